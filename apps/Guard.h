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
#ifndef Guard_h
#define Guard_h

#include <filesystem>
#include <functional>
#include <string>

/** Calls \a run in a process of its own, and returns its exit status. A damaged file can end the process whose library
 * parses the file, or keep the library busy for ever: see Parsing. Signals to end go to that process. \a refuse gets
 * what the program is to say if \a run cannot say it. Without POSIX, \a run is only called. */
int
RunGuarded(const std::function<int()> & run, const std::function<void(const std::string &)> & refuse);

/** Files and folders whose paths begin with \a begin are removed if the process of RunGuarded() is killed. */
void
RemoveIfKilled(const std::filesystem::path & begin);

/** Whether the message that comes now is new: if all begins anew, the first ones were said before. */
bool
IsNewMessage();

/** A library parses a file during this object's life. If that ends the process, \a refusal is what the program says. If
 * \a refusal is empty, all begins anew, and HasEndedParsing() tells of the file. */
class Parsing
{
public:
  explicit Parsing(const std::filesystem::path & path, const std::string & refusal = "");
  ~Parsing();
  Parsing(const Parsing &) = delete;
  Parsing &
  operator=(const Parsing &) = delete;

private:
  std::string m_OuterPath;
  std::string m_OuterRefusal;
};

/** Whether an earlier process ended while the file was parsed. */
bool
HasEndedParsing(const std::filesystem::path & path);

#endif
