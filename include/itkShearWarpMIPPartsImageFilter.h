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
#ifndef itkShearWarpMIPPartsImageFilter_h
#define itkShearWarpMIPPartsImageFilter_h

#include "itkShearWarpMIPImageFilter.h"

namespace itk
{
/** \class ShearWarpMIPPartsImageFilter
 * \brief Maximum intensity projection (MIP) of a 3D image from parts that are projected independently.
 *
 * With this filter, an image that is too large for one memory, or that lies in pieces on many computers, is projected
 * part by part, and only small 2D images move between computers.
 *
 * The input is the whole image: the filter uses only its geometry, and does not request its voxels. ProjectPart() on
 * any computer makes the projection of a part. AddPart() takes the projections of all parts, in any order, and Update()
 * makes the picture. It has the same bits as the output of ShearWarpMIPImageFilter for the whole image.
 *
 * A projection belongs to one Transform, Oversampling and input geometry: call ClearParts() before another view. The
 * output's grid may change. Update() does not notice a part that is missing: pixels without samples have the pixel
 * type's lowest value. Update() needs memory for the intermediate image of the whole input, about as many pixels as the
 * input's two largest faces.
 *
 * The filter makes only plain maxima: Mode, SlabNear, SlabFar, CropLower, CropUpper, MaskImage, LocalMaximum,
 * DepthAttenuation, ComputeDepth, Exact and NumberOfStreamDivisions must have their default values. Otherwise Update()
 * and ProjectPart() throw ExceptionObject. Update() also throws ExceptionObject if there is no part, and in the cases
 * of ShearWarpMIPImageFilter.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 *
 * \ingroup ShearWarpMIP
 * \sa ShearWarpMIPImageFilter
 */
template <typename TInputImage>
class ITK_TEMPLATE_EXPORT ShearWarpMIPPartsImageFilter : public ShearWarpMIPImageFilter<TInputImage>
{
public:
  ITK_DISALLOW_COPY_AND_MOVE(ShearWarpMIPPartsImageFilter);

  using Self = ShearWarpMIPPartsImageFilter;
  using Superclass = ShearWarpMIPImageFilter<TInputImage>;
  using Pointer = SmartPointer<Self>;
  using ConstPointer = SmartPointer<const Self>;

  itkNewMacro(Self);
  itkOverrideGetNameOfClassMacro(ShearWarpMIPPartsImageFilter);

  using InputImageType = TInputImage;
  using typename Superclass::InputPixelType;
  /** The projection of a part: a rectangle of the intermediate image of the whole image. */
  using PartImageType = Image<InputPixelType, 2>;

  /** Returns the projection of a part of the input: of the buffered region of \a part, an image with the input's
   * geometry, as made by ExtractImageFilter. Samples lie between voxels, so neighbouring parts must have at least one
   * voxel in common along each axis; otherwise the samples between the parts are missing, without an error. The rules
   * for the edge of the volume apply only to the edges of the input.
   *
   * The index of the projection's region is its place in the intermediate image of the whole image. A file format
   * stores the index as origin: AddPart() takes both. The entry "IntermediateImage" of the meta data dictionary names
   * the intermediate image. Its size is at most
   * (c + s, r + s) Oversampling pixels for a part of c columns, r rows and s slices in the view's order of axes. A
   * pixel without a sample of the part has the pixel type's lowest value, or minus infinity. Spacing is 1 and origin 0.
   * The method reports progress by ProgressEvent, and AbortGenerateData ends it with ProcessAborted. Each thread needs
   * a filter of its own.
   *
   * The first view of a part prepares the part, as the second view of ShearWarpMIPImageFilter does. The filter keeps
   * this preparation until it gets another part. If a part has only one view, set ReducedResampling to Off: the
   * projection is then faster, and needs little memory beside a large part.
   *
   * Throws ExceptionObject if there is no input, if the part is null, empty, not within the input, has another
   * geometry or fewer voxels than its buffered region, and for parameters as Update(). Throws MemoryAllocationError if
   * memory runs out. */
  typename PartImageType::Pointer
  ProjectPart(const InputImageType * part);

  /** Adds the projection of a part to the picture, as ProjectPart() made it or as a file has it that keeps the origin
   * (MetaImage, NRRD, NIfTI). The filter keeps the projection until ClearParts(). Throws ExceptionObject if the
   * projection is null or not in memory. Update() throws ExceptionObject if the projection is of another intermediate
   * image or does not lie within it. */
  void
  AddPart(const PartImageType * projection);

  /** Returns the number of projections that were added. */
  SizeValueType
  GetNumberOfParts() const
  {
    return m_Parts.size();
  }

  /** Removes the projections that were added. */
  void
  ClearParts();

  /** Also counts changes of the projections. */
  ModifiedTimeType
  GetMTime() const override;

protected:
  ShearWarpMIPPartsImageFilter() = default;
  ~ShearWarpMIPPartsImageFilter() override = default;

  void
  VerifyPreconditions() const override;

  void
  GenerateInputRequestedRegion() override;

  void
  GeneratePixels() override;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

private:
  /** Names the intermediate image of the view, as its factorization does. */
  static std::string
  DescribeIntermediateImage(const ShearWarp::Scene & scene, unsigned int oversampling);

  /** Returns the region of the intermediate image that a projection is. */
  static ImageRegion<2>
  FindPlace(const PartImageType * projection);

  std::vector<typename PartImageType::ConstPointer> m_Parts;
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPPartsImageFilter.hxx"
#endif

#endif
