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
#ifndef itkShearWarpMIPPartImageFilter_hxx
#define itkShearWarpMIPPartImageFilter_hxx

#include "itkIdentityTransform.h"

#include <algorithm>

namespace itk
{
template <typename TInputImage>
ShearWarpMIPPartImageFilter<TInputImage>::ShearWarpMIPPartImageFilter()
{
  Self::AddRequiredInputName("Transform");
  this->SetTransform(IdentityTransform<double, 3>::New());
}

template <typename TInputImage>
void
ShearWarpMIPPartImageFilter<TInputImage>::VerifyPreconditions() const
{
  Superclass::VerifyPreconditions();
  this->template VerifyInputType<DecoratedTransformType>("Transform", "the view, a decorated transform");
  ShearWarpFactorization::VerifyViewTransform(this->GetTransform());
}

template <typename TInputImage>
void
ShearWarpMIPPartImageFilter<TInputImage>::VerifyInputInformation() const
{
  ShearWarp::VerifyInputGeometry(this->GetInput());
  Superclass::VerifyInputInformation();
}

template <typename TInputImage>
void
ShearWarpMIPPartImageFilter<TInputImage>::SetWholeRegion(const RegionType & region)
{
  if (m_WholeRegion != region)
  {
    m_WholeRegion = region;
    this->ReleasePreparedVolume();
    this->Modified();
  }
}

template <typename TInputImage>
auto
ShearWarpMIPPartImageFilter<TInputImage>::GetWhole() const -> RegionType
{
  return m_WholeRegion.GetNumberOfPixels() == 0 ? this->GetInput()->GetLargestPossibleRegion() : m_WholeRegion;
}

template <typename TInputImage>
auto
ShearWarpMIPPartImageFilter<TInputImage>::GetPart() const -> RegionType
{
  const InputImageType * input = this->GetInput();
  return input->GetBufferedRegion().GetNumberOfPixels() == 0 ? input->GetLargestPossibleRegion()
                                                             : input->GetBufferedRegion();
}

template <typename TInputImage>
ShearWarpFactorization
ShearWarpMIPPartImageFilter<TInputImage>::FactorizePart() const
{
  const auto whole = ImageBase<3>::New();
  whole->CopyInformation(this->GetInput());
  whole->SetLargestPossibleRegion(this->GetWhole());
  // the grid of a picture, which there is none of
  const auto grid = ImageBase<2>::New();
  return ShearWarpFactorization(this->GetTransform(), whole, grid, this->m_Oversampling).MakePart(this->GetPart());
}

template <typename TInputImage>
void
ShearWarpMIPPartImageFilter<TInputImage>::GenerateOutputInformation()
{
  this->GetOutput()->SetLargestPossibleRegion(this->FactorizePart().GetIntermediateRegion());
}

template <typename TInputImage>
void
ShearWarpMIPPartImageFilter<TInputImage>::GenerateInputRequestedRegion()
{
  const_cast<InputImageType *>(this->GetInput())->SetRequestedRegion(this->GetPart());
}

template <typename TInputImage>
std::vector<double>
ShearWarpMIPPartImageFilter<TInputImage>::GetSettings() const
{
  std::vector<double> settings = Superclass::GetSettings();
  Superclass::AddRegion(m_WholeRegion, settings);
  return settings;
}

template <typename TInputImage>
auto
ShearWarpMIPPartImageFilter<TInputImage>::GetState() -> State
{
  State state = Superclass::GetState();
  if (const InputImageType * input = this->GetInput())
  {
    Superclass::AddRegion(input->GetBufferedRegion(), state.settings);
  }
  return state;
}

template <typename TInputImage>
void
ShearWarpMIPPartImageFilter<TInputImage>::GeneratePixels()
{
  const InputImageType *                              input = this->GetInput();
  const ShearWarpFactorization                        factorization = this->FactorizePart();
  typename InputImageType::PixelContainerConstPointer voxels;
  ShearWarp::Volume<InputPixelType>                   volume{ input, this->GetWhole() };
  volume.load = [&](const ShearWarp::SliceRange &) { voxels = this->VerifyVoxels("input", input); };
  typename OutputImageType::PixelContainerPointer pixels;
  const auto                                      getPixels = [&] {
    pixels = this->VerifyPixels(this->GetOutput(), factorization.GetIntermediateRegion().GetNumberOfPixels());
    return pixels->GetBufferPointer();
  };
  this->m_Engine.ProjectPart(volume, factorization, this->m_ReducedResampling, getPixels, this->GetThreads());
  this->UpdateProgress(1.0f);
}

template <typename TInputImage>
void
ShearWarpMIPPartImageFilter<TInputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  os << indent << "Transform: " << this->GetTransform() << std::endl;
  os << indent << "WholeRegion: " << m_WholeRegion << std::endl;
}
} // namespace itk

#endif
