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
#include "Program.h"

#include "itkObject.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <new>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

// Arguments, one a line or ending with a NUL, and after an empty line the transform file view.tfm. The program works on
// a small image in.mha and says in one line what is wrong, with no file left behind, or writes its output.

namespace
{
namespace fs = std::filesystem;

std::atomic<std::size_t> memoryLimit{ std::numeric_limits<std::size_t>::max() };

const std::string image = "ObjectType = Image\nNDims = 3\nDimSize = 4 3 2\nElementSpacing = 0.5 1 2\n"
                          "ElementType = MET_SHORT\nElementDataFile = LOCAL\n"
                          "These are 48 bytes: the voxels of a small image.";

/** The inner one of two, so that the program finds nothing where ".." leads. */
const fs::path &
GetFolder()
{
  static const fs::path folder = [] {
    std::string name = (fs::temp_directory_path() / "shear-warp-mip-fuzz-XXXXXX").string();
    if (!mkdtemp(name.data()))
    {
      std::abort();
    }
    const fs::path inner = fs::path(name) / "inner";
    fs::create_directory(inner);
    return inner;
  }();
  return folder;
}

void
Require(bool condition, const std::string & property, const std::string & got)
{
  if (!condition)
  {
    std::cerr << "not so: " << property << ": " << got << std::endl;
    std::abort();
  }
}

/** No path leads out of the current folder. */
std::vector<std::string>
SplitArguments(std::string text)
{
  std::replace(text.begin(), text.end(), '/', '_');
  std::replace(text.begin(), text.end(), '~', '_');
  std::replace(text.begin(), text.end(), '\0', '\n');
  std::vector<std::string> arguments{ "shear-warp-mip" };
  std::istringstream       lines(text);
  for (std::string line; std::getline(lines, line);)
  {
    arguments.push_back(line);
  }
  return arguments;
}

std::set<std::string>
GetFiles()
{
  std::set<std::string> files;
  for (const auto & entry : fs::directory_iterator("."))
  {
    files.insert(entry.path().filename().string());
  }
  return files;
}
} // namespace

// The program sees a computer with little memory; AddressSanitizer's own operators do not throw.
void *
operator new(std::size_t size)
{
  void * const memory = size <= memoryLimit ? std::malloc(size) : nullptr;
  return memory ? memory : throw std::bad_alloc();
}

void *
operator new[](std::size_t size)
{
  return operator new(size);
}

void
operator delete(void * memory) noexcept
{
  std::free(memory);
}

void
operator delete(void * memory, std::size_t) noexcept
{
  std::free(memory);
}

void
operator delete[](void * memory) noexcept
{
  std::free(memory);
}

void
operator delete[](void * memory, std::size_t) noexcept
{
  std::free(memory);
}

// what the other operators allocate is freed here too
extern "C" const char *
__asan_default_options()
{
  return "alloc_dealloc_mismatch=0";
}

extern "C" int
LLVMFuzzerInitialize(int *, char ***)
{
  itk::Object::SetGlobalWarningDisplay(false);
  std::cout.rdbuf(nullptr);
  fs::current_path(GetFolder());
  std::atexit([] { fs::remove_all(GetFolder().parent_path()); });
  return 0;
}

extern "C" int
LLVMFuzzerTestOneInput(const std::uint8_t * data, std::size_t size)
{
  const std::string text(reinterpret_cast<const char *>(data), size);
  // a long series is no fault
  static const std::regex manyFrames("--frames[=\n][^\n]{3}|--sliding-slab[=\n][^\n]*\n[^\n]*[.e]");
  if (std::regex_search(text, manyFrames))
  {
    return -1;
  }
  const auto                     end = std::min(text.find("\n\n"), size);
  const std::vector<std::string> arguments = SplitArguments(text.substr(0, end));
  std::vector<const char *>      argv;
  for (const std::string & argument : arguments)
  {
    argv.push_back(argument.c_str());
  }

  std::ofstream("in.mha", std::ios::binary) << image;
  std::ofstream("view.tfm", std::ios::binary) << text.substr(std::min(end + 2, size));
  const auto         before = GetFiles();
  std::ostringstream output;
  std::ostringstream messages;
  memoryLimit = 1 << 22;
  const int status = RunProgram(static_cast<int>(argv.size()), argv.data(), output, messages);
  memoryLimit = std::numeric_limits<std::size_t>::max();
  const auto after = GetFiles();

  const std::string said = messages.str();
  Require(status == 0 || status == 1, "the exit status is 0 or 1", std::to_string(status));
  if (status == 1)
  {
    const auto last = said.rfind('\n', said.size() - 2) + 1;
    Require(!said.empty() && said.back() == '\n' && said.compare(last, 16, "shear-warp-mip: ") == 0 &&
              said.compare(last + 16, 8, "warning:") != 0,
            "a message ends what is said",
            said);
    Require(before == after, "nothing is written but all", said);
  }
  for (const std::string & name : after)
  {
    Require(name.compare(0, 16, ".shear-warp-mip-") != 0, "no temporary file is left", name);
    fs::remove_all(name);
  }
  return 0;
}
