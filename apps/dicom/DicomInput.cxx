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
#include "CharacterSet.h"
#include "DicomAttribute.h"
#include "DicomFolder.h"
#include "DicomKind.h"
#include "DicomSlices.h"
#include "DicomVolumes.h"
#include "FileGeometry.h"

#include "itkGDCMImageIO.h"
#include "itkMetaDataObject.h"

#include <gdcmTrace.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <stdexcept>

namespace
{
namespace fs = std::filesystem;
using VectorType = itk::Vector<double, 3>;
using Component = itk::IOComponentEnum;

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

/** The slices in a row that are as far apart as the first two. */
struct Run
{
  std::size_t begin;
  std::size_t count;
  double      distance;
};

std::vector<Run>
FindRuns(const std::vector<Slice> & slices)
{
  std::vector<Run> runs;
  for (std::size_t n = 1; n < slices.size(); ++n)
  {
    const double distance = std::abs(slices[n].position - slices[n - 1].position);
    if (!runs.empty() && std::abs(distance - runs.back().distance) <= 0.1 * runs.back().distance)
    {
      ++runs.back().count;
    }
    else
    {
      runs.push_back({ n - 1, 1, distance });
    }
  }
  return runs;
}

/** As "4 mm from 0 to 52 mm". */
std::string
Describe(const Run & run, const std::vector<Slice> & slices)
{
  std::ostringstream text;
  text << run.distance << " mm from " << slices[run.begin].position << " to " << slices[run.begin + run.count].position
       << " mm";
  return text.str();
}

/** Whether a run may be in a series with several distances, and no slice is missing there: it has four slices at least,
 * is not longer than one before it and one behind it, and not more than three times as long as any; or it is a single
 * distance between two such runs, and not longer than both. */
bool
IsPlausible(const std::vector<Run> & runs, std::size_t n)
{
  constexpr std::size_t fewest = 3;
  const Run &           run = runs[n];
  if (run.count < fewest)
  {
    return run.count == 1 && n > 0 && n + 1 < runs.size() && runs[n - 1].count >= fewest &&
           runs[n + 1].count >= fewest && run.distance <= std::max(runs[n - 1].distance, runs[n + 1].distance);
  }
  double before = std::numeric_limits<double>::infinity();
  double behind = before;
  for (std::size_t other = 0; other < runs.size(); ++other)
  {
    double & smallest = other < n ? before : behind;
    smallest = runs[other].count >= fewest && other != n ? std::min(smallest, runs[other].distance) : smallest;
  }
  return run.distance <= std::max(before, behind) && run.distance <= 3.0 * std::min(before, behind);
}

/** Throws, naming the longest run that is not plausible, if there is any. */
void
RequirePlausible(const std::vector<Run> & runs, const std::vector<Slice> & slices)
{
  const Run * stray = nullptr;
  for (std::size_t n = 0; n < runs.size(); ++n)
  {
    if (!IsPlausible(runs, n) && (!stray || runs[n].distance > stray->distance))
    {
      stray = &runs[n];
    }
  }
  if (!stray)
  {
    return;
  }
  std::vector<double> others;
  for (const Run & run : runs)
  {
    others.insert(others.end(), &run == stray ? run.count - 1 : run.count, run.distance);
  }
  std::sort(others.begin(), others.end());
  const double  times = stray->distance / others[(others.size() - 1) / 2];
  const bool    isMissing = stray->count < 4 && times > 1.5 && times < 5.5 && std::abs(times - std::round(times)) < 0.2;
  const Slice & one = slices[stray->begin];
  const Slice & other = slices[stray->begin + 1];
  std::ostringstream message;
  message << (isMissing ? "a slice is missing between " : "the slices are not evenly spaced: ") << GetName(one)
          << " at " << one.position << " mm and " << GetName(other) << " at " << other.position << " mm";
  if (!isMissing)
  {
    message << " are " << stray->distance << " mm apart";
  }
  message << "; others are " << others.front();
  if (others.back() > 1.1 * others.front())
  {
    message << " to " << others.back();
  }
  message << " mm apart";
  if (one.source != other.source)
  {
    message << "; a part of the series can be read from a folder of its own";
  }
  throw std::runtime_error(message.str());
}

/** Throws if a slice lies beside the line from the first to the last one. */
void
RequireLine(const std::vector<Slice> & slices, double allowed)
{
  const VectorType whole = slices.back().origin - slices.front().origin;
  const double     extent = slices.back().position - slices.front().position;
  for (const Slice & slice : slices)
  {
    const VectorType place = slices.front().origin + whole * ((slice.position - slices.front().position) / extent);
    const double     beside = (slice.origin - place).GetNorm();
    if (beside > allowed)
    {
      std::ostringstream message;
      message << "the slices are not in line: " << GetName(slice) << " is " << beside
              << " mm beside the line from the first to the last, more than a fifth of the distance of slices";
      throw std::runtime_error(message.str());
    }
  }
}

struct Steps
{
  std::size_t count;
  VectorType  step;
  bool        areInterpolated{ false };
};

/** From slice to slice, in mm. If there are several distances, from plane to plane at nearly the smallest, but not for
 * labels. */
Steps
FindSteps(const std::vector<Slice> & slices, bool areLabels, const WarningFunction & warn)
{
  const VectorType whole = slices.back().origin - slices.front().origin;
  const VectorType step = whole / static_cast<double>(slices.size() - 1);
  const double     distance = step.GetNorm();
  double           deviation = 0.0;
  for (std::size_t i = 0; i < slices.size(); ++i)
  {
    const VectorType expected = slices.front().origin + static_cast<double>(i) * step;
    deviation = std::max(deviation, (slices[i].origin - expected).GetNorm());
  }
  constexpr double tolerance = 0.2;
  if (deviation <= tolerance * distance)
  {
    if (deviation > 1e-3 * distance)
    {
      std::ostringstream message;
      message << "the slices are not evenly spaced: one is " << deviation << " mm away from where it should be";
      warn(message.str());
    }
    return { slices.size(), step };
  }

  RequireLine(slices, tolerance * distance);
  const auto runs = FindRuns(slices);
  RequirePlausible(runs, slices);
  double      smallest = distance;
  std::string list;
  for (const Run & run : runs)
  {
    if (run.count > 1)
    {
      smallest = std::min(smallest, run.distance);
      list += (list.empty() ? "" : ", ") + Describe(run, slices);
    }
  }
  const double       extent = std::abs(slices.back().position - slices.front().position);
  const double       count = std::ceil(extent / smallest - 0.01);
  const std::string  uneven = "the slices are not evenly spaced (" + list + "): ";
  std::ostringstream message;
  message << uneven << count + 1.0 << " planes, " << extent / count << " mm apart, are interpolated between them";
  if (areLabels)
  {
    throw std::runtime_error(uneven + "labels cannot be interpolated");
  }
  warn(message.str());
  return { static_cast<std::size_t>(count) + 1, whole / count, true };
}

struct Arrangement
{
  itk::ImageBase<3>::Pointer grid;
  bool                       isInterpolated;
};

/** Sorts the slices, and returns the grid that they are or are to be interpolated on. */
Arrangement
ArrangeSlices(std::vector<Slice> & slices, bool areLabels, const WarningFunction & warn)
{
  const Slice first = slices.front();
  bool        areOfOneFile = true;
  for (const Slice & slice : slices)
  {
    RequireLikeness(slice, first);
    areOfOneFile = areOfOneFile && slice.source == first.source;
  }
  const bool isBackward = areOfOneFile && slices.back().position < first.position;
  std::stable_sort(slices.begin(), slices.end(), [isBackward](const Slice & a, const Slice & b) {
    return isBackward ? a.position > b.position : a.position < b.position;
  });

  Steps steps{ 1, first.directions[2] };
  if (slices.size() > 1)
  {
    steps = FindSteps(slices, areLabels, warn);
  }
  else
  {
    if (!(first.thickness > 0.0))
    {
      throw std::runtime_error(GetName(first) + " has no valid slice thickness");
    }
    steps.step *= first.thickness;
  }

  const VectorType &               step = steps.step;
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
  grid->SetRegions(itk::Size<3>{ { first.source->size[0], first.source->size[1], steps.count } });
  grid->SetOrigin(origin);
  grid->SetSpacing(spacing);
  grid->SetDirection(direction);
  return { grid, steps.areInterpolated };
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
/** Interpolates planes, which are evenly spaced, linearly between \a slices of so many values. */
template <typename TPixel>
void
Interpolate(const std::vector<Slice> & slices,
            const TPixel *             values,
            std::size_t                count,
            std::size_t                planes,
            TPixel *                   to)
{
  const double extent = std::abs(slices.back().position - slices.front().position);
  std::size_t  next = 1;
  for (std::size_t plane = 0; plane < planes; ++plane)
  {
    const double position = extent * static_cast<double>(plane) / static_cast<double>(planes - 1);
    const auto   getPosition = [&](std::size_t n) { return std::abs(slices[n].position - slices.front().position); };
    while (next + 1 < slices.size() && getPosition(next) < position)
    {
      ++next;
    }
    const double         begin = getPosition(next - 1);
    const double         weight = std::min((position - begin) / (getPosition(next) - begin), 1.0);
    const TPixel * const one = values + (next - 1) * count;
    const TPixel * const other = one + count;
    for (std::size_t n = 0; n < count; ++n)
    {
      const double value = (1.0 - weight) * static_cast<double>(one[n]) + weight * static_cast<double>(other[n]);
      *to++ = static_cast<TPixel>(std::is_integral_v<TPixel> ? std::round(value) : value);
    }
  }
}
} // namespace

std::string
GetVolumeOption(const std::string & seriesOption)
{
  return seriesOption.empty() ? "" : seriesOption.substr(0, seriesOption.rfind("series")) + "volume";
}

Volume
ReadDicom(const fs::path &        path,
          const std::string &     series,
          const WarningFunction & warn,
          const std::string &     option,
          const std::string &     volumeNumber)
{
  // what matters is said here
  gdcm::Trace::ErrorOff();
  gdcm::Trace::WarningOff();
  std::vector<Source> sources;
  if (fs::is_directory(path))
  {
    for (const std::string & file : FindSeries(path, series, warn, option))
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

  if (IsSegmentation(sources.front().header))
  {
    throw std::runtime_error("'" + path.string() + "' is a DICOM segmentation: --segments takes one");
  }
  std::vector<Slice> slices;
  for (const Source & source : sources)
  {
    if (IsProjection(source.header))
    {
      throw std::runtime_error("'" + source.path +
                               "' is a projection, not a part of a volume; give the series that it was made from");
    }
    if (IsMosaic(source.header))
    {
      throw std::runtime_error("'" + source.path + "' is a mosaic: the slices of a volume are tiles of one picture; " +
                               "convert it by dcm2niix, and give the file that this program writes");
    }
    const auto ofSource = GetSlices(source);
    slices.insert(slices.end(), ofSource.begin(), ofSource.end());
  }
  ChooseVolume(slices, volumeNumber, GetVolumeOption(option), "'" + path.string() + "'");
  // masks and segments have no option for a series
  const auto arranged = ArrangeSlices(slices, option.empty(), warn);
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
    volume.times = { MakeAnyImage<PixelType>(arranged.grid, first.components) };
    PixelType * const        pixels = CastImage<PixelType>(volume.times.front()).GetBufferPointer();
    const std::size_t        count = std::size_t{ first.size[0] } * first.size[1] * first.components;
    const std::size_t        planes = arranged.grid->GetLargestPossibleRegion().GetSize(2);
    std::vector<PixelType>   ofSlices(arranged.isInterpolated ? slices.size() * count : 0);
    PixelType * const        values = arranged.isInterpolated ? ofSlices.data() : pixels;
    std::set<const Source *> known;
    for (const Slice & slice : slices)
    {
      const Source * const source = slice.source;
      if (!known.insert(source).second)
      {
        continue;
      }
      volume.dicomFiles.emplace_back(source->path);
      const auto stored = TakeStored(*source);
      const auto bytes = stored.size() / source->size[2];
      for (std::size_t n = 0; n < slices.size(); ++n)
      {
        if (slices[n].source == source)
        {
          Rescale(slices[n], stored.data() + slices[n].frame * bytes, count, values + n * count);
        }
      }
    }
    if (arranged.isInterpolated)
    {
      Interpolate(slices, values, count, planes, pixels);
    }
  });
  return volume;
}

itk::MetaDataDictionary
ReadAttributes(const fs::path & path)
{
  const auto io = itk::GDCMImageIO::New();
  io->SetFileName(path.string());
  try
  {
    io->ReadImageInformation();
  }
  // pixels of floats are not ITK's, but the attributes are there
  catch (const itk::ExceptionObject &) // NOLINT(bugprone-empty-catch)
  {}
  const itk::MetaDataDictionary & all = io->GetMetaDataDictionary();
  const std::string               characterSet = GetEntry(all, "0008|0005");
  itk::MetaDataDictionary         attributes;
  for (const std::string & key : all.GetKeys())
  {
    if (key.find('|') != std::string::npos)
    {
      itk::EncapsulateMetaData(attributes, key, ConvertToUTF8(GetEntry(all, key), characterSet));
    }
  }
  if (!characterSet.empty())
  {
    itk::EncapsulateMetaData<std::string>(attributes, "0008|0005", "ISO_IR 192");
  }
  return attributes;
}
