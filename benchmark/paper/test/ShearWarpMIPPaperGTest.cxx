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
#include "RayCasting.h"
#include "Studies.h"

#include "itkImageFileReader.h"
#include "itkImageFileWriter.h"
#include "itkShearWarpMIPTestImages.h"

#include <cstdio>
#include <map>

namespace
{
using namespace itk::ShearWarpBenchmark;
using namespace itk::ShearWarpMIPTest;

using VectorType = itk::Vector<double, 3>;
using VolumeType = itk::Image<std::uint16_t, 3>;

/** Most cells can be skipped where a tenth of the voxels is bright. */
VolumeType::Pointer
MakeRandomVolume(Random & random, const itk::Size<3> & size)
{
  const auto volume = VolumeType::New();
  SetRandomGeometry(random, volume, size);
  volume->Allocate();
  FillByIndex(volume, [&random](const auto &) {
    return random.Integer(0, 9) == 0 ? random.Integer(0, 16383) : random.Integer(0, 500);
  });
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

/** Of a volume of \a size whose voxels are \a valueAt(index). */
template <typename TFunction>
itk::SizeValueType
CountSkipped(const Angles & angles, const itk::Size<3> & size, const TFunction & valueAt)
{
  const auto volume = MakePlainImage<std::uint16_t>(size);
  FillByIndex(volume, valueAt);
  return ProjectTagged(volume, angles).skippedCells;
}

const Angles AlongX{ 0, 90, 0 };
const Angles AlongY{ 90, 0, 0 };
const Angles AlongZ{ 0, 0, 0 };
const Angles AgainstZ{ 0, 180, 0 };

constexpr double Radius = 3.0;
constexpr double StenosisLength = 12.0;

const Vessel vessel{ MakePoint3(1.0, 2.0, 3.0), MakeVector3(2.0, 3.0, -1.0), Radius, StenosisLength };

/** The largest value along a line: dense samples, and denser ones around the best of them. */
double
SearchMaximum(const PointType & start, const VectorType & direction)
{
  constexpr int samples = 20000;
  double        center = 0.0;
  double        best = 0.0;
  for (double range = 60.0; range > 1e-9; range /= 0.1 * samples)
  {
    const double begin = center - 0.5 * range;
    for (int sample = 0; sample <= samples; ++sample)
    {
      const double t = begin + range * sample / samples;
      const double value = vessel.GetValue(start + direction * t);
      if (value > best)
      {
        best = value;
        center = t;
      }
    }
  }
  return best;
}
} // namespace

TEST(PaperMethods, ShearWarpsAreEqualInEveryBit)
{
  Random random(20);
  bool   isSkipped[3] = {};
  for (int round = 0; round < 60; ++round)
  {
    SCOPED_TRACE(round);
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
    const auto                        cells = volume->GetBufferedRegion().GetNumberOfPixels();
    isSkipped[factorization.GetPrincipalAxis()] |= tagged.skippedCells > cells / 4;

    const auto intermediate =
      Project(PermutedVolume<std::uint16_t>(volume, factorization.GetPrincipalAxis()), factorization);
    const auto reached = factorization.GetReachedColumns();
    for (std::size_t row = 0; row < reached.size(); ++row)
    {
      for (std::int32_t column = reached[row].begin; column < reached[row].end; ++column)
      {
        const std::size_t n = row * factorization.GetIntermediateSize()[0] + column;
        ASSERT_EQ(tagged.intermediate[n], intermediate[n]) << "column " << column << ", row " << row;
      }
    }

    const auto filter = MakeFilter(volume, view);
    filter->SetDefaultPixelValue(5);
    filter->Update();
    ASSERT_EQ(filter->GetOutput()->GetBufferedRegion(), grid->GetBufferedRegion());
    EXPECT_EQ(Warp<std::uint16_t>(factorization, tagged.intermediate, grid->GetBufferedRegion().GetSize(), 5),
              GetPixels(filter->GetOutput()));
  }
  EXPECT_TRUE(isSkipped[0] && isSkipped[1] && isSkipped[2]);
}

TEST(PaperMethods, SkipsWhatCannotChangeThePixel)
{
  const itk::Size<3> size{ { 5, 4, 7 } };
  // all slices but the first
  const auto constant = [](const auto &) { return 1000; };
  EXPECT_EQ(CountSkipped(AlongX, size, constant), 4 * 4 * 7);
  EXPECT_EQ(CountSkipped(AlongY, size, constant), 5 * 3 * 7);
  EXPECT_EQ(CountSkipped(AlongZ, size, constant), 5 * 4 * 6);
  // slices come in storage order
  for (const Angles & angles : { AlongZ, AgainstZ })
  {
    EXPECT_EQ(CountSkipped(angles, size, [](const auto & index) { return 10 + index[2]; }), 0);
    EXPECT_EQ(CountSkipped(angles, size, [](const auto & index) { return 10 - index[2]; }), 5 * 4 * 6);
  }
  // a voxel keeps its four cells
  const auto spot = [](const auto & index) { return index[2] == 0 ? 10 : index[0] == 2 && index[1] == 1 ? 20 : 0; };
  EXPECT_EQ(CountSkipped(AlongZ, { { 5, 4, 2 } }, spot), 5 * 4 - 4);
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
  const auto output = MakeOutput<std::uint16_t>({ { 7, 6 } });
  const auto expected = MakeOutput<std::uint16_t>({ { 7, 6 } });
  CastRays<std::uint16_t>(volume, MakeView(volume, AlongZ), 1.0, 3, output);

  // one pixel of background around the volume
  expected->FillBuffer(3);
  for (const auto & index : itk::ImageRegionIndexRange<3>(volume->GetBufferedRegion()))
  {
    auto & pixel = expected->GetPixel({ { index[0] + 1, index[1] + 1 } });
    pixel = index[2] == 0 ? volume->GetPixel(index) : std::max(pixel, volume->GetPixel(index));
  }
  EXPECT_EQ(GetPixels(output), GetPixels(expected));
}

TEST(PaperMethods, RayCastingOfALinearRamp)
{
  constexpr double half = 4;
  const auto       volume = MakePlainImage<float>({ { 9, 9, 9 } });
  const auto       view = MakeView(volume, { 0, 30, 0 });
  const auto       output = MakeOutput<float>({ { 15, 15 } });

  // view space is where the inverse of the view takes a voxel; returns the middle pixel
  const auto toView = view->GetInverseTransform();
  const auto castRays = [&](const VectorType & gradient) {
    FillByIndex(volume, [&](const auto & index) {
      const auto point = volume->TransformIndexToPhysicalPoint<double>(index);
      return gradient * toView->TransformPoint(point).GetVectorFromOrigin();
    });
    CastRays<float>(volume, view, 0.25, -100.0F, output);
    return output->GetPixel({ { 7, 7 } });
  };

  // across the rays: the same all along each
  castRays(MakeVector3(1, 10, 0));
  const double reach = half * (std::cos(itk::Math::pi / 6) + std::sin(itk::Math::pi / 6));
  for (const auto & index : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
  {
    const auto u = static_cast<double>(index[0] - 7);
    const auto v = static_cast<double>(index[1] - 7);
    const bool isHit = std::abs(u) <= reach && std::abs(v) <= half;
    EXPECT_NEAR(output->GetPixel(index), isHit ? u + 10 * v : -100, 1e-4) << index;
  }

  // along the rays: the value where the middle one enters, and nearly that where it leaves
  const double entry = half / std::cos(itk::Math::pi / 6);
  EXPECT_NEAR(castRays(MakeVector3(0, 0, -1)), entry, 1e-4);
  const double last = castRays(MakeVector3(0, 0, 1));
  EXPECT_LE(last, entry + 1e-4);
  EXPECT_GT(last, entry - 0.25);
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
  FillByIndex(image, [](const auto & index) { return index[0] - 100; });
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
  FillByIndex(volume, [&random](const auto &) { return random.Integer(0, 16383); });
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
  for (const auto & index : itk::ImageRegionIndexRange<2>(expected->GetBufferedRegion()))
  {
    EXPECT_EQ(rayCasting->GetPixel(index), expected->GetPixel(index));
    EXPECT_EQ(difference->GetPixel(index), rayCasting->GetPixel(index) - shearWarp->GetPixel(index));
    largest = std::max(largest, shearWarp->GetPixel(index));
  }
  EXPECT_GT(largest, 5000);
}

TEST(ShearWarpMIPVessel, IsHalfAsWideInTheMiddle)
{
  EXPECT_DOUBLE_EQ(vessel.GetRadius(0.0), 0.5 * Radius);
  EXPECT_DOUBLE_EQ(vessel.GetRadius(0.25 * StenosisLength), 0.75 * Radius);
  EXPECT_DOUBLE_EQ(vessel.GetRadius(-0.25 * StenosisLength), 0.75 * Radius);
  EXPECT_NEAR(vessel.GetRadius(0.5 * StenosisLength - 1e-6), Radius, 1e-9);
  EXPECT_EQ(vessel.GetRadius(0.5 * StenosisLength), Radius);
  EXPECT_EQ(vessel.GetRadius(-100.0), Radius);
}

TEST(ShearWarpMIPVessel, HasItsProfileAcrossTheAxis)
{
  const VectorType axis = MakeVector3(2.0, 3.0, -1.0) / std::sqrt(14.0);
  VectorType       across = MakeVector3(1.0, 0.0, 2.0); // at a right angle to the axis
  across.Normalize();
  for (const double position : { 0.0, 2.0, -5.0, 20.0 })
  {
    for (const double fraction : { 0.0, 0.5, 0.99, 1.01 })
    {
      const double    distance = fraction * vessel.GetRadius(position);
      const PointType point = MakePoint3(1.0, 2.0, 3.0) + axis * position + across * distance;
      EXPECT_NEAR(vessel.GetPosition(point), position, 1e-12);
      EXPECT_NEAR(vessel.GetDistance(point), distance, 1e-7);
      EXPECT_NEAR(vessel.GetValue(point), fraction < 1.0 ? 1.0 - fraction * fraction : 0.0, 1e-9);
    }
  }
}

TEST(ShearWarpMIPVessel, MaximumOfARayAcrossIsAtTheNearestPoint)
{
  const Vessel upright(MakePoint3(0, 0, 0), MakeVector3(0, 1, 0), Radius, StenosisLength);
  for (const double angle : { 0.0, 0.3, 1.2, 2.5 })
  {
    const VectorType direction = MakeVector3(std::sin(angle), 0.0, std::cos(angle));
    const VectorType across = MakeVector3(std::cos(angle), 0.0, -std::sin(angle));
    for (const double y : { 0.0, 1.5, -4.0, 30.0 })
    {
      for (const double distance : { 0.0, 0.7, 1.4, 2.9 })
      {
        const double radii = distance / upright.GetRadius(y);
        const auto   start = MakePoint3(0, y, 0) + across * distance + direction * 17.0;
        EXPECT_NEAR(upright.GetMaximum(start, direction), std::max(0.0, 1.0 - radii * radii), 1e-9);
      }
    }
  }
}

TEST(ShearWarpMIPVessel, MaximumOfARayAlongIsOutsideOfTheStenosis)
{
  const Vessel along(MakePoint3(0, 0, 0), MakeVector3(0, 0, 1), Radius, StenosisLength);
  EXPECT_NEAR(along.GetMaximum(MakePoint3(2, 0, 0), MakeVector3(0, 0, -1)), 1.0 - 4.0 / 9.0, 1e-9);
  EXPECT_EQ(along.GetMaximum(MakePoint3(3.1, 0, 0), MakeVector3(0, 0, 1)), 0.0);
}

TEST(ShearWarpMIPVessel, MaximumIsThatOfADenseSearch)
{
  Random     random(1);
  const auto uniform = [&random] { return random.Uniform(-1.0, 1.0); };
  for (int n = 0; n < 150; ++n)
  {
    const auto direction = MakeVector3(uniform(), uniform(), uniform());
    const auto nearby = MakePoint3(1.0, 2.0, 3.0) + MakeVector3(2.0, 3.0, -1.0) * (2.0 * uniform()) +
                        MakeVector3(uniform(), uniform(), uniform()) * (1.5 * Radius);
    const VectorType unit = direction / direction.GetNorm();
    const auto       start = vessel.GetNearestPoint(nearby, unit);
    EXPECT_NEAR(vessel.GetMaximum(nearby, direction), SearchMaximum(start, unit), 1e-9) << n;
  }
}

TEST(ShearWarpMIPVessel, AxisOfTheVesselIsBrightInAllPictures)
{
  auto pictures = ProjectVessel({ 30.0, 6.0, 1 }, 30.0);
  EXPECT_GT(pictures.object.size(), 300U);
  ASSERT_EQ(pictures.methods.size(), 4U);
  pictures.methods["truth"] = pictures.truth;
  for (const auto & [name, picture] : pictures.methods)
  {
    float largest = 0.0f;
    for (const auto & pixel : pictures.object)
    {
      largest = std::max(largest, picture->GetPixel(pixel));
    }
    EXPECT_GT(largest, 0.97f) << name;
    EXPECT_LE(largest, 1.0f) << name;
    EXPECT_LT(pictures.GetError(picture), 0.03) << name;
    EXPECT_EQ(pictures.GetError(picture) == 0.0, name == "truth");
  }
}

TEST(ShearWarpMIPVessel, ErrorIsThatOfTheObject)
{
  VesselPictures pictures;
  pictures.truth = MakeOutput<float>({ { 2, 2 } });
  pictures.truth->FillBuffer(5.0f);
  pictures.object = { { { 1, 0 } }, { { 1, 1 } } };
  const auto other = Copy(pictures.truth.GetPointer());
  other->SetPixel({ { 0, 0 } }, 1000.0f); // not among the object's
  other->SetPixel({ { 1, 0 } }, 2.0f);
  other->SetPixel({ { 1, 1 } }, 6.0f);
  EXPECT_EQ(pictures.GetError(other), 2.0);
}
