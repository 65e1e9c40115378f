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
#include "HeldSignals.h"
#include "Posix.h"

#ifdef ShearWarpMIP_HAS_POSIX
#  include <sys/mman.h>
#  include <sys/time.h>
#  include <sys/wait.h>
#  include <unistd.h>
#  ifdef __linux__
#    include <sys/prctl.h>
#  endif
#endif

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <set>
#include <sstream>
#include <vector>

namespace
{
/** What both processes see. */
struct Parsed
{
  char path[1 << 14];
  char refusal[1 << 15];
  /** Of RemoveIfKilled(), each between two null characters, which no path has. */
  char        begins[1 << 16];
  std::size_t length;
  /** Number of messages. */
  unsigned int said;
};

Parsed *              parsed = nullptr; // none without a process of its own
std::set<std::string> endings;

template <std::size_t VSize>
void
Copy(const std::string & text, char (&to)[VSize])
{
  const std::size_t length = std::min(text.size(), VSize - 1);
  std::copy_n(text.begin(), length, to);
  to[length] = '\0';
}

void
SetParsed(const std::string & path, const std::string & refusal)
{
  // a path is there only with its refusal
  parsed->path[0] = '\0';
  Copy(refusal, parsed->refusal);
  Copy(path, parsed->path);
}

#ifdef ShearWarpMIP_HAS_POSIX
constexpr int abortStatus = 134; // as a shell has it

volatile std::sig_atomic_t child = 0;
volatile std::sig_atomic_t lastSignal = 0;

extern "C" void
PassSignal(int signal)
{
  lastSignal = signal;
  if (child > 0)
  {
    kill(static_cast<pid_t>(child), signal);
  }
}

using Handler = void (*)(int);

/** Signals that are ignored stay so. */
std::vector<Handler>
HandleSignals()
{
  std::vector<Handler> previous;
  for (const int signal : endingSignals)
  {
    previous.push_back(std::signal(signal, PassSignal));
    if (previous.back() == SIG_IGN)
    {
      std::signal(signal, SIG_IGN);
    }
  }
  return previous;
}

void
PrepareChild(const std::vector<Handler> & handlers, [[maybe_unused]] pid_t parent)
{
  for (std::size_t n = 0; n < handlers.size(); ++n)
  {
    std::signal(endingSignals[n], handlers[n]);
  }
  if (lastSignal != 0)
  {
    // it came before
    std::raise(lastSignal);
  }
  // a file that gets larger than is allowed is like one on a full disk
  std::signal(SIGXFSZ, SIG_IGN);
  // no core is dumped
  std::signal(SIGABRT, [](int) { std::_Exit(abortStatus); });
#  ifdef __linux__
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent)
  {
    std::_Exit(EXIT_FAILURE);
  }
#  endif
}

int
Wait(pid_t process)
{
  int status = 0;
  while (waitpid(process, &status, 0) < 0 && errno == EINTR)
  {
  }
  return status;
}

/** Whether a library ended the process, and nobody from outside. */
bool
IsCrash(int status)
{
  const auto crashes = { SIGABRT, SIGPROF, SIGBUS, SIGFPE, SIGILL, SIGSEGV };
  return WIFSIGNALED(status) ? std::find(crashes.begin(), crashes.end(), WTERMSIG(status)) != crashes.end()
                             : WEXITSTATUS(status) == abortStatus;
}

/** Removes what a process has not finished: see RemoveIfKilled(). */
void
RemoveUnfinished()
{
  std::istringstream begins(std::string(parsed->begins, parsed->length));
  for (std::string name; std::getline(begins, name, '\0');)
  {
    if (name.empty())
    {
      continue;
    }
    const std::filesystem::path begin(name);
    const auto                  folder = begin.parent_path();
    std::error_code             ignored;
    for (const auto & entry : std::filesystem::directory_iterator(folder.empty() ? "." : folder, ignored))
    {
      if (entry.path().filename().string().find(begin.filename().string()) == 0)
      {
        std::filesystem::remove_all(entry.path(), ignored);
      }
    }
  }
  parsed->length = 0;
}

/** Ends this process as the other one was ended. */
int
EndLike(int status)
{
  if (WIFSIGNALED(status))
  {
    std::signal(WTERMSIG(status), SIG_DFL);
    std::raise(WTERMSIG(status));
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : EXIT_FAILURE;
}
#endif

/** Has the process end if a library computes for more than a minute, and a second for each MB of the file. */
void
LimitTime([[maybe_unused]] const std::string & path)
{
#ifdef ShearWarpMIP_HAS_POSIX
  std::error_code error;
  const auto      size = path.empty() ? 0 : std::filesystem::file_size(path, error);
  itimerval       limit{};
  limit.it_value.tv_sec = path.empty() ? 0 : 60 + (error ? 0 : static_cast<time_t>(size >> 20));
  setitimer(ITIMER_PROF, &limit, nullptr);
#endif
}
} // namespace

int
RunGuarded(const std::function<int()> & run, [[maybe_unused]] const std::function<void(const std::string &)> & refuse)
{
#ifdef ShearWarpMIP_HAS_POSIX
  void * const memory = mmap(nullptr, sizeof(Parsed), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED)
  {
    return run();
  }
  parsed = static_cast<Parsed *>(memory);
  const auto  handlers = HandleSignals();
  const pid_t parent = getpid();
  while (true)
  {
    SetParsed("", "");
    const pid_t process = fork();
    if (process == 0)
    {
      PrepareChild(handlers, parent);
      return run();
    }
    if (process < 0)
    {
      refuse("cannot start a process");
      return EXIT_FAILURE;
    }
    child = process;
    if (lastSignal != 0)
    {
      kill(process, lastSignal);
    }
    const int status = Wait(process);
    child = 0;
    if (WIFSIGNALED(status) || IsCrash(status))
    {
      RemoveUnfinished();
    }
    if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL)
    {
      refuse("the program was killed; is there too little memory?");
      return EXIT_FAILURE;
    }
    if (!IsCrash(status))
    {
      return EndLike(status);
    }
    const std::string path = parsed->path;
    const std::string refusal = parsed->refusal;
    if (path.empty() || !refusal.empty() || !endings.insert(path).second)
    {
      refuse(refusal.empty() ? "the program ended by a fault of its own" : refusal);
      return EXIT_FAILURE;
    }
  }
#else
  return run();
#endif
}

void
RemoveIfKilled(const std::filesystem::path & begin)
{
  if (!parsed)
  {
    return;
  }
  const std::string name = '\0' + begin.string() + '\0';
  const std::string begins(parsed->begins, parsed->length);
  if (begins.find(name) == std::string::npos && begins.size() + name.size() <= sizeof(parsed->begins))
  {
    std::copy(name.begin(), name.end(), parsed->begins + parsed->length);
    parsed->length += name.size();
  }
}

bool
IsNewMessage()
{
  static unsigned int count = 0;
  ++count;
  if (parsed)
  {
    const bool isNew = count > parsed->said;
    parsed->said = std::max(count, parsed->said);
    return isNew;
  }
  return true;
}

Parsing::Parsing(const std::filesystem::path & path, const std::string & refusal)
{
  if (parsed)
  {
    m_OuterPath = parsed->path;
    m_OuterRefusal = parsed->refusal;
    SetParsed(path.string(), refusal);
    LimitTime(path.string());
  }
}

Parsing::~Parsing()
{
  if (parsed)
  {
    SetParsed(m_OuterPath, m_OuterRefusal);
    LimitTime(m_OuterPath);
  }
}

bool
HasEndedParsing(const std::filesystem::path & path)
{
  return endings.count(path.string()) > 0;
}
