/*=========================================================================
 *
 *  Copyright NumFOCUS
 *
 *  Licensed under the Apache License, Version 2.0 (the "License");
 *  you may not use this file except in compliance with the License.
 *  You may obtain a copy of the License at
 *
 *         https://www.apache.org/licenses/LICENSE-2.0.txt
 *
 *  Unless required by applicable law or agreed to in writing, software
 *  distributed under the License is distributed on an "AS IS" BASIS,
 *  WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
 *  See the License for the specific language governing permissions and
 *  limitations under the License.
 *
 *=========================================================================*/
#ifndef itkShearWarpVector_h
#define itkShearWarpVector_h

/* The kernels of one instruction set. A file with an instruction set defines these macros, and includes this header:
 *
 * SHEARWARP_INSTRUCTION_SET  its name
 * SHEARWARP_VECTOR_BYTES     the length of a vector
 * SHEARWARP_LANES            the header of its operations on vectors, in namespace Lanes
 * SHEARWARP_GET_KERNELS      the function that returns its kernels
 *
 * The headers below are included within an anonymous namespace, so that the linker cannot share their code with another
 * instruction set. For the same reason, they may not call an inline function or a template of another header at run
 * time. */

#include "InstructionSets.h"

#if defined(__SSE2__)
#  include <immintrin.h>
#elif defined(__aarch64__)
#  include <arm_neon.h>
#elif defined(__wasm_simd128__)
#  include <wasm_simd128.h>
#endif

#include <math.h>

#include <type_traits>

#define SHEARWARP_UNROLL _Pragma("GCC unroll 18")
#define SHEARWARP_INLINE __attribute__((always_inline))
#define SHEARWARP_RESTRICT __restrict

namespace itk::ShearWarp
{
namespace // NOLINT(misc-anonymous-namespace-in-header)
{
#include SHEARWARP_LANES

#include "Scalar.h"

/** Exact.h computes with vectors of one of these types. */
template <typename TNumber>
struct ExactVector
{
  using Type = std::conditional_t<std::is_same_v<TNumber, float>, Lanes::Float, Lanes::Double>;
  static constexpr int Count = sizeof(Type) / sizeof(TNumber);

  static Type
  Load(const TNumber * p)
  {
    return Lanes::Load(p);
  }
  static void
  Store(TNumber * p, Type v)
  {
    Lanes::Store(p, v);
  }
  static Type
  Set(TNumber v)
  {
    return v - Type{};
  }
  static Type
  SquareRoot(Type v)
  {
    return Lanes::SquareRoot(v);
  }
  /** Returns a bit for each lane of a mask. */
  template <typename TMask>
  static std::uint32_t
  GetBits(TMask lanes)
  {
    return Lanes::GetSigns(reinterpret_cast<Type>(lanes));
  }
};

/** Returns a bit for each flag that is -1; the other flags are 0. */
inline std::uint32_t
FindSet(const std::int16_t (&flags)[CellColumns])
{
  return Lanes::FindSet(flags);
}

/** Returns the place of the lowest bit of \a v. */
inline int
FindLowest(std::uint32_t v)
{
  return __builtin_ctz(v);
}

inline void
CopyBytes(void * to, const void * from, std::size_t bytes)
{
  __builtin_memcpy(to, from, bytes);
}

inline void
PrefetchVoxel(const void * p)
{
  __builtin_prefetch(p);
}

#include "Exact.h"

#include "RowProjection.h"

#include "VectorSampling.h"

#include "VectorTiles.h"

#include "VectorSums.h"

#include "VectorProjection.h"

#include "VectorPreparation.h"
#include "VectorWarp.h"

/** Whether kernels of a pixel type are written for lanes. */
template <typename TPixel>
constexpr bool HasLanes = std::is_same_v<TPixel, float> || sizeof(TPixel) <= 2;

/** Other types have the portable kernels; the compiler makes vectors of the slowest ones. */
template <typename TPixel>
Kernels<TPixel>
MakeKernels()
{
  if constexpr (HasLanes<TPixel>)
  {
    return {
      Lanes::Name,     ProjectBlock<TPixel>,   AddBlock<TPixel>,         IsAnyBelow<TPixel>, FindBlockExtrema<TPixel>,
      WarpRow<TPixel>, TransposeSlice<TPixel>, EvaluateSegments<TPixel>, SearchLayer<TPixel>
    };
  }
  else
  {
    Kernels<TPixel> kernels = GetPortableKernels<TPixel>();
    kernels.instructionSet = Lanes::Name;
    kernels.projectBlock = ProjectBlockByRows<TPixel>;
    kernels.addBlock = ProjectBlockByRows<TPixel>;
    kernels.findBlockExtrema = FindBlockExtremaByRows<TPixel>;
    return kernels;
  }
}

template <typename... TPixels>
KernelsForEach<TPixels...>
MakeKernelsForEach()
{
  return { MakeKernels<TPixels>()... };
}
} // namespace

const VectorKernels &
SHEARWARP_GET_KERNELS() // NOLINT(misc-definitions-in-headers)
{
  static const VectorKernels kernels = MakeKernelsForEach<SHEARWARP_PIXEL_TYPES>();
  return kernels;
}
} // namespace itk::ShearWarp

#endif
