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
#ifndef PlainShearWarp_h
#define PlainShearWarp_h

#include "itkImage.h"
#include "itkShearWarpFactorization.h"

#include <vector>

namespace itk::ShearWarpBenchmark
{
/** The shear-warp of Fang et al. 2002 as one would write it first, from the factorization of a view: what the filter is
 * compared with, in speed and bit by bit. It shares no code with the filter's kernels but the slices' places and
 * the weights. The compiler is given the flags of a release build and may do what they allow.
 *
 * An image row is one of the intermediate image, of which a vector holds all rows, or of the output. Rows are
 * independent of each other: threads may share them.
 *
 * Voxels must be finite. Instantiated for `uint8 int16 uint16 float`. */
template <typename TPixel>
class PlainShearWarp
{
public:
  using ImageType = Image<TPixel, 3>;

  /** \a image must outlive this object. */
  explicit PlainShearWarp(const ImageType * image)
    : m_Image(image)
  {}

  /** Gets the slices along \a principalAxis, 0, 1 or 2, ready: copies the image, transposed, for axis 0. */
  void
  Prepare(unsigned int principalAxis);

  /** Figure 2 and equation 2 of the paper: slice by slice, each sample the sum of four voxels times the slice's four
   * weights, and the larger of it and what the pixel has already. Sums are kept in 32 bits. Nothing is skipped.
   * Writes rows [rowBegin, rowEnd) of \a intermediate, which has the factorization's intermediate size. */
  void
  ProjectRows(const ShearWarpFactorization & factorization,
              std::ptrdiff_t                 rowBegin,
              std::ptrdiff_t                 rowEnd,
              std::vector<TPixel> &          intermediate) const;

  /** The whole intermediate image, in one thread. */
  std::vector<TPixel>
  Project(const ShearWarpFactorization & factorization) const;

  /** Bilinear interpolation of the intermediate image at the pixels of the factorization's output grid, of which
   * \a columns is the number of columns. Pixels that no slice reached are left out, and the weights of the others
   * scaled to sum to one; where none is left the output is \a background. Writes rows [rowBegin, rowEnd) of \a output.
   */
  static void
  WarpRows(const ShearWarpFactorization & factorization,
           const std::vector<TPixel> &    intermediate,
           std::ptrdiff_t                 rowBegin,
           std::ptrdiff_t                 rowEnd,
           std::ptrdiff_t                 columns,
           TPixel                         background,
           std::vector<TPixel> &          output);

  /** Frees the copy, if there is one. */
  void
  Release()
  {
    m_Transposed = {};
  }

private:
  /** Voxels in the order of the factorization's i, j and k; those along i are contiguous. */
  struct Slices
  {
    const TPixel * voxels;
    std::ptrdiff_t columns, rows, slices;
    std::ptrdiff_t rowStride, sliceStride;
  };

  Slices
  GetSlices(unsigned int principalAxis) const;

  const ImageType *   m_Image;
  std::vector<TPixel> m_Transposed;
};
} // namespace itk::ShearWarpBenchmark

#endif
