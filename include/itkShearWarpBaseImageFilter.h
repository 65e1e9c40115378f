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
#include "itkShearWarpFactorization.h"
#include "itkShearWarpProjector.h"

#include <chrono>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

namespace itk
{
/** \class ShearWarpBaseImageFilter
 * \brief What all filters have in common that project 3D images by shear-warp factorization: the prepared volume, its
 * projector, and their threads.
 *
 * Observers may change how many threads there are and release the prepared volume during an update: that takes effect
 * after it. An update ends with an exception if an observer changes a parameter, an input or an output. Only the memory
 * of voxels must not be allocated again meanwhile.
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

  itkTypeMacro(ShearWarpBaseImageFilter, ImageToImageFilter);

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

  /** Reduced resampling leaves out parts of slices whose largest voxel is not above what the picture has there already.
   * It never changes a pixel. Auto, the default, uses it where it saves time. It is used for the plain maximum
   * alone. */
  itkSetEnumMacro(ReducedResampling, ReducedResamplingEnum);
  itkGetEnumMacro(ReducedResampling, ReducedResamplingEnum);

  /** Pixels of the intermediate image per voxel, along each axis: 1, the default, or 2, which samples each slice four
   * times as densely, so that the second interpolation, of the intermediate image, loses less. The output's grid stays
   * as it is. */
  itkSetMacro(Oversampling, unsigned int);
  itkGetConstMacro(Oversampling, unsigned int);

  /** The fraction of the volume, 0 to 1, that the last update left out by reduced resampling or by a mask. */
  itkGetConstMacro(SkippedFraction, double);

  /** The instruction set of the last update's kernels: "portable", "avx2" or "avx512". The fastest that the processor
   * has is used, unless the environment variable SHEARWARPMIP_INSTRUCTION_SET names another. */
  itkGetConstReferenceMacro(InstructionSet, std::string);

  /** Index axis of the input, 0, 1 or 2, along which the last update took the slices of the first view. */
  itkGetConstMacro(PrincipalAxis, unsigned int);

  /** Seconds that the last update took to prepare the volume; 0 if it was prepared already. */
  itkGetConstMacro(PreparationSeconds, double);

  /** Seconds that the last update took to project the volume to intermediate images. */
  itkGetConstMacro(ProjectionSeconds, double);

  /** Frees the memory that is kept for the next update: of the prepared volume, a mask's, and the intermediate images.
   * A later update prepares them again if it needs to. During an update it waits for the end. */
  void
  ReleasePreparedVolume();

  /** Bytes that are held beside inputs and outputs: what ReleasePreparedVolume() frees. Not for observers of an update.
   */
  virtual SizeValueType
  GetPreparedVolumeSizeInBytes() const
  {
    return m_PreparedVolume.GetSizeInBytes() + m_Projector.GetSizeInBytes();
  }

  void
  UpdateOutputInformation() override;

protected:
  using Kernels = ShearWarp::Kernels<InputPixelType>;
  using IntermediateImageType = ShearWarp::IntermediateImage<InputPixelType>;
  using ProjectorType = ShearWarpProjector<InputPixelType>;
  using Clock = std::chrono::steady_clock;

  ShearWarpBaseImageFilter() = default;
  ~ShearWarpBaseImageFilter() override = default;

  void
  VerifyPreconditions() ITKv5_CONST override;

  void
  EnlargeOutputRequestedRegion(DataObject * output) override;

  /** Calls GeneratePixels(), for which number of threads, parameters, inputs and outputs do not change. */
  void
  GenerateData() override;

  /** Gives the outputs, which are allocated, their pixels. */
  virtual void
  GeneratePixels() = 0;

  /** Frees what the next update would make again. */
  virtual void
  ReleaseMemory();

  /** All parameters, and the input's region, as numbers. */
  virtual std::vector<double>
  GetSettings() const;

  static void
  AddRegion(const ImageRegion<3> & region, std::vector<double> & settings);

  /** What an update depends on. Data objects live while it is held. */
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

  /** Throws ExceptionObject if there is an input beside the first that has a number, not a name. */
  void
  VerifyOneInput() const;

  /** Throws ExceptionObject if the input of that name is not a \a TObject. */
  template <typename TObject>
  void
  VerifyInputType(const DataObject::DataObjectIdentifierType & name, const std::string & purpose) const;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

  /** Throws ExceptionObject if the input is empty, or its spacing or origin is of no use. */
  void
  VerifyInputGeometry() const;

  /** Throws ExceptionObject if \a image, the input of that name, does not have the voxels that were requested. They
   * stay in memory while what it returns does. */
  template <typename TPixel, unsigned int VDimension>
  typename Image<TPixel, VDimension>::PixelContainerConstPointer
  VerifyVoxels(const std::string & name, const Image<TPixel, VDimension> * image) const;

  /** Throws ExceptionObject if \a output does not have \a count pixels. They stay in memory while what it returns does.
   */
  template <typename TPixel, unsigned int VDimension>
  typename Image<TPixel, VDimension>::PixelContainerPointer
  VerifyPixels(Image<TPixel, VDimension> * output, SizeValueType count) const;

  /** Chooses the kernels, and forgets the last update's measurements. */
  const Kernels &
  BeginUpdate(const ShearWarpFactorization & first);

  static double
  SecondsSince(Clock::time_point start)
  {
    return std::chrono::duration<double>(Clock::now() - start).count();
  }

  /** How many threads the update has. */
  SizeValueType
  GetNumberOfWorkers() const
  {
    return m_NumberOfWorkers;
  }

  /** How many of the slices along z of an image of \a size voxels are transposed at once, where they are not kept; at
   * least \a least for each thread. */
  std::ptrdiff_t
  GetSlabLength(const Size<3> & size, std::ptrdiff_t least) const;

  /** Calls \a process(n, step, worker) in parallel for each n of [0, count) and, one after the other, each step of
   * [0, steps); calls with the same worker, less than GetNumberOfWorkers(), do not overlap. Adds \a progressWeight to
   * the progress; throws ProcessAborted between two calls. */
  template <typename TFunction>
  void
  Parallelize(SizeValueType count, SizeValueType steps, float progressWeight, const TFunction & process);

  ShearWarpPreparedVolume<InputPixelType> m_PreparedVolume;
  ProjectorType                           m_Projector;

  ReducedResamplingEnum m_ReducedResampling{ ReducedResamplingEnum::Auto };
  unsigned int          m_Oversampling{ 1 };
  double                m_SkippedFraction{ 0.0 };
  double                m_PreparationSeconds{ 0.0 };
  double                m_ProjectionSeconds{ 0.0 };

private:
  /** As bits: a parameter can be not-a-number. */
  static bool
  AreSame(const std::vector<double> & a, const std::vector<double> & b)
  {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
  }

  std::string  m_InstructionSet{ "portable" };
  unsigned int m_PrincipalAxis{ 2 };

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
