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
#ifndef InputFiles_h
#define InputFiles_h

#include <filesystem>
#include <vector>

/** What is in a folder and in its folders, in the order of the paths, but nothing whose name begins with a point. Links
 * are followed, to each folder once. */
std::vector<std::filesystem::path>
FindFiles(const std::filesystem::path & folder);

/** Names of files as one text: a word each, in which bytes other than letters, digits and -._~/ are %XX (RFC 3986). */
std::string
JoinPaths(const std::vector<std::filesystem::path> & paths);

/** The names that JoinPaths() made a text of. */
std::vector<std::filesystem::path>
SplitPaths(const std::string & text);

/** Throws if \a path is no file or folder, or no file that can be read. */
void
RequireReadable(const std::filesystem::path & path);

/** The folder where the images of \a path are: itself, or the folder of a DICOMDIR. Empty if \a path is neither. */
std::filesystem::path
GetImageFolder(const std::filesystem::path & path);

/** The files that are there and are read for the image or transform \a path: the files of its image folder; or the
 * file, others of its name, and those that its header names. In the first two cases none with an extension of an
 * output. */
std::vector<std::filesystem::path>
FindInputFiles(const std::filesystem::path & path);

/** Throws if the new folder \a output is in the image folder of \a input. */
void
RequireOutside(const std::filesystem::path & output, const std::filesystem::path & input);

#endif
