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
#ifndef Rays_h
#define Rays_h

#include "itkImageBase.h"
#include "itkTransform.h"

namespace itk::ShearWarpBenchmark
{
/** The part [begin, end] of a ray; empty if begin > end. */
struct Segment
{
  double begin;
  double end;
};

/** The part of the ray of all start + t * direction, in voxels, in the box of the centres of \a size voxels. */
Segment
Clip(const Vector<double, 3> & start, const Vector<double, 3> & direction, const Size<3> & size);

/** The rays of a view, in voxels from the first voxel of an image's buffered region. */
class Rays
{
public:
  using VectorType = Vector<double, 3>;

  /** \a viewTransform takes view space to the image's physical space and must be linear. */
  Rays(const ImageBase<3> * image, const Transform<double, 3, 3> * viewTransform);

  /** The way of a ray for one unit of w. */
  const VectorType &
  GetDirection() const
  {
    return m_Axes[2];
  }

  /** Where the ray of (u, v) has w = 0. */
  VectorType
  GetStart(const Point<double, 2> & position) const
  {
    return m_Origin + m_Axes[0] * position[0] + m_Axes[1] * position[1];
  }

private:
  VectorType m_Origin;
  VectorType m_Axes[3];
};
} // namespace itk::ShearWarpBenchmark

#endif
