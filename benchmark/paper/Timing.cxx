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
#include "Timing.h"

#include "PlainShearWarp.h"
#include "RayCasting.h"
#include "TaggedShearWarp.h"
#include "Views.h"
#include "Volumes.h"

#include "itkShearWarpMIPImageFilter.h"

#include <chrono>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>

namespace itk::ShearWarpBenchmark
{
namespace
{
using PixelType = std::uint16_t;
using VolumeType = Image<PixelType, 3>;
using PixelsType = std::vector<PixelType>;
using FilterType = ShearWarpMIPImageFilter<VolumeType>;

struct View
{
  unsigned int                 angle;
  ViewTransformType::Pointer   transform;
  Image<PixelType, 2>::Pointer output;
};

/** A projection: times as in Timing, and the picture of a shear-warp. */
struct Projection
{
  double     interpolation, clip, warp, total;
  double     skippedFraction;
  PixelsType pixels;
};

struct Method
{
  std::string                             name;
  std::function<double()>                 prepare; // returns milliseconds
  std::function<Projection(const View &)> project;
};

/** Milliseconds that \a function takes. */
template <typename TFunction>
double
Time(const TFunction & function)
{
  const auto start = std::chrono::steady_clock::now();
  function();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

Method
MakeRayCasting(const VolumeType * volume)
{
  return { "ray casting",
           [] { return 0.0; },
           [volume](const View & view) -> Projection {
             const double step = GetVoxelStep(volume, view.transform);
             const double clip = Time([&] { CountSamples(volume, view.transform, step, view.output); });
             const double total =
               Time([&] { CastRays<PixelType>(volume, view.transform, step, PixelType{}, view.output); });
             return { total - clip, clip, 0.0, total, 0.0, {} };
           } };
}

/** A published shear-warp: factorization, \a project(factorization, skipped fraction), warp. */
template <typename TPrepare, typename TProject>
Method
MakeShearWarp(const std::string & name, const VolumeType * volume, const TPrepare & prepare, const TProject & project)
{
  return { name,
           [prepare] { return Time(prepare); },
           [volume, project](const View & view) {
             const auto                            size = view.output->GetBufferedRegion().GetSize();
             std::optional<ShearWarpFactorization> factorization;
             PixelsType                            intermediate;
             Projection                            result{ 0.0, 0.0, 0.0, 0.0, 0.0, PixelsType(size[0] * size[1]) };
             const double factorizing = Time([&] { factorization.emplace(view.transform, volume, view.output); });
             result.interpolation = Time([&] { intermediate = project(*factorization, result.skippedFraction); });
             result.warp = Time([&] {
               WarpRows(*factorization,
                        intermediate,
                        0,
                        static_cast<std::ptrdiff_t>(size[1]),
                        static_cast<std::ptrdiff_t>(size[0]),
                        PixelType{},
                        result.pixels);
             });
             result.total = factorizing + result.interpolation + result.warp;
             return result;
           } };
}

Method
MakePlainShearWarp(const VolumeType * volume)
{
  const auto copies = std::make_shared<std::vector<PermutedVolume<PixelType>>>();
  return MakeShearWarp(
    "shear warp",
    volume,
    [volume, copies] {
      copies->clear();
      for (unsigned int principalAxis = 0; principalAxis < 3; ++principalAxis)
      {
        copies->emplace_back(volume, principalAxis);
      }
    },
    [copies](const ShearWarpFactorization & factorization, double &) {
      return Project((*copies)[factorization.GetPrincipalAxis()], factorization);
    });
}

Method
MakeTaggedShearWarp(const VolumeType * volume)
{
  const auto shearWarp = std::make_shared<std::optional<TaggedShearWarp>>();
  return MakeShearWarp(
    "shear warp, tagged",
    volume,
    [volume, shearWarp] { shearWarp->emplace(volume); },
    [shearWarp](const ShearWarpFactorization & factorization, double & skippedFraction) {
      auto projection = (*shearWarp)->Project(factorization);
      skippedFraction = static_cast<double>(projection.skippedCells) / static_cast<double>(projection.cells);
      return std::move(projection.intermediate);
    });
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
    return 1000.0 * seconds;
  };
  return { name, prepare, [filter](const View & view) -> Projection {
            const double total = Time([&] {
              filter->SetTransform(view.transform);
              filter->Update();
            });
            const auto * output = filter->GetOutput();
            const auto * begin = output->GetBufferPointer();
            return { 1000.0 * filter->GetProjectionSeconds(),
                     0.0,
                     1000.0 * filter->GetWarpSeconds(),
                     total,
                     filter->GetSkippedFraction(),
                     PixelsType(begin, begin + output->GetBufferedRegion().GetNumberOfPixels()) };
          } };
}
} // namespace

std::vector<Timing>
TimeMethods(const VolumeType * image, unsigned int repetitions)
{
  std::vector<View> views;
  for (unsigned int angle = 0; angle <= 180; angle += 10)
  {
    const auto transform = MakeView(image, Angles{ 0.0, static_cast<double>(angle), 0.0 });
    views.push_back({ angle, transform, MakeFittedOutput(image, transform) });
  }
  const std::vector<Method> methods{ MakeRayCasting(image),
                                     MakePlainShearWarp(image),
                                     MakeTaggedShearWarp(image),
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
        const View &     view = views[v];
        const Projection done = method.project(view);
        if (expected[v].empty())
        {
          expected[v] = done.pixels;
        }
        else if (!done.pixels.empty() && done.pixels != expected[v])
        {
          itkGenericExceptionMacro("At " << view.angle << " degrees '" << method.name
                                         << "' differs from the first shear-warp.");
        }
        const ShearWarpFactorization factorization(view.transform, image, view.output);
        timings.push_back({ method.name,
                            view.angle,
                            factorization.GetPrincipalAxis(),
                            preparation,
                            done.interpolation,
                            done.clip,
                            done.warp,
                            done.total,
                            done.skippedFraction });
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
    csv << '"' << timing.method << "\"," << timing.angle << ',' << timing.principalAxis << ',' << timing.preparation
        << ',' << timing.interpolation << ',' << timing.clip << ',' << timing.warp << ',' << timing.total << ','
        << timing.skippedFraction << '\n';
  }
  if (!csv.flush())
  {
    itkGenericExceptionMacro("'" << csvFile << "' cannot be written.");
  }
}
} // namespace itk::ShearWarpBenchmark
