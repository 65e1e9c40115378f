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
#include "itkImportImageContainer.h"
#include "itkShearWarpKernels.h"

namespace itk
{
/** \class ShearWarpPreparedVolume
 * \brief An image as stacks of slices along each of its axes, rows contiguous in memory.
 *
 * Along y and z the slices are those of the image itself. Along x they come from one transposed copy, of the
 * image's size, which is made when it is first needed and kept until the image changes. (Fang et al. 2002
 * keep three permuted copies.)
 *
 * \ingroup ShearWarpMIP
 */
template <typename TPixel>
class ShearWarpPreparedVolume
{
public:
  using Self = ShearWarpPreparedVolume;
  using ImageType = Image<TPixel, 3>;
  using SliceStackType = ShearWarp::SliceStack<TPixel>;

  /** Whether GetSlices() would return without copying anything. */
  bool
  IsPrepared(const ImageType * image, unsigned int principalAxis) const
  {
    return principalAxis != 0 || this->HoldsCopyOf(image);
  }

  /** Slices of \a image along index axis \a principalAxis (0, 1, 2), with the image's other axes, in their order, as
   * columns and rows. They refer to the image's memory or to this object's.
   * \a parallelize(count, function) calls function(begin, end) for ranges that make up [0, count). If it
   * throws, nothing is kept. Throws MemoryAllocationError if there is no memory for the copy. */
  template <typename TParallelize>
  SliceStackType
  GetSlices(const ImageType * image, unsigned int principalAxis, const TParallelize & parallelize);

  /** Frees the copy, if there is one. */
  void
  Release()
  {
    m_Transposed = nullptr;
  }

  /** Bytes that the copy holds. */
  SizeValueType
  GetSizeInBytes() const
  {
    return m_Transposed ? m_Transposed->Size() * sizeof(TPixel) : 0;
  }

private:
  using ContainerType = ImportImageContainer<SizeValueType, TPixel>;

  bool
  HoldsCopyOf(const ImageType * image) const
  {
    return m_Transposed && m_Image == image && m_ImageMTime == image->GetMTime();
  }

  template <typename TParallelize>
  static typename ContainerType::Pointer
  Transpose(const ImageType * image, const TParallelize & parallelize);

  typename ContainerType::Pointer m_Transposed;
  const ImageType *               m_Image{ nullptr }; // together with m_ImageMTime an identity, not dereferenced
  ModifiedTimeType                m_ImageMTime{ 0 };
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpPreparedVolume.hxx"
#endif

#endif
