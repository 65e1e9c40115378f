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
#ifndef Data_h
#define Data_h

#include "itkAffineTransform.h"
#include "itkImage.h"

#include <array>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

/** Calls macro(type) for each type of voxels. */
#define FOR_EACH_BENCHMARK_PIXEL_TYPE(macro)                                                                        \
  macro(std::uint8_t) macro(std::int16_t) macro(std::uint16_t) macro(std::int32_t) macro(std::int64_t) macro(float) \
    macro(double)

namespace itk::ShearWarpBenchmark
{
/** A volume to project: a synthetic volume, see MakeVolume(), or the volume of a file. */
struct DataSet
{
  std::string kind; // or the file's name
  std::string file; // empty for a synthetic volume
  Size<3>     size;
  std::string pixelType; // uint8, int16, uint16, int32, int64, float or double
};

/** The volume of an image file that ITK reads. Pixels of other types become int16, to which reading casts them. Throws
 * ExceptionObject if the file holds no scalar volume. */
DataSet
ReadInformation(const std::string & file);

/** The kinds of synthetic volumes, which README.md describes. */
std::vector<std::string>
GetKinds();

/** A volume of unit spacing, the same for any number of threads. The anatomy scales with \a size, the noise does not.
 * Other types hold the same values as `uint16`, `int16` too (full 16-bit noise shifted to its range), `uint8` the
 * upper eight bits. Throws ExceptionObject for an unknown kind. */
template <typename TPixel>
typename Image<TPixel, 3>::Pointer
MakeVolume(const std::string & kind, const Size<3> & size);

/** Calls function(T()) with the type that \a pixelType names. */
template <typename TFunction>
auto
Dispatch(const std::string & pixelType, const TFunction & function)
{
  return pixelType == "uint8"    ? function(std::uint8_t{})
         : pixelType == "int16"  ? function(std::int16_t{})
         : pixelType == "uint16" ? function(std::uint16_t{})
         : pixelType == "int32"  ? function(std::int32_t{})
         : pixelType == "int64"  ? function(std::int64_t{})
         : pixelType == "double" ? function(double{})
                                 : function(float{});
}

using ViewTransformType = AffineTransform<double, 3>;

/** Turns, in degrees, about a volume's axes, the first axis first. */
using Angles = std::array<double, 3>;

/** The views that are measured, which README.md describes. */
const std::vector<Angles> &
GetViews();

/** A new transform of the given view, from view space (mm, its origin the image's center) to the image's physical
 * space. */
ViewTransformType::Pointer
MakeView(const ImageBase<3> * image, const Angles & angles);

/** What an error says, without the place in the code that ITK's exceptions have. */
std::string
Describe(const std::exception & error);

/** Seconds that \a function takes. */
template <typename TFunction>
double
Time(const TFunction & function)
{
  const auto start = std::chrono::steady_clock::now();
  function();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}
} // namespace itk::ShearWarpBenchmark

#endif
