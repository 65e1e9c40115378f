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
#include "Projector.h"

#include "kernels/PixelTypes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <numeric>

namespace itk
{
template <typename TPixel>
void
ShearWarpProjector<TPixel>::Start(ViewList                           views,
                                  const ShearWarp::Kernels<TPixel> & kernels,
                                  const Parameters &                 parameters,
                                  SizeValueType                      workers)
{
  const bool hasRegion =
    std::any_of(views.begin(), views.end(), [](const View & view) { return !view.intervals.empty(); });
  m_Kernels = &kernels;
  m_Views = std::move(views);
  m_Parameters = parameters;
  m_Parameters.mode = Simplify(parameters.mode);
  if (m_Parameters.mode != ModeEnum::Maximum || hasRegion || parameters.hasSlices)
  {
    m_Parameters.reducedResampling = ReducedResamplingEnum::Off;
  }
  m_NumberOfWorkers = workers;
  m_Grids.clear();
  m_Regions.clear();
  m_Fadings.clear();
  m_TileColumns = m_TileRows = 0;
  for (const View & view : m_Views)
  {
    std::size_t phase = 0;
    for (const ShearWarp::IntermediateGrid & grid : view.factorization->GetPhases())
    {
      ShearWarp::Region region{ view.intervals };
      for (ShearWarp::Interval & interval : region.intervals)
      {
        interval.function = view.factorization->GetFunctionOfPhase(interval.function, phase);
      }
      const auto depth = view.factorization->GetFunctionOfPhase(view.factorization->GetDepthFunction(), phase);
      ++phase;
      const bool        isPair = m_Parameters.mode == ModeEnum::AbsoluteMaximum && !m_Parameters.isOrdered;
      const std::size_t extrema = isPair ? 2 : 1;
      m_Grids.insert(m_Grids.end(), extrema, &grid);
      m_Regions.insert(m_Regions.end(), hasRegion ? extrema : 0, region);
      if (view.fading)
      {
        m_Fadings.insert(m_Fadings.end(), extrema, { *view.fading, depth, parameters.background });
      }
      m_TileColumns = std::max(m_TileColumns, ShearWarp::CountBlocks(grid.columns, ShearWarp::TileColumns));
      m_TileRows = std::max(m_TileRows, ShearWarp::CountBlocks(grid.rows));
    }
  }
  m_RowStride = GetRowStride(m_TileColumns);

  m_Workers.resize(std::max<SizeValueType>(m_Workers.size(), workers));
  for (Worker & worker : m_Workers)
  {
    worker.images.resize(m_Grids.size());
    worker.active.resize(m_Grids.size());
    for (PartialImage & image : worker.images)
    {
      image.rowBegin = image.rowEnd = 0;
    }
    worker.tiles = worker.skippedTiles = 0;
    worker.untestedCubes = worker.pause = 0;
  }
}

template <typename TPixel>
bool
ShearWarpProjector<TPixel>::IsFirstSlabFront(const ShearWarpFactorization & factorization)
{
  const bool isFirstSliceNearest = IsFirstSliceNearest(factorization);
  // along other axes rows are along z, and a ray goes through them against the shear
  return factorization.GetPrincipalAxis() == 2 ? isFirstSliceNearest
                                               : isFirstSliceNearest == (factorization.GetShear()[1] < 0);
}

template <typename TPixel>
void
ShearWarpProjector<TPixel>::Project(const ShearWarpPreparedVolume<TPixel> &        volume,
                                    const ShearWarpPreparedVolume<unsigned char> * mask,
                                    const ShearWarp::Parallelize &                 parallelize)
{
  using ShearWarp::BlockLength;
  using ShearWarp::CountBlocks;

  const unsigned int axis = m_Views.front().factorization->GetPrincipalAxis();
  m_Slices = volume.GetSlices(axis);
  m_BlockExtrema = volume.GetBlockExtrema(axis);
  m_Mask = {};
  if (mask)
  {
    const auto slices = mask->GetSlices(axis);
    m_Mask = { slices.voxels, slices.rowStride, slices.sliceStride, m_Parameters.maskLabel };
    m_BlocksOfMask = mask->GetBlockExtrema(axis);
  }
  m_Placements.clear();
  for (const ShearWarp::IntermediateGrid * grid : m_Grids)
  {
    m_Placements.push_back(ShearWarp::PlacePart(*grid, volume.GetCorner(axis), m_Slices.slices));
  }
  m_FirstSlice = volume.GetCorner(axis).slice;
  for (ShearWarp::Region & region : m_Regions)
  {
    region.firstSlice = m_FirstSlice;
  }
  for (auto & fading : m_Fadings)
  {
    fading.SetStack(m_Slices.columns, m_FirstSlice);
  }
  m_ReducedResampling = m_BlockExtrema.maxima ? m_Parameters.reducedResampling : ReducedResamplingEnum::Off;
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    // an interpolation whose difference overflows can exceed its voxels
    if (!std::isfinite(m_Slices.highest - m_Slices.lowest))
    {
      m_ReducedResampling = ReducedResamplingEnum::Off;
    }
  }
  // slices together are faster where samples have two voxels
  const auto isTurnAboutAxis = [](const View & view) {
    const auto & placements = view.factorization->GetSlicePlacements();
    const auto   areWhole = [&](ShearWarp::SamplingPosition ShearWarp::SlicePlacement::* position) {
      return std::all_of(
        placements.begin(), placements.end(), [=](const auto & slice) { return (slice.*position).fraction == 0; });
    };
    return areWhole(&ShearWarp::SlicePlacement::column) || areWhole(&ShearWarp::SlicePlacement::row);
  };
  m_HasCommonRows = m_Views.size() > 1 && std::all_of(m_Views.begin(), m_Views.end(), isTurnAboutAxis);

  // where slices lie side by side a few rows are long runs in memory, else all rows of a slice are; several images
  // share rows of BlockLength slices; in order, a thread keeps its rows of the image in the cache
  const bool           isOrdered = m_Parameters.isOrdered;
  const auto           images = isOrdered ? 1 : static_cast<std::ptrdiff_t>(m_Grids.size());
  const std::ptrdiff_t allRows = isOrdered ? m_TileRows * BlockLength : m_Slices.rows;
  const std::ptrdiff_t rowBytes = m_Slices.columns * static_cast<std::ptrdiff_t>(sizeof(TPixel));
  const bool           isLongRun = m_Slices.sliceStride > m_Slices.rowStride;
  const std::ptrdiff_t wanted = images > 1 || isOrdered ? CountBlocks(1 << 16, rowBytes)
                                : isLongRun             ? CountBlocks(1 << 18, rowBytes)
                                                        : 2 * BlockLength;
  const std::ptrdiff_t fairShare = CountBlocks(allRows, 2 * static_cast<std::ptrdiff_t>(m_NumberOfWorkers));
  const std::ptrdiff_t blockRows = CountBlocks(std::min(wanted, fairShare)) * BlockLength;
  std::vector<Rows>    blocks;
  for (std::size_t grid = 0; grid < (isOrdered ? m_Grids.size() : 1); ++grid)
  {
    for (std::ptrdiff_t row = 0; row < allRows; row += blockRows)
    {
      blocks.push_back({ row, std::min(row + blockRows, allRows), grid, isOrdered ? grid + 1 : m_Grids.size() });
    }
  }
  // a step takes milliseconds at most
  constexpr std::ptrdiff_t stepVoxels = 1 << 21;
  constexpr std::ptrdiff_t mostCubes = MostRankedSlices / BlockLength;
  const std::ptrdiff_t     stepCubes =
    std::min(stepVoxels / (images * blockRows * m_Slices.columns * BlockLength) + 1, mostCubes);
  m_RankedCubes = mostCubes / stepCubes * stepCubes;
  this->OrderSlices();

  const bool isFirst = isOrdered && m_Workers.front().images.front().rowEnd == 0;
  for (std::size_t grid = 0; isFirst && grid < m_Grids.size(); ++grid)
  {
    PartialImage & image = m_Workers.front().images[grid];
    this->ReserveRows(image);
    image.rowEnd = allRows;
  }
  const auto cubes = static_cast<std::ptrdiff_t>(m_SliceOrder.size());
  parallelize(static_cast<SizeValueType>(blocks.size()),
              static_cast<SizeValueType>(CountBlocks(cubes, stepCubes)),
              [&](SizeValueType n, SizeValueType step, SizeValueType worker) {
                const Rows &         rows = blocks[n];
                const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(step) * stepCubes;
                const std::ptrdiff_t last = std::min(first + stepCubes, cubes);
                if (isFirst && first == 0)
                {
                  this->FillRows(rows.gridBegin, m_Workers.front().images[rows.gridBegin], rows.begin, rows.end);
                }
                this->ProjectRows(m_Workers[worker], rows, first, last);
                if (isOrdered && (last == cubes || last % m_RankedCubes == 0))
                {
                  this->SettleRanks(rows, first);
                }
              });
}

template <typename TPixel>
auto
ShearWarpProjector<TPixel>::Finish(std::size_t view, const ShearWarp::Parallelize & parallelize)
  -> IntermediateImageType
{
  const ShearWarpFactorization & factorization = *m_Views[view].factorization;
  const auto                     oversampling = static_cast<std::ptrdiff_t>(factorization.GetOversampling());
  const std::ptrdiff_t           rowStride = oversampling * m_RowStride;
  const auto                     columns = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[0]);
  const auto                     rows = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[1]);
  const std::size_t              phases = factorization.GetPhases().size();
  const std::size_t              extrema = m_Grids.size() / (m_Views.size() * phases);
  const std::size_t              firstGrid = view * phases * extrema;

  std::vector<PartialImage> & merged = m_Workers.front().images;
  for (std::size_t n = firstGrid; n < firstGrid + phases * extrema; ++n)
  {
    this->ExtendRows(n, merged[n], 0, m_TileRows * ShearWarp::BlockLength);
  }
  if (oversampling > 1)
  {
    m_JoinedPhases.Reserve(rows * rowStride * sizeof(TPixel), "the joined intermediate image");
  }
  // the better one of two extrema does not tell whether a float has met a sample
  const bool    hasRegion = !m_Regions.empty();
  const bool    isAbsolute = extrema == 2;
  const bool    isMagnitude = this->GetExtremum(firstGrid) == ShearWarp::Extremum::Magnitude;
  const bool    mayHaveGaps = hasRegion || m_Parameters.hasSlices || (isAbsolute && std::is_floating_point_v<TPixel>);
  const Ranking ranking = this->GetRanking(m_Views[view], 0);
  if (mayHaveGaps)
  {
    m_Reached.resize(rows);
    m_JoinedSlices.Reserve(rows * rowStride * sizeof(std::int32_t), "the slices of the joined intermediate image");
  }
  auto * const             slices = m_JoinedSlices.template GetPointer<std::int32_t>();
  constexpr std::ptrdiff_t bandPixels = 1 << 17;
  const std::ptrdiff_t     bandRows = bandPixels / rowStride + 1;
  std::atomic<bool>        hasGaps{ false };
  const auto               mergeBand = [&](SizeValueType n, SizeValueType, SizeValueType) {
    const std::ptrdiff_t begin = static_cast<std::ptrdiff_t>(n) * bandRows;
    for (std::ptrdiff_t row = begin; row < std::min(begin + bandRows, rows); ++row)
    {
      for (std::ptrdiff_t column = 0; column < oversampling; ++column)
      {
        const std::ptrdiff_t phaseOfRow = row % oversampling * oversampling + column;
        const std::size_t    grid = firstGrid + phaseOfRow * extrema;
        TPixel *             phase = this->MergeRow(grid, row / oversampling);
        const TPixel *       minima = isAbsolute ? this->MergeRow(grid + 1, row / oversampling) : nullptr;
        const RankType *     ranks = this->GetRanks(merged[grid], row / oversampling);
        const RankType * ranksOfMinima = isAbsolute ? this->GetRanks(merged[grid + 1], row / oversampling) : nullptr;
        const std::uint8_t * marks = hasRegion ? this->MergeMarks(grid, row / oversampling) : nullptr;
        const std::int32_t * settled =
          m_Parameters.isOrdered
                          ? merged[grid].slices.template GetPointer<std::int32_t>() + row / oversampling * m_RowStride
                          : nullptr;
        for (std::ptrdiff_t p = 0; mayHaveGaps && p < m_RowStride; ++p)
        {
          const bool isEmpty = std::is_floating_point_v<TPixel> && !isMagnitude && phase[p] == this->GetStart(grid) &&
                               !(isAbsolute && minima[p] != this->GetStart(grid + 1));
          const bool isMinimum = isAbsolute && IsMagnitudeLarger(minima[p], phase[p]);
          const auto rank = m_Parameters.hasSlices ? (isMinimum ? ranksOfMinima : ranks)[p] : RankType{ 0 };
          const bool hasValue = !isEmpty && (!marks || marks[p] != 0) && rank != ShearWarp::NoRank<TPixel>;
          const auto slice = m_Parameters.isOrdered ? settled[p] : m_Parameters.hasSlices ? ranking.GetSlice(rank) : 0;
          slices[row * rowStride + column + p * oversampling] = hasValue ? slice : ShearWarp::NoSlice;
        }
        for (std::ptrdiff_t p = 0; isAbsolute && p < m_RowStride; ++p)
        {
          phase[p] = IsMagnitudeLarger(minima[p], phase[p]) ? minima[p] : phase[p];
        }
        if (oversampling > 1)
        {
          TPixel * joined = m_JoinedPhases.template GetPointer<TPixel>() + row * rowStride + column;
          for (std::ptrdiff_t p = 0; p < m_RowStride; ++p)
          {
            joined[p * oversampling] = phase[p];
          }
        }
      }
      if (mayHaveGaps)
      {
        const auto reached = ShearWarp::FindReached(slices + row * rowStride, columns);
        m_Reached[row] = reached.span;
        if (reached.hasGaps)
        {
          hasGaps = true;
        }
      }
    }
  };
  parallelize(static_cast<SizeValueType>(ShearWarp::CountBlocks(rows, bandRows)), 1, mergeBand);
  const ShearWarpBuffer & pixels = oversampling > 1 ? m_JoinedPhases : merged[firstGrid].pixels;
  return { pixels.template GetPointer<TPixel>(),
           columns,
           rows,
           rowStride,
           mayHaveGaps ? m_Reached.data() : factorization.GetReachedColumns().data(),
           mayHaveGaps ? slices : nullptr,
           hasGaps,
           this->GetStart(firstGrid) };
}

template <typename TPixel>
auto
ShearWarpProjector<TPixel>::GetRanking(const View & view, std::ptrdiff_t cube) const -> Ranking
{
  using ShearWarp::BlockLength;
  const bool isFirstNearest = IsFirstSliceNearest(*view.factorization);
  if (m_Parameters.isOrdered)
  {
    const std::ptrdiff_t first = m_SliceOrder[cube / m_RankedCubes * m_RankedCubes];
    const std::ptrdiff_t nearest = isFirstNearest ? first : std::min(first + BlockLength, m_Slices.slices) - 1;
    return { m_FirstSlice + nearest, isFirstNearest ? 1 : -1 };
  }
  const auto last = static_cast<std::ptrdiff_t>(view.factorization->GetSlicePlacements().size()) - 1;
  return { isFirstNearest ? 0 : last, isFirstNearest ? 1 : -1 };
}

/** Ranks become 0: nearer than those that follow. */
template <typename TPixel>
void
ShearWarpProjector<TPixel>::SettleRanks(const Rows & rows, std::ptrdiff_t cube)
{
  const Ranking        ranking = this->GetRanking(m_Views.front(), cube);
  const PartialImage & image = m_Workers.front().images[rows.gridBegin];
  RankType * const     ranks = this->GetRanks(image, 0);
  auto * const         slices = image.slices.template GetPointer<std::int32_t>();
  for (std::ptrdiff_t p = rows.begin * m_RowStride; p < rows.end * m_RowStride; ++p)
  {
    const auto rank = static_cast<RankType>(ranks[p] & ShearWarp::NoRank<TPixel>);
    if (rank != 0 && rank != ShearWarp::NoRank<TPixel>)
    {
      slices[p] = ranking.GetSlice(rank);
      ranks[p] = static_cast<RankType>(ranks[p] - rank);
    }
  }
}

template <typename TPixel>
double
ShearWarpProjector<TPixel>::GetSkippedFraction() const
{
  SizeValueType tiles = 0;
  SizeValueType skipped = 0;
  for (const Worker & worker : m_Workers)
  {
    tiles += worker.tiles;
    skipped += worker.skippedTiles;
  }
  return tiles == 0 ? 0.0 : static_cast<double>(skipped) / static_cast<double>(tiles);
}

template <typename TPixel>
SizeValueType
ShearWarpProjector<TPixel>::GetSizeInBytes() const
{
  using ShearWarp::CountBytes;
  SizeValueType bytes = m_JoinedPhases.GetSizeInBytes() + CountBytes(m_SliceOrder) + CountBytes(m_Views) +
                        CountBytes(m_Grids) + CountBytes(m_Regions) + m_JoinedSlices.GetSizeInBytes() +
                        CountBytes(m_Reached);
  for (const ShearWarp::Region & region : m_Regions)
  {
    bytes += CountBytes(region.intervals);
  }
  for (const View & view : m_Views)
  {
    bytes += CountBytes(view.intervals);
  }
  bytes += CountBytes(m_Fadings);
  for (const auto & fading : m_Fadings)
  {
    bytes += CountBytes(fading.factors);
  }
  for (const PlacementList & placements : m_Placements)
  {
    bytes += CountBytes(placements);
  }
  for (const Worker & worker : m_Workers)
  {
    bytes += CountBytes(worker.images) + CountBytes(worker.views) + CountBytes(worker.columnMaxima) +
             CountBytes(worker.columnParts);
    for (const PartialImage & image : worker.images)
    {
      bytes += image.pixels.GetSizeInBytes() + image.marks.GetSizeInBytes() + image.ranks.GetSizeInBytes() +
               image.slices.GetSizeInBytes() + CountBytes(image.known) + CountBytes(image.lowerBounds);
    }
    for (const auto & active : worker.active)
    {
      bytes += CountBytes(active);
    }
  }
  return bytes;
}

template <typename TPixel>
SizeValueType
ShearWarpProjector<TPixel>::GetImageSizeInBytes(const Size<2> & size,
                                                unsigned int    oversampling,
                                                ModeEnum        mode,
                                                bool            hasRegion,
                                                bool            hasSlices)
{
  const auto countBlocks = [=](SizeValueType length, std::ptrdiff_t blockLength) {
    return ShearWarp::CountBlocks(ShearWarp::CountBlocks(static_cast<std::ptrdiff_t>(length), oversampling),
                                  blockLength);
  };
  const std::ptrdiff_t pixels = GetRowStride(countBlocks(size[0], ShearWarp::TileColumns)) * ShearWarp::BlockLength *
                                countBlocks(size[1], ShearWarp::BlockLength);
  return SizeValueType{ oversampling } * oversampling * static_cast<SizeValueType>(pixels) *
         (Simplify(mode) == ModeEnum::AbsoluteMaximum ? 2 : 1) *
         (sizeof(TPixel) + hasRegion + (hasSlices ? sizeof(RankType) : 0));
}

/** Storage order, or from the viewer on; but for reduced resampling every few slices first: they soon give all pixels a
 * value. */
template <typename TPixel>
void
ShearWarpProjector<TPixel>::OrderSlices()
{
  using ShearWarp::BlockLength;
  constexpr std::ptrdiff_t seedDistance = 8 * BlockLength;
  const bool               hasSeeds = m_ReducedResampling != ReducedResamplingEnum::Off;
  const std::ptrdiff_t     lastCube = (m_Slices.slices - 1) / BlockLength * BlockLength;
  m_SliceOrder.clear();
  for (const bool isSeed : { true, false })
  {
    for (std::ptrdiff_t slice = 0; slice < m_Slices.slices; slice += BlockLength)
    {
      if (isSeed == (hasSeeds && (slice % seedDistance == 0 || slice == lastCube)))
      {
        m_SliceOrder.push_back(slice);
      }
    }
  }
  if (m_Parameters.isOrdered && !IsFirstSliceNearest(*m_Views.front().factorization))
  {
    std::reverse(m_SliceOrder.begin(), m_SliceOrder.end());
  }
}

template <typename TPixel>
void
ShearWarpProjector<TPixel>::ProjectRows(Worker & worker, const Rows & rows, std::ptrdiff_t first, std::ptrdiff_t last)
{
  using ShearWarp::BlockLength;
  using ShearWarp::BlockRows;
  const bool      isOrdered = m_Parameters.isOrdered;
  const BlockRows rowsOf = isOrdered         ? BlockRows::OfImage
                           : m_HasCommonRows ? BlockRows::OfMiddleSlices
                                             : BlockRows::OfSlices;
  const bool      isBackward = isOrdered && !IsFirstSliceNearest(*m_Views.front().factorization);
  for (std::ptrdiff_t n = first; n < last;)
  {
    // one cube's slices, or as many as follow each other untested
    const bool isTested =
      m_Mask.voxels || (m_ReducedResampling != ReducedResamplingEnum::Off && worker.untestedCubes == 0);
    std::ptrdiff_t end = n + 1;
    while (!isTested && end < last && m_SliceOrder[end] == m_SliceOrder[end - 1] + BlockLength &&
           (m_ReducedResampling == ReducedResamplingEnum::Off || end - n < worker.untestedCubes))
    {
      ++end;
    }
    const std::ptrdiff_t   sliceEnd = std::min(m_SliceOrder[end - 1] + BlockLength, m_Slices.slices);
    const ShearWarp::Block block{ rows.begin, rows.end, m_SliceOrder[n], sliceEnd, m_Slices.rows, rowsOf, isBackward };
    for (std::size_t g = rows.gridBegin; !isOrdered && g < rows.gridEnd; ++g)
    {
      // offsets are monotonic in the slice
      const std::int32_t firstRow = m_Placements[g][block.sliceBegin].row.whole;
      const std::int32_t lastRow = m_Placements[g][block.sliceEnd - 1].row.whole;
      this->ExtendRows(g,
                       worker.images[g],
                       rows.begin + std::min(firstRow, lastRow),
                       std::min(rows.end + std::max(firstRow, lastRow) + 1, m_Grids[g]->rows));
    }
    const bool areSelected = isTested && this->SelectTiles(worker, rows, block);
    worker.views.clear();
    const std::size_t gridsOfView = m_Grids.size() / m_Views.size();
    for (std::size_t g = rows.gridBegin; g < rows.gridEnd; ++g)
    {
      const ShearWarp::IntermediateGrid & grid = *m_Grids[g];
      PartialImage &                      image = this->GetImages(worker)[g];
      const auto &                        active = worker.active[g];
      const auto isNeeded = [](ShearWarp::TileState state) { return state != ShearWarp::TileState::Unneeded; };
      if (!areSelected || std::any_of(active.begin(), active.end(), isNeeded))
      {
        const View & view = m_Views[g / gridsOfView];
        const auto [nearest, step] = this->GetRanking(view, first);
        const ShearWarp::RankedImage<TPixel> ranked{ this->GetRanks(image, 0),
                                                     static_cast<std::int32_t>(1 + step * (m_FirstSlice - nearest)),
                                                     static_cast<std::int32_t>(step) };
        worker.views.push_back(
          { m_Placements[g].data(),
            { image.pixels.template GetPointer<TPixel>(), grid.columns, grid.rows, m_RowStride, grid.reached.data() },
            areSelected ? active.data() : nullptr,
            m_TileColumns,
            this->GetExtremum(g),
            { m_Regions.empty() ? nullptr : &m_Regions[g],
              image.marks.template GetPointer<std::uint8_t>(),
              m_RowStride,
              image.known.data() },
            ranked,
            m_Mask.voxels ? &m_Mask : nullptr,
            m_Fadings.empty() ? nullptr : &m_Fadings[g],
            m_Parameters.localThreshold ? &*m_Parameters.localThreshold : nullptr });
      }
    }
    if (!worker.views.empty())
    {
      m_Kernels->projectBlock(m_Slices, block, worker.views.data(), worker.views.size());
    }
    if (!isTested)
    {
      worker.untestedCubes -= end - n;
      worker.tiles += (rows.gridEnd - rows.gridBegin) * m_TileColumns *
                      ShearWarp::CountBlocks(rows.end - rows.begin, BlockLength) * (end - n);
    }
    n = end;
  }
}

/** Marks, on every grid, the tiles of at most BlockLength slices that may raise a pixel; false if the others are too
 * few to be worth it. */
template <typename TPixel>
bool
ShearWarpProjector<TPixel>::SelectTiles(Worker & worker, const Rows & rows, const ShearWarp::Block & block)
{
  TileCount tiles{ 0, 0 };
  for (std::size_t grid = rows.gridBegin; grid < rows.gridEnd; ++grid)
  {
    const TileCount count =
      m_Mask.voxels ? this->SelectMaskedTiles(worker, grid, block) : this->SelectTiles(worker, grid, block);
    tiles.all += count.all;
    tiles.skipped += count.skipped;
  }
  // memory is faster in one go than in pieces
  const bool isWorthIt =
    m_Mask.voxels || m_ReducedResampling == ReducedResamplingEnum::On || 3 * tiles.skipped > tiles.all;
  worker.tiles += tiles.all;
  worker.skippedTiles += isWorthIt ? tiles.skipped : 0;
  // try again more and more rarely
  worker.untestedCubes = isWorthIt ? 0 : worker.pause;
  worker.pause = isWorthIt ? 0 : std::min<std::ptrdiff_t>(2 * worker.pause + 1, 15);
  return isWorthIt;
}

template <typename TPixel>
template <typename TBeginRow, typename TGetState>
auto
ShearWarpProjector<TPixel>::ForEachTile(Worker &                 worker,
                                        std::size_t              grid,
                                        const ShearWarp::Block & block,
                                        const TBeginRow &        beginRow,
                                        const TGetState &        getState) const -> TileCount
{
  using ShearWarp::BlockLength;
  using ShearWarp::BlockRows;
  using ShearWarp::TileColumns;
  const PlacementList &               placements = m_Placements[grid];
  std::vector<ShearWarp::TileState> & active = worker.active[grid];
  const ShearWarp::SlicePlacement &   first = placements[block.sliceBegin];
  const ShearWarp::SlicePlacement &   last = placements[block.sliceEnd - 1];
  const std::ptrdiff_t                firstColumn = std::min(first.column.whole, last.column.whole);
  const std::ptrdiff_t                lastColumn = std::max(first.column.whole, last.column.whole);
  const std::ptrdiff_t                firstRow = std::min(first.row.whole, last.row.whole);
  const std::ptrdiff_t                lastRow = std::max(first.row.whole, last.row.whole);
  const std::ptrdiff_t                commonRow = ShearWarp::FindFirstRow(block, placements.data(), block.sliceBegin);

  const std::ptrdiff_t blockRows = ShearWarp::CountBlocks(block.rowEnd - block.rowBegin, BlockLength);
  active.assign(blockRows * m_TileColumns, ShearWarp::TileState::Unneeded);
  TileCount tiles{ 0, 0 };
  for (std::ptrdiff_t blockRow = 0; blockRow < blockRows; ++blockRow)
  {
    // a sample needs the row above too; the last row may have the edge's sample
    const std::ptrdiff_t row = block.rowBegin + blockRow * BlockLength;
    const std::ptrdiff_t end = std::min(row + BlockLength, block.rowEnd);
    const bool           isOfImage = block.rowsOf == BlockRows::OfImage;
    const bool           isFirst = row == 0 && !isOfImage;
    const bool           isLast = end == block.rows && !isOfImage;
    ShearWarp::RowSpan   voxels{ row - 1, end };
    ShearWarp::RowSpan   pixels{ row + firstRow, end + lastRow + isLast };
    if (block.rowsOf != BlockRows::OfSlices)
    {
      pixels.begin = isFirst ? pixels.begin : row + commonRow;
      pixels.end = isLast ? pixels.end : end + commonRow;
      voxels = { pixels.begin - lastRow - 1, pixels.end - firstRow };
    }
    const auto findCube = [&](std::ptrdiff_t voxelRow) {
      return std::clamp<std::ptrdiff_t>(voxelRow, 0, block.rows - 1) / BlockLength;
    };
    beginRow(Range{ findCube(voxels.begin), findCube(voxels.end - 1) + 1 });

    const Range tileRows{ pixels.begin / BlockLength, std::min((pixels.end - 1) / BlockLength + 1, m_TileRows) };
    for (std::ptrdiff_t tileColumn = firstColumn / TileColumns; tileColumn < m_TileColumns; ++tileColumn)
    {
      const std::ptrdiff_t columnBegin = std::max<std::ptrdiff_t>(tileColumn * TileColumns - lastColumn - 1, 0);
      const std::ptrdiff_t columnEnd = std::min(tileColumn * TileColumns + TileColumns - firstColumn, m_Slices.columns);
      if (tileColumn * TileColumns > lastColumn + m_Slices.columns)
      {
        break;
      }
      const Range cubeColumns{ std::min(columnBegin, m_Slices.columns - 1) / BlockLength,
                               (std::max<std::ptrdiff_t>(columnEnd, 1) - 1) / BlockLength + 1 };
      const auto  state = getState(tileRows, tileColumn, cubeColumns);
      active[blockRow * m_TileColumns + tileColumn] = state;
      ++tiles.all;
      tiles.skipped += state == ShearWarp::TileState::Unneeded;
    }
  }
  return tiles;
}

template <typename TPixel>
auto
ShearWarpProjector<TPixel>::SelectTiles(Worker & worker, std::size_t grid, const ShearWarp::Block & block) -> TileCount
{
  using ShearWarp::TileState;
  std::vector<TPixel> & columnMaxima = worker.columnMaxima;
  columnMaxima.resize(m_BlockExtrema.columns);
  const TPixel * cubes = m_BlockExtrema.maxima + block.sliceBegin / ShearWarp::BlockLength * m_BlockExtrema.sliceStride;
  const auto     findColumnMaxima = [&](Range cubeRows) {
    for (std::ptrdiff_t column = 0; column < m_BlockExtrema.columns; ++column)
    {
      const TPixel * cube = cubes + column * m_BlockExtrema.columnStride + cubeRows.begin * m_BlockExtrema.rowStride;
      TPixel         maximum = *cube;
      for (std::ptrdiff_t n = cubeRows.begin + 1; n < cubeRows.end; ++n)
      {
        cube += m_BlockExtrema.rowStride;
        maximum = std::max(maximum, *cube);
      }
      columnMaxima[column] = maximum;
    }
  };
  const auto getState = [&](Range tileRows, std::ptrdiff_t tileColumn, Range cubeColumns) {
    const TPixel maximum =
      *std::max_element(columnMaxima.data() + cubeColumns.begin, columnMaxima.data() + cubeColumns.end);
    for (std::ptrdiff_t tileRow = tileRows.begin; tileRow < tileRows.end; ++tileRow)
    {
      if (this->IsAnyBelow(worker.images[grid], tileRow, tileColumn, maximum))
      {
        return TileState::Whole;
      }
    }
    return TileState::Unneeded;
  };
  return this->ForEachTile(worker, grid, block, findColumnMaxima, getState);
}

/** The state of each tile in the mask. */
template <typename TPixel>
auto
ShearWarpProjector<TPixel>::SelectMaskedTiles(Worker & worker, std::size_t grid, const ShearWarp::Block & block) const
  -> TileCount
{
  using ShearWarp::TileState;
  constexpr unsigned int in = 1;
  constexpr unsigned int out = 2;
  auto &                 columnParts = worker.columnParts;
  const auto &           blocks = m_BlocksOfMask;
  const unsigned char    label = m_Mask.label;
  const auto             getParts = [&](std::ptrdiff_t cube) {
    const unsigned char highest = blocks.maxima[cube];
    const unsigned char lowest = blocks.minima[cube];
    const bool          mayBeIn = label == 0 ? highest != 0 : lowest <= label && label <= highest;
    const bool          mayBeOut = label == 0 ? lowest == 0 : lowest != label || highest != label;
    return (mayBeIn ? in : 0) | (mayBeOut ? out : 0);
  };
  const std::ptrdiff_t slice = block.sliceBegin / ShearWarp::BlockLength * blocks.sliceStride;
  const auto           findColumnParts = [&](Range cubeRows) {
    columnParts.assign(blocks.columns, 0);
    for (std::ptrdiff_t row = cubeRows.begin; row < cubeRows.end; ++row)
    {
      for (std::ptrdiff_t column = 0; column < blocks.columns; ++column)
      {
        columnParts[column] |= getParts(slice + row * blocks.rowStride + column * blocks.columnStride);
      }
    }
  };
  const auto getState = [&](Range, std::ptrdiff_t, Range cubeColumns) {
    const unsigned int parts = std::accumulate(
      columnParts.begin() + cubeColumns.begin, columnParts.begin() + cubeColumns.end, 0U, std::bit_or<>());
    return (parts & in) == 0 ? TileState::Unneeded : parts == in ? TileState::Whole : TileState::Masked;
  };
  return this->ForEachTile(worker, grid, block, findColumnParts, getState);
}

/** Pixels only rise, so what was once true of a tile stays so. */
template <typename TPixel>
bool
ShearWarpProjector<TPixel>::IsAnyBelow(PartialImage & image,
                                       std::ptrdiff_t tileRow,
                                       std::ptrdiff_t tileColumn,
                                       TPixel         value) const
{
  TPixel & lowerBound = image.lowerBounds[tileRow * m_TileColumns + tileColumn];
  if (value <= lowerBound)
  {
    return false;
  }
  const TPixel * pixels = image.pixels.template GetPointer<TPixel>() + tileRow * ShearWarp::BlockLength * m_RowStride +
                          tileColumn * ShearWarp::TileColumns;
  if (m_Kernels->isAnyBelow(pixels, m_RowStride, ShearWarp::BlockLength, ShearWarp::TileColumns, value))
  {
    return true;
  }
  lowerBound = value;
  return false;
}

template <typename TPixel>
void
ShearWarpProjector<TPixel>::ReserveRows(PartialImage & image) const
{
  const std::ptrdiff_t rows = m_TileRows * ShearWarp::BlockLength;
  const std::ptrdiff_t pixels = rows * m_RowStride;
  image.pixels.Reserve(pixels * sizeof(TPixel), "an intermediate image");
  image.lowerBounds.assign(m_TileRows * m_TileColumns, ShearWarp::NoSample<TPixel>);
  if (!m_Regions.empty())
  {
    image.marks.Reserve(pixels, "the marks of an intermediate image");
  }
  if (m_Parameters.hasSlices)
  {
    image.ranks.Reserve(pixels * sizeof(RankType), "the slices of an intermediate image");
  }
  if (m_Parameters.isOrdered)
  {
    image.slices.Reserve(pixels * sizeof(std::int32_t), "the slices of an intermediate image");
  }
  image.known.assign(m_Regions.empty() ? 0 : rows, {});
}

/** Makes the image's rows contain [begin, end). */
template <typename TPixel>
void
ShearWarpProjector<TPixel>::ExtendRows(std::size_t    grid,
                                       PartialImage & image,
                                       std::ptrdiff_t begin,
                                       std::ptrdiff_t end) const
{
  using ShearWarp::BlockLength;
  begin = begin / BlockLength * BlockLength;
  end = ShearWarp::CountBlocks(end, BlockLength) * BlockLength;
  if (image.rowBegin == image.rowEnd)
  {
    this->ReserveRows(image);
    image.rowBegin = image.rowEnd = begin;
  }
  if (begin < image.rowBegin)
  {
    this->FillRows(grid, image, begin, image.rowBegin);
    image.rowBegin = begin;
  }
  if (end > image.rowEnd)
  {
    this->FillRows(grid, image, image.rowEnd, end);
    image.rowEnd = end;
  }
}

/** No sample yet; with reduced resampling, where none can come, a maximum that does not keep a tile from being skipped.
 */
template <typename TPixel>
void
ShearWarpProjector<TPixel>::FillRows(std::size_t    grid,
                                     PartialImage & image,
                                     std::ptrdiff_t begin,
                                     std::ptrdiff_t end) const
{
  const bool   isTested = m_Parameters.reducedResampling != ReducedResamplingEnum::Off;
  const TPixel start = this->GetStart(grid);
  const TPixel outside = isTested ? NumericTraits<TPixel>::max() : start;
  for (std::ptrdiff_t row = begin; row < end; ++row)
  {
    TPixel *                    pixels = image.pixels.template GetPointer<TPixel>() + row * m_RowStride;
    const ShearWarp::ColumnSpan span =
      row < m_Grids[grid]->rows ? m_Grids[grid]->reached[row] : ShearWarp::ColumnSpan{ 0, 0 };
    std::fill(pixels, pixels + span.begin, outside);
    std::fill(pixels + span.begin, pixels + span.end, start);
    std::fill(pixels + span.end, pixels + m_RowStride, outside);
    if (!m_Regions.empty())
    {
      std::fill_n(image.marks.template GetPointer<std::uint8_t>() + row * m_RowStride, m_RowStride, std::uint8_t{ 0 });
    }
    if (m_Parameters.hasSlices)
    {
      std::fill_n(this->GetRanks(image, row), m_RowStride, ShearWarp::NoRank<TPixel>);
    }
  }
}

/** Gives the first worker's marks of a row of a grid those of the others, and returns them. */
template <typename TPixel>
const std::uint8_t *
ShearWarpProjector<TPixel>::MergeMarks(std::size_t grid, std::ptrdiff_t row)
{
  std::uint8_t * const result =
    m_Workers.front().images[grid].marks.template GetPointer<std::uint8_t>() + row * m_RowStride;
  for (std::size_t n = 1; n < m_Workers.size(); ++n)
  {
    const PartialImage & image = m_Workers[n].images[grid];
    if (row >= image.rowBegin && row < image.rowEnd)
    {
      const auto * marks = image.marks.template GetPointer<std::uint8_t>() + row * m_RowStride;
      std::transform(marks, marks + m_RowStride, result, result, std::bit_or<>());
    }
  }
  return result;
}

/** Gives the first worker's pixels of a row of a grid the extremum over all, with its ranks, and returns them. */
template <typename TPixel>
TPixel *
ShearWarpProjector<TPixel>::MergeRow(std::size_t grid, std::ptrdiff_t row)
{
  const bool           isMinimum = this->GetExtremum(grid) == ShearWarp::Extremum::Minimum;
  const std::ptrdiff_t columns = m_Grids[grid]->columns;
  PartialImage &       first = m_Workers.front().images[grid];
  TPixel * const       result = first.pixels.template GetPointer<TPixel>() + row * m_RowStride;
  RankType * const     resultRanks = this->GetRanks(first, row);
  for (std::size_t n = 1; n < m_Workers.size(); ++n)
  {
    const PartialImage & image = m_Workers[n].images[grid];
    if (row >= image.rowBegin && row < image.rowEnd)
    {
      const TPixel *   pixels = image.pixels.template GetPointer<TPixel>() + row * m_RowStride;
      const RankType * ranks = this->GetRanks(image, row);
      for (std::ptrdiff_t p = 0; m_Parameters.hasSlices && p < columns; ++p)
      {
        const bool isBetter = isMinimum ? pixels[p] < result[p] : pixels[p] > result[p];
        const bool isNearer = pixels[p] == result[p] && ranks[p] < resultRanks[p];
        resultRanks[p] = isBetter || isNearer ? ranks[p] : resultRanks[p];
      }
      for (std::ptrdiff_t p = 0; p < columns; ++p)
      {
        result[p] = (isMinimum ? pixels[p] < result[p] : pixels[p] > result[p]) ? pixels[p] : result[p];
      }
    }
  }
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    // which of two zeros was first does not matter
    for (std::ptrdiff_t p = 0; p < columns; ++p)
    {
      result[p] += TPixel{ 0 };
    }
  }
  return result;
}

#define INSTANTIATE(TPixel) template class ShearWarpProjector<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk
