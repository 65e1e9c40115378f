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
#include "Studies.h"

#include "itkMultiThreaderBase.h"

#include <CLI/CLI.hpp>

#include <iostream>
#include <map>

int
main(int argc, char * argv[])
try
{
  using namespace itk::ShearWarpBenchmark;

  std::string  output{ "." };
  std::string  image;
  unsigned int repetitions{ 9 };
  CLI::App     app("Measures what Fang et al. (Magn Reson Med 47:696-700, 2002) measured, with their methods and with "
                   "the filter of this\nmodule. Writes CSV files and pictures (TIFF). The data are a synthetic "
                   "time-of-flight MR angiogram, `mra`, and\n--image, which is called `image`.");
  app.add_option("--output", output, "Folder for the results")->check(CLI::ExistingDirectory)->capture_default_str();
  app.add_option("--image", image, "A 3D image that ITK reads")->required()->check(CLI::ExistingFile);
  app.add_option("--repetitions", repetitions, "How often each angle is timed")
    ->check(CLI::Range(1, 1000))
    ->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  // the filter has no more threads than ITK's pool
  itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(1);
  const std::map<std::string, itk::Image<std::uint16_t, 3>::Pointer> volumes{
    { "mra", MakeVolume<std::uint16_t>("mra", PaperSize) }, { "image", ReadVolume(image, PaperSize) }
  };
  for (const auto & [name, volume] : volumes)
  {
    WriteTimings(TimeMethods(volume, repetitions), output + "/table1-" + name + ".csv");
    WriteFigure5(volume, name, output);
  }
  WriteVesselErrors(output + "/figure6.csv");
  WriteVesselPictures(output);
  return EXIT_SUCCESS;
}
catch (const std::exception & error)
{
  std::cerr << itk::ShearWarpBenchmark::Describe(error) << std::endl;
  return EXIT_FAILURE;
}
