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
#include "Overlay.h"
#include "ColourMaps.h"

#include "DicomAttribute.h"
#include "TransformFile.h"

#include "itkRGBPixel.h"
#include "itkShearWarpFactorization.h"

#include <gdcmReader.h>

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace
{
using TransformType = itk::Transform<double, 3, 3>;

/** Gives \a image the place that \a transform has for it. */
void
Move(itk::ImageBase<3> & image, const TransformType & transform)
{
  const auto origin = transform.TransformPoint(image.GetOrigin());
  auto       spacing = image.GetSpacing();
  auto       direction = image.GetDirection();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    itk::Index<3>         index{};
    itk::Point<double, 3> next;
    index[axis] = 1;
    image.TransformIndexToPhysicalPoint(index, next);
    auto step = transform.TransformPoint(next) - origin;
    spacing[axis] = step.Normalize();
    for (unsigned int row = 0; row < 3; ++row)
    {
      direction(row, axis) = step[row];
    }
  }
  image.SetOrigin(origin);
  image.SetSpacing(spacing);
  image.SetDirection(direction);
}

TransformType::Pointer
ReadInverse(const std::string & path)
{
  const auto transforms = ReadLinearTransforms(path);
  if (transforms.size() > 1)
  {
    throw std::runtime_error("--overlay-transform: '" + path + "' holds " + std::to_string(transforms.size()) +
                             " transforms; 1 is needed");
  }
  const TransformType::Pointer inverse = transforms.front()->GetInverseTransform();
  if (!inverse)
  {
    throw std::runtime_error("--overlay-transform: the transform of '" + path + "' has no inverse");
  }
  return inverse;
}

/** An attribute of the first DICOM file of a volume, empty if there is none. */
std::string
ReadText(const Volume & volume, const gdcm::Tag & tag)
{
  const auto & files = volume.dicomFiles.empty() ? volume.sourceFiles : volume.dicomFiles;
  const auto   first = std::find_if(files.begin(), files.end(), IsDicomFile);
  if (first == files.end())
  {
    return "";
  }
  gdcm::Reader reader;
  reader.SetFileName(first->string().c_str());
  return reader.ReadUpToTag(tag) ? GetText(reader.GetFile().GetDataSet(), tag) : "";
}
} // namespace

Volume
ReadOverlay(const Options & options, const WarningFunction & warn)
{
  const TransformType::Pointer toInput =
    options.overlayTransform.empty() ? nullptr : ReadInverse(options.overlayTransform);
  Volume volume = ReadVolume(options.overlay, options.overlaySeries, warn, "--overlay-series", options.overlayVolume);
  const auto refuse = [&](std::size_t count, const std::string & what) {
    throw std::runtime_error("--overlay: '" + options.overlay + "' has " + std::to_string(count) + ' ' + what);
  };
  if (volume.times.size() > 1)
  {
    refuse(volume.times.size(), "points in time; --overlay-volume NUMBER chooses one");
  }
  itk::ImageBase<3> & image = *volume.times.front().image;
  if (image.GetNumberOfComponentsPerPixel() > 1)
  {
    refuse(image.GetNumberOfComponentsPerPixel(), "components; 1 is needed");
  }
  if (toInput)
  {
    Move(image, *toInput);
  }
  return volume;
}

void
WarnOfOtherSpace(const Volume &          volume,
                 const Volume &          layer,
                 const std::string &     path,
                 const TransformType *   transform,
                 bool                    isRegistered,
                 const WarningFunction & warn)
{
  itk::Point<double, 3> lower[2];
  itk::Point<double, 3> upper[2];
  itk::ShearWarpFactorization::ComputeViewBounds(transform, volume.times.front().image, lower[0], upper[0]);
  itk::ShearWarpFactorization::ComputeViewBounds(transform, layer.times.front().image, lower[1], upper[1]);
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    if (lower[0][axis] >= upper[1][axis] || lower[1][axis] >= upper[0][axis])
    {
      warn("'" + path + "' and INPUT have no place in common: are they in one space?");
      break;
    }
  }

  const auto differ = [&](const gdcm::Tag & tag) {
    const std::string texts[] = { ReadText(volume, tag), ReadText(layer, tag) };
    return !texts[0].empty() && !texts[1].empty() && texts[0] != texts[1];
  };
  if (differ({ 0x0010, 0x0020 }))
  {
    warn("'" + path + "' and INPUT are of different patients");
  }
  if (!isRegistered && differ({ 0x0020, 0x0052 }))
  {
    warn("'" + path + "' and INPUT are of different frames of reference: their places may not match");
  }
}

ProjectionOptions
MakeLayerOptions(const ProjectionOptions & options, const itk::ImageBase<3> * stack)
{
  ProjectionOptions layer;
  layer.frames = options.frames;
  for (Frame & frame : layer.frames)
  {
    frame.time = 0;
  }
  const auto   size = stack->GetLargestPossibleRegion().GetSize();
  const double spacing[] = { stack->GetSpacing()[0], stack->GetSpacing()[1] };
  const double origin[] = { stack->GetOrigin()[0], stack->GetOrigin()[1] };
  layer.size = { { size[0], size[1] } };
  layer.spacing = itk::Vector<double, 2>(spacing);
  layer.origin = itk::Point<double, 2>(origin);
  layer.oversampling = options.oversampling;
  layer.isExact = options.isExact;
  layer.cropLower = options.cropLower;
  layer.cropUpper = options.cropUpper;
  return layer;
}

AnyImage
BlendOverlay(const AnyImage &        pictures,
             const Projections &     overlay,
             const Options &         options,
             const WarningFunction & warn)
{
  using ColourType = itk::RGBPixel<unsigned char>;
  const WindowType window =
    options.overlayWindow.empty() ? FindWindow(overlay) : WindowType(options.overlayWindow.data());
  // only for its map
  const auto filter = itk::ScalarToRGBColormapImageFilter<itk::Image<double, 3>, itk::Image<ColourType, 3>>::New();
  filter->SetColormap(colourMaps.at(options.overlayColour));
  auto & colourMap = *filter->GetModifiableColormap();
  colourMap.SetMinimumInputValue(window[0]);
  colourMap.SetMaximumInputValue(window[1]);

  AnyImage        blended = MakeColourPictures(pictures);
  unsigned char * pixel = CastImage<unsigned char>(blended).GetBufferPointer();
  bool            isSeen = false;
  DispatchPixelType(overlay.stack.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    const auto              background = static_cast<PixelType>(overlay.background);
    auto &                  values = *CastImage<PixelType>(overlay.stack).GetPixelContainer();
    const PixelType * const end = values.GetBufferPointer() + values.Size();
    for (const PixelType * value = values.GetBufferPointer(); value != end; ++value, pixel += 3)
    {
      if (*value == background || !(static_cast<double>(*value) > window[0]))
      {
        continue;
      }
      isSeen = true;
      const auto colour = colourMap(static_cast<double>(*value));
      for (unsigned int component = 0; component < 3; ++component)
      {
        pixel[component] = static_cast<unsigned char>(
          std::lround((1.0 - options.opacity) * pixel[component] + options.opacity * colour[component]));
      }
    }
  });
  if (!isSeen)
  {
    std::ostringstream message;
    message << "nothing of '" << options.overlay << "' is in the picture: no value is above " << window[0];
    warn(message.str());
  }
  return blended;
}
