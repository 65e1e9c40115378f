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
#ifndef RayCasting_h
#define RayCasting_h

#include "itkImage.h"
#include "itkTransform.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace itk::ShearWarpBenchmark
{
/** Trilinear interpolation at positions in voxels from the first voxel, inside the box of the voxels' centers but for
 * rounding. */
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

  float
  operator()(float x, float y, float z) const
  {
    const int      i = std::clamp(static_cast<int>(x), 0, m_LastCell[0]);
    const int      j = std::clamp(static_cast<int>(y), 0, m_LastCell[1]);
    const int      k = std::clamp(static_cast<int>(z), 0, m_LastCell[2]);
    const TPixel * cell = m_Voxels + i * m_Stride[0] + j * m_Stride[1] + k * m_Stride[2];

    const auto mix = [](float a, float b, float fraction) { return a + fraction * (b - a); };
    const auto alongX = [&](const TPixel * voxel) {
      return mix(static_cast<float>(voxel[0]), static_cast<float>(voxel[m_Step[0]]), x - static_cast<float>(i));
    };
    const auto alongY = [&](const TPixel * voxel) {
      return mix(alongX(voxel), alongX(voxel + m_Step[1]), y - static_cast<float>(j));
    };
    return mix(alongY(cell), alongY(cell + m_Step[2]), z - static_cast<float>(k));
  }

private:
  const TPixel *  m_Voxels;
  int             m_LastCell[3];
  OffsetValueType m_Stride[3];
  OffsetValueType m_Step[3];
};

/** Where the view takes a point, in voxels from the first voxel of the buffered region. */
inline Vector<double, 3>
ToVoxels(const ImageBase<3> * image, const Transform<double, 3, 3> * viewTransform, double u, double v, double w)
{
  const double coordinates[] = { u, v, w };
  const auto   index = image->TransformPhysicalPointToContinuousIndex<double>(
    viewTransform->TransformPoint(Point<double, 3>(coordinates)));
  return index - ContinuousIndex<double, 3>(image->GetBufferedRegion().GetIndex());
}

/** Calls \a process(start, direction, begin, samples) for each pixel of \a output, row by row: its ray is start + w *
 * direction in voxels, and is sampled \a samples times from w = begin on. */
template <typename TFunction>
void
ForEachRay(const ImageBase<3> *            image,
           const Transform<double, 3, 3> * viewTransform,
           double                          step,
           const ImageBase<2> *            output,
           const TFunction &               process)
{
  constexpr double        tolerance = 1e-9;
  const Vector<double, 3> origin = ToVoxels(image, viewTransform, 0, 0, 0);
  const Vector<double, 3> across = ToVoxels(image, viewTransform, 1, 0, 0) - origin;
  const Vector<double, 3> down = ToVoxels(image, viewTransform, 0, 1, 0) - origin;
  const Vector<double, 3> direction = ToVoxels(image, viewTransform, 0, 0, 1) - origin;
  const ImageRegion<2>    region = output->GetBufferedRegion();
  for (OffsetValueType n = 0; n < static_cast<OffsetValueType>(region.GetNumberOfPixels()); ++n)
  {
    Point<double, 2> position;
    output->TransformIndexToPhysicalPoint(output->ComputeIndex(n), position);
    const Vector<double, 3> start = origin + across * position[0] + down * position[1];
    double                  begin = -std::numeric_limits<double>::infinity();
    double                  end = std::numeric_limits<double>::infinity();
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const double last = static_cast<double>(image->GetBufferedRegion().GetSize(axis)) - 1.0;
      if (std::abs(direction[axis]) >= tolerance)
      {
        const auto [near, far] =
          std::minmax({ -start[axis] / direction[axis], (last - start[axis]) / direction[axis] });
        begin = std::max(begin, near);
        end = std::min(end, far);
      }
      else if (start[axis] < -tolerance || start[axis] > last + tolerance)
      {
        end = -std::numeric_limits<double>::infinity();
      }
    }
    // a sample at the far end counts although rounding takes it just beyond
    process(start, direction, begin, begin <= end ? 1 + static_cast<int>((end - begin) / step + tolerance) : 0);
  }
}

/** Maximum intensity projection by ray casting, in one thread: what shear-warp is compared with.
 *
 * Pixel (u, v) of \a output, at the place that its region, spacing and origin give in view space, is the maximum of
 * \a image along the line of all w at T(u, v, w), where T is \a viewTransform. The line is clipped to the box of the
 * voxels' centers and sampled by trilinear interpolation (equation 1 of Fang et al. 2002), from where it enters the
 * box, every \a step in units of w (mm, for a rigid transform of an image in mm). Pixels whose line misses the box are
 * \a background; integers are rounded.
 *
 * \a output must be allocated. */
template <typename TPixel>
void
CastRays(const Image<TPixel, 3> *             image,
         const Transform<double, 3, 3> *      viewTransform,
         double                               step,
         typename Image<TPixel, 2>::PixelType background,
         Image<TPixel, 2> *                   output)
{
  const TrilinearInterpolator<TPixel> interpolate(*image);
  TPixel *                            pixel = output->GetBufferPointer();
  ForEachRay(image,
             viewTransform,
             step,
             output,
             [&](const Vector<double, 3> & start, const Vector<double, 3> & direction, double begin, int samples) {
               float maximum = -std::numeric_limits<float>::infinity();
               for (int sample = 0; sample < samples; ++sample)
               {
                 const Vector<double, 3> position = start + direction * (begin + sample * step);
                 maximum = std::max(maximum,
                                    interpolate(static_cast<float>(position[0]),
                                                static_cast<float>(position[1]),
                                                static_cast<float>(position[2])));
               }
               const float rounded = std::numeric_limits<TPixel>::is_integer ? std::floor(maximum + 0.5F) : maximum;
               *pixel++ = samples > 0 ? static_cast<TPixel>(rounded) : background;
             });
}

/** Clips the rays of CastRays() and does nothing else with them: how many samples it takes, over all pixels. */
inline SizeValueType
CountSamples(const ImageBase<3> *            image,
             const Transform<double, 3, 3> * viewTransform,
             double                          step,
             const ImageBase<2> *            output)
{
  SizeValueType sum = 0;
  ForEachRay(image, viewTransform, step, output, [&sum](auto &&, auto &&, double, int samples) { sum += samples; });
  return sum;
}

/** The distance along w in which a ray goes the length of one voxel: its index changes by a vector of length 1. */
inline double
GetVoxelStep(const ImageBase<3> * image, const Transform<double, 3, 3> * viewTransform)
{
  return 1.0 / (ToVoxels(image, viewTransform, 0, 0, 1) - ToVoxels(image, viewTransform, 0, 0, 0)).GetNorm();
}
} // namespace itk::ShearWarpBenchmark

#endif
