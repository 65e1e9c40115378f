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
#include "Output.h"
#include "Integrity.h"

#include "itkImageIOFactory.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <iomanip>
#include <random>
#include <sstream>
#include <stdexcept>

namespace
{
using WindowType = itk::Vector<double, 2>;

template <typename TPixel>
WindowType
ComputeRobustWindow(const TPixel * pixels, std::size_t count, TPixel background)
{
  std::vector<TPixel> values;
  std::copy_if(pixels, pixels + count, std::back_inserter(values), [background](TPixel value) {
    return value != background && std::isfinite(static_cast<double>(value));
  });
  WindowType window;
  window[1] = static_cast<double>(background);
  if (!values.empty())
  {
    const auto percentile = [&values](double fraction) {
      const auto nth = values.begin() + std::lround(fraction * static_cast<double>(values.size() - 1));
      std::nth_element(values.begin(), nth, values.end());
      return static_cast<double>(*nth);
    };
    window[0] = percentile(0.01);
    window[1] = percentile(0.998);
  }
  if (!(window[0] < window[1]))
  {
    window[0] = window[1] - 1.0;
  }
  return window;
}

template <typename TPixel>
std::vector<unsigned char>
ApplyWindow(const TPixel * pixels, std::size_t count, const WindowType & window)
{
  std::vector<unsigned char> windowed(count);
  std::transform(pixels, pixels + count, windowed.begin(), [&window](TPixel pixel) {
    const double value = std::clamp(static_cast<double>(pixel), window[0], window[1]);
    return static_cast<unsigned char>(std::lround(255.0 * (value - window[0]) / (window[1] - window[0])));
  });
  return windowed;
}

std::filesystem::path
GetFrameName(const std::filesystem::path & path, std::size_t frame)
{
  std::ostringstream name;
  name << path.stem().string() << '-' << std::setw(3) << std::setfill('0') << frame << path.extension().string();
  return path.parent_path() / name.str();
}

bool
EndsWith(const std::string & text, const std::string & end)
{
  return text.size() > end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/** Not all of ITK's writers notice a full disk. */
void
ReadBack(const std::string & fileName)
{
  ReadIntact(fileName, [&fileName] {
    const auto io = itk::ImageIOFactory::CreateImageIO(fileName.c_str(), itk::IOFileModeEnum::ReadMode);
    if (!io)
    {
      throw std::runtime_error("not an image");
    }
    io->SetFileName(fileName);
    io->ReadImageInformation();
    itk::ImageIORegion region(io->GetNumberOfDimensions());
    for (unsigned int axis = 0; axis < io->GetNumberOfDimensions(); ++axis)
    {
      region.SetSize(axis, io->GetDimensions(axis));
    }
    io->SetIORegion(region);
    std::vector<char> pixels(static_cast<std::size_t>(io->GetImageSizeInBytes()));
    io->Read(pixels.data());
  });
}

bool
HasRoom(const std::string & fileName, std::size_t bytes)
{
  const std::string zeros(bytes, '\0');
  std::ofstream     file(fileName, std::ios::binary);
  file << zeros;
  file.close();
  return file.good();
}

volatile std::sig_atomic_t heldSignal = 0;

extern "C" void
HoldSignal(int signal)
{
  heldSignal = signal;
}
} // namespace

HeldSignals::HeldSignals()
{
  for (const int signal : { SIGINT, SIGTERM })
  {
    if (std::signal(signal, HoldSignal) == SIG_IGN)
    {
      std::signal(signal, SIG_IGN);
    }
  }
}

HeldSignals::~HeldSignals()
{
  for (const int signal : { SIGINT, SIGTERM })
  {
    if (std::signal(signal, SIG_DFL) == SIG_IGN)
    {
      std::signal(signal, SIG_IGN);
    }
  }
  if (heldSignal != 0)
  {
    std::raise(heldSignal);
  }
}

void
HeldSignals::RequireNone()
{
  if (heldSignal != 0)
  {
    throw std::runtime_error("interrupted");
  }
}

OutputFiles::OutputFiles(std::filesystem::path path, Kind kind)
  : m_Path(std::move(path))
  , m_Kind(kind)
  , m_Prefix(".shear-warp-mip-" + std::to_string(std::random_device()()) + '-')
{
  const std::string              name = m_Path.filename().string();
  const std::vector<std::string> extensions =
    kind == Kind::Volume ? std::vector<std::string>{ ".mha", ".nrrd", ".nii", ".nii.gz" }
                         : std::vector<std::string>{ ".mha", ".nrrd", ".nii", ".nii.gz", ".png" };
  if (std::none_of(extensions.begin(), extensions.end(), [&](const auto & end) { return EndsWith(name, end); }))
  {
    std::string good;
    for (const std::string & extension : extensions)
    {
      good += ' ' + extension;
    }
    throw std::runtime_error("'" + m_Path.string() + "' must have one of the extensions" + good);
  }
  if (std::filesystem::is_directory(m_Path))
  {
    throw std::runtime_error("'" + m_Path.string() + "' is a folder");
  }

  const auto probe = this->GetTemporaryName(m_Path);
  if (!std::ofstream(probe))
  {
    throw std::runtime_error("cannot write '" + m_Path.string() + "': its folder does not exist or is not writable");
  }
  std::filesystem::remove(probe);
}

OutputFiles::~OutputFiles()
{
  for (const auto & path : m_Written)
  {
    std::error_code ignored;
    std::filesystem::remove(this->GetTemporaryName(path), ignored);
  }
}

bool
OutputFiles::IsWindowed() const
{
  return m_Path.extension() == ".png";
}

void
OutputFiles::WriteValues(const ScalarImage & stack)
{
  const auto * const buffer = DispatchPixelType(stack.componentType, [&](auto tag) -> const void * {
    return CastImage<typename decltype(tag)::Type>(stack).GetBufferPointer();
  });
  this->Write(m_Path, stack.image, m_Kind == Kind::Still ? 2 : 3, stack.componentType, buffer);
}

void
OutputFiles::WriteWindowed(const Frames & frames, const std::optional<WindowType> & window)
{
  const itk::ImageBase<3> * grid = frames.stack.image;
  const auto                size = grid->GetLargestPossibleRegion().GetSize();
  const auto                windowed = DispatchPixelType(frames.stack.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    const PixelType * const pixels = CastImage<PixelType>(frames.stack).GetBufferPointer();
    const std::size_t       count = grid->GetLargestPossibleRegion().GetNumberOfPixels();
    const auto              background = static_cast<PixelType>(frames.background);
    return ApplyWindow(pixels, count, window ? *window : ComputeRobustWindow(pixels, count, background));
  });
  for (std::size_t frame = 0; frame < size[2]; ++frame)
  {
    this->Write(m_Kind == Kind::Series ? GetFrameName(m_Path, frame) : m_Path,
                grid,
                2,
                itk::IOComponentEnum::UCHAR,
                windowed.data() + frame * size[0] * size[1]);
  }
}

void
OutputFiles::Commit()
{
  for (const auto & path : m_Written)
  {
    if (std::filesystem::is_directory(path))
    {
      throw std::runtime_error("'" + path.string() + "' is a folder");
    }
  }
  HeldSignals::RequireNone();
  for (const auto & path : m_Written)
  {
    std::filesystem::rename(this->GetTemporaryName(path), path);
  }
  m_Written.clear();
}

std::filesystem::path
OutputFiles::GetTemporaryName(const std::filesystem::path & path) const
{
  return path.parent_path() / (m_Prefix + path.filename().string());
}

void
OutputFiles::Write(const std::filesystem::path & path,
                   const itk::ImageBase<3> *     grid,
                   unsigned int                  dimension,
                   itk::IOComponentEnum          componentType,
                   const void *                  buffer)
{
  const std::string temporaryName = this->GetTemporaryName(path).string();
  const auto        io = itk::ImageIOFactory::CreateImageIO(temporaryName.c_str(), itk::IOFileModeEnum::WriteMode);
  if (!io)
  {
    throw std::runtime_error("this build of ITK cannot write '" + path.string() + "'");
  }
  itk::ImageIORegion region(dimension);
  io->SetNumberOfDimensions(dimension);
  for (unsigned int axis = 0; axis < dimension; ++axis)
  {
    io->SetDimensions(axis, grid->GetLargestPossibleRegion().GetSize(axis));
    io->SetSpacing(axis, grid->GetSpacing()[axis]);
    io->SetOrigin(axis, grid->GetOrigin()[axis]);
    std::vector<double> direction(dimension);
    for (unsigned int row = 0; row < dimension; ++row)
    {
      direction[row] = grid->GetDirection()(row, axis);
    }
    io->SetDirection(axis, direction);
    region.SetSize(axis, grid->GetLargestPossibleRegion().GetSize(axis));
  }
  io->SetPixelType(itk::IOPixelEnum::SCALAR);
  io->SetNumberOfComponents(1);
  io->SetComponentType(componentType);
  io->SetIORegion(region);
  io->SetFileName(temporaryName);

  if (!m_HeldSignals)
  {
    m_HeldSignals.emplace();
  }
  HeldSignals::RequireNone();
  m_Written.push_back(path);
  // ITK's PNG writer does not survive a full disk
  if (this->IsWindowed() && !HasRoom(temporaryName, 2 * static_cast<std::size_t>(io->GetImageSizeInBytes()) + 4096))
  {
    throw std::runtime_error("cannot write '" + path.string() + "'; is the disk full?");
  }
  try
  {
    io->Write(buffer);
  }
  catch (const itk::ExceptionObject & error)
  {
    throw std::runtime_error("cannot write '" + path.string() + "': " + error.GetDescription());
  }
  try
  {
    ReadBack(temporaryName);
  }
  catch (const std::exception &)
  {
    throw std::runtime_error("cannot write all of '" + path.string() + "'; is the disk full?");
  }
}
