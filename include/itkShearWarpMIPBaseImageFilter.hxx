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

#include "itkDataObjectDecorator.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <thread>
#include <typeinfo>
#include <utility>

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
  if (fit || !Self::HaveSameBits(parameter, value))
  {
    parameter = value;
    fit = false;
    this->Modified();
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::SetOutputParametersFromImage(const ImageBase<2> * image)
{
  this->SetOutputOrigin(ShearWarp::FindFirstPixel(image));
  this->SetOutputSpacing(image->GetSpacing());
  this->SetSize(image->GetLargestPossibleRegion().GetSize());
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
  this->template VerifyInputType<InputImageType>("Primary", "the 3D image that is projected");
  this->VerifyIndexedInputs();
  this->template VerifyInputType<MaskImageType>("MaskImage", "the mask, a 3D image of unsigned char");
  if (m_NumberOfStreamDivisions == 0)
  {
    itkExceptionMacro("NumberOfStreamDivisions must be positive, but it is 0.");
  }
  ShearWarp::CallEngine([this] { this->MakeRule().Verify(); });
  if (!m_FitSize && (m_Size[0] == 0 || m_Size[1] == 0))
  {
    itkExceptionMacro("Size must not be zero, but it is " << m_Size << '.');
  }
  const ShearWarp::PictureGrid grid{ {},
                                     { m_OutputSpacing[0], m_OutputSpacing[1] },
                                     { m_OutputOrigin[0], m_OutputOrigin[1] } };
  ShearWarp::CallEngine([&] { ShearWarp::VerifyPictureGrid(grid, m_FitOutputSpacing); });
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::VerifyIndexedInputs() const
{
  for (ProcessObject::DataObjectPointerArraySizeType n = 1; n < this->GetNumberOfIndexedInputs(); ++n)
  {
    if (this->ProcessObject::GetInput(n))
    {
      itkExceptionMacro("Input " << n << " is not used: only input 0, the 3D image that is projected, is numbered.");
    }
  }
}

template <typename TInputImage, typename TOutputImage>
template <typename TObject>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::VerifyInputType(
  const DataObject::DataObjectIdentifierType & name,
  const std::string &                          purpose) const
{
  const DataObject * object = this->ProcessObject::GetInput(name);
  if (object && !dynamic_cast<const TObject *>(object))
  {
    itkExceptionMacro("Input " << name << " is for " << purpose << ", not for an object of class "
                               << object->GetNameOfClass() << " (" << typeid(*object).name() << ").");
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::VerifyInputInformation() const
{
  // first, because ITK 6 compares the input with itself
  ShearWarp::CallEngine([this] { ShearWarp::VerifyVolumeGrid(ShearWarp::MakeVolumeGrid(this->GetInput())); });
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
template <typename TPixel, unsigned int VDimension>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::VerifyVoxels(const std::string &               name,
                                                                     const Image<TPixel, VDimension> * image,
                                                                     const ImageRegion<VDimension> &   wanted) const ->
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
  if (!buffered.IsInside(wanted) || rest == 0)
  {
    itkExceptionMacro("The " << name << " must be buffered where it is requested, but there are " << available
                             << " voxels, its buffered region is " << buffered << " and the requested region is "
                             << wanted);
  }
  return voxels;
}

template <typename TInputImage, typename TOutputImage>
template <typename TPixel, unsigned int VDimension>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::VerifyPixels(Image<TPixel, VDimension> * output,
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
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::MakeRule() const -> RuleType
{
  RuleType rule;
  rule.mode = m_Mode;
  rule.interpolation = m_Interpolation;
  rule.reducedResampling = m_ReducedResampling;
  rule.oversampling = m_Oversampling;
  rule.slabNear = m_SlabNear;
  rule.slabFar = m_SlabFar;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    rule.cropLower[axis] = m_CropLower[axis];
    rule.cropUpper[axis] = m_CropUpper[axis];
  }
  rule.hasMask = this->GetMaskImage() != nullptr;
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
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::UpdateOutputInformation()
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
}

template <typename TInputImage, typename TOutputImage>
ModifiedTimeType
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetParameterTime() const
{
  const auto * view =
    dynamic_cast<const DataObjectDecorator<TransformType> *>(this->ProcessObject::GetInput("Transform"));
  ModifiedTimeType time = std::max(this->GetMTime(), view && view->Get() ? view->Get()->GetMTime() : 0);
  for (const DataObject * image :
       { static_cast<const DataObject *>(this->GetInput()), static_cast<const DataObject *>(this->GetMaskImage()) })
  {
    // a source changes its images in an update
    time = image && !image->GetSource() ? std::max(time, image->GetMTime()) : time;
  }
  return time;
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::UpdateOutputData(DataObject * output)
{
  try
  {
    Superclass::UpdateOutputData(output);
  }
  catch (...)
  {
    // ITK does not do this where an observer of the start throws
    this->ResetPipeline();
    throw;
  }
  if (this->GetParameterTime() > m_RuleTime.GetMTime())
  {
    this->Modified();
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GenerateOutputInformation()
{
  const InputImageType * input = this->GetInput();
  m_RuleTime.Modified();
  m_Rule = this->MakeRule();
  m_InputOfRule = input;
  m_MaskOfRule = this->GetMaskImage();
  m_InputRegion = input->GetLargestPossibleRegion();
  m_Scene.volume = ShearWarp::MakeVolumeGrid(input);
  m_Scene.views = this->MakeViews();
  m_Scene.slabs = ShearWarp::CountSlabs({ 0, m_Scene.volume.size[2] }, m_NumberOfStreamDivisions);
  m_Scene.intermediateMemory = m_IntermediateMemory;
  const ShearWarp::PictureGrid given{ { static_cast<double>(m_Size[0]), static_cast<double>(m_Size[1]) },
                                      { m_OutputSpacing[0], m_OutputSpacing[1] },
                                      { m_OutputOrigin[0], m_OutputOrigin[1] } };
  ShearWarp::CallEngine([&] {
    m_Scene.picture =
      ShearWarp::FitGrid(m_Scene.views, m_Scene.volume, given, m_FitSize, m_FitOutputSpacing, m_FitOutputOrigin);
  });
  const auto & [size, spacing, origin] = m_Scene.picture;
  const double memory = ShearWarp::GetPhysicalMemory();
  const double bytes = size[0] * size[1] * sizeof(OutputPixelType) * static_cast<double>(m_Scene.views.size());
  if (!(bytes <= memory))
  {
    itkExceptionMacro("Size must fit in memory, but " << m_Scene.views.size() << " x [" << size[0] << ", " << size[1]
                                                      << "] pixels, with an OutputSpacing of [" << spacing[0] << ", "
                                                      << spacing[1] << "], take " << bytes / 1e9
                                                      << " GB, and this computer has " << memory / 1e9 << " GB.");
  }
  this->SetGeometry(this->GetOutput());
  if (m_ComputeDepth)
  {
    this->SetGeometry(this->GetDepthOutput());
  }
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetPictureSize() const -> SizeType
{
  return { { static_cast<SizeValueType>(m_Scene.picture.size[0]),
             static_cast<SizeValueType>(m_Scene.picture.size[1]) } };
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::EnlargeOutputRequestedRegion(DataObject * output)
{
  output->SetRequestedRegionToLargestPossibleRegion();
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GenerateInputRequestedRegion()
{
  const auto first = ShearWarp::GetSlab({ 0, m_Scene.volume.size[2] }, 0, m_Scene.slabs);
  const auto region = GetSlabRegion(m_InputRegion, first);
  const_cast<InputImageType *>(this->GetInput())->SetRequestedRegion(region);
  if (const MaskImageType * mask = this->GetMaskImage())
  {
    const_cast<MaskImageType *>(mask)->SetRequestedRegion(region);
  }
}

template <typename TInputImage, typename TOutputImage>
ImageRegion<3>
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GetSlabRegion(ImageRegion<3>                whole,
                                                                      const ShearWarp::SliceRange & slab)
{
  const std::ptrdiff_t begin = std::max<std::ptrdiff_t>(slab.begin - 1, 0);
  whole.SetIndex(2, whole.GetIndex(2) + begin);
  whole.SetSize(2, static_cast<SizeValueType>(slab.end - begin));
  return whole;
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::LoadRegion(ImageBase<3> * image, const ImageRegion<3> & region)
{
  image->SetRequestedRegion(region);
  image->PropagateRequestedRegion();
  image->UpdateOutputData();
}

template <typename TInputImage, typename TOutputImage>
template <typename TPixel>
ShearWarp::Voxels<ShearWarp::EnginePixel<TPixel>>
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::MakeVoxels(const Image<TPixel, 3> * image,
                                                                   const ImageRegion<3> &   whole)
{
  const auto &                                      buffered = image->GetBufferedRegion();
  ShearWarp::Voxels<ShearWarp::EnginePixel<TPixel>> voxels;
  voxels.data = reinterpret_cast<const ShearWarp::EnginePixel<TPixel> *>(image->GetBufferPointer());
  voxels.owner = image;
  voxels.version = image->GetMTime();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    voxels.box.begin[axis] = buffered.GetIndex(axis) - whole.GetIndex(axis);
    voxels.box.size[axis] = static_cast<std::ptrdiff_t>(buffered.GetSize(axis));
  }
  return voxels;
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GenerateData()
{
  this->AllocateOutputs();
  this->GeneratePixels();
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::GeneratePixels()
{
  const UpdateData update{ m_Scene,
                           m_Rule,
                           m_InputRegion,
                           const_cast<InputImageType *>(this->GetInput()),
                           const_cast<MaskImageType *>(this->GetMaskImage()),
                           this->GetOutput(),
                           this->GetDepthOutput() };
  if (update.input.IsNull() || update.input.GetPointer() != m_InputOfRule || update.mask.GetPointer() != m_MaskOfRule ||
      update.input->GetLargestPossibleRegion() != update.region || update.rule.hasDepth != update.depths.IsNotNull())
  {
    itkExceptionMacro("Inputs and outputs must not change during an update.");
  }
  this->CallWithThreads([&](const ShearWarp::Threads & threads) {
    m_Engine.Begin(update.scene, update.rule, threads);
    for (std::size_t pass = 0; pass < m_Engine.GetNumberOfPasses(); ++pass)
    {
      // exact pictures need the voxels
      const auto voxels = this->AddSlabs(pass, update);
      this->MakePictures(pass, update);
    }
    m_Engine.End();
  });
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::AddSlabs(std::size_t pass, const UpdateData & update) ->
  typename InputImageType::PixelContainerConstPointer
{
  typename InputImageType::PixelContainerConstPointer voxels;
  MaskImageType::PixelContainerConstPointer           maskVoxels;
  for (const ShearWarp::SliceRange & slab : m_Engine.BeginPass(pass))
  {
    const ImageRegion<3> wanted = GetSlabRegion(update.region, slab);
    if (update.scene.slabs > 1)
    {
      // the memory of the slab before
      voxels = nullptr;
      maskVoxels = nullptr;
      LoadRegion(update.input, wanted);
      if (update.mask)
      {
        LoadRegion(update.mask, wanted);
      }
    }
    voxels = this->VerifyVoxels("input", update.input.GetPointer(), wanted);
    typename EngineType::MaskType voxelsOfMask;
    if (update.mask)
    {
      maskVoxels = this->VerifyVoxels("MaskImage", update.mask.GetPointer(), wanted);
      voxelsOfMask = MakeVoxels<unsigned char>(update.mask, update.region);
    }
    m_Engine.Add(slab, MakeVoxels<InputPixelType>(update.input, update.region), voxelsOfMask);
  }
  return voxels;
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::MakePictures(std::size_t pass, const UpdateData & update)
{
  const auto count = static_cast<SizeValueType>(update.scene.picture.size[0] * update.scene.picture.size[1]);
  for (const std::size_t view : m_Engine.GetViews(pass))
  {
    const SizeValueType first = view * count;
    const auto          pixels = this->VerifyPixels(update.output.GetPointer(), first + count);
    typename DepthImageType::PixelContainerPointer depths;
    auto                                           picture = MakePicture(pixels->GetBufferPointer() + first);
    if (update.depths)
    {
      depths = this->VerifyPixels(update.depths.GetPointer(), first + count);
      picture.depths = depths->GetBufferPointer() + first;
    }
    update.rule.isExact ? m_Engine.Refine(view, picture) : m_Engine.Warp(view, picture);
    if (this->VerifyPixels(update.output.GetPointer(), first + count) != pixels ||
        (update.depths && this->VerifyPixels(update.depths.GetPointer(), first + count) != depths))
    {
      itkExceptionMacro("An output must not change during an update.");
    }
  }
}

template <typename TInputImage, typename TOutputImage>
template <typename TFunction>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::CallWithThreads(const TFunction & function)
{
  if (m_IsUpdating)
  {
    itkExceptionMacro(
      "The filter projects already, for an observer or in another thread: use one filter for each thread.");
  }
  m_NumberOfWorkers = std::min(this->GetNumberOfWorkUnits(), this->GetMultiThreader()->GetMaximumNumberOfThreads());
  // one that no observer has
  m_UpdateThreader = dynamic_cast<MultiThreaderBase *>(this->GetMultiThreader()->CreateAnother().GetPointer());
  m_UpdateThreader->SetMaximumNumberOfThreads(this->GetMultiThreader()->GetMaximumNumberOfThreads());
  m_CallingThread = std::this_thread::get_id();
  m_ReportedPercent = 0;
  m_IsUpdating = true;
  const auto end = [this] {
    m_IsUpdating = false;
    if (m_IsReleaseWanted)
    {
      this->ReleasePreparedVolume();
    }
  };
  try
  {
    const ShearWarp::Threads threads{ m_NumberOfWorkers,
                                      [this](std::size_t count, std::size_t steps, const ShearWarp::Task & task) {
                                        this->RunInParallel(count, steps, task);
                                      } };
    ShearWarp::CallEngine([&] { function(threads); });
    this->UpdateProgress(1.0f);
  }
  catch (...)
  {
    end();
    throw;
  }
  end();
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::ReleasePreparedVolume()
{
  m_IsReleaseWanted = m_IsUpdating;
  if (!m_IsReleaseWanted)
  {
    m_Engine.Release();
  }
}

/** ITK's reporters are not used: they invoke events in destructors, where no observer may throw. ITK's threads lose
 * exceptions. */
template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::RunInParallel(std::size_t             count,
                                                                      std::size_t             steps,
                                                                      const ShearWarp::Task & task)
{
  const SizeValueType workers = std::min<SizeValueType>(count, m_NumberOfWorkers);
  m_UpdateThreader->SetNumberOfWorkUnits(static_cast<ThreadIdType>(workers));
  std::atomic<std::size_t> next{ 0 };
  std::exception_ptr       exception;
  std::mutex               mutex;
  const auto               work = [&](SizeValueType worker) {
    for (std::size_t n = next++; n < count; n = next++)
    {
      for (std::size_t step = 0; step < steps; ++step)
      {
        if (this->GetAbortGenerateData())
        {
          throw ProcessAborted(__FILE__, __LINE__);
        }
        task(n, step, worker);
        this->ReportProgress();
      }
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
}

/** Reports whole percents, in the thread that called the filter. The last one is reported at the end. */
template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>::ReportProgress()
{
  if (std::this_thread::get_id() == m_CallingThread)
  {
    const auto percent = std::min(static_cast<unsigned int>(100.0 * m_Engine.GetProgress()), 99u);
    if (percent > m_ReportedPercent)
    {
      m_ReportedPercent = percent;
      this->UpdateProgress(0.01f * static_cast<float>(percent));
    }
  }
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
  os << indent << "Interpolation: " << m_Interpolation << std::endl;
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
  os << indent << "ReducedResampling: " << m_ReducedResampling << std::endl;
  os << indent << "Oversampling: " << m_Oversampling << std::endl;
  os << indent << "SkippedFraction: " << this->GetSkippedFraction() << std::endl;
  os << indent << "InstructionSet: " << this->GetInstructionSet() << std::endl;
  os << indent << "PrincipalAxis: " << this->GetPrincipalAxis() << std::endl;
  os << indent << "PreparationSeconds: " << this->GetPreparationSeconds() << std::endl;
  os << indent << "ProjectionSeconds: " << this->GetProjectionSeconds() << std::endl;
  if (!m_IsUpdating)
  {
    os << indent << "PreparedVolumeSizeInBytes: " << this->GetPreparedVolumeSizeInBytes() << std::endl;
  }
  os << indent << "WarpSeconds: " << this->GetWarpSeconds() << std::endl;
}
} // namespace itk

#endif
