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
#ifndef itkShearWarpSampling_h
#define itkShearWarpSampling_h

#include "ShearWarpMIPExport.h"

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

/** The rule of sampling, which every kernel follows to the bit, and the places of slices in the intermediate image.
 *
 * Positions are quantized to 1/2^15 voxel, and bilinear weights are integers that sum to 2^15:
 * see SamplingPosition and BilinearWeights. Integer samples are the weighted sum rounded once, half upward:
 * \f[ \lfloor (w_{aa} v_{aa} + w_{ab} v_{ab} + w_{ba} v_{ba} + w_{bb} v_{bb} + 2^{14}) / 2^{15} \rfloor \f]
 * Floating-point samples are three linear interpolations `b + x * (a - b)`, along columns first, each in
 * the pixel's own precision and without contraction. Because x is at most 1 - 2^-15, the result is never outside the
 * range of the four voxels, unless their difference overflows. A voxel with weight zero is not used. A maximum ignores
 * samples that are not-a-number or minus infinity. A zero is +0 in every picture, part and depth, apart from the value
 * of pixels without a sample.
 */
namespace itk::ShearWarp
{
constexpr int          FractionBits = 15;
constexpr std::int32_t One = 1 << FractionBits;

/** A position along one axis, in 1/2^15 pixel: `whole * 2^15 + fraction`, with 0 <= fraction < 2^15. */
struct SamplingPosition
{
  std::int32_t whole;
  std::int32_t fraction;
};

/** Rounds \a position, in pixels, to the nearest 1/2^15. Its magnitude must be below 2^31. */
ShearWarpMIP_EXPORT SamplingPosition
QuantizePosition(double position);

/** Weights of the four corners of a cell, in 1/2^15. No weight is negative, and their sum is exactly 2^15.
 * The first letter is the row, the second one the column. Neighbour `a` has weight \a x (or \a y), and neighbour `b`
 * the rest. \f[ aa = \lfloor (x y + 2^{14}) / 2^{15} \rfloor, \quad ab = y - aa, \quad ba = x - aa, \quad bb = 2^{15} -
 * x - y + aa \f] */
struct BilinearWeights
{
  BilinearWeights(std::int32_t x, std::int32_t y)
    : aa((x * y + One / 2) >> FractionBits)
    , ab(y - aa)
    , ba(x - aa)
    , bb(One - x - y + aa)
  {}
  std::int32_t aa, ab, ba, bb;
};

/** The place of a slice in the intermediate image. Voxel (0, 0) of the slice is at column `column`, row `row`.
 *
 * Intermediate pixel p meets the slice at voxel column p - column.whole - column.fraction / 2^15.
 * The slice reaches half a voxel beyond its outer voxel centers, with the outer voxels' values, so it always covers as
 * many pixels as it has voxels. */
struct SlicePlacement
{
  SamplingPosition column;
  SamplingPosition row;

  /** First intermediate column and row that the slice reaches. */
  std::int32_t
  FirstColumn() const
  {
    return column.whole + (column.fraction > One / 2);
  }
  std::int32_t
  FirstRow() const
  {
    return row.whole + (row.fraction > One / 2);
  }
};

/** Returns the instruction sets that this computer and this build have, the best one last. */
ShearWarpMIP_EXPORT std::vector<std::string>
                    GetInstructionSets();

/** The first voxel of a part of a volume. */
struct Corner
{
  std::ptrdiff_t column, row, slice;
};

/** Columns [begin, end) of an image row. */
struct ColumnSpan
{
  std::int32_t begin, end;
};

/** An affine function of column, row and slice of a sheared volume, evaluated as
 * `perColumn * column + ((perRow * row + perSlice * slice) + constant)`. */
struct ShearedFunction
{
  double perColumn, perRow, perSlice, constant;

  ShearWarpMIP_EXPORT double
  operator()(double column, double row, double slice) const;
};
/** An affine map of a plane: (x, y) to (xx x + xy y + x0, yx x + yy y + y0). */
struct AffineMap2D
{
  double xx, xy, x0;
  double yx, yy, y0;
};
} // namespace itk::ShearWarp

#endif
