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
#ifndef DicomVolumes_h
#define DicomVolumes_h

#include "DicomSlices.h"

#include <string>
#include <vector>

/** Sets the positions of slices, and leaves the slices of one volume where several lie at the same positions, such as
 * echoes or points in time. Volumes are told apart by the attributes that differ at one position and hold for most
 * positions; where each slice has its own value, such as the time, by the order in it. \a volume is the number in the
 * list that the error has, from 1; it may be empty if there is only one. Errors call the slices \a name, and the option
 * \a option; without one there is no choice. Throws if slices cannot be told apart. */
void
ChooseVolume(std::vector<Slice> & slices,
             const std::string &  volume,
             const std::string &  option,
             const std::string &  name);

#endif
