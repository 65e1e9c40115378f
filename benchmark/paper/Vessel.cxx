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

#include "itkImageRegionIteratorWithIndex.h"
#include "itkMath.h"

#include <algorithm>
#include <cmath>

namespace itk::ShearWarpBenchmark
{
Vessel::Vessel(const PointType &  centre,
               const VectorType & direction,
               double             radius,
               double             stenosisLength,
               Profile            profile)
  : m_Centre(centre)
  , m_Direction(direction / direction.GetNorm())
  , m_Radius(radius)
  , m_StenosisLength(stenosisLength)
  , m_Profile(profile)
{}

double
Vessel::GetRadius(double position) const
{
  const bool inStenosis = 2.0 * std::abs(position) < m_StenosisLength;
  return inStenosis ? m_Radius * (3.0 - std::cos(Math::twopi * position / m_StenosisLength)) / 4.0 : m_Radius;
}

double
Vessel::GetSlopeOfRadius(double position) const
{
  const double frequency = Math::twopi / m_StenosisLength;
  return m_Radius * frequency * std::sin(frequency * position) / 4.0;
}

double
Vessel::GetDistance(const PointType & point) const
{
  return (point - m_Centre - m_Direction * this->GetPosition(point)).GetNorm();
}

double
Vessel::GetValueAtSquaredRadii(double squared) const
{
  if (m_Profile == Profile::Uniform)
  {
    return squared < 1.0 ? 1.0 : 0.0;
  }
  return std::max(0.0, 1.0 - squared);
}

double
Vessel::GetValue(const PointType & point) const
{
  return this->GetValueAtSquaredRadii(Math::sqr(this->GetDistance(point) / this->GetRadius(this->GetPosition(point))));
}

Vessel::PointType
Vessel::GetNearestPoint(const PointType & start, const VectorType & direction) const
{
  const VectorType across = direction - m_Direction * (direction * m_Direction);
  const double     squaredNorm = across.GetSquaredNorm();
  return squaredNorm > 0.0 ? start - direction * ((start - m_Centre) * across / squaredNorm) : start;
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
  if (!std::isfinite(growth))
  {
    return this->GetValueAtSquaredRadii(squaredDistance / Math::sqr(this->GetRadius(position)));
  }
  const auto getSquaredDistance = [&](double s) { return squaredDistance + growth * Math::sqr(s - position); };

  // squared distance over squared radius has one minimum, where its derivative changes sign
  double           low = position;
  double           high = std::max(position, 0.5 * m_StenosisLength);
  constexpr double tolerance = 1e-12;
  while (high - low > tolerance * m_StenosisLength)
  {
    const double middle = 0.5 * (low + high);
    const bool   falls = growth * (middle - position) * this->GetRadius(middle) <
                       getSquaredDistance(middle) * this->GetSlopeOfRadius(middle);
    (falls ? low : high) = middle;
  }
  return this->GetValueAtSquaredRadii(getSquaredDistance(low) / Math::sqr(this->GetRadius(low)));
}

namespace
{
/** The mean intensity in a voxel. */
double
GetMean(const Vessel & vessel, const Vessel::PointType & centre)
{
  const double halfDiagonal = 0.5 * std::sqrt(3.0);
  if (vessel.GetDistance(centre) >= vessel.GetLargestRadius() + halfDiagonal)
  {
    return 0.0;
  }
  constexpr int points = 8;
  const auto    offset = [](int n) { return (n + 0.5) / points - 0.5; };
  double        sum = 0.0;
  for (int z = 0; z < points; ++z)
  {
    for (int y = 0; y < points; ++y)
    {
      for (int x = 0; x < points; ++x)
      {
        const double offsets[] = { offset(x), offset(y), offset(z) };
        sum += vessel.GetValue(centre + Vessel::VectorType(offsets));
      }
    }
  }
  return sum / (points * points * points);
}
} // namespace

Image<float, 3>::Pointer
Digitize(const Vessel & vessel, const Size<3> & size, Digitization digitization)
{
  const auto image = Image<float, 3>::New();
  image->SetRegions(size);
  image->Allocate();
  for (ImageRegionIteratorWithIndex<Image<float, 3>> voxel(image, image->GetBufferedRegion()); !voxel.IsAtEnd();
       ++voxel)
  {
    Vessel::PointType centre;
    image->TransformIndexToPhysicalPoint(voxel.GetIndex(), centre);
    voxel.Set(static_cast<float>(digitization == Digitization::PointSampled ? vessel.GetValue(centre)
                                                                            : GetMean(vessel, centre)));
  }
  return image;
}
} // namespace itk::ShearWarpBenchmark
