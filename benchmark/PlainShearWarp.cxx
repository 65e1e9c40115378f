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

#include "Data.h"

#include "itkMultiThreaderBase.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace itk::ShearWarpBenchmark
{
namespace
{
using ShearWarp::FractionBits;
using ShearWarp::One;

template <typename TPixel>
using SumType = std::conditional_t<std::is_floating_point_v<TPixel>,
                                   TPixel,
                                   std::conditional_t<(sizeof(TPixel) > 2), std::int64_t, std::int32_t>>;

/** A function of a cell's four voxels. For integers it is equation 2, the sum in 1/2^15, which fits for pixels of up to
 * 16 bits, and for these volumes in wider pixels, because the weights sum to 2^15; for floating point, columns first,
 * then rows. */
template <typename TPixel>
auto
MakeSampler(const ShearWarp::SlicePlacement & placement)
{
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    const TPixel x = static_cast<TPixel>(placement.column.fraction) / One;
    const TPixel y = static_cast<TPixel>(placement.row.fraction) / One;
    return [x, y](TPixel aa, TPixel ab, TPixel ba, TPixel bb) {
      const TPixel a = ab + x * (aa - ab);
      const TPixel b = bb + x * (ba - bb);
      return b + y * (a - b);
    };
  }
  else
  {
    const ShearWarp::BilinearWeights weights(placement.column.fraction, placement.row.fraction);
    return [weights](SumType<TPixel> aa, SumType<TPixel> ab, SumType<TPixel> ba, SumType<TPixel> bb) {
      return weights.aa * aa + weights.ab * ab + weights.ba * ba + weights.bb * bb;
    };
  }
}

template <typename TPixel>
TPixel
Round(SumType<TPixel> sum)
{
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    return sum;
  }
  else
  {
    return static_cast<TPixel>((sum + One / 2) >> FractionBits);
  }
}

/** Calls \a process(begin, end) for [0, count), or in parallel for bands of it. */
template <typename TFunction>
void
ForEachBand(std::ptrdiff_t count, bool isParallel, const TFunction & process)
{
  constexpr std::ptrdiff_t band = 32;
  if (isParallel)
  {
    MultiThreaderBase::New()->ParallelizeArray(
      0,
      static_cast<SizeValueType>((count + band - 1) / band),
      [&](SizeValueType n) {
        const auto begin = static_cast<std::ptrdiff_t>(n) * band;
        process(begin, std::min(begin + band, count));
      },
      nullptr);
  }
  else
  {
    process(std::ptrdiff_t{ 0 }, count);
  }
}
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
std::vector<TPixel>
Project(const PermutedVolume<TPixel> & volume, const ShearWarpFactorization & factorization, bool isParallel)
{
  const auto          size = factorization.GetIntermediateSize();
  const auto          columns = static_cast<std::ptrdiff_t>(size[0]);
  std::vector<TPixel> intermediate(size[0] * size[1]);
  ForEachBand(static_cast<std::ptrdiff_t>(size[1]), isParallel, [&](std::ptrdiff_t rowBegin, std::ptrdiff_t rowEnd) {
    std::vector<SumType<TPixel>> sums((rowEnd - rowBegin) * columns, std::numeric_limits<SumType<TPixel>>::lowest());
    ForEachRow(
      volume,
      factorization,
      rowBegin,
      rowEnd,
      [&](const ShearWarp::SlicePlacement & placement, const TPixel * a, std::ptrdiff_t column, std::ptrdiff_t row) {
        const auto        sample = MakeSampler<TPixel>(placement);
        const TPixel *    b = a + volume.rowStride;
        SumType<TPixel> * sum = sums.data() + (row - rowBegin) * columns + column;
        for (std::ptrdiff_t i = 0; i < volume.columns; ++i)
        {
          sum[i] = std::max(sum[i], sample(a[i], a[i + 1], b[i], b[i + 1]));
        }
      });
    std::transform(sums.begin(), sums.end(), intermediate.begin() + rowBegin * columns, Round<TPixel>);
  });
  return intermediate;
}

template <typename TPixel>
std::vector<TPixel>
Warp(const ShearWarpFactorization & factorization,
     const std::vector<TPixel> &    intermediate,
     const Size<2> &                size,
     TPixel                         background,
     bool                           isParallel)
{
  using MeanSumType = std::conditional_t<std::is_floating_point_v<TPixel>, double, std::int64_t>;
  const auto          map = factorization.GetOutputToIntermediateMatrix();
  const auto &        reached = factorization.GetReachedColumns();
  const auto          rowStride = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[0]);
  const auto          rows = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[1]);
  const auto          columns = static_cast<std::ptrdiff_t>(size[0]);
  std::vector<TPixel> output(size[0] * size[1]);
  const auto          interpolate = [&](std::ptrdiff_t x, std::ptrdiff_t y) {
    const auto locate = [&](unsigned int axis) {
      const double position =
        (map(axis, 0) * static_cast<double>(x) + map(axis, 1) * static_cast<double>(y)) + map(axis, 2);
      return static_cast<std::int64_t>(std::floor(position * One + 0.5));
    };
    const std::int64_t column = locate(0);
    const std::int64_t row = locate(1);

    // here the fractions are the weights of the second pixel and row
    const ShearWarp::BilinearWeights cell(static_cast<std::int32_t>(column & (One - 1)),
                                          static_cast<std::int32_t>(row & (One - 1)));
    const std::int32_t               weights[] = { cell.bb, cell.ba, cell.ab, cell.aa };
    MeanSumType                      sum{ 0 };
    std::int64_t                     weight = 0;
    TPixel                           smallest = std::numeric_limits<TPixel>::max();
    TPixel                           largest = std::numeric_limits<TPixel>::lowest();
    for (unsigned int corner = 0; corner < 4; ++corner)
    {
      const std::ptrdiff_t i = (column >> FractionBits) + corner % 2;
      const std::ptrdiff_t j = (row >> FractionBits) + corner / 2;
      if (weights[corner] > 0 && j >= 0 && j < rows && i >= reached[j].begin && i < reached[j].end)
      {
        const TPixel value = intermediate[j * rowStride + i];
        sum += static_cast<MeanSumType>(weights[corner]) * static_cast<MeanSumType>(value);
        weight += weights[corner];
        smallest = std::min(smallest, value);
        largest = std::max(largest, value);
      }
    }
    if (weight == 0)
    {
      return background;
    }
    if constexpr (std::is_floating_point_v<TPixel>)
    {
      return std::clamp(static_cast<TPixel>(sum / static_cast<MeanSumType>(weight)), smallest, largest);
    }
    else
    {
      // half upward; the offset makes negative sums positive
      constexpr std::int64_t offset = 1 << 15;
      return static_cast<TPixel>((2 * (sum + offset * weight) + weight) / (2 * weight) - offset);
    }
  };
  ForEachBand(static_cast<std::ptrdiff_t>(size[1]), isParallel, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (std::ptrdiff_t y = begin; y < end; ++y)
    {
      for (std::ptrdiff_t x = 0; x < columns; ++x)
      {
        output[y * columns + x] = interpolate(x, y);
      }
    }
  });
  return output;
}

#define INSTANTIATE(TPixel)                                                                                   \
  template struct PermutedVolume<TPixel>;                                                                     \
  template std::vector<TPixel> Project(const PermutedVolume<TPixel> &, const ShearWarpFactorization &, bool); \
  template std::vector<TPixel> Warp(                                                                          \
    const ShearWarpFactorization &, const std::vector<TPixel> &, const Size<2> &, TPixel, bool);
FOR_EACH_BENCHMARK_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk::ShearWarpBenchmark
