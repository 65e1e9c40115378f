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
#include "Input.h"
#include "Measurement.h"
#include "ReportErrors.h"

#include "itkMultiThreaderBase.h"
#include "itkShearWarpSampling.h"
#include "itkVersion.h"

#include "itksys/SystemInformation.hxx"

#include <CLI/CLI.hpp>
#include <benchmark/benchmark.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>

namespace
{
using namespace itk::ShearWarpBenchmark;
using ReducedResampling = Measurement::ReducedResampling;

struct Options
{
  std::vector<std::string>  kinds;
  std::vector<std::string>  sizes{ "256x256x64", "391x257x173", "512x512x512" };
  std::vector<PixelType>    pixelTypes;
  std::vector<unsigned int> threads{ 1, 2 };
  std::vector<std::string>  images;
  unsigned int              viewRepetitions{ 0 };
  bool                      hasVariants{ false };
  bool                      isCine{ false };
};

std::string
Describe()
{
  std::string description =
    "Times maximum intensity projections by itk::ShearWarpMIPImageFilter, 35 views of each volume, beside reading\n"
    "the volume, ray casting and a plain shear-warp.\n\nKinds of volumes:\n";
  for (const Kind & kind : GetKinds())
  {
    description += "  " + kind.name + ": " + kind.description + "\n";
  }
  return description;
}

std::vector<std::string>
GetKindNames()
{
  std::vector<std::string> names;
  for (const Kind & kind : GetKinds())
  {
    names.push_back(kind.name);
  }
  return names;
}

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

/** Without --pixel-types all volumes have uint16, and the largest of the first kind the other types too. */
std::vector<DataSet>
MakeSyntheticDataSets(const Options & options)
{
  std::vector<std::string>  kinds = options.kinds.empty() ? GetKindNames() : options.kinds;
  std::vector<itk::Size<3>> sizes;
  std::transform(options.sizes.begin(), options.sizes.end(), std::back_inserter(sizes), ParseSize);
  std::vector<PixelType> pixelTypes = options.pixelTypes;
  std::vector<PixelType> furtherPixelTypes;
  if (pixelTypes.empty())
  {
    pixelTypes = { PixelType::UInt16 };
    furtherPixelTypes = { PixelType::Float, PixelType::UInt8, PixelType::Int16 };
  }

  std::vector<DataSet> dataSets;
  for (const std::string & kind : kinds)
  {
    for (const itk::Size<3> & size : sizes)
    {
      for (const PixelType pixelType : pixelTypes)
      {
        dataSets.push_back({ kind, "", size, pixelType });
      }
    }
  }
  const auto largest = std::max_element(
    sizes.begin(), sizes.end(), [](const auto & a, const auto & b) { return CountVoxels(a) < CountVoxels(b); });
  for (const PixelType pixelType : furtherPixelTypes)
  {
    dataSets.push_back({ kinds.front(), "", *largest, pixelType });
  }
  return dataSets;
}

std::vector<DataSet>
MakeDataSets(const Options & options)
{
  std::vector<DataSet> dataSets;
  if (options.images.empty() || !options.kinds.empty())
  {
    dataSets = MakeSyntheticDataSets(options);
  }
  for (const std::string & file : options.images)
  {
    const FileInformation information = ReadInformation(file);
    dataSets.push_back({ std::filesystem::path(file).stem().string(), file, information.size, information.pixelType });
  }
  return dataSets;
}

/** ReducedResampling Off and On are measured for the fastest instruction set and the largest `uint16` volumes and
 * files. */
void
RegisterAll(const Options & options)
{
  const auto         dataSets = MakeDataSets(options);
  const auto         instructionSets = itk::ShearWarp::GetInstructionSets();
  itk::SizeValueType most = 0;
  for (const DataSet & data : dataSets)
  {
    most = data.file.empty() ? std::max(most, CountVoxels(data.size)) : most;
  }
  for (const DataSet & data : dataSets)
  {
    const bool isLargest = CountVoxels(data.size) == most && data.pixelType == PixelType::UInt16;
    const bool isMeasuredInAllModes = isLargest || !data.file.empty();
    const bool isLong = CountVoxels(data.size) >= 1U << 26;
    for (const std::string & instructionSet : instructionSets)
    {
      const unsigned int repetitions = options.viewRepetitions > 0    ? options.viewRepetitions
                                       : !isLong                      ? 5
                                       : instructionSet == "portable" ? 1
                                                                      : 3;

      std::vector<ReducedResampling> modes{ ReducedResampling::Auto };
      if (isMeasuredInAllModes && instructionSet == instructionSets.back())
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
  ::benchmark::AddCustomContext(
    "threader", itk::MultiThreaderBase::ThreaderTypeToString(itk::MultiThreaderBase::GetGlobalDefaultThreader()));
}

int
Run(int argc, char * argv[])
{
  std::map<std::string, PixelType> pixelTypes;
  for (const PixelType type : { PixelType::UInt8, PixelType::Int16, PixelType::UInt16, PixelType::Float })
  {
    pixelTypes[PixelTypeNames[static_cast<int>(type)]] = type;
  }
  Options  options;
  CLI::App app(Describe());
  app.allow_extras();
  app.add_option("--kinds", options.kinds, "Kinds of volumes to make [all, or none with --image]")
    ->delimiter(',')
    ->check(CLI::IsMember(GetKindNames()));
  app.add_option("--sizes", options.sizes, "Their sizes in voxels")->delimiter(',')->capture_default_str();
  app
    .add_option(
      "--pixel-types", options.pixelTypes, "Their pixel types [uint16, and all for the largest of the first kind]")
    ->delimiter(',')
    ->transform(CLI::CheckedTransformer(pixelTypes));
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

  try
  {
    app.parse(argc, argv);
    // the pool has as many threads as are asked for
    itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(
      *std::max_element(options.threads.begin(), options.threads.end()));

    // Google Benchmark keeps pointers to them
    static std::vector<std::string> arguments;
    arguments = app.remaining();
    std::vector<char *> pointers{ argv[0] };
    for (std::string & argument : arguments)
    {
      pointers.push_back(argument.data());
    }
    auto count = static_cast<int>(pointers.size());
    pointers.push_back(nullptr);
    ::benchmark::Initialize(&count, pointers.data());
    if (::benchmark::ReportUnrecognizedArguments(count, pointers.data()))
    {
      return EXIT_FAILURE;
    }
    RegisterAll(options);
  }
  catch (const CLI::CallForHelp & help)
  {
    app.exit(help);
    std::cout << "\nOptions of Google Benchmark:\n";
    ::benchmark::PrintDefaultHelp();
    return EXIT_SUCCESS;
  }
  catch (const CLI::ParseError & error)
  {
    app.exit(error);
    return EXIT_FAILURE;
  }

  AddContext();
  const auto measured = ::benchmark::RunSpecifiedBenchmarks();
  ::benchmark::Shutdown();
  return measured > 0 && !HasAnyFailed() ? EXIT_SUCCESS : EXIT_FAILURE;
}
} // namespace

int
main(int argc, char * argv[])
{
  return ReportErrors([=] { return Run(argc, argv); });
}
