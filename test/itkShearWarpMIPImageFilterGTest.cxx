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
#include "itkShearWarpMIPImageFilter.h"

#include "itkShearWarpMIPTestOracle.h"

#include "itkImageRegionConstIteratorWithIndex.h"
#include "itkLinearInterpolateImageFunction.h"
#include "itkMaximumProjectionImageFilter.h"
#include "itkResampleImageFilter.h"

#include <gtest/gtest.h>

#include <set>
#include <utility>

namespace
{
using namespace itk::ShearWarpMIPTest;

template <typename TPixel>
using FilterOf = itk::ShearWarpMIPImageFilter<itk::Image<TPixel, 3>>;
template <typename TPixel>
using OutputOf = itk::Image<TPixel, 2>;

template <typename TPixel>
typename FilterOf<TPixel>::Pointer
MakeFilter(const itk::Image<TPixel, 3> * image, const ViewType * view)
{
  auto filter = FilterOf<TPixel>::New();
  filter->SetInput(image);
  filter->SetTransform(view);
  return filter;
}

template <typename TPixel>
typename OutputOf<TPixel>::Pointer
Project(const itk::Image<TPixel, 3> * image, const ViewType * view)
{
  const auto filter = MakeFilter(image, view);
  filter->Update();
  typename OutputOf<TPixel>::Pointer output = filter->GetOutput();
  output->DisconnectPipeline();
  return output;
}

/** A grid of random size, spacing and place that meets the projected image. */
template <typename TFilter>
void
SetRandomGrid(Random & random, TFilter * filter, const ViewType * view, const itk::ImageBase<3> * image)
{
  const PointType       center = view->GetInverseTransform()->TransformPoint(GetCenter(image));
  const auto            spacing = MakeVector2(random.Uniform(0.3, 2.5), random.Uniform(0.3, 2.5));
  itk::Size<2>          size;
  itk::Point<double, 2> origin;
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    size[axis] = static_cast<itk::SizeValueType>(random.Integer(5, 32));
    origin[axis] = center[axis] - spacing[axis] * random.Uniform(0.2, 0.8) * static_cast<double>(size[axis]);
  }
  filter->SetSize(size);
  filter->SetOutputSpacing(spacing);
  filter->SetOutputOrigin(origin);
}

/** View along index axis \a axis of an image with identity direction, with the other axes in their order. */
ViewType::Pointer
MakeAxisView(unsigned int axis)
{
  const double u[] = { axis == 0 ? 0.0 : 1.0, axis == 0 ? 1.0 : 0.0, 0.0 };
  const double v[] = { 0.0, axis == 2 ? 1.0 : 0.0, axis == 2 ? 0.0 : 1.0 };
  const double w[] = { axis == 0 ? 1.0 : 0.0, axis == 1 ? 1.0 : 0.0, axis == 2 ? 1.0 : 0.0 };
  return MakeView(MakeMatrix({ { u[0], v[0], w[0] }, { u[1], v[1], w[1] }, { u[2], v[2], w[2] } }),
                  MakePoint3(0, 0, 0));
}

/** The position of index (u, v, w) of the first or last voxels' outer corners, in view space. */
template <typename TFunction>
void
ForEachCorner(const itk::ImageBase<3> * image, const ViewType * view, const TFunction & function)
{
  const auto & region = image->GetLargestPossibleRegion();
  for (int corner = 0; corner < 8; ++corner)
  {
    itk::ContinuousIndex<double, 3> index;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      index[axis] = static_cast<double>(region.GetIndex(axis)) - 0.5 +
                    ((corner >> axis & 1) ? static_cast<double>(region.GetSize(axis)) : 0.0);
    }
    PointType physical;
    image->TransformContinuousIndexToPhysicalPoint(index, physical);
    function(view->GetInverseTransform()->TransformPoint(physical));
  }
}

template <typename TPixel>
class ShearWarpMIPImageFilterTyped : public testing::Test
{};
using PixelTypes = testing::
  Types<unsigned char, signed char, short, unsigned short, int, unsigned int, long long, unsigned long, float, double>;
TYPED_TEST_SUITE(ShearWarpMIPImageFilterTyped, PixelTypes, );
} // namespace

TYPED_TEST(ShearWarpMIPImageFilterTyped, HasTheBitsOfABruteForceEvaluation)
{
  Random                                  random(401);
  std::set<std::pair<unsigned int, bool>> axes;
  for (int repeat = 0; repeat < 400; ++repeat)
  {
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, repeat % 4 == 0 ? 3 : 17));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto background = MakeRandomPixel<TypeParam>(random);
    const auto filter = MakeFilter<TypeParam>(image, view);
    SetRandomGrid(random, filter.GetPointer(), view, image);
    filter->SetDefaultPixelValue(background);
    const int oversampling = repeat / 4 % 2 + 1;
    filter->SetOversampling(oversampling);
    filter->Update();

    BruteForceProjection<TypeParam> bruteForce(view, image, oversampling);
    const auto                      expected = bruteForce.Evaluate(filter->GetOutput(), background);
    ASSERT_TRUE(HaveSamePixels(expected.GetPointer(), filter->GetOutput())) << "in repetition " << repeat;
    ASSERT_EQ(filter->GetPrincipalAxis(), bruteForce.GetPrincipalAxis());
    axes.insert({ bruteForce.GetPrincipalAxis(), bruteForce.LooksAlongAxis() });

    const TypeParam * voxels = image->GetBufferPointer();
    const auto        count = image->GetBufferedRegion().GetNumberOfPixels();
    const auto        range = std::minmax_element(voxels, voxels + count);
    const TypeParam * pixels = filter->GetOutput()->GetBufferPointer();
    for (itk::SizeValueType n = 0; n < filter->GetOutput()->GetBufferedRegion().GetNumberOfPixels(); ++n)
    {
      ASSERT_TRUE(pixels[n] == background || (*range.first <= pixels[n] && pixels[n] <= *range.second));
    }
  }
  EXPECT_EQ(axes.size(), 6u) << "every axis from both sides";
}

TYPED_TEST(ShearWarpMIPImageFilterTyped, FittedGridHasTheBitsOfABruteForceEvaluation)
{
  Random random(402);
  for (int repeat = 0; repeat < 100; ++repeat)
  {
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 12));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter<TypeParam>(image, view);
    filter->Update();
    BruteForceProjection<TypeParam> bruteForce(view, image);
    const auto                      expected = bruteForce.Evaluate(filter->GetOutput(), TypeParam{});
    ASSERT_TRUE(HaveSamePixels(expected.GetPointer(), filter->GetOutput())) << "in repetition " << repeat;
  }
}

TYPED_TEST(ShearWarpMIPImageFilterTyped, AxisAlignedViewsEqualMaximumProjectionImageFilter)
{
  Random random(403);
  for (const itk::Size<3> & size : { itk::Size<3>{ { 7, 12, 9 } }, { { 33, 5, 20 } }, { { 1, 1, 1 } } })
  {
    auto image = itk::Image<TypeParam, 3>::New();
    image->SetRegions(itk::ImageRegion<3>({ { 3, -5, 8 } }, size));
    image->SetSpacing(MakeVector3(0.75, 1.5, 2.25));
    image->SetOrigin(MakePoint3(-10, 20, 30));
    image->Allocate();
    FillRandom(random, image.GetPointer());
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      using ProjectionType = itk::MaximumProjectionImageFilter<itk::Image<TypeParam, 3>, itk::Image<TypeParam, 3>>;
      auto projection = ProjectionType::New();
      projection->SetInput(image);
      projection->SetProjectionDimension(axis);
      projection->Update();

      const unsigned int columnAxis = axis == 0 ? 1 : 0;
      const unsigned int rowAxis = axis == 2 ? 1 : 2;
      for (const double side : { 1.0, -1.0 })
      {
        auto view = MakeAxisView(axis);
        view->SetMatrix(view->GetMatrix() * MakeDiagonal(1, 1, side));
        const auto filter = MakeFilter<TypeParam>(image, view);
        filter->SetOutputSpacing(MakeVector2(image->GetSpacing()[columnAxis], image->GetSpacing()[rowAxis]));
        filter->Update();
        const auto * output = filter->GetOutput();
        ASSERT_EQ(output->GetLargestPossibleRegion().GetSize(0), size[columnAxis]);
        ASSERT_EQ(output->GetLargestPossibleRegion().GetSize(1), size[rowAxis]);
        PointType firstVoxel;
        image->TransformIndexToPhysicalPoint(image->GetBufferedRegion().GetIndex(), firstVoxel);
        EXPECT_NEAR(output->GetOrigin()[0], firstVoxel[columnAxis], 1e-9);
        EXPECT_NEAR(output->GetOrigin()[1], firstVoxel[rowAxis], 1e-9);
        EXPECT_EQ(filter->GetPrincipalAxis(), axis);
        EXPECT_TRUE(std::equal(output->GetBufferPointer(),
                               output->GetBufferPointer() + size[columnAxis] * size[rowAxis],
                               projection->GetOutput()->GetBufferPointer()))
          << "along axis " << axis << " of " << size;
      }
    }
  }
}

TYPED_TEST(ShearWarpMIPImageFilterTyped, ConstantImageGivesTheConstantOrTheBackgroundAndNothingBetween)
{
  Random random(404);
  for (int repeat = 0; repeat < 200; ++repeat)
  {
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 14));
    const auto constant = MakeRandomPixel<TypeParam>(random);
    const auto background = static_cast<TypeParam>(constant / 2 + 1);
    image->FillBuffer(constant);
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter<TypeParam>(image, view);
    filter->SetDefaultPixelValue(background);
    if (repeat % 2 == 0)
    {
      SetRandomGrid(random, filter.GetPointer(), view, image);
    }
    filter->Update();
    const TypeParam * pixels = filter->GetOutput()->GetBufferPointer();
    int               inside = 0;
    for (itk::SizeValueType n = 0; n < filter->GetOutput()->GetBufferedRegion().GetNumberOfPixels(); ++n)
    {
      ASSERT_TRUE(pixels[n] == constant || pixels[n] == background) << +pixels[n];
      inside += pixels[n] == constant;
    }
    EXPECT_GT(inside, 0);
  }
}

TYPED_TEST(ShearWarpMIPImageFilterTyped, AnyNumberOfWorkUnitsGivesTheSameBits)
{
  Random random(405);
  for (int repeat = 0; repeat < 40; ++repeat)
  {
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 40));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter<TypeParam>(image, view);
    filter->SetNumberOfWorkUnits(1);
    filter->Update();
    const auto expected = Copy(filter->GetOutput());
    for (const unsigned int workUnits : { 2, 3, 7, 16 })
    {
      filter->SetNumberOfWorkUnits(workUnits);
      filter->ReleasePreparedVolume();
      filter->Modified();
      filter->Update();
      ASSERT_TRUE(HaveSamePixels(expected.GetPointer(), filter->GetOutput())) << workUnits << " work units";
    }
  }
}

TYPED_TEST(ShearWarpMIPImageFilterTyped, StartIndexOnlyMovesTheImage)
{
  Random random(406);
  for (int repeat = 0; repeat < 60; ++repeat)
  {
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 12));
    PointType  firstVoxel;
    image->TransformIndexToPhysicalPoint(image->GetBufferedRegion().GetIndex(), firstVoxel);
    auto same = itk::Image<TypeParam, 3>::New();
    same->CopyInformation(image);
    same->SetOrigin(firstVoxel);
    same->SetRegions(image->GetBufferedRegion().GetSize());
    same->SetPixelContainer(image->GetPixelContainer());
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto expected = Project<TypeParam>(image, view);
    const auto output = Project<TypeParam>(same, view);
    EXPECT_TRUE(HaveSamePixels(expected.GetPointer(), output.GetPointer())) << "in repetition " << repeat;
    EXPECT_NEAR((expected->GetOrigin() - output->GetOrigin()).GetNorm(), 0.0, 1e-9);
  }
}

TYPED_TEST(ShearWarpMIPImageFilterTyped, MirroredViewMirrorsTheOutput)
{
  Random random(407);
  for (int repeat = 0; repeat < 60; ++repeat)
  {
    const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 12));
    const auto view = MakeRandomView(random, ViewKind::Rigid, image);
    const auto mirrored =
      MakeView(view->GetMatrix() * MakeDiagonal(-1, 1, 1), PointType(view->GetOffset().GetDataPointer()));
    const auto expected = Project<TypeParam>(image, view);
    const auto output = Project<TypeParam>(image, mirrored);
    const auto size = output->GetBufferedRegion().GetSize();
    ASSERT_EQ(size, expected->GetBufferedRegion().GetSize());
    for (itk::SizeValueType row = 0; row < size[1]; ++row)
    {
      const TypeParam * there = expected->GetBufferPointer() + row * size[0];
      const TypeParam * here = output->GetBufferPointer() + row * size[0];
      ASSERT_TRUE(std::equal(here, here + size[0], std::make_reverse_iterator(there + size[0])))
        << "in row " << row << " of repetition " << repeat;
    }
  }
}

TEST(ShearWarpMIPImageFilter, BrightVoxelLandsWhereTheGeometrySays)
{
  Random random(408);
  for (int repeat = 0; repeat < 400; ++repeat)
  {
    const auto image = MakeRandomImage<unsigned short>(random, MakeRandomSize(random, 6, 20));
    image->FillBuffer(0);
    itk::Index<3> index = image->GetBufferedRegion().GetIndex();
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      index[axis] += random.Integer(2, static_cast<std::int64_t>(image->GetBufferedRegion().GetSize(axis)) - 3);
    }
    image->SetPixel(index, 60000);
    PointType physical;
    image->TransformIndexToPhysicalPoint(index, physical);
    const auto      view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const PointType expected = view->GetInverseTransform()->TransformPoint(physical);

    // half an intermediate pixel, in the view plane: its longest diagonal
    const auto smallest = itk::ShearWarpFactorization::ComputeProjectedSpacing(view, image);
    const auto filter = MakeFilter<unsigned short>(image, view);
    filter->SetOutputSpacing(smallest * 0.25);
    filter->Update();
    const itk::ShearWarpFactorization factorization(view, image, filter->GetOutput());
    const auto                        warp = factorization.GetWarpMatrix();

    const auto *                                                     output = filter->GetOutput();
    double                                                           brightest = 0.0;
    double                                                           mass = 0.0;
    double                                                           moment[2] = { 0.0, 0.0 };
    itk::Point<double, 2>                                            brightestPosition;
    itk::ImageRegionConstIteratorWithIndex<OutputOf<unsigned short>> it(output, output->GetBufferedRegion());
    for (; !it.IsAtEnd(); ++it)
    {
      itk::Point<double, 2> position;
      output->TransformIndexToPhysicalPoint(it.GetIndex(), position);
      mass += it.Get();
      moment[0] += it.Get() * position[0];
      moment[1] += it.Get() * position[1];
      if (it.Get() > brightest)
      {
        brightest = it.Get();
        brightestPosition = position;
      }
    }
    ASSERT_GT(mass, 0.0) << "in repetition " << repeat;
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      const double halfPixel = 0.5 * (std::abs(warp(axis, 0)) + std::abs(warp(axis, 1)));
      EXPECT_NEAR(brightestPosition[axis], expected[axis], 0.5 * output->GetSpacing()[axis] + halfPixel)
        << "in repetition " << repeat;
      EXPECT_NEAR(moment[axis] / mass, expected[axis], 0.1 * smallest[axis]) << "in repetition " << repeat;
    }
  }
}

TEST(ShearWarpMIPImageFilter, AgreesWithFineResamplingOfASmoothImage)
{
  using ImageType = itk::Image<float, 3>;
  Random random(409);
  // Gaussians of at least sigma = 4 voxels: second derivatives along an axis are below amplitude / sigma^2
  constexpr double amplitude = 1000.0;
  constexpr double sigma = 4.0;
  auto             image = ImageType::New();
  image->SetRegions(itk::Size<3>{ { 48, 44, 40 } });
  image->SetSpacing(MakeVector3(0.8, 1.0, 1.3));
  image->SetDirection(MakeRandomRotation(random));
  image->SetOrigin(MakePoint3(40, -30, 20));
  image->Allocate();
  const double centers[][4] = { { 22, 20, 19, 1.0 }, { 27, 25, 21, 0.7 }, { 19, 24, 17, 0.5 } };
  itk::ImageRegionIteratorWithIndex<ImageType> voxel(image, image->GetBufferedRegion());
  for (; !voxel.IsAtEnd(); ++voxel)
  {
    double value = 0.0;
    for (const auto & center : centers)
    {
      double squared = 0.0;
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        const double distance = (static_cast<double>(voxel.GetIndex()[axis]) - center[axis]) / sigma;
        squared += distance * distance;
      }
      value += amplitude * center[3] * std::exp(-0.5 * squared);
    }
    voxel.Set(static_cast<float>(value));
  }

  // linear interpolation on an axis is off by f''/8; here there are four more of them than in the resampling
  const double bound = amplitude / (sigma * sigma) * 4.0 / 8.0;
  for (int repeat = 0; repeat < 6; ++repeat)
  {
    const auto view =
      MakeView(MakeRandomViewMatrix(random, repeat % 2 == 0 ? ViewKind::Rigid : ViewKind::Mirrored), GetCenter(image));
    const auto filter = MakeFilter<float>(image, view);
    filter->SetOutputSpacing(MakeVector2(1.1, 1.1));
    filter->Update();
    const auto * output = filter->GetOutput();

    constexpr double step = 0.2;
    using ResampleType = itk::ResampleImageFilter<ImageType, ImageType>;
    auto resample = ResampleType::New();
    resample->SetInput(image);
    resample->SetTransform(view);
    const auto   size = output->GetBufferedRegion().GetSize();
    itk::Size<3> resampledSize{ { size[0], size[1], 450 } };
    resample->SetSize(resampledSize);
    resample->SetOutputSpacing(MakeVector3(1.1, 1.1, step));
    resample->SetOutputOrigin(MakePoint3(output->GetOrigin()[0], output->GetOrigin()[1], -step * 225));
    using ProjectionType = itk::MaximumProjectionImageFilter<ImageType, ImageType>;
    auto projection = ProjectionType::New();
    projection->SetInput(resample->GetOutput());
    projection->SetProjectionDimension(2);
    projection->Update();

    const float * expected = projection->GetOutput()->GetBufferPointer();
    double        largest = 0.0;
    for (itk::SizeValueType n = 0; n < size[0] * size[1]; ++n)
    {
      largest = std::max(largest, std::abs(static_cast<double>(output->GetBufferPointer()[n]) - expected[n]));
    }
    EXPECT_LT(largest, bound);
    EXPECT_GT(*std::max_element(expected, expected + size[0] * size[1]), amplitude);
  }
}

TEST(ShearWarpMIPImageFilter, FittedGridHoldsTheWholeImageAtEveryViewAndNoMore)
{
  Random random(410);
  for (int repeat = 0; repeat < 300; ++repeat)
  {
    const auto image = MakeRandomImage<unsigned char>(random, MakeRandomSize(random, 1, 10));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeFilter<unsigned char>(image, view);
    filter->UpdateOutputInformation();
    const auto * output = filter->GetOutput();
    const auto & size = output->GetLargestPossibleRegion().GetSize();

    double lower[2] = { 1e9, 1e9 };
    double upper[2] = { -1e9, -1e9 };
    ForEachCorner(image, view, [&](const PointType & corner) {
      for (unsigned int axis = 0; axis < 2; ++axis)
      {
        lower[axis] = std::min(lower[axis], corner[axis]);
        upper[axis] = std::max(upper[axis], corner[axis]);
      }
    });
    double smallest = image->GetSpacing()[0];
    smallest = std::min({ smallest, image->GetSpacing()[1], image->GetSpacing()[2] });
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      const double spacing = output->GetSpacing()[axis];
      const double begin = output->GetOrigin()[axis] - 0.5 * spacing;
      const double end = begin + spacing * static_cast<double>(size[axis]);
      const double slack = 1e-4 * spacing;
      ASSERT_LE(begin, lower[axis] + slack);
      ASSERT_GE(end, upper[axis] - slack);
      ASSERT_LT(end - begin, std::max(spacing, upper[axis] - lower[axis] + spacing) + slack);
      ASSERT_NEAR(begin + end, lower[axis] + upper[axis], 1e-8) << "centered on the image";

      PointType ahead = MakePoint3(0, 0, 0);
      ahead[axis] = 1.0;
      const auto scale = (view->TransformPoint(ahead) - view->TransformPoint(MakePoint3(0, 0, 0))).GetNorm();
      ASSERT_NEAR(spacing * scale, smallest, 1e-9) << "a step of a pixel is the smallest spacing in physical space";
    }
    EXPECT_EQ(output->GetDirection(), OutputOf<unsigned char>::DirectionType(itk::Matrix<double, 2, 2>::GetIdentity()));
    EXPECT_EQ(output->GetLargestPossibleRegion().GetIndex(), (itk::Index<2>{ { 0, 0 } }));
  }
}

TEST(ShearWarpMIPImageFilter, PartsOfTheGridThatAreSetStayAndTheOthersAreFitted)
{
  const auto image = MakePlainImage<unsigned char>({ { 20, 10, 5 } });
  // corners of the image are at -0.5 and 19.5, 9.5
  const auto filter = MakeFilter<unsigned char>(image, MakeAxisView(2));
  const auto expectGrid = [&](itk::Size<2> size, double spacingU, double spacingV, double originU, double originV) {
    filter->UpdateOutputInformation();
    const auto * output = filter->GetOutput();
    EXPECT_EQ(output->GetLargestPossibleRegion().GetSize(), size);
    EXPECT_NEAR(output->GetSpacing()[0], spacingU, 1e-12);
    EXPECT_NEAR(output->GetSpacing()[1], spacingV, 1e-12);
    EXPECT_NEAR(output->GetOrigin()[0], originU, 1e-9);
    EXPECT_NEAR(output->GetOrigin()[1], originV, 1e-9);
  };
  {
    SCOPED_TRACE("nothing is set");
    expectGrid({ { 20, 10 } }, 1, 1, 0, 0);
  }
  {
    SCOPED_TRACE("Size alone is centered");
    filter->SetSize({ { 6, 13 } });
    expectGrid({ { 6, 13 } }, 1, 1, 7, -1.5);
    filter->FitOutputGrid();
    expectGrid({ { 20, 10 } }, 1, 1, 0, 0);
  }
  {
    SCOPED_TRACE("OutputSpacing alone");
    filter->SetOutputSpacing(MakeVector2(2.0, 3.0));
    // 4 pixels of 3 mm are 2 mm too long
    expectGrid({ { 10, 4 } }, 2, 3, 0.5, 0.0);
    filter->FitOutputGrid();
  }
  {
    SCOPED_TRACE("OutputOrigin alone reaches to the far end");
    filter->SetOutputOrigin(MakePoint2(-4.0, 7.25));
    expectGrid({ { 24, 3 } }, 1, 1, -4, 7.25);
    filter->SetOutputOrigin(MakePoint2(100.0, 100.0));
    expectGrid({ { 1, 1 } }, 1, 1, 100, 100);
    filter->FitOutputGrid();
  }
  {
    SCOPED_TRACE("OutputSpacing and Size");
    filter->SetOutputSpacing(MakeVector2(2.0, 3.0));
    filter->SetSize({ { 3, 5 } });
    expectGrid({ { 3, 5 } }, 2, 3, 9.5 - 2, 4.5 - 6);
    filter->FitOutputGrid();
  }
  {
    SCOPED_TRACE("OutputSpacing and OutputOrigin");
    filter->SetOutputSpacing(MakeVector2(2.0, 2.0));
    filter->SetOutputOrigin(MakePoint2(0.5, 0.5));
    expectGrid({ { 10, 5 } }, 2, 2, 0.5, 0.5);
    filter->FitOutputGrid();
  }
  {
    SCOPED_TRACE("all of them");
    filter->SetSize({ { 4, 3 } });
    filter->SetOutputSpacing(MakeVector2(0.5, 0.25));
    filter->SetOutputOrigin(MakePoint2(-1, -2));
    expectGrid({ { 4, 3 } }, 0.5, 0.25, -1, -2);
    EXPECT_EQ(filter->GetSize(), (itk::Size<2>{ { 4, 3 } }));
    EXPECT_EQ(filter->GetOutputSpacing(), MakeVector2(0.5, 0.25));
    EXPECT_EQ(filter->GetOutputOrigin(), MakePoint2(-1, -2));
  }
}

/** Files have spacings in float, and their multiples in double. */
TEST(ShearWarpMIPImageFilter, FittedGridNeedsNoPixelForRoundingErrorsOfFiles)
{
  const auto image = MakePlainImage<unsigned char>({ { 192, 3, 10 } });
  const auto filter = MakeFilter<unsigned char>(image, MakeAxisView(2));
  for (const auto & [excess, columns] :
       { std::pair(5e-6, 192U), std::pair(9e-5, 192U), std::pair(2e-4, 193U), std::pair(-2e-4, 192U) })
  {
    filter->SetOutputSpacing(MakeVector2(192.0 / (192.0 + excess), 1.0));
    filter->UpdateOutputInformation();
    const auto * output = filter->GetOutput();
    EXPECT_EQ(output->GetLargestPossibleRegion().GetSize(), (itk::Size<2>{ { columns, 3 } })) << excess;
    // in the middle of the image
    const double middle = output->GetOrigin()[0] + 0.5 * (columns - 1) * output->GetSpacing()[0];
    EXPECT_NEAR(middle, 95.5, 1e-9);
  }
}

TEST(ShearWarpMIPImageFilter, FittedGridIsFinite)
{
  const auto image = MakePlainImage<unsigned char>({ { 4, 4, 4 } });
  image->SetOrigin(MakePoint3(1.2e308, 0, 0));
  const auto filter = MakeFilter<unsigned char>(image, MakeAxisView(2));
  EXPECT_THROW(filter->UpdateOutputInformation(), itk::ExceptionObject);
  image->SetOrigin(MakePoint3(0.8e308, 0, 0));
  EXPECT_NO_THROW(filter->UpdateOutputInformation());
}

TEST(ShearWarpMIPImageFilter, OneVoxelThickImagesProjectFromEverySide)
{
  for (unsigned int thin = 0; thin < 4; ++thin)
  {
    itk::Size<3> size{ { 6, 6, 6 } };
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      if (thin == 3 || axis == thin)
      {
        size[axis] = 1;
      }
    }
    const auto image = MakePlainImage<unsigned char>(size, 200);
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const auto output = Project<unsigned char>(image, MakeAxisView(axis));
      EXPECT_EQ(output->GetBufferedRegion().GetSize(0), size[axis == 0 ? 1 : 0]);
      EXPECT_EQ(output->GetBufferedRegion().GetSize(1), size[axis == 2 ? 1 : 2]);
      const auto * pixels = output->GetBufferPointer();
      EXPECT_EQ(std::count(pixels, pixels + output->GetBufferedRegion().GetNumberOfPixels(), 200),
                static_cast<std::ptrdiff_t>(output->GetBufferedRegion().GetNumberOfPixels()))
        << "thin axis " << thin << ", along axis " << axis;
    }
    Random random(411);
    for (int repeat = 0; repeat < 20; ++repeat)
    {
      const auto   output = Project<unsigned char>(image, MakeRandomView(random, ViewKind::Rigid, image));
      const auto * pixels = output->GetBufferPointer();
      EXPECT_GT(std::count(pixels, pixels + output->GetBufferedRegion().GetNumberOfPixels(), 200), 0);
    }
  }
}

TEST(ShearWarpMIPImageFilter, DefaultPixelValueIsWhereTheImageIsNot)
{
  const auto image = MakePlainImage<short>({ { 4, 4, 4 } }, -100);
  const auto filter = MakeFilter<short>(image, MakeAxisView(2));
  filter->SetDefaultPixelValue(-1024);
  filter->SetSize({ { 10, 10 } });
  filter->Update();
  itk::ImageRegionConstIteratorWithIndex<OutputOf<short>> it(filter->GetOutput(),
                                                             filter->GetOutput()->GetBufferedRegion());
  for (; !it.IsAtEnd(); ++it)
  {
    const auto & index = it.GetIndex();
    const bool   isInside = index[0] >= 3 && index[0] < 7 && index[1] >= 3 && index[1] < 7;
    EXPECT_EQ(it.Get(), isInside ? -100 : -1024) << index;
  }

  filter->SetOutputOrigin(MakePoint2(50, 50));
  filter->Update();
  const short * pixels = filter->GetOutput()->GetBufferPointer();
  EXPECT_EQ(std::count(pixels, pixels + 100, -1024), 100) << "the grid misses the image";

  filter->SetDefaultPixelValue(0);
  filter->Update();
  EXPECT_EQ(std::count(filter->GetOutput()->GetBufferPointer(), filter->GetOutput()->GetBufferPointer() + 100, 0), 100);
}

TEST(ShearWarpMIPImageFilter, FootprintIsTheImagesPhysicalExtent)
{
  // the outer voxels reach half a voxel beyond their centers
  const auto image = MakePlainImage<unsigned char>({ { 8, 6, 5 } }, 9);
  const auto filter = MakeFilter<unsigned char>(image, MakeAxisView(2));
  filter->SetOutputSpacing(MakeVector2(0.25, 0.25));
  filter->SetOutputOrigin(MakePoint2(-1.375, -1.375));
  filter->SetSize({ { 44, 36 } });
  filter->Update();
  itk::ImageRegionConstIteratorWithIndex<OutputOf<unsigned char>> it(filter->GetOutput(),
                                                                     filter->GetOutput()->GetBufferedRegion());
  double                                                          first[2] = { 1e9, 1e9 };
  double                                                          last[2] = { -1e9, -1e9 };
  for (; !it.IsAtEnd(); ++it)
  {
    if (it.Get() == 9)
    {
      itk::Point<double, 2> position;
      filter->GetOutput()->TransformIndexToPhysicalPoint(it.GetIndex(), position);
      for (unsigned int axis = 0; axis < 2; ++axis)
      {
        first[axis] = std::min(first[axis], position[axis]);
        last[axis] = std::max(last[axis], position[axis]);
      }
    }
  }
  // between half a voxel and the warp's whole one
  EXPECT_LE(first[0], -0.375);
  EXPECT_LE(first[1], -0.375);
  EXPECT_GE(last[0], 7.375);
  EXPECT_GE(last[1], 5.375);
  EXPECT_GT(first[0], -1.0);
  EXPECT_LT(last[0], 8.0);
}

template <typename TPixel>
void
ExpectNotANumberStaysAway()
{
  Random     random(412);
  const auto image = MakeRandomImage<TPixel>(random, { { 9, 8, 7 } });
  for (itk::SizeValueType n = 0; n < image->GetBufferedRegion().GetNumberOfPixels(); n += 5)
  {
    image->GetBufferPointer()[n] = std::numeric_limits<TPixel>::quiet_NaN();
  }
  for (int repeat = 0; repeat < 20; ++repeat)
  {
    const auto                   view = MakeRandomView(random, ViewKind::Affine, image);
    const auto                   output = Project<TPixel>(image, view);
    BruteForceProjection<TPixel> bruteForce(view, image);
    EXPECT_TRUE(HaveSamePixels(bruteForce.Evaluate(output, TPixel{}).GetPointer(), output.GetPointer()));
    const TPixel * pixels = output->GetBufferPointer();
    EXPECT_TRUE(std::none_of(pixels, pixels + output->GetBufferedRegion().GetNumberOfPixels(), [](TPixel pixel) {
      return std::isnan(pixel);
    }));
  }

  image->FillBuffer(std::numeric_limits<TPixel>::quiet_NaN());
  image->Modified();
  const auto filter = MakeFilter<TPixel>(image, MakeAxisView(1));
  filter->SetDefaultPixelValue(TPixel(-3.5));
  filter->Update();
  const TPixel * pixels = filter->GetOutput()->GetBufferPointer();
  const auto     count = filter->GetOutput()->GetBufferedRegion().GetNumberOfPixels();
  EXPECT_EQ(std::count(pixels, pixels + count, TPixel(-3.5)), static_cast<std::ptrdiff_t>(count));
}

TEST(ShearWarpMIPImageFilter, NotANumberInTheImageStaysAwayFromTheOutput)
{
  ExpectNotANumberStaysAway<float>();
  ExpectNotANumberStaysAway<double>();
}
