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
#include "DicomSlices.h"
#include "DicomAttribute.h"
#include "DicomReader.h"
#include "Guard.h"

#include "itkGDCMImageIO.h"

#include <gdcmAttribute.h>
#include <gdcmImageHelper.h>
#include <gdcmJPEG2000Codec.h>
#include <gdcmJPEGCodec.h>
#include <gdcmJPEGLSCodec.h>
#include <gdcmRLECodec.h>
#include <gdcmRescaler.h>
#include <gdcmSequenceOfFragments.h>
#include <gdcmSequenceOfItems.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace
{
using gdcm::DataSet;
using gdcm::Tag;
using VectorType = itk::Vector<double, 3>;
using Component = itk::IOComponentEnum;

std::string
DescribeUndecoded(const Source & source)
{
  return source.image->GetTransferSyntax().IsEncapsulated()
           ? "cannot decode the pixels of '" + source.path + "'; decompress the images first"
           : DescribeDicomDamage(source.path, "its pixels are not what its attributes say");
}

Component
GetComponentType(gdcm::PixelFormat::ScalarType type)
{
  switch (type)
  {
    case gdcm::PixelFormat::UINT8:
      return Component::UCHAR;
    case gdcm::PixelFormat::INT8:
      return Component::CHAR;
    case gdcm::PixelFormat::UINT16:
      return Component::USHORT;
    case gdcm::PixelFormat::INT16:
      return Component::SHORT;
    case gdcm::PixelFormat::UINT32:
      return Component::UINT;
    case gdcm::PixelFormat::INT32:
      return Component::INT;
    case gdcm::PixelFormat::FLOAT32:
      return Component::FLOAT;
    case gdcm::PixelFormat::FLOAT64:
      return Component::DOUBLE;
    default:
      return Component::UNKNOWNCOMPONENTTYPE;
  }
}

/** Throws if attributes of PS3.3 C.7.6.3 are missing or contradict each other: GDCM would take pixels for what they are
 * not, or abort. */
void
RequirePixelFormat(const Source & source)
{
  gdcm::Attribute<0x0028, 0x0101> stored;
  stored.SetValue(source.format.GetBitsAllocated());
  stored.SetFromDataSet(source.header);
  if (source.storedType == Component::UNKNOWNCOMPONENTTYPE || stored.GetValue() > source.format.GetBitsAllocated() ||
      !source.header.FindDataElement(Tag(0x0028, 0x0103)))
  {
    throw std::runtime_error("'" + source.path + "' has no valid pixels: its Bits Allocated, Bits Stored or Pixel " +
                             "Representation are missing or impossible");
  }
}

/** Some programs put the low half of 32 bits first (DCMTK, GDCM), others the high half (pydicom). */
void
RequireOneByteOrder(const Source & source, const gdcm::TransferSyntax & syntax)
{
  if (source.format.GetBitsAllocated() > 16 && (syntax == gdcm::TransferSyntax::ExplicitVRBigEndian ||
                                                syntax == gdcm::TransferSyntax::ImplicitVRBigEndianPrivateGE))
  {
    throw std::runtime_error("'" + source.path + "' has pixels of " + std::to_string(source.format.GetBitsAllocated()) +
                             " bits in big endian, whose byte order differs between programs; export the images in " +
                             "little endian");
  }
}

/** As "12 signed bits, 1 sample, 64 x 48". */
std::string
DescribePixels(const gdcm::PixelFormat & format, const unsigned int * size)
{
  const bool isSigned = format.GetPixelRepresentation() == 1;
  const auto samples = format.GetSamplesPerPixel();
  return std::to_string(format.GetBitsStored()) + (isSigned ? " signed bits, " : " bits, ") + std::to_string(samples) +
         (samples == 1 ? " sample, " : " samples, ") + std::to_string(size[0]) + " x " + std::to_string(size[1]);
}

[[noreturn]] void
RefuseStream(const Source &            source,
             const gdcm::PixelFormat & stream,
             const unsigned int *      size,
             const std::string &       reason = "")
{
  throw std::runtime_error("'" + source.path + "' has compressed pixels of " + DescribePixels(stream, size) +
                           ", but its attributes say " + DescribePixels(source.format, source.size.data()) + reason +
                           "; export the images without compression");
}

/** Of a number that a codec delivers. */
unsigned short
GetBytes(const gdcm::PixelFormat & stream)
{
  return stream.GetBitsStored() <= 8 ? 1 : stream.GetBitsStored() <= 16 ? 2 : 4;
}

/** What compressed streams say of their pixels. Throws if that is not possible with the attributes of \a source. */
std::vector<gdcm::PixelFormat>
ReadStreams(const Source & source, const gdcm::Image & image)
{
  gdcm::JPEGCodec          jpeg;
  gdcm::JPEGLSCodec        jpegLS;
  gdcm::JPEG2000Codec      jpeg2000;
  gdcm::RLECodec           rle;
  gdcm::ImageCodec * const codecs[] = { &jpeg, &jpegLS, &jpeg2000, &rle };
  const auto               found = std::find_if(std::begin(codecs), std::end(codecs), [&image](const auto * codec) {
    return codec->CanDecode(image.GetTransferSyntax());
  });
  const auto * const       fragments = image.GetDataElement().GetSequenceOfFragments();
  if (found == std::end(codecs) || !fragments || fragments->GetNumberOfFragments() == 0)
  {
    return {};
  }
  gdcm::ImageCodec &             codec = **found;
  const gdcm::PixelFormat &      format = source.format;
  const bool                     isEachFrame = fragments->GetNumberOfFragments() == source.size[2];
  std::vector<gdcm::PixelFormat> streams;
  for (std::size_t n = 0; n < (isEachFrame ? source.size[2] : 1); ++n)
  {
    // a stream may be in several fragments
    std::string bytes;
    for (std::size_t part = n; part < (isEachFrame ? n + 1 : fragments->GetNumberOfFragments()); ++part)
    {
      const gdcm::ByteValue * const value = fragments->GetFragment(part).GetByteValue();
      bytes.append(value ? value->GetPointer() : "", value ? std::size_t{ value->GetLength() } : 0);
    }
    std::istringstream   fragment(bytes);
    gdcm::TransferSyntax syntax;
    codec.SetPixelFormat(image.GetPixelFormat());
    if (!codec.GetHeaderInfo(fragment, syntax))
    {
      throw std::runtime_error(DescribeUndecoded(source));
    }
    gdcm::PixelFormat stream = codec.GetPixelFormat();
    if (&codec == &rle)
    {
      // bytes, whose meaning the attributes alone say
      if (stream.GetBitsAllocated() * stream.GetSamplesPerPixel() !=
          format.GetBitsAllocated() * format.GetSamplesPerPixel())
      {
        RefuseStream(source, stream, source.size.data());
      }
      if (format.GetBitsAllocated() > 8 && format.GetSamplesPerPixel() > 1)
      {
        throw std::runtime_error("'" + source.path + "' has colours of more than 8 bits, compressed by RLE, which " +
                                 "GDCM mixes up; export the images without compression");
      }
      continue;
    }
    if (&codec != &jpeg2000)
    {
      stream.SetPixelRepresentation(0);
    }
    streams.push_back(stream);
    const unsigned int * const size = codec.GetDimensions();
    const unsigned int         bits = 8 * GetBytes(stream);
    // ITK decodes colours, and takes their type from the attributes
    const bool isLike = source.isConverted ? bits == format.GetBitsAllocated() &&
                                               stream.GetPixelRepresentation() == format.GetPixelRepresentation()
                                           : bits <= format.GetBitsAllocated();
    if (!isLike || size[0] != source.size[0] || size[1] != source.size[1] ||
        stream.GetSamplesPerPixel() != format.GetSamplesPerPixel() || bits != 8u * GetBytes(streams.front()))
    {
      RefuseStream(source, stream, size);
    }
  }
  return streams;
}

/** The last \a bits of a number, with or without a sign. */
std::int64_t
TakeBits(std::int64_t number, int bits, bool isSigned)
{
  const auto range = std::int64_t{ 1 } << bits;
  number &= range - 1;
  return isSigned && number >= range / 2 ? number - range : number;
}

/** The numbers that a codec delivers, as the attributes say: streams have bits, which have a sign or not. Throws if a
 * number does not fit into the stored bits, or if a stream has fewer bits and another sign. */
template <typename TDecoded>
std::vector<char>
Interpret(const Source & source, const std::vector<char> & decoded)
{
  const int          bits = source.format.GetBitsStored();
  const bool         isSigned = source.format.GetPixelRepresentation() == 1;
  const auto         range = std::int64_t{ 1 } << bits;
  const std::int64_t lowest = isSigned ? -range / 2 : 0;
  const std::size_t  frames = source.size[2];
  const std::size_t  count = decoded.size() / sizeof(TDecoded) / frames;
  std::vector<char>  stored;
  DispatchPixelType(source.storedType, [&](auto tag) {
    using StoredType = typename decltype(tag)::Type;
    stored.resize(frames * count * sizeof(StoredType));
    const auto * from = reinterpret_cast<const TDecoded *>(decoded.data());
    auto *       to = reinterpret_cast<StoredType *>(stored.data());
    for (std::size_t frame = 0; frame < frames; ++frame)
    {
      const gdcm::PixelFormat & stream = source.streams[std::min(frame, source.streams.size() - 1)];
      const int                 streamBits = stream.GetBitsStored();
      const bool                isStreamSigned = stream.GetPixelRepresentation() == 1;
      const bool                isEither = streamBits < bits && isStreamSigned != isSigned;
      for (std::size_t n = 0; n < count; ++n, ++from, ++to)
      {
        auto value = TakeBits(*from, streamBits, isSigned);
        // a sign that is stored without the bits before it
        value -= isSigned && !isStreamSigned && value >= -lowest ? range : 0;
        if (value < lowest || value >= lowest + range || (isEither && (*from >> (streamBits - 1) & 1)))
        {
          const auto number = TakeBits(*from, streamBits, isStreamSigned);
          RefuseStream(source,
                       stream,
                       source.size.data(),
                       ", and the value of the number " + std::to_string(number) + " is not clear");
        }
        *to = static_cast<StoredType>(value);
      }
    }
  });
  return stored;
}

/** What a frame is away from the position that all of a file have, in dose and nuclear medicine (PS3.3 C.8.8.3.2 and
 * C.8.4.15). */
VectorType
GetFrameOffset(const DataSet & header, const Slice & slice, std::size_t frames, const VectorType & normal)
{
  const std::size_t frame = slice.frame;
  const auto        offsets = ParseNumbers(GetText(header, { 0x3004, 0x000c }));
  if (offsets.size() == frames)
  {
    VectorType superior(0.0);
    superior[2] = 1.0;
    return (offsets[frame] - offsets[0]) * (offsets[0] == 0.0 ? normal : superior);
  }
  const auto                      distance = ParseNumbers(GetText(header, { 0x0018, 0x0088 }));
  const auto                      vectors = GetFrameVectors(header);
  const bool                      isBySlices = std::count(vectors.begin(), vectors.end(), Tag(0x0054, 0x0080)) > 0;
  gdcm::Attribute<0x0054, 0x0080> order;
  order.SetFromDataSet(header);
  const bool   isOrdered = order.GetNumberOfValues() == frames;
  const double number = isOrdered ? order[static_cast<unsigned int>(frame)] - 1.0 : static_cast<double>(frame);
  if (isBySlices && vectors.size() == 1 && order.GetNumberOfValues() > 0 &&
      !(isOrdered && number == static_cast<double>(frame)))
  {
    throw std::runtime_error(GetName(slice) + " is not in the order of the slices");
  }
  // frames of several volumes need the numbers of their slices
  const bool isNumbered = isBySlices && (vectors.size() == 1 || isOrdered);
  return isNumbered && distance.size() == 1 ? number * distance[0] * normal : VectorType(0.0);
}

/** As ITK does. */
Component
ChooseType(const Slice & slice)
{
  if (slice.slope == 1.0 && slice.intercept == 0.0)
  {
    return slice.source->storedType;
  }
  gdcm::Rescaler rescaler;
  rescaler.SetSlope(slice.slope);
  rescaler.SetIntercept(slice.intercept);
  rescaler.SetPixelFormat(slice.source->format);
  // GDCM asserts that it is
  return slice.slope > 0.0 ? GetComponentType(rescaler.ComputeInterceptSlopePixelType()) : Component::DOUBLE;
}

std::vector<char>
Decode(const Source & source)
{
  gdcm::Image &     image = *source.image;
  std::vector<char> bytes;
  if (source.isConverted && source.format != gdcm::PixelFormat::SINGLEBIT)
  {
    const auto io = itk::GDCMImageIO::New();
    io->SetFileName(source.path);
    io->ReadImageInformation();
    bytes.resize(static_cast<std::size_t>(io->GetImageSizeInBytes()));
    io->Read(bytes.data());
    return bytes;
  }
  if (source.format == gdcm::PixelFormat::SINGLEBIT && image.GetDataElement().GetByteValue())
  {
    // bits follow one another, also from row to row; GDCM has each row begin with a byte
    const gdcm::ByteValue & bits = *image.GetDataElement().GetByteValue();
    bytes.resize(std::size_t{ source.size[0] } * source.size[1] * source.size[2]);
    for (std::size_t n = 0; n < std::min<std::size_t>(bytes.size(), 8 * std::size_t{ bits.GetLength() }); ++n)
    {
      bytes[n] = static_cast<char>(bits.GetPointer()[n / 8] >> n % 8 & 1);
    }
    return bytes;
  }
  const unsigned short width = source.streams.empty() ? 0 : GetBytes(source.streams.front());
  if (width > 0)
  {
    // all bits that the codec delivers
    const auto bits = static_cast<unsigned short>(8 * width);
    image.SetPixelFormat(gdcm::PixelFormat(1, bits, bits, static_cast<unsigned short>(bits - 1)));
  }
  bytes.resize(image.GetBufferLength());
  if (!image.GetBuffer(bytes.data()))
  {
    throw std::runtime_error(DescribeUndecoded(source));
  }
  return width == 0   ? bytes
         : width == 1 ? Interpret<std::uint8_t>(source, bytes)
         : width == 2 ? Interpret<std::uint16_t>(source, bytes)
                      : Interpret<std::uint32_t>(source, bytes);
}
} // namespace

std::optional<Source>
ReadSource(const std::string & path)
{
  // as ITK has it
  gdcm::ImageHelper::SetForceRescaleInterceptSlope(true);
  DicomReader reader;
  if (!reader.ReadWhole(path))
  {
    return {};
  }
  Source source;
  source.path = path;
  source.image = &reader.GetImage();
  const Parsing              parsing(path, DescribeUndecoded(source));
  const gdcm::Image &        image = reader.GetImage();
  const unsigned int * const dimensions = image.GetDimensions();
  source.header = reader.GetFile().GetDataSet();
  source.header.Remove(Tag(0x7fe0, 0x0010));
  source.size = { dimensions[0], dimensions[1], image.GetNumberOfDimensions() == 3 ? dimensions[2] : 1 };
  source.format = image.GetPixelFormat();
  if (image.GetTransferSyntax().IsEncapsulated())
  {
    // GDCM changes its own by the first stream
    const auto size = gdcm::ImageHelper::GetDimensionsValue(reader.GetFile());
    std::copy_n(size.begin(), 3, source.size.begin());
    source.format = gdcm::ImageHelper::GetPixelFormatValue(reader.GetFile());
  }
  const auto colours = image.GetPhotometricInterpretation();
  source.isConverted = (colours != gdcm::PhotometricInterpretation::MONOCHROME1 &&
                        colours != gdcm::PhotometricInterpretation::MONOCHROME2 && !IsLabelMap(source.header)) ||
                       source.format == gdcm::PixelFormat::SINGLEBIT;
  if (source.isConverted)
  {
    const auto io = itk::GDCMImageIO::New();
    io->SetFileName(path);
    io->ReadImageInformation();
    source.components = io->GetNumberOfComponents();
    source.storedType = io->GetComponentType();
  }
  else
  {
    source.storedType = GetComponentType(source.format.GetScalarType());
    source.slope = image.GetSlope();
    source.intercept = image.GetIntercept();
  }
  RequirePixelFormat(source);
  RequireOneByteOrder(source, image.GetTransferSyntax());
  source.streams = ReadStreams(source, image);
  return source;
}

std::vector<Tag>
GetFrameVectors(const DataSet & header)
{
  std::vector<Tag>              vectors;
  const gdcm::ByteValue * const bytes = header.GetDataElement(Tag(0x0028, 0x0009)).GetByteValue();
  for (std::size_t n = 0; bytes && n + 4 <= bytes->GetLength(); n += 4)
  {
    std::uint16_t numbers[2];
    std::memcpy(numbers, bytes->GetPointer() + n, sizeof(numbers));
    vectors.emplace_back(numbers[0], numbers[1]);
  }
  return vectors;
}

std::string
GetName(const Slice & slice)
{
  return (slice.source->size[2] > 1 ? "frame " + std::to_string(slice.frame + 1) + " of '" : "'") + slice.source->path +
         "'";
}

DataSet
GetItem(const DataSet & dataSet, const Tag & tag)
{
  const auto sequence = dataSet.GetDataElement(tag).GetValueAsSQ();
  return sequence && sequence->GetNumberOfItems() > 0 ? sequence->GetItem(1).GetNestedDataSet() : DataSet();
}

std::vector<Slice>
GetSlices(const Source & source)
{
  const DataSet &    header = source.header;
  const DataSet      shared = GetItem(header, { 0x5200, 0x9229 });
  const DataSet      detector = GetItem(header, { 0x0054, 0x0022 });
  const auto         groups = header.GetDataElement(Tag(0x5200, 0x9230)).GetValueAsSQ();
  const std::size_t  frames = source.size[2];
  std::vector<Slice> slices;
  if (!GetItem(header, { 0x0028, 0x3000 }).IsEmpty())
  {
    throw std::runtime_error("'" + source.path + "' has its values in a Modality LUT Sequence (0028,3000), which is " +
                             "not read; convert the images to values with a rescale slope");
  }
  if (groups && groups->GetNumberOfItems() != frames)
  {
    throw std::runtime_error("'" + source.path + "' has " + std::to_string(frames) + " frames, but describes " +
                             std::to_string(groups->GetNumberOfItems()));
  }
  for (std::size_t frame = 0; frame < frames; ++frame)
  {
    Slice         slice{ &source, frame, source.slope, source.intercept, source.storedType };
    const DataSet own = groups ? groups->GetItem(frame + 1).GetNestedDataSet() : DataSet();
    const auto    find = [&](const Tag & group, const Tag & attribute) {
      const DataSet ofFrame = GetItem(own, group);
      const DataSet ofAll = GetItem(shared, group);
      std::string   text;
      for (const DataSet * scope : { &ofFrame, &ofAll, &header, &detector })
      {
        text = text.empty() ? GetText(*scope, attribute) : text;
      }
      return text;
    };
    const auto require = [&](const Tag & group, const Tag & attribute, std::size_t count, const std::string & name) {
      auto numbers = ParseNumbers(find(group, attribute));
      if (numbers.size() != count)
      {
        throw std::runtime_error(GetName(slice) + " has no valid " + name);
      }
      return numbers;
    };

    const auto orientation = require({ 0x0020, 0x9116 }, { 0x0020, 0x0037 }, 6, "orientation");
    const auto position = require({ 0x0020, 0x9113 }, { 0x0020, 0x0032 }, 3, "position");
    const auto spacing = require({ 0x0028, 0x9110 }, { 0x0028, 0x0030 }, 2, "pixel spacing");
    VectorType row(orientation.data());
    VectorType column(orientation.data() + 3);
    // 3 decimals are not exact
    const bool isUnit = std::abs(row.Normalize() - 1.0) < 1e-2 && std::abs(column.Normalize() - 1.0) < 1e-2;
    if (!isUnit || !(std::abs(row * column) < 2e-3))
    {
      throw std::runtime_error(GetName(slice) + " has no valid orientation: its rows and columns are not at right " +
                               "angles, or not of length 1");
    }
    if (!(std::min(spacing[0], spacing[1]) > 0.0))
    {
      throw std::runtime_error(GetName(slice) + " has no valid pixel spacing: it is not positive");
    }
    VectorType normal = itk::CrossProduct(row, column);
    normal.Normalize();
    row = itk::CrossProduct(column, normal);
    row.Normalize();
    slice.directions = { row, itk::CrossProduct(normal, row), normal };
    slice.spacing = { spacing[1], spacing[0] };
    slice.origin = VectorType(position.data()) + GetFrameOffset(header, slice, frames, normal);

    for (const Tag & thickness : { Tag(0x0018, 0x0088), Tag(0x0018, 0x0050) })
    {
      const auto numbers = ParseNumbers(find({ 0x0028, 0x9110 }, thickness));
      slice.thickness = slice.thickness == 0.0 && numbers.size() == 1 ? std::abs(numbers[0]) : slice.thickness;
    }
    if (!source.isConverted)
    {
      const Tag  transformation(0x0028, 0x9145);
      const Tag  slope(0x0028, 0x1053);
      const Tag  doseScaling(0x3004, 0x000e);
      const bool isDose = !GetText(header, doseScaling).empty();
      slice.isRescaled = isDose || !find(transformation, slope).empty();
      if (isDose)
      {
        slice.slope = require(transformation, doseScaling, 1, "dose grid scaling")[0];
      }
      else if (slice.isRescaled)
      {
        slice.slope = require(transformation, slope, 1, "rescale slope")[0];
        if (slice.slope == 0.0)
        {
          throw std::runtime_error(GetName(slice) + " has no valid rescale slope");
        }
        if (groups)
        {
          slice.intercept = require(transformation, { 0x0028, 0x1052 }, 1, "rescale intercept")[0];
        }
      }
      slice.type = ChooseType(slice);
    }
    gdcm::Attribute<0x0062, 0x000b> segment;
    for (const DataSet * scope : { &shared, &own })
    {
      segment.SetFromDataSet(GetItem(*scope, { 0x0062, 0x000a }));
    }
    slice.segment = segment.GetNumberOfValues() > 0 ? segment.GetValue() : 0;
    slices.push_back(slice);
  }
  return slices;
}

void
RequireLikeness(const Slice & slice, const Slice & first)
{
  std::string difference;
  const auto  require = [&difference](bool isLike, const std::string & what) {
    difference = difference.empty() && !isLike ? what : difference;
  };
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    require((slice.directions[axis] - first.directions[axis]).GetNorm() < 1e-3, "orientation");
  }
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    require(slice.source->size[axis] == first.source->size[axis], "size");
    require(std::abs(slice.spacing[axis] - first.spacing[axis]) < 1e-3 * first.spacing[axis], "pixel spacing");
  }
  const Tag photometric(0x0028, 0x0004);
  require(GetText(slice.source->header, photometric) == GetText(first.source->header, photometric),
          "photometric interpretation");
  require(slice.source->storedType == first.source->storedType && slice.source->components == first.source->components,
          "pixel type");
  require(slice.isRescaled == first.isRescaled, "rescaling");
  if (!difference.empty())
  {
    throw std::runtime_error(GetName(slice) + " and " + GetName(first) + " are of one series, but differ in " +
                             difference);
  }
}

std::vector<char>
TakeStored(const Source & source)
{
  const Parsing parsing(source.path, DescribeUndecoded(source));
  auto          stored = Decode(source);
  source.image->GetDataElement().Empty();
  return stored;
}
