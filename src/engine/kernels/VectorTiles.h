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
#ifndef itkShearWarpVectorTiles_h
#define itkShearWarpVectorTiles_h

/* From slices to tiles of the intermediate image. Vector.h includes this header. */

/** \class Prefetcher
 * Fetches voxels before they are needed: a few lines of the cache at each step. Lines come from several streams in
 * turn, because memory serves a few streams faster than one. A stream has its lines in the order of their addresses. */
class Prefetcher
{
public:
  static constexpr int MaximumStreams = 4;

  /** Each stream has \a rows rows of \a bytes bytes. The prefetcher fetches all lines in \a steps steps. */
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

/** Returns a bit for each of the LaneCount pixels from \a column on that is in the span. */
template <typename TPixel>
SHEARWARP_INLINE inline std::uint32_t
GetLanes(ColumnSpan span, std::ptrdiff_t column)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  const std::ptrdiff_t     begin = Smaller(Larger<std::ptrdiff_t>(span.begin - column, 0), lanes);
  const std::ptrdiff_t     end = Smaller(Larger<std::ptrdiff_t>(span.end - column, begin), lanes);
  return static_cast<std::uint32_t>((std::uint64_t{ 1 } << end) - (std::uint64_t{ 1 } << begin));
}

/** The bits of all lanes. */
template <typename TPixel>
constexpr auto AllLanes = static_cast<std::uint32_t>((std::uint64_t{ 1 } << LaneCount<TPixel>)-1);

/** Gives the pixels of a tile the samples of a slice. The tile has BlockLength rows of LaneCount pixels, from \a column
 * on. */
template <Extremum VExtremum, typename TSampler, typename TPixel>
SHEARWARP_INLINE inline void
TakeSlice(const TileRow<TPixel> & row, const PlacedSlice & slice, std::ptrdiff_t column)
{
  // stores of pixels cannot change copies
  const std::ptrdiff_t stride = row.rowStride;
  const std::ptrdiff_t pixelStride = row.pixelStride;
  TPixel * const       pixels = row.pixels + column;
  const TPixel * const voxels = row.voxels + (slice.offset + row.row * stride + column);
  TSampler             sampler(slice, voxels, stride);
  SHEARWARP_UNROLL
  for (int r = 0; r < BlockLength; ++r)
  {
    TPixel * const pixel = pixels + r * pixelStride;
    const auto     sample = TSampler::Finish(sampler.Next(voxels + r * stride));
    Lanes::Store(pixel, Better<VExtremum, TPixel>(Lanes::Load(pixel), sample));
  }
}

/** Writes the samples of a slice for a tile, a vector for each row. What tiles need seldom is done with these vectors,
 * so that it is compiled once for all samplers. */
template <typename TSampler, typename TPixel>
__attribute__((noinline)) void
SampleTile(const TileRow<TPixel> & row,
           const PlacedSlice &     slice,
           std::ptrdiff_t          column,
           LanesOf<TPixel> (&samples)[BlockLength])
{
  const std::ptrdiff_t stride = row.rowStride;
  const TPixel * const voxels = row.voxels + (slice.offset + row.row * stride + column);
  TSampler             sampler(slice, voxels, stride);
  for (int r = 0; r < row.rows; ++r)
  {
    samples[r] = TSampler::Finish(sampler.Next(voxels + r * stride));
  }
}

/** Gives the pixels of a tile samples. If the row has spans, only pixels in them take samples. */
template <Extremum VExtremum, typename TPixel>
__attribute__((noinline)) void
TakeSamples(const TileRow<TPixel> & row, std::ptrdiff_t column, const LanesOf<TPixel> (&samples)[BlockLength])
{
  for (int r = 0; r < row.rows; ++r)
  {
    TPixel * const      pixel = row.pixels + r * row.pixelStride + column;
    const std::uint32_t lanes = row.spans ? GetLanes<TPixel>(row.spans[r], column) : AllLanes<TPixel>;
    const auto          before = Lanes::Load(pixel);
    Lanes::Store(pixel, Lanes::Select(before, Better<VExtremum, TPixel>(before, samples[r]), lanes));
  }
}

/** Returns LaneCount samples of a row, from \a column on, as they fade. */
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

/** Which samples of a tile count, and which voxels around the samples are in the mask. Each element has the bits of one
 * row's lanes. */
template <typename TPixel>
struct CountedSamples
{
  /** Counts the samples that have a bit in \a lanes and are in the spans and, if \a isMasked, in the mask. Returns
   * whether there may be one. */
  __attribute__((noinline)) bool
  Count(const TileRow<TPixel> & row, std::ptrdiff_t column, std::uint32_t lanes, bool isMasked)
  {
    for (int r = 0; r < row.rows; ++r)
    {
      counted[r] = row.spans ? GetLanes<TPixel>(row.spans[r], column) & lanes : lanes;
      whole[r] = counted[r];
    }
    return !isMasked || this->KeepMasked(row, column);
  }

  /** Keeps samples whose nearest voxel is in the mask. Returns whether a sample is left. */
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

  /** Returns which voxels of a lane are in the mask, as bits in the order of SampleCounted(). */
  unsigned int
  GetVoxels(int r, int above, int lane) const
  {
    const auto get = [lane](std::uint32_t bits) { return bits >> lane & 1U; };
    return get(at[r + 1]) | get(before[r + 1]) << 1 | get(at[r + 1 - above]) << 2 | get(before[r + 1 - above]) << 3;
  }

  // set by KeepMasked(), from the row above the tile on: voxels at the lanes' columns, and one column before
  std::uint32_t at[BlockLength + 1], before[BlockLength + 1];
  std::uint32_t counted[BlockLength]; // samples that count
  std::uint32_t whole[BlockLength];   // samples that count and have all voxels in the mask
};

/** Gives LaneCount pixels a sample each that is better, or equal and of a lower rank. Unless VAll, only pixels with a
 * bit in \a taken take samples. If \a localThreshold is not null, rays end at their first local maximum. */
template <Extremum VExtremum, bool VAll, typename TPixel, typename TVector, typename TRanks>
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
  const auto better = Better<VExtremum, TPixel>(before, sample);
  auto       lowest = Lanes::SelectLowestRank(before, sample, better, rankBefore, rank);
  if (localThreshold)
  {
    const auto beyond = Better<VExtremum, TPixel>(before, Lanes::SetPixel(*localThreshold));
    const auto none = Lanes::SetPixel(NoSample<TPixel, VExtremum>);
    lowest = Lanes::EndRays(before, beyond, better, sample, none, lowest);
  }
  if constexpr (VAll)
  {
    Lanes::Store(pixels, better);
    Lanes::Store(ranks, lowest);
  }
  else
  {
    Lanes::Store(pixels, Lanes::Select(before, better, taken));
    Lanes::Store(ranks, Lanes::Select(rankBefore, lowest, taken));
  }
}

/** Calls \a take(r, column, sample) for the samples at the rim of the mask, which count but have a voxel outside. */
template <typename TPixel, typename TTake>
void
ForEachRimSample(const TileRow<TPixel> &        row,
                 std::ptrdiff_t                 column,
                 const CountedSamples<TPixel> & samples,
                 const TTake &                  take)
{
  const PlacedSlice & slice = *row.slices;
  const int           above = slice.y != 0 ? 1 : 0;
  const int           before = slice.x != 0 ? 1 : 0;
  for (int r = 0; r < row.rows; ++r)
  {
    for (std::uint32_t rest = samples.counted[r] & ~samples.whole[r]; rest != 0; rest &= rest - 1)
    {
      const int      lane = __builtin_ctz(rest);
      const TPixel * b = row.voxels + (slice.offset + (row.row + r) * row.rowStride + column + lane);
      const TPixel * a = b - above * row.rowStride;
      const TPixel   mean = SampleCounted(a, b, 0, -before, slice.x, slice.y, samples.GetVoxels(r, above, lane));
      take(r, column + lane, row.fades ? FadeInRow(row.fades[r], mean, column + lane) : mean);
    }
  }
}

/** Gives the pixels of a tile samples of a slice, and its rank. If VAll, each sample counts, and fades. */
template <Extremum VExtremum, bool VAll, typename TPixel>
SHEARWARP_INLINE inline void
TakeRankedRows(const TileRow<TPixel> & row,
               std::ptrdiff_t          column,
               const LanesOf<TPixel> (&samples)[BlockLength],
               const CountedSamples<TPixel> & counted)
{
  // stores of pixels cannot change copies
  const int                       rows = row.rows;
  const std::ptrdiff_t            pixelStride = row.pixelStride;
  const FadingRow<TPixel> * const fades = row.fades;
  const TPixel * const            threshold = VAll ? nullptr : row.localThreshold;
  const auto                      rank = Lanes::SetRank(row.rank);
  TPixel * const                  pixels = row.pixels + column;
  SliceRank<TPixel> * const       ranks = row.ranks + column;
  for (int r = 0; r < rows; ++r)
  {
    const auto faded = VAll || fades ? Fade<TPixel>(samples[r], fades[r], column) : samples[r];
    TakeRanked<VExtremum, VAll>(
      faded, rank, threshold, counted.whole[r], pixels + r * pixelStride, ranks + r * pixelStride);
  }
}

/** Gives the pixels of a tile the samples that count, and the slice's rank. */
template <Extremum VExtremum, typename TPixel>
__attribute__((noinline)) void
TakeRankedSamples(const TileRow<TPixel> & row,
                  std::ptrdiff_t          column,
                  const LanesOf<TPixel> (&samples)[BlockLength],
                  const CountedSamples<TPixel> & counted,
                  bool                           areAll)
{
  if (areAll && row.fades && !row.localThreshold)
  {
    return TakeRankedRows<VExtremum, true>(row, column, samples, counted);
  }
  TakeRankedRows<VExtremum, false>(row, column, samples, counted);
  ForEachRimSample(row, column, counted, [&row](int r, std::ptrdiff_t p, TPixel sample) {
    const std::ptrdiff_t place = r * row.pixelStride + p;
    TakeSample<VExtremum>(sample, row.rank, row.localThreshold, row.pixels[place], row.ranks + place);
  });
}

/** Gives the pixels of a tile the samples of a slice, and its rank. If VIsLocal, rays end at their first local maximum.
 */
template <Extremum VExtremum, typename TSampler, bool VIsLocal, typename TPixel>
SHEARWARP_INLINE inline void
TakeRankedSlice(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  // stores of pixels cannot change copies
  const std::ptrdiff_t      stride = row.rowStride;
  const std::ptrdiff_t      pixelStride = row.pixelStride;
  const TPixel * const      threshold = VIsLocal ? row.localThreshold : nullptr;
  const auto                rank = Lanes::SetRank(row.rank);
  TPixel * const            pixels = row.pixels + column;
  SliceRank<TPixel> * const ranks = row.ranks + column;
  const TPixel * const      voxels = row.voxels + (row.slices->offset + row.row * stride + column);
  TSampler                  sampler(*row.slices, voxels, stride);
  const auto                takeRow = [&](int r) SHEARWARP_INLINE {
    const auto sample = TSampler::Finish(sampler.Next(voxels + r * stride));
    TakeRanked<VExtremum, true>(sample, rank, threshold, 0, pixels + r * pixelStride, ranks + r * pixelStride);
  };
  SHEARWARP_UNROLL
  for (int r = 0; r < BlockLength && !VIsLocal; ++r)
  {
    takeRow(r);
  }
  const int rows = row.rows;
  for (int r = 0; r < rows && VIsLocal; ++r)
  {
    takeRow(r);
  }
}

/** Gives a tile the samples of a slice, and its rank. \a first tells the tile's state; see ForEachTile(). */
template <Extremum VExtremum, typename TSampler, typename TPixel>
SHEARWARP_INLINE inline void
TakeRankedTile(const TileRow<TPixel> & row, std::ptrdiff_t first, std::ptrdiff_t column)
{
  const TileState state = row.active ? row.active[first / TileColumns] : TileState::Masked;
  const bool      isMasked = row.mask && (state == TileState::Masked || row.isMoved || column != first);
  const bool      areAll = !isMasked && !row.IsCut(column);
  if (areAll && !row.fades && row.localThreshold)
  {
    return TakeRankedSlice<VExtremum, TSampler, true>(row, column);
  }
  if (areAll && !row.fades && row.rows == BlockLength)
  {
    return TakeRankedSlice<VExtremum, TSampler, false>(row, column);
  }
  CountedSamples<TPixel> counted;
  if (counted.Count(row, column, AllLanes<TPixel>, isMasked))
  {
    LanesOf<TPixel> samples[BlockLength];
    SampleTile<TSampler>(row, *row.slices, column, samples);
    TakeRankedSamples<VExtremum>(row, column, samples, counted, areAll);
  }
}

/** Gives the pixels of a tile the samples of all slices. */
template <Extremum VExtremum, typename TSampler, typename TPixel>
SHEARWARP_INLINE inline void
TakeSlices(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  constexpr int rows = TSampler::MaximumRows;
  for (int first = 0; first < BlockLength; first += rows)
  {
    typename TSampler::Sample best[rows];
    SHEARWARP_UNROLL
    for (int r = 0; r < rows; ++r)
    {
      best[r] = TSampler::template GetStart<VExtremum>();
    }
    for (const PlacedSlice * slice = row.slices; slice != row.slices + row.count; ++slice)
    {
      const TPixel * const voxels = row.voxels + (slice->offset + (row.row + first) * row.rowStride + column);
      TSampler             sampler(*slice, voxels, row.rowStride);
      SHEARWARP_UNROLL
      for (int r = 0; r < rows; ++r)
      {
        const TPixel * const b = voxels + r * row.rowStride;
        // a later tile's voxels come from a slower cache
        Lanes::Prefetch(reinterpret_cast<const char *>(b) + 128);
        best[r] = TSampler::template GetBetter<VExtremum>(best[r], sampler.Next(b));
      }
    }
    SHEARWARP_UNROLL
    for (int r = 0; r < rows; ++r)
    {
      TPixel * const pixel = row.pixels + (first + r) * row.pixelStride + column;
      Lanes::Store(pixel, Better<VExtremum, TPixel>(Lanes::Load(pixel), TSampler::Finish(best[r])));
    }
  }
}

/** Fetches the voxels that the tile needs of the next slice. */
template <typename TPixel>
void
FetchNextSlice(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  const TPixel * voxels = row.voxels + (row.slices->offset + row.nextSlice + row.row * row.rowStride + column);
  for (int r = 0; r < BlockLength; ++r, voxels += row.rowStride)
  {
    Lanes::Prefetch(reinterpret_cast<const char *>(voxels - 1));
    Lanes::Prefetch(reinterpret_cast<const char *>(voxels + lanes - 1));
  }
}

/** Calls \a take(first, column) for each tile. Tiles begin at multiples of LaneCount, \a first. Their pixels begin at
 * \a column, which differs only for outer tiles: these overlap their neighbours. A pixel may so take one sample twice,
 * which does not change an extremum. */
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
    const std::ptrdiff_t column = Smaller(Larger(first, row.begin), row.end - lanes);
    if (row.prefetcher)
    {
      row.prefetcher->Step();
    }
    else
    {
      FetchNextSlice(row, column);
    }
    take(first, column);
  }
}

/** Gives the pixels of a row of tiles without ranks the samples of all slices. */
template <Extremum VExtremum, typename TSampler, typename TPixel>
void
ProjectUnrankedTiles(const TileRow<TPixel> & row)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  const auto               takeSome = [&row](const PlacedSlice & slice, std::ptrdiff_t column) {
    LanesOf<TPixel> samples[BlockLength];
    SampleTile<TSampler>(row, slice, column, samples);
    TakeSamples<VExtremum>(row, column, samples);
  };
  ForEachTile(row, [&](std::ptrdiff_t, std::ptrdiff_t column) SHEARWARP_INLINE {
    if (row.rows != BlockLength || row.IsCut(column))
    {
      takeSome(*row.slices, column);
    }
    else if (row.count == 1)
    {
      TakeSlice<VExtremum, TSampler>(row, *row.slices, column);
    }
    else
    {
      TakeSlices<VExtremum, TSampler>(row, column);
    }
  });
  // columns that not all slices have
  for (const PlacedSlice * slice = row.slices; row.count > 1 && slice != row.slices + row.count; ++slice)
  {
    if (slice->inner.begin < row.begin)
    {
      takeSome(*slice, slice->inner.begin);
    }
    if (slice->inner.end > row.end)
    {
      takeSome(*slice, slice->inner.end - lanes);
    }
  }
}

template <Extremum VExtremum, typename TSampler, typename TPixel>
void
ProjectTilesWithSampler(const TileRow<TPixel> & row)
{
  if (row.ranks)
  {
    return ForEachTile(row, [&row](std::ptrdiff_t first, std::ptrdiff_t column) SHEARWARP_INLINE {
      TakeRankedTile<VExtremum, TSampler>(row, first, column);
    });
  }
  ProjectUnrankedTiles<VExtremum, TSampler>(row);
}

/** \class ExtremumTiles
 * Images collect the extremum of samples. */
struct ExtremumTiles
{
  static constexpr bool MayRepeat = true;

  template <typename TSampler, typename TPixel>
  static void
  Project(const TileRow<TPixel> & row)
  {
    CallWithExtremum(row.extremum,
                     [&](auto extremum) { ProjectTilesWithSampler<decltype(extremum)::value, TSampler>(row); });
  }

  template <typename TPixel>
  static void
  Take(const ShearedView<TPixel> & view,
       std::ptrdiff_t              row,
       std::ptrdiff_t              column,
       TPixel                      sample,
       SliceRank<TPixel>           rank)
  {
    const std::ptrdiff_t      place = row * view.intermediate.rowStride + column;
    SliceRank<TPixel> * const ranks = view.ranked.ranks ? view.ranked.ranks + place : nullptr;
    CallWithExtremum(view.extremum, [&](auto extremum) {
      TakeSample<decltype(extremum)::value>(sample, rank, view.localThreshold, view.intermediate.pixels[place], ranks);
    });
  }
};

/** Gives the pixels of a row of tiles the samples of its slices, whose fractions are zero along the same axes. */
template <typename TCollector, bool VWide, typename TPixel>
void
ProjectTileRow(const TileRow<TPixel> & row)
{
  switch (row.slices->GetFractions())
  {
    case Fractions::None:
      return TCollector::template Project<Sampler<TPixel, Fractions::None, VWide>>(row);
    case Fractions::Column:
      return TCollector::template Project<Sampler<TPixel, Fractions::Column, VWide>>(row);
    case Fractions::Row:
      return TCollector::template Project<Sampler<TPixel, Fractions::Row, VWide>>(row);
    case Fractions::Both:
      return TCollector::template Project<Sampler<TPixel, Fractions::Both, VWide>>(row);
  }
}

#endif
