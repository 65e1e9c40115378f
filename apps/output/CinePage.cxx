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
#include "Orientation.h"
#include "Page.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>

namespace
{
/** Pictures of stored values; the background is 0. */
template <typename TStored>
AnyImage
Store(const Projections & projections, const StoredScale & scale)
{
  AnyImage stored = MakeAnyImage<TStored>(projections.stack.image, 1);
  DispatchPixelType(projections.stack.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    const auto              background = static_cast<PixelType>(projections.background);
    auto &                  pixels = *CastImage<PixelType>(projections.stack).GetPixelContainer();
    const PixelType * const begin = pixels.GetBufferPointer();
    std::transform(begin, begin + pixels.Size(), CastImage<TStored>(stored).GetBufferPointer(), [&](PixelType pixel) {
      const auto value = static_cast<double>(pixel);
      return pixel == background || std::isnan(value) ? TStored{ 0 } : static_cast<TStored>(scale.Store(value));
    });
  });
  return stored;
}

} // namespace

/** A web page that shows the projections, of one component or in colours, and needs nothing but itself: a series to
 * turn and play, with window and level. It holds values as MakeStoredScale() says; of colours it holds pictures in RGB,
 * without a window. */
void
WriteFramesPage(OutputFiles & files, const std::string & path, const Product & product)
{
  const Stack &       stack = product.stack;
  const Projections & projections = stack.projections;
  AnyImage            stored = product.pictures;
  if (!stored.image && projections.stack.image->GetNumberOfComponentsPerPixel() == 3)
  {
    stored = MakePictures(projections, product.window);
  }
  StoredScale scale;
  WindowType  window;
  window[0] = 0.0;
  window[1] = 255.0;
  scale.bits = 24;
  if (!stored.image)
  {
    window = product.window ? *product.window : FindWindow(projections);
    scale = MakeStoredScale(projections.stack, projections.background, window, GetPageBits(product.options));
    stored = scale.bits == 8 ? Store<unsigned char>(projections, scale) : Store<unsigned short>(projections, scale);
  }
  const itk::ImageBase<3> & grid = *stored.image;
  const auto                size = grid.GetLargestPossibleRegion().GetSize();

  std::vector<EdgeLetters> sides;
  if (stack.hasOrientation)
  {
    std::transform(stack.frames.begin(), stack.frames.end(), std::back_inserter(sides), [](const Frame & frame) {
      return ComputeEdgeLetters(frame.transform);
    });
  }

  std::ostringstream series;
  series << std::setprecision(std::numeric_limits<double>::max_digits10);
  series << '{' << DescribeDisplay(product, scale, window) << ", \"width\": " << size[0] << ", \"height\": " << size[1]
         << ", \"spacing\": [" << grid.GetSpacing()[0] << ", " << grid.GetSpacing()[1] << "], \"origin\": ["
         << grid.GetOrigin()[0] << ", " << grid.GetOrigin()[1] << "], \"rate\": " << product.rate
         << ", \"loop\": " << Quote(stack.loop);
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
  series << ", \"frames\": [";
  for (std::size_t frame = 0; frame < size[2]; ++frame)
  {
    series << (frame > 0 ? ",\n" : "\n") << '"' << EncodeBase64(files.EncodePicture(path, stored, frame)) << '"';
  }
  series << "]}";

  WriteFilledPage(files, path, { { "@SERIES@", series.str() } });
}
