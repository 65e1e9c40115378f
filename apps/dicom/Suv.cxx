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
#include "Suv.h"
#include "DicomAttribute.h"
#include "DicomPet.h"

#include <gdcmPrivateTag.h>
#include <gdcmSequenceOfItems.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <regex>
#include <sstream>
#include <stdexcept>

namespace
{
using gdcm::DataSet;
using gdcm::Tag;

const Tag acquisitionDate(0x0008, 0x0022);
const Tag correctedImage(0x0028, 0x0051);
const Tag decayCorrection(0x0054, 0x1102);
const Tag radiopharmaceutical(0x0054, 0x0016);
const Tag startDateTime(0x0018, 0x1078);
const Tag startTime(0x0018, 0x1072);
const Tag suvType(0x0054, 0x1006);
const Tag units(0x0054, 0x1001);

constexpr double secondsOfDay = 86400.0;

[[noreturn]] void
Refuse(const Tag & tag, const std::string & reason)
{
  throw std::runtime_error("--suv is not possible: " + Describe(tag) + ' ' + reason);
}

std::string
RequireText(const DataSet & dataSet, const Tag & tag)
{
  std::string text = GetText(dataSet, tag);
  if (text.empty())
  {
    Refuse(tag, "is missing");
  }
  return text;
}

double
RequirePositive(const DataSet & dataSet, const Tag & tag)
{
  const std::string text = RequireText(dataSet, tag);
  const auto        numbers = ParseNumbers(text);
  if (numbers.size() != 1 || !(numbers[0] > 0.0))
  {
    Refuse(tag, "is '" + text + "', not a positive number");
  }
  return numbers[0];
}

/** Seconds of the offset from UTC at the end of a date and time, as +0130. */
std::optional<double>
ParseOffset(const std::string & text)
{
  std::smatch match;
  if (!std::regex_search(text, match, std::regex("([+-])(\\d\\d)(\\d\\d)$")))
  {
    return {};
  }
  return (match[1] == "-" ? -60.0 : 60.0) * (60.0 * std::stoi(match[2]) + std::stoi(match[3]));
}

/** Seconds of YYYYMMDDHHMMSS.FFFFFF, of which minutes, seconds and an offset, which is ignored, may be missing (PS3.5
 * 6.2). */
std::optional<double>
ParseDateTime(const std::string & text)
{
  std::smatch match;
  if (!std::regex_match(
        text,
        match,
        std::regex(
          "(\\d{4})(\\d\\d)(\\d\\d)([01]\\d|2[0-3])(?:([0-5]\\d)(?:([0-5]\\d|60)(\\.\\d{1,6})?)?)?(?:[+-]\\d{4})?")))
  {
    return {};
  }
  const auto number = [&match](std::size_t n) { return match[n].matched ? std::stoi(match[n]) : 0; };
  const int  year = number(1);
  const int  month = number(2);
  const int  day = number(3);
  if (month < 1 || month > 12 || day < 1 || day > 31)
  {
    return {};
  }
  // the Julian day (Fliegel and van Flandern 1968)
  const int shift = (month - 14) / 12;
  const int julianDay = day - 32075 + 1461 * (year + 4800 + shift) / 4 + 367 * (month - 2 - 12 * shift) / 12 -
                        3 * ((year + 4900 + shift) / 100) / 4;
  return julianDay * secondsOfDay + 3600.0 * number(4) + 60.0 * number(5) + number(6) +
         (match[7].matched ? std::stod(match[7]) : 0.0);
}

double
RequireDateTime(const Tag & tag, const std::string & text)
{
  const auto time = ParseDateTime(text);
  if (!time)
  {
    Refuse(tag, "is of no use: '" + text + "' is no date and time");
  }
  return *time;
}

double
RequireDateTime(const DataSet & dataSet, std::uint16_t date, std::uint16_t time)
{
  return RequireDateTime(Tag(0x0008, time),
                         RequireText(dataSet, { 0x0008, date }) + RequireText(dataSet, { 0x0008, time }));
}

double
FindScanStart(const DataSet & image, double halfLife)
{
  const double series = RequireDateTime(image, 0x0021, 0x0031);
  const double acquisition = RequireDateTime(image, 0x0022, 0x0032);
  if (series <= acquisition)
  {
    return series;
  }
  const gdcm::PrivateTag scanDateTime(0x0009, 0x0d, "GEMS_PETD_01");
  if (image.FindDataElement(scanDateTime))
  {
    const auto * const value = image.GetDataElement(scanDateTime).GetByteValue();
    return RequireDateTime(scanDateTime, value ? Trim({ value->GetPointer(), value->GetLength() }) : "");
  }
  // Frame Reference Time is when the mean of the decaying activity occurs
  const double decay = std::log(2.0) / halfLife;
  const double duringFrame = decay * RequirePositive(image, { 0x0018, 0x1242 }) / 1000.0;
  const double mean = std::log(duringFrame / -std::expm1(-duringFrame)) / decay;
  return acquisition - RequirePositive(image, { 0x0054, 0x1300 }) / 1000.0 + mean;
}

double
FindInjection(const DataSet & image, const DataSet & drug, double scan)
{
  const std::string dateTime = GetText(drug, startDateTime);
  if (dateTime.empty())
  {
    const std::string day = RequireText(image, { 0x0008, 0x0021 });
    const double      clock = RequireDateTime(startTime, day + RequireText(drug, startTime));
    // over midnight it is the day before
    return clock - std::ceil((clock - scan) / secondsOfDay) * secondsOfDay;
  }
  double     injection = RequireDateTime(startDateTime, dateTime);
  const auto offset = ParseOffset(dateTime);
  const auto offsetOfImage = ParseOffset(GetText(image, { 0x0008, 0x0201 }));
  if (offset && offsetOfImage)
  {
    injection += *offsetOfImage - *offset;
  }
  if (injection > scan)
  {
    Refuse(startDateTime, "is of no use: " + dateTime + " is after the start of the scan");
  }
  return injection;
}

double
ComputeFactor(const DataSet & image, const WarningFunction & warn)
{
  const std::string unit = RequireText(image, units);
  if (unit == "GML")
  {
    const std::string type = GetText(image, suvType);
    if (!type.empty() && type != "BW")
    {
      Refuse(suvType, "is " + type + ": BW is needed");
    }
    return 1.0;
  }
  if (unit != "BQML")
  {
    Refuse(units, "is " + unit + ": BQML is needed");
  }
  const std::string corrections = RequireText(image, correctedImage);
  for (const std::string correction : { "ATTN", "DECY" })
  {
    if (corrections.find(correction) == std::string::npos)
    {
      Refuse(correctedImage, "is " + corrections + ", without " + correction);
    }
  }
  const std::string decay = RequireText(image, decayCorrection);
  if (decay != "START" && decay != "ADMIN")
  {
    Refuse(decayCorrection, "is " + decay + ": START or ADMIN is needed");
  }
  const auto sequence = image.GetDataElement(radiopharmaceutical).GetValueAsSQ();
  if (!sequence || sequence->GetNumberOfItems() == 0)
  {
    Refuse(radiopharmaceutical, "is missing");
  }
  const DataSet & drug = sequence->GetItem(1).GetNestedDataSet();
  const double    weight = 1000.0 * RequirePositive(image, { 0x0010, 0x1030 });
  double          dose = RequirePositive(drug, { 0x0018, 0x1074 });
  if (decay == "START")
  {
    const double halfLife = RequirePositive(drug, { 0x0018, 0x1075 });
    const double scan = FindScanStart(image, halfLife);
    dose *= std::exp2((FindInjection(image, drug, scan) - scan) / halfLife);
  }
  // from 10 g and 1 GBq to 70 kg and 1.4 MBq
  const double factor = weight / dose;
  if (!(factor > 1e-8 && factor < 0.05))
  {
    std::ostringstream message;
    message << "--suv: a weight of " << weight / 1000.0 << " kg and a dose of " << dose
            << " Bq at the scan are unusual; are weight, dose, half-life and times right?";
    warn(message.str());
  }
  return factor;
}
} // namespace

bool
ConvertToSuv(Volume & volume, const WarningFunction & warn)
{
  if (volume.isSuv)
  {
    return true;
  }
  const DataSet image = volume.dicomFiles.empty() ? DataSet() : ReadFirstAcquired(volume.dicomFiles);
  if (GetText(image, { 0x0008, 0x0016 }) != petImageStorage)
  {
    return false;
  }
  const double factor = ComputeFactor(image, warn);
  for (AnyImage & time : volume.times)
  {
    const unsigned int components = time.image->GetNumberOfComponentsPerPixel();
    const AnyImage     converted = MakeAnyImage<float>(time.image, components);
    float * const      values = CastImage<float>(converted).GetBufferPointer();
    DispatchPixelType(time.componentType, [&](auto tag) {
      using PixelType = typename decltype(tag)::Type;
      auto &                  pixels = *CastImage<PixelType>(time).GetPixelContainer();
      const PixelType * const begin = pixels.GetBufferPointer();
      std::transform(begin, begin + pixels.Size(), values, [factor](PixelType value) {
        return static_cast<float>(factor * static_cast<double>(value));
      });
    });
    time = converted;
  }
  volume.isSuv = true;
  return true;
}
