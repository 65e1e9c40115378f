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
#ifndef itkShearWarpPreparedVolume_h
#define itkShearWarpPreparedVolume_h

#include "Buffer.h"
#include "itkShearWarpEngine.h"
#include "kernels/Kernels.h"

namespace itk::ShearWarp
{
/** \class PreparedVolume
 * \brief A volume as stacks of slices along each of its axes, rows contiguous in memory, and its block extrema.
 *
 * Along y and z, the slices are the voxels themselves. Along x, they come from one transposed copy of the volume. The
 * copy is made when it is first needed, and kept until the volume changes. (Fang et al. 2002 keep three permuted
 * copies.) Block extrema are of cubes, so all axes share them. They have 1/512 of the volume's size.
 *
 * The voxels can be a part of a volume: a box of a larger volume or, for streaming, some of its slices. Samples lie
 * between voxels, so parts must have one voxel in common along each axis but the principal one.
 *
 * \ingroup ShearWarpMIP
 */
template <typename TPixel>
class ShearWarpMIP_EXPORT PreparedVolume
{
public:
  /** With \a hasBlockMinima, block extrema have minima beside the maxima. */
  explicit PreparedVolume(bool hasBlockMinima = false)
    : m_HasBlockMinima(hasBlockMinima)
  {}

  /** Returns whether Prepare() would return at once. */
  bool
  IsPrepared(const Voxels<TPixel> & voxels, unsigned int principalAxis, bool hasBlockExtrema = true) const
  {
    return this->IsOf(voxels) && (!hasBlockExtrema || m_BlockExtrema.GetSizeInBytes() > 0) &&
           (principalAxis != 0 || m_Transposed.GetSizeInBytes() > 0);
  }

  /** Makes block extrema have minima from now on. */
  void
  KeepBlockMinima();

  /** Returns the axes along which \a voxels were projected, as bits 1, 2 and 4. */
  unsigned int
  GetProjectedAxes(const Voxels<TPixel> & voxels) const
  {
    return this->IsOf(voxels) ? m_ProjectedAxes : 0;
  }

  /** Frees what was made of other voxels than \a voxels, which are a part of \a whole, or all of it. */
  void
  SetVoxels(const Voxels<TPixel> & voxels, const VoxelBox & whole);

  /** Notes that the voxels were projected along \a principalAxis. */
  void
  AddProjectedAxis(unsigned int principalAxis)
  {
    m_ProjectedAxes |= 1U << principalAxis;
  }

  /** Makes what GetSlices() and GetBlockExtrema() need for \a principalAxis (0, 1, 2). Without \a hasBlockExtrema,
   * block extrema and the lowest and highest voxel are left out: for one view, they cost more than they save. If \a run
   * throws, nothing half made is kept. Throws OutOfMemory. */
  void
  Prepare(const Voxels<TPixel> &  voxels,
          const VoxelBox &        whole,
          unsigned int            principalAxis,
          bool                    hasBlockExtrema,
          const Kernels<TPixel> & kernels,
          const RunTasks &        run);

  /** Makes the same for some slices along z, counted from the first of \a whole. Rows along z begin with the slice
   * before, if the voxels have it. Nothing is kept for another view. */
  void
  PreparePiece(const Voxels<TPixel> &  voxels,
               const VoxelBox &        whole,
               const SliceRange &      slices,
               unsigned int            principalAxis,
               bool                    hasBlockExtrema,
               const Kernels<TPixel> & kernels,
               const RunTasks &        run);

  /** Returns the slices along \a principalAxis. Their columns and rows are the other axes, in this order. They refer to
   * the voxels or to this object's memory. */
  SliceStack<TPixel>
  GetSlices(unsigned int principalAxis) const;

  /** Returns the block extrema, without memory if they were not made. */
  BlockExtrema<TPixel>
  GetBlockExtrema(unsigned int principalAxis) const;

  /** Returns the column, row and slice of the whole volume where these slices begin. */
  Corner
  GetCorner(unsigned int principalAxis) const;

  /** Frees all memory. */
  void
  Release();

  /** Returns the bytes of the copy and of the block extrema. */
  std::size_t
  GetSizeInBytes() const
  {
    return m_Transposed.GetSizeInBytes() + m_BlockExtrema.GetSizeInBytes();
  }

private:
  bool
  IsOf(const Voxels<TPixel> & voxels) const;

  void
  SetPiece(const Voxels<TPixel> & voxels, const VoxelBox & whole, const SliceRange & slices);

  void
  SetEnds(const VoxelBox & whole);

  void
  FindBlockExtrema(const Kernels<TPixel> & kernels, const RunTasks & run);

  void
  Transpose(const Kernels<TPixel> & kernels, const RunTasks & run, Buffer memory);

  bool   m_HasBlockMinima;
  Buffer m_Transposed;
  Buffer m_BlockExtrema; // maxima, then minima
  TPixel m_Lowest{};
  TPixel m_Highest{};

  Voxels<TPixel> m_Voxels; // without owner if nothing is kept of them
  unsigned int   m_ProjectedAxes{ 0 };
  const TPixel * m_First{ nullptr }; // first voxel of the piece
  std::ptrdiff_t m_Begin[3]{ 0, 0, 0 };
  std::ptrdiff_t m_Size[3]{ 0, 0, 0 };
  Ends           m_Ends[3];
};
} // namespace itk::ShearWarp

#endif
