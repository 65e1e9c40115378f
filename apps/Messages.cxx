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
#include "Messages.h"
#include "Guard.h"
#include "Posix.h"
#include "Text.h"

#include <iomanip>
#include <sstream>

#ifdef ShearWarpMIP_HAS_POSIX
#  include <unistd.h>
#endif

namespace
{
bool
IsTerminal()
{
#ifdef ShearWarpMIP_HAS_POSIX
  return isatty(STDERR_FILENO) == 1;
#else
  return false;
#endif
}

// to the line's begin, and no text behind
constexpr auto clearLine = "\r\033[K";

std::string
Milliseconds(double seconds)
{
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << 1000.0 * seconds << " ms";
  return text.str();
}
} // namespace

Messages::Messages(std::ostream & stream, bool verbose)
  : m_Stream(stream)
  , m_IsVerbose(verbose)
  , m_Start(Clock::now())
  , m_Shown(m_Start)
{}

Messages::~Messages()
{
  this->StepBegins("");
}

void
Messages::Say(const std::string & text) const
{
  if (IsNewMessage())
  {
    m_Stream << (IsTerminal() ? clearLine : "") << MakeOneLine(text) << std::endl;
  }
}

void
Messages::Warn(const std::string & text) const
{
  this->Say("shear-warp-mip: warning: " + text);
}

void
Messages::Note(const std::string & text) const
{
  this->Say("shear-warp-mip: note: " + text);
}

void
Messages::StepBegins(const std::string & text) const
{
  if (!m_IsVerbose && IsTerminal())
  {
    m_Stream << clearLine << text << std::flush;
  }
}

void
Messages::StepDone(const std::string & text)
{
  const auto now = Clock::now();
  if (m_IsVerbose)
  {
    this->Say(text + ": " + Milliseconds(std::chrono::duration<double>(now - m_Start).count()));
  }
  StepBegins("");
  m_Start = now;
}

void
Messages::FramesDone(const FrameReport & report) const
{
  if (m_IsVerbose)
  {
    m_Stream << (report.end - report.begin > 1 ? "frames " : "frame ") << report.begin;
    if (report.end - report.begin > 1)
    {
      m_Stream << " to " << report.end - 1;
    }
    m_Stream << ": axis " << report.principalAxis << ", "
             << (report.preparationSeconds > 0.0 ? "volume prepared in " + Milliseconds(report.preparationSeconds)
                                                 : "nothing to prepare")
             << ", projected in " << Milliseconds(report.projectionSeconds) << ", warped in "
             << Milliseconds(report.warpSeconds) << std::endl;
  }
}

void
Messages::Progress(std::size_t done, std::size_t all)
{
  using namespace std::chrono_literals;
  const auto now = Clock::now();
  if (now - m_Start < 1s || now - m_Shown < 100ms)
  {
    return;
  }
  m_Shown = now;
  this->StepBegins("projected " + std::to_string(done) + " of " + std::to_string(all));
}

std::string
Describe(const AnyImage & image)
{
  std::ostringstream text;
  text << image.image->GetLargestPossibleRegion().GetSize() << " voxels, spacing " << image.image->GetSpacing()
       << " mm, " << itk::ImageIOBase::GetComponentTypeAsString(image.componentType);
  if (image.image->GetNumberOfComponentsPerPixel() > 1)
  {
    text << " x " << image.image->GetNumberOfComponentsPerPixel();
  }
  return text.str();
}
