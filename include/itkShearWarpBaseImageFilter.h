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
#ifndef itkShearWarpBaseImageFilter_h
#define itkShearWarpBaseImageFilter_h

#include "itkDataObjectDecorator.h"
#include "itkImageToImageFilter.h"
#include "itkMultiThreaderBase.h"
#include "itkShearWarpEngine.h"

#include <cstring>
#include <optional>
#include <string>
#include <vector>

#ifndef itkOverrideGetNameOfClassMacro // before ITK 5.4
#  define itkOverrideGetNameOfClassMacro(thisClass) itkTypeMacro(thisClass, )
#endif

/** As itkSetMacro, but compares bits: `-ffast-math` drops what is not a number from a comparison. */
#define itkShearWarpSetMacro(name, type)                  \
  virtual void Set##name(type value)                      \
  {                                                       \
    itkDebugMacro("setting " #name " to " << value);      \
    if (!Superclass::HaveSameBits(this->m_##name, value)) \
    {                                                     \
      this->m_##name = value;                             \
      this->Modified();                                   \
    }                                                     \
  }

namespace itk
{
/** \class ShearWarpBaseImageFilter
 * \brief Base of the filters that project 3D images by shear-warp factorization.
 *
 * It has the engine and the threads of these filters.
 * If the transform of a view has a source, UpdateOutputInformation() updates this source first. If this source also
 * makes the image or the mask, it makes them whole.
 *
 * Observers may change the number of threads and release the prepared volume during an update: both take effect after
 * the update. An update ends with an exception if an observer changes a parameter, an input or an output. The memory of
 * voxels must not be allocated again during an update.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 * \tparam TOutputImage An Image of the same pixel type.
 *
 * \ingroup ShearWarpMIP
 * \sa ShearWarpMIPBaseImageFilter, ShearWarpMIPPartImageFilter
 */
template <typename TInputImage, typename TOutputImage>
class ITK_TEMPLATE_EXPORT ShearWarpBaseImageFilter : public ImageToImageFilter<TInputImage, TOutputImage>
{
public:
  ITK_DISALLOW_COPY_AND_MOVE(ShearWarpBaseImageFilter);

  using Self = ShearWarpBaseImageFilter;
  using Superclass = ImageToImageFilter<TInputImage, TOutputImage>;
  using Pointer = SmartPointer<Self>;
  using ConstPointer = SmartPointer<const Self>;

  itkOverrideGetNameOfClassMacro(ShearWarpBaseImageFilter);

  static constexpr unsigned int InputImageDimension = TInputImage::ImageDimension;

  using InputImageType = TInputImage;
  using OutputImageType = TOutputImage;
  using InputPixelType = typename InputImageType::PixelType;
  using OutputPixelType = typename OutputImageType::PixelType;
  using TransformType = Transform<double, 3, 3>;
  using TransformConstPointer = typename TransformType::ConstPointer;
  using ReducedResamplingEnum = ShearWarpMIPImageFilterEnums::ReducedResampling;

  static_assert(InputImageDimension == 3, "the input of a projection must have dimension 3");
  static_assert(std::is_base_of_v<Image<InputPixelType, 3>, InputImageType>, "the input must be an itk::Image");
  static_assert(std::is_same_v<OutputPixelType, InputPixelType>, "input and output must have the same pixel type");
  static_assert(std::is_arithmetic_v<InputPixelType> && !std::is_same_v<InputPixelType, bool> &&
                  !std::is_same_v<InputPixelType, long double>,
                "the pixel type must be a scalar other than bool and long double");

  /** Whether the filter skips parts of slices whose largest voxel is not above the values that the picture already has.
   * Skipping never changes a pixel. Auto, the default, skips parts only where this saves time. Only the plain maximum
   * uses reduced resampling. */
  itkSetEnumMacro(ReducedResampling, ReducedResamplingEnum);
  itkGetEnumMacro(ReducedResampling, ReducedResamplingEnum);

  /** Pixels of the intermediate image per voxel, along each axis: 1, the default, or 2. With 2, the filter takes four
   * times as many samples of each slice, and the interpolation of the intermediate image loses less detail. The
   * output's grid does not change. */
  itkSetMacro(Oversampling, unsigned int);
  itkGetConstMacro(Oversampling, unsigned int);

  /** The fraction of the volume, 0 to 1, that the last update left out by reduced resampling or by a mask. */
  double
  GetSkippedFraction() const
  {
    return m_Engine.GetMeasurements().skippedFraction;
  }

  /** The instruction set of the last update's kernels: "portable", "generic" (the compiler's vectors), "avx2" or
   * "avx512". The filter uses the fastest one of the processor, unless the environment variable
   * SHEARWARPMIP_INSTRUCTION_SET names another. */
  const std::string &
  GetInstructionSet() const
  {
    return m_Engine.GetMeasurements().instructionSet;
  }

  /** Index axis of the input, 0, 1 or 2, along which the last update took the slices of the first view. */
  unsigned int
  GetPrincipalAxis() const
  {
    return m_Engine.GetMeasurements().principalAxis;
  }

  /** Seconds that the last update took to prepare the volume; 0 if it was prepared already. */
  double
  GetPreparationSeconds() const
  {
    return m_Engine.GetMeasurements().preparationSeconds;
  }

  /** Seconds that the last update took to project the volume to intermediate images. */
  double
  GetProjectionSeconds() const
  {
    return m_Engine.GetMeasurements().projectionSeconds;
  }

  /** Frees the memory that is kept for the next update: the prepared volume, the prepared mask and the intermediate
   * images. A later update prepares them again if it needs them. A call during an update takes effect at its end. */
  void
  ReleasePreparedVolume();

  /** Returns the bytes that the filter holds beside inputs and outputs, which ReleasePreparedVolume() frees. Observers
   * must not call it during an update. */
  SizeValueType
  GetPreparedVolumeSizeInBytes() const
  {
    return m_Engine.GetSizeInBytes();
  }

  void
  UpdateOutputInformation() override;

protected:
  using EngineType = ShearWarpEngine<InputPixelType>;

  ShearWarpBaseImageFilter() = default;
  ~ShearWarpBaseImageFilter() override = default;

  void
  VerifyPreconditions() const override;

  void
  EnlargeOutputRequestedRegion(DataObject * output) override;

  /** Calls GeneratePixels(). The number of threads, parameters, inputs and outputs do not change during this call. */
  void
  GenerateData() override;

  /** Computes the pixels of the outputs, which are already allocated. */
  virtual void
  GeneratePixels() = 0;

  /** Returns all parameters, and the input's region, as numbers. */
  virtual std::vector<double>
  GetSettings() const;

  static void
  AddRegion(const ImageRegion<3> & region, std::vector<double> & settings);

  /** Everything that an update depends on. It keeps its data objects alive. */
  struct State
  {
    std::vector<DataObject::Pointer> inputs, outputs;
    std::vector<double>              settings;
  };

  virtual State
  GetState();

  /** Throws ExceptionObject if an observer changed what the update depends on. */
  void
  VerifyUnchanged();

  void
  RequireUnchanged(bool isUnchanged) const;

  /** Throws ExceptionObject if the numbered inputs are not as expected: by default only the first one. */
  virtual void
  VerifyIndexedInputs() const;

  /** Throws ExceptionObject if the input of that name is not a \a TObject. */
  template <typename TObject>
  void
  VerifyInputType(const DataObject::DataObjectIdentifierType & name, const std::string & purpose) const;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

  /** Unlike `==`, also for numbers that are not finite, whatever the compiler's options. */
  template <typename T>
  static bool
  HaveSameBits(const T & a, const T & b)
  {
    return std::memcmp(&a, &b, sizeof(T)) == 0;
  }

  /** Throws ExceptionObject if \a image, the input of that name, does not have the voxels that were requested. They
   * stay in memory as long as the returned object. */
  template <typename TPixel, unsigned int VDimension>
  typename Image<TPixel, VDimension>::PixelContainerConstPointer
  VerifyVoxels(const std::string & name, const Image<TPixel, VDimension> * image) const;

  /** Throws ExceptionObject if \a output does not have \a count pixels. They stay in memory as long as the returned
   * object. */
  template <typename TPixel, unsigned int VDimension>
  typename Image<TPixel, VDimension>::PixelContainerPointer
  VerifyPixels(Image<TPixel, VDimension> * output, SizeValueType count) const;

  /** Returns the threads of the update, which report the filter's progress and throw ProcessAborted between two calls.
   */
  ShearWarp::Threads
  GetThreads();

  EngineType m_Engine;

  ReducedResamplingEnum m_ReducedResampling{ ReducedResamplingEnum::Auto };
  unsigned int          m_Oversampling{ 1 };

private:
  /** Compares the bits of numbers, because a parameter can be not-a-number. */
  static bool
  AreSame(const std::vector<double> & a, const std::vector<double> & b)
  {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
  }

  void
  RunInParallel(SizeValueType count, SizeValueType steps, float share, const ShearWarp::Task & task);

  std::vector<double> m_SettingsOfOutputs; // by which the outputs' geometry was made

  // of the update
  std::optional<State>       m_State;
  MultiThreaderBase::Pointer m_UpdateThreader;
  SizeValueType              m_NumberOfWorkers{ 1 };
  bool                       m_IsReleaseWanted{ false };
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpBaseImageFilter.hxx"
#endif

#endif
