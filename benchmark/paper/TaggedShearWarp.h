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
#ifndef TaggedShearWarp_h
#define TaggedShearWarp_h

#include "PlainShearWarp.h"

#include <cstdint>
#include <vector>

namespace itk::ShearWarpBenchmark
{
/** Shear-warp with the reduced resampling of Fang et al. 2002 (figure 3) in its published form, in one thread: a cell
 * of four voxels is skipped where the pixel has reached the largest of them already.
 *
 * Voxels have up to 14 bits. Before any view three permuted copies of the volume are made, in which each voxel has its
 * value in the upper 14 bits and in the lower two the number of the largest corner of the cell that it begins. That
 * cell has corners 0, the voxel itself, 1, the next column's, 2, the next row's, and 3, the one across from 0; of equal
 * corners the first counts.
 *
 * A sample is rounded as the filter rounds it, which never takes it above the largest corner: what is skipped cannot
 * change a pixel, and the intermediate image is that of PlainShearWarp.h and of the filter, bit by bit. */
class TaggedShearWarp
{
public:
  using PixelType = std::uint16_t;
  using ImageType = Image<PixelType, 3>;

  static constexpr PixelType LargestVoxel = (1 << 14) - 1;

  struct Projection
  {
    /** Of the factorization's intermediate size; pixels that no slice reaches are 0. */
    std::vector<PixelType> intermediate;

    /** Cells met, as many as the volume has voxels, and those that were skipped. */
    SizeValueType cells;
    SizeValueType skippedCells;
  };

  /** Prepares the copies; \a image is not needed afterwards. Throws ExceptionObject, with its value, for a voxel above
   * LargestVoxel. */
  explicit TaggedShearWarp(const ImageType * image);

  /** Collects the maxima slice by slice, in storage order, of a factorization without oversampling. */
  Projection
  Project(const ShearWarpFactorization & factorization) const;

private:
  /** For each principal axis. */
  std::vector<PermutedVolume<PixelType>> m_Volumes;
};
} // namespace itk::ShearWarpBenchmark

#endif
