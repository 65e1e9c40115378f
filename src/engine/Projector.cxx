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

#include "Values.h"
#include "kernels/PixelTypes.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace itk::ShearWarp
{
template <typename TPixel>
bool
Projector<TPixel>::HasTwoImages(Mode mode)
{
  switch (mode)
  {
    case Mode::Maximum:
    case Mode::Minimum:
    case Mode::Mean:
      return false;
    case Mode::AbsoluteMaximum:
      return std::is_signed_v<TPixel>;
  }
  return false;
}

template <typename TPixel>
Extremum
Projector<TPixel>::GetExtremum(std::size_t image) const
{
  switch (m_Parameters.mode)
  {
    case Mode::Maximum:
    case Mode::Mean:
      return Extremum::Maximum;
    case Mode::Minimum:
      return Extremum::Minimum;
    case Mode::AbsoluteMaximum:
      return image % m_ImagesOfView == 1 ? Extremum::Minimum : Extremum::Maximum;
  }
  return Extremum::Maximum;
}

template <typename TPixel>
TPixel
Projector<TPixel>::GetStart(std::size_t image) const
{
  switch (this->GetExtremum(image))
  {
    case Extremum::Maximum:
      return NoSample<TPixel, Extremum::Maximum>;
    case Extremum::Minimum:
      return NoSample<TPixel, Extremum::Minimum>;
  }
  return {};
}

template <typename TPixel>
void
Projector<TPixel>::Begin(std::vector<ProjectedView> views,
                         unsigned int               axis,
                         const Kernels<TPixel> &    kernels,
                         const Parameters &         parameters,
                         std::size_t                workers)
{
  m_Kernels = &kernels;
  m_Axis = axis;
  m_Parameters = parameters;
  m_NumberOfWorkers = workers;
  m_ImagesOfView = HasTwoImages(parameters.mode) ? 2 : 1;
  m_HasRegion = false;
  m_TileColumns = m_TileRows = 0;
  m_Views.clear();
  for (ProjectedView & view : views)
  {
    m_HasRegion = m_HasRegion || !view.intervals.empty();
    m_TileColumns = std::max(m_TileColumns, CountBlocks(view.grid->columns, TileColumns));
    m_TileRows = std::max(m_TileRows, CountBlocks(view.grid->rows));
    PlacedView placed{ std::move(view), {}, {}, {} };
    placed.region.intervals = placed.view.intervals;
    if (placed.view.fading)
    {
      placed.fading = { *placed.view.fading, placed.view.depth, parameters.background };
    }
    m_Views.push_back(std::move(placed));
  }
  m_RowStride = GetRowStride(m_TileColumns);
  m_HasSums = parameters.mode == Mode::Mean;
  m_MayHaveGaps = MayHaveGaps<TPixel>(parameters.mode, m_HasRegion, parameters.hasRanks);
  m_Parameters.hasRanks = parameters.hasRanks && !m_HasSums;
  if (parameters.mode != Mode::Maximum || m_HasRegion || parameters.hasRanks)
  {
    m_Parameters.reducedResampling = ReducedResampling::Off;
  }

  m_Workers.resize(std::max(m_Workers.size(), workers));
  for (Worker & worker : m_Workers)
  {
    worker.images.resize(this->CountImages());
    worker.active.resize(this->CountImages());
    for (ThreadImage & image : worker.images)
    {
      image.rowBegin = image.rowEnd = 0;
    }
    worker.tiles = worker.skippedTiles = 0;
    worker.untestedCubes = worker.pause = 0;
  }
}

template <typename TPixel>
void
Projector<TPixel>::Project(const PreparedVolume<TPixel> &        volume,
                           const PreparedVolume<unsigned char> * mask,
                           const RunTasks &                      run)
{
  this->SetSlices(volume, mask);
  this->OrderCubes();
  const std::vector<Rows> blocks = this->MakeBlocks();
  const std::ptrdiff_t    blockRows = blocks.front().end - blocks.front().begin;
  const auto              cubes = static_cast<std::ptrdiff_t>(m_Cubes.size());
  const auto              images = static_cast<std::ptrdiff_t>(blocks.front().imageEnd - blocks.front().imageBegin);

  // a step takes milliseconds at most
  constexpr std::ptrdiff_t stepVoxels = 1 << 21;
  constexpr std::ptrdiff_t mostCubes = MostRankedSlices / BlockLength;
  const std::ptrdiff_t     stepCubes =
    std::min(stepVoxels / (images * blockRows * m_Slices.columns * BlockLength) + 1, mostCubes);
  m_RankedCubes = mostCubes / stepCubes * stepCubes;

  const bool                 isOrdered = m_Parameters.isOrdered;
  std::vector<ThreadImage> & shared = m_Workers.front().images;
  const bool                 isFirst = isOrdered && shared.front().rowEnd == 0;
  for (std::size_t n = 0; isFirst && n < shared.size(); ++n)
  {
    this->ReserveRows(shared[n]);
    shared[n].rowEnd = m_TileRows * BlockLength;
  }
  run(blocks.size(),
      static_cast<std::size_t>(CountBlocks(cubes, stepCubes)),
      [&](std::size_t n, std::size_t step, std::size_t worker) {
        const Rows &         rows = blocks[n];
        const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(step) * stepCubes;
        const std::ptrdiff_t last = std::min(first + stepCubes, cubes);
        if (isFirst && first == 0)
        {
          this->FillRows(rows.imageBegin, shared[rows.imageBegin], rows.begin, rows.end);
        }
        this->ProjectRows(m_Workers[worker], rows, first, last);
        if (isOrdered && m_Parameters.hasRanks && (last == cubes || last % m_RankedCubes == 0))
        {
          this->SettleRanks(rows, first);
        }
      });
}

template <typename TPixel>
void
Projector<TPixel>::SetSlices(const PreparedVolume<TPixel> & volume, const PreparedVolume<unsigned char> * mask)
{
  m_Slices = volume.GetSlices(m_Axis);
  m_BlockExtrema = volume.GetBlockExtrema(m_Axis);
  Corner corner = volume.GetCorner(m_Axis);
  if (m_Parameters.isFirstSliceShared)
  {
    m_Slices.voxels += m_Slices.sliceStride;
    --m_Slices.slices;
    ++corner.slice;
  }
  m_FirstSlice = corner.slice;
  m_Mask = {};
  if (mask)
  {
    const auto slices = mask->GetSlices(m_Axis);
    m_Mask = { slices.voxels, slices.rowStride, slices.sliceStride, m_Parameters.maskLabel };
    m_BlocksOfMask = mask->GetBlockExtrema(m_Axis);
  }
  for (PlacedView & placed : m_Views)
  {
    placed.placements = PlacePart(*placed.view.grid, corner, m_Slices.slices);
    placed.region.first = { placed.view.grid->begin.column, placed.view.grid->begin.row, m_FirstSlice };
    if (placed.view.fading)
    {
      placed.fading.SetStack(m_Slices.columns, m_FirstSlice);
    }
  }
  m_HasCommonRows = m_Views.size() > 1 && this->HaveCommonRows();
  m_ReducedResampling = m_BlockExtrema.maxima ? m_Parameters.reducedResampling : ReducedResampling::Off;
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    // an interpolation whose difference overflows can exceed its voxels
    if (!std::isfinite(m_Slices.highest - m_Slices.lowest))
    {
      m_ReducedResampling = ReducedResampling::Off;
    }
  }
}

/** Returns whether each view turns about an axis of the volume. Samples then have two voxels, and several slices are
 * faster together than one after the other. */
template <typename TPixel>
bool
Projector<TPixel>::HaveCommonRows() const
{
  return std::all_of(m_Views.begin(), m_Views.end(), [](const PlacedView & placed) {
    const auto & placements = placed.view.grid->placements;
    const auto   areWhole = [&](SamplingPosition SlicePlacement::* position) {
      return std::all_of(
        placements.begin(), placements.end(), [=](const auto & slice) { return (slice.*position).fraction == 0; });
    };
    return areWhole(&SlicePlacement::column) || areWhole(&SlicePlacement::row);
  });
}

/** Cubes are in the order of storage or, if samples come in order, from the viewer on. With reduced resampling, every
 * eighth cube comes first: then all pixels soon have a value. */
template <typename TPixel>
void
Projector<TPixel>::OrderCubes()
{
  constexpr std::ptrdiff_t seedDistance = 8 * BlockLength;
  const bool               hasSeeds = m_ReducedResampling != ReducedResampling::Off;
  const std::ptrdiff_t     lastCube = (m_Slices.slices - 1) / BlockLength * BlockLength;
  m_Cubes.clear();
  for (const bool isSeed : { true, false })
  {
    for (std::ptrdiff_t slice = 0; slice < m_Slices.slices; slice += BlockLength)
    {
      if (isSeed == (hasSeeds && (slice % seedDistance == 0 || slice == lastCube)))
      {
        m_Cubes.push_back(slice);
      }
    }
  }
  if (m_Parameters.isOrdered && !m_Views.front().view.IsFirstSliceNearest())
  {
    std::reverse(m_Cubes.begin(), m_Cubes.end());
  }
}

/** Where slices lie side by side in memory, a few rows are long runs; else only all rows of a slice are. Several images
 * share the rows of BlockLength slices. If samples come in order, a thread keeps its rows of the image in the cache. */
template <typename TPixel>
auto
Projector<TPixel>::MakeBlocks() const -> std::vector<Rows>
{
  const bool           isOrdered = m_Parameters.isOrdered;
  const std::size_t    images = this->CountImages();
  const std::ptrdiff_t allRows = isOrdered ? m_TileRows * BlockLength : m_Slices.rows;
  const std::ptrdiff_t rowBytes = m_Slices.columns * static_cast<std::ptrdiff_t>(sizeof(TPixel));
  const bool           isLongRun = m_Slices.sliceStride > m_Slices.rowStride;
  const std::ptrdiff_t wanted = images > 1 || isOrdered ? CountBlocks(1 << 16, rowBytes)
                                : isLongRun             ? CountBlocks(1 << 18, rowBytes)
                                : m_HasRegion           ? 8 * BlockLength
                                                        : 2 * BlockLength;
  const std::ptrdiff_t fairShare = CountBlocks(allRows, 2 * static_cast<std::ptrdiff_t>(m_NumberOfWorkers));
  const std::ptrdiff_t blockRows = CountBlocks(std::min(wanted, fairShare)) * BlockLength;
  std::vector<Rows>    blocks;
  for (std::size_t image = 0; image < (isOrdered ? images : 1); ++image)
  {
    for (std::ptrdiff_t row = 0; row < allRows; row += blockRows)
    {
      blocks.push_back({ row, std::min(row + blockRows, allRows), image, isOrdered ? image + 1 : images });
    }
  }
  return blocks;
}

/** Projects elements [first, last) of m_Cubes. */
template <typename TPixel>
void
Projector<TPixel>::ProjectRows(Worker & worker, const Rows & rows, std::ptrdiff_t first, std::ptrdiff_t last)
{
  const bool      isOrdered = m_Parameters.isOrdered;
  const BlockRows rowsOf = isOrdered         ? BlockRows::OfImage
                           : m_HasCommonRows ? BlockRows::OfMiddleSlices
                                             : BlockRows::OfSlices;
  const bool      isBackward = isOrdered && !m_Views.front().view.IsFirstSliceNearest();
  for (std::ptrdiff_t n = first, end = first; n < last; n = end)
  {
    const bool isTested = m_Mask.voxels || (m_ReducedResampling != ReducedResampling::Off && worker.untestedCubes == 0);
    end = this->FindCubesTogether(worker, n, last, isTested);
    const std::ptrdiff_t sliceEnd = std::min(m_Cubes[end - 1] + BlockLength, m_Slices.slices);
    const Block          block{ rows.begin, rows.end, m_Cubes[n], sliceEnd, m_Slices.rows, rowsOf, isBackward };
    if (!isOrdered)
    {
      this->ExtendImages(worker, rows, block);
    }
    const bool areSelected = isTested && this->SelectTiles(worker, rows, block);
    worker.views.clear();
    for (std::size_t image = rows.imageBegin; image < rows.imageEnd; ++image)
    {
      const auto & active = worker.active[image];
      const auto   isNeeded = [](TileState state) { return state != TileState::Unneeded; };
      if (!areSelected || std::any_of(active.begin(), active.end(), isNeeded))
      {
        worker.views.push_back(this->MakeShearedView(worker, image, areSelected, first));
      }
    }
    if (!worker.views.empty())
    {
      const auto project = m_HasSums ? m_Kernels->addBlock : m_Kernels->projectBlock;
      project(m_Slices, block, worker.views.data(), worker.views.size());
    }
    if (!isTested)
    {
      worker.untestedCubes -= end - n;
      worker.tiles +=
        (rows.imageEnd - rows.imageBegin) * m_TileColumns * CountBlocks(rows.end - rows.begin) * (end - n);
    }
  }
}

/** Returns the end of the cubes that are projected at once: one cube, or as many as follow each other untested. */
template <typename TPixel>
std::ptrdiff_t
Projector<TPixel>::FindCubesTogether(const Worker & worker,
                                     std::ptrdiff_t first,
                                     std::ptrdiff_t last,
                                     bool           isTested) const
{
  std::ptrdiff_t end = first + 1;
  while (!isTested && end < last && m_Cubes[end] == m_Cubes[end - 1] + BlockLength &&
         (m_ReducedResampling == ReducedResampling::Off || end - first < worker.untestedCubes))
  {
    ++end;
  }
  return end;
}

/** Makes the worker's images have all rows that the block reaches. */
template <typename TPixel>
void
Projector<TPixel>::ExtendImages(Worker & worker, const Rows & rows, const Block & block) const
{
  for (std::size_t image = rows.imageBegin; image < rows.imageEnd; ++image)
  {
    // offsets are monotonic in the slice
    const auto &       placements = this->GetView(image).placements;
    const std::int32_t first = placements[block.sliceBegin].row.whole;
    const std::int32_t last = placements[block.sliceEnd - 1].row.whole;
    this->ExtendRows(image,
                     worker.images[image],
                     rows.begin + std::min(first, last),
                     std::min(rows.end + std::max(first, last) + 1, this->GetGrid(image).rows));
  }
}

template <typename TPixel>
ShearedView<TPixel>
Projector<TPixel>::MakeShearedView(Worker & worker, std::size_t image, bool areSelected, std::ptrdiff_t cube)
{
  const PlacedView &       placed = this->GetView(image);
  const IntermediateGrid & grid = *placed.view.grid;
  ThreadImage &            target = this->GetImages(worker)[image];
  const Ranking       ranking = m_Parameters.isOrdered ? this->GetRankingOfCube(cube) : this->GetRanking(placed.view);
  ShearedView<TPixel> view;
  view.placements = placed.placements.data();
  view.intermediate.pixels = target.pixels.template GetPointer<TPixel>();
  view.intermediate.columns = grid.columns;
  view.intermediate.rows = grid.rows;
  view.intermediate.rowStride = m_RowStride;
  view.intermediate.reached = grid.reached.data();
  view.active = areSelected ? worker.active[image].data() : nullptr;
  view.activeStride = m_TileColumns;
  view.extremum = this->GetExtremum(image);
  view.coverage.region = m_HasRegion ? &placed.region : nullptr;
  if (m_HasRegion && !m_HasSums)
  {
    view.coverage.marks = target.marks.template GetPointer<std::uint8_t>();
    view.coverage.rowStride = m_RowStride;
    view.coverage.known = target.known.data();
  }
  view.summed = m_HasSums ? this->GetSummed(target) : SummedImage<TPixel>{};
  view.ranked.ranks = this->GetRanks(target, 0);
  view.ranked.first = ranking.GetRank(static_cast<std::int32_t>(m_FirstSlice));
  view.ranked.step = ranking.step;
  view.mask = m_Mask.voxels ? &m_Mask : nullptr;
  view.fading = placed.view.fading ? &placed.fading : nullptr;
  view.localThreshold = m_Parameters.localThreshold ? &*m_Parameters.localThreshold : nullptr;
  return view;
}

/** The ranks of all slices of the volume. */
template <typename TPixel>
Ranking
Projector<TPixel>::GetRanking(const ProjectedView & view) const
{
  const auto last =
    static_cast<std::int32_t>(view.grid->begin.slice) + static_cast<std::int32_t>(view.grid->placements.size()) - 1;
  const auto first = static_cast<std::int32_t>(view.grid->begin.slice);
  return view.IsFirstSliceNearest() ? Ranking{ first, 1 } : Ranking{ last, -1 };
}

/** The ranks that begin anew with the cubes around an element of m_Cubes. */
template <typename TPixel>
Ranking
Projector<TPixel>::GetRankingOfCube(std::ptrdiff_t cube) const
{
  const bool           isFirstNearest = m_Views.front().view.IsFirstSliceNearest();
  const std::ptrdiff_t first = m_Cubes[cube / m_RankedCubes * m_RankedCubes];
  const std::ptrdiff_t nearest = isFirstNearest ? first : std::min(first + BlockLength, m_Slices.slices) - 1;
  return { static_cast<std::int32_t>(m_FirstSlice + nearest), isFirstNearest ? 1 : -1 };
}

/** Notes the ranks of pixels, which count from the cubes around an element of m_Cubes on, as ranks of the whole volume.
 * The ranks then become 0: nearer than all that follow. */
template <typename TPixel>
void
Projector<TPixel>::SettleRanks(const Rows & rows, std::ptrdiff_t cube)
{
  const Ranking       all = this->GetRanking(m_Views.front().view);
  const std::int32_t  before = all.GetRank(this->GetRankingOfCube(cube).first) - 1;
  const ThreadImage & image = m_Workers.front().images[rows.imageBegin];
  RankType * const    ranks = this->GetRanks(image, 0);
  auto * const        settled = image.settledRanks.template GetPointer<std::int32_t>();
  for (std::ptrdiff_t p = rows.begin * m_RowStride; p < rows.end * m_RowStride; ++p)
  {
    const auto rank = static_cast<RankType>(ranks[p] & NoRank<TPixel>);
    if (rank != 0 && rank != NoRank<TPixel>)
    {
      settled[p] = before + rank;
      ranks[p] = static_cast<RankType>(ranks[p] - rank);
    }
  }
}

template <typename TPixel>
void
Projector<TPixel>::ReserveRows(ThreadImage & image) const
{
  const std::ptrdiff_t rows = m_TileRows * BlockLength;
  const std::ptrdiff_t pixels = rows * m_RowStride;
  if (m_HasSums)
  {
    image.sums.Reserve(pixels * sizeof(SampleSum<TPixel>), "the sums of an intermediate image");
    image.countSteps.Reserve((pixels + rows) * sizeof(std::uint32_t), "the counts of an intermediate image");
    return;
  }
  image.pixels.Reserve(pixels * sizeof(TPixel), "an intermediate image");
  image.lowerBounds.assign(m_TileRows * m_TileColumns, NoSample<TPixel>);
  if (m_HasRegion)
  {
    image.marks.Reserve(pixels, "the marks of an intermediate image");
  }
  if (m_Parameters.hasRanks)
  {
    image.ranks.Reserve(pixels * sizeof(RankType), "the ranks of an intermediate image");
  }
  if (m_Parameters.hasRanks && m_Parameters.isOrdered)
  {
    image.settledRanks.Reserve(pixels * sizeof(std::int32_t), "the ranks of an intermediate image");
  }
  image.known.assign(m_HasRegion ? rows : 0, {});
}

/** Makes the rows of an image contain [begin, end). */
template <typename TPixel>
void
Projector<TPixel>::ExtendRows(std::size_t n, ThreadImage & image, std::ptrdiff_t begin, std::ptrdiff_t end) const
{
  begin = begin / BlockLength * BlockLength;
  end = CountBlocks(end) * BlockLength;
  if (image.rowBegin == image.rowEnd)
  {
    this->ReserveRows(image);
    image.rowBegin = image.rowEnd = begin;
  }
  if (begin < image.rowBegin)
  {
    this->FillRows(n, image, begin, image.rowBegin);
    image.rowBegin = begin;
  }
  if (end > image.rowEnd)
  {
    this->FillRows(n, image, image.rowEnd, end);
    image.rowEnd = end;
  }
}

/** Gives pixels the value of no sample. With reduced resampling, pixels that no slice reaches get the largest number,
 * so that they do not keep a tile from being skipped. */
template <typename TPixel>
void
Projector<TPixel>::FillRows(std::size_t n, ThreadImage & image, std::ptrdiff_t begin, std::ptrdiff_t end) const
{
  if (m_HasSums)
  {
    const auto [sums, countSteps] = this->GetSummed(image);
    std::fill(sums + begin * m_RowStride, sums + end * m_RowStride, SampleSum<TPixel>{});
    std::fill(countSteps + begin * (m_RowStride + 1), countSteps + end * (m_RowStride + 1), std::uint32_t{ 0 });
    return;
  }
  const IntermediateGrid & grid = this->GetGrid(n);
  const bool               isTested = m_Parameters.reducedResampling != ReducedResampling::Off;
  const TPixel             start = this->GetStart(n);
  const TPixel             outside = isTested ? std::numeric_limits<TPixel>::max() : start;
  for (std::ptrdiff_t row = begin; row < end; ++row)
  {
    TPixel *         pixels = image.pixels.template GetPointer<TPixel>() + row * m_RowStride;
    const ColumnSpan span = row < grid.rows ? grid.reached[row] : ColumnSpan{ 0, 0 };
    std::fill(pixels, pixels + span.begin, outside);
    std::fill(pixels + span.begin, pixels + span.end, start);
    std::fill(pixels + span.end, pixels + m_RowStride, outside);
    if (m_HasRegion)
    {
      std::fill_n(image.marks.template GetPointer<std::uint8_t>() + row * m_RowStride, m_RowStride, std::uint8_t{ 0 });
    }
    if (m_Parameters.hasRanks)
    {
      std::fill_n(this->GetRanks(image, row), m_RowStride, NoRank<TPixel>);
    }
  }
}

template <typename TPixel>
double
Projector<TPixel>::GetSkippedFraction() const
{
  std::size_t tiles = 0;
  std::size_t skipped = 0;
  for (const Worker & worker : m_Workers)
  {
    tiles += worker.tiles;
    skipped += worker.skippedTiles;
  }
  return tiles == 0 ? 0.0 : static_cast<double>(skipped) / static_cast<double>(tiles);
}

template <typename TPixel>
std::size_t
Projector<TPixel>::GetSizeInBytes() const
{
  std::size_t bytes = m_Ranks.GetSizeInBytes() + m_Means.GetSizeInBytes() + CountBytes(m_Reached) +
                      CountBytes(m_Cubes) + CountBytes(m_Views);
  for (const auto & [view, region, fading, placements] : m_Views)
  {
    bytes +=
      CountBytes(view.intervals) + CountBytes(region.intervals) + CountBytes(fading.factors) + CountBytes(placements);
  }
  for (const Worker & worker : m_Workers)
  {
    bytes += CountBytes(worker.images) + CountBytes(worker.views) + CountBytes(worker.columnMaxima) +
             CountBytes(worker.columnParts);
    for (const ThreadImage & image : worker.images)
    {
      bytes += image.pixels.GetSizeInBytes() + image.marks.GetSizeInBytes() + image.ranks.GetSizeInBytes() +
               image.settledRanks.GetSizeInBytes() + image.sums.GetSizeInBytes() + image.countSteps.GetSizeInBytes() +
               CountBytes(image.known) + CountBytes(image.lowerBounds);
    }
    for (const auto & active : worker.active)
    {
      bytes += CountBytes(active);
    }
  }
  return bytes;
}

template <typename TPixel>
std::size_t
Projector<TPixel>::GetViewSizeInBytes(std::ptrdiff_t columns,
                                      std::ptrdiff_t rows,
                                      Mode           mode,
                                      bool           hasRegion,
                                      bool           hasRanks)
{
  const std::ptrdiff_t pixels =
    GetRowStride(CountBlocks(columns, TileColumns)) * BlockLength * CountBlocks(rows, BlockLength);
  if (mode == Mode::Mean)
  {
    return static_cast<std::size_t>(pixels) * (sizeof(SampleSum<TPixel>) + sizeof(std::uint32_t));
  }
  return static_cast<std::size_t>(pixels) * (HasTwoImages(mode) ? 2 : 1) *
         (sizeof(TPixel) + (hasRegion ? 1 : 0) + (hasRanks ? sizeof(RankType) : 0));
}

#define INSTANTIATE(TPixel) template class Projector<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk::ShearWarp
