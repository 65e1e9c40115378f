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

#include "Text.h"

#include "itkMacro.h"
#include "itk_zlib.h"

#include <gdcmImageReader.h>
#include <gdcmMediaStorage.h>
#include <nifti1_io.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <system_error>

#if __has_include(<sys/wait.h>)
#  include <sys/wait.h>
#  include <unistd.h>
#endif

namespace
{
namespace fs = std::filesystem;

[[noreturn]] void
Refuse(const fs::path & path, const std::string & reason)
{
  throw std::runtime_error("'" + path.string() + "' is damaged or incomplete: " + reason);
}

std::string
ReadStart(const fs::path & path, std::size_t count)
{
  std::string   start(count, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(start.data(), static_cast<std::streamsize>(count));
  start.resize(static_cast<std::size_t>(file.gcount()));
  return start;
}

/** The bytes that the gzip or zlib stream from \a offset on inflates to. */
std::uintmax_t
GetInflatedSize(const fs::path & path, std::streamoff offset)
{
  std::ifstream              file(path, std::ios::binary);
  std::vector<unsigned char> input(1 << 16);
  std::vector<unsigned char> output(1 << 18);
  z_stream                   stream{};
  inflateInit2(&stream, 15 + 32);
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
    if (status == Z_STREAM_END && (stream.avail_in > 0 ? *stream.next_in : file.peek()) == 0x1f)
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

std::uintmax_t
GetSize(const fs::path & path)
{
  return ReadStart(path, 2) == "\x1f\x8b" ? GetInflatedSize(path, 0) : fs::file_size(path);
}

/** Checks the compressed data of NRRD and MetaImage. */
void
RequireIntactCompression(const fs::path & path)
{
  std::ifstream                      file(path, std::ios::binary);
  std::map<std::string, std::string> fields;
  for (std::string line; fields.count("ElementDataFile") == 0 && std::getline(file, line) && !Trim(line).empty();)
  {
    const auto separator = line.find_first_of(":=");
    if (separator != std::string::npos)
    {
      fields[Trim(line.substr(0, separator))] = Trim(line.substr(separator + 1));
    }
  }

  const bool isMeta = fields.count("ElementDataFile") > 0;
  const bool isCompressed = isMeta ? fields["CompressedData"].find_first_of("Tt1") == 0
                                   : fields["encoding"] == "gzip" || fields["encoding"] == "gz";
  if (isCompressed && fields.count("line skip") == 0)
  {
    const std::string name = isMeta ? fields["ElementDataFile"] : fields["data file"] + fields["datafile"];
    const fs::path    dataPath = path.parent_path() / name;
    if (name.empty() || name == "LOCAL")
    {
      GetInflatedSize(path, file.tellg());
    }
    else if (fs::exists(dataPath))
    {
      GetInflatedSize(dataPath, 0);
    }
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
  const auto needed =
    static_cast<double>(image->iname_offset) + static_cast<double>(image->nvox) * static_cast<double>(image->nbyper);
  const auto size = static_cast<double>(path == image->iname ? fileSize : GetSize(image->iname));
  if (size < needed)
  {
    std::ostringstream reason;
    reason << std::fixed << std::setprecision(0) << "it has " << size << " of " << needed << " bytes";
    Refuse(image->iname, reason.str());
  }
}

/** Notices if more is read than there is. */
class WatchedFile : public std::filebuf
{
public:
  explicit WatchedFile(const std::string & path) { this->open(path, std::ios::in | std::ios::binary); }

  bool
  IsTooShort() const
  {
    return m_IsTooShort;
  }

protected:
  std::streamsize
  xsgetn(char * buffer, std::streamsize count) override
  {
    constexpr std::streamsize tagSize = 4;
    const std::streamsize     got = std::filebuf::xsgetn(buffer, count);
    m_IsTooShort = m_IsTooShort || (got < count && (got > 0 || count > tagSize));
    return got;
  }

private:
  bool m_IsTooShort{ false };
};

bool
LooksLikeDICOM(const fs::path & path)
{
  const std::string start = ReadStart(path, 132);
  return path.extension() == ".dcm" || (start.size() == 132 && start.substr(128) == "DICM");
}

bool
IsIntactDICOM(const std::string & path)
{
  WatchedFile       file(path);
  std::istream      stream(&file);
  gdcm::ImageReader reader;
  reader.SetStream(stream);
  const bool isImage = reader.Read();
  if (isImage || !LooksLikeDICOM(path))
  {
    return !isImage || !file.IsTooShort();
  }
  gdcm::MediaStorage storage;
  storage.SetFromFile(reader.GetFile());
  return !file.IsTooShort() && !gdcm::MediaStorage::IsImage(storage);
}

/** The number of files before the first that is not intact. */
std::size_t
CountIntactDICOM(const std::vector<std::string> & files)
{
#if __has_include(<sys/wait.h>)
  // in a process of its own: GDCM may have assertions, as Debian's has, which damaged files break
  int   ends[2];
  pid_t child = 0;
  if (pipe(ends) != 0 || (child = fork()) < 0)
  {
    throw std::system_error(errno, std::generic_category());
  }
  if (child == 0)
  {
    if (!std::freopen("/dev/null", "w", stderr))
    {
      _exit(EXIT_FAILURE);
    }
    const bool done = std::all_of(files.begin(), files.end(), [&ends](const std::string & file) {
      return IsIntactDICOM(file) && write(ends[1], "", 1) == 1;
    });
    _exit(done ? EXIT_SUCCESS : EXIT_FAILURE);
  }
  close(ends[1]);
  std::size_t count = 0;
  for (char byte; read(ends[0], &byte, 1) == 1;)
  {
    ++count;
  }
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return count;
#else
  return std::find_if_not(files.begin(), files.end(), IsIntactDICOM) - files.begin();
#endif
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
RequireIntactDICOM(const std::vector<std::string> & files)
{
  const std::size_t count = CountIntactDICOM(files);
  if (count < files.size())
  {
    Refuse(files[count], "its DICOM data cannot be parsed to the end");
  }
}

void
ReadIntact(const fs::path & path, const std::function<void()> & read)
{
  const std::string start = ReadStart(path, 64);
  const bool        isMeta = path.extension() == ".mha" || path.extension() == ".mhd";
  nifti_set_debug_level(0);
  if (LooksLikeDICOM(path))
  {
    RequireIntactDICOM({ path.string() });
  }
  else if (isMeta || start.substr(0, 4) == "NRRD")
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
  catch (const itk::ExceptionObject &)
  {
    // MetaIO says more than ITK
    requireNoErrors();
    throw;
  }
  requireNoErrors();
}
