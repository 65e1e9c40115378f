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
#ifndef HeldSignals_h
#define HeldSignals_h

#include <csignal>
#include <vector>

/** The signals that end a program from outside. */
constexpr int endingSignals[] = { SIGINT,
                                  SIGTERM,
#ifdef SIGHUP
                                  SIGHUP,
                                  SIGPIPE,
                                  SIGQUIT
#endif
};

/** Holds back the signals that end a program: the process gets them at the end of
 * this object's life. */
class HeldSignals
{
public:
  HeldSignals();
  ~HeldSignals();
  HeldSignals(const HeldSignals &) = delete;
  HeldSignals &
  operator=(const HeldSignals &) = delete;

  /** Whether one came. */
  static bool
  HaveCome();

  /** Throws if a signal came. */
  static void
  RequireNone();

private:
  std::vector<void (*)(int)> m_Previous;
};

#endif
