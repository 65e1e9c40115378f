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
#include "EngineOfPage.h"
#include "Page.h"

#include "itkShearWarpFactorization.h"
#include "itk_zlib.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <new>
#include <sstream>
#include <stdexcept>

namespace
{
// browsers take no longer texts; WebAssembly has 4 GB, for the voxels and their transposed copy
constexpr std::size_t mostCharacters = (std::size_t{ 1 } << 29) - 1024;
constexpr std::size_t mostBytes = std::size_t{ 1 } << 31;

void
RequireAtMost(std::size_t most, std::size_t count)
{
  if (count > most)
  {
    throw std::runtime_error(
      "the volume is too large for a page: browsers take 2 GB of voxels, and 512 MB of text; see "
      "--page-volume-size, --page-bits and --crop");
  }
}

/** Makes a text of bytes: base64 of gzip. */
class PackedText
{
public:
  PackedText()
  {
    // the default level takes up to four times as long, for 2 %; 16: as gzip
    constexpr int level = 4;
    if (deflateInit2(&m_Stream, level, Z_DEFLATED, MAX_WBITS + 16, MAX_MEM_LEVEL, Z_DEFAULT_STRATEGY) != Z_OK)
    {
      throw std::bad_alloc();
    }
  }
  PackedText(const PackedText &) = delete;
  PackedText &
  operator=(const PackedText &) = delete;
  ~PackedText() { deflateEnd(&m_Stream); }

  void
  Add(const unsigned char * bytes, std::size_t count)
  {
    this->Deflate(bytes, count, Z_NO_FLUSH);
  }

  std::string
  Finish()
  {
    this->Deflate(nullptr, 0, Z_FINISH);
    m_Text += EncodeBase64(m_Packed);
    return std::move(m_Text);
  }

private:
  void
  Deflate(const unsigned char * bytes, std::size_t count, int flush)
  {
    // without padding, of whole groups of three bytes
    constexpr std::size_t piece = 3 << 16;
    m_Stream.next_in = const_cast<unsigned char *>(bytes);
    m_Stream.avail_in = static_cast<uInt>(count);
    for (bool isFull = true; isFull;)
    {
      const std::size_t begin = m_Packed.size();
      m_Packed.resize(piece);
      m_Stream.next_out = reinterpret_cast<unsigned char *>(m_Packed.data()) + begin;
      m_Stream.avail_out = static_cast<uInt>(piece - begin);
      deflate(&m_Stream, flush);
      isFull = m_Stream.avail_out == 0;
      m_Packed.resize(piece - m_Stream.avail_out);
      if (isFull)
      {
        m_Text += EncodeBase64(m_Packed);
        m_Packed.clear();
      }
    }
    RequireAtMost(mostCharacters, m_Text.size());
  }

  z_stream    m_Stream{};
  std::string m_Packed;
  std::string m_Text;
};

/** The low bytes of all stored voxels, then, of 16 bits, the high ones. */
std::string
PackVoxels(const AnyImage & image, const StoredScale & scale)
{
  PackedText text;
  DispatchPixelType(image.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    auto &                     voxels = *CastImage<PixelType>(image).GetPixelContainer();
    std::vector<unsigned char> bytes;
    RequireAtMost(mostBytes, voxels.Size() * scale.bits / 8);
    for (unsigned int shift = 0; shift < scale.bits; shift += 8)
    {
      constexpr std::size_t piece = 1 << 16;
      for (std::size_t begin = 0; begin < voxels.Size(); begin += piece)
      {
        const PixelType * const first = voxels.GetBufferPointer() + begin;
        bytes.resize(std::min<std::size_t>(piece, voxels.Size() - begin));
        std::transform(first, first + bytes.size(), bytes.begin(), [&](PixelType voxel) {
          return static_cast<unsigned char>(scale.Store(static_cast<double>(voxel)) >> shift);
        });
        text.Add(bytes.data(), bytes.size());
      }
    }
  });
  return text.Finish();
}

/** The stored value of voxels that are as the background; 0 if there are none. */
unsigned int
StoreBackground(const StoredScale & scale, double background)
{
  const bool isBelowAll = !scale.isCut[0] && background < scale.range[0] && std::isfinite(background);
  return isBelowAll ? 0 : scale.Store(background);
}

/** Three rows of JSON: the matrix, and the offset behind it. */
std::string
DescribeMap(const itk::ShearWarp::AffineMap3D & map)
{
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10);
  for (unsigned int row = 0; row < 3; ++row)
  {
    text << (row == 0 ? "[[" : ", [");
    for (const double number : map.matrix[row])
    {
      text << number << ", ";
    }
    text << map.offset[row] << ']';
  }
  return text.str() + ']';
}

/** From the index of a voxel to mm. */
std::string
DescribeGrid(const itk::ImageBase<3> & grid)
{
  return DescribeMap(itk::ShearWarp::MakeVolumeGrid(&grid).indexToPhysical);
}

/** The depths between which samples count, within the sphere about the whole volume, or null. */
std::string
DescribeSlab(const Frame & frame, const itk::ImageBase<3> & whole, const itk::Point<double, 3> & center)
{
  if (!std::isfinite(frame.slabNear) && !std::isfinite(frame.slabFar))
  {
    return "null";
  }
  double radius = 0.0;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    radius += static_cast<double>(whole.GetLargestPossibleRegion().GetSize()[axis]) * whole.GetSpacing()[axis];
  }
  const double       depth = frame.transform->GetInverseTransform()->TransformPoint(center)[2];
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10) << '['
       << std::max(frame.slabNear, depth - radius) << ", " << std::min(frame.slabFar, depth + radius) << ']';
  return text.str();
}

template <typename TValues>
std::string
DescribeList(const TValues & values)
{
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10) << '[' << values[0] << ", " << values[1] << ", "
       << values[2] << ']';
  return text.str();
}

/** The command that makes pictures of the same voxels, without names of files and series, which may be a patient's. */
std::string
DescribeCommand(const Options & options)
{
  std::ostringstream text;
  text << R"(["shear-warp-mip", "INPUT")";
  const auto add = [&text](bool isGiven, const std::string & name, const std::string & value) {
    if (isGiven)
    {
      text << ", " << Quote(name) << (value.empty() ? "" : ", " + Quote(value));
    }
  };
  const auto join = [](const auto & numbers) {
    std::ostringstream list;
    list << std::setprecision(std::numeric_limits<double>::max_digits10);
    for (const auto & number : numbers)
    {
      list << (list.tellp() > 0 ? "," : "") << number;
    }
    return list.str();
  };
  const bool isNumber = options.series.find_first_not_of("0123456789") == std::string::npos;
  add(!options.series.empty(), "--series", isNumber ? options.series : "SERIES");
  add(!options.volume.empty(), "--volume", options.volume);
  add(options.isSuv, "--suv", "");
  add(!options.mask.empty(), "--mask", "MASK");
  add(options.maskLabel.has_value(), "--mask-label", std::to_string(options.maskLabel.value_or(0)));
  add(!options.removedLabels.empty(), "--remove-label", join(options.removedLabels));
  add(!options.crop.empty(), "--crop", join(options.crop));
  return text.str() + ']';
}
} // namespace

/** A web page that holds the volume and the engine, which projects it in the browser. */
void
WriteVolumePage(OutputFiles & files, const std::string & path, const Product & product)
{
  const Options &   options = product.options;
  const Stack &     stack = product.stack;
  const Reduction & volume = *product.volume;
  const Frame &     frame = stack.frames.front();
  const auto &      grid = *volume.image.image;
  const auto &      whole = *volume.whole;
  const WindowType  window = product.window ? *product.window : FindWindow(stack.projections);
  const StoredScale scale = MakeStoredScale(volume.image, std::nullopt, window, GetPageBits(options));

  const auto         size = grid.GetLargestPossibleRegion().GetSize();
  const double       spacing = stack.projections.stack.image->GetSpacing()[0];
  std::ostringstream series;
  series << std::setprecision(std::numeric_limits<double>::max_digits10) << '{'
         << DescribeDisplay(product, scale, window) << ", \"volume\": {\"size\": " << DescribeList(size)
         << ", \"toPhysical\": " << DescribeGrid(grid)
         << ", \"view\": " << DescribeMap(itk::ShearWarp::MakeView(frame.transform))
         << ", \"center\": " << DescribeList(*stack.center)
         << ", \"axis\": [0, 0, 1], \"mode\": " << Quote(options.mode)
         << ", \"slab\": " << DescribeSlab(frame, whole, *stack.center)
         << ", \"exact\": " << (options.isExact ? "true" : "false")
         << ", \"hasOrientation\": " << (stack.hasOrientation ? "true" : "false") << ", \"spacing\": " << spacing
         << ", \"whole\": {\"size\": " << DescribeList(whole.GetLargestPossibleRegion().GetSize())
         << ", \"spacing\": " << DescribeList(whole.GetSpacing()) << ", \"toPhysical\": " << DescribeGrid(whole)
         << "}, \"backgroundVoxel\": " << StoreBackground(scale, stack.projections.background)
         << ", \"command\": " << DescribeCommand(options) << "}}";

  std::map<std::string, std::string> texts{ { "@SERIES@", series.str() } };
  texts["@ENGINE@"] = EncodeBase64(GetEngineOfPage());
  texts["@VOXELS@"] = PackVoxels(volume.image, scale);
  WriteFilledPage(files, path, texts);
}
