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
namespace ShearWarp
{
/** Returns the physical point of a column, row and depth of a picture. Throws ExceptionObject if the depth is not
 * finite, as where no ray has a value. */
ShearWarpMIP_EXPORT Point<double, 3>
                    TransformPixel(const AffineMap3D & pictureSpace, double column, double row, double depth);
} // namespace ShearWarp

/** \class ShearWarpMIPImageFilter
 * \brief Maximum intensity projection (MIP) of a 3D image from any direction.
 *
 * Pixel (u, v) of the 2D output is the maximum of the input I along the line of all w at T(u, v, w). T is the Transform
 * parameter, which maps view space to the image's physical space (as in ResampleImageFilter, output to input):
 * \f[ MIP(u, v) = \max_w I(T(u, v, w)) \f]
 * The output's index axes point along u and v. Its spacing and origin are in units of view space: mm, for a rigid
 * transform of an image in mm. If the line misses the image, the output is DefaultPixelValue. All other output values
 * lie within the range of the input's voxels or, if they fade, between this range and DefaultPixelValue.
 *
 * The method is shear-warp factorization: Fang et al., "Fast Maximum Intensity Projection Algorithm Using Shear Warp
 * Factorization and Reduced Resampling", Magn Reson Med 47:696-700, 2002. The filter takes the slices of the volume
 * across the principal viewing axis. It interpolates each slice bilinearly, with one set of weights, onto the grid of a
 * sheared intermediate image, which collects the maxima. It then interpolates the intermediate image bilinearly at the
 * output's pixels. Both interpolations are exactly defined (see itkShearWarpSampling.h), so the result does not depend
 * on the machine or on the number of threads.
 *
 * The first view of an image prepares nothing. The second view finds the maxima of cubes of eight voxels a side, for
 * reduced resampling. The second view along the image's x axis makes a transposed copy of the volume. The filter keeps
 * both until the input changes or ReleasePreparedVolume() is called, so later views prepare nothing. It also keeps the
 * memory of an intermediate image for each thread, until ReleasePreparedVolume().
 *
 * Mode and LocalMaximum select another sample of a ray than the maximum, or the mean of all. Interpolation Nearest is
 * for labels. SlabNear, SlabFar, CropLower, CropUpper and
 * MaskImage leave out samples, and DepthAttenuation fades samples. ComputeDepth adds a second output with depths. All
 * these parameters can be combined, except for what Update() refuses, see below. Reduced resampling then skips no part
 * of the volume. With LocalMaximum, the filter follows rays from front to back, and all threads share one intermediate
 * image. It does the same for MaskImage, ComputeDepth and DepthAttenuation if an axis has more than 32766 voxels of 8
 * or 16 bits.
 *
 * By default the output's grid is fitted to the view. Its extent is the projected bounding box of the whole image. Its
 * spacing is the image's smallest spacing, scaled as the transform scales the view plane's axes. If an axis of the
 * image lies along an axis of the output, spacings that differ by less than a thousandth count as equal there: each
 * column or row of voxels has its own pixels. If you set Size, OutputSpacing or OutputOrigin, the filter fits only the
 * others: a grid with a given Size is centered on the projected image, and a grid with a given OutputOrigin reaches to
 * the far end of the projected image.
 *
 * Infinite voxels make the samples around them infinite or not-a-number. The filter ignores samples that are
 * not-a-number. If Mode is Maximum, it also ignores minus infinity; if Mode is Minimum, plus infinity. A pixel without
 * any other sample has DefaultPixelValue. A mean with an infinite sample is infinite, and a pixel whose samples have
 * both infinities has DefaultPixelValue.
 *
 * Update() throws ExceptionObject for
 * - a transform that is missing, not linear, not finite or not invertible
 * - an OutputSpacing that is not positive or not finite, an OutputOrigin that is not finite, or a Size of zero
 * - an Oversampling other than 1 and 2, or a NumberOfStreamDivisions of zero
 * - a SlabNear greater than SlabFar, a CropLower greater than CropUpper, or one of these bounds that is not a number
 * - a SlabNear of infinity or a SlabFar of minus infinity
 * - a LocalMaximumThreshold that is not a number, with LocalMaximum
 * - LocalMaximum with the Mode AbsoluteMaximum or Mean; ComputeDepth or Exact with the Mode Mean
 * - the Interpolation Nearest with the Mode Mean, DepthAttenuation or Oversampling
 * - the Mode Mean for pixels of 8 or 16 bits if an axis has more than 65536 voxels
 * - a DepthAttenuation that is negative or not finite, or not zero while DefaultPixelValue is not finite
 * - Exact together with a parameter that it excludes
 * - a MaskImage that is not on the input's grid
 * - an input that is empty, has a spacing that is not positive or not finite or an origin that is not finite, or was
 *   not put into memory by its source
 * - an output larger than the computer's memory
 *
 * Update() throws MemoryAllocationError if memory runs out. The filter can be used again after an exception or an
 * abort. If the exception is of a source of its inputs, call ResetPipeline() first, as for every filter of ITK:
 * otherwise Update() does nothing.
 *
 * Several filters may update in different threads at once if they share no data object, because ITK's pipeline changes
 * even the requested region of an input. They can share voxels if each filter has its own image, made by
 * Image::Graft(). They can also share a transform, if nobody changes it.
 *
 * The filter always computes the whole output. It requests the whole input, or one division after the other with
 * NumberOfStreamDivisions from a source that streams, and the mask in the same way. So it can project an image larger
 * than memory. It then needs memory for a division (twice for views along x), for the intermediate images and, with
 * Exact, for 4 to 16 bytes of each output pixel.
 * ShearWarpMIPPartsImageFilter can also project parts of an image independently, on any computer, and make the picture
 * from them.
 *
 * \tparam TInputImage An Image of dimension 3 of any arithmetic pixel type but bool and long double.
 * \tparam TOutputImage An Image of the same pixel type, of dimension 2 or 3. With dimension 3, the output is one slice
 * in the input's physical space, with the view plane's axes. The slice lies in the middle of the projected depths, and
 * is as thick as their range: the range of the image in the view, or the slab's part of this range. Size, OutputSpacing
 * and OutputOrigin still define the grid in the view plane.
 *
 * \ingroup ShearWarpMIP
 * \sa MaximumProjectionImageFilter, ResampleImageFilter, ShearWarpMIPView, ShearWarpMIPPartsImageFilter
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

  /** The transform from view space to the image's physical space; identity by default. It must be linear and
   * invertible. If you change it in place, the change takes effect at the next Update(). ITK's CompositeTransform does
   * not notice that a transform in it changes: call its Modified() then. */
  itkSetGetDecoratedObjectInputMacro(Transform, TransformType);

  /** Returns the physical point of the value of an output pixel, by the Depth output of the last update. Throws
   * ExceptionObject if there is no Depth output, if the index is outside of it, or if the pixel has no value. */
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

  /** Keeps what GetPhysicalPoint() needs of an update, whatever is set afterwards. */
  void
  KeepPictureSpace()
  {
    m_PictureSpace = ShearWarp::MakePictureSpace(this->GetScene().views.front(), this->GetScene().picture);
  }

  void
  PrintSelf(std::ostream & os, Indent indent) const override;

private:
  ShearWarp::AffineMap3D m_PictureSpace{}; // of the last update
};
} // namespace itk

#ifndef ITK_MANUAL_INSTANTIATION
#  include "itkShearWarpMIPImageFilter.hxx"
#endif

#endif
