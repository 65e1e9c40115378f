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
#include "InputFiles.h"

#include "FileFormat.h"
#include "FileStart.h"
#include "Text.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>

namespace
{
namespace fs = std::filesystem;

using Paths = std::vector<fs::path>;

/** Of x.img.gz, x.img. */
fs::path
WithoutGzip(const fs::path & path)
{
  return path.extension() == ".gz" ? path.stem() : path.filename();
}

bool
LooksLikeOutput(const fs::path & path)
{
  return FindFormat(path) != FileFormat::None;
}

/** The files of a folder, as far as it can be read, that do not look like outputs. */
Paths
ListFiles(const fs::path & folder)
{
  Paths           files;
  std::error_code error;
  for (fs::directory_iterator entry(folder.empty() ? "." : folder, error), end; !error && entry != end;
       entry.increment(error))
  {
    std::error_code ignored;
    if (entry->is_regular_file(ignored) && !LooksLikeOutput(entry->path()))
    {
      files.push_back(folder / entry->path().filename());
    }
  }
  return files;
}

/** Adds what \a text of the header of an NRRD or MetaImage file names: a file or, as slice%03d.raw 1 9, a series. */
void
AddNamedFiles(const fs::path & folder, const std::string & text, Paths & files)
{
  std::error_code ignored;
  if (fs::is_regular_file(folder / text, ignored))
  {
    files.push_back(folder / text);
  }
  const auto number = text.find('%');
  if (number != std::string::npos)
  {
    const fs::path start = folder / text.substr(0, number);
    for (const fs::path & file : ListFiles(start.parent_path()))
    {
      if (file.filename().string().find(start.filename().string()) == 0)
      {
        files.push_back(file);
      }
    }
  }
}

void
AddFilesOfHeader(const fs::path & path, Paths & files)
{
  const std::string start = ReadStart(path, 1 << 20);
  const auto        isBinary = [](char c) { return c >= '\0' && c < ' ' && c != '\t' && c != '\r'; };

  // headers that name files: of NRRD, which end with an empty line, and of MetaImage; or with a list of names
  std::istringstream lines(start);
  bool isLast = start.compare(0, 4, "NRRD") != 0 && path.extension() != ".mha" && path.extension() != ".mhd";
  bool isList = false;
  for (std::string line; !isLast && std::getline(lines, line) && std::none_of(line.begin(), line.end(), isBinary);)
  {
    line = Trim(line);
    const std::string value = Trim(line.substr(line.find_first_of(":=") + 1));
    isList = isList || value.compare(0, 4, "LIST") == 0;
    isLast = !isList && (line.empty() || line.compare(0, 15, "ElementDataFile") == 0);
    if (!line.empty() && line[0] != '#')
    {
      AddNamedFiles(path.parent_path(), line, files);
      AddNamedFiles(path.parent_path(), value, files);
    }
  }
}

void
AddFiles(const fs::path & folder, std::set<fs::path> & known, Paths & files)
{
  if (!known.insert(fs::canonical(folder)).second)
  {
    return;
  }
  std::set<fs::path> entries;
  for (const auto & entry : fs::directory_iterator(folder))
  {
    entries.insert(entry.path());
  }
  for (const fs::path & path : entries)
  {
    if (path.filename().string().front() == '.')
    {
      continue;
    }
    if (fs::is_directory(path))
    {
      AddFiles(path, known, files);
    }
    else
    {
      files.push_back(path);
    }
  }
}
} // namespace

std::string
JoinPaths(const Paths & paths)
{
  std::ostringstream text;
  text << std::hex << std::uppercase << std::setfill('0');
  for (const fs::path & path : paths)
  {
    text << (&path == &paths.front() ? "" : " ");
    for (const char byte : path.string())
    {
      const auto value = static_cast<unsigned char>(byte);
      if (value < 0x80 && (std::isalnum(value) != 0 || std::strchr("-._~/", byte)))
      {
        text << byte;
      }
      else
      {
        text << '%' << std::setw(2) << static_cast<int>(value);
      }
    }
  }
  return text.str();
}

Paths
SplitPaths(const std::string & text)
{
  Paths              paths;
  std::istringstream words(text);
  for (std::string word; words >> word;)
  {
    for (auto at = word.find('%'); at != std::string::npos; at = word.find('%', at + 1))
    {
      const long value = std::strtol(word.substr(at + 1, 2).c_str(), nullptr, 16);
      word.replace(at, 3, 1, static_cast<char>(value));
    }
    paths.emplace_back(word);
  }
  return paths;
}

Paths
FindFiles(const fs::path & folder)
{
  std::set<fs::path> known;
  Paths              files;
  AddFiles(folder, known, files);
  return files;
}

void
RequireReadable(const fs::path & path)
{
  const std::string name = "'" + path.string() + "'";
  if (!fs::exists(path))
  {
    throw std::runtime_error(name + " does not exist");
  }
  // ITK would wait for a pipe
  if (!fs::is_regular_file(path) && !fs::is_directory(path))
  {
    throw std::runtime_error(name + " is neither a file nor a folder");
  }
  if (fs::is_regular_file(path) && !std::ifstream(path))
  {
    throw std::runtime_error("cannot read " + name + ": " + std::generic_category().message(errno));
  }
}

fs::path
GetImageFolder(const fs::path & path)
{
  std::error_code ignored;
  if (fs::is_directory(path, ignored))
  {
    return path;
  }
  const bool isDirectory = ToLower(path.filename().string()) == "dicomdir" && fs::is_regular_file(path, ignored);
  return !isDirectory ? fs::path() : path.has_parent_path() ? path.parent_path() : ".";
}

void
RequireOutside(const fs::path & output, const fs::path & input)
{
  const fs::path folder = GetImageFolder(input);
  if (!folder.empty() &&
      *fs::weakly_canonical(fs::absolute(output)).lexically_relative(fs::canonical(folder)).begin() != "..")
  {
    throw std::runtime_error("cannot write '" + output.string() + "': it is in '" + folder.string() +
                             "', where images are searched; choose a folder elsewhere");
  }
}

Paths
FindInputFiles(const fs::path & path)
{
  std::error_code ignored;
  const fs::path  folder = GetImageFolder(path);
  if (!folder.empty())
  {
    Paths found = FindFiles(folder);
    found.erase(std::remove_if(found.begin(), found.end(), LooksLikeOutput), found.end());
    return found;
  }
  Paths files{ path };
  if (!fs::is_regular_file(path, ignored))
  {
    return files;
  }
  // data beside headers, as .hdr and .img
  for (const fs::path & file : ListFiles(path.parent_path()))
  {
    if (WithoutGzip(file).stem() == WithoutGzip(path).stem())
    {
      files.push_back(file);
    }
  }
  AddFilesOfHeader(path, files);
  return files;
}
