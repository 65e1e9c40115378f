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

#include "DicomAttribute.h"
#include "DicomKind.h"
#include "DicomReader.h"
#include "FileStart.h"
#include "Posix.h"
#include "Process.h"
#include "Text.h"
#include "TransformRecords.h"

#include "itkMRCHeaderObject.h"
#include "itkMacro.h"
#include "itkMetaDataObject.h"
#include "itk_zlib.h"

#include "itksys/SystemTools.hxx"

#include <gdcmFileMetaInformation.h>
#include <gdcmPreamble.h>
#include <gdcmTransferSyntax.h>
#include <nifti1_io.h>

#ifdef ShearWarpMIP_HAS_POSIX
#  include <unistd.h>
#endif

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <iterator>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <system_error>

namespace fs = std::filesystem;

void
Refuse(const fs::path & path, const std::string & reason)
{
  throw std::runtime_error("'" + path.string() + "' is damaged or incomplete: " + reason);
}

namespace
{
constexpr int gzipOrZlib = MAX_WBITS + 32;
constexpr int rawDeflate = -MAX_WBITS;

/** The bytes that the stream from \a offset on inflates to. */
std::uintmax_t
GetInflatedSize(const fs::path & path, std::streamoff offset = 0, int format = gzipOrZlib)
{
  std::ifstream              file(path, std::ios::binary);
  std::vector<unsigned char> input(1 << 16);
  std::vector<unsigned char> output(1 << 18);
  z_stream                   stream{};
  inflateInit2(&stream, format);
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
    if (status == Z_STREAM_END && format == gzipOrZlib && (stream.avail_in > 0 ? *stream.next_in : file.peek()) == 0x1f)
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
  return ReadStart(path, 2) == "\x1f\x8b" ? GetInflatedSize(path) : fs::file_size(path);
}

/** Checks the compressed data of NRRD and MetaImage. */
void
RequireIntactCompression(const fs::path & path)
{
  std::streamoff end = 0;
  auto           fields = ReadFields(path, &end);

  const bool isMeta = fields.count("ElementDataFile") > 0;
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
  return path.extension() == ".dcm" || HasPreamble(path);
}

/** Whether it is DICOM with a deflated data set. Throws if that is damaged: GDCM may never come to its end. */
bool
IsDeflated(const fs::path & path)
{
  std::ifstream             file(path, std::ios::binary);
  gdcm::Preamble            preamble;
  gdcm::FileMetaInformation header;
  try
  {
    if (!HasPreamble(path) || !preamble.Read(file) || !header.Read(file))
    {
      return false;
    }
  }
  catch (const std::exception &)
  {
    return false;
  }
  return header.GetDataSetTransferSyntax() == gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian &&
         GetInflatedSize(path, file.tellg(), rawDeflate) > 0;
}

/** As it is in the file's meta information (PS3.10 7.1), empty if that has none. */
std::string
ReadTransferSyntax(const fs::path & path)
{
  using namespace std::string_literals;
  const std::string start = HasPreamble(path) ? ReadStart(path, 1 << 12) : "";
  const auto        element = start.find("\x02\0\x10\0UI"s);
  constexpr int     headerLength = 8;
  if (element == std::string::npos || element + headerLength > start.size())
  {
    return "";
  }
  const auto        length = static_cast<unsigned char>(start[element + 6]);
  const std::string uid = start.substr(element + headerLength, length);
  return uid.substr(0, uid.find('\0'));
}

/** Of pixels that are missing GDCM would make any values. */
bool
HasAllPixels(const gdcm::Image & image)
{
  // colours may be stored with fewer samples, and what is compressed has no length of its own
  const gdcm::ByteValue * const bytes = image.GetDataElement().GetByteValue();
  if (bytes && image.GetPixelFormat() == gdcm::PixelFormat::SINGLEBIT)
  {
    const auto pixels = image.GetDimension(0) * 1.0 * image.GetDimension(1) *
                        (image.GetNumberOfDimensions() > 2 ? image.GetDimension(2) : 1);
    return 8.0 * bytes->GetLength() >= pixels;
  }
  return image.GetPixelFormat().GetSamplesPerPixel() != 1 || !bytes || bytes->GetLength() >= image.GetBufferLength();
}

bool
HasSoundHeader(const std::string & path)
try
{
  const bool   isDeflated = IsDeflated(path);
  WatchedFile  file(path);
  std::istream stream(&file);
  const auto   header = FindHeader(stream);
  const bool   isWhole = header && (isDeflated || !file.IsTooShort());
  // an image without a series may lack more that followed
  return isWhole && (!IsImage(*header) || header->FindDataElement(gdcm::Tag(0x0020, 0x000e)) ||
                     header->FindDataElement(gdcm::Tag(0x0028, 0x0100)));
}
catch (const std::exception &)
{
  return false;
}

Soundness
CheckImage(const std::string & path)
try
{
  const bool   isDeflated = IsDeflated(path);
  WatchedFile  file(path);
  std::istream stream(&file);
  DicomReader  reader;
  reader.SetStream(stream);
  const bool isImage = reader.Read();
  const bool isWhole = isDeflated || !file.IsTooShort();
  if (!isImage && !LooksLikeDICOM(path))
  {
    return Soundness::Sound;
  }
  const gdcm::DataSet & dataSet = reader.GetFile().GetDataSet();
  if (!isWhole || dataSet.IsEmpty() || (isImage && !HasAllPixels(reader.GetImage())))
  {
    return Soundness::Damaged;
  }
  if (!isImage && dataSet.FindDataElement(gdcm::Tag(0x7fe0, 0x0010)))
  {
    return Soundness::Damaged;
  }
  return isImage || !IsImage(dataSet) ? Soundness::Sound : Soundness::WithoutPixels;
}
catch (const std::exception &)
{
  return Soundness::Damaged;
}

using Files = std::vector<std::string>;

/** What the program is asked by its first argument, and the files follow. */
const std::map<FileKind, std::string> questions = { { FileKind::DicomHeader, "--have-dicom-headers" },
                                                    { FileKind::DicomImage, "--are-intact-dicom" },
                                                    { FileKind::Transform, "--are-readable-transforms" } };

Soundness
Answer(FileKind kind, const std::string & file)
{
  if (kind == FileKind::DicomImage)
  {
    return CheckImage(file);
  }
  const bool isSound = kind == FileKind::DicomHeader ? HasSoundHeader(file) : IsReadableTransform(file);
  return isSound ? Soundness::Sound : Soundness::Damaged;
}

/** The program itself, if main() called ParseIfAsked. */
std::string program;

/** The answers for so few files that they fit into a command, up to the first that ends the process. GDCM may have
 * assertions, as Debian's has, which damaged files break, and HDF5 does not survive each: the program itself parses in
 * a process of its own. */
std::string
Ask(FileKind kind, Files::const_iterator begin, Files::const_iterator end)
{
  if (program.empty())
  {
    std::string said;
    std::transform(begin, end, std::back_inserter(said), [kind](const std::string & file) {
      return static_cast<char>(Answer(kind, file));
    });
    return said;
  }
  Files command{ program, questions.at(kind) };
  command.insert(command.end(), begin, end);
  return RunProcess(command, false).said;
}

[[noreturn]] void
RefuseDicom(const std::string & path, const std::string & reason)
{
  const std::string syntax = ReadTransferSyntax(path);
  if (!syntax.empty() && gdcm::TransferSyntax::GetTSType(syntax.c_str()) == gdcm::TransferSyntax::TS_END)
  {
    throw std::runtime_error("'" + path + "' has a compression that GDCM does not read, transfer syntax " + syntax +
                             "; decompress the images first");
  }
  Refuse(path, reason);
}

/** Has the process end if it takes longer to parse a file than any disk does. */
void
LimitTime([[maybe_unused]] const fs::path & file)
{
#ifdef ShearWarpMIP_HAS_POSIX
  std::error_code error;
  const auto      size = fs::file_size(file, error);
  std::signal(SIGALRM, SIG_DFL);
  alarm(60 + (error ? 0 : static_cast<unsigned int>(size >> 20)));
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

bool
ParseIfAsked(int argc, const char * const * argv, std::ostream & output)
{
  for (const auto & [kind, question] : questions)
  {
    if (argc > 1 && argv[1] == question)
    {
      // no core is dumped
      std::signal(SIGABRT, [](int) { std::_Exit(EXIT_FAILURE); });
      for (int n = 2; n < argc; ++n)
      {
        LimitTime(argv[n]);
        output.put(static_cast<char>(Answer(kind, argv[n]))).flush();
      }
      return true;
    }
  }
#ifdef ShearWarpMIP_HAS_POSIX
  std::error_code    noSuchFile;
  const char * const itself = "/proc/self/exe";
  program = fs::read_symlink(itself, noSuchFile).string();
  if (!program.empty() && !fs::exists(program, noSuchFile))
  {
    program = itself; // removed or replaced since
  }
  if (program.empty())
  {
    program = itksys::SystemTools::FindProgram(argv[0]);
  }
#endif
  return false;
}

std::vector<Soundness>
Check(FileKind kind, const Files & files)
{
  // every system takes that many bytes of arguments
  constexpr std::size_t  most = 30000;
  std::vector<Soundness> answers;
  for (auto begin = files.begin(); begin != files.end();)
  {
    std::size_t       bytes = 0;
    const auto        end = std::find_if(begin + 1, files.end(), [&bytes](const std::string & file) {
      bytes += file.size() + 1;
      return bytes > most;
    });
    const std::string said = Ask(kind, begin, end);
    std::transform(
      said.begin(), said.end(), std::back_inserter(answers), [](char answer) { return Soundness{ answer }; });
    begin += static_cast<std::ptrdiff_t>(said.size());
    if (begin != end)
    {
      answers.push_back(Soundness::Damaged);
      ++begin;
    }
  }
  return answers;
}

std::vector<bool>
HaveDicomHeaders(const Files & files)
{
  std::vector<bool> have;
  for (const Soundness soundness : Check(FileKind::DicomHeader, files))
  {
    const std::string & file = files[have.size()];
    have.push_back(soundness == Soundness::Sound);
    if (!have.back() && HasPreamble(file))
    {
      RefuseDicom(file, "its header cannot be parsed, so it may be a slice of any series; copy it again or remove it");
    }
  }
  return have;
}

void
RequireIntactDICOM(const Files & files)
{
  const auto answers = Check(FileKind::DicomImage, files);
  for (std::size_t n = 0; n < files.size(); ++n)
  {
    if (answers[n] != Soundness::Sound)
    {
      if (answers[n] == Soundness::WithoutPixels)
      {
        throw std::runtime_error(
          "'" + files[n] + "' is damaged or incomplete, or an image of floats: it has no pixels " + "of integers");
      }
      RefuseDicom(files[n], "its DICOM data cannot be parsed to the end");
    }
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

void
RequireAllVoxels(const itk::ImageIOBase & io, const fs::path & path)
{
  constexpr double  headerOfGIPL = 256.0;
  const std::string format = io.GetNameOfClass();
  const auto        bytes = static_cast<double>(io.GetImageSizeInBytes());
  if (format == "VTKImageIO")
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
