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
/* The maximum of the interpolant along rays.
 * Included by each file of kernels, after itkShearWarpScalarKernels.h, see there, and after ExactVector<float> and
 * ExactVector<double>: as many numbers as are computed together, with operators for each one. */

template <typename T>
T
Limit(T v, T low, T high)
{
  return v < low ? low : v > high ? high : v;
}

/** The largest integer that is not above \a v >= -1, but for rounding errors. */
inline std::int32_t
FloorOf(double v)
{
  return static_cast<std::int32_t>(v + 2.0) - 2;
}

/** The bilinear interpolant of four voxels, columns first, along a line, (x, y) = (x0 + X u, y0 + Y u), as
 * c0 + c1 u + c2 u^2. */
template <typename TNumber>
struct LineExpansion
{
  typename ExactVector<TNumber>::Type c0, c1, c2;
};

template <typename TNumber, typename TVector = typename ExactVector<TNumber>::Type>
SHEARWARP_INLINE inline LineExpansion<TNumber>
ExpandAlongLine(const TVector * v, TVector x0, TVector X, TVector y0, TVector Y)
{
  const TVector a10 = v[1] - v[0];
  const TVector a01 = v[2] - v[0];
  const TVector a11 = (v[3] - v[2]) - a10;
  return { (v[0] + a10 * x0) + (a01 + a11 * x0) * y0, (a10 * X + a01 * Y) + a11 * (x0 * Y + y0 * X), a11 * (X * Y) };
}

/** Rays of one tile between one slice and the next. */
template <typename TPixel, bool VIsMinimum>
class PairOfSlices
{
public:
  using Number = ExactNumber<TPixel>;

  /** Rays that are evaluated together. */
  static constexpr int RaysTogether = 16;

  PairOfSlices(const ExactView<TPixel> & view, bool hasDepth, std::ptrdiff_t slice)
    : m_View(view)
    , m_Slices(view.slices)
    , m_HasDepth(hasDepth)
    , m_IsBackward(view.depth.perSlice < 0)
    , m_Slice(slice)
    , m_Before(slice < 0 ? 0 : slice)
    , m_Behind(Smaller<std::ptrdiff_t>(slice + 1, view.slices.slices - 1))
  {}

  /** Bounds of the interpolant for the rays in each cell of the sheared grid; returns the largest. */
  Number
  BoundCells(const CellGrid<TPixel> & cells) const
  {
    std::ptrdiff_t begin[2], end[2];
    for (int axis = 0; axis < 2; ++axis)
    {
      const double a = this->GetOffset(axis, static_cast<double>(m_Slice));
      const double b = this->GetOffset(axis, static_cast<double>(m_Slice + 1));
      // a little more, for what rounding errors do
      constexpr double slack = 1e-6;
      begin[axis] = static_cast<std::ptrdiff_t>(floor(-Larger(a, b) - slack));
      end[axis] = static_cast<std::ptrdiff_t>(floor(1.0 - Smaller(a, b) + slack)) + 2;
    }
    // of both slices: the extrema of each row, then of the rows of a cell, then of its columns
    const std::ptrdiff_t width = cells.columns + (end[0] - begin[0]) - 1;
    const std::ptrdiff_t firstColumn = cells.column + begin[0];
    const std::ptrdiff_t from = Limit<std::ptrdiff_t>(-firstColumn, 0, width - 1);
    const std::ptrdiff_t to = Limit<std::ptrdiff_t>(m_Slices.columns - firstColumn, from + 1, width);
    const std::ptrdiff_t reach = end[1] - begin[1];
    Number               highest = NoSample<Number>;
    for (std::ptrdiff_t row = 0; row < cells.rows + reach - 1; ++row)
    {
      TPixel * const       of = cells.extrema + row * cells.stride;
      const std::ptrdiff_t voxelRow = Limit<std::ptrdiff_t>(cells.row + begin[1] + row, 0, m_Slices.rows - 1);
      // columns beside the volume are as its outer ones
      const std::ptrdiff_t shift =
        Limit<std::ptrdiff_t>(firstColumn + from, 0, m_Slices.columns - 1) - from + voxelRow * m_Slices.rowStride;
      const TPixel * const a = m_Slices.voxels + (m_Before * m_Slices.sliceStride + shift);
      const TPixel * const b = m_Slices.voxels + (m_Behind * m_Slices.sliceStride + shift);
      for (std::ptrdiff_t n = from; n < to; ++n)
      {
        of[n] = Better(a[n], b[n]);
      }
      for (std::ptrdiff_t n = 0; n < from; ++n)
      {
        of[n] = of[from];
      }
      for (std::ptrdiff_t n = to; n < width; ++n)
      {
        of[n] = of[to - 1];
      }
      if (row + 1 < reach)
      {
        continue;
      }
      TPixel * const line = cells.line;
      const TPixel * first = of - (reach - 1) * cells.stride;
      for (std::ptrdiff_t n = 0; n < width; ++n)
      {
        line[n] = first[n];
      }
      for (const TPixel * each = first + cells.stride; each <= of; each += cells.stride)
      {
        for (std::ptrdiff_t n = 0; n < width; ++n)
        {
          line[n] = Better(line[n], each[n]);
        }
      }
      Number * const       bounds = cells.bounds + (row + 1 - reach) * cells.columns;
      const std::ptrdiff_t count = end[0] - begin[0];
      for (std::ptrdiff_t n = 0; n < cells.columns; ++n)
      {
        TPixel best = line[n];
        for (std::ptrdiff_t next = 1; next < count; ++next)
        {
          best = Better(best, line[n + next]);
        }
        bounds[n] = Load(best);
      }
      for (std::ptrdiff_t n = 0; n < cells.columns; ++n)
      {
        highest = Larger(highest, bounds[n]);
      }
    }
    return highest;
  }

  /** Takes the maxima of those rays whose cells' bounds allow them to change. */
  void
  Take(const ExactRays<TPixel> & rays, const CellGrid<TPixel> & cells) const
  {
    const auto   count = static_cast<std::int32_t>(rays.count);
    std::int32_t hot[RaysTogether];
    int          size = 0;
    std::uint8_t isHot[ExactTileSize];
    for (std::int32_t n = 0; n < count; ++n)
    {
      isHot[n] = cells.bounds[rays.cells[n]] > rays.best[n] ? 1 : 0;
    }
    if (m_HasDepth)
    {
      const auto nearest = static_cast<double>(m_IsBackward ? m_Slice + 1 : m_Slice);
      for (std::int32_t n = 0; n < count; ++n)
      {
        const bool isAsGood = cells.bounds[rays.cells[n]] == rays.best[n];
        isHot[n] = isHot[n] != 0 || (isAsGood && this->IsNearer(nearest, rays.place[n])) ? 1 : 0;
      }
    }
    for (std::int32_t n = 0; n < count; ++n)
    {
      hot[size] = n;
      size += isHot[n];
      if (size == RaysTogether)
      {
        this->Evaluate(rays, hot, size);
        size = 0;
      }
    }
    if (size > 0)
    {
      this->Evaluate(rays, hot, size);
    }
  }

  /** Takes the maxima of \a count rays. */
  void
  Evaluate(const ExactRays<TPixel> & rays, const std::int32_t * chosen, int count) const;

private:
  static Number
  Load(TPixel voxel)
  {
    return VIsMinimum ? -static_cast<Number>(voxel) : static_cast<Number>(voxel);
  }

  static TPixel
  Better(TPixel a, TPixel b)
  {
    const bool isNumber = a <= NoSample<TPixel, Extremum::Minimum>;
    return !isNumber || (VIsMinimum ? b < a : b > a) ? b : a;
  }

  bool
  IsNearer(double slice, double other) const
  {
    return m_IsBackward ? slice > other : slice < other;
  }

  double
  GetOffset(int axis, double slice) const
  {
    return m_View.shear[axis] * slice + m_View.translation[axis];
  }

  const ExactView<TPixel> &  m_View;
  const SliceStack<TPixel> & m_Slices;
  bool                       m_HasDepth, m_IsBackward;
  std::ptrdiff_t             m_Slice, m_Before, m_Behind;
};

template <typename TPixel, bool VIsMinimum>
void
PairOfSlices<TPixel, VIsMinimum>::Evaluate(const ExactRays<TPixel> & rays, const std::int32_t * chosen, int count) const
{
  constexpr int lanes = RaysTogether;
  double        begin[lanes], end[lanes], p[lanes], q[lanes];
  for (int n = 0; n < lanes; ++n)
  {
    const std::int32_t ray = chosen[n < count ? n : 0];
    begin[n] = rays.begin[ray];
    end[n] = rays.end[ray];
    p[n] = rays.p[ray];
    q[n] = rays.q[ray];
  }
  // columns and rows from one end of the interval of slices to the other, and the first cell of three
  const auto   first = static_cast<double>(m_Slice);
  Number       fromX[lanes], toX[lanes], fromY[lanes], toY[lanes], fromZ[lanes], toZ[lanes];
  std::int32_t baseX[lanes]{}, baseY[lanes]{};
  for (int n = 0; n < lanes; ++n)
  {
    begin[n] = Larger(begin[n], first);
    end[n] = Smaller(end[n], first + 1.0);
    const double xa = p[n] - this->GetOffset(0, begin[n]);
    const double xb = p[n] - this->GetOffset(0, end[n]);
    const double ya = q[n] - this->GetOffset(1, begin[n]);
    const double yb = q[n] - this->GetOffset(1, end[n]);
    baseX[n] = FloorOf(Smaller(xa, xb));
    baseY[n] = FloorOf(Smaller(ya, yb));
    fromX[n] = static_cast<Number>(xa - baseX[n]);
    toX[n] = static_cast<Number>(xb - baseX[n]);
    fromY[n] = static_cast<Number>(ya - baseY[n]);
    toY[n] = static_cast<Number>(yb - baseY[n]);
    fromZ[n] = static_cast<Number>(begin[n] - first);
    toZ[n] = static_cast<Number>(end[n] - first);
  }
  Number         voxels[18][lanes];
  const auto     lastColumn = static_cast<std::int32_t>(m_Slices.columns - 1);
  const auto     lastRow = static_cast<std::int32_t>(m_Slices.rows - 1);
  const TPixel * slices[] = { m_Slices.voxels + m_Before * m_Slices.sliceStride,
                              m_Slices.voxels + m_Behind * m_Slices.sliceStride };
  for (int n = 0; n < count; ++n)
  {
    for (int row = 0; row < 3; ++row)
    {
      const std::ptrdiff_t offset = Limit(baseY[n] + row, 0, lastRow) * m_Slices.rowStride;
      for (int column = 0; column < 3; ++column)
      {
        const std::ptrdiff_t place = offset + Limit(baseX[n] + column, 0, lastColumn);
        voxels[3 * row + column][n] = Load(slices[0][place]);
        voxels[9 + 3 * row + column][n] = Load(slices[1][place]);
      }
    }
  }
  for (int n = count; n < lanes; ++n)
  {
    for (auto & voxel : voxels)
    {
      voxel[n] = 0;
    }
  }

  Number best[lanes], place[lanes];
  for (int n = 0; n < lanes; n += ExactVector<Number>::Count)
  {
    using Vector = typename ExactVector<Number>::Type;
    const auto   load = [n](const Number * numbers) SHEARWARP_INLINE { return ExactVector<Number>::Load(numbers + n); };
    const Number zero = 0;
    const Number one = 1;
    const Vector none = ExactVector<Number>::Set(zero);
    const Vector all = ExactVector<Number>::Set(one);
    constexpr Number largest = std::numeric_limits<Number>::max();
    const Vector     most = ExactVector<Number>::Set(largest);
    Vector           v[18];
    for (int voxel = 0; voxel < 18; ++voxel)
    {
      v[voxel] = load(voxels[voxel]);
    }
    const Vector x[] = { load(fromX), load(toX) };
    const Vector y[] = { load(fromY), load(toY) };
    const Vector z[] = { load(fromZ), load(toZ) };
    const auto   smaller = [](Vector a, Vector b) SHEARWARP_INLINE -> Vector { return b < a ? b : a; };
    const auto   larger = [](Vector a, Vector b) SHEARWARP_INLINE -> Vector { return a < b ? b : a; };
    const auto   clamp = [=](Vector u) SHEARWARP_INLINE -> Vector { return smaller(larger(u, none), all); };
    const auto   at = [=](const Vector * ends, Vector u) SHEARWARP_INLINE -> Vector {
      const Vector between = ends[0] + u * (ends[1] - ends[0]);
      return u == all ? ends[1] : between;
    };
    // what comes later is better only if it is more or, for a viewer behind the last slice, as much
    const auto isBetter = [isBackward = m_IsBackward](Vector a, Vector b)
                            SHEARWARP_INLINE { return isBackward ? a >= b : a > b; };

    // from cell to cell, where the ray crosses columns and rows
    const auto cross = [=](const Vector * ends) SHEARWARP_INLINE -> Vector {
      const Vector crossing = clamp((one - ends[0]) / (ends[1] - ends[0]));
      const auto   crosses = (ends[0] < all) != (ends[1] < all);
      return crosses ? crossing : all;
    };
    const Vector crossX = cross(x);
    const Vector crossY = cross(y);
    const Vector ends[] = { none, smaller(crossX, crossY), larger(crossX, crossY), all };
    Vector       bestOfAll = ExactVector<Number>::Set(NoSample<Number>);
    Vector       placeOfBest = none;
    for (int part = 0; part < 3; ++part)
    {
      const Vector from = ends[part];
      const Vector to = ends[part + 1];
      const auto   isBeyondX = (from < crossX) == (x[0] >= all);
      const auto   isBeyondY = (from < crossY) == (y[0] >= all);
      const auto   choose = [&](int corner) SHEARWARP_INLINE -> Vector {
        const Vector upper = isBeyondX ? v[corner + 1] : v[corner];
        const Vector lower = isBeyondX ? v[corner + 4] : v[corner + 3];
        return isBeyondY ? lower : upper;
      };
      const Vector a[] = { choose(0), choose(1), choose(3), choose(4) };
      const Vector b[] = { choose(9), choose(10), choose(12), choose(13) };
      const Vector cellX = isBeyondX ? all : none;
      const Vector cellY = isBeyondY ? all : none;
      const Vector x0 = clamp(at(x, from) - cellX);
      const Vector x1 = clamp(at(x, to) - cellX);
      const Vector y0 = clamp(at(y, from) - cellY);
      const Vector y1 = clamp(at(y, to) - cellY);
      const Vector z0 = at(z, from);
      const Vector z1 = at(z, to);

      // the cubic f0 + f1 u + f2 u^2 + f3 u^3
      const auto   before = ExpandAlongLine<Number>(a, x0, Vector(x1 - x0), y0, Vector(y1 - y0));
      const auto   behind = ExpandAlongLine<Number>(b, x0, Vector(x1 - x0), y0, Vector(y1 - y0));
      const Vector d0 = behind.c0 - before.c0;
      const Vector d1 = behind.c1 - before.c1;
      const Vector d2 = behind.c2 - before.c2;
      const Vector Z = z1 - z0;
      const Vector f0 = before.c0 + z0 * d0;
      const Vector f1 = before.c1 + (z0 * d1 + Z * d0);
      const Vector f2 = before.c2 + (z0 * d2 + Z * d1);
      const Vector f3 = Z * d2;
      // where its derivative falls through 0
      const Number three = 3;
      const Vector discriminant = f2 * f2 - three * (f3 * f1);
      const Vector root = ExactVector<Number>::SquareRoot(larger(discriminant, none));
      const Vector ifFalling = f1 / (root - f2);
      const Vector ifRising = -(f2 + root) / (three * f3);
      const Vector u = f2 <= none ? ifFalling : ifRising;
      const auto   isWithin = (discriminant >= none) & (u > none) & (u < all);
      const Vector polynomial = ((f3 * u + f2) * u + f1) * u + f0;
      const Vector atRoot = isWithin ? polynomial : f0;
      const Vector atEnd = ((f3 + f2) + f1) + f0;
      const auto   takesRoot = isWithin & isBetter(atRoot, f0);
      const Vector better = takesRoot ? atRoot : f0;
      const Vector betterPlace = takesRoot ? u : none;
      const auto   takesEnd = isBetter(atEnd, better);
      const Vector where = takesEnd ? all : betterPlace;
      // rounding errors lead beyond no voxel; what is not finite is left out
      const Vector highest =
        larger(larger(larger(a[0], b[0]), larger(a[1], b[1])), larger(larger(a[2], b[2]), larger(a[3], b[3])));
      const Vector value = smaller(takesEnd ? atEnd : better, highest);
      const Vector sum = ((a[0] + b[0]) + (a[1] + b[1])) + ((a[2] + b[2]) + (a[3] + b[3]));
      const auto   counts = (sum >= -most) & (sum <= most) & (from < all);
      const auto   isTaken = counts & isBetter(value, bestOfAll);
      bestOfAll = isTaken ? value : bestOfAll;
      placeOfBest = isTaken ? from + where * (to - from) : placeOfBest;
    }
    ExactVector<Number>::Store(best + n, bestOfAll);
    ExactVector<Number>::Store(place + n, placeOfBest);
  }
  for (int n = 0; n < count; ++n)
  {
    const std::int32_t ray = chosen[n];
    const double       slice = begin[n] + static_cast<double>(place[n]) * (end[n] - begin[n]);
    if (begin[n] <= end[n] &&
        (best[n] > rays.best[ray] || (best[n] == rays.best[ray] && this->IsNearer(slice, rays.place[ray]))))
    {
      rays.best[ray] = best[n];
      rays.place[ray] = slice;
    }
  }
}

template <bool VIsMinimum, typename TPixel>
void
MaximizeOnRays(const ExactView<TPixel> & view,
               bool                      hasDepth,
               const ExactRays<TPixel> & rays,
               const CellGrid<TPixel> &  cells,
               std::ptrdiff_t            sliceBegin,
               std::ptrdiff_t            sliceEnd)
{
  for (std::ptrdiff_t slice = sliceBegin; slice < sliceEnd; ++slice)
  {
    const PairOfSlices<TPixel, VIsMinimum> pair(view, hasDepth, slice);
    const auto                             highest = pair.BoundCells(cells);
    auto                                   least = rays.best[0];
    for (std::ptrdiff_t n = 0; n < rays.count; ++n)
    {
      least = Smaller(least, rays.best[n]);
    }
    if (highest > least || (hasDepth && highest == least))
    {
      pair.Take(rays, cells);
    }
  }
}

/** See Kernels. */
template <typename TPixel>
void
MaximizeOnRays(const ExactView<TPixel> & view,
               bool                      isMinimum,
               bool                      hasDepth,
               const ExactRays<TPixel> & rays,
               const CellGrid<TPixel> &  cells,
               std::ptrdiff_t            sliceBegin,
               std::ptrdiff_t            sliceEnd)
{
  return isMinimum ? MaximizeOnRays<true>(view, hasDepth, rays, cells, sliceBegin, sliceEnd)
                   : MaximizeOnRays<false>(view, hasDepth, rays, cells, sliceBegin, sliceEnd);
}
