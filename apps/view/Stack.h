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
#ifndef Stack_h
#define Stack_h

#include "Input.h"
#include "Projection.h"

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

/** Frames that are projected already, with what is known of them. */
struct Stack
{
  Projections                                 projections;
  std::vector<Frame>                          frames{};
  ProjectionOptions::ModeEnum                 mode{ ProjectionOptions::ModeEnum::Maximum };
  std::optional<ProjectionOptions::PointType> center{};
  /** How the series goes on behind its last frame: turn, swing or none. */
  std::string loop{ "none" };
  /** One for each turn, all of as many frames. Empty if there is one turn, or none. */
  std::vector<double> elevations{};
  /** Whether there may be several frames. */
  bool isSeries{ false };
  bool hasOrientation{ true };
  /** Whether values are SUV by body weight. */
  bool isSuv{ false };
  /** The files of the volume, if they are DICOM. */
  std::vector<std::filesystem::path> dicomFiles{};
  /** The files of the volume, and of the mask, as the file of frames or of the volume says. */
  std::vector<std::filesystem::path> sourceFiles{};
  std::vector<std::filesystem::path> maskFiles{};
  /** Attributes of DICOM as "gggg|eeee", if there are no such files. */
  std::map<std::string, std::string> attributes{};
};

/** The angles of the first turn, in degrees; empty if there is no turn. */
std::vector<double>
GetAngles(const Stack & stack);

/** Frames of one turn, or all where there is no turn. */
std::size_t
CountFramesOfTurn(const Stack & stack);

/** What a file of values has beside the frames' values, as pairs of key and text, from which ReadStack() makes the same
 * stack:
 * - FrameTransforms: 16 numbers for each frame, row by row, from view space to physical space
 * - FrameAngles: a number for each frame, in degrees, if the series turns
 * - Elevations: a number for each turn, in degrees
 * - Loop: turn, swing or none
 * - Background: a value
 * - Mode: as --mode
 * - Slab: depths NEAR FAR in mm, of all frames or of each
 * - Center: X Y Z of the volume, in mm
 * - HasOrientation: 0 if it is not known how the volume lies in the patient
 * - IsInverted: 1 if low values are to be shown white
 * - IsSuv: 1 if values are SUV by body weight */
std::map<std::string, std::string>
DescribeStack(const Stack & stack);

/** Reads a file of frames: NRRD or MetaImage, of two or three dimensions, with the key FrameTransforms and others of
 * DescribeStack(). Keys may also be
 * - Unit: of spacing, origin, transforms, slab and center; mm if there is none
 *
 * and, if the file is trusted,
 * - SourceFiles and MaskFiles: the files of the volume and of the mask, see JoinPaths()
 * - gggg|eeee: attributes of DICOM of the volume
 *
 * Returns nothing for other files. Throws if the file is damaged, or keys are wrong or contradict each other. */
std::optional<Stack>
ReadStack(const std::filesystem::path & path, bool isTrusted, const WarningFunction & warn);

#endif
