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

#include "Posix.h"
#include "Process.h"

#include "itksys/SystemTools.hxx"

#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace
{
using Arguments = std::vector<std::string>;

const std::string gray = "gray";

std::string
FindEncoder()
{
#ifdef ShearWarpMIP_HAS_POSIX
  return itksys::SystemTools::FindProgram("ffmpeg");
#else
  return "";
#endif
}

/** Runs a program that has nothing to say if all is well. */
void
RunQuietly(const Arguments & arguments)
{
  const ProcessOutcome outcome = RunProcess(arguments, true);
  if (!outcome.isGood || !outcome.said.empty())
  {
    throw std::runtime_error(arguments.front() + " failed: " + outcome.said);
  }
}

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
