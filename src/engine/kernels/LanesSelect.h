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
#ifndef itkShearWarpLanesSelect_h
#define itkShearWarpLanesSelect_h

/* What is made of the operations before. The header of each instruction set includes this header last. */

namespace Lanes
{
// clang-format off
#ifndef SHEARWARP_HAS_MASKS
/** The lanes of b that have a bit, the other lanes of a. */
inline Short Select(Short a, Short b, std::uint32_t lanes)
{
  constexpr unsigned short values[] = { 1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768 };
  const Short bits = Load(values);
  return (Set(static_cast<int>(lanes)) & bits) == bits ? b : a;
}
inline Int GetMask(std::uint32_t lanes)
{
  constexpr std::int32_t values[] = { 1, 2, 4, 8, 16, 32, 64, 128 };
  const Int bits = Load(values);
  return (SetInt(static_cast<int>(lanes)) & bits) == bits;
}
inline Float Select(Float a, Float b, std::uint32_t lanes) { return GetMask(lanes) ? b : a; }
inline Int Select(Int a, Int b, std::uint32_t lanes) { return GetMask(lanes) ? b : a; }
#endif

/** Returns the ranks of \a better, the better one of \a before and \a sample: the lower rank if both are equal. */
inline Short SelectLowestRank(Short before, Short sample, Short better, Short rankBefore, Short rank)
{
  const Short lowest = sample == better ? Minimum(rankBefore, rank) : rankBefore;
  return before == better ? lowest : rank;
}
inline Int SelectLowestRank(Float before, Float sample, Float better, Int rankBefore, Int rank)
{
  const Int lowest = sample == better ? MinimumInt(rankBefore, rank) : rankBefore;
  return before == better ? lowest : rank;
}

inline bool AreEqual(Short a, Short b) { return AreAll(a == b); }
inline bool AreEqual(Float a, Float b) { return AreAll(a == b); }
inline bool AreWithin(Double v, double begin, double end)
{
  return GetSigns(As<Double>((v >= SetDouble(begin)) & (v < SetDouble(end)))) == (1U << WarpCount) - 1;
}
// clang-format on
} // namespace Lanes

#endif
