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
#ifndef itkShearWarpRowProjection_h
#define itkShearWarpRowProjection_h

/* From rows of slices to rows of intermediate images: the rule of itkShearWarpSampling.h as it is written, for all
 * pixel types. A compiler makes vectors of the loops over plain runs of samples. */

/** \class IntegerSampler
 * Interpolates between the four voxels of cells, at the same place of each, with a fraction along columns (VHasX) or
 * rows (VHasY). Integers of 64 bits are split into an upper and a lower part of 15 bits, so that no sum overflows. */
template <typename TPixel, bool VHasX, bool VHasY>
class IntegerSampler
{
public:
  IntegerSampler(std::int32_t x, std::int32_t y)
    : IntegerSampler(x, y, (x * y + One / 2) >> FractionBits)
  {}

  /** The two voxels before and in a column of rows \a a and \a b. */
  TPixel
  operator()(const TPixel * a, const TPixel * b, std::ptrdiff_t before, std::ptrdiff_t column) const
  {
    const auto sum = [&](const auto & get) {
      auto total = m_BB * get(b[column]);
      total += VHasX ? m_BA * get(b[before]) : 0;
      total += VHasY ? m_AB * get(a[column]) : 0;
      return total + (VHasX && VHasY ? m_AA * get(a[before]) : 0);
    };
    if constexpr (sizeof(TPixel) < sizeof(std::int64_t))
    {
      const Sum rounded = sum([](TPixel voxel) { return Sum{ voxel }; }) + One / 2;
      // a signed shift has the same low bits
      return static_cast<TPixel>(static_cast<std::make_unsigned_t<Sum>>(rounded) >> FractionBits);
    }
    else
    {
      // an offset changes no weighted mean: a signed integer becomes an unsigned one
      constexpr std::uint64_t offset = static_cast<TPixel>(-1) < 0 ? std::uint64_t{ 1 } << 63 : 0;
      constexpr std::uint64_t lowBits = One - 1;
      const auto getUpper = [](TPixel voxel) { return (static_cast<std::uint64_t>(voxel) ^ offset) >> FractionBits; };
      const auto getLower = [](TPixel voxel) { return (static_cast<std::uint64_t>(voxel) ^ offset) & lowBits; };
      return static_cast<TPixel>((sum(getUpper) + ((sum(getLower) + One / 2) >> FractionBits)) ^ offset);
    }
  }

private:
  using Sum = std::conditional_t<(sizeof(TPixel) == 8),
                                 std::uint64_t,
                                 std::conditional_t<(sizeof(TPixel) > 2), std::int64_t, std::int32_t>>;

  IntegerSampler(std::int32_t x, std::int32_t y, std::int32_t aa)
    : m_AA(static_cast<Sum>(aa))
    , m_AB(static_cast<Sum>(y - aa))
    , m_BA(static_cast<Sum>(x - aa))
    , m_BB(static_cast<Sum>(One - x - y + aa))
  {}

  Sum m_AA, m_AB, m_BA, m_BB;
};

/** \class FloatCellSampler
 * As IntegerSampler, for floats: without a fraction, the voxels of weight zero are not used. */
template <typename TFloat, bool VHasX, bool VHasY>
class FloatCellSampler
{
public:
  FloatCellSampler(std::int32_t x, std::int32_t y)
    : m_X(static_cast<TFloat>(x) / One)
    , m_Y(static_cast<TFloat>(y) / One)
  {}

  TFloat
  operator()(const TFloat * a, const TFloat * b, std::ptrdiff_t before, std::ptrdiff_t column) const
  {
    const auto interpolate = [before, column, this](const TFloat * row) {
      return VHasX ? row[column] + m_X * (row[before] - row[column]) : row[column];
    };
    const TFloat below = interpolate(b);
    return VHasY ? below + m_Y * (interpolate(a) - below) : below;
  }

private:
  TFloat m_X, m_Y;
};

template <typename TPixel, bool VHasX, bool VHasY>
using CellSampler =
  std::conditional_t<IsFloat<TPixel>, FloatCellSampler<TPixel, VHasX, VHasY>, IntegerSampler<TPixel, VHasX, VHasY>>;

/** Returns what \a function returns for the sampler of these fractions. */
template <typename TPixel, typename TFunction>
auto
CallWithSampler(std::int32_t x, std::int32_t y, const TFunction & function)
{
  if (x != 0)
  {
    return y != 0 ? function(CellSampler<TPixel, true, true>(x, y)) : function(CellSampler<TPixel, true, false>(x, y));
  }
  return y != 0 ? function(CellSampler<TPixel, false, true>(x, y)) : function(CellSampler<TPixel, false, false>(x, y));
}

/** Writes \a count samples of a sampler, the first one in column 0 of two rows. */
template <typename TPixel, typename TSampler>
void
WriteSamples(const TPixel *              a,
             const TPixel *              b,
             std::ptrdiff_t              count,
             const TSampler              sample,
             TPixel * SHEARWARP_RESTRICT samples)
{
  for (std::ptrdiff_t n = 0; n < count; ++n)
  {
    samples[n] = sample(a, b, n - 1, n);
  }
}

/** Writes \a count samples with weights \a x and \a y, the first one in column 0 of two rows. */
template <typename TPixel>
void
SampleRun(const TPixel * a, const TPixel * b, std::int32_t x, std::int32_t y, std::ptrdiff_t count, TPixel * samples)
{
  CallWithSampler<TPixel>(x, y, [&](const auto & sample) { WriteSamples(a, b, count, sample, samples); });
}

/** A row of samples between two rows of a slice. */
template <typename TPixel>
struct SliceRow
{
  const TPixel *       a; // weight y / 2^15
  const TPixel *       b; // the remaining weight
  const std::uint8_t * maskA;
  const std::uint8_t * maskB; // both null if the view has no mask
  std::ptrdiff_t       columns;
  SamplingPosition     column; // of voxel 0 in the intermediate image
  std::int32_t         y;      // 0 in the outer half voxels
  const TPixel *       next;   // the row of the next slice, which the projection fetches, or null
};

/** \class PixelRow
 * The pixels of a row, which take the extremum of their samples or, if the view has sums, their sum. */
template <typename TPixel>
class PixelRow
{
public:
  PixelRow(const ShearedView<TPixel> & view, std::ptrdiff_t row, SliceRank<TPixel> rank)
    : m_Extremum(view.extremum)
    , m_Rank(rank)
    , m_Threshold(view.localThreshold)
    , m_Pixels(view.summed.sums ? nullptr : view.intermediate.pixels + row * view.intermediate.rowStride)
    , m_Ranks(view.ranked.ranks ? view.ranked.ranks + row * view.intermediate.rowStride : nullptr)
    , m_Sums(view.summed.sums ? GetSums(view, row) : nullptr)
    , m_CountSteps(view.summed.sums ? GetCountSteps(view, row) : nullptr)
  {}

  /** Whether TakeRun() is possible. */
  bool
  HasRuns() const
  {
    return !m_Ranks;
  }

  /** Takes \a count samples from pixel \a p on, of two rows from \a a and \a b on. */
  template <typename TSampler>
  void
  TakeRun(std::ptrdiff_t p, std::ptrdiff_t count, const TSampler & sample, const TPixel * a, const TPixel * b) const
  {
    if (m_Sums)
    {
      return AddRun(m_Sums + p, m_CountSteps + p, count, sample, a, b);
    }
    CallWithExtremum(
      m_Extremum, [&](auto extremum) { TakePlainRun<decltype(extremum)::value>(m_Pixels + p, count, sample, a, b); });
  }

  /** Takes \a count samples from pixel \a p on. */
  void
  Take(std::ptrdiff_t p, std::ptrdiff_t count, const TPixel * samples) const
  {
    if (m_Sums)
    {
      const auto get = [](const TPixel * from, const TPixel *, std::ptrdiff_t, std::ptrdiff_t n) { return from[n]; };
      return AddRun(m_Sums + p, m_CountSteps + p, count, get, samples, samples);
    }
    CallWithExtremum(m_Extremum, [&](auto extremum) {
      constexpr Extremum wanted = decltype(extremum)::value;
      if (m_Ranks && !m_Threshold)
      {
        return TakeRankedRun<wanted>(m_Pixels + p, m_Ranks + p, m_Rank, count, samples);
      }
      for (std::ptrdiff_t n = p; n < p + count; ++n)
      {
        TakeSample<wanted>(samples[n - p], m_Rank, m_Threshold, m_Pixels[n], m_Ranks ? m_Ranks + n : nullptr);
      }
    });
  }

private:
  template <Extremum VExtremum, typename TSampler>
  static void
  TakePlainRun(TPixel * SHEARWARP_RESTRICT pixels,
               std::ptrdiff_t              count,
               const TSampler              sample,
               const TPixel *              a,
               const TPixel *              b)
  {
    for (std::ptrdiff_t n = 0; n < count; ++n)
    {
      const TPixel value = sample(a, b, n - 1, n);
      pixels[n] = IsBetter<VExtremum>(value, pixels[n]) ? value : pixels[n];
    }
  }

  template <Extremum VExtremum>
  static void
  TakeRankedRun(TPixel * SHEARWARP_RESTRICT            pixels,
                SliceRank<TPixel> * SHEARWARP_RESTRICT ranks,
                SliceRank<TPixel>                      rank,
                std::ptrdiff_t                         count,
                const TPixel *                         samples)
  {
    for (std::ptrdiff_t n = 0; n < count; ++n)
    {
      const TPixel            value = samples[n];
      const TPixel            pixel = pixels[n];
      const SliceRank<TPixel> lower = Smaller(rank, ranks[n]);
      const SliceRank<TPixel> equal = value == pixel ? lower : ranks[n];
      ranks[n] = IsBetter<VExtremum>(value, pixel) ? rank : equal;
      pixels[n] = IsBetter<VExtremum>(value, pixel) ? value : pixel;
    }
  }

  template <typename TSampler>
  static void
  AddRun(SampleSum<TPixel> * SHEARWARP_RESTRICT sums,
         std::uint32_t * SHEARWARP_RESTRICT     countSteps,
         std::ptrdiff_t                         count,
         const TSampler                         sample,
         const TPixel *                         a,
         const TPixel *                         b)
  {
    CountSamples(countSteps, 0, count);
    for (std::ptrdiff_t n = 0; n < count; ++n)
    {
      const TPixel value = sample(a, b, n - 1, n);
      if (IsNumber(value))
      {
        AddToSum(value, sums[n]);
      }
      else
      {
        CountSamples(countSteps, n + 1, n);
      }
    }
  }

  Extremum            m_Extremum;
  SliceRank<TPixel>   m_Rank;
  const TPixel *      m_Threshold;
  TPixel *            m_Pixels;
  SliceRank<TPixel> * m_Ranks;
  SampleSum<TPixel> * m_Sums;
  std::uint32_t *     m_CountSteps;
};

/** Takes the samples of a row of a slice for a view. They fade if \a fading is not null. */
template <typename TPixel>
class RowProjector
{
public:
  RowProjector(const SliceRow<TPixel> &    row,
               const ShearedView<TPixel> & view,
               std::ptrdiff_t              pixelRow,
               const TileState *           active,
               SliceRank<TPixel>           rank,
               const FadingRow<TPixel> *   fading)
    : m_Row(row)
    , m_View(view)
    , m_Active(active)
    , m_Fading(fading)
    , m_Pixels(view, pixelRow, rank)
  {}

  /** Takes the samples in \a span that lie between two columns. */
  void
  ProjectInner(ColumnSpan span) const
  {
    const SamplingPosition & position = m_Row.column;
    const std::ptrdiff_t     last = Smaller<std::ptrdiff_t>(span.end, position.whole + m_Row.columns);
    for (std::ptrdiff_t begin = Larger(span.begin, position.whole + 1), end = 0; begin < last; begin = end)
    {
      const TileState state = this->GetState(begin);
      // without states, all tiles are alike
      end = m_Active ? Smaller<std::ptrdiff_t>((begin / TileColumns + 1) * TileColumns, last) : last;
      if (state == TileState::Whole)
      {
        this->TakeWhole(begin, end);
      }
      if (state == TileState::Masked)
      {
        this->TakeMasked(begin, end);
      }
    }
  }

  /** Takes the sample of the outer column if the sample is in \a span. */
  void
  ProjectEdge(ColumnSpan span) const
  {
    const SamplingPosition & position = m_Row.column;
    const std::ptrdiff_t     edge = position.whole + (position.fraction > One / 2 ? m_Row.columns : 0);
    const std::ptrdiff_t     i = Smaller(edge - position.whole, m_Row.columns - 1);
    const bool               hasEdge = edge >= span.begin && edge < span.end;
    if (hasEdge && this->GetState(edge) == TileState::Whole)
    {
      TPixel sample;
      SampleRun(m_Row.a + i, m_Row.b + i, 0, m_Row.y, 1, &sample);
      this->Take(edge, 1, &sample);
    }
    if (hasEdge && this->GetState(edge) == TileState::Masked)
    {
      const unsigned int counted = this->FindCountedAt(i, i, 0);
      if (counted != 0)
      {
        TPixel sample = SampleCounted(m_Row.a, m_Row.b, i, i, 0, m_Row.y, counted);
        this->Take(edge, 1, &sample);
      }
    }
  }

private:
  static constexpr std::ptrdiff_t MostSamples = 256;
  static constexpr std::ptrdiff_t Line = 64 / sizeof(TPixel);
  /** Many lines at once would wait for each other. */
  static constexpr std::ptrdiff_t FetchedSamples = 8 * Line;

  /** Starts to fetch the voxels of the next slice at these columns. */
  void
  FetchNext(std::ptrdiff_t first, std::ptrdiff_t count) const
  {
    for (std::ptrdiff_t n = first; m_Row.next && n < first + count; n += Line)
    {
      PrefetchVoxel(m_Row.next + n);
    }
  }

  void
  TakeWhole(std::ptrdiff_t begin, std::ptrdiff_t end) const
  {
    if (!m_Fading && m_Pixels.HasRuns())
    {
      return CallWithSampler<TPixel>(m_Row.column.fraction, m_Row.y, [&](const auto & sample) {
        const std::ptrdiff_t most = m_Row.next ? FetchedSamples : end - begin;
        for (std::ptrdiff_t p = begin; p < end; p += most)
        {
          const std::ptrdiff_t first = p - m_Row.column.whole;
          const std::ptrdiff_t count = Smaller(most, end - p);
          this->FetchNext(first, count);
          m_Pixels.TakeRun(p, count, sample, m_Row.a + first, m_Row.b + first);
        }
      });
    }
    TPixel samples[MostSamples];
    for (std::ptrdiff_t count = 0; begin < end; begin += count)
    {
      count = Smaller(MostSamples, end - begin);
      const std::ptrdiff_t first = begin - m_Row.column.whole;
      this->FetchNext(first, count);
      SampleRun(m_Row.a + first, m_Row.b + first, m_Row.column.fraction, m_Row.y, count, samples);
      this->Take(begin, count, samples);
    }
  }

  TileState
  GetState(std::ptrdiff_t p) const
  {
    return m_Active ? m_Active[p / TileColumns] : m_Row.maskA ? TileState::Masked : TileState::Whole;
  }

  /** Takes samples from pixel \a p on, which become the faded ones. */
  void
  Take(std::ptrdiff_t p, std::ptrdiff_t count, TPixel * samples) const
  {
    for (std::ptrdiff_t n = 0; m_Fading && n < count; ++n)
    {
      samples[n] = FadeInRow(*m_Fading, samples[n], p + n);
    }
    m_Pixels.Take(p, count, samples);
  }

  /** Takes the samples that count by the mask. */
  void
  TakeMasked(std::ptrdiff_t begin, std::ptrdiff_t end) const
  {
    const std::int32_t x = m_Row.column.fraction;
    TPixel             samples[MostSamples];
    std::ptrdiff_t     count = 0;
    for (std::ptrdiff_t p = begin; p < end; ++p)
    {
      const std::ptrdiff_t i = p - m_Row.column.whole;
      const unsigned int   counted = this->FindCountedAt(i, i - 1, x);
      if (counted != 0)
      {
        samples[count++] = SampleCounted(m_Row.a, m_Row.b, i, i - 1, x, m_Row.y, counted);
      }
      const std::ptrdiff_t next = counted != 0 ? p + 1 : p;
      if (count > 0 && (next == p || next == end || count == MostSamples))
      {
        this->Take(next - count, count, samples);
        count = 0;
      }
    }
  }

  unsigned int
  FindCountedAt(std::ptrdiff_t i, std::ptrdiff_t before, std::int32_t x) const
  {
    return FindCounted(m_Row.maskA, m_Row.maskB, m_View.mask->label, i, before, x, m_Row.y);
  }

  SliceRow<TPixel>            m_Row;
  const ShearedView<TPixel> & m_View;
  const TileState *           m_Active; // the states of the row's tiles, or null
  const FadingRow<TPixel> *   m_Fading;
  PixelRow<TPixel>            m_Pixels;
};

/** Takes the block's samples of one slice. The first view fetches the rows of the next slice for all views. */
template <typename TPixel>
void
ProjectSlice(const SliceStack<TPixel> &  stack,
             const Block &               block,
             const ShearedView<TPixel> & view,
             std::ptrdiff_t              slice,
             bool                        isFirstView)
{
  const SamplingPosition & column = view.placements[slice].column;
  const SamplingPosition & row = view.placements[slice].row;
  const auto [begin, end] = FindRowSamples(block, view.placements, slice, stack.rowEnds);
  const RowSpan        columnSamples = FindSamples(column, stack.columns, stack.columnEnds);
  const std::ptrdiff_t firstTile = FindFirstRow(block, view.placements, slice) - row.whole + block.rowBegin;
  const Mask           mask = view.mask ? *view.mask : Mask{};
  const auto           getRow = [slice](const auto & of, std::ptrdiff_t index) {
    return of.voxels ? of.voxels + (slice * of.sliceStride + index * of.rowStride) : nullptr;
  };
  const std::ptrdiff_t next = block.isBackward ? slice - 1 : slice + 1;
  const bool fetches = isFirstView && !view.active && !view.coverage.region && next >= 0 && next < stack.slices;
  for (std::ptrdiff_t j = begin; j < end; ++j)
  {
    const bool           isEdge = j == 0 || j == stack.rows;
    const std::ptrdiff_t a = Larger<std::ptrdiff_t>(j - 1, 0);
    const std::ptrdiff_t b = Smaller(j, stack.rows - 1);
    const std::ptrdiff_t tile =
      Smaller(Larger<std::ptrdiff_t>(j - firstTile, 0), block.rowEnd - block.rowBegin - 1) / BlockLength;
    ColumnSpan        reached{ column.whole + static_cast<std::int32_t>(columnSamples.begin),
                        column.whole + static_cast<std::int32_t>(columnSamples.end) };
    FadingRow<TPixel> fading{};
    if (view.fading)
    {
      fading = view.fading->GetRow(row.whole + j, slice, reached);
    }
    if (view.coverage.region && !view.coverage.Add(reached, { row.whole + j, row.whole + j + 1 }, slice, &reached))
    {
      continue;
    }
    const RowProjector<TPixel> projector(
      { getRow(stack, a),
        getRow(stack, b),
        getRow(mask, a),
        getRow(mask, b),
        stack.columns,
        column,
        isEdge ? 0 : row.fraction,
        fetches ? stack.voxels + (next * stack.sliceStride + b * stack.rowStride) : nullptr },
      view,
      row.whole + j,
      view.active ? view.active + tile * view.activeStride : nullptr,
      GetRank(view.ranked, slice),
      view.fading ? &fading : nullptr);
    projector.ProjectInner(reached);
    projector.ProjectEdge(reached);
  }
}

/** Projects or, if the views have sums, adds the slices of a block, each slice for all views. */
template <typename TPixel>
void
ProjectBlockByRows(const SliceStack<TPixel> &  slices,
                   const Block &               block,
                   const ShearedView<TPixel> * views,
                   std::size_t                 count)
{
  for (std::ptrdiff_t n = block.sliceBegin; n < block.sliceEnd; ++n)
  {
    const std::ptrdiff_t slice = block.isBackward ? block.sliceBegin + block.sliceEnd - 1 - n : n;
    for (const ShearedView<TPixel> * view = views; view != views + count; ++view)
    {
      ProjectSlice(slices, block, *view, slice, view == views);
    }
  }
}

/** Raises maxima and lowers minima to the elements of a row. */
template <typename TPixel>
void
WidenRanges(const TPixel *              row,
            std::ptrdiff_t              count,
            TPixel * SHEARWARP_RESTRICT maxima,
            TPixel * SHEARWARP_RESTRICT minima)
{
  for (std::ptrdiff_t n = 0; n < count; ++n)
  {
    maxima[n] = row[n] > maxima[n] ? row[n] : maxima[n];
    minima[n] = row[n] < minima[n] ? row[n] : minima[n];
  }
}

template <typename TPixel>
void
FindBlockExtremaByRows(const TPixel * voxels,
                       std::ptrdiff_t columns,
                       std::ptrdiff_t rows,
                       std::ptrdiff_t slices,
                       std::ptrdiff_t rowStride,
                       std::ptrdiff_t sliceStride,
                       TPixel *       maxima,
                       TPixel *       minima,
                       TPixel &       lowest,
                       TPixel &       highest)
{
  constexpr std::ptrdiff_t most = 32 * BlockLength; // columns at once
  for (std::ptrdiff_t begin = 0; begin < columns; begin += most)
  {
    const std::ptrdiff_t count = Smaller(most, columns - begin);
    TPixel               high[most], low[most];
    for (std::ptrdiff_t n = 0; n < most; ++n)
    {
      high[n] = NoSample<TPixel, Extremum::Maximum>;
      low[n] = NoSample<TPixel, Extremum::Minimum>;
    }
    for (std::ptrdiff_t k = 0; k < slices; ++k)
    {
      for (std::ptrdiff_t j = 0; j < rows; ++j)
      {
        WidenRanges(voxels + (k * sliceStride + j * rowStride + begin), count, high, low);
      }
    }
    for (std::ptrdiff_t n = 0; n < count; n += BlockLength)
    {
      for (std::ptrdiff_t next = n + 1; next < n + BlockLength; ++next)
      {
        high[n] = Larger(high[n], high[next]);
        low[n] = Smaller(low[n], low[next]);
      }
      maxima[(begin + n) / BlockLength] = high[n];
      highest = Larger(highest, high[n]);
      lowest = Smaller(lowest, low[n]);
      if (minima)
      {
        minima[(begin + n) / BlockLength] = low[n];
      }
    }
  }
}

#endif
