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
#ifndef itkShearWarpLanesAVX2_h
#define itkShearWarpLanesAVX2_h

/* Vectors of 256 bits on x86-64. */

#define SHEARWARP_X86(operation) _mm256_##operation

#include "LanesCommon.h"
#include "LanesX86.h"

namespace Lanes
{
constexpr int SumRows = 4; // of two vectors each, in half of the registers

// clang-format off
inline Short Load(const unsigned char * p) { return As<Short>(_mm256_cvtepu8_epi16(LoadVector<__m128i>(p))); }
inline Short Load(const signed char * p) { return As<Short>(_mm256_cvtepi8_epi16(LoadVector<__m128i>(p))); }
inline __m128i GetLow(Short v) { return _mm256_castsi256_si128(As<X86>(v)); }
inline __m128i GetHigh(Short v) { return _mm256_extracti128_si256(As<X86>(v), 1); }
inline void Store(unsigned char * p, Short v) { StoreVector(p, _mm_packus_epi16(GetLow(v), GetHigh(v))); }
inline void Store(signed char * p, Short v) { StoreVector(p, _mm_packs_epi16(GetLow(v), GetHigh(v))); }

inline Short MultiplyHighRounded(Short a, Short b) { return As<Short>(_mm256_mulhrs_epi16(As<X86>(a), As<X86>(b))); }
inline Short MaximumUnsigned(Short maximum, Short v)
{
  return As<Short>(_mm256_max_epu16(As<X86>(maximum), As<X86>(v)));
}
inline Short MinimumUnsigned(Short minimum, Short v)
{
  return As<Short>(_mm256_min_epu16(As<X86>(minimum), As<X86>(v)));
}
inline Short PackColumns(Sums sums)
{
  const auto even = As<X86>(As<UnsignedInt>(sums.low) >> 15);
  const auto odd = As<X86>(As<UnsignedInt>(sums.high) << 1);
  return As<Short>(_mm256_blend_epi16(even, odd, 0xAA));
}
inline void Stream(void * p, X86 v) { _mm256_stream_si256(static_cast<__m256i *>(p), v); }
inline Double SquareRoot(Double v) { return _mm256_sqrt_pd(v); }

/** Bytes of packed vectors have another order: quarters 0 and 2, then 1 and 3. */
inline X86 OrderQuarters(X86 v) { return As<X86>(_mm256_permute4x64_epi64(v, 0xD8)); }

template <typename TMask>
bool AreAll(TMask mask) { return _mm256_movemask_epi8(As<X86>(mask)) == -1; }
inline bool AreFinite(Single v) { return _mm_movemask_ps(As<Single>(v * SetSingle(0) == 0)) == 0xF; }
inline std::uint32_t GetSigns(Float mask) { return static_cast<std::uint32_t>(_mm256_movemask_ps(mask)); }
inline std::uint32_t GetSigns(Double mask) { return static_cast<std::uint32_t>(_mm256_movemask_pd(mask)); }
/** Returns a bit for each of CellColumns numbers that is -1; the other numbers are 0. */
inline std::uint32_t FindSet(const std::int16_t * p)
{
  const auto packed = As<X86>(_mm256_packs_epi16(LoadVector<X86>(p), LoadVector<X86>(p + ShortCount)));
  return static_cast<std::uint32_t>(_mm256_movemask_epi8(OrderQuarters(packed)));
}
/** Returns a bit for each of VCount bytes that is \a label or, if \a label is 0, not 0. */
template <std::ptrdiff_t VCount>
std::uint32_t FindLabel(const std::uint8_t * p, std::uint8_t label)
{
  Quad bytes;
  if constexpr (VCount == sizeof(Quad))
  {
    bytes = LoadVector<Quad>(p);
  }
  else
  {
    long long low = 0;
    __builtin_memcpy(&low, p, VCount);
    bytes = As<Quad>(QuadLong{ low, 0 });
  }
  const auto equal = static_cast<std::uint32_t>(_mm_movemask_epi8(As<__m128i>(bytes == label)));
  return (label == 0 ? ~equal : equal) & ((1U << VCount) - 1);
}

/** Returns samples that fade to \a to by \a factor times \a factors. */
template <bool VIsUnsigned>
Short Fade(Short v, const float * factors, float factor, float to)
{
  const auto fade = [factor, to](__m128i half, const float * p)
  {
    const Float from = _mm256_cvtepi32_ps(VIsUnsigned ? _mm256_cvtepu16_epi32(half) : _mm256_cvtepi16_epi32(half));
    const Float product = SetFloat(factor) * Load(p);
    const Float faded = SetFloat(to) + (from - SetFloat(to)) * product;
    return _mm256_cvttps_epi32(_mm256_floor_ps(faded + SetFloat(0.5f)));
  };
  const __m256i low = fade(GetLow(v), factors);
  const __m256i high = fade(GetHigh(v), factors + 8);
  const auto    packed = VIsUnsigned ? _mm256_packus_epi32(low, high) : _mm256_packs_epi32(low, high);
  return As<Short>(OrderQuarters(As<X86>(packed)));
}

/** Stores the low bits of each element. */
template <typename TPixel>
void StoreLow(TPixel * p, Index v)
{
  const __m128i low = sizeof(TPixel) == 1 ? _mm_setr_epi8(0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1)
                                          : _mm_setr_epi8(0, 1, 4, 5, 8, 9, 12, 13, -1, -1, -1, -1, -1, -1, -1, -1);
  const __m128i pixels = _mm_shuffle_epi8(As<__m128i>(v), low);
  __builtin_memcpy(p, &pixels, 4 * sizeof(TPixel));
}
/** Loads 32 bits at each index, in units of VSize bytes. */
template <int VSize>
Index Gather(const void * p, Index v)
{
  return As<Index>(_mm_i32gather_epi32(static_cast<const int *>(p), As<__m128i>(v), VSize));
}
inline Single GatherSingle(const float * p, Index v) { return _mm_i32gather_ps(p, As<__m128i>(v), 4); }
inline Double IndexToDouble(Index v) { return _mm256_cvtepi32_pd(As<__m128i>(v)); }
inline Double SingleToDouble(Single v) { return _mm256_cvtps_pd(v); }
// clang-format on
} // namespace Lanes

#include "LanesSelect.h"

#endif
