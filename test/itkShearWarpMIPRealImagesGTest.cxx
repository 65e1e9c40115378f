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
#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPTestOracle.h"
#include "itkShearWarpMIPView.h"

#include "itkGDCMImageIO.h"
#include "itkImageFileReader.h"
#include "itkMaximumProjectionImageFilter.h"
#include "itkMetaImageIO.h"
#include "itkNrrdImageIO.h"
#include "itkVectorImage.h"

/** Clinical images from ITK's own test data: the content links in the folder Input. */
namespace
{
using namespace itk::ShearWarpMIPTest;
using itk::ShearWarpMIPView;
using Direction = itk::ShearWarpMIPViewEnums::Direction;

const std::string Folder = SHEARWARPMIP_TEST_IMAGES;

class ShearWarpMIPRealImages : public testing::Test
{
protected:
  void
  SetUp() override
  {
    if (Folder.empty())
    {
      GTEST_SKIP() << "the CMake variable ShearWarpMIP_TEST_IMAGES does not give the folder of the test images";
    }
  }
};

template <typename TImage, typename TImageIO>
typename TImage::Pointer
Read(const std::string & name)
{
  const auto reader = itk::ImageFileReader<TImage>::New();
  reader->SetImageIO(TImageIO::New());
  reader->SetFileName(Folder + "/" + name);
  reader->Update();
  typename TImage::Pointer image = reader->GetOutput();
  image->DisconnectPipeline();
  return image;
}

/** Component \a component of a vector image. */
itk::Image<short, 3>::Pointer
ReadCardiacCT(unsigned int component)
{
  const auto         phases = Read<itk::VectorImage<short, 3>, itk::NrrdImageIO>("CTCardioCropped.seq.nrrd");
  const auto         image = MakeAlike<short, 3>(phases, phases->GetBufferedRegion());
  const unsigned int length = phases->GetNumberOfComponentsPerPixel();
  for (itk::SizeValueType n = 0; n < image->GetBufferedRegion().GetNumberOfPixels(); ++n)
  {
    image->GetBufferPointer()[n] = phases->GetBufferPointer()[n * length + component];
  }
  return image;
}

/** Of the 25 phases of 65 slices, in the order 25 * slice + phase, the one that is asked for. */
itk::Image<unsigned short, 3>::Pointer
ReadCardiacMR(itk::SizeValueType phase)
{
  constexpr itk::SizeValueType phases = 25;
  using ImageType = itk::Image<unsigned short, 3>;
  const auto   all = Read<ImageType, itk::GDCMImageIO>("Philips_4D_DICOM.dcm");
  const auto & allSize = all->GetBufferedRegion().GetSize();
  EXPECT_EQ(allSize[2], 65 * phases);

  auto image = ImageType::New();
  image->CopyInformation(all);
  image->SetRegions(itk::Size<3>{ { allSize[0], allSize[1], allSize[2] / phases } });
  // PixelSpacing and SpacingBetweenSlices of the file, which GDCM does not find
  image->SetSpacing(MakeVector3(1.8518518, 1.8518518, 1.85));
  image->Allocate();
  const itk::SizeValueType slice = allSize[0] * allSize[1];
  for (itk::SizeValueType z = 0; z < allSize[2] / phases; ++z)
  {
    std::copy_n(all->GetBufferPointer() + (phases * z + phase) * slice, slice, image->GetBufferPointer() + z * slice);
  }
  return image;
}

/** A view by azimuth and elevation, and the picture's facts that hold for any image. */
template <typename TPixel>
void
ExpectProjectionIsRight(const itk::Image<TPixel, 3> * image, Direction direction, double azimuth, double elevation)
{
  SCOPED_TRACE(testing::Message() << direction << ", azimuth " << azimuth << ", elevation " << elevation);
  const auto     view = ShearWarpMIPView::MakeTransform(image, direction, azimuth, elevation);
  const TPixel * voxels = image->GetBufferPointer();
  const auto     count = image->GetBufferedRegion().GetNumberOfPixels();
  const auto     brightestVoxel = std::max_element(voxels, voxels + count);
  const TPixel   darkest = *std::min_element(voxels, voxels + count);
  const auto     background = static_cast<TPixel>(darkest > 0 ? darkest / 2 : darkest - 1);
  const auto     filter = MakeFilter(image, view);
  filter->SetDefaultPixelValue(background);
  filter->Update();
  const auto * output = filter->GetOutput();

  BruteForceProjection<TPixel> bruteForce(view, image);
  EXPECT_TRUE(HaveSamePixels(bruteForce.Evaluate(output, background), output));

  // the image's physical corners just fit in
  const auto & size = output->GetBufferedRegion().GetSize();
  const auto [lower, upper] = FindCornerBounds(view, image);
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    const double extent = output->GetSpacing()[axis] * static_cast<double>(size[axis]);
    EXPECT_GE(extent, upper[axis] - lower[axis] - 1e-4);
    EXPECT_LT(extent, upper[axis] - lower[axis] + output->GetSpacing()[axis]);
  }

  // the brightest voxel is seen, and nothing is brighter
  const auto brightest = image->ComputeIndex(brightestVoxel - voxels);
  const auto physical = image->template TransformIndexToPhysicalPoint<double>(brightest);
  const auto expected = view->GetInverseTransform()->TransformPoint(physical);
  const auto smallest = output->GetSpacing()[0];
  TPixel     nearby = background;
  for (const auto & index : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
  {
    const TPixel pixel = output->GetPixel(index);
    ASSERT_TRUE(pixel == background || (pixel >= darkest && pixel <= *brightestVoxel)) << index;
    const auto position = output->template TransformIndexToPhysicalPoint<double>(index);
    if (std::abs(position[0] - expected[0]) <= smallest && std::abs(position[1] - expected[1]) <= smallest)
    {
      nearby = pixel == background ? nearby : std::max(nearby, pixel);
    }
  }
  EXPECT_GT(nearby, 0.2 * static_cast<double>(*brightestVoxel));
}

/** Blanks the voxels on one side of the image's center, in physical space. */
template <typename TPixel>
typename itk::Image<TPixel, 3>::Pointer
KeepSide(const itk::Image<TPixel, 3> * image, const itk::Vector<double, 3> & side)
{
  const auto half = MakeAlike<TPixel>(image, image->GetBufferedRegion());
  const auto center = GetCenter(image);
  FillByIndex(half, [&](const auto & index) {
    const auto position = image->template TransformIndexToPhysicalPoint<double>(index);
    return (position - center) * side > 0 ? image->GetPixel(index) : TPixel{};
  });
  return half;
}

/** The half of the patient on \a side must be on the picture's side \a sign along axis \a axis. */
template <typename TPixel>
void
ExpectSideIsSeen(const itk::Image<TPixel, 3> *  image,
                 const itk::Vector<double, 3> & side,
                 Direction                      direction,
                 unsigned int                   axis,
                 double                         sign)
{
  const auto half = KeepSide(image, side);
  const auto filter = MakeFilter(half, ShearWarpMIPView::MakeTransform(half, direction));
  filter->Update();
  const auto * output = filter->GetOutput();
  const double reach = image->GetSpacing().GetVnlVector().max_value() * 2;
  double       there = 0.0;
  for (const auto & index : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
  {
    const auto position = output->template TransformIndexToPhysicalPoint<double>(index);
    if (sign * position[axis] < -reach)
    {
      ASSERT_EQ(output->GetPixel(index), 0) << "on the wrong side, at " << position;
    }
    there += output->GetPixel(index);
  }
  EXPECT_GT(there, 0.0);
}

template <typename TPixel>
void
ExpectSidesAreSeen(const itk::Image<TPixel, 3> * image)
{
  const auto left = MakeVector3(1, 0, 0);
  const auto posterior = MakeVector3(0, 1, 0);
  const auto superior = MakeVector3(0, 0, 1);
  ExpectSideIsSeen(image, left, Direction::Anterior, 0, 1);
  ExpectSideIsSeen(image, -left, Direction::Anterior, 0, -1);
  ExpectSideIsSeen(image, superior, Direction::Anterior, 1, -1);
  ExpectSideIsSeen(image, left, Direction::Posterior, 0, -1);
  ExpectSideIsSeen(image, posterior, Direction::Left, 0, 1);
  ExpectSideIsSeen(image, posterior, Direction::Right, 0, -1);
  ExpectSideIsSeen(image, posterior, Direction::Superior, 1, 1);
  ExpectSideIsSeen(image, left, Direction::Inferior, 0, 1);
}

/** Maximum along the image's own axes, as ITK computes it. */
template <typename TPixel>
void
ExpectAxisViewsEqualMaximumProjection(const itk::Image<TPixel, 3> * image)
{
  using ImageType = itk::Image<TPixel, 3>;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto projection = itk::MaximumProjectionImageFilter<ImageType, ImageType>::New();
    projection->SetInput(image);
    projection->SetProjectionDimension(axis);
    projection->Update();

    const unsigned int columnAxis = axis == 0 ? 1 : 0;
    const unsigned int rowAxis = axis == 2 ? 1 : 2;
    const auto filter = MakeFilter(image, MakeView(image->GetDirection() * MakeAxisMatrix(axis), image->GetOrigin()));
    filter->SetOutputSpacing(MakeVector2(image->GetSpacing()[columnAxis], image->GetSpacing()[rowAxis]));
    filter->Update();
    EXPECT_TRUE(GetPixels(projection->GetOutput()) == GetPixels(filter->GetOutput())) << "along axis " << axis;
  }
}

constexpr const char * HeadFiles[] = { "HeadMRVolumeWithDirection.mhd",
                                       "HeadMRVolumeWithDirection001.mhd",
                                       "HeadMRVolumeWithDirection002.mhd",
                                       "HeadMRVolumeWithDirection003.mhd" };
} // namespace

TEST_F(ShearWarpMIPRealImages, HeadsWithDirectionsAreProjectedRight)
{
  for (const char * file : HeadFiles)
  {
    SCOPED_TRACE(file);
    const auto image = Read<itk::Image<unsigned char, 3>, itk::MetaImageIO>(file);
    ASSERT_EQ(image->GetBufferedRegion().GetSize(), (itk::Size<3>{ { 48, 62, 42 } }));
    ExpectProjectionIsRight<unsigned char>(image, Direction::Anterior, 0, 0);
    ExpectProjectionIsRight<unsigned char>(image, Direction::Left, 25, 10);
    ExpectProjectionIsRight<unsigned char>(image, Direction::Superior, -35, 20);
    ExpectSidesAreSeen<unsigned char>(image);
    ExpectAxisViewsEqualMaximumProjection<unsigned char>(image);
  }
}

TEST_F(ShearWarpMIPRealImages, DirectionTurnsThePatientAndNothingElse)
{
  // the same voxels, seen along the same lines
  using ImageType = itk::Image<unsigned char, 3>;
  const auto first = Read<ImageType, itk::MetaImageIO>(HeadFiles[0]);
  const auto view = ShearWarpMIPView::MakeTransform(first, Direction::Anterior, 20, 30);
  const auto expected = MakeFilter(first, view);
  expected->Update();
  for (const char * file : HeadFiles)
  {
    const auto       image = Read<ImageType, itk::MetaImageIO>(file);
    const MatrixType turn = image->GetDirection() * MatrixType(first->GetDirection().GetInverse());
    const auto       offset = turn * (view->GetOffset() - first->GetOrigin().GetVectorFromOrigin());
    const auto       turned = MakeView(turn * view->GetMatrix(), image->GetOrigin() + offset);
    const auto       output = MakeFilter(image, turned);
    output->Update();
    EXPECT_TRUE(HaveSamePixels(expected->GetOutput(), output->GetOutput())) << file;
  }
}

TEST_F(ShearWarpMIPRealImages, ObliqueHeadOfCompressedNrrdIsProjectedRight)
{
  const auto image = Read<itk::Image<unsigned char, 3>, itk::NrrdImageIO>("HeadMRVolumeWithDirection.nhdr");
  ASSERT_EQ(image->GetBufferedRegion().GetSize(), (itk::Size<3>{ { 48, 62, 42 } }));
  EXPECT_NEAR(image->GetDirection()(0, 0), std::sqrt(0.75), 1e-4) << "turned by 30 degrees";
  ExpectProjectionIsRight<unsigned char>(image, Direction::Anterior, 0, 0);
  ExpectProjectionIsRight<unsigned char>(image, Direction::Right, 12, -34);
  ExpectSidesAreSeen<unsigned char>(image);
}

TEST_F(ShearWarpMIPRealImages, CardiacCTWithNegativeValuesIsProjectedRight)
{
  for (const unsigned int phase : { 0, 7 })
  {
    const auto image = ReadCardiacCT(phase);
    ASSERT_EQ(image->GetBufferedRegion().GetSize(), (itk::Size<3>{ { 32, 27, 15 } }));
    const short * voxels = image->GetBufferPointer();
    ASSERT_LT(*std::min_element(voxels, voxels + image->GetBufferedRegion().GetNumberOfPixels()), 0);
    EXPECT_LT(image->GetDirection()(0, 0), 0) << "columns run to the patient's right";
    ExpectProjectionIsRight<short>(image, Direction::Anterior, 0, 0);
    ExpectProjectionIsRight<short>(image, Direction::Left, 15, -40);
    ExpectProjectionIsRight<short>(image, Direction::Inferior, 33, 5);
    ExpectSidesAreSeen<short>(image);
    ExpectAxisViewsEqualMaximumProjection<short>(image);
  }
}

TEST_F(ShearWarpMIPRealImages, ObliqueHeadOfLegacyMultiFrameIsProjectedRight)
{
  const auto image = Read<itk::Image<unsigned short, 3>, itk::GDCMImageIO>("LegacyMultiFrame.dcm");
  ASSERT_EQ(image->GetBufferedRegion().GetSize(), (itk::Size<3>{ { 256, 256, 128 } }));
  ExpectProjectionIsRight<unsigned short>(image, Direction::Anterior, 0, 0);
  ExpectProjectionIsRight<unsigned short>(image, Direction::Left, -20, 30);
  ExpectSidesAreSeen<unsigned short>(image);
  ExpectAxisViewsEqualMaximumProjection<unsigned short>(image);
}

TEST_F(ShearWarpMIPRealImages, BrightBloodOfOneCardiacPhaseIsProjectedRight)
{
  const auto image = ReadCardiacMR(0);
  ASSERT_EQ(image->GetBufferedRegion().GetSize(), (itk::Size<3>{ { 128, 128, 65 } }));
  ExpectProjectionIsRight<unsigned short>(image, Direction::Anterior, 0, 0);
  ExpectProjectionIsRight<unsigned short>(image, Direction::Anterior, 45, 20);
  ExpectProjectionIsRight<unsigned short>(image, Direction::Superior, 0, 10);
  ExpectSidesAreSeen<unsigned short>(image);
  ExpectAxisViewsEqualMaximumProjection<unsigned short>(image);
}
