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
#ifndef TiffDescription_h
#define TiffDescription_h

#include <array>
#include <string>
#include <vector>

/** What the description of a TIFF file says of its pages. */
struct TiffDescription
{
  /** Who wrote it: ImageJ, OME, or nothing that is known. */
  std::string writer{};
  /** Channels, slices and points in time. */
  std::array<std::size_t, 3> size{ { 1, 1, 1 } };
  /** The pages of channel c, slice z and time t, at c + size[0] * (z + size[1] * t). */
  std::vector<std::size_t> pages{};
  /** The sides of a voxel, 0 if not given, and their units. */
  std::array<double, 3>      spacing{};
  std::array<std::string, 3> units{};
  /** In seconds, 0 if not given. */
  double timeSpacing{ 0.0 };
  /** Whether unsigned numbers of 16 bits are values plus 32768. */
  bool isSigned{ false };
  /** What the description says and the program does not follow; empty if nothing. */
  std::string ignored{};
};

/** Parses the text of the file \a fileName, which has \a pages of \a samples for each pixel. Throws if the text is
 * damaged, or if it says that planes are in other files. */
TiffDescription
ParseTiffDescription(const std::string & text, const std::string & fileName, std::size_t pages, std::size_t samples);

#endif
