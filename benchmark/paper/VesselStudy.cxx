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

#include "Studies.h"

#include "Data.h"
#include "RayCasting.h"

#include "itkImageFileWriter.h"
#include "itkIndexRange.h"
#include "itkShearWarpMIPImageFilter.h"

#include <fstream>

namespace itk::ShearWarpBenchmark
{
double
Vessel::GetMaximum(const PointType & start, const VectorType & direction) const
{
  const PointType nearest = this->GetNearestPoint(start, direction);
  const double    squaredDistance = Math::sqr(this->GetDistance(nearest));
  const double    position = std::abs(this->GetPosition(nearest));

  // the squared distance grows by this, times the square of the way along the axis
  const double along = direction * m_Direction;
  const double growth = (direction - m_Direction * along).GetSquaredNorm() / (along * along);
  const bool   isAcross = !std::isfinite(growth);
  const auto   getSquaredDistance = [&](double s) { return squaredDistance + growth * Math::sqr(s - position); };

  // squared distance over squared radius has one minimum, where its derivative changes sign
  const double     frequency = Math::twopi / m_StenosisLength;
  double           low = position;
  double           high = isAcross ? position : std::max(position, 0.5 * m_StenosisLength);
  constexpr double tolerance = 1e-12;
  while (high - low > tolerance * m_StenosisLength)
  {
    const double middle = 0.5 * (low + high);
    const double slopeOfRadius = m_Radius * frequency * std::sin(frequency * middle) / 4.0;
    const bool   falls =
      growth * (middle - position) * this->GetRadius(middle) < getSquaredDistance(middle) * slopeOfRadius;
    (falls ? low : high) = middle;
  }
  const double least = isAcross ? squaredDistance : getSquaredDistance(low);
  return std::max(0.0, 1.0 - least / Math::sqr(this->GetRadius(low)));
}

namespace
{
using PointType = Vessel::PointType;
using VectorType = Vessel::VectorType;
using VolumeType = Image<float, 3>;
using PictureType = VesselPictures::PictureType;

constexpr SizeValueType Length = 64;           // voxels and pixels along each side
constexpr double        HalfLength = 20.0;     // mm of the vessel, in the pictures
constexpr double        StenosisLength = 24.0; // mm

const PointType Center(0.5 * (Length - 1.0));

/** The direction of a vessel that is tilted by so many degrees. */
VectorType
GetDirection(double tilt)
{
  constexpr double lean = 30.0 * Math::pi_over_180;
  const double     across = std::sin(tilt * Math::pi_over_180);
  const double     along = std::cos(tilt * Math::pi_over_180);
  const double     direction[] = { across * std::cos(lean), along, across * std::sin(lean) };
  return VectorType(direction);
}

Vessel
MakeVessel(const VesselSetting & setting)
{
  // points that fill a cube evenly, whatever their number
  constexpr double generator[] = { 0.8192, 0.6711, 0.5497 };
  VectorType       offset;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    offset[axis] = std::fmod(setting.offset * generator[axis], 1.0);
  }
  return { Center + offset, GetDirection(setting.tilt), setting.radius, StenosisLength };
}

VolumeType::Pointer
MakeVolume(const VesselSetting & setting)
{
  const Vessel vessel = MakeVessel(setting);
  const auto   volume = VolumeType::New();
  volume->SetRegions(Size<3>::Filled(Length));
  volume->Allocate();
  for (const Index<3> & voxel : ImageRegionIndexRange<3>(volume->GetBufferedRegion()))
  {
    volume->SetPixel(voxel, static_cast<float>(vessel.GetValue(volume->TransformIndexToPhysicalPoint<double>(voxel))));
  }
  return volume;
}

/** A picture whose center is at the origin of view space; sets each pixel to \a getValue(index, u, v). */
template <typename TFunction>
PictureType::Pointer
MakePicture(SizeValueType columns, double spacing, const TFunction & getValue)
{
  const auto picture = PictureType::New();
  picture->SetRegions(Size<2>::Filled(columns));
  picture->SetSpacing(Vector<double, 2>(spacing));
  picture->SetOrigin(Point<double, 2>(-0.5 * spacing * static_cast<double>(columns - 1)));
  picture->Allocate();
  for (const Index<2> & pixel : ImageRegionIndexRange<2>(picture->GetBufferedRegion()))
  {
    const auto position = picture->TransformIndexToPhysicalPoint<double>(pixel);
    picture->SetPixel(pixel, static_cast<float>(getValue(pixel, position[0], position[1])));
  }
  return picture;
}

PictureType::Pointer
MakeEmptyPicture()
{
  return MakePicture(Length, 1.0, [](const Index<2> &, double, double) { return 0.0; });
}

VesselPictures
ProjectVessel(const VesselSetting & setting, const VolumeType * volume, double angle)
{
  const Vessel     vessel = MakeVessel(setting);
  const auto       view = MakeView(volume, { 0.0, -angle, 0.0 });
  constexpr double ahead[] = { 0.0, 0.0, 1.0 };
  const VectorType w = view->TransformVector(VectorType(ahead));
  VesselPictures   pictures;
  pictures.truth = MakePicture(Length, 1.0, [&](const Index<2> & pixel, double u, double v) {
    const double    coordinates[] = { u, v, 0.0 };
    const PointType start = view->TransformPoint(PointType(coordinates));
    const double    maximum = vessel.GetMaximum(start, w);
    if (maximum > 0.0 && std::abs(vessel.GetPosition(vessel.GetNearestPoint(start, w))) <= HalfLength)
    {
      pictures.object.push_back(pixel);
    }
    return maximum;
  });
  const auto castRays = [&](double step) {
    const auto picture = MakeEmptyPicture();
    CastRays<float>(volume, view, step, 0.0F, picture);
    return picture;
  };
  const auto warp = [&](unsigned int oversampling) -> PictureType::Pointer {
    const auto filter = ShearWarpMIPImageFilter<VolumeType>::New();
    filter->SetInput(volume);
    filter->SetTransform(view);
    filter->SetOversampling(oversampling);
    filter->SetSize(Size<2>::Filled(Length));
    filter->SetOutputSpacing(pictures.truth->GetSpacing());
    filter->SetOutputOrigin(pictures.truth->GetOrigin());
    filter->Update();
    return filter->GetOutput();
  };
  pictures.methods = { { "ray-casting", castRays(1.0) },
                       { "ray-casting-half-step", castRays(0.5) },
                       { "shear-warp", warp(1) },
                       { "shear-warp-oversampled", warp(2) } };
  return pictures;
}

void
WriteErrors(std::ostream & out, const VesselSetting & setting)
{
  const auto volume = MakeVolume(setting);
  for (int angle = 0; angle <= 180; angle += 10)
  {
    const VesselPictures pictures = ProjectVessel(setting, volume, angle);
    for (const auto & [name, picture] : pictures.methods)
    {
      out << setting.tilt << ',' << setting.radius << ',' << setting.offset << ',' << angle << ','
          << pictures.object.size() << ',' << name << ',' << 100.0 * pictures.GetError(picture) << '\n';
    }
  }
}
} // namespace

double
VesselPictures::GetError(const PictureType * picture) const
{
  double sum = 0.0;
  for (const Index<2> & pixel : object)
  {
    sum += std::abs(static_cast<double>(picture->GetPixel(pixel)) - truth->GetPixel(pixel));
  }
  return sum / static_cast<double>(object.size());
}

VesselPictures
ProjectVessel(const VesselSetting & setting, double angle)
{
  return ProjectVessel(setting, MakeVolume(setting), angle);
}

void
WriteVesselErrors(const std::string & file)
{
  std::ofstream out(file);
  out << "tilt,radius,offset,angle,pixels,method,error\n";
  for (const double tilt : { 0.0, 30.0, 45.0, 60.0, 70.0 })
  {
    for (const double radius : { 2.0, 3.0, 4.0 })
    {
      for (unsigned int offset = 0; offset < 4; ++offset)
      {
        WriteErrors(out, { tilt, radius, offset });
      }
    }
  }
  if (!out.flush())
  {
    itkGenericExceptionMacro("Cannot write " << file << '.');
  }
}

void
WriteVesselPictures(const std::string & folder)
{
  const VesselSetting setting{ 60.0, 4.0, 0 };
  const auto          volume = MakeVolume(setting);
  const auto          pictures = ProjectVessel(setting, volume, 40.0);
  const auto          write = [&](const PictureType * picture, const std::string & name) {
    WriteImage(picture, folder + "/figure6-" + name + ".tif");
  };

  // the plane through the vessel's axis that holds the x direction too, the axis upright
  constexpr double spacing = 0.25;
  constexpr double x[] = { 1.0, 0.0, 0.0 };
  const VectorType along = GetDirection(setting.tilt);
  VectorType       across = VectorType(x) - along * along[0];
  across.Normalize();
  const auto section = MakePicture(
    static_cast<SizeValueType>(2.0 * HalfLength / spacing), spacing, [&](const Index<2> &, double u, double v) {
      return volume->GetPixel(volume->TransformPhysicalPointToIndex(Center + across * u + along * v));
    });

  write(section, "section");
  write(pictures.truth, "truth");
  for (const std::string name : { "ray-casting", "shear-warp", "shear-warp-oversampled" })
  {
    const auto difference = MakeEmptyPicture();
    for (const Index<2> & pixel : pictures.object)
    {
      difference->SetPixel(pixel, pictures.methods.at(name)->GetPixel(pixel) - pictures.truth->GetPixel(pixel));
    }
    write(difference, name);
  }
}
} // namespace itk::ShearWarpBenchmark
