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
#ifndef Options_h
#define Options_h

#include "Warning.h"

#include "itkShearWarpEngine.h"
#include "itkShearWarpMIPView.h"

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace CLI
{
class App;
class ParseError;
} // namespace CLI

/** What the command line says, as it is documented by --help. */
struct Options
{
  std::string                 input;
  std::string                 output;
  std::string                 phantom;
  std::string                 volumeOut;
  bool                        hasAttributes{ false };
  std::vector<unsigned int>   phantomSize{ 256, 256, 128 };
  std::string                 series;
  std::string                 volume;
  std::string                 view{ "anterior" };
  double                      azimuth{ 0.0 };
  double                      elevation{ 0.0 };
  std::string                 transform;
  std::vector<double>         outputSpacing;
  std::vector<double>         size;
  std::vector<std::string>    window;
  std::vector<double>         levelAndWidth;
  std::optional<double>       background;
  unsigned int                oversampling{ 1 };
  bool                        isExact{ false };
  unsigned int                frames{ 0 };
  std::optional<unsigned int> pageBits;
  bool                        isPageOfVolume{ false };
  std::string                 pageVolumeSize{ "256" };
  std::optional<std::string>  title;
  std::vector<std::string>    rotationAxis{ "superior" };
  std::vector<double>         center;
  double                      angularRange{ 360.0 };
  bool                        isRocking{ false };
  std::vector<double>         elevations;
  std::optional<double>       rate;
  std::string                 mode{ "maximum" };
  std::string                 interpolation{ "linear" };
  std::vector<double>         slab;
  std::vector<double>         slidingSlab;
  std::vector<double>         crop;
  std::string                 mask;
  std::optional<std::int64_t> maskLabel;
  std::vector<std::int64_t>   removedLabels;
  std::optional<double>       localMaximum;
  double                      attenuation{ 0.0 };
  std::string                 depth;
  std::string                 depthColour;
  std::string                 dicomOut;
  bool                        isMultiFrame{ false };
  bool                        isSuv{ false };
  std::string                 overlay;
  std::string                 overlaySeries;
  std::string                 overlayVolume;
  std::string                 overlayTransform;
  std::string                 overlayColour{ "hot" };
  std::vector<double>         overlayWindow;
  double                      opacity{ 0.6 };
  std::string                 segments;
  bool                        isInPlace{ false };
  bool                        isUnlabelled{ false };
  bool                        isAnnotated{ false };
  unsigned int                threads{ 0 };
  bool                        verbose{ false };
  std::vector<std::string>    trusted;
  /** The names of the given options that are not of outputs, as --view. */
  std::vector<std::string> ofProjection;
};

inline const std::map<std::string, itk::ShearWarpMIPViewEnums::Direction> directions = {
  { "anterior", itk::ShearWarpMIPViewEnums::Direction::Anterior },
  { "posterior", itk::ShearWarpMIPViewEnums::Direction::Posterior },
  { "left", itk::ShearWarpMIPViewEnums::Direction::Left },
  { "right", itk::ShearWarpMIPViewEnums::Direction::Right },
  { "superior", itk::ShearWarpMIPViewEnums::Direction::Superior },
  { "inferior", itk::ShearWarpMIPViewEnums::Direction::Inferior }
};

inline const std::map<std::string, itk::ShearWarpMIPImageFilterEnums::Mode> modes = {
  { "maximum", itk::ShearWarpMIPImageFilterEnums::Mode::Maximum },
  { "minimum", itk::ShearWarpMIPImageFilterEnums::Mode::Minimum },
  { "absolute-maximum", itk::ShearWarpMIPImageFilterEnums::Mode::AbsoluteMaximum },
  { "mean", itk::ShearWarpMIPImageFilterEnums::Mode::Mean }
};

inline const std::map<std::string, itk::ShearWarpMIPImageFilterEnums::Interpolation> interpolations = {
  { "linear", itk::ShearWarpMIPImageFilterEnums::Interpolation::Linear },
  { "nearest", itk::ShearWarpMIPImageFilterEnums::Interpolation::Nearest }
};

/** Bits of a page's values. A page of a volume with 8 bits cuts what a maximum does not show, which other modes show.
 */
unsigned int
GetPageBits(const Options & options);

/** The option that nearest interpolation does not go with, and the reason; empty if there is none. */
std::string
FindAgainstNearest(const Options & options);

/** Sets up \a app so that it fills \a options, which must live as long. */
void
DefineOptions(CLI::App & app, Options & options);

/** The names of the options on the parsed command line whose definition does not have the \a trait: outputs, which go
 * with frames that are projected already, or volumes, which go with --write-volume. */
std::vector<std::string>
FindGivenWithout(const CLI::App & app, const std::string & trait);

/** The arguments, the last first, as CLI::App::parse() takes them: the values of a list are one argument. To be called
 * once for \a app. */
std::vector<std::string>
CollectArguments(CLI::App & app, int argc, const char * const * argv);

/** LOW and HIGH of --window or --wl, if one is given. Throws std::runtime_error if they are not numbers in order. */
std::optional<std::array<double, 2>>
GetWindow(const Options & options);

/** Takes an OUTPUT that is a folder, or is to be one, for the folder of --dicom-out; output is empty then. */
void
UseOutputFolder(Options & options);

/** Throws std::runtime_error if the options contradict each other. */
void
Verify(const Options & options);

/** What the parser says, in the words of the help. */
std::string
Reword(const CLI::App & app, const CLI::ParseError & error);

#endif
