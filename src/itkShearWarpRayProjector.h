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
#ifndef itkShearWarpRayProjector_h
#define itkShearWarpRayProjector_h

#include "itkShearWarpFactorization.h"
#include "itkShearWarpPreparedVolume.h"

#include <limits>
#include <optional>
#include <vector>

namespace itk
{
/** \class ShearWarpRayProjector
 * \brief Projects a prepared volume to an intermediate image, following its rays from front to back.
 *
 * It is for what ShearWarpProjector does not know: the first local maximum, and the slices of more than it can rank.
 * Each thread takes a few rows of the intermediate image, and for them the slices one after the other from the viewer
 * on. Nothing is merged, and no part of the volume is skipped, but for what Parameters exclude.
 *
 * The memory is kept from one projection to the next.
 *
 * \ingroup ShearWarpMIP
 */
template <typename TPixel>
class ShearWarpMIP_EXPORT ShearWarpRayProjector
{
public:
  using MaskPixelType = unsigned char;
  using IntermediateImageType = ShearWarp::IntermediateImage<TPixel>;

  /** What rays do with their samples. */
  struct Parameters
  {
    /** Of the kernels that Start() gets. */
    const ShearWarp::RayKernels<TPixel> * mode;
    /** If given rays end behind their first local maximum that is not less. */
    std::optional<TPixel> localMaximumThreshold;
    /** Samples count in all of them. */
    std::vector<ShearWarp::Interval> intervals;
    /** How samples fade to the background, if they do. */
    std::optional<ShearWarp::Fading> fading;
    TPixel                           background{};
    /** Of the voxels that count in a mask; 0 for all but 0. */
    MaskPixelType maskLabel{ 0 };
  };

  /** Begins a projection by at most \a workers threads. \a factorization, \a kernels and what \a parameters refers to
   * must live until Finish(). */
  void
  Start(const ShearWarpFactorization &     factorization,
        const ShearWarp::Kernels<TPixel> & kernels,
        const Parameters &                 parameters,
        SizeValueType                      workers);

  /** Whether the first slice along the volume's z axis is met before the last one: the order of slabs. */
  bool
  IsFirstSlabFront() const;

  /** Projects what \a volume has prepared for the factorization's principal axis: all or, one after the other, slabs,
   * in the order that IsFirstSlabFront() tells. \a mask, of the same size, restricts it if that is not null.
   * Throws MemoryAllocationError. */
  void
  Project(const ShearWarpPreparedVolume<TPixel> &        volume,
          const ShearWarpPreparedVolume<MaskPixelType> * mask,
          const ShearWarp::Parallelize &                 parallelize);

  /** The intermediate image of all that was projected since Start(), with the slices of its pixels. It refers to this
   * object's memory and to the factorization's, and is valid until the next projection. Throws MemoryAllocationError.
   */
  IntermediateImageType
  Finish(const ShearWarp::Parallelize & parallelize);

  /** Frees all memory. */
  void
  Release()
  {
    *this = ShearWarpRayProjector();
  }

  SizeValueType
  GetSizeInBytes() const;

private:
  /** The rays of one phase: as many rows as its grid. */
  struct Rays
  {
    ShearWarpBuffer                              values, slices;
    ShearWarp::Region                            region;
    std::optional<ShearWarp::ViewFading<TPixel>> fading;
  };

  struct Worker
  {
    std::vector<TPixel>        samples;
    std::vector<MaskPixelType> counted;
  };

  /** Rows [begin, end) of one phase. */
  struct Band
  {
    std::size_t    phase;
    std::ptrdiff_t begin, end;
  };

  ShearWarp::RayRow<TPixel>
  GetRayRow(std::size_t phase, std::ptrdiff_t row) const;

  void
  ClearBand(const Band & band) const;

  void
  ProjectSlice(Worker & worker, const Band & band, std::ptrdiff_t slice) const;

  /** Projects row \a j of a slice, which reaches \a reached, to rays \a span of row \a pixelRow. */
  void
  ProjectRow(Worker &              worker,
             std::size_t           phase,
             std::ptrdiff_t        pixelRow,
             ShearWarp::ColumnSpan reached,
             ShearWarp::ColumnSpan span,
             std::ptrdiff_t        slice,
             std::ptrdiff_t        j) const;

  const ShearWarp::Kernels<TPixel> * m_Kernels{ nullptr };
  const ShearWarpFactorization *     m_Factorization{ nullptr };
  Parameters                         m_Parameters;
  ShearWarp::ShearedFunction         m_Depth{};
  std::vector<Rays>                  m_Rays; // of the factorization's phases
  std::vector<Band>                  m_Bands;
  std::ptrdiff_t                     m_FirstSlice{ 0 };
  std::vector<Worker>                m_Workers;
  std::ptrdiff_t                     m_RowStride{ 0 };
  bool                               m_IsCleared{ false };
  ShearWarpBuffer                    m_JoinedValues, m_JoinedSlices;
  std::vector<ShearWarp::ColumnSpan> m_Reached; // of the joined image's rows

  ShearWarp::SliceStack<TPixel>                       m_Slices{};
  ShearWarp::SliceStack<MaskPixelType>                m_Mask{};     // without voxels if there is none
  std::vector<std::vector<ShearWarp::SlicePlacement>> m_Placements; // of these slices, for each phase
};
} // namespace itk

#endif
