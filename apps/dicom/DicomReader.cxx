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
#include "DicomReader.h"
#include "DicomAttribute.h"
#include "DicomKind.h"
#include "FileStart.h"
#include "Guard.h"
#include "Integrity.h"

#include <gdcmFileMetaInformation.h>
#include <gdcmPreamble.h>
#include <gdcmTransferSyntax.h>

#include <fstream>
#include <stdexcept>

namespace
{
namespace fs = std::filesystem;

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
         GetInflatedSize(path, file.tellg(), DeflateFormat::Raw) > 0;
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
  // what is compressed has no length of its own
  const gdcm::ByteValue * const bytes = image.GetDataElement().GetByteValue();
  if (bytes && image.GetPixelFormat() == gdcm::PixelFormat::SINGLEBIT)
  {
    const auto pixels = image.GetDimension(0) * 1.0 * image.GetDimension(1) *
                        (image.GetNumberOfDimensions() > 2 ? image.GetDimension(2) : 1);
    return 8.0 * bytes->GetLength() >= pixels;
  }
  const bool isReduced = image.GetPhotometricInterpretation() == gdcm::PhotometricInterpretation::YBR_FULL_422;
  return !bytes || (isReduced ? 3.0 : 2.0) * bytes->GetLength() >= 2.0 * static_cast<double>(image.GetBufferLength());
}

/** The header, as far as it is parsed to its end. */
std::optional<gdcm::DataSet>
ParseHeader(const std::string & path)
try
{
  const bool   isDeflated = IsDeflated(path);
  WatchedFile  file(path);
  std::istream stream(&file);
  auto         header = FindHeader(stream);
  const bool   isWhole = header && (isDeflated || !file.IsTooShort());
  // an image without a series may lack more that followed
  const bool isSound = isWhole && (!IsImage(*header) || header->FindDataElement(gdcm::Tag(0x0020, 0x000e)) ||
                                   header->FindDataElement(gdcm::Tag(0x0028, 0x0100)));
  return isSound ? header : std::nullopt;
}
catch (const std::exception &)
{
  return {};
}
} // namespace

std::string
DescribeDicomDamage(const std::string & path, const std::string & reason)
{
  const std::string syntax = ReadTransferSyntax(path);
  if (!syntax.empty() && gdcm::TransferSyntax::GetTSType(syntax.c_str()) == gdcm::TransferSyntax::TS_END)
  {
    return "'" + path + "' has a compression that GDCM does not read, transfer syntax " + syntax +
           "; decompress the images first";
  }
  return DescribeDamage(path, reason);
}

std::optional<gdcm::DataSet>
ReadSoundHeader(const std::string & path)
{
  std::optional<gdcm::DataSet> header;
  if (!HasEndedParsing(path))
  {
    const Parsing parsing(path);
    header = ParseHeader(path);
  }
  if (!header && HasPreamble(path))
  {
    throw std::runtime_error(DescribeDicomDamage(
      path, "its header cannot be parsed, so it may be a slice of any series; copy it again or remove it"));
  }
  return header;
}

bool
DicomReader::Read()
{
  if (gdcm::ImageReader::Read())
  {
    return true;
  }
  gdcm::File &    file = this->GetFile();
  const gdcm::Tag sopClass(0x0008, 0x0016);
  if (GetText(file.GetDataSet(), sopClass) != "1.2.840.10008.5.1.4.1.1.66.7")
  {
    return false;
  }
  const std::string segmentation = "1.2.840.10008.5.1.4.1.1.66.4";
  SetText(file.GetDataSet(), sopClass, segmentation);
  SetText(file.GetHeader(), { 0x0002, 0x0002 }, segmentation);
  this->GetImage().SetTransferSyntax(file.GetHeader().GetDataSetTransferSyntax());
  return this->ReadImage(gdcm::MediaStorage::SegmentationStorage);
}

bool
DicomReader::ReadWhole(const std::string & path)
{
  const std::string refusal = DescribeDicomDamage(path, "its DICOM data cannot be parsed to the end");
  const Parsing     parsing(path, refusal);
  bool              isImage = false;
  bool              isSound = false;
  try
  {
    const bool   isDeflated = IsDeflated(path);
    WatchedFile  file(path);
    std::istream stream(&file);
    this->SetStream(stream);
    isImage = this->Read();
    if (!isImage && !LooksLikeDicom(path))
    {
      return false;
    }
    const gdcm::DataSet & dataSet = this->GetFile().GetDataSet();
    const bool            hasPixels = dataSet.FindDataElement(gdcm::Tag(0x7fe0, 0x0010));
    isSound = (isDeflated || !file.IsTooShort()) && !dataSet.IsEmpty() &&
              (isImage ? HasAllPixels(this->GetImage()) : !hasPixels);
  }
  catch (const std::exception &)
  {
    isSound = false;
  }
  if (!isSound)
  {
    throw std::runtime_error(refusal);
  }
  if (!isImage && IsImage(this->GetFile().GetDataSet()))
  {
    throw std::runtime_error("'" + path +
                             "' is damaged or incomplete, or an image of floats: it has no pixels of integers");
  }
  return isImage;
}

bool
IsLabelMap(const gdcm::DataSet & header)
{
  return GetText(header, { 0x0062, 0x0001 }) == "LABELMAP";
}
