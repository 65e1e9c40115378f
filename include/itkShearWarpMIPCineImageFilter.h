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
#ifndef itkShearWarpMIPCineImageFilter_h
#define itkShearWarpMIPCineImageFilter_h

#include "itkDataObjectDecorator.h"
#include "itkShearWarpMIPBaseImageFilter.h"
#include "itkShearWarpMIPView.h"

namespace itk
{
/** \class ShearWarpMIPCineImageFilter
 * \brief Maximum intensity projections (MIPs) of a 3D image from many directions: a series that turns.
 *
 * Slice n of the 3D output is frame n. It has the same bits as the output of ShearWarpMIPImageFilter for the view that
 * GetFrameTransform() returns, with the same parameters. By default the viewer moves around the image's center, about
 * the patient's long axis, in NumberOfFrames equal steps of a full turn. RotationAxis, Center, StartAngle, AngularRange
 * and Rocking change the turn. With AddTransform(), the frames are any list of views instead.
 *
 * All frames have one grid, in view space. By default the grid clips no frame: its extent is the bounding box of all
 * frames' projections, and its spacing is the finest of all frames' own spacings. The output's third axis counts the
 * frames. The output's MetaDataDictionary has two entries of type `std::vector<double>`. "FrameAngles" has the angles
 * in degrees (not for a list of transforms). "FrameTransforms" has 16 numbers per frame: the matrix from view space to
 * physical space, row by row.
 *
 * The filter projects frames with the same principal axis together. A block of the volume serves all of them while it
 * is in the cache, so a series takes far less time than single views. This needs memory for an intermediate image for
 * each frame and thread, up to IntermediateMemory. With LocalMaximum, the filter projects frames one by one, because it
 * follows rays from front to back.
 *
 * Parameters, errors, streaming and the memory that is kept between updates are as for ShearWarpMIPImageFilter.
 * Without AddTransform(), Update() also throws ExceptionObject for a NumberOfFrames that is zero or too large, a
 * RotationAxis that is zero or not finite, and a Center, StartAngle or AngularRange that is not finite.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 * \tparam TOutputImage An Image of the same pixel type, of dimension 3: (u, v, frame).
 *
 * \ingroup ShearWarpMIP
 * \sa ShearWarpMIPImageFilter, ShearWarpMIPView
 */
template <typename TInputImage, typename TOutputImage = Image<typename TInputImage::PixelType, 3>>
class ITK_TEMPLATE_EXPORT ShearWarpMIPCineImageFilter : public ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>
{
public:
  ITK_DISALLOW_COPY_AND_MOVE(ShearWarpMIPCineImageFilter);

  using Self = ShearWarpMIPCineImageFilter;
  using Superclass = ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>;
  using Pointer = SmartPointer<Self>;
  using ConstPointer = SmartPointer<const Self>;

  itkNewMacro(Self);
  itkOverrideGetNameOfClassMacro(ShearWarpMIPCineImageFilter);

  static_assert(TOutputImage::ImageDimension == 3, "the output of a series must have dimension 3");

  using OutputImageType = TOutputImage;
  using typename Superclass::PhysicalPointType;
  using typename Superclass::TransformConstPointer;
  using typename Superclass::TransformType;
  using DecoratedTransformType = DataObjectDecorator<TransformType>;
  using AxisType = Vector<double, 3>;

  /** The view at angle 0, from view space to the image's physical space. It must be linear and invertible. The default
   * is the view of ShearWarpMIPView::MakeUprightTransform(): RotationAxis points up the picture. */
  itkSetGetDecoratedObjectInputMacro(Transform, TransformType);

  static constexpr unsigned int MaximumNumberOfFrames = 65535;

  /** The number of frames, at most MaximumNumberOfFrames; 36 by default. */
  itkSetMacro(NumberOfFrames, unsigned int);
  itkGetConstMacro(NumberOfFrames, unsigned int);

  /** The direction of the axis that the viewer moves about, in physical space, of any length. The default is the
   * patient's long axis, towards superior. Positive angles are right-handed: with the default axis, from anterior to
   * the patient's left. */
  itkShearWarpSetMacro(RotationAxis, AxisType);
  itkGetConstReferenceMacro(RotationAxis, AxisType);

  /** A point of the axis, in physical space; the image's center by default. */
  void
  SetCenter(const PhysicalPointType & center);
  PhysicalPointType
  GetCenter() const;

  /** Sets Center to the image's center again. */
  void
  UseImageCenter();

  /** The first frame's angle, in degrees; 0 by default. */
  itkShearWarpSetMacro(StartAngle, double);
  itkGetConstMacro(StartAngle, double);

  /** How far the viewer moves, in degrees, negative to the other side; 360 by default. Frame n of N is at StartAngle +
   * AngularRange n / N, so a full turn repeats no frame. */
  itkShearWarpSetMacro(AngularRange, double);
  itkGetConstMacro(AngularRange, double);

  /** Whether the viewer moves to and fro; off by default. Frame n of N is then at
   * StartAngle + AngularRange / 2 sin(2 pi n / N) / s, where s is the largest of these sines. So both ends of the range
   * are frames, and the series can repeat without a jump. Two frames are the two ends; a single frame is at StartAngle.
   */
  itkSetMacro(Rocking, bool);
  itkGetConstMacro(Rocking, bool);
  itkBooleanMacro(Rocking);

  /** Adds a frame of any view, from view space to physical space. The transform must be linear and invertible. The
   * filter then ignores NumberOfFrames and all parameters of the turn. If you change the transform in place, the change
   * takes effect at the next Update(); see ShearWarpMIPImageFilter for a CompositeTransform. */
  void
  AddTransform(const TransformType * transform);

  /** Removes the frames that were added. */
  void
  ClearTransforms();

  /** Returns the angles of all frames, in degrees; empty if transforms were added. They are the angles by the present
   * parameters, not the angles of the last update. */
  std::vector<double>
  GetFrameAngles() const;

  /** Returns a copy of the view of frame \a frame, from view space to physical space, by the present parameters. Throws
   * ExceptionObject if there is no such frame, or no input. */
  typename TransformType::Pointer
  GetFrameTransform(unsigned int frame) const;

  /** The transforms that were added are part of the filter's state. */
  ModifiedTimeType
  GetMTime() const override;

protected:
  ShearWarpMIPCineImageFilter() { m_RotationAxis[2] = 1.0; }
  ~ShearWarpMIPCineImageFilter() override = default;

  void
  VerifyPreconditions() const override;

  void
  GenerateOutputInformation() override;

  typename Superclass::ViewList
  MakeViews() const override;

  void
  SetGeometry(ImageBase<3> * output) const override;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

private:
  SizeValueType
  GetFrames() const
  {
    return m_Transforms.empty() ? m_NumberOfFrames : m_Transforms.size();
  }

  double
  GetFrameAngle(unsigned int frame) const;

  /** The view at angle 0. */
  TransformConstPointer
  GetFirstView() const;

  unsigned int      m_NumberOfFrames{ 36 };
  AxisType          m_RotationAxis{ 0.0 };
  PhysicalPointType m_Center{ 0.0 };
  bool              m_IsCenterSet{ false };
  double            m_StartAngle{ 0.0 };
  double            m_AngularRange{ 360.0 };
  bool              m_Rocking{ false };

  std::vector<TransformConstPointer> m_Transforms;
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPCineImageFilter.hxx"
#endif

#endif
