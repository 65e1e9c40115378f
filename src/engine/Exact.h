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
#ifndef itkShearWarpExact_h
#define itkShearWarpExact_h

#include "itkShearWarpEngine.h"
#include "PreparedVolume.h"

#include <vector>

namespace itk
{
namespace ShearWarp
{
/** Writes \a columns x \a rows pixels: on each one's own ray, the extremum of the trilinear interpolant of the voxels,
 * whose coordinates are clamped to the outer voxel centers, within half a voxel of these and within the intervals;
 * rounded once, half upward. Depths are those of the extremum, the nearest of several. A ray that is outside, or meets
 * no finite cell, gives the background.
 *
 * \a guess tells for each pixel of the sheared grid a slice that is likely to have the extremum. It saves time and
 * changes no bit. Throws MemoryAllocationError. */
template <typename TPixel>
void
ProjectExactly(const ExactView<TPixel> &         view,
               const Kernels<TPixel> &           kernels,
               const IntermediateImage<TPixel> & guess,
               std::ptrdiff_t                    columns,
               std::ptrdiff_t                    rows,
               const Picture<TPixel> &           picture,
               const Threads &                   threads,
               float                             share);
} // namespace ShearWarp
} // namespace itk

#endif
