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
#ifndef ColourMaps_h
#define ColourMaps_h

#include "itkScalarToRGBColormapImageFilter.h"

#include <map>
#include <string>

using ColourMapEnum = itk::ScalarToRGBColormapImageFilterEnums::RGBColormapFilter;

inline const std::map<std::string, ColourMapEnum> colourMaps = {
  { "autumn", ColourMapEnum::Autumn }, { "blue", ColourMapEnum::Blue },     { "cool", ColourMapEnum::Cool },
  { "copper", ColourMapEnum::Copper }, { "green", ColourMapEnum::Green },   { "grey", ColourMapEnum::Grey },
  { "hot", ColourMapEnum::Hot },       { "hsv", ColourMapEnum::HSV },       { "jet", ColourMapEnum::Jet },
  { "red", ColourMapEnum::Red },       { "spring", ColourMapEnum::Spring }, { "summer", ColourMapEnum::Summer },
  { "winter", ColourMapEnum::Winter }
};

#endif
