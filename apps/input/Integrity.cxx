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
#include "Integrity.h"

#include "FileStart.h"
#include "Guard.h"
#include "InputFiles.h"
#include "Text.h"

#include "itkMRCHeaderObject.h"
#include "itkMacro.h"
#include "itkMetaDataObject.h"
#include "itk_zlib.h"

#include <nifti1_io.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace fs = std::filesystem;

std::string
DescribeDamage(const fs::path & path, const std::string & reason)
{
  return "'" + path.string() + "' is damaged or incomplete: " + reason;
}

void
Refuse(const fs::path & path, const std::string & reason)
{
  throw std::runtime_error(DescribeDamage(path, reason));
}

std::uintmax_t
GetInflatedSize(const fs::path & path, std::streamoff offset, DeflateFormat format)
{
  std::ifstream              file(path, std::ios::binary);
  std::vector<unsigned char> input(1 << 16);
  std::vector<unsigned char> output(1 << 18);
  z_stream                   stream{};
  inflateInit2(&stream, format == DeflateFormat::Raw ? -MAX_WBITS : MAX_WBITS + 32);
  const std::unique_ptr<z_stream, decltype(&inflateEnd)> end(&stream, inflateEnd);

  std::uintmax_t size = 0;
  int            status = Z_OK;
  file.seekg(offset);
  while (status == Z_OK)
  {
    if (stream.avail_in == 0)
    {
      file.read(reinterpret_cast<char *>(input.data()), static_cast<std::streamsize>(input.size()));
      stream.next_in = input.data();
      stream.avail_in = static_cast<uInt>(file.gcount());
    }
    stream.next_out = output.data();
    stream.avail_out = static_cast<uInt>(output.size());
    status = inflate(&stream, Z_NO_FLUSH);
    size += output.size() - stream.avail_out;
    // gzip may go on with another stream, DICOM ends with a check sum of any bytes
    if (status == Z_STREAM_END && format == DeflateFormat::GzipOrZlib &&
        (stream.avail_in > 0 ? *stream.next_in : file.peek()) == 0x1f)
    {
      status = inflateReset(&stream);
    }
  }
  if (status != Z_STREAM_END)
  {
    Refuse(path, status == Z_BUF_ERROR ? "its compressed data end too early" : "its compressed data are corrupt");
  }
  return size;
}

namespace
{
std::uintmax_t
GetSize(const fs::path & path)
{
  return ReadStart(path, 2) == "\x1f\x8b" ? GetInflatedSize(path) : fs::file_size(path);
}

/** Checks the compressed data of NRRD and MetaImage. */
void
RequireIntactCompression(const fs::path & path)
{
  std::streamoff end = 0;
  auto           fields = ReadFields(path, &end);

  const bool isMeta = fields.count("ElementDataFile") > 0;
  for (const auto & [key, text] : fields)
  {
    if (isMeta && text.size() > LongestMetaText)
    {
      Refuse(path, '\'' + key.substr(0, 40) + "' has " + std::to_string(text.size()) + " characters");
    }
  }
  const bool isCompressed = isMeta ? fields["CompressedData"].find_first_of("Tt1") == 0
                                   : fields["encoding"] == "gzip" || fields["encoding"] == "gz";
  if (isCompressed && fields.count("line skip") == 0)
  {
    const std::string name = isMeta ? fields["ElementDataFile"] : fields["data file"] + fields["datafile"];
    const fs::path    dataPath = path.parent_path() / name;
    if (name.empty() || name == "LOCAL")
    {
      GetInflatedSize(path, end);
    }
    else if (fs::exists(dataPath))
    {
      GetInflatedSize(dataPath);
    }
  }
}

void
RequireBytes(const fs::path & path, std::uintmax_t size, double needed)
{
  if (static_cast<double>(size) < needed)
  {
    std::ostringstream reason;
    reason << std::fixed << std::setprecision(0) << "it has " << size << " of " << needed << " bytes";
    Refuse(path, reason.str());
  }
}

void
RequireIntactNIfTI(const fs::path & path, std::uintmax_t fileSize)
{
  const std::unique_ptr<nifti_image, decltype(&nifti_image_free)> image(nifti_image_read(path.c_str(), 0),
                                                                        nifti_image_free);
  if (!image)
  {
    Refuse(path, "its NIfTI header is not valid");
  }
  // ITK's library looks for files by the stem of the name, first for those that are not compressed
  const std::unique_ptr<char, decltype(&std::free)> found(nifti_findimgname(image->iname, image->nifti_type),
                                                          std::free);
  if (!found)
  {
    Refuse(path, std::string("there is no '") + image->iname + "' for its voxels");
  }
  const fs::path header(image->fname);
  const fs::path data(found.get());
  const auto     isInsteadOfAnother = [&path](const fs::path & file) {
    return file != path && fs::exists(fs::path(file) += path.extension());
  };
  if ((path != header && path != data) || isInsteadOfAnother(header) || isInsteadOfAnother(data) ||
      is_nifti_file(data.c_str()) != image->nifti_type)
  {
    throw std::runtime_error("'" + path.string() +
                             "' cannot be read beside files of like names: ITK would take the header of '" +
                             header.string() + "' and the voxels of '" + data.string() + "'");
  }
  for (const mat44 & form : { image->sto_xyz, image->qto_xyz })
  {
    for (const auto & row : form.m)
    {
      if (!std::all_of(std::begin(row), std::end(row), [](float number) { return std::isfinite(number); }))
      {
        Refuse(header, "its sform or qform is not finite");
      }
    }
  }
  RequireBytes(data,
               path == data ? fileSize : GetSize(data),
               static_cast<double>(image->iname_offset) +
                 static_cast<double>(image->nvox) * static_cast<double>(image->nbyper));
}

/** Throws unless the values of points of a legacy VTK file are all there. */
void
RequireIntactVTK(const fs::path & path, const itk::ImageIOBase & io)
{
  std::ifstream file(path, std::ios::binary);
  std::string   words[2];
  const auto    readLine = [&] {
    std::string line;
    while (std::getline(file, line) && Trim(line).empty())
    {
    }
    std::istringstream stream(ToLower(line));
    words[0] = words[1] = "";
    stream >> words[0] >> words[1];
    return !line.empty();
  };
  bool isOfPoints = false;
  bool isReached = false;
  for (int lines = 0; !isReached && readLine(); ++lines)
  {
    isOfPoints = isOfPoints || words[0] == "point_data";
    isReached = lines > 3 && (words[0] == "scalars" || words[0] == "vectors" || words[0] == "color_scalars");
    const bool isKnown = lines < 4 || isReached || words[0] == "dimensions" || words[0] == "spacing" ||
                         words[0] == "aspect_ratio" || words[0] == "origin" || words[0] == "point_data";
    if (!isKnown)
    {
      throw std::runtime_error("'" + path.string() + "' cannot be read: its header has '" + words[0] +
                               "', where SCALARS or VECTORS of POINT_DATA are needed");
    }
  }
  if (!isReached || !isOfPoints)
  {
    Refuse(path, "it has no values of points");
  }
  const std::streamoff begin = file.tellg();
  if (words[0] == "vectors" || !readLine() || words[0] != "lookup_table")
  {
    file.clear();
    file.seekg(begin);
  }
  if (io.GetFileType() != itk::IOFileEnum::ASCII)
  {
    RequireBytes(
      path, fs::file_size(path), static_cast<double>(file.tellg()) + static_cast<double>(io.GetImageSizeInBytes()));
    return;
  }
  double value = 0.0;
  for (itk::ImageIOBase::SizeType n = 0; n < io.GetImageSizeInComponents(); ++n)
  {
    if (!(file >> value))
    {
      Refuse(path,
             "value " + std::to_string(n + 1) + " of " + std::to_string(io.GetImageSizeInComponents()) +
               " is missing or no number");
    }
  }
}

/** Throws if the files of a NRRD or MetaImage are too small for \a bytes of voxels. */
void
RequireBytesInFiles(const fs::path & path, const itk::ImageIOBase & io, double bytes)
{
  std::streamoff                     end = 0;
  std::map<std::string, std::string> fields;
  for (const auto & [key, text] : ReadFields(path, &end))
  {
    fields[ToLower(key)] = ToLower(text);
  }
  const bool isMeta = io.GetNameOfClass() == std::string("MetaImageIO");
  const auto begins = [&fields](const std::string & key, const std::string & letters) {
    return letters.find(fields[key].substr(0, 1)) != std::string::npos && !fields[key].empty();
  };
  const bool isCompressed = isMeta ? begins("compresseddata", "t1") : begins("encoding", "gb");
  const bool isText = isMeta ? begins("binarydata", "f0") : begins("encoding", "at");
  const bool isLocal =
    isMeta ? fields["elementdatafile"] == "local" : fields.count("data file") + fields.count("datafile") == 0;
  std::uintmax_t size = 0;
  for (const fs::path & file : isLocal ? std::vector<fs::path>{ path } : FindInputFiles(path))
  {
    size += fs::file_size(file);
  }
  if (isLocal && end > 0)
  {
    size -= static_cast<std::uintmax_t>(end);
  }
  constexpr double mostOfDeflate = 1032.0;
  RequireBytes(path, size, bytes / (isCompressed ? mostOfDeflate : isText ? io.GetComponentSize() : 1.0));
}

/** What is printed to std::cerr. */
class PrintedErrors
{
public:
  PrintedErrors()
    : m_Previous(std::cerr.rdbuf(m_Text.rdbuf()))
  {}
  ~PrintedErrors() { std::cerr.rdbuf(m_Previous); }
  PrintedErrors(const PrintedErrors &) = delete;
  PrintedErrors &
  operator=(const PrintedErrors &) = delete;

  std::string
  GetText() const
  {
    return m_Text.str();
  }

private:
  std::ostringstream m_Text;
  std::streambuf *   m_Previous;
};
} // namespace

void
ReadIntact(const fs::path & path, const std::function<void()> & read)
{
  const std::string start = ReadStart(path, 64);
  const bool        isMeta = path.extension() == ".mha" || path.extension() == ".mhd";
  const Parsing     parsing(path, DescribeDamage(path, "it ended the library that reads it"));
  nifti_set_debug_level(0);
  if (isMeta || start.substr(0, 4) == "NRRD")
  {
    RequireIntactCompression(path);
  }
  else
  {
    const std::uintmax_t size = GetSize(path);
    if (is_nifti_file(path.c_str()) >= 0)
    {
      RequireIntactNIfTI(path, size);
    }
  }

  const PrintedErrors errors;
  const auto          requireNoErrors = [&] {
    if (isMeta && !errors.GetText().empty())
    {
      Refuse(path, errors.GetText());
    }
  };
  try
  {
    read();
  }
  catch (const itk::ExceptionObject & error)
  {
    // MetaIO says more than ITK
    requireNoErrors();
    const std::string text = error.GetDescription();
    const auto        last = text.rfind("[nrrd] ");
    if (last != std::string::npos)
    {
      // behind the names of functions
      Refuse(path, text.substr(text.find(": ", last) + 2));
    }
    throw std::runtime_error("cannot read '" + path.string() + "': " + text);
  }
  requireNoErrors();
}

void
RequireAllVoxels(const itk::ImageIOBase & io, const fs::path & path)
{
  constexpr double  headerOfGIPL = 256.0;
  const std::string format = io.GetNameOfClass();
  // ITK's own product may overflow
  double bytes = static_cast<double>(io.GetComponentSize()) * io.GetNumberOfComponents();
  for (unsigned int axis = 0; axis < io.GetNumberOfDimensions(); ++axis)
  {
    bytes *= static_cast<double>(io.GetDimensions(axis));
  }
  if (format == "NrrdImageIO" || format == "MetaImageIO")
  {
    RequireBytesInFiles(path, io, bytes);
  }
  else if (format == "VTKImageIO")
  {
    RequireIntactVTK(path, io);
  }
  else if (format == "GiplImageIO")
  {
    RequireBytes(path, GetSize(path), headerOfGIPL + bytes);
  }
  else if (format == "MRCImageIO")
  {
    itk::MRCHeaderObject::ConstPointer header;
    itk::ExposeMetaData(io.GetMetaDataDictionary(), "MRCHeader", header);
    RequireBytes(
      path, GetSize(path), static_cast<double>(header->GetHeaderSize() + header->GetExtendedHeaderSize()) + bytes);
  }
}
