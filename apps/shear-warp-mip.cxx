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
#include "Guard.h"
#include "Posix.h"
#include "Program.h"

#include "itkObject.h"

#ifdef ShearWarpMIP_HAS_POSIX
#  include <fcntl.h>
#  include <unistd.h>
#endif

#include <cstdio>
#include <iostream>

int
main(int argc, char * argv[])
{
#ifdef ShearWarpMIP_HAS_POSIX
  // no file becomes a standard stream that is closed
  for (const int stream : { STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO })
  {
    if (fcntl(stream, F_GETFD) < 0)
    {
      open("/dev/null", O_RDONLY);
    }
  }
#endif
  std::ostream output(std::cout.rdbuf());
  std::ostream messages(std::cerr.rdbuf());
  // libraries that ITK uses write what they like to the standard streams
  std::cout.rdbuf(nullptr);
  std::cerr.rdbuf(nullptr);
#ifdef __GLIBC__
  stderr = std::fopen("/dev/null", "w");
#endif
  itk::Object::SetGlobalWarningDisplay(false);
  return RunGuarded([&] { return RunProgram(argc, argv, output, messages); },
                    [&](const std::string & refusal) { RefuseToRun(messages, refusal); });
}
