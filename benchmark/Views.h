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
#ifndef Views_h
#define Views_h

#include "itkAffineTransform.h"
#include "itkImageBase.h"

#include <vector>

namespace itk::ShearWarpBenchmark
{
using ViewTransformType = AffineTransform<double, 3>;

/** Turns, in degrees, about a volume's axes, the first axis first. */
struct Angles
{
  double first, second, third;
};

/** The views that are measured: 19 about the image's second axis, every 10 degrees from 0 to 180; 10 about the first
 * axis, every 20 degrees from 0 to 180; 6 oblique ones. */
const std::vector<Angles> &
GetViews();

/** A new transform of the given view, from view space (mm, its origin the image's center) to the image's physical
 * space. */
ViewTransformType::Pointer
MakeView(const ImageBase<3> * image, const Angles & angles);
} // namespace itk::ShearWarpBenchmark

#endif
