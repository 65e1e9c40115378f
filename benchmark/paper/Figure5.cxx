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
#include "Figure5.h"

#include "RayCasting.h"
#include "TaggedShearWarp.h"
#include "Views.h"
#include "Volumes.h"

#include "itkImageFileWriter.h"
#include "itkShearWarpMIPImageFilter.h"

#include <algorithm>

namespace itk::ShearWarpBenchmark
{
void
WriteFigure5(const Image<std::uint16_t, 3> * image, const std::string & name, const std::string & folder)
{
  const auto transform = MakeView(image, Angles{ 50.0, 0.0, 40.0 });
  const auto rayCasting = MakeFittedOutput(image, transform);
  CastRays<std::uint16_t>(image, transform, GetVoxelStep(image, transform), 0, rayCasting);

  const auto                   size = rayCasting->GetBufferedRegion().GetSize();
  const ShearWarpFactorization factorization(transform, image, rayCasting);
  std::vector<std::uint16_t>   shearWarp(size[0] * size[1]);
  WarpRows(factorization,
           TaggedShearWarp(image).Project(factorization).intermediate,
           0,
           static_cast<std::ptrdiff_t>(size[1]),
           static_cast<std::ptrdiff_t>(size[0]),
           std::uint16_t{},
           shearWarp);

  const auto filter = ShearWarpMIPImageFilter<Image<std::uint16_t, 3>>::New();
  filter->SetInput(image);
  filter->SetTransform(transform);
  filter->Update();
  const auto * filtered = filter->GetOutput();
  if (!std::equal(shearWarp.begin(), shearWarp.end(), filtered->GetBufferPointer()))
  {
    itkGenericExceptionMacro("The filter's picture of " << name << " differs from that of the published shear-warp.");
  }

  const auto difference = Image<float, 2>::New();
  difference->CopyInformation(rayCasting);
  difference->SetRegions(rayCasting->GetBufferedRegion());
  difference->Allocate();
  std::transform(shearWarp.begin(),
                 shearWarp.end(),
                 rayCasting->GetBufferPointer(),
                 difference->GetBufferPointer(),
                 [](std::uint16_t b, std::uint16_t a) { return static_cast<float>(a) - static_cast<float>(b); });

  const std::string stem = folder + "/figure5-" + name + '-';
  WriteImage(rayCasting.GetPointer(), stem + "raycasting.tif");
  WriteImage(filtered, stem + "shearwarp.tif");
  WriteImage(difference.GetPointer(), stem + "difference.tif");
}
} // namespace itk::ShearWarpBenchmark
