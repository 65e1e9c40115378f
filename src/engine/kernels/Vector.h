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

/* Included by the file of each instruction set, within its anonymous namespace, after its struct Lanes and
 * Scalar.h, so that the linker cannot share what is compiled here. For the same reason nothing here
 * may call an inline function or a template of another header at run time.
 *
 * Lanes has the operations on vectors of 16-bit and 32-bit integers, float and double that are written differently for
 * each instruction set. */

template <typename TNumber>
struct ExactVector;
template <>
struct ExactVector<float> : Lanes
{
  using Type = Lanes::Float;
  static constexpr int Count = Lanes::FloatCount;

  static Type
  Set(float v)
  {
    return SetFloat(v);
  }
  template <typename TMask>
  static std::uint32_t
  GetBits(TMask lanes)
  {
    return GetSigns(reinterpret_cast<Type>(lanes));
  }
};
template <>
struct ExactVector<double> : Lanes
{
  using Type = Lanes::Double;
  static constexpr int Count = Lanes::WarpCount;

  static Type
  Set(double v)
  {
    return SetDouble(v);
  }
  template <typename TMask>
  static std::uint32_t
  GetBits(TMask lanes)
  {
    return GetSigns(reinterpret_cast<Type>(lanes));
  }
};

/** The bits of those numbers that are not 0 but -1. */
inline std::uint32_t
FindSet(const std::int16_t (&flags)[CellColumns])
{
  return Lanes::FindSet(flags);
}

/** The place of the lowest bit of \a v. */
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

#include "VectorSampling.h"

#include "VectorPreparation.h"
#include "VectorProjection.h"
#include "VectorWarp.h"

template <typename TPixel>
constexpr Kernels<TPixel> VectorKernels{ Lanes::Name,           ProjectBlock<TPixel>,
                                         IsAnyBelow<TPixel>,    FindBlockExtrema<TPixel>,
                                         WarpRow<TPixel>,       TransposeSlice<TPixel>,
                                         EvaluateParts<TPixel>, SearchSlab<TPixel> };

#endif
