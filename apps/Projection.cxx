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
#include "Projection.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace
{
/** Throws if \a value, that of the option \a name, is not one of the pixel type. */
template <typename TPixel>
TPixel
ToPixel(double value, const std::string & name)
{
  // the limits of 64-bit integers are not doubles: the upper one is rounded up
  const double lowest = static_cast<double>(std::numeric_limits<TPixel>::lowest());
  const double highest = static_cast<double>(std::numeric_limits<TPixel>::max());
  bool         fits = value >= lowest && value <= highest;
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    fits = fits || !std::isfinite(value);
  }
  else
  {
    fits = fits && value < std::ldexp(1.0, std::numeric_limits<TPixel>::digits) && value == std::trunc(value);
  }
  if (!fits)
  {
    std::ostringstream message;
    message << name << ' ' << value << " is not a value of the image's pixel type, "
            << itk::ImageIOBase::GetComponentTypeAsString(itk::ImageIOBase::MapPixelType<TPixel>::CType);
    throw std::runtime_error(message.str());
  }
  return static_cast<TPixel>(value);
}

template <typename TPixel>
TPixel
GetMinimumBelowZero(const Volume & volume)
{
  TPixel minimum = 0;
  if constexpr (std::is_signed_v<TPixel>)
  {
    for (const AnyImage & time : volume.times)
    {
      auto &               pixels = *CastImage<TPixel>(time).GetPixelContainer();
      const TPixel * const begin = pixels.GetBufferPointer();
      std::for_each(
        begin, begin + pixels.Size(), [&minimum](TPixel value) { minimum = value < minimum ? value : minimum; });
    }
  }
  return minimum;
}

/** The component by itself; of one component, the same pixels. */
template <typename TPixel>
typename itk::Image<TPixel, 3>::Pointer
GetComponent(const AnyImage & anyImage, unsigned int component)
{
  auto &             whole = CastImage<TPixel>(anyImage);
  const unsigned int components = whole.GetNumberOfComponentsPerPixel();
  const auto         image = itk::Image<TPixel, 3>::New();
  image->CopyInformation(&whole);
  image->SetRegions(whole.GetLargestPossibleRegion());
  if (components == 1)
  {
    image->SetPixelContainer(whole.GetPixelContainer());
    return image;
  }
  image->Allocate();
  const TPixel * value = whole.GetBufferPointer() + component;
  const auto     count = image->GetLargestPossibleRegion().GetNumberOfPixels();
  for (TPixel *pixel = image->GetBufferPointer(), *end = pixel + count; pixel != end; ++pixel, value += components)
  {
    *pixel = *value;
  }
  return image;
}

/** Sets the filter to the smallest grid that holds the projections by all of the transforms. */
template <typename TFilter>
void
FitGrid(TFilter & filter, const ProjectionOptions & options)
{
  using PointType = typename TFilter::OriginPointType;
  PointType lower(itk::NumericTraits<double>::max());
  PointType upper(itk::NumericTraits<double>::NonpositiveMin());
  for (const Frame & frame : options.frames)
  {
    filter.SetTransform(frame.transform);
    filter.UpdateOutputInformation();
    const auto * output = filter.GetOutput();
    const auto   spacing = output->GetSpacing();
    const auto   size = output->GetLargestPossibleRegion().GetSize();
    filter.SetOutputSpacing(spacing);
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      const double first = output->GetOrigin()[axis];
      lower[axis] = std::min(lower[axis], first);
      upper[axis] = std::max(upper[axis], first + spacing[axis] * static_cast<double>(size[axis] - 1));
    }
  }

  const auto   spacing = filter.GetOutputSpacing();
  itk::Size<2> size;
  PointType    origin;
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    size[axis] = options.size
                   ? (*options.size)[axis]
                   : 1 + static_cast<itk::SizeValueType>(std::ceil((upper[axis] - lower[axis]) / spacing[axis] - 1e-6));
    origin[axis] = 0.5 * (lower[axis] + upper[axis]) - 0.5 * static_cast<double>(size[axis] - 1) * spacing[axis];
  }
  filter.SetSize(size);
  filter.SetOutputOrigin(origin);
}

/** The grid of the projection in physical space, a single slice. */
itk::ImageBase<3>::Pointer
MakeGridInPlace(const itk::ImageBase<2> & projection, const itk::ImageBase<3> * volume, const Frame & frame)
{
  using ImageType = itk::Image<unsigned char, 3>;
  const auto image = ImageType::New();
  image->CopyInformation(volume);
  // only for its geometry
  const auto filter = itk::ShearWarpMIPImageFilter<ImageType, ImageType>::New();
  filter->SetInput(image);
  filter->SetTransform(frame.transform);
  filter->SetSize(projection.GetLargestPossibleRegion().GetSize());
  filter->SetOutputSpacing(projection.GetSpacing());
  filter->SetOutputOrigin(projection.GetOrigin());
  filter->SetSlabNear(frame.slabNear);
  filter->SetSlabFar(frame.slabFar);
  filter->UpdateOutputInformation();
  return filter->GetOutput();
}

itk::ImageBase<3>::Pointer
MakeStackGrid(const itk::ImageBase<2> & projection, const ProjectionOptions & options)
{
  const auto grid = itk::ImageBase<3>::New();
  const auto size = projection.GetLargestPossibleRegion().GetSize();
  grid->SetLargestPossibleRegion(itk::Size<3>{ { size[0], size[1], options.frames.size() } });
  const double spacing[] = { projection.GetSpacing()[0], projection.GetSpacing()[1], options.frameSpacing };
  const double origin[] = { projection.GetOrigin()[0], projection.GetOrigin()[1], options.frameOrigin };
  grid->SetSpacing(spacing);
  grid->SetOrigin(origin);
  return grid;
}

/** Throws if there is not enough memory for that many bytes for each pixel of \a grid. */
void
RequireMemory(const itk::ImageBase<3> & grid, std::size_t bytesPerPixel)
{
  const auto size = grid.GetLargestPossibleRegion().GetSize();
  const auto bytes = static_cast<double>(size[0]) * static_cast<double>(size[1]) * static_cast<double>(size[2]) *
                     static_cast<double>(bytesPerPixel);
  itksys::SystemInformation system;
  system.RunMemoryCheck();
  if (bytes > 0x1p20 * static_cast<double>(system.GetTotalPhysicalMemory()))
  {
    std::ostringstream message;
    message << size[2] << " frames of size [" << size[0] << ", " << size[1] << "] take " << bytes
            << " bytes and do not fit in memory";
    throw std::runtime_error(message.str());
  }
}

/** Puts a projection into a frame of the stack. */
template <typename TPixel>
void
CopyToStack(const itk::Image<TPixel, 2> & projection, const AnyImage & stack, std::size_t frame, unsigned int component)
{
  const unsigned int components = stack.image->GetNumberOfComponentsPerPixel();
  const auto         count = projection.GetBufferedRegion().GetNumberOfPixels();
  const TPixel *     value = projection.GetBufferPointer();
  TPixel *           pixel = CastImage<TPixel>(stack).GetBufferPointer() + frame * count * components + component;
  for (const TPixel * const end = value + count; value != end; ++value, pixel += components)
  {
    *pixel = *value;
  }
}

template <typename TPixel>
Projections
ProjectVolume(const Volume &                                   volume,
              const ProjectionOptions &                        options,
              const std::function<void(const FrameReport &)> & report)
{
  const auto   filter = itk::ShearWarpMIPImageFilter<itk::Image<TPixel, 3>>::New();
  const TPixel background =
    options.background ? ToPixel<TPixel>(*options.background, "--background") : GetMinimumBelowZero<TPixel>(volume);
  filter->SetDefaultPixelValue(background);
  filter->SetOversampling(options.oversampling);
  filter->SetMode(options.mode);
  if (options.localMaximum)
  {
    filter->LocalMaximumOn();
    filter->SetLocalMaximumThreshold(ToPixel<TPixel>(*options.localMaximum, "--local-maximum"));
  }
  filter->SetMaskImage(options.mask);
  filter->SetCropLower(options.cropLower);
  filter->SetCropUpper(options.cropUpper);
  filter->SetDepthAttenuation(options.attenuation);
  filter->SetComputeDepth(options.computeDepth);
  if (options.spacing)
  {
    filter->SetOutputSpacing(*options.spacing);
  }
  if (options.size)
  {
    filter->SetSize(*options.size);
  }

  const itk::ImageBase<3> * const grid = volume.times.front().image;
  const unsigned int              components = grid->GetNumberOfComponentsPerPixel();
  const std::size_t               frames = options.frames.size();
  Projections                     projections{ {}, {}, static_cast<double>(background) };
  for (unsigned int component = 0; component < components; ++component)
  {
    std::optional<std::size_t> time;
    for (std::size_t n = 0; n < frames; ++n)
    {
      const Frame & frame = options.frames[n];
      if (time != frame.time)
      {
        time = frame.time;
        filter->SetInput(GetComponent<TPixel>(volume.times[frame.time], component));
      }
      if (!projections.stack.image)
      {
        if (frames > 1)
        {
          FitGrid(*filter, options);
        }
        filter->SetTransform(frame.transform);
        filter->UpdateOutputInformation();
        const auto & projection = *filter->GetOutput();
        const auto   stackGrid =
          options.isInPlace ? MakeGridInPlace(projection, grid, frame) : MakeStackGrid(projection, options);
        RequireMemory(*stackGrid, components * sizeof(TPixel) + (options.computeDepth ? sizeof(float) : 0));
        projections.stack = MakeAnyImage<TPixel>(stackGrid, components);
        projections.depths = options.computeDepth ? MakeAnyImage<float>(stackGrid, 1) : AnyImage();
      }
      filter->SetTransform(frame.transform);
      filter->SetSlabNear(frame.slabNear);
      filter->SetSlabFar(frame.slabFar);
      filter->Update();
      CopyToStack<TPixel>(*filter->GetOutput(), projections.stack, n, component);
      if (options.computeDepth)
      {
        CopyToStack<float>(*filter->GetDepthOutput(), projections.depths, n, component);
      }
      report({ component * frames + n,
               components * frames,
               filter->GetPrincipalAxis(),
               filter->GetPreparationSeconds(),
               filter->GetProjectionSeconds(),
               filter->GetWarpSeconds() });
    }
  }
  return projections;
}
} // namespace

Projections
ProjectFrames(const Volume &                                   volume,
              const ProjectionOptions &                        options,
              const std::function<void(const FrameReport &)> & report)
{
  return DispatchPixelType(volume.times.front().componentType, [&](auto tag) {
    return ProjectVolume<typename decltype(tag)::Type>(volume, options, report);
  });
}
