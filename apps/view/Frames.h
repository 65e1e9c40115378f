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
#ifndef Frames_h
#define Frames_h

#include "Options.h"
#include "Projection.h"

/** Sets the frames of \a projection: a turn, or slabs, or the views that are \a given, or one frame for each point in
 * time. */
void
SetFrames(ProjectionOptions &                                        projection,
          const Options &                                            options,
          const std::vector<itk::Transform<double, 3, 3>::Pointer> & given,
          const Volume &                                             volume);

#endif
