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
#include "DicomPet.h"
#include "DicomAttribute.h"

#include "itkMatrix.h"

#include <algorithm>
#include <cmath>
#include <utility>

using VectorType = itk::Vector<double, 3>;
using MatrixType = itk::Matrix<double, 3, 3>;

const std::vector<std::uint32_t> petAttributes = {
  // series
  0x00080021,
  0x00080031,
  0x00180071,
  0x00180073,
  0x00180074,
  0x00180075,
  0x00181100,
  0x00181120,
  0x00181121,
  0x00181147,
  0x00181149,
  0x00181180,
  0x00181181,
  0x00181210,
  0x00280051,
  0x00540013,
  0x00540202,
  0x00541001,
  0x00541002,
  0x00541006,
  0x00541100,
  0x00541101,
  0x00541102,
  0x00541103,
  0x00541104,
  0x00541105,
  0x00541200,
  0x00541201,
  0x00541202,
  0x00541203,
  0x00541210,
  0x00541220,
  // isotope and orientation
  0x00180026,
  0x00540016,
  0x00540410,
  0x00540414,
  // image
  0x00080022,
  0x00080032,
  0x00181242,
  0x00541300,
  0x00541321,
  0x00541322
};

const std::vector<std::uint32_t> petType2 = { 0x00080022, 0x00080032, 0x00181181, 0x00181242,
                                              0x00280051, 0x00540016, 0x00540410, 0x00540414 };

namespace
{
VectorType
GetNormal(const PicturePlane & plane)
{
  return itk::CrossProduct(plane.right, plane.down);
}

/** Columns are the directions of rows, columns and the normal. */
MatrixType
GetAxes(const PicturePlane & plane)
{
  const VectorType normal = GetNormal(plane);
  MatrixType       axes;
  for (unsigned int row = 0; row < 3; ++row)
  {
    axes(row, 0) = plane.right[row];
    axes(row, 1) = plane.down[row];
    axes(row, 2) = normal[row];
  }
  return axes;
}

/** The axis about which pictures turn, from the first to the one that is turned farthest; 0 if none is turned. */
VectorType
FindAxis(const std::vector<PicturePlane> & planes)
{
  VectorType axis(0.0);
  double     farthest = 1e-9;
  for (const PicturePlane & plane : planes)
  {
    // R + R^T + (1 - trace R) I is 2 (1 - cos(angle)) times the outer product of the axis with itself
    const MatrixType turn = GetAxes(plane) * MatrixType(GetAxes(planes.front()).GetTranspose());
    const double     trace = turn(0, 0) + turn(1, 1) + turn(2, 2);
    for (unsigned int column = 0; column < 3 && 3.0 - trace > farthest; ++column)
    {
      VectorType candidate;
      for (unsigned int row = 0; row < 3; ++row)
      {
        candidate[row] = turn(row, column) + turn(column, row) + (row == column ? 1.0 - trace : 0.0);
      }
      axis = candidate.GetNorm() > axis.GetNorm() ? candidate : axis;
    }
    farthest = std::max(farthest, 3.0 - trace);
  }
  return axis.GetNorm() > 0.0 ? axis / axis.GetNorm() : axis;
}

/** The point in which the normals of both meet best. */
itk::Point<double, 3>
FindMeetingPoint(const PicturePlane & one, const PicturePlane & other)
{
  const VectorType normal = GetNormal(other);
  const VectorType across = normal - (normal * GetNormal(one)) * GetNormal(one);
  const double     square = across.GetSquaredNorm();
  return square > 1e-12 ? other.center - normal * (((other.center - one.center) * across) / square) : one.center;
}
} // namespace

const std::string petImageStorage = "1.2.840.10008.5.1.4.1.1.128";

gdcm::DataSet
ReadFirstAcquired(const std::vector<std::filesystem::path> & files)
{
  const auto getTime = [](const std::filesystem::path & file) {
    const gdcm::DataSet image = ReadHeader(file);
    return GetText(image, { 0x0008, 0x0022 }) + GetText(image, { 0x0008, 0x0032 });
  };
  std::pair<std::string, std::filesystem::path> first(getTime(files.front()), files.front());
  for (const auto & file : files)
  {
    first = std::min(first, { getTime(file), file });
  }
  return ReadHeader(first.second);
}

std::string
FindMissingPetAttribute(const gdcm::DataSet & source)
{
  // the last one only where decay is corrected
  std::vector<std::uint32_t> type1 = { 0x00080021, 0x00080031, 0x00541001, 0x00541002,
                                       0x00541102, 0x00541300, 0x00541321 };
  if (GetText(source, { 0x0054, 0x1102 }) == "NONE")
  {
    type1.pop_back();
  }
  const auto missing = std::find_if(
    type1.begin(), type1.end(), [&](std::uint32_t tag) { return GetText(source, gdcm::Tag(tag)).empty(); });
  return missing == type1.end() ? "" : Describe(gdcm::Tag(*missing));
}

std::string
FindReprojectionObstacle(const std::vector<PicturePlane> & planes, double tolerance)
{
  const PicturePlane & first = planes.front();
  const PicturePlane & last = planes.back();
  const double         direction = last.angle - first.angle;
  if (std::any_of(planes.begin(), planes.end(), [](const PicturePlane & plane) { return std::isnan(plane.angle); }))
  {
    return "the views are no turn";
  }
  if (!(std::abs(direction) < 360.0) ||
      std::adjacent_find(planes.begin(), planes.end(), [&](const PicturePlane & one, const PicturePlane & next) {
        return !((next.angle - one.angle) * direction > 0.0);
      }) != planes.end())
  {
    return "the views do not turn one way, once at most";
  }

  const VectorType     axis = FindAxis(planes);
  const VectorType     axisInView = MatrixType(GetAxes(first).GetTranspose()) * axis;
  const PicturePlane & across =
    *std::max_element(planes.begin(), planes.end(), [&](const auto & one, const auto & two) {
      return std::abs(GetNormal(one) * GetNormal(first)) > std::abs(GetNormal(two) * GetNormal(first));
    });
  const auto point = FindMeetingPoint(first, across);
  for (const PicturePlane & plane : planes)
  {
    if (!((MatrixType(GetAxes(plane).GetTranspose()) * axis - axisInView).GetNorm() < 1e-6))
    {
      return "the views do not turn about one axis";
    }
    if (!(std::abs(GetNormal(plane) * axis) < 1e-6))
    {
      return "the views are not at right angles to the axis";
    }
    if (!(itk::CrossProduct(point - plane.center, GetNormal(plane)).GetNorm() <= tolerance))
    {
      return "the pictures' middles are not on the axis";
    }
  }
  return "";
}
