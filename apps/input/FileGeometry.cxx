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
#include "FileGeometry.h"

#include "FileStart.h"
#include "Text.h"

#include "itkMRCHeaderObject.h"
#include "itkMetaDataObject.h"

#include <NrrdIO.h>
#include <nifti1_io.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>

namespace
{
namespace fs = std::filesystem;
using VectorType = itk::Vector<double, 3>;

/** The columns of \a axes, in mm per voxel, as spacing and direction. Throws if they span no volume. */
void
SetAxes(FileGeometry & geometry, const std::array<VectorType, 3> & axes, const fs::path & path)
{
  const double volume = std::abs(axes[0] * itk::CrossProduct(axes[1], axes[2]));
  const double cuboid = axes[0].GetNorm() * axes[1].GetNorm() * axes[2].GetNorm();
  if (!(volume > 1e-6 * cuboid) || !std::isfinite(cuboid))
  {
    throw std::runtime_error("'" + path.string() + "' has no valid directions of its axes: they span no volume");
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    geometry.spacing[axis] = axes[axis].GetNorm();
    for (unsigned int row = 0; row < 3; ++row)
    {
      geometry.direction(row, axis) = axes[axis][row] / geometry.spacing[axis];
    }
  }
}

FileGeometry
GetGeometryOfITK(const itk::ImageIOBase & io)
{
  FileGeometry       geometry;
  const unsigned int dimension = std::min(io.GetNumberOfDimensions(), 3u);
  for (unsigned int axis = 0; axis < dimension; ++axis)
  {
    geometry.origin[axis] = io.GetOrigin(axis);
    geometry.spacing[axis] = io.GetSpacing(axis);
    const std::vector<double> direction = io.GetDirection(axis);
    for (unsigned int row = 0; row < dimension; ++row)
    {
      geometry.direction(row, axis) = direction[row];
    }
  }
  return geometry;
}

void
Scale(FileGeometry & geometry, double factor)
{
  geometry.spacing *= factor;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    geometry.origin[axis] *= factor;
  }
}

double
GetMillimetres(const std::string & unit, const fs::path & path, const WarningFunction & warn)
{
  const auto found = FindMillimetres(unit);
  if (!found && !unit.empty())
  {
    warn("'" + path.string() + "' has lengths in '" + unit.substr(0, 20) + "', which are taken for mm");
  }
  return found.value_or(1.0);
}

using NrrdPointer = std::unique_ptr<Nrrd, decltype(&nrrdNuke)>;

NrrdPointer
LoadNrrdHeader(const fs::path & path)
{
  NrrdPointer                                                   nrrd(nrrdNew(), nrrdNuke);
  const std::unique_ptr<NrrdIoState, decltype(&nrrdIoStateNix)> state(nrrdIoStateNew(), nrrdIoStateNix);
  nrrdIoStateSet(state.get(), nrrdIoStateSkipData, 1);
  if (nrrdLoad(nrrd.get(), path.string().c_str(), state.get()) != 0)
  {
    const std::unique_ptr<char, decltype(&std::free)> error(biffGetDone(NRRD), std::free);
    throw std::runtime_error("cannot read '" + path.string() + "': " + error.get());
  }
  return nrrd;
}

std::string
GetValue(const Nrrd & nrrd, const std::string & key)
{
  const std::unique_ptr<char, decltype(&std::free)> value(nrrdKeyValueGet(&nrrd, key.c_str()), std::free);
  return value ? value.get() : "";
}

/** Whether values of axis \a range are volumes: of a list, or diffusion-weighted, but not layers of 3D Slicer's
 * segments. */
bool
IsSeries(const Nrrd & nrrd, unsigned int range)
{
  return (nrrd.axis[range].kind == nrrdKindList && GetValue(nrrd, "Segment0_ID").empty()) ||
         GetValue(nrrd, "modality") == "DWMRI";
}

/** The signs that turn the coordinates of a space into LPS, and whether the space is the patient's. */
struct NrrdSpace
{
  std::array<double, 3> signs;
  bool                  isPatients;
};

const std::map<int, NrrdSpace> nrrdSpaces = { { nrrdSpaceUnknown, { { { 1, 1, 1 } }, false } },
                                              { nrrdSpaceRightAnteriorSuperior, { { { -1, -1, 1 } }, true } },
                                              { nrrdSpaceLeftAnteriorSuperior, { { { 1, -1, 1 } }, true } },
                                              { nrrdSpaceLeftPosteriorSuperior, { { { 1, 1, 1 } }, true } },
                                              { nrrdSpaceRightAnteriorSuperiorTime, { { { -1, -1, 1 } }, true } },
                                              { nrrdSpaceLeftAnteriorSuperiorTime, { { { 1, -1, 1 } }, true } },
                                              { nrrdSpaceLeftPosteriorSuperiorTime, { { { 1, 1, 1 } }, true } },
                                              { nrrdSpaceScannerXYZ, { { { 1, 1, 1 } }, false } },
                                              { nrrdSpaceScannerXYZTime, { { { 1, 1, 1 } }, false } },
                                              { nrrdSpace3DRightHanded, { { { 1, 1, 1 } }, false } },
                                              { nrrdSpace3DRightHandedTime, { { { 1, 1, 1 } }, false } } };

FileGeometry
ReadNrrdGeometry(const itk::ImageIOBase & io, const fs::path & path, const WarningFunction & warn)
{
  const NrrdPointer             nrrd = LoadNrrdHeader(path);
  FileGeometry                  geometry = GetGeometryOfITK(io);
  unsigned int                  domain[NRRD_DIM_MAX];
  const unsigned int            count = nrrdDomainAxesGet(nrrd.get(), domain);
  const auto                    toText = [](const char * text) { return Trim(text ? text : ""); };
  std::map<std::string, double> units;
  const auto                    getMillimetres = [&](const std::string & unit) {
    const auto known = units.find(unit);
    return known != units.end() ? known->second : units[unit] = GetMillimetres(unit, path, warn);
  };
  unsigned int range[NRRD_DIM_MAX];
  geometry.isSeries = nrrdRangeAxesGet(nrrd.get(), range) == 1 && IsSeries(*nrrd, range[0]);
  if (nrrd->spaceDim == 0)
  {
    // an axis without a unit has the unit of the others
    std::string unit;
    for (unsigned int axis = 0; axis < std::min(count, 3u); ++axis)
    {
      unit = unit.empty() ? toText(nrrd->axis[domain[axis]].units) : unit;
    }
    for (unsigned int axis = 0; axis < std::min(count, 3u); ++axis)
    {
      const std::string own = toText(nrrd->axis[domain[axis]].units);
      const double      factor = getMillimetres(own.empty() ? unit : own);
      geometry.spacing[axis] *= factor;
      geometry.origin[axis] *= factor;
    }
    return geometry;
  }

  const auto space = nrrdSpaces.find(nrrd->space);
  if (space == nrrdSpaces.end())
  {
    throw std::runtime_error("'" + path.string() + "' is in the space '" + airEnumStr(nrrdSpace, nrrd->space) +
                             "', whose relation to a patient is not known; right-anterior-superior, " +
                             "left-anterior-superior or left-posterior-superior is needed");
  }
  VectorType factors;
  for (unsigned int row = 0; row < 3; ++row)
  {
    factors[row] = space->second.signs[row] * getMillimetres(toText(nrrd->spaceUnits[row]));
  }
  const auto toLPS = [&](const double * values) {
    VectorType vector;
    for (unsigned int row = 0; row < 3; ++row)
    {
      vector[row] = factors[row] * (row < nrrd->spaceDim ? values[row] : 0.0);
    }
    return vector;
  };
  std::array<VectorType, 3> axes;
  for (unsigned int axis = 0; axis < std::min(count, 4u); ++axis)
  {
    const double * const direction = nrrd->axis[domain[axis]].spaceDirection;
    if (nrrd->spaceDim > 3 && (axis < 3 ? direction[3] != 0.0 : toLPS(direction).GetNorm() != 0.0))
    {
      throw std::runtime_error("'" + path.string() + "' has an axis along space and time together");
    }
    if (axis < 3)
    {
      axes[axis] = toLPS(direction);
    }
  }
  SetAxes(geometry, axes, path);
  const VectorType origin = toLPS(nrrd->spaceOrigin);
  const bool       hasOrigin = std::isfinite(origin.GetNorm());
  for (unsigned int row = 0; row < 3; ++row)
  {
    geometry.origin[row] = hasOrigin ? origin[row] : 0.0;
  }
  geometry.hasOrientation = space->second.isPatients;
  return geometry;
}

/** Columns of a matrix of NIfTI, which is RAS, and the position of the first voxel. */
FileGeometry
MakeNIfTIGeometry(const mat44 & matrix, double millimetres, const fs::path & path)
{
  FileGeometry              geometry;
  std::array<VectorType, 3> axes;
  for (unsigned int row = 0; row < 3; ++row)
  {
    const double factor = row < 2 ? -millimetres : millimetres;
    geometry.origin[row] = factor * matrix.m[row][3];
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      axes[axis][row] = factor * matrix.m[row][axis];
    }
  }
  SetAxes(geometry, axes, path);
  geometry.hasOrientation = true;
  return geometry;
}

bool
SpansVolume(const mat44 & matrix)
{
  mat33 linear;
  for (unsigned int row = 0; row < 3; ++row)
  {
    std::copy(matrix.m[row], matrix.m[row] + 3, linear.m[row]);
  }
  return nifti_mat33_determ(linear) != 0.0F;
}

FileGeometry
ReadNIfTIGeometry(const itk::ImageIOBase & io, const fs::path & path, const WarningFunction & warn)
{
  const std::unique_ptr<nifti_image, decltype(&nifti_image_free)> image(nifti_image_read(path.string().c_str(), 0),
                                                                        nifti_image_free);
  if (!image)
  {
    throw std::runtime_error("cannot read the header of '" + path.string() + "'");
  }
  if (image->sform_code <= 0 && image->qform_code <= 0)
  {
    return GetGeometryOfITK(io);
  }
  const double millimetres = image->xyz_units == NIFTI_UNITS_METER    ? 1000.0
                             : image->xyz_units == NIFTI_UNITS_MICRON ? 0.001
                                                                      : 1.0;
  const bool   hasSform = image->sform_code > 0 && (image->qform_code <= 0 || SpansVolume(image->sto_xyz));
  if (image->sform_code > 0 && !hasSform)
  {
    warn("'" + path.string() + "' has an sform that spans no volume; its qform is used");
  }
  if (!hasSform)
  {
    FileGeometry geometry = MakeNIfTIGeometry(image->qto_xyz, millimetres, path);
    // the matrix is rounded
    const double sides[] = { millimetres * image->dx, millimetres * image->dy, millimetres * image->dz };
    geometry.spacing = VectorType(sides);
    return geometry;
  }
  const FileGeometry geometry = MakeNIfTIGeometry(image->sto_xyz, millimetres, path);
  if (image->qform_code > 0)
  {
    const double distance =
      FindDistance(MakeGrid(geometry, io), MakeGrid(MakeNIfTIGeometry(image->qto_xyz, millimetres, path), io));
    if (distance > 0.1 * *std::min_element(geometry.spacing.Begin(), geometry.spacing.End()))
    {
      std::ostringstream message;
      message << "'" << path.string() << "' states two positions: the qform puts a corner " << distance
              << " mm away from where the sform, which is used, puts it";
      warn(message.str());
    }
  }
  return geometry;
}

/** The header's lengths are in ångström (mrc2014). */
FileGeometry
ReadMRCGeometry(const itk::ImageIOBase & io, const fs::path & path)
{
  itk::MRCHeaderObject::ConstPointer header;
  itk::ExposeMetaData(io.GetMetaDataDictionary(), "MRCHeader", header);
  if (header)
  {
    const auto & axes = header->GetHeader();
    const bool   isStated = axes.mapc != 0 || axes.mapr != 0 || axes.maps != 0;
    if (isStated && (axes.mapc != 1 || axes.mapr != 2 || axes.maps != 3))
    {
      throw std::runtime_error("'" + path.string() + "' has its axes in another order than X, Y, Z");
    }
    constexpr int volumeStack = 401;
    if (axes.ispg >= volumeStack)
    {
      throw std::runtime_error("'" + path.string() + "' is a stack of volumes; one volume is needed");
    }
  }
  FileGeometry geometry = GetGeometryOfITK(io);
  Scale(geometry, 1e-7);
  return geometry;
}

FileGeometry
ReadMetaGeometry(const itk::ImageIOBase & io, const fs::path & path, const WarningFunction & warn)
{
  FileGeometry geometry = GetGeometryOfITK(io);
  auto         fields = ReadFields(path);
  const auto isStated = [&fields](const std::string & name) { return !fields[name].empty() && fields[name] != "???"; };
  geometry.hasOrientation = fields["AnatomicalOrientation"] == "RAI" || isStated("TransformMatrix") ||
                            isStated("Rotation") || isStated("Orientation");
  const std::string unit = fields["DistanceUnits"];
  Scale(geometry, unit == "?" ? 1.0 : GetMillimetres(unit, path, warn));
  return geometry;
}
} // namespace

FileGeometry
ReadGeometry(const itk::ImageIOBase & io, const fs::path & path, const WarningFunction & warn)
{
  const std::string format = io.GetNameOfClass();
  FileGeometry      geometry = format == "NrrdImageIO"    ? ReadNrrdGeometry(io, path, warn)
                               : format == "NiftiImageIO" ? ReadNIfTIGeometry(io, path, warn)
                               : format == "MetaImageIO"  ? ReadMetaGeometry(io, path, warn)
                               : format == "MRCImageIO"   ? ReadMRCGeometry(io, path)
                                                          : GetGeometryOfITK(io);
  const auto &      entries = io.GetMetaDataDictionary();
  Scale(geometry, GetMillimetres(GetEntry(entries, "Unit"), path, warn));
  geometry.hasOrientation = geometry.hasOrientation && GetEntry(entries, "HasOrientation") != "0";
  return geometry;
}

std::string
GetEntry(const itk::MetaDataDictionary & dictionary, const std::string & key)
{
  std::string value;
  itk::ExposeMetaData(dictionary, key, value);
  return value;
}

itk::ImageBase<3>::Pointer
MakeGrid(const FileGeometry & geometry, const itk::ImageIOBase & io)
{
  const auto grid = itk::ImageBase<3>::New();
  grid->SetRegions(itk::Size<3>{ { io.GetDimensions(0), io.GetDimensions(1), io.GetDimensions(2) } });
  grid->SetOrigin(geometry.origin);
  grid->SetSpacing(geometry.spacing);
  grid->SetDirection(geometry.direction);
  return grid;
}

double
FindDistance(const itk::ImageBase<3> * one, const itk::ImageBase<3> * other)
{
  const auto size = one->GetLargestPossibleRegion().GetSize();
  double     distance = 0.0;
  for (unsigned int corner = 0; corner < 8; ++corner)
  {
    itk::Index<3>         index;
    itk::Point<double, 3> points[2];
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      index[axis] = (corner >> axis & 1) * static_cast<itk::IndexValueType>(size[axis] - 1);
    }
    one->TransformIndexToPhysicalPoint(index, points[0]);
    other->TransformIndexToPhysicalPoint(index, points[1]);
    distance = std::max(distance, points[0].EuclideanDistanceTo(points[1]));
  }
  return distance;
}

std::optional<double>
FindMillimetres(const std::string & unit)
{
  // µ is a sign of its own or a Greek letter, in UTF-8, Latin 1 or as ImageJ writes it
  static const std::map<std::string, double> units = {
    { "mm", 1.0 },          { "millimeter", 1.0 },    { "millimeters", 1.0 }, { "millimetre", 1.0 },
    { "millimetres", 1.0 }, { "um", 1e-3 },           { "\xc2\xb5m", 1e-3 },  { "\xce\xbcm", 1e-3 },
    { "\xb5m", 1e-3 },      { "\\u00b5m", 1e-3 },     { "micron", 1e-3 },     { "microns", 1e-3 },
    { "micrometer", 1e-3 }, { "micrometers", 1e-3 },  { "micrometre", 1e-3 }, { "micrometres", 1e-3 },
    { "nm", 1e-6 },         { "nanometer", 1e-6 },    { "nanometers", 1e-6 }, { "nanometre", 1e-6 },
    { "nanometres", 1e-6 }, { "cm", 10.0 },           { "centimeter", 10.0 }, { "centimeters", 10.0 },
    { "centimetre", 10.0 }, { "centimetres", 10.0 },  { "m", 1e3 },           { "meter", 1e3 },
    { "meters", 1e3 },      { "metre", 1e3 },         { "metres", 1e3 },      { "inch", 25.4 },
    { "inches", 25.4 },     { "in", 25.4 },           { "pm", 1e-9 },         { "\xc3\x85", 1e-7 },
    { "\xc3\xa5", 1e-7 },   { "\xe2\x84\xab", 1e-7 }, { "angstrom", 1e-7 }
  };
  const auto found = units.find(ToLower(unit));
  return found == units.end() ? std::nullopt : std::optional(found->second);
}
