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
#ifndef itkShearWarpVectorSets_h
#define itkShearWarpVectorSets_h

#include "Kernels.h"

namespace itk::ShearWarp
{
/** The kernels of one instruction set, for the processors that have it; the pixel types are those of
 * SHEARWARP_FOR_EACH_VECTOR_PIXEL_TYPE. */
template <typename TPixel>
const Kernels<TPixel> &
GetGenericKernels();

template <typename TPixel>
const Kernels<TPixel> &
GetAVX2Kernels();

template <typename TPixel>
const Kernels<TPixel> &
GetAVX512Kernels();
} // namespace itk::ShearWarp

#endif
