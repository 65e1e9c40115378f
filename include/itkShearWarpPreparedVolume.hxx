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
    m_Voxels = image->GetBufferPointer();
    std::copy_n(image->GetBufferedRegion().GetSize().begin(), 3, m_Size);
    this->FindBlockMaxima(kernels, parallelize);
    m_Image = image;
    m_ImageMTime = image->GetMTime();
  }
  if (!this->IsPrepared(image, principalAxis))
  {
    memory.Reserve(m_Size[0] * m_Size[1] * m_Size[2] * sizeof(TPixel));
    this->Transpose(kernels, parallelize, memory.GetPointer<TPixel>());
    m_Transposed = std::move(memory);
  }
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
ShearWarpPreparedVolume<TPixel>::FindBlockMaxima(const ShearWarp::Kernels<TPixel> & kernels,
                                                 const TParallelize &               parallelize)
{
  using ShearWarp::BlockLength;
  using ShearWarp::CountBlocks;
  const std::ptrdiff_t x = m_Size[0];
  const std::ptrdiff_t y = m_Size[1];
  const std::ptrdiff_t z = m_Size[2];
  const std::ptrdiff_t blocksX = CountBlocks(x);
  const std::ptrdiff_t blocksY = CountBlocks(y);
  const std::ptrdiff_t blocksZ = CountBlocks(z);
  ShearWarpBuffer      maxima;
  maxima.Reserve(blocksX * blocksY * blocksZ * sizeof(TPixel));

  m_Lowest = NumericTraits<TPixel>::max();
  m_Highest = NumericTraits<TPixel>::NonpositiveMin();
  std::mutex mutex;
  parallelize(static_cast<SizeValueType>(blocksY * blocksZ), [&](SizeValueType n) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(n) % blocksY * BlockLength;
    const std::ptrdiff_t slice = static_cast<std::ptrdiff_t>(n) / blocksY * BlockLength;
    TPixel               lowest = NumericTraits<TPixel>::max();
    TPixel               highest = NumericTraits<TPixel>::NonpositiveMin();
    kernels.findBlockMaxima(m_Voxels + (slice * y + row) * x,
                            x,
                            std::min(BlockLength, y - row),
                            std::min(BlockLength, z - slice),
                            x,
                            x * y,
                            maxima.GetPointer<TPixel>() + n * blocksX,
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
                                           TPixel *                           transposed) const
{
  const std::ptrdiff_t slice = m_Size[0] * m_Size[1];
  parallelize(static_cast<SizeValueType>(m_Size[2]), [&](SizeValueType z) {
    kernels.transposeSlice(m_Voxels + z * slice, m_Size[0], m_Size[1], transposed + z * slice);
  });
}

template <typename TPixel>
auto
ShearWarpPreparedVolume<TPixel>::GetSlices(unsigned int principalAxis) const -> SliceStackType
{
  const std::ptrdiff_t x = m_Size[0];
  const std::ptrdiff_t y = m_Size[1];
  const std::ptrdiff_t z = m_Size[2];
  switch (principalAxis)
  {
    case 0:
      return { m_Transposed.GetPointer<TPixel>(), y, z, x, x * y, y, m_Lowest, m_Highest };
    case 1:
      return { m_Voxels, x, z, y, x * y, x, m_Lowest, m_Highest };
    default:
      return { m_Voxels, x, y, z, x, x * y, m_Lowest, m_Highest };
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
