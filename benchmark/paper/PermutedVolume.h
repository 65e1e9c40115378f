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
#ifndef PermutedVolume_h
#define PermutedVolume_h

#include "itkImage.h"
#include "itkShearWarpFactorization.h"

#include <cstdint>
#include <vector>

namespace itk::ShearWarpBenchmark
{
/** One of the three copies of a volume that Fang et al. 2002 make before any view, one for each principal axis: its
 * slices along that axis one behind the other, so that a projection reads them in storage order.
 *
 * Axes are in the order of ShearWarpFactorization: i, contiguous in memory, then j, then the principal axis k. Each
 * slice has a border of one voxel that repeats its outer voxels. */
struct PermutedVolume
{
  /** \a principalAxis is 0, 1 or 2. */
  PermutedVolume(const Image<std::uint16_t, 3> * image, unsigned int principalAxis);

  /** Slice k, from the corner of its border on. */
  const std::uint16_t *
  GetSlice(std::ptrdiff_t k) const
  {
    return voxels.data() + k * rowStride * (rows + 2);
  }
  std::uint16_t *
  GetSlice(std::ptrdiff_t k)
  {
    return voxels.data() + k * rowStride * (rows + 2);
  }

  /** Size without the border, in voxels, and voxels from row to row. */
  std::ptrdiff_t             columns, rows, slices;
  std::ptrdiff_t             rowStride;
  std::vector<std::uint16_t> voxels;
};

/** Shears \a volume, the copy for the factorization's principal axis, slice by slice in storage order: for each row of
 * a slice calls \a process(weights, cell, column, row), where \a cell points to the first voxel of the row's first
 * cell, which falls on pixel (column, row) of the intermediate image; those of the next cells and pixels follow. */
template <typename TFunction>
void
ForEachRow(const PermutedVolume & volume, const ShearWarpFactorization & factorization, const TFunction & process)
{
  for (std::ptrdiff_t k = 0; k < volume.slices; ++k)
  {
    const ShearWarp::SlicePlacement & placement = factorization.GetSlicePlacements()[k];
    const ShearWarp::BilinearWeights  weights(placement.column.fraction, placement.row.fraction);
    const std::ptrdiff_t              firstColumn = placement.FirstColumn();
    const std::ptrdiff_t              firstRow = placement.FirstRow();
    for (std::ptrdiff_t row = firstRow; row < firstRow + volume.rows; ++row)
    {
      // the border shifts a voxel by one, a cell begins one before the pixel
      const std::uint16_t * cell =
        volume.GetSlice(k) + (row - placement.row.whole) * volume.rowStride + (firstColumn - placement.column.whole);
      process(weights, cell, firstColumn, row);
    }
  }
}

/** The shear-warp of Fang et al. 2002 without reduced resampling (figure 2 and equation 2), in one thread: \a volume,
 * the copy for the factorization's principal axis, slice by slice onto an intermediate image of the factorization's
 * size, that of PlainShearWarp bit by bit. Pixels that no slice reaches are 0. Without oversampling. */
std::vector<std::uint16_t>
Project(const PermutedVolume & volume, const ShearWarpFactorization & factorization);
} // namespace itk::ShearWarpBenchmark

#endif
