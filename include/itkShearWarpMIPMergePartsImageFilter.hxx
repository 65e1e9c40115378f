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
#ifndef itkShearWarpMIPMergePartsImageFilter_hxx
#define itkShearWarpMIPMergePartsImageFilter_hxx

namespace itk
{
template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPMergePartsImageFilter<TInputImage, TOutputImage>::VerifyPreconditions() const
{
  Superclass::VerifyPreconditions();
  if (!this->IsPlainMaximum())
  {
    itkExceptionMacro("Parts have plain maxima: Mode, SlabNear, SlabFar, CropLower, CropUpper, MaskImage, "
                      "LocalMaximum, DepthAttenuation, ComputeDepth and Exact must be as by default.");
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPMergePartsImageFilter<TInputImage, TOutputImage>::VerifyIndexedInputs() const
{
  const unsigned int parts = this->GetNumberOfParts();
  for (unsigned int n = 0; n < parts; ++n)
  {
    this->template VerifyInputType<PartImageType>(
      this->MakeNameFromInputIndex(n + 1), "part " + std::to_string(n) + ", a 2D image of ShearWarpMIPPartImageFilter");
    if (!this->GetPart(n))
    {
      itkExceptionMacro("Part " << n << " of " << parts << " is required but not set.");
    }
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPMergePartsImageFilter<TInputImage, TOutputImage>::GenerateInputRequestedRegion()
{
  auto * input = const_cast<TInputImage *>(this->GetInput());
  input->SetRequestedRegion({ input->GetLargestPossibleRegion().GetIndex(), { { 0, 0, 0 } } });
  for (unsigned int n = 0; n < this->GetNumberOfParts(); ++n)
  {
    const_cast<PartImageType *>(this->GetPart(n))->SetRequestedRegionToLargestPossibleRegion();
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPMergePartsImageFilter<TInputImage, TOutputImage>::GeneratePixels()
{
  if (this->GetNumberOfParts() == 0)
  {
    itkExceptionMacro("Parts are required but not set.");
  }
  const ShearWarpFactorization factorization(
    this->GetTransform(), this->GetInput(), this->GetViewGrid(), this->m_Oversampling);
  const ImageRegion<2> & whole = factorization.GetIntermediateRegion();

  std::vector<typename PartImageType::PixelContainerConstPointer> containers;
  std::vector<ShearWarp::IntermediatePart<InputPixelType>>        parts;
  for (unsigned int n = 0; n < this->GetNumberOfParts(); ++n)
  {
    const PartImageType *  part = this->GetPart(n);
    const ImageRegion<2> & region = part->GetBufferedRegion();
    if (region != part->GetLargestPossibleRegion() || !whole.IsInside(region))
    {
      itkExceptionMacro("Part " << n << " must be buffered and lie within the intermediate image, " << whole
                                << ", but its buffered region is " << region);
    }
    containers.push_back(this->VerifyVoxels("part " + std::to_string(n), part));
    parts.push_back({ part->GetBufferPointer(), region });
  }

  typename TOutputImage::PixelContainerPointer pixels;
  const auto                                   getPixels = [&] {
    pixels = this->VerifyPixels(this->GetOutput(), this->GetViewGrid()->GetLargestPossibleRegion().GetNumberOfPixels());
    return pixels->GetBufferPointer();
  };
  this->m_Engine.WarpParts(
    parts, factorization, this->GetViewGrid(), this->GetDefaultPixelValue(), getPixels, this->GetThreads());
  this->UpdateProgress(1.0f);
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPMergePartsImageFilter<TInputImage, TOutputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  os << indent << "NumberOfParts: " << this->GetNumberOfParts() << std::endl;
}
} // namespace itk

#endif
