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
#ifndef Program_h
#define Program_h

#include <ostream>
#include <string>

/** The program shear-warp-mip with the arguments of main(), and what it prints: \a output is what was asked for,
 * \a messages are errors, warnings and progress. Returns the exit status, 0 or 1. */
int
RunProgram(int argc, const char * const * argv, std::ostream & output, std::ostream & messages);

/** Prints why the program ends. Returns the exit status, 1. */
int
RefuseToRun(std::ostream & messages, const std::string & reason);

#endif
