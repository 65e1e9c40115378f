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
#include "itkShearWarpMIPImageFilter.h"

#include "itksys/SystemInformation.hxx"

#include <cmath>
#include <limits>

namespace itk::ShearWarp
{
double
GetPhysicalMemory()
{
  static const double memory = [] {
    itksys::SystemInformation system;
    system.RunMemoryCheck();
    const auto megabytes = system.GetTotalPhysicalMemory();
    return megabytes > 0 ? 0x1p20 * static_cast<double>(megabytes)
                         : 0.5 * static_cast<double>(std::numeric_limits<std::ptrdiff_t>::max());
  }();
  return memory;
}

Point<double, 2>
FindFirstPixel(const ImageBase<2> * picture)
{
  if (!picture)
  {
    itkGenericExceptionMacro("The image of the output's grid must not be null.");
  }
  if (!picture->GetDirection().GetVnlMatrix().is_identity())
  {
    itkGenericExceptionMacro("The image of the output's grid must have the identity as its direction, but it has\n"
                             << picture->GetDirection());
  }
  return picture->TransformIndexToPhysicalPoint<double>(picture->GetLargestPossibleRegion().GetIndex());
}

Point<double, 3>
TransformPixel(const AffineMap3D & pictureSpace, double column, double row, double depth)
{
  if (!std::isfinite(depth))
  {
    itkGenericExceptionMacro("No ray has a value at column " << column << ", row " << row << '.');
  }
  Point<double, 3> point(pictureSpace.offset);
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto & steps = pictureSpace.matrix[axis];
    point[axis] += steps[0] * column + steps[1] * row + steps[2] * depth;
  }
  return point;
}
} // namespace itk::ShearWarp
