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
#ifndef itkShearWarpKernels_h
#define itkShearWarpKernels_h

#include "ShearWarpMIPExport.h"

#include <cstddef>
#include <cstdint>

/** The steps of the projection on plain memory: pointers, strides and sizes, no ITK type.
 *
 * Each function is instantiated in the library for every scalar pixel type of ITK (the arithmetic and
 * character types but `bool` and `long double`), and writes only the rows that it is asked for, so that
 * threads can share the work by rows.
 *
 * Positions are quantized to 1/2^15 voxel, and bilinear weights are integers that sum to 2^15:
 * see SamplingPosition and BilinearWeights. Integer samples are the weighted sum rounded once, half upward.
 * Floating-point samples are three linear interpolations `b + x * (a - b)`, along columns first, each in
 * the pixel's own precision and without contraction; the result is never outside the range of the four
 * voxels, because x is at most 1 - 2^-15, unless their difference overflows. A voxel of weight zero takes no part. A
 * sample that is not a number never wins, and one of minus infinity counts as no sample.
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

/** Weights of the four corners of a cell in 1/2^15: none negative, their sum exactly 2^15.
 * First letter: row, second letter: column; `a` is the neighbour of weight \a x (or \a y), `b` the one that
 * has the rest. */
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

/** Where a slice lies in the intermediate image: its voxel (0, 0) is at column `column`, row `row`.
 *
 * Intermediate pixel p meets the slice at voxel column p - column.whole - column.fraction / 2^15.
 * The slice reaches half a voxel beyond its outer voxel centres, so that it always covers as many pixels
 * as it has voxels. */
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

/** A volume as slices along the principal axis. A slice is `rows` x `columns` voxels, its columns are
 * contiguous in memory; strides are in voxels. */
template <typename TPixel>
struct SliceStack
{
  const TPixel * voxels;
  std::ptrdiff_t columns, rows, slices;
  std::ptrdiff_t rowStride, sliceStride;
};

/** Columns [begin, end) of an image row. */
struct ColumnSpan
{
  std::int32_t begin, end;
};

/** The intermediate (sheared) image: `rows` x `columns` pixels without padding. `reached[r]` are the columns
 * of row r that some slice reaches; what the other pixels hold is not defined. */
template <typename TPixel>
struct IntermediateImage
{
  TPixel *           pixels;
  std::ptrdiff_t     columns, rows;
  const ColumnSpan * reached;
};

/** Affine map (x, y) -> (xx x + xy y + x0, yx x + yy y + y0). */
struct AffineMap2D
{
  double xx, xy, x0;
  double yx, yy, y0;
};

/** Writes to rows [rowBegin, rowEnd) of \a intermediate the maximum over all slices of the sheared volume's
 * samples: the projection of Fang et al. 2002 (figure 2 and equation 2), one set of weights for a slice.
 * \a placements holds one element per slice. */
template <typename TPixel>
ShearWarpMIP_EXPORT void
ProjectSlices(const SliceStack<TPixel> &        slices,
              const SlicePlacement *            placements,
              std::ptrdiff_t                    rowBegin,
              std::ptrdiff_t                    rowEnd,
              const IntermediateImage<TPixel> & intermediate);

/** Writes rows [rowBegin, rowEnd) of an output image of \a columns columns, the first row at \a output: the
 * bilinear interpolation of \a intermediate at \a outputToIntermediate of each pixel's column and row.
 * Intermediate pixels that no slice reached are left out and the weights of the others are scaled to
 * sum to one; where none is left the pixel is \a background. */
template <typename TPixel>
ShearWarpMIP_EXPORT void
WarpRows(const IntermediateImage<TPixel> & intermediate,
         const AffineMap2D &               outputToIntermediate,
         std::ptrdiff_t                    rowBegin,
         std::ptrdiff_t                    rowEnd,
         std::ptrdiff_t                    columns,
         TPixel                            background,
         TPixel *                          output);

/** Copies \a rows rows of \a columns pixels at \a input to \a columns rows of \a rows pixels at \a output. */
template <typename TPixel>
ShearWarpMIP_EXPORT void
TransposeSlice(const TPixel * input, std::ptrdiff_t columns, std::ptrdiff_t rows, TPixel * output);

} // namespace itk::ShearWarp

#endif
