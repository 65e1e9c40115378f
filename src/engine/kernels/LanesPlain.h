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
#ifndef itkShearWarpLanesPlain_h
#define itkShearWarpLanesPlain_h

/* Vectors of 128 bits, with no more than the compiler offers for every processor. */

#include "LanesCommon.h"
#include "LanesPairs.h"

namespace Lanes
{
constexpr int SumRows = 8; // of two vectors each

// clang-format off
inline Quad PackBytes(Short v)
{
  return SHEARWARP_SHUFFLE(As<Quad>(v), As<Quad>(v), 0, 2, 4, 6, 8, 10, 12, 14, 0, 2, 4, 6, 8, 10, 12, 14);
}
inline Short MultiplyHighRounded(Short a, Short b)
{
  const Int half = SetInt(1 << 14);
  return PackEvenOdd(GetEven(a) * GetEven(b) + half, GetOdd(a) * GetOdd(b) + half);
}
inline Short Maximum(Short maximum, Short v) { return v > maximum ? v : maximum; }
inline Short Minimum(Short minimum, Short v) { return v < minimum ? v : minimum; }
inline Short MaximumUnsigned(Short maximum, Short v)
{
  return As<UnsignedShort>(v) > As<UnsignedShort>(maximum) ? v : maximum;
}
inline Short MinimumUnsigned(Short minimum, Short v)
{
  return As<UnsignedShort>(v) < As<UnsignedShort>(minimum) ? v : minimum;
}

/** Halves are the even and the odd columns. */
inline Sums AddColumns(Sums sums, Short a, Short b, Short weights)
{
  const Int weightOfA = GetEven(weights);
  const Int weightOfB = GetOdd(weights);
  return { sums.low + GetEven(a) * weightOfA + GetEven(b) * weightOfB,
           sums.high + GetOdd(a) * weightOfA + GetOdd(b) * weightOfB };
}
inline Sums AddRows(Sums sums, Short above, Short below, Short weights)
{
  return AddColumns(sums, above, below, weights);
}
inline Short PackColumns(Sums sums) { return PackEvenOdd(sums.low, sums.high); }
inline Short PackRows(Sums sums) { return PackColumns(sums); }
// clang-format on
} // namespace Lanes

#include "Lanes128.h"
#include "LanesScalarBits.h"
#include "LanesSelect.h"

#endif
