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

namespace itk
{
std::ostream &
operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::Mode value)
{
  static constexpr const char * names[] = { "Maximum", "Minimum", "AbsoluteMaximum" };
  const auto                    index = static_cast<unsigned int>(value);
  return out << "itk::ShearWarpMIPImageFilterEnums::Mode::" << (index < 3 ? names[index] : "INVALID VALUE");
}

std::ostream &
operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::ReducedResampling value)
{
  static constexpr const char * names[] = { "Off", "On", "Auto" };
  const auto                    index = static_cast<unsigned int>(value);
  return out << "itk::ShearWarpMIPImageFilterEnums::ReducedResampling::"
             << (index < 3 ? names[index] : "INVALID VALUE");
}
} // namespace itk
