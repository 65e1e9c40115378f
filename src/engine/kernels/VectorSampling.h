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

/* Vectors of pixels, and the samples of a slice.
 * See Vector.h for what includes it. */

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
  else if constexpr (std::is_same_v<TRule, MagnitudeRule<TPixel>>)
  {
    return Lanes::LargerMagnitude(best, value);
  }
  else
  {
    return Maximum<TPixel>(best, value);
  }
}

/** \class Fractions
 * Which of a slice's fractions are not zero: a sample has one, two or four voxels. */
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
 * `inner`; the block may have those of an outer row beside them. */
struct PlacedSlice
{
  std::ptrdiff_t offset, maskOffset;
  std::ptrdiff_t column, row;
  std::int32_t   x, y;
  Rectangle      inner;
  bool           hasEdgeRow;

  Fractions
  GetFractions() const
  {
    return x == 0 ? (y == 0 ? Fractions::None : Fractions::Row) : (y == 0 ? Fractions::Column : Fractions::Both);
  }
};

class Prefetcher;

/** A row of tiles: columns [begin, end), at least LaneCount of them, that `count` slices have in common, of `rows` rows
 * from `row` on: 1 or BlockLength. `spans`, if not null, are the columns to take of each row; `any` has all of them,
 * and each has `common`.
 */
template <typename TPixel>
struct TileRow
{
  const TPixel *            voxels;
  std::ptrdiff_t            rowStride;
  const PlacedSlice *       slices;
  std::ptrdiff_t            count;
  std::ptrdiff_t            row, begin, end;
  TPixel *                  pixels;
  std::ptrdiff_t            pixelStride;
  const TileState *         active;
  std::ptrdiff_t            nextSlice;  // distance in voxels
  Prefetcher *              prefetcher; // null where tiles fetch their own place in the next slice
  SliceRank<TPixel>         rank;       // of the one slice
  const Mask *              mask;
  const TPixel *            localThreshold;
  int                       rows{ BlockLength };
  bool                      isMoved{ false }; // so that it has rows of other tiles, whose states `active` does not tell
  SliceRank<TPixel> *       ranks{ nullptr };
  const FadingRow<TPixel> * fades{ nullptr }; // of each row
  const ColumnSpan *        spans{ nullptr };
  ColumnSpan                any{}, common{};

  /** Whether some row's span has not all of the LaneCount pixels from \a column on. */
  bool
  IsCut(std::ptrdiff_t column) const
  {
    return spans && !(common.begin <= column && column + LaneCount<TPixel> <= common.end);
  }
};

/** \class LinearSampler
 * The samples of a slice in a tile, row by row, of one or two short integers whose difference fits in 16 bits: linear
 * interpolation is b + ((a - b) x + 2^14 >> 15). */
template <typename TPixel, Fractions VFractions>
class LinearSampler
{
public:
  using Sample = Lanes::Short;

  /** As many rows as have registers. */
  static constexpr int MaximumRows = BlockLength;

  /** \a b are the first row's lower voxels. */
  SHEARWARP_INLINE
  LinearSampler(const PlacedSlice & slice, const TPixel * b, std::ptrdiff_t stride)
    : m_Weight(Lanes::Set(VFractions == Fractions::Column ? slice.x : slice.y))
    , m_Above(VFractions == Fractions::Row ? Lanes::Load(b - stride) : m_Weight)
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

  /** The samples of the next row; \a b are its lower voxels. */
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
 * The samples of a slice in a tile, row by row, of short integers: weighted sums. VFlipSign if unsigned ones
 * need all 16 bits. */
template <typename TPixel, Fractions VFractions, bool VFlipSign>
class SumSampler
{
public:
  using Short = Lanes::Short;
  using Int = Lanes::Int;

  /** Two halves of weighted sums, 2^14 added. */
  using Sample = Lanes::Sums;

  static constexpr int MaximumRows = Lanes::SumRows;

  /** \a b are the first row's lower voxels. */
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
    const Short packed = VFractions == Fractions::Row ? Lanes::PackRows(sample) : Lanes::PackColumns(sample);
    return VFlipSign ? Lanes::FlipSign(packed) : packed;
  }

  /** The samples of the next row; \a b are its lower voxels. */
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
 * The samples of a slice in a tile, row by row, of floats. */
template <Fractions VFractions>
class FloatSampler
{
public:
  using Sample = Lanes::Float;

  static constexpr int MaximumRows = BlockLength;

  /** \a b are the first row's lower voxels. */
  SHEARWARP_INLINE
  FloatSampler(const PlacedSlice & slice, const float * b, std::ptrdiff_t stride)
    : m_X(Lanes::SetFloat(static_cast<float>(slice.x) / 32768))
    , m_Y(Lanes::SetFloat(static_cast<float>(slice.y) / 32768))
    , m_Above(IsBetweenRows ? this->InterpolateColumns(b - stride) : m_X)
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

  /** The samples of the next row; \a b are its lower voxels. */
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
/** \a VWide if voxels, or their differences, need more than 15 bits and a sign. */
template <typename TPixel, Fractions VFractions, bool VWide>
using Sampler =
  typename SamplerOf<!IsFloat<TPixel> && (VFractions == Fractions::None || (!VWide && VFractions != Fractions::Both)),
                     TPixel,
                     VFractions,
                     VWide>::Type;

#endif
