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
 * Included by each file of kernels, after Scalar.h, see there, and after ExactVector<float> and
 * ExactVector<double>: as many numbers as are computed together, with operators for each one. */

template <typename T>
T
Limit(T v, T low, T high)
{
  return v < low ? low : v > high ? high : v;
}

/** Levels are voxels in 15 bits, a larger one a better one, so that their differences are in 16 bits. A number that is
 * compared, of a voxel or between voxels, has the level (number + Zero) * scale. */
template <typename TPixel, bool VIsMinimum>
struct Levels
{
  static constexpr bool IsSigned = static_cast<TPixel>(-1) < 0;
  static constexpr int  Sign = sizeof(TPixel) == 2 && !IsSigned ? 0x8000 : 0;
  static constexpr int  All = sizeof(TPixel) == 2 || IsSigned ? 0xFFFF : 0xFF;
  static constexpr int  Flip = VIsMinimum ? Sign ^ All : Sign;
  static constexpr auto Zero = static_cast<std::int16_t>(Flip);

  /** Of a volume with voxels from \a lowest to \a highest. */
  Levels(TPixel lowest, TPixel highest)
    : isHalved(sizeof(TPixel) == 2 && highest - lowest > 32767)
    , scale(sizeof(TPixel) == 1 ? 64.0
            : isHalved          ? 0.5
                                : 1.0)
  {}

  template <bool VIsHalved>
  static std::int16_t
  Find(TPixel voxel)
  {
    const auto level = static_cast<std::int16_t>(voxel ^ Flip);
    return static_cast<std::int16_t>(sizeof(TPixel) == 1 ? level * 64 : VIsHalved ? level >> 1 : level);
  }

  bool   isHalved;
  double scale;
};

/** Of pixels that have no levels. */
struct NoLevels
{
  template <typename TPixel>
  NoLevels(TPixel, TPixel)
  {}

  static constexpr bool isHalved = false;
};

/** (1 - \a w / 2^15) \a a + \a w / 2^15 \a b, but for half a unit. */
inline std::int16_t
Mix(std::int16_t a, std::int16_t b, std::int16_t w)
{
  const auto difference = static_cast<std::int16_t>(b - a);
  return static_cast<std::int16_t>(a + static_cast<std::int16_t>((((difference * w) >> 14) + 1) >> 1));
}

/** Voxels that have weight in a cell of the sheared grid from one slice to the next, along one axis: those of the cell
 * 0 begin at `first`. Its rays go from Mix(0, 1, left), past the voxels 1 to `last`, to Mix(last, last + 1, right);
 * `last` is 1 to 3. */
struct CellWindow
{
  std::ptrdiff_t first, last;
  std::int16_t   left, right;
};

/** The highest level where the voxel \a get(n) has weight, for n from 0 to VLast + 1. */
template <int VLast, typename TGet>
SHEARWARP_INLINE inline std::int16_t
FindHighest(const CellWindow & window, const TGet & get)
{
  const std::int16_t first = get(1);
  const std::int16_t last = get(VLast);
  const std::int16_t ends = Larger(Mix(get(0), first, window.left), Mix(last, get(VLast + 1), window.right));
  return Larger(Larger(ends, VLast > 2 ? get(2) : last), Larger(first, last));
}

/** Calls \a function with `last` as a constant. */
template <typename TFunction>
void
CallWithLast(const CellWindow & window, const TFunction & function)
{
  window.last == 1   ? function(std::integral_constant<int, 1>())
  : window.last == 2 ? function(std::integral_constant<int, 2>())
                     : function(std::integral_constant<int, 3>());
}

/** The same voxels of a slice and the next one. */
template <typename TPixel>
struct PairOfRows
{
  const TPixel * voxels[2];
};

/** In each column of cells the best voxel of two rows, and the highest level of their interpolants. */
template <typename TPixel>
struct RowBounds
{
  TPixel       voxels[CellColumns];
  std::int16_t levels[CellColumns];
};

/** Finds the maxima of the rays of a tile. */
template <typename TPixel, bool VIsMinimum>
class TileSearch
{
public:
  using Number = ExactNumber<TPixel>;

  /** With \a isNew `least` is not set yet. */
  TileSearch(const ExactView<TPixel> & view, const ExactTile<TPixel> & tile, bool isNew);

  /** All rays from a slice to the next one; what bounds by voxels exclude is left out. */
  void
  SearchPair(std::ptrdiff_t slice);

  /** One ray from a slice to the next one; evaluated together with others, at the latest by Finish(). */
  void
  Add(RayPart part)
  {
    m_Parts[m_Count++] = part;
    if (m_Count == RaysTogether)
    {
      this->Evaluate();
    }
  }

  /** Sets `least` of all cells, and returns the least of them. */
  TPixel
  Finish();

private:
  using Vectors = ExactVector<Number>;
  using Vector = typename Vectors::Type;

  using LevelType = std::conditional_t<(sizeof(TPixel) <= 2), Levels<TPixel, VIsMinimum>, NoLevels>;

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
  static constexpr bool IsBigEndian = true;
#else
  static constexpr bool IsBigEndian = false;
#endif

  static constexpr int  RaysTogether = 16;
  static constexpr bool HasLevels = sizeof(TPixel) <= 2;
  static constexpr bool HasLargeNumbers = std::is_same_v<TPixel, double>;

  /** What rounding may take from a level: half a unit for a halved voxel, and along each axis one for the weight and
   * half a one for the product. */
  static constexpr int LevelSlack = 4;

  static constexpr TPixel NoVoxel = VIsMinimum ? NoSample<TPixel, Extremum::Minimum> : NoSample<TPixel>;

  /** The most voxels of a row that have weight in a cell of the sheared grid, from one slice to the next. */
  static constexpr int CellReach = 5;

  /** The voxels of a row that have weight in a row of cells. */
  static constexpr std::ptrdiff_t RowWidth = CellColumns + CellReach - 1;

  static Number
  Load(TPixel voxel)
  {
    return VIsMinimum ? -static_cast<Number>(voxel) : static_cast<Number>(voxel);
  }

  /** Not-a-number as \a voxel is ignored. */
  static TPixel
  GetBetter(TPixel best, TPixel voxel)
  {
    return (VIsMinimum ? voxel < best : voxel > best) ? voxel : best;
  }

  static TPixel
  FindLeast(Number best, bool hasDepth);

  /** A power of two by which no difference of voxels overflows. */
  Number
  FindScaleOfVoxels() const
  {
    if constexpr (HasLargeNumbers)
    {
      return m_Slices.lowest < -0x1p1000 || m_Slices.highest > 0x1p1000 ? 0x1p-30 : 1.0;
    }
    return 1;
  }

  /** A power of two by which squares of these numbers neither overflow nor vanish. */
  static Number
  FindScaleOfSquares(Vector f1, Vector f2, Vector f3)
  {
    if constexpr (HasLargeNumbers)
    {
      const auto   abs = [](double v) { return v < 0 ? -v : v; };
      const double largest = Larger(Larger(abs(f1), abs(f2)), abs(f3));
      return largest > 0x1p400 ? 0x1p-600 : largest < 0x1p-400 ? 0x1p600 : 1.0;
    }
    return 1;
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

  const TPixel *
  GetSlice(std::ptrdiff_t slice) const
  {
    return m_Slices.voxels + Limit<std::ptrdiff_t>(slice, 0, m_Slices.slices - 1) * m_Slices.sliceStride;
  }

  CellWindow
  FindWindow(int axis, std::ptrdiff_t slice) const;

  void
  SetLeast(std::ptrdiff_t row);

  /** The voxels of a row from \a first on; columns beside the volume are as its outer ones. */
  const TPixel *
  CopyRow(const TPixel * voxels, std::ptrdiff_t first, TPixel (&copy)[2 * RowWidth]) const
  {
    const std::ptrdiff_t last = m_Slices.columns - RowWidth;
    if (last < 0)
    {
      for (std::ptrdiff_t n = 0; n < RowWidth; ++n)
      {
        copy[n] = voxels[Limit<std::ptrdiff_t>(first + n, 0, m_Slices.columns - 1)];
      }
      return copy;
    }
    const bool     isLeft = first < 0;
    TPixel * const inside = isLeft ? copy + RowWidth : copy;
    TPixel * const outside = isLeft ? copy : copy + RowWidth;
    CopyBytes(inside, voxels + (isLeft ? 0 : last), RowWidth * sizeof(TPixel));
    const TPixel outer = voxels[isLeft ? 0 : m_Slices.columns - 1];
    for (std::ptrdiff_t n = 0; n < RowWidth; ++n)
    {
      outside[n] = outer;
    }
    return inside + (isLeft ? Larger(first, -RowWidth) : Smaller(first - last, RowWidth));
  }

  template <int VLast, bool VIsHalved>
  static void
  BoundRows(const PairOfRows<TPixel> * rows,
            std::ptrdiff_t             count,
            const CellWindow &         window,
            RowBounds<TPixel> *        bounds);

  /** The cells of a row that may have something better, as bits, and the best voxel of each one. */
  template <int VLast>
  std::uint32_t
  FindCells(const RowBounds<TPixel> * rows,
            const CellWindow &        window,
            std::ptrdiff_t            row,
            TPixel (&voxels)[CellColumns]) const;

  void
  LoadVoxels(const std::int32_t (&columns)[RaysTogether],
             const std::int32_t (&rows)[RaysTogether],
             const TPixel * const (&slices)[2][RaysTogether],
             Number (&voxels)[18][RaysTogether]) const;

  void
  Evaluate();

  const ExactView<TPixel> &  m_View;
  const ExactTile<TPixel> &  m_Tile;
  const SliceStack<TPixel> & m_Slices;
  bool                       m_IsBackward;
  std::ptrdiff_t             m_Step[2];     // from voxel to voxel, the way that rays go
  Number                     m_Slope[2];    // columns and rows that a ray passes in a slice
  Number                     m_PerVoxel[2]; // slices in which a ray passes a column or row
  LevelType                  m_Levels;
  bool                       m_HasChanged[CellRows]{};
  RayPart                    m_Parts[RaysTogether]{};
  int                        m_Count{ 0 };
};

template <typename TPixel, bool VIsMinimum>
TileSearch<TPixel, VIsMinimum>::TileSearch(const ExactView<TPixel> & view, const ExactTile<TPixel> & tile, bool isNew)
  : m_View(view)
  , m_Tile(tile)
  , m_Slices(view.slices)
  , m_IsBackward(view.depth.perSlice < 0)
  , m_Levels(view.slices.lowest, view.slices.highest)
{
  constexpr Number most = std::numeric_limits<Number>::max();
  for (int axis = 0; axis < 2; ++axis)
  {
    const double slope = view.shear[axis] > 0 ? view.shear[axis] : -view.shear[axis];
    m_Step[axis] = view.shear[axis] > 0 ? -1 : 1;
    m_Slope[axis] = static_cast<Number>(slope);
    m_PerVoxel[axis] = slope > 1 / static_cast<double>(most) ? static_cast<Number>(1 / slope) : most;
  }
  for (bool & hasChanged : m_HasChanged)
  {
    hasChanged = isNew;
  }
}

/** The largest voxel that does not exceed a value, or that reaches it. */
template <typename TPixel, bool VIsMinimum>
TPixel
TileSearch<TPixel, VIsMinimum>::FindLeast(Number best, bool hasDepth)
{
  using Limits = std::numeric_limits<TPixel>;
  const Number value = VIsMinimum ? -best : best;
  if constexpr (IsFloat<TPixel>)
  {
    constexpr TPixel smallest = Limits::min();
    const auto       voxel = static_cast<TPixel>(value);
    const auto       rounded = static_cast<Number>(voxel);
    if (!(VIsMinimum ? rounded < value : rounded > value) || hasDepth)
    {
      return voxel;
    }
    const TPixel more = static_cast<TPixel>(rounded < 0 ? -rounded * 2e-7 : rounded * 2e-7) + smallest;
    return VIsMinimum ? voxel + more : voxel - more;
  }
  else
  {
    constexpr TPixel lowest = Limits::lowest();
    constexpr TPixel highest = Limits::max();
    const auto       wide = static_cast<double>(value);
    double           rounded = hasDepth == VIsMinimum ? floor(wide) : ceil(wide);
    if (sizeof(TPixel) == 8)
    {
      // some integers are one number
      constexpr double epsilon = std::numeric_limits<double>::epsilon();
      const double     spacing = (rounded < 0 ? -rounded : rounded) * epsilon;
      rounded = VIsMinimum ? rounded + spacing : rounded - spacing;
    }
    return rounded <= static_cast<double>(lowest)    ? lowest
           : rounded >= static_cast<double>(highest) ? highest
                                                     : static_cast<TPixel>(rounded);
  }
}

template <typename TPixel, bool VIsMinimum>
void
TileSearch<TPixel, VIsMinimum>::SetLeast(std::ptrdiff_t row)
{
  constexpr Number most = std::numeric_limits<Number>::infinity();
  Number           best[CellColumns];
  for (std::ptrdiff_t n = 0; n < CellColumns; ++n)
  {
    best[n] = most;
  }
  for (std::int32_t ray = m_Tile.cellBegins[row * CellColumns]; ray < m_Tile.cellBegins[(row + 1) * CellColumns]; ++ray)
  {
    Number & least = best[m_Tile.cells[ray] % CellColumns];
    least = Smaller(least, m_Tile.best[ray]);
  }
  TPixel * const least = m_Tile.least + row * CellColumns;
  for (std::ptrdiff_t n = 0; n < CellColumns; ++n)
  {
    least[n] = FindLeast(best[n], m_Tile.hasDepth);
  }
  if constexpr (HasLevels)
  {
    std::int16_t * const levels = m_Tile.leastLevels + row * CellColumns;
    for (std::ptrdiff_t n = 0; n < CellColumns; ++n)
    {
      const double level = floor((LevelType::Zero + static_cast<double>(best[n])) * m_Levels.scale);
      levels[n] = static_cast<std::int16_t>(static_cast<int>(Limit(level, -32765.0, 32767.0)) - (LevelSlack - 1));
    }
  }
  m_HasChanged[row] = false;
}

template <typename TPixel, bool VIsMinimum>
TPixel
TileSearch<TPixel, VIsMinimum>::Finish()
{
  this->Evaluate();
  for (std::ptrdiff_t row = 0; row < CellRows; ++row)
  {
    if (m_HasChanged[row])
    {
      this->SetLeast(row);
    }
  }
  TPixel least = m_Tile.least[0];
  for (std::ptrdiff_t n = 1; n < CellRows * CellColumns; ++n)
  {
    least = (VIsMinimum ? m_Tile.least[n] > least : m_Tile.least[n] < least) ? m_Tile.least[n] : least;
  }
  return least;
}

template <typename TPixel, bool VIsMinimum>
CellWindow
TileSearch<TPixel, VIsMinimum>::FindWindow(int axis, std::ptrdiff_t slice) const
{
  const double a = this->GetOffset(axis, static_cast<double>(slice));
  const double b = this->GetOffset(axis, static_cast<double>(slice + 1));
  // a little more, for what rounding errors do
  constexpr double slack = 1e-6;
  const double     left = -Larger(a, b) - slack;
  const double     right = 1.0 - Smaller(a, b) + slack;
  const double     first = floor(left);
  const double     last = floor(right);
  const auto       weight = [](double v) { return static_cast<std::int16_t>(Smaller(v * 32768.0, 32767.0)); };
  return { static_cast<std::ptrdiff_t>(first) + (axis == 0 ? m_Tile.column : m_Tile.row),
           static_cast<std::ptrdiff_t>(last - first),
           weight(left - first),
           weight(right - last) };
}

template <typename TPixel, bool VIsMinimum>
template <int VLast, bool VIsHalved>
void
TileSearch<TPixel, VIsMinimum>::BoundRows(const PairOfRows<TPixel> * rows,
                                          std::ptrdiff_t             count,
                                          const CellWindow &         window,
                                          RowBounds<TPixel> *        bounds)
{
  for (std::ptrdiff_t row = 0; row < count; ++row)
  {
    const TPixel * const a = rows[row].voxels[0];
    const TPixel * const b = rows[row].voxels[1];
    // one loop, so that numbers stay in registers
    for (std::ptrdiff_t n = 0; n < CellColumns; ++n)
    {
      TPixel best = GetBetter(GetBetter(NoVoxel, a[n]), b[n]);
      best = GetBetter(GetBetter(best, a[n + 1]), b[n + 1]);
      best = GetBetter(GetBetter(best, a[n + 2]), b[n + 2]);
      best = VLast > 1 ? GetBetter(GetBetter(best, a[n + 3]), b[n + 3]) : best;
      best = VLast > 2 ? GetBetter(GetBetter(best, a[n + 4]), b[n + 4]) : best;
      bounds[row].voxels[n] = best;
      if constexpr (HasLevels)
      {
        const auto get = [n](const TPixel * voxels) SHEARWARP_INLINE {
          return [n, voxels](int next)
                   SHEARWARP_INLINE { return LevelType::template Find<VIsHalved>(voxels[n + next]); };
        };
        bounds[row].levels[n] = Larger(FindHighest<VLast>(window, get(a)), FindHighest<VLast>(window, get(b)));
      }
    }
  }
}

template <typename TPixel, bool VIsMinimum>
template <int VLast>
std::uint32_t
TileSearch<TPixel, VIsMinimum>::FindCells(const RowBounds<TPixel> * rows,
                                          const CellWindow &        window,
                                          std::ptrdiff_t            row,
                                          TPixel (&voxels)[CellColumns]) const
{
  const TPixel * const       least = m_Tile.least + row * CellColumns;
  const std::int16_t * const leastLevels = m_Tile.leastLevels + row * CellColumns;
  const std::int16_t         equal = m_Tile.hasDepth ? -1 : 0;
  std::int16_t               flags[CellColumns];
  for (std::ptrdiff_t n = 0; n < CellColumns; ++n)
  {
    TPixel best = GetBetter(GetBetter(rows[0].voxels[n], rows[1].voxels[n]), rows[2].voxels[n]);
    best = VLast > 1 ? GetBetter(best, rows[3].voxels[n]) : best;
    best = VLast > 2 ? GetBetter(best, rows[4].voxels[n]) : best;
    voxels[n] = best;
    flags[n] = (VIsMinimum ? best < least[n] : best > least[n]) ? -1 : best == least[n] ? equal : 0;
    if constexpr (HasLevels)
    {
      const std::int16_t highest =
        FindHighest<VLast>(window, [rows, n](int next) SHEARWARP_INLINE { return rows[next].levels[n]; });
      flags[n] = highest >= leastLevels[n] ? flags[n] : 0;
    }
  }
  return FindSet(flags);
}

template <typename TPixel, bool VIsMinimum>
void
TileSearch<TPixel, VIsMinimum>::SearchPair(std::ptrdiff_t slice)
{
  const CellWindow     columns = this->FindWindow(0, slice);
  const CellWindow     rows = this->FindWindow(1, slice);
  const std::ptrdiff_t count = CellRows + rows.last + 1;
  const bool           isInside = columns.first >= 0 && columns.first + RowWidth <= m_Slices.columns;
  const TPixel * const slices[] = { this->GetSlice(slice), this->GetSlice(slice + 1) };
  const TPixel * const later = this->GetSlice(slice + 2);
  const std::ptrdiff_t laterColumns[] = { Limit<std::ptrdiff_t>(columns.first, 0, m_Slices.columns - 1),
                                          Limit<std::ptrdiff_t>(columns.first + CellColumns, 0, m_Slices.columns - 1) };
  PairOfRows<TPixel>   pairs[CellRows + CellReach - 1];
  TPixel               edges[CellRows + CellReach - 1][2][2 * RowWidth];
  for (std::ptrdiff_t row = 0; row < count; ++row)
  {
    const std::ptrdiff_t begin = Limit<std::ptrdiff_t>(rows.first + row, 0, m_Slices.rows - 1) * m_Slices.rowStride;
    for (int side = 0; side < 2; ++side)
    {
      const TPixel * const voxels = slices[side] + begin;
      pairs[row].voxels[side] =
        isInside ? voxels + columns.first : this->CopyRow(voxels, columns.first, edges[row][side]);
      PrefetchVoxel(later + (begin + laterColumns[side]));
    }
  }
  RowBounds<TPixel> bounds[CellRows + CellReach - 1];
  CallWithLast(columns, [&](auto last) {
    m_Levels.isHalved ? BoundRows<decltype(last)::value, sizeof(TPixel) == 2>(pairs, count, columns, bounds)
                      : BoundRows<decltype(last)::value, false>(pairs, count, columns, bounds);
  });
  const auto   first = static_cast<double>(slice);
  const double nearest = m_IsBackward ? first + 1.0 : first;
  for (std::ptrdiff_t row = 0; row < CellRows; ++row)
  {
    if (m_HasChanged[row])
    {
      this->SetLeast(row);
    }
    TPixel        voxels[CellColumns];
    std::uint32_t bits = 0;
    CallWithLast(rows, [&](auto last) {
      bits = this->template FindCells<decltype(last)::value>(bounds + row, rows, row, voxels);
    });
    for (; bits != 0; bits &= bits - 1)
    {
      const std::ptrdiff_t n = FindLowest(bits);
      const Number         bound = Load(voxels[n]);
      const std::int32_t * cell = m_Tile.cellBegins + (row * CellColumns + n);
      for (std::int32_t ray = cell[0]; ray < cell[1]; ++ray)
      {
        const bool isReached = (m_Tile.begin[ray] <= first + 1.0) & (m_Tile.end[ray] >= first);
        bool       isBetter = bound > m_Tile.best[ray];
        if (m_Tile.hasDepth)
        {
          isBetter |= (bound == m_Tile.best[ray]) & this->IsNearer(nearest, m_Tile.places[ray]);
        }
        m_Parts[m_Count] = { ray, static_cast<std::int32_t>(slice) };
        m_Count += (isReached & isBetter) ? 1 : 0;
        if (m_Count == RaysTogether)
        {
          this->Evaluate();
        }
      }
    }
  }
}

/** The bilinear interpolant of four voxels, columns first, on a line, (x, y) = (x0 + X t, y0 + Y t), as
 * c0 + c1 t + c2 t^2. */
template <typename TNumber>
struct LineExpansion
{
  typename ExactVector<TNumber>::Type c0, c1, c2;
};

template <typename TNumber, typename TVector = typename ExactVector<TNumber>::Type>
SHEARWARP_INLINE inline LineExpansion<TNumber>
ExpandOnLine(const TVector * v, TVector x0, TNumber X, TVector y0, TNumber Y)
{
  const TVector a10 = v[1] - v[0];
  const TVector a01 = v[2] - v[0];
  const TVector a11 = (v[3] - v[2]) - a10;
  return { (v[0] + a10 * x0) + (a01 + a11 * x0) * y0, (a10 * X + a01 * Y) + a11 * (x0 * Y + y0 * X), a11 * (X * Y) };
}

/** 3 x 3 x 2 voxels, columns first, the way that the rays go, from the least column and row on. */
template <typename TPixel, bool VIsMinimum>
void
TileSearch<TPixel, VIsMinimum>::LoadVoxels(const std::int32_t (&columns)[RaysTogether],
                                           const std::int32_t (&rows)[RaysTogether],
                                           const TPixel * const (&slices)[2][RaysTogether],
                                           Number (&voxels)[18][RaysTogether]) const
{
  const int  firstColumn = m_Step[0] > 0 ? 0 : 2;
  const int  firstRow = m_Step[1] > 0 ? 0 : 2;
  const auto stepX = static_cast<int>(m_Step[0]);
  const auto stepY = static_cast<int>(m_Step[1]);
  const auto lastColumn = static_cast<std::int32_t>(m_Slices.columns - 1);
  const auto lastRow = static_cast<std::int32_t>(m_Slices.rows - 1);
  if constexpr (sizeof(TPixel) <= 2)
  {
    // four columns at once
    constexpr int bits = 8 * sizeof(TPixel);
    constexpr int voxelsInWord = 32 / bits;
    constexpr int wordCount = 4 / voxelsInWord;
    using Four = std::conditional_t<wordCount == 1, std::uint32_t, std::uint64_t>;
    Four fours[6][RaysTogether];
    for (int n = 0; n < RaysTogether; ++n)
    {
      const bool isInside =
        (columns[n] >= 0) & (columns[n] <= lastColumn - 3) & (rows[n] >= 0) & (rows[n] <= lastRow - 2);
      if (isInside)
      {
        const std::ptrdiff_t offset = rows[n] * m_Slices.rowStride + columns[n];
        for (int line = 0; line < 6; ++line)
        {
          CopyBytes(&fours[line][n], slices[line / 3][n] + offset + line % 3 * m_Slices.rowStride, sizeof(Four));
        }
        continue;
      }
      for (int line = 0; line < 6; ++line)
      {
        const TPixel * const from = slices[line / 3][n] + Limit(rows[n] + line % 3, 0, lastRow) * m_Slices.rowStride;
        TPixel               edge[4];
        for (int column = 0; column < 4; ++column)
        {
          edge[column] = from[Limit(columns[n] + column, 0, lastColumn)];
        }
        CopyBytes(&fours[line][n], edge, sizeof(Four));
      }
    }
    std::uint32_t words[6][wordCount][RaysTogether];
    for (int line = 0; line < 6; ++line)
    {
      for (int word = 0; word < wordCount; ++word)
      {
        const int shift = 32 * (IsBigEndian ? wordCount - 1 - word : word);
        for (int n = 0; n < RaysTogether; ++n)
        {
          words[line][word][n] = static_cast<std::uint32_t>(fours[line][n] >> shift);
        }
      }
    }
    using Word = std::conditional_t<std::is_signed_v<TPixel>, std::int32_t, std::uint32_t>;
    for (int line = 0; line < 6; ++line)
    {
      const auto & from = words[line / 3 * 3 + firstRow + line % 3 * stepY];
      for (int column = 0; column < 3; ++column)
      {
        const int    place = firstColumn + column * stepX;
        const int    inWord = IsBigEndian ? voxelsInWord - 1 - place % voxelsInWord : place % voxelsInWord;
        const int    shift = 32 - bits * (inWord + 1);
        const auto & word = from[place / voxelsInWord];
        for (int n = 0; n < RaysTogether; ++n)
        {
          const auto shifted = static_cast<Word>(word[n] << shift);
          const auto number = static_cast<Number>(static_cast<std::int32_t>(shifted >> (32 - bits)));
          voxels[3 * line + column][n] = VIsMinimum ? -number : number;
        }
      }
    }
  }
  else
  {
    for (int n = 0; n < RaysTogether; ++n)
    {
      for (int line = 0; line < 6; ++line)
      {
        const std::ptrdiff_t row = Limit(rows[n] + firstRow + line % 3 * stepY, 0, lastRow);
        const TPixel * const from = slices[line / 3][n] + row * m_Slices.rowStride;
        for (int column = 0; column < 3; ++column)
        {
          voxels[3 * line + column][n] = Load(from[Limit(columns[n] + firstColumn + column * stepX, 0, lastColumn)]);
        }
      }
    }
  }
}

template <typename TPixel, bool VIsMinimum>
void
TileSearch<TPixel, VIsMinimum>::Evaluate()
{
  constexpr int lanes = RaysTogether;
  const int     count = m_Count;
  m_Count = 0;
  if (count == 0)
  {
    return;
  }
  // columns and rows from the corner where the ray begins, slices from the first one
  Number         fromX[lanes], fromY[lanes], fromZ[lanes], toZ[lanes], leasts[lanes];
  double         p[lanes], q[lanes], begins[lanes], ends[lanes], first[lanes];
  std::int32_t   columns[lanes], rows[lanes]; // the least of three
  const TPixel * slices[2][lanes];
  for (int n = 0; n < lanes; ++n)
  {
    const std::int32_t ray = m_Parts[n < count ? n : 0].ray;
    const std::int32_t slice = m_Parts[n < count ? n : 0].slice;
    p[n] = m_Tile.p[ray];
    q[n] = m_Tile.q[ray];
    begins[n] = m_Tile.begin[ray];
    ends[n] = m_Tile.end[ray];
    leasts[n] = m_Tile.best[ray];
    first[n] = static_cast<double>(slice);
    slices[0][n] = this->GetSlice(slice);
    slices[1][n] = this->GetSlice(slice + 1);
  }
  const auto   stepX = static_cast<double>(m_Step[0]);
  const auto   stepY = static_cast<double>(m_Step[1]);
  const double behindX = m_Step[0] > 0 ? 0.0 : 2.0;
  const double behindY = m_Step[1] > 0 ? 0.0 : 2.0;
  for (int n = 0; n < lanes; ++n)
  {
    const double x = stepX * (p[n] - this->GetOffset(0, first[n]));
    const double y = stepY * (q[n] - this->GetOffset(1, first[n]));
    const double baseX = floor(x);
    const double baseY = floor(y);
    columns[n] = static_cast<std::int32_t>(stepX * baseX - behindX);
    rows[n] = static_cast<std::int32_t>(stepY * baseY - behindY);
    fromX[n] = static_cast<Number>(x - baseX);
    fromY[n] = static_cast<Number>(y - baseY);
    fromZ[n] = static_cast<Number>(Larger(begins[n] - first[n], 0.0));
    toZ[n] = static_cast<Number>(Smaller(ends[n] - first[n], 1.0));
  }
  Number voxels[18][lanes];
  this->LoadVoxels(columns, rows, slices, voxels);

  const Number scaleOfVoxels = this->FindScaleOfVoxels();
  if constexpr (HasLargeNumbers)
  {
    for (int n = 0; n < lanes; ++n)
    {
      leasts[n] *= scaleOfVoxels;
      for (auto & voxelsOfRays : voxels)
      {
        voxelsOfRays[n] *= scaleOfVoxels;
      }
    }
  }

  Number        best[lanes], places[lanes];
  std::uint32_t betterRays = 0;
  for (int n = 0; n < lanes; n += Vectors::Count)
  {
    const auto   load = [n](const Number * numbers) SHEARWARP_INLINE -> Vector { return Vectors::Load(numbers + n); };
    const Vector none = Vectors::Set(0);
    const Vector all = Vectors::Set(1);
    const Vector nowhere = Vectors::Set(NoSample<Number>);
    constexpr Number largest = std::numeric_limits<Number>::max();
    const Vector     most = Vectors::Set(largest);
    const Number     three = 3;
    const Vector     least = load(leasts);
    const Vector     x0 = load(fromX);
    const Vector     y0 = load(fromY);
    const Vector     begin = load(fromZ);
    const Vector     end = load(toZ);
    Vector           v[18];
    SHEARWARP_UNROLL
    for (int voxel = 0; voxel < 18; ++voxel)
    {
      v[voxel] = load(voxels[voxel]);
    }
    const auto smaller = [](Vector a, Vector b) SHEARWARP_INLINE -> Vector { return b < a ? b : a; };
    const auto larger = [](Vector a, Vector b) SHEARWARP_INLINE -> Vector { return a < b ? b : a; };
    // what comes later is better only if it is more or, for a viewer behind the last slice, as much
    const auto isBetter = [isBackward = m_IsBackward](Vector a, Vector b)
                            SHEARWARP_INLINE { return isBackward ? a >= b : a > b; };
    Vector     bestOfAll = nowhere;
    Vector     placeOfBest = none;
    const auto takeCell =
      [&](const Vector(&a)[4], const Vector(&b)[4], Vector x, Vector y, Vector from, Vector to) SHEARWARP_INLINE {
        const Vector highest =
          larger(larger(larger(a[0], b[0]), larger(a[1], b[1])), larger(larger(a[2], b[2]), larger(a[3], b[3])));
        auto isCounted = (from <= to) & (highest >= least);
        if constexpr (IsFloat<TPixel>)
        {
          // what is not finite is left out
          const Vector sum = ((a[0] + b[0]) + (a[1] + b[1])) + ((a[2] + b[2]) + (a[3] + b[3]));
          isCounted &= (sum >= -most) & (sum <= most);
        }
        if (Vectors::GetBits(isCounted) == 0)
        {
          return;
        }
        // the cubic f0 + f1 t + f2 t^2 + f3 t^3
        const auto   before = ExpandOnLine<Number>(a, x, m_Slope[0], y, m_Slope[1]);
        const auto   behind = ExpandOnLine<Number>(b, x, m_Slope[0], y, m_Slope[1]);
        const Vector f0 = before.c0;
        const Vector f1 = before.c1 + (behind.c0 - before.c0);
        const Vector f2 = before.c2 + (behind.c1 - before.c1);
        const Vector f3 = behind.c2 - before.c2;
        const Vector threeF3 = three * f3;
        const Vector twoF2 = f2 + f2;
        const auto   evaluate = [&](Vector t) SHEARWARP_INLINE -> Vector { return ((f3 * t + f2) * t + f1) * t + f0; };
        const auto   derive = [&](Vector t) SHEARWARP_INLINE -> Vector { return (threeF3 * t + twoF2) * t + f1; };
        const Vector atBegin = smaller(evaluate(from), highest);
        const Vector atEnd = smaller(evaluate(to), highest);
        // the cubic is not above its control points (Bernstein)
        const Number third = Number(1) / three;
        const Vector step = (to - from) * third;
        const Vector control = smaller(larger(atBegin + step * derive(from), atEnd - step * derive(to)), highest);
        const auto   mayBeBetter = isCounted & (control > atBegin) & (control > atEnd) & (control >= least);
        Vector       value = atBegin;
        Vector       place = from;
        if (Vectors::GetBits(mayBeBetter) != 0)
        {
          // where its derivative falls through 0
          const Number scale = FindScaleOfSquares(f1, f2, f3);
          const Vector g1 = f1 * scale;
          const Vector g2 = f2 * scale;
          const Vector threeG3 = threeF3 * scale;
          const Vector discriminant = g2 * g2 - threeG3 * g1;
          const Vector root = Vectors::SquareRoot(larger(discriminant, none));
          const auto   isFalling = g2 <= none;
          const Vector numerator = isFalling ? g1 : Vector(-(g2 + root));
          const Vector denominator = isFalling ? Vector(root - g2) : threeG3;
          const Vector t = numerator / denominator;
          const Vector atRoot = smaller(evaluate(t), control);
          const auto takesRoot = mayBeBetter & (discriminant >= none) & (t > from) & (t < to) & isBetter(atRoot, value);
          value = takesRoot ? atRoot : value;
          place = takesRoot ? t : place;
        }
        const auto takesEnd = isBetter(atEnd, value);
        value = takesEnd ? atEnd : value;
        place = takesEnd ? to : place;
        const auto isTaken = isCounted & isBetter(value, bestOfAll);
        bestOfAll = isTaken ? value : bestOfAll;
        placeOfBest = isTaken ? place : placeOfBest;
      };
    // a ray leaves its first column or its first row, then the other one
    const Vector leavesX = (all - x0) * m_PerVoxel[0];
    const Vector leavesY = (all - y0) * m_PerVoxel[1];
    const auto   isXFirst = leavesX <= leavesY;
    const Vector leavesFirst = smaller(leavesX, leavesY);
    const Vector leavesLast = larger(leavesX, leavesY);
    const auto   next = [&](int voxel) SHEARWARP_INLINE -> Vector { return isXFirst ? v[voxel + 1] : v[voxel + 3]; };
    takeCell({ v[0], v[1], v[3], v[4] }, { v[9], v[10], v[12], v[13] }, x0, y0, begin, smaller(leavesFirst, end));
    takeCell({ next(0), next(1), next(3), next(4) },
             { next(9), next(10), next(12), next(13) },
             isXFirst ? Vector(x0 - all) : x0,
             isXFirst ? y0 : Vector(y0 - all),
             larger(leavesFirst, begin),
             smaller(leavesLast, end));
    takeCell(
      { v[4], v[5], v[7], v[8] }, { v[13], v[14], v[16], v[17] }, x0 - all, y0 - all, larger(leavesLast, begin), end);
    betterRays |= Vectors::GetBits(bestOfAll >= least) << n;
    Vectors::Store(best + n, bestOfAll);
    Vectors::Store(places + n, placeOfBest);
  }
  for (betterRays &= (std::uint32_t{ 1 } << count) - 1; betterRays != 0; betterRays &= betterRays - 1)
  {
    const int          n = FindLowest(betterRays);
    const Number       value = best[n] / scaleOfVoxels;
    const std::int32_t ray = m_Parts[n].ray;
    const std::int32_t slice = m_Parts[n].slice;
    const double       place = static_cast<double>(slice) + static_cast<double>(places[n]);
    if (value > m_Tile.best[ray] || (value == m_Tile.best[ray] && this->IsNearer(place, m_Tile.places[ray])))
    {
      m_Tile.best[ray] = value;
      m_Tile.places[ray] = place;
      m_HasChanged[m_Tile.cells[ray] / CellColumns] = true;
    }
  }
}

template <bool VIsMinimum, typename TPixel>
TPixel
EvaluateParts(const ExactView<TPixel> & view, const ExactTile<TPixel> & tile, const RayPart * parts, std::size_t count)
{
  TileSearch<TPixel, VIsMinimum> search(view, tile, true);
  for (std::size_t n = 0; n < count; ++n)
  {
    search.Add(parts[n]);
  }
  return search.Finish();
}

/** See Kernels. */
template <typename TPixel>
TPixel
EvaluateParts(const ExactView<TPixel> & view, const ExactTile<TPixel> & tile, const RayPart * parts, std::size_t count)
{
  return tile.isMinimum ? EvaluateParts<true>(view, tile, parts, count)
                        : EvaluateParts<false>(view, tile, parts, count);
}

template <bool VIsMinimum, typename TPixel>
TPixel
SearchSlab(const ExactView<TPixel> & view,
           const ExactTile<TPixel> & tile,
           std::ptrdiff_t            sliceBegin,
           std::ptrdiff_t            sliceEnd)
{
  TileSearch<TPixel, VIsMinimum> search(view, tile, false);
  for (std::ptrdiff_t slice = sliceBegin; slice < sliceEnd; ++slice)
  {
    search.SearchPair(slice);
  }
  return search.Finish();
}

/** See Kernels. */
template <typename TPixel>
TPixel
SearchSlab(const ExactView<TPixel> & view,
           const ExactTile<TPixel> & tile,
           std::ptrdiff_t            sliceBegin,
           std::ptrdiff_t            sliceEnd)
{
  return tile.isMinimum ? SearchSlab<true>(view, tile, sliceBegin, sliceEnd)
                        : SearchSlab<false>(view, tile, sliceBegin, sliceEnd);
}
