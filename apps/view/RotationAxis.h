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
#ifndef RotationAxis_h
#define RotationAxis_h

#include "itkImageBase.h"
#include "itkVector.h"

#include <string>
#include <vector>

/** Whether \a axis is a name or three finite numbers. */
bool
IsAxis(const std::vector<std::string> & axis);

/** The direction of an \a axis in the space of \a grid. */
itk::Vector<double, 3>
MakeAxis(const std::vector<std::string> & axis, const itk::ImageBase<3> * grid);

#endif
