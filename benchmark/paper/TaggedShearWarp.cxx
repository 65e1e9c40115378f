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
#include "TaggedShearWarp.h"

#include <algorithm>
#include <utility>

namespace itk::ShearWarpBenchmark
{
namespace
{
constexpr unsigned int TagBits = 2;
constexpr unsigned int TagMask = (1 << TagBits) - 1;

void
Tag(PermutedVolume<std::uint16_t> & volume)
{
  for (std::uint16_t & voxel : volume.voxels)
  {
    voxel = static_cast<std::uint16_t>(voxel << TagBits);
  }

  // a cell gets its tag before its other voxels get theirs
  const std::ptrdiff_t corners[] = { 0, 1, volume.rowStride, volume.rowStride + 1 };
  for (std::ptrdiff_t k = 0; k < volume.slices; ++k)
  {
    for (std::ptrdiff_t j = 0; j <= volume.rows; ++j)
    {
      std::uint16_t * cell = volume.voxels.data() + (k * (volume.rows + 2) + j) * volume.rowStride;
      for (std::ptrdiff_t i = 0; i <= volume.columns; ++i, ++cell)
      {
        std::uint16_t largest = 0;
        for (std::uint16_t corner = 1; corner < 4; ++corner)
        {
          largest = cell[corners[corner]] > cell[corners[largest]] ? corner : largest;
        }
        *cell |= largest;
      }
    }
  }
}
} // namespace

TaggedShearWarp::TaggedShearWarp(const ImageType * image)
{
  const PixelType * voxels = image->GetBufferPointer();
  const PixelType   largest = *std::max_element(voxels, voxels + image->GetBufferedRegion().GetNumberOfPixels());
  if (largest > LargestVoxel)
  {
    itkGenericExceptionMacro("The image has a voxel of " << largest << "; voxels of up to 14 bits, " << LargestVoxel
                                                         << ", leave room for the corner number.");
  }
  for (unsigned int principalAxis = 0; principalAxis < 3; ++principalAxis)
  {
    m_Volumes.emplace_back(image, principalAxis);
    Tag(m_Volumes.back());
  }
}

TaggedShearWarp::Projection
TaggedShearWarp::Project(const ShearWarpFactorization & factorization) const
{
  const PermutedVolume<PixelType> & volume = m_Volumes[factorization.GetPrincipalAxis()];
  const std::ptrdiff_t              corners[] = { 0, 1, volume.rowStride, volume.rowStride + 1 };
  const auto                        size = factorization.GetIntermediateSize();
  std::vector<PixelType>            intermediate(size[0] * size[1]);
  SizeValueType                     skippedCells = 0;

  ForEachRow(
    volume,
    factorization,
    0,
    static_cast<std::ptrdiff_t>(size[1]),
    [&](
      const ShearWarp::SlicePlacement & placement, const PixelType * cell, std::ptrdiff_t column, std::ptrdiff_t row) {
      const ShearWarp::BilinearWeights weights(placement.column.fraction, placement.row.fraction);
      PixelType * pixel = intermediate.data() + row * static_cast<std::ptrdiff_t>(size[0]) + column;
      for (const PixelType * end = pixel + volume.columns; pixel != end; ++pixel, ++cell)
      {
        if (cell[corners[*cell & TagMask]] >> TagBits <= *pixel)
        {
          ++skippedCells;
          continue;
        }
        const std::int32_t sum = weights.aa * (cell[0] >> TagBits) + weights.ab * (cell[1] >> TagBits) +
                                 weights.ba * (cell[volume.rowStride] >> TagBits) +
                                 weights.bb * (cell[volume.rowStride + 1] >> TagBits);
        *pixel = std::max(*pixel, static_cast<PixelType>((sum + ShearWarp::One / 2) >> ShearWarp::FractionBits));
      }
    });
  const auto cells = static_cast<SizeValueType>(volume.slices * volume.rows * volume.columns);
  return { std::move(intermediate), cells, skippedCells };
}
} // namespace itk::ShearWarpBenchmark
