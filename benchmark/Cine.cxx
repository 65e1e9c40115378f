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
#include "Cine.h"

#include "Process.h"
#include "ReadLimit.h"
#include "Subject.h"

#include "itkShearWarpMIPCineImageFilter.h"

#include <chrono>
#include <cstring>

namespace itk::ShearWarpBenchmark
{
namespace
{
constexpr unsigned int NumberOfFrames = 36;

struct Axis
{
  std::string name;
  double      direction[3];
};

const Axis Axes[] = { { "x", { 1, 0, 0 } },
                      { "y", { 0, 1, 0 } },
                      { "z", { 0, 0, 1 } },
                      { "oblique", { 0.3, 0.8, 0.5 } } };

/** Calls \a function and returns its time in milliseconds. */
template <typename TFunction>
double
Time(const TFunction & function)
{
  const auto start = std::chrono::steady_clock::now();
  function();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

template <typename TPixel>
std::string
Measure(::benchmark::State & state, const Measurement & measurement, const Axis & axis)
{
  using VolumeType = Image<TPixel, 3>;
  const ForcedInstructionSet forced(measurement.instructionSet);
  const auto                 volume = LoadVolume<TPixel>(measurement.data);
  const auto                 cine = ShearWarpMIPCineImageFilter<VolumeType>::New();
  const auto                 single = ShearWarpMIPImageFilter<VolumeType>::New();
  const Size<2>              size = GetOutputSize(volume);
  SetUp(*cine, volume, measurement);
  SetUp(*single, volume, measurement);
  cine->SetNumberOfFrames(NumberOfFrames);
  cine->SetRotationAxis(axis.direction);
  cine->Update();
  const Point<double, 3> origin = cine->GetOutput()->GetOrigin();
  const double           viewOrigin[] = { origin[0], origin[1] };
  single->SetOutputOrigin(viewOrigin);

  std::vector<typename ShearWarpMIPCineImageFilter<VolumeType>::TransformType::Pointer> views;
  for (unsigned int frame = 0; frame < NumberOfFrames; ++frame)
  {
    views.push_back(cine->GetFrameTransform(frame));
    single->SetTransform(views.back());
    single->Update();
  }

  ReadLimit           readLimit(measurement.threads);
  std::vector<double> cineTimes;
  std::vector<double> singleTimes;
  std::vector<double> readTimes;
  for (auto _ : state)
  {
    cine->Modified();
    cineTimes.push_back(Time([&] { cine->Update(); }));
    state.SetIterationTime(1e-3 * cineTimes.back());

    double sum = 0.0;
    for (unsigned int frame = 0; frame < NumberOfFrames; ++frame)
    {
      sum += Time([&] {
        single->SetTransform(views[frame]);
        single->Update();
      });
      const TPixel * expected = single->GetOutput()->GetBufferPointer();
      const TPixel * pixels = cine->GetOutput()->GetBufferPointer() + frame * size[0] * size[1];
      if (std::memcmp(pixels, expected, size[0] * size[1] * sizeof(TPixel)) != 0)
      {
        return "frame " + std::to_string(frame) + " differs from the single filter's picture";
      }
    }
    singleTimes.push_back(sum);
    readTimes.push_back(1e3 * readLimit.FindMaximum(volume->GetBufferPointer(), volume->GetOffsetTable()[3]).seconds);
  }

  const auto getLeast = [](const std::vector<double> & times) { return *std::min_element(times.begin(), times.end()); };
  const double frame = getLeast(cineTimes) / NumberOfFrames;
  auto &       counters = state.counters;
  counters["read_limit_ratio"] = frame / getLeast(readTimes);
  counters["read_limit_ms"] = getLeast(readTimes);
  counters["frame_ms"] = frame;
  counters["single_ratio"] = getLeast(singleTimes) / getLeast(cineTimes);
  counters["projection_ms"] = 1e3 * cine->GetProjectionSeconds() / NumberOfFrames;
  counters["warp_ms"] = 1e3 * cine->GetWarpSeconds() / NumberOfFrames;
  counters["skipped_fraction"] = cine->GetSkippedFraction();
  return {};
}
} // namespace

void
RegisterCine(const Measurement & measurement)
{
  for (const Axis & axis : Axes)
  {
    RegisterChecked("cine/" + axis.name + '/' + GetName(measurement),
                    measurement.repetitions,
                    [measurement, axis](::benchmark::State & state) {
                      return Dispatch(measurement.data.pixelType,
                                      [&](auto pixel) { return Measure<decltype(pixel)>(state, measurement, axis); });
                    });
  }
}
} // namespace itk::ShearWarpBenchmark
