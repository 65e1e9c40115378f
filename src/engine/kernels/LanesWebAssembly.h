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
#ifndef itkShearWarpLanesWebAssembly_h
#define itkShearWarpLanesWebAssembly_h

/* Vectors of 128 bits in WebAssembly. */

#include "LanesCommon.h"
#include "LanesPairs.h"

namespace Lanes
{
constexpr int SumRows = 4; // of two vectors each: x86-64 has registers for half of eight

// clang-format off
inline v128_t V(Short v) { return As<v128_t>(v); }
inline Quad PackBytes(Short v)
{
  return As<Quad>(wasm_u8x16_narrow_i16x8(V(v & Set(0xFF)), V(Short{})));
}
inline Short MultiplyHighRounded(Short a, Short b) { return As<Short>(wasm_i16x8_q15mulr_sat(V(a), V(b))); }
inline Short Maximum(Short maximum, Short v) { return As<Short>(wasm_i16x8_max(V(maximum), V(v))); }
inline Short Minimum(Short minimum, Short v) { return As<Short>(wasm_i16x8_min(V(minimum), V(v))); }
inline Short MaximumUnsigned(Short maximum, Short v) { return As<Short>(wasm_u16x8_max(V(maximum), V(v))); }
inline Short MinimumUnsigned(Short minimum, Short v) { return As<Short>(wasm_u16x8_min(V(minimum), V(v))); }

/** Adds the products of two neighbours. */
inline Int AddPairProducts(Int sum, Short a, Short b) { return sum + As<Int>(wasm_i32x4_dot_i16x8(V(a), V(b))); }
/** Halves are the even and the odd columns. */
inline Sums AddColumns(Sums sums, Short left, Short right, Short weights)
{
  return { AddPairProducts(sums.low, left, weights), AddPairProducts(sums.high, right, weights) };
}
/** Halves are the halves of interleaved vectors. */
inline Sums AddRows(Sums sums, Short above, Short below, Short weights)
{
  const Short low = SHEARWARP_SHUFFLE(above, below, 0, 8, 1, 9, 2, 10, 3, 11);
  const Short high = SHEARWARP_SHUFFLE(above, below, 4, 12, 5, 13, 6, 14, 7, 15);
  return { AddPairProducts(sums.low, low, weights), AddPairProducts(sums.high, high, weights) };
}
inline Short PackColumns(Sums sums) { return PackEvenOdd(sums.low, sums.high); }
inline Short PackRows(Sums sums)
{
  return As<Short>(wasm_i16x8_narrow_i32x4(As<v128_t>(sums.low >> 15), As<v128_t>(sums.high >> 15)));
}
// clang-format on
} // namespace Lanes

#include "Lanes128.h"
#include "LanesScalarBits.h"
#include "LanesSelect.h"

#endif
