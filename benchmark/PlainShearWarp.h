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
#ifndef PlainShearWarp_h
#define PlainShearWarp_h

#include "itkImage.h"
#include "itkShearWarpFactorization.h"

#include <algorithm>
#include <vector>

/** The shear-warp of Fang et al. 2002 as one would write it first, from the factorization of a view: what the filter is
 * compared with, in speed and bit by bit. It shares no code with the filter's kernels but the slices' places and
 * the weights. The compiler is given the flags of a release build and may do what they allow.
 *
 * Voxels must be finite. Instantiated for `uint8 int16 uint16 float`; without oversampling. */
namespace itk::ShearWarpBenchmark
{
/** One of the three copies of a volume that the paper makes before any view, one for each principal axis: its slices
 * along that axis one behind the other, so that a projection reads them in storage order.
 *
 * Axes are in the order of ShearWarpFactorization: i, contiguous in memory, then j, then the principal axis k. Each
 * slice has a border of one voxel that repeats its outer voxels. */
template <typename TPixel>
struct PermutedVolume
{
  /** \a principalAxis is 0, 1 or 2. */
  PermutedVolume(const Image<TPixel, 3> * image, unsigned int principalAxis);

  /** Size without the border, in voxels, and voxels from row to row. */
  std::ptrdiff_t      columns, rows, slices;
  std::ptrdiff_t      rowStride;
  std::vector<TPixel> voxels;
};

/** Shears \a volume, the copy for the factorization's principal axis, slice by slice in storage order: for each row of
 * a slice that falls on rows [rowBegin, rowEnd) of the intermediate image calls \a process(placement, cell, column,
 * row), where \a cell points to the first voxel of the row's first cell, which falls on pixel (column, row); the next
 * cells follow, and fall on the next pixels. */
template <typename TPixel, typename TFunction>
void
ForEachRow(const PermutedVolume<TPixel> & volume,
           const ShearWarpFactorization & factorization,
           std::ptrdiff_t                 rowBegin,
           std::ptrdiff_t                 rowEnd,
           const TFunction &              process)
{
  for (std::ptrdiff_t k = 0; k < volume.slices; ++k)
  {
    const ShearWarp::SlicePlacement & placement = factorization.GetSlicePlacements()[k];
    const TPixel *                    slice = volume.voxels.data() + k * volume.rowStride * (volume.rows + 2);
    const std::ptrdiff_t              column = placement.FirstColumn();
    const std::ptrdiff_t              first = placement.FirstRow();
    for (std::ptrdiff_t row = std::max(rowBegin, first); row < std::min(rowEnd, first + volume.rows); ++row)
    {
      // the border shifts a voxel by one, a cell begins one before the pixel
      process(placement,
              slice + (row - placement.row.whole) * volume.rowStride + (column - placement.column.whole),
              column,
              row);
    }
  }
}

/** Figure 2 and equation 2 of the paper: the intermediate image, slice by slice. Each sample is the sum of four voxels
 * times the slice's four weights, and a pixel keeps the largest. Sums have 32 bits. Nothing is skipped. One thread
 * makes it or, if \a isParallel, all of ITK's. */
template <typename TPixel>
std::vector<TPixel>
Project(const PermutedVolume<TPixel> & volume, const ShearWarpFactorization & factorization, bool isParallel = false);

/** Bilinear interpolation of the intermediate image at the pixels of the factorization's output grid, of the given
 * size. Pixels that no slice reached are left out, and the weights of the others scaled to sum to one; where none is
 * left the output is \a background. */
template <typename TPixel>
std::vector<TPixel>
Warp(const ShearWarpFactorization & factorization,
     const std::vector<TPixel> &    intermediate,
     const Size<2> &                size,
     TPixel                         background = TPixel{},
     bool                           isParallel = false);
} // namespace itk::ShearWarpBenchmark

#endif
