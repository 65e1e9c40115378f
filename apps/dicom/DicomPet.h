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
#ifndef DicomPet_h
#define DicomPet_h

#include "itkPoint.h"

#include <gdcmDataSet.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

/** Attributes of a source that its reprojection has too: of the PET Series, PET Isotope and PET Image modules and of
 * the patient orientation module (PS3.3 C.8.9.1, C.8.9.2, C.8.9.4, C.8.4.6), but what is of one slice alone. */
extern const std::vector<std::uint32_t> petAttributes;
/** Its attributes of type 2: there without a value if the source has none. */
extern const std::vector<std::uint32_t> petType2;

extern const std::string petImageStorage;

/** The attributes, without pixels, of the image that was acquired first. */
gdcm::DataSet
ReadFirstAcquired(const std::vector<std::filesystem::path> & files);

/** The first attribute of type 1 that a PET image without a gate must have, but \a source has not, as Units
 * (0054,1001); empty if it has all. */
std::string
FindMissingPetAttribute(const gdcm::DataSet & source);

/** Where a picture lies. */
struct PicturePlane
{
  /** In the patient's space (LPS), in mm. */
  itk::Point<double, 3> center;
  /** Unit vectors along rows and columns. */
  itk::Vector<double, 3> right;
  itk::Vector<double, 3> down;
  /** How far the view has turned, in degrees; not a number if that does not apply. */
  double angle;
};

/** Why pictures are no PET reprojection, empty if they are one. Such pictures turn about a single axis, and their
 * center normals are co-planar and pass through a single point (PS3.3 C.8.9.1.1.1); they are in the order of increasing
 * or decreasing angles (C.8.9.4.1.9). Normals may miss the point by \a tolerance, in mm. */
std::string
FindReprojectionObstacle(const std::vector<PicturePlane> & planes, double tolerance);

#endif
