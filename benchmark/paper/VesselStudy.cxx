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
#include "VesselStudy.h"

#include "SphereStudy.h"
#include "Table.h"
#include "Views.h"

#include "itkImageFileWriter.h"
#include "itkImageRegionIteratorWithIndex.h"
#include "itkMath.h"

#include <cmath>
#include <sstream>
#include <utility>

namespace itk::ShearWarpBenchmark
{
namespace
{
using PointType = Vessel::PointType;
using VectorType = Vessel::VectorType;

constexpr SizeValueType VolumeLength = 64;     // voxels
constexpr SizeValueType PictureLength = 64;    // pixels
constexpr double        HalfLength = 20.0;     // mm of the vessel, in the pictures
constexpr double        StenosisLength = 24.0; // mm

constexpr const char * TurnNames[] = { "grid", "vessel" };
constexpr const char * ProfileNames[] = { "uniform", "parabolic" };
constexpr const char * DigitizationNames[] = { "point-sampled", "partial-volume" };

PointType
GetCentre()
{
  return PointType(0.5 * static_cast<double>(VolumeLength - 1));
}

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
  return { GetCentre() + offset, GetDirection(setting.tilt), setting.radius, StenosisLength, setting.profile };
}

VolumeType::Pointer
MakeVolume(const VesselSetting & setting)
{
  return Digitize(MakeVessel(setting), Size<3>{ { VolumeLength, VolumeLength, VolumeLength } }, setting.digitization);
}

/** From view space, its origin the volume's centre and v the axis of the turn, to physical space. */
ViewTransformType::Pointer
MakeView(const VesselSetting & setting, double angle)
{
  const auto transform = ViewTransformType::New();
  VectorType axis = GetDirection(0.0);
  if (setting.turn == Turn::Vessel)
  {
    const VectorType vesselAxis = GetDirection(setting.tilt);
    transform->Rotate3D(CrossProduct(axis, vesselAxis), setting.tilt * Math::pi_over_180);
    axis = vesselAxis;
  }
  transform->Rotate3D(axis, angle * Math::pi_over_180);
  transform->SetOffset(GetCentre().GetVectorFromOrigin());
  return transform;
}

void
ProjectTruth(const Vessel & vessel, const ViewTransformType * view, VesselPictures & pictures)
{
  constexpr double ahead[] = { 0.0, 0.0, 1.0 };
  const VectorType w = view->TransformVector(VectorType(ahead));
  pictures.truth = MakePicture(PictureLength, 1.0);
  for (ImageRegionIteratorWithIndex<PictureType> pixel(pictures.truth, pictures.truth->GetBufferedRegion());
       !pixel.IsAtEnd();
       ++pixel)
  {
    Point<double, 2> position;
    pictures.truth->TransformIndexToPhysicalPoint(pixel.GetIndex(), position);
    const double    coordinates[] = { position[0], position[1], 0.0 };
    const PointType start = view->TransformPoint(PointType(coordinates));
    const double    maximum = vessel.GetMaximum(start, w);
    pixel.Set(static_cast<float>(maximum));
    if (maximum > 0.0 && std::abs(vessel.GetPosition(vessel.GetNearestPoint(start, w))) <= HalfLength)
    {
      pictures.object.push_back(static_cast<SizeValueType>(pictures.truth->ComputeOffset(pixel.GetIndex())));
    }
  }
}

VesselPictures
ProjectVessel(const VesselSetting & setting, const VolumeType * volume, double angle)
{
  const auto     view = MakeView(setting, angle);
  VesselPictures pictures;
  ProjectTruth(MakeVessel(setting), view, pictures);
  pictures.rayCasting = ProjectByRayCasting(volume, view, 1.0, pictures.truth);
  pictures.fineRayCasting = ProjectByRayCasting(volume, view, 0.5, pictures.truth);
  pictures.shearWarp = ProjectByShearWarp(volume, view, 1, pictures.truth);
  pictures.oversampled = ProjectByShearWarp(volume, view, 2, pictures.truth);
  pictures.exactRays = ProjectExactRays(volume, view, 1, pictures.truth);
  return pictures;
}

/** The voxels of the plane through the vessel's axis that holds the x direction too, the axis upright. */
PictureType::Pointer
MakeSection(const VolumeType * volume, const VectorType & along)
{
  constexpr double spacing = 0.25;
  const auto       section = MakePicture(static_cast<SizeValueType>(2.0 * HalfLength / spacing), spacing);
  constexpr double x[] = { 1.0, 0.0, 0.0 };
  VectorType       across = VectorType(x) - along * along[0];
  across.Normalize();
  for (ImageRegionIteratorWithIndex<PictureType> pixel(section, section->GetBufferedRegion()); !pixel.IsAtEnd();
       ++pixel)
  {
    Point<double, 2> position;
    section->TransformIndexToPhysicalPoint(pixel.GetIndex(), position);
    const PointType point = GetCentre() + across * position[0] + along * position[1];
    pixel.Set(volume->GetPixel(volume->TransformPhysicalPointToIndex(point)));
  }
  return section;
}

std::vector<VesselSetting>
GetSettings()
{
  constexpr std::pair<Turn, double> turnsAndTilts[] = { { Turn::Grid, 0.0 },  { Turn::Grid, 30.0 },
                                                        { Turn::Grid, 45.0 }, { Turn::Grid, 60.0 },
                                                        { Turn::Grid, 70.0 }, { Turn::Vessel, 30.0 } };
  std::vector<VesselSetting>        settings;
  for (const auto & [turn, tilt] : turnsAndTilts)
  {
    for (const auto profile : { Vessel::Profile::Uniform, Vessel::Profile::Parabolic })
    {
      for (const auto digitization : { Digitization::PointSampled, Digitization::PartialVolume })
      {
        for (const double radius : { 2.0, 3.0, 4.0, 6.0 })
        {
          for (unsigned int offset = 0; offset < 4; ++offset)
          {
            settings.push_back({ turn, tilt, profile, digitization, radius, offset });
          }
        }
      }
    }
  }
  return settings;
}

double
GetMean(const PictureType * picture, const std::vector<SizeValueType> & pixels)
{
  double sum = 0.0;
  for (const SizeValueType pixel : pixels)
  {
    sum += picture->GetBufferPointer()[pixel];
  }
  return sum / static_cast<double>(pixels.size());
}

/** The lines of one setting. */
std::string
DescribeErrors(const VesselSetting & setting)
{
  const auto         volume = MakeVolume(setting);
  std::ostringstream lines;
  for (int angle = 0; angle <= 180; angle += 10)
  {
    const VesselPictures pictures = ProjectVessel(setting, volume, angle);
    const auto           describe = [&](const char * method, const PictureType * picture) {
      const Errors errors = Compare(picture, pictures.truth, pictures.object);
      lines << TurnNames[static_cast<int>(setting.turn)] << ',' << setting.tilt << ','
            << ProfileNames[static_cast<int>(setting.profile)] << ','
            << DigitizationNames[static_cast<int>(setting.digitization)] << ',' << setting.radius << ','
            << setting.offset << ',' << angle << ',' << pictures.object.size() << ','
            << 100.0 * GetMean(pictures.truth, pictures.object) << ',' << method << ',' << 100.0 * errors.meanAbsolute
            << ',' << 100.0 * errors.mean << ',' << 100.0 * errors.rootMeanSquare << '\n';
    };
    describe("ray-casting", pictures.rayCasting);
    describe("ray-casting-half-step", pictures.fineRayCasting);
    describe("shear-warp", pictures.shearWarp);
    describe("shear-warp-oversampled", pictures.oversampled);
    describe("exact-rays", pictures.exactRays);
  }
  return lines.str();
}
} // namespace

VesselPictures
ProjectVessel(const VesselSetting & setting, double angle)
{
  return ProjectVessel(setting, MakeVolume(setting), angle);
}

void
WriteVesselErrors(const std::string & file)
{
  const auto settings = GetSettings();
  WriteTable(file,
             "turn,tilt,profile,digitization,radius,offset,angle,pixels,mean_truth,method,mean_absolute,mean,rms",
             settings.size(),
             [&](SizeValueType n) { return DescribeErrors(settings[n]); });
}

void
WriteVesselPictures(const std::string & folder)
{
  const VesselSetting setting{ Turn::Grid, 60.0, Vessel::Profile::Parabolic, Digitization::PointSampled, 4.0, 0 };
  const auto          pictures = ProjectVessel(setting, 40.0);
  const auto          write = [&](const PictureType * picture, const std::string & name) {
    WriteImage(picture, folder + "/figure6-" + name + ".tif");
  };
  write(MakeSection(MakeVolume(setting), GetDirection(setting.tilt)), "section");
  write(pictures.truth, "truth");
  write(Subtract(pictures.rayCasting, pictures.truth, pictures.object), "ray-casting");
  write(Subtract(pictures.shearWarp, pictures.truth, pictures.object), "shear-warp");
  write(Subtract(pictures.oversampled, pictures.truth, pictures.object), "shear-warp-oversampled");
}
} // namespace itk::ShearWarpBenchmark
