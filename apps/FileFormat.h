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
#ifndef FileFormat_h
#define FileFormat_h

#include <filesystem>
#include <set>
#include <string>

/** Stands for the standard output, which gets a NRRD. */
constexpr const char * StandardOutput = "-";

/** What the name of a file ends with, in small letters, with two parts where it is compressed: its format. */
std::string
GetExtension(const std::filesystem::path & path);

enum class FileFormat
{
  None,
  Values,
  Picture,
  Animation,
  Page
};

/** The format of a name, by its extension. */
FileFormat
FindFormat(const std::filesystem::path & path);

/** All extensions of \a formats, with a space before each. */
std::string
ListExtensions(const std::set<FileFormat> & formats);

#endif
