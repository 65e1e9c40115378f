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
#include "Picture.h"

#include "itkJetColormapFunction.h"
#include "itkRGBPixel.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace
{
template <typename TPixel>
WindowType
ComputeRobustWindow(const TPixel * pixels, std::size_t count, TPixel background)
{
  std::vector<TPixel> values;
  std::copy_if(pixels, pixels + count, std::back_inserter(values), [background](TPixel value) {
    return value != background && std::isfinite(static_cast<double>(value));
  });
  WindowType window;
  if (values.empty())
  {
    // the background is black
    window[0] = std::isfinite(static_cast<double>(background)) ? static_cast<double>(background) : 0.0;
    window[1] = std::max(window[0] + 1.0, std::nextafter(window[0], std::numeric_limits<double>::max()));
    return window;
  }
  const auto percentile = [&values](double fraction) {
    const auto nth = values.begin() + std::lround(fraction * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return static_cast<double>(*nth);
  };
  window[0] = percentile(0.01);
  window[1] = percentile(0.998);
  if (!(window[0] < window[1]))
  {
    // beyond 2^53 one less is the same
    window[0] = std::min(window[1] - 1.0, std::nextafter(window[1], std::numeric_limits<double>::lowest()));
  }
  return window;
}
} // namespace

WindowType
FindWindow(const Projections & projections)
{
  return DispatchPixelType(projections.stack.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    auto & values = *CastImage<PixelType>(projections.stack).GetPixelContainer();
    return ComputeRobustWindow(
      values.GetBufferPointer(), values.Size(), static_cast<PixelType>(projections.background));
  });
}

AnyImage
MakePictures(const Projections & projections, const std::optional<WindowType> & window)
{
  const AnyImage &    stack = projections.stack;
  const WindowType    range = window ? *window : FindWindow(projections);
  const unsigned char inversion = projections.isInverted ? 255 : 0;
  AnyImage            pictures = MakeAnyImage<unsigned char>(stack.image, stack.image->GetNumberOfComponentsPerPixel());
  DispatchPixelType(stack.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    auto &                  values = *CastImage<PixelType>(stack).GetPixelContainer();
    const PixelType * const begin = values.GetBufferPointer();
    std::transform(
      begin, begin + values.Size(), CastImage<unsigned char>(pictures).GetBufferPointer(), [&](PixelType pixel) {
        const auto   given = static_cast<double>(pixel);
        const double value = given > range[0] ? std::min(given, range[1]) : range[0];
        const auto   grey = std::lround(255.0 * (value - range[0]) / (range[1] - range[0]));
        return static_cast<unsigned char>(static_cast<unsigned char>(grey) ^ inversion);
      });
  });
  return pictures;
}

AnyImage
MakeColourPictures(const AnyImage & pictures)
{
  const unsigned int components = pictures.image->GetNumberOfComponentsPerPixel();
  AnyImage           colours = MakeAnyImage<unsigned char>(pictures.image, 3);
  auto &             values = *CastImage<unsigned char>(colours).GetPixelContainer();
  const auto * const grey = CastImage<unsigned char>(pictures).GetBufferPointer();
  for (std::size_t n = 0; n < values.Size(); ++n)
  {
    values[n] = grey[components == 3 ? n : n / 3];
  }
  return colours;
}

AnyImage
MakeDepthPictures(const Projections & projections, const std::optional<WindowType> & window)
{
  Projections upright = projections;
  upright.isInverted = false;
  const AnyImage        brightnesses = MakePictures(upright, window);
  AnyImage              pictures = MakeAnyImage<unsigned char>(projections.stack.image, 3);
  auto &                depths = *CastImage<float>(projections.depths).GetPixelContainer();
  const unsigned char * brightness = CastImage<unsigned char>(brightnesses).GetBufferPointer();
  unsigned char *       pixel = CastImage<unsigned char>(pictures).GetBufferPointer();

  const float * const begin = depths.GetBufferPointer();
  const float * const end = begin + depths.Size();
  // noise is at all depths
  constexpr unsigned char bright = 128;
  float                   nearest = std::numeric_limits<float>::max();
  float                   farthest = std::numeric_limits<float>::lowest();
  for (const float * depth = begin; depth != end; ++depth)
  {
    if (brightness[depth - begin] >= bright)
    {
      nearest = *depth < nearest ? *depth : nearest;
      farthest = *depth > farthest ? *depth : farthest;
    }
  }

  // the map's part from pure red to pure blue
  constexpr float red = 0.872F;
  constexpr float blue = 0.112F;
  const auto      colourMap = itk::Function::JetColormapFunction<float, itk::RGBPixel<unsigned char>>::New();
  colourMap->SetMinimumInputValue(0.0F);
  colourMap->SetMaximumInputValue(1.0F);
  for (const float * depth = begin; depth != end; ++depth, ++brightness, pixel += 3)
  {
    const bool  isSomething = !std::isnan(*depth);
    const float fraction =
      isSomething && nearest < farthest ? std::clamp((*depth - nearest) / (farthest - nearest), 0.0F, 1.0F) : 0.0F;
    const auto colour = (*colourMap)(red + fraction * (blue - red));
    for (unsigned int component = 0; component < 3; ++component)
    {
      pixel[component] = static_cast<unsigned char>(isSomething ? (colour[component] * *brightness + 127) / 255 : 0);
    }
  }
  return pictures;
}
