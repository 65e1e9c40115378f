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
#include "itkShearWarpMIPView.h"

#include "itkContinuousIndex.h"
#include "itkMath.h"
#include "itkShearWarpFactorization.h"

#include <algorithm>
#include <cmath>
#include <ostream>

namespace itk
{
namespace
{
using VectorType = Vector<double, 3>;

struct ViewAxes
{
  VectorType u, v, w;
};

ViewAxes
GetAxes(ShearWarpMIPViewEnums::Direction direction)
{
  const auto make = [](double x, double y, double z) {
    const double components[] = { x, y, z };
    return VectorType(components);
  };
  const auto left = make(1, 0, 0);
  const auto posterior = make(0, 1, 0);
  const auto superior = make(0, 0, 1);
  using Direction = ShearWarpMIPViewEnums::Direction;
  switch (direction)
  {
    case Direction::Anterior:
      return { left, -superior, posterior };
    case Direction::Posterior:
      return { -left, -superior, -posterior };
    case Direction::Left:
      return { posterior, -superior, -left };
    case Direction::Right:
      return { -posterior, -superior, left };
    case Direction::Superior:
      return { -left, posterior, -superior };
    case Direction::Inferior:
      return { left, posterior, superior };
  }
  itkGenericExceptionMacro("Direction must be one of the six enumerators, but it is " << static_cast<int>(direction)
                                                                                      << '.');
}

/** Cosine and sine of an angle in degrees. Of multiples of 90 they are exact. */
void
GetCosineAndSine(double degrees, double & cosine, double & sine)
{
  const double quarters = std::round(degrees / 90.0);
  const double rest = (degrees - 90.0 * quarters) * Math::pi_over_180;
  const double cosines[4] = { std::cos(rest), -std::sin(rest), -std::cos(rest), std::sin(rest) };
  const auto   quadrant = static_cast<int>(quarters - 4.0 * std::floor(quarters / 4.0));
  cosine = cosines[quadrant];
  sine = cosines[(quadrant + 3) % 4];
}

/** Turns \a from towards \a to, both unit vectors at a right angle, and \a to along with it. */
void
TurnTowards(VectorType & from, VectorType & to, double degrees)
{
  double cosine;
  double sine;
  GetCosineAndSine(degrees, cosine, sine);
  const auto turned = from * cosine + to * sine;
  to = to * cosine - from * sine;
  from = turned;
}

VectorType
Normalize(const VectorType & axis)
{
  // scaled, so that squares neither overflow nor vanish
  const double largest = std::max({ std::abs(axis[0]), std::abs(axis[1]), std::abs(axis[2]) });
  const auto   scaled = axis / largest;
  const double length = scaled.GetNorm();
  if (!(length > 0.0 && std::isfinite(length)))
  {
    itkGenericExceptionMacro("The axis must be finite and not zero, but it is " << axis << '.');
  }
  return scaled / length;
}

ShearWarpMIPView::TransformType::Pointer
MakeView(const ImageBase<3> * image, const ViewAxes & axes)
{
  ShearWarpMIPView::TransformType::MatrixType matrix;
  for (unsigned int row = 0; row < 3; ++row)
  {
    matrix(row, 0) = axes.u[row];
    matrix(row, 1) = axes.v[row];
    matrix(row, 2) = axes.w[row];
  }
  auto transform = ShearWarpMIPView::TransformType::New();
  transform->SetMatrix(matrix);
  transform->SetOffset(ShearWarpMIPView::GetCenter(image).GetVectorFromOrigin());
  return transform;
}
} // namespace

double
ShearWarp::GetTurnAngle(unsigned int frame, unsigned int frames, double start, double range, bool isRocking)
{
  const double count = frames;
  if (!isRocking)
  {
    return start + range * (frame / count);
  }
  // the frame nearest to a quarter is one end
  const double end = std::floor((count + 2.0) / 4.0);
  const double part = frames > 2 ? std::sin(Math::twopi * (frame / count)) / std::sin(Math::twopi * (end / count))
                                 : count - 1.0 - 2.0 * frame;
  return start + 0.5 * range * part;
}

void
ShearWarp::VerifyTurn(const Vector<double, 3> & axis, const Point<double, 3> & center, double start, double range)
{
  const auto areFinite = [](const auto & numbers) {
    return std::isfinite(numbers[0]) && std::isfinite(numbers[1]) && std::isfinite(numbers[2]);
  };
  if (!areFinite(center))
  {
    itkGenericExceptionMacro("Center must be finite, but it is " << center << '.');
  }
  if (!areFinite(axis) || (axis[0] == 0.0 && axis[1] == 0.0 && axis[2] == 0.0))
  {
    itkGenericExceptionMacro("RotationAxis must be finite and not zero, but it is " << axis << '.');
  }
  if (!std::isfinite(start) || !std::isfinite(range))
  {
    itkGenericExceptionMacro("StartAngle and AngularRange must be finite, but they are " << start << " and " << range
                                                                                         << '.');
  }
}

std::ostream &
operator<<(std::ostream & out, ShearWarpMIPViewEnums::Direction value)
{
  static constexpr const char * names[] = { "Anterior", "Posterior", "Left", "Right", "Superior", "Inferior" };
  const auto                    index = static_cast<unsigned int>(value);
  return out << "itk::ShearWarpMIPViewEnums::Direction::" << (index < 6 ? names[index] : "INVALID VALUE");
}

ShearWarpMIPView::TransformType::Pointer
ShearWarpMIPView::MakeTransform(const ImageBase<3> * image, DirectionEnum direction, double azimuth, double elevation)
{
  if (!std::isfinite(azimuth) || !std::isfinite(elevation))
  {
    itkGenericExceptionMacro("Azimuth and elevation must be finite, but they are " << azimuth << " and " << elevation
                                                                                   << '.');
  }
  ViewAxes axes = GetAxes(direction);
  TurnTowards(axes.u, axes.w, azimuth);
  TurnTowards(axes.v, axes.w, -elevation);
  return MakeView(image, axes);
}

ShearWarpMIPView::TransformType::Pointer
ShearWarpMIPView::MakeUprightTransform(const ImageBase<3> * image, const Vector<double, 3> & axis)
{
  const VectorType up = Normalize(axis);
  const double     posterior[] = { 0.0, 1.0, 0.0 };
  const double     inferior[] = { 0.0, 0.0, -1.0 };
  // away from the viewer, at a right angle to the axis
  const VectorType away = std::abs(up[1]) < 0.99 ? VectorType(posterior) : VectorType(inferior);
  const VectorType w = Normalize(away - up * (away * up));
  return MakeView(image, { CrossProduct(w, up), -up, w });
}

ShearWarpMIPView::TransformType::Pointer
ShearWarpMIPView::Turn(const Transform<double, 3, 3> * view,
                       const Vector<double, 3> &       axis,
                       const Point<double, 3> &        center,
                       double                          degrees)
{
  const auto       linearPart = ShearWarpFactorization::GetLinearPart(view);
  const VectorType k = Normalize(axis);
  if (!std::isfinite(degrees))
  {
    itkGenericExceptionMacro("The angle must be finite, but it is " << degrees << '.');
  }
  double cosine;
  double sine;
  GetCosineAndSine(degrees, cosine, sine);
  TransformType::MatrixType rotation;
  for (unsigned int row = 0; row < 3; ++row)
  {
    const unsigned int next = (row + 1) % 3;
    const unsigned int last = (row + 2) % 3;
    rotation(row, row) = cosine + k[row] * k[row] * (1.0 - cosine);
    rotation(row, next) = k[row] * k[next] * (1.0 - cosine) - k[last] * sine;
    rotation(row, last) = k[row] * k[last] * (1.0 - cosine) + k[next] * sine;
  }
  auto turned = TransformType::New();
  turned->SetMatrix(rotation * linearPart);
  const VectorType fromCenter = view->TransformPoint(Point<double, 3>(0.0)) - center;
  turned->SetOffset(center.GetVectorFromOrigin() + rotation * fromCenter);
  return turned;
}

Point<double, 3>
ShearWarpMIPView::GetCenter(const ImageBase<3> * image)
{
  if (!image)
  {
    itkGenericExceptionMacro("The image is required but not set.");
  }
  const ImageRegion<3> & region = image->GetLargestPossibleRegion();
  if (region.GetNumberOfPixels() == 0)
  {
    itkGenericExceptionMacro("The image has no voxels: call UpdateOutputInformation() of its filter before.");
  }
  ContinuousIndex<double, 3> index;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    index[axis] = static_cast<double>(region.GetIndex(axis)) + 0.5 * (static_cast<double>(region.GetSize(axis)) - 1.0);
  }
  Point<double, 3> center;
  image->TransformContinuousIndexToPhysicalPoint(index, center);
  return center;
}
} // namespace itk
