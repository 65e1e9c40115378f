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

#include "itkMultiThreaderBase.h"
#include "itkShearWarpSampling.h"
#include "itkVersion.h"

#include "itksys/SystemInformation.hxx"

#include <CLI/CLI.hpp>
#include <benchmark/benchmark.h>

#include <algorithm>
#include <iostream>

namespace
{
using namespace itk::ShearWarpBenchmark;
using ReducedResampling = Measurement::ReducedResampling;

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

itk::Size<3>
ParseSize(const std::string & text)
{
  itk::Size<3>       size;
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

itk::SizeValueType
CountVoxels(const itk::Size<3> & size)
{
  return size[0] * size[1] * size[2];
}

/** Without --pixel-types all volumes have uint16, and the largest of the first kind the other types too.
 * ReducedResampling Off and On are measured for the fastest instruction set and the largest `uint16` volumes and files.
 */
void
RegisterAll(const Options & options)
{
  const bool           isTyped = !options.pixelTypes.empty();
  const auto           kinds = options.kinds.empty() && options.images.empty() ? GetKinds() : options.kinds;
  const auto           pixelTypes = isTyped ? options.pixelTypes : std::vector<std::string>{ "uint16" };
  std::vector<DataSet> dataSets;
  itk::Size<3>         largest{};
  for (const std::string & kind : kinds)
  {
    for (const std::string & text : options.sizes)
    {
      const itk::Size<3> size = ParseSize(text);
      largest = CountVoxels(size) > CountVoxels(largest) ? size : largest;
      for (const std::string & pixelType : pixelTypes)
      {
        dataSets.push_back({ kind, "", size, pixelType });
      }
    }
  }
  if (!kinds.empty() && !isTyped)
  {
    for (const std::string pixelType : { "float", "uint8", "int16" })
    {
      dataSets.push_back({ kinds.front(), "", largest, pixelType });
    }
  }
  std::transform(options.images.begin(), options.images.end(), std::back_inserter(dataSets), ReadInformation);

  const auto instructionSets = itk::ShearWarp::GetInstructionSets();
  for (const DataSet & data : dataSets)
  {
    const bool isLargest = CountVoxels(data.size) == CountVoxels(largest) && data.pixelType == "uint16";
    const bool isLong = CountVoxels(data.size) >= 1U << 26;
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
          (options.isCine ? RegisterCine : Register)({ data, instructionSet, threads, mode, repetitions, hasVariants });
        }
      }
    }
  }
}

void
AddContext()
{
  itksys::SystemInformation system;
  system.RunCPUCheck();
  ::benchmark::AddCustomContext("processor", system.GetModelName());
  ::benchmark::AddCustomContext("itk", itk::Version::GetITKVersion());
  ::benchmark::AddCustomContext("compiler", ShearWarpMIP_COMPILER);
}
} // namespace

int
main(int argc, char * argv[])
try
{
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
    ->check(CLI::IsMember({ "uint8", "int16", "uint16", "float" }));
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
  AddContext();
  const auto measured = ::benchmark::RunSpecifiedBenchmarks();
  ::benchmark::Shutdown();
  return measured > 0 && !HasAnyFailed() ? EXIT_SUCCESS : EXIT_FAILURE;
}
catch (const std::exception & error)
{
  std::cerr << Describe(error) << std::endl;
  return EXIT_FAILURE;
}
