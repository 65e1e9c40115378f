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
#include "Data.h"
#include "Figure5.h"
#include "ReportErrors.h"
#include "Timing.h"
#include "VesselStudy.h"
#include "Volumes.h"

#include "itkMultiThreaderBase.h"

#include <CLI/CLI.hpp>

#include <filesystem>
#include <utility>
#include <vector>

namespace
{
using namespace itk::ShearWarpBenchmark;
using VolumeType = itk::Image<std::uint16_t, 3>;

struct Options
{
  std::string  output{ "." };
  std::string  image;
  unsigned int repetitions{ 9 };
};

constexpr char Description[] =
  "Measures what Fang et al. (Magn Reson Med 47:696-700, 2002) measured, with their methods and with the filter of "
  "this\n"
  "module. Writes CSV files and pictures (TIFF). The data are a synthetic time-of-flight MR angiogram, `mra`, and\n"
  "--image, which is called `image`.";

/** The data sets by their names, of the paper's size and 14 bits. */
std::vector<std::pair<std::string, VolumeType::Pointer>>
MakeVolumes(const Options & options)
{
  std::vector<std::pair<std::string, VolumeType::Pointer>> volumes{ { "mra",
                                                                      MakeVolume<std::uint16_t>("mra", PaperSize) } };
  if (!options.image.empty())
  {
    volumes.emplace_back("image", ReadVolume(options.image, PaperSize));
  }
  return volumes;
}

int
Run(int argc, char * argv[])
{
  Options  options;
  CLI::App app(Description);
  app.require_subcommand(1);
  app.add_option("--output", options.output, "Folder for the results")
    ->check(CLI::ExistingDirectory)
    ->capture_default_str();
  app.add_option("--image", options.image, "A 3D image that ITK reads")->check(CLI::ExistingFile);
  const auto getPath = [&options](const std::string & name) {
    return (std::filesystem::path(options.output) / name).string();
  };

  auto * timing =
    app.add_subcommand("timing", "Table 1 and figure 4: the methods' times, with one thread")->fallthrough();
  timing->add_option("--repetitions", options.repetitions, "How often each angle is timed")
    ->check(CLI::Range(1, 1000))
    ->capture_default_str();
  timing->callback([&] {
    // the filter has no more threads than ITK's pool
    itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(1);
    for (const auto & [name, volume] : MakeVolumes(options))
    {
      WriteTimings(TimeMethods(volume, options.repetitions), getPath("table1-" + name + ".csv"));
    }
  });

  app.add_subcommand("pictures", "Figure 5: a view by ray casting and by shear-warp, and their difference")
    ->fallthrough()
    ->callback([&] {
      for (const auto & [name, volume] : MakeVolumes(options))
      {
        WriteFigure5(volume, name, options.output);
      }
    });

  app.add_subcommand("vessel", "Figure 6: errors for a vessel with a stenosis, whose projection is known")
    ->fallthrough()
    ->callback([&] {
      WriteVesselErrors(getPath("figure6.csv"));
      WriteVesselPictures(options.output);
    });

  CLI11_PARSE(app, argc, argv);
  return EXIT_SUCCESS;
}
} // namespace

int
main(int argc, char * argv[])
{
  return ReportErrors([=] { return Run(argc, argv); });
}
