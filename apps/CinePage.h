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
#ifndef CinePage_h
#define CinePage_h

#include "Orientation.h"
#include "Picture.h"

#include <functional>
#include <optional>
#include <string>
#include <vector>

struct CinePageOptions
{
  std::string               title;
  std::optional<WindowType> window;
  /** Of the frames of a turn, in degrees; empty for other series. */
  std::vector<double> angles;
  /** Of turns of equally many frames that follow one another, in degrees; empty for one turn. */
  std::vector<double> elevations;
  /** Of each frame; or empty. */
  std::vector<EdgeLetters> letters;
  /** Whether letters and scale bar are shown at first. */
  bool hasLabels{ true };
  /** "none", or how the series goes on behind its last frame: "turn" on and on, or "swing" to and fro. */
  std::string loop{ "none" };
  /** In frames per second. */
  double rate{ 10.0 };
  /** 8 or 16. */
  unsigned int bits{ 8 };
  /** Pictures in RGB that the page shows instead of values, without a window; or none. */
  AnyImage colours{};
};

/** The bytes of a PNG of one frame of an image. */
using PictureEncoder = std::function<std::string(const AnyImage & image, std::size_t frame)>;

/** The text of a web page that shows the projections, of one component or in colours, and needs nothing but itself: a
 * series to turn and play, with window and level.
 *
 * It holds the values with 16 bits, exactly if they are whole numbers of a range of less than 65535; or with 8, one
 * grey level for a 254th of twice the window, which is what can be set from the page, as far as there are values. */
std::string
MakeCinePage(const Projections & projections, const CinePageOptions & options, const PictureEncoder & encode);

#endif
