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
 * throws std::bad_alloc if there is no memory. `view.slices` are the whole volume. */
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

/** Searches a part of the volume in the same way, and merges what it finds with \a records, of \a region of the
 * picture. Merged records of all parts give the picture of the whole, bit by bit: see WriteExactly(). The volume has \a
 * volume columns, rows and slices, and `guess`, of the part, begins at \a guessBegin. */
template <typename TPixel>
void
SearchExactly(const ExactView<TPixel> & view,
              const std::ptrdiff_t (&volume)[3],
              const ProjectionRule<TPixel> &    rule,
              const Kernels<TPixel> &           kernels,
              const IntermediateImage<TPixel> & guess,
              const Corner &                    guessBegin,
              const IntermediateRegion &        region,
              unsigned char *                   records,
              const RunTasks &                  run);

/** Writes row \a row of an exact picture of \a columns columns. */
template <typename TPixel>
void
WriteExactly(const ProjectionRule<TPixel> & rule,
             const AffineMap2D &            outputToSheared,
             const ShearedFunction &        depth,
             const unsigned char *          records,
             std::ptrdiff_t                 columns,
             std::ptrdiff_t                 row,
             const Picture<TPixel> &        picture);

/** Returns the pixels of a picture whose rays may meet a part of the volume: one or more, and all for the whole volume.
 */
IntermediateRegion
FindExactRegion(const Factorization & factorization, const VoxelBox & box, const PictureGrid & grid);
} // namespace itk::ShearWarp

#endif
