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
#ifndef itkShearWarpMIPTestRule_h
#define itkShearWarpMIPTestRule_h

#include "itkShearWarpSampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <type_traits>
#include <vector>

/** Random pixels, and an evaluation of the sampling rule that shares no code with the module. Needs nothing of ITK. */
namespace itk::ShearWarpMIPTest
{
/** Calls \a check with the seeds of \a count cases, up to the first failure. SHEARWARPMIP_TEST_SEED=N gives the case of
 * that seed alone, SHEARWARPMIP_TEST_SECONDS=N new ones for a part of so long. */
template <typename TCheck>
void
ForEachSeed(std::uint64_t count, int parts, TCheck check)
{
  using Clock = std::chrono::steady_clock;
  const char * const seconds = std::getenv("SHEARWARPMIP_TEST_SECONDS");
  const char * const seed = std::getenv("SHEARWARPMIP_TEST_SEED");
  const auto         end = Clock::now() + std::chrono::seconds(seconds ? std::stoll(seconds) / parts : 0);
  const auto         first = seed ? std::stoull(seed) : seconds ? std::random_device{}() : 0;
  for (std::uint64_t n = 0; seed ? n < 1 : seconds ? Clock::now() < end : n < count; ++n)
  {
    SCOPED_TRACE("SHEARWARPMIP_TEST_SEED=" + std::to_string(first + n));
    check(first + n);
    if (testing::Test::HasFailure())
    {
      return;
    }
  }
}

/** The same numbers with every standard library. */
class Random
{
public:
  explicit Random(std::uint64_t seed)
    : m_Engine(seed)
  {}

  double
  Uniform(double low, double high)
  {
    return low + (high - low) * (static_cast<double>(m_Engine() >> 11) * 0x1.0p-53);
  }

  /** Of [low, high]. */
  std::int64_t
  Integer(std::int64_t low, std::int64_t high)
  {
    return low + static_cast<std::int64_t>(m_Engine() % static_cast<std::uint64_t>(high - low + 1));
  }

  std::uint64_t
  Bits()
  {
    return m_Engine();
  }

private:
  std::mt19937_64 m_Engine;
};

template <typename TPixel>
TPixel
MakeRandomPixel(Random & random)
{
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    return static_cast<TPixel>(random.Uniform(-1000, 1000));
  }
  else
  {
    const std::uint64_t bits = random.Bits();
    switch (bits % 8)
    {
      case 0:
        return std::numeric_limits<TPixel>::max();
      case 1:
        return std::numeric_limits<TPixel>::lowest();
      default:
        return static_cast<TPixel>(bits >> 7);
    }
  }
}

/** A volume of noise above a gradient, from integers alone; floats are multiples of 1/64. */
template <typename TPixel>
std::vector<TPixel>
MakeFixedVoxels(std::int64_t count)
{
  std::vector<TPixel> voxels;
  std::uint64_t       state = 1;
  for (std::int64_t n = 0; n < count; ++n)
  {
    state = state * 6364136223846793005u + 1442695040888963407u;
    const auto noise = static_cast<std::int64_t>(state >> 40);
    const auto value = (noise % 200 * n) / count + noise % 5;
    voxels.push_back(std::is_floating_point_v<TPixel> ? static_cast<TPixel>(noise - (1 << 23)) / 64
                                                      : static_cast<TPixel>(sizeof(TPixel) == 1 ? value : value * 311));
  }
  return voxels;
}

template <typename TPixel>
bool
HaveSameBits(TPixel a, TPixel b)
{
  return std::memcmp(&a, &b, sizeof(TPixel)) == 0;
}

/** Every zero is +0 in a maximum. */
template <typename TPixel>
TPixel
WithoutSignOfZero(TPixel value)
{
  return value == TPixel{} ? TPixel{} : value;
}

inline void
SetEnvironment(const char * variable, const std::string & value)
{
#ifdef _WIN32
  _putenv_s(variable, value.c_str());
#else
  setenv(variable, value.c_str(), 1);
#endif
}

/** Calls \a function(name) for each instruction set of this computer, while that is the chosen one. */
template <typename TFunction>
void
ForEachInstructionSet(const TFunction & function)
{
  constexpr const char * variable = "SHEARWARPMIP_INSTRUCTION_SET";
  for (const std::string & name : ShearWarp::GetInstructionSets())
  {
    SetEnvironment(variable, name);
    SCOPED_TRACE(name);
    function(name);
  }
  SetEnvironment(variable, "");
}

/** 64-bit FNV-1a of the values' bytes, the lowest first. */
template <typename T>
void
AddToChecksum(const T * values, std::size_t count, std::uint64_t & checksum)
{
  using Bits = std::conditional_t<sizeof(T) == 1,
                                  std::uint8_t,
                                  std::conditional_t<sizeof(T) == 2,
                                                     std::uint16_t,
                                                     std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>>>;
  for (std::size_t n = 0; n < count; ++n)
  {
    Bits bits;
    std::memcpy(&bits, values + n, sizeof(bits));
    for (std::size_t byte = 0; byte < sizeof(bits); ++byte)
    {
      checksum = (checksum ^ (static_cast<std::uint64_t>(bits) >> (8 * byte) & 0xff)) * 0x100000001b3u;
    }
  }
}
constexpr std::uint64_t EmptyChecksum = 0xcbf29ce484222325u;

constexpr std::int64_t WholePixel = 1 << 15;

/** To the nearest 1/2^15. */
inline std::int64_t
Quantize(long double position)
{
  return static_cast<std::int64_t>(std::floor(position * 32768.0L + 0.5L));
}

inline std::int64_t
DivideDown(std::int64_t dividend, std::int64_t divisor)
{
  return dividend / divisor - (dividend % divisor < 0 ? 1 : 0);
}

/** In 1/2^15, to the nearest whole pixel, half upward. */
inline std::int64_t
RoundToWhole(std::int64_t position)
{
  return DivideDown(position + WholePixel / 2, WholePixel) * WholePixel;
}

/** Products of two fractions in 1/2^15, in 1/2^15: {{a a, a b}, {b a, b b}}. */
struct CornerWeights
{
  CornerWeights(std::int64_t ofFirstColumn, std::int64_t ofFirstRow)
  {
    const std::int64_t x = ofFirstColumn;
    const std::int64_t y = ofFirstRow;
    const std::int64_t both = DivideDown(2 * x * y + WholePixel, 2 * WholePixel);
    weights[0] = both;
    weights[1] = y - both;
    weights[2] = x - both;
    weights[3] = WholePixel - x - y + both;
  }
  std::int64_t weights[4];
};

/** The weighted mean, rounded once and half upward, exact for every integer type: in two halves of 32 bits. */
template <typename TPixel>
TPixel
RoundedMean(const TPixel (&values)[4], const std::int64_t (&weights)[4])
{
  constexpr std::int64_t base = std::int64_t{ 1 } << 32;
  std::int64_t           high = 0;
  std::int64_t           low = 0;
  std::int64_t           sum = 0;
  for (int n = 0; n < 4; ++n)
  {
    const auto         bits = static_cast<std::uint64_t>(values[n]);
    const bool         isNegative = values[n] < TPixel{};
    const std::int64_t upper = static_cast<std::int64_t>(bits >> 32) - (isNegative ? base : 0);
    high += weights[n] * upper;
    low += weights[n] * static_cast<std::int64_t>(bits & 0xffffffffu);
    sum += weights[n];
  }
  const std::int64_t quotient = DivideDown(high, sum);
  const std::int64_t rest = (high - quotient * sum) * base + low;
  const std::int64_t rounded = DivideDown(2 * rest + sum, 2 * sum);
  return static_cast<TPixel>(static_cast<std::uint64_t>(quotient) * static_cast<std::uint64_t>(base) +
                             static_cast<std::uint64_t>(rounded));
}

/** The sample of a slice of columns x rows voxels at (column, row), in 1/2^15 voxel; false where the slice does
 * not reach. voxel(column, row) gives its voxels. */
template <typename TPixel, typename TVoxel>
bool
SampleSlice(const TVoxel & voxel,
            std::int64_t   columns,
            std::int64_t   rows,
            std::int64_t   column,
            std::int64_t   row,
            TPixel &       sample)
{
  constexpr std::int64_t half = WholePixel / 2;
  if (column < -half || column >= columns * WholePixel - half || row < -half || row >= rows * WholePixel - half)
  {
    return false;
  }
  // b: the voxel at or behind the position, a: the one before it
  const std::int64_t columnB = -DivideDown(-column, WholePixel);
  const std::int64_t rowB = -DivideDown(-row, WholePixel);
  // the outer half voxels have the edge's value
  const std::int64_t x = columnB < 1 || columnB >= columns ? 0 : columnB * WholePixel - column;
  const std::int64_t y = rowB < 1 || rowB >= rows ? 0 : rowB * WholePixel - row;

  const auto edge = [&](std::int64_t i, std::int64_t j) -> TPixel {
    return voxel(std::clamp<std::int64_t>(i, 0, columns - 1), std::clamp<std::int64_t>(j, 0, rows - 1));
  };
  const TPixel values[4] = {
    edge(columnB - 1, rowB - 1), edge(columnB, rowB - 1), edge(columnB - 1, rowB), edge(columnB, rowB)
  };
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    const auto blend = [](TPixel a, TPixel b, TPixel weight) {
      const TPixel difference = a - b;
      const TPixel step = weight * difference;
      return weight == TPixel{} ? b : b + step;
    };
    const TPixel weightX = static_cast<TPixel>(x) / TPixel{ WholePixel };
    const TPixel weightY = static_cast<TPixel>(y) / TPixel{ WholePixel };
    sample = blend(blend(values[0], values[1], weightX), blend(values[2], values[3], weightX), weightY);
  }
  else
  {
    sample = RoundedMean(values, CornerWeights(x, y).weights);
  }
  return true;
}

/** The warp's interpolation at (column, row), in 1/2^15 pixel. pixel(column, row, value) is false where there is none.
 */
template <typename TPixel, typename TPixelAt>
TPixel
InterpolateReached(const TPixelAt & pixel, std::int64_t column, std::int64_t row, TPixel background)
{
  const std::int64_t  i = DivideDown(column, WholePixel);
  const std::int64_t  j = DivideDown(row, WholePixel);
  const CornerWeights next(column - i * WholePixel, row - j * WholePixel);
  // from the first corner on
  std::int64_t weights[4] = { next.weights[3], next.weights[2], next.weights[1], next.weights[0] };
  TPixel       values[4] = {};
  std::int64_t sum = 0;
  for (int n = 0; n < 4; ++n)
  {
    if (weights[n] == 0 || !pixel(i + n % 2, j + n / 2, values[n]))
    {
      weights[n] = 0;
      values[n] = TPixel{};
    }
    sum += weights[n];
  }
  if (sum == 0)
  {
    return background;
  }
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    // a sum of large numbers overflows
    constexpr double part = std::is_same_v<TPixel, double> ? 0x1p-20 : 1.0;
    double           mean = 0.0;
    double           meanOfParts = 0.0;
    TPixel           lowest = std::numeric_limits<TPixel>::infinity();
    TPixel           highest = -lowest;
    for (int n = 0; n < 4; ++n)
    {
      if (weights[n] != 0)
      {
        const double term = static_cast<double>(weights[n]) * static_cast<double>(values[n]);
        const double termOfPart = static_cast<double>(weights[n]) * (part * static_cast<double>(values[n]));
        mean += term;
        meanOfParts += termOfPart;
        lowest = std::min(lowest, values[n]);
        highest = std::max(highest, values[n]);
      }
    }
    mean = std::isfinite(mean) ? mean / static_cast<double>(sum) : meanOfParts / static_cast<double>(sum) / part;
    return WithoutSignOfZero(std::min(std::max(static_cast<TPixel>(mean), lowest), highest));
  }
  else
  {
    return RoundedMean(values, weights);
  }
}

enum class RayMode
{
  Maximum,
  Minimum,
  AbsoluteMaximum,
  Mean
};

/** The mean of samples from front to back, rounded half upward: exact for integers, in doubles for floats. */
template <typename TPixel>
TPixel
MeanOf(const std::vector<TPixel> & samples)
{
  const auto count = static_cast<std::int64_t>(samples.size());
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    constexpr double part = std::is_same_v<TPixel, double> ? 0x1p-32 : 1.0;
    double           sum = 0.0;
    for (const TPixel sample : samples)
    {
      sum += part * static_cast<double>(sample);
    }
    const double mean = sum / static_cast<double>(count) / part;
    const auto [lowest, highest] = std::minmax_element(samples.begin(), samples.end());
    return std::isnan(mean) ? static_cast<TPixel>(mean)
                            : std::min(std::max(static_cast<TPixel>(mean), *lowest), *highest);
  }
  else
  {
    // digits to the base of 2^32 of the sum of distances from the lowest integer
    const auto    lowest = static_cast<std::uint64_t>(std::numeric_limits<TPixel>::lowest());
    std::uint64_t high = 0;
    std::uint64_t low = 0;
    for (const TPixel sample : samples)
    {
      const std::uint64_t distance = static_cast<std::uint64_t>(sample) - lowest;
      high += distance >> 32;
      low += distance & 0xffffffffU;
    }
    const auto          divisor = static_cast<std::uint64_t>(count);
    const std::uint64_t rest = (high % divisor << 32) + low;
    const std::uint64_t rounded = rest / divisor + (rest % divisor * 2 >= divisor ? 1 : 0);
    return static_cast<TPixel>(lowest + (high / divisor << 32) + rounded);
  }
}

/** Which sample of a ray is its value, or whether the mean is. */
template <typename TPixel>
struct SampleRule
{
  RayMode mode{ RayMode::Maximum };
  bool    isLocal{ false };
  TPixel  threshold{};
  bool    isNearest{ false };
};

/** A sample of a ray. */
template <typename TPixel>
struct RaySample
{
  TPixel       value;
  std::int64_t slice;
};

template <typename TPixel>
long double
GetRank(RayMode mode, TPixel value)
{
  const auto exact = static_cast<long double>(value);
  return mode == RayMode::Minimum ? -exact : mode == RayMode::AbsoluteMaximum ? std::abs(exact) : exact;
}

/** The value of a ray with \a samples, one or more, from front to back. */
template <typename TPixel>
RaySample<TPixel>
ChooseSample(const SampleRule<TPixel> & rule, const std::vector<RaySample<TPixel>> & samples)
{
  if (rule.mode == RayMode::Mean)
  {
    std::vector<TPixel> values;
    values.reserve(samples.size());
    for (const RaySample<TPixel> & sample : samples)
    {
      values.push_back(sample.value);
    }
    return { MeanOf(values), samples.front().slice };
  }
  const auto rank = [&](std::size_t n) { return GetRank(rule.mode, samples[n].value); };
  if (rule.isLocal)
  {
    for (std::size_t n = 0; n + 1 < samples.size(); ++n)
    {
      if (rank(n) >= GetRank(rule.mode, rule.threshold) && rank(n + 1) < rank(n))
      {
        for (; n > 0 && rank(n - 1) == rank(n); --n)
        {
        }
        return samples[n];
      }
    }
  }
  std::size_t best = 0;
  for (std::size_t n = 1; n < samples.size(); ++n)
  {
    const bool isPositive = rank(n) == rank(best) && samples[n].value > samples[best].value;
    best = rank(n) > rank(best) || isPositive ? n : best;
  }
  return samples[best];
}

} // namespace itk::ShearWarpMIPTest

#endif
