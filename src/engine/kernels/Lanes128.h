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
#ifndef itkShearWarpLanes128_h
#define itkShearWarpLanes128_h

/* Vectors of 128 bits: operations for which the compiler's vectors suffice. Included after PackBytes(). */

namespace Lanes
{
// clang-format off
/** Bytes in the low or high halves of lanes. */
inline Short LoadBytes(const void * p, bool isHigh)
{
  long long bytes;
  __builtin_memcpy(&bytes, p, sizeof(bytes));
  const Quad v = As<Quad>(QuadLong{ bytes, 0 });
  return As<Short>(isHigh ? InterleaveQuadLow(Quad{}, v, char{}) : InterleaveQuadLow(v, Quad{}, char{}));
}
inline Short Load(const unsigned char * p) { return LoadBytes(p, false); }
inline Short Load(const signed char * p) { return LoadBytes(p, true) >> 8; }
template <typename TByte, std::enable_if_t<sizeof(TByte) == 1, bool> = true>
void Store(TByte * p, Short v)
{
  const long long bytes = As<QuadLong>(PackBytes(v))[0];
  __builtin_memcpy(p, &bytes, sizeof(bytes));
}

/** Returns a bit for each of CellColumns numbers that is -1; the other numbers are 0. */
inline std::uint32_t FindSet(const std::int16_t * p)
{
  const Short bits = { 1, 2, 4, 8, 16, 32, 64, 128 };
  std::uint32_t set = 0;
  for (std::ptrdiff_t n = 0; n < 4; ++n)
  {
    const QuadLong  found = As<QuadLong>(Load(p + 8 * n) & bits);
    const long long four = found[0] | found[1];
    const long long two = four | four >> 32;
    set |= (static_cast<std::uint32_t>(two | two >> 16) & 0xFFU) << 8 * n;
  }
  return set;
}
/** Returns a bit for each lane of a mask. */
inline std::uint32_t GetSigns(Double mask)
{
  const DoubleMask bits = As<DoubleMask>(mask) & DoubleMask{ 1, 2, 4, 8 };
  return static_cast<std::uint32_t>(bits[0] | bits[1] | bits[2] | bits[3]);
}
inline Double SquareRoot(Double v)
{
  return Double{ __builtin_sqrt(v[0]), __builtin_sqrt(v[1]), __builtin_sqrt(v[2]), __builtin_sqrt(v[3]) };
}

/** Returns samples that fade to \a to by \a factor times \a factors. */
template <bool VIsUnsigned>
Short Fade(Short v, const float * factors, float factor, float to)
{
  const auto fade = [factor, to](Int from, const float * p)
  {
    const Float product = Multiply(SetFloat(factor), Load(p));
    const Float difference = Subtract(__builtin_convertvector(from, Float), SetFloat(to));
    const Float half = Add(Add(SetFloat(to), Multiply(difference, product)), SetFloat(0.5f));
    const Int   whole = __builtin_convertvector(half, Int);
    return whole + As<Int>(__builtin_convertvector(whole, Float) > half);
  };
  const Short sign = VIsUnsigned ? Short{} : v >> 15;
  const Int   low = fade(As<Int>(InterleaveQuadLow(As<Quad>(v), As<Quad>(sign), short{})), factors);
  const Int   high = fade(As<Int>(InterleaveQuadHigh(As<Quad>(v), As<Quad>(sign), short{})), factors + 4);
  return SHEARWARP_SHUFFLE(As<Short>(low), As<Short>(high), 0, 2, 4, 6, 8, 10, 12, 14);
}

/** Stores the low bits of each element. */
template <typename TPixel>
void StoreLow(TPixel * p, Index v)
{
  for (int n = 0; n < 4; ++n)
  {
    p[n] = static_cast<TPixel>(v[n]);
  }
}
/** Loads 32 bits at each index, in units of VSize bytes. */
template <int VSize>
Index Gather(const void * p, Index v)
{
  int values[4] = {};
  for (int n = 0; n < 4; ++n)
  {
    __builtin_memcpy(values + n, static_cast<const char *>(p) + std::ptrdiff_t{ v[n] } * VSize, 4);
  }
  return LoadVector<Index>(values);
}
inline Single GatherSingle(const float * p, Index v) { return Single{ p[v[0]], p[v[1]], p[v[2]], p[v[3]] }; }
inline Double IndexToDouble(Index v) { return __builtin_convertvector(v, Double); }
inline Double SingleToDouble(Single v) { return __builtin_convertvector(v, Double); }
// clang-format on
} // namespace Lanes

#endif
