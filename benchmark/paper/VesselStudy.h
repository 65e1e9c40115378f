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
#ifndef VesselStudy_h
#define VesselStudy_h

#include "itkImage.h"
#include "itkPoint.h"

#include <map>
#include <string>
#include <vector>

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

/** One object of figure 6 of Fang et al. 2002, digitized by its intensity at each voxel's center. */
struct VesselSetting
{
  double       tilt;   // degrees between the vessel and the grid's y axis
  double       radius; // in voxels, of 1 mm
  unsigned int offset; // 0 to 3: where the vessel lies between the voxels
};

/** The projections of one setting at one angle: pixels of 1 mm, the vessel's peak is 1. */
struct VesselPictures
{
  using PictureType = Image<float, 2>;

  PictureType::Pointer       truth;  // Vessel::GetMaximum() of each pixel's ray
  std::vector<SizeValueType> object; // the pixels that are compared

  /** `ray-casting`, with a step of a voxel, `ray-casting-half-step`, `shear-warp`, which is the filter, and
   * `shear-warp-oversampled`, with Oversampling 2. */
  std::map<std::string, PictureType::Pointer> methods;

  /** Mean magnitude of the difference of a picture from the truth, over the object's pixels. */
  double
  GetError(const PictureType * picture) const;
};

/** Projects the digitized vessel of \a setting, in a volume of 64 x 64 x 64 voxels, at \a angle degrees of a turn about
 * the grid's y axis. The stenosis is 24 mm long. A tilted vessel leans from y by 30 degrees out of the plane of x and
 * y.
 *
 * The object's pixels are those where the truth is above 0 and whose ray is next to the vessel's axis within 20 mm
 * of its center: there the vessel goes on to both sides inside the volume. */
VesselPictures
ProjectVessel(const VesselSetting & setting, double angle);

/** Writes the errors of each setting at 19 angles, every 10 degrees from 0 to 180: tilt, radius, offset, angle, number
 * of the object's pixels, method, and error in percent of the peak. Throws ExceptionObject if the file cannot be
 * written. */
void
WriteVesselErrors(const std::string & file);

/** Figure 6 itself, of a vessel of radius 4, tilted by 60 degrees to the grid, at 40 degrees: writes the digitized
 * section along the axis (a), the true projection (b), and the differences from it of ray casting (c) and of the
 * filter (d), with Oversampling 2 too, over the object's pixels. They are float TIFF, `figure6-section.tif`, `-truth`,
 * `-ray-casting`, `-shear-warp` and `-shear-warp-oversampled` in \a folder; the vessel's peak is 1. */
void
WriteVesselPictures(const std::string & folder);
} // namespace itk::ShearWarpBenchmark

#endif
