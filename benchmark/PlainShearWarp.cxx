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
#include "PlainShearWarp.h"

#include "itkMultiThreaderBase.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace itk::ShearWarpBenchmark
{
namespace
{
using ShearWarp::FractionBits;
using ShearWarp::One;

/** Equation 2: the sum in 1/2^15, which fits for pixels of up to 16 bits because the weights sum to 2^15. */
template <typename TPixel>
struct Sampler
{
  using SumType = std::int32_t;

  // the checker misses the specialization's members here
  // cppcheck-suppress uninitMemberVar
  explicit Sampler(const ShearWarp::SlicePlacement & placement)
    : weights(placement.column.fraction, placement.row.fraction)
  {}

  SumType
  operator()(SumType aa, SumType ab, SumType ba, SumType bb) const
  {
    return weights.aa * aa + weights.ab * ab + weights.ba * ba + weights.bb * bb;
  }

  static TPixel
  Round(SumType sum)
  {
    return static_cast<TPixel>((sum + One / 2) >> FractionBits);
  }

  ShearWarp::BilinearWeights weights;
};

/** Floating point: columns first, then rows. */
template <>
struct Sampler<float>
{
  using SumType = float;

  explicit Sampler(const ShearWarp::SlicePlacement & placement)
    : x(static_cast<float>(placement.column.fraction) / One)
    , y(static_cast<float>(placement.row.fraction) / One)
  {}

  SumType
  operator()(SumType aa, SumType ab, SumType ba, SumType bb) const
  {
    const float a = ab + x * (aa - ab);
    const float b = bb + x * (ba - bb);
    return b + y * (a - b);
  }

  static float
  Round(SumType sum)
  {
    return sum;
  }

  float x, y;
};

/** Up to four pixels of the intermediate image with their weights. */
template <typename TPixel>
class Mean
{
public:
  void
  Add(TPixel value, std::int32_t weight)
  {
    m_Sum += static_cast<SumType>(weight) * static_cast<SumType>(value);
    m_Weight += weight;
    m_Smallest = std::min(m_Smallest, value);
    m_Largest = std::max(m_Largest, value);
  }

  bool
  IsEmpty() const
  {
    return m_Weight == 0;
  }

  TPixel
  Get() const
  {
    if constexpr (std::is_floating_point_v<TPixel>)
    {
      return std::clamp(static_cast<TPixel>(m_Sum / static_cast<SumType>(m_Weight)), m_Smallest, m_Largest);
    }
    else
    {
      // half upward, for negative sums too
      const std::int64_t divisor = 2 * m_Weight;
      const std::int64_t dividend = 2 * m_Sum + m_Weight;
      return static_cast<TPixel>((dividend - (dividend % divisor + divisor) % divisor) / divisor);
    }
  }

private:
  using SumType = std::conditional_t<std::is_floating_point_v<TPixel>, double, std::int64_t>;

  SumType      m_Sum{ 0 };
  std::int64_t m_Weight{ 0 };
  TPixel       m_Smallest{ std::numeric_limits<TPixel>::max() };
  TPixel       m_Largest{ std::numeric_limits<TPixel>::lowest() };
};
} // namespace

template <typename TPixel>
void
PlainShearWarp<TPixel>::Prepare(unsigned int principalAxis)
{
  if (principalAxis != 0 || !m_Transposed.empty())
  {
    return;
  }
  const auto size = m_Image->GetBufferedRegion().GetSize();
  m_Transposed.resize(size[0] * size[1] * size[2]);
  MultiThreaderBase::New()->ParallelizeArray(
    0,
    size[2],
    [&](SizeValueType z) {
      constexpr SizeValueType tile = 32;
      const TPixel *          slice = m_Image->GetBufferPointer() + z * size[0] * size[1];
      TPixel *                transposed = m_Transposed.data() + z * size[0] * size[1];
      for (SizeValueType firstRow = 0; firstRow < size[1]; firstRow += tile)
      {
        const SizeValueType lastRow = std::min(firstRow + tile, size[1]);
        for (SizeValueType x = 0; x < size[0]; ++x)
        {
          for (SizeValueType y = firstRow; y < lastRow; ++y)
          {
            transposed[x * size[1] + y] = slice[y * size[0] + x];
          }
        }
      }
    },
    nullptr);
}

template <typename TPixel>
typename PlainShearWarp<TPixel>::Slices
PlainShearWarp<TPixel>::GetSlices(unsigned int principalAxis) const
{
  const auto     size = m_Image->GetBufferedRegion().GetSize();
  const auto     x = static_cast<std::ptrdiff_t>(size[0]);
  const auto     y = static_cast<std::ptrdiff_t>(size[1]);
  const auto     z = static_cast<std::ptrdiff_t>(size[2]);
  const TPixel * voxels = m_Image->GetBufferPointer();
  switch (principalAxis)
  {
    case 0:
      return { m_Transposed.data(), y, z, x, x * y, y };
    case 1:
      return { voxels, x, z, y, x * y, x };
    default:
      return { voxels, x, y, z, x, x * y };
  }
}

template <typename TPixel>
void
PlainShearWarp<TPixel>::ProjectRows(const ShearWarpFactorization & factorization,
                                    std::ptrdiff_t                 rowBegin,
                                    std::ptrdiff_t                 rowEnd,
                                    std::vector<TPixel> &          intermediate) const
{
  using SumType = typename Sampler<TPixel>::SumType;
  const Slices         slices = this->GetSlices(factorization.GetPrincipalAxis());
  const auto           columns = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[0]);
  std::vector<SumType> sums((rowEnd - rowBegin) * columns, std::numeric_limits<SumType>::lowest());

  for (std::ptrdiff_t k = 0; k < slices.slices; ++k)
  {
    const ShearWarp::SlicePlacement & placement = factorization.GetSlicePlacements()[k];
    const Sampler<TPixel>             sample(placement);
    const TPixel *                    slice = slices.voxels + k * slices.sliceStride;
    const std::ptrdiff_t              firstRow = placement.FirstRow();
    const std::ptrdiff_t              last = slices.columns - 1;

    for (std::ptrdiff_t q = std::max(rowBegin, firstRow); q < std::min(rowEnd, firstRow + slices.rows); ++q)
    {
      const std::ptrdiff_t j = q - placement.row.whole;
      const TPixel *       a = slice + std::max<std::ptrdiff_t>(j - 1, 0) * slices.rowStride;
      const TPixel *       b = slice + std::min(j, slices.rows - 1) * slices.rowStride;
      SumType *            row = sums.data() + (q - rowBegin) * columns + placement.column.whole;

      for (std::ptrdiff_t i = 1; i <= last; ++i)
      {
        row[i] = std::max(row[i], sample(a[i - 1], a[i], b[i - 1], b[i]));
      }
      // half a voxel beyond the outer voxel's centre, with its value
      const bool           atFirst = placement.FirstColumn() == placement.column.whole;
      const std::ptrdiff_t edge = atFirst ? 0 : last;
      SumType &            sum = row[atFirst ? 0 : last + 1];
      sum = std::max(sum, sample(a[edge], a[edge], b[edge], b[edge]));
    }
  }
  std::transform(sums.begin(), sums.end(), intermediate.begin() + rowBegin * columns, Sampler<TPixel>::Round);
}

template <typename TPixel>
std::vector<TPixel>
PlainShearWarp<TPixel>::Project(const ShearWarpFactorization & factorization) const
{
  const auto          size = factorization.GetIntermediateSize();
  std::vector<TPixel> intermediate(size[0] * size[1]);
  this->ProjectRows(factorization, 0, static_cast<std::ptrdiff_t>(size[1]), intermediate);
  return intermediate;
}

template <typename TPixel>
void
PlainShearWarp<TPixel>::WarpRows(const ShearWarpFactorization & factorization,
                                 const std::vector<TPixel> &    intermediate,
                                 std::ptrdiff_t                 rowBegin,
                                 std::ptrdiff_t                 rowEnd,
                                 std::ptrdiff_t                 columns,
                                 TPixel                         background,
                                 std::vector<TPixel> &          output)
{
  const auto           map = factorization.GetOutputToIntermediateMatrix();
  const auto &         reached = factorization.GetReachedColumns();
  const auto           rows = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[1]);
  const std::ptrdiff_t rowStride = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[0]);
  for (std::ptrdiff_t y = rowBegin; y < rowEnd; ++y)
  {
    for (std::ptrdiff_t x = 0; x < columns; ++x)
    {
      const auto locate = [&](unsigned int axis) {
        const double position =
          (map(axis, 0) * static_cast<double>(x) + map(axis, 1) * static_cast<double>(y)) + map(axis, 2);
        return static_cast<std::int64_t>(std::floor(position * One + 0.5));
      };
      const std::int64_t column = locate(0);
      const std::int64_t row = locate(1);
      const auto         columnFraction = static_cast<std::int32_t>(column & (One - 1));
      const auto         rowFraction = static_cast<std::int32_t>(row & (One - 1));

      // here the weights of the second pixel and row are those of the fraction
      const ShearWarp::BilinearWeights cell(columnFraction, rowFraction);
      const std::int32_t               weights[2][2] = { { cell.bb, cell.ba }, { cell.ab, cell.aa } };
      Mean<TPixel>                     mean;
      for (unsigned int corner = 0; corner < 4; ++corner)
      {
        const std::ptrdiff_t i = (column >> FractionBits) + corner % 2;
        const std::ptrdiff_t j = (row >> FractionBits) + corner / 2;
        const std::int32_t   weight = weights[corner / 2][corner % 2];
        if (weight > 0 && j >= 0 && j < rows && i >= reached[j].begin && i < reached[j].end)
        {
          mean.Add(intermediate[j * rowStride + i], weight);
        }
      }
      output[y * columns + x] = mean.IsEmpty() ? background : mean.Get();
    }
  }
}

template class PlainShearWarp<std::uint8_t>;
template class PlainShearWarp<std::int16_t>;
template class PlainShearWarp<std::uint16_t>;
template class PlainShearWarp<float>;

} // namespace itk::ShearWarpBenchmark
