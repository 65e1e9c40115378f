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
#include "HeldSignals.h"
#include "Posix.h"

#include <csignal>
#include <cstddef>
#include <stdexcept>

namespace
{
volatile std::sig_atomic_t heldSignal = 0;

extern "C" void
HoldSignal(int signal)
{
  heldSignal = signal;
}

bool
IsIgnored([[maybe_unused]] int signal)
{
#ifdef ShearWarpMIP_HAS_POSIX
  struct sigaction action{};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
#else
  return false;
#endif
}
} // namespace

HeldSignals::HeldSignals()
{
  for (const int signal : endingSignals)
  {
    m_Previous.push_back(std::signal(signal, IsIgnored(signal) ? SIG_IGN : HoldSignal));
  }
}

HeldSignals::~HeldSignals()
{
  for (std::size_t n = 0; n < m_Previous.size(); ++n)
  {
    std::signal(endingSignals[n], m_Previous[n]);
  }
  if (HaveCome())
  {
    std::raise(heldSignal);
  }
}

bool
HeldSignals::HaveCome()
{
  return heldSignal != 0;
}

void
HeldSignals::RequireNone()
{
  if (HaveCome())
  {
    throw std::runtime_error("interrupted");
  }
}
