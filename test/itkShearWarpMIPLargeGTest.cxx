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

#include "itkShearWarpMIPTestImages.h"

namespace
{
using namespace itk::ShearWarpMIPTest;

using ImageType = itk::Image<unsigned char, 3>;

constexpr itk::SizeValueType Length = 1300;
constexpr unsigned char      Bright = 255;
constexpr unsigned char      Dark = 63;
constexpr int                Radius = 2;

/** Centers of bright cubes, from the first voxel of the image to the last. */
const itk::Index<3> Cubes[] = { { { 2, 2, 2 } },          { { 1297, 2, 2 } },      { { 2, 1297, 1270 } },
                                { { 1297, 1297, 1297 } }, { { 650, 1200, 1280 } }, { { 1100, 300, 1275 } },
                                { { 640, 650, 660 } } };

/** More than 2^31 voxels: not more than Dark, but for the bright cubes. */
ImageType::Pointer
MakeLargeImage()
{
  const auto      image = MakePlainImage<unsigned char>({ { Length, Length, Length } });
  unsigned char * voxel = image->GetBufferPointer();
  std::uint32_t   state = 1;
  for (itk::SizeValueType n = Length * Length * Length; n-- > 0; ++voxel)
  {
    state = state * 1664525u + 1013904223u;
    *voxel = static_cast<unsigned char>(state >> 26);
  }
  for (const itk::Index<3> & center : Cubes)
  {
    itk::ImageRegion<3> cube(center, { { 1, 1, 1 } });
    cube.PadByRadius(Radius);
    for (const auto & index : itk::ImageRegionIndexRange<3>(cube))
    {
      image->SetPixel(index, Bright);
    }
  }
  return image;
}

/** The maxima along each axis, the other two in their order. */
std::vector<std::vector<unsigned char>>
FindAxisMaxima(const ImageType * image)
{
  std::vector<std::vector<unsigned char>> maxima(3, std::vector<unsigned char>(Length * Length));
  const unsigned char *                   row = image->GetBufferPointer();
  for (itk::SizeValueType z = 0; z < Length; ++z)
  {
    for (itk::SizeValueType y = 0; y < Length; ++y, row += Length)
    {
      unsigned char * alongY = maxima[1].data() + z * Length;
      unsigned char * alongZ = maxima[2].data() + y * Length;
      for (itk::SizeValueType x = 0; x < Length; ++x)
      {
        alongY[x] = std::max(alongY[x], row[x]);
        alongZ[x] = std::max(alongZ[x], row[x]);
      }
      maxima[0][z * Length + y] = *std::max_element(row, row + Length);
    }
  }
  return maxima;
}
} // namespace

TEST(ShearWarpMIPLarge, MoreThan2To31VoxelsAreProjected)
{
  if (!std::getenv("SHEARWARPMIP_TEST_LARGE"))
  {
    GTEST_SKIP() << "takes 5 GB of memory: set SHEARWARPMIP_TEST_LARGE";
  }
  const auto image = MakeLargeImage();
  const auto filter = MakeFilter(image);
  const auto maxima = FindAxisMaxima(image);
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    filter->SetTransform(MakeView(MakeAxisMatrix(axis), PointType(0.0)));
    filter->UpdateLargestPossibleRegion();
    ASSERT_EQ(filter->GetPrincipalAxis(), axis);
    ASSERT_EQ(filter->GetOutput()->GetBufferedRegion().GetSize(), (itk::Size<2>{ { Length, Length } }));
    EXPECT_TRUE(std::equal(maxima[axis].begin(), maxima[axis].end(), filter->GetOutput()->GetBufferPointer()))
      << "along axis " << axis;
  }

  // oblique, along each axis: bright where the geometry says, and nowhere else
  const double rows[][3] = { { 0.48, 0.8, 0.36 }, { -0.6, 0, 0.8 }, { 0.64, -0.6, 0.48 } };
  for (int turn = 0; turn < 3; ++turn)
  {
    MatrixType matrix;
    for (int row = 0; row < 3; ++row)
    {
      for (int column = 0; column < 3; ++column)
      {
        matrix((row + turn) % 3, column) = rows[row][column];
      }
    }
    const auto view = MakeView(matrix, MakePoint3(650, 650, 650));
    filter->SetTransform(view);
    filter->UpdateLargestPossibleRegion();
    EXPECT_EQ(filter->GetPrincipalAxis(), static_cast<unsigned int>(turn + 1) % 3);

    const auto *               output = filter->GetOutput();
    std::vector<itk::Index<2>> places;
    for (const itk::Index<3> & center : Cubes)
    {
      const auto          physical = image->TransformIndexToPhysicalPoint<double>(center);
      const PointType     inView = view->GetInverseTransform()->TransformPoint(physical);
      const itk::Index<2> place = output->TransformPhysicalPointToIndex(MakePoint2(inView[0], inView[1]));
      EXPECT_EQ(+output->GetPixel(place), +Bright) << center;
      places.push_back(place);
    }
    // a cube's corner, and a pixel for each interpolation
    constexpr double   reach = 1.75 * (Radius + 0.5) + 3;
    itk::SizeValueType strangers = 0;
    for (const auto & index : itk::ImageRegionIndexRange<2>(output->GetBufferedRegion()))
    {
      const auto isNear = [&](const itk::Index<2> & place) {
        return std::hypot(place[0] - index[0], place[1] - index[1]) < reach;
      };
      strangers += output->GetPixel(index) > Dark && std::none_of(places.begin(), places.end(), isNear);
    }
    EXPECT_EQ(strangers, 0u);
  }
}
