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
#ifndef itkShearWarpMIPImageFilter_h
#define itkShearWarpMIPImageFilter_h

#include "itkDataObjectDecorator.h"
#include "itkImageToImageFilter.h"
#include "itkShearWarpFactorization.h"
#include "itkShearWarpProjector.h"

namespace itk
{
/** \class ShearWarpMIPImageFilter
 * \brief Maximum intensity projection (MIP) of a 3D image from any direction.
 *
 * Pixel (u, v) of the 2D output is the maximum of the input along the line of all w at T(u, v, w), where T is the
 * Transform parameter, from view space to the image's physical space (as in ResampleImageFilter, output to input).
 * The output's index axes point along u and v, its spacing and origin are in view space: mm, for a rigid
 * transform of an image in mm. Where the line misses the image the output is DefaultPixelValue; every other
 * value is one that the input's voxels bound.
 *
 * The method is shear-warp factorization: Fang et al., "Fast Maximum Intensity Projection Algorithm Using Shear Warp
 * Factorization and Reduced Resampling", Magn Reson Med 47:696-700, 2002. Each slice of the volume
 * across the principal viewing axis is interpolated bilinearly, with one set of weights, onto the grid of a
 * sheared intermediate image, in which the maximum is taken; the intermediate image is then interpolated
 * bilinearly at the output's pixels. Both interpolations are exactly defined (see itkShearWarpKernels.h), so that a
 * result does not depend on the machine or on the number of threads.
 *
 * The first view of an image finds the maxima of its cubes of eight voxels a side, which reduced resampling needs; the
 * first view along the image's x axis makes a transposed copy of the volume, of the input's size. Both are kept until
 * the input changes or ReleasePreparedVolume() is called: a change of view or of any parameter prepares nothing again.
 * Memory is kept too for an intermediate image of each thread.
 *
 * By default the output's grid is fitted to the view. Its extent is the projected bounding box of the whole image;
 * its spacing is the image's smallest spacing, scaled as the transform scales the view plane's axes. Each of Size,
 * OutputSpacing and OutputOrigin that is set stays as it is and the others are fitted around it: a grid of given
 * Size is centred on the projected image, one of given OutputOrigin reaches to the far end of it.
 *
 * Infinite voxels make the samples around them infinite or not-a-number. Samples that are not a number never win, and a
 * pixel that meets no other sample, or only minus infinity, has DefaultPixelValue.
 *
 * Update() throws ExceptionObject for a transform that is missing, not linear, not finite or not invertible; for an
 * OutputSpacing that is not positive or not finite, an OutputOrigin that is not finite, a Size of zero; for an
 * Oversampling other than 1 and 2, NumberOfStreamDivisions of zero; for an input that is empty, has a spacing that is
 * not positive, or was not put into memory by its source; and for an output larger than the computer's memory. It
 * throws MemoryAllocationError where memory runs out. After an exception or an abort the filter is as usable as before.
 *
 * Filters may update in several threads at once if they share no data object, as ITK's pipeline changes the
 * requested region even of an input. They can share voxels: give each filter an image of its own, made by
 * Image::Graft(). They can share a transform that no one changes.
 *
 * The output can't be computed in pieces; any request enlarges to the whole output. The input is requested whole or,
 * with NumberOfStreamDivisions, slab by slab from a source that streams: then an image larger than memory can be
 * projected, and needs memory for a slab (twice for views along x) and for the intermediate images.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 * \tparam TOutputImage An Image of dimension 2 of the same pixel type.
 *
 * \ingroup ShearWarpMIP
 * \sa MaximumProjectionImageFilter, ResampleImageFilter, ShearWarpMIPView
 */
template <typename TInputImage, typename TOutputImage = Image<typename TInputImage::PixelType, 2>>
class ITK_TEMPLATE_EXPORT ShearWarpMIPImageFilter : public ImageToImageFilter<TInputImage, TOutputImage>
{
public:
  ITK_DISALLOW_COPY_AND_MOVE(ShearWarpMIPImageFilter);

  using Self = ShearWarpMIPImageFilter;
  using Superclass = ImageToImageFilter<TInputImage, TOutputImage>;
  using Pointer = SmartPointer<Self>;
  using ConstPointer = SmartPointer<const Self>;

  itkNewMacro(Self);
  itkTypeMacro(ShearWarpMIPImageFilter, ImageToImageFilter);

  static constexpr unsigned int InputImageDimension = TInputImage::ImageDimension;
  static constexpr unsigned int OutputImageDimension = TOutputImage::ImageDimension;

  using InputImageType = TInputImage;
  using OutputImageType = TOutputImage;
  using InputPixelType = typename InputImageType::PixelType;
  using OutputPixelType = typename OutputImageType::PixelType;
  using OutputImageRegionType = typename OutputImageType::RegionType;
  using SizeType = typename OutputImageType::SizeType;
  using SpacingType = typename OutputImageType::SpacingType;
  using OriginPointType = typename OutputImageType::PointType;
  using TransformType = Transform<double, 3, 3>;
  using DecoratedTransformType = DataObjectDecorator<TransformType>;
  using ReducedResamplingEnum = ShearWarpMIPImageFilterEnums::ReducedResampling;

  static_assert(InputImageDimension == 3, "the input of a projection must have dimension 3");
  static_assert(OutputImageDimension == 2, "the output of a projection must have dimension 2");
  static_assert(std::is_base_of_v<Image<InputPixelType, 3>, InputImageType>, "the input must be an itk::Image");
  static_assert(std::is_same_v<OutputPixelType, InputPixelType>, "input and output must have the same pixel type");
  static_assert(std::is_arithmetic_v<InputPixelType> && !std::is_same_v<InputPixelType, bool> &&
                  !std::is_same_v<InputPixelType, long double>,
                "the pixel type must be a scalar other than bool and long double");

  /** View space to the image's physical space; identity by default. Must be linear and invertible. A transform that
   * is changed in place takes effect at the next Update(). */
  itkSetGetDecoratedObjectInputMacro(Transform, TransformType);

  /** Size of the output, in pixels; zero while it is fitted. */
  void
  SetSize(const SizeType & size)
  {
    this->SetGridParameter(m_Size, m_FitSize, size);
  }
  itkGetConstReferenceMacro(Size, SizeType);

  /** Spacing of the output, in units of view space; zero while it is fitted. */
  void
  SetOutputSpacing(const SpacingType & spacing)
  {
    this->SetGridParameter(m_OutputSpacing, m_FitOutputSpacing, spacing);
  }
  itkGetConstReferenceMacro(OutputSpacing, SpacingType);

  /** Position of the output's first pixel centre in the view plane, in units of view space; zero while it is fitted. */
  void
  SetOutputOrigin(const OriginPointType & origin)
  {
    this->SetGridParameter(m_OutputOrigin, m_FitOutputOrigin, origin);
  }
  itkGetConstReferenceMacro(OutputOrigin, OriginPointType);

  /** Fits Size, OutputSpacing and OutputOrigin to the view again: undoes their setting. */
  void
  FitOutputGrid();

  /** Value of the output where a ray misses the image; 0 by default. */
  itkSetMacro(DefaultPixelValue, OutputPixelType);
  itkGetConstReferenceMacro(DefaultPixelValue, OutputPixelType);

  /** Reduced resampling leaves out parts of slices whose largest voxel is not above what the picture has there already.
   * It never changes a pixel. Auto, the default, uses it where it saves time. On and Auto keep a table of
   * block maxima. */
  itkSetEnumMacro(ReducedResampling, ReducedResamplingEnum);
  itkGetEnumMacro(ReducedResampling, ReducedResamplingEnum);

  /** Pixels of the intermediate image per voxel, along each axis: 1, the default, or 2, which samples each slice four
   * times as densely, so that the second interpolation, of the intermediate image, loses less. The output's grid stays
   * as it is. */
  itkSetMacro(Oversampling, unsigned int);
  itkGetConstMacro(Oversampling, unsigned int);

  /** In how many slabs along the input's z axis its voxels are requested, one after the other; 1 by default. The output
   * has the same bits. Slabs have at least eight slices. If there are more than one nothing prepared is kept, and each
   * update gets all of them again. */
  itkSetMacro(NumberOfStreamDivisions, unsigned int);
  itkGetConstMacro(NumberOfStreamDivisions, unsigned int);

  /** The fraction of the volume, 0 to 1, that the last update left out by reduced resampling. */
  itkGetConstMacro(SkippedFraction, double);

  /** The instruction set of the last update's kernels: "portable", "avx2" or "avx512". The fastest that the processor
   * has is used, unless the environment variable SHEARWARPMIP_INSTRUCTION_SET names another. */
  itkGetConstReferenceMacro(InstructionSet, std::string);

  /** Index axis of the input, 0, 1 or 2, along which the last update took the slices. */
  itkGetConstMacro(PrincipalAxis, unsigned int);

  /** Seconds that the last update took to prepare the volume; 0 if it was prepared already. */
  itkGetConstMacro(PreparationSeconds, double);

  /** Seconds that the last update took to project the volume to the intermediate image. */
  itkGetConstMacro(ProjectionSeconds, double);

  /** Seconds that the last update took to warp the intermediate image to the output. */
  itkGetConstMacro(WarpSeconds, double);

  /** Frees the memory of the prepared volume; a later update prepares it again if it needs to. */
  void
  ReleasePreparedVolume()
  {
    m_PreparedVolume.Release();
  }

  /** Bytes that the prepared volume holds beside the input. */
  SizeValueType
  GetPreparedVolumeSizeInBytes() const
  {
    return m_PreparedVolume.GetSizeInBytes();
  }

protected:
  ShearWarpMIPImageFilter();
  ~ShearWarpMIPImageFilter() override = default;

  void
  VerifyPreconditions() ITKv5_CONST override;

  void
  VerifyInputInformation() ITKv5_CONST override;

  void
  GenerateOutputInformation() override;

  void
  GenerateInputRequestedRegion() override;

  void
  EnlargeOutputRequestedRegion(DataObject * output) override;

  void
  GenerateData() override;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

private:
  /** Sets one of the output grid's parameters, which is no longer fitted then. */
  template <typename TParameter>
  void
  SetGridParameter(TParameter & parameter, bool & fit, const TParameter & value);

  /** Of the input's region, slab \a n of GetNumberOfSlabs(): from and to which slice. */
  struct Slab
  {
    std::ptrdiff_t begin, end;
  };

  Slab
  GetSlab(SizeValueType n) const;

  SizeValueType
  GetNumberOfSlabs() const;

  /** The slab's part of the input, with the slice before, which its samples need. */
  void
  SetInputRequestedRegionToSlab(const Slab & slab);

  void
  PrepareVolume(const Slab & slab, const ShearWarp::Kernels<InputPixelType> & kernels, float progressWeight);

  const ShearWarp::Kernels<InputPixelType> &
  ChooseKernels() const;

  SizeValueType
  GetNumberOfWorkers();

  /** Calls \a process(n, step, worker) in parallel for each n of [0, count) and, one after the other, each step of
   * [0, steps); calls with the same worker, less than GetNumberOfWorkers(), do not overlap. Adds \a progressWeight to
   * the progress; throws ProcessAborted between two calls. */
  template <typename TFunction>
  void
  Parallelize(SizeValueType count, SizeValueType steps, float progressWeight, const TFunction & process);

  SizeType        m_Size{ { 0, 0 } };
  SpacingType     m_OutputSpacing{ 0.0 };
  OriginPointType m_OutputOrigin{ 0.0 };
  bool            m_FitSize{ true };
  bool            m_FitOutputSpacing{ true };
  bool            m_FitOutputOrigin{ true };
  OutputPixelType m_DefaultPixelValue{};

  ShearWarpPreparedVolume<InputPixelType> m_PreparedVolume;
  ShearWarpProjector<InputPixelType>      m_Projector;

  ReducedResamplingEnum m_ReducedResampling{ ReducedResamplingEnum::Auto };
  unsigned int          m_Oversampling{ 1 };
  unsigned int          m_NumberOfStreamDivisions{ 1 };
  double                m_SkippedFraction{ 0.0 };
  std::string           m_InstructionSet{ "portable" };

  unsigned int m_PrincipalAxis{ 2 };
  double       m_PreparationSeconds{ 0.0 };
  double       m_ProjectionSeconds{ 0.0 };
  double       m_WarpSeconds{ 0.0 };
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPImageFilter.hxx"
#endif

#endif
