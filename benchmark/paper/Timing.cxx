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

#include "PermutedVolume.h"
#include "PlainShearWarp.h"
#include "RayCasting.h"
#include "Statistics.h"
#include "TaggedShearWarp.h"
#include "Views.h"
#include "Volumes.h"

#include "itkShearWarpMIPImageFilter.h"

#include <chrono>
#include <fstream>
#include <memory>
#include <optional>

namespace itk::ShearWarpBenchmark
{
namespace
{
using PixelType = std::uint16_t;
using VolumeType = Image<PixelType, 3>;
using OutputType = Image<PixelType, 2>;
using PixelsType = std::vector<PixelType>;

class Stopwatch
{
public:
  /** Milliseconds since the last call. */
  double
  Lap()
  {
    const auto                                      now = std::chrono::steady_clock::now();
    const std::chrono::duration<double, std::milli> duration = now - m_Start;
    m_Start = now;
    return duration.count();
  }

private:
  std::chrono::steady_clock::time_point m_Start{ std::chrono::steady_clock::now() };
};

struct View
{
  unsigned int               angle;
  ViewTransformType::Pointer transform;
  OutputType::Pointer        output;
  double                     step;
};

/** As in Timing. */
struct Times
{
  double interpolation, clip, warp, total;
  double skippedFraction;
};

class Method
{
public:
  Method(std::string name, const VolumeType * volume)
    : m_Name(std::move(name))
    , m_Volume(volume)
  {}
  virtual ~Method() = default;

  const std::string &
  GetName() const
  {
    return m_Name;
  }

  /** Prepares the volume for the views; returns milliseconds. */
  virtual double
  Prepare(const std::vector<View> & views) = 0;

  /** Shear-warps write the picture to \a pixels. */
  virtual Times
  Project(const View & view, PixelsType & pixels) = 0;

protected:
  const VolumeType *
  GetVolume() const
  {
    return m_Volume;
  }

private:
  std::string        m_Name;
  const VolumeType * m_Volume;
};

class RayCastingMethod : public Method
{
public:
  explicit RayCastingMethod(const VolumeType * volume)
    : Method("ray casting", volume)
  {}

  double
  Prepare(const std::vector<View> &) override
  {
    return 0.0;
  }

  Times
  Project(const View & view, PixelsType &) override
  {
    Stopwatch watch;
    CountSamples(this->GetVolume(), view.transform, view.step, view.output);
    const double clip = watch.Lap();
    CastRays<PixelType>(this->GetVolume(), view.transform, view.step, PixelType{}, view.output);
    const double total = watch.Lap();
    return { total - clip, clip, 0.0, total, 0.0 };
  }
};

/** A published shear-warp: factorization, projection, warp. */
class ShearWarpMethod : public Method
{
public:
  using Method::Method;

  Times
  Project(const View & view, PixelsType & pixels) override
  {
    const auto size = view.output->GetBufferedRegion().GetSize();
    pixels.resize(size[0] * size[1]);

    Stopwatch                    watch;
    const ShearWarpFactorization factorization(view.transform, this->GetVolume(), view.output);
    const double                 factorizing = watch.Lap();
    double                       skippedFraction = 0.0;
    const PixelsType             intermediate = this->ProjectSlices(factorization, skippedFraction);
    const double                 interpolation = watch.Lap();
    PlainShearWarp<PixelType>::WarpRows(factorization,
                                        intermediate,
                                        0,
                                        static_cast<std::ptrdiff_t>(size[1]),
                                        static_cast<std::ptrdiff_t>(size[0]),
                                        PixelType{},
                                        pixels);
    const double warp = watch.Lap();
    return { interpolation, 0.0, warp, factorizing + interpolation + warp, skippedFraction };
  }

private:
  virtual PixelsType
  ProjectSlices(const ShearWarpFactorization & factorization, double & skippedFraction) const = 0;
};

class PlainMethod : public ShearWarpMethod
{
public:
  explicit PlainMethod(const VolumeType * volume)
    : ShearWarpMethod("shear warp", volume)
  {}

  double
  Prepare(const std::vector<View> &) override
  {
    m_Volumes.clear();
    Stopwatch watch;
    for (unsigned int principalAxis = 0; principalAxis < 3; ++principalAxis)
    {
      m_Volumes.emplace_back(this->GetVolume(), principalAxis);
    }
    return watch.Lap();
  }

private:
  PixelsType
  ProjectSlices(const ShearWarpFactorization & factorization, double &) const override
  {
    return ShearWarpBenchmark::Project(m_Volumes[factorization.GetPrincipalAxis()], factorization);
  }

  std::vector<PermutedVolume> m_Volumes;
};

class TaggedMethod : public ShearWarpMethod
{
public:
  explicit TaggedMethod(const VolumeType * volume)
    : ShearWarpMethod("shear warp, tagged", volume)
  {}

  double
  Prepare(const std::vector<View> &) override
  {
    m_ShearWarp.reset();
    Stopwatch watch;
    m_ShearWarp.emplace(this->GetVolume());
    return watch.Lap();
  }

private:
  PixelsType
  ProjectSlices(const ShearWarpFactorization & factorization, double & skippedFraction) const override
  {
    auto projection = m_ShearWarp->Project(factorization);
    skippedFraction = static_cast<double>(projection.skippedCells) / static_cast<double>(projection.cells);
    return std::move(projection.intermediate);
  }

  std::optional<TaggedShearWarp> m_ShearWarp;
};

class FilterMethod : public Method
{
public:
  using FilterType = ShearWarpMIPImageFilter<VolumeType>;

  FilterMethod(const std::string & name, const VolumeType * volume, FilterType::ReducedResamplingEnum reducedResampling)
    : Method(name, volume)
    , m_ReducedResampling(reducedResampling)
  {}

  double
  Prepare(const std::vector<View> & views) override
  {
    m_Filter = FilterType::New();
    m_Filter->SetInput(this->GetVolume());
    m_Filter->SetReducedResampling(m_ReducedResampling);
    m_Filter->SetNumberOfWorkUnits(1);
    double seconds = 0.0;
    for (const View & view : views)
    {
      m_Filter->SetTransform(view.transform);
      m_Filter->Update();
      seconds += m_Filter->GetPreparationSeconds();
    }
    return 1000.0 * seconds;
  }

  Times
  Project(const View & view, PixelsType & pixels) override
  {
    Stopwatch watch;
    m_Filter->SetTransform(view.transform);
    m_Filter->Update();
    const double total = watch.Lap();

    const OutputType * output = m_Filter->GetOutput();
    const PixelType *  begin = output->GetBufferPointer();
    pixels.assign(begin, begin + output->GetBufferedRegion().GetNumberOfPixels());
    return { 1000.0 * m_Filter->GetProjectionSeconds(),
             0.0,
             1000.0 * m_Filter->GetWarpSeconds(),
             total,
             m_Filter->GetSkippedFraction() };
  }

private:
  FilterType::ReducedResamplingEnum m_ReducedResampling;
  FilterType::Pointer               m_Filter;
};

std::vector<View>
MakeViews(const VolumeType * volume)
{
  std::vector<View> views;
  for (unsigned int angle = 0; angle <= 180; angle += 10)
  {
    const auto transform = MakeView(volume, Angles{ 0.0, static_cast<double>(angle), 0.0 });
    views.push_back({ angle, transform, MakeFittedOutput(volume, transform), GetVoxelStep(volume, transform) });
  }
  return views;
}

std::vector<std::unique_ptr<Method>>
MakeMethods(const VolumeType * volume)
{
  using ReducedResampling = FilterMethod::FilterType::ReducedResamplingEnum;
  std::vector<std::unique_ptr<Method>> methods;
  methods.push_back(std::make_unique<RayCastingMethod>(volume));
  methods.push_back(std::make_unique<PlainMethod>(volume));
  methods.push_back(std::make_unique<TaggedMethod>(volume));
  methods.push_back(std::make_unique<FilterMethod>("filter, off", volume, ReducedResampling::Off));
  methods.push_back(std::make_unique<FilterMethod>("filter, auto", volume, ReducedResampling::Auto));
  return methods;
}

/** What the repetitions of one method measured. */
struct Series
{
  std::vector<double>             preparation;
  std::vector<std::vector<Times>> timesOfViews;
};

double
GetMedianOf(double Times::* time, const std::vector<Times> & measured)
{
  std::vector<double> values;
  for (const Times & times : measured)
  {
    values.push_back(times.*time);
  }
  return GetMedian(values);
}
} // namespace

std::vector<Timing>
TimeMethods(const VolumeType * image, unsigned int repetitions)
{
  const auto          views = MakeViews(image);
  const auto          methods = MakeMethods(image);
  std::vector<Series> measured(methods.size(), { {}, std::vector<std::vector<Times>>(views.size()) });

  std::vector<PixelsType> expected(views.size());
  for (unsigned int repetition = 0; repetition < repetitions; ++repetition)
  {
    for (std::size_t m = 0; m < methods.size(); ++m)
    {
      measured[m].preparation.push_back(methods[m]->Prepare(views));
      for (std::size_t v = 0; v < views.size(); ++v)
      {
        PixelsType pixels;
        measured[m].timesOfViews[v].push_back(methods[m]->Project(views[v], pixels));
        if (expected[v].empty())
        {
          expected[v] = pixels;
        }
        else if (!pixels.empty() && pixels != expected[v])
        {
          itkGenericExceptionMacro("At " << views[v].angle << " degrees '" << methods[m]->GetName()
                                         << "' differs from the first shear-warp.");
        }
      }
    }
  }

  std::vector<Timing> timings;
  for (std::size_t m = 0; m < methods.size(); ++m)
  {
    const double preparation = GetMedian(measured[m].preparation);
    for (std::size_t v = 0; v < views.size(); ++v)
    {
      const View &                 view = views[v];
      const auto &                 times = measured[m].timesOfViews[v];
      const ShearWarpFactorization factorization(view.transform, image, view.output);
      timings.push_back({ methods[m]->GetName(),
                          view.angle,
                          factorization.GetPrincipalAxis(),
                          preparation,
                          GetMedianOf(&Times::interpolation, times),
                          GetMedianOf(&Times::clip, times),
                          GetMedianOf(&Times::warp, times),
                          GetMedianOf(&Times::total, times),
                          times.front().skippedFraction,
                          view.output->GetBufferedRegion().GetNumberOfPixels() });
    }
  }
  return timings;
}

void
WriteTimings(const std::vector<Timing> & timings, const std::string & csvFile)
{
  std::ofstream csv(csvFile);
  csv
    << "method,angle,principal_axis,preparation_ms,interpolation_ms,clip_ms,warp_ms,total_ms,skipped_fraction,pixels\n";
  for (const Timing & timing : timings)
  {
    csv << '"' << timing.method << "\"," << timing.angle << ',' << timing.principalAxis << ',' << timing.preparation
        << ',' << timing.interpolation << ',' << timing.clip << ',' << timing.warp << ',' << timing.total << ','
        << timing.skippedFraction << ',' << timing.pixels << '\n';
  }
  if (!csv.flush())
  {
    itkGenericExceptionMacro("'" << csvFile << "' cannot be written.");
  }
}
} // namespace itk::ShearWarpBenchmark
