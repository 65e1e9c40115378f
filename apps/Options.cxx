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

#include "ColourMaps.h"
#include "FileFormat.h"
#include "Help.h"
#include "Projection.h"
#include "RotationAxis.h"
#include "Text.h"

#include "itkVersion.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <regex>
#include <set>
#include <sstream>

namespace
{
constexpr auto description =
  "Maximum intensity projection (MIP) of a 3D image from any direction.\n"
  "INPUT is an image (DICOM, NIfTI, NRRD, MetaImage, TIFF, VTK, GIPL, MRC) or a folder. The program searches a folder, "
  "and the folders in it, for DICOM files. It projects each component of the pixels by itself. A 4D image gives one "
  "frame for each point in time.\n"
  "The extension of OUTPUT selects the format. Files .mha, .nrrd, .nii and .nii.gz keep the image's values and pixel "
  "type; a series is a 3D stack. Pictures .png, .jpg and .tif have 8 bits, see --window; a series is numbered files. "
  "Animations .gif, .apng and .mp4 are made by the program ffmpeg. A page .html turns and plays a series in any "
  "browser. If OUTPUT is an empty folder, or a new one with a / at its end, the program writes a DICOM series into "
  "it.\n"
  "If INPUT is a .nrrd or .mha that the program wrote, its pictures are written in any of these formats, without a "
  "new projection: project once, write many.\n"
  "Sizes and positions of the output are in mm in the view plane. Names of values may be in capitals, and may be "
  "shortened as long as they are unique. Separate several numbers by commas or spaces.";

constexpr auto examples =
  "Examples:\n"
  "  shear-warp-mip tof.nii.gz mip.png --view inferior\n"
  "      a picture, seen from the feet as axial slices are\n"
  "  shear-warp-mip dicom-folder/ mip.nrrd --azimuth 30 --elevation 15\n"
  "      the image's values, left anterior oblique 30 degrees, cranial 15 degrees\n"
  "  shear-warp-mip tof.nrrd turn.html --frames 72\n"
  "      a page that turns, for any browser\n"
  "  shear-warp-mip tof.nrrd rocking.mp4 --frames 48 --rocking --angular-range 60 --elevation 15\n"
  "      an animation, 30 degrees to either side and back, from somewhat above\n"
  "  shear-warp-mip dicom-folder/ turn/ --frames 72\n"
  "      a DICOM series for the archive; --dicom-out writes one beside another OUTPUT\n"
  "  shear-warp-mip turn.nrrd turn.gif\n"
  "      an animation of pictures that were projected before\n"
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

/** A hint if the text is a number with a comma. */
std::string
ExplainComma(const std::string & text)
{
  const std::string start = text.substr(0, 40); // std::regex needs stack for each character
  return std::regex_match(start, std::regex(" *[-+]?[0-9]*,[0-9]+")) ? "; decimals have a point" : "";
}

/** Accepts the numbers, or only the whole ones, that are \a good. */
CLI::Validator
MakeCheck(const std::string & name, const std::function<bool(double)> & good, bool isWhole = false)
{
  const auto check = [=](const std::string & text) {
    double value = 0.0;
    return CLI::detail::lexical_cast(text, value) && (!isWhole || value == std::trunc(value)) && good(value)
             ? std::string()
             : '\'' + Trim(text) + "' is not " + name + (isWhole ? "" : ExplainComma(text));
  };
  return CLI::Validator(check, "");
}

/** Accepts finite numbers from \a lowest on. */
CLI::Validator
Number(const std::string & name, double lowest, bool isWhole = false)
{
  return MakeCheck(
    name,
    [=](double value) { return std::isfinite(value) && value >= lowest && (!isWhole || value <= 0x1p53); },
    isWhole);
}

/** Accepts whole numbers from 1 to \a most. */
CLI::Validator
Count(unsigned int most)
{
  return MakeCheck(
    "a whole number from 1 to " + std::to_string(most),
    [most](double value) { return value >= 1.0 && value <= most; },
    true);
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

/** Accepts a number of voxels, or all. */
CLI::Validator
VoxelCount()
{
  const auto check = [](std::string & text) {
    constexpr unsigned int most = 65535;
    std::string            problem = ToLower(text) == "full" ? "" : Count(most)(text);
    return problem + (problem.empty() ? "" : ", nor full");
  };
  return CLI::Validator(check, "");
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

unsigned int
GetPageBits(const Options & options)
{
  return options.pageBits.value_or(options.isPageOfVolume && options.mode != "maximum" ? 16 : 8);
}

void
DefineOptions(CLI::App & app, Options & options)
{
  app.description(description);
  app.footer(examples);

  constexpr double tiny = std::numeric_limits<double>::min();
  const auto       angle = Number("a finite angle", std::numeric_limits<double>::lowest());
  const auto       count = Number("a whole number of at least 1", 1.0, true);

  const auto input = app.add_option("INPUT", options.input, "Image file, or DICOM folder (or its DICOMDIR)")
                       ->required()
                       ->group("Options, outputs, volumes");
  const auto output =
    app.add_option("OUTPUT,-o,--output", options.output, "File to write, or FOLDER/ for a DICOM series")
      ->required()
      ->group("Options, outputs");
  app
    .add_option("--series",
                options.series,
                "DICOM series, if the folder has several: its number in the printed list, a part of its description, "
                "or its instance UID")
    ->type_name("SERIES")
    ->group("Options, usual, volumes");
  app
    .add_option("--volume",
                options.volume,
                "Volume of a DICOM series or of a file that has several, such as echoes or points in time: its number, "
                "from 1 on")
    ->type_name("NUMBER")
    ->group("Options, volumes");

  // behind the title of a group: --help lists usual options, options of outputs go with frames that are projected
  // already, and options of volumes go with --write-volume
  const auto add = [&app](const std::string & group,
                          const std::string & names,
                          auto &              value,
                          const std::string & type,
                          const std::string & text) {
    CLI::Option * const option = app.add_option(names, value, text)->group(group);
    return type.empty() ? option : option->type_name(type);
  };
  // of numbers or names, one to so many
  const auto addList = [&add](int most, auto &&... arguments) {
    return add(arguments...)->delimiter(',')->expected(1, most)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  };
  const auto addFlag =
    [&app](const std::string & group, const std::string & names, bool & value, const std::string & text) {
      return app.add_flag(names, value, text)->group(group);
    };

  const auto view = add("View, usual",
                        "--view",
                        options.view,
                        "",
                        "Side from which the viewer looks; superior: from above, with the patient's left at the "
                        "left; inferior: from the feet, like axial slices")
                      ->transform(Choice(GetKeys(directions)))
                      ->capture_default_str();
  const auto azimuth = add("View, usual",
                           "--azimuth",
                           options.azimuth,
                           "DEGREES",
                           "Moves the viewer by this angle towards the right of the picture (LAO is positive)")
                         ->check(angle);
  const auto elevation =
    add("View, usual",
        "--elevation",
        options.elevation,
        "DEGREES",
        "After --azimuth, moves the viewer by this angle towards the top of the picture (cranial is positive)")
      ->check(angle);
  add("View",
      "--transform",
      options.transform,
      "FILE",
      "Linear ITK transform from view space (right, down, away; mm) to the image's space; depths are then "
      "measured from the origin of view space. A file with several transforms makes a series of frames; a composite is "
      "one transform")
    ->excludes(view)
    ->excludes(azimuth)
    ->excludes(elevation);

  const auto frames =
    add("Turning series, usual", "--frames", options.frames, "N", "Makes a series of N frames: a turn")
      ->check(Count(MostFrames));
  addList(3,
          "Turning series",
          "--rotation-axis",
          options.rotationAxis,
          "NAME or X Y Z",
          "Axis of the turn, right-handed: the patient's left, posterior or superior, the image's i, j or k, or a "
          "direction X Y Z (LPS); default: superior, from anterior towards the patient's left")
    ->needs(frames);
  add("Turning series",
      "--center,--centre",
      options.center,
      "X Y Z",
      "A point of the axis in the patient's space (LPS), in mm; default: the image's center")
    ->check(Number("a finite number", std::numeric_limits<double>::lowest()))
    ->delimiter(',')
    ->expected(3)
    ->needs(frames);
  add("Turning series, usual",
      "--angular-range",
      options.angularRange,
      "DEGREES",
      "Angle of the whole turn, negative to the other side; default: 360")
    ->check(angle)
    ->needs(frames);
  addFlag("Turning series, usual",
          "--rocking",
          options.isRocking,
          "Swings to and fro over the angular range instead of a turn: half of it to one side of the view, then to the "
          "other side, and back. The speed follows a sine, and both ends are frames. The series can repeat without a "
          "jump")
    ->needs(frames);
  addList(MostFrames,
          "Turning series",
          "--elevations",
          options.elevations,
          "DEGREES",
          "Makes a turn at each of these elevations, such as -30,0,30, one after the other; in a page, drag up and "
          "down")
    ->check(angle)
    ->needs(frames)
    ->excludes(elevation)
    ->excludes(app.get_option("--transform"));
  add("Turning series, outputs",
      "--rate",
      options.rate,
      "FPS",
      "Frames per second of an animation or page; by default the series, or one turn, takes four seconds, with 5 to "
      "25 frames per second")
    ->check(MakeCheck("a number from 0.1 to 100", [](double value) { return value >= 0.1 && value <= 100.0; }));

  addList(2,
          "Picture, usual",
          "--output-spacing",
          options.outputSpacing,
          "MM",
          "Distance of pixels: one value, or two for x and y; default: the image's smallest spacing")
    ->check(Number("a positive number; decimals have a point", tiny));
  add("Picture", "--size", options.size, "WIDTH HEIGHT", "Size in pixels; default: the picture shows the whole image")
    ->check(count)
    ->delimiter(',')
    ->expected(2);
  add("Picture",
      "--background",
      options.background,
      "VALUE",
      "Value of pixels beside the image; default: 0, or the image's minimum if it is negative")
    ->check(Value());
  const auto oversampling =
    add("Picture",
        "--oversampling",
        options.oversampling,
        "",
        "1, or 2 for twice as many samples along both axes of each slice, which is sharper and about three times as "
        "slow")
      ->check(CLI::IsMember({ "1", "2" }))
      ->capture_default_str();
  const auto exact = addFlag("Picture, usual",
                             "--exact",
                             options.isExact,
                             "Computes the maximum of the interpolated image along each pixel's ray in closed form, "
                             "instead of samples; 8 to 40 times as slow")
                       ->excludes(oversampling);
  const auto window =
    addList(2,
            "Picture, usual, outputs",
            "--window",
            options.window,
            "LOW HIGH or NAME",
            "Values that become black and white in pictures and animations, and in a page when it opens "
            "(white and black for DICOM MONOCHROME1), or the name of a usual window: " +
              DescribeWindows() + "; default: percentiles 1 and 99.8 of the pixels that are not background");
  add("Picture, usual, outputs",
      "--wl",
      options.levelAndWidth,
      "LEVEL WIDTH",
      "The middle of the window and its width, instead of --window")
    ->check(Number("a finite number", std::numeric_limits<double>::lowest()))
    ->delimiter(',')
    ->expected(2)
    ->excludes(window);
  addFlag("Picture, usual, outputs",
          "--no-labels",
          options.isUnlabelled,
          "Leaves out the letters of the patient's sides (L, R, A, P, H, F) at the edges of pictures and animations; a "
          "page hides them and the scale bar when it opens");
  addFlag("Picture, usual, outputs",
          "--annotate",
          options.isAnnotated,
          "Adds a scale bar and the angles of each frame's view (LAO 30 CRA 15) to pictures and animations");

  const auto slab = add("Projection, usual",
                        "--slab",
                        options.slab,
                        "NEAR FAR",
                        "Projects only samples between these depths, in mm behind the image's center along the view "
                        "(negative: nearer to the viewer; -inf and inf: no limit)")
                      ->check(Bound())
                      ->delimiter(',')
                      ->expected(2);
  const auto slidingSlab = add("Projection, usual",
                               "--sliding-slab",
                               options.slidingSlab,
                               "THICKNESS STEP",
                               "Projects slabs from the image's front to its back, one every STEP mm: a 3D stack by "
                               "the depth of the slabs' middles, or numbered PNGs")
                             ->check(Number("a positive number", tiny))
                             ->delimiter(',')
                             ->expected(2)
                             ->excludes(slab)
                             ->excludes(frames);
  add("Projection, usual",
      "--mode",
      options.mode,
      "",
      "Which value along a ray the picture shows; the absolute maximum keeps its sign")
    ->transform(Choice(GetKeys(modes),
                       { { "mip", "maximum" }, { "minip", "minimum" }, { "aip", "mean" }, { "average", "mean" } }))
    ->capture_default_str();
  add("Projection",
      "--interpolation",
      options.interpolation,
      "",
      "nearest is for labels: the picture then has only values of voxels")
    ->transform(Choice(GetKeys(interpolations)))
    ->capture_default_str();
  add("Projection",
      "--local-maximum",
      options.localMaximum,
      "THRESHOLD",
      "Rays end behind their first local maximum of at least this value, so that a near vessel hides a "
      "brighter one behind it (first local minimum of at most this value with --mode minimum)")
    ->check(Value())
    ->excludes(exact);
  const auto mask = add("Projection, usual",
                        "--mask",
                        options.mask,
                        "FILE",
                        "Projects only voxels where this image is not 0; it has whole numbers and INPUT's grid")
                      ->excludes(exact);
  const auto maskLabel =
    add("Projection", "--mask-label", options.maskLabel, "N", "Projects only voxels where the mask is N, at least 1")
      ->check(count)
      ->needs(mask);
  addList(MostFrames,
          "Projection, usual",
          "--remove-label",
          options.removedLabels,
          "N",
          "Leaves out voxels where the mask is one of these labels, each at least 1, such as bone or the table")
    ->check(count)
    ->needs(mask)
    ->excludes(maskLabel);
  add("Projection",
      "--crop",
      options.crop,
      "X0 X1 Y0 Y1 Z0 Z1",
      "Projects only samples in this box of the patient's space, in mm (LPS: x to the left, y to posterior, z to "
      "superior; -inf and inf: no limit)")
    ->check(Bound())
    ->delimiter(',')
    ->expected(6);
  add("Projection",
      "--attenuation",
      options.attenuation,
      "RATE",
      "Fades values to the background with depth: the difference from the background becomes exp(-RATE d) times "
      "as large. d is the depth in mm behind the front of the sphere about the image or, if that is deeper, of the "
      "slab. RATE is per mm")
    ->check(Number("a finite number of at least 0", 0.0))
    ->excludes(exact);
  add("Projection",
      "--depth",
      options.depth,
      "FILE",
      "Also writes the depth of each pixel's value, in mm behind the image's center along the view, as floats "
      "in .mha, .nrrd, .nii or .nii.gz; pixels without a value are not-a-number, which ITK reads as 0 from NIfTI");
  add("Projection",
      "--depth-color,--depth-colour",
      options.depthColour,
      "FILE",
      "Also writes a picture coloured by depth: a .png, or for a series numbered ones or an animation. Of the bright "
      "pixels, the nearest are red and the farthest blue. The brightness is as in OUTPUT with --window; pixels "
      "without a value are black");
  add("Turning series, usual, outputs",
      "--dicom-out",
      options.dicomOut,
      "DIR",
      "Also writes a DICOM series, one file for each picture, into this folder, which must be new or empty. "
      "Patient, study and frame of reference come from INPUT if it is DICOM");
  addFlag("Turning series, outputs",
          "--multi-frame",
          options.isMultiFrame,
          "Writes the DICOM series as one multi-frame file of Secondary Capture, which archives play at --rate");
  addFlag("Picture, usual, volumes",
          "--suv",
          options.isSuv,
          "Converts the values of a DICOM PET series, INPUT or the overlay, to SUV by body weight (float), in all "
          "options and outputs");

  const auto overlay =
    add("Overlay, usual",
        "--overlay",
        options.overlay,
        "FILE",
        "Shows the maximum of another volume in colour over pictures, animations, pages and --dicom-out. It is a "
        "file or folder like INPUT, in INPUT's space, on any grid");
  add("Overlay", "--overlay-series", options.overlaySeries, "SERIES", "Like --series, for the overlay")->needs(overlay);
  add("Overlay", "--overlay-volume", options.overlayVolume, "NUMBER", "Like --volume, for the overlay")->needs(overlay);
  add("Overlay",
      "--overlay-transform",
      options.overlayTransform,
      "FILE",
      "Linear ITK transform from INPUT's space to the overlay's, with which ITK resamples the overlay on INPUT's grid")
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
      "LOW and HIGH values of the overlay, for the first and the last colour; up to LOW the overlay is transparent; "
      "default: as for --window")
    ->check(Number("a finite number", std::numeric_limits<double>::lowest()))
    ->delimiter(',')
    ->expected(2)
    ->needs(overlay);
  add("Overlay",
      "--opacity",
      options.opacity,
      "",
      "Opacity of the overlay above LOW, from 0 (only INPUT is visible) to 1")
    ->check(MakeCheck("a number from 0 to 1", [](double value) { return value >= 0.0 && value <= 1.0; }))
    ->capture_default_str()
    ->needs(overlay);
  add("Overlay",
      "--segments",
      options.segments,
      "FILE",
      "Draws the outlines of labels over pictures, animations, pages and --dicom-out. FILE is an image of labels or a "
      "DICOM SEG in INPUT's space, on any grid. Colours come from the SEG or 3D Slicer's .seg.nrrd, if any");

  addFlag("Projection",
          "--in-place",
          options.isInPlace,
          "Writes OUTPUT as a slice in the patient's space, as thick as the projected depths, so that viewers can show "
          "it with INPUT; only .mha, .nrrd, .nii and .nii.gz")
    ->excludes(frames)
    ->excludes(slidingSlab);

  add("Page, outputs",
      "--page-bits",
      options.pageBits,
      "",
      "Bits per pixel or voxel of a page: 8 stores values in twice the range of the window, and cuts others; 16 stores "
      "the whole range, and makes the page two to four times as large; default: 8, or 16 for a volume whose --mode is "
      "not maximum")
    ->check(CLI::IsMember({ "8", "16" }));
  const auto pageVolume =
    addFlag("Page, usual",
            "--page-volume",
            options.isPageOfVolume,
            "Makes a page that holds the volume instead of frames, and projects it in the browser: it turns about all "
            "axes, cuts slabs and shows places. Only what is not background is kept; --mask and --crop have their "
            "effect on voxels")
      ->excludes(frames);
  for (const std::string name : { "--sliding-slab",
                                  "--size",
                                  "--background",
                                  "--oversampling",
                                  "--local-maximum",
                                  "--attenuation",
                                  "--depth",
                                  "--depth-colour",
                                  "--overlay",
                                  "--segments",
                                  "--dicom-out",
                                  "--in-place" })
  {
    pageVolume->excludes(app.get_option(name));
  }
  add("Page",
      "--page-volume-size",
      options.pageVolumeSize,
      "N",
      "Most voxels along an axis of the page's volume; of larger ones, blocks become their maximum, or minimum or mean "
      "as --mode says. Or full, for all voxels; default: 256")
    ->check(VoxelCount())
    ->needs(pageVolume);
  add("Page, outputs",
      "--title",
      options.title,
      "TEXT",
      "Title of a page; default: the mode, such as Maximum intensity projection. The name of INPUT is in no page");

  add("Program, outputs, volumes", "--threads", options.threads, "N", "Threads to use; default: all processors")
    ->check(count);
  addFlag("Program, usual, outputs, volumes",
          "-v,--verbose",
          options.verbose,
          "Prints what the program does and how long it takes");

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
                         ->group("Program, usual");
  add(
    "Program", "--phantom-size", options.phantomSize, "X Y Z", "Size of the angiogram in voxels; default: 256 256 128")
    ->check(Count(4096))
    ->needs(phantom)
    ->delimiter(',')
    ->expected(3);
  const auto volumeOut = app
                           .add_option_function<std::string>(
                             "--write-volume",
                             [&options, output](const std::string & path) {
                               options.volumeOut = path;
                               output->required(false);
                             },
                             "Writes the volume that INPUT holds, as this program understands it, instead of a "
                             "projection: .mha, .nrrd, .nii or .nii.gz, or - for a NRRD as standard output. Points in "
                             "time are the fourth axis. --series, --volume and --suv have their effect")
                           ->type_name("FILE")
                           ->group("Program, usual, volumes");
  addFlag("Program, volumes",
          "--with-attributes",
          options.hasAttributes,
          "Adds to the .nrrd of --write-volume the names of the files that were read, and the DICOM attributes of the "
          "first slice, the patient's name too")
    ->needs(volumeOut);
  add("Program, outputs",
      "--trust",
      options.trusted,
      "FILE",
      "Believes what FILE, which is INPUT or another .nrrd or .mha that is read, says of its source: DICOM attributes, "
      "such as the patient's name, and names of files, which DICOM outputs take theirs from")
    ->expected(1)
    ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.set_version_flag("--version", GetVersionText(), "Prints the version")->group("Program");
  app.set_help_flag("-h,--help", "Prints the usual options")->group("Program, usual");
  app.set_help_all_flag("--help-all", "Prints all options")->group("Program, usual");
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

std::string
FindAgainstNearest(const Options & options)
{
  const std::string reason = ": the picture has only values of voxels";
  return !itk::ShearWarp::HasFeature(modes.at(options.mode), itk::ShearWarp::Feature::Nearest)
           ? "--mode " + options.mode
         : options.isExact           ? "--exact" + reason
         : options.attenuation > 0.0 ? "--attenuation" + reason
         : options.oversampling != 1 ? "--oversampling" + reason
                                     : "";
}

namespace
{
/** Throws std::runtime_error if the mode or the interpolation does not go with another option. */
void
VerifyMode(const Options & options)
{
  using itk::ShearWarp::Feature;
  struct Given
  {
    bool        isGiven;
    Feature     feature;
    std::string name;
  };
  const std::vector<Given> features = { { options.localMaximum.has_value(), Feature::LocalMaximum, "--local-maximum" },
                                        { !options.depth.empty(), Feature::Depth, "--depth" },
                                        { !options.depthColour.empty(), Feature::Depth, "--depth-colour" },
                                        { options.isExact, Feature::Exact, "--exact" } };
  for (const auto & [isGiven, feature, name] : features)
  {
    if (isGiven && !itk::ShearWarp::HasFeature(modes.at(options.mode), feature))
    {
      throw std::runtime_error(name + " is not possible with --mode " + options.mode);
    }
  }
  if (const std::string other = FindAgainstNearest(options); options.interpolation == "nearest" && !other.empty())
  {
    throw std::runtime_error("--interpolation nearest is not possible with " + other);
  }
}

/** Throws if the page cannot hold the volume. */
void
VerifyPageOfVolume(const Options & options)
{
  if (FindFormat(options.output) != FileFormat::Page)
  {
    throw std::runtime_error("--page-volume requires a page: .html");
  }
  // as in page/volume.js
  const std::set<std::string> modesOfPages{ "maximum", "minimum", "mean" };
  const std::string           other = modesOfPages.count(options.mode) == 0 ? "--mode " + options.mode
                                      : options.interpolation == "nearest"  ? "--interpolation nearest"
                                                                            : "";
  if (!other.empty())
  {
    throw std::runtime_error("--page-volume is not possible with " + other);
  }
  if (options.outputSpacing.size() == 2 && options.outputSpacing[0] != options.outputSpacing[1])
  {
    throw std::runtime_error("--page-volume is not possible with two different values of --output-spacing: the page's "
                             "pixels are square");
  }
}
} // namespace

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
  if (options.outputSpacing.size() > 2)
  {
    throw std::runtime_error("--output-spacing: one or two values are needed");
  }
  if (!IsAxis(options.rotationAxis))
  {
    throw std::runtime_error("--rotation-axis: it must be left, posterior, superior, i, j, k or a direction X,Y,Z");
  }
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (options.slab.size() == 2 &&
      (options.slab[0] > options.slab[1] || options.slab[0] == infinity || options.slab[1] == -infinity))
  {
    throw std::runtime_error("--slab: NEAR must not be greater than FAR; NEAR cannot be inf, and FAR cannot be -inf");
  }
  VerifyMode(options);
  if (options.pageBits && FindFormat(options.output) != FileFormat::Page)
  {
    throw std::runtime_error("--page-bits requires a page: .html");
  }
  if (options.isPageOfVolume)
  {
    VerifyPageOfVolume(options);
  }
  if (options.isMultiFrame && options.dicomOut.empty())
  {
    throw std::runtime_error("--multi-frame requires --dicom-out, or a folder as OUTPUT");
  }
  for (std::size_t n = 0; n < options.crop.size(); n += 2)
  {
    if (options.crop[n] > options.crop[n + 1] || options.crop[n] == infinity || options.crop[n + 1] == -infinity)
    {
      throw std::runtime_error("--crop: X0, Y0 and Z0 must not be greater than X1, Y1 and Z1; X0, Y0 and Z0 cannot be "
                               "inf, and X1, Y1 and Z1 cannot be -inf");
    }
  }
}

std::vector<std::string>
FindGivenWithout(const CLI::App & app, const std::string & trait)
{
  std::vector<std::string> given;
  for (const CLI::Option * const option : app.get_options())
  {
    if (option->count() > 0 && !HasTrait(*option, trait))
    {
      given.push_back(option->get_name() == "--output" ? "OUTPUT" : option->get_name());
    }
  }
  return given;
}

std::vector<std::string>
CollectArguments(CLI::App & app, int argc, const char * const * argv)
{
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
    const bool isOther = areShort || FindFormat(argument) != FileFormat::None;
    return isWord && !isNumber(argument) && (isLong || !isOther) ? '-' + argument : argument;
  };
  std::vector<std::string> arguments;
  int                      n = 1;
  for (; n < argc && argv[n] != std::string("--"); ++n)
  {
    const std::string argument = complete(argv[n]);
    const std::size_t equals = argument.find('=');
    const std::string name = argument.substr(0, equals);
    const std::string value = equals != std::string::npos ? argument.substr(equals + 1)
                              : n + 1 < argc              ? argv[n + 1]
                                                          : "";
    if (name.compare(0, 2, "--") == 0 && equals != std::string::npos && value.empty())
    {
      // the parser would take the next argument
      throw std::runtime_error(name + ": a value is needed");
    }
    const auto option = name[0] == '-' ? app.get_option_no_throw(name) : nullptr;
    const bool hasNumbers = option && option->get_delimiter() == ',';
    if (option && !hasNumbers && option->get_items_expected_min() > 0 && argument == name && n + 1 < argc &&
        value != "--")
    {
      // the value stays as it is: of -o -m.png, -m.png
      arguments.insert(arguments.end(), { argument, value });
      ++n;
    }
    else if (hasNumbers && equals != std::string::npos)
    {
      const auto numbers = split(value);
      arguments.push_back(numbers.empty() ? argument : name + '=' + CLI::detail::join(numbers, ","));
    }
    else if (hasNumbers)
    {
      const auto               most = static_cast<std::size_t>(option->get_expected_max());
      std::vector<std::string> numbers;
      for (; numbers.size() < most && n + 1 < argc; ++n)
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
  // a list is one argument now; what follows is INPUT or OUTPUT
  for (CLI::Option * const option : app.get_options([](const CLI::Option *) { return true; }))
  {
    if (option->get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll)
    {
      option->expected(1);
    }
  }
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
    auto extra = app.remaining();
    extra.erase(std::remove(extra.begin(), extra.end(), "--"), extra.end());
    const std::string           first = extra.front().substr(0, extra.front().find('='));
    const std::string           hint = first[0] == '-' ? Suggest(first, names) : ExplainComma(first);
    const std::filesystem::path input = app.get_option("INPUT")->as<std::string>();
    const std::string           output = app.get_option("OUTPUT")->as<std::string>();
    std::error_code             ignored;
    if (first[0] != '-' && FindFormat(output) == FileFormat::None && std::filesystem::is_regular_file(output, ignored))
    {
      const auto folder = input.has_parent_path() ? input.parent_path() : std::filesystem::path(".");
      return "several files are given, but INPUT is one file or a folder: for a DICOM series give its folder, '" +
             folder.string() + '\'';
    }
    constexpr std::size_t most = 5;
    if (extra.size() > most)
    {
      extra[most] = "and " + std::to_string(extra.size() - most) + " more";
      extra.resize(most + 1);
    }
    return CLI::detail::join(extra, " ") + " is not expected" + (hint.empty() ? "; see --help" : hint);
  }
  std::string text = std::string(error.what()).substr(0, MostCharacters);
  text = std::regex_replace(
    text, std::regex("At [Ll]east (\\d+) required but received (\\d+)"), "$1 values are needed, not $2");
  text = std::regex_replace(
    text, std::regex("At [Mm]ost (\\d+) required but received (\\d+)"), "at most $1 can be given, not $2");
  text = std::regex_replace(text, std::regex("1 required (.*) missing"), "a value is needed, $1");
  text = std::regex_replace(text, std::regex(", \\w+:(\\{.*\\})"), ", one of $1");
  text = std::regex_replace(text, std::regex("(, \\w+):\\w+ in \\[.*"), "$1");
  text = std::regex_replace(text, std::regex("^--output(?!-)"), "OUTPUT");
  text = std::regex_replace(text, std::regex("a value is needed, TEXT"), "a value is needed");
  if (!dynamic_cast<const CLI::RequiredError *>(&error))
  {
    return text;
  }
  for (const std::string & extra : app.remaining())
  {
    if (extra[0] == '-' && FindFormat(extra) != FileFormat::None)
    {
      text += ", or ./" + extra + " if '" + extra + "' is a file";
    }
  }
  return text + "; see --help";
}
