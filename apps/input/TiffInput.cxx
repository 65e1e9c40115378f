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
#include "TiffInput.h"

#include "FileGeometry.h"
#include "FileStart.h"
#include "Integrity.h"
#include "TiffDescription.h"

#include "itkShearWarpMIPBaseImageFilter.h"
#include "itk_zlib.h"

#if __has_include("itk_tiff.h")
#  include "itk_tiff.h"
#else
#  include <tiffio.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <sstream>
#include <stdexcept>
#include <tuple>

namespace
{
namespace fs = std::filesystem;
using Component = itk::IOComponentEnum;
using Bytes = std::vector<unsigned char>;

/** The last error of libtiff; it goes on after most. */
std::string lastError;

void
KeepError(const char * /*module*/, const char * format, std::va_list arguments)
{
  std::array<char, 256> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  lastError = text.data();
}

/** libtiff goes on without a tag that it cannot read. */
void
KeepReadError(const char * module, const char * format, std::va_list arguments)
{
  if (std::string(format).compare(0, 8, "IO error") == 0)
  {
    KeepError(module, format, arguments);
  }
}

/** How the pixels of a page are stored. */
struct PageFormat
{
  std::uint32_t width{ 0 };
  std::uint32_t height{ 0 };
  std::uint16_t bits{ 1 };
  std::uint16_t samples{ 1 };
  std::uint16_t sampleFormat{ SAMPLEFORMAT_UINT };
  std::uint16_t photometric{ PHOTOMETRIC_MINISBLACK };
  /** Of the samples, the last ones. */
  std::uint16_t opacities{ 0 };
  /** Where the first row and the first column are. */
  std::uint16_t orientation{ ORIENTATION_TOPLEFT };

  bool
  operator==(const PageFormat & other) const
  {
    const auto tie = [](const PageFormat & format) {
      return std::tie(format.width,
                      format.height,
                      format.bits,
                      format.samples,
                      format.sampleFormat,
                      format.photometric,
                      format.orientation);
    };
    return tie(*this) == tie(other);
  }
};

/** A TIFF file, of which one page is the current one. */
class TiffFile
{
public:
  explicit TiffFile(const fs::path & path)
    : m_Path(path)
    , m_FormerWarnings(TIFFSetWarningHandler(KeepReadError))
    , m_FormerErrors(TIFFSetErrorHandler(KeepError))
  {
    lastError.clear();
    // the file is read, not mapped into memory
    m_File.reset(TIFFOpen(path.string().c_str(), "rm"));
    this->Verify(m_File != nullptr);
    this->FindPages();
  }

  ~TiffFile()
  {
    TIFFSetWarningHandler(m_FormerWarnings);
    TIFFSetErrorHandler(m_FormerErrors);
  }

  TiffFile(const TiffFile &) = delete;
  TiffFile &
  operator=(const TiffFile &) = delete;

  std::size_t
  GetNumberOfPages() const
  {
    return m_Offsets.size();
  }

  void
  GoTo(std::size_t page)
  {
    this->Verify(TIFFSetSubDirectory(m_File.get(), m_Offsets[page]) == 1);
  }

  template <typename T>
  T
  Get(ttag_t tag) const
  {
    T value{};
    TIFFGetFieldDefaulted(m_File.get(), tag, &value);
    return value;
  }

  std::string
  GetDescription() const
  {
    const char * text = nullptr;
    return TIFFGetField(m_File.get(), TIFFTAG_IMAGEDESCRIPTION, &text) == 1 && text ? text : "";
  }

  PageFormat
  GetFormat()
  {
    PageFormat format;
    format.width = this->Get<std::uint32_t>(TIFFTAG_IMAGEWIDTH);
    format.height = this->Get<std::uint32_t>(TIFFTAG_IMAGELENGTH);
    format.bits = this->Get<std::uint16_t>(TIFFTAG_BITSPERSAMPLE);
    format.samples = this->Get<std::uint16_t>(TIFFTAG_SAMPLESPERPIXEL);
    format.sampleFormat = this->Get<std::uint16_t>(TIFFTAG_SAMPLEFORMAT);
    format.photometric = this->Get<std::uint16_t>(TIFFTAG_PHOTOMETRIC);
    format.orientation = this->Get<std::uint16_t>(TIFFTAG_ORIENTATION);
    this->Verify(format.width > 0 && format.height > 0 && format.samples > 0);
    if (format.orientation > ORIENTATION_BOTLEFT)
    {
      throw std::runtime_error("'" + m_Path.string() + "' has columns that are stored as rows, which is not read");
    }
    const auto compression = this->Get<std::uint16_t>(TIFFTAG_COMPRESSION);
    if (TIFFIsCODECConfigured(compression) == 0)
    {
      throw std::runtime_error("'" + m_Path.string() + "' has a compression that libtiff does not read, number " +
                               std::to_string(compression));
    }
    if (format.photometric == PHOTOMETRIC_YCBCR && compression == COMPRESSION_JPEG)
    {
      TIFFSetField(m_File.get(), TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
      format.photometric = PHOTOMETRIC_RGB;
    }
    std::uint16_t         extra = 0;
    const std::uint16_t * kinds = nullptr;
    if (TIFFGetField(m_File.get(), TIFFTAG_EXTRASAMPLES, &extra, &kinds) == 1 && kinds)
    {
      format.opacities = static_cast<std::uint16_t>(
        std::count_if(kinds, kinds + extra, [](std::uint16_t kind) { return kind != EXTRASAMPLE_UNSPECIFIED; }));
    }
    return format;
  }

  /** Red, green and blue for each value of a palette, of 16 bits each. */
  std::array<std::uint16_t *, 3>
  GetPalette()
  {
    std::array<std::uint16_t *, 3> palette{};
    this->Verify(TIFFGetField(m_File.get(), TIFFTAG_COLORMAP, palette.data(), &palette[1], &palette[2]) == 1);
    return palette;
  }

  /** The pixels of the page, in rows, with the samples of a pixel side by side, as they are stored. */
  Bytes
  ReadPixels(const PageFormat & format)
  {
    const bool isTiled = TIFFIsTiled(m_File.get()) != 0;
    const bool isPlanar = this->Get<std::uint16_t>(TIFFTAG_PLANARCONFIG) == PLANARCONFIG_SEPARATE;
    const auto blockWidth = isTiled ? this->Get<std::uint32_t>(TIFFTAG_TILEWIDTH) : format.width;
    const auto blockHeight = isTiled ? this->Get<std::uint32_t>(TIFFTAG_TILELENGTH)
                                     : std::min(this->Get<std::uint32_t>(TIFFTAG_ROWSPERSTRIP), format.height);
    const auto blockBytes = isTiled ? TIFFTileSize(m_File.get()) : TIFFStripSize(m_File.get());
    const auto rowBytes = isTiled ? TIFFTileRowSize(m_File.get()) : TIFFScanlineSize(m_File.get());
    this->Verify(blockWidth > 0 && blockHeight > 0 && blockBytes > 0 && rowBytes > 0);
    this->VerifyChecksums();

    const std::uint32_t planes = isPlanar ? format.samples : 1;
    const std::size_t   samples = isPlanar ? 1 : format.samples;
    const std::size_t   sampleBytes = format.bits / 8;
    Bytes pixels(std::size_t{ format.width } * format.height * format.samples * std::max<std::size_t>(sampleBytes, 1));
    Bytes block(static_cast<std::size_t>(blockBytes));
    std::uint32_t number = 0;
    for (std::uint32_t plane = 0; plane < planes; ++plane)
    {
      for (std::uint32_t top = 0; top < format.height; top += blockHeight)
      {
        for (std::uint32_t left = 0; left < format.width; left += blockWidth)
        {
          const std::uint32_t rows = std::min(blockHeight, format.height - top);
          const std::uint32_t columns = std::min(blockWidth, format.width - left);
          const auto          needed = isTiled ? blockBytes : rowBytes * static_cast<tmsize_t>(rows);
          const auto          got = isTiled ? TIFFReadEncodedTile(m_File.get(), number, block.data(), needed)
                                            : TIFFReadEncodedStrip(m_File.get(), number, block.data(), needed);
          this->Verify(got == needed);
          ++number;
          for (std::uint32_t row = 0; row < rows; ++row)
          {
            const std::size_t first = (std::size_t{ top + row } * format.width + left) * format.samples + plane;
            CopySamples(block.data() + row * static_cast<std::size_t>(rowBytes),
                        columns * samples,
                        sampleBytes,
                        pixels.data() + first * std::max<std::size_t>(sampleBytes, 1),
                        planes);
          }
        }
      }
    }
    return pixels;
  }

  /** Throws the error of libtiff if there was one. */
  void
  Verify(bool isRight) const
  {
    if (!isRight || !lastError.empty())
    {
      Refuse(m_Path, lastError.empty() ? "its pages are not all there" : lastError);
    }
  }

private:
  void
  FindPages()
  {
    bool isLast = false;
    while (!isLast)
    {
      const auto kind = this->Get<std::uint32_t>(TIFFTAG_SUBFILETYPE);
      if ((kind & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) == 0)
      {
        m_Offsets.push_back(TIFFCurrentDirOffset(m_File.get()));
      }
      isLast = TIFFLastDirectory(m_File.get()) != 0;
      this->Verify(isLast || TIFFReadDirectory(m_File.get()) == 1);
    }
    if (m_Offsets.empty())
    {
      throw std::runtime_error("'" + m_Path.string() + "' has no page of full size");
    }
  }

  /** Copies samples of so many bytes, or of one bit if 0, to every so manyth place. */
  static void
  CopySamples(const unsigned char * from, std::size_t count, std::size_t bytes, unsigned char * to, std::size_t stride)
  {
    if (bytes > 0 && stride == 1)
    {
      std::memcpy(to, from, count * bytes);
      return;
    }
    for (std::size_t n = 0; n < count; ++n)
    {
      if (bytes == 0)
      {
        to[n * stride] = from[n / 8] >> (7 - n % 8) & 1;
      }
      else
      {
        std::memcpy(to + n * stride * bytes, from + n * bytes, bytes);
      }
    }
  }

  /** libtiff does not compare the check sum of what was deflated. */
  void
  VerifyChecksums() const
  {
    const auto compression = this->Get<std::uint16_t>(TIFFTAG_COMPRESSION);
    if (compression != COMPRESSION_ADOBE_DEFLATE && compression != COMPRESSION_DEFLATE)
    {
      return;
    }
    const bool          isTiled = TIFFIsTiled(m_File.get()) != 0;
    const std::uint32_t blocks = isTiled ? TIFFNumberOfTiles(m_File.get()) : TIFFNumberOfStrips(m_File.get());
    const auto          blockBytes = isTiled ? TIFFTileSize(m_File.get()) : TIFFStripSize(m_File.get());
    Bytes               inflated(static_cast<std::size_t>(blockBytes));
    // ITK's libtiff has no TIFFGetStrileByteCount()
    const std::uint64_t * sizes = nullptr;
    TIFFGetField(m_File.get(), isTiled ? TIFFTAG_TILEBYTECOUNTS : TIFFTAG_STRIPBYTECOUNTS, &sizes);
    this->Verify(sizes != nullptr);
    for (std::uint32_t block = 0; block < blocks; ++block)
    {
      const auto size = static_cast<tmsize_t>(sizes[block]);
      if (size == 0)
      {
        continue;
      }
      // no more than the file has
      this->Verify(size > 0 && static_cast<std::uintmax_t>(size) <= fs::file_size(m_Path));
      Bytes      raw(static_cast<std::size_t>(size));
      const auto got = isTiled ? TIFFReadRawTile(m_File.get(), block, raw.data(), size)
                               : TIFFReadRawStrip(m_File.get(), block, raw.data(), size);
      this->Verify(got == size);
      auto length = static_cast<uLongf>(inflated.size());
      if (uncompress(inflated.data(), &length, raw.data(), static_cast<uLong>(size)) != Z_OK)
      {
        Refuse(m_Path, "its compressed data are corrupt");
      }
    }
  }

  fs::path m_Path;
  struct Closer
  {
    void
    operator()(TIFF * file) const
    {
      TIFFClose(file);
    }
  };
  std::unique_ptr<TIFF, Closer> m_File;
  std::vector<std::uint64_t>    m_Offsets;
  TIFFErrorHandler              m_FormerWarnings;
  TIFFErrorHandler              m_FormerErrors;
};

Component
GetComponentType(const PageFormat & format)
{
  const bool isSigned = format.sampleFormat == SAMPLEFORMAT_INT;
  if (format.sampleFormat == SAMPLEFORMAT_IEEEFP)
  {
    return format.bits == 32   ? Component::FLOAT
           : format.bits == 64 ? Component::DOUBLE
                               : Component::UNKNOWNCOMPONENTTYPE;
  }
  switch (isSigned || format.sampleFormat == SAMPLEFORMAT_UINT || format.sampleFormat == SAMPLEFORMAT_VOID ? format.bits
                                                                                                           : 0)
  {
    case 1:
      return Component::UCHAR;
    case 8:
      return isSigned ? Component::CHAR : Component::UCHAR;
    case 16:
      return isSigned ? Component::SHORT : Component::USHORT;
    case 32:
      return isSigned ? Component::INT : Component::UINT;
    case 64:
      return isSigned ? Component::LONGLONG : Component::ULONGLONG;
    default:
      return Component::UNKNOWNCOMPONENTTYPE;
  }
}

/** How many values a pixel has: colours have three, and opacity is none. */
std::size_t
CountValues(const PageFormat & format, const fs::path & path)
{
  const std::size_t samples = format.samples - std::min(format.opacities, format.samples);
  const bool isGrey = format.photometric == PHOTOMETRIC_MINISBLACK || format.photometric == PHOTOMETRIC_MINISWHITE;
  const bool isColoured = format.photometric == PHOTOMETRIC_RGB && samples >= 3;
  const bool isPalette =
    format.photometric == PHOTOMETRIC_PALETTE && samples == 1 && (format.bits == 8 || format.bits == 16);
  if (samples == 0 || !(isGrey || isColoured || isPalette))
  {
    throw std::runtime_error("'" + path.string() + "' has colours of a kind that is not read; grey values or red, " +
                             "green and blue are needed");
  }
  return isPalette || isColoured ? 3 : samples;
}

Bytes
ExpandPalette(const Bytes & indices, const PageFormat & format, const std::array<std::uint16_t *, 3> & palette)
{
  const std::size_t bytes = format.bits / 8;
  Bytes             colours;
  colours.reserve(indices.size() / bytes * 3);
  for (std::size_t n = 0; n < indices.size(); n += bytes)
  {
    std::uint16_t index = indices[n];
    if (bytes == 2)
    {
      std::memcpy(&index, indices.data() + n, bytes);
    }
    for (const std::uint16_t * const map : palette)
    {
      colours.push_back(static_cast<unsigned char>(map[index] >> 8));
    }
  }
  return colours;
}

/** The size of a voxel in mm. An axis without one gets the size along another axis. */
std::array<double, 3>
FindSpacing(const TiffFile &        file,
            const TiffDescription & description,
            const fs::path &        path,
            const WarningFunction & warn)
{
  const double          resolution[] = { file.Get<float>(TIFFTAG_XRESOLUTION), file.Get<float>(TIFFTAG_YRESOLUTION) };
  const auto            unit = file.Get<std::uint16_t>(TIFFTAG_RESOLUTIONUNIT);
  const bool            isImageJ = description.writer == "ImageJ";
  std::array<double, 3> spacing{};
  double                stated = 0.0;
  bool                  hasUnit = true;
  for (std::size_t axis = 0; axis < 3; ++axis)
  {
    const double perPixel = axis < 2 && resolution[axis] > 0.0 ? 1.0 / resolution[axis] : 0.0;
    if (description.writer.empty())
    {
      spacing[axis] = unit == RESUNIT_NONE ? 0.0 : unit == RESUNIT_INCH ? 25.4 * perPixel : 10.0 * perPixel;
    }
    else
    {
      const double length = isImageJ && axis < 2 ? perPixel : description.spacing[axis];
      const auto   millimetres = FindMillimetres(description.units[axis]);
      hasUnit = hasUnit && (millimetres || !(length > 0.0));
      spacing[axis] = length * millimetres.value_or(1.0);
    }
    spacing[axis] = spacing[axis] > 0.0 && std::isfinite(spacing[axis]) ? spacing[axis] : 0.0;
    stated = stated > 0.0 ? stated : spacing[axis];
  }
  stated = stated > 0.0 ? stated : 1.0;
  std::string without;
  for (std::size_t axis = 0; axis < 3; ++axis)
  {
    if (spacing[axis] == 0.0)
    {
      without += (without.empty() ? "" : ", ") + std::string(1, "xyz"[axis]);
      spacing[axis] = stated;
    }
  }
  if (!without.empty())
  {
    std::ostringstream message;
    message << "'" << path.string() << "' does not say how large its voxels are along " << without << "; " << stated
            << " mm is taken";
    warn(message.str());
  }
  if (!hasUnit)
  {
    warn("'" + path.string() + "' gives the size of its voxels without a known unit; mm is taken");
  }
  return spacing;
}

/** What the pages are; all of one slice are taken for slices. */
TiffDescription
Describe(const TiffFile & file, std::size_t samples, const fs::path & path, const WarningFunction & warn)
{
  const std::string name = "'" + path.string() + "'";
  TiffDescription   description;
  try
  {
    description =
      ParseTiffDescription(file.GetDescription(), path.filename().string(), file.GetNumberOfPages(), samples);
  }
  catch (const std::runtime_error & error)
  {
    throw std::runtime_error("cannot read " + name + ": " + error.what());
  }
  const std::size_t pages = description.pages.size();
  if (pages == 1)
  {
    throw std::runtime_error(name + " has one slice; a stack of slices is needed");
  }
  if (description.size[1] == 1)
  {
    warn(name + " describes its " + std::to_string(pages) + " pages as channels or points in time of one slice; they " +
         "are taken for slices");
    description.size = { { 1, pages, 1 } };
  }
  if (!description.ignored.empty())
  {
    warn(name + " describes " + description.ignored + ", which is not read");
  }
  return description;
}

/** Puts the first row to the top and the first column to the left. */
void
Flip(Bytes & page, const PageFormat & format, std::size_t pixelBytes)
{
  const auto getPlace = [&](std::size_t row, std::size_t column) {
    return page.begin() + static_cast<std::ptrdiff_t>((row * format.width + column) * pixelBytes);
  };
  const std::size_t height = format.height;
  if (format.orientation == ORIENTATION_BOTLEFT || format.orientation == ORIENTATION_BOTRIGHT)
  {
    for (std::size_t row = 0; row < height / 2; ++row)
    {
      std::swap_ranges(getPlace(row, 0), getPlace(row + 1, 0), getPlace(height - 1 - row, 0));
    }
  }
  if (format.orientation == ORIENTATION_TOPRIGHT || format.orientation == ORIENTATION_BOTRIGHT)
  {
    for (std::size_t row = 0; row < height; ++row)
    {
      for (std::size_t column = 0; column < format.width / 2; ++column)
      {
        std::swap_ranges(getPlace(row, column), getPlace(row, column + 1), getPlace(row, format.width - 1 - column));
      }
    }
  }
}

/** The pages as slices of a volume of \a grid, with \a values for each pixel of a page. */
template <typename TPixel>
Volume
ReadPages(TiffFile &                file,
          const TiffDescription &   description,
          const PageFormat &        format,
          std::size_t               values,
          const itk::ImageBase<3> * grid,
          const fs::path &          path)
{
  using ContainerType = typename itk::VectorImage<TPixel, 3>::PixelContainer;
  const bool        isPalette = format.photometric == PHOTOMETRIC_PALETTE;
  const std::size_t samples = isPalette ? 3 : format.samples;
  const std::size_t channels = description.size[0];
  const std::size_t components = channels * values;
  const std::size_t pixels = std::size_t{ format.width } * format.height;
  const auto        planes = static_cast<double>(description.pages.size() * values);
  if (static_cast<double>(pixels * sizeof(TPixel)) * planes > itk::ShearWarp::GetPhysicalMemory())
  {
    throw std::bad_alloc();
  }
  const auto container = ContainerType::New();
  container->Reserve(pixels * values * description.pages.size());
  for (std::size_t n = 0; n < description.pages.size(); ++n)
  {
    file.GoTo(description.pages[n]);
    if (!(file.GetFormat() == format))
    {
      throw std::runtime_error("'" + path.string() + "' has pages of different sizes or kinds, the first and page " +
                               std::to_string(description.pages[n] + 1) + "; all must be of one");
    }
    const Bytes bytes = file.ReadPixels(format);
    Bytes       page = isPalette ? ExpandPalette(bytes, format, file.GetPalette()) : bytes;
    Flip(page, format, samples * sizeof(TPixel));
    const auto * from = page.data();
    TPixel *     to = container->GetBufferPointer() + n / channels * pixels * components + n % channels * values;
    if (components == samples)
    {
      std::memcpy(to, from, page.size());
      continue;
    }
    for (std::size_t pixel = 0; pixel < pixels; ++pixel, from += samples * sizeof(TPixel), to += components)
    {
      std::memcpy(to, from, values * sizeof(TPixel));
    }
  }
  file.Verify(true);
  if (std::is_same_v<TPixel, short> && description.isSigned && format.sampleFormat != SAMPLEFORMAT_INT)
  {
    // what is stored is the value plus 32768
    constexpr auto signBit = static_cast<TPixel>(std::numeric_limits<short>::min());
    std::for_each(container->GetBufferPointer(), container->GetBufferPointer() + container->Size(), [](TPixel & value) {
      value = static_cast<TPixel>(value < TPixel{ 0 } ? value - signBit : value + signBit);
    });
  }
  return MakeVolume<TPixel>(grid, static_cast<unsigned int>(components), description.size[2], container);
}
} // namespace

bool
LooksLikeTiff(const fs::path & path)
{
  using namespace std::string_literals;
  const std::string start = ReadStart(path, 4);
  return !HasPreamble(path) && (start == "II*\0"s || start == "MM\0*"s || start == "II+\0"s || start == "MM\0+"s);
}

Volume
ReadTiff(const fs::path & path, const WarningFunction & warn)
{
  TiffFile file(path);
  file.GoTo(0);
  const PageFormat  format = file.GetFormat();
  Component         stored = GetComponentType(format);
  const std::size_t values = CountValues(format, path);
  const bool        isPalette = format.photometric == PHOTOMETRIC_PALETTE;
  if (stored == Component::UNKNOWNCOMPONENTTYPE)
  {
    throw std::runtime_error(
      "'" + path.string() + "' has " + (format.sampleFormat == SAMPLEFORMAT_IEEEFP ? "floats of " : "samples of ") +
      std::to_string(format.bits) + " bits; integers of 1, 8, 16, 32 or 64 bits or floats of 32 or 64 bits are needed");
  }
  const TiffDescription description = Describe(file, isPalette ? 1 : values, path, warn);
  stored = description.isSigned && stored == Component::USHORT ? Component::SHORT : stored;
  const auto grid = itk::ImageBase<3>::New();
  grid->SetRegions(itk::Size<3>{ { format.width, format.height, description.size[1] } });
  grid->SetSpacing(FindSpacing(file, description, path, warn).data());
  Volume volume = DispatchPixelType(isPalette ? Component::UCHAR : stored, [&](auto tag) {
    return ReadPages<typename decltype(tag)::Type>(file, description, format, values, grid, path);
  });
  volume.timeSpacing = description.timeSpacing > 0.0 ? description.timeSpacing : 1.0;
  volume.hasOrientation = false;
  volume.isInverted = format.photometric == PHOTOMETRIC_MINISWHITE;
  return volume;
}
