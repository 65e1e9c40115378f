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

#include <filesystem>
#include <istream>
#include <optional>
#include <string>
#include <vector>

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

/** A text in UTF-8, from the character set of \a header, fit for a line. */
std::string
GetLine(const gdcm::DataSet & dataSet, const gdcm::Tag & tag, const gdcm::DataSet & header);

/** The kind of value, which files without such have by the dictionary. */
gdcm::VR
GetVR(const gdcm::DataElement & element);

/** Name and tag, as Units (0054,1001). */
std::string
Describe(const gdcm::Tag & tag);

/** The attributes of a DICOM file before its pixels, also if GDCM does not know how these are compressed. None if it
 * cannot be parsed as DICOM. */
std::optional<gdcm::DataSet>
FindHeader(std::istream & file);

/** The attributes of a DICOM file before its pixels. Throws if it is none. */
gdcm::DataSet
ReadHeader(const std::filesystem::path & path);

/** Sets an attribute of text, with the dictionary's VR. */
void
SetText(gdcm::DataSet & dataSet, const gdcm::Tag & tag, std::string text);

/** Copies an attribute by the dictionary's VR, as an element of a file without VRs would lose its own: text, or a
 * sequence of such. It is empty if \a from has none. */
void
CopyAttribute(const gdcm::DataSet & from, gdcm::DataSet & to, const gdcm::Tag & tag);

/** Adds an item to a sequence, which is made if it is not there. */
void
AddItem(gdcm::DataSet & dataSet, const gdcm::Tag & tag, const gdcm::DataSet & nested);

/** As many finite numbers as \a text has, or none. */
std::vector<double>
ParseNumbers(const std::string & text);

/** \a number as a decimal string, which has at most 16 characters (PS3.5 6.2). */
std::string
FormatDecimal(double number);

#endif
