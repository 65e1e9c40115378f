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

#include "itkShearWarpMIPTestImages.h"

#include <cmath>

namespace
{
using namespace itk::ShearWarpBenchmark;
using namespace itk::ShearWarpMIPTest;
using VectorType = Vessel::VectorType;

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

TEST(ShearWarpMIPVessel, NearestPointIsOnTheLineAndNoOtherIsNearer)
{
  const auto       start = MakePoint3(10.0, -4.0, 2.0);
  const VectorType direction = MakeVector3(-1.0, 0.4, 0.3);
  const auto       nearest = vessel.GetNearestPoint(start, direction);
  EXPECT_NEAR(CrossProduct(nearest - start, direction).GetNorm(), 0.0, 1e-9);
  EXPECT_LT(vessel.GetDistance(nearest), vessel.GetDistance(nearest + direction * 0.01));
  EXPECT_LT(vessel.GetDistance(nearest), vessel.GetDistance(nearest - direction * 0.01));
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
