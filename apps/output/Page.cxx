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
#include "Page.h"
#include "CinePageTemplate.h"
#include "DicomSeries.h"

#include "itksys/Base64.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>
#include <string_view>
#include <vector>

namespace
{
/** The range of the values other than the background. */
template <typename TPixel>
WindowType
FindRange(const TPixel * begin, const TPixel * end, std::optional<double> background)
{
  const bool hasBackground = background.has_value();
  const auto none = static_cast<TPixel>(background.value_or(0.0));
  WindowType range;
  range[0] = std::numeric_limits<double>::max();
  range[1] = std::numeric_limits<double>::lowest();
  std::for_each(begin, end, [&](TPixel pixel) {
    const auto value = static_cast<double>(pixel);
    if (!(hasBackground && pixel == none) && std::isfinite(value))
    {
      range[0] = std::min(range[0], value);
      range[1] = std::max(range[1], value);
    }
  });
  if (range[0] > range[1])
  {
    range.Fill(std::isfinite(static_cast<double>(none)) ? static_cast<double>(none) : 0.0);
  }
  return range;
}
} // namespace

std::uint16_t
StoredScale::Store(double value) const
{
  const double clamped = value > range[0] ? std::min(value, range[1]) : range[0];
  return static_cast<std::uint16_t>(std::lround((clamped - intercept) / slope));
}

StoredScale
MakeStoredScale(const AnyImage & values, std::optional<double> background, const WindowType & window, unsigned int bits)
{
  return DispatchPixelType(values.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    auto &                  pixels = *CastImage<PixelType>(values).GetPixelContainer();
    const PixelType * const begin = pixels.GetBufferPointer();
    StoredScale             scale{ FindRange(begin, begin + pixels.Size(), background) };
    scale.bits = bits;
    const double levels = bits == 8 ? 254.0 : 65534.0;
    WindowType & range = scale.range;
    if (bits == 8)
    {
      const double     margin = 0.5 * (window[1] - window[0]);
      const WindowType all = range;
      range[0] = std::max(range[0], window[0] - margin);
      range[1] = std::max(range[0], std::min(range[1], window[1] + margin));
      scale.isCut[0] = range[0] > all[0];
      scale.isCut[1] = range[1] < all[1];
    }
    const bool isExact = std::is_integral_v<PixelType> && range[1] - range[0] <= levels;
    scale.slope = isExact || range[0] == range[1] ? 1.0 : (range[1] - range[0]) / levels;
    scale.intercept = range[0] - scale.slope;
    return scale;
  });
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
EncodeBase64(std::string_view bytes)
{
  std::string text((bytes.size() + 2) / 3 * 4, '\0');
  text.resize(itksysBase64_Encode(reinterpret_cast<const unsigned char *>(bytes.data()),
                                  bytes.size(),
                                  reinterpret_cast<unsigned char *>(text.data()),
                                  0));
  return text;
}
std::string
DescribeDisplay(const Product & product, const StoredScale & scale, const WindowType & window)
{
  const Options &   options = product.options;
  const bool        isInverted = product.stack.projections.isInverted && scale.bits != 24;
  const std::string title = options.title.value_or(DescribeMode(product.stack.mode).derivation);
  // stored values that stand for values beyond them too
  const int          lowest = scale.isCut[0] ? scale.Store(scale.range[0]) : -1;
  const int          highest = scale.isCut[1] ? scale.Store(scale.range[1]) : -1;
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10) << "\"title\": " << Quote(title)
       << ", \"bits\": " << scale.bits << ", \"slope\": " << scale.slope << ", \"intercept\": " << scale.intercept
       << ", \"cut\": [" << lowest << ", " << highest
       << "], \"background\": 0, \"inverted\": " << (isInverted ? "true" : "false") << ", \"window\": [" << window[0]
       << ", " << window[1] << "], \"labels\": " << (options.isUnlabelled ? "false" : "true");
  return text.str();
}

void
WritePage(OutputFiles & files, const std::string & path, const Product & product)
{
  (product.volume ? WriteVolumePage : WriteFramesPage)(files, path, product);
}

void
WriteFilledPage(OutputFiles &                              files,
                const std::filesystem::path &              path,
                const std::map<std::string, std::string> & texts)
{
  std::vector<std::string_view> parts;
  std::string_view              rest = cinePageTemplate;
  for (const std::string_view mark : { "@SERIES@", "@ENGINE@", "@VOXELS@" })
  {
    const std::size_t at = rest.find(mark);
    if (at != std::string_view::npos)
    {
      parts.push_back(rest.substr(0, at));
      const auto text = texts.find(std::string(mark));
      parts.push_back(text == texts.end() ? std::string_view() : text->second);
      rest.remove_prefix(at + mark.size());
    }
  }
  parts.push_back(rest);
  files.WriteText(path, parts);
}
