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
#ifndef Phantom_h
#define Phantom_h

#include "itkImage.h"
#include "itkMersenneTwisterRandomVariateGenerator.h"

/** A synthetic head as time-of-flight MR angiography shows it, the same each time. The patient has an aneurysm at the
 * left middle cerebral artery's bifurcation and a stenosis of 60 % in the right one's trunk. Positions are in mm, LPS.
 */
namespace Phantom
{
using ImageType = itk::Image<unsigned short, 3>;
using VectorType = itk::Vector<double, 3>;
using RandomType = itk::Statistics::MersenneTwisterRandomVariateGenerator;

/** The brightness of bone. */
constexpr double Bone = 45.0;

/** An image of 0 of the whole head. */
ImageType::Pointer
MakeGrid(const itk::Size<3> & size);

/** Makes voxels as bright as the arteries in them, up to 892. */
void
PaintArteries(ImageType & image, RandomType & random);

/** The brightness of the tissue at a point, 0 outside the head. */
double
GetTissue(const VectorType & point);

bool
IsInBrain(const VectorType & point);

/** Arteries, tissue and noise. */
ImageType::Pointer
Make(const itk::Size<3> & size);
} // namespace Phantom

#endif
