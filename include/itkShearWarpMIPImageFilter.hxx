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

#include "itksys/SystemInformation.hxx"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <mutex>
#include <stdexcept>

namespace itk
{
template <typename TInputImage, typename TOutputImage>
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::ShearWarpMIPImageFilter()
{
  Self::AddRequiredInputName("Transform");
  this->SetTransform(IdentityTransform<double, 3>::New());
}

template <typename TInputImage, typename TOutputImage>
template <typename TParameter>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::SetGridParameter(TParameter &       parameter,
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
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::FitOutputGrid()
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
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::VerifyPreconditions() ITKv5_CONST
{
  Superclass::VerifyPreconditions();
  if (!this->GetTransformInput()->GetSource())
  {
    ShearWarpFactorization::VerifyViewTransform(this->GetTransform());
  }

  ShearWarpFactorization::VerifyOversampling(m_Oversampling);
  if (m_NumberOfStreamDivisions == 0)
  {
    itkExceptionMacro("NumberOfStreamDivisions must be positive, but it is 0.");
  }
  for (unsigned int axis = 0; axis < OutputImageDimension; ++axis)
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
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::VerifyInputInformation() ITKv5_CONST
{
  Superclass::VerifyInputInformation();

  const InputImageType * input = this->GetInput();
  if (input->GetLargestPossibleRegion().GetNumberOfPixels() == 0)
  {
    itkExceptionMacro("The input must not be empty, but its region is " << input->GetLargestPossibleRegion());
  }
  for (unsigned int axis = 0; axis < InputImageDimension; ++axis)
  {
    if (!(input->GetSpacing()[axis] > 0.0 && std::isfinite(input->GetSpacing()[axis])))
    {
      itkExceptionMacro("The input's spacing must be positive and finite, but it is " << input->GetSpacing() << '.');
    }
    if (!std::isfinite(input->GetOrigin()[axis]))
    {
      itkExceptionMacro("The input's origin must be finite, but it is " << input->GetOrigin() << '.');
    }
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GenerateOutputInformation()
{
  const InputImageType * input = this->GetInput();
  const TransformType *  transform = this->GetTransform();
  OriginPointType        lower;
  OriginPointType        upper;
  ShearWarpFactorization::ComputeProjectedBounds(transform, input, lower, upper);

  const SpacingType spacing =
    m_FitOutputSpacing ? ShearWarpFactorization::ComputeProjectedSpacing(transform, input) : m_OutputSpacing;
  OriginPointType                      origin = m_OutputOrigin;
  Vector<double, OutputImageDimension> size;
  for (unsigned int axis = 0; axis < OutputImageDimension; ++axis)
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

  for (unsigned int axis = 0; axis < OutputImageDimension; ++axis)
  {
    if (!(spacing[axis] > 0.0 && std::isfinite(spacing[axis]) && std::isfinite(origin[axis])))
    {
      itkExceptionMacro("The output's grid must be finite, but its spacing is " << spacing << " and its origin "
                                                                                << origin << '.');
    }
  }

  static const double memory = []() {
    itksys::SystemInformation system;
    system.RunMemoryCheck();
    return 1024.0 * 1024.0 * static_cast<double>(system.GetTotalPhysicalMemory());
  }();
  const double bytes = size[0] * size[1] * sizeof(OutputPixelType);
  if (!(bytes <= memory))
  {
    itkExceptionMacro("Size must fit in memory, but an output of size " << size << ", spacing " << spacing << ", takes "
                                                                        << bytes << " bytes and this computer has "
                                                                        << memory << '.');
  }

  OutputImageType * output = this->GetOutput();
  output->SetLargestPossibleRegion(
    SizeType{ { static_cast<SizeValueType>(size[0]), static_cast<SizeValueType>(size[1]) } });
  output->SetSpacing(spacing);
  output->SetOrigin(origin);
  typename OutputImageType::DirectionType direction;
  direction.SetIdentity();
  output->SetDirection(direction);
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GenerateInputRequestedRegion()
{
  this->SetInputRequestedRegionToSlab(this->GetSlab(0));
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::SetInputRequestedRegionToSlab(const Slab & slab)
{
  auto *                              input = const_cast<InputImageType *>(this->GetInput());
  typename InputImageType::RegionType region = input->GetLargestPossibleRegion();
  const std::ptrdiff_t                begin = std::max<std::ptrdiff_t>(slab.begin - 1, 0);
  region.SetIndex(2, region.GetIndex(2) + begin);
  region.SetSize(2, static_cast<SizeValueType>(slab.end - begin));
  input->SetRequestedRegion(region);
}

template <typename TInputImage, typename TOutputImage>
SizeValueType
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GetNumberOfSlabs() const
{
  const auto slices = static_cast<std::ptrdiff_t>(this->GetInput()->GetLargestPossibleRegion().GetSize(2));
  return std::clamp<SizeValueType>(
    m_NumberOfStreamDivisions, 1, std::max<std::ptrdiff_t>(ShearWarp::CountBlocks(slices), 1));
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GetSlab(SizeValueType n) const -> Slab
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
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::EnlargeOutputRequestedRegion(DataObject * output)
{
  output->SetRequestedRegionToLargestPossibleRegion();
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::ChooseKernels() const -> const ShearWarp::Kernels<InputPixelType> &
{
  try
  {
    return ShearWarp::GetKernels<InputPixelType>();
  }
  catch (const std::invalid_argument & error)
  {
    itkExceptionMacro(<< error.what());
  }
}

template <typename TInputImage, typename TOutputImage>
SizeValueType
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GetNumberOfWorkers()
{
  return std::min(this->GetNumberOfWorkUnits(), this->GetMultiThreader()->GetMaximumNumberOfThreads());
}

template <typename TInputImage, typename TOutputImage>
template <typename TFunction>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::Parallelize(SizeValueType     count,
                                                                SizeValueType     steps,
                                                                float             progressWeight,
                                                                const TFunction & process)
{
  const SizeValueType workers = std::min(count, this->GetNumberOfWorkers());
  MultiThreaderBase * multiThreader = this->GetMultiThreader();
  multiThreader->SetNumberOfWorkUnits(static_cast<ThreadIdType>(workers));
  // ITK's reporters invoke events in their destructors, out of which no observer may throw; its threads lose exceptions
  const SizeValueType        reportedSteps = (count * steps + 99) / 100;
  const float                stepWeight = progressWeight / static_cast<float>(count * steps);
  std::atomic<SizeValueType> next{ 0 };
  std::exception_ptr         exception;
  std::mutex                 mutex;
  const auto                 work = [&](SizeValueType worker) {
    SizeValueType done = 0;
    for (SizeValueType n = next++; n < count; n = next++)
    {
      for (SizeValueType step = 0; step < steps; ++step)
      {
        if (this->GetAbortGenerateData())
        {
          throw ProcessAborted(__FILE__, __LINE__);
        }
        process(n, step, worker);
        if (++done == reportedSteps)
        {
          this->IncrementProgress(stepWeight * static_cast<float>(done));
          done = 0;
        }
      }
    }
    if (done > 0)
    {
      this->IncrementProgress(stepWeight * static_cast<float>(done));
    }
  };
  multiThreader->ParallelizeArray(
    0,
    workers,
    [&](SizeValueType worker) {
      try
      {
        work(worker);
      }
      catch (...)
      {
        next = count;
        const std::lock_guard<std::mutex> lock(mutex);
        exception = exception ? exception : std::current_exception();
      }
    },
    nullptr);
  if (exception)
  {
    std::rethrow_exception(exception);
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::PrepareVolume(const Slab &                               slab,
                                                                  const ShearWarp::Kernels<InputPixelType> & kernels,
                                                                  float progressWeight)
{
  const InputImageType * input = this->GetInput();
  const auto &           buffered = input->GetBufferedRegion();
  const auto *           voxels = input->GetPixelContainer();
  const SizeValueType    available = voxels ? voxels->Size() : 0;
  if (!buffered.IsInside(input->GetRequestedRegion()) || !input->GetLargestPossibleRegion().IsInside(buffered) ||
      available < buffered.GetNumberOfPixels())
  {
    itkExceptionMacro("The input must be buffered where it is requested, but there are "
                      << available << " voxels, its buffered region is " << buffered << " and its requested region is "
                      << input->GetRequestedRegion());
  }
  const auto parallelize = [=](SizeValueType count, const auto & process) {
    this->Parallelize(
      count, 1, progressWeight, [&process](SizeValueType n, SizeValueType, SizeValueType) { process(n); });
  };
  if (this->GetNumberOfSlabs() > 1)
  {
    m_PreparedVolume.PrepareSlab(input, slab.begin, slab.end, m_PrincipalAxis, kernels, parallelize);
  }
  else
  {
    m_PreparedVolume.Prepare(input, m_PrincipalAxis, kernels, parallelize);
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::GenerateData()
{
  using Clock = std::chrono::steady_clock;
  const auto secondsSince = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };

  this->AllocateOutputs();
  auto *            input = const_cast<InputImageType *>(this->GetInput());
  OutputImageType * output = this->GetOutput();

  const ShearWarpFactorization factorization(this->GetTransform(), input, output, m_Oversampling);
  m_PrincipalAxis = factorization.GetPrincipalAxis();
  const ShearWarp::Kernels<InputPixelType> & kernels = this->ChooseKernels();
  m_InstructionSet = kernels.instructionSet;

  m_PreparationSeconds = 0.0;
  m_ProjectionSeconds = 0.0;
  const SizeValueType slabs = this->GetNumberOfSlabs();
  const bool          isPrepared = slabs == 1 && m_PreparedVolume.IsPrepared(input, m_PrincipalAxis);
  const float         preparationShare = 0.2f / static_cast<float>(slabs);
  const float         projectionShare = (isPrepared ? 0.85f : 0.45f) / static_cast<float>(slabs);
  m_Projector.Start(factorization, kernels, m_ReducedResampling, this->GetNumberOfWorkers());
  for (SizeValueType n = 0; n < slabs; ++n)
  {
    const Slab slab = this->GetSlab(n);
    if (n > 0)
    {
      this->SetInputRequestedRegionToSlab(slab);
      input->PropagateRequestedRegion();
      input->UpdateOutputData();
    }
    const auto preparationStart = Clock::now();
    this->PrepareVolume(slab, kernels, preparationShare);
    m_PreparationSeconds += isPrepared ? 0.0 : secondsSince(preparationStart);

    const auto projectionStart = Clock::now();
    m_Projector.Project(m_PreparedVolume, [=](SizeValueType count, SizeValueType steps, const auto & process) {
      this->Parallelize(count, steps, projectionShare, process);
    });
    m_ProjectionSeconds += secondsSince(projectionStart);
  }
  const auto mergeStart = Clock::now();
  const auto intermediate = m_Projector.Finish([this](SizeValueType count, SizeValueType steps, const auto & process) {
    this->Parallelize(count, steps, 0.05f, process);
  });
  m_ProjectionSeconds += secondsSince(mergeStart);
  m_SkippedFraction = m_Projector.GetSkippedFraction();
  if (slabs > 1)
  {
    m_PreparedVolume.Release();
  }

  const auto                   warpStart = Clock::now();
  const auto                   map = factorization.GetOutputToIntermediateMatrix();
  const ShearWarp::AffineMap2D outputToIntermediate{ map(0, 0), map(0, 1), map(0, 2), map(1, 0), map(1, 1), map(1, 2) };
  const SizeType               outputSize = output->GetBufferedRegion().GetSize();
  constexpr SizeValueType      band = 16;
  this->Parallelize((outputSize[1] + band - 1) / band, 1, 0.09f, [&](SizeValueType n, SizeValueType, SizeValueType) {
    for (SizeValueType row = n * band; row < std::min((n + 1) * band, outputSize[1]); ++row)
    {
      kernels.warpRow(intermediate,
                      outputToIntermediate,
                      row,
                      0,
                      outputSize[0],
                      m_DefaultPixelValue,
                      output->GetBufferPointer() + row * outputSize[0]);
    }
  });
  m_WarpSeconds = secondsSince(warpStart);

  // the weights sum to less: ITK's progress wraps around to 0 where rounding takes it beyond 1
  this->UpdateProgress(1.0f);
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPImageFilter<TInputImage, TOutputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  const auto fitted = [](bool fit) { return fit ? " (fitted)" : ""; };
  os << indent << "Transform: " << this->GetTransform() << std::endl;
  os << indent << "Size: " << m_Size << fitted(m_FitSize) << std::endl;
  os << indent << "OutputSpacing: " << m_OutputSpacing << fitted(m_FitOutputSpacing) << std::endl;
  os << indent << "OutputOrigin: " << m_OutputOrigin << fitted(m_FitOutputOrigin) << std::endl;
  os << indent
     << "DefaultPixelValue: " << static_cast<typename NumericTraits<OutputPixelType>::PrintType>(m_DefaultPixelValue)
     << std::endl;
  os << indent << "ReducedResampling: " << m_ReducedResampling << std::endl;
  os << indent << "Oversampling: " << m_Oversampling << std::endl;
  os << indent << "NumberOfStreamDivisions: " << m_NumberOfStreamDivisions << std::endl;
  os << indent << "SkippedFraction: " << m_SkippedFraction << std::endl;
  os << indent << "InstructionSet: " << m_InstructionSet << std::endl;
  os << indent << "PrincipalAxis: " << m_PrincipalAxis << std::endl;
  os << indent << "PreparationSeconds: " << m_PreparationSeconds << std::endl;
  os << indent << "ProjectionSeconds: " << m_ProjectionSeconds << std::endl;
  os << indent << "WarpSeconds: " << m_WarpSeconds << std::endl;
  os << indent << "PreparedVolumeSizeInBytes: " << this->GetPreparedVolumeSizeInBytes() << std::endl;
}
} // namespace itk

#endif
