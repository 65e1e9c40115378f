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
#include "RotationAxis.h"

#include "Text.h"

#include <CLI/CLI.hpp>

#include <cmath>
#include <map>
#include <optional>

namespace
{
// LPS: x to the left, y to posterior, z to superior
const std::map<std::string, unsigned int> patientAxes = { { "left", 0 }, { "posterior", 1 }, { "superior", 2 } };
const std::map<std::string, unsigned int> imageAxes = { { "i", 0 }, { "j", 1 }, { "k", 2 } };

/** The name of an axis that \a axis means, empty if it means none. */
std::string
FindAxis(const std::vector<std::string> & axis)
{
  std::vector<std::string> names;
  for (const auto & axes : { patientAxes, imageAxes })
  {
    for (const auto & [name, number] : axes)
    {
      names.push_back(name);
    }
  }
  return axis.size() == 1 ? FindName(axis.front(), names) : "";
}

/** X,Y,Z, if it is three finite numbers. */
std::optional<itk::Vector<double, 3>>
ReadDirection(const std::vector<std::string> & axis)
{
  if (axis.size() != 3)
  {
    return std::nullopt;
  }
  itk::Vector<double, 3> direction;
  for (unsigned int n = 0; n < 3; ++n)
  {
    if (!CLI::detail::lexical_cast(axis[n], direction[n]) || !std::isfinite(direction[n]))
    {
      return std::nullopt;
    }
  }
  return direction;
}
} // namespace

bool
IsAxis(const std::vector<std::string> & axis)
{
  return !FindAxis(axis).empty() || ReadDirection(axis);
}

itk::Vector<double, 3>
MakeAxis(const std::vector<std::string> & axis, const itk::ImageBase<3> * grid)
{
  if (const auto given = ReadDirection(axis))
  {
    return *given;
  }
  itk::Vector<double, 3> direction(0.0);
  const std::string      name = FindAxis(axis);
  if (const auto found = imageAxes.find(name); found != imageAxes.end())
  {
    for (unsigned int row = 0; row < 3; ++row)
    {
      direction[row] = grid->GetDirection()(row, found->second);
    }
  }
  else
  {
    direction[patientAxes.at(name)] = 1.0;
  }
  return direction;
}
