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
#include "DicomReader.h"
#include "DicomAttribute.h"

bool
DicomReader::Read()
{
  if (gdcm::ImageReader::Read())
  {
    return true;
  }
  gdcm::File &    file = this->GetFile();
  const gdcm::Tag sopClass(0x0008, 0x0016);
  if (GetText(file.GetDataSet(), sopClass) != "1.2.840.10008.5.1.4.1.1.66.7")
  {
    return false;
  }
  const std::string segmentation = "1.2.840.10008.5.1.4.1.1.66.4";
  SetText(file.GetDataSet(), sopClass, segmentation);
  SetText(file.GetHeader(), { 0x0002, 0x0002 }, segmentation);
  this->GetImage().SetTransferSyntax(file.GetHeader().GetDataSetTransferSyntax());
  return this->ReadImage(gdcm::MediaStorage::SegmentationStorage);
}

bool
IsLabelMap(const gdcm::DataSet & header)
{
  return GetText(header, { 0x0062, 0x0001 }) == "LABELMAP";
}
