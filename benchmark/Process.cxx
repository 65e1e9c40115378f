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
#include "Process.h"

#include "itkShearWarpMIPImageFilter.h"

#include "itksys/SystemTools.hxx"

#include <fstream>
#include <limits>

namespace itk::ShearWarpBenchmark
{
namespace
{
constexpr auto environmentVariable = "SHEARWARPMIP_INSTRUCTION_SET";

/** The instruction set that the filter takes when \a name is forced. */
std::string
ForceInstructionSet(const std::string & name)
{
  using ImageType = Image<std::uint16_t, 3>;
  const auto image = ImageType::New();
  image->SetRegions(Size<3>{ { 8, 8, 8 } });
  image->Allocate(true);

  const ForcedInstructionSet forced(name);
  const auto                 filter = ShearWarpMIPImageFilter<ImageType>::New();
  filter->SetInput(image);
  filter->Update();
  return filter->GetInstructionSet();
}
} // namespace

ForcedInstructionSet::ForcedInstructionSet(const std::string & name)
{
  std::string former;
  if (itksys::SystemTools::GetEnv(environmentVariable, former))
  {
    m_Former = former;
  }
  itksys::SystemTools::PutEnv(environmentVariable + ("=" + name));
}

ForcedInstructionSet::~ForcedInstructionSet()
{
  if (m_Former)
  {
    itksys::SystemTools::PutEnv(environmentVariable + ("=" + *m_Former));
  }
  else
  {
    itksys::SystemTools::UnPutEnv(environmentVariable);
  }
}

std::vector<std::string>
FindInstructionSets()
{
  std::vector<std::string> found;
  for (const std::string name : { "portable", "generic", "avx2", "avx512" })
  {
    try
    {
      if (ForceInstructionSet(name) == name)
      {
        found.push_back(name);
      }
    }
    catch (const ExceptionObject &)
    {
      // the filter may refuse what the processor does not have
    }
  }
  return found;
}

bool
ResetPeakMemory()
{
  std::ofstream file("/proc/self/clear_refs");
  file << "5" << std::flush;
  return file.good();
}

double
GetPeakMemory()
{
  std::ifstream file("/proc/self/status");
  for (std::string name; file >> name;)
  {
    double kilobytes = 0.0;
    if (name == "VmHWM:" && file >> kilobytes)
    {
      return kilobytes / 1024.0;
    }
    file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return 0.0;
}
} // namespace itk::ShearWarpBenchmark
