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
#include "Input.h"
#include "Integrity.h"
#include "Text.h"

#include "itkGDCMImageIO.h"
#include "itkGDCMSeriesFileNames.h"
#include "itkImageFileReader.h"
#include "itkImageIOFactory.h"
#include "itkImageSeriesReader.h"
#include "itkMetaDataObject.h"
#include "itkTransformFactoryBase.h"
#include "itkTransformFileReader.h"

#include "itksys/SystemTools.hxx"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <new>
#include <set>
#include <sstream>
#include <stdexcept>

namespace
{
using FileNames = std::vector<std::string>;

void
RequireExistence(const std::filesystem::path & path)
{
  if (!std::filesystem::exists(path))
  {
    throw std::runtime_error("'" + path.string() + "' does not exist");
  }
}

FileNames
FindSeries(const std::filesystem::path & folder, const std::string & series)
{
  FileNames all;
  for (const auto & entry : std::filesystem::directory_iterator(folder))
  {
    if (entry.is_regular_file())
    {
      all.push_back(entry.path().string());
    }
  }
  RequireIntactDICOM(all);

  const auto seriesFileNames = itk::GDCMSeriesFileNames::New();
  seriesFileNames->SetUseSeriesDetails(false);
  seriesFileNames->SetDirectory(folder.string());
  const auto & uids = seriesFileNames->GetSeriesUIDs();
  if (uids.empty())
  {
    throw std::runtime_error("no DICOM series in the folder '" + folder.string() + "'");
  }

  FileNames   found;
  std::string present;
  for (const std::string & uid : uids)
  {
    const FileNames & files = seriesFileNames->GetFileNames(uid);
    if (uid == series || (series.empty() && uids.size() == 1))
    {
      found = files;
    }
    present += (present.empty() ? "" : ", ") + uid + " (" + std::to_string(files.size()) + " files)";
  }
  if (found.empty())
  {
    throw std::runtime_error(
      series.empty() ? "'" + folder.string() + "' has several DICOM series, choose one by --series: " + present
                     : "--series " + series + " is not in '" + folder.string() + "', which has " + present);
  }
  return found;
}

using TransformBase = itk::TransformBaseTemplate<double>;
using TransformType = itk::Transform<double, 3, 3>;

TransformType *
RequireLinear(TransformBase * transform, const std::filesystem::path & path)
{
  const auto linear = dynamic_cast<TransformType *>(transform);
  if (!linear || !linear->IsLinear())
  {
    throw std::runtime_error("'" + path.string() + "' holds a " + transform->GetTransformTypeAsString() +
                             "; a linear 3D transform is needed");
  }
  return linear;
}

TransformBase::Pointer
CreateTransform(std::string type)
{
  const auto precision = type.find("float");
  if (precision != std::string::npos)
  {
    type.replace(precision, 5, "double");
  }
  itk::TransformFactoryBase::RegisterDefaultTransforms();
  const auto object = itk::ObjectFactoryBase::CreateInstance(type.c_str());
  if (object)
  {
    // one reference is the factory's
    object->UnRegister();
  }
  return dynamic_cast<TransformBase *>(object.GetPointer());
}

/** Whether every transform of a text file is known and has both kinds of parameters, as many as it takes, or none.
 * ITK's reader checks neither, and follows component files for ever. Throws if one is not linear. */
bool
IsSoundTransformText(const std::filesystem::path & path)
{
  TransformBase::Pointer transform;
  std::set<std::string>  tags;
  const auto             isComplete = [&tags] { return tags.count("Parameters") == tags.count("FixedParameters"); };
  std::ifstream          file(path, std::ios::binary);
  for (std::string line; std::getline(file, line);)
  {
    const auto        colon = std::min(line.find(':'), line.size());
    const std::string tag = Trim(line.substr(0, colon));
    const std::string value = Trim(line.substr(std::min(colon + 1, line.size())));
    if (tag.empty() || tag[0] == '#')
    {
      continue;
    }
    if (tag == "Transform")
    {
      transform = isComplete() ? CreateTransform(value) : nullptr;
      tags.clear();
    }
    if (!transform || !tags.insert(tag).second || tag == "ComponentTransformFile")
    {
      return false;
    }
    RequireLinear(transform, path);
    if (tag == "Parameters")
    {
      std::istringstream                  numbers(value);
      const std::istream_iterator<double> begin(numbers);
      const auto                          count = std::distance(begin, std::istream_iterator<double>());
      if (static_cast<itk::SizeValueType>(count) != transform->GetNumberOfParameters())
      {
        return false;
      }
    }
  }
  return isComplete();
}

/** Throws unless the slices have one orientation and pixel type, and none is missing or there twice. */
void
RequireOneVolume(const FileNames & files)
{
  using VectorType = itk::Vector<double, 3>;
  struct Slice
  {
    std::string               file;
    itk::IOComponentEnum      componentType;
    std::array<VectorType, 3> directions;
    VectorType                origin;
    double                    position;
  };
  std::vector<Slice> slices;
  for (const std::string & file : files)
  {
    const auto io = itk::GDCMImageIO::New();
    io->SetFileName(file);
    io->ReadImageInformation();
    Slice slice{ file, io->GetComponentType(), {}, {}, 0.0 };
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      slice.directions[axis] = VectorType(io->GetDirection(axis).data());
      slice.origin[axis] = io->GetOrigin(axis);
    }
    const Slice & first = slices.empty() ? slice : slices.front();
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      if (slice.componentType != first.componentType ||
          (slice.directions[axis] - first.directions[axis]).GetNorm() > 1e-3)
      {
        throw std::runtime_error("'" + file + "' and '" + first.file +
                                 "' are of one series, but differ in orientation or pixel type");
      }
    }
    slice.position = slice.origin * first.directions[2];
    slices.push_back(slice);
  }
  std::sort(slices.begin(), slices.end(), [](const Slice & a, const Slice & b) { return a.position < b.position; });

  std::vector<double> gaps;
  for (std::size_t i = 1; i < slices.size(); ++i)
  {
    gaps.push_back(slices[i].position - slices[i - 1].position);
  }
  const auto [closest, farthest] = std::minmax_element(gaps.begin(), gaps.end());
  const bool isTwice = !(*closest > 0.01 * *farthest);
  if (isTwice || *farthest > 1.5 * *closest)
  {
    const auto         after = (isTwice ? closest : farthest) - gaps.begin();
    std::ostringstream message;
    message << (isTwice ? "two slices lie at one position: '" : "a slice is missing between '") << slices[after].file
            << "' at " << slices[after].position << " mm and '" << slices[after + 1].file << "' at "
            << slices[after + 1].position << " mm; others are " << (isTwice ? *farthest : *closest) << " mm apart";
    throw std::runtime_error(message.str());
  }
}

void
RequireVolume(const itk::ImageIOBase & io, const std::string & name)
{
  const unsigned int dimension = io.GetNumberOfDimensions();
  unsigned int       dimensionUsed = dimension;
  while (dimensionUsed > 3 && io.GetDimensions(dimensionUsed - 1) == 1)
  {
    --dimensionUsed;
  }
  if (dimensionUsed != 3 && dimensionUsed != 4)
  {
    throw std::runtime_error("'" + name + "' has " + std::to_string(dimension) +
                             " dimensions; 3 are needed, or 4 with time");
  }
  if (io.GetPixelType() == itk::IOPixelEnum::COMPLEX)
  {
    throw std::runtime_error("'" + name + "' has complex pixels; real ones are needed");
  }
}

void
WarnOfUnevenSlices(const itk::MetaDataDictionary & dictionary, const WarningFunction & warn)
{
  double deviation = 0.0;
  if (itk::ExposeMetaData(dictionary, "ITK_non_uniform_sampling_deviation", deviation) && deviation > 0.0)
  {
    std::ostringstream message;
    message << "the slices are not evenly spaced: one is " << deviation << " mm away from where it should be";
    warn(message.str());
  }
}

void
RequireGrid(const itk::ImageBase<3> * image, const itk::ImageBase<3> * grid, const std::filesystem::path & path)
{
  const auto         size = grid->GetLargestPossibleRegion().GetSize();
  std::ostringstream message;
  message << "--mask: '" << path.string() << "' is not on INPUT's grid: ";
  if (image->GetLargestPossibleRegion().GetSize() != size)
  {
    message << "it has " << image->GetLargestPossibleRegion().GetSize() << " voxels instead of " << size;
    throw std::runtime_error(message.str());
  }
  double distance = 0.0;
  for (unsigned int corner = 0; corner < 8; ++corner)
  {
    itk::Index<3>         index;
    itk::Point<double, 3> points[2];
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      index[axis] = (corner >> axis & 1) * static_cast<itk::IndexValueType>(size[axis] - 1);
    }
    image->TransformIndexToPhysicalPoint(index, points[0]);
    grid->TransformIndexToPhysicalPoint(index, points[1]);
    distance = std::max(distance, points[0].EuclideanDistanceTo(points[1]));
  }
  // file formats round positions
  const auto & spacing = grid->GetSpacing();
  if (!(distance <= 0.01 * *std::min_element(spacing.begin(), spacing.end())))
  {
    message << "a corner is " << distance << " mm away from where it should be";
    throw std::runtime_error(message.str());
  }
}

template <typename TPixel>
Volume
SplitTimes(const itk::VectorImage<TPixel, 4> & image)
{
  const auto size = image.GetLargestPossibleRegion().GetSize();
  const auto grid = itk::ImageBase<3>::New();
  auto       origin = grid->GetOrigin();
  auto       spacing = grid->GetSpacing();
  auto       direction = grid->GetDirection();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    origin[axis] = image.GetOrigin()[axis];
    spacing[axis] = image.GetSpacing()[axis];
    for (unsigned int row = 0; row < 3; ++row)
    {
      direction(row, axis) = image.GetDirection()(row, axis);
    }
  }
  grid->SetLargestPossibleRegion(itk::Size<3>{ { size[0], size[1], size[2] } });
  grid->SetOrigin(origin);
  grid->SetSpacing(spacing);
  grid->SetDirection(direction);

  using ContainerType = typename itk::VectorImage<TPixel, 3>::PixelContainer;
  const auto components = image.GetNumberOfComponentsPerPixel();
  const auto count = grid->GetLargestPossibleRegion().GetNumberOfPixels() * components;
  const auto whole = const_cast<ContainerType *>(image.GetPixelContainer());
  Volume     volume{ {}, image.GetSpacing()[3], image.GetOrigin()[3], whole };
  for (itk::SizeValueType time = 0; time < size[3]; ++time)
  {
    const auto pixels = ContainerType::New();
    pixels->SetImportPointer(whole->GetBufferPointer() + time * count, count, false);
    volume.times.push_back(MakeAnyImage<TPixel>(grid, components, pixels));
  }
  return volume;
}
} // namespace

Volume
ReadVolume(const std::filesystem::path & path, const std::string & series, const WarningFunction & warn)
{
  RequireExistence(path);
  const bool isFolder = std::filesystem::is_directory(path);
  if (!isFolder && !series.empty())
  {
    throw std::runtime_error("--series is for a DICOM folder, but '" + path.string() + "' is a file");
  }
  const FileNames files = isFolder ? FindSeries(path, series) : FileNames{ path.string() };
  if (files.size() > 1)
  {
    RequireOneVolume(files);
  }

  Volume     volume;
  bool       isDICOM = isFolder;
  const auto read = [&] {
    const itk::ImageIOBase::Pointer io =
      isFolder ? itk::ImageIOBase::Pointer(itk::GDCMImageIO::New())
               : itk::ImageIOFactory::CreateImageIO(files.front().c_str(), itk::IOFileModeEnum::ReadMode);
    if (!io)
    {
      throw std::runtime_error("'" + path.string() + "' is not an image that ITK can read");
    }
    isDICOM = dynamic_cast<const itk::GDCMImageIO *>(io.GetPointer()) != nullptr;
    io->SetFileName(files.front());
    io->ReadImageInformation();
    RequireVolume(*io, path.string());

    volume = DispatchPixelType(io->GetComponentType(), [&](auto tag) {
      using PixelType = typename decltype(tag)::Type;
      if (files.size() == 1)
      {
        const auto reader = itk::ImageFileReader<itk::VectorImage<PixelType, 4>>::New();
        reader->SetImageIO(io);
        reader->SetFileName(files.front());
        reader->Update();
        return SplitTimes(*reader->GetOutput());
      }
      const auto reader = itk::ImageSeriesReader<itk::VectorImage<PixelType, 3>>::New();
      reader->SetImageIO(io);
      reader->SetFileNames(files);
      reader->Update();
      const auto * image = reader->GetOutput();
      WarnOfUnevenSlices(image->GetMetaDataDictionary(), warn);
      Volume slices;
      slices.times = { MakeAnyImage<PixelType>(
        image, image->GetNumberOfComponentsPerPixel(), reader->GetOutput()->GetPixelContainer()) };
      return slices;
    });
  };
  try
  {
    isFolder ? read() : ReadIntact(path, read);
  }
  catch (const itk::ExceptionObject & error)
  {
    throw std::runtime_error("cannot read '" + path.string() + "': " + error.GetDescription());
  }
  catch (const std::bad_alloc &)
  {
    throw std::runtime_error("not enough memory for '" + path.string() + "'");
  }
  if (isDICOM)
  {
    volume.dicomFiles.assign(files.begin(), files.end());
  }
  return volume;
}

itk::Image<unsigned char, 3>::Pointer
ReadMask(const std::filesystem::path &       path,
         const std::optional<std::int64_t> & label,
         const itk::ImageBase<3> *           grid,
         const WarningFunction &             warn)
{
  const Volume     volume = ReadVolume(path, "", warn);
  const AnyImage & labels = volume.times.front();
  if (volume.times.size() > 1 || labels.image->GetNumberOfComponentsPerPixel() > 1)
  {
    throw std::runtime_error("--mask: '" + path.string() + "' must have one component and one point in time");
  }
  RequireGrid(labels.image, grid, path);

  const auto mask = itk::Image<unsigned char, 3>::New();
  mask->CopyInformation(grid);
  mask->SetRegions(grid->GetLargestPossibleRegion());
  mask->Allocate();
  const auto * const end = mask->GetBufferPointer() + grid->GetLargestPossibleRegion().GetNumberOfPixels();
  DispatchPixelType(labels.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    if constexpr (std::is_integral_v<PixelType>)
    {
      const PixelType * value = CastImage<PixelType>(labels).GetBufferPointer();
      for (unsigned char * pixel = mask->GetBufferPointer(); pixel != end; ++pixel, ++value)
      {
        *pixel =
          label ? *value > 0 && static_cast<std::uint64_t>(*value) == static_cast<std::uint64_t>(*label) : *value != 0;
      }
    }
    else
    {
      throw std::runtime_error("--mask: '" + path.string() + "' must have whole numbers, but its pixels are of type " +
                               itk::ImageIOBase::GetComponentTypeAsString(labels.componentType));
    }
  });
  if (std::find(mask->GetBufferPointer(), const_cast<unsigned char *>(end), 1) == end)
  {
    warn("no voxel is in the mask '" + path.string() + "'");
  }
  return mask;
}

std::vector<itk::Transform<double, 3, 3>::Pointer>
ReadLinearTransforms(const std::filesystem::path & path)
{
  RequireExistence(path);
  const auto unreadable = [&path] {
    return std::runtime_error("'" + path.string() + "' is not a transform that ITK can read");
  };
  const std::string extension = itksys::SystemTools::GetFilenameLastExtension(path.string());
  if ((extension == ".tfm" || extension == ".txt") && !IsSoundTransformText(path))
  {
    throw unreadable();
  }
  const auto reader = itk::TransformFileReaderTemplate<double>::New();
  reader->SetFileName(path.string());
  try
  {
    reader->Update();
  }
  catch (const itk::ExceptionObject &)
  {
    throw unreadable();
  }

  std::vector<itk::Transform<double, 3, 3>::Pointer> transforms;
  for (const auto & transform : *reader->GetTransformList())
  {
    transforms.push_back(RequireLinear(transform, path));
  }
  if (transforms.empty())
  {
    throw unreadable();
  }
  return transforms;
}
