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

/** Pixels [begin, end) along one axis. */
struct PixelSpan
{
  std::ptrdiff_t begin, end;
};

/** The cells of a vector of output pixels: the bilinear weights, and the place of the cell's first pixel. */
struct WarpCells
{
  Lanes::Index   aaWeights, abWeights, baWeights, bbWeights;
  Lanes::Index   index;
  std::ptrdiff_t rowStride;
};

/** Quantizes positions as QuantizePosition() does, to units of 1/2^15 pixel. */
SHEARWARP_INLINE inline Lanes::Index
QuantizePositions(Lanes::Double positions)
{
  return Lanes::DoubleToIndex(
    Lanes::AddDouble(Lanes::MultiplyDouble(positions, Lanes::SetDouble(32768.0)), Lanes::SetDouble(0.5)));
}

/** Rounds quantized positions to the nearest whole pixel, half upward. */
SHEARWARP_INLINE inline Lanes::Index
RoundPositions(Lanes::Index positions)
{
  return Lanes::AndIndex(Lanes::AddIndex(positions, Lanes::SetIndex(1 << 14)), Lanes::SetIndex(-32768));
}

/** Returns the pixels of the cells at quantized positions along one axis. */
SHEARWARP_INLINE inline PixelSpan
GetPixels(Lanes::Index positions)
{
  // positions lie on a line: the outer ones are the extremes
  const Lanes::Index   whole = Lanes::ShiftRight(positions, 15);
  const std::ptrdiff_t first = Lanes::First(whole);
  const std::ptrdiff_t last = Lanes::Last(whole);
  return { Smaller(first, last), Larger(first, last) + 2 };
}

/** Returns the cells at quantized positions, with the weights of BilinearWeights. */
SHEARWARP_INLINE inline WarpCells
GetCells(Lanes::Index columns, Lanes::Index rows, std::ptrdiff_t rowStride)
{
  const Lanes::Index u = Lanes::AndIndex(columns, Lanes::SetIndex(32767));
  const Lanes::Index v = Lanes::AndIndex(rows, Lanes::SetIndex(32767));
  const Lanes::Index stride = Lanes::SetIndex(static_cast<std::int32_t>(rowStride));
  WarpCells          cells;
  cells.aaWeights = Lanes::ShiftRight(Lanes::AddIndex(Lanes::MultiplyIndex(u, v), Lanes::SetIndex(1 << 14)), 15);
  cells.abWeights = Lanes::SubtractIndex(v, cells.aaWeights);
  cells.baWeights = Lanes::SubtractIndex(u, cells.aaWeights);
  cells.bbWeights = Lanes::SubtractIndex(Lanes::SetIndex(32768), Lanes::AddIndex(v, cells.baWeights));
  cells.rowStride = rowStride;
  cells.index =
    Lanes::AddIndex(Lanes::MultiplyIndex(Lanes::ShiftRight(rows, 15), stride), Lanes::ShiftRight(columns, 15));
  return cells;
}

/** Writes a vector of output pixels, interpolated between integers. Returns true. */
template <typename TPixel>
SHEARWARP_INLINE inline bool
InterpolateCells(const WarpCells & cells, const TPixel * pixels, TPixel * output)
{
  // one 32-bit element holds two neighbours
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

/** Writes a vector of output pixels, interpolated between finite values. Returns false, and writes nothing, if a value
 * is not finite. */
SHEARWARP_INLINE inline bool
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

/** Returns whether all pixels of a rectangle are reached, or, unless VAll, whether one is. */
template <bool VAll, typename TPixel>
bool
IsReached(const IntermediateImage<TPixel> & image, PixelSpan columns, PixelSpan rows)
{
  for (std::ptrdiff_t row = rows.begin; row < rows.end; ++row)
  {
    const auto [first, last] = image.reached[row];
    if ((VAll ? columns.begin >= first && columns.end <= last : columns.begin < last && columns.end > first) != VAll)
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

/** Returns the positions (slope x + fromRow) + offset of output columns \a x along one axis of the intermediate image.
 */
SHEARWARP_INLINE inline Lanes::Double
GetPositions(double slope, Lanes::Double fromRow, double offset, Lanes::Double x)
{
  return Lanes::AddDouble(Lanes::AddDouble(Lanes::MultiplyDouble(Lanes::SetDouble(slope), x), fromRow),
                          Lanes::SetDouble(offset));
}

/** Narrows [begin, end) to the integers x where lowest < slope x + offset < highest, and at most two more on each side.
 */
inline void
Clip(double slope, double offset, double lowest, double highest, std::ptrdiff_t & begin, std::ptrdiff_t & end)
{
  // a slope of -0 too: its infinities have the other sign
  if (__builtin_signbit(slope))
  {
    return Clip(-slope, -offset, -highest, -lowest, begin, end);
  }
  const double first = (lowest - offset) / slope - 1;
  const double last = (highest - offset) / slope + 2;
  const auto   from = static_cast<double>(begin);
  const auto   to = static_cast<double>(end);
  // not-a-number cuts nothing off
  begin = first > from ? static_cast<std::ptrdiff_t>(Smaller(first, to)) : begin;
  end = last < to ? static_cast<std::ptrdiff_t>(Larger(last, from)) : end;
  end = Larger(begin, end);
}

/** Narrows output columns [begin, end) to the columns x that may have a value: whose position (slope x + fromRow) +
 * offset may be next to one of \a pixels pixels. No column is beyond \a columnEnd. */
inline void
ClipToPixels(double           slope,
             double           fromRow,
             double           offset,
             std::ptrdiff_t   pixels,
             std::ptrdiff_t   columnEnd,
             std::ptrdiff_t & begin,
             std::ptrdiff_t & end)
{
  // the terms of a position may cancel, and leave only rounding errors
  const double size =
    AbsoluteValue(slope) * static_cast<double>(columnEnd) + AbsoluteValue(fromRow) + AbsoluteValue(offset);
  const double error = 0x1p-50 * size;
  Clip(slope, fromRow + offset, -1.0 - error, static_cast<double>(pixels) + error, begin, end);
}

template <typename TPixel>
SHEARWARP_INLINE inline void
FillColumns(TPixel * output, std::ptrdiff_t begin, std::ptrdiff_t end, TPixel background)
{
  for (std::ptrdiff_t x = begin; x < end; ++x)
  {
    output[x] = background;
  }
}

/** Writes a vector of output pixels, which lie at \a columns and \a rows of the intermediate image. Returns false, and
 * writes nothing, if the portable kernel must write the pixels: at a border, or if a value is not finite. */
template <typename TPixel>
SHEARWARP_INLINE inline bool
WarpVector(const IntermediateImage<TPixel> & image,
           Lanes::Double                     columns,
           Lanes::Double                     rows,
           TPixel                            background,
           TPixel *                          output)
{
  if (!(Lanes::AreWithin(columns, 0.0, static_cast<double>(image.columns - 1)) &&
        Lanes::AreWithin(rows, 0.0, static_cast<double>(image.rows - 1))))
  {
    return false;
  }
  // a gather reads 32 bits: for small pixels, more than a cell has
  constexpr std::ptrdiff_t more = IsFloat<TPixel> ? 0 : 4 / sizeof(TPixel) - 2;
  const auto               place = [&image](Lanes::Double positions) SHEARWARP_INLINE {
    const Lanes::Index quantized = QuantizePositions(positions);
    return image.isNearest ? RoundPositions(quantized) : quantized;
  };
  const Lanes::Index p = place(columns);
  const Lanes::Index q = place(rows);
  const PixelSpan    pixelColumns = GetPixels(p);
  const PixelSpan    pixelRows = GetPixels(q);
  if (pixelRows.end > image.rows)
  {
    return false;
  }
  if (pixelColumns.end + more <= image.columns && IsReached<true>(image, pixelColumns, pixelRows))
  {
    return InterpolateCells(GetCells(p, q, image.rowStride), static_cast<const TPixel *>(image.pixels), output);
  }
  if (!IsReached<false>(image, pixelColumns, pixelRows))
  {
    FillColumns(output, 0, Lanes::WarpCount, background);
    return true;
  }
  return false;
}

/** See Kernels. */
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
  std::ptrdiff_t      begin = columnBegin;
  std::ptrdiff_t      end = columnEnd;
  ClipToPixels(map.xx, map.xy * y, map.x0, intermediate.columns, columnEnd, begin, end);
  ClipToPixels(map.yx, map.yy * y, map.y0, intermediate.rows, columnEnd, begin, end);
  FillColumns(output, columnBegin, begin, background);
  FillColumns(output, end, columnEnd, background);
  std::ptrdiff_t x = begin;
  for (; x + lanes <= end; x += lanes)
  {
    const Lanes::Double xs = Lanes::Count(static_cast<double>(x));
    const Lanes::Double columns = GetPositions(map.xx, columnFromRow, map.x0, xs);
    const Lanes::Double rows = GetPositions(map.yx, rowFromRow, map.y0, xs);
    if (!WarpVector(intermediate, columns, rows, background, output + x))
    {
      portable(intermediate, map, row, x, x + lanes, background, output);
    }
  }
  portable(intermediate, map, row, x, end, background, output);
}

#endif
