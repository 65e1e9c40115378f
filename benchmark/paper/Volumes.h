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
#ifndef Volumes_h
#define Volumes_h

#include "itkImage.h"
#include "itkTransform.h"

#include <cstdint>
#include <string>

namespace itk::ShearWarpBenchmark
{
/** The size of the paper's data set (table 1). */
constexpr Size<3> PaperSize{ { 256, 256, 64 } };

/** Reads a 3D image of one component that ITK reads, and brings it to \a size voxels and 14 bits: interpolated linearly
 * at the new voxels' centers over the same physical extent, so that its spacing changes, then scaled linearly so that
 * its smallest voxel is 0 and its largest 16383. Nothing is smoothed before, and a constant image becomes 0. Throws
 * ExceptionObject for a file that is none of this. */
Image<std::uint16_t, 3>::Pointer
ReadVolume(const std::string & file, const Size<3> & size);

/** An allocated image of the grid that the filter fits to the view: the projected bounding box of \a image at its
 * smallest spacing. \a viewTransform takes view space to the image's physical space. */
Image<std::uint16_t, 2>::Pointer
MakeFittedOutput(const Image<std::uint16_t, 3> * image, const Transform<double, 3, 3> * viewTransform);
} // namespace itk::ShearWarpBenchmark

#endif
