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
#include "DicomSlices.h"
#include "DicomVolumes.h"

#include <gdcmTrace.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <set>
#include <stdexcept>

namespace
{
namespace fs = std::filesystem;
using gdcm::Tag;
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

/** Throws if one of the slices, which are sorted, is missing. */
void
RequireEachSlice(const std::vector<Slice> & slices)
{
  std::vector<double> gaps;
  for (std::size_t i = 1; i < slices.size(); ++i)
  {
    gaps.push_back(std::abs(slices[i].position - slices[i - 1].position));
  }
  const auto [closest, farthest] = std::minmax_element(gaps.begin(), gaps.end());
  if (*farthest > 1.5 * *closest)
  {
    const auto         after = farthest - gaps.begin();
    const Slice &      one = slices[after];
    const Slice &      other = slices[after + 1];
    std::ostringstream message;
    message << "a slice is missing between " << GetName(one) << " at " << one.position << " mm and " << GetName(other)
            << " at " << other.position << " mm; others are " << *closest << " mm apart";
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
  const std::string volumeOption = option.empty() ? "" : option.substr(0, option.rfind("series")) + "volume";
  ChooseVolume(slices, volumeNumber, volumeOption, "'" + path.string() + "'");
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
    std::set<const Source *> known;
    for (const Slice & slice : slices)
    {
      const Source * const source = slice.source;
      if (!known.insert(source).second)
      {
        continue;
      }
      volume.dicomFiles.emplace_back(source->path);
      const auto stored = ReadStored(*source);
      const auto bytes = stored.size() / source->size[2];
      for (std::size_t n = 0; n < slices.size(); ++n)
      {
        if (slices[n].source == source)
        {
          Rescale(slices[n], stored.data() + slices[n].frame * bytes, count, values + n * count);
        }
      }
    }
  });
  return volume;
}
