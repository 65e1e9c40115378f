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
#include "Vessel.h"

#include "itkMath.h"

#include <algorithm>
#include <cmath>

namespace itk::ShearWarpBenchmark
{
Vessel::Vessel(const PointType & center, const VectorType & direction, double radius, double stenosisLength)
  : m_Center(center)
  , m_Direction(direction / direction.GetNorm())
  , m_Radius(radius)
  , m_StenosisLength(stenosisLength)
{}

double
Vessel::GetRadius(double position) const
{
  const bool inStenosis = 2.0 * std::abs(position) < m_StenosisLength;
  return inStenosis ? m_Radius * (3.0 - std::cos(Math::twopi * position / m_StenosisLength)) / 4.0 : m_Radius;
}

double
Vessel::GetDistance(const PointType & point) const
{
  return (point - m_Center - m_Direction * this->GetPosition(point)).GetNorm();
}

double
Vessel::GetValue(const PointType & point) const
{
  return std::max(0.0, 1.0 - Math::sqr(this->GetDistance(point) / this->GetRadius(this->GetPosition(point))));
}

Vessel::PointType
Vessel::GetNearestPoint(const PointType & start, const VectorType & direction) const
{
  const VectorType across = direction - m_Direction * (direction * m_Direction);
  const double     squaredNorm = across.GetSquaredNorm();
  return squaredNorm > 0.0 ? start - direction * ((start - m_Center) * across / squaredNorm) : start;
}

double
Vessel::GetMaximum(const PointType & start, const VectorType & direction) const
{
  const PointType nearest = this->GetNearestPoint(start, direction);
  const double    squaredDistance = Math::sqr(this->GetDistance(nearest));
  const double    position = std::abs(this->GetPosition(nearest));

  // the squared distance grows by this, times the square of the way along the axis
  const double along = direction * m_Direction;
  const double growth = (direction - m_Direction * along).GetSquaredNorm() / (along * along);
  const bool   isAcross = !std::isfinite(growth);
  const auto   getSquaredDistance = [&](double s) { return squaredDistance + growth * Math::sqr(s - position); };

  // squared distance over squared radius has one minimum, where its derivative changes sign
  const double     frequency = Math::twopi / m_StenosisLength;
  double           low = position;
  double           high = isAcross ? position : std::max(position, 0.5 * m_StenosisLength);
  constexpr double tolerance = 1e-12;
  while (high - low > tolerance * m_StenosisLength)
  {
    const double middle = 0.5 * (low + high);
    const double slopeOfRadius = m_Radius * frequency * std::sin(frequency * middle) / 4.0;
    const bool   falls =
      growth * (middle - position) * this->GetRadius(middle) < getSquaredDistance(middle) * slopeOfRadius;
    (falls ? low : high) = middle;
  }
  const double least = isAcross ? squaredDistance : getSquaredDistance(low);
  return std::max(0.0, 1.0 - least / Math::sqr(this->GetRadius(low)));
}
} // namespace itk::ShearWarpBenchmark
