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
#ifndef itkShearWarpLanesARM64_h
#define itkShearWarpLanesARM64_h

/* Vectors of 128 bits on ARM64. */

#include "LanesCommon.h"

namespace Lanes
{
constexpr int SumRows = 8; // of two vectors each, in half of the registers

// clang-format off
inline Quad PackBytes(Short v) { return As<Quad>(vcombine_s8(vmovn_s16(As<int16x8_t>(v)), vdup_n_s8(0))); }
inline Short MultiplyHighRounded(Short a, Short b)
{
  return As<Short>(vqrdmulhq_s16(As<int16x8_t>(a), As<int16x8_t>(b)));
}
inline Short Maximum(Short maximum, Short v) { return As<Short>(vmaxq_s16(As<int16x8_t>(maximum), As<int16x8_t>(v))); }
inline Short Minimum(Short minimum, Short v) { return As<Short>(vminq_s16(As<int16x8_t>(minimum), As<int16x8_t>(v))); }
inline Short MaximumUnsigned(Short maximum, Short v)
{
  return As<Short>(vmaxq_u16(As<uint16x8_t>(maximum), As<uint16x8_t>(v)));
}
inline Short MinimumUnsigned(Short minimum, Short v)
{
  return As<Short>(vminq_u16(As<uint16x8_t>(minimum), As<uint16x8_t>(v)));
}

/** Halves are the halves of the vectors. */
inline Sums AddColumns(Sums sums, Short a, Short b, Short weights)
{
  const auto aa = As<int16x8_t>(a);
  const auto bb = As<int16x8_t>(b);
  const auto w = vget_low_s16(As<int16x8_t>(weights));
  const auto low = vmlal_lane_s16(As<int32x4_t>(sums.low), vget_low_s16(aa), w, 0);
  const auto high = vmlal_high_lane_s16(As<int32x4_t>(sums.high), aa, w, 0);
  return { As<Int>(vmlal_lane_s16(low, vget_low_s16(bb), w, 1)), As<Int>(vmlal_high_lane_s16(high, bb, w, 1)) };
}
inline Sums AddRows(Sums sums, Short above, Short below, Short weights)
{
  return AddColumns(sums, above, below, weights);
}
inline Short PackColumns(Sums sums)
{
  return As<Short>(vshrn_high_n_s32(vshrn_n_s32(As<int32x4_t>(sums.low), 15), As<int32x4_t>(sums.high), 15));
}
inline Short PackRows(Sums sums) { return PackColumns(sums); }
// clang-format on
} // namespace Lanes

#include "Lanes128.h"
#include "LanesScalarBits.h"
#include "LanesSelect.h"

#endif
