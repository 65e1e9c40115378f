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
#ifndef itkShearWarpLanesScalarBits_h
#define itkShearWarpLanesScalarBits_h

/* Bits of lanes without an instruction that collects signs. */

namespace Lanes
{
// clang-format off
template <typename TMask>
bool AreAll(TMask mask) { return (As<QuadLong>(mask)[0] & As<QuadLong>(mask)[1]) == -1; }
inline bool AreFinite(Single v) { return AreAll(v * SetSingle(0) == 0); }
/** Returns a bit for each lane of a mask. */
inline std::uint32_t GetSigns(Float mask)
{
  const QuadLong  bits = As<QuadLong>(As<Int>(mask) & Int{ 1, 2, 4, 8 });
  const long long two = bits[0] | bits[1];
  return static_cast<std::uint32_t>(two | two >> 32);
}
/** Returns a bit for each of VCount bytes that is \a label or, if \a label is 0, not 0. */
template <std::ptrdiff_t VCount>
std::uint32_t FindLabel(const std::uint8_t * p, std::uint8_t label)
{
  unsigned long long bytes = 0;
  __builtin_memcpy(&bytes, p, VCount);
  const Quad labels = As<Quad>(SetInt(0x01010101 * label));
  const Quad found = As<Quad>(As<Quad>(QuadLong{ static_cast<long long>(bytes), 0 }) == labels);
  const auto flags = static_cast<unsigned long long>(As<QuadLong>(found)[0]) & 0x8040201008040201;
  const auto equal = static_cast<std::uint32_t>(flags * 0x0101010101010101 >> 56);
  return (label == 0 ? ~equal : equal) & ((1U << VCount) - 1);
}
inline Float SquareRoot(Float v)
{
  return Float{ __builtin_sqrtf(v[0]), __builtin_sqrtf(v[1]), __builtin_sqrtf(v[2]), __builtin_sqrtf(v[3]) };
}
inline void StoreLine(void * p, const void * line, bool) { __builtin_memcpy(p, line, 64); }
inline void FinishLines() {}
// clang-format on
} // namespace Lanes

#endif
