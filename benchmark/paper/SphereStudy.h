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
#ifndef SphereStudy_h
#define SphereStudy_h

#include "Pictures.h"

#include <string>

namespace itk::ShearWarpBenchmark
{
/** The maximum of \a volume along the rays of a view, one trilinear sample wherever a ray meets a multiple of 1 /
 * \a samplesPerSlice slices of the principal axis, at the exact rays of the pixels of \a grid. As in the filter the
 * volume reaches half a voxel beyond the centres of its outer voxels, with their values. Rays that miss are 0.
 *
 * One sample per slice is what the filter has before its second interpolation; many come near the exact maximum. */
PictureType::Pointer
ProjectExactRays(const VolumeType *              volume,
                 const Transform<double, 3, 3> * viewTransform,
                 unsigned int                    samplesPerSlice,
                 const PictureType *             grid);

/** The pixels of \a grid whose rays cross the box of the centres of \a volume's voxels, by their offsets. */
std::vector<SizeValueType>
FindCrossingRays(const VolumeType * volume, const Transform<double, 3, 3> * viewTransform, const PictureType * grid);

/** What the method of Fang et al. 2002 leaves of the error, one step past the paper. The pictures of these methods are
 * compared with ProjectExactly():
 *
 * - `dense-rays`: ProjectExactRays() at 16 samples per slice
 * - `ray-casting`: CastRays() with steps of the smallest spacing
 * - `one-sample`: ProjectExactRays() at one sample per slice: no second interpolation
 * - `shear-warp`, `shear-warp-oversampled`: the filter, with Oversampling 1 and 2
 *
 * over the pixels of FindCrossingRays(), in a square grid that holds every view, of the volume's smallest spacing. Of
 * that every \a coarseness-th column and row is projected.
 *
 * The first function looks from \a views directions that lie evenly on the half sphere around \a volume (the other half
 * has the same rays). A line of the file is azimuth and elevation of ShearWarpMIPView from superior in degrees,
 * principal axis, method, and in percent of the volume's range: mean magnitude, 99th percentile, largest, mean;
 * and in percent of the pixels: how many are below the reference by more than 0.1 % of the range. */
void
WriteSphereErrors(const VolumeType * volume, unsigned int views, unsigned int coarseness, const std::string & file);

/** How much a turning picture changes from frame to frame, with each method. The azimuth turns from 0
 * to 90 in steps of \a degrees, about the volume's y axis as it is seen at elevations 0 and 30.
 *
 * A line of the file is elevation, azimuth and principal axis of a frame, the step in degrees to the next, method, and
 * the mean and the largest change of the pixels that both frames have, in percent of the volume's range. Where the
 * principal axis changes from a frame to the next there are lines of a step of 0.002 degrees too, across the
 * switch: what is left of the change then is a jump. */
void
WriteJumps(const VolumeType * volume, double degrees, unsigned int coarseness, const std::string & file);
} // namespace itk::ShearWarpBenchmark

#endif
