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
#ifndef itkShearWarpMIPBaseImageFilter_h
#define itkShearWarpMIPBaseImageFilter_h

#include "itkImageToImageFilter.h"
#include "itkMultiThreaderBase.h"
#include "itkShearWarpEngine.h"
#include "itkShearWarpFactorization.h"

#include <atomic>
#include <cstring>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#ifndef itkOverrideGetNameOfClassMacro // before ITK 5.4
#  define itkOverrideGetNameOfClassMacro(thisClass) itkTypeMacro(thisClass, )
#endif

/** As itkSetMacro, but compares bits: `-ffast-math` drops what is not a number from a comparison. */
#define itkShearWarpSetMacro(name, type)             \
  virtual void Set##name(type value)                 \
  {                                                  \
    itkDebugMacro("setting " #name " to " << value); \
    if (!Self::HaveSameBits(this->m_##name, value))  \
    {                                                \
      this->m_##name = value;                        \
      this->Modified();                              \
    }                                                \
  }

namespace itk
{
namespace ShearWarp
{
/** Returns the computer's memory in bytes, or the size of the address space if the system does not report it. */
ShearWarpMIP_EXPORT double
GetPhysicalMemory();

/** Returns the center of the first pixel of a picture, as SetOutputParametersFromImage() takes it. */
ShearWarpMIP_EXPORT Point<double, 2>
                    FindFirstPixel(const ImageBase<2> * picture);
} // namespace ShearWarp

/** \class ShearWarpMIPBaseImageFilter
 * \brief Base of the filters that project 3D images along rays.
 *
 * It has the parameters of these filters, and projects any number of views onto one grid.
 *
 * It projects views with the same principal axis together: at most 256, and as many as fit into IntermediateMemory. So
 * it reads the volume once for all of them, and views from opposite sides share an intermediate image. With
 * LocalMaximum, it projects one view after the other. Each view has the same bits as in an update of its own.
 *
 * An update uses the parameters as they were when the output's geometry was computed. An observer that changes a
 * parameter during an update changes the next update. So do observers that change the number of threads, or release the
 * prepared volume. An update ends with an exception if an observer of its start changes inputs or outputs, or if an
 * observer takes away the pixels of an image that are still needed. An observer must not free or allocate the memory of
 * a pixel container during an update.
 *
 * If the transform of a view has a source, UpdateOutputInformation() updates this source first. If this source also
 * makes the image or the mask, it makes them whole.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 * \tparam TOutputImage An Image of the same pixel type, of dimension 2 or 3.
 *
 * \ingroup ShearWarpMIP
 * \sa ShearWarpMIPImageFilter, ShearWarpMIPCineImageFilter
 */
template <typename TInputImage, typename TOutputImage>
class ITK_TEMPLATE_EXPORT ShearWarpMIPBaseImageFilter : public ImageToImageFilter<TInputImage, TOutputImage>
{
public:
  ITK_DISALLOW_COPY_AND_MOVE(ShearWarpMIPBaseImageFilter);

  using Self = ShearWarpMIPBaseImageFilter;
  using Superclass = ImageToImageFilter<TInputImage, TOutputImage>;
  using Pointer = SmartPointer<Self>;
  using ConstPointer = SmartPointer<const Self>;

  itkOverrideGetNameOfClassMacro(ShearWarpMIPBaseImageFilter);

  static constexpr unsigned int InputImageDimension = TInputImage::ImageDimension;
  static constexpr unsigned int OutputImageDimension = TOutputImage::ImageDimension;

  using InputImageType = TInputImage;
  using OutputImageType = TOutputImage;
  using InputPixelType = typename InputImageType::PixelType;
  using OutputPixelType = typename OutputImageType::PixelType;
  using TransformType = Transform<double, 3, 3>;
  using TransformConstPointer = typename TransformType::ConstPointer;
  using OutputImageRegionType = typename OutputImageType::RegionType;
  using OutputIndexType = typename OutputImageType::IndexType;
  using SizeType = itk::Size<2>;
  using SpacingType = Vector<double, 2>;
  using OriginPointType = Point<double, 2>;
  using PhysicalPointType = Point<double, 3>;
  using MaskImageType = Image<unsigned char, 3>;
  using DepthImageType = Image<float, OutputImageDimension>;
  using ModeEnum = ShearWarpMIPImageFilterEnums::Mode;
  using InterpolationEnum = ShearWarpMIPImageFilterEnums::Interpolation;
  using ReducedResamplingEnum = ShearWarpMIPImageFilterEnums::ReducedResampling;

  static_assert(InputImageDimension == 3, "the input of a projection must have dimension 3");
  static_assert(std::is_base_of_v<Image<InputPixelType, 3>, InputImageType>, "the input must be an itk::Image");
  static_assert(std::is_same_v<OutputPixelType, InputPixelType>, "input and output must have the same pixel type");
  static_assert(std::is_arithmetic_v<InputPixelType> && !std::is_same_v<InputPixelType, bool> &&
                  !std::is_same_v<InputPixelType, long double>,
                "the pixel type must be a scalar other than bool and long double");
  static_assert(OutputImageDimension == 2 || OutputImageDimension == 3,
                "the output of a projection must have dimension 2, or 3 for a slice in the image's physical space");

  /** Size of the output, in pixels; zero if the filter fits it to the view. */
  void
  SetSize(const SizeType & size)
  {
    this->SetGridParameter(m_Size, m_FitSize, size);
  }
  itkGetConstReferenceMacro(Size, SizeType);

  /** Spacing of the output, in units of view space; zero if the filter fits it to the view. */
  void
  SetOutputSpacing(const SpacingType & spacing)
  {
    this->SetGridParameter(m_OutputSpacing, m_FitOutputSpacing, spacing);
  }
  itkGetConstReferenceMacro(OutputSpacing, SpacingType);

  /** Position of the output's first pixel center in the view plane, in units of view space; zero if the filter fits it
   * to the view. */
  void
  SetOutputOrigin(const OriginPointType & origin)
  {
    this->SetGridParameter(m_OutputOrigin, m_FitOutputOrigin, origin);
  }
  itkGetConstReferenceMacro(OutputOrigin, OriginPointType);

  /** Sets Size, OutputSpacing and OutputOrigin to the grid of \a image, whose axes are u and v: a picture that another
   * filter has made, or an image with the pixels that are wanted. The image is not kept. Its first pixel may have any
   * index, but the output's first pixel has the index zero. Throws ExceptionObject if \a image is null, or if its
   * direction is not the identity. */
  void
  SetOutputParametersFromImage(const ImageBase<2> * image);

  /** Lets the filter fit Size, OutputSpacing and OutputOrigin to the view again. */
  void
  FitOutputGrid();

  /** Value of pixels whose ray misses the image; 0 by default. */
  itkShearWarpSetMacro(DefaultPixelValue, OutputPixelType);
  itkGetConstReferenceMacro(DefaultPixelValue, OutputPixelType);

  /** The value of a ray: the Maximum (the default) or the Minimum of its samples, their AbsoluteMaximum or their Mean.
   * The absolute maximum is the sample with the largest magnitude, with its sign; of two opposite samples, the positive
   * one. For the mean (average intensity projection), a pixel of the intermediate image is the mean of its samples,
   * rounded half upward to the pixel type, and the output is interpolated between these means. Sums of integers are
   * exact. Samples of floating-point voxels are added in double precision, from the viewer on; the sum is never beyond
   * the range of doubles, and the mean never beyond the range of its samples. With Mean, ComputeDepth, LocalMaximum and
   * Exact must be off, and an image of pixels of 8 or 16 bits has at most 65536 voxels along each axis. */
  itkSetEnumMacro(Mode, ModeEnum);
  itkGetEnumMacro(Mode, ModeEnum);

  /** Whether samples and pixels are interpolated: Linear (the default) or Nearest, which is for labels. With Nearest, a
   * sample has the value of the nearest voxel in its slice, and a pixel of the output the value of the nearest pixel of
   * the intermediate image, so that no value appears that no voxel has. Of two equally near voxels or pixels, the one
   * with the higher index wins along each axis. With Nearest, Mode must not be Mean, and Exact, DepthAttenuation and
   * Oversampling must have their default values. */
  itkSetEnumMacro(Interpolation, InterpolationEnum);
  itkGetEnumMacro(Interpolation, InterpolationEnum);

  /** Only samples with SlabNear <= w <= SlabFar count, where w is the depth in view space. The default is from minus to
   * plus infinity. In the views of ShearWarpMIPView, the depth is the distance in mm behind the image's center.
   * Positions are rounded numbers, so samples beyond a limit by at most 1e-9 of a voxel's extent along the depth axis
   * count too. This is enough if the image is at most 100 000 voxels away from the origin of space. */
  itkShearWarpSetMacro(SlabNear, double);
  itkGetConstMacro(SlabNear, double);
  itkShearWarpSetMacro(SlabFar, double);
  itkGetConstMacro(SlabFar, double);

  /** Only samples with a physical position between these corners count, along each physical axis; by default all.
   * The limits have the tolerance of SlabNear. */
  itkShearWarpSetMacro(CropLower, PhysicalPointType);
  itkGetConstReferenceMacro(CropLower, PhysicalPointType);
  itkShearWarpSetMacro(CropUpper, PhysicalPointType);
  itkGetConstReferenceMacro(CropUpper, PhysicalPointType);

  /** Only voxels inside the mask count. A voxel is inside if its mask value is MaskLabel; if MaskLabel is 0, the
   * default, a voxel is inside if its mask value is not 0. The mask must have the input's grid. A sample counts if its
   * nearest voxel is inside the mask. Its value is the weighted mean of its voxels inside the mask. */
  itkSetInputMacro(MaskImage, MaskImageType);
  itkGetInputMacro(MaskImage, MaskImageType);
  itkSetMacro(MaskLabel, unsigned char);
  itkGetConstMacro(MaskLabel, unsigned char);

  /** Whether rays end behind their first local maximum of at least LocalMaximumThreshold; off by default. A near vessel
   * then hides a brighter vessel behind it. With Minimum, rays end behind their first local minimum of at most the
   * threshold. Other modes have no local maximum. Rays without such a sample have their maximum. The method is local
   * maximum intensity projection: Sato et al., J Comput Assist Tomogr 22:912-917, 1998. */
  itkSetMacro(LocalMaximum, bool);
  itkGetConstMacro(LocalMaximum, bool);
  itkBooleanMacro(LocalMaximum);
  itkShearWarpSetMacro(LocalMaximumThreshold, InputPixelType);
  itkGetConstReferenceMacro(LocalMaximumThreshold, InputPixelType);

  /** How fast samples fade with depth, in 1 / unit of view space; 0, no fading, by default. A sample with value v at
   * depth w becomes DefaultPixelValue + (v - DefaultPixelValue) f, where f = exp(-DepthAttenuation (w - w0)). Fading
   * begins at w0, the least depth of the smallest sphere about the image's center that holds the image, or at SlabNear
   * if SlabNear is deeper. So fading begins at the same depth in all views of a turn about the center. The rate can be
   * any finite number that is not negative. With fading, DefaultPixelValue must be finite. */
  itkShearWarpSetMacro(DepthAttenuation, double);
  itkGetConstMacro(DepthAttenuation, double);

  /** Whether there is a Depth output; off by default. */
  void
  SetComputeDepth(bool compute);
  itkGetConstMacro(ComputeDepth, bool);
  itkBooleanMacro(ComputeDepth);

  /** The depth w of the output's values, in units of view space; null if ComputeDepth is off. T(u, v, w) is the place
   * of a pixel's maximum, or the nearest place if there are several. A pixel has the depth of the intermediate pixel
   * with the largest weight in its interpolation. The depth is not-a-number if the pixel has no sample. */
  DepthImageType *
  GetDepthOutput();
  const DepthImageType *
  GetDepthOutput() const;

  /** Whether a pixel is the extremum of the interpolated image along its ray, instead of the extremum of samples; off
   * by default. The interpolated image is the trilinear interpolant of the voxels, within the slab and the box. It
   * extends half a voxel beyond the outer voxel centers, with the values of the outer voxels. In each cell it is a
   * cubic along the ray, and the extremum of the cubic has a closed form. So there is no step, no principal axis and no
   * second interpolation. The extremum is rounded once. For pixels of 8 and 16 bits, the error before rounding is below
   * 2^-14 of the range of the pixel type. Wider pixels are computed in double precision, which rounds integers beyond
   * 2^53. Cells with a voxel that is not finite are left out. Depths are exact, too. MaskImage,
   * LocalMaximum, DepthAttenuation and Oversampling must have their default values. */
  itkSetMacro(Exact, bool);
  itkGetConstMacro(Exact, bool);
  itkBooleanMacro(Exact);

  /** The number of divisions along the input's z axis in which the filter requests the voxels, one after the other; 1
   * by default. It does not change the bits of the output. A division has at least eight slices. With more than one,
   * the filter keeps nothing, and each update requests all divisions again. */
  itkSetMacro(NumberOfStreamDivisions, unsigned int);
  itkGetConstMacro(NumberOfStreamDivisions, unsigned int);

  /** The most memory, in bytes, for the intermediate images of views that are projected together; 1 GiB by default.
   * Each view has an intermediate image for each thread. If one view needs more memory, it is projected alone. At most
   * 256 views are projected together. */
  itkSetMacro(IntermediateMemory, SizeValueType);
  itkGetConstMacro(IntermediateMemory, SizeValueType);

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

  /** Seconds that the last update took to warp intermediate images to the output. */
  double
  GetWarpSeconds() const
  {
    return m_Engine.GetMeasurements().warpSeconds;
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

  /** A parameter that an observer changed during the update is a change for the next update. */
  void
  UpdateOutputData(DataObject * output) override;

protected:
  using EngineType = ShearWarpEngine<ShearWarp::EnginePixel<InputPixelType>>;
  using RuleType = typename EngineType::RuleType;
  using ViewList = std::vector<ShearWarp::AffineMap3D>;

  ShearWarpMIPBaseImageFilter() = default;
  ~ShearWarpMIPBaseImageFilter() override = default;

  /** Returns the views, at least one, from view space to the image's physical space. The output has their pictures in
   * this order. */
  virtual ViewList
  MakeViews() const = 0;

  /** Sets the geometry of an output. */
  virtual void
  SetGeometry(ImageBase<OutputImageDimension> * output) const = 0;

  /** The scene and the rule of the update, after GenerateOutputInformation(). */
  const ShearWarp::Scene &
  GetScene() const
  {
    return m_Scene;
  }
  const RuleType &
  GetRule() const
  {
    return m_Rule;
  }

  /** The size of the picture of each view, after GenerateOutputInformation(). */
  SizeType
  GetPictureSize() const;

  /** Returns the rule of the present parameters. */
  RuleType
  MakeRule() const;

  void
  VerifyPreconditions() const override;

  void
  VerifyInputInformation() const override;

  /** Throws ExceptionObject if the numbered inputs are not as expected: by default only the first one. */
  virtual void
  VerifyIndexedInputs() const;

  /** Throws ExceptionObject if the input \a name is not a \a TObject. */
  template <typename TObject>
  void
  VerifyInputType(const DataObject::DataObjectIdentifierType & name, const std::string & purpose) const;

  void
  GenerateOutputInformation() override;

  void
  GenerateInputRequestedRegion() override;

  void
  EnlargeOutputRequestedRegion(DataObject * output) override;

  /** Allocates the outputs and calls GeneratePixels(). */
  void
  GenerateData() override;

  /** Computes the pixels of the outputs. */
  virtual void
  GeneratePixels();

  /** Unlike `==`, also for numbers that are not finite, whatever the compiler's options. */
  template <typename T>
  static bool
  HaveSameBits(const T & a, const T & b)
  {
    return std::memcmp(&a, &b, sizeof(T)) == 0;
  }

  /** Throws ExceptionObject if \a image does not have the voxels of \a wanted in memory. Returns their container. */
  template <typename TPixel, unsigned int VDimension>
  typename Image<TPixel, VDimension>::PixelContainerConstPointer
  VerifyVoxels(const std::string &               name,
               const Image<TPixel, VDimension> * image,
               const ImageRegion<VDimension> &   wanted) const;

  /** Throws ExceptionObject if \a output does not have \a count pixels. Returns their container. */
  template <typename TPixel, unsigned int VDimension>
  typename Image<TPixel, VDimension>::PixelContainerPointer
  VerifyPixels(Image<TPixel, VDimension> * output, SizeValueType count) const;

  /** Calls \a function(threads). The threads report the filter's progress, and throw ProcessAborted between two tasks.
   * Their number does not change during the call, and the prepared volume is not released. */
  template <typename TFunction>
  void
  CallWithThreads(const TFunction & function);

  /** Returns the voxels of an image's buffered region, within the image of \a whole. */
  template <typename TPixel>
  static ShearWarp::Voxels<ShearWarp::EnginePixel<TPixel>>
  MakeVoxels(const Image<TPixel, 3> * image, const ImageRegion<3> & whole);

  /** Returns the picture whose pixels begin at \a pixels. */
  static typename EngineType::PictureType
  MakePicture(InputPixelType * pixels)
  {
    return { reinterpret_cast<ShearWarp::EnginePixel<InputPixelType> *>(pixels), nullptr };
  }

  using Superclass::MakeOutput;
  DataObject::Pointer
  MakeOutput(const ProcessObject::DataObjectIdentifierType & name) override;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

  EngineType m_Engine;

private:
  /** What an update depends on. Whatever an observer does, these stay. */
  struct UpdateData
  {
    ShearWarp::Scene                  scene;
    RuleType                          rule;
    ImageRegion<3>                    region; // of the input
    typename InputImageType::Pointer  input;
    MaskImageType::Pointer            mask;
    typename OutputImageType::Pointer output;
    typename DepthImageType::Pointer  depths;
  };

  /** Projects the volume for a pass. Returns the voxels of the last slab. */
  typename InputImageType::PixelContainerConstPointer
  AddSlabs(std::size_t pass, const UpdateData & update);

  void
  MakePictures(std::size_t pass, const UpdateData & update);

  /** Sets one of the output grid's parameters, so that the filter no longer fits it. */
  template <typename TParameter>
  void
  SetGridParameter(TParameter & parameter, bool & fit, const TParameter & value);

  /** Returns the region of a slab, and of the slice before the slab, which its samples need. */
  static ImageRegion<3>
  GetSlabRegion(ImageRegion<3> whole, const ShearWarp::SliceRange & slab);

  /** Makes the source of \a image put a region into memory. */
  static void
  LoadRegion(ImageBase<3> * image, const ImageRegion<3> & region);

  void
  RunInParallel(std::size_t count, std::size_t steps, const ShearWarp::Task & task);

  void
  ReportProgress();

  /** When a parameter, or the transform, changed last. */
  ModifiedTimeType
  GetParameterTime() const;

  SizeType        m_Size{ { 0, 0 } };
  SpacingType     m_OutputSpacing{ 0.0 };
  OriginPointType m_OutputOrigin{ 0.0 };
  bool            m_FitSize{ true };
  bool            m_FitOutputSpacing{ true };
  bool            m_FitOutputOrigin{ true };
  OutputPixelType m_DefaultPixelValue{};

  ModeEnum          m_Mode{ ModeEnum::Maximum };
  InterpolationEnum m_Interpolation{ InterpolationEnum::Linear };
  double            m_SlabNear{ -std::numeric_limits<double>::infinity() };
  double            m_SlabFar{ std::numeric_limits<double>::infinity() };
  PhysicalPointType m_CropLower{ -std::numeric_limits<double>::infinity() };
  PhysicalPointType m_CropUpper{ std::numeric_limits<double>::infinity() };
  unsigned char     m_MaskLabel{ 0 };
  bool              m_LocalMaximum{ false };
  InputPixelType    m_LocalMaximumThreshold{};
  double            m_DepthAttenuation{ 0.0 };
  bool              m_ComputeDepth{ false };
  bool              m_Exact{ false };

  ReducedResamplingEnum m_ReducedResampling{ ReducedResamplingEnum::Auto };
  unsigned int          m_Oversampling{ 1 };
  unsigned int          m_NumberOfStreamDivisions{ 1 };
  SizeValueType         m_IntermediateMemory{ SizeValueType{ 1 } << 30 };

  // of the update, from GenerateOutputInformation() on
  ShearWarp::Scene m_Scene{};
  RuleType         m_Rule;
  ImageRegion<3>   m_InputRegion;
  const void *     m_InputOfRule{ nullptr };
  const void *     m_MaskOfRule{ nullptr };
  TimeStamp        m_RuleTime;

  // while threads run
  MultiThreaderBase::Pointer m_UpdateThreader;
  SizeValueType              m_NumberOfWorkers{ 1 };
  std::thread::id            m_CallingThread;
  unsigned int               m_ReportedPercent{ 0 };
  bool                       m_IsUpdating{ false };
  bool                       m_IsReleaseWanted{ false };
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPBaseImageFilter.hxx"
#endif

#endif
