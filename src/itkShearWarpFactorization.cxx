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
#include "itkShearWarpFactorization.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>

namespace itk
{
std::vector<ShearWarp::SlicePlacement>
ShearWarp::PlacePart(const IntermediateGrid & grid, const Corner & corner, std::ptrdiff_t slices)
{
  const auto                  first = grid.placements.begin() + (corner.slice - grid.begin.slice);
  std::vector<SlicePlacement> part(first, first + slices);
  for (SlicePlacement & placement : part)
  {
    placement.column.whole += static_cast<std::int32_t>(corner.column - grid.begin.column);
    placement.row.whole += static_cast<std::int32_t>(corner.row - grid.begin.row);
  }
  return part;
}

namespace
{

/** One space to another: p = matrix * q + offset. */
struct LinearView
{
  Matrix<double, 3, 3> matrix;
  Vector<double, 3>    offset;
};

/** Components of a ray whose ratio is not above this are equal, but for rounding errors: then the later axis is
 * principal, on every machine. */
constexpr double AxisTie = 1.0 + 1e-10;

Vector<double, 3>
GetColumn(const Matrix<double, 3, 3> & matrix, unsigned int column)
{
  Vector<double, 3> result;
  for (unsigned int row = 0; row < 3; ++row)
  {
    result[row] = matrix(row, column);
  }
  return result;
}

template <typename TArray>
bool
IsFinite(const TArray & array)
{
  return std::all_of(array.begin(), array.end(), [](double element) { return std::isfinite(element); });
}

bool
IsFinite(const Matrix<double, 3, 3> & matrix)
{
  return IsFinite(matrix.GetVnlMatrix());
}

// who includes ITK's templates may compile them for another processor, and the linker shares them

double
Dot(const Vector<double, 3> & a, const Vector<double, 3> & b)
{
  return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}

double
GetNorm(const Vector<double, 3> & vector)
{
  return std::sqrt(Dot(vector, vector));
}

Matrix<double, 3, 3>
Multiply(const Matrix<double, 3, 3> & a, const Matrix<double, 3, 3> & b)
{
  Matrix<double, 3, 3> product;
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int column = 0; column < 3; ++column)
    {
      product(row, column) = (a(row, 0) * b(0, column) + a(row, 1) * b(1, column)) + a(row, 2) * b(2, column);
    }
  }
  return product;
}

Vector<double, 3>
Multiply(const Matrix<double, 3, 3> & a, const Vector<double, 3> & b)
{
  Vector<double, 3> product;
  for (unsigned int row = 0; row < 3; ++row)
  {
    product[row] = (a(row, 0) * b[0] + a(row, 1) * b[1]) + a(row, 2) * b[2];
  }
  return product;
}

Vector<double, 3>
Cross(const Vector<double, 3> & a, const Vector<double, 3> & b)
{
  const double product[] = { a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] };
  return Vector<double, 3>(product);
}

double
GetDeterminant(const Matrix<double, 3, 3> & matrix)
{
  return Dot(Cross(GetColumn(matrix, 0), GetColumn(matrix, 1)), GetColumn(matrix, 2));
}

/** By cofactors; not finite where the matrix is singular. The singular value decomposition of Matrix::GetInverse() ends
 * the program where numbers are not finite, and may never end itself where they are large. */
Matrix<double, 3, 3>
Invert(const Matrix<double, 3, 3> & matrix)
{
  const double         determinant = GetDeterminant(matrix);
  Matrix<double, 3, 3> inverse;
  for (unsigned int row = 0; row < 3; ++row)
  {
    const auto cofactors = Cross(GetColumn(matrix, (row + 1) % 3), GetColumn(matrix, (row + 2) % 3));
    for (unsigned int column = 0; column < 3; ++column)
    {
      inverse(row, column) = cofactors[column] / determinant;
    }
  }
  return inverse;
}

bool
IsInvertible(const Matrix<double, 3, 3> & matrix)
{
  const double volume = GetNorm(GetColumn(matrix, 0)) * GetNorm(GetColumn(matrix, 1)) * GetNorm(GetColumn(matrix, 2));
  return std::abs(GetDeterminant(matrix)) > 1e-12 * volume && IsFinite(Invert(matrix));
}

/** The image's index axes in physical space: direction times spacing. */
Matrix<double, 3, 3>
GetIndexToPhysical(const ImageBase<3> * image)
{
  Matrix<double, 3, 3> matrix = image->GetDirection();
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int column = 0; column < 3; ++column)
    {
      matrix(row, column) *= image->GetSpacing()[column];
    }
  }
  return matrix;
}

/** Physical position of the first voxel of the image's largest possible region. */
Vector<double, 3>
GetFirstVoxel(const ImageBase<3> * image)
{
  const Matrix<double, 3, 3> matrix = GetIndexToPhysical(image);
  Vector<double, 3>          point = image->GetOrigin().GetVectorFromOrigin();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto index = static_cast<double>(image->GetLargestPossibleRegion().GetIndex(axis));
    for (unsigned int row = 0; row < 3; ++row)
    {
      point[row] += matrix(row, axis) * index;
    }
  }
  return point;
}

void
VerifyImage(const DataObject * image, const char * name)
{
  if (!image)
  {
    itkGenericExceptionMacro("The " << name << " is required but not set.");
  }
}

/** What an image looks like in a view. */
struct ImageView
{
  /** Index, relative to the first voxel, to view space: q = matrix * index + offset. */
  LinearView indexToView;
  /** The direction of a ray, in index space. */
  Vector<double, 3> ray;
};

ImageView
GetImageView(const ShearWarp::ViewSpace & view, const ImageBase<3> * image)
{
  VerifyImage(image, "input image");
  const Matrix<double, 3, 3> physicalToView = Invert(view.axes);
  const LinearView           indexToView{ Multiply(physicalToView, GetIndexToPhysical(image)),
                                Multiply(physicalToView, GetFirstVoxel(image) - view.offset) };
  if (IsInvertible(indexToView.matrix) && IsFinite(indexToView.offset))
  {
    return { indexToView, GetColumn(Invert(indexToView.matrix), 2) };
  }
  itkGenericExceptionMacro(
    "Transform and the image's axes together must be finite and invertible, but the transform's matrix is\n"
    << view.axes << "its offset " << view.offset << ", and the image has spacing " << image->GetSpacing() << ", origin "
    << image->GetOrigin() << " and direction\n"
    << image->GetDirection());
}

/** The bounding box of an image in view space. */
struct Bounds
{
  Point<double, 3> lower, upper;
  /** Along each axis of view space: the step of a voxel of the image axis that is longest there, and the extent of the
   * other image axes. */
  Vector<double, 3> step, rest;
};

Bounds
FindBounds(const ShearWarp::ViewSpace & view, const ImageBase<3> * image)
{
  const LinearView indexToView = GetImageView(view, image).indexToView;
  const Size<3>    size = image->GetLargestPossibleRegion().GetSize();
  Bounds           bounds{};
  for (unsigned int row = 0; row < 3; ++row)
  {
    double center = indexToView.offset[row];
    double halfExtent = 0.0;
    double longest = 0.0;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const auto   count = static_cast<double>(size[axis]);
      const double step = std::abs(indexToView.matrix(row, axis));
      center += indexToView.matrix(row, axis) * 0.5 * (count - 1.0);
      halfExtent += step * 0.5 * count;
      bounds.step[row] = step * count > longest ? step : bounds.step[row];
      longest = std::max(longest, step * count);
    }
    bounds.lower[row] = center - halfExtent;
    bounds.upper[row] = center + halfExtent;
    bounds.rest[row] = 2.0 * halfExtent - longest;
  }
  return bounds;
}

/** The image's smallest spacing, in units of the view plane's axes. */
Vector<double, 2>
ProjectSpacing(const ShearWarp::ViewSpace & view, const ImageBase<3> * image)
{
  VerifyImage(image, "input image");
  const auto &      spacing = image->GetSpacing();
  Vector<double, 2> projected;
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    projected[axis] = *std::min_element(spacing.Begin(), spacing.End()) / GetNorm(GetColumn(view.axes, axis));
  }
  return projected;
}

/** \a position and \a fractions of a pixel, in 1/2^15. */
ShearWarp::SamplingPosition
Shift(const ShearWarp::SamplingPosition & position, std::int32_t fractions)
{
  const std::int32_t fraction = position.fraction + fractions;
  return { position.whole + (fraction >> ShearWarp::FractionBits), fraction & (ShearWarp::One - 1) };
}

/** The grid of slices of columns x rows voxels at \a placements, of which voxel (0, 0) is the volume's at \a corner,
 * from column and row \a begin on. */
ShearWarp::IntermediateGrid
MakeGrid(std::vector<ShearWarp::SlicePlacement> placements,
         const ShearWarp::Corner &              corner,
         std::int32_t                           columns,
         std::int32_t                           rows,
         const ShearWarp::Corner &              begin)
{
  ShearWarp::IntermediateGrid grid{ 0, 0, std::move(placements), {}, begin };
  const auto                  columnShift = static_cast<std::int32_t>(corner.column - begin.column);
  const auto                  rowShift = static_cast<std::int32_t>(corner.row - begin.row);
  for (const auto & placement : grid.placements)
  {
    grid.columns = std::max<std::ptrdiff_t>(grid.columns, placement.FirstColumn() + columnShift + columns);
    grid.rows = std::max<std::ptrdiff_t>(grid.rows, placement.FirstRow() + rowShift + rows);
  }

  // offsets are monotonic in the slice, so that slices [first, last) reach a row; slices side by side overlap, so that
  // the columns that they reach are one span
  const bool     isFalling = grid.placements.front().FirstRow() > grid.placements.back().FirstRow();
  const auto     slices = static_cast<std::ptrdiff_t>(grid.placements.size());
  const auto     getSlice = [&](std::ptrdiff_t n) { return grid.placements[isFalling ? slices - 1 - n : n]; };
  const auto     getRow = [&](std::ptrdiff_t n) { return getSlice(n).FirstRow() + rowShift; };
  const auto     getColumn = [&](std::ptrdiff_t n) { return getSlice(n).FirstColumn() + columnShift; };
  std::ptrdiff_t first = 0;
  std::ptrdiff_t last = 0;
  for (std::int32_t row = 0; row < grid.rows; ++row)
  {
    while (last < slices && getRow(last) <= row)
    {
      ++last;
    }
    while (first < last && getRow(first) + rows <= row)
    {
      ++first;
    }
    const bool isReached = first < last;
    grid.reached.push_back({ isReached ? std::min(getColumn(first), getColumn(last - 1)) : 0,
                             isReached ? std::max(getColumn(first), getColumn(last - 1)) + columns : 0 });
  }
  return grid;
}

ShearWarpFactorization::PermutationType
MakePermutation(unsigned int principalAxis)
{
  ShearWarpFactorization::PermutationType permutation;
  permutation[0] = principalAxis == 0 ? 1 : 0;
  permutation[1] = principalAxis == 2 ? 1 : 2;
  permutation[2] = principalAxis;
  return permutation;
}

} // namespace

ShearWarp::ViewSpace::ViewSpace(const Transform<double, 3, 3> * transform)
{
  if (!transform)
  {
    itkGenericExceptionMacro("Transform is required but not set.");
  }
  if (!transform->IsLinear())
  {
    itkGenericExceptionMacro("Transform must be linear, but it is a " << transform->GetNameOfClass() << '.');
  }
  // this works for every class of transforms; a power of two as step keeps the digits of the matrix
  constexpr double step = 1024.0;
  offset = transform->TransformPoint(Point<double, 3>(0.0)).GetVectorFromOrigin();
  for (unsigned int column = 0; column < 3; ++column)
  {
    Point<double, 3> ahead(0.0);
    Point<double, 3> behind(0.0);
    ahead[column] = step;
    behind[column] = -step;
    const auto difference = transform->TransformPoint(ahead) - transform->TransformPoint(behind);
    for (unsigned int row = 0; row < 3; ++row)
    {
      axes(row, column) = difference[row] / (2 * step);
    }
  }
  if (!IsFinite(axes) || !std::isfinite(offset.GetSquaredNorm()))
  {
    itkGenericExceptionMacro("Transform must be finite, but its matrix is\n"
                             << axes << "and its offset " << offset << '.');
  }
  if (!IsInvertible(axes))
  {
    itkGenericExceptionMacro("Transform must be invertible, but the determinant of its matrix\n"
                             << axes << "is " << GetDeterminant(axes) << '.');
  }
}

void
ShearWarp::VerifyInputGeometry(const ImageBase<3> * image)
{
  const auto & region = image->GetLargestPossibleRegion();
  if (region.GetSize(0) == 0 || region.GetSize(1) == 0 || region.GetSize(2) == 0)
  {
    itkGenericExceptionMacro("The input must not be empty, but its region is " << region);
  }
  const auto & spacing = image->GetSpacing();
  if (!IsFinite(spacing) || !(spacing[0] > 0.0 && spacing[1] > 0.0 && spacing[2] > 0.0))
  {
    itkGenericExceptionMacro("The input's spacing must be positive and finite, but it is " << spacing << '.');
  }
  if (!IsFinite(image->GetOrigin()))
  {
    itkGenericExceptionMacro("The input's origin must be finite, but it is " << image->GetOrigin() << '.');
  }
}

void
ShearWarp::VerifyOutputGrid(const Vector<double, 2> & spacing, const Point<double, 2> & origin, bool fitSpacing)
{
  if (!fitSpacing && !(IsFinite(spacing) && spacing[0] > 0.0 && spacing[1] > 0.0))
  {
    itkGenericExceptionMacro("OutputSpacing must be positive and finite, but it is " << spacing << '.');
  }
  if (!IsFinite(origin))
  {
    itkGenericExceptionMacro("OutputOrigin must be finite, but it is " << origin << '.');
  }
}

ShearWarp::ViewGrid
ShearWarp::FitGrid(const ViewList &     views,
                   const ImageBase<3> * image,
                   const ViewGrid &     given,
                   bool                 fitSize,
                   bool                 fitSpacing,
                   bool                 fitOrigin)
{
  constexpr double  infinity = std::numeric_limits<double>::infinity();
  Point<double, 3>  lower(infinity);
  Point<double, 3>  upper(-infinity);
  Vector<double, 3> shortestStep(infinity);
  Vector<double, 3> longestStep(0.0);
  Vector<double, 3> rest(0.0);
  ViewGrid          grid = given;
  grid.spacing = fitSpacing ? Vector<double, 2>(infinity) : given.spacing;
  for (SizeValueType n = 0; n < views.count; ++n)
  {
    const auto   view = views.get(n);
    const Bounds bounds = FindBounds(view, image);
    const auto   spacing = ProjectSpacing(view, image);
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      lower[axis] = std::min(lower[axis], bounds.lower[axis]);
      upper[axis] = std::max(upper[axis], bounds.upper[axis]);
      shortestStep[axis] = std::min(shortestStep[axis], bounds.step[axis]);
      longestStep[axis] = std::max(longestStep[axis], bounds.step[axis]);
      rest[axis] = std::max(rest[axis], bounds.rest[axis]);
      grid.spacing[axis] = fitSpacing ? std::min(grid.spacing[axis], spacing[axis]) : grid.spacing[axis];
    }
  }
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    // in each view, one image axis lies along this axis
    const bool isAlong = rest[axis] <= 1e-2 * grid.spacing[axis];
    if (fitSpacing && isAlong)
    {
      const double pixels = std::round(longestStep[axis] / grid.spacing[axis]);
      const double spacing = longestStep[axis] / pixels;
      const double difference =
        std::max(std::abs(spacing - grid.spacing[axis]), std::abs(shortestStep[axis] / pixels - grid.spacing[axis]));
      // equal spacings keep their bits
      const bool isRounded = difference > 1e-9 * grid.spacing[axis] && difference <= 1e-3 * grid.spacing[axis];
      grid.spacing[axis] = isRounded ? spacing : grid.spacing[axis];
    }
    const double start = fitOrigin ? lower[axis] : given.origin[axis] - 0.5 * grid.spacing[axis];
    // an extent that exceeds whole pixels by rounding errors only needs no further pixel
    const double tolerance = isAlong ? 1e-2 : 1e-4;
    const double fitted = std::max(1.0, std::ceil((upper[axis] - start) / grid.spacing[axis] - tolerance));
    grid.size[axis] = fitSize ? fitted : given.size[axis];
    if (fitOrigin)
    {
      grid.origin[axis] = 0.5 * (lower[axis] + upper[axis]) - 0.5 * (grid.size[axis] - 1.0) * grid.spacing[axis];
    }
  }
  if (!(IsFinite(grid.spacing) && grid.spacing[0] > 0.0 && grid.spacing[1] > 0.0 && IsFinite(grid.origin)))
  {
    itkGenericExceptionMacro("The output's grid must be finite, but its spacing is "
                             << grid.spacing << " and its origin " << grid.origin << '.');
  }
  return grid;
}

ShearWarp::DepthRange
ShearWarp::ClipDepths(const ViewSpace & view, const ImageBase<3> * image, const DepthRange & slab)
{
  const Bounds bounds = FindBounds(view, image);
  const double lower = bounds.lower[2];
  const double upper = bounds.upper[2];
  DepthRange   depths{ std::max(lower, slab.nearest), std::min(upper, slab.farthest) };
  if (!(depths.nearest < depths.farthest))
  {
    // a slab without thickness, or beside the image
    depths.nearest = std::isfinite(slab.nearest) ? slab.nearest : slab.farthest;
    depths.farthest = std::isfinite(slab.farthest) ? slab.farthest : slab.nearest;
    const double missing = (upper - lower) * 1e-3 - (depths.farthest - depths.nearest);
    depths.nearest -= 0.5 * std::max(missing, 0.0);
    depths.farthest += 0.5 * std::max(missing, 0.0);
  }
  const double thickness = depths.farthest - depths.nearest;
  if (!(thickness > 0.0 && std::isfinite(thickness)))
  {
    itkGenericExceptionMacro("SlabNear and SlabFar must be within the range of the output's geometry, but they are "
                             << slab.nearest << " and " << slab.farthest << '.');
  }
  return depths;
}

double
ShearWarp::FindSphereDepth(const ViewSpace & view, const ImageBase<3> * image)
{
  const LinearView indexToView = GetImageView(view, image).indexToView;
  const auto       indexToPhysical = GetIndexToPhysical(image);
  const Size<3>    size = image->GetLargestPossibleRegion().GetSize();
  double           center = indexToView.offset[2];
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    center += indexToView.matrix(2, axis) * 0.5 * (static_cast<double>(size[axis]) - 1.0);
  }
  // four diagonals: axes need not be at right angles
  double radius = 0.0;
  for (const double signY : { -1.0, 1.0 })
  {
    for (const double signZ : { -1.0, 1.0 })
    {
      const Vector<double, 3> halfDiagonal =
        GetColumn(indexToPhysical, 0) * (0.5 * static_cast<double>(size[0])) +
        GetColumn(indexToPhysical, 1) * (signY * 0.5 * static_cast<double>(size[1])) +
        GetColumn(indexToPhysical, 2) * (signZ * 0.5 * static_cast<double>(size[2]));
      radius = std::max(radius, GetNorm(halfDiagonal));
    }
  }
  // how fast the depth changes along physical space
  const Matrix<double, 3, 3> physicalToView = Invert(view.axes);
  const double               slope[] = { physicalToView(2, 0), physicalToView(2, 1), physicalToView(2, 2) };
  return center - GetNorm(Vector<double, 3>(slope)) * radius;
}

Point<double, 3>
ShearWarp::PictureSpace::operator()(double column, double row, double depth) const
{
  if (!std::isfinite(depth))
  {
    itkGenericExceptionMacro("No ray has a value at column " << column << ", row " << row << '.');
  }
  Point<double, 3> point = origin;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    point[axis] += steps(axis, 0) * column + steps(axis, 1) * row + steps(axis, 2) * depth;
  }
  return point;
}

ShearWarp::PictureSpace
ShearWarp::MakePictureSpace(const ViewSpace & view, const ImageBase<2> * grid)
{
  PictureSpace space;
  space.steps = view.axes;
  for (unsigned int row = 0; row < 3; ++row)
  {
    space.origin[row] =
      (view.axes(row, 0) * grid->GetOrigin()[0] + view.axes(row, 1) * grid->GetOrigin()[1]) + view.offset[row];
    space.steps(row, 0) *= grid->GetSpacing()[0];
    space.steps(row, 1) *= grid->GetSpacing()[1];
  }
  return space;
}

ShearWarp::SliceGeometry
ShearWarp::MakeSliceGeometry(const ViewSpace & view, const ImageBase<2> * grid, const DepthRange & depths)
{
  const double  steps[] = { grid->GetSpacing()[0], grid->GetSpacing()[1], depths.farthest - depths.nearest };
  const double  middle = 0.5 * (depths.nearest + depths.farthest);
  SliceGeometry slice;
  for (unsigned int row = 0; row < 3; ++row)
  {
    slice.origin[row] = ((view.axes(row, 0) * grid->GetOrigin()[0] + view.axes(row, 1) * grid->GetOrigin()[1]) +
                         view.axes(row, 2) * middle) +
                        view.offset[row];
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const Vector<double, 3> column = GetColumn(view.axes, axis);
    const double            length = GetNorm(column);
    slice.spacing[axis] = steps[axis] * length;
    for (unsigned int row = 0; row < 3; ++row)
    {
      slice.direction(row, axis) = column[row] / length;
    }
  }
  return slice;
}

ShearWarpFactorization::ShearWarpFactorization(const TransformType *       viewTransform,
                                               const InputImageBaseType *  image,
                                               const OutputImageBaseType * output,
                                               unsigned int                oversampling)
  : ShearWarpFactorization(ShearWarp::ViewSpace(viewTransform), image, output, oversampling)
{}

ShearWarpFactorization::ShearWarpFactorization(const ShearWarp::ViewSpace & view,
                                               const InputImageBaseType *   image,
                                               const OutputImageBaseType *  output,
                                               unsigned int                 oversampling)
  : m_Oversampling(oversampling)
{
  const auto [indexToView, ray] = GetImageView(view, image);
  VerifyOversampling(oversampling);
  VerifyImage(output, "output image");
  m_ImageRegion = image->GetLargestPossibleRegion();
  m_OutputSpacing = output->GetSpacing();
  m_OutputOrigin = output->GetOrigin();

  unsigned int principalAxis = 2;
  for (const unsigned int axis : { 1, 0 })
  {
    principalAxis = std::abs(ray[axis]) > AxisTie * std::abs(ray[principalAxis]) ? axis : principalAxis;
  }
  m_Permutation = MakePermutation(principalAxis);

  m_ViewMatrix.SetIdentity();
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int column = 0; column < 3; ++column)
    {
      m_ViewMatrix(row, column) = indexToView.matrix(row, m_Permutation[column]);
    }
    m_ViewMatrix(row, 3) = indexToView.offset[row];
  }

  Size<3> size;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    size[axis] = m_ImageRegion.GetSize(m_Permutation[axis]);
  }
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    // sums of integers can overflow
    const double length = m_Oversampling * (static_cast<double>(size[axis]) + static_cast<double>(size[2]));
    if (length > std::numeric_limits<std::int32_t>::max())
    {
      itkGenericExceptionMacro("The intermediate image must have less than 2^31 columns and rows, but an input of size "
                               << m_ImageRegion.GetSize() << " needs " << std::fixed << std::setprecision(0) << length
                               << '.');
    }
    m_Shear[axis] = -ray[m_Permutation[axis]] / ray[principalAxis];
    m_Translation[axis] = m_Shear[axis] < 0 ? -m_Shear[axis] * static_cast<double>(size[2] - 1) : 0.0;
  }

  this->MakePhases(m_ImageRegion);
}

ShearWarpFactorization
ShearWarpFactorization::MakePart(const ImageRegion<3> & part) const
{
  if (part.GetNumberOfPixels() == 0 || !m_ImageRegion.IsInside(part))
  {
    itkGenericExceptionMacro("A part must not be empty and lie within the image's region, " << m_ImageRegion
                                                                                            << ", but it is " << part);
  }
  ShearWarpFactorization factorization = *this;
  factorization.MakePhases(part);
  return factorization;
}

void
ShearWarpFactorization::MakePhases(const ImageRegion<3> & part)
{
  std::ptrdiff_t first[3];
  std::int32_t   size[3];
  for (unsigned int n = 0; n < 3; ++n)
  {
    const unsigned int axis = m_Permutation[n];
    first[n] = part.GetIndex(axis) - m_ImageRegion.GetIndex(axis);
    size[n] = static_cast<std::int32_t>(part.GetSize(axis));
  }

  std::vector<ShearWarp::SlicePlacement> placements;
  for (std::ptrdiff_t k = first[2]; k < first[2] + size[2]; ++k)
  {
    const auto offset = m_Shear * static_cast<double>(k) + m_Translation;
    placements.push_back({ ShearWarp::QuantizePosition(offset[0]), ShearWarp::QuantizePosition(offset[1]) });
  }
  const ShearWarp::SlicePlacement & front = placements.front();
  const ShearWarp::SlicePlacement & back = placements.back();
  const ShearWarp::Corner           corner{ first[0], first[1], first[2] };
  const ShearWarp::Corner           begin{ corner.column + std::min(front.column.whole, back.column.whole),
                                 corner.row + std::min(front.row.whole, back.row.whole),
                                 corner.slice };
  m_Phases.clear();
  const auto steps = static_cast<std::int32_t>(m_Oversampling);
  for (std::int32_t row = 0; row < steps; ++row)
  {
    for (std::int32_t column = 0; column < steps; ++column)
    {
      const auto getShift = [steps](std::int32_t phase) { return (steps - 1 - phase) * (ShearWarp::One / steps); };
      auto       shifted = placements;
      for (ShearWarp::SlicePlacement & placement : shifted)
      {
        placement = { Shift(placement.column, getShift(column)), Shift(placement.row, getShift(row)) };
      }
      m_Phases.push_back(MakeGrid(std::move(shifted), corner, size[0], size[1], begin));
    }
  }
  m_IntermediateRegion.SetIndex({ { steps * begin.column, steps * begin.row } });
  this->JoinPhases();
}

void
ShearWarpFactorization::JoinPhases()
{
  const std::ptrdiff_t steps = m_Oversampling;
  const auto           length = [steps](std::ptrdiff_t pixels, std::ptrdiff_t phase) {
    return static_cast<SizeValueType>((pixels - 1) * steps + phase + 1);
  };
  Size<2> size{ { 0, 0 } };
  for (std::ptrdiff_t n = 0; n < steps * steps; ++n)
  {
    size[0] = std::max(size[0], length(m_Phases[n].columns, n % steps));
    size[1] = std::max(size[1], length(m_Phases[n].rows, n / steps));
  }
  m_IntermediateRegion.SetSize(size);

  m_ReachedColumns.assign(size[1], { static_cast<std::int32_t>(size[0]), 0 });
  for (std::ptrdiff_t n = 0; n < steps * steps; ++n)
  {
    for (std::ptrdiff_t row = 0; row < m_Phases[n].rows; ++row)
    {
      const ShearWarp::ColumnSpan & phase = m_Phases[n].reached[row];
      ShearWarp::ColumnSpan &       span = m_ReachedColumns[row * steps + n / steps];
      if (phase.begin < phase.end)
      {
        span.begin = std::min(span.begin, static_cast<std::int32_t>(phase.begin * steps + n % steps));
        span.end = std::max(span.end, static_cast<std::int32_t>(length(phase.end, n % steps)));
      }
    }
  }
  for (ShearWarp::ColumnSpan & span : m_ReachedColumns)
  {
    span.begin = std::min(span.begin, span.end);
  }
}

ShearWarpFactorization::Matrix4Type
ShearWarpFactorization::GetShearMatrix() const
{
  Matrix4Type shear;
  shear.SetIdentity();
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    shear(axis, 2) = m_Shear[axis];
    shear(axis, 3) = m_Translation[axis];
  }
  return shear;
}

ShearWarp::ShearedFunction
ShearWarpFactorization::GetShearedFunction(const Vector4Type & ofView) const
{
  const Matrix4Type matrix = this->GetShearedToViewMatrix();
  const auto        get = [&](unsigned int column) {
    return ((matrix(0, column) * ofView[0] + matrix(1, column) * ofView[1]) + matrix(2, column) * ofView[2]) +
           matrix(3, column) * ofView[3];
  };
  return { get(0), get(1), get(2), get(3) };
}

ShearWarp::ShearedFunction
ShearWarpFactorization::GetFunctionOfPhase(ShearWarp::ShearedFunction function, std::size_t phase) const
{
  const auto shift = [this](std::size_t n) { return static_cast<double>(n + 1) / m_Oversampling - 1.0; };
  function.constant = function(shift(phase % m_Oversampling), shift(phase / m_Oversampling), 0.0);
  return function;
}

ShearWarp::ShearedFunction
ShearWarpFactorization::GetDepthFunction() const
{
  const double depth[] = { 0.0, 0.0, 1.0, 0.0 };
  return this->GetShearedFunction(Vector4Type(depth));
}

ShearWarpFactorization::Matrix3Type
ShearWarpFactorization::GetWarpMatrix() const
{
  const Matrix4Type shearedToView = this->GetShearedToViewMatrix();
  Matrix3Type       warp;
  warp.SetIdentity();
  for (unsigned int row = 0; row < 2; ++row)
  {
    warp(row, 0) = shearedToView(row, 0);
    warp(row, 1) = shearedToView(row, 1);
    warp(row, 2) = shearedToView(row, 3);
  }
  return warp;
}

ShearWarpFactorization::Matrix4Type
ShearWarpFactorization::GetShearedToViewMatrix() const
{
  Matrix4Type matrix = m_ViewMatrix;
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      matrix(row, 2) -= m_Shear[axis] * m_ViewMatrix(row, axis);
      matrix(row, 3) -= m_Translation[axis] * m_ViewMatrix(row, axis);
    }
  }
  return matrix;
}

ShearWarpFactorization::Matrix3Type
ShearWarpFactorization::GetOutputToIntermediateMatrix() const
{
  Matrix3Type outputToView;
  outputToView.SetIdentity();
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    outputToView(axis, axis) = m_OutputSpacing[axis];
    outputToView(axis, 2) = m_OutputOrigin[axis];
  }
  Matrix3Type shearedToIntermediate;
  shearedToIntermediate.SetIdentity();
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    shearedToIntermediate(axis, axis) = m_Oversampling;
    shearedToIntermediate(axis, 2) = m_Oversampling - 1.0;
  }
  const Matrix3Type map = Multiply(Multiply(shearedToIntermediate, Invert(this->GetWarpMatrix())), outputToView);
  if (IsFinite(map))
  {
    return map;
  }
  itkGenericExceptionMacro("Transform and output grid must be within the range of numbers, but the warp is\n"
                           << this->GetWarpMatrix() << "and the output's spacing " << m_OutputSpacing << ", origin "
                           << m_OutputOrigin << '.');
}

void
ShearWarpFactorization::VerifyOversampling(unsigned int oversampling)
{
  if (oversampling != 1 && oversampling != 2)
  {
    itkGenericExceptionMacro("Oversampling must be 1 or 2, but it is " << oversampling << '.');
  }
}

void
ShearWarpFactorization::VerifyViewTransform(const TransformType * viewTransform)
{
  ShearWarp::ViewSpace{ viewTransform };
}

ShearWarpFactorization::Matrix3Type
ShearWarpFactorization::GetLinearPart(const TransformType * viewTransform)
{
  return ShearWarp::ViewSpace(viewTransform).axes;
}

bool
ShearWarpFactorization::HasSameSlicePlacements(const ShearWarpFactorization & other) const
{
  const auto areSame = [](const ShearWarp::SamplingPosition & a, const ShearWarp::SamplingPosition & b) {
    return a.whole == b.whole && a.fraction == b.fraction;
  };
  const auto haveSamePlacements = [&](const ShearWarp::IntermediateGrid & a, const ShearWarp::IntermediateGrid & b) {
    return std::equal(a.placements.begin(),
                      a.placements.end(),
                      b.placements.begin(),
                      b.placements.end(),
                      [&](const ShearWarp::SlicePlacement & x, const ShearWarp::SlicePlacement & y) {
                        return areSame(x.column, y.column) && areSame(x.row, y.row);
                      });
  };
  return m_Permutation == other.m_Permutation &&
         std::equal(m_Phases.begin(), m_Phases.end(), other.m_Phases.begin(), other.m_Phases.end(), haveSamePlacements);
}

void
ShearWarpFactorization::ComputeViewBounds(const TransformType *      viewTransform,
                                          const InputImageBaseType * image,
                                          Point3Type &               lower,
                                          Point3Type &               upper)
{
  const Bounds bounds = FindBounds(ShearWarp::ViewSpace(viewTransform), image);
  lower = bounds.lower;
  upper = bounds.upper;
}

ShearWarpFactorization::Vector2Type
ShearWarpFactorization::ComputeProjectedSpacing(const TransformType * viewTransform, const InputImageBaseType * image)
{
  return ProjectSpacing(ShearWarp::ViewSpace(viewTransform), image);
}

} // namespace itk
