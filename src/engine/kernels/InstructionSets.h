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
#ifndef itkShearWarpInstructionSets_h
#define itkShearWarpInstructionSets_h

#include "Kernels.h"
#include "PixelTypes.h"

/* A new set of vector instructions needs a file with one of these functions, its compiler options in CMakeLists.txt,
 * and a row in InstructionSets.cxx. */
namespace itk::ShearWarp
{
/** Kernels for each of some pixel types. */
template <typename... TPixels>
struct KernelsForEach : Kernels<TPixels>...
{};

/** The kernels of one instruction set. */
using VectorKernels = KernelsForEach<SHEARWARP_PIXEL_TYPES>;

/* Kernels run only on a processor that has their instructions. */
const VectorKernels &
GetGenericKernels();

const VectorKernels &
GetAVX2Kernels();

const VectorKernels &
GetAVX512Kernels();
} // namespace itk::ShearWarp

#endif
