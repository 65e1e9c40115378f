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
#include "Pictures.h"

#include "RayCasting.h"

#include "itkShearWarpMIPImageFilter.h"

#include <algorithm>
#include <cmath>

namespace itk::ShearWarpBenchmark
{
PictureType::Pointer
MakePicture(SizeValueType columns, double spacing)
{
  const auto picture = PictureType::New();
  picture->SetRegions(Size<2>{ { columns, columns } });
  picture->SetSpacing(Vector<double, 2>(spacing));
  picture->SetOrigin(Point<double, 2>(-0.5 * spacing * static_cast<double>(columns - 1)));
  picture->Allocate(true);
  return picture;
}

PictureType::Pointer
MakePicture(const PictureType * grid)
{
  const auto picture = PictureType::New();
  picture->CopyInformation(grid);
  picture->SetRegions(grid->GetLargestPossibleRegion());
  picture->Allocate(true);
  return picture;
}

namespace
{
PictureType::Pointer
Project(const VolumeType *              volume,
        const Transform<double, 3, 3> * viewTransform,
        unsigned int                    oversampling,
        bool                            isExact,
        const PictureType *             grid)
{
  // threads must not share a filter's input, which the pipeline changes
  const auto input = VolumeType::New();
  input->Graft(volume);

  const auto filter = ShearWarpMIPImageFilter<VolumeType>::New();
  filter->SetInput(input);
  filter->SetTransform(viewTransform);
  filter->SetOversampling(oversampling);
  filter->SetExact(isExact);
  filter->SetSize(grid->GetLargestPossibleRegion().GetSize());
  filter->SetOutputSpacing(grid->GetSpacing());
  filter->SetOutputOrigin(grid->GetOrigin());
  filter->SetNumberOfWorkUnits(1);
  filter->Update();
  return filter->GetOutput();
}
} // namespace

PictureType::Pointer
ProjectByShearWarp(const VolumeType *              volume,
                   const Transform<double, 3, 3> * viewTransform,
                   unsigned int                    oversampling,
                   const PictureType *             grid)
{
  return Project(volume, viewTransform, oversampling, false, grid);
}

PictureType::Pointer
ProjectExactly(const VolumeType * volume, const Transform<double, 3, 3> * viewTransform, const PictureType * grid)
{
  return Project(volume, viewTransform, 1, true, grid);
}

PictureType::Pointer
ProjectByRayCasting(const VolumeType *              volume,
                    const Transform<double, 3, 3> * viewTransform,
                    double                          step,
                    const PictureType *             grid)
{
  const auto picture = MakePicture(grid);
  CastRays<float>(volume, viewTransform, step, 0.0f, picture);
  return picture;
}

PictureType::Pointer
Subtract(const PictureType * picture, const PictureType * reference, const std::vector<SizeValueType> & pixels)
{
  const auto difference = MakePicture(picture);
  for (const SizeValueType pixel : pixels)
  {
    difference->GetBufferPointer()[pixel] = picture->GetBufferPointer()[pixel] - reference->GetBufferPointer()[pixel];
  }
  return difference;
}

Errors
Compare(const PictureType *                picture,
        const PictureType *                reference,
        const std::vector<SizeValueType> & pixels,
        double                             tolerance)
{
  Errors errors;
  if (pixels.empty())
  {
    return errors;
  }
  std::vector<double> magnitudes;
  magnitudes.reserve(pixels.size());
  for (const SizeValueType pixel : pixels)
  {
    const double error = static_cast<double>(picture->GetBufferPointer()[pixel]) - reference->GetBufferPointer()[pixel];
    magnitudes.push_back(std::abs(error));
    errors.meanAbsolute += std::abs(error);
    errors.mean += error;
    errors.rootMeanSquare += error * error;
    errors.underestimated += error < -tolerance;
  }
  const auto count = static_cast<double>(pixels.size());
  errors.meanAbsolute /= count;
  errors.mean /= count;
  errors.rootMeanSquare = std::sqrt(errors.rootMeanSquare / count);
  errors.underestimated /= count;

  const auto percentile = magnitudes.begin() + static_cast<std::ptrdiff_t>(0.99 * (count - 1.0) + 0.5);
  std::nth_element(magnitudes.begin(), percentile, magnitudes.end());
  errors.percentile99 = *percentile;
  errors.largest = *std::max_element(percentile, magnitudes.end());
  return errors;
}
} // namespace itk::ShearWarpBenchmark
