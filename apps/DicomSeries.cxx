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
#include "Output.h"

#include "itkByteSwapper.h"
#include "itkGDCMImageIO.h"
#include "itkMatrix.h"
#include "itkShearWarpFactorization.h"
#include "itkShearWarpMIPView.h"

#include <gdcmAttribute.h>
#include <gdcmDict.h>
#include <gdcmDicts.h>
#include <gdcmGlobal.h>
#include <gdcmReader.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmSystem.h>
#include <gdcmUIDGenerator.h>
#include <gdcmWriter.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
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

/** Attributes of text, group and element in one number. */
using Attributes = std::vector<std::uint32_t>;

// PS3.3 C.7.1.1, C.7.2.1, C.7.2.2
const Attributes patientAndStudy = { 0x00080005, 0x00080020, 0x00080030, 0x00080050, 0x00080090, 0x00081030, 0x00081080,
                                     0x00100010, 0x00100020, 0x00100021, 0x00100030, 0x00100032, 0x00100040, 0x00101000,
                                     0x00101001, 0x00101010, 0x00101020, 0x00101030, 0x00102160, 0x00102180, 0x001021b0,
                                     0x00104000, 0x00120062, 0x00120063, 0x0020000d, 0x00200010 };
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

void
SetText(DataSet & dataSet, const Tag & tag, std::string text)
{
  const gdcm::VR    vr = gdcm::Global::GetInstance().GetDicts().GetDictEntry(tag).GetVR();
  gdcm::DataElement element(tag, 0, vr);
  if (text.size() % 2 == 1)
  {
    text += vr == gdcm::VR::UI ? '\0' : ' ';
  }
  element.SetByteValue(text.data(), static_cast<std::uint32_t>(text.size()));
  dataSet.Replace(element);
}

template <std::uint16_t VElement>
void
SetPixelAttribute(DataSet & dataSet, std::size_t value)
{
  gdcm::Attribute<0x0028, VElement> attribute;
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
      SetText(to, tag, GetText(from, tag));
    }
  }
}

void
AddItem(DataSet & dataSet, const Tag & tag, const DataSet & nested)
{
  gdcm::SmartPointer<gdcm::SequenceOfItems> sequence;
  if (dataSet.FindDataElement(tag))
  {
    sequence = dataSet.GetDataElement(tag).GetValueAsSQ();
  }
  else
  {
    sequence = new gdcm::SequenceOfItems;
    sequence->SetLengthToUndefined();
    gdcm::DataElement element(tag, 0, gdcm::VR::SQ);
    element.SetValue(*sequence);
    element.SetVLToUndefined();
    dataSet.Insert(element);
  }
  gdcm::Item item;
  item.SetVLToUndefined();
  item.SetNestedDataSet(nested);
  sequence->AddItem(item);
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

/** Code by code: an element of a file without VRs would lose its own. */
void
CopyCodes(const DataSet & from, DataSet & to, const Tag & tag)
{
  const auto sequence = from.GetDataElement(tag).GetValueAsSQ();
  for (std::size_t item = 1; sequence && item <= sequence->GetNumberOfItems(); ++item)
  {
    DataSet code;
    Copy(sequence->GetItem(item).GetNestedDataSet(), code, { 0x00080100, 0x00080102, 0x00080103, 0x00080104 });
    AddItem(to, tag, code);
  }
}

/** \a number as a decimal string, which has at most 16 characters (PS3.5 6.2). */
std::string
FormatDecimal(double number)
{
  char text[32];
  for (int digits = 15; digits > 0; --digits)
  {
    if (std::snprintf(text, sizeof(text), "%.*g", digits, number + 0.0) <= 16)
    {
      break;
    }
  }
  return text;
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
ChooseRescale(const TPixel * begin, const TPixel * end)
{
  Rescale rescale;
  rescale.lowest = rescale.highest = static_cast<double>(*begin);
  bool areWhole = true;
  for (const TPixel * pixel = begin; pixel != end; ++pixel)
  {
    const double value = static_cast<double>(*pixel);
    if (!std::isfinite(value))
    {
      throw std::runtime_error("a pixel is " + std::to_string(value) + ", which DICOM cannot hold");
    }
    areWhole = areWhole && value == std::round(value);
    rescale.lowest = std::min(rescale.lowest, value);
    rescale.highest = std::max(rescale.highest, value);
  }
  if (areWhole && rescale.lowest >= -32768.0 && rescale.highest <= 32767.0)
  {
    rescale.isSigned = rescale.lowest < 0.0;
  }
  else if (!areWhole || rescale.lowest < 0.0 || rescale.highest > 65535.0)
  {
    // as a reader finds them
    rescale.intercept = std::stod(FormatDecimal(rescale.lowest));
    const double range = rescale.highest - rescale.intercept;
    const bool   isExact = areWhole && range <= 65535.0 && rescale.intercept == rescale.lowest;
    rescale.slope = isExact || !(range > 0.0) ? 1.0 : std::stod(FormatDecimal(range / 65535.0));
  }
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

/** The letters of the sides that \a direction points to, the nearest first (PS3.3 C.7.6.1.1.1). */
std::string
NameDirection(const VectorType & direction)
{
  const std::string         names[] = { "RL", "AP", "FH" };
  std::vector<unsigned int> axes = { 0, 1, 2 };
  std::stable_sort(axes.begin(), axes.end(), [&direction](unsigned int a, unsigned int b) {
    return std::abs(direction[a]) > std::abs(direction[b]);
  });
  std::string letters;
  for (const unsigned int axis : axes)
  {
    if (std::abs(direction[axis]) > 0.01)
    {
      letters += names[axis][direction[axis] > 0.0];
    }
  }
  return letters;
}

DataSet
ReadHeader(const Path & path, const Tag & last)
{
  gdcm::Reader reader;
  reader.SetFileName(path.string().c_str());
  if (!reader.ReadUpToTag(last) || GetText(reader.GetFile().GetDataSet(), { 0x0008, 0x0018 }).empty())
  {
    throw std::runtime_error("'" + path.string() + "' is not a DICOM file");
  }
  return reader.GetFile().GetDataSet();
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
  if (!options.window && !GetText(source, { 0x0028, 0x1050 }).empty() && !GetText(source, { 0x0028, 0x1051 }).empty())
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

/** What all frames have. */
DataSet
MakeHeader(const AnyImage &           frames,
           const std::vector<Path> &  files,
           const DicomSeriesOptions & options,
           const Rescale &            rescale)
{
  const DataSet     source = files.empty() ? DataSet() : ReadHeader(files.front(), { 0x0040, 0xffff });
  const std::string sopClass = ChooseClass(source, rescale);
  DataSet           header;

  Copy(source, header, patientAndStudy);
  CopyCodes(source, header, { 0x0012, 0x0064 });
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

  const std::string mode = options.isMinimum ? "MinIP" : "MIP";
  const std::string sourceDescription = GetText(source, { 0x0008, 0x103e });
  std::string       description = options.description;
  if (description.empty())
  {
    description = mode + ' ' + sourceDescription;
    description = sourceDescription.empty() || description.size() > 64 ? mode : description;
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
          std::string("DERIVED\\SECONDARY\\PROJECTION IMAGE\\") + (options.isMinimum ? "MIN_IP" : "MAX_IP"));
  SetText(header, { 0x0008, 0x2111 }, options.derivation);
  AddCode(header,
          { 0x0008, 0x9215 },
          options.isMinimum ? "113079" : "113078",
          options.isMinimum ? "Minimum intensity projection" : "Maximum intensity projection");
  for (const Path & file : files)
  {
    const DataSet image = ReadHeader(file, { 0x0008, 0x0018 });
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
  if (sopClass == secondaryCaptureImageStorage)
  {
    SetText(header, { 0x0008, 0x0064 }, "WSD");
  }
  else
  {
    Copy(source, header, contrast);
    Copy(source, header, sopClass == ctImageStorage ? ctImage : mrImage);
  }
  if (sopClass != mrImageStorage)
  {
    std::string unit = GetText(source, { 0x0028, 0x1054 });
    if (unit.empty() || unit == "US")
    {
      unit = modality == "CT" ? "HU" : "US";
    }
    SetText(header, { 0x0028, 0x1052 }, FormatDecimal(rescale.intercept));
    SetText(header, { 0x0028, 0x1053 }, FormatDecimal(rescale.slope));
    SetText(header, { 0x0028, 0x1054 }, unit);
  }
  SetWindow(header, source, options, rescale);

  const auto size = frames.image->GetLargestPossibleRegion().GetSize();
  const bool isInverted = GetText(source, { 0x0028, 0x0004 }) == "MONOCHROME1";
  SetText(header, { 0x0028, 0x0004 }, isInverted ? "MONOCHROME1" : "MONOCHROME2");
  SetPixelAttribute<0x0002>(header, 1);
  SetPixelAttribute<0x0010>(header, size[1]);
  SetPixelAttribute<0x0011>(header, size[0]);
  SetPixelAttribute<0x0100>(header, 16);
  SetPixelAttribute<0x0101>(header, 16);
  SetPixelAttribute<0x0102>(header, 15);
  SetPixelAttribute<0x0103>(header, rescale.isSigned ? 1 : 0);
  return header;
}

DataSet
MakeFrame(const DataSet & header, const Geometry & geometry, const DicomView & view, std::size_t frame)
{
  DataSet dataSet = header;
  SetText(dataSet, { 0x0008, 0x0018 }, MakeUID());
  SetText(dataSet, { 0x0020, 0x0013 }, std::to_string(frame + 1));
  SetText(dataSet, { 0x0018, 0x0050 }, std::isfinite(geometry.thickness) ? FormatDecimal(geometry.thickness) : "");
  SetText(dataSet, { 0x0028, 0x0030 }, Join({ geometry.rowSpacing, geometry.columnSpacing }));
  SetText(dataSet, { 0x0020, 0x0032 }, Join({ geometry.origin[0], geometry.origin[1], geometry.origin[2] }));
  SetText(dataSet,
          { 0x0020, 0x0037 },
          Join({ geometry.right[0],
                 geometry.right[1],
                 geometry.right[2],
                 geometry.down[0],
                 geometry.down[1],
                 geometry.down[2] }));
  SetText(dataSet, { 0x0020, 0x0020 }, NameDirection(geometry.right) + '\\' + NameDirection(geometry.down));
  if (!std::isnan(view.angle))
  {
    SetText(dataSet, { 0x0020, 0x4000 }, "Turned by " + FormatDecimal(view.angle) + " degrees");
  }
  return dataSet;
}

void
SetPixels(DataSet & dataSet, std::vector<std::uint16_t> & pixels)
{
  itk::ByteSwapper<std::uint16_t>::SwapRangeFromSystemToLittleEndian(pixels.data(), pixels.size());
  gdcm::DataElement element(Tag(0x7fe0, 0x0010), 0, gdcm::VR::OW);
  element.SetByteValue(reinterpret_cast<const char *>(pixels.data()),
                       static_cast<std::uint32_t>(pixels.size() * sizeof(std::uint16_t)));
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
  if (frames.image->GetNumberOfComponentsPerPixel() != 1)
  {
    throw std::runtime_error("a DICOM series needs pixels of one component");
  }
  if (size[2] == 0 || views.size() != size[2])
  {
    throw std::runtime_error("there are " + std::to_string(size[2]) + " frames, but " + std::to_string(views.size()) +
                             " views");
  }
  // PixelData has less than 2^32 bytes
  if (std::min(size[0], size[1]) == 0 || std::max(size[0], size[1]) > 65535 || size[0] * size[1] > 0x7ffffffe)
  {
    throw std::runtime_error("a picture of " + std::to_string(size[0]) + " x " + std::to_string(size[1]) +
                             " pixels is not possible in DICOM");
  }
  if (options.window && !(options.window->first < options.window->second))
  {
    throw std::runtime_error("the lower end of a window must be less than the upper one");
  }
  RequireText(options.derivation, 1024);
  RequireText(options.description, 64);
  RequireText(options.program, 64);
  RequireText(options.version, 64);
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

double
ComputeDepthOfCentre(const itk::Transform<double, 3, 3> * transform, const itk::ImageBase<3> * grid)
{
  const auto      axes = itk::ShearWarpFactorization::GetLinearPart(transform);
  const PointType origin = transform->TransformPoint(PointType(0.0));
  return (itk::Matrix<double, 3, 3>(axes.GetInverse()) * (itk::ShearWarpMIPView::GetCentre(grid) - origin))[2];
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
  for (std::size_t frame = 0; frame < views.size(); ++frame)
  {
    geometries.push_back(ComputeGeometry(*frames.image, views[frame], frame));
  }
  const Path temporary = files.BeginFolder(directory);
  gdcm::UIDGenerator::SetRoot(itk::GDCMImageIO::New()->GetUIDPrefix());

  DispatchPixelType(frames.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    const PixelType * const begin = CastImage<PixelType>(frames).GetBufferPointer();
    const std::size_t       length = size[0] * size[1];
    const Rescale           rescale = ChooseRescale(begin, begin + length * size[2]);
    const DataSet           header = MakeHeader(frames, source, options, rescale);

    std::vector<std::uint16_t> pixels(length);
    for (std::size_t frame = 0; frame < views.size(); ++frame)
    {
      HeldSignals::RequireNone();
      const PixelType * const first = begin + frame * length;
      std::transform(first, first + length, pixels.begin(), [&rescale](PixelType value) {
        return rescale.Apply(static_cast<double>(value));
      });
      DataSet dataSet = MakeFrame(header, geometries[frame], views[frame], frame);
      SetPixels(dataSet, pixels);
      const Path name = GetFrameName(frame, views.size());
      WriteFile(dataSet, temporary / name, directory / name);
    }
  });
}
