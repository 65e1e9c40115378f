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
#include "Check.h"

#include "RayCasting.h"
#include "Views.h"

#include "itkImageRegionIteratorWithIndex.h"
#include "itkShearWarpMIPImageFilter.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>

namespace itk::ShearWarpBenchmark
{
namespace
{
template <typename TPixel>
constexpr double LargestVoxel = sizeof(TPixel) == 1 ? 250.0 : 30000.0;

constexpr double SmallestDeviation = 8.0;

/** A blob of normal shape, away from the centre and of different width along each axis, nothing at the faces. */
template <typename TPixel>
typename Image<TPixel, 3>::Pointer
MakeSmoothVolume()
{
  constexpr double centre[] = { 36.3, 47.2, 52.4 };
  constexpr double deviation[] = { SmallestDeviation, 10.0, 12.0 };

  const auto volume = Image<TPixel, 3>::New();
  volume->SetRegions(Size<3>{ { 76, 92, 108 } });
  volume->Allocate();
  for (ImageRegionIteratorWithIndex<Image<TPixel, 3>> voxel(volume, volume->GetBufferedRegion()); !voxel.IsAtEnd();
       ++voxel)
  {
    double squaredDistance = 0.0;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const double distance = (static_cast<double>(voxel.GetIndex()[axis]) - centre[axis]) / deviation[axis];
      squaredDistance += distance * distance;
    }
    voxel.Set(static_cast<TPixel>(LargestVoxel<TPixel> * std::exp(-0.5 * squaredDistance)));
  }
  return volume;
}
} // namespace

template <typename TPixel>
std::string
CheckRayCasting()
{
  using VolumeType = Image<TPixel, 3>;
  const auto volume = MakeSmoothVolume<TPixel>();
  const auto filter = ShearWarpMIPImageFilter<VolumeType>::New();
  filter->SetInput(volume);

  constexpr double curvature = LargestVoxel<TPixel> / (SmallestDeviation * SmallestDeviation);
  constexpr double tolerance = 7.0 / 8.0 * curvature + (std::numeric_limits<TPixel>::is_integer ? 2.0 : 0.0);
  double           largestDifference = 0.0;
  for (unsigned int view = 0; view < GetNumberOfViews(); ++view)
  {
    const auto transform = MakeView(volume, view);
    filter->SetTransform(transform);
    filter->Update();
    const auto * projection = filter->GetOutput();

    const auto output = Image<TPixel, 2>::New();
    output->CopyInformation(projection);
    output->SetRegions(projection->GetLargestPossibleRegion());
    output->Allocate();
    CastRays<TPixel>(volume, transform, 1.0, TPixel{}, output);
    for (SizeValueType n = 0; n < output->GetBufferedRegion().GetNumberOfPixels(); ++n)
    {
      const double difference = static_cast<double>(output->GetBufferPointer()[n]) - projection->GetBufferPointer()[n];
      largestDifference = std::max(largestDifference, std::abs(difference));
    }
  }
  if (largestDifference <= tolerance)
  {
    return {};
  }
  std::ostringstream message;
  message << "ray casting and filter differ by " << largestDifference << " on smooth data; " << tolerance
          << " is allowed";
  return message.str();
}

template std::string
CheckRayCasting<std::uint8_t>();
template std::string
CheckRayCasting<std::int16_t>();
template std::string
CheckRayCasting<std::uint16_t>();
template std::string
CheckRayCasting<float>();

} // namespace itk::ShearWarpBenchmark
