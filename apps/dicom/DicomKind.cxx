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
#include "DicomKind.h"
#include "DicomAttribute.h"

#include <gdcmUIDs.h>

#include <algorithm>
#include <string>

using gdcm::DataSet;
using gdcm::Tag;

namespace
{
/** Whether Image Type (0008,0008) has a term. */
bool
HasType(const DataSet & header, const std::string & term)
{
  return ('\\' + GetText(header, { 0x0008, 0x0008 }) + '\\').find('\\' + term + '\\') != std::string::npos;
}
} // namespace

bool
IsImage(const DataSet & header)
{
  const std::string sopClass = GetText(header, { 0x0008, 0x0016 });
  gdcm::UIDs        uids;
  const char *      name = uids.SetFromUID(sopClass.c_str()) ? uids.GetName() : nullptr;
  return header.FindDataElement(Tag(0x0028, 0x0100)) ||
         (name && std::string(name).find(" Image Storage") != std::string::npos);
}

bool
IsProjection(const DataSet & header)
{
  const auto terms = { "PROJECTION IMAGE", "MAX_IP", "MIN_IP" };
  return std::any_of(terms.begin(), terms.end(), [&header](const char * term) { return HasType(header, term); }) ||
         GetText(header, { 0x0054, 0x1000 }).find("REPROJECTION") != std::string::npos;
}

bool
IsMosaic(const DataSet & header)
{
  const gdcm::ByteValue * const count =
    header.GetDataElement(gdcm::PrivateTag(0x0019, 0x0a, "SIEMENS MR HEADER")).GetByteValue();
  // anonymizers may change Image Type
  const bool hasTiles =
    count && count->GetLength() == 2 && (count->GetPointer()[0] & 0xfe || count->GetPointer()[1] != 0);
  return hasTiles || HasType(header, "MOSAIC");
}

bool
IsSegmentation(const DataSet & header)
{
  const std::string sopClass = GetText(header, { 0x0008, 0x0016 });
  return sopClass == "1.2.840.10008.5.1.4.1.1.66.4" || sopClass == "1.2.840.10008.5.1.4.1.1.66.7";
}
