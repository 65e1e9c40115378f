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
#include "SphereStudy.h"

#include "Rays.h"
#include "Table.h"
#include "TrilinearInterpolator.h"

#include "itkImageRegionIteratorWithIndex.h"
#include "itkMath.h"
#include "itkShearWarpFactorization.h"
#include "itkShearWarpMIPView.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <sstream>

namespace itk::ShearWarpBenchmark
{
namespace
{
constexpr unsigned int DenseSamplesPerSlice = 16;

constexpr const char * MethodNames[] = { "exact",      "dense-rays", "ray-casting",
                                         "one-sample", "shear-warp", "shear-warp-oversampled" };
constexpr std::size_t  NumberOfMethods = std::size(MethodNames);

struct View
{
  double azimuth;
  double elevation;
};

/** The pictures of one view, in the order of the methods' names. */
struct Pictures
{
  unsigned int                                      principalAxis;
  std::array<PictureType::Pointer, NumberOfMethods> methods;
  std::vector<SizeValueType>                        pixels;
};

/** A volume and all that is the same for its views. */
class Study
{
public:
  Study(const VolumeType * volume, unsigned int coarseness)
    : m_Volume(volume)
    , m_SmallestSpacing(*std::min_element(volume->GetSpacing().Begin(), volume->GetSpacing().End()))
  {
    const auto size = volume->GetLargestPossibleRegion().GetSize();
    double     squaredDiagonal = 0.0;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      squaredDiagonal += Math::sqr(static_cast<double>(size[axis]) * volume->GetSpacing()[axis]);
    }
    // an even number of columns: where the volume's size is even, rays along its axes run through its voxels
    const auto columns =
      2 * coarseness * Math::Ceil<SizeValueType>(0.5 * std::sqrt(squaredDiagonal) / (m_SmallestSpacing * coarseness));
    m_Grid = MakePicture(columns / coarseness, m_SmallestSpacing * coarseness);
    m_Grid->SetOrigin(MakePicture(columns, m_SmallestSpacing)->GetOrigin());

    const float * begin = volume->GetBufferPointer();
    const auto [least, greatest] =
      std::minmax_element(begin, begin + volume->GetLargestPossibleRegion().GetNumberOfPixels());
    m_Percent = 100.0 / (*greatest - *least);
  }

  /** Percent of the volume's range in one unit of its voxels. */
  double
  GetPercent() const
  {
    return m_Percent;
  }

  unsigned int
  GetPrincipalAxis(const View & view) const
  {
    return ShearWarpFactorization(this->MakeTransform(view), m_Volume, m_Grid).GetPrincipalAxis();
  }

  Pictures
  Project(const View & view) const
  {
    const auto transform = this->MakeTransform(view);
    return { this->GetPrincipalAxis(view),
             { ProjectExactly(m_Volume, transform, m_Grid),
               ProjectExactRays(m_Volume, transform, DenseSamplesPerSlice, m_Grid),
               ProjectByRayCasting(m_Volume, transform, m_SmallestSpacing, m_Grid),
               ProjectExactRays(m_Volume, transform, 1, m_Grid),
               ProjectByShearWarp(m_Volume, transform, 1, m_Grid),
               ProjectByShearWarp(m_Volume, transform, 2, m_Grid) },
             FindCrossingRays(m_Volume, transform, m_Grid) };
  }

private:
  ShearWarpMIPView::TransformType::Pointer
  MakeTransform(const View & view) const
  {
    return ShearWarpMIPView::MakeTransform(
      m_Volume, ShearWarpMIPView::DirectionEnum::Superior, view.azimuth, view.elevation);
  }

  VolumeType::ConstPointer m_Volume;
  double                   m_SmallestSpacing;
  PictureType::Pointer     m_Grid;
  double                   m_Percent;
};

/** Fibonacci's lattice: each direction has the same share of the half sphere of elevations from 0 to 90. */
View
GetDirection(SizeValueType n, unsigned int count)
{
  constexpr double goldenAngle = 137.50776405003785;
  return { std::fmod(static_cast<double>(n) * goldenAngle, 360.0),
           std::asin((static_cast<double>(n) + 0.5) / count) / Math::pi_over_180 };
}

/** Two views on both sides of the switch of the principal axis between two views. */
std::pair<View, View>
FindSwitch(const Study & study, View first, View last)
{
  constexpr double   step = 0.002;
  const unsigned int axis = study.GetPrincipalAxis(first);
  while (last.azimuth - first.azimuth > step / 1000.0)
  {
    const View middle{ 0.5 * (first.azimuth + last.azimuth), first.elevation };
    (study.GetPrincipalAxis(middle) == axis ? first : last) = middle;
  }
  const double azimuth = 0.5 * (first.azimuth + last.azimuth);
  return { { azimuth - 0.5 * step, first.elevation }, { azimuth + 0.5 * step, first.elevation } };
}

std::string
DescribeChange(const Study & study, const View & view, const Pictures & first, double step, const Pictures & next)
{
  std::vector<SizeValueType> pixels;
  std::set_intersection(
    first.pixels.begin(), first.pixels.end(), next.pixels.begin(), next.pixels.end(), std::back_inserter(pixels));
  std::ostringstream lines;
  for (std::size_t method = 0; method < NumberOfMethods; ++method)
  {
    const Errors change = Compare(next.methods[method], first.methods[method], pixels);
    lines << view.elevation << ',' << view.azimuth << ',' << first.principalAxis << ',' << step << ','
          << MethodNames[method] << ',' << study.GetPercent() * change.meanAbsolute << ','
          << study.GetPercent() * change.largest << '\n';
  }
  return lines.str();
}
} // namespace

PictureType::Pointer
ProjectExactRays(const VolumeType *              volume,
                 const Transform<double, 3, 3> * viewTransform,
                 unsigned int                    samplesPerSlice,
                 const PictureType *             grid)
{
  using VectorType = Rays::VectorType;
  const Rays                         rays(volume, viewTransform);
  const TrilinearInterpolator<float> interpolate(*volume);
  const unsigned int principalAxis = ShearWarpFactorization(viewTransform, volume, grid).GetPrincipalAxis();
  const VectorType   direction = rays.GetDirection() / rays.GetDirection()[principalAxis];

  Size<3>          enlarged = volume->GetLargestPossibleRegion().GetSize();
  float            last[3];
  const VectorType halfVoxel(0.5);
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    last[axis] = static_cast<float>(enlarged[axis]) - 1.0f;
    ++enlarged[axis];
  }

  const auto picture = MakePicture(grid);
  for (ImageRegionIteratorWithIndex<PictureType> pixel(picture, picture->GetBufferedRegion()); !pixel.IsAtEnd();
       ++pixel)
  {
    Point<double, 2> position;
    grid->TransformIndexToPhysicalPoint(pixel.GetIndex(), position);
    VectorType start = rays.GetStart(position);
    start -= direction * start[principalAxis];

    const Segment segment = Clip(start + halfVoxel, direction, enlarged);
    float         maximum = -std::numeric_limits<float>::infinity();
    if (!(segment.begin <= segment.end))
    {
      continue;
    }
    const auto first = static_cast<int>(std::ceil(segment.begin * samplesPerSlice - 1e-9));
    const auto end = static_cast<int>(std::floor(segment.end * samplesPerSlice + 1e-9));
    for (int sample = first; sample <= end; ++sample)
    {
      const double slice = static_cast<double>(sample) / samplesPerSlice;
      const auto   coordinate = [&](unsigned int axis) {
        return std::clamp(static_cast<float>(start[axis] + slice * direction[axis]), 0.0f, last[axis]);
      };
      maximum = std::max(maximum, interpolate(coordinate(0), coordinate(1), coordinate(2)));
    }
    pixel.Set(first <= end ? maximum : 0.0f);
  }
  return picture;
}

std::vector<SizeValueType>
FindCrossingRays(const VolumeType * volume, const Transform<double, 3, 3> * viewTransform, const PictureType * grid)
{
  const Rays                 rays(volume, viewTransform);
  std::vector<SizeValueType> pixels;
  for (SizeValueType pixel = 0; pixel < grid->GetLargestPossibleRegion().GetNumberOfPixels(); ++pixel)
  {
    Point<double, 2> position;
    grid->TransformIndexToPhysicalPoint(grid->ComputeIndex(static_cast<OffsetValueType>(pixel)), position);
    const Segment segment =
      Clip(rays.GetStart(position), rays.GetDirection(), volume->GetLargestPossibleRegion().GetSize());
    if (segment.begin <= segment.end)
    {
      pixels.push_back(pixel);
    }
  }
  return pixels;
}

void
WriteSphereErrors(const VolumeType * volume, unsigned int views, unsigned int coarseness, const std::string & file)
{
  const Study study(volume, coarseness);
  WriteTable(file,
             "azimuth,elevation,principal_axis,method,mean_absolute,percentile99,largest,mean,underestimated",
             views,
             [&](SizeValueType n) {
               const View         view = GetDirection(n, views);
               const Pictures     pictures = study.Project(view);
               std::ostringstream lines;
               for (std::size_t method = 1; method < NumberOfMethods; ++method)
               {
                 const Errors errors =
                   Compare(pictures.methods[method], pictures.methods[0], pictures.pixels, 0.1 / study.GetPercent());
                 lines << view.azimuth << ',' << view.elevation << ',' << pictures.principalAxis << ','
                       << MethodNames[method] << ',' << study.GetPercent() * errors.meanAbsolute << ','
                       << study.GetPercent() * errors.percentile99 << ',' << study.GetPercent() * errors.largest << ','
                       << study.GetPercent() * errors.mean << ',' << 100.0 * errors.underestimated << '\n';
               }
               return lines.str();
             });
}

void
WriteJumps(const VolumeType * volume, double degrees, unsigned int coarseness, const std::string & file)
{
  // each part of the turn is a job
  constexpr SizeValueType parts = 9;
  constexpr double        partLength = 90.0 / parts;
  constexpr double        elevations[] = { 0.0, 30.0 };

  const Study study(volume, coarseness);
  WriteTable(file,
             "elevation,azimuth,principal_axis,step,method,mean,largest",
             std::size(elevations) * parts,
             [&](SizeValueType n) {
               const double azimuth = static_cast<double>(n % parts) * partLength;
               View         view{ azimuth, elevations[n / parts] };
               Pictures     pictures = study.Project(view);
               std::string  lines;
               for (int frame = 1; frame * degrees <= partLength + 1e-9; ++frame)
               {
                 const View nextView{ azimuth + frame * degrees, view.elevation };
                 Pictures   next = study.Project(nextView);
                 lines += DescribeChange(study, view, pictures, degrees, next);
                 if (pictures.principalAxis != next.principalAxis)
                 {
                   const auto [before, after] = FindSwitch(study, view, nextView);
                   lines += DescribeChange(
                     study, before, study.Project(before), after.azimuth - before.azimuth, study.Project(after));
                 }
                 view = nextView;
                 pictures = std::move(next);
               }
               return lines;
             });
}
} // namespace itk::ShearWarpBenchmark
