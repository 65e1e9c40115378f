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
#ifndef itkShearWarpValues_h
#define itkShearWarpValues_h

#include "itkShearWarpEngine.h"
#include "kernels/Kernels.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

/** How values of the same pixel are compared and merged. */
namespace itk::ShearWarp
{
/** Returns whether a pixel that slices reach may have no value that an image of pixels alone can tell. Of two extrema,
 * the better one does not tell whether a float has met a sample. */
template <typename TPixel>
bool
MayHaveGaps(Mode mode, bool hasRegion, bool hasRanks)
{
  return hasRegion || hasRanks ||
         (std::is_floating_point_v<TPixel> && (mode == Mode::AbsoluteMaximum || mode == Mode::Mean));
}

/** Returns whether \a minimum, which is not above \a maximum, has the larger magnitude. */
template <typename TPixel>
bool
IsMagnitudeLarger(TPixel minimum, TPixel maximum)
{
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    return minimum < 0 && -minimum > maximum;
  }
  else if constexpr (std::is_signed_v<TPixel>)
  {
    // the lowest integer has no negative
    return minimum < 0 && (maximum < 0 || -(minimum + 1) >= maximum);
  }
  return false;
}

/** Adds a sum of other samples. A sum that overflows, as records of a file may, is wrong but defined. */
template <typename TSum>
void
Merge(TSum & sum, const TSum & other)
{
  if constexpr (std::is_same_v<TSum, SumOfDoubles>)
  {
    sum.scaled += other.scaled;
    sum.lowest = std::min(sum.lowest, other.lowest);
    sum.highest = std::max(sum.highest, other.highest);
  }
  else if constexpr (std::is_class_v<TSum>)
  {
    Merge(sum.upper, other.upper);
    Merge(sum.lower, other.lower);
  }
  else if constexpr (std::is_integral_v<TSum>)
  {
    using Unsigned = std::make_unsigned_t<TSum>;
    sum = static_cast<TSum>(static_cast<Unsigned>(sum) + static_cast<Unsigned>(other));
  }
  else
  {
    sum += other;
  }
}

/** Returns the quotient, rounded half upward. The divisor is less than 2^31. */
template <typename TInteger>
TInteger
DivideRounded(TInteger dividend, std::uint32_t divisor)
{
  const auto     by = static_cast<TInteger>(divisor);
  const TInteger quotient = dividend / by;
  const TInteger rest = dividend % by;
  // the rest has the sign of the dividend
  return quotient + (2 * rest >= by ? 1 : 0) - (rest < 0 && 2 * (by + rest) < by ? 1 : 0);
}

/** Returns the mean of \a count samples, rounded half upward to the pixel type. A mean of zero is +0. */
template <typename TPixel>
TPixel
GetMean(const SampleSum<TPixel> & sum, std::uint32_t count)
{
  if constexpr (std::is_same_v<TPixel, double>)
  {
    const double mean = sum.scaled / count * 0x1p32;
    // not-a-number is neither below nor above the range
    return (mean < sum.lowest ? sum.lowest : mean > sum.highest ? sum.highest : mean) + 0.0;
  }
  else if constexpr (std::is_same_v<TPixel, float>)
  {
    return static_cast<float>(sum / count) + 0.0F;
  }
  else if constexpr (sizeof(TPixel) == 8)
  {
    const auto   divisor = static_cast<TPixel>(count);
    const TPixel toZero = sum.upper / divisor;
    const TPixel quotient = toZero - (sum.upper < toZero * divisor ? 1 : 0);
    const auto   rest = static_cast<std::uint64_t>(sum.upper) - static_cast<std::uint64_t>(quotient) * count;
    const auto   lower = DivideRounded<std::uint64_t>((rest << 32) + sum.lower, count);
    return static_cast<TPixel>((static_cast<std::uint64_t>(quotient) << 32) + lower);
  }
  else if constexpr (sizeof(TPixel) <= 2)
  {
    // the distance from the lowest number is not negative; doubles hold it exactly, and the quotient's integer part
    constexpr std::int32_t lowest = std::numeric_limits<TPixel>::lowest();
    constexpr double       most = std::numeric_limits<TPixel>::max() - lowest;
    const double distance = std::min(static_cast<double>(sum) - static_cast<double>(lowest) * count, most * count);
    return static_cast<TPixel>(lowest + static_cast<std::int32_t>((distance + 0.5 * count) / count));
  }
  else
  {
    using Wide = std::conditional_t<std::is_signed_v<TPixel>, std::int64_t, std::uint64_t>;
    return static_cast<TPixel>(DivideRounded<Wide>(sum, count));
  }
}

/** Returns whether \a a is better than \a b. Neither is not-a-number. Of two values with the same magnitude, the
 * positive one is an absolute maximum. */
template <Mode VMode, typename TValue>
bool
IsBetter(TValue a, TValue b)
{
  if constexpr (VMode == Mode::Minimum)
  {
    return a < b;
  }
  else if constexpr (VMode == Mode::AbsoluteMaximum)
  {
    return a > b ? !IsMagnitudeLarger(b, a) : a < b && IsMagnitudeLarger(a, b);
  }
  return a > b;
}
} // namespace itk::ShearWarp

#endif
