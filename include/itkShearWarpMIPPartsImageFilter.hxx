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
  ShearWarp::CallEngine([this] { this->MakeRule().VerifyForParts(); });
  if (this->GetNumberOfStreamDivisions() != 1)
  {
    itkExceptionMacro("Parts have no NumberOfStreamDivisions, but it is " << this->GetNumberOfStreamDivisions() << '.');
  }
}

template <typename TInputImage>
auto
ShearWarpMIPPartsImageFilter<TInputImage>::ProjectPart(const InputImageType * part) -> PartImageType::Pointer
{
  if (!part)
  {
    itkExceptionMacro("The part must not be null.");
  }
  this->UpdateOutputInformation();
  const ShearWarp::Scene scene = this->GetScene();
  const RuleType         rule = this->GetRule();
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

  PartImageType::Pointer projection;
  this->CallWithThreads([&](const ShearWarp::Threads & threads) {
    this->SetAbortGenerateData(false);
    projection = MakeProjection(scene, rule, Superclass::EngineType::FindPart(scene, rule, voxels.box));
    this->m_Engine.ProjectPart(scene, rule, voxels, projection->GetBufferPointer(), threads);
  });
  return projection;
}

template <typename TInputImage>
auto
ShearWarpMIPPartsImageFilter<TInputImage>::MakeProjection(const ShearWarp::Scene &              scene,
                                                          const RuleType &                      rule,
                                                          const ShearWarp::IntermediateRegion & place)
  -> PartImageType::Pointer
{
  auto projection = PartImageType::New();
  projection->SetRegions({ { { 0, place.column, place.row } },
                           { { static_cast<SizeValueType>(Superclass::EngineType::GetRecordSize(rule)),
                               static_cast<SizeValueType>(place.columns),
                               static_cast<SizeValueType>(place.rows) } } });
  projection->Allocate();
  EncapsulateMetaData<std::string>(
    projection->GetMetaDataDictionary(), "IntermediateImage", DescribeIntermediateImage(scene, rule));
  return projection;
}

template <typename TInputImage>
auto
ShearWarpMIPPartsImageFilter<TInputImage>::MergeParts() -> PartImageType::Pointer
{
  this->UpdateOutputInformation();
  const ShearWarp::Scene scene = this->GetScene();
  const RuleType         rule = this->GetRule();
  PartImageType::Pointer projection;
  this->CallWithThreads([&](const ShearWarp::Threads & threads) {
    this->SetAbortGenerateData(false);
    const PartList                list = this->VerifyParts(scene, rule);
    ShearWarp::IntermediateRegion all = list.parts.front().region;
    for (const auto & [records, place] : list.parts)
    {
      const std::ptrdiff_t columnEnd = std::max(all.column + all.columns, place.column + place.columns);
      const std::ptrdiff_t rowEnd = std::max(all.row + all.rows, place.row + place.rows);
      all.column = std::min(all.column, place.column);
      all.row = std::min(all.row, place.row);
      all.columns = columnEnd - all.column;
      all.rows = rowEnd - all.row;
    }
    projection = MakeProjection(scene, rule, all);
    Superclass::EngineType::MergeParts(rule, list.parts, all, projection->GetBufferPointer(), threads);
  });
  return projection;
}

template <typename TInputImage>
std::string
ShearWarpMIPPartsImageFilter<TInputImage>::DescribeIntermediateImage(const ShearWarp::Scene & scene,
                                                                     const RuleType &         rule)
{
  const auto         factorization = ShearWarp::Factorize(scene.views.front(), scene.volume, rule.oversampling);
  std::ostringstream text;
  const auto         write = [&text](const auto & numbers) {
    for (const auto number : numbers)
    {
      text << ' ' << number;
    }
  };
  text << std::setprecision(std::numeric_limits<double>::max_digits10) << "axes";
  write(factorization.permutation);
  text << ", size";
  write(factorization.size);
  text << ", shear " << factorization.shear[0] << ' ' << factorization.shear[1] << ", oversampling "
       << rule.oversampling << ", "
       << (std::is_floating_point_v<InputPixelType> ? "float"
           : std::is_signed_v<InputPixelType>       ? "int"
                                                    : "uint")
       << 8 * sizeof(InputPixelType);
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
  text << ", big endian";
#endif
  if (rule.mode != ShearWarp::Mode::Maximum || rule.interpolation != ShearWarp::Interpolation::Linear)
  {
    text << ", " << rule.mode << ", " << rule.interpolation;
  }
  if (rule.HasRegion() || rule.NeedsRanks())
  {
    text << (rule.hasDepth ? ", depth" : "") << ", slab " << rule.slabNear << ' ' << rule.slabFar << ", crop";
    write(rule.cropLower);
    write(rule.cropUpper);
    text << ", view and volume";
    for (const ShearWarp::AffineMap3D & map : { scene.views.front(), scene.volume.indexToPhysical })
    {
      for (const auto & row : map.matrix)
      {
        write(row);
      }
      write(map.offset);
    }
  }
  if (rule.isExact)
  {
    text << ", exact, grid";
    write(scene.picture.size);
    write(scene.picture.spacing);
    write(scene.picture.origin);
  }
  return text.str();
}

template <typename TInputImage>
ShearWarp::IntermediateRegion
ShearWarpMIPPartsImageFilter<TInputImage>::FindPlace(const PartImageType * projection)
{
  const auto &             region = projection->GetBufferedRegion();
  PartImageType::PointType first;
  projection->TransformIndexToPhysicalPoint(region.GetIndex(), first);
  return { Math::Round<std::ptrdiff_t>(first[1]),
           Math::Round<std::ptrdiff_t>(first[2]),
           static_cast<std::ptrdiff_t>(region.GetSize(1)),
           static_cast<std::ptrdiff_t>(region.GetSize(2)) };
}

template <typename TInputImage>
auto
ShearWarpMIPPartsImageFilter<TInputImage>::VerifyParts(const ShearWarp::Scene & scene, const RuleType & rule) const
  -> PartList
{
  if (m_Parts.empty())
  {
    itkExceptionMacro("Parts are required but not added.");
  }
  const auto        whole = Superclass::EngineType::FindPart(scene, rule, ShearWarp::GetWholeBox(scene.volume));
  const std::string intermediateImage = DescribeIntermediateImage(scene, rule);
  const auto        recordSize = static_cast<SizeValueType>(Superclass::EngineType::GetRecordSize(rule));
  PartList          list;
  for (const auto & projection : m_Parts)
  {
    const SizeValueType number = list.parts.size() + 1;
    std::string         own = intermediateImage;
    ExposeMetaData<std::string>(projection->GetMetaDataDictionary(), "IntermediateImage", own);
    if (own != intermediateImage)
    {
      itkExceptionMacro("The projection of part "
                        << number
                        << " must be of the filter's parameters and input geometry; see ClearParts(). It "
                           "is of the intermediate image "
                        << own << " instead of " << intermediateImage);
    }
    const auto & region = projection->GetBufferedRegion();
    const auto   place = FindPlace(projection);
    if (place.column < 0 || place.row < 0 || place.column > whole.columns - place.columns ||
        place.row > whole.rows - place.rows || region.GetSize(0) != recordSize)
    {
      itkExceptionMacro("The projection of part "
                        << number << " must lie within the intermediate image of " << whole.columns << " x "
                        << whole.rows << " pixels, with " << recordSize << " bytes each, but it begins at column "
                        << place.column << " and row " << place.row << " and its region is " << region);
    }
    list.containers.push_back(this->VerifyVoxels("projection of a part", projection.GetPointer(), region));
    list.parts.push_back({ projection->GetBufferPointer(), place });
  }
  return list;
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
  this->KeepPictureSpace();
  const ShearWarp::Scene scene = this->GetScene();
  const RuleType         rule = this->GetRule();
  this->CallWithThreads([&](const ShearWarp::Threads & threads) {
    const PartList list = this->VerifyParts(scene, rule);
    const auto     size = this->GetPictureSize();
    const auto     pixels = this->VerifyPixels(this->GetOutput(), size[0] * size[1]);
    typename Superclass::DepthImageType::PixelContainerPointer depths;
    auto                                                       picture = Self::MakePicture(pixels->GetBufferPointer());
    if (rule.hasDepth)
    {
      const typename Superclass::DepthImageType::Pointer output = this->GetDepthOutput();
      if (output.IsNull())
      {
        itkExceptionMacro("Inputs and outputs must not change during an update.");
      }
      depths = this->VerifyPixels(output.GetPointer(), size[0] * size[1]);
      picture.depths = depths->GetBufferPointer();
    }
    this->m_Engine.WarpParts(scene, rule, list.parts, picture, threads);
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
