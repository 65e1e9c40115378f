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
#include "Projector.h"

#include "Values.h"
#include "kernels/PixelTypes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>

namespace itk::ShearWarp
{
template <typename TPixel>
IntermediateImage<TPixel>
Projector<TPixel>::Finish(std::size_t view, const RunTasks & run)
{
  const ProjectedView &      projected = m_Views[view].view;
  const std::size_t          firstImage = view * m_ImagesOfView;
  std::vector<ThreadImage> & merged = m_Workers.front().images;
  for (std::size_t n = firstImage; n < firstImage + m_ImagesOfView; ++n)
  {
    this->ExtendRows(n, merged[n], 0, m_TileRows * BlockLength);
  }
  if (m_HasSums)
  {
    m_Means.Reserve(m_TileRows * BlockLength * m_RowStride * sizeof(TPixel), "an intermediate image");
  }
  IntermediateImage<TPixel> image;
  image.pixels = (m_HasSums ? m_Means : merged[firstImage].pixels).template GetPointer<TPixel>();
  image.columns = projected.grid->columns;
  image.rows = projected.grid->rows;
  image.rowStride = m_RowStride;
  image.reached = projected.grid->reached.data();
  image.ranking = this->GetRanking(projected);
  image.none = this->GetStart(firstImage);
  if (m_MayHaveGaps)
  {
    m_Reached.resize(image.rows);
    m_Ranks.Reserve(image.rows * m_RowStride * sizeof(std::int32_t), "the ranks of an intermediate image");
    image.ranks = m_Ranks.template GetPointer<std::int32_t>();
    image.reached = m_Reached.data();
  }

  constexpr std::ptrdiff_t bandPixels = 1 << 17;
  const std::ptrdiff_t     bandRows = bandPixels / m_RowStride + 1;
  std::atomic<bool>        hasGaps{ false };
  run(static_cast<std::size_t>(CountBlocks(image.rows, bandRows)), 1, [&](std::size_t n, std::size_t, std::size_t) {
    const std::ptrdiff_t begin = static_cast<std::ptrdiff_t>(n) * bandRows;
    for (std::ptrdiff_t row = begin; row < std::min(begin + bandRows, image.rows); ++row)
    {
      this->MergeView(firstImage, row, image.ranks != nullptr);
      if (image.ranks)
      {
        const ReachedRow reached = FindReached(image.ranks + row * m_RowStride, image.columns);
        m_Reached[row] = reached.span;
        if (reached.hasGaps)
        {
          hasGaps = true;
        }
      }
    }
  });
  // sums that are merged do not count again
  for (std::size_t worker = 1; m_HasSums && worker < m_Workers.size(); ++worker)
  {
    m_Workers[worker].images[firstImage].rowEnd = m_Workers[worker].images[firstImage].rowBegin;
  }
  image.hasGaps = hasGaps;
  return image;
}

/** Merges a row of all threads' sums, and finds its means. Without a number as its mean, a pixel has rank 0, others
 * have 1. */
template <typename TPixel>
void
Projector<TPixel>::FindMeans(std::size_t n, std::ptrdiff_t row, bool hasRanks)
{
  const auto getRow = [&](const ThreadImage & image) {
    const auto [sums, countSteps] = this->GetSummed(image);
    return SummedImage<TPixel>{ sums + row * m_RowStride, countSteps + row * (m_RowStride + 1) };
  };
  const std::ptrdiff_t columns = this->GetGrid(n).columns;
  const auto [sums, countSteps] = getRow(m_Workers.front().images[n]);
  for (std::size_t worker = 1; worker < m_Workers.size(); ++worker)
  {
    const ThreadImage & image = m_Workers[worker].images[n];
    if (row >= image.rowBegin && row < image.rowEnd)
    {
      const auto [others, otherSteps] = getRow(image);
      for (std::ptrdiff_t p = 0; p < columns; ++p)
      {
        Merge(sums[p], others[p]);
        countSteps[p] += otherSteps[p];
      }
    }
  }
  TPixel * const       means = m_Means.template GetPointer<TPixel>() + row * m_RowStride;
  std::int32_t * const ranks = m_Ranks.template GetPointer<std::int32_t>() + (hasRanks ? row * m_RowStride : 0);
  std::uint32_t        count = 0;
  for (std::ptrdiff_t p = 0; p < columns; ++p)
  {
    count += countSteps[p];
    means[p] = count > 0 ? GetMean<TPixel>(sums[p], count) : TPixel{};
    if (hasRanks)
    {
      const bool isNumber = std::is_integral_v<TPixel> || !std::isnan(static_cast<double>(means[p]));
      ranks[p] = count > 0 && isNumber ? 1 : 0;
    }
  }
}

/** Merges a row of all threads' images of a view into the first thread's first image, or finds the row's means. */
template <typename TPixel>
void
Projector<TPixel>::MergeView(std::size_t firstImage, std::ptrdiff_t row, bool hasRanks)
{
  if (m_HasSums)
  {
    return this->FindMeans(firstImage, row, hasRanks);
  }
  MergedRow merged{ this->MergeRow(firstImage, row), nullptr, nullptr };
  if (m_ImagesOfView == 2)
  {
    merged.minima = this->MergeRow(firstImage + 1, row);
  }
  if (m_HasRegion)
  {
    merged.marks = this->MergeMarks(firstImage, row);
  }
  if (hasRanks)
  {
    this->SetRanks(firstImage, row, merged);
  }
  for (std::ptrdiff_t p = 0; merged.minima && p < m_RowStride; ++p)
  {
    const bool isMinimum = IsMagnitudeLarger(merged.minima[p], merged.pixels[p]);
    merged.pixels[p] = isMinimum ? merged.minima[p] : merged.pixels[p];
  }
}

/** Sets the ranks of a merged row: 0 for a pixel without a value, and 1 for other pixels if images have no ranks. */
template <typename TPixel>
void
Projector<TPixel>::SetRanks(std::size_t firstImage, std::ptrdiff_t row, const MergedRow & merged)
{
  const ThreadImage *  images = m_Workers.front().images.data() + firstImage;
  const ThreadImage *  last = images + (m_ImagesOfView - 1);
  const RankType *     ranks[] = { this->GetRanks(images[0], row), this->GetRanks(*last, row) };
  const std::ptrdiff_t ofRow = m_Parameters.isOrdered ? row * m_RowStride : 0;
  const std::int32_t * settled[] = { images[0].settledRanks.template GetPointer<std::int32_t>() + ofRow,
                                     last->settledRanks.template GetPointer<std::int32_t>() + ofRow };
  const TPixel         none[] = { this->GetStart(firstImage), this->GetStart(firstImage + m_ImagesOfView - 1) };
  std::int32_t * const result = m_Ranks.template GetPointer<std::int32_t>() + row * m_RowStride;
  for (std::ptrdiff_t p = 0; p < m_RowStride; ++p)
  {
    const bool isMinimum = merged.minima && IsMagnitudeLarger(merged.minima[p], merged.pixels[p]);
    const bool isEmpty = std::is_floating_point_v<TPixel> && merged.pixels[p] == none[0] &&
                         !(merged.minima && merged.minima[p] != none[1]);
    const RankType rank = m_Parameters.hasRanks ? ranks[isMinimum][p] : RankType{ 1 };
    const bool     hasValue = !isEmpty && (!merged.marks || merged.marks[p] != 0) && rank != NoRank<TPixel>;
    result[p] = !hasValue ? 0 : m_Parameters.isOrdered ? settled[isMinimum][p] : rank;
  }
}

/** Merges a row of all threads' marks into the first thread's marks, and returns these. */
template <typename TPixel>
const std::uint8_t *
Projector<TPixel>::MergeMarks(std::size_t n, std::ptrdiff_t row)
{
  std::uint8_t * const result =
    m_Workers.front().images[n].marks.template GetPointer<std::uint8_t>() + row * m_RowStride;
  for (std::size_t worker = 1; worker < m_Workers.size(); ++worker)
  {
    const ThreadImage & image = m_Workers[worker].images[n];
    if (row >= image.rowBegin && row < image.rowEnd)
    {
      const auto * marks = image.marks.template GetPointer<std::uint8_t>() + row * m_RowStride;
      std::transform(marks, marks + m_RowStride, result, result, std::bit_or<>());
    }
  }
  return result;
}

/** Merges a row of all threads' pixels, and their ranks, into the first thread's pixels, and returns these. */
template <typename TPixel>
TPixel *
Projector<TPixel>::MergeRow(std::size_t n, std::ptrdiff_t row)
{
  const bool           isMinimum = this->GetExtremum(n) == Extremum::Minimum;
  const std::ptrdiff_t columns = this->GetGrid(n).columns;
  ThreadImage &        first = m_Workers.front().images[n];
  TPixel * const       result = first.pixels.template GetPointer<TPixel>() + row * m_RowStride;
  RankType * const     resultRanks = this->GetRanks(first, row);
  for (std::size_t worker = 1; worker < m_Workers.size(); ++worker)
  {
    const ThreadImage & image = m_Workers[worker].images[n];
    if (row < image.rowBegin || row >= image.rowEnd)
    {
      continue;
    }
    const TPixel *   pixels = image.pixels.template GetPointer<TPixel>() + row * m_RowStride;
    const RankType * ranks = this->GetRanks(image, row);
    for (std::ptrdiff_t p = 0; ranks && p < columns; ++p)
    {
      const bool isBetter = isMinimum ? pixels[p] < result[p] : pixels[p] > result[p];
      const bool isNearer = pixels[p] == result[p] && ranks[p] < resultRanks[p];
      resultRanks[p] = isBetter || isNearer ? ranks[p] : resultRanks[p];
    }
    for (std::ptrdiff_t p = 0; p < columns; ++p)
    {
      result[p] = (isMinimum ? pixels[p] < result[p] : pixels[p] > result[p]) ? pixels[p] : result[p];
    }
  }
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    // a zero is +0, whichever zero was first
    for (std::ptrdiff_t p = 0; p < columns; ++p)
    {
      result[p] += TPixel{ 0 };
    }
  }
  return result;
}

#define INSTANTIATE(TPixel) template IntermediateImage<TPixel> Projector<TPixel>::Finish(std::size_t, const RunTasks &);
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk::ShearWarp
