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
#ifndef AnyImage_h
#define AnyImage_h

#include "itkImage.h"
#include "itkImageIOBase.h"
#include "itkVectorImage.h"

#include <filesystem>
#include <string>
#include <vector>

/** A 3D image of one of ITK's component types, an itk::VectorImage. */
struct AnyImage
{
  itk::ImageBase<3>::Pointer image;
  itk::IOComponentEnum       componentType{ itk::IOComponentEnum::UNKNOWNCOMPONENTTYPE };
};

/** Images of one grid and pixel type. */
struct Volume
{
  std::vector<AnyImage> times;
  double                timeSpacing{ 1.0 };
  double                timeOrigin{ 0.0 };
  /** Owns the pixels. */
  itk::Object::Pointer pixels{};
  /** The files, if they are DICOM. */
  std::vector<std::filesystem::path> dicomFiles{};
  /** Whether low values are to be displayed white. */
  bool isInverted{ false };
  /** Whether values are SUV by body weight. */
  bool isSuv{ false };
  /** Whether the file says how the image lies in the patient. */
  bool hasOrientation{ true };
  /** Files from which the file was made, if it says so; not for files that nobody trusts. */
  std::vector<std::filesystem::path> sourceFiles{};
};

template <typename TPixel>
struct PixelTag
{
  using Type = TPixel;
};

/** Returns function(PixelTag<T>()), where T is the pixel type that \a componentType names. */
template <typename TFunction>
auto
DispatchPixelType(itk::IOComponentEnum componentType, const TFunction & function)
{
  switch (componentType)
  {
    case itk::IOComponentEnum::UCHAR:
      return function(PixelTag<unsigned char>());
    case itk::IOComponentEnum::CHAR:
      return function(PixelTag<signed char>());
    case itk::IOComponentEnum::USHORT:
      return function(PixelTag<unsigned short>());
    case itk::IOComponentEnum::SHORT:
      return function(PixelTag<short>());
    case itk::IOComponentEnum::UINT:
      return function(PixelTag<unsigned int>());
    case itk::IOComponentEnum::INT:
      return function(PixelTag<int>());
    case itk::IOComponentEnum::ULONG:
      return function(PixelTag<unsigned long>());
    case itk::IOComponentEnum::LONG:
      return function(PixelTag<long>());
    case itk::IOComponentEnum::ULONGLONG:
      return function(PixelTag<unsigned long long>());
    case itk::IOComponentEnum::LONGLONG:
      return function(PixelTag<long long>());
    case itk::IOComponentEnum::FLOAT:
      return function(PixelTag<float>());
    case itk::IOComponentEnum::DOUBLE:
      return function(PixelTag<double>());
    default:
      itkGenericExceptionMacro("Pixels of type " << itk::ImageIOBase::GetComponentTypeAsString(componentType)
                                                 << " are not supported.");
  }
}

template <typename TPixel>
itk::VectorImage<TPixel, 3> &
CastImage(const AnyImage & anyImage)
{
  return dynamic_cast<itk::VectorImage<TPixel, 3> &>(*anyImage.image);
}

/** Makes an image of a grid with \a pixels, or pixels of its own if that is null. */
template <typename TPixel>
AnyImage
MakeAnyImage(const itk::ImageBase<3> *                              grid,
             unsigned int                                           components,
             typename itk::VectorImage<TPixel, 3>::PixelContainer * pixels = nullptr)
{
  const auto image = itk::VectorImage<TPixel, 3>::New();
  image->CopyInformation(grid);
  image->SetRegions(grid->GetLargestPossibleRegion());
  image->SetNumberOfComponentsPerPixel(components);
  if (pixels)
  {
    image->SetPixelContainer(pixels);
  }
  else
  {
    image->Allocate();
  }
  return { image.GetPointer(), itk::ImageIOBase::MapPixelType<TPixel>::CType };
}

/** Makes a volume of so many points in time, whose pixels lie one after the other in \a pixels. */
template <typename TPixel>
Volume
MakeVolume(const itk::ImageBase<3> *                              grid,
           unsigned int                                           components,
           std::size_t                                            times,
           typename itk::VectorImage<TPixel, 3>::PixelContainer * pixels)
{
  using ContainerType = typename itk::VectorImage<TPixel, 3>::PixelContainer;
  const auto count = grid->GetLargestPossibleRegion().GetNumberOfPixels() * components;
  Volume     volume;
  volume.pixels = pixels;
  for (std::size_t time = 0; time < times; ++time)
  {
    const auto ofTime = ContainerType::New();
    ofTime->SetImportPointer(pixels->GetBufferPointer() + time * count, count, false);
    volume.times.push_back(MakeAnyImage<TPixel>(grid, components, ofTime));
  }
  return volume;
}

#endif
