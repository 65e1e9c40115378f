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
#ifndef FileGeometry_h
#define FileGeometry_h

#include "AnyImage.h"
#include "Warning.h"

#include "itkImageIOBase.h"
#include "itkMatrix.h"

#include <filesystem>
#include <optional>
#include <string>

/** Where the voxels of an image file lie: in mm, LPS where the file says how the image lies in the patient. */
struct FileGeometry
{
  itk::Point<double, 3>     origin{};
  itk::Vector<double, 3>    spacing{ 1.0 };
  itk::Matrix<double, 3, 3> direction = itk::Matrix<double, 3, 3>::GetIdentity();
  bool                      hasOrientation{ false };
  /** Whether the components of a voxel are its values in the volumes of a series. */
  bool isSeries{ false };
};

/** What \a io, which has read the header of \a path, says of the first three axes; of NRRD and NIfTI what the file
 * says, because ITK's readers differ there and take some spaces for others. NIfTI's sform counts if its code is above
 * 0, else the qform. Throws if the file states no space that is known, or one that has no volume. */
FileGeometry
ReadGeometry(const itk::ImageIOBase & io, const std::filesystem::path & path, const WarningFunction & warn);

/** The text of an entry, empty if there is none. The entries that files of NRRD and MetaImage may have are
 * HasOrientation, 0 if nobody stated how the image lies in the patient; IsInverted, 1 if low values are to be displayed
 * white; IsSuv, 1 if values are SUV by body weight; and Unit, of lengths, by default mm. */
std::string
GetEntry(const itk::MetaDataDictionary & dictionary, const std::string & key);

/** The grid of the first three axes of \a io at \a geometry. */
itk::ImageBase<3>::Pointer
MakeGrid(const FileGeometry & geometry, const itk::ImageIOBase & io);

/** How far a corner of one grid is at the most from the same corner of another grid of that size, in mm. */
double
FindDistance(const itk::ImageBase<3> * one, const itk::ImageBase<3> * other);

/** The mm of a unit of length as files name it, such as um or "millimeter"; none if it is not known. */
std::optional<double>
FindMillimetres(const std::string & unit);

#endif
