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

#include "itkShearWarpFactorization.h"
#include "PreparedVolume.h"

#include <optional>
#include <vector>

namespace itk
{
/** \class ShearWarpProjector
 * \brief Projects a prepared volume to the intermediate images of views along one axis, by several threads: the
 * maximum, the minimum or the sample of the largest magnitude, of all samples or of those in a region or a mask, faded
 * or not; or the first local one; and the slices that they are of.
 *
 * The volume is divided into blocks of rows and slices. Each thread takes the next block and raises intermediate
 * images of its own, or for the minimum lowers them; the extremum over the threads' images is the result. It does not
 * depend on who took which block; of equal samples the nearest is kept. A block is projected for all views while it is
 * in the cache, so that the volume is read once.
 *
 * Where the order of samples matters, blocks are rows of one intermediate image that all threads share, and slices come
 * from the viewer on.
 *
 * Reduced resampling (Fang et al. 2002, figure 3) by tiles: before a thread projects eight slices of a block, it
 * compares the maximum of the cubes that a tile's samples come from with the least pixel that the tile has already. A
 * sample is never above the maximum of its voxels, so where that is not greater nothing can change. Only the
 * maximum of the whole image has it.
 *
 * The phases of an oversampled intermediate image are projected together, while the voxels are in the cache, and joined
 * at the end.
 *
 * The memory is kept from one projection to the next.
 *
 * \ingroup ShearWarpMIP
 */
template <typename TPixel>
class ShearWarpMIP_EXPORT ShearWarpProjector
{
public:
  using ReducedResamplingEnum = ShearWarpMIPImageFilterEnums::ReducedResampling;
  using ModeEnum = ShearWarpMIPImageFilterEnums::Mode;
  using IntermediateImageType = ShearWarp::IntermediateImage<TPixel>;

  using IntervalList = std::vector<ShearWarp::Interval>;

  struct View
  {
    const ShearWarpFactorization * factorization;
    /** Samples count in all of them. */
    IntervalList intervals;
    /** How samples fade to the background, if they do; it needs the slices. */
    std::optional<ShearWarp::Fading> fading{};
  };
  using ViewList = std::vector<View>;

  /** More are projected in order. */
  static constexpr std::ptrdiff_t MostRankedSlices = ShearWarp::NoRank<TPixel> - 1;

  /** What is wanted of the samples. */
  struct Parameters
  {
    ModeEnum mode{ ModeEnum::Maximum };
    /** Whether the intermediate images tell the slices of their pixels. */
    bool hasSlices{ false };
    /** Whether samples come from the viewer on; then there is one view, it has slices, and slabs come so too. */
    bool   isOrdered{ false };
    TPixel background{};
    /** Of the voxels that count in a mask; 0 for all but 0. */
    unsigned char         maskLabel{ 0 };
    ReducedResamplingEnum reducedResampling{ ReducedResamplingEnum::Off };
    /** If given, and samples come in order, rays end behind their first local extremum that is not less good. */
    std::optional<TPixel> localThreshold{};
  };

  /** Begins a projection by at most \a workers threads. The factorizations of \a views, of one principal axis and one
   * oversampling, and \a kernels must live until Finish(). */
  void
  Start(ViewList                           views,
        const ShearWarp::Kernels<TPixel> & kernels,
        const Parameters &                 parameters,
        SizeValueType                      workers);

  /** What pixels keep. */
  static ShearWarp::Extremum
  FindExtremum(ModeEnum mode)
  {
    using ShearWarp::Extremum;
    mode = Simplify(mode);
    return mode == ModeEnum::Minimum           ? Extremum::Minimum
           : mode == ModeEnum::AbsoluteMaximum ? Extremum::Magnitude
                                               : Extremum::Maximum;
  }

  /** Whether the first slice along the volume's z axis is met before the last one: the order of slabs. */
  static bool
  IsFirstSlabFront(const ShearWarpFactorization & factorization);

  /** Projects what \a volume has prepared for the factorizations' principal axis: all or, one after the other, parts.
   * \a mask, of the same size and with block minima, restricts it if that is not null; it needs the slices.
   * Throws MemoryAllocationError. */
  void
  Project(const ShearWarpPreparedVolume<TPixel> &        volume,
          const ShearWarpPreparedVolume<unsigned char> * mask,
          const ShearWarp::Parallelize &                 parallelize);

  /** The intermediate image, of view \a view, of all that was projected since Start(). It refers to this object's
   * memory and to the factorization's, and is valid until the next call. Throws MemoryAllocationError. */
  IntermediateImageType
  Finish(std::size_t view, const ShearWarp::Parallelize & parallelize);

  /** The fraction of tiles that the last projection left out. */
  double
  GetSkippedFraction() const;

  /** Frees all memory. */
  void
  Release()
  {
    *this = ShearWarpProjector();
  }

  SizeValueType
  GetSizeInBytes() const;

  /** Bytes of one thread's intermediate image of \a size pixels, with a region or slices or without. */
  static SizeValueType
  GetImageSizeInBytes(const Size<2> & size, unsigned int oversampling, ModeEnum mode, bool hasRegion, bool hasSlices);

private:
  using PlacementList = std::vector<ShearWarp::SlicePlacement>;
  using RankType = ShearWarp::SliceRank<TPixel>;

  /** What one thread has projected onto one grid: rows [rowBegin, rowEnd). */
  struct PartialImage
  {
    ShearWarpBuffer                    pixels;
    ShearWarpBuffer                    marks; // of pixels that have met a sample of the region
    std::vector<ShearWarp::ColumnSpan> known;
    ShearWarpBuffer                    ranks;
    ShearWarpBuffer                    slices; // of the pixels whose ranks are settled, if samples come in order
    std::ptrdiff_t                     rowBegin{ 0 }, rowEnd{ 0 };
    std::vector<TPixel>                lowerBounds; // no pixel of the tile is below
  };

  struct Worker
  {
    std::vector<PartialImage>                      images; // one for each grid
    std::vector<ShearWarp::ShearedView<TPixel>>    views;
    std::vector<std::vector<ShearWarp::TileState>> active; // of each grid
    std::vector<TPixel>                            columnMaxima;
    std::vector<unsigned int>                      columnParts;
    SizeValueType                                  tiles{ 0 };
    SizeValueType                                  skippedTiles{ 0 };
    std::ptrdiff_t                                 untestedCubes{ 0 };
    std::ptrdiff_t                                 pause{ 0 };
  };

  struct TileCount
  {
    SizeValueType all, skipped;
  };

  /** Whether \a minimum, which is not above \a maximum, has the larger magnitude. */
  static bool
  IsMagnitudeLarger(TPixel minimum, TPixel maximum)
  {
    if constexpr (std::is_floating_point_v<TPixel>)
    {
      return minimum < 0 && -minimum > maximum;
    }
    else if constexpr (std::is_signed_v<TPixel>)
    {
      // that of the lowest integer has no sign
      return minimum < 0 && (maximum < 0 || -(minimum + 1) >= maximum);
    }
    return false;
  }

  /** No unsigned minimum has a larger magnitude than the maximum. */
  static ModeEnum
  Simplify(ModeEnum mode)
  {
    return mode == ModeEnum::AbsoluteMaximum && !std::is_signed_v<TPixel> ? ModeEnum::Maximum : mode;
  }

  /** An odd number of tiles, so that rows do not compete for the same lines of the cache. */
  static std::ptrdiff_t
  GetRowStride(std::ptrdiff_t tileColumns)
  {
    return (tileColumns | 1) * ShearWarp::TileColumns;
  }

  void
  OrderSlices();

  /** Rows [begin, end) of the slices or, if samples come in order, of one grid. */
  struct Rows
  {
    std::ptrdiff_t begin, end;
    std::size_t    gridBegin, gridEnd;
  };

  /** Of elements [first, last) of m_SliceOrder. */
  void
  ProjectRows(Worker & worker, const Rows & rows, std::ptrdiff_t first, std::ptrdiff_t last);

  bool
  SelectTiles(Worker & worker, const Rows & rows, const ShearWarp::Block & block);

  TileCount
  SelectTiles(Worker & worker, std::size_t grid, const ShearWarp::Block & block);

  TileCount
  SelectMaskedTiles(Worker & worker, std::size_t grid, const ShearWarp::Block & block) const;

  /** A range of cubes, or of tiles. */
  struct Range
  {
    std::ptrdiff_t begin, end;
  };

  /** For each row of the block's tiles: \a beginRow(cubeRows), then for each of its tiles \a getState(tileRows,
   * tileColumn, cubeColumns), of which the samples may be. */
  template <typename TBeginRow, typename TGetState>
  TileCount
  ForEachTile(Worker &                 worker,
              std::size_t              grid,
              const ShearWarp::Block & block,
              const TBeginRow &        beginRow,
              const TGetState &        getState) const;

  /** Onto which \a worker projects, for each grid. */
  std::vector<PartialImage> &
  GetImages(Worker & worker)
  {
    return m_Parameters.isOrdered ? m_Workers.front().images : worker.images;
  }

  bool
  IsAnyBelow(PartialImage & image, std::ptrdiff_t tileRow, std::ptrdiff_t tileColumn, TPixel value) const;

  void
  ReserveRows(PartialImage & image) const;

  void
  ExtendRows(std::size_t grid, PartialImage & image, std::ptrdiff_t begin, std::ptrdiff_t end) const;

  void
  FillRows(std::size_t grid, PartialImage & image, std::ptrdiff_t begin, std::ptrdiff_t end) const;

  TPixel *
  MergeRow(std::size_t grid, std::ptrdiff_t row);

  const std::uint8_t *
  MergeMarks(std::size_t grid, std::ptrdiff_t row);

  RankType *
  GetRanks(const PartialImage & image, std::ptrdiff_t row) const
  {
    return m_Parameters.hasSlices ? image.ranks.template GetPointer<RankType>() + row * m_RowStride : nullptr;
  }

  /** Which slice of the volume has rank 1, and whether the next ranks are those of the next slices or of the ones
   * before. */
  struct Ranking
  {
    std::ptrdiff_t first, step;

    std::int32_t
    GetSlice(RankType rank) const
    {
      return static_cast<std::int32_t>(first + step * (rank - 1));
    }
  };

  /** For element \a cube of m_SliceOrder. */
  Ranking
  GetRanking(const View & view, std::ptrdiff_t cube) const;

  static bool
  IsFirstSliceNearest(const ShearWarpFactorization & factorization)
  {
    return factorization.GetDepthFunction().perSlice > 0;
  }

  /** Notes the slices of pixels whose ranks count from element \a cube of m_SliceOrder on. */
  void
  SettleRanks(const Rows & rows, std::ptrdiff_t cube);

  /** In any order, for the absolute maximum, each phase has two grids: of maxima, then of minima. */
  ShearWarp::Extremum
  GetExtremum(std::size_t grid) const
  {
    using ShearWarp::Extremum;
    const Extremum extremum = FindExtremum(m_Parameters.mode);
    const bool     isPair = extremum == Extremum::Magnitude && !m_Parameters.isOrdered;
    return isPair ? (grid % 2 == 1 ? Extremum::Minimum : Extremum::Maximum) : extremum;
  }

  TPixel
  GetStart(std::size_t grid) const
  {
    using ShearWarp::Extremum;
    const Extremum extremum = this->GetExtremum(grid);
    return extremum == Extremum::Minimum     ? ShearWarp::NoSample<TPixel, Extremum::Minimum>
           : extremum == Extremum::Magnitude ? ShearWarp::NoSample<TPixel, Extremum::Magnitude>
                                             : ShearWarp::NoSample<TPixel>;
  }

  std::vector<Worker>                m_Workers;
  SizeValueType                      m_NumberOfWorkers{ 1 };
  ShearWarpBuffer                    m_JoinedPhases;
  ShearWarpBuffer                    m_JoinedSlices; // where pixels may have no value; all are 0 unless they are wanted
  std::vector<ShearWarp::ColumnSpan> m_Reached;      // of its rows
  std::vector<std::ptrdiff_t>        m_SliceOrder;   // the first of each BlockLength slices
  std::ptrdiff_t                     m_RankedCubes{ 1 }; // ranks begin anew after so many of these

  const ShearWarp::Kernels<TPixel> *               m_Kernels{ nullptr };
  ViewList                                         m_Views;
  std::vector<ShearWarp::Region>                   m_Regions; // of each grid, if any has intervals
  std::vector<ShearWarp::ViewFading<TPixel>>       m_Fadings; // of each grid, if samples fade
  Parameters                                       m_Parameters;
  std::vector<const ShearWarp::IntermediateGrid *> m_Grids;      // of each view its phases, of these the extrema
  std::vector<PlacementList>                       m_Placements; // on each grid, of the slices
  ShearWarp::SliceStack<TPixel>                    m_Slices{};
  ShearWarp::BlockExtrema<TPixel>                  m_BlockExtrema{};
  ShearWarp::Mask                                  m_Mask; // without voxels if there is none
  ShearWarp::BlockExtrema<unsigned char>           m_BlocksOfMask{};
  bool                                             m_HasCommonRows{ false };
  std::ptrdiff_t                                   m_FirstSlice{ 0 }; // of these slices, in the volume
  ReducedResamplingEnum                            m_ReducedResampling{ ReducedResamplingEnum::Off };
  std::ptrdiff_t                                   m_TileColumns{ 0 }, m_TileRows{ 0 }, m_RowStride{ 0 };
};
} // namespace itk

#endif
