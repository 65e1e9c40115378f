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
#ifndef itkShearWarpMIPTestOracle_h
#define itkShearWarpMIPTestOracle_h

#include "itkShearWarpFactorization.h"
#include "itkShearWarpMIPTestImages.h"

#include <array>

/** An evaluation of projections that shares no code with the module: from transform, image and output grid alone. */
namespace itk::ShearWarpMIPTest
{
/** Which samples of a ray count, and which of them is its value. */
template <typename TPixel>
struct RayRule : SampleRule<TPixel>
{
  static constexpr double Infinity = std::numeric_limits<double>::infinity();

  double                                         slabNear{ -Infinity };
  double                                         slabFar{ Infinity };
  PointType                                      cropLower{ -Infinity };
  PointType                                      cropUpper{ Infinity };
  typename Image<unsigned char, 3>::ConstPointer mask;
  unsigned char                                  maskLabel{ 0 };
  double                                         attenuation{ 0.0 };
  TPixel                                         background{};
};

inline Image<unsigned char, 3>::Pointer
MakeMask(const ImageBase<3> * image, unsigned char label = 0)
{
  const auto mask = MakeAlike<unsigned char>(image, image->GetLargestPossibleRegion());
  mask->FillBuffer(label);
  return mask;
}

/** Blobs of labels 1 and 2, and single voxels. */
inline Image<unsigned char, 3>::Pointer
MakeRandomMask(Random & random, const ImageBase<3> * image)
{
  const auto    mask = MakeMask(image);
  const auto    region = image->GetLargestPossibleRegion();
  const auto    length = random.Integer(1, random.Integer(0, 1) == 0 ? 7 : 40);
  const bool    hasSpecks = random.Integer(0, 1) == 0;
  std::uint64_t labels[512];
  std::generate_n(labels, 512, [&] { return random.Bits() % 3; });
  for (const auto & index : ImageRegionIndexRange<3>(region))
  {
    std::int64_t cell = 0;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      cell = cell * 8 + (index[axis] - region.GetIndex(axis)) / length % 8;
    }
    mask->SetPixel(index, static_cast<unsigned char>(hasSpecks && random.Integer(0, 20) == 0 ? 1 : labels[cell]));
  }
  return mask;
}

/** As modes.md says: how far beyond limits samples count, in extents of a voxel. */
constexpr long double LimitTolerance = 1e-9L;

/** Along the axes of physical space. */
using VoxelExtents = std::array<long double, 3>;

inline VoxelExtents
GetVoxelExtents(const ImageBase<3> * image)
{
  VoxelExtents extents{};
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    for (unsigned int n = 0; n < 3; ++n)
    {
      extents[axis] += std::abs(static_cast<long double>(image->GetDirection()(axis, n)) * image->GetSpacing()[n]);
    }
  }
  return extents;
}

/** Chooses a slab and a box for the filter and for its rule; some of their ends are open if \a mayBeOpen, and some lie
 * in the centers of voxels. */
template <typename TFilter, typename TPixel>
void
DrawSlabAndBox(Random &             random,
               TFilter *            filter,
               const ViewBaseType * view,
               const ImageBase<3> * image,
               bool                 mayBeOpen,
               RayRule<TPixel> &    rule)
{
  const auto [lower, upper] = FindCornerBounds(view, image);
  const bool endsInVoxels = random.Integer(0, 2) == 0;
  const auto drawVoxel = [&random, image] {
    Index<3> index = DrawIndex(random, image->GetLargestPossibleRegion());
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const auto first = image->GetLargestPossibleRegion().GetIndex(axis);
      const auto length = static_cast<IndexValueType>(image->GetLargestPossibleRegion().GetSize(axis));
      // at the ends, where the slices of oblique views have samples in voxels
      const IndexValueType places[] = { index[axis], first, first + length - 1 };
      index[axis] = places[random.Integer(0, 2)];
    }
    return image->template TransformIndexToPhysicalPoint<double>(index);
  };
  if (random.Integer(0, 1) == 0)
  {
    double ends[] = { random.Uniform(lower[2], upper[2]), random.Uniform(lower[2], upper[2]) };
    if (endsInVoxels)
    {
      ends[0] = view->GetInverseTransform()->TransformPoint(drawVoxel())[2];
      ends[1] = random.Integer(0, 1) == 0 ? ends[0] : view->GetInverseTransform()->TransformPoint(drawVoxel())[2];
    }
    rule.slabNear = mayBeOpen && random.Integer(0, 3) == 0 ? rule.slabNear : std::min(ends[0], ends[1]);
    rule.slabFar = mayBeOpen && random.Integer(0, 3) == 0 ? rule.slabFar : std::max(ends[0], ends[1]);
    filter->SetSlabNear(rule.slabNear);
    filter->SetSlabFar(rule.slabFar);
  }
  if (random.Integer(0, 2) == 0)
  {
    const PointType center = GetCenter(image);
    const PointType corners[] = { drawVoxel(), drawVoxel() };
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      if (endsInVoxels)
      {
        rule.cropLower[axis] = std::min(corners[0][axis], corners[1][axis]);
        rule.cropUpper[axis] = std::max(corners[0][axis], corners[1][axis]);
        continue;
      }
      rule.cropLower[axis] = center[axis] - random.Uniform(0, 0.4) * (upper[2] - lower[2]);
      rule.cropUpper[axis] = center[axis] + random.Uniform(0, 0.4) * (upper[2] - lower[2]);
    }
    rule.cropUpper[2] = mayBeOpen && random.Integer(0, 1) == 0 ? rule.Infinity : rule.cropUpper[2];
    filter->SetCropLower(rule.cropLower);
    filter->SetCropUpper(rule.cropUpper);
  }
}

constexpr ShearWarp::Mode AllModes[] = { ShearWarp::Mode::Maximum,
                                         ShearWarp::Mode::Minimum,
                                         ShearWarp::Mode::AbsoluteMaximum,
                                         ShearWarp::Mode::Mean };
/** The first ones, which take one sample of a ray. */
constexpr int CountOfExtrema = 3;

/** Chooses parameters, for the filter and for the rule that its result must follow. */
template <typename TFilter, typename TPixel>
RayRule<TPixel>
DrawRule(Random & random, TFilter * filter, const ViewBaseType * view, const Image<TPixel, 3> * image)
{
  RayRule<TPixel> rule;
  filter->SetMode(AllModes[random.Integer(0, std::size(AllModes) - 1)]);
  rule.mode = static_cast<RayMode>(filter->GetMode());
  const auto hasFeature = [filter](ShearWarp::Feature feature) {
    return ShearWarp::HasFeature(filter->GetMode(), feature);
  };
  rule.isNearest = hasFeature(ShearWarp::Feature::Nearest) && random.Integer(0, 3) == 0;
  filter->SetInterpolation(rule.isNearest ? ShearWarp::Interpolation::Nearest : ShearWarp::Interpolation::Linear);
  DrawSlabAndBox(random, filter, view, image, true, rule);
  if (random.Integer(0, 1) == 0)
  {
    const auto mask = MakeRandomMask(random, image);
    rule.mask = mask;
    rule.maskLabel = static_cast<unsigned char>(random.Integer(0, 2));
    filter->SetMaskImage(mask);
    filter->SetMaskLabel(rule.maskLabel);
  }
  if (hasFeature(ShearWarp::Feature::LocalMaximum) && random.Integer(0, 1) == 0)
  {
    rule.isLocal = true;
    rule.threshold = MakeRandomPixel<TPixel>(random);
    filter->LocalMaximumOn();
    filter->SetLocalMaximumThreshold(rule.threshold);
  }
  filter->SetComputeDepth(hasFeature(ShearWarp::Feature::Depth) && random.Integer(0, 1) == 0);
  return rule;
}

/** The place in the view plane of a pixel of an axis-aligned grid, without the rounding of a direction. */
inline Point<double, 2>
GetPlace(const ImageBase<2> * grid, const Index<2> & index)
{
  return MakePoint2(grid->GetOrigin()[0] + grid->GetSpacing()[0] * static_cast<double>(index[0]),
                    grid->GetOrigin()[1] + grid->GetSpacing()[1] * static_cast<double>(index[1]));
}

// The projection of an image, pixel by pixel; `oversampling` is the number of intermediate pixels per voxel.
template <typename TPixel>
class BruteForceProjection
{
public:
  using ImageType = Image<TPixel, 3>;

  BruteForceProjection(const ViewBaseType *    view,
                       const ImageType *       image,
                       int                     oversampling = 1,
                       const RayRule<TPixel> & rule = {})
    : m_Image(image)
    , m_Oversampling(oversampling)
    , m_Rule(rule)
    , m_VoxelExtents(GetVoxelExtents(image))
  {
    long double indexToPhysical[3][3];
    long double viewMatrix[3][3];
    for (int row = 0; row < 3; ++row)
    {
      for (int column = 0; column < 3; ++column)
      {
        const long double spacing = image->GetSpacing()[column];
        indexToPhysical[row][column] = image->GetDirection()(row, column) * spacing;
        viewMatrix[row][column] = view->GetMatrix()(row, column);
      }
    }
    // c = M q + m by Cramer's rule, c relative to the start of the region
    const long double determinant = Determinant(indexToPhysical);
    const auto        solve = [&](const long double(&right)[3], long double(&solution)[3]) {
      for (int axis = 0; axis < 3; ++axis)
      {
        long double replaced[3][3];
        std::memcpy(replaced, indexToPhysical, sizeof(replaced));
        for (int row = 0; row < 3; ++row)
        {
          replaced[row][axis] = right[row];
        }
        solution[axis] = Determinant(replaced) / determinant;
      }
    };
    for (int column = 0; column < 3; ++column)
    {
      const long double right[3] = { viewMatrix[0][column], viewMatrix[1][column], viewMatrix[2][column] };
      solve(right, m_Axes[column]);
    }
    long double right[3];
    for (int row = 0; row < 3; ++row)
    {
      right[row] = static_cast<long double>(view->GetOffset()[row]) - image->GetOrigin()[row];
    }
    solve(right, m_Offset);
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      m_Offset[axis] -= image->GetLargestPossibleRegion().GetIndex(axis);
      m_Length[axis] = static_cast<std::int64_t>(image->GetLargestPossibleRegion().GetSize(axis));
    }

    const long double(&ray)[3] = m_Axes[2];
    constexpr long double tie = 1.0L + 1e-10L;
    m_K = 2;
    m_K = std::abs(ray[1]) > tie * std::abs(ray[m_K]) ? 1 : m_K;
    m_K = std::abs(ray[0]) > tie * std::abs(ray[m_K]) ? 0 : m_K;
    m_I = m_K == 0 ? 1 : 0;
    m_J = m_K == 2 ? 1 : 2;
    const int across[2] = { m_I, m_J };
    for (int n = 0; n < 2; ++n)
    {
      m_Shear[n] = -ray[across[n]] / ray[m_K];
      m_Translation[n] = std::max(0.0L, -m_Shear[n] * (m_Length[m_K] - 1));
      m_Margin = std::min(m_Margin, 1.0L - std::abs(m_Shear[n]));
      m_MemoLength[n] = oversampling * (m_Length[across[n]] + m_Length[m_K] + 2);
    }
    m_Memo.resize(m_MemoLength[0] * m_MemoLength[1]);
    m_MemoState.resize(m_Memo.size(), Unknown);
    m_MemoSlices.resize(m_Memo.size());

    m_Condition = GetCondition(indexToPhysical) * GetCondition(viewMatrix);

    const long double axesDeterminant = Determinant(m_Axes);
    for (int column = 0; column < 3; ++column)
    {
      long double replaced[3][3];
      for (int axis = 0; axis < 3; ++axis)
      {
        for (int row = 0; row < 3; ++row)
        {
          replaced[axis][row] = axis == 2 ? (row == column ? 1.0L : 0.0L) : m_Axes[axis][row];
        }
      }
      m_DepthOfIndex[column] = Determinant(replaced) / axesDeterminant;
    }
    // the sphere's least depth; in physical space, the depth's gradient has the direction of u x v
    long double center = 0.0L;
    for (int axis = 0; axis < 3; ++axis)
    {
      center += m_DepthOfIndex[axis] * (0.5L * (m_Length[axis] - 1) - m_Offset[axis]);
    }
    long double squaredRadius = 0.0L;
    for (int corner = 0; corner < 4; ++corner)
    {
      const long double lengths[3] = { static_cast<long double>(m_Length[0]),
                                       static_cast<long double>(corner % 2 == 0 ? m_Length[1] : -m_Length[1]),
                                       static_cast<long double>(corner < 2 ? m_Length[2] : -m_Length[2]) };
      long double       squared = 0.0L;
      for (const auto & row : indexToPhysical)
      {
        const long double half = 0.5L * (row[0] * lengths[0] + row[1] * lengths[1] + row[2] * lengths[2]);
        squared += half * half;
      }
      squaredRadius = std::max(squaredRadius, squared);
    }
    const long double viewDeterminant = Determinant(viewMatrix);
    long double       squaredSlope = 0.0L;
    for (int axis = 0; axis < 3; ++axis)
    {
      const int         next = (axis + 1) % 3;
      const int         last = (axis + 2) % 3;
      const long double cofactor =
        viewMatrix[next][0] * viewMatrix[last][1] - viewMatrix[last][0] * viewMatrix[next][1];
      squaredSlope += cofactor * cofactor / (viewDeterminant * viewDeterminant);
    }
    m_FadeBegin = std::max<long double>(center - std::sqrt(squaredSlope * squaredRadius), rule.slabNear);
  }

  unsigned int
  GetPrincipalAxis() const
  {
    return static_cast<unsigned int>(m_K);
  }

  bool
  LooksAlongAxis() const
  {
    return m_Axes[2][m_K] > 0;
  }

  /** Smaller errors, in voxels, of the positions that were evaluated and of the shear make no difference. */
  long double
  GetMargin() const
  {
    return m_Margin;
  }

  TPixel
  Evaluate(double u, double v, TPixel background)
  {
    std::int64_t position[2];
    if (!this->FindPosition(u, v, position))
    {
      return background;
    }
    return InterpolateReached(
      [this](std::int64_t p, std::int64_t q, TPixel & value) { return this->GetIntermediate(p, q, value); },
      position[0],
      position[1],
      background);
  }

  /** The depth, in view space, of the slice of the intermediate pixel that has the largest weight at (u, v);
   * not-a-number where there is none. */
  double
  EvaluateDepth(double u, double v)
  {
    std::int64_t position[2];
    std::int64_t slice = -1;
    if (this->FindPosition(u, v, position))
    {
      const std::int64_t  i = DivideDown(position[0], WholePixel);
      const std::int64_t  j = DivideDown(position[1], WholePixel);
      const CornerWeights next(position[0] - i * WholePixel, position[1] - j * WholePixel);
      std::int64_t        largest = 0;
      for (int n = 0; n < 4; ++n)
      {
        TPixel value;
        if (next.weights[3 - n] > largest && this->GetIntermediate(i + n % 2, j + n / 2, value))
        {
          largest = next.weights[3 - n];
          slice = m_MemoSlices[static_cast<std::size_t>((j + n / 2) * m_MemoLength[0] + i + n % 2)];
        }
      }
    }
    if (slice < 0)
    {
      return std::numeric_limits<double>::quiet_NaN();
    }
    const long double atZero = m_Axes[0][m_K] * u + m_Axes[1][m_K] * v + m_Offset[m_K];
    return static_cast<double>((slice - atZero) / m_Axes[2][m_K]);
  }

  /** Whether the value at (u, v) rests on the last digits of a double: a position there, or of a slice, is about
   * half-way between two multiples of 1/2^15; or the principal axis does. */
  bool
  IsTie(double u, double v) const
  {
    long double c[3];
    long double scale = 0.0L;
    for (int axis = 0; axis < 3; ++axis)
    {
      c[axis] = m_Axes[0][axis] * u + m_Axes[1][axis] * v + m_Offset[axis];
      scale += std::abs(m_Axes[0][axis] * u) + std::abs(m_Axes[1][axis] * v) + std::abs(m_Offset[axis]) +
               static_cast<long double>(m_Length[axis]);
    }
    const auto isTie = [](long double position, long double uncertainty) {
      return Quantize(position - uncertainty) != Quantize(position + uncertainty);
    };
    const long double  error = 0x1p-45L * m_Condition;
    const std::int64_t across[2] = { m_I, m_J };
    for (int n = 0; n < 2; ++n)
    {
      for (std::int64_t k = 0; k < m_Length[m_K]; ++k)
      {
        if (isTie(m_Shear[n] * k + m_Translation[n], error * m_Length[m_K]))
        {
          return true;
        }
      }
      const long double position = c[across[n]] + m_Shear[n] * c[m_K] + m_Translation[n];
      if (isTie(m_Oversampling * (position + 1) - 1, error * scale))
      {
        return true;
      }
    }
    return false;
  }

  typename Image<TPixel, 2>::Pointer
  Evaluate(const ImageBase<2> * grid, TPixel background)
  {
    const auto output = MakeAlike<TPixel>(grid, grid->GetLargestPossibleRegion());
    FillByIndex(output, [&](const Index<2> & index) {
      const auto place = GetPlace(grid, index);
      return this->Evaluate(place[0], place[1], background);
    });
    return output;
  }

private:
  enum State : char
  {
    Unknown,
    None,
    Known
  };

  /** By the Frobenius norm. */
  static long double
  GetCondition(const long double (&m)[3][3])
  {
    long double squaredNorm = 0.0L;
    long double squaredNormOfCofactors = 0.0L;
    for (int row = 0; row < 3; ++row)
    {
      for (int column = 0; column < 3; ++column)
      {
        const int         a = (row + 1) % 3, b = (row + 2) % 3, c = (column + 1) % 3, d = (column + 2) % 3;
        const long double cofactor = m[a][c] * m[b][d] - m[a][d] * m[b][c];
        squaredNorm += m[row][column] * m[row][column];
        squaredNormOfCofactors += cofactor * cofactor;
      }
    }
    return std::sqrt(squaredNorm * squaredNormOfCofactors) / std::abs(Determinant(m));
  }

  static long double
  Determinant(const long double (&m)[3][3])
  {
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  }

  /** Where (u, v) is in the intermediate image, in 1/2^15; false far outside. */
  bool
  FindPosition(double u, double v, std::int64_t (&position)[2])
  {
    const int across[2] = { m_I, m_J };
    for (int n = 0; n < 2; ++n)
    {
      const auto        index = [&](int axis) { return m_Axes[0][axis] * u + m_Axes[1][axis] * v + m_Offset[axis]; };
      const long double sheared = index(across[n]) + m_Shear[n] * index(m_K) + m_Translation[n];
      if (!(sheared > -2.0L && sheared < m_MemoLength[n] + 2.0L))
      {
        return false;
      }
      position[n] = this->Round(m_Oversampling * (sheared + 1) - 1);
    }
    return true;
  }

  /** In 1/2^15. Whole numbers are rounded half upward, or half downward for the place of a slice. */
  std::int64_t
  Round(long double position, bool isOfSlice = false)
  {
    const long double steps = position * WholePixel;
    const long double beyondHalf = std::abs(std::abs(steps - std::round(steps)) - 0.5L);
    m_Margin = std::min(m_Margin, beyondHalf / WholePixel);
    if (!m_Rule.isNearest)
    {
      return Quantize(position);
    }
    // a half, which is rounded after the quantization, is beside a quantized number by half a unit
    return isOfSlice ? -RoundToWhole(-Quantize(position)) : RoundToWhole(Quantize(position));
  }

  bool
  GetIntermediate(std::int64_t p, std::int64_t q, TPixel & value)
  {
    if (p < 0 || p >= m_MemoLength[0] || q < 0 || q >= m_MemoLength[1])
    {
      return false;
    }
    const auto place = static_cast<std::size_t>(q * m_MemoLength[0] + p);
    if (m_MemoState[place] == Unknown)
    {
      m_MemoState[place] = this->ComputeIntermediate(p, q, m_Memo[place], m_MemoSlices[place]) ? Known : None;
    }
    value = m_Memo[place];
    return m_MemoState[place] == Known;
  }

  bool
  ComputeIntermediate(std::int64_t p, std::int64_t q, TPixel & value, std::int64_t & slice)
  {
    // pixel -1 is sheared voxel -1
    const std::int64_t             column = (p + 1) * WholePixel / m_Oversampling - WholePixel;
    const std::int64_t             row = (q + 1) * WholePixel / m_Oversampling - WholePixel;
    std::vector<RaySample<TPixel>> samples;
    for (std::int64_t n = 0; n < m_Length[m_K]; ++n)
    {
      const std::int64_t k = this->LooksAlongAxis() ? n : m_Length[m_K] - 1 - n;
      const long double  offset[2] = { m_Shear[0] * k + m_Translation[0], m_Shear[1] * k + m_Translation[1] };
      TPixel             sample{};
      if (this->Sample(k, column - this->Round(offset[0], true), row - this->Round(offset[1], true), sample) &&
          IsNumber(sample) &&
          this->IsIncluded(k,
                           static_cast<long double>(column) / WholePixel - offset[0],
                           static_cast<long double>(row) / WholePixel - offset[1],
                           sample))
      {
        samples.push_back({ sample, k });
      }
    }
    if (samples.empty())
    {
      return false;
    }
    const RaySample<TPixel> chosen = ChooseSample(m_Rule, samples);
    value = WithoutSignOfZero(chosen.value);
    slice = chosen.slice;
    // a mean of both infinities is none
    return value == value;
  }

  bool
  Sample(std::int64_t k, std::int64_t column, std::int64_t row, TPixel & sample) const
  {
    const std::int64_t strides[3] = { 1, m_Length[0], m_Length[0] * m_Length[1] };
    const auto         getVoxel = [&](const auto * voxels, std::int64_t i, std::int64_t j) {
      return voxels[i * strides[m_I] + j * strides[m_J] + k * strides[m_K]];
    };
    const TPixel * voxels = m_Image->GetBufferPointer();
    const auto     voxel = [&](std::int64_t i, std::int64_t j) { return getVoxel(voxels, i, j); };
    if (!SampleSlice(voxel, m_Length[m_I], m_Length[m_J], column, row, sample))
    {
      return false;
    }
    if (!m_Rule.mask)
    {
      return true;
    }
    const unsigned char * labels = m_Rule.mask->GetBufferPointer();
    const auto            isIn = [&](std::int64_t i, std::int64_t j) {
      const unsigned char label = getVoxel(labels, i, j);
      return m_Rule.maskLabel == 0 ? label != 0 : label == m_Rule.maskLabel;
    };
    const auto nearest = [](std::int64_t position) { return DivideDown(position + WholePixel / 2, WholePixel); };
    if (!isIn(nearest(column), nearest(row)))
    {
      return false;
    }
    // voxels beyond the image are those at its edge
    const auto clampTo = [](std::int64_t position, std::int64_t length) {
      return std::clamp<std::int64_t>(position, 0, (length - 1) * WholePixel);
    };
    const std::int64_t inColumn = clampTo(column, m_Length[m_I]);
    const std::int64_t inRow = clampTo(row, m_Length[m_J]);
    const auto         pixel = [&](std::int64_t i, std::int64_t j, TPixel & value) {
      const bool counts = isIn(i, j);
      value = counts ? voxel(i, j) : TPixel{};
      return counts;
    };
    const std::int64_t columns[] = { DivideDown(inColumn, WholePixel), -DivideDown(-inColumn, WholePixel) };
    const std::int64_t rows[] = { DivideDown(inRow, WholePixel), -DivideDown(-inRow, WholePixel) };
    const bool         isWhole =
      isIn(columns[0], rows[0]) && isIn(columns[1], rows[0]) && isIn(columns[0], rows[1]) && isIn(columns[1], rows[1]);
    sample = isWhole ? sample : this->InterpolateBehind(pixel, inColumn, inRow);
    return true;
  }

  /** As InterpolateReached, but with the weights of a slice's samples: the first product is the product of the
   * neighbours before. */
  template <typename TPixelAt>
  static TPixel
  InterpolateBehind(const TPixelAt & pixel, std::int64_t column, std::int64_t row)
  {
    // counted from the other end, a slice is interpolated as an intermediate image is
    return InterpolateReached(
      [&](std::int64_t i, std::int64_t j, TPixel & value) { return pixel(-i, -j, value); }, -column, -row, TPixel{});
  }

  /** Whether the sample at (column, row), in voxels, of slice k counts; fades it. */
  bool
  IsIncluded(std::int64_t k, long double column, long double row, TPixel & sample) const
  {
    long double index[3];
    index[m_I] = column;
    index[m_J] = row;
    index[m_K] = static_cast<long double>(k);
    long double                depth = 0.0L;
    ContinuousIndex<double, 3> place;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      depth += m_DepthOfIndex[axis] * (index[axis] - m_Offset[axis]);
      place[axis] =
        static_cast<double>(index[axis]) + static_cast<double>(m_Image->GetLargestPossibleRegion().GetIndex(axis));
    }
    PointType point;
    m_Image->TransformContinuousIndexToPhysicalPoint(place, point);
    const auto isWithin = [](long double position, long double low, long double high, long double extentOfVoxel) {
      return position >= low - LimitTolerance * extentOfVoxel && position <= high + LimitTolerance * extentOfVoxel;
    };
    const auto & d = m_DepthOfIndex;
    bool         isIncluded =
      isWithin(depth, m_Rule.slabNear, m_Rule.slabFar, std::abs(d[0]) + std::abs(d[1]) + std::abs(d[2]));
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      isIncluded =
        isIncluded && isWithin(point[axis], m_Rule.cropLower[axis], m_Rule.cropUpper[axis], m_VoxelExtents[axis]);
    }
    if (m_Rule.attenuation > 0.0)
    {
      const auto        background = static_cast<long double>(m_Rule.background);
      const long double factor = std::min(std::exp(-m_Rule.attenuation * (depth - m_FadeBegin)), 1.0L);
      const long double faded = background + (static_cast<long double>(sample) - background) * factor;
      const long double rounded = std::is_integral_v<TPixel> ? std::floor(faded + 0.5L) : faded;
      // of the largest integers a half may round up
      constexpr TPixel highest = std::numeric_limits<TPixel>::max();
      sample = rounded >= static_cast<long double>(highest) ? highest : static_cast<TPixel>(rounded);
    }
    return isIncluded;
  }

  bool
  IsNumber(TPixel sample) const
  {
    if constexpr (std::is_floating_point_v<TPixel>)
    {
      constexpr TPixel infinity = std::numeric_limits<TPixel>::infinity();
      return m_Rule.mode == RayMode::Maximum   ? sample > -infinity
             : m_Rule.mode == RayMode::Minimum ? sample < infinity
                                               : sample == sample;
    }
    return sample == sample;
  }

  const ImageType *         m_Image;
  int                       m_Oversampling;
  RayRule<TPixel>           m_Rule;
  VoxelExtents              m_VoxelExtents;
  long double               m_DepthOfIndex[3];
  long double               m_FadeBegin;
  long double               m_Condition;
  std::vector<std::int64_t> m_MemoSlices;
  long double               m_Axes[3][3]; // of view space, in index space
  long double               m_Offset[3];
  std::int64_t              m_Length[3];
  int                       m_I, m_J, m_K;
  long double               m_Shear[2];
  long double               m_Translation[2];
  long double               m_Margin{ 1.0 };
  std::int64_t              m_MemoLength[2];
  std::vector<TPixel>       m_Memo;
  std::vector<State>        m_MemoState;
};

} // namespace itk::ShearWarpMIPTest

#endif
