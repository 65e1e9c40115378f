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
#include "ReadLimit.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <limits>
#include <mutex>
#include <thread>
#include <vector>

// the compiler makes a copy for each of these instruction sets, and the program takes the best that the processor has
#if defined(__GNUC__) && defined(__x86_64__) && defined(__gnu_linux__)
#  define FOR_EACH_INSTRUCTION_SET __attribute__((target_clones("avx2", "default")))
#  define INTO_EACH_COPY inline __attribute__((always_inline))
#else
#  define FOR_EACH_INSTRUCTION_SET
#  define INTO_EACH_COPY inline
#endif

#define FOR_EACH_PIXEL_TYPE(macro) macro(std::uint8_t) macro(std::int16_t) macro(std::uint16_t) macro(float)

namespace itk::ShearWarpBenchmark
{
namespace
{
template <typename TPixel>
INTO_EACH_COPY TPixel
FindMaximumInStreams(const TPixel * voxels, std::size_t count)
{
  const auto        larger = [](TPixel a, TPixel b) { return a > b ? a : b; };
  const std::size_t quarter = count / 4;
  TPixel            a = std::numeric_limits<TPixel>::lowest();
  TPixel            b = a;
  TPixel            c = a;
  TPixel            d = a;
  for (std::size_t n = 0; n < quarter; ++n)
  {
    a = larger(voxels[n], a);
    b = larger(voxels[n + quarter], b);
    c = larger(voxels[n + 2 * quarter], c);
    d = larger(voxels[n + 3 * quarter], d);
  }
  for (std::size_t n = 4 * quarter; n < count; ++n)
  {
    a = larger(voxels[n], a);
  }
  return larger(larger(a, b), larger(c, d));
}

#define DEFINE(TPixel)                                                                         \
  FOR_EACH_INSTRUCTION_SET TPixel FindMaximumInBlock(const TPixel * voxels, std::size_t count) \
  {                                                                                            \
    return FindMaximumInStreams(voxels, count);                                                \
  }
FOR_EACH_PIXEL_TYPE(DEFINE)
} // namespace

template <typename TPixel>
ReadLimit<TPixel>
MeasureReadLimit(const TPixel * voxels, std::size_t count, unsigned int threads)
{
  constexpr std::size_t     block = (std::size_t{ 1 } << 20) / sizeof(TPixel);
  std::atomic<std::size_t>  next{ 0 };
  std::atomic<unsigned int> awake{ 0 };
  std::atomic<unsigned int> done{ 0 };
  std::mutex                mutex;
  TPixel                    maximum = std::numeric_limits<TPixel>::lowest();

  const auto waitFor = [threads](const std::atomic<unsigned int> & number) {
    while (number < threads)
    {
      std::this_thread::yield();
    }
  };
  const auto read = [&] {
    ++awake;
    waitFor(awake);
    const auto start = std::chrono::steady_clock::now();
    TPixel     ownMaximum = std::numeric_limits<TPixel>::lowest();
    for (std::size_t begin = next.fetch_add(block); begin < count; begin = next.fetch_add(block))
    {
      ownMaximum = std::max(ownMaximum, FindMaximumInBlock(voxels + begin, std::min(block, count - begin)));
    }
    {
      const std::lock_guard<std::mutex> lock(mutex);
      maximum = std::max(maximum, ownMaximum);
    }
    ++done;
    waitFor(done);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  std::vector<std::thread> others;
  for (unsigned int thread = 1; thread < threads; ++thread)
  {
    others.emplace_back(read);
  }
  const double seconds = read();
  for (std::thread & other : others)
  {
    other.join();
  }
  return { maximum, seconds };
}

#define INSTANTIATE(TPixel) template ReadLimit<TPixel> MeasureReadLimit(const TPixel *, std::size_t, unsigned int);
FOR_EACH_PIXEL_TYPE(INSTANTIATE)
} // namespace itk::ShearWarpBenchmark
