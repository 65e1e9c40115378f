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
#include "Orientation.h"

#include "itkMath.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace
{
std::string
FindLetters(const itk::Vector<double, 3> & direction)
{
  constexpr std::array<const char *, 3> sides{ { "LR", "PA", "HF" } };
  constexpr double                      sin22 = 0.382683;

  // rounding errors make no letter
  std::array<double, 3> lengths{};
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    lengths[axis] = std::round(1e6 * std::abs(direction[axis]) / direction.GetNorm()) / 1e6;
  }
  std::array<unsigned int, 3> axes{ { 0, 1, 2 } };
  std::stable_sort(axes.begin(), axes.end(), [&](unsigned int a, unsigned int b) { return lengths[a] > lengths[b]; });
  std::string letters;
  for (const unsigned int axis : { axes[0], axes[1] })
  {
    if (lengths[axis] >= sin22)
    {
      letters += sides[axis][direction[axis] < 0.0 ? 1 : 0];
    }
  }
  return letters;
}
} // namespace

itk::Vector<double, 3>
ComputeAxis(const itk::Transform<double, 3, 3> * transform, unsigned int axis)
{
  itk::Point<double, 3> point(0.0);
  const auto            origin = transform->TransformPoint(point);
  point[axis] = 1.0;
  return transform->TransformPoint(point) - origin;
}

EdgeLetters
ComputeEdgeLetters(const itk::Transform<double, 3, 3> * transform)
{
  const auto right = ComputeAxis(transform, 0);
  const auto down = ComputeAxis(transform, 1);
  return { FindLetters(-right), FindLetters(right), FindLetters(-down), FindLetters(down) };
}

ViewAngles
ComputeViewAngles(const itk::Transform<double, 3, 3> * transform)
{
  constexpr double degrees = 180.0 / itk::Math::pi;
  const auto       direction = -ComputeAxis(transform, 2);
  const double     equatorial = std::hypot(direction[0], direction[1]);
  const bool       isPole = equatorial < 1e-9 * direction.GetNorm();
  // seen along the long axis, what is up says where the front is
  const auto   front = isPole ? ComputeAxis(transform, 1) * (direction[2] > 0.0 ? 1.0 : -1.0) : direction;
  const double primary = degrees * std::atan2(front[0], -front[1]);
  return { primary > -180.0 ? primary : 180.0, degrees * std::atan2(direction[2], equatorial) };
}
