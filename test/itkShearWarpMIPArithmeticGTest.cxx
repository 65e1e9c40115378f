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
#include "itkShearWarpMIPTestImages.h"
#include "itkShearWarpMIPTestParts.h"

/* Compiled twice, the second time by a compiler that may fuse multiplications and additions, and may assume that
 * numbers are finite. */
namespace
{
using namespace itk::ShearWarpMIPTest;

constexpr float notANumber = std::numeric_limits<float>::quiet_NaN();

const double Turned[3][3] = { { 0.48, 0.8, 0.36 }, { -0.6, 0, 0.8 }, { 0.64, -0.6, 0.48 } };
const double Views[][3][3] = { { { -0.36, 0.48, 0.8 }, { 0.8, 0.6, 0 }, { 0.48, -0.64, -0.6 } },
                               { { 0.6, 0, 0.8 }, { 0, 1, 0 }, { -0.8, 0, 0.6 } },
                               { { 1.1, 0.2, 0.3 }, { -0.1, 0.9, -0.7 }, { 0.05, 0.4, -1.3 } } };

/** Oblique, anisotropic, with an origin and an index; from integers alone. */
template <typename TPixel>
typename itk::Image<TPixel, 3>::Pointer
MakeFixedImage()
{
  auto image = itk::Image<TPixel, 3>::New();
  image->SetRegions(itk::ImageRegion<3>({ { 7, -3, 11 } }, { { 33, 29, 37 } }));
  image->SetSpacing(MakeVector3(0.7, 1.3, 0.9));
  image->SetOrigin(MakePoint3(-20.1, 12.3, -4.7));
  image->SetDirection(MakeMatrix(Turned));
  image->Allocate();
  std::uint64_t state = 1;
  for (itk::SizeValueType n = 0; n < image->GetBufferedRegion().GetNumberOfPixels(); ++n)
  {
    state = state * 6364136223846793005u + 1442695040888963407u;
    image->GetBufferPointer()[n] = static_cast<TPixel>(static_cast<std::int64_t>(state >> 50) - (1 << 13));
  }
  return image;
}

template <typename TArray>
void
AddArray(const TArray & array, std::uint64_t & checksum)
{
  AddToChecksum(&array[0], 3, checksum);
}

template <typename TPixel>
void
ExpectChecksum(std::uint64_t expected)
{
  using ImageType = itk::Image<TPixel, 3>;
  const auto image = MakeFixedImage<TPixel>();
  const auto filter = itk::ShearWarpMIPImageFilter<ImageType, ImageType>::New();
  filter->SetInput(image);
  filter->SetDefaultPixelValue(-37);
  filter->ComputeDepthOn();
  filter->SetCropUpper(MakePoint3(1e3, 1e3, 17.3));
  ForEachInstructionSet([&](const std::string &) {
    std::uint64_t checksum = EmptyChecksum;
    for (const auto & matrix : Views)
    {
      filter->SetTransform(MakeView(MakeMatrix(matrix), MakePoint3(11.1, 19.9, 7.7)));
      for (const unsigned int oversampling : { 1, 2 })
      {
        filter->SetOversampling(oversampling);
        filter->SetSlabNear(oversampling == 1 ? -100.0 : -13.7);
        filter->SetSlabFar(12.9);
        filter->SetDepthAttenuation(oversampling == 1 ? 0.0137 : 0.71);
        filter->Update();
        const ImageType * output = filter->GetOutput();
        AddToChecksum(output, checksum);
        const auto * depths = filter->GetDepthOutput();
        AddToChecksum(depths, checksum);
        AddArray(output->GetOrigin(), checksum);
        AddArray(output->GetSpacing(), checksum);
        const auto * values = depths->GetBufferPointer();
        const auto   count = depths->GetBufferedRegion().GetNumberOfPixels();
        const auto   first =
          std::find_if(values, values + count, [](float depth) { return !HaveSameBits(depth, notANumber); });
        AddArray(filter->GetPhysicalPoint(depths->ComputeIndex(first - values)), checksum);
        for (unsigned int row = 0; row < 3; ++row)
        {
          AddArray(output->GetDirection()[row], checksum);
        }
      }
    }
    EXPECT_EQ(checksum, expected) << std::hex << "0x" << checksum;
  });
}
} // namespace

TEST(ShearWarpMIPArithmetic, IsCompiledInTheLibrary)
{
  ExpectChecksum<short>(0xc7e7ddc152e4efbc);
  ExpectChecksum<double>(0x9a4813f81a7509b6);
}

TEST(ShearWarpMIPArithmetic, ChecksAreCompiledInTheLibrary)
{
  using ImageType = itk::Image<float, 3>;
  const auto image = MakePlainImage<float>({ { 6, 5, 4 } }, 3);
  const auto expectError = [&](const char * name, const auto & set) {
    const auto single = itk::ShearWarpMIPImageFilter<ImageType, ImageType>::New();
    const auto turn = itk::ShearWarpMIPCineImageFilter<ImageType>::New();
    single->SetInput(image);
    turn->SetInput(image);
    if constexpr (std::is_invocable_v<decltype(set), decltype(*single)>)
    {
      single->Update();
      set(*single);
      EXPECT_NAMES(single->Update(), name);
    }
    turn->Update();
    set(*turn);
    EXPECT_NAMES(turn->Update(), name);
  };
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : { static_cast<double>(notANumber), infinity, -infinity })
  {
    expectError("OutputSpacing", [=](auto & filter) { filter.SetOutputSpacing(MakeVector2(1, bad)); });
    expectError("OutputOrigin", [=](auto & filter) { filter.SetOutputOrigin(MakePoint2(bad, 1)); });
    expectError("DepthAttenuation", [=](auto & filter) { filter.SetDepthAttenuation(bad); });
    expectError("DefaultPixelValue", [=](auto & filter) {
      filter.SetDepthAttenuation(1);
      filter.SetDefaultPixelValue(static_cast<float>(bad));
    });
    expectError("Transform",
                [=](auto & filter) { filter.SetTransform(MakeView(MakeDiagonal(1, 1, 1), MakePoint3(0, bad, 0))); });
    using Turn = itk::ShearWarpMIPCineImageFilter<ImageType>;
    expectError("RotationAxis", [=](Turn & turn) { turn.SetRotationAxis(MakeVector3(0, bad, 1)); });
    expectError("Center", [=](Turn & turn) { turn.SetCenter(MakePoint3(0, bad, 1)); });
    expectError("StartAngle", [=](Turn & turn) { turn.SetStartAngle(bad); });
    expectError("AngularRange", [=](Turn & turn) { turn.SetAngularRange(bad); });
  }
  for (const double bad : { static_cast<double>(notANumber), infinity })
  {
    expectError("SlabNear", [=](auto & filter) { filter.SetSlabNear(bad); });
    expectError("SlabFar", [=](auto & filter) { filter.SetSlabFar(-bad); });
  }
  expectError("CropLower", [](auto & filter) { filter.SetCropLower(PointType(notANumber)); });
  expectError("CropUpper", [](auto & filter) { filter.SetCropUpper(MakePoint3(1, notANumber, 1)); });
  expectError("LocalMaximumThreshold", [](auto & filter) {
    filter.LocalMaximumOn();
    filter.SetLocalMaximumThreshold(notANumber);
  });

  const auto filter = MakeFilter(image);
  filter->SetDefaultPixelValue(notANumber);
  SetGrid(filter, { { 4, 4 } }, MakeVector2(1, 1), MakePoint2(4, 0));
  filter->ComputeDepthOn();
  filter->Update();
  EXPECT_EQ(filter->GetOutput()->GetPixel({ { 1, 0 } }), 3.0f);
  EXPECT_TRUE(HaveSameBits(filter->GetOutput()->GetPixel({ { 3, 0 } }), notANumber));
  EXPECT_NO_THROW(filter->GetPhysicalPoint({ { 1, 0 } }));
  EXPECT_NAMES(filter->GetPhysicalPoint({ { 3, 0 } }), "No ray has a value at column 3, row 0");

  // what is infinite by default is no slab or box
  filter->ComputeDepthOff();
  filter->Update();
  EXPECT_TRUE(HaveSamePixels(filter->GetOutput(), ProjectAsOnePart(filter.GetPointer())));

  image->SetOrigin(MakePoint3(0, infinity, 0));
  EXPECT_NAMES(filter->Update(), "origin must be finite");
}

TEST(ShearWarpMIPArithmetic, AnglesAreCompiledInTheLibrary)
{
  const auto turn = itk::ShearWarpMIPCineImageFilter<itk::Image<short, 3>, itk::Image<short, 3>>::New();
  turn->SetNumberOfFrames(100);
  turn->SetStartAngle(0.1);
  turn->SetAngularRange(123.4);
  const std::vector<double> angles = turn->GetFrameAngles();
  std::uint64_t             checksum = EmptyChecksum;
  AddToChecksum(angles.data(), angles.size(), checksum);
  EXPECT_EQ(checksum, 0x670149de154238b0u) << std::hex << "0x" << checksum;
}

TEST(ShearWarpMIPArithmetic, DecayIsTheExponentialFunctionAndNeverRises)
{
  using itk::ShearWarp::Decay;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(Decay(0.0), 1.0);
  EXPECT_EQ(Decay(std::numeric_limits<double>::denorm_min()), 1.0);
  EXPECT_GT(Decay(std::nextafter(708.0, 0.0)), std::numeric_limits<double>::min());
  for (const double x : { 708.0, 1e4, std::numeric_limits<double>::max(), infinity })
  {
    EXPECT_EQ(Decay(x), 0.0) << x;
  }
  Random random(907);
  for (int repeat = 0; repeat < 200000; ++repeat)
  {
    // of every magnitude, and where another power of two begins
    const double edge = (static_cast<double>(random.Integer(0, repeat % 4 == 1 ? 5 : 1020)) + 0.5) * std::log(2.0);
    double       x = repeat % 2 == 0 ? std::pow(2.0, random.Uniform(-60, 9.4)) : edge * (1.0 - 12 * 0x1p-53);
    double       value = Decay(x);
    ASSERT_LE(std::abs(static_cast<double>(value / std::exp(static_cast<long double>(-x)) - 1.0L)), 0x1p-52) << x;
    for (int step = 0; step < 20; ++step)
    {
      x = std::nextafter(x + static_cast<double>(repeat % 3) * 0x1p-52, infinity);
      ASSERT_LE(Decay(x), value) << x;
      value = Decay(x);
    }
  }
}
