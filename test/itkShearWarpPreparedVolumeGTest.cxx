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
#include "itkShearWarpPreparedVolume.h"

#include "itkShearWarpMIPTestHelper.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace
{
using namespace itk::ShearWarpMIPTest;

/** Counts the calls, and splits the work into bands of three. */
struct CountingParallelize
{
  template <typename TFunction>
  void
  operator()(itk::SizeValueType count, const TFunction & function) const
  {
    ++calls;
    for (itk::SizeValueType begin = 0; begin < count; begin += 3)
    {
      function(begin, std::min(begin + 3, count));
    }
  }
  mutable int calls{ 0 };
};

template <typename TPixel>
void
ExpectSlicesOf(const itk::Image<TPixel, 3> *              image,
               unsigned int                               axis,
               const itk::ShearWarp::SliceStack<TPixel> & slices)
{
  const auto         region = image->GetBufferedRegion();
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

using ImageType = itk::Image<short, 3>;
using VolumeType = itk::ShearWarpPreparedVolume<short>;
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
      ExpectSlicesOf<TypeParam>(image, axis, volume.GetSlices(image, axis, parallelize));
    }
    EXPECT_EQ(volume.GetSizeInBytes(), size[0] * size[1] * size[2] * sizeof(TypeParam));
  }
}

TEST(ShearWarpPreparedVolume, AlongYAndZNothingIsCopied)
{
  Random                    random(202);
  const auto                image = MakeRandomImage<short>(random, { { 4, 5, 6 } });
  VolumeType                volume;
  const CountingParallelize parallelize;
  for (const unsigned int axis : { 1, 2 })
  {
    EXPECT_TRUE(volume.IsPrepared(image, axis));
    EXPECT_EQ(volume.GetSlices(image, axis, parallelize).voxels, image->GetBufferPointer());
  }
  EXPECT_EQ(parallelize.calls, 0);
  EXPECT_EQ(volume.GetSizeInBytes(), 0u);
}

TEST(ShearWarpPreparedVolume, AlongXTheCopyIsMadeOnceAndKept)
{
  Random                    random(203);
  const auto                image = MakeRandomImage<short>(random, { { 4, 5, 6 } });
  VolumeType                volume;
  const CountingParallelize parallelize;
  EXPECT_FALSE(volume.IsPrepared(image, 0));
  const auto slices = volume.GetSlices(image, 0, parallelize);
  EXPECT_TRUE(volume.IsPrepared(image, 0));
  volume.GetSlices(image, 1, parallelize);
  volume.GetSlices(image, 2, parallelize);
  EXPECT_EQ(volume.GetSlices(image, 0, parallelize).voxels, slices.voxels);
  EXPECT_EQ(parallelize.calls, 1);
  EXPECT_EQ(volume.GetSizeInBytes(), 4u * 5u * 6u * sizeof(short));
}

TEST(ShearWarpPreparedVolume, AModifiedImageIsCopiedAgain)
{
  Random                    random(204);
  const auto                image = MakeRandomImage<short>(random, { { 4, 5, 6 } });
  VolumeType                volume;
  const CountingParallelize parallelize;
  volume.GetSlices(image, 0, parallelize);
  FillRandom(random, image.GetPointer());
  image->Modified();
  EXPECT_FALSE(volume.IsPrepared(image, 0));
  ExpectSlicesOf<short>(image, 0, volume.GetSlices(image, 0, parallelize));
  EXPECT_EQ(parallelize.calls, 2);
}

TEST(ShearWarpPreparedVolume, AnotherImageIsCopiedAgain)
{
  Random                    random(205);
  const auto                first = MakeRandomImage<short>(random, { { 4, 5, 6 } });
  const auto                second = MakeRandomImage<short>(random, { { 4, 5, 6 } });
  VolumeType                volume;
  const CountingParallelize parallelize;
  volume.GetSlices(first, 0, parallelize);
  EXPECT_FALSE(volume.IsPrepared(second, 0));
  ExpectSlicesOf<short>(second, 0, volume.GetSlices(second, 0, parallelize));
  ExpectSlicesOf<short>(first, 0, volume.GetSlices(first, 0, parallelize));
  EXPECT_EQ(parallelize.calls, 3);
}

TEST(ShearWarpPreparedVolume, AChangedImageSeenAlongZFreesTheCopy)
{
  Random                    random(206);
  const auto                image = MakeRandomImage<short>(random, { { 4, 5, 6 } });
  VolumeType                volume;
  const CountingParallelize parallelize;
  volume.GetSlices(image, 0, parallelize);
  image->Modified();
  volume.GetSlices(image, 2, parallelize);
  EXPECT_EQ(volume.GetSizeInBytes(), 0u);
}

TEST(ShearWarpPreparedVolume, ReleaseFreesTheCopy)
{
  Random                    random(207);
  const auto                image = MakeRandomImage<short>(random, { { 4, 5, 6 } });
  VolumeType                volume;
  const CountingParallelize parallelize;
  volume.Release();
  volume.GetSlices(image, 0, parallelize);
  volume.Release();
  EXPECT_EQ(volume.GetSizeInBytes(), 0u);
  EXPECT_FALSE(volume.IsPrepared(image, 0));
  ExpectSlicesOf<short>(image, 0, volume.GetSlices(image, 0, parallelize));
  EXPECT_EQ(parallelize.calls, 2);
}

TEST(ShearWarpPreparedVolume, KeepsNothingIfPreparationThrows)
{
  Random                    random(208);
  const auto                image = MakeRandomImage<short>(random, { { 4, 5, 6 } });
  VolumeType                volume;
  const CountingParallelize parallelize;
  const auto                failing = [](itk::SizeValueType, const auto & function) {
    function(0, 1);
    throw std::runtime_error("stopped");
  };
  EXPECT_THROW(volume.GetSlices(image, 0, failing), std::runtime_error);
  EXPECT_FALSE(volume.IsPrepared(image, 0));
  EXPECT_EQ(volume.GetSizeInBytes(), 0u);
  ExpectSlicesOf<short>(image, 0, volume.GetSlices(image, 0, parallelize));
}
