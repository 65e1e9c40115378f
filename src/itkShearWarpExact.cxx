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
/** One ray, of slices [begin, end], and the best value so far with its slice. */
template <typename TNumber>
struct Ray
{
  double         p, q;
  double         begin, end;
  TNumber        best;
  double         place;
  std::ptrdiff_t pixel;
};

/** Columns or rows of a ray from one end of an interval of slices to the other, counted from `base`. */
template <typename TNumber>
struct Advance
{
  std::ptrdiff_t base;
  TNumber        from, to;
};

/** The largest integer that is not above \a v >= -1, but for rounding errors. */
inline std::ptrdiff_t
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

/** A value on a ray, and where. */
template <typename TNumber>
struct Place
{
  TNumber value, u;
};

/** A cell's voxels, columns first, in the slice before and the one behind. */
template <typename TNumber>
struct Cell
{
  TNumber before[4], behind[4];
};

/** The bilinear interpolant of four voxels along a line, (x, y) = (x0 + X u, y0 + Y u), as c[0] + c[1] u + c[2] u^2. */
template <typename TNumber>
void
ExpandAlongLine(const TNumber (&v)[4], TNumber x0, TNumber X, TNumber y0, TNumber Y, TNumber (&c)[3])
{
  const TNumber a10 = v[1] - v[0];
  const TNumber a01 = v[2] - v[0];
  const TNumber a11 = (v[3] - v[2]) - a10;
  c[0] = (v[0] + a10 * x0) + (a01 + a11 * x0) * y0;
  c[1] = (a10 * X + a01 * Y) + a11 * (x0 * Y + y0 * X);
  c[2] = a11 * (X * Y);
}

/** The maximum of the trilinear interpolant in a cell on a line from (x0, y0, z0) to (x1, y1, z1), and the place there
 * from 0 to 1; of several the first, or the last one if \a isBackward. Not a number if a voxel is not finite. */
template <typename TNumber>
Place<TNumber>
MaximizeInCell(const Cell<TNumber> & cell,
               TNumber               x0,
               TNumber               x1,
               TNumber               y0,
               TNumber               y1,
               TNumber               z0,
               TNumber               z1,
               bool                  isBackward)
{
  TNumber before[3], behind[3];
  ExpandAlongLine(cell.before, x0, x1 - x0, y0, y1 - y0, before);
  ExpandAlongLine(cell.behind, x0, x1 - x0, y0, y1 - y0, behind);
  const TNumber d[] = { behind[0] - before[0], behind[1] - before[1], behind[2] - before[2] };
  const TNumber Z = z1 - z0;
  const TNumber f0 = before[0] + z0 * d[0];
  const TNumber f1 = before[1] + (z0 * d[1] + Z * d[0]);
  const TNumber f2 = before[2] + (z0 * d[2] + Z * d[1]);
  const TNumber f3 = Z * d[2];

  Place<TNumber> best{ f0, 0 };
  const auto     take = [&](TNumber value, TNumber u) {
    if (value > best.value || (isBackward && value == best.value))
    {
      best = { value, u };
    }
  };
  // where the derivative falls through 0
  const TNumber root = std::sqrt(f2 * f2 - 3 * (f3 * f1));
  const TNumber u = f2 <= 0 ? f1 / (root - f2) : -(f2 + root) / (3 * f3);
  if (u > 0 && u < 1)
  {
    take(((f3 * u + f2) * u + f1) * u + f0, u);
  }
  take(((f3 + f2) + f1) + f0, 1);
  // rounding errors lead beyond no voxel
  TNumber highest = cell.before[0];
  TNumber sum = 0;
  for (int n = 0; n < 4; ++n)
  {
    highest = std::max({ highest, cell.before[n], cell.behind[n] });
    sum += cell.before[n] + cell.behind[n];
  }
  best.value = sum - sum == 0 ? std::min(best.value, highest) : std::numeric_limits<TNumber>::quiet_NaN();
  return best;
}

/** Projects tiles of a view: its maximum or, with the sign of all voxels changed, its minimum. */
template <typename TPixel, bool VIsMinimum>
class ExactProjector
{
public:
  using Number = ExactNumber<TPixel>;
  using RayType = Ray<Number>;

  ExactProjector(const ExactView<TPixel> & view, bool hasDepth)
    : m_View(view)
    , m_Slices(view.slices)
    , m_HasDepth(hasDepth)
    , m_IsBackward(view.depth.perSlice < 0)
  {}

  void
  Project(std::vector<RayType> & rays, const IntermediateImage<TPixel> & guess);

private:
  Number
  Load(TPixel voxel) const
  {
    return VIsMinimum ? -static_cast<Number>(voxel) : static_cast<Number>(voxel);
  }

  bool
  IsNearer(double slice, double other) const
  {
    return m_IsBackward ? slice > other : slice < other;
  }

  void
  Take(RayType & ray, Number value, double slice) const
  {
    if (value > ray.best || (value == ray.best && this->IsNearer(slice, ray.place)))
    {
      ray.best = value;
      ray.place = slice;
    }
  }

  /** Whether voxels up to \a highest, between slices \a first and \a last, can change a ray's value or its place. */
  bool
  CanMatter(const RayType & ray, Number highest, double first, double last) const
  {
    return highest > ray.best ||
           (m_HasDepth && highest == ray.best && this->IsNearer(m_IsBackward ? last : first, ray.place));
  }

  double
  GetOffset(int axis, double slice) const
  {
    return m_View.shear[axis] * slice + m_View.translation[axis];
  }

  Advance<Number>
  Follow(int axis, double position, double from, double to) const
  {
    const double         a = position - this->GetOffset(axis, from);
    const double         b = position - this->GetOffset(axis, to);
    const std::ptrdiff_t base = Floor(std::min(a, b));
    return { base,
             static_cast<Number>(a - static_cast<double>(base)),
             static_cast<Number>(b - static_cast<double>(base)) };
  }

  const TPixel *
  GetRow(std::ptrdiff_t row, std::ptrdiff_t slice) const
  {
    return m_Slices.voxels + (std::clamp<std::ptrdiff_t>(row, 0, m_Slices.rows - 1) * m_Slices.rowStride +
                              std::clamp<std::ptrdiff_t>(slice, 0, m_Slices.slices - 1) * m_Slices.sliceStride);
  }

  Number
  SampleAt(const RayType & ray, std::ptrdiff_t slice) const;

  void
  Seed(RayType & ray, const IntermediateImage<TPixel> & guess) const;

  void
  Evaluate(RayType & ray, std::ptrdiff_t slice) const;

  void
  ProjectSlab(std::vector<RayType> & rays, std::ptrdiff_t slab);

  const ExactView<TPixel> &  m_View;
  const SliceStack<TPixel> & m_Slices;
  bool                       m_HasDepth, m_IsBackward;
  std::vector<Number>        m_Bounds; // of the blocks of a slab
};

/** Takes the maximum of a ray between \a slice and the next one. */
template <typename TPixel, bool VIsMinimum>
void
ExactProjector<TPixel, VIsMinimum>::Evaluate(RayType & ray, std::ptrdiff_t slice) const
{
  const auto   first = static_cast<double>(slice);
  const double begin = std::max(ray.begin, first);
  const double end = std::min(ray.end, first + 1.0);
  if (!(begin <= end))
  {
    return;
  }
  const Advance<Number> x = this->Follow(0, ray.p, begin, end);
  const Advance<Number> y = this->Follow(1, ray.q, begin, end);
  std::ptrdiff_t        columns[3];
  for (int n = 0; n < 3; ++n)
  {
    columns[n] = std::clamp<std::ptrdiff_t>(x.base + n, 0, m_Slices.columns - 1);
  }
  Number before[3][3], behind[3][3];
  Number highest = -std::numeric_limits<Number>::infinity();
  for (int row = 0; row < 3; ++row)
  {
    const TPixel * const a = this->GetRow(y.base + row, slice);
    const TPixel * const b = this->GetRow(y.base + row, slice + 1);
    for (int column = 0; column < 3; ++column)
    {
      before[row][column] = this->Load(a[columns[column]]);
      behind[row][column] = this->Load(b[columns[column]]);
      const Number higher = behind[row][column] > before[row][column] ? behind[row][column] : before[row][column];
      highest = higher > highest ? higher : highest;
    }
  }
  if (!this->CanMatter(ray, highest, begin, end))
  {
    return;
  }

  // from cell to cell, where the ray crosses columns and rows
  const auto cross = [](const Advance<Number> & along) -> Number {
    const bool crosses = (along.from < 1) != (along.to < 1);
    return crosses ? std::clamp<Number>((1 - along.from) / (along.to - along.from), 0, 1) : Number{ 1 };
  };
  const Number crossings[] = { cross(x), cross(y) };
  const Number ends[] = { 0, std::min(crossings[0], crossings[1]), std::max(crossings[0], crossings[1]), 1 };
  const auto   z0 = static_cast<Number>(begin - first);
  const auto   z1 = static_cast<Number>(end - first);
  for (int n = 0; n < 3; ++n)
  {
    const Number from = ends[n];
    const Number to = ends[n + 1];
    if (n > 0 && from == 1)
    {
      break;
    }
    const auto at = [](Number a, Number b, Number u) { return u == 1 ? b : a + u * (b - a); };
    const auto isBeyond = [&](const Advance<Number> & along, Number crossing) {
      const bool startsBeyond = along.from >= 1;
      return (from < crossing) == startsBeyond ? 1 : 0;
    };
    const int    column = isBeyond(x, crossings[0]);
    const int    row = isBeyond(y, crossings[1]);
    const auto   inCell = [](Number v, int cell) { return std::clamp<Number>(v - static_cast<Number>(cell), 0, 1); };
    Cell<Number> cell;
    for (int corner = 0; corner < 4; ++corner)
    {
      cell.before[corner] = before[row + corner / 2][column + corner % 2];
      cell.behind[corner] = behind[row + corner / 2][column + corner % 2];
    }
    const auto [value, u] = MaximizeInCell(cell,
                                           inCell(at(x.from, x.to, from), column),
                                           inCell(at(x.from, x.to, to), column),
                                           inCell(at(y.from, y.to, from), row),
                                           inCell(at(y.from, y.to, to), row),
                                           at(z0, z1, from),
                                           at(z0, z1, to),
                                           m_IsBackward);
    const double along = static_cast<double>(from) + static_cast<double>(u) * static_cast<double>(to - from);
    this->Take(ray, value, begin + along * (end - begin));
  }
}

/** The interpolant where the ray meets a slice. */
template <typename TPixel, bool VIsMinimum>
auto
ExactProjector<TPixel, VIsMinimum>::SampleAt(const RayType & ray, std::ptrdiff_t slice) const -> Number
{
  const auto   position = static_cast<double>(slice);
  const auto   x = this->Follow(0, ray.p, position, position);
  const auto   y = this->Follow(1, ray.q, position, position);
  const auto   column = [&](std::ptrdiff_t n) { return std::clamp<std::ptrdiff_t>(n, 0, m_Slices.columns - 1); };
  const auto * a = this->GetRow(y.base, slice);
  const auto * b = this->GetRow(y.base + 1, slice);
  const auto   mix = [](Number from, Number to, Number u) { return from + u * (to - from); };
  return mix(mix(this->Load(a[column(x.base)]), this->Load(a[column(x.base + 1)]), x.from),
             mix(this->Load(b[column(x.base)]), this->Load(b[column(x.base + 1)]), x.from),
             y.from);
}

/** Takes the ray's maximum about the best one of the slices that the pixels around it had. */
template <typename TPixel, bool VIsMinimum>
void
ExactProjector<TPixel, VIsMinimum>::Seed(RayType & ray, const IntermediateImage<TPixel> & guess) const
{
  std::ptrdiff_t slice = NoSlice;
  Number         value = -std::numeric_limits<Number>::infinity();
  for (int n = 0; n < 4; ++n)
  {
    const std::ptrdiff_t column = Floor(ray.p) + n % 2;
    const std::ptrdiff_t row = Floor(ray.q) + n / 2;
    if (row < 0 || row >= guess.rows || column < guess.reached[row].begin || column >= guess.reached[row].end)
    {
      continue;
    }
    const std::int32_t candidate = guess.slices[row * guess.rowStride + column];
    const auto         position = static_cast<double>(candidate);
    if (candidate == NoSlice || candidate == slice || position < ray.begin || position > ray.end)
    {
      continue;
    }
    const Number sample = this->SampleAt(ray, candidate);
    if (sample > value)
    {
      value = sample;
      slice = candidate;
    }
  }
  if (slice != NoSlice)
  {
    this->Evaluate(ray, slice - 1);
    this->Evaluate(ray, slice);
  }
}

/** Takes the maxima of rays between the slices of one slab of blocks, and to the next one. */
template <typename TPixel, bool VIsMinimum>
void
ExactProjector<TPixel, VIsMinimum>::ProjectSlab(std::vector<RayType> & rays, std::ptrdiff_t slab)
{
  // half a voxel before the first slice and behind the last one too
  const std::ptrdiff_t first = slab == 0 ? -1 : slab * BlockLength;
  const std::ptrdiff_t last = std::min((slab + 1) * BlockLength, m_Slices.slices);
  const auto           begin = static_cast<double>(first);
  const auto           end = static_cast<double>(last);
  double               low[] = { std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity() };
  double               high[] = { -low[0], -low[1] };
  Number               least = std::numeric_limits<Number>::infinity();
  for (const RayType & ray : rays)
  {
    if (ray.begin <= end && ray.end >= begin)
    {
      low[0] = std::min(low[0], ray.p);
      high[0] = std::max(high[0], ray.p);
      low[1] = std::min(low[1], ray.q);
      high[1] = std::max(high[1], ray.q);
      least = std::min(least, ray.best);
    }
  }
  if (!(low[0] <= high[0]))
  {
    return;
  }

  // blocks that the rays may meet, and how many of them one ray may
  const std::ptrdiff_t blocks[] = { m_View.blocks.columns, m_View.blocks.rows };
  double               offset[2], length[2];
  std::ptrdiff_t       firstBlock[2], count[2], reach[2];
  const auto           findBlock = [&](int axis, double position) {
    const double voxel = std::clamp(position, 0.0, static_cast<double>(blocks[axis] * BlockLength - 1));
    return static_cast<std::ptrdiff_t>(voxel) / BlockLength;
  };
  for (int axis = 0; axis < 2; ++axis)
  {
    const double ends[] = { this->GetOffset(axis, begin), this->GetOffset(axis, end) };
    offset[axis] = std::max(ends[0], ends[1]);
    length[axis] = offset[axis] - std::min(ends[0], ends[1]);
    // a voxel more on both sides, for what rounding errors do
    firstBlock[axis] = findBlock(axis, low[axis] - offset[axis] - 1.0);
    count[axis] = findBlock(axis, high[axis] - offset[axis] + length[axis] + 2.0) - firstBlock[axis] + 1;
    reach[axis] = static_cast<std::ptrdiff_t>(std::ceil((length[axis] + 3.0) / BlockLength));
  }
  m_Bounds.resize(count[0] * count[1]);
  Number highest = -std::numeric_limits<Number>::infinity();
  for (std::ptrdiff_t row = 0; row < count[1]; ++row)
  {
    for (std::ptrdiff_t column = 0; column < count[0]; ++column)
    {
      const std::ptrdiff_t place = (firstBlock[0] + column) * m_View.blocks.columnStride +
                                   (firstBlock[1] + row) * m_View.blocks.rowStride + slab * m_View.blocks.sliceStride;
      const TPixel * const extrema = VIsMinimum ? m_View.blocks.minima : m_View.blocks.maxima;
      Number               bound = this->Load(extrema[place]);
      if (slab + 1 < m_View.blocks.slices)
      {
        bound = std::max(bound, this->Load(extrema[place + m_View.blocks.sliceStride]));
      }
      m_Bounds[row * count[0] + column] = bound;
      highest = std::max(highest, bound);
    }
  }
  if (highest < least || (highest == least && !m_HasDepth))
  {
    return;
  }
  // the maximum over the blocks from each one on that a ray may meet
  for (std::ptrdiff_t row = 0; row < count[1]; ++row)
  {
    Number * const bounds = m_Bounds.data() + row * count[0];
    for (std::ptrdiff_t column = 0; column < count[0]; ++column)
    {
      bounds[column] = *std::max_element(bounds + column, bounds + std::min(column + reach[0] + 1, count[0]));
    }
  }
  for (std::ptrdiff_t row = 0; row < count[1]; ++row)
  {
    for (std::ptrdiff_t next = row + 1; next < std::min(row + reach[1] + 1, count[1]); ++next)
    {
      for (std::ptrdiff_t column = 0; column < count[0]; ++column)
      {
        Number & bound = m_Bounds[row * count[0] + column];
        bound = std::max(bound, m_Bounds[next * count[0] + column]);
      }
    }
  }
  for (RayType & ray : rays)
  {
    if (!(ray.begin <= end && ray.end >= begin))
    {
      continue;
    }
    const std::ptrdiff_t column = findBlock(0, ray.p - offset[0] - 1.0) - firstBlock[0];
    const std::ptrdiff_t row = findBlock(1, ray.q - offset[1] - 1.0) - firstBlock[1];
    const Number         bound = m_Bounds[row * count[0] + column];
    const double         nearest = std::max(begin, ray.begin);
    const double         farthest = std::min(end, ray.end);
    for (std::ptrdiff_t slice = first; slice < last && this->CanMatter(ray, bound, nearest, farthest); ++slice)
    {
      this->Evaluate(ray, slice);
    }
  }
}

template <typename TPixel, bool VIsMinimum>
void
ExactProjector<TPixel, VIsMinimum>::Project(std::vector<RayType> & rays, const IntermediateImage<TPixel> & guess)
{
  for (RayType & ray : rays)
  {
    this->Seed(ray, guess);
  }
  for (std::ptrdiff_t slab = 0; slab < m_View.blocks.slices; ++slab)
  {
    this->ProjectSlab(rays, slab);
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
               const IntermediateImage<TPixel> & guess,
               std::ptrdiff_t                    columns,
               std::ptrdiff_t                    rows,
               const Picture<TPixel> &           picture,
               const Threads &                   threads,
               float                             share)
{
  using Number = ExactNumber<TPixel>;
  constexpr Number         infinity = std::numeric_limits<Number>::infinity();
  constexpr std::ptrdiff_t tile = 16;
  const bool               hasDepth = picture.depths != nullptr;
  const auto               findRay = [&](std::ptrdiff_t column, std::ptrdiff_t row, Ray<Number> & ray) {
    const AffineMap2D & map = view.outputToSheared;
    const auto          x = static_cast<double>(column);
    const auto          y = static_cast<double>(row);
    ray.p = (map.xx * x + map.xy * y) + map.x0;
    ray.q = (map.yx * x + map.yy * y) + map.y0;
    ray.begin = -0.5;
    ray.end = static_cast<double>(view.slices.slices) - 0.5;
    const std::ptrdiff_t lengths[] = { view.slices.columns, view.slices.rows };
    for (int axis = 0; axis < 2; ++axis)
    {
      const double position = (axis == 0 ? ray.p : ray.q) - view.translation[axis];
      ClipRay(-view.shear[axis], position, -0.5, static_cast<double>(lengths[axis]) - 0.5, ray.begin, ray.end);
    }
    for (const auto & [function, low, high] : view.intervals)
    {
      ClipRay(function.perSlice, function(ray.p, ray.q, 0.0), low, high, ray.begin, ray.end);
    }
    ray.best = -infinity;
    ray.place = view.depth.perSlice < 0 ? -infinity : infinity;
    ray.pixel = row * columns + column;
    return ray.begin <= ray.end;
  };
  threads.run(CountBlocks(rows, tile),
              CountBlocks(columns, tile),
              share,
              [&](SizeValueType tileRow, SizeValueType tileColumn, SizeValueType) {
                std::vector<Ray<Number>> rays;
                const auto               firstRow = static_cast<std::ptrdiff_t>(tileRow) * tile;
                const auto               firstColumn = static_cast<std::ptrdiff_t>(tileColumn) * tile;
                for (std::ptrdiff_t row = firstRow; row < std::min(firstRow + tile, rows); ++row)
                {
                  for (std::ptrdiff_t column = firstColumn; column < std::min(firstColumn + tile, columns); ++column)
                  {
                    Ray<Number> ray;
                    const bool  isInside = findRay(column, row, ray);
                    picture.pixels[ray.pixel] = view.background;
                    if (hasDepth)
                    {
                      picture.depths[ray.pixel] = std::numeric_limits<float>::quiet_NaN();
                    }
                    if (isInside)
                    {
                      rays.push_back(ray);
                    }
                  }
                }
                std::vector<Ray<Number>> minima;
                if (view.extremum != Extremum::Maximum)
                {
                  minima = rays;
                  ExactProjector<TPixel, true>(view, hasDepth).Project(minima, guess);
                }
                if (view.extremum != Extremum::Minimum)
                {
                  ExactProjector<TPixel, false>(view, hasDepth).Project(rays, guess);
                }
                for (std::size_t n = 0; n < rays.size(); ++n)
                {
                  const bool isMinimum = view.extremum == Extremum::Minimum ||
                                         (view.extremum == Extremum::Magnitude && minima[n].best > rays[n].best);
                  const Ray<Number> & ray = isMinimum ? minima[n] : rays[n];
                  if (ray.best == -infinity)
                  {
                    continue;
                  }
                  picture.pixels[ray.pixel] = RoundToPixel<TPixel>(isMinimum ? -ray.best : ray.best);
                  if (hasDepth)
                  {
                    picture.depths[ray.pixel] = static_cast<float>(view.depth(ray.p, ray.q, ray.place));
                  }
                }
              });
}

#define INSTANTIATE(TPixel)                                       \
  template void ProjectExactly(const ExactView<TPixel> &,         \
                               const IntermediateImage<TPixel> &, \
                               std::ptrdiff_t,                    \
                               std::ptrdiff_t,                    \
                               const Picture<TPixel> &,           \
                               const Threads &,                   \
                               float);
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk::ShearWarp
