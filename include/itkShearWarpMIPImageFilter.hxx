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
  return ShearWarp::TransformPixel(
    m_PictureSpace, static_cast<double>(index[0]), static_cast<double>(index[1]), depth->GetPixel(index));
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
  return { ShearWarp::MakeView(this->GetTransform()) };
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::SetGeometry(ImageBase<OutputImageDimension> * output) const
{
  const ShearWarp::PictureGrid & grid = this->GetScene().picture;
  const SizeType                 size = this->GetPictureSize();

  typename OutputImageType::DirectionType direction;
  direction.SetIdentity();
  if constexpr (OutputImageDimension == 2)
  {
    output->SetLargestPossibleRegion(size);
    output->SetSpacing(grid.spacing);
    output->SetOrigin(grid.origin);
    output->SetDirection(direction);
  }
  else
  {
    const ShearWarp::AffineMap3D & view = this->GetScene().views.front();
    const ShearWarp::DepthRange    slab{ this->GetSlabNear(), this->GetSlabFar() };
    ShearWarp::SliceGeometry       slice{};
    ShearWarp::CallEngine([&] {
      slice = ShearWarp::MakeSliceGeometry(view, grid, ShearWarp::ClipDepths(view, this->GetScene().volume, slab));
    });
    for (unsigned int row = 0; row < 3; ++row)
    {
      for (unsigned int column = 0; column < 3; ++column)
      {
        direction(row, column) = slice.direction[row][column];
      }
    }
    output->SetLargestPossibleRegion(typename OutputImageType::SizeType{ { size[0], size[1], 1 } });
    output->SetSpacing(slice.spacing);
    output->SetOrigin(slice.origin);
    output->SetDirection(direction);
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GeneratePixels()
{
  this->KeepPictureSpace();
  Superclass::GeneratePixels();
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
