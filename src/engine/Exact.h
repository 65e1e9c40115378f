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
#include "kernels/Kernels.h"

#include <cstddef>

namespace itk::ShearWarp
{
/** Makes an exact picture of `columns` x `rows` pixels. A pixel is the extremum of the interpolant on the pixel's ray:
 * the highest value, the lowest value, or the value of the largest magnitude. If the highest and the lowest value have
 * the same magnitude, the highest value wins. Integers are rounded once, half upward.
 *
 * The interpolant is trilinear between voxel centers. Within half a voxel of the outer centers, it has the value at the
 * nearest place between the centers. A ray ends where the volume ends, and where an interval of the view ends. Cells
 * with a voxel that is not finite are left out. A ray that meets no other cell gets the background.
 *
 * Depths are where the extrema are. Among equal extrema the nearest wins.
 *
 * \a guess, an intermediate image with ranks, tells for each ray in which slice the extremum probably is. The guess
 * saves time and changes no bit. `guess.pixels` is not used.
 *
 * \a runFill fills the picture with the background, and \a runSearch searches, which takes most of the time. The search
 * throws std::bad_alloc if there is no memory. */
template <typename TPixel>
void
ProjectExactly(const ExactView<TPixel> &         view,
               Mode                              mode,
               const Kernels<TPixel> &           kernels,
               const IntermediateImage<TPixel> & guess,
               std::ptrdiff_t                    columns,
               std::ptrdiff_t                    rows,
               const Picture<TPixel> &           picture,
               const RunTasks &                  runFill,
               const RunTasks &                  runSearch);
} // namespace itk::ShearWarp

#endif
