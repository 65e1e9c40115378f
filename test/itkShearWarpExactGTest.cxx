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
#include "itkEuler3DTransform.h"
#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPTestOracle.h"
#include "itkShearWarpMIPView.h"

#include <array>

namespace
{
using namespace itk::ShearWarpMIPTest;
using ModeEnum = itk::ShearWarpMIPImageFilterEnums::Mode;

template <typename TPixel>
using FilterType = itk::ShearWarpMIPImageFilter<itk::Image<TPixel, 3>>;

template <typename TImagePointer>
auto
MakeExactFilter(const TImagePointer & image, const itk::Transform<double, 3, 3> * view)
{
  const auto filter = MakeFilter(image, view);
  filter->ExactOn();
  return filter;
}

// The interpolant of an image along a ray, cell by cell of the image's own grid: from transform and image alone.
template <typename TPixel>
class InterpolantOnRay
{
public:
  using Number = long double;
  struct Extremum
  {
    Number value, depth;
  };

  InterpolantOnRay(const itk::Image<TPixel, 3> * image, const ViewType * view, double u, double v)
    : m_Image(image)
  {
    const auto & region = image->GetBufferedRegion();
    const auto   toIndex = image->GetInverseDirection();
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      m_Begin[axis] = m_Step[axis] = 0;
      for (unsigned int n = 0; n < 3; ++n)
      {
        const auto & matrix = view->GetMatrix();
        const Number place = Number(matrix(n, 0)) * u + Number(matrix(n, 1)) * v + Number(view->GetOffset()[n]);
        m_Begin[axis] += Number(toIndex(axis, n)) * (place - Number(image->GetOrigin()[n]));
        m_Step[axis] += Number(toIndex(axis, n)) * Number(matrix(n, 2));
        m_Physical[n] = place;
        m_PhysicalStep[n] = matrix(n, 2);
      }
      m_Begin[axis] = m_Begin[axis] / Number(image->GetSpacing()[axis]) - Number(region.GetIndex(axis));
      m_Step[axis] /= Number(image->GetSpacing()[axis]);
      m_Length[axis] = static_cast<std::int64_t>(region.GetSize(axis));
      this->Clip(m_Begin[axis], m_Step[axis], -0.5L, Number(m_Length[axis]) - 0.5L);
    }
  }

  /** Leaves out what is outside of \a rule's slab and box. */
  void
  Clip(const RayRule<TPixel> & rule, const ViewType * view)
  {
    Number depthOfVoxel = 0;
    for (unsigned int n = 0; n < 3; ++n)
    {
      itk::Vector<double, 3> step;
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        step[axis] = m_Image->GetDirection()(axis, n) * m_Image->GetSpacing()[n];
      }
      depthOfVoxel += std::abs(view->GetInverseTransform()->TransformVector(step)[2]);
    }
    this->Clip(0, 1, rule.slabNear - LimitTolerance * depthOfVoxel, rule.slabFar + LimitTolerance * depthOfVoxel);
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const Number tolerance = LimitTolerance * GetVoxelExtents(m_Image)[axis];
      this->Clip(
        m_Physical[axis], m_PhysicalStep[axis], rule.cropLower[axis] - tolerance, rule.cropUpper[axis] + tolerance);
    }
  }

  /** Of the depths that count; not a number if the ray only touches them. */
  Number
  GetLength() const
  {
    return m_Far - m_Near;
  }

  bool
  Contains(Number depth) const
  {
    return m_Near <= depth && depth <= m_Far;
  }

  Number
  At(Number depth) const
  {
    return this->At(depth, this->FindCell(depth));
  }

  /** The first maximum of \a sign times the interpolant. */
  Extremum
  Maximize(Number sign) const
  {
    std::vector<Number> planes{ m_Near, m_Far };
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      for (std::int64_t n = 0; n < m_Length[axis] && m_Step[axis] != 0; ++n)
      {
        const Number depth = (Number(n) - m_Begin[axis]) / m_Step[axis];
        if (depth > m_Near && depth < m_Far)
        {
          planes.push_back(depth);
        }
      }
    }
    std::sort(planes.begin(), planes.end());
    Extremum   best{ -std::numeric_limits<Number>::infinity(), m_Near };
    const auto take = [&](Number value, Number depth) {
      if (value > best.value)
      {
        best = { value, depth };
      }
    };
    for (std::size_t n = 0; n + 1 < planes.size(); ++n)
    {
      const Number from = planes[n];
      const Number to = planes[n + 1];
      const auto   cell = this->FindCell((from + to) / 2);
      // a cubic through four points: Newton's divided differences of x = 0, 1, 2, 3
      Number f[4];
      for (int point = 0; point < 4; ++point)
      {
        f[point] = sign * this->At(from + (to - from) * point / 3, cell);
      }
      if (!std::isfinite(f[0] + f[1] + f[2] + f[3]))
      {
        continue;
      }
      const Number a = f[1] - f[0];
      const Number b = (f[2] - 2 * f[1] + f[0]) / 2;
      const Number c = (f[3] - 3 * f[2] + 3 * f[1] - f[0]) / 6;
      const auto   value = [&](Number x) { return f[0] + x * (a + (x - 1) * (b + (x - 2) * c)); };
      take(f[0], from);
      // a + b (2x - 1) + c (3x^2 - 6x + 2) = 0
      const Number        quadratic[] = { 3 * c, 2 * b - 6 * c, a - b + 2 * c };
      const Number        discriminant = quadratic[1] * quadratic[1] - 4 * quadratic[0] * quadratic[2];
      std::vector<Number> roots;
      if (quadratic[0] != 0 && discriminant >= 0)
      {
        const Number q = -(quadratic[1] + (quadratic[1] < 0 ? -std::sqrt(discriminant) : std::sqrt(discriminant))) / 2;
        roots.push_back(q / quadratic[0]);
        roots.push_back(q != 0 ? quadratic[2] / q : -1);
      }
      else if (quadratic[1] != 0)
      {
        roots.push_back(-quadratic[2] / quadratic[1]);
      }
      for (const Number root : roots)
      {
        if (root > 0 && root < 3)
        {
          take(value(root), from + (to - from) * root / 3);
        }
      }
      take(f[3], to);
    }
    return best;
  }

private:
  using CellType = std::array<std::int64_t, 3>;

  void
  Clip(Number begin, Number step, Number low, Number high)
  {
    if (step == 0)
    {
      m_Far = low <= begin && begin <= high ? m_Far : -std::numeric_limits<Number>::infinity();
      return;
    }
    const Number a = (low - begin) / step;
    const Number b = (high - begin) / step;
    m_Near = std::max(m_Near, std::min(a, b));
    m_Far = std::min(m_Far, std::max(a, b));
  }

  CellType
  FindCell(Number depth) const
  {
    CellType cell;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const auto index = static_cast<std::int64_t>(std::floor(m_Begin[axis] + depth * m_Step[axis]));
      cell[axis] = std::clamp<std::int64_t>(index, 0, std::max<std::int64_t>(m_Length[axis] - 2, 0));
    }
    return cell;
  }

  Number
  At(Number depth, const CellType & cell) const
  {
    Number sum = 0;
    for (int corner = 0; corner < 8; ++corner)
    {
      Number        weight = 1;
      itk::Index<3> index;
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        const Number last = Number(m_Length[axis] - 1);
        const Number position = std::clamp(m_Begin[axis] + depth * m_Step[axis], Number(0), last);
        const Number fraction = position - Number(cell[axis]);
        const int    side = corner >> axis & 1;
        weight *= side != 0 ? fraction : 1 - fraction;
        index[axis] =
          m_Image->GetBufferedRegion().GetIndex(axis) + std::min<std::int64_t>(cell[axis] + side, m_Length[axis] - 1);
      }
      sum += weight * static_cast<Number>(m_Image->GetPixel(index));
    }
    return sum;
  }

  const itk::Image<TPixel, 3> * m_Image;
  Number                        m_Begin[3], m_Step[3], m_Physical[3], m_PhysicalStep[3];
  std::int64_t                  m_Length[3];
  Number                        m_Near{ -std::numeric_limits<Number>::infinity() };
  Number                        m_Far{ std::numeric_limits<Number>::infinity() };
};

/** Compares each pixel of \a filter's picture and depth. */
template <typename TPixel>
void
ExpectExtremaOfTheInterpolant(const FilterType<TPixel> *    filter,
                              const ViewType *              view,
                              const itk::Image<TPixel, 3> * image,
                              const RayRule<TPixel> &       rule)
{
  const auto        voxels = GetPixels(image);
  const auto        extremes = std::minmax_element(voxels.begin(), voxels.end());
  const auto        lowest = static_cast<long double>(*extremes.first);
  const auto        highest = static_cast<long double>(*extremes.second);
  constexpr bool    isInteger = std::is_integral_v<TPixel>;
  const long double range = highest - lowest;
  const long double magnitude = std::max(std::abs(lowest), std::abs(highest));
  const long double tolerance = (sizeof(TPixel) > 2 || !isInteger ? 1e-11L * magnitude : range / 16384) +
                                static_cast<long double>(std::is_same_v<TPixel, float>) * 1e-7L * magnitude;

  const auto * output = filter->GetOutput();
  for (const auto & index : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
  {
    const auto               place = output->template TransformIndexToPhysicalPoint<double>(index);
    InterpolantOnRay<TPixel> ray(image, view, place[0], place[1]);
    ray.Clip(rule, view);
    if (std::abs(ray.GetLength()) < 1e-11L)
    {
      continue;
    }
    if (!(ray.GetLength() > 0))
    {
      ASSERT_EQ(output->GetPixel(index), filter->GetDefaultPixelValue()) << index;
      continue;
    }
    const auto maximum = ray.Maximize(1);
    const auto minimum = ray.Maximize(-1);
    const auto pixel = static_cast<long double>(output->GetPixel(index));
    // an absolute maximum may have the sign of either where both are as large
    const bool isAbsolute = rule.mode == RayMode::AbsoluteMaximum;
    const bool isMaximum = isAbsolute ? maximum.value + 1 > minimum.value - tolerance : rule.mode == RayMode::Maximum;
    const bool isMinimum = isAbsolute ? minimum.value + 1 > maximum.value - tolerance : rule.mode == RayMode::Minimum;
    const long double infinity = std::numeric_limits<long double>::infinity();
    const long double error = std::min(isMaximum ? std::abs(pixel - maximum.value) : infinity,
                                       isMinimum ? std::abs(pixel + minimum.value) : infinity);
    ASSERT_LE(error, tolerance + (isInteger ? 0.5L : 0.0L))
      << index << ": " << pixel << " instead of " << maximum.value << " or " << -minimum.value << ", "
      << image->GetBufferedRegion().GetSize();
    if (const auto * depths = filter->GetDepthOutput())
    {
      const auto depth = static_cast<long double>(depths->GetPixel(index));
      // what rounding to float does to the place
      const long double shift = 1e-6L * (1 + std::abs(depth));
      const long double near = ray.At(depth - shift);
      const long double far = ray.At(depth + shift);
      const long double slack = tolerance + std::abs(far - near) + (isInteger ? 0.5L : 0.0L) + 1e-4L * range;
      ASSERT_LE(std::abs(ray.At(depth) - pixel), slack) << index << " at depth " << depth;
    }
  }
}

template <typename TPixel>
class ShearWarpExact : public testing::Test
{};
using PixelTypes = itk::ShearWarpMIPTest::TestedTypes<unsigned char,
                                                      signed char,
                                                      unsigned short,
                                                      short,
                                                      int,
                                                      unsigned int,
                                                      unsigned long,
                                                      long long,
                                                      float,
                                                      double>;
TYPED_TEST_SUITE(ShearWarpExact, PixelTypes, );
} // namespace

TYPED_TEST(ShearWarpExact, IsTheExtremumOfTheInterpolant)
{
  ForEachSeed(120, 10, [](std::uint64_t seed) {
    Random             random(seed);
    const auto         repeat = static_cast<int>(seed % 12);
    const auto         image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, repeat % 4 == 0 ? 40 : 12));
    const auto         view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto         filter = MakeExactFilter(image, view);
    RayRule<TypeParam> rule;
    rule.mode = static_cast<RayMode>(repeat % 3);
    filter->SetMode(static_cast<ModeEnum>(rule.mode));
    DrawSlabAndBox(random, filter.GetPointer(), view.GetPointer(), image.GetPointer(), false, rule);
    filter->SetDefaultPixelValue(MakeRandomPixel<TypeParam>(random));
    filter->SetOutputSpacing(itk::ShearWarpFactorization::ComputeProjectedSpacing(view, image) *
                             random.Uniform(0.8, 3));
    filter->SetComputeDepth(random.Integer(0, 1) == 0);
    typename itk::Image<TypeParam, 2>::Pointer first;
    ForEachInstructionSet([&](const std::string & name) {
      filter->SetNumberOfWorkUnits(static_cast<itk::ThreadIdType>(random.Integer(1, 5)));
      UpdateAnew(filter);
      first = first ? first : Copy(filter->GetOutput());
      EXPECT_TRUE(HaveSamePixels(first, filter->GetOutput())) << name;
    });
    ExpectExtremaOfTheInterpolant<TypeParam>(filter, view, image, rule);
  });
}

TYPED_TEST(ShearWarpExact, ConstantsStay)
{
  Random random(2402);
  // odd numbers that double just holds
  const auto large = static_cast<TypeParam>(sizeof(TypeParam) == 8 ? 4503599627370497 : 77);
  for (const TypeParam value : { std::numeric_limits<TypeParam>::lowest(),
                                 std::numeric_limits<TypeParam>::max(),
                                 TypeParam{ 0 },
                                 large,
                                 static_cast<TypeParam>(std::is_signed_v<TypeParam> ? -large : 78) })
  {
    for (int repeat = 0; repeat < 12; ++repeat)
    {
      const auto image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 12));
      image->FillBuffer(value);
      const auto filter = MakeExactFilter(image, MakeRandomView(random, AllViewKinds[repeat % 3], image));
      filter->SetMode(static_cast<ModeEnum>(repeat % 3));
      filter->SetDefaultPixelValue(1);
      filter->ComputeDepthOn();
      filter->Update();
      const auto * output = filter->GetOutput();
      int          numberOfValues = 0;
      for (const auto & index : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
      {
        const bool isOutside = std::isnan(filter->GetDepthOutput()->GetPixel(index));
        numberOfValues += isOutside ? 0 : 1;
        ASSERT_EQ(output->GetPixel(index), isOutside ? TypeParam{ 1 } : value);
      }
      EXPECT_GT(numberOfValues, 0);
    }
  }
}

TYPED_TEST(ShearWarpExact, AlongTheGridIsTheExtremumOfVoxels)
{
  Random random(2403);
  for (int repeat = 0; repeat < 30; ++repeat)
  {
    const auto   image = MakeRandomImage<TypeParam>(random, MakeRandomSize(random, 1, 35));
    const auto & region = image->GetBufferedRegion();
    image->SetSpacing(MakeVector3(1, 1, 1));
    image->SetOrigin(MakePoint3(0, 0, 0));
    image->SetDirection(MakeDiagonal(1, 1, 1));
    const auto axis = static_cast<unsigned int>(repeat % 3);
    const auto across = axis == 0 ? 1U : 0U;
    const auto down = axis == 2 ? 1U : 2U;
    double     signs[3];
    std::generate_n(signs, 3, [&random] { return random.Integer(0, 1) == 0 ? 1.0 : -1.0; });
    const auto matrix = MakeAxisMatrix(axis) * MakeDiagonal(signs[0], signs[1], signs[2]);
    const auto filter = MakeExactFilter(image, MakeView(matrix, PointType(0.0)));
    filter->SetMode(repeat % 2 == 0 ? ModeEnum::Maximum : ModeEnum::Minimum);
    filter->ComputeDepthOn();
    filter->Update();
    double largest = 0.0;
    for (const TypeParam voxel : GetPixels(image))
    {
      largest = std::max(largest, std::abs(static_cast<double>(voxel)));
    }
    const auto * output = filter->GetOutput();
    for (const auto & pixelIndex : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
    {
      const TypeParam pixel = output->GetPixel(pixelIndex);
      const auto      place = output->template TransformIndexToPhysicalPoint<double>(pixelIndex);
      itk::Index<3>   index;
      index[across] = std::lround(matrix(across, 0) * place[0]);
      index[down] = std::lround(matrix(down, 1) * place[1]);
      index[axis] = region.GetIndex(axis);
      ASSERT_TRUE(region.IsInside(index));
      TypeParam  expected = image->GetPixel(index);
      double     depth = std::numeric_limits<double>::infinity();
      const auto last = region.GetIndex(axis) + static_cast<itk::IndexValueType>(region.GetSize(axis)) - 1;
      const auto first = index[axis];
      for (; index[axis] <= last; ++index[axis])
      {
        const TypeParam voxel = image->GetPixel(index);
        expected = repeat % 2 == 0 ? std::max(expected, voxel) : std::min(expected, voxel);
      }
      for (index[axis] = first; index[axis] <= last; ++index[axis])
      {
        if (image->GetPixel(index) == expected)
        {
          // the outer half voxels are as the outer voxels
          const double center = matrix(axis, 2) * static_cast<double>(index[axis]);
          const bool   isNearEnd = index[axis] == (matrix(axis, 2) > 0 ? first : last);
          depth = std::min(depth, center - (isNearEnd ? 0.5 : 0.0));
        }
      }
      if (sizeof(TypeParam) == 8)
      {
        // double holds no difference of them
        ASSERT_NEAR(static_cast<double>(pixel), static_cast<double>(expected), 1e-14 * largest);
        continue;
      }
      ASSERT_TRUE(HaveSameBits(pixel, WithoutSignOfZero(expected))) << +pixel << ' ' << +expected;
      ASSERT_EQ(filter->GetDepthOutput()->GetPixel(pixelIndex), static_cast<float>(depth)) << pixelIndex;
    }
  }
}

TYPED_TEST(ShearWarpExact, LimitsOnPlanesOfVoxelsIncludeNothingBeyondThem)
{
  Random    random(2414);
  TypeParam large = std::numeric_limits<TypeParam>::max();
  if constexpr (std::is_floating_point_v<TypeParam>)
  {
    large = TypeParam(1e12);
  }
  for (int repeat = 0; repeat < 120; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto axis = static_cast<unsigned int>(repeat % 3);
    const auto image = MakePlainImage<TypeParam>({ { 9, 9, 9 } });
    image->SetSpacing(MakeVector3(random.Uniform(0.5, 2), random.Uniform(0.5, 2), random.Uniform(0.5, 2)));
    image->SetOrigin(MakePoint3(random.Uniform(-90, 90), random.Uniform(-90, 90), random.Uniform(-90, 90)));
    const auto first = random.Integer(0, 8);
    const auto last = repeat % 4 < 2 ? first : random.Integer(first, 8);
    const bool isMaximum = random.Integer(0, 1) == 0;
    FillByIndex(image, [&](const auto & index) {
      const bool isWithin = index[axis] >= first && index[axis] <= last;
      return isWithin == isMaximum ? TypeParam{ 0 } : large;
    });
    double signs[3];
    std::generate_n(signs, 3, [&random] { return random.Integer(0, 1) == 0 ? 1.0 : -1.0; });
    const auto matrix = MakeAxisMatrix(axis) * MakeDiagonal(signs[0], signs[1], signs[2]);
    const auto view = MakeView(matrix, PointType(0.0));
    const auto filter = MakeExactFilter(image, view);
    const auto toView = view->GetInverseTransform();
    const auto center = toView->TransformPoint(GetCenter(image));
    SetGrid(filter, { { 3, 3 } }, MakeVector2(0.3, 0.3), MakePoint2(center[0] - 0.3, center[1] - 0.3));
    filter->SetMode(isMaximum ? ModeEnum::Maximum : ModeEnum::Minimum);
    filter->SetDefaultPixelValue(1);
    itk::Index<3> index{ { 4, 4, 4 } };
    index[axis] = first;
    const auto firstPlace = image->template TransformIndexToPhysicalPoint<double>(index);
    index[axis] = last;
    const auto lastPlace = image->template TransformIndexToPhysicalPoint<double>(index);
    if (repeat % 2 == 0)
    {
      const auto depths = std::minmax({ toView->TransformPoint(firstPlace)[2], toView->TransformPoint(lastPlace)[2] });
      filter->SetSlabNear(depths.first);
      filter->SetSlabFar(depths.second);
    }
    else
    {
      auto lower = filter->GetCropLower();
      auto upper = filter->GetCropUpper();
      lower[axis] = firstPlace[axis];
      upper[axis] = lastPlace[axis];
      filter->SetCropLower(lower);
      filter->SetCropUpper(upper);
    }
    filter->Update();
    const auto expected = static_cast<double>(isMaximum ? TypeParam{ 0 } : large);
    for (const TypeParam pixel : GetPixels(filter->GetOutput()))
    {
      // means of eight equal numbers in double may differ from them
      ASSERT_NEAR(static_cast<double>(pixel), expected, sizeof(TypeParam) == 8 ? 1e-15 * expected : 0.0);
    }
  }
}

namespace
{
/** A float image of 2 x 2 x 2 voxels, 1000 at one of them, in a cell from (0, 0, 0) to (1, 1, 1). */
itk::Image<float, 3>::Pointer
MakeCell(const itk::Index<3> & bright)
{
  const auto image = MakePlainImage<float>({ { 2, 2, 2 } });
  image->SetPixel(bright, 1000.0f);
  return image;
}

/** The exact value, and its depth, on the ray from \a begin in direction \a direction, of length 1. */
std::pair<float, float>
ProjectRay(const itk::Image<float, 3> * image, const PointType & begin, const itk::Vector<double, 3> & direction)
{
  const auto across = itk::CrossProduct(direction, MakeVector3(0.3, -0.2, 0.7));
  const auto down = itk::CrossProduct(direction, across);
  MatrixType matrix;
  for (unsigned int n = 0; n < 3; ++n)
  {
    matrix(n, 0) = across[n];
    matrix(n, 1) = down[n];
    matrix(n, 2) = direction[n];
  }
  const auto filter = MakeExactFilter(image, MakeView(matrix, begin));
  SetGrid(filter, { { 1, 1 } }, MakeVector2(1, 1), itk::Point<double, 2>(0.0));
  filter->ComputeDepthOn();
  filter->Update();
  return { filter->GetOutput()->GetPixel({ { 0, 0 } }), filter->GetDepthOutput()->GetPixel({ { 0, 0 } }) };
}
} // namespace

TEST(ShearWarpExactClosedForms, MaximaWithinACell)
{
  for (const double sign : { 1.0, -1.0 })
  {
    const auto ray = [=](double x, double y, double z) { return MakeVector3(sign * x, sign * y, sign * z); };
    // x y (1 - z) = t^2 (1 - t) on the diagonal: 4/27 at t = 2/3
    const double third = 1.0 / std::sqrt(3.0);
    const auto   cubic = ProjectRay(MakeCell({ { 1, 1, 0 } }), MakePoint3(0, 0, 0), ray(third, third, third));
    EXPECT_NEAR(cubic.first, 4000.0 / 27.0, 1e-4);
    EXPECT_NEAR(cubic.second, sign * 2.0 / 3.0 / third, 1e-6);
    // y (1 - z) / 4 ... of a ray in the plane x = 1/4 of that voxel: 3/4 t (1 - t)
    const double half = std::sqrt(0.5);
    const auto   square = ProjectRay(MakeCell({ { 0, 1, 0 } }), MakePoint3(0.25, 0, 0), ray(0, half, half));
    EXPECT_NEAR(square.first, 1000.0 * 0.75 * 0.25, 1e-4);
    EXPECT_NEAR(square.second, sign * 0.5 / half, 1e-6);
    // along an axis: the weight of the voxel in its slice
    const auto linear = ProjectRay(MakeCell({ { 0, 1, 1 } }), MakePoint3(0.25, 0.5, 0), ray(0, 0, 1));
    EXPECT_NEAR(linear.first, 1000.0 * 0.75 * 0.5, 1e-4);
    EXPECT_NEAR(linear.second, sign > 0 ? 1.0 : -1.5, 1e-6);
    // half a voxel beside the outer voxel centers
    const auto outer = ProjectRay(MakeCell({ { 0, 0, 0 } }), MakePoint3(-0.5, -0.4375, 5), ray(0, 0, 1));
    EXPECT_EQ(outer.first, 1000.0f);
  }
}

TEST(ShearWarpExactClosedForms, HalvesAreRoundedUpAndOfEqualMagnitudesTheMaximumIsTaken)
{
  const auto project = [](const itk::Size<3> & size, short first, short last, ModeEnum mode) {
    const auto image = MakePlainImage<short>(size);
    image->GetBufferPointer()[0] = first;
    image->GetBufferPointer()[1] = last;
    const auto filter = MakeExactFilter(image, itk::AffineTransform<double, 3>::New());
    filter->SetMode(mode);
    SetGrid(filter, { { 1, 1 } }, MakeVector2(1, 1), MakePoint2(size[0] == 2 ? 0.5 : 0, 0));
    filter->Update();
    return filter->GetOutput()->GetPixel({ { 0, 0 } });
  };
  const itk::Size<3> row{ { 2, 1, 1 } };
  for (const ModeEnum mode : { ModeEnum::Maximum, ModeEnum::Minimum, ModeEnum::AbsoluteMaximum })
  {
    EXPECT_EQ(project(row, 0, 1, mode), 1);
    EXPECT_EQ(project(row, -1, 0, mode), 0);
    EXPECT_EQ(project(row, -2, -1, mode), -1);
  }
  const itk::Size<3> ray{ { 1, 1, 2 } };
  EXPECT_EQ(project(ray, -5, 5, ModeEnum::AbsoluteMaximum), 5);
  EXPECT_EQ(project(ray, 5, -5, ModeEnum::AbsoluteMaximum), 5);
  EXPECT_EQ(project(ray, -6, 5, ModeEnum::AbsoluteMaximum), -6);
}

TEST(ShearWarpExactClosedForms, ARampEndsWhereSlabAndBoxEnd)
{
  const auto image = itk::Image<float, 3>::New();
  image->SetRegions(itk::ImageRegion<3>({ { -3, 4, 5 } }, { { 40, 30, 20 } }));
  image->Allocate();
  FillByIndex(image, [](const auto & index) { return index[0] + 2 * index[1] + 3 * index[2]; });
  Random random(2404);
  for (int repeat = 0; repeat < 200; ++repeat)
  {
    const auto   view = MakeRandomView(random, ViewKind::Rigid, image.GetPointer());
    const double near = random.Uniform(-6, 0);
    const double far = random.Uniform(0, 6);
    const auto   filter = MakeExactFilter(image, view);
    const auto   center = view->GetInverseTransform()->TransformPoint(GetCenter(image));
    const auto   origin = MakePoint2(center[0] - 0.3, center[1] - 0.3);
    SetGrid(filter, { { 3, 3 } }, MakeVector2(0.3, 0.3), origin);
    filter->SetSlabNear(center[2] + near);
    filter->SetSlabFar(center[2] + far);
    filter->Update();
    const auto * output = filter->GetOutput();
    for (const auto & index : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
    {
      const double u = origin[0] + 0.3 * static_cast<double>(index[0]);
      const double v = origin[1] + 0.3 * static_cast<double>(index[1]);
      double       expected = -1e9;
      for (const double depth : { near, far })
      {
        const auto place = view->TransformPoint(MakePoint3(u, v, center[2] + depth));
        expected = std::max(expected, place[0] + 2 * place[1] + 3 * place[2]);
      }
      ASSERT_NEAR(output->GetPixel(index), expected, 1e-4);
    }
  }
}

TEST(ShearWarpExactRays, NoSampleIsBetter)
{
  Random random(2409);
  for (int repeat = 0; repeat < 10; ++repeat)
  {
    const auto image = MakeRandomImage<unsigned short>(random, MakeRandomSize(random, 2, 40));
    const auto view = MakeRandomView(random, AllViewKinds[repeat % 3], image);
    const auto filter = MakeExactFilter(image, view);
    filter->Update();
    const auto * output = filter->GetOutput();
    const auto & region = output->GetBufferedRegion();
    const auto [lower, upper] = FindCornerBounds(view, image);
    int samples = 0;
    while (samples < 1000)
    {
      const auto                             index = DrawIndex(random, region);
      const auto                             place = output->TransformIndexToPhysicalPoint<double>(index);
      const InterpolantOnRay<unsigned short> ray(image, view, place[0], place[1]);
      const double                           depth = random.Uniform(lower[2], upper[2]);
      if (ray.Contains(depth))
      {
        ASSERT_LE(ray.At(depth), static_cast<long double>(output->GetPixel(index)) + 0.5L + 65535.0L / 16384);
        ++samples;
      }
      // half of the corners of small images' bounds have no ray
      if (ray.GetLength() <= 0 && region.GetNumberOfPixels() < 4)
      {
        break;
      }
    }
  }
}

/** One bright voxel in each place of the blocks and tiles that are left out where they are dark. */
TEST(ShearWarpExactRays, AllPlacesInTheVolumeAreSeen)
{
  for (const double angle : { 0.4, -0.3 })
  {
    std::vector<unsigned short> expected;
    for (itk::IndexValueType place = 3; place < 45; ++place)
    {
      SCOPED_TRACE(place);
      const auto image = MakePlainImage<unsigned short>({ { 48, 48, 48 } });
      image->SetPixel({ { place, place, place } }, 1000);
      image->SetOrigin(PointType(-static_cast<double>(place)));
      const auto transform = itk::Euler3DTransform<double>::New();
      transform->SetRotation(angle, 0.7 * angle, 0.0);
      const auto filter = MakeExactFilter(image, transform);
      SetGrid(filter, { { 10, 10 } }, itk::Vector<double, 2>(0.25), itk::Point<double, 2>(-1.125));
      filter->Update();
      const auto picture = GetPixels(filter->GetOutput());
      expected = expected.empty() ? picture : expected;
      for (std::size_t n = 0; n < picture.size(); ++n)
      {
        EXPECT_NEAR(picture[n], expected[n], 1);
      }
    }
    EXPECT_GT(*std::max_element(expected.begin(), expected.end()), 500);
  }
}

/** Sines and cosines of right angles are not exactly 0: rays are on the borders of tiles but for rounding errors. */
TEST(ShearWarpExactRays, TurnsByRightAnglesHaveNoHoles)
{
  Random random(2412);
  for (int repeat = 0; repeat < 200; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto edge = static_cast<itk::SizeValueType>(random.Integer(1, 70));
    const auto image = MakePlainImage<unsigned short>({ { edge, edge, edge } }, 1000);
    if (repeat % 2 == 0)
    {
      image->SetSpacing(MakeVector3(random.Uniform(0.5, 2), random.Uniform(0.5, 2), random.Uniform(0.5, 2)));
      image->SetOrigin(MakePoint3(random.Uniform(-90, 90), random.Uniform(-90, 90), random.Uniform(-90, 90)));
    }
    const auto view = itk::Euler3DTransform<double>::New();
    const auto angle = [&random] { return static_cast<double>(random.Integer(-3, 3)) * 0.5 * itk::Math::pi; };
    view->SetRotation(angle(), angle(), angle());
    const auto viewOfImage = MakeView(view->GetMatrix(), PointType(0.0));
    const auto filter = MakeExactFilter(image, viewOfImage);
    filter->Update();
    const auto * output = filter->GetOutput();
    for (const auto & index : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
    {
      const auto place = output->TransformIndexToPhysicalPoint<double>(index);
      const auto length = InterpolantOnRay<unsigned short>(image, viewOfImage, place[0], place[1]).GetLength();
      if (std::abs(length) > 1e-9L)
      {
        ASSERT_EQ(output->GetPixel(index), length > 0 ? 1000 : 0) << index;
      }
    }
  }
}

/** Many rays in a cell, in parts. */
TEST(ShearWarpExactRays, AnyZoomHasTheSameBits)
{
  Random     random(2413);
  const auto image = MakeRandomImage<short>(random, { { 30, 25, 20 } });
  const auto view = MakeRandomView(random, ViewKind::Rigid, image.GetPointer());
  const auto filter = MakeExactFilter(image, view);
  const auto center = view->GetInverseTransform()->TransformPoint(GetCenter(image));
  SetGrid(filter, { { 300, 300 } }, MakeVector2(0.01, 0.01), MakePoint2(center[0] - 1.5, center[1] - 1.5));
  filter->SetNumberOfWorkUnits(3);
  filter->Update();
  const auto whole = Copy(filter->GetOutput());
  // every hundredth one
  filter->SetOutputSpacing(MakeVector2(1.0, 1.0));
  filter->SetSize({ { 3, 3 } });
  filter->Update();
  for (const auto & index : itk::ImageRegionIndexRange<2>(filter->GetOutput()->GetBufferedRegion()))
  {
    EXPECT_NEAR(whole->GetPixel({ { 100 * index[0], 100 * index[1] } }), filter->GetOutput()->GetPixel(index), 1);
  }
}

TEST(ShearWarpExactRays, OrderOfAxesChangesAtMostOneUnit)
{
  Random                            random(2410);
  std::array<std::array<int, 3>, 6> orders{
    { { 0, 1, 2 }, { 0, 2, 1 }, { 1, 0, 2 }, { 1, 2, 0 }, { 2, 0, 1 }, { 2, 1, 0 } }
  };
  for (int repeat = 0; repeat < 48; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto image = MakeRandomImage<short>(random, { { 23, 17, 12 } });
    const auto view = MakeRandomView(random, AllViewKinds[random.Integer(0, 2)], image);
    // the same voxels in the same places, by other indices
    const auto &  order = orders[repeat % 6];
    const int     flips = repeat / 6;
    const auto &  region = image->GetBufferedRegion();
    itk::Size<3>  size;
    MatrixType    direction;
    auto          spacing = image->GetSpacing();
    itk::Index<3> corner = region.GetIndex();
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const auto from = static_cast<unsigned int>(order[axis]);
      const bool isFlipped = (flips >> axis & 1) != 0;
      size[axis] = region.GetSize(from);
      spacing[axis] = image->GetSpacing()[from];
      corner[from] += isFlipped ? static_cast<itk::IndexValueType>(region.GetSize(from)) - 1 : 0;
      for (unsigned int n = 0; n < 3; ++n)
      {
        direction(n, axis) = (isFlipped ? -1.0 : 1.0) * image->GetDirection()(n, from);
      }
    }
    const auto other = MakePlainImage<short>(size);
    other->SetSpacing(spacing);
    other->SetDirection(direction);
    other->SetOrigin(image->TransformIndexToPhysicalPoint<double>(corner));
    FillByIndex(other, [&](const auto & otherIndex) {
      itk::Index<3> index = corner;
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        index[order[axis]] += ((flips >> axis & 1) != 0 ? -1 : 1) * otherIndex[axis];
      }
      return image->GetPixel(index);
    });

    const auto filter = MakeExactFilter(image, view);
    filter->SetMode(static_cast<ModeEnum>(repeat % 2));
    filter->Update();
    const auto first = Copy(filter->GetOutput());
    SetGrid(filter, first->GetBufferedRegion().GetSize(), first->GetSpacing(), first->GetOrigin());
    filter->SetInput(other);
    filter->Update();
    int beside = 0;
    for (const auto & index : itk::ImageRegionIndexRange<2>(first->GetBufferedRegion()))
    {
      const auto place = first->TransformIndexToPhysicalPoint<double>(index);
      if (std::abs(InterpolantOnRay<short>(image, view, place[0], place[1]).GetLength()) > 1e-9L)
      {
        ASSERT_NEAR(filter->GetOutput()->GetPixel(index), first->GetPixel(index), 1) << index;
        ++beside;
      }
    }
    EXPECT_GT(beside, 100);
  }
}

/** The principal axis of a cube changes at 45 degrees. */
TEST(ShearWarpExactRays, PicturesDoNotJumpWhereThePrincipalAxisChanges)
{
  Random     random(2411);
  const auto image = MakePlainImage<float>({ { 48, 48, 48 } });
  FillRandom(random, image.GetPointer());
  const auto filter = MakeFilter(image);
  SetGrid(filter, { { 150, 110 } }, MakeVector2(0.4, 0.4), MakePoint2(-30, -22));
  const auto project = [&](bool isExact, double azimuth, unsigned int & axis) {
    using DirectionEnum = itk::ShearWarpMIPView::DirectionEnum;
    filter->SetTransform(itk::ShearWarpMIPView::MakeTransform(image, DirectionEnum::Anterior, azimuth, 30));
    filter->SetExact(isExact);
    filter->Update();
    axis = filter->GetPrincipalAxis();
    return GetPixels(filter->GetOutput());
  };
  const auto measure = [&](bool isExact, double azimuth, bool isSwitch) {
    unsigned int axes[2];
    const auto   before = project(isExact, azimuth - 0.001, axes[0]);
    const auto   after = project(isExact, azimuth + 0.001, axes[1]);
    EXPECT_EQ(axes[0] != axes[1], isSwitch);
    double change = 0.0;
    for (std::size_t n = 0; n < before.size(); ++n)
    {
      change += std::abs(static_cast<double>(after[n]) - static_cast<double>(before[n]));
    }
    return change;
  };
  EXPECT_LT(measure(true, 45.0, true), 1.1 * 0.5 * (measure(true, 44.9, false) + measure(true, 45.1, false)));
  EXPECT_GT(measure(false, 45.0, true), 10.0 * measure(false, 44.9, false));
}

TEST(ShearWarpExactNumbers, CellsWithAVoxelThatIsNotFiniteAreLeftOut)
{
  constexpr float notANumber = std::numeric_limits<float>::quiet_NaN();
  constexpr float infinity = std::numeric_limits<float>::infinity();
  for (const float hole : { notANumber, infinity, -infinity })
  {
    const auto image = MakePlainImage<float>({ { 5, 5, 5 } }, 3);
    image->SetPixel({ { 2, 2, 2 } }, hole);
    image->SetPixel({ { 2, 2, 0 } }, 9.0f);
    const auto through = ProjectRay(image, MakePoint3(2.0, 2.0, 0.0), MakeVector3(0, 0, 1));
    EXPECT_EQ(through.first, 9.0f);
    image->FillBuffer(hole);
    const auto nothing = ProjectRay(image, MakePoint3(2.0, 2.0, 0.0), MakeVector3(0, 0, 1));
    EXPECT_EQ(nothing.first, 0.0f);
    EXPECT_TRUE(std::isnan(nothing.second));
  }
}

TEST(ShearWarpExactParameters, WhatHasNoBoundIsRefused)
{
  Random     random(2406);
  const auto image = MakeRandomImage<short>(random, { { 9, 9, 9 } });
  const auto expectRefused = [&](const auto & set) {
    const auto anterior = itk::ShearWarpMIPView::DirectionEnum::Anterior;
    const auto filter = MakeExactFilter(image, itk::ShearWarpMIPView::MakeTransform(image, anterior));
    EXPECT_NO_THROW(filter->Update());
    set(filter.GetPointer());
    EXPECT_NAMES(filter->Update(), "Exact");
  };
  using Filter = FilterType<short>;
  expectRefused([](Filter * filter) { filter->LocalMaximumOn(); });
  expectRefused([](Filter * filter) { filter->SetDepthAttenuation(0.1); });
  expectRefused([](Filter * filter) { filter->SetOversampling(2); });
  expectRefused([&](Filter * filter) { filter->SetMaskImage(MakeMask(image)); });
}
