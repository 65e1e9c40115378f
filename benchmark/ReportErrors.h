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
#ifndef ReportErrors_h
#define ReportErrors_h

#include "itkMacro.h"

#include <cstdlib>
#include <exception>
#include <iostream>

namespace itk::ShearWarpBenchmark
{
/** The status that \a run() returns; if it throws, what it says goes to standard error and the status is that of a
 * failure. */
template <typename TFunction>
int
ReportErrors(const TFunction & run)
{
  try
  {
    return run();
  }
  catch (const ExceptionObject & error)
  {
    std::cerr << error.GetDescription() << std::endl;
  }
  catch (const std::exception & error)
  {
    std::cerr << error.what() << std::endl;
  }
  return EXIT_FAILURE;
}
} // namespace itk::ShearWarpBenchmark

#endif
