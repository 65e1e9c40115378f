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
#ifndef Figure5_h
#define Figure5_h

#include "itkImage.h"

#include <cstdint>
#include <string>

namespace itk::ShearWarpBenchmark
{
/** The pictures of figure 5 of Fang et al. 2002: \a image from azimuth 40 and altitude 50 degrees on the grid that the
 * filter fits, as TIFF files `figure5-<name>-raycasting.tif` (RayCasting.h, a sample for each voxel of way)
 * and `figure5-<name>-shearwarp.tif` (TaggedShearWarp.h), 16 bits, and `figure5-<name>-difference.tif`, ray casting
 * less shear-warp, 32-bit floating point, in \a folder. The azimuth turns about the image's third axis, then the
 * altitude about the first. \a image has voxels of up to 14 bits. Throws ExceptionObject if the filter's picture is not
 * that of the published shear-warp in every bit, or if a file cannot be written. */
void
WriteFigure5(const Image<std::uint16_t, 3> * image, const std::string & name, const std::string & folder);
} // namespace itk::ShearWarpBenchmark

#endif
