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
#ifndef itkShearWarpLanesAVX512_h
#define itkShearWarpLanesAVX512_h

/* Vectors of 512 bits on x86-64: AVX-512 F, BW, DQ, VL and VNNI. */

#define SHEARWARP_X86(operation) _mm512_##operation
#define SHEARWARP_HAS_MASKS

#include "LanesCommon.h"
#include "LanesX86.h"

namespace Lanes
{
constexpr int SumRows = 8; // of two vectors each, in half of the registers

// clang-format off
inline Short Load(const unsigned char * p) { return As<Short>(_mm512_cvtepu8_epi16(LoadVector<__m256i>(p))); }
inline Short Load(const signed char * p) { return As<Short>(_mm512_cvtepi8_epi16(LoadVector<__m256i>(p))); }
inline void Store(unsigned char * p, Short v) { StoreVector(p, _mm512_cvtepi16_epi8(As<X86>(v))); }
inline void Store(signed char * p, Short v) { StoreVector(p, _mm512_cvtepi16_epi8(As<X86>(v))); }

inline Short MultiplyHighRounded(Short a, Short b) { return As<Short>(_mm512_mulhrs_epi16(As<X86>(a), As<X86>(b))); }
inline Short MaximumUnsigned(Short maximum, Short v)
{
  return As<Short>(_mm512_max_epu16(As<X86>(maximum), As<X86>(v)));
}
inline Short MinimumUnsigned(Short minimum, Short v)
{
  return As<Short>(_mm512_min_epu16(As<X86>(minimum), As<X86>(v)));
}
inline Short PackColumns(Sums sums)
{
  const auto even = As<X86>(As<UnsignedInt>(sums.low) >> 15);
  const auto odd = As<X86>(As<UnsignedInt>(sums.high) << 1);
  return As<Short>(_mm512_mask_blend_epi16(0xAAAAAAAA, even, odd));
}
inline void Stream(void * p, X86 v) { _mm512_stream_si512(static_cast<__m512i *>(p), v); }
inline Double SquareRoot(Double v) { return _mm512_sqrt_pd(v); }

template <typename TMask>
bool AreAll(TMask mask) { return _mm512_movepi16_mask(As<X86>(mask)) == 0xFFFFFFFF; }
inline bool AreFinite(Single v) { return _mm256_movemask_ps(As<Single>(v * SetSingle(0) == 0)) == 0xFF; }
inline std::uint32_t GetSigns(Float mask) { return _mm512_movepi32_mask(As<X86>(mask)); }
inline std::uint32_t GetSigns(Double mask) { return _mm512_movepi64_mask(As<X86>(mask)); }
/** Returns a bit for each of CellColumns numbers that is -1; the other numbers are 0. */
inline std::uint32_t FindSet(const std::int16_t * p) { return _mm512_movepi16_mask(LoadVector<X86>(p)); }
/** Returns a bit for each of VCount bytes that is \a label or, if \a label is 0, not 0. */
template <std::ptrdiff_t VCount>
std::uint32_t FindLabel(const std::uint8_t * p, std::uint8_t label)
{
  std::uint32_t equal;
  if constexpr (VCount == 32)
  {
    equal = _mm256_cmpeq_epi8_mask(LoadVector<__m256i>(p), _mm256_set1_epi8(static_cast<char>(label)));
  }
  else
  {
    static_assert(VCount == 16, "the lanes of floats");
    equal = _mm_cmpeq_epi8_mask(LoadVector<__m128i>(p), _mm_set1_epi8(static_cast<char>(label)));
  }
  return (label == 0 ? ~equal : equal) & static_cast<std::uint32_t>((std::uint64_t{ 1 } << VCount) - 1);
}

/** The lanes of b that have a bit, the other lanes of a. */
inline Short Select(Short a, Short b, std::uint32_t lanes)
{
  return As<Short>(_mm512_mask_blend_epi16(lanes, As<X86>(a), As<X86>(b)));
}
inline Float Select(Float a, Float b, std::uint32_t lanes)
{
  return _mm512_mask_blend_ps(static_cast<__mmask16>(lanes), a, b);
}
inline Int Select(Int a, Int b, std::uint32_t lanes)
{
  return As<Int>(_mm512_mask_blend_epi32(static_cast<__mmask16>(lanes), As<X86>(a), As<X86>(b)));
}

/** Returns samples that fade to \a to by \a factor times \a factors. */
template <bool VIsUnsigned>
Short Fade(Short v, const float * factors, float factor, float to)
{
  const auto fade = [factor, to](__m256i half, const float * p)
  {
    constexpr int downward = _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC;
    const Float   from = _mm512_cvtepi32_ps(VIsUnsigned ? _mm512_cvtepu16_epi32(half) : _mm512_cvtepi16_epi32(half));
    const Float   product = SetFloat(factor) * Load(p);
    const Float   faded = SetFloat(to) + (from - SetFloat(to)) * product;
    return _mm512_cvtepi32_epi16(_mm512_cvt_roundps_epi32(faded + SetFloat(0.5f), downward));
  };
  const __m256i low = fade(_mm512_castsi512_si256(As<X86>(v)), factors);
  const __m256i high = fade(_mm512_extracti64x4_epi64(As<X86>(v), 1), factors + 16);
  return As<Short>(_mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1));
}

/** Stores the low bits of each element. */
template <typename TPixel>
void StoreLow(TPixel * p, Index v)
{
  const auto    all = As<__m256i>(v);
  const __m128i low = sizeof(TPixel) == 1 ? _mm256_cvtepi32_epi8(all) : _mm256_cvtepi32_epi16(all);
  __builtin_memcpy(p, &low, 8 * sizeof(TPixel));
}
/** Loads 32 bits at each index, in units of VSize bytes. */
template <int VSize>
Index Gather(const void * p, Index v)
{
  return As<Index>(_mm256_i32gather_epi32(static_cast<const int *>(p), As<__m256i>(v), VSize));
}
inline Single GatherSingle(const float * p, Index v) { return _mm256_i32gather_ps(p, As<__m256i>(v), 4); }
inline Double IndexToDouble(Index v) { return _mm512_cvtepi32_pd(As<__m256i>(v)); }
inline Double SingleToDouble(Single v) { return _mm512_cvtps_pd(v); }
// clang-format on
} // namespace Lanes

#include "LanesSelect.h"

#endif
