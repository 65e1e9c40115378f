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
  if (!m_IsCenterSet || !Superclass::HaveSameBits(m_Center, center))
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
  m_ListTime.Modified();
  this->Modified();
}

template <typename TInputImage, typename TOutputImage>
void
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::ClearTransforms()
{
  if (!m_Transforms.empty())
  {
    m_Transforms.clear();
    m_ListTime.Modified();
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
  if (!m_Transforms.empty())
  {
    return { m_Transforms.size(), [this, views = m_Transforms](SizeValueType frame) {
              this->RequireUnchanged(views[frame]->GetMTime() <= m_FitTime);
              return ShearWarp::ViewSpace(views[frame]);
            } };
  }
  return {
    m_NumberOfFrames,
    [first = this->GetFirstView(), axis = m_RotationAxis, center = this->GetCenter(), angles = this->GetFrameAngles()](
      SizeValueType frame) { return ShearWarp::ViewSpace(ShearWarpMIPView::Turn(first, axis, center, angles[frame])); }
  };
}

template <typename TInputImage, typename TOutputImage>
std::vector<double>
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::GetSettings() const
{
  std::vector<double> settings = Superclass::GetSettings();
  settings.insert(settings.end(),
                  { static_cast<double>(m_ListTime.GetMTime()),
                    static_cast<double>(m_NumberOfFrames),
                    m_StartAngle,
                    m_AngularRange,
                    static_cast<double>(m_Rocking),
                    static_cast<double>(m_IsCenterSet) });
  settings.insert(settings.end(), m_RotationAxis.Begin(), m_RotationAxis.End());
  settings.insert(settings.end(), m_Center.Begin(), m_Center.End());
  return settings;
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
  const ImageBase<2> *                    grid = this->GetViewGrid();
  const Size<2>                           size = grid->GetLargestPossibleRegion().GetSize();
  const SizeValueType                     frames = this->GetFrames();
  typename OutputImageType::SpacingType   spacing(1.0);
  typename OutputImageType::PointType     origin(0.0);
  typename OutputImageType::DirectionType direction;
  direction.SetIdentity();
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    spacing[axis] = grid->GetSpacing()[axis];
    origin[axis] = grid->GetOrigin()[axis];
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
  m_FitTime = this->GetMTime();
  Superclass::GenerateOutputInformation();
  std::vector<double> matrices;
  const auto          views = this->MakeViews();
  for (SizeValueType n = 0; n < views.count; ++n)
  {
    const auto [axes, offset] = views.get(n);
    for (unsigned int row = 0; row < 3; ++row)
    {
      matrices.insert(matrices.end(), { axes(row, 0), axes(row, 1), axes(row, 2), offset[row] });
    }
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
ShearWarpMIPCineImageFilter<TInputImage, TOutputImage>::GeneratePixels()
{
  Superclass::GeneratePixels();
  for (const TransformConstPointer & transform : m_Transforms)
  {
    this->RequireUnchanged(transform->GetMTime() <= m_FitTime);
  }
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
