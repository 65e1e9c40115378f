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
#ifndef itkShearWarpLanesCommon_h
#define itkShearWarpLanesCommon_h

/* Vectors of the compiler, and operations that every processor has. The header of each instruction set includes this
 * header first. */

#ifdef __clang__
#  define SHEARWARP_SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#  define SHEARWARP_SHUFFLE(a, b, ...) __builtin_shuffle(a, b, decltype(a){ __VA_ARGS__ })
#endif

namespace Lanes
{
constexpr char           Name[] = SHEARWARP_INSTRUCTION_SET;
constexpr std::ptrdiff_t ShortCount = SHEARWARP_VECTOR_BYTES / 2;
constexpr std::ptrdiff_t FloatCount = SHEARWARP_VECTOR_BYTES / 4;
constexpr std::ptrdiff_t WarpCount = SHEARWARP_VECTOR_BYTES == 64 ? 8 : 4;

// clang-format off
// pixels; pixels of 8 bits have lanes of 16 bits
using Short [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = short;
using UnsignedShort [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = unsigned short;
using Int [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = int;
using UnsignedInt [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = unsigned int;
using Float [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = float;
// positions and pixels of the warp
using Index [[gnu::vector_size(4 * WarpCount)]] = int;
using UnsignedIndex [[gnu::vector_size(4 * WarpCount)]] = unsigned int;
using Single [[gnu::vector_size(4 * WarpCount)]] = float;
using Double [[gnu::vector_size(8 * WarpCount)]] = double;
using DoubleMask [[gnu::vector_size(8 * WarpCount)]] = long long;
// 128 bits
using Quad [[gnu::vector_size(16)]] = unsigned char;
using QuadShort [[gnu::vector_size(16)]] = short;
using QuadInt [[gnu::vector_size(16)]] = int;
using QuadLong [[gnu::vector_size(16)]] = long long;

using HalfShort [[gnu::vector_size(SHEARWARP_VECTOR_BYTES / 2)]] = short;
using HalfUnsignedShort [[gnu::vector_size(SHEARWARP_VECTOR_BYTES / 2)]] = unsigned short;
using HalfFloat [[gnu::vector_size(SHEARWARP_VECTOR_BYTES / 2)]] = float;
using FullDouble [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = double;

/** Weighted sums of the lanes of a Short, in two halves. */
struct Sums { Int low, high; };

template <typename TVector>
// cppcheck-suppress uninitvar
TVector LoadVector(const void * p) { TVector v; __builtin_memcpy(&v, p, sizeof(v)); return v; }
template <typename TVector>
void StoreVector(void * p, TVector v) { __builtin_memcpy(p, &v, sizeof(v)); }
/** The same bits as another type. */
template <typename TTo, typename TFrom>
TTo As(TFrom v) { return reinterpret_cast<TTo>(v); }

inline Short Load(const unsigned short * p) { return LoadVector<Short>(p); }
inline Short Load(const short * p) { return LoadVector<Short>(p); }
inline Int Load(const std::int32_t * p) { return LoadVector<Int>(p); }
inline Float Load(const float * p) { return LoadVector<Float>(p); }
inline Double Load(const double * p) { return LoadVector<Double>(p); }
inline void Store(unsigned short * p, Short v) { StoreVector(p, v); }
inline void Store(short * p, Short v) { StoreVector(p, v); }
inline void Store(std::int32_t * p, Int v) { StoreVector(p, v); }
inline void Store(float * p, Float v) { StoreVector(p, v); }
inline void Store(double * p, Double v) { StoreVector(p, v); }

inline Short Set(int v) { return static_cast<short>(v) - Short{}; }
inline Int SetInt(int v) { return v - Int{}; }
inline Float SetFloat(float v) { return v - Float{}; }
inline Short SetPixel(int v) { return Set(v); }
inline Float SetPixel(float v) { return SetFloat(v); }
inline Short SetRank(std::int16_t v) { return Set(v); }
inline Int SetRank(std::int32_t v) { return SetInt(v); }
inline Short SetPairs(int low, int high) { return As<Short>(SetInt(low | high << 16)); }

inline Short Add(Short a, Short b) { return As<Short>(As<UnsignedShort>(a) + As<UnsignedShort>(b)); }
inline Short Subtract(Short a, Short b) { return As<Short>(As<UnsignedShort>(a) - As<UnsignedShort>(b)); }
inline Float Add(Float a, Float b) { return a + b; }
inline Float Subtract(Float a, Float b) { return a - b; }
inline Float Multiply(Float a, Float b) { return a * b; }
inline Short FlipSign(Short v) { return v ^ Set(-32768); }
inline Int MaximumInt(Int a, Int b) { return a > b ? a : b; }
inline Int MinimumInt(Int a, Int b) { return a < b ? a : b; }
/** \a maximum if both are equal or one is not a number. */
inline Float Maximum(Float maximum, Float v) { return v > maximum ? v : maximum; }
inline Float Minimum(Float minimum, Float v) { return v < minimum ? v : minimum; }

/** The lanes of \a kept whose ranks are negative, the other lanes of \a v. */
inline Short KeepEnded(Short ranks, Short kept, Short v) { return ranks < 0 ? kept : v; }
inline Float KeepEnded(Int ranks, Float kept, Float v) { return ranks < 0 ? kept : v; }

/** Adds EndedRank to the ranks of rays that were at \a beyond before, and then have a worse sample, but not \a none. */
inline Short EndRays(Short before, Short beyond, Short better, Short sample, Short, Short ranks)
{
  return ranks | ((better != sample) & (before == beyond) & Set(-32768));
}
inline Int EndRays(Float before, Float beyond, Float better, Float sample, Float none, Int ranks)
{
  const Int isWorse = (better > sample) | (better < sample);
  const Int isSample = (sample > none) | (sample < none);
  return ranks | (isWorse & isSample & (before == beyond) & SetInt(-2147483647 - 1));
}

/** Returns floats that fade to \a to by \a factor times \a factors. */
template <bool>
Float Fade(Float v, const float * factors, float factor, float to)
{
  const Float product = Multiply(SetFloat(factor), Load(factors));
  const Float faded = Add(SetFloat(to), Multiply(Subtract(v, SetFloat(to)), product));
  return v > SetFloat(to) ? Minimum(v, faded) : Maximum(v, faded);
}

/** The sums of pixels, in the order of memory. */
template <bool VIsUnsigned>
Sums Widen(Short v)
{
  using Half = std::conditional_t<VIsUnsigned, HalfUnsignedShort, HalfShort>;
  Half halves[2];
  __builtin_memcpy(halves, &v, sizeof(v));
  return { __builtin_convertvector(halves[0], Int), __builtin_convertvector(halves[1], Int) };
}
inline Sums AddSums(Sums a, Sums b) { return { a.low + b.low, a.high + b.high }; }
inline Sums LoadSums(const void * p)
{
  return { LoadVector<Int>(p), LoadVector<Int>(static_cast<const char *>(p) + sizeof(Int)) };
}
inline void StoreSums(void * p, Sums v)
{
  StoreVector(p, v.low);
  StoreVector(static_cast<char *>(p) + sizeof(Int), v.high);
}
/** Adds floats to doubles. */
inline void AddFloats(double * p, Float v)
{
  HalfFloat halves[2];
  __builtin_memcpy(halves, &v, sizeof(v));
  for (std::ptrdiff_t half = 0; half < 2; ++half)
  {
    double * const sums = p + half * FloatCount / 2;
    StoreVector(sums, LoadVector<FullDouble>(sums) + __builtin_convertvector(halves[half], FullDouble));
  }
}
/** Zero where \a v is not a number. */
inline Float Number(Float v) { return ((v >= 0) | (v < 0)) ? v : Float{}; }
/** The sign bits of lanes that are not a number are set. */
inline Float FindNotNumbers(Float v) { return As<Float>(~((v >= 0) | (v < 0))); }

inline Double SetDouble(double v) { return v - Double{}; }
/** \a first, \a first + 1, and so on. */
inline Double Count(double first)
{
  constexpr double numbers[] = { 0, 1, 2, 3, 4, 5, 6, 7 };
  return SetDouble(first) + LoadVector<Double>(numbers);
}
inline Double AddDouble(Double a, Double b) { return a + b; }
inline Double MultiplyDouble(Double a, Double b) { return a * b; }
inline Index DoubleToIndex(Double v) { return __builtin_convertvector(v, Index); }
inline Single DoubleToSingle(Double v) { return __builtin_convertvector(v, Single); }
inline Index SetIndex(int v) { return v - Index{}; }
inline int First(Index v) { return v[0]; }
inline int Last(Index v) { return v[WarpCount - 1]; }
inline Index AddIndex(Index a, Index b) { return a + b; }
inline Index SubtractIndex(Index a, Index b) { return a - b; }
inline Index MultiplyIndex(Index a, Index b) { return a * b; }
inline Index AndIndex(Index a, Index b) { return a & b; }
inline Index ShiftLeft(Index v, int bits) { return As<Index>(As<UnsignedIndex>(v) << bits); }
inline Index ShiftRight(Index v, int bits) { return v >> bits; }
inline Index ShiftRightLogical(Index v, int bits) { return As<Index>(As<UnsignedIndex>(v) >> bits); }

inline Single SetSingle(float v) { return v - Single{}; }
inline void StoreSingle(float * p, Single v) { StoreVector(p, v); }
/** \a a if both are equal or one is not a number. */
inline Single MaximumSingle(Single a, Single b) { return b > a ? b : a; }
inline Single MinimumSingle(Single a, Single b) { return b < a ? b : a; }
inline Single SelectWhereZero(Index v, Single zero, Single other) { return v == 0 ? zero : other; }

inline Quad LoadQuad(const void * p) { return LoadVector<Quad>(p); }
inline void StoreQuad(void * p, Quad v) { StoreVector(p, v); }
template <typename TPixel>
Quad InterleaveQuadLow(Quad a, Quad b, TPixel)
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
    return As<Quad>(SHEARWARP_SHUFFLE(As<QuadInt>(a), As<QuadInt>(b), 0, 4, 1, 5));
  }
}
template <typename TPixel>
Quad InterleaveQuadHigh(Quad a, Quad b, TPixel)
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
    return As<Quad>(SHEARWARP_SHUFFLE(As<QuadInt>(a), As<QuadInt>(b), 2, 6, 3, 7));
  }
}

#ifdef __wasm__
constexpr bool HasPrefetch = false;
#else
constexpr bool HasPrefetch = true;
#endif
inline void Prefetch(const char * p) { __builtin_prefetch(p); }
inline void PrefetchFar(const char * p) { __builtin_prefetch(p, 0, 2); }
// clang-format on
} // namespace Lanes

#endif
