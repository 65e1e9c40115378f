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
#include "CinePageTemplate.h"
#include "Orientation.h"
#include "Product.h"

#include "itksys/Base64.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>

namespace
{
/** Pixel 0 is background, the others are intercept + slope * pixel. */
struct StoredValues
{
  AnyImage image;
  double   slope, intercept;
};

/** The range of the values other than the background. */
template <typename TPixel>
WindowType
FindRange(const TPixel * begin, const TPixel * end, TPixel background)
{
  WindowType range;
  range[0] = std::numeric_limits<double>::max();
  range[1] = std::numeric_limits<double>::lowest();
  std::for_each(begin, end, [&](TPixel pixel) {
    const auto value = static_cast<double>(pixel);
    if (pixel != background && std::isfinite(value))
    {
      range[0] = std::min(range[0], value);
      range[1] = std::max(range[1], value);
    }
  });
  if (range[0] > range[1])
  {
    range.Fill(std::isfinite(static_cast<double>(background)) ? static_cast<double>(background) : 0.0);
  }
  return range;
}

template <typename TStored>
StoredValues
Store(const Projections & projections, const WindowType & window)
{
  StoredValues stored{ MakeAnyImage<TStored>(projections.stack.image, 1), 1.0, 0.0 };
  DispatchPixelType(projections.stack.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    constexpr double        levels = std::numeric_limits<TStored>::max() - 1;
    const auto              background = static_cast<PixelType>(projections.background);
    auto &                  pixels = *CastImage<PixelType>(projections.stack).GetPixelContainer();
    const PixelType * const begin = pixels.GetBufferPointer();
    const PixelType * const end = begin + pixels.Size();
    WindowType              range = FindRange(begin, end, background);
    if (sizeof(TStored) == 1)
    {
      const double margin = 0.5 * (window[1] - window[0]);
      range[0] = std::max(range[0], window[0] - margin);
      range[1] = std::max(range[0], std::min(range[1], window[1] + margin));
    }
    const bool isExact = std::is_integral_v<PixelType> && range[1] - range[0] <= levels;
    stored.slope = isExact || range[0] == range[1] ? 1.0 : (range[1] - range[0]) / levels;
    stored.intercept = range[0] - stored.slope;
    std::transform(begin, end, CastImage<TStored>(stored.image).GetBufferPointer(), [&](PixelType pixel) {
      const auto value = static_cast<double>(pixel);
      if (pixel == background || std::isnan(value))
      {
        return TStored{ 0 };
      }
      const double clamped = std::clamp(value, range[0], range[1]);
      return static_cast<TStored>(std::lround((clamped - stored.intercept) / stored.slope));
    });
  });
  return stored;
}

std::string
Quote(const std::string & text)
{
  std::ostringstream quoted;
  for (const char character : text)
  {
    const auto code = static_cast<unsigned char>(character);
    const bool isPlain = code >= 0x20 && character != '"' && character != '\\' && character != '<';
    if (isPlain)
    {
      quoted << character;
    }
    else
    {
      quoted << "\\u" << std::hex << std::setw(4) << std::setfill('0') << static_cast<int>(code);
    }
  }
  return '"' + quoted.str() + '"';
}

std::string
EncodeBase64(const std::string & bytes)
{
  std::string text((bytes.size() + 2) / 3 * 4, '\0');
  text.resize(itksysBase64_Encode(reinterpret_cast<const unsigned char *>(bytes.data()),
                                  bytes.size(),
                                  reinterpret_cast<unsigned char *>(text.data()),
                                  0));
  return text;
}
} // namespace

/** A web page that shows the projections, of one component or in colours, and needs nothing but itself: a series to
 * turn and play, with window and level.
 *
 * It holds the values with 16 bits, exactly if they are whole numbers of a range of less than 65535; or with 8, one
 * grey level for a 254th of twice the window, which is what can be set from the page, as far as there are values. Of
 * colours it holds pictures in RGB, without a window. */
void
WritePage(OutputFiles & files, const std::string & path, const Product & product)
{
  const Options &     options = product.options;
  const Stack &       stack = product.stack;
  const Projections & projections = stack.projections;
  const unsigned int  bits = options.pageBits.value_or(8);
  AnyImage            colours = product.pictures;
  if (!colours.image && projections.stack.image->GetNumberOfComponentsPerPixel() == 3)
  {
    colours = MakePictures(projections, product.window);
  }
  const bool isColoured = colours.image.IsNotNull();
  WindowType window;
  window[0] = 0.0;
  window[1] = 255.0;
  if (!isColoured)
  {
    window = product.window ? *product.window : FindWindow(projections);
  }
  const StoredValues        stored = isColoured  ? StoredValues{ colours, 1.0, 0.0 }
                                     : bits == 8 ? Store<unsigned char>(projections, window)
                                                 : Store<unsigned short>(projections, window);
  const itk::ImageBase<3> & grid = *stored.image.image;
  const auto                size = grid.GetLargestPossibleRegion().GetSize();

  std::vector<EdgeLetters> sides;
  if (stack.hasOrientation)
  {
    std::transform(stack.frames.begin(), stack.frames.end(), std::back_inserter(sides), [](const Frame & frame) {
      return ComputeEdgeLetters(frame.transform);
    });
  }

  const std::string  title = stack.title.empty() ? "Maximum intensity projection" : stack.title;
  std::ostringstream series;
  series << std::setprecision(std::numeric_limits<double>::max_digits10);
  series << "{\"title\": " << Quote(title) << ", \"width\": " << size[0] << ", \"height\": " << size[1]
         << ", \"spacing\": [" << grid.GetSpacing()[0] << ", " << grid.GetSpacing()[1] << "], \"origin\": ["
         << grid.GetOrigin()[0] << ", " << grid.GetOrigin()[1] << "], \"bits\": " << (isColoured ? 24 : bits)
         << ", \"slope\": " << stored.slope << ", \"intercept\": " << stored.intercept << ", \"background\": 0"
         << ", \"inverted\": " << (projections.isInverted && !isColoured ? "true" : "false") << ", \"window\": ["
         << window[0] << ", " << window[1] << "], \"rate\": " << product.rate << ", \"loop\": " << Quote(stack.loop);
  const auto writeList = [&series](const std::string & name, const auto & values, const auto & print) {
    std::string separator = ", \"" + name + "\": [";
    for (const auto & value : values)
    {
      series << separator << print(value);
      separator = ", ";
    }
    series << (values.empty() ? "" : "]");
  };
  const auto printNumber = [](double number) { return number; };
  writeList("angles", GetAngles(stack), printNumber);
  writeList("elevations", stack.elevations, printNumber);
  writeList("segments", product.segments, [](const Segment & segment) {
    std::ostringstream colour;
    colour << '#' << std::hex << std::setfill('0');
    for (unsigned int component = 0; component < 3; ++component)
    {
      colour << std::setw(2) << static_cast<int>(segment.colour[component]);
    }
    return '[' + Quote(segment.name) + ", " + Quote(colour.str()) + ']';
  });
  writeList("letters", sides, [](const EdgeLetters & letters) {
    return Quote(letters.left + ' ' + letters.right + ' ' + letters.top + ' ' + letters.bottom);
  });
  series << ", \"labels\": " << (options.isUnlabelled ? "false" : "true") << ", \"frames\": [";
  for (std::size_t frame = 0; frame < size[2]; ++frame)
  {
    series << (frame > 0 ? ",\n" : "\n") << '"' << EncodeBase64(files.EncodePicture(path, stored.image, frame)) << '"';
  }
  series << "]}";

  const std::string mark = "@SERIES@";
  std::string       page = cinePageTemplate;
  files.WriteText(path, page.replace(page.find(mark), mark.size(), series.str()));
}
