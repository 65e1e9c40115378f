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
#ifndef Vessel_h
#define Vessel_h

#include "itkPoint.h"

namespace itk::ShearWarpBenchmark
{
/** The test object of Fang et al. 2002 (figure 6): an endless straight vessel with a stenosis of 50 % of its diameter,
 * known at every point of physical space and not only at voxels. At distance r from the axis, where its radius is R, it
 * has 1 - (r / R)^2, as laminar flow; outside of it there is 0. Lengths are in mm. */
class Vessel
{
public:
  using PointType = Point<double, 3>;
  using VectorType = Vector<double, 3>;

  /** The axis is the line through \a center, where the vessel is narrowest, along \a direction of any length but 0. */
  Vessel(const PointType & center, const VectorType & direction, double radius, double stenosisLength);

  /** The radius at \a position along the axis, measured from the center: half of the full one at 0, and from there to
   * half of the stenosis length on both sides R (3 - cos(2 pi position / length)) / 4. */
  double
  GetRadius(double position) const;

  /** The position along the axis of what is next to \a point. */
  double
  GetPosition(const PointType & point) const
  {
    return (point - m_Center) * m_Direction;
  }

  /** The distance of \a point from the axis. */
  double
  GetDistance(const PointType & point) const;

  /** The intensity at \a point. */
  double
  GetValue(const PointType & point) const;

  /** The point nearest to the axis on the line through \a start along \a direction; \a start if they are parallel. */
  PointType
  GetNearestPoint(const PointType & start, const VectorType & direction) const;

  /** The maximum intensity along that line, from the closed forms of distance and radius without any sampling: the true
   * projection. Rounding errors stay below 1e-9.
   *
   * It is the value at the nearest point, unless this lies in the stenosis and the line runs obliquely. Then it is
   * found by bisection, between the nearest point and the nearer end of the stenosis: on the other side the line is
   * farther from the axis at the same radius, beyond the end at the largest. */
  double
  GetMaximum(const PointType & start, const VectorType & direction) const;

private:
  PointType  m_Center;
  VectorType m_Direction;
  double     m_Radius;
  double     m_StenosisLength;
};
} // namespace itk::ShearWarpBenchmark

#endif
