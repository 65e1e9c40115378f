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
#include "Exact.h"

#include "kernels/PixelTypes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace itk::ShearWarp
{
namespace
{
/** Narrows [begin, end] to where low <= slope s + offset <= high. */
inline void
ClipRay(double slope, double offset, double low, double high, double & begin, double & end)
{
  if (slope == 0.0)
  {
    end = low <= offset && offset <= high ? end : -std::numeric_limits<double>::infinity();
    return;
  }
  const double ends[] = { (low - offset) / slope, (high - offset) / slope };
  begin = std::max(begin, std::min(ends[0], ends[1]));
  end = std::min(end, std::max(ends[0], ends[1]));
}

/** Returns the nearest slice if only the tolerance of limits lies between, so that a ray that ends there does not see
 * the next slice's voxels. */
inline double
SnapToSlice(double place)
{
  const double slice = std::round(place);
  return std::abs(place - slice) <= 2e-9 ? slice : place;
}

template <typename TPixel>
TPixel
RoundToPixel(ExactNumber<TPixel> value)
{
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    return static_cast<TPixel>(value) + TPixel{ 0 };
  }
  else
  {
    using Limits = std::numeric_limits<TPixel>;
    using Number = ExactNumber<TPixel>;
    const Number whole = std::floor(value);
    const Number rounded = value - whole >= Number(0.5) ? whole + 1 : whole;
    return rounded >= static_cast<Number>(Limits::max())      ? Limits::max()
           : rounded <= static_cast<Number>(Limits::lowest()) ? Limits::lowest()
                                                              : static_cast<TPixel>(rounded);
  }
}
/** The rays of some tiles beside each other in the sheared grid, and their extrema. */
template <typename TPixel>
class RaySearch
{
public:
  using Number = ExactNumber<TPixel>;

  static constexpr std::size_t MostRays = 8192;

  RaySearch(const ExactView<TPixel> &         view,
            const Kernels<TPixel> &           kernels,
            const IntermediateImage<TPixel> & guess,
            const Picture<TPixel> &           picture,
            std::ptrdiff_t                    column,
            std::ptrdiff_t                    row,
            std::ptrdiff_t                    tiles)
    : m_View(view)
    , m_Kernels(kernels)
    , m_Guess(guess)
    , m_Picture(picture)
    , m_Column(column)
    , m_Row(row)
    , m_Tiles(tiles)
  {}

  /** Takes the ray of \a pixel if it begins in one of the tiles and meets the volume. */
  void
  Add(double p, double q, std::ptrdiff_t pixel);

  /** Sets the pixels of the rays, and forgets these. */
  void
  SetPixels();

private:
  static constexpr double Nowhere = std::numeric_limits<double>::infinity();

  struct Ray
  {
    double         p, q, begin, end;
    std::ptrdiff_t pixel;
    std::size_t    cell;
  };

  /** The best values of rays, and their slices. */
  struct Extrema
  {
    std::vector<Number> best;
    std::vector<double> places;
  };

  void
  Sort();

  ExactTile<TPixel>
  GetTile(std::ptrdiff_t tile, bool isMinimum, Extrema & extrema);

  void
  FindExtrema(bool isMinimum, Extrema & extrema);

  /** The slice that the nearest pixel of the guess had, or the ray's first one. */
  RayPart
  FindGuess(std::size_t ray) const;

  /** Whether voxels may make a ray of the tile better, from slice \a first to \a last. */
  bool
  MayBeBetter(const ExactTile<TPixel> & tile, TPixel least, std::ptrdiff_t first, std::ptrdiff_t last) const;

  const ExactView<TPixel> &         m_View;
  const Kernels<TPixel> &           m_Kernels;
  const IntermediateImage<TPixel> & m_Guess;
  const Picture<TPixel> &           m_Picture;
  std::ptrdiff_t                    m_Column, m_Row, m_Tiles;
  std::vector<Ray>                  m_Rays;
  std::vector<std::int32_t>         m_CellBegins; // of tile by tile
  std::vector<std::uint16_t>        m_Cells;
  std::vector<double>               m_P, m_Q, m_Begin, m_End;
  std::vector<RayPart>              m_Parts;
  std::vector<TPixel>               m_Least;
  std::vector<std::int16_t>         m_LeastLevels;
  Extrema                           m_Maxima, m_Minima;
};

template <typename TPixel>
void
RaySearch<TPixel>::Add(double p, double q, std::ptrdiff_t pixel)
{
  const double column = std::floor(p) - static_cast<double>(m_Column);
  const double row = std::floor(q) - static_cast<double>(m_Row);
  if (!(column >= 0.0 && column < static_cast<double>(m_Tiles * CellColumns) && row >= 0.0 &&
        row < static_cast<double>(CellRows)))
  {
    return;
  }
  const double         position[] = { p, q };
  const std::ptrdiff_t lengths[] = { m_View.slices.columns, m_View.slices.rows };
  double               begin = -0.5;
  double               end = static_cast<double>(m_View.slices.slices) - 0.5;
  for (int axis = 0; axis < 2; ++axis)
  {
    const double offset = position[axis] - m_View.translation[axis];
    ClipRay(-m_View.shear[axis], offset, -0.5, static_cast<double>(lengths[axis]) - 0.5, begin, end);
  }
  for (const auto & [function, low, high] : m_View.intervals)
  {
    ClipRay(function.perSlice, function(p, q, 0.0), low, high, begin, end);
  }
  if (begin <= end)
  {
    if (!m_View.intervals.empty())
    {
      begin = SnapToSlice(begin);
      end = SnapToSlice(end);
    }
    const auto tile = static_cast<std::size_t>(column) / CellColumns;
    const auto cell =
      (tile * CellRows + static_cast<std::size_t>(row)) * CellColumns + static_cast<std::size_t>(column) % CellColumns;
    m_Rays.push_back({ p, q, begin, end, pixel, cell });
    if (m_Rays.size() == MostRays)
    {
      this->SetPixels();
    }
  }
}

template <typename TPixel>
void
RaySearch<TPixel>::Sort()
{
  const std::size_t         count = m_Rays.size();
  std::vector<std::int32_t> ends(m_Tiles * CellRows * CellColumns + 1);
  for (const Ray & ray : m_Rays)
  {
    ++ends[ray.cell + 1];
  }
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  m_CellBegins = ends;
  std::vector<Ray> sorted(count);
  m_Cells.resize(count);
  for (std::vector<double> * const numbers : { &m_P, &m_Q, &m_Begin, &m_End })
  {
    numbers->resize(count);
  }
  for (const Ray & ray : m_Rays)
  {
    const std::int32_t place = ends[ray.cell]++;
    sorted[place] = ray;
    m_Cells[place] = static_cast<std::uint16_t>(ray.cell % (CellRows * CellColumns));
    m_P[place] = ray.p;
    m_Q[place] = ray.q;
    m_Begin[place] = ray.begin;
    m_End[place] = ray.end;
  }
  m_Rays.swap(sorted);
}

template <typename TPixel>
ExactTile<TPixel>
RaySearch<TPixel>::GetTile(std::ptrdiff_t tile, bool isMinimum, Extrema & extrema)
{
  return { m_Column + tile * CellColumns,
           m_Row,
           isMinimum,
           m_Picture.depths != nullptr,
           m_CellBegins.data() + tile * CellRows * CellColumns,
           m_Cells.data(),
           m_P.data(),
           m_Q.data(),
           m_Begin.data(),
           m_End.data(),
           extrema.best.data(),
           extrema.places.data(),
           m_Least.data() + tile * CellRows * CellColumns,
           m_LeastLevels.data() + tile * CellRows * CellColumns };
}

template <typename TPixel>
RayPart
RaySearch<TPixel>::FindGuess(std::size_t ray) const
{
  const auto column = static_cast<std::ptrdiff_t>(std::floor(m_P[ray] + 0.5));
  const auto row = static_cast<std::ptrdiff_t>(std::floor(m_Q[ray] + 0.5));
  double     slice = std::floor(m_Begin[ray]);
  if (row >= 0 && row < m_Guess.rows && column >= m_Guess.reached[row].begin && column < m_Guess.reached[row].end)
  {
    const std::int32_t guess = m_Guess.slices[row * m_Guess.rowStride + column];
    const auto         position = static_cast<double>(guess);
    slice = guess != NoSlice && m_Begin[ray] <= position + 1.0 && position <= m_End[ray] ? position : slice;
  }
  return { static_cast<std::int32_t>(ray), static_cast<std::int32_t>(slice) };
}

template <typename TPixel>
bool
RaySearch<TPixel>::MayBeBetter(const ExactTile<TPixel> & tile,
                               TPixel                    least,
                               std::ptrdiff_t            first,
                               std::ptrdiff_t            last) const
{
  const auto & blocks = m_View.blocks;
  // blocks that the rays may meet, with a voxel more for what rounding errors do
  std::ptrdiff_t       begin[3], end[3];
  const std::ptrdiff_t lengths[] = { m_View.slices.columns, m_View.slices.rows };
  const std::ptrdiff_t low[] = { tile.column, tile.row };
  const std::ptrdiff_t high[] = { tile.column + CellColumns, tile.row + CellRows };
  for (int axis = 0; axis < 2; ++axis)
  {
    const double offsets[] = { m_View.shear[axis] * static_cast<double>(first) + m_View.translation[axis],
                               m_View.shear[axis] * static_cast<double>(last) + m_View.translation[axis] };
    const auto   find = [&](double position) {
      return static_cast<std::ptrdiff_t>(std::clamp(position, 0.0, static_cast<double>(lengths[axis] - 1))) /
             BlockLength;
    };
    begin[axis] = find(static_cast<double>(low[axis]) - std::max(offsets[0], offsets[1]) - 1.0);
    end[axis] = find(static_cast<double>(high[axis]) - std::min(offsets[0], offsets[1]) + 2.0) + 1;
  }
  begin[2] = std::max<std::ptrdiff_t>(first, 0) / BlockLength;
  end[2] = std::min(begin[2] + 2, blocks.slices);
  const TPixel * const extrema = tile.isMinimum ? blocks.minima : blocks.maxima;
  for (std::ptrdiff_t slice = begin[2]; slice < end[2]; ++slice)
  {
    for (std::ptrdiff_t row = begin[1]; row < end[1]; ++row)
    {
      for (std::ptrdiff_t column = begin[0]; column < end[0]; ++column)
      {
        const TPixel voxel =
          extrema[column * blocks.columnStride + row * blocks.rowStride + slice * blocks.sliceStride];
        if ((tile.isMinimum ? voxel < least : voxel > least) || (tile.hasDepth && voxel == least))
        {
          return true;
        }
      }
    }
  }
  return false;
}

template <typename TPixel>
void
RaySearch<TPixel>::FindExtrema(bool isMinimum, Extrema & extrema)
{
  const std::size_t count = m_Rays.size();
  extrema.best.assign(count, -std::numeric_limits<Number>::infinity());
  extrema.places.assign(count, m_View.depth.perSlice < 0 ? -Nowhere : Nowhere);
  m_Least.resize(m_Tiles * CellRows * CellColumns);
  m_LeastLevels.resize(m_Least.size());
  struct TileState
  {
    ExactTile<TPixel> tile;
    TPixel            least;
    double            nearest, farthest;
  };
  std::vector<TileState> tiles;
  for (std::ptrdiff_t n = 0; n < m_Tiles; ++n)
  {
    const ExactTile<TPixel> tile = this->GetTile(n, isMinimum, extrema);
    const std::size_t       first = tile.cellBegins[0];
    const std::size_t       last = tile.cellBegins[CellRows * CellColumns];
    if (first == last)
    {
      continue;
    }
    m_Parts.clear();
    for (std::size_t ray = first; ray < last; ++ray)
    {
      m_Parts.push_back(this->FindGuess(ray));
    }
    const TPixel least = m_Kernels.evaluateParts(m_View, tile, m_Parts.data(), m_Parts.size());
    tiles.push_back({ tile,
                      least,
                      *std::min_element(m_Begin.begin() + first, m_Begin.begin() + last),
                      *std::max_element(m_End.begin() + first, m_End.begin() + last) });
  }
  for (std::ptrdiff_t slab = 0; slab < m_View.blocks.slices; ++slab)
  {
    // half a voxel before the first slice and behind the last one too
    const std::ptrdiff_t first = slab == 0 ? -1 : slab * BlockLength;
    const std::ptrdiff_t last = std::min((slab + 1) * BlockLength, m_View.slices.slices);
    for (auto & [tile, least, nearest, farthest] : tiles)
    {
      if (nearest <= static_cast<double>(last) && farthest >= static_cast<double>(first) &&
          this->MayBeBetter(tile, least, first, last))
      {
        least = m_Kernels.searchSlab(m_View, tile, first, last);
      }
    }
  }
}

template <typename TPixel>
void
RaySearch<TPixel>::SetPixels()
{
  this->Sort();
  if (m_View.extremum != Extremum::Minimum)
  {
    this->FindExtrema(false, m_Maxima);
  }
  if (m_View.extremum != Extremum::Maximum)
  {
    this->FindExtrema(true, m_Minima);
  }
  for (std::size_t n = 0; n < m_Rays.size(); ++n)
  {
    const bool isMinimum = m_View.extremum == Extremum::Minimum ||
                           (m_View.extremum == Extremum::Magnitude && m_Minima.best[n] > m_Maxima.best[n]);
    const auto & [best, places] = isMinimum ? m_Minima : m_Maxima;
    if (best[n] == -std::numeric_limits<Number>::infinity())
    {
      continue;
    }
    const auto & [p, q, begin, end, pixel, cell] = m_Rays[n];
    m_Picture.pixels[pixel] = RoundToPixel<TPixel>(isMinimum ? -best[n] : best[n]);
    if (m_Picture.depths)
    {
      m_Picture.depths[pixel] = static_cast<float>(m_View.depth(p, q, places[n])) + 0.0f;
    }
  }
  m_Rays.clear();
}

/** The most tasks of one tile. */
constexpr std::ptrdiff_t MostParts = 256;

/** A number of rows or columns, of a double that may be anything. */
std::ptrdiff_t
LimitTo(double v, std::ptrdiff_t count)
{
  return v >= static_cast<double>(count) ? count : v >= 0.0 ? static_cast<std::ptrdiff_t>(v) : 0;
}

/** The pixels that \a map may take to [low, high), in each of both dimensions: rows, or columns of a row. */
class PixelsOfCells
{
public:
  PixelsOfCells(const AffineMap2D & map, const double (&low)[2], const double (&high)[2])
    : m_Map(map)
    , m_Low{ low[0] - Slack, low[1] - Slack }
    , m_High{ high[0] + Slack, high[1] + Slack }
  {}

  std::pair<std::ptrdiff_t, std::ptrdiff_t>
  FindRows(std::ptrdiff_t rows) const
  {
    const double determinant = m_Map.xx * m_Map.yy - m_Map.xy * m_Map.yx;
    double       least = std::numeric_limits<double>::infinity();
    double       most = -least;
    for (const double p : { m_Low[0], m_High[0] })
    {
      for (const double q : { m_Low[1], m_High[1] })
      {
        const double row = (m_Map.xx * (q - m_Map.y0) - m_Map.yx * (p - m_Map.x0)) / determinant;
        least = std::min(least, row);
        most = std::max(most, row);
      }
    }
    return { LimitTo(least - 1.0, rows), LimitTo(most + 2.0, rows) };
  }

  std::pair<std::ptrdiff_t, std::ptrdiff_t>
  FindColumns(std::ptrdiff_t row, std::ptrdiff_t columns) const
  {
    double     begin = 0.0;
    auto       end = static_cast<double>(columns);
    const auto y = static_cast<double>(row);
    ClipRay(m_Map.xx, m_Map.xy * y + m_Map.x0, m_Low[0], m_High[0], begin, end);
    ClipRay(m_Map.yx, m_Map.yy * y + m_Map.y0, m_Low[1], m_High[1], begin, end);
    return { LimitTo(begin - 1.0, columns), LimitTo(end + 2.0, columns) };
  }

private:
  /** A pixel whose place is on a border, but for rounding errors, is a pixel of both sides. */
  static constexpr double Slack = 0.01;

  AffineMap2D m_Map;
  double      m_Low[2], m_High[2];
};
} // namespace

template <typename TPixel>
void
ProjectExactly(const ExactView<TPixel> &         view,
               const Kernels<TPixel> &           kernels,
               const IntermediateImage<TPixel> & guess,
               std::ptrdiff_t                    columns,
               std::ptrdiff_t                    rows,
               const Picture<TPixel> &           picture,
               const Threads &                   threads,
               float                             share)
{
  threads.run(rows, 1, 0.0f, [&](SizeValueType row, SizeValueType, SizeValueType) {
    const auto first = static_cast<std::ptrdiff_t>(row) * columns;
    std::fill_n(picture.pixels + first, columns, view.background);
    if (picture.depths)
    {
      std::fill_n(picture.depths + first, columns, std::numeric_limits<float>::quiet_NaN());
    }
  });
  // cells that rays may be in, with one more for what rounding errors do
  const std::ptrdiff_t lengths[] = { view.slices.columns, view.slices.rows };
  std::ptrdiff_t       first[2], counts[2];
  for (int axis = 0; axis < 2; ++axis)
  {
    const double shift = view.shear[axis] * static_cast<double>(view.slices.slices);
    first[axis] = static_cast<std::ptrdiff_t>(std::floor(view.translation[axis] + std::min(shift, 0.0))) - 2;
    counts[axis] = lengths[axis] + static_cast<std::ptrdiff_t>(std::ceil(std::abs(shift))) + 4;
  }
  // tiles share what they read; where they have many rays, tasks have some rows of pixels
  const AffineMap2D &  map = view.outputToSheared;
  const double         raysInTile = CellRows * CellColumns / std::abs(map.xx * map.yy - map.xy * map.yx);
  const std::ptrdiff_t tiles = raysInTile > 2048.0 ? 1 : raysInTile > 1024.0 ? 4 : 8;
  const std::ptrdiff_t parts = raysInTile < 16384.0 ? 1 : LimitTo(raysInTile / 8192.0, std::min(rows, MostParts));
  const auto           projectPart = [&](SizeValueType tileRow, SizeValueType tileColumn, SizeValueType) {
    const auto           part = static_cast<std::ptrdiff_t>(tileRow) % parts;
    const std::ptrdiff_t column = first[0] + static_cast<std::ptrdiff_t>(tileColumn) * tiles * CellColumns;
    const std::ptrdiff_t row = first[1] + static_cast<std::ptrdiff_t>(tileRow) / parts * CellRows;
    RaySearch<TPixel>    search(view, kernels, guess, picture, column, row, tiles);
    const double         low[] = { static_cast<double>(column), static_cast<double>(row) };
    const double high[] = { static_cast<double>(column + tiles * CellColumns), static_cast<double>(row + CellRows) };
    const PixelsOfCells pixels(map, low, high);
    const auto [rowBegin, rowEnd] = pixels.FindRows(rows);
    const std::ptrdiff_t count = rowEnd - rowBegin;
    for (std::ptrdiff_t j = rowBegin + count * part / parts; j < rowBegin + count * (part + 1) / parts; ++j)
    {
      const auto [columnBegin, columnEnd] = pixels.FindColumns(j, columns);
      for (std::ptrdiff_t i = columnBegin; i < columnEnd; ++i)
      {
        const auto x = static_cast<double>(i);
        const auto y = static_cast<double>(j);
        search.Add((map.xx * x + map.xy * y) + map.x0, (map.yx * x + map.yy * y) + map.y0, j * columns + i);
      }
    }
    search.SetPixels();
  };
  threads.run(
    CountBlocks(counts[1], CellRows) * parts, CountBlocks(counts[0], tiles * CellColumns), share, projectPart);
}

#define INSTANTIATE(TPixel)                                       \
  template void ProjectExactly(const ExactView<TPixel> &,         \
                               const Kernels<TPixel> &,           \
                               const IntermediateImage<TPixel> &, \
                               std::ptrdiff_t,                    \
                               std::ptrdiff_t,                    \
                               const Picture<TPixel> &,           \
                               const Threads &,                   \
                               float);
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk::ShearWarp
