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
#ifndef DicomFolder_h
#define DicomFolder_h

#include "Warning.h"

#include <filesystem>
#include <string>
#include <vector>

/** The images of a DICOM series, in the order of their paths, of a folder and those in it. \a series is as in
 * ReadVolume, and so is \a option. What is no image is left out; a copy of an image is too. Throws if the series cannot
 * be told, or if a file is damaged that might be one of its images. */
std::vector<std::string>
FindSeries(const std::filesystem::path & folder,
           const std::string &           series,
           const WarningFunction &       warn,
           const std::string &           option);

#endif
