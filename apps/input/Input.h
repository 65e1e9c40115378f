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
#ifndef Input_h
#define Input_h

#include "AnyImage.h"
#include "Warning.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

/** Reads a 3D image, or a series of them in time: a file, or a DICOM series of the folder \a path or of the folder of a
 * DICOMDIR, and of the folders in it. \a series is its number in the list that the error has if there are several, its
 * instance UID or, ignoring case, a part of its description; it may be empty if there is only one. \a volume is the
 * number of a volume of the series, likewise. Errors name the \a option that gave the series; an empty one stands for
 * no choice. Throws if something of the image is missing or damaged. */
Volume
ReadVolume(const std::filesystem::path & path,
           const std::string &           series,
           const WarningFunction &       warn,
           const std::string &           option = "--series",
           const std::string &           volume = "");

/** Whether a file is there and is sound DICOM. */
bool
IsDicomFile(const std::filesystem::path & path);

/** Reads an image of whole numbers that must lie on \a grid. The mask is 1 where that is \a label or, without one, not
 * 0; or, if there are \a removed labels, where it is none of these labels. \a sourceFiles gets the files that the mask
 * was made from, if its file names them. */
itk::Image<unsigned char, 3>::Pointer
ReadMask(const std::filesystem::path &        path,
         const std::optional<std::int64_t> &  label,
         const std::vector<std::int64_t> &    removed,
         const itk::ImageBase<3> *            grid,
         const WarningFunction &              warn,
         std::vector<std::filesystem::path> & sourceFiles);

#endif
