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

#include "Input.h"
#include "Output.h"
#include "Phantom.h"
#include "Projection.h"

#include "itkCompositeTransform.h"
#include "itkMultiThreaderBase.h"
#include "itkShearWarpMIPView.h"
#include "itkVersion.h"

#include <CLI/CLI.hpp>

#include <chrono>
#include <cmath>
#include <map>
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
  "INPUT is an image that ITK reads (NIfTI, NRRD, MetaImage, DICOM, ...) or a folder of DICOM files.\n"
  "OUTPUT's extension gives its format: .mha, .nrrd, .nii and .nii.gz keep the image's values and pixel type;\n"
  ".png has 8 bits, see --window. Sizes and positions of the output are in mm in the view plane.";

constexpr auto examples = "Examples:\n"
                          "  shear-warp-mip tof.nii.gz mip.png --view superior\n"
                          "      seen from above, as a picture\n"
                          "  shear-warp-mip dicom-folder/ mip.nrrd --azimuth 30 --elevation 15\n"
                          "      left anterior oblique 30 degrees, cranial 15 degrees, with the image's values\n"
                          "  shear-warp-mip tof.nrrd cine.png --frames 36\n"
                          "      a full turn around the patient, cine-000.png to cine-035.png\n"
                          "  shear-warp-mip --write-phantom head.nrrd\n"
                          "      an image to try";

const std::map<std::string, Direction> directions = {
  { "anterior", Direction::Anterior }, { "posterior", Direction::Posterior }, { "left", Direction::Left },
  { "right", Direction::Right },       { "superior", Direction::Superior },   { "inferior", Direction::Inferior }
};

// LPS: x to the left, y to posterior, z to superior
const std::map<std::string, unsigned int> turningAxes = { { "left", 0 }, { "posterior", 1 }, { "superior", 2 } };

// each has a transform in memory before the first is projected
constexpr unsigned int mostFrames = 100000;

struct Options
{
  std::string         input;
  std::string         output;
  std::string         phantom;
  std::string         series;
  std::string         view{ "anterior" };
  double              azimuth{ 0.0 };
  double              elevation{ 0.0 };
  std::string         transform;
  std::vector<double> spacing;
  std::vector<double> size;
  std::vector<double> window;
  double              background{ 0.0 };
  bool                hasBackground{ false };
  unsigned int        oversampling{ 1 };
  unsigned int        frames{ 0 };
  std::string         axis{ "superior" };
  unsigned int        threads{ 0 };
  bool                verbose{ false };
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

/** Accepts finite numbers from \a lowest on. */
CLI::Validator
Number(const std::string & name, double lowest, bool whole = false)
{
  const auto check = [=](const std::string & text) {
    double value = 0.0;
    return CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value >= lowest &&
               (!whole || (value == std::trunc(value) && value <= 0x1p53))
             ? std::string()
             : '\'' + text + "' is not " + name;
  };
  return CLI::Validator(check, "");
}

std::string
GetVersionText()
{
  return std::string("shear-warp-mip " ShearWarpMIP_VERSION ", ITK ") + itk::Version::GetITKVersion();
}

/** Thrown as soon as an option is met that needs no INPUT and OUTPUT. */
class PhantomWanted : public CLI::Success
{};

void
DefineOptions(CLI::App & app, Options & options)
{
  constexpr double tiny = std::numeric_limits<double>::min();
  const auto       angle = Number("a finite angle", std::numeric_limits<double>::lowest());
  const auto       count = Number("a whole number of at least 1", 1.0, true);

  app.add_option("INPUT", options.input, "Image file, or DICOM folder")->required();
  app.add_option("OUTPUT", options.output, "File to write")->required();
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
                "Linear ITK transform from view space (right, down, away; mm) to the image's space")
    ->excludes(view)
    ->excludes(azimuth)
    ->excludes(elevation)
    ->type_name("FILE")
    ->group("View");

  const auto frames =
    app.add_option("--frames", options.frames, "A full turn in N frames: a 3D stack, or numbered PNGs")
      ->check(CLI::Range(1u, mostFrames))
      ->type_name("N")
      ->group("Turning series");
  app.add_option("--axis", options.axis, "The patient's axis to turn about, towards the left from anterior")
    ->check(CLI::IsMember(GetKeys(turningAxes)))
    ->capture_default_str()
    ->needs(frames)
    ->group("Turning series");

  app
    .add_option(
      "--spacing", options.spacing, "Distance of pixels: one value, or two as 0.5,0.8; default: the image's smallest")
    ->check(Number("a positive number", tiny))
    ->delimiter(',')
    ->expected(1)
    ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
    ->type_name("MM")
    ->group("Picture");
  app.add_option("--size", options.size, "Width and height in pixels; default: all of the image is in the picture")
    ->check(count)
    ->expected(2)
    ->type_name("PIXELS")
    ->group("Picture");
  app
    .add_option_function<double>(
      "--background",
      [&options](double value) {
        options.background = value;
        options.hasBackground = true;
      },
      "Value beside the image; default: 0, or the image's minimum if that is negative")
    ->type_name("VALUE")
    ->group("Picture");
  app
    .add_option("--oversampling",
                options.oversampling,
                "1, or 2 for twice as many samples along both axes of each slice: sharper, up to three times as slow")
    ->check(CLI::IsMember({ 1, 2 }))
    ->capture_default_str()
    ->group("Picture");
  app
    .add_option("--window",
                options.window,
                "LOW and HIGH values that become black and white in a PNG; default: percentiles 1 and 99.8 of "
                "the pixels that are not background")
    ->check(Number("a finite number", std::numeric_limits<double>::lowest()))
    ->expected(2)
    ->type_name("VALUE")
    ->group("Picture");

  app.add_option("--threads", options.threads, "Threads to use; default: all processors")
    ->check(count)
    ->type_name("N")
    ->group("Program");
  app.add_flag("--verbose", options.verbose, "Tells what is done and how long it takes")->group("Program");
  app
    .add_option_function<std::string>(
      "--write-phantom",
      [&options](const std::string & path) {
        options.phantom = path;
        throw PhantomWanted();
      },
      "Writes a synthetic MR angiogram of a head, instead of INPUT and OUTPUT")
    ->trigger_on_parse()
    ->type_name("FILE")
    ->group("Program");
  app.set_version_flag("--version", GetVersionText(), "Prints the version")->group("Program");
  app.set_help_flag("-h,--help", "Prints this text")->group("Program");
}

std::vector<TransformPointer>
MakeFrameTransforms(const Options & options, const TransformPointer & given, const itk::ImageBase<3> * volume)
{
  TransformPointer view = given;
  if (!view)
  {
    view =
      itk::ShearWarpMIPView::MakeTransform(volume, directions.at(options.view), options.azimuth, options.elevation);
  }
  if (options.frames == 0)
  {
    return { view };
  }

  std::vector<TransformPointer> transforms;
  itk::Vector<double, 3>        axis(0.0);
  axis[turningAxes.at(options.axis)] = 1.0;
  for (unsigned int frame = 0; frame < options.frames; ++frame)
  {
    const auto turn = itk::AffineTransform<double, 3>::New();
    turn->SetCenter(itk::ShearWarpMIPView::GetCentre(volume));
    turn->Rotate3D(axis, itk::Math::twopi * frame / options.frames);
    const auto composite = itk::CompositeTransform<double, 3>::New();
    composite->AddTransform(turn);
    composite->AddTransform(view);
    transforms.emplace_back(composite.GetPointer());
  }
  return transforms;
}

std::string
Describe(const ScalarImage & volume)
{
  std::ostringstream text;
  text << volume.image->GetLargestPossibleRegion().GetSize() << " voxels, spacing " << volume.image->GetSpacing()
       << " mm, " << itk::ImageIOBase::GetComponentTypeAsString(volume.componentType);
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
  FrameDone(const FrameReport & report) const
  {
    if (m_Options.verbose)
    {
      m_Stream << "frame " << report.frame << ": axis " << report.principalAxis << ", "
               << (report.preparationSeconds > 0.0 ? "volume transposed in " + Milliseconds(report.preparationSeconds)
                                                   : "nothing to prepare")
               << ", projected in " << Milliseconds(report.projectionSeconds) << ", warped in "
               << Milliseconds(report.warpSeconds) << std::endl;
    }
    else if (m_Options.frames > 0 && IsTerminal())
    {
      const auto done = report.frame + 1;
      m_Stream << "\rframe " << done << " of " << m_Options.frames << (done == m_Options.frames ? "\n" : "")
               << std::flush;
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
  OutputFiles files(options.phantom, OutputFiles::Kind::Volume);
  files.WriteValues(MakePhantom());
  files.Commit();
}

void
Run(const Options & options, Messages & messages)
{
  if (options.window.size() == 2 && !(options.window[0] < options.window[1]))
  {
    throw std::runtime_error("--window: LOW must be less than HIGH");
  }
  if (options.spacing.size() > 2)
  {
    throw std::runtime_error("--spacing: one or two values are needed");
  }
  if (options.threads > 0)
  {
    itk::MultiThreaderBase::SetGlobalMaximumNumberOfThreads(options.threads);
    itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(options.threads);
  }
  OutputFiles files(options.output, options.frames > 0 ? OutputFiles::Kind::Series : OutputFiles::Kind::Still);
  const TransformPointer given = options.transform.empty() ? nullptr : ReadLinearTransform(options.transform);

  const ScalarImage volume =
    ReadVolume(options.input, options.series, [&](const std::string & text) { messages.Warn(text); });
  messages.StepDone("read " + options.input + ", " + Describe(volume));

  ProjectionOptions projection;
  projection.transforms = MakeFrameTransforms(options, given, volume.image);
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
  if (options.hasBackground)
  {
    projection.background = options.background;
  }
  const Frames frames =
    ProjectFrames(volume, projection, [&](const FrameReport & report) { messages.FrameDone(report); });
  messages.StepDone("projected, " + Describe(frames.stack));

  if (files.IsWindowed())
  {
    std::optional<itk::Vector<double, 2>> window;
    if (!options.window.empty())
    {
      window = itk::Vector<double, 2>(options.window.data());
    }
    files.WriteWindowed(frames, window);
  }
  else
  {
    files.WriteValues(frames.stack);
  }
  files.Commit();
  messages.StepDone("wrote " + options.output);
}

std::string
MakeOneLine(const std::string & text)
{
  // without ITK's beginning, "ITK ERROR: Class(0x123): "
  std::istringstream words(std::regex_replace(text, std::regex("ITK ERROR: |\\w+\\(0x[0-9a-f]+\\): "), ""));
  std::string        line;
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
    bool phantomWanted = false;
    try
    {
      app.parse(argc, argv);
    }
    catch (const PhantomWanted &)
    {
      phantomWanted = true;
    }
    catch (const CLI::ParseError & error)
    {
      return error.get_exit_code() == 0 ? app.exit(error, output, messages) : fail(error.what());
    }

    Messages steps(messages, options);
    if (phantomWanted)
    {
      WritePhantom(options);
    }
    else
    {
      Run(options, steps);
    }
    return EXIT_SUCCESS;
  }
  catch (const itk::ExceptionObject & error)
  {
    return fail(error.GetDescription());
  }
  catch (const std::bad_alloc &)
  {
    return fail("not enough memory");
  }
  catch (const std::exception & error)
  {
    return fail(error.what());
  }
}
