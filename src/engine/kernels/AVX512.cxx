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
#include "PixelTypes.h"
#include "VectorSets.h"

#include <immintrin.h>

#include <math.h>

#include <type_traits>

#define SHEARWARP_UNROLL _Pragma("GCC unroll 18")
#define SHEARWARP_INLINE __attribute__((always_inline))

namespace itk::ShearWarp
{
namespace
{
/** AVX-512 F, BW, DQ, VL and VNNI. */
struct Lanes
{
  static constexpr char           Name[] = "avx512";
  static constexpr std::ptrdiff_t ShortCount = 32;
  static constexpr std::ptrdiff_t FloatCount = 16;
  static constexpr int            SumRows = 8; // of 2 x Int, in half of the registers
  static constexpr std::ptrdiff_t WarpCount = 8;

  using Short = __m512i;
  using Int = __m512i;
  using Float = __m512;

  // clang-format off
  static Short Load(const unsigned short * p) { return _mm512_loadu_si512(p); }
  static Short Load(const short * p) { return _mm512_loadu_si512(p); }
  static Short Load(const unsigned char * p) { return _mm512_cvtepu8_epi16(_mm256_loadu_si256(reinterpret_cast<const __m256i *>(p))); }
  static Short Load(const signed char * p) { return _mm512_cvtepi8_epi16(_mm256_loadu_si256(reinterpret_cast<const __m256i *>(p))); }
  static void Store(unsigned short * p, Short v) { _mm512_storeu_si512(p, v); }
  static void Store(short * p, Short v) { _mm512_storeu_si512(p, v); }
  static void Store(unsigned char * p, Short v) { _mm256_storeu_si256(reinterpret_cast<__m256i *>(p), _mm512_cvtepi16_epi8(v)); }
  static void Store(signed char * p, Short v) { _mm256_storeu_si256(reinterpret_cast<__m256i *>(p), _mm512_cvtepi16_epi8(v)); }
  static Short Set(int v) { return _mm512_set1_epi16(static_cast<short>(v)); }
  static Short SetPixel(int v) { return Set(v); }
  static Short SetPairs(int low, int high) { return _mm512_set1_epi32(low | high << 16); }
  static Short Add(Short a, Short b) { return _mm512_add_epi16(a, b); }
  static Short Subtract(Short a, Short b) { return _mm512_sub_epi16(a, b); }
  static Short MultiplyHighRounded(Short a, Short b) { return _mm512_mulhrs_epi16(a, b); }
  static Short FlipSign(Short v) { return _mm512_xor_si512(v, _mm512_set1_epi16(-32768)); }
  static Short Maximum(Short maximum, Short v) { return _mm512_max_epi16(maximum, v); }
  static Short Minimum(Short minimum, Short v) { return _mm512_min_epi16(minimum, v); }
  static Short MaximumUnsigned(Short maximum, Short v) { return _mm512_max_epu16(maximum, v); }
  static Short MinimumUnsigned(Short minimum, Short v) { return _mm512_min_epu16(minimum, v); }
  static bool AreEqual(Short a, Short b) { return _mm512_cmpeq_epi16_mask(a, b) == 0xFFFFFFFF; }

  /** The lanes of b that have a bit, the others of a. */
  static Short Select(Short a, Short b, std::uint32_t lanes) { return _mm512_mask_blend_epi16(lanes, a, b); }

  /** Of each lane of \a better, the better one of \a before and \a sample, the least rank of those that are it. */
  static Short SelectNearest(Short before, Short sample, Short better, Short rankBefore, Short rank)
  {
    const Short least = _mm512_mask_min_epi16(rankBefore, _mm512_cmpeq_epi16_mask(sample, better), rankBefore, rank);
    return _mm512_mask_blend_epi16(_mm512_cmpeq_epi16_mask(before, better), rank, least);
  }
  static Short SetRank(std::int16_t v) { return Set(v); }
  /** The ranks of rays that are at \a beyond before and then meet a worse sample, which is not \a none, have EndedRank
   * added. */
  static Short EndRays(Short before, Short beyond, Short better, Short sample, Short, Short ranks)
  {
    const __mmask32 ended = _mm512_mask_cmpneq_epi16_mask(_mm512_cmpeq_epi16_mask(before, beyond), better, sample);
    return _mm512_mask_blend_epi16(ended, ranks, _mm512_or_si512(ranks, Set(-32768)));
  }
  /** The lanes of \a kept whose ranks are negative, the others of \a v. */
  static Short KeepEnded(Short ranks, Short kept, Short v) { return _mm512_mask_blend_epi16(_mm512_movepi16_mask(ranks), v, kept); }

  static Short Magnitude(Short v) { return _mm512_abs_epi16(v); }
  static Short MaximumMagnitude(Short a, Short b) { return MaximumUnsigned(a, b); }
  static Short LargerMagnitude(Short best, Short v)
  {
    const __mmask32 isPositive = _mm512_mask_cmpgt_epi16_mask(_mm512_cmpeq_epi16_mask(Magnitude(v), Magnitude(best)), v, best);
    return _mm512_mask_blend_epi16(_mm512_cmpgt_epu16_mask(Magnitude(v), Magnitude(best)) | isPositive, best, v);
  }

  static Int MaximumInt(Int a, Int b) { return _mm512_max_epi32(a, b); }
  static Int MinimumInt(Int a, Int b) { return _mm512_min_epi32(a, b); }
  static Int SetInt(int v) { return _mm512_set1_epi32(v); }
  static std::uint32_t FindSet(const std::int16_t * p) { return _mm512_movepi16_mask(Load(p)); }
  static std::uint32_t GetSigns(__m512 v) { return _mm512_movepi32_mask(_mm512_castps_si512(v)); }
  static std::uint32_t GetSigns(__m512d v) { return _mm512_movepi64_mask(_mm512_castpd_si512(v)); }
  /** Of the even and the odd columns; between rows alone of the halves of interleaved vectors. */
  struct Sums { Int low, high; };
  static Int AddPairProducts(Int sum, Short a, Short b) { return _mm512_dpwssd_epi32(sum, a, b); }
  static Sums AddColumns(Sums sums, Short left, Short right, Short weights) { return { AddPairProducts(sums.low, left, weights), AddPairProducts(sums.high, right, weights) }; }
  static Sums AddRows(Sums sums, Short above, Short below, Short weights) { return { AddPairProducts(sums.low,
    _mm512_unpacklo_epi16(above, below), weights), AddPairProducts(sums.high, _mm512_unpackhi_epi16(above, below), weights) }; }
  static Short PackColumns(Sums sums) { return _mm512_mask_blend_epi16(0xAAAAAAAA, _mm512_srli_epi32(sums.low, 15), _mm512_slli_epi32(sums.high, 1)); }
  static Short PackRows(Sums sums) { return _mm512_packs_epi32(_mm512_srai_epi32(sums.low, 15), _mm512_srai_epi32(sums.high, 15)); }

  static Float Load(const float * p) { return _mm512_loadu_ps(p); }
  static void Store(float * p, Float v) { _mm512_storeu_ps(p, v); }
  static Float SetFloat(float v) { return _mm512_set1_ps(v); }
  static Float SetPixel(float v) { return SetFloat(v); }
  static bool AreEqual(Float a, Float b) { return _mm512_cmp_ps_mask(a, b, _CMP_EQ_OQ) == 0xFFFF; }
  static Float Add(Float a, Float b) { return _mm512_add_ps(a, b); }
  static Float Subtract(Float a, Float b) { return _mm512_sub_ps(a, b); }
  static Float Multiply(Float a, Float b) { return _mm512_mul_ps(a, b); }
  static Float Maximum(Float maximum, Float v) { return _mm512_max_ps(v, maximum); }
  static Float Minimum(Float minimum, Float v) { return _mm512_min_ps(v, minimum); }
  static Float Magnitude(Float v) { return _mm512_abs_ps(v); }
  static Float MaximumMagnitude(Float a, Float b) { return Maximum(a, b); }
  static Float LargerMagnitude(Float best, Float v)
  {
    const __mmask16 isEqual = _mm512_cmp_ps_mask(Magnitude(v), Magnitude(best), _CMP_EQ_OQ);
    const __mmask16 isPositive = _mm512_mask_cmp_ps_mask(isEqual, v, best, _CMP_GT_OQ);
    return _mm512_mask_blend_ps(_mm512_cmp_ps_mask(Magnitude(v), Magnitude(best), _CMP_GT_OQ) | isPositive, best, v);
  }
  static Float Select(Float a, Float b, std::uint32_t lanes) { return _mm512_mask_blend_ps(static_cast<__mmask16>(lanes), a, b); }
  /** The same for lanes of 32 bits if VIsWide. */
  template <bool VIsWide>
  static Int SelectRanks(Int a, Int b, std::uint32_t lanes) { return VIsWide ? _mm512_mask_blend_epi32(static_cast<__mmask16>(lanes), a, b) : Select(a, b, lanes); }

  /** The bits of VCount bytes that are \a label or, if that is 0, not 0. */
  template <std::ptrdiff_t VCount>
  static std::uint32_t FindLabel(const std::uint8_t * p, std::uint8_t label)
  {
    if constexpr (VCount == 32)
    {
      const std::uint32_t equal = _mm256_cmpeq_epi8_mask(_mm256_loadu_si256(reinterpret_cast<const __m256i *>(p)), _mm256_set1_epi8(static_cast<char>(label)));
      return label == 0 ? ~equal : equal;
    }
    else
    {
      const std::uint32_t equal = _mm_cmpeq_epi8_mask(_mm_loadu_si128(reinterpret_cast<const __m128i *>(p)), _mm_set1_epi8(static_cast<char>(label)));
      return (label == 0 ? ~equal : equal) & 0xFFFF;
    }
  }

  static Int Load(const std::int32_t * p) { return _mm512_loadu_si512(p); }
  static void Store(std::int32_t * p, Int v) { _mm512_storeu_si512(p, v); }
  static Int SetRank(std::int32_t v) { return SetInt(v); }
  static Int EndRays(Float before, Float beyond, Float better, Float sample, Float none, Int ranks)
  {
    const __mmask16 isBeyond = _mm512_cmp_ps_mask(before, beyond, _CMP_EQ_OQ);
    const __mmask16 isWorse = _mm512_mask_cmp_ps_mask(isBeyond, better, sample, _CMP_NEQ_OQ);
    const __mmask16 ended = _mm512_mask_cmp_ps_mask(isWorse, sample, none, _CMP_NEQ_OQ);
    return _mm512_mask_or_epi32(ranks, ended, ranks, SetInt(-2147483647 - 1));
  }
  static Float KeepEnded(Int ranks, Float kept, Float v) { return _mm512_mask_blend_ps(_mm512_movepi32_mask(ranks), v, kept); }
  static Int SelectNearest(Float before, Float sample, Float better, Int rankBefore, Int rank)
  {
    const Int least = _mm512_mask_min_epi32(rankBefore, _mm512_cmp_ps_mask(sample, better, _CMP_EQ_OQ), rankBefore, rank);
    return _mm512_mask_blend_epi32(_mm512_cmp_ps_mask(before, better, _CMP_EQ_OQ), rank, least);
  }

  /** Samples that fade to \a to, by \a factor times \a factors. */
  template <bool VIsUnsigned>
  static Short Fade(Short v, const float * factors, float factor, float to)
  {
    const auto fade = [factor, to](__m256i half, const float * p)
    {
      const Float from = _mm512_cvtepi32_ps(VIsUnsigned ? _mm512_cvtepu16_epi32(half) : _mm512_cvtepi16_epi32(half));
      const Float product = Multiply(SetFloat(factor), Load(p));
      const Float faded = Add(SetFloat(to), Multiply(Subtract(from, SetFloat(to)), product));
      return _mm512_cvtepi32_epi16(_mm512_cvt_roundps_epi32(Add(faded, SetFloat(0.5f)), _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC));
    };
    return _mm512_inserti64x4(_mm512_castsi256_si512(fade(_mm512_castsi512_si256(v), factors)), fade(_mm512_extracti64x4_epi64(v, 1), factors + 16), 1);
  }
  template <bool>
  static Float Fade(Float v, const float * factors, float factor, float to)
  {
    const Float faded = Add(SetFloat(to), Multiply(Subtract(v, SetFloat(to)), Multiply(SetFloat(factor), Load(factors))));
    return _mm512_mask_blend_ps(_mm512_cmp_ps_mask(v, SetFloat(to), _CMP_GT_OQ), Maximum(v, faded), Minimum(v, faded));
  }

  using Index = __m256i;
  using Double = __m512d;
  using Single = __m256;

  static Double Load(const double * p) { return _mm512_loadu_pd(p); }
  static void Store(double * p, Double v) { _mm512_storeu_pd(p, v); }
  static Float SquareRoot(Float v) { return _mm512_sqrt_ps(v); }
  static Double SquareRoot(Double v) { return _mm512_sqrt_pd(v); }
  static Double SetDouble(double v) { return _mm512_set1_pd(v); }
  static Double Count(double first) { return _mm512_add_pd(_mm512_set1_pd(first), _mm512_setr_pd(0, 1, 2, 3, 4, 5, 6, 7)); }
  static Double AddDouble(Double a, Double b) { return _mm512_add_pd(a, b); }
  static Double MultiplyDouble(Double a, Double b) { return _mm512_mul_pd(a, b); }
  static bool AreWithin(Double v, double begin, double end) { return (_mm512_cmp_pd_mask(v, _mm512_set1_pd(begin), _CMP_GE_OQ) & _mm512_cmp_pd_mask(v, _mm512_set1_pd(end), _CMP_LT_OQ)) == 0xFF; }
  static Index DoubleToIndex(Double v) { return _mm512_cvttpd_epi32(v); }
  static Double IndexToDouble(Index v) { return _mm512_cvtepi32_pd(v); }
  static Index SetIndex(int v) { return _mm256_set1_epi32(v); }
  static int First(Index v) { return _mm256_cvtsi256_si32(v); }
  static int Last(Index v) { return _mm256_extract_epi32(v, 7); }
  static void StoreLow(unsigned char * p, Index v) { _mm_storel_epi64(reinterpret_cast<__m128i *>(p), _mm256_cvtepi32_epi8(v)); }
  static void StoreLow(signed char * p, Index v) { _mm_storel_epi64(reinterpret_cast<__m128i *>(p), _mm256_cvtepi32_epi8(v)); }
  static void StoreLow(unsigned short * p, Index v) { _mm_storeu_si128(reinterpret_cast<__m128i *>(p), _mm256_cvtepi32_epi16(v)); }
  static void StoreLow(short * p, Index v) { _mm_storeu_si128(reinterpret_cast<__m128i *>(p), _mm256_cvtepi32_epi16(v)); }
  static Index AddIndex(Index a, Index b) { return _mm256_add_epi32(a, b); }
  static Index SubtractIndex(Index a, Index b) { return _mm256_sub_epi32(a, b); }
  static Index MultiplyIndex(Index a, Index b) { return _mm256_mullo_epi32(a, b); }
  static Index AndIndex(Index a, Index b) { return _mm256_and_si256(a, b); }
  static Index ShiftLeft(Index v, int bits) { return _mm256_slli_epi32(v, bits); }
  static Index ShiftRight(Index v, int bits) { return _mm256_srai_epi32(v, bits); }
  static Index ShiftRightLogical(Index v, int bits) { return _mm256_srli_epi32(v, bits); }
  template <int VSize>
  static Index Gather(const void * p, Index v) { return _mm256_i32gather_epi32(static_cast<const int *>(p), v, VSize); }

  static Single GatherSingle(const float * p, Index v) { return _mm256_i32gather_ps(p, v, 4); }
  static Single SetSingle(float v) { return _mm256_set1_ps(v); }
  static void StoreSingle(float * p, Single v) { _mm256_storeu_ps(p, v); }
  /** \a a if both are equal or one is not a number. */
  static Single MaximumSingle(Single a, Single b) { return _mm256_max_ps(b, a); }
  static Single MinimumSingle(Single a, Single b) { return _mm256_min_ps(b, a); }
  static Single SelectWhereZero(Index v, Single zero, Single other) { return _mm256_blendv_ps(other, zero, _mm256_castsi256_ps(_mm256_cmpeq_epi32(v, _mm256_setzero_si256()))); }
  static bool AreFinite(Single v) { const Single difference = _mm256_sub_ps(v, v); return _mm256_movemask_ps(_mm256_cmp_ps(difference, difference, _CMP_UNORD_Q)) == 0; }
  static Double SingleToDouble(Single v) { return _mm512_cvtps_pd(v); }
  static Single DoubleToSingle(Double v) { return _mm512_cvtpd_ps(v); }

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
    const __m512i v = _mm512_load_si512(line);
    isAligned ? _mm512_stream_si512(static_cast<__m512i *>(p), v) : _mm512_storeu_si512(p, v);
  }
  static void FinishLines() { _mm_sfence(); }
  static void Prefetch(const char * p) { _mm_prefetch(p, _MM_HINT_T0); }
  static void PrefetchFar(const char * p) { _mm_prefetch(p, _MM_HINT_T1); }
  // clang-format on
};

#include "Scalar.h"
#include "Vector.h"
} // namespace

#define SPECIALIZE(TPixel)                   \
  template <>                                \
  const Kernels<TPixel> & GetAVX512Kernels() \
  {                                          \
    return VectorKernels<TPixel>;            \
  }
SHEARWARP_FOR_EACH_VECTOR_PIXEL_TYPE(SPECIALIZE)
#undef SPECIALIZE
} // namespace itk::ShearWarp
