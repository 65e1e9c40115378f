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

#include <math.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <type_traits>

#define SHEARWARP_UNROLL
#define SHEARWARP_RESTRICT __restrict
// otherwise g++ calls a function for each cell
#if defined(__GNUC__)
#  define SHEARWARP_INLINE __attribute__((always_inline))
#else
#  define SHEARWARP_INLINE
#endif

namespace itk::ShearWarp
{

namespace
{

#include "Scalar.h"

/** One number in place of a vector. */
template <typename TNumber>
struct ExactVector
{
  using Type = TNumber;
  static constexpr int Count = 1;

  static Type
  Load(const TNumber * p)
  {
    return *p;
  }
  static void
  Store(TNumber * p, Type v)
  {
    *p = v;
  }
  static Type
  Set(TNumber v)
  {
    return v;
  }
  static std::uint32_t
  GetBits(bool lane)
  {
    return lane ? 1 : 0;
  }
  static Type
  SquareRoot(Type v)
  {
    return std::sqrt(v);
  }
};

/** Returns a bit for each flag that is -1; the other flags are 0. */
inline std::uint32_t
FindSet(const std::int16_t (&flags)[CellColumns])
{
  std::uint32_t bits = 0;
  for (std::ptrdiff_t n = 0; n < CellColumns; ++n)
  {
    bits |= flags[n] != 0 ? std::uint32_t{ 1 } << n : 0;
  }
  return bits;
}

/** Returns the place of the lowest bit of \a v. */
inline int
FindLowest(std::uint32_t v)
{
  int place = 0;
  for (; (v & 1) == 0; v >>= 1)
  {
    ++place;
  }
  return place;
}

inline void
CopyBytes(void * to, const void * from, std::size_t bytes)
{
  std::memcpy(to, from, bytes);
}

inline void
PrefetchVoxel(const void *)
{}

#include "Exact.h"

#include "RowProjection.h"

/** Returns the weighted mean of VCount values, rounded half upward to the pixel type. A mean of zero is +0. The weights
 * sum to \a sum <= 2^15. */
template <typename TPixel, std::size_t VCount>
TPixel
WeightedMean(const TPixel (&values)[VCount], const std::int32_t (&weights)[VCount], std::int32_t sum)
{
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    const auto getMean = [&](double scale) {
      double total = 0.0;
      for (std::size_t n = 0; n < VCount; ++n)
      {
        total += weights[n] == 0 ? 0.0 : weights[n] * (scale * static_cast<double>(values[n]));
      }
      return total / sum / scale;
    };
    double mean = getMean(1.0);
    if (std::is_same_v<TPixel, double> && !std::isfinite(mean))
    {
      mean = getMean(0x1p-16);
    }
    const auto weighted = [&](TPixel limit, auto better) {
      for (std::size_t n = 0; n < VCount; ++n)
      {
        limit = weights[n] != 0 && better(values[n], limit) ? values[n] : limit;
      }
      return limit;
    };
    const TPixel lowest = weighted(std::numeric_limits<TPixel>::infinity(), std::less<>());
    const TPixel highest = weighted(-std::numeric_limits<TPixel>::infinity(), std::greater<>());
    // std::clamp needs lowest <= highest, which is false if no value is a number
    return std::min(std::max(static_cast<TPixel>(mean), lowest), highest) + TPixel{ 0 };
  }
  else
  {
    // pixels of 64 bits are split into quotient * sum + remainder, so that no term overflows
    TPixel       whole = 0;
    std::int64_t twice = sum;
    for (std::size_t n = 0; n < VCount; ++n)
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

/** The four intermediate pixels around the place of an output pixel. A pixel without a value has weight 0. */
template <typename TPixel>
struct WarpCell
{
  WarpCell(const IntermediateImage<TPixel> & image, double column, double row)
  {
    if (!(column > -1.0 && column < static_cast<double>(image.columns) && row > -1.0 &&
          row < static_cast<double>(image.rows)))
    {
      return;
    }
    const auto place = [&image](double position) {
      const SamplingPosition quantized = QuantizePosition(position);
      return image.isNearest ? SamplingPosition{ quantized.whole + (quantized.fraction >= One / 2), 0 } : quantized;
    };
    const SamplingPosition p = place(column);
    const SamplingPosition q = place(row);
    const BilinearWeights  cell(p.fraction, q.fraction);
    const std::int32_t     corners[4] = { cell.bb, cell.ba, cell.ab, cell.aa };
    for (int corner = 0; corner < 4; ++corner)
    {
      const std::ptrdiff_t i = p.whole + (corner & 1);
      const std::ptrdiff_t j = q.whole + (corner >> 1);
      if (corners[corner] != 0 && j >= 0 && j < image.rows && i >= image.reached[j].begin && i < image.reached[j].end)
      {
        const std::ptrdiff_t pixel = j * image.rowStride + i;
        const bool           hasValue = image.ranks                        ? image.ranks[pixel] > 0
                                        : std::is_floating_point_v<TPixel> ? image.pixels[pixel] != image.none
                                                                           : true;
        weights[corner] = hasValue ? corners[corner] : 0;
        places[corner] = pixel;
        sum += weights[corner];
      }
    }
  }

  std::int32_t   weights[4]{};
  std::ptrdiff_t places[4]{};
  std::int32_t   sum{ 0 };
};

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
  for (std::ptrdiff_t x = columnBegin; x < columnEnd; ++x)
  {
    const auto             outputColumn = static_cast<double>(x);
    const WarpCell<TPixel> cell(intermediate,
                                (map.xx * outputColumn + map.xy * outputRow) + map.x0,
                                (map.yx * outputColumn + map.yy * outputRow) + map.y0);
    output[x] = background;
    if (cell.sum > 0)
    {
      TPixel values[4]{};
      for (int corner = 0; corner < 4; ++corner)
      {
        values[corner] = cell.weights[corner] != 0 ? intermediate.pixels[cell.places[corner]] : TPixel{};
      }
      output[x] = WeightedMean(values, cell.weights, cell.sum);
    }
  }
}

template <typename TPixel>
void
TransposeSlice(const TPixel * input, std::ptrdiff_t columns, std::ptrdiff_t rows, TPixel * output, bool)
{
  // the rows of a square have the same place in a cache if their distance is a power of two
  constexpr std::ptrdiff_t square = 8;
  for (std::ptrdiff_t firstRow = 0; firstRow < rows; firstRow += square)
  {
    for (std::ptrdiff_t firstColumn = 0; firstColumn < columns; firstColumn += square)
    {
      for (std::ptrdiff_t i = firstColumn; i < std::min(firstColumn + square, columns); ++i)
      {
        for (std::ptrdiff_t j = firstRow; j < std::min(firstRow + square, rows); ++j)
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
  static constexpr Kernels<TPixel> kernels{ "portable",
                                            ProjectBlockByRows<TPixel>,
                                            ProjectBlockByRows<TPixel>,
                                            IsAnyBelow<TPixel>,
                                            FindBlockExtremaByRows<TPixel>,
                                            WarpRow<TPixel>,
                                            TransposeSlice<TPixel>,
                                            EvaluateSegments<TPixel>,
                                            SearchLayer<TPixel> };
  return kernels;
}

template <typename TPixel>
TPixel
SampleCounted(const TPixel * a,
              const TPixel * b,
              std::ptrdiff_t column,
              std::ptrdiff_t before,
              std::int32_t   x,
              std::int32_t   y,
              unsigned int   counted)
{
  const BilinearWeights cell(x, y);
  const TPixel          values[4] = { b[column], b[before], a[column], a[before] };
  std::int32_t          weights[4] = { cell.bb, cell.ba, cell.ab, cell.aa };
  std::int32_t          sum = 0;
  for (int corner = 0; corner < 4; ++corner)
  {
    weights[corner] = (counted >> corner & 1U) != 0 ? weights[corner] : 0;
    sum += weights[corner];
  }
  // floats use all four voxels, also if a weight is rounded to zero
  const unsigned int used =
    0b0001U | (x != 0 ? 0b0010U : 0U) | (y != 0 ? 0b0100U : 0U) | (x != 0 && y != 0 ? 0b1000U : 0U);
  return (counted & used) == used
           ? CallWithSampler<TPixel>(x, y, [&](const auto & sample) { return sample(a, b, before, column); })
           : WeightedMean(values, weights, sum);
}

/** Returns the rank of the intermediate pixel with the largest weight, or 0 if the place has no value. */
template <typename TPixel>
std::int32_t
FindRank(const IntermediateImage<TPixel> & image, double column, double row)
{
  const auto isWithin = [](double position, std::ptrdiff_t length) {
    return position >= 0.0 && position < static_cast<double>(length - 1);
  };
  if (isWithin(column, image.columns) && isWithin(row, image.rows))
  {
    constexpr std::int64_t half = One / 2;
    const auto             p = static_cast<std::int64_t>(column * One);
    const auto             q = static_cast<std::int64_t>(row * One);
    const std::int64_t     i = (p + half) >> FractionBits;
    const std::int64_t     j = (q + half) >> FractionBits;
    // rounding moves weights by at most two units: further from the middle, the nearest pixel has the largest weight
    const auto isClear = [](std::int64_t position) { return std::abs((position & (One - 1)) - half) > 2; };
    if (isClear(p) && isClear(q) && i >= image.reached[j].begin && i < image.reached[j].end &&
        image.ranks[j * image.rowStride + i] > 0)
    {
      return image.ranks[j * image.rowStride + i];
    }
  }
  const WarpCell<TPixel> cell(image, column, row);
  const auto             largest = std::max_element(cell.weights, cell.weights + 4) - cell.weights;
  return cell.sum > 0 ? image.ranks[cell.places[largest]] : 0;
}

template <typename TPixel>
void
FindDepths(const IntermediateImage<TPixel> & intermediate,
           const AffineMap2D &               outputToIntermediate,
           unsigned int                      oversampling,
           const ShearedFunction &           depth,
           std::ptrdiff_t                    row,
           std::ptrdiff_t                    columns,
           float *                           depths)
{
  const AffineMap2D & map = outputToIntermediate;
  const auto          y = static_cast<double>(row);
  const auto          toSheared = [=](double position) { return (position + 1.0) / oversampling - 1.0; };
  for (std::ptrdiff_t n = 0; n < columns; ++n)
  {
    const auto         x = static_cast<double>(n);
    const double       p = (map.xx * x + map.xy * y) + map.x0;
    const double       q = (map.yx * x + map.yy * y) + map.y0;
    const std::int32_t rank = FindRank(intermediate, p, q);
    const std::int32_t slice = intermediate.ranking.GetSlice(rank);
    depths[n] = rank > 0 ? static_cast<float>(depth(toSheared(p), toSheared(q), slice)) + 0.0f
                         : std::numeric_limits<float>::quiet_NaN();
  }
}

#define INSTANTIATE(TPixel)                                                        \
  template const Kernels<TPixel> & GetPortableKernels();                           \
  template TPixel                  SampleCounted(std::add_pointer_t<const TPixel>, \
                                                 std::add_pointer_t<const TPixel>, \
                                                 std::ptrdiff_t,                   \
                                                 std::ptrdiff_t,                   \
                                                 std::int32_t,                     \
                                                 std::int32_t,                     \
                                                 unsigned int);                    \
  template void                    FindDepths(const IntermediateImage<TPixel> &,   \
                                              const AffineMap2D &,                 \
                                              unsigned int,                        \
                                              const ShearedFunction &,             \
                                              std::ptrdiff_t,                      \
                                              std::ptrdiff_t,                      \
                                              float *);
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE

} // namespace itk::ShearWarp
