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

#include <algorithm>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <sstream>

namespace itk::ShearWarpBenchmark
{
namespace
{
constexpr unsigned int NumberOfFrames = 36;
constexpr double       Milliseconds = 1000.0;

bool hasAnyFailed = false;

void
ForceInstructionSet(const std::string & name)
{
  itksys::SystemTools::PutEnv("SHEARWARPMIP_INSTRUCTION_SET=" + name);
}

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
  double        kilobytes = 0.0;
  for (std::string name; file >> name && name != "VmHWM:";)
  {
    file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
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

/** One quantity, measured several times for each view. */
class ViewSeries
{
public:
  void
  Add(unsigned int view, double value)
  {
    m_Values[view].push_back(value);
  }

  /** For each view that \a other has \a statistic of the values. */
  template <typename TStatistic>
  std::vector<double>
  Summarize(const ViewSeries & other, const TStatistic & statistic) const
  {
    std::vector<double> result;
    for (const auto & view : other.m_Values)
    {
      result.push_back(statistic(m_Values.at(view.first)));
    }
    return result;
  }

  /** Of all views. */
  double
  GetMeanOfMinima() const
  {
    return GetMean(this->Summarize(*this, GetMinimum));
  }

private:
  std::map<unsigned int, std::vector<double>> m_Values;
};

/** The subject of \a data. Only the last one is kept, because several may not fit in memory. */
template <typename TPixel>
Subject<TPixel> &
GetSubject(const DataSet & data)
{
  static std::optional<DataSet> keptData;
  static std::shared_ptr<void>  kept;
  if (!keptData || !(*keptData == data))
  {
    kept.reset();
    kept = std::make_shared<Subject<TPixel>>(data);
    keptData = data;
  }
  return *static_cast<Subject<TPixel> *>(kept.get());
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
        filter.SetTransform(MakeView(subject.volume, view));
        filter.Update();
        sum += filter.GetPreparationSeconds();
      }
    }
  }
  return GetMinimum(seconds);
}

template <typename TPixel>
std::string
Measure(::benchmark::State & state, const Measurement & measurement)
{
  using FilterType = ShearWarpMIPImageFilter<Image<TPixel, 3>>;
  Subject<TPixel> & subject = GetSubject<TPixel>(measurement.data);
  const auto        volume = subject.volume;
  const bool        isCompared = measurement.threads == 1;
  const bool        isOversampled =
    measurement.instructionSet != "portable" && measurement.reducedResampling == Measurement::ReducedResampling::Auto;
  subject.Expect();
  if (isCompared)
  {
    subject.Compare(measurement.repetitions);
  }

  ForceInstructionSet(measurement.instructionSet);
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
  if (isOversampled)
  {
    variants.push_back({ "oversampling_ratio",
                         [](auto & changed) { changed.SetOversampling(2); },
                         [](auto & changed) { changed.SetOversampling(1); } });
  }
  std::vector<ViewSeries> variantSeconds(variants.size());
  const double            preparation = MeasurePreparation(*filter, subject, measurement.repetitions);
  if (filter->GetInstructionSet() != measurement.instructionSet)
  {
    return "the filter used the instruction set " + filter->GetInstructionSet();
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
    const unsigned int view = iteration++ % GetNumberOfViews();
    const auto         transform = MakeView(volume, view);
    const double       duration = Time([&] {
      filter->SetTransform(transform);
      filter->Update();
    });
    state.SetIterationTime(duration);
    if (!subject.IsExpected(view, filter->GetOutput()))
    {
      return "the output of view " + std::to_string(view) + " differs from that of the plain shear-warp";
    }
    const auto read = MeasureReadLimit(volume->GetBufferPointer(), volume->GetOffsetTable()[3], measurement.threads);
    if (read.maximum != subject.maximum)
    {
      return "the read limit has not read the whole volume";
    }
    seconds.Add(view, duration);
    projectionSeconds.Add(view, filter->GetProjectionSeconds());
    warpSeconds.Add(view, filter->GetWarpSeconds());
    readSeconds.Add(view, read.seconds);
    skipped += filter->GetSkippedFraction();
    if (std::count(subject.comparedViews.begin(), subject.comparedViews.end(), view) > 0)
    {
      compared.Add(view, duration);
    }
    for (std::size_t n = 0; n < variants.size(); ++n)
    {
      const Variant<FilterType> & variant = variants[n];
      if (std::count(variant.principalAxes.begin(), variant.principalAxes.end(), filter->GetPrincipalAxis()) > 0)
      {
        FilterType & changed = variant.isFirstView ? *firstFilter : *filter;
        changed.SetTransform(transform);
        variant.set(changed);
        changed.Modified();
        const double whole = Time([&] { changed.Update(); });
        // a mask is prepared once
        variantSeconds[n].Add(view, whole - (variant.isFirstView ? 0.0 : changed.GetPreparationSeconds()));
        variant.reset(changed);
      }
    }
  }

  const double readLimit = readSeconds.GetMeanOfMinima();
  const auto   minima = seconds.Summarize(seconds, GetMinimum);
  auto &       counters = state.counters;
  counters["read_limit_ratio"] = GetMean(minima) / readLimit;
  counters["worst_view_ratio"] = *std::max_element(minima.begin(), minima.end()) / readLimit;
  counters["read_limit_ms"] = Milliseconds * readLimit;
  counters["min_ms"] = Milliseconds * GetMean(minima);
  counters["median_ms"] = Milliseconds * GetMean(seconds.Summarize(seconds, GetMedian));
  counters["projection_ms"] = Milliseconds * projectionSeconds.GetMeanOfMinima();
  counters["warp_ms"] = Milliseconds * warpSeconds.GetMeanOfMinima();
  counters["preparation_ms"] = Milliseconds * preparation;
  counters["skipped_fraction"] = skipped / iteration;
  if (isCompared)
  {
    const auto & comparison = subject.Compare(measurement.repetitions);
    counters["raycast_ratio"] = comparison.rayCasting / compared.GetMeanOfMinima();
    counters["plain_ratio"] = comparison.plainShearWarp / compared.GetMeanOfMinima();
  }
  for (std::size_t n = 0; n < variants.size(); ++n)
  {
    counters[variants[n].counter] =
      variantSeconds[n].GetMeanOfMinima() / GetMean(seconds.Summarize(variantSeconds[n], GetMinimum));
  }
  if (isPeakKnown)
  {
    counters["peak_mb"] = GetPeakMemory();
  }
  return {};
}

template <typename TPixel>
std::string
MeasureCine(::benchmark::State & state, const Measurement & measurement, const Vector<double, 3> & axis)
{
  using VolumeType = Image<TPixel, 3>;
  ForceInstructionSet(measurement.instructionSet);
  const Subject<TPixel> & subject = GetSubject<TPixel>(measurement.data);
  const auto              cine = ShearWarpMIPCineImageFilter<VolumeType>::New();
  const auto              single = ShearWarpMIPImageFilter<VolumeType>::New();
  const SizeValueType     pixels = subject.output->GetBufferedRegion().GetNumberOfPixels();
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
        return "frame " + std::to_string(frame) + " differs from the single filter's picture";
      }
    }
    readTimes.push_back(
      MeasureReadLimit(subject.volume->GetBufferPointer(), subject.volume->GetOffsetTable()[3], measurement.threads)
        .seconds);
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
  return {};
}

/** For example mip/mra/512x512x512/uint16/avx2/threads:2/auto. */
std::string
GetName(const Measurement & measurement)
{
  using ReducedResampling = Measurement::ReducedResampling;
  const DataSet &    data = measurement.data;
  const auto         mode = measurement.reducedResampling;
  std::ostringstream name;
  name << "mip/" << data.kind << '/' << data.size[0] << 'x' << data.size[1] << 'x' << data.size[2] << '/'
       << PixelTypeNames[static_cast<int>(data.pixelType)] << '/' << measurement.instructionSet
       << "/threads:" << measurement.threads << '/'
       << (mode == ReducedResampling::Off  ? "off"
           : mode == ReducedResampling::On ? "on"
                                           : "auto");
  return name.str();
}

/** Text that \a measure(state) returns, and what it throws, is an error of the benchmark. */
template <typename TFunction>
void
RegisterChecked(const std::string & name, unsigned int iterations, const TFunction & measure)
{
  const auto check = [measure](::benchmark::State & state) {
    std::string error;
    try
    {
      error = measure(state);
    }
    catch (const ExceptionObject & exception)
    {
      error = exception.GetDescription();
    }
    catch (const std::exception & exception)
    {
      error = exception.what();
    }
    if (!error.empty())
    {
      hasAnyFailed = true;
      state.SkipWithError(error.c_str());
    }
  };
  ::benchmark::RegisterBenchmark(name.c_str(), check)
    ->UseManualTime()
    ->Iterations(iterations)
    ->Unit(::benchmark::kMillisecond);
}
} // namespace

void
Register(const Measurement & measurement)
{
  RegisterChecked(
    GetName(measurement), measurement.repetitions * GetNumberOfViews(), [measurement](::benchmark::State & state) {
      return Dispatch(measurement.data.pixelType,
                      [&](auto pixel) { return Measure<decltype(pixel)>(state, measurement); });
    });
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
    RegisterChecked("cine/" + name + '/' + GetName(measurement),
                    measurement.repetitions,
                    [measurement, axis](::benchmark::State & state) {
                      return Dispatch(measurement.data.pixelType, [&](auto pixel) {
                        return MeasureCine<decltype(pixel)>(state, measurement, axis);
                      });
                    });
  }
}

bool
HasAnyFailed()
{
  return hasAnyFailed;
}
} // namespace itk::ShearWarpBenchmark
