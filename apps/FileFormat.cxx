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
#include "FileFormat.h"

#include "Text.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace
{
const std::vector<std::pair<std::string, FileFormat>> extensions = {
  { ".mha", FileFormat::Values },    { ".nrrd", FileFormat::Values },    { ".nii", FileFormat::Values },
  { ".nii.gz", FileFormat::Values }, { ".png", FileFormat::Picture },    { ".jpg", FileFormat::Picture },
  { ".jpeg", FileFormat::Picture },  { ".tif", FileFormat::Picture },    { ".tiff", FileFormat::Picture },
  { ".gif", FileFormat::Animation }, { ".apng", FileFormat::Animation }, { ".mp4", FileFormat::Animation },
  { ".html", FileFormat::Page }
};
} // namespace

std::string
GetExtension(const std::filesystem::path & path)
{
  if (path == StandardOutput)
  {
    return ".nrrd";
  }
  const std::string last = ToLower(path.extension().string());
  return (last == ".gz" ? ToLower(path.stem().extension().string()) : "") + last;
}

FileFormat
FindFormat(const std::filesystem::path & path)
{
  const std::string name = GetExtension(path);
  const auto        found =
    std::find_if(extensions.begin(), extensions.end(), [&name](const auto & entry) { return entry.first == name; });
  return found == extensions.end() ? FileFormat::None : found->second;
}

std::string
ListExtensions(const std::set<FileFormat> & formats)
{
  std::string list;
  for (const auto & [name, format] : extensions)
  {
    list += formats.count(format) > 0 ? ' ' + name : "";
  }
  return list;
}
