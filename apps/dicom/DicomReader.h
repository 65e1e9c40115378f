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
#ifndef DicomReader_h
#define DicomReader_h

#include <gdcmImageReader.h>

#include <optional>
#include <string>

/** GDCM's reader, which also reads label maps (PS3.3 C.8.20.2), whose SOP class GDCM does not know. They become other
 * segmentations. */
class DicomReader : public gdcm::ImageReader
{
public:
  bool
  Read() override;

  /** Reads a file once, with its pixels as they are stored. Returns whether the file is an image. Throws
   * std::runtime_error if a DICOM file is cut short or damaged. */
  bool
  ReadWhole(const std::string & path);
};

/** The header of a DICOM file, none if the file is of another kind. Throws std::runtime_error if the file begins as
 * DICOM does, but has no sound header. */
std::optional<gdcm::DataSet>
ReadSoundHeader(const std::string & path);

/** What the program says if the pixels of a file cannot be read. */
std::string
DescribeDicomDamage(const std::string & path, const std::string & reason);

/** Whether the pixels of a segmentation are numbers of segments. */
bool
IsLabelMap(const gdcm::DataSet & header);

#endif
