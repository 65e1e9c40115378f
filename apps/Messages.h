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
#ifndef Messages_h
#define Messages_h

#include "Projection.h"

#include <chrono>
#include <ostream>
#include <string>

/** What the program says, on one line each. */
class Messages
{
public:
  Messages(std::ostream & stream, bool verbose);
  Messages(const Messages &) = delete;
  Messages &
  operator=(const Messages &) = delete;

  /** Leaves nothing of a step on the terminal. */
  ~Messages();

  void
  Warn(const std::string & text) const;

  /** What has no effect, or may surprise. */
  void
  Note(const std::string & text) const;

  /** Says on a terminal what is under way. */
  void
  StepBegins(const std::string & text) const;

  /** Says what was done since the last call, and how long it took. */
  void
  StepDone(const std::string & text);

  void
  FramesDone(const FrameReport & report) const;

  /** Says it on a terminal, from a second after the last step on, ten times a second at most. */
  void
  Progress(std::size_t done, std::size_t all);

private:
  /** Writes a line, unless an earlier process did so: see IsNewMessage(). */
  void
  Say(const std::string & text) const;

  using Clock = std::chrono::steady_clock;

  std::ostream &    m_Stream;
  bool              m_IsVerbose;
  Clock::time_point m_Start;
  Clock::time_point m_Shown;
};

/** Size, spacing and pixel type. */
std::string
Describe(const AnyImage & image);

#endif
