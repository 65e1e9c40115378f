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

#include "itkLinearInterpolateImageFunction.h"
#include "itkMaximumProjectionImageFilter.h"
#include "itkResampleImageFilter.h"

#include <utility>

namespace
{
using namespace itk::ShearWarpMIPTest;

template <typename TImagePointer>
auto
Project(const TImagePointer & image, const ViewType * view)
{
  const auto filter = MakeFilter(image, view);
  filter->Update();
  return Copy(filter->GetOutput());
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
  SetGrid(filter, size, spacing, origin);
}

ViewType::Pointer
MakeAxisView(unsigned int axis)
{
  return MakeView(MakeAxisMatrix(axis), PointType(0.0));
}

/** Whether all pixels are \a value. */
template <typename TPixel>
bool
IsConstant(const itk::Image<TPixel, 2> * image, TPixel value)
{
  const auto pixels = GetPixels(image);
  return std::all_of(pixels.begin(), pixels.end(), [=](TPixel pixel) { return pixel == value; });
}

template <typename TPixel>
class ShearWarpMIPImageFilterTyped : public testing::Test
{};
using PixelTypes = itk::ShearWarpMIPTest::TestedTypes<char,
                                                      unsigned char,
                                                      signed char,
                                                      short,
                                                      unsigned short,
                                                      int,
                                                      unsigned int,
                                                      long,
                                                      unsigned long,
                                                      long long,
                                                      unsigned long long,
                                                      float,
                                                      double>;
TYPED_TEST_SUITE(ShearWarpMIPImageFilterTyped, PixelTypes, );
} // namespace

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
        const auto view = MakeView(MakeAxisMatrix(axis) * MakeDiagonal(1, 1, side), PointType(0.0));
        const auto filter = MakeFilter(image, view);
        filter->SetOutputSpacing(MakeVector2(image->GetSpacing()[columnAxis], image->GetSpacing()[rowAxis]));
        filter->Update();
        const auto * output = filter->GetOutput();
        ASSERT_EQ(output->GetLargestPossibleRegion().GetSize(0), size[columnAxis]);
        ASSERT_EQ(output->GetLargestPossibleRegion().GetSize(1), size[rowAxis]);
        const auto & first = image->GetBufferedRegion().GetIndex();
        const auto   firstVoxel = image->template TransformIndexToPhysicalPoint<double>(first);
        EXPECT_NEAR(output->GetOrigin()[0], firstVoxel[columnAxis], 1e-9);
        EXPECT_NEAR(output->GetOrigin()[1], firstVoxel[rowAxis], 1e-9);
        EXPECT_EQ(filter->GetPrincipalAxis(), axis);
        EXPECT_TRUE(GetPixels(output) == GetPixels(projection->GetOutput())) << "along axis " << axis << " of " << size;
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
    const auto filter = MakeFilter(image, view);
    filter->SetDefaultPixelValue(background);
    if (repeat % 2 == 0)
    {
      SetRandomGrid(random, filter.GetPointer(), view, image);
    }
    filter->Update();
    int inside = 0;
    for (const TypeParam pixel : GetPixels(filter->GetOutput()))
    {
      ASSERT_TRUE(pixel == constant || pixel == background) << +pixel;
      inside += pixel == constant;
    }
    EXPECT_GT(inside, 0);
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
    const auto expected = Project(image, view);
    const auto output = Project(image, mirrored);
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
    const auto index = DrawIndex(random, image->GetBufferedRegion(), 2);
    image->SetPixel(index, 60000);
    const auto physical = image->TransformIndexToPhysicalPoint<double>(index);
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto expected = view->GetInverseTransform()->TransformPoint(physical);

    // half an intermediate pixel, in the view plane: its longest diagonal
    const auto smallest = itk::ShearWarpFactorization::ComputeProjectedSpacing(view, image);
    const auto filter = MakeFilter(image, view);
    filter->SetOutputSpacing(smallest * 0.25);
    filter->Update();
    const itk::ShearWarpFactorization factorization(view, image, filter->GetOutput());
    const auto                        warp = factorization.GetWarpMatrix();

    const auto *          output = filter->GetOutput();
    double                brightest = 0.0;
    double                mass = 0.0;
    double                moment[2] = { 0.0, 0.0 };
    itk::Point<double, 2> brightestPosition;
    for (const auto & pixel : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
    {
      const auto   position = output->TransformIndexToPhysicalPoint<double>(pixel);
      const double value = output->GetPixel(pixel);
      mass += value;
      moment[0] += value * position[0];
      moment[1] += value * position[1];
      if (value > brightest)
      {
        brightest = value;
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
  const auto       image = MakePlainImage<float>({ { 48, 44, 40 } });
  image->SetSpacing(MakeVector3(0.8, 1.0, 1.3));
  image->SetDirection(MakeRandomRotation(random));
  image->SetOrigin(MakePoint3(40, -30, 20));
  const double centers[][4] = { { 22, 20, 19, 1.0 }, { 27, 25, 21, 0.7 }, { 19, 24, 17, 0.5 } };
  FillByIndex(image, [&](const auto & index) {
    double value = 0.0;
    for (const auto & center : centers)
    {
      double squared = 0.0;
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        const double distance = (static_cast<double>(index[axis]) - center[axis]) / sigma;
        squared += distance * distance;
      }
      value += amplitude * center[3] * std::exp(-0.5 * squared);
    }
    return value;
  });

  // linear interpolation on an axis is off by f''/8; here there are four more of them than in the resampling
  const double bound = amplitude / (sigma * sigma) * 4.0 / 8.0;
  for (int repeat = 0; repeat < 6; ++repeat)
  {
    const auto view =
      MakeView(MakeRandomViewMatrix(random, repeat % 2 == 0 ? ViewKind::Rigid : ViewKind::Mirrored), GetCenter(image));
    const auto filter = MakeFilter(image, view);
    filter->SetOutputSpacing(MakeVector2(1.1, 1.1));
    filter->Update();
    const auto * output = filter->GetOutput();

    constexpr double step = 0.2;
    using ResampleType = itk::ResampleImageFilter<ImageType, ImageType>;
    auto resample = ResampleType::New();
    resample->SetInput(image);
    resample->SetTransform(view);
    const auto size = output->GetBufferedRegion().GetSize();
    resample->SetSize({ { size[0], size[1], 450 } });
    resample->SetOutputSpacing(MakeVector3(1.1, 1.1, step));
    resample->SetOutputOrigin(MakePoint3(output->GetOrigin()[0], output->GetOrigin()[1], -step * 225));
    using ProjectionType = itk::MaximumProjectionImageFilter<ImageType, ImageType>;
    auto projection = ProjectionType::New();
    projection->SetInput(resample->GetOutput());
    projection->SetProjectionDimension(2);
    projection->Update();

    const auto expected = GetPixels(projection->GetOutput());
    for (std::size_t n = 0; n < expected.size(); ++n)
    {
      ASSERT_LT(std::abs(static_cast<double>(output->GetBufferPointer()[n]) - expected[n]), bound);
    }
    EXPECT_GT(*std::max_element(expected.begin(), expected.end()), amplitude);
  }
}

TEST(ShearWarpMIPImageFilter, PartsOfTheGridThatAreSetStayAndTheOthersAreFitted)
{
  const auto image = MakePlainImage<unsigned char>({ { 20, 10, 5 } });
  // corners of the image are at -0.5 and 19.5, 9.5
  const auto filter = MakeFilter(image, MakeAxisView(2));
  const auto expectGrid = [&](const char *                   set,
                              itk::Size<2>                   size,
                              const itk::Vector<double, 2> & spacing,
                              const itk::Point<double, 2> &  origin) {
    SCOPED_TRACE(set);
    filter->UpdateOutputInformation();
    const auto * output = filter->GetOutput();
    EXPECT_EQ(output->GetLargestPossibleRegion().GetSize(), size);
    EXPECT_LT((output->GetSpacing() - spacing).GetNorm(), 1e-12);
    EXPECT_LT((output->GetOrigin() - origin).GetNorm(), 1e-9);
  };
  const auto unit = MakeVector2(1, 1);
  expectGrid("nothing is set", { { 20, 10 } }, unit, MakePoint2(0, 0));
  filter->SetSize({ { 6, 13 } });
  expectGrid("Size alone is centered", { { 6, 13 } }, unit, MakePoint2(7, -1.5));
  filter->FitOutputGrid();
  expectGrid("nothing is set any more", { { 20, 10 } }, unit, MakePoint2(0, 0));
  // 4 pixels of 3 mm are 2 mm too long
  filter->SetOutputSpacing(MakeVector2(2, 3));
  expectGrid("OutputSpacing alone", { { 10, 4 } }, MakeVector2(2, 3), MakePoint2(0.5, 0));
  filter->FitOutputGrid();
  filter->SetOutputOrigin(MakePoint2(-4, 7.25));
  expectGrid("OutputOrigin alone reaches to the far end", { { 24, 3 } }, unit, MakePoint2(-4, 7.25));
  filter->SetOutputOrigin(MakePoint2(100, 100));
  expectGrid("OutputOrigin beyond the far end", { { 1, 1 } }, unit, MakePoint2(100, 100));
  filter->FitOutputGrid();
  filter->SetOutputSpacing(MakeVector2(2, 3));
  filter->SetSize({ { 3, 5 } });
  expectGrid("OutputSpacing and Size", { { 3, 5 } }, MakeVector2(2, 3), MakePoint2(9.5 - 2, 4.5 - 6));
  filter->FitOutputGrid();
  filter->SetOutputSpacing(MakeVector2(2, 2));
  filter->SetOutputOrigin(MakePoint2(0.5, 0.5));
  expectGrid("OutputSpacing and OutputOrigin", { { 10, 5 } }, MakeVector2(2, 2), MakePoint2(0.5, 0.5));
  filter->FitOutputGrid();
  SetGrid(filter, { { 4, 3 } }, MakeVector2(0.5, 0.25), MakePoint2(-1, -2));
  expectGrid("all of them", { { 4, 3 } }, MakeVector2(0.5, 0.25), MakePoint2(-1, -2));
  EXPECT_EQ(filter->GetSize(), (itk::Size<2>{ { 4, 3 } }));
  EXPECT_EQ(filter->GetOutputSpacing(), MakeVector2(0.5, 0.25));
  EXPECT_EQ(filter->GetOutputOrigin(), MakePoint2(-1, -2));
}

TEST(ShearWarpMIPImageFilter, AnImageGivesTheGrid)
{
  const auto filter = MakeFilter(MakePlainImage<short>({ { 20, 10, 5 } }), MakeAxisView(2));
  const auto reference = itk::Image<float, 2>::New();
  reference->SetRegions(itk::ImageRegion<2>({ { 3, -4 } }, { { 7, 9 } }));
  reference->SetSpacing(MakeVector2(0.5, 0.25));
  reference->SetOrigin(MakePoint2(2.5, 3));
  filter->SetOutputParametersFromImage(reference);
  filter->Update();
  EXPECT_EQ(filter->GetOutput()->GetBufferedRegion(), itk::ImageRegion<2>({ { 0, 0 } }, { { 7, 9 } }));
  EXPECT_EQ(filter->GetOutput()->GetSpacing(), MakeVector2(0.5, 0.25));
  EXPECT_EQ(filter->GetOutput()->GetOrigin(), MakePoint2(4, 2));

  const auto other = MakeFilter(MakePlainImage<short>({ { 8, 8, 8 } }), MakeAxisView(0));
  other->SetOutputParametersFromImage(filter->GetOutput());
  other->Update();
  EXPECT_EQ(other->GetOutput()->GetBufferedRegion(), filter->GetOutput()->GetBufferedRegion());
  EXPECT_EQ(other->GetOutput()->GetSpacing(), MakeVector2(0.5, 0.25));
  EXPECT_EQ(other->GetOutput()->GetOrigin(), MakePoint2(4, 2));

  itk::Image<float, 2>::DirectionType turned;
  turned.SetIdentity();
  turned(1, 1) = -1;
  reference->SetDirection(turned);
  EXPECT_NAMES(filter->SetOutputParametersFromImage(reference), "direction", "-1");
  EXPECT_NAMES(filter->SetOutputParametersFromImage(nullptr), "null");
}

/** Files have spacings in float, and their multiples in double. */
TEST(ShearWarpMIPImageFilter, FittedGridNeedsNoPixelForRoundingErrorsOfFiles)
{
  const auto image = MakePlainImage<unsigned char>({ { 192, 3, 10 } });
  const auto filter = MakeFilter(image, MakeAxisView(2));
  for (const auto & [excess, columns] :
       { std::pair(5e-6, 192U), std::pair(9e-3, 192U), std::pair(2e-2, 193U), std::pair(-2e-2, 192U) })
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
  const auto filter = MakeFilter(image, MakeAxisView(2));
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
      const auto output = Project(image, MakeAxisView(axis));
      EXPECT_EQ(output->GetBufferedRegion().GetSize(0), size[axis == 0 ? 1 : 0]);
      EXPECT_EQ(output->GetBufferedRegion().GetSize(1), size[axis == 2 ? 1 : 2]);
      EXPECT_TRUE(IsConstant<unsigned char>(output, 200)) << "thin axis " << thin << ", along axis " << axis;
    }
    Random random(411);
    for (int repeat = 0; repeat < 20; ++repeat)
    {
      const auto pixels = GetPixels(Project(image, MakeRandomView(random, ViewKind::Rigid, image)));
      EXPECT_GT(std::count(pixels.begin(), pixels.end(), 200), 0);
    }
  }
}

TEST(ShearWarpMIPImageFilter, DefaultPixelValueIsWhereTheImageIsNot)
{
  const auto image = MakePlainImage<short>({ { 4, 4, 4 } }, -100);
  const auto filter = MakeFilter(image, MakeAxisView(2));
  filter->SetDefaultPixelValue(-1024);
  filter->SetSize({ { 10, 10 } });
  filter->Update();
  for (const auto & index : itk::ImageRegionIndexRange<2>(filter->GetOutput()->GetBufferedRegion()))
  {
    const bool isInside = index[0] >= 3 && index[0] < 7 && index[1] >= 3 && index[1] < 7;
    EXPECT_EQ(filter->GetOutput()->GetPixel(index), isInside ? -100 : -1024) << index;
  }

  filter->SetOutputOrigin(MakePoint2(50, 50));
  for (const short background : { short{ -1024 }, short{ 0 } })
  {
    filter->SetDefaultPixelValue(background);
    filter->Update();
    EXPECT_TRUE(IsConstant<short>(filter->GetOutput(), background)) << "the grid misses the image";
  }
}

TEST(ShearWarpMIPImageFilter, FootprintIsTheImagesPhysicalExtent)
{
  // the outer voxels reach half a voxel beyond their centers
  const auto image = MakePlainImage<unsigned char>({ { 8, 6, 5 } }, 9);
  const auto filter = MakeFilter(image, MakeAxisView(2));
  SetGrid(filter, { { 44, 36 } }, MakeVector2(0.25, 0.25), MakePoint2(-1.375, -1.375));
  filter->Update();
  const auto * output = filter->GetOutput();
  auto         first = MakePoint2(1e9, 1e9);
  auto         last = MakePoint2(-1e9, -1e9);
  for (const auto & index : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
  {
    const auto position = output->TransformIndexToPhysicalPoint<double>(index);
    for (unsigned int axis = 0; output->GetPixel(index) == 9 && axis < 2; ++axis)
    {
      first[axis] = std::min(first[axis], position[axis]);
      last[axis] = std::max(last[axis], position[axis]);
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
    const auto                   output = Project(image, view);
    BruteForceProjection<TPixel> bruteForce(view, image);
    EXPECT_TRUE(HaveSamePixels(bruteForce.Evaluate(output, TPixel{}), output));
    const auto pixels = GetPixels(output);
    EXPECT_TRUE(std::none_of(pixels.begin(), pixels.end(), [](TPixel pixel) { return std::isnan(pixel); }));
  }

  image->FillBuffer(std::numeric_limits<TPixel>::quiet_NaN());
  image->Modified();
  const auto filter = MakeFilter(image, MakeAxisView(1));
  filter->SetDefaultPixelValue(TPixel(-3.5));
  filter->Update();
  EXPECT_TRUE(IsConstant<TPixel>(filter->GetOutput(), TPixel(-3.5)));
}

TEST(ShearWarpMIPImageFilter, NotANumberInTheImageStaysAwayFromTheOutput)
{
  ExpectNotANumberStaysAway<float>();
  ExpectNotANumberStaysAway<double>();
}
