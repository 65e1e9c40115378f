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
#ifndef RayCasting_h
#define RayCasting_h

#include "itkImage.h"
#include "itkTransform.h"

namespace itk::ShearWarpBenchmark
{
/** Maximum intensity projection by ray casting, in one thread: what shear-warp is compared with.
 *
 * Pixel (u, v) of \a output, at the place that its region, spacing and origin give in view space, is the maximum of
 * \a image along the line of all w at T(u, v, w), where T is \a viewTransform. The line is clipped to the box of the
 * voxels' centers and sampled by trilinear interpolation (equation 1 of Fang et al. 2002), from where it enters the
 * box, every \a step in units of w (mm, for a rigid transform of an image in mm). Pixels whose line misses the box are
 * \a background; integers are rounded.
 *
 * \a output must be allocated. Instantiated for `uint8 int16 uint16 float`. */
template <typename TPixel>
void
CastRays(const Image<TPixel, 3> *             image,
         const Transform<double, 3, 3> *      viewTransform,
         double                               step,
         typename Image<TPixel, 2>::PixelType background,
         Image<TPixel, 2> *                   output);

/** Clips the rays of CastRays() and does nothing else with them: how many samples it takes, over all pixels. */
SizeValueType
CountSamples(const ImageBase<3> *            image,
             const Transform<double, 3, 3> * viewTransform,
             double                          step,
             const ImageBase<2> *            output);

/** The distance along w in which a ray goes the length of one voxel: its index changes by a vector of length 1. */
double
GetVoxelStep(const ImageBase<3> * image, const Transform<double, 3, 3> * viewTransform);
} // namespace itk::ShearWarpBenchmark

#endif
