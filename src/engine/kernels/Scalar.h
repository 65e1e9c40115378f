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
#ifndef itkShearWarpScalar_h
#define itkShearWarpScalar_h

/* Included by each file of kernels, within its anonymous namespace, so that the linker cannot share what is compiled
 * here. For the same reason nothing here may call an inline function or a template of another header at run time. */

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
constexpr bool IsFloat = static_cast<TPixel>(0.5) != 0;

template <typename TPixel>
struct MaximumRule
{
  static constexpr TPixel Start = NoSample<TPixel>;

  static bool
  IsBetter(TPixel sample, TPixel value)
  {
    return sample > value;
  }
};

template <typename TPixel>
struct MinimumRule
{
  static constexpr TPixel Start = NoSample<TPixel, Extremum::Minimum>;

  static bool
  IsBetter(TPixel sample, TPixel value)
  {
    return sample < value;
  }
};

template <typename TPixel>
struct MagnitudeRule
{
  static constexpr TPixel Start = NoSample<TPixel, Extremum::Magnitude>;

  static bool
  IsBetter(TPixel sample, TPixel value)
  {
    const auto ofSample = GetMagnitude(sample);
    const auto ofValue = GetMagnitude(value);
    return (ofSample > ofValue) | ((ofSample == ofValue) & (sample > value));
  }

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

/** Whether \a sample is less good than \a value. */
template <typename TRule, typename TPixel>
bool
IsWorse(TPixel sample, TPixel value)
{
  if constexpr (std::is_same_v<TRule, MagnitudeRule<TPixel>>)
  {
    return TRule::GetMagnitude(sample) < TRule::GetMagnitude(value);
  }
  else
  {
    return TRule::IsBetter(value, sample);
  }
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

/** Gives a pixel a sample if that is better, or as good and nearer; or ends its ray at its first local maximum, unless
 * \a localThreshold is null. */
template <typename TRule, typename TPixel>
void
TakeSample(TPixel              sample,
           SliceRank<TPixel>   rank,
           const TPixel *      localThreshold,
           TPixel &            pixel,
           SliceRank<TPixel> * pixelRank)
{
  if (localThreshold)
  {
    // an infinity as bad as the start counts as no sample
    const bool counts = !IsFloat<TPixel> || TRule::Start == 0 || sample != TRule::Start;
    if (counts && IsWorse<TRule>(sample, pixel) && !IsWorse<TRule>(pixel, *localThreshold) && *pixelRank >= 0)
    {
      *pixelRank += EndedRank<TPixel>;
    }
    if (*pixelRank < 0)
    {
      return;
    }
  }
  const bool isBetter = TRule::IsBetter(sample, pixel);
  if (pixelRank && (isBetter || (sample == pixel && rank < *pixelRank)))
  {
    *pixelRank = rank;
  }
  pixel = isBetter ? sample : pixel;
}

/** A sample that fades by \a product, from 0 to 1, to a finite background: to `background + (sample - background) *
 * product`, rounded half upward to the pixel type; to a value that lies between the two. One whose difference from the
 * background is infinite stays as it is. */
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

/** A sample of column \a column, as the row fades. */
template <typename TPixel>
TPixel
FadeInRow(const FadingRow<TPixel> & row, TPixel sample, std::ptrdiff_t column)
{
  const bool fades = column >= row.span.begin && column < row.span.end;
  return fades ? FadeSample(sample, row.factor * row.factors[column - row.first], row.background) : sample;
}

#endif
