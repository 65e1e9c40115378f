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
#include "Input.h"

#include "itkImageIOFactory.h"

namespace itk::ShearWarpBenchmark
{
namespace
{
PixelType
GetPixelType(IOComponentEnum component)
{
  switch (component)
  {
    case IOComponentEnum::UCHAR:
      return PixelType::UInt8;
    case IOComponentEnum::USHORT:
      return PixelType::UInt16;
    case IOComponentEnum::FLOAT:
    case IOComponentEnum::DOUBLE:
      return PixelType::Float;
    default:
      return PixelType::Int16;
  }
}
} // namespace

FileInformation
ReadInformation(const std::string & file)
{
  const ImageIOBase::Pointer io = ImageIOFactory::CreateImageIO(file.c_str(), IOFileModeEnum::ReadMode);
  if (!io)
  {
    itkGenericExceptionMacro("'" << file << "' is not an image that ITK can read.");
  }
  io->SetFileName(file);
  io->ReadImageInformation();
  if (io->GetNumberOfDimensions() != 3 || io->GetNumberOfComponents() != 1)
  {
    itkGenericExceptionMacro("'" << file << "' has " << io->GetNumberOfDimensions() << " dimensions and "
                                 << io->GetNumberOfComponents() << " components; 3 and 1 are needed.");
  }
  FileInformation information;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    information.size[axis] = io->GetDimensions(axis);
  }
  information.pixelType = GetPixelType(io->GetComponentType());
  return information;
}
} // namespace itk::ShearWarpBenchmark
