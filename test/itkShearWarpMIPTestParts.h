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
#ifndef itkShearWarpMIPTestParts_h
#define itkShearWarpMIPTestParts_h

#include "itkImageAlgorithm.h"
#include "itkImageSource.h"
#include "itkShearWarpMIPPartsImageFilter.h"
#include "itkShearWarpMIPTestImages.h"

/** Images that come in parts. */
namespace itk::ShearWarpMIPTest
{
/** A piece of \a image, in memory of its own. */
template <typename TPixel>
typename Image<TPixel, 3>::Pointer
MakePart(const Image<TPixel, 3> * image, const ImageRegion<3> & region)
{
  const auto part = MakeAlike<TPixel>(image, region);
  ImageAlgorithm::Copy(image, part.GetPointer(), region, region);
  return part;
}

/** Boxes of \a least to \a most voxels a side that together are \a whole, each with one voxel more below. */
inline std::vector<ImageRegion<3>>
MakeRandomParts(Random & random, const ImageRegion<3> & whole, int least, int most)
{
  std::vector<ImageRegion<3>> parts{ whole };
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto                  first = whole.GetIndex(axis);
    const auto                  last = first + static_cast<IndexValueType>(whole.GetSize(axis));
    std::vector<ImageRegion<3>> smaller;
    for (auto begin = first; begin < last;)
    {
      const auto end = std::min<IndexValueType>(begin + random.Integer(least, most), last);
      for (ImageRegion<3> part : parts)
      {
        const auto halo = std::max(begin - 1, first);
        part.SetIndex(axis, halo);
        part.SetSize(axis, static_cast<SizeValueType>(end - halo));
        smaller.push_back(part);
      }
      begin = end;
    }
    parts = smaller;
  }
  return parts;
}

/** Only the geometry. */
template <typename TPixel>
typename Image<TPixel, 3>::Pointer
MakeOutline(const Image<TPixel, 3> * image)
{
  auto outline = Image<TPixel, 3>::New();
  outline->CopyInformation(image);
  return outline;
}

/** The filter that makes the picture of \a filter from parts of its input. */
template <typename TInputImage>
auto
MakePartsFilter(const ShearWarpMIPImageFilter<TInputImage> * filter)
{
  const auto parts = ShearWarpMIPPartsImageFilter<TInputImage>::New();
  parts->SetInput(MakeOutline(filter->GetInput()));
  parts->SetTransform(filter->GetTransform());
  parts->SetOversampling(filter->GetOversampling());
  parts->SetMode(filter->GetMode());
  parts->SetInterpolation(filter->GetInterpolation());
  parts->SetSlabNear(filter->GetSlabNear());
  parts->SetSlabFar(filter->GetSlabFar());
  parts->SetCropLower(filter->GetCropLower());
  parts->SetCropUpper(filter->GetCropUpper());
  parts->SetComputeDepth(filter->GetComputeDepth());
  parts->SetExact(filter->GetExact());
  parts->SetDefaultPixelValue(filter->GetDefaultPixelValue());
  parts->SetReducedResampling(filter->GetReducedResampling());
  parts->SetNumberOfWorkUnits(filter->GetNumberOfWorkUnits());
  if (filter->GetSize()[0] > 0)
  {
    parts->SetSize(filter->GetSize());
  }
  if (filter->GetOutputSpacing()[0] > 0.0)
  {
    parts->SetOutputSpacing(filter->GetOutputSpacing());
  }
  if (filter->GetOutputOrigin() != Point<double, 2>(0.0))
  {
    parts->SetOutputOrigin(filter->GetOutputOrigin());
  }
  return parts;
}

/** The picture of the whole image as one part. */
template <typename TInputImage>
auto
ProjectAsOnePart(const ShearWarpMIPImageFilter<TInputImage> * filter)
{
  const auto parts = MakePartsFilter(filter);
  parts->AddPart(parts->ProjectPart(filter->GetInput()));
  parts->Update();
  return Copy(parts->GetOutput());
}

// Gives the requested parts of an image, in memory of their own, and remembers how large they were.
template <typename TPixel>
class PartSource : public ImageSource<Image<TPixel, 3>>
{
public:
  using Self = PartSource;
  using Superclass = ImageSource<Image<TPixel, 3>>;
  using Pointer = SmartPointer<Self>;
  using ImageType = Image<TPixel, 3>;
  itkNewMacro(Self);

  typename ImageType::ConstPointer whole;
  SizeValueType                    executions{ 0 };
  SizeValueType                    mostSlices{ 0 };
  SizeValueType                    missingSlices{ 0 }; // an error

protected:
  void
  GenerateOutputInformation() override
  {
    this->GetOutput()->CopyInformation(whole);
  }

  void
  GenerateData() override
  {
    ImageType * output = this->GetOutput();
    auto        region = output->GetRequestedRegion();
    region.SetSize(2, region.GetSize(2) - missingSlices);
    output->SetBufferedRegion(region);
    output->Allocate();
    ImageAlgorithm::Copy(whole.GetPointer(), output, region, region);
    ++executions;
    mostSlices = std::max(mostSlices, region.GetSize(2));
  }
};

template <typename TPixel>
typename PartSource<TPixel>::Pointer
MakeSource(const Image<TPixel, 3> * image)
{
  auto source = PartSource<TPixel>::New();
  source->whole = image;
  return source;
}

} // namespace itk::ShearWarpMIPTest

#endif
