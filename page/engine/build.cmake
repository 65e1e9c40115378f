# Builds the engine of web pages with the project, where clang has what it needs for WebAssembly, or takes the one that
# ShearWarpMIP_PAGE_ENGINE_FILE names. Then ShearWarpMIP_PAGE_ENGINE is the path of shear-warp.wasm, and
# ShearWarpMIP_PAGE_ENGINE_BYTES the path of its gzipped bytes, as the initializers of a C++ array.

option(ShearWarpMIP_BUILD_PAGE_ENGINE "Build the engine for pages that hold a volume." ON)
set(ShearWarpMIP_PAGE_ENGINE_FILE "" CACHE FILEPATH "The engine for such pages, if it is built already.")
mark_as_advanced(ShearWarpMIP_PAGE_ENGINE_FILE)
if(NOT ShearWarpMIP_BUILD_PAGE_ENGINE)
  return()
endif()

find_program(ShearWarpMIP_WASM_COMPILER clang++)
mark_as_advanced(ShearWarpMIP_WASM_COMPILER)
set(folder ${CMAKE_CURRENT_BINARY_DIR}/page-engine)
if(NOT ShearWarpMIP_PAGE_ENGINE_FILE AND NOT ShearWarpMIP_HAS_WASM)
  file(WRITE ${folder}/check.cxx "#include <string>\nstd::string text(\"abc\");\n")
  execute_process(
    COMMAND
      ${ShearWarpMIP_WASM_COMPILER} --target=wasm32-wasi -fno-exceptions -mexec-model=reactor ${folder}/check.cxx -o
      ${folder}/check.wasm
    RESULT_VARIABLE missing
    OUTPUT_QUIET
    ERROR_QUIET
  )
  if(NOT missing EQUAL 0)
    message(
      STATUS
      "The program cannot write pages that hold a volume. In Debian, they need clang, lld, wasi-libc, "
      "libc++-dev-wasm32 and libclang-rt-dev-wasm32."
    )
    return()
  endif()
  set(ShearWarpMIP_HAS_WASM ON CACHE INTERNAL "Whether clang makes WebAssembly.")
endif()

set(ShearWarpMIP_PAGE_ENGINE ${folder}/shear-warp.wasm)
set(ShearWarpMIP_PAGE_ENGINE_BYTES ${folder}/PageEngineBytes.h)
set(source ${CMAKE_CURRENT_LIST_DIR})
file(
  GLOB files
  CONFIGURE_DEPENDS
  ${source}/*.cxx
  ${source}/*.h
  ${source}/../../include/itkShearWarp*.h
  ${source}/../../src/engine/*
  ${source}/../../src/engine/kernels/*.*
)
if(ShearWarpMIP_PAGE_ENGINE_FILE)
  configure_file(${ShearWarpMIP_PAGE_ENGINE_FILE} ${ShearWarpMIP_PAGE_ENGINE} COPYONLY)
else()
  # flags of the environment are for other processors
  add_custom_command(
    OUTPUT ${ShearWarpMIP_PAGE_ENGINE}
    COMMAND
      ${CMAKE_COMMAND} -E env --unset=CXXFLAGS --unset=LDFLAGS ${CMAKE_COMMAND} -S ${source} -B ${folder} -G
      ${CMAKE_GENERATOR} -DCMAKE_BUILD_TYPE=Release -DCMAKE_MAKE_PROGRAM=${CMAKE_MAKE_PROGRAM}
      -DCMAKE_CXX_COMPILER=${ShearWarpMIP_WASM_COMPILER}
    COMMAND ${CMAKE_COMMAND} --build ${folder} --parallel 2
    COMMAND ${CMAKE_COMMAND} -E touch ${ShearWarpMIP_PAGE_ENGINE}
    DEPENDS ${files} ${source}/CMakeLists.txt
    VERBATIM
  )
endif()
add_custom_command(
  OUTPUT ${ShearWarpMIP_PAGE_ENGINE_BYTES}
  COMMAND gzip --best --no-name --force --keep ${ShearWarpMIP_PAGE_ENGINE}
  COMMAND
    ${CMAKE_COMMAND} -DINPUT=${ShearWarpMIP_PAGE_ENGINE}.gz -DOUTPUT=${ShearWarpMIP_PAGE_ENGINE_BYTES} -P
    ${source}/bytes.cmake
  DEPENDS ${ShearWarpMIP_PAGE_ENGINE} ${source}/bytes.cmake
  VERBATIM
)
