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
#ifndef ReadLimit_h
#define ReadLimit_h

#include <cstddef>

namespace itk::ShearWarpBenchmark
{
template <typename TPixel>
struct ReadLimit
{
  TPixel maximum;
  double seconds;
};

/** Reads a whole volume as fast as the memory gives it to so many threads: every projection has to read it too, and the
 * largest voxel is about the least that can be computed on the way. Each thread reads four streams of memory at a time.
 * All threads are awake before the clock starts, so that they add nothing to the limit. Instantiated for
 * `uint8 int16 uint16 float`. */
template <typename TPixel>
ReadLimit<TPixel>
MeasureReadLimit(const TPixel * voxels, std::size_t count, unsigned int threads);
} // namespace itk::ShearWarpBenchmark

#endif
