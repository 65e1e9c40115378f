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
#ifndef MethodStudy_h
#define MethodStudy_h

#include "itkImage.h"
#include "itkTransform.h"

#include <cstdint>
#include <string>
#include <vector>

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

/** One method at one angle, once: points of figure 4 of Fang et al. 2002. Times are in seconds. */
struct Timing
{
  /** "ray casting", "shear warp", "shear warp, tagged", "filter, off" or "filter, auto". */
  std::string  method;
  unsigned int angle;
  unsigned int principalAxis;

  /** Of the volume, once for all angles. */
  double preparation;

  /** With the memory access. */
  double interpolation{ 0.0 };
  double clip{ 0.0 };
  double warp{ 0.0 };

  /** Without the preparation. */
  double total{ 0.0 };

  /** Of the cells, or in the filter of the volume, 0 to 1. */
  double skippedFraction{ 0.0 };
};

/** Times the methods of table 1 of Fang et al. 2002, each in one thread, and beside them the module's filter with
 * reduced resampling off and auto. The volume turns about its second axis from 0 to 180 degrees in steps of 10; the
 * output is the filter's fit for each angle, so that the number of rays varies with the angle as in the paper.
 *
 * - Ray casting: RayCasting.h, a sample for each voxel of way (GetVoxelStep()). Clipping is timed by itself and taken
 * off the whole to get the interpolation.
 * - Shear warp: PlainShearWarp.h, from three permuted copies of the volume.
 * - Tagged shear warp: TaggedShearWarp.h.
 * - Filter: what it prepares for these angles, by its own clocks like the two parts; the total is the whole update.
 *
 * All methods take turns in each repetition. The outputs of all shear-warps are compared: throws ExceptionObject if
 * they differ in a bit. \a image has voxels of up to 14 bits. */
std::vector<Timing>
TimeMethods(const Image<std::uint16_t, 3> * image, unsigned int repetitions);

/** One line for each element, times in milliseconds. Throws ExceptionObject if the file cannot be written. */
void
WriteTimings(const std::vector<Timing> & timings, const std::string & csvFile);

/** The pictures of figure 5: \a image from azimuth 40 and altitude 50 degrees on the grid that the filter fits, as TIFF
 * files `figure5-<name>-raycasting.tif` (RayCasting.h, a sample for each voxel of way)
 * and `figure5-<name>-shearwarp.tif` (TaggedShearWarp.h), 16 bits, and `figure5-<name>-difference.tif`, ray casting
 * less shear-warp, 32-bit floating point, in \a folder. The azimuth turns about the image's third axis, then the
 * altitude about the first. \a image has voxels of up to 14 bits. Throws ExceptionObject if the filter's picture is not
 * that of the published shear-warp in every bit, or if a file cannot be written. */
void
WriteFigure5(const Image<std::uint16_t, 3> * image, const std::string & name, const std::string & folder);
} // namespace itk::ShearWarpBenchmark

#endif
