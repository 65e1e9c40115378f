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
#include "Volumes.h"

#include "Data.h"

#include "itkImageFileReader.h"
#include "itkResampleImageFilter.h"
#include "itkShearWarpMIPImageFilter.h"

#include <algorithm>

namespace itk::ShearWarpBenchmark
{
namespace
{
using FloatImageType = Image<float, 3>;

FloatImageType::Pointer
Resample(const FloatImageType * image, const Size<3> & size)
{
  const auto                  region = image->GetLargestPossibleRegion();
  FloatImageType::SpacingType spacing;
  ContinuousIndex<double, 3>  firstVoxel;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const double scale = static_cast<double>(region.GetSize(axis)) / static_cast<double>(size[axis]);
    spacing[axis] = scale * image->GetSpacing()[axis];
    firstVoxel[axis] = static_cast<double>(region.GetIndex(axis)) - 0.5 + 0.5 * scale;
  }
  FloatImageType::PointType origin;
  image->TransformContinuousIndexToPhysicalPoint(firstVoxel, origin);

  const auto resample = ResampleImageFilter<FloatImageType, FloatImageType>::New();
  resample->SetInput(image);
  resample->SetSize(size);
  resample->SetOutputSpacing(spacing);
  resample->SetOutputOrigin(origin);
  resample->SetOutputDirection(image->GetDirection());
  resample->Update();
  return resample->GetOutput();
}
} // namespace

Image<std::uint16_t, 3>::Pointer
ReadVolume(const std::string & file, const Size<3> & size)
{
  // throws for other dimensions and components
  ReadInformation(file);
  const auto image = Resample(ReadImage<FloatImageType>(file), size);

  const auto volume = Image<std::uint16_t, 3>::New();
  volume->CopyInformation(image);
  volume->SetRegions(size);
  volume->Allocate();
  const float * voxels = image->GetBufferPointer();
  const float * voxelsEnd = voxels + image->GetBufferedRegion().GetNumberOfPixels();
  const auto [lowest, highest] = std::minmax_element(voxels, voxelsEnd);
  constexpr float largest = (1 << 14) - 1;
  const float     scale = *highest > *lowest ? largest / (*highest - *lowest) : 0.0F;
  std::transform(voxels, voxelsEnd, volume->GetBufferPointer(), [offset = *lowest, scale](float voxel) {
    return static_cast<std::uint16_t>(scale * (voxel - offset) + 0.5F);
  });
  return volume;
}

Image<std::uint16_t, 2>::Pointer
MakeFittedOutput(const Image<std::uint16_t, 3> * image, const Transform<double, 3, 3> * viewTransform)
{
  const auto filter = ShearWarpMIPImageFilter<Image<std::uint16_t, 3>>::New();
  filter->SetInput(image);
  filter->SetTransform(viewTransform);
  filter->UpdateOutputInformation();

  const auto output = Image<std::uint16_t, 2>::New();
  output->CopyInformation(filter->GetOutput());
  output->SetRegions(filter->GetOutput()->GetLargestPossibleRegion());
  output->Allocate();
  return output;
}
} // namespace itk::ShearWarpBenchmark
