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
#include "Pictures.h"
#include "Rays.h"
#include "SphereStudy.h"
#include "Vessel.h"
#include "VesselStudy.h"

#include "itkAffineTransform.h"
#include "itkImageRegionIteratorWithIndex.h"
#include "itkMath.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace
{
using namespace itk::ShearWarpBenchmark;
using PointType = Vessel::PointType;
using VectorType = Vessel::VectorType;
using Profile = Vessel::Profile;

template <typename TVector = VectorType>
TVector
Make(double x, double y, double z)
{
  const double coordinates[] = { x, y, z };
  return TVector(coordinates);
}

constexpr double Radius = 3.0;
constexpr double StenosisLength = 12.0;

Vessel
MakeVessel(Profile profile)
{
  return { Make<PointType>(1.0, 2.0, 3.0), Make(2.0, 3.0, -1.0), Radius, StenosisLength, profile };
}

/** The largest value along a line: dense samples, and denser ones around the best of them. */
double
SearchMaximum(const Vessel & vessel, const PointType & start, const VectorType & direction)
{
  constexpr int samples = 20000;
  double        centre = 0.0;
  double        best = 0.0;
  for (double range = 60.0; range > 1e-9; range /= 0.1 * samples)
  {
    const double begin = centre - 0.5 * range;
    for (int sample = 0; sample <= samples; ++sample)
    {
      const double t = begin + range * sample / samples;
      const double value = vessel.GetValue(start + direction * t);
      if (value > best)
      {
        best = value;
        centre = t;
      }
    }
  }
  return best;
}

/** A volume of 24 x 20 x 16 voxels with a value of each voxel's index. */
template <typename TFunction>
VolumeType::Pointer
MakeVolume(const TFunction & function)
{
  const auto volume = VolumeType::New();
  volume->SetRegions(itk::Size<3>{ { 24, 20, 16 } });
  volume->Allocate();
  for (itk::ImageRegionIteratorWithIndex<VolumeType> voxel(volume, volume->GetBufferedRegion()); !voxel.IsAtEnd();
       ++voxel)
  {
    const itk::ContinuousIndex<double, 3> index(voxel.GetIndex());
    voxel.Set(static_cast<float>(function(index[0], index[1], index[2])));
  }
  return volume;
}

/** From view space, its origin the centre of MakeVolume()'s volumes, to physical space. */
itk::AffineTransform<double, 3>::Pointer
MakeView(double aroundX, double aroundY)
{
  const auto view = itk::AffineTransform<double, 3>::New();
  view->Rotate3D(Make(1, 0, 0), aroundX * itk::Math::pi_over_180);
  view->Rotate3D(Make(0, 1, 0), aroundY * itk::Math::pi_over_180);
  view->SetOffset(Make(11.5, 9.5, 7.5));
  return view;
}
} // namespace

TEST(ShearWarpMIPVessel, IsHalfAsWideInTheMiddle)
{
  const Vessel vessel = MakeVessel(Profile::Uniform);
  EXPECT_DOUBLE_EQ(vessel.GetRadius(0.0), 0.5 * Radius);
  EXPECT_DOUBLE_EQ(vessel.GetRadius(0.25 * StenosisLength), 0.75 * Radius);
  EXPECT_DOUBLE_EQ(vessel.GetRadius(-0.25 * StenosisLength), 0.75 * Radius);
  EXPECT_NEAR(vessel.GetRadius(0.5 * StenosisLength - 1e-6), Radius, 1e-9);
  EXPECT_EQ(vessel.GetRadius(0.5 * StenosisLength), Radius);
  EXPECT_EQ(vessel.GetRadius(-100.0), Radius);
}

TEST(ShearWarpMIPVessel, HasItsProfileAcrossTheAxis)
{
  const VectorType axis = Make(2.0, 3.0, -1.0) / std::sqrt(14.0);
  VectorType       across = Make(1.0, 0.0, 2.0); // at a right angle to the axis
  across.Normalize();
  for (const double position : { 0.0, 2.0, -5.0, 20.0 })
  {
    for (const double fraction : { 0.0, 0.5, 0.99, 1.01 })
    {
      const double    distance = fraction * MakeVessel(Profile::Uniform).GetRadius(position);
      const PointType point = Make<PointType>(1.0, 2.0, 3.0) + axis * position + across * distance;
      EXPECT_NEAR(MakeVessel(Profile::Uniform).GetPosition(point), position, 1e-12);
      EXPECT_NEAR(MakeVessel(Profile::Uniform).GetDistance(point), distance, 1e-7);
      EXPECT_EQ(MakeVessel(Profile::Uniform).GetValue(point), fraction < 1.0 ? 1.0 : 0.0);
      EXPECT_NEAR(
        MakeVessel(Profile::Parabolic).GetValue(point), fraction < 1.0 ? 1.0 - fraction * fraction : 0.0, 1e-9);
    }
  }
}

TEST(ShearWarpMIPVessel, MaximumOfARayAcrossIsAtTheNearestPoint)
{
  const Vessel vessel(Make<PointType>(0, 0, 0), Make(0, 1, 0), Radius, StenosisLength, Profile::Parabolic);
  for (const double angle : { 0.0, 0.3, 1.2, 2.5 })
  {
    const VectorType direction = Make(std::sin(angle), 0.0, std::cos(angle));
    const VectorType across = Make(std::cos(angle), 0.0, -std::sin(angle));
    for (const double y : { 0.0, 1.5, -4.0, 30.0 })
    {
      for (const double distance : { 0.0, 0.7, 1.4, 2.9 })
      {
        const double radii = distance / vessel.GetRadius(y);
        const auto   start = Make<PointType>(0, y, 0) + across * distance + direction * 17.0;
        EXPECT_NEAR(vessel.GetMaximum(start, direction), std::max(0.0, 1.0 - radii * radii), 1e-9);
      }
    }
  }
}

TEST(ShearWarpMIPVessel, MaximumOfARayAlongIsOutsideOfTheStenosis)
{
  const Vessel vessel(Make<PointType>(0, 0, 0), Make(0, 0, 1), Radius, StenosisLength, Profile::Parabolic);
  EXPECT_NEAR(vessel.GetMaximum(Make<PointType>(2, 0, 0), Make(0, 0, -1)), 1.0 - 4.0 / 9.0, 1e-9);
  EXPECT_EQ(vessel.GetMaximum(Make<PointType>(3.1, 0, 0), Make(0, 0, 1)), 0.0);
}

TEST(ShearWarpMIPVessel, MaximumIsThatOfADenseSearch)
{
  std::mt19937                           random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int n = 0; n < 150; ++n)
  {
    const auto direction = Make(uniform(random), uniform(random), uniform(random));
    const auto nearby = Make<PointType>(1.0, 2.0, 3.0) + Make(2.0, 3.0, -1.0) * (2.0 * uniform(random)) +
                        Make(uniform(random), uniform(random), uniform(random)) * (1.5 * Radius);
    const VectorType unit = direction / direction.GetNorm();
    for (const auto profile : { Profile::Uniform, Profile::Parabolic })
    {
      const Vessel vessel = MakeVessel(profile);
      const auto   start = vessel.GetNearestPoint(nearby, unit);
      EXPECT_NEAR(vessel.GetMaximum(nearby, direction), SearchMaximum(vessel, start, unit), 1e-9) << n;
    }
  }
}

TEST(ShearWarpMIPVessel, NearestPointIsOnTheLineAndNoOtherIsNearer)
{
  const Vessel     vessel = MakeVessel(Profile::Uniform);
  const auto       start = Make<PointType>(10.0, -4.0, 2.0);
  const VectorType direction = Make(-1.0, 0.4, 0.3);
  const auto       nearest = vessel.GetNearestPoint(start, direction);
  EXPECT_NEAR(CrossProduct(nearest - start, direction).GetNorm(), 0.0, 1e-9);
  EXPECT_LT(vessel.GetDistance(nearest), vessel.GetDistance(nearest + direction * 0.01));
  EXPECT_LT(vessel.GetDistance(nearest), vessel.GetDistance(nearest - direction * 0.01));
}

TEST(ShearWarpMIPVessel, PointSamplesAreValuesAtVoxelCentres)
{
  const Vessel vessel(Make<PointType>(6.2, 5.7, 4.1), Make(1, 2, 0.5), 2.5, 6.0, Profile::Parabolic);
  const auto   volume = Digitize(vessel, itk::Size<3>{ { 12, 11, 10 } }, Digitization::PointSampled);
  for (itk::ImageRegionIteratorWithIndex<VolumeType> voxel(volume, volume->GetBufferedRegion()); !voxel.IsAtEnd();
       ++voxel)
  {
    PointType centre;
    volume->TransformIndexToPhysicalPoint(voxel.GetIndex(), centre);
    ASSERT_FLOAT_EQ(voxel.Get(), static_cast<float>(vessel.GetValue(centre)));
  }
}

TEST(ShearWarpMIPVessel, PartialVolumesSumToTheVesselsVolume)
{
  // the squared radius of the stenosis has the mean R^2 (9 + 1/2) / 16
  constexpr double length = 24.0;
  constexpr double crossSection = itk::Math::pi * 2.5 * 2.5;
  constexpr double narrow = (9.0 + 0.5) / 16.0;
  constexpr double volume = crossSection * (length - StenosisLength + narrow * StenosisLength);
  for (const auto profile : { Profile::Uniform, Profile::Parabolic })
  {
    const Vessel vessel(Make<PointType>(9.3, 11.5, 10.1), Make(0, 1, 0), 2.5, StenosisLength, profile);
    const auto   image = Digitize(vessel, itk::Size<3>{ { 20, 24, 20 } }, Digitization::PartialVolume);
    double       sum = 0.0;
    double       moment = 0.0;
    for (itk::ImageRegionIteratorWithIndex<VolumeType> voxel(image, image->GetBufferedRegion()); !voxel.IsAtEnd();
         ++voxel)
    {
      EXPECT_LE(voxel.Get(), 1.0f);
      sum += voxel.Get();
      moment += voxel.Get() * static_cast<double>(voxel.GetIndex()[0]);
    }
    EXPECT_NEAR(sum / volume, profile == Profile::Uniform ? 1.0 : 0.5, 2e-3);
    EXPECT_NEAR(moment / sum, 9.3, 0.02);
  }
}

TEST(ShearWarpMIPVessel, ErrorsOfKnownPictures)
{
  const auto reference = MakePicture(20, 1.0);
  const auto picture = MakePicture(20, 1.0);
  reference->FillBuffer(5.0f);
  picture->FillBuffer(5.0f);
  std::vector<itk::SizeValueType> pixels(200);
  std::iota(pixels.begin(), pixels.end(), 100);

  Errors errors = Compare(picture, reference, pixels);
  EXPECT_EQ(errors.meanAbsolute, 0.0);
  EXPECT_EQ(errors.mean, 0.0);
  EXPECT_EQ(errors.rootMeanSquare, 0.0);
  EXPECT_EQ(errors.percentile99, 0.0);
  EXPECT_EQ(errors.largest, 0.0);
  EXPECT_EQ(errors.underestimated, 0.0);

  picture->GetBufferPointer()[99] = 1000.0f; // not among the pixels
  picture->GetBufferPointer()[100] = 9.0f;
  picture->GetBufferPointer()[101] = 2.0f;
  picture->GetBufferPointer()[102] = 3.0f;
  picture->GetBufferPointer()[103] = 4.5f;
  errors = Compare(picture, reference, pixels, 1.0);
  EXPECT_DOUBLE_EQ(errors.meanAbsolute, 9.5 / 200);
  EXPECT_DOUBLE_EQ(errors.mean, -1.5 / 200);
  EXPECT_DOUBLE_EQ(errors.rootMeanSquare, std::sqrt(29.25 / 200));
  EXPECT_EQ(errors.percentile99, 2.0);
  EXPECT_EQ(errors.largest, 4.0);
  EXPECT_DOUBLE_EQ(errors.underestimated, 2.0 / 200);
}

TEST(ShearWarpMIPVessel, ErrorsOfNoPixelsAreZero)
{
  EXPECT_EQ(Compare(MakePicture(2, 1.0), MakePicture(2, 1.0), {}).meanAbsolute, 0.0);
}

TEST(ShearWarpMIPVessel, AxisOfTheVesselIsBrightInAllPictures)
{
  const VesselPictures pictures =
    ProjectVessel({ Turn::Grid, 30.0, Profile::Parabolic, Digitization::PointSampled, 6.0, 1 }, 30.0);
  const auto getLargest = [&](const PictureType * picture) {
    float largest = 0.0f;
    for (const auto pixel : pictures.object)
    {
      largest = std::max(largest, picture->GetBufferPointer()[pixel]);
    }
    return largest;
  };
  EXPECT_GT(pictures.object.size(), 300U);
  for (const PictureType * picture : { pictures.truth.GetPointer(),
                                       pictures.rayCasting.GetPointer(),
                                       pictures.fineRayCasting.GetPointer(),
                                       pictures.shearWarp.GetPointer(),
                                       pictures.oversampled.GetPointer(),
                                       pictures.exactRays.GetPointer() })
  {
    EXPECT_GT(getLargest(picture), 0.97f);
    EXPECT_LE(getLargest(picture), 1.0f);
    EXPECT_LT(Compare(picture, pictures.truth, pictures.object).meanAbsolute, 0.03);
  }
}

TEST(ShearWarpMIPVessel, TruthStaysWhenTheViewTurnsAboutTheVessel)
{
  VesselSetting setting{ Turn::Vessel, 30.0, Profile::Parabolic, Digitization::PointSampled, 4.0, 0 };
  const auto    first = ProjectVessel(setting, 0.0);
  const auto    turned = ProjectVessel(setting, 70.0);
  EXPECT_LT(Compare(first.truth, turned.truth, first.object).largest, 1e-6);
  EXPECT_LT(Compare(first.truth, turned.truth, turned.object).largest, 1e-6);
  EXPECT_GT(Compare(first.shearWarp, turned.shearWarp, first.object).largest, 1e-2);

  setting.turn = Turn::Grid;
  EXPECT_GT(Compare(ProjectVessel(setting, 0.0).truth, first.truth, first.object).largest, 0.1);
}

TEST(ShearWarpMIPVessel, DifferencesOfGivenPixels)
{
  const auto picture = MakePicture(2, 1.0);
  const auto reference = MakePicture(2, 1.0);
  picture->FillBuffer(3.0f);
  reference->FillBuffer(5.0f);
  const auto difference = Subtract(picture, reference, { 1, 3 });
  EXPECT_EQ(std::vector<float>(difference->GetBufferPointer(), difference->GetBufferPointer() + 4),
            std::vector<float>({ 0.0f, -2.0f, 0.0f, -2.0f }));
}

TEST(ShearWarpMIPExactRays, LinearVolumeGivesTheEndOfTheRay)
{
  // along the principal axis z the volume rises towards larger z; x shifts by the shear
  const auto volume = MakeVolume([](double x, double, double z) { return 100.0 + 2.0 * x + 3.0 * z; });
  const auto view = MakeView(0.0, 20.0);
  const auto grid = MakePicture(9, 1.0);
  const auto picture = ProjectExactRays(volume, view, 1, grid);
  const Rays rays(volume, view);
  for (itk::SizeValueType pixel = 0; pixel < 81; ++pixel)
  {
    itk::Point<double, 2> position;
    grid->TransformIndexToPhysicalPoint(grid->ComputeIndex(static_cast<itk::OffsetValueType>(pixel)), position);
    const auto   start = rays.GetStart(position);
    const double way = (15.0 - start[2]) / rays.GetDirection()[2];
    const double x = start[0] + way * rays.GetDirection()[0];
    EXPECT_NEAR(picture->GetBufferPointer()[pixel], 100.0 + 2.0 * x + 3.0 * 15.0, 1e-3);
  }
}

TEST(ShearWarpMIPExactRays, MoreSamplesNeverGiveLess)
{
  std::mt19937 random(2);
  const auto   volume = MakeVolume([&](auto...) { return random() % 1000; });
  const auto   view = MakeView(25.0, 63.0);
  const auto   grid = MakePicture(40, 1.0);
  const auto   pixels = FindCrossingRays(volume, view, grid);
  double       error = 1e30;
  const auto   reference = ProjectExactRays(volume, view, 16, grid);
  for (const unsigned int samples : { 1, 2, 4, 8 })
  {
    const Errors errors = Compare(ProjectExactRays(volume, view, samples, grid), reference, pixels);
    EXPECT_DOUBLE_EQ(errors.mean, -errors.meanAbsolute);
    EXPECT_LT(errors.meanAbsolute, error);
    error = errors.meanAbsolute;
  }
  EXPECT_LT(error, 5.0);
}

TEST(ShearWarpMIPExactRays, NoSampleIsAboveTheExactMaximum)
{
  std::mt19937 random(4);
  const auto   volume = MakeVolume([&](auto...) { return random() % 1000; });
  const auto   grid = MakePicture(40, 0.7);
  for (const double angle : { 0.0, 20.0, 63.0 })
  {
    const auto view = MakeView(25.0, angle);
    const auto pixels = FindCrossingRays(volume, view, grid);
    const auto exact = ProjectExactly(volume, view, grid);
    double     before = 1e30;
    for (const unsigned int samples : { 2, 16, 128 })
    {
      const auto   dense = ProjectExactRays(volume, view, samples, grid);
      const Errors errors = Compare(dense, exact, pixels);
      for (const auto pixel : pixels)
      {
        // samples are computed in single precision
        ASSERT_LE(dense->GetBufferPointer()[pixel], exact->GetBufferPointer()[pixel] + 0.01);
      }
      EXPECT_LT(errors.meanAbsolute, std::max(before, 0.01));
      before = errors.meanAbsolute;
    }
    EXPECT_LT(before, 0.3);
  }
}

TEST(ShearWarpMIPExactRays, FilterDiffersByItsSecondInterpolationOnly)
{
  // along an axis rays run through the voxels, and there is nothing to interpolate
  std::mt19937 random(3);
  const auto   volume = MakeVolume([&](auto...) { return random() % 1000; });
  for (const double angle : { 0.0, 90.0 })
  {
    const auto view = MakeView(0.0, angle);
    const auto grid = MakePicture(26, 1.0);
    const auto exact = ProjectExactRays(volume, view, 1, grid);
    const auto pixels = FindCrossingRays(volume, view, grid);
    EXPECT_EQ(pixels.size(), angle == 0.0 ? 24U * 20U : 16U * 20U);
    EXPECT_LT(Compare(ProjectByShearWarp(volume, view, 1, grid), exact, pixels).largest, 0.1);
  }
}
