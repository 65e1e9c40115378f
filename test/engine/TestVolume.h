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
#ifndef itkShearWarpMIPTestVolume_h
#define itkShearWarpMIPTestVolume_h

#include "itkShearWarpEngine.h"
#include "itkShearWarpMIPTestRule.h"

#include <array>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>

/** Volumes, views and threads for tests of the engine. Needs nothing of ITK. */
namespace itk::ShearWarpMIPTest
{
/** Voxels in memory of their own. */
template <typename TPixel>
struct TestVolume
{
  ShearWarp::VoxelBox box;
  std::vector<TPixel> pixels;
  std::uint64_t       version{ 1 };

  ShearWarp::Voxels<TPixel>
  GetVoxels() const
  {
    return { pixels.data(), box, this, version };
  }

  /** The voxel at a place of the whole volume. */
  const TPixel &
  At(std::ptrdiff_t x, std::ptrdiff_t y, std::ptrdiff_t z) const
  {
    return pixels[((z - box.begin[2]) * box.size[1] + y - box.begin[1]) * box.size[0] + x - box.begin[0]];
  }
};

using TestSize = std::array<std::ptrdiff_t, 3>;

template <typename TPixel>
TestVolume<TPixel>
MakeVolume(const TestSize & size, TPixel value = TPixel{})
{
  TestVolume<TPixel> volume{ { { 0, 0, 0 }, { size[0], size[1], size[2] } }, {} };
  volume.pixels.assign(size[0] * size[1] * size[2], value);
  return volume;
}

template <typename TPixel>
TestVolume<TPixel>
MakeRandomVolume(Random & random, const TestSize & size)
{
  auto volume = MakeVolume<TPixel>(size);
  std::generate(volume.pixels.begin(), volume.pixels.end(), [&random] { return MakeRandomPixel<TPixel>(random); });
  return volume;
}

template <typename TPixel>
TestVolume<TPixel>
CopyPart(const TestVolume<TPixel> & volume, const ShearWarp::VoxelBox & box)
{
  TestVolume<TPixel> part{ box, {} };
  for (std::ptrdiff_t z = 0; z < box.size[2]; ++z)
  {
    for (std::ptrdiff_t y = 0; y < box.size[1]; ++y)
    {
      const TPixel * row = &volume.At(box.begin[0], box.begin[1] + y, box.begin[2] + z);
      part.pixels.insert(part.pixels.end(), row, row + box.size[0]);
    }
  }
  return part;
}

/** Boxes of \a least to \a most voxels a side that together are \a whole, each with one voxel more below. */
inline std::vector<ShearWarp::VoxelBox>
DrawParts(Random & random, const ShearWarp::VoxelBox & whole, int least, int most)
{
  std::vector<ShearWarp::VoxelBox> parts{ whole };
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    std::vector<ShearWarp::VoxelBox> smaller;
    for (std::ptrdiff_t begin = 0; begin < whole.size[axis];)
    {
      const auto end = std::min<std::ptrdiff_t>(begin + random.Integer(least, most), whole.size[axis]);
      for (ShearWarp::VoxelBox part : parts)
      {
        part.begin[axis] = std::max<std::ptrdiff_t>(begin - 1, 0);
        part.size[axis] = end - part.begin[axis];
        smaller.push_back(part);
      }
      begin = end;
    }
    parts = smaller;
  }
  return parts;
}

inline ShearWarp::VolumeGrid
MakeGrid(const ShearWarp::VoxelBox & box)
{
  return { { box.size[0], box.size[1], box.size[2] },
           { 1, 1, 1 },
           { { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, { 0, 0, 0 } } };
}

/** Turns about y, then x, then z. */
inline ShearWarp::AffineMap3D
MakeTurn(double x, double y, double z)
{
  const double cx = std::cos(x), sx = std::sin(x), cy = std::cos(y), sy = std::sin(y), cz = std::cos(z),
               sz = std::sin(z);
  return { { { cz * cy - sz * sx * sy, -cx * sz, cz * sy + cy * sz * sx },
             { cy * sz + cz * sx * sy, cz * cx, sz * sy - cz * cy * sx },
             { -cx * sy, sx, cx * cy } },
           { 0, 0, 0 } };
}

/** Views along each axis with zero, one and two shears, near and far from the axis. */
inline std::vector<ShearWarp::AffineMap3D>
MakeTestViews()
{
  return { MakeTurn(0, 0, 0),        MakeTurn(0, 0.3, 0),  MakeTurn(0, 2.7, 0.2),   MakeTurn(0.4, 0, 0),
           MakeTurn(0.3, 0.5, 0.1),  MakeTurn(1.5, 0, 0),  MakeTurn(1.3, 0.2, 0.4), MakeTurn(0, 1.5, 0),
           MakeTurn(0.2, 1.4, -0.3), MakeTurn(0.6, 0.7, 0) };
}

inline void
RunSerially(std::size_t count, std::size_t steps, const ShearWarp::Task & task)
{
  for (std::size_t n = 0; n < count * steps; ++n)
  {
    task(n / steps, n % steps, 0);
  }
}

/** One thread serves all calls of the same worker. */
inline ShearWarp::Threads
MakeThreads(std::size_t workers)
{
  if (workers == 1)
  {
    return { 1, RunSerially };
  }
  const auto run = [workers](std::size_t count, std::size_t steps, const ShearWarp::Task & task) {
    std::atomic<std::size_t> next{ 0 };
    std::exception_ptr       exception;
    std::mutex               mutex;
    std::vector<std::thread> threads;
    threads.reserve(workers);
    for (std::size_t worker = 0; worker < workers; ++worker)
    {
      threads.emplace_back([&, worker] {
        try
        {
          for (std::size_t n = next++; n < count; n = next++)
          {
            for (std::size_t step = 0; step < steps; ++step)
            {
              task(n, step, worker);
            }
          }
        }
        catch (...)
        {
          const std::lock_guard<std::mutex> lock(mutex);
          exception = std::current_exception();
        }
      });
    }
    for (std::thread & thread : threads)
    {
      thread.join();
    }
    if (exception)
    {
      std::rethrow_exception(exception);
    }
  };
  return { workers, run };
}
} // namespace itk::ShearWarpMIPTest

#endif
