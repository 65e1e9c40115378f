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
/* Included by the file of each instruction set, within its anonymous namespace, after its struct Lanes and
 * itkShearWarpRayKernels.h, so that the linker cannot share what is compiled here. For the same reason nothing here may
 * call an inline function or a template of another header at run time.
 *
 * Lanes has the operations on vectors of 16-bit and 32-bit integers, float and double that are written differently for
 * each instruction set. */

template <typename T>
T
Smaller(T a, T b)
{
  return b < a ? b : a;
}

template <typename T>
T
Larger(T a, T b)
{
  return a < b ? b : a;
}

template <typename TPixel>
constexpr bool IsUnsignedShort = sizeof(TPixel) == 2 && static_cast<TPixel>(-1) > 0;

template <typename TPixel>
constexpr std::ptrdiff_t LaneCount = IsFloat<TPixel> ? Lanes::FloatCount : Lanes::ShortCount;

/** The maximum of pixels of type TPixel; 8-bit ones are lanes of 16 bits. For float, \a maximum where \a value is not a
 * number. */
template <typename TPixel, typename TVector>
TVector
Maximum(TVector maximum, TVector value)
{
  if constexpr (IsUnsignedShort<TPixel>)
  {
    return Lanes::MaximumUnsigned(maximum, value);
  }
  else
  {
    return Lanes::Maximum(maximum, value);
  }
}

template <typename TPixel, typename TVector>
TVector
Minimum(TVector minimum, TVector value)
{
  if constexpr (IsUnsignedShort<TPixel>)
  {
    return Lanes::MinimumUnsigned(minimum, value);
  }
  else
  {
    return Lanes::Minimum(minimum, value);
  }
}

/** The one of two pixels that a rule takes. */
template <typename TRule, typename TPixel, typename TVector>
TVector
Better(TVector best, TVector value)
{
  if constexpr (std::is_same_v<TRule, MinimumRule<TPixel>>)
  {
    return Minimum<TPixel>(best, value);
  }
  else
  {
    return Maximum<TPixel>(best, value);
  }
}

/** Which of a slice's fractions are not zero: a sample has one, two or four voxels. */
enum class Fractions
{
  None,
  Column,
  Row,
  Both
};

/** Rows [rowBegin, rowEnd) and columns [begin, end) of the intermediate image. */
struct Rectangle
{
  std::ptrdiff_t rowBegin, rowEnd;
  std::ptrdiff_t begin, end;
};

/** A slice where the view places it: pixel (p, q) is sampled between voxels (p - 1, q - 1) and (p, q) of a slice whose
 * voxel (0, 0) is at `offset`, and at `maskOffset` of the mask. Of the block's samples it has all voxels of those in
 * `inner`. */
struct PlacedSlice
{
  std::ptrdiff_t offset, maskOffset;
  std::ptrdiff_t column, row;
  std::int32_t   x, y;
  Rectangle      inner;

  Fractions
  GetFractions() const
  {
    return x == 0 ? (y == 0 ? Fractions::None : Fractions::Row) : (y == 0 ? Fractions::Column : Fractions::Both);
  }
};

/** Fetches lines of voxels that are soon needed, a few at each step. Lines come from several places in turn, each in
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

/** A row of tiles: columns [begin, end), at least LaneCount of them, that `count` slices have in common, of the rows
 * from `row` on. `spans`, if not null, are the columns to take of each row; `any` has all of them, and each has
 * `common`.
 */
template <typename TPixel>
struct TileRow
{
  const TPixel *      voxels;
  std::ptrdiff_t      rowStride;
  const PlacedSlice * slices;
  std::ptrdiff_t      count;
  std::ptrdiff_t      row, begin, end;
  TPixel *            pixels;
  std::ptrdiff_t      pixelStride;
  const TileState *   active;
  std::ptrdiff_t      nextSlice;  // distance in voxels
  Prefetcher *        prefetcher; // null where tiles fetch their own place in the next slice
  SliceRank<TPixel>   rank;       // of the one slice
  const Mask *        mask;
  bool                isMoved{ false }; // so that it has rows of other tiles, whose states `active` does not tell
  SliceRank<TPixel> * ranks{ nullptr };
  const ColumnSpan *  spans{ nullptr };
  ColumnSpan          any{}, common{};
};

/** The samples of a slice in a tile, of one or two short integers whose difference fits in 16 bits: linear
 * interpolation is b + ((a - b) x + 2^14 >> 15). */
template <typename TPixel, Fractions VFractions>
class LinearSampler
{
public:
  using Sample = Lanes::Short;

  /** As many rows as have registers. */
  static constexpr int MaximumRows = BlockLength;

  SHEARWARP_INLINE explicit LinearSampler(const PlacedSlice & slice)
    : m_Weight(Lanes::Set(VFractions == Fractions::Column ? slice.x : slice.y))
  {}

  template <typename TRule>
  static Sample
  GetStart()
  {
    return Lanes::Set(TRule::Start);
  }

  template <typename TRule>
  static Sample
  GetBetter(Sample a, Sample b)
  {
    return Better<TRule, TPixel>(a, b);
  }

  static Sample
  Finish(Sample sample)
  {
    return sample;
  }

  /** Calls \a process(row, voxels, sample) for each of VRows rows; \a b are the first one's lower voxels. */
  template <int VRows, typename TFunction>
  SHEARWARP_INLINE void
  ForEachRow(const TPixel * b, std::ptrdiff_t stride, const TFunction & process) const
  {
    Sample above = VFractions == Fractions::Row ? Lanes::Load(b - stride) : m_Weight;
    SHEARWARP_UNROLL
    for (int r = 0; r < VRows; ++r, b += stride)
    {
      const Sample voxel = Lanes::Load(b);
      if constexpr (VFractions == Fractions::None)
      {
        process(r, b, voxel);
      }
      else if constexpr (VFractions == Fractions::Column)
      {
        process(r, b, this->Interpolate(Lanes::Load(b - 1), voxel));
      }
      else
      {
        process(r, b, this->Interpolate(above, voxel));
        above = voxel;
      }
    }
  }

private:
  Sample
  Interpolate(Sample a, Sample b) const
  {
    return Lanes::Add(b, Lanes::MultiplyHighRounded(Lanes::Subtract(a, b), m_Weight));
  }

  Sample m_Weight;
};

/** The samples of a slice in a tile, of short integers: weighted sums. Unsigned ones fit in 15 bits unless VWide. */
template <typename TPixel, Fractions VFractions, bool VWide>
class SumSampler
{
public:
  using Short = Lanes::Short;
  using Int = Lanes::Int;

  /** Two halves of weighted sums, 2^14 added. The lanes of one half are the even columns, of the other the odd ones;
   * or, between rows alone, the halves of interleaved vectors. */
  struct Sample
  {
    Int low, high;
  };

  static constexpr int MaximumRows = Lanes::SumRows;

  SHEARWARP_INLINE explicit SumSampler(const PlacedSlice & slice)
    : SumSampler(slice.x, slice.y, (slice.x * slice.y + (1 << 14)) >> 15)
  {}

  template <typename TRule>
  static Sample
  GetStart()
  {
    // beyond every sum
    const Int start = Lanes::SetInt(std::is_same_v<TRule, MinimumRule<TPixel>> ? 1 << 30 : -(1 << 30));
    return { start, start };
  }

  template <typename TRule>
  static Sample
  GetBetter(Sample a, Sample b)
  {
    if constexpr (std::is_same_v<TRule, MinimumRule<TPixel>>)
    {
      return { Lanes::MinimumInt(a.low, b.low), Lanes::MinimumInt(a.high, b.high) };
    }
    else
    {
      return { Lanes::MaximumInt(a.low, b.low), Lanes::MaximumInt(a.high, b.high) };
    }
  }

  /** Rounds: that is monotonic, so that an extremum is rounded once. */
  static Short
  Finish(Sample sample)
  {
    const Short packed = VFractions == Fractions::Row ? Lanes::PackInterleaved(sample.low, sample.high)
                                                      : Lanes::PackEvenOdd(sample.low, sample.high);
    return FlipSign ? Lanes::FlipSign(packed) : packed;
  }

  template <int VRows, typename TFunction>
  SHEARWARP_INLINE void
  ForEachRow(const TPixel * b, std::ptrdiff_t stride, const TFunction & process) const
  {
    const Int half = Lanes::SetInt(1 << 14);
    if constexpr (VFractions == Fractions::Row)
    {
      Short above = Load(b - stride);
      SHEARWARP_UNROLL
      for (int r = 0; r < VRows; ++r, b += stride)
      {
        const Short voxel = Load(b);
        process(r,
                b,
                { Lanes::AddPairProducts(half, Lanes::InterleaveLow(above, voxel), m_Weights),
                  Lanes::AddPairProducts(half, Lanes::InterleaveHigh(above, voxel), m_Weights) });
        above = voxel;
      }
    }
    else if constexpr (VFractions == Fractions::Column)
    {
      SHEARWARP_UNROLL
      for (int r = 0; r < VRows; ++r, b += stride)
      {
        process(
          r,
          b,
          { Lanes::AddPairProducts(half, Load(b - 1), m_Weights), Lanes::AddPairProducts(half, Load(b), m_Weights) });
      }
    }
    else
    {
      Short evenAbove = Load(b - stride - 1);
      Short oddAbove = Load(b - stride);
      SHEARWARP_UNROLL
      for (int r = 0; r < VRows; ++r, b += stride)
      {
        const Short even = Load(b - 1);
        const Short odd = Load(b);
        process(r,
                b,
                { Lanes::AddPairProducts(Lanes::AddPairProducts(half, evenAbove, m_WeightsAbove), even, m_Weights),
                  Lanes::AddPairProducts(Lanes::AddPairProducts(half, oddAbove, m_WeightsAbove), odd, m_Weights) });
        evenAbove = even;
        oddAbove = odd;
      }
    }
  }

private:
  static constexpr bool FlipSign = VWide && IsUnsignedShort<TPixel>;

  SHEARWARP_INLINE
  SumSampler(std::int32_t x, std::int32_t y, std::int32_t aa)
    : m_WeightsAbove(Lanes::SetPairs(aa, y - aa))
    , m_Weights(VFractions == Fractions::Row ? Lanes::SetPairs(y, 32768 - y)
                                             : Lanes::SetPairs(x - aa, 32768 - x - y + aa))
  {}

  static Short
  Load(const TPixel * voxels)
  {
    const Short loaded = Lanes::Load(voxels);
    return FlipSign ? Lanes::FlipSign(loaded) : loaded;
  }

  Short m_WeightsAbove;
  Short m_Weights;
};

/** The samples of a slice in a tile, of floats. */
template <Fractions VFractions>
class FloatSampler
{
public:
  using Sample = Lanes::Float;

  static constexpr int MaximumRows = BlockLength;

  SHEARWARP_INLINE explicit FloatSampler(const PlacedSlice & slice)
    : m_X(Lanes::SetFloat(static_cast<float>(slice.x) / 32768))
    , m_Y(Lanes::SetFloat(static_cast<float>(slice.y) / 32768))
  {}

  template <typename TRule>
  static Sample
  GetStart()
  {
    return Lanes::SetFloat(TRule::Start);
  }

  template <typename TRule>
  static Sample
  GetBetter(Sample a, Sample b)
  {
    return Better<TRule, float>(a, b);
  }

  static Sample
  Finish(Sample sample)
  {
    return sample;
  }

  template <int VRows, typename TFunction>
  SHEARWARP_INLINE void
  ForEachRow(const float * b, std::ptrdiff_t stride, const TFunction & process) const
  {
    constexpr bool betweenRows = VFractions == Fractions::Row || VFractions == Fractions::Both;
    Sample         above = betweenRows ? this->InterpolateColumns(b - stride) : m_X;
    SHEARWARP_UNROLL
    for (int r = 0; r < VRows; ++r, b += stride)
    {
      const Sample row = this->InterpolateColumns(b);
      process(r, b, betweenRows ? Interpolate(above, row, m_Y) : row);
      above = row;
    }
  }

private:
  static Sample
  Interpolate(Sample a, Sample b, Sample weightOfA)
  {
    return Lanes::Add(b, Lanes::Multiply(weightOfA, Lanes::Subtract(a, b)));
  }

  Sample
  InterpolateColumns(const float * b) const
  {
    const Sample voxel = Lanes::Load(b);
    return VFractions == Fractions::Column || VFractions == Fractions::Both
             ? Interpolate(Lanes::Load(b - 1), voxel, m_X)
             : voxel;
  }

  Sample m_X, m_Y;
};

template <bool VIsLinear, typename TPixel, Fractions VFractions, bool VWide>
struct SamplerOf
{
  using Type = SumSampler<TPixel, VFractions, VWide>;
};
template <typename TPixel, Fractions VFractions, bool VWide>
struct SamplerOf<true, TPixel, VFractions, VWide>
{
  using Type = LinearSampler<TPixel, VFractions>;
};
template <Fractions VFractions, bool VWide>
struct SamplerOf<false, float, VFractions, VWide>
{
  using Type = FloatSampler<VFractions>;
};
template <typename TPixel, Fractions VFractions, bool VWide>
using Sampler =
  typename SamplerOf<!IsFloat<TPixel> && (VFractions == Fractions::None || (!VWide && VFractions != Fractions::Both)),
                     TPixel,
                     VFractions,
                     VWide>::Type;

/** Gives VRows rows of LaneCount pixels, from \a column on, the samples of a slice. */
template <typename TRule, typename TSampler, int VRows, typename TPixel>
SHEARWARP_INLINE inline void
TakeSlice(const TileRow<TPixel> & row, const PlacedSlice & slice, std::ptrdiff_t column)
{
  TPixel * const       pixels = row.pixels + column;
  const std::ptrdiff_t stride = row.pixelStride;
  TSampler(slice).template ForEachRow<VRows>(
    row.voxels + (slice.offset + row.row * row.rowStride + column),
    row.rowStride,
    [=](int r, const TPixel *, typename TSampler::Sample sample) SHEARWARP_INLINE {
      TPixel * const pixel = pixels + r * stride;
      Lanes::Store(pixel, Better<TRule, TPixel>(Lanes::Load(pixel), TSampler::Finish(sample)));
    });
}

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

/** The same, no more of each row than its span. */
template <typename TRule, typename TSampler, int VRows, typename TPixel>
SHEARWARP_INLINE inline void
TakeSpans(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  TPixel * const       pixels = row.pixels + column;
  const std::ptrdiff_t stride = row.pixelStride;
  TSampler(*row.slices)
    .template ForEachRow<VRows>(
      row.voxels + (row.slices->offset + row.row * row.rowStride + column),
      row.rowStride,
      [=, spans = row.spans](int r, const TPixel *, typename TSampler::Sample sample) SHEARWARP_INLINE {
        TPixel * const pixel = pixels + r * stride;
        const auto     before = Lanes::Load(pixel);
        const auto     better = Better<TRule, TPixel>(before, TSampler::Finish(sample));
        Lanes::Store(pixel, Lanes::Select(before, better, GetLanes<TPixel>(spans[r], column)));
      });
}

/** Which voxels around the samples of VRows rows, from \a column on, are in the mask: as bits, of the lanes' columns
 * and of the columns before, of the row above and of the rows. */
template <typename TPixel, int VRows>
struct MaskedVoxels
{
  SHEARWARP_INLINE
  MaskedVoxels(const TileRow<TPixel> & row, std::ptrdiff_t column)
  {
    const PlacedSlice &  slice = *row.slices;
    const Mask &         mask = *row.mask;
    const std::uint8_t * voxels = mask.voxels + (slice.maskOffset + row.row * mask.rowStride + column);
    for (int r = slice.y != 0 ? 0 : 1; r <= VRows; ++r)
    {
      const std::uint8_t * p = voxels + (r - 1) * mask.rowStride;
      at[r] = Lanes::FindLabel<LaneCount<TPixel>>(p, mask.label);
      before[r] = slice.x != 0 ? Lanes::FindLabel<LaneCount<TPixel>>(p - 1, mask.label) : at[r];
    }
    constexpr std::int32_t half = 1 << 14;
    for (int r = 0; r < VRows; ++r)
    {
      const int             above = slice.y != 0 ? r : r + 1;
      const int             nearest = slice.y > half ? r : r + 1;
      const std::uint32_t * columns = slice.x > half ? before : at;
      counted[r] = columns[nearest];
      whole[r] = counted[r] & at[r + 1] & before[r + 1] & at[above] & before[above];
      any |= counted[r];
    }
  }

  /** The voxels of a lane, as SampleCounted() has them. */
  unsigned int
  GetVoxels(int r, int above, int lane) const
  {
    const auto get = [lane](std::uint32_t bits) { return bits >> lane & 1U; };
    return get(at[r + 1]) | get(before[r + 1]) << 1 | get(at[r + 1 - above]) << 2 | get(before[r + 1 - above]) << 3;
  }

  std::uint32_t at[VRows + 1], before[VRows + 1];
  std::uint32_t counted[VRows]; // samples that count
  std::uint32_t whole[VRows];   // those of them that have all voxels
  std::uint32_t any{ 0 };
};

/** Gives the \a taken lanes of a row of pixels, with their ranks, what is better or nearer. */
template <typename TRule, bool VAll, typename TPixel, typename TVector, typename TRanks>
SHEARWARP_INLINE inline void
TakeRanked(TVector sample, TRanks rank, std::uint32_t taken, TPixel * pixels, SliceRank<TPixel> * ranks)
{
  const auto before = Lanes::Load(pixels);
  const auto rankBefore = Lanes::Load(ranks);
  const auto better = Better<TRule, TPixel>(before, sample);
  const auto nearest = Lanes::SelectNearest(before, sample, better, rankBefore, rank);
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

/** Gives VRows rows of LaneCount pixels, from \a column on, the samples of a slice, and its rank; no more of each row
 * than its span unless VAll. */
template <typename TRule, typename TSampler, int VRows, bool VAll, typename TPixel>
SHEARWARP_INLINE inline void
TakeRanked(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  TPixel * const            pixels = row.pixels + column;
  SliceRank<TPixel> * const ranks = row.ranks + column;
  const std::ptrdiff_t      stride = row.pixelStride;
  const auto                rank = Lanes::SetRank(row.rank);
  TSampler(*row.slices)
    .template ForEachRow<VRows>(
      row.voxels + (row.slices->offset + row.row * row.rowStride + column),
      row.rowStride,
      [=, spans = row.spans](int r, const TPixel *, typename TSampler::Sample sample) SHEARWARP_INLINE {
        const std::uint32_t taken = VAll ? ~0U : GetLanes<TPixel>(spans[r], column);
        TakeRanked<TRule, VAll>(TSampler::Finish(sample), rank, taken, pixels + r * stride, ranks + r * stride);
      });
}

/** The same, no more than counts in the mask; spans may be null. */
template <typename TRule, typename TSampler, int VRows, typename TPixel>
SHEARWARP_INLINE inline void
TakeMasked(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  const MaskedVoxels<TPixel, VRows> mask(row, column);
  if (mask.any == 0)
  {
    return;
  }
  const PlacedSlice & slice = *row.slices;
  const int           above = slice.y != 0 ? 1 : 0;
  const int           before = slice.x != 0 ? 1 : 0;
  const auto          rank = Lanes::SetRank(row.rank);
  TSampler(slice).template ForEachRow<VRows>(
    row.voxels + (slice.offset + row.row * row.rowStride + column),
    row.rowStride,
    [&](int r, const TPixel * b, typename TSampler::Sample sample) SHEARWARP_INLINE {
      TPixel * const            pixels = row.pixels + r * row.pixelStride + column;
      SliceRank<TPixel> * const ranks = row.ranks + r * row.pixelStride + column;
      const std::uint32_t       taken = mask.counted[r] & (row.spans ? GetLanes<TPixel>(row.spans[r], column) : ~0U);
      const std::uint32_t       whole = taken & mask.whole[r];
      TakeRanked<TRule, false>(TSampler::Finish(sample), rank, whole, pixels, ranks);
      // a few samples at the mask's rim
      for (std::uint32_t rest = taken & ~whole; rest != 0; rest &= rest - 1)
      {
        const int      lane = __builtin_ctz(rest);
        const TPixel * a = b - above * row.rowStride + lane;
        TakeSample<TRule>(SampleCounted(a, b + lane, 0, -before, slice.x, slice.y, mask.GetVoxels(r, above, lane)),
                          row.rank,
                          pixels[lane],
                          ranks + lane);
      }
    });
}

/** The same, what there is of a tile that begins at \a first. */
template <typename TRule, typename TSampler, int VRows, typename TPixel>
void
TakeRankedTile(const TileRow<TPixel> & row, std::ptrdiff_t first, std::ptrdiff_t column, bool isCut)
{
  const TileState state = row.active ? row.active[first / TileColumns] : TileState::Masked;
  if (row.mask && (state == TileState::Masked || row.isMoved || column != first))
  {
    TakeMasked<TRule, TSampler, VRows>(row, column);
  }
  else if (isCut)
  {
    TakeRanked<TRule, TSampler, VRows, false>(row, column);
  }
  else
  {
    TakeRanked<TRule, TSampler, VRows, true>(row, column);
  }
}

/** The samples of all slices. */
template <typename TRule, typename TSampler, int VRows, typename TPixel>
SHEARWARP_INLINE inline void
TakeSlices(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  using Sample = typename TSampler::Sample;
  constexpr int rows = VRows < TSampler::MaximumRows ? VRows : TSampler::MaximumRows;
  for (int first = 0; first < VRows; first += rows)
  {
    Sample best[rows];
    SHEARWARP_UNROLL
    for (int r = 0; r < rows; ++r)
    {
      best[r] = TSampler::template GetStart<TRule>();
    }
    for (const PlacedSlice * slice = row.slices; slice != row.slices + row.count; ++slice)
    {
      TSampler(*slice).template ForEachRow<rows>(row.voxels +
                                                   (slice->offset + (row.row + first) * row.rowStride + column),
                                                 row.rowStride,
                                                 [&](int r, const TPixel * voxels, Sample sample) SHEARWARP_INLINE {
                                                   // what a tile further on needs, from a slower cache
                                                   Lanes::Prefetch(reinterpret_cast<const char *>(voxels) + 128);
                                                   best[r] = TSampler::template GetBetter<TRule>(best[r], sample);
                                                 });
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

template <typename TRule, typename TPixel, Fractions VFractions, bool VWide, int VRows, bool VHasRanks>
void
ProjectTileRow(const TileRow<TPixel> & row)
{
  using SamplerType = Sampler<TPixel, VFractions, VWide>;
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
    if (!row.prefetcher)
    {
      FetchNextSlice<VRows>(row, column);
    }
    else
    {
      row.prefetcher->Step();
    }
    const bool isCut = row.spans && !(row.common.begin <= column && column + lanes <= row.common.end);
    if constexpr (VHasRanks)
    {
      TakeRankedTile<TRule, SamplerType, VRows>(row, first, column, isCut);
    }
    else if (isCut)
    {
      TakeSpans<TRule, SamplerType, VRows>(row, column);
    }
    else if (row.count == 1)
    {
      TakeSlice<TRule, SamplerType, VRows>(row, *row.slices, column);
    }
    else
    {
      TakeSlices<TRule, SamplerType, VRows>(row, column);
    }
  }
  // what a slice has beside the others
  for (const PlacedSlice * slice = row.slices; !VHasRanks && row.count > 1 && slice != row.slices + row.count; ++slice)
  {
    if (slice->inner.begin < row.begin)
    {
      TakeSlice<TRule, SamplerType, VRows>(row, *slice, slice->inner.begin);
    }
    if (slice->inner.end > row.end)
    {
      TakeSlice<TRule, SamplerType, VRows>(row, *slice, slice->inner.end - lanes);
    }
  }
}

template <typename TRule, typename TPixel, bool VWide, int VRows, bool VHasRanks>
void
ProjectTileRow(const TileRow<TPixel> & row)
{
  switch (row.slices->GetFractions())
  {
    case Fractions::None:
      return ProjectTileRow<TRule, TPixel, Fractions::None, VWide, VRows, VHasRanks>(row);
    case Fractions::Column:
      return ProjectTileRow<TRule, TPixel, Fractions::Column, VWide, VRows, VHasRanks>(row);
    case Fractions::Row:
      return ProjectTileRow<TRule, TPixel, Fractions::Row, VWide, VRows, VHasRanks>(row);
    default:
      return ProjectTileRow<TRule, TPixel, Fractions::Both, VWide, VRows, VHasRanks>(row);
  }
}

/** Projects a few slices of a block of the volume into one view. */
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

  /** Slices [begin, end), at most MaximumSlices of one cube. */
  void
  Project(std::ptrdiff_t begin, std::ptrdiff_t end)
  {
    m_Grid = m_Block.rowBegin + FindFirstRow(m_Block, m_View.placements, begin);
    m_Slice = begin;
    PlacedSlice slices[MaximumSlices];
    const auto  count = static_cast<int>(end - begin);
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
        this->ProjectEdges(slices[n], FindRows(m_Block, m_View.placements, begin + n));
      }
    }
  }

private:
  PlacedSlice
  Place(std::ptrdiff_t slice) const
  {
    const auto [column, row] = m_View.placements[slice];
    const RowSpan rows = FindRows(m_Block, m_View.placements, slice);
    return { slice * m_Stack.sliceStride - row.whole * m_Stack.rowStride - column.whole,
             m_View.mask ? slice * m_View.mask->sliceStride - row.whole * m_View.mask->rowStride - column.whole : 0,
             column.whole,
             row.whole,
             column.fraction,
             row.fraction,
             { row.whole + Larger<std::ptrdiff_t>(rows.begin, row.fraction != 0 || !m_Stack.rowEnds.first),
               row.whole + rows.end,
               column.whole + (column.fraction != 0 || !m_Stack.columnEnds.first),
               column.whole + m_Stack.columns } };
  }

  /** Half a voxel beyond the outer voxel centres, with the outer voxels' values. */
  void
  ProjectEdges(const PlacedSlice & slice, const RowSpan & rows) const
  {
    constexpr std::int32_t half = 1 << 14;
    const bool             edgeIsLastColumn = slice.x > half;
    const std::ptrdiff_t   edge = slice.column + (edgeIsLastColumn ? m_Stack.columns : 0);
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
    const bool edgeIsLastRow = slice.y > half;
    const bool hasRow = slice.y != 0 && (edgeIsLastRow ? m_Stack.rowEnds.last && rows.end == m_Stack.rows
                                                       : m_Stack.rowEnds.first && rows.begin == 0);
    if (hasRow)
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
      return this->TakeRankedEdgeSample(slice, row, voxelColumn, voxel, y, place);
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
                       std::ptrdiff_t      voxelColumn,
                       const TPixel *      voxel,
                       std::int32_t        y,
                       std::ptrdiff_t      place) const
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
      TakeSample<TRule>(SampleCounted(above, voxel, 0, 0, 0, y, counted),
                        GetRank(m_View.ranked, m_Slice),
                        m_View.intermediate.pixels[place],
                        m_View.ranked.ranks + place);
    }
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
                           m_Stack.sliceStride,
                           m_View.active || m_View.coverage.region ? nullptr : &prefetcher,
                           GetRank(m_View.ranked, m_Slice),
                           m_View.mask };
    if (rowEnd - rowBegin < BlockLength)
    {
      for (std::ptrdiff_t row = rowBegin; row < rowEnd; ++row)
      {
        this->ProjectTiles<1>(tiles, row, row);
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
        const std::ptrdiff_t next = isLongRun ? (n + 1) % length : n;
        prefetcher.ClearStreams();
        for (std::ptrdiff_t tile = firstTile + next; tile < lastTile; tile += length)
        {
          this->AddStream(prefetcher, index + isNextSlice, m_Grid + tile * BlockLength - slices->row);
        }
        this->StartFetching(prefetcher, BlockLength, steps * streams);
      }
      for (std::ptrdiff_t tile = firstTile + n; tile < lastTile; tile += length)
      {
        const std::ptrdiff_t row = m_Grid + tile * BlockLength;
        this->ProjectTiles<BlockLength>(tiles, row, Smaller(Larger(row, rowBegin), rowEnd - BlockLength));
      }
    }
  }

  /** The rows of a slice from \a row on, or next to it. */
  void
  AddStream(Prefetcher & prefetcher, std::ptrdiff_t slice, std::ptrdiff_t row) const
  {
    if (slice < m_Stack.slices && m_Stack.rows >= BlockLength)
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
  template <int VRows>
  void
  ProjectTiles(TileRow<TPixel> & tiles, std::ptrdiff_t gridRow, std::ptrdiff_t row) const
  {
    tiles.active = this->GetActiveTiles(gridRow);
    tiles.isMoved = row != gridRow;
    tiles.row = row;
    tiles.pixels = m_View.intermediate.pixels + row * m_View.intermediate.rowStride;
    tiles.ranks = m_View.ranked.ranks ? m_View.ranked.ranks + row * m_View.intermediate.rowStride : nullptr;
    if (m_View.coverage.region)
    {
      return this->ProjectRegion<VRows>(tiles);
    }
    this->ProjectTiles<VRows>(tiles);
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
  template <int VRows>
  void
  ProjectRegion(TileRow<TPixel> tiles) const
  {
    if (!this->IsInRegion({ tiles.row, tiles.row + VRows, tiles.begin, tiles.end }))
    {
      return;
    }
    const ColumnSpan all = GetColumns(tiles.begin, tiles.end);
    ColumnSpan       spans[VRows];
    ColumnSpan       common = all;
    ColumnSpan       any{ all.end, all.begin };
    for (int r = 0; r < VRows; ++r)
    {
      spans[r] = m_View.coverage.Add(all, tiles.row + r, m_Slice);
      common = { Larger(common.begin, spans[r].begin), Smaller(common.end, spans[r].end) };
      const bool isEmpty = spans[r].begin == spans[r].end;
      any = isEmpty ? any : ColumnSpan{ Smaller(any.begin, spans[r].begin), Larger(any.end, spans[r].end) };
    }
    tiles.spans = spans;
    tiles.any = any;
    tiles.common = common;
    this->ProjectTiles<VRows>(tiles);
  }

  template <int VRows>
  void
  ProjectTiles(const TileRow<TPixel> & tiles) const
  {
    constexpr bool mayBeWide = sizeof(TPixel) == 2;
    if (tiles.ranks)
    {
      return m_IsWide ? ProjectTileRow<TRule, TPixel, mayBeWide, VRows, true>(tiles)
                      : ProjectTileRow<TRule, TPixel, false, VRows, true>(tiles);
    }
    return m_IsWide ? ProjectTileRow<TRule, TPixel, mayBeWide, VRows, false>(tiles)
                    : ProjectTileRow<TRule, TPixel, false, VRows, false>(tiles);
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
  const bool areTogether = block.hasCommonRows && !views->active && !views->coverage.region && !views->ranked.ranks;
  const std::ptrdiff_t length = areTogether ? BlockProjector<MaximumRule<TPixel>, TPixel>::MaximumSlices : 1;
  for (std::ptrdiff_t slice = block.sliceBegin, end = slice; slice < block.sliceEnd; slice = end)
  {
    end = Smaller(slice + length, block.sliceEnd);
    for (std::size_t n = 0; n < count; ++n)
    {
      const auto index = static_cast<std::ptrdiff_t>(n);
      const auto total = static_cast<std::ptrdiff_t>(count);
      if (views[n].isMinimum)
      {
        BlockProjector<MinimumRule<TPixel>, TPixel>(slices, block, views[n], index, total).Project(slice, end);
      }
      else
      {
        BlockProjector<MaximumRule<TPixel>, TPixel>(slices, block, views[n], index, total).Project(slice, end);
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

template <typename TPixel>
void
FindBlockExtrema(const TPixel * voxels,
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
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  constexpr std::ptrdiff_t strip = 4096;
  for (std::ptrdiff_t begin = 0; begin < columns; begin += strip)
  {
    const std::ptrdiff_t width = Smaller(strip, columns - begin);
    if (width < lanes)
    {
      GetPortableKernels<TPixel>().findBlockExtrema(voxels + begin,
                                                    width,
                                                    rows,
                                                    slices,
                                                    rowStride,
                                                    sliceStride,
                                                    maxima + begin / BlockLength,
                                                    minima ? minima + begin / BlockLength : nullptr,
                                                    lowest,
                                                    highest);
      continue;
    }
    TPixel columnMaxima[strip];
    TPixel columnMinima[strip];
    for (std::ptrdiff_t i = 0; i < width; ++i)
    {
      columnMaxima[i] = MaximumRule<TPixel>::Start;
      columnMinima[i] = MinimumRule<TPixel>::Start;
    }
    auto least = Lanes::Load(columnMinima);
    for (std::ptrdiff_t k = 0; k < slices; ++k)
    {
      for (std::ptrdiff_t j = 0; j < rows; ++j)
      {
        const TPixel * row = voxels + k * sliceStride + j * rowStride + begin;
        for (std::ptrdiff_t first = 0; first < width; first += lanes)
        {
          const std::ptrdiff_t i = Smaller(first, width - lanes);
          const auto           values = Lanes::Load(row + i);
          Lanes::Store(columnMaxima + i, Maximum<TPixel>(Lanes::Load(columnMaxima + i), values));
          least = Minimum<TPixel>(least, values);
          if (minima)
          {
            Lanes::Store(columnMinima + i, Minimum<TPixel>(Lanes::Load(columnMinima + i), values));
          }
        }
      }
    }
    for (std::ptrdiff_t i = 0; i < width; i += BlockLength)
    {
      TPixel maximum = columnMaxima[i];
      TPixel minimum = columnMinima[i];
      for (std::ptrdiff_t n = i + 1; n < Smaller(i + BlockLength, width); ++n)
      {
        maximum = Larger(maximum, columnMaxima[n]);
        minimum = Smaller(minimum, columnMinima[n]);
      }
      maxima[(begin + i) / BlockLength] = maximum;
      highest = Larger(highest, maximum);
      if (minima)
      {
        minima[(begin + i) / BlockLength] = minimum;
      }
    }
    Lanes::Store(columnMinima, least);
    for (std::ptrdiff_t i = 0; i < lanes; ++i)
    {
      lowest = Smaller(lowest, columnMinima[i]);
    }
  }
}

/** The four corners' weights and values of a few pixels: rows a and b, left and right. */
struct WarpCell
{
  Lanes::Index   aaWeights, abWeights, baWeights, bbWeights;
  Lanes::Index   index;
  std::ptrdiff_t rowStride;
};

/** Interpolates between integers; all corners count. */
template <typename TPixel>
bool
Interpolate(const WarpCell & cell, const TPixel * pixels, TPixel * output)
{
  // two neighbours come in one 32-bit element
  constexpr int bits = 8 * sizeof(TPixel);
  const auto    extract = [](Lanes::Index pair, int position) {
    const auto shifted = Lanes::ShiftLeft(pair, 32 - bits - position);
    return static_cast<TPixel>(-1) > 0 ? Lanes::ShiftRightLogical(shifted, 32 - bits)
                                          : Lanes::ShiftRight(shifted, 32 - bits);
  };
  const Lanes::Index upper = Lanes::template Gather<sizeof(TPixel)>(pixels, cell.index);
  const Lanes::Index lower = Lanes::template Gather<sizeof(TPixel)>(pixels + cell.rowStride, cell.index);
  Lanes::Index       sum = Lanes::SetIndex(1 << 14);
  sum = Lanes::AddIndex(sum, Lanes::MultiplyIndex(cell.bbWeights, extract(upper, 0)));
  sum = Lanes::AddIndex(sum, Lanes::MultiplyIndex(cell.baWeights, extract(upper, bits)));
  sum = Lanes::AddIndex(sum, Lanes::MultiplyIndex(cell.abWeights, extract(lower, 0)));
  sum = Lanes::AddIndex(sum, Lanes::MultiplyIndex(cell.aaWeights, extract(lower, bits)));
  Lanes::StoreLow(output, Lanes::ShiftRight(sum, 15));
  return true;
}

/** Interpolates between finite values; false, and no output, if one is not. */
inline bool
Interpolate(const WarpCell & cell, const float * pixels, float * output)
{
  const Lanes::Single values[4] = { Lanes::GatherSingle(pixels, cell.index),
                                    Lanes::GatherSingle(pixels + 1, cell.index),
                                    Lanes::GatherSingle(pixels + cell.rowStride, cell.index),
                                    Lanes::GatherSingle(pixels + cell.rowStride + 1, cell.index) };
  const Lanes::Index  weights[4] = { cell.bbWeights, cell.baWeights, cell.abWeights, cell.aaWeights };
  Lanes::Double       mean = Lanes::SetDouble(0.0);
  Lanes::Single       lowest = Lanes::SetSingle(__builtin_inff());
  Lanes::Single       highest = Lanes::SetSingle(-__builtin_inff());
  for (int corner = 0; corner < 4; ++corner)
  {
    if (!Lanes::AreFinite(values[corner]))
    {
      return false;
    }
    mean = Lanes::AddDouble(
      mean, Lanes::MultiplyDouble(Lanes::IndexToDouble(weights[corner]), Lanes::SingleToDouble(values[corner])));
    lowest = Lanes::SelectWhereZero(weights[corner], lowest, Lanes::MinimumSingle(values[corner], lowest));
    highest = Lanes::SelectWhereZero(weights[corner], highest, Lanes::MaximumSingle(values[corner], highest));
  }
  const Lanes::Single rounded = Lanes::DoubleToSingle(Lanes::MultiplyDouble(mean, Lanes::SetDouble(1.0 / 32768)));
  Lanes::StoreSingle(output, Lanes::MinimumSingle(highest, Lanes::MaximumSingle(lowest, rounded)));
  return true;
}

/** Which of columns [begin, end) of rows [rowBegin, rowEnd) slices reach. */
struct Reach
{
  bool any, all;
};

template <typename TPixel>
Reach
FindReach(const IntermediateImage<TPixel> & image,
          std::ptrdiff_t                    rowBegin,
          std::ptrdiff_t                    rowEnd,
          std::ptrdiff_t                    begin,
          std::ptrdiff_t                    end)
{
  Reach reach{ false, true };
  for (std::ptrdiff_t row = rowBegin; row < rowEnd; ++row)
  {
    const ColumnSpan reached = image.reached[row];
    reach.any = reach.any || (begin < reached.end && end > reached.begin);
    reach.all = reach.all && begin >= reached.begin && end <= reached.end;
  }
  return reach;
}

inline double
Magnitude(double value)
{
  return value < 0 ? -value : value;
}

/** Narrows [begin, end) to the integers x where lowest < slope x + offset < highest, and at most two more on each side.
 */
inline void
Clip(double slope, double offset, double lowest, double highest, std::ptrdiff_t & begin, std::ptrdiff_t & end)
{
  // of a zero too: infinities come from it, with its sign
  if (__builtin_signbit(slope))
  {
    return Clip(-slope, -offset, -highest, -lowest, begin, end);
  }
  const double first = (lowest - offset) / slope - 1;
  const double last = (highest - offset) / slope + 2;
  const auto   from = static_cast<double>(begin);
  const auto   to = static_cast<double>(end);
  // false for what is not a number, and then nothing is cut off
  begin = first > from ? static_cast<std::ptrdiff_t>(Smaller(first, to)) : begin;
  end = last < to ? static_cast<std::ptrdiff_t>(Larger(last, from)) : end;
  end = Larger(begin, end);
}

template <typename TPixel>
void
WarpRow(const IntermediateImage<TPixel> & intermediate,
        const AffineMap2D &               outputToIntermediate,
        std::ptrdiff_t                    row,
        std::ptrdiff_t                    columnBegin,
        std::ptrdiff_t                    columnEnd,
        TPixel                            background,
        TPixel *                          output)
{
  const auto &             map = outputToIntermediate;
  constexpr std::ptrdiff_t lanes = Lanes::WarpCount;
  constexpr std::ptrdiff_t read = IsFloat<TPixel> ? 2 : 4 / sizeof(TPixel);
  const auto               portable = GetPortableKernels<TPixel>().warpRow;
  constexpr std::ptrdiff_t limit = 65535;
  if (intermediate.hasGaps || intermediate.columns > limit || intermediate.rows > limit ||
      intermediate.rows * intermediate.rowStride > 2147483647)
  {
    return portable(intermediate, map, row, columnBegin, columnEnd, background, output);
  }

  // the same operations in the same order as for one pixel
  const auto          y = static_cast<double>(row);
  const Lanes::Double columnFromRow = Lanes::SetDouble(map.xy * y);
  const Lanes::Double rowFromRow = Lanes::SetDouble(map.yy * y);
  const auto          quantize = [](Lanes::Double position) {
    return Lanes::DoubleToIndex(Lanes::Floor(
      Lanes::AddDouble(Lanes::MultiplyDouble(position, Lanes::SetDouble(32768.0)), Lanes::SetDouble(0.5))));
  };
  std::ptrdiff_t begin = columnBegin;
  std::ptrdiff_t end = columnEnd;
  const auto     clip = [&](double slope, double fromRow, double offset, std::ptrdiff_t pixels) {
    // the terms of a position may cancel: what is left is then rounding
    const double size = Magnitude(slope) * static_cast<double>(columnEnd) + Magnitude(fromRow) + Magnitude(offset);
    const double error = 0x1p-50 * size;
    Clip(slope, fromRow + offset, -1.0 - error, static_cast<double>(pixels) + error, begin, end);
  };
  clip(map.xx, map.xy * y, map.x0, intermediate.columns);
  clip(map.yx, map.yy * y, map.y0, intermediate.rows);
  for (std::ptrdiff_t x = columnBegin; x < begin; ++x)
  {
    output[x] = background;
  }
  for (std::ptrdiff_t x = end; x < columnEnd; ++x)
  {
    output[x] = background;
  }
  std::ptrdiff_t x = begin;
  for (; x + lanes <= end; x += lanes)
  {
    const Lanes::Double xs = Lanes::Count(static_cast<double>(x));
    const Lanes::Double columns = Lanes::AddDouble(
      Lanes::AddDouble(Lanes::MultiplyDouble(Lanes::SetDouble(map.xx), xs), columnFromRow), Lanes::SetDouble(map.x0));
    const Lanes::Double rows = Lanes::AddDouble(
      Lanes::AddDouble(Lanes::MultiplyDouble(Lanes::SetDouble(map.yx), xs), rowFromRow), Lanes::SetDouble(map.y0));
    const auto isWithin = Lanes::AreWithin(columns, 0.0, static_cast<double>(intermediate.columns - 1)) &&
                          Lanes::AreWithin(rows, 0.0, static_cast<double>(intermediate.rows - 1));
    bool isDone = false;
    if (isWithin)
    {
      const Lanes::Index column = quantize(columns);
      const Lanes::Index wholeColumn = Lanes::ShiftRight(column, 15);
      const Lanes::Index line = quantize(rows);
      const Lanes::Index wholeRow = Lanes::ShiftRight(line, 15);
      // positions lie on a line: the outer ones are the extremes
      const std::ptrdiff_t first = Smaller(Lanes::First(wholeColumn), Lanes::Last(wholeColumn));
      const std::ptrdiff_t last = Larger(Lanes::First(wholeColumn), Lanes::Last(wholeColumn));
      const std::ptrdiff_t rowBegin = Smaller(Lanes::First(wholeRow), Lanes::Last(wholeRow));
      const std::ptrdiff_t rowEnd = Larger(Lanes::First(wholeRow), Lanes::Last(wholeRow)) + 2;
      const Reach          reach =
        rowEnd <= intermediate.rows ? FindReach(intermediate, rowBegin, rowEnd, first, last + 2) : Reach{ true, false };
      if (last + read <= intermediate.columns && reach.all)
      {
        const Lanes::Index fraction = Lanes::SetIndex(32767);
        const Lanes::Index u = Lanes::AndIndex(column, fraction);
        const Lanes::Index v = Lanes::AndIndex(line, fraction);
        WarpCell           cell;
        cell.aaWeights = Lanes::ShiftRight(Lanes::AddIndex(Lanes::MultiplyIndex(u, v), Lanes::SetIndex(1 << 14)), 15);
        cell.abWeights = Lanes::SubtractIndex(v, cell.aaWeights);
        cell.baWeights = Lanes::SubtractIndex(u, cell.aaWeights);
        cell.bbWeights = Lanes::SubtractIndex(Lanes::SetIndex(32768), Lanes::AddIndex(v, cell.baWeights));
        cell.rowStride = intermediate.rowStride;
        cell.index = Lanes::AddIndex(
          Lanes::MultiplyIndex(wholeRow, Lanes::SetIndex(static_cast<std::int32_t>(cell.rowStride))), wholeColumn);
        isDone = Interpolate(cell, static_cast<const TPixel *>(intermediate.pixels), output + x);
      }
      else if (!reach.any)
      {
        for (std::ptrdiff_t n = x; n < x + lanes; ++n)
        {
          output[n] = background;
        }
        isDone = true;
      }
    }
    if (!isDone)
    {
      portable(intermediate, map, row, x, x + lanes, background, output);
    }
  }
  portable(intermediate, map, row, x, end, background, output);
}

/** Interleaves the elements of the first half of the vectors with those of the second: that moves the highest bit of an
 * element's vector to the lowest of its position, so that doing it for every bit transposes. */
template <typename TPixel, int VCount>
SHEARWARP_INLINE inline void
InterleaveHalves(Lanes::Quad (&vectors)[VCount])
{
  Lanes::Quad interleaved[VCount];
  SHEARWARP_UNROLL
  for (int n = 0; n < VCount / 2; ++n)
  {
    interleaved[2 * n] = Lanes::InterleaveQuadLow(vectors[n], vectors[n + VCount / 2], TPixel{});
    interleaved[2 * n + 1] = Lanes::InterleaveQuadHigh(vectors[n], vectors[n + VCount / 2], TPixel{});
  }
  SHEARWARP_UNROLL
  for (int n = 0; n < VCount; ++n)
  {
    vectors[n] = interleaved[n];
  }
}

template <typename TPixel>
void
TransposeSlice(const TPixel * input, std::ptrdiff_t columns, std::ptrdiff_t rows, TPixel * output, bool isStreamed)
{
  // squares of a cache line's width, in smaller ones that fit in 128-bit vectors
  constexpr std::ptrdiff_t square = 64 / sizeof(TPixel);
  constexpr int            small = 16 / sizeof(TPixel);
  isStreamed = isStreamed && reinterpret_cast<std::uintptr_t>(output) % 64 == 0 && rows % square == 0;
  constexpr std::ptrdiff_t ahead = (1 << 15) / sizeof(TPixel);
  for (std::ptrdiff_t j = 0; j < rows; j += square)
  {
    for (std::ptrdiff_t i = 0; i < columns; i += square)
    {
      if (j + square > rows || i + square > columns)
      {
        for (std::ptrdiff_t column = i; column < Smaller(i + square, columns); ++column)
        {
          for (std::ptrdiff_t row = j; row < Smaller(j + square, rows); ++row)
          {
            output[column * rows + row] = input[row * columns + column];
          }
        }
        continue;
      }
      // as many lines as a square has, in the order of memory, not of squares
      for (std::ptrdiff_t line = 0; line < square; ++line)
      {
        Lanes::PrefetchFar(reinterpret_cast<const char *>(input + j * columns + (i + line) * square + ahead));
      }
      alignas(64) TPixel lines[square][square];
      for (std::ptrdiff_t column = 0; column < square; column += small)
      {
        for (std::ptrdiff_t row = 0; row < square; row += small)
        {
          Lanes::Quad vectors[small];
          SHEARWARP_UNROLL
          for (int n = 0; n < small; ++n)
          {
            vectors[n] = Lanes::LoadQuad(input + (j + row + n) * columns + i + column);
          }
          InterleaveHalves<TPixel>(vectors);
          InterleaveHalves<TPixel>(vectors);
          if constexpr (small > 4)
          {
            InterleaveHalves<TPixel>(vectors);
          }
          if constexpr (small > 8)
          {
            InterleaveHalves<TPixel>(vectors);
          }
          SHEARWARP_UNROLL
          for (int n = 0; n < small; ++n)
          {
            Lanes::StoreQuad(&lines[column + n][row], vectors[n]);
          }
        }
      }
      for (std::ptrdiff_t column = 0; column < square; ++column)
      {
        Lanes::StoreLine(output + (i + column) * rows + j, lines[column], isStreamed);
      }
    }
  }
  Lanes::FinishLines();
}

/** Short integers and float, in plain loops that compilers make vectors of. */
template <typename TPixel>
void
SampleRow(const SliceRow<TPixel> & row, ColumnSpan span, TPixel * samples)
{
  const std::int32_t columns = static_cast<std::int32_t>(row.columns);
  const std::int32_t x = row.column.fraction;
  const std::int32_t y = row.y;
  const std::int32_t begin = Larger(span.begin, row.column.whole + 1);
  const std::int32_t count = Smaller(span.end, row.column.whole + columns) - begin;
  const bool         edgeIsLast = x > 1 << 14;
  const std::int32_t edge = row.column.whole + (edgeIsLast ? columns : 0);
  if (edge >= span.begin && edge < span.end)
  {
    const TPixel a = row.a[edgeIsLast ? columns - 1 : 0];
    const TPixel b = row.b[edgeIsLast ? columns - 1 : 0];
    if constexpr (IsFloat<TPixel>)
    {
      samples[edge] = y == 0 ? b : b + static_cast<float>(y) / 32768 * (a - b);
    }
    else
    {
      samples[edge] = static_cast<TPixel>((y * a + (32768 - y) * b + (1 << 14)) >> 15);
    }
  }
  if (count <= 0)
  {
    return;
  }

  const TPixel * __restrict a = row.a + (begin - row.column.whole);
  const TPixel * __restrict b = row.b + (begin - row.column.whole);
  TPixel * __restrict output = samples + begin;
  if (x == 0 && y == 0)
  {
    for (std::int32_t n = 0; n < count; ++n)
    {
      output[n] = b[n];
    }
  }
  else if constexpr (IsFloat<TPixel>)
  {
    // a voxel of weight zero takes no part, not even one that is not finite
    const float weightX = static_cast<float>(x) / 32768;
    const float weightY = static_cast<float>(y) / 32768;
    if (y == 0)
    {
      for (std::int32_t n = 0; n < count; ++n)
      {
        output[n] = b[n] + weightX * (b[n - 1] - b[n]);
      }
    }
    else if (x == 0)
    {
      for (std::int32_t n = 0; n < count; ++n)
      {
        output[n] = b[n] + weightY * (a[n] - b[n]);
      }
    }
    else
    {
      for (std::int32_t n = 0; n < count; ++n)
      {
        const float above = a[n] + weightX * (a[n - 1] - a[n]);
        const float below = b[n] + weightX * (b[n - 1] - b[n]);
        output[n] = below + weightY * (above - below);
      }
    }
  }
  else
  {
    const std::int32_t aa = (x * y + (1 << 14)) >> 15;
    const std::int32_t ab = y - aa;
    const std::int32_t ba = x - aa;
    const std::int32_t bb = 32768 - y - ba;
    for (std::int32_t n = 0; n < count; ++n)
    {
      output[n] = static_cast<TPixel>((aa * a[n - 1] + ab * a[n] + ba * b[n - 1] + bb * b[n] + (1 << 14)) >> 15);
    }
  }
}

template <typename TPixel>
constexpr Kernels<TPixel> VectorKernels{ Lanes::Name,
                                         ProjectBlock<TPixel>,
                                         IsAnyBelow<TPixel>,
                                         FindBlockExtrema<TPixel>,
                                         WarpRow<TPixel>,
                                         TransposeSlice<TPixel>,
                                         SampleRow<TPixel>,
                                         FadeRow<TPixel>,
                                         RayKernelsOf<MaximumRule<TPixel>, TPixel>,
                                         RayKernelsOf<MinimumRule<TPixel>, TPixel>,
                                         RayKernelsOf<AbsoluteMaximumRule<TPixel>, TPixel> };
