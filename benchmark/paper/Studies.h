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
#ifndef Studies_h
#define Studies_h

#include "PlainShearWarp.h"

#include "itkImage.h"
#include "itkMath.h"
#include "itkTransform.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace itk::ShearWarpBenchmark
{
/** The size of the paper's data set (table 1). */
constexpr Size<3> PaperSize{ { 256, 256, 64 } };

/** Reads a 3D image of one component, interpolates it linearly at the centers of \a size voxels over the same physical
 * extent, and scales it linearly to [0, 16383]. Nothing is smoothed, and a constant image becomes 0. Throws
 * ExceptionObject for any other file. */
Image<std::uint16_t, 3>::Pointer
ReadVolume(const std::string & file, const Size<3> & size);

/** An allocated image of the grid that the filter fits to the view. */
Image<std::uint16_t, 2>::Pointer
MakeFittedOutput(const Image<std::uint16_t, 3> * image, const Transform<double, 3, 3> * viewTransform);

/** Shear-warp with the reduced resampling of Fang et al. 2002 (figure 3) in its published form, in one thread: a cell
 * of four voxels is skipped where the pixel has reached the largest of them already.
 *
 * Voxels have up to 14 bits. In the permuted copies, each voxel has its value in the upper 14 bits and in the lower two
 * the number of the largest corner of the cell that it begins: 0, the voxel itself, 1, the next column's, 2, the next
 * row's, or 3, the one across from 0. Of equal corners the first counts.
 *
 * A sample is rounded as the filter rounds it, which never takes it above the largest corner: what is skipped cannot
 * change a pixel, and the intermediate image is the same as in PlainShearWarp.h and in the filter, bit by bit. */
class TaggedShearWarp
{
public:
  using PixelType = std::uint16_t;

  static constexpr PixelType LargestVoxel = (1 << 14) - 1;

  struct Projection
  {
    std::vector<PixelType> intermediate; // of the factorization's size; pixels that no slice reaches are 0
    SizeValueType          skippedCells; // of as many as the volume has voxels
  };

  /** Prepares the copies; \a image is not needed afterwards. Throws ExceptionObject, with its value, for a voxel above
   * LargestVoxel. */
  explicit TaggedShearWarp(const Image<PixelType, 3> * image);

  /** Collects the maxima slice by slice, in storage order, of a factorization without oversampling. */
  Projection
  Project(const ShearWarpFactorization & factorization) const;

private:
  std::vector<PermutedVolume<PixelType>> m_Volumes; // for each principal axis
};

/** One method at one angle, once: points of figure 4 of Fang et al. 2002. Times are in seconds. */
struct Timing
{
  std::string  method; // "ray casting", "shear warp", "shear warp, tagged", "filter, off" or "filter, auto"
  unsigned int angle;
  unsigned int principalAxis;
  double       preparation;          // of the volume, once for all angles
  double       interpolation{ 0.0 }; // with the memory access
  double       clip{ 0.0 };
  double       warp{ 0.0 };
  double       total{ 0.0 };           // without the preparation
  double       skippedFraction{ 0.0 }; // of the cells, or in the filter of the volume, 0 to 1
};

/** Times the methods of table 1 of Fang et al. 2002, each in one thread, and beside them the module's filter with
 * reduced resampling off and auto. The volume turns about its second axis from 0 to 180 degrees in steps of 10. The
 * output is fitted to each angle, so that the number of rays varies with the angle as in the paper.
 *
 * - Ray casting has a sample for each voxel of way (GetVoxelStep()). Its interpolation is the whole less the clipping,
 *   which is timed by itself.
 * - The shear-warps are PlainShearWarp.h and TaggedShearWarp, each from three permuted copies of the volume.
 * - The filter's own clocks time its parts, and what it prepares for these angles. The total is the whole update.
 *
 * All methods take turns in each repetition. The outputs of all shear-warps are compared: throws ExceptionObject if
 * they differ in a bit. \a image has voxels of up to 14 bits. */
std::vector<Timing>
TimeMethods(const Image<std::uint16_t, 3> * image, unsigned int repetitions);

/** One line for each element, times in milliseconds. Throws ExceptionObject if the file cannot be written. */
void
WriteTimings(const std::vector<Timing> & timings, const std::string & csvFile);

/** The pictures of figure 5: \a image from azimuth 40 and altitude 50 degrees on the grid that the filter fits, as TIFF
 * files in \a folder: `figure5-<name>-raycasting.tif` (RayCasting.h, a sample for each voxel of way) and `-shearwarp`
 * (TaggedShearWarp), 16 bits, and `-difference`, ray casting less shear-warp, 32-bit floating point. The azimuth turns
 * about the image's third axis, then the altitude about the first. \a image has voxels of up to 14 bits. Throws
 * ExceptionObject if the filter's picture differs in a bit from the published shear-warp's picture, or if a file cannot
 * be written. */
void
WriteFigure5(const Image<std::uint16_t, 3> * image, const std::string & name, const std::string & folder);

/** The test object of Fang et al. 2002 (figure 6): an endless straight vessel with a stenosis of 50 % of its diameter,
 * known at every point of physical space and not only at voxels. At distance r from the axis, where its radius is R, it
 * has 1 - (r / R)^2, as laminar flow; outside of it there is 0. Lengths are in mm. */
class Vessel
{
public:
  using PointType = Point<double, 3>;
  using VectorType = Vector<double, 3>;

  /** The axis is the line through \a center, where the vessel is narrowest, along \a direction of any length but 0. */
  Vessel(const PointType & center, const VectorType & direction, double radius, double stenosisLength)
    : m_Center(center)
    , m_Direction(direction / direction.GetNorm())
    , m_Radius(radius)
    , m_StenosisLength(stenosisLength)
  {}

  /** The radius at \a position along the axis, measured from the center: half of the full one at 0, and from there to
   * half of the stenosis length on both sides R (3 - cos(2 pi position / length)) / 4. */
  double
  GetRadius(double position) const
  {
    const bool inStenosis = 2.0 * std::abs(position) < m_StenosisLength;
    return inStenosis ? m_Radius * (3.0 - std::cos(Math::twopi * position / m_StenosisLength)) / 4.0 : m_Radius;
  }

  /** The position along the axis of what is next to \a point. */
  double
  GetPosition(const PointType & point) const
  {
    return (point - m_Center) * m_Direction;
  }

  /** The distance of \a point from the axis. */
  double
  GetDistance(const PointType & point) const
  {
    return (point - m_Center - m_Direction * this->GetPosition(point)).GetNorm();
  }

  /** The intensity at \a point. */
  double
  GetValue(const PointType & point) const
  {
    return std::max(0.0, 1.0 - Math::sqr(this->GetDistance(point) / this->GetRadius(this->GetPosition(point))));
  }

  /** The point nearest to the axis on the line through \a start along \a direction; \a start if they are parallel. */
  PointType
  GetNearestPoint(const PointType & start, const VectorType & direction) const
  {
    const VectorType across = direction - m_Direction * (direction * m_Direction);
    const double     squaredNorm = across.GetSquaredNorm();
    return squaredNorm > 0.0 ? start - direction * ((start - m_Center) * across / squaredNorm) : start;
  }

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

  PictureType::Pointer  truth;  // Vessel::GetMaximum() of each pixel's ray
  std::vector<Index<2>> object; // the pixels that are compared

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
