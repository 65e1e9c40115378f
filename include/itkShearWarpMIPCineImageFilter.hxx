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
#ifndef itkShearWarpMIPCineImageFilter_hxx
#define itkShearWarpMIPCineImageFilter_hxx

#include "itkMetaDataObject.h"

#include <algorithm>

namespace itk
{
template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::SetCenter(const PhysicalPointType & center)
{
  if (!m_IsCenterSet || !Self::HaveSameBits(m_Center, center))
  {
    m_Center = center;
    m_IsCenterSet = true;
    this->Modified();
  }
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::GetCenter() const -> PhysicalPointType
{
  return m_IsCenterSet ? m_Center : ShearWarpMIPView::GetCenter(this->GetInput());
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::UseImageCenter()
{
  if (m_IsCenterSet)
  {
    m_Center.Fill(0.0);
    m_IsCenterSet = false;
    this->Modified();
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::AddTransform(const TransformType * transform)
{
  if (!transform)
  {
    itkExceptionMacro("A frame's transform must not be null.");
  }
  m_Transforms.push_back(transform);
  this->Modified();
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::ClearTransforms()
{
  if (!m_Transforms.empty())
  {
    m_Transforms.clear();
    this->Modified();
  }
}

template <typename TInputImage, typename TOutputImage>
std::vector<double>
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::GetFrameAngles() const
{
  std::vector<double> angles;
  if (m_Transforms.empty())
  {
    for (unsigned int frame = 0; frame < m_NumberOfFrames; ++frame)
    {
      angles.push_back(this->GetFrameAngle(frame));
    }
  }
  return angles;
}

template <typename TInputImage, typename TOutputImage>
double
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::GetFrameAngle(unsigned int frame) const
{
  return ShearWarp::GetTurnAngle(frame, m_NumberOfFrames, m_StartAngle, m_AngularRange, m_Rocking);
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::GetFrameTransform(unsigned int frame) const ->
  typename TransformType::Pointer
{
  const auto frames = this->GetFrames();
  if (frame >= frames)
  {
    itkExceptionMacro("There is no frame " << frame << ": their number is " << frames << '.');
  }
  if (!m_Transforms.empty())
  {
    return m_Transforms[frame]->Clone();
  }
  return ShearWarpMIPView::Turn(this->GetFirstView(), m_RotationAxis, this->GetCenter(), this->GetFrameAngle(frame))
    .GetPointer();
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::GetFirstView() const -> TransformConstPointer
{
  TransformConstPointer view = this->GetTransform();
  if (!view)
  {
    view = ShearWarpMIPView::MakeUprightTransform(this->GetInput(), m_RotationAxis);
  }
  return view;
}

template <typename TInputImage, typename TOutputImage>
ModifiedTimeType
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::GetMTime() const
{
  ModifiedTimeType time = Superclass::GetMTime();
  for (const TransformConstPointer & transform : m_Transforms)
  {
    time = std::max(time, transform->GetMTime());
  }
  return time;
}

template <typename TInputImage, typename TOutputImage>
auto
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::MakeViews() const -> typename Superclass::ViewList
{
  typename Superclass::ViewList views;
  for (const TransformConstPointer & transform : m_Transforms)
  {
    views.push_back(ShearWarp::MakeView(transform));
  }
  if (m_Transforms.empty())
  {
    const TransformConstPointer first = this->GetFirstView();
    const PhysicalPointType     center = this->GetCenter();
    for (const double angle : this->GetFrameAngles())
    {
      views.push_back(ShearWarp::MakeView(ShearWarpMIPView::Turn(first, m_RotationAxis, center, angle)));
    }
  }
  return views;
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::VerifyPreconditions() const
{
  Superclass::VerifyPreconditions();
  this->template VerifyInputType<DecoratedTransformType>("Transform", "the view, a decorated transform");
  SizeValueType frame = 0;
  for (const TransformConstPointer & transform : m_Transforms)
  {
    try
    {
      ShearWarpFactorization::VerifyViewTransform(transform);
    }
    catch (const ExceptionObject & error)
    {
      itkExceptionMacro("Frame " << frame << ": " << error.GetDescription());
    }
    ++frame;
  }
  if (!m_Transforms.empty())
  {
    return;
  }
  if (m_NumberOfFrames == 0 || m_NumberOfFrames > MaximumNumberOfFrames)
  {
    itkExceptionMacro("NumberOfFrames must be from 1 to " << MaximumNumberOfFrames << ", but it is " << m_NumberOfFrames
                                                          << '.');
  }
  ShearWarp::VerifyTurn(m_RotationAxis, m_Center, m_StartAngle, m_AngularRange);
  if (this->GetTransformInput())
  {
    ShearWarpFactorization::VerifyViewTransform(this->GetTransform());
  }
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::SetGeometry(ImageBase<3> * output) const
{
  const ShearWarp::PictureGrid &          grid = this->GetScene().picture;
  const Size<2>                           size = this->GetPictureSize();
  const SizeValueType                     frames = this->GetScene().views.size();
  typename OutputImageType::SpacingType   spacing(1.0);
  typename OutputImageType::PointType     origin(0.0);
  typename OutputImageType::DirectionType direction;
  direction.SetIdentity();
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    spacing[axis] = grid.spacing[axis];
    origin[axis] = grid.origin[axis];
  }
  output->SetLargestPossibleRegion(typename OutputImageType::SizeType{ { size[0], size[1], frames } });
  output->SetSpacing(spacing);
  output->SetOrigin(origin);
  output->SetDirection(direction);
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::GenerateOutputInformation()
{
  Superclass::GenerateOutputInformation();
  std::vector<double> matrices;
  for (const ShearWarp::AffineMap3D & view : this->GetScene().views)
  {
    for (unsigned int row = 0; row < 3; ++row)
    {
      matrices.insert(matrices.end(), view.matrix[row], view.matrix[row] + 3);
      matrices.push_back(view.offset[row]);
    }
    matrices.insert(matrices.end(), { 0.0, 0.0, 0.0, 1.0 });
  }
  MetaDataDictionary dictionary;
  EncapsulateMetaData(dictionary, "FrameTransforms", matrices);
  if (m_Transforms.empty())
  {
    EncapsulateMetaData(dictionary, "FrameAngles", this->GetFrameAngles());
  }
  this->GetOutput()->SetMetaDataDictionary(dictionary);
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  os << indent << "Transform: " << this->GetTransform() << std::endl;
  os << indent << "NumberOfFrames: " << m_NumberOfFrames << std::endl;
  os << indent << "RotationAxis: " << m_RotationAxis << std::endl;
  os << indent << "Center: ";
  if (m_IsCenterSet)
  {
    os << m_Center << std::endl;
  }
  else
  {
    os << "the image's" << std::endl;
  }
  os << indent << "StartAngle: " << m_StartAngle << std::endl;
  os << indent << "AngularRange: " << m_AngularRange << std::endl;
  os << indent << "Rocking: " << (m_Rocking ? "On" : "Off") << std::endl;
  os << indent << "Transforms: " << m_Transforms.size() << std::endl;
}
} // namespace itk

#endif
