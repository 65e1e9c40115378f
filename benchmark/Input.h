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
#ifndef Input_h
#define Input_h

#include "itkImage.h"

#include <string>

namespace itk::ShearWarpBenchmark
{
/** The pixel types that are measured. */
enum class PixelType
{
  UInt8,
  Int16,
  UInt16,
  Float
};

/** In the order of PixelType. */
constexpr const char * PixelTypeNames[] = { "uint8", "int16", "uint16", "float" };

struct FileInformation
{
  Size<3>   size;
  PixelType pixelType;
};

/** Size and pixel type of an image file that ITK reads. For pixels of other types: float for double, and int16, to
 * which reading casts them. Throws ExceptionObject if the file holds no scalar volume. */
FileInformation
ReadInformation(const std::string & file);

/** Calls function(T()) with the type that \a type names. */
template <typename TFunction>
auto
Dispatch(PixelType type, const TFunction & function)
{
  switch (type)
  {
    case PixelType::UInt8:
      return function(std::uint8_t{});
    case PixelType::Int16:
      return function(std::int16_t{});
    case PixelType::UInt16:
      return function(std::uint16_t{});
    default:
      return function(float{});
  }
}
} // namespace itk::ShearWarpBenchmark

#endif
