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

/* Slices to intermediate images.
 * See Vector.h for what includes it. */

/** \class Prefetcher
 * Fetches lines of voxels that are soon needed, a few at each step. Lines come from several places in turn, each in
 * the order of its addresses: memory serves a few streams faster than one. */
class Prefetcher
{
public:
  static constexpr int MaximumStreams = 4;

  /** Rows of \a bytes bytes, the lines of all streams within \a steps steps. */
  void
  Start(std::ptrdiff_t stride, std::ptrdiff_t rows, std::ptrdiff_t bytes, std::ptrdiff_t steps)
  {
    m_Stride = stride;
    m_Bytes = bytes;
    m_Lines = rows * ((bytes + Line - 1) / Line) * m_Streams;
    m_Quota = (m_Lines + steps - 1) / steps;
    m_Column = 0;
    m_Stream = 0;
  }

  void
  ClearStreams()
  {
    m_Streams = 0;
    m_Lines = 0;
  }

  void
  AddStream(const char * firstRow)
  {
    m_Rows[m_Streams++] = firstRow;
  }

  void
  Step()
  {
    const std::ptrdiff_t end = Larger<std::ptrdiff_t>(m_Lines - m_Quota, 0);
    for (; m_Lines > end; --m_Lines)
    {
      Lanes::Prefetch(m_Rows[m_Stream] + m_Column);
      if (++m_Stream == m_Streams)
      {
        m_Stream = 0;
        m_Column += Line;
        if (m_Column >= m_Bytes)
        {
          m_Column = 0;
          for (int n = 0; n < m_Streams; ++n)
          {
            m_Rows[n] += m_Stride;
          }
        }
      }
    }
  }

private:
  static constexpr std::ptrdiff_t Line = 64;
  const char *                    m_Rows[MaximumStreams]{};
  std::ptrdiff_t                  m_Stride{ 0 }, m_Bytes{ 0 }, m_Lines{ 0 }, m_Quota{ 0 }, m_Column{ 0 };
  int                             m_Streams{ 0 }, m_Stream{ 0 };
};

/** The lanes of a row's span in the LaneCount pixels from \a column on, as bits. */
template <typename TPixel>
SHEARWARP_INLINE inline std::uint32_t
GetLanes(ColumnSpan span, std::ptrdiff_t column)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  const std::ptrdiff_t     begin = Smaller(Larger<std::ptrdiff_t>(span.begin - column, 0), lanes);
  const std::ptrdiff_t     end = Smaller(Larger<std::ptrdiff_t>(span.end - column, begin), lanes);
  return static_cast<std::uint32_t>((std::uint64_t{ 1 } << end) - (std::uint64_t{ 1 } << begin));
}

/** All lanes, as GetLanes() has them. */
template <typename TPixel>
constexpr auto AllLanes = static_cast<std::uint32_t>((std::uint64_t{ 1 } << LaneCount<TPixel>)-1);

/** Gives VRows rows of LaneCount pixels, from \a column on, the samples of a slice: of each row, if VIsCut, no more
 * than its span. */
template <typename TRule, typename TSampler, int VRows, bool VIsCut = false, typename TPixel>
SHEARWARP_INLINE inline void
TakeSlice(const TileRow<TPixel> & row, const PlacedSlice & slice, std::ptrdiff_t column)
{
  // copies, which no store can change
  const std::ptrdiff_t     stride = row.rowStride;
  const std::ptrdiff_t     pixelStride = row.pixelStride;
  const ColumnSpan * const spans = row.spans;
  TPixel * const           pixels = row.pixels + column;
  const TPixel * const     voxels = row.voxels + (slice.offset + row.row * stride + column);
  TSampler                 sampler(slice, voxels, stride);
  SHEARWARP_UNROLL
  for (int r = 0; r < VRows; ++r)
  {
    TPixel * const pixel = pixels + r * pixelStride;
    const auto     sample = TSampler::Finish(sampler.Next(voxels + r * stride));
    const auto     before = Lanes::Load(pixel);
    const auto     better = Better<TRule, TPixel>(before, sample);
    if constexpr (VIsCut)
    {
      Lanes::Store(pixel, Lanes::Select(before, better, GetLanes<TPixel>(spans[r], column)));
    }
    else
    {
      Lanes::Store(pixel, better);
    }
  }
}

/** LaneCount samples of a row, from \a column on, as they fade. */
template <typename TPixel, typename TVector>
SHEARWARP_INLINE inline TVector
Fade(TVector sample, const FadingRow<TPixel> & fading, std::ptrdiff_t column)
{
  const std::uint32_t lanes = GetLanes<TPixel>(fading.span, column);
  if (lanes == 0)
  {
    return sample;
  }
  const float * const     factors = fading.factors + (column - fading.first);
  const auto              to = static_cast<float>(fading.background);
  const TVector           faded = Lanes::Fade<IsUnsignedShort<TPixel>>(sample, factors, fading.factor, to);
  constexpr std::uint32_t all = AllLanes<TPixel>;
  return lanes == all ? faded : Lanes::Select(sample, faded, lanes);
}

/** Which samples of a tile count, and which voxels around them are in the mask: as bits, of the lanes' columns and of
 * the columns before, of the row above and of the rows. */
template <typename TPixel>
struct CountedSamples
{
  /** Counts all samples in the spans of row.rows rows, from \a column on. */
  void
  CountAll(const TileRow<TPixel> & row, std::ptrdiff_t column)
  {
    for (int r = 0; r < row.rows; ++r)
    {
      counted[r] = row.spans ? GetLanes<TPixel>(row.spans[r], column) : AllLanes<TPixel>;
      whole[r] = counted[r];
    }
  }

  /** Keeps those whose nearest voxel is in the mask. Returns whether there are any. */
  bool
  KeepMasked(const TileRow<TPixel> & row, std::ptrdiff_t column)
  {
    const PlacedSlice &  slice = *row.slices;
    const Mask &         mask = *row.mask;
    const std::uint8_t * voxels = mask.voxels + (slice.maskOffset + row.row * mask.rowStride + column);
    for (int r = slice.y != 0 ? 0 : 1; r <= row.rows; ++r)
    {
      const std::uint8_t * p = voxels + (r - 1) * mask.rowStride;
      at[r] = Lanes::FindLabel<LaneCount<TPixel>>(p, mask.label);
      before[r] = slice.x != 0 ? Lanes::FindLabel<LaneCount<TPixel>>(p - 1, mask.label) : at[r];
    }
    constexpr std::int32_t half = 1 << 14;
    std::uint32_t          any = 0;
    for (int r = 0; r < row.rows; ++r)
    {
      const int             above = slice.y != 0 ? r : r + 1;
      const int             nearest = slice.y > half ? r : r + 1;
      const std::uint32_t * columns = slice.x > half ? before : at;
      counted[r] &= columns[nearest];
      whole[r] = counted[r] & at[r + 1] & before[r + 1] & at[above] & before[above];
      any |= counted[r];
    }
    return any != 0;
  }

  /** The voxels of a lane, as SampleCounted() has them. */
  unsigned int
  GetVoxels(int r, int above, int lane) const
  {
    const auto get = [lane](std::uint32_t bits) { return bits >> lane & 1U; };
    return get(at[r + 1]) | get(before[r + 1]) << 1 | get(at[r + 1 - above]) << 2 | get(before[r + 1 - above]) << 3;
  }

  std::uint32_t at[BlockLength + 1], before[BlockLength + 1]; // set by KeepMasked()
  std::uint32_t counted[BlockLength];                         // samples that count
  std::uint32_t whole[BlockLength];                           // those of them that have all voxels
};

/** Gives a row of pixels, with their ranks, what is better or nearer: all lanes if VAll, or those that are \a taken.
 * Rays end unless \a localThreshold is null. */
template <typename TRule, bool VAll, typename TPixel, typename TVector, typename TRanks>
SHEARWARP_INLINE inline void
TakeRanked(TVector             sample,
           TRanks              rank,
           const TPixel *      localThreshold,
           std::uint32_t       taken,
           TPixel *            pixels,
           SliceRank<TPixel> * ranks)
{
  const auto before = Lanes::Load(pixels);
  const auto rankBefore = Lanes::Load(ranks);
  if (localThreshold)
  {
    sample = Lanes::KeepEnded(rankBefore, before, sample);
  }
  const auto better = Better<TRule, TPixel>(before, sample);
  auto       nearest = Lanes::SelectNearest(before, sample, better, rankBefore, rank);
  if (localThreshold)
  {
    const auto threshold = Lanes::SetPixel(*localThreshold);
    if constexpr (std::is_same_v<TRule, MagnitudeRule<TPixel>>)
    {
      // no magnitude is -1
      const auto of = Lanes::Magnitude(before);
      const auto ofSample = Lanes::Magnitude(sample);
      const auto beyond = Lanes::MaximumMagnitude(of, Lanes::Magnitude(threshold));
      nearest = Lanes::EndRays(
        of, beyond, Lanes::MaximumMagnitude(of, ofSample), ofSample, Lanes::SetPixel(static_cast<TPixel>(-1)), nearest);
    }
    else
    {
      const auto beyond = Better<TRule, TPixel>(before, threshold);
      nearest = Lanes::EndRays(before, beyond, better, sample, Lanes::SetPixel(TRule::Start), nearest);
    }
  }
  if constexpr (VAll)
  {
    Lanes::Store(pixels, better);
    Lanes::Store(ranks, nearest);
  }
  else
  {
    Lanes::Store(pixels, Lanes::Select(before, better, taken));
    Lanes::Store(ranks, Lanes::SelectRanks<IsFloat<TPixel>>(rankBefore, nearest, taken));
  }
}

/** Gives the pixels of a tile, from \a column on, the few samples that count and have not all of
 * their voxels in the mask. */
template <typename TRule, typename TPixel>
__attribute__((noinline)) void
TakeRim(const TileRow<TPixel> & row, std::ptrdiff_t column, const CountedSamples<TPixel> & samples)
{
  const PlacedSlice & slice = *row.slices;
  const int           above = slice.y != 0 ? 1 : 0;
  const int           before = slice.x != 0 ? 1 : 0;
  for (int r = 0; r < row.rows; ++r)
  {
    for (std::uint32_t rest = samples.counted[r] & ~samples.whole[r]; rest != 0; rest &= rest - 1)
    {
      const int            lane = __builtin_ctz(rest);
      const TPixel *       b = row.voxels + (slice.offset + (row.row + r) * row.rowStride + column + lane);
      const std::ptrdiff_t place = r * row.pixelStride + column + lane;
      const TPixel *       a = b - above * row.rowStride;
      const TPixel         mean = SampleCounted(a, b, 0, -before, slice.x, slice.y, samples.GetVoxels(r, above, lane));
      const TPixel         faded = row.fades ? FadeInRow(row.fades[r], mean, column + lane) : mean;
      TakeSample<TRule>(faded, row.rank, row.localThreshold, row.pixels[place], row.ranks + place);
    }
  }
}

/** \class Extras
 * What there is beside ranks, where a tile is taken whole; Any in any tile. */
enum class Extras
{
  None,
  Fading,
  LocalMaximum,
  Any
};

/** Gives the pixels of a tile, from \a column on, the samples of a slice, and its rank: with Extras::Any, of each row
 * those that are \a taken, as bits. */
template <typename TRule, typename TSampler, Extras VExtras, typename TPixel>
SHEARWARP_INLINE inline void
TakeRankedRows(const TileRow<TPixel> & row, std::ptrdiff_t column, const std::uint32_t * taken = nullptr)
{
  constexpr bool hasAny = VExtras == Extras::Any;
  // copies, which no store can change
  const int                       rows = row.rows;
  const std::ptrdiff_t            stride = row.rowStride;
  const std::ptrdiff_t            pixelStride = row.pixelStride;
  const FadingRow<TPixel> * const fades = row.fades;
  const bool                      isFading = VExtras == Extras::Fading || (hasAny && fades);
  const TPixel * const            threshold = hasAny || VExtras == Extras::LocalMaximum ? row.localThreshold : nullptr;
  const auto                      rank = Lanes::SetRank(row.rank);
  TPixel * const                  pixels = row.pixels + column;
  SliceRank<TPixel> * const       ranks = row.ranks + column;
  const TPixel * const            voxels = row.voxels + (row.slices->offset + row.row * stride + column);
  TSampler                        sampler(*row.slices, voxels, stride);
  const auto                      takeRow = [&](int r) SHEARWARP_INLINE {
    const std::uint32_t lanes = hasAny ? taken[r] : AllLanes<TPixel>;
    const auto          sample = TSampler::Finish(sampler.Next(voxels + r * stride));
    const auto          faded = isFading ? Fade<TPixel>(sample, fades[r], column) : sample;
    TakeRanked<TRule, !hasAny>(faded, rank, threshold, lanes, pixels + r * pixelStride, ranks + r * pixelStride);
  };
  if (VExtras == Extras::None && rows == BlockLength)
  {
    SHEARWARP_UNROLL
    for (int r = 0; r < BlockLength; ++r)
    {
      takeRow(r);
    }
  }
  else
  {
    for (int r = 0; r < rows; ++r)
    {
      takeRow(r);
    }
  }
}

/** Gives the tile that begins at \a first, whose pixels are those from \a column on, the samples of a slice, and its
 * rank, with no more extras than it needs. */
template <typename TRule, typename TSampler, typename TPixel>
SHEARWARP_INLINE inline void
TakeRankedTile(const TileRow<TPixel> & row, std::ptrdiff_t first, std::ptrdiff_t column)
{
  const TileState state = row.active ? row.active[first / TileColumns] : TileState::Masked;
  const bool      isMasked = row.mask && (state == TileState::Masked || row.isMoved || column != first);
  if (isMasked || row.IsCut(column) || (row.fades && row.localThreshold))
  {
    CountedSamples<TPixel> samples;
    samples.CountAll(row, column);
    if (!isMasked || samples.KeepMasked(row, column))
    {
      TakeRankedRows<TRule, TSampler, Extras::Any>(row, column, samples.whole);
      TakeRim<TRule>(row, column, samples);
    }
  }
  else if (row.fades)
  {
    TakeRankedRows<TRule, TSampler, Extras::Fading>(row, column);
  }
  else if (row.localThreshold)
  {
    TakeRankedRows<TRule, TSampler, Extras::LocalMaximum>(row, column);
  }
  else
  {
    TakeRankedRows<TRule, TSampler, Extras::None>(row, column);
  }
}

/** The samples of all slices. */
template <typename TRule, typename TSampler, int VRows, typename TPixel>
SHEARWARP_INLINE inline void
TakeSlices(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  constexpr int rows = VRows < TSampler::MaximumRows ? VRows : TSampler::MaximumRows;
  for (int first = 0; first < VRows; first += rows)
  {
    typename TSampler::Sample best[rows];
    SHEARWARP_UNROLL
    for (int r = 0; r < rows; ++r)
    {
      best[r] = TSampler::template GetStart<TRule>();
    }
    for (const PlacedSlice * slice = row.slices; slice != row.slices + row.count; ++slice)
    {
      const TPixel * const voxels = row.voxels + (slice->offset + (row.row + first) * row.rowStride + column);
      TSampler             sampler(*slice, voxels, row.rowStride);
      SHEARWARP_UNROLL
      for (int r = 0; r < rows; ++r)
      {
        const TPixel * const b = voxels + r * row.rowStride;
        // what a tile further on needs, from a slower cache
        Lanes::Prefetch(reinterpret_cast<const char *>(b) + 128);
        best[r] = TSampler::template GetBetter<TRule>(best[r], sampler.Next(b));
      }
    }
    SHEARWARP_UNROLL
    for (int r = 0; r < rows; ++r)
    {
      TPixel * const pixel = row.pixels + (first + r) * row.pixelStride + column;
      Lanes::Store(pixel, Better<TRule, TPixel>(Lanes::Load(pixel), TSampler::Finish(best[r])));
    }
  }
}

template <int VRows, typename TPixel>
void
FetchNextSlice(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  const TPixel * voxels = row.voxels + (row.slices->offset + row.nextSlice + row.row * row.rowStride + column);
  for (int r = 0; r < VRows; ++r, voxels += row.rowStride)
  {
    Lanes::Prefetch(reinterpret_cast<const char *>(voxels - 1));
    Lanes::Prefetch(reinterpret_cast<const char *>(voxels + lanes - 1));
  }
}

/** Calls \a take(first, column) for each tile: it begins at \a first, and its pixels are those from \a column on. */
template <typename TPixel, typename TFunction>
SHEARWARP_INLINE inline void
ForEachTile(const TileRow<TPixel> & row, const TFunction & take)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  const std::ptrdiff_t     begin = row.spans ? row.any.begin : row.begin;
  const std::ptrdiff_t     end = row.spans ? row.any.end : row.end;
  for (std::ptrdiff_t first = begin / lanes * lanes; first < end; first += lanes)
  {
    if (row.active && row.active[first / TileColumns] == TileState::Unneeded)
    {
      continue;
    }
    // the outer tiles overlap their neighbours, which an extremum allows
    const std::ptrdiff_t column = Smaller(Larger(first, row.begin), row.end - lanes);
    if (row.prefetcher)
    {
      row.prefetcher->Step();
    }
    else if (row.rows == 1)
    {
      FetchNextSlice<1>(row, column);
    }
    else
    {
      FetchNextSlice<BlockLength>(row, column);
    }
    take(first, column);
  }
}

template <typename TRule, typename TSampler, int VRows, typename TPixel>
void
ProjectUnrankedTiles(const TileRow<TPixel> & row)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  ForEachTile(row, [&row](std::ptrdiff_t, std::ptrdiff_t column) SHEARWARP_INLINE {
    if (row.IsCut(column))
    {
      TakeSlice<TRule, TSampler, VRows, true>(row, *row.slices, column);
    }
    else if (row.count == 1)
    {
      TakeSlice<TRule, TSampler, VRows>(row, *row.slices, column);
    }
    else
    {
      TakeSlices<TRule, TSampler, VRows>(row, column);
    }
  });
  // what a slice has beside the others
  for (const PlacedSlice * slice = row.slices; row.count > 1 && slice != row.slices + row.count; ++slice)
  {
    if (slice->inner.begin < row.begin)
    {
      TakeSlice<TRule, TSampler, VRows>(row, *slice, slice->inner.begin);
    }
    if (slice->inner.end > row.end)
    {
      TakeSlice<TRule, TSampler, VRows>(row, *slice, slice->inner.end - lanes);
    }
  }
}

template <typename TRule, typename TSampler, typename TPixel>
void
ProjectTileRow(const TileRow<TPixel> & row)
{
  // magnitudes have ranks
  if constexpr (!std::is_same_v<TRule, MagnitudeRule<TPixel>>)
  {
    if (!row.ranks)
    {
      return row.rows == 1 ? ProjectUnrankedTiles<TRule, TSampler, 1>(row)
                           : ProjectUnrankedTiles<TRule, TSampler, BlockLength>(row);
    }
  }
  ForEachTile(row, [&row](std::ptrdiff_t first, std::ptrdiff_t column) SHEARWARP_INLINE {
    TakeRankedTile<TRule, TSampler>(row, first, column);
  });
}

template <typename TRule, bool VWide, typename TPixel>
void
ProjectTileRow(const TileRow<TPixel> & row)
{
  switch (row.slices->GetFractions())
  {
    case Fractions::None:
      return ProjectTileRow<TRule, Sampler<TPixel, Fractions::None, VWide>>(row);
    case Fractions::Column:
      return ProjectTileRow<TRule, Sampler<TPixel, Fractions::Column, VWide>>(row);
    case Fractions::Row:
      return ProjectTileRow<TRule, Sampler<TPixel, Fractions::Row, VWide>>(row);
    default:
      return ProjectTileRow<TRule, Sampler<TPixel, Fractions::Both, VWide>>(row);
  }
}

/** \class BlockProjector
 * Projects a few slices of a block of the volume into one view. */
template <typename TRule, typename TPixel>
class BlockProjector
{
public:
  /** More would compete for the lines of the first cache. */
  static constexpr int MaximumSlices = BlockLength / 2;
  static_assert(MaximumSlices <= Prefetcher::MaximumStreams, "each of the next slices is a stream");

  /** View \a index of \a count. */
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
    // the difference of two voxels, and an unsigned voxel, as 16-bit signed integers
    if constexpr (sizeof(TPixel) == 2)
    {
      m_IsWide = stack.highest - stack.lowest > 32767 || stack.highest > 32767;
    }
  }

  /** \a count slices from \a begin on, at most MaximumSlices of one cube. */
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
      Rectangle common = slices[first].inner;
      for (last = first + 1; last < count && slices[last].GetFractions() == slices[first].GetFractions(); ++last)
      {
        const Rectangle & inner = slices[last].inner;
        common = { Larger(common.rowBegin, inner.rowBegin),
                   Smaller(common.rowEnd, inner.rowEnd),
                   Larger(common.begin, inner.begin),
                   Smaller(common.end, inner.end) };
      }
      const bool areTogether = last - first > 1 && common.rowEnd - common.rowBegin >= BlockLength &&
                               common.end - common.begin >= LaneCount<TPixel>;
      if (areTogether)
      {
        this->ProjectRectangle(slices + first, last - first, begin + first, common);
      }
      for (int n = first; n < last; ++n)
      {
        const Rectangle & inner = slices[n].inner;
        const auto        projectRows = [&](std::ptrdiff_t rowBegin, std::ptrdiff_t rowEnd) {
          this->ProjectRectangle(slices + n, 1, begin + n, { rowBegin, rowEnd, inner.begin, inner.end });
        };
        projectRows(inner.rowBegin, areTogether ? common.rowBegin : inner.rowEnd);
        projectRows(areTogether ? common.rowEnd : inner.rowEnd, inner.rowEnd);
        this->ProjectEdges(slices[n]);
      }
    }
  }

private:
  static constexpr std::int32_t HalfVoxel = 1 << 14;

  PlacedSlice
  Place(std::ptrdiff_t slice) const
  {
    const auto [column, row] = m_View.placements[slice];
    const RowSpan rows = FindRowSamples(m_Block, m_View.placements, slice, m_Stack.rowEnds);
    return { slice * m_Stack.sliceStride - row.whole * m_Stack.rowStride - column.whole,
             m_View.mask ? slice * m_View.mask->sliceStride - row.whole * m_View.mask->rowStride - column.whole : 0,
             column.whole,
             row.whole,
             column.fraction,
             row.fraction,
             { row.whole + Larger<std::ptrdiff_t>(rows.begin, row.fraction != 0 || !m_Stack.rowEnds.first),
               row.whole + Smaller(rows.end, m_Stack.rows),
               column.whole + (column.fraction != 0 || !m_Stack.columnEnds.first),
               column.whole + m_Stack.columns },
             rows.begin < rows.end && (row.fraction > HalfVoxel ? rows.end > m_Stack.rows : rows.begin == 0) };
  }

  /** Half a voxel beyond the outer voxel centers, with the outer voxels' values. */
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
      // as in a slice that lies one row further on and not between rows
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

  /** The flags of the tiles with \a row of the intermediate image. */
  const TileState *
  GetActiveTiles(std::ptrdiff_t row) const
  {
    const std::ptrdiff_t last = m_Block.rowEnd - m_Block.rowBegin - 1;
    const std::ptrdiff_t tile = Smaller(Larger<std::ptrdiff_t>(row - m_Grid, 0), last) / BlockLength;
    return m_View.active ? m_View.active + tile * m_View.activeStride : nullptr;
  }

  /** One sample at the end of a row: of the voxels at \a voxelColumn, but for pixel \a column. */
  void
  TakeEdgeSample(const PlacedSlice & slice,
                 std::ptrdiff_t      row,
                 std::ptrdiff_t      column,
                 std::ptrdiff_t      voxelColumn,
                 std::int32_t        y) const
  {
    if (m_View.coverage.region)
    {
      const ColumnSpan span = m_View.coverage.Add(GetColumns(column, column + 1), row, m_Slice);
      if (span.begin == span.end)
      {
        return;
      }
    }
    const std::ptrdiff_t place = row * m_View.intermediate.rowStride + column;
    const TPixel * const voxel = m_Stack.voxels + (slice.offset + row * m_Stack.rowStride + voxelColumn);
    if (m_View.ranked.ranks)
    {
      return this->TakeRankedEdgeSample(slice, row, column, voxelColumn, voxel, y);
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
    TPixel & pixel = m_View.intermediate.pixels[place];
    pixel = TRule::IsBetter(sample, pixel) ? sample : pixel;
  }

  __attribute__((noinline)) void
  TakeRankedEdgeSample(const PlacedSlice & slice,
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
      const std::ptrdiff_t place = row * m_View.intermediate.rowStride + column;
      const TPixel         sample = SampleCounted(above, voxel, 0, 0, 0, y, counted);
      TakeSample<TRule>(m_View.fading ? FadeInRow(this->FindFading(slice, row), sample, column) : sample,
                        GetRank(m_View.ranked, m_Slice),
                        m_View.localThreshold,
                        m_View.intermediate.pixels[place],
                        m_View.ranked.ranks + place);
    }
  }

  FadingRow<TPixel>
  FindFading(const PlacedSlice & slice, std::ptrdiff_t row) const
  {
    const auto    column = static_cast<std::int32_t>(slice.column);
    const RowSpan samples = FindSamples({ column, slice.x }, m_Stack.columns, m_Stack.columnEnds);
    const auto    reached = GetColumns(column + samples.begin, column + samples.end);
    return m_View.fading->GetRow(row, m_Slice, reached);
  }

  /** Samples that \a count slices have in common; \a index is the first slice. */
  void
  ProjectRectangle(const PlacedSlice * slices,
                   std::ptrdiff_t      count,
                   std::ptrdiff_t      index,
                   const Rectangle &   samples) const
  {
    const auto [rowBegin, rowEnd, begin, end] = samples;
    if (rowBegin >= rowEnd || begin >= end || !this->IsInRegion(samples))
    {
      return;
    }
    Prefetcher      prefetcher;
    TileRow<TPixel> tiles{ m_Stack.voxels,
                           m_Stack.rowStride,
                           slices,
                           count,
                           rowBegin,
                           begin,
                           end,
                           nullptr,
                           m_View.intermediate.rowStride,
                           nullptr,
                           m_Block.isBackward ? -m_Stack.sliceStride : m_Stack.sliceStride,
                           m_View.active || m_View.coverage.region ? nullptr : &prefetcher,
                           GetRank(m_View.ranked, m_Slice),
                           m_View.mask,
                           m_View.localThreshold };
    if (rowEnd - rowBegin < BlockLength)
    {
      tiles.rows = 1;
      for (std::ptrdiff_t row = rowBegin; row < rowEnd; ++row)
      {
        this->ProjectTiles(tiles, row, row);
      }
      return;
    }

    // rows of tiles as those of the block's cubes; where a slice is one run of memory, several places in turn
    const std::ptrdiff_t firstTile = (rowBegin - m_Grid + BlockLength) / BlockLength - 1;
    const std::ptrdiff_t lastTile = (rowEnd - 1 - m_Grid) / BlockLength + 1;
    const bool           isLongRun = m_Stack.sliceStride > m_Stack.rowStride;
    const std::ptrdiff_t streams = isLongRun && count == 1 ? Prefetcher::MaximumStreams : 1;
    const std::ptrdiff_t length = (lastTile - firstTile + streams - 1) / streams;
    const std::ptrdiff_t steps = (end - begin) / LaneCount<TPixel> + 1;
    if (count > 1)
    {
      // each view fetches its share of the next slices
      const std::ptrdiff_t rows = m_Block.rowEnd - m_Block.rowBegin;
      const std::ptrdiff_t first = rows * m_Index / m_Count;
      for (std::ptrdiff_t slice = index + count; slice < index + 2 * count; ++slice)
      {
        this->AddStream(prefetcher, slice, m_Block.rowBegin + first);
      }
      this->StartFetching(prefetcher, rows * (m_Index + 1) / m_Count - first, steps * length);
    }
    for (std::ptrdiff_t n = 0; n < length; ++n)
    {
      if (count == 1 && m_Index == 0 && tiles.prefetcher)
      {
        const bool           isNextSlice = !isLongRun || n + 1 == length;
        const std::ptrdiff_t nextSlice = m_Block.isBackward ? index - isNextSlice : index + isNextSlice;
        const std::ptrdiff_t next = isLongRun ? (n + 1) % length : n;
        prefetcher.ClearStreams();
        for (std::ptrdiff_t tile = firstTile + next; tile < lastTile; tile += length)
        {
          this->AddStream(prefetcher, nextSlice, m_Grid + tile * BlockLength - slices->row);
        }
        this->StartFetching(prefetcher, BlockLength, steps * streams);
      }
      for (std::ptrdiff_t tile = firstTile + n; tile < lastTile; tile += length)
      {
        const std::ptrdiff_t row = m_Grid + tile * BlockLength;
        this->ProjectTiles(tiles, row, Smaller(Larger(row, rowBegin), rowEnd - BlockLength));
      }
    }
  }

  /** The rows of a slice from \a row on, or next to it. */
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

  /** A row of tiles from \a row on; \a gridRow is in the row of cubes that tells whether they are active. */
  void
  ProjectTiles(TileRow<TPixel> & tiles, std::ptrdiff_t gridRow, std::ptrdiff_t row) const
  {
    tiles.active = this->GetActiveTiles(gridRow);
    tiles.isMoved = row != gridRow;
    tiles.row = row;
    tiles.pixels = m_View.intermediate.pixels + row * m_View.intermediate.rowStride;
    tiles.ranks = m_View.ranked.ranks ? m_View.ranked.ranks + row * m_View.intermediate.rowStride : nullptr;
    if (m_View.fading)
    {
      return this->ProjectFading(tiles);
    }
    this->ProjectTiles(tiles);
  }

  __attribute__((noinline)) void
  ProjectFading(TileRow<TPixel> tiles) const
  {
    FadingRow<TPixel> fades[BlockLength];
    for (int r = 0; r < tiles.rows; ++r)
    {
      fades[r] = this->FindFading(*tiles.slices, tiles.row + r);
    }
    tiles.fades = fades;
    this->ProjectTiles(tiles);
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

  /** Those columns of a row of tiles that are in the region. */
  void
  ProjectRegion(TileRow<TPixel> tiles) const
  {
    if (!this->IsInRegion({ tiles.row, tiles.row + tiles.rows, tiles.begin, tiles.end }))
    {
      return;
    }
    const ColumnSpan all = GetColumns(tiles.begin, tiles.end);
    ColumnSpan       spans[BlockLength];
    ColumnSpan       common = all;
    ColumnSpan       any{ all.end, all.begin };
    for (int r = 0; r < tiles.rows; ++r)
    {
      spans[r] = m_View.coverage.Add(all, tiles.row + r, m_Slice);
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
    if (m_View.coverage.region && !tiles.spans)
    {
      return this->ProjectRegion(tiles);
    }
    constexpr bool mayBeWide = sizeof(TPixel) == 2;
    return m_IsWide ? ProjectTileRow<TRule, mayBeWide>(tiles) : ProjectTileRow<TRule, false>(tiles);
  }

  const SliceStack<TPixel> &  m_Stack;
  const Block &               m_Block;
  const ShearedView<TPixel> & m_View;
  std::ptrdiff_t              m_Index, m_Count;
  std::ptrdiff_t              m_Grid{ 0 }; // of the intermediate image, where rows of tiles begin
  std::ptrdiff_t              m_Slice{ 0 };
  bool                        m_IsWide{ false };
};

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
  // all views take a slice's rows, or those of a few slices, while they are in the cache
  const bool areTogether =
    block.rowsOf == BlockRows::OfMiddleSlices && !views->active && !views->coverage.region && !views->ranked.ranks;
  const std::ptrdiff_t most = areTogether ? BlockProjector<MaximumRule<TPixel>, TPixel>::MaximumSlices : 1;
  for (std::ptrdiff_t done = 0, length = 0; done < block.sliceEnd - block.sliceBegin; done += length)
  {
    length = Smaller(most, block.sliceEnd - block.sliceBegin - done);
    const std::ptrdiff_t begin = block.isBackward ? block.sliceEnd - done - length : block.sliceBegin + done;
    for (std::size_t n = 0; n < count; ++n)
    {
      const auto index = static_cast<std::ptrdiff_t>(n);
      const auto total = static_cast<std::ptrdiff_t>(count);
      if (views[n].extremum == Extremum::Minimum)
      {
        BlockProjector<MinimumRule<TPixel>, TPixel>(slices, block, views[n], index, total).Project(begin, length);
      }
      else if (std::is_signed_v<TPixel> && views[n].extremum == Extremum::Magnitude)
      {
        // of unsigned pixels it is the maximum
        using Rule = std::conditional_t<std::is_signed_v<TPixel>, MagnitudeRule<TPixel>, MaximumRule<TPixel>>;
        BlockProjector<Rule, TPixel>(slices, block, views[n], index, total).Project(begin, length);
      }
      else
      {
        BlockProjector<MaximumRule<TPixel>, TPixel>(slices, block, views[n], index, total).Project(begin, length);
      }
    }
  }
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
