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
#include "DicomAttribute.h"
#include "DicomInput.h"
#include "DicomReader.h"
#include "FileGeometry.h"
#include "FileStart.h"
#include "InputFiles.h"
#include "Integrity.h"
#include "TiffInput.h"

#include "itkGDCMImageIO.h"
#include "itkImageFileReader.h" // registers ITK's readers and writers
#include "itkImageIOFactory.h"
#include "itkMetaDataObject.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <new>
#include <set>
#include <sstream>
#include <stdexcept>

namespace
{
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
  const double distance = FindDistance(image, grid);
  // file formats round positions
  const auto & spacing = grid->GetSpacing();
  if (!(distance <= 0.01 * *std::min_element(spacing.begin(), spacing.end())))
  {
    message << "a corner is " << distance << " mm away from where it should be";
    throw std::runtime_error(message.str());
  }
}

/** The names of ITK's readers of formats whose damaged files are noticed; TIFF and DICOM have readers here. */
const std::set<std::string> checkedReaders = { "GiplImageIO",  "MetaImageIO", "MRCImageIO",
                                               "NiftiImageIO", "NrrdImageIO", "VTKImageIO" };

void
ReadInformation(itk::ImageIOBase & io)
try
{
  io.ReadImageInformation();
}
catch (const itk::ExceptionObject & error)
{
  // the voxels of a sheared NIfTI image can be read all the same
  if (std::string(io.GetNameOfClass()) != "NiftiImageIO" ||
      std::string(error.GetDescription()).find("orthonormal") == std::string::npos)
  {
    throw;
  }
}

/** The volume of an image that ITK reads. */
Volume
ReadImage(itk::ImageIOBase & io, const std::filesystem::path & path, const WarningFunction & warn)
{
  io.SetFileName(path.string());
  ReadInformation(io);
  if (io.GetMetaDataDictionary().HasKey("FrameTransforms"))
  {
    throw std::runtime_error("'" + path.string() + "' has frames of projections, and is no volume");
  }
  RequireVolume(io, path.string());
  RequireAllVoxels(io, path);
  const FileGeometry geometry = ReadGeometry(io, path, warn);
  const unsigned int dimension = io.GetNumberOfDimensions();
  const std::size_t  times = dimension > 3 ? io.GetDimensions(3) : 1;
  const unsigned int components = io.GetNumberOfComponents();
  itk::ImageIORegion region(dimension);
  for (unsigned int axis = 0; axis < dimension; ++axis)
  {
    region.SetSize(axis, io.GetDimensions(axis));
  }
  io.SetIORegion(region);
  const auto grid = MakeGrid(geometry, io);

  Volume volume = DispatchPixelType(io.GetComponentType(), [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    using ContainerType = typename itk::VectorImage<PixelType, 3>::PixelContainer;
    const auto pixels = ContainerType::New();
    pixels->Reserve(static_cast<std::size_t>(io.GetImageSizeInComponents()));
    io.Read(pixels->GetBufferPointer());
    if (!geometry.isSeries || times > 1)
    {
      return MakeVolume<PixelType>(grid, components, times, pixels);
    }
    const auto        volumes = ContainerType::New();
    const std::size_t count = grid->GetLargestPossibleRegion().GetNumberOfPixels();
    volumes->Reserve(count * components);
    for (std::size_t n = 0; n < count * components; ++n)
    {
      (*volumes)[n % components * count + n / components] = (*pixels)[n];
    }
    return MakeVolume<PixelType>(grid, 1, components, volumes);
  });
  if (dimension > 3)
  {
    volume.timeSpacing = io.GetSpacing(3);
    volume.timeOrigin = io.GetOrigin(3);
  }
  const auto & entries = io.GetMetaDataDictionary();
  volume.hasOrientation = geometry.hasOrientation;
  volume.isInverted = GetEntry(entries, "IsInverted") == "1";
  volume.isSuv = GetEntry(entries, "IsSuv") == "1";
  volume.sourceFiles = SplitPaths(GetEntry(entries, "SourceFiles"));
  return volume;
}

/** A hint if a file's content is of another format than its name says, empty otherwise. */
std::string
ExplainContent(const std::filesystem::path & path)
{
  constexpr std::size_t magicOfNIfTI = 344;
  const std::string     start = ReadStart(path, magicOfNIfTI + 3);
  const auto            hasAt = [&start](std::size_t place, const std::string & text) {
    return start.size() >= place && start.compare(place, text.size(), text) == 0;
  };
  const std::string name = hasAt(0, "NRRD")             ? "NRRD, whose name ends in .nrrd"
                           : hasAt(0, "ObjectType")     ? "MetaImage, whose name ends in .mha"
                           : hasAt(magicOfNIfTI, "n+1") ? "NIfTI, whose name ends in .nii"
                           : hasAt(0, "\x1f\x8b")
                             ? "gzip: decompress it, or if it is NIfTI, let its name end in .nii.gz"
                             : "";
  return name.empty() ? "" : "; its content is " + name;
}

/** Keeps only the point in time with this \a number, which counts from 1. */
void
ChooseTime(Volume & volume, const std::string & number, const std::string & option, const std::filesystem::path & path)
{
  const std::size_t count = volume.times.size();
  std::size_t       chosen = 0;
  while (chosen < count && number != std::to_string(chosen + 1))
  {
    ++chosen;
  }
  if (chosen == count)
  {
    throw std::runtime_error(option + ' ' + number + " is not in '" + path.string() + "', which has " +
                             (count == 1 ? "one volume" : "points in time 1 to " + std::to_string(count)));
  }
  volume.times = { volume.times[chosen] };
}
} // namespace

bool
IsDicomFile(const std::filesystem::path & path)
{
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored) && HasPreamble(path) && ReadSoundHeader(path.string());
}

Volume
ReadVolume(const std::filesystem::path & path,
           const std::string &           series,
           const WarningFunction &       warn,
           const std::string &           option,
           const std::string &           volumeNumber)
{
  RequireReadable(path);
  const auto folder = GetImageFolder(path);
  if (folder.empty() && !series.empty())
  {
    throw std::runtime_error(option + " is for a DICOM folder, but '" + path.string() + "' is a file");
  }

  Volume     volume;
  const auto read = [&] {
    const auto io = itk::ImageIOFactory::CreateImageIO(path.c_str(), itk::IOFileModeEnum::ReadMode);
    if (LooksLikeDicom(path) || (io && dynamic_cast<const itk::GDCMImageIO *>(io.GetPointer())))
    {
      volume = ReadDicom(path, series, warn, option, volumeNumber);
      return;
    }
    if (LooksLikeTiff(path))
    {
      volume = ReadTiff(path, warn);
      return;
    }
    const std::string reader = io ? io->GetNameOfClass() : "";
    if (reader == "PNGImageIO" || reader == "JPEGImageIO" || reader == "BMPImageIO")
    {
      throw std::runtime_error("'" + path.string() + "' is one picture, not a volume; put all slices into one file, " +
                               "such as a TIFF or NRRD");
    }
    if (reader == "HDF5ImageIO" || reader == "MINCImageIO")
    {
      throw std::runtime_error("'" + path.string() +
                               "' is HDF5 or MINC, which are not read because nothing in them tells of " +
                               "damage; convert it to NRRD, NIfTI or MetaImage");
    }
    if (checkedReaders.count(reader) == 0)
    {
      throw std::runtime_error("'" + path.string() +
                               "' is no image of DICOM, NIfTI-1, Analyze, NRRD, MetaImage, TIFF, VTK, GIPL or MRC" +
                               ExplainContent(path));
    }
    volume = ReadImage(*io, path, warn);
  };
  try
  {
    if (!folder.empty())
    {
      volume = ReadDicom(folder, series, warn, option, volumeNumber);
    }
    else
    {
      ReadIntact(path, read);
    }
    if (!volumeNumber.empty() && volume.dicomFiles.empty())
    {
      ChooseTime(volume, volumeNumber, GetVolumeOption(option), path);
    }
  }
  catch (const itk::ExceptionObject & error)
  {
    throw std::runtime_error("cannot read '" + path.string() + "': " + error.GetDescription());
  }
  catch (const std::bad_alloc &)
  {
    throw std::runtime_error("not enough memory for '" + path.string() + "'");
  }
  return volume;
}

itk::Image<unsigned char, 3>::Pointer
ReadMask(const std::filesystem::path &        path,
         const std::optional<std::int64_t> &  label,
         const std::vector<std::int64_t> &    removed,
         const itk::ImageBase<3> *            grid,
         const WarningFunction &              warn,
         std::vector<std::filesystem::path> & sourceFiles)
{
  const Volume volume = ReadVolume(path, "", warn, "");
  sourceFiles = volume.sourceFiles;
  const AnyImage & labels = volume.times.front();
  if (volume.times.size() > 1 || labels.image->GetNumberOfComponentsPerPixel() > 1)
  {
    throw std::runtime_error("--mask: '" + path.string() + "' must have one component and one point in time");
  }
  RequireGrid(labels.image, grid, path);

  std::map<std::uint64_t, bool> isFound;
  for (const std::int64_t each : removed)
  {
    isFound[static_cast<std::uint64_t>(each)] = false;
  }
  const auto mask = itk::Image<unsigned char, 3>::New();
  mask->CopyInformation(grid);
  mask->SetRegions(grid->GetLargestPossibleRegion());
  mask->Allocate();
  unsigned char * const begin = mask->GetBufferPointer();
  unsigned char * const end = begin + grid->GetLargestPossibleRegion().GetNumberOfPixels();
  DispatchPixelType(labels.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    if constexpr (std::is_integral_v<PixelType>)
    {
      const PixelType * value = CastImage<PixelType>(labels).GetBufferPointer();
      for (unsigned char * pixel = begin; pixel != end; ++pixel, ++value)
      {
        const bool isLabel = *value > 0;
        const auto number = static_cast<std::uint64_t>(*value);
        if (removed.empty())
        {
          *pixel = label ? isLabel && number == static_cast<std::uint64_t>(*label) : *value != 0;
          continue;
        }
        const auto found = isFound.find(number);
        const bool isRemoved = isLabel && found != isFound.end();
        if (isRemoved)
        {
          found->second = true;
        }
        *pixel = !isRemoved;
      }
    }
    else
    {
      throw std::runtime_error("--mask: '" + path.string() + "' must have whole numbers, but its pixels are of type " +
                               itk::ImageIOBase::GetComponentTypeAsString(labels.componentType));
    }
  });
  for (const auto & [number, isThere] : isFound)
  {
    if (!isThere)
    {
      warn("no voxel of the mask '" + path.string() + "' has the label " + std::to_string(number));
    }
  }
  const bool isEmpty = std::find(begin, end, 1) == end;
  if (isEmpty || (removed.empty() && std::find(begin, end, 0) == end))
  {
    warn((isEmpty ? "no voxel is in the mask '" : "all voxels are in the mask '") + path.string() + '\'');
  }
  return mask;
}
