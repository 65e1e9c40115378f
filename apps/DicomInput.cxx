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
#include "DicomInput.h"
#include "DicomAttribute.h"
#include "DicomFolder.h"

#include "itkGDCMImageIO.h"

#include <gdcmAttribute.h>
#include <gdcmImageHelper.h>
#include <gdcmImageReader.h>
#include <gdcmRescaler.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmTrace.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>

namespace
{
namespace fs = std::filesystem;
using gdcm::DataSet;
using gdcm::Tag;
using VectorType = itk::Vector<double, 3>;
using Component = itk::IOComponentEnum;

/** A file with an image. */
struct Source
{
  std::string                 path;
  DataSet                     header;
  std::array<unsigned int, 3> size{};
  unsigned int                components{ 1 };
  Component                   storedType{ Component::UNKNOWNCOMPONENTTYPE };
  gdcm::PixelFormat           format;
  /** Of all frames, or the first. */
  double slope{ 1.0 };
  double intercept{ 0.0 };
  /** Whether ITK makes the pixels: colours and bits. */
  bool isConverted{ false };
};

struct Slice
{
  const Source * source;
  std::size_t    frame;
  double         slope;
  double         intercept;
  Component      type;
  bool           isRescaled{ false };
  /** Of rows, of columns, and the normal. */
  std::array<VectorType, 3> directions{};
  VectorType                origin{};
  /** Of columns and rows. */
  std::array<double, 2> spacing{};
  /** 0 if it is not known. */
  double thickness{ 0.0 };
  /** Along the normal of the first. */
  double position{ 0.0 };
};

Component
GetComponentType(gdcm::PixelFormat::ScalarType type)
{
  switch (type)
  {
    case gdcm::PixelFormat::UINT8:
      return Component::UCHAR;
    case gdcm::PixelFormat::INT8:
      return Component::CHAR;
    case gdcm::PixelFormat::UINT12:
    case gdcm::PixelFormat::UINT16:
      return Component::USHORT;
    case gdcm::PixelFormat::INT12:
    case gdcm::PixelFormat::INT16:
      return Component::SHORT;
    case gdcm::PixelFormat::UINT32:
      return Component::UINT;
    case gdcm::PixelFormat::INT32:
      return Component::INT;
    case gdcm::PixelFormat::FLOAT32:
      return Component::FLOAT;
    case gdcm::PixelFormat::FLOAT64:
      return Component::DOUBLE;
    default:
      return Component::UNKNOWNCOMPONENTTYPE;
  }
}

std::optional<Source>
ReadSource(const std::string & path)
{
  // as ITK has it
  gdcm::ImageHelper::SetForceRescaleInterceptSlope(true);
  gdcm::ImageReader reader;
  reader.SetFileName(path.c_str());
  if (!reader.Read())
  {
    return {};
  }
  const gdcm::Image &        image = reader.GetImage();
  const unsigned int * const dimensions = image.GetDimensions();
  Source                     source;
  source.path = path;
  source.header = reader.GetFile().GetDataSet();
  source.header.Remove(Tag(0x7fe0, 0x0010));
  source.size = { dimensions[0], dimensions[1], image.GetNumberOfDimensions() == 3 ? dimensions[2] : 1 };
  source.format = image.GetPixelFormat();
  const auto colours = image.GetPhotometricInterpretation();
  source.isConverted = (colours != gdcm::PhotometricInterpretation::MONOCHROME1 &&
                        colours != gdcm::PhotometricInterpretation::MONOCHROME2) ||
                       source.format == gdcm::PixelFormat::SINGLEBIT;
  if (source.isConverted)
  {
    const auto io = itk::GDCMImageIO::New();
    io->SetFileName(path);
    io->ReadImageInformation();
    source.components = io->GetNumberOfComponents();
    source.storedType = io->GetComponentType();
  }
  else
  {
    source.storedType = GetComponentType(source.format.GetScalarType());
    source.slope = image.GetSlope();
    source.intercept = image.GetIntercept();
  }
  return source;
}

std::string
GetName(const Slice & slice)
{
  return (slice.source->size[2] > 1 ? "frame " + std::to_string(slice.frame + 1) + " of '" : "'") + slice.source->path +
         "'";
}

/** The data set in the first item of a sequence, empty if there is none. */
DataSet
GetItem(const DataSet & dataSet, const Tag & tag)
{
  const auto sequence = dataSet.GetDataElement(tag).GetValueAsSQ();
  return sequence && sequence->GetNumberOfItems() > 0 ? sequence->GetItem(1).GetNestedDataSet() : DataSet();
}

/** As many finite numbers as \a text has, or none. */
std::vector<double>
ParseNumbers(const std::string & text)
{
  std::vector<double> numbers;
  std::istringstream  stream(text);
  for (std::string part; std::getline(stream, part, '\\');)
  {
    part = Trim(part);
    char *       end = nullptr;
    const double number = std::strtod(part.c_str(), &end);
    if (part.empty() || *end != '\0' || !std::isfinite(number))
    {
      return {};
    }
    numbers.push_back(number);
  }
  return numbers;
}

/** What a frame is away from the position that all of a file have, in dose and nuclear medicine (PS3.3 C.8.8.3.2 and
 * C.8.4.15). */
VectorType
GetFrameOffset(const DataSet & header, const Slice & slice, std::size_t frames, const VectorType & normal)
{
  const std::size_t frame = slice.frame;
  const auto        offsets = ParseNumbers(GetText(header, { 0x3004, 0x000c }));
  if (offsets.size() == frames)
  {
    VectorType superior(0.0);
    superior[2] = 1.0;
    return (offsets[frame] - offsets[0]) * (offsets[0] == 0.0 ? normal : superior);
  }
  const auto distance = ParseNumbers(GetText(header, { 0x0018, 0x0088 }));
  const auto increment = header.GetDataElement(Tag(0x0028, 0x0009)).GetByteValue();
  const bool isBySlices =
    increment && std::string(increment->GetPointer(), increment->GetLength()) == std::string("\x54\x00\x80\x00", 4);
  gdcm::Attribute<0x0054, 0x0080> order;
  order.SetFromDataSet(header);
  if (isBySlices && order.GetNumberOfValues() > 0 &&
      (frame >= order.GetNumberOfValues() || order[static_cast<unsigned int>(frame)] != frame + 1))
  {
    throw std::runtime_error(GetName(slice) + " is not in the order of the slices");
  }
  return isBySlices && distance.size() == 1 ? static_cast<double>(frame) * distance[0] * normal : VectorType(0.0);
}

/** Takes out localizers (PS3.3 C.8.2.1.1.1) if there are others. */
void
LeaveOutLocalizers(std::vector<Source> & sources, const WarningFunction & warn)
{
  const auto isLocalizer = [](const Source & source) {
    return GetText(source.header, { 0x0008, 0x0008 }).find("\\LOCALIZER") != std::string::npos;
  };
  const auto first = std::stable_partition(sources.begin(), sources.end(), std::not_fn(isLocalizer));
  if (first != sources.begin() && first != sources.end())
  {
    const auto more = sources.end() - first - 1;
    warn("left out: '" + first->path + "'" + (more > 0 ? " and " + std::to_string(more) + " more" : "") +
         " (localizer)");
    sources.erase(first, sources.end());
  }
}

/** As ITK does. */
Component
ChooseType(const Slice & slice)
{
  if (slice.slope == 1.0 && slice.intercept == 0.0)
  {
    return slice.source->storedType;
  }
  gdcm::Rescaler rescaler;
  rescaler.SetSlope(slice.slope);
  rescaler.SetIntercept(slice.intercept);
  rescaler.SetPixelFormat(slice.source->format);
  // GDCM asserts that it is
  return slice.slope > 0.0 ? GetComponentType(rescaler.ComputeInterceptSlopePixelType()) : Component::DOUBLE;
}

/** The slices of a file. Attributes are in the functional groups of the frame or of all frames (PS3.3 C.7.6.16), or in
 * the file itself, or with the detector. */
std::vector<Slice>
GetSlices(const Source & source)
{
  const DataSet &    header = source.header;
  const DataSet      shared = GetItem(header, { 0x5200, 0x9229 });
  const DataSet      detector = GetItem(header, { 0x0054, 0x0022 });
  const auto         groups = header.GetDataElement(Tag(0x5200, 0x9230)).GetValueAsSQ();
  const std::size_t  frames = source.size[2];
  std::vector<Slice> slices;
  if (groups && groups->GetNumberOfItems() != frames)
  {
    throw std::runtime_error("'" + source.path + "' has " + std::to_string(frames) + " frames, but describes " +
                             std::to_string(groups->GetNumberOfItems()));
  }
  for (std::size_t frame = 0; frame < frames; ++frame)
  {
    Slice         slice{ &source, frame, source.slope, source.intercept, source.storedType };
    const DataSet own = groups ? groups->GetItem(frame + 1).GetNestedDataSet() : DataSet();
    const auto    find = [&](const Tag & group, const Tag & attribute) {
      const DataSet ofFrame = GetItem(own, group);
      const DataSet ofAll = GetItem(shared, group);
      std::string   text;
      for (const DataSet * scope : { &ofFrame, &ofAll, &header, &detector })
      {
        text = text.empty() ? GetText(*scope, attribute) : text;
      }
      return text;
    };
    const auto require = [&](const Tag & group, const Tag & attribute, std::size_t count, const std::string & name) {
      auto numbers = ParseNumbers(find(group, attribute));
      if (numbers.size() != count)
      {
        throw std::runtime_error(GetName(slice) + " has no valid " + name);
      }
      return numbers;
    };

    const auto orientation = require({ 0x0020, 0x9116 }, { 0x0020, 0x0037 }, 6, "orientation");
    const auto position = require({ 0x0020, 0x9113 }, { 0x0020, 0x0032 }, 3, "position");
    const auto spacing = require({ 0x0028, 0x9110 }, { 0x0028, 0x0030 }, 2, "pixel spacing");
    VectorType row(orientation.data());
    VectorType column(orientation.data() + 3);
    // 3 decimals are not exact
    const bool isUnit = std::abs(row.Normalize() - 1.0) < 1e-2 && std::abs(column.Normalize() - 1.0) < 1e-2;
    if (!isUnit || !(std::abs(row * column) < 2e-3))
    {
      throw std::runtime_error(GetName(slice) + " has no valid orientation: its rows and columns are not at right " +
                               "angles, or not of length 1");
    }
    if (!(std::min(spacing[0], spacing[1]) > 0.0))
    {
      throw std::runtime_error(GetName(slice) + " has no valid pixel spacing: it is not positive");
    }
    VectorType normal = itk::CrossProduct(row, column);
    normal.Normalize();
    row = itk::CrossProduct(column, normal);
    row.Normalize();
    slice.directions = { row, itk::CrossProduct(normal, row), normal };
    slice.spacing = { spacing[1], spacing[0] };
    slice.origin = VectorType(position.data()) + GetFrameOffset(header, slice, frames, normal);

    for (const Tag & thickness : { Tag(0x0018, 0x0088), Tag(0x0018, 0x0050) })
    {
      const auto numbers = ParseNumbers(find({ 0x0028, 0x9110 }, thickness));
      slice.thickness = slice.thickness == 0.0 && numbers.size() == 1 ? std::abs(numbers[0]) : slice.thickness;
    }
    if (!source.isConverted)
    {
      const Tag  transformation(0x0028, 0x9145);
      const Tag  slope(0x0028, 0x1053);
      const Tag  doseScaling(0x3004, 0x000e);
      const bool isDose = !GetText(header, doseScaling).empty();
      slice.isRescaled = isDose || !find(transformation, slope).empty();
      if (isDose)
      {
        slice.slope = require(transformation, doseScaling, 1, "dose grid scaling")[0];
      }
      else if (slice.isRescaled && groups)
      {
        slice.slope = require(transformation, slope, 1, "rescale slope")[0];
        if (slice.slope == 0.0)
        {
          throw std::runtime_error(GetName(slice) + " has no valid rescale slope");
        }
        slice.intercept = require(transformation, { 0x0028, 0x1052 }, 1, "rescale intercept")[0];
      }
      slice.type = ChooseType(slice);
    }
    slices.push_back(slice);
  }
  return slices;
}

void
RequireLikeness(const Slice & slice, const Slice & first)
{
  std::string difference;
  const auto  require = [&difference](bool isLike, const std::string & what) {
    difference = difference.empty() && !isLike ? what : difference;
  };
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    require((slice.directions[axis] - first.directions[axis]).GetNorm() < 1e-3, "orientation");
  }
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    require(slice.source->size[axis] == first.source->size[axis], "size");
    require(std::abs(slice.spacing[axis] - first.spacing[axis]) < 1e-3 * first.spacing[axis], "pixel spacing");
  }
  const Tag photometric(0x0028, 0x0004);
  require(GetText(slice.source->header, photometric) == GetText(first.source->header, photometric),
          "photometric interpretation");
  require(slice.source->storedType == first.source->storedType && slice.source->components == first.source->components,
          "pixel type");
  require(slice.isRescaled == first.isRescaled, "rescaling");
  if (!difference.empty())
  {
    throw std::runtime_error(GetName(slice) + " and " + GetName(first) + " are of one series, but differ in " +
                             difference);
  }
}

/** What tells two slices at one position apart, and what to do then. */
std::string
NameDifference(const Slice & one, const Slice & other)
{
  if (one.source == other.source)
  {
    return ". The file has several volumes, such as points in time: one is needed";
  }
  const std::pair<Tag, std::string> attributes[] = { { { 0x0020, 0x0100 }, "Temporal Position Identifier" },
                                                     { { 0x0018, 0x0081 }, "Echo Time" },
                                                     { { 0x0054, 0x1300 }, "Frame Reference Time" },
                                                     { { 0x0018, 0x1060 }, "Trigger Time" },
                                                     { { 0x0020, 0x0012 }, "Acquisition Number" },
                                                     { { 0x0008, 0x0008 }, "Image Type" },
                                                     { { 0x0008, 0x0032 }, "Acquisition Time" } };
  for (const auto & [tag, name] : attributes)
  {
    const std::string first = GetText(one.source->header, tag);
    const std::string second = GetText(other.source->header, tag);
    if (first != second)
    {
      return ". They differ in " + name + ", " + first + " and " + second +
             ": put the images of one volume into a folder of their own";
    }
  }
  return "";
}

/** Throws if one of the slices, which are sorted, is missing or there twice. */
void
RequireEachSlice(const std::vector<Slice> & slices)
{
  std::vector<double> gaps;
  for (std::size_t i = 1; i < slices.size(); ++i)
  {
    gaps.push_back(std::abs(slices[i].position - slices[i - 1].position));
  }
  const auto [closest, farthest] = std::minmax_element(gaps.begin(), gaps.end());
  const bool isTwice = !(*closest > 0.01 * *farthest);
  if (isTwice || *farthest > 1.5 * *closest)
  {
    const auto         after = (isTwice ? closest : farthest) - gaps.begin();
    const Slice &      one = slices[after];
    const Slice &      other = slices[after + 1];
    std::ostringstream message;
    message << (isTwice ? "two slices lie at one position: " : "a slice is missing between ") << GetName(one) << " at "
            << one.position << " mm and " << GetName(other) << " at " << other.position << " mm; others are "
            << (isTwice ? *farthest : *closest) << " mm apart";
    if (isTwice)
    {
      message << NameDifference(one, other);
    }
    throw std::runtime_error(message.str());
  }
}

/** From slice to slice, in mm. */
VectorType
FindStep(const std::vector<Slice> & slices, const WarningFunction & warn)
{
  const VectorType step = (slices.back().origin - slices.front().origin) / static_cast<double>(slices.size() - 1);
  double           deviation = 0.0;
  for (std::size_t i = 0; i < slices.size(); ++i)
  {
    const VectorType expected = slices.front().origin + static_cast<double>(i) * step;
    deviation = std::max(deviation, (slices[i].origin - expected).GetNorm());
  }
  const double       distance = step.GetNorm();
  std::ostringstream message;
  message << "the slices are not evenly spaced: one is " << deviation << " mm away from where it should be";
  if (deviation > 0.5 * distance)
  {
    throw std::runtime_error(message.str() + ", more than half of their distance");
  }
  if (deviation > 1e-3 * distance)
  {
    warn(message.str());
  }
  return step;
}

/** Sorts the slices, and returns the grid that they are. */
itk::ImageBase<3>::Pointer
ArrangeSlices(std::vector<Slice> & slices, const WarningFunction & warn)
{
  const Slice first = slices.front();
  for (Slice & slice : slices)
  {
    RequireLikeness(slice, first);
    slice.position = slice.origin * first.directions[2];
  }
  const bool isBackward = slices.size() == first.source->size[2] && slices.back().position < slices.front().position;
  std::stable_sort(slices.begin(), slices.end(), [isBackward](const Slice & a, const Slice & b) {
    return isBackward ? a.position > b.position : a.position < b.position;
  });

  VectorType step = first.directions[2];
  if (slices.size() > 1)
  {
    RequireEachSlice(slices);
    step = FindStep(slices, warn);
  }
  else
  {
    if (!(first.thickness > 0.0))
    {
      throw std::runtime_error(GetName(first) + " has no valid slice thickness");
    }
    step *= first.thickness;
  }

  const auto                       grid = itk::ImageBase<3>::New();
  itk::ImageBase<3>::PointType     origin;
  itk::ImageBase<3>::SpacingType   spacing;
  itk::ImageBase<3>::DirectionType direction;
  const std::array<VectorType, 3>  axes = { first.directions[0], first.directions[1], step / step.GetNorm() };
  spacing[0] = first.spacing[0];
  spacing[1] = first.spacing[1];
  spacing[2] = step.GetNorm();
  for (unsigned int row = 0; row < 3; ++row)
  {
    origin[row] = slices.front().origin[row];
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      direction(row, axis) = axes[axis][row];
    }
  }
  grid->SetRegions(itk::Size<3>{ { first.source->size[0], first.source->size[1], slices.size() } });
  grid->SetOrigin(origin);
  grid->SetSpacing(spacing);
  grid->SetDirection(direction);
  return grid;
}

/** The pixels of all frames as they are stored. */
std::vector<char>
ReadStored(const Source & source)
{
  std::vector<char> bytes;
  if (source.isConverted)
  {
    const auto io = itk::GDCMImageIO::New();
    io->SetFileName(source.path);
    io->ReadImageInformation();
    bytes.resize(static_cast<std::size_t>(io->GetImageSizeInBytes()));
    io->Read(bytes.data());
    return bytes;
  }
  gdcm::ImageReader reader;
  reader.SetFileName(source.path.c_str());
  const bool          isRead = reader.Read();
  const gdcm::Image & image = reader.GetImage();
  bytes.resize(image.GetBufferLength());
  if (!isRead || !image.GetBuffer(bytes.data()))
  {
    throw std::runtime_error("cannot decode the pixels of '" + source.path + "'; decompress the images first");
  }
  return bytes;
}

/** Makes the values of \a slice from \a stored, its \a count pixels. */
template <typename TPixel>
void
Rescale(const Slice & slice, const char * stored, std::size_t count, TPixel * values)
{
  const bool isRescaled = slice.slope != 1.0 || slice.intercept != 0.0;
  if (!isRescaled && slice.source->storedType == itk::ImageIOBase::MapPixelType<TPixel>::CType)
  {
    std::memcpy(values, stored, count * sizeof(TPixel));
    return;
  }
  std::vector<double> numbers(count);
  DispatchPixelType(slice.source->storedType, [&](auto tag) {
    using StoredType = typename decltype(tag)::Type;
    const auto * const begin = reinterpret_cast<const StoredType *>(stored);
    std::transform(begin, begin + count, numbers.begin(), [&slice](StoredType number) {
      return slice.slope * static_cast<double>(number) + slice.intercept;
    });
  });
  std::transform(numbers.begin(), numbers.end(), values, [&slice](double number) {
    if (std::is_integral_v<TPixel> && (number < static_cast<double>(std::numeric_limits<TPixel>::lowest()) ||
                                       number > static_cast<double>(std::numeric_limits<TPixel>::max())))
    {
      throw std::runtime_error(GetName(slice) + " has values beyond its stored bits");
    }
    return static_cast<TPixel>(number);
  });
}
} // namespace

Volume
ReadDicom(const fs::path & path, const std::string & series, const WarningFunction & warn)
{
  // what matters is said here
  gdcm::Trace::ErrorOff();
  gdcm::Trace::WarningOff();
  std::vector<Source> sources;
  if (fs::is_directory(path))
  {
    for (const std::string & file : FindSeries(path, series, warn))
    {
      if (const auto source = ReadSource(file))
      {
        sources.push_back(*source);
      }
      else
      {
        throw std::runtime_error("cannot decode the image '" + file + "'");
      }
    }
    LeaveOutLocalizers(sources, warn);
  }
  else if (const auto source = ReadSource(path.string()))
  {
    sources = { *source };
  }
  else
  {
    throw std::runtime_error("'" + path.string() + "' is not a DICOM image");
  }

  // Segmentation Storage, PS3.6 table A-1
  if (GetText(sources.front().header, { 0x0008, 0x0016 }) == "1.2.840.10008.5.1.4.1.1.66.4")
  {
    throw std::runtime_error("'" + path.string() +
                             "' is a DICOM segmentation: convert it to an image of labels, .nrrd, by dcmqi's "
                             "segimage2itkimage, highdicom or pydicom-seg");
  }
  std::vector<Slice> slices;
  for (const Source & source : sources)
  {
    if (IsProjection(source.header))
    {
      throw std::runtime_error("'" + source.path +
                               "' is a projection, not a part of a volume; give the series that it was made from");
    }
    const auto ofSource = GetSlices(source);
    slices.insert(slices.end(), ofSource.begin(), ofSource.end());
  }
  const auto grid = ArrangeSlices(slices, warn);
  if (slices.size() == 1)
  {
    warn("'" + path.string() + "' has only one slice" +
         (fs::is_directory(path) ? "" : "; for a whole series give its folder"));
  }
  const Source first = *slices.front().source;
  const bool   isOneType = std::all_of(
    slices.begin(), slices.end(), [&slices](const Slice & slice) { return slice.type == slices.front().type; });

  Volume volume;
  volume.isInverted = GetText(first.header, { 0x0028, 0x0004 }) == "MONOCHROME1";
  DispatchPixelType(isOneType ? slices.front().type : Component::DOUBLE, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    volume.times = { MakeAnyImage<PixelType>(grid, first.components) };
    PixelType * const values = CastImage<PixelType>(volume.times.front()).GetBufferPointer();
    const std::size_t count = std::size_t{ first.size[0] } * first.size[1] * first.components;
    for (const Source & source : sources)
    {
      const auto stored = ReadStored(source);
      const auto bytes = stored.size() / source.size[2];
      for (std::size_t n = 0; n < slices.size(); ++n)
      {
        if (slices[n].source == &source)
        {
          Rescale(slices[n], stored.data() + slices[n].frame * bytes, count, values + n * count);
        }
      }
    }
  });
  std::set<const Source *> listed;
  for (const Slice & slice : slices)
  {
    if (listed.insert(slice.source).second)
    {
      volume.dicomFiles.emplace_back(slice.source->path);
    }
  }
  return volume;
}
