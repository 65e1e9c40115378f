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
/** An image that collects the maxima of sheared slices: where each slice lies in it, and the columns of each row that
 * some slice reaches. That of a part of a volume begins at column `begin.column` and row `begin.row` of the whole
 * volume's, and has the slices from `begin.slice` on. */
struct IntermediateGrid
{
  std::ptrdiff_t              columns, rows;
  std::vector<SlicePlacement> placements;
  std::vector<ColumnSpan>     reached;
  Corner                      begin{ 0, 0, 0 };
};

/** The places in \a grid of \a slices slices of a part of a volume whose voxel (0, 0, 0) is the volume's at \a corner.
 */
ShearWarpMIP_EXPORT std::vector<SlicePlacement>
                    PlacePart(const IntermediateGrid & grid, const Corner & corner, std::ptrdiff_t slices);

/** A view transform as numbers: (u, v, w) of view space is at axes (u, v, w) + offset in physical space. */
struct ViewSpace
{
  /** Throws ExceptionObject, with the value, if the transform is null, not linear, not finite or singular. */
  ShearWarpMIP_EXPORT explicit ViewSpace(const Transform<double, 3, 3> * transform);

  Matrix<double, 3, 3> axes;
  Vector<double, 3>    offset;
};

/** Views, made one by one: those of a long series would take much memory. */
struct ViewList
{
  SizeValueType                           count;
  std::function<ViewSpace(SizeValueType)> get;
};

/** A grid in the view plane. */
struct ViewGrid
{
  Vector<double, 2> size, spacing;
  Point<double, 2>  origin;
};

/** The grid of pictures of \a image in all of \a views: that what is to be fitted holds the image's voxels, with the
 * smallest of ShearWarpFactorization::ComputeProjectedSpacing(); the rest as \a given. */
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

/** The depths of \a image from \a slab.nearest to \a slab.farthest. A slab without thickness, or beside the image, has
 * a thousandth of the image's depth. */
ShearWarpMIP_EXPORT DepthRange
ClipDepths(const ViewSpace & view, const ImageBase<3> * image, const DepthRange & slab);

/** The least depth of the sphere about the image's center that holds all of its voxels: but for rounding errors the
 * same for all views that are turned about that center. */
ShearWarpMIP_EXPORT double
FindSphereDepth(const ViewSpace & view, const ImageBase<3> * image);

/** A picture in physical space: column, row and depth are at origin + steps (column, row, depth). */
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

/** A picture as a slice in physical space, in the middle of \a depths and as thick. */
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
 * The principal axis is the one along which a ray's index changes most (the later one where two are equal but for
 * rounding errors), so that |s_a| <= 1 and |s_b| <= 1 for anisotropic voxels and affine views too. The published
 * translations are twice too large for negative shears; here \f$ t_a = \max(0, -s_a (n_k - 1)) \f$ for n_k slices,
 * and t_b likewise, so that every slice lies at a non-negative offset.
 *
 * With an oversampling of N the intermediate image has N pixels per voxel along each axis: its pixel (x, y) lies where
 * the sheared voxels have column (x + 1) / N - 1 and row (y + 1) / N - 1. Its N x N phases, of which each takes every
 * N-th column and row, meet a slice like any intermediate image, with one set of weights.
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

  /** Factors the view of \a image, over its largest possible region, by \a viewTransform, which takes view space to
   * the image's physical space. \a output gives the grid in the view plane: size, spacing and origin.
   * \a oversampling is 1 or 2. Throws ExceptionObject as VerifyViewTransform() and VerifyOversampling() do, for an
   * intermediate image of 2^31 columns or rows, and for a null image, as all functions here do. */
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

  /** The same view, with the intermediate image of a part of the image alone: \a part, which lies within the image's
   * largest possible region. Throws ExceptionObject if it does not. */
  ShearWarpFactorization
  MakePart(const ImageRegion<3> & part) const;

  /** Size of the intermediate image, in pixels. */
  const Size<2> &
  GetIntermediateSize() const
  {
    return m_IntermediateRegion.GetSize();
  }

  /** Where the intermediate image lies in the whole image's: it begins at index (0, 0) but for a part. */
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

  /** M_shear: (i, j, k, 1) to sheared column, row, slice; without oversampling those of the intermediate image. */
  Matrix4Type
  GetShearMatrix() const;

  /** M_warp2D: sheared column, row, 1 to the view plane. */
  Matrix3Type
  GetWarpMatrix() const;

  /** Sheared column, row, slice, 1 to view space. */
  Matrix4Type
  GetShearedToViewMatrix() const;

  /** The function \a ofView[0] u + \a ofView[1] v + \a ofView[2] w + \a ofView[3] of view space as one of sheared
   * column, row and slice. */
  ShearWarp::ShearedFunction
  GetShearedFunction(const Vector4Type & ofView) const;

  /** A function of sheared column, row and slice as one of the columns and rows of element \a phase of GetPhases(). */
  ShearWarp::ShearedFunction
  GetFunctionOfPhase(ShearWarp::ShearedFunction function, std::size_t phase) const;

  /** The depth w, as a function of sheared column, row and slice. */
  ShearWarp::ShearedFunction
  GetDepthFunction() const;

  /** Column, row, 1 of the output grid to column, row, 1 of the whole image's intermediate image: the inverse of the
   * warp, after the grid's spacing and origin. */
  Matrix3Type
  GetOutputToIntermediateMatrix() const;

  /** The place of each slice among the sheared voxels; without oversampling in the intermediate image. */
  const std::vector<ShearWarp::SlicePlacement> &
  GetSlicePlacements() const
  {
    return m_Phases.back().placements;
  }

  /** The parts of the intermediate image, Oversampling x Oversampling: pixel (x, y) of element `row * Oversampling +
   * column` is its pixel (Oversampling x + column, Oversampling y + row). */
  const std::vector<ShearWarp::IntermediateGrid> &
  GetPhases() const
  {
    return m_Phases;
  }

  /** For each row of the intermediate image, the columns that some slice reaches. */
  const std::vector<ShearWarp::ColumnSpan> &
  GetReachedColumns() const
  {
    return m_ReachedColumns;
  }

  /** Whether every slice lies at the same place as with \a other, so that the maxima are the same: as they are for
   * views from opposite sides. */
  bool
  HasSameSlicePlacements(const ShearWarpFactorization & other) const;

  /** Throws ExceptionObject, with the value, if the transform is not linear, not finite or singular. */
  static void
  VerifyViewTransform(const TransformType * viewTransform);

  /** Throws ExceptionObject, with the value, if it is not 1 or 2. */
  static void
  VerifyOversampling(unsigned int oversampling);

  /** The linear part of a transform: its columns are the axes of view space, in physical space. */
  static Matrix3Type
  GetLinearPart(const TransformType * viewTransform);

  /** Corners of the bounding box, in view space, of the physical extent of \a image: its voxels, not only their
   * centers. */
  static void
  ComputeViewBounds(const TransformType *      viewTransform,
                    const InputImageBaseType * image,
                    Point3Type &               lower,
                    Point3Type &               upper);

  /** The smallest spacing of \a image, in units of the view plane's two axes. */
  static Vector2Type
  ComputeProjectedSpacing(const TransformType * viewTransform, const InputImageBaseType * image);

private:
  /** Makes the phases' grids for voxels \a part of the image, and the intermediate image that they join to. */
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
