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
#include "PreparedVolume.h"

#include "kernels/PixelTypes.h"

#include <algorithm>
#include <mutex>

namespace itk
{
template <typename TPixel>
void
ShearWarpPreparedVolume<TPixel>::Prepare(const ImageType *                  image,
                                         const ImageRegion<3> &             whole,
                                         unsigned int                       principalAxis,
                                         bool                               hasBlockExtrema,
                                         const ShearWarp::Kernels<TPixel> & kernels,
                                         const ShearWarp::Parallelize &     parallelize)
{
  ShearWarpBuffer memory;
  if (!this->IsOf(image))
  {
    // the next copy can have the memory of the last one
    memory = std::move(m_Transposed);
  }
  this->SetImage(image, whole);
  if (hasBlockExtrema && m_BlockExtrema.GetSizeInBytes() == 0)
  {
    this->FindBlockExtrema(kernels, parallelize);
  }
  if (principalAxis == 0 && m_Transposed.GetSizeInBytes() == 0)
  {
    this->Transpose(kernels, parallelize, std::move(memory));
  }
}

template <typename TPixel>
void
ShearWarpPreparedVolume<TPixel>::PreparePart(const ImageType *                  image,
                                             const ImageRegion<3> &             whole,
                                             std::ptrdiff_t                     begin,
                                             std::ptrdiff_t                     end,
                                             unsigned int                       principalAxis,
                                             bool                               hasBlockExtrema,
                                             const ShearWarp::Kernels<TPixel> & kernels,
                                             const ShearWarp::Parallelize &     parallelize)
{
  m_Image = nullptr;
  ShearWarpBuffer memory = std::move(m_Transposed);
  // rows along z need the slice before
  const std::ptrdiff_t first = image->GetBufferedRegion().GetIndex(2) - whole.GetIndex(2);
  this->SetPart(image, whole, principalAxis == 2 ? begin : std::max(begin - 1, first), end);
  if (hasBlockExtrema)
  {
    this->FindBlockExtrema(kernels, parallelize);
  }
  if (principalAxis == 0)
  {
    this->Transpose(kernels, parallelize, std::move(memory));
  }
}

template <typename TPixel>
void
ShearWarpPreparedVolume<TPixel>::SetImage(const ImageType * image, const ImageRegion<3> & whole)
{
  if (this->IsOf(image))
  {
    return;
  }
  this->Release();
  const auto &         buffered = image->GetBufferedRegion();
  const std::ptrdiff_t begin = buffered.GetIndex(2) - whole.GetIndex(2);
  this->SetPart(image, whole, begin, begin + static_cast<std::ptrdiff_t>(buffered.GetSize(2)));
  m_Image = image;
  m_ImageMTime = image->GetMTime();
  m_ProjectedAxes = 0;
}

template <typename TPixel>
void
ShearWarpPreparedVolume<TPixel>::SetPart(const ImageType *      image,
                                         const ImageRegion<3> & whole,
                                         std::ptrdiff_t         begin,
                                         std::ptrdiff_t         end)
{
  const auto & buffered = image->GetBufferedRegion();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    m_Begin[axis] = buffered.GetIndex(axis) - whole.GetIndex(axis);
    m_Size[axis] = static_cast<std::ptrdiff_t>(buffered.GetSize(axis));
  }
  m_Voxels = image->GetBufferPointer() + (begin - m_Begin[2]) * m_Size[0] * m_Size[1];
  m_Begin[2] = begin;
  m_Size[2] = end - begin;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto length = static_cast<std::ptrdiff_t>(whole.GetSize(axis));
    m_Ends[axis] = { m_Begin[axis] == 0, m_Begin[axis] + m_Size[axis] == length };
  }
  m_Lowest = NumericTraits<TPixel>::NonpositiveMin();
  m_Highest = NumericTraits<TPixel>::max();
}

template <typename TPixel>
void
ShearWarpPreparedVolume<TPixel>::Release()
{
  m_Image = nullptr;
  m_Transposed.Release();
  m_BlockExtrema.Release();
}

template <typename TPixel>
void
ShearWarpPreparedVolume<TPixel>::FindBlockExtrema(const ShearWarp::Kernels<TPixel> & kernels,
                                                  const ShearWarp::Parallelize &     parallelize)
{
  using ShearWarp::BlockLength;
  using ShearWarp::CountBlocks;
  const std::ptrdiff_t x = m_Size[0];
  const std::ptrdiff_t y = m_Size[1];
  const std::ptrdiff_t blocksX = CountBlocks(x);
  const std::ptrdiff_t blocksY = CountBlocks(y);
  ShearWarpBuffer      maxima = std::move(m_BlockExtrema);
  const std::ptrdiff_t blocks = blocksX * blocksY * CountBlocks(m_Size[2]);
  maxima.Reserve(blocks * (m_HasBlockMinima ? 2 : 1) * sizeof(TPixel), "the block maxima");
  TPixel * const first = maxima.GetPointer<TPixel>();
  TPixel         lowestOfAll = NumericTraits<TPixel>::max();
  TPixel         highestOfAll = NumericTraits<TPixel>::NonpositiveMin();
  std::mutex     mutex;
  parallelize(static_cast<SizeValueType>(blocksY * CountBlocks(m_Size[2])),
              1,
              [&](SizeValueType n, SizeValueType, SizeValueType) {
                const auto           block = static_cast<std::ptrdiff_t>(n);
                const std::ptrdiff_t row = block % blocksY * BlockLength;
                const std::ptrdiff_t slice = block / blocksY * BlockLength;
                TPixel               lowest = NumericTraits<TPixel>::max();
                TPixel               highest = NumericTraits<TPixel>::NonpositiveMin();
                kernels.findBlockExtrema(m_Voxels + (slice * y + row) * x,
                                         x,
                                         std::min(BlockLength, y - row),
                                         std::min(BlockLength, m_Size[2] - slice),
                                         x,
                                         x * y,
                                         first + block * blocksX,
                                         m_HasBlockMinima ? first + blocks + block * blocksX : nullptr,
                                         lowest,
                                         highest);
                const std::lock_guard<std::mutex> lock(mutex);
                lowestOfAll = std::min(lowestOfAll, lowest);
                highestOfAll = std::max(highestOfAll, highest);
              });
  m_Lowest = lowestOfAll;
  m_Highest = highestOfAll;
  m_BlockExtrema = std::move(maxima);
}

template <typename TPixel>
void
ShearWarpPreparedVolume<TPixel>::Transpose(const ShearWarp::Kernels<TPixel> & kernels,
                                           const ShearWarp::Parallelize &     parallelize,
                                           ShearWarpBuffer                    memory)
{
  const std::ptrdiff_t slice = m_Size[0] * m_Size[1];
  const std::size_t    bytes = slice * m_Size[2] * sizeof(TPixel);
  memory.Reserve(bytes, "the transposed copy of the volume");
  TPixel * transposed = memory.GetPointer<TPixel>();
  // a small one stays in the cache
  const bool isStreamed = bytes > std::size_t{ 1 } << 22;
  parallelize(static_cast<SizeValueType>(m_Size[2]), 1, [&](SizeValueType z, SizeValueType, SizeValueType) {
    kernels.transposeSlice(m_Voxels + z * slice, m_Size[0], m_Size[1], transposed + z * slice, isStreamed);
  });
  m_Transposed = std::move(memory);
}

template <typename TPixel>
auto
ShearWarpPreparedVolume<TPixel>::GetSlices(unsigned int principalAxis) const -> SliceStackType
{
  const std::ptrdiff_t x = m_Size[0];
  const std::ptrdiff_t y = m_Size[1];
  const std::ptrdiff_t z = m_Size[2];
  const TPixel *       transposed = m_Transposed.GetPointer<TPixel>();
  switch (principalAxis)
  {
    case 0:
      return { transposed, y, z, x, x * y, y, m_Lowest, m_Highest, m_Ends[1], m_Ends[2] };
    case 1:
      return { m_Voxels, x, z, y, x * y, x, m_Lowest, m_Highest, m_Ends[0], m_Ends[2] };
    default:
      return { m_Voxels, x, y, z, x, x * y, m_Lowest, m_Highest, m_Ends[0], m_Ends[1] };
  }
}

template <typename TPixel>
ShearWarp::Corner
ShearWarpPreparedVolume<TPixel>::GetCorner(unsigned int principalAxis) const
{
  switch (principalAxis)
  {
    case 0:
      return { m_Begin[1], m_Begin[2], m_Begin[0] };
    case 1:
      return { m_Begin[0], m_Begin[2], m_Begin[1] };
    default:
      return { m_Begin[0], m_Begin[1], m_Begin[2] };
  }
}

template <typename TPixel>
auto
ShearWarpPreparedVolume<TPixel>::GetBlockExtrema(unsigned int principalAxis) const -> BlockExtremaType
{
  const std::ptrdiff_t x = ShearWarp::CountBlocks(m_Size[0]);
  const std::ptrdiff_t y = ShearWarp::CountBlocks(m_Size[1]);
  const std::ptrdiff_t z = ShearWarp::CountBlocks(m_Size[2]);
  const auto *         maxima = m_BlockExtrema.GetPointer<TPixel>();
  const auto *         minima = maxima && m_HasBlockMinima ? maxima + x * y * z : nullptr;
  switch (principalAxis)
  {
    case 0:
      return { maxima, minima, y, z, x, x, x * y, 1 };
    case 1:
      return { maxima, minima, x, z, y, 1, x * y, x };
    default:
      return { maxima, minima, x, y, z, 1, x, x * y };
  }
}

#define INSTANTIATE(TPixel) template class ShearWarpPreparedVolume<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk
