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
#include "PermutedVolume.h"

#include <algorithm>

namespace itk::ShearWarpBenchmark
{
PermutedVolume::PermutedVolume(const Image<std::uint16_t, 3> * image, unsigned int principalAxis)
{
  const unsigned int axes[] = { principalAxis == 0 ? 1U : 0U, principalAxis == 2 ? 1U : 2U, principalAxis };
  const auto         size = image->GetBufferedRegion().GetSize();
  columns = static_cast<std::ptrdiff_t>(size[axes[0]]);
  rows = static_cast<std::ptrdiff_t>(size[axes[1]]);
  slices = static_cast<std::ptrdiff_t>(size[axes[2]]);
  rowStride = columns + 2;
  voxels.resize(rowStride * (rows + 2) * slices);

  const OffsetValueType * strides = image->GetOffsetTable();
  std::uint16_t *         voxel = voxels.data();
  for (std::ptrdiff_t k = 0; k < slices; ++k)
  {
    for (std::ptrdiff_t j = -1; j <= rows; ++j)
    {
      const std::uint16_t * row = image->GetBufferPointer() + k * strides[axes[2]] +
                                  std::clamp<std::ptrdiff_t>(j, 0, rows - 1) * strides[axes[1]];
      for (std::ptrdiff_t i = -1; i <= columns; ++i)
      {
        *voxel++ = row[std::clamp<std::ptrdiff_t>(i, 0, columns - 1) * strides[axes[0]]];
      }
    }
  }
}

std::vector<std::uint16_t>
Project(const PermutedVolume & volume, const ShearWarpFactorization & factorization)
{
  const auto                columns = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[0]);
  const auto                rows = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[1]);
  std::vector<std::int32_t> sums(columns * rows);
  ForEachRow(
    volume,
    factorization,
    [&](
      const ShearWarp::BilinearWeights & weights, const std::uint16_t * a, std::ptrdiff_t column, std::ptrdiff_t row) {
      const std::uint16_t * b = a + volume.rowStride;
      std::int32_t *        sum = sums.data() + row * columns + column;
      for (std::ptrdiff_t i = 0; i < volume.columns; ++i)
      {
        sum[i] =
          std::max(sum[i], weights.aa * a[i] + weights.ab * a[i + 1] + weights.ba * b[i] + weights.bb * b[i + 1]);
      }
    });

  std::vector<std::uint16_t> intermediate(sums.size());
  std::transform(sums.begin(), sums.end(), intermediate.begin(), [](std::int32_t sum) {
    return static_cast<std::uint16_t>((sum + ShearWarp::One / 2) >> ShearWarp::FractionBits);
  });
  return intermediate;
}
} // namespace itk::ShearWarpBenchmark
