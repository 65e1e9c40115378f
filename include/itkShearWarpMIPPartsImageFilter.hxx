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
#ifndef itkShearWarpMIPPartsImageFilter_hxx
#define itkShearWarpMIPPartsImageFilter_hxx

#include "itkMetaDataObject.h"

#include <iomanip>
#include <sstream>

namespace itk
{
template <typename TInputImage>
void
ShearWarpMIPPartsImageFilter<TInputImage>::VerifyPreconditions() const
{
  Superclass::VerifyPreconditions();
  if (!this->MakeRule().IsPlainMaximum() || this->GetNumberOfStreamDivisions() != 1)
  {
    itkExceptionMacro(
      "Parts have plain maxima: Mode, SlabNear, SlabFar, CropLower, CropUpper, MaskImage, LocalMaximum, "
      "DepthAttenuation, ComputeDepth, Exact and NumberOfStreamDivisions must be as by default.");
  }
}

template <typename TInputImage>
auto
ShearWarpMIPPartsImageFilter<TInputImage>::ProjectPart(const InputImageType * part) -> typename PartImageType::Pointer
{
  if (!part)
  {
    itkExceptionMacro("The part must not be null.");
  }
  this->VerifyPreconditions();
  const_cast<InputImageType *>(this->GetInput())->UpdateOutputInformation();
  this->VerifyInputInformation();
  ShearWarp::Scene scene;
  scene.volume = ShearWarp::MakeVolumeGrid(this->GetInput());
  scene.views = this->MakeViews();
  const auto   rule = this->MakeRule();
  const auto   voxels = Self::template MakeVoxels<InputPixelType>(part, this->GetInput()->GetLargestPossibleRegion());
  const double tolerance = 1e-6 * this->GetInput()->GetSpacing()[0];
  const auto   isEqual = [tolerance](const auto & a, const auto & b) {
    return a.GetVnlVector().is_equal(b.GetVnlVector(), tolerance);
  };
  if (!isEqual(part->GetSpacing(), this->GetInput()->GetSpacing()) ||
      !isEqual(part->GetOrigin(), this->GetInput()->GetOrigin()) ||
      !part->GetDirection().GetVnlMatrix().is_equal(this->GetInput()->GetDirection().GetVnlMatrix(), 1e-6))
  {
    itkExceptionMacro("A part must have the input's spacing "
                      << this->GetInput()->GetSpacing() << ", origin " << this->GetInput()->GetOrigin()
                      << " and direction, and its place as index, but its spacing is " << part->GetSpacing()
                      << ", its origin " << part->GetOrigin() << " and its direction\n"
                      << part->GetDirection());
  }
  const auto container = this->VerifyVoxels("part", part, part->GetBufferedRegion());

  auto projection = PartImageType::New();
  this->CallWithThreads([&](const ShearWarp::Threads & threads) {
    this->SetAbortGenerateData(false);
    const ShearWarp::IntermediateRegion place = Superclass::EngineType::FindPart(scene, rule, voxels.box);
    projection->SetRegions(
      { { { place.column, place.row } },
        { { static_cast<SizeValueType>(place.columns), static_cast<SizeValueType>(place.rows) } } });
    projection->Allocate();
    this->m_Engine.ProjectPart(scene, rule, voxels, projection->GetBufferPointer(), threads);
  });
  EncapsulateMetaData<std::string>(
    projection->GetMetaDataDictionary(), "IntermediateImage", DescribeIntermediateImage(scene, rule.oversampling));
  return projection;
}

template <typename TInputImage>
std::string
ShearWarpMIPPartsImageFilter<TInputImage>::DescribeIntermediateImage(const ShearWarp::Scene & scene,
                                                                     unsigned int             oversampling)
{
  const auto         factorization = ShearWarp::Factorize(scene.views.front(), scene.volume, oversampling);
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10) << "axes";
  for (const unsigned int axis : factorization.permutation)
  {
    text << ' ' << axis;
  }
  text << ", size";
  for (const std::ptrdiff_t length : factorization.size)
  {
    text << ' ' << length;
  }
  text << ", shear " << factorization.shear[0] << ' ' << factorization.shear[1] << ", oversampling " << oversampling;
  return text.str();
}

template <typename TInputImage>
ImageRegion<2>
ShearWarpMIPPartsImageFilter<TInputImage>::FindPlace(const PartImageType * projection)
{
  const ImageRegion<2> &            region = projection->GetBufferedRegion();
  typename PartImageType::PointType first;
  projection->TransformIndexToPhysicalPoint(region.GetIndex(), first);
  return { { { Math::Round<IndexValueType>(first[0]), Math::Round<IndexValueType>(first[1]) } }, region.GetSize() };
}

template <typename TInputImage>
void
ShearWarpMIPPartsImageFilter<TInputImage>::AddPart(const PartImageType * projection)
{
  if (!projection)
  {
    itkExceptionMacro("The projection of a part must not be null.");
  }
  this->VerifyVoxels("projection of a part", projection, projection->GetBufferedRegion());
  m_Parts.emplace_back(projection);
  this->Modified();
}

template <typename TInputImage>
void
ShearWarpMIPPartsImageFilter<TInputImage>::ClearParts()
{
  if (!m_Parts.empty())
  {
    m_Parts.clear();
    this->Modified();
  }
}

template <typename TInputImage>
ModifiedTimeType
ShearWarpMIPPartsImageFilter<TInputImage>::GetMTime() const
{
  ModifiedTimeType latest = Superclass::GetMTime();
  for (const auto & projection : m_Parts)
  {
    latest = std::max(latest, projection->GetMTime());
  }
  return latest;
}

template <typename TInputImage>
void
ShearWarpMIPPartsImageFilter<TInputImage>::GenerateInputRequestedRegion()
{
  auto * input = const_cast<TInputImage *>(this->GetInput());
  input->SetRequestedRegion({ input->GetLargestPossibleRegion().GetIndex(), { { 0, 0, 0 } } });
}

template <typename TInputImage>
void
ShearWarpMIPPartsImageFilter<TInputImage>::GeneratePixels()
{
  if (m_Parts.empty())
  {
    itkExceptionMacro("Parts are required but not added.");
  }
  const ShearWarp::Scene scene = this->GetScene();
  const auto             rule = this->GetRule();
  const auto             projections = m_Parts;
  this->CallWithThreads([&](const ShearWarp::Threads & threads) {
    const ShearWarp::IntermediateRegion whole =
      Superclass::EngineType::FindPart(scene, rule, ShearWarp::GetWholeBox(scene.volume));
    const ImageRegion<2> region(
      { { 0, 0 } }, { { static_cast<SizeValueType>(whole.columns), static_cast<SizeValueType>(whole.rows) } });
    std::vector<typename PartImageType::PixelContainerConstPointer> containers;
    std::vector<ShearWarp::IntermediatePart<InputPixelType>>        parts;
    const std::string intermediateImage = DescribeIntermediateImage(scene, rule.oversampling);
    for (const auto & projection : projections)
    {
      std::string own = intermediateImage;
      ExposeMetaData<std::string>(projection->GetMetaDataDictionary(), "IntermediateImage", own);
      if (own != intermediateImage)
      {
        itkExceptionMacro(
          "The projection of part "
          << parts.size() + 1
          << " must be of the filter's Transform, Oversampling and input geometry; see ClearParts(). It "
             "is of the intermediate image "
          << own << " instead of " << intermediateImage);
      }
      const ImageRegion<2> place = FindPlace(projection);
      if (!region.IsInside(place))
      {
        itkExceptionMacro("The projection of part " << parts.size() + 1 << " must lie within the intermediate image, "
                                                    << region << ", but its region is " << place);
      }
      containers.push_back(
        this->VerifyVoxels("projection of a part", projection.GetPointer(), projection->GetBufferedRegion()));
      parts.push_back({ projection->GetBufferPointer(),
                        { place.GetIndex(0),
                          place.GetIndex(1),
                          static_cast<std::ptrdiff_t>(place.GetSize(0)),
                          static_cast<std::ptrdiff_t>(place.GetSize(1)) } });
    }
    const auto size = this->GetPictureSize();
    const auto pixels = this->VerifyPixels(this->GetOutput(), size[0] * size[1]);
    this->m_Engine.WarpParts(scene, rule, parts, pixels->GetBufferPointer(), threads);
  });
}

template <typename TInputImage>
void
ShearWarpMIPPartsImageFilter<TInputImage>::PrintSelf(std::ostream & os, Indent indent) const
{
  Superclass::PrintSelf(os, indent);
  os << indent << "NumberOfParts: " << this->GetNumberOfParts() << std::endl;
}
} // namespace itk

#endif
