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
#ifndef itkShearWarpLanesPairs_h
#define itkShearWarpLanesPairs_h

/* Products of pairs by the compiler's vectors. Included for processors without an instruction for pairs. */

namespace Lanes
{
// clang-format off
/** The even and the odd elements of 16 bits. */
inline Int GetEven(Short v) { return As<Int>(As<UnsignedInt>(v) << 16) >> 16; }
inline Int GetOdd(Short v) { return As<Int>(v) >> 16; }
/** Shifts by 15 bits, and keeps 16 bits of each. */
inline Short PackEvenOdd(Int even, Int odd)
{
  return As<Short>(((even >> 15) & SetInt(0xFFFF)) | (As<Int>(As<UnsignedInt>(odd) << 1) & SetInt(-65536)));
}
// clang-format on
} // namespace Lanes

#endif
