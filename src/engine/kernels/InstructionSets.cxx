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
#include "InstructionSets.h"

#include "itkShearWarpGeometry.h"

#include <cstdlib>
#include <string>
#include <vector>

namespace itk::ShearWarp
{
namespace
{
/** A set of instructions that kernels are compiled for. */
struct InstructionSet
{
  const char * name;
  bool (*isAvailable)();
  const VectorKernels & (*getKernels)(); // null for the portable kernels
};

bool
HasAnyProcessor()
{
  return true;
}

#ifdef ShearWarpMIP_HAS_X86_KERNELS
bool
HasAVX2()
{
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2");
}

bool
HasAVX512()
{
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
         __builtin_cpu_supports("avx512vnni");
}
#endif

/** All instruction sets of this build, the best one last. */
constexpr InstructionSet InstructionSets[] = {
  { "portable", HasAnyProcessor, nullptr },
#ifdef ShearWarpMIP_HAS_GENERIC_KERNELS
  { "generic", HasAnyProcessor, GetGenericKernels },
#endif
#ifdef ShearWarpMIP_HAS_X86_KERNELS
  { "avx2", HasAVX2, GetAVX2Kernels },
  { "avx512", HasAVX512, GetAVX512Kernels },
#endif
};

std::vector<InstructionSet>
FindAvailable()
{
  std::vector<InstructionSet> available;
  for (const InstructionSet & set : InstructionSets)
  {
    if (set.isAvailable())
    {
      available.push_back(set);
    }
  }
  return available;
}

InstructionSet
ChooseInstructionSet()
{
  static const std::vector<InstructionSet> available = FindAvailable();
  const char *                             wanted = std::getenv("SHEARWARPMIP_INSTRUCTION_SET");
  if (!wanted || !*wanted)
  {
    return available.back();
  }
  std::string names;
  for (const InstructionSet & set : available)
  {
    if (std::string(set.name) == wanted)
    {
      return set;
    }
    names += ' ' + std::string(set.name);
  }
  Throw(
    InvalidParameter("SHEARWARPMIP_INSTRUCTION_SET is \"" + std::string(wanted) + "\"; this computer has:" + names));
}
} // namespace

std::vector<std::string>
GetInstructionSets()
{
  std::vector<std::string> names;
  for (const InstructionSet & set : FindAvailable())
  {
    names.emplace_back(set.name);
  }
  return names;
}

template <typename TPixel>
const Kernels<TPixel> &
GetKernels()
{
  const InstructionSet set = ChooseInstructionSet();
  return set.getKernels ? set.getKernels() : GetPortableKernels<TPixel>();
}

#define INSTANTIATE(TPixel) template const Kernels<TPixel> & GetKernels();
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE

} // namespace itk::ShearWarp
