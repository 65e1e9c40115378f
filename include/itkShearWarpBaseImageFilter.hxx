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
#include <exception>
#include <mutex>
#include <typeinfo>
#include <utility>

namespace itk
{
template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::VerifyPreconditions() const
{
  Superclass::VerifyPreconditions();
  this->template VerifyInputType<InputImageType>("Primary", "the 3D image that is projected");
  this->VerifyIndexedInputs();
  ShearWarpFactorization::VerifyOversampling(m_Oversampling);
  if (m_ReducedResampling > ReducedResamplingEnum::Auto)
  {
    itkExceptionMacro("ReducedResampling must be one of its enumerators, but it is "
                      << static_cast<unsigned int>(m_ReducedResampling) << '.');
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::EnlargeOutputRequestedRegion(DataObject * output)
{
  output->SetRequestedRegionToLargestPossibleRegion();
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::VerifyIndexedInputs() const
{
  for (ProcessObject::DataObjectPointerArraySizeType n = 1; n < this->GetNumberOfIndexedInputs(); ++n)
  {
    if (this->ProcessObject::GetInput(n))
    {
      itkExceptionMacro(
        "Input " << n << " is for nothing: input 0 is the 3D image that is projected, and others have names.");
    }
  }
}

template <typename TInputImage, typename TOutputImage>
template <typename TObject>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::VerifyInputType(const DataObject::DataObjectIdentifierType & name,
                                                                     const std::string & purpose) const
{
  const DataObject * object = this->ProcessObject::GetInput(name);
  if (object && !dynamic_cast<const TObject *>(object))
  {
    itkExceptionMacro("Input " << name << " is for " << purpose << ", not for an object of class "
                               << object->GetNameOfClass() << " (" << typeid(*object).name() << ").");
  }
}

template <typename TInputImage, typename TOutputImage>
template <typename TPixel, unsigned int VDimension>
auto
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::VerifyVoxels(const std::string &               name,
                                                                  const Image<TPixel, VDimension> * image) const ->
  typename Image<TPixel, VDimension>::PixelContainerConstPointer
{
  const auto &        buffered = image->GetBufferedRegion();
  const auto *        voxels = image->GetPixelContainer();
  const SizeValueType available = voxels ? voxels->Size() : 0;
  // a product of the lengths can overflow
  SizeValueType rest = available;
  for (const SizeValueType length : buffered.GetSize())
  {
    rest /= std::max<SizeValueType>(length, 1);
  }
  if (!buffered.IsInside(image->GetRequestedRegion()) || !image->GetLargestPossibleRegion().IsInside(buffered) ||
      rest == 0)
  {
    itkExceptionMacro("The " << name << " must be buffered where it is requested, but there are " << available
                             << " voxels, its buffered region is " << buffered << " and its requested region is "
                             << image->GetRequestedRegion());
  }
  return voxels;
}

template <typename TInputImage, typename TOutputImage>
template <typename TPixel, unsigned int VDimension>
auto
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::VerifyPixels(Image<TPixel, VDimension> * output,
                                                                  SizeValueType               count) const ->
  typename Image<TPixel, VDimension>::PixelContainerPointer
{
  auto * pixels = output->GetPixelContainer();
  if (!pixels || pixels->Size() < count)
  {
    itkExceptionMacro("An output must not change during an update: it has " << (pixels ? pixels->Size() : 0)
                                                                            << " pixels of " << count << '.');
  }
  return pixels;
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::ReleasePreparedVolume()
{
  m_IsReleaseWanted = m_State.has_value();
  if (!m_IsReleaseWanted)
  {
    m_Engine.Release();
  }
}

template <typename TInputImage, typename TOutputImage>
std::vector<double>
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::GetSettings() const
{
  std::vector<double> settings{ static_cast<double>(m_ReducedResampling), static_cast<double>(m_Oversampling) };
  if (const InputImageType * input = this->GetInput())
  {
    AddRegion(input->GetLargestPossibleRegion(), settings);
    settings.insert(settings.end(), input->GetSpacing().Begin(), input->GetSpacing().End());
    settings.insert(settings.end(), input->GetOrigin().Begin(), input->GetOrigin().End());
    const auto & direction = input->GetDirection().GetVnlMatrix();
    settings.insert(settings.end(), direction.begin(), direction.end());
  }
  const auto * view =
    dynamic_cast<const DataObjectDecorator<TransformType> *>(this->ProcessObject::GetInput("Transform"));
  if (view && view->Get())
  {
    // no two changes of objects have the same time
    settings.push_back(static_cast<double>(view->Get()->GetMTime()));
  }
  return settings;
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::AddRegion(const ImageRegion<3> & region,
                                                               std::vector<double> &  settings)
{
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    settings.insert(settings.end(),
                    { static_cast<double>(region.GetIndex(axis)), static_cast<double>(region.GetSize(axis)) });
  }
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::GetState() -> State
{
  return { this->GetInputs(), this->GetOutputs(), this->GetSettings() };
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::RequireUnchanged(bool isUnchanged) const
{
  if (!isUnchanged)
  {
    itkExceptionMacro("Parameters, inputs and outputs must not change during an update.");
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::UpdateOutputInformation()
{
  // the geometry of the outputs needs the transform that its source makes
  if (auto * view = dynamic_cast<DataObjectDecorator<TransformType> *>(this->ProcessObject::GetInput("Transform")))
  {
    // a source that makes images too must not run again for them
    for (const auto & name : this->GetInputNames())
    {
      auto * image = dynamic_cast<ImageBase<3> *>(this->ProcessObject::GetInput(name));
      if (image && view->GetSource())
      {
        image->UpdateOutputInformation();
        image->SetRequestedRegionToLargestPossibleRegion();
      }
    }
    view->Update();
  }
  Superclass::UpdateOutputInformation();
  m_SettingsOfOutputs = this->GetSettings();
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::VerifyUnchanged()
{
  const State state = this->GetState();
  this->RequireUnchanged(state.inputs == m_State->inputs && state.outputs == m_State->outputs &&
                         AreSame(state.settings, m_State->settings));
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::GenerateData()
{
  // an observer may have changed what was verified
  this->VerifyPreconditions();
  this->VerifyInputInformation();
  this->RequireUnchanged(AreSame(this->GetSettings(), m_SettingsOfOutputs));
  m_NumberOfWorkers = std::min(this->GetNumberOfWorkUnits(), this->GetMultiThreader()->GetMaximumNumberOfThreads());
  // one that no observer has
  m_UpdateThreader = dynamic_cast<MultiThreaderBase *>(this->GetMultiThreader()->CreateAnother().GetPointer());
  m_UpdateThreader->SetMaximumNumberOfThreads(this->GetMultiThreader()->GetMaximumNumberOfThreads());
  m_State = this->GetState();
  const auto end = [this] {
    m_State.reset();
    if (m_IsReleaseWanted)
    {
      this->ReleasePreparedVolume();
    }
  };
  try
  {
    this->AllocateOutputs();
    this->GeneratePixels();
  }
  catch (...)
  {
    end();
    throw;
  }
  end();
}

template <typename TInputImage, typename TOutputImage>
ShearWarp::Threads
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::GetThreads()
{
  return { m_NumberOfWorkers,
           [this](SizeValueType count, SizeValueType steps, float share, const ShearWarp::Task & task) {
             this->RunInParallel(count, steps, share, task);
           } };
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::RunInParallel(SizeValueType           count,
                                                                   SizeValueType           steps,
                                                                   float                   share,
                                                                   const ShearWarp::Task & task)
{
  const SizeValueType workers = std::min(count, m_NumberOfWorkers);
  m_UpdateThreader->SetNumberOfWorkUnits(static_cast<ThreadIdType>(workers));
  // ITK's reporters invoke events in their destructors, out of which no observer may throw; its threads lose exceptions
  const SizeValueType        reportedSteps = (count * steps + 99) / 100;
  const float                stepWeight = share / static_cast<float>(count * steps);
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
        task(n, step, worker);
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
  m_UpdateThreader->ParallelizeArray(
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
  this->VerifyUnchanged();
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpBaseImageFilter<TInputImage, TOutputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  os << indent << "ReducedResampling: " << m_ReducedResampling << std::endl;
  os << indent << "Oversampling: " << m_Oversampling << std::endl;
  os << indent << "SkippedFraction: " << this->GetSkippedFraction() << std::endl;
  os << indent << "InstructionSet: " << this->GetInstructionSet() << std::endl;
  os << indent << "PrincipalAxis: " << this->GetPrincipalAxis() << std::endl;
  os << indent << "PreparationSeconds: " << this->GetPreparationSeconds() << std::endl;
  os << indent << "ProjectionSeconds: " << this->GetProjectionSeconds() << std::endl;
  os << indent << "PreparedVolumeSizeInBytes: " << this->GetPreparedVolumeSizeInBytes() << std::endl;
}
} // namespace itk

#endif
