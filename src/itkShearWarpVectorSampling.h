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
 * See itkShearWarpVectorKernels.h for what includes it. */

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

/** A row of tiles: columns [begin, end), at least LaneCount of them, that `count` slices have in common, of the rows
 * from `row` on. `spans`, if not null, are the columns to take of each row; `any` has all of them, and each has
 * `common`.
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
  bool                      isMoved{ false }; // so that it has rows of other tiles, whose states `active` does not tell
  SliceRank<TPixel> *       ranks{ nullptr };
  const FadingRow<TPixel> * fades{ nullptr }; // of each row
  const ColumnSpan *        spans{ nullptr };
  ColumnSpan                any{}, common{};
};

/** \class LinearSampler
 * The samples of a slice in a tile, of one or two short integers whose difference fits in 16 bits: linear
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

/** \class SumSampler
 * The samples of a slice in a tile, of short integers: weighted sums. Unsigned ones fit in 15 bits unless VWide. */
template <typename TPixel, Fractions VFractions, bool VWide>
class SumSampler
{
public:
  using Short = Lanes::Short;
  using Int = Lanes::Int;

  /** Two halves of weighted sums, 2^14 added. */
  using Sample = Lanes::Sums;

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
    const Short packed = VFractions == Fractions::Row ? Lanes::PackRows(sample) : Lanes::PackColumns(sample);
    return FlipSign ? Lanes::FlipSign(packed) : packed;
  }

  template <int VRows, typename TFunction>
  SHEARWARP_INLINE void
  ForEachRow(const TPixel * b, std::ptrdiff_t stride, const TFunction & process) const
  {
    const Sample half{ Lanes::SetInt(1 << 14), Lanes::SetInt(1 << 14) };
    if constexpr (VFractions == Fractions::Row)
    {
      Short above = Load(b - stride);
      SHEARWARP_UNROLL
      for (int r = 0; r < VRows; ++r, b += stride)
      {
        const Short voxel = Load(b);
        process(r, b, Lanes::AddRows(half, above, voxel, m_Weights));
        above = voxel;
      }
    }
    else if constexpr (VFractions == Fractions::Column)
    {
      SHEARWARP_UNROLL
      for (int r = 0; r < VRows; ++r, b += stride)
      {
        process(r, b, Lanes::AddColumns(half, Load(b - 1), Load(b), m_Weights));
      }
    }
    else
    {
      Short leftAbove = Load(b - stride - 1);
      Short rightAbove = Load(b - stride);
      SHEARWARP_UNROLL
      for (int r = 0; r < VRows; ++r, b += stride)
      {
        const Short  left = Load(b - 1);
        const Short  right = Load(b);
        const Sample above = Lanes::AddColumns(half, leftAbove, rightAbove, m_WeightsAbove);
        process(r, b, Lanes::AddColumns(above, left, right, m_Weights));
        leftAbove = left;
        rightAbove = right;
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

/** \class FloatSampler
 * The samples of a slice in a tile, of floats. */
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

#endif
