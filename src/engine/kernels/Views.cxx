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

ColumnSpan
ClipColumns(const ShearedFunction & function, double low, double high, double row, double slice, ColumnSpan span)
{
  // the function is monotonic in the column, with rounding too
  const double rest = function(0.0, row, slice);
  const auto   getValue = [&](std::int32_t column) { return function.perColumn * column + rest; };
  if (span.begin >= span.end)
  {
    return span;
  }
  const auto [lowest, highest] = std::minmax({ getValue(span.begin), getValue(span.end - 1) });
  if (lowest >= low && highest <= high)
  {
    return span;
  }
  if (!(highest >= low && lowest <= high))
  {
    return { span.begin, span.begin };
  }
  // the search begins near the column where the function has the value
  const auto findFirst = [&](double value, const auto & isReached) {
    const double guess = (value - rest) / function.perColumn;
    auto         first = guess > span.begin ? static_cast<std::int32_t>(std::min<double>(guess, span.end)) : span.begin;
    for (; first > span.begin && isReached(first - 1); --first)
    {
    }
    for (; first < span.end && !isReached(first); ++first)
    {
    }
    return first;
  };
  if (function.perColumn >= 0)
  {
    return { findFirst(low, [&](std::int32_t column) { return getValue(column) >= low; }),
             findFirst(high, [&](std::int32_t column) { return getValue(column) > high; }) };
  }
  return { findFirst(high, [&](std::int32_t column) { return getValue(column) <= high; }),
           findFirst(low, [&](std::int32_t column) { return getValue(column) < low; }) };
}

bool
Region::MayReach(ColumnSpan columns, RowSpan rows, std::ptrdiff_t slice) const
{
  const auto   position = static_cast<double>(first.slice + slice);
  const double outerColumns[] = { static_cast<double>(first.column + columns.begin),
                                  static_cast<double>(first.column + columns.end - 1) };
  const double outerRows[] = { static_cast<double>(first.row + rows.begin),
                               static_cast<double>(first.row + rows.end - 1) };
  return std::all_of(intervals.begin(), intervals.end(), [&](const Interval & interval) {
    // the function is monotonic in column and row, with rounding too
    const auto & function = interval.function;
    const bool   falls = function.perColumn < 0;
    const bool   fallsAlongRows = function.perRow < 0;
    const double lowest = function(outerColumns[falls], outerRows[fallsAlongRows], position);
    const double highest = function(outerColumns[!falls], outerRows[!fallsAlongRows], position);
    return highest >= interval.low && lowest <= interval.high;
  });
}

ColumnSpan
Region::Clip(ColumnSpan columns, std::ptrdiff_t row, std::ptrdiff_t slice) const
{
  const auto shift = static_cast<std::int32_t>(first.column);
  columns = { columns.begin + shift, columns.end + shift };
  for (const auto & [function, low, high] : intervals)
  {
    columns = ClipColumns(
      function, low, high, static_cast<double>(first.row + row), static_cast<double>(first.slice + slice), columns);
  }
  return { columns.begin - shift, columns.end - shift };
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

ColumnSpan
Coverage::Add(ColumnSpan columns, std::ptrdiff_t row, std::ptrdiff_t slice) const
{
  const ColumnSpan span = region->Clip(columns, row, slice);
  if (!marks)
  {
    return span;
  }
  ColumnSpan & marked = known[row];
  if (span.begin < span.end && (span.begin < marked.begin || span.end > marked.end))
  {
    std::memset(marks + row * rowStride + span.begin, 1, static_cast<std::size_t>(span.end - span.begin));
    const bool areJoined = span.begin <= marked.end && span.end >= marked.begin;
    marked = areJoined ? ColumnSpan{ std::min(span.begin, marked.begin), std::max(span.end, marked.end) } : span;
  }
  return span;
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
  const ColumnSpan behind = ClipColumns(depth, fading.begin, infinity, y, z, reached);
  const bool       isFirstNearest = depth.perColumn >= 0;
  const auto       count = static_cast<std::int32_t>(factors.size() - 2 * FadePadding);
  const auto       nearest = isFirstNearest ? behind.begin : behind.end - 1;
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
