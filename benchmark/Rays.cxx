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
#include "Rays.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace itk::ShearWarpBenchmark
{
Segment
Clip(const Vector<double, 3> & start, const Vector<double, 3> & direction, const Size<3> & size)
{
  Segment segment{ -std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity() };
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    constexpr double tolerance = 1e-9;
    const double     last = static_cast<double>(size[axis]) - 1.0;
    if (std::abs(direction[axis]) < tolerance)
    {
      if (start[axis] < -tolerance || start[axis] > last + tolerance)
      {
        return { 1.0, 0.0 };
      }
    }
    else
    {
      const auto [near, far] = std::minmax({ -start[axis] / direction[axis], (last - start[axis]) / direction[axis] });
      segment.begin = std::max(segment.begin, near);
      segment.end = std::min(segment.end, far);
    }
  }
  return segment;
}

Rays::Rays(const ImageBase<3> * image, const Transform<double, 3, 3> * viewTransform)
{
  const auto toVoxels = [&](double u, double v, double w) {
    const double coordinates[] = { u, v, w };
    const auto   point = viewTransform->TransformPoint(Point<double, 3>(coordinates));
    const auto   index = image->TransformPhysicalPointToContinuousIndex<double>(point);
    VectorType   voxels;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      voxels[axis] = index[axis] - static_cast<double>(image->GetBufferedRegion().GetIndex(axis));
    }
    return voxels;
  };
  m_Origin = toVoxels(0, 0, 0);
  m_Axes[0] = toVoxels(1, 0, 0) - m_Origin;
  m_Axes[1] = toVoxels(0, 1, 0) - m_Origin;
  m_Axes[2] = toVoxels(0, 0, 1) - m_Origin;
}
} // namespace itk::ShearWarpBenchmark
