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
ShearWarpMIPPartImageFilter<TInputImage>::VerifyPreconditions() ITKv5_CONST
{
  Superclass::VerifyPreconditions();
  this->VerifyOneInput();
  this->template VerifyInputType<DecoratedTransformType>("Transform", "the view, a decorated transform");
  if (!this->GetTransformInput()->GetSource())
  {
    ShearWarpFactorization::VerifyViewTransform(this->GetTransform());
  }
}

template <typename TInputImage>
void
ShearWarpMIPPartImageFilter<TInputImage>::VerifyInputInformation() ITKv5_CONST
{
  Superclass::VerifyInputInformation();
  this->VerifyInputGeometry();
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
  const InputImageType *       input = this->GetInput();
  const ShearWarpFactorization factorization = this->FactorizePart();
  const unsigned int           axis = factorization.GetPrincipalAxis();
  const auto &                 kernels = this->BeginUpdate(factorization);
  this->VerifyVoxels("input", input);

  const RegionType whole = this->GetWhole();
  const bool       hasBlockMaxima = this->m_ReducedResampling != Superclass::ReducedResamplingEnum::Off;
  const bool       isPrepared = this->m_PreparedVolume.IsPrepared(input, axis, hasBlockMaxima);
  const bool       isKept = isPrepared || hasBlockMaxima || axis != 0;
  const auto       first = input->GetBufferedRegion().GetIndex(2) - whole.GetIndex(2);
  const auto       last = first + static_cast<std::ptrdiff_t>(input->GetBufferedRegion().GetSize(2));
  const auto       slabLength =
    isKept ? last - first : this->GetSlabLength(input->GetBufferedRegion().GetSize(), ShearWarp::BlockLength);
  const auto slabs = static_cast<float>(ShearWarp::CountBlocks(last - first, slabLength));
  const auto parallelize = [this](float share) {
    return [this, share](SizeValueType count, SizeValueType steps, const auto & process) {
      this->Parallelize(count, steps, share, process);
    };
  };
  const auto prepare = [this, slabs](SizeValueType count, const auto & process) {
    this->Parallelize(
      count, 1, 0.2f / slabs, [&process](SizeValueType n, SizeValueType, SizeValueType) { process(n); });
  };
  auto & projector = this->m_Projector;
  projector.Start({ { &factorization, {} } },
                  kernels,
                  { ShearWarpMIPImageFilterEnums::Mode::Maximum, false, 0, this->m_ReducedResampling },
                  this->GetNumberOfWorkers());
  for (std::ptrdiff_t begin = first; begin < last; begin += slabLength)
  {
    const auto voxels = this->VerifyVoxels("input", input);
    const auto preparationStart = Superclass::Clock::now();
    if (isKept)
    {
      this->m_PreparedVolume.Prepare(input, whole, axis, hasBlockMaxima, kernels, prepare);
    }
    else
    {
      const std::ptrdiff_t end = std::min(begin + slabLength, last);
      this->m_PreparedVolume.PreparePart(input, whole, begin, end, axis, hasBlockMaxima, kernels, prepare);
    }
    const auto projectionStart = Superclass::Clock::now();
    projector.Project(this->m_PreparedVolume, nullptr, parallelize((isPrepared ? 0.9f : 0.5f) / slabs));
    this->m_PreparationSeconds +=
      isPrepared ? 0.0 : std::chrono::duration<double>(projectionStart - preparationStart).count();
    this->m_ProjectionSeconds += Superclass::SecondsSince(projectionStart);
  }
  this->m_SkippedFraction = projector.GetSkippedFraction();
  const auto finishStart = Superclass::Clock::now();
  const auto part = projector.Finish(0, parallelize(0.05f));
  Superclass::VerifyPixels(this->GetOutput(), part.columns * part.rows);
  InputPixelType * output = this->GetOutput()->GetBufferPointer();
  for (std::ptrdiff_t row = 0; row < part.rows; ++row)
  {
    const InputPixelType *      pixels = part.pixels + row * part.rowStride;
    const ShearWarp::ColumnSpan reached = part.reached[row];
    std::fill(output, output + part.columns, ShearWarp::NoSample<InputPixelType>);
    std::copy(pixels + reached.begin, pixels + reached.end, output + reached.begin);
    output += part.columns;
  }
  this->m_ProjectionSeconds += Superclass::SecondsSince(finishStart);
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
