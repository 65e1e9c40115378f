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
#ifndef itkShearWarpLanesSSE2_h
#define itkShearWarpLanesSSE2_h

/* Vectors of 128 bits on x86-64. */

#define SHEARWARP_X86(operation) _mm_##operation

#include "LanesCommon.h"

#include "LanesPairs.h"
#include "LanesX86.h"

namespace Lanes
{
constexpr int SumRows = 4; // of two vectors each, in half of the registers

// clang-format off
inline Quad PackBytes(Short v) { return As<Quad>(_mm_packus_epi16(As<__m128i>(v & Set(0xFF)), _mm_setzero_si128())); }
inline Short MultiplyHighRounded(Short a, Short b)
{
  const __m128i product = _mm_srli_epi16(_mm_mullo_epi16(As<__m128i>(a), As<__m128i>(b)), 14);
  const __m128i low = _mm_avg_epu16(product, _mm_setzero_si128());
  const __m128i high = _mm_mulhi_epi16(As<__m128i>(a), As<__m128i>(b));
  return As<Short>(_mm_add_epi16(_mm_add_epi16(high, high), low));
}
inline Short MaximumUnsigned(Short maximum, Short v)
{
  return Add(As<Short>(_mm_subs_epu16(As<__m128i>(maximum), As<__m128i>(v))), v);
}
inline Short MinimumUnsigned(Short minimum, Short v)
{
  return Subtract(minimum, As<Short>(_mm_subs_epu16(As<__m128i>(minimum), As<__m128i>(v))));
}
inline Short PackColumns(Sums sums) { return PackEvenOdd(sums.low, sums.high); }
inline void Stream(void * p, X86 v) { _mm_stream_si128(static_cast<__m128i *>(p), v); }

template <typename TMask>
bool AreAll(TMask mask) { return _mm_movemask_epi8(As<__m128i>(mask)) == 0xFFFF; }
inline bool AreFinite(Single v) { return _mm_movemask_ps(As<Single>(v * SetSingle(0) == 0)) == 0xF; }
inline std::uint32_t GetSigns(Float mask) { return static_cast<std::uint32_t>(_mm_movemask_ps(mask)); }
template <std::ptrdiff_t VCount>
std::uint32_t FindLabel(const std::uint8_t * p, std::uint8_t label)
{
  long long bytes = 0;
  __builtin_memcpy(&bytes, p, VCount);
  const auto found = As<Quad>(QuadLong{ bytes, 0 }) == label;
  const auto equal = static_cast<std::uint32_t>(_mm_movemask_epi8(As<__m128i>(found)));
  return (label == 0 ? ~equal : equal) & ((1U << VCount) - 1);
}
// clang-format on
} // namespace Lanes

#include "Lanes128.h"
#include "LanesSelect.h"

#endif
