# The engine, which needs nothing of ITK: ShearWarpMIP_ENGINE_SRCS, their options, and ShearWarpMIP_ENGINE_OPTIONS, with
# which the target must be compiled. ShearWarpMIP_INSTRUCTION_SET_SRCS are for processors that have an instruction set.

set(
  ShearWarpMIP_ENGINE_SRCS
  Buffer.cxx
  Engine.cxx
  Exact.cxx
  Geometry.cxx
  PartRecords.cxx
  PreparedVolume.cxx
  Projector.cxx
  ProjectorMerge.cxx
  ProjectorTiles.cxx
  Rule.cxx
  kernels/InstructionSets.cxx
  kernels/Portable.cxx
  kernels/Views.cxx
)
list(TRANSFORM ShearWarpMIP_ENGINE_SRCS PREPEND ${CMAKE_CURRENT_LIST_DIR}/)
set(kernels ${CMAKE_CURRENT_LIST_DIR}/kernels)

include(CheckCXXCompilerFlag)
include(CheckCXXSourceCompiles)

option(ShearWarpMIP_USE_VECTOR_EXTENSIONS "Build kernels with the vectors of g++ and clang, AVX2 and AVX-512." ON)
mark_as_advanced(ShearWarpMIP_USE_VECTOR_EXTENSIONS)

# kernels over the vectors of g++ and clang
check_cxx_source_compiles(
  "#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error
#endif
using Int [[gnu::vector_size(16)]] = int;
using Float [[gnu::vector_size(16)]] = float;
int main() { return __builtin_convertvector(Float{}, Int)[0]; }"
  ShearWarpMIP_HAS_VECTORS
)
if(ShearWarpMIP_USE_VECTOR_EXTENSIONS AND ShearWarpMIP_HAS_VECTORS)
  list(APPEND ShearWarpMIP_ENGINE_SRCS ${kernels}/Generic.cxx)
  # vectors of 256 bits are not in the interface
  set_source_files_properties(${kernels}/Generic.cxx PROPERTIES COMPILE_OPTIONS "-Wno-psabi")
  list(APPEND kernel_definitions ShearWarpMIP_HAS_GENERIC_KERNELS)
endif()

# kernels for instruction sets that a processor may or may not have are chosen at run time
set(ShearWarpMIP_INSTRUCTION_SET_SRCS)
if(ShearWarpMIP_USE_VECTOR_EXTENSIONS AND CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
  check_cxx_source_compiles(
    "#ifndef __x86_64__
#error
#endif
int main() { return 0; }"
    ShearWarpMIP_IS_X86_64
  )
endif()
if(ShearWarpMIP_USE_VECTOR_EXTENSIONS AND ShearWarpMIP_IS_X86_64)
  set(ShearWarpMIP_INSTRUCTION_SET_SRCS ${kernels}/AVX2.cxx ${kernels}/AVX512.cxx)
  set_source_files_properties(${kernels}/AVX2.cxx PROPERTIES COMPILE_OPTIONS "-mavx2")
  set_source_files_properties(
    ${kernels}/AVX512.cxx
    PROPERTIES
      COMPILE_OPTIONS
        "-mavx512f;-mavx512bw;-mavx512dq;-mavx512vl;-mavx512vnni;-Wno-uninitialized;-Wno-maybe-uninitialized"
  )
  list(APPEND ShearWarpMIP_ENGINE_SRCS ${ShearWarpMIP_INSTRUCTION_SET_SRCS})
  list(APPEND kernel_definitions ShearWarpMIP_HAS_X86_KERNELS)
endif()
set_source_files_properties(${kernels}/InstructionSets.cxx PROPERTIES COMPILE_DEFINITIONS "${kernel_definitions}")

# the same bits on every machine: no fused multiply-add. More loops become vectors: comparisons that the source does not
# make are allowed, and errno is not set
set(options -ffp-contract=off -fno-trapping-math -fno-math-errno)
if(CMAKE_CXX_COMPILER_FRONTEND_VARIANT STREQUAL "MSVC")
  # clang-cl ignores them otherwise
  list(TRANSFORM options PREPEND /clang:)
endif()
set(ShearWarpMIP_ENGINE_OPTIONS "$<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:${options}>")

# GCC 12 moves 64-bit integers through an MMX register and does not end its use (seen with -march=x86-64-v2), so that
# the caller's next long double would be wrong
check_cxx_compiler_flag(-mno-mmx ShearWarpMIP_HAS_NO_MMX_OPTION)
if(ShearWarpMIP_HAS_NO_MMX_OPTION AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  list(APPEND ShearWarpMIP_ENGINE_OPTIONS -mno-mmx)
endif()
