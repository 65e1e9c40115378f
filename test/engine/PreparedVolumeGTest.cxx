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
#include "PreparedVolume.h"
#include "kernels/PixelTypes.h"

#include "TestVolume.h"

#include <stdexcept>

namespace
{
using namespace itk::ShearWarp;
using namespace itk::ShearWarpMIPTest;

/** Counts the calls. */
struct CountingRun
{
  void
  operator()(std::size_t count, std::size_t steps, const Task & task) const
  {
    ++calls;
    RunSerially(count, steps, task);
  }
  mutable int calls{ 0 };
};

template <typename TPixel, typename TRunner>
SliceStack<TPixel>
PrepareSlices(PreparedVolume<TPixel> &   prepared,
              const TestVolume<TPixel> & volume,
              unsigned int               axis,
              const TRunner &            run)
{
  prepared.Prepare(volume.GetVoxels(), volume.box, axis, true, GetKernels<TPixel>(), std::cref(run));
  EXPECT_TRUE(prepared.IsPrepared(volume.GetVoxels(), axis));
  return prepared.GetSlices(axis);
}

template <typename TPixel>
void
ExpectSlicesOf(const TestVolume<TPixel> & volume, unsigned int axis, const SliceStack<TPixel> & slices)
{
  const unsigned int columnAxis = axis == 0 ? 1 : 0;
  const unsigned int rowAxis = axis == 2 ? 1 : 2;
  ASSERT_EQ(slices.columns, volume.box.size[columnAxis]);
  ASSERT_EQ(slices.rows, volume.box.size[rowAxis]);
  ASSERT_EQ(slices.slices, volume.box.size[axis]);
  for (std::ptrdiff_t k = 0; k < slices.slices; ++k)
  {
    for (std::ptrdiff_t j = 0; j < slices.rows; ++j)
    {
      for (std::ptrdiff_t i = 0; i < slices.columns; ++i)
      {
        std::ptrdiff_t index[3];
        index[columnAxis] = i;
        index[rowAxis] = j;
        index[axis] = k;
        ASSERT_EQ(slices.voxels[k * slices.sliceStride + j * slices.rowStride + i],
                  volume.At(index[0], index[1], index[2]));
      }
    }
  }
}

template <typename TPixel>
class ShearWarpPreparedVolumeTyped : public testing::Test
{};
using PixelTypes = testing::Types<SHEARWARP_PIXEL_TYPES>;
TYPED_TEST_SUITE(ShearWarpPreparedVolumeTyped, PixelTypes, );

class ShearWarpPreparedVolume : public testing::Test
{
protected:
  SliceStack<short>
  GetSlices(unsigned int axis, const TestVolume<short> * volume = nullptr)
  {
    return PrepareSlices(m_Prepared, volume ? *volume : m_Volume, axis, m_Run);
  }

  Random                m_Random{ 203 };
  TestVolume<short>     m_Volume{ MakeRandomVolume<short>(m_Random, { 4, 5, 6 }) };
  PreparedVolume<short> m_Prepared;
  CountingRun           m_Run;
};
} // namespace

TYPED_TEST(ShearWarpPreparedVolumeTyped, GivesTheVoxelsAlongEachAxis)
{
  Random random(201);
  for (const TestSize & size :
       { TestSize{ { 1, 1, 1 } }, { { 5, 1, 1 } }, { { 1, 5, 1 } }, { { 1, 1, 5 } }, { { 37, 6, 11 } } })
  {
    const auto                volume = MakeRandomVolume<TypeParam>(random, size);
    PreparedVolume<TypeParam> prepared;
    const CountingRun         run;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      ExpectSlicesOf<TypeParam>(volume, axis, PrepareSlices(prepared, volume, axis, run));
    }
    EXPECT_EQ(prepared.GetSizeInBytes(),
              static_cast<std::size_t>(size[0] * size[1] * size[2] +
                                       (size[0] + 7) / 8 * ((size[1] + 7) / 8) * ((size[2] + 7) / 8)) *
                sizeof(TypeParam));
  }
}

TYPED_TEST(ShearWarpPreparedVolumeTyped, GivesTheMaximaOfCubesAlongEachAxis)
{
  Random random(209);
  for (const TestSize & size : { TestSize{ { 1, 1, 1 } }, { { 9, 8, 7 } }, { { 77, 26, 11 } } })
  {
    const auto volume = MakeRandomVolume<TypeParam>(random, size);
    const auto extremes = std::minmax_element(volume.pixels.begin(), volume.pixels.end());
    ForEachInstructionSet([&](const std::string &) {
      PreparedVolume<TypeParam> prepared(true);
      const CountingRun         run;
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        const auto slices = PrepareSlices(prepared, volume, axis, run);
        EXPECT_EQ(slices.lowest, *extremes.first);
        EXPECT_EQ(slices.highest, *extremes.second);
        const auto blocks = prepared.GetBlockExtrema(axis);
        ASSERT_EQ(blocks.columns, (slices.columns + 7) / 8);
        ASSERT_EQ(blocks.rows, (slices.rows + 7) / 8);
        ASSERT_EQ(blocks.slices, (slices.slices + 7) / 8);
        for (std::ptrdiff_t n = 0; n < blocks.columns * blocks.rows * blocks.slices; ++n)
        {
          const std::ptrdiff_t column = n % blocks.columns;
          const std::ptrdiff_t row = n / blocks.columns % blocks.rows;
          const std::ptrdiff_t slice = n / blocks.columns / blocks.rows;
          TypeParam            maximum = std::numeric_limits<TypeParam>::lowest();
          TypeParam            minimum = std::numeric_limits<TypeParam>::max();
          for (int voxel = 0; voxel < 8 * 8 * 8; ++voxel)
          {
            const std::ptrdiff_t i = std::min(column * 8 + voxel % 8, slices.columns - 1);
            const std::ptrdiff_t j = std::min(row * 8 + voxel / 8 % 8, slices.rows - 1);
            const std::ptrdiff_t k = std::min(slice * 8 + voxel / 64, slices.slices - 1);
            const TypeParam      value = slices.voxels[k * slices.sliceStride + j * slices.rowStride + i];
            maximum = std::max(maximum, value);
            minimum = std::min(minimum, value);
          }
          const auto block = column * blocks.columnStride + row * blocks.rowStride + slice * blocks.sliceStride;
          ASSERT_EQ(blocks.maxima[block], maximum);
          ASSERT_EQ(blocks.minima[block], minimum);
        }
      }
    });
  }
}

TEST(ShearWarpPreparedVolumeOfFloats, NotANumberIsNoMaximum)
{
  auto volume = MakeVolume<float>({ 40, 9, 3 }, std::numeric_limits<float>::quiet_NaN());
  volume.pixels[50] = 3;
  volume.pixels[400] = -7;
  ForEachInstructionSet([&](const std::string &) {
    PreparedVolume<float> prepared;
    const CountingRun     run;
    const auto            slices = PrepareSlices(prepared, volume, 2, run);
    EXPECT_EQ(slices.lowest, -7);
    EXPECT_EQ(slices.highest, 3);
    const auto blocks = prepared.GetBlockExtrema(2);
    EXPECT_EQ(blocks.maxima[1], 3);
    EXPECT_EQ(blocks.maxima[0], -7);
    EXPECT_EQ(blocks.maxima[2], -std::numeric_limits<float>::infinity());
  });
}

TEST_F(ShearWarpPreparedVolume, AlongYAndZNoVoxelIsCopied)
{
  for (const unsigned int axis : { 1, 2 })
  {
    EXPECT_EQ(GetSlices(axis).voxels, m_Volume.pixels.data());
  }
  EXPECT_EQ(m_Run.calls, 1);
  EXPECT_EQ(m_Prepared.GetSizeInBytes(), sizeof(short));
}

TEST_F(ShearWarpPreparedVolume, AlongXTheCopyIsMadeOnceAndKept)
{
  EXPECT_FALSE(m_Prepared.IsPrepared(m_Volume.GetVoxels(), 0));
  const auto slices = GetSlices(0);
  EXPECT_TRUE(m_Prepared.IsPrepared(m_Volume.GetVoxels(), 0));
  GetSlices(1);
  GetSlices(2);
  EXPECT_EQ(GetSlices(0).voxels, slices.voxels);
  EXPECT_EQ(m_Run.calls, 2);
  EXPECT_EQ(m_Prepared.GetSizeInBytes(), (4u * 5u * 6u + 1u) * sizeof(short));
}

TEST_F(ShearWarpPreparedVolume, AModifiedImageIsCopiedAgainToTheSameMemory)
{
  const short * memory = GetSlices(0).voxels;
  m_Volume.pixels = MakeRandomVolume<short>(m_Random, { 4, 5, 6 }).pixels;
  ++m_Volume.version;
  EXPECT_FALSE(m_Prepared.IsPrepared(m_Volume.GetVoxels(), 0));
  const auto slices = GetSlices(0);
  ExpectSlicesOf<short>(m_Volume, 0, slices);
  EXPECT_EQ(slices.voxels, memory);
  EXPECT_EQ(m_Run.calls, 4);
}

TEST_F(ShearWarpPreparedVolume, AnotherImageIsCopiedAgain)
{
  const auto other = MakeRandomVolume<short>(m_Random, { 4, 5, 6 });
  GetSlices(0);
  EXPECT_FALSE(m_Prepared.IsPrepared(other.GetVoxels(), 0));
  ExpectSlicesOf<short>(other, 0, GetSlices(0, &other));
  ExpectSlicesOf<short>(m_Volume, 0, GetSlices(0));
  EXPECT_EQ(m_Run.calls, 6);
}

TEST_F(ShearWarpPreparedVolume, AChangedImageSeenAlongZFreesTheCopy)
{
  GetSlices(0);
  ++m_Volume.version;
  GetSlices(2);
  EXPECT_EQ(m_Prepared.GetSizeInBytes(), sizeof(short));
}

TEST_F(ShearWarpPreparedVolume, ReleaseFreesTheCopy)
{
  m_Prepared.Release();
  GetSlices(0);
  m_Prepared.Release();
  EXPECT_EQ(m_Prepared.GetSizeInBytes(), 0u);
  EXPECT_FALSE(m_Prepared.IsPrepared(m_Volume.GetVoxels(), 0));
  ExpectSlicesOf<short>(m_Volume, 0, GetSlices(0));
  EXPECT_EQ(m_Run.calls, 4);
}

TEST_F(ShearWarpPreparedVolume, KeepsNothingIfPreparationThrows)
{
  const auto failing = [](std::size_t, std::size_t, const Task & task) {
    task(0, 0, 0);
    throw std::runtime_error("stopped");
  };
  EXPECT_THROW(PrepareSlices(m_Prepared, m_Volume, 0, failing), std::runtime_error);
  EXPECT_FALSE(m_Prepared.IsPrepared(m_Volume.GetVoxels(), 0));
  EXPECT_EQ(m_Prepared.GetSizeInBytes(), 0u);
  ExpectSlicesOf<short>(m_Volume, 0, GetSlices(0));
}
