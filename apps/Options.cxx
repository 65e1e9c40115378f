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
#include "Options.h"

#include "Frames.h"
#include "Help.h"
#include "Output.h"
#include "Overlay.h"
#include "Text.h"

#include "itkVersion.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <regex>
#include <sstream>

namespace
{
constexpr auto description =
  "Maximum intensity projection (MIP) of a 3D image from any direction.\n"
  "INPUT is an image that ITK reads (NIfTI, NRRD, MetaImage, DICOM, ...) or a folder whose DICOM files, "
  "also in folders, are searched. The program projects each component of its pixels by itself. A 4D image gives one "
  "frame for each point in time.\n"
  "The extension of OUTPUT is its format: .mha, .nrrd, .nii and .nii.gz keep the image's values and pixel type, a "
  "series as a 3D stack; .png, .jpg and .tif have 8 bits, see --window, a series as numbered files; .gif, .apng and "
  ".mp4 are animations, made by the program ffmpeg; .html is a page that turns and plays a series in any browser. A "
  "folder, new with a / at its end or empty, gets a DICOM series.\n"
  "Sizes and positions of the output are in mm in the view plane. Names of values may be in capitals, and as short as "
  "they are clear. Several numbers have commas or spaces between them.";

constexpr auto examples = "Examples:\n"
                          "  shear-warp-mip tof.nii.gz mip.png --view inferior\n"
                          "      a picture, seen from the feet as axial slices are\n"
                          "  shear-warp-mip dicom-folder/ mip.nrrd --azimuth 30 --elevation 15\n"
                          "      left anterior oblique 30 degrees, cranial 15 degrees, with the image's values\n"
                          "  shear-warp-mip tof.nrrd turn.html --frames 72\n"
                          "      a page that turns, for any browser\n"
                          "  shear-warp-mip tof.nrrd rocking.mp4 --frames 48 --rocking 60 --elevation 15\n"
                          "      an animation, 30 degrees to either side and back, from somewhat above\n"
                          "  shear-warp-mip dicom-folder/ turn/ --frames 72\n"
                          "      a DICOM series for the archive; --dicom-out writes one beside another OUTPUT\n"
                          "  shear-warp-mip ct.nrrd slabs.nrrd --view superior --sliding-slab 10 5\n"
                          "      slabs of 10 mm from top to bottom, one every 5 mm\n"
                          "  shear-warp-mip ct.nrrd bones.png --window bone\n"
                          "      a CT in the usual window of bones\n"
                          "  shear-warp-mip --write-phantom head.nrrd\n"
                          "      an image to try";

// in Hounsfield units, but the last in SUV
const std::map<std::string, std::array<double, 2>> windows = { { "lung", { { -1350.0, 150.0 } } },
                                                               { "bone", { { -450.0, 1050.0 } } },
                                                               { "angio", { { 0.0, 600.0 } } },
                                                               { "brain", { { 0.0, 80.0 } } },
                                                               { "pet", { { 0.0, 10.0 } } } };

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

/** Accepts one of \a names, in capitals too, or a beginning that only one has, or one of \a synonyms. */
CLI::Validator
Choice(const std::vector<std::string> & names, const std::map<std::string, std::string> & synonyms = {})
{
  const auto choose = [=](std::string & text) {
    const std::string word = ToLower(text);
    if (const auto synonym = synonyms.find(word); synonym != synonyms.end())
    {
      text = synonym->second;
      return std::string();
    }
    const std::string found = FindName(word, names);
    if (found.empty())
    {
      return '\'' + text + "' is not one of " + CLI::detail::join(names, ", ") + Suggest(word, names);
    }
    text = found;
    return std::string();
  };
  return CLI::Validator(choose, '{' + CLI::detail::join(names, ",") + '}');
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
DescribeWindows()
{
  std::ostringstream text;
  for (const auto & [name, window] : windows)
  {
    text << (text.tellp() > 0 ? ", " : "") << name << " (" << window[0] << " to " << window[1]
         << (name == "pet" ? " SUV)" : " HU)");
  }
  return text.str();
}

std::string
GetVersionText()
{
  return std::string("shear-warp-mip " ShearWarpMIP_VERSION ", ITK ") + itk::Version::GetITKVersion();
}

} // namespace

void
DefineOptions(CLI::App & app, Options & options)
{
  app.description(description);
  app.footer(examples);

  constexpr double tiny = std::numeric_limits<double>::min();
  const auto       angle = Number("a finite angle", std::numeric_limits<double>::lowest());
  const auto       count = Number("a whole number of at least 1", 1.0, true);

  const auto input =
    app.add_option("INPUT", options.input, "Image file, or DICOM folder (or its DICOMDIR)")->required();
  const auto output =
    app.add_option("OUTPUT,-o,--output", options.output, "File to write, or FOLDER/ for a DICOM series")->required();
  app
    .add_option("--series",
                options.series,
                "DICOM series, if the folder has several: its number in the list that is then printed, a part of its "
                "description, or its instance UID")
    ->type_name("SERIES");

  const auto add = [&app](const std::string & group,
                          const std::string & names,
                          auto &              value,
                          const std::string & type,
                          const std::string & text) {
    CLI::Option * const option = app.add_option(names, value, text)->group(group);
    return type.empty() ? option : option->type_name(type);
  };
  // of numbers or names, as many as are given
  const auto addList = [&add](auto &&... arguments) {
    return add(arguments...)->delimiter(',')->expected(1)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  };
  const auto addFlag =
    [&app](const std::string & group, const std::string & names, bool & value, const std::string & text) {
      return app.add_flag(names, value, text)->group(group);
    };

  const auto view = add("View",
                        "--view",
                        options.view,
                        "",
                        "Side from which the patient is seen; superior: from above, the patient's left at the "
                        "left; inferior: from the feet, as axial slices are read")
                      ->transform(Choice(GetKeys(directions)))
                      ->capture_default_str();
  const auto azimuth = add("View",
                           "--azimuth",
                           options.azimuth,
                           "DEGREES",
                           "Degrees to go on, towards the right of the picture (LAO positive)")
                         ->check(angle);
  const auto elevation =
    add("View", "--elevation", options.elevation, "DEGREES", "Degrees to rise then, towards its top (cranial positive)")
      ->check(angle);
  add("View",
      "--transform",
      options.transform,
      "FILE",
      "Linear ITK transform from view space (right, down, away; mm) to the image's space; depths are then "
      "from its origin. Several are a series of frames")
    ->excludes(view)
    ->excludes(azimuth)
    ->excludes(elevation);

  const auto frames = add("Turning series", "--frames", options.frames, "N", "A turn in N frames: a series")
                        ->check(CLI::Range(1u, MostFrames));
  addList("Turning series",
          "--axis",
          options.axis,
          "NAME or X Y Z",
          "To turn about, right-handed: the patient's left, posterior or superior, the image's i, j or k, or a "
          "direction X Y Z (LPS); default: superior, towards the patient's left from anterior")
    ->needs(frames);
  add("Turning series",
      "--center,--centre",
      options.centre,
      "X Y Z",
      "A point of the axis in the patient's space (LPS), in mm; default: the image's centre")
    ->check(Number("a finite number", std::numeric_limits<double>::lowest()))
    ->delimiter(',')
    ->expected(3)
    ->needs(frames);
  const auto range = add("Turning series",
                         "--range",
                         options.range,
                         "DEGREES",
                         "How far to turn, negative to the other side; default: 360")
                       ->check(angle)
                       ->needs(frames);
  add("Turning series",
      "--rocking",
      options.rocking,
      "DEGREES",
      "Turn to and fro instead, over so many degrees in all: from the view half of them to one side, then to the "
      "other, and back, as a sine whose ends are frames; two frames are the ends. Fit to be repeated")
    ->check(angle)
    ->needs(frames)
    ->excludes(range);
  addList("Turning series",
          "--elevations",
          options.elevations,
          "DEGREES",
          "A turn at each of these elevations, as -30,0,30, one after the other; in a page drag up and down")
    ->check(angle)
    ->needs(frames)
    ->excludes(elevation)
    ->excludes(app.get_option("--transform"));
  add("Turning series",
      "--rate",
      options.rate,
      "FPS",
      "Frames per second of an animation or page; default: the series, or one turn, in four seconds, from 5 to "
      "25")
    ->check(CLI::Range(0.1, 100.0));
  add("Turning series",
      "--page-bits",
      options.pageBits,
      "",
      "Bits of a page's pixels: 8 for twice the window's range, or 16 for all values, two to four times as "
      "large")
    ->check(CLI::IsMember({ "8", "16" }))
    ->default_str("8");

  addList("Picture",
          "--spacing",
          options.spacing,
          "MM",
          "Distance of pixels: one value, or two for x and y; default: the image's smallest")
    ->check(Number("a positive number; decimals have a point", tiny));
  add("Picture", "--size", options.size, "WIDTH HEIGHT", "In pixels; default: all of the image is in the picture")
    ->check(count)
    ->delimiter(',')
    ->expected(2);
  add("Picture",
      "--background",
      options.background,
      "VALUE",
      "Value beside the image; default: 0, or the image's minimum if that is negative")
    ->check(Value());
  const auto oversampling =
    add("Picture",
        "--oversampling",
        options.oversampling,
        "",
        "1, or 2 for twice as many samples along both axes of each slice: sharper, up to three times as slow")
      ->check(CLI::IsMember({ "1", "2" }))
      ->capture_default_str();
  const auto exact = addFlag("Picture",
                             "--exact",
                             options.isExact,
                             "The maximum of the interpolated image along each pixel's ray, in closed form: "
                             "without steps between samples, 7 to 60 times as slow")
                       ->excludes(oversampling);
  const auto window =
    addList("Picture",
            "--window",
            options.window,
            "LOW HIGH or NAME",
            "Values that become black and white in pictures and animations, and at first in a page "
            "(white and black if DICOM is MONOCHROME1), or the name of a usual window: " +
              DescribeWindows() + "; default: percentiles 1 and 99.8 of the pixels that are not background");
  add("Picture",
      "--wl",
      options.levelAndWidth,
      "LEVEL WIDTH",
      "The middle of the window and its width, instead of --window")
    ->check(Number("a finite number", std::numeric_limits<double>::lowest()))
    ->delimiter(',')
    ->expected(2)
    ->excludes(window);
  addFlag("Picture",
          "--no-labels",
          options.isUnlabelled,
          "No letters of the patient's sides (L, R, A, P, H, F) at the edges of pictures and animations; a page "
          "hides them and the scale bar at first");
  addFlag("Picture",
          "--annotate",
          options.isAnnotated,
          "A scale bar, and where each frame is seen from (LAO 30 CRA 15), in pictures and animations");

  const auto slab = add("Projection",
                        "--slab",
                        options.slab,
                        "NEAR FAR",
                        "Only what lies between these depths in mm behind the image's centre along the view "
                        "(negative: nearer to the viewer; -inf and inf: no limit)")
                      ->check(Bound())
                      ->delimiter(',')
                      ->expected(2);
  const auto slidingSlab = add("Projection",
                               "--sliding-slab",
                               options.slidingSlab,
                               "THICKNESS STEP",
                               "Slabs from the image's front to its back, one every STEP mm: a 3D stack by depth "
                               "of the slabs' middles, or numbered PNGs")
                             ->check(Number("a positive number", tiny))
                             ->delimiter(',')
                             ->expected(2)
                             ->excludes(slab)
                             ->excludes(frames);
  add("Projection",
      "--mode",
      options.mode,
      "",
      "What a ray shows of the values along it; the absolute maximum keeps its sign")
    ->transform(Choice(GetKeys(modes), { { "mip", "maximum" }, { "minip", "minimum" } }))
    ->capture_default_str();
  add("Projection",
      "--local-maximum",
      options.localMaximum,
      "THRESHOLD",
      "Rays end behind their first local maximum of at least this value, so that a near vessel hides a "
      "brighter one behind it (first local minimum of at most this value with --mode minimum)")
    ->check(Value())
    ->excludes(exact);
  const auto mask = add("Projection",
                        "--mask",
                        options.mask,
                        "FILE",
                        "Only voxels where this image is not 0; it has whole numbers and INPUT's grid")
                      ->excludes(exact);
  const auto maskLabel =
    add("Projection", "--mask-label", options.maskLabel, "N", "Only voxels where the mask is N, at least 1")
      ->check(count)
      ->needs(mask);
  add("Projection",
      "--remove-label",
      options.removedLabels,
      "N",
      "All voxels but those where the mask is one of these labels, each at least 1: takes bone or the table "
      "out")
    ->check(count)
    ->delimiter(',')
    ->needs(mask)
    ->excludes(maskLabel);
  add("Projection",
      "--crop",
      options.crop,
      "X0 X1 Y0 Y1 Z0 Z1",
      "Only what lies in this box of the patient's space, in mm (LPS: x to the left, y to posterior, z to "
      "superior; -inf and inf: no limit)")
    ->check(Bound())
    ->delimiter(',')
    ->expected(6);
  add("Projection",
      "--attenuation",
      options.attenuation,
      "RATE",
      "Values fade to the background with depth: at d mm behind the front of the sphere that holds the "
      "image or, if that is deeper, of the slab, to exp(-RATE d) of their difference; RATE is per mm")
    ->check(Number("a finite number of at least 0", 0.0))
    ->excludes(exact);
  add("Projection",
      "--depth",
      options.depth,
      "FILE",
      "Also writes the depth of each pixel's value, in mm behind the image's centre along the view: floats "
      "in .mha, .nrrd, .nii or .nii.gz, not-a-number where nothing is, which ITK reads as 0 from NIfTI");
  add("Projection",
      "--depth-color,--depth-colour",
      options.depthColour,
      "FILE",
      "Also writes a .png, or numbered ones or an animation of a series: coloured by depth from red, the "
      "nearest of what is bright, to blue, the farthest; as bright as OUTPUT with --window; black where "
      "nothing is");
  add("Turning series",
      "--dicom-out",
      options.dicomOut,
      "DIR",
      "Also writes a DICOM series, one file for each picture, into this folder, which must be new or empty; "
      "patient, study and frame of reference are those of INPUT if that is DICOM");
  addFlag("Turning series",
          "--multi-frame",
          options.isMultiFrame,
          "The DICOM series is one multi-frame file of Secondary Capture, which archives play at --rate");
  addFlag("Picture",
          "--suv",
          options.isSuv,
          "Values of a DICOM PET series, INPUT or the overlay, are SUV by body weight (float), in all options "
          "and outputs");

  const auto overlay =
    add("Overlay",
        "--overlay",
        options.overlay,
        "FILE",
        "Another volume in INPUT's space, with a grid of its own, as INPUT can be: its maximum in colour over "
        "pictures, animations, pages and --dicom-out");
  add("Overlay", "--overlay-series", options.overlaySeries, "SERIES", "As --series, for the overlay")->needs(overlay);
  add("Overlay",
      "--overlay-transform",
      options.overlayTransform,
      "FILE",
      "Linear ITK transform from INPUT's space to the overlay's, as ITK resamples the overlay on INPUT's grid")
    ->needs(overlay);
  add("Overlay",
      "--overlay-color,--overlay-colour",
      options.overlayColour,
      "NAME",
      "Colour map of the overlay: " + CLI::detail::join(GetKeys(colourMaps), ", "))
    ->transform(Choice(GetKeys(colourMaps), { { "gray", "grey" } }).description(""))
    ->capture_default_str()
    ->needs(overlay);
  add("Overlay",
      "--overlay-window",
      options.overlayWindow,
      "VALUE",
      "LOW and HIGH values of the overlay that get the first and the last colour; up to LOW it is "
      "transparent; default: as --window")
    ->check(Number("a finite number", std::numeric_limits<double>::lowest()))
    ->delimiter(',')
    ->expected(2)
    ->needs(overlay);
  add("Overlay", "--opacity", options.opacity, "", "Of the overlay above LOW: from 0, only INPUT is seen, to 1")
    ->check(MakeCheck("a number from 0 to 1", [](double value) { return value >= 0.0 && value <= 1.0; }))
    ->capture_default_str()
    ->needs(overlay);
  add("Overlay",
      "--segments",
      options.segments,
      "FILE",
      "Image of labels or DICOM SEG in INPUT's space, with a grid of its own: their outlines over pictures, "
      "animations, pages and --dicom-out, in the colours of a SEG or of a .seg.nrrd of 3D Slicer, or in others");

  addFlag("Projection",
          "--in-place",
          options.isInPlace,
          "OUTPUT is a slice in the patient's space, as thick as what is projected, which viewers show with INPUT; "
          "only .mha, .nrrd, .nii and .nii.gz")
    ->excludes(frames)
    ->excludes(slidingSlab);

  add("Program", "--threads", options.threads, "N", "Threads to use; default: all processors")->check(count);
  addFlag("Program", "-v,--verbose", options.verbose, "Says what is done and how long it takes");

  const auto phantom = app
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
  add("Program", "--phantom-size", options.phantomSize, "X Y Z", "Its size in voxels; default: 256 256 128")
    ->check(MakeCheck("a whole number from 1 to 4096",
                      [](double value) { return value >= 1.0 && value <= 4096.0 && value == std::trunc(value); }))
    ->needs(phantom)
    ->delimiter(',')
    ->expected(3);
  app.set_version_flag("--version", GetVersionText(), "Prints the version")->group("Program");
  app.set_help_flag("-h,--help", "Prints the usual options")->group("Program");
  app.set_help_all_flag("--help-all", "Prints all options")->group("Program");
  app.formatter(std::make_shared<HelpFormatter>());

  // what follows the values of an option is INPUT or OUTPUT
  for (CLI::Option * const option : app.get_options([](const CLI::Option *) { return true; }))
  {
    option->allow_extra_args(false);
  }
}

std::optional<std::array<double, 2>>
GetWindow(const Options & options)
{
  std::array<double, 2> window{};
  if (!options.levelAndWidth.empty())
  {
    const double level = options.levelAndWidth[0];
    const double width = options.levelAndWidth[1];
    if (!(width > 0.0))
    {
      throw std::runtime_error("--wl: WIDTH must be positive");
    }
    window = { { level - 0.5 * width, level + 0.5 * width } };
  }
  else if (options.window.empty())
  {
    return std::nullopt;
  }
  else if (const std::string name = FindName(options.window.front(), GetKeys(windows));
           options.window.size() == 1 && !name.empty())
  {
    window = windows.at(name);
  }
  else
  {
    bool isGood = options.window.size() == 2;
    for (std::size_t n = 0; n < 2 && isGood; ++n)
    {
      isGood = CLI::detail::lexical_cast(options.window[n], window[n]) && std::isfinite(window[n]);
    }
    if (!isGood)
    {
      throw std::runtime_error(
        "--window: '" + CLI::detail::join(options.window, " ") + "' is not two finite numbers LOW HIGH, nor one of " +
        CLI::detail::join(GetKeys(windows), ", ") + Suggest(options.window.front(), GetKeys(windows)));
    }
  }
  if (!(window[0] < window[1]))
  {
    throw std::runtime_error("--window: LOW must be less than HIGH");
  }
  return window;
}

void
UseOutputFolder(Options & options)
{
  if (options.output.empty())
  {
    throw std::runtime_error("OUTPUT is empty; see --help");
  }
  std::error_code ignored;
  if (options.output.back() != '/' && !std::filesystem::is_directory(options.output, ignored))
  {
    return;
  }
  if (!options.dicomOut.empty())
  {
    throw std::runtime_error("--dicom-out is not possible: OUTPUT is a folder for a DICOM series already");
  }
  if (options.isInPlace)
  {
    throw std::runtime_error("--in-place is not possible: OUTPUT is a folder, '" + options.output + "'");
  }
  options.dicomOut.swap(options.output);
}

void
Verify(const Options & options)
{
  GetWindow(options);
  if (options.overlayWindow.size() == 2 && !(options.overlayWindow[0] < options.overlayWindow[1]))
  {
    throw std::runtime_error("--overlay-window: LOW must be less than HIGH");
  }
  if (!(options.overlay.empty() && options.segments.empty()))
  {
    const std::string name = options.overlay.empty() ? "--segments" : "--overlay";
    if (!options.output.empty() && FindFormat(options.output) == FileFormat::Values)
    {
      throw std::runtime_error(
        name + " is for what is looked at: OUTPUT must be .png, .jpg, .tif, .gif, .apng, .mp4, .html or "
               "a folder for DICOM");
    }
    if (options.pageBits == 16u)
    {
      throw std::runtime_error("--page-bits 16 is not possible with " + name + ": the page holds colours, not values");
    }
    if (options.isMultiFrame)
    {
      throw std::runtime_error("--multi-frame has no colours: it is not possible with " + name);
    }
  }
  if (options.spacing.size() > 2)
  {
    throw std::runtime_error("--spacing: one or two values are needed");
  }
  if (!IsAxis(options.axis))
  {
    throw std::runtime_error("--axis: it must be left, posterior, superior, i, j, k or a direction X,Y,Z");
  }
  if (options.slab.size() == 2 && options.slab[0] > options.slab[1])
  {
    throw std::runtime_error("--slab: NEAR must not be greater than FAR");
  }
  if (options.pageBits && FindFormat(options.output) != FileFormat::Page)
  {
    throw std::runtime_error("--page-bits requires a page: .html");
  }
  if (options.isMultiFrame && options.dicomOut.empty())
  {
    throw std::runtime_error("--multi-frame requires --dicom-out");
  }
  for (std::size_t n = 0; n < options.crop.size(); n += 2)
  {
    if (options.crop[n] > options.crop[n + 1])
    {
      throw std::runtime_error("--crop: X0, Y0 and Z0 must not be greater than X1, Y1 and Z1");
    }
  }
}

std::vector<std::string>
CollectArguments(const CLI::App & app, int argc, const char * const * argv)
{
  // options that take so many numbers at most, with commas or spaces or both between them
  const std::map<std::string, std::size_t> most = { { "--axis", 3 },
                                                    { "--center", 3 },
                                                    { "--centre", 3 },
                                                    { "--crop", 6 },
                                                    { "--elevations", MostFrames },
                                                    { "--overlay-window", 2 },
                                                    { "--remove-label", MostFrames },
                                                    { "--phantom-size", 3 },
                                                    { "--size", 2 },
                                                    { "--slab", 2 },
                                                    { "--sliding-slab", 2 },
                                                    { "--spacing", 2 },
                                                    { "--window", 2 },
                                                    { "--wl", 2 } };

  const auto isNumber = [](const std::string & text) {
    double number = 0.0;
    return CLI::detail::lexical_cast(text, number);
  };
  // the numbers of a text, none if there is anything else in it
  const auto split = [&isNumber](std::string text) {
    std::replace(text.begin(), text.end(), ',', ' ');
    std::istringstream       words(text);
    std::vector<std::string> numbers;
    for (std::string word; words >> word;)
    {
      if (!isNumber(word))
      {
        return std::vector<std::string>();
      }
      numbers.push_back(word);
    }
    return numbers;
  };
  // -view is --view; the parser would take it for -v and -iew
  const auto complete = [&](const std::string & argument) {
    const bool isLong = app.get_option_no_throw('-' + argument.substr(0, argument.find('='))) != nullptr;
    const bool isWord = std::regex_search(argument.substr(0, 3), std::regex("^-[A-Za-z]."));
    const bool areShort = std::regex_match(argument.substr(0, 5), std::regex("-[hv]*(o.*)?"));
    return isWord && !isNumber(argument) && (isLong || !areShort) ? '-' + argument : argument;
  };
  std::vector<std::string> arguments;
  int                      n = 1;
  for (; n < argc && argv[n] != std::string("--"); ++n)
  {
    const std::string argument = complete(argv[n]);
    const std::size_t equals = argument.find('=');
    const auto        option = most.find(argument.substr(0, equals));
    if (option != most.end() && equals != std::string::npos)
    {
      const auto numbers = split(argument.substr(equals + 1));
      arguments.push_back(numbers.empty() ? argument : option->first + '=' + CLI::detail::join(numbers, ","));
    }
    else if (option != most.end())
    {
      std::vector<std::string> numbers;
      for (; numbers.size() < option->second && n + 1 < argc; ++n)
      {
        const std::string text = argv[n + 1];
        const auto        more = split(text);
        if (more.empty() && (numbers.empty() || text != ","))
        {
          break;
        }
        numbers.insert(numbers.end(), more.begin(), more.end());
      }
      arguments.push_back(argument);
      if (!numbers.empty())
      {
        arguments.push_back(CLI::detail::join(numbers, ","));
      }
    }
    else
    {
      // the parser takes -inf and -.5 for options unless a space is before them
      const bool looksLikeOption =
        argument.size() > 1 && argument[0] == '-' && (argument[1] < '0' || argument[1] > '9');
      arguments.push_back(looksLikeOption && isNumber(argument) ? ' ' + argument : argument);
    }
  }
  arguments.insert(arguments.end(), argv + std::min(n, argc), argv + argc);
  std::reverse(arguments.begin(), arguments.end());
  return arguments;
}

std::string
Reword(const CLI::App & app, const CLI::ParseError & error)
{
  if (dynamic_cast<const CLI::ExtrasError *>(&error))
  {
    std::vector<std::string> names;
    for (const CLI::Option * const option : app.get_options())
    {
      for (const std::string & name : option->get_lnames())
      {
        names.push_back("--" + name);
      }
    }
    const auto        extra = app.remaining();
    const std::string first = extra.front().substr(0, extra.front().find('='));
    const std::string hint = first[0] == '-' ? Suggest(first, names) : "";
    return CLI::detail::join(extra, " ") + " is not expected" + (hint.empty() ? "; see --help" : hint);
  }
  std::string text = std::string(error.what()).substr(0, MostCharacters);
  text = std::regex_replace(
    text, std::regex("At [Ll]east (\\d+) required but received (\\d+)"), "$1 values are needed, not $2");
  text = std::regex_replace(
    text, std::regex("At [Mm]ost (\\d+) required but received (\\d+)"), "at most $1 can be given, not $2");
  text = std::regex_replace(text, std::regex("1 required (.*) missing"), "a value is needed, $1");
  text = std::regex_replace(text, std::regex("(, \\w+):\\w+ in \\[.*"), "$1");
  text = std::regex_replace(text, std::regex("^--output"), "OUTPUT");
  text = std::regex_replace(text, std::regex("a value is needed, TEXT"), "a value is needed");
  return dynamic_cast<const CLI::RequiredError *>(&error) ? text + "; see --help" : text;
}
