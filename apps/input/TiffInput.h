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
#ifndef TiffInput_h
#define TiffInput_h

#include "AnyImage.h"
#include "Warning.h"

#include <filesystem>

/** Whether a file begins as TIFF or BigTIFF does. */
bool
LooksLikeTiff(const std::filesystem::path & path);

/** Reads the pages of a TIFF file, but not reduced copies and masks, as slices. The descriptions of ImageJ and OME say
 * which channel, slice and point in time a page is, and how large a voxel is; without them the resolution gives the
 * size of pixels, and slices are 1 mm apart. Channels become components. Colours of a palette become red, green and
 * blue; opacity is left out. Throws if a page is missing, damaged or unlike the first, or if pages are in other files.
 */
Volume
ReadTiff(const std::filesystem::path & path, const WarningFunction & warn);

#endif
