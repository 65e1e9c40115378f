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
#ifndef itkShearWarpVectorSampling_h
#define itkShearWarpVectorSampling_h

/* Vectors of pixels, and the samples of a slice. Vector.h includes this header. */

template <typename TPixel>
constexpr bool IsUnsignedShort = sizeof(TPixel) == 2 && static_cast<TPixel>(-1) > 0;

template <typename TPixel>
constexpr std::ptrdiff_t LaneCount = IsFloat<TPixel> ? Lanes::FloatCount : Lanes::ShortCount;

/** LaneCount pixels. */
template <typename TPixel>
using LanesOf = std::conditional_t<IsFloat<TPixel>, Lanes::Float, Lanes::Short>;

/** Returns the larger of two pixels, or \a maximum if \a value is not a number. Pixels of 8 bits have lanes of 16 bits.
 */
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

/** Returns the smaller of two pixels, or \a minimum if \a value is not a number. */
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

template <Extremum VExtremum, typename TPixel, typename TVector>
TVector
Better(TVector best, TVector value)
{
  switch (VExtremum)
  {
    case Extremum::Maximum:
      return Maximum<TPixel>(best, value);
    case Extremum::Minimum:
      return Minimum<TPixel>(best, value);
  }
  return best;
}

/** \class Fractions
 * Along which axes a slice has a fraction: a sample has one, two or four voxels. */
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

/** A slice and its place in the intermediate image. Pixel (p, q) is sampled between voxels (p - 1, q - 1) and (p, q),
 * counted from `offset`. */
struct PlacedSlice
{
  std::ptrdiff_t offset, maskOffset; // of pixel (0, 0) in the volume and in the mask
  std::ptrdiff_t column, row;        // of voxel (0, 0) in the intermediate image
  std::int32_t   x, y;               // the fractions
  Rectangle      inner;              // samples of the block with all voxels in the slice
  bool           hasEdgeRow;         // whether the block has the samples of an outer row

  Fractions
  GetFractions() const
  {
    return x == 0 ? (y == 0 ? Fractions::None : Fractions::Row) : (y == 0 ? Fractions::Column : Fractions::Both);
  }
};

class Prefetcher;

/** A row of tiles: columns [begin, end), at least LaneCount, that `count` slices have in common. */
template <typename TPixel>
struct TileRow
{
  const TPixel *      voxels{ nullptr };
  std::ptrdiff_t      rowStride{ 0 };
  const PlacedSlice * slices{ nullptr };
  std::ptrdiff_t      count{ 0 };
  std::ptrdiff_t      nextSlice{ 0 };        // distance in voxels
  Prefetcher *        prefetcher{ nullptr }; // if null, each tile fetches its voxels of the next slice

  std::ptrdiff_t row{ 0 }, begin{ 0 }, end{ 0 };
  int            rows{ BlockLength }; // 1 or BlockLength; for sums, any number up to it

  Extremum            extremum{ Extremum::Maximum };
  TPixel *            pixels{ nullptr };
  SliceRank<TPixel> * ranks{ nullptr };
  std::ptrdiff_t      pixelStride{ 0 };
  SliceRank<TPixel>   rank{ 0 }; // of the slice, if there is only one
  SampleSum<TPixel> * sums{ nullptr };
  std::uint32_t *     countSteps{ nullptr };

  const TileState *         active{ nullptr };
  bool                      isMoved{ false }; // `active` does not tell the states of all rows
  const Mask *              mask{ nullptr };
  const TPixel *            localThreshold{ nullptr };
  const FadingRow<TPixel> * fades{ nullptr }; // of each row

  const ColumnSpan * spans{ nullptr }; // columns that each row takes; null for all
  ColumnSpan         any{}, common{};  // columns that one row takes, and columns that every row takes

  /** Whether some row does not take all LaneCount pixels from \a column on. */
  bool
  IsCut(std::ptrdiff_t column) const
  {
    return spans && !(common.begin <= column && column + LaneCount<TPixel> <= common.end);
  }
};

/** \class LinearSampler
 * The samples of a slice in a tile, row by row. A sample has one voxel, or two whose difference has at most 16 bits:
 * then linear interpolation is b + ((a - b) x + 2^14 >> 15). */
template <typename TPixel, Fractions VFractions>
class LinearSampler
{
public:
  using Sample = Lanes::Short;

  /** More rows would need more registers than there are. */
  static constexpr int MaximumRows = BlockLength;

  /** \a b points to the lower voxels of the first row. */
  SHEARWARP_INLINE
  LinearSampler(const PlacedSlice & slice, const TPixel * b, std::ptrdiff_t stride)
    : m_Weight(Lanes::Set(VFractions == Fractions::Column ? slice.x : slice.y))
    , m_Above(VFractions == Fractions::Row ? Lanes::Load(b - stride) : m_Weight)
  {}

  template <Extremum VExtremum>
  static Sample
  GetStart()
  {
    return Lanes::Set(NoSample<TPixel, VExtremum>);
  }

  template <Extremum VExtremum>
  static Sample
  GetBetter(Sample a, Sample b)
  {
    return Better<VExtremum, TPixel>(a, b);
  }

  static Sample
  Finish(Sample sample)
  {
    return sample;
  }

  /** Returns the samples of the next row. \a b points to the lower voxels. */
  SHEARWARP_INLINE Sample
  Next(const TPixel * b)
  {
    const Sample voxel = Lanes::Load(b);
    if constexpr (VFractions == Fractions::None)
    {
      return voxel;
    }
    else if constexpr (VFractions == Fractions::Column)
    {
      return this->Interpolate(Lanes::Load(b - 1), voxel);
    }
    else
    {
      const Sample sample = this->Interpolate(m_Above, voxel);
      m_Above = voxel;
      return sample;
    }
  }

private:
  Sample
  Interpolate(Sample a, Sample b) const
  {
    return Lanes::Add(b, Lanes::MultiplyHighRounded(Lanes::Subtract(a, b), m_Weight));
  }

  Sample m_Weight;
  Sample m_Above;
};

/** \class SumSampler
 * The samples of a slice in a tile, row by row, as weighted sums of short integers. VFlipSign is for unsigned integers
 * that need all 16 bits. */
template <typename TPixel, Fractions VFractions, bool VFlipSign>
class SumSampler
{
public:
  using Short = Lanes::Short;
  using Int = Lanes::Int;

  /** The weighted sums plus 2^14, in two halves. */
  using Sample = Lanes::Sums;

  static constexpr int MaximumRows = Lanes::SumRows;

  /** \a b points to the lower voxels of the first row. */
  SHEARWARP_INLINE
  SumSampler(const PlacedSlice & slice, const TPixel * b, std::ptrdiff_t stride)
    : SumSampler(slice.x, slice.y, (slice.x * slice.y + (1 << 14)) >> 15)
  {
    if constexpr (VFractions == Fractions::Row || VFractions == Fractions::Both)
    {
      m_Above = Load(b - stride);
    }
    if constexpr (VFractions == Fractions::Both)
    {
      m_LeftAbove = Load(b - stride - 1);
    }
  }

  template <Extremum VExtremum>
  static Sample
  GetStart()
  {
    // no sum is worse
    constexpr int beyond = 1 << 30;
    const Int     start = Lanes::SetInt(VExtremum == Extremum::Maximum ? -beyond : beyond);
    return { start, start };
  }

  template <Extremum VExtremum>
  static Sample
  GetBetter(Sample a, Sample b)
  {
    switch (VExtremum)
    {
      case Extremum::Maximum:
        return { Lanes::MaximumInt(a.low, b.low), Lanes::MaximumInt(a.high, b.high) };
      case Extremum::Minimum:
        return { Lanes::MinimumInt(a.low, b.low), Lanes::MinimumInt(a.high, b.high) };
    }
    return a;
  }

  /** Rounds. Rounding is monotonic, so an extremum of many sums is rounded only once. */
  static Short
  Finish(Sample sample)
  {
    const Short packed = VFractions == Fractions::Row ? Lanes::PackRows(sample) : Lanes::PackColumns(sample);
    return VFlipSign ? Lanes::FlipSign(packed) : packed;
  }

  /** Returns the samples of the next row. \a b points to the lower voxels. */
  SHEARWARP_INLINE Sample
  Next(const TPixel * b)
  {
    const Sample half{ Lanes::SetInt(1 << 14), Lanes::SetInt(1 << 14) };
    const Short  voxel = Load(b);
    const Short  above = m_Above;
    m_Above = voxel;
    if constexpr (VFractions == Fractions::Row)
    {
      return Lanes::AddRows(half, above, voxel, m_Weights);
    }
    else if constexpr (VFractions == Fractions::Column)
    {
      return Lanes::AddColumns(half, Load(b - 1), voxel, m_Weights);
    }
    else
    {
      const Short  left = Load(b - 1);
      const Sample sumAbove = Lanes::AddColumns(half, m_LeftAbove, above, m_WeightsAbove);
      m_LeftAbove = left;
      return Lanes::AddColumns(sumAbove, left, voxel, m_Weights);
    }
  }

private:
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
    return VFlipSign ? Lanes::FlipSign(loaded) : loaded;
  }

  Short m_WeightsAbove;
  Short m_Weights;
  Short m_Above{}, m_LeftAbove{};
};

/** \class FloatSampler
 * The samples of a slice of floats in a tile, row by row. */
template <Fractions VFractions>
class FloatSampler
{
public:
  using Sample = Lanes::Float;

  static constexpr int MaximumRows = BlockLength;

  /** \a b points to the lower voxels of the first row. */
  SHEARWARP_INLINE
  FloatSampler(const PlacedSlice & slice, const float * b, std::ptrdiff_t stride)
    : m_X(Lanes::SetFloat(static_cast<float>(slice.x) / 32768))
    , m_Y(Lanes::SetFloat(static_cast<float>(slice.y) / 32768))
    , m_Above(IsBetweenRows ? this->InterpolateColumns(b - stride) : m_X)
  {}

  template <Extremum VExtremum>
  static Sample
  GetStart()
  {
    return Lanes::SetFloat(NoSample<float, VExtremum>);
  }

  template <Extremum VExtremum>
  static Sample
  GetBetter(Sample a, Sample b)
  {
    return Better<VExtremum, float>(a, b);
  }

  static Sample
  Finish(Sample sample)
  {
    return sample;
  }

  /** Returns the samples of the next row. \a b points to the lower voxels. */
  SHEARWARP_INLINE Sample
  Next(const float * b)
  {
    const Sample row = this->InterpolateColumns(b);
    const Sample sample = IsBetweenRows ? Interpolate(m_Above, row, m_Y) : row;
    m_Above = row;
    return sample;
  }

private:
  static constexpr bool IsBetweenRows = VFractions == Fractions::Row || VFractions == Fractions::Both;

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
  Sample m_Above;
};

template <bool VIsLinear, typename TPixel, Fractions VFractions, bool VWide>
struct SamplerOf
{
  using Type = SumSampler<TPixel, VFractions, VWide && IsUnsignedShort<TPixel>>;
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
/** VWide is for voxels that need more than 15 bits and a sign, or whose differences do. */
template <typename TPixel, Fractions VFractions, bool VWide>
using Sampler =
  typename SamplerOf<!IsFloat<TPixel> && (VFractions == Fractions::None || (!VWide && VFractions != Fractions::Both)),
                     TPixel,
                     VFractions,
                     VWide>::Type;

#endif
