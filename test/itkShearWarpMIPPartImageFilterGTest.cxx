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
#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPPartImageFilter.h"

#include "itkShearWarpMIPTestParts.h"

#include "itkCastImageFilter.h"
#include "itkTranslationTransform.h"

namespace
{
using namespace itk::ShearWarpMIPTest;
using RegionType = itk::ImageRegion<3>;
using ViewType = itk::Transform<double, 3, 3>;

template <typename TImagePointer>
auto
MakePartFilter(const TImagePointer & part, const RegionType & whole, const ViewType * view)
{
  const auto filter = itk::ShearWarpMIPPartImageFilter<std::decay_t<decltype(*part)>>::New();
  filter->SetInput(part);
  if (whole != RegionType{})
  {
    filter->SetWholeRegion(whole);
  }
  filter->SetTransform(view);
  return filter;
}

template <typename TImagePointer>
auto
ProjectPart(const TImagePointer & part,
            const RegionType &    whole,
            const ViewType *      view,
            unsigned int          oversampling = 1,
            unsigned int          threads = 1)
{
  const auto filter = MakePartFilter(part, whole, view);
  filter->SetOversampling(oversampling);
  filter->SetNumberOfWorkUnits(threads);
  filter->Update();
  return Copy(filter->GetOutput());
}

template <typename TPixel>
class ShearWarpMIPPartTyped : public testing::Test
{};

using PixelTypes = testing::Types<unsigned char, signed char, unsigned short, short, float, int, double>;
TYPED_TEST_SUITE(ShearWarpMIPPartTyped, PixelTypes, );

using ImageType = itk::Image<short, 3>;
using PartFilterType = itk::ShearWarpMIPPartImageFilter<ImageType>;
using MergeFilterType = itk::ShearWarpMIPMergePartsImageFilter<ImageType>;
using ReducedResamplingEnum = itk::ShearWarpMIPImageFilterEnums::ReducedResampling;

auto
MakeUpstream(const ImageType * image)
{
  const auto source = itk::CastImageFilter<ImageType, ImageType>::New();
  source->SetInput(image);
  source->InPlaceOff();
  return source;
}
} // namespace

TYPED_TEST(ShearWarpMIPPartTyped, RandomPartsGiveThePictureOfTheWhole)
{
  Random random(1101);
  ForEachInstructionSet([&](const std::string & name) {
    for (int repeat = 0; repeat < 30; ++repeat)
    {
      const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, repeat % 2 ? 12 : 60));
      const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
      const auto oversampling = static_cast<unsigned int>(random.Integer(1, 2));
      SCOPED_TRACE(name + ", case " + std::to_string(repeat));

      const auto filter = MakeFilter(image, view);
      filter->SetOversampling(oversampling);
      filter->SetDefaultPixelValue(TypeParam{ 7 });
      // positions between the intermediate image's pixels, and beyond it
      filter->UpdateOutputInformation();
      filter->SetOutputSpacing(filter->GetOutput()->GetSpacing() * 0.73);
      filter->Update();
      const auto whole = Copy(filter->GetOutput());

      const auto merge = MakeMergeFilter(filter.GetPointer());
      const int  thinnest = repeat % 4 == 0 ? 1 : 5;
      for (const RegionType & region : MakeRandomParts(random, image->GetLargestPossibleRegion(), thinnest, 25))
      {
        const auto threads = static_cast<unsigned int>(random.Integer(1, 3));
        const auto part = ProjectPart(
          MakePart(image.GetPointer(), region), image->GetLargestPossibleRegion(), view, oversampling, threads);
        merge->SetPart(merge->GetNumberOfParts(), part);
        const auto axis = filter->GetPrincipalAxis();
        const auto size = part->GetLargestPossibleRegion().GetSize();
        const auto slices = region.GetSize(axis);
        const auto bound = [&](unsigned int n) { return oversampling * (region.GetSize(n) + slices); };
        const bool isX = axis == 0;
        EXPECT_LE(size[0], bound(isX ? 1 : 0));
        EXPECT_LE(size[1], bound(axis == 2 ? 1 : 2));
      }
      merge->Update();
      EXPECT_TRUE(HaveSamePixels(whole, merge->GetOutput()));
      EXPECT_EQ(whole->GetOrigin(), merge->GetOutput()->GetOrigin());
      EXPECT_EQ(whole->GetSpacing(), merge->GetOutput()->GetSpacing());
    }
  });
}

TEST(ShearWarpMIPPart, ASliceInSpaceAndNotANumberAreThoseOfTheWhole)
{
  using FloatImage = itk::Image<float, 3>;
  Random     random(1102);
  const auto image = MakeRandomImage<float>(random, { { 30, 31, 32 } });
  for (int n = 0; n < 6000; ++n)
  {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    constexpr float specials[] = { std::numeric_limits<float>::quiet_NaN(), infinity, -infinity, 0.0f, -0.0f };
    image->GetBufferPointer()[random.Integer(0, 30 * 31 * 32 - 1)] = specials[n % 5];
  }
  for (int repeat = 0; repeat < 10; ++repeat)
  {
    const auto view = MakeRandomView(random, ViewKind::Rigid, image);
    const auto filter = itk::ShearWarpMIPImageFilter<FloatImage, FloatImage>::New();
    filter->SetInput(image);
    filter->SetTransform(view);
    filter->Update();
    const FloatImage * whole = filter->GetOutput();
    const auto         merge = MakeMergeFilter(filter.GetPointer());
    for (const RegionType & region : MakeRandomParts(random, image->GetLargestPossibleRegion(), 3, 20))
    {
      const auto part =
        ProjectPart(MakePart(image.GetPointer(), region), image->GetLargestPossibleRegion(), view, 1, 2);
      merge->SetPart(merge->GetNumberOfParts(), part);
    }
    merge->Update();
    const FloatImage * joined = merge->GetOutput();
    EXPECT_EQ(joined->GetDirection(), whole->GetDirection());
    EXPECT_EQ(joined->GetOrigin(), whole->GetOrigin());
    EXPECT_TRUE(HaveSamePixels(joined, whole));
  }
}

TEST(ShearWarpMIPPart, APartWithoutSamplesHasTheLowestValue)
{
  Random     random(1103);
  const auto image = MakeRandomImage<short>(random, { { 9, 8, 7 } });
  RegionType region = image->GetLargestPossibleRegion();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    region.SetIndex(axis, region.GetIndex(axis) + 3);
    region.SetSize(axis, 1);
  }
  for (const unsigned int oversampling : { 1, 2 })
  {
    const auto view = MakeRandomView(random, ViewKind::Rigid, image);
    const auto part =
      ProjectPart(MakePart(image.GetPointer(), region), image->GetLargestPossibleRegion(), view, oversampling, 1);
    const auto pixels = GetPixels(part);
    ASSERT_FALSE(pixels.empty());
    EXPECT_EQ(pixels, std::vector<short>(pixels.size(), std::numeric_limits<short>::lowest()));
  }
}

TEST(ShearWarpMIPPart, AnImageWithASourceIsItsOwnPartAndIsPreparedOnce)
{
  Random     random(1104);
  const auto image = MakeRandomImage<short>(random, { { 40, 30, 20 } });
  const auto source = MakeUpstream(image);
  const auto view = MakeRandomView(random, ViewKind::Rigid, image);
  const auto filter = MakePartFilter(source->GetOutput(), {}, view);
  filter->Update();
  EXPECT_GT(filter->GetPreparationSeconds(), 0.0);
  const auto expected = ProjectPart(image, {}, view);
  EXPECT_TRUE(HaveSamePixels(expected, filter->GetOutput()));

  const auto updated = filter->GetOutput()->GetMTime();
  filter->Update();
  EXPECT_EQ(filter->GetOutput()->GetMTime(), updated);
  filter->SetReducedResampling(ReducedResamplingEnum::Off);
  filter->Update();
  EXPECT_EQ(filter->GetPreparationSeconds(), 0.0);
  EXPECT_TRUE(HaveSamePixels(expected, filter->GetOutput()));
  EXPECT_GT(filter->GetPreparedVolumeSizeInBytes(), 0u);
  filter->ReleasePreparedVolume();
  EXPECT_EQ(filter->GetPreparedVolumeSizeInBytes(), 0u);

  // another piece of the same image
  RegionType half = image->GetLargestPossibleRegion();
  half.SetSize(2, 10);
  const auto part = MakePart(image.GetPointer(), half);
  for (const RegionType & whole : { image->GetLargestPossibleRegion(), RegionType(), half })
  {
    filter->SetInput(part);
    filter->SetWholeRegion(whole);
    EXPECT_EQ(filter->GetWholeRegion(), whole);
    filter->Update();
    const auto fresh = ProjectPart(part, whole, view);
    EXPECT_TRUE(HaveSamePixels(fresh, filter->GetOutput()));
  }

  // what is buffered of an image whose source can give more
  const auto streamed = MakeUpstream(image);
  streamed->UpdateOutputInformation();
  streamed->GetOutput()->SetRequestedRegion(half);
  streamed->GetOutput()->Update();
  filter->SetInput(streamed->GetOutput());
  filter->SetWholeRegion({});
  filter->Update();
  const auto fresh = ProjectPart(part, image->GetLargestPossibleRegion(), view);
  EXPECT_EQ(streamed->GetOutput()->GetBufferedRegion(), half);
  EXPECT_TRUE(HaveSamePixels(fresh, filter->GetOutput()));
}

TEST(ShearWarpMIPPart, BlockExtremaAreFoundWhereTheyAreUsed)
{
  Random     random(1108);
  const auto image = MakeRandomImage<short>(random, { { 40, 30, 20 } });
  for (int repeat = 0; repeat < 8; ++repeat)
  {
    const auto view = MakeRandomView(random, ViewKind::Rigid, image);
    const auto expected = ProjectPart(image, {}, view);
    const auto filter = MakePartFilter(image, {}, view);
    for (const auto mode : { ReducedResamplingEnum::Off, ReducedResamplingEnum::On, ReducedResamplingEnum::Off })
    {
      if (repeat % 2 == 1)
      {
        filter->ReleasePreparedVolume();
      }
      const auto before = GetPreparedBytes(filter.GetPointer());
      filter->SetReducedResampling(mode);
      filter->Update();
      EXPECT_TRUE(HaveSamePixels(expected, filter->GetOutput()));
      const auto copy = filter->GetPrincipalAxis() == 0 ? sizeof(short) * 40 * 30 * 20 : 0u;
      const auto after = GetPreparedBytes(filter.GetPointer());
      if (mode == ReducedResamplingEnum::Off)
      {
        EXPECT_EQ(after, before == 0 ? copy : before);
      }
      else
      {
        EXPECT_EQ(after, copy + sizeof(short) * 5 * 4 * 3);
      }
    }
  }
}

TEST(ShearWarpMIPPart, OneViewAlongXIsOfSlabs)
{
  Random     random(1109);
  const auto image = MakeRandomImage<short>(random, { { 500, 300, 75 } });
  const auto whole = image->GetLargestPossibleRegion();
  RegionType region = whole;
  region.SetIndex(2, whole.GetIndex(2) + 20);
  region.SetSize(2, 52);
  const auto part = MakePart(image.GetPointer(), region);
  const auto view =
    MakeView(MakeAxisMatrix(0) * MakeMatrix({ { 1, 0, 0.3 }, { 0, 1, -0.7 }, { 0, 0, 1 } }), PointType(0.0));
  for (const unsigned int threads : { 1, 3 })
  {
    const auto filter = MakePartFilter(part, whole, view);
    filter->SetOversampling(threads == 1 ? 2 : 1);
    filter->SetNumberOfWorkUnits(threads);
    const auto expected = ProjectPart(part, whole, view, filter->GetOversampling());
    filter->SetReducedResampling(ReducedResamplingEnum::Off);
    for (int repeat = 0; repeat < 2; ++repeat)
    {
      UpdateAnew(filter);
      EXPECT_EQ(filter->GetPrincipalAxis(), 0u);
      EXPECT_TRUE(HaveSamePixels(expected, filter->GetOutput()));
      EXPECT_GT(filter->GetPreparationSeconds(), 0.0);
      EXPECT_GT(GetPreparedBytes(filter.GetPointer()), 0u);
      EXPECT_LT(GetPreparedBytes(filter.GetPointer()), sizeof(short) * 500 * 300 * 30);
      EXPECT_EQ(filter->GetProgress(), 1.0f);
    }
  }
}

TEST(ShearWarpMIPPart, AbortThrowsAndTheNextUpdateIsRight)
{
  Random     random(1105);
  const auto image = MakeRandomImage<short>(random, { { 50, 60, 70 } });
  const auto view = MakeRandomView(random, ViewKind::Rigid, image);
  const auto filter = MakePartFilter(image, {}, view);
  filter->SetNumberOfWorkUnits(1);
  float      last = 0.0f;
  const auto observer = filter->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) {
    EXPECT_GE(filter->GetProgress(), last);
    last = filter->GetProgress();
    filter->SetAbortGenerateData(last > 0.4f);
  });
  EXPECT_THROW(filter->Update(), itk::ProcessAborted);
  EXPECT_LT(last, 0.9f);
  filter->RemoveObserver(observer);
  filter->Update();
  EXPECT_EQ(filter->GetProgress(), 1.0f);
  EXPECT_TRUE(HaveSamePixels(ProjectPart(image, {}, view), filter->GetOutput()));
}

TEST(ShearWarpMIPPart, PartsLeaveTheInputUnread)
{
  Random     random(1106);
  const auto image = MakeRandomImage<short>(random, { { 12, 13, 14 } });
  const auto view = MakeRandomView(random, ViewKind::Rigid, image);
  const auto source = MakeUpstream(image);
  int        runs = 0;
  source->AddObserver(itk::StartEvent(), [&](const itk::EventObject &) { ++runs; });

  const auto filter = MergeFilterType::New();
  filter->SetInput(source->GetOutput());
  filter->SetTransform(view);
  filter->SetPart(0, ProjectPart(image, {}, view));
  EXPECT_EQ(filter->GetNumberOfParts(), 1u);
  filter->Update();
  EXPECT_EQ(runs, 0);
  EXPECT_EQ(filter->GetProgress(), 1.0f);

  filter->ClearParts();
  EXPECT_EQ(filter->GetNumberOfParts(), 0u);
  EXPECT_NAMES(filter->Update(), "Parts are required but not set");
}

TEST(ShearWarpMIPPart, BadInputIsNamed)
{
  Random     random(1107);
  const auto image = MakeRandomImage<short>(random, { { 12, 13, 14 } });
  const auto view = MakeRandomView(random, ViewKind::Rigid, image);

  const auto part = PartFilterType::New();
  EXPECT_NAMES(part->Update(), "Primary");
  part->SetInput(MakeOutline(image.GetPointer()));
  EXPECT_NAMES(part->Update(), "The input must be buffered where it is requested, but there are 0 voxels");
  part->SetInput(image);
  part->SetTransform(nullptr);
  EXPECT_NAMES(part->Update(), "Transform");
  part->SetTransform(view);
  part->SetOversampling(3);
  EXPECT_NAMES(part->Update(), "Oversampling must be 1 or 2, but it is 3");
  part->SetOversampling(2);
  part->SetWholeRegion(itk::Size<3>{ { 2, 2, 2 } });
  EXPECT_NAMES(part->Update(), "A part must not be empty and lie within the image's region");
  part->SetWholeRegion({});
  part->Update();

  const auto filter = MergeFilterType::New();
  EXPECT_EQ(filter->GetNumberOfParts(), 0u);
  EXPECT_NAMES(filter->Update(), "Primary");
  filter->SetInput(MakeOutline(image.GetPointer()));
  filter->SetTransform(view);
  filter->UpdateOutputInformation();
  EXPECT_GT(filter->GetOutput()->GetLargestPossibleRegion().GetNumberOfPixels(), 0u);
  EXPECT_NAMES(filter->Update(), "Parts are required but not set");
  filter->SetPart(1, part->GetOutput());
  EXPECT_NAMES(filter->Update(), "Part 0 of 2 is required but not set");
  filter->SetPart(0, part->GetOutput());
  EXPECT_NAMES(filter->Update(), "Part 0 must be buffered and lie within the intermediate image");
  filter->SetOversampling(2);
  filter->Update();
  filter->ComputeDepthOn();
  EXPECT_NAMES(filter->Update(), "Parts have plain maxima");
  filter->ComputeDepthOff();
  filter->SetMode(itk::ShearWarpMIPImageFilterEnums::Mode::Minimum);
  EXPECT_NAMES(filter->Update(), "Parts have plain maxima");
}
