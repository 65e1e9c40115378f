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

#include "Check.h"
#include "Process.h"
#include "ReadLimit.h"
#include "Statistics.h"
#include "Subject.h"

#include "itkImageRegionIteratorWithIndex.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <limits>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <sstream>

namespace itk::ShearWarpBenchmark
{
namespace
{
struct KeptSubject
{
  std::optional<DataSet> data;
  std::shared_ptr<void>  subject;
};

bool        hasAnyFailed = false;
KeptSubject keptSubject;

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

/** One quantity, measured several times for each view. */
class ViewSeries
{
public:
  ViewSeries()
    : m_Values(GetNumberOfViews())
  {}

  void
  Add(unsigned int view, double value)
  {
    m_Values.at(view).push_back(value);
  }

  /** For each view with values \a statistic of them. */
  template <typename TStatistic>
  std::vector<double>
  Summarize(const TStatistic & statistic) const
  {
    std::vector<double> result;
    for (const unsigned int view : this->GetViews())
    {
      result.push_back(statistic(m_Values[view]));
    }
    return result;
  }

  /** Those with values. */
  std::vector<unsigned int>
  GetViews() const
  {
    std::vector<unsigned int> views;
    for (unsigned int view = 0; view < m_Values.size(); ++view)
    {
      if (!m_Values[view].empty())
      {
        views.push_back(view);
      }
    }
    return views;
  }

  double
  GetMeanOfMinima() const
  {
    return GetMean(this->Summarize(GetMinimum));
  }

  double
  GetMeanOfMinima(const std::vector<unsigned int> & views) const
  {
    std::vector<double> minima;
    for (const unsigned int view : views)
    {
      minima.push_back(GetMinimum(m_Values.at(view)));
    }
    return GetMean(minima);
  }

private:
  std::vector<std::vector<double>> m_Values;
};

/** The subject of \a data. Only the last one is kept, because several may not fit in memory. */
template <typename TPixel>
Subject<TPixel> &
GetSubject(KeptSubject & kept, const DataSet & data)
{
  if (!kept.data || !(*kept.data == data))
  {
    kept = {};
    kept.subject = std::make_shared<Subject<TPixel>>(data);
    kept.data = data;
  }
  return *static_cast<Subject<TPixel> *>(kept.subject.get());
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
      for (const unsigned int view : subject.GetComparedViews())
      {
        filter.SetTransform(MakeView(subject.GetVolume(), view));
        filter.Update();
        sum += filter.GetPreparationSeconds();
      }
    }
  }
  return GetMinimum(seconds);
}

/** A parameter that is set for one update and then set back; its time is told as a ratio to that without, of the views
 * along the same axes. */
template <typename TFilter>
struct Variant
{
  std::string                    counter;
  std::function<void(TFilter &)> set;
  std::function<void(TFilter &)> reset;
  bool                           isFirstView{ false };
  std::vector<unsigned int>      principalAxes{ 0, 1, 2 };
};

/** A ball in the middle, of a diameter of \a fraction of the volume's extent. */
Image<unsigned char, 3>::Pointer
MakeBall(const ImageBase<3> * volume, double fraction)
{
  const auto mask = Image<unsigned char, 3>::New();
  mask->CopyInformation(volume);
  mask->SetRegions(volume->GetLargestPossibleRegion());
  mask->Allocate();
  const Size<3> size = volume->GetLargestPossibleRegion().GetSize();
  for (ImageRegionIteratorWithIndex<Image<unsigned char, 3>> it(mask, mask->GetBufferedRegion()); !it.IsAtEnd(); ++it)
  {
    double squaredRadius = 0.0;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const double position = 2.0 * static_cast<double>(it.GetIndex()[axis]) / static_cast<double>(size[axis]) - 1.0;
      squaredRadius += position * position;
    }
    it.Set(squaredRadius <= fraction * fraction ? 1 : 0);
  }
  return mask;
}

/** Slab and box have a tenth and an eighth of the volume. */
template <typename TPixel>
std::vector<Variant<ShearWarpMIPImageFilter<Image<TPixel, 3>>>>
MakeVariants(const Subject<TPixel> & subject)
{
  using FilterType = ShearWarpMIPImageFilter<Image<TPixel, 3>>;
  using Mode = ShearWarpMIPImageFilterEnums::Mode;
  const auto *     volume = subject.GetVolume();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const auto       setMode = [](Mode mode) { return [mode](FilterType & filter) { filter.SetMode(mode); }; };
  const auto       setSlab = [](double near, double far) {
    return [=](FilterType & filter) {
      filter.SetSlabNear(near);
      filter.SetSlabFar(far);
    };
  };
  const auto setBox = [](const Point<double, 3> & lower, const Point<double, 3> & upper) {
    return [=](FilterType & filter) {
      filter.SetCropLower(lower);
      filter.SetCropUpper(upper);
    };
  };
  const Size<3> size = volume->GetLargestPossibleRegion().GetSize();
  const double  depth =
    GetOutputSpacing(subject.GetVolume()) * static_cast<double>(GetOutputSize(subject.GetVolume())[0]);
  Point<double, 3>           lower;
  Point<double, 3>           upper;
  ContinuousIndex<double, 3> quarter;
  ContinuousIndex<double, 3> threeQuarters;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    quarter[axis] = 0.25 * static_cast<double>(size[axis]);
    threeQuarters[axis] = 0.75 * static_cast<double>(size[axis]);
  }
  volume->TransformContinuousIndexToPhysicalPoint(quarter, lower);
  volume->TransformContinuousIndexToPhysicalPoint(threeQuarters, upper);
  const auto threshold = static_cast<TPixel>(subject.GetMaximum() / 2);
  const auto setMask = [volume](double fraction) {
    return [mask = MakeBall(volume, fraction)](FilterType & filter) { filter.SetMaskImage(mask); };
  };
  const auto removeMask = [](FilterType & filter) { filter.SetMaskImage(nullptr); };
  const auto release = [](FilterType & filter) { filter.ReleasePreparedVolume(); };
  const auto keep = [](FilterType &) {};
  return {
    { "first_ratio", release, keep, true, { 1, 2 } },
    { "first_x_ratio", release, keep, true, { 0 } },
    { "minimum_ratio", setMode(Mode::Minimum), setMode(Mode::Maximum) },
    { "absolute_ratio", setMode(Mode::AbsoluteMaximum), setMode(Mode::Maximum) },
    { "depth_ratio",
      [](FilterType & filter) { filter.ComputeDepthOn(); },
      [](FilterType & filter) { filter.ComputeDepthOff(); } },
    { "slab_ratio", setSlab(-0.05 * depth, 0.05 * depth), setSlab(-infinity, infinity) },
    { "box_ratio", setBox(lower, upper), setBox(Point<double, 3>(-infinity), Point<double, 3>(infinity)) },
    { "mask_ratio", setMask(0.7), removeMask },
    { "small_mask_ratio", setMask(0.57), removeMask },
    { "local_ratio",
      [threshold](FilterType & filter) {
        filter.LocalMaximumOn();
        filter.SetLocalMaximumThreshold(threshold);
      },
      [](FilterType & filter) { filter.LocalMaximumOff(); } },
    { "fading_ratio",
      [depth](FilterType & filter) { filter.SetDepthAttenuation(1.0 / depth); },
      [](FilterType & filter) { filter.SetDepthAttenuation(0.0); } },
    { "exact_ratio", [](FilterType & filter) { filter.ExactOn(); }, [](FilterType & filter) { filter.ExactOff(); } },
  };
}

template <typename TPixel>
std::string
Measure(::benchmark::State & state, const Measurement & measurement)
{
  std::optional<ForcedInstructionSet> forced("portable");
  Subject<TPixel> &                   subject = GetSubject<TPixel>(keptSubject, measurement.data);
  const auto *                        volume = subject.GetVolume();
  const bool                          isCompared = measurement.threads == 1;
  const bool                          isOversampled =
    measurement.instructionSet != "portable" && measurement.reducedResampling == Measurement::ReducedResampling::Auto;
  if (isCompared)
  {
    static const std::string difference = CheckRayCasting<TPixel>();
    if (!difference.empty())
    {
      return difference;
    }
    subject.Compare(measurement.repetitions);
  }

  forced.reset();
  forced.emplace(measurement.instructionSet);
  const bool isPeakKnown = ResetPeakMemory();

  const auto filter = ShearWarpMIPImageFilter<Image<TPixel, 3>>::New();
  SetUp(*filter, volume, measurement);
  // the other one's volume stays prepared
  const auto firstFilter = ShearWarpMIPImageFilter<Image<TPixel, 3>>::New();
  SetUp(*firstFilter, volume, measurement);
  std::vector<Variant<ShearWarpMIPImageFilter<Image<TPixel, 3>>>> variants;
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

  ReadLimit    readLimit(measurement.threads);
  ViewSeries   seconds;
  ViewSeries   projectionSeconds;
  ViewSeries   warpSeconds;
  ViewSeries   readSeconds;
  double       skipped = 0.0;
  unsigned int iteration = 0;
  for (auto _ : state)
  {
    state.PauseTiming();
    const unsigned int view = iteration % GetNumberOfViews();
    const auto         transform = MakeView(volume, view);
    state.ResumeTiming();

    const auto start = std::chrono::steady_clock::now();
    filter->SetTransform(transform);
    filter->Update();
    const std::chrono::duration<double> duration = std::chrono::steady_clock::now() - start;
    state.SetIterationTime(duration.count());

    state.PauseTiming();
    if (!subject.IsExpected(view, filter->GetOutput()))
    {
      return "the output of view " + std::to_string(view) + " differs from that of the plain shear-warp";
    }
    const auto read = readLimit.FindMaximum(volume->GetBufferPointer(), volume->GetOffsetTable()[3]);
    if (read.maximum != subject.GetMaximum())
    {
      return "the read limit has not read the whole volume";
    }
    seconds.Add(view, duration.count());
    projectionSeconds.Add(view, filter->GetProjectionSeconds());
    warpSeconds.Add(view, filter->GetWarpSeconds());
    readSeconds.Add(view, read.seconds);
    skipped += filter->GetSkippedFraction();
    for (std::size_t n = 0; n < variants.size(); ++n)
    {
      const auto & axes = variants[n].principalAxes;
      if (std::find(axes.begin(), axes.end(), filter->GetPrincipalAxis()) == axes.end())
      {
        continue;
      }
      auto & changed = variants[n].isFirstView ? *firstFilter : *filter;
      changed.SetTransform(transform);
      variants[n].set(changed);
      changed.Modified();
      const auto variantStart = std::chrono::steady_clock::now();
      changed.Update();
      const std::chrono::duration<double> variant = std::chrono::steady_clock::now() - variantStart;
      // a mask is prepared once
      variantSeconds[n].Add(view, variant.count() - (variants[n].isFirstView ? 0.0 : changed.GetPreparationSeconds()));
      variants[n].reset(changed);
    }
    ++iteration;
    state.ResumeTiming();
  }

  constexpr double milliseconds = 1000.0;
  const double     readLimitSeconds = readSeconds.GetMeanOfMinima();
  const auto       minima = seconds.Summarize(GetMinimum);
  auto &           counters = state.counters;
  counters["read_limit_ratio"] = GetMean(minima) / readLimitSeconds;
  counters["worst_view_ratio"] = *std::max_element(minima.begin(), minima.end()) / readLimitSeconds;
  counters["read_limit_ms"] = milliseconds * readLimitSeconds;
  counters["min_ms"] = milliseconds * GetMean(minima);
  counters["median_ms"] = milliseconds * GetMean(seconds.Summarize(GetMedian));
  counters["projection_ms"] = milliseconds * projectionSeconds.GetMeanOfMinima();
  counters["warp_ms"] = milliseconds * warpSeconds.GetMeanOfMinima();
  counters["preparation_ms"] = milliseconds * preparation;
  counters["skipped_fraction"] = skipped / iteration;
  if (isCompared)
  {
    const auto & comparison = subject.Compare(measurement.repetitions);
    const double comparedSeconds = seconds.GetMeanOfMinima(subject.GetComparedViews());
    counters["raycast_ratio"] = comparison.rayCasting / comparedSeconds;
    counters["plain_ratio"] = comparison.plainShearWarp / comparedSeconds;
  }
  for (std::size_t n = 0; n < variants.size(); ++n)
  {
    counters[variants[n].counter] =
      variantSeconds[n].GetMeanOfMinima() / seconds.GetMeanOfMinima(variantSeconds[n].GetViews());
  }
  if (isPeakKnown)
  {
    counters["peak_mb"] = GetPeakMemory();
  }
  return {};
}

std::string
GetName(Measurement::ReducedResampling reducedResampling)
{
  using ReducedResampling = Measurement::ReducedResampling;
  return reducedResampling == ReducedResampling::Off  ? "off"
         : reducedResampling == ReducedResampling::On ? "on"
                                                      : "auto";
}
} // namespace

std::string
GetName(const Measurement & measurement)
{
  const DataSet &    data = measurement.data;
  std::ostringstream name;
  name << "mip/" << data.kind << '/' << data.size[0] << 'x' << data.size[1] << 'x' << data.size[2] << '/'
       << GetName(data.pixelType) << '/' << measurement.instructionSet << "/threads:" << measurement.threads << '/'
       << GetName(measurement.reducedResampling);
  return name.str();
}

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
RegisterChecked(const std::string &                                            name,
                unsigned int                                                   iterations,
                const std::function<std::string(::benchmark::State & state)> & measure)
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

bool
HasAnyFailed()
{
  return hasAnyFailed;
}
} // namespace itk::ShearWarpBenchmark
