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
#include "RayCasting.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace itk::ShearWarpBenchmark
{
namespace
{
/** Trilinear interpolation of an image. */
template <typename TPixel>
class Interpolator
{
public:
  explicit Interpolator(const Image<TPixel, 3> & image)
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

/** The part [begin, end] of a ray, in units of w. */
struct Segment
{
  double begin{ -std::numeric_limits<double>::infinity() };
  double end{ std::numeric_limits<double>::infinity() };
};

/** Clips the ray of all start + w * direction, in voxels, to the box of the centres of \a size voxels. */
Segment
Clip(const Vector<double, 3> & start, const Vector<double, 3> & direction, const Size<3> & size)
{
  Segment segment;
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

template <typename TPixel>
TPixel
Round(float value)
{
  return static_cast<TPixel>(std::is_floating_point_v<TPixel> ? value : std::floor(value + 0.5F));
}
} // namespace

template <typename TPixel>
void
CastRays(const Image<TPixel, 3> *             image,
         const Transform<double, 3, 3> *      viewTransform,
         double                               step,
         typename Image<TPixel, 2>::PixelType background,
         Image<TPixel, 2> *                   output)
{
  const ImageRegion<3> region = image->GetBufferedRegion();
  const auto           toVoxels = [&](double u, double v, double w) {
    const double      coordinates[] = { u, v, w };
    const auto        point = viewTransform->TransformPoint(Point<double, 3>(coordinates));
    const auto        index = image->template TransformPhysicalPointToContinuousIndex<double>(point);
    Vector<double, 3> voxels;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      voxels[axis] = index[axis] - static_cast<double>(region.GetIndex(axis));
    }
    return voxels;
  };
  const auto                 direction = toVoxels(0, 0, 1) - toVoxels(0, 0, 0);
  const Interpolator<TPixel> interpolate(*image);

  const Size<2> size = output->GetBufferedRegion().GetSize();
  TPixel *      pixel = output->GetBufferPointer();
  for (SizeValueType row = 0; row < size[1]; ++row)
  {
    for (SizeValueType column = 0; column < size[0]; ++column, ++pixel)
    {
      Point<double, 2> position;
      output->TransformIndexToPhysicalPoint(
        output->GetBufferedRegion().GetIndex() +
          Offset<2>{ { static_cast<OffsetValueType>(column), static_cast<OffsetValueType>(row) } },
        position);
      const auto    start = toVoxels(position[0], position[1], 0);
      const Segment segment = Clip(start, direction, region.GetSize());
      if (!(segment.begin <= segment.end))
      {
        *pixel = background;
        continue;
      }

      // a sample at the far end counts although rounding takes it just beyond
      const auto samples = 1 + static_cast<int>(std::floor((segment.end - segment.begin) / step + 1e-9));
      float      maximum = -std::numeric_limits<float>::infinity();
      for (int sample = 0; sample < samples; ++sample)
      {
        const double w = segment.begin + sample * step;
        maximum = std::max(maximum,
                           interpolate(static_cast<float>(start[0] + w * direction[0]),
                                       static_cast<float>(start[1] + w * direction[1]),
                                       static_cast<float>(start[2] + w * direction[2])));
      }
      *pixel = Round<TPixel>(maximum);
    }
  }
}

#define INSTANTIATE(TPixel)                                       \
  template void CastRays<TPixel>(const Image<TPixel, 3> *,        \
                                 const Transform<double, 3, 3> *, \
                                 double,                          \
                                 Image<TPixel, 2>::PixelType,     \
                                 Image<TPixel, 2> *)

INSTANTIATE(std::uint8_t);
INSTANTIATE(std::int16_t);
INSTANTIATE(std::uint16_t);
INSTANTIATE(float);

#undef INSTANTIATE

} // namespace itk::ShearWarpBenchmark
