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
#include "itkShearWarpRayProjector.h"

#include "itkShearWarpPixelTypes.h"

#include <algorithm>
#include <atomic>

namespace itk
{
template <typename TPixel>
void
ShearWarpRayProjector<TPixel>::Start(const ShearWarpFactorization &     factorization,
                                     const ShearWarp::Kernels<TPixel> & kernels,
                                     const Parameters &                 parameters,
                                     SizeValueType                      workers)
{
  m_Kernels = &kernels;
  m_Factorization = &factorization;
  m_Parameters = parameters;
  m_Workers.resize(workers);
  m_IsCleared = false;

  const std::vector<ShearWarp::IntermediateGrid> & phases = factorization.GetPhases();
  m_Depth = factorization.GetDepthFunction();
  m_Rays.resize(phases.size());
  m_Bands.clear();
  m_RowStride = 0;
  for (std::size_t n = 0; n < phases.size(); ++n)
  {
    m_RowStride = std::max(m_RowStride, ShearWarp::CountBlocks(phases[n].columns, ShearWarp::TileColumns));
    m_Rays[n].fading.reset();
    if (parameters.fading)
    {
      m_Rays[n].fading = { *parameters.fading, factorization.GetFunctionOfPhase(m_Depth, n), parameters.background };
    }
    m_Rays[n].region.intervals = parameters.intervals;
    for (ShearWarp::Interval & interval : m_Rays[n].region.intervals)
    {
      interval.function = factorization.GetFunctionOfPhase(interval.function, n);
    }
    constexpr std::ptrdiff_t bandRows = 2 * ShearWarp::BlockLength;
    for (std::ptrdiff_t row = 0; row < phases[n].rows; row += bandRows)
    {
      m_Bands.push_back({ n, row, std::min(row + bandRows, phases[n].rows) });
    }
  }
  // an odd number of tiles, so that rows do not compete for the same lines of the cache
  m_RowStride = (m_RowStride | 1) * ShearWarp::TileColumns;
  for (std::size_t n = 0; n < phases.size(); ++n)
  {
    m_Rays[n].values.Reserve(phases[n].rows * m_RowStride * sizeof(TPixel), "an intermediate image");
    m_Rays[n].slices.Reserve(phases[n].rows * m_RowStride * sizeof(std::int32_t), "the slices of rays");
  }
}

template <typename TPixel>
bool
ShearWarpRayProjector<TPixel>::IsFirstSlabFront() const
{
  const bool isFirstSliceFront = m_Depth.perSlice > 0;
  if (m_Factorization->GetPrincipalAxis() == 2)
  {
    return isFirstSliceFront;
  }
  // rows are along z, and a ray goes through them against the shear
  return isFirstSliceFront == (m_Factorization->GetShear()[1] < 0);
}

template <typename TPixel>
void
ShearWarpRayProjector<TPixel>::Project(const ShearWarpPreparedVolume<TPixel> &        volume,
                                       const ShearWarpPreparedVolume<MaskPixelType> * mask,
                                       const ShearWarp::Parallelize &                 parallelize)
{
  const unsigned int      axis = m_Factorization->GetPrincipalAxis();
  const ShearWarp::Corner corner = volume.GetCorner(axis);
  m_Slices = volume.GetSlices(axis);
  m_FirstSlice = corner.slice;
  for (Rays & rays : m_Rays)
  {
    rays.region.firstSlice = corner.slice;
    if (rays.fading)
    {
      rays.fading->SetStack(m_Slices.columns, corner.slice);
    }
  }
  m_Placements.clear();
  for (const ShearWarp::IntermediateGrid & phase : m_Factorization->GetPhases())
  {
    m_Placements.push_back(ShearWarp::PlacePart(phase, corner, m_Slices.slices));
  }
  m_Mask = mask ? mask->GetSlices(axis) : ShearWarp::SliceStack<MaskPixelType>{};
  for (Worker & worker : m_Workers)
  {
    worker.samples.resize(m_RowStride);
    worker.counted.resize(m_RowStride);
  }

  // a step takes milliseconds at most
  constexpr std::ptrdiff_t stepPixels = 1 << 20;
  const std::ptrdiff_t     stepSlices = stepPixels / (2 * ShearWarp::BlockLength * m_RowStride) + 1;
  const bool               isAscending = m_Depth.perSlice > 0;
  parallelize(static_cast<SizeValueType>(m_Bands.size()),
              static_cast<SizeValueType>(ShearWarp::CountBlocks(m_Slices.slices, stepSlices)),
              [&](SizeValueType n, SizeValueType step, SizeValueType worker) {
                const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(step) * stepSlices;
                if (!m_IsCleared && first == 0)
                {
                  this->ClearBand(m_Bands[n]);
                }
                for (std::ptrdiff_t k = first; k < std::min(first + stepSlices, m_Slices.slices); ++k)
                {
                  this->ProjectSlice(m_Workers[worker], m_Bands[n], isAscending ? k : m_Slices.slices - 1 - k);
                }
              });
  m_IsCleared = true;
}

template <typename TPixel>
ShearWarp::RayRow<TPixel>
ShearWarpRayProjector<TPixel>::GetRayRow(std::size_t phase, std::ptrdiff_t row) const
{
  return { m_Rays[phase].values.template GetPointer<TPixel>() + row * m_RowStride,
           m_Rays[phase].slices.template GetPointer<std::int32_t>() + row * m_RowStride };
}

template <typename TPixel>
void
ShearWarpRayProjector<TPixel>::ClearBand(const Band & band) const
{
  const ShearWarp::RayRow<TPixel> rays = this->GetRayRow(band.phase, band.begin);
  const std::ptrdiff_t            count = (band.end - band.begin) * m_RowStride;
  std::fill_n(rays.values, count, m_Parameters.mode->start);
  std::fill_n(rays.slices, count, ShearWarp::NoSlice);
}

template <typename TPixel>
void
ShearWarpRayProjector<TPixel>::ProjectSlice(Worker & worker, const Band & band, std::ptrdiff_t slice) const
{
  const ShearWarp::SlicePlacement & placement = m_Placements[band.phase][slice];
  // row j is between voxel rows j - 1 and j
  const ShearWarp::RowSpan    rows = ShearWarp::FindSamples(placement.row, m_Slices.rows, m_Slices.rowEnds);
  const ShearWarp::RowSpan    columns = ShearWarp::FindSamples(placement.column, m_Slices.columns, m_Slices.columnEnds);
  const ShearWarp::ColumnSpan reached{ placement.column.whole + static_cast<std::int32_t>(columns.begin),
                                       placement.column.whole + static_cast<std::int32_t>(columns.end) };
  for (std::ptrdiff_t row = std::max(band.begin, placement.row.whole + rows.begin);
       row < std::min(band.end, placement.row.whole + rows.end);
       ++row)
  {
    const ShearWarp::ColumnSpan span = m_Rays[band.phase].region.Clip(reached, row, slice);
    if (span.begin < span.end)
    {
      this->ProjectRow(worker, band.phase, row, reached, span, slice, row - placement.row.whole);
    }
  }
}

template <typename TPixel>
void
ShearWarpRayProjector<TPixel>::ProjectRow(Worker &              worker,
                                          std::size_t           phase,
                                          std::ptrdiff_t        pixelRow,
                                          ShearWarp::ColumnSpan reached,
                                          ShearWarp::ColumnSpan span,
                                          std::ptrdiff_t        slice,
                                          std::ptrdiff_t        j) const
{
  const ShearWarp::SlicePlacement & placement = m_Placements[phase][slice];
  const bool                        isEdge = j == 0 || j == m_Slices.rows;
  const std::ptrdiff_t              after = std::min(j, m_Slices.rows - 1);
  const std::ptrdiff_t              before = isEdge ? after : j - 1;
  const auto                        getRow = [slice](const auto & stack, std::ptrdiff_t row) {
    return stack.voxels + (slice * stack.sliceStride + row * stack.rowStride);
  };
  const ShearWarp::SliceRow<TPixel> row{ getRow(m_Slices, before),
                                         getRow(m_Slices, after),
                                         m_Slices.columns,
                                         placement.column,
                                         isEdge ? 0 : placement.row.fraction };
  TPixel * const                    samples = worker.samples.data();
  MaskPixelType * const             counted = worker.counted.data();
  if (m_Mask.voxels)
  {
    ShearWarp::SampleMaskedRow(
      *m_Kernels, row, getRow(m_Mask, before), getRow(m_Mask, after), m_Parameters.maskLabel, span, samples, counted);
  }
  else
  {
    m_Kernels->sampleRow(row, span, samples);
  }
  if (const auto & fading = m_Rays[phase].fading)
  {
    // of all columns, so that what a box leaves out changes no bit of the others
    m_Kernels->fadeRow(fading->GetRow(pixelRow, slice, reached), span, samples);
  }

  const ShearWarp::RayRow<TPixel> rays = this->GetRayRow(phase, pixelRow);
  const auto                      take = [&](ShearWarp::ColumnSpan columns) {
    const auto index = static_cast<std::int32_t>(m_FirstSlice + slice);
    if (m_Parameters.localMaximumThreshold)
    {
      m_Parameters.mode->takeUntilLocalMaximum(samples, columns, index, *m_Parameters.localMaximumThreshold, rays);
    }
    else
    {
      m_Parameters.mode->take(samples, columns, index, rays);
    }
  };
  if (!m_Mask.voxels)
  {
    take(span);
    return;
  }
  // runs of samples that count
  for (std::int32_t begin = ShearWarp::FindMark(counted, span, 1); begin != span.end;)
  {
    const std::int32_t end = ShearWarp::FindMark(counted, { begin, span.end }, 0);
    take({ begin, end });
    begin = ShearWarp::FindMark(counted, { end, span.end }, 1);
  }
}

template <typename TPixel>
auto
ShearWarpRayProjector<TPixel>::Finish(const ShearWarp::Parallelize & parallelize) -> IntermediateImageType
{
  const auto           oversampling = static_cast<std::ptrdiff_t>(m_Factorization->GetOversampling());
  const std::ptrdiff_t rowStride = oversampling * m_RowStride;
  const auto           columns = static_cast<std::ptrdiff_t>(m_Factorization->GetIntermediateSize()[0]);
  const auto           rows = static_cast<std::ptrdiff_t>(m_Factorization->GetIntermediateSize()[1]);
  if (oversampling > 1)
  {
    m_JoinedValues.Reserve(rows * rowStride * sizeof(TPixel), "the joined intermediate image");
    m_JoinedSlices.Reserve(rows * rowStride * sizeof(std::int32_t), "the slices of the joined intermediate image");
  }
  const ShearWarpBuffer &         values = oversampling > 1 ? m_JoinedValues : m_Rays.front().values;
  const ShearWarpBuffer &         slices = oversampling > 1 ? m_JoinedSlices : m_Rays.front().slices;
  const ShearWarp::RayRow<TPixel> joined{ values.template GetPointer<TPixel>(),
                                          slices.template GetPointer<std::int32_t>() };
  m_Reached.resize(rows);
  std::atomic<bool>        hasGaps{ false };
  constexpr std::ptrdiff_t bandRows = 2 * ShearWarp::BlockLength;
  const auto               joinBand = [&](SizeValueType n, SizeValueType, SizeValueType) {
    const std::ptrdiff_t begin = static_cast<std::ptrdiff_t>(n) * bandRows;
    for (std::ptrdiff_t row = begin; row < std::min(begin + bandRows, rows); ++row)
    {
      for (std::ptrdiff_t column = 0; column < oversampling; ++column)
      {
        const auto           rays = this->GetRayRow(row % oversampling * oversampling + column, row / oversampling);
        const std::ptrdiff_t first = row * rowStride + column;
        for (std::ptrdiff_t p = 0; p < m_RowStride; ++p)
        {
          // zero has no sign
          joined.values[first + oversampling * p] = static_cast<TPixel>(rays.values[p] + TPixel{ 0 });
          joined.slices[first + oversampling * p] =
            rays.slices[p] < ShearWarp::EndedRay ? rays.slices[p] : rays.slices[p] - ShearWarp::EndedRay;
        }
      }
      const ShearWarp::ReachedRow reached = ShearWarp::FindReached(joined.slices + row * rowStride, columns);
      m_Reached[row] = reached.span;
      if (reached.hasGaps)
      {
        hasGaps = true;
      }
    }
  };
  parallelize(static_cast<SizeValueType>(ShearWarp::CountBlocks(rows, bandRows)), 1, joinBand);
  return { joined.values, columns, rows, rowStride, m_Reached.data(), joined.slices, hasGaps };
}

template <typename TPixel>
SizeValueType
ShearWarpRayProjector<TPixel>::GetSizeInBytes() const
{
  using ShearWarp::CountBytes;
  SizeValueType bytes = m_JoinedValues.GetSizeInBytes() + m_JoinedSlices.GetSizeInBytes() + CountBytes(m_Bands) +
                        CountBytes(m_Rays) + CountBytes(m_Reached) + CountBytes(m_Workers);
  for (const Rays & rays : m_Rays)
  {
    bytes += rays.values.GetSizeInBytes() + rays.slices.GetSizeInBytes() + CountBytes(rays.region.intervals);
    bytes += rays.fading ? CountBytes(rays.fading->factors) : 0;
  }
  for (const Worker & worker : m_Workers)
  {
    bytes += CountBytes(worker.samples) + CountBytes(worker.counted);
  }
  for (const auto & placements : m_Placements)
  {
    bytes += CountBytes(placements);
  }
  return bytes;
}

#define INSTANTIATE(TPixel) template class ShearWarpRayProjector<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk
