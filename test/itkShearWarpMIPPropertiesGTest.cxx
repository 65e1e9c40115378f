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
#include "itkShearWarpMIPCineImageFilter.h"
#include "itkShearWarpMIPImageFilter.h"

#include "itkShearWarpMIPTestOracle.h"
#include "itkShearWarpMIPTestParts.h"

#include <array>
#include <iostream>
#include <set>

namespace
{
using namespace itk::ShearWarpMIPTest;
using ReducedResamplingEnum = itk::ShearWarpMIPImageFilterEnums::ReducedResampling;

/** Mostly small, at most 70. */
itk::Size<3>
DrawSize(Random & random)
{
  itk::Size<3> size;
  for (auto & length : size)
  {
    constexpr itk::SizeValueType limits[] = { 2, 5, 12, 12, 12, 25, 25, 70 };
    length = static_cast<itk::SizeValueType>(random.Integer(1, limits[random.Integer(0, 7)]));
  }
  return size;
}

/** Spacings from 0.01 to 100, more or less alike; oblique, mirrored, or along the axes. */
void
DrawGeometry(Random & random, itk::ImageBase<3> * image, const itk::Size<3> & size)
{
  SetRandomGeometry(random, image, size);
  const double           scale = std::pow(10.0, random.Uniform(-2, 2));
  const bool             isAnisotropic = random.Integer(0, 2) == 0;
  itk::Vector<double, 3> spacing;
  for (auto & step : spacing)
  {
    step = isAnisotropic ? std::pow(10.0, random.Uniform(-2, 2)) : scale * random.Uniform(0.5, 2.0);
  }
  image->SetSpacing(spacing);
  if (random.Integer(0, 3) == 0)
  {
    const double mirror = random.Integer(0, 1) == 0 ? 1 : -1;
    image->SetDirection(MakeMatrix({ { 0, mirror, 0 }, { 0, 0, 1 }, { -1, 0, 0 } }));
  }
}

/** Noise, or a few bright voxels, or what is not finite. */
template <typename TPixel>
void
DrawVoxels(Random & random, itk::Image<TPixel, 3> * image)
{
  FillRandom(random, image);
  TPixel * const voxels = image->GetBufferPointer();
  const auto     last = static_cast<std::int64_t>(image->GetBufferedRegion().GetNumberOfPixels()) - 1;
  const auto     content = random.Integer(0, 3);
  if (content == 0)
  {
    std::fill(voxels, voxels + last + 1, TPixel{ 3 });
    for (int n = 0; n < 5; ++n)
    {
      voxels[random.Integer(0, last)] = static_cast<TPixel>(random.Integer(1, 120));
    }
  }
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    if (content == 1)
    {
      using Limits = std::numeric_limits<TPixel>;
      constexpr TPixel specials[] = { Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), -TPixel{},
                                      Limits::max(),       Limits::lowest(),   Limits::denorm_min() };
      for (std::int64_t n = 0; n <= last; n += random.Integer(1, 9))
      {
        voxels[n] = specials[random.Integer(0, 6)];
      }
    }
  }
}

/** Random, or one whose shears are multiples of 1/2 up to rounding errors: on the boundary of what is possible. */
ViewType::Pointer
DrawView(Random & random, const itk::ImageBase<3> * image)
{
  const auto kind = AllViewKinds[random.Integer(0, 2)];
  MatrixType matrix = MakeRandomViewMatrix(random, kind);
  if (random.Integer(0, 2) == 0)
  {
    const auto & spacing = image->GetSpacing();
    MatrixType   viewToIndex;
    viewToIndex.SetIdentity();
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      viewToIndex(axis, 2) = 0.5 * static_cast<double>(random.Integer(-2, 2));
    }
    if (viewToIndex(2, 2) != 0.0)
    {
      matrix = image->GetDirection() * MakeDiagonal(spacing[0], spacing[1], spacing[2]) * viewToIndex;
    }
  }
  else if (random.Integer(0, 2) == 0)
  {
    matrix = matrix * MakeDiagonal(1.0, 1.0, std::pow(10.0, random.Uniform(-2, 2)));
  }
  return MakeView(matrix, GetCenter(image) + DrawVector(random, 20));
}

/** Sets some of the grid's parameters, or none, and what is needed to keep the output small. */
template <typename TFilter>
void
DrawGrid(Random & random, TFilter * filter, const ViewType * view, const itk::ImageBase<3> * image)
{
  constexpr double largest = 80.0;
  const auto [lower, upper] = FindCornerBounds(view, image);
  const auto             extent = upper - lower;
  const auto             fitted = itk::ShearWarpFactorization::ComputeProjectedSpacing(view, image);
  itk::Size<2>           size;
  itk::Vector<double, 2> spacing;
  itk::Point<double, 2>  origin;
  bool                   isTooLarge = false;
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    size[axis] = static_cast<itk::SizeValueType>(random.Integer(1, 40));
    spacing[axis] = extent[axis] / random.Uniform(1, largest);
    origin[axis] = lower[axis] + extent[axis] * random.Uniform(-0.4, 0.9);
    isTooLarge = isTooLarge || extent[axis] / fitted[axis] > largest;
  }
  const auto parts = random.Integer(0, 7);
  if (parts & 1)
  {
    filter->SetSize(size);
  }
  if ((parts & 2) || isTooLarge)
  {
    filter->SetOutputSpacing(spacing);
  }
  if (parts & 4)
  {
    filter->SetOutputOrigin(origin);
  }
}

/** What the cases of a run had. */
struct Tally
{
  std::size_t cases{ 0 };
  std::size_t pixels{ 0 };
  std::size_t ties{ 0 };

  std::set<std::pair<unsigned int, bool>> axes;
};

/** The filter gives the bits of BruteForceProjection, however it computes them. */
template <typename TPixel>
void
CheckCase(Random & random, Tally & tally)
{
  using ImageType = itk::Image<TPixel, 3>;
  const auto image = ImageType::New();
  DrawGeometry(random, image, DrawSize(random));
  image->Allocate();
  DrawVoxels(random, image.GetPointer());
  if (random.Integer(0, 3) == 0)
  {
    // an image without a source is what there is of it in memory
    auto larger = image->GetBufferedRegion();
    larger.PadByRadius(static_cast<itk::SizeValueType>(random.Integer(1, 9)));
    image->SetLargestPossibleRegion(larger);
  }
  const auto buffered = image->GetBufferedRegion();

  const auto filter = itk::ShearWarpMIPImageFilter<ImageType>::New();
  if (random.Integer(0, 3) == 0)
  {
    // what another image left behind
    filter->SetInput(MakeRandomImage<TPixel>(random, DrawSize(random)));
    filter->SetSize({ { 9, 9 } });
    filter->SetOversampling(2);
    filter->Update();
    filter->FitOutputGrid();
  }
  filter->SetInput(image);
  image->UpdateOutputInformation();
  const auto view = DrawView(random, image);
  const auto background = MakeRandomPixel<TPixel>(random);
  auto       oversampling = static_cast<unsigned int>(random.Integer(1, 2));
  filter->SetTransform(view);
  filter->SetDefaultPixelValue(background);
  DrawGrid(random, filter.GetPointer(), view, image);
  RayRule<TPixel> rule;
  if (random.Integer(0, 1) == 0)
  {
    rule = DrawRule(random, filter.GetPointer(), view.GetPointer(), image.GetPointer());
    oversampling = rule.isNearest ? 1 : oversampling;
  }
  filter->SetOversampling(oversampling);

  typename itk::Image<TPixel, 2>::Pointer first;
  ForEachInstructionSet([&](const std::string & name) {
    const auto threads = static_cast<itk::ThreadIdType>(random.Integer(1, 8));
    const auto mode = static_cast<ReducedResamplingEnum>(random.Integer(0, 2));
    SetThreads(filter, threads);
    filter->SetReducedResampling(mode);
    filter->SetNumberOfStreamDivisions(static_cast<unsigned int>(random.Integer(0, 1) == 0 ? 1 : random.Integer(2, 9)));
    if (random.Integer(0, 1) == 0)
    {
      filter->ReleasePreparedVolume();
    }
    filter->Modified();
    filter->UpdateLargestPossibleRegion();
    first = first ? first : Copy(filter->GetOutput());
    EXPECT_TRUE(HaveSamePixels(first, filter->GetOutput())) << name << ", " << threads << " threads, " << mode;
  });

  ASSERT_EQ(image->GetLargestPossibleRegion(), buffered);
  BruteForceProjection<TPixel> bruteForce(view, image, static_cast<int>(oversampling), rule);
  tally.axes.insert({ filter->GetPrincipalAxis(), bruteForce.LooksAlongAxis() });
  for (const auto & index : itk::ImageRegionIndexRange<2>(first->GetBufferedRegion()))
  {
    const auto   place = GetPlace(first, index);
    const TPixel pixel = first->GetPixel(index);
    const TPixel expected = bruteForce.Evaluate(place[0], place[1], background);
    ++tally.pixels;
    if (!HaveSameBits(pixel, expected))
    {
      ASSERT_TRUE(bruteForce.IsTie(place[0], place[1]))
        << "pixel " << index << " is " << +pixel << " instead of " << +expected << "; "
        << first->GetBufferedRegion().GetSize() << " pixels of " << buffered.GetSize() << " voxels";
      ++tally.ties;
    }
  }
  ++tally.cases;
}

/** Every draw of a case follows from its seed. */
void
CheckCase(std::uint64_t seed, Tally & tally)
{
  constexpr std::array checks = {
    CheckCase<char>,           CheckCase<signed char>, CheckCase<unsigned char>,      CheckCase<short>,
    CheckCase<unsigned short>, CheckCase<int>,         CheckCase<unsigned int>,       CheckCase<long>,
    CheckCase<unsigned long>,  CheckCase<long long>,   CheckCase<unsigned long long>, CheckCase<float>,
    CheckCase<double>
  };
  Random random(seed);
  checks[seed % checks.size()](random, tally);
}

double
DrawZero(Random & random)
{
  return random.Integer(0, 1) == 0 ? 0.0 : -0.0;
}

/** All 48, some with zeros of one sign, some of both. */
std::vector<MatrixType>
DrawSignedPermutations(Random & random)
{
  std::vector<MatrixType>     matrices;
  std::array<unsigned int, 3> rows{ 0, 1, 2 };
  do
  {
    for (int signs = 0; signs < 8; ++signs)
    {
      const double zeros[] = { DrawZero(random), DrawZero(random) };
      MatrixType   matrix;
      for (unsigned int n = 0; n < 9; ++n)
      {
        const double one = (signs >> n % 3 & 1) != 0 ? -1.0 : 1.0;
        matrix(n / 3, n % 3) = rows[n % 3] == n / 3 ? one : zeros[random.Integer(0, 1)];
      }
      matrices.push_back(matrix);
    }
  } while (std::next_permutation(rows.begin(), rows.end()));
  return matrices;
}

/** The maxima of the voxels behind each pixel of \a grid, whose pixels are as large as voxels, along an axis of the
 * image; else 0. Only voxels of \a region count. */
template <typename TGrid>
std::vector<short>
TakeMaxima(const itk::Image<short, 3> * image,
           const ViewType *             view,
           const TGrid *                grid,
           const itk::ImageRegion<3> &  region)
{
  const auto         toView = view->GetInverseTransform();
  const auto         size = grid->GetLargestPossibleRegion().GetSize();
  std::vector<short> maxima(size[0] * size[1]);
  for (const auto & index : itk::ImageRegionIndexRange<3>(region))
  {
    const auto point = toView->TransformPoint(image->TransformIndexToPhysicalPoint<double>(index));
    const auto place = [&](unsigned int axis) {
      return static_cast<std::size_t>(std::lround((point[axis] - grid->GetOrigin()[axis]) / grid->GetSpacing()[axis]));
    };
    short & maximum = maxima.at(place(1) * size[0] + place(0));
    maximum = std::max(maximum, image->GetPixel(index));
  }
  return maxima;
}

template <typename TGrid>
std::vector<short>
TakeMaxima(const itk::Image<short, 3> * image, const ViewType * view, const TGrid * grid)
{
  return TakeMaxima(image, view, grid, image->GetBufferedRegion());
}

/** Sets a geometry of special values: signed permutations, zeros of both signs, halves and whole numbers. */
void
SetLatticeGeometry(Random & random, itk::ImageBase<3> * image)
{
  const double spacings[] = { 1.0, 0.5, 0.7, 0.1, 1.0 / 3.0, 2.5 };
  const double origins[] = { 0.0, -0.0, 0.5, -2.0, 0.1, 30000.7, -12.0 };
  auto         spacing = image->GetSpacing();
  auto         origin = image->GetOrigin();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    spacing[axis] = spacings[random.Integer(0, 5)];
    origin[axis] = origins[random.Integer(0, 6)];
  }
  image->SetSpacing(spacing);
  image->SetOrigin(origin);
  image->SetDirection(DrawSignedPermutations(random)[static_cast<std::size_t>(random.Integer(0, 47))]);
}
} // namespace

TEST(ShearWarpMIPProperties, ViewsAlongTheGridHaveTheMaximaOfTheirVoxels)
{
  using ImageType = itk::Image<short, 3>;
  Random     random(1201);
  const auto image = ImageType::New();
  // longer than vectors; the center is a voxel
  image->SetRegions(itk::ImageRegion<3>({ { -3, 2, 5 } }, { { 35, 9, 7 } }));
  image->SetSpacing(MakeVector3(0.5, 0.5, 0.5));
  image->SetOrigin(MakePoint3(1.5, -2, 10));
  image->Allocate();
  std::generate_n(image->GetBufferPointer(), image->GetBufferedRegion().GetNumberOfPixels(), [&random] {
    return static_cast<short>(random.Integer(1, 9999));
  });

  const auto single = MakeFilter(image);
  const auto cine = itk::ShearWarpMIPCineImageFilter<ImageType>::New();
  cine->SetInput(image);
  for (const MatrixType & direction : DrawSignedPermutations(random))
  {
    image->SetDirection(direction);
    const auto corner = image->TransformIndexToPhysicalPoint<double>(image->GetBufferedRegion().GetIndex());
    std::vector<ViewType::Pointer> views;
    for (const MatrixType & matrix : DrawSignedPermutations(random))
    {
      PointType origin = corner;
      for (auto & coordinate : origin)
      {
        coordinate += 0.5 * static_cast<double>(random.Integer(-2, 2));
      }
      views.push_back(MakeView(matrix, origin));
    }
    for (int repeat = 0; repeat < 12; ++repeat)
    {
      auto view = views[static_cast<std::size_t>(random.Integer(0, 47))];
      for (int turn = 0; turn < 2; ++turn)
      {
        auto axis = MakeVector3(DrawZero(random), DrawZero(random), DrawZero(random));
        axis[static_cast<unsigned int>(random.Integer(0, 2))] = random.Integer(0, 1) == 0 ? 1.0 : -1.0;
        view = itk::ShearWarpMIPView::Turn(view, axis, corner, 90.0 * static_cast<double>(random.Integer(1, 3)));
      }
      views.push_back(view);
    }

    cine->ClearTransforms();
    for (const auto & view : views)
    {
      cine->AddTransform(view);
      std::vector<short> expected;
      single->SetTransform(view);
      ForEachInstructionSet([&](const std::string & name) {
        UpdateAnew(single);
        const auto * output = single->GetOutput();
        expected = expected.empty() ? TakeMaxima(image, view, output) : expected;
        EXPECT_TRUE(std::equal(expected.begin(), expected.end(), output->GetBufferPointer())) << name << ", direction\n"
                                                                                              << direction << "view\n"
                                                                                              << view->GetMatrix();
      });
    }
    std::vector<std::vector<short>> expected;
    ForEachInstructionSet([&](const std::string & name) {
      UpdateAnew(cine);
      for (std::size_t n = 0; n < views.size(); ++n)
      {
        if (n == expected.size())
        {
          expected.push_back(TakeMaxima(image, views[n], cine->GetOutput()));
        }
        const short * frame = cine->GetOutput()->GetBufferPointer() + n * expected[n].size();
        EXPECT_TRUE(std::equal(expected[n].begin(), expected[n].end(), frame))
          << name << ", frame " << n << ", direction\n"
          << direction << "view\n"
          << views[n]->GetMatrix();
      }
    });
  }
}

TEST(ShearWarpMIPProperties, SpacingsThatAreEqualButForRoundingGiveTheMaximaOfVoxels)
{
  using ImageType = itk::Image<short, 3>;
  Random       random(1202);
  const double spacings[][3] = { { 0.48828125, 0.488281, 0.4882813 }, { 0.499998, 0.5, 0.500005 },
                                 { 0.7, 0.7f, 0.70000005 },           { 0.488, 0.48828125, 0.4883 },
                                 { 1.0, 1.0 + 1e-7, 1.0 - 1e-8 },     { 0.39f, 0.39, 0.39 } };
  for (const auto & spacing : spacings)
  {
    const auto image = ImageType::New();
    image->SetRegions(itk::ImageRegion<3>({ { -3, 2, 5 } }, { { 60, 35, 24 } }));
    image->SetSpacing(MakeVector3(spacing[0], spacing[1], spacing[2]));
    image->SetOrigin(MakePoint3(random.Uniform(-99, 99), random.Uniform(-99, 99), random.Uniform(-99, 99)));
    image->Allocate();
    std::generate_n(image->GetBufferPointer(), image->GetBufferedRegion().GetNumberOfPixels(), [&random] {
      return static_cast<short>(random.Integer(1, 32000));
    });
    const auto directions = DrawSignedPermutations(random);
    for (const MatrixType & matrix : DrawSignedPermutations(random))
    {
      image->SetDirection(directions[static_cast<std::size_t>(random.Integer(0, 47))]);
      const auto view = MakeView(matrix, GetCenter(image) + DrawVector(random, 20));
      const auto opposite = MakeView(matrix * MakeDiagonal(-1, 1, -1), GetCenter(image));
      const auto filter = MakeFilter(image, view);
      filter->Update();
      const auto * output = filter->GetOutput();
      const auto   expected = TakeMaxima(image, view, output);
      SCOPED_TRACE(testing::Message() << image->GetDirection() << view->GetMatrix() << image->GetSpacing());
      ASSERT_EQ(GetPixels(output), expected);
      ASSERT_EQ(std::count(expected.begin(), expected.end(), 0), 0) << "more pixels than voxels";

      const auto exact = MakeFilter(image, view);
      exact->ExactOn();
      exact->Update();
      EXPECT_EQ(GetPixels(exact->GetOutput()), expected);
      const auto inSpace = itk::ShearWarpMIPImageFilter<ImageType, ImageType>::New();
      inSpace->SetInput(image);
      inSpace->SetTransform(view);
      inSpace->Update();
      EXPECT_EQ(GetPixels(inSpace->GetOutput()), expected);
      EXPECT_EQ(GetPixels(ProjectAsOnePart(filter.GetPointer())), expected);
      const auto cine = itk::ShearWarpMIPCineImageFilter<ImageType>::New();
      cine->SetInput(image);
      cine->AddTransform(opposite);
      cine->AddTransform(MakeView(matrix, GetCenter(image)));
      cine->Update();
      ASSERT_EQ(cine->GetOutput()->GetBufferedRegion().GetNumberOfPixels(), 2 * expected.size());
      const short * second = cine->GetOutput()->GetBufferPointer() + expected.size();
      EXPECT_TRUE(std::equal(expected.begin(), expected.end(), second));
    }
  }
}

TEST(ShearWarpMIPProperties, FittedGridsHoldTheImage)
{
  Random random(1203);
  for (int repeat = 0; repeat < 3000; ++repeat)
  {
    const auto image = itk::Image<short, 3>::New();
    SetRandomGeometry(random, image, MakeRandomSize(random, 1, repeat % 2 == 0 ? 12 : 600));
    if (repeat % 3 != 0)
    {
      const double spacing = random.Uniform(0.3, 3.0);
      const double ratio = static_cast<double>(random.Integer(1, 3));
      const double error = std::pow(10.0, random.Uniform(-9, -2.5));
      image->SetSpacing(MakeVector3(spacing, spacing * random.Uniform(1 - error, 1 + error), spacing * ratio));
    }
    auto matrix = MakeRandomViewMatrix(random, AllViewKinds[repeat % 3]);
    if (repeat % 4 != 0)
    {
      // of the image's axes, or a little beside them
      const auto   permutations = DrawSignedPermutations(random);
      const double angle = repeat % 4 == 1 ? 0.0 : std::pow(10.0, random.Uniform(-9, -1));
      const double c = std::cos(angle);
      const double s = std::sin(angle);
      matrix = image->GetDirection() * permutations[static_cast<std::size_t>(random.Integer(0, 47))] *
               MakeMatrix({ { c, -s, 0 }, { s, c, 0 }, { 0, 0, 1 } });
    }
    const auto view = MakeView(matrix, GetCenter(image));
    const auto filter = MakeFilter(image, view);
    filter->UpdateOutputInformation();
    const auto * grid = filter->GetOutput();
    const auto [lower, upper] = FindCornerBounds(view, image);
    const auto smallest = itk::ShearWarpFactorization::ComputeProjectedSpacing(view, image);
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      const double spacing = grid->GetSpacing()[axis];
      const double begin = grid->GetOrigin()[axis] - 0.5 * spacing;
      const double end = begin + static_cast<double>(grid->GetLargestPossibleRegion().GetSize(axis)) * spacing;
      ASSERT_NEAR(spacing, smallest[axis], 1.001e-3 * smallest[axis]) << repeat;
      ASSERT_TRUE(repeat % 4 != 0 || spacing == smallest[axis]) << "an oblique view";
      ASSERT_LE(begin, lower[axis] + 0.00501 * spacing) << repeat;
      ASSERT_GE(end, upper[axis] - 0.00501 * spacing) << repeat;
      ASSERT_LT(end - begin, upper[axis] - lower[axis] + spacing) << repeat;
    }
  }
}

TEST(ShearWarpMIPProperties, AFittedGridMeetsVoxelsOfAlmostThreePixelsAtTheirCenters)
{
  const auto image = MakePlainImage<short>({ { 200, 210, 220 } });
  image->SetSpacing(MakeVector3(0.5, 0.5, 1.500003));
  image->SetPixel({ { 20, 30, 40 } }, 1000);
  const auto filter = MakeFilter(image, MakeView(MakeAxisMatrix(0), GetCenter(image)));
  filter->Update();
  ASSERT_EQ(filter->GetOutput()->GetBufferedRegion().GetSize(), (itk::Size<2>{ { 210, 660 } }));
  EXPECT_EQ(filter->GetOutput()->GetPixel({ { 30, 3 * 40 + 1 } }), 1000);

  // a given spacing
  filter->SetOutputSpacing(MakeVector2(0.4999999, 1.5));
  filter->Update();
  ASSERT_EQ(filter->GetOutput()->GetBufferedRegion().GetSize(), (itk::Size<2>{ { 210, 220 } }));
  EXPECT_EQ(filter->GetOutput()->GetPixel({ { 30, 40 } }), 1000);

  // rows are along z in all frames
  const auto cine = itk::ShearWarpMIPCineImageFilter<itk::Image<short, 3>>::New();
  cine->SetInput(image);
  cine->SetNumberOfFrames(5);
  cine->UpdateOutputInformation();
  EXPECT_EQ(cine->GetOutput()->GetLargestPossibleRegion().GetSize(1), 660u);
  EXPECT_DOUBLE_EQ(cine->GetOutput()->GetSpacing()[1], 0.500001);
  EXPECT_EQ(cine->GetOutput()->GetSpacing()[0], 0.5);
}

TEST(ShearWarpMIPProperties, LimitsInVoxelCentersIncludeTheVoxels)
{
  Random random(1204);
  for (int repeat = 0; repeat < 1500; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto image = MakeRandomImage<short>(random, MakeRandomSize(random, 1, repeat % 10 == 0 ? 20 : 6));
    const bool isLattice = repeat % 3 != 0;
    if (isLattice)
    {
      SetLatticeGeometry(random, image);
    }
    FillByIndex(image, [&random](const auto &) { return random.Integer(1, 32000); });
    const auto region = image->GetBufferedRegion();
    const auto first = DrawIndex(random, region);
    const auto second = repeat % 4 == 0 ? first : DrawIndex(random, region);
    const auto a = image->TransformIndexToPhysicalPoint<double>(first);
    const auto b = image->TransformIndexToPhysicalPoint<double>(second);

    // along an axis of the image
    const auto      permutation = DrawSignedPermutations(random)[static_cast<std::size_t>(random.Integer(0, 47))];
    const PointType offsets[] = { GetCenter(image) + DrawVector(random, 20), a, GetCenter(image), PointType(0.0) };
    const auto      view = MakeView(image->GetDirection() * permutation, offsets[random.Integer(0, 3)]);
    const auto      toView = view->GetInverseTransform();
    unsigned int    axes[3]{}; // of the image, along the axes of the view
    for (unsigned int n = 0; n < 3; ++n)
    {
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        axes[n] = permutation(axis, n) != 0.0 ? axis : axes[n];
      }
    }
    const auto filter = MakeFilter(image, view);
    filter->SetOutputSpacing(MakeVector2(image->GetSpacing()[axes[0]], image->GetSpacing()[axes[1]]));
    auto       included = region;
    const auto include = [&](unsigned int axis) {
      included.SetIndex(axis, std::min(first[axis], second[axis]));
      included.SetSize(axis, static_cast<itk::SizeValueType>(std::abs(first[axis] - second[axis])) + 1);
    };
    if (isLattice && repeat % 2 == 0)
    {
      PointType lower;
      PointType upper;
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        include(axis);
        lower[axis] = std::min(a[axis], b[axis]);
        upper[axis] = std::max(a[axis], b[axis]);
      }
      filter->SetCropLower(lower);
      filter->SetCropUpper(upper);
    }
    else
    {
      include(axes[2]);
      const double depths[] = { toView->TransformPoint(a)[2], toView->TransformPoint(b)[2] };
      filter->SetSlabNear(std::min(depths[0], depths[1]));
      filter->SetSlabFar(std::max(depths[0], depths[1]));
    }
    const auto expect = [&](const char * what) {
      filter->Update();
      ASSERT_EQ(GetPixels(filter->GetOutput()), TakeMaxima(image, view, filter->GetOutput(), included))
        << what << ", " << region.GetSize();
    };
    expect("plain");
    filter->ExactOn();
    expect("exact");
    filter->ExactOff();
    filter->SetNumberOfStreamDivisions(2);
    expect("streamed");
    filter->SetOversampling(2);
    filter->ComputeDepthOn();
    expect("oversampled");
    filter->SetMaskImage(MakeMask(image, 1));
    expect("masked");
    filter->SetNumberOfStreamDivisions(1);
    expect("masked in memory");

    // a millionth of a voxel beside the limit
    const double beside = 1e-6 * image->GetSpacing()[axes[2]];
    filter->SetCropLower(PointType(-1e9));
    filter->SetCropUpper(PointType(1e9));
    filter->SetSlabNear(toView->TransformPoint(a)[2] - 2 * beside);
    filter->SetSlabFar(toView->TransformPoint(a)[2] - beside);
    included.SetSize(axes[2], 0);
    expect("beside");

    // the ray through a voxel, in any direction: only there it meets the box, or the slab
    const auto oblique = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto place = oblique->GetInverseTransform()->TransformPoint(a);
    const auto ray = MakeFilter(image, oblique);
    SetGrid(ray, { { 1, 1 } }, MakeVector2(1, 1), MakePoint2(place[0], place[1]));
    ray->ExactOn();
    ray->SetSlabNear(place[2]);
    ray->SetSlabFar(place[2]);
    ray->Update();
    ASSERT_EQ(ray->GetOutput()->GetPixel({ { 0, 0 } }), image->GetPixel(first)) << "slab";
    ray->SetSlabNear(-1e9);
    ray->SetSlabFar(1e9);
    ray->SetCropLower(a);
    ray->SetCropUpper(a);
    ray->Update();
    ASSERT_EQ(ray->GetOutput()->GetPixel({ { 0, 0 } }), image->GetPixel(first)) << "box";
  }
}

TEST(ShearWarpMIPProperties, EveryCaseHasTheBitsOfABruteForceEvaluation)
{
  Tally tally;
  ForEachSeed(12000, 1, [&](std::uint64_t seed) { CheckCase(seed, tally); });
  std::cout << tally.cases << " cases, " << tally.pixels << " pixels, " << tally.ties << " of them ties\n";
  EXPECT_TRUE(tally.cases < 1000 || tally.axes.size() == 6) << "every axis from both sides";
  EXPECT_LE(static_cast<double>(tally.ties), 1e-4 * static_cast<double>(tally.pixels));
}
