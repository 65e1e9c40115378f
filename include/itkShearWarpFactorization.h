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
#include "itkShearWarpSampling.h"
#include "itkTransform.h"

#include <functional>
#include <vector>

namespace itk
{
namespace ShearWarp
{
/** An image that collects the maxima of sheared slices: the place of each slice, and the columns of each row that a
 * slice reaches. The image of a part of a volume begins at column `begin.column` and row `begin.row` of the whole
 * volume's image, and has the slices from `begin.slice` on. */
struct IntermediateGrid
{
  std::ptrdiff_t              columns, rows;
  std::vector<SlicePlacement> placements;
  std::vector<ColumnSpan>     reached;
  Corner                      begin{ 0, 0, 0 };
};

/** Returns the places in \a grid of \a slices slices of a part of a volume. The part's voxel (0, 0, 0) is the volume's
 * voxel at \a corner. */
ShearWarpMIP_EXPORT std::vector<SlicePlacement>
                    PlacePart(const IntermediateGrid & grid, const Corner & corner, std::ptrdiff_t slices);

/** A view transform as numbers: point (u, v, w) of view space is at axes (u, v, w) + offset in physical space. */
struct ViewSpace
{
  /** Throws ExceptionObject, with the value, if the transform is null, not linear, not finite or singular. */
  ShearWarpMIP_EXPORT explicit ViewSpace(const Transform<double, 3, 3> * transform);

  Matrix<double, 3, 3> axes;
  Vector<double, 3>    offset;
};

/** Views that are made one by one, because all views of a long series would take much memory. */
struct ViewList
{
  SizeValueType                           count;
  std::function<ViewSpace(SizeValueType)> get;
};

/** Throws ExceptionObject, with the value, if \a image is empty, its spacing is not positive and finite, or its origin
 * is not finite. */
ShearWarpMIP_EXPORT void
VerifyInputGeometry(const ImageBase<3> * image);

/** Throws ExceptionObject, with the value, if a grid in the view plane is not finite, or its spacing is not positive. A
 * fitted spacing is not verified. */
ShearWarpMIP_EXPORT void
VerifyOutputGrid(const Vector<double, 2> & spacing, const Point<double, 2> & origin, bool fitSpacing);

/** A grid in the view plane. */
struct ViewGrid
{
  Vector<double, 2> size, spacing;
  Point<double, 2>  origin;
};

/** Returns the grid of pictures of \a image in all of \a views. Fitted parameters are such that the grid holds the
 * image's voxels, with the smallest spacing of ShearWarpFactorization::ComputeProjectedSpacing(). Where, in each view,
 * one axis of the image lies along an axis of the grid, and its voxels are a whole number of such pixels long within a
 * thousandth, they are so exactly: the spacing is adapted. There the grid may leave out a hundredth of a pixel, and
 * elsewhere a ten-thousandth of a pixel. The other parameters are those of \a given. Throws ExceptionObject, with the
 * values, if the grid is not finite. */
ShearWarpMIP_EXPORT ViewGrid
FitGrid(const ViewList &     views,
        const ImageBase<3> * image,
        const ViewGrid &     given,
        bool                 fitSize,
        bool                 fitSpacing,
        bool                 fitOrigin);

/** Depths of a view. */
struct DepthRange
{
  double nearest, farthest;
};

/** Returns the depths of \a image from \a slab.nearest to \a slab.farthest. A slab without thickness, or beside the
 * image, gets a thousandth of the image's depth. Throws ExceptionObject, with the slab, if the slab's thickness is zero
 * or infinite in double precision. */
ShearWarpMIP_EXPORT DepthRange
ClipDepths(const ViewSpace & view, const ImageBase<3> * image, const DepthRange & slab);

/** Returns the least depth of the smallest sphere about the image's center that holds all voxels. Except for rounding
 * errors, it is the same for all views that turn about the center. */
ShearWarpMIP_EXPORT double
FindSphereDepth(const ViewSpace & view, const ImageBase<3> * image);

/** A picture in physical space: column, row and depth are at origin + steps (column, row, depth). Throws
 * ExceptionObject if the depth is not finite, as where no ray has a value. */
struct PictureSpace
{
  Point<double, 3>     origin;
  Matrix<double, 3, 3> steps;

  ShearWarpMIP_EXPORT Point<double, 3>
                      operator()(double column, double row, double depth) const;
};

ShearWarpMIP_EXPORT PictureSpace
MakePictureSpace(const ViewSpace & view, const ImageBase<2> * grid);

/** Where an image lies in physical space. */
struct SliceGeometry
{
  Vector<double, 3>    spacing;
  Point<double, 3>     origin;
  Matrix<double, 3, 3> direction;
};

/** Returns a picture as a slice in physical space, in the middle of \a depths and as thick as their range. */
ShearWarpMIP_EXPORT SliceGeometry
MakeSliceGeometry(const ViewSpace & view, const ImageBase<2> * grid, const DepthRange & depths);
} // namespace ShearWarp

/** \class ShearWarpFactorization
 * \brief Factors the view of a 3D image into a permutation of its axes, a shear and a 2D warp.
 *
 * With the index of a voxel (relative to the start of the image's region) permuted so that the principal
 * axis comes third, (i, j, k), the view of the image is
 * \f[ M_{view} P^{-1} = M_{warp} M_{shear} \f]
 * (Fang et al., Magn Reson Med 47:696-700, 2002, appendix). The shear moves slice k by whole and fractional
 * voxels, (i, j) to \f$ (i + s_a k + t_a, j + s_b k + t_b) \f$, onto the intermediate image; the warp takes pixels of
 * the intermediate image to the view plane. Here, as everywhere in this module, coordinates of the view plane are in
 * the units of the view transform's input (mm, for a rigid transform of an image in mm). With \f$ M_{view} P^{-1} =
 * [m_{ij}] \f$ the shear is
 * \f[ s_a = (m_{22} m_{13} - m_{12} m_{23}) / (m_{11} m_{22} - m_{21} m_{12}) \f]
 * \f[ s_b = (m_{11} m_{23} - m_{21} m_{13}) / (m_{11} m_{22} - m_{21} m_{12}) \f]
 *
 * The principal axis is the axis along which a ray's index changes most. If two axes are equal except for rounding
 * errors, it is the later one. So |s_a| <= 1 and |s_b| <= 1 for anisotropic voxels and affine views too. The published
 * translations are twice too large for negative shears. Here \f$ t_a = \max(0, -s_a (n_k - 1)) \f$ for n_k slices, and
 * t_b likewise, so that every slice lies at a non-negative offset.
 *
 * With an oversampling of N, the intermediate image has N pixels per voxel along each axis. Its pixel (x, y) lies at
 * column (x + 1) / N - 1 and row (y + 1) / N - 1 of the sheared voxels. It has N x N phases, each with every N-th
 * column and row. A phase meets a slice with one set of weights, like an intermediate image without oversampling.
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
  using Point2Type = Point<double, 2>;
  using Point3Type = Point<double, 3>;
  using Vector4Type = Vector<double, 4>;
  using Matrix3Type = Matrix<double, 3, 3>;
  using Matrix4Type = Matrix<double, 4, 4>;

  /** Factors the view of \a image, over its largest possible region, by \a viewTransform, which maps view space to the
   * image's physical space. \a output defines the grid in the view plane: size, spacing and origin. \a oversampling is
   * 1 or 2. Throws ExceptionObject for the cases of VerifyViewTransform() and VerifyOversampling(), and for an
   * intermediate image of 2^31 columns or rows. Like all functions here, it also throws ExceptionObject for a null
   * image. */
  ShearWarpFactorization(const ShearWarp::ViewSpace & view,
                         const InputImageBaseType *   image,
                         const OutputImageBaseType *  output,
                         unsigned int                 oversampling = 1);
  ShearWarpFactorization(const TransformType *       viewTransform,
                         const InputImageBaseType *  image,
                         const OutputImageBaseType * output,
                         unsigned int                oversampling = 1);

  /** Index axis of the image (0, 1, 2) along which its slices are taken. */
  unsigned int
  GetPrincipalAxis() const
  {
    return m_Permutation[2];
  }

  /** The image's axes in the order i, j, k. */
  const PermutationType &
  GetPermutation() const
  {
    return m_Permutation;
  }

  /** Pixels of the intermediate image per voxel, along each axis. */
  unsigned int
  GetOversampling() const
  {
    return m_Oversampling;
  }

  /** (s_a, s_b): voxels from one slice to the next. */
  const Vector2Type &
  GetShear() const
  {
    return m_Shear;
  }

  /** (t_a, t_b), in voxels. */
  const Vector2Type &
  GetTranslation() const
  {
    return m_Translation;
  }

  /** Returns the same view with the intermediate image of \a part only. Throws ExceptionObject if \a part is not within
   * the image's largest possible region. */
  ShearWarpFactorization
  MakePart(const ImageRegion<3> & part) const;

  /** Size of the intermediate image, in pixels. */
  const Size<2> &
  GetIntermediateSize() const
  {
    return m_IntermediateRegion.GetSize();
  }

  /** The region of the intermediate image within that of the whole image. It begins at index (0, 0), except for a part.
   */
  const ImageRegion<2> &
  GetIntermediateRegion() const
  {
    return m_IntermediateRegion;
  }

  /** M_view P^-1 = [m_ij]: (i, j, k, 1) to view space. */
  const Matrix4Type &
  GetViewMatrix() const
  {
    return m_ViewMatrix;
  }

  /** M_shear: (i, j, k, 1) to sheared column, row, slice. Without oversampling, these are column and row of the
   * intermediate image. */
  Matrix4Type
  GetShearMatrix() const;

  /** M_warp2D: sheared column, row, 1 to the view plane. */
  Matrix3Type
  GetWarpMatrix() const;

  /** Sheared column, row, slice, 1 to view space. */
  Matrix4Type
  GetShearedToViewMatrix() const;

  /** Returns the function \a ofView[0] u + \a ofView[1] v + \a ofView[2] w + \a ofView[3] of view space as a function
   * of sheared column, row and slice. */
  ShearWarp::ShearedFunction
  GetShearedFunction(const Vector4Type & ofView) const;

  /** Returns a function of sheared column, row and slice as a function of column, row and slice of element \a phase of
   * GetPhases(). */
  ShearWarp::ShearedFunction
  GetFunctionOfPhase(ShearWarp::ShearedFunction function, std::size_t phase) const;

  /** Returns the depth w as a function of sheared column, row and slice. */
  ShearWarp::ShearedFunction
  GetDepthFunction() const;

  /** Column, row, 1 of the output grid to column, row, 1 of the whole image's intermediate image. This applies the
   * grid's spacing and origin, and then the inverse of the warp. */
  Matrix3Type
  GetOutputToIntermediateMatrix() const;

  /** The place of each slice among the sheared voxels. Without oversampling, this is its place in the intermediate
   * image.
   */
  const std::vector<ShearWarp::SlicePlacement> &
  GetSlicePlacements() const
  {
    return m_Phases.back().placements;
  }

  /** The Oversampling x Oversampling phases of the intermediate image. Pixel (x, y) of element `row * Oversampling +
   * column` is the intermediate image's pixel (Oversampling x + column, Oversampling y + row). */
  const std::vector<ShearWarp::IntermediateGrid> &
  GetPhases() const
  {
    return m_Phases;
  }

  /** For each row of the intermediate image, the columns that a slice reaches. */
  const std::vector<ShearWarp::ColumnSpan> &
  GetReachedColumns() const
  {
    return m_ReachedColumns;
  }

  /** Returns whether every slice has the same place as with \a other, so that the maxima are the same. This is so for
   * views from opposite sides. */
  bool
  HasSameSlicePlacements(const ShearWarpFactorization & other) const;

  /** Throws ExceptionObject, with the value, if the transform is not linear, not finite or singular. */
  static void
  VerifyViewTransform(const TransformType * viewTransform);

  /** Throws ExceptionObject, with the value, if it is not 1 or 2. */
  static void
  VerifyOversampling(unsigned int oversampling);

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
  /** Makes the grids of the phases for the voxels \a part of the image, and the joined intermediate image. */
  void
  MakePhases(const ImageRegion<3> & part);

  void
  JoinPhases();

  PermutationType                          m_Permutation;
  unsigned int                             m_Oversampling;
  Vector2Type                              m_Shear;
  Vector2Type                              m_Translation;
  ImageRegion<3>                           m_ImageRegion;
  ImageRegion<2>                           m_IntermediateRegion;
  Matrix4Type                              m_ViewMatrix;
  Vector2Type                              m_OutputSpacing;
  Point2Type                               m_OutputOrigin;
  std::vector<ShearWarp::IntermediateGrid> m_Phases;
  std::vector<ShearWarp::ColumnSpan>       m_ReachedColumns;
};
} // namespace itk

#endif
