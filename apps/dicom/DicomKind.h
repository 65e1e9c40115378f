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
#ifndef DicomKind_h
#define DicomKind_h

#include <gdcmDataSet.h>

/** Whether an object is an image, by its attributes of pixels or, where these are missing, by its class. */
bool
IsImage(const gdcm::DataSet & header);

/** Whether an image is a projection of a volume, as those that this program writes (PS3.3 C.8.3.1.1.1, C.8.9.1 and
 * C.8.16.2.1). */
bool
IsProjection(const gdcm::DataSet & header);

/** Whether an image has the slices of a volume as tiles, as Siemens stores functional and diffusion MR. */
bool
IsMosaic(const gdcm::DataSet & header);

/** Whether an image is a segmentation (PS3.6 table A-1). */
bool
IsSegmentation(const gdcm::DataSet & header);

#endif
