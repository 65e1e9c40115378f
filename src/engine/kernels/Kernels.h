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

#include "itkShearWarpSampling.h"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

/** The steps of the projection on plain memory: pointers, strides and sizes, no ITK type.
 *
 * Kernels holds one function for each step. Every scalar pixel type of ITK (the arithmetic and character types but
 * `bool` and `long double`) has portable kernels. `unsigned char`, `signed char`, 16-bit integers and float have vector
 * kernels too, but `char` has not. All give the same bits: those of the rule of itkShearWarpSampling.h.
 */
namespace itk::ShearWarp
{

/** Blocks begin and end at multiples of this many rows and slices; block maxima are those of cubes of this length. */
constexpr std::ptrdiff_t BlockLength = 8;

/** Columns of a tile of the intermediate image; it has BlockLength rows. */
constexpr std::ptrdiff_t TileColumns = 32;

/** Whether the first and the last voxel along an axis are the volume's. */
struct Ends
{
  bool first{ true }, last{ true };
};

/** A volume, or a part of it, as slices along the principal axis. A slice is `rows` x `columns` voxels, its columns are
 * contiguous in memory; strides are in voxels. No voxel is below `lowest` or above `highest`.
 *
 * A part has the samples between its voxels and, if its first voxel is not the volume's, none at that: along columns
 * and rows parts must have one voxel in common, and then they have all samples once. */
template <typename TPixel>
struct SliceStack
{
  const TPixel * voxels;
  std::ptrdiff_t columns, rows, slices;
  std::ptrdiff_t rowStride, sliceStride;
  TPixel         lowest{ std::numeric_limits<TPixel>::lowest() };
  TPixel         highest{ std::numeric_limits<TPixel>::max() };
  Ends           columnEnds{}, rowEnds{};
};

/** \class BlockRows
 * Whose rows a block has. */
enum class BlockRows : std::uint8_t
{
  OfSlices,
  OfMiddleSlices, // the other slices of each BlockLength: their samples in the same rows of the intermediate image
  OfImage         // the intermediate image's
};

/** Rows [rowBegin, rowEnd), of slices [sliceBegin, sliceEnd) of a SliceStack of `rows` rows: each a multiple of
 * BlockLength or the end.
 *
 * Sample j of a slice lies between its rows j - 1 and j, and belongs to the block of row j; see FindRowSamples(). With
 * common rows slices can be projected together. With rows of the image blocks share no pixel, so that each pixel can
 * have its samples in their order: the first slice first, or the last one if the block `isBackward`. */
struct Block
{
  std::ptrdiff_t rowBegin, rowEnd;
  std::ptrdiff_t sliceBegin, sliceEnd;
  std::ptrdiff_t rows;
  BlockRows      rowsOf{ BlockRows::OfSlices };
  bool           isBackward{ false };
};

/** Rows [begin, end) of an image or a slice. */
struct RowSpan
{
  std::ptrdiff_t begin, end;
};

/** The samples of a slice of \a voxels voxels along one axis, counted from `position.whole`: sample n lies between
 * voxels n - 1 and n, and the outer one at the end that is nearer, if it is the volume's, has the outer voxel's value.
 */
ShearWarpMIP_EXPORT RowSpan
FindSamples(const SamplingPosition & position, std::ptrdiff_t voxels, Ends ends);

/** The row of the intermediate image where row 0 of the block's rows lies, for \a slice. */
ShearWarpMIP_EXPORT std::ptrdiff_t
                    FindFirstRow(const Block & block, const SlicePlacement * placements, std::ptrdiff_t slice);

/** The samples of \a slice along its rows that are the block's, as FindSamples() counts them; at the ends of the stack
 * all that there are. */
ShearWarpMIP_EXPORT RowSpan
FindRowSamples(const Block & block, const SlicePlacement * placements, std::ptrdiff_t slice, Ends rowEnds);

/** \class Extremum
 * Which samples an image collects. */
enum class Extremum : std::uint8_t
{
  Maximum,
  Minimum
};

/** The value of a pixel that has met no sample. */
template <typename TPixel>
constexpr TPixel
GetNoSample(Extremum extremum)
{
  using Limits = std::numeric_limits<TPixel>;
  switch (extremum)
  {
    case Extremum::Maximum:
      return Limits::has_infinity ? static_cast<TPixel>(-Limits::infinity()) : Limits::lowest();
    case Extremum::Minimum:
      return Limits::has_infinity ? Limits::infinity() : Limits::max();
  }
  return TPixel{};
}
template <typename TPixel, Extremum VExtremum = Extremum::Maximum>
constexpr TPixel NoSample = GetNoSample<TPixel>(VExtremum);

/** The slices in the order of their ranks. Slice `first` has rank 1, and the next rank is `step` slices further: 1 or
 * -1. */
struct Ranking
{
  std::int32_t first{ 0 }, step{ 1 };

  std::int32_t
  GetSlice(std::int32_t rank) const
  {
    return first + step * (rank - 1);
  }
  std::int32_t
  GetRank(std::int32_t slice) const
  {
    return 1 + step * (slice - first);
  }
};

/** The intermediate (sheared) image: `rows` x `columns` pixels, `rowStride` pixels from row to row. Columns
 * `reached[r]` of row r may have values; the other pixels are not defined.
 *
 * `ranks`, if not null, has the rank of each pixel's value, laid out as `pixels`; a rank of 0 or less is a pixel
 * without a value. If `hasGaps`, a reached pixel may have no value. Without `ranks`, floating-point pixels that are
 * `none` have no value. */
template <typename TPixel>
struct IntermediateImage
{
  TPixel *             pixels{ nullptr };
  std::ptrdiff_t       columns{ 0 }, rows{ 0 }, rowStride{ 0 };
  const ColumnSpan *   reached{ nullptr };
  const std::int32_t * ranks{ nullptr };
  Ranking              ranking{};
  bool                 hasGaps{ false };
  TPixel               none{ NoSample<TPixel> };
};

/** Those columns of \a span where \a low <= function <= \a high, for a row and a slice. */
ShearWarpMIP_EXPORT ColumnSpan
ClipColumns(const ShearedFunction & function, double low, double high, double row, double slice, ColumnSpan span);

/** Samples count where \a low <= function <= \a high. */
struct Interval
{
  ShearedFunction function;
  double          low, high;
};

/** The samples that count in a view: those of all intervals. */
struct Region
{
  std::vector<Interval> intervals;
  std::ptrdiff_t        firstSlice{ 0 }; // of the stack, in the volume

  /** Whether samples of columns \a columns and rows \a rows of a slice may count. */
  ShearWarpMIP_EXPORT bool
  MayReach(ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice) const;

  /** Those of columns \a columns of a row of a slice that count. */
  ShearWarpMIP_EXPORT ColumnSpan
  Clip(ColumnSpan columns, std::ptrdiff_t row, std::ptrdiff_t slice) const;
};

/** A view's region, and which pixels have met a sample of it. */
struct Coverage
{
  const Region * region{ nullptr };
  std::uint8_t * marks{ nullptr }; // 1 for those, 0 for others
  std::ptrdiff_t rowStride{ 0 };
  ColumnSpan *   known{ nullptr }; // of each row, some that are marked

  /** Marks those pixels of columns \a columns of a row that have a sample of a slice in the region, and returns them.
   */
  ShearWarpMIP_EXPORT ColumnSpan
  Add(ColumnSpan columns, std::ptrdiff_t row, std::ptrdiff_t slice) const;
};

/** The place of a slice, counted from the viewer, from 1 on: as wide as the lanes of its pixels. Of equal samples the
 * one of the least counts. A pixel without a sample has NoRank; that of a ray which takes no more has EndedRank added.
 */
template <typename TPixel>
using SliceRank = std::conditional_t<(sizeof(TPixel) > 2), std::int32_t, std::int16_t>;
template <typename TPixel>
constexpr SliceRank<TPixel> NoRank = std::numeric_limits<SliceRank<TPixel>>::max();
template <typename TPixel>
constexpr SliceRank<TPixel> EndedRank = std::numeric_limits<SliceRank<TPixel>>::lowest();

/** The ranks of an image's pixels, laid out as these; that of slice k is `first + step * k`. */
template <typename TPixel>
struct RankedImage
{
  SliceRank<TPixel> * ranks{ nullptr };
  std::int32_t        first{ 1 }, step{ 1 };
};

/** A mask, laid out as the slices of a volume, but with strides of its own: voxels are in it where they are `label` or,
 * if that is 0, not 0. A sample counts where its nearest voxel is in the mask, and is the mean of those of its voxels
 * that are, their weights scaled to sum to one. */
struct Mask
{
  const std::uint8_t * voxels{ nullptr };
  std::ptrdiff_t       rowStride{ 0 }, sliceStride{ 0 };
  std::uint8_t         label{ 0 };
};

/** \class TileState
 * What is known of a tile: no sample is needed, each is taken, or the mask tells. */
enum class TileState : std::uint8_t
{
  Unneeded,
  Whole,
  Masked
};

/** exp(-\a x) for 0 <= x, or 0 where that is less than exp(-708): from IEEE operations alone, so that every computer
 * has the same bits. It is exactly 1 at 0, never rises with x, and its relative error is below 2^-52. */
ShearWarpMIP_EXPORT double
Decay(double x);

/** How samples fade: those of depth w by exp(-rate (w - begin)), those before `begin` not at all. */
struct Fading
{
  double rate, begin;
};

/** The precision in which samples fade. */
template <typename TPixel>
using FadeNumber = std::conditional_t<(sizeof(TPixel) <= 2) || std::is_same_v<TPixel, float>, float, double>;

/** How a row of samples fades to `background`: those of the columns of `span`, column p by
 * `factor * factors[p - first]`. Vectors that have one of these columns may read FadePadding factors further. */
template <typename TPixel>
struct FadingRow
{
  ColumnSpan                 span;
  std::int32_t               first;
  FadeNumber<TPixel>         factor; // of the nearest sample
  const FadeNumber<TPixel> * factors;
  TPixel                     background;
};
constexpr std::ptrdiff_t FadePadding = 32;

/** How the samples of a view fade to `background`: `depth` is that of column and row of the intermediate image and of
 * the slice in the volume. A float factor below 2^-60 is 0. */
template <typename TPixel>
struct ViewFading
{
  Fading          fading;
  ShearedFunction depth;
  TPixel          background;

  std::vector<FadeNumber<TPixel>> factors{}; // by distance from the nearest column, between FadePadding zeros
  std::ptrdiff_t                  firstSlice{ 0 };

  /** Prepares for a stack of slices of \a columns columns that begins with slice \a first of the volume. */
  ShearWarpMIP_EXPORT void
  SetStack(std::ptrdiff_t columns, std::ptrdiff_t first);

  /** For a row of a slice of the stack that reaches the columns of \a reached. */
  ShearWarpMIP_EXPORT FadingRow<TPixel>
                      GetRow(std::ptrdiff_t row, std::ptrdiff_t slice, ColumnSpan reached) const;
};

/** A view along the slices' axis: the place of each slice, and the image that collects the extrema; with a `coverage`
 * of the samples in its region alone. `ranked` tells which slices gave the extrema, if its ranks are not null. The
 * views of one call all have a coverage or none, and all have ranks or none.
 *
 * A ray whose pixel is `*localThreshold` or beyond, if that is not null, ends at the first sample that is less good: it
 * keeps its first local maximum (local maximum intensity projection, Sato et al. 1998). For that, as for magnitudes,
 * blocks have the image's rows, and slices come from the viewer on.
 *
 * `active`, if not null, tells the state of the tiles of a block of at most BlockLength slices: that of
 * `active[(row - block.rowBegin) / BlockLength * activeStride + column / TileColumns]`, for a row counted from
 * FindFirstRow() and no further than the block's, and a column of the intermediate image. If it is null all tiles are
 * Masked, or Whole without a `mask`. Views of a mask, of fading, of magnitudes and of local maxima have ranks. */
template <typename TPixel>
struct ShearedView
{
  const SlicePlacement *     placements{ nullptr };
  IntermediateImage<TPixel>  intermediate{};
  const TileState *          active{ nullptr };
  std::ptrdiff_t             activeStride{ 0 };
  Extremum                   extremum{ Extremum::Maximum };
  Coverage                   coverage{};
  RankedImage<TPixel>        ranked{};
  const Mask *               mask{ nullptr };
  const ViewFading<TPixel> * fading{ nullptr };
  const TPixel *             localThreshold{ nullptr };
};

/** The maxima of a volume's cubes of BlockLength voxels a side, permuted as its slices are, and the minima if these are
 * not null; not-a-number is ignored. Strides are in elements. */
template <typename TPixel>
struct BlockExtrema
{
  const TPixel * maxima;
  const TPixel * minima;
  std::ptrdiff_t columns, rows, slices;
  std::ptrdiff_t columnStride, rowStride, sliceStride;
};

/** The precision in which the interpolant is evaluated. */
template <typename TPixel>
using ExactNumber = std::conditional_t<std::is_integral_v<TPixel> && (sizeof(TPixel) <= 2), float, double>;

/** A volume whose slices are sheared, and the rays of a view in it: that of sheared column p and row q is at voxel
 * column p - (shear[0] s + translation[0]), row q - (shear[1] s + translation[1]) and slice s. */
template <typename TPixel>
struct ExactView
{
  SliceStack<TPixel>    slices;
  BlockExtrema<TPixel>  blocks; // with minima unless the maximum is wanted
  double                shear[2], translation[2];
  AffineMap2D           outputToSheared;
  std::vector<Interval> intervals; // of sheared column, row and slice
  ShearedFunction       depth;
  TPixel                background;
};

/** The rays of a tile of CellRows x CellColumns cells of the sheared grid, sorted by their cells: those of slices
 * [begin, end], with the best value so far and its slice. `least` has for each cell what a voxel must exceed, or with
 * depths reach, to make one of its rays better. With `isMinimum` all voxels have the other sign. */
template <typename TPixel>
struct ExactTile
{
  std::ptrdiff_t        column, row; // of the first cell
  bool                  isMinimum, hasDepth;
  const std::int32_t *  cellBegins; // the first ray of each cell; the last one's end
  const std::uint16_t * cells;      // of the rays, in the tile
  const double *        p;
  const double *        q;
  const double *        begin;
  const double *        end;
  ExactNumber<TPixel> * best;
  double *              places;
  TPixel *              least;
  std::int16_t *        leastLevels; // the same in the units of interpolated bounds
};
constexpr std::ptrdiff_t CellColumns = 32;
constexpr std::ptrdiff_t CellRows = 16;

/** A ray of a tile, from a slice to the next one. */
struct RayPart
{
  std::int32_t ray, slice;
};

/** The functions of one instruction set. */
template <typename TPixel>
struct Kernels
{
  /** "portable", "generic", "avx2" or "avx512". */
  const char * instructionSet;

  /** Gives the pixels of each of \a count views the extremum of what they hold and of the
   * samples of a block of the sheared volume: the projection of Fang et al. 2002 (figure 2 and equation 2), one set of
   * weights for a slice. */
  void (*projectBlock)(const SliceStack<TPixel> &  slices,
                       const Block &               block,
                       const ShearedView<TPixel> * views,
                       std::size_t                 count);

  /** Whether one of `rows` x `columns` pixels is below \a value; `columns` is a multiple of TileColumns. */
  bool (*isAnyBelow)(const TPixel * pixels,
                     std::ptrdiff_t rowStride,
                     std::ptrdiff_t rows,
                     std::ptrdiff_t columns,
                     TPixel         value);

  /** The maximum of each BlockLength columns of `slices` x `rows` rows of `columns` voxels, to ceil(columns /
   * BlockLength) elements of \a maxima, and the minimum to \a minima if that is not null; \a lowest and \a highest are
   * widened to hold every voxel. Not-a-number is ignored. */
  void (*findBlockExtrema)(const TPixel * voxels,
                           std::ptrdiff_t columns,
                           std::ptrdiff_t rows,
                           std::ptrdiff_t slices,
                           std::ptrdiff_t rowStride,
                           std::ptrdiff_t sliceStride,
                           TPixel *       maxima,
                           TPixel *       minima,
                           TPixel &       lowest,
                           TPixel &       highest);

  /** Writes columns [columnBegin, columnEnd) of row \a row of an output image, that row's first pixel at \a output:
   * the bilinear interpolation of \a intermediate at \a outputToIntermediate of each pixel's column and row.
   * Intermediate pixels that no slice reached are left out and the weights of the others are scaled to
   * sum to one; where none is left the pixel is \a background. */
  void (*warpRow)(const IntermediateImage<TPixel> & intermediate,
                  const AffineMap2D &               outputToIntermediate,
                  std::ptrdiff_t                    row,
                  std::ptrdiff_t                    columnBegin,
                  std::ptrdiff_t                    columnEnd,
                  TPixel                            background,
                  TPixel *                          output);

  /** Copies \a rows rows of \a columns pixels at \a input to \a columns rows of \a rows pixels at \a output. With
   * \a isStreamed they are written past the caches. */
  void (*transposeSlice)(const TPixel * input,
                         std::ptrdiff_t columns,
                         std::ptrdiff_t rows,
                         TPixel *       output,
                         bool           isStreamed);

  /** Raises the best values of a tile's rays to the maxima of the interpolant in \a count parts, and sets `least` of
   * all cells. Voxels before the first slice and behind the last one are as these. Returns the least of all cells. */
  TPixel (*evaluateParts)(const ExactView<TPixel> & view,
                          const ExactTile<TPixel> & tile,
                          const RayPart *           parts,
                          std::size_t               count);

  /** The same for all parts of slices sliceBegin to sliceEnd that bounds by voxels do not exclude, once a part of each
   * ray was evaluated. */
  TPixel (*searchSlab)(const ExactView<TPixel> & view,
                       const ExactTile<TPixel> & tile,
                       std::ptrdiff_t            sliceBegin,
                       std::ptrdiff_t            sliceEnd);
};

/** The columns of a row from the first to the last pixel with a value, and whether a pixel between them has none. */
struct ReachedRow
{
  ColumnSpan span;
  bool       hasGaps;
};

ShearWarpMIP_EXPORT ReachedRow
FindReached(const std::int32_t * ranks, std::ptrdiff_t columns);

/** The sample of weights \a x and \a y between the voxels b[column], b[before], a[column] and a[before], of those whose
 * bits, the lowest first, \a counted has. */
template <typename TPixel>
ShearWarpMIP_EXPORT TPixel
SampleCounted(const TPixel * a,
              const TPixel * b,
              std::ptrdiff_t column,
              std::ptrdiff_t before,
              std::int32_t   x,
              std::int32_t   y,
              unsigned int   counted);

/** Writes the depths of columns [0, columns) of row \a row of an output image. A pixel's depth is \a depth on the
 * pixel's own ray, in the slice of the intermediate pixel with the largest weight, or not-a-number if the pixel has no
 * value. */
template <typename TPixel>
ShearWarpMIP_EXPORT void
FindDepths(const IntermediateImage<TPixel> & intermediate,
           const AffineMap2D &               outputToIntermediate,
           unsigned int                      oversampling,
           const ShearedFunction &           depth,
           std::ptrdiff_t                    row,
           std::ptrdiff_t                    columns,
           float *                           depths);

/** The plain C++ kernels: the definition that the others are tested against. */
template <typename TPixel>
const ShearWarpMIP_EXPORT Kernels<TPixel> &
                          GetPortableKernels();

/** The kernels of the instruction set that the environment variable SHEARWARPMIP_INSTRUCTION_SET names or, if that is
 * not set, of the best one of this computer. Pixel types without kernels of their own get the portable ones.
 * Throws std::invalid_argument if this computer does not have the named instruction set. */
template <typename TPixel>
const ShearWarpMIP_EXPORT Kernels<TPixel> &
                          GetKernels();

} // namespace itk::ShearWarp

#endif
