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
#include <chrono>
#include <cstdint>
#include <limits>

// the compiler makes a copy for each of these instruction sets, and the program takes the best that the processor has
#if defined(__GNUC__) && defined(__x86_64__) && defined(__gnu_linux__)
#  define FOR_EACH_INSTRUCTION_SET __attribute__((target_clones("avx2", "default")))
#  define INTO_EACH_COPY inline __attribute__((always_inline))
#else
#  define FOR_EACH_INSTRUCTION_SET
#  define INTO_EACH_COPY inline
#endif

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

DEFINE(std::uint8_t)
DEFINE(std::int16_t)
DEFINE(std::uint16_t)
DEFINE(float)

#undef DEFINE

template <typename TCondition>
void
SpinUntil(const TCondition & condition)
{
  while (!condition())
  {
    std::this_thread::yield();
  }
}
} // namespace

ReadLimit::ReadLimit(unsigned int threads)
{
  for (unsigned int thread = 1; thread < threads; ++thread)
  {
    m_Threads.emplace_back([this] { this->Work(); });
  }
}

ReadLimit::~ReadLimit()
{
  {
    const std::lock_guard<std::mutex> lock(m_Mutex);
    m_Ended = true;
  }
  m_WakeUp.notify_all();
  for (std::thread & thread : m_Threads)
  {
    thread.join();
  }
}

void
ReadLimit::Work()
{
  for (unsigned int round = 1;; ++round)
  {
    {
      std::unique_lock<std::mutex> lock(m_Mutex);
      m_WakeUp.wait(lock, [&] { return m_Ended || m_Round == round; });
      if (m_Ended)
      {
        return;
      }
    }
    ++m_Awake;
    SpinUntil([&] { return m_StartedRound == round; });
    m_Task();
    ++m_Done;
  }
}

double
ReadLimit::Run(const std::function<void()> & task)
{
  m_Awake = 0;
  m_Done = 0;
  {
    const std::lock_guard<std::mutex> lock(m_Mutex);
    m_Task = task;
    ++m_Round;
  }
  m_WakeUp.notify_all();
  SpinUntil([this] { return m_Awake == m_Threads.size(); });

  const auto start = std::chrono::steady_clock::now();
  m_StartedRound = m_Round;
  task();
  SpinUntil([this] { return m_Done == m_Threads.size(); });
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

template <typename TPixel>
ReadLimit::Result<TPixel>
ReadLimit::FindMaximum(const TPixel * voxels, std::size_t count)
{
  constexpr std::size_t    block = (std::size_t{ 1 } << 20) / sizeof(TPixel);
  std::atomic<std::size_t> next{ 0 };
  std::mutex               mutex;
  TPixel                   maximum = std::numeric_limits<TPixel>::lowest();

  const double seconds = this->Run([&] {
    TPixel ownMaximum = std::numeric_limits<TPixel>::lowest();
    for (std::size_t begin = next.fetch_add(block); begin < count; begin = next.fetch_add(block))
    {
      ownMaximum = std::max(ownMaximum, FindMaximumInBlock(voxels + begin, std::min(block, count - begin)));
    }
    const std::lock_guard<std::mutex> lock(mutex);
    maximum = std::max(maximum, ownMaximum);
  });
  return { maximum, seconds };
}

template ReadLimit::Result<std::uint8_t>
ReadLimit::FindMaximum(const std::uint8_t *, std::size_t);
template ReadLimit::Result<std::int16_t>
ReadLimit::FindMaximum(const std::int16_t *, std::size_t);
template ReadLimit::Result<std::uint16_t>
ReadLimit::FindMaximum(const std::uint16_t *, std::size_t);
template ReadLimit::Result<float>
ReadLimit::FindMaximum(const float *, std::size_t);

} // namespace itk::ShearWarpBenchmark
