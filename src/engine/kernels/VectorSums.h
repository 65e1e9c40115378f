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
#ifndef itkShearWarpVectorSums_h
#define itkShearWarpVectorSums_h

/* From slices to tiles of sums. A pixel takes each sample once. Vector.h includes this header. */

/** Takes back the count of a sample of pixel \a column of row \a r of a tile. */
template <typename TPixel>
void
Uncount(const TileRow<TPixel> & row, std::ptrdiff_t r, std::ptrdiff_t column)
{
  std::uint32_t * const steps = row.countSteps + r * (row.pixelStride + 1) + column;
  steps[0] -= 1;
  steps[1] += 1;
}

/** Counts a sample of each pixel of a tile's row with a bit in \a lanes. */
template <typename TPixel>
void
CountLanes(const TileRow<TPixel> & row, std::ptrdiff_t r, std::ptrdiff_t column, std::uint32_t lanes)
{
  std::uint32_t * const steps = row.countSteps + r * (row.pixelStride + 1) + column;
  for (std::uint64_t rest = lanes; rest != 0;)
  {
    const int begin = __builtin_ctzll(rest);
    const int end = __builtin_ctzll(~(rest | ((std::uint64_t{ 1 } << begin) - 1)));
    CountSamples(steps, begin, end);
    rest &= ~std::uint64_t{ 0 } << end;
  }
}

/** Adds LaneCount samples, which are counted already, to the pixels from \a column on of row \a r of a tile. Unless
 * VAll, only samples with a bit in \a taken. */
template <bool VAll, typename TPixel, typename TVector>
SHEARWARP_INLINE inline void
AddLanes(const TileRow<TPixel> & row, std::ptrdiff_t r, std::ptrdiff_t column, TVector sample, std::uint32_t taken)
{
  SampleSum<TPixel> * const sums = row.sums + r * row.pixelStride + column;
  if constexpr (!VAll)
  {
    sample = Lanes::Select(TVector{}, sample, taken);
  }
  if constexpr (IsFloat<TPixel>)
  {
    const auto number = Lanes::Number(sample);
    for (auto rest = Lanes::GetSigns(Lanes::FindNotNumbers(sample)); rest != 0; rest &= rest - 1)
    {
      Uncount(row, r, column + __builtin_ctz(rest));
    }
    Lanes::AddFloats(sums, number);
  }
  else
  {
    const auto wide = Lanes::Widen<IsUnsignedShort<TPixel>>(sample);
    Lanes::StoreSums(sums, Lanes::AddSums(Lanes::LoadSums(sums), wide));
  }
}

/** Adds all samples of a slice to a tile of BlockLength rows. */
template <typename TSampler, typename TPixel>
SHEARWARP_INLINE inline void
AddSlice(const TileRow<TPixel> & row, std::ptrdiff_t column)
{
  const std::ptrdiff_t stride = row.rowStride;
  const TPixel * const voxels = row.voxels + (row.slices->offset + row.row * stride + column);
  TSampler             sampler(*row.slices, voxels, stride);
  SHEARWARP_UNROLL
  for (int r = 0; r < BlockLength; ++r)
  {
    AddLanes<true>(row, r, column, TSampler::Finish(sampler.Next(voxels + r * stride)), 0);
  }
}

/** Adds samples that count. */
template <typename TPixel>
__attribute__((noinline)) void
AddSamples(const TileRow<TPixel> & row,
           std::ptrdiff_t          column,
           const LanesOf<TPixel> (&samples)[BlockLength],
           const CountedSamples<TPixel> & counted)
{
  // stores of sums cannot change copies
  const int                       rows = row.rows;
  const bool                      hasMask = row.mask != nullptr;
  const FadingRow<TPixel> * const fades = row.fades;
  for (int r = 0; r < rows; ++r)
  {
    if (hasMask)
    {
      CountLanes(row, r, column, counted.counted[r]);
    }
    const auto faded = fades ? Fade<TPixel>(samples[r], fades[r], column) : samples[r];
    AddLanes<false>(row, r, column, faded, counted.whole[r]);
  }
  ForEachRimSample(row, column, counted, [&row](int r, std::ptrdiff_t p, TPixel sample) {
    if (IsNumber(sample))
    {
      AddToSum(sample, row.sums[r * row.pixelStride + p]);
    }
    else
    {
      Uncount(row, r, p);
    }
  });
}

/** Counts the samples of a row of tiles. */
template <typename TPixel>
void
CountTiles(const TileRow<TPixel> & row)
{
  for (int r = 0; r < row.rows; ++r)
  {
    std::uint32_t * const steps = row.countSteps + r * (row.pixelStride + 1);
    CountSamples(steps, row.spans ? row.spans[r].begin : row.begin, row.spans ? row.spans[r].end : row.end);
  }
}

/** Adds the samples of a slice to a row of tiles. */
template <typename TSampler, typename TPixel>
void
AddTiles(const TileRow<TPixel> & row)
{
  constexpr std::ptrdiff_t lanes = LaneCount<TPixel>;
  if (!row.mask)
  {
    CountTiles(row);
  }
  ForEachTile(row, [&row](std::ptrdiff_t first, std::ptrdiff_t column) SHEARWARP_INLINE {
    if (first != column || row.mask || row.fades || row.IsCut(column) || row.rows != BlockLength)
    {
      const ColumnSpan       span{ static_cast<std::int32_t>(Larger(first, row.begin)),
                             static_cast<std::int32_t>(Smaller(first + lanes, row.end)) };
      const bool             isWhole = row.active && row.active[first / TileColumns] == TileState::Whole;
      CountedSamples<TPixel> counted;
      if (counted.Count(row, column, GetLanes<TPixel>(span, column), row.mask && !isWhole))
      {
        LanesOf<TPixel> samples[BlockLength];
        SampleTile<TSampler>(row, *row.slices, column, samples);
        AddSamples(row, column, samples, counted);
      }
    }
    else
    {
      AddSlice<TSampler>(row, column);
    }
  });
}

/** \class SumTiles
 * Images collect sums of samples. */
struct SumTiles
{
  static constexpr bool MayRepeat = false;

  template <typename TSampler, typename TPixel>
  static void
  Project(const TileRow<TPixel> & row)
  {
    AddTiles<TSampler>(row);
  }

  template <typename TPixel>
  static void
  Take(const ShearedView<TPixel> & view, std::ptrdiff_t row, std::ptrdiff_t column, TPixel sample, SliceRank<TPixel>)
  {
    AddSample(sample, GetSums(view, row)[column], GetCountSteps(view, row) + column);
  }
};

#endif
