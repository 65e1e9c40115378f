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
 * part by part, and only small images move between computers.
 *
 * The input is the whole image: the filter uses only its geometry, and does not request its voxels. ProjectPart() on
 * any computer makes the projection of a part. AddPart() takes the projections of all parts, in any order, and Update()
 * makes the picture. It has the same bits as the output of ShearWarpMIPImageFilter for the whole image. MergeParts()
 * makes one projection of many, so that computers can merge theirs in a tree.
 *
 * A projection belongs to one set of parameters and one input geometry: call ClearParts() before another view. The
 * output's grid may change unless Exact is on. Update() does not notice a part that is missing. Update() needs memory
 * for the intermediate image of the whole input, about as many pixels as the input's two largest faces.
 *
 * MaskImage, LocalMaximum, DepthAttenuation and NumberOfStreamDivisions must have their default values. Mode Mean needs
 * pixels that are integers: sums of floating-point pixels depend on the order of samples. Otherwise Update(),
 * ProjectPart() and MergeParts() throw ExceptionObject. Update() also throws ExceptionObject if there is no part, and
 * in the cases of ShearWarpMIPImageFilter.
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
  /** The projection of a part: a record for each pixel of a rectangle of the intermediate image of the whole image or,
   * with Exact, of the picture. The first axis is the bytes of a record, and the others are columns and rows. Only this
   * filter reads records. */
  using PartImageType = Image<unsigned char, 3>;

  /** Returns the projection of a part of the input: of the buffered region of \a part, an image with the input's
   * geometry, as made by ExtractImageFilter. Samples lie between voxels, so neighbouring parts must have at least one
   * voxel in common along each axis; otherwise the samples between the parts are missing, without an error. With Mode
   * Mean, they must have exactly one in common: samples in the first slice, row or column of a part belong to the part
   * before it, and a part that is one voxel thick has none. The rules for the edge of the volume apply only to the
   * edges of the input.
   *
   * The index of the projection's region is its place: column and row. A file format stores the index as origin:
   * AddPart() takes both. The entry "IntermediateImage" of the meta data dictionary names what the projection is of. A
   * projection has at most (c + s, r + s) Oversampling pixels for a part of c columns, r rows and s slices in the
   * view's order of axes. A record has the bytes of one pixel and, where a pixel may have no value or a depth, 4 bytes
   * more. In a mean, it has 8 bytes, or 12 for pixels of 4 bytes and 20 for pixels of 8 bytes; with Exact 4 bytes, or 8
   * for pixels of 4 and 8 bytes, and 8 more for a depth. Spacing is 1 and origin 0. The method reports progress by
   * ProgressEvent, and AbortGenerateData ends it with ProcessAborted. Each thread needs a filter of its own.
   *
   * The first view of a part prepares the part for plain maxima and Exact, as the second view of
   * ShearWarpMIPImageFilter does. The filter keeps this preparation until it gets another part. If a part has only one
   * view, set ReducedResampling to Off: a plain maximum is then faster, and needs little memory beside a large part.
   *
   * Throws ExceptionObject if there is no input, if the part is null, empty, not within the input, has another
   * geometry or fewer voxels than its buffered region, and for parameters as Update(). Throws MemoryAllocationError if
   * memory runs out. */
  PartImageType::Pointer
  ProjectPart(const InputImageType * part);

  /** Adds the projection of a part to the picture, as ProjectPart() or MergeParts() made it, or as a file has it that
   * keeps the origin (MetaImage, NRRD, NIfTI). The filter keeps the projection until ClearParts(). Throws
   * ExceptionObject if the projection is null or not in memory. Update() and MergeParts() throw ExceptionObject if the
   * projection is of another intermediate image or does not lie within it. */
  void
  AddPart(const PartImageType * projection);

  /** Returns one projection that stands for all that were added, with the extent of all of them. Throws
   * ExceptionObject as Update(), and MemoryAllocationError if memory runs out. */
  PartImageType::Pointer
  MergeParts();

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
  using typename Superclass::RuleType;
  using PartType = ShearWarp::IntermediatePart;

  /** The records of all projections. The containers keep them in memory. */
  struct PartList
  {
    std::vector<PartImageType::PixelContainerConstPointer> containers;
    std::vector<PartType>                                  parts;
  };

  /** Names the intermediate image of the view, and what its pixels are. */
  static std::string
  DescribeIntermediateImage(const ShearWarp::Scene & scene, const RuleType & rule);

  /** Makes an image of records without values. */
  static PartImageType::Pointer
  MakeProjection(const ShearWarp::Scene & scene, const RuleType & rule, const ShearWarp::IntermediateRegion & place);

  /** Returns the rectangle that a projection is. */
  static ShearWarp::IntermediateRegion
  FindPlace(const PartImageType * projection);

  /** Verifies the projections that were added. */
  PartList
  VerifyParts(const ShearWarp::Scene & scene, const RuleType & rule) const;

  std::vector<PartImageType::ConstPointer> m_Parts;
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPPartsImageFilter.hxx"
#endif

#endif
