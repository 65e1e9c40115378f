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
#include "TiffDescription.h"

#include "DicomAttribute.h"
#include "Text.h"

#if __has_include("itk_expat.h")
#  include "itk_expat.h"
#else
#  include <expat.h>
#endif

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <stdexcept>

namespace
{
using Attributes = std::map<std::string, std::string>;

struct Element
{
  std::string name;
  Attributes  attributes;
};

/** The elements of an XML text in the order in which they begin, and an empty one behind them. */
std::vector<Element>
ParseElements(const std::string & text)
{
  std::vector<Element>                                               elements;
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser(XML_ParserCreate(nullptr), XML_ParserFree);
  XML_SetUserData(parser.get(), &elements);
  XML_SetStartElementHandler(parser.get(), [](void * data, const XML_Char * name, const XML_Char ** attributes) {
    const std::string whole(name);
    Element           element{ whole.substr(whole.find(':') + 1), {} };
    for (; *attributes; attributes += 2)
    {
      element.attributes[attributes[0]] = attributes[1];
    }
    static_cast<std::vector<Element> *>(data)->push_back(element);
  });
  if (XML_Parse(parser.get(), text.data(), static_cast<int>(text.size()), 1) != XML_STATUS_OK)
  {
    throw std::runtime_error("its OME description is damaged");
  }
  elements.emplace_back();
  return elements;
}

std::string
Find(const Attributes & attributes, const std::string & name)
{
  const auto found = attributes.find(name);
  return found == attributes.end() ? "" : found->second;
}

/** A number of \a attributes, \a missing if it is not there, or not a number. */
double
GetNumber(const Attributes & attributes, const std::string & name, double missing)
{
  const auto numbers = ParseNumbers(Find(attributes, name));
  return attributes.count(name) == 0 ? missing
         : numbers.size() == 1       ? numbers[0]
                                     : std::numeric_limits<double>::quiet_NaN();
}

std::size_t
GetCount(const Attributes & attributes, const std::string & name, std::size_t missing, double least = 1.0)
{
  constexpr double most = 1e9;
  const double     count = GetNumber(attributes, name, static_cast<double>(missing));
  if (!(count >= least && count <= most))
  {
    throw std::runtime_error("its description has no valid " + name);
  }
  return static_cast<std::size_t>(count);
}

std::size_t
Multiply(const std::array<std::size_t, 3> & size)
{
  return size[0] * size[1] * size[2];
}

/** Lines of names and values, as ImageJ writes them: pages are in the order of channel, slice, time. */
TiffDescription
ParseImageJ(const std::string & text, std::size_t pages)
{
  Attributes         fields;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
  {
    const auto separator = line.find('=');
    if (separator != std::string::npos)
    {
      fields[Trim(line.substr(0, separator))] = Trim(line.substr(separator + 1));
    }
  }
  TiffDescription description;
  description.writer = "ImageJ";
  const auto images = GetCount(fields, "images", 1);
  if (images != pages)
  {
    throw std::runtime_error("its description states " + std::to_string(images) + " images, but it has " +
                             std::to_string(pages) + (pages == 1 ? " page" : " pages") +
                             "; save it as BigTIFF or OME-TIFF");
  }
  description.size = {
    { GetCount(fields, "channels", 1), GetCount(fields, "slices", 1), GetCount(fields, "frames", 1) }
  };
  if (Multiply(description.size) != pages && fields.count("slices") == 0 && fields.count("frames") == 0)
  {
    description.size = { { 1, pages, 1 } };
  }
  if (Multiply(description.size) != pages)
  {
    throw std::runtime_error("its description states " + std::to_string(images) +
                             " images, which are not its channels times slices times frames");
  }
  const std::string unit = Find(fields, "unit");
  description.units = { { unit, unit, fields.count("zunit") > 0 ? Find(fields, "zunit") : unit } };
  description.units[1] = fields.count("yunit") > 0 ? Find(fields, "yunit") : unit;
  // it is left out where it is 1
  description.spacing[2] = std::abs(GetNumber(fields, "spacing", unit.empty() ? 0.0 : 1.0));
  description.timeSpacing = std::max(0.0, GetNumber(fields, "finterval", 0.0));
  // a calibration of values, of which one stands for signed ones
  const bool isCalibrated = fields.count("cf") > 0 || fields.count("c0") > 0;
  description.isSigned = isCalibrated && GetNumber(fields, "cf", 0.0) == 0.0 &&
                         GetNumber(fields, "c0", 0.0) == -32768.0 && GetNumber(fields, "c1", 0.0) == 1.0;
  description.ignored = isCalibrated && !description.isSigned ? "a calibration of its values" : "";
  for (std::size_t page = 0; page < pages; ++page)
  {
    description.pages.push_back(page);
  }
  return description;
}

/** The first image of OME-XML. */
TiffDescription
ParseOME(const std::string & text, const std::string & fileName, std::size_t pages, std::size_t samples)
{
  const std::vector<Element> elements = ParseElements(text);
  TiffDescription            description;
  description.writer = "OME";
  const auto isPixels = [](const Element & element) { return element.name == "Pixels"; };
  const auto begin = std::find_if(elements.begin(), elements.end(), isPixels);
  if (begin == elements.end())
  {
    throw std::runtime_error("its OME description describes no pixels");
  }
  const auto         end = std::find_if(begin + 1, elements.end(), isPixels);
  const Attributes & fields = begin->attributes;
  const auto         channels = GetCount(fields, "SizeC", 1);
  description.size = { { channels % samples == 0 ? channels / samples : channels,
                         GetCount(fields, "SizeZ", 1),
                         GetCount(fields, "SizeT", 1) } };
  const std::string axes = "XYZ";
  for (std::size_t axis = 0; axis < 3; ++axis)
  {
    const std::string name = std::string("PhysicalSize") + axes[axis];
    description.spacing[axis] = std::max(0.0, GetNumber(fields, name, 0.0));
    description.units[axis] = fields.count(name + "Unit") > 0 ? Find(fields, name + "Unit") : "um";
  }
  description.timeSpacing = std::max(0.0, GetNumber(fields, "TimeIncrement", 0.0));
  if (Multiply(description.size) > 1000000)
  {
    throw std::runtime_error("its OME description has no valid number of planes");
  }
  if (end != elements.end())
  {
    description.ignored = "more images than the first";
  }

  // in the order of the axes that vary fastest, from the plane that a block of pages begins with
  const std::string order = Find(fields, "DimensionOrder").size() == 5 ? Find(fields, "DimensionOrder") : "XYZCT";
  const std::string names = "CZT";
  const std::size_t none = pages;
  description.pages.assign(Multiply(description.size), none);
  const auto addBlock = [&](std::array<std::size_t, 3> plane, std::size_t page, std::size_t count) {
    for (; count > 0 && page < pages; --count, ++page)
    {
      if (plane[0] >= description.size[0] || plane[1] >= description.size[1] || plane[2] >= description.size[2])
      {
        return;
      }
      description.pages[plane[0] + description.size[0] * (plane[1] + description.size[1] * plane[2])] = page;
      for (std::size_t place = 2; place < 5; ++place)
      {
        const auto axis = names.find(order[place]);
        if (axis == std::string::npos || ++plane[axis] < description.size[axis])
        {
          break;
        }
        plane[axis] = place < 4 ? 0 : plane[axis];
      }
    }
  };
  // a block of another file is followed by the name of that file
  const auto getFile = [](std::vector<Element>::const_iterator block) {
    return block[1].name == "UUID" ? Find(block[1].attributes, "FileName") : "";
  };
  std::set<std::string>                             files;
  std::vector<std::vector<Element>::const_iterator> blocks;
  for (auto element = begin + 1; element != end; ++element)
  {
    if (element->name == "TiffData")
    {
      blocks.push_back(element);
      files.insert(getFile(element));
    }
  }
  for (const auto & block : blocks)
  {
    if (files.size() == 1 || getFile(block) == fileName)
    {
      const Attributes & place = block->attributes;
      addBlock({ { GetCount(place, "FirstC", 0, 0.0) / samples,
                   GetCount(place, "FirstZ", 0, 0.0),
                   GetCount(place, "FirstT", 0, 0.0) } },
               GetCount(place, "IFD", 0, 0.0),
               GetCount(place, "PlaneCount", place.count("IFD") > 0 ? 1 : pages));
    }
  }
  if (blocks.empty())
  {
    addBlock({ { 0, 0, 0 } }, 0, pages);
  }
  const auto missing = std::count(description.pages.begin(), description.pages.end(), none);
  if (missing > 0)
  {
    throw std::runtime_error("its OME description states " + std::to_string(description.pages.size()) +
                             " planes, of which " + std::to_string(missing) +
                             " are not in this file; all must be in one file");
  }
  return description;
}

/** The numbers of the shape that tifffile writes. */
std::string
FindShape(const std::string & text)
{
  const std::string start = "{\"shape\": [";
  const auto        end = text.find(']');
  return text.compare(0, start.size(), start) == 0 && end != std::string::npos
           ? text.substr(start.size(), end - start.size())
           : "";
}
} // namespace

TiffDescription
ParseTiffDescription(const std::string & text, const std::string & fileName, std::size_t pages, std::size_t samples)
{
  if (text.compare(0, 7, "ImageJ=") == 0)
  {
    return ParseImageJ(text, pages);
  }
  const auto xml = text.find('<');
  if (xml < 4 && text.find("OME", xml) < 1000)
  {
    return ParseOME(text.substr(xml), fileName, pages, samples);
  }
  TiffDescription description;
  description.size = { { 1, pages, 1 } };
  for (std::size_t page = 0; page < pages; ++page)
  {
    description.pages.push_back(page);
  }
  const std::string shape = FindShape(text);
  if (std::count(shape.begin(), shape.end(), ',') > (samples > 1 ? 3 : 2))
  {
    description.ignored = "the shape [" + shape + "]";
  }
  return description;
}
