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
#ifndef FileStart_h
#define FileStart_h

#include "Text.h"

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

/** The first \a count bytes of a file, or as many as can be read. */
inline std::string
ReadStart(const std::filesystem::path & path, std::size_t count)
{
  std::string   start(count, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(start.data(), static_cast<std::streamsize>(count));
  start.resize(static_cast<std::size_t>(file.gcount()));
  return start;
}

/** Characters of a field of MetaImage: MetaIO takes less than 32768. */
constexpr std::size_t LongestMetaText = 32000;

/** Whether a file begins as DICOM does. */
inline bool
HasPreamble(const std::filesystem::path & path)
{
  const std::string start = ReadStart(path, 132);
  return start.size() == 132 && start.compare(128, 4, "DICM") == 0;
}

/** Whether a file is called DICOM, or begins as DICOM does. */
inline bool
LooksLikeDicom(const std::filesystem::path & path)
{
  return path.extension() == ".dcm" || HasPreamble(path);
}

/** The fields of the text that a file of NRRD or MetaImage begins with. \a end gets the place behind this text. */
inline std::map<std::string, std::string>
ReadFields(const std::filesystem::path & path, std::streamoff * end = nullptr)
{
  std::ifstream                      file(path, std::ios::binary);
  std::map<std::string, std::string> fields;
  for (std::string line; fields.count("ElementDataFile") == 0 && std::getline(file, line) && !Trim(line).empty();)
  {
    const auto separator = line.find_first_of(":=");
    if (separator != std::string::npos)
    {
      fields[Trim(line.substr(0, separator))] = Trim(line.substr(separator + 1));
    }
  }
  if (end)
  {
    *end = file.tellg();
  }
  return fields;
}

#endif
