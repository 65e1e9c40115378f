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
#include "itkShearWarpExact.h"

#include "itkShearWarpPixelTypes.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace itk::ShearWarp
{
namespace
{
/** The largest integer that is not above \a v >= -1, but for rounding errors. */
std::ptrdiff_t
Floor(double v)
{
  return static_cast<std::ptrdiff_t>(v + 2.0) - 2;
}

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

/** The rays of a tile of a picture, and their maxima or, with the sign of all voxels changed, minima. */
template <typename TPixel>
class ExactTile
{
public:
  using Number = ExactNumber<TPixel>;

  ExactTile(const ExactView<TPixel> & view, const Kernels<TPixel> & kernels, bool hasDepth)
    : m_View(view)
    , m_Kernels(kernels)
    , m_HasDepth(hasDepth)
  {}

  /** A ray of sheared column \a p and row \a q, and of slices [begin, end]. */
  void
  Add(double p, double q, double begin, double end, std::ptrdiff_t pixel)
  {
    m_P.push_back(p);
    m_Q.push_back(q);
    m_Begin.push_back(begin);
    m_End.push_back(end);
    pixels.push_back(pixel);
  }

  void
  Project(bool isMinimum, const IntermediateImage<TPixel> & guess);

  double
  GetDepth(std::size_t ray) const
  {
    return m_View.depth(m_P[ray], m_Q[ray], places[ray]);
  }

  std::vector<std::ptrdiff_t> pixels;
  std::vector<Number>         best;   // minus infinity where there is none
  std::vector<double>         places; // the slices

private:
  static constexpr double Nowhere = std::numeric_limits<double>::infinity();

  Number
  SampleAt(std::size_t ray, std::ptrdiff_t slice, bool isMinimum) const;

  Number
  FindLowerBound(std::size_t ray, bool isMinimum, const IntermediateImage<TPixel> & guess) const;

  void
  ProjectSlabs(bool isMinimum);

  const ExactView<TPixel> & m_View;
  const Kernels<TPixel> &   m_Kernels;
  bool                      m_HasDepth;
  std::vector<double>       m_P, m_Q, m_Begin, m_End;
  std::vector<std::int32_t> m_Cells;
  std::vector<Number>       m_Bounds;
  std::vector<TPixel>       m_Extrema, m_Line;
};

/** The interpolant where the ray meets a slice, but for rounding errors not above it. */
template <typename TPixel>
auto
ExactTile<TPixel>::SampleAt(std::size_t ray, std::ptrdiff_t slice, bool isMinimum) const -> Number
{
  const SliceStack<TPixel> & slices = m_View.slices;
  const auto                 s = static_cast<double>(slice);
  const double               x = m_P[ray] - (m_View.shear[0] * s + m_View.translation[0]);
  const double               y = m_Q[ray] - (m_View.shear[1] * s + m_View.translation[1]);
  const std::ptrdiff_t       column = Floor(x);
  const std::ptrdiff_t       row = Floor(y);
  const TPixel *             voxels = slices.voxels + slice * slices.sliceStride;
  Number                     values[4];
  Number                     magnitude = 0;
  for (int n = 0; n < 4; ++n)
  {
    const TPixel voxel = voxels[std::clamp<std::ptrdiff_t>(row + n / 2, 0, slices.rows - 1) * slices.rowStride +
                                std::clamp<std::ptrdiff_t>(column + n % 2, 0, slices.columns - 1)];
    values[n] = isMinimum ? -static_cast<Number>(voxel) : static_cast<Number>(voxel);
    magnitude = std::max(magnitude, std::abs(values[n]));
  }
  const auto mix = [](Number a, Number b, Number u) { return a + u * (b - a); };
  const auto u = static_cast<Number>(x - static_cast<double>(column));
  const auto v = static_cast<Number>(y - static_cast<double>(row));
  return mix(mix(values[0], values[1], u), mix(values[2], values[3], u), v) -
         64 * std::numeric_limits<Number>::epsilon() * magnitude;
}

/** The best sample of the ray in the slices that the pixels around it had. */
template <typename TPixel>
auto
ExactTile<TPixel>::FindLowerBound(std::size_t ray, bool isMinimum, const IntermediateImage<TPixel> & guess) const
  -> Number
{
  Number       bound = -std::numeric_limits<Number>::infinity();
  std::int32_t last = NoSlice;
  for (int n = 0; n < 4; ++n)
  {
    const std::ptrdiff_t column = Floor(m_P[ray]) + n % 2;
    const std::ptrdiff_t row = Floor(m_Q[ray]) + n / 2;
    if (row < 0 || row >= guess.rows || column < guess.reached[row].begin || column >= guess.reached[row].end)
    {
      continue;
    }
    const std::int32_t slice = guess.slices[row * guess.rowStride + column];
    const auto         position = static_cast<double>(slice);
    if (slice != NoSlice && slice != last && m_Begin[ray] <= position && position <= m_End[ray])
    {
      const Number sample = this->SampleAt(ray, slice, isMinimum);
      bound = sample > bound ? sample : bound;
      last = slice;
    }
  }
  return bound;
}

template <typename TPixel>
void
ExactTile<TPixel>::Project(bool isMinimum, const IntermediateImage<TPixel> & guess)
{
  const std::size_t count = pixels.size();
  const double      nowhere = m_View.depth.perSlice < 0 ? -Nowhere : Nowhere;
  places.assign(count, nowhere);
  best.resize(count);
  for (std::size_t ray = 0; ray < count; ++ray)
  {
    best[ray] = this->FindLowerBound(ray, isMinimum, guess);
  }
  this->ProjectSlabs(isMinimum);
  // cells that are left out may be around such a sample
  bool isAnyLeft = false;
  for (std::size_t ray = 0; ray < count; ++ray)
  {
    if (places[ray] == nowhere && best[ray] != -std::numeric_limits<Number>::infinity())
    {
      best[ray] = -std::numeric_limits<Number>::infinity();
      isAnyLeft = true;
    }
  }
  if (isAnyLeft)
  {
    this->ProjectSlabs(isMinimum);
  }
}

template <typename TPixel>
void
ExactTile<TPixel>::ProjectSlabs(bool isMinimum)
{
  const std::size_t count = pixels.size();
  if (count == 0)
  {
    return;
  }
  const auto [lowP, highP] = std::minmax_element(m_P.begin(), m_P.end());
  const auto [lowQ, highQ] = std::minmax_element(m_Q.begin(), m_Q.end());
  const double     low[] = { *lowP, *lowQ };
  const double     high[] = { *highP, *highQ };
  CellGrid<TPixel> cells{ Floor(low[0]), Floor(low[1]), 0, 0, 0, nullptr, nullptr, nullptr };
  cells.columns = Floor(high[0]) - cells.column + 1;
  cells.rows = Floor(high[1]) - cells.row + 1;
  cells.stride = cells.columns + CellReach;
  m_Cells.resize(count);
  for (std::size_t ray = 0; ray < count; ++ray)
  {
    m_Cells[ray] =
      static_cast<std::int32_t>((Floor(m_Q[ray]) - cells.row) * cells.columns + Floor(m_P[ray]) - cells.column);
  }
  m_Bounds.resize(cells.rows * cells.columns);
  m_Extrema.resize((cells.rows + CellReach) * cells.stride);
  m_Line.resize(cells.stride);
  cells.bounds = m_Bounds.data();
  cells.extrema = m_Extrema.data();
  cells.line = m_Line.data();
  const ExactRays<TPixel> rays{ static_cast<std::ptrdiff_t>(count),
                                m_P.data(),
                                m_Q.data(),
                                m_Begin.data(),
                                m_End.data(),
                                m_Cells.data(),
                                best.data(),
                                places.data() };
  const double            nearest = *std::min_element(m_Begin.begin(), m_Begin.end());
  const double            farthest = *std::max_element(m_End.begin(), m_End.end());
  const auto &            blocks = m_View.blocks;
  const TPixel * const    extrema = isMinimum ? blocks.minima : blocks.maxima;
  for (std::ptrdiff_t slab = 0; slab < blocks.slices; ++slab)
  {
    // half a voxel before the first slice and behind the last one too
    const std::ptrdiff_t first = slab == 0 ? -1 : slab * BlockLength;
    const std::ptrdiff_t last = std::min((slab + 1) * BlockLength, m_View.slices.slices);
    if (nearest > static_cast<double>(last) || farthest < static_cast<double>(first))
    {
      continue;
    }
    // blocks that the rays may meet, with a voxel more for what rounding errors do
    std::ptrdiff_t       begin[2], end[2];
    const std::ptrdiff_t lengths[] = { m_View.slices.columns, m_View.slices.rows };
    for (int axis = 0; axis < 2; ++axis)
    {
      const double offsets[] = { m_View.shear[axis] * static_cast<double>(first) + m_View.translation[axis],
                                 m_View.shear[axis] * static_cast<double>(last) + m_View.translation[axis] };
      const auto   find = [&](double position) {
        return static_cast<std::ptrdiff_t>(std::clamp(position, 0.0, static_cast<double>(lengths[axis] - 1))) /
               BlockLength;
      };
      begin[axis] = find(low[axis] - std::max(offsets[0], offsets[1]) - 1.0);
      end[axis] = find(high[axis] - std::min(offsets[0], offsets[1]) + 2.0) + 1;
    }
    Number highest = -std::numeric_limits<Number>::infinity();
    for (std::ptrdiff_t slice = slab; slice < std::min(slab + 2, blocks.slices); ++slice)
    {
      for (std::ptrdiff_t row = begin[1]; row < end[1]; ++row)
      {
        for (std::ptrdiff_t column = begin[0]; column < end[0]; ++column)
        {
          const auto bound = static_cast<Number>(
            extrema[column * blocks.columnStride + row * blocks.rowStride + slice * blocks.sliceStride]);
          highest = std::max(highest, isMinimum ? -bound : bound);
        }
      }
    }
    const Number least = *std::min_element(best.begin(), best.end());
    if (highest > least || (m_HasDepth && highest == least))
    {
      m_Kernels.maximizeOnRays(m_View, isMinimum, m_HasDepth, rays, cells, first, last);
    }
  }
}

template <typename TPixel>
TPixel
RoundToPixel(ExactNumber<TPixel> value)
{
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    return static_cast<TPixel>(value + 0.0);
  }
  else
  {
    using Limits = std::numeric_limits<TPixel>;
    using Number = ExactNumber<TPixel>;
    const Number rounded = std::floor(value + Number(0.5));
    return rounded >= static_cast<Number>(Limits::max())      ? Limits::max()
           : rounded <= static_cast<Number>(Limits::lowest()) ? Limits::lowest()
                                                              : static_cast<TPixel>(rounded);
  }
}
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
  using Number = ExactNumber<TPixel>;
  constexpr double         infinity = std::numeric_limits<double>::infinity();
  constexpr std::ptrdiff_t tileColumns = 32;
  constexpr std::ptrdiff_t tileRows = ExactTileSize / tileColumns;
  const bool               hasDepth = picture.depths != nullptr;
  const auto               addRay = [&](ExactTile<TPixel> & tile, std::ptrdiff_t column, std::ptrdiff_t row) {
    const AffineMap2D &  map = view.outputToSheared;
    const auto           x = static_cast<double>(column);
    const auto           y = static_cast<double>(row);
    const double         position[] = { (map.xx * x + map.xy * y) + map.x0, (map.yx * x + map.yy * y) + map.y0 };
    const std::ptrdiff_t lengths[] = { view.slices.columns, view.slices.rows };
    double               begin = -0.5;
    double               end = static_cast<double>(view.slices.slices) - 0.5;
    for (int axis = 0; axis < 2; ++axis)
    {
      const double offset = position[axis] - view.translation[axis];
      ClipRay(-view.shear[axis], offset, -0.5, static_cast<double>(lengths[axis]) - 0.5, begin, end);
    }
    for (const auto & [function, low, high] : view.intervals)
    {
      ClipRay(function.perSlice, function(position[0], position[1], 0.0), low, high, begin, end);
    }
    if (begin <= end)
    {
      tile.Add(position[0], position[1], begin, end, row * columns + column);
    }
  };
  const auto projectTile = [&](SizeValueType tileRow, SizeValueType tileColumn, SizeValueType) {
    ExactTile<TPixel> tile(view, kernels, hasDepth);
    const auto        firstRow = static_cast<std::ptrdiff_t>(tileRow) * tileRows;
    const auto        firstColumn = static_cast<std::ptrdiff_t>(tileColumn) * tileColumns;
    for (std::ptrdiff_t row = firstRow; row < std::min(firstRow + tileRows, rows); ++row)
    {
      for (std::ptrdiff_t column = firstColumn; column < std::min(firstColumn + tileColumns, columns); ++column)
      {
        const std::ptrdiff_t pixel = row * columns + column;
        picture.pixels[pixel] = view.background;
        if (hasDepth)
        {
          picture.depths[pixel] = std::numeric_limits<float>::quiet_NaN();
        }
        addRay(tile, column, row);
      }
    }
    ExactTile<TPixel> minima = tile;
    if (view.extremum != Extremum::Maximum)
    {
      minima.Project(true, guess);
    }
    if (view.extremum != Extremum::Minimum)
    {
      tile.Project(false, guess);
    }
    for (std::size_t n = 0; n < tile.pixels.size(); ++n)
    {
      const bool isMinimum =
        view.extremum == Extremum::Minimum || (view.extremum == Extremum::Magnitude && minima.best[n] > tile.best[n]);
      const ExactTile<TPixel> & chosen = isMinimum ? minima : tile;
      const Number              value = isMinimum ? -chosen.best[n] : chosen.best[n];
      if (chosen.best[n] == -infinity)
      {
        continue;
      }
      picture.pixels[tile.pixels[n]] = RoundToPixel<TPixel>(value);
      if (hasDepth)
      {
        picture.depths[tile.pixels[n]] = static_cast<float>(chosen.GetDepth(n));
      }
    }
  };
  threads.run(CountBlocks(rows, tileRows), CountBlocks(columns, tileColumns), share, projectTile);
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
