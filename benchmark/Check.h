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
#ifndef Check_h
#define Check_h

#include <string>

namespace itk::ShearWarpBenchmark
{
/** Projects a smooth volume, one blob, by ray casting and by the filter from all views, and compares each pixel. Linear
 * interpolation between samples at distance h misses a function of curvature c by at most c h^2 / 8. The filter does it
 * along the two axes of a slice and of the intermediate image, and for a ray's maximum its samples are at most sqrt(3)
 * voxels apart, which makes 7 c / 8; ray casting misses less, in the same direction. Integers may differ by two more
 * for rounding. A shift by half a voxel would be 1.7 times as much.
 * Returns an empty string if they agree, otherwise by how much they differ. Instantiated for `uint8 int16 uint16
 * float`. */
template <typename TPixel>
std::string
CheckRayCasting();
} // namespace itk::ShearWarpBenchmark

#endif
