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
#ifndef DicomInput_h
#define DicomInput_h

#include "AnyImage.h"
#include "Warning.h"

#include <filesystem>
#include <string>

#include "itkMetaDataDictionary.h"

/** Reads a 3D image from a DICOM file, or a series of a folder as ReadVolume does. The file must be intact.
 *
 * Its slices are the frames of the files. Each has a position, an orientation and pixel spacing of its own, which are
 * read here: ITK takes unit vectors, 1 mm and the first frame's for what is missing or differs. Slices are sorted by
 * position along their normal, frames of a single file in the direction in which they are stored. Where the positions
 * are sheared, as with a tilted gantry, so is the image: its third axis is from slice to slice. Where slices have
 * several distances, as in a CT of a head, they are interpolated.
 *
 * Pixels have the values of the modality, by the rescaling of each frame, also where low ones are to be displayed white
 * (MONOCHROME1). Their type is ITK's; it is double where slices would have different ones.
 *
 * Throws if slices do not make one volume, or if one might be missing. */
Volume
ReadDicom(const std::filesystem::path & path,
          const std::string &           series,
          const WarningFunction &       warn,
          const std::string &           option,
          const std::string &           volume);

/** The option that chooses a volume, beside the one that chooses a series; empty if that is. */
std::string
GetVolumeOption(const std::string & seriesOption);

/** The texts of a DICOM file in UTF-8, as itk::GDCMImageIO names them, such as 0008|0060. */
itk::MetaDataDictionary
ReadAttributes(const std::filesystem::path & path);

#endif
