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

#include "itkShearWarpMIPImageFilter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace
{
template <typename TPixel>
TPixel
GetBackground(const itk::Image<TPixel, 3> & volume, const std::optional<double> & given)
{
  if (!given)
  {
    TPixel minimum = 0;
    if constexpr (std::is_signed_v<TPixel>)
    {
      const TPixel * const begin = volume.GetBufferPointer();
      std::for_each(begin, begin + volume.GetBufferedRegion().GetNumberOfPixels(), [&minimum](TPixel value) {
        minimum = value < minimum ? value : minimum;
      });
    }
    return minimum;
  }

  // the limits of 64-bit integers are not doubles: the upper one is rounded up
  const double lowest = static_cast<double>(std::numeric_limits<TPixel>::lowest());
  const double highest = static_cast<double>(std::numeric_limits<TPixel>::max());
  const bool   fits = std::is_floating_point_v<TPixel>
                        ? !std::isfinite(*given) || (*given >= lowest && *given <= highest)
                        : *given >= lowest && *given <= highest && *given < 0x1p64 &&
                          (std::numeric_limits<TPixel>::digits != 63 || *given < 0x1p63) &&
                          *given == std::trunc(*given);
  if (!fits)
  {
    std::ostringstream message;
    message << "--background " << *given << " is not a value of the image's pixel type, "
            << itk::ImageIOBase::GetComponentTypeAsString(itk::ImageIOBase::MapPixelType<TPixel>::CType);
    throw std::runtime_error(message.str());
  }
  return static_cast<TPixel>(*given);
}

/** Sets the filter to the smallest grid that holds the projections by all of the transforms. */
template <typename TFilter>
void
FitGrid(TFilter & filter, const ProjectionOptions & options)
{
  using PointType = typename TFilter::OriginPointType;
  PointType lower(itk::NumericTraits<double>::max());
  PointType upper(itk::NumericTraits<double>::NonpositiveMin());
  for (const auto & transform : options.transforms)
  {
    filter.SetTransform(transform);
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

template <typename TPixel>
typename itk::Image<TPixel, 3>::Pointer
MakeStack(const itk::ImageBase<2> & frame, std::size_t frames)
{
  const auto frameSize = frame.GetLargestPossibleRegion().GetSize();
  const auto bytes = static_cast<double>(frames) * static_cast<double>(frameSize[0]) *
                     static_cast<double>(frameSize[1]) * sizeof(TPixel);
  itksys::SystemInformation system;
  system.RunMemoryCheck();
  if (bytes > 0x1p20 * static_cast<double>(system.GetTotalPhysicalMemory()))
  {
    std::ostringstream message;
    message << frames << " frames of size " << frameSize << " take " << bytes << " bytes and do not fit in memory";
    throw std::runtime_error(message.str());
  }

  const auto stack = itk::Image<TPixel, 3>::New();
  stack->SetRegions(itk::Size<3>{ { frameSize[0], frameSize[1], frames } });
  const double spacing[] = { frame.GetSpacing()[0], frame.GetSpacing()[1], 1.0 };
  const double origin[] = { frame.GetOrigin()[0], frame.GetOrigin()[1], 0.0 };
  stack->SetSpacing(spacing);
  stack->SetOrigin(origin);
  stack->Allocate();
  return stack;
}

template <typename TPixel>
Frames
ProjectVolume(const ScalarImage &                              volume,
              const ProjectionOptions &                        options,
              const std::function<void(const FrameReport &)> & report)
{
  using ImageType = itk::Image<TPixel, 3>;
  ImageType &  image = CastImage<TPixel>(volume);
  const TPixel background = GetBackground(image, options.background);

  const auto filter = itk::ShearWarpMIPImageFilter<ImageType>::New();
  filter->SetInput(&image);
  filter->SetDefaultPixelValue(background);
  filter->SetOversampling(options.oversampling);
  if (options.spacing)
  {
    filter->SetOutputSpacing(*options.spacing);
  }
  if (options.size)
  {
    filter->SetSize(*options.size);
  }
  if (options.transforms.size() > 1)
  {
    FitGrid(*filter, options);
  }

  typename ImageType::Pointer stack;
  for (std::size_t frame = 0; frame < options.transforms.size(); ++frame)
  {
    filter->SetTransform(options.transforms[frame]);
    if (!stack)
    {
      filter->UpdateOutputInformation();
      stack = MakeStack<TPixel>(*filter->GetOutput(), options.transforms.size());
    }
    filter->Update();
    const auto   pixels = filter->GetOutput()->GetBufferedRegion().GetNumberOfPixels();
    const auto * projection = filter->GetOutput()->GetBufferPointer();
    std::copy(projection, projection + pixels, stack->GetBufferPointer() + frame * pixels);
    report({ frame,
             filter->GetPrincipalAxis(),
             filter->GetPreparationSeconds(),
             filter->GetProjectionSeconds(),
             filter->GetWarpSeconds() });
  }
  return { { stack.GetPointer(), volume.componentType }, static_cast<double>(background) };
}
} // namespace

Frames
ProjectFrames(const ScalarImage &                              volume,
              const ProjectionOptions &                        options,
              const std::function<void(const FrameReport &)> & report)
{
  return DispatchPixelType(volume.componentType, [&](auto tag) {
    return ProjectVolume<typename decltype(tag)::Type>(volume, options, report);
  });
}
