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
#include "Animation.h"
#include "Integrity.h"

#include "itkImageIOFactory.h"

#include <algorithm>
#include <csignal>
#include <fstream>
#include <iomanip>
#include <random>
#include <sstream>
#include <stdexcept>

namespace
{
std::filesystem::path
GetFrameName(const std::filesystem::path & path, std::size_t frame)
{
  std::ostringstream name;
  name << path.stem().string() << '-' << std::setw(3) << std::setfill('0') << frame << path.extension().string();
  return path.parent_path() / name.str();
}

itk::IOPixelEnum
ChoosePixelType(unsigned int components, itk::IOComponentEnum componentType)
{
  if (components == 1)
  {
    return itk::IOPixelEnum::SCALAR;
  }
  const bool isColour = componentType == itk::IOComponentEnum::UCHAR && (components == 3 || components == 4);
  return !isColour ? itk::IOPixelEnum::VECTOR : components == 3 ? itk::IOPixelEnum::RGB : itk::IOPixelEnum::RGBA;
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

OutputFiles::OutputFiles()
  : m_Prefix(".shear-warp-mip-" + std::to_string(std::random_device()()) + '-')
{}

OutputFiles::~OutputFiles()
{
  for (const auto & path : m_Written)
  {
    std::error_code ignored;
    std::filesystem::remove(this->GetTemporaryName(path), ignored);
  }
}

bool
OutputFiles::IsPicture(const std::filesystem::path & path)
{
  return path.extension() == ".png";
}

bool
OutputFiles::IsAnimation(const std::filesystem::path & path)
{
  const auto extension = path.extension();
  return extension == ".gif" || extension == ".apng" || extension == ".mp4";
}

bool
OutputFiles::IsPage(const std::filesystem::path & path)
{
  return path.extension() == ".html";
}

void
OutputFiles::Reserve(const std::filesystem::path & path, Format format)
{
  const std::string        name = path.filename().string();
  std::vector<std::string> extensions;
  if (format != Format::Picture)
  {
    extensions = { ".mha", ".nrrd", ".nii", ".nii.gz" };
  }
  if (format != Format::Values)
  {
    extensions.insert(extensions.end(), { ".png", ".gif", ".apng", ".mp4" });
  }
  if (format == Format::Any)
  {
    extensions.emplace_back(".html");
  }
  if (std::none_of(extensions.begin(), extensions.end(), [&](const auto & end) { return EndsWith(name, end); }))
  {
    std::string good;
    for (const std::string & extension : extensions)
    {
      good += ' ' + extension;
    }
    throw std::runtime_error("'" + path.string() + "' must have one of the extensions" + good);
  }
  if (IsAnimation(path))
  {
    RequireAnimationEncoder();
  }
  if (std::filesystem::is_directory(path))
  {
    throw std::runtime_error("'" + path.string() + "' is a folder");
  }

  const auto probe = this->GetTemporaryName(path);
  if (!std::ofstream(probe))
  {
    throw std::runtime_error("cannot write '" + path.string() + "': its folder does not exist or is not writable");
  }
  std::filesystem::remove(probe);

  const auto place = std::filesystem::weakly_canonical(path);
  if (std::find(m_Reserved.begin(), m_Reserved.end(), place) != m_Reserved.end())
  {
    throw std::runtime_error("'" + path.string() + "' would be written twice");
  }
  m_Reserved.push_back(place);
}

void
OutputFiles::Write(const std::filesystem::path & path, const AnyImage & image, Layout layout)
{
  DispatchPixelType(image.componentType, [&](auto tag) {
    auto &             frames = CastImage<typename decltype(tag)::Type>(image);
    const auto * const pixels = frames.GetBufferPointer();
    if (layout != Layout::Series || !IsPicture(path))
    {
      this->WriteFile(path, image, layout == Layout::Still ? 2 : 3, pixels);
      return;
    }
    const auto        size = frames.GetLargestPossibleRegion().GetSize();
    const std::size_t length = size[0] * size[1] * frames.GetNumberOfComponentsPerPixel();
    for (std::size_t frame = 0; frame < size[2]; ++frame)
    {
      this->WriteFile(GetFrameName(path, frame), image, 2, pixels + frame * length);
    }
  });
}

void
OutputFiles::WriteAnimation(const std::filesystem::path & path, const AnyImage & pictures, double rate)
{
  const std::string animation = this->BeginFile(path);
  const std::string raw = this->BeginFile(path.parent_path() / (path.filename().string() + ".raw"));
  try
  {
    EncodeAnimation(pictures, rate, raw, animation);
  }
  catch (const std::runtime_error & error)
  {
    throw std::runtime_error("cannot write '" + path.string() + "': " + error.what());
  }
  std::filesystem::remove(raw);
  m_Written.pop_back();
}

void
OutputFiles::WriteText(const std::filesystem::path & path, const std::string & text)
{
  std::ofstream file(this->BeginFile(path), std::ios::binary);
  file << text;
  file.close();
  if (!file)
  {
    throw std::runtime_error("cannot write all of '" + path.string() + "'; is the disk full?");
  }
}

std::string
OutputFiles::EncodePicture(const std::filesystem::path & path, const AnyImage & image, std::size_t frame)
{
  const auto picture = path.parent_path() / (path.filename().string() + ".png");
  const auto name = this->GetTemporaryName(picture);
  DispatchPixelType(image.componentType, [&](auto tag) {
    auto &     frames = CastImage<typename decltype(tag)::Type>(image);
    const auto size = frames.GetLargestPossibleRegion().GetSize();
    this->WriteFile(picture, image, 2, frames.GetBufferPointer() + frame * size[0] * size[1]);
  });
  std::ifstream      file(name, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  file.close();
  std::filesystem::remove(name);
  m_Written.pop_back();
  return bytes.str();
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

std::string
OutputFiles::BeginFile(const std::filesystem::path & path)
{
  if (!m_HeldSignals)
  {
    m_HeldSignals.emplace();
  }
  HeldSignals::RequireNone();
  m_Written.push_back(path);
  return this->GetTemporaryName(path).string();
}

void
OutputFiles::WriteFile(const std::filesystem::path & path,
                       const AnyImage &              image,
                       unsigned int                  dimension,
                       const void *                  buffer)
{
  const itk::ImageBase<3> * grid = image.image;
  const std::string         temporaryName = this->BeginFile(path);
  const auto io = itk::ImageIOFactory::CreateImageIO(temporaryName.c_str(), itk::IOFileModeEnum::WriteMode);
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
  const unsigned int components = grid->GetNumberOfComponentsPerPixel();
  io->SetPixelType(ChoosePixelType(components, image.componentType));
  io->SetNumberOfComponents(components);
  io->SetComponentType(image.componentType);
  io->SetIORegion(region);
  io->SetFileName(temporaryName);

  // ITK's PNG writer does not survive a full disk
  if (IsPicture(path) && !HasRoom(temporaryName, 2 * static_cast<std::size_t>(io->GetImageSizeInBytes()) + 4096))
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
