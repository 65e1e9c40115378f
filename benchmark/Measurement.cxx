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
#include "Measurement.h"

#include "ReadLimit.h"
#include "Subject.h"
#include "Variants.h"

#include "itkShearWarpMIPCineImageFilter.h"

#include "itksys/SystemTools.hxx"

#include <benchmark/benchmark.h>

#include <fstream>
#include <memory>
#include <numeric>
#include <stdexcept>

namespace itk::ShearWarpBenchmark
{
namespace
{
constexpr unsigned int NumberOfFrames = 36;
constexpr double       Milliseconds = 1000.0;

/** Makes this process forget its peak memory. Returns whether the system can do so: Linux, see proc(5), clear_refs. */
bool
ResetPeakMemory()
{
  std::ofstream file("/proc/self/clear_refs");
  file << "5" << std::flush;
  return file.good();
}

/** The most memory that this process has held since ResetPeakMemory(), in MB of 2^20 bytes: VmHWM of proc(5). */
double
GetPeakMemory()
{
  std::ifstream file("/proc/self/status");
  std::string   word;
  while (file >> word && word != "VmHWM:")
  {
  }
  double kilobytes = 0.0;
  file >> kilobytes;
  return kilobytes / 1024.0;
}

double
GetMean(const std::vector<double> & values)
{
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double
GetMinimum(const std::vector<double> & values)
{
  return *std::min_element(values.begin(), values.end());
}

/** The lower one of two medians. */
double
GetMedian(std::vector<double> values)
{
  const auto middle = values.begin() + (static_cast<std::ptrdiff_t>(values.size()) - 1) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/** For each view a statistic of the values. */
template <typename TStatistic>
std::vector<double>
Summarize(const ViewSeries & series, const TStatistic & statistic)
{
  std::vector<double> result;
  for (const auto & [view, values] : series)
  {
    result.push_back(statistic(values));
  }
  return result;
}

double
GetMeanOfMinima(const ViewSeries & series)
{
  return GetMean(Summarize(series, GetMinimum));
}

bool
Contains(const std::vector<unsigned int> & values, unsigned int value)
{
  return std::find(values.begin(), values.end(), value) != values.end();
}

/** Seconds that it takes to read the whole volume. */
template <typename TPixel>
double
Read(const Subject<TPixel> & subject, unsigned int threads)
{
  const auto & volume = subject.volume;
  const auto   read = MeasureReadLimit(volume->GetBufferPointer(), volume->GetOffsetTable()[3], threads);
  if (read.maximum != subject.maximum)
  {
    throw std::runtime_error("the read limit has not read the whole volume");
  }
  return read.seconds;
}

/** Seconds that the filter needs to prepare the volume for further views along all its axes, in the course of two views
 * along each. */
template <typename TFilter, typename TPixel>
double
MeasurePreparation(TFilter & filter, const Subject<TPixel> & subject, unsigned int repetitions)
{
  std::vector<double> seconds(repetitions, 0.0);
  for (double & sum : seconds)
  {
    filter.ReleasePreparedVolume();
    for (unsigned int repeat = 0; repeat < 2; ++repeat)
    {
      for (const unsigned int view : subject.comparedViews)
      {
        filter.SetTransform(MakeView(subject.volume, GetViews()[view]));
        filter.Update();
        sum += filter.GetPreparationSeconds();
      }
    }
  }
  return GetMinimum(seconds);
}

template <typename TPixel>
void
Measure(::benchmark::State & state, const Measurement & measurement, Subject<TPixel> & subject)
{
  using FilterType = ShearWarpMIPImageFilter<Image<TPixel, 3>>;
  const bool isCompared = measurement.threads == 1;
  subject.Expect();
  if (isCompared)
  {
    subject.Compare(measurement.repetitions);
  }

  const bool isPeakKnown = ResetPeakMemory();

  const auto filter = FilterType::New();
  subject.SetUp(*filter, measurement);
  // the other one's volume stays prepared
  const auto firstFilter = FilterType::New();
  subject.SetUp(*firstFilter, measurement);
  std::vector<Variant<FilterType>> variants;
  if (measurement.hasVariants)
  {
    variants = MakeVariants(subject);
  }
  if (measurement.instructionSet != "portable" && measurement.reducedResampling == Measurement::ReducedResampling::Auto)
  {
    variants.push_back(
      { "oversampling_ratio", [](auto & changed, bool isOn) { changed.SetOversampling(isOn ? 2 : 1); } });
  }
  const double preparation = MeasurePreparation(*filter, subject, measurement.repetitions);
  if (filter->GetInstructionSet() != measurement.instructionSet)
  {
    throw std::runtime_error("the filter used the instruction set " + filter->GetInstructionSet());
  }

  ViewSeries   seconds;
  ViewSeries   projectionSeconds;
  ViewSeries   warpSeconds;
  ViewSeries   readSeconds;
  ViewSeries   compared;
  double       skipped = 0.0;
  unsigned int iteration = 0;
  for (auto _ : state)
  {
    const auto   view = static_cast<unsigned int>(iteration++ % GetViews().size());
    const auto   transform = MakeView(subject.volume, GetViews()[view]);
    const double duration = Time([&] {
      filter->SetTransform(transform);
      filter->Update();
    });
    state.SetIterationTime(duration);
    if (!subject.IsExpected(view, filter->GetOutput()))
    {
      throw std::runtime_error("the output of view " + std::to_string(view) +
                               " differs from that of the plain shear-warp");
    }
    readSeconds[view].push_back(Read(subject, measurement.threads));
    seconds[view].push_back(duration);
    projectionSeconds[view].push_back(filter->GetProjectionSeconds());
    warpSeconds[view].push_back(filter->GetWarpSeconds());
    skipped += filter->GetSkippedFraction();
    if (Contains(subject.comparedViews, view))
    {
      compared[view].push_back(duration);
    }
    for (Variant<FilterType> & variant : variants)
    {
      if (Contains(variant.principalAxes, filter->GetPrincipalAxis()))
      {
        FilterType & changed = variant.isFirstView ? *firstFilter : *filter;
        changed.SetTransform(transform);
        variant.set(changed, true);
        changed.Modified();
        const double whole = Time([&] { changed.Update(); });
        // a mask is prepared once
        variant.seconds[view].push_back(whole - (variant.isFirstView ? 0.0 : changed.GetPreparationSeconds()));
        variant.unchangedSeconds[view].push_back(duration);
        variant.set(changed, false);
      }
    }
  }

  const double readLimit = GetMeanOfMinima(readSeconds);
  const auto   minima = Summarize(seconds, GetMinimum);
  auto &       counters = state.counters;
  counters["read_limit_ratio"] = GetMean(minima) / readLimit;
  counters["worst_view_ratio"] = *std::max_element(minima.begin(), minima.end()) / readLimit;
  counters["read_limit_ms"] = Milliseconds * readLimit;
  counters["min_ms"] = Milliseconds * GetMean(minima);
  counters["median_ms"] = Milliseconds * GetMean(Summarize(seconds, GetMedian));
  counters["projection_ms"] = Milliseconds * GetMeanOfMinima(projectionSeconds);
  counters["warp_ms"] = Milliseconds * GetMeanOfMinima(warpSeconds);
  counters["preparation_ms"] = Milliseconds * preparation;
  counters["skipped_fraction"] = skipped / iteration;
  if (isCompared)
  {
    counters["raycast_ratio"] = subject.rayCastingSeconds / GetMeanOfMinima(compared);
    counters["plain_ratio"] = subject.plainSeconds / GetMeanOfMinima(compared);
  }
  for (const Variant<FilterType> & variant : variants)
  {
    counters[variant.counter] = GetMeanOfMinima(variant.seconds) / GetMeanOfMinima(variant.unchangedSeconds);
  }
  if (isPeakKnown)
  {
    counters["peak_mb"] = GetPeakMemory();
  }
}

template <typename TPixel>
void
MeasureCine(::benchmark::State &      state,
            const Measurement &       measurement,
            const Subject<TPixel> &   subject,
            const Vector<double, 3> & axis)
{
  const auto          cine = ShearWarpMIPCineImageFilter<Image<TPixel, 3>>::New();
  const auto          single = ShearWarpMIPImageFilter<Image<TPixel, 3>>::New();
  const SizeValueType pixels = subject.output->GetBufferedRegion().GetNumberOfPixels();
  subject.SetUp(*cine, measurement);
  subject.SetUp(*single, measurement);
  cine->SetNumberOfFrames(NumberOfFrames);
  cine->SetRotationAxis(axis);
  cine->Update();
  const Point<double, 3> origin = cine->GetOutput()->GetOrigin();
  const double           viewOrigin[] = { origin[0], origin[1] };
  single->SetOutputOrigin(viewOrigin);
  const auto project = [&](unsigned int frame) {
    const auto view = cine->GetFrameTransform(frame);
    return Time([&] {
      single->SetTransform(view);
      single->Update();
    });
  };
  // prepares the volume
  for (unsigned int frame = 0; frame < NumberOfFrames; ++frame)
  {
    project(frame);
  }

  std::vector<double> cineTimes;
  std::vector<double> singleTimes;
  std::vector<double> readTimes;
  for (auto _ : state)
  {
    cine->Modified();
    cineTimes.push_back(Time([&] { cine->Update(); }));
    state.SetIterationTime(cineTimes.back());

    singleTimes.push_back(0.0);
    for (unsigned int frame = 0; frame < NumberOfFrames; ++frame)
    {
      singleTimes.back() += project(frame);
      if (std::memcmp(cine->GetOutput()->GetBufferPointer() + frame * pixels,
                      single->GetOutput()->GetBufferPointer(),
                      pixels * sizeof(TPixel)) != 0)
      {
        throw std::runtime_error("frame " + std::to_string(frame) + " differs from the single filter's picture");
      }
    }
    readTimes.push_back(Read(subject, measurement.threads));
  }

  const double frame = GetMinimum(cineTimes) / NumberOfFrames;
  auto &       counters = state.counters;
  counters["read_limit_ratio"] = frame / GetMinimum(readTimes);
  counters["read_limit_ms"] = Milliseconds * GetMinimum(readTimes);
  counters["frame_ms"] = Milliseconds * frame;
  counters["single_ratio"] = GetMinimum(singleTimes) / GetMinimum(cineTimes);
  counters["projection_ms"] = Milliseconds * cine->GetProjectionSeconds() / NumberOfFrames;
  counters["warp_ms"] = Milliseconds * cine->GetWarpSeconds() / NumberOfFrames;
  counters["skipped_fraction"] = cine->GetSkippedFraction();
}

/** For example mip/mra/512x512x512/uint16/. */
std::string
GetName(const DataSet & data)
{
  const auto & size = data.size;
  return "mip/" + data.kind + '/' + std::to_string(size[0]) + 'x' + std::to_string(size[1]) + 'x' +
         std::to_string(size[2]) + '/' + data.pixelType + '/';
}

/** For example mip/mra/512x512x512/uint16/avx2/threads:2/auto. */
std::string
GetName(const Measurement & measurement)
{
  using ReducedResampling = Measurement::ReducedResampling;
  const auto mode = measurement.reducedResampling;
  return GetName(measurement.data) + measurement.instructionSet + "/threads:" + std::to_string(measurement.threads) +
         (mode == ReducedResampling::Off  ? "/off"
          : mode == ReducedResampling::On ? "/on"
                                          : "/auto");
}

// only the last subject is kept, because several may not fit in memory
std::string           keptName;
std::shared_ptr<void> keptSubject;

template <typename TPixel>
Subject<TPixel> &
GetSubject(const DataSet & data)
{
  const std::string name = GetName(data) + data.file;
  if (name != keptName)
  {
    keptName.clear();
    keptSubject.reset();
    keptSubject = std::make_shared<Subject<TPixel>>(data);
    keptName = name;
  }
  return *static_cast<Subject<TPixel> *>(keptSubject.get());
}

bool hasFailed = false;

/** Registers \a measure(state, subject); what it throws is an error of the benchmark. */
template <typename TFunction>
void
RegisterChecked(const std::string & prefix,
                const Measurement & measurement,
                std::size_t         iterations,
                const TFunction &   measure)
{
  const auto check = [measurement, measure](::benchmark::State & state) {
    itksys::SystemTools::PutEnv("SHEARWARPMIP_INSTRUCTION_SET=" + measurement.instructionSet);
    try
    {
      Dispatch(measurement.data.pixelType,
               [&](auto pixel) { measure(state, GetSubject<decltype(pixel)>(measurement.data)); });
    }
    catch (const std::exception & error)
    {
      state.SkipWithError(Describe(error).c_str());
      hasFailed = true;
    }
  };
  ::benchmark::RegisterBenchmark((prefix + GetName(measurement)).c_str(), check)
    ->UseManualTime()
    ->Iterations(static_cast<std::int64_t>(iterations))
    ->Unit(::benchmark::kMillisecond);
}
} // namespace

bool
HasAnyFailed()
{
  return hasFailed;
}

void
Register(const Measurement & measurement)
{
  RegisterChecked("",
                  measurement,
                  measurement.repetitions * GetViews().size(),
                  [measurement](auto & state, auto & subject) { Measure(state, measurement, subject); });
}

void
RegisterCine(const Measurement & measurement)
{
  const std::map<std::string, std::array<double, 3>> axes{
    { "x", { 1, 0, 0 } }, { "y", { 0, 1, 0 } }, { "z", { 0, 0, 1 } }, { "oblique", { 0.3, 0.8, 0.5 } }
  };
  for (const auto & [name, direction] : axes)
  {
    const Vector<double, 3> axis(direction.data());
    RegisterChecked(
      "cine/" + name + '/', measurement, measurement.repetitions, [measurement, axis](auto & state, auto & subject) {
        MeasureCine(state, measurement, subject, axis);
      });
  }
}
} // namespace itk::ShearWarpBenchmark
