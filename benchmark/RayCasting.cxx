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

#include "Rays.h"
#include "TrilinearInterpolator.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace itk::ShearWarpBenchmark
{
namespace
{
/** The part of a ray, start + w * direction in voxels, that is sampled. */
struct SampledRay
{
  Vector<double, 3> start;
  double            begin;
  int               samples;
};

/** Calls \a process(ray) for each pixel of \a output, row by row, with its clipped ray. */
template <typename TFunction>
void
ForEachRay(const ImageBase<3> * image,
           const Rays &         rays,
           double               step,
           const ImageBase<2> * output,
           const TFunction &    process)
{
  const Size<3>        volumeSize = image->GetBufferedRegion().GetSize();
  const ImageRegion<2> region = output->GetBufferedRegion();
  for (SizeValueType row = 0; row < region.GetSize(1); ++row)
  {
    for (SizeValueType column = 0; column < region.GetSize(0); ++column)
    {
      Point<double, 2> position;
      output->TransformIndexToPhysicalPoint(
        region.GetIndex() + Offset<2>{ { static_cast<OffsetValueType>(column), static_cast<OffsetValueType>(row) } },
        position);
      const auto    start = rays.GetStart(position);
      const Segment segment = Clip(start, rays.GetDirection(), volumeSize);
      // a sample at the far end counts although rounding takes it just beyond
      const int samples = segment.begin <= segment.end
                            ? 1 + static_cast<int>(std::floor((segment.end - segment.begin) / step + 1e-9))
                            : 0;
      process(SampledRay{ start, segment.begin, samples });
    }
  }
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
  const Rays                          rays(image, viewTransform);
  const auto                          direction = rays.GetDirection();
  const TrilinearInterpolator<TPixel> interpolate(*image);
  TPixel *                            pixel = output->GetBufferPointer();
  ForEachRay(image, rays, step, output, [&](const SampledRay & ray) {
    float maximum = -std::numeric_limits<float>::infinity();
    for (int sample = 0; sample < ray.samples; ++sample)
    {
      const double w = ray.begin + sample * step;
      maximum = std::max(maximum,
                         interpolate(static_cast<float>(ray.start[0] + w * direction[0]),
                                     static_cast<float>(ray.start[1] + w * direction[1]),
                                     static_cast<float>(ray.start[2] + w * direction[2])));
    }
    *pixel++ = ray.samples > 0 ? Round<TPixel>(maximum) : background;
  });
}

SizeValueType
CountSamples(const ImageBase<3> *            image,
             const Transform<double, 3, 3> * viewTransform,
             double                          step,
             const ImageBase<2> *            output)
{
  SizeValueType samples = 0;
  ForEachRay(image, Rays(image, viewTransform), step, output, [&](const SampledRay & ray) { samples += ray.samples; });
  return samples;
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
