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

#include "itkShearWarpMIPTestParts.h"

#include <set>

namespace
{
using namespace itk::ShearWarpMIPTest;
using ReducedResamplingEnum = itk::ShearWarpMIPImageFilterEnums::ReducedResampling;
using ModeEnum = itk::ShearWarpMIPImageFilterEnums::Mode;

template <typename TImagePointer>
auto
MakeStreamingFilter(const TImagePointer & image, unsigned int divisions)
{
  const auto filter = MakeFilter(image);
  filter->SetNumberOfStreamDivisions(divisions);
  return filter;
}

template <typename TPixel>
class ShearWarpMIPStreaming : public testing::Test
{};
using PixelTypes = itk::ShearWarpMIPTest::TestedTypes<unsigned char, short, unsigned short, float, double>;
TYPED_TEST_SUITE(ShearWarpMIPStreaming, PixelTypes, );
} // namespace

TEST(ShearWarpMIPStreamingMemory, ASlabIsFreedBeforeTheNextOneIsMade)
{
  const auto image = MakePlainImage<short>({ { 20, 21, 64 } }, 5);
  for (const bool hasMask : { false, true })
  {
    const auto source = MakeSource<short>(image);
    const auto mask = MakeSource<unsigned char>(MakePlainImage<unsigned char>({ { 20, 21, 64 } }, 1));
    const auto filter = MakeStreamingFilter(source->GetOutput(), 4);
    int        alive = 0;
    int        most = 0;
    const auto count = [&](auto * output) {
      // a container of its own for each slab
      output->Initialize();
      most = std::max(most, ++alive);
      output->GetPixelContainer()->AddObserver(itk::DeleteEvent(), [&](const itk::EventObject &) { --alive; });
    };
    source->AddObserver(itk::StartEvent(), [&](const itk::EventObject &) { count(source->GetOutput()); });
    mask->AddObserver(itk::StartEvent(), [&](const itk::EventObject &) { count(mask->GetOutput()); });
    if (hasMask)
    {
      filter->SetMaskImage(mask->GetOutput());
    }
    filter->Update();
    EXPECT_EQ(source->executions, 4u);
    EXPECT_EQ(most, hasMask ? 2 : 1);
  }
}

TYPED_TEST(ShearWarpMIPStreaming, HasTheBitsOfTheWholeImageAndNeedsOneSlabAtATime)
{
  Random                 random(801);
  std::set<unsigned int> axes;
  for (int repeat = 0; repeat < 60; ++repeat)
  {
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, repeat % 3 == 0 ? 70 : 30));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto divisions = static_cast<unsigned int>(random.Integer(2, 12));
    const auto source = MakeSource<TypeParam>(image);
    const auto streamed = MakeStreamingFilter(source->GetOutput(), divisions);
    const auto whole = MakeFilter(image);
    for (auto * filter : { whole.GetPointer(), streamed.GetPointer() })
    {
      filter->SetTransform(view);
      filter->SetReducedResampling(static_cast<ReducedResamplingEnum>(repeat % 3));
      filter->SetExact(repeat % 4 == 0);
      filter->SetComputeDepth(repeat % 8 == 0);
      filter->SetMode(static_cast<ModeEnum>(repeat % 4 == 0 ? repeat / 4 % 3 : 0));
      filter->SetOversampling(filter->GetExact() ? 1 : 1 + repeat % 2);
      filter->Update();
    }
    ASSERT_TRUE(HaveSamePixels(whole->GetOutput(), streamed->GetOutput())) << "in repetition " << repeat;
    ASSERT_TRUE(!whole->GetComputeDepth() || HaveSamePixels(whole->GetDepthOutput(), streamed->GetDepthOutput()))
      << "in repetition " << repeat;
    ASSERT_EQ(streamed->GetPrincipalAxis(), whole->GetPrincipalAxis());
    axes.insert(streamed->GetPrincipalAxis());

    const itk::SizeValueType blocks = (image->GetBufferedRegion().GetSize(2) + 7) / 8;
    const itk::SizeValueType slabs = std::min<itk::SizeValueType>(divisions, blocks);
    ASSERT_EQ(source->executions, slabs);
    ASSERT_LE(source->mostSlices, (blocks + slabs - 1) / slabs * 8 + 1) << "a slab and the slice before";
    if (slabs > 1)
    {
      ASSERT_EQ(streamed->GetPreparedVolumeSizeInBytes(), 0u);
    }
  }
  EXPECT_EQ(axes.size(), 3u);
}

TEST(ShearWarpMIPStreamingPipeline, EveryViewAndInstructionSetGetsTheSlabsAgainAndHasTheSameBits)
{
  Random       random(802);
  const auto   image = MakeRandomImage<short>(random, { { 129, 77, 45 } });
  const auto   source = MakeSource<short>(image);
  const auto   streamed = MakeStreamingFilter(source->GetOutput(), 4);
  const auto   whole = MakeFilter(image);
  const auto   expectSame = [&] { EXPECT_TRUE(HaveSamePixels(whole->GetOutput(), streamed->GetOutput())); };
  unsigned int updates = 0;
  for (int repeat = 0; repeat < 12; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto view = MakeRandomView(random, ViewKind::Rigid, image);
    whole->SetTransform(view);
    whole->Update();
    streamed->SetTransform(view);
    streamed->Update();
    expectSame();
    EXPECT_EQ(source->executions, 4u * ++updates);
    ForEachInstructionSet([&](const std::string & name) {
      UpdateAnew(whole);
      UpdateAnew(streamed);
      EXPECT_EQ(streamed->GetInstructionSet(), name);
      expectSame();
      EXPECT_EQ(source->executions, 4u * ++updates);
    });
  }
  streamed->SetNumberOfStreamDivisions(1);
  streamed->Update();
  expectSame();
  EXPECT_EQ(source->mostSlices, 45u);
}

TEST(ShearWarpMIPStreamingPipeline, AnImageInMemoryNeedsNoStreamingSource)
{
  Random     random(803);
  const auto image = MakeRandomImage<short>(random, { { 30, 40, 50 } });
  const auto filter = MakeFilter(image, MakeRandomView(random, ViewKind::Rigid, image));
  filter->Update();
  const auto expected = Copy(filter->GetOutput());
  for (const unsigned int divisions : { 3u, 1u, 1000u, 1u })
  {
    filter->SetNumberOfStreamDivisions(divisions);
    filter->Update();
    EXPECT_TRUE(HaveSamePixels(expected, filter->GetOutput())) << divisions;
    EXPECT_EQ(filter->GetPreparedVolumeSizeInBytes() > 0, divisions == 1);
  }
}

TEST(ShearWarpMIPStreamingPipeline, ErrorsNameTheParameterOrTheRegions)
{
  const auto image = MakePlainImage<short>({ { 9, 9, 30 } }, 1);
  const auto source = MakeSource<short>(image);
  source->missingSlices = 1;
  const auto filter = MakeFilter(source->GetOutput());
  for (const unsigned int divisions : { 1u, 3u })
  {
    filter->SetNumberOfStreamDivisions(divisions);
    EXPECT_NAMES(filter->Update(), "buffered region");
  }
  filter->SetNumberOfStreamDivisions(0);
  EXPECT_NAMES(filter->Update(), "NumberOfStreamDivisions must be positive, but it is 0");
}
