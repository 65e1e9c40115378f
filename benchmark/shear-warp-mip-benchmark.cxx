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
#include "Subject.h"
#include "Variants.h"

#include "itkMultiThreaderBase.h"
#include "itkShearWarpMIPCineImageFilter.h"
#include "itkVersion.h"

#include "itksys/SystemInformation.hxx"
#include "itksys/SystemTools.hxx"

#include <CLI/CLI.hpp>
#include <benchmark/benchmark.h>

#include <atomic>
#include <fstream>
#include <iostream>
#include <memory>
#include <numeric>
#include <stdexcept>

namespace itk::ShearWarpBenchmark
{
namespace
{
constexpr unsigned int NumberOfFrames = 36;
constexpr double       Milliseconds = 1000.0;

using ReducedResampling = Measurement::ReducedResampling;

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
GetMinimum(const std::vector<double> & values)
{
  return *std::min_element(values.begin(), values.end());
}

/** The lower one of two medians. */
double
GetMedian(const std::vector<double> & values)
{
  auto       sorted = values;
  const auto middle = sorted.begin() + (static_cast<std::ptrdiff_t>(sorted.size()) - 1) / 2;
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

/** The mean over the views of a statistic of each view's values. */
double
GetMean(const ViewSeries & series, double (*statistic)(const std::vector<double> &) = GetMinimum)
{
  const auto add = [statistic](double sum, const auto & view) { return sum + statistic(view.second); };
  return std::accumulate(series.begin(), series.end(), 0.0, add) / static_cast<double>(series.size());
}

/** The sum of a buffer's words of 64 bits, read at four places in turn: memory serves a few streams faster than one. */
#if defined(__GNUC__) && defined(__x86_64__) && defined(__gnu_linux__)
// the compiler makes a copy for each of these instruction sets, and the program takes the best that the processor has
[[gnu::target_clones("avx2", "default")]]
#endif
std::uint64_t
AddWords(const char * bytes, std::size_t size)
{
  const auto get = [bytes](std::size_t n) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes + n * sizeof(word), sizeof(word));
    return word;
  };
  const std::size_t count = size / sizeof(std::uint64_t);
  const std::size_t quarter = count / 4;
  std::uint64_t     a = 0;
  std::uint64_t     b = 0;
  std::uint64_t     c = 0;
  std::uint64_t     d = 0;
  for (std::size_t n = 0; n < quarter; ++n)
  {
    a += get(n);
    b += get(n + quarter);
    c += get(n + 2 * quarter);
    d += get(n + 3 * quarter);
  }
  for (std::size_t n = 4 * quarter; n < count; ++n)
  {
    a += get(n);
  }
  std::uint64_t last = 0;
  std::memcpy(&last, bytes + count * sizeof(last), size % sizeof(last));
  return a + b + c + d + last;
}

/** Seconds that so many threads need to read the whole volume: every projection has to read it too. */
template <typename TPixel>
double
MeasureReadLimit(const Subject<TPixel> & subject, unsigned int threads)
{
  static constexpr SizeValueType block = 1U << 20U;
  const auto *                   bytes = reinterpret_cast<const char *>(subject.volume->GetBufferPointer());
  const SizeValueType            size = subject.volume->GetOffsetTable()[3] * sizeof(TPixel);
  const auto                     threader = MultiThreaderBase::New();
  std::atomic<std::uint64_t>     sum{ 0 };
  const auto                     read = [bytes, size, &sum](SizeValueType n) {
    sum += AddWords(bytes + n * block, std::min(block, size - n * block));
  };
  threader->SetNumberOfWorkUnits(threads);
  const double seconds = Time([&] { threader->ParallelizeArray(0, (size + block - 1) / block, read, nullptr); });
  if (sum != subject.sum)
  {
    throw std::runtime_error("the read limit has not read the whole volume");
  }
  return seconds;
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
      for (const auto & [axis, view] : subject.comparedViews)
      {
        filter.SetTransform(MakeView(subject.volume, GetViews()[view]));
        filter.Update();
        sum += filter.GetPreparationSeconds();
      }
    }
  }
  return GetMinimum(seconds);
}

/** An iteration is one view: a new transform, and the filter's whole update, which is what is timed. After each view
 * the read limit is measured with as many threads. Output that differs in a bit from the plain shear-warp is an error.
 * README.md says what the counters are. */
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
  if (measurement.instructionSet != "portable" && measurement.reducedResampling == ReducedResampling::Auto)
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
                               " differs from the output of the plain shear-warp");
    }
    readSeconds[view].push_back(MeasureReadLimit(subject, measurement.threads));
    seconds[view].push_back(duration);
    projectionSeconds[view].push_back(filter->GetProjectionSeconds());
    warpSeconds[view].push_back(filter->GetWarpSeconds());
    skipped += filter->GetSkippedFraction();
    if (subject.comparedViews.at(filter->GetPrincipalAxis()) == view)
    {
      compared[view].push_back(duration);
    }
    for (Variant<FilterType> & variant : variants)
    {
      if (variant.principalAxes.count(filter->GetPrincipalAxis()) > 0)
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

  const double readLimit = GetMean(readSeconds);
  double       worst = 0.0;
  for (const auto & [view, values] : seconds)
  {
    worst = std::max(worst, GetMinimum(values));
  }
  auto & counters = state.counters;
  counters["read_limit_ratio"] = GetMean(seconds) / readLimit;
  counters["worst_view_ratio"] = worst / readLimit;
  counters["read_limit_ms"] = Milliseconds * readLimit;
  counters["min_ms"] = Milliseconds * GetMean(seconds);
  counters["median_ms"] = Milliseconds * GetMean(seconds, GetMedian);
  counters["projection_ms"] = Milliseconds * GetMean(projectionSeconds);
  counters["warp_ms"] = Milliseconds * GetMean(warpSeconds);
  counters["preparation_ms"] = Milliseconds * preparation;
  counters["skipped_fraction"] = skipped / iteration;
  if (isCompared)
  {
    counters["raycast_ratio"] = subject.rayCastingSeconds / GetMean(compared);
    counters["plain_ratio"] = subject.plainSeconds / GetMean(compared);
  }
  for (const Variant<FilterType> & variant : variants)
  {
    counters[variant.counter] = GetMean(variant.seconds) / GetMean(variant.unchangedSeconds);
  }
  if (isPeakKnown)
  {
    counters["peak_mb"] = GetPeakMemory();
  }
}

/** An iteration is a full turn of 36 frames by ShearWarpMIPCineImageFilter, which is what is timed. After each the read
 * limit is measured and, with the single filter, all of its frames; frames that differ in a bit are an error. */
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
    readTimes.push_back(MeasureReadLimit(subject, measurement.threads));
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

/** Registers \a measure(state, subject) of so many iterations; what it throws is an error of the benchmark. */
template <typename TFunction>
void
Register(const std::string & prefix, const Measurement & measurement, std::size_t iterations, const TFunction & measure)
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

/** Registers a benchmark of single views, or one of turns for each of four axes. */
void
Register(const Measurement & measurement, bool isCine)
{
  if (!isCine)
  {
    const std::size_t iterations = measurement.repetitions * GetViews().size();
    Register("", measurement, iterations, [measurement](auto & state, auto & subject) {
      Measure(state, measurement, subject);
    });
    return;
  }
  const std::map<std::string, std::array<double, 3>> axes{
    { "x", { 1, 0, 0 } }, { "y", { 0, 1, 0 } }, { "z", { 0, 0, 1 } }, { "oblique", { 0.3, 0.8, 0.5 } }
  };
  for (const auto & [name, direction] : axes)
  {
    const std::string       prefix = "cine/" + name + '/';
    const Vector<double, 3> axis(direction.data());
    Register(prefix, measurement, measurement.repetitions, [measurement, axis](auto & state, auto & subject) {
      MeasureCine(state, measurement, subject, axis);
    });
  }
}

struct Options
{
  std::vector<std::string>  kinds;
  std::vector<std::string>  sizes{ "256x256x64", "391x257x173", "512x512x512" };
  std::vector<std::string>  pixelTypes;
  std::vector<unsigned int> threads{ 1, 2 };
  std::vector<std::string>  images;
  unsigned int              viewRepetitions{ 0 };
  bool                      hasVariants{ false };
  bool                      isCine{ false };
};

Size<3>
ParseSize(const std::string & text)
{
  Size<3>            size;
  std::istringstream stream(text);
  char               first = 0;
  char               second = 0;
  if (!(stream >> size[0] >> first >> size[1] >> second >> size[2]) || first != 'x' || second != 'x' || !stream.eof() ||
      std::find(size.begin(), size.end(), 0) != size.end())
  {
    throw CLI::ValidationError("--sizes", "'" + text + "' is not of the form 512x512x512");
  }
  return size;
}

/** Without --pixel-types all volumes have uint16, and the largest of the first kind the other types too.
 * ReducedResampling Off and On are measured for the fastest instruction set and the largest `uint16` volumes and files.
 */
void
RegisterAll(const Options & options)
{
  const auto           count = [](const Size<3> & size) { return size[0] * size[1] * size[2]; };
  const bool           isTyped = !options.pixelTypes.empty();
  const auto           kinds = options.kinds.empty() && options.images.empty() ? GetKinds() : options.kinds;
  const auto           pixelTypes = isTyped ? options.pixelTypes : std::vector<std::string>{ "uint16" };
  std::vector<DataSet> dataSets;
  Size<3>              largest{};
  for (const std::string & kind : kinds)
  {
    for (const std::string & text : options.sizes)
    {
      const Size<3> size = ParseSize(text);
      largest = count(size) > count(largest) ? size : largest;
      for (const std::string & pixelType : pixelTypes)
      {
        dataSets.push_back({ kind, "", size, pixelType });
      }
    }
  }
  if (!kinds.empty() && !isTyped)
  {
    for (const std::string pixelType : { "float", "uint8", "int16", "int32", "int64", "double" })
    {
      dataSets.push_back({ kinds.front(), "", largest, pixelType });
    }
  }
  std::transform(options.images.begin(), options.images.end(), std::back_inserter(dataSets), ReadInformation);

  const auto instructionSets = ShearWarp::GetInstructionSets();
  for (const DataSet & data : dataSets)
  {
    const bool isLargest = count(data.size) == count(largest) && data.pixelType == "uint16";
    const bool isLong = count(data.size) >= 1U << 26;
    for (const std::string & instructionSet : instructionSets)
    {
      const unsigned int repetitions = options.viewRepetitions > 0    ? options.viewRepetitions
                                       : !isLong                      ? 5
                                       : instructionSet == "portable" ? 1
                                                                      : 3;

      std::vector<ReducedResampling> modes{ ReducedResampling::Auto };
      if ((isLargest || !data.file.empty()) && instructionSet == instructionSets.back())
      {
        modes = { ReducedResampling::Off, ReducedResampling::On, ReducedResampling::Auto };
      }
      for (const unsigned int threads : options.threads)
      {
        for (const ReducedResampling mode : modes)
        {
          const bool hasVariants = options.hasVariants && mode == ReducedResampling::Auto;
          Register({ data, instructionSet, threads, mode, repetitions, hasVariants }, options.isCine);
        }
      }
    }
  }
}
} // namespace
} // namespace itk::ShearWarpBenchmark

int
main(int argc, char * argv[])
try
{
  using namespace itk::ShearWarpBenchmark;

  static CLI::App app("Times maximum intensity projections by itk::ShearWarpMIPImageFilter, 35 views of each volume,\n"
                      "beside reading the volume, ray casting and a plain shear-warp.",
                      "shear-warp-mip-benchmark");
  Options         options;
  app.add_option("--kinds", options.kinds, "Kinds of volumes to make [all, or none with --image]")
    ->delimiter(',')
    ->check(CLI::IsMember(GetKinds()));
  app.add_option("--sizes", options.sizes, "Their sizes in voxels")->delimiter(',')->capture_default_str();
  app
    .add_option(
      "--pixel-types", options.pixelTypes, "Their pixel types [uint16, and all for the largest of the first kind]")
    ->delimiter(',')
    ->check(CLI::IsMember({ "uint8", "int16", "uint16", "int32", "int64", "float", "double" }));
  app.add_option("--image", options.images, "A file that ITK reads, to measure too")->check(CLI::ExistingFile);
  app.add_flag("--variants", options.hasVariants, "Measure modes, slab, box, mask, depth and the like too, where Auto");
  app.add_flag("--cine", options.isCine, "Measure turning series of 36 frames instead of single views");
  app.add_option("--threads", options.threads, "Numbers of threads")
    ->delimiter(',')
    ->check(CLI::Range(1, 128))
    ->capture_default_str();
  app
    .add_option("--view-repetitions",
                options.viewRepetitions,
                "How often each view is timed [5; for 512x512x512 3, and 1 where portable]")
    ->check(CLI::Range(1, 1000));

  // it takes its own options and --help away
  ::benchmark::Initialize(&argc, argv, [] {
    std::cout << app.help() << "\nOptions of Google Benchmark:\n";
    ::benchmark::PrintDefaultHelp();
  });
  try
  {
    app.parse(argc, argv);
    RegisterAll(options);
  }
  catch (const CLI::ParseError & error)
  {
    return app.exit(error);
  }
  // the pool has as many threads as are asked for
  itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(
    *std::max_element(options.threads.begin(), options.threads.end()));
  itksys::SystemInformation system;
  system.RunCPUCheck();
  ::benchmark::AddCustomContext("processor", system.GetModelName());
  ::benchmark::AddCustomContext("itk", itk::Version::GetITKVersion());
  ::benchmark::AddCustomContext("compiler", ShearWarpMIP_COMPILER);
  const auto measured = ::benchmark::RunSpecifiedBenchmarks();
  ::benchmark::Shutdown();
  return measured > 0 && !hasFailed ? EXIT_SUCCESS : EXIT_FAILURE;
}
catch (const std::exception & error)
{
  std::cerr << itk::ShearWarpBenchmark::Describe(error) << std::endl;
  return EXIT_FAILURE;
}
