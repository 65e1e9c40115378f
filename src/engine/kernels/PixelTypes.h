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

/* The pixel types of the kernels: macro(type) for each. Web pages have the types of their voxels only, and some tests
 * the usual types. */

#ifdef ShearWarpMIP_FOR_PAGE
#  define SHEARWARP_PIXEL_TYPES std::uint8_t, std::uint16_t
#  define SHEARWARP_FOR_EACH_PIXEL_TYPE(macro) macro(std::uint8_t) macro(std::uint16_t)
#elif defined(ShearWarpMIP_FOR_USUAL_TYPES)
#  define SHEARWARP_PIXEL_TYPES std::uint8_t, std::uint16_t, std::int16_t, float, double
#  define SHEARWARP_FOR_EACH_PIXEL_TYPE(macro) \
    macro(std::uint8_t) macro(std::uint16_t) macro(std::int16_t) macro(float) macro(double)
#else
#  define SHEARWARP_PIXEL_TYPES                                                                               \
    std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, float, std::int32_t, std::uint32_t, std::int64_t, \
      std::uint64_t, double
#  define SHEARWARP_FOR_EACH_PIXEL_TYPE(macro)                                                                       \
    macro(std::uint8_t) macro(std::int8_t) macro(std::uint16_t) macro(std::int16_t) macro(float) macro(std::int32_t) \
      macro(std::uint32_t) macro(std::int64_t) macro(std::uint64_t) macro(double)
#endif

#endif
