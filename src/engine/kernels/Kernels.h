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

/** The steps of the projection on plain memory: pointers, strides and sizes.
 *
 * Kernels has one function for each step. Portable kernels are for every pixel type of the engine.
 * Vector kernels of `unsigned char`, `signed char`, integers of 16 bits, and float are written for lanes. For the other
 * types they are the portable projection, compiled for an instruction set. All kernels give the same bits: they follow
 * the rule of itkShearWarpSampling.h. */
namespace itk::ShearWarp
{

/** The length of a cube. Blocks begin and end at multiples of it. */
constexpr std::ptrdiff_t BlockLength = 8;

/** Returns how many blocks of \a blockLength hold \a length elements. */
constexpr std::ptrdiff_t
CountBlocks(std::ptrdiff_t length, std::ptrdiff_t blockLength = BlockLength)
{
  return (length + blockLength - 1) / blockLength;
}

/** The columns of a tile, which has BlockLength rows. */
constexpr std::ptrdiff_t TileColumns = 32;

/** Whether the first and the last voxel along an axis are the volume's. */
struct Ends
{
  bool first{ true }, last{ true };
};

/** A volume, or a part of a volume, as slices along the principal axis. A slice has `rows` x `columns` voxels. Columns
 * are contiguous in memory; strides are in voxels. No voxel is below `lowest` or above `highest`.
 *
 * A part owns the samples between its voxels. It owns samples at its first voxel only if that voxel is the volume's
 * first. Parts that share one voxel per axis own each sample once. */
template <typename TPixel>
struct SliceStack
{
  const TPixel * voxels{ nullptr };
  std::ptrdiff_t columns{ 0 }, rows{ 0 }, slices{ 0 };
  std::ptrdiff_t rowStride{ 0 }, sliceStride{ 0 };
  TPixel         lowest{ std::numeric_limits<TPixel>::lowest() };
  TPixel         highest{ std::numeric_limits<TPixel>::max() };
  Ends           columnEnds{}, rowEnds{};
};

/** \class BlockRows
 * What the rows of a block are. */
enum class BlockRows : std::uint8_t
{
  OfSlices,       // rows of each slice
  OfMiddleSlices, // rows of the image where the middle slice of each cube has the rows
  OfImage         // rows of the intermediate image
};

/** Rows [rowBegin, rowEnd) and slices [sliceBegin, sliceEnd) of a SliceStack with `rows` rows. Each limit is a multiple
 * of BlockLength, or the end.
 *
 * Sample j of a slice lies between rows j - 1 and j, and belongs to the block of row j; see FindRowSamples(). If blocks
 * have rows of middle slices, the slices of a cube can be projected together. If blocks are rows of the image, no two
 * blocks write one pixel, so that a pixel can take its samples in order: from the first slice on, or from the last one
 * if the block `isBackward`. */
struct Block
{
  std::ptrdiff_t rowBegin{ 0 }, rowEnd{ 0 };
  std::ptrdiff_t sliceBegin{ 0 }, sliceEnd{ 0 };
  std::ptrdiff_t rows{ 0 };
  BlockRows      rowsOf{ BlockRows::OfSlices };
  bool           isBackward{ false };
};

/** Rows [begin, end) of an image or a slice. */
struct RowSpan
{
  std::ptrdiff_t begin, end;
};

/** Returns the samples of a slice along an axis with \a voxels voxels, counted from `position.whole`. Sample n lies
 * between voxels n - 1 and n. Beyond the end of the volume that is nearer to samples, one more sample has the value of
 * the outer voxel. */
ShearWarpMIP_EXPORT RowSpan
FindSamples(const SamplingPosition & position, std::ptrdiff_t voxels, Ends ends);

/** Returns the row of the intermediate image where row 0 of the block lies for \a slice. */
ShearWarpMIP_EXPORT std::ptrdiff_t
                    FindFirstRow(const Block & block, const SlicePlacement * placements, std::ptrdiff_t slice);

/** Returns the samples of \a slice along its rows that belong to the block, as FindSamples() counts them. The first and
 * the last block have all remaining samples. */
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

/** The order of slices by rank, as seen from the viewer. Slice `first` has rank 1, and the next rank is `step` slices
 * further: 1 or -1. */
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
 * without a value. If `hasGaps`, a reached pixel may have no value. If `isNearest`, an output pixel takes the nearest
 * pixel; of two equally near pixels, the pixel of the higher column or row. Without `ranks`, floating-point pixels that
 * are `none` have no value. */
template <typename TPixel>
struct IntermediateImage
{
  TPixel *             pixels{ nullptr };
  std::ptrdiff_t       columns{ 0 }, rows{ 0 }, rowStride{ 0 };
  const ColumnSpan *   reached{ nullptr };
  const std::int32_t * ranks{ nullptr };
  Ranking              ranking{};
  bool                 hasGaps{ false };
  bool                 isNearest{ false };
  TPixel               none{ NoSample<TPixel> };
};

/** Samples count where low <= function <= high. */
struct Interval
{
  ShearedFunction function{};
  double          low{ 0 }, high{ 0 };
};

/** Keeps of \a spans, which belong to \a rows rows from \a row on, the columns in the interval. */
ShearWarpMIP_EXPORT void
ClipColumns(const Interval & interval, double row, double slice, std::ptrdiff_t rows, ColumnSpan * spans);

/** Samples count in a view where they count in all intervals. The intervals are of the whole volume, in which an
 * image's first column and row, and a stack's first slice, are `first`. */
struct Region
{
  std::vector<Interval> intervals;
  Corner                first{ 0, 0, 0 };

  /** False only if no sample of these columns and rows of a slice counts. */
  ShearWarpMIP_EXPORT bool
  MayReach(ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice) const;

  /** Finds the columns of each row of a slice where samples count. Returns false if none count. */
  ShearWarpMIP_EXPORT bool
  Clip(ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice, ColumnSpan * spans) const;

private:
  enum class Overlap
  {
    None,
    Part,
    All
  };

  Overlap
  FindOverlap(const Interval & interval, ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice) const;
};

/** A view's region, and the pixels that have met a sample in the region. */
struct Coverage
{
  const Region * region{ nullptr };
  std::uint8_t * marks{ nullptr }; // 1 for these pixels, 0 for others
  std::ptrdiff_t rowStride{ 0 };
  ColumnSpan *   known{ nullptr }; // for each row, some columns that are marked

  /** Finds the columns of each row where a sample of the slice is in the region, and marks them if there are marks.
   * Returns false if there are none. */
  ShearWarpMIP_EXPORT bool
  Add(ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice, ColumnSpan * spans) const;
};

/** The type of a rank while samples are collected: as wide as a lane of the pixels. Among equal samples the lowest rank
 * wins. A pixel without a sample has NoRank. When a ray ends, EndedRank is added to its pixel's rank. */
template <typename TPixel>
using SliceRank = std::conditional_t<(sizeof(TPixel) > 2), std::int32_t, std::int16_t>;
template <typename TPixel>
constexpr SliceRank<TPixel> NoRank = std::numeric_limits<SliceRank<TPixel>>::max();
template <typename TPixel>
constexpr SliceRank<TPixel> EndedRank = std::numeric_limits<SliceRank<TPixel>>::lowest();

/** The ranks of an image's pixels, laid out as the pixels. Slice k has rank `first + step * k`. */
template <typename TPixel>
struct RankedImage
{
  SliceRank<TPixel> * ranks{ nullptr };
  std::int32_t        first{ 1 }, step{ 1 };
};

/** The sum of samples of 64 bits: the sums of their upper and of their lower halves. */
template <typename TPixel>
struct SumOfHalves
{
  TPixel        upper{ 0 };
  std::uint64_t lower{ 0 };
};

/** The sum of doubles, divided by 2^32 so that it does not overflow, and the range of the doubles. */
struct SumOfDoubles
{
  double scaled{ 0 };
  double lowest{ std::numeric_limits<double>::infinity() };
  double highest{ -std::numeric_limits<double>::infinity() };
};

/** The sum of a pixel's samples. Sums of integers are exact for MostSummedSlices samples. Sums of floats are doubles,
 * so their bits depend on the order of the samples. */
template <typename TPixel>
using SampleSum = std::conditional_t<
  std::is_same_v<TPixel, float>,
  double,
  std::conditional_t<
    std::is_same_v<TPixel, double>,
    SumOfDoubles,
    std::conditional_t<sizeof(TPixel) == 8,
                       SumOfHalves<TPixel>,
                       std::conditional_t<sizeof(TPixel) == 4,
                                          std::conditional_t<std::is_signed_v<TPixel>, std::int64_t, std::uint64_t>,
                                          std::conditional_t<std::is_signed_v<TPixel>, std::int32_t, std::uint32_t>>>>>;
template <typename TPixel>
constexpr std::ptrdiff_t MostSummedSlices = sizeof(TPixel) <= 2 ? 1 << 16 : std::numeric_limits<std::int32_t>::max();

/** What an image collects for means: the sums of its pixels, laid out as the pixels, and the counts of their samples.
 * A pixel's count is the sum, modulo 2^32, of its row's `countSteps` up to the pixel. Rows of `countSteps` are one
 * element longer than rows of pixels. */
template <typename TPixel>
struct SummedImage
{
  SampleSum<TPixel> * sums{ nullptr };
  std::uint32_t *     countSteps{ nullptr };
};

/** A mask of a volume, laid out as its slices, with its own strides. Voxels are in the mask where the mask is `label`
 * or, if `label` is 0, not 0. A sample counts if its nearest voxel is in the mask. The sample is the weighted mean of
 * its voxels in the mask, with weights scaled to sum to one. */
struct Mask
{
  const std::uint8_t * voxels{ nullptr };
  std::ptrdiff_t       rowStride{ 0 }, sliceStride{ 0 };
  std::uint8_t         label{ 0 };
};

/** \class TileState
 * Whether a tile needs no sample, takes all samples, or takes samples as the mask tells. */
enum class TileState : std::uint8_t
{
  Unneeded,
  Whole,
  Masked
};

/** Returns exp(-\a x) for 0 <= x, or 0 for x >= 708. Only IEEE operations are used, so that every computer has the same
 * bits. The result is exactly 1 at 0 and never rises with x; its relative error is below 2^-52. */
ShearWarpMIP_EXPORT double
Decay(double x);

/** How samples fade: at depth w by exp(-rate (w - begin)). Samples before `begin` do not fade. */
struct Fading
{
  double rate{ 0 }, begin{ 0 };
};

/** The precision in which samples fade. */
template <typename TPixel>
using FadeNumber = std::conditional_t<(sizeof(TPixel) <= 2) || std::is_same_v<TPixel, float>, float, double>;

/** How a row of samples fades to `background`. In the columns of `span`, column p fades by `factor * factors[p -
 * first]`. Vectors may read FadePadding factors before and behind. */
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

/** How the samples of a view fade to `background`. `depth` is a function of column and row of the intermediate image,
 * and of the slice in the volume. A float factor below 2^-60 is 0. */
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

  /** Returns how a row of a slice of the stack fades in columns \a reached. */
  ShearWarpMIP_EXPORT FadingRow<TPixel>
                      GetRow(std::ptrdiff_t row, std::ptrdiff_t slice, ColumnSpan reached) const;
};

/** A view along the axis of the slices: the place of each slice, and the image that collects the extremum of samples,
 * or the sums of samples if `summed` has any. If there is a `coverage`, only samples in its region count. If
 * `ranked.ranks` is not null, ranks tell which slices gave the pixels their values. The views of one call all have a
 * coverage or none, and all have ranks or none. Extrema with a mask, fading or a local threshold have ranks.
 *
 * `localThreshold`, if not null, is for local maximum intensity projection (Sato et al. 1998). A ray whose pixel has
 * reached `*localThreshold` ends at the first sample that is worse, and so keeps its first local maximum. Blocks must
 * then be rows of the image, and come in the order of the slices from the viewer on.
 *
 * `active`, if not null, has the states of the tiles of a block of at most BlockLength slices, `activeStride` elements
 * from one row of tiles to the next. Rows of tiles begin where FindFirstRow() has the block's first row; columns of
 * tiles begin with the image. If `active` is null, all tiles are Masked if there is a mask, or else Whole. */
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
  SummedImage<TPixel>        summed{};
  const Mask *               mask{ nullptr };
  const ViewFading<TPixel> * fading{ nullptr };
  const TPixel *             localThreshold{ nullptr };
};

/** The maxima of a volume's cubes, and the minima if not null. Axes are in the order of the slices. Not-a-number is
 * ignored. Strides are in elements. */
template <typename TPixel>
struct BlockExtrema
{
  const TPixel * maxima{ nullptr };
  const TPixel * minima{ nullptr };
  std::ptrdiff_t columns{ 0 }, rows{ 0 }, slices{ 0 };
  std::ptrdiff_t columnStride{ 0 }, rowStride{ 0 }, sliceStride{ 0 };
};

/** The precision in which the interpolant is evaluated. */
template <typename TPixel>
using ExactNumber = std::conditional_t<std::is_integral_v<TPixel> && (sizeof(TPixel) <= 2), float, double>;

/** A volume whose slices are sheared, and the rays of a view in it: the ray of sheared column p and row q is at voxel
 * column p - (shear[0] s + translation[0]), row q - (shear[1] s + translation[1]) and slice s. If `slices` are a part
 * of the volume, only cells between the part's voxels, and beyond the volume's outer voxels, have values. */
template <typename TPixel>
struct ExactView
{
  SliceStack<TPixel>    slices;
  Corner                first{ 0, 0, 0 }; // of the slices in the volume
  BlockExtrema<TPixel>  blocks;           // block extrema, with minima unless the maximum is wanted
  double                shear[2], translation[2];
  AffineMap2D           outputToSheared;
  std::vector<Interval> intervals; // of sheared column, row and slice
  ShearedFunction       depth;
  TPixel                background;
};

/** The rays of a patch of CellRows x CellColumns cells of the sheared grid, sorted by their cells. Each ray has slices
 * [begin, end], a best value so far, and the place of the best value among the slices. A voxel improves a ray of a cell
 * only if the voxel exceeds the cell's `least`, or reaches `least` if there are depths. With `isMinimum`, all voxels
 * have the other sign. */
template <typename TPixel>
struct RayPatch
{
  std::ptrdiff_t        column, row; // of the first cell
  bool                  isMinimum, hasDepth;
  const std::int32_t *  cellBegins; // the first ray of each cell, and the number of rays
  const std::uint16_t * cells;      // the cell of each ray, counted in the patch
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

/** A segment of a ray: from a slice to the next one. */
struct RaySegment
{
  std::int32_t ray, slice;
};

/** The functions of one instruction set. */
template <typename TPixel>
struct Kernels
{
  /** "portable", "generic", "avx2" or "avx512". */
  const char * instructionSet;

  /** Projects a block of the sheared volume into \a count views: each pixel becomes the extremum of its value and of
   * the block's samples. One set of weights is for a whole slice (Fang et al. 2002, figure 2 and equation 2). Outer
   * tiles overlap their neighbours, so a pixel may take one sample twice: only an extremum allows that. */
  void (*projectBlock)(const SliceStack<TPixel> &  slices,
                       const Block &               block,
                       const ShearedView<TPixel> * views,
                       std::size_t                 count);

  /** Adds the samples of a block to the sums of \a count views: each sample once, slice by slice for floats. A sample
   * that is not a number does not count. */
  void (*addBlock)(const SliceStack<TPixel> &  slices,
                   const Block &               block,
                   const ShearedView<TPixel> * views,
                   std::size_t                 count);

  /** Whether one of `rows` x `columns` pixels is below \a value; `columns` is a multiple of TileColumns. */
  bool (*isAnyBelow)(const TPixel * pixels,
                     std::ptrdiff_t rowStride,
                     std::ptrdiff_t rows,
                     std::ptrdiff_t columns,
                     TPixel         value);

  /** Writes the maxima of a row of cubes to \a maxima, and the minima to \a minima if not null: ceil(columns /
   * BlockLength) elements. The cubes have `slices` x `rows` rows of `columns` voxels. Widens the range from \a lowest
   * to
   * \a highest so that it has every voxel. Not-a-number is ignored. */
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

  /** Writes columns [columnBegin, columnEnd) of row \a row of an output image. \a output points to the row's first
   * pixel. Each pixel is interpolated bilinearly in \a intermediate, at its place by \a outputToIntermediate.
   * Intermediate pixels without a value are left out, and the weights of the others are scaled to sum to one. An output
   * pixel without any is
   * \a background. */
  void (*warpRow)(const IntermediateImage<TPixel> & intermediate,
                  const AffineMap2D &               outputToIntermediate,
                  std::ptrdiff_t                    row,
                  std::ptrdiff_t                    columnBegin,
                  std::ptrdiff_t                    columnEnd,
                  TPixel                            background,
                  TPixel *                          output);

  /** Swaps columns and rows: copies \a rows rows of \a columns pixels to \a columns rows of \a rows pixels. If
   * \a isStreamed, pixels are written past the caches. */
  void (*transposeSlice)(const TPixel * input,
                         std::ptrdiff_t columns,
                         std::ptrdiff_t rows,
                         TPixel *       output,
                         bool           isStreamed);

  /** Raises the best values of a patch's rays to the maxima of the interpolant on \a count segments of the rays. Sets
   * `least` of all cells, and returns the lowest `least`. Beyond the first and the last slice, voxels repeat. */
  TPixel (*evaluateSegments)(const ExactView<TPixel> & view,
                             const RayPatch<TPixel> &  patch,
                             const RaySegment *        segments,
                             std::size_t               count);

  /** Does the same for all segments from slice \a sliceBegin to slice \a sliceEnd. Segments near which no voxel is
   * good enough are left out. Before, evaluateSegments() must have had a segment of each ray. */
  TPixel (*searchLayer)(const ExactView<TPixel> & view,
                        const RayPatch<TPixel> &  patch,
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

/** Returns the sample with weights \a x and \a y between voxels b[column], b[before], a[column] and a[before]. Only
 * voxels with a bit in \a counted have weight; the first voxel has the lowest bit. */
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

/** Returns the kernels in standard C++: the reference for all others. */
template <typename TPixel>
const ShearWarpMIP_EXPORT Kernels<TPixel> &
                          GetPortableKernels();

/** Returns the kernels of the instruction set in the environment variable SHEARWARPMIP_INSTRUCTION_SET or, if the
 * variable is not set, of the best one of this computer. Throws InvalidParameter if this computer does not have the
 * instruction set. */
template <typename TPixel>
const ShearWarpMIP_EXPORT Kernels<TPixel> &
                          GetKernels();

} // namespace itk::ShearWarp

#endif
