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
#ifndef itkShearWarpPixelTypes_h
#define itkShearWarpPixelTypes_h

/* The pixel types of the kernels: macro(type) for each. Web pages have the types of their voxels only. */

#ifdef ShearWarpMIP_FOR_PAGE
#  define SHEARWARP_PIXEL_TYPES unsigned char, unsigned short
#  define SHEARWARP_FOR_EACH_PIXEL_TYPE(macro) macro(unsigned char) macro(unsigned short)
#else
#  define SHEARWARP_PIXEL_TYPES                                                                                        \
    unsigned char, signed char, unsigned short, short, float, char, int, unsigned int, long, unsigned long, long long, \
      unsigned long long, double
#  define SHEARWARP_FOR_EACH_PIXEL_TYPE(macro)                                                                     \
    macro(unsigned char) macro(signed char) macro(unsigned short) macro(short) macro(float) macro(char) macro(int) \
      macro(unsigned int) macro(long) macro(unsigned long) macro(long long) macro(unsigned long long) macro(double)
#endif

#endif
