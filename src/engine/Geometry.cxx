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
#include "itkShearWarpGeometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <iterator>
#include <limits>
#include <sstream>

namespace itk::ShearWarp
{
namespace
{
constexpr double Infinity = std::numeric_limits<double>::infinity();

/** Two components of a ray are equal if their ratio is not above this number: rounding errors do not decide. */
constexpr double AxisTie = 1.0 + 1e-10;

using Vector = std::array<double, 3>;

struct Matrix
{
  double rows[3][3];
};

template <typename TNumber, std::size_t VLength>
std::string
ToText(const TNumber (&numbers)[VLength])
{
  std::ostringstream text;
  for (std::size_t n = 0; n < VLength; ++n)
  {
    text << (n == 0 ? "[" : ", ") << numbers[n];
  }
  text << ']';
  return text.str();
}

/** A matrix, row by row. */
std::string
ToText(const double (&matrix)[3][3])
{
  std::ostringstream text;
  for (const auto & row : matrix)
  {
    text << row[0] << ' ' << row[1] << ' ' << row[2] << '\n';
  }
  return text.str();
}

template <typename TArray>
bool
IsFinite(const TArray & array)
{
  return std::all_of(std::begin(array), std::end(array), [](double element) { return std::isfinite(element); });
}

bool
IsFiniteMatrix(const double (&matrix)[3][3])
{
  return IsFinite(matrix[0]) && IsFinite(matrix[1]) && IsFinite(matrix[2]);
}

Vector
GetColumn(const double (&matrix)[3][3], unsigned int column)
{
  return { matrix[0][column], matrix[1][column], matrix[2][column] };
}

double
Dot(const Vector & a, const Vector & b)
{
  return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}

double
GetNorm(const Vector & vector)
{
  return std::sqrt(Dot(vector, vector));
}

Vector
Cross(const Vector & a, const Vector & b)
{
  return { a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] };
}

Matrix
Multiply(const double (&a)[3][3], const double (&b)[3][3])
{
  Matrix product;
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int column = 0; column < 3; ++column)
    {
      product.rows[row][column] = (a[row][0] * b[0][column] + a[row][1] * b[1][column]) + a[row][2] * b[2][column];
    }
  }
  return product;
}

double
GetDeterminant(const double (&matrix)[3][3])
{
  return Dot(Cross(GetColumn(matrix, 0), GetColumn(matrix, 1)), GetColumn(matrix, 2));
}

/** By cofactors. The inverse of a singular matrix is not finite. */
Matrix
Invert(const double (&matrix)[3][3])
{
  const double determinant = GetDeterminant(matrix);
  Matrix       inverse;
  for (unsigned int row = 0; row < 3; ++row)
  {
    const Vector cofactors = Cross(GetColumn(matrix, (row + 1) % 3), GetColumn(matrix, (row + 2) % 3));
    for (unsigned int column = 0; column < 3; ++column)
    {
      inverse.rows[row][column] = cofactors[column] / determinant;
    }
  }
  return inverse;
}

bool
IsInvertible(const double (&matrix)[3][3])
{
  const double volume = GetNorm(GetColumn(matrix, 0)) * GetNorm(GetColumn(matrix, 1)) * GetNorm(GetColumn(matrix, 2));
  return std::abs(GetDeterminant(matrix)) > 1e-12 * volume && IsFiniteMatrix(Invert(matrix).rows);
}

/** A volume in a view. */
struct VolumeView
{
  AffineMap3D indexToView;
  /** The direction of a ray, in index space. */
  Vector ray;
};

/** Maps indices to view space, without verifying the map. */
AffineMap3D
GetIndexToView(const AffineMap3D & view, const VolumeGrid & volume)
{
  const Matrix physicalToView = Invert(view.matrix);
  const Matrix product = Multiply(physicalToView.rows, volume.indexToPhysical.matrix);
  Vector       difference;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    difference[axis] = volume.indexToPhysical.offset[axis] - view.offset[axis];
  }
  AffineMap3D map;
  for (unsigned int row = 0; row < 3; ++row)
  {
    const double(&inverse)[3] = physicalToView.rows[row];
    std::copy(std::begin(product.rows[row]), std::end(product.rows[row]), map.matrix[row]);
    map.offset[row] = (inverse[0] * difference[0] + inverse[1] * difference[1]) + inverse[2] * difference[2];
  }
  return map;
}

VolumeView
GetVolumeView(const AffineMap3D & view, const VolumeGrid & volume)
{
  const AffineMap3D indexToView = GetIndexToView(view, volume);
  if (!IsInvertible(indexToView.matrix) || !IsFinite(indexToView.offset))
  {
    std::ostringstream text;
    text << "Transform and the image's axes together must be finite and invertible, but the transform's matrix is\n"
         << ToText(view.matrix) << "its offset " << ToText(view.offset) << ", and the image has spacing "
         << ToText(volume.spacing) << ", its first voxel at " << ToText(volume.indexToPhysical.offset)
         << " and the axes\n"
         << ToText(volume.indexToPhysical.matrix);
    RefuseParameter(text.str());
  }
  return { indexToView, GetColumn(Invert(indexToView.matrix).rows, 2) };
}

/** Throws if the intermediate image would have too many columns or rows. */
void
VerifyIntermediateSize(const Factorization & factorization, const VolumeGrid & volume, unsigned int oversampling)
{
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    // sums of integers can overflow
    const double length =
      oversampling * (static_cast<double>(factorization.size[axis]) + static_cast<double>(factorization.size[2]));
    if (length > std::numeric_limits<std::int32_t>::max())
    {
      std::ostringstream text;
      text << "The intermediate image must have less than 2^31 columns and rows, but an input of size "
           << ToText(volume.size) << " needs " << std::fixed << std::setprecision(0) << length << '.';
      RefuseParameter(text.str());
    }
  }
}

/** Moves \a position by \a fractions of a pixel, in 1/2^15. */
SamplingPosition
Shift(const SamplingPosition & position, std::int32_t fractions)
{
  const std::int32_t fraction = position.fraction + fractions;
  return { position.whole + (fraction >> FractionBits), fraction & (One - 1) };
}

/** Slices of columns x rows voxels. Voxel (0, 0) of the first slice is the volume's voxel at `corner`. */
struct SliceStack
{
  Corner       corner;
  std::int32_t columns, rows;
};

/** Writes the size of an image that holds the slices, and the columns of each row that they reach. */
void
FindReached(IntermediateGrid & grid, const SliceStack & stack)
{
  const auto columnShift = static_cast<std::int32_t>(stack.corner.column - grid.begin.column);
  const auto rowShift = static_cast<std::int32_t>(stack.corner.row - grid.begin.row);
  for (const SlicePlacement & placement : grid.placements)
  {
    grid.columns = std::max<std::ptrdiff_t>(grid.columns, placement.FirstColumn() + columnShift + stack.columns);
    grid.rows = std::max<std::ptrdiff_t>(grid.rows, placement.FirstRow() + rowShift + stack.rows);
  }

  // places are monotonic in the slice: slices [first, last) reach a row, and their columns are one span
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
    while (first < last && getRow(first) + stack.rows <= row)
    {
      ++first;
    }
    const bool isReached = first < last;
    grid.reached.push_back({ isReached ? std::min(getColumn(first), getColumn(last - 1)) : 0,
                             isReached ? std::max(getColumn(first), getColumn(last - 1)) + stack.columns : 0 });
  }
}

/** One axis of the view plane in all views. */
struct FittedAxis
{
  double lower{ Infinity }, upper{ -Infinity };
  double shortestStep{ Infinity }, longestStep{ 0.0 };
  double rest{ 0.0 };
  double spacing{ Infinity };
};

/** Returns the spacing that makes a voxel's step a whole number of pixels if it is near \a spacing, else \a spacing. */
double
RoundSpacing(const FittedAxis & fitted, double spacing)
{
  const double pixels = std::round(fitted.longestStep / spacing);
  const double rounded = fitted.longestStep / pixels;
  const double difference = std::max(std::abs(rounded - spacing), std::abs(fitted.shortestStep / pixels - spacing));
  // equal spacings keep their bits
  return difference > 1e-9 * spacing && difference <= 1e-3 * spacing ? rounded : spacing;
}

/** Fits one axis of a grid. */
void
FitAxis(PictureGrid & grid, unsigned int axis, const FittedAxis & fitted, bool fitSize, bool fitSpacing, bool fitOrigin)
{
  double & spacing = grid.spacing[axis];
  spacing = fitSpacing ? fitted.spacing : spacing;
  // in each view, one axis of the volume lies along this axis
  const bool isAlong = fitted.rest <= 1e-2 * spacing;
  spacing = fitSpacing && isAlong ? RoundSpacing(fitted, spacing) : spacing;
  // an extent that exceeds whole pixels by rounding errors only needs no further pixel
  const double tolerance = isAlong ? 1e-2 : 1e-4;
  const double start = fitOrigin ? fitted.lower : grid.origin[axis] - 0.5 * spacing;
  const double size = std::max(1.0, std::ceil((fitted.upper - start) / spacing - tolerance));
  grid.size[axis] = fitSize ? size : grid.size[axis];
  if (fitOrigin)
  {
    grid.origin[axis] = 0.5 * (fitted.lower + fitted.upper) - 0.5 * (grid.size[axis] - 1.0) * spacing;
  }
}
} // namespace

void
VerifyVolumeGrid(const VolumeGrid & volume)
{
  std::ostringstream text;
  if (!(volume.size[0] > 0 && volume.size[1] > 0 && volume.size[2] > 0))
  {
    text << "The input must not be empty, but its size is " << ToText(volume.size) << '.';
    RefuseParameter(text.str());
  }
  const double(&spacing)[3] = volume.spacing;
  if (!IsFinite(spacing) || !(spacing[0] > 0.0 && spacing[1] > 0.0 && spacing[2] > 0.0))
  {
    text << "The input's spacing must be positive and finite, but it is " << ToText(spacing) << '.';
    RefuseParameter(text.str());
  }
  if (!IsFinite(volume.indexToPhysical.offset))
  {
    text << "The input's origin must be finite, but its first voxel is at " << ToText(volume.indexToPhysical.offset)
         << '.';
    RefuseParameter(text.str());
  }
}

void
VerifyPictureGrid(const PictureGrid & picture, bool fitSpacing)
{
  std::ostringstream text;
  if (!fitSpacing && !(IsFinite(picture.spacing) && picture.spacing[0] > 0.0 && picture.spacing[1] > 0.0))
  {
    text << "OutputSpacing must be positive and finite, but it is " << ToText(picture.spacing) << '.';
    RefuseParameter(text.str());
  }
  if (!IsFinite(picture.origin))
  {
    text << "OutputOrigin must be finite, but it is " << ToText(picture.origin) << '.';
    RefuseParameter(text.str());
  }
}

void
VerifyView(const AffineMap3D & view)
{
  std::ostringstream text;
  const double(&offset)[3] = view.offset;
  const double squaredNorm = (offset[0] * offset[0] + offset[1] * offset[1]) + offset[2] * offset[2];
  if (!IsFiniteMatrix(view.matrix) || !std::isfinite(squaredNorm))
  {
    text << "Transform must be finite, but its matrix is\n"
         << ToText(view.matrix) << "and its offset " << ToText(offset) << '.';
    RefuseParameter(text.str());
  }
  if (!IsInvertible(view.matrix))
  {
    text << "Transform must be invertible, but the determinant of its matrix\n"
         << ToText(view.matrix) << "is " << GetDeterminant(view.matrix) << '.';
    RefuseParameter(text.str());
  }
}

Factorization
Factorize(const AffineMap3D & view, const VolumeGrid & volume, unsigned int oversampling)
{
  const auto [indexToView, ray] = GetVolumeView(view, volume);
  unsigned int principalAxis = 2;
  for (const unsigned int axis : { 1, 0 })
  {
    principalAxis = std::abs(ray[axis]) > AxisTie * std::abs(ray[principalAxis]) ? axis : principalAxis;
  }

  Factorization factorization{};
  factorization.permutation[0] = principalAxis == 0 ? 1 : 0;
  factorization.permutation[1] = principalAxis == 2 ? 1 : 2;
  factorization.permutation[2] = principalAxis;
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int column = 0; column < 3; ++column)
    {
      factorization.indexToView.matrix[row][column] = indexToView.matrix[row][factorization.permutation[column]];
    }
    factorization.indexToView.offset[row] = indexToView.offset[row];
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    factorization.size[axis] = volume.size[factorization.permutation[axis]];
  }
  VerifyIntermediateSize(factorization, volume, oversampling);
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    const double shear = -ray[factorization.permutation[axis]] / ray[principalAxis];
    factorization.shear[axis] = shear;
    factorization.translation[axis] = shear < 0 ? -shear * static_cast<double>(factorization.size[2] - 1) : 0.0;
  }
  return factorization;
}

std::vector<SlicePlacement>
PlaceSlices(const Factorization & factorization, std::ptrdiff_t first, std::ptrdiff_t count)
{
  std::vector<SlicePlacement> placements;
  placements.reserve(static_cast<std::size_t>(count));
  for (std::ptrdiff_t k = first; k < first + count; ++k)
  {
    const auto place = [&factorization, k](unsigned int axis) {
      return QuantizePosition(factorization.shear[axis] * static_cast<double>(k) + factorization.translation[axis]);
    };
    const SlicePlacement placement{ place(0), place(1) };
    const SlicePlacement nearest{ { placement.FirstColumn(), 0 }, { placement.FirstRow(), 0 } };
    placements.push_back(factorization.isNearest ? nearest : placement);
  }
  return placements;
}

std::vector<IntermediateGrid>
MakePhases(const Factorization & factorization, const VoxelBox & part, unsigned int oversampling)
{
  const auto & [i, j, k] = factorization.permutation;
  const SliceStack stack{ { part.begin[i], part.begin[j], part.begin[k] },
                          static_cast<std::int32_t>(part.size[i]),
                          static_cast<std::int32_t>(part.size[j]) };
  const auto       placements = PlaceSlices(factorization, part.begin[k], part.size[k]);
  const auto &     front = placements.front();
  const auto &     back = placements.back();
  const Corner     begin{ stack.corner.column + std::min(front.column.whole, back.column.whole),
                      stack.corner.row + std::min(front.row.whole, back.row.whole),
                      stack.corner.slice };

  std::vector<IntermediateGrid> phases;
  std::ptrdiff_t                columns = 0;
  std::ptrdiff_t                rows = 0;
  const auto                    steps = static_cast<std::int32_t>(oversampling);
  for (std::int32_t n = 0; n < steps * steps; ++n)
  {
    const auto       getShift = [steps](std::int32_t phase) { return (steps - 1 - phase) * (One / steps); };
    IntermediateGrid phase{ 0, 0, placements, {}, begin };
    for (SlicePlacement & placement : phase.placements)
    {
      placement = { Shift(placement.column, getShift(n % steps)), Shift(placement.row, getShift(n / steps)) };
    }
    FindReached(phase, stack);
    columns = std::max(columns, phase.columns);
    rows = std::max(rows, phase.rows);
    phases.push_back(std::move(phase));
  }
  for (IntermediateGrid & phase : phases)
  {
    phase.columns = columns;
    phase.rows = rows;
    phase.reached.resize(static_cast<std::size_t>(rows), { 0, 0 });
  }
  return phases;
}

VoxelBox
GetWholeBox(const VolumeGrid & volume)
{
  return { { 0, 0, 0 }, { volume.size[0], volume.size[1], volume.size[2] } };
}

std::vector<SlicePlacement>
PlacePart(const IntermediateGrid & grid, const Corner & corner, std::ptrdiff_t slices)
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

AffineMap3D
GetShearedToView(const Factorization & factorization)
{
  AffineMap3D map = factorization.indexToView;
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      map.matrix[row][2] -= factorization.shear[axis] * factorization.indexToView.matrix[row][axis];
      map.offset[row] -= factorization.translation[axis] * factorization.indexToView.matrix[row][axis];
    }
  }
  return map;
}

ShearedFunction
GetShearedFunction(const Factorization & factorization, const double (&ofView)[4])
{
  const AffineMap3D map = GetShearedToView(factorization);
  const auto        get = [&ofView](double u, double v, double w, double one) {
    return ((u * ofView[0] + v * ofView[1]) + w * ofView[2]) + one * ofView[3];
  };
  const auto getSlope = [&](unsigned int axis) {
    return get(map.matrix[0][axis], map.matrix[1][axis], map.matrix[2][axis], 0.0);
  };
  return { getSlope(0), getSlope(1), getSlope(2), get(map.offset[0], map.offset[1], map.offset[2], 1.0) };
}

ShearedFunction
GetDepthFunction(const Factorization & factorization)
{
  return GetShearedFunction(factorization, { 0.0, 0.0, 1.0, 0.0 });
}

ShearedFunction
GetFunctionOfPhase(ShearedFunction function, unsigned int oversampling, std::size_t phase)
{
  const auto shift = [oversampling](std::size_t n) { return static_cast<double>(n + 1) / oversampling - 1.0; };
  function.constant = function(shift(phase % oversampling), shift(phase / oversampling), 0.0);
  return function;
}

AffineMap2D
GetOutputToIntermediate(const Factorization & factorization, const PictureGrid & picture, unsigned int oversampling)
{
  const AffineMap3D view = GetShearedToView(factorization);
  const double      warp[3][3] = { { view.matrix[0][0], view.matrix[0][1], view.offset[0] },
                                   { view.matrix[1][0], view.matrix[1][1], view.offset[1] },
                                   { 0.0, 0.0, 1.0 } };
  const double      outputToView[3][3] = { { picture.spacing[0], 0.0, picture.origin[0] },
                                           { 0.0, picture.spacing[1], picture.origin[1] },
                                           { 0.0, 0.0, 1.0 } };
  const double      scale = oversampling;
  const double      shearedToIntermediate[3][3] = { { scale, 0.0, scale - 1.0 },
                                                    { 0.0, scale, scale - 1.0 },
                                                    { 0.0, 0.0, 1.0 } };
  const Matrix      map = Multiply(Multiply(shearedToIntermediate, Invert(warp).rows).rows, outputToView);
  if (!IsFiniteMatrix(map.rows))
  {
    std::ostringstream text;
    text << "Transform and output grid must be within the range of numbers, but the warp is\n"
         << ToText(warp) << "and the output's spacing " << ToText(picture.spacing) << ", origin "
         << ToText(picture.origin) << '.';
    RefuseParameter(text.str());
  }
  const auto & [x, y, last] = map.rows;
  return { x[0], x[1], x[2], y[0], y[1], y[2] };
}

ViewBounds
FindBounds(const AffineMap3D & view, const VolumeGrid & volume)
{
  const AffineMap3D indexToView = GetVolumeView(view, volume).indexToView;
  ViewBounds        bounds{};
  for (unsigned int row = 0; row < 3; ++row)
  {
    double center = indexToView.offset[row];
    double halfExtent = 0.0;
    double longest = 0.0;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const auto   count = static_cast<double>(volume.size[axis]);
      const double step = std::abs(indexToView.matrix[row][axis]);
      center += indexToView.matrix[row][axis] * 0.5 * (count - 1.0);
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

void
ProjectSpacing(const AffineMap3D & view, const VolumeGrid & volume, double (&projected)[2])
{
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    projected[axis] =
      *std::min_element(std::begin(volume.spacing), std::end(volume.spacing)) / GetNorm(GetColumn(view.matrix, axis));
  }
}

PictureGrid
FitGrid(const std::vector<AffineMap3D> & views,
        const VolumeGrid &               volume,
        const PictureGrid &              given,
        bool                             fitSize,
        bool                             fitSpacing,
        bool                             fitOrigin)
{
  FittedAxis axes[2];
  for (const AffineMap3D & view : views)
  {
    const ViewBounds bounds = FindBounds(view, volume);
    double           spacing[2];
    ProjectSpacing(view, volume, spacing);
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      FittedAxis & fitted = axes[axis];
      fitted.lower = std::min(fitted.lower, bounds.lower[axis]);
      fitted.upper = std::max(fitted.upper, bounds.upper[axis]);
      fitted.shortestStep = std::min(fitted.shortestStep, bounds.step[axis]);
      fitted.longestStep = std::max(fitted.longestStep, bounds.step[axis]);
      fitted.rest = std::max(fitted.rest, bounds.rest[axis]);
      fitted.spacing = std::min(fitted.spacing, spacing[axis]);
    }
  }
  PictureGrid grid = given;
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    FitAxis(grid, axis, axes[axis], fitSize, fitSpacing, fitOrigin);
  }
  if (!(IsFinite(grid.spacing) && grid.spacing[0] > 0.0 && grid.spacing[1] > 0.0 && IsFinite(grid.origin)))
  {
    std::ostringstream text;
    text << "The output's grid must be finite, but its spacing is " << ToText(grid.spacing) << " and its origin "
         << ToText(grid.origin) << '.';
    RefuseParameter(text.str());
  }
  return grid;
}

DepthRange
ClipDepths(const AffineMap3D & view, const VolumeGrid & volume, const DepthRange & slab)
{
  const ViewBounds bounds = FindBounds(view, volume);
  const double     lower = bounds.lower[2];
  const double     upper = bounds.upper[2];
  DepthRange       depths{ std::max(lower, slab.nearest), std::min(upper, slab.farthest) };
  if (!(depths.nearest < depths.farthest))
  {
    // a slab without thickness, or beside the volume
    depths.nearest = std::isfinite(slab.nearest) ? slab.nearest : slab.farthest;
    depths.farthest = std::isfinite(slab.farthest) ? slab.farthest : slab.nearest;
    const double missing = (upper - lower) * 1e-3 - (depths.farthest - depths.nearest);
    depths.nearest -= 0.5 * std::max(missing, 0.0);
    depths.farthest += 0.5 * std::max(missing, 0.0);
  }
  const double thickness = depths.farthest - depths.nearest;
  if (!(thickness > 0.0 && std::isfinite(thickness)))
  {
    std::ostringstream text;
    text << "SlabNear and SlabFar must be within the range of the output's geometry, but they are " << slab.nearest
         << " and " << slab.farthest << '.';
    RefuseParameter(text.str());
  }
  return depths;
}

double
FindSphereDepth(const AffineMap3D & view, const VolumeGrid & volume)
{
  const AffineMap3D indexToView = GetVolumeView(view, volume).indexToView;
  double            center = indexToView.offset[2];
  Vector            halfEdges;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    center += indexToView.matrix[2][axis] * 0.5 * (static_cast<double>(volume.size[axis]) - 1.0);
    halfEdges[axis] = 0.5 * static_cast<double>(volume.size[axis]);
  }
  // four diagonals: axes need not be at right angles
  double radius = 0.0;
  for (const double signY : { -1.0, 1.0 })
  {
    for (const double signZ : { -1.0, 1.0 })
    {
      Vector halfDiagonal;
      for (unsigned int row = 0; row < 3; ++row)
      {
        const double(&axes)[3] = volume.indexToPhysical.matrix[row];
        halfDiagonal[row] =
          (axes[0] * halfEdges[0] + axes[1] * (signY * halfEdges[1])) + axes[2] * (signZ * halfEdges[2]);
      }
      radius = std::max(radius, GetNorm(halfDiagonal));
    }
  }
  // how fast the depth changes along physical space
  const Matrix physicalToView = Invert(view.matrix);
  const double(&slope)[3] = physicalToView.rows[2];
  return center - GetNorm({ slope[0], slope[1], slope[2] }) * radius;
}

AffineMap3D
MakePictureSpace(const AffineMap3D & view, const PictureGrid & picture)
{
  AffineMap3D space = view;
  for (unsigned int row = 0; row < 3; ++row)
  {
    const double(&axes)[3] = view.matrix[row];
    space.offset[row] = (axes[0] * picture.origin[0] + axes[1] * picture.origin[1]) + view.offset[row];
    space.matrix[row][0] *= picture.spacing[0];
    space.matrix[row][1] *= picture.spacing[1];
  }
  return space;
}

SliceGeometry
MakeSliceGeometry(const AffineMap3D & view, const PictureGrid & picture, const DepthRange & depths)
{
  const double  steps[] = { picture.spacing[0], picture.spacing[1], depths.farthest - depths.nearest };
  const double  middle = 0.5 * (depths.nearest + depths.farthest);
  SliceGeometry slice;
  for (unsigned int row = 0; row < 3; ++row)
  {
    const double(&axes)[3] = view.matrix[row];
    slice.origin[row] =
      ((axes[0] * picture.origin[0] + axes[1] * picture.origin[1]) + axes[2] * middle) + view.offset[row];
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const Vector column = GetColumn(view.matrix, axis);
    const double length = GetNorm(column);
    slice.spacing[axis] = steps[axis] * length;
    for (unsigned int row = 0; row < 3; ++row)
    {
      slice.direction[row][axis] = column[row] / length;
    }
  }
  return slice;
}
} // namespace itk::ShearWarp
