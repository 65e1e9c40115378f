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

#include <cmath>
#include <limits>
#include <utility>

namespace itk
{
namespace
{
void
VerifyImage(const DataObject * image, const char * name)
{
  if (!image)
  {
    itkGenericExceptionMacro("The " << name << " is required but not set.");
  }
}

ShearWarpFactorization::Matrix3Type
ToMatrix(const double (&rows)[3][3])
{
  return ShearWarpFactorization::Matrix3Type(vnl_matrix_fixed<double, 3, 3>(&rows[0][0]));
}

ShearWarpFactorization::Matrix4Type
ToMatrix(const ShearWarp::AffineMap3D & map)
{
  ShearWarpFactorization::Matrix4Type matrix;
  matrix.SetIdentity();
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int column = 0; column < 3; ++column)
    {
      matrix(row, column) = map.matrix[row][column];
    }
    matrix(row, 3) = map.offset[row];
  }
  return matrix;
}
} // namespace

ShearWarp::AffineMap3D
ShearWarp::MakeView(const Transform<double, 3, 3> * transform)
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
  const auto       offset = transform->TransformPoint(Point<double, 3>(0.0));
  AffineMap3D      view;
  for (unsigned int column = 0; column < 3; ++column)
  {
    Point<double, 3> ahead(0.0);
    Point<double, 3> behind(0.0);
    ahead[column] = step;
    behind[column] = -step;
    const auto difference = transform->TransformPoint(ahead) - transform->TransformPoint(behind);
    for (unsigned int row = 0; row < 3; ++row)
    {
      view.matrix[row][column] = difference[row] / (2 * step);
    }
    view.offset[column] = offset[column];
  }
  CallEngine([&view] { VerifyView(view); });
  return view;
}

ShearWarp::VolumeGrid
ShearWarp::MakeVolumeGrid(const ImageBase<3> * image)
{
  VerifyImage(image, "input image");
  const ImageRegion<3> & region = image->GetLargestPossibleRegion();
  VolumeGrid             volume;
  AffineMap3D &          map = volume.indexToPhysical;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    if (region.GetSize(axis) > static_cast<SizeValueType>(std::numeric_limits<std::ptrdiff_t>::max()))
    {
      itkGenericExceptionMacro("The input must have less than 2^63 voxels along each axis, but its size is "
                               << region.GetSize() << '.');
    }
    if (!std::isfinite(image->GetOrigin()[axis]))
    {
      itkGenericExceptionMacro("The input's origin must be finite, but it is " << image->GetOrigin() << '.');
    }
    volume.size[axis] = static_cast<std::ptrdiff_t>(region.GetSize(axis));
    volume.spacing[axis] = image->GetSpacing()[axis];
    map.offset[axis] = image->GetOrigin()[axis];
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto index = static_cast<double>(region.GetIndex(axis));
    for (unsigned int row = 0; row < 3; ++row)
    {
      map.matrix[row][axis] = image->GetDirection()(row, axis) * image->GetSpacing()[axis];
      map.offset[row] += map.matrix[row][axis] * index;
    }
  }
  return volume;
}

ShearWarp::PictureGrid
ShearWarp::MakePictureGrid(const ImageBase<2> * image)
{
  VerifyImage(image, "output image");
  PictureGrid picture;
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    picture.size[axis] = static_cast<double>(image->GetLargestPossibleRegion().GetSize(axis));
    picture.spacing[axis] = image->GetSpacing()[axis];
    picture.origin[axis] = image->GetOrigin()[axis];
  }
  return picture;
}

ShearWarpFactorization::ShearWarpFactorization(const TransformType *       viewTransform,
                                               const InputImageBaseType *  image,
                                               const OutputImageBaseType * output)
{
  const ShearWarp::AffineMap3D view = ShearWarp::MakeView(viewTransform);
  const ShearWarp::VolumeGrid  volume = ShearWarp::MakeVolumeGrid(image);
  m_Output = ShearWarp::MakePictureGrid(output);
  ShearWarp::CallEngine([&] {
    ShearWarp::VerifyVolumeGrid(volume);
    m_Factorization = ShearWarp::Factorize(view, volume);
    m_Intermediate = std::move(ShearWarp::MakePhases(m_Factorization, ShearWarp::GetWholeBox(volume)).front());
  });
}

unsigned int
ShearWarpFactorization::GetPrincipalAxis() const
{
  return m_Factorization.GetPrincipalAxis();
}

ShearWarpFactorization::PermutationType
ShearWarpFactorization::GetPermutation() const
{
  return PermutationType(m_Factorization.permutation);
}

ShearWarpFactorization::Vector2Type
ShearWarpFactorization::GetShear() const
{
  return Vector2Type(m_Factorization.shear);
}

ShearWarpFactorization::Vector2Type
ShearWarpFactorization::GetTranslation() const
{
  return Vector2Type(m_Factorization.translation);
}

Size<2>
ShearWarpFactorization::GetIntermediateSize() const
{
  return { { static_cast<SizeValueType>(m_Intermediate.columns), static_cast<SizeValueType>(m_Intermediate.rows) } };
}

const std::vector<ShearWarp::SlicePlacement> &
ShearWarpFactorization::GetSlicePlacements() const
{
  return m_Intermediate.placements;
}

const std::vector<ShearWarp::ColumnSpan> &
ShearWarpFactorization::GetReachedColumns() const
{
  return m_Intermediate.reached;
}

ShearWarpFactorization::Matrix4Type
ShearWarpFactorization::GetViewMatrix() const
{
  return ToMatrix(m_Factorization.indexToView);
}

ShearWarpFactorization::Matrix4Type
ShearWarpFactorization::GetShearMatrix() const
{
  const auto & [a, b] = m_Factorization.shear;
  const auto & translation = m_Factorization.translation;
  return ToMatrix(
    ShearWarp::AffineMap3D{ { { 1, 0, a }, { 0, 1, b }, { 0, 0, 1 } }, { translation[0], translation[1], 0 } });
}

ShearWarpFactorization::Matrix3Type
ShearWarpFactorization::GetWarpMatrix() const
{
  const auto & [matrix, offset] = ShearWarp::GetShearedToView(m_Factorization);
  return ToMatrix(
    { { matrix[0][0], matrix[0][1], offset[0] }, { matrix[1][0], matrix[1][1], offset[1] }, { 0.0, 0.0, 1.0 } });
}

ShearWarpFactorization::Matrix4Type
ShearWarpFactorization::GetShearedToViewMatrix() const
{
  return ToMatrix(ShearWarp::GetShearedToView(m_Factorization));
}

ShearWarpFactorization::Matrix3Type
ShearWarpFactorization::GetOutputToIntermediateMatrix() const
{
  const auto map = ShearWarp::CallEngine([&] { return ShearWarp::GetOutputToIntermediate(m_Factorization, m_Output); });
  return ToMatrix({ { map.xx, map.xy, map.x0 }, { map.yx, map.yy, map.y0 }, { 0.0, 0.0, 1.0 } });
}

void
ShearWarpFactorization::VerifyViewTransform(const TransformType * viewTransform)
{
  ShearWarp::MakeView(viewTransform);
}

ShearWarpFactorization::Matrix3Type
ShearWarpFactorization::GetLinearPart(const TransformType * viewTransform)
{
  return ToMatrix(ShearWarp::MakeView(viewTransform).matrix);
}

void
ShearWarpFactorization::ComputeViewBounds(const TransformType *      viewTransform,
                                          const InputImageBaseType * image,
                                          Point3Type &               lower,
                                          Point3Type &               upper)
{
  const ShearWarp::AffineMap3D view = ShearWarp::MakeView(viewTransform);
  const ShearWarp::VolumeGrid  volume = ShearWarp::MakeVolumeGrid(image);
  const ShearWarp::ViewBounds  bounds = ShearWarp::CallEngine([&] { return ShearWarp::FindBounds(view, volume); });
  lower = Point3Type(bounds.lower);
  upper = Point3Type(bounds.upper);
}

ShearWarpFactorization::Vector2Type
ShearWarpFactorization::ComputeProjectedSpacing(const TransformType * viewTransform, const InputImageBaseType * image)
{
  const ShearWarp::AffineMap3D view = ShearWarp::MakeView(viewTransform);
  double                       projected[2];
  ShearWarp::ProjectSpacing(view, ShearWarp::MakeVolumeGrid(image), projected);
  return Vector2Type(projected);
}
} // namespace itk
