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
#include "Process.h"
#include "HeldSignals.h"
#include "Posix.h"

#include <cerrno>
#include <csignal>
#include <stdexcept>
#include <system_error>

#ifdef ShearWarpMIP_HAS_POSIX
#  include <fcntl.h>
#  include <poll.h>
#  include <spawn.h>
#  include <sys/wait.h>
#  include <unistd.h>
extern char ** environ; // NOLINT(readability-redundant-declaration): POSIX has programs declare it

ProcessOutcome
RunProcess(const std::vector<std::string> & command, bool withErrors)
{
  std::vector<char *> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string & argument : command)
  {
    arguments.push_back(const_cast<char *>(argument.c_str()));
  }
  arguments.push_back(nullptr);

  int ends[2];
  if (pipe(ends) != 0)
  {
    throw std::system_error(errno, std::generic_category());
  }
  // one may have the number of a stream that is closed here
  for (const int end : ends)
  {
    fcntl(end, F_SETFD, FD_CLOEXEC);
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  if (withErrors)
  {
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  }
  else
  {
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  }
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  pid_t     child = 0;
  const int error = posix_spawn(&child, arguments.front(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (error != 0)
  {
    close(ends[0]);
    throw std::system_error(error, std::generic_category(), "cannot start '" + command.front() + '\'');
  }

  std::string said;
  bool        isOpen = true;
  while (isOpen && !HeldSignals::HaveCome())
  {
    constexpr int milliseconds = 50;
    pollfd        end{ ends[0], POLLIN, 0 };
    if (poll(&end, 1, milliseconds) > 0)
    {
      char       text[4096];
      const auto length = read(ends[0], text, sizeof(text));
      isOpen = length > 0;
      said.append(text, isOpen ? static_cast<std::size_t>(length) : 0);
    }
  }
  close(ends[0]);
  if (isOpen)
  {
    kill(child, SIGKILL);
  }
  int   status = 0;
  pid_t ended = 0;
  do
  {
    ended = waitpid(child, &status, 0);
  } while (ended < 0 && errno == EINTR);
  HeldSignals::RequireNone();
  return { said, status == 0 };
}
#else
ProcessOutcome
RunProcess(const std::vector<std::string> &, bool)
{
  throw std::runtime_error("this build cannot start other programs");
}
#endif
