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

#include "ScalarImage.h"
#include "itkTransform.h"

#include <filesystem>
#include <functional>
#include <string>

using WarningFunction = std::function<void(const std::string &)>;

/** Reads a 3D scalar image: a file, or a series of the DICOM folder \a path. That is the one of instance UID \a series,
 * or the only one if \a series is empty. Throws if something of the image is missing or damaged. */
ScalarImage
ReadVolume(const std::filesystem::path & path, const std::string & series, const WarningFunction & warn);

/** Reads a linear 3D transform. */
itk::Transform<double, 3, 3>::Pointer
ReadLinearTransform(const std::filesystem::path & path);

#endif
