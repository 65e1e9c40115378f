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

#if defined(__SSE2__)
#  include <immintrin.h>
#elif defined(__aarch64__)
#  include <arm_neon.h>
#endif

#include <math.h>

#include <type_traits>

#ifndef SHEARWARP_VECTOR_BYTES
#  define SHEARWARP_INSTRUCTION_SET "generic"
#  define SHEARWARP_VECTOR_BYTES 16
#  define SHEARWARP_X86(operation) _mm_##operation
#  define SHEARWARP_GET_KERNELS GetGenericKernels
#endif

#define SHEARWARP_UNROLL _Pragma("GCC unroll 18")
#define SHEARWARP_INLINE __attribute__((always_inline))

#ifdef __clang__
#  define SHEARWARP_SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#  define SHEARWARP_SHUFFLE(a, b, ...) __builtin_shuffle(a, b, decltype(a){ __VA_ARGS__ })
#endif

namespace itk::ShearWarp
{
namespace
{
/** The compiler's vectors of 128 bits, which nearly every processor has, with a few operations of those of x86-64 and
 * ARM64; or vectors of 256 bits, with AVX2. */
struct Lanes
{
  static constexpr char           Name[] = SHEARWARP_INSTRUCTION_SET;
  static constexpr std::ptrdiff_t ShortCount = SHEARWARP_VECTOR_BYTES / 2;
  static constexpr std::ptrdiff_t FloatCount = SHEARWARP_VECTOR_BYTES / 4;
#ifdef __SSE2__
  static constexpr int SumRows = 4; // of 2 x Int, in half of the registers
#else
  static constexpr int SumRows = 8;
#endif
  static constexpr std::ptrdiff_t WarpCount = 4;

  // clang-format off
  using Short [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = short;
  using UnsignedShort [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = unsigned short;
  using Int [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = int;
  using UnsignedInt [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = unsigned int;
  using Float [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = float;
  using Long [[gnu::vector_size(16)]] = long long;
  using Quad [[gnu::vector_size(16)]] = unsigned char;
  using QuadShort [[gnu::vector_size(16)]] = short;
  using Index [[gnu::vector_size(16)]] = int;
  using UnsignedIndex [[gnu::vector_size(16)]] = unsigned int;
  using Single [[gnu::vector_size(16)]] = float;
  using Double [[gnu::vector_size(32)]] = double;
  using DoubleMask [[gnu::vector_size(32)]] = long long;

  template <typename TVector>
  // cppcheck-suppress uninitvar
  static TVector LoadVector(const void * p) { TVector v; __builtin_memcpy(&v, p, sizeof(v)); return v; }
  template <typename TVector>
  static void StoreVector(void * p, TVector v) { __builtin_memcpy(p, &v, sizeof(v)); }
  template <typename TTo, typename TFrom>
  static TTo As(TFrom v) { return reinterpret_cast<TTo>(v); }

  static Short Load(const unsigned short * p) { return LoadVector<Short>(p); }
  static Short Load(const short * p) { return LoadVector<Short>(p); }
  static void Store(unsigned short * p, Short v) { StoreVector(p, v); }
  static void Store(short * p, Short v) { StoreVector(p, v); }
  static Short Set(int v) { return static_cast<short>(v) - Short{}; }
  static Short SetPixel(int v) { return Set(v); }
  static Int SetInt(int v) { return v - Int{}; }
  static Short SetPairs(int low, int high) { return As<Short>(SetInt(low | high << 16)); }
  static Short Add(Short a, Short b) { return As<Short>(As<UnsignedShort>(a) + As<UnsignedShort>(b)); }
  static Short Subtract(Short a, Short b) { return As<Short>(As<UnsignedShort>(a) - As<UnsignedShort>(b)); }
  static Short FlipSign(Short v) { return v ^ Set(-32768); }

  /** The even and the odd elements of 16 bits. */
  static Int GetEven(Short v) { return As<Int>(As<UnsignedInt>(v) << 16) >> 16; }
  static Int GetOdd(Short v) { return As<Int>(v) >> 16; }
  static Short PackEvenOdd(Int even, Int odd) { return As<Short>(((even >> 15) & SetInt(0xFFFF)) | (As<Int>(As<UnsignedInt>(odd) << 1) & SetInt(-65536))); }

#if defined(__SSE2__)
  // 64-bit integers, as intrinsics have them
  using X86 [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = long long;
  static Short Maximum(Short maximum, Short v) { return As<Short>(SHEARWARP_X86(max_epi16)(As<X86>(maximum), As<X86>(v))); }
  static Short Minimum(Short minimum, Short v) { return As<Short>(SHEARWARP_X86(min_epi16)(As<X86>(minimum), As<X86>(v))); }

  /** Of the even and the odd columns; between rows alone of the halves of interleaved vectors. */
  struct Sums { Int low, high; };
  static Int AddPairProducts(Int sum, Short a, Short b) { return sum + As<Int>(SHEARWARP_X86(madd_epi16)(As<X86>(a), As<X86>(b))); }
  static Sums AddColumns(Sums sums, Short left, Short right, Short weights) { return { AddPairProducts(sums.low, left, weights), AddPairProducts(sums.high, right, weights) }; }
  static Sums AddRows(Sums sums, Short above, Short below, Short weights)
  {
    return { AddPairProducts(sums.low, As<Short>(SHEARWARP_X86(unpacklo_epi16)(As<X86>(above), As<X86>(below))), weights),
             AddPairProducts(sums.high, As<Short>(SHEARWARP_X86(unpackhi_epi16)(As<X86>(above), As<X86>(below))), weights) };
  }
  static Short PackRows(Sums sums) { return As<Short>(SHEARWARP_X86(packs_epi32)(As<X86>(sums.low >> 15), As<X86>(sums.high >> 15))); }

  template <typename TMask>
  static bool AreAll(TMask mask) { return static_cast<std::uint32_t>(SHEARWARP_X86(movemask_epi8)(As<X86>(mask))) == 0xFFFFFFFF >> (32 - SHEARWARP_VECTOR_BYTES); }
  static bool AreFinite(Single v) { return _mm_movemask_ps(As<Single>(v * SetSingle(0) == 0)) == 0xF; }
  static std::uint32_t GetSigns(Float mask) { return static_cast<std::uint32_t>(SHEARWARP_X86(movemask_ps)(mask)); }
  template <std::ptrdiff_t VCount>
  static std::uint32_t FindLabel(const std::uint8_t * p, std::uint8_t label)
  {
    Quad bytes;
    if constexpr (VCount == 16)
    {
      bytes = LoadVector<Quad>(p);
    }
    else
    {
      long long low = 0;
      __builtin_memcpy(&low, p, VCount);
      bytes = As<Quad>(Long{ low, 0 });
    }
    const auto equal = static_cast<std::uint32_t>(_mm_movemask_epi8(As<__m128i>(bytes == label)));
    return (label == 0 ? ~equal : equal) & ((1U << VCount) - 1);
  }

  static void StoreLine(void * p, const void * line, bool isAligned)
  {
    for (int n = 0; n < 64; n += SHEARWARP_VECTOR_BYTES)
    {
      const auto v = LoadVector<X86>(static_cast<const char *>(line) + n);
      char *     target = static_cast<char *>(p) + n;
      isAligned ? Stream(target, v) : StoreVector(target, v);
    }
  }
  static void FinishLines() { _mm_sfence(); }
#elif defined(__aarch64__)
  static Quad PackBytes(Short v) { return As<Quad>(vcombine_s8(vmovn_s16(As<int16x8_t>(v)), vdup_n_s8(0))); }
  static Short MultiplyHighRounded(Short a, Short b) { return As<Short>(vqrdmulhq_s16(As<int16x8_t>(a), As<int16x8_t>(b))); }
  static Short Maximum(Short maximum, Short v) { return As<Short>(vmaxq_s16(As<int16x8_t>(maximum), As<int16x8_t>(v))); }
  static Short Minimum(Short minimum, Short v) { return As<Short>(vminq_s16(As<int16x8_t>(minimum), As<int16x8_t>(v))); }
  static Short MaximumUnsigned(Short maximum, Short v) { return As<Short>(vmaxq_u16(As<uint16x8_t>(maximum), As<uint16x8_t>(v))); }
  static Short MinimumUnsigned(Short minimum, Short v) { return As<Short>(vminq_u16(As<uint16x8_t>(minimum), As<uint16x8_t>(v))); }

  /** Of both halves. */
  struct Sums { Int low, high; };
  static Sums AddColumns(Sums sums, Short a, Short b, Short weights)
  {
    const auto aa = As<int16x8_t>(a);
    const auto bb = As<int16x8_t>(b);
    const auto w = vget_low_s16(As<int16x8_t>(weights));
    return { As<Int>(vmlal_lane_s16(vmlal_lane_s16(As<int32x4_t>(sums.low), vget_low_s16(aa), w, 0), vget_low_s16(bb), w, 1)),
             As<Int>(vmlal_high_lane_s16(vmlal_high_lane_s16(As<int32x4_t>(sums.high), aa, w, 0), bb, w, 1)) };
  }
  static Sums AddRows(Sums sums, Short above, Short below, Short weights) { return AddColumns(sums, above, below, weights); }
  static Short PackColumns(Sums sums) { return As<Short>(vshrn_high_n_s32(vshrn_n_s32(As<int32x4_t>(sums.low), 15), As<int32x4_t>(sums.high), 15)); }
  static Short PackRows(Sums sums) { return PackColumns(sums); }
#else
  static Quad PackBytes(Short v) { return SHEARWARP_SHUFFLE(As<Quad>(v), As<Quad>(v), 0, 2, 4, 6, 8, 10, 12, 14, 0, 2, 4, 6, 8, 10, 12, 14); }
  static Short MultiplyHighRounded(Short a, Short b)
  {
    const Int half = SetInt(1 << 14);
    return PackEvenOdd(GetEven(a) * GetEven(b) + half, GetOdd(a) * GetOdd(b) + half);
  }
  static Short Maximum(Short maximum, Short v) { return v > maximum ? v : maximum; }
  static Short Minimum(Short minimum, Short v) { return v < minimum ? v : minimum; }
  static Short MaximumUnsigned(Short maximum, Short v) { return As<UnsignedShort>(v) > As<UnsignedShort>(maximum) ? v : maximum; }
  static Short MinimumUnsigned(Short minimum, Short v) { return As<UnsignedShort>(v) < As<UnsignedShort>(minimum) ? v : minimum; }

  /** Of the even and the odd columns. */
  struct Sums { Int low, high; };
  static Sums AddColumns(Sums sums, Short a, Short b, Short weights)
  {
    const Int weightOfA = GetEven(weights);
    const Int weightOfB = GetOdd(weights);
    return { sums.low + GetEven(a) * weightOfA + GetEven(b) * weightOfB, sums.high + GetOdd(a) * weightOfA + GetOdd(b) * weightOfB };
  }
  static Sums AddRows(Sums sums, Short above, Short below, Short weights) { return AddColumns(sums, above, below, weights); }
  static Short PackColumns(Sums sums) { return PackEvenOdd(sums.low, sums.high); }
  static Short PackRows(Sums sums) { return PackColumns(sums); }
#endif

#ifdef SHEARWARP_WITH_AVX2
  static Short Load(const unsigned char * p) { return As<Short>(_mm256_cvtepu8_epi16(LoadVector<__m128i>(p))); }
  static Short Load(const signed char * p) { return As<Short>(_mm256_cvtepi8_epi16(LoadVector<__m128i>(p))); }
  static void Store(unsigned char * p, Short v) { StoreVector(p, _mm_packus_epi16(_mm256_castsi256_si128(As<X86>(v)), _mm256_extracti128_si256(As<X86>(v), 1))); }
  static void Store(signed char * p, Short v) { StoreVector(p, _mm_packs_epi16(_mm256_castsi256_si128(As<X86>(v)), _mm256_extracti128_si256(As<X86>(v), 1))); }
  static Short MultiplyHighRounded(Short a, Short b) { return As<Short>(_mm256_mulhrs_epi16(As<X86>(a), As<X86>(b))); }
  static Short MaximumUnsigned(Short maximum, Short v) { return As<Short>(_mm256_max_epu16(As<X86>(maximum), As<X86>(v))); }
  static Short MinimumUnsigned(Short minimum, Short v) { return As<Short>(_mm256_min_epu16(As<X86>(minimum), As<X86>(v))); }
  static Short PackColumns(Sums sums) { return As<Short>(_mm256_blend_epi16(As<X86>(As<UnsignedInt>(sums.low) >> 15), As<X86>(As<UnsignedInt>(sums.high) << 1), 0xAA)); }
  static std::uint32_t FindSet(const std::int16_t * p) { return static_cast<std::uint32_t>(_mm256_movemask_epi8(_mm256_permute4x64_epi64(_mm256_packs_epi16(LoadVector<X86>(p), LoadVector<X86>(p + ShortCount)), 0xD8))); }
  static std::uint32_t GetSigns(Double v) { return static_cast<std::uint32_t>(_mm256_movemask_pd(v)); }
  static void Stream(void * p, X86 v) { _mm256_stream_si256(static_cast<__m256i *>(p), v); }
  static Float SquareRoot(Float v) { return _mm256_sqrt_ps(v); }
  static Double SquareRoot(Double v) { return _mm256_sqrt_pd(v); }

  /** Samples that fade to \a to, by \a factor times \a factors. */
  template <bool VIsUnsigned>
  static Short Fade(Short v, const float * factors, float factor, float to)
  {
    const auto fade = [factor, to](__m128i half, const float * p)
    {
      const Float from = _mm256_cvtepi32_ps(VIsUnsigned ? _mm256_cvtepu16_epi32(half) : _mm256_cvtepi16_epi32(half));
      const Float product = SetFloat(factor) * Load(p);
      const Float faded = SetFloat(to) + (from - SetFloat(to)) * product;
      return _mm256_cvttps_epi32(_mm256_floor_ps(faded + SetFloat(0.5f)));
    };
    const __m256i low = fade(_mm256_castsi256_si128(As<X86>(v)), factors);
    const __m256i high = fade(_mm256_extracti128_si256(As<X86>(v), 1), factors + 8);
    return As<Short>(_mm256_permute4x64_epi64(VIsUnsigned ? _mm256_packus_epi32(low, high) : _mm256_packs_epi32(low, high), 0xD8));
  }

  static Index LowBytes(Index v) { return As<Index>(_mm_shuffle_epi8(As<__m128i>(v), _mm_setr_epi8(0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1))); }
  static Index LowShorts(Index v) { return As<Index>(_mm_shuffle_epi8(As<__m128i>(v), _mm_setr_epi8(0, 1, 4, 5, 8, 9, 12, 13, -1, -1, -1, -1, -1, -1, -1, -1))); }
  template <typename TPixel>
  static void StoreLow(TPixel * p, Index v)
  {
    const Index low = sizeof(TPixel) == 1 ? LowBytes(v) : LowShorts(v);
    __builtin_memcpy(p, &low, 4 * sizeof(TPixel));
  }
  template <int VSize>
  static Index Gather(const void * p, Index v) { return As<Index>(_mm_i32gather_epi32(static_cast<const int *>(p), As<__m128i>(v), VSize)); }
  static Single GatherSingle(const float * p, Index v) { return _mm_i32gather_ps(p, As<__m128i>(v), 4); }
  static Double IndexToDouble(Index v) { return _mm256_cvtepi32_pd(As<__m128i>(v)); }
  static Double SingleToDouble(Single v) { return _mm256_cvtps_pd(v); }
#else
  /** Bytes as the low or high halves of lanes. */
  static Short LoadBytes(const void * p, bool isHigh)
  {
    long long bytes;
    __builtin_memcpy(&bytes, p, sizeof(bytes));
    const Quad v = As<Quad>(Long{ bytes, 0 });
    return As<Short>(isHigh ? InterleaveQuadLow(Quad{}, v, char{}) : InterleaveQuadLow(v, Quad{}, char{}));
  }
  static Short Load(const unsigned char * p) { return LoadBytes(p, false); }
  static Short Load(const signed char * p) { return LoadBytes(p, true) >> 8; }
  template <typename TByte, std::enable_if_t<sizeof(TByte) == 1, bool> = true>
  static void Store(TByte * p, Short v)
  {
    const long long bytes = As<Long>(PackBytes(v))[0];
    __builtin_memcpy(p, &bytes, sizeof(bytes));
  }
#ifdef __SSE2__
  static Quad PackBytes(Short v) { return As<Quad>(_mm_packus_epi16(As<__m128i>(v & Set(0xFF)), _mm_setzero_si128())); }
  static Short MultiplyHighRounded(Short a, Short b)
  {
    const __m128i low = _mm_avg_epu16(_mm_srli_epi16(_mm_mullo_epi16(As<__m128i>(a), As<__m128i>(b)), 14), _mm_setzero_si128());
    const __m128i high = _mm_mulhi_epi16(As<__m128i>(a), As<__m128i>(b));
    return As<Short>(_mm_add_epi16(_mm_add_epi16(high, high), low));
  }
  static Short MaximumUnsigned(Short maximum, Short v) { return Add(As<Short>(_mm_subs_epu16(As<__m128i>(maximum), As<__m128i>(v))), v); }
  static Short MinimumUnsigned(Short minimum, Short v) { return Subtract(minimum, As<Short>(_mm_subs_epu16(As<__m128i>(minimum), As<__m128i>(v)))); }
  static Short PackColumns(Sums sums) { return PackEvenOdd(sums.low, sums.high); }
  static void Stream(void * p, X86 v) { _mm_stream_si128(static_cast<__m128i *>(p), v); }
#else
  template <typename TMask>
  static bool AreAll(TMask mask) { return (As<Long>(mask)[0] & As<Long>(mask)[1]) == -1; }
  static bool AreFinite(Single v) { return AreAll(v * SetSingle(0) == 0); }
  static std::uint32_t GetSigns(Float mask)
  {
    const Long bits = As<Long>(As<Int>(mask) & Int{ 1, 2, 4, 8 });
    const long long two = bits[0] | bits[1];
    return static_cast<std::uint32_t>(two | two >> 32);
  }
  /** The bits of VCount bytes that are \a label or, if that is 0, not 0. */
  template <std::ptrdiff_t VCount>
  static std::uint32_t FindLabel(const std::uint8_t * p, std::uint8_t label)
  {
    unsigned long long bytes = 0;
    __builtin_memcpy(&bytes, p, VCount);
    const Quad found = As<Quad>(As<Quad>(Long{ static_cast<long long>(bytes), 0 }) == As<Quad>(SetInt(0x01010101 * label)));
    const auto equal = static_cast<std::uint32_t>((static_cast<unsigned long long>(As<Long>(found)[0]) & 0x8040201008040201) * 0x0101010101010101 >> 56);
    return (label == 0 ? ~equal : equal) & ((1U << VCount) - 1);
  }
  static void StoreLine(void * p, const void * line, bool) { __builtin_memcpy(p, line, 64); }
  static void FinishLines() {}
#endif

  static std::uint32_t FindSet(const std::int16_t * p)
  {
    const Short bits = { 1, 2, 4, 8, 16, 32, 64, 128 };
    std::uint32_t set = 0;
    for (std::ptrdiff_t n = 0; n < 4; ++n)
    {
      const Long found = As<Long>(Load(p + 8 * n) & bits);
      const long long four = found[0] | found[1];
      const long long two = four | four >> 32;
      set |= (static_cast<std::uint32_t>(two | two >> 16) & 0xFFU) << 8 * n;
    }
    return set;
  }
  static std::uint32_t GetSigns(Double mask)
  {
    const DoubleMask bits = As<DoubleMask>(mask) & DoubleMask{ 1, 2, 4, 8 };
    return static_cast<std::uint32_t>(bits[0] | bits[1] | bits[2] | bits[3]);
  }
  static Float SquareRoot(Float v) { return Float{ __builtin_sqrtf(v[0]), __builtin_sqrtf(v[1]), __builtin_sqrtf(v[2]), __builtin_sqrtf(v[3]) }; }
  static Double SquareRoot(Double v) { return Double{ __builtin_sqrt(v[0]), __builtin_sqrt(v[1]), __builtin_sqrt(v[2]), __builtin_sqrt(v[3]) }; }

  /** Samples that fade to \a to, by \a factor times \a factors. */
  template <bool VIsUnsigned>
  static Short Fade(Short v, const float * factors, float factor, float to)
  {
    const auto fade = [factor, to](Int from, const float * p)
    {
      const Float product = Multiply(SetFloat(factor), Load(p));
      const Float faded = Add(SetFloat(to), Multiply(Subtract(__builtin_convertvector(from, Float), SetFloat(to)), product));
      const Float half = Add(faded, SetFloat(0.5f));
      const Int whole = __builtin_convertvector(half, Int);
      return whole + As<Int>(__builtin_convertvector(whole, Float) > half);
    };
    const Short sign = VIsUnsigned ? Short{} : v >> 15;
    const Int low = fade(As<Int>(InterleaveQuadLow(As<Quad>(v), As<Quad>(sign), short{})), factors);
    const Int high = fade(As<Int>(InterleaveQuadHigh(As<Quad>(v), As<Quad>(sign), short{})), factors + 4);
    return SHEARWARP_SHUFFLE(As<Short>(low), As<Short>(high), 0, 2, 4, 6, 8, 10, 12, 14);
  }

  template <typename TPixel>
  static void StoreLow(TPixel * p, Index v)
  {
    for (int n = 0; n < 4; ++n)
    {
      p[n] = static_cast<TPixel>(v[n]);
    }
  }
  template <int VSize>
  static Index Gather(const void * p, Index v)
  {
    int values[4] = {};
    for (int n = 0; n < 4; ++n)
    {
      __builtin_memcpy(values + n, static_cast<const char *>(p) + std::ptrdiff_t{ v[n] } * VSize, 4);
    }
    return LoadVector<Index>(values);
  }
  static Single GatherSingle(const float * p, Index v) { return Single{ p[v[0]], p[v[1]], p[v[2]], p[v[3]] }; }
  static Double IndexToDouble(Index v) { return __builtin_convertvector(v, Double); }
  static Double SingleToDouble(Single v) { return __builtin_convertvector(v, Double); }
#endif

  /** The lanes of b that have a bit, the others of a. */
  static Short Select(Short a, Short b, std::uint32_t lanes)
  {
    constexpr unsigned short values[] = { 1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768 };
    const Short bits = Load(values);
    return (Set(static_cast<int>(lanes)) & bits) == bits ? b : a;
  }

  /** Of each lane of \a better, the better one of \a before and \a sample, the least rank of those that are it. */
  static Short SelectNearest(Short before, Short sample, Short better, Short rankBefore, Short rank)
  {
    const Short least = sample == better ? Minimum(rankBefore, rank) : rankBefore;
    return before == better ? least : rank;
  }
  static Short SetRank(std::int16_t v) { return Set(v); }
  /** The ranks of rays that are at \a beyond before and then meet a worse sample, which is not \a none, have EndedRank
   * added. */
  static Short EndRays(Short before, Short beyond, Short better, Short sample, Short, Short ranks) { return ranks | ((better != sample) & (before == beyond) & Set(-32768)); }
  /** The lanes of \a kept whose ranks are negative, the others of \a v. */
  static Short KeepEnded(Short ranks, Short kept, Short v) { return ranks < 0 ? kept : v; }

  static Short Magnitude(Short v) { return Maximum(v, Subtract(Short{}, v)); }
  static Short MaximumMagnitude(Short a, Short b) { return MaximumUnsigned(a, b); }
  static Short LargerMagnitude(Short best, Short v)
  {
    const Short ofBest = Magnitude(best);
    const Short ofV = Magnitude(v);
    const Short larger = MaximumUnsigned(ofBest, ofV);
    return (larger == ofV) & ((larger != ofBest) | (v > best)) ? v : best;
  }

  static Int MaximumInt(Int a, Int b) { return a > b ? a : b; }
  static Int MinimumInt(Int a, Int b) { return a < b ? a : b; }

  static Float Load(const float * p) { return LoadVector<Float>(p); }
  static void Store(float * p, Float v) { StoreVector(p, v); }
  static Float SetFloat(float v) { return v - Float{}; }
  static Float SetPixel(float v) { return SetFloat(v); }
  static bool AreEqual(Short a, Short b) { return AreAll(a == b); }
  static bool AreEqual(Float a, Float b) { return AreAll(a == b); }
  static Float Add(Float a, Float b) { return a + b; }
  static Float Subtract(Float a, Float b) { return a - b; }
  static Float Multiply(Float a, Float b) { return a * b; }
  static Float Maximum(Float maximum, Float v) { return v > maximum ? v : maximum; }
  static Float Minimum(Float minimum, Float v) { return v < minimum ? v : minimum; }
  static Float Magnitude(Float v) { return As<Float>(As<Int>(v) & SetInt(0x7FFFFFFF)); }
  static Float MaximumMagnitude(Float a, Float b) { return Maximum(a, b); }
  static Float LargerMagnitude(Float best, Float v)
  {
    const Float ofBest = Magnitude(best);
    const Float ofV = Magnitude(v);
    return (ofV > ofBest) | ((ofV == ofBest) & (v > best)) ? v : best;
  }
  static Int GetMask(std::uint32_t lanes)
  {
    constexpr std::int32_t values[] = { 1, 2, 4, 8, 16, 32, 64, 128 };
    const Int bits = Load(values);
    return (SetInt(static_cast<int>(lanes)) & bits) == bits;
  }
  static Float Select(Float a, Float b, std::uint32_t lanes) { return GetMask(lanes) ? b : a; }
  /** The same for lanes of 32 bits if VIsWide. */
  template <bool>
  static Int SelectRanks(Int a, Int b, std::uint32_t lanes) { return GetMask(lanes) ? b : a; }
  template <bool>
  static Short SelectRanks(Short a, Short b, std::uint32_t lanes) { return Select(a, b, lanes); }


  static Int Load(const std::int32_t * p) { return LoadVector<Int>(p); }
  static void Store(std::int32_t * p, Int v) { StoreVector(p, v); }
  static Int SetRank(std::int32_t v) { return SetInt(v); }
  static Int EndRays(Float before, Float beyond, Float better, Float sample, Float none, Int ranks)
  {
    const Int isWorse = (better > sample) | (better < sample);
    const Int isSample = (sample > none) | (sample < none);
    return ranks | (isWorse & isSample & (before == beyond) & SetInt(-2147483647 - 1));
  }
  static Float KeepEnded(Int ranks, Float kept, Float v) { return ranks < 0 ? kept : v; }
  static Int SelectNearest(Float before, Float sample, Float better, Int rankBefore, Int rank)
  {
    const Int least = sample == better ? MinimumInt(rankBefore, rank) : rankBefore;
    return before == better ? least : rank;
  }

  template <bool>
  static Float Fade(Float v, const float * factors, float factor, float to)
  {
    const Float faded = Add(SetFloat(to), Multiply(Subtract(v, SetFloat(to)), Multiply(SetFloat(factor), Load(factors))));
    return v > SetFloat(to) ? Minimum(v, faded) : Maximum(v, faded);
  }

  static Double Load(const double * p) { return LoadVector<Double>(p); }
  static void Store(double * p, Double v) { StoreVector(p, v); }
  static Double SetDouble(double v) { return Double{ v, v, v, v }; }
  static Double Count(double first) { return SetDouble(first) + Double{ 0, 1, 2, 3 }; }
  static Double AddDouble(Double a, Double b) { return a + b; }
  static Double MultiplyDouble(Double a, Double b) { return a * b; }
  static bool AreWithin(Double v, double begin, double end) { return GetSigns(As<Double>((v >= SetDouble(begin)) & (v < SetDouble(end)))) == 0xF; }
  static Index DoubleToIndex(Double v) { return __builtin_convertvector(v, Index); }
  static Index SetIndex(int v) { return v - Index{}; }
  static int First(Index v) { return v[0]; }
  static int Last(Index v) { return v[3]; }
  static Index AddIndex(Index a, Index b) { return a + b; }
  static Index SubtractIndex(Index a, Index b) { return a - b; }
  static Index MultiplyIndex(Index a, Index b) { return a * b; }
  static Index AndIndex(Index a, Index b) { return a & b; }
  static Index ShiftLeft(Index v, int bits) { return As<Index>(As<UnsignedIndex>(v) << bits); }
  static Index ShiftRight(Index v, int bits) { return v >> bits; }
  static Index ShiftRightLogical(Index v, int bits) { return As<Index>(As<UnsignedIndex>(v) >> bits); }

  static Single SetSingle(float v) { return v - Single{}; }
  static void StoreSingle(float * p, Single v) { StoreVector(p, v); }
  /** \a a if both are equal or one is not a number. */
  static Single MaximumSingle(Single a, Single b) { return b > a ? b : a; }
  static Single MinimumSingle(Single a, Single b) { return b < a ? b : a; }
  static Single SelectWhereZero(Index v, Single zero, Single other) { return v == 0 ? zero : other; }
  static Single DoubleToSingle(Double v) { return __builtin_convertvector(v, Single); }

  static Quad LoadQuad(const void * p) { return LoadVector<Quad>(p); }
  static void StoreQuad(void * p, Quad v) { StoreVector(p, v); }
  template <typename TPixel>
  static Quad InterleaveQuadLow(Quad a, Quad b, TPixel)
  {
    if constexpr (sizeof(TPixel) == 1)
    {
      return SHEARWARP_SHUFFLE(a, b, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
    }
    else if constexpr (sizeof(TPixel) == 2)
    {
      return As<Quad>(SHEARWARP_SHUFFLE(As<QuadShort>(a), As<QuadShort>(b), 0, 8, 1, 9, 2, 10, 3, 11));
    }
    else
    {
      return As<Quad>(SHEARWARP_SHUFFLE(As<Index>(a), As<Index>(b), 0, 4, 1, 5));
    }
  }
  template <typename TPixel>
  static Quad InterleaveQuadHigh(Quad a, Quad b, TPixel)
  {
    if constexpr (sizeof(TPixel) == 1)
    {
      return SHEARWARP_SHUFFLE(a, b, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
    }
    else if constexpr (sizeof(TPixel) == 2)
    {
      return As<Quad>(SHEARWARP_SHUFFLE(As<QuadShort>(a), As<QuadShort>(b), 4, 12, 5, 13, 6, 14, 7, 15));
    }
    else
    {
      return As<Quad>(SHEARWARP_SHUFFLE(As<Index>(a), As<Index>(b), 2, 6, 3, 7));
    }
  }

  static void Prefetch(const char * p) { __builtin_prefetch(p); }
  static void PrefetchFar(const char * p) { __builtin_prefetch(p, 0, 2); }
  // clang-format on
};

#include "Scalar.h"
#include "Vector.h"
} // namespace

#define SPECIALIZE(TPixel)                        \
  template <>                                     \
  const Kernels<TPixel> & SHEARWARP_GET_KERNELS() \
  {                                               \
    return VectorKernels<TPixel>;                 \
  }
SHEARWARP_FOR_EACH_VECTOR_PIXEL_TYPE(SPECIALIZE)
#undef SPECIALIZE
} // namespace itk::ShearWarp
