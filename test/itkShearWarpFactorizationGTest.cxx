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
#include "itkShearWarpFactorization.h"

#include "itkShearWarpMIPTestImages.h"

#include "itkBSplineTransform.h"
#include "itkCompositeTransform.h"
#include "itkEuler3DTransform.h"
#include "itkIdentityTransform.h"
#include "itkScaleTransform.h"
#include "itkSimilarity3DTransform.h"
#include "itkTranslationTransform.h"
#include "itkVersorRigid3DTransform.h"

#include <set>
#include <utility>

namespace
{
using namespace itk::ShearWarpMIPTest;
using itk::ShearWarpFactorization;

using GeometryType = itk::ImageBase<3>;
using GridType = itk::ImageBase<2>;

GridType::Pointer
MakeGrid(double spacingU = 1.0, double spacingV = 1.0, double originU = 0.0, double originV = 0.0)
{
  auto grid = GridType::New();
  grid->SetRegions(itk::Size<2>{ { 8, 8 } });
  grid->SetSpacing(MakeVector2(spacingU, spacingV));
  grid->SetOrigin(MakePoint2(originU, originV));
  return grid;
}

GeometryType::Pointer
MakeGeometry(const itk::Size<3> & size, const itk::Vector<double, 3> & spacing)
{
  auto geometry = GeometryType::New();
  geometry->SetRegions(size);
  geometry->SetSpacing(spacing);
  return geometry;
}

GeometryType::Pointer
MakeRandomGeometry(Random & random, itk::SizeValueType low, itk::SizeValueType high)
{
  auto geometry = GeometryType::New();
  SetRandomGeometry(random, geometry, MakeRandomSize(random, low, high));
  return geometry;
}

/** A homogeneous 4x4 matrix times (x, y, z, 1). */
itk::Vector<double, 4>
Apply(const ShearWarpFactorization::Matrix4Type & matrix, double x, double y, double z)
{
  const double position[] = { x, y, z, 1.0 };
  return matrix * itk::Vector<double, 4>(position);
}

itk::Vector<double, 3>
Apply(const ShearWarpFactorization::Matrix3Type & matrix, double x, double y)
{
  return matrix * MakeVector3(x, y, 1.0);
}

double
ToDouble(const itk::ShearWarp::SamplingPosition & position)
{
  return position.whole + position.fraction / 32768.0;
}

/** View coordinates of (i, j, k), voxels from the first one in the order of \a permutation: by the image and the
 * transform's own inverse. */
PointType
ToView(const itk::Transform<double, 3, 3> *            inverse,
       const GeometryType *                            image,
       const ShearWarpFactorization::PermutationType & permutation,
       double                                          i,
       double                                          j,
       double                                          k)
{
  const double                    ijk[] = { i, j, k };
  itk::ContinuousIndex<double, 3> index;
  for (unsigned int n = 0; n < 3; ++n)
  {
    index[permutation[n]] = static_cast<double>(image->GetLargestPossibleRegion().GetIndex(permutation[n])) + ijk[n];
  }
  return inverse->TransformPoint(image->TransformContinuousIndexToPhysicalPoint<double>(index));
}

/** The columns of each row are the columns of its span. */
void
ExpectSpans(const std::vector<std::set<std::int32_t>> &     columnsOfRows,
            const std::vector<itk::ShearWarp::ColumnSpan> & spans)
{
  ASSERT_EQ(columnsOfRows.size(), spans.size());
  for (std::size_t row = 0; row < spans.size(); ++row)
  {
    std::set<std::int32_t> columns;
    for (std::int32_t column = spans[row].begin; column < spans[row].end; ++column)
    {
      columns.insert(columns.end(), column);
    }
    ASSERT_EQ(columnsOfRows[row], columns) << "in row " << row;
  }
}

/** Everything that holds for every factorization. */
void
ExpectFactors(const ShearWarpFactorization &       factorization,
              const itk::Transform<double, 3, 3> * view,
              const GeometryType *                 image,
              const GridType *                     grid)
{
  const auto & permutation = factorization.GetPermutation();
  ASSERT_EQ(permutation[2], factorization.GetPrincipalAxis());
  ASSERT_LT(permutation[0], permutation[1]);
  ASSERT_EQ((std::set<unsigned int>{ permutation[0], permutation[1], permutation[2] }),
            (std::set<unsigned int>{ 0, 1, 2 }));
  const auto size = image->GetLargestPossibleRegion().GetSize();
  const auto columns = static_cast<double>(size[permutation[0]]);
  const auto rows = static_cast<double>(size[permutation[1]]);
  const auto slices = static_cast<double>(size[permutation[2]]);

  const auto & shear = factorization.GetShear();
  const auto & translation = factorization.GetTranslation();
  for (unsigned int n = 0; n < 2; ++n)
  {
    ASSERT_LE(std::abs(shear[n]), 1.0 + 1e-12);
    ASSERT_NEAR(translation[n], std::max(0.0, -shear[n] * (slices - 1)), 1e-12 * slices);
  }

  // warp after shear is the view, and a voxel's slice moves as the shear says
  const auto inverse = view->GetInverseTransform();
  ASSERT_TRUE(inverse);
  const auto warp = factorization.GetWarpMatrix();
  const auto outputToIntermediate = factorization.GetOutputToIntermediateMatrix();
  for (int corner = 0; corner < 8; ++corner)
  {
    const double i = corner & 1 ? columns - 1 : -0.5;
    const double j = corner & 2 ? rows - 0.5 : 0.0;
    const double k = corner & 4 ? slices - 1 : 0.0;
    const auto   expected = ToView(inverse, image, permutation, i, j, k);
    const auto   viewed = Apply(factorization.GetViewMatrix(), i, j, k);
    const auto   sheared = Apply(factorization.GetShearMatrix(), i, j, k);
    const auto   warped = Apply(warp, sheared[0], sheared[1]);
    ASSERT_EQ(sheared[2], k);
    ASSERT_EQ(sheared[3], 1.0);
    ASSERT_EQ(warped[2], 1.0);
    for (unsigned int n = 0; n < 3; ++n)
    {
      ASSERT_NEAR(viewed[n], expected[n], 1e-9);
    }
    ASSERT_NEAR(warped[0], expected[0], 1e-9);
    ASSERT_NEAR(warped[1], expected[1], 1e-9);

    // the output's pixel there is the intermediate one
    const auto   origin = grid->GetOrigin();
    const double column = (expected[0] - origin[0]) / grid->GetSpacing()[0];
    const double row = (expected[1] - origin[1]) / grid->GetSpacing()[1];
    const auto   back = Apply(outputToIntermediate, column, row);
    ASSERT_NEAR(back[0], sheared[0], 1e-9);
    ASSERT_NEAR(back[1], sheared[1], 1e-9);
    ASSERT_NEAR(back[2], 1.0, 1e-12);
  }

  // slices at their quantized offsets, exactly within the intermediate image
  const auto & placements = factorization.GetSlicePlacements();
  ASSERT_EQ(placements.size(), size[permutation[2]]);
  double       lowestColumn = 1e9, lowestRow = 1e9;
  double       endColumn = 0, endRow = 0;
  const auto & intermediateSize = factorization.GetIntermediateSize();
  const auto & reached = factorization.GetReachedColumns();
  ASSERT_EQ(reached.size(), intermediateSize[1]);
  std::vector<std::set<std::int32_t>> reachedByRow(intermediateSize[1]);
  for (std::size_t k = 0; k < placements.size(); ++k)
  {
    const double column = ToDouble(placements[k].column);
    const double row = ToDouble(placements[k].row);
    ASSERT_NEAR(column, shear[0] * static_cast<double>(k) + translation[0], 0.5001 / 32768.0);
    ASSERT_NEAR(row, shear[1] * static_cast<double>(k) + translation[1], 0.5001 / 32768.0);
    lowestColumn = std::min(lowestColumn, column);
    lowestRow = std::min(lowestRow, row);
    // pixel p meets the slice where -1/2 <= p - column < columns - 1/2
    const double firstColumn = std::ceil(column - 0.5);
    const double firstRow = std::ceil(row - 0.5);
    endColumn = std::max(endColumn, firstColumn + columns);
    endRow = std::max(endRow, firstRow + rows);
    for (double q = firstRow; q < firstRow + rows; ++q)
    {
      ASSERT_LT(q, static_cast<double>(reachedByRow.size()));
      for (double p = firstColumn; p < firstColumn + columns; ++p)
      {
        reachedByRow[static_cast<std::size_t>(q)].insert(static_cast<std::int32_t>(p));
      }
    }
  }
  ASSERT_EQ(lowestColumn, 0.0);
  ASSERT_EQ(lowestRow, 0.0);
  ASSERT_EQ(endColumn, static_cast<double>(intermediateSize[0]));
  ASSERT_EQ(endRow, static_cast<double>(intermediateSize[1]));
  ExpectSpans(reachedByRow, reached);
}
} // namespace

TEST(ShearWarpFactorization, WarpAfterShearIsTheViewForRandomViewsOfRandomImages)
{
  Random                                     random(101);
  std::set<std::pair<unsigned int, bool>>    axes;
  std::set<std::tuple<unsigned, bool, bool>> shearSigns;
  for (int repeat = 0; repeat < 6000 && !HasFatalFailure(); ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto image = MakeRandomGeometry(random, 1, 12);
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto grid =
      MakeGrid(random.Uniform(0.2, 3), random.Uniform(0.2, 3), random.Uniform(-50, 50), random.Uniform(-50, 50));
    const ShearWarpFactorization factorization(view, image, grid);
    ExpectFactors(factorization, view, image, grid);

    // the ray's index changes most along the principal axis
    const auto toIndex = [&](double w) {
      const PointType                 physical = view->TransformPoint(MakePoint3(0, 0, w));
      itk::ContinuousIndex<double, 3> index;
      // of no consequence whether it is inside
      static_cast<void>(image->TransformPhysicalPointToContinuousIndex(physical, index));
      return index;
    };
    const auto         ray = toIndex(1000.0) - toIndex(0.0);
    const unsigned int axis = factorization.GetPrincipalAxis();
    for (unsigned int n = 0; n < 3; ++n)
    {
      ASSERT_LE(std::abs(ray[n]), std::abs(ray[axis]) * (1 + 1e-9));
    }
    axes.insert({ axis, ray[axis] > 0 });
    shearSigns.insert({ axis, factorization.GetShear()[0] > 0, factorization.GetShear()[1] > 0 });
  }
  EXPECT_EQ(axes.size(), 6u) << "every axis from both sides";
  EXPECT_EQ(shearSigns.size(), 12u) << "every axis with both signs of both shears";
}

TEST(ShearWarpFactorization, ShearIsTheTangentOfTheTilt)
{
  // looking along z, turned about x: s_b = tan(angle) up to sign
  const auto image = MakeGeometry({ { 10, 20, 30 } }, MakeVector3(1, 1, 1));
  for (const double degrees : { -40.0, -10.0, 0.0, 25.0, 44.0 })
  {
    const double angle = degrees * itk::Math::pi_over_180;
    const auto   view = MakeView(
      MakeMatrix({ { 1, 0, 0 }, { 0, std::cos(angle), -std::sin(angle) }, { 0, std::sin(angle), std::cos(angle) } }),
      MakePoint3(0, 0, 0));
    const ShearWarpFactorization factorization(view, image, MakeGrid());
    EXPECT_EQ(factorization.GetPrincipalAxis(), 2u);
    EXPECT_NEAR(factorization.GetShear()[0], 0.0, 1e-15);
    EXPECT_NEAR(factorization.GetShear()[1], std::tan(angle), 1e-14);
  }
}

TEST(ShearWarpFactorization, PrincipalAxisIsChosenInIndexSpace)
{
  // 50 degrees from z towards x: nearer to x in physical space, but the voxels are four times longer along x
  const double angle = 50.0 * itk::Math::pi_over_180;
  const auto   view = MakeView(
    MakeMatrix({ { std::cos(angle), 0, std::sin(angle) }, { 0, 1, 0 }, { -std::sin(angle), 0, std::cos(angle) } }),
    MakePoint3(0, 0, 0));
  const ShearWarpFactorization isotropic(view, MakeGeometry({ { 9, 9, 9 } }, MakeVector3(1, 1, 1)), MakeGrid());
  EXPECT_EQ(isotropic.GetPrincipalAxis(), 0u);
  const ShearWarpFactorization anisotropic(view, MakeGeometry({ { 9, 9, 9 } }, MakeVector3(4, 1, 1)), MakeGrid());
  EXPECT_EQ(anisotropic.GetPrincipalAxis(), 2u);
  EXPECT_NEAR(anisotropic.GetShear()[0], -std::tan(angle) / 4, 1e-14);
}

TEST(ShearWarpFactorization, TranslationsAreHalfOfThePublishedOnes)
{
  Random random(102);
  int    negative = 0;
  for (int repeat = 0; repeat < 200; ++repeat)
  {
    const auto                   image = MakeRandomGeometry(random, 2, 12);
    const auto                   view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const ShearWarpFactorization factorization(view, image, MakeGrid());
    const auto &                 m = factorization.GetViewMatrix();
    const double                 determinant = m(0, 0) * m(1, 1) - m(1, 0) * m(0, 1);
    const double                 published[2] = { (m(1, 1) * m(0, 2) - m(0, 1) * m(1, 2)) / determinant,
                                                  (m(0, 0) * m(1, 2) - m(1, 0) * m(0, 2)) / determinant };
    const double                 last =
      static_cast<double>(image->GetLargestPossibleRegion().GetSize(factorization.GetPrincipalAxis())) - 1.0;
    for (unsigned int n = 0; n < 2; ++n)
    {
      EXPECT_NEAR(factorization.GetShear()[n], published[n], 1e-9);
      const double sign = published[n] < 0 ? -1.0 : 1.0;
      const double publishedTranslation = (sign - 1.0) * published[n] * last;
      EXPECT_NEAR(2.0 * factorization.GetTranslation()[n], publishedTranslation, 1e-8);
      // the slice furthest to the left begins at the image's first pixel; the published one leaves it empty
      const double leftmost = std::min(0.0, published[n] * last);
      EXPECT_NEAR(factorization.GetTranslation()[n] + leftmost, 0.0, 1e-8);
      EXPECT_NEAR(publishedTranslation + leftmost, published[n] < 0 ? -published[n] * last : 0.0, 1e-8);
      negative += published[n] < 0;
    }
  }
  EXPECT_GT(negative, 100);
}

TEST(ShearWarpFactorization, EveryLinearTransformClassWorks)
{
  auto translation = itk::TranslationTransform<double, 3>::New();
  translation->SetOffset(MakeVector3(3, -4, 5.5));

  auto scale = itk::ScaleTransform<double, 3>::New();
  scale->Scale(MakeVector3(0.7, 1.3, -2.0));
  scale->SetCenter(MakePoint3(1, 2, 3));

  auto euler = itk::Euler3DTransform<double>::New();
  euler->SetCenter(MakePoint3(4, 5, 6));
  euler->SetRotation(0.3, -0.9, 2.2);
  euler->SetTranslation(MakeVector3(1, 2, 3));

  auto versor = itk::VersorRigid3DTransform<double>::New();
  versor->SetRotation(MakeVector3(0.6, 0.0, 0.8), 1.1);
  versor->SetTranslation(MakeVector3(-1, 2, 9));

  auto similarity = itk::Similarity3DTransform<double>::New();
  similarity->SetRotation(MakeVector3(0.0, 0.6, 0.8), 2.1);
  similarity->SetScale(1.7);

  Random     random(103);
  const auto affine = MakeView(MakeRandomViewMatrix(random, ViewKind::Affine), MakePoint3(7, 8, 9));

  auto composite = itk::CompositeTransform<double, 3>::New();
  composite->AddTransform(euler);
  composite->AddTransform(translation);
  composite->AddTransform(scale);

  auto nested = itk::CompositeTransform<double, 3>::New();
  nested->AddTransform(composite);
  nested->AddTransform(versor);

  const auto image = GeometryType::New();
  SetRandomGeometry(random, image, { { 7, 9, 11 } });
  const auto grid = MakeGrid(0.5, 0.7, -10, 4);
  const auto identity = itk::IdentityTransform<double, 3>::New();
  for (const itk::Transform<double, 3, 3> * transform : std::initializer_list<const itk::Transform<double, 3, 3> *>{
         identity, translation, scale, euler, versor, similarity, affine, composite, nested })
  {
    SCOPED_TRACE(transform->GetNameOfClass());
    const ShearWarpFactorization factorization(transform, image, grid);
    ExpectFactors(factorization, transform, image, grid);
  }
}

TEST(ShearWarpFactorization, TransformErrorsNameTheValue)
{
  const auto verify = &ShearWarpFactorization::VerifyViewTransform;
  EXPECT_NAMES(verify(nullptr), "Transform", "not set");
  EXPECT_NAMES(verify(itk::BSplineTransform<double, 3>::New()), "Transform", "linear", "BSplineTransform");

  auto composite = itk::CompositeTransform<double, 3>::New();
  composite->AddTransform(itk::TranslationTransform<double, 3>::New());
  composite->AddTransform(itk::BSplineTransform<double, 3>::New());
  EXPECT_NAMES(verify(composite), "Transform", "linear", "CompositeTransform");

  auto                     view = ViewType::New();
  ViewType::ParametersType parameters = view->GetParameters();
  parameters[4] = std::numeric_limits<double>::quiet_NaN();
  view->SetParameters(parameters);
  EXPECT_NAMES(verify(view), "Transform", "finite", "nan");
  parameters[4] = 1.0;
  parameters[10] = std::numeric_limits<double>::infinity();
  view->SetParameters(parameters);
  EXPECT_NAMES(verify(view), "Transform", "finite", "inf");

  parameters.Fill(0.0);
  parameters[0] = 2.5;
  parameters[4] = 7.25;
  view->SetParameters(parameters);
  EXPECT_NAMES(verify(view), "Transform", "invertible", "2.5", "7.25", "determinant");
}

TEST(ShearWarpFactorization, TooManyIntermediateColumnsAreAnError)
{
  auto       image = itk::Image<unsigned char, 3>::New();
  const auto output = itk::Image<unsigned char, 2>::New();
  const auto factorize = [&] { ShearWarpFactorization(ViewType::New(), image, output); };
  image->SetRegions(itk::Size<3>{ { 1, 1, std::size_t{ 1 } << 31 } });
  EXPECT_NAMES(factorize(), "[1, 1, 2147483648] needs 2147483649");
  // a sum that overflows
  image->SetRegions(itk::Size<3>{ { std::numeric_limits<itk::SizeValueType>::max() / 2, 1, 7 } });
  EXPECT_NAMES(factorize(), "must have less than 2^31 columns and rows", "[9223372036854775807, 1, 7]");
  // a size that overflows
  image->SetRegions(itk::Size<3>{ { std::numeric_limits<itk::SizeValueType>::max() - 4, 1, 7 } });
  EXPECT_NAMES(factorize(), "less than 2^63", "[18446744073709551611, 1, 7]");
}

TEST(ShearWarpFactorization, OfEqualAxesTheLastIsPrincipal)
{
  Random random(312);
  for (int repeat = 0; repeat < 300; ++repeat)
  {
    const auto image = MakeRandomImage<unsigned char>(random, MakeRandomSize(random, 1, 3));
    MatrixType viewToIndex;
    viewToIndex.SetIdentity();
    const double sign = repeat % 2 == 0 ? 1 : -1;
    viewToIndex(0, 2) = sign;
    viewToIndex(1, 2) = repeat % 3 == 0 ? -sign : 0.3;
    const auto & spacing = image->GetSpacing();
    const auto   view = MakeView(image->GetDirection() * MakeDiagonal(spacing[0], spacing[1], spacing[2]) * viewToIndex,
                               GetCenter(image));
    const itk::ShearWarpFactorization factorization(view, image, itk::Image<unsigned char, 2>::New());
    EXPECT_EQ(factorization.GetPrincipalAxis(), 2u) << "in repetition " << repeat;
  }
}

TEST(ShearWarpFactorization, ConstructorAndProjectedGridVerifyTheTransform)
{
  const auto image = MakeGeometry({ { 3, 3, 3 } }, MakeVector3(1, 1, 1));
  const auto spline = itk::BSplineTransform<double, 3>::New();
  EXPECT_NAMES(ShearWarpFactorization(spline, image, MakeGrid()), "BSplineTransform");
  EXPECT_NAMES(ShearWarpFactorization::ComputeProjectedSpacing(spline, image), "BSplineTransform");
  ShearWarpFactorization::Point3Type lower, upper;
  EXPECT_NAMES(ShearWarpFactorization::ComputeViewBounds(spline, image, lower, upper), "BSplineTransform");
}

TEST(ShearWarpFactorization, SmallTransformsOfFullRankAreNotSingular)
{
  for (const double scale : { 1e-9, 1e-3, 1e6 })
  {
    EXPECT_NO_THROW(
      ShearWarpFactorization::VerifyViewTransform(MakeView(MakeDiagonal(scale, scale, scale), MakePoint3(0, 0, 0))));
  }
}

TEST(ShearWarpFactorization, ErrorsWhereNumbersOverflow)
{
  const auto                         image = MakeGeometry({ { 3, 3, 3 } }, MakeVector3(1, 1, 1));
  const auto                         small = MakeView(MakeDiagonal(1e-100, 1e-100, 1e-100), MakePoint3(0, 0, 0));
  ShearWarpFactorization::Point3Type lower, upper;
  image->SetOrigin(MakePoint3(0, 1e300, 0));
  EXPECT_NAMES(ShearWarpFactorization(small, image, MakeGrid()), "1e+300");
  EXPECT_NAMES(ShearWarpFactorization::ComputeViewBounds(small, image, lower, upper), "1e+300");

  const auto plain = MakeGeometry({ { 3, 3, 3 } }, MakeVector3(1e-10, 1, 1));
  const auto identity = MakeView(MakeDiagonal(1, 1, 1), MakePoint3(0, 0, 0));
  EXPECT_NO_THROW(ShearWarpFactorization(identity, plain, MakeGrid(1e290)).GetOutputToIntermediateMatrix());
  EXPECT_NAMES(ShearWarpFactorization(identity, plain, MakeGrid(1e300)).GetOutputToIntermediateMatrix(), "1e+300");
}

TEST(ShearWarpFactorization, FlatImagesHaveNoView)
{
  const auto image = MakeGeometry({ { 3, 6, 6 } }, MakeVector3(1, 1, 1));
  image->SetDirection(MakeMatrix({ { 1, 0, -2 }, { 0, 1, 1 }, { 0, 0, 1e-300 } }));
  Random     random(1);
  const auto view = MakeView(MakeRandomRotation(random), MakePoint3(0, 0, 0));
  EXPECT_NAMES(ShearWarpFactorization(view, image, MakeGrid()), "1e-300");
}

TEST(ShearWarpFactorization, ViewBoundsAreThoseOfTheEightCorners)
{
  Random random(104);
  for (int repeat = 0; repeat < 500; ++repeat)
  {
    const auto                         image = MakeRandomGeometry(random, 1, 12);
    const auto                         view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    ShearWarpFactorization::Point3Type lower, upper;
    ShearWarpFactorization::ComputeViewBounds(view, image, lower, upper);
    const auto [expectedLower, expectedUpper] = FindCornerBounds(view, image);
    for (unsigned int n = 0; n < 3; ++n)
    {
      ASSERT_NEAR(lower[n], expectedLower[n], 1e-9);
      ASSERT_NEAR(upper[n], expectedUpper[n], 1e-9);
    }
  }
}

TEST(ShearWarpFactorization, ProjectedSpacingIsTheSmallestScaledByTheTransform)
{
  Random     random(105);
  const auto image = MakeGeometry({ { 3, 3, 3 } }, MakeVector3(2.0, 0.75, 1.5));
  const auto rigid = MakeView(MakeRandomRotation(random), MakePoint3(0, 0, 0));
  const auto same = ShearWarpFactorization::ComputeProjectedSpacing(rigid, image);
  EXPECT_NEAR(same[0], 0.75, 1e-12);
  EXPECT_NEAR(same[1], 0.75, 1e-12);
  const auto scaled = MakeView(MakeRandomRotation(random) * MakeDiagonal(0.5, -3.0, 10.0), MakePoint3(0, 0, 0));
  const auto projected = ShearWarpFactorization::ComputeProjectedSpacing(scaled, image);
  EXPECT_NEAR(projected[0], 1.5, 1e-12);
  EXPECT_NEAR(projected[1], 0.25, 1e-12);
}

TEST(ShearWarpFactorization, ConversionsKeepTheGeometry)
{
  Random random(106);
  for (int repeat = 0; repeat < 100; ++repeat)
  {
    const auto volumeImage = MakeRandomGeometry(random, 1, 12);
    const auto transform = MakeRandomView(random, AllViewKinds[repeat % 3], volumeImage);
    const auto view = itk::ShearWarp::MakeView(transform);
    const auto volume = itk::ShearWarp::MakeVolumeGrid(volumeImage);
    const auto image = MakeGrid(0.5, random.Uniform(0.2, 3), -10, 4);
    const auto picture = itk::ShearWarp::MakePictureGrid(image);
    const auto region = volumeImage->GetLargestPossibleRegion();
    for (unsigned int row = 0; row < 3; ++row)
    {
      EXPECT_EQ(view.offset[row], transform->GetOffset()[row]);
      EXPECT_EQ(volume.size[row], static_cast<std::ptrdiff_t>(region.GetSize(row)));
      EXPECT_EQ(volume.spacing[row], volumeImage->GetSpacing()[row]);
      for (unsigned int column = 0; column < 3; ++column)
      {
        EXPECT_NEAR(view.matrix[row][column], transform->GetMatrix()(row, column), 1e-12);
      }
    }
    const double steps[] = { 1, 2, 3 };
    const auto   first = volumeImage->TransformIndexToPhysicalPoint<double>(region.GetIndex());
    const auto   other =
      volumeImage->TransformIndexToPhysicalPoint<double>(region.GetIndex() + itk::Offset<3>{ { 1, 2, 3 } });
    for (unsigned int row = 0; row < 3; ++row)
    {
      double expected = volume.indexToPhysical.offset[row];
      EXPECT_NEAR(first[row], expected, 1e-11);
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        expected += volume.indexToPhysical.matrix[row][axis] * steps[axis];
      }
      EXPECT_NEAR(other[row], expected, 1e-11);
    }
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      EXPECT_EQ(picture.size[axis], 8);
      EXPECT_EQ(picture.spacing[axis], image->GetSpacing()[axis]);
      EXPECT_EQ(picture.origin[axis], image->GetOrigin()[axis]);
    }
  }
  EXPECT_NAMES(itk::ShearWarp::MakeVolumeGrid(nullptr), "The input image is required but not set.");
  EXPECT_NAMES(itk::ShearWarp::MakePictureGrid(nullptr), "The output image is required but not set.");
}

TEST(ShearWarpFactorization, EmptyImagesHaveNoView)
{
  const auto image = MakeGeometry({ { 3, 0, 3 } }, MakeVector3(1, 1, 1));
  EXPECT_NAMES(ShearWarpFactorization(ViewType::New(), image, MakeGrid()), "must not be empty", "[3, 0, 3]");
}

TEST(ShearWarpFactorization, ExceptionsOfTheEngineBecomeExceptionsOfITK)
{
  using itk::ShearWarp::CallEngine;
  int        called = 0;
  const auto getReference = [&called]() -> int & { return ++called; };
  EXPECT_EQ(&CallEngine(getReference), &called);
  EXPECT_EQ(called, 1);
  EXPECT_NAMES(CallEngine([] { throw itk::ShearWarp::InvalidParameter("Oversampling is 3"); }), "Oversampling is 3");
  EXPECT_NAMES(CallEngine([] { throw itk::ShearWarp::OutOfMemory("no 12 bytes"); }), "no 12 bytes");
  EXPECT_THROW(CallEngine([] { throw itk::ShearWarp::OutOfMemory("no 12 bytes"); }), itk::MemoryAllocationError);
  // exceptions of others are unchanged
  EXPECT_THROW(CallEngine([] { throw std::bad_alloc(); }), std::bad_alloc);
  EXPECT_THROW(CallEngine([] { throw std::invalid_argument("a"); }), std::invalid_argument);
  EXPECT_THROW(CallEngine([] { throw itk::ProcessAborted(); }), itk::ProcessAborted);
}
