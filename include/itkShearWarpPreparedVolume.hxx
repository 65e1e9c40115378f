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
#ifndef itkShearWarpPreparedVolume_hxx
#define itkShearWarpPreparedVolume_hxx

#include <algorithm>
#include <mutex>

namespace itk
{
template <typename TPixel>
template <typename TParallelize>
void
ShearWarpPreparedVolume<TPixel>::Prepare(const ImageType *                  image,
                                         unsigned int                       principalAxis,
                                         const ShearWarp::Kernels<TPixel> & kernels,
                                         const TParallelize &               parallelize)
{
  ShearWarpBuffer memory;
  if (!this->IsOf(image))
  {
    // the next copy can have the memory of the last one
    memory = std::move(m_Transposed);
    this->Release();
    this->SetSlab(image, 0, image->GetLargestPossibleRegion().GetSize(2));
    this->FindBlockMaxima(true, kernels, parallelize);
    m_Image = image;
    m_ImageMTime = image->GetMTime();
  }
  if (!this->IsPrepared(image, principalAxis))
  {
    this->Transpose(kernels, parallelize, std::move(memory));
  }
}

template <typename TPixel>
template <typename TParallelize>
void
ShearWarpPreparedVolume<TPixel>::PrepareSlab(const ImageType *                  image,
                                             std::ptrdiff_t                     begin,
                                             std::ptrdiff_t                     end,
                                             bool                               isFirst,
                                             unsigned int                       principalAxis,
                                             const ShearWarp::Kernels<TPixel> & kernels,
                                             const TParallelize &               parallelize)
{
  m_Image = nullptr;
  ShearWarpBuffer memory = std::move(m_Transposed);
  this->SetSlab(image, begin, end);
  this->FindBlockMaxima(isFirst, kernels, parallelize);
  if (principalAxis == 0)
  {
    this->Transpose(kernels, parallelize, std::move(memory));
  }
}

template <typename TPixel>
void
ShearWarpPreparedVolume<TPixel>::SetSlab(const ImageType * image, std::ptrdiff_t begin, std::ptrdiff_t end)
{
  m_Voxels = image->GetBufferPointer();
  std::copy_n(image->GetLargestPossibleRegion().GetSize().begin(), 3, m_Size);
  m_FirstBufferedSlice = image->GetBufferedRegion().GetIndex(2) - image->GetLargestPossibleRegion().GetIndex(2);
  m_SlabBegin = begin;
  m_SlabEnd = end;
}

template <typename TPixel>
void
ShearWarpPreparedVolume<TPixel>::Release()
{
  m_Image = nullptr;
  m_Transposed.Release();
  m_BlockMaxima.Release();
}

template <typename TPixel>
template <typename TParallelize>
void
ShearWarpPreparedVolume<TPixel>::FindBlockMaxima(bool                               isFirstSlab,
                                                 const ShearWarp::Kernels<TPixel> & kernels,
                                                 const TParallelize &               parallelize)
{
  using ShearWarp::BlockLength;
  using ShearWarp::CountBlocks;
  const std::ptrdiff_t x = m_Size[0];
  const std::ptrdiff_t y = m_Size[1];
  const std::ptrdiff_t blocksX = CountBlocks(x);
  const std::ptrdiff_t blocksY = CountBlocks(y);
  ShearWarpBuffer      maxima = std::move(m_BlockMaxima);
  if (isFirstSlab)
  {
    maxima.Reserve(blocksX * blocksY * CountBlocks(m_Size[2]) * sizeof(TPixel), "the block maxima");
    m_Lowest = NumericTraits<TPixel>::max();
    m_Highest = NumericTraits<TPixel>::NonpositiveMin();
  }
  std::mutex mutex;
  parallelize(static_cast<SizeValueType>(blocksY * CountBlocks(m_SlabEnd - m_SlabBegin)), [&](SizeValueType n) {
    const std::ptrdiff_t block = m_SlabBegin / BlockLength * blocksY + static_cast<std::ptrdiff_t>(n);
    const std::ptrdiff_t row = block % blocksY * BlockLength;
    const std::ptrdiff_t slice = block / blocksY * BlockLength;
    TPixel               lowest = NumericTraits<TPixel>::max();
    TPixel               highest = NumericTraits<TPixel>::NonpositiveMin();
    kernels.findBlockMaxima(m_Voxels + ((slice - m_FirstBufferedSlice) * y + row) * x,
                            x,
                            std::min(BlockLength, y - row),
                            std::min(BlockLength, m_SlabEnd - slice),
                            x,
                            x * y,
                            maxima.GetPointer<TPixel>() + block * blocksX,
                            lowest,
                            highest);
    const std::lock_guard<std::mutex> lock(mutex);
    m_Lowest = std::min(m_Lowest, lowest);
    m_Highest = std::max(m_Highest, highest);
  });
  m_BlockMaxima = std::move(maxima);
}

template <typename TPixel>
template <typename TParallelize>
void
ShearWarpPreparedVolume<TPixel>::Transpose(const ShearWarp::Kernels<TPixel> & kernels,
                                           const TParallelize &               parallelize,
                                           ShearWarpBuffer                    memory)
{
  const std::ptrdiff_t slice = m_Size[0] * m_Size[1];
  const std::ptrdiff_t first = this->GetFirstTransposedSlice();
  const std::ptrdiff_t count = m_SlabEnd - first;
  memory.Reserve(slice * count * sizeof(TPixel), "the transposed copy of the volume");
  const TPixel * input = m_Voxels + (first - m_FirstBufferedSlice) * slice;
  TPixel *       transposed = memory.GetPointer<TPixel>();
  parallelize(static_cast<SizeValueType>(count), [&](SizeValueType z) {
    kernels.transposeSlice(input + z * slice, m_Size[0], m_Size[1], transposed + z * slice);
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
  const std::ptrdiff_t first = m_FirstBufferedSlice * x * y;
  switch (principalAxis)
  {
    case 0:
      return { m_Transposed.GetPointer<TPixel>(),      y, z, x, x * y, y, m_Lowest, m_Highest,
               this->GetFirstTransposedSlice() * x * y };
    case 1:
      return { m_Voxels, x, z, y, x * y, x, m_Lowest, m_Highest, first };
    default:
      return { m_Voxels, x, y, z, x, x * y, m_Lowest, m_Highest, first };
  }
}

template <typename TPixel>
ShearWarp::Block
ShearWarpPreparedVolume<TPixel>::GetPreparedPart(unsigned int principalAxis) const
{
  switch (principalAxis)
  {
    case 0:
      return { m_SlabBegin, m_SlabEnd, 0, m_Size[0], m_SlabBegin, m_SlabEnd };
    case 1:
      return { m_SlabBegin, m_SlabEnd, 0, m_Size[1], m_SlabBegin, m_SlabEnd };
    default:
      return { 0, m_Size[1], m_SlabBegin, m_SlabEnd, 0, m_Size[1] };
  }
}

template <typename TPixel>
auto
ShearWarpPreparedVolume<TPixel>::GetBlockMaxima(unsigned int principalAxis) const -> BlockMaximaType
{
  const std::ptrdiff_t x = ShearWarp::CountBlocks(m_Size[0]);
  const std::ptrdiff_t y = ShearWarp::CountBlocks(m_Size[1]);
  const std::ptrdiff_t z = ShearWarp::CountBlocks(m_Size[2]);
  const auto *         maxima = m_BlockMaxima.GetPointer<TPixel>();
  switch (principalAxis)
  {
    case 0:
      return { maxima, y, z, x, x, x * y, 1 };
    case 1:
      return { maxima, x, z, y, 1, x * y, x };
    default:
      return { maxima, x, y, z, 1, x, x * y };
  }
}
} // namespace itk

#endif
