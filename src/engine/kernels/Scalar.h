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

/* What all kernels do with one pixel.
 *
 * Each file of kernels includes this header within its anonymous namespace, so that the linker cannot share the
 * compiled code: another file's code may have instructions that the processor lacks. For the same reason, nothing here
 * may call an inline function or a template of another header at run time. */

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

/** Calls \a function with a std::integral_constant. */
template <typename TFunction>
void
CallWithExtremum(Extremum extremum, const TFunction & function)
{
  switch (extremum)
  {
    case Extremum::Maximum:
      return function(std::integral_constant<Extremum, Extremum::Maximum>());
    case Extremum::Minimum:
      return function(std::integral_constant<Extremum, Extremum::Minimum>());
  }
}

/** Whether \a sample replaces \a value. Not-a-number replaces nothing. */
template <Extremum VExtremum, typename TPixel>
bool
IsBetter(TPixel sample, TPixel value)
{
  switch (VExtremum)
  {
    case Extremum::Maximum:
      return sample > value;
    case Extremum::Minimum:
      return sample < value;
  }
  return false;
}

template <typename TPixel>
SliceRank<TPixel>
GetRank(const RankedImage<TPixel> & image, std::ptrdiff_t slice)
{
  return static_cast<SliceRank<TPixel>>(image.first + image.step * slice);
}

/** Returns which of the four voxels around a sample are in a mask, as bits in the order of SampleCounted(), or 0 if the
 * nearest voxel is not in the mask. Rows \a a and \a b are rows of the mask. */
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

/** Gives a pixel a sample that is better, or equal and of a lower rank. If \a localThreshold is not null, a ray ends at
 * its first local maximum instead. */
template <Extremum VExtremum, typename TPixel>
void
TakeSample(TPixel              sample,
           SliceRank<TPixel>   rank,
           const TPixel *      localThreshold,
           TPixel &            pixel,
           SliceRank<TPixel> * pixelRank)
{
  if (localThreshold)
  {
    // an infinity that no sample can be worse than counts as no sample
    const bool counts = !IsFloat<TPixel> || sample != NoSample<TPixel, VExtremum>;
    if (counts && IsBetter<VExtremum>(pixel, sample) && !IsBetter<VExtremum>(*localThreshold, pixel) && *pixelRank >= 0)
    {
      *pixelRank += EndedRank<TPixel>;
    }
    if (*pixelRank < 0)
    {
      return;
    }
  }
  const bool isBetter = IsBetter<VExtremum>(sample, pixel);
  if (pixelRank && (isBetter || (sample == pixel && rank < *pixelRank)))
  {
    *pixelRank = rank;
  }
  pixel = isBetter ? sample : pixel;
}

template <typename TPixel>
SampleSum<TPixel> *
GetSums(const ShearedView<TPixel> & view, std::ptrdiff_t row)
{
  return view.summed.sums + row * view.intermediate.rowStride;
}

template <typename TPixel>
std::uint32_t *
GetCountSteps(const ShearedView<TPixel> & view, std::ptrdiff_t row)
{
  return view.summed.countSteps + row * (view.intermediate.rowStride + 1);
}

/** Counts a sample of each pixel in columns [begin, end). */
inline void
CountSamples(std::uint32_t * countSteps, std::ptrdiff_t begin, std::ptrdiff_t end)
{
  countSteps[begin] += 1;
  countSteps[end] -= 1;
}

/** Adds a sample, which is a number, to a sum. */
template <typename TPixel>
void
AddToSum(TPixel sample, SampleSum<TPixel> & sum)
{
  if constexpr (!IsFloat<TPixel> && sizeof(TPixel) == 8)
  {
    sum.upper += sample >> 32;
    sum.lower += static_cast<std::uint64_t>(sample) & 0xffffffffU;
  }
  else if constexpr (IsFloat<TPixel> && sizeof(TPixel) == 8)
  {
    sum.scaled += 0x1p-32 * sample;
    sum.lowest = Smaller<double>(sum.lowest, sample);
    sum.highest = Larger<double>(sum.highest, sample);
  }
  else
  {
    sum += static_cast<SampleSum<TPixel>>(sample);
  }
}

/** False for not-a-number. */
template <typename TPixel>
bool
IsNumber(TPixel value)
{
  if constexpr (IsFloat<TPixel>)
  {
    const bool isNegative = value < 0;
    return isNegative || value >= 0;
  }
  return true;
}

/** Adds a sample to a pixel's sum and counts it, unless it is not a number. */
template <typename TPixel>
void
AddSample(TPixel sample, SampleSum<TPixel> & sum, std::uint32_t * countStep)
{
  if (IsNumber(sample))
  {
    AddToSum(sample, sum);
    CountSamples(countStep, 0, 1);
  }
}

/** Returns a sample that fades by \a product, from 0 to 1, to a finite background: `background + (sample - background)
 * * product`, limited to the range between sample and background, and rounded half upward to the pixel type. A sample
 * infinitely far from the background does not fade. */
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
    // not-a-number is neither below nor above the sample
    const TPixel below = faded < sample ? faded : sample;
    const TPixel above = faded > sample ? faded : sample;
    return sample > background ? below : above;
  }
  else
  {
    // a double does not hold every integer of 64 bits
    if (sizeof(TPixel) < 8 || (faded > to && faded < from) || (faded < to && faded > from))
    {
      const Number half = faded + static_cast<Number>(0.5);
      const auto   whole = static_cast<TPixel>(half);
      return static_cast<TPixel>(whole - (static_cast<Number>(whole) > half ? 1 : 0));
    }
    return faded == to ? background : sample;
  }
}

/** Returns a sample of column \a column as the samples of \a row fade. */
template <typename TPixel>
TPixel
FadeInRow(const FadingRow<TPixel> & row, TPixel sample, std::ptrdiff_t column)
{
  const bool fades = column >= row.span.begin && column < row.span.end;
  return fades ? FadeSample(sample, row.factor * row.factors[column - row.first], row.background) : sample;
}

#endif
