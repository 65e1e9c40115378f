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
#ifndef Pictures_h
#define Pictures_h

#include "itkImage.h"
#include "itkTransform.h"

#include <vector>

namespace itk::ShearWarpBenchmark
{
using VolumeType = Image<float, 3>;
using PictureType = Image<float, 2>;

/** A picture of 0, of \a columns x \a columns pixels of \a spacing mm, its centre at the origin of view space. */
PictureType::Pointer
MakePicture(SizeValueType columns, double spacing);

/** A picture of 0 on the grid of another. */
PictureType::Pointer
MakePicture(const PictureType * grid);

/** The projection by ShearWarpMIPImageFilter, in one thread, at the pixels of \a grid. Rays that miss are 0. */
PictureType::Pointer
ProjectByShearWarp(const VolumeType *              volume,
                   const Transform<double, 3, 3> * viewTransform,
                   unsigned int                    oversampling,
                   const PictureType *             grid);

/** The exact maxima by ShearWarpMIPImageFilter, likewise. */
PictureType::Pointer
ProjectExactly(const VolumeType * volume, const Transform<double, 3, 3> * viewTransform, const PictureType * grid);

/** The projection by CastRays(), likewise. \a step is in mm. */
PictureType::Pointer
ProjectByRayCasting(const VolumeType *              volume,
                    const Transform<double, 3, 3> * viewTransform,
                    double                          step,
                    const PictureType *             grid);

/** One picture less another at the given pixels, by their offsets in the buffer; 0 elsewhere. */
PictureType::Pointer
Subtract(const PictureType * picture, const PictureType * reference, const std::vector<SizeValueType> & pixels);

/** What a picture has too much, in the units of its pixels. */
struct Errors
{
  double meanAbsolute{ 0.0 };
  double mean{ 0.0 };
  double rootMeanSquare{ 0.0 };
  double percentile99{ 0.0 };   // of the magnitude: at least 99 % of the pixels have no more
  double largest{ 0.0 };        // the largest magnitude
  double underestimated{ 0.0 }; // the fraction of pixels that have too little, by more than the tolerance
};

/** Compares the given pixels. All errors are 0 if there are none. */
Errors
Compare(const PictureType *                picture,
        const PictureType *                reference,
        const std::vector<SizeValueType> & pixels,
        double                             tolerance = 0.0);
} // namespace itk::ShearWarpBenchmark

#endif
