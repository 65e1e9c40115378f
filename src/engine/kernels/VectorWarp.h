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
#ifndef itkShearWarpVectorWarp_h
#define itkShearWarpVectorWarp_h

/* From the intermediate image to the output. Vector.h includes this header. */

/** The four corners' weights and values of a few pixels: rows a and b, left and right. */
struct WarpCells
{
  Lanes::Index   aaWeights, abWeights, baWeights, bbWeights;
  Lanes::Index   index;
  std::ptrdiff_t rowStride;
};

/** Interpolates between integers; all corners count. */
template <typename TPixel>
bool
InterpolateCells(const WarpCells & cells, const TPixel * pixels, TPixel * output)
{
  // two neighbours come in one 32-bit element
  constexpr int bits = 8 * sizeof(TPixel);
  const auto    extract = [](Lanes::Index pair, int position) {
    const auto shifted = Lanes::ShiftLeft(pair, 32 - bits - position);
    return static_cast<TPixel>(-1) > 0 ? Lanes::ShiftRightLogical(shifted, 32 - bits)
                                          : Lanes::ShiftRight(shifted, 32 - bits);
  };
  const Lanes::Index upper = Lanes::Gather<sizeof(TPixel)>(pixels, cells.index);
  const Lanes::Index lower = Lanes::Gather<sizeof(TPixel)>(pixels + cells.rowStride, cells.index);
  Lanes::Index       sum = Lanes::SetIndex(1 << 14);
  sum = Lanes::AddIndex(sum, Lanes::MultiplyIndex(cells.bbWeights, extract(upper, 0)));
  sum = Lanes::AddIndex(sum, Lanes::MultiplyIndex(cells.baWeights, extract(upper, bits)));
  sum = Lanes::AddIndex(sum, Lanes::MultiplyIndex(cells.abWeights, extract(lower, 0)));
  sum = Lanes::AddIndex(sum, Lanes::MultiplyIndex(cells.aaWeights, extract(lower, bits)));
  Lanes::StoreLow(output, Lanes::ShiftRight(sum, 15));
  return true;
}

/** Interpolates between finite values; false, and no output, if one is not. */
inline bool
InterpolateCells(const WarpCells & cells, const float * pixels, float * output)
{
  const Lanes::Single values[4] = { Lanes::GatherSingle(pixels, cells.index),
                                    Lanes::GatherSingle(pixels + 1, cells.index),
                                    Lanes::GatherSingle(pixels + cells.rowStride, cells.index),
                                    Lanes::GatherSingle(pixels + cells.rowStride + 1, cells.index) };
  const Lanes::Index  weights[4] = { cells.bbWeights, cells.baWeights, cells.abWeights, cells.aaWeights };
  Lanes::Double       total = Lanes::SetDouble(0.0);
  Lanes::Single       lowest = Lanes::SetSingle(__builtin_inff());
  Lanes::Single       highest = Lanes::SetSingle(-__builtin_inff());
  for (int corner = 0; corner < 4; ++corner)
  {
    if (!Lanes::AreFinite(values[corner]))
    {
      return false;
    }
    total = Lanes::AddDouble(
      total, Lanes::MultiplyDouble(Lanes::IndexToDouble(weights[corner]), Lanes::SingleToDouble(values[corner])));
    lowest = Lanes::SelectWhereZero(weights[corner], lowest, Lanes::MinimumSingle(values[corner], lowest));
    highest = Lanes::SelectWhereZero(weights[corner], highest, Lanes::MaximumSingle(values[corner], highest));
  }
  const Lanes::Single rounded = Lanes::DoubleToSingle(Lanes::MultiplyDouble(total, Lanes::SetDouble(1.0 / 32768)));
  const Lanes::Single mean = Lanes::MinimumSingle(highest, Lanes::MaximumSingle(lowest, rounded));
  // a mean of zero is +0
  Lanes::StoreSingle(output, mean + Lanes::SetSingle(0.0f));
  return true;
}

/** Whether slices reach all of columns [begin, end) of rows [rowBegin, rowEnd) or, unless VAll, one of them. */
template <bool VAll, typename TPixel>
bool
IsReached(const IntermediateImage<TPixel> & image,
          std::ptrdiff_t                    rowBegin,
          std::ptrdiff_t                    rowEnd,
          std::ptrdiff_t                    begin,
          std::ptrdiff_t                    end)
{
  for (std::ptrdiff_t row = rowBegin; row < rowEnd; ++row)
  {
    const auto [first, last] = image.reached[row];
    if ((VAll ? begin >= first && end <= last : begin < last && end > first) != VAll)
    {
      return !VAll;
    }
  }
  return VAll;
}

inline double
AbsoluteValue(double value)
{
  return value < 0 ? -value : value;
}

/** Narrows [begin, end) to the integers x where lowest < slope x + offset < highest, and at most two more on each side.
 */
inline void
Clip(double slope, double offset, double lowest, double highest, std::ptrdiff_t & begin, std::ptrdiff_t & end)
{
  // of a zero too: infinities come from it, with its sign
  if (__builtin_signbit(slope))
  {
    return Clip(-slope, -offset, -highest, -lowest, begin, end);
  }
  const double first = (lowest - offset) / slope - 1;
  const double last = (highest - offset) / slope + 2;
  const auto   from = static_cast<double>(begin);
  const auto   to = static_cast<double>(end);
  // false for what is not a number, and then nothing is cut off
  begin = first > from ? static_cast<std::ptrdiff_t>(Smaller(first, to)) : begin;
  end = last < to ? static_cast<std::ptrdiff_t>(Larger(last, from)) : end;
  end = Larger(begin, end);
}

template <typename TPixel>
void
WarpRow(const IntermediateImage<TPixel> & intermediate,
        const AffineMap2D &               outputToIntermediate,
        std::ptrdiff_t                    row,
        std::ptrdiff_t                    columnBegin,
        std::ptrdiff_t                    columnEnd,
        TPixel                            background,
        TPixel *                          output)
{
  const auto &             map = outputToIntermediate;
  constexpr std::ptrdiff_t lanes = Lanes::WarpCount;
  constexpr std::ptrdiff_t read = IsFloat<TPixel> ? 2 : 4 / sizeof(TPixel);
  const auto               portable = GetPortableKernels<TPixel>().warpRow;
  constexpr std::ptrdiff_t limit = 65535;
  if (intermediate.hasGaps || intermediate.columns > limit || intermediate.rows > limit ||
      intermediate.rows * intermediate.rowStride > 2147483647)
  {
    return portable(intermediate, map, row, columnBegin, columnEnd, background, output);
  }

  // the same operations in the same order as for one pixel
  const auto          y = static_cast<double>(row);
  const Lanes::Double columnFromRow = Lanes::SetDouble(map.xy * y);
  const Lanes::Double rowFromRow = Lanes::SetDouble(map.yy * y);
  const auto          quantize = [](Lanes::Double position) {
    return Lanes::DoubleToIndex(
      Lanes::AddDouble(Lanes::MultiplyDouble(position, Lanes::SetDouble(32768.0)), Lanes::SetDouble(0.5)));
  };
  std::ptrdiff_t begin = columnBegin;
  std::ptrdiff_t end = columnEnd;
  const auto     clip = [&](double slope, double fromRow, double offset, std::ptrdiff_t pixels) {
    // the terms of a position may cancel: what is left is then rounding
    const double size =
      AbsoluteValue(slope) * static_cast<double>(columnEnd) + AbsoluteValue(fromRow) + AbsoluteValue(offset);
    const double error = 0x1p-50 * size;
    Clip(slope, fromRow + offset, -1.0 - error, static_cast<double>(pixels) + error, begin, end);
  };
  clip(map.xx, map.xy * y, map.x0, intermediate.columns);
  clip(map.yx, map.yy * y, map.y0, intermediate.rows);
  for (std::ptrdiff_t x = columnBegin; x < begin; ++x)
  {
    output[x] = background;
  }
  for (std::ptrdiff_t x = end; x < columnEnd; ++x)
  {
    output[x] = background;
  }
  std::ptrdiff_t x = begin;
  for (; x + lanes <= end; x += lanes)
  {
    const Lanes::Double xs = Lanes::Count(static_cast<double>(x));
    const Lanes::Double columns = Lanes::AddDouble(
      Lanes::AddDouble(Lanes::MultiplyDouble(Lanes::SetDouble(map.xx), xs), columnFromRow), Lanes::SetDouble(map.x0));
    const Lanes::Double rows = Lanes::AddDouble(
      Lanes::AddDouble(Lanes::MultiplyDouble(Lanes::SetDouble(map.yx), xs), rowFromRow), Lanes::SetDouble(map.y0));
    const auto isWithin = Lanes::AreWithin(columns, 0.0, static_cast<double>(intermediate.columns - 1)) &&
                          Lanes::AreWithin(rows, 0.0, static_cast<double>(intermediate.rows - 1));
    bool isDone = false;
    if (isWithin)
    {
      const Lanes::Index column = quantize(columns);
      const Lanes::Index wholeColumn = Lanes::ShiftRight(column, 15);
      const Lanes::Index line = quantize(rows);
      const Lanes::Index wholeRow = Lanes::ShiftRight(line, 15);
      // positions lie on a line: the outer ones are the extremes
      const std::ptrdiff_t first = Smaller(Lanes::First(wholeColumn), Lanes::Last(wholeColumn));
      const std::ptrdiff_t last = Larger(Lanes::First(wholeColumn), Lanes::Last(wholeColumn));
      const std::ptrdiff_t rowBegin = Smaller(Lanes::First(wholeRow), Lanes::Last(wholeRow));
      const std::ptrdiff_t rowEnd = Larger(Lanes::First(wholeRow), Lanes::Last(wholeRow)) + 2;
      if (last + read <= intermediate.columns && rowEnd <= intermediate.rows &&
          IsReached<true>(intermediate, rowBegin, rowEnd, first, last + 2))
      {
        const Lanes::Index fraction = Lanes::SetIndex(32767);
        const Lanes::Index u = Lanes::AndIndex(column, fraction);
        const Lanes::Index v = Lanes::AndIndex(line, fraction);
        WarpCells          cells;
        cells.aaWeights = Lanes::ShiftRight(Lanes::AddIndex(Lanes::MultiplyIndex(u, v), Lanes::SetIndex(1 << 14)), 15);
        cells.abWeights = Lanes::SubtractIndex(v, cells.aaWeights);
        cells.baWeights = Lanes::SubtractIndex(u, cells.aaWeights);
        cells.bbWeights = Lanes::SubtractIndex(Lanes::SetIndex(32768), Lanes::AddIndex(v, cells.baWeights));
        cells.rowStride = intermediate.rowStride;
        cells.index = Lanes::AddIndex(
          Lanes::MultiplyIndex(wholeRow, Lanes::SetIndex(static_cast<std::int32_t>(cells.rowStride))), wholeColumn);
        isDone = InterpolateCells(cells, static_cast<const TPixel *>(intermediate.pixels), output + x);
      }
      else if (rowEnd <= intermediate.rows && !IsReached<false>(intermediate, rowBegin, rowEnd, first, last + 2))
      {
        for (std::ptrdiff_t n = x; n < x + lanes; ++n)
        {
          output[n] = background;
        }
        isDone = true;
      }
    }
    if (!isDone)
    {
      portable(intermediate, map, row, x, x + lanes, background, output);
    }
  }
  portable(intermediate, map, row, x, end, background, output);
}

#endif
