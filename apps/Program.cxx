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
#include "Program.h"

#include "CinePage.h"
#include "DicomSeries.h"
#include "Input.h"
#include "InputFiles.h"
#include "Output.h"
#include "Phantom.h"
#include "Picture.h"
#include "Text.h"
#include "TransformFile.h"

#include "itkMultiThreaderBase.h"
#include "itkShearWarpMIPCineImageFilter.h"
#include "itkShearWarpFactorization.h"
#include "itkShearWarpMIPView.h"
#include "itkVersion.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <regex>

#if __has_include(<unistd.h>)
#  include <unistd.h>
#endif

namespace
{
using Direction = itk::ShearWarpMIPViewEnums::Direction;
using TransformPointer = itk::Transform<double, 3, 3>::Pointer;

constexpr auto description =
  "Maximum intensity projection (MIP) of a 3D image from any direction.\n\n"
  "INPUT is an image that ITK reads (NIfTI, NRRD, MetaImage, DICOM, ...) or a folder of DICOM files. Each\n"
  "component of its pixels is projected by itself, and so is each point in time of a 4D image: a series of frames.\n"
  "OUTPUT's extension gives its format: .mha, .nrrd, .nii and .nii.gz keep the image's values and pixel type, a\n"
  "series as a 3D stack; .png has 8 bits, see --window, a series as numbered files; .gif, .apng and .mp4 are\n"
  "animations, made by the program ffmpeg; .html is a page to turn and play a series in any browser. Sizes and\n"
  "positions of the output are in mm in the view plane.";

constexpr auto examples = "Examples:\n"
                          "  shear-warp-mip tof.nii.gz mip.png --view superior\n"
                          "      seen from above, as a picture\n"
                          "  shear-warp-mip dicom-folder/ mip.nrrd --azimuth 30 --elevation 15\n"
                          "      left anterior oblique 30 degrees, cranial 15 degrees, with the image's values\n"
                          "  shear-warp-mip tof.nrrd cine.png --frames 36\n"
                          "      a full turn around the patient, cine-000.png to cine-035.png\n"
                          "  shear-warp-mip tof.nrrd turn.html --frames 72\n"
                          "      a page that turns, for any browser\n"
                          "  shear-warp-mip tof.nrrd rocking.mp4 --frames 48 --rocking 60 --elevation 15\n"
                          "      an animation, 30 degrees to either side and back, from somewhat above\n"
                          "  shear-warp-mip dicom-folder/ turn.html --frames 72 --dicom-out turn/\n"
                          "      the same and a DICOM series for the archive\n"
                          "  shear-warp-mip ct.nrrd slabs.nrrd --view superior --sliding-slab 10 5\n"
                          "      slabs of 10 mm from top to bottom, one every 5 mm\n"
                          "  shear-warp-mip tof.nrrd mip.png --depth-colour depth.png\n"
                          "      a picture, and one with near vessels red and far ones blue\n"
                          "  shear-warp-mip --write-phantom head.nrrd\n"
                          "      an image to try";

const std::map<std::string, Direction> directions = {
  { "anterior", Direction::Anterior }, { "posterior", Direction::Posterior }, { "left", Direction::Left },
  { "right", Direction::Right },       { "superior", Direction::Superior },   { "inferior", Direction::Inferior }
};

// LPS: x to the left, y to posterior, z to superior
const std::map<std::string, unsigned int> patientAxes = { { "left", 0 }, { "posterior", 1 }, { "superior", 2 } };
const std::map<std::string, unsigned int> imageAxes = { { "i", 0 }, { "j", 1 }, { "k", 2 } };

using ModeEnum = ProjectionOptions::ModeEnum;
const std::map<std::string, ModeEnum> modes = { { "maximum", ModeEnum::Maximum },
                                                { "minimum", ModeEnum::Minimum },
                                                { "absolute-maximum", ModeEnum::AbsoluteMaximum } };

// only for its geometry
using TurnType = itk::ShearWarpMIPCineImageFilter<itk::Image<unsigned char, 3>>;
constexpr unsigned int mostFrames = TurnType::MaximumNumberOfFrames;

struct Options
{
  std::string                 input;
  std::string                 output;
  std::string                 phantom;
  std::string                 series;
  std::string                 view{ "anterior" };
  double                      azimuth{ 0.0 };
  double                      elevation{ 0.0 };
  std::string                 transform;
  std::vector<double>         spacing;
  std::vector<double>         size;
  std::vector<double>         window;
  std::optional<double>       background;
  unsigned int                oversampling{ 1 };
  bool                        isExact{ false };
  unsigned int                frames{ 0 };
  std::optional<unsigned int> pageBits;
  std::vector<std::string>    axis{ "superior" };
  std::vector<double>         centre;
  double                      range{ 360.0 };
  std::optional<double>       rocking;
  std::optional<double>       rate;
  std::string                 mode{ "maximum" };
  std::vector<double>         slab;
  std::vector<double>         slidingSlab;
  std::vector<double>         crop;
  std::string                 mask;
  std::optional<std::int64_t> maskLabel;
  std::optional<double>       localMaximum;
  double                      attenuation{ 0.0 };
  std::string                 depth;
  std::string                 depthColour;
  std::string                 dicomOut;
  bool                        isInPlace{ false };
  unsigned int                threads{ 0 };
  bool                        verbose{ false };
};

template <typename TValue>
std::vector<std::string>
GetKeys(const std::map<std::string, TValue> & map)
{
  std::vector<std::string> keys;
  keys.reserve(map.size());
  for (const auto & entry : map)
  {
    keys.push_back(entry.first);
  }
  return keys;
}

/** Accepts the numbers that are \a good. */
CLI::Validator
MakeCheck(const std::string & name, const std::function<bool(double)> & good)
{
  const auto check = [=](const std::string & text) {
    double value = 0.0;
    return CLI::detail::lexical_cast(text, value) && good(value) ? std::string()
                                                                 : '\'' + Trim(text) + "' is not " + name;
  };
  return CLI::Validator(check, "");
}

/** Accepts finite numbers from \a lowest on. */
CLI::Validator
Number(const std::string & name, double lowest, bool whole = false)
{
  return MakeCheck(name, [=](double value) {
    return std::isfinite(value) && value >= lowest && (!whole || (value == std::trunc(value) && value <= 0x1p53));
  });
}

/** Accepts numbers, infinite ones too. */
CLI::Validator
Bound()
{
  return MakeCheck("a number", [](double value) { return !std::isnan(value); });
}

/** Accepts numbers, and what is not a number. */
CLI::Validator
Value()
{
  return MakeCheck("a number", [](double) { return true; });
}

std::string
GetVersionText()
{
  return std::string("shear-warp-mip " ShearWarpMIP_VERSION ", ITK ") + itk::Version::GetITKVersion();
}

void
DefineOptions(CLI::App & app, Options & options)
{
  constexpr double tiny = std::numeric_limits<double>::min();
  const auto       angle = Number("a finite angle", std::numeric_limits<double>::lowest());
  const auto       count = Number("a whole number of at least 1", 1.0, true);

  const auto input = app.add_option("INPUT", options.input, "Image file, or DICOM folder")->required();
  const auto output = app.add_option("OUTPUT", options.output, "File to write")->required();
  app.add_option("--series", options.series, "Instance UID of the DICOM series, if the folder has several")
    ->type_name("UID");

  const auto view = app.add_option("--view", options.view, "Side from which the patient is seen")
                      ->check(CLI::IsMember(GetKeys(directions)))
                      ->capture_default_str()
                      ->group("View");
  const auto azimuth =
    app.add_option("--azimuth", options.azimuth, "Degrees to go on, towards the right of the picture (LAO positive)")
      ->check(angle)
      ->type_name("DEGREES")
      ->group("View");
  const auto elevation =
    app.add_option("--elevation", options.elevation, "Degrees to rise then, towards its top (cranial positive)")
      ->check(angle)
      ->type_name("DEGREES")
      ->group("View");
  app
    .add_option("--transform",
                options.transform,
                "Linear ITK transform from view space (right, down, away; mm) to the image's space; depths are then "
                "from its origin. Several are a series of frames")
    ->excludes(view)
    ->excludes(azimuth)
    ->excludes(elevation)
    ->type_name("FILE")
    ->group("View");

  const auto frames = app.add_option("--frames", options.frames, "A turn in N frames: a series")
                        ->check(CLI::Range(1u, mostFrames))
                        ->type_name("N")
                        ->group("Turning series");
  app
    .add_option("--axis",
                options.axis,
                "To turn about, right-handed: the patient's left, posterior or superior, the image's i, j or k, or a "
                "direction X,Y,Z (LPS); default: superior, towards the patient's left from anterior")
    ->delimiter(',')
    ->expected(1)
    ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
    ->needs(frames)
    ->type_name("NAME or X,Y,Z")
    ->group("Turning series");
  app
    .add_option("--centre",
                options.centre,
                "X,Y,Z in the patient's space (LPS): a point of the axis; default: the image's centre")
    ->check(Number("a finite number", std::numeric_limits<double>::lowest()))
    ->delimiter(',')
    ->expected(3)
    ->needs(frames)
    ->type_name("MM")
    ->group("Turning series");
  const auto range =
    app.add_option("--range", options.range, "How far to turn, negative to the other side; default: 360")
      ->check(angle)
      ->needs(frames)
      ->type_name("DEGREES")
      ->group("Turning series");
  app
    .add_option(
      "--rocking",
      options.rocking,
      "Turn to and fro instead, over so many degrees in all: from the view half of them to one side, then to the "
      "other, and back, as a sine whose ends are frames; two frames are the ends. Fit to be repeated")
    ->check(angle)
    ->needs(frames)
    ->excludes(range)
    ->type_name("DEGREES")
    ->group("Turning series");
  app
    .add_option("--rate",
                options.rate,
                "Frames per second of an animation or page; default: the series in four seconds, from 5 to 25")
    ->check(CLI::Range(0.1, 100.0))
    ->type_name("FPS")
    ->group("Turning series");
  app
    .add_option("--page-bits",
                options.pageBits,
                "Bits of a page's pixels: 8 for twice the window's range, or 16 for all values, two to four times as "
                "large")
    ->check(CLI::IsMember({ 8, 16 }))
    ->default_str("8")
    ->group("Turning series");

  app
    .add_option(
      "--spacing", options.spacing, "Distance of pixels: one value, or two as 0.5,0.8; default: the image's smallest")
    ->check(Number("a positive number; decimals have a point", tiny))
    ->delimiter(',')
    ->expected(1)
    ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
    ->type_name("MM")
    ->group("Picture");
  app.add_option("--size", options.size, "Width and height in pixels; default: all of the image is in the picture")
    ->check(count)
    ->delimiter(',')
    ->expected(2)
    ->type_name("PIXELS")
    ->group("Picture");
  app
    .add_option("--background",
                options.background,
                "Value beside the image; default: 0, or the image's minimum if that is negative")
    ->check(Value())
    ->type_name("VALUE")
    ->group("Picture");
  const auto oversampling =
    app
      .add_option("--oversampling",
                  options.oversampling,
                  "1, or 2 for twice as many samples along both axes of each slice: sharper, up to three times as slow")
      ->check(CLI::IsMember({ 1, 2 }))
      ->capture_default_str()
      ->group("Picture");
  const auto exact = app
                       .add_flag("--exact",
                                 options.isExact,
                                 "The maximum of the interpolated image along each pixel's ray, in closed form: "
                                 "without steps between samples, 10 to 60 times as slow")
                       ->excludes(oversampling)
                       ->group("Picture");
  app
    .add_option("--window",
                options.window,
                "LOW and HIGH values that become black and white in pictures and animations, and at first in a page "
                "(white and black if DICOM is MONOCHROME1); default: percentiles 1 and 99.8 of the pixels that are not "
                "background")
    ->check(Number("a finite number", std::numeric_limits<double>::lowest()))
    ->delimiter(',')
    ->expected(2)
    ->type_name("VALUE")
    ->group("Picture");

  const auto slab = app
                      .add_option("--slab",
                                  options.slab,
                                  "NEAR and FAR: only what lies between these depths behind the image's centre along "
                                  "the view (negative: nearer to the viewer; -inf and inf: no limit)")
                      ->check(Bound())
                      ->delimiter(',')
                      ->expected(2)
                      ->type_name("MM")
                      ->group("Projection");
  const auto slidingSlab = app
                             .add_option("--sliding-slab",
                                         options.slidingSlab,
                                         "THICKNESS and STEP: slabs from the image's front to its back, one every "
                                         "STEP: a 3D stack by depth of the slabs' middles, or numbered PNGs")
                             ->check(Number("a positive number", tiny))
                             ->delimiter(',')
                             ->expected(2)
                             ->excludes(slab)
                             ->excludes(frames)
                             ->type_name("MM")
                             ->group("Projection");
  app
    .add_option("--mode", options.mode, "What a ray shows of the values along it; the absolute maximum keeps its sign")
    ->check(CLI::IsMember(GetKeys(modes)))
    ->capture_default_str()
    ->group("Projection");
  app
    .add_option("--local-maximum",
                options.localMaximum,
                "Rays end behind their first local maximum of at least this value, so that a near vessel hides a "
                "brighter one behind it (first local minimum of at most this value with --mode minimum)")
    ->check(Value())
    ->excludes(exact)
    ->type_name("THRESHOLD")
    ->group("Projection");
  const auto mask = app
                      .add_option("--mask",
                                  options.mask,
                                  "Only voxels where this image is not 0; it has whole numbers and INPUT's grid")
                      ->excludes(exact)
                      ->type_name("FILE")
                      ->group("Projection");
  app.add_option("--mask-label", options.maskLabel, "Only voxels where the mask is N, at least 1")
    ->check(count)
    ->needs(mask)
    ->type_name("N")
    ->group("Projection");
  app
    .add_option("--crop",
                options.crop,
                "X0 X1 Y0 Y1 Z0 Z1, or with commas: only what lies in this box of the patient's space (LPS: x to the "
                "left, y to posterior, z to superior; -inf and inf: no limit)")
    ->check(Bound())
    ->delimiter(',')
    ->expected(6)
    ->type_name("MM")
    ->group("Projection");
  app
    .add_option("--attenuation",
                options.attenuation,
                "Values fade to the background with depth: at d mm behind the front of the sphere that holds the "
                "image or, if that is deeper, of the slab, to exp(-RATE d) of their difference; RATE is per mm")
    ->check(Number("a finite number of at least 0", 0.0))
    ->excludes(exact)
    ->type_name("RATE")
    ->group("Projection");
  app
    .add_option("--depth",
                options.depth,
                "Also writes the depth of each pixel's value, in mm behind the image's centre along the view: floats "
                "in .mha, .nrrd, .nii or .nii.gz, not-a-number where nothing is, which ITK reads as 0 from NIfTI")
    ->type_name("FILE")
    ->group("Projection");
  app
    .add_option("--depth-colour",
                options.depthColour,
                "Also writes a .png, or numbered ones or an animation of a series: coloured by depth from red, the "
                "nearest of what is bright, to blue, the farthest; as bright as OUTPUT with --window; black where "
                "nothing is")
    ->type_name("FILE")
    ->group("Projection");
  app
    .add_option("--dicom-out",
                options.dicomOut,
                "Also writes a DICOM series, one file for each picture, into this folder, which must be new or empty; "
                "patient, study and frame of reference are those of INPUT if that is DICOM")
    ->type_name("DIR")
    ->group("Turning series");

  app
    .add_flag("--in-place",
              options.isInPlace,
              "OUTPUT is a slice in the patient's space, as thick as what is projected, which viewers show with INPUT; "
              "only .mha, .nrrd, .nii and .nii.gz")
    ->excludes(frames)
    ->excludes(slidingSlab)
    ->group("Projection");

  app.add_option("--threads", options.threads, "Threads to use; default: all processors")
    ->check(count)
    ->type_name("N")
    ->group("Program");
  app.add_flag("--verbose", options.verbose, "Tells what is done and how long it takes")->group("Program");
  app
    .add_option_function<std::string>(
      "--write-phantom",
      [&options, input, output](const std::string & path) {
        options.phantom = path;
        input->required(false);
        output->required(false);
      },
      "Writes a synthetic MR angiogram of a head, instead of INPUT and OUTPUT")
    ->excludes(input)
    ->type_name("FILE")
    ->group("Program");
  app.set_version_flag("--version", GetVersionText(), "Prints the version")->group("Program");
  app.set_help_flag("-h,--help", "Prints this text")->group("Program");
}

/** X,Y,Z, if it is three finite numbers. */
std::optional<itk::Vector<double, 3>>
ReadDirection(const std::vector<std::string> & axis)
{
  if (axis.size() != 3)
  {
    return std::nullopt;
  }
  itk::Vector<double, 3> direction;
  for (unsigned int n = 0; n < 3; ++n)
  {
    if (!CLI::detail::lexical_cast(axis[n], direction[n]) || !std::isfinite(direction[n]))
    {
      return std::nullopt;
    }
  }
  return direction;
}

itk::Vector<double, 3>
MakeAxis(const std::vector<std::string> & axis, const itk::ImageBase<3> * grid)
{
  if (const auto given = ReadDirection(axis))
  {
    return *given;
  }
  itk::Vector<double, 3> direction(0.0);
  if (const auto found = imageAxes.find(axis.front()); found != imageAxes.end())
  {
    for (unsigned int row = 0; row < 3; ++row)
    {
      direction[row] = grid->GetDirection()(row, found->second);
    }
  }
  else
  {
    direction[patientAxes.at(axis.front())] = 1.0;
  }
  return direction;
}

std::vector<Frame>
MakeTurn(const Options & options, const Frame & still, const itk::ImageBase<3> * grid)
{
  const auto image = TurnType::InputImageType::New();
  image->CopyInformation(grid);
  const auto turn = TurnType::New();
  turn->SetInput(image);
  turn->SetTransform(still.transform);
  turn->SetNumberOfFrames(options.frames);
  turn->SetRotationAxis(MakeAxis(options.axis, grid));
  if (!options.centre.empty())
  {
    turn->SetCenter(itk::Point<double, 3>(options.centre.data()));
  }
  turn->SetRocking(options.rocking.has_value());
  turn->SetAngularRange(options.rocking.value_or(options.range));

  const auto         angles = turn->GetFrameAngles();
  std::vector<Frame> frames(options.frames, still);
  for (unsigned int n = 0; n < options.frames; ++n)
  {
    frames[n].transform = turn->GetFrameTransform(n);
    frames[n].angle = angles[n];
  }
  return frames;
}

void
SetSlidingSlabs(ProjectionOptions & projection, const Options & options, Frame frame, const itk::ImageBase<3> * grid)
{
  const double          thickness = options.slidingSlab[0];
  const double          step = options.slidingSlab[1];
  itk::Point<double, 3> lower;
  itk::Point<double, 3> upper;
  itk::ShearWarpFactorization::VerifyViewTransform(frame.transform);
  itk::ShearWarpFactorization::ComputeViewBounds(frame.transform, grid, lower, upper);
  // up to the one that reaches the back, or begins before it
  const double more = std::max(0.0, std::ceil((upper[2] - lower[2] - std::max(thickness, step)) / step - 1e-6));
  if (!(more < mostFrames))
  {
    std::ostringstream message;
    message << "--sliding-slab: " << more + 1.0 << " slabs are too many; at most " << mostFrames << " are possible";
    throw std::runtime_error(message.str());
  }
  for (unsigned int n = 0; n <= static_cast<unsigned int>(more); ++n)
  {
    frame.slabNear = lower[2] + n * step;
    frame.slabFar = frame.slabNear + thickness;
    projection.frames.push_back(frame);
  }
  projection.frameSpacing = step;
  projection.frameOrigin = lower[2] + 0.5 * thickness;
}

/** A turn, or slabs, or the views that are given, or one frame for each point in time. */
void
SetFrames(ProjectionOptions &                   projection,
          const Options &                       options,
          const std::vector<TransformPointer> & given,
          const Volume &                        volume)
{
  const itk::ImageBase<3> * grid = volume.times.front().image;
  Frame                     still;
  if (given.empty())
  {
    still.transform =
      itk::ShearWarpMIPView::MakeTransform(grid, directions.at(options.view), options.azimuth, options.elevation);
  }
  else
  {
    still.transform = given.front();
  }
  if (!options.slab.empty())
  {
    still.slabNear = options.slab[0];
    still.slabFar = options.slab[1];
  }

  if (options.frames > 0)
  {
    projection.frames = MakeTurn(options, still, grid);
  }
  else if (!options.slidingSlab.empty())
  {
    SetSlidingSlabs(projection, options, still, grid);
  }
  else if (given.size() > 1)
  {
    projection.frames.resize(given.size(), still);
    for (std::size_t n = 0; n < given.size(); ++n)
    {
      projection.frames[n].transform = given[n];
    }
  }
  else
  {
    projection.frames.resize(volume.times.size(), still);
    for (std::size_t time = 0; time < volume.times.size(); ++time)
    {
      projection.frames[time].time = time;
    }
    projection.frameSpacing = volume.timeSpacing;
    projection.frameOrigin = volume.timeOrigin;
  }
}

std::string
Describe(const AnyImage & image)
{
  std::ostringstream text;
  text << image.image->GetLargestPossibleRegion().GetSize() << " voxels, spacing " << image.image->GetSpacing()
       << " mm, " << itk::ImageIOBase::GetComponentTypeAsString(image.componentType);
  if (image.image->GetNumberOfComponentsPerPixel() > 1)
  {
    text << " x " << image.image->GetNumberOfComponentsPerPixel();
  }
  return text.str();
}

bool
IsTerminal()
{
#if __has_include(<unistd.h>)
  return isatty(STDERR_FILENO) == 1;
#else
  return false;
#endif
}

/** What the program says, on one line each. */
class Messages
{
public:
  Messages(std::ostream & stream, const Options & options)
    : m_Stream(stream)
    , m_Options(options)
    , m_Start(Clock::now())
  {}

  void
  Warn(const std::string & text) const
  {
    m_Stream << "shear-warp-mip: warning: " << text << std::endl;
  }

  /** Says what was done since the last call, and how long it took. */
  void
  StepDone(const std::string & text)
  {
    const auto now = Clock::now();
    if (m_Options.verbose)
    {
      m_Stream << text << ": " << Milliseconds(now - m_Start) << std::endl;
    }
    m_Start = now;
  }

  void
  FramesDone(const FrameReport & report) const
  {
    if (m_Options.verbose)
    {
      m_Stream << (report.end - report.begin > 1 ? "frames " : "frame ") << report.begin;
      if (report.end - report.begin > 1)
      {
        m_Stream << " to " << report.end - 1;
      }
      m_Stream << ": axis " << report.principalAxis << ", "
               << (report.preparationSeconds > 0.0 ? "volume prepared in " + Milliseconds(report.preparationSeconds)
                                                   : "nothing to prepare")
               << ", projected in " << Milliseconds(report.projectionSeconds) << ", warped in "
               << Milliseconds(report.warpSeconds) << std::endl;
    }
  }

  void
  Progress(std::size_t done, std::size_t all) const
  {
    if (!m_Options.verbose && all > 1 && IsTerminal())
    {
      m_Stream << "\rframe " << done << " of " << all << (done == all ? "\n" : "") << std::flush;
    }
  }

private:
  using Clock = std::chrono::steady_clock;
  using Seconds = std::chrono::duration<double>;

  static std::string
  Milliseconds(Seconds duration)
  {
    std::ostringstream text;
    text << std::fixed << std::setprecision(1) << 1000.0 * duration.count() << " ms";
    return text.str();
  }

  static std::string
  Milliseconds(double seconds)
  {
    return Milliseconds(Seconds(seconds));
  }

  std::ostream &    m_Stream;
  const Options &   m_Options;
  Clock::time_point m_Start;
};

void
WritePhantom(const Options & options)
{
  OutputFiles files;
  files.Reserve(options.phantom, OutputFiles::Format::Values, "--write-phantom");
  files.Write(options.phantom, MakePhantom(), OutputFiles::Layout::Volume);
  files.Commit();
}

void
Verify(const Options & options)
{
  if (options.window.size() == 2 && !(options.window[0] < options.window[1]))
  {
    throw std::runtime_error("--window: LOW must be less than HIGH");
  }
  if (options.spacing.size() > 2)
  {
    throw std::runtime_error("--spacing: one or two values are needed");
  }
  const bool isName = options.axis.size() == 1 &&
                      (patientAxes.count(options.axis.front()) > 0 || imageAxes.count(options.axis.front()) > 0);
  if (!isName && !ReadDirection(options.axis))
  {
    throw std::runtime_error("--axis: it must be left, posterior, superior, i, j, k or a direction X,Y,Z");
  }
  if (options.slab.size() == 2 && options.slab[0] > options.slab[1])
  {
    throw std::runtime_error("--slab: NEAR must not be greater than FAR");
  }
  if (options.pageBits && !OutputFiles::IsPage(options.output))
  {
    throw std::runtime_error("--page-bits requires a page: .html");
  }
  for (std::size_t n = 0; n < options.crop.size(); n += 2)
  {
    if (options.crop[n] > options.crop[n + 1])
    {
      throw std::runtime_error("--crop: X0, Y0 and Z0 must not be greater than X1, Y1 and Z1");
    }
  }
}

/** Throws if several views are given but something else makes a series, or cannot be one. */
void
VerifyViews(const Options & options, std::size_t views, std::size_t times)
{
  const std::string other = options.frames > 0             ? "--frames"
                            : !options.slidingSlab.empty() ? "--sliding-slab"
                            : options.isInPlace            ? "--in-place"
                            : times > 1                    ? "An image of several points in time"
                                                           : "";
  if (views > 1 && !other.empty())
  {
    throw std::runtime_error(other + " is not possible: '" + options.transform + "' holds " + std::to_string(views) +
                             " transforms");
  }
}

/** Throws if not all of the options go with an image of several components or points in time. */
void
VerifyVolume(const Options & options, const Volume & volume)
{
  const auto         times = volume.times.size();
  const unsigned int components = volume.times.front().image->GetNumberOfComponentsPerPixel();
  const auto         refuse = [&](const std::string & option, std::size_t count, const std::string & what) {
    throw std::runtime_error(option + " is not possible: '" + options.input + "' has " + std::to_string(count) + ' ' +
                             what);
  };
  if (times > 1 && (options.frames > 0 || !options.slidingSlab.empty() || options.isInPlace))
  {
    refuse(options.frames > 0  ? "--frames"
           : options.isInPlace ? "--in-place"
                               : "--sliding-slab",
           times,
           "points in time");
  }
  if (components > 1 && !(options.depth.empty() && options.depthColour.empty()))
  {
    refuse(options.depth.empty() ? "--depth-colour" : "--depth", components, "components");
  }
  if (!options.dicomOut.empty() && times > 1)
  {
    refuse("--dicom-out", times, "points in time");
  }
  if (!options.dicomOut.empty() && components > 1)
  {
    refuse("--dicom-out", components, "components");
  }
  if (components > 1 && OutputFiles::IsPage(options.output))
  {
    refuse("A page of more than 1 component", components, "components");
  }
  if (components != 1 && components != 3 &&
      (OutputFiles::IsPicture(options.output) || OutputFiles::IsAnimation(options.output)))
  {
    refuse("A picture of other than 1 or 3 components", components, "components");
  }
}

/** Whether all is background. */
bool
IsBlank(const Projections & projections)
{
  return DispatchPixelType(projections.stack.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    const auto              background = static_cast<PixelType>(projections.background);
    auto &                  pixels = *CastImage<PixelType>(projections.stack).GetPixelContainer();
    const PixelType * const begin = pixels.GetBufferPointer();
    return std::all_of(begin, begin + pixels.Size(), [background](PixelType pixel) {
      return pixel == background || (pixel != pixel && background != background);
    });
  });
}

/** Of a frame without a slab the plane through the image's centre. */
std::vector<DicomView>
MakeDicomViews(const ProjectionOptions & projection, const itk::ImageBase<3> * grid)
{
  std::vector<DicomView> views;
  for (const Frame & frame : projection.frames)
  {
    DicomView view;
    view.transform = frame.transform;
    view.thickness = frame.slabFar - frame.slabNear;
    view.depth = std::isfinite(view.thickness) ? 0.5 * (frame.slabNear + frame.slabFar)
                                               : ComputeDepthOfCentre(frame.transform, grid);
    view.angle = frame.angle;
    views.push_back(view);
  }
  return views;
}

CinePageOptions
MakePageOptions(const Options &                   options,
                const ProjectionOptions &         projection,
                const std::optional<WindowType> & window,
                double                            rate)
{
  CinePageOptions page{
    std::filesystem::path(options.input).filename().string(), window, {}, "none", rate, options.pageBits.value_or(8)
  };
  if (options.frames > 0)
  {
    page.loop = options.rocking ? "swing" : std::abs(options.range) == 360.0 ? "turn" : "none";
    for (const Frame & frame : projection.frames)
    {
      page.angles.push_back(frame.angle);
    }
  }
  return page;
}

void
Run(const Options & options, Messages & messages)
{
  Verify(options);
  if (options.threads > 0)
  {
    itk::MultiThreaderBase::SetGlobalMaximumNumberOfThreads(options.threads);
    itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(options.threads);
  }
  OutputFiles files;
  for (const std::string & path : { options.input, options.mask, options.transform })
  {
    files.Protect(FindInputFiles(path));
  }
  if (options.isInPlace)
  {
    files.Reserve(options.output, OutputFiles::Format::Values, "--in-place");
  }
  else
  {
    files.Reserve(options.output, OutputFiles::Format::Any, "OUTPUT");
  }
  if (!options.depth.empty())
  {
    files.Reserve(options.depth, OutputFiles::Format::Values, "--depth");
  }
  if (!options.depthColour.empty())
  {
    files.Reserve(options.depthColour, OutputFiles::Format::Picture, "--depth-colour");
  }
  if (!options.dicomOut.empty())
  {
    files.ReserveFolder(options.dicomOut);
  }
  std::vector<TransformPointer> given;
  if (!options.transform.empty())
  {
    given = ReadLinearTransforms(options.transform);
  }

  const auto   warn = [&](const std::string & text) { messages.Warn(text); };
  const Volume volume = ReadVolume(options.input, options.series, warn);
  files.Protect(volume.dicomFiles);
  const AnyImage &  first = volume.times.front();
  const std::string times = volume.times.size() > 1 ? std::to_string(volume.times.size()) + " x " : "";
  messages.StepDone("read " + options.input + ", " + times + Describe(first));
  VerifyVolume(options, volume);
  VerifyViews(options, given.size(), volume.times.size());

  ProjectionOptions projection;
  SetFrames(projection, options, given, volume);
  const std::size_t frames = projection.frames.size();
  const bool        isSeries = options.frames > 0 || !options.slidingSlab.empty() || frames > 1;
  if (options.rate && !isSeries)
  {
    throw std::runtime_error("--rate requires a series; see --frames");
  }
  projection.isInPlace = options.isInPlace;
  if (!options.spacing.empty())
  {
    const double spacing[] = { options.spacing.front(), options.spacing.back() };
    projection.spacing = itk::Vector<double, 2>(spacing);
  }
  if (!options.size.empty())
  {
    projection.size = { { static_cast<itk::SizeValueType>(options.size[0]),
                          static_cast<itk::SizeValueType>(options.size[1]) } };
  }
  projection.oversampling = options.oversampling;
  projection.isExact = options.isExact;
  projection.background = options.background;
  projection.mode = modes.at(options.mode);
  projection.localMaximum = options.localMaximum;
  if (!options.mask.empty())
  {
    projection.mask = ReadMask(options.mask, options.maskLabel, first.image, warn);
    messages.StepDone("read " + options.mask);
  }
  for (std::size_t axis = 0; axis < 3 && !options.crop.empty(); ++axis)
  {
    projection.cropLower[axis] = options.crop[2 * axis];
    projection.cropUpper[axis] = options.crop[2 * axis + 1];
  }
  projection.attenuation = options.attenuation;
  projection.computeDepth = !options.depth.empty() || !options.depthColour.empty();
  const Projections projections = ProjectFrames(
    volume,
    projection,
    [&](const FrameReport & report) { messages.FramesDone(report); },
    [&](std::size_t done, std::size_t all) { messages.Progress(done, all); });
  messages.StepDone("projected, " + Describe(projections.stack));
  if (!(options.slab.empty() && options.crop.empty()) && IsBlank(projections))
  {
    warn("there is only background in the picture: is the image within " +
         std::string(options.slab.empty() ? "--crop?" : "--slab?"));
  }

  const double rate = options.rate.value_or(std::clamp(std::round(static_cast<double>(frames) / 4.0), 5.0, 25.0));
  const auto   layout = options.isInPlace ? OutputFiles::Layout::Volume
                        : isSeries        ? OutputFiles::Layout::Series
                                          : OutputFiles::Layout::Still;
  std::optional<WindowType> window;
  if (!options.window.empty())
  {
    window = WindowType(options.window.data());
  }
  const auto writePictures = [&](const std::string & path, const AnyImage & pictures) {
    if (OutputFiles::IsAnimation(path))
    {
      files.WriteAnimation(path, pictures, rate);
    }
    else
    {
      files.Write(path, pictures, isSeries ? OutputFiles::Layout::Series : OutputFiles::Layout::Still);
    }
  };
  if (OutputFiles::IsPage(options.output))
  {
    const auto encode = [&](const AnyImage & image, std::size_t frame) {
      return files.EncodePicture(options.output, image, frame);
    };
    files.WriteText(options.output,
                    MakeCinePage(projections, MakePageOptions(options, projection, window, rate), encode));
  }
  else if (OutputFiles::IsPicture(options.output) || OutputFiles::IsAnimation(options.output))
  {
    writePictures(options.output, MakePictures(projections, window));
  }
  else
  {
    files.Write(options.output, projections.stack, layout);
  }
  if (!options.depth.empty())
  {
    files.Write(options.depth, projections.depths, layout);
  }
  if (!options.depthColour.empty())
  {
    writePictures(options.depthColour, MakeDepthPictures(projections, window));
  }
  if (!options.dicomOut.empty())
  {
    DicomSeriesOptions dicom;
    dicom.isMinimum = projection.mode == ModeEnum::Minimum;
    dicom.derivation = projection.mode == ModeEnum::Maximum   ? "Maximum intensity projection"
                       : projection.mode == ModeEnum::Minimum ? "Minimum intensity projection"
                                                              : "Maximum intensity projection of absolute values";
    dicom.version = ShearWarpMIP_VERSION;
    if (window)
    {
      dicom.window = std::make_pair((*window)[0], (*window)[1]);
    }
    WriteDicomSeries(
      files, projections.stack, MakeDicomViews(projection, first.image), volume.dicomFiles, options.dicomOut, dicom);
    messages.StepDone("made the files of " + options.dicomOut);
  }
  files.Commit();
  messages.StepDone("wrote " + options.output);
}

/** The arguments, the last first. The parser takes -inf and -.5 for options unless a space is before them. */
std::vector<std::string>
CollectArguments(int argc, const char * const * argv)
{
  std::vector<std::string> arguments;
  for (int n = argc - 1; n > 0; --n)
  {
    double            number = 0.0;
    const std::string argument = argv[n];
    const bool        looksLikeOption = argument.size() > 1 && argument[0] == '-' && std::isdigit(argument[1]) == 0;
    arguments.push_back(looksLikeOption && CLI::detail::lexical_cast(argument, number) ? ' ' + argument : argument);
  }
  return arguments;
}

/** Of a message. A regular expression takes as much of the stack as there are characters. */
constexpr std::size_t MostCharacters = 4000;

/** What the parser says, in the words of the help. */
std::string
Reword(const CLI::App & app, const CLI::ParseError & error)
{
  if (dynamic_cast<const CLI::ExtrasError *>(&error))
  {
    return CLI::detail::join(app.remaining(), " ") + " is not expected; see --help";
  }
  std::string text = std::string(error.what()).substr(0, MostCharacters);
  text = std::regex_replace(
    text, std::regex("At [Ll]east (\\d+) required but received (\\d+)"), "$1 values are needed, not $2");
  text = std::regex_replace(
    text, std::regex("At [Mm]ost (\\d+) required but received (\\d+)"), "at most $1 can be given, not $2");
  text = std::regex_replace(text, std::regex("1 required (.*) missing"), "a value is needed, $1");
  return dynamic_cast<const CLI::RequiredError *>(&error) ? text + "; see --help" : text;
}

std::string
MakeOneLine(const std::string & text)
{
  // without ITK's beginning, "ITK ERROR: Class(0x123): "
  std::istringstream words(
    std::regex_replace(text.substr(0, MostCharacters), std::regex("ITK ERROR: |\\w+\\(0x[0-9a-f]+\\): "), ""));
  std::string line;
  for (std::string word; words >> word;)
  {
    line += (line.empty() ? "" : " ") + word;
  }
  return line;
}
} // namespace

int
RunProgram(int argc, const char * const * argv, std::ostream & output, std::ostream & messages)
{
  Options  options;
  CLI::App app(description, "shear-warp-mip");
  app.footer(examples);
  DefineOptions(app, options);

  const auto fail = [&messages](const std::string & text) {
    messages << "shear-warp-mip: " << MakeOneLine(text) << std::endl;
    return EXIT_FAILURE;
  };
  try
  {
    app.parse(CollectArguments(argc, argv));
    Messages steps(messages, options);
    if (app.count("--write-phantom") > 0)
    {
      WritePhantom(options);
    }
    else
    {
      Run(options, steps);
    }
    return EXIT_SUCCESS;
  }
  catch (const CLI::ParseError & error)
  {
    return error.get_exit_code() == 0 ? app.exit(error, output, messages) : fail(Reword(app, error));
  }
  catch (const itk::ExceptionObject & error)
  {
    return fail(error.GetDescription());
  }
  catch (const std::bad_alloc &)
  {
    return fail("not enough memory");
  }
  catch (const std::filesystem::filesystem_error & error)
  {
    return fail("'" + error.path1().string() + "': " + error.code().message());
  }
  catch (const std::exception & error)
  {
    return fail(error.what());
  }
}
