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
#ifndef Overlay_h
#define Overlay_h

#include "Input.h"
#include "Options.h"
#include "Picture.h"

#include <string>

/** Reads the volume of --overlay, in INPUT's space: by the inverse of --overlay-transform, if there is one. Throws if
 * it is in colour or 4D, or if the file does not hold one invertible linear transform. */
Volume
ReadOverlay(const Options & options, const WarningFunction & warn);

/** Warns if \a layer, read from \a path, has no place in common with \a volume as seen by \a transform, from view space
 * to physical space; or if both are DICOM and of different patients or, unless the layer \a isRegistered, of different
 * frames of reference (PS3.3 C.7.4.1). */
void
WarnOfOtherSpace(const Volume &                       volume,
                 const Volume &                       layer,
                 const std::string &                  path,
                 const itk::Transform<double, 3, 3> * transform,
                 bool                                 isRegistered,
                 const WarningFunction &              warn);

/** Options to project a volume that is shown over INPUT as \a options do INPUT: the same frames, slab, box and
 * sampling, on the grid of \a stack; a maximum. Mask, first local maximum and fading are INPUT's alone. */
ProjectionOptions
MakeLayerOptions(const ProjectionOptions & options, const itk::ImageBase<3> * stack);

/** RGB pictures of \a pictures, of 8 bits and one or three components. Where the overlay's value is above LOW of its
 * window, a component is (1 - opacity) * picture + opacity * color, as 3D Slicer blends a foreground that has a lower
 * threshold; elsewhere it is the component of the picture. LOW gets the first color, HIGH and more the last. Warns if
 * no pixel is colored. */
AnyImage
BlendOverlay(const AnyImage &        pictures,
             const Projections &     overlay,
             const Options &         options,
             const WarningFunction & warn);

#endif
