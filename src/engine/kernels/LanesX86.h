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
#ifndef itkShearWarpLanesX86_h
#define itkShearWarpLanesX86_h

/* Operations that SSE2, AVX2 and AVX-512 have under names that differ by SHEARWARP_X86. */

namespace Lanes
{
// clang-format off
/** Intrinsics have integers of 64 bits. */
using X86 [[gnu::vector_size(SHEARWARP_VECTOR_BYTES)]] = long long;

inline Short Maximum(Short maximum, Short v)
{
  return As<Short>(SHEARWARP_X86(max_epi16)(As<X86>(maximum), As<X86>(v)));
}
inline Short Minimum(Short minimum, Short v)
{
  return As<Short>(SHEARWARP_X86(min_epi16)(As<X86>(minimum), As<X86>(v)));
}

/** Adds the products of two neighbours. */
inline Int AddPairProducts(Int sum, Short a, Short b)
{
#ifdef __AVX512VNNI__
  return As<Int>(SHEARWARP_X86(dpwssd_epi32)(As<X86>(sum), As<X86>(a), As<X86>(b)));
#else
  return sum + As<Int>(SHEARWARP_X86(madd_epi16)(As<X86>(a), As<X86>(b)));
#endif
}
/** Halves are the even and the odd columns. */
inline Sums AddColumns(Sums sums, Short left, Short right, Short weights)
{
  return { AddPairProducts(sums.low, left, weights), AddPairProducts(sums.high, right, weights) };
}
/** Halves are the halves of interleaved vectors. */
inline Sums AddRows(Sums sums, Short above, Short below, Short weights)
{
  const auto low = As<Short>(SHEARWARP_X86(unpacklo_epi16)(As<X86>(above), As<X86>(below)));
  const auto high = As<Short>(SHEARWARP_X86(unpackhi_epi16)(As<X86>(above), As<X86>(below)));
  return { AddPairProducts(sums.low, low, weights), AddPairProducts(sums.high, high, weights) };
}
inline Short PackRows(Sums sums)
{
  return As<Short>(SHEARWARP_X86(packs_epi32)(As<X86>(sums.low >> 15), As<X86>(sums.high >> 15)));
}

inline Float SquareRoot(Float v) { return SHEARWARP_X86(sqrt_ps)(v); }

inline void Stream(void * p, X86 v);
/** Copies a line of the cache. If it is aligned, the copy goes past the caches. */
inline void StoreLine(void * p, const void * line, bool isAligned)
{
  for (int n = 0; n < 64; n += SHEARWARP_VECTOR_BYTES)
  {
    const auto v = LoadVector<X86>(static_cast<const char *>(line) + n);
    char *     target = static_cast<char *>(p) + n;
    if (isAligned)
    {
      Stream(target, v);
    }
    else
    {
      StoreVector(target, v);
    }
  }
}
inline void FinishLines() { _mm_sfence(); }
// clang-format on
} // namespace Lanes

#endif
