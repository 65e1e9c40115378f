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
#include <iterator>
#include <unordered_map>

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
  this->template VerifyInputType<MaskImageType>("MaskImage", "the mask, a 3D image of unsigned char");
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
  if (m_DepthAttenuation > 0.0 && !std::isfinite(static_cast<double>(m_DefaultPixelValue)))
  {
    itkExceptionMacro("DefaultPixelValue must be finite where samples fade to it, but it is " << m_DefaultPixelValue
                                                                                              << '.');
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
  const ViewList         views = this->MakeViews();
  const double           givenSize[] = { static_cast<double>(m_Size[0]), static_cast<double>(m_Size[1]) };
  const auto [size, spacing, origin] =
    ShearWarp::FitGrid(views,
                       input,
                       { Vector<double, 2>(givenSize), m_OutputSpacing, m_OutputOrigin },
                       m_FitSize,
                       m_FitOutputSpacing,
                       m_FitOutputOrigin);
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    if (!(spacing[axis] > 0.0 && std::isfinite(spacing[axis]) && std::isfinite(origin[axis])))
    {
      itkExceptionMacro("The output's grid must be finite, but its spacing is " << spacing << " and its origin "
                                                                                << origin << '.');
    }
  }

  const double memory = ShearWarpBuffer::GetPhysicalMemory();
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
  this->SetInputRequestedRegionToSlab(this->GetSlab(0, this->GetNumberOfSlabs()));
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
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetSlab(SizeValueType n, SizeValueType slabs) const -> Slab
{
  const auto          slices = static_cast<std::ptrdiff_t>(this->GetInput()->GetLargestPossibleRegion().GetSize(2));
  const SizeValueType blocks = ShearWarp::CountBlocks(slices);
  const auto          getEnd = [=](SizeValueType count) {
    return std::min(static_cast<std::ptrdiff_t>(count * blocks / slabs) * ShearWarp::BlockLength, slices);
  };
  return { getEnd(n), getEnd(n + 1) };
}

template <typename TInputImage, typename TOutputImage>
template <typename TPixel>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::Prepare(const char *                       name,
                                                                const Image<TPixel, 3> *           image,
                                                                ShearWarpPreparedVolume<TPixel> &  prepared,
                                                                unsigned int                       axis,
                                                                const Slab *                       slab,
                                                                bool                               hasBlockMaxima,
                                                                const ShearWarp::Kernels<TPixel> & kernels,
                                                                float                              progressWeight) ->
  typename Image<TPixel, 3>::PixelContainerConstPointer
{
  const auto voxels = this->VerifyVoxels(name, image);
  const auto parallelize = [=](SizeValueType count, const auto & process) {
    this->Parallelize(
      count, 1, progressWeight, [&process](SizeValueType n, SizeValueType, SizeValueType) { process(n); });
  };
  const ImageRegion<3> & whole = image->GetLargestPossibleRegion();
  if (slab)
  {
    prepared.PreparePart(image, whole, slab->begin, slab->end, axis, hasBlockMaxima, kernels, parallelize);
  }
  else
  {
    prepared.Prepare(image, whole, axis, hasBlockMaxima, kernels, parallelize);
  }
  return voxels;
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
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GeneratePixels()
{
  const ViewList                           views = this->MakeViews();
  std::vector<std::shared_ptr<const View>> lastViews(MostViewsTogether);
  const auto                               factorize = [&](SizeValueType number) {
    auto & view = lastViews[number % MostViewsTogether];
    if (!view || view->number != number)
    {
      const TransformConstPointer transform = views.get(number);
      view = std::make_shared<const View>(
        View{ transform, { transform, this->GetInput(), m_Grid, this->m_Oversampling }, number });
    }
    return view;
  };
  const Kernels & kernels = this->BeginUpdate(factorize(0)->factorization);
  m_WarpSeconds = 0.0;

  const SizeValueType workers = this->GetNumberOfWorkers();
  const float         viewShare = 1.0f / static_cast<float>(views.count);
  for (const Group & group : this->MakeGroups(views.count, factorize))
  {
    const unsigned int axis = group.axis;
    // what serves further views is made when they come
    const unsigned int projectedAxes = this->m_PreparedVolume.GetProjectedAxes(this->GetInput());
    const bool         hasBlockMaxima = this->m_ReducedResampling == Superclass::ReducedResamplingEnum::On ||
                                group.projections.size() > 1 || projectedAxes != 0;
    const bool                               isKept = (projectedAxes >> axis & 1U) != 0;
    std::vector<std::shared_ptr<const View>> firsts;
    SizeValueType                            count = 0;
    for (const Projection & projection : group.projections)
    {
      count += projection.size();
      firsts.push_back(factorize(projection.front()));
    }
    const float share = viewShare * static_cast<float>(count);
    const auto  finish = [&](const auto & finishProjection) {
      for (std::size_t n = 0; n < firsts.size(); ++n)
      {
        const Projection &          projection = group.projections[n];
        const auto                  start = Clock::now();
        const auto                  mergeShare = 0.05f * viewShare * static_cast<float>(projection.size());
        const IntermediateImageType intermediate =
          finishProjection(n, [this, mergeShare](SizeValueType bands, SizeValueType steps, const auto & process) {
            this->Parallelize(bands, steps, mergeShare, process);
          });
        this->m_ProjectionSeconds += SecondsSince(start);
        for (const SizeValueType number : projection)
        {
          this->Warp(intermediate, *factorize(number), kernels, viewShare);
        }
      }
    };
    if (!this->NeedsRays())
    {
      typename Superclass::ProjectorType::ViewList projectedViews;
      for (const auto & first : firsts)
      {
        projectedViews.push_back({ &first->factorization, this->MakeIntervals(*first) });
      }
      this->m_Projector.Start(
        projectedViews, kernels, { m_Mode, this->NeedsSlices(), m_MaskLabel, this->m_ReducedResampling }, workers);
      const auto project = [this](const auto & volume, const auto * mask, const auto & parallelize) {
        this->m_Projector.Project(volume, mask, parallelize);
      };
      this->Project(project, axis, true, hasBlockMaxima && this->IsPlainMaximum(), isKept, kernels, share);
      // shares may sum to a little more than 1
      this->m_SkippedFraction = std::min(this->m_SkippedFraction + this->m_Projector.GetSkippedFraction() * share, 1.0);
      finish([this](std::size_t n, const auto & parallelize) { return this->m_Projector.Finish(n, parallelize); });
    }
    else
    {
      const View & first = *firsts.front();
      m_RayProjector.Start(first.factorization, kernels, this->MakeRayParameters(first, kernels), workers);
      const auto project = [this](const auto & volume, const auto * mask, const auto & parallelize) {
        m_RayProjector.Project(volume, mask, parallelize);
      };
      this->Project(project, axis, m_RayProjector.IsFirstSlabFront(), false, isKept, kernels, share);
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
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::MakeGroups(SizeValueType             count,
                                                                   const FactorizeFunction & factorize) const
  -> std::vector<Group>
{
  const bool                                          isOneByOne = this->NeedsRays();
  const bool                                          hasRegion = this->HasRegion();
  std::vector<Projection>                             projections[InputImageDimension];
  Size<2>                                             largest[InputImageDimension]{};
  std::unordered_multimap<SizeValueType, std::size_t> candidates[InputImageDimension];
  for (SizeValueType number = 0; number < count; ++number)
  {
    const auto         view = factorize(number);
    const unsigned int axis = view->factorization.GetPrincipalAxis();
    const Size<2>      size = view->factorization.GetIntermediateSize();
    largest[axis] = { { std::max(largest[axis][0], size[0]), std::max(largest[axis][1], size[1]) } };

    // first and last place tell most views apart
    SizeValueType key = 0;
    for (const auto & place :
         { view->factorization.GetSlicePlacements().front(), view->factorization.GetSlicePlacements().back() })
    {
      for (const std::int32_t part : { place.column.whole, place.column.fraction, place.row.whole, place.row.fraction })
      {
        key = key * 1000003 + static_cast<SizeValueType>(part);
      }
    }
    const auto [begin, end] = candidates[axis].equal_range(key);
    const auto same =
      isOneByOne || hasRegion || m_ComputeDepth ? end : std::find_if(begin, end, [&](const auto & candidate) {
        const Projection & projection = projections[axis][candidate.second];
        return factorize(projection.front())->factorization.HasSameSlicePlacements(view->factorization);
      });
    if (same != end)
    {
      projections[axis][same->second].push_back(number);
      continue;
    }
    candidates[axis].emplace(key, projections[axis].size());
    projections[axis].push_back({ number });
  }

  std::vector<Group> groups;
  for (unsigned int axis = 0; axis < InputImageDimension; ++axis)
  {
    // as few groups as there is room for, of equal size; more views would save nothing
    const SizeValueType bytes = Superclass::ProjectorType::GetImageSizeInBytes(
      largest[axis], this->m_Oversampling, m_Mode, hasRegion, this->NeedsSlices());
    const SizeValueType room = m_IntermediateMemory / std::max<SizeValueType>(bytes * this->GetNumberOfWorkers(), 1);
    const SizeValueType most = isOneByOne ? 1 : std::clamp<SizeValueType>(room, 1, MostViewsTogether);
    const SizeValueType total = projections[axis].size();
    const SizeValueType groupsOfAxis = (total + most - 1) / most;
    const auto          first = std::make_move_iterator(projections[axis].begin());
    for (SizeValueType n = 0; n < groupsOfAxis; ++n)
    {
      groups.push_back({ axis, { first + n * total / groupsOfAxis, first + (n + 1) * total / groupsOfAxis } });
    }
  }
  return groups;
}

template <typename TInputImage, typename TOutputImage>
bool
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::IsPlainMaximum() const
{
  return m_Mode == ModeEnum::Maximum && !this->HasRegion() && !this->NeedsSlices() && !this->NeedsRays();
}

template <typename TInputImage, typename TOutputImage>
bool
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::HasRegion() const
{
  constexpr double infinity = std::numeric_limits<double>::infinity();
  return m_SlabNear != -infinity || m_SlabFar != infinity || m_CropLower != PhysicalPointType(-infinity) ||
         m_CropUpper != PhysicalPointType(infinity);
}

template <typename TInputImage, typename TOutputImage>
bool
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::NeedsRays() const
{
  const auto size = this->GetInput()->GetLargestPossibleRegion().GetSize();
  const auto mostSlices = static_cast<SizeValueType>(Superclass::ProjectorType::MostRankedSlices);
  return m_LocalMaximum || m_DepthAttenuation > 0.0 ||
         (this->NeedsSlices() && std::max({ size[0], size[1], size[2] }) > mostSlices);
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::MakeIntervals(const View & view) const ->
  typename Superclass::ProjectorType::IntervalList
{
  typename Superclass::ProjectorType::IntervalList intervals;
  const auto addInterval = [&](const ShearWarp::ShearedFunction & function, double low, double high) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    if (low != -infinity || high != infinity)
    {
      intervals.push_back({ function, low, high });
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
  return intervals;
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

  parameters.intervals = this->MakeIntervals(view);
  if (m_DepthAttenuation > 0.0)
  {
    const double begin = std::max(ShearWarp::FindSphereDepth(view.transform, this->GetInput()), m_SlabNear);
    parameters.fading = typename RayProjectorType::Fading{ { m_DepthAttenuation, begin }, m_DefaultPixelValue };
  }
  parameters.maskLabel = m_MaskLabel;
  return parameters;
}

template <typename TInputImage, typename TOutputImage>
template <typename TFunction>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::Project(const TFunction & project,
                                                                unsigned int      axis,
                                                                bool              isFirstSlabFirst,
                                                                bool              hasBlockMaxima,
                                                                bool              isKept,
                                                                const Kernels &   kernels,
                                                                float             share)
{
  auto * input = const_cast<InputImageType *>(this->GetInput());
  auto * mask = const_cast<MaskImageType *>(this->GetMaskImage());

  const SizeValueType streamed = this->GetNumberOfSlabs();
  const bool          isStreamed = streamed > 1;
  const bool          isWhole = !isStreamed && (isKept || axis != 0);
  const auto          size = input->GetLargestPossibleRegion().GetSize();
  const SizeValueType slabs =
    isStreamed ? streamed
    : isWhole  ? 1
               : ShearWarp::CountBlocks(size[2], this->GetSlabLength(size, 2 * ShearWarp::BlockLength));
  const bool  findsMaxima = hasBlockMaxima && !(isWhole && this->m_PreparedVolume.IsPrepared(input, 2));
  const bool  transposes = axis == 0 && !(isWhole && this->m_PreparedVolume.IsPrepared(input, axis, false));
  const bool  transposesMask = mask && axis == 0 && !(isWhole && m_PreparedMask.IsPrepared(mask, axis, false));
  const bool  hasBlocksOfMask = mask && !this->NeedsRays();
  const bool  findsBlocksOfMask = hasBlocksOfMask && !(isWhole && m_PreparedMask.IsPrepared(mask, 2));
  const int   preparations = findsMaxima + transposes + transposesMask + findsBlocksOfMask;
  const float preparationShare = share * (mask ? 0.1f : 0.2f) / static_cast<float>(slabs);
  const float projectionShare =
    share * 0.85f / static_cast<float>(slabs) - preparationShare * static_cast<float>(preparations);
  if (isStreamed)
  {
    this->m_PreparedVolume.Release();
    m_PreparedMask.Release();
  }
  else
  {
    this->m_PreparedVolume.SetImage(input, input->GetLargestPossibleRegion());
  }

  ShearWarpPreparedVolume<InputPixelType> volumeSlab;
  ShearWarpPreparedVolume<unsigned char>  maskSlab(true);
  auto &                                  volume = isWhole ? this->m_PreparedVolume : volumeSlab;
  auto &                                  preparedMask = isWhole ? m_PreparedMask : maskSlab;
  for (SizeValueType n = 0; n < slabs; ++n)
  {
    const Slab         slab = this->GetSlab(isFirstSlabFirst ? n : slabs - 1 - n, slabs);
    const Slab * const part = isWhole ? nullptr : &slab;
    if (isStreamed)
    {
      this->SetInputRequestedRegionToSlab(slab);
      this->UpdateSlab(input);
      this->UpdateSlab(mask);
    }
    const auto start = Clock::now();
    const auto voxels = this->Prepare("input", input, volume, axis, part, hasBlockMaxima, kernels, preparationShare);
    MaskImageType::PixelContainerConstPointer maskVoxels;
    if (mask)
    {
      const auto & maskKernels = ShearWarp::GetKernels<unsigned char>();
      maskVoxels =
        this->Prepare("MaskImage", mask, preparedMask, axis, part, hasBlocksOfMask, maskKernels, preparationShare);
    }
    this->m_PreparationSeconds += preparations > 0 ? SecondsSince(start) : 0.0;

    const auto projectionStart = Clock::now();
    project(
      volume, mask ? &preparedMask : nullptr, [=](SizeValueType count, SizeValueType steps, const auto & process) {
        this->Parallelize(count, steps, projectionShare, process);
      });
    this->m_ProjectionSeconds += SecondsSince(projectionStart);
  }
  if (!isStreamed)
  {
    this->m_PreparedVolume.AddProjectedAxis(axis);
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
  const SizeValueType          end = first + size[0] * size[1];
  const auto                   pixels = this->VerifyPixels(this->GetOutput(), end);
  InputPixelType * const       values = pixels->GetBufferPointer() + first;
  const auto                   depthPixels =
    m_ComputeDepth ? this->VerifyPixels(this->GetDepthOutput(), end) : typename DepthImageType::PixelContainerPointer();
  float * const           depths = depthPixels ? depthPixels->GetBufferPointer() + first : nullptr;
  const auto              background = m_DefaultPixelValue;
  const unsigned int      oversampling = view.factorization.GetOversampling();
  constexpr SizeValueType band = 16;
  this->Parallelize((size[1] + band - 1) / band, 1, 0.09f * share, [&](SizeValueType n, SizeValueType, SizeValueType) {
    for (SizeValueType row = n * band; row < std::min((n + 1) * band, size[1]); ++row)
    {
      kernels.warpRow(intermediate, outputToIntermediate, row, 0, size[0], background, values + row * size[0]);
      if (depths)
      {
        ShearWarp::FindDepths(
          intermediate, outputToIntermediate, oversampling, depthFunction, row, size[0], depths + row * size[0]);
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
