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
#ifndef itkShearWarpBaseImageFilter_hxx
#define itkShearWarpBaseImageFilter_hxx

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <stdexcept>

namespace itk
{
template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::VerifyPreconditions() ITKv5_CONST
{
  Superclass::VerifyPreconditions();
  ShearWarpFactorization::VerifyOversampling(m_Oversampling);
  if (m_ReducedResampling > ReducedResamplingEnum::Auto)
  {
    itkExceptionMacro("ReducedResampling must be one of its enumerators, but it is "
                      << static_cast<unsigned int>(m_ReducedResampling) << '.');
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::VerifyInputGeometry() const
{
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
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::EnlargeOutputRequestedRegion(DataObject * output)
{
  output->SetRequestedRegionToLargestPossibleRegion();
}

template <typename TInputImage, typename TOutputImage>
template <typename TPixel>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::VerifyVoxels(const char *             name,
                                                                  const Image<TPixel, 3> * image) const
{
  const auto &        buffered = image->GetBufferedRegion();
  const auto *        voxels = image->GetPixelContainer();
  const SizeValueType available = voxels ? voxels->Size() : 0;
  if (!buffered.IsInside(image->GetRequestedRegion()) || !image->GetLargestPossibleRegion().IsInside(buffered) ||
      available < buffered.GetNumberOfPixels())
  {
    itkExceptionMacro("The " << name << " must be buffered where it is requested, but there are " << available
                             << " voxels, its buffered region is " << buffered << " and its requested region is "
                             << image->GetRequestedRegion());
  }
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::BeginUpdate(const ShearWarpFactorization & first)
  -> const Kernels &
{
  m_PrincipalAxis = first.GetPrincipalAxis();
  m_PreparationSeconds = m_ProjectionSeconds = 0.0;
  m_SkippedFraction = 0.0;
  try
  {
    const Kernels & kernels = ShearWarp::GetKernels<InputPixelType>();
    m_InstructionSet = kernels.instructionSet;
    return kernels;
  }
  catch (const std::invalid_argument & error)
  {
    itkExceptionMacro(<< error.what());
  }
}

template <typename TInputImage, typename TOutputImage>
SizeValueType
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::GetNumberOfWorkers()
{
  return std::min(this->GetNumberOfWorkUnits(), this->GetMultiThreader()->GetMaximumNumberOfThreads());
}

template <typename TInputImage, typename TOutputImage>
template <typename TFunction>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::Parallelize(SizeValueType     count,
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
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  os << indent << "ReducedResampling: " << m_ReducedResampling << std::endl;
  os << indent << "Oversampling: " << m_Oversampling << std::endl;
  os << indent << "SkippedFraction: " << m_SkippedFraction << std::endl;
  os << indent << "InstructionSet: " << m_InstructionSet << std::endl;
  os << indent << "PrincipalAxis: " << m_PrincipalAxis << std::endl;
  os << indent << "PreparationSeconds: " << m_PreparationSeconds << std::endl;
  os << indent << "ProjectionSeconds: " << m_ProjectionSeconds << std::endl;
  os << indent << "PreparedVolumeSizeInBytes: " << this->GetPreparedVolumeSizeInBytes() << std::endl;
}
} // namespace itk

#endif
