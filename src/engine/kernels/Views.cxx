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
#include "Kernels.h"
#include "PixelTypes.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <iterator>
#include <type_traits>

/* What kernels need to know of a view: where its samples lie, which of them count, and how they fade. */

namespace itk::ShearWarp
{

SamplingPosition
QuantizePosition(double position)
{
  const auto quantized = static_cast<std::int64_t>(std::floor(position * One + 0.5));
  return { static_cast<std::int32_t>(quantized >> FractionBits), static_cast<std::int32_t>(quantized & (One - 1)) };
}

RowSpan
FindSamples(const SamplingPosition & position, std::ptrdiff_t voxels, Ends ends)
{
  const bool isLastNearer = position.fraction > One / 2;
  return { ends.first ? isLastNearer : 1, voxels + (ends.last && isLastNearer) };
}

std::ptrdiff_t
FindFirstRow(const Block & block, const SlicePlacement * placements, std::ptrdiff_t slice)
{
  if (block.rowsOf == BlockRows::OfImage)
  {
    return 0;
  }
  if (block.rowsOf == BlockRows::OfMiddleSlices)
  {
    slice = std::min(slice / BlockLength * BlockLength + BlockLength / 2, block.sliceEnd - 1);
  }
  return placements[slice].row.whole;
}

RowSpan
FindRowSamples(const Block & block, const SlicePlacement * placements, std::ptrdiff_t slice, Ends rowEnds)
{
  const SamplingPosition & position = placements[slice].row;
  const std::ptrdiff_t     difference = FindFirstRow(block, placements, slice) - position.whole;
  const RowSpan            all = FindSamples(position, block.rows, rowEnds);
  const auto               shift = [&](std::ptrdiff_t row) {
    if (block.rowsOf != BlockRows::OfImage && (row == 0 || row == block.rows))
    {
      return row == 0 ? all.begin : all.end;
    }
    return std::clamp(row + difference, all.begin, all.end);
  };
  return { shift(block.rowBegin), shift(block.rowEnd) };
}

double
ShearedFunction::operator()(double column, double row, double slice) const
{
  return perColumn * column + ((perRow * row + perSlice * slice) + constant);
}

void
ClipColumns(const Interval & interval, double row, double slice, std::ptrdiff_t rows, ColumnSpan * spans)
{
  // a function that falls along the columns becomes one that rises
  const auto & function = interval.function;
  const bool   falls = function.perColumn < 0;
  const double perColumn = std::abs(function.perColumn);
  const double low = falls ? -interval.high : interval.low;
  const double high = falls ? -interval.low : interval.high;
  const double perValue = 1 / perColumn;
  for (std::ptrdiff_t n = 0; n < rows; ++n)
  {
    const double atZero = function(0.0, row + static_cast<double>(n), slice);
    const double rest = falls ? -atZero : atZero;
    const auto   getValue = [=](double column) { return perColumn * column + rest; };
    const auto   begin = static_cast<double>(spans[n].begin);
    const auto   end = static_cast<double>(spans[n].end);
    // the function is monotonic in the column, with rounding too, so a search near the guess finds the first column
    const auto findFirst = [=](double limit, const auto & isReached) {
      const double guess = (limit - rest) * perValue;
      const double inside = guess > begin ? (guess < end ? guess : end) : begin;
      const auto   whole = static_cast<double>(static_cast<std::int32_t>(inside));
      double       first = whole < inside ? whole + 1 : whole;
      for (; first > begin && isReached(getValue(first - 1), limit); --first)
      {
      }
      for (; first < end && !isReached(getValue(first), limit); ++first)
      {
      }
      return first;
    };
    const double first = findFirst(low, std::greater_equal<>());
    const double last = findFirst(high, std::greater<>());
    spans[n] = { static_cast<std::int32_t>(first), static_cast<std::int32_t>(std::max(first, last)) };
  }
}

/** Returns whether samples of these columns and rows of a slice are in the interval. */
Region::Overlap
Region::FindOverlap(const Interval & interval, ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice) const
{
  const auto   position = static_cast<double>(first.slice + slice);
  const double outerColumns[] = { static_cast<double>(first.column + columns.begin),
                                  static_cast<double>(first.column + columns.end - 1) };
  const double outerRows[] = { static_cast<double>(first.row + rows.begin),
                               static_cast<double>(first.row + rows.end - 1) };
  // the function is monotonic in column and row, with rounding too
  const auto & function = interval.function;
  const bool   falls = function.perColumn < 0;
  const bool   fallsAlongRows = function.perRow < 0;
  const double lowest = function(outerColumns[falls], outerRows[fallsAlongRows], position);
  const double highest = function(outerColumns[!falls], outerRows[!fallsAlongRows], position);
  if (lowest >= interval.low && highest <= interval.high)
  {
    return Overlap::All;
  }
  return highest >= interval.low && lowest <= interval.high ? Overlap::Part : Overlap::None;
}

bool
Region::MayReach(ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice) const
{
  return std::all_of(intervals.begin(), intervals.end(), [&](const Interval & interval) {
    return this->FindOverlap(interval, columns, rows, slice) != Overlap::None;
  });
}

bool
Region::Clip(ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice, ColumnSpan * spans) const
{
  const std::ptrdiff_t count = rows.end - rows.begin;
  const auto           shift = static_cast<std::int32_t>(first.column);
  const auto           row = static_cast<double>(first.row + rows.begin);
  const auto           position = static_cast<double>(first.slice + slice);
  std::fill_n(spans, count, ColumnSpan{ columns.begin + shift, columns.end + shift });
  for (const Interval & interval : intervals)
  {
    const Overlap overlap = this->FindOverlap(interval, columns, rows, slice);
    if (overlap == Overlap::None)
    {
      return false;
    }
    if (overlap == Overlap::Part)
    {
      ClipColumns(interval, row, position, count, spans);
    }
  }
  std::for_each(spans, spans + count, [shift](ColumnSpan & span) { span = { span.begin - shift, span.end - shift }; });
  return true;
}

ReachedRow
FindReached(const std::int32_t * ranks, std::ptrdiff_t columns)
{
  const auto hasValue = [](std::int32_t rank) { return rank > 0; };
  const auto begin = std::find_if(ranks, ranks + columns, hasValue);
  const auto last =
    std::find_if(std::make_reverse_iterator(ranks + columns), std::make_reverse_iterator(begin), hasValue);
  const auto end = last.base();
  return { { static_cast<std::int32_t>(begin - ranks), static_cast<std::int32_t>(end - ranks) },
           !std::all_of(begin, end, hasValue) };
}

bool
Coverage::Add(ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice, ColumnSpan * spans) const
{
  if (!region->Clip(columns, rows, slice, spans))
  {
    return false;
  }
  for (std::ptrdiff_t row = rows.begin; marks && row < rows.end; ++row)
  {
    const ColumnSpan span = spans[row - rows.begin];
    ColumnSpan &     marked = known[row];
    if (span.begin < span.end && (span.begin < marked.begin || span.end > marked.end))
    {
      std::memset(marks + row * rowStride + span.begin, 1, static_cast<std::size_t>(span.end - span.begin));
      const bool areJoined = span.begin <= marked.end && span.end >= marked.begin;
      marked = areJoined ? ColumnSpan{ std::min(span.begin, marked.begin), std::max(span.end, marked.end) } : span;
    }
  }
  return true;
}

double
Decay(double x)
{
  if (!(x < 708.0))
  {
    return 0.0;
  }
  // exp(-x) = 2^-n exp(r), and n log2High is exact
  constexpr double log2High = 0x1.62e42fefap-1;
  constexpr double log2Low = 0x1.cf79abc9e3b3ap-40;
  const double     n = std::floor(x * 0x1.71547652b82fep+0 + 0.5);
  const double     r = (n * log2High - x) + n * log2Low;
  // coefficients of Taylor's series; the first term left out is below 2^-57
  constexpr double c[] = {
    1.0 / 2,     1.0 / 6,      1.0 / 24,      1.0 / 120,      1.0 / 720,       1.0 / 5040,
    1.0 / 40320, 1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800
  };
  const double r2 = r * r;
  const auto   sum = [=](int m) { return (c[m] + c[m + 1] * r) + r2 * (c[m + 2] + c[m + 3] * r); };
  const double exponential = 1.0 + (r + r2 * (sum(0) + (r2 * r2) * (sum(4) + (r2 * r2) * sum(8))));
  const auto   powerBits = static_cast<std::uint64_t>(1023 - static_cast<std::int64_t>(n)) << 52;
  double       power;
  std::memcpy(&power, &powerBits, sizeof(power));
  return exponential * power;
}

namespace
{
/** Returns a float below 2^-60 as 0: products with denormalized numbers are slow. */
template <typename TNumber>
TNumber
ToFadeNumber(double factor)
{
  return std::is_same_v<TNumber, float> && factor < 0x1p-60 ? TNumber{ 0 } : static_cast<TNumber>(factor);
}
} // namespace

template <typename TPixel>
void
ViewFading<TPixel>::SetStack(std::ptrdiff_t columns, std::ptrdiff_t first)
{
  firstSlice = first;
  factors.assign(columns + 1 + 2 * FadePadding, 0);
  for (std::ptrdiff_t n = 0; n <= columns; ++n)
  {
    factors[FadePadding + n] =
      ToFadeNumber<FadeNumber<TPixel>>(Decay(fading.rate * (std::abs(depth.perColumn) * static_cast<double>(n))));
  }
  if (depth.perColumn < 0)
  {
    std::reverse(factors.begin(), factors.end());
  }
}

template <typename TPixel>
FadingRow<TPixel>
ViewFading<TPixel>::GetRow(std::ptrdiff_t row, std::ptrdiff_t slice, ColumnSpan reached) const
{
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const auto       y = static_cast<double>(row);
  const auto       z = static_cast<double>(firstSlice + slice);
  ColumnSpan       behind = reached;
  ClipColumns({ depth, fading.begin, infinity }, y, z, 1, &behind);
  const bool   isFirstNearest = depth.perColumn >= 0;
  const auto   count = static_cast<std::int32_t>(factors.size() - 2 * FadePadding);
  const auto   nearest = isFirstNearest ? behind.begin : behind.end - 1;
  const double factor = behind.begin == behind.end ? 1.0 : Decay(fading.rate * (depth(nearest, y, z) - fading.begin));
  return { behind,
           isFirstNearest ? nearest : behind.end - count,
           ToFadeNumber<FadeNumber<TPixel>>(factor),
           factors.data() + FadePadding,
           background };
}

#define INSTANTIATE(TPixel) template struct ViewFading<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE

} // namespace itk::ShearWarp
