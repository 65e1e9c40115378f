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
#include "VesselStudy.h"

#include "itkImageRegionIteratorWithIndex.h"
#include "itkMath.h"

#include <gtest/gtest.h>

#include <cmath>
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
  for (itk::ImageRegionIteratorWithIndex<itk::Image<float, 3>> voxel(volume, volume->GetBufferedRegion());
       !voxel.IsAtEnd();
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
    for (itk::ImageRegionIteratorWithIndex<itk::Image<float, 3>> voxel(image, image->GetBufferedRegion());
         !voxel.IsAtEnd();
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

TEST(ShearWarpMIPVessel, AxisOfTheVesselIsBrightInAllPictures)
{
  auto pictures = ProjectVessel({ Turn::Grid, 30.0, Profile::Parabolic, Digitization::PointSampled, 6.0, 1 }, 30.0);
  EXPECT_GT(pictures.object.size(), 300U);
  ASSERT_EQ(pictures.methods.size(), 4U);
  pictures.methods["truth"] = pictures.truth;
  for (const auto & [name, picture] : pictures.methods)
  {
    float largest = 0.0f;
    for (const auto pixel : pictures.object)
    {
      largest = std::max(largest, picture->GetBufferPointer()[pixel]);
    }
    EXPECT_GT(largest, 0.97f) << name;
    EXPECT_LE(largest, 1.0f) << name;
    EXPECT_LT(pictures.GetError(picture), 0.03) << name;
    EXPECT_EQ(pictures.GetError(picture) == 0.0, name == "truth");
  }
}

TEST(ShearWarpMIPVessel, TruthStaysWhenTheViewTurnsAboutTheVessel)
{
  VesselSetting setting{ Turn::Vessel, 30.0, Profile::Parabolic, Digitization::PointSampled, 4.0, 0 };
  const auto    first = ProjectVessel(setting, 0.0);
  const auto    turned = ProjectVessel(setting, 70.0);
  EXPECT_LT(first.GetError(turned.truth), 1e-6);
  EXPECT_LT(turned.GetError(first.truth), 1e-6);
  EXPECT_GT(std::abs(first.GetError(turned.methods.at("shear-warp")) - first.GetError(first.methods.at("shear-warp"))),
            1e-4);

  setting.turn = Turn::Grid;
  EXPECT_GT(first.GetError(ProjectVessel(setting, 0.0).truth), 0.01);
}

TEST(ShearWarpMIPVessel, ErrorIsThatOfTheObject)
{
  VesselPictures pictures;
  for (auto * picture : { &pictures.truth, &pictures.methods["other"] })
  {
    *picture = VesselPictures::PictureType::New();
    (*picture)->SetRegions(itk::Size<2>{ { 2, 2 } });
    (*picture)->Allocate();
    (*picture)->FillBuffer(5.0f);
  }
  pictures.object = { 1, 3 };
  const auto & other = pictures.methods["other"];
  other->SetPixel({ { 0, 0 } }, 1000.0f); // not among the object's
  other->SetPixel({ { 1, 0 } }, 2.0f);
  other->SetPixel({ { 1, 1 } }, 6.0f);
  EXPECT_EQ(pictures.GetError(other), 2.0);
}
