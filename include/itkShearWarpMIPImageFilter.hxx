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
#ifndef itkShearWarpMIPImageFilter_hxx
#define itkShearWarpMIPImageFilter_hxx

#include "itkIdentityTransform.h"

#include <cmath>

namespace itk
{
template <typename TInputImage, typename TOutputImage>
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::ShearWarpMIPImageFilter()
{
  Self::AddRequiredInputName("Transform");
  this->SetTransform(IdentityTransform<double, 3>::New());
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GetPhysicalPoint(const OutputIndexType & index) const
  -> PhysicalPointType
{
  const DepthImageType * depth = this->GetDepthOutput();
  if (!depth || !depth->GetBufferedRegion().IsInside(index))
  {
    itkExceptionMacro("There is no depth at index " << index
                                                    << ": ComputeDepth must be on, and the index of a pixel of "
                                                    << "the last update.");
  }
  const auto w = static_cast<double>(depth->GetPixel(index));
  if (!std::isfinite(w))
  {
    itkExceptionMacro("No ray has a value at index " << index << '.');
  }
  return m_PictureSpace(static_cast<double>(index[0]), static_cast<double>(index[1]), w);
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::VerifyPreconditions() ITKv5_CONST
{
  Superclass::VerifyPreconditions();
  this->template VerifyInputType<DecoratedTransformType>("Transform", "the view, a decorated transform");
  if (!this->GetTransformInput()->GetSource())
  {
    ShearWarpFactorization::VerifyViewTransform(this->GetTransform());
  }
  const unsigned int parts = this->GetNumberOfParts();
  for (unsigned int n = 0; n < parts; ++n)
  {
    this->template VerifyInputType<PartImageType>(
      this->MakeNameFromInputIndex(n + 1), "part " + std::to_string(n) + ", a 2D image of ShearWarpMIPPartImageFilter");
    if (!this->GetPart(n))
    {
      itkExceptionMacro("Part " << n << " of " << parts << " is required but not set.");
    }
    if (!this->IsPlainMaximum())
    {
      itkExceptionMacro("Parts have plain maxima: Mode, SlabNear, SlabFar, CropLower, CropUpper, MaskImage, "
                        "LocalMaximum, DepthAttenuation and ComputeDepth must be as by default.");
    }
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GenerateInputRequestedRegion()
{
  const unsigned int parts = this->GetNumberOfParts();
  if (parts == 0)
  {
    Superclass::GenerateInputRequestedRegion();
    return;
  }
  auto * input = const_cast<TInputImage *>(this->GetInput());
  input->SetRequestedRegion({ input->GetLargestPossibleRegion().GetIndex(), { { 0, 0, 0 } } });
  for (unsigned int n = 0; n < parts; ++n)
  {
    const_cast<PartImageType *>(this->GetPart(n))->SetRequestedRegionToLargestPossibleRegion();
  }
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::MakeViews() const -> typename Superclass::ViewList
{
  return { 1, [view = ShearWarp::ViewSpace(this->GetTransform())](SizeValueType) { return view; } };
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::SetGeometry(ImageBase<OutputImageDimension> * output) const
{
  const ImageBase<2> * grid = this->GetViewGrid();
  if constexpr (OutputImageDimension == 2)
  {
    output->CopyInformation(grid);
  }
  else
  {
    const ShearWarp::ViewSpace  view(this->GetTransform());
    const ShearWarp::DepthRange slab{ this->GetSlabNear(), this->GetSlabFar() };
    const auto [spacing, origin, direction] =
      ShearWarp::MakeSliceGeometry(view, grid, ShearWarp::ClipDepths(view, this->GetInput(), slab));
    if (!(spacing[2] > 0.0 && std::isfinite(spacing[2])))
    {
      itkExceptionMacro("SlabNear and SlabFar must be within the range of the output's geometry, but they are "
                        << this->GetSlabNear() << " and " << this->GetSlabFar() << '.');
    }
    const SizeType size = grid->GetLargestPossibleRegion().GetSize();
    output->SetLargestPossibleRegion(typename OutputImageType::SizeType{ { size[0], size[1], 1 } });
    output->SetSpacing(spacing);
    output->SetOrigin(origin);
    output->SetDirection(direction);
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GeneratePixels()
{
  if (this->GetNumberOfParts() > 0)
  {
    this->WarpParts();
    return;
  }
  Superclass::GeneratePixels();
  if (this->GetComputeDepth())
  {
    // for GetPhysicalPoint(), whatever is set afterwards
    m_PictureSpace = ShearWarp::MakePictureSpace(ShearWarp::ViewSpace(this->GetTransform()), this->GetViewGrid());
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::WarpParts()
{
  const ShearWarpFactorization factorization(
    this->GetTransform(), this->GetInput(), this->GetViewGrid(), this->m_Oversampling);
  const ImageRegion<2> whole = factorization.GetIntermediateRegion();

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
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  os << indent << "Transform: " << this->GetTransform() << std::endl;
  os << indent << "NumberOfParts: " << this->GetNumberOfParts() << std::endl;
}
} // namespace itk

#endif
