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
#include "itkShearWarpMIPView.h"

#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPTestImages.h"

#include <sstream>

namespace
{
using namespace itk::ShearWarpMIPTest;
using itk::ShearWarpMIPView;
using Direction = itk::ShearWarpMIPViewEnums::Direction;
using VectorType = itk::Vector<double, 3>;
using ImageType = itk::Image<unsigned short, 3>;

constexpr Direction AllDirections[] = { Direction::Anterior, Direction::Posterior, Direction::Left,
                                        Direction::Right,    Direction::Superior,  Direction::Inferior };

const VectorType Left = MakeVector3(1, 0, 0);
const VectorType Right = MakeVector3(-1, 0, 0);
const VectorType Posterior = MakeVector3(0, 1, 0);
const VectorType Anterior = MakeVector3(0, -1, 0);
const VectorType Superior = MakeVector3(0, 0, 1);
const VectorType Inferior = MakeVector3(0, 0, -1);

ImageType::Pointer
MakeHead()
{
  Random random(301);
  auto   image = ImageType::New();
  SetRandomGeometry(random, image, { { 15, 16, 12 } });
  image->SetSpacing(MakeVector3(1.2, 0.9, 1.5));
  image->Allocate(true);
  return image;
}

VectorType
GetViewAxis(const itk::Transform<double, 3, 3> * view, double u, double v, double w)
{
  return view->TransformPoint(MakePoint3(u, v, w)) - view->TransformPoint(MakePoint3(0, 0, 0));
}

/** The axes are of length 1 and at right angles, and right-handed. */
void
ExpectRightHanded(const itk::Transform<double, 3, 3> * view)
{
  const auto u = GetViewAxis(view, 1, 0, 0);
  const auto v = GetViewAxis(view, 0, 1, 0);
  EXPECT_NEAR(u.GetNorm(), 1.0, 1e-12);
  EXPECT_NEAR(v.GetNorm(), 1.0, 1e-12);
  EXPECT_NEAR((itk::CrossProduct(u, v) - GetViewAxis(view, 0, 0, 1)).GetNorm(), 0.0, 1e-12);
}

void
ExpectAxes(const ShearWarpMIPView::TransformType * view,
           const VectorType &                      u,
           const VectorType &                      v,
           const VectorType &                      w,
           double                                  tolerance = 0.0)
{
  const auto &     matrix = view->GetMatrix();
  const VectorType expected[] = { u, v, w };
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int column = 0; column < 3; ++column)
    {
      EXPECT_NEAR(matrix(row, column), expected[column][row], tolerance) << "of axis "
                                                                         << "uvw"[column] << " in matrix\n"
                                                                         << matrix;
    }
  }
}
} // namespace

TEST(ShearWarpMIPView, SixDirectionsHaveTheDocumentedAxes)
{
  const auto image = MakeHead();
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Anterior), Left, Inferior, Posterior);
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Posterior), Right, Inferior, Anterior);
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Left), Posterior, Inferior, Right);
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Right), Anterior, Inferior, Left);
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Superior), Right, Posterior, Inferior);
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Inferior), Left, Posterior, Superior);
}

TEST(ShearWarpMIPView, EveryViewIsRigidAndRightHanded)
{
  const auto image = MakeHead();
  Random     random(302);
  for (int repeat = 0; repeat < 300; ++repeat)
  {
    const auto view = ShearWarpMIPView::MakeTransform(
      image, AllDirections[repeat % 6], random.Uniform(-720, 720), random.Uniform(-720, 720));
    ExpectRightHanded(view);
  }
}

TEST(ShearWarpMIPView, AzimuthMovesTheViewerToTheRightAndElevationToTheTopOfThePicture)
{
  const auto image = MakeHead();
  const auto expectMoved = [](const auto & start, const auto & turned, double right, double top) {
    const auto towardsViewer = GetViewAxis(turned, 0, 0, -1);
    EXPECT_NEAR(towardsViewer * GetViewAxis(start, right, -top, 0), 0.5, 1e-12);
    EXPECT_NEAR(towardsViewer * GetViewAxis(start, 0, 0, -1), std::sqrt(0.75), 1e-12);
    // the picture's other axis stays
    EXPECT_NEAR((GetViewAxis(turned, top, right, 0) - GetViewAxis(start, top, right, 0)).GetNorm(), 0.0, 1e-12);
  };
  for (const Direction direction : AllDirections)
  {
    SCOPED_TRACE(direction);
    const auto make = [&](double azimuth, double elevation) {
      return ShearWarpMIPView::MakeTransform(image, direction, azimuth, elevation);
    };
    expectMoved(make(0, 0), make(30, 0), 1, 0);
    expectMoved(make(20, 0), make(20, 30), 0, 1);
  }
}

TEST(ShearWarpMIPView, QuarterAndFullTurnsAreExact)
{
  const auto image = MakeHead();
  const auto matrixOf = [&](Direction direction, double azimuth, double elevation) {
    return ShearWarpMIPView::MakeTransform(image, direction, azimuth, elevation)->GetMatrix();
  };
  const Direction around[] = { Direction::Anterior, Direction::Left, Direction::Posterior, Direction::Right };
  for (int start = 0; start < 4; ++start)
  {
    for (int quarters = -9; quarters <= 9; ++quarters)
    {
      EXPECT_EQ(matrixOf(around[start], 90.0 * quarters, 0.0), matrixOf(around[(start + quarters + 12) % 4], 0.0, 0.0))
        << start << ' ' << quarters;
    }
  }
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Anterior, 0.0, 90.0), Left, Anterior, Inferior);
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Anterior, 0.0, -90.0), Left, Posterior, Superior);
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Posterior, 0.0, 90.0), Right, Posterior, Inferior);
  ExpectAxes(ShearWarpMIPView::MakeTransform(image, Direction::Superior, 180.0), Left, Posterior, Superior);
  EXPECT_EQ(matrixOf(Direction::Left, 33.0, -12.0), matrixOf(Direction::Left, 33.0 + 720.0, -12.0 - 360.0));
}

TEST(ShearWarpMIPView, ViewOriginIsTheCenterOfTheImage)
{
  auto image = itk::ImageBase<3>::New();
  image->SetRegions(itk::ImageRegion<3>({ { 10, -4, 2 } }, { { 4, 7, 1 } }));
  image->SetSpacing(MakeVector3(2, 3, 5));
  image->SetOrigin(MakePoint3(100, 200, 300));
  image->SetDirection(MakeMatrix({ { 0, -1, 0 }, { 1, 0, 0 }, { 0, 0, 1 } }));
  const PointType expected = MakePoint3(100 - 3 * -1.0, 200 + 2 * 11.5, 300 + 5 * 2);
  EXPECT_EQ(ShearWarpMIPView::GetCenter(image), expected);
  for (const Direction direction : AllDirections)
  {
    EXPECT_EQ(ShearWarpMIPView::MakeTransform(image, direction, 17, 21)->TransformPoint(MakePoint3(0, 0, 0)), expected);
  }
}

TEST(ShearWarpMIPView, ErrorsNameTheValue)
{
  const auto   image = MakeHead();
  const double notANumber = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_NAMES(ShearWarpMIPView::MakeTransform(image, Direction::Left, notANumber, 12.5), "nan and 12.5");
  EXPECT_NAMES(ShearWarpMIPView::MakeTransform(image, Direction::Left, 3.5, -infinity), "3.5 and -inf");
  EXPECT_NAMES(ShearWarpMIPView::MakeTransform(nullptr, Direction::Left, 0, 0), "image");
  EXPECT_NAMES(ShearWarpMIPView::MakeTransform(image, static_cast<Direction>(17), 0, 0), "17");
  EXPECT_THROW(ShearWarpMIPView::GetCenter(nullptr), itk::ExceptionObject);
  // the output of a filter before its UpdateOutputInformation()
  const auto empty = itk::Image<short, 3>::New();
  EXPECT_NAMES(ShearWarpMIPView::MakeTransform(empty, Direction::Left, 0, 0), "UpdateOutputInformation");
  EXPECT_THROW(ShearWarpMIPView::MakeUprightTransform(empty, Superior), itk::ExceptionObject);
}

TEST(ShearWarpMIPView, DirectionsPrintTheirNames)
{
  const auto print = [](Direction direction) {
    std::ostringstream out;
    out << direction;
    return out.str();
  };
  const std::string prefix = "itk::ShearWarpMIPViewEnums::Direction::";
  EXPECT_EQ(print(Direction::Anterior), prefix + "Anterior");
  EXPECT_EQ(print(Direction::Posterior), prefix + "Posterior");
  EXPECT_EQ(print(Direction::Left), prefix + "Left");
  EXPECT_EQ(print(Direction::Right), prefix + "Right");
  EXPECT_EQ(print(Direction::Superior), prefix + "Superior");
  EXPECT_EQ(print(Direction::Inferior), prefix + "Inferior");
  EXPECT_EQ(print(static_cast<Direction>(17)), prefix + "INVALID VALUE");
}

TEST(ShearWarpMIPView, PatientSidesAreWhereTheReaderExpectsThem)
{
  const auto      image = MakeHead();
  const PointType center = GetCenter(image);
  const auto      filter = MakeFilter(image);
  const auto      expectBright =
    [&](const VectorType & side, Direction direction, double azimuth, double elevation, int u, int v) {
      image->FillBuffer(0);
      itk::Index<3> index;
      ASSERT_TRUE(image->TransformPhysicalPointToIndex(center + side * 3.0, index));
      image->SetPixel(index, 1000);
      image->Modified();
      filter->SetTransform(ShearWarpMIPView::MakeTransform(image, direction, azimuth, elevation));
      filter->Update();
      const auto * output = filter->GetOutput();
      const auto   pixels = GetPixels(output);
      const auto   brightest = std::max_element(pixels.begin(), pixels.end()) - pixels.begin();
      const auto   position = output->TransformIndexToPhysicalPoint<double>(output->ComputeIndex(brightest));
      // the voxel's center may be 1.1 mm from the point asked for
      EXPECT_NEAR(position[0], 3.0 * u, 2.0);
      EXPECT_NEAR(position[1], 3.0 * v, 2.0);
    };
  expectBright(Left, Direction::Anterior, 0, 0, 1, 0);
  expectBright(Right, Direction::Anterior, 0, 0, -1, 0);
  expectBright(Superior, Direction::Anterior, 0, 0, 0, -1);
  expectBright(Inferior, Direction::Anterior, 0, 0, 0, 1);
  expectBright(Left, Direction::Posterior, 0, 0, -1, 0);
  expectBright(Posterior, Direction::Left, 0, 0, 1, 0);
  expectBright(Superior, Direction::Left, 0, 0, 0, -1);
  expectBright(Anterior, Direction::Right, 0, 0, 1, 0);
  expectBright(Right, Direction::Superior, 0, 0, 1, 0);
  expectBright(Anterior, Direction::Superior, 0, 0, 0, -1);
  expectBright(Left, Direction::Inferior, 0, 0, 1, 0);
  expectBright(Posterior, Direction::Inferior, 0, 0, 0, 1);
  // left anterior oblique: the front moves to the picture's left; from above it moves down
  expectBright(Anterior, Direction::Anterior, 90, 0, -1, 0);
  expectBright(Anterior, Direction::Anterior, 0, 90, 0, 1);
}

TEST(ShearWarpMIPView, TurningAboutTheLongAxisIsAzimuth)
{
  const auto image = MakeHead();
  const auto view = ShearWarpMIPView::MakeTransform(image, Direction::Anterior);
  const auto center = ShearWarpMIPView::GetCenter(image);
  for (const double angle : { 0.0, 30.0, 90.0, -45.0, 180.0, 270.0, 1000.0 })
  {
    const auto turned = ShearWarpMIPView::Turn(view, Superior * 7.0, center, angle);
    const auto expected = ShearWarpMIPView::MakeTransform(image, Direction::Anterior, angle);
    const bool isExact = std::fmod(angle, 90.0) == 0.0;
    ExpectAxes(turned,
               GetViewAxis(expected, 1, 0, 0),
               GetViewAxis(expected, 0, 1, 0),
               GetViewAxis(expected, 0, 0, 1),
               isExact ? 0.0 : 1e-14);
    EXPECT_LT((turned->TransformPoint(MakePoint3(0, 0, 0)) - center).GetNorm(), 1e-12);
  }
}

TEST(ShearWarpMIPView, TurningIsARotationAboutTheLine)
{
  Random     random(310);
  const auto image = MakeHead();
  for (int repeat = 0; repeat < 200; ++repeat)
  {
    const auto view = MakeRandomView(random, ViewKind::Rigid, image);
    const auto axis = DrawVector(random, 3);
    const auto center = PointType(0.0) + DrawVector(random, 50);
    const auto degrees = random.Uniform(-400, 400);
    const auto turned = ShearWarpMIPView::Turn(view, axis, center, degrees);
    auto       rotation = itk::AffineTransform<double, 3>::New();
    rotation->SetCenter(center);
    rotation->Rotate3D(axis, degrees * itk::Math::pi_over_180);
    const auto point = PointType(0.0) + DrawVector(random, 9);
    const auto expected = rotation->TransformPoint(view->TransformPoint(point));
    ASSERT_LT((turned->TransformPoint(point) - expected).GetNorm(), 1e-10);
  }
}

TEST(ShearWarpMIPView, UprightViewsHaveTheAxisUpThePicture)
{
  const auto image = MakeHead();
  ExpectAxes(ShearWarpMIPView::MakeUprightTransform(image, Superior * 5.0), Left, Inferior, Posterior);
  ExpectAxes(ShearWarpMIPView::MakeUprightTransform(image, Inferior), Right, Superior, Posterior);
  ExpectAxes(ShearWarpMIPView::MakeUprightTransform(image, Left), Inferior, Right, Posterior);
  ExpectAxes(ShearWarpMIPView::MakeUprightTransform(image, Anterior), Right, Posterior, Inferior);
  Random random(311);
  for (int repeat = 0; repeat < 100; ++repeat)
  {
    const auto axis = DrawVector(random, 1);
    const auto view = ShearWarpMIPView::MakeUprightTransform(image, axis * (repeat % 2 == 0 ? 1e-200 : 1e200));
    ExpectRightHanded(view);
    ASSERT_LT((GetViewAxis(view, 0, 1, 0) + axis / axis.GetNorm()).GetNorm(), 1e-12);
  }
}

TEST(ShearWarpMIPView, ErrorsOfAxesNameTheValue)
{
  const auto image = MakeHead();
  const auto view = ShearWarpMIPView::MakeTransform(image, Direction::Anterior);
  const auto center = MakePoint3(0, 0, 0);
  const auto none = MakeVector3(0, 0, 0);
  const auto infinite = MakeVector3(0, std::numeric_limits<double>::infinity(), 0);
  EXPECT_THROW(ShearWarpMIPView::MakeUprightTransform(image, none), itk::ExceptionObject);
  EXPECT_THROW(ShearWarpMIPView::MakeUprightTransform(image, infinite), itk::ExceptionObject);
  EXPECT_THROW(ShearWarpMIPView::MakeUprightTransform(nullptr, Superior), itk::ExceptionObject);
  EXPECT_THROW(ShearWarpMIPView::Turn(view, none, center, 10.0), itk::ExceptionObject);
  EXPECT_THROW(ShearWarpMIPView::Turn(nullptr, Superior, center, 10.0), itk::ExceptionObject);
  EXPECT_THROW(ShearWarpMIPView::Turn(view, Superior, center, std::nan("")), itk::ExceptionObject);
}
