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
#ifndef TrilinearInterpolator_h
#define TrilinearInterpolator_h

#include "itkImage.h"

#include <algorithm>
#include <array>

namespace itk::ShearWarpBenchmark
{
/** Trilinear interpolation of an image: equation 1 of Fang et al. 2002. The image must outlive this object. */
template <typename TPixel>
class TrilinearInterpolator
{
public:
  explicit TrilinearInterpolator(const Image<TPixel, 3> & image)
    : m_Voxels(image.GetBufferPointer())
  {
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const auto size = static_cast<int>(image.GetBufferedRegion().GetSize(axis));
      m_LastCell[axis] = std::max(0, size - 2);
      m_Stride[axis] = image.GetOffsetTable()[axis];
      m_Step[axis] = size > 1 ? m_Stride[axis] : 0;
    }
  }

  /** At a position in voxels from the first voxel, inside the box of the voxels' centres but for rounding. */
  float
  operator()(float x, float y, float z) const
  {
    const int      i = this->GetCell(x, 0);
    const int      j = this->GetCell(y, 1);
    const int      k = this->GetCell(z, 2);
    const TPixel * cell = m_Voxels + i * m_Stride[0] + j * m_Stride[1] + k * m_Stride[2];
    const float    fraction[3] = { x - static_cast<float>(i), y - static_cast<float>(j), z - static_cast<float>(k) };

    const auto alongX = [&](const TPixel * voxel) {
      return Interpolate(static_cast<float>(voxel[0]), static_cast<float>(voxel[m_Step[0]]), fraction[0]);
    };
    const auto alongY = [&](const TPixel * voxel) {
      return Interpolate(alongX(voxel), alongX(voxel + m_Step[1]), fraction[1]);
    };
    return Interpolate(alongY(cell), alongY(cell + m_Step[2]), fraction[2]);
  }

private:
  int
  GetCell(float position, unsigned int axis) const
  {
    return std::clamp(static_cast<int>(position), 0, m_LastCell[axis]);
  }

  static float
  Interpolate(float a, float b, float fraction)
  {
    return a + fraction * (b - a);
  }

  const TPixel *                 m_Voxels;
  std::array<int, 3>             m_LastCell;
  std::array<OffsetValueType, 3> m_Stride;
  std::array<OffsetValueType, 3> m_Step;
};
} // namespace itk::ShearWarpBenchmark

#endif
