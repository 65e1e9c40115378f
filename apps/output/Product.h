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
#ifndef Product_h
#define Product_h

#include "Options.h"
#include "Output.h"
#include "Reduction.h"
#include "Segments.h"
#include "Stack.h"

#include <optional>
#include <string>
#include <vector>

/** What a run has made, for its outputs. */
struct Product
{
  const Options &           options;
  WarningFunction           warn;
  Stack                     stack;
  std::optional<WindowType> window{};
  /** Pictures to show instead of the projections, as those with an overlay; or none. */
  AnyImage pictures{};
  /** Whose outlines the pictures have. */
  std::vector<Segment> segments{};
  /** What a page holds instead of frames. */
  std::optional<Reduction> volume{};
  /** Pictures per second. */
  double rate{ 10.0 };
  bool   isOverlaySuv{ false };
  /** Why pictures of PET are no reprojection by maximum, empty if they may be one. */
  std::string noReprojection{};
};

/** Writes an output, each format in a file of its own. Pictures and animations draw letters into Product::pictures. */
using WriteFunction = void(OutputFiles & files, const std::string & path, const Product & product);

WriteFunction WriteValues;
WriteFunction WritePictures;
WriteFunction WritePage;
WriteFunction WriteDicom;

#endif
