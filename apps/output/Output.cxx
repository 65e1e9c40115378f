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
#include "FileStart.h"
#include "Guard.h"
#include "Integrity.h"
#include "Posix.h"
#include "Text.h"

#include "itkImageIOFactory.h"
#include "itkMetaDataObject.h"

#include <algorithm>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <random>
#include <sstream>
#include <stdexcept>

#ifdef ShearWarpMIP_HAS_POSIX
#  include <fcntl.h>
#  include <sys/stat.h>
#  include <unistd.h>
#endif

namespace
{
namespace fs = std::filesystem;

/** The name of the standard output as a file. */
const std::string streamName = "/dev/stdout";

/** Names sort as frames do. */
fs::path
GetFrameName(const fs::path & path, std::size_t frame, std::size_t frames)
{
  std::ostringstream name;
  const auto         width = std::max<std::size_t>(3, std::to_string(frames - 1).size());
  name << path.stem().string() << '-' << std::setw(static_cast<int>(width)) << std::setfill('0') << frame
       << path.extension().string();
  return path.parent_path() / name.str();
}

/** Whether \a name is a GetFrameName() of \a path. */
bool
IsFrameName(const fs::path & name, const fs::path & path)
{
  const std::string start = path.stem().string() + '-';
  const std::string stem = name.stem().string();
  return name.extension() == path.extension() && stem.size() > start.size() &&
         stem.compare(0, start.size(), start) == 0 &&
         stem.find_first_not_of("0123456789", start.size()) == std::string::npos;
}

/** Where symbolic links lead, though nothing be there. */
fs::path
FollowLinks(fs::path path)
{
  constexpr int mostLinks = 40;
  for (int links = 0; links < mostLinks && fs::is_symlink(path); ++links)
  {
    path = path.parent_path() / fs::read_symlink(path);
  }
  return path;
}

/** The same for all names of one file. */
std::string
GetIdentity(const fs::path & path)
{
#ifdef ShearWarpMIP_HAS_POSIX
  struct stat status;
  if (stat(path.c_str(), &status) == 0)
  {
    return std::to_string(status.st_dev) + ':' + std::to_string(status.st_ino);
  }
#endif
  return fs::weakly_canonical(fs::absolute(path)).string();
}

/** Gives \a path the mode of \a former and, as far as that is allowed, its owner and group. */
void
CopyAccess(const fs::path & former, const fs::path & path)
{
  fs::perms mode = fs::status(former).permissions();
#ifdef ShearWarpMIP_HAS_POSIX
  struct stat status;
  if (stat(former.c_str(), &status) != 0 || (chown(path.c_str(), status.st_uid, status.st_gid) != 0 &&
                                             chown(path.c_str(), static_cast<uid_t>(-1), status.st_gid) != 0))
  {
    mode &= ~fs::perms::group_all;
  }
#endif
  fs::permissions(path, mode);
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

/** Gives the writers of NRRD and MetaImage the \a texts of a file. */
void
SetTexts(itk::ImageIOBase & io, const OutputFiles::Texts & texts)
{
  const std::string format = io.GetNameOfClass();
  if (format == "NrrdImageIO")
  {
    for (const auto & [key, text] : texts)
    {
      itk::EncapsulateMetaData<std::string>(io.GetMetaDataDictionary(), key, text);
    }
  }
  else if (format == "MetaImageIO")
  {
    for (const auto & [key, whole] : texts)
    {
      std::string name = key;
      // a line holds what follows
      std::string text = whole.substr(0, whole.find_first_of("\r\n"));
      for (int part = 2; !text.empty(); ++part)
      {
        const std::size_t length = text.size() < LongestMetaText ? text.size() : text.rfind(' ', LongestMetaText);
        itk::EncapsulateMetaData<std::string>(io.GetMetaDataDictionary(), name, text.substr(0, length));
        text.erase(0, length);
        name = key + '.' + std::to_string(part);
      }
    }
  }
}

/** Whether \a stream is a file, and opens anew: other systems give the stream itself. */
bool
IsFileOfLinux([[maybe_unused]] const std::string & stream)
{
#ifdef __linux__
  return fs::is_regular_file(stream);
#else
  return false;
#endif
}

/** Throws if the standard output is closed, or is a file that is not empty: ITK would overwrite it. */
void
RequireEmptyStream()
{
#ifdef ShearWarpMIP_HAS_POSIX
  if ((fcntl(STDOUT_FILENO, F_GETFL) & O_ACCMODE) == O_RDONLY)
  {
    throw std::runtime_error("cannot write '-': the standard output is closed");
  }
#endif
  if (IsFileOfLinux(streamName) && fs::file_size(streamName) > 0)
  {
    throw std::runtime_error("cannot write '-': the standard output is a file that is not empty");
  }
}

/** Has later output of others follow: ITK opened the file anew. */
void
GoToEndOfStream()
{
#ifdef ShearWarpMIP_HAS_POSIX
  lseek(STDOUT_FILENO, 0, SEEK_END);
#endif
}

/** Throws if \a bytes of pixels are not all in a file: not all of ITK's writers notice a full disk. */
void
ReadBack(const std::string & fileName, std::uintmax_t bytes)
{
  const std::string extension = GetExtension(fileName);
  if (fileName == streamName && !IsFileOfLinux(fileName))
  {
    return;
  }
  if (fileName == streamName || extension == ".nrrd" || extension == ".mha")
  {
    // they are stored as they are, and may be half of the memory
    std::streamoff end = 0;
    ReadFields(fileName, &end);
    if (fs::file_size(fileName) != static_cast<std::uintmax_t>(end) + bytes)
    {
      throw std::runtime_error("not all");
    }
    return;
  }
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

std::string
DescribeFullDisk(const fs::path & path)
{
  return "cannot write all of '" + path.string() + "'; is the disk full?";
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

} // namespace

OutputFiles::OutputFiles()
  : m_Prefix(".shear-warp-mip-" + std::to_string(std::random_device()()) + '-')
{}

OutputFiles::~OutputFiles()
{
  for (const File & file : m_Files)
  {
    std::error_code ignored;
    fs::remove_all(file.temporary, ignored);
  }
}

void
OutputFiles::Protect(const std::vector<fs::path> & inputs)
{
  for (const fs::path & input : inputs)
  {
    if (fs::exists(input))
    {
      m_Inputs.emplace(GetIdentity(input), input);
    }
  }
}

void
OutputFiles::Reserve(const fs::path & path, const std::set<FileFormat> & formats, const std::string & option)
{
  const fs::path    target = this->Claim(path, false, m_Reserved);
  const std::string extension = GetExtension(path);
  const bool        isRefused = path == StandardOutput && option != "--write-volume";
  const FileFormat  own = isRefused ? FileFormat::None : FindFormat(path);
  if (formats.count(own) == 0)
  {
    throw std::runtime_error(option + ": '" + path.string() + "' must have one of the extensions" +
                             ListExtensions(formats) +
                             (formats.count(FileFormat::Page) == 0 ? ""
                              : extension == ".dcm"                ? "; --dicom-out writes DICOM"
                                                                   : ", or a / at its end for a DICOM series"));
  }
  if (extension == ".nii" || extension == ".nii.gz")
  {
    const bool isCompressed = extension == ".nii.gz";
    const auto input =
      m_Inputs.find(GetIdentity(isCompressed ? path.parent_path() / path.stem() : fs::path(path) += ".gz"));
    if (input != m_Inputs.end())
    {
      throw std::runtime_error("cannot write '" + path.string() + "' beside '" + input->second.string() +
                               "', which this call reads: ITK would read the one for the other");
    }
  }
  if (own == FileFormat::Animation)
  {
    RequireAnimationEncoder();
  }
  if (path == StandardOutput)
  {
    RequireEmptyStream();
  }
  else
  {
    this->RequireWritable(target.parent_path(), path);
  }
  if (own == FileFormat::Picture)
  {
    const fs::path  folder = path.parent_path();
    std::error_code ignored;
    for (const auto & entry : fs::directory_iterator(folder.empty() ? "." : folder, ignored))
    {
      if (IsFrameName(entry.path(), path))
      {
        this->RequireNoInput(folder / entry.path().filename());
      }
    }
  }
}

void
OutputFiles::ReserveFolder(const fs::path & path)
{
  const fs::path target = this->Claim(path, true, m_Reserved);
  this->RequireWritable(fs::exists(target) ? target : target.parent_path(), path);
}

void
OutputFiles::Write(const fs::path & path, const AnyImage & image, Layout layout, const Texts & texts)
{
  DispatchPixelType(image.componentType, [&](auto tag) {
    auto &             frames = CastImage<typename decltype(tag)::Type>(image);
    const auto * const pixels = frames.GetBufferPointer();
    if (layout != Layout::Series || FindFormat(path) != FileFormat::Picture)
    {
      this->WriteFile(path, this->BeginFile(path), image, layout == Layout::Still ? 2 : 3, pixels, {}, texts);
      return;
    }
    const auto        size = frames.GetLargestPossibleRegion().GetSize();
    const std::size_t length = size[0] * size[1] * frames.GetNumberOfComponentsPerPixel();
    for (std::size_t frame = 0; frame < size[2]; ++frame)
    {
      const fs::path name = GetFrameName(path, frame, size[2]);
      this->WriteFile(name, this->BeginFile(name), image, 2, pixels + frame * length, {});
    }
  });
}

void
OutputFiles::WriteVolume(const fs::path & path, const Volume & volume)
{
  const AnyImage & first = volume.times.front();
  // the points in time lie one after the other: see MakeVolume()
  const void * const pixels = DispatchPixelType(first.componentType, [&](auto tag) -> const void * {
    return CastImage<typename decltype(tag)::Type>(first).GetBufferPointer();
  });
  const std::size_t  count = volume.times.size();
  if (count > 1 && GetExtension(path) == ".nrrd")
  {
    // which ITK leaves out
    const std::string space = "left-posterior-superior-time";
    itk::EncapsulateMetaData<std::string>(first.image->GetMetaDataDictionary(), "NRRD_space", space);
  }
  const Times times{ count, volume.timeSpacing > 0.0 ? volume.timeSpacing : 1.0, volume.timeOrigin };
  this->WriteFile(path, this->BeginFile(path), first, count > 1 ? 4 : 3, pixels, times);
}

void
OutputFiles::WriteAnimation(const fs::path & path, const AnyImage & pictures, double rate)
{
  const std::string animation = this->BeginFile(path);
  const std::string raw = this->BeginScratch(path, ".raw");
  try
  {
    EncodeAnimation(pictures, rate, raw, animation);
  }
  catch (const std::runtime_error & error)
  {
    throw std::runtime_error("cannot write '" + path.string() + "': " + error.what());
  }
  this->RemoveScratch();
}

void
OutputFiles::WriteText(const fs::path & path, const std::vector<std::string_view> & parts)
{
  std::ofstream file(this->BeginFile(path), std::ios::binary);
  for (const std::string_view part : parts)
  {
    file << part;
  }
  file.close();
  if (!file)
  {
    throw std::runtime_error(DescribeFullDisk(path));
  }
}

std::string
OutputFiles::EncodePicture(const fs::path & path, const AnyImage & image, std::size_t frame)
{
  const std::string picture = this->BeginScratch(path, ".png");
  DispatchPixelType(image.componentType, [&](auto tag) {
    auto &     frames = CastImage<typename decltype(tag)::Type>(image);
    const auto size = frames.GetLargestPossibleRegion().GetSize();
    this->WriteFile(path,
                    picture,
                    image,
                    2,
                    frames.GetBufferPointer() + frame * size[0] * size[1] * frames.GetNumberOfComponentsPerPixel(),
                    {});
  });
  std::ifstream      file(picture, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  file.close();
  this->RemoveScratch();
  return bytes.str();
}

fs::path
OutputFiles::BeginFolder(const fs::path & path)
{
  this->HoldSignals();
  const fs::path target = this->Claim(path, true, m_Begun);
  const fs::path folder = fs::exists(target) ? target : target.parent_path();
  this->RequireWritable(folder, path);
  fs::path temporary = this->MakeTemporaryName(folder, "");
  m_Files.push_back({ temporary, target, {}, fs::exists(target) });
  fs::create_directory(temporary);
  return temporary;
}

void
OutputFiles::Commit()
{
  HeldSignals::RequireNone();
  std::vector<File> moves;
  for (const File & file : m_Files)
  {
    if (!file.isFilled)
    {
      moves.push_back(file);
      continue;
    }
    if (!this->IsEmptyFolder(file.target))
    {
      throw std::runtime_error("cannot write '" + file.target.string() + "': it is no longer empty");
    }
    for (const auto & entry : fs::directory_iterator(file.temporary))
    {
      moves.push_back({ entry.path(), file.target / entry.path().filename(), {} });
    }
  }

  std::size_t done = 0;
  try
  {
    for (; done < moves.size(); ++done)
    {
      File & move = moves[done];
      // a folder that has come meanwhile is no former one
      if (!fs::is_directory(move.temporary) && fs::exists(move.target))
      {
        CopyAccess(move.target, move.temporary);
        // the last one needs no way back
        if (done + 1 < moves.size())
        {
          this->KeepFormer(move);
        }
      }
      fs::rename(move.temporary, move.target);
    }
  }
  catch (const fs::filesystem_error & error)
  {
    const std::string name = moves[done].target.string();
    for (std::size_t n = done + 1; n-- > 0;)
    {
      const File &    move = moves[n];
      std::error_code ignored;
      if (!move.former.empty())
      {
        fs::rename(move.former, move.target, ignored);
      }
      else if (n < done)
      {
        fs::rename(move.target, move.temporary, ignored);
      }
    }
    throw std::runtime_error("cannot write '" + name + "': " + error.code().message());
  }
}

void
OutputFiles::KeepFormer(File & file)
{
  // not removed if the process is killed: it may be the only copy
  file.former = file.target.parent_path() / (".former" + m_Prefix + std::to_string(m_Count++));
  m_Files.push_back({ file.former, {}, {} });
  std::error_code noLinks;
  fs::create_hard_link(file.target, file.former, noLinks);
  if (noLinks)
  {
    fs::rename(file.target, file.former);
  }
}

void
OutputFiles::HoldSignals()
{
  if (!m_HeldSignals)
  {
    m_HeldSignals.emplace();
  }
  HeldSignals::RequireNone();
}

fs::path
OutputFiles::MakeTemporaryName(const fs::path & folder, const std::string & extension)
{
  RemoveIfKilled(folder / m_Prefix);
  return folder / (m_Prefix + std::to_string(m_Count++) + extension);
}

void
OutputFiles::RequireNoInput(const fs::path & path) const
{
  const auto input = m_Inputs.find(GetIdentity(path));
  if (input != m_Inputs.end())
  {
    throw std::runtime_error("cannot write '" + path.string() + "': this call reads it, as '" + input->second.string() +
                             "'");
  }
}

fs::path
OutputFiles::Claim(const fs::path & path, bool isFolder, Names & taken) const
{
  const std::string name = "'" + path.string() + "'";
  fs::path          target;
  try
  {
    const auto status = fs::status(path);
    if (isFolder ? fs::exists(status) && !this->IsEmptyFolder(path) : fs::is_directory(status))
    {
      throw std::runtime_error(name +
                               (isFolder ? " is there already; a DICOM series needs an empty folder" : " is a folder"));
    }
    if (fs::exists(status) && !fs::is_directory(status) && !fs::is_regular_file(status))
    {
      throw std::runtime_error(name + " is a device or a pipe: only files can be written");
    }
    this->RequireNoInput(path == StandardOutput ? fs::path(streamName) : path);
    target = FollowLinks(isFolder ? (path / "").parent_path() : path);
    if (fs::is_regular_file(status) && !std::ofstream(target, std::ios::app))
    {
      throw std::runtime_error("cannot write " + name + ": it is write-protected");
    }
    const auto [other, isNew] = taken.emplace(GetIdentity(target), path);
    if (!isNew)
    {
      throw std::runtime_error(name + " would be written twice, also as '" + other->second.string() + "'");
    }
  }
  catch (const fs::filesystem_error & error)
  {
    throw std::runtime_error("cannot write " + name + ": " + error.code().message());
  }
  return target;
}

bool
OutputFiles::IsEmptyFolder(const fs::path & path) const
{
  std::error_code              error;
  const fs::directory_iterator entries(path, error);
  return !error && std::all_of(begin(entries), end(entries), [this](const auto & entry) {
    return entry.path().filename().string().find(m_Prefix) == 0;
  });
}

void
OutputFiles::RequireWritable(const fs::path & folder, const fs::path & path)
{
  const HeldSignals heldSignals;
  const fs::path    probe = this->MakeTemporaryName(folder, "");
  if (!std::ofstream(probe))
  {
    throw std::runtime_error("cannot write '" + path.string() + "': its folder does not exist or is not writable");
  }
  fs::remove(probe);
}

std::string
OutputFiles::BeginFile(const fs::path & path)
{
  this->HoldSignals();
  const fs::path target = this->Claim(path, false, m_Begun);
  return path == StandardOutput ? streamName : this->AddFile(target, GetExtension(path));
}

std::string
OutputFiles::BeginScratch(const fs::path & path, const std::string & extension)
{
  this->HoldSignals();
  return this->AddFile(FollowLinks(path), extension);
}

std::string
OutputFiles::AddFile(const fs::path & target, const std::string & extension)
{
  const fs::path temporary = this->MakeTemporaryName(target.parent_path(), extension);
  m_Files.push_back({ temporary, target, {} });
  if (std::ofstream(temporary) && fs::exists(target))
  {
    fs::permissions(temporary, fs::perms::owner_read | fs::perms::owner_write);
  }
  return temporary.string();
}

void
OutputFiles::RemoveScratch()
{
  fs::remove(m_Files.back().temporary);
  m_Files.pop_back();
}

void
OutputFiles::WriteFile(const fs::path &    path,
                       const std::string & temporaryName,
                       const AnyImage &    image,
                       unsigned int        dimension,
                       const void *        buffer,
                       const Times &       times,
                       const Texts &       texts)
{
  const itk::ImageBase<3> * grid = image.image;
  const std::string         name = temporaryName == streamName ? streamName + ".nrrd" : temporaryName;
  const auto                io = itk::ImageIOFactory::CreateImageIO(name.c_str(), itk::IOFileModeEnum::WriteMode);
  if (!io)
  {
    throw std::runtime_error("this build of ITK cannot write '" + path.string() + "'");
  }
  itk::ImageIORegion region(dimension);
  io->SetNumberOfDimensions(dimension);
  for (unsigned int axis = 0; axis < dimension; ++axis)
  {
    std::vector<double> direction(dimension);
    if (axis == 3)
    {
      io->SetDimensions(axis, times.count);
      io->SetSpacing(axis, times.spacing);
      io->SetOrigin(axis, times.origin);
      direction[axis] = 1.0;
    }
    else
    {
      io->SetDimensions(axis, grid->GetLargestPossibleRegion().GetSize(axis));
      io->SetSpacing(axis, grid->GetSpacing()[axis]);
      io->SetOrigin(axis, grid->GetOrigin()[axis]);
      for (unsigned int row = 0; row < std::min(dimension, 3u); ++row)
      {
        direction[row] = grid->GetDirection()(row, axis);
      }
    }
    io->SetDirection(axis, direction);
    region.SetSize(axis, io->GetDimensions(axis));
  }
  const unsigned int components = grid->GetNumberOfComponentsPerPixel();
  io->SetPixelType(ChoosePixelType(components, image.componentType));
  io->SetNumberOfComponents(components);
  io->SetComponentType(image.componentType);
  io->SetIORegion(region);
  io->SetFileName(temporaryName);
  io->SetMetaDataDictionary(grid->GetMetaDataDictionary());
  SetTexts(*io, texts);

  const std::string full = DescribeFullDisk(path);
  // some of ITK's writers do not survive a full disk
  if (FindFormat(temporaryName) == FileFormat::Picture &&
      !HasRoom(temporaryName, 2 * static_cast<std::size_t>(io->GetImageSizeInBytes()) + 4096))
  {
    throw std::runtime_error(full);
  }
  const auto bytes = static_cast<std::size_t>(io->GetImageSizeInBytes());
  try
  {
    io->Write(buffer);
  }
  catch (const itk::ExceptionObject & error)
  {
    throw std::runtime_error(
      HasRoom(temporaryName, bytes) ? "cannot write '" + path.string() + "': " + error.GetDescription() : full);
  }
  try
  {
    ReadBack(temporaryName, bytes);
  }
  catch (const std::exception &)
  {
    throw std::runtime_error(full);
  }
  if (temporaryName == streamName)
  {
    GoToEndOfStream();
  }
}
