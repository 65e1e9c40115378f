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
#ifndef ReadLimit_h
#define ReadLimit_h

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace itk::ShearWarpBenchmark
{
/** Reads a whole volume as fast as the memory gives it to so many threads: every projection has to read it too, and the
 * largest voxel is about the least that can be computed on the way. The threads live as long as the object and are
 * awake before the clock starts, so that they add nothing to the limit. */
class ReadLimit
{
public:
  explicit ReadLimit(unsigned int threads);
  ~ReadLimit();
  ReadLimit(const ReadLimit &) = delete;
  ReadLimit &
  operator=(const ReadLimit &) = delete;

  template <typename TPixel>
  struct Result
  {
    TPixel maximum;
    double seconds;
  };

  /** The largest of \a count voxels, and the time to find it. Each thread reads four streams of memory at a time.
   * Instantiated for `uint8 int16 uint16 float`. */
  template <typename TPixel>
  Result<TPixel>
  FindMaximum(const TPixel * voxels, std::size_t count);

private:
  /** Calls task() in each of the threads, of which the calling one is the first. Returns how long they took, in
   * seconds. */
  double
  Run(const std::function<void()> & task);

  void
  Work();

  std::vector<std::thread>  m_Threads;
  std::mutex                m_Mutex;
  std::condition_variable   m_WakeUp;
  std::function<void()>     m_Task;
  unsigned int              m_Round{ 0 };
  bool                      m_Ended{ false };
  std::atomic<std::size_t>  m_Awake{ 0 };
  std::atomic<unsigned int> m_StartedRound{ 0 };
  std::atomic<std::size_t>  m_Done{ 0 };
};
} // namespace itk::ShearWarpBenchmark

#endif
