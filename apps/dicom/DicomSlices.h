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
#ifndef DicomSlices_h
#define DicomSlices_h

#include "AnyImage.h"

#include <gdcmDataSet.h>
#include <gdcmImage.h>
#include <gdcmSmartPointer.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/** A file with an image. */
struct Source
{
  std::string                 path;
  gdcm::DataSet               header;
  std::array<unsigned int, 3> size{};
  unsigned int                components{ 1 };
  itk::IOComponentEnum        storedType{ itk::IOComponentEnum::UNKNOWNCOMPONENTTYPE };
  gdcm::PixelFormat           format;
  /** Of the frames that a codec decodes, by their streams; one if it is for all. */
  std::vector<gdcm::PixelFormat> streams{};
  /** Of all frames, or the first. */
  double slope{ 1.0 };
  double intercept{ 0.0 };
  /** Whether ITK makes the pixels: colours and bits. */
  bool isConverted{ false };
  /** The pixels as they are in the file, until TakeStored(). */
  gdcm::SmartPointer<gdcm::Image> image{};
};

struct Slice
{
  const Source *       source;
  std::size_t          frame;
  double               slope;
  double               intercept;
  itk::IOComponentEnum type;
  bool                 isRescaled{ false };
  /** Of rows, of columns, and the normal. */
  std::array<itk::Vector<double, 3>, 3> directions{};
  itk::Vector<double, 3>                origin{};
  /** Of columns and rows. */
  std::array<double, 2> spacing{};
  /** 0 if it is not known. */
  double thickness{ 0.0 };
  /** Along the normal of the first. */
  double position{ 0.0 };
  /** The number of the segment of which a segmentation's frame is; 0 in others. */
  std::uint16_t segment{ 0 };
};

/** A file with an image, which is read once; none if it is no image. Throws if the file is damaged, or if its
 * attributes contradict its pixels. */
std::optional<Source>
ReadSource(const std::string & path);

/** The slices of a file. Attributes are in the functional groups of the frame or of all frames (PS3.3 C.7.6.16), or in
 * the file itself, or with the detector. */
std::vector<Slice>
GetSlices(const Source & source);

/** The attributes that have a value for each frame, such as the number of its slice or its time (PS3.3 C.7.6.6). */
std::vector<gdcm::Tag>
GetFrameVectors(const gdcm::DataSet & header);

/** The file, and the frame if there are several. */
std::string
GetName(const Slice & slice);

/** Throws if the slices cannot be of one volume. */
void
RequireLikeness(const Slice & slice, const Slice & first);

/** The pixels of all frames as they are stored, for a single call: their memory in \a source is released. Bits that a
 * codec delivers are read as the attributes say. Throws if the stream can mean other values. */
std::vector<char>
TakeStored(const Source & source);

/** The data set in the first item of a sequence, empty if there is none. */
gdcm::DataSet
GetItem(const gdcm::DataSet & dataSet, const gdcm::Tag & tag);

#endif
