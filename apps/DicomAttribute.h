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
#ifndef DicomAttribute_h
#define DicomAttribute_h

#include "Text.h"

#include <gdcmDataSet.h>

#include <string>

/** The value of an attribute of text, without what fills it up to an even length. */
inline std::string
GetText(const gdcm::DataSet & dataSet, const gdcm::Tag & tag)
{
  const gdcm::ByteValue * const value = dataSet.GetDataElement(tag).GetByteValue();
  if (!value)
  {
    return "";
  }
  const std::string text(value->GetPointer(), value->GetLength());
  return Trim(text.substr(0, text.find('\0')));
}

#endif
