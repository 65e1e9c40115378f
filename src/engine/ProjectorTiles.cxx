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
#include "Projector.h"

#include "kernels/PixelTypes.h"

#include <algorithm>
#include <functional>
#include <numeric>

namespace itk::ShearWarp
{
/** Notes in `worker.active` which tiles of all images need the samples of at most BlockLength slices. Returns false if
 * too few tiles can be skipped: then all tiles are projected. */
template <typename TPixel>
bool
Projector<TPixel>::SelectTiles(Worker & worker, const Rows & rows, const Block & block)
{
  TileCount tiles{ 0, 0 };
  for (std::size_t image = rows.imageBegin; image < rows.imageEnd; ++image)
  {
    const TileCount count =
      m_Mask.voxels ? this->SelectMaskedTiles(worker, image, block) : this->SelectRaisedTiles(worker, image, block);
    tiles.all += count.all;
    tiles.skipped += count.skipped;
  }
  // memory is faster in one go than in pieces
  const bool isWorthIt = m_Mask.voxels || m_ReducedResampling == ReducedResampling::On || 3 * tiles.skipped > tiles.all;
  worker.tiles += tiles.all;
  worker.skippedTiles += isWorthIt ? tiles.skipped : 0;
  // try again more and more rarely
  worker.untestedCubes = isWorthIt ? 0 : worker.pause;
  worker.pause = isWorthIt ? 0 : std::min<std::ptrdiff_t>(2 * worker.pause + 1, 15);
  return isWorthIt;
}

/** Selects the tiles whose pixels the block's samples may raise. */
template <typename TPixel>
auto
Projector<TPixel>::SelectRaisedTiles(Worker & worker, std::size_t image, const Block & block) -> TileCount
{
  std::vector<TPixel> & columnMaxima = worker.columnMaxima;
  columnMaxima.resize(m_BlockExtrema.columns);
  const TPixel * cubes = m_BlockExtrema.maxima + block.sliceBegin / BlockLength * m_BlockExtrema.sliceStride;
  const auto     findColumnMaxima = [&](Range cubeRows) {
    for (std::ptrdiff_t column = 0; column < m_BlockExtrema.columns; ++column)
    {
      const TPixel * cube = cubes + column * m_BlockExtrema.columnStride + cubeRows.begin * m_BlockExtrema.rowStride;
      TPixel         maximum = *cube;
      for (std::ptrdiff_t n = cubeRows.begin + 1; n < cubeRows.end; ++n)
      {
        cube += m_BlockExtrema.rowStride;
        maximum = std::max(maximum, *cube);
      }
      columnMaxima[column] = maximum;
    }
  };
  const auto getState = [&](Range tileRows, std::ptrdiff_t tileColumn, Range cubeColumns) {
    const TPixel maximum =
      *std::max_element(columnMaxima.data() + cubeColumns.begin, columnMaxima.data() + cubeColumns.end);
    for (std::ptrdiff_t tileRow = tileRows.begin; tileRow < tileRows.end; ++tileRow)
    {
      if (this->IsAnyBelow(worker.images[image], tileRow, tileColumn, maximum))
      {
        return TileState::Whole;
      }
    }
    return TileState::Unneeded;
  };
  return this->ForEachTile(worker, image, block, findColumnMaxima, getState);
}

/** Finds for each tile whether all, some or none of its voxels are in the mask. */
template <typename TPixel>
auto
Projector<TPixel>::SelectMaskedTiles(Worker & worker, std::size_t image, const Block & block) const -> TileCount
{
  constexpr unsigned int in = 1;
  constexpr unsigned int out = 2;
  auto &                 columnParts = worker.columnParts;
  const auto &           blocks = m_BlocksOfMask;
  const unsigned char    label = m_Mask.label;
  const auto             getParts = [&](std::ptrdiff_t cube) {
    const unsigned char highest = blocks.maxima[cube];
    const unsigned char lowest = blocks.minima[cube];
    const bool          mayBeIn = label == 0 ? highest != 0 : lowest <= label && label <= highest;
    const bool          mayBeOut = label == 0 ? lowest == 0 : lowest != label || highest != label;
    return (mayBeIn ? in : 0) | (mayBeOut ? out : 0);
  };
  const std::ptrdiff_t slice = block.sliceBegin / BlockLength * blocks.sliceStride;
  const auto           findColumnParts = [&](Range cubeRows) {
    columnParts.assign(blocks.columns, 0);
    for (std::ptrdiff_t row = cubeRows.begin; row < cubeRows.end; ++row)
    {
      for (std::ptrdiff_t column = 0; column < blocks.columns; ++column)
      {
        columnParts[column] |= getParts(slice + row * blocks.rowStride + column * blocks.columnStride);
      }
    }
  };
  const auto getState = [&](Range, std::ptrdiff_t, Range cubeColumns) {
    const unsigned int parts = std::accumulate(
      columnParts.begin() + cubeColumns.begin, columnParts.begin() + cubeColumns.end, 0U, std::bit_or<>());
    return (parts & in) == 0 ? TileState::Unneeded : parts == in ? TileState::Whole : TileState::Masked;
  };
  return this->ForEachTile(worker, image, block, findColumnParts, getState);
}

/** Returns the rows of the image, and of the volume, that a row of a block's tiles may need. */
template <typename TPixel>
auto
Projector<TPixel>::FindRowsOfTiles(const Block &                       block,
                                   const std::vector<SlicePlacement> & placements,
                                   std::ptrdiff_t                      row) -> RowsOfTiles
{
  const std::ptrdiff_t ofBegin = placements[block.sliceBegin].row.whole;
  const std::ptrdiff_t ofEnd = placements[block.sliceEnd - 1].row.whole;
  const std::ptrdiff_t firstRow = std::min(ofBegin, ofEnd);
  const std::ptrdiff_t lastRow = std::max(ofBegin, ofEnd);
  const std::ptrdiff_t end = std::min(row + BlockLength, block.rowEnd);
  const bool           isOfImage = block.rowsOf == BlockRows::OfImage;
  const bool           isFirst = row == 0 && !isOfImage;
  const bool           isLast = end == block.rows && !isOfImage;
  // a sample needs the row above too; the last row may have the edge's sample
  Range voxels{ row - 1, end };
  Range pixels{ row + firstRow, end + lastRow + isLast };
  if (block.rowsOf != BlockRows::OfSlices)
  {
    const std::ptrdiff_t commonRow = FindFirstRow(block, placements.data(), block.sliceBegin);
    pixels.begin = isFirst ? pixels.begin : row + commonRow;
    pixels.end = isLast ? pixels.end : end + commonRow;
    voxels = { pixels.begin - lastRow - 1, pixels.end - firstRow };
  }
  const auto findCube = [&](std::ptrdiff_t voxelRow) {
    return std::clamp<std::ptrdiff_t>(voxelRow, 0, block.rows - 1) / BlockLength;
  };
  return { pixels, { findCube(voxels.begin), findCube(voxels.end - 1) + 1 } };
}

/** Calls \a beginRow(cubeRows) for each row of the block's tiles. Then sets the state of each tile of the row to
 * \a getState(tileRows, tileColumn, cubeColumns): samples of the tile may need these cubes. */
template <typename TPixel>
template <typename TBeginRow, typename TGetState>
auto
Projector<TPixel>::ForEachTile(Worker &          worker,
                               std::size_t       image,
                               const Block &     block,
                               const TBeginRow & beginRow,
                               const TGetState & getState) const -> TileCount
{
  const auto &             placements = this->GetView(image).placements;
  std::vector<TileState> & active = worker.active[image];
  const std::ptrdiff_t     ofBegin = placements[block.sliceBegin].column.whole;
  const std::ptrdiff_t     ofEnd = placements[block.sliceEnd - 1].column.whole;
  const std::ptrdiff_t     firstColumn = std::min(ofBegin, ofEnd);
  const std::ptrdiff_t     lastColumn = std::max(ofBegin, ofEnd);

  const std::ptrdiff_t blockRows = CountBlocks(block.rowEnd - block.rowBegin);
  active.assign(blockRows * m_TileColumns, TileState::Unneeded);
  TileCount tiles{ 0, 0 };
  for (std::ptrdiff_t blockRow = 0; blockRow < blockRows; ++blockRow)
  {
    const auto [pixels, cubeRows] = FindRowsOfTiles(block, placements, block.rowBegin + blockRow * BlockLength);
    beginRow(cubeRows);
    const Range tileRows{ pixels.begin / BlockLength, std::min((pixels.end - 1) / BlockLength + 1, m_TileRows) };
    for (std::ptrdiff_t tileColumn = firstColumn / TileColumns; tileColumn < m_TileColumns; ++tileColumn)
    {
      const std::ptrdiff_t columnBegin = std::max<std::ptrdiff_t>(tileColumn * TileColumns - lastColumn - 1, 0);
      const std::ptrdiff_t columnEnd = std::min(tileColumn * TileColumns + TileColumns - firstColumn, m_Slices.columns);
      if (tileColumn * TileColumns > lastColumn + m_Slices.columns)
      {
        break;
      }
      const Range cubeColumns{ std::min(columnBegin, m_Slices.columns - 1) / BlockLength,
                               (std::max<std::ptrdiff_t>(columnEnd, 1) - 1) / BlockLength + 1 };
      const auto  state = getState(tileRows, tileColumn, cubeColumns);
      active[blockRow * m_TileColumns + tileColumn] = state;
      ++tiles.all;
      tiles.skipped += state == TileState::Unneeded;
    }
  }
  return tiles;
}

/** Returns whether a pixel of a tile is below \a value. Pixels only rise, so a lower bound stays one. */
template <typename TPixel>
bool
Projector<TPixel>::IsAnyBelow(ThreadImage &  image,
                              std::ptrdiff_t tileRow,
                              std::ptrdiff_t tileColumn,
                              TPixel         value) const
{
  TPixel & lowerBound = image.lowerBounds[tileRow * m_TileColumns + tileColumn];
  if (value <= lowerBound)
  {
    return false;
  }
  const TPixel * pixels =
    image.pixels.template GetPointer<TPixel>() + tileRow * BlockLength * m_RowStride + tileColumn * TileColumns;
  if (m_Kernels->isAnyBelow(pixels, m_RowStride, BlockLength, TileColumns, value))
  {
    return true;
  }
  lowerBound = value;
  return false;
}

#define INSTANTIATE(TPixel) template bool Projector<TPixel>::SelectTiles(Worker &, const Rows &, const Block &);
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk::ShearWarp
