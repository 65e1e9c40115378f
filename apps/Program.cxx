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

#include "DicomInput.h"
#include "EngineOfPage.h"
#include "FileGeometry.h"
#include "Frames.h"
#include "Input.h"
#include "InputFiles.h"
#include "Labels.h"
#include "Messages.h"
#include "Options.h"
#include "Output.h"
#include "Overlay.h"
#include "Phantom.h"
#include "Picture.h"
#include "Product.h"
#include "Segments.h"
#include "Stack.h"
#include "Suv.h"
#include "Text.h"
#include "TransformFile.h"

#include "itkMetaDataObject.h"
#include "itkMultiThreaderBase.h"
#include "itkShearWarpMIPView.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <iomanip>
#include <iterator>
#include <limits>
#include <map>

namespace
{
using TransformPointer = itk::Transform<double, 3, 3>::Pointer;

// a new format is a line here and one for its extensions in FileFormat.cxx
const std::map<FileFormat, WriteFunction *> writers = { { FileFormat::Values, WriteValues },
                                                        { FileFormat::Picture, WritePictures },
                                                        { FileFormat::Animation, WritePictures },
                                                        { FileFormat::Page, WritePage } };

void
WritePhantom(const Options & options)
{
  OutputFiles files;
  files.Reserve(options.phantom, { FileFormat::Values }, "--write-phantom");
  const auto & size = options.phantomSize;
  const auto   head = Phantom::Make({ { size[0], size[1], size[2] } });
  files.Write(
    options.phantom, MakeAnyImage<unsigned short>(head, 1, head->GetPixelContainer()), OutputFiles::Layout::Volume);
  files.Commit();
}

/** What files say beside voxels and geometry, as entries of the dictionary of \a volume: see GetEntry(). With
 * attributes, SourceFiles has the names of all files that were read, and Spacing and Direction, row by row, have all
 * digits. */
void
AddEntries(Volume & volume, const Options & options)
{
  itk::MetaDataDictionary & entries = volume.times.front().image->GetMetaDataDictionary();
  const auto                add = [&entries](const std::string & key, const std::string & value) {
    itk::EncapsulateMetaData<std::string>(entries, key, value);
  };
  if (options.hasAttributes)
  {
    auto names = volume.dicomFiles.empty() ? std::vector<std::filesystem::path>{ options.input } : volume.dicomFiles;
    for (auto & name : names)
    {
      name = std::filesystem::absolute(name);
    }
    if (!volume.dicomFiles.empty())
    {
      entries = ReadAttributes(volume.dicomFiles.front());
    }
    add("SourceFiles", JoinPaths(names));
    // NRRD has their product, rounded
    std::ostringstream spacing;
    std::ostringstream direction;
    const auto &       grid = *volume.times.front().image;
    for (unsigned int row = 0; row < 3; ++row)
    {
      spacing << std::setprecision(17) << grid.GetSpacing()[row] << ' ';
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        direction << std::setprecision(17) << grid.GetDirection()(row, axis) << ' ';
      }
    }
    add("Spacing", spacing.str());
    add("Direction", direction.str());
  }
  if (!volume.hasOrientation)
  {
    add("HasOrientation", "0");
  }
  if (volume.isInverted)
  {
    add("IsInverted", "1");
  }
  if (volume.isSuv)
  {
    add("IsSuv", "1");
  }
}

/** Whether \a one and \a other are names of one file. */
bool
IsSameFile(const std::string & one, const std::string & other)
{
  std::error_code ignored;
  return one == other || std::filesystem::equivalent(one, other, ignored);
}

/** Whether \a path is a file whose words about its source are believed. */
bool
IsTrusted(const Options & options, const std::string & path)
{
  return std::any_of(options.trusted.begin(), options.trusted.end(), [&path](const std::string & trusted) {
    return IsSameFile(trusted, path);
  });
}

/** Throws if --trust names a file that is not read. */
void
VerifyTrusted(const Options & options)
{
  const std::string read[] = { options.input, options.mask, options.overlay, options.segments };
  for (const std::string & trusted : options.trusted)
  {
    if (std::none_of(
          std::begin(read), std::end(read), [&trusted](const std::string & path) { return IsSameFile(trusted, path); }))
    {
      throw std::runtime_error("--trust: '" + trusted +
                               "' is not read: it must be INPUT, or the file of --mask, --overlay or --segments");
    }
  }
}

/** Has the files of the volume of \a path never written, nor those that it was made from, if \a path is trusted. */
void
Protect(OutputFiles & files, Volume & volume, const Options & options, const std::string & path)
{
  if (!IsTrusted(options, path))
  {
    volume.sourceFiles.clear();
  }
  files.Protect(volume.dicomFiles);
  files.Protect(volume.sourceFiles);
}

[[noreturn]] void
RefuseSuv()
{
  throw std::runtime_error("--suv is not possible: INPUT is no DICOM series of PET Image Storage");
}

/** Warns if \a volume has only one slice along an axis; files of DICOM are warned of when they are read. */
void
WarnOfOneSlice(const Volume & volume, const std::string & path, const WarningFunction & warn)
{
  const auto size = volume.times.front().image->GetLargestPossibleRegion().GetSize();
  if (volume.dicomFiles.empty() && *std::min_element(size.begin(), size.end()) == 1)
  {
    warn('\'' + path + "' has only one slice");
  }
}

void
WriteVolume(const Options & options, Messages & messages)
{
  const std::string extension = GetExtension(options.volumeOut);
  if (options.hasAttributes && extension != ".nrrd")
  {
    throw std::runtime_error("--with-attributes is not possible: '" + options.volumeOut + "' is no .nrrd");
  }
  OutputFiles files;
  files.Protect(FindInputFiles(options.input));
  files.Reserve(options.volumeOut, { FileFormat::Values }, "--write-volume");
  messages.StepBegins("reading " + options.input);
  const auto warn = [&](const std::string & text) { messages.Warn(text); };
  Volume     volume = ReadVolume(options.input, options.series, warn, "--series", options.volume);
  Protect(files, volume, options, options.input);
  if (options.isSuv && !ConvertToSuv(volume, warn))
  {
    RefuseSuv();
  }
  messages.StepDone("read " + options.input + ", " + Describe(volume.times.front()));
  WarnOfOneSlice(volume, options.input, warn);
  AddEntries(volume, options);
  const bool isNIfTI = extension != ".nrrd" && extension != ".mha";
  if (isNIfTI && (volume.isInverted || !volume.hasOrientation))
  {
    warn("'" + options.volumeOut + "' cannot say " +
         (volume.isInverted ? "that low values are to be shown white" : "that nobody knows the patient's sides") +
         "; .nrrd and .mha can");
  }
  messages.StepBegins("writing " + options.volumeOut);
  files.WriteVolume(options.volumeOut, volume);
  files.Commit();
  messages.StepDone("wrote " + options.volumeOut);
}

/** Throws if several views are given but something else makes a series, or cannot be one. */
void
VerifyViews(const Options & options, std::size_t views, std::size_t times)
{
  const std::string other = options.frames > 0             ? "--frames"
                            : !options.slidingSlab.empty() ? "--sliding-slab"
                            : options.isInPlace            ? "--in-place"
                            : options.isPageOfVolume       ? "--page-volume"
                            : times > 1                    ? "An image of several points in time"
                                                           : "";
  if (views > 1 && !other.empty())
  {
    throw std::runtime_error(other + " is not possible: '" + options.transform + "' holds " + std::to_string(views) +
                             " transforms");
  }
}

/** Throws if not all of the options go with so many points in time. */
void
VerifyTimes(const Options & options, std::size_t times)
{
  const std::string refused = options.frames > 0             ? "--frames"
                              : options.isInPlace            ? "--in-place"
                              : options.isPageOfVolume       ? "--page-volume"
                              : !options.slidingSlab.empty() ? "--sliding-slab"
                              : !options.dicomOut.empty()    ? "A DICOM series"
                                                             : "";
  if (times > 1 && !refused.empty())
  {
    throw std::runtime_error(refused + " is not possible: '" + options.input + "' has " + std::to_string(times) +
                             " points in time; --volume NUMBER chooses one");
  }
}

/** Throws if not all of the options go with so many components. */
void
VerifyComponents(const Options & options, unsigned int components)
{
  const bool        isShown = !options.output.empty() && FindFormat(options.output) != FileFormat::Values;
  const std::string refused = !options.depth.empty()         ? "--depth"
                              : !options.depthColour.empty() ? "--depth-colour"
                              : !options.dicomOut.empty()    ? "A DICOM series"
                              : options.isPageOfVolume       ? "--page-volume"
                              : options.pageBits == 16u      ? "--page-bits 16"
                              : components != 3 && isShown   ? "A picture of other than 1 or 3 components"
                                                             : "";
  if (components > 1 && !refused.empty())
  {
    throw std::runtime_error(refused + " is not possible: '" + options.input + "' has " + std::to_string(components) +
                             " components");
  }
}

/** Calls \a function with the first and the last pixel of \a image, and with \a background. */
template <typename TFunction>
auto
VisitPixels(const AnyImage & image, double background, const TFunction & function)
{
  return DispatchPixelType(image.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    auto &                  pixels = *CastImage<PixelType>(image).GetPixelContainer();
    const PixelType * const begin = pixels.GetBufferPointer();
    return function(begin, begin + pixels.Size(), static_cast<PixelType>(background));
  });
}

/** Whether all pixels are background or no numbers. */
bool
IsBlank(const AnyImage & image, double background)
{
  return VisitPixels(image, background, [](const auto * begin, const auto * end, auto nothing) {
    return std::all_of(begin, end, [nothing](auto pixel) { return pixel == nothing || pixel != pixel; });
  });
}

/** The only value of a blank image. */
std::string
DescribeBlank(const AnyImage & image, double background)
{
  return VisitPixels(image, background, [](const auto * begin, const auto * end, auto nothing) {
    std::ostringstream text;
    text << +nothing;
    return std::find(begin, end, nothing) == end ? "no numbers" : "only the value " + text.str();
  });
}

/** Warns if the projections of \a volume are blank, and says why; ReadMask() has warned of an empty mask. */
void
WarnOfBlank(const Projections &                  projections,
            const Volume &                       volume,
            const itk::Image<unsigned char, 3> * mask,
            const Options &                      options,
            const WarningFunction &              warn)
{
  const double background = projections.background;
  if (!IsBlank(projections.stack, background))
  {
    return;
  }
  const unsigned char * const voxels = mask ? mask->GetBufferPointer() : nullptr;
  const std::size_t           count = mask ? mask->GetPixelContainer()->Size() : 0;
  if (mask && std::find(voxels, voxels + count, 1) == voxels + count)
  {
    return;
  }
  std::vector<std::string> limits;
  for (const auto & [isGiven, name] : { std::pair(!options.slab.empty(), "--slab"),
                                        std::pair(!options.crop.empty(), "--crop"),
                                        std::pair(!options.mask.empty(), "--mask") })
  {
    if (isGiven)
    {
      limits.emplace_back(name);
    }
  }
  // a page's volume is cropped and masked
  const bool canBlame = limits.empty() || !options.isPageOfVolume;
  const bool isAll = canBlame && std::all_of(volume.times.begin(), volume.times.end(), [&](const AnyImage & image) {
                       return IsBlank(image, background);
                     });
  const std::string reason = isAll ? '\'' + options.input + "' has " + DescribeBlank(volume.times[0], background)
                             : !limits.empty() ? "is the image within " + CLI::detail::join(limits, " and ") + '?'
                                               : "it has " + DescribeBlank(projections.stack, background);
  const bool        isThin = !isAll && !options.slab.empty();
  warn("there is only background in the picture: " + reason +
       (isThin ? " A slab must be at least as thick as the voxels." : ""));
}

/** Notes which options change nothing of what is written, and what may surprise in pictures. */
void
AddNotes(const Options & options, const Stack & stack, const Messages & messages)
{
  const std::string & output = options.output;
  const FileFormat    format = FindFormat(output);
  const bool          isPage = format == FileFormat::Page;
  const bool isAnimated = format == FileFormat::Animation || FindFormat(options.depthColour) == FileFormat::Animation;
  const std::string name = '\'' + (output.empty() ? options.dicomOut : output) + '\'';
  const bool        isSeen = !output.empty() && format != FileFormat::Values;
  const std::string picture = isSeen ? output : options.depthColour;
  const auto        note = [&](bool isGiven, const std::string & option, const std::string & reason) {
    if (isGiven)
    {
      messages.Note(option + " has no effect: " + reason);
    }
  };
  const std::string keeps = name + " keeps the image's values";
  const bool        isWindowed = !picture.empty() || !options.dicomOut.empty();
  note(!isWindowed && !options.window.empty(), "--window", keeps);
  note(!isWindowed && !options.levelAndWidth.empty(), "--wl", keeps);
  note(picture.empty() && options.isUnlabelled, "--no-labels", name + " has no letters");
  note(picture.empty() && options.isAnnotated, "--annotate", name + " has no annotations");
  note(isPage && options.isAnnotated && options.depthColour.empty(),
       "--annotate",
       name + " has scale bar and angles anyway");
  note(!isPage && options.title.has_value(), "--title", name + " has no title");
  note(!isPage && !isAnimated && !options.isMultiFrame && options.rate.has_value(), "--rate", name + " does not play");
  const auto size = stack.projections.stack.image->GetLargestPossibleRegion().GetSize();
  if (isAnimated && size[2] == 1 && GetAngles(stack).empty())
  {
    messages.Note("one view does not move; see --frames");
  }
  const auto spacing = stack.projections.stack.image->GetSpacing();
  for (const std::string & drawn : { output, options.depthColour })
  {
    const FileFormat formatDrawn = FindFormat(drawn);
    const bool       isDrawn = formatDrawn == FileFormat::Picture || formatDrawn == FileFormat::Animation;
    if (isDrawn && std::abs(spacing[0] - spacing[1]) > 1e-3 * spacing[0])
    {
      std::ostringstream text;
      text << '\'' << drawn << "' looks distorted: its pixels are " << spacing[0] << " x " << spacing[1] << " mm";
      messages.Note(text.str());
    }
  }
  if (picture.empty())
  {
    return;
  }
  const bool        isSmall = !isPage && std::min(size[0], size[1]) < SmallestLabelled;
  const std::string small = '\'' + picture + "' has less than " + std::to_string(SmallestLabelled) + " columns or rows";
  note(isSmall && options.isAnnotated, "--annotate", small);
  if (!options.isUnlabelled && (isSmall || !stack.hasOrientation))
  {
    messages.Note("there are no letters: " +
                  (isSmall ? small : '\'' + options.input + "' does not say how it lies in the patient"));
  }
}

/** Reserves the names of all outputs, none of which may be an input. */
void
ReserveOutputs(const Options & options, OutputFiles & files)
{
  for (const std::string & path :
       { options.input, options.mask, options.transform, options.overlay, options.overlayTransform, options.segments })
  {
    files.Protect(FindInputFiles(path));
  }
  const std::set<FileFormat> drawn{ FileFormat::Picture, FileFormat::Animation };
  const std::set<FileFormat> values{ FileFormat::Values };
  const std::set<FileFormat> any{ FileFormat::Values, FileFormat::Picture, FileFormat::Animation, FileFormat::Page };
  const auto reserve = [&files](const std::string & path, const auto & formats, const std::string & option) {
    if (!path.empty())
    {
      files.Reserve(path, formats, option);
    }
  };
  reserve(options.output, options.isInPlace ? values : any, options.isInPlace ? "--in-place" : "OUTPUT");
  reserve(options.depth, values, "--depth");
  reserve(options.depthColour, drawn, "--depth-colour");
  if (!options.dicomOut.empty())
  {
    files.ReserveFolder(options.dicomOut);
    for (const std::string & path : { options.input, options.overlay })
    {
      RequireOutside(options.dicomOut, path);
    }
  }
}

/** Everything but the volume, its frames and its mask. */
ProjectionOptions
MakeProjectionOptions(const Options & options)
{
  ProjectionOptions projection;
  projection.isInPlace = options.isInPlace;
  if (!options.outputSpacing.empty())
  {
    const double spacing[] = { options.outputSpacing.front(), options.outputSpacing.back() };
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
  projection.interpolation = interpolations.at(options.interpolation);
  projection.localMaximum = options.localMaximum;
  for (std::size_t axis = 0; axis < 3 && !options.crop.empty(); ++axis)
  {
    projection.cropLower[axis] = options.crop[2 * axis];
    projection.cropUpper[axis] = options.crop[2 * axis + 1];
  }
  projection.attenuation = options.attenuation;
  projection.computeDepth = !options.depth.empty() || !options.depthColour.empty();
  return projection;
}

/** What is known of the projections of \a volume. */
Stack
MakeStack(const Options & options, const Volume & volume, const std::vector<Frame> & frames)
{
  Stack stack{ {} };
  stack.frames = frames;
  stack.mode = modes.at(options.mode);
  stack.center = itk::ShearWarpMIPView::GetCenter(volume.times.front().image);
  if (options.frames > 0)
  {
    stack.loop = options.isRocking ? "swing" : std::abs(options.angularRange) == 360.0 ? "turn" : "none";
  }
  stack.elevations = options.elevations;
  stack.isSeries = options.frames > 0 || !options.slidingSlab.empty() || frames.size() > 1;
  stack.hasOrientation = volume.hasOrientation;
  stack.dicomFiles = volume.dicomFiles;
  stack.sourceFiles = volume.sourceFiles;
  stack.isSuv = volume.isSuv;
  return stack;
}

/** Why pictures of PET are no reprojection by maximum, empty if they may be one. */
std::string
FindNoReprojection(const Options & options)
{
  const bool isSlabOff = !options.slab.empty() && !(options.slab[0] <= 0.0 && options.slab[1] >= 0.0);
  return options.frames == 0         ? "they are no turn, see --frames"
         : options.isRocking         ? "--rocking turns to and fro"
         : options.mode != "maximum" ? "--mode is not maximum"
         : options.localMaximum      ? "--local-maximum shows other values"
         : options.attenuation > 0.0 ? "--attenuation changes values"
         : isSlabOff                 ? "the slab is beside the axis"
                                     : "";
}

/** Throws if \a stack does not go with --rate; otherwise sets rate and window. */
void
SetDisplay(Product & product)
{
  const Options & options = product.options;
  if (options.rate && !product.stack.isSeries)
  {
    throw std::runtime_error("--rate requires a series; see --frames");
  }
  const auto turn = static_cast<double>(CountFramesOfTurn(product.stack));
  product.rate = options.rate.value_or(std::clamp(std::round(turn / 4.0), 5.0, 25.0));
  if (const auto bounds = GetWindow(options))
  {
    product.window = WindowType(bounds->data());
  }
}

/** What is shown over INPUT. */
struct Layers
{
  Volume   overlay{};
  Segments segments{};
};

Layers
ReadLayers(Product & product, OutputFiles & files, Messages & messages)
{
  const Options & options = product.options;
  Layers          layers;
  if (!options.overlay.empty())
  {
    layers.overlay = ReadOverlay(options, product.warn);
    Protect(files, layers.overlay, options, options.overlay);
    const bool isConverted = options.isSuv && ConvertToSuv(layers.overlay, product.warn);
    product.isOverlaySuv = layers.overlay.isSuv;
    if (options.isSuv && !product.stack.isSuv && !isConverted)
    {
      throw std::runtime_error(
        "--suv is not possible: neither INPUT nor the overlay is a DICOM series of PET Image Storage");
    }
    messages.StepDone("read " + options.overlay + ", " + Describe(layers.overlay.times.front()));
  }
  if (!options.segments.empty())
  {
    layers.segments = ReadSegments(options.segments, product.warn);
    Protect(files, layers.segments.labels, options, options.segments);
    messages.StepDone("read " + options.segments + ", " + Describe(layers.segments));
  }
  return layers;
}

/** Shows \a layers over the projections of \a volume. */
void
DrawLayers(Product &                                                                     product,
           const Layers &                                                                layers,
           const Volume &                                                                volume,
           const ProjectionOptions &                                                     projection,
           const std::function<Projections(const Volume &, const ProjectionOptions &)> & project,
           Messages &                                                                    messages)
{
  const Options &     options = product.options;
  const Projections & projections = product.stack.projections;
  const auto          projectLayer = [&](const Volume & layer) {
    return project(layer, MakeLayerOptions(projection, projections.stack.image));
  };
  const auto verifySpace = [&](const Volume & layer, const std::string & path) {
    const bool isRegistered = path == options.overlay && !options.overlayTransform.empty();
    WarnOfOtherSpace(volume, layer, path, projection.frames.front().transform, isRegistered, product.warn);
  };
  product.pictures = MakePictures(projections, product.window);
  if (!options.overlay.empty())
  {
    verifySpace(layers.overlay, options.overlay);
    product.pictures = BlendOverlay(product.pictures, projectLayer(layers.overlay), options, product.warn);
    messages.StepDone("blended " + options.overlay);
  }
  if (!options.segments.empty())
  {
    verifySpace(layers.segments.labels, options.segments);
    product.segments = layers.segments.list;
    product.pictures = DrawSegments(product.pictures, layers.segments, projectLayer);
    messages.StepDone("drew " + options.segments);
  }
}

/** The volume of INPUT, in SUV if that is asked for and possible. */
Volume
ReadInput(Product & product, OutputFiles & files, Messages & messages)
{
  const Options & options = product.options;
  Volume          volume = ReadVolume(options.input, options.series, product.warn, "--series", options.volume);
  Protect(files, volume, options, options.input);
  const bool isConverted = options.isSuv && ConvertToSuv(volume, product.warn);
  if (options.isSuv && !isConverted && options.overlay.empty())
  {
    RefuseSuv();
  }
  if (options.window.size() == 1 && !volume.dicomFiles.empty())
  {
    const std::string & name = options.window.front();
    const bool          isPet = FindName(name, { "pet" }) == "pet";
    const std::string   modality = GetEntry(ReadAttributes(volume.dicomFiles.front()), "0008|0060");
    if (isPet && !volume.isSuv)
    {
      product.warn("--window pet is in SUV, but INPUT's values are not; see --suv");
    }
    if (!isPet && !modality.empty() && modality != "CT")
    {
      product.warn("--window " + name + " is in HU, but INPUT is " + modality + ", not CT");
    }
  }
  const AnyImage &  first = volume.times.front();
  const std::string times = volume.times.size() > 1 ? std::to_string(volume.times.size()) + " x " : "";
  messages.StepDone("read " + options.input + ", " + times + Describe(first));
  VerifyTimes(options, volume.times.size());
  WarnOfOneSlice(volume, options.input, product.warn);
  VerifyComponents(options, first.image->GetNumberOfComponentsPerPixel());
  return volume;
}

/** Throws if a page that holds the volume is asked for, but the program has no engine for it. */
void
VerifyEngineOfPage(const Options & options)
{
  if (options.isPageOfVolume && GetEngineOfPage().empty())
  {
    throw std::runtime_error("--page-volume is not possible: this build has no engine for pages; build it with clang, "
                             "lld, wasi-libc, libc++-dev-wasm32 and libclang-rt-dev-wasm32");
  }
}

/** Makes what a page holds of \a volume, and has that projected instead. */
void
TakeForPage(Product & product, Volume & volume, ProjectionOptions & projection, Messages & messages)
{
  const std::string & size = product.options.pageVolumeSize;
  constexpr auto      all = std::numeric_limits<std::size_t>::max();
  product.volume = Reduce(volume, projection, std::isdigit(size.front()) ? std::stoul(size) : all);
  messages.StepDone("reduced the volume, " + Describe(product.volume->image));
  if (product.volume->notNumbers > 0)
  {
    messages.Note(std::to_string(product.volume->notNumbers) +
                  " voxels are no numbers: they have the least value in the page");
  }
  volume.times.front() = product.volume->image;
  volume.pixels = nullptr;
  projection.mask = nullptr;
  projection.cropLower = ProjectionOptions().cropLower;
  projection.cropUpper = ProjectionOptions().cropUpper;
}

/** The size of a page, in voxels and bytes. */
std::string
DescribePage(const Options & options, const Reduction & volume)
{
  const auto         size = volume.image.image->GetLargestPossibleRegion().GetSize();
  const double       megabytes = static_cast<double>(std::filesystem::file_size(options.output)) / 1e6;
  std::ostringstream text;
  text << '\'' << options.output << "' holds " << size[0] << " x " << size[1] << " x " << size[2] << " voxels of "
       << GetPageBits(options) << " bits, " << std::fixed << std::setprecision(megabytes < 10.0 ? 1 : 0) << megabytes
       << " MB";
  return text.str();
}

/** Projects the volume of INPUT. */
void
Project(Product & product, OutputFiles & files, Messages & messages)
{
  const Options &               options = product.options;
  std::vector<TransformPointer> given;
  if (!options.transform.empty())
  {
    given = ReadLinearTransforms(options.transform);
  }
  messages.StepBegins("reading " + options.input);
  Volume volume = ReadInput(product, files, messages);
  VerifyViews(options, given.size(), volume.times.size());

  ProjectionOptions projection = MakeProjectionOptions(options);
  SetFrames(projection, options, given, volume);
  product.stack = MakeStack(options, volume, projection.frames);
  product.noReprojection =
    volume.sourceFiles.empty() ? FindNoReprojection(options) : "they are of a file that is not DICOM";
  SetDisplay(product);
  if (!options.mask.empty())
  {
    std::vector<std::filesystem::path> sources;
    projection.mask = ReadMask(
      options.mask, options.maskLabel, options.removedLabels, volume.times.front().image, product.warn, sources);
    files.Protect(IsTrusted(options, options.mask) ? sources : std::vector<std::filesystem::path>());
    messages.StepDone("read " + options.mask);
  }
  const auto   mask = projection.mask;
  const Layers layers = ReadLayers(product, files, messages);
  if (options.isPageOfVolume)
  {
    TakeForPage(product, volume, projection, messages);
  }

  const auto project = [&](const Volume & projected, const ProjectionOptions & how) {
    return ProjectFrames(
      projected,
      how,
      [&](const FrameReport & report) { messages.FramesDone(report); },
      [&](std::size_t done, std::size_t all) { messages.Progress(done, all); });
  };
  messages.StepBegins("projecting");
  Projections & projections = product.stack.projections;
  projections = project(volume, projection);
  messages.StepDone("projected, " + Describe(projections.stack));
  WarnOfBlank(projections, volume, mask, options, product.warn);
  const std::size_t count = product.stack.frames.size();
  for (const std::string & drawn : { options.output, options.depthColour })
  {
    if (count > 1 && options.frames == 0 && options.slidingSlab.empty() && FindFormat(drawn) == FileFormat::Picture)
    {
      messages.Note('\'' + drawn + "' becomes " + std::to_string(count) + " numbered files");
    }
  }
  const AnyImage & first = volume.times.front();
  if (!options.isPageOfVolume && options.interpolation != "nearest" && FindAgainstNearest(options).empty() &&
      volume.dicomFiles.empty() && first.image->GetNumberOfComponentsPerPixel() == 1 && LooksLikeLabels(first))
  {
    messages.Note("'" + options.input + "' looks like labels: --interpolation nearest shows only these values");
  }
  if (!(options.overlay.empty() && options.segments.empty()))
  {
    DrawLayers(product, layers, volume, projection, project, messages);
  }
}

/** Takes the frames of INPUT, which is a file of frames. */
void
Take(Product & product, Stack && stack, OutputFiles & files, Messages & messages)
{
  const Options & options = product.options;
  if (!options.ofProjection.empty())
  {
    throw std::runtime_error(options.ofProjection.front() + " is not possible: '" + options.input +
                             "' has frames, which are not projected again");
  }
  product.stack = std::move(stack);
  files.Protect(product.stack.sourceFiles);
  files.Protect(product.stack.maskFiles);
  product.noReprojection = "they are frames of a file; PET images are projected and written at once";
  const AnyImage & frames = product.stack.projections.stack;
  VerifyComponents(options, frames.image->GetNumberOfComponentsPerPixel());
  SetDisplay(product);
  messages.StepDone("read " + options.input + ", " + Describe(frames));
}

void
Write(const Product & product, OutputFiles & files, Messages & messages)
{
  const Options & options = product.options;
  AddNotes(options, product.stack, messages);
  messages.StepBegins("writing " + options.output);
  // before letters are drawn into the pictures
  if (!options.dicomOut.empty())
  {
    WriteDicom(files, options.dicomOut, product);
    messages.StepDone("made the files of " + options.dicomOut);
  }
  if (!options.output.empty())
  {
    writers.at(FindFormat(options.output))(files, options.output, product);
  }
  if (!options.depth.empty())
  {
    Product depths = product;
    depths.stack.projections.stack = product.stack.projections.depths;
    depths.stack.projections.background = std::numeric_limits<double>::quiet_NaN();
    depths.stack.projections.isInverted = false;
    depths.stack.isSuv = false;
    WriteValues(files, options.depth, depths);
  }
  if (!options.depthColour.empty())
  {
    Product depths = product;
    depths.pictures = MakeDepthPictures(product.stack.projections, product.window);
    WritePictures(files, options.depthColour, depths);
  }
}

void
Run(const Options & options, Messages & messages)
{
  Verify(options);
  VerifyTrusted(options);
  VerifyEngineOfPage(options);
  if (options.threads > 0)
  {
    itk::MultiThreaderBase::SetGlobalMaximumNumberOfThreads(options.threads);
    itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(options.threads);
  }
  OutputFiles files;
  ReserveOutputs(options, files);
  Product product{ options, [&messages](const std::string & text) { messages.Warn(text); }, { {} } };
  if (auto stack = ReadStack(options.input, IsTrusted(options, options.input), product.warn))
  {
    Take(product, std::move(*stack), files, messages);
  }
  else
  {
    Project(product, files, messages);
  }
  Write(product, files, messages);
  files.Commit();
  if (product.volume)
  {
    messages.Note(DescribePage(options, *product.volume));
  }
  messages.StepDone("wrote " + (options.output.empty() ? options.dicomOut : options.output));
}

} // namespace

int
RefuseToRun(std::ostream & messages, const std::string & reason)
{
  messages << "shear-warp-mip: " << MakeOneLine(reason) << std::endl;
  return EXIT_FAILURE;
}

int
RunProgram(int argc, const char * const * argv, std::ostream & output, std::ostream & messages)
{
  Options  options;
  CLI::App app("", "shear-warp-mip");
  DefineOptions(app, options);

  const auto fail = [&messages](const std::string & text) { return RefuseToRun(messages, text); };
  try
  {
    app.parse(CollectArguments(app, argc, argv));
    options.ofProjection = FindGivenWithout(app, "outputs");
    Messages steps(messages, options.verbose);
    if (app.count("--write-phantom") > 0 && app.count("--write-volume") == 0)
    {
      WritePhantom(options);
    }
    else if (app.count("--write-volume") > 0)
    {
      if (const auto others = FindGivenWithout(app, "volumes"); !others.empty())
      {
        throw std::runtime_error(others.front() + " is not possible with --write-volume: nothing is projected");
      }
      WriteVolume(options, steps);
    }
    else
    {
      UseOutputFolder(options);
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
