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
#include "DicomAttribute.h"
#include "CharacterSet.h"

#include <gdcmDict.h>
#include <gdcmDicts.h>
#include <gdcmExplicitDataElement.h>
#include <gdcmFileMetaInformation.h>
#include <gdcmGlobal.h>
#include <gdcmPreamble.h>
#include <gdcmReader.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmSwapper.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

using gdcm::DataSet;
using gdcm::Tag;

namespace
{
gdcm::VR
GetVR(const Tag & tag)
{
  return tag.IsPublic() ? gdcm::Global::GetInstance().GetDicts().GetDictEntry(tag).GetVR() : gdcm::VR();
}

/** It is made if it is not there. */
gdcm::SmartPointer<gdcm::SequenceOfItems>
GetSequence(DataSet & dataSet, const Tag & tag)
{
  if (dataSet.FindDataElement(tag))
  {
    return dataSet.GetDataElement(tag).GetValueAsSQ();
  }
  const gdcm::SmartPointer<gdcm::SequenceOfItems> sequence = new gdcm::SequenceOfItems;
  sequence->SetLengthToUndefined();
  gdcm::DataElement element(tag, 0, gdcm::VR::SQ);
  element.SetValue(*sequence);
  element.SetVLToUndefined();
  dataSet.Insert(element);
  return sequence;
}
} // namespace

gdcm::VR
GetVR(const gdcm::DataElement & element)
{
  const gdcm::VR vr = element.GetVR();
  return vr == gdcm::VR::INVALID || vr == gdcm::VR::UN ? GetVR(element.GetTag()) : vr;
}

std::string
Describe(const Tag & tag)
{
  std::ostringstream text;
  if (tag.IsPublic())
  {
    text << gdcm::Global::GetInstance().GetDicts().GetDictEntry(tag).GetName() << ' ';
  }
  text << tag;
  return text.str();
}

std::string
GetLine(const DataSet & dataSet, const Tag & tag, const DataSet & header)
{
  const std::string text = ConvertToUTF8(GetText(dataSet, tag), GetText(header, { 0x0008, 0x0005 }));
  std::string       line;
  for (std::size_t n = 0; n < text.size(); ++n)
  {
    const auto code = static_cast<unsigned char>(text[n]);
    // also the control characters from U+0080 to U+009F
    const bool isHigh = code == 0xc2 && n + 1 < text.size() && static_cast<unsigned char>(text[n + 1]) < 0xa0;
    line += code < ' ' || code == 0x7f || isHigh ? '?' : text[n];
    n += isHigh ? 1 : 0;
  }
  return line;
}

std::optional<DataSet>
FindHeader(std::istream & file)
{
  const Tag    pixels(0x7fe0, 0x0010);
  gdcm::Reader reader;
  reader.SetStream(file);
  if (reader.ReadUpToTag(pixels, { pixels }))
  {
    return reader.GetFile().GetDataSet();
  }
  gdcm::FileMetaInformation header;
  file.clear();
  file.seekg(0);
  try
  {
    gdcm::Preamble().Read(file);
    header.Read(file);
    return {};
  }
  catch (const gdcm::Exception &)
  {
    // GDCM has read the header, but does not know the compression
    const auto syntax = GetText(header, { 0x0002, 0x0010 });
    if (syntax.empty() || gdcm::TransferSyntax::GetTSType(syntax.c_str()) != gdcm::TransferSyntax::TS_END)
    {
      return {};
    }
  }
  // PS3.5 A.4
  DataSet dataSet;
  dataSet.ReadUpToTag<gdcm::ExplicitDataElement, gdcm::SwapperNoOp>(file, pixels, { pixels });
  return dataSet;
}

DataSet
ReadHeader(const std::filesystem::path & path)
{
  std::ifstream file(path, std::ios::binary);
  const auto    header = FindHeader(file);
  if (!header || GetText(*header, { 0x0008, 0x0018 }).empty())
  {
    throw std::runtime_error("'" + path.string() + "' is not a DICOM file");
  }
  return *header;
}

void
SetText(DataSet & dataSet, const Tag & tag, std::string text)
{
  const gdcm::VR    vr = GetVR(tag);
  gdcm::DataElement element(tag, 0, vr);
  if (text.size() % 2 == 1)
  {
    text += vr == gdcm::VR::UI ? '\0' : ' ';
  }
  element.SetByteValue(text.data(), static_cast<std::uint32_t>(text.size()));
  dataSet.Replace(element);
}

void
CopyAttribute(const DataSet & from, DataSet & to, const Tag & tag)
{
  if (GetVR(tag) & gdcm::VR::VRASCII)
  {
    SetText(to, tag, GetText(from, tag));
  }
  else if (GetVR(tag) == gdcm::VR::SQ)
  {
    GetSequence(to, tag);
    const auto sequence = from.GetDataElement(tag).GetValueAsSQ();
    for (std::size_t item = 1; sequence && item <= sequence->GetNumberOfItems(); ++item)
    {
      const DataSet & nested = sequence->GetItem(item).GetNestedDataSet();
      DataSet         copy;
      for (const gdcm::DataElement & element : nested.GetDES())
      {
        CopyAttribute(nested, copy, element.GetTag());
      }
      AddItem(to, tag, copy);
    }
  }
}

void
AddItem(DataSet & dataSet, const Tag & tag, const DataSet & nested)
{
  gdcm::Item item;
  item.SetVLToUndefined();
  item.SetNestedDataSet(nested);
  GetSequence(dataSet, tag)->AddItem(item);
}

std::vector<double>
ParseNumbers(const std::string & text)
{
  std::vector<double> numbers;
  std::istringstream  stream(text);
  for (std::string part; std::getline(stream, part, '\\');)
  {
    part = Trim(part);
    char *       end = nullptr;
    const double number = std::strtod(part.c_str(), &end);
    // hexadecimal ones are none of DICOM
    if (part.empty() || *end != '\0' || !std::isfinite(number) || part.find_first_of("xX") != std::string::npos)
    {
      return {};
    }
    numbers.push_back(number);
  }
  return numbers;
}

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
