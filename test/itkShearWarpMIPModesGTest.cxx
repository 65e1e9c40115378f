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
#include "kernels/Kernels.h"
#include "itkShearWarpMIPCineImageFilter.h"
#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPTestOracle.h"
#include "itkShearWarpMIPTestParts.h"
#include "itkShearWarpMIPView.h"

#include <cstring>
#include <functional>
#include <set>

namespace
{
using namespace itk::ShearWarpMIPTest;
using ModeEnum = itk::ShearWarpMIPImageFilterEnums::Mode;
using InterpolationEnum = itk::ShearWarpMIPImageFilterEnums::Interpolation;
using itk::ShearWarp::Feature;

template <typename TPixel>
using FilterType = itk::ShearWarpMIPImageFilter<itk::Image<TPixel, 3>>;

template <typename TPixel>
void
ExpectRule(FilterType<TPixel> *          filter,
           const ViewType *              view,
           const itk::Image<TPixel, 3> * image,
           const RayRule<TPixel> &       rule,
           int                           oversampling = 1)
{
  const auto *                 output = filter->GetOutput();
  BruteForceProjection<TPixel> expected(view, image, oversampling, rule);
  const auto                   values = expected.Evaluate(output, filter->GetDefaultPixelValue());
  ASSERT_TRUE(HaveSamePixels(values, output)) << *filter;
  if (const auto * depths = filter->GetDepthOutput())
  {
    ASSERT_EQ(depths->GetBufferedRegion(), output->GetBufferedRegion());
    ASSERT_EQ(depths->GetOrigin(), output->GetOrigin());
    ASSERT_EQ(depths->GetSpacing(), output->GetSpacing());
    for (const auto & index : itk::ImageRegionIndexRange<2>(depths->GetBufferedRegion()))
    {
      const auto   place = GetPlace(output, index);
      const double depth = expected.EvaluateDepth(place[0], place[1]);
      const float  found = depths->GetPixel(index);
      ASSERT_EQ(std::isnan(depth), std::isnan(found)) << index;
      if (!std::isnan(depth))
      {
        ASSERT_NEAR(found, depth, 1e-6 * (1.0 + std::abs(depth))) << index;
      }
    }
  }
}

template <typename TPixel>
class ShearWarpMIPModes : public testing::Test
{};
using PixelTypes = itk::ShearWarpMIPTest::
  TestedTypes<unsigned char, signed char, unsigned short, short, int, unsigned long, long long, float, double>;
TYPED_TEST_SUITE(ShearWarpMIPModes, PixelTypes, );
} // namespace

TYPED_TEST(ShearWarpMIPModes, FollowTheRuleOnEveryInstructionSet)
{
  Random random(901);
  for (int repeat = 0; repeat < 150 && !this->HasFatalFailure(); ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, repeat % 5 == 0 ? 50 : 16));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter(image, view);
    const auto rule = DrawRule(random, filter.GetPointer(), view.GetPointer(), image.GetPointer());
    const int  oversampling = rule.isNearest ? 1 : static_cast<int>(random.Integer(1, 2));
    filter->SetOversampling(oversampling);
    filter->SetNumberOfWorkUnits(static_cast<itk::ThreadIdType>(random.Integer(1, 8)));
    filter->SetDefaultPixelValue(MakeRandomPixel<TypeParam>(random));
    filter->SetOutputSpacing(itk::ShearWarpFactorization::ComputeProjectedSpacing(view, image) * random.Uniform(1, 3));
    ForEachInstructionSet([&](const std::string & name) {
      UpdateAnew(filter);
      EXPECT_EQ(filter->GetInstructionSet() == name,
                itk::ShearWarp::GetKernels<itk::ShearWarp::EnginePixel<TypeParam>>().instructionSet == name);
      ExpectRule<TypeParam>(filter, view, image, rule, oversampling);
    });
  }
}

TYPED_TEST(ShearWarpMIPModes, ValuesAndDepthHaveTheBitsOfSamplesInTheirOrder)
{
  // which they have with a first local maximum that no ray meets before its end
  using Limits = std::numeric_limits<TypeParam>;
  constexpr TypeParam last = Limits::has_infinity ? Limits::infinity() : Limits::max();
  constexpr TypeParam first = Limits::has_infinity ? -Limits::infinity() : Limits::lowest();
  Random              random(905);
  for (int repeat = 0; repeat < 100; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 90));
    if (repeat % 2 == 0)
    {
      // many equal samples
      std::generate_n(image->GetBufferPointer(), image->GetPixelContainer()->Size(), [&random] {
        return static_cast<TypeParam>(random.Integer(0, 2));
      });
    }
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter(image, view);
    const auto [lower, upper] = FindCornerBounds(view, image);
    const double near = random.Uniform(lower[2], upper[2]);
    filter->SetSlabNear(repeat % 4 == 0 ? -std::numeric_limits<double>::infinity() : near);
    // without a sample in many rays
    filter->SetSlabFar(repeat % 4 == 1 ? near + random.Uniform(0, 0.5) : upper[2]);
    if (repeat % 3 == 0)
    {
      const auto middle = view->TransformPoint(lower + (upper - lower) * 0.5);
      filter->SetCropLower(middle - MakeVector3(random.Uniform(0, 9), 99, random.Uniform(0, 9)));
      filter->SetCropUpper(middle + MakeVector3(random.Uniform(0, 9), random.Uniform(0, 9), 99));
    }
    if (repeat % 5 < 2)
    {
      filter->SetMaskImage(MakeRandomMask(random, image));
      filter->SetMaskLabel(static_cast<unsigned char>(random.Integer(0, 2)));
    }
    filter->SetDepthAttenuation(repeat % 7 < 3 ? std::pow(10.0, random.Uniform(-4.0, 2.0)) : 0.0);
    filter->SetMode(AllModes[random.Integer(0, CountOfExtrema - 1)]);
    // beyond the type's end nothing is better
    const TypeParam unmet = filter->GetMode() == ModeEnum::Maximum ? last : first;
    const bool      mayBeLocal = itk::ShearWarp::HasFeature(filter->GetMode(), Feature::LocalMaximum);
    const auto      threshold = MakeRandomPixel<TypeParam>(random);
    filter->SetOversampling(repeat % 5 == 0 ? 2 : 1);
    filter->SetNumberOfStreamDivisions(static_cast<unsigned int>(random.Integer(1, 3)));
    filter->SetDefaultPixelValue(MakeRandomPixel<TypeParam>(random));
    // of the first instruction set
    typename itk::Image<TypeParam, 2>::Pointer expected;
    typename itk::Image<TypeParam, 2>::Pointer expectedLocal;
    itk::Image<float, 2>::Pointer              expectedDepths;
    ForEachInstructionSet([&](const std::string &) {
      filter->ComputeDepthOff();
      filter->LocalMaximumOff();
      filter->SetLocalMaximumThreshold(unmet);
      filter->SetNumberOfWorkUnits(static_cast<itk::ThreadIdType>(random.Integer(1, 8)));
      UpdateAnew(filter);
      const auto pixels = Copy(filter->GetOutput());
      filter->ComputeDepthOn();
      filter->Update();
      EXPECT_TRUE(HaveSamePixels(pixels, filter->GetOutput()));
      const auto depths = Copy(filter->GetDepthOutput());
      filter->SetLocalMaximum(mayBeLocal);
      filter->Update();
      EXPECT_TRUE(HaveSamePixels(pixels, filter->GetOutput()));
      EXPECT_TRUE(HaveSamePixels(depths, filter->GetDepthOutput()));
      filter->SetLocalMaximumThreshold(threshold);
      filter->Update();
      expected = expected ? expected : pixels;
      expectedDepths = expectedDepths ? expectedDepths : depths;
      expectedLocal = expectedLocal ? expectedLocal : Copy(filter->GetOutput());
      EXPECT_TRUE(HaveSamePixels(expected, pixels));
      EXPECT_TRUE(HaveSamePixels(expectedDepths, depths));
      EXPECT_TRUE(HaveSamePixels(expectedLocal, filter->GetOutput()));
    });
  }
}

TEST(ShearWarpMIPModesOutput, FewGapsAreSeenByAllThreads)
{
  const auto image = MakePlainImage<unsigned char>({ { 64, 1024, 2 } }, 200);
  const auto mask = MakePlainImage<unsigned char>({ { 64, 1024, 2 } }, 1);
  mask->SetPixel({ { 30, 512, 0 } }, 0);
  mask->SetPixel({ { 30, 512, 1 } }, 0);
  const auto filter = MakeFilter(image, ViewType::New());
  filter->SetMaskImage(mask);
  filter->SetDefaultPixelValue(7);
  filter->SetNumberOfWorkUnits(8);
  for (int repeat = 0; repeat < 200; ++repeat)
  {
    UpdateAnew(filter);
    ASSERT_EQ(filter->GetOutput()->GetPixel({ { 30, 512 } }), 7) << repeat;
  }
}

TYPED_TEST(ShearWarpMIPModes, StreamedHaveTheSameBits)
{
  Random random(902);
  for (int repeat = 0; repeat < 60 && !this->HasFatalFailure(); ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 40));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto source = MakeSource<TypeParam>(image);
    const auto filter = MakeFilter(source->GetOutput(), view);
    auto       rule = DrawRule(random, filter.GetPointer(), view.GetPointer(), image.GetPointer());
    const auto mask = filter->GetMaskImage() ? MakeSource<unsigned char>(filter->GetMaskImage()) : nullptr;
    if (mask)
    {
      filter->SetMaskImage(mask->GetOutput());
    }
    filter->SetNumberOfStreamDivisions(static_cast<unsigned int>(random.Integer(2, 6)));
    filter->Update();
    ExpectRule<TypeParam>(filter, view, image, rule);
  }
}

TYPED_TEST(ShearWarpMIPModes, FadesByTheFormula)
{
  Random random(903);
  for (int repeat = 0; repeat < 60; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto         image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 20));
    const auto         view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto         filter = MakeFilter(image, view);
    RayRule<TypeParam> rule;
    rule.mode = static_cast<RayMode>(repeat % 2);
    // of every magnitude
    rule.attenuation = repeat % 4 == 0 ? std::pow(10.0, random.Uniform(-320.0, 308.0)) : random.Uniform(0.0, 0.2);
    rule.background = MakeRandomPixel<TypeParam>(random);
    const auto [lower, upper] = FindCornerBounds(view, image);
    rule.slabNear = repeat % 3 == 0 ? random.Uniform(lower[2], upper[2]) : rule.slabNear;
    filter->SetMode(AllModes[repeat % 2]);
    filter->SetDepthAttenuation(rule.attenuation);
    filter->SetDefaultPixelValue(rule.background);
    filter->SetSlabNear(rule.slabNear);
    typename itk::Image<TypeParam, 2>::Pointer first;
    ForEachInstructionSet([&](const std::string &) {
      UpdateAnew(filter);
      first = first ? first : Copy(filter->GetOutput());
      ASSERT_TRUE(HaveSamePixels(first, filter->GetOutput()));
    });
    BruteForceProjection<TypeParam> expected(view, image, 1, rule);
    const auto                      values = expected.Evaluate(first, rule.background);
    for (const auto & index : itk::ImageRegionIndexRange<2>(first->GetBufferedRegion()))
    {
      const auto a = static_cast<long double>(values->GetPixel(index));
      const auto b = static_cast<long double>(first->GetPixel(index));
      const auto range = static_cast<long double>(std::numeric_limits<TypeParam>::max());
      // of 64-bit integers, what a double does not hold is lost
      const long double tolerance = std::is_integral_v<TypeParam> ? 1.0L + range * 0x1p-48L : 1e-3L;
      ASSERT_LE(std::abs(a - b), tolerance)
        << "at " << index << ": " << a << " " << b << " to " << static_cast<long double>(rule.background) << " rate "
        << rule.attenuation;
    }
  }
}

TYPED_TEST(ShearWarpMIPModes, FasterFadingIsNeverBrighter)
{
  Random random(909);
  for (int repeat = 0; repeat < 12; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 20));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter(image, view);
    const bool isMinimum = repeat % 2 == 1;
    // no sample is beyond the background
    const auto voxels = GetPixels(image);
    const auto [lowest, highest] = std::minmax_element(voxels.begin(), voxels.end());
    const TypeParam background = isMinimum ? *highest : *lowest;
    const TypeParam farthest = isMinimum ? *lowest : *highest;
    const auto [lower, upper] = FindCornerBounds(view, image);
    if (repeat % 4 < 2)
    {
      const double ends[] = { random.Uniform(lower[2], upper[2]), random.Uniform(lower[2], upper[2]) };
      filter->SetSlabNear(std::min(ends[0], ends[1]));
      filter->SetSlabFar(std::max(ends[0], ends[1]));
    }
    filter->SetMode(isMinimum ? ModeEnum::Minimum : ModeEnum::Maximum);
    filter->SetDefaultPixelValue(background);
    ForEachInstructionSet([&](const std::string &) {
      std::vector<TypeParam> before;
      for (const double rate : { 0.0, 5e-324, 1e-300, 1e-9, 0.01, 0.0101, 0.3, 4.0, 8.0, 100.0, 1e4, 1e20, 1.7e308 })
      {
        filter->SetDepthAttenuation(rate);
        filter->Update();
        const auto pixels = GetPixels(filter->GetOutput());
        before.resize(pixels.size(), farthest);
        for (std::size_t n = 0; n < before.size(); ++n)
        {
          ASSERT_FALSE(isMinimum ? pixels[n] < before[n] : pixels[n] > before[n]) << rate << " at " << n;
          ASSERT_FALSE(isMinimum ? pixels[n] > background : pixels[n] < background) << rate << " at " << n;
          ASSERT_TRUE(rate < 1e20 || pixels[n] == background) << rate << " at " << n;
        }
        before = pixels;
      }
    });
  }
}

TYPED_TEST(ShearWarpMIPModes, OptionsThatExcludeNothingChangeNoBit)
{
  Random     random(904);
  const auto image = MakeRandomImage<TypeParam>(random, { { 37, 23, 29 } });
  const auto mask = MakeMask(image, 7);
  for (int repeat = 0; repeat < 6; ++repeat)
  {
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter(image, view);
    filter->Update();
    const auto plain = Copy(filter->GetOutput());
    const auto expectSame = [&](const char * what) {
      filter->Update();
      EXPECT_TRUE(HaveSamePixels(plain, filter->GetOutput())) << what;
      EXPECT_EQ(filter->GetSkippedFraction(), 0.0) << what;
    };
    filter->ComputeDepthOn();
    expectSame("depth");
    filter->ComputeDepthOff();
    filter->SetMaskImage(mask);
    expectSame("mask");
    filter->SetMaskLabel(7);
    expectSame("label");
    filter->SetMaskImage(nullptr);
    filter->SetSlabNear(-1e6);
    filter->SetSlabFar(1e6);
    expectSame("slab");
    filter->SetCropLower(PointType(-1e6));
    filter->SetCropUpper(PointType(1e6));
    expectSame("box");
    filter->SetDepthAttenuation(1e-300);
    filter->SetDefaultPixelValue(0);
    expectSame("attenuation");
    filter->SetDepthAttenuation(0);
    filter->LocalMaximumOn();
    filter->SetLocalMaximumThreshold(std::numeric_limits<TypeParam>::max());
    expectSame("threshold");
  }
}

TEST(ShearWarpMIPModesClosedForms, ChooseMinimumAndAbsoluteMaximum)
{
  const auto image = MakePlainImage<short>({ { 4, 3, 5 } }, 100);
  image->SetPixel({ { 1, 1, 2 } }, -300);
  image->SetPixel({ { 2, 1, 3 } }, 200);
  image->SetPixel({ { 3, 1, 3 } }, -100);
  const auto filter = MakeFilter(image);
  const auto getRow = [&] {
    filter->Update();
    const short * const row = filter->GetOutput()->GetBufferPointer() + 4;
    return std::vector<short>(row, row + 4);
  };
  filter->SetMode(ModeEnum::Minimum);
  EXPECT_EQ(getRow(), (std::vector<short>{ 100, -300, 100, -100 }));
  filter->SetMode(ModeEnum::AbsoluteMaximum);
  EXPECT_EQ(getRow(), (std::vector<short>{ 100, -300, 200, 100 }));
  image->SetPixel({ { 0, 1, 0 } }, std::numeric_limits<short>::lowest());
  image->SetPixel({ { 0, 1, 4 } }, std::numeric_limits<short>::max());
  image->Modified();
  EXPECT_EQ(getRow()[0], std::numeric_limits<short>::lowest());
}

/** The mean of voxels along z, as one pixel. */
template <typename TPixel>
TPixel
ProjectMean(const std::vector<TPixel> & voxels)
{
  const auto image = MakePlainImage<TPixel>({ { 1, 1, voxels.size() } });
  std::copy(voxels.begin(), voxels.end(), image->GetBufferPointer());
  const auto filter = MakeFilter(image);
  filter->SetMode(ModeEnum::Mean);
  filter->SetDefaultPixelValue(TPixel{ 77 });
  filter->Update();
  return filter->GetOutput()->GetPixel({ { 0, 0 } });
}

TEST(ShearWarpMIPModesClosedForms, MeansAreRoundedHalfUpwardAndWithinTheRangeOfTheirSamples)
{
  ForEachInstructionSet([](const std::string &) {
    EXPECT_EQ(ProjectMean<short>({ 1, 2 }), 2);
    EXPECT_EQ(ProjectMean<short>({ -1, -2 }), -1);
    EXPECT_EQ(ProjectMean<short>({ -1, -1, -2 }), -1);
    EXPECT_EQ(ProjectMean<short>({ -2, -2, -1 }), -2);
    EXPECT_EQ(ProjectMean<unsigned char>({ 255, 255, 254 }), 255);
    EXPECT_EQ(ProjectMean<int>({ -7, -8 }), -7);
    EXPECT_EQ(ProjectMean<float>({ 1, 2, 4 }), 7.0F / 3);
    const auto expectConstant = [](auto value) {
      using PixelType = decltype(value);
      for (const std::size_t count : { 1, 3, 7, 200 })
      {
        EXPECT_TRUE(HaveSameBits(ProjectMean(std::vector<PixelType>(count, value)), value)) << +value << ' ' << count;
      }
    };
    const auto expectLimits = [&](auto type) {
      using Limits = std::numeric_limits<decltype(type)>;
      expectConstant(Limits::max());
      expectConstant(Limits::lowest());
      // of two extremes, an integer's mean is between 0 and -1 or 1
      const auto mean = ProjectMean<decltype(type)>({ Limits::lowest(), Limits::max() });
      EXPECT_EQ(mean, Limits::is_integer ? Limits::max() / 2 + (Limits::is_signed ? -Limits::max() / 2 : 1) : 0);
    };
    expectLimits(std::uint8_t{});
    expectLimits(std::int8_t{});
    expectLimits(std::uint16_t{});
    expectLimits(std::int16_t{});
    expectLimits(std::uint32_t{});
    expectLimits(std::int32_t{});
    expectLimits(std::uint64_t{});
    expectLimits(std::int64_t{});
    expectLimits(float{});
    expectLimits(double{});
    expectConstant(std::numeric_limits<float>::denorm_min());
    expectConstant(std::numeric_limits<double>::denorm_min());
    expectConstant(0.1);
    EXPECT_TRUE(HaveSameBits(ProjectMean<float>({ -0.0F, -0.0F }), 0.0F));
    constexpr float infinity = std::numeric_limits<float>::infinity();
    constexpr float nothing = std::numeric_limits<float>::quiet_NaN();
    EXPECT_EQ(ProjectMean<float>({ nothing, 3, nothing, 5 }), 4.0F);
    EXPECT_EQ(ProjectMean<float>({ nothing, nothing }), 77.0F);
    EXPECT_EQ(ProjectMean<float>({ 1, infinity, nothing }), infinity);
    EXPECT_EQ(ProjectMean<float>({ 1, -infinity }), -infinity);
    EXPECT_EQ(ProjectMean<float>({ infinity, -infinity }), 77.0F);
    EXPECT_EQ(ProjectMean<double>({ infinity, -infinity, 1 }), 77.0);
    EXPECT_EQ(ProjectMean<double>({ infinity, 1 }), infinity);
  });
}

TEST(ShearWarpMIPModesClosedForms, MeansOfTheLongestImagesAreExact)
{
  constexpr std::size_t most = 65536;
  EXPECT_EQ(ProjectMean(std::vector<unsigned short>(most, 65535)), 65535);
  EXPECT_EQ(ProjectMean(std::vector<short>(most, -32768)), -32768);
  EXPECT_EQ(ProjectMean(std::vector<unsigned char>(most, 255)), 255);
  EXPECT_NAMES(ProjectMean(std::vector<short>(most + 1, 1)), "Mode Mean", "65536", "65537");
  EXPECT_EQ(ProjectMean(std::vector<int>(most + 1, -2147483647 - 1)), -2147483647 - 1);
}

TEST(ShearWarpMIPModesClosedForms, NearestHasOnlyValuesOfVoxels)
{
  Random random(906);
  for (int repeat = 0; repeat < 40; ++repeat)
  {
    const auto image = MakeRandomImage<short>(random, MakeRandomSize(random, 1, 40));
    std::generate_n(image->GetBufferPointer(), image->GetPixelContainer()->Size(), [&random] {
      return static_cast<short>(random.Integer(0, 1) == 0 ? -300 : 20000);
    });
    const auto filter = MakeFilter(image, MakeRandomView(random, AllViewKinds[repeat % 3], image));
    filter->SetMode(AllModes[random.Integer(0, CountOfExtrema - 1)]);
    filter->SetInterpolation(InterpolationEnum::Nearest);
    filter->SetDefaultPixelValue(7);
    filter->Update();
    const auto * pixels = filter->GetOutput()->GetBufferPointer();
    EXPECT_TRUE(std::all_of(pixels, pixels + filter->GetOutput()->GetPixelContainer()->Size(), [](short pixel) {
      return pixel == -300 || pixel == 20000 || pixel == 7;
    }));
  }
}

TEST(ShearWarpMIPModesClosedForms, NearestTakesTheHigherVoxelAndTheHigherPixelOfTwo)
{
  const auto  image = MakePlainImage<short>({ { 4, 1, 2 } });
  const short voxels[] = { 10, 20, 30, 40, 0, 0, 0, 0 };
  std::copy(std::begin(voxels), std::end(voxels), image->GetBufferPointer());
  const auto project = [&image](double shear) {
    const auto view = itk::AffineTransform<double, 3>::New();
    auto       matrix = view->GetMatrix();
    matrix(0, 2) = shear;
    view->SetMatrix(matrix);
    const auto filter = MakeFilter(image, view);
    filter->SetInterpolation(InterpolationEnum::Nearest);
    filter->SetSize({ { 4, 1 } });
    filter->SetOutputSpacing(MakeVector2(1.0, 1.0));
    filter->SetOutputOrigin(MakePoint2(0.5, 0));
    filter->Update();
    const short * pixels = filter->GetOutput()->GetBufferPointer();
    return std::vector<short>(pixels, pixels + 4);
  };
  // the first slice is half a voxel beside the pixels of the intermediate image, which are at the output's pixels
  EXPECT_EQ(project(0.5), (std::vector<short>{ 20, 30, 40, 0 }));
  // the output's pixels lie in the middle between pixels of the intermediate image
  EXPECT_EQ(project(0.0), (std::vector<short>{ 20, 30, 40, 0 }));
}

TEST(ShearWarpMIPModesClosedForms, LocalMaximumHidesABrighterVesselBehind)
{
  // along z: rising to 50, falling, rising to 90
  const auto  image = MakePlainImage<unsigned char>({ { 3, 3, 8 } });
  const short ray[] = { 0, 20, 50, 50, 30, 90, 90, 10 };
  FillByIndex(image, [&ray](const auto & index) { return ray[index[2]]; });
  const auto filter = MakeFilter(image, ViewType::New());
  const auto get = [&] {
    filter->Update();
    return std::make_pair(static_cast<int>(filter->GetOutput()->GetPixel({ { 1, 1 } })),
                          filter->GetDepthOutput()->GetPixel({ { 1, 1 } }));
  };
  filter->ComputeDepthOn();
  filter->LocalMaximumOn();
  filter->SetLocalMaximumThreshold(40);
  EXPECT_EQ(get(), std::make_pair(50, 2.0f));
  filter->SetLocalMaximumThreshold(51);
  EXPECT_EQ(get(), std::make_pair(90, 5.0f));
  filter->SetLocalMaximumThreshold(91);
  EXPECT_EQ(get(), std::make_pair(90, 5.0f));
  // from behind
  filter->SetTransform(MakeView(MakeDiagonal(-1, 1, -1), MakePoint3(2, 0, 0)));
  filter->SetLocalMaximumThreshold(40);
  EXPECT_EQ(get(), std::make_pair(90, -6.0f));
  filter->SetCropUpper(MakePoint3(1e9, 1e9, 4.5));
  EXPECT_EQ(get(), std::make_pair(50, -3.0f));
  filter->SetMode(ModeEnum::Minimum);
  filter->SetLocalMaximumThreshold(35);
  EXPECT_EQ(get(), std::make_pair(30, -4.0f));
}

TEST(ShearWarpMIPModesClosedForms, SlabIsThatOfItsMillimetres)
{
  // each slice has its number
  const auto image = MakePlainImage<unsigned short>({ { 5, 4, 40 } });
  image->SetSpacing(MakeVector3(1, 1, 2.5));
  FillByIndex(image, [](const auto & index) { return index[2] + 1; });
  const auto filter = MakeFilter(image, ViewType::New());
  const auto project = [&](double near, double far) {
    filter->SetSlabNear(near);
    filter->SetSlabFar(far);
    filter->Update();
    return filter->GetOutput()->GetPixel({ { 2, 2 } });
  };
  EXPECT_EQ(project(0, 25), 11);
  EXPECT_EQ(project(0, 24.999), 10);
  EXPECT_EQ(project(25, 25), 11);
  EXPECT_EQ(project(26, 27), 0) << "no slice is between";
  EXPECT_EQ(project(-50, -0.1), 0);
  filter->SetMode(ModeEnum::Minimum);
  EXPECT_EQ(project(24.999, 60), 11);
  EXPECT_EQ(project(25.001, 60), 12);
}

TEST(ShearWarpMIPModesClosedForms, DepthLeadsToTheVoxel)
{
  Random random(905);
  for (int repeat = 0; repeat < 60; ++repeat)
  {
    const auto image = itk::Image<short, 3>::New();
    SetRandomGeometry(random, image, MakeRandomSize(random, 5, 24));
    image->Allocate(true);
    const auto bright = DrawIndex(random, image->GetBufferedRegion(), 1);
    image->SetPixel(bright, 1000);
    const auto expected = image->TransformIndexToPhysicalPoint<double>(bright);

    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter(image, view);
    filter->ComputeDepthOn();
    filter->Update();
    const auto * output = filter->GetOutput();
    // the pixel next to the voxel's projection
    const auto    projected = view->GetInverseTransform()->TransformPoint(expected);
    itk::Index<2> pixel;
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      pixel[axis] = std::lround((projected[axis] - output->GetOrigin()[axis]) / output->GetSpacing()[axis]);
    }
    const PointType point = filter->GetPhysicalPoint(pixel);
    // no further than the pixel is from the projection, along the slice that the voxel is in
    const double reach = image->GetSpacing().GetVnlVector().max_value();
    EXPECT_LT(point.EuclideanDistanceTo(expected), 4.0 * reach) << "in repetition " << repeat;
    itk::ContinuousIndex<double, 3> index;
    static_cast<void>(image->TransformPhysicalPointToContinuousIndex(point, index));
    const unsigned int axis = filter->GetPrincipalAxis();
    EXPECT_NEAR(index[axis], static_cast<double>(bright[axis]), 1e-3) << "in repetition " << repeat;
  }
}

/** More slices than 16 bits tell apart. */
TEST(ShearWarpMIPModesClosedForms, DepthOfAVeryLongImageLeadsToTheVoxel)
{
  constexpr itk::SizeValueType slices = 66000;
  Random                       random(977);
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    itk::Size<3> size{ { 40, 40, 40 } };
    size[axis] = slices;
    size[axis == 2 ? 1 : 2] = 3;
    const auto image = MakePlainImage<short>(size);
    const auto mask = MakeMask(image, 1);
    // few values, so that many samples are equal
    for (int n = 0; n < 3000; ++n)
    {
      const auto index = DrawIndex(random, image->GetBufferedRegion());
      image->SetPixel(index, static_cast<short>(random.Integer(1, 4)));
    }
    for (const double direction : { 1.0, -1.0 })
    {
      const auto view = MakeView(MakeAxisMatrix(axis) * MakeDiagonal(1, 1, direction), PointType(0.0));
      for (const bool isLocal : { false, true })
      {
        for (const unsigned int divisions : { 1, 2 })
        {
          const auto filter = MakeFilter(image, view);
          filter->ComputeDepthOn();
          filter->SetMaskImage(mask);
          filter->SetLocalMaximum(isLocal);
          filter->SetLocalMaximumThreshold(2);
          filter->SetNumberOfStreamDivisions(divisions);
          ForEachInstructionSet([&](const std::string & name) {
            UpdateAnew(filter);
            const auto * output = filter->GetOutput();
            ASSERT_EQ(filter->GetPrincipalAxis(), axis);
            for (const auto & pixel : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
            {
              const auto place = output->TransformIndexToPhysicalPoint<double>(pixel);
              const auto depthPlace = MakePoint3(place[0], place[1], filter->GetDepthOutput()->GetPixel(pixel));
              const auto found = image->TransformPhysicalPointToIndex(view->TransformPoint(depthPlace));

              itk::Index<3> expected = found;
              short         value = -1;
              for (itk::SizeValueType n = 0; n < slices; ++n)
              {
                itk::Index<3> index = found;
                index[axis] = static_cast<itk::IndexValueType>(direction > 0 ? n : slices - 1 - n);
                const short voxel = image->GetPixel(index);
                if (isLocal && value >= 2 && voxel < value)
                {
                  break;
                }
                expected = voxel > value ? index : expected;
                value = std::max(value, voxel);
              }
              ASSERT_EQ(output->GetPixel(pixel), value) << name << ", axis " << axis << ", " << pixel;
              ASSERT_EQ(found, expected) << name << ", axis " << axis << ", " << pixel;
            }
          });
        }
      }
    }
  }
}

TEST(ShearWarpMIPModesClosedForms, MaskedBrightNeighboursDoNotBleed)
{
  // vessel beside bone
  const auto image = MakePlainImage<short>({ { 16, 16, 16 } });
  const auto mask = MakeMask(image);
  FillByIndex(image, [](const auto & index) { return index[0] < 8 ? 2000 : 300; });
  FillByIndex(mask, [](const auto & index) { return index[0] < 8 ? 0 : 1; });
  Random random(906);
  for (int repeat = 0; repeat < 20; ++repeat)
  {
    const auto filter = MakeFilter(image, MakeRandomView(random, ViewKind::Affine, image));
    filter->SetMaskImage(mask);
    filter->SetDefaultPixelValue(-1000);
    filter->Update();
    const auto            pixels = GetPixels(filter->GetOutput());
    const std::set<short> values(pixels.begin(), pixels.end());
    EXPECT_EQ(values.count(300), 1u);
    EXPECT_EQ(values.size(), 1 + values.count(-1000));
  }
}

TEST(ShearWarpMIPModesClosedForms, FadingVesselsOfEqualBrightness)
{
  const auto image = MakePlainImage<float>({ { 5, 5, 101 } }, -1000);
  for (itk::IndexValueType n = 0; n < 25; ++n)
  {
    image->SetPixel({ { n % 5, n / 5, n % 5 * 20 } }, 500);
  }
  const auto filter = MakeFilter(image, ViewType::New());
  filter->SetDefaultPixelValue(-1000);
  filter->SetDepthAttenuation(0.01);
  filter->Update();
  for (itk::IndexValueType u = 0; u < 5; ++u)
  {
    // the sphere that holds the image is about its middle slice
    const double radius = 0.5 * std::sqrt(5.0 * 5.0 + 5.0 * 5.0 + 101.0 * 101.0);
    const double expected = -1000 + 1500 * std::exp(-0.01 * (20.0 * static_cast<double>(u) - 50.0 + radius));
    EXPECT_NEAR(filter->GetOutput()->GetPixel({ { u, 2 } }), expected, 1e-3);
  }
}

TEST(ShearWarpMIPModesClosedForms, AFadingTurnDoesNotPulse)
{
  using CineType = itk::ShearWarpMIPCineImageFilter<itk::Image<float, 3>, itk::Image<float, 3>>;
  // a small ball amid a cube, which begins up to 12 mm nearer to the viewer from its edges on
  const auto image = MakePlainImage<float>({ { 61, 61, 61 } });
  const auto cine = CineType::New();
  for (itk::IndexValueType n = 0; n < 27; ++n)
  {
    image->SetPixel({ { 29 + n % 3, 29 + n / 3 % 3, 29 + n / 9 } }, 1000);
  }
  cine->SetInput(image);
  cine->SetDepthAttenuation(0.1);
  cine->SetNumberOfFrames(24);
  const double radius = 0.5 * 61 * std::sqrt(3.0);
  const auto   volume = itk::ShearWarp::MakeVolumeGrid(image);
  for (const bool isAboutCenter : { true, false })
  {
    if (!isAboutCenter)
    {
      cine->SetCenter(MakePoint3(-40, 50, 30));
      cine->SetRotationAxis(MakeVector3(1, 2, 3));
    }
    cine->Update();
    for (unsigned int frame = 0; frame < 24; ++frame)
    {
      const auto    length = cine->GetOutput()->ComputeOffset({ { 0, 0, 1 } });
      const float * first = cine->GetOutput()->GetBufferPointer() + frame * length;
      const float   brightest = *std::max_element(first, first + length);
      EXPECT_GT(brightest, 1000 * std::exp(-0.1 * radius)) << frame;
      EXPECT_LT(brightest, 1000 * std::exp(-0.1 * (radius - 2.6))) << frame;
      const double depth =
        itk::ShearWarp::FindSphereDepth(itk::ShearWarp::MakeView(cine->GetFrameTransform(frame)), volume);
      EXPECT_NEAR(depth,
                  cine->GetFrameTransform(frame)->GetInverseTransform()->TransformPoint(GetCenter(image))[2] - radius,
                  1e-9);
    }
  }
}

TEST(ShearWarpMIPModesClosedForms, ABoxChangesNoBitOfWhatFadesInIt)
{
  // one slice, whose rows fade from either end
  const auto image = MakePlainImage<double>({ { 64, 3, 1 } }, 1000);
  for (const double slope : { -0.7, 0.7 })
  {
    const double view[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { slope, 0, 1 } };
    const auto   filter = MakeFilter(image, MakeView(MakeMatrix(view), MakePoint3(0, 0, 0)));
    filter->SetDepthAttenuation(0.0123);
    SetGrid(filter, { { 64, 3 } }, MakeVector2(1, 1), MakePoint2(0, 0));
    filter->Update();
    const auto whole = Copy(filter->GetOutput());
    filter->SetCropLower(MakePoint3(9.5, -10, -10));
    filter->SetCropUpper(MakePoint3(40.5, 10, 10));
    filter->Update();
    for (itk::IndexValueType u = 10; u < 41; ++u)
    {
      EXPECT_EQ(filter->GetOutput()->GetPixel({ { u, 1 } }), whole->GetPixel({ { u, 1 } })) << u;
    }
    EXPECT_EQ(filter->GetOutput()->GetPixel({ { 5, 1 } }), 0.0);
  }
}

TEST(ShearWarpMIPModesClosedForms, InfinityAndNotANumber)
{
  constexpr float infinity = std::numeric_limits<float>::infinity();
  const float     nothing = std::numeric_limits<float>::quiet_NaN();
  const auto      image = MakePlainImage<float>({ { 1, 1, 4 } });
  const auto      filter = MakeFilter(image);
  filter->SetDefaultPixelValue(7);
  const auto project = [&](ModeEnum mode, const std::vector<float> & ray) {
    std::copy(ray.begin(), ray.end(), image->GetBufferPointer());
    image->Modified();
    filter->SetMode(mode);
    filter->Update();
    return filter->GetOutput()->GetPixel({ { 0, 0 } });
  };
  for (const bool hasDepth : { false, true })
  {
    filter->SetComputeDepth(hasDepth);
    ForEachInstructionSet([&](const std::string &) {
      EXPECT_EQ(project(ModeEnum::Maximum, { nothing, -infinity, nothing, -infinity }), 7);
      EXPECT_EQ(project(ModeEnum::Maximum, { nothing, -3, nothing, -infinity }), -3);
      EXPECT_EQ(project(ModeEnum::Minimum, { nothing, infinity, nothing, infinity }), 7);
      EXPECT_EQ(project(ModeEnum::Minimum, { nothing, -infinity, 3, infinity }), -infinity);
      EXPECT_EQ(project(ModeEnum::AbsoluteMaximum, { nothing, nothing, nothing, nothing }), 7);
      EXPECT_EQ(project(ModeEnum::AbsoluteMaximum, { nothing, -infinity, 3, 4 }), -infinity);
      EXPECT_EQ(project(ModeEnum::AbsoluteMaximum, { nothing, -0.0f, nothing, nothing }), 0);
    });
  }
  // what counts as no sample ends no ray
  filter->LocalMaximumOn();
  filter->SetLocalMaximumThreshold(4);
  ForEachInstructionSet([&](const std::string &) {
    EXPECT_EQ(project(ModeEnum::Maximum, { 5, -infinity, nothing, 9 }), 9);
    EXPECT_EQ(project(ModeEnum::Maximum, { 5, 1, nothing, 9 }), 5);
    EXPECT_EQ(project(ModeEnum::Minimum, { 3, infinity, nothing, 1 }), 1);
  });
}

TEST(ShearWarpMIPModesOutput, EveryZeroIsPositiveWithEveryInstructionSet)
{
  constexpr float least = std::numeric_limits<float>::denorm_min();
  constexpr float values[] = { 0.0f, -0.0f, least, -least, -2 * least, 0.5f, -0.5f };
  using Filter = FilterType<float>;
  const std::function<void(Filter *)> options[] = {
    [](Filter *) {},
    [](Filter * filter) { filter->SetOversampling(2); },
    [](Filter * filter) { filter->SetSlabFar(1.0); },
    [](Filter * filter) { filter->SetMaskImage(MakeMask(filter->GetInput())); },
    [](Filter * filter) { filter->SetDepthAttenuation(0.3); },
    [](Filter * filter) {
      filter->SetLocalMaximum(itk::ShearWarp::HasFeature(filter->GetMode(), Feature::LocalMaximum));
      filter->SetLocalMaximumThreshold(-least);
    },
    [](Filter * filter) { filter->ExactOn(); },
  };
  Random random(913);
  for (const itk::SizeValueType width : { 1, 3, 4, 8, 17, 64 })
  {
    for (int repeat = 0; repeat < 84; ++repeat)
    {
      SCOPED_TRACE(repeat);
      const auto image = MakePlainImage<float>({ { 64, 8, repeat % 3 == 0 ? 1u : 3u } });
      FillByIndex(image, [&](const auto & index) {
        return repeat == 0 ? (index[0] % 2 == 1 ? -least : 0.0f) : values[random.Integer(0, repeat % 2 == 0 ? 4 : 6)];
      });
      const bool isAlongGrid = repeat < 42;
      const auto view = isAlongGrid ? ViewType::New() : MakeRandomView(random, ViewKind::Rigid, image);
      const auto filter = MakeFilter(image, view);
      filter->SetMode(AllModes[repeat / 7 % CountOfExtrema]);
      filter->ComputeDepthOn();
      SetGrid(filter, { { width, 8 } }, MakeVector2(1, 1), isAlongGrid ? MakePoint2(2.25, 2.25) : MakePoint2(-3, -3));
      options[repeat % 7](filter);
      itk::Image<float, 2>::Pointer first, firstDepth;
      ForEachInstructionSet([&](const std::string & name) {
        UpdateAnew(filter);
        first = first ? first : Copy(filter->GetOutput());
        firstDepth = firstDepth ? firstDepth : Copy(filter->GetDepthOutput());
        EXPECT_TRUE(HaveSamePixels(first, filter->GetOutput())) << name;
        EXPECT_TRUE(HaveSamePixels(firstDepth, filter->GetDepthOutput())) << name;
        for (const auto & output : { first, firstDepth })
        {
          for (const float pixel : GetPixels(output))
          {
            ASSERT_FALSE(pixel == 0.0f && std::signbit(pixel)) << name;
          }
        }
      });
      if (repeat % 7 > 1 || filter->GetMode() != ModeEnum::Maximum)
      {
        continue;
      }
      const auto parts = MakePartsFilter(filter.GetPointer());
      ForEachInstructionSet([&](const std::string & name) {
        parts->ClearParts();
        const auto part = parts->ProjectPart(image);
        parts->AddPart(part);
        parts->Update();
        EXPECT_TRUE(HaveSamePixels(first, parts->GetOutput())) << name;
        const auto bytes = GetPixels(part);
        for (std::size_t n = 0; n < bytes.size(); n += part->GetBufferedRegion().GetSize(0))
        {
          float pixel;
          std::memcpy(&pixel, &bytes[n], sizeof(pixel));
          ASSERT_FALSE(pixel == 0.0f && std::signbit(pixel)) << name;
        }
      });
    }
  }
}

TEST(ShearWarpMIPModesOutput, IsScaledAsItsVoxelsAreOfAnyMagnitude)
{
  using Filter = FilterType<double>;
  const std::function<void(Filter *)> options[] = {
    [](Filter *) {},
    [](Filter * filter) { filter->SetOversampling(2); },
    [](Filter * filter) { filter->SetMaskImage(MakeMask(filter->GetInput())); },
    [](Filter * filter) { filter->ExactOn(); },
  };
  Random random(914);
  for (int repeat = 0; repeat < 96; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto image = MakeRandomImage<double>(random, MakeRandomSize(random, 1, 12));
    const auto filter = MakeFilter(image, MakeRandomView(random, AllViewKinds[repeat % 3], image));
    filter->SetMode(AllModes[repeat / 4 % CountOfExtrema]);
    filter->ComputeDepthOn();
    options[repeat % 4](filter);
    filter->Update();
    const auto expected = Copy(filter->GetOutput());
    const auto depths = Copy(filter->GetDepthOutput());
    // voxels are below 2^10, and their differences below 2^11
    for (const int exponent : { 1013, 1000, 600, -600, -900 })
    {
      const auto scale = [=](double voxel) { return std::ldexp(voxel, exponent); };
      const auto scaled = MakeAlike<double>(image.GetPointer(), image->GetBufferedRegion());
      FillByIndex(scaled, [&](const auto & index) { return scale(image->GetPixel(index)); });
      filter->SetInput(scaled);
      filter->Update();
      EXPECT_TRUE(HaveSamePixels(depths, filter->GetDepthOutput())) << exponent;
      for (const auto & index : itk::ImageRegionIndexRange<2>(expected->GetBufferedRegion()))
      {
        ASSERT_EQ(filter->GetOutput()->GetPixel(index), scale(expected->GetPixel(index))) << exponent;
      }
    }
  }
}

TEST(ShearWarpMIPModesOutput, OfThreeDimensionsLiesInThePatient)
{
  using VolumeType = itk::Image<short, 3>;
  Random random(907);
  for (int repeat = 0; repeat < 30; ++repeat)
  {
    const auto image = MakeRandomImage<short>(random, MakeRandomSize(random, 4, 20));
    const auto view = MakeRandomView(random, repeat % 2 ? ViewKind::Rigid : ViewKind::Mirrored, image);
    const auto flat = MakeFilter(image, view);
    flat->ComputeDepthOn();
    flat->Update();
    const auto filter = itk::ShearWarpMIPImageFilter<VolumeType, VolumeType>::New();
    filter->SetInput(image);
    filter->SetTransform(view);
    filter->ComputeDepthOn();
    filter->Update();
    const auto size = flat->GetOutput()->GetBufferedRegion().GetSize();
    ASSERT_EQ(filter->GetOutput()->GetBufferedRegion().GetSize(), (itk::Size<3>{ { size[0], size[1], 1 } }));
    EXPECT_EQ(GetPixels(filter->GetOutput()), GetPixels(flat->GetOutput()));

    const auto [lower, upper] = FindCornerBounds(view, image);
    EXPECT_NEAR(filter->GetOutput()->GetSpacing()[2], upper[2] - lower[2], 1e-9);
    for (const itk::IndexValueType x : { itk::IndexValueType{ 0 }, static_cast<itk::IndexValueType>(size[0] - 1) })
    {
      const auto place = GetPlace(flat->GetOutput(), { { x, 2 } });
      const auto expected = view->TransformPoint(MakePoint3(place[0], place[1], 0.5 * (lower[2] + upper[2])));
      const auto point = filter->GetOutput()->TransformIndexToPhysicalPoint<double>({ { x, 2, 0 } });
      EXPECT_LT(point.EuclideanDistanceTo(expected), 1e-9);
    }
    const itk::Index<2> middle{ { static_cast<itk::IndexValueType>(size[0] / 2),
                                  static_cast<itk::IndexValueType>(size[1] / 2) } };
    const PointType     found = flat->GetPhysicalPoint(middle);
    EXPECT_EQ(filter->GetPhysicalPoint({ { middle[0], middle[1], 0 } }), found);
    // of the last update, whatever is set afterwards
    flat->SetTransform(ViewType::New());
    flat->UpdateOutputInformation();
    EXPECT_EQ(flat->GetPhysicalPoint(middle), found);

    filter->SetSlabNear(-1);
    filter->SetSlabFar(1);
    filter->UpdateLargestPossibleRegion();
    const double thickness = std::min(upper[2], 1.0) - std::max(lower[2], -1.0);
    EXPECT_NEAR(filter->GetOutput()->GetSpacing()[2], thickness > 0 ? thickness : 2, 1e-9);
    // a slab beside the image, and one of no thickness, have a place too
    filter->SetSlabNear(1000);
    filter->SetSlabFar(1000);
    filter->UpdateLargestPossibleRegion();
    EXPECT_NEAR(filter->GetOutput()->GetSpacing()[2], 1e-3 * (upper[2] - lower[2]), 1e-9);
    const auto place = filter->GetOutput()->TransformIndexToPhysicalPoint<double>({ { 0, 0, 0 } });
    EXPECT_NEAR(view->GetInverseTransform()->TransformPoint(place)[2], 1000, 1e-9);
  }
}

TEST(ShearWarpMIPModesOutput, DepthComesAndGoes)
{
  const auto image = MakePlainImage<short>({ { 6, 5, 4 } }, 3);
  const auto filter = MakeFilter(image);
  EXPECT_EQ(filter->GetDepthOutput(), nullptr);
  EXPECT_EQ(filter->GetNumberOfIndexedOutputs(), 1u);
  filter->Update();
  EXPECT_ANY_THROW(filter->GetPhysicalPoint({ { 0, 0 } }));
  filter->ComputeDepthOn();
  EXPECT_ANY_THROW(filter->GetPhysicalPoint({ { 0, 0 } }));
  // asked for by itself
  filter->GetDepthOutput()->Update();
  EXPECT_EQ(filter->GetDepthOutput()->GetPixel({ { 2, 2 } }), 0.0f);
  EXPECT_EQ(filter->GetOutput()->GetPixel({ { 2, 2 } }), 3);
  EXPECT_EQ(filter->GetNumberOfIndexedOutputs(), 1u);
  EXPECT_NO_THROW(filter->GetPhysicalPoint({ { 0, 0 } }));
  EXPECT_ANY_THROW(filter->GetPhysicalPoint({ { 6, 0 } }));
  filter->SetSlabNear(100);
  filter->Update();
  EXPECT_TRUE(std::isnan(filter->GetDepthOutput()->GetPixel({ { 2, 2 } })));
  EXPECT_ANY_THROW(filter->GetPhysicalPoint({ { 0, 0 } }));
  filter->ComputeDepthOff();
  filter->Update();
  EXPECT_EQ(filter->GetDepthOutput(), nullptr);
}

TEST(ShearWarpMIPModesParameters, ErrorsNameParameterAndValue)
{
  const auto image = MakePlainImage<float>({ { 6, 5, 4 } }, 3);
  const auto expectError = [&](const char * name, const char * value, const auto & set) {
    const auto filter = MakeFilter(image);
    set(*filter);
    EXPECT_NAMES(filter->Update(), name, value);
  };
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  expectError("SlabNear", "12", [](auto & filter) {
    filter.SetSlabNear(12);
    filter.SetSlabFar(11);
  });
  expectError("SlabFar", "nan", [=](auto & filter) { filter.SetSlabFar(nothing); });
  constexpr double infinity = std::numeric_limits<double>::infinity();
  expectError("SlabNear", "inf", [=](auto & filter) { filter.SetSlabNear(infinity); });
  expectError("SlabFar", "-inf", [=](auto & filter) { filter.SetSlabFar(-infinity); });
  expectError("Mode", "99", [](auto & filter) { filter.SetMode(static_cast<ModeEnum>(99)); });
  expectError("Interpolation", "5", [](auto & filter) { filter.SetInterpolation(static_cast<InterpolationEnum>(5)); });
  expectError("Interpolation", "Oversampling", [](auto & filter) {
    filter.SetInterpolation(InterpolationEnum::Nearest);
    filter.SetOversampling(2);
  });
  expectError("Interpolation", "DepthAttenuation", [](auto & filter) {
    filter.SetInterpolation(InterpolationEnum::Nearest);
    filter.SetDepthAttenuation(0.1);
  });
  expectError("ReducedResampling", "7", [](auto & filter) {
    filter.SetReducedResampling(static_cast<itk::ShearWarpMIPImageFilterEnums::ReducedResampling>(7));
  });
  expectError("CropLower", "8", [](auto & filter) {
    filter.SetCropLower(PointType(8.0));
    filter.SetCropUpper(PointType(7.0));
  });
  expectError("DepthAttenuation", "-0.5", [](auto & filter) { filter.SetDepthAttenuation(-0.5); });
  expectError("DepthAttenuation", "inf", [=](auto & filter) { filter.SetDepthAttenuation(infinity); });
  expectError("DefaultPixelValue", "nan", [=](auto & filter) {
    filter.SetDepthAttenuation(1);
    filter.SetDefaultPixelValue(static_cast<float>(nothing));
  });
  expectError("LocalMaximumThreshold", "nan", [=](auto & filter) {
    filter.LocalMaximumOn();
    filter.SetLocalMaximumThreshold(static_cast<float>(nothing));
  });
  expectError("MaskImage", "[6, 5, 3]", [](auto & filter) {
    filter.SetMaskImage(MakePlainImage<unsigned char>({ { 6, 5, 3 } }));
  });
  expectError("MaskImage", "2.0", [](auto & filter) {
    const auto mask = MakePlainImage<unsigned char>({ { 6, 5, 4 } });
    mask->SetSpacing(MakeVector3(1, 1, 2));
    filter.SetMaskImage(mask);
  });
}

TEST(ShearWarpMIPModesParameters, FeaturesThatAModeHasNotAreRefused)
{
  const auto image = MakePlainImage<float>({ { 6, 5, 4 } }, 3);
  const auto single = MakeFilter(image);
  const auto cine = itk::ShearWarpMIPCineImageFilter<itk::Image<float, 3>>::New();
  cine->SetInput(image);
  const auto expect = [](const auto & filter, Feature feature, bool isOn) {
    filter->SetLocalMaximum(isOn && feature == Feature::LocalMaximum);
    filter->SetComputeDepth(isOn && feature == Feature::Depth);
    filter->SetExact(isOn && feature == Feature::Exact);
    filter->SetInterpolation(isOn && feature == Feature::Nearest ? InterpolationEnum::Nearest
                                                                 : InterpolationEnum::Linear);
    for (const ModeEnum mode : AllModes)
    {
      SCOPED_TRACE(mode);
      filter->SetMode(mode);
      const auto text = GetExceptionDescription([&] { filter->UpdateLargestPossibleRegion(); });
      EXPECT_EQ(text == "no exception", !isOn || itk::ShearWarp::HasFeature(mode, feature)) << text;
    }
  };
  for (const Feature feature : { Feature::Depth, Feature::Exact, Feature::LocalMaximum, Feature::Nearest })
  {
    for (const bool isOn : { false, true, false })
    {
      expect(single, feature, isOn);
      expect(cine, feature, isOn);
    }
  }
  const auto expectMessage = [](const auto & filter) {
    filter->LocalMaximumOn();
    filter->SetMode(ModeEnum::AbsoluteMaximum);
    EXPECT_NAMES(filter->Update(), "LocalMaximum needs Mode Maximum or Minimum, but Mode is AbsoluteMaximum.");
  };
  expectMessage(single);
  expectMessage(cine);
}

TEST(ShearWarpMIPModesParameters, AThresholdThatIsNotUsedMayBeAnything)
{
  const auto filter = MakeFilter(MakePlainImage<float>({ { 6, 5, 4 } }, 3));
  filter->SetLocalMaximumThreshold(std::numeric_limits<float>::quiet_NaN());
  EXPECT_NO_THROW(filter->Update());
}

TEST(ShearWarpMIPModesParameters, EachIsPrintedAndMakesTheFilterModified)
{
  const auto image = MakePlainImage<float>({ { 6, 5, 4 } }, 3);
  const auto filter = MakeFilter(image);
  const auto expectModified = [&](const char * text, const auto & set) {
    const auto before = filter->GetMTime();
    set();
    EXPECT_GT(filter->GetMTime(), before) << text;
    const auto after = filter->GetMTime();
    set();
    EXPECT_EQ(filter->GetMTime(), after) << text;
    ExpectPrinted(filter, { text });
  };
  expectModified("Mode: itk::ShearWarpMIPImageFilterEnums::Mode::Minimum", [&] { filter->SetMode(ModeEnum::Minimum); });
  expectModified("Interpolation: itk::ShearWarpMIPImageFilterEnums::Interpolation::Nearest",
                 [&] { filter->SetInterpolation(InterpolationEnum::Nearest); });
  expectModified("SlabNear: -2.5", [&] { filter->SetSlabNear(-2.5); });
  expectModified("SlabFar: 2.5", [&] { filter->SetSlabFar(2.5); });
  expectModified("CropLower: [1, 1, 1]", [&] { filter->SetCropLower(PointType(1.0)); });
  expectModified("CropUpper: [4, 4, 4]", [&] { filter->SetCropUpper(PointType(4.0)); });
  expectModified("MaskLabel: 9", [&] { filter->SetMaskLabel(9); });
  expectModified("LocalMaximum: On", [&] { filter->LocalMaximumOn(); });
  expectModified("LocalMaximumThreshold: 6", [&] { filter->SetLocalMaximumThreshold(6); });
  expectModified("DepthAttenuation: 0.25", [&] { filter->SetDepthAttenuation(0.25); });
  expectModified("ComputeDepth: On", [&] { filter->ComputeDepthOn(); });
  const auto mask = MakeMask(image);
  expectModified("MaskImage", [&] { filter->SetMaskImage(mask); });
}
