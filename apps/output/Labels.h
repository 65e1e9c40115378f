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
#ifndef Labels_h
#define Labels_h

#include "Projection.h"

/** Columns and rows of a picture that has room for labels. */
constexpr itk::SizeValueType SmallestLabelled = 48;

struct Labels
{
  /** The patient's sides at the middle of the four edges; see ComputeEdgeLetters(). */
  bool hasSides{ true };
  /** A scale bar at the bottom left, right along x; at the top left where the frame is seen from: LAO or RAO, or
   * degrees from behind, and CRA or CAU. */
  bool hasScaleAndAngles{ false };
  /** Whether it is known how the image lies in the patient; if not, there are neither sides nor angles. */
  bool hasOrientation{ true };
};

/** Draws \a labels into \a pictures, of 8 bits, each of them the picture of one of \a frames: white with a black rim,
 * as high as 1/28 of the shorter side but at least 7 pixels. What has no room is left out: all in pictures of less than
 * 48 pixels. */
void
DrawLabels(const AnyImage & pictures, const std::vector<Frame> & frames, const Labels & labels);

#endif
