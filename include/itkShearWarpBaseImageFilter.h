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

#include "itkImageToImageFilter.h"
#include "itkShearWarpFactorization.h"
#include "itkShearWarpProjector.h"

#include <chrono>
#include <string>

namespace itk
{
/** \class ShearWarpBaseImageFilter
 * \brief What all filters have in common that project 3D images by shear-warp factorization: the prepared volume, its
 * projector, and their threads.
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

  /** The fraction of the volume, 0 to 1, that the last update left out by reduced resampling. */
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

  /** Frees the memory of the prepared volume; a later update prepares it again if it needs to. */
  virtual void
  ReleasePreparedVolume()
  {
    m_PreparedVolume.Release();
  }

  /** Bytes that the prepared volume, and a mask's, hold beside the inputs. */
  virtual SizeValueType
  GetPreparedVolumeSizeInBytes() const
  {
    return m_PreparedVolume.GetSizeInBytes();
  }

protected:
  using Kernels = ShearWarp::Kernels<InputPixelType>;
  using IntermediateImageType = ShearWarp::IntermediateImage<InputPixelType>;
  using Clock = std::chrono::steady_clock;

  ShearWarpBaseImageFilter() = default;
  ~ShearWarpBaseImageFilter() override = default;

  void
  VerifyPreconditions() ITKv5_CONST override;

  void
  EnlargeOutputRequestedRegion(DataObject * output) override;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

  /** Throws ExceptionObject if the input is empty, or its spacing or origin is of no use. */
  void
  VerifyInputGeometry() const;

  /** Throws ExceptionObject if \a image, the input of that name, does not have the voxels that were requested. */
  template <typename TPixel>
  void
  VerifyVoxels(const char * name, const Image<TPixel, 3> * image) const;

  /** Chooses the kernels, and forgets the last update's measurements. */
  const Kernels &
  BeginUpdate(const ShearWarpFactorization & first);

  static double
  SecondsSince(Clock::time_point start)
  {
    return std::chrono::duration<double>(Clock::now() - start).count();
  }

  SizeValueType
  GetNumberOfWorkers();

  /** Calls \a process(n, step, worker) in parallel for each n of [0, count) and, one after the other, each step of
   * [0, steps); calls with the same worker, less than GetNumberOfWorkers(), do not overlap. Adds \a progressWeight to
   * the progress; throws ProcessAborted between two calls. */
  template <typename TFunction>
  void
  Parallelize(SizeValueType count, SizeValueType steps, float progressWeight, const TFunction & process);

  ShearWarpPreparedVolume<InputPixelType> m_PreparedVolume;
  ShearWarpProjector<InputPixelType>      m_Projector;

  ReducedResamplingEnum m_ReducedResampling{ ReducedResamplingEnum::Auto };
  unsigned int          m_Oversampling{ 1 };
  double                m_SkippedFraction{ 0.0 };
  double                m_PreparationSeconds{ 0.0 };
  double                m_ProjectionSeconds{ 0.0 };

private:
  std::string  m_InstructionSet{ "portable" };
  unsigned int m_PrincipalAxis{ 2 };
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpBaseImageFilter.hxx"
#endif

#endif
