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
/* The maxima of the interpolant along rays. For minima, voxels change their sign when they are loaded.
 *
 * Each file of kernels includes this file after Scalar.h (see there) and after ExactVector<float> and
 * ExactVector<double>. An ExactVector holds the numbers that are computed together, and its operators act on each. */

template <typename T>
T
Limit(T v, T low, T high)
{
  return v < low ? low : v > high ? high : v;
}

/** Levels are voxels in 15 bits, so that the difference of two levels has 16 bits. A better voxel has a higher level.
 * The level of a number between voxels is (number + Zero) * scale. Numbers have the other sign for minima. */
template <typename TPixel, bool VIsMinimum>
struct Levels
{
  static constexpr bool IsSigned = static_cast<TPixel>(-1) < 0;
  static constexpr int  Sign = sizeof(TPixel) == 2 && !IsSigned ? 0x8000 : 0;
  static constexpr int  All = sizeof(TPixel) == 2 || IsSigned ? 0xFFFF : 0xFF;
  static constexpr int  Flip = VIsMinimum ? Sign ^ All : Sign;
  static constexpr auto Zero = static_cast<std::int16_t>(Flip);

  /** Prepares for voxels from \a lowest to \a highest. */
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

/** Stands for the levels of pixel types that have none. */
struct NoLevels
{
  template <typename TPixel>
  NoLevels(TPixel, TPixel)
  {}

  static constexpr bool isHalved = false;
};

/** Returns (1 - w / 2^15) a + w / 2^15 b, with an error of at most half a unit. */
inline std::int16_t
Mix(std::int16_t a, std::int16_t b, std::int16_t w)
{
  const auto difference = static_cast<std::int16_t>(b - a);
  return static_cast<std::int16_t>(a + static_cast<std::int16_t>((((difference * w) >> 14) + 1) >> 1));
}

/** The voxels along one axis that have weight in a cell of the sheared grid, from a slice to the next one. In cell n
 * they begin at voxel `first` + n, which is the window's voxel 0. The cell's rays lie between a place `left` / 2^15
 * behind voxel 0 and a place `right` / 2^15 behind voxel `last`. `last` is 1, 2 or 3. */
struct CellWindow
{
  std::ptrdiff_t first, last;
  std::int16_t   left, right;
};

/** Returns the highest level in a window. The voxels 0 to VLast + 1 of the window have the levels \a get(n). */
template <int VLast, typename TGet>
SHEARWARP_INLINE inline std::int16_t
FindHighest(const CellWindow & window, const TGet & get)
{
  const std::int16_t first = get(1);
  const std::int16_t last = get(VLast);
  const std::int16_t ends = Larger(Mix(get(0), first, window.left), Mix(last, get(VLast + 1), window.right));
  return Larger(Larger(ends, VLast > 2 ? get(2) : last), Larger(first, last));
}

/** Calls a function with the window's `last` as a constant. */
template <typename TFunction>
void
CallWithLast(const CellWindow & window, const TFunction & function)
{
  window.last == 1   ? function(std::integral_constant<int, 1>())
  : window.last == 2 ? function(std::integral_constant<int, 2>())
                     : function(std::integral_constant<int, 3>());
}

/** A row of a slice, and the same row of the next slice. */
template <typename TPixel>
struct PairOfRows
{
  const TPixel * voxels[2];
};

/** For each cell of a row, the best voxel of a pair of rows, and the highest level between the voxels of each row. */
template <typename TPixel>
struct RowBounds
{
  TPixel       voxels[CellColumns];
  std::int16_t levels[CellColumns];
};

/** For the ray of each lane, a cell between four voxels of a slice and four voxels of the next slice. Voxels are in the
 * direction of the ray, columns first. Places on the ray are 0 in the slice and 1 in the next one. The ray is in the
 * cell from `begin` to `end`. At 0 it is at column `x` and row `y` of the cell, or beside the cell if it enters later.
 */
template <typename TNumber>
struct CellLanes
{
  using Vector = typename ExactVector<TNumber>::Type;

  Vector front[4], back[4];
  Vector x, y;
  Vector begin, end;
};

/** The bilinear interpolant of four voxels on a line: c0 + c1 t + c2 t^2. */
template <typename TNumber>
struct Quadratic
{
  typename ExactVector<TNumber>::Type c0, c1, c2;
};

/** Returns the bilinear interpolant on the line (x0 + X t, y0 + Y t). */
template <typename TNumber, typename TVector = typename ExactVector<TNumber>::Type>
SHEARWARP_INLINE inline Quadratic<TNumber>
ExpandOnLine(const TVector * v, TVector x0, TNumber X, TVector y0, TNumber Y)
{
  const TVector a10 = v[1] - v[0];
  const TVector a01 = v[2] - v[0];
  const TVector a11 = (v[3] - v[2]) - a10;
  return { (v[0] + a10 * x0) + (a01 + a11 * x0) * y0, (a10 * X + a01 * Y) + a11 * (x0 * Y + y0 * X), a11 * (X * Y) };
}

/** The trilinear interpolant on a ray: f0 + f1 t + f2 t^2 + f3 t^3. */
template <typename TNumber>
struct Cubic
{
  using Vector = typename ExactVector<TNumber>::Type;

  SHEARWARP_INLINE Vector
  Evaluate(Vector t) const
  {
    return ((f3 * t + f2) * t + f1) * t + f0;
  }

  SHEARWARP_INLINE Vector
  Derive(Vector t) const
  {
    return (threeF3 * t + twoF2) * t + f1;
  }

  Vector f0, f1, f2, f3, threeF3, twoF2;
};

/** Returns the trilinear interpolant of a cell on rays that pass \a slope columns and rows from slice to slice. */
template <typename TNumber>
SHEARWARP_INLINE inline Cubic<TNumber>
ExpandInCell(const CellLanes<TNumber> & cell, const TNumber (&slope)[2])
{
  using Vector = typename ExactVector<TNumber>::Type;
  const TNumber three = 3;
  const auto    front = ExpandOnLine<TNumber>(cell.front, cell.x, slope[0], cell.y, slope[1]);
  const auto    back = ExpandOnLine<TNumber>(cell.back, cell.x, slope[0], cell.y, slope[1]);
  const Vector  f0 = front.c0;
  const Vector  f1 = front.c1 + (back.c0 - front.c0);
  const Vector  f2 = front.c2 + (back.c1 - front.c1);
  const Vector  f3 = back.c2 - front.c2;
  return { f0, f1, f2, f3, three * f3, f2 + f2 };
}

/** For the ray of each lane, the best value in the cells so far, and its place. Values below `least` are not needed. */
template <typename TNumber>
struct BestLanes
{
  using Vector = typename ExactVector<TNumber>::Type;

  Vector least, best, place;
};

/** The rays that are searched together, from a slice to the next one. In the slice, a ray is at column `x` and row `y`,
 * counted from the corner of its first cell in the direction of the ray. The ray begins and ends between the two
 * slices. `best` is the ray's best value so far. `voxels` are 3 x 3 x 2 voxels in the direction of the ray, columns
 * first: a ray passes at most one column and one row. */
template <typename TNumber>
struct RayGroup
{
  static constexpr int Rays = 16; // at most 31

  TNumber x[Rays], y[Rays];
  TNumber missing[2][2][Rays]; // infinite if a part does not have the first or last columns, or rows, of cells
  TNumber begin[Rays], end[Rays];
  TNumber best[Rays];
  TNumber voxels[18][Rays];
};

/** Finds the maxima of the rays of a group. Pixel types with the same numbers share the search. With VMayBeInfinite,
 * voxels may be infinite or not-a-number. With VMayBeLarge, they may be so large or so small that products of them
 * overflow or vanish. */
template <typename TNumber, bool VMayBeInfinite, bool VMayBeLarge>
class GroupSearch
{
public:
  using Group = RayGroup<TNumber>;

  /** The magnitudes of \a shear are the columns and rows that a ray passes from slice to slice. Backward rays come from
   * the last slice. Only in a part do cells miss. The magnitude of a voxel is at most that of \a lowest or \a highest.
   */
  GroupSearch(const double (&shear)[2], bool isBackward, bool isPart, TNumber lowest, TNumber highest);

  /** Writes each ray's best value and its place: 0 in the slice, 1 in the next one. Returns, as bits, the rays whose
   * value is at least the best one so far. */
  std::uint32_t
  Search(const Group & group, TNumber (&best)[Group::Rays], TNumber (&places)[Group::Rays]) const;

private:
  using Vectors = ExactVector<TNumber>;
  using Vector = typename Vectors::Type;
  using Flags = decltype(Vector{} < Vector{});

  static constexpr double Large = 0x1p1000;

  /** Returns whether differences of the voxels may overflow. */
  static bool
  IsLarge(const CellLanes<TNumber> & cell)
  {
    bool isLarge = false;
    for (int n = 0; n < 4; ++n)
    {
      isLarge |= (cell.front[n] < -Large) | (cell.front[n] > Large) | (cell.back[n] < -Large) | (cell.back[n] > Large);
    }
    return isLarge;
  }

  /** Returns a power of two. Squares of coefficients that are multiplied by it neither overflow nor vanish. */
  static TNumber
  FindScaleOfSquares(Vector f1, Vector f2, Vector f3)
  {
    if constexpr (VMayBeLarge)
    {
      const auto   abs = [](double v) { return v < 0 ? -v : v; };
      const double largest = Larger(Larger(abs(f1), abs(f2)), abs(f3));
      return largest > 0x1p400 ? 0x1p-600 : largest < 0x1p-400 ? 0x1p600 : 1.0;
    }
    return 1;
  }

  SHEARWARP_INLINE static Vector
  GetLower(Vector a, Vector b)
  {
    return b < a ? b : a;
  }

  SHEARWARP_INLINE static Vector
  GetHigher(Vector a, Vector b)
  {
    return a < b ? b : a;
  }

  /** Returns the lanes where \a value is better than a value before it. Among equal values the one nearer to the viewer
   * is better. */
  SHEARWARP_INLINE Flags
  IsBetter(Vector value, Vector before) const
  {
    return m_IsBackward ? value >= before : value > before;
  }

  /** Returns the lanes whose rays meet the cell, if the cell may have a better value and all its voxels are finite. */
  static Flags
  FindCounted(const CellLanes<TNumber> & cell, Vector highest, Vector least);

  /** Raises \a value to the cubic's local maximum within the cell, in the given lanes. The maximum is at most \a bound.
   */
  void
  TakeLocalMaximum(const CellLanes<TNumber> & cell,
                   const Cubic<TNumber> &     cubic,
                   Vector                     bound,
                   Flags                      lanes,
                   Vector &                   value,
                   Vector &                   place) const;

  /** Raises best values to the maximum in the cell. A ray's cells come in the order of the slices. */
  void
  TakeCell(const CellLanes<TNumber> & cell, BestLanes<TNumber> & lanes) const;

  /** Does the same for voxels of any magnitude. */
  void
  TakeAnyCell(const CellLanes<TNumber> & cell, BestLanes<TNumber> & lanes) const;

  /** Does the same as Search() for as many rays as a vector has lanes, from ray \a first on. */
  std::uint32_t
  SearchLanes(const Group & group, int first, TNumber * best, TNumber * places) const;

  bool    m_IsBackward;
  bool    m_IsPart; // in columns or rows
  bool    m_HasLargeVoxels;
  TNumber m_Slope[2];    // columns and rows that a ray passes from slice to slice
  TNumber m_PerVoxel[2]; // slices in which a ray passes a column or a row
};

template <typename TNumber, bool VMayBeInfinite, bool VMayBeLarge>
GroupSearch<TNumber, VMayBeInfinite, VMayBeLarge>::GroupSearch(const double (&shear)[2],
                                                               bool    isBackward,
                                                               bool    isPart,
                                                               TNumber lowest,
                                                               TNumber highest)
  : m_IsBackward(isBackward)
  , m_IsPart(isPart)
  , m_HasLargeVoxels(highest > Large || lowest < -Large)
{
  constexpr TNumber most = std::numeric_limits<TNumber>::max();
  for (int axis = 0; axis < 2; ++axis)
  {
    const double slope = shear[axis] > 0 ? shear[axis] : -shear[axis];
    m_Slope[axis] = static_cast<TNumber>(slope);
    m_PerVoxel[axis] = slope > 1 / static_cast<double>(most) ? static_cast<TNumber>(1 / slope) : most;
  }
}

template <typename TNumber, bool VMayBeInfinite, bool VMayBeLarge>
SHEARWARP_INLINE inline auto
GroupSearch<TNumber, VMayBeInfinite, VMayBeLarge>::FindCounted(const CellLanes<TNumber> & cell,
                                                               Vector                     highest,
                                                               Vector                     least) -> Flags
{
  Flags isCounted = (cell.begin <= cell.end) & (highest >= least);
  if constexpr (VMayBeInfinite)
  {
    constexpr TNumber largest = std::numeric_limits<TNumber>::max();
    const Vector      most = Vectors::Set(largest);
    const auto &      a = cell.front;
    const auto &      b = cell.back;
    const Vector      sum = ((a[0] + b[0]) + (a[1] + b[1])) + ((a[2] + b[2]) + (a[3] + b[3]));
    isCounted &= (sum >= -most) & (sum <= most);
  }
  return isCounted;
}

template <typename TNumber, bool VMayBeInfinite, bool VMayBeLarge>
SHEARWARP_INLINE inline void
GroupSearch<TNumber, VMayBeInfinite, VMayBeLarge>::TakeLocalMaximum(const CellLanes<TNumber> & cell,
                                                                    const Cubic<TNumber> &     cubic,
                                                                    Vector                     bound,
                                                                    Flags                      lanes,
                                                                    Vector &                   value,
                                                                    Vector &                   place) const
{
  // the derivative, 3 g3 t^2 + 2 g2 t + g1 but for the scale, falls through 0 at t
  const Vector  zero = Vectors::Set(0);
  const TNumber scale = FindScaleOfSquares(cubic.f1, cubic.f2, cubic.f3);
  const Vector  g1 = cubic.f1 * scale;
  const Vector  g2 = cubic.f2 * scale;
  const Vector  threeG3 = cubic.threeF3 * scale;
  const Vector  discriminant = g2 * g2 - threeG3 * g1;
  const Vector  root = Vectors::SquareRoot(GetHigher(discriminant, zero));
  const Flags   isFalling = g2 <= zero;
  const Vector  numerator = isFalling ? g1 : Vector(-(g2 + root));
  const Vector  denominator = isFalling ? Vector(root - g2) : threeG3;
  const Vector  t = numerator / denominator;
  const Vector  atRoot = GetLower(cubic.Evaluate(t), bound);
  const Flags   isTaken =
    lanes & (discriminant >= zero) & (t > cell.begin) & (t < cell.end) & this->IsBetter(atRoot, value);
  value = isTaken ? atRoot : value;
  place = isTaken ? t : place;
}

template <typename TNumber, bool VMayBeInfinite, bool VMayBeLarge>
SHEARWARP_INLINE inline void
GroupSearch<TNumber, VMayBeInfinite, VMayBeLarge>::TakeCell(const CellLanes<TNumber> & cell,
                                                            BestLanes<TNumber> &       lanes) const
{
  const auto & a = cell.front;
  const auto & b = cell.back;
  const Vector highest = GetHigher(GetHigher(GetHigher(a[0], b[0]), GetHigher(a[1], b[1])),
                                   GetHigher(GetHigher(a[2], b[2]), GetHigher(a[3], b[3])));
  const Flags  isCounted = FindCounted(cell, highest, lanes.least);
  if (Vectors::GetBits(isCounted) == 0)
  {
    return;
  }
  const auto   cubic = ExpandInCell<TNumber>(cell, m_Slope);
  const Vector atBegin = GetLower(cubic.Evaluate(cell.begin), highest);
  const Vector atEnd = GetLower(cubic.Evaluate(cell.end), highest);
  // a cubic is not above the control points of its Bernstein form
  const TNumber three = 3;
  const TNumber third = TNumber(1) / three;
  const Vector  step = (cell.end - cell.begin) * third;
  const Vector  bound =
    GetLower(GetHigher(atBegin + step * cubic.Derive(cell.begin), atEnd - step * cubic.Derive(cell.end)), highest);
  const Flags mayBeBetter = isCounted & (bound > atBegin) & (bound > atEnd) & (bound >= lanes.least);
  Vector      value = atBegin;
  Vector      place = cell.begin;
  if (Vectors::GetBits(mayBeBetter) != 0)
  {
    this->TakeLocalMaximum(cell, cubic, bound, mayBeBetter, value, place);
  }
  const Flags takesEnd = this->IsBetter(atEnd, value);
  value = takesEnd ? atEnd : value;
  place = takesEnd ? cell.end : place;
  const Flags isTaken = isCounted & this->IsBetter(value, lanes.best);
  lanes.best = isTaken ? value : lanes.best;
  lanes.place = isTaken ? place : lanes.place;
}

template <typename TNumber, bool VMayBeInfinite, bool VMayBeLarge>
SHEARWARP_INLINE inline void
GroupSearch<TNumber, VMayBeInfinite, VMayBeLarge>::TakeAnyCell(const CellLanes<TNumber> & cell,
                                                               BestLanes<TNumber> &       lanes) const
{
  if constexpr (VMayBeLarge)
  {
    // most volumes have no large voxels, whose differences overflow
    if (m_HasLargeVoxels && IsLarge(cell))
    {
      CellLanes<TNumber> scaled = cell;
      for (int n = 0; n < 4; ++n)
      {
        scaled.front[n] *= 0x1p-30;
        scaled.back[n] *= 0x1p-30;
      }
      BestLanes<TNumber> best{ lanes.least * 0x1p-30, NoSample<TNumber>, lanes.place };
      this->TakeCell(scaled, best);
      best.best *= 0x1p30;
      lanes.place = this->IsBetter(best.best, lanes.best) ? best.place : lanes.place;
      lanes.best = this->IsBetter(best.best, lanes.best) ? best.best : lanes.best;
      return;
    }
  }
  this->TakeCell(cell, lanes);
}

template <typename TNumber, bool VMayBeInfinite, bool VMayBeLarge>
SHEARWARP_INLINE inline std::uint32_t
GroupSearch<TNumber, VMayBeInfinite, VMayBeLarge>::SearchLanes(const Group & group,
                                                               int           first,
                                                               TNumber *     best,
                                                               TNumber *     places) const
{
  const auto load = [first](const TNumber * numbers)
                      SHEARWARP_INLINE -> Vector { return Vectors::Load(numbers + first); };
  const Vector one = Vectors::Set(1);
  const Vector x = load(group.x);
  const Vector y = load(group.y);
  const Vector begin = load(group.begin);
  const Vector end = load(group.end);
  Vector       v[18];
  SHEARWARP_UNROLL
  for (int voxel = 0; voxel < 18; ++voxel)
  {
    v[voxel] = load(group.voxels[voxel]);
  }
  // the ray leaves its first column or its first row, then the other one
  const Vector leavesX = (one - x) * m_PerVoxel[0];
  const Vector leavesY = (one - y) * m_PerVoxel[1];
  const auto   isXFirst = leavesX <= leavesY;
  const Vector leavesFirst = GetLower(leavesX, leavesY);
  const Vector leavesLast = GetHigher(leavesX, leavesY);
  const auto   next = [&](int voxel) SHEARWARP_INLINE -> Vector { return isXFirst ? v[voxel + 1] : v[voxel + 3]; };
  Vector       begins[] = { begin, GetHigher(leavesFirst, begin), GetHigher(leavesLast, begin) };
  if (m_IsPart)
  {
    const auto & [columns, rows] = group.missing;
    const Vector ofFirst[] = { load(columns[0]), load(rows[0]) };
    const Vector ofLast[] = { load(columns[1]), load(rows[1]) };
    begins[0] += ofFirst[0] + ofFirst[1];
    begins[1] += isXFirst ? Vector(ofLast[0] + ofFirst[1]) : Vector(ofFirst[0] + ofLast[1]);
    begins[2] += ofLast[0] + ofLast[1];
  }

  BestLanes<TNumber> lanes{ load(group.best), Vectors::Set(NoSample<TNumber>), Vectors::Set(0) };
  this->TakeAnyCell(
    { { v[0], v[1], v[3], v[4] }, { v[9], v[10], v[12], v[13] }, x, y, begins[0], GetLower(leavesFirst, end) }, lanes);
  this->TakeAnyCell({ { next(0), next(1), next(3), next(4) },
                      { next(9), next(10), next(12), next(13) },
                      isXFirst ? Vector(x - one) : x,
                      isXFirst ? y : Vector(y - one),
                      begins[1],
                      GetLower(leavesLast, end) },
                    lanes);
  this->TakeAnyCell({ { v[4], v[5], v[7], v[8] }, { v[13], v[14], v[16], v[17] }, x - one, y - one, begins[2], end },
                    lanes);
  Vectors::Store(best + first, lanes.best);
  Vectors::Store(places + first, lanes.place);
  return Vectors::GetBits(lanes.best >= lanes.least);
}

template <typename TNumber, bool VMayBeInfinite, bool VMayBeLarge>
std::uint32_t
GroupSearch<TNumber, VMayBeInfinite, VMayBeLarge>::Search(const Group & group,
                                                          TNumber (&best)[Group::Rays],
                                                          TNumber (&places)[Group::Rays]) const
{
  static_assert(Group::Rays % Vectors::Count == 0);
  std::uint32_t betterRays = 0;
  for (int n = 0; n < Group::Rays; n += Vectors::Count)
  {
    betterRays |= this->SearchLanes(group, n, best, places) << n;
  }
  return betterRays;
}

/** Finds the maxima of the rays of a patch. */
template <typename TPixel, bool VIsMinimum>
class PatchSearch
{
public:
  using Number = ExactNumber<TPixel>;

  /** A new search sets `least` of all cells. Another one only updates `least`. */
  PatchSearch(const ExactView<TPixel> & view, const RayPatch<TPixel> & patch, bool isNew);

  /** Searches from a slice to the next one all rays that voxels near them do not exclude. */
  void
  SearchPair(std::ptrdiff_t slice);

  /** Searches one ray from a slice to the next one. Finish() completes the search. */
  void
  Add(RaySegment segment)
  {
    m_Segments[m_Count++] = segment;
    if (m_Count == RaysTogether)
    {
      this->Evaluate();
    }
  }

  /** Completes the search, sets `least`, and returns the least of all cells. */
  TPixel
  Finish();

private:
  using Group = RayGroup<Number>;
  using LevelType = std::conditional_t<(sizeof(TPixel) <= 2), Levels<TPixel, VIsMinimum>, NoLevels>;

  /** Four voxels of at most two bytes. */
  using Four = std::conditional_t<sizeof(TPixel) == 1, std::uint32_t, std::uint64_t>;
  static constexpr int WordsInFour = sizeof(TPixel) == 1 ? 1 : 2;

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
  static constexpr bool IsBigEndian = true;
#else
  static constexpr bool IsBigEndian = false;
#endif

  static constexpr int  RaysTogether = Group::Rays;
  static constexpr bool HasLevels = sizeof(TPixel) <= 2;

  /** Doubles may be so large or so small that products of them overflow or vanish. */
  static constexpr bool MayBeLarge = std::is_same_v<TPixel, double>;

  /** Rounding may lower a level by half a unit if voxels are halved, and, along each axis, by one unit for the weight
   * and half a unit for the product. */
  static constexpr int LevelSlack = 4;

  static constexpr TPixel NoVoxel = VIsMinimum ? NoSample<TPixel, Extremum::Minimum> : NoSample<TPixel>;

  /** The most voxels along one axis that have weight in a cell of the sheared grid, from a slice to the next one. */
  static constexpr int CellReach = 5;

  /** The most voxels of a row that have weight in a row of cells. */
  static constexpr std::ptrdiff_t RowWidth = CellColumns + CellReach - 1;

  /** The most rows that have weight in a patch. */
  static constexpr std::ptrdiff_t MostRows = CellRows + CellReach - 1;

  /** Rows of a slice and of the next one: in the volume, or copies. */
  struct SlicePair
  {
    PairOfRows<TPixel> rows[MostRows];
    TPixel             copies[MostRows][2][2 * RowWidth];
  };

  /** Where the voxels of a RayGroup are: the least column and row of each ray, and the two slices. */
  struct VoxelPlaces
  {
    std::int32_t   columns[RaysTogether], rows[RaysTogether];
    const TPixel * slices[2][RaysTogether];
  };

  static Number
  Load(TPixel voxel)
  {
    return VIsMinimum ? -static_cast<Number>(voxel) : static_cast<Number>(voxel);
  }

  /** Returns the better voxel. \a voxel may be not-a-number, which is never better. */
  static TPixel
  GetBetter(TPixel best, TPixel voxel)
  {
    return (VIsMinimum ? voxel < best : voxel > best) ? voxel : best;
  }

  /** Returns what a voxel must exceed, or reach if there is depth, to be better than \a best. */
  static TPixel
  FindLeast(Number best, bool hasDepth);

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
    return m_Slices.voxels +
           Limit<std::ptrdiff_t>(slice - m_View.first.slice, 0, m_Slices.slices - 1) * m_Slices.sliceStride;
  }

  CellWindow
  FindWindow(int axis, std::ptrdiff_t slice) const;

  void
  SetLeast(std::ptrdiff_t row);

  /** Returns the voxels of a row from column \a first on. Beside the volume, columns have the outer column's voxel. */
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

  /** Finds \a count rows that have weight in the patch, and prefetches the slice behind them. */
  void
  FindRows(std::ptrdiff_t slice,
           std::ptrdiff_t firstColumn,
           std::ptrdiff_t firstRow,
           std::ptrdiff_t count,
           SlicePair &    pair) const;

  template <int VLast, bool VIsHalved>
  static void
  BoundRows(const PairOfRows<TPixel> * rows,
            std::ptrdiff_t             count,
            const CellWindow &         window,
            RowBounds<TPixel> *        bounds);

  /** Returns the cells of a row that may have a better value, as bits, and writes the best voxel of each cell. */
  template <int VLast>
  std::uint32_t
  FindCells(const RowBounds<TPixel> * rows,
            const CellWindow &        window,
            std::ptrdiff_t            row,
            TPixel (&voxels)[CellColumns]) const;

  /** Adds the rays of a cell for which \a bound, the best voxel near the cell, is better, or as good and nearer. */
  void
  AddRays(std::ptrdiff_t cell, Number bound, std::ptrdiff_t slice);

  /** Places the rays of the first \a count segments. The other rays of the group are copies of the first one. */
  void
  PlaceRays(int count, Group & group, VoxelPlaces & places) const;

  /** Finds which cells the part of the volume does not have. */
  void
  FindMissing(const VoxelPlaces & places, Group & group) const;

  /** Loads voxels one by one. */
  void
  LoadSingly(const VoxelPlaces & places, Group & group) const;

  /** Loads four voxels of a row at once. Pixels have one or two bytes. */
  void
  LoadFours(const VoxelPlaces & places, Group & group) const;

  /** Copies four voxels of three rows of two slices for each ray. Beside the volume, they are the outer voxels. */
  void
  CopyLines(const VoxelPlaces & places, Four (&fours)[6][RaysTogether]) const;

  /** Converts three of four voxels to numbers, in the direction of rays. */
  void
  SplitLine(const std::uint32_t (&words)[WordsInFour][RaysTogether], Number (*voxels)[RaysTogether]) const;

  /** Gives a ray a value if it is better than the ray's best one so far, or as good and nearer to the viewer. */
  void
  TakeBest(const RaySegment & segment, Number value, Number placeInSegment);

  /** Evaluates the segments that were added. */
  void
  Evaluate();

  const ExactView<TPixel> &  m_View;
  const RayPatch<TPixel> &   m_Patch;
  const SliceStack<TPixel> & m_Slices;
  bool                       m_IsBackward;
  bool                       m_IsPart;  // in columns or rows
  std::ptrdiff_t             m_Step[2]; // 1 or -1: the direction of rays
  LevelType                  m_Levels;
  bool                       m_HasChanged[CellRows]{};
  RaySegment                 m_Segments[RaysTogether]{};
  int                        m_Count{ 0 };

  GroupSearch<Number, IsFloat<TPixel>, MayBeLarge> m_GroupSearch;
};

template <typename TPixel, bool VIsMinimum>
PatchSearch<TPixel, VIsMinimum>::PatchSearch(const ExactView<TPixel> & view, const RayPatch<TPixel> & patch, bool isNew)
  : m_View(view)
  , m_Patch(patch)
  , m_Slices(view.slices)
  , m_IsBackward(view.depth.perSlice < 0)
  , m_IsPart(!(view.slices.columnEnds.first && view.slices.columnEnds.last && view.slices.rowEnds.first &&
               view.slices.rowEnds.last))
  , m_Step{ view.shear[0] > 0 ? -1 : 1, view.shear[1] > 0 ? -1 : 1 }
  , m_Levels(view.slices.lowest, view.slices.highest)
  , m_GroupSearch(view.shear,
                  m_IsBackward,
                  m_IsPart,
                  static_cast<Number>(view.slices.lowest),
                  static_cast<Number>(view.slices.highest))
{
  for (bool & hasChanged : m_HasChanged)
  {
    hasChanged = isNew;
  }
}

template <typename TPixel, bool VIsMinimum>
TPixel
PatchSearch<TPixel, VIsMinimum>::FindLeast(Number best, bool hasDepth)
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
    // rounding went beyond the value
    const TPixel more = static_cast<TPixel>(rounded < 0 ? -rounded * 2e-7 : rounded * 2e-7) + smallest;
    return VIsMinimum ? voxel + more : voxel - more;
  }
  else
  {
    constexpr TPixel lowest = Limits::lowest();
    constexpr TPixel highest = Limits::max();
    const auto       wide = static_cast<double>(value);
    double           rounded = hasDepth == VIsMinimum ? floor(wide) : ceil(wide);
    constexpr double most = std::numeric_limits<double>::max();
    const bool       isFinite = rounded >= -most && rounded <= most;
    if (sizeof(TPixel) == 8 && isFinite)
    {
      // a double does not distinguish all integers
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
PatchSearch<TPixel, VIsMinimum>::SetLeast(std::ptrdiff_t row)
{
  constexpr Number most = std::numeric_limits<Number>::infinity();
  Number           best[CellColumns];
  for (std::ptrdiff_t n = 0; n < CellColumns; ++n)
  {
    best[n] = most;
  }
  for (std::int32_t ray = m_Patch.cellBegins[row * CellColumns]; ray < m_Patch.cellBegins[(row + 1) * CellColumns];
       ++ray)
  {
    Number & least = best[m_Patch.cells[ray] % CellColumns];
    least = Smaller(least, m_Patch.best[ray]);
  }
  TPixel * const least = m_Patch.least + row * CellColumns;
  for (std::ptrdiff_t n = 0; n < CellColumns; ++n)
  {
    least[n] = FindLeast(best[n], m_Patch.hasDepth);
  }
  if constexpr (HasLevels)
  {
    std::int16_t * const levels = m_Patch.leastLevels + row * CellColumns;
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
PatchSearch<TPixel, VIsMinimum>::Finish()
{
  this->Evaluate();
  for (std::ptrdiff_t row = 0; row < CellRows; ++row)
  {
    if (m_HasChanged[row])
    {
      this->SetLeast(row);
    }
  }
  TPixel least = m_Patch.least[0];
  for (std::ptrdiff_t n = 1; n < CellRows * CellColumns; ++n)
  {
    least = (VIsMinimum ? m_Patch.least[n] > least : m_Patch.least[n] < least) ? m_Patch.least[n] : least;
  }
  return least;
}

template <typename TPixel, bool VIsMinimum>
CellWindow
PatchSearch<TPixel, VIsMinimum>::FindWindow(int axis, std::ptrdiff_t slice) const
{
  const double a = this->GetOffset(axis, static_cast<double>(slice));
  const double b = this->GetOffset(axis, static_cast<double>(slice + 1));
  // windows are a little wider because of rounding errors
  constexpr double     slack = 1e-6;
  const double         left = -Larger(a, b) - slack;
  const double         right = 1.0 - Smaller(a, b) + slack;
  const double         first = floor(left);
  const double         last = floor(right);
  const auto           weight = [](double v) { return static_cast<std::int16_t>(Smaller(v * 32768.0, 32767.0)); };
  const std::ptrdiff_t patch = axis == 0 ? m_Patch.column - m_View.first.column : m_Patch.row - m_View.first.row;
  return { static_cast<std::ptrdiff_t>(first) + patch,
           static_cast<std::ptrdiff_t>(last - first),
           weight(left - first),
           weight(right - last) };
}

template <typename TPixel, bool VIsMinimum>
template <int VLast, bool VIsHalved>
void
PatchSearch<TPixel, VIsMinimum>::BoundRows(const PairOfRows<TPixel> * rows,
                                           std::ptrdiff_t             count,
                                           const CellWindow &         window,
                                           RowBounds<TPixel> *        bounds)
{
  for (std::ptrdiff_t row = 0; row < count; ++row)
  {
    const TPixel * const a = rows[row].voxels[0];
    const TPixel * const b = rows[row].voxels[1];
    // one loop keeps numbers in registers
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
PatchSearch<TPixel, VIsMinimum>::FindCells(const RowBounds<TPixel> * rows,
                                           const CellWindow &        window,
                                           std::ptrdiff_t            row,
                                           TPixel (&voxels)[CellColumns]) const
{
  const TPixel * const       least = m_Patch.least + row * CellColumns;
  const std::int16_t * const leastLevels = m_Patch.leastLevels + row * CellColumns;
  const std::int16_t         equal = m_Patch.hasDepth ? -1 : 0;
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
PatchSearch<TPixel, VIsMinimum>::FindRows(std::ptrdiff_t slice,
                                          std::ptrdiff_t firstColumn,
                                          std::ptrdiff_t firstRow,
                                          std::ptrdiff_t count,
                                          SlicePair &    pair) const
{
  const bool           isInside = firstColumn >= 0 && firstColumn + RowWidth <= m_Slices.columns;
  const TPixel * const slices[] = { this->GetSlice(slice), this->GetSlice(slice + 1) };
  const TPixel * const later = this->GetSlice(slice + 2);
  const std::ptrdiff_t laterColumns[] = { Limit<std::ptrdiff_t>(firstColumn, 0, m_Slices.columns - 1),
                                          Limit<std::ptrdiff_t>(firstColumn + CellColumns, 0, m_Slices.columns - 1) };
  for (std::ptrdiff_t row = 0; row < count; ++row)
  {
    const std::ptrdiff_t begin = Limit<std::ptrdiff_t>(firstRow + row, 0, m_Slices.rows - 1) * m_Slices.rowStride;
    for (int side = 0; side < 2; ++side)
    {
      const TPixel * const voxels = slices[side] + begin;
      pair.rows[row].voxels[side] =
        isInside ? voxels + firstColumn : this->CopyRow(voxels, firstColumn, pair.copies[row][side]);
      PrefetchVoxel(later + (begin + laterColumns[side]));
    }
  }
}

template <typename TPixel, bool VIsMinimum>
void
PatchSearch<TPixel, VIsMinimum>::AddRays(std::ptrdiff_t cell, Number bound, std::ptrdiff_t slice)
{
  const auto                 first = static_cast<double>(slice);
  const double               nearest = m_IsBackward ? first + 1.0 : first;
  const std::int32_t * const begin = m_Patch.cellBegins + cell;
  for (std::int32_t ray = begin[0]; ray < begin[1]; ++ray)
  {
    const bool isReached = (m_Patch.begin[ray] <= first + 1.0) & (m_Patch.end[ray] >= first);
    bool       isBetter = bound > m_Patch.best[ray];
    if (m_Patch.hasDepth)
    {
      isBetter |= (bound == m_Patch.best[ray]) & this->IsNearer(nearest, m_Patch.places[ray]);
    }
    m_Segments[m_Count] = { ray, static_cast<std::int32_t>(slice) };
    m_Count += (isReached & isBetter) ? 1 : 0;
    if (m_Count == RaysTogether)
    {
      this->Evaluate();
    }
  }
}

template <typename TPixel, bool VIsMinimum>
void
PatchSearch<TPixel, VIsMinimum>::SearchPair(std::ptrdiff_t slice)
{
  const CellWindow     columns = this->FindWindow(0, slice);
  const CellWindow     rows = this->FindWindow(1, slice);
  const std::ptrdiff_t count = CellRows + rows.last + 1;
  SlicePair            pair;
  this->FindRows(slice, columns.first, rows.first, count, pair);
  RowBounds<TPixel> bounds[MostRows];
  CallWithLast(columns, [&](auto last) {
    m_Levels.isHalved ? BoundRows<decltype(last)::value, sizeof(TPixel) == 2>(pair.rows, count, columns, bounds)
                      : BoundRows<decltype(last)::value, false>(pair.rows, count, columns, bounds);
  });
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
      this->AddRays(row * CellColumns + n, Load(voxels[n]), slice);
    }
  }
}

template <typename TPixel, bool VIsMinimum>
void
PatchSearch<TPixel, VIsMinimum>::PlaceRays(int count, Group & group, VoxelPlaces & places) const
{
  double p[RaysTogether], q[RaysTogether], begins[RaysTogether], ends[RaysTogether], first[RaysTogether];
  for (int n = 0; n < RaysTogether; ++n)
  {
    const std::int32_t ray = m_Segments[n < count ? n : 0].ray;
    const std::int32_t slice = m_Segments[n < count ? n : 0].slice;
    p[n] = m_Patch.p[ray];
    q[n] = m_Patch.q[ray];
    begins[n] = m_Patch.begin[ray];
    ends[n] = m_Patch.end[ray];
    group.best[n] = m_Patch.best[ray];
    first[n] = static_cast<double>(slice);
    places.slices[0][n] = this->GetSlice(slice);
    places.slices[1][n] = this->GetSlice(slice + 1);
  }
  const auto   stepX = static_cast<double>(m_Step[0]);
  const auto   stepY = static_cast<double>(m_Step[1]);
  const double behindX = m_Step[0] > 0 ? 0.0 : 2.0;
  const double behindY = m_Step[1] > 0 ? 0.0 : 2.0;
  const auto   firstColumn = static_cast<std::int32_t>(m_View.first.column);
  const auto   firstRow = static_cast<std::int32_t>(m_View.first.row);
  for (int n = 0; n < RaysTogether; ++n)
  {
    const double x = stepX * (p[n] - this->GetOffset(0, first[n]));
    const double y = stepY * (q[n] - this->GetOffset(1, first[n]));
    const double baseX = floor(x);
    const double baseY = floor(y);
    places.columns[n] = static_cast<std::int32_t>(stepX * baseX - behindX) - firstColumn;
    places.rows[n] = static_cast<std::int32_t>(stepY * baseY - behindY) - firstRow;
    group.x[n] = static_cast<Number>(x - baseX);
    group.y[n] = static_cast<Number>(y - baseY);
    group.begin[n] = static_cast<Number>(Larger(begins[n] - first[n], 0.0));
    group.end[n] = static_cast<Number>(Smaller(ends[n] - first[n], 1.0));
  }
}

template <typename TPixel, bool VIsMinimum>
void
PatchSearch<TPixel, VIsMinimum>::FindMissing(const VoxelPlaces & places, Group & group) const
{
  constexpr Number     infinity = std::numeric_limits<Number>::infinity();
  const std::ptrdiff_t lasts[] = { m_Slices.columns - 1, m_Slices.rows - 1 };
  const Ends           ends[] = { m_Slices.columnEnds, m_Slices.rowEnds };
  for (int axis = 0; axis < 2; ++axis)
  {
    for (int cell = 0; cell < 2; ++cell)
    {
      const int after = m_Step[axis] > 0 ? cell : 1 - cell;
      for (int n = 0; n < RaysTogether; ++n)
      {
        const std::ptrdiff_t voxel = (axis == 0 ? places.columns[n] : places.rows[n]) + after;
        const bool           isIn = (voxel >= 0 || ends[axis].first) && (voxel < lasts[axis] || ends[axis].last);
        group.missing[axis][cell][n] = isIn ? 0 : infinity;
      }
    }
  }
}

template <typename TPixel, bool VIsMinimum>
void
PatchSearch<TPixel, VIsMinimum>::LoadSingly(const VoxelPlaces & places, Group & group) const
{
  const int  firstColumn = m_Step[0] > 0 ? 0 : 2;
  const int  firstRow = m_Step[1] > 0 ? 0 : 2;
  const auto stepX = static_cast<int>(m_Step[0]);
  const auto stepY = static_cast<int>(m_Step[1]);
  const auto lastColumn = static_cast<std::int32_t>(m_Slices.columns - 1);
  const auto lastRow = static_cast<std::int32_t>(m_Slices.rows - 1);
  for (int n = 0; n < RaysTogether; ++n)
  {
    for (int line = 0; line < 6; ++line)
    {
      const std::ptrdiff_t row = Limit(places.rows[n] + firstRow + line % 3 * stepY, 0, lastRow);
      const TPixel * const from = places.slices[line / 3][n] + row * m_Slices.rowStride;
      for (int column = 0; column < 3; ++column)
      {
        const std::int32_t place = Limit(places.columns[n] + firstColumn + column * stepX, 0, lastColumn);
        group.voxels[3 * line + column][n] = Load(from[place]);
      }
    }
  }
}

template <typename TPixel, bool VIsMinimum>
SHEARWARP_INLINE inline void
PatchSearch<TPixel, VIsMinimum>::CopyLines(const VoxelPlaces & places, Four (&fours)[6][RaysTogether]) const
{
  const auto lastColumn = static_cast<std::int32_t>(m_Slices.columns - 1);
  const auto lastRow = static_cast<std::int32_t>(m_Slices.rows - 1);
  for (int n = 0; n < RaysTogether; ++n)
  {
    const std::int32_t column = places.columns[n];
    const std::int32_t row = places.rows[n];
    const bool         isInside = (column >= 0) & (column <= lastColumn - 3) & (row >= 0) & (row <= lastRow - 2);
    if (isInside)
    {
      const std::ptrdiff_t offset = row * m_Slices.rowStride + column;
      for (int line = 0; line < 6; ++line)
      {
        CopyBytes(&fours[line][n], places.slices[line / 3][n] + offset + line % 3 * m_Slices.rowStride, sizeof(Four));
      }
      continue;
    }
    for (int line = 0; line < 6; ++line)
    {
      const TPixel * const from = places.slices[line / 3][n] + Limit(row + line % 3, 0, lastRow) * m_Slices.rowStride;
      TPixel               edge[4];
      for (int place = 0; place < 4; ++place)
      {
        edge[place] = from[Limit(column + place, 0, lastColumn)];
      }
      CopyBytes(&fours[line][n], edge, sizeof(Four));
    }
  }
}

template <typename TPixel, bool VIsMinimum>
SHEARWARP_INLINE inline void
PatchSearch<TPixel, VIsMinimum>::SplitLine(const std::uint32_t (&words)[WordsInFour][RaysTogether],
                                           Number (*voxels)[RaysTogether]) const
{
  using Word = std::conditional_t<std::is_signed_v<TPixel>, std::int32_t, std::uint32_t>;
  constexpr int bits = 8 * sizeof(TPixel);
  constexpr int voxelsInWord = 32 / bits;
  const int     firstColumn = m_Step[0] > 0 ? 0 : 2;
  const auto    stepX = static_cast<int>(m_Step[0]);
  for (int column = 0; column < 3; ++column)
  {
    const int    place = firstColumn + column * stepX;
    const int    inWord = IsBigEndian ? voxelsInWord - 1 - place % voxelsInWord : place % voxelsInWord;
    const int    shift = 32 - bits * (inWord + 1);
    const auto & word = words[place / voxelsInWord];
    for (int n = 0; n < RaysTogether; ++n)
    {
      const auto shifted = static_cast<Word>(word[n] << shift);
      const auto number = static_cast<Number>(static_cast<std::int32_t>(shifted >> (32 - bits)));
      voxels[column][n] = VIsMinimum ? -number : number;
    }
  }
}

template <typename TPixel, bool VIsMinimum>
void
PatchSearch<TPixel, VIsMinimum>::LoadFours(const VoxelPlaces & places, Group & group) const
{
  Four fours[6][RaysTogether];
  this->CopyLines(places, fours);
  std::uint32_t words[6][WordsInFour][RaysTogether];
  for (int line = 0; line < 6; ++line)
  {
    for (int word = 0; word < WordsInFour; ++word)
    {
      const int shift = 32 * (IsBigEndian ? WordsInFour - 1 - word : word);
      for (int n = 0; n < RaysTogether; ++n)
      {
        words[line][word][n] = static_cast<std::uint32_t>(fours[line][n] >> shift);
      }
    }
  }
  const int  firstRow = m_Step[1] > 0 ? 0 : 2;
  const auto stepY = static_cast<int>(m_Step[1]);
  for (int line = 0; line < 6; ++line)
  {
    this->SplitLine(words[line / 3 * 3 + firstRow + line % 3 * stepY], group.voxels + 3 * line);
  }
}

template <typename TPixel, bool VIsMinimum>
SHEARWARP_INLINE inline void
PatchSearch<TPixel, VIsMinimum>::TakeBest(const RaySegment & segment, Number value, Number placeInSegment)
{
  const std::int32_t ray = segment.ray;
  const double       place = static_cast<double>(segment.slice) + static_cast<double>(placeInSegment);
  if (value > m_Patch.best[ray] || (value == m_Patch.best[ray] && this->IsNearer(place, m_Patch.places[ray])))
  {
    m_Patch.best[ray] = value;
    m_Patch.places[ray] = place;
    m_HasChanged[m_Patch.cells[ray] / CellColumns] = true;
  }
}

template <typename TPixel, bool VIsMinimum>
void
PatchSearch<TPixel, VIsMinimum>::Evaluate()
{
  const int count = m_Count;
  m_Count = 0;
  if (count == 0)
  {
    return;
  }
  Group       group;
  VoxelPlaces voxelPlaces;
  this->PlaceRays(count, group, voxelPlaces);
  if (m_IsPart)
  {
    this->FindMissing(voxelPlaces, group);
  }
  if constexpr (sizeof(TPixel) <= 2)
  {
    this->LoadFours(voxelPlaces, group);
  }
  else
  {
    this->LoadSingly(voxelPlaces, group);
  }
  Number        best[RaysTogether], places[RaysTogether];
  std::uint32_t betterRays = m_GroupSearch.Search(group, best, places);
  for (betterRays &= (std::uint32_t{ 1 } << count) - 1; betterRays != 0; betterRays &= betterRays - 1)
  {
    const int n = FindLowest(betterRays);
    this->TakeBest(m_Segments[n], best[n], places[n]);
  }
}

template <bool VIsMinimum, typename TPixel>
TPixel
EvaluateSegments(const ExactView<TPixel> & view,
                 const RayPatch<TPixel> &  patch,
                 const RaySegment *        segments,
                 std::size_t               count)
{
  PatchSearch<TPixel, VIsMinimum> search(view, patch, true);
  for (std::size_t n = 0; n < count; ++n)
  {
    search.Add(segments[n]);
  }
  return search.Finish();
}

/** See Kernels. */
template <typename TPixel>
TPixel
EvaluateSegments(const ExactView<TPixel> & view,
                 const RayPatch<TPixel> &  patch,
                 const RaySegment *        segments,
                 std::size_t               count)
{
  return patch.isMinimum ? EvaluateSegments<true>(view, patch, segments, count)
                         : EvaluateSegments<false>(view, patch, segments, count);
}

template <bool VIsMinimum, typename TPixel>
TPixel
SearchLayer(const ExactView<TPixel> & view,
            const RayPatch<TPixel> &  patch,
            std::ptrdiff_t            sliceBegin,
            std::ptrdiff_t            sliceEnd)
{
  PatchSearch<TPixel, VIsMinimum> search(view, patch, false);
  for (std::ptrdiff_t slice = sliceBegin; slice < sliceEnd; ++slice)
  {
    search.SearchPair(slice);
  }
  return search.Finish();
}

/** See Kernels. */
template <typename TPixel>
TPixel
SearchLayer(const ExactView<TPixel> & view,
            const RayPatch<TPixel> &  patch,
            std::ptrdiff_t            sliceBegin,
            std::ptrdiff_t            sliceEnd)
{
  return patch.isMinimum ? SearchLayer<true>(view, patch, sliceBegin, sliceEnd)
                         : SearchLayer<false>(view, patch, sliceBegin, sliceEnd);
}
