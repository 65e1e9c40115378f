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

#include "itkImage.h"
#include "Buffer.h"
#include "itkShearWarpEngine.h"
#include "kernels/Kernels.h"

#include <algorithm>

namespace itk
{
namespace ShearWarp
{
/** How many blocks of \a blockLength hold \a length elements. */
constexpr std::ptrdiff_t
CountBlocks(std::ptrdiff_t length, std::ptrdiff_t blockLength = BlockLength)
{
  return (length + blockLength - 1) / blockLength;
}
} // namespace ShearWarp

/** \class ShearWarpPreparedVolume
 * \brief An image as stacks of slices along each of its axes, rows contiguous in memory, and its block maxima.
 *
 * Along y and z the slices are those of the image itself. Along x they come from one transposed copy, of the
 * image's size, which is made when it is first needed and kept until the image changes. (Fang et al. 2002
 * keep three permuted copies.) Block maxima, of 1/512 of the image's size, are those of cubes, so that all axes share
 * them.
 *
 * It can be of a part of an image: what is buffered of a larger one or, for streaming, slices of that.
 *
 * \ingroup ShearWarpMIP
 */
template <typename TPixel>
class ShearWarpMIP_EXPORT ShearWarpPreparedVolume
{
public:
  using Self = ShearWarpPreparedVolume;
  using ImageType = Image<TPixel, 3>;
  using SliceStackType = ShearWarp::SliceStack<TPixel>;
  using BlockExtremaType = ShearWarp::BlockExtrema<TPixel>;

  /** With \a hasBlockMinima block maxima come with the minima. */
  explicit ShearWarpPreparedVolume(bool hasBlockMinima = false)
    : m_HasBlockMinima(hasBlockMinima)
  {}

  /** Whether Prepare() would return at once. */
  bool
  IsPrepared(const ImageType * image, unsigned int principalAxis, bool hasBlockExtrema = true) const
  {
    return this->IsOf(image) && (!hasBlockExtrema || m_BlockExtrema.GetSizeInBytes() > 0) &&
           (principalAxis != 0 || m_Transposed.GetSizeInBytes() > 0);
  }

  /** From now on block maxima come with the minima. */
  void
  KeepBlockMinima()
  {
    if (!m_HasBlockMinima)
    {
      m_BlockExtrema.Release();
      m_HasBlockMinima = true;
    }
  }

  /** The index axes along which \a image, as it is now, was projected, as bits 1, 2 and 4. */
  unsigned int
  GetProjectedAxes(const ImageType * image) const
  {
    return this->IsOf(image) ? m_ProjectedAxes : 0;
  }

  /** Frees what was made for another image than \a image, which is a part of \a whole or all of it, or before that was
   * modified. */
  void
  SetImage(const ImageType * image, const ImageRegion<3> & whole);

  /** Tells that the image was projected along index axis \a principalAxis. */
  void
  AddProjectedAxis(unsigned int principalAxis)
  {
    m_ProjectedAxes |= 1U << principalAxis;
  }

  /** Makes what GetSlices() and GetBlockExtrema() need for what is buffered of \a image, which is a part of \a whole or
   * all of it, and index axis \a principalAxis (0, 1, 2); frees what was made for another image, or before this one was
   * modified. Without \a hasBlockExtrema block maxima, and the lowest and highest voxel, are left out: for one view
   * they cost more than they save. If \a parallelize throws, what it should have made is not kept. Throws
   * MemoryAllocationError if there is no memory.
   */
  void
  Prepare(const ImageType *                  image,
          const ImageRegion<3> &             whole,
          unsigned int                       principalAxis,
          bool                               hasBlockExtrema,
          const ShearWarp::Kernels<TPixel> & kernels,
          const ShearWarp::Parallelize &     parallelize);

  /** Makes the same for slices [begin, end) along z of what is buffered, counted from the first of \a whole. Rows along
   * z begin with the slice before, if that is buffered. Nothing of it is kept for another view. Samples are taken
   * between the voxels of a part: to have them all, parts must have one voxel in common along each axis but the
   * principal one. */
  void
  PreparePart(const ImageType *                  image,
              const ImageRegion<3> &             whole,
              std::ptrdiff_t                     begin,
              std::ptrdiff_t                     end,
              unsigned int                       principalAxis,
              bool                               hasBlockExtrema,
              const ShearWarp::Kernels<TPixel> & kernels,
              const ShearWarp::Parallelize &     parallelize);

  /** Slices of what is prepared along its index axis \a principalAxis, with its other axes, in their order, as
   * columns and rows. They refer to the image's memory or to this object's. */
  SliceStackType
  GetSlices(unsigned int principalAxis) const;

  /** Without memory if they were not made. */
  BlockExtremaType
  GetBlockExtrema(unsigned int principalAxis) const;

  /** The column, row and slice of the whole image where these slices begin. */
  ShearWarp::Corner
  GetCorner(unsigned int principalAxis) const;

  /** Frees all memory. */
  void
  Release();

  /** Bytes that the copy and the block maxima hold. */
  SizeValueType
  GetSizeInBytes() const
  {
    return m_Transposed.GetSizeInBytes() + m_BlockExtrema.GetSizeInBytes();
  }

private:
  bool
  IsOf(const ImageType * image) const
  {
    return m_Image == image && m_ImageMTime == image->GetMTime() && m_Voxels == image->GetBufferPointer();
  }

  void
  SetPart(const ImageType * image, const ImageRegion<3> & whole, std::ptrdiff_t begin, std::ptrdiff_t end);

  void
  FindBlockExtrema(const ShearWarp::Kernels<TPixel> & kernels, const ShearWarp::Parallelize & parallelize);

  void
  Transpose(const ShearWarp::Kernels<TPixel> & kernels,
            const ShearWarp::Parallelize &     parallelize,
            ShearWarpBuffer                    memory);

  bool            m_HasBlockMinima;
  ShearWarpBuffer m_Transposed;
  ShearWarpBuffer m_BlockExtrema; // and minima behind them
  TPixel          m_Lowest{};
  TPixel          m_Highest{};

  // an identity; the image itself is not dereferenced
  const ImageType * m_Image{ nullptr };
  ModifiedTimeType  m_ImageMTime{ 0 };
  const TPixel *    m_Voxels{ nullptr };
  unsigned int      m_ProjectedAxes{ 0 };
  std::ptrdiff_t    m_Begin[3]{ 0, 0, 0 }; // of the part in the image
  std::ptrdiff_t    m_Size[3]{ 0, 0, 0 };
  ShearWarp::Ends   m_Ends[3];
};
} // namespace itk

#endif
