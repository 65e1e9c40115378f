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
 * It has the parameters of these filters, and projects any number of views onto one grid.
 *
 * It projects views with the same principal axis together: at most 256, and as many as fit into IntermediateMemory. So
 * it reads the volume once for all of them, and views from opposite sides share an intermediate image. With
 * LocalMaximum, it projects one view after the other. Each view has the same bits as in an update of its own.
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

  /** Lets the filter fit Size, OutputSpacing and OutputOrigin to the view again. */
  void
  FitOutputGrid();

  /** Value of pixels whose ray misses the image; 0 by default. */
  itkShearWarpSetMacro(DefaultPixelValue, OutputPixelType);
  itkGetConstReferenceMacro(DefaultPixelValue, OutputPixelType);

  /** Which of a ray's samples is its value: Maximum (the default), Minimum or AbsoluteMaximum. The absolute maximum is
   * the sample with the largest magnitude, with its sign; of two opposite samples, the positive one. */
  itkSetEnumMacro(Mode, ModeEnum);
  itkGetEnumMacro(Mode, ModeEnum);

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
   * threshold; with AbsoluteMaximum, behind the first local maximum of the magnitude. Rays without such a sample have
   * their maximum. The method is local maximum intensity projection: Sato et al., J Comput Assist Tomogr 22:912-917,
   * 1998. */
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
   * of a pixel's maximum, or the nearest place if there are several. The depth is that of the intermediate pixel with
   * the largest weight in the output pixel. It is not-a-number if the pixel has no sample. */
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
   * 2^53. Cells with a voxel that is not finite are left out. The depth is that of the extremum. MaskImage,
   * LocalMaximum, DepthAttenuation, Oversampling and NumberOfStreamDivisions must have their default values. */
  itkSetMacro(Exact, bool);
  itkGetConstMacro(Exact, bool);
  itkBooleanMacro(Exact);

  /** The number of slabs along the input's z axis in which the filter requests the voxels, one after the other; 1 by
   * default. It does not change the bits of the output. Slabs have at least eight slices. With more than one slab, the
   * filter keeps nothing, and each update requests all slabs again. */
  itkSetMacro(NumberOfStreamDivisions, unsigned int);
  itkGetConstMacro(NumberOfStreamDivisions, unsigned int);

  /** The most memory, in bytes, for the intermediate images of views that are projected together; 1 GiB by default.
   * Each view has an intermediate image for each thread. If one view needs more memory, it is projected alone. At most
   * 256 views are projected together. */
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

  /** Returns the view transforms, at least one, from view space to the image's physical space. They must be linear and
   * invertible. The output has their pictures in this order. */
  virtual ViewList
  MakeViews() const = 0;

  /** Sets the geometry of an output. */
  virtual void
  SetGeometry(ImageBase<OutputImageDimension> * output) const = 0;

  /** The grid of each view in the view plane, after GenerateOutputInformation(). */
  const ImageBase<2> *
  GetViewGrid() const
  {
    return m_Grid;
  }

  /** Returns whether a ray's value is the maximum of all its samples. */
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

  /** Sets one of the output grid's parameters, so that the filter no longer fits it. */
  template <typename TParameter>
  void
  SetGridParameter(TParameter & parameter, bool & fit, const TParameter & value);

  /** Returns the slices of the input's largest possible region. */
  ShearWarp::SliceRange
  GetSlices() const;

  /** Returns the number of slabs, at most NumberOfStreamDivisions. */
  SizeValueType
  GetNumberOfSlabs() const;

  /** Requests these slices of the input and the mask, and the slice before them, which their samples need. */
  void
  SetInputRequestedRegionToSlab(const ShearWarp::SliceRange & slab);

  /** Makes the source of \a image, if \a image is not null, put the requested region into memory. */
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
