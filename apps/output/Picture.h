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
#ifndef Picture_h
#define Picture_h

#include "Projection.h"

#include <optional>

using WindowType = itk::Vector<double, 2>;

/** A robust range of values other than the background, LOW less than HIGH. */
WindowType
FindWindow(const Projections & projections);

/** Pixels of 8 bits: \a window, or FindWindow(), becomes 0 to 255, or 255 to 0 of inverted projections. */
AnyImage
MakePictures(const Projections & projections, const std::optional<WindowType> & window);

/** Pictures of 8 bits with three components, of such that have one or three. */
AnyImage
MakeColourPictures(const AnyImage & pictures);

/** The pictures coloured by depth: from red, the nearest of the pixels that are bright in any of them, to blue, the
 * farthest. Black where nothing is; high values are bright, of inverted projections too. */
AnyImage
MakeDepthPictures(const Projections & projections, const std::optional<WindowType> & window);

#endif
