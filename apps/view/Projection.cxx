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

#include "itkCommand.h"
#include "itkShearWarpMIPImageFilter.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <stdexcept>

namespace
{
template <typename TPixel>
bool
IsPixel(double value)
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
  return fits;
}

/** Throws if \a value, the value of the option \a name, is not a value of the pixel type. */
template <typename TPixel>
TPixel
ToPixel(double value, const std::string & name)
{
  if (!IsPixel<TPixel>(value))
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
GetMinimumBelowZero(const std::vector<AnyImage> & images)
{
  TPixel minimum = 0;
  if constexpr (std::is_signed_v<TPixel>)
  {
    for (const AnyImage & image : images)
    {
      auto &               pixels = *CastImage<TPixel>(image).GetPixelContainer();
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

/** The grid of the first frame in physical space, a single slice. */
itk::ImageBase<3>::Pointer
MakeGridInPlace(const itk::ImageBase<3> * frames, const itk::ImageBase<3> * volume, const Frame & frame)
{
  using ImageType = itk::Image<unsigned char, 3>;
  const auto image = ImageType::New();
  image->CopyInformation(volume);
  // only for its geometry
  const auto   filter = itk::ShearWarpMIPImageFilter<ImageType, ImageType>::New();
  const auto   size = frames->GetLargestPossibleRegion().GetSize();
  const double spacing[] = { frames->GetSpacing()[0], frames->GetSpacing()[1] };
  const double origin[] = { frames->GetOrigin()[0], frames->GetOrigin()[1] };
  filter->SetInput(image);
  filter->SetTransform(frame.transform);
  filter->SetSize({ { size[0], size[1] } });
  filter->SetOutputSpacing(spacing);
  filter->SetOutputOrigin(origin);
  filter->SetSlabNear(frame.slabNear);
  filter->SetSlabFar(frame.slabFar);
  filter->UpdateOutputInformation();
  return filter->GetOutput();
}

itk::ImageBase<3>::Pointer
MakeStackGrid(const itk::ImageBase<3> * frames, const ProjectionOptions & options)
{
  const auto grid = itk::ImageBase<3>::New();
  const auto size = frames->GetLargestPossibleRegion().GetSize();
  grid->SetLargestPossibleRegion(itk::Size<3>{ { size[0], size[1], options.frames.size() } });
  const double spacing[] = { frames->GetSpacing()[0], frames->GetSpacing()[1], options.frameSpacing };
  const double origin[] = { frames->GetOrigin()[0], frames->GetOrigin()[1], options.frameOrigin };
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
  if (bytes > itk::ShearWarp::GetPhysicalMemory())
  {
    std::ostringstream message;
    message << size[2] << " frames of size [" << size[0] << ", " << size[1] << "] take " << bytes
            << " bytes and do not fit in memory";
    throw std::runtime_error(message.str());
  }
}

/** Puts projections into the stack, from \a frame on. */
template <typename TPixel>
void
CopyToStack(const itk::Image<TPixel, 3> & frames, const AnyImage & stack, std::size_t frame, unsigned int component)
{
  const unsigned int components = stack.image->GetNumberOfComponentsPerPixel();
  const auto         size = frames.GetBufferedRegion().GetSize();
  const TPixel *     value = frames.GetBufferPointer();
  TPixel * pixel = CastImage<TPixel>(stack).GetBufferPointer() + frame * size[0] * size[1] * components + component;
  for (const TPixel * const end = value + size[0] * size[1] * size[2]; value != end; ++value, pixel += components)
  {
    *pixel = *value;
  }
}

/** The end of the frames from \a begin on that are of the same time and slab. */
std::size_t
FindEndOfSeries(const std::vector<Frame> & frames, std::size_t begin)
{
  const Frame & first = frames[begin];
  return std::find_if(frames.begin() + begin,
                      frames.end(),
                      [&](const Frame & frame) {
                        return frame.time != first.time || frame.slabNear != first.slabNear ||
                               frame.slabFar != first.slabFar;
                      }) -
         frames.begin();
}

template <typename TPixel>
Projections
ProjectVolume(const Volume &                                   volume,
              const ProjectionOptions &                        options,
              const std::function<void(const FrameReport &)> & report,
              const ProgressFunction &                         progress)
{
  const auto   filter = itk::ShearWarpMIPCineImageFilter<itk::Image<TPixel, 3>>::New();
  const TPixel background = options.background ? ToPixel<TPixel>(*options.background, "--background")
                                               : GetMinimumBelowZero<TPixel>(volume.times);
  filter->SetDefaultPixelValue(background);
  filter->SetOversampling(options.oversampling);
  filter->SetExact(options.isExact);
  filter->SetMode(options.mode);
  filter->SetInterpolation(options.interpolation);
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
  if (options.origin)
  {
    filter->SetOutputOrigin(*options.origin);
  }

  const itk::ImageBase<3> * const grid = volume.times.front().image;
  const unsigned int              components = grid->GetNumberOfComponentsPerPixel();
  const std::size_t               frames = options.frames.size();
  const std::size_t               all = components * frames;
  Projections                     projections{ {}, {}, static_cast<double>(background), volume.isInverted };
  for (unsigned int component = 0; component < components; ++component)
  {
    std::optional<std::size_t> time;
    for (std::size_t begin = 0, end = 0; begin < frames; begin = end)
    {
      end = FindEndOfSeries(options.frames, begin);
      const Frame & first = options.frames[begin];
      if (time != first.time)
      {
        time = first.time;
        filter->SetInput(GetComponent<TPixel>(volume.times[first.time], component));
      }
      filter->ClearTransforms();
      for (std::size_t n = begin; n < end; ++n)
      {
        filter->AddTransform(options.frames[n].transform);
      }
      filter->SetSlabNear(first.slabNear);
      filter->SetSlabFar(first.slabFar);
      if (!projections.stack.image)
      {
        filter->UpdateOutputInformation();
        const auto stackGrid = options.isInPlace ? MakeGridInPlace(filter->GetOutput(), grid, first)
                                                 : MakeStackGrid(filter->GetOutput(), options);
        // with the filter's own output
        RequireMemory(*stackGrid, (components + 1) * sizeof(TPixel) + (options.computeDepth ? 2 * sizeof(float) : 0));
        projections.stack = MakeAnyImage<TPixel>(stackGrid, components);
        projections.depths = options.computeDepth ? MakeAnyImage<float>(stackGrid, 1) : AnyImage();
      }
      const std::size_t done = component * frames + begin;
      const auto        observer = filter->AddObserver(itk::ProgressEvent(), [&](const itk::EventObject &) {
        progress(done + static_cast<std::size_t>(filter->GetProgress() * static_cast<float>(end - begin)), all);
      });
      filter->Update();
      filter->RemoveObserver(observer);
      CopyToStack<TPixel>(*filter->GetOutput(), projections.stack, begin, component);
      if (options.computeDepth)
      {
        CopyToStack<float>(*filter->GetDepthOutput(), projections.depths, begin, component);
      }
      report({ done,
               done + end - begin,
               all,
               filter->GetPrincipalAxis(),
               filter->GetPreparationSeconds(),
               filter->GetProjectionSeconds(),
               filter->GetWarpSeconds() });
    }
  }
  return projections;
}
} // namespace

bool
LooksLikeLabels(const AnyImage & image)
{
  constexpr std::size_t fewestVoxels = 4096;
  constexpr std::size_t fewestLabels = 3; // with what is beside them
  constexpr std::size_t mostLabels = 32;
  return DispatchPixelType(image.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    auto &              container = *CastImage<PixelType>(image).GetPixelContainer();
    const auto *        voxels = container.GetBufferPointer();
    std::set<PixelType> found;
    for (std::size_t n = 0; n < container.Size() && found.size() <= mostLabels; ++n)
    {
      const PixelType voxel = voxels[n];
      // most neighbours are equal
      if (n > 0 && voxel == voxels[n - 1])
      {
        continue;
      }
      const auto number = static_cast<double>(voxel);
      if (!(number >= 0.0 && number < 0x1p53) || std::trunc(number) != number)
      {
        return false;
      }
      found.insert(voxel);
    }
    return container.Size() >= fewestVoxels && found.size() >= fewestLabels && found.size() <= mostLabels;
  });
}

bool
IsPixelValue(itk::IOComponentEnum componentType, double value)
{
  return DispatchPixelType(componentType, [value](auto tag) { return IsPixel<typename decltype(tag)::Type>(value); });
}

double
FindBackground(const std::vector<AnyImage> & images)
{
  return DispatchPixelType(images.front().componentType, [&](auto tag) {
    return static_cast<double>(GetMinimumBelowZero<typename decltype(tag)::Type>(images));
  });
}

Projections
ProjectFrames(const Volume &                                   volume,
              const ProjectionOptions &                        options,
              const std::function<void(const FrameReport &)> & report,
              const ProgressFunction &                         progress)
{
  return DispatchPixelType(volume.times.front().componentType, [&](auto tag) {
    return ProjectVolume<typename decltype(tag)::Type>(volume, options, report, progress);
  });
}
