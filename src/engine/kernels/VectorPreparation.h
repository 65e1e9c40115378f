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
#ifndef itkShearWarpVectorPreparation_h
#define itkShearWarpVectorPreparation_h

/* What is computed before a volume is projected: block extrema and transposed slices. Vector.h includes this header. */

/** Rows of voxels, in one or more slices. Strides are in voxels. */
template <typename TPixel>
struct RowsOfVoxels
{
  const TPixel * voxels;
  std::ptrdiff_t columns, rows, slices;
  std::ptrdiff_t rowStride, sliceStride;
};

/** Raises the maxima of columns, and lowers their minima if VHasMinima. Lowers the lanes of \a least. */
template <bool VHasMinima, typename TPixel, typename TVector>
SHEARWARP_INLINE inline void
FindColumnExtrema(const RowsOfVoxels<TPixel> & of, TPixel * maxima, TPixel * minima, TVector & least)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  const auto [voxels, columns, rows, slices, rowStride, sliceStride] = of;
  for (std::ptrdiff_t k = 0; k < slices; ++k)
  {
    for (std::ptrdiff_t j = 0; j < rows; ++j)
    {
      const TPixel * row = voxels + k * sliceStride + j * rowStride;
      for (std::ptrdiff_t first = 0; first < columns; first += lanes)
      {
        const std::ptrdiff_t i = Smaller(first, columns - lanes);
        const auto           values = Lanes::Load(row + i);
        Lanes::Store(maxima + i, Maximum<TPixel>(Lanes::Load(maxima + i), values));
        least = Minimum<TPixel>(least, values);
        if constexpr (VHasMinima)
        {
          Lanes::Store(minima + i, Minimum<TPixel>(Lanes::Load(minima + i), values));
        }
      }
    }
  }
}

/** Finds the extrema of blocks of columns. \a minima may be null. Raises \a highest to the maxima. */
template <typename TPixel>
SHEARWARP_INLINE inline void
JoinColumns(const TPixel * columnMaxima,
            const TPixel * columnMinima,
            std::ptrdiff_t columns,
            TPixel *       maxima,
            TPixel *       minima,
            TPixel &       highest)
{
  for (std::ptrdiff_t i = 0; i < columns; i += BlockLength)
  {
    TPixel maximum = columnMaxima[i];
    TPixel minimum = columnMinima[i];
    for (std::ptrdiff_t n = i + 1; n < Smaller(i + BlockLength, columns); ++n)
    {
      maximum = Larger(maximum, columnMaxima[n]);
      minimum = Smaller(minimum, columnMinima[n]);
    }
    maxima[i / BlockLength] = maximum;
    highest = Larger(highest, maximum);
    if (minima)
    {
      minima[i / BlockLength] = minimum;
    }
  }
}

/** See Kernels. */
template <typename TPixel>
void
FindBlockExtrema(const TPixel * voxels,
                 std::ptrdiff_t columns,
                 std::ptrdiff_t rows,
                 std::ptrdiff_t slices,
                 std::ptrdiff_t rowStride,
                 std::ptrdiff_t sliceStride,
                 TPixel *       maxima,
                 TPixel *       minima,
                 TPixel &       lowest,
                 TPixel &       highest)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  constexpr std::ptrdiff_t most = 4096;
  const auto               portable = GetPortableKernels<TPixel>().findBlockExtrema;
  for (std::ptrdiff_t begin = 0; begin < columns; begin += most)
  {
    const std::ptrdiff_t width = Smaller(most, columns - begin);
    TPixel * const       blockMaxima = maxima + begin / BlockLength;
    TPixel * const       blockMinima = minima ? minima + begin / BlockLength : nullptr;
    const TPixel * const first = voxels + begin;
    if (width < lanes)
    {
      portable(first, width, rows, slices, rowStride, sliceStride, blockMaxima, blockMinima, lowest, highest);
      continue;
    }
    TPixel columnMaxima[most];
    TPixel columnMinima[most];
    for (std::ptrdiff_t i = 0; i < width; ++i)
    {
      columnMaxima[i] = NoSample<TPixel, Extremum::Maximum>;
      columnMinima[i] = NoSample<TPixel, Extremum::Minimum>;
    }
    auto                       least = Lanes::Load(columnMinima);
    const RowsOfVoxels<TPixel> all{ first, width, rows, slices, rowStride, sliceStride };
    minima ? FindColumnExtrema<true>(all, columnMaxima, columnMinima, least)
           : FindColumnExtrema<false>(all, columnMaxima, columnMinima, least);
    JoinColumns(columnMaxima, columnMinima, width, blockMaxima, blockMinima, highest);
    Lanes::Store(columnMinima, least);
    for (std::ptrdiff_t i = 0; i < lanes; ++i)
    {
      lowest = Smaller(lowest, columnMinima[i]);
    }
  }
}

/** Interleaves the first half of the vectors with the second half. An element's place is the number of its vector,
 * followed by its position in the vector. Interleaving moves the highest bit of the place to the lowest one, so that
 * repeating it for every bit of the vector's number transposes. */
template <typename TPixel, int VCount>
SHEARWARP_INLINE inline void
InterleaveHalves(Lanes::Quad (&vectors)[VCount])
{
  Lanes::Quad interleaved[VCount];
  SHEARWARP_UNROLL
  for (int n = 0; n < VCount / 2; ++n)
  {
    interleaved[2 * n] = Lanes::InterleaveQuadLow(vectors[n], vectors[n + VCount / 2], TPixel{});
    interleaved[2 * n + 1] = Lanes::InterleaveQuadHigh(vectors[n], vectors[n + VCount / 2], TPixel{});
  }
  SHEARWARP_UNROLL
  for (int n = 0; n < VCount; ++n)
  {
    vectors[n] = interleaved[n];
  }
}

/** The side of the squares that are transposed together: a cache line. */
template <typename TPixel>
constexpr std::ptrdiff_t SquareLength = 64 / sizeof(TPixel);

/** Transposes a square whose rows fill 128-bit vectors. Strides are in pixels. */
template <typename TPixel>
SHEARWARP_INLINE inline void
TransposeVectors(const TPixel * input, std::ptrdiff_t inputStride, TPixel * output, std::ptrdiff_t outputStride)
{
  constexpr int count = 16 / sizeof(TPixel);
  Lanes::Quad   vectors[count];
  SHEARWARP_UNROLL
  for (int n = 0; n < count; ++n)
  {
    vectors[n] = Lanes::LoadQuad(input + n * inputStride);
  }
  InterleaveHalves<TPixel>(vectors);
  InterleaveHalves<TPixel>(vectors);
  if constexpr (count > 4)
  {
    InterleaveHalves<TPixel>(vectors);
  }
  if constexpr (count > 8)
  {
    InterleaveHalves<TPixel>(vectors);
  }
  SHEARWARP_UNROLL
  for (int n = 0; n < count; ++n)
  {
    Lanes::StoreQuad(output + n * outputStride, vectors[n]);
  }
}

/** Transposes SquareLength columns of SquareLength rows, and fetches as many lines from \a next on. Strides are in
 * pixels. */
template <typename TPixel>
SHEARWARP_INLINE inline void
TransposeSquare(const TPixel * input,
                std::ptrdiff_t inputStride,
                TPixel *       output,
                std::ptrdiff_t outputStride,
                const TPixel * next,
                bool           isStreamed)
{
  constexpr std::ptrdiff_t square = SquareLength<TPixel>;
  constexpr std::ptrdiff_t small = 16 / sizeof(TPixel);
  alignas(64) TPixel       lines[square][square];
  for (std::ptrdiff_t column = 0; column < square; column += small)
  {
    for (std::ptrdiff_t row = 0; row < square; row += small)
    {
      // all lines at once would wait for each other
      for (std::ptrdiff_t line = 0; line < small; line += square / small)
      {
        Lanes::PrefetchFar(reinterpret_cast<const char *>(next));
        next += square;
      }
      TransposeVectors(input + row * inputStride + column, inputStride, &lines[column][row], square);
    }
  }
  for (std::ptrdiff_t column = 0; column < square; ++column)
  {
    Lanes::StoreLine(output + column * outputStride, lines[column], isStreamed);
  }
}

/** See Kernels. */
template <typename TPixel>
void
TransposeSlice(const TPixel * input, std::ptrdiff_t columns, std::ptrdiff_t rows, TPixel * output, bool isStreamed)
{
  constexpr std::ptrdiff_t square = SquareLength<TPixel>;
  constexpr std::ptrdiff_t ahead = (1 << 15) / sizeof(TPixel);
  isStreamed = isStreamed && reinterpret_cast<std::uintptr_t>(output) % 64 == 0 && rows % square == 0;
  for (std::ptrdiff_t j = 0; j < rows; j += square)
  {
    for (std::ptrdiff_t i = 0; i < columns; i += square)
    {
      if (j + square > rows || i + square > columns)
      {
        for (std::ptrdiff_t column = i; column < Smaller(i + square, columns); ++column)
        {
          for (std::ptrdiff_t row = j; row < Smaller(j + square, rows); ++row)
          {
            output[column * rows + row] = input[row * columns + column];
          }
        }
        continue;
      }
      // the next lines in the order of memory
      const TPixel * const next = input + j * columns + i * square + ahead;
      TransposeSquare(input + j * columns + i, columns, output + i * rows + j, rows, next, isStreamed);
    }
  }
  Lanes::FinishLines();
}

#endif
