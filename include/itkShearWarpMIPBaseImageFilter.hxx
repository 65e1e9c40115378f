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
#include <cmath>

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
  if (fit || parameter != value)
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
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::VerifyPreconditions() ITKv5_CONST
{
  Superclass::VerifyPreconditions();
  if (m_NumberOfStreamDivisions == 0)
  {
    itkExceptionMacro("NumberOfStreamDivisions must be positive, but it is 0.");
  }
  if (m_Mode > ModeEnum::AbsoluteMaximum)
  {
    itkExceptionMacro("Mode must be one of its enumerators, but it is " << static_cast<unsigned int>(m_Mode) << '.');
  }
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (!(m_SlabNear <= m_SlabFar && m_SlabNear < infinity && m_SlabFar > -infinity))
  {
    itkExceptionMacro("SlabNear must be less than infinity and not greater than SlabFar, but they are "
                      << m_SlabNear << " and " << m_SlabFar << '.');
  }
  if (!(m_DepthAttenuation >= 0.0 && std::isfinite(m_DepthAttenuation)))
  {
    itkExceptionMacro("DepthAttenuation must be finite and not negative, but it is " << m_DepthAttenuation << '.');
  }
  if (m_LocalMaximumThreshold != m_LocalMaximumThreshold)
  {
    itkExceptionMacro("LocalMaximumThreshold must be a number, but it is " << m_LocalMaximumThreshold << '.');
  }
  for (unsigned int axis = 0; axis < InputImageDimension; ++axis)
  {
    if (!(m_CropLower[axis] <= m_CropUpper[axis]))
    {
      itkExceptionMacro("CropLower must not be greater than CropUpper, but they are " << m_CropLower << " and "
                                                                                      << m_CropUpper << '.');
    }
  }
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    if (!m_FitSize && m_Size[axis] == 0)
    {
      itkExceptionMacro("Size must not be zero, but it is " << m_Size << '.');
    }
    if (!m_FitOutputSpacing && !(m_OutputSpacing[axis] > 0.0 && std::isfinite(m_OutputSpacing[axis])))
    {
      itkExceptionMacro("OutputSpacing must be positive and finite, but it is " << m_OutputSpacing << '.');
    }
    if (!m_FitOutputOrigin && !std::isfinite(m_OutputOrigin[axis]))
    {
      itkExceptionMacro("OutputOrigin must be finite, but it is " << m_OutputOrigin << '.');
    }
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::VerifyInputInformation() ITKv5_CONST
{
  try
  {
    Superclass::VerifyInputInformation();
  }
  catch (const ExceptionObject & error)
  {
    itkExceptionMacro("MaskImage must have the input's geometry. " << error.GetDescription());
  }
  this->VerifyInputGeometry();
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
  const auto             views = this->MakeViews();
  PhysicalPointType      lower;
  PhysicalPointType      upper;
  SpacingType            spacing;
  for (const TransformConstPointer & view : views)
  {
    PhysicalPointType lowerOfView;
    PhysicalPointType upperOfView;
    ShearWarpFactorization::ComputeViewBounds(view, input, lowerOfView, upperOfView);
    const SpacingType spacingOfView = ShearWarpFactorization::ComputeProjectedSpacing(view, input);
    const bool        isFirst = &view == &views.front();
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      lower[axis] = isFirst ? lowerOfView[axis] : std::min(lower[axis], lowerOfView[axis]);
      upper[axis] = isFirst ? upperOfView[axis] : std::max(upper[axis], upperOfView[axis]);
      spacing[axis] = isFirst ? spacingOfView[axis] : std::min(spacing[axis], spacingOfView[axis]);
    }
  }
  spacing = m_FitOutputSpacing ? spacing : m_OutputSpacing;
  OriginPointType   origin = m_OutputOrigin;
  Vector<double, 2> size;
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    const double start = m_FitOutputOrigin ? lower[axis] : origin[axis] - 0.5 * spacing[axis];
    // an extent that exceeds whole pixels by rounding errors only needs no further pixel
    const double fitted = std::max(1.0, std::ceil((upper[axis] - start) / spacing[axis] - 1e-6));
    size[axis] = m_FitSize ? fitted : static_cast<double>(m_Size[axis]);
    if (m_FitOutputOrigin)
    {
      origin[axis] = 0.5 * (lower[axis] + upper[axis]) - 0.5 * (size[axis] - 1.0) * spacing[axis];
    }
  }

  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    if (!(spacing[axis] > 0.0 && std::isfinite(spacing[axis]) && std::isfinite(origin[axis])))
    {
      itkExceptionMacro("The output's grid must be finite, but its spacing is " << spacing << " and its origin "
                                                                                << origin << '.');
    }
  }

  const double memory = ShearWarpBuffer::GetPhysicalMemory();
  const double bytes = size[0] * size[1] * sizeof(OutputPixelType) * static_cast<double>(views.size());
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
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetDepthRange(const TransformType * transform,
                                                                      double &              nearest,
                                                                      double &              farthest) const
{
  PhysicalPointType lower;
  PhysicalPointType upper;
  ShearWarpFactorization::ComputeViewBounds(transform, this->GetInput(), lower, upper);
  nearest = std::max(lower[2], m_SlabNear);
  farthest = std::min(upper[2], m_SlabFar);
  if (!(nearest < farthest))
  {
    // a slab without thickness, or beside the image
    nearest = std::isfinite(m_SlabNear) ? m_SlabNear : m_SlabFar;
    farthest = std::isfinite(m_SlabFar) ? m_SlabFar : m_SlabNear;
    const double missing = (upper[2] - lower[2]) * 1e-3 - (farthest - nearest);
    nearest -= 0.5 * std::max(missing, 0.0);
    farthest += 0.5 * std::max(missing, 0.0);
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GenerateInputRequestedRegion()
{
  this->SetInputRequestedRegionToSlab(this->GetSlab(0));
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::SetInputRequestedRegionToSlab(const Slab & slab)
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
SizeValueType
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetNumberOfSlabs() const
{
  const auto slices = static_cast<std::ptrdiff_t>(this->GetInput()->GetLargestPossibleRegion().GetSize(2));
  return std::clamp<SizeValueType>(
    m_NumberOfStreamDivisions, 1, std::max<std::ptrdiff_t>(ShearWarp::CountBlocks(slices), 1));
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetSlab(SizeValueType n) const -> Slab
{
  const auto           slices = static_cast<std::ptrdiff_t>(this->GetInput()->GetLargestPossibleRegion().GetSize(2));
  const std::ptrdiff_t blocks = ShearWarp::CountBlocks(slices);
  const auto           slabs = static_cast<std::ptrdiff_t>(this->GetNumberOfSlabs());
  const auto           getEnd = [=](std::ptrdiff_t count) {
    return std::min(count * blocks / slabs * ShearWarp::BlockLength, slices);
  };
  return { getEnd(static_cast<std::ptrdiff_t>(n)), getEnd(static_cast<std::ptrdiff_t>(n) + 1) };
}

template <typename TInputImage, typename TOutputImage>
template <typename TPixel>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::Prepare(const char *                       name,
                                                                const Image<TPixel, 3> *           image,
                                                                ShearWarpPreparedVolume<TPixel> &  prepared,
                                                                unsigned int                       axis,
                                                                const Slab &                       slab,
                                                                const ShearWarp::Kernels<TPixel> & kernels,
                                                                float                              progressWeight)
{
  this->VerifyVoxels(name, image);
  const auto parallelize = [=](SizeValueType count, const auto & process) {
    this->Parallelize(
      count, 1, progressWeight, [&process](SizeValueType n, SizeValueType, SizeValueType) { process(n); });
  };
  if (this->GetNumberOfSlabs() > 1)
  {
    prepared.PreparePart(
      image, image->GetLargestPossibleRegion(), slab.begin, slab.end, axis, true, kernels, parallelize);
  }
  else
  {
    prepared.Prepare(image, image->GetLargestPossibleRegion(), axis, true, kernels, parallelize);
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GenerateData()
{
  this->AllocateOutputs();
  std::vector<View> views;
  for (const TransformConstPointer & transform : this->MakeViews())
  {
    views.push_back({ transform, { transform, this->GetInput(), m_Grid, this->m_Oversampling }, views.size() });
  }
  const Kernels & kernels = this->BeginUpdate(views.front().factorization);
  m_WarpSeconds = 0.0;

  const SizeValueType workers = this->GetNumberOfWorkers();
  const float         viewShare = 1.0f / static_cast<float>(views.size());
  for (const Group & group : this->MakeGroups(views))
  {
    const View &  first = *group.front().front();
    SizeValueType count = 0;
    for (const Projection & projection : group)
    {
      count += projection.size();
    }
    const float share = viewShare * static_cast<float>(count);
    const auto  finish = [&](const auto & finishProjection) {
      for (std::size_t n = 0; n < group.size(); ++n)
      {
        const auto                  start = Clock::now();
        const auto                  mergeShare = 0.05f * viewShare * static_cast<float>(group[n].size());
        const IntermediateImageType intermediate =
          finishProjection(n, [this, mergeShare](SizeValueType bands, SizeValueType steps, const auto & process) {
            this->Parallelize(bands, steps, mergeShare, process);
          });
        this->m_ProjectionSeconds += SecondsSince(start);
        for (const View * view : group[n])
        {
          this->Warp(intermediate, *view, kernels, viewShare);
        }
      }
    };
    const unsigned int axis = first.factorization.GetPrincipalAxis();
    if (this->IsPlainMaximum())
    {
      std::vector<const ShearWarpFactorization *> factorizations;
      for (const Projection & projection : group)
      {
        factorizations.push_back(&projection.front()->factorization);
      }
      this->m_Projector.Start(factorizations, kernels, this->m_ReducedResampling, workers);
      this->Project(this->m_Projector, axis, true, kernels, share);
      this->m_SkippedFraction += this->m_Projector.GetSkippedFraction() * share;
      finish([this](std::size_t n, const auto & parallelize) { return this->m_Projector.Finish(n, parallelize); });
    }
    else
    {
      m_RayProjector.Start(first.factorization, kernels, this->MakeRayParameters(first, kernels), workers);
      this->Project(m_RayProjector, axis, m_RayProjector.IsFirstSlabFront(), kernels, share);
      finish([this](std::size_t, const auto & parallelize) { return m_RayProjector.Finish(parallelize); });
    }
  }
  if (this->GetNumberOfSlabs() > 1)
  {
    this->ReleasePreparedVolume();
  }

  // the weights sum to less: ITK's progress wraps around to 0 where rounding takes it beyond 1
  this->UpdateProgress(1.0f);
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::MakeGroups(const std::vector<View> & views)
  -> std::vector<Group>
{
  const bool         isPlainMaximum = this->IsPlainMaximum();
  std::vector<Group> groups;
  for (unsigned int axis = 0; axis < InputImageDimension; ++axis)
  {
    Group         projections;
    SizeValueType bytes = 1;
    for (const View & view : views)
    {
      if (view.factorization.GetPrincipalAxis() != axis)
      {
        continue;
      }
      const auto isSame = [&](const Projection & projection) {
        return isPlainMaximum && projection.front()->factorization.HasSameSlicePlacements(view.factorization);
      };
      const auto same = std::find_if(projections.begin(), projections.end(), isSame);
      if (same != projections.end())
      {
        same->push_back(&view);
        continue;
      }
      const Size<2> size = view.factorization.GetIntermediateSize();
      bytes = std::max(bytes, size[0] * size[1] * SizeValueType{ sizeof(InputPixelType) });
      projections.push_back({ &view });
    }
    // as few groups as there is room for, of equal size
    const SizeValueType room = m_IntermediateMemory / (bytes * this->GetNumberOfWorkers());
    const SizeValueType most = isPlainMaximum ? std::max<SizeValueType>(room, 1) : 1;
    const SizeValueType count = (projections.size() + most - 1) / most;
    for (SizeValueType n = 0; n < count; ++n)
    {
      groups.emplace_back(projections.begin() + n * projections.size() / count,
                          projections.begin() + (n + 1) * projections.size() / count);
    }
  }
  return groups;
}

template <typename TInputImage, typename TOutputImage>
bool
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::IsPlainMaximum() const
{
  constexpr double infinity = std::numeric_limits<double>::infinity();
  return m_Mode == ModeEnum::Maximum && m_SlabNear == -infinity && m_SlabFar == infinity &&
         m_CropLower == PhysicalPointType(-infinity) && m_CropUpper == PhysicalPointType(infinity) &&
         !this->GetMaskImage() && !m_LocalMaximum && m_DepthAttenuation == 0.0 && !m_ComputeDepth;
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::MakeRayParameters(const View &    view,
                                                                          const Kernels & kernels) const ->
  typename RayProjectorType::Parameters
{
  typename RayProjectorType::Parameters parameters;
  parameters.mode = m_Mode == ModeEnum::Minimum           ? &kernels.minimum
                    : m_Mode == ModeEnum::AbsoluteMaximum ? &kernels.absoluteMaximum
                                                          : &kernels.maximum;
  if (m_LocalMaximum)
  {
    parameters.localMaximumThreshold = m_LocalMaximumThreshold;
  }

  const auto addInterval = [&](const ShearWarp::ShearedFunction & function, double low, double high) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    if (low != -infinity || high != infinity)
    {
      parameters.intervals.push_back({ function, low, high });
    }
  };
  addInterval(view.factorization.GetDepthFunction(), m_SlabNear, m_SlabFar);
  const auto axes = ShearWarpFactorization::GetLinearPart(view.transform);
  const auto offset = view.transform->TransformPoint(PhysicalPointType(0.0));
  for (unsigned int axis = 0; axis < InputImageDimension; ++axis)
  {
    const double position[] = { axes(axis, 0), axes(axis, 1), axes(axis, 2), offset[axis] };
    addInterval(
      view.factorization.GetShearedFunction(Vector<double, 4>(position)), m_CropLower[axis], m_CropUpper[axis]);
  }

  if (m_DepthAttenuation > 0.0)
  {
    double nearest;
    double farthest;
    this->GetDepthRange(view.transform, nearest, farthest);
    // exp() of it must be a number
    constexpr double most = 300.0;
    if (!(m_DepthAttenuation * (farthest - nearest) <= most))
    {
      itkExceptionMacro("DepthAttenuation must not be greater than "
                        << most / (farthest - nearest) << " for this image, but it is " << m_DepthAttenuation << '.');
    }
    parameters.fading = typename RayProjectorType::Fading{ m_DepthAttenuation, nearest, m_DefaultPixelValue };
  }
  if (this->GetMaskImage())
  {
    parameters.mask = &m_PreparedMask;
    parameters.maskLabel = m_MaskLabel;
  }
  return parameters;
}

template <typename TInputImage, typename TOutputImage>
template <typename TProjector>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::Project(TProjector &    projector,
                                                                unsigned int    axis,
                                                                bool            isFirstSlabFirst,
                                                                const Kernels & kernels,
                                                                float           share)
{
  auto * input = const_cast<InputImageType *>(this->GetInput());
  auto * mask = const_cast<MaskImageType *>(this->GetMaskImage());

  const SizeValueType slabs = this->GetNumberOfSlabs();
  const bool          isPrepared =
    slabs == 1 && this->m_PreparedVolume.IsPrepared(input, axis) && (!mask || m_PreparedMask.IsPrepared(mask, axis));
  const float preparationShare = share * (mask ? 0.1f : 0.2f) / static_cast<float>(slabs);
  const float projectionShare = share * (isPrepared ? 0.85f : 0.45f) / static_cast<float>(slabs);
  for (SizeValueType n = 0; n < slabs; ++n)
  {
    const Slab slab = this->GetSlab(isFirstSlabFirst ? n : slabs - 1 - n);
    if (slabs > 1)
    {
      this->SetInputRequestedRegionToSlab(slab);
      this->UpdateSlab(input);
      this->UpdateSlab(mask);
    }
    const auto preparationStart = Clock::now();
    this->Prepare("input", input, this->m_PreparedVolume, axis, slab, kernels, preparationShare);
    if (mask)
    {
      const auto & maskKernels = ShearWarp::GetKernels<unsigned char>();
      this->Prepare("MaskImage", mask, m_PreparedMask, axis, slab, maskKernels, preparationShare);
    }
    this->m_PreparationSeconds += isPrepared ? 0.0 : SecondsSince(preparationStart);

    const auto projectionStart = Clock::now();
    projector.Project(this->m_PreparedVolume, [=](SizeValueType count, SizeValueType steps, const auto & process) {
      this->Parallelize(count, steps, projectionShare, process);
    });
    this->m_ProjectionSeconds += SecondsSince(projectionStart);
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::Warp(const IntermediateImageType & intermediate,
                                                             const View &                  view,
                                                             const Kernels &               kernels,
                                                             float                         share)
{
  const auto                   start = Clock::now();
  const auto                   map = view.factorization.GetOutputToIntermediateMatrix();
  const ShearWarp::AffineMap2D outputToIntermediate{ map(0, 0), map(0, 1), map(0, 2), map(1, 0), map(1, 1), map(1, 2) };
  const SizeType               size = m_Grid->GetLargestPossibleRegion().GetSize();
  const SizeValueType          first = view.number * size[0] * size[1];
  const auto                   depthFunction = view.factorization.GetDepthFunction();
  InputPixelType * const       values = this->GetOutput()->GetBufferPointer() + first;
  float * const                depths = m_ComputeDepth ? this->GetDepthOutput()->GetBufferPointer() + first : nullptr;
  constexpr SizeValueType      band = 16;
  this->Parallelize((size[1] + band - 1) / band, 1, 0.09f * share, [&](SizeValueType n, SizeValueType, SizeValueType) {
    std::vector<std::int32_t> slices(depths ? size[0] : 0);
    for (SizeValueType row = n * band; row < std::min((n + 1) * band, size[1]); ++row)
    {
      kernels.warpRow(intermediate, outputToIntermediate, row, 0, size[0], m_DefaultPixelValue, values + row * size[0]);
      if (depths)
      {
        ShearWarp::FindNearestSlices(intermediate, outputToIntermediate, row, size[0], slices.data());
        for (SizeValueType column = 0; column < size[0]; ++column)
        {
          const auto shearedPosition = [&](unsigned int axis) {
            const double position =
              map(axis, 0) * static_cast<double>(column) + map(axis, 1) * static_cast<double>(row) + map(axis, 2);
            return (position + 1.0) / this->m_Oversampling - 1.0;
          };
          depths[row * size[0] + column] =
            slices[column] < 0
              ? std::numeric_limits<float>::quiet_NaN()
              : static_cast<float>(depthFunction(shearedPosition(0), shearedPosition(1), slices[column]));
        }
      }
    }
  });
  m_WarpSeconds += SecondsSince(start);
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
  os << indent << "NumberOfStreamDivisions: " << m_NumberOfStreamDivisions << std::endl;
  os << indent << "IntermediateMemory: " << m_IntermediateMemory << std::endl;
  os << indent << "WarpSeconds: " << m_WarpSeconds << std::endl;
}
} // namespace itk

#endif
