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
  return m_PictureSpace(
    static_cast<double>(index[0]), static_cast<double>(index[1]), static_cast<double>(depth->GetPixel(index)));
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::VerifyPreconditions() const
{
  Superclass::VerifyPreconditions();
  this->template VerifyInputType<DecoratedTransformType>("Transform", "the view, a decorated transform");
  ShearWarpFactorization::VerifyViewTransform(this->GetTransform());
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
  Superclass::GeneratePixels();
  if (this->GetComputeDepth())
  {
    // for GetPhysicalPoint(), whatever is set afterwards
    m_PictureSpace = ShearWarp::MakePictureSpace(ShearWarp::ViewSpace(this->GetTransform()), this->GetViewGrid());
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  os << indent << "Transform: " << this->GetTransform() << std::endl;
}
} // namespace itk

#endif
