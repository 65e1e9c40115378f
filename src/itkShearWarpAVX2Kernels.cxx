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
#include "itkShearWarpPixelTypes.h"
#include "itkShearWarpVectorKernelSets.h"

#include <immintrin.h>

#include <math.h>

#include <type_traits>

#define SHEARWARP_UNROLL _Pragma("GCC unroll 18")
#define SHEARWARP_INLINE __attribute__((always_inline))

namespace itk::ShearWarp
{
namespace
{
/** AVX2. */
struct Lanes
{
  static constexpr char           Name[] = "avx2";
  static constexpr std::ptrdiff_t ShortCount = 16;
  static constexpr std::ptrdiff_t FloatCount = 8;
  static constexpr int            SumRows = 4; // of 2 x Int, in half of the registers
  static constexpr std::ptrdiff_t WarpCount = 4;

  using Short = __m256i;
  using Int = __m256i;
  using Float = __m256;

  // clang-format off
  static Short Load(const unsigned short * p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i *>(p)); }
  static Short Load(const short * p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i *>(p)); }
  static Short Load(const unsigned char * p) { return _mm256_cvtepu8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i *>(p))); }
  static Short Load(const signed char * p) { return _mm256_cvtepi8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i *>(p))); }
  static void Store(unsigned short * p, Short v) { _mm256_storeu_si256(reinterpret_cast<__m256i *>(p), v); }
  static void Store(short * p, Short v) { _mm256_storeu_si256(reinterpret_cast<__m256i *>(p), v); }
  static void Store(unsigned char * p, Short v) { _mm_storeu_si128(reinterpret_cast<__m128i *>(p), _mm_packus_epi16(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1))); }
  static void Store(signed char * p, Short v) { _mm_storeu_si128(reinterpret_cast<__m128i *>(p), _mm_packs_epi16(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1))); }
  static Short Set(int v) { return _mm256_set1_epi16(static_cast<short>(v)); }
  static Short SetPixel(int v) { return Set(v); }
  static Short SetPairs(int low, int high) { return _mm256_set1_epi32(low | high << 16); }
  static Short Add(Short a, Short b) { return _mm256_add_epi16(a, b); }
  static Short Subtract(Short a, Short b) { return _mm256_sub_epi16(a, b); }
  static Short MultiplyHighRounded(Short a, Short b) { return _mm256_mulhrs_epi16(a, b); }
  static Short FlipSign(Short v) { return _mm256_xor_si256(v, _mm256_set1_epi16(-32768)); }
  static Short Maximum(Short maximum, Short v) { return _mm256_max_epi16(maximum, v); }
  static Short Minimum(Short minimum, Short v) { return _mm256_min_epi16(minimum, v); }
  static Short MaximumUnsigned(Short maximum, Short v) { return _mm256_max_epu16(maximum, v); }
  static Short MinimumUnsigned(Short minimum, Short v) { return _mm256_min_epu16(minimum, v); }
  static bool AreEqual(Short a, Short b) { return _mm256_movemask_epi8(_mm256_cmpeq_epi16(a, b)) == -1; }

  /** The lanes of b that have a bit, the others of a. */
  static Short Select(Short a, Short b, std::uint32_t lanes)
  {
    const Short bits = _mm256_setr_epi16(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, -32768);
    return _mm256_blendv_epi8(a, b, _mm256_cmpeq_epi16(_mm256_and_si256(Set(static_cast<int>(lanes)), bits), bits));
  }

  /** Of each lane of \a better, the better one of \a before and \a sample, the least rank of those that are it. */
  static Short SelectNearest(Short before, Short sample, Short better, Short rankBefore, Short rank)
  {
    const Short least = _mm256_blendv_epi8(rankBefore, _mm256_min_epi16(rankBefore, rank), _mm256_cmpeq_epi16(sample, better));
    return _mm256_blendv_epi8(rank, least, _mm256_cmpeq_epi16(before, better));
  }
  static Short SetRank(std::int16_t v) { return Set(v); }
  /** The ranks of rays that are at \a beyond before and then meet a worse sample, which is not \a none, have EndedRank
   * added. */
  static Short EndRays(Short before, Short beyond, Short better, Short sample, Short, Short ranks)
  {
    const Short ended = _mm256_andnot_si256(_mm256_cmpeq_epi16(better, sample), _mm256_cmpeq_epi16(before, beyond));
    return _mm256_or_si256(ranks, _mm256_and_si256(ended, Set(-32768)));
  }
  /** The lanes of \a kept whose ranks are negative, the others of \a v. */
  static Short KeepEnded(Short ranks, Short kept, Short v) { return _mm256_blendv_epi8(v, kept, _mm256_srai_epi16(ranks, 15)); }

  static Short Magnitude(Short v) { return _mm256_abs_epi16(v); }
  static Short MaximumMagnitude(Short a, Short b) { return MaximumUnsigned(a, b); }
  static Short LargerMagnitude(Short best, Short v)
  {
    const Short equal = _mm256_cmpeq_epi16(Magnitude(best), Magnitude(v));
    const Short isNotLess = _mm256_cmpeq_epi16(MaximumUnsigned(Magnitude(best), Magnitude(v)), Magnitude(v));
    return _mm256_blendv_epi8(best, v, _mm256_blendv_epi8(isNotLess, _mm256_cmpgt_epi16(v, best), equal));
  }

  static Int MaximumInt(Int a, Int b) { return _mm256_max_epi32(a, b); }
  static Int MinimumInt(Int a, Int b) { return _mm256_min_epi32(a, b); }
  static Int SetInt(int v) { return _mm256_set1_epi32(v); }
  static std::uint32_t FindSet(const std::int16_t * p) { return static_cast<std::uint32_t>(_mm256_movemask_epi8(_mm256_permute4x64_epi64(_mm256_packs_epi16(Load(p), Load(p + ShortCount)), 0xD8))); }
  static std::uint32_t GetSigns(__m256 v) { return static_cast<std::uint32_t>(_mm256_movemask_ps(v)); }
  static std::uint32_t GetSigns(__m256d v) { return static_cast<std::uint32_t>(_mm256_movemask_pd(v)); }
  /** Of the even and the odd columns; between rows alone of the halves of interleaved vectors. */
  struct Sums { Int low, high; };
  static Int AddPairProducts(Int sum, Short a, Short b) { return _mm256_add_epi32(sum, _mm256_madd_epi16(a, b)); }
  static Sums AddColumns(Sums sums, Short left, Short right, Short weights) { return { AddPairProducts(sums.low, left, weights), AddPairProducts(sums.high, right, weights) }; }
  static Sums AddRows(Sums sums, Short above, Short below, Short weights) { return { AddPairProducts(sums.low,
    _mm256_unpacklo_epi16(above, below), weights), AddPairProducts(sums.high, _mm256_unpackhi_epi16(above, below), weights) }; }
  static Short PackColumns(Sums sums) { return _mm256_blend_epi16(_mm256_srli_epi32(sums.low, 15), _mm256_slli_epi32(sums.high, 1), 0xAA); }
  static Short PackRows(Sums sums) { return _mm256_packs_epi32(_mm256_srai_epi32(sums.low, 15), _mm256_srai_epi32(sums.high, 15)); }

  static Float Load(const float * p) { return _mm256_loadu_ps(p); }
  static void Store(float * p, Float v) { _mm256_storeu_ps(p, v); }
  static Float SetFloat(float v) { return _mm256_set1_ps(v); }
  static Float SetPixel(float v) { return SetFloat(v); }
  static bool AreEqual(Float a, Float b) { return _mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_EQ_OQ)) == 0xFF; }
  static Float Add(Float a, Float b) { return _mm256_add_ps(a, b); }
  static Float Subtract(Float a, Float b) { return _mm256_sub_ps(a, b); }
  static Float Multiply(Float a, Float b) { return _mm256_mul_ps(a, b); }
  static Float Maximum(Float maximum, Float v) { return _mm256_max_ps(v, maximum); }
  static Float Minimum(Float minimum, Float v) { return _mm256_min_ps(v, minimum); }
  static Float Magnitude(Float v) { return _mm256_andnot_ps(SetFloat(-0.0f), v); }
  static Float MaximumMagnitude(Float a, Float b) { return Maximum(a, b); }
  static Float LargerMagnitude(Float best, Float v)
  {
    const Float isMore = _mm256_cmp_ps(Magnitude(v), Magnitude(best), _CMP_GT_OQ);
    const Float isPositive = _mm256_and_ps(_mm256_cmp_ps(Magnitude(v), Magnitude(best), _CMP_EQ_OQ), _mm256_cmp_ps(v, best, _CMP_GT_OQ));
    return _mm256_blendv_ps(best, v, _mm256_or_ps(isMore, isPositive));
  }
  static Int GetMask(std::uint32_t lanes)
  {
    const Int bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    return _mm256_cmpeq_epi32(_mm256_and_si256(SetInt(static_cast<int>(lanes)), bits), bits);
  }
  static Float Select(Float a, Float b, std::uint32_t lanes) { return _mm256_blendv_ps(a, b, _mm256_castsi256_ps(GetMask(lanes))); }
  /** The same for lanes of 32 bits if VIsWide. */
  template <bool VIsWide>
  static Int SelectRanks(Int a, Int b, std::uint32_t lanes) { return VIsWide ? _mm256_blendv_epi8(a, b, GetMask(lanes)) : Select(a, b, lanes); }

  /** The bits of VCount bytes that are \a label or, if that is 0, not 0. */
  template <std::ptrdiff_t VCount>
  static std::uint32_t FindLabel(const std::uint8_t * p, std::uint8_t label)
  {
    const __m128i v = VCount == 16 ? _mm_loadu_si128(reinterpret_cast<const __m128i *>(p)) : _mm_loadl_epi64(reinterpret_cast<const __m128i *>(p));
    const auto    equal = static_cast<std::uint32_t>(_mm_movemask_epi8(_mm_cmpeq_epi8(v, _mm_set1_epi8(static_cast<char>(label)))));
    return (label == 0 ? ~equal : equal) & ((1U << VCount) - 1);
  }

  static Int Load(const std::int32_t * p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i *>(p)); }
  static void Store(std::int32_t * p, Int v) { _mm256_storeu_si256(reinterpret_cast<__m256i *>(p), v); }
  static Int SetRank(std::int32_t v) { return SetInt(v); }
  static Int EndRays(Float before, Float beyond, Float better, Float sample, Float none, Int ranks)
  {
    const Float isWorse = _mm256_and_ps(_mm256_cmp_ps(better, sample, _CMP_NEQ_OQ), _mm256_cmp_ps(sample, none, _CMP_NEQ_OQ));
    const Float ended = _mm256_and_ps(isWorse, _mm256_cmp_ps(before, beyond, _CMP_EQ_OQ));
    return _mm256_or_si256(ranks, _mm256_slli_epi32(_mm256_castps_si256(ended), 31));
  }
  static Float KeepEnded(Int ranks, Float kept, Float v) { return _mm256_blendv_ps(v, kept, _mm256_castsi256_ps(ranks)); }
  static Int SelectNearest(Float before, Float sample, Float better, Int rankBefore, Int rank)
  {
    const Int least = _mm256_blendv_epi8(rankBefore, _mm256_min_epi32(rankBefore, rank), _mm256_castps_si256(_mm256_cmp_ps(sample, better, _CMP_EQ_OQ)));
    return _mm256_blendv_epi8(rank, least, _mm256_castps_si256(_mm256_cmp_ps(before, better, _CMP_EQ_OQ)));
  }

  /** Samples that fade to \a to, by \a factor times \a factors. */
  template <bool VIsUnsigned>
  static Short Fade(Short v, const float * factors, float factor, float to)
  {
    const auto fade = [factor, to](__m128i half, const float * p)
    {
      const Float from = _mm256_cvtepi32_ps(VIsUnsigned ? _mm256_cvtepu16_epi32(half) : _mm256_cvtepi16_epi32(half));
      const Float product = Multiply(SetFloat(factor), Load(p));
      const Float faded = Add(SetFloat(to), Multiply(Subtract(from, SetFloat(to)), product));
      return _mm256_cvttps_epi32(_mm256_floor_ps(Add(faded, SetFloat(0.5f))));
    };
    const Int low = fade(_mm256_castsi256_si128(v), factors);
    const Int high = fade(_mm256_extracti128_si256(v, 1), factors + 8);
    return _mm256_permute4x64_epi64(VIsUnsigned ? _mm256_packus_epi32(low, high) : _mm256_packs_epi32(low, high), 0xD8);
  }
  template <bool>
  static Float Fade(Float v, const float * factors, float factor, float to)
  {
    const Float faded = Add(SetFloat(to), Multiply(Subtract(v, SetFloat(to)), Multiply(SetFloat(factor), Load(factors))));
    return _mm256_blendv_ps(Maximum(v, faded), Minimum(v, faded), _mm256_cmp_ps(v, SetFloat(to), _CMP_GT_OQ));
  }

  using Index = __m128i;
  using Double = __m256d;
  using Single = __m128;

  static Double Load(const double * p) { return _mm256_loadu_pd(p); }
  static void Store(double * p, Double v) { _mm256_storeu_pd(p, v); }
  static Float SquareRoot(Float v) { return _mm256_sqrt_ps(v); }
  static Double SquareRoot(Double v) { return _mm256_sqrt_pd(v); }
  static Double SetDouble(double v) { return _mm256_set1_pd(v); }
  static Double Count(double first) { return _mm256_add_pd(_mm256_set1_pd(first), _mm256_setr_pd(0, 1, 2, 3)); }
  static Double AddDouble(Double a, Double b) { return _mm256_add_pd(a, b); }
  static Double MultiplyDouble(Double a, Double b) { return _mm256_mul_pd(a, b); }
  static bool AreWithin(Double v, double begin, double end) { return _mm256_movemask_pd(_mm256_and_pd(_mm256_cmp_pd(v,
    _mm256_set1_pd(begin), _CMP_GE_OQ), _mm256_cmp_pd(v, _mm256_set1_pd(end), _CMP_LT_OQ))) == 0xF; }
  static Index DoubleToIndex(Double v) { return _mm256_cvttpd_epi32(v); }
  static Double IndexToDouble(Index v) { return _mm256_cvtepi32_pd(v); }
  static Index SetIndex(int v) { return _mm_set1_epi32(v); }
  static int First(Index v) { return _mm_cvtsi128_si32(v); }
  static int Last(Index v) { return _mm_extract_epi32(v, 3); }
  static Index LowBytes(Index v) { return _mm_shuffle_epi8(v, _mm_setr_epi8(0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1)); }
  static Index LowShorts(Index v) { return _mm_shuffle_epi8(v, _mm_setr_epi8(0, 1, 4, 5, 8, 9, 12, 13, -1, -1, -1, -1, -1, -1, -1, -1)); }
  static void StoreLow(unsigned char * p, Index v) { _mm_storeu_si32(p, LowBytes(v)); }
  static void StoreLow(signed char * p, Index v) { _mm_storeu_si32(p, LowBytes(v)); }
  static void StoreLow(unsigned short * p, Index v) { _mm_storel_epi64(reinterpret_cast<__m128i *>(p), LowShorts(v)); }
  static void StoreLow(short * p, Index v) { _mm_storel_epi64(reinterpret_cast<__m128i *>(p), LowShorts(v)); }
  static Index AddIndex(Index a, Index b) { return _mm_add_epi32(a, b); }
  static Index SubtractIndex(Index a, Index b) { return _mm_sub_epi32(a, b); }
  static Index MultiplyIndex(Index a, Index b) { return _mm_mullo_epi32(a, b); }
  static Index AndIndex(Index a, Index b) { return _mm_and_si128(a, b); }
  static Index ShiftLeft(Index v, int bits) { return _mm_slli_epi32(v, bits); }
  static Index ShiftRight(Index v, int bits) { return _mm_srai_epi32(v, bits); }
  static Index ShiftRightLogical(Index v, int bits) { return _mm_srli_epi32(v, bits); }
  template <int VSize>
  static Index Gather(const void * p, Index v) { return _mm_i32gather_epi32(static_cast<const int *>(p), v, VSize); }

  static Single GatherSingle(const float * p, Index v) { return _mm_i32gather_ps(p, v, 4); }
  static Single SetSingle(float v) { return _mm_set1_ps(v); }
  static void StoreSingle(float * p, Single v) { _mm_storeu_ps(p, v); }
  static Single MaximumSingle(Single a, Single b) { return _mm_max_ps(a, b); }
  static Single MinimumSingle(Single a, Single b) { return _mm_min_ps(a, b); }
  static Single SelectWhereZero(Index v, Single zero, Single other) { return _mm_blendv_ps(other, zero, _mm_castsi128_ps(_mm_cmpeq_epi32(v, _mm_setzero_si128()))); }
  static bool AreFinite(Single v) { const Single difference = _mm_sub_ps(v, v); return _mm_movemask_ps(_mm_cmp_ps(difference, difference, _CMP_UNORD_Q)) == 0; }
  static Double SingleToDouble(Single v) { return _mm256_cvtps_pd(v); }
  static Single DoubleToSingle(Double v) { return _mm256_cvtpd_ps(v); }

  using Quad = __m128i;
  static Quad LoadQuad(const void * p) { return _mm_loadu_si128(static_cast<const __m128i *>(p)); }
  static void StoreQuad(void * p, Quad v) { _mm_storeu_si128(static_cast<__m128i *>(p), v); }
  static Quad InterleaveQuadLow(Quad a, Quad b, unsigned char) { return _mm_unpacklo_epi8(a, b); }
  static Quad InterleaveQuadHigh(Quad a, Quad b, unsigned char) { return _mm_unpackhi_epi8(a, b); }
  static Quad InterleaveQuadLow(Quad a, Quad b, signed char) { return _mm_unpacklo_epi8(a, b); }
  static Quad InterleaveQuadHigh(Quad a, Quad b, signed char) { return _mm_unpackhi_epi8(a, b); }
  static Quad InterleaveQuadLow(Quad a, Quad b, unsigned short) { return _mm_unpacklo_epi16(a, b); }
  static Quad InterleaveQuadHigh(Quad a, Quad b, unsigned short) { return _mm_unpackhi_epi16(a, b); }
  static Quad InterleaveQuadLow(Quad a, Quad b, short) { return _mm_unpacklo_epi16(a, b); }
  static Quad InterleaveQuadHigh(Quad a, Quad b, short) { return _mm_unpackhi_epi16(a, b); }
  static Quad InterleaveQuadLow(Quad a, Quad b, float) { return _mm_unpacklo_epi32(a, b); }
  static Quad InterleaveQuadHigh(Quad a, Quad b, float) { return _mm_unpackhi_epi32(a, b); }

  static void StoreLine(void * p, const void * line, bool isAligned)
  {
    for (int half = 0; half < 2; ++half)
    {
      const __m256i v = _mm256_load_si256(static_cast<const __m256i *>(line) + half);
      __m256i *     target = static_cast<__m256i *>(p) + half;
      isAligned ? _mm256_stream_si256(target, v) : _mm256_storeu_si256(target, v);
    }
  }
  static void FinishLines() { _mm_sfence(); }
  static void Prefetch(const char * p) { _mm_prefetch(p, _MM_HINT_T0); }
  static void PrefetchFar(const char * p) { _mm_prefetch(p, _MM_HINT_T1); }
  // clang-format on
};

#include "itkShearWarpScalarKernels.h"
#include "itkShearWarpVectorKernels.h"
} // namespace

#define SPECIALIZE(TPixel)                 \
  template <>                              \
  const Kernels<TPixel> & GetAVX2Kernels() \
  {                                        \
    return VectorKernels<TPixel>;          \
  }
SHEARWARP_FOR_EACH_VECTOR_PIXEL_TYPE(SPECIALIZE)
#undef SPECIALIZE
} // namespace itk::ShearWarp
