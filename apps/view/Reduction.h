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
#ifndef Reduction_h
#define Reduction_h

#include "Projection.h"

#include <cstddef>

/** A volume that fits into a page, of one component. */
struct Reduction
{
  AnyImage image;
  /** Owns the pixels, if they are the volume's. */
  itk::Object::Pointer pixels{};
  /** The grid of the volume that it was made from. */
  itk::ImageBase<3>::Pointer whole{};
  /** Voxels that are not a number. */
  std::size_t notNumbers{ 0 };
};

/** Crops and reduces a volume of one component and one point in time.
 *
 * 1. Voxels outside of the mask or the box of \a options get the least value, in \a volume itself. Voxels beyond those
 *    whose centers are in the box are cut off.
 * 2. In the mode maximum, the background is the least value of the voxels at the border. What remains is the box of all
 *    voxels above it, and one more voxel at each side, if there is one. If no voxel is above it, all voxels remain.
 * 3. If more than \a most voxels lie along an axis, blocks of voxels become one voxel: the maximum, the minimum or the
 *    mean of the block, as the mode of \a options is. Along each axis a block is about as long as along the one that
 * needs the longest blocks. A block at the end may have fewer voxels.
 *
 * A voxel of the result lies at the center of its block. Voxels that are not a number count as the least, and are not
 * in means. Throws if voxels would get the least value in another mode than maximum, or if no voxel is in the box. */
Reduction
Reduce(const Volume & volume, const ProjectionOptions & options, std::size_t most);

#endif
