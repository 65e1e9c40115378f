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
#include "itkShearWarpGeometry.h"

#include "itkShearWarpMIPTestRule.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

/** The geometry of views without ITK. */
namespace
{
using namespace itk::ShearWarp;

constexpr double Infinity = std::numeric_limits<double>::infinity();
constexpr double Pi = 3.14159265358979323846;

using Vector = std::array<double, 3>;

using itk::ShearWarpMIPTest::Random;

constexpr AffineMap3D Identity{ { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, { 0, 0, 0 } };

AffineMap3D
MakeScale(double x, double y, double z)
{
  return { { { x, 0, 0 }, { 0, y, 0 }, { 0, 0, z } }, { 0, 0, 0 } };
}

/** Turns physical space about x. */
AffineMap3D
MakeTilt(double angle)
{
  const double cosine = std::cos(angle);
  const double sine = std::sin(angle);
  return { { { 1, 0, 0 }, { 0, cosine, -sine }, { 0, sine, cosine } }, { 0, 0, 0 } };
}

/** First \a b, then \a a. */
AffineMap3D
Compose(const AffineMap3D & a, const AffineMap3D & b)
{
  AffineMap3D product = a;
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int n = 0; n < 3; ++n)
    {
      product.matrix[row][n] = 0.0;
      product.offset[row] += a.matrix[row][n] * b.offset[n];
      for (unsigned int inner = 0; inner < 3; ++inner)
      {
        product.matrix[row][n] += a.matrix[row][inner] * b.matrix[inner][n];
      }
    }
  }
  return product;
}

Vector
Apply(const AffineMap3D & map, double x, double y, double z)
{
  Vector result;
  for (unsigned int row = 0; row < 3; ++row)
  {
    result[row] = map.matrix[row][0] * x + map.matrix[row][1] * y + map.matrix[row][2] * z + map.offset[row];
  }
  return result;
}

/** A map whose columns are at right angles and 1 long, from three turns about axes. */
AffineMap3D
MakeRandomRotation(Random & random)
{
  const AffineMap3D swap{ { { 0, 0, 1 }, { 1, 0, 0 }, { 0, 1, 0 } }, { 0, 0, 0 } };
  AffineMap3D       map = Identity;
  for (int n = 0; n < 3; ++n)
  {
    map = Compose(Compose(map, swap), MakeTilt(random.Uniform(-Pi, Pi)));
  }
  return map;
}

/** A rotation, or a rotation, a skew and another rotation. A mirror may come first. */
AffineMap3D
MakeRandomView(Random & random)
{
  AffineMap3D view = MakeRandomRotation(random);
  if (random.Integer(0, 2) == 0)
  {
    AffineMap3D skew = MakeScale(random.Uniform(0.5, 2), random.Uniform(0.5, 2), random.Uniform(0.5, 2));
    skew.matrix[0][1] = random.Uniform(-0.4, 0.4);
    skew.matrix[0][2] = random.Uniform(-0.4, 0.4);
    view = Compose(Compose(view, skew), MakeRandomRotation(random));
  }
  view = Compose(view, MakeScale(random.Integer(0, 1) == 0 ? -1 : 1, 1, 1));
  for (double & offset : view.offset)
  {
    offset = random.Uniform(-20, 20);
  }
  return view;
}

VolumeGrid
MakeVolume(const std::array<std::ptrdiff_t, 3> & size, const Vector & spacing)
{
  return { { size[0], size[1], size[2] },
           { spacing[0], spacing[1], spacing[2] },
           MakeScale(spacing[0], spacing[1], spacing[2]) };
}

VolumeGrid
MakeRandomVolume(Random & random, std::ptrdiff_t least, std::ptrdiff_t most)
{
  const auto length = [&] { return random.Integer(least, most); };
  const auto spacing = [&] { return random.Uniform(0.3, 3); };
  VolumeGrid volume = MakeVolume({ length(), length(), length() }, { spacing(), spacing(), spacing() });
  volume.indexToPhysical = Compose(MakeRandomRotation(random), volume.indexToPhysical);
  for (double & offset : volume.indexToPhysical.offset)
  {
    offset = random.Uniform(-100, 100);
  }
  return volume;
}

Vector
GetCenter(const VolumeGrid & volume)
{
  const auto middle = [&](unsigned int axis) { return 0.5 * (static_cast<double>(volume.size[axis]) - 1.0); };
  return Apply(volume.indexToPhysical, middle(0), middle(1), middle(2));
}

VoxelBox
DrawPart(Random & random, const VolumeGrid & volume)
{
  VoxelBox part;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    part.begin[axis] = random.Integer(0, volume.size[axis] - 1);
    part.size[axis] = random.Integer(1, volume.size[axis] - part.begin[axis]);
  }
  return part;
}

double
ToDouble(const SamplingPosition & position)
{
  return position.whole + position.fraction / 32768.0;
}

bool
IsSame(const SlicePlacement & a, const SlicePlacement & b)
{
  return ToDouble(a.column) == ToDouble(b.column) && ToDouble(a.row) == ToDouble(b.row);
}

template <typename TFunction>
std::string
GetMessage(const TFunction & function)
{
  try
  {
    function();
  }
  catch (const InvalidParameter & error)
  {
    return error.what();
  }
  return "no exception";
}

/** Expects InvalidParameter from an expression, with each of the texts in the message. */
#define EXPECT_INVALID(expression, ...)                                                              \
  {                                                                                                  \
    const std::string message = GetMessage([&] { static_cast<void>(expression); });                  \
    for (const std::string & eachText : std::initializer_list<std::string>{ __VA_ARGS__ })           \
    {                                                                                                \
      EXPECT_NE(message.find(eachText), std::string::npos) << eachText << " is not in: " << message; \
    }                                                                                                \
  }

/** Expects that \a reached has exactly the pixels that the slices reach, by the definition of SlicePlacement. \a grid
 * is the image of \a part. */
void
ExpectReached(const IntermediateGrid & grid, const Factorization & factorization, const VoxelBox & part)
{
  const auto & [i, j, k] = factorization.permutation;
  ASSERT_EQ(grid.reached.size(), static_cast<std::size_t>(grid.rows));
  ASSERT_EQ(grid.placements.size(), static_cast<std::size_t>(part.size[k]));
  std::vector<std::set<std::ptrdiff_t>> expected(grid.reached.size());
  for (const SlicePlacement & placement : grid.placements)
  {
    const double column = ToDouble(placement.column) + static_cast<double>(part.begin[i] - grid.begin.column);
    const double row = ToDouble(placement.row) + static_cast<double>(part.begin[j] - grid.begin.row);
    for (std::ptrdiff_t y = 0; y < grid.rows + 2; ++y)
    {
      const double voxelRow = static_cast<double>(y) - row;
      for (std::ptrdiff_t x = 0; x < grid.columns + 2; ++x)
      {
        const double voxelColumn = static_cast<double>(x) - column;
        if (voxelRow >= -0.5 && voxelRow < static_cast<double>(part.size[j]) - 0.5 && voxelColumn >= -0.5 &&
            voxelColumn < static_cast<double>(part.size[i]) - 0.5)
        {
          ASSERT_LT(x, grid.columns);
          ASSERT_LT(y, grid.rows);
          expected[static_cast<std::size_t>(y)].insert(x);
        }
      }
    }
  }
  for (std::size_t row = 0; row < expected.size(); ++row)
  {
    const auto & [begin, end] = grid.reached[row];
    if (expected[row].empty())
    {
      ASSERT_EQ(begin, 0);
      ASSERT_EQ(end, 0);
      continue;
    }
    ASSERT_EQ(begin, *expected[row].begin()) << "in row " << row;
    ASSERT_EQ(end, *expected[row].rbegin() + 1) << "in row " << row;
    ASSERT_EQ(expected[row].size(), static_cast<std::size_t>(end - begin)) << "in row " << row;
  }
}
} // namespace

TEST(ShearWarpGeometry, TheIdentityViewHasNoShear)
{
  const VolumeGrid    volume = MakeVolume({ 4, 5, 6 }, { 1, 1, 1 });
  const Factorization factorization = Factorize(Identity, volume);
  EXPECT_EQ(factorization.GetPrincipalAxis(), 2u);
  for (unsigned int n = 0; n < 3; ++n)
  {
    EXPECT_EQ(factorization.permutation[n], n);
    EXPECT_EQ(factorization.size[n], volume.size[n]);
    EXPECT_EQ(factorization.indexToView.offset[n], 0.0);
    for (unsigned int column = 0; column < 3; ++column)
    {
      EXPECT_EQ(factorization.indexToView.matrix[n][column], Identity.matrix[n][column]);
      EXPECT_EQ(GetShearedToView(factorization).matrix[n][column], Identity.matrix[n][column]);
    }
  }
  for (unsigned int n = 0; n < 2; ++n)
  {
    EXPECT_EQ(factorization.shear[n], 0.0);
    EXPECT_EQ(factorization.translation[n], 0.0);
  }

  const auto phases = MakePhases(factorization, GetWholeBox(volume));
  ASSERT_EQ(phases.size(), 1u);
  EXPECT_EQ(phases[0].columns, 4);
  EXPECT_EQ(phases[0].rows, 5);
  EXPECT_EQ(phases[0].begin.column, 0);
  EXPECT_EQ(phases[0].begin.row, 0);
  EXPECT_EQ(phases[0].begin.slice, 0);
  EXPECT_EQ(phases[0].placements.size(), 6u);
  ExpectReached(phases[0], factorization, GetWholeBox(volume));

  const ShearedFunction depth = GetDepthFunction(factorization);
  EXPECT_EQ(depth(3, 2, 5), 5.0);
  const AffineMap2D map = GetOutputToIntermediate(factorization, { { 8, 8 }, { 0.5, 2 }, { 3, -1 } });
  EXPECT_EQ(map.xx, 0.5);
  EXPECT_EQ(map.xy, 0.0);
  EXPECT_EQ(map.x0, 3.0);
  EXPECT_EQ(map.yx, 0.0);
  EXPECT_EQ(map.yy, 2.0);
  EXPECT_EQ(map.y0, -1.0);
}

TEST(ShearWarpGeometry, ViewsAlongAxesAreExact)
{
  const std::array<double, 3> spacing{ 2, 1, 0.5 };
  const VolumeGrid            volume = MakeVolume({ 4, 5, 6 }, spacing);
  std::array<unsigned int, 3> axes{ 0, 1, 2 };
  std::set<unsigned int>      principalAxes;
  do
  {
    // each sign of each axis of view space, with zeros of both signs
    for (unsigned int signs = 0; signs < 16; ++signs)
    {
      AffineMap3D view{};
      Vector      sign;
      for (unsigned int column = 0; column < 3; ++column)
      {
        sign[column] = (signs >> column & 1) != 0 ? -1.0 : 1.0;
        for (unsigned int row = 0; row < 3; ++row)
        {
          view.matrix[row][column] = row == axes[column] ? sign[column] : signs < 8 ? 0.0 : -0.0;
        }
        view.offset[column] = signs < 8 ? 0.0 : -0.0;
      }
      const Factorization factorization = Factorize(view, volume);
      const auto & [i, j, k] = factorization.permutation;
      EXPECT_EQ(k, axes[2]);
      EXPECT_LT(i, j);
      principalAxes.insert(k);
      for (unsigned int n = 0; n < 2; ++n)
      {
        EXPECT_EQ(factorization.shear[n], 0.0);
        EXPECT_EQ(factorization.translation[n], 0.0);
      }
      for (const SlicePlacement & placement : PlaceSlices(factorization, 0, factorization.size[2]))
      {
        EXPECT_TRUE(IsSame(placement, { { 0, 0 }, { 0, 0 } }));
      }

      Vector index;
      index[i] = 1;
      index[j] = 2;
      index[k] = 3;
      const Vector     viewed = Apply(factorization.indexToView, 1, 2, 3);
      const ViewBounds bounds = FindBounds(view, volume);
      for (unsigned int n = 0; n < 3; ++n)
      {
        const unsigned int axis = axes[n];
        EXPECT_EQ(viewed[n], sign[n] * index[axis] * spacing[axis]);
        const double first = -0.5 * spacing[axis];
        const double last = (static_cast<double>(volume.size[axis]) - 0.5) * spacing[axis];
        EXPECT_EQ(bounds.lower[n], sign[n] > 0 ? first : -last);
        EXPECT_EQ(bounds.upper[n], sign[n] > 0 ? last : -first);
        EXPECT_EQ(bounds.step[n], spacing[axis]);
        EXPECT_EQ(bounds.rest[n], 0.0);
      }
    }
  } while (std::next_permutation(axes.begin(), axes.end()));
  EXPECT_EQ(principalAxes.size(), 3u);
}

TEST(ShearWarpGeometry, QuarterTurnsAndTinyTiltsHaveNoShear)
{
  const VolumeGrid volume = MakeVolume({ 4, 5, 6 }, { 1, 1, 1 });
  for (const double angle : { 1e-10, -1e-10, 0.5 * Pi, -0.5 * Pi, Pi })
  {
    SCOPED_TRACE(angle);
    const Factorization factorization = Factorize(MakeTilt(angle), volume);
    EXPECT_EQ(factorization.GetPrincipalAxis(), std::abs(angle) == 0.5 * Pi ? 1u : 2u);
    EXPECT_EQ(factorization.shear[0], 0.0);
    EXPECT_NEAR(factorization.shear[1], std::abs(angle) < 1 ? angle : 0.0, 1e-15);
    const auto grid = MakePhases(factorization, GetWholeBox(volume)).front();
    EXPECT_EQ(grid.columns, volume.size[0]);
    EXPECT_EQ(grid.rows, volume.size[factorization.permutation[1]]);
    for (const SlicePlacement & placement : grid.placements)
    {
      EXPECT_TRUE(IsSame(placement, { { 0, 0 }, { 0, 0 } }));
    }
  }
}

TEST(ShearWarpGeometry, ATiltShearsByItsTangent)
{
  const VolumeGrid volume = MakeVolume({ 4, 5, 6 }, { 1, 1, 1 });
  for (const double degrees : { -44.0, -30.0, 30.0, 44.0 })
  {
    const double        tangent = std::tan(degrees * Pi / 180.0);
    const double        translation = std::max(0.0, -5.0 * tangent);
    const Factorization factorization = Factorize(MakeTilt(degrees * Pi / 180.0), volume);
    EXPECT_NEAR(factorization.shear[1], tangent, 1e-14);
    EXPECT_NEAR(factorization.translation[1], translation, 1e-13);
    const auto placements = PlaceSlices(factorization, 2, 3);
    ASSERT_EQ(placements.size(), 3u);
    for (std::size_t n = 0; n < 3; ++n)
    {
      const double slice = 2.0 + static_cast<double>(n);
      EXPECT_NEAR(ToDouble(placements[n].row), tangent * slice + translation, 0.5001 / 32768.0);
    }
  }
}

TEST(ShearWarpGeometry, OfEqualAxesTheLastIsPrincipal)
{
  const VolumeGrid volume = MakeVolume({ 4, 5, 6 }, { 1, 1, 1 });
  const auto       getAxis = [&volume](double x, double y, double z) {
    return Factorize({ { { 1, 0, x }, { 0, 1, y }, { 0, 0, z } }, { 0, 0, 0 } }, volume).GetPrincipalAxis();
  };
  EXPECT_EQ(getAxis(1, 1, 1), 2u);
  EXPECT_EQ(getAxis(-1, 1, -1), 2u);
  EXPECT_EQ(getAxis(1 + 1e-12, 0.3, 1), 2u);
  EXPECT_EQ(getAxis(1 + 1e-9, 0.3, 1), 0u);
  EXPECT_EQ(getAxis(1 + 1e-12, 1, 0.3), 1u);
}

TEST(ShearWarpGeometry, OversampledPhasesLieBetweenThePixels)
{
  Random random(106);
  for (int repeat = 0; repeat < 500 && !HasFatalFailure(); ++repeat)
  {
    SCOPED_TRACE(repeat);
    const VolumeGrid    volume = MakeRandomVolume(random, 1, 12);
    const AffineMap3D   view = MakeRandomView(random);
    const Factorization factorization = Factorize(view, volume, 2);
    const VoxelBox      part = repeat % 2 == 0 ? GetWholeBox(volume) : DrawPart(random, volume);
    const auto          plain = MakePhases(factorization, part);
    const auto          fine = MakePhases(factorization, part, 2);
    ASSERT_EQ(plain.size(), 1u);
    ASSERT_EQ(fine.size(), 4u);
    ExpectReached(plain[0], factorization, part);
    for (std::size_t phase = 0; phase < 4; ++phase)
    {
      ASSERT_EQ(fine[phase].columns, fine[0].columns);
      ASSERT_EQ(fine[phase].rows, fine[0].rows);
      ExpectReached(fine[phase], factorization, part);
      for (std::size_t k = 0; k < plain[0].placements.size(); ++k)
      {
        const SlicePlacement & placement = fine[phase].placements[k];
        ASSERT_EQ(ToDouble(placement.column), ToDouble(plain[0].placements[k].column) + (phase % 2 == 0 ? 0.5 : 0.0));
        ASSERT_EQ(ToDouble(placement.row), ToDouble(plain[0].placements[k].row) + (phase / 2 == 0 ? 0.5 : 0.0));
      }
    }
    ASSERT_EQ(fine[3].begin.column, plain[0].begin.column);
    ASSERT_EQ(fine[3].begin.row, plain[0].begin.row);

    // pixel 2 p + 1 of the oversampled image lies where pixel p of the plain image lies
    const PictureGrid picture{ { 8, 8 }, { 0.5, 0.7 }, { -10, 4 } };
    const AffineMap2D plainMap = GetOutputToIntermediate(factorization, picture);
    const AffineMap2D fineMap = GetOutputToIntermediate(factorization, picture, 2);
    ASSERT_NEAR(
      fineMap.xx * 3 + fineMap.xy * 8 + fineMap.x0, 2 * (plainMap.xx * 3 + plainMap.xy * 8 + plainMap.x0) + 1, 1e-9);
    ASSERT_NEAR(
      fineMap.yx * 3 + fineMap.yy * 8 + fineMap.y0, 2 * (plainMap.yx * 3 + plainMap.yy * 8 + plainMap.y0) + 1, 1e-9);
  }
}

TEST(ShearWarpGeometry, PartsLieInTheWholeImage)
{
  Random random(108);
  for (int repeat = 0; repeat < 500 && !HasFatalFailure(); ++repeat)
  {
    SCOPED_TRACE(repeat);
    const VolumeGrid    volume = MakeRandomVolume(random, 1, 12);
    const Factorization factorization = Factorize(MakeRandomView(random), volume);
    const VoxelBox      part = DrawPart(random, volume);
    const auto & [i, j, k] = factorization.permutation;
    const auto whole = MakePhases(factorization, GetWholeBox(volume)).front();
    const auto grid = MakePhases(factorization, part).front();
    ASSERT_EQ(whole.begin.column, 0);
    ASSERT_EQ(whole.begin.row, 0);
    ASSERT_EQ(grid.begin.slice, part.begin[k]);
    ASSERT_LE(grid.begin.column + grid.columns, whole.columns);
    ASSERT_LE(grid.begin.row + grid.rows, whole.rows);

    // the whole image and the part's image give a slice of the part the same place
    const Corner corner{ part.begin[i], part.begin[j], part.begin[k] };
    const auto   inWhole = PlacePart(whole, corner, part.size[k]);
    const auto   inPart = PlacePart(grid, corner, part.size[k]);
    ASSERT_EQ(inWhole.size(), inPart.size());
    std::int32_t leastColumn = 1000;
    std::int32_t leastRow = 1000;
    for (std::size_t n = 0; n < inPart.size(); ++n)
    {
      ASSERT_EQ(ToDouble(inWhole[n].column), ToDouble(inPart[n].column) + static_cast<double>(grid.begin.column));
      ASSERT_EQ(ToDouble(inWhole[n].row), ToDouble(inPart[n].row) + static_cast<double>(grid.begin.row));
      leastColumn = std::min(leastColumn, inPart[n].column.whole);
      leastRow = std::min(leastRow, inPart[n].row.whole);
    }
    ASSERT_EQ(leastColumn, 0);
    ASSERT_EQ(leastRow, 0);
  }
}

TEST(ShearWarpGeometry, FunctionsOfViewSpaceFollowTheShear)
{
  Random random(109);
  for (int repeat = 0; repeat < 500; ++repeat)
  {
    const VolumeGrid    volume = MakeRandomVolume(random, 1, 12);
    const Factorization factorization = Factorize(MakeRandomView(random), volume);
    const double        ofView[] = {
      random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(-9, 9)
    };
    const ShearedFunction function = GetShearedFunction(factorization, ofView);
    const ShearedFunction depth = GetDepthFunction(factorization);
    const Vector          voxel{ random.Uniform(0, 9), random.Uniform(0, 9), random.Uniform(0, 9) };
    const Vector          point = Apply(factorization.indexToView, voxel[0], voxel[1], voxel[2]);
    const double          column = voxel[0] + factorization.shear[0] * voxel[2] + factorization.translation[0];
    const double          row = voxel[1] + factorization.shear[1] * voxel[2] + factorization.translation[1];
    const Vector          sheared = Apply(GetShearedToView(factorization), column, row, voxel[2]);
    const double          expected = ofView[0] * point[0] + ofView[1] * point[1] + ofView[2] * point[2] + ofView[3];
    for (unsigned int n = 0; n < 3; ++n)
    {
      EXPECT_NEAR(sheared[n], point[n], 1e-9);
    }
    EXPECT_NEAR(function(column, row, voxel[2]), expected, 1e-9);
    EXPECT_NEAR(depth(column, row, voxel[2]), point[2], 1e-9);
    for (std::size_t phase = 0; phase < 4; ++phase)
    {
      // pixel (x, y) of the oversampled image lies at column (x + 1) / 2 - 1 and row (y + 1) / 2 - 1
      const double x = phase % 2 == 0 ? 6.0 : 7.0;
      const double y = phase < 2 ? 10.0 : 11.0;
      EXPECT_NEAR(GetFunctionOfPhase(function, 2, phase)(3, 5, voxel[2]),
                  function((x + 1) / 2 - 1, (y + 1) / 2 - 1, voxel[2]),
                  1e-9);
    }
  }
}

TEST(ShearWarpGeometry, ViewsFromOppositeSidesHaveTheSamePlaces)
{
  Random random(107);
  int    opposites = 0;
  for (int repeat = 0; repeat < 100; ++repeat)
  {
    const VolumeGrid  volume = MakeRandomVolume(random, 2, 60);
    const AffineMap3D view = MakeRandomView(random);
    // the same rays, from the other side, in a picture that is turned and shifted
    const double cosine = std::cos(0.1 * repeat);
    const double sine = std::sin(0.1 * repeat);
    AffineMap3D  turn{ { { -cosine, -sine, 0 }, { -sine, cosine, 0 }, { 0, 0, -1 } }, {} };
    for (double & offset : turn.offset)
    {
      offset = random.Uniform(-9, 9);
    }
    const auto place = [&volume](const AffineMap3D & someView) {
      const Factorization factorization = Factorize(someView, volume);
      return PlaceSlices(factorization, 0, factorization.size[2]);
    };
    const auto places = place(view);
    const auto opposite = place(Compose(view, turn));
    const auto other = place(MakeRandomView(random));
    opposites += std::equal(places.begin(), places.end(), opposite.begin(), opposite.end(), IsSame);
    EXPECT_FALSE(std::equal(places.begin(), places.end(), other.begin(), other.end(), IsSame));
  }
  // rounding errors may move a slice by 1/2^15
  EXPECT_GT(opposites, 95);
}

TEST(ShearWarpGeometry, AFittedGridHoldsTheVolume)
{
  const VolumeGrid  volume = MakeVolume({ 4, 5, 6 }, { 2, 1, 0.5 });
  const PictureGrid given{ { 7, 8 }, { 0.25, 2 }, { 1, 3 } };
  const auto        expect = [](const PictureGrid & grid, const PictureGrid & expected) {
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      EXPECT_EQ(grid.size[axis], expected.size[axis]);
      EXPECT_EQ(grid.spacing[axis], expected.spacing[axis]);
      EXPECT_EQ(grid.origin[axis], expected.origin[axis]);
    }
  };
  // the volume is from -1 to 7 and from -0.5 to 4.5
  const std::vector<AffineMap3D> view{ Identity };
  expect(FitGrid(view, volume, given, false, false, false), given);
  expect(FitGrid(view, volume, given, true, true, true), { { 16, 10 }, { 0.5, 0.5 }, { -0.75, -0.25 } });
  expect(FitGrid(view, volume, given, true, false, true), { { 32, 3 }, { 0.25, 2 }, { -0.875, 0 } });
  expect(FitGrid(view, volume, given, false, false, true), { { 7, 8 }, { 0.25, 2 }, { 2.25, -5 } });
  expect(FitGrid(view, volume, given, true, false, false), { { 25, 2 }, { 0.25, 2 }, { 1, 3 } });
  expect(FitGrid(view, volume, given, false, true, false), { { 7, 8 }, { 0.5, 0.5 }, { 1, 3 } });

  // two views together, one of which is moved by -3 and 1
  AffineMap3D moved = Identity;
  moved.offset[0] = 3;
  moved.offset[1] = -1;
  expect(FitGrid({ Identity, moved }, volume, given, true, true, true), { { 22, 12 }, { 0.5, 0.5 }, { -3.75, -0.25 } });
}

TEST(ShearWarpGeometry, AFittedSpacingIsRoundedToWholePixels)
{
  const PictureGrid given{ { 7, 8 }, { 0.25, 2 }, { 1, 3 } };
  const auto        fit = [&](double u, double v) {
    return FitGrid({ Identity }, MakeVolume({ 4, 5, 6 }, { u, v, 1 }), given, true, true, true);
  };
  EXPECT_EQ(fit(1.0005, 3.002).spacing[0], 1.0005);
  EXPECT_EQ(fit(1.0005, 3.002).spacing[1], 3.002 / 3);
  EXPECT_EQ(fit(1.0005, 3.002).size[0], 4);
  EXPECT_EQ(fit(1.0005, 3.002).size[1], 15);
  EXPECT_EQ(fit(1.002, 3.004).spacing[0], 1.0);
  EXPECT_EQ(fit(1.002, 3.004).spacing[1], 1.0);
  EXPECT_EQ(fit(1.002, 3.004).size[1], 16);
  // a difference of rounding errors changes no bit
  EXPECT_EQ(fit(1.0 + 1e-12, 1).spacing[0], 1.0);
  // no axis of the volume lies along v
  EXPECT_EQ(FitGrid({ MakeTilt(0.02) }, MakeVolume({ 4, 5, 6 }, { 1, 1.0005, 1 }), given, true, true, true).spacing[1],
            1.0);
}

TEST(ShearWarpGeometry, RandomFittedGridsHoldAllViews)
{
  Random random(110);
  for (int repeat = 0; repeat < 500; ++repeat)
  {
    const VolumeGrid               volume = MakeRandomVolume(random, 1, 12);
    const std::vector<AffineMap3D> views{ MakeRandomView(random), MakeRandomView(random) };
    const PictureGrid              grid = FitGrid(views, volume, {}, true, true, true);
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      const auto   bounds = { FindBounds(views[0], volume), FindBounds(views[1], volume) };
      const double lower = std::min(bounds.begin()[0].lower[axis], bounds.begin()[1].lower[axis]);
      const double upper = std::max(bounds.begin()[0].upper[axis], bounds.begin()[1].upper[axis]);
      const double extent = grid.size[axis] * grid.spacing[axis];
      const double begin = grid.origin[axis] - 0.5 * grid.spacing[axis];
      EXPECT_GE(extent, upper - lower - 1e-4 * grid.spacing[axis]);
      EXPECT_LT(extent, upper - lower + grid.spacing[axis]);
      EXPECT_NEAR(begin + 0.5 * extent, 0.5 * (lower + upper), 1e-9);
      double projected[2][2];
      ProjectSpacing(views[0], volume, projected[0]);
      ProjectSpacing(views[1], volume, projected[1]);
      EXPECT_EQ(grid.spacing[axis], std::min(projected[0][axis], projected[1][axis]));
    }
  }
}

TEST(ShearWarpGeometry, ASlabIsClippedToTheVolume)
{
  const VolumeGrid volume = MakeVolume({ 4, 5, 6 }, { 1, 1, 1 });
  const auto       expect = [&](const DepthRange & slab, double nearest, double farthest) {
    const DepthRange depths = ClipDepths(Identity, volume, slab);
    EXPECT_NEAR(depths.nearest, nearest, 1e-12);
    EXPECT_NEAR(depths.farthest, farthest, 1e-12);
  };
  expect({ -Infinity, Infinity }, -0.5, 5.5);
  expect({ 1, 2 }, 1, 2);
  expect({ -9, 2 }, -0.5, 2);
  expect({ 1, 9 }, 1, 5.5);
  // a thousandth of six voxels
  expect({ 3, 3 }, 2.997, 3.003);
  expect({ 20, Infinity }, 19.997, 20.003);
  expect({ -Infinity, -20 }, -20.003, -19.997);
  expect({ 20, 21 }, 20, 21);
  EXPECT_INVALID(ClipDepths(Identity, volume, { 1e300, 1e300 }), "SlabNear", "1e+300");
}

TEST(ShearWarpGeometry, TheSphereDepthIsTheSameForAllViewsAboutTheCenter)
{
  const VolumeGrid plain = MakeVolume({ 4, 5, 6 }, { 1, 1, 1 });
  EXPECT_NEAR(FindSphereDepth(Identity, plain), 2.5 - 0.5 * std::sqrt(77.0), 1e-14);
  EXPECT_NEAR(FindSphereDepth(MakeScale(1, 1, 2), plain), 0.5 * (2.5 - 0.5 * std::sqrt(77.0)), 1e-14);

  Random random(111);
  for (int repeat = 0; repeat < 100; ++repeat)
  {
    VolumeGrid volume = MakeRandomVolume(random, 1, 12);
    if (repeat % 2 == 0)
    {
      AffineMap3D skew = Identity;
      skew.matrix[0][1] = 0.5;
      volume.indexToPhysical = Compose(skew, volume.indexToPhysical);
    }
    const Vector center = GetCenter(volume);
    double       depths[2];
    for (double & depth : depths)
    {
      AffineMap3D view = MakeRandomRotation(random);
      std::copy(center.begin(), center.end(), view.offset);
      depth = FindSphereDepth(view, volume);
      const ViewBounds bounds = FindBounds(view, volume);
      EXPECT_LE(depth, bounds.lower[2] + 1e-9);
      EXPECT_GE(-depth, bounds.upper[2] - 1e-9);
    }
    EXPECT_NEAR(depths[0], depths[1], 1e-9);
  }
}

TEST(ShearWarpGeometry, PicturesHaveAPlaceInPhysicalSpace)
{
  AffineMap3D view = MakeScale(2, -1, 3);
  view.offset[0] = 1;
  view.offset[1] = 2;
  view.offset[2] = 3;
  const PictureGrid picture{ { 8, 8 }, { 0.5, 2 }, { 4, 5 } };
  // column 1, row 2 is at (4.5, 9) of the view plane
  EXPECT_EQ(Apply(MakePictureSpace(view, picture), 1, 2, 7), (Vector{ 10, -7, 24 }));

  const SliceGeometry slice = MakeSliceGeometry(view, picture, { 1, 5 });
  const Vector        spacing{ 1, 2, 12 };
  const Vector        origin{ 9, -3, 12 };
  const Vector        direction{ 1, -1, 1 };
  for (unsigned int row = 0; row < 3; ++row)
  {
    EXPECT_EQ(slice.spacing[row], spacing[row]);
    EXPECT_EQ(slice.origin[row], origin[row]);
    for (unsigned int column = 0; column < 3; ++column)
    {
      EXPECT_EQ(slice.direction[row][column], row == column ? direction[row] : 0.0);
    }
  }
}

TEST(ShearWarpGeometry, GridsWithoutAMeaningAreErrors)
{
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NO_THROW(VerifyVolumeGrid(MakeVolume({ 1, 1, 1 }, { 1, 1, 1 })));
  EXPECT_INVALID(VerifyVolumeGrid(MakeVolume({ 3, 0, 5 }, { 1, 1, 1 })), "input must not be empty", "[3, 0, 5]");
  EXPECT_INVALID(VerifyVolumeGrid(MakeVolume({ 3, 4, -5 }, { 1, 1, 1 })), "[3, 4, -5]");
  for (const double bad : { 0.0, -1.0, Infinity, nan })
  {
    EXPECT_INVALID(VerifyVolumeGrid(MakeVolume({ 3, 4, 5 }, { 1, bad, 7 })), "input's spacing", "[1, ", ", 7]");
    EXPECT_INVALID(VerifyPictureGrid({ { 1, 1 }, { 0.25, bad }, { 0, 0 } }, false), "OutputSpacing", "[0.25, ");
    EXPECT_NO_THROW(VerifyPictureGrid({ { 1, 1 }, { 0.25, bad }, { 0, 0 } }, true));
  }
  VolumeGrid volume = MakeVolume({ 3, 4, 5 }, { 1, 1, 1 });
  volume.indexToPhysical.offset[1] = Infinity;
  EXPECT_INVALID(VerifyVolumeGrid(volume), "input's origin", "[0, inf, 0]");
  EXPECT_INVALID(VerifyPictureGrid({ { 1, 1 }, { 1, 1 }, { 2.5, nan } }, true), "OutputOrigin", "[2.5, nan]");
}

TEST(ShearWarpGeometry, ViewsWithoutAMeaningAreErrors)
{
  for (const double scale : { 1e-9, 1e-3, 1e6 })
  {
    EXPECT_NO_THROW(VerifyView(MakeScale(scale, scale, scale)));
  }
  EXPECT_INVALID(VerifyView(MakeScale(2.5, Infinity, 1)), "Transform must be finite", "2.5 0 0\n0 inf 0\n0 0 1\n");
  EXPECT_INVALID(VerifyView(MakeScale(2.5, 7.25, 0)), "invertible", "2.5 0 0\n0 7.25 0\n0 0 0\n", "determinant");
  AffineMap3D far = Identity;
  far.offset[2] = 1e200;
  EXPECT_INVALID(VerifyView(far), "Transform must be finite", "[0, 0, 1e+200]");

  VolumeGrid volume = MakeVolume({ 3, 3, 3 }, { 1, 1, 1 });
  volume.indexToPhysical = { { { 1, 0, -2 }, { 0, 1, 1 }, { 0, 0, 1e-300 } }, { 0, 0, 0 } };
  EXPECT_INVALID(Factorize(MakeTilt(1), volume), "finite and invertible", "0 0 1e-300\n");
  EXPECT_INVALID(FindBounds(MakeTilt(1), volume), "finite and invertible");
  volume = MakeVolume({ 3, 3, 3 }, { 1, 1, 1 });
  volume.indexToPhysical.offset[0] = 1e300;
  EXPECT_INVALID(Factorize(MakeScale(1e-100, 1, 1), volume), "finite and invertible", "[1e+300, 0, 0]");
  volume.indexToPhysical.offset[0] = 1.5e308;
  EXPECT_INVALID(FitGrid({ Identity }, volume, {}, true, true, true), "grid must be finite", "[1, 1]", "[inf, 0]");

  const Factorization factorization = Factorize(Identity, MakeVolume({ 3, 3, 3 }, { 1e-10, 1, 1 }));
  EXPECT_NO_THROW(GetOutputToIntermediate(factorization, { { 8, 8 }, { 1e290, 1 }, { 0, 0 } }));
  EXPECT_INVALID(GetOutputToIntermediate(factorization, { { 8, 8 }, { 1e300, 1 }, { 2.5, 0 } }),
                 "[1e+300, 1]",
                 "[2.5, 0]",
                 "1e-10 0 0\n0 1 0\n0 0 1\n");
}

TEST(ShearWarpGeometry, TooLargeIntermediateImagesAreErrors)
{
  constexpr std::ptrdiff_t half = std::ptrdiff_t{ 1 } << 30;
  EXPECT_NO_THROW(Factorize(Identity, MakeVolume({ half, 1, half - 1 }, { 1, 1, 1 })));
  EXPECT_INVALID(Factorize(Identity, MakeVolume({ half, 1, half }, { 1, 1, 1 })), "less than 2^31", "2147483648.");
  EXPECT_NO_THROW(Factorize(Identity, MakeVolume({ 1, half - 2, 1 }, { 1, 1, 1 }), 2));
  EXPECT_INVALID(Factorize(Identity, MakeVolume({ 1, half - 1, 1 }, { 1, 1, 1 }), 2),
                 "[1, 1073741823, 1] needs 2147483648.");
}
