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

/* What is computed of a volume before views: block extrema and transposed slices. Vector.h includes this header. */

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
  constexpr std::ptrdiff_t strip = 4096;
  for (std::ptrdiff_t begin = 0; begin < columns; begin += strip)
  {
    const std::ptrdiff_t width = Smaller(strip, columns - begin);
    if (width < lanes)
    {
      GetPortableKernels<TPixel>().findBlockExtrema(voxels + begin,
                                                    width,
                                                    rows,
                                                    slices,
                                                    rowStride,
                                                    sliceStride,
                                                    maxima + begin / BlockLength,
                                                    minima ? minima + begin / BlockLength : nullptr,
                                                    lowest,
                                                    highest);
      continue;
    }
    TPixel columnMaxima[strip];
    TPixel columnMinima[strip];
    for (std::ptrdiff_t i = 0; i < width; ++i)
    {
      columnMaxima[i] = NoSample<TPixel, Extremum::Maximum>;
      columnMinima[i] = NoSample<TPixel, Extremum::Minimum>;
    }
    auto least = Lanes::Load(columnMinima);
    for (std::ptrdiff_t k = 0; k < slices; ++k)
    {
      for (std::ptrdiff_t j = 0; j < rows; ++j)
      {
        const TPixel * row = voxels + k * sliceStride + j * rowStride + begin;
        for (std::ptrdiff_t first = 0; first < width; first += lanes)
        {
          const std::ptrdiff_t i = Smaller(first, width - lanes);
          const auto           values = Lanes::Load(row + i);
          Lanes::Store(columnMaxima + i, Maximum<TPixel>(Lanes::Load(columnMaxima + i), values));
          least = Minimum<TPixel>(least, values);
          if (minima)
          {
            Lanes::Store(columnMinima + i, Minimum<TPixel>(Lanes::Load(columnMinima + i), values));
          }
        }
      }
    }
    for (std::ptrdiff_t i = 0; i < width; i += BlockLength)
    {
      TPixel maximum = columnMaxima[i];
      TPixel minimum = columnMinima[i];
      for (std::ptrdiff_t n = i + 1; n < Smaller(i + BlockLength, width); ++n)
      {
        maximum = Larger(maximum, columnMaxima[n]);
        minimum = Smaller(minimum, columnMinima[n]);
      }
      maxima[(begin + i) / BlockLength] = maximum;
      highest = Larger(highest, maximum);
      if (minima)
      {
        minima[(begin + i) / BlockLength] = minimum;
      }
    }
    Lanes::Store(columnMinima, least);
    for (std::ptrdiff_t i = 0; i < lanes; ++i)
    {
      lowest = Smaller(lowest, columnMinima[i]);
    }
  }
}

/** Interleaves the elements of the first half of the vectors with those of the second: that moves the highest bit of an
 * element's vector to the lowest of its position, so that doing it for every bit transposes. */
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

template <typename TPixel>
void
TransposeSlice(const TPixel * input, std::ptrdiff_t columns, std::ptrdiff_t rows, TPixel * output, bool isStreamed)
{
  // squares of a cache line's width, in smaller ones that fit in 128-bit vectors
  constexpr std::ptrdiff_t square = 64 / sizeof(TPixel);
  constexpr int            small = 16 / sizeof(TPixel);
  isStreamed = isStreamed && reinterpret_cast<std::uintptr_t>(output) % 64 == 0 && rows % square == 0;
  constexpr std::ptrdiff_t ahead = (1 << 15) / sizeof(TPixel);
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
      // as many lines as a square has, in the order of memory, not of squares
      for (std::ptrdiff_t line = 0; line < square; ++line)
      {
        Lanes::PrefetchFar(reinterpret_cast<const char *>(input + j * columns + (i + line) * square + ahead));
      }
      alignas(64) TPixel lines[square][square];
      for (std::ptrdiff_t column = 0; column < square; column += small)
      {
        for (std::ptrdiff_t row = 0; row < square; row += small)
        {
          Lanes::Quad vectors[small];
          SHEARWARP_UNROLL
          for (int n = 0; n < small; ++n)
          {
            vectors[n] = Lanes::LoadQuad(input + (j + row + n) * columns + i + column);
          }
          InterleaveHalves<TPixel>(vectors);
          InterleaveHalves<TPixel>(vectors);
          if constexpr (small > 4)
          {
            InterleaveHalves<TPixel>(vectors);
          }
          if constexpr (small > 8)
          {
            InterleaveHalves<TPixel>(vectors);
          }
          SHEARWARP_UNROLL
          for (int n = 0; n < small; ++n)
          {
            Lanes::StoreQuad(&lines[column + n][row], vectors[n]);
          }
        }
      }
      for (std::ptrdiff_t column = 0; column < square; ++column)
      {
        Lanes::StoreLine(output + (i + column) * rows + j, lines[column], isStreamed);
      }
    }
  }
  Lanes::FinishLines();
}

#endif
