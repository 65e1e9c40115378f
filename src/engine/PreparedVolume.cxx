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
#include <vector>

namespace itk::ShearWarp
{
namespace
{
bool
AreEqual(const VoxelBox & a, const VoxelBox & b)
{
  return std::equal(a.begin, a.begin + 3, b.begin) && std::equal(a.size, a.size + 3, b.size);
}
} // namespace

template <typename TPixel>
bool
PreparedVolume<TPixel>::IsOf(const Voxels<TPixel> & voxels) const
{
  return m_Voxels.owner && m_Voxels.owner == voxels.owner && m_Voxels.version == voxels.version &&
         m_Voxels.data == voxels.data && AreEqual(m_Voxels.box, voxels.box);
}

template <typename TPixel>
void
PreparedVolume<TPixel>::KeepBlockMinima()
{
  if (!m_HasBlockMinima)
  {
    m_BlockExtrema.Release();
    m_HasBlockMinima = true;
  }
}

template <typename TPixel>
void
PreparedVolume<TPixel>::Prepare(const Voxels<TPixel> &  voxels,
                                const VoxelBox &        whole,
                                unsigned int            principalAxis,
                                bool                    hasBlockExtrema,
                                const Kernels<TPixel> & kernels,
                                const RunTasks &        run)
{
  Buffer memory;
  if (!this->IsOf(voxels))
  {
    // the next copy can have the memory of the last one
    memory = std::move(m_Transposed);
  }
  this->SetVoxels(voxels, whole);
  if (hasBlockExtrema && m_BlockExtrema.GetSizeInBytes() == 0)
  {
    this->FindBlockExtrema(kernels, run);
  }
  if (principalAxis == 0 && m_Transposed.GetSizeInBytes() == 0)
  {
    this->Transpose(kernels, run, std::move(memory));
  }
}

template <typename TPixel>
void
PreparedVolume<TPixel>::PreparePiece(const Voxels<TPixel> &  voxels,
                                     const VoxelBox &        whole,
                                     const SliceRange &      slices,
                                     unsigned int            principalAxis,
                                     bool                    hasBlockExtrema,
                                     const Kernels<TPixel> & kernels,
                                     const RunTasks &        run)
{
  m_Voxels = {};
  Buffer memory = std::move(m_Transposed);
  // rows along z need the slice before
  const std::ptrdiff_t begin = principalAxis == 2 ? slices.begin : std::max(slices.begin - 1, voxels.box.begin[2]);
  this->SetPiece(voxels, whole, { begin, slices.end });
  if (hasBlockExtrema)
  {
    this->FindBlockExtrema(kernels, run);
  }
  if (principalAxis == 0)
  {
    this->Transpose(kernels, run, std::move(memory));
  }
}

template <typename TPixel>
void
PreparedVolume<TPixel>::SetVoxels(const Voxels<TPixel> & voxels, const VoxelBox & whole)
{
  if (this->IsOf(voxels))
  {
    this->SetEnds(whole);
    return;
  }
  this->Release();
  this->SetPiece(voxels, whole, { voxels.box.begin[2], voxels.box.begin[2] + voxels.box.size[2] });
  m_Voxels = voxels;
  m_ProjectedAxes = 0;
}

template <typename TPixel>
void
PreparedVolume<TPixel>::SetPiece(const Voxels<TPixel> & voxels, const VoxelBox & whole, const SliceRange & slices)
{
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    m_Begin[axis] = voxels.box.begin[axis];
    m_Size[axis] = voxels.box.size[axis];
  }
  m_First = voxels.data + (slices.begin - m_Begin[2]) * m_Size[0] * m_Size[1];
  m_Begin[2] = slices.begin;
  m_Size[2] = slices.end - slices.begin;
  this->SetEnds(whole);
  m_Lowest = std::numeric_limits<TPixel>::lowest();
  m_Highest = std::numeric_limits<TPixel>::max();
}

template <typename TPixel>
void
PreparedVolume<TPixel>::SetEnds(const VoxelBox & whole)
{
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    m_Ends[axis] = { m_Begin[axis] == 0, m_Begin[axis] + m_Size[axis] == whole.size[axis] };
  }
}

template <typename TPixel>
void
PreparedVolume<TPixel>::Release()
{
  m_Voxels = {};
  m_Transposed.Release();
  m_BlockExtrema.Release();
}

template <typename TPixel>
void
PreparedVolume<TPixel>::FindBlockExtrema(const Kernels<TPixel> & kernels, const RunTasks & run)
{
  const std::ptrdiff_t x = m_Size[0];
  const std::ptrdiff_t y = m_Size[1];
  const std::ptrdiff_t blocksX = CountBlocks(x);
  const std::ptrdiff_t blocksY = CountBlocks(y);
  Buffer               maxima = std::move(m_BlockExtrema);
  const std::ptrdiff_t blocks = blocksX * blocksY * CountBlocks(m_Size[2]);
  maxima.Reserve(blocks * (m_HasBlockMinima ? 2 : 1) * sizeof(TPixel), "the block maxima");
  TPixel * const      first = maxima.GetPointer<TPixel>();
  const auto          rows = static_cast<std::size_t>(blocksY * CountBlocks(m_Size[2]));
  std::vector<TPixel> lowest(rows, std::numeric_limits<TPixel>::max());
  std::vector<TPixel> highest(rows, std::numeric_limits<TPixel>::lowest());
  run(rows, 1, [&](std::size_t n, std::size_t, std::size_t) {
    const auto           block = static_cast<std::ptrdiff_t>(n);
    const std::ptrdiff_t row = block % blocksY * BlockLength;
    const std::ptrdiff_t slice = block / blocksY * BlockLength;
    kernels.findBlockExtrema(m_First + (slice * y + row) * x,
                             x,
                             std::min(BlockLength, y - row),
                             std::min(BlockLength, m_Size[2] - slice),
                             x,
                             x * y,
                             first + block * blocksX,
                             m_HasBlockMinima ? first + blocks + block * blocksX : nullptr,
                             lowest[n],
                             highest[n]);
  });
  m_Lowest = *std::min_element(lowest.begin(), lowest.end());
  m_Highest = *std::max_element(highest.begin(), highest.end());
  m_BlockExtrema = std::move(maxima);
}

template <typename TPixel>
void
PreparedVolume<TPixel>::Transpose(const Kernels<TPixel> & kernels, const RunTasks & run, Buffer memory)
{
  const std::ptrdiff_t slice = m_Size[0] * m_Size[1];
  const std::size_t    bytes = slice * m_Size[2] * sizeof(TPixel);
  memory.Reserve(bytes, "the transposed copy of the volume");
  TPixel * transposed = memory.GetPointer<TPixel>();
  // a small copy stays in the last cache
  const bool isStreamed = bytes > std::size_t{ 1 } << 25;
  run(static_cast<std::size_t>(m_Size[2]), 1, [&](std::size_t z, std::size_t, std::size_t) {
    kernels.transposeSlice(m_First + z * slice, m_Size[0], m_Size[1], transposed + z * slice, isStreamed);
  });
  m_Transposed = std::move(memory);
}

template <typename TPixel>
SliceStack<TPixel>
PreparedVolume<TPixel>::GetSlices(unsigned int principalAxis) const
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
      return { m_First, x, z, y, x * y, x, m_Lowest, m_Highest, m_Ends[0], m_Ends[2] };
    default:
      return { m_First, x, y, z, x, x * y, m_Lowest, m_Highest, m_Ends[0], m_Ends[1] };
  }
}

template <typename TPixel>
Corner
PreparedVolume<TPixel>::GetCorner(unsigned int principalAxis) const
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
BlockExtrema<TPixel>
PreparedVolume<TPixel>::GetBlockExtrema(unsigned int principalAxis) const
{
  const std::ptrdiff_t x = CountBlocks(m_Size[0]);
  const std::ptrdiff_t y = CountBlocks(m_Size[1]);
  const std::ptrdiff_t z = CountBlocks(m_Size[2]);
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

#define INSTANTIATE(TPixel) template class PreparedVolume<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk::ShearWarp
