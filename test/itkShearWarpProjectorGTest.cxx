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
#include "itkEuler3DTransform.h"
#include "itkShearWarpMIPImageFilter.h"
#include "Projector.h"

#include "itkShearWarpMIPTestParts.h"

namespace
{
using namespace itk::ShearWarpMIPTest;
using ReducedResamplingEnum = itk::ShearWarpMIPImageFilterEnums::ReducedResampling;

constexpr ReducedResamplingEnum Modes[] = { ReducedResamplingEnum::Off,
                                            ReducedResamplingEnum::On,
                                            ReducedResamplingEnum::Auto };

/** Views along each axis with zero, one and two shears, near and far from the axis. */
std::vector<itk::Transform<double, 3, 3>::ConstPointer>
MakeViews()
{
  std::vector<itk::Transform<double, 3, 3>::ConstPointer> views;
  for (const auto & angles : std::initializer_list<std::array<double, 3>>{ { 0, 0, 0 },
                                                                           { 0, 0.3, 0 },
                                                                           { 0, 2.7, 0.2 },
                                                                           { 0.4, 0, 0 },
                                                                           { 0.3, 0.5, 0.1 },
                                                                           { 1.5, 0, 0 },
                                                                           { 1.3, 0.2, 0.4 },
                                                                           { 0, 1.5, 0 },
                                                                           { 0.2, 1.4, -0.3 },
                                                                           { 0.6, 0.7, 0 } })
  {
    const auto view = itk::Euler3DTransform<double>::New();
    view->SetRotation(angles[0], angles[1], angles[2]);
    views.emplace_back(view);
  }
  return views;
}
template <typename TPixel>
class ShearWarpProjectorTyped : public testing::Test
{
public:
  using ImageType = itk::Image<TPixel, 3>;

  /** Projects each view with every instruction set, mode and number of threads, without and with oversampling; all must
   * give the bits of the portable kernels without reduced resampling. Returns the views' smallest and largest skipped
   * fractions. */
  static std::pair<double, double>
  ExpectTheSameBits(const ImageType * image)
  {
    std::vector<double> skipped;
    for (const auto & view : MakeViews())
    {
      SCOPED_TRACE("view " + std::to_string(skipped.size()));
      skipped.push_back(std::max(ExpectTheSameBits(image, view, 1), ExpectTheSameBits(image, view, 2)));
    }
    return { *std::min_element(skipped.begin(), skipped.end()), *std::max_element(skipped.begin(), skipped.end()) };
  }

  /** The intermediate image, where slices reach it, from \a parts. */
  static std::vector<TPixel>
  ProjectInParts(const ImageType *                        image,
                 const itk::Transform<double, 3, 3> *     view,
                 unsigned int                             oversampling,
                 const std::vector<itk::ImageRegion<3>> & parts)
  {
    const auto & kernels = itk::ShearWarp::GetKernels<TPixel>();
    const auto   grid = itk::ImageBase<2>::New();
    grid->SetLargestPossibleRegion(itk::Size<2>{ { 1, 1 } });
    const itk::ShearWarpFactorization    factorization(view, image, grid, oversampling);
    const unsigned int                   axis = factorization.GetPrincipalAxis();
    itk::ShearWarpPreparedVolume<TPixel> volume;
    itk::ShearWarpProjector<TPixel>      projector;
    const auto call = [](itk::SizeValueType count, itk::SizeValueType steps, const auto & process) {
      for (itk::SizeValueType n = 0; n < count * steps; ++n)
      {
        process(n / steps, n % steps, n / steps % 2);
      }
    };
    typename itk::ShearWarpProjector<TPixel>::Parameters parameters;
    parameters.reducedResampling = ReducedResamplingEnum::On;
    projector.Start({ { &factorization, {} } }, kernels, parameters, 2);
    for (const auto & region : parts)
    {
      const auto part = MakePart(image, region);
      const auto begin = region.GetIndex(2) - image->GetLargestPossibleRegion().GetIndex(2);
      const auto end = begin + static_cast<itk::IndexValueType>(region.GetSize(2));
      volume.PreparePart(part, image->GetLargestPossibleRegion(), begin, end, axis, true, kernels, call);
      projector.Project(volume, nullptr, call);
    }
    const auto          intermediate = projector.Finish(0, call);
    std::vector<TPixel> pixels;
    for (std::ptrdiff_t row = 0; row < intermediate.rows; ++row)
    {
      const TPixel * begin = intermediate.pixels + row * intermediate.rowStride;
      pixels.insert(pixels.end(), begin + intermediate.reached[row].begin, begin + intermediate.reached[row].end);
    }
    return pixels;
  }

private:
  static double
  ExpectTheSameBits(const ImageType * image, const itk::Transform<double, 3, 3> * view, unsigned int oversampling)
  {
    SCOPED_TRACE("oversampling " + std::to_string(oversampling));
    const auto filter = MakeFilter(image, view);
    filter->SetOversampling(oversampling);
    filter->SetDefaultPixelValue(TPixel{ 7 });
    // positions between the intermediate image's pixels, and beyond it
    filter->SetOutputSpacing(itk::Vector<double, 2>(0.73));
    typename itk::Image<TPixel, 2>::Pointer expected;

    double skipped = 0.0;
    ForEachInstructionSet([&](const std::string & name) {
      for (const ReducedResamplingEnum mode : Modes)
      {
        for (const unsigned int threads : { 1, 2, 5 })
        {
          SetThreads(filter, threads);
          filter->SetReducedResampling(mode);
          UpdateAnew(filter);
          EXPECT_EQ(filter->GetInstructionSet(), HasVectorKernels() ? name : "portable");
          expected = expected ? expected : Copy(filter->GetOutput());
          EXPECT_TRUE(HaveSamePixels(expected, filter->GetOutput()))
            << name << ", " << mode << ", " << threads << " threads";
          EXPECT_GE(filter->GetSkippedFraction(), 0.0);
          EXPECT_LE(filter->GetSkippedFraction(), mode == ReducedResamplingEnum::Off ? 0.0 : 1.0);
          skipped = std::max(skipped, filter->GetSkippedFraction());
        }
      }
    });
    return skipped;
  }

  static bool
  HasVectorKernels()
  {
    return std::is_same_v<TPixel, float> || (std::is_integral_v<TPixel> && sizeof(TPixel) <= 2);
  }
};

using PixelTypes = testing::Types<unsigned char, signed char, unsigned short, short, float, int, double>;
TYPED_TEST_SUITE(ShearWarpProjectorTyped, PixelTypes, );

} // namespace

TYPED_TEST(ShearWarpProjectorTyped, NoiseGivesTheSameBitsHoweverItIsProjected)
{
  Random random(601);
  for (const auto & size : { itk::Size<3>{ { 129, 77, 45 } }, { { 35, 90, 61 } }, { { 5, 33, 70 } } })
  {
    const auto image = MakeRandomImage<TypeParam>(random, size);
    TestFixture::ExpectTheSameBits(image);
  }
}

TYPED_TEST(ShearWarpProjectorTyped, PartsOfAnImageGiveTheBitsOfTheWhole)
{
  Random       random(606);
  const auto   image = MakeRandomImage<TypeParam>(random, { { 61, 45, 38 } });
  const auto & region = image->GetLargestPossibleRegion();
  for (const auto & view : MakeViews())
  {
    for (const unsigned int oversampling : { 1, 2 })
    {
      const auto whole = TestFixture::ProjectInParts(image, view, oversampling, { region });
      const auto parts = MakeRandomParts(random, region, 1, 30);
      ForEachInstructionSet([&](const std::string &) {
        EXPECT_TRUE(TestFixture::ProjectInParts(image, view, oversampling, parts) == whole);
      });
    }
  }
}

TYPED_TEST(ShearWarpProjectorTyped, FewBrightVoxelsGiveTheSameBitsHoweverTheyAreProjected)
{
  Random     random(602);
  const auto image = MakeRandomImage<TypeParam>(random, { { 129, 77, 45 } });
  image->FillBuffer(TypeParam{ 3 });
  for (int n = 0; n < 60; ++n)
  {
    TypeParam & voxel = image->GetBufferPointer()[random.Integer(0, 129 * 77 * 45 - 1)];
    voxel = static_cast<TypeParam>(random.Integer(4, 120));
  }
  EXPECT_GT(TestFixture::ExpectTheSameBits(image).first, 0.1);
}

TYPED_TEST(ShearWarpProjectorTyped, AConstantVolumeIsSkippedButForTheFirstSlices)
{
  Random     random(603);
  const auto image = MakeRandomImage<TypeParam>(random, { { 96, 80, 128 } });
  image->FillBuffer(TypeParam{ 9 });
  EXPECT_GT(TestFixture::ExpectTheSameBits(image).first, 0.5);
}

TEST(ShearWarpProjector, DataWithinHalfTheRangeAndBeyondGiveTheSameBits)
{
  using Fixture = ShearWarpProjectorTyped<unsigned short>;
  Random     random(604);
  const auto image = MakeRandomImage<unsigned short>(random, { { 70, 40, 30 } });
  const auto count = image->GetBufferedRegion().GetNumberOfPixels();
  for (const auto & [lowest, highest] : std::initializer_list<std::pair<int, int>>{
         { 0, 32767 }, { 0, 32768 }, { 30000, 62767 }, { 32768, 65535 }, { 0, 65535 } })
  {
    for (itk::SizeValueType n = 0; n < count; ++n)
    {
      // extremes side by side
      const auto choice = random.Integer(0, 3);
      image->GetBufferPointer()[n] =
        static_cast<unsigned short>(n == 0 || choice == 0   ? lowest
                                    : n == 1 || choice == 1 ? highest
                                                            : random.Integer(lowest, highest));
    }
    image->Modified();
    Fixture::ExpectTheSameBits(image);
  }
}

TEST(ShearWarpProjector, NotANumberInfinityAndZerosOfBothSignsGiveTheSameBits)
{
  using Fixture = ShearWarpProjectorTyped<float>;
  Random          random(605);
  const auto      image = MakeRandomImage<float>(random, { { 70, 40, 45 } });
  const auto      count = image->GetBufferedRegion().GetNumberOfPixels();
  float *         voxels = image->GetBufferPointer();
  constexpr float infinity = std::numeric_limits<float>::infinity();
  constexpr float specials[] = { std::numeric_limits<float>::quiet_NaN(), infinity, -infinity, 0.0f, -0.0f, 1e-40f };
  for (const int rarity : { 3, 300 })
  {
    for (itk::SizeValueType n = 0; n < count; ++n)
    {
      voxels[n] = random.Integer(0, rarity) == 0 ? specials[random.Integer(0, 5)] : -0.5f;
    }
    image->Modified();
    Fixture::ExpectTheSameBits(image);
  }
  // the difference of two voxels overflows: interpolation may exceed both
  for (itk::SizeValueType n = 0; n < count; ++n)
  {
    voxels[n] = random.Integer(0, 1) == 0 ? 3e38f : -3e38f;
  }
  image->Modified();
  EXPECT_EQ(Fixture::ExpectTheSameBits(image).second, 0.0);
}
