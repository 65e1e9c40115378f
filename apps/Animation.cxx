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
#include "Animation.h"

#include "Output.h"
#include "Posix.h"

#include "itksys/SystemTools.hxx"

#include <cerrno>
#include <csignal>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#ifdef ShearWarpMIP_HAS_POSIX
#  include <fcntl.h>
#  include <poll.h>
#  include <spawn.h>
#  include <sys/wait.h>
#  include <unistd.h>
extern char ** environ; // NOLINT(readability-redundant-declaration): POSIX has programs declare it
#endif

namespace
{
using Arguments = std::vector<std::string>;

const std::string gray = "gray";

#ifdef ShearWarpMIP_HAS_POSIX
std::string
FindEncoder()
{
  return itksys::SystemTools::FindProgram("ffmpeg");
}

/** Runs a program that has nothing to say if all is well. Throws, with what it said, if it is not, or at a signal. */
void
RunQuietly(const Arguments & arguments)
{
  std::vector<char *> command;
  for (const std::string & argument : arguments)
  {
    command.push_back(const_cast<char *>(argument.c_str()));
  }
  command.push_back(nullptr);

  int ends[2];
  if (pipe(ends) != 0)
  {
    throw std::system_error(errno, std::generic_category());
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  posix_spawn_file_actions_addclose(&actions, ends[0]);
  posix_spawn_file_actions_addclose(&actions, ends[1]);
  pid_t     child = 0;
  const int error = posix_spawn(&child, command.front(), &actions, nullptr, command.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);

  std::string said;
  bool        isOpen = error == 0;
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
  int status = error;
  if (error == 0)
  {
    if (isOpen)
    {
      kill(child, SIGKILL);
    }
    waitpid(child, &status, 0);
  }
  HeldSignals::RequireNone();
  if (status != 0 || !said.empty())
  {
    throw std::runtime_error(arguments.front() + " failed: " + said);
  }
}
#else
std::string
FindEncoder()
{
  return "";
}

void
RunQuietly(const Arguments &)
{}
#endif

Arguments
ChooseEncoding(const std::string & extension, const std::string & pixels)
{
  if (extension == ".mp4")
  {
    // sizes must be even
    return { "-vf",       "pad=ceil(iw/2)*2:ceil(ih/2)*2",
             "-c:v",      "libx264",
             "-crf",      "18",
             "-pix_fmt",  "yuv420p",
             "-movflags", "+faststart",
             "-f",        "mp4" };
  }
  if (extension == ".apng")
  {
    return { "-pix_fmt", pixels, "-pred", "mixed", "-plays", "0", "-f", "apng" };
  }
  return pixels == gray ? Arguments{ "-pix_fmt", pixels, "-f", "gif" }
                        : Arguments{ "-vf", "split[a][b];[a]palettegen[p];[b][p]paletteuse", "-f", "gif" };
}
} // namespace

void
RequireAnimationEncoder()
{
  if (FindEncoder().empty())
  {
    throw std::runtime_error("an animation needs the program ffmpeg, which is not installed");
  }
}

void
EncodeAnimation(const AnyImage &              pictures,
                double                        rate,
                const std::filesystem::path & raw,
                const std::filesystem::path & path)
{
  auto &             pixels = *CastImage<unsigned char>(pictures).GetPixelContainer();
  const auto         size = pictures.image->GetLargestPossibleRegion().GetSize();
  const std::string  format = pictures.image->GetNumberOfComponentsPerPixel() == 3 ? "rgb24" : gray;
  std::ofstream      file(raw, std::ios::binary);
  std::ostringstream sizeText;
  std::ostringstream rateText;
  sizeText << size[0] << 'x' << size[1];
  rateText << rate;
  file.write(reinterpret_cast<const char *>(pixels.GetBufferPointer()), static_cast<std::streamsize>(pixels.Size()));
  file.close();
  if (!file)
  {
    throw std::runtime_error("cannot write the pictures; is the disk full?");
  }

  Arguments arguments{
    FindEncoder(),         "-nostdin", "-v",          "error",        "-y",         "-f",           "rawvideo",
    "-pixel_format",       format,     "-video_size", sizeText.str(), "-framerate", rateText.str(), "-i",
    "file:" + raw.string()
  };
  const Arguments encoding = ChooseEncoding(path.extension().string(), format);
  arguments.insert(arguments.end(), encoding.begin(), encoding.end());
  arguments.insert(arguments.end(), { "-bitexact", "file:" + path.string() });
  RunQuietly(arguments);
  // it does not notice each full disk
  RunQuietly({ FindEncoder(), "-nostdin", "-v", "error", "-i", "file:" + path.string(), "-f", "null", "-" });
}
