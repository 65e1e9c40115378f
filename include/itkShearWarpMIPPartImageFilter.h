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
#ifndef itkShearWarpMIPPartImageFilter_h
#define itkShearWarpMIPPartImageFilter_h

#include "itkDataObjectDecorator.h"
#include "itkShearWarpBaseImageFilter.h"

namespace itk
{
/** \class ShearWarpMIPPartImageFilter
 * \brief Projects a part of a 3D image to its place in the intermediate image of the whole.
 *
 * With this filter, an image that is too large for one memory, or that lies in pieces on many computers, is projected
 * piece by piece, and only small 2D images move between computers. ShearWarpMIPMergePartsImageFilter makes the picture
 * from these, with the same bits as the whole image gives at once.
 *
 * A part is an image with the geometry of the whole image and a piece of WholeRegion, as made by ExtractImageFilter. It
 * can also be the buffered region of an image whose source can give more. Samples lie between voxels, so neighbouring
 * parts must have one voxel in common along each axis. The rules for the edge of the volume apply only to the edges of
 * the whole image.
 *
 * The output is a piece of the intermediate image of the whole image. The index of its region is the place of the part
 * there. Its size is at most (c + s, r + s) Oversampling pixels for a part of c columns, r rows and s slices in the
 * view's order of axes. A pixel without a sample of the part has the pixel type's lowest value, or minus infinity.
 * Spacing is 1 and origin 0.
 *
 * The first view of a part prepares it, as the second view of ShearWarpMIPImageFilter does. The filter keeps this
 * preparation until the part changes. If a part has only one view, set ReducedResampling to Off: the projection is then
 * faster. The filter finds no block maxima, and for a view along x it transposes one slab after the other: 2 MiB for
 * each thread, or 16 slices if these are larger. So it needs little memory beside a large part. It keeps this memory
 * and the intermediate images until ReleasePreparedVolume().
 *
 * Update() throws ExceptionObject for a transform that is missing, not linear, not finite or not invertible, for an
 * Oversampling other than 1 and 2, and for an input that is empty, is not within WholeRegion, has a spacing that is not
 * positive, or fewer voxels than its buffered region. It throws MemoryAllocationError where memory runs out.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 *
 * \ingroup ShearWarpMIP
 * \sa ShearWarpMIPMergePartsImageFilter
 */
template <typename TInputImage>
class ITK_TEMPLATE_EXPORT ShearWarpMIPPartImageFilter
  : public ShearWarpBaseImageFilter<TInputImage, Image<typename TInputImage::PixelType, 2>>
{
public:
  ITK_DISALLOW_COPY_AND_MOVE(ShearWarpMIPPartImageFilter);

  using Self = ShearWarpMIPPartImageFilter;
  using OutputImageType = Image<typename TInputImage::PixelType, 2>;
  using Superclass = ShearWarpBaseImageFilter<TInputImage, OutputImageType>;
  using Pointer = SmartPointer<Self>;
  using ConstPointer = SmartPointer<const Self>;

  itkNewMacro(Self);
  itkOverrideGetNameOfClassMacro(ShearWarpMIPPartImageFilter);

  using InputImageType = TInputImage;
  using typename Superclass::InputPixelType;
  using typename Superclass::TransformType;
  using DecoratedTransformType = DataObjectDecorator<TransformType>;
  using RegionType = ImageRegion<3>;

  /** The transform from view space to the image's physical space; identity by default. It must be linear and
   * invertible. */
  itkSetGetDecoratedObjectInputMacro(Transform, TransformType);

  /** The region of the whole image; by default, and if it has no size, the input's largest possible region. Set it for
   * an image without a source, because ITK takes the buffered region of such an image for the largest possible one. */
  void
  SetWholeRegion(const RegionType & region);
  itkGetConstReferenceMacro(WholeRegion, RegionType);

protected:
  ShearWarpMIPPartImageFilter();
  ~ShearWarpMIPPartImageFilter() override = default;

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

  using typename Superclass::State;

  State
  GetState() override;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

private:
  /** Return the regions of the whole and of the part that are projected. */
  RegionType
  GetWhole() const;
  RegionType
  GetPart() const;

  ShearWarpFactorization
  FactorizePart() const;

  RegionType m_WholeRegion;
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPPartImageFilter.hxx"
#endif

#endif
