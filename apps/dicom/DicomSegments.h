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
#ifndef DicomSegments_h
#define DicomSegments_h

#include "AnyImage.h"
#include "Warning.h"

#include "itkRGBPixel.h"

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>

/** Component and label. */
using SegmentKey = std::pair<unsigned int, std::uint64_t>;

struct Appearance
{
  std::string                                 name;
  std::optional<itk::RGBPixel<unsigned char>> colour;
};

/** What a file of segments has of them. */
struct SegmentFile
{
  Volume                           labels;
  std::map<SegmentKey, Appearance> appearances;
};

/** Reads a DICOM segmentation, a file or a folder with this one image: its segments' numbers as labels, in as many
 * layers as segments overlap. Frames may be in any order, and those without a pixel may be missing. A pixel is in a
 * segment if its fraction is at least a half (PS3.3 C.8.20). Nothing if \a path is another image; throws if the frames
 * do not lie on one grid. */
std::optional<SegmentFile>
ReadDicomSegments(const std::filesystem::path & path, const WarningFunction & warn);

#endif
