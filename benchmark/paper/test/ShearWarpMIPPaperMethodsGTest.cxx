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
#include "Data.h"
#include "MethodStudy.h"
#include "PlainShearWarp.h"
#include "RayCasting.h"
#include "TaggedShearWarp.h"

#include "itkImageFileReader.h"
#include "itkImageFileWriter.h"
#include "itkImageRegionIteratorWithIndex.h"
#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPTestImages.h"

#include <cstdio>
#include <functional>
#include <map>

namespace
{
using namespace itk::ShearWarpBenchmark;
using namespace itk::ShearWarpMIPTest;

using VolumeType = itk::Image<std::uint16_t, 3>;

/** Most cells can be skipped where a tenth of the voxels is bright. */
VolumeType::Pointer
MakeRandomVolume(Random & random, const itk::Size<3> & size)
{
  const auto volume = VolumeType::New();
  SetRandomGeometry(random, volume, size);
  volume->Allocate();
  std::generate_n(volume->GetBufferPointer(), volume->GetBufferedRegion().GetNumberOfPixels(), [&random] {
    return static_cast<std::uint16_t>(random.Integer(0, 9) == 0 ? random.Integer(0, 16383) : random.Integer(0, 500));
  });
  return volume;
}

/** Calls \a process(pixel, index) for each pixel. */
template <typename TImage, typename TFunction>
void
ForEachPixel(TImage * image, const TFunction & process)
{
  for (itk::ImageRegionIteratorWithIndex<TImage> it(image, image->GetBufferedRegion()); !it.IsAtEnd(); ++it)
  {
    process(it.Value(), it.GetIndex());
  }
}

VolumeType::Pointer
MakeVolumeOf(const itk::Size<3> & size, const std::function<int(const itk::Index<3> &)> & valueAt)
{
  const auto volume = MakePlainImage<std::uint16_t>(size);
  ForEachPixel(volume.GetPointer(),
               [&](auto & voxel, const auto & index) { voxel = static_cast<std::uint16_t>(valueAt(index)); });
  return volume;
}

/** A grid of spacing 1 around the view's origin. */
template <typename TPixel>
typename itk::Image<TPixel, 2>::Pointer
MakeOutput(const itk::Size<2> & size)
{
  const auto output = itk::Image<TPixel, 2>::New();
  output->SetRegions(size);
  output->SetOrigin(MakePoint2(-0.5 * static_cast<double>(size[0] - 1), -0.5 * static_cast<double>(size[1] - 1)));
  output->Allocate();
  return output;
}

TaggedShearWarp::Projection
ProjectTagged(const VolumeType * volume, const Angles & angles)
{
  const auto                        view = MakeView(volume, angles);
  const itk::ShearWarpFactorization factorization(view, volume, MakeFittedOutput(volume, view));
  return TaggedShearWarp(volume).Project(factorization);
}

const Angles AlongX{ 0, 90, 0 };
const Angles AlongY{ 90, 0, 0 };
const Angles AlongZ{ 0, 0, 0 };
const Angles AgainstZ{ 0, 180, 0 };
} // namespace

TEST(PaperMethods, ShearWarpsAreEqualInEveryBit)
{
  Random random(20);
  bool   isSkipped[3] = {};
  for (int round = 0; round < 60; ++round)
  {
    itk::Size<3> size = MakeRandomSize(random, 2, 21);
    if (round % 4 == 0)
    {
      size[static_cast<unsigned int>(random.Integer(0, 2))] = 1;
    }
    const auto volume = MakeRandomVolume(random, size);
    const auto view = MakeRandomView(random, AllViewKinds[round % 3], volume);
    const auto grid = MakeFittedOutput(volume, view);

    const itk::ShearWarpFactorization factorization(view, volume, grid);
    const auto                        tagged = TaggedShearWarp(volume).Project(factorization);
    EXPECT_EQ(tagged.cells, volume->GetBufferedRegion().GetNumberOfPixels());
    isSkipped[factorization.GetPrincipalAxis()] |= tagged.skippedCells > tagged.cells / 4;

    const auto intermediate =
      Project(PermutedVolume<std::uint16_t>(volume, factorization.GetPrincipalAxis()), factorization);
    const auto reached = factorization.GetReachedColumns();
    for (std::size_t row = 0; row < reached.size(); ++row)
    {
      for (std::int32_t column = reached[row].begin; column < reached[row].end; ++column)
      {
        const std::size_t n = row * factorization.GetIntermediateSize()[0] + column;
        ASSERT_EQ(tagged.intermediate[n], intermediate[n])
          << "round " << round << ", column " << column << ", row " << row;
      }
    }

    const auto picture =
      Warp<std::uint16_t>(factorization, tagged.intermediate, grid->GetBufferedRegion().GetSize(), 5);
    const auto filter = itk::ShearWarpMIPImageFilter<VolumeType>::New();
    filter->SetInput(volume);
    filter->SetTransform(view);
    filter->SetDefaultPixelValue(5);
    filter->Update();
    ASSERT_EQ(filter->GetOutput()->GetBufferedRegion(), grid->GetBufferedRegion());
    EXPECT_TRUE(std::equal(picture.begin(), picture.end(), filter->GetOutput()->GetBufferPointer()))
      << "round " << round;
  }
  EXPECT_TRUE(isSkipped[0] && isSkipped[1] && isSkipped[2]);
}

TEST(PaperMethods, SkipsWhatCannotChangeThePixel)
{
  const itk::Size<3> size{ { 5, 4, 7 } };
  const auto         constant = MakePlainImage<std::uint16_t>(size, 1000);
  // all slices but the first
  EXPECT_EQ(ProjectTagged(constant, AlongX).skippedCells, 4 * 4 * 7);
  EXPECT_EQ(ProjectTagged(constant, AlongY).skippedCells, 5 * 3 * 7);
  EXPECT_EQ(ProjectTagged(constant, AlongZ).skippedCells, 5 * 4 * 6);
}

TEST(PaperMethods, TakesSlicesInStorageOrder)
{
  const itk::Size<3> size{ { 5, 4, 7 } };
  const auto         increasing = MakeVolumeOf(size, [](auto index) { return 10 + index[2]; });
  const auto         decreasing = MakeVolumeOf(size, [](auto index) { return 10 - index[2]; });
  for (const Angles & angles : { AlongZ, AgainstZ })
  {
    EXPECT_EQ(ProjectTagged(increasing, angles).skippedCells, 0);
    EXPECT_EQ(ProjectTagged(decreasing, angles).skippedCells, 5 * 4 * 6);
  }
}

TEST(PaperMethods, AVoxelKeepsItsFourCells)
{
  const auto spot = [](auto index) { return index[2] == 0 ? 10 : index[0] == 2 && index[1] == 1 ? 20 : 0; };
  EXPECT_EQ(ProjectTagged(MakeVolumeOf({ { 5, 4, 2 } }, spot), AlongZ).skippedCells, 5 * 4 - 4);
}

TEST(PaperMethods, VoxelsHave14Bits)
{
  const auto volume = MakePlainImage<std::uint16_t>({ { 3, 3, 3 } }, 16383);
  EXPECT_EQ(ProjectTagged(volume, AlongZ).intermediate[0], 16383);
  volume->SetPixel({ { 1, 2, 1 } }, 16384);
  EXPECT_NAMES(TaggedShearWarp{ volume }, "16384");
}

TEST(PaperMethods, RayCastingAlongAnAxisGivesTheMaxima)
{
  Random             random(21);
  const itk::Size<3> size{ { 5, 4, 7 } };
  const auto         volume = MakePlainImage<std::uint16_t>(size);
  FillRandom(random, volume.GetPointer());
  const auto view = MakeView(volume, AlongZ);
  const auto output = MakeOutput<std::uint16_t>({ { 7, 6 } });
  CastRays<std::uint16_t>(volume, view, 1.0, 3, output);
  ForEachPixel(output.GetPointer(), [&](auto pixel, const auto & index) {
    // one pixel of background around the volume
    itk::Index<3> voxel{ { index[0] - 1, index[1] - 1, 0 } };
    std::uint16_t expected = 3;
    if (volume->GetBufferedRegion().IsInside(voxel))
    {
      for (expected = 0; voxel[2] < 7; ++voxel[2])
      {
        expected = std::max(expected, volume->GetPixel(voxel));
      }
    }
    EXPECT_EQ(pixel, expected) << index;
  });
}

TEST(PaperMethods, RayCastingOfALinearRamp)
{
  constexpr double length = 9;
  const double     half = 0.5 * (length - 1);
  const auto       volume = MakePlainImage<float>({ { 9, 9, 9 } });
  const auto       view = MakeView(volume, { 0, 30, 0 });
  const auto       output = MakeOutput<float>({ { 15, 15 } });

  // view space is where the inverse of the view takes a voxel
  const auto toView = view->GetInverseTransform();
  const auto fill = [&](const auto & valueAt) {
    ForEachPixel(volume.GetPointer(), [&](auto & voxel, const auto & index) {
      PointType point;
      volume->TransformIndexToPhysicalPoint(index, point);
      voxel = static_cast<float>(valueAt(toView->TransformPoint(point)));
    });
    CastRays<float>(volume, view, 0.25, -100.0F, output);
  };

  // across the rays: the same all along each
  fill([](const auto & point) { return point[0] + 10 * point[1]; });
  const double reach = half * (std::cos(itk::Math::pi / 6) + std::sin(itk::Math::pi / 6));
  ForEachPixel(output.GetPointer(), [&](auto pixel, const auto & index) {
    const auto u = static_cast<double>(index[0] - 7);
    const auto v = static_cast<double>(index[1] - 7);
    const bool isHit = std::abs(u) <= reach && std::abs(v) <= half;
    EXPECT_NEAR(pixel, isHit ? u + 10 * v : -100, 1e-4) << index;
  });

  // along the rays: the value where the middle one enters, and nearly that where it leaves
  const double entry = half / std::cos(itk::Math::pi / 6);
  fill([](const auto & point) { return -point[2]; });
  EXPECT_NEAR(output->GetPixel({ { 7, 7 } }), entry, 1e-4);
  fill([](const auto & point) { return point[2]; });
  EXPECT_LE(output->GetPixel({ { 7, 7 } }), entry + 1e-4);
  EXPECT_GT(output->GetPixel({ { 7, 7 } }), entry - 0.25);
}

TEST(PaperMethods, ClippingCountsTheSamples)
{
  const auto volume = MakePlainImage<std::uint16_t>({ { 5, 5, 7 } });
  const auto output = MakeOutput<std::uint16_t>({ { 9, 9 } });
  EXPECT_EQ(CountSamples(volume, MakeView(volume, AlongZ), 1.0, output), 5 * 5 * 7);
  EXPECT_EQ(CountSamples(volume, MakeView(volume, AlongZ), 0.5, output), 5 * 5 * 13);
  EXPECT_EQ(CountSamples(volume, MakeView(volume, AlongX), 1.0, output), 7 * 5 * 5);
}

TEST(PaperMethods, AVoxelOfWay)
{
  const auto volume = MakePlainImage<std::uint16_t>({ { 5, 5, 7 } });
  volume->SetSpacing(MakeVector3(3, 1, 4));
  EXPECT_DOUBLE_EQ(GetVoxelStep(volume, MakeView(volume, AlongX)), 3);
  EXPECT_DOUBLE_EQ(GetVoxelStep(volume, MakeView(volume, AlongZ)), 4);
  const double slope = std::atan2(3, 4) / itk::Math::pi_over_180;
  EXPECT_DOUBLE_EQ(GetVoxelStep(volume, MakeView(volume, { 0, slope, 0 })), 5 / std::sqrt(2));
}

TEST(PaperMethods, ReadVolumeKeepsTheExtent)
{
  const auto image = MakePlainImage<short>({ { 8, 6, 4 } });
  image->SetSpacing(MakeVector3(1, 2, 3));
  image->SetOrigin(MakePoint3(10, 20, 30));
  ForEachPixel(image.GetPointer(),
               [](auto & voxel, const auto & index) { voxel = static_cast<short>(index[0] - 100); });
  const std::string file = testing::TempDir() + "ShearWarpMIPPaperMethods.mha";
  itk::WriteImage(image.GetPointer(), file);
  const auto volume = ReadVolume(file, { { 4, 12, 4 } });
  std::remove(file.c_str());

  EXPECT_EQ(volume->GetSpacing(), MakeVector3(2, 1, 3));
  EXPECT_EQ(volume->GetOrigin(), MakePoint3(10.5, 19.5, 30));
  // a ramp of four columns
  EXPECT_EQ(volume->GetPixel({ { 0, 11, 2 } }), 0);
  EXPECT_EQ(volume->GetPixel({ { 1, 5, 0 } }), 5461);
  EXPECT_EQ(volume->GetPixel({ { 3, 0, 3 } }), 16383);
}

TEST(PaperMethods, TimesEachMethodAtEachAngle)
{
  Random     random(22);
  const auto volume = MakePlainImage<std::uint16_t>({ { 16, 14, 4 } });
  std::generate_n(volume->GetBufferPointer(), 16 * 14 * 4, [&random] { return random.Integer(0, 16383); });
  const auto timings = TimeMethods(volume, 2);

  std::map<std::string, std::vector<Timing>> methods;
  for (const Timing & timing : timings)
  {
    methods[timing.method].push_back(timing);
    EXPECT_EQ(timing.principalAxis, timing.angle < 45 || timing.angle > 135 ? 2U : 0U) << timing.angle;
    EXPECT_GT(timing.total, 0.0);
    EXPECT_LT(timing.interpolation, timing.total);
    EXPECT_EQ(timing.clip > 0.0, timing.method == "ray casting");
    EXPECT_EQ(timing.warp > 0.0, timing.method != "ray casting");
    EXPECT_EQ(timing.preparation > 0.0, timing.method != "ray casting");
    if (timing.method == "shear warp, tagged")
    {
      EXPECT_GT(timing.skippedFraction, 0.0);
      EXPECT_LT(timing.skippedFraction, 1.0);
    }
  }
  EXPECT_EQ(methods.size(), 5U);
  for (const auto & [name, angles] : methods)
  {
    ASSERT_EQ(angles.size(), 2 * 19U) << name;
    EXPECT_EQ(angles[18].angle, 180U);
    EXPECT_EQ(angles[19].angle, 0U);
  }

  EXPECT_THROW(WriteTimings(timings, "/no such folder/table1.csv"), itk::ExceptionObject);
}

TEST(PaperMethods, PicturesAreThoseOfTheMethods)
{
  Random     random(23);
  const auto volume = MakeRandomVolume(random, { { 12, 10, 8 } });
  WriteFigure5(volume, "test", testing::TempDir());
  const auto read = [](const std::string & name) {
    const std::string file = testing::TempDir() + "figure5-test-" + name + ".tif";
    const auto        image = itk::ReadImage<itk::Image<float, 2>>(file);
    std::remove(file.c_str());
    return image;
  };
  const auto rayCasting = read("raycasting");
  const auto shearWarp = read("shearwarp");
  const auto difference = read("difference");

  const auto view = MakeView(volume, { 50, 0, 40 });
  const auto expected = MakeFittedOutput(volume, view);
  CastRays<std::uint16_t>(volume, view, GetVoxelStep(volume, view), 0, expected);
  ASSERT_EQ(rayCasting->GetBufferedRegion(), expected->GetBufferedRegion());
  float largest = 0;
  for (itk::SizeValueType n = 0; n < expected->GetBufferedRegion().GetNumberOfPixels(); ++n)
  {
    EXPECT_EQ(rayCasting->GetBufferPointer()[n], expected->GetBufferPointer()[n]);
    EXPECT_EQ(difference->GetBufferPointer()[n], rayCasting->GetBufferPointer()[n] - shearWarp->GetBufferPointer()[n]);
    largest = std::max(largest, shearWarp->GetBufferPointer()[n]);
  }
  EXPECT_GT(largest, 5000);
}
