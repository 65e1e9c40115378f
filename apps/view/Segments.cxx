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
#include "Segments.h"
#include "Input.h"

#include "itkImageIOFactory.h"
#include "itkMetaDataObject.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>
#include <sstream>
#include <stdexcept>

namespace
{
using ColourType = itk::RGBPixel<unsigned char>;
using Key = SegmentKey;

std::optional<ColourType>
ReadColour(const std::string & text)
{
  std::istringstream numbers(text);
  ColourType         colour;
  for (unsigned int component = 0; component < 3; ++component)
  {
    double number = 0.0;
    if (!(numbers >> number))
    {
      return std::nullopt;
    }
    colour[component] = static_cast<unsigned char>(std::lround(255.0 * std::clamp(number, 0.0, 1.0)));
  }
  return colour;
}

/** What the meta data says of segments. Files of Slicer before 4.11 have each in a component of its own. */
std::map<Key, Appearance>
ReadAppearances(const std::string & path)
{
  std::map<Key, Appearance> appearances;
  const auto                io = itk::ImageIOFactory::CreateImageIO(path.c_str(), itk::IOFileModeEnum::ReadMode);
  if (!io || std::filesystem::is_directory(path))
  {
    return appearances;
  }
  io->SetFileName(path);
  io->ReadImageInformation();
  for (std::size_t n = 0; n < MostSegments; ++n)
  {
    const auto get = [&](const std::string & name, const std::string & otherwise) {
      std::string text;
      return itk::ExposeMetaData(io->GetMetaDataDictionary(), "Segment" + std::to_string(n) + '_' + name, text)
               ? text
               : otherwise;
    };
    std::string name = get("Name", get("ID", ""));
    if (name.empty())
    {
      return appearances;
    }
    std::replace_if(name.begin(), name.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
    Key                key;
    const std::string  value = get("LabelValue", "");
    std::istringstream layer(get("Layer", value.empty() ? std::to_string(n) : "0"));
    std::istringstream label(value.empty() ? "1" : value);
    if (layer >> key.first && label >> key.second)
    {
      appearances[key] = { name, ReadColour(get("Color", "")) };
    }
  }
  return appearances;
}

/** The lowest and the highest index of each label. */
std::map<Key, std::pair<itk::Index<3>, itk::Index<3>>>
FindLabels(const AnyImage & labels, const std::string & path)
{
  std::map<Key, std::pair<itk::Index<3>, itk::Index<3>>> found;
  const unsigned int                                     components = labels.image->GetNumberOfComponentsPerPixel();
  const auto                                             size = labels.image->GetLargestPossibleRegion().GetSize();
  DispatchPixelType(labels.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    if constexpr (std::is_integral_v<PixelType>)
    {
      const PixelType * value = CastImage<PixelType>(labels).GetBufferPointer();
      itk::Index<3>     index;
      const auto        end = [&](unsigned int axis) { return static_cast<itk::IndexValueType>(size[axis]); };
      for (index[2] = 0; index[2] < end(2); ++index[2])
      {
        for (index[1] = 0; index[1] < end(1); ++index[1])
        {
          for (index[0] = 0; index[0] < end(0); ++index[0])
          {
            for (unsigned int component = 0; component < components; ++component, ++value)
            {
              if (*value > 0)
              {
                auto & [lower, upper] =
                  found.emplace(Key(component, static_cast<std::uint64_t>(*value)), std::make_pair(index, index))
                    .first->second;
                for (unsigned int axis = 0; axis < 3; ++axis)
                {
                  lower[axis] = std::min(lower[axis], index[axis]);
                  upper[axis] = std::max(upper[axis], index[axis]);
                }
                if (found.size() > MostSegments)
                {
                  throw std::runtime_error("--segments: '" + path + "' has more than " + std::to_string(MostSegments) +
                                           " labels; is it an image of labels?");
                }
              }
            }
          }
        }
      }
    }
    else
    {
      throw std::runtime_error("--segments: '" + path + "' must have whole numbers, but its pixels are of type " +
                               itk::ImageIOBase::GetComponentTypeAsString(labels.componentType));
    }
  });
  return found;
}

constexpr unsigned char inside = 254;

/** The box of a segment, where its label is \a inside and all else 0. */
Volume
MakeIndicator(const AnyImage & labels, const Segment & segment)
{
  const auto            grid = itk::ImageBase<3>::New();
  itk::Point<double, 3> origin;
  labels.image->TransformIndexToPhysicalPoint(segment.box.GetIndex(), origin);
  grid->CopyInformation(labels.image);
  grid->SetOrigin(origin);
  grid->SetLargestPossibleRegion(segment.box.GetSize());
  Volume          indicator{ { MakeAnyImage<unsigned char>(grid, 1) } };
  unsigned char * pixel = CastImage<unsigned char>(indicator.times.front()).GetBufferPointer();
  DispatchPixelType(labels.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    const auto & image = CastImage<PixelType>(labels);
    const auto   size = segment.box.GetSize();
    const auto   components = image.GetNumberOfComponentsPerPixel();
    const auto   label = static_cast<PixelType>(segment.label);
    for (itk::SizeValueType row = 0; row < size[1] * size[2]; ++row)
    {
      auto index = segment.box.GetIndex();
      index[1] += static_cast<itk::IndexValueType>(row % size[1]);
      index[2] += static_cast<itk::IndexValueType>(row / size[1]);
      const PixelType * value = image.GetBufferPointer() + image.ComputeOffset(index) * components + segment.component;
      for (itk::SizeValueType column = 0; column < size[0]; ++column, value += components, ++pixel)
      {
        *pixel = *value == label ? inside : 0;
      }
    }
  });
  return indicator;
}
} // namespace

Segments
ReadSegments(const std::string & path, const WarningFunction & warn)
{
  constexpr std::array<std::array<unsigned char, 3>, 7> colours{ { { { 230, 159, 0 } },
                                                                   { { 86, 180, 233 } },
                                                                   { { 0, 158, 115 } },
                                                                   { { 240, 228, 66 } },
                                                                   { { 213, 94, 0 } },
                                                                   { { 204, 121, 167 } },
                                                                   { { 0, 114, 178 } } } };

  const auto dicom = ReadDicomSegments(path, warn);
  Segments   segments;
  segments.labels = dicom ? dicom->labels : ReadVolume(path, "", warn, "");
  if (segments.labels.times.size() > 1)
  {
    throw std::runtime_error("--segments: '" + path + "' has " + std::to_string(segments.labels.times.size()) +
                             " points in time; 1 is needed");
  }
  const AnyImage & labels = segments.labels.times.front();
  const auto       appearances = dicom ? dicom->appearances : ReadAppearances(path);
  for (const auto & [key, corners] : FindLabels(labels, path))
  {
    Segment segment;
    segment.component = key.first;
    segment.label = key.second;
    segment.box.SetIndex(corners.first);
    segment.box.SetUpperIndex(corners.second);
    segment.box.PadByRadius(1);
    segment.box.Crop(labels.image->GetLargestPossibleRegion());
    const auto appearance = appearances.find(key);
    const bool isKnown = appearance != appearances.end();
    segment.name = isKnown ? appearance->second.name : "label " + std::to_string(segment.label);
    segment.colour = isKnown && appearance->second.colour
                       ? *appearance->second.colour
                       : ColourType(colours[segments.list.size() % colours.size()].data());
    segments.list.push_back(segment);
  }
  if (segments.list.empty())
  {
    warn("no voxel of '" + path + "' has a label");
  }
  return segments;
}

std::string
Describe(const Segments & segments)
{
  std::string text = std::to_string(segments.list.size()) + (segments.list.size() == 1 ? " segment" : " segments");
  for (const Segment & segment : segments.list)
  {
    text += (&segment == &segments.list.front() ? ": " : ", ") + segment.name;
  }
  return text;
}

AnyImage
DrawSegments(const AnyImage &                                   pictures,
             const Segments &                                   segments,
             const std::function<Projections(const Volume &)> & project)
{
  AnyImage              drawn = MakeColourPictures(pictures);
  const auto            size = drawn.image->GetLargestPossibleRegion().GetSize();
  const std::size_t     width = size[0];
  const std::size_t     height = size[1];
  unsigned char * const pixels = CastImage<unsigned char>(drawn).GetBufferPointer();
  for (const Segment & segment : segments.list)
  {
    const Projections           projections = project(MakeIndicator(segments.labels.times.front(), segment));
    const unsigned char * const values = CastImage<unsigned char>(projections.stack).GetBufferPointer();
    for (std::size_t n = 0; n < width * height * size[2]; ++n)
    {
      const std::size_t column = n % width;
      const std::size_t row = n / width % height;
      const auto        isIn = [values](std::size_t pixel) { return 2 * values[pixel] >= inside; };
      if (isIn(n) && ((column > 0 && !isIn(n - 1)) || (column + 1 < width && !isIn(n + 1)) ||
                      (row > 0 && !isIn(n - width)) || (row + 1 < height && !isIn(n + width))))
      {
        std::copy_n(segment.colour.GetDataPointer(), 3, pixels + 3 * n);
      }
    }
  }
  return drawn;
}
