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
#ifndef itkShearWarpProjector_h
#define itkShearWarpProjector_h

#include "PreparedVolume.h"

#include <optional>
#include <vector>

namespace itk::ShearWarp
{
/** A view of a pass: where its slices are, and which samples count. */
struct ProjectedView
{
  const IntermediateGrid * grid{ nullptr };
  /** The depth of column, row and slice of the grid. */
  ShearedFunction depth{};
  /** A sample counts if all intervals contain it. */
  std::vector<Interval> intervals{};
  std::optional<Fading> fading{};

  bool
  IsFirstSliceNearest() const
  {
    return depth.perSlice > 0;
  }
};

/** \class Projector
 * \brief Projects a prepared volume to the intermediate images of the views of a pass, by several threads.
 *
 * An image collects one value per ray, the maximum or the minimum of the samples that count, and optionally the rank of
 * the slice that the value came from. An absolute maximum is made from two images, of maxima and of minima.
 *
 * The volume is divided into blocks of rows and slices. Each thread takes the next block and raises (or lowers) images
 * of its own; the extremum over all threads' images is the result. The result does not depend on which thread took
 * which block: among equal samples the lowest rank wins. A block is projected for all views while it is in the cache,
 * so the volume is read once.
 *
 * Where the order of samples matters, blocks are rows of one image that all threads share, and slices come from the
 * viewer on.
 *
 * Reduced resampling (Fang et al. 2002, figure 3) works on tiles. Before a thread projects eight slices of a block, it
 * compares the largest voxel of the cubes that a tile's samples come from with the least pixel that the tile has
 * already. A sample is never above its voxels, so nothing changes if the voxel is not greater, and the tile is skipped.
 * Only plain maxima are projected in this way.
 *
 * The memory is kept from one projection to the next.
 *
 * \ingroup ShearWarpMIP
 */
template <typename TPixel>
class ShearWarpMIP_EXPORT Projector
{
public:
  /** With more slices, ranks begin anew, and samples must come in order. */
  static constexpr std::ptrdiff_t MostRankedSlices = NoRank<TPixel> - 1;

  struct Parameters
  {
    Mode mode{ Mode::Maximum };
    bool hasRanks{ false };
    /** Whether samples come from the viewer on. Then all views have one direction, images have ranks or sums, and slabs
     * come from the viewer on too. */
    bool isOrdered{ false };
    /** Whether the first slice is left out, because another part of the volume has it. Only sums need this. */
    bool              isFirstSliceShared{ false };
    TPixel            background{};
    unsigned char     maskLabel{ 0 };
    ReducedResampling reducedResampling{ ReducedResampling::Off };
    /** If given, and samples come in order, a ray ends behind its first local extremum that reaches the threshold. */
    std::optional<TPixel> localThreshold{};
  };

  /** Begins a pass of views along \a axis, by at most \a workers threads. The grids of \a views and \a kernels must
   * live until the last Finish(). */
  void
  Begin(std::vector<ProjectedView> views,
        unsigned int               axis,
        const Kernels<TPixel> &    kernels,
        const Parameters &         parameters,
        std::size_t                workers);

  /** Projects the prepared voxels: all, or a piece of the volume after another. \a mask, with block minima, has the
   * same size, or is null. Throws OutOfMemory. */
  void
  Project(const PreparedVolume<TPixel> & volume, const PreparedVolume<unsigned char> * mask, const RunTasks & run);

  /** Returns the intermediate image of a view, of all that was projected since Begin(). Its memory belongs to this
   * object and is valid until the next call. Throws OutOfMemory. */
  IntermediateImage<TPixel>
  Finish(std::size_t view, const RunTasks & run);

  /** Returns the sums of a view after Finish(), laid out as the intermediate image. */
  SummedImage<TPixel>
  GetSums(std::size_t view) const
  {
    return this->GetSummed(m_Workers.front().images[view * m_ImagesOfView]);
  }

  /** Returns the fraction of tiles that were skipped since Begin(). */
  double
  GetSkippedFraction() const;

  /** Frees all memory. */
  void
  Release()
  {
    *this = Projector();
  }

  std::size_t
  GetSizeInBytes() const;

  /** Returns the bytes of one thread's images of a view. */
  static std::size_t
  GetViewSizeInBytes(std::ptrdiff_t columns, std::ptrdiff_t rows, Mode mode, bool hasRegion, bool hasRanks);

private:
  using RankType = SliceRank<TPixel>;

  /** A view, and what depends on the slices that are projected. */
  struct PlacedView
  {
    ProjectedView               view;
    Region                      region;
    ViewFading<TPixel>          fading;
    std::vector<SlicePlacement> placements;
  };

  /** What one thread has projected to one image: rows [rowBegin, rowEnd). */
  struct ThreadImage
  {
    Buffer                  pixels;
    Buffer                  marks; // of pixels that have met a sample of the region
    std::vector<ColumnSpan> known;
    Buffer                  ranks;
    Buffer                  settledRanks; // if samples come in order
    Buffer                  sums, countSteps;
    std::ptrdiff_t          rowBegin{ 0 }, rowEnd{ 0 };
    std::vector<TPixel>     lowerBounds; // of the pixels of each tile
  };

  struct Worker
  {
    std::vector<ThreadImage>            images;
    std::vector<ShearedView<TPixel>>    views;
    std::vector<std::vector<TileState>> active; // of each image
    std::vector<TPixel>                 columnMaxima;
    std::vector<unsigned int>           columnParts;
    std::size_t                         tiles{ 0 };
    std::size_t                         skippedTiles{ 0 };
    std::ptrdiff_t                      untestedCubes{ 0 };
    std::ptrdiff_t                      pause{ 0 };
  };

  struct TileCount
  {
    std::size_t all, skipped;
  };

  /** Rows [begin, end) of the slices or, if samples come in order, of one image. */
  struct Rows
  {
    std::ptrdiff_t begin, end;
    std::size_t    imageBegin, imageEnd;
  };

  /** A range of cubes, or of tiles. */
  struct Range
  {
    std::ptrdiff_t begin, end;
  };

  /** Returns whether two images make a view: of an unsigned type, the absolute maximum is the maximum. */
  static bool
  HasTwoImages(Mode mode);

  /** Returns what an image of a view collects, unless it collects sums. */
  Extremum
  GetExtremum(std::size_t image) const;

  SummedImage<TPixel>
  GetSummed(const ThreadImage & image) const
  {
    return { image.sums.template GetPointer<SampleSum<TPixel>>(),
             image.countSteps.template GetPointer<std::uint32_t>() };
  }

  TPixel
  GetStart(std::size_t image) const;

  /** An odd number of tiles, so that rows do not compete for the same lines of the cache. */
  static std::ptrdiff_t
  GetRowStride(std::ptrdiff_t tileColumns)
  {
    return (tileColumns | 1) * TileColumns;
  }

  std::size_t
  CountImages() const
  {
    return m_Views.size() * m_ImagesOfView;
  }

  const PlacedView &
  GetView(std::size_t image) const
  {
    return m_Views[image / m_ImagesOfView];
  }

  const IntermediateGrid &
  GetGrid(std::size_t image) const
  {
    return *this->GetView(image).view.grid;
  }

  // Projector.cxx
  void
  SetSlices(const PreparedVolume<TPixel> & volume, const PreparedVolume<unsigned char> * mask);

  bool
  HaveCommonRows() const;

  void
  OrderCubes();

  std::vector<Rows>
  MakeBlocks() const;

  void
  ProjectRows(Worker & worker, const Rows & rows, std::ptrdiff_t first, std::ptrdiff_t last);

  std::ptrdiff_t
  FindCubesTogether(const Worker & worker, std::ptrdiff_t first, std::ptrdiff_t last, bool isTested) const;

  void
  ExtendImages(Worker & worker, const Rows & rows, const Block & block) const;

  ShearedView<TPixel>
  MakeShearedView(Worker & worker, std::size_t image, bool areSelected, std::ptrdiff_t cube);

  Ranking
  GetRanking(const ProjectedView & view) const;

  Ranking
  GetRankingOfCube(std::ptrdiff_t cube) const;

  void
  SettleRanks(const Rows & rows, std::ptrdiff_t cube);

  RankType *
  GetRanks(const ThreadImage & image, std::ptrdiff_t row) const
  {
    return m_Parameters.hasRanks ? image.ranks.template GetPointer<RankType>() + row * m_RowStride : nullptr;
  }

  std::vector<ThreadImage> &
  GetImages(Worker & worker)
  {
    return m_Parameters.isOrdered ? m_Workers.front().images : worker.images;
  }

  void
  ReserveRows(ThreadImage & image) const;

  void
  ExtendRows(std::size_t n, ThreadImage & image, std::ptrdiff_t begin, std::ptrdiff_t end) const;

  void
  FillRows(std::size_t n, ThreadImage & image, std::ptrdiff_t begin, std::ptrdiff_t end) const;

  // ProjectorTiles.cxx
  bool
  SelectTiles(Worker & worker, const Rows & rows, const Block & block);

  TileCount
  SelectRaisedTiles(Worker & worker, std::size_t image, const Block & block);

  TileCount
  SelectMaskedTiles(Worker & worker, std::size_t image, const Block & block) const;

  /** Rows of pixels and of cubes. */
  struct RowsOfTiles
  {
    Range pixels, cubes;
  };

  static RowsOfTiles
  FindRowsOfTiles(const Block & block, const std::vector<SlicePlacement> & placements, std::ptrdiff_t row);

  template <typename TBeginRow, typename TGetState>
  TileCount
  ForEachTile(Worker &          worker,
              std::size_t       image,
              const Block &     block,
              const TBeginRow & beginRow,
              const TGetState & getState) const;

  bool
  IsAnyBelow(ThreadImage & image, std::ptrdiff_t tileRow, std::ptrdiff_t tileColumn, TPixel value) const;

  // ProjectorMerge.cxx
  void
  MergeView(std::size_t firstImage, std::ptrdiff_t row, bool hasRanks);

  TPixel *
  MergeRow(std::size_t n, std::ptrdiff_t row);

  const std::uint8_t *
  MergeMarks(std::size_t n, std::ptrdiff_t row);

  void
  FindMeans(std::size_t n, std::ptrdiff_t row, bool hasRanks);

  /** A row of a view, merged from all threads. Without a second image, there are no minima. */
  struct MergedRow
  {
    TPixel *             pixels;
    const TPixel *       minima;
    const std::uint8_t * marks;
  };

  void
  SetRanks(std::size_t firstImage, std::ptrdiff_t row, const MergedRow & merged);

  std::vector<Worker>         m_Workers;
  std::size_t                 m_NumberOfWorkers{ 1 };
  Buffer                      m_Ranks;            // of a view's pixels that may have no value
  Buffer                      m_Means;            // of a view's pixels
  std::vector<ColumnSpan>     m_Reached;          // of a view's rows
  std::vector<std::ptrdiff_t> m_Cubes;            // the first slice of each cube, in the order of projection
  std::ptrdiff_t              m_RankedCubes{ 1 }; // ranks begin anew after so many cubes

  const Kernels<TPixel> *     m_Kernels{ nullptr };
  unsigned int                m_Axis{ 2 };
  std::vector<PlacedView>     m_Views;
  std::size_t                 m_ImagesOfView{ 1 };
  bool                        m_HasRegion{ false };
  bool                        m_HasSums{ false };
  bool                        m_MayHaveGaps{ false };
  Parameters                  m_Parameters;
  SliceStack<TPixel>          m_Slices{};
  BlockExtrema<TPixel>        m_BlockExtrema{};
  Mask                        m_Mask; // without voxels if there is none
  BlockExtrema<unsigned char> m_BlocksOfMask{};
  bool                        m_HasCommonRows{ false };
  std::ptrdiff_t              m_FirstSlice{ 0 }; // of the slices, in the volume
  ReducedResampling           m_ReducedResampling{ ReducedResampling::Off };
  std::ptrdiff_t              m_TileColumns{ 0 }, m_TileRows{ 0 }, m_RowStride{ 0 };
};
} // namespace itk::ShearWarp

#endif
