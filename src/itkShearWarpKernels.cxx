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

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <type_traits>

namespace itk::ShearWarp
{

SamplingPosition
QuantizePosition(double position)
{
  const auto quantized = static_cast<std::int64_t>(std::floor(position * One + 0.5));
  return { static_cast<std::int32_t>(quantized >> FractionBits), static_cast<std::int32_t>(quantized & (One - 1)) };
}

namespace
{

template <typename TPixel>
constexpr TPixel NoSample = std::is_floating_point_v<TPixel> ? -std::numeric_limits<TPixel>::infinity()
                                                             : std::numeric_limits<TPixel>::lowest();

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
    const std::int64_t quotient = twice / (2 * sum);
    const bool         roundedUp = twice % (2 * sum) < 0;
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

} // namespace

template <typename TPixel>
void
ProjectSlices(const SliceStack<TPixel> &        slices,
              const SlicePlacement *            placements,
              std::ptrdiff_t                    rowBegin,
              std::ptrdiff_t                    rowEnd,
              const IntermediateImage<TPixel> & intermediate)
{
  std::fill(intermediate.pixels + rowBegin * intermediate.columns,
            intermediate.pixels + rowEnd * intermediate.columns,
            NoSample<TPixel>);

  for (std::ptrdiff_t k = 0; k < slices.slices; ++k)
  {
    const SlicePlacement & placement = placements[k];
    const Sampler<TPixel>  sample(placement.column.fraction, placement.row.fraction);
    const TPixel *         slice = slices.voxels + k * slices.sliceStride;
    const std::ptrdiff_t   firstRow = placement.FirstRow();
    const std::ptrdiff_t   last = slices.columns - 1;

    for (std::ptrdiff_t q = std::max(rowBegin, firstRow); q < std::min(rowEnd, firstRow + slices.rows); ++q)
    {
      const std::ptrdiff_t j = q - placement.row.whole;
      const TPixel *       a = slice + std::max<std::ptrdiff_t>(j - 1, 0) * slices.rowStride;
      const TPixel *       b = slice + std::min(j, slices.rows - 1) * slices.rowStride;
      TPixel *             row = intermediate.pixels + q * intermediate.columns + placement.column.whole;

      for (std::ptrdiff_t i = 1; i <= last; ++i)
      {
        const TPixel value = sample(a[i - 1], a[i], b[i - 1], b[i]);
        row[i] = value > row[i] ? value : row[i];
      }

      // the outer half voxel has the edge's value
      const bool           atFirst = placement.FirstColumn() == placement.column.whole;
      const std::ptrdiff_t edge = atFirst ? 0 : last;
      TPixel &             pixel = row[atFirst ? 0 : last + 1];
      const TPixel         value = sample(a[edge], a[edge], b[edge], b[edge]);
      pixel = value > pixel ? value : pixel;
    }
  }
}

template <typename TPixel>
void
WarpRows(const IntermediateImage<TPixel> & intermediate,
         const AffineMap2D &               outputToIntermediate,
         std::ptrdiff_t                    rowBegin,
         std::ptrdiff_t                    rowEnd,
         std::ptrdiff_t                    columns,
         TPixel                            background,
         TPixel *                          output)
{
  const AffineMap2D & map = outputToIntermediate;
  for (std::ptrdiff_t y = rowBegin; y < rowEnd; ++y)
  {
    for (std::ptrdiff_t x = 0; x < columns; ++x, ++output)
    {
      *output = background;
      const double column = (map.xx * x + map.xy * y) + map.x0;
      const double row = (map.yx * x + map.yy * y) + map.y0;
      if (!(column > -1.0 && column < intermediate.columns && row > -1.0 && row < intermediate.rows))
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
        values[corner] = reached ? intermediate.pixels[j * intermediate.columns + i] : TPixel{};
        if (!reached || (std::is_floating_point_v<TPixel> && values[corner] == NoSample<TPixel>))
        {
          weights[corner] = 0;
        }
        sum += weights[corner];
      }
      if (sum > 0)
      {
        *output = WeightedMean(values, weights, sum);
      }
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

#define INSTANTIATE(TPixel)                                               \
  template void ProjectSlices<TPixel>(const SliceStack<TPixel> &,         \
                                      const SlicePlacement *,             \
                                      std::ptrdiff_t,                     \
                                      std::ptrdiff_t,                     \
                                      const IntermediateImage<TPixel> &); \
  template void WarpRows<TPixel>(const IntermediateImage<TPixel> &,       \
                                 const AffineMap2D &,                     \
                                 std::ptrdiff_t,                          \
                                 std::ptrdiff_t,                          \
                                 std::ptrdiff_t,                          \
                                 TPixel,                                  \
                                 TPixel *);                               \
  template void TransposeSlice<TPixel>(const TPixel *, std::ptrdiff_t, std::ptrdiff_t, TPixel *)

INSTANTIATE(char);
INSTANTIATE(signed char);
INSTANTIATE(unsigned char);
INSTANTIATE(short);
INSTANTIATE(unsigned short);
INSTANTIATE(int);
INSTANTIATE(unsigned int);
INSTANTIATE(long);
INSTANTIATE(unsigned long);
INSTANTIATE(long long);
INSTANTIATE(unsigned long long);
INSTANTIATE(float);
INSTANTIATE(double);

#undef INSTANTIATE

} // namespace itk::ShearWarp
