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
#ifndef itkShearWarpMIPMergePartsImageFilter_h
#define itkShearWarpMIPMergePartsImageFilter_h

#include "itkShearWarpMIPImageFilter.h"

namespace itk
{
/** \class ShearWarpMIPMergePartsImageFilter
 * \brief Makes the picture of a 3D image from projections of its parts.
 *
 * Parts are outputs of ShearWarpMIPPartImageFilter for the same image, Transform and Oversampling. If the parts
 * together cover the image, the picture has the same bits as the output of ShearWarpMIPImageFilter for the whole image.
 * The filter uses only the geometry of the input, and does not request its voxels. The output's geometry is known
 * before there are parts.
 *
 * The filter makes only plain maxima: Mode, SlabNear, SlabFar, CropLower, CropUpper, MaskImage, LocalMaximum,
 * DepthAttenuation, ComputeDepth and Exact must have their default values. Otherwise Update() throws ExceptionObject.
 * It also throws ExceptionObject if there is no part, if a part is missing or does not lie within the intermediate
 * image, and in the cases of ShearWarpMIPImageFilter.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 * \tparam TOutputImage An Image of the same pixel type, of dimension 2, or 3 for a slice in physical space.
 *
 * \ingroup ShearWarpMIP
 * \sa ShearWarpMIPPartImageFilter, ShearWarpMIPImageFilter
 */
template <typename TInputImage, typename TOutputImage = Image<typename TInputImage::PixelType, 2>>
class ITK_TEMPLATE_EXPORT ShearWarpMIPMergePartsImageFilter : public ShearWarpMIPImageFilter<TInputImage, TOutputImage>
{
public:
  ITK_DISALLOW_COPY_AND_MOVE(ShearWarpMIPMergePartsImageFilter);

  using Self = ShearWarpMIPMergePartsImageFilter;
  using Superclass = ShearWarpMIPImageFilter<TInputImage, TOutputImage>;
  using Pointer = SmartPointer<Self>;
  using ConstPointer = SmartPointer<const Self>;

  itkNewMacro(Self);
  itkOverrideGetNameOfClassMacro(ShearWarpMIPMergePartsImageFilter);

  using typename Superclass::InputPixelType;
  using PartImageType = Image<InputPixelType, 2>;

  /** Sets part number \a n, counted from 0. */
  void
  SetPart(unsigned int n, const PartImageType * part)
  {
    this->SetNthInput(n + 1, const_cast<PartImageType *>(part));
  }
  const PartImageType *
  GetPart(unsigned int n) const
  {
    return dynamic_cast<const PartImageType *>(this->ProcessObject::GetInput(n + 1));
  }
  unsigned int
  GetNumberOfParts() const
  {
    const auto inputs = static_cast<unsigned int>(this->GetNumberOfIndexedInputs());
    return inputs == 0 ? 0 : inputs - 1;
  }
  void
  ClearParts()
  {
    this->SetNumberOfIndexedInputs(1);
  }

protected:
  ShearWarpMIPMergePartsImageFilter() = default;
  ~ShearWarpMIPMergePartsImageFilter() override = default;

  void
  VerifyPreconditions() const override;

  void
  VerifyIndexedInputs() const override;

  void
  GenerateInputRequestedRegion() override;

  void
  GeneratePixels() override;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPMergePartsImageFilter.hxx"
#endif

#endif
