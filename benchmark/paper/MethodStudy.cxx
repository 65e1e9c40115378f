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
#include "MethodStudy.h"

#include "Data.h"
#include "PlainShearWarp.h"
#include "RayCasting.h"
#include "TaggedShearWarp.h"

#include "itkImageFileReader.h"
#include "itkImageFileWriter.h"
#include "itkResampleImageFilter.h"
#include "itkShearWarpMIPImageFilter.h"
#include "itkSubtractImageFilter.h"

#include <fstream>
#include <functional>
#include <optional>

namespace itk::ShearWarpBenchmark
{
namespace
{
using PixelType = std::uint16_t;
using VolumeType = Image<PixelType, 3>;
using FloatImageType = Image<float, 3>;
using PictureType = Image<PixelType, 2>;
using PixelsType = std::vector<PixelType>;
using FilterType = ShearWarpMIPImageFilter<VolumeType>;

struct View
{
  unsigned int               angle;
  ViewTransformType::Pointer transform;
  PictureType::Pointer       output;
};

struct Method
{
  std::string             name;
  std::function<double()> prepare; // returns seconds

  /** Sets what a Timing has of one view; returns the picture of a shear-warp. */
  std::function<PixelsType(const View &, Timing &)> project;
};

Method
MakeRayCasting(const VolumeType * volume)
{
  return { "ray casting",
           [] { return 0.0; },
           [volume](const View & view, Timing & timing) {
             const double step = GetVoxelStep(volume, view.transform);
             timing.clip = Time([&] { CountSamples(volume, view.transform, step, view.output); });
             timing.total = Time([&] { CastRays<PixelType>(volume, view.transform, step, PixelType{}, view.output); });
             timing.interpolation = timing.total - timing.clip;
             return PixelsType();
           } };
}

/** A published shear-warp: factorization, \a project(factorization, skipped fraction), warp. */
template <typename TPrepare, typename TProject>
Method
MakeShearWarp(const std::string & name, const VolumeType * volume, const TPrepare & prepare, const TProject & project)
{
  return { name,
           [prepare] { return Time(prepare); },
           [volume, project](const View & view, Timing & timing) {
             std::optional<ShearWarpFactorization> factorization;
             PixelsType                            intermediate;
             PixelsType                            picture;
             const double factorizing = Time([&] { factorization.emplace(view.transform, volume, view.output); });
             timing.interpolation = Time([&] { intermediate = project(*factorization, timing.skippedFraction); });
             timing.warp =
               Time([&] { picture = Warp(*factorization, intermediate, view.output->GetBufferedRegion().GetSize()); });
             timing.total = factorizing + timing.interpolation + timing.warp;
             return picture;
           } };
}

Method
MakeFilter(const std::string &               name,
           const VolumeType *                volume,
           const std::vector<View> &         views,
           FilterType::ReducedResamplingEnum reducedResampling)
{
  const auto filter = FilterType::New();
  filter->SetInput(volume);
  filter->SetReducedResampling(reducedResampling);
  filter->SetNumberOfWorkUnits(1);
  const auto prepare = [filter, &views] {
    filter->ReleasePreparedVolume();
    double seconds = 0.0;
    for (const View & view : views)
    {
      filter->SetTransform(view.transform);
      filter->Update();
      seconds += filter->GetPreparationSeconds();
    }
    return seconds;
  };
  return { name, prepare, [filter](const View & view, Timing & timing) {
            timing.total = Time([&] {
              filter->SetTransform(view.transform);
              filter->Update();
            });
            timing.interpolation = filter->GetProjectionSeconds();
            timing.warp = filter->GetWarpSeconds();
            timing.skippedFraction = filter->GetSkippedFraction();
            const auto * output = filter->GetOutput();
            const auto * begin = output->GetBufferPointer();
            return PixelsType(begin, begin + output->GetBufferedRegion().GetNumberOfPixels());
          } };
}

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

VolumeType::Pointer
ReadVolume(const std::string & file, const Size<3> & size)
{
  // throws for other dimensions and components
  ReadInformation(file);
  const auto image = Resample(ReadImage<FloatImageType>(file), size);

  const auto volume = VolumeType::New();
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

PictureType::Pointer
MakeFittedOutput(const VolumeType * image, const Transform<double, 3, 3> * viewTransform)
{
  const auto filter = FilterType::New();
  filter->SetInput(image);
  filter->SetTransform(viewTransform);
  filter->UpdateOutputInformation();

  const auto output = PictureType::New();
  output->CopyInformation(filter->GetOutput());
  output->SetRegions(filter->GetOutput()->GetLargestPossibleRegion());
  output->Allocate();
  return output;
}

std::vector<Timing>
TimeMethods(const VolumeType * image, unsigned int repetitions)
{
  std::vector<View> views;
  for (unsigned int angle = 0; angle <= 180; angle += 10)
  {
    const auto transform = MakeView(image, Angles{ 0.0, static_cast<double>(angle), 0.0 });
    views.push_back({ angle, transform, MakeFittedOutput(image, transform) });
  }
  std::vector<PermutedVolume<PixelType>> copies;
  std::optional<TaggedShearWarp>         tagged;

  const auto permute = [&] {
    copies.clear();
    for (unsigned int principalAxis = 0; principalAxis < 3; ++principalAxis)
    {
      copies.emplace_back(image, principalAxis);
    }
  };
  const auto projectPlainly = [&](const ShearWarpFactorization & factorization, double &) {
    return Project(copies[factorization.GetPrincipalAxis()], factorization);
  };
  const auto tag = [&] { tagged.emplace(image); };
  const auto projectTagged = [&](const ShearWarpFactorization & factorization, double & skippedFraction) {
    auto projection = tagged->Project(factorization);
    skippedFraction = static_cast<double>(projection.skippedCells) / static_cast<double>(projection.cells);
    return std::move(projection.intermediate);
  };
  const std::vector<Method> methods{ MakeRayCasting(image),
                                     MakeShearWarp("shear warp", image, permute, projectPlainly),
                                     MakeShearWarp("shear warp, tagged", image, tag, projectTagged),
                                     MakeFilter("filter, off", image, views, FilterType::ReducedResamplingEnum::Off),
                                     MakeFilter(
                                       "filter, auto", image, views, FilterType::ReducedResamplingEnum::Auto) };

  std::vector<Timing>     timings;
  std::vector<PixelsType> expected(views.size());
  for (unsigned int repetition = 0; repetition < repetitions; ++repetition)
  {
    for (const Method & method : methods)
    {
      const double preparation = method.prepare();
      for (std::size_t v = 0; v < views.size(); ++v)
      {
        const View &                 view = views[v];
        const ShearWarpFactorization factorization(view.transform, image, view.output);
        timings.push_back({ method.name, view.angle, factorization.GetPrincipalAxis(), preparation });
        const PixelsType pixels = method.project(view, timings.back());
        if (expected[v].empty())
        {
          expected[v] = pixels;
        }
        else if (!pixels.empty() && pixels != expected[v])
        {
          itkGenericExceptionMacro("At " << view.angle << " degrees '" << method.name
                                         << "' differs from the first shear-warp.");
        }
      }
    }
  }
  return timings;
}

void
WriteTimings(const std::vector<Timing> & timings, const std::string & csvFile)
{
  std::ofstream csv(csvFile);
  csv << "method,angle,principal_axis,preparation_ms,interpolation_ms,clip_ms,warp_ms,total_ms,skipped_fraction\n";
  for (const Timing & timing : timings)
  {
    csv << '"' << timing.method << "\"," << timing.angle << ',' << timing.principalAxis;
    for (const double seconds : { timing.preparation, timing.interpolation, timing.clip, timing.warp, timing.total })
    {
      csv << ',' << 1000.0 * seconds;
    }
    csv << ',' << timing.skippedFraction << '\n';
  }
  if (!csv.flush())
  {
    itkGenericExceptionMacro("'" << csvFile << "' cannot be written.");
  }
}

void
WriteFigure5(const VolumeType * image, const std::string & name, const std::string & folder)
{
  const auto transform = MakeView(image, Angles{ 50.0, 0.0, 40.0 });
  const auto rayCasting = MakeFittedOutput(image, transform);
  CastRays<PixelType>(image, transform, GetVoxelStep(image, transform), 0, rayCasting);

  const ShearWarpFactorization factorization(transform, image, rayCasting);
  const PixelsType             shearWarp = Warp(factorization,
                                    TaggedShearWarp(image).Project(factorization).intermediate,
                                    rayCasting->GetBufferedRegion().GetSize());

  const auto filter = FilterType::New();
  filter->SetInput(image);
  filter->SetTransform(transform);
  filter->Update();
  if (!std::equal(shearWarp.begin(), shearWarp.end(), filter->GetOutput()->GetBufferPointer()))
  {
    itkGenericExceptionMacro("The filter's picture of " << name << " differs from that of the published shear-warp.");
  }

  const auto difference = SubtractImageFilter<PictureType, PictureType, Image<float, 2>>::New();
  difference->SetInput1(rayCasting);
  difference->SetInput2(filter->GetOutput());

  const std::string stem = folder + "/figure5-" + name + '-';
  WriteImage(rayCasting.GetPointer(), stem + "raycasting.tif");
  WriteImage(filter->GetOutput(), stem + "shearwarp.tif");
  WriteImage(difference->GetOutput(), stem + "difference.tif");
}
} // namespace itk::ShearWarpBenchmark
