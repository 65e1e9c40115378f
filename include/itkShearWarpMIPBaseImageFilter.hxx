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
#ifndef itkShearWarpMIPBaseImageFilter_hxx
#define itkShearWarpMIPBaseImageFilter_hxx

#include <algorithm>

namespace itk
{
template <typename TInputImage, typename TOutputImage>
DataObject::Pointer
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::MakeOutput(const ProcessObject::DataObjectIdentifierType & name)
{
  return name == "Depth" ? DepthImageType::New().GetPointer() : Superclass::MakeOutput(name);
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::SetComputeDepth(bool compute)
{
  if (compute != m_ComputeDepth)
  {
    m_ComputeDepth = compute;
    // a second output that is there from the beginning would be allocated too
    if (compute)
    {
      this->ProcessObject::SetOutput("Depth", this->MakeOutput("Depth"));
    }
    else
    {
      this->RemoveOutput("Depth");
    }
    this->Modified();
  }
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetDepthOutput() -> DepthImageType *
{
  return dynamic_cast<DepthImageType *>(this->ProcessObject::GetOutput("Depth"));
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetDepthOutput() const -> const DepthImageType *
{
  return dynamic_cast<const DepthImageType *>(this->ProcessObject::GetOutput("Depth"));
}

template <typename TInputImage, typename TOutputImage>
template <typename TParameter>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::SetGridParameter(TParameter &       parameter,
                                                                         bool &             fit,
                                                                         const TParameter & value)
{
  if (fit || !Superclass::HaveSameBits(parameter, value))
  {
    parameter = value;
    fit = false;
    this->Modified();
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::FitOutputGrid()
{
  if (!(m_FitSize && m_FitOutputSpacing && m_FitOutputOrigin))
  {
    m_Size.Fill(0);
    m_OutputSpacing.Fill(0.0);
    m_OutputOrigin.Fill(0.0);
    m_FitSize = m_FitOutputSpacing = m_FitOutputOrigin = true;
    this->Modified();
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::VerifyPreconditions() const
{
  Superclass::VerifyPreconditions();
  this->template VerifyInputType<MaskImageType>("MaskImage", "the mask, a 3D image of unsigned char");
  if (m_NumberOfStreamDivisions == 0)
  {
    itkExceptionMacro("NumberOfStreamDivisions must be positive, but it is 0.");
  }
  if (m_Mode > ModeEnum::AbsoluteMaximum)
  {
    itkExceptionMacro("Mode must be one of its enumerators, but it is " << static_cast<unsigned int>(m_Mode) << '.');
  }
  this->MakeRule().Verify();
  if (m_Exact && (this->GetMaskImage() || m_LocalMaximum || m_DepthAttenuation > 0.0 || this->m_Oversampling != 1 ||
                  m_NumberOfStreamDivisions != 1))
  {
    itkExceptionMacro("Exact pictures have no MaskImage, LocalMaximum, DepthAttenuation, Oversampling or "
                      "NumberOfStreamDivisions: these must be as by default.");
  }
  if (!m_FitSize && (m_Size[0] == 0 || m_Size[1] == 0))
  {
    itkExceptionMacro("Size must not be zero, but it is " << m_Size << '.');
  }
  ShearWarp::VerifyOutputGrid(m_OutputSpacing, m_OutputOrigin, m_FitOutputSpacing);
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::VerifyInputInformation() const
{
  // first, as ITK 6 compares the input with itself
  ShearWarp::VerifyInputGeometry(this->GetInput());
  try
  {
    Superclass::VerifyInputInformation();
  }
  catch (const ExceptionObject & error)
  {
    itkExceptionMacro("MaskImage must have the input's geometry. " << error.GetDescription());
  }
  const InputImageType * input = this->GetInput();
  const MaskImageType *  mask = this->GetMaskImage();
  if (mask && mask->GetLargestPossibleRegion() != input->GetLargestPossibleRegion())
  {
    itkExceptionMacro("MaskImage must have the input's region, " << input->GetLargestPossibleRegion() << ", but it has "
                                                                 << mask->GetLargestPossibleRegion());
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GenerateOutputInformation()
{
  const InputImageType * input = this->GetInput();
  const ViewList         views = this->MakeViews();
  const double           givenSize[] = { static_cast<double>(m_Size[0]), static_cast<double>(m_Size[1]) };
  const auto [size, spacing, origin] =
    ShearWarp::FitGrid(views,
                       input,
                       { Vector<double, 2>(givenSize), m_OutputSpacing, m_OutputOrigin },
                       m_FitSize,
                       m_FitOutputSpacing,
                       m_FitOutputOrigin);
  const double memory = ShearWarp::GetPhysicalMemory();
  const double bytes = size[0] * size[1] * sizeof(OutputPixelType) * static_cast<double>(views.count);
  if (!(bytes <= memory))
  {
    itkExceptionMacro("Size must fit in memory, but an output of size " << size << ", spacing " << spacing << ", takes "
                                                                        << bytes << " bytes and this computer has "
                                                                        << memory << '.');
  }

  m_Grid->SetLargestPossibleRegion(
    SizeType{ { static_cast<SizeValueType>(size[0]), static_cast<SizeValueType>(size[1]) } });
  m_Grid->SetSpacing(spacing);
  m_Grid->SetOrigin(origin);
  this->SetGeometry(this->GetOutput());
  if (m_ComputeDepth)
  {
    this->SetGeometry(this->GetDepthOutput());
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GenerateInputRequestedRegion()
{
  this->SetInputRequestedRegionToSlab(ShearWarp::GetSlab(this->GetSlices(), 0, this->GetNumberOfSlabs()));
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::SetInputRequestedRegionToSlab(
  const ShearWarp::SliceRange & slab)
{
  typename InputImageType::RegionType region = this->GetInput()->GetLargestPossibleRegion();
  const std::ptrdiff_t                begin = std::max<std::ptrdiff_t>(slab.begin - 1, 0);
  region.SetIndex(2, region.GetIndex(2) + begin);
  region.SetSize(2, static_cast<SizeValueType>(slab.end - begin));
  const_cast<InputImageType *>(this->GetInput())->SetRequestedRegion(region);
  if (const MaskImageType * mask = this->GetMaskImage())
  {
    const_cast<MaskImageType *>(mask)->SetRequestedRegion(region);
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::UpdateSlab(DataObject * image)
{
  if (image)
  {
    image->PropagateRequestedRegion();
    image->UpdateOutputData();
    this->VerifyUnchanged();
  }
}

template <typename TInputImage, typename TOutputImage>
ShearWarp::SliceRange
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetSlices() const
{
  return { 0, static_cast<std::ptrdiff_t>(this->GetInput()->GetLargestPossibleRegion().GetSize(2)) };
}

template <typename TInputImage, typename TOutputImage>
SizeValueType
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetNumberOfSlabs() const
{
  return ShearWarp::CountSlabs(this->GetSlices(), m_NumberOfStreamDivisions);
}

template <typename TInputImage, typename TOutputImage>
std::vector<double>
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetSettings() const
{
  std::vector<double> settings = Superclass::GetSettings();
  settings.insert(settings.end(),
                  { static_cast<double>(m_DefaultPixelValue),
                    static_cast<double>(m_Mode),
                    m_SlabNear,
                    m_SlabFar,
                    static_cast<double>(m_MaskLabel),
                    static_cast<double>(m_LocalMaximum),
                    static_cast<double>(m_LocalMaximumThreshold),
                    m_DepthAttenuation,
                    static_cast<double>(m_ComputeDepth),
                    static_cast<double>(m_Exact),
                    static_cast<double>(m_NumberOfStreamDivisions),
                    static_cast<double>(m_IntermediateMemory) });
  settings.insert(settings.end(), m_CropLower.Begin(), m_CropLower.End());
  settings.insert(settings.end(), m_CropUpper.Begin(), m_CropUpper.End());
  settings.insert(settings.end(), m_Size.begin(), m_Size.end());
  settings.insert(settings.end(), m_OutputSpacing.Begin(), m_OutputSpacing.End());
  settings.insert(settings.end(), m_OutputOrigin.Begin(), m_OutputOrigin.End());
  if (const MaskImageType * mask = this->GetMaskImage())
  {
    Superclass::AddRegion(mask->GetLargestPossibleRegion(), settings);
  }
  return settings;
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::MakeRule() const -> RuleType
{
  RuleType rule;
  rule.mode = m_Mode;
  rule.reducedResampling = this->m_ReducedResampling;
  rule.slabNear = m_SlabNear;
  rule.slabFar = m_SlabFar;
  rule.cropLower = m_CropLower;
  rule.cropUpper = m_CropUpper;
  rule.maskLabel = m_MaskLabel;
  if (m_LocalMaximum)
  {
    rule.localMaximumThreshold = m_LocalMaximumThreshold;
  }
  rule.depthAttenuation = m_DepthAttenuation;
  rule.background = m_DefaultPixelValue;
  rule.hasDepth = m_ComputeDepth;
  rule.isExact = m_Exact;
  return rule;
}

template <typename TInputImage, typename TOutputImage>
bool
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::IsPlainMaximum() const
{
  return this->MakeRule().IsPlainMaximum() && !this->GetMaskImage();
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GeneratePixels()
{
  auto * input = const_cast<InputImageType *>(this->GetInput());
  auto * mask = const_cast<MaskImageType *>(this->GetMaskImage());

  typename InputImageType::PixelContainerConstPointer voxels;
  MaskImageType::PixelContainerConstPointer           maskVoxels;
  ShearWarp::Volume<InputPixelType>                   volume{ input, input->GetLargestPossibleRegion(), mask };
  volume.streamDivisions = this->GetNumberOfSlabs();
  volume.load = [&](const ShearWarp::SliceRange & slab) {
    if (volume.streamDivisions > 1)
    {
      // the last slab's
      voxels = nullptr;
      maskVoxels = nullptr;
      this->SetInputRequestedRegionToSlab(slab);
      this->UpdateSlab(input);
      this->UpdateSlab(mask);
    }
    voxels = this->VerifyVoxels("input", input);
    if (mask)
    {
      maskVoxels = this->VerifyVoxels("MaskImage", mask);
    }
  };

  typename OutputImageType::PixelContainerPointer pixels;
  typename DepthImageType::PixelContainerPointer  depths;
  const SizeValueType                             count = m_Grid->GetLargestPossibleRegion().GetNumberOfPixels();
  const auto                                      getPicture = [&](SizeValueType view) {
    const SizeValueType first = view * count;
    pixels = this->VerifyPixels(this->GetOutput(), first + count);
    depths = m_ComputeDepth ? this->VerifyPixels(this->GetDepthOutput(), first + count) : nullptr;
    return ShearWarp::Picture<InputPixelType>{ pixels->GetBufferPointer() + first,
                                               depths ? depths->GetBufferPointer() + first : nullptr };
  };
  this->m_Engine.Project(volume,
                         this->MakeViews(),
                         m_Grid,
                         this->m_Oversampling,
                         this->MakeRule(),
                         m_IntermediateMemory,
                         getPicture,
                         this->GetThreads());
  // the shares sum to less: ITK's progress wraps around to 0 where rounding takes it beyond 1
  this->UpdateProgress(1.0f);
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  const auto fitted = [](bool fit) { return fit ? " (fitted)" : ""; };
  os << indent << "Size: " << m_Size << fitted(m_FitSize) << std::endl;
  os << indent << "OutputSpacing: " << m_OutputSpacing << fitted(m_FitOutputSpacing) << std::endl;
  os << indent << "OutputOrigin: " << m_OutputOrigin << fitted(m_FitOutputOrigin) << std::endl;
  os << indent
     << "DefaultPixelValue: " << static_cast<typename NumericTraits<OutputPixelType>::PrintType>(m_DefaultPixelValue)
     << std::endl;
  os << indent << "Mode: " << m_Mode << std::endl;
  os << indent << "SlabNear: " << m_SlabNear << std::endl;
  os << indent << "SlabFar: " << m_SlabFar << std::endl;
  os << indent << "CropLower: " << m_CropLower << std::endl;
  os << indent << "CropUpper: " << m_CropUpper << std::endl;
  os << indent << "MaskLabel: " << static_cast<unsigned int>(m_MaskLabel) << std::endl;
  os << indent << "LocalMaximum: " << (m_LocalMaximum ? "On" : "Off") << std::endl;
  os << indent << "LocalMaximumThreshold: "
     << static_cast<typename NumericTraits<InputPixelType>::PrintType>(m_LocalMaximumThreshold) << std::endl;
  os << indent << "DepthAttenuation: " << m_DepthAttenuation << std::endl;
  os << indent << "ComputeDepth: " << (m_ComputeDepth ? "On" : "Off") << std::endl;
  os << indent << "Exact: " << (m_Exact ? "On" : "Off") << std::endl;
  os << indent << "NumberOfStreamDivisions: " << m_NumberOfStreamDivisions << std::endl;
  os << indent << "IntermediateMemory: " << m_IntermediateMemory << std::endl;
  os << indent << "WarpSeconds: " << this->GetWarpSeconds() << std::endl;
}
} // namespace itk

#endif
