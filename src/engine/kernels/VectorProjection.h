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
#ifndef itkShearWarpVectorProjection_h
#define itkShearWarpVectorProjection_h

/* From blocks of the volume to intermediate images. Vector.h includes this header. */

/** \class BlockProjector
 * Projects a few slices of a block into one view. */
template <typename TCollector, typename TPixel>
class BlockProjector
{
public:
  /** More slices would compete for the lines of the first cache. */
  static constexpr int MaximumSlices = BlockLength / 2;
  static_assert(MaximumSlices <= Prefetcher::MaximumStreams, "each of the next slices is a stream");

  /** The view is number \a index of \a count. */
  BlockProjector(const SliceStack<TPixel> &  stack,
                 const Block &               block,
                 const ShearedView<TPixel> & view,
                 std::ptrdiff_t              index,
                 std::ptrdiff_t              count)
    : m_Stack(stack)
    , m_Block(block)
    , m_View(view)
    , m_Index(index)
    , m_Count(count)
  {
    // voxels, or differences of voxels, that a signed integer of 16 bits does not hold
    if constexpr (sizeof(TPixel) == 2)
    {
      m_IsWide = stack.highest - stack.lowest > 32767 || stack.highest > 32767;
    }
  }

  /** Projects \a count slices from \a begin on: at most MaximumSlices, and all of one cube. */
  void
  Project(std::ptrdiff_t begin, std::ptrdiff_t count)
  {
    m_Grid = m_Block.rowBegin + FindFirstRow(m_Block, m_View.placements, begin);
    m_Slice = begin;
    PlacedSlice slices[MaximumSlices];
    for (int n = 0; n < count; ++n)
    {
      slices[n] = this->Place(begin + n);
    }
    for (int first = 0, last = 0; first < count; first = last)
    {
      for (last = first + 1; last < count && slices[last].GetFractions() == slices[first].GetFractions(); ++last)
      {
      }
      this->ProjectTogether(slices + first, last - first, begin + first);
    }
  }

private:
  static constexpr std::int32_t HalfVoxel = 1 << 14;
  /** With more parts, the fetched rows and the pixels do not fit into the first cache. */
  static constexpr std::ptrdiff_t PartsOfSlice = 2;

  PlacedSlice
  Place(std::ptrdiff_t slice) const
  {
    const auto [column, row] = m_View.placements[slice];
    const RowSpan rows = FindRowSamples(m_Block, m_View.placements, slice, m_Stack.rowEnds);
    PlacedSlice   placed;
    placed.offset = slice * m_Stack.sliceStride - row.whole * m_Stack.rowStride - column.whole;
    placed.maskOffset =
      m_View.mask ? slice * m_View.mask->sliceStride - row.whole * m_View.mask->rowStride - column.whole : 0;
    placed.column = column.whole;
    placed.row = row.whole;
    placed.x = column.fraction;
    placed.y = row.fraction;
    placed.inner.rowBegin = row.whole + Larger<std::ptrdiff_t>(rows.begin, row.fraction != 0 || !m_Stack.rowEnds.first);
    placed.inner.rowEnd = row.whole + Smaller(rows.end, m_Stack.rows);
    placed.inner.begin = column.whole + (column.fraction != 0 || !m_Stack.columnEnds.first);
    placed.inner.end = column.whole + m_Stack.columns;
    placed.hasEdgeRow = rows.begin < rows.end && (row.fraction > HalfVoxel ? rows.end > m_Stack.rows : rows.begin == 0);
    return placed;
  }

  /** Projects \a count slices from slice \a index on, whose fractions are zero along the same axes. */
  void
  ProjectTogether(const PlacedSlice * slices, std::ptrdiff_t count, std::ptrdiff_t index) const
  {
    Rectangle common = slices->inner;
    for (std::ptrdiff_t n = 1; n < count; ++n)
    {
      const Rectangle & inner = slices[n].inner;
      common = { Larger(common.rowBegin, inner.rowBegin),
                 Smaller(common.rowEnd, inner.rowEnd),
                 Larger(common.begin, inner.begin),
                 Smaller(common.end, inner.end) };
    }
    const bool areTogether =
      count > 1 && common.rowEnd - common.rowBegin >= BlockLength && common.end - common.begin >= LaneCount<TPixel>;
    if (areTogether)
    {
      this->ProjectRectangle(slices, count, index, common);
    }
    for (std::ptrdiff_t n = 0; n < count; ++n)
    {
      const Rectangle & inner = slices[n].inner;
      const auto        projectRows = [&](std::ptrdiff_t rowBegin, std::ptrdiff_t rowEnd) {
        this->ProjectRectangle(slices + n, 1, index + n, { rowBegin, rowEnd, inner.begin, inner.end });
      };
      projectRows(inner.rowBegin, areTogether ? common.rowBegin : inner.rowEnd);
      projectRows(areTogether ? common.rowEnd : inner.rowEnd, inner.rowEnd);
      this->ProjectEdges(slices[n]);
    }
  }

  /** Projects the outer half voxels, which have the values of the outer voxels. */
  void
  ProjectEdges(const PlacedSlice & slice) const
  {
    const bool           edgeIsLastColumn = slice.x > HalfVoxel;
    const std::ptrdiff_t edge = slice.column + (edgeIsLastColumn ? m_Stack.columns : 0);
    const bool hasColumn = slice.x != 0 && (edgeIsLastColumn ? m_Stack.columnEnds.last : m_Stack.columnEnds.first);
    if (hasColumn && this->IsInRegion({ slice.inner.rowBegin, slice.inner.rowEnd, edge, edge + 1 }))
    {
      for (std::ptrdiff_t row = slice.inner.rowBegin; row < slice.inner.rowEnd; ++row)
      {
        const TileState * active = this->GetActiveTiles(row);
        if (!active || active[edge / TileColumns] != TileState::Unneeded)
        {
          this->TakeEdgeSample(slice, row, edge, edge - edgeIsLastColumn, slice.y);
        }
      }
    }
    const bool edgeIsLastRow = slice.y > HalfVoxel;
    if (slice.y != 0 && slice.hasEdgeRow)
    {
      // the samples of a slice that is one row further on, without a fraction of a row
      PlacedSlice          edgeSlice = slice;
      const std::ptrdiff_t row = slice.row + (edgeIsLastRow ? m_Stack.rows : 0);
      edgeSlice.offset -= edgeIsLastRow ? m_Stack.rowStride : 0;
      edgeSlice.maskOffset -= edgeIsLastRow && m_View.mask ? m_View.mask->rowStride : 0;
      edgeSlice.y = 0;
      this->ProjectRectangle(&edgeSlice, 1, -1, { row, row + 1, slice.inner.begin, slice.inner.end });
      if (hasColumn)
      {
        this->TakeEdgeSample(edgeSlice, row, edge, edge - edgeIsLastColumn, 0);
      }
    }
  }

  /** Returns the states of the tiles that have \a row of the intermediate image, or null. */
  const TileState *
  GetActiveTiles(std::ptrdiff_t row) const
  {
    const std::ptrdiff_t last = m_Block.rowEnd - m_Block.rowBegin - 1;
    const std::ptrdiff_t tile = Smaller(Larger<std::ptrdiff_t>(row - m_Grid, 0), last) / BlockLength;
    return m_View.active ? m_View.active + tile * m_View.activeStride : nullptr;
  }

  /** Gives pixel \a column the sample of the outer voxels, which are at \a voxelColumn. */
  void
  TakeEdgeSample(const PlacedSlice & slice,
                 std::ptrdiff_t      row,
                 std::ptrdiff_t      column,
                 std::ptrdiff_t      voxelColumn,
                 std::int32_t        y) const
  {
    if (m_View.coverage.region)
    {
      ColumnSpan span;
      if (!m_View.coverage.Add(GetColumns(column, column + 1), { row, row + 1 }, m_Slice, &span) ||
          span.begin == span.end)
      {
        return;
      }
    }
    const TPixel * const voxel = m_Stack.voxels + (slice.offset + row * m_Stack.rowStride + voxelColumn);
    if (m_View.ranked.ranks || m_View.mask || m_View.fading)
    {
      return this->TakeCountedEdgeSample(slice, row, column, voxelColumn, voxel, y);
    }
    const TPixel b = *voxel;
    TPixel       sample = b;
    if (y != 0)
    {
      const TPixel a = voxel[-m_Stack.rowStride];
      if constexpr (IsFloat<TPixel>)
      {
        sample = b + static_cast<float>(y) / 32768 * (a - b);
      }
      else
      {
        sample = static_cast<TPixel>((y * a + (32768 - y) * b + (1 << 14)) >> 15);
      }
    }
    TCollector::Take(m_View, row, column, sample, SliceRank<TPixel>{});
  }

  __attribute__((noinline)) void
  TakeCountedEdgeSample(const PlacedSlice & slice,
                        std::ptrdiff_t      row,
                        std::ptrdiff_t      column,
                        std::ptrdiff_t      voxelColumn,
                        const TPixel *      voxel,
                        std::int32_t        y) const
  {
    unsigned int counted = 0b1111U;
    if (m_View.mask)
    {
      const Mask &               mask = *m_View.mask;
      const std::uint8_t * const b = mask.voxels + (slice.maskOffset + row * mask.rowStride + voxelColumn);
      counted = FindCounted(b - (y != 0 ? mask.rowStride : 0), b, mask.label, 0, 0, 0, y);
    }
    if (counted != 0)
    {
      const TPixel * const above = voxel - (y != 0 ? m_Stack.rowStride : 0);
      const TPixel         sample = SampleCounted(above, voxel, 0, 0, 0, y, counted);
      const TPixel         faded = m_View.fading ? FadeInRow(this->FindFading(slice, row), sample, column) : sample;
      TCollector::Take(m_View, row, column, faded, GetRank(m_View.ranked, m_Slice));
    }
  }

  /** Returns how a row of the slice fades. */
  FadingRow<TPixel>
  FindFading(const PlacedSlice & slice, std::ptrdiff_t row) const
  {
    const auto    column = static_cast<std::int32_t>(slice.column);
    const RowSpan samples = FindSamples({ column, slice.x }, m_Stack.columns, m_Stack.columnEnds);
    const auto    reached = GetColumns(column + samples.begin, column + samples.end);
    return m_View.fading->GetRow(row, m_Slice, reached);
  }

  /** Projects samples that \a count slices have in common. \a index is the first slice. */
  void
  ProjectRectangle(const PlacedSlice * slices,
                   std::ptrdiff_t      count,
                   std::ptrdiff_t      index,
                   const Rectangle &   samples) const
  {
    if (samples.rowBegin >= samples.rowEnd || samples.begin >= samples.end || !this->IsInRegion(samples))
    {
      return;
    }
    Prefetcher      prefetcher;
    TileRow<TPixel> tiles;
    tiles.voxels = m_Stack.voxels;
    tiles.rowStride = m_Stack.rowStride;
    tiles.slices = slices;
    tiles.count = count;
    tiles.begin = samples.begin;
    tiles.end = samples.end;
    tiles.extremum = m_View.extremum;
    tiles.pixelStride = m_View.intermediate.rowStride;
    tiles.nextSlice = m_Block.isBackward ? -m_Stack.sliceStride : m_Stack.sliceStride;
    tiles.prefetcher = m_View.active || m_View.coverage.region || !Lanes::HasPrefetch ? nullptr : &prefetcher;
    tiles.rank = GetRank(m_View.ranked, m_Slice);
    tiles.mask = m_View.mask;
    tiles.localThreshold = m_View.localThreshold;
    if (samples.rowEnd - samples.rowBegin >= BlockLength)
    {
      return this->ProjectRowsOfTiles(tiles, prefetcher, index, samples.rowBegin, samples.rowEnd);
    }
    tiles.rows = 1;
    for (std::ptrdiff_t row = samples.rowBegin; row < samples.rowEnd; ++row)
    {
      this->ProjectTilesAt(tiles, row, row);
    }
  }

  /** Projects rows of tiles where the block has rows of cubes. If a slice is one run of memory, the next row of tiles
   * lies a part of the slice further on: then several parts are fetched at the same time. */
  void
  ProjectRowsOfTiles(TileRow<TPixel> & tiles,
                     Prefetcher &      prefetcher,
                     std::ptrdiff_t    index,
                     std::ptrdiff_t    rowBegin,
                     std::ptrdiff_t    rowEnd) const
  {
    const std::ptrdiff_t firstTile = (rowBegin - m_Grid + BlockLength) / BlockLength - 1;
    const std::ptrdiff_t lastTile = (rowEnd - 1 - m_Grid) / BlockLength + 1;
    const bool           isLongRun = m_Stack.sliceStride > m_Stack.rowStride;
    const std::ptrdiff_t streams = isLongRun && tiles.count == 1 ? PartsOfSlice : 1;
    const std::ptrdiff_t length = (lastTile - firstTile + streams - 1) / streams;
    const std::ptrdiff_t steps = (tiles.end - tiles.begin) / LaneCount<TPixel> + 1;
    if (tiles.count > 1)
    {
      this->FetchNextSlices(prefetcher, index + tiles.count, tiles.count, steps * length);
    }
    for (std::ptrdiff_t n = 0; n < length; ++n)
    {
      if (tiles.count == 1 && m_Index == 0 && tiles.prefetcher)
      {
        const bool           isNextSlice = !isLongRun || n + 1 == length;
        const std::ptrdiff_t nextSlice = m_Block.isBackward ? index - isNextSlice : index + isNextSlice;
        const std::ptrdiff_t next = isLongRun ? (n + 1) % length : n;
        prefetcher.ClearStreams();
        for (std::ptrdiff_t tile = firstTile + next; tile < lastTile; tile += length)
        {
          this->AddStream(prefetcher, nextSlice, m_Grid + tile * BlockLength - tiles.slices->row);
        }
        this->StartFetching(prefetcher, BlockLength, steps * streams);
      }
      for (std::ptrdiff_t tile = firstTile + n; tile < lastTile; tile += length)
      {
        const std::ptrdiff_t row = m_Grid + tile * BlockLength;
        if constexpr (TCollector::MayRepeat)
        {
          this->ProjectTilesAt(tiles, row, Smaller(Larger(row, rowBegin), rowEnd - BlockLength));
        }
        else
        {
          const std::ptrdiff_t first = Larger(row, rowBegin);
          tiles.rows = static_cast<int>(Smaller(row + BlockLength, rowEnd) - first);
          this->ProjectTilesAt(tiles, row, first);
        }
      }
    }
  }

  /** Starts to fetch this view's share of \a count slices from \a begin on. */
  void
  FetchNextSlices(Prefetcher & prefetcher, std::ptrdiff_t begin, std::ptrdiff_t count, std::ptrdiff_t steps) const
  {
    const std::ptrdiff_t rows = m_Block.rowEnd - m_Block.rowBegin;
    const std::ptrdiff_t first = rows * m_Index / m_Count;
    for (std::ptrdiff_t slice = begin; slice < begin + count; ++slice)
    {
      this->AddStream(prefetcher, slice, m_Block.rowBegin + first);
    }
    this->StartFetching(prefetcher, rows * (m_Index + 1) / m_Count - first, steps);
  }

  /** Adds rows of a slice from \a row on, or from the nearest row that the slice has. */
  void
  AddStream(Prefetcher & prefetcher, std::ptrdiff_t slice, std::ptrdiff_t row) const
  {
    if (slice >= 0 && slice < m_Stack.slices && m_Stack.rows >= BlockLength)
    {
      row = Smaller(Larger<std::ptrdiff_t>(row, 0), m_Stack.rows - BlockLength);
      prefetcher.AddStream(
        reinterpret_cast<const char *>(m_Stack.voxels + (slice * m_Stack.sliceStride + row * m_Stack.rowStride)));
    }
  }

  void
  StartFetching(Prefetcher & prefetcher, std::ptrdiff_t rows, std::ptrdiff_t steps) const
  {
    constexpr auto bytes = static_cast<std::ptrdiff_t>(sizeof(TPixel));
    prefetcher.Start(m_Stack.rowStride * bytes, rows, m_Stack.columns * bytes, steps);
  }

  /** Projects a row of tiles from \a row on. \a gridRow is in the row of cubes that tells the tiles' states. */
  void
  ProjectTilesAt(TileRow<TPixel> & tiles, std::ptrdiff_t gridRow, std::ptrdiff_t row) const
  {
    tiles.active = this->GetActiveTiles(gridRow);
    tiles.isMoved = row != gridRow;
    tiles.row = row;
    if constexpr (TCollector::MayRepeat)
    {
      tiles.pixels = m_View.intermediate.pixels + row * m_View.intermediate.rowStride;
      tiles.ranks = m_View.ranked.ranks ? m_View.ranked.ranks + row * m_View.intermediate.rowStride : nullptr;
    }
    else
    {
      tiles.sums = GetSums(m_View, row);
      tiles.countSteps = GetCountSteps(m_View, row);
    }
    return m_View.fading ? this->ProjectFadingTiles(tiles) : this->ProjectTilesInRegion(tiles);
  }

  __attribute__((noinline)) void
  ProjectFadingTiles(TileRow<TPixel> tiles) const
  {
    FadingRow<TPixel> fades[BlockLength];
    for (int r = 0; r < tiles.rows; ++r)
    {
      fades[r] = this->FindFading(*tiles.slices, tiles.row + r);
    }
    tiles.fades = fades;
    this->ProjectTilesInRegion(tiles);
  }

  void
  ProjectTilesInRegion(const TileRow<TPixel> & tiles) const
  {
    return m_View.coverage.region ? this->ProjectClippedTiles(tiles) : this->ProjectTiles(tiles);
  }

  /** Projects the columns of each row that are in the region. */
  void
  ProjectClippedTiles(TileRow<TPixel> tiles) const
  {
    const ColumnSpan all = GetColumns(tiles.begin, tiles.end);
    ColumnSpan       spans[BlockLength];
    if (!m_View.coverage.Add(all, { tiles.row, tiles.row + tiles.rows }, m_Slice, spans))
    {
      return;
    }
    ColumnSpan common = all;
    ColumnSpan any{ all.end, all.begin };
    for (int r = 0; r < tiles.rows; ++r)
    {
      common = { Larger(common.begin, spans[r].begin), Smaller(common.end, spans[r].end) };
      const bool isEmpty = spans[r].begin == spans[r].end;
      any = isEmpty ? any : ColumnSpan{ Smaller(any.begin, spans[r].begin), Larger(any.end, spans[r].end) };
    }
    tiles.spans = spans;
    tiles.any = any;
    tiles.common = common;
    this->ProjectTiles(tiles);
  }

  void
  ProjectTiles(const TileRow<TPixel> & tiles) const
  {
    constexpr bool mayBeWide = sizeof(TPixel) == 2;
    return m_IsWide ? ProjectTileRow<TCollector, mayBeWide>(tiles) : ProjectTileRow<TCollector, false>(tiles);
  }

  /** Whether samples of the slice in \a samples may be in the region. */
  bool
  IsInRegion(const Rectangle & samples) const
  {
    const Region * region = m_View.coverage.region;
    return !region ||
           region->MayReach(GetColumns(samples.begin, samples.end), { samples.rowBegin, samples.rowEnd }, m_Slice);
  }

  static ColumnSpan
  GetColumns(std::ptrdiff_t begin, std::ptrdiff_t end)
  {
    return { static_cast<std::int32_t>(begin), static_cast<std::int32_t>(end) };
  }

  const SliceStack<TPixel> &  m_Stack;
  const Block &               m_Block;
  const ShearedView<TPixel> & m_View;
  std::ptrdiff_t              m_Index, m_Count;
  std::ptrdiff_t              m_Grid{ 0 }; // the row of the intermediate image where the block's rows of tiles begin
  std::ptrdiff_t              m_Slice{ 0 };
  bool                        m_IsWide{ false };
};

/** Calls \a project(view, index, begin, length) for the slices of a block, at most \a most at once. All views take the
 * rows of one slice, or of a few slices, while the rows are in the cache. */
template <typename TPixel, typename TFunction>
void
ForEachSlice(const Block &               block,
             const ShearedView<TPixel> * views,
             std::size_t                 count,
             std::ptrdiff_t              most,
             const TFunction &           project)
{
  for (std::ptrdiff_t done = 0, length = 0; done < block.sliceEnd - block.sliceBegin; done += length)
  {
    length = Smaller(most, block.sliceEnd - block.sliceBegin - done);
    const std::ptrdiff_t begin = block.isBackward ? block.sliceEnd - done - length : block.sliceBegin + done;
    for (std::size_t n = 0; n < count; ++n)
    {
      project(views[n], static_cast<std::ptrdiff_t>(n), begin, length);
    }
  }
}

template <typename TPixel>
void
ProjectBlock(const SliceStack<TPixel> &  slices,
             const Block &               block,
             const ShearedView<TPixel> * views,
             std::size_t                 count)
{
  if (slices.columns <= LaneCount<TPixel>)
  {
    return GetPortableKernels<TPixel>().projectBlock(slices, block, views, count);
  }
  using Projector = BlockProjector<ExtremumTiles, TPixel>;
  const bool areTogether =
    block.rowsOf == BlockRows::OfMiddleSlices && !views->active && !views->coverage.region && !views->ranked.ranks;
  const std::ptrdiff_t most = areTogether ? Projector::MaximumSlices : 1;
  const auto           total = static_cast<std::ptrdiff_t>(count);
  ForEachSlice(block, views, count, most, [&](const auto & view, auto index, auto begin, auto length) {
    Projector(slices, block, view, index, total).Project(begin, length);
  });
}

template <typename TPixel>
void
AddBlock(const SliceStack<TPixel> & slices, const Block & block, const ShearedView<TPixel> * views, std::size_t count)
{
  if (slices.columns <= LaneCount<TPixel>)
  {
    return GetPortableKernels<TPixel>().addBlock(slices, block, views, count);
  }
  const auto total = static_cast<std::ptrdiff_t>(count);
  ForEachSlice(block, views, count, 1, [&](const auto & view, auto index, auto begin, auto length) {
    BlockProjector<SumTiles, TPixel>(slices, block, view, index, total).Project(begin, length);
  });
}

template <typename TPixel>
bool
IsAnyBelow(const TPixel * pixels, std::ptrdiff_t rowStride, std::ptrdiff_t rows, std::ptrdiff_t columns, TPixel value)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  const auto               values = Lanes::SetPixel(value);
  for (std::ptrdiff_t j = 0; j < rows; ++j)
  {
    for (std::ptrdiff_t i = 0; i < columns; i += lanes)
    {
      const auto loaded = Lanes::Load(pixels + j * rowStride + i);
      if (!Lanes::AreEqual(Minimum<TPixel>(loaded, values), values))
      {
        return true;
      }
    }
  }
  return false;
}

#endif
