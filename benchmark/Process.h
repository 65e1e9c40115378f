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
#ifndef Process_h
#define Process_h

#include <optional>
#include <string>
#include <vector>

namespace itk::ShearWarpBenchmark
{
/** Forces the filter's instruction set, through the environment, as long as the object lives. */
class ForcedInstructionSet
{
public:
  explicit ForcedInstructionSet(const std::string & name);
  ~ForcedInstructionSet();
  ForcedInstructionSet(const ForcedInstructionSet &) = delete;
  ForcedInstructionSet &
  operator=(const ForcedInstructionSet &) = delete;

private:
  std::optional<std::string> m_Former;
};

/** Those of the filter's instruction sets that this machine runs, the slowest first. */
std::vector<std::string>
FindInstructionSets();

/** Makes this process forget its peak memory. Returns whether the system can do so: Linux, see proc(5), clear_refs. */
bool
ResetPeakMemory();

/** The most memory that this process has held in RAM since ResetPeakMemory(), in MB of 2^20 bytes: VmHWM of proc(5).
 * Zero where the system does not tell. */
double
GetPeakMemory();
} // namespace itk::ShearWarpBenchmark

#endif
