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
#ifndef itkShearWarpFactorization_h
#define itkShearWarpFactorization_h

#include "itkImageBase.h"
#include "itkMatrix.h"
#include "itkShearWarpGeometry.h"
#include "itkTransform.h"

#include <vector>

namespace itk
{
namespace ShearWarp
{
/** Returns a transform as a matrix and an offset. Throws ExceptionObject, with the value, if the transform is null, not
 * linear, not finite or singular. */
ShearWarpMIP_EXPORT AffineMap3D
MakeView(const Transform<double, 3, 3> * transform);

/** Returns where the voxels of an image's largest possible region are. Throws ExceptionObject, with the value, if the
 * image is null, a size does not fit into std::ptrdiff_t, or the origin is not finite. For other numbers, see
 * VerifyVolumeGrid(). */
ShearWarpMIP_EXPORT VolumeGrid
MakeVolumeGrid(const ImageBase<3> * image);

/** Returns where the pixels of an image's largest possible region are in the view plane. Ignores the region's index and
 * the image's direction. Throws ExceptionObject if the image is null. */
ShearWarpMIP_EXPORT PictureGrid
MakePictureGrid(const ImageBase<2> * image);

/** Calls a function and returns what the function returns. Throws InvalidParameter as ExceptionObject, OutOfMemory as
 * MemoryAllocationError, and other exceptions unchanged. */
template <typename TFunction>
decltype(auto)
CallEngine(TFunction && function)
{
  try
  {
    return function();
  }
  catch (const InvalidParameter & error)
  {
    itkGenericExceptionMacro(<< error.what());
  }
  catch (const OutOfMemory & error)
  {
    throw MemoryAllocationError(__FILE__, __LINE__, error.what(), ITK_LOCATION);
  }
}
} // namespace ShearWarp

/** \class ShearWarpFactorization
 * \brief Factors the view of a 3D image into a permutation of its axes, a shear and a 2D warp.
 *
 * The index of a voxel, counted from the start of the image's region, is permuted to (i, j, k), so that the principal
 * axis comes third. Then the view of the image is
 * \f[ M_{view} P^{-1} = M_{warp} M_{shear} \f]
 * (Fang et al., Magn Reson Med 47:696-700, 2002, appendix). The shear moves slice k by whole and fractional
 * voxels, (i, j) to \f$ (i + s_a k + t_a, j + s_b k + t_b) \f$, onto the intermediate image. The warp takes pixels of
 * the intermediate image to the view plane. Here, as everywhere in this module, coordinates of the view plane are in
 * the units of the view transform's input (mm, for a rigid transform of an image in mm). With \f$ M_{view} P^{-1} =
 * [m_{ij}] \f$ the shear is
 * \f[ s_a = (m_{22} m_{13} - m_{12} m_{23}) / (m_{11} m_{22} - m_{21} m_{12}) \f]
 * \f[ s_b = (m_{11} m_{23} - m_{21} m_{13}) / (m_{11} m_{22} - m_{21} m_{12}) \f]
 *
 * The principal axis is the axis along which a ray's index changes most. If two axes are equal except for rounding
 * errors, the later axis is principal. So |s_a| <= 1 and |s_b| <= 1 for anisotropic voxels and affine views too. The
 * published translations are twice too large for negative shears. Here \f$ t_a = \max(0, -s_a (n_k - 1)) \f$ for n_k
 * slices, and t_b likewise, so that every slice lies at a non-negative offset.
 *
 * This class converts between classes of ITK and the plain functions of itkShearWarpGeometry.h.
 *
 * \ingroup ShearWarpMIP
 */
class ShearWarpMIP_EXPORT ShearWarpFactorization
{
public:
  using TransformType = Transform<double, 3, 3>;
  using InputImageBaseType = ImageBase<3>;
  using OutputImageBaseType = ImageBase<2>;
  using PermutationType = FixedArray<unsigned int, 3>;
  using Vector2Type = Vector<double, 2>;
  using Point3Type = Point<double, 3>;
  using Matrix3Type = Matrix<double, 3, 3>;
  using Matrix4Type = Matrix<double, 4, 4>;

  /** Factors the view of \a image, over its largest possible region, by \a viewTransform, which maps view space to the
   * image's physical space. \a output defines the grid in the view plane: size, spacing and origin. Throws
   * ExceptionObject, with the value, in the cases of VerifyViewTransform(), if an image is null, if \a image is empty
   * or not finite, and if the intermediate image would have 2^31 columns or rows. */
  ShearWarpFactorization(const TransformType *       viewTransform,
                         const InputImageBaseType *  image,
                         const OutputImageBaseType * output);

  /** Index axis of the image (0, 1, 2) along which its slices are taken. */
  unsigned int
  GetPrincipalAxis() const;

  /** The image's axes in the order i, j, k. */
  PermutationType
  GetPermutation() const;

  /** (s_a, s_b): voxels from one slice to the next. */
  Vector2Type
  GetShear() const;

  /** (t_a, t_b), in voxels. */
  Vector2Type
  GetTranslation() const;

  /** Size of the intermediate image, in pixels. */
  Size<2>
  GetIntermediateSize() const;

  /** M_view P^-1 = [m_ij]: (i, j, k, 1) to view space. */
  Matrix4Type
  GetViewMatrix() const;

  /** M_shear: (i, j, k, 1) to column, row, slice of the sheared image. The intermediate image has
   * the same columns and rows. */
  Matrix4Type
  GetShearMatrix() const;

  /** M_warp2D: column, row, 1 of the intermediate image to the view plane. */
  Matrix3Type
  GetWarpMatrix() const;

  /** Sheared column, row, slice, 1 to view space. */
  Matrix4Type
  GetShearedToViewMatrix() const;

  /** Column, row, 1 of the output grid to column, row, 1 of the intermediate image. This matrix applies the grid's
   * spacing and origin, and then the inverse of the warp. Throws ExceptionObject, with the values, if the matrix is not
   * finite. */
  Matrix3Type
  GetOutputToIntermediateMatrix() const;

  /** The place of each slice in the intermediate image. */
  const std::vector<ShearWarp::SlicePlacement> &
  GetSlicePlacements() const;

  /** For each row of the intermediate image, the columns that a slice reaches. */
  const std::vector<ShearWarp::ColumnSpan> &
  GetReachedColumns() const;

  /** Throws ExceptionObject, with the value, if the transform is null, not linear, not finite or singular. */
  static void
  VerifyViewTransform(const TransformType * viewTransform);

  /** Returns the linear part of a transform. Its columns are the axes of view space, in physical space. */
  static Matrix3Type
  GetLinearPart(const TransformType * viewTransform);

  /** Returns the corners of the bounding box of \a image in view space. The box contains whole voxels, not only their
   * centers. */
  static void
  ComputeViewBounds(const TransformType *      viewTransform,
                    const InputImageBaseType * image,
                    Point3Type &               lower,
                    Point3Type &               upper);

  /** Returns the smallest spacing of \a image, in units of the view plane's two axes. */
  static Vector2Type
  ComputeProjectedSpacing(const TransformType * viewTransform, const InputImageBaseType * image);

private:
  ShearWarp::Factorization    m_Factorization;
  ShearWarp::PictureGrid      m_Output;
  ShearWarp::IntermediateGrid m_Intermediate;
};
} // namespace itk

#endif
