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

#include <string>
#include <vector>

struct ProcessOutcome
{
  std::string said;
  bool        isGood;
};

/** Runs a program that has nothing to read: what it says to its standard output and, \a withErrors, to its standard
 * error. Throws if it cannot be started, or at a signal that is held. */
ProcessOutcome
RunProcess(const std::vector<std::string> & command, bool withErrors);

#endif
