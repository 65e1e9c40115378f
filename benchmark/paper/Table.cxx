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
#include "Table.h"

#include "itkMultiThreaderBase.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <vector>

namespace itk::ShearWarpBenchmark
{
void
WriteTable(const std::string &                               file,
           const std::string &                               header,
           SizeValueType                                     count,
           const std::function<std::string(SizeValueType)> & describe)
{
  std::vector<std::string> descriptions(count);
  MultiThreaderBase::New()->ParallelizeArray(
    0, count, [&](SizeValueType n) { descriptions[n] = describe(n); }, nullptr);

  std::ofstream out(file);
  out << header << '\n';
  std::copy(descriptions.begin(), descriptions.end(), std::ostream_iterator<std::string>(out));
  if (!out.flush())
  {
    itkGenericExceptionMacro("Cannot write " << file << '.');
  }
}
} // namespace itk::ShearWarpBenchmark
