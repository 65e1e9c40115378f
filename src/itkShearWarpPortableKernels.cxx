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
#include "itkShearWarpKernels.h"
#include "itkShearWarpPixelTypes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <type_traits>

namespace itk::ShearWarp
{

namespace
{

/** The weighted mean of N values, rounded half upward to the pixel type. The weights sum to \a sum <= 2^15. */
template <typename TPixel, std::size_t N>
TPixel
WeightedMean(const TPixel (&values)[N], const std::int32_t (&weights)[N], std::int32_t sum)
{
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    double mean = 0.0;
    for (std::size_t n = 0; n < N; ++n)
    {
      mean += weights[n] == 0 ? 0.0 : weights[n] * static_cast<double>(values[n]);
    }
    const auto weighted = [&](TPixel limit, auto better) {
      for (std::size_t n = 0; n < N; ++n)
      {
        limit = weights[n] != 0 && better(values[n], limit) ? values[n] : limit;
      }
      return limit;
    };
    const TPixel lowest = weighted(std::numeric_limits<TPixel>::infinity(), std::less<>());
    const TPixel highest = weighted(-std::numeric_limits<TPixel>::infinity(), std::greater<>());
    return std::clamp(static_cast<TPixel>(mean / sum), lowest, highest);
  }
  else
  {
    // for 64-bit pixels, value = quotient * sum + remainder keeps every term within 64 bits
    TPixel       whole = 0;
    std::int64_t twice = sum;
    for (std::size_t n = 0; n < N; ++n)
    {
      TPixel remainder = values[n];
      if constexpr (sizeof(TPixel) == sizeof(std::int64_t))
      {
        const auto divisor = static_cast<TPixel>(sum);
        whole += static_cast<TPixel>(weights[n]) * (values[n] / divisor);
        remainder = values[n] % divisor;
      }
      twice += 2 * static_cast<std::int64_t>(weights[n]) * static_cast<std::int64_t>(remainder);
    }
    const std::int64_t twiceSum = 2 * std::int64_t{ sum };
    const std::int64_t quotient = twice / twiceSum;
    const bool         roundedUp = twice % twiceSum < 0;
    return static_cast<TPixel>(whole + static_cast<TPixel>(roundedUp ? quotient - 1 : quotient));
  }
}

/** Samples slices at one placement's fractions: the bilinear rule of the intermediate image. */
template <typename TPixel, typename = void>
class Sampler
{
public:
  Sampler(std::int32_t x, std::int32_t y)
    : m_Weights(x, y)
  {}

  TPixel
  operator()(TPixel aa, TPixel ab, TPixel ba, TPixel bb) const
  {
    if constexpr (sizeof(TPixel) < sizeof(std::int64_t))
    {
      using Sum = std::conditional_t<(sizeof(TPixel) > 2), std::int64_t, std::int32_t>;
      const Sum sum =
        Sum{ m_Weights.aa } * aa + Sum{ m_Weights.ab } * ab + Sum{ m_Weights.ba } * ba + Sum{ m_Weights.bb } * bb;
      return static_cast<TPixel>((sum + One / 2) >> FractionBits);
    }
    else
    {
      return WeightedMean<TPixel, 4>(
        { aa, ab, ba, bb }, { m_Weights.aa, m_Weights.ab, m_Weights.ba, m_Weights.bb }, One);
    }
  }

private:
  BilinearWeights m_Weights;
};

template <typename TPixel>
class Sampler<TPixel, std::enable_if_t<std::is_floating_point_v<TPixel>>>
{
public:
  Sampler(std::int32_t x, std::int32_t y)
    : m_X(static_cast<TPixel>(x) / One)
    , m_Y(static_cast<TPixel>(y) / One)
  {}

  TPixel
  operator()(TPixel aa, TPixel ab, TPixel ba, TPixel bb) const
  {
    return Interpolate(Interpolate(aa, ab, m_X), Interpolate(ba, bb, m_X), m_Y);
  }

private:
  static TPixel
  Interpolate(TPixel a, TPixel b, TPixel weightOfA)
  {
    return weightOfA == 0 ? b : b + weightOfA * (a - b);
  }

  TPixel m_X;
  TPixel m_Y;
};

template <typename TPixel>
void
Raise(TPixel & maximum, TPixel value)
{
  maximum = value > maximum ? value : maximum;
}

/** Samples one slice along the rows [\a a and] \a b, and at the outer voxels with \a edgeSample. */
template <typename TPixel>
void
ProjectRow(const TPixel *           a,
           const TPixel *           b,
           std::ptrdiff_t           columns,
           const SamplingPosition & position,
           const Sampler<TPixel> &  sample,
           const Sampler<TPixel> &  edgeSample,
           const std::uint8_t *     active,
           TPixel *                 pixels)
{
  for (std::ptrdiff_t begin = position.whole + 1, end = 0; begin < position.whole + columns; begin = end)
  {
    end = std::min<std::ptrdiff_t>((begin / TileColumns + 1) * TileColumns, position.whole + columns);
    if (!active || active[begin / TileColumns])
    {
      for (std::ptrdiff_t p = begin; p < end; ++p)
      {
        const std::ptrdiff_t i = p - position.whole;
        Raise(pixels[p], sample(a[i - 1], a[i], b[i - 1], b[i]));
      }
    }
  }
  const std::ptrdiff_t edge = position.fraction > One / 2 ? columns : 0;
  const std::ptrdiff_t i = std::min(edge, columns - 1);
  if (!active || active[(position.whole + edge) / TileColumns])
  {
    Raise(pixels[position.whole + edge], edgeSample(a[i], a[i], b[i], b[i]));
  }
}

template <typename TPixel>
void
ProjectBlock(const SliceStack<TPixel> &  slices,
             const Block &               block,
             const ShearedView<TPixel> * views,
             std::size_t                 count)
{
  for (std::ptrdiff_t k = block.sliceBegin; k < block.sliceEnd; ++k)
  {
    for (const ShearedView<TPixel> * view = views; view != views + count; ++view)
    {
      const SamplingPosition & column = view->placements[k].column;
      const SamplingPosition & row = view->placements[k].row;
      const Sampler<TPixel>    sample(column.fraction, row.fraction);
      const Sampler<TPixel>    edgeRow(column.fraction, 0);
      const Sampler<TPixel>    edgeColumn(0, row.fraction);
      const Sampler<TPixel>    corner(0, 0);

      // sample j lies between rows j - 1 and j; the outer half voxels have the edge's value
      const std::ptrdiff_t first = row.fraction > One / 2;
      const std::ptrdiff_t end = block.rowEnd == slices.rows ? slices.rows + first : block.rowEnd;
      for (std::ptrdiff_t j = block.rowBegin == 0 ? first : block.rowBegin; j < end; ++j)
      {
        const bool edge = j == 0 || j == slices.rows;
        const auto getRow = [&](std::ptrdiff_t index) {
          return slices.voxels + (k * slices.sliceStride + index * slices.rowStride - slices.first);
        };
        const TPixel *       a = getRow(std::max<std::ptrdiff_t>(j - 1, 0));
        const TPixel *       b = getRow(std::min(j, slices.rows - 1));
        const std::ptrdiff_t tile = (std::min(j, slices.rows - 1) - block.rowBegin) / BlockLength;
        ProjectRow(a,
                   b,
                   slices.columns,
                   column,
                   edge ? edgeRow : sample,
                   edge ? corner : edgeColumn,
                   view->active ? view->active + tile * view->activeStride : nullptr,
                   view->intermediate.pixels + (row.whole + j) * view->intermediate.rowStride);
      }
    }
  }
}

template <typename TPixel>
bool
IsAnyBelow(const TPixel * pixels, std::ptrdiff_t rowStride, std::ptrdiff_t rows, std::ptrdiff_t columns, TPixel value)
{
  for (std::ptrdiff_t j = 0; j < rows; ++j)
  {
    const TPixel * row = pixels + j * rowStride;
    if (std::any_of(row, row + columns, [=](TPixel pixel) { return pixel < value; }))
    {
      return true;
    }
  }
  return false;
}

template <typename TPixel>
void
FindBlockMaxima(const TPixel * voxels,
                std::ptrdiff_t columns,
                std::ptrdiff_t rows,
                std::ptrdiff_t slices,
                std::ptrdiff_t rowStride,
                std::ptrdiff_t sliceStride,
                TPixel *       maxima,
                TPixel &       lowest,
                TPixel &       highest)
{
  std::fill(maxima, maxima + (columns + BlockLength - 1) / BlockLength, NoSample<TPixel>);
  for (std::ptrdiff_t k = 0; k < slices; ++k)
  {
    for (std::ptrdiff_t j = 0; j < rows; ++j)
    {
      const TPixel * row = voxels + k * sliceStride + j * rowStride;
      for (std::ptrdiff_t i = 0; i < columns; ++i)
      {
        Raise(maxima[i / BlockLength], row[i]);
        Raise(highest, row[i]);
        lowest = row[i] < lowest ? row[i] : lowest;
      }
    }
  }
}

template <typename TPixel>
void
WarpRow(const IntermediateImage<TPixel> & intermediate,
        const AffineMap2D &               outputToIntermediate,
        std::ptrdiff_t                    y,
        std::ptrdiff_t                    columnBegin,
        std::ptrdiff_t                    columnEnd,
        TPixel                            background,
        TPixel *                          output)
{
  const AffineMap2D & map = outputToIntermediate;
  const auto          outputRow = static_cast<double>(y);
  const auto          columns = static_cast<double>(intermediate.columns);
  const auto          rows = static_cast<double>(intermediate.rows);
  for (std::ptrdiff_t x = columnBegin; x < columnEnd; ++x)
  {
    output[x] = background;
    const auto   outputColumn = static_cast<double>(x);
    const double column = (map.xx * outputColumn + map.xy * outputRow) + map.x0;
    const double row = (map.yx * outputColumn + map.yy * outputRow) + map.y0;
    if (!(column > -1.0 && column < columns && row > -1.0 && row < rows))
    {
      continue;
    }
    const SamplingPosition p = QuantizePosition(column);
    const SamplingPosition q = QuantizePosition(row);
    const BilinearWeights  cell(p.fraction, q.fraction);

    TPixel       values[4];
    std::int32_t weights[4] = { cell.bb, cell.ba, cell.ab, cell.aa };
    std::int32_t sum = 0;
    for (int corner = 0; corner < 4; ++corner)
    {
      const std::ptrdiff_t i = p.whole + (corner & 1);
      const std::ptrdiff_t j = q.whole + (corner >> 1);
      const bool           reached = weights[corner] != 0 && j >= 0 && j < intermediate.rows &&
                           i >= intermediate.reached[j].begin && i < intermediate.reached[j].end;
      values[corner] = reached ? intermediate.pixels[j * intermediate.rowStride + i] : TPixel{};
      if (!reached || (std::is_floating_point_v<TPixel> && values[corner] == NoSample<TPixel>))
      {
        weights[corner] = 0;
      }
      sum += weights[corner];
    }
    if (sum > 0)
    {
      output[x] = WeightedMean(values, weights, sum);
    }
  }
}

template <typename TPixel>
void
TransposeSlice(const TPixel * input, std::ptrdiff_t columns, std::ptrdiff_t rows, TPixel * output)
{
  constexpr std::ptrdiff_t tile = 32;
  for (std::ptrdiff_t tileRow = 0; tileRow < rows; tileRow += tile)
  {
    for (std::ptrdiff_t tileColumn = 0; tileColumn < columns; tileColumn += tile)
    {
      for (std::ptrdiff_t i = tileColumn; i < std::min(tileColumn + tile, columns); ++i)
      {
        for (std::ptrdiff_t j = tileRow; j < std::min(tileRow + tile, rows); ++j)
        {
          output[i * rows + j] = input[j * columns + i];
        }
      }
    }
  }
}

} // namespace

template <typename TPixel>
const Kernels<TPixel> &
GetPortableKernels()
{
  static constexpr Kernels<TPixel> kernels{ "portable",         ProjectBlock<TPixel>,
                                            IsAnyBelow<TPixel>, FindBlockMaxima<TPixel>,
                                            WarpRow<TPixel>,    TransposeSlice<TPixel> };
  return kernels;
}

#define INSTANTIATE(TPixel) template const Kernels<TPixel> & GetPortableKernels();
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE

} // namespace itk::ShearWarp
