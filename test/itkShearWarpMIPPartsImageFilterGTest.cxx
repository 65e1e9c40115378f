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
#include "itkShearWarpMIPTestParts.h"

#include "itkCastImageFilter.h"
#include "itkShearWarpMIPView.h"

#include <cstring>

namespace
{
using namespace itk::ShearWarpMIPTest;
using ImageType = itk::Image<short, 3>;
using RegionType = itk::ImageRegion<3>;
using PartsFilterType = itk::ShearWarpMIPPartsImageFilter<ImageType>;
using ReducedResamplingEnum = itk::ShearWarpMIPImageFilterEnums::ReducedResampling;
using ModeEnum = itk::ShearWarpMIPImageFilterEnums::Mode;

/** A filter for parts of \a image, of which it has the geometry alone. */
template <typename TPixel>
auto
MakePartsFilterOf(const itk::Image<TPixel, 3> * image, const ViewType * view, unsigned int oversampling = 1)
{
  const auto filter = itk::ShearWarpMIPPartsImageFilter<itk::Image<TPixel, 3>>::New();
  filter->SetInput(MakeOutline(image));
  filter->SetTransform(view);
  filter->SetOversampling(oversampling);
  return filter;
}

template <typename TPixel>
class ShearWarpMIPPartsTyped : public testing::Test
{};

using PixelTypes =
  itk::ShearWarpMIPTest::TestedTypes<unsigned char, signed char, unsigned short, short, float, int, double>;
TYPED_TEST_SUITE(ShearWarpMIPPartsTyped, PixelTypes, );

class ShearWarpMIPParts : public testing::Test
{
protected:
  Random                   m_Random{ 1104 };
  ImageType::Pointer       m_Image{ MakeRandomImage<short>(m_Random, { { 40, 30, 20 } }) };
  ViewType::Pointer        m_View{ MakeRandomView(m_Random, ViewKind::Rigid, m_Image) };
  PartsFilterType::Pointer m_Filter{ MakePartsFilterOf<short>(m_Image, m_View) };
};
} // namespace

TYPED_TEST(ShearWarpMIPPartsTyped, RandomPartsGiveThePictureOfTheWhole)
{
  Random random(1101);
  ForEachInstructionSet([&](const std::string & name) {
    for (int repeat = 0; repeat < 30; ++repeat)
    {
      const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, repeat % 2 ? 12 : 60));
      if constexpr (std::is_floating_point_v<TypeParam>)
      {
        using Limits = std::numeric_limits<TypeParam>;
        constexpr TypeParam specials[] = {
          Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), 0, -TypeParam{}
        };
        const auto count = static_cast<std::int64_t>(image->GetPixelContainer()->Size());
        for (std::int64_t n = 0; repeat % 5 == 0 && n < count; n += random.Integer(1, 9))
        {
          image->GetBufferPointer()[n] = specials[random.Integer(0, 4)];
        }
      }
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

      const auto whole = image->GetLargestPossibleRegion();
      const auto picture = MakePartsFilter(filter.GetPointer());
      const int  thinnest = repeat % 4 == 0 ? 1 : 5;
      const auto together = MakePartsFilterOf<TypeParam>(image, view, oversampling);
      for (const RegionType & region : MakeRandomParts(random, whole, thinnest, 25))
      {
        // by a filter that has seen other parts, or by one of its own
        const auto alone = MakePartsFilterOf<TypeParam>(image, view, oversampling);
        const auto projector = random.Integer(0, 1) == 0 ? together : alone;
        projector->SetNumberOfWorkUnits(static_cast<itk::ThreadIdType>(random.Integer(1, 3)));
        const auto part = projector->ProjectPart(MakePart(image.GetPointer(), region));
        picture->AddPart(part);
        const auto axis = filter->GetPrincipalAxis();
        const auto size = part->GetLargestPossibleRegion().GetSize();
        const auto bound = [&](unsigned int n) { return oversampling * (region.GetSize(n) + region.GetSize(axis)); };
        EXPECT_EQ(size[0], sizeof(TypeParam));
        EXPECT_LE(size[1], bound(axis == 0 ? 1 : 0));
        EXPECT_LE(size[2], bound(axis == 2 ? 1 : 2));
      }
      picture->Update();
      EXPECT_TRUE(HaveSamePixels(filter->GetOutput(), picture->GetOutput()));
      EXPECT_EQ(filter->GetOutput()->GetOrigin(), picture->GetOutput()->GetOrigin());
      EXPECT_EQ(filter->GetOutput()->GetSpacing(), picture->GetOutput()->GetSpacing());
    }
  });
}

/** Parts by all rules, merged in a tree. */
TYPED_TEST(ShearWarpMIPPartsTyped, MergedPartsGiveThePictureOfTheWhole)
{
  using FilterType = itk::ShearWarpMIPImageFilter<itk::Image<TypeParam, 3>>;
  const std::function<void(FilterType *)> changes[] = {
    [](FilterType * filter) { filter->SetMode(ModeEnum::Minimum); },
    [](FilterType * filter) { filter->SetMode(ModeEnum::AbsoluteMaximum); },
    [](FilterType * filter) { filter->SetMode(std::is_integral_v<TypeParam> ? ModeEnum::Mean : ModeEnum::Minimum); },
    [](FilterType * filter) { filter->ComputeDepthOn(); },
    [](FilterType * filter) { filter->SetInterpolation(itk::ShearWarpMIPImageFilterEnums::Interpolation::Nearest); },
    [](FilterType * filter) {
      filter->SetMode(ModeEnum::Minimum);
      filter->ComputeDepthOn();
      filter->ExactOn();
    },
    [](FilterType * filter) { filter->ExactOn(); }
  };
  Random random(1106);
  for (int repeat = 0; repeat < 28; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, repeat % 2 ? 12 : 40));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter(image, view);
    changes[repeat % 7](filter);
    filter->SetDefaultPixelValue(TypeParam{ 7 });
    if (repeat % 4 == 1)
    {
      const auto center = itk::ShearWarpMIPView::GetCenter(image);
      filter->SetCropUpper(center + PointType(random.Uniform(0, 9)).GetVectorFromOrigin());
      filter->SetSlabNear(view->GetInverseTransform()->TransformPoint(center)[2] - random.Uniform(0, 9));
    }
    filter->Update();
    const auto picture = MakePartsFilter(filter.GetPointer());
    const auto merger = MakePartsFilter(filter.GetPointer());
    for (const RegionType & region : MakeRandomParts(random, image->GetLargestPossibleRegion(), 3, 25))
    {
      merger->AddPart(picture->ProjectPart(MakePart(image.GetPointer(), region)));
      if (merger->GetNumberOfParts() == 3)
      {
        picture->AddPart(merger->MergeParts());
        merger->ClearParts();
      }
    }
    if (merger->GetNumberOfParts() > 0)
    {
      picture->AddPart(merger->MergeParts());
    }
    picture->Update();
    EXPECT_TRUE(HaveSamePixels(filter->GetOutput(), picture->GetOutput()));
    if (filter->GetComputeDepth())
    {
      EXPECT_TRUE(HaveSamePixels(filter->GetDepthOutput(), picture->GetDepthOutput()));
    }
  }
}

TEST_F(ShearWarpMIPParts, APartWithoutSamplesHasTheLowestValue)
{
  RegionType region = m_Image->GetLargestPossibleRegion();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    region.SetIndex(axis, region.GetIndex(axis) + 3);
    region.SetSize(axis, 1);
  }
  for (const unsigned int oversampling : { 1, 2 })
  {
    m_Filter->SetOversampling(oversampling);
    const auto         bytes = GetPixels(m_Filter->ProjectPart(MakePart(m_Image.GetPointer(), region)));
    std::vector<short> pixels(bytes.size() / sizeof(short));
    ASSERT_FALSE(pixels.empty());
    std::memcpy(pixels.data(), bytes.data(), bytes.size());
    EXPECT_EQ(pixels, std::vector<short>(pixels.size(), std::numeric_limits<short>::lowest()));
  }
}

TEST_F(ShearWarpMIPParts, APartIsPreparedOnce)
{
  const auto expected = m_Filter->ProjectPart(m_Image);
  EXPECT_GT(m_Filter->GetPreparationSeconds(), 0.0);
  m_Filter->SetReducedResampling(ReducedResamplingEnum::Off);
  for (int repeat = 0; repeat < 2; ++repeat)
  {
    EXPECT_TRUE(HaveSamePixels(expected, m_Filter->ProjectPart(m_Image)));
    EXPECT_EQ(m_Filter->GetPreparationSeconds() == 0.0, repeat == 0);
    EXPECT_GT(m_Filter->GetPreparedVolumeSizeInBytes(), 0u);
    m_Filter->ReleasePreparedVolume();
    EXPECT_EQ(m_Filter->GetPreparedVolumeSizeInBytes(), 0u);
    m_Filter->SetReducedResampling(ReducedResamplingEnum::On);
  }

  // another piece of the same image, which is changed then
  RegionType half = m_Image->GetLargestPossibleRegion();
  half.SetSize(2, 10);
  const auto part = MakePart(m_Image.GetPointer(), half);
  for (int repeat = 0; repeat < 2; ++repeat)
  {
    const auto fresh = MakePartsFilterOf<short>(m_Image, m_View)->ProjectPart(part);
    EXPECT_FALSE(HaveSamePixels(expected, fresh));
    EXPECT_TRUE(HaveSamePixels(fresh, m_Filter->ProjectPart(part)));
    EXPECT_GT(m_Filter->GetPreparationSeconds(), 0.0);
    FillRandom(m_Random, part.GetPointer());
    part->Modified();
  }
}

TEST_F(ShearWarpMIPParts, BlockExtremaAreFoundWhereTheyAreUsed)
{
  for (int repeat = 0; repeat < 8; ++repeat)
  {
    const auto view = MakeRandomView(m_Random, ViewKind::Rigid, m_Image);
    const auto filter = MakePartsFilterOf<short>(m_Image, view);
    const auto expected = MakePartsFilterOf<short>(m_Image, view)->ProjectPart(m_Image);
    for (const auto mode : { ReducedResamplingEnum::Off, ReducedResamplingEnum::On, ReducedResamplingEnum::Off })
    {
      if (repeat % 2 == 1)
      {
        filter->ReleasePreparedVolume();
      }
      const auto before = GetPreparedBytes(filter.GetPointer());
      filter->SetReducedResampling(mode);
      EXPECT_TRUE(HaveSamePixels(expected, filter->ProjectPart(m_Image)));
      const auto copy = filter->GetPrincipalAxis() == 0 ? sizeof(short) * 40 * 30 * 20 : 0u;
      const auto after = GetPreparedBytes(filter.GetPointer());
      const auto prepared = copy + sizeof(short) * 5 * 4 * 3;
      EXPECT_EQ(after, mode != ReducedResamplingEnum::Off ? prepared : before == 0 ? copy : before);
    }
  }
}

TEST_F(ShearWarpMIPParts, OneViewAlongXIsOfSlabs)
{
  const auto image = MakeRandomImage<short>(m_Random, { { 500, 300, 75 } });
  RegionType region = image->GetLargestPossibleRegion();
  region.SetIndex(2, region.GetIndex(2) + 20);
  region.SetSize(2, 52);
  const auto part = MakePart(image.GetPointer(), region);
  const auto view =
    MakeView(MakeAxisMatrix(0) * MakeMatrix({ { 1, 0, 0.3 }, { 0, 1, -0.7 }, { 0, 0, 1 } }), PointType(0.0));
  for (const auto & geometry : { image, part })
  {
    geometry->SetDirection(MakeDiagonal(1, 1, 1));
    geometry->SetSpacing(MakeVector3(1, 1, 1));
  }
  for (const unsigned int threads : { 1, 3 })
  {
    const unsigned int oversampling = threads == 1 ? 2 : 1;
    const auto         expected = MakePartsFilterOf<short>(image, view, oversampling)->ProjectPart(part);
    const auto         filter = MakePartsFilterOf<short>(image, view, oversampling);
    filter->SetNumberOfWorkUnits(threads);
    filter->SetReducedResampling(ReducedResamplingEnum::Off);
    for (int repeat = 0; repeat < 2; ++repeat)
    {
      EXPECT_TRUE(HaveSamePixels(expected, filter->ProjectPart(part)));
      EXPECT_EQ(filter->GetPrincipalAxis(), 0u);
      EXPECT_GT(filter->GetPreparationSeconds(), 0.0);
      EXPECT_GT(GetPreparedBytes(filter.GetPointer()), 0u);
      EXPECT_LT(GetPreparedBytes(filter.GetPointer()), sizeof(short) * 500 * 300 * 30);
      EXPECT_EQ(filter->GetProgress(), 1.0f);
    }
  }
}

TEST_F(ShearWarpMIPParts, AbortThrowsAndTheNextCallIsRight)
{
  m_Image = MakeRandomImage<short>(m_Random, { { 50, 60, 70 } });
  m_Filter = MakePartsFilterOf<short>(m_Image, m_View);
  const auto expected = m_Filter->ProjectPart(m_Image);
  m_Filter->AddPart(expected);
  m_Filter->Update();
  const auto picture = Copy(m_Filter->GetOutput());
  m_Filter->SetNumberOfWorkUnits(1);
  const std::function<void()> calls[] = { [this] { m_Filter->ProjectPart(m_Image); },
                                          [this] { UpdateAnew(m_Filter); } };
  for (const auto & call : calls)
  {
    m_Filter->ReleasePreparedVolume();
    float      last = 0.0f;
    const auto observer = m_Filter->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) {
      if (m_Filter->GetProgress() > 0.0f)
      {
        EXPECT_GE(m_Filter->GetProgress(), last);
        last = m_Filter->GetProgress();
        m_Filter->SetAbortGenerateData(last > 0.4f);
      }
    });
    EXPECT_THROW(call(), itk::ProcessAborted);
    EXPECT_LT(last, 0.9f);
    m_Filter->RemoveObserver(observer);
    EXPECT_NO_THROW(call());
    EXPECT_EQ(m_Filter->GetProgress(), 1.0f);
    EXPECT_TRUE(HaveSamePixels(expected, m_Filter->ProjectPart(m_Image)));
    UpdateAnew(m_Filter);
    EXPECT_TRUE(HaveSamePixels(picture, m_Filter->GetOutput()));
  }
}

TEST_F(ShearWarpMIPParts, PartsLeaveTheInputUnread)
{
  const auto source = itk::CastImageFilter<ImageType, ImageType>::New();
  source->InPlaceOff();
  source->SetInput(m_Image);
  int runs = 0;
  source->AddObserver(itk::StartEvent(), [&](const itk::EventObject &) { ++runs; });
  const auto projection = m_Filter->ProjectPart(m_Image);
  const auto filter = PartsFilterType::New();
  filter->SetInput(source->GetOutput());
  filter->SetTransform(m_View);
  EXPECT_EQ(filter->GetNumberOfParts(), 0u);
  filter->AddPart(projection);
  EXPECT_EQ(filter->GetNumberOfParts(), 1u);
  ExpectPrinted(filter, { "NumberOfParts: 1" });
  filter->Update();
  EXPECT_EQ(runs, 0);
  EXPECT_EQ(filter->GetProgress(), 1.0f);

  filter->ClearParts();
  EXPECT_EQ(filter->GetNumberOfParts(), 0u);
  EXPECT_NAMES(filter->Update(), "Parts are required but not added");
}

TEST_F(ShearWarpMIPParts, BadInputIsNamed)
{
  const auto filter = PartsFilterType::New();
  EXPECT_NAMES(filter->ProjectPart(m_Image), "Primary");
  EXPECT_NAMES(filter->Update(), "Primary");
  filter->SetInput(MakeOutline(m_Image.GetPointer()));
  EXPECT_NAMES(filter->ProjectPart(nullptr), "The part must not be null");
  EXPECT_NAMES(filter->ProjectPart(MakeOutline(m_Image.GetPointer())), "there are 0 voxels");
  filter->SetTransform(nullptr);
  EXPECT_NAMES(filter->ProjectPart(m_Image), "Transform");
  filter->SetTransform(m_View);
  filter->SetOversampling(3);
  EXPECT_NAMES(filter->ProjectPart(m_Image), "Oversampling must be 1 or 2, but it is 3");
  filter->SetOversampling(2);
  const auto larger = ImageType::New();
  larger->CopyInformation(m_Image);
  RegionType region = m_Image->GetLargestPossibleRegion();
  region.SetIndex(1, region.GetIndex(1) - 1);
  larger->SetRegions(region);
  larger->Allocate(true);
  EXPECT_NAMES(filter->ProjectPart(larger), "A part must not be empty and lie within the volume", "axis 1", "-1");

  filter->UpdateOutputInformation();
  EXPECT_GT(filter->GetOutput()->GetLargestPossibleRegion().GetNumberOfPixels(), 0u);
  EXPECT_NAMES(filter->AddPart(nullptr), "The projection of a part must not be null");
  EXPECT_NAMES(filter->AddPart(itk::Image<unsigned char, 3>::New()), "projection of a part", "0 voxels");
  const auto oversampled = filter->ProjectPart(m_Image);
  filter->AddPart(oversampled);
  filter->SetOversampling(1);
  EXPECT_NAMES(filter->Update(), "The projection of part 1 must be of the filter's parameters");
  filter->SetOversampling(2);
  EXPECT_NO_THROW(filter->Update());
  oversampled->SetOrigin(itk::Point<double, 3>(1.0));
  EXPECT_NAMES(filter->Update(), "The projection of part 1 must lie within the intermediate image");
  oversampled->SetOrigin(itk::Point<double, 3>(0.0));
  Shorten(oversampled.GetPointer());
  filter->Modified();
  EXPECT_NAMES(filter->Update(), "The projection of a part must be buffered where it is requested");
}

TEST_F(ShearWarpMIPParts, ProjectionsKeepTheirPlaceInFiles)
{
  const auto filter = MakeFilter(m_Image, m_View);
  filter->Update();
  const auto whole = m_Image->GetLargestPossibleRegion();
  for (const bool isOrigin : { false, true })
  {
    m_Filter->ClearParts();
    for (const RegionType & region : MakeRandomParts(m_Random, whole, 5, 25))
    {
      const auto projection = m_Filter->ProjectPart(MakePart(m_Image.GetPointer(), region));
      const auto place = projection->GetBufferedRegion();
      if (isOrigin)
      {
        // as files store the place
        itk::Point<double, 3> origin;
        projection->TransformIndexToPhysicalPoint(place.GetIndex(), origin);
        projection->SetOrigin(origin);
        projection->SetRegions(place.GetSize());
      }
      else
      {
        // as Python's pickle of ITK leaves the regions
        projection->SetLargestPossibleRegion({ { { 0, 0, 0 } }, place.GetSize() });
      }
      m_Filter->AddPart(projection);
    }
    m_Filter->Update();
    EXPECT_TRUE(HaveSamePixels(filter->GetOutput(), m_Filter->GetOutput()));
  }
}

TEST_F(ShearWarpMIPParts, ProjectionsOfAnotherViewAreAnError)
{
  m_Filter->AddPart(m_Filter->ProjectPart(m_Image));
  m_Filter->Update();
  const auto turned = MakeRandomView(m_Random, ViewKind::Rigid, m_Image);
  m_Filter->SetTransform(turned);
  EXPECT_NAMES(m_Filter->Update(), "The projection of part 1 must be of the filter's parameters");
  m_Filter->ClearParts();
  m_Filter->AddPart(m_Filter->ProjectPart(m_Image));
  EXPECT_NO_THROW(m_Filter->Update());
}

TEST_F(ShearWarpMIPParts, AChangedProjectionMakesTheFilterUpdate)
{
  const auto projection = m_Filter->ProjectPart(m_Image);
  m_Filter->AddPart(projection);
  m_Filter->Update();
  const auto before = m_Filter->GetOutput()->GetTimeStamp();
  m_Filter->Update();
  EXPECT_EQ(m_Filter->GetOutput()->GetTimeStamp(), before);
  projection->FillBuffer(3);
  projection->Modified();
  m_Filter->Update();
  const auto center = m_Filter->GetOutput()->GetLargestPossibleRegion().GetSize();
  EXPECT_EQ(m_Filter->GetOutput()->GetPixel({ { static_cast<long>(center[0] / 2), static_cast<long>(center[1] / 2) } }),
            0x0303);
}

TEST_F(ShearWarpMIPParts, WhatDoesNotMergeIsAnError)
{
  const std::function<void(PartsFilterType *)> changes[] = {
    [](PartsFilterType * filter) { filter->SetDepthAttenuation(0.1); },
    [](PartsFilterType * filter) { filter->LocalMaximumOn(); },
    [](PartsFilterType * filter) { filter->SetNumberOfStreamDivisions(2); },
    [this](PartsFilterType * filter) {
      filter->SetMaskImage(MakeAlike<unsigned char, 3>(m_Image, m_Image->GetLargestPossibleRegion()));
    }
  };
  const auto projection = m_Filter->ProjectPart(m_Image);
  for (const auto & change : changes)
  {
    const auto filter = MakePartsFilterOf<short>(m_Image, m_View);
    filter->AddPart(projection);
    EXPECT_NO_THROW(filter->Update());
    change(filter);
    EXPECT_NAMES(filter->Update(), "Parts have no");
    EXPECT_NAMES(filter->ProjectPart(m_Image), "Parts have no");
    EXPECT_NAMES(filter->MergeParts(), "Parts have no");
  }
  const auto image = MakeRandomImage<float>(m_Random, { { 9, 8, 7 } });
  const auto mean = MakePartsFilterOf<float>(image, m_View);
  mean->SetMode(ModeEnum::Mean);
  EXPECT_NAMES(mean->ProjectPart(image), "Parts have no Mode Mean of floating-point pixels");
}

/** Another rule, or a view that only this rule distinguishes, is another intermediate image. */
TEST_F(ShearWarpMIPParts, ProjectionsByAnotherRuleAreAnError)
{
  const std::function<void(PartsFilterType *)> changes[] = {
    [](PartsFilterType * filter) { filter->SetMode(ModeEnum::Minimum); },
    [](PartsFilterType * filter) { filter->SetMode(ModeEnum::Mean); },
    [](PartsFilterType * filter) {
      filter->SetInterpolation(itk::ShearWarpMIPImageFilterEnums::Interpolation::Nearest);
    },
    [](PartsFilterType * filter) { filter->SetSlabFar(1e9); },
    [](PartsFilterType * filter) { filter->SetCropLower(PointType(-1e9)); },
    [](PartsFilterType * filter) { filter->ComputeDepthOn(); },
    [](PartsFilterType * filter) { filter->ExactOn(); }
  };
  const auto expectRefused = [this](const auto & before, const auto & change) {
    const auto filter = MakePartsFilterOf<short>(m_Image, m_View);
    before(filter.GetPointer());
    filter->AddPart(filter->ProjectPart(m_Image));
    EXPECT_NO_THROW(filter->Update());
    change(filter.GetPointer());
    EXPECT_NAMES(filter->Update(), "The projection of part 1 must be of the filter's parameters");
    EXPECT_NAMES(filter->MergeParts(), "The projection of part 1 must be of the filter's parameters");
    filter->ClearParts();
    EXPECT_NAMES(filter->MergeParts(), "Parts are required but not added");
  };
  for (const auto & change : changes)
  {
    expectRefused([](PartsFilterType *) {}, change);
  }
  // a part of an exact picture has pixels of the grid
  expectRefused([](PartsFilterType * filter) { filter->ExactOn(); },
                [](PartsFilterType * filter) { filter->SetSize({ { 5, 5 } }); });
}

/** Where the volume lies matters to limits and to exact rays, even if the shear stays the same. */
TEST_F(ShearWarpMIPParts, ProjectionsOfAnotherInputGeometryAreAnError)
{
  const std::function<void(PartsFilterType *)> changes[] = { [](PartsFilterType * filter) { filter->SetSlabFar(9); },
                                                             [](PartsFilterType * filter) {
                                                               filter->SetCropLower(PointType(-9.0));
                                                             },
                                                             [](PartsFilterType * filter) {
                                                               filter->ExactOn();
                                                               filter->SetSize({ { 50, 50 } });
                                                               filter->SetOutputSpacing(itk::Vector<double, 2>(1.0));
                                                               filter->SetOutputOrigin(itk::Point<double, 2>(0.0));
                                                             } };
  for (const auto & change : changes)
  {
    const auto filter = MakePartsFilterOf<short>(m_Image, m_View);
    change(filter);
    filter->AddPart(filter->ProjectPart(m_Image));
    const auto moved = MakeOutline(m_Image.GetPointer());
    moved->SetOrigin(m_Image->GetOrigin() + itk::Vector<double, 3>(2.0));
    filter->SetInput(moved);
    EXPECT_NAMES(filter->Update(), "The projection of part 1 must be of the filter's parameters and input geometry");
  }
}

TEST_F(ShearWarpMIPParts, APointIsThatOfTheWhole)
{
  const auto whole = MakeFilter(m_Image, m_View);
  whole->ComputeDepthOn();
  whole->Update();
  const auto parts = MakePartsFilter(whole.GetPointer());
  parts->AddPart(parts->ProjectPart(m_Image));
  parts->Update();
  const auto                             size = whole->GetOutput()->GetLargestPossibleRegion().GetSize();
  const PartsFilterType::OutputIndexType index{ { static_cast<long>(size[0] / 2), static_cast<long>(size[1] / 2) } };
  EXPECT_EQ(parts->GetPhysicalPoint(index), whole->GetPhysicalPoint(index));
}
