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
#ifndef Data_h
#define Data_h

#include "itkImage.h"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace itk::ShearWarpBenchmark
{
/** A kind of synthetic volume: its name, one sentence about its voxels, how many bits they have, and how they are made.
 */
struct Kind
{
  std::string                                    name;
  std::string                                    description;
  unsigned int                                   bits;
  std::function<void(Image<std::uint16_t, 3> &)> fill;
};

/** The kinds that MakeVolume() knows. */
const std::vector<Kind> &
GetKinds();

/** A volume of unit spacing, the same for any number of threads. The anatomy scales with \a size, the noise does not.
 * Values are those of the kind's description for `uint16`; `float` holds the same values, `int16` too (full 16-bit
 * noise shifted to its range), `uint8` the upper eight bits. Throws ExceptionObject for an unknown kind. */
template <typename TPixel>
typename Image<TPixel, 3>::Pointer
MakeVolume(const std::string & kind, const Size<3> & size);
} // namespace itk::ShearWarpBenchmark

#endif
