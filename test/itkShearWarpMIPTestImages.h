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
#ifndef itkShearWarpMIPTestImages_h
#define itkShearWarpMIPTestImages_h

#include "itkAffineTransform.h"
#include "itkImage.h"
#include "itkImageRegionIterator.h"
#include "itkImageRegionIteratorWithIndex.h"
#include "itkIndexRange.h"
#include "itkMatrix.h"
#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPTestRule.h"

#include <gtest/gtest.h>

#include <functional>
#include <sstream>
#include <utility>

/** Random images and views; what images have in common. */
namespace itk::ShearWarpMIPTest
{
using MatrixType = Matrix<double, 3, 3>;
using PointType = Point<double, 3>;
using ViewBaseType = MatrixOffsetTransformBase<double, 3, 3>;
using ViewType = AffineTransform<double, 3>;

/** The given pixel types, or in brief builds four of them. */
#ifdef SHEARWARPMIP_TEST_BRIEFLY
template <typename...>
using TestedTypes = testing::Types<unsigned char, unsigned short, short, float>;
#else
template <typename... TPixels>
using TestedTypes = testing::Types<TPixels...>;
#endif

inline PointType
MakePoint3(double x, double y, double z)
{
  const double components[] = { x, y, z };
  return PointType(components);
}

inline Vector<double, 3>
MakeVector3(double x, double y, double z)
{
  const double components[] = { x, y, z };
  return Vector<double, 3>(components);
}

inline Vector<double, 2>
MakeVector2(double x, double y)
{
  const double components[] = { x, y };
  return Vector<double, 2>(components);
}

inline Point<double, 2>
MakePoint2(double x, double y)
{
  const double components[] = { x, y };
  return Point<double, 2>(components);
}

inline MatrixType
MakeMatrix(const double (&rows)[3][3])
{
  return MatrixType(vnl_matrix_fixed<double, 3, 3>(&rows[0][0]));
}

inline MatrixType
MakeDiagonal(double x, double y, double z)
{
  return MakeMatrix({ { x, 0, 0 }, { 0, y, 0 }, { 0, 0, z } });
}

/** Looks along \a axis of an image whose direction is the identity; the other axes keep their order. */
inline MatrixType
MakeAxisMatrix(unsigned int axis)
{
  MatrixType matrix;
  matrix(axis == 0 ? 1 : 0, 0) = 1.0;
  matrix(axis == 2 ? 1 : 2, 1) = 1.0;
  matrix(axis, 2) = 1.0;
  return matrix;
}

/** Each component is within \a limit of 0. */
inline Vector<double, 3>
DrawVector(Random & random, double limit)
{
  const double x = random.Uniform(-limit, limit);
  const double y = random.Uniform(-limit, limit);
  return MakeVector3(x, y, random.Uniform(-limit, limit));
}

/** Uniformly distributed over all rotations: of a random unit quaternion. */
inline MatrixType
MakeRandomRotation(Random & random)
{
  double a, b, c, d, squaredNorm;
  do
  {
    a = random.Uniform(-1, 1);
    b = random.Uniform(-1, 1);
    c = random.Uniform(-1, 1);
    d = random.Uniform(-1, 1);
    squaredNorm = a * a + b * b + c * c + d * d;
  } while (squaredNorm > 1.0 || squaredNorm < 0.01);
  const double s = 2.0 / squaredNorm;
  return MakeMatrix({ { 1 - s * (c * c + d * d), s * (b * c - a * d), s * (b * d + a * c) },
                      { s * (b * c + a * d), 1 - s * (b * b + d * d), s * (c * d - a * b) },
                      { s * (b * d - a * c), s * (c * d + a * b), 1 - s * (b * b + c * c) } });
}

enum class ViewKind
{
  Rigid,
  Affine,
  Mirrored
};

constexpr ViewKind AllViewKinds[] = { ViewKind::Rigid, ViewKind::Affine, ViewKind::Mirrored };

inline MatrixType
MakeRandomViewMatrix(Random & random, ViewKind kind)
{
  MatrixType matrix = MakeRandomRotation(random);
  if (kind == ViewKind::Affine)
  {
    const auto scale = [&random] { return random.Uniform(0.5, 2.0); };
    const auto skew = [&random] { return random.Uniform(-0.4, 0.4); };
    const auto x = scale(), y = scale(), z = scale();
    const auto xy = skew(), xz = skew(), yz = skew();
    matrix = matrix * MakeMatrix({ { x, xy, xz }, { 0, y, yz }, { 0, 0, z } }) * MakeRandomRotation(random);
  }
  if (kind == ViewKind::Mirrored)
  {
    matrix = matrix * MakeDiagonal(-1, 1, 1);
  }
  return matrix;
}

inline ViewType::Pointer
MakeView(const MatrixType & matrix, const PointType & origin)
{
  auto view = ViewType::New();
  view->SetMatrix(matrix);
  view->SetOffset(origin.GetVectorFromOrigin());
  return view;
}

inline PointType
GetCenter(const ImageBase<3> * image)
{
  const auto &               region = image->GetLargestPossibleRegion();
  ContinuousIndex<double, 3> index;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    index[axis] = static_cast<double>(region.GetIndex(axis)) + 0.5 * (static_cast<double>(region.GetSize(axis)) - 1.0);
  }
  return image->TransformContinuousIndexToPhysicalPoint<double>(index);
}

/** The bounds in view space of the eight corners of the outer voxels, by the transform's own inverse. */
inline std::pair<PointType, PointType>
FindCornerBounds(const Transform<double, 3, 3> * view, const ImageBase<3> * image)
{
  const auto   inverse = view->GetInverseTransform();
  const auto & region = image->GetLargestPossibleRegion();
  PointType    lower(1e9);
  PointType    upper(-1e9);
  for (int corner = 0; corner < 8; ++corner)
  {
    ContinuousIndex<double, 3> index;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const double length = (corner >> axis & 1) != 0 ? static_cast<double>(region.GetSize(axis)) : 0.0;
      index[axis] = static_cast<double>(region.GetIndex(axis)) - 0.5 + length;
    }
    const auto point = inverse->TransformPoint(image->TransformContinuousIndexToPhysicalPoint<double>(index));
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      lower[axis] = std::min(lower[axis], point[axis]);
      upper[axis] = std::max(upper[axis], point[axis]);
    }
  }
  return { lower, upper };
}

/** A view whose origin is somewhere near the image's center. */
inline ViewType::Pointer
MakeRandomView(Random & random, ViewKind kind, const ImageBase<3> * image)
{
  const PointType origin = GetCenter(image) + DrawVector(random, 20);
  return MakeView(MakeRandomViewMatrix(random, kind), origin);
}

/** Anisotropic, oblique, off the origin, with a start index that is not zero; every third is left-handed. */
inline void
SetRandomGeometry(Random & random, ImageBase<3> * image, const Size<3> & size)
{
  ImageRegion<3>    region;
  Vector<double, 3> spacing;
  PointType         origin;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    region.SetIndex(axis, random.Integer(-9, 9));
    region.SetSize(axis, size[axis]);
    spacing[axis] = random.Uniform(0.3, 3.0);
    origin[axis] = random.Uniform(-100, 100);
  }
  image->SetRegions(region);
  image->SetSpacing(spacing);
  image->SetOrigin(origin);
  image->SetDirection(MakeRandomRotation(random) * MakeDiagonal(1, 1, random.Integer(0, 2) == 0 ? -1 : 1));
}

inline Size<3>
MakeRandomSize(Random & random, SizeValueType low, SizeValueType high)
{
  Size<3> size;
  for (auto & length : size)
  {
    length = static_cast<SizeValueType>(random.Integer(low, high));
  }
  return size;
}

/** Of \a region without \a margin pixels on each side. */
template <unsigned int VDimension>
Index<VDimension>
DrawIndex(Random & random, const ImageRegion<VDimension> & region, std::int64_t margin = 0)
{
  Index<VDimension> index = region.GetIndex();
  for (unsigned int axis = 0; axis < VDimension; ++axis)
  {
    index[axis] += random.Integer(margin, static_cast<std::int64_t>(region.GetSize(axis)) - 1 - margin);
  }
  return index;
}

template <typename TPixel, unsigned int VDimension>
void
FillRandom(Random & random, Image<TPixel, VDimension> * image)
{
  const SizeValueType count = image->GetBufferedRegion().GetNumberOfPixels();
  std::generate_n(image->GetBufferPointer(), count, [&random] { return MakeRandomPixel<TPixel>(random); });
}

/** Gives each pixel the value of \a function(index). */
template <typename TImagePointer, typename TFunction>
void
FillByIndex(const TImagePointer & image, const TFunction & function)
{
  using ImageType = std::decay_t<decltype(*image)>;
  for (const auto & index : ImageRegionIndexRange<ImageType::ImageDimension>(image->GetBufferedRegion()))
  {
    image->SetPixel(index, static_cast<typename ImageType::PixelType>(function(index)));
  }
}

template <typename TPixel>
typename Image<TPixel, 3>::Pointer
MakeRandomImage(Random & random, const Size<3> & size)
{
  auto image = Image<TPixel, 3>::New();
  SetRandomGeometry(random, image, size);
  image->Allocate();
  FillRandom(random, image.GetPointer());
  return image;
}

/** Spacing 1, identity direction, origin and index zero. */
template <typename TPixel>
typename Image<TPixel, 3>::Pointer
MakePlainImage(const Size<3> & size, TPixel value = TPixel{})
{
  auto image = Image<TPixel, 3>::New();
  image->SetRegions(size);
  image->Allocate();
  image->FillBuffer(value);
  return image;
}

/** An image of \a TPixel with the geometry and the buffered region of \a image. */
template <typename TPixel, unsigned int VDimension>
typename Image<TPixel, VDimension>::Pointer
MakeAlike(const ImageBase<VDimension> * image, const ImageRegion<VDimension> & region)
{
  auto alike = Image<TPixel, VDimension>::New();
  alike->CopyInformation(image);
  alike->SetRegions(region);
  alike->Allocate();
  return alike;
}

/** A filter with the input \a image and, if there is one, the view \a view. */
template <typename TImagePointer>
auto
MakeFilter(const TImagePointer & image, const Transform<double, 3, 3> * view = nullptr)
{
  const auto filter = ShearWarpMIPImageFilter<std::decay_t<decltype(*image)>>::New();
  filter->SetInput(image);
  if (view)
  {
    filter->SetTransform(view);
  }
  return filter;
}

template <typename TFilterPointer>
void
SetGrid(const TFilterPointer &    filter,
        const Size<2> &           size,
        const Vector<double, 2> & spacing,
        const Point<double, 2> &  origin)
{
  filter->SetSize(size);
  filter->SetOutputSpacing(spacing);
  filter->SetOutputOrigin(origin);
}

template <typename TFilterPointer>
void
SetThreads(const TFilterPointer & filter, ThreadIdType threads)
{
  filter->GetMultiThreader()->SetMaximumNumberOfThreads(threads);
  filter->SetNumberOfWorkUnits(threads);
}

/** Even if nothing has changed. */
template <typename TFilterPointer>
void
UpdateAnew(const TFilterPointer & filter)
{
  filter->Modified();
  filter->Update();
}

/** In the order of memory. */
template <typename TImagePointer>
auto
GetPixels(const TImagePointer & image)
{
  const auto * const pixels = image->GetBufferPointer();
  return std::vector(pixels, pixels + image->GetBufferedRegion().GetNumberOfPixels());
}

template <typename TFunction>
std::string
GetExceptionDescription(const TFunction & function)
{
  try
  {
    function();
  }
  catch (const ExceptionObject & exception)
  {
    return exception.GetDescription();
  }
  return "no exception";
}

/** Expects an exception of \a expression that says each of the texts. */
#define EXPECT_NAMES(expression, ...)                                                                        \
  {                                                                                                          \
    const std::string description = itk::ShearWarpMIPTest::GetExceptionDescription([&] { expression; });     \
    for (const std::string & eachText : std::initializer_list<std::string>{ __VA_ARGS__ })                   \
    {                                                                                                        \
      EXPECT_NE(description.find(eachText), std::string::npos) << eachText << " is not in: " << description; \
    }                                                                                                        \
  }

/** Expects each of \a texts in what \a object prints. */
inline void
ExpectPrinted(const Object * object, std::initializer_list<std::string> texts)
{
  std::ostringstream printed;
  object->Print(printed);
  for (const std::string & text : texts)
  {
    EXPECT_NE(printed.str().find(text), std::string::npos) << text << " is not in:\n" << printed.str();
  }
}

/** The same region, and the same bits of all pixels. */
template <typename TImagePointer, typename TOtherPointer>
bool
HaveSamePixels(const TImagePointer & a, const TOtherPointer & b)
{
  const auto * const     pixels = a->GetBufferPointer();
  const decltype(pixels) others = b->GetBufferPointer();
  const auto             count = a->GetBufferedRegion().GetNumberOfPixels();
  return a->GetBufferedRegion() == b->GetBufferedRegion() && std::memcmp(pixels, others, count * sizeof(*pixels)) == 0;
}

template <typename TImage>
void
AddToChecksum(const TImage * image, std::uint64_t & checksum)
{
  AddToChecksum(image->GetBufferPointer(), image->GetBufferedRegion().GetNumberOfPixels(), checksum);
}

template <typename TPixel>
typename Image<TPixel, 2>::Pointer
Copy(const Image<TPixel, 2> * image)
{
  const auto copy = MakeAlike<TPixel>(image, image->GetBufferedRegion());
  std::copy_n(image->GetBufferPointer(), image->GetBufferedRegion().GetNumberOfPixels(), copy->GetBufferPointer());
  return copy;
}

/** Takes one pixel from what is held. */
template <typename TPixel, unsigned int VDimension>
void
Shorten(Image<TPixel, VDimension> * image)
{
  const auto pixels = Image<TPixel, VDimension>::PixelContainer::New();
  pixels->Reserve(image->GetBufferedRegion().GetNumberOfPixels() - 1);
  std::fill_n(pixels->GetBufferPointer(), pixels->Size(), TPixel{ 1 });
  image->SetPixelContainer(pixels);
}

/** Bytes of what a filter has prepared of its input, without intermediate images. */
template <typename TFilter>
SizeValueType
GetPreparedBytes(const TFilter * filter)
{
  struct Open : TFilter
  {
    static SizeValueType
    Get(const TFilter * filter)
    {
      return (filter->*(&Open::m_Engine)).GetPreparedSizeInBytes();
    }
  };
  return Open::Get(filter);
}

} // namespace itk::ShearWarpMIPTest

#endif
