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
#include "itkShearWarpMIPCineImageFilter.h"
#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPTestOracle.h"
#include "itkShearWarpMIPTestParts.h"

#include "itkMetaDataObject.h"

namespace
{
using namespace itk::ShearWarpMIPTest;
using itk::ShearWarpMIPView;
using ReducedResamplingEnum = itk::ShearWarpMIPImageFilterEnums::ReducedResampling;

template <typename TPixel>
using CineType = itk::ShearWarpMIPCineImageFilter<itk::Image<TPixel, 3>>;
template <typename TPixel>
using SingleType = itk::ShearWarpMIPImageFilter<itk::Image<TPixel, 3>>;

template <typename TImagePointer>
auto
MakeCine(const TImagePointer & image)
{
  const auto cine = itk::ShearWarpMIPCineImageFilter<std::decay_t<decltype(*image)>>::New();
  cine->SetInput(image);
  return cine;
}

template <typename TPixel>
typename itk::Image<TPixel, 2>::Pointer
GetFrame(const itk::Image<TPixel, 3> * frames, unsigned int n)
{
  EXPECT_EQ(frames->GetBufferedRegion(), frames->GetLargestPossibleRegion());
  const auto size = frames->GetBufferedRegion().GetSize();
  const auto frame = itk::Image<TPixel, 2>::New();
  frame->SetRegions(itk::Size<2>{ { size[0], size[1] } });
  frame->Allocate();
  std::copy_n(frames->GetBufferPointer() + n * size[0] * size[1], size[0] * size[1], frame->GetBufferPointer());
  return frame;
}

/** Compares each frame with the single filter's picture on the same grid. */
template <typename TPixel>
void
ExpectFramesOfTheSingleFilter(CineType<TPixel> * cine, SingleType<TPixel> * single)
{
  cine->Update();
  const auto * frames = cine->GetOutput();
  const auto   size = frames->GetLargestPossibleRegion().GetSize();
  SetGrid(single,
          { { size[0], size[1] } },
          MakeVector2(frames->GetSpacing()[0], frames->GetSpacing()[1]),
          MakePoint2(frames->GetOrigin()[0], frames->GetOrigin()[1]));
  for (unsigned int n = 0; n < size[2]; ++n)
  {
    single->SetTransform(cine->GetFrameTransform(n));
    single->Update();
    ASSERT_TRUE(HaveSamePixels(GetFrame(frames, n), single->GetOutput())) << "frame " << n;
    if (cine->GetComputeDepth())
    {
      ASSERT_TRUE(HaveSamePixels(GetFrame(cine->GetDepthOutput(), n), single->GetDepthOutput()))
        << "depths of frame " << n;
    }
  }
}

itk::Vector<double, 3>
MakeRandomAxis(Random & random)
{
  const auto axis = random.Integer(0, 5);
  return axis < 3 ? MakeVector3(axis == 0, axis == 1, axis == 2)
                  : MakeVector3(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
}

template <typename TPixel>
class ShearWarpMIPCineTyped : public testing::Test
{};
using PixelTypes =
  itk::ShearWarpMIPTest::TestedTypes<unsigned char, signed char, unsigned short, short, float, int, double>;
TYPED_TEST_SUITE(ShearWarpMIPCineTyped, PixelTypes, );
} // namespace

TYPED_TEST(ShearWarpMIPCineTyped, FramesHaveTheBitsOfTheSingleFilter)
{
  Random random(1001);
  for (int repeat = 0; repeat < 24; ++repeat)
  {
    SCOPED_TRACE("repetition " + std::to_string(repeat));
    // wider than vectors, and rows of several blocks
    const auto size = repeat % 2 == 0 ? MakeRandomSize(random, 40, 90) : MakeRandomSize(random, 1, 40);
    auto       image = MakeRandomImage<TypeParam>(random, size);
    if (repeat % 4 < 2)
    {
      // without directions, so that turns about image axes have a zero shear
      auto plain = MakePlainImage<TypeParam>(size);
      plain->SetSpacing(image->GetSpacing());
      FillRandom(random, plain.GetPointer());
      image = plain;
    }
    const auto cine = MakeCine(image);
    const auto single = MakeFilter(image);
    cine->SetNumberOfFrames(static_cast<unsigned int>(random.Integer(1, 13)));
    cine->SetRotationAxis(MakeRandomAxis(random));
    cine->SetStartAngle(random.Uniform(-400, 400));
    cine->SetAngularRange(repeat % 3 == 0 ? 360.0 : random.Uniform(-400, 400));
    cine->SetRocking(random.Integer(0, 3) == 0);
    const auto threads = static_cast<unsigned int>(random.Integer(1, 4));
    SetThreads(cine, threads);
    cine->SetIntermediateMemory(random.Integer(0, 2) == 0 ? 1 : 1 << 20);
    const auto reducedResampling = static_cast<ReducedResamplingEnum>(random.Integer(0, 2));
    const auto oversampling = static_cast<unsigned int>(random.Integer(1, 2));
    cine->SetReducedResampling(reducedResampling);
    cine->SetOversampling(oversampling);
    cine->SetDefaultPixelValue(TypeParam{ 7 });
    single->SetOversampling(oversampling);
    single->SetDefaultPixelValue(TypeParam{ 7 });
    ForEachInstructionSet([&](const std::string & name) {
      SCOPED_TRACE(name);
      cine->Modified();
      single->Modified();
      ExpectFramesOfTheSingleFilter(cine.GetPointer(), single.GetPointer());
    });
  }
}

TYPED_TEST(ShearWarpMIPCineTyped, EveryModeHasTheBitsOfTheSingleFilter)
{
  Random random(1002);
  for (int repeat = 0; repeat < 10; ++repeat)
  {
    SCOPED_TRACE("repetition " + std::to_string(repeat));
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 40));
    const auto cine = MakeCine(image);
    const auto single = MakeFilter(image);
    const auto view = MakeRandomView(random, ViewKind::Rigid, image);
    Random     sameRandom = random;
    DrawRule(random, cine.GetPointer(), view.GetPointer(), image.GetPointer());
    DrawRule(sameRandom, single.GetPointer(), view.GetPointer(), image.GetPointer());
    cine->SetTransform(view);
    // with opposite ones
    cine->SetNumberOfFrames(4 + repeat % 2);
    const bool hasDepth =
      repeat % 2 == 0 && itk::ShearWarp::HasFeature(single->GetMode(), itk::ShearWarp::Feature::Depth);
    cine->SetComputeDepth(hasDepth);
    single->SetComputeDepth(hasDepth);
    ExpectFramesOfTheSingleFilter(cine.GetPointer(), single.GetPointer());
  }
}

TEST(ShearWarpMIPCine, AListOfTransformsHasTheBitsOfTheSingleFilter)
{
  Random                                             random(1003);
  const auto                                         image = MakeRandomImage<short>(random, { { 50, 44, 39 } });
  const auto                                         cine = MakeCine(image);
  const auto                                         single = MakeFilter(image);
  std::vector<itk::Transform<double, 3, 3>::Pointer> views;
  for (int n = 0; n < 12; ++n)
  {
    views.emplace_back(MakeRandomView(random, AllViewKinds[n % 3], image));
    cine->AddTransform(views.back());
  }
  // the same one again
  cine->AddTransform(views[3]);
  EXPECT_TRUE(cine->GetFrameAngles().empty());
  ExpectFramesOfTheSingleFilter(cine.GetPointer(), single.GetPointer());
  EXPECT_EQ(cine->GetOutput()->GetLargestPossibleRegion().GetSize(2), 13u);
  EXPECT_EQ(cine->GetFrameTransform(12)->GetParameters(), views[3]->GetParameters());
  EXPECT_FALSE(cine->GetOutput()->GetMetaDataDictionary().HasKey("FrameAngles"));

  // changed in place
  const auto time = cine->GetMTime();
  views[5]->SetParameters(views[4]->GetParameters());
  EXPECT_GT(cine->GetMTime(), time);
  ExpectFramesOfTheSingleFilter(cine.GetPointer(), single.GetPointer());

  cine->ClearTransforms();
  cine->Update();
  EXPECT_EQ(cine->GetOutput()->GetLargestPossibleRegion().GetSize(2), 36u);
  EXPECT_THROW(cine->AddTransform(nullptr), itk::ExceptionObject);
}

TEST(ShearWarpMIPCine, MoreFramesThanAreProjectedTogetherHaveTheBitsOfTheSingleFilter)
{
  Random     random(1012);
  const auto image = MakeRandomImage<short>(random, { { 5, 6, 7 } });
  const auto cine = MakeCine(image);
  const auto single = MakeFilter(image);
  cine->SetNumberOfFrames(1300);
  ExpectFramesOfTheSingleFilter(cine.GetPointer(), single.GetPointer());
}

TEST(ShearWarpMIPCine, StreamingHasTheBitsOfTheWholeImage)
{
  Random     random(1004);
  const auto image = MakeRandomImage<unsigned short>(random, { { 45, 38, 60 } });
  const auto source = MakeSource<unsigned short>(image);
  const auto whole = MakeCine(image);
  const auto streamed = MakeCine(source->GetOutput());
  streamed->SetNumberOfStreamDivisions(4);
  for (const auto & axis : { MakeVector3(0, 0, 1), MakeVector3(1, 0, 0), MakeVector3(0.3, 0.8, 0.5) })
  {
    for (const bool isMinimum : { false, true })
    {
      for (auto * filter : { whole.GetPointer(), streamed.GetPointer() })
      {
        filter->SetRotationAxis(axis);
        filter->SetNumberOfFrames(7);
        filter->SetMode(isMinimum ? itk::ShearWarpMIPImageFilterEnums::Mode::Minimum
                                  : itk::ShearWarpMIPImageFilterEnums::Mode::Maximum);
        filter->Update();
      }
      EXPECT_TRUE(HaveSamePixels(whole->GetOutput(), streamed->GetOutput())) << axis;
    }
  }
  EXPECT_LE(source->mostSlices, 17u);
}

TEST(ShearWarpMIPCine, NoFrameIsClippedAndNoGridIsFiner)
{
  Random random(1005);
  for (int repeat = 0; repeat < 20; ++repeat)
  {
    const auto image = MakeRandomImage<unsigned char>(random, MakeRandomSize(random, 1, 30));
    const auto cine = MakeCine(image);
    cine->SetRotationAxis(MakeRandomAxis(random));
    cine->SetNumberOfFrames(9);
    cine->UpdateOutputInformation();
    const auto * grid = cine->GetOutput();
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      const double spacing = grid->GetSpacing()[axis];
      const double begin = grid->GetOrigin()[axis] - 0.5 * spacing;
      const double end = begin + static_cast<double>(grid->GetLargestPossibleRegion().GetSize(axis)) * spacing;
      double       lowest = 1e300;
      double       highest = -1e300;
      double       finest = 1e300;
      for (unsigned int n = 0; n < 9; ++n)
      {
        const auto view = cine->GetFrameTransform(n);
        const auto [lower, upper] = FindCornerBounds(view, image);
        lowest = std::min(lowest, lower[axis]);
        highest = std::max(highest, upper[axis]);
        finest = std::min(finest, itk::ShearWarpFactorization::ComputeProjectedSpacing(view, image)[axis]);
      }
      EXPECT_DOUBLE_EQ(spacing, finest);
      EXPECT_LE(begin, lowest + 1e-5 * spacing);
      EXPECT_GE(end, highest - 1e-5 * spacing);
      EXPECT_LE(end - begin, highest - lowest + spacing * 1.0001);
    }
    EXPECT_EQ(grid->GetSpacing()[2], 1.0);
    EXPECT_EQ(grid->GetOrigin()[2], 0.0);
  }
}

TEST(ShearWarpMIPCine, TheDefaultTurnBeginsAtAnteriorAndGoesToTheLeft)
{
  Random     random(1006);
  const auto image = MakeRandomImage<float>(random, { { 20, 25, 30 } });
  const auto cine = MakeCine(image);
  cine->SetNumberOfFrames(4);
  using Direction = itk::ShearWarpMIPViewEnums::Direction;
  unsigned int n = 0;
  for (const Direction direction : { Direction::Anterior, Direction::Left, Direction::Posterior, Direction::Right })
  {
    const auto expected = ShearWarpMIPView::MakeTransform(image, direction);
    const auto frame = cine->GetFrameTransform(n++);
    for (const auto & point : { MakePoint3(0, 0, 0), MakePoint3(1, 0, 0), MakePoint3(0, 1, 0), MakePoint3(0, 0, 1) })
    {
      EXPECT_LT((frame->TransformPoint(point) - expected->TransformPoint(point)).GetNorm(), 1e-12) << direction;
    }
  }
  EXPECT_THROW(cine->GetFrameTransform(4), itk::ExceptionObject);
}

TEST(ShearWarpMIPCine, AnglesOfTurnsAndOfRockingAsASine)
{
  const auto cine = CineType<short>::New();
  cine->SetNumberOfFrames(8);
  EXPECT_EQ(cine->GetFrameAngles(), (std::vector<double>{ 0, 45, 90, 135, 180, 225, 270, 315 }));
  cine->SetNumberOfFrames(4);
  cine->SetStartAngle(10.0);
  cine->SetAngularRange(-180.0);
  EXPECT_EQ(cine->GetFrameAngles(), (std::vector<double>{ 10, -35, -80, -125 }));
  cine->SetAngularRange(60.0);
  cine->RockingOn();
  for (const unsigned int count : { 2u, 3u, 4u, 5u, 6u, 7u, 30u, 48u, 101u })
  {
    cine->SetNumberOfFrames(count);
    const auto angles = cine->GetFrameAngles();
    ASSERT_EQ(angles.size(), count);
    EXPECT_NEAR(*std::max_element(angles.begin(), angles.end()), 40.0, 1e-12) << count;
    EXPECT_NEAR(*std::min_element(angles.begin(), angles.end()), -20.0, 1e-12) << count;
    const double step = itk::Math::twopi / count;
    for (unsigned int n = 0; n < count && count > 2; ++n)
    {
      // the next and the last one of a sine are 2 cos(step) times as far together
      const double both = angles[(n + 1) % count] + angles[(n + count - 1) % count] - 20.0;
      EXPECT_NEAR(both, 2.0 * std::cos(step) * (angles[n] - 10.0), 1e-10) << n << " of " << count;
    }
    EXPECT_EQ(angles[0], count > 2 ? 10.0 : 40.0) << count;
    // the first quarter goes up
    EXPECT_TRUE(count == 2 || angles[1] > 10.0) << count;
  }
  cine->SetNumberOfFrames(1);
  EXPECT_EQ(cine->GetFrameAngles(), std::vector<double>{ 10.0 });
}

TEST(ShearWarpMIPCine, ThePointThatTheViewerMovesAboutStaysInPlace)
{
  Random     random(1007);
  const auto image = MakeRandomImage<short>(random, { { 20, 20, 20 } });
  const auto cine = MakeCine(image);
  EXPECT_LT((cine->GetCenter() - GetCenter(image)).GetNorm(), 1e-9);
  const auto center = MakePoint3(3.0, -4.0, 5.0);
  const auto axis = MakeVector3(1.0, 2.0, -0.5);
  cine->SetCenter(center);
  cine->SetRotationAxis(axis);
  const auto inView = [&](unsigned int n, const PointType & point) {
    return cine->GetFrameTransform(n)->GetInverseTransform()->TransformPoint(point);
  };
  for (unsigned int n = 1; n < 36; n += 5)
  {
    for (const double distance : { 0.0, -20.0, 7.0 })
    {
      EXPECT_LT((inView(n, center + axis * distance) - inView(0, center + axis * distance)).GetNorm(), 1e-9);
    }
  }
  cine->UseImageCenter();
  EXPECT_LT((cine->GetCenter() - GetCenter(image)).GetNorm(), 1e-9);
}

TEST(ShearWarpMIPCine, AnglesAndTransformsAreInTheMetaDataDictionary)
{
  Random     random(1008);
  const auto image = MakeRandomImage<short>(random, { { 12, 10, 8 } });
  const auto cine = MakeCine(image);
  cine->SetNumberOfFrames(5);
  cine->Update();
  const auto &        dictionary = cine->GetOutput()->GetMetaDataDictionary();
  std::vector<double> angles;
  std::vector<double> matrices;
  ASSERT_TRUE(itk::ExposeMetaData(dictionary, "FrameAngles", angles));
  ASSERT_TRUE(itk::ExposeMetaData(dictionary, "FrameTransforms", matrices));
  EXPECT_EQ(angles, cine->GetFrameAngles());
  ASSERT_EQ(matrices.size(), 80u);
  const auto view = MakePoint3(2.0, -3.0, 5.0);
  for (unsigned int n = 0; n < 5; ++n)
  {
    const auto point = cine->GetFrameTransform(n)->TransformPoint(view);
    for (unsigned int row = 0; row < 4; ++row)
    {
      const double * m = &matrices[16 * n + 4 * row];
      EXPECT_NEAR(m[0] * view[0] + m[1] * view[1] + m[2] * view[2] + m[3], row < 3 ? point[row] : 1.0, 1e-9);
    }
  }
}

TEST(ShearWarpMIPCine, ErrorsNameParameterAndValue)
{
  Random     random(1009);
  const auto image = MakeRandomImage<short>(random, { { 12, 10, 8 } });
  const auto expectError = [&](const auto & change, const std::string & text) {
    const auto cine = MakeCine(image);
    change(cine.GetPointer());
    EXPECT_NAMES(cine->Update(), text);
  };
  constexpr double notANumber = std::numeric_limits<double>::quiet_NaN();
  using Cine = CineType<short>;
  expectError([](Cine * cine) { cine->SetNumberOfFrames(0); }, "NumberOfFrames must be from 1 to 65535, but it is 0");
  expectError([](Cine * cine) { cine->SetRotationAxis(MakeVector3(0, 0, 0)); }, "RotationAxis must be finite and not");
  expectError([](Cine * cine) { cine->SetRotationAxis(MakeVector3(0, notANumber, 0)); }, "RotationAxis");
  expectError([](Cine * cine) { cine->SetCenter(MakePoint3(0, notANumber, 0)); }, "Center must be finite");
  expectError([](Cine * cine) { cine->SetStartAngle(notANumber); }, "StartAngle and AngularRange must be finite");
  expectError([](Cine * cine) { cine->SetAngularRange(notANumber); }, "but they are 0 and nan");
  expectError([](Cine * cine) { cine->SetNumberOfFrames(65536); }, "but it is 65536");
  expectError([](Cine * cine) { cine->SetSlabNear(5.0), cine->SetSlabFar(1.0); }, "SlabNear");
  expectError(
    [](Cine * cine) {
      cine->AddTransform(itk::AffineTransform<double, 3>::New());
      const auto singular = itk::AffineTransform<double, 3>::New();
      singular->Scale(0.0);
      cine->AddTransform(singular);
    },
    "Frame 1: ");
}

TEST(ShearWarpMIPCine, ParametersThatAreNotUsedMayBeAnything)
{
  Random           random(1012);
  const auto       image = MakeRandomImage<short>(random, { { 12, 10, 8 } });
  constexpr double notANumber = std::numeric_limits<double>::quiet_NaN();
  const auto       cine = MakeCine(image);
  cine->SetCenter(MakePoint3(0, notANumber, 0));
  EXPECT_NAMES(cine->Update(), "Center must be finite");
  cine->UseImageCenter();
  EXPECT_NO_THROW(cine->Update());

  cine->AddTransform(itk::AffineTransform<double, 3>::New());
  const auto singular = itk::AffineTransform<double, 3>::New();
  singular->Scale(0.0);
  const std::function<void()> changes[] = { [&] { cine->SetNumberOfFrames(0); },
                                            [&] { cine->SetRotationAxis(MakeVector3(0, 0, 0)); },
                                            [&] { cine->SetCenter(MakePoint3(0, notANumber, 0)); },
                                            [&] { cine->SetStartAngle(notANumber); },
                                            [&] { cine->SetAngularRange(notANumber); },
                                            [&] { cine->SetTransform(singular); } };
  for (const auto & change : changes)
  {
    change();
    EXPECT_NO_THROW(cine->UpdateLargestPossibleRegion());
  }
  cine->ClearTransforms();
  EXPECT_NAMES(cine->Update(), "NumberOfFrames");
}

TEST(ShearWarpMIPCine, AbortThrowsProgressRisesAndTheNextUpdateIsRight)
{
  Random     random(1010);
  const auto image = MakeRandomImage<unsigned short>(random, { { 120, 110, 100 } });
  const auto cine = MakeCine(image);
  cine->SetNumberOfFrames(10);
  cine->SetReducedResampling(ReducedResamplingEnum::Off);
  // only the thread that updates reports
  cine->SetNumberOfWorkUnits(1);
  std::vector<float> reported;
  float              abortAt = 2.0f;
  cine->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) {
    reported.push_back(cine->GetProgress());
    if (cine->GetProgress() >= abortAt)
    {
      cine->AbortGenerateDataOn();
    }
  });
  for (const float limit : { 0.01f, 0.2f, 0.5f, 0.8f })
  {
    abortAt = limit;
    cine->Modified();
    EXPECT_THROW(cine->Update(), itk::ProcessAborted) << limit;
  }
  abortAt = 2.0f;
  reported.clear();
  const auto single = MakeFilter(image);
  cine->Modified();
  ExpectFramesOfTheSingleFilter(cine.GetPointer(), single.GetPointer());
  EXPECT_GT(reported.size(), 20u);
  EXPECT_TRUE(std::is_sorted(reported.begin(), reported.end()));
  EXPECT_EQ(cine->GetProgress(), 1.0f);
}

TEST(ShearWarpMIPCine, PrintsItsParameters)
{
  const auto cine = CineType<short>::New();
  cine->SetNumberOfFrames(17);
  cine->SetCenter(MakePoint3(1, 2, 3));
  ExpectPrinted(cine,
                { "NumberOfFrames: 17",
                  "RotationAxis: [0, 0, 1]",
                  "Center: [1, 2, 3]",
                  "StartAngle: 0",
                  "AngularRange: 360",
                  "Rocking: Off",
                  "Transforms: 0",
                  "IntermediateMemory: 1073741824" });
}

TEST(ShearWarpMIPCine, OppositeFramesFadeFromTheirOwnSides)
{
  Random     random(818);
  const auto image = MakeRandomImage<short>(random, { { 30, 20, 25 } });
  const auto cine = MakeCine(image);
  const auto single = MakeFilter(image);
  cine->SetNumberOfFrames(4);
  single->SetDepthAttenuation(0.05);
  cine->SetDepthAttenuation(0.05);
  ExpectFramesOfTheSingleFilter(cine.GetPointer(), single.GetPointer());
  EXPECT_FALSE(HaveSamePixels(GetFrame(cine->GetOutput(), 0), GetFrame(cine->GetOutput(), 2)));
}

TEST(ShearWarpMIPCine, AnEmptyMaskLeavesOutAllAndNoMore)
{
  Random     random(817);
  const auto image = MakeRandomImage<short>(random, { { 30, 20, 25 } });
  const auto cine = MakeCine(image);
  cine->SetMaskImage(MakeMask(image));
  cine->SetDefaultPixelValue(7);
  // views of two axes, whose shares of the work do not sum to 1 exactly
  for (const unsigned int frames : { 1, 3, 7, 9 })
  {
    cine->SetNumberOfFrames(frames);
    cine->Update();
    EXPECT_LE(cine->GetSkippedFraction(), 1.0);
    EXPECT_GT(cine->GetSkippedFraction(), 0.9999);
    const auto pixels = GetPixels(cine->GetOutput());
    EXPECT_EQ(pixels, std::vector<short>(pixels.size(), 7));
  }
}

TEST(ShearWarpMIPCine, WhatIsSkippedChangesNoPixel)
{
  Random     random(1011);
  const auto image = MakePlainImage<unsigned short>({ { 130, 90, 75 } }, 3);
  for (int n = 0; n < 40; ++n)
  {
    const auto index = DrawIndex(random, image->GetBufferedRegion());
    image->SetPixel(index, static_cast<unsigned short>(random.Integer(4, 60000)));
  }
  const auto whole = MakeCine(image);
  const auto skipping = MakeCine(image);
  for (const auto & axis :
       { MakeVector3(0, 0, 1), MakeVector3(1, 0, 0), MakeVector3(0, 1, 0), MakeVector3(0.3, 0.8, 0.5) })
  {
    for (const auto reducedResampling : { ReducedResamplingEnum::On, ReducedResamplingEnum::Auto })
    {
      for (auto * filter : { whole.GetPointer(), skipping.GetPointer() })
      {
        filter->SetRotationAxis(axis);
        filter->SetNumberOfFrames(17);
        filter->SetReducedResampling(ReducedResamplingEnum::Off);
      }
      skipping->SetReducedResampling(reducedResampling);
      whole->Update();
      skipping->Update();
      EXPECT_GT(skipping->GetSkippedFraction(), reducedResampling == ReducedResamplingEnum::On ? 0.1 : -1.0);
      EXPECT_TRUE(HaveSamePixels(whole->GetOutput(), skipping->GetOutput())) << "about " << axis;
    }
  }
}
