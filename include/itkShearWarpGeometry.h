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
#ifndef itkShearWarpGeometry_h
#define itkShearWarpGeometry_h

#include "itkShearWarpSampling.h"

#include <new>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

/** The geometry of views, in plain structures: 3 x 4 matrices of doubles, and sizes. No header of ITK is needed.
 *
 * These functions are compiled only in the library, so their bits do not depend on the program that includes this
 * header. */
namespace itk::ShearWarp
{
/** \class InvalidParameter
 * \brief A parameter without a meaning. The message has its name and its value.
 * \ingroup ShearWarpMIP
 */
class ShearWarpMIP_EXPORT InvalidParameter : public std::invalid_argument
{
public:
  using std::invalid_argument::invalid_argument;
};

/** \class OutOfMemory
 * \brief There is no memory. The message says how many bytes were wanted, and what for.
 * \ingroup ShearWarpMIP
 */
class ShearWarpMIP_EXPORT OutOfMemory : public std::bad_alloc
{
public:
  explicit OutOfMemory(const std::string & message)
    : m_Message(message)
  {}
  const char *
  what() const noexcept override
  {
    return m_Message.c_str();
  }

private:
  std::string m_Message;
};

#ifdef __cpp_exceptions
/** Throws \a error. */
template <typename TError>
[[noreturn]] void
Throw(TError && error)
{
  throw std::forward<TError>(error);
}

/** Throws InvalidParameter. */
inline void
RefuseParameter(const std::string & message)
{
  Throw(InvalidParameter(message));
}
#else
/** What is compiled without exceptions defines these two functions: Fail() must not return. RefuseParameter() can
 * return, because nothing but a result is wrong after it. */
[[noreturn]] void
Fail(const char * message);
void
RefuseParameter(const std::string & message);

template <typename TError>
[[noreturn]] void
Throw(TError && error)
{
  Fail(error.what());
}
#endif

/** An affine map of space, a 3 x 4 matrix: x to matrix x + offset. A view is such a map, from view space (u, v, w) to
 * physical space. */
struct AffineMap3D
{
  double matrix[3][3];
  double offset[3];
};

/** Where the voxels of a volume are. The index of the first voxel is (0, 0, 0). `spacing` has the lengths of the
 * columns of `indexToPhysical`. */
struct VolumeGrid
{
  std::ptrdiff_t size[3];
  double         spacing[3];
  AffineMap3D    indexToPhysical;
};

/** A box of voxels of a volume: indices from `begin` to before `begin` + `size`. */
struct VoxelBox
{
  std::ptrdiff_t begin[3];
  std::ptrdiff_t size[3];
};

/** Where the pixels of a picture are in the view plane, in units of view space. `origin` is the center of the first
 * pixel. Sizes are doubles because a fitted size may be any number. */
struct PictureGrid
{
  double size[2];
  double spacing[2];
  double origin[2];
};

/** Depths of a view. */
struct DepthRange
{
  double nearest, farthest;
};

/** A view of a volume as a permutation of its axes, a shear and a 2D warp: see ShearWarpFactorization. */
struct Factorization
{
  /** The volume's axes in the order i, j, k. The last one is the principal axis. */
  unsigned int permutation[3];
  /** Voxels along i, j, k. */
  std::ptrdiff_t size[3];
  double         shear[2];
  double         translation[2];
  /** (i, j, k) to view space. */
  AffineMap3D indexToView;
  /** Whether slices lie at whole columns and rows, so that a sample is the nearest voxel. */
  bool isNearest{ false };

  unsigned int
  GetPrincipalAxis() const
  {
    return permutation[2];
  }
};

/** An image that collects the samples of sheared slices: the place of each slice, and the columns of each row that a
 * slice reaches. The image of a part of a volume begins at column `begin.column` and row `begin.row` of the whole
 * volume's image, and has the slices from `begin.slice` on. */
struct IntermediateGrid
{
  std::ptrdiff_t              columns, rows;
  std::vector<SlicePlacement> placements;
  std::vector<ColumnSpan>     reached;
  Corner                      begin{ 0, 0, 0 };
};

/** Throws InvalidParameter, with the values, if the volume is empty, or the spacing is not positive and finite, or the
 * position of the first voxel is not finite. */
ShearWarpMIP_EXPORT void
VerifyVolumeGrid(const VolumeGrid & volume);

/** Throws InvalidParameter, with the values, if the spacing is not positive and finite, or the origin is not finite.
 * With \a fitSpacing, the spacing is not verified. */
ShearWarpMIP_EXPORT void
VerifyPictureGrid(const PictureGrid & picture, bool fitSpacing);

/** Throws InvalidParameter, with the values, if a view is not finite or singular. */
ShearWarpMIP_EXPORT void
VerifyView(const AffineMap3D & view);

/** Factors the view of a volume. Throws InvalidParameter, with the values, if the view and the volume's axes together
 * are not finite or not invertible, or if an intermediate image of \a oversampling pixels per voxel would have 2^31
 * columns or rows. */
ShearWarpMIP_EXPORT Factorization
Factorize(const AffineMap3D & view, const VolumeGrid & volume, unsigned int oversampling = 1);

/** Returns the places of \a count slices from \a first on. If a sample is the nearest voxel, places are whole: the
 * first column and the first row that the slice reaches. */
ShearWarpMIP_EXPORT std::vector<SlicePlacement>
                    PlaceSlices(const Factorization & factorization, std::ptrdiff_t first, std::ptrdiff_t count);

/** Returns the intermediate images of a part of the volume: `oversampling` x `oversampling` phases. Pixel (x, y) of
 * element `row * oversampling + column` is pixel (oversampling x + column, oversampling y + row) of the oversampled
 * image. Pixel (x, y) of the oversampled image lies at sheared column (x + 1) / oversampling - 1 and row (y + 1) /
 * oversampling
 * - 1. All phases have the same size. Without oversampling, the only element is the intermediate image. */
ShearWarpMIP_EXPORT std::vector<IntermediateGrid>
MakePhases(const Factorization & factorization, const VoxelBox & part, unsigned int oversampling = 1);

/** Returns the part of the whole volume. */
ShearWarpMIP_EXPORT VoxelBox
GetWholeBox(const VolumeGrid & volume);

/** Returns the places in \a grid of \a slices slices of a part of a volume. The part's voxel (0, 0, 0) is the volume's
 * voxel at \a corner. */
ShearWarpMIP_EXPORT std::vector<SlicePlacement>
                    PlacePart(const IntermediateGrid & grid, const Corner & corner, std::ptrdiff_t slices);

/** Returns the map of sheared column, row and slice to view space. */
ShearWarpMIP_EXPORT AffineMap3D
GetShearedToView(const Factorization & factorization);

/** Returns the function \a ofView[0] u + \a ofView[1] v + \a ofView[2] w + \a ofView[3] of view space as a function of
 * sheared column, row and slice. */
ShearWarpMIP_EXPORT ShearedFunction
GetShearedFunction(const Factorization & factorization, const double (&ofView)[4]);

/** Returns the depth w as a function of sheared column, row and slice. */
ShearWarpMIP_EXPORT ShearedFunction
GetDepthFunction(const Factorization & factorization);

/** Returns a function of sheared column, row and slice as a function of column, row and slice of element \a phase of
 * MakePhases(). */
ShearWarpMIP_EXPORT ShearedFunction
GetFunctionOfPhase(ShearedFunction function, unsigned int oversampling, std::size_t phase);

/** Returns the map of a picture's column and row to the whole volume's intermediate image. Throws InvalidParameter,
 * with the values, if the map is not finite. */
ShearWarpMIP_EXPORT AffineMap2D
GetOutputToIntermediate(const Factorization & factorization,
                        const PictureGrid &   picture,
                        unsigned int          oversampling = 1);

/** The bounding box of a volume in view space. The box contains whole voxels, not only their centers. */
struct ViewBounds
{
  double lower[3], upper[3];
  /** Along each axis of view space: the step of a voxel of the volume's axis that is longest there, and the extent of
   * the other axes. */
  double step[3], rest[3];
};

/** Throws as Factorize(). */
ShearWarpMIP_EXPORT ViewBounds
FindBounds(const AffineMap3D & view, const VolumeGrid & volume);

/** Writes the volume's smallest spacing, in units of the view plane's two axes. */
ShearWarpMIP_EXPORT void
ProjectSpacing(const AffineMap3D & view, const VolumeGrid & volume, double (&projected)[2]);

/** Returns the grid of pictures of a volume in all of \a views. Fitted parameters are such that the grid holds the
 * volume's voxels, with the smallest spacing of ProjectSpacing(). Where, in each view, one axis of the volume lies
 * along an axis of the grid, and its voxels are a whole number of such pixels long within a thousandth, the voxels are
 * exactly so many pixels long: the spacing is adapted. There the grid may leave out a hundredth of a pixel, and
 * elsewhere a ten-thousandth of a pixel. The other parameters stay as in \a given. Throws InvalidParameter, with the
 * values, if the grid is not finite. */
ShearWarpMIP_EXPORT PictureGrid
FitGrid(const std::vector<AffineMap3D> & views,
        const VolumeGrid &               volume,
        const PictureGrid &              given,
        bool                             fitSize,
        bool                             fitSpacing,
        bool                             fitOrigin);

/** Returns the depths of a volume from \a slab.nearest to \a slab.farthest. A slab without thickness, or beside the
 * volume, gets a thousandth of the volume's depth. Throws InvalidParameter, with the slab, if the slab's thickness is
 * zero or infinite in double precision. */
ShearWarpMIP_EXPORT DepthRange
ClipDepths(const AffineMap3D & view, const VolumeGrid & volume, const DepthRange & slab);

/** Returns the least depth of the smallest sphere about the volume's center that holds all voxels. Except for rounding
 * errors, it is the same for all views that turn about the center. */
ShearWarpMIP_EXPORT double
FindSphereDepth(const AffineMap3D & view, const VolumeGrid & volume);

/** Returns the map of a picture's column, row and depth to physical space. */
ShearWarpMIP_EXPORT AffineMap3D
MakePictureSpace(const AffineMap3D & view, const PictureGrid & picture);

/** Where a slice lies in physical space. The columns of `direction` have length 1. */
struct SliceGeometry
{
  double spacing[3];
  double origin[3];
  double direction[3][3];
};

/** Returns a picture as a slice in physical space, in the middle of \a depths and as thick as their range. */
ShearWarpMIP_EXPORT SliceGeometry
MakeSliceGeometry(const AffineMap3D & view, const PictureGrid & picture, const DepthRange & depths);
} // namespace itk::ShearWarp

#endif
