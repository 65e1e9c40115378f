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
#ifndef itkShearWarpMIPImageFilter_h
#define itkShearWarpMIPImageFilter_h

#include "itkDataObjectDecorator.h"
#include "itkShearWarpMIPBaseImageFilter.h"

namespace itk
{
/** \class ShearWarpMIPImageFilter
 * \brief Maximum intensity projection (MIP) of a 3D image from any direction.
 *
 * Pixel (u, v) of the 2D output is the maximum of the input I along the line of all w at T(u, v, w), where T is the
 * Transform parameter, from view space to the image's physical space (as in ResampleImageFilter, output to input):
 * \f[ MIP(u, v) = \max_w I(T(u, v, w)) \f]
 * The output's index axes point along u and v, its spacing and origin are in view space: mm, for a rigid
 * transform of an image in mm. Where the line misses the image the output is DefaultPixelValue; every other
 * value is one that the input's voxels bound.
 *
 * The method is shear-warp factorization: Fang et al., "Fast Maximum Intensity Projection Algorithm Using Shear Warp
 * Factorization and Reduced Resampling", Magn Reson Med 47:696-700, 2002. Each slice of the volume
 * across the principal viewing axis is interpolated bilinearly, with one set of weights, onto the grid of a
 * sheared intermediate image, in which the maximum is taken; the intermediate image is then interpolated
 * bilinearly at the output's pixels. Both interpolations are exactly defined (see itkShearWarpSampling.h), so that a
 * result does not depend on the machine or on the number of threads.
 *
 * The first view of an image reads it once. The second one finds the maxima of its cubes of eight voxels a side, for
 * reduced resampling; the second view along the image's x axis makes a transposed copy of the volume, of the input's
 * size. Both are kept until the input changes or ReleasePreparedVolume() is called: further views prepare nothing.
 * Memory is kept too for an intermediate image of each thread, until ReleasePreparedVolume().
 *
 * A ray's value can be another one of its samples (Mode, LocalMaximum), of fewer of them (SlabNear and SlabFar,
 * CropLower and CropUpper, MaskImage) or of faded ones (DepthAttenuation), and there can be a second output, of depths
 * (ComputeDepth). All of these can be combined. Then no part of the volume is skipped by reduced resampling. With
 * LocalMaximum rays are followed from front to back, and there is one intermediate image for all threads; so it is
 * with MaskImage, ComputeDepth or DepthAttenuation if an axis has more than 32766 voxels of 8 or 16 bits.
 *
 * By default the output's grid is fitted to the view. Its extent is the projected bounding box of the whole image;
 * its spacing is the image's smallest spacing, scaled as the transform scales the view plane's axes. Each of Size,
 * OutputSpacing and OutputOrigin that is set stays as it is and the others are fitted around it: a grid of given
 * Size is centered on the projected image, one of given OutputOrigin reaches to the far end of it.
 *
 * Infinite voxels make the samples around them infinite or not-a-number. Samples that are not a number never win, and a
 * pixel that meets no other sample, or only minus infinity (plus infinity, if Mode is Minimum), has DefaultPixelValue.
 *
 * Update() throws ExceptionObject for a transform that is missing, not linear, not finite or not invertible; for an
 * OutputSpacing that is not positive or not finite, an OutputOrigin that is not finite, a Size of zero; for an
 * Oversampling other than 1 and 2, NumberOfStreamDivisions of zero; for a SlabNear or CropLower that is greater than
 * SlabFar or CropUpper or not a number, a LocalMaximumThreshold that is not a number, a DepthAttenuation that is
 * negative or not finite, or a DefaultPixelValue that is not finite for samples to fade to; for a MaskImage on another
 * grid than the input's; for an input that is empty, has a spacing that is not positive, or was not put into memory by
 * its source; and for an output larger than the computer's memory. It throws MemoryAllocationError where memory runs
 * out. After an exception or an abort the filter is as usable as before.
 *
 * Filters may update in several threads at once if they share no data object, as ITK's pipeline changes the
 * requested region even of an input. They can share voxels: give each filter an image of its own, made by
 * Image::Graft(). They can share a transform that no one changes.
 *
 * The output can't be computed in pieces; any request enlarges to the whole output. The input is requested whole or,
 * with NumberOfStreamDivisions, slab by slab from a source that streams, and the mask likewise: then an image larger
 * than memory can be projected, and needs memory for a slab (twice for views along x) and for the intermediate images.
 * Parts of an image can also be projected apart from each other, wherever they are, by ShearWarpMIPPartImageFilter;
 * ShearWarpMIPMergePartsImageFilter makes the picture from them.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 * \tparam TOutputImage An Image of the same pixel type, of dimension 2, or of dimension 3: then the output is one slice
 * in the input's physical space, of the view plane's axes, in the middle of the depths that are projected and as thick
 * as their range (the image's in the view, or the slab's part of it). Size, OutputSpacing and OutputOrigin are those of
 * the view plane all the same.
 *
 * \ingroup ShearWarpMIP
 * \sa MaximumProjectionImageFilter, ResampleImageFilter, ShearWarpMIPView, ShearWarpMIPPartImageFilter
 */
template <typename TInputImage, typename TOutputImage = Image<typename TInputImage::PixelType, 2>>
class ITK_TEMPLATE_EXPORT ShearWarpMIPImageFilter : public ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>
{
public:
  ITK_DISALLOW_COPY_AND_MOVE(ShearWarpMIPImageFilter);

  using Self = ShearWarpMIPImageFilter;
  using Superclass = ShearWarpMIPBaseImageFilter<TInputImage, TOutputImage>;
  using Pointer = SmartPointer<Self>;
  using ConstPointer = SmartPointer<const Self>;

  itkNewMacro(Self);
  itkOverrideGetNameOfClassMacro(ShearWarpMIPImageFilter);

  using Superclass::OutputImageDimension;
  using OutputImageType = TOutputImage;
  using OutputIndexType = typename OutputImageType::IndexType;
  using typename Superclass::DepthImageType;
  using typename Superclass::InputPixelType;
  using typename Superclass::PhysicalPointType;
  using typename Superclass::SizeType;
  using typename Superclass::TransformConstPointer;
  using typename Superclass::TransformType;
  using DecoratedTransformType = DataObjectDecorator<TransformType>;

  /** View space to the image's physical space; identity by default. Must be linear and invertible. A transform that
   * is changed in place takes effect at the next Update(). */
  itkSetGetDecoratedObjectInputMacro(Transform, TransformType);

  /** The physical point of the value of an output pixel, by the Depth output of the last update. Throws ExceptionObject
   * if there is none, if the index is outside of it, or if the pixel has no value. */
  PhysicalPointType
  GetPhysicalPoint(const OutputIndexType & index) const;

protected:
  ShearWarpMIPImageFilter();
  ~ShearWarpMIPImageFilter() override = default;

  void
  VerifyPreconditions() const override;

  void
  GeneratePixels() override;

  typename Superclass::ViewList
  MakeViews() const override;

  /** Gives an output the grid in view space or, if it has three dimensions, in physical space: one slice in the middle
   * of the depths that are projected, as thick as they reach. */
  void
  SetGeometry(ImageBase<OutputImageDimension> * output) const override;

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

private:
  ShearWarp::PictureSpace m_PictureSpace; // of the last update
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPImageFilter.hxx"
#endif

#endif
