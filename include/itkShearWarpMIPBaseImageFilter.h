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

#include "itkShearWarpBaseImageFilter.h"

#include <limits>
#include <vector>

namespace itk
{
/** \class ShearWarpMIPBaseImageFilter
 * \brief Base of the filters that project 3D images along rays.
 *
 * It has their parameters, and projects any number of views onto one grid.
 *
 * Views of one principal axis are projected together, as many as IntermediateMemory has room for and at most 256. So
 * the volume is read once for all of them, and views from opposite sides share an intermediate image. With
 * LocalMaximum views are projected one after the other. Each view has the bits that it has alone.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 * \tparam TOutputImage An Image of the same pixel type, of dimension 2 or 3.
 *
 * \ingroup ShearWarpMIP
 * \sa ShearWarpMIPImageFilter, ShearWarpMIPCineImageFilter
 */
template <typename TInputImage, typename TOutputImage>
class ITK_TEMPLATE_EXPORT ShearWarpMIPBaseImageFilter : public ShearWarpBaseImageFilter<TInputImage, TOutputImage>
{
public:
  ITK_DISALLOW_COPY_AND_MOVE(ShearWarpMIPBaseImageFilter);

  using Self = ShearWarpMIPBaseImageFilter;
  using Superclass = ShearWarpBaseImageFilter<TInputImage, TOutputImage>;
  using Pointer = SmartPointer<Self>;
  using ConstPointer = SmartPointer<const Self>;

  itkOverrideGetNameOfClassMacro(ShearWarpMIPBaseImageFilter);

  using Superclass::InputImageDimension;
  static constexpr unsigned int OutputImageDimension = TOutputImage::ImageDimension;

  using InputImageType = TInputImage;
  using OutputImageType = TOutputImage;
  using typename Superclass::InputPixelType;
  using typename Superclass::OutputPixelType;
  using typename Superclass::TransformConstPointer;
  using typename Superclass::TransformType;
  using OutputImageRegionType = typename OutputImageType::RegionType;
  using OutputIndexType = typename OutputImageType::IndexType;
  using SizeType = itk::Size<2>;
  using SpacingType = Vector<double, 2>;
  using OriginPointType = Point<double, 2>;
  using PhysicalPointType = Point<double, 3>;
  using MaskImageType = Image<unsigned char, 3>;
  using DepthImageType = Image<float, OutputImageDimension>;
  using ModeEnum = ShearWarpMIPImageFilterEnums::Mode;

  static_assert(OutputImageDimension == 2 || OutputImageDimension == 3,
                "the output of a projection must have dimension 2, or 3 for a slice in the image's physical space");

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

  /** Position of the output's first pixel center in the view plane, in units of view space; zero while it is fitted. */
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

  /** Which of a ray's samples is its value: the Maximum, by default, the Minimum, or the one of AbsoluteMaximum, with
   * its sign (the positive one of two). */
  itkSetEnumMacro(Mode, ModeEnum);
  itkGetEnumMacro(Mode, ModeEnum);

  /** Only samples of depth w, in view space, SlabNear <= w <= SlabFar count: by default from minus to plus infinity. In
   * the views of ShearWarpMIPView depth is mm behind the image's center. */
  itkSetMacro(SlabNear, double);
  itkGetConstMacro(SlabNear, double);
  itkSetMacro(SlabFar, double);
  itkGetConstMacro(SlabFar, double);

  /** Only samples whose physical position is within these corners count, along each physical axis; by default all. */
  itkSetMacro(CropLower, PhysicalPointType);
  itkGetConstReferenceMacro(CropLower, PhysicalPointType);
  itkSetMacro(CropUpper, PhysicalPointType);
  itkGetConstReferenceMacro(CropUpper, PhysicalPointType);

  /** Only voxels in the mask take part: those that are MaskLabel or, if that is 0 as by default, not 0. The mask has
   * the input's grid. A sample counts where its nearest voxel is in the mask; its value is the mean of those of its
   * voxels that are. */
  itkSetInputMacro(MaskImage, MaskImageType);
  itkGetInputMacro(MaskImage, MaskImageType);
  itkSetMacro(MaskLabel, unsigned char);
  itkGetConstMacro(MaskLabel, unsigned char);

  /** Rays end behind their first local maximum that is not less than LocalMaximumThreshold, so that a near vessel hides
   * a brighter one behind it. With Minimum it is the first local minimum that is not greater, with AbsoluteMaximum the
   * first local maximum of magnitude. Rays that meet none have their maximum. Local maximum intensity projection: Sato
   * et al., J Comput Assist Tomogr 22:912-917, 1998. Off by default. */
  itkSetMacro(LocalMaximum, bool);
  itkGetConstMacro(LocalMaximum, bool);
  itkBooleanMacro(LocalMaximum);
  itkSetMacro(LocalMaximumThreshold, InputPixelType);
  itkGetConstReferenceMacro(LocalMaximumThreshold, InputPixelType);

  /** How fast samples fade with depth, in 1 / unit of view space. A sample of value v at depth w takes part as
   * DefaultPixelValue + (v - DefaultPixelValue) f, where f = exp(-DepthAttenuation (w - w0)). Fading begins at w0, the
   * least depth of the sphere about the image's center that holds the image, or at SlabNear if that is deeper. So all
   * views of a turn about that center begin at the same depth. Any finite rate that is not negative will do; 0, none,
   * by default. DefaultPixelValue must be finite where samples fade. */
  itkSetMacro(DepthAttenuation, double);
  itkGetConstMacro(DepthAttenuation, double);

  /** Whether there is a Depth output; off by default. */
  void
  SetComputeDepth(bool compute);
  itkGetConstMacro(ComputeDepth, bool);
  itkBooleanMacro(ComputeDepth);

  /** The depth w of the output's values, in units of view space: T(u, v, w) is where a pixel's maximum lies, the
   * nearest one of several. It is that of the intermediate pixel that has the largest part in the output's;
   * not-a-number where no sample is. Null if ComputeDepth is off. */
  DepthImageType *
  GetDepthOutput();
  const DepthImageType *
  GetDepthOutput() const;

  /** Whether a pixel is the extremum of the image itself along its ray, not of samples. The image is the trilinear
   * interpolant of the voxels, within the slab and the box; up to half a voxel beyond the outer voxel centers it has
   * their values. In each cell it is a cubic along the ray, whose extremum is known in closed form: there is no step,
   * no principal axis and no second interpolation. The extremum is rounded once. The error before rounding is below
   * 2^-14 of the voxels' range. Cells with a voxel that is not finite are left out. Depth is that of the extremum. Off
   * by default. With it MaskImage, LocalMaximum, DepthAttenuation, Oversampling and NumberOfStreamDivisions must be as
   * by default. */
  itkSetMacro(Exact, bool);
  itkGetConstMacro(Exact, bool);
  itkBooleanMacro(Exact);

  /** In how many slabs along the input's z axis its voxels are requested, one after the other; 1 by default. The output
   * has the same bits. Slabs have at least eight slices. If there are more than one nothing is kept, and each
   * update gets all of them again. */
  itkSetMacro(NumberOfStreamDivisions, unsigned int);
  itkGetConstMacro(NumberOfStreamDivisions, unsigned int);

  /** The most memory, in bytes, that intermediate images of views which are projected together may take: each view has
   * one for each thread. A view that needs more is projected alone; more than 256 are never together. 1 GiB by default.
   */
  itkSetMacro(IntermediateMemory, SizeValueType);
  itkGetConstMacro(IntermediateMemory, SizeValueType);

  /** Seconds that the last update took to warp intermediate images to the output. */
  double
  GetWarpSeconds() const
  {
    return this->m_Engine.GetMeasurements().warpSeconds;
  }

protected:
  using ViewList = ShearWarp::ViewList;

  ShearWarpMIPBaseImageFilter() = default;
  ~ShearWarpMIPBaseImageFilter() override = default;

  /** The view transforms, from view space to the image's physical space: linear and invertible, at least one. Their
   * pictures follow each other in the output. */
  virtual ViewList
  MakeViews() const = 0;

  /** Gives an output its geometry. */
  virtual void
  SetGeometry(ImageBase<OutputImageDimension> * output) const = 0;

  /** The grid of each view in the view plane, after GenerateOutputInformation(). */
  const ImageBase<2> *
  GetViewGrid() const
  {
    return m_Grid;
  }

  /** Whether a ray's value is the maximum of all its samples. */
  bool
  IsPlainMaximum() const;

  void
  VerifyPreconditions() const override;

  void
  VerifyInputInformation() const override;

  void
  GenerateOutputInformation() override;

  void
  GenerateInputRequestedRegion() override;

  void
  GeneratePixels() override;

  std::vector<double>
  GetSettings() const override;

  using Superclass::MakeOutput;
  DataObject::Pointer
  MakeOutput(const ProcessObject::DataObjectIdentifierType & name) override;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

private:
  using RuleType = typename Superclass::EngineType::RuleType;

  RuleType
  MakeRule() const;

  /** Sets one of the output grid's parameters, which is no longer fitted then. */
  template <typename TParameter>
  void
  SetGridParameter(TParameter & parameter, bool & fit, const TParameter & value);

  /** The slices of the input's largest possible region. */
  ShearWarp::SliceRange
  GetSlices() const;

  /** At most NumberOfStreamDivisions. */
  SizeValueType
  GetNumberOfSlabs() const;

  /** These slices of the input and the mask, with the slice before, which their samples need. */
  void
  SetInputRequestedRegionToSlab(const ShearWarp::SliceRange & slab);

  /** Makes the source of \a image, if that is not null, put the requested region into memory. */
  void
  UpdateSlab(DataObject * image);

  SizeType        m_Size{ { 0, 0 } };
  SpacingType     m_OutputSpacing{ 0.0 };
  OriginPointType m_OutputOrigin{ 0.0 };
  bool            m_FitSize{ true };
  bool            m_FitOutputSpacing{ true };
  bool            m_FitOutputOrigin{ true };
  OutputPixelType m_DefaultPixelValue{};

  // of each view, in the view plane
  ImageBase<2>::Pointer m_Grid{ ImageBase<2>::New() };

  ModeEnum          m_Mode{ ModeEnum::Maximum };
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

  unsigned int  m_NumberOfStreamDivisions{ 1 };
  SizeValueType m_IntermediateMemory{ SizeValueType{ 1 } << 30 };
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPBaseImageFilter.hxx"
#endif

#endif
