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
#include "DicomSegments.h"
#include "DicomAttribute.h"
#include "DicomFolder.h"
#include "DicomKind.h"
#include "DicomReader.h"
#include "DicomSlices.h"
#include "FileStart.h"
#include "InputFiles.h"

#include <gdcmAttribute.h>
#include <gdcmSequenceOfItems.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace
{
using gdcm::DataSet;
using gdcm::Tag;
using ColourType = itk::RGBPixel<unsigned char>;
using PixelType = unsigned short;

/** CIELab as DICOM has it, of the illuminant D50 (PS3.3 C.10.7.1.1), in sRGB (IEC 61966-2-1). */
ColourType
ConvertColour(const std::uint16_t * stored)
{
  const double lightness = (stored[0] * 100.0 / 65535.0 + 16.0) / 116.0;
  const double lab[] = { lightness + (stored[1] * 255.0 / 65535.0 - 128.0) / 500.0,
                         lightness,
                         lightness - (stored[2] * 255.0 / 65535.0 - 128.0) / 200.0 };
  const double white[] = { 0.9642, 1.0, 0.8251 };
  // with the adaptation of Bradford to sRGB's illuminant, D65
  const double toRed[] = { 3.1338561, -1.6168667, -0.4906146 };
  const double toGreen[] = { -0.9787684, 1.9161415, 0.0334540 };
  const double toBlue[] = { 0.0719453, -0.2289914, 1.4052427 };
  ColourType   colour;
  unsigned int component = 0;
  for (const double * row : { toRed, toGreen, toBlue })
  {
    double linear = 0.0;
    for (unsigned int n = 0; n < 3; ++n)
    {
      const double cube = lab[n] > 6.0 / 29.0 ? std::pow(lab[n], 3.0) : (lab[n] - 4.0 / 29.0) * 108.0 / 841.0;
      linear += row[n] * white[n] * cube;
    }
    linear = std::clamp(linear, 0.0, 1.0);
    const double value = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
    colour[component++] = static_cast<unsigned char>(std::lround(255.0 * value));
  }
  return colour;
}

/** By the segments' numbers. */
std::map<PixelType, Appearance>
ReadAppearances(const DataSet & header)
{
  std::map<PixelType, Appearance> appearances;
  const auto                      segments = header.GetDataElement(Tag(0x0062, 0x0002)).GetValueAsSQ();
  for (std::size_t n = 1; segments && n <= segments->GetNumberOfItems(); ++n)
  {
    const DataSet &                 segment = segments->GetItem(n).GetNestedDataSet();
    gdcm::Attribute<0x0062, 0x0004> number;
    gdcm::Attribute<0x0062, 0x000d> colour;
    number.SetFromDataSet(segment);
    Appearance & appearance = appearances[number.GetValue()];
    appearance.name = GetLine(segment, { 0x0062, 0x0005 }, header);
    if (segment.FindDataElement(decltype(colour)::GetTag()))
    {
      colour.SetFromDataSet(segment);
      appearance.colour = ConvertColour(colour.GetValues());
    }
  }
  return appearances;
}

/** Sorts the frames of a segmentation, and gives each its index among the slices of the grid that is returned, which
 * begins and ends with an empty one. */
itk::ImageBase<3>::Pointer
ArrangeFrames(std::vector<Slice> & frames, std::vector<std::size_t> & indices, const std::string & path)
{
  const Slice first = frames.front();
  for (Slice & frame : frames)
  {
    RequireLikeness(frame, first);
    frame.position = frame.origin * first.directions[2];
  }
  std::stable_sort(
    frames.begin(), frames.end(), [](const Slice & a, const Slice & b) { return a.position < b.position; });
  double distance = std::numeric_limits<double>::infinity();
  for (std::size_t n = 1; n < frames.size(); ++n)
  {
    const double gap = frames[n].position - frames[n - 1].position;
    distance = gap > 1e-3 ? std::min(distance, gap) : distance;
  }
  distance = std::isfinite(distance) ? distance : first.thickness;
  constexpr double mostSlices = 65535.0;
  if (!(distance > 0.0) || !(frames.back().position - frames.front().position < mostSlices * distance))
  {
    throw std::runtime_error("'" + path + "' has frames whose distance is not valid");
  }
  for (const Slice & frame : frames)
  {
    const double number = std::round((frame.position - frames.front().position) / distance);
    const auto   place = frames.front().origin + number * distance * first.directions[2];
    if (!((frame.origin - place).GetNorm() < 0.1 * distance))
    {
      throw std::runtime_error(GetName(frame) + " is not on the grid of the others");
    }
    indices.push_back(static_cast<std::size_t>(number) + 1);
  }

  const auto                       grid = itk::ImageBase<3>::New();
  itk::ImageBase<3>::DirectionType direction;
  const double                     spacing[] = { first.spacing[0], first.spacing[1], distance };
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      direction(row, axis) = first.directions[axis][row];
    }
  }
  grid->SetRegions(itk::Size<3>{ { first.source->size[0], first.source->size[1], indices.back() + 2 } });
  const auto origin = frames.front().origin - distance * first.directions[2];
  grid->SetOrigin(itk::Point<double, 3>(origin.GetDataPointer()));
  grid->SetSpacing(spacing);
  grid->SetDirection(direction);
  return grid;
}

/** Layers of labels, each as long as \a count; a segment is in the first one in which it overlaps no other. Sets the
 * layer of each segment. */
std::vector<std::vector<PixelType>>
MakeLayers(const std::vector<Slice> &         frames,
           const std::vector<std::size_t> &   indices,
           std::size_t                        count,
           std::map<PixelType, std::size_t> & layerOf)
{
  const Source & source = *frames.front().source;
  const auto     stored = TakeStored(source);
  const auto     length = stored.size() / source.size[2];
  // fractions are of a highest value
  gdcm::Attribute<0x0062, 0x000e> highest;
  highest.SetValue(1);
  highest.SetFromDataSet(source.header);
  std::vector<std::vector<PixelType>> layers;
  // calls function(pixel) with the place of each pixel of a segment
  const auto visit = [&](PixelType segment, const auto & function) {
    for (std::size_t n = 0; n < frames.size(); ++n)
    {
      const char * const values = stored.data() + frames[n].frame * length;
      for (std::size_t pixel = 0; pixel < length && frames[n].segment == segment; ++pixel)
      {
        const auto value = static_cast<unsigned char>(values[pixel]);
        if (2 * value >= std::max<std::uint16_t>(1, highest.GetValue()))
        {
          function(indices[n] * length + pixel);
        }
      }
    }
  };
  for (auto & each : layerOf)
  {
    const auto &  segment = each.first;
    std::size_t & layer = each.second;
    for (layer = 0; layer < layers.size(); ++layer)
    {
      bool isFree = true;
      visit(segment, [&](std::size_t pixel) { isFree = isFree && layers[layer][pixel] == 0; });
      if (isFree)
      {
        break;
      }
    }
    if (layer == layers.size())
    {
      layers.emplace_back(count);
    }
    visit(segment, [&, label = segment, to = layer](std::size_t pixel) { layers[to][pixel] = label; });
  }
  return layers;
}
/** The numbers of segments of a label map, without its padding, as long as \a count. */
std::vector<PixelType>
ReadLabels(const std::vector<Slice> & frames, const std::vector<std::size_t> & indices, std::size_t count)
{
  const Source & source = *frames.front().source;
  const auto     stored = TakeStored(source);
  const auto     length = std::size_t{ source.size[0] } * source.size[1];
  PixelType      padding = 0;
  if (const auto * const bytes = source.header.GetDataElement(Tag(0x0028, 0x0120)).GetByteValue())
  {
    bytes->GetBuffer(reinterpret_cast<char *>(&padding), sizeof(padding));
  }
  std::vector<PixelType> labels(count);
  DispatchPixelType(source.storedType, [&](auto tag) {
    using StoredType = typename decltype(tag)::Type;
    for (std::size_t n = 0; n < frames.size(); ++n)
    {
      const auto * const numbers = reinterpret_cast<const StoredType *>(stored.data()) + frames[n].frame * length;
      std::transform(numbers, numbers + length, labels.data() + indices[n] * length, [padding](StoredType number) {
        const auto label = static_cast<PixelType>(number);
        return label == padding ? PixelType{ 0 } : label;
      });
    }
  });
  return labels;
}
} // namespace

std::optional<SegmentFile>
ReadDicomSegments(const std::filesystem::path & path, const WarningFunction & warn)
{
  const auto folder = GetImageFolder(path);
  const auto files = folder.empty() ? std::vector<std::string>{ path.string() } : FindSeries(folder, "", warn, "");
  if (files.size() != 1 || !HasPreamble(files.front()))
  {
    return {};
  }
  const auto source = ReadSource(files.front());
  if (!source || !IsSegmentation(source->header))
  {
    return {};
  }
  auto                             frames = GetSlices(*source);
  std::vector<std::size_t>         indices;
  const auto                       grid = ArrangeFrames(frames, indices, files.front());
  const auto                       count = grid->GetLargestPossibleRegion().GetNumberOfPixels();
  const bool                       isLabelMap = IsLabelMap(source->header);
  std::map<PixelType, std::size_t> layerOf;
  for (const Slice & frame : frames)
  {
    if (!isLabelMap && frame.segment == 0)
    {
      throw std::runtime_error(GetName(frame) + " has no segment number");
    }
    layerOf[frame.segment] = 0;
  }
  const auto  layers = isLabelMap ? std::vector<std::vector<PixelType>>{ ReadLabels(frames, indices, count) }
                                  : MakeLayers(frames, indices, count, layerOf);
  const auto  components = static_cast<unsigned int>(layers.size());
  SegmentFile file;
  file.labels.dicomFiles = { files.front() };
  file.labels.times = { MakeAnyImage<PixelType>(grid, components) };
  PixelType * const values = CastImage<PixelType>(file.labels.times.front()).GetBufferPointer();
  for (std::size_t component = 0; component < components; ++component)
  {
    for (std::size_t n = 0; n < layers[component].size(); ++n)
    {
      values[n * components + component] = layers[component][n];
    }
  }
  for (const auto & [number, appearance] : ReadAppearances(source->header))
  {
    const auto layer = layerOf.find(isLabelMap ? 0 : number);
    if (layer != layerOf.end() && !appearance.name.empty())
    {
      file.appearances[{ static_cast<unsigned int>(layer->second), number }] = appearance;
    }
  }
  return file;
}
