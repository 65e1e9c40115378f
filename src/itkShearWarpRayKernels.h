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
/* Included by each file of kernels, within its anonymous namespace, so that the linker cannot share what is compiled
 * here. For the same reason nothing here may call an inline function or a template of another header at run time. */

template <typename TPixel>
constexpr bool IsFloat = static_cast<TPixel>(0.5) != 0;

template <typename TPixel>
struct MaximumRule
{
  static constexpr TPixel Start = NoSample<TPixel>;
  // no sample that counts is as bad as the start
  static constexpr bool IsStartUnique = IsFloat<TPixel>;

  static bool
  IsBetter(TPixel sample, TPixel value)
  {
    return sample > value;
  }
  static bool
  IsWorse(TPixel sample, TPixel value)
  {
    return sample < value;
  }
};

template <typename TPixel>
struct MinimumRule
{
  static constexpr TPixel Start = std::numeric_limits<TPixel>::has_infinity ? std::numeric_limits<TPixel>::infinity()
                                                                            : std::numeric_limits<TPixel>::max();
  static constexpr bool   IsStartUnique = IsFloat<TPixel>;

  static bool
  IsBetter(TPixel sample, TPixel value)
  {
    return sample < value;
  }
  static bool
  IsWorse(TPixel sample, TPixel value)
  {
    return sample > value;
  }
};

template <typename TPixel>
struct AbsoluteMaximumRule
{
  static constexpr TPixel Start = 0;
  static constexpr bool   IsStartUnique = false;

  static bool
  IsBetter(TPixel sample, TPixel value)
  {
    const auto ofSample = GetMagnitude(sample);
    const auto ofValue = GetMagnitude(value);
    return (ofSample > ofValue) | ((ofSample == ofValue) & (sample > value));
  }
  static bool
  IsWorse(TPixel sample, TPixel value)
  {
    return GetMagnitude(sample) < GetMagnitude(value);
  }

private:
  static auto
  GetMagnitude(TPixel value)
  {
    if constexpr (IsFloat<TPixel>)
    {
      return value < 0 ? -value : value;
    }
    else
    {
      // that of the lowest integer has no sign
      using Unsigned = std::make_unsigned_t<TPixel>;
      const auto bits = static_cast<Unsigned>(value);
      return static_cast<Unsigned>(value < 0 ? 0 - bits : bits);
    }
  }
};

template <typename TPixel>
bool
IsNumber(TPixel value)
{
  if constexpr (IsFloat<TPixel>)
  {
    constexpr TPixel infinity = std::numeric_limits<TPixel>::infinity();
    return value <= infinity;
  }
  return true;
}

template <typename TPixel>
SliceRank<TPixel>
GetRank(const RankedImage<TPixel> & image, std::ptrdiff_t slice)
{
  return static_cast<SliceRank<TPixel>>(image.first + image.step * slice);
}

/** Which voxels of two rows around a sample are in a mask, as SampleCounted() has them; none if the nearest is not. */
inline unsigned int
FindCounted(const std::uint8_t * a,
            const std::uint8_t * b,
            std::uint8_t         label,
            std::ptrdiff_t       column,
            std::ptrdiff_t       before,
            std::int32_t         x,
            std::int32_t         y)
{
  const auto         isIn = [label](std::uint8_t mask) { return label == 0 ? mask != 0 : mask == label; };
  const unsigned int counted =
    static_cast<unsigned int>(isIn(b[column])) | static_cast<unsigned int>(isIn(b[before])) << 1 |
    static_cast<unsigned int>(isIn(a[column])) << 2 | static_cast<unsigned int>(isIn(a[before])) << 3;
  const int nearest = (x > One / 2 ? 1 : 0) + (y > One / 2 ? 2 : 0);
  return (counted >> nearest & 1U) != 0 ? counted : 0;
}

/** Gives a pixel a sample if that is better, or as good and nearer. */
template <typename TRule, typename TPixel>
void
TakeSample(TPixel sample, SliceRank<TPixel> rank, TPixel & pixel, SliceRank<TPixel> * pixelRank)
{
  const bool isBetter = TRule::IsBetter(sample, pixel);
  if (pixelRank && (isBetter || (sample == pixel && rank < *pixelRank)))
  {
    *pixelRank = rank;
  }
  pixel = isBetter ? sample : pixel;
}

template <typename TRule, bool VUntilLocalMaximum, typename TPixel>
void
TakeSamples(const TPixel * __restrict samples,
            ColumnSpan   span,
            std::int32_t slice,
            TPixel       threshold,
            TPixel * __restrict values,
            std::int32_t * __restrict slices)
{
  for (std::int32_t p = span.begin; p < span.end; ++p)
  {
    // masks, all bits or none: compilers make vectors of them
    const TPixel       sample = samples[p];
    const TPixel       value = values[p];
    const std::int32_t before = slices[p];
    const std::int32_t isEmpty = -static_cast<std::int32_t>(static_cast<std::uint32_t>(before) >> 31);
    const std::int32_t isNumber = IsNumber(sample) ? -1 : 0;
    const std::int32_t isFirst = TRule::IsStartUnique ? 0 : isNumber & isEmpty;
    std::int32_t       isTaken = (TRule::IsBetter(sample, value) ? -1 : 0) | isFirst;
    std::int32_t       kept = before;
    if constexpr (VUntilLocalMaximum)
    {
      const std::int32_t goesOn = before < EndedRay ? -1 : 0;
      // one as bad as the start counts as none
      const std::int32_t counts = !TRule::IsStartUnique || TRule::IsBetter(sample, TRule::Start) ? -1 : 0;
      const std::int32_t isWorse = TRule::IsWorse(sample, value) ? counts : 0;
      const std::int32_t isShort = TRule::IsWorse(value, threshold) ? -1 : 0;
      isTaken &= goesOn;
      kept += EndedRay & goesOn & isWorse & ~isShort & ~isEmpty;
    }
    values[p] = isTaken != 0 ? sample : value;
    slices[p] = (isTaken & slice) | (~isTaken & kept);
  }
}

template <typename TRule, typename TPixel>
void
Take(const TPixel * samples, ColumnSpan span, std::int32_t slice, const RayRow<TPixel> & rays)
{
  TakeSamples<TRule, false>(samples, span, slice, TPixel{}, rays.values, rays.slices);
}

template <typename TRule, typename TPixel>
void
TakeUntilLocalMaximum(const TPixel *         samples,
                      ColumnSpan             span,
                      std::int32_t           slice,
                      TPixel                 threshold,
                      const RayRow<TPixel> & rays)
{
  TakeSamples<TRule, true>(samples, span, slice, threshold, rays.values, rays.slices);
}

template <typename TRule, typename TPixel>
constexpr RayKernels<TPixel> RayKernelsOf{ TRule::Start, Take<TRule, TPixel>, TakeUntilLocalMaximum<TRule, TPixel> };

/** A sample that fades by \a product, as fadeRow has it. */
template <typename TPixel>
TPixel
FadeSample(TPixel sample, FadeNumber<TPixel> product, TPixel background)
{
  using Number = FadeNumber<TPixel>;
  const auto   to = static_cast<Number>(background);
  const auto   from = static_cast<Number>(sample);
  const Number faded = to + (from - to) * product;
  if constexpr (IsFloat<TPixel>)
  {
    // the sample if rounding leads beyond it, or its difference is infinite or not a number
    const TPixel below = faded < sample ? faded : sample;
    const TPixel above = faded > sample ? faded : sample;
    return sample > background ? below : above;
  }
  else
  {
    // between two integers of less than 64 bits; of others a double does not hold all
    if (sizeof(TPixel) < 8 || (faded > to && faded < from) || (faded < to && faded > from))
    {
      const Number half = faded + static_cast<Number>(0.5);
      const auto   whole = static_cast<TPixel>(half);
      return static_cast<TPixel>(whole - (static_cast<Number>(whole) > half ? 1 : 0));
    }
    return faded == to ? background : sample;
  }
}

template <typename TPixel>
void
FadeRow(const FadingRow<TPixel> & row, ColumnSpan span, TPixel * __restrict samples)
{
  const auto [reached, first, factor, factors, background] = row;
  const std::int32_t begin = span.begin > reached.begin ? span.begin : reached.begin;
  const std::int32_t end = span.end < reached.end ? span.end : reached.end;
  for (std::int32_t p = begin; p < end; ++p)
  {
    samples[p] = FadeSample(samples[p], factor * factors[p - first], background);
  }
}

/** A sample of column \a column, as the row fades. */
template <typename TPixel>
TPixel
FadeInRow(const FadingRow<TPixel> & row, TPixel sample, std::ptrdiff_t column)
{
  const bool fades = column >= row.span.begin && column < row.span.end;
  return fades ? FadeSample(sample, row.factor * row.factors[column - row.first], row.background) : sample;
}
