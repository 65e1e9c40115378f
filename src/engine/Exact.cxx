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

#include "PartRecords.h"
#include "kernels/PixelTypes.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

namespace itk::ShearWarp
{
namespace
{
constexpr std::ptrdiff_t CellsInPatch = CellRows * CellColumns;

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

/** Returns the nearest slice if \a place is there but for the tolerance of intervals. Then a ray that ends at the slice
 * does not see the voxels behind it. */
inline double
SnapToSlice(double place)
{
  const double slice = std::round(place);
  return std::abs(place - slice) <= 2e-9 ? slice : place;
}

/** Rounds to the pixel type: integers half upward, and into the type's range. A zero is +0. */
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

/** What is searched, and where the results go: to a picture or, if there are records, to these. */
template <typename TPixel>
struct ExactSearch
{
  const ExactView<TPixel> &         view;
  std::ptrdiff_t                    volume[3]; // columns, rows and slices
  Mode                              mode;
  const Kernels<TPixel> &           kernels;
  const IntermediateImage<TPixel> & guess;
  Corner                            guessBegin;
  IntermediateRegion                region;
  bool                              hasDepth;
  Picture<TPixel>                   picture;
  const PartRecords<TPixel> *       records;
  unsigned char *                   bytes;

  bool
  IsBackward() const
  {
    return view.depth.perSlice < 0;
  }

  /** The first and the last slice from which a ray goes to the next one. Beyond the volume's outer slices, the first
   * slice is -1, and voxels repeat behind the last one. */
  std::int32_t
  GetFirstSlice() const
  {
    return static_cast<std::int32_t>(view.first.slice == 0 ? -1 : view.first.slice);
  }
  std::int32_t
  GetLastSlice() const
  {
    const std::ptrdiff_t end = view.first.slice + view.slices.slices;
    return static_cast<std::int32_t>(end == volume[2] ? end - 1 : end - 2);
  }
};

float
GetDepth(const ShearedFunction & depth, double p, double q, double place)
{
  return static_cast<float>(depth(p, q, place)) + 0.0f;
}

/** The sheared column and row of a pixel's ray. */
std::pair<double, double>
GetRay(const AffineMap2D & map, std::ptrdiff_t column, std::ptrdiff_t row)
{
  const auto x = static_cast<double>(column);
  const auto y = static_cast<double>(row);
  return { (map.xx * x + map.xy * y) + map.x0, (map.yx * x + map.yy * y) + map.y0 };
}

/** Searches the rays of some patches that lie side by side. */
template <typename TPixel>
class RaySearch
{
public:
  using Number = ExactNumber<TPixel>;

  RaySearch(const ExactSearch<TPixel> & search, std::ptrdiff_t column, std::ptrdiff_t row, std::ptrdiff_t patches)
    : m_Search(search)
    , m_View(search.view)
    , m_Column(column)
    , m_Row(row)
    , m_Patches(patches)
  {}

  /** Adds the ray of sheared column \a p and row \a q if the ray lies in one of the patches and meets the volume. */
  void
  Add(double p, double q, std::ptrdiff_t pixel);

  /** Searches all rays, sets their pixels, and removes the rays. */
  void
  SetPixels();

private:
  static constexpr std::size_t MostRays = 8192;
  static constexpr double      Nowhere = std::numeric_limits<double>::infinity();

  struct Ray
  {
    double         p, q, begin, end;
    std::ptrdiff_t pixel;
    std::size_t    cell;
  };

  /** The best value of each ray, and its slice. Minima have the other sign. */
  struct Extrema
  {
    std::vector<Number> best;
    std::vector<double> places;
  };

  struct PatchState
  {
    RayPatch<TPixel> patch;
    TPixel           least;
    double           nearest, farthest; // the slices of the rays
  };

  /** Clips a ray to the volume and to the intervals: to slices [begin, end], or end < begin. If only a part is
   * searched, also to slices where the ray may be in the part. */
  std::pair<double, double>
  Clip(double p, double q) const;

  std::pair<double, double>
  ClipToPart(double p, double q, double begin, double end) const;

  unsigned char *
  GetRecord(std::size_t ray) const
  {
    return m_Search.bytes + m_Rays[ray].pixel * static_cast<std::ptrdiff_t>(m_Search.records->GetSize());
  }

  /** Begins with what the records have. An absolute maximum may be a minimum there. */
  void
  TakeRecords(Extremum extremum, Extrema & extrema) const;

  /** Sorts the rays by their cells. */
  void
  Sort();

  RayPatch<TPixel>
  GetPatch(std::ptrdiff_t patch, Extremum extremum, Extrema & extrema);

  /** Returns the slice of the guess's nearest pixel, or the slice where the ray begins. */
  RaySegment
  FindGuess(std::size_t ray) const;

  /** Evaluates the guess of each ray. Returns the patches that have rays. */
  std::vector<PatchState>
  EvaluateGuesses(Extremum extremum, Extrema & extrema);

  /** Evaluates all segments of rays that have no value yet: in a part, a guess may be where the part has no cell, and
   * the search finds only what is better than the worst voxel of the pixel type. */
  void
  EvaluateMissed(const RayPatch<TPixel> & patch);

  /** Returns whether a cube that the patch's rays may meet between slices \a first and \a last has a better voxel than
   * \a least. */
  bool
  MayBeBetter(const RayPatch<TPixel> & patch, TPixel least, std::ptrdiff_t first, std::ptrdiff_t last) const;

  void
  FindExtrema(Extremum extremum, Extrema & extrema);

  /** Returns whether a ray's value is the ray's minimum. */
  bool
  IsMinimum(std::size_t ray) const;

  void
  SetPixel(std::size_t ray);

  const ExactSearch<TPixel> & m_Search;
  const ExactView<TPixel> &   m_View;
  std::ptrdiff_t              m_Column, m_Row, m_Patches;
  std::vector<Ray>            m_Rays;
  std::vector<std::int32_t>   m_CellBegins; // patch by patch
  std::vector<std::uint16_t>  m_Cells;
  std::vector<double>         m_P, m_Q, m_Begin, m_End;
  std::vector<RaySegment>     m_Segments;
  std::vector<TPixel>         m_Least;
  std::vector<std::int16_t>   m_LeastLevels;
  Extrema                     m_Maxima, m_Minima;
};

template <typename TPixel>
void
RaySearch<TPixel>::Add(double p, double q, std::ptrdiff_t pixel)
{
  const double column = std::floor(p) - static_cast<double>(m_Column);
  const double row = std::floor(q) - static_cast<double>(m_Row);
  if (!(column >= 0.0 && column < static_cast<double>(m_Patches * CellColumns) && row >= 0.0 &&
        row < static_cast<double>(CellRows)))
  {
    return;
  }
  const auto [begin, end] = this->Clip(p, q);
  if (begin <= end)
  {
    const auto patch = static_cast<std::size_t>(column) / CellColumns;
    const auto cell =
      (patch * CellRows + static_cast<std::size_t>(row)) * CellColumns + static_cast<std::size_t>(column) % CellColumns;
    m_Rays.push_back({ p, q, begin, end, pixel, cell });
    if (m_Rays.size() == MostRays)
    {
      this->SetPixels();
    }
  }
}

template <typename TPixel>
std::pair<double, double>
RaySearch<TPixel>::Clip(double p, double q) const
{
  const double position[] = { p, q };
  const auto & lengths = m_Search.volume;
  double       begin = -0.5;
  double       end = static_cast<double>(lengths[2]) - 0.5;
  for (int axis = 0; axis < 2; ++axis)
  {
    const double offset = position[axis] - m_View.translation[axis];
    ClipRay(-m_View.shear[axis], offset, -0.5, static_cast<double>(lengths[axis]) - 0.5, begin, end);
  }
  for (const auto & [function, low, high] : m_View.intervals)
  {
    ClipRay(function.perSlice, function(p, q, 0.0), low, high, begin, end);
  }
  if (begin <= end && !m_View.intervals.empty())
  {
    begin = SnapToSlice(begin);
    end = SnapToSlice(end);
  }
  return m_Search.records ? this->ClipToPart(p, q, begin, end) : std::pair(begin, end);
}

/** Rounds outward to whole slices: a ray's places in a cell, and so its bits, stay the same as in the whole volume.
 * Cells that the part does not have are left out later. */
template <typename TPixel>
std::pair<double, double>
RaySearch<TPixel>::ClipToPart(double p, double q, double begin, double end) const
{
  const double         position[] = { p, q };
  const std::ptrdiff_t firsts[] = { m_View.first.column, m_View.first.row };
  const std::ptrdiff_t lengths[] = { m_View.slices.columns, m_View.slices.rows };
  double               low = m_Search.GetFirstSlice();
  double               high = m_Search.GetLastSlice() + 1.0;
  for (int axis = 0; axis < 2; ++axis)
  {
    const auto first = static_cast<double>(firsts[axis]);
    ClipRay(-m_View.shear[axis],
            position[axis] - m_View.translation[axis],
            first - 0.51,
            first + static_cast<double>(lengths[axis]) - 0.49,
            low,
            high);
  }
  return low <= high ? std::pair(std::max(begin, std::floor(low)), std::min(end, std::ceil(high)))
                     : std::pair(1.0, 0.0);
}

template <typename TPixel>
void
RaySearch<TPixel>::Sort()
{
  const std::size_t         count = m_Rays.size();
  std::vector<std::int32_t> ends(m_Patches * CellsInPatch + 1);
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
    m_Cells[place] = static_cast<std::uint16_t>(ray.cell % CellsInPatch);
    m_P[place] = ray.p;
    m_Q[place] = ray.q;
    m_Begin[place] = ray.begin;
    m_End[place] = ray.end;
  }
  m_Rays.swap(sorted);
}

template <typename TPixel>
RayPatch<TPixel>
RaySearch<TPixel>::GetPatch(std::ptrdiff_t patch, Extremum extremum, Extrema & extrema)
{
  return { m_Column + patch * CellColumns,
           m_Row,
           extremum == Extremum::Minimum,
           m_Search.hasDepth,
           m_CellBegins.data() + patch * CellsInPatch,
           m_Cells.data(),
           m_P.data(),
           m_Q.data(),
           m_Begin.data(),
           m_End.data(),
           extrema.best.data(),
           extrema.places.data(),
           m_Least.data() + patch * CellsInPatch,
           m_LeastLevels.data() + patch * CellsInPatch };
}

template <typename TPixel>
RaySegment
RaySearch<TPixel>::FindGuess(std::size_t ray) const
{
  const auto & image = m_Search.guess;
  const auto   column = static_cast<std::ptrdiff_t>(std::floor(m_P[ray] + 0.5)) - m_Search.guessBegin.column;
  const auto   row = static_cast<std::ptrdiff_t>(std::floor(m_Q[ray] + 0.5)) - m_Search.guessBegin.row;
  double       slice = std::floor(m_Begin[ray]);
  if (row >= 0 && row < image.rows && column >= image.reached[row].begin && column < image.reached[row].end)
  {
    const std::int32_t rank = image.ranks[row * image.rowStride + column];
    const double       guess = rank > 0 ? static_cast<double>(image.ranking.GetSlice(rank)) : -Nowhere;
    slice = m_Begin[ray] <= guess + 1.0 && guess <= m_End[ray] ? guess : slice;
  }
  return { static_cast<std::int32_t>(ray),
           std::clamp(static_cast<std::int32_t>(slice), m_Search.GetFirstSlice(), m_Search.GetLastSlice()) };
}

template <typename TPixel>
auto
RaySearch<TPixel>::EvaluateGuesses(Extremum extremum, Extrema & extrema) -> std::vector<PatchState>
{
  std::vector<PatchState> patches;
  for (std::ptrdiff_t n = 0; n < m_Patches; ++n)
  {
    const RayPatch<TPixel> patch = this->GetPatch(n, extremum, extrema);
    const std::size_t      first = patch.cellBegins[0];
    const std::size_t      last = patch.cellBegins[CellsInPatch];
    if (first == last)
    {
      continue;
    }
    m_Segments.clear();
    for (std::size_t ray = first; ray < last; ++ray)
    {
      m_Segments.push_back(this->FindGuess(ray));
    }
    const TPixel least = m_Search.kernels.evaluateSegments(m_View, patch, m_Segments.data(), m_Segments.size());
    patches.push_back({ patch,
                        least,
                        *std::min_element(m_Begin.begin() + first, m_Begin.begin() + last),
                        *std::max_element(m_End.begin() + first, m_End.begin() + last) });
  }
  return patches;
}

template <typename TPixel>
void
RaySearch<TPixel>::EvaluateMissed(const RayPatch<TPixel> & patch)
{
  m_Segments.clear();
  for (std::int32_t ray = patch.cellBegins[0]; ray < patch.cellBegins[CellsInPatch]; ++ray)
  {
    if (patch.best[ray] == -std::numeric_limits<Number>::infinity())
    {
      const auto last = std::min(static_cast<std::int32_t>(std::floor(m_End[ray])), m_Search.GetLastSlice());
      for (auto slice = static_cast<std::int32_t>(std::floor(m_Begin[ray])); slice <= last; ++slice)
      {
        m_Segments.push_back({ ray, std::max(slice, m_Search.GetFirstSlice()) });
      }
    }
  }
  if (!m_Segments.empty())
  {
    m_Search.kernels.evaluateSegments(m_View, patch, m_Segments.data(), m_Segments.size());
  }
}

template <typename TPixel>
bool
RaySearch<TPixel>::MayBeBetter(const RayPatch<TPixel> & patch,
                               TPixel                   least,
                               std::ptrdiff_t           first,
                               std::ptrdiff_t           last) const
{
  const auto &         cubes = m_View.blocks;
  std::ptrdiff_t       begin[3], end[3];
  const std::ptrdiff_t lengths[] = { m_View.slices.columns, m_View.slices.rows };
  const std::ptrdiff_t low[] = { patch.column - m_View.first.column, patch.row - m_View.first.row };
  const std::ptrdiff_t high[] = { low[0] + CellColumns, low[1] + CellRows };
  for (int axis = 0; axis < 2; ++axis)
  {
    const double offsets[] = { m_View.shear[axis] * static_cast<double>(first) + m_View.translation[axis],
                               m_View.shear[axis] * static_cast<double>(last) + m_View.translation[axis] };
    const auto   findCube = [&](double position) {
      return static_cast<std::ptrdiff_t>(std::clamp(position, 0.0, static_cast<double>(lengths[axis] - 1))) /
             BlockLength;
    };
    // one voxel more on each side because of rounding errors
    begin[axis] = findCube(static_cast<double>(low[axis]) - std::max(offsets[0], offsets[1]) - 1.0);
    end[axis] = findCube(static_cast<double>(high[axis]) - std::min(offsets[0], offsets[1]) + 2.0) + 1;
  }
  begin[2] = std::max<std::ptrdiff_t>(first - m_View.first.slice, 0) / BlockLength;
  end[2] = std::min(begin[2] + 2, cubes.slices);
  const TPixel * const extrema = patch.isMinimum ? cubes.minima : cubes.maxima;
  for (std::ptrdiff_t slice = begin[2]; slice < end[2]; ++slice)
  {
    for (std::ptrdiff_t row = begin[1]; row < end[1]; ++row)
    {
      for (std::ptrdiff_t column = begin[0]; column < end[0]; ++column)
      {
        const TPixel voxel = extrema[column * cubes.columnStride + row * cubes.rowStride + slice * cubes.sliceStride];
        if ((patch.isMinimum ? voxel < least : voxel > least) || (patch.hasDepth && voxel == least))
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
RaySearch<TPixel>::FindExtrema(Extremum extremum, Extrema & extrema)
{
  extrema.best.assign(m_Rays.size(), -std::numeric_limits<Number>::infinity());
  extrema.places.assign(m_Rays.size(), m_Search.IsBackward() ? -Nowhere : Nowhere);
  if (m_Search.records && m_Search.mode != Mode::AbsoluteMaximum)
  {
    this->TakeRecords(extremum, extrema);
  }
  m_Least.resize(m_Patches * CellsInPatch);
  m_LeastLevels.resize(m_Least.size());
  std::vector<PatchState> patches = this->EvaluateGuesses(extremum, extrema);
  for (std::ptrdiff_t layer = 0; layer < m_View.blocks.slices; ++layer)
  {
    // the outer layers include half a voxel beyond the volume's outer slices
    const std::ptrdiff_t begin = m_View.first.slice + layer * BlockLength;
    const std::ptrdiff_t first = layer == 0 ? m_Search.GetFirstSlice() : begin;
    const std::ptrdiff_t last = std::min<std::ptrdiff_t>(begin + BlockLength, m_Search.GetLastSlice() + 1);
    for (auto & [patch, least, nearest, farthest] : patches)
    {
      if (nearest <= static_cast<double>(last) && farthest >= static_cast<double>(first) &&
          this->MayBeBetter(patch, least, first, last))
      {
        least = m_Search.kernels.searchLayer(m_View, patch, first, last);
      }
    }
  }
  if (m_Search.records)
  {
    for (const PatchState & state : patches)
    {
      this->EvaluateMissed(state.patch);
    }
  }
}

template <typename TPixel>
void
RaySearch<TPixel>::TakeRecords(Extremum extremum, Extrema & extrema) const
{
  for (std::size_t ray = 0; ray < m_Rays.size(); ++ray)
  {
    Number value;
    double place;
    if (m_Search.records->GetExact(this->GetRecord(ray), value, place))
    {
      extrema.best[ray] = extremum == Extremum::Minimum ? -value : value;
      extrema.places[ray] = m_Search.IsBackward() ? -place : place;
    }
  }
}

template <typename TPixel>
bool
RaySearch<TPixel>::IsMinimum(std::size_t ray) const
{
  switch (m_Search.mode)
  {
    case Mode::Maximum:
    case Mode::Mean:
      return false;
    case Mode::Minimum:
      return true;
    case Mode::AbsoluteMaximum:
      return m_Minima.best[ray] > m_Maxima.best[ray];
  }
  return false;
}

template <typename TPixel>
void
RaySearch<TPixel>::SetPixel(std::size_t ray)
{
  const bool isMinimum = this->IsMinimum(ray);
  const auto & [best, places] = isMinimum ? m_Minima : m_Maxima;
  if (best[ray] == -std::numeric_limits<Number>::infinity())
  {
    return;
  }
  const Number value = isMinimum ? -best[ray] : best[ray];
  if (m_Search.records)
  {
    m_Search.records->MergeExact(value, m_Search.IsBackward() ? -places[ray] : places[ray], this->GetRecord(ray));
    return;
  }
  const auto & [p, q, begin, end, pixel, cell] = m_Rays[ray];
  m_Search.picture.pixels[pixel] = RoundToPixel<TPixel>(value);
  if (m_Search.hasDepth)
  {
    m_Search.picture.depths[pixel] = GetDepth(m_View.depth, p, q, places[ray]);
  }
}

template <typename TPixel>
void
RaySearch<TPixel>::SetPixels()
{
  this->Sort();
  switch (m_Search.mode)
  {
    case Mode::Maximum:
      this->FindExtrema(Extremum::Maximum, m_Maxima);
      break;
    case Mode::Minimum:
      this->FindExtrema(Extremum::Minimum, m_Minima);
      break;
    case Mode::AbsoluteMaximum:
      this->FindExtrema(Extremum::Maximum, m_Maxima);
      this->FindExtrema(Extremum::Minimum, m_Minima);
      break;
    case Mode::Mean:
      break; // a rule refuses exact means
  }
  for (std::size_t ray = 0; ray < m_Rays.size(); ++ray)
  {
    this->SetPixel(ray);
  }
  m_Rays.clear();
}

/** Converts any double, also not-a-number, to a number of rows or columns from 0 to \a most. */
std::ptrdiff_t
ConvertToCount(double v, std::ptrdiff_t most)
{
  return v >= static_cast<double>(most) ? most : v >= 0.0 ? static_cast<std::ptrdiff_t>(v) : 0;
}

/** Finds the pixels that a map may take into the rectangle from `low` to `high`: first their rows, then the columns of
 * a row. */
class PixelsInRectangle
{
public:
  PixelsInRectangle(const AffineMap2D & map, const double (&low)[2], const double (&high)[2])
    : m_Map(map)
    , m_Low{ low[0] - Slack, low[1] - Slack }
    , m_High{ high[0] + Slack, high[1] + Slack }
  {}

  /** Returns rows [begin, end) of \a region. */
  std::pair<std::ptrdiff_t, std::ptrdiff_t>
  FindRows(const IntermediateRegion & region) const
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
    return { std::max(ConvertToCount(least - 1.0, region.row + region.rows), region.row),
             ConvertToCount(most + 2.0, region.row + region.rows) };
  }

  /** Returns columns [begin, end) of a row of \a region. */
  std::pair<std::ptrdiff_t, std::ptrdiff_t>
  FindColumns(std::ptrdiff_t row, const IntermediateRegion & region) const
  {
    const std::ptrdiff_t columns = region.column + region.columns;
    double               begin = 0.0;
    auto                 end = static_cast<double>(columns);
    const auto           y = static_cast<double>(row);
    ClipRay(m_Map.xx, m_Map.xy * y + m_Map.x0, m_Low[0], m_High[0], begin, end);
    ClipRay(m_Map.yx, m_Map.yy * y + m_Map.y0, m_Low[1], m_High[1], begin, end);
    return { std::max(ConvertToCount(begin - 1.0, columns), region.column), ConvertToCount(end + 2.0, columns) };
  }

private:
  /** Rounding errors lose no pixel whose place is on the rectangle's border. */
  static constexpr double Slack = 0.01;

  AffineMap2D m_Map;
  double      m_Low[2], m_High[2];
};

/** Adds the rays of the pixels of a row. */
template <typename TPixel>
void
AddRays(RaySearch<TPixel> &        rays,
        const AffineMap2D &        map,
        const PixelsInRectangle &  pixels,
        std::ptrdiff_t             row,
        const IntermediateRegion & region)
{
  const auto [begin, end] = pixels.FindColumns(row, region);
  for (std::ptrdiff_t column = begin; column < end; ++column)
  {
    const auto [p, q] = GetRay(map, column, row);
    rays.Add(p, q, (row - region.row) * region.columns + (column - region.column));
  }
}

/** Fills a picture with the background, and its depths with not-a-number. */
template <typename TPixel>
void
FillBackground(TPixel                  background,
               std::ptrdiff_t          columns,
               std::ptrdiff_t          rows,
               const Picture<TPixel> & picture,
               const RunTasks &        run)
{
  run(static_cast<std::size_t>(rows), 1, [&](std::size_t row, std::size_t, std::size_t) {
    const auto first = static_cast<std::ptrdiff_t>(row) * columns;
    std::fill_n(picture.pixels + first, columns, background);
    if (picture.depths)
    {
      std::fill_n(picture.depths + first, columns, std::numeric_limits<float>::quiet_NaN());
    }
  });
}

/** A rectangle of cells of the sheared grid. The first cell is (`first[0]`, `first[1]`). */
struct CellRectangle
{
  std::ptrdiff_t first[2], counts[2];
};

/** Returns the cells that rays may be in, with one cell more on each side because of rounding errors. */
template <typename TPixel>
CellRectangle
FindCells(const ExactView<TPixel> & view)
{
  const std::ptrdiff_t lengths[] = { view.slices.columns, view.slices.rows };
  CellRectangle        cells;
  for (int axis = 0; axis < 2; ++axis)
  {
    const double shift = view.shear[axis] * static_cast<double>(view.slices.slices);
    const double offset = view.translation[axis] + view.shear[axis] * static_cast<double>(view.first.slice);
    cells.first[axis] = static_cast<std::ptrdiff_t>(std::floor(offset + std::min(shift, 0.0))) - 2 +
                        (axis == 0 ? view.first.column : view.first.row);
    cells.counts[axis] = lengths[axis] + static_cast<std::ptrdiff_t>(std::ceil(std::abs(shift))) + 4;
  }
  return cells;
}

/** How the rays are split into tasks. A task has `patches` patches side by side, which share the voxels in the caches.
 * If patches have many rays, a task has one of `bands` bands of the patches' rows of pixels. */
struct TaskSize
{
  std::ptrdiff_t patches, bands;
};

TaskSize
FindTaskSize(const AffineMap2D & map, std::ptrdiff_t rows)
{
  constexpr std::ptrdiff_t mostBands = 256;
  const double             raysInPatch = CellsInPatch / std::abs(map.xx * map.yy - map.xy * map.yx);
  return { raysInPatch > 2048.0   ? 1
           : raysInPatch > 1024.0 ? 4
                                  : 8,
           raysInPatch < 16384.0 ? 1 : ConvertToCount(raysInPatch / 8192.0, std::min(rows, mostBands)) };
}

/** Searches the rays of all pixels of the region. */
template <typename TPixel>
void
Search(const ExactSearch<TPixel> & exact, const RunTasks & run)
{
  const AffineMap2D &        map = exact.view.outputToSheared;
  const IntermediateRegion & region = exact.region;
  const CellRectangle        cells = FindCells(exact.view);
  const TaskSize             task = FindTaskSize(map, region.rows);
  const auto                 taskColumns = task.patches * CellColumns;
  const auto                 search = [&](std::size_t n, std::size_t step, std::size_t) {
    const auto              band = static_cast<std::ptrdiff_t>(n) % task.bands;
    const std::ptrdiff_t    column = cells.first[0] + static_cast<std::ptrdiff_t>(step) * taskColumns;
    const std::ptrdiff_t    row = cells.first[1] + static_cast<std::ptrdiff_t>(n) / task.bands * CellRows;
    RaySearch<TPixel>       rays(exact, column, row, task.patches);
    const double            low[] = { static_cast<double>(column), static_cast<double>(row) };
    const double            high[] = { static_cast<double>(column + taskColumns), static_cast<double>(row + CellRows) };
    const PixelsInRectangle pixels(map, low, high);
    const auto [rowBegin, rowEnd] = pixels.FindRows(region);
    const std::ptrdiff_t count = rowEnd - rowBegin;
    for (std::ptrdiff_t j = rowBegin + count * band / task.bands; j < rowBegin + count * (band + 1) / task.bands; ++j)
    {
      AddRays(rays, map, pixels, j, region);
    }
    rays.SetPixels();
  };
  run(CountBlocks(cells.counts[1], CellRows) * task.bands, CountBlocks(cells.counts[0], taskColumns), search);
}
} // namespace

template <typename TPixel>
void
ProjectExactly(const ExactView<TPixel> &         view,
               Mode                              mode,
               const Kernels<TPixel> &           kernels,
               const IntermediateImage<TPixel> & guess,
               std::ptrdiff_t                    columns,
               std::ptrdiff_t                    rows,
               const Picture<TPixel> &           picture,
               const RunTasks &                  runFill,
               const RunTasks &                  runSearch)
{
  FillBackground(view.background, columns, rows, picture, runFill);
  const auto & slices = view.slices;
  Search<TPixel>({ view,
                   { slices.columns, slices.rows, slices.slices },
                   mode,
                   kernels,
                   guess,
                   { 0, 0, 0 },
                   { 0, 0, columns, rows },
                   picture.depths != nullptr,
                   picture,
                   nullptr,
                   nullptr },
                 runSearch);
}

template <typename TPixel>
void
SearchExactly(const ExactView<TPixel> & view,
              const std::ptrdiff_t (&volume)[3],
              const ProjectionRule<TPixel> &    rule,
              const Kernels<TPixel> &           kernels,
              const IntermediateImage<TPixel> & guess,
              const Corner &                    guessBegin,
              const IntermediateRegion &        region,
              unsigned char *                   records,
              const RunTasks &                  run)
{
  const PartRecords<TPixel> ofRule(rule);
  const ExactSearch<TPixel> exact{ view,
                                   { volume[0], volume[1], volume[2] },
                                   rule.mode,
                                   kernels,
                                   guess,
                                   guessBegin,
                                   region,
                                   rule.hasDepth,
                                   { nullptr, nullptr },
                                   &ofRule,
                                   records };
  // a part of one slice has no cells
  if (exact.GetFirstSlice() <= exact.GetLastSlice())
  {
    Search(exact, run);
  }
}

template <typename TPixel>
void
WriteExactly(const ProjectionRule<TPixel> & rule,
             const AffineMap2D &            outputToSheared,
             const ShearedFunction &        depth,
             const unsigned char *          records,
             std::ptrdiff_t                 columns,
             std::ptrdiff_t                 row,
             const Picture<TPixel> &        picture)
{
  const PartRecords<TPixel> ofRule(rule);
  for (std::ptrdiff_t column = 0; column < columns; ++column)
  {
    ExactNumber<TPixel> value;
    double              place;
    const bool          hasValue =
      ofRule.GetExact(records + column * static_cast<std::ptrdiff_t>(ofRule.GetSize()), value, place);
    const std::ptrdiff_t pixel = row * columns + column;
    picture.pixels[pixel] = hasValue ? RoundToPixel<TPixel>(value) : rule.background;
    if (picture.depths)
    {
      const auto [p, q] = GetRay(outputToSheared, column, row);
      picture.depths[pixel] =
        hasValue ? GetDepth(depth, p, q, depth.perSlice < 0 ? -place : place) : std::numeric_limits<float>::quiet_NaN();
    }
  }
}

IntermediateRegion
FindExactRegion(const Factorization & factorization, const VoxelBox & box, const PictureGrid & grid)
{
  const IntermediateRegion all{
    0, 0, static_cast<std::ptrdiff_t>(grid.size[0]), static_cast<std::ptrdiff_t>(grid.size[1])
  };
  const auto & axes = factorization.permutation;
  double       low[2], high[2];
  bool         isWhole = box.size[axes[2]] == factorization.size[2];
  for (int axis = 0; axis < 2; ++axis)
  {
    const auto   begin = static_cast<double>(box.begin[axes[axis]]);
    const auto   length = static_cast<double>(box.size[axes[axis]]);
    const auto   slice = static_cast<double>(box.begin[axes[2]]);
    const double shift = factorization.shear[axis] * (static_cast<double>(box.size[axes[2]]) + 1.0);
    const double offset = factorization.translation[axis] + factorization.shear[axis] * (slice - 1.0);
    low[axis] = begin + offset + std::min(shift, 0.0) - 1.0;
    high[axis] = begin + length + offset + std::max(shift, 0.0);
    isWhole = isWhole && box.size[axes[axis]] == factorization.size[axis];
  }
  if (isWhole)
  {
    return all;
  }
  const AffineMap2D       map = GetOutputToIntermediate(factorization, grid);
  const PixelsInRectangle rows(map, low, high);
  const PixelsInRectangle columns(
    { map.yy, map.yx, map.y0, map.xy, map.xx, map.x0 }, { low[1], low[0] }, { high[1], high[0] });
  const auto [rowBegin, rowEnd] = rows.FindRows(all);
  const auto [columnBegin, columnEnd] = columns.FindRows({ 0, 0, all.rows, all.columns });
  const bool isEmpty = columnBegin >= columnEnd || rowBegin >= rowEnd;
  return isEmpty ? IntermediateRegion{ 0, 0, 1, 1 }
                 : IntermediateRegion{ columnBegin, rowBegin, columnEnd - columnBegin, rowEnd - rowBegin };
}

#define INSTANTIATE(TPixel)                                       \
  template void ProjectExactly(const ExactView<TPixel> &,         \
                               Mode,                              \
                               const Kernels<TPixel> &,           \
                               const IntermediateImage<TPixel> &, \
                               std::ptrdiff_t,                    \
                               std::ptrdiff_t,                    \
                               const Picture<TPixel> &,           \
                               const RunTasks &,                  \
                               const RunTasks &);                 \
  template void SearchExactly(const ExactView<TPixel> &,          \
                              const std::ptrdiff_t(&)[3],         \
                              const ProjectionRule<TPixel> &,     \
                              const Kernels<TPixel> &,            \
                              const IntermediateImage<TPixel> &,  \
                              const Corner &,                     \
                              const IntermediateRegion &,         \
                              unsigned char *,                    \
                              const RunTasks &);                  \
  template void WriteExactly(const ProjectionRule<TPixel> &,      \
                             const AffineMap2D &,                 \
                             const ShearedFunction &,             \
                             const unsigned char *,               \
                             std::ptrdiff_t,                      \
                             std::ptrdiff_t,                      \
                             const Picture<TPixel> &);
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk::ShearWarp
