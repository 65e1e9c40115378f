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
#ifndef Table_h
#define Table_h

#include "itkIntTypes.h"

#include <functional>
#include <string>

namespace itk::ShearWarpBenchmark
{
/** Writes \a header and then \a describe(n), whole lines, for each n of [0, count) to \a file. Threads share the calls.
 * Throws ExceptionObject if the file cannot be written. */
void
WriteTable(const std::string &                               file,
           const std::string &                               header,
           SizeValueType                                     count,
           const std::function<std::string(SizeValueType)> & describe);
} // namespace itk::ShearWarpBenchmark

#endif
