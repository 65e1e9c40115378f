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
#include "DicomSeries.h"
#include "DicomAttribute.h"
#include "DicomPet.h"
#include "Orientation.h"
#include "Output.h"

#include "itkByteSwapper.h"
#include "itkGDCMImageIO.h"
#include "itkMatrix.h"
#include "itkShearWarpFactorization.h"

#include <gdcmAttribute.h>
#include <gdcmSystem.h>
#include <gdcmUIDGenerator.h>
#include <gdcmWriter.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iomanip>
#include <random>
#include <set>
#include <sstream>
#include <stdexcept>

namespace
{
using gdcm::DataSet;
using gdcm::Tag;
using TransformType = itk::Transform<double, 3, 3>;
using PointType = itk::Point<double, 3>;
using VectorType = itk::Vector<double, 3>;
using Path = std::filesystem::path;

const std::string ctImageStorage = "1.2.840.10008.5.1.4.1.1.2";
const std::string mrImageStorage = "1.2.840.10008.5.1.4.1.1.4";
const std::string secondaryCaptureImageStorage = "1.2.840.10008.5.1.4.1.1.7";
const std::string multiFrameByteStorage = "1.2.840.10008.5.1.4.1.1.7.2";
const std::string multiFrameWordStorage = "1.2.840.10008.5.1.4.1.1.7.3";

/** Attributes, group and element in one number. */
using Attributes = std::vector<std::uint32_t>;

// PS3.3 C.7.1.1, C.7.2.1, C.7.2.2
const Attributes patientAndStudy = { 0x00080005, 0x00080020, 0x00080030, 0x00080050, 0x00080090, 0x00081030, 0x00081080,
                                     0x00100010, 0x00100020, 0x00100021, 0x00100030, 0x00100032, 0x00100040, 0x00101000,
                                     0x00101001, 0x00101010, 0x00101020, 0x00101030, 0x00102160, 0x00102180, 0x001021b0,
                                     0x00104000, 0x00120062, 0x00120063, 0x00120064, 0x0020000d, 0x00200010 };
// PS3.3 C.7.3.1, C.7.4.1, C.7.10.1, and lossy compression of C.7.6.1
const Attributes seriesAndAcquisition = { 0x00080022, 0x0008002a, 0x00080032, 0x00180015, 0x00181030,
                                          0x00185100, 0x00200012, 0x00200052, 0x00200060, 0x00201040,
                                          0x00282110, 0x00282112, 0x00282114 };
// PS3.3 C.7.6.4
const Attributes contrast = { 0x00180010, 0x00181040, 0x00181041, 0x00181042, 0x00181043,
                              0x00181044, 0x00181046, 0x00181047, 0x00181048, 0x00181049 };
// PS3.3 C.8.2.1
const Attributes ctImage = { 0x00180060, 0x00200012 };
// PS3.3 C.8.3.1
const Attributes mrImage = { 0x00180020, 0x00180021, 0x00180022, 0x00180023, 0x00180024,
                             0x00180025, 0x00180080, 0x00180081, 0x00180082, 0x00180084,
                             0x00180085, 0x00180087, 0x00180091, 0x00181060, 0x00181314 };
// PS3.3 C.7.5.1
const Attributes equipment = { 0x00080070, 0x00080080, 0x00081010, 0x00081090, 0x00181000, 0x00181020 };
// PS3.3 C.11.2
const Attributes window = { 0x00281050, 0x00281051, 0x00281055, 0x00281056 };
/** Type 2: there without a value if the source has none. */
const std::set<std::uint32_t> type2 = { 0x00080020, 0x00080030, 0x00080050, 0x00080090, 0x00100010, 0x00100020,
                                        0x00100030, 0x00100040, 0x00180022, 0x00180023, 0x00180060, 0x00180081,
                                        0x00180091, 0x00200010, 0x00200012, 0x00201040 };

template <std::uint16_t VElement, std::uint16_t VGroup = 0x0028>
void
SetPixelAttribute(DataSet & dataSet, std::size_t value)
{
  gdcm::Attribute<VGroup, VElement> attribute;
  attribute.SetValue(static_cast<std::uint16_t>(value));
  dataSet.Replace(attribute.GetAsDataElement());
}

void
Copy(const DataSet & from, DataSet & to, const Attributes & attributes)
{
  for (const std::uint32_t attribute : attributes)
  {
    const Tag tag(attribute);
    if (from.FindDataElement(tag) || type2.count(attribute) > 0)
    {
      CopyAttribute(from, to, tag);
    }
  }
}

/** A code of PS3.16. */
void
AddCode(DataSet & dataSet, const Tag & tag, const std::string & code, const std::string & meaning)
{
  DataSet item;
  SetText(item, { 0x0008, 0x0100 }, code);
  SetText(item, { 0x0008, 0x0102 }, "DCM");
  SetText(item, { 0x0008, 0x0104 }, meaning);
  AddItem(dataSet, tag, item);
}

std::string
Join(const std::vector<double> & numbers)
{
  std::string text;
  for (const double number : numbers)
  {
    text += (text.empty() ? "" : "\\") + FormatDecimal(number);
  }
  return text;
}

void
RequireText(const std::string & text, std::size_t longest)
{
  if (text.size() > longest ||
      !std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~' && c != '\\'; }))
  {
    throw std::runtime_error("'" + text + "' does not fit into DICOM: at most " + std::to_string(longest) +
                             " printable ASCII characters and no backslash are possible");
  }
}

std::string
MakeUID()
{
  return gdcm::UIDGenerator().Generate();
}

/** How values become the numbers from 0 to 65535, or -32768 to 32767 if there is a sign. */
struct Rescale
{
  double slope{ 1.0 };
  double intercept{ 0.0 };
  bool   isSigned{ false };
  double lowest{ 0.0 };
  double highest{ 0.0 };
  bool   areWhole{ true };

  bool
  IsIdentity() const
  {
    return slope == 1.0 && intercept == 0.0;
  }

  std::uint16_t
  Apply(double value) const
  {
    const double lowestNumber = isSigned ? -32768.0 : 0.0;
    const double number = std::round((value - intercept) / slope);
    return static_cast<std::uint16_t>(
      static_cast<std::int32_t>(std::min(std::max(number, lowestNumber), lowestNumber + 65535.0)));
  }
};

template <typename TPixel>
Rescale
ChooseRescale(const TPixel * begin, const TPixel * end, bool canBeSigned)
{
  Rescale rescale;
  rescale.lowest = rescale.highest = static_cast<double>(*begin);
  for (const TPixel * pixel = begin; pixel != end; ++pixel)
  {
    const double value = static_cast<double>(*pixel);
    if (!std::isfinite(value))
    {
      throw std::runtime_error("a pixel is " + std::to_string(value) + ", which DICOM cannot hold");
    }
    rescale.areWhole = rescale.areWhole && value == std::round(value);
    rescale.lowest = std::min(rescale.lowest, value);
    rescale.highest = std::max(rescale.highest, value);
  }
  if (canBeSigned && rescale.areWhole && rescale.lowest >= -32768.0 && rescale.highest <= 32767.0)
  {
    rescale.isSigned = rescale.lowest < 0.0;
  }
  else if (!rescale.areWhole || rescale.lowest < 0.0 || rescale.highest > 65535.0)
  {
    // as a reader finds them
    rescale.intercept = std::stod(FormatDecimal(rescale.lowest));
    const double range = rescale.highest - rescale.intercept;
    const bool   isExact = rescale.areWhole && range <= 65535.0 && rescale.intercept == rescale.lowest;
    rescale.slope = isExact || !(range > 0.0) ? 1.0 : std::stod(FormatDecimal(range / 65535.0));
  }
  return rescale;
}

/** Without an intercept. */
Rescale
ChoosePetRescale(Rescale rescale)
{
  const double largest =
    rescale.lowest < 0.0 ? std::max(rescale.lowest / -32768.0, rescale.highest / 32767.0) : rescale.highest / 65535.0;
  rescale.isSigned = rescale.lowest < 0.0;
  rescale.intercept = 0.0;
  rescale.slope = rescale.areWhole && largest <= 1.0 ? 1.0 : std::stod(FormatDecimal(largest));
  return rescale;
}

struct Geometry
{
  PointType  origin;
  VectorType right;
  VectorType down;
  double     columnSpacing;
  double     rowSpacing;
  double     thickness;
};

Geometry
ComputeGeometry(const itk::ImageBase<3> & frames, const DicomView & view, std::size_t frame)
{
  PointType origin = frames.GetOrigin();
  origin[2] = view.depth;
  PointType right = origin;
  PointType down = origin;
  PointType away = origin;
  right[0] += 1.0;
  down[1] += 1.0;
  away[2] += 1.0;

  Geometry geometry;
  geometry.origin = view.transform->TransformPoint(origin);
  geometry.right = view.transform->TransformPoint(right) - geometry.origin;
  geometry.down = view.transform->TransformPoint(down) - geometry.origin;
  geometry.columnSpacing = frames.GetSpacing()[0] * geometry.right.Normalize();
  geometry.rowSpacing = frames.GetSpacing()[1] * geometry.down.Normalize();
  geometry.thickness = view.thickness * std::abs((view.transform->TransformPoint(away) - geometry.origin) *
                                                 itk::CrossProduct(geometry.right, geometry.down));
  if (!(std::abs(geometry.right * geometry.down) < 1e-5))
  {
    throw std::runtime_error("the view of frame " + std::to_string(frame + 1) +
                             " is sheared: rows and columns of a DICOM image must be at right angles");
  }
  return geometry;
}

/** Why the pictures of a PET source are none of PET, empty if they are. */
std::string
FindPetObstacle(const itk::ImageBase<3> &      frames,
                const DataSet &                source,
                const std::vector<Geometry> &  geometries,
                const std::vector<DicomView> & views,
                const DicomSeriesOptions &     options)
{
  std::string       missing = FindMissingPetAttribute(source);
  const std::string ofMode = DescribeMode(options.mode).petObstacle;
  if (!missing.empty() || !options.noReprojection.empty() || !ofMode.empty())
  {
    return !missing.empty() ? "the source has no " + missing : !ofMode.empty() ? ofMode : options.noReprojection;
  }
  const auto                size = frames.GetLargestPossibleRegion().GetSize();
  const Geometry &          first = geometries.front();
  std::vector<PicturePlane> planes;
  for (std::size_t frame = 0; frame < views.size(); ++frame)
  {
    const Geometry & plane = geometries[frame];
    const double     width = plane.columnSpacing * (static_cast<double>(size[0]) - 1.0);
    const double     height = plane.rowSpacing * (static_cast<double>(size[1]) - 1.0);
    planes.push_back({ plane.origin + (plane.right * width + plane.down * height) * 0.5,
                       plane.right,
                       plane.down,
                       views[frame].angle });
  }
  return FindReprojectionObstacle(planes, 0.5 * std::min(first.columnSpacing, first.rowSpacing));
}

bool
AreColoured(const AnyImage & frames)
{
  return frames.image->GetNumberOfComponentsPerPixel() == 3 && frames.componentType == itk::IOComponentEnum::UCHAR;
}

std::string
ChooseClass(const DataSet & source, const Rescale & rescale)
{
  const std::string sourceClass = GetText(source, { 0x0008, 0x0016 });
  // these two are type 1
  const bool isGoodMR = !GetText(source, { 0x0018, 0x0020 }).empty() && !GetText(source, { 0x0018, 0x0021 }).empty() &&
                        rescale.IsIdentity();
  return sourceClass == ctImageStorage || (sourceClass == mrImageStorage && isGoodMR) ? sourceClass
                                                                                      : secondaryCaptureImageStorage;
}

void
SetWindow(DataSet & dataSet, const DataSet & source, const DicomSeriesOptions & options, const Rescale & rescale)
{
  if (!options.window && !options.isSuv && !GetText(source, { 0x0028, 0x1050 }).empty() &&
      !GetText(source, { 0x0028, 0x1051 }).empty())
  {
    Copy(source, dataSet, window);
    return;
  }
  const auto [lower, upper] = options.window.value_or(std::make_pair(rescale.lowest, rescale.highest));
  // the default function counts whole numbers, its width is at least 1 (PS3.3 C.11.2.1.2.1 and C.11.2.1.3.2)
  const bool isExact = rescale.slope != 1.0 && upper > lower;
  SetText(dataSet, { 0x0028, 0x1050 }, FormatDecimal(0.5 * (lower + upper + (isExact ? 0.0 : 1.0))));
  SetText(dataSet, { 0x0028, 0x1051 }, FormatDecimal(upper - lower + (isExact ? 0.0 : 1.0)));
  if (isExact)
  {
    SetText(dataSet, { 0x0028, 0x1056 }, "LINEAR_EXACT");
  }
}

void
SetPetModules(DataSet & header, const DataSet & source, std::size_t frames, bool isSuv)
{
  Copy(source, header, petAttributes);
  for (const std::uint32_t attribute : petType2)
  {
    if (!header.FindDataElement(Tag(attribute)))
    {
      CopyAttribute(source, header, Tag(attribute));
    }
  }
  // Patient Orientation Code Sequence has its place (PS3.3 C.7.3.1)
  header.Remove(Tag(0x0018, 0x5100));
  const bool isWholeBody = GetText(source, { 0x0054, 0x1000 }).find("WHOLE BODY") == 0;
  SetText(header, { 0x0054, 0x1000 }, std::string(isWholeBody ? "WHOLE BODY" : "STATIC") + "\\REPROJECTION");
  SetText(header, { 0x0054, 0x1004 }, "MAX PIXEL");
  SetPixelAttribute<0x0081, 0x0054>(header, frames);
  if (isSuv)
  {
    SetText(header, { 0x0054, 0x1001 }, "GML");
    SetText(header, { 0x0054, 0x1006 }, "BW");
  }
}

/** PS3.3 C.7.6.5, C.7.6.6, C.8.6.3 */
void
SetMultiFrame(DataSet & header, std::size_t frames, double frameTime)
{
  gdcm::Attribute<0x0028, 0x0009> increment;
  increment.SetNumberOfValues(1);
  increment.SetValue(0, Tag(0x0018, 0x1063));
  header.Replace(increment.GetAsDataElement());
  SetText(header, { 0x0018, 0x1063 }, FormatDecimal(frameTime));
  SetText(header, { 0x0008, 0x2144 }, std::to_string(std::max(1L, std::lround(1000.0 / frameTime))));
  SetText(header, { 0x0018, 0x0040 }, GetText(header, { 0x0008, 0x2144 }));
  SetText(header, { 0x0028, 0x0008 }, std::to_string(frames));
  SetText(header, { 0x2050, 0x0020 }, "IDENTITY");
  // without planes there is no frame of reference
  header.Remove(Tag(0x0020, 0x0052));
  header.Remove(Tag(0x0020, 0x1040));
}

bool
IsInverted(const DataSet & source, const DicomSeriesOptions & options)
{
  return options.isInverted || GetText(source, { 0x0028, 0x0004 }) == "MONOCHROME1";
}

/** A source of the attributes that are texts. */
DataSet
MakeSource(const std::map<std::string, std::string> & attributes)
{
  DataSet source;
  for (const auto & [key, text] : attributes)
  {
    const Tag             tag(static_cast<std::uint32_t>(std::stoul(key.substr(0, 4) + key.substr(5, 4), nullptr, 16)));
    constexpr std::size_t longest = 10240; // PS3.5 6.2
    if ((GetVR(gdcm::DataElement(tag)) & gdcm::VR::VRASCII) && text.size() <= longest)
    {
      SetText(source, tag, Trim(text));
    }
  }
  return source;
}

/** What all frames have. */
DataSet
MakeHeader(const AnyImage &           frames,
           const std::vector<Path> &  files,
           const DataSet &            source,
           const DicomSeriesOptions & options,
           const std::string &        sopClass,
           const Rescale &            rescale)
{
  const auto size = frames.image->GetLargestPossibleRegion().GetSize();
  const bool isColoured = AreColoured(frames);
  DataSet    header;

  Copy(source, header, patientAndStudy);
  Copy(source, header, seriesAndAcquisition);
  for (const Tag & uid : { Tag(0x0020, 0x000d), Tag(0x0020, 0x0052) })
  {
    if (GetText(header, uid).empty())
    {
      SetText(header, uid, MakeUID());
    }
  }

  // required of a paired body part, forbidden of others (PS3.3 C.7.3.1)
  if (GetText(source, { 0x0018, 0x0015 }).empty() && !header.FindDataElement(Tag(0x0020, 0x0060)))
  {
    SetText(header, { 0x0020, 0x0060 }, "");
  }

  char now[22];
  gdcm::System::GetCurrentDateTime(now);
  const std::string date(now, 8);
  const std::string time(now + 8, 13);
  for (const std::uint16_t dateElement : std::initializer_list<std::uint16_t>{ 0x0012, 0x0021, 0x0023 })
  {
    SetText(header, { 0x0008, dateElement }, date);
  }
  for (const std::uint16_t timeElement : std::initializer_list<std::uint16_t>{ 0x0013, 0x0031, 0x0033 })
  {
    SetText(header, { 0x0008, timeElement }, time);
  }

  const ModeInDicom & mode = DescribeMode(options.mode);
  const std::string   sourceDescription = GetText(source, { 0x0008, 0x103e });
  std::string         description = options.description;
  if (description.empty())
  {
    description = std::string(mode.series) + ' ' + sourceDescription;
    description = sourceDescription.empty() || description.size() > 64 ? mode.series : description;
  }
  const std::string sourceNumber = GetText(source, { 0x0020, 0x0011 });
  const int         number = options.number.value_or(std::min(std::atoi(sourceNumber.c_str()), 1000000) + 1000);
  SetText(header, { 0x0008, 0x103e }, description);
  SetText(header, { 0x0020, 0x000e }, MakeUID());
  SetText(header, { 0x0020, 0x0011 }, std::to_string(number));
  SetText(header, { 0x0008, 0x0016 }, sopClass);

  SetText(header, { 0x0008, 0x0070 }, "");
  SetText(header, { 0x0008, 0x1090 }, options.program);
  SetText(header, { 0x0018, 0x1020 }, options.version);
  if (!GetText(source, { 0x0008, 0x0070 }).empty())
  {
    DataSet item;
    Copy(source, item, equipment);
    AddCode(item, { 0x0040, 0xa170 }, "109101", "Acquisition Equipment");
    AddItem(header, { 0x0018, 0xa001 }, item);
  }

  SetText(header,
          { 0x0008, 0x0008 },
          std::string("DERIVED\\") + (sopClass == petImageStorage ? "PRIMARY" : "SECONDARY") + "\\PROJECTION IMAGE\\" +
            mode.imageType);
  SetText(header, { 0x0008, 0x2111 }, mode.derivation + options.derivation);
  AddCode(header, { 0x0008, 0x9215 }, mode.code, mode.meaning);
  for (const Path & file : files)
  {
    const DataSet image = ReadHeader(file);
    DataSet       item;
    SetText(item, { 0x0008, 0x1150 }, GetText(image, { 0x0008, 0x0016 }));
    SetText(item, { 0x0008, 0x1155 }, GetText(image, { 0x0008, 0x0018 }));
    AddCode(item, { 0x0040, 0xa170 }, "121322", "Source image for image processing operation");
    AddItem(header, { 0x0008, 0x2112 }, item);
  }
  const bool isBurnedIn = GetText(source, { 0x0028, 0x0301 }) == "YES";
  SetText(header, { 0x0028, 0x0301 }, isBurnedIn ? "YES" : "NO");

  const std::string sourceModality = GetText(source, { 0x0008, 0x0060 });
  const std::string modality = sopClass == ctImageStorage   ? "CT"
                               : sopClass == mrImageStorage ? "MR"
                               : sourceModality.empty()     ? "OT"
                                                            : sourceModality;
  SetText(header, { 0x0008, 0x0060 }, modality);
  if (sopClass.find(secondaryCaptureImageStorage) == 0)
  {
    SetText(header, { 0x0008, 0x0064 }, "WSD");
    if (options.frameTime)
    {
      SetMultiFrame(header, size[2], *options.frameTime);
    }
  }
  else if (sopClass == petImageStorage)
  {
    SetPetModules(header, source, size[2], options.isSuv);
    SetText(header, { 0x0028, 0x1052 }, "0");
    SetText(header, { 0x0028, 0x1053 }, FormatDecimal(rescale.slope));
  }
  else
  {
    Copy(source, header, contrast);
    Copy(source, header, sopClass == ctImageStorage ? ctImage : mrImage);
  }
  if (sopClass != mrImageStorage && sopClass != petImageStorage && !isColoured)
  {
    std::string unit = GetText(source, { 0x0028, 0x1054 });
    if (unit.empty() || unit == "US" || options.isSuv)
    {
      unit = modality == "CT" ? "HU" : "US";
    }
    SetText(header, { 0x0028, 0x1052 }, FormatDecimal(rescale.intercept));
    SetText(header, { 0x0028, 0x1053 }, FormatDecimal(rescale.slope));
    SetText(header, { 0x0028, 0x1054 }, unit);
  }
  if (!isColoured)
  {
    SetWindow(header, source, options, rescale);
  }

  const bool isInverted = sopClass != petImageStorage && IsInverted(source, options);
  SetText(header, { 0x0028, 0x0004 }, isColoured ? "RGB" : isInverted ? "MONOCHROME1" : "MONOCHROME2");
  SetPixelAttribute<0x0002>(header, isColoured ? 3 : 1);
  SetPixelAttribute<0x0010>(header, size[1]);
  SetPixelAttribute<0x0011>(header, size[0]);
  if (isColoured)
  {
    SetPixelAttribute<0x0006>(header, 0);
  }
  const std::size_t bits = isColoured || sopClass == multiFrameByteStorage ? 8 : 16;
  SetPixelAttribute<0x0100>(header, bits);
  SetPixelAttribute<0x0101>(header, bits);
  SetPixelAttribute<0x0102>(header, bits - 1);
  SetPixelAttribute<0x0103>(header, rescale.isSigned ? 1 : 0);
  return header;
}

DataSet
MakeFrame(const DataSet & header, const Geometry & geometry, const DicomView & view, std::size_t frame)
{
  DataSet dataSet = header;
  SetText(dataSet, { 0x0008, 0x0018 }, MakeUID());
  SetText(dataSet, { 0x0020, 0x0013 }, std::to_string(frame + 1));
  SetText(dataSet, { 0x0028, 0x0030 }, Join({ geometry.rowSpacing, geometry.columnSpacing }));
  const EdgeLetters letters = ComputeEdgeLetters(view.transform);
  SetText(dataSet, { 0x0020, 0x0020 }, letters.right + '\\' + letters.bottom);
  if (header.FindDataElement(Tag(0x0018, 0x1063)))
  {
    return dataSet;
  }
  SetText(dataSet, { 0x0018, 0x0050 }, std::isfinite(geometry.thickness) ? FormatDecimal(geometry.thickness) : "");
  SetText(dataSet, { 0x0020, 0x0032 }, Join({ geometry.origin[0], geometry.origin[1], geometry.origin[2] }));
  SetText(dataSet,
          { 0x0020, 0x0037 },
          Join({ geometry.right[0],
                 geometry.right[1],
                 geometry.right[2],
                 geometry.down[0],
                 geometry.down[1],
                 geometry.down[2] }));
  if (GetText(header, { 0x0008, 0x0016 }) == petImageStorage)
  {
    SetPixelAttribute<0x1330, 0x0054>(dataSet, frame + 1);
  }
  if (!std::isnan(view.angle))
  {
    SetText(dataSet, { 0x0020, 0x4000 }, "Turned by " + FormatDecimal(view.angle) + " degrees");
  }
  return dataSet;
}

template <typename TStored>
void
SetPixels(DataSet & dataSet, std::vector<TStored> & pixels)
{
  constexpr bool isByte = sizeof(TStored) == 1;
  pixels.resize(pixels.size() + (isByte ? pixels.size() % 2 : 0));
  itk::ByteSwapper<TStored>::SwapRangeFromSystemToLittleEndian(pixels.data(), pixels.size());
  gdcm::DataElement element(Tag(0x7fe0, 0x0010), 0, isByte ? gdcm::VR::OB : gdcm::VR::OW);
  element.SetByteValue(reinterpret_cast<const char *>(pixels.data()),
                       static_cast<std::uint32_t>(pixels.size() * sizeof(TStored)));
  dataSet.Replace(element);
}

/** Writes \a path, which shall become \a finalPath. */
void
WriteFile(const DataSet & dataSet, const Path & path, const Path & finalPath)
{
  // GDCM aborts where a file cannot be written
  std::ostringstream bytes;
  gdcm::Writer       writer;
  writer.SetStream(bytes);
  writer.GetFile().SetDataSet(dataSet);
  writer.GetFile().GetHeader().SetDataSetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
  const bool    isEncoded = writer.Write();
  std::ofstream file(path, std::ios::binary);
  file << bytes.str();
  file.close();
  if (!isEncoded || !file)
  {
    throw std::runtime_error("cannot write all of '" + finalPath.string() + "'; is the disk full?");
  }
}

void
RequireFrames(const AnyImage & frames, const std::vector<DicomView> & views, const DicomSeriesOptions & options)
{
  const auto size = frames.image->GetLargestPossibleRegion().GetSize();
  if (frames.image->GetNumberOfComponentsPerPixel() != 1 && !AreColoured(frames))
  {
    throw std::runtime_error("a DICOM series needs pixels of one component, or of three bytes");
  }
  if (size[2] == 0 || views.size() != size[2])
  {
    throw std::runtime_error("there are " + std::to_string(size[2]) + " frames, but " + std::to_string(views.size()) +
                             " views");
  }
  // PixelData has less than 2^32 bytes
  if (std::min(size[0], size[1]) == 0 || std::max(size[0], size[1]) > 65535 ||
      size[0] * size[1] * (AreColoured(frames) ? 3 : 2) > 0xfffffffc)
  {
    throw std::runtime_error("a picture of " + std::to_string(size[0]) + " x " + std::to_string(size[1]) +
                             " pixels is not possible in DICOM");
  }
  if (options.window && !(options.window->first < options.window->second))
  {
    throw std::runtime_error("the lower end of a window must be less than the upper one");
  }
  RequireText(DescribeMode(options.mode).derivation + options.derivation, 1024);
  RequireText(options.description, 64);
  RequireText(options.program, 64);
  RequireText(options.version, 64);
}

/** Throws if frames of \a size, or inverted ones, are impossible in a multi-frame Secondary Capture. */
void
RequireMultiFrame(bool isInverted, const itk::Size<3> & size)
{
  if (isInverted)
  {
    throw std::runtime_error("low values of the source are white (MONOCHROME1), which a multi-frame DICOM file cannot "
                             "say; single frames can");
  }
  if (size[0] * size[1] > 0x7ffffffe / size[2])
  {
    throw std::runtime_error(std::to_string(size[2]) + " frames of " + std::to_string(size[0]) + " x " +
                             std::to_string(size[1]) + " pixels are too large for one DICOM file");
  }
}

Path
GetFrameName(std::size_t frame, std::size_t frames)
{
  std::ostringstream name;
  const auto         width = std::max<std::size_t>(3, std::to_string(frames).size());
  name << "frame-" << std::setw(static_cast<int>(width)) << std::setfill('0') << frame + 1 << ".dcm";
  return name.str();
}
} // namespace

const ModeInDicom &
DescribeMode(itk::ShearWarpMIPImageFilterEnums::Mode mode)
{
  using Mode = itk::ShearWarpMIPImageFilterEnums::Mode;
  static constexpr ModeInDicom maximum{ "Maximum intensity projection", "MIP", "MAX_IP", "113078",
                                        "Maximum intensity projection", "" };
  static constexpr ModeInDicom minimum{ "Minimum intensity projection", "MinIP",          "MIN_IP", "113079",
                                        "Minimum intensity projection", "they are minima" };
  static constexpr ModeInDicom absoluteMaximum{
    "Maximum intensity projection of absolute values", "MIP", "MAX_IP", "113078", "Maximum intensity projection", ""
  };
  static constexpr ModeInDicom mean{ "Mean intensity projection", "AIP",           "MEAN", "113049",
                                     "Pixel by pixel mean",       "they are means" };
  switch (mode)
  {
    case Mode::Maximum:
      return maximum;
    case Mode::Minimum:
      return minimum;
    case Mode::AbsoluteMaximum:
      return absoluteMaximum;
    case Mode::Mean:
      return mean;
  }
  throw std::logic_error("the mode has no description in DICOM");
}

double
ComputeDepth(const itk::Transform<double, 3, 3> * transform, const PointType & point)
{
  const auto      axes = itk::ShearWarpFactorization::GetLinearPart(transform);
  const PointType origin = transform->TransformPoint(PointType(0.0));
  return (itk::Matrix<double, 3, 3>(axes.GetInverse()) * (point - origin))[2];
}

void
WriteDicomSeries(const AnyImage &                           frames,
                 const std::vector<DicomView> &             views,
                 const std::vector<std::filesystem::path> & source,
                 const std::filesystem::path &              directory,
                 const DicomSeriesOptions &                 options)
{
  OutputFiles files;
  WriteDicomSeries(files, frames, views, source, directory, options);
  files.Commit();
}

void
WriteDicomSeries(OutputFiles &                              files,
                 const AnyImage &                           frames,
                 const std::vector<DicomView> &             views,
                 const std::vector<std::filesystem::path> & source,
                 const std::filesystem::path &              directory,
                 const DicomSeriesOptions &                 options)
{
  RequireFrames(frames, views, options);
  const auto            size = frames.image->GetLargestPossibleRegion().GetSize();
  std::vector<Geometry> geometries;
  geometries.reserve(views.size());
  for (std::size_t frame = 0; frame < views.size(); ++frame)
  {
    geometries.push_back(ComputeGeometry(*frames.image, views[frame], frame));
  }
  const Path temporary = files.BeginFolder(directory);
  gdcm::UIDGenerator::SetRoot(itk::GDCMImageIO::New()->GetUIDPrefix());

  DispatchPixelType(frames.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    const PixelType * const begin = CastImage<PixelType>(frames).GetBufferPointer();
    const std::size_t       length = size[0] * size[1] * frames.image->GetNumberOfComponentsPerPixel();
    Rescale                 rescale = ChooseRescale(begin, begin + length * size[2], !options.frameTime);
    DataSet                 header = source.empty() ? MakeSource(options.attributes) : ReadHeader(source.front());
    std::string             sopClass = ChooseClass(header, rescale);
    const bool              isColoured = AreColoured(frames);
    if (isColoured)
    {
      sopClass = secondaryCaptureImageStorage;
    }
    else if (options.frameTime)
    {
      sopClass = frames.componentType == itk::IOComponentEnum::UCHAR ? multiFrameByteStorage : multiFrameWordStorage;
      RequireMultiFrame(IsInverted(header, options), size);
    }
    else if (!source.empty() && GetText(header, { 0x0008, 0x0016 }) == petImageStorage)
    {
      const DataSet     first = ReadFirstAcquired(source);
      const std::string obstacle = FindPetObstacle(*frames.image, first, geometries, views, options);
      if (obstacle.empty())
      {
        header = first;
        sopClass = petImageStorage;
        rescale = ChoosePetRescale(rescale);
        // it must not vary (C.8.9.1.1.1), not even by a rounding error
        for (Geometry & geometry : geometries)
        {
          geometry.columnSpacing = geometries.front().columnSpacing;
          geometry.rowSpacing = geometries.front().rowSpacing;
        }
      }
      else if (options.warn)
      {
        options.warn("'" + directory.string() + "' has Secondary Capture, not PET images: " + obstacle);
      }
    }
    header = MakeHeader(frames, source, header, options, sopClass, rescale);

    const std::size_t together = options.frameTime ? views.size() : 1;
    for (std::size_t frame = 0; frame < views.size(); frame += together)
    {
      HeldSignals::RequireNone();
      const PixelType * const first = begin + frame * length;
      DataSet                 dataSet = MakeFrame(header, geometries[frame], views[frame], frame);
      for (std::size_t n = 1; n < together; ++n)
      {
        // the Patient Orientation of all frames, or none
        const DataSet other = MakeFrame(header, geometries[n], views[n], n);
        if (GetText(other, { 0x0020, 0x0020 }) != GetText(dataSet, { 0x0020, 0x0020 }))
        {
          SetText(dataSet, { 0x0020, 0x0020 }, "");
          break;
        }
      }
      const auto store = [&](auto stored) {
        std::vector<decltype(stored)> pixels(length * together);
        std::transform(first, first + pixels.size(), pixels.begin(), [&rescale](PixelType value) {
          return static_cast<decltype(stored)>(rescale.Apply(static_cast<double>(value)));
        });
        SetPixels(dataSet, pixels);
      };
      isColoured || sopClass == multiFrameByteStorage ? store(std::uint8_t{}) : store(std::uint16_t{});
      const Path name = options.frameTime ? Path("frames.dcm") : GetFrameName(frame, views.size());
      WriteFile(dataSet, temporary / name, directory / name);
    }
  });
}
