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
struct CellSampler
{
  using SumType = std::int32_t;

  // the checker misses the specialization's members here
  // cppcheck-suppress uninitMemberVar
  explicit CellSampler(const ShearWarp::SlicePlacement & placement)
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
struct CellSampler<float>
{
  using SumType = float;

  explicit CellSampler(const ShearWarp::SlicePlacement & placement)
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
PermutedVolume<TPixel>::PermutedVolume(const Image<TPixel, 3> * image, unsigned int principalAxis)
{
  const unsigned int axes[] = { principalAxis == 0 ? 1U : 0U, principalAxis == 2 ? 1U : 2U, principalAxis };
  const auto         size = image->GetBufferedRegion().GetSize();
  columns = static_cast<std::ptrdiff_t>(size[axes[0]]);
  rows = static_cast<std::ptrdiff_t>(size[axes[1]]);
  slices = static_cast<std::ptrdiff_t>(size[axes[2]]);
  rowStride = columns + 2;
  voxels.resize(rowStride * (rows + 2) * slices);

  const OffsetValueType * strides = image->GetOffsetTable();
  TPixel *                voxel = voxels.data();
  for (std::ptrdiff_t k = 0; k < slices; ++k)
  {
    for (std::ptrdiff_t j = -1; j <= rows; ++j)
    {
      const TPixel * row = image->GetBufferPointer() + k * strides[axes[2]] +
                           std::clamp<std::ptrdiff_t>(j, 0, rows - 1) * strides[axes[1]];
      for (std::ptrdiff_t i = -1; i <= columns; ++i)
      {
        *voxel++ = row[std::clamp<std::ptrdiff_t>(i, 0, columns - 1) * strides[axes[0]]];
      }
    }
  }
}

template <typename TPixel>
void
ProjectRows(const PermutedVolume<TPixel> & volume,
            const ShearWarpFactorization & factorization,
            std::ptrdiff_t                 rowBegin,
            std::ptrdiff_t                 rowEnd,
            std::vector<TPixel> &          intermediate)
{
  using SumType = typename CellSampler<TPixel>::SumType;
  const auto           columns = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[0]);
  std::vector<SumType> sums((rowEnd - rowBegin) * columns, std::numeric_limits<SumType>::lowest());
  ForEachRow(
    volume,
    factorization,
    rowBegin,
    rowEnd,
    [&](const ShearWarp::SlicePlacement & placement, const TPixel * a, std::ptrdiff_t column, std::ptrdiff_t row) {
      const CellSampler<TPixel> sample(placement);
      const TPixel *            b = a + volume.rowStride;
      SumType *                 sum = sums.data() + (row - rowBegin) * columns + column;
      for (std::ptrdiff_t i = 0; i < volume.columns; ++i)
      {
        sum[i] = std::max(sum[i], sample(a[i], a[i + 1], b[i], b[i + 1]));
      }
    });
  std::transform(sums.begin(), sums.end(), intermediate.begin() + rowBegin * columns, CellSampler<TPixel>::Round);
}

template <typename TPixel>
std::vector<TPixel>
Project(const PermutedVolume<TPixel> & volume, const ShearWarpFactorization & factorization)
{
  const auto          size = factorization.GetIntermediateSize();
  std::vector<TPixel> intermediate(size[0] * size[1]);
  ProjectRows(volume, factorization, 0, static_cast<std::ptrdiff_t>(size[1]), intermediate);
  return intermediate;
}

template <typename TPixel>
void
WarpRows(const ShearWarpFactorization & factorization,
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

#define INSTANTIATE(TPixel)                                                                             \
  template struct PermutedVolume<TPixel>;                                                               \
  template void                ProjectRows(const PermutedVolume<TPixel> &,                              \
                                           const ShearWarpFactorization &,                              \
                                           std::ptrdiff_t,                                              \
                                           std::ptrdiff_t,                                              \
                                           std::vector<TPixel> &);                                      \
  template std::vector<TPixel> Project(const PermutedVolume<TPixel> &, const ShearWarpFactorization &); \
  template void                WarpRows(const ShearWarpFactorization &,                                 \
                                        const std::vector<TPixel> &,                                    \
                                        std::ptrdiff_t,                                                 \
                                        std::ptrdiff_t,                                                 \
                                        std::ptrdiff_t,                                                 \
                                        TPixel,                                                         \
                                        std::vector<TPixel> &)

INSTANTIATE(std::uint8_t);
INSTANTIATE(std::int16_t);
INSTANTIATE(std::uint16_t);
INSTANTIATE(float);

#undef INSTANTIATE

} // namespace itk::ShearWarpBenchmark
