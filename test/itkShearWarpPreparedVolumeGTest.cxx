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

#include "itkShearWarpMIPTestImages.h"

#include <stdexcept>

namespace
{
using namespace itk::ShearWarpMIPTest;

/** Counts the calls. */
struct CountingParallelize
{
  void
  operator()(itk::SizeValueType count, itk::SizeValueType, const itk::ShearWarp::Task & task) const
  {
    ++calls;
    for (itk::SizeValueType n = 0; n < count; ++n)
    {
      task(n, 0, 0);
    }
  }
  mutable int calls{ 0 };
};

template <typename TPixel, typename TParallelize>
itk::ShearWarp::SliceStack<TPixel>
GetSlices(itk::ShearWarpPreparedVolume<TPixel> & volume,
          const itk::Image<TPixel, 3> *          image,
          unsigned int                           axis,
          const TParallelize &                   parallelize)
{
  const auto & kernels = itk::ShearWarp::GetKernels<TPixel>();
  volume.Prepare(image, image->GetLargestPossibleRegion(), axis, true, kernels, std::cref(parallelize));
  EXPECT_TRUE(volume.IsPrepared(image, axis));
  return volume.GetSlices(axis);
}

template <typename TPixel>
void
ExpectSlicesOf(const itk::Image<TPixel, 3> *              image,
               unsigned int                               axis,
               const itk::ShearWarp::SliceStack<TPixel> & slices)
{
  const auto &       region = image->GetBufferedRegion();
  const unsigned int columnAxis = axis == 0 ? 1 : 0;
  const unsigned int rowAxis = axis == 2 ? 1 : 2;
  ASSERT_EQ(static_cast<itk::SizeValueType>(slices.columns), region.GetSize(columnAxis));
  ASSERT_EQ(static_cast<itk::SizeValueType>(slices.rows), region.GetSize(rowAxis));
  ASSERT_EQ(static_cast<itk::SizeValueType>(slices.slices), region.GetSize(axis));
  for (std::ptrdiff_t k = 0; k < slices.slices; ++k)
  {
    for (std::ptrdiff_t j = 0; j < slices.rows; ++j)
    {
      for (std::ptrdiff_t i = 0; i < slices.columns; ++i)
      {
        itk::Index<3> index = region.GetIndex();
        index[columnAxis] += i;
        index[rowAxis] += j;
        index[axis] += k;
        ASSERT_EQ(slices.voxels[k * slices.sliceStride + j * slices.rowStride + i], image->GetPixel(index));
      }
    }
  }
}

template <typename TPixel>
class ShearWarpPreparedVolumeTyped : public testing::Test
{};
using PixelTypes = testing::Types<signed char, unsigned short, int, long long, float, double>;
TYPED_TEST_SUITE(ShearWarpPreparedVolumeTyped, PixelTypes, );

class ShearWarpPreparedVolume : public testing::Test
{
protected:
  itk::ShearWarp::SliceStack<short>
  GetSlices(unsigned int axis, const itk::Image<short, 3> * image = nullptr)
  {
    return ::GetSlices<short>(m_Volume, image ? image : m_Image.GetPointer(), axis, m_Parallelize);
  }

  Random                              m_Random{ 203 };
  itk::Image<short, 3>::Pointer       m_Image{ MakeRandomImage<short>(m_Random, { { 4, 5, 6 } }) };
  itk::ShearWarpPreparedVolume<short> m_Volume;
  CountingParallelize                 m_Parallelize;
};
} // namespace

TYPED_TEST(ShearWarpPreparedVolumeTyped, GivesTheImagesVoxelsAlongEachAxis)
{
  Random random(201);
  for (const itk::Size<3> & size :
       { itk::Size<3>{ { 1, 1, 1 } }, { { 5, 1, 1 } }, { { 1, 5, 1 } }, { { 1, 1, 5 } }, { { 37, 6, 11 } } })
  {
    const auto                              image = MakeRandomImage<TypeParam>(random, size);
    itk::ShearWarpPreparedVolume<TypeParam> volume;
    const CountingParallelize               parallelize;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      ExpectSlicesOf<TypeParam>(image, axis, GetSlices<TypeParam>(volume, image, axis, parallelize));
    }
    EXPECT_EQ(volume.GetSizeInBytes(),
              (size[0] * size[1] * size[2] + (size[0] + 7) / 8 * ((size[1] + 7) / 8) * ((size[2] + 7) / 8)) *
                sizeof(TypeParam));
  }
}

TYPED_TEST(ShearWarpPreparedVolumeTyped, GivesTheMaximaOfCubesAlongEachAxis)
{
  Random random(209);
  for (const itk::Size<3> & size : { itk::Size<3>{ { 1, 1, 1 } }, { { 9, 8, 7 } }, { { 77, 26, 11 } } })
  {
    const auto image = MakeRandomImage<TypeParam>(random, size);
    const auto voxels = image->GetBufferPointer();
    const auto count = size[0] * size[1] * size[2];
    ForEachInstructionSet([&](const std::string &) {
      itk::ShearWarpPreparedVolume<TypeParam> volume(true);
      const CountingParallelize               parallelize;
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        const auto slices = GetSlices<TypeParam>(volume, image, axis, parallelize);
        EXPECT_EQ(slices.lowest, *std::min_element(voxels, voxels + count));
        EXPECT_EQ(slices.highest, *std::max_element(voxels, voxels + count));
        const auto blocks = volume.GetBlockExtrema(axis);
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
  Random     random(210);
  const auto image = MakeRandomImage<float>(random, { { 40, 9, 3 } });
  float *    voxels = image->GetBufferPointer();
  image->FillBuffer(std::numeric_limits<float>::quiet_NaN());
  voxels[50] = 3;
  voxels[400] = -7;
  ForEachInstructionSet([&](const std::string &) {
    itk::ShearWarpPreparedVolume<float> volume;
    const CountingParallelize           parallelize;
    const auto                          slices = GetSlices<float>(volume, image, 2, parallelize);
    EXPECT_EQ(slices.lowest, -7);
    EXPECT_EQ(slices.highest, 3);
    const auto blocks = volume.GetBlockExtrema(2);
    EXPECT_EQ(blocks.maxima[1], 3);
    EXPECT_EQ(blocks.maxima[0], -7);
    EXPECT_EQ(blocks.maxima[2], -std::numeric_limits<float>::infinity());
  });
}

TEST_F(ShearWarpPreparedVolume, AlongYAndZNoVoxelIsCopied)
{
  for (const unsigned int axis : { 1, 2 })
  {
    EXPECT_EQ(GetSlices(axis).voxels, m_Image->GetBufferPointer());
  }
  EXPECT_EQ(m_Parallelize.calls, 1);
  EXPECT_EQ(m_Volume.GetSizeInBytes(), sizeof(short));
}

TEST_F(ShearWarpPreparedVolume, AlongXTheCopyIsMadeOnceAndKept)
{
  EXPECT_FALSE(m_Volume.IsPrepared(m_Image, 0));
  const auto slices = GetSlices(0);
  EXPECT_TRUE(m_Volume.IsPrepared(m_Image, 0));
  GetSlices(1);
  GetSlices(2);
  EXPECT_EQ(GetSlices(0).voxels, slices.voxels);
  EXPECT_EQ(m_Parallelize.calls, 2);
  EXPECT_EQ(m_Volume.GetSizeInBytes(), (4u * 5u * 6u + 1u) * sizeof(short));
}

TEST_F(ShearWarpPreparedVolume, AModifiedImageIsCopiedAgainToTheSameMemory)
{
  const short * memory = GetSlices(0).voxels;
  FillRandom(m_Random, m_Image.GetPointer());
  m_Image->Modified();
  EXPECT_FALSE(m_Volume.IsPrepared(m_Image, 0));
  const auto slices = GetSlices(0);
  ExpectSlicesOf<short>(m_Image, 0, slices);
  EXPECT_EQ(slices.voxels, memory);
  EXPECT_EQ(m_Parallelize.calls, 4);
}

TEST_F(ShearWarpPreparedVolume, AnotherImageIsCopiedAgain)
{
  const auto other = MakeRandomImage<short>(m_Random, { { 4, 5, 6 } });
  GetSlices(0);
  EXPECT_FALSE(m_Volume.IsPrepared(other, 0));
  ExpectSlicesOf<short>(other, 0, GetSlices(0, other));
  ExpectSlicesOf<short>(m_Image, 0, GetSlices(0));
  EXPECT_EQ(m_Parallelize.calls, 6);
}

TEST_F(ShearWarpPreparedVolume, AChangedImageSeenAlongZFreesTheCopy)
{
  GetSlices(0);
  m_Image->Modified();
  GetSlices(2);
  EXPECT_EQ(m_Volume.GetSizeInBytes(), sizeof(short));
}

TEST_F(ShearWarpPreparedVolume, ReleaseFreesTheCopy)
{
  m_Volume.Release();
  GetSlices(0);
  m_Volume.Release();
  EXPECT_EQ(m_Volume.GetSizeInBytes(), 0u);
  EXPECT_FALSE(m_Volume.IsPrepared(m_Image, 0));
  ExpectSlicesOf<short>(m_Image, 0, GetSlices(0));
  EXPECT_EQ(m_Parallelize.calls, 4);
}

TEST_F(ShearWarpPreparedVolume, KeepsNothingIfPreparationThrows)
{
  const auto failing = [](itk::SizeValueType, itk::SizeValueType, const itk::ShearWarp::Task & task) {
    task(0, 0, 0);
    throw std::runtime_error("stopped");
  };
  EXPECT_THROW(::GetSlices<short>(m_Volume, m_Image, 0, failing), std::runtime_error);
  EXPECT_FALSE(m_Volume.IsPrepared(m_Image, 0));
  EXPECT_EQ(m_Volume.GetSizeInBytes(), 0u);
  ExpectSlicesOf<short>(m_Image, 0, GetSlices(0));
}
