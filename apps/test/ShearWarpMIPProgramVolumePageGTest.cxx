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
#include "ShearWarpMIPProgramPageTestHelper.h"

#include "itkVectorImage.h"
#include "itk_zlib.h"

#include <cmath>
#include <limits>
#include <numeric>

namespace
{
using namespace ShearWarpMIPProgramTest;

/** What a text of base64 of gzip holds. */
std::string
Unpack(const std::string & text)
{
  const std::string packed = DecodeBase64(text);
  std::string       bytes;
  z_stream          stream{};
  EXPECT_EQ(inflateInit2(&stream, MAX_WBITS + 16), Z_OK);
  stream.next_in = reinterpret_cast<unsigned char *>(const_cast<char *>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  int status = Z_OK;
  while (status == Z_OK)
  {
    std::string piece(1 << 16, '\0');
    stream.next_out = reinterpret_cast<unsigned char *>(piece.data());
    stream.avail_out = static_cast<uInt>(piece.size());
    status = inflate(&stream, Z_NO_FLUSH);
    bytes.append(piece, 0, piece.size() - stream.avail_out);
  }
  EXPECT_EQ(status, Z_STREAM_END);
  EXPECT_EQ(stream.avail_in, 0u);
  inflateEnd(&stream);
  return bytes;
}

/** What a page of a volume holds. */
struct PageVolume
{
  std::string               series;
  itk::Size<3>              size;
  std::vector<double>       toPhysical;
  std::vector<double>       values;
  std::vector<unsigned int> stored;

  /** The index of voxel \a n. */
  std::array<std::size_t, 3>
  GetIndex(std::size_t n) const
  {
    return { { n % size[0], n / size[0] % size[1], n / (size[0] * size[1]) } };
  }

  double
  At(std::size_t x, std::size_t y, std::size_t z) const
  {
    return values.at((z * size[1] + y) * size[0] + x);
  }
};

/** Where an index is in mm, by a matrix of three rows of four numbers. */
std::array<double, 3>
Place(const std::vector<double> & matrix, const std::array<double, 3> & index)
{
  std::array<double, 3> point{};
  for (std::size_t row = 0; row < 3; ++row)
  {
    point[row] = matrix.at(4 * row) * index[0] + matrix.at(4 * row + 1) * index[1] + matrix.at(4 * row + 2) * index[2] +
                 matrix.at(4 * row + 3);
  }
  return point;
}

class ShearWarpMIPProgramVolumePage : public ShearWarpMIPProgramPageTest
{
protected:
  void
  SetUp() override
  {
    ShearWarpMIPProgramPageTest::SetUp();
    const Result result = this->Run("in.nrrd probe.html --page-volume");
    if (result.status != 0)
    {
      EXPECT_EQ(result.messages,
                "shear-warp-mip: --page-volume is not possible: this build has no engine for pages; build it with "
                "clang, lld, wasi-libc, libc++-dev-wasm32 and libclang-rt-dev-wasm32\n");
      GTEST_SKIP() << result.messages;
    }
  }

  PageVolume
  ReadVolume(const std::string & name) const
  {
    PageVolume volume{ this->ReadSeries(name), {}, {}, {}, {} };
    EXPECT_EQ(Unpack(this->ReadScript(name, "engine")).substr(0, 4), std::string("\0asm", 4));
    const std::string bytes = Unpack(this->ReadScript(name, "voxels"));
    const auto        size = GetNumbers(volume.series, "volume\": \\{\"size");
    volume.toPhysical = GetNumbers(volume.series, "toPhysical");
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      volume.size[axis] = static_cast<std::size_t>(size.at(axis));
    }
    const std::size_t count = volume.size[0] * volume.size[1] * volume.size[2];
    const auto        planes = static_cast<std::size_t>(GetNumber(volume.series, "bits")) / 8;
    EXPECT_EQ(bytes.size(), planes * count);
    const double slope = GetNumber(volume.series, "slope");
    const double intercept = GetNumber(volume.series, "intercept");
    for (std::size_t n = 0; n < count; ++n)
    {
      const unsigned int high = planes == 2 ? static_cast<unsigned char>(bytes[count + n]) : 0u;
      const unsigned int stored = 256 * high + static_cast<unsigned char>(bytes[n]);
      EXPECT_GT(stored, 0u);
      volume.stored.push_back(stored);
      volume.values.push_back(intercept + slope * stored);
    }
    return volume;
  }

  PageVolume
  Make(const std::string & arguments) const
  {
    const Result result = this->Run(arguments + " page.html --page-volume");
    EXPECT_EQ(result.status, 0) << result.messages;
    return this->ReadVolume("page.html");
  }

  /** An image of \a value with a box of another value from (10, 20, 5) to (19, 22, 8). */
  void
  WriteBox(const std::string & name, PixelType value, PixelType inBox) const
  {
    const auto image = MakeImage<VolumeType>({ { 40, 30, 20 } });
    image->FillBuffer(value);
    itk::ImageRegionIteratorWithIndex<VolumeType> it(image, { { { 10, 20, 5 } }, { { 10, 3, 4 } } });
    for (; !it.IsAtEnd(); ++it)
    {
      it.Set(inBox);
    }
    this->WriteImage(image, name);
  }
};

/** Directions that are oblique, the first one mirrored. */
VolumeType::DirectionType
MakeDirection()
{
  VolumeType::DirectionType direction;
  const double              c = std::cos(0.4);
  const double              s = std::sin(0.4);
  const double              rows[3][3] = { { -c, -s * 0.6, s * 0.8 }, { -s, c * 0.6, -c * 0.8 }, { 0.0, 0.8, 0.6 } };
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int column = 0; column < 3; ++column)
    {
      direction(row, column) = rows[row][column];
    }
  }
  return direction;
}
} // namespace

TEST_F(ShearWarpMIPProgramVolumePage, HoldsAllVoxelsWithTheirGeometry)
{
  const Result result = this->Run("in.nrrd page.html --page-volume --page-bits 16");
  EXPECT_TRUE(std::regex_match(
    result.messages,
    std::regex("shear-warp-mip: note: 'page.html' holds 20 x 18 x 12 voxels of 16 bits, 0\\.[0-9]+ MB\n")))
    << result.messages;
  const PageVolume volume = this->ReadVolume("page.html");
  const auto       voxels = GetPixels(m_Volume);
  EXPECT_EQ(volume.values, std::vector<double>(voxels.begin(), voxels.end()));
  EXPECT_EQ(volume.toPhysical, (std::vector<double>{ 0.7, 0, 0, -40, 0, 0.9, 0, 12.5, 0, 0, 1.3, 3 }));
  EXPECT_EQ(GetNumbers(volume.series, "whole\": \\{\"size"), (std::vector<double>{ 20, 18, 12 }));
  const auto center = GetNumbers(volume.series, "center");
  EXPECT_NEAR(center.at(0), -40 + 0.7 * 9.5, 1e-12);
  EXPECT_NEAR(center.at(1), 12.5 + 0.9 * 8.5, 1e-12);
  EXPECT_NEAR(center.at(2), 3 + 1.3 * 5.5, 1e-12);
  EXPECT_EQ(GetNumber(volume.series, "spacing"), 0.7);
}

TEST_F(ShearWarpMIPProgramVolumePage, BlocksKeepThePlaceOfABrightVoxel)
{
  const auto image = MakeImage<VolumeType>({ { 40, 30, 20 } }, { 0.5, 0.8, 2.0 }, { -30.0, 7.5, 110.0 });
  image->SetDirection(MakeDirection());
  image->FillBuffer(5);
  const itk::Index<3> index{ { 23, 11, 7 } };
  image->SetPixel(index, 1000);
  // so that nothing is background
  image->SetPixel({ { 0, 0, 0 } }, 6);
  image->SetPixel({ { 39, 29, 19 } }, 6);
  this->WriteImage(image, "bright.nrrd");
  // blocks of 4 x 3 x 2 voxels would do for 10 voxels, but cubes of 4 mm are 8 x 5 x 2
  const PageVolume volume = this->Make("bright.nrrd --page-bits 16 --page-volume-size 10");
  EXPECT_EQ(volume.size, (itk::Size<3>{ { 5, 6, 10 } }));
  for (std::size_t n = 0; n < volume.values.size(); ++n)
  {
    EXPECT_EQ(volume.values[n], n == (3 * 6 + 2) * 5 + 2 ? 1000 : n == 0 || n == 299 ? 6 : 5) << n;
  }
  const auto                      found = Place(volume.toPhysical, { { 2.0, 2.0, 3.0 } });
  itk::ContinuousIndex<double, 3> middle;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const double factor[] = { 8.0, 5.0, 2.0 };
    middle[axis] = std::floor(static_cast<double>(index[axis]) / factor[axis]) * factor[axis] + (factor[axis] - 1) / 2;
    EXPECT_LE(std::abs(middle[axis] - static_cast<double>(index[axis])), factor[axis] / 2);
  }
  const auto expected = image->TransformContinuousIndexToPhysicalPoint<double>(middle);
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    EXPECT_NEAR(found[axis], expected[axis], 1e-5);
  }
}

TEST_F(ShearWarpMIPProgramVolumePage, ReducesOnlyIfThatIsNeeded)
{
  const auto sizes = [this](const std::string & arguments) { return this->Make(arguments).size; };
  const auto image = MakeImage<VolumeType>({ { 64, 64, 10 } }, { 1.0, 1.0, 5.0 }, { 0.0, 0.0, 0.0 });
  this->WriteImage(image, "thick.nrrd");
  EXPECT_EQ(sizes("thick.nrrd --page-volume-size 64"), (itk::Size<3>{ { 64, 64, 10 } }));
  EXPECT_EQ(sizes("thick.nrrd --page-volume-size full"), (itk::Size<3>{ { 64, 64, 10 } }));
  EXPECT_EQ(sizes("thick.nrrd --page-volume-size FULL"), (itk::Size<3>{ { 64, 64, 10 } }));
  EXPECT_EQ(sizes("thick.nrrd --page-volume-size 63"), (itk::Size<3>{ { 32, 32, 10 } }));
  EXPECT_EQ(sizes("thick.nrrd --page-volume-size 20"), (itk::Size<3>{ { 16, 16, 10 } }));
  EXPECT_EQ(sizes("thick.nrrd --page-volume-size 3"), (itk::Size<3>{ { 3, 3, 3 } }));
  EXPECT_EQ(sizes("thick.nrrd --page-volume-size 1"), (itk::Size<3>{ { 1, 1, 1 } }));
}

TEST_F(ShearWarpMIPProgramVolumePage, BlocksAreWhatTheModeIs)
{
  const auto voxel = [this](std::size_t x, std::size_t y, std::size_t z) {
    return static_cast<double>(m_Volume->GetPixel({ { static_cast<itk::IndexValueType>(x),
                                                      static_cast<itk::IndexValueType>(y),
                                                      static_cast<itk::IndexValueType>(z) } }));
  };
  for (const std::string mode : { "maximum", "minimum", "mean" })
  {
    SCOPED_TRACE(mode);
    // blocks of 6 x 4 x 3 voxels, fewer at the end
    const PageVolume volume = this->Make("in.nrrd --page-volume-size 5 --page-bits 16 --mode " + mode);
    ASSERT_EQ(volume.size, (itk::Size<3>{ { 4, 5, 4 } }));
    for (std::size_t n = 0; n < volume.values.size(); ++n)
    {
      const auto [x, y, z] = volume.GetIndex(n);
      std::vector<double> block;
      for (std::size_t k = 0; k < 72; ++k)
      {
        const std::size_t place[] = { 6 * x + k % 6, 4 * y + k / 6 % 4, 3 * z + k / 24 };
        if (place[0] < 20 && place[1] < 18)
        {
          block.push_back(voxel(place[0], place[1], place[2]));
        }
      }
      const double sum = std::accumulate(block.begin(), block.end(), 0.0);
      const double expected = mode == "maximum"   ? *std::max_element(block.begin(), block.end())
                              : mode == "minimum" ? *std::min_element(block.begin(), block.end())
                                                  : std::round(sum / static_cast<double>(block.size()));
      EXPECT_EQ(volume.values[n], expected) << x << ' ' << y << ' ' << z;
    }
    EXPECT_NE(volume.series.find("\"mode\": \"" + mode + '"'), std::string::npos);
  }
}

TEST_F(ShearWarpMIPProgramVolumePage, CropsBackgroundAndKeepsOneVoxelOfIt)
{
  for (const auto & [background, inBox] : std::map<PixelType, PixelType>{ { 0, 300 }, { -2000, -1999 } })
  {
    this->WriteBox("box.nrrd", background, inBox);
    const PageVolume volume = this->Make("box.nrrd --page-bits 16");
    EXPECT_EQ(volume.size, (itk::Size<3>{ { 12, 5, 6 } }));
    EXPECT_EQ(volume.toPhysical, (std::vector<double>{ 1, 0, 0, 9, 0, 1, 0, 19, 0, 0, 1, 4 }));
    EXPECT_EQ(volume.At(0, 2, 2), background);
    EXPECT_EQ(volume.At(1, 1, 1), inBox);
    EXPECT_EQ(volume.At(10, 3, 4), inBox);
    EXPECT_EQ(GetNumbers(volume.series, "whole\": \\{\"size"), (std::vector<double>{ 40, 30, 20 }));
    EXPECT_EQ(GetNumbers(volume.series, "center"), (std::vector<double>{ 19.5, 14.5, 9.5 }));
    // rays would have other minima and means without background
    for (const std::string mode : { "minimum", "mean" })
    {
      EXPECT_EQ(this->Make("box.nrrd --mode " + mode).size, (itk::Size<3>{ { 40, 30, 20 } }));
    }
  }
}

TEST_F(ShearWarpMIPProgramVolumePage, CropsNothingAboveTheLeastValueOfTheBorder)
{
  this->WriteBox("dark.nrrd", 100, -50);
  EXPECT_EQ(this->Make("dark.nrrd").size, (itk::Size<3>{ { 40, 30, 20 } }));
  const auto image = MakeImage<VolumeType>({ { 40, 30, 20 } });
  image->SetPixel({ { 39, 15, 10 } }, -1);
  this->WriteImage(image, "least.nrrd");
  EXPECT_EQ(this->Make("least.nrrd").size, (itk::Size<3>{ { 40, 30, 20 } }));
  image->FillBuffer(7);
  image->SetPixel({ { 20, 15, 10 } }, -5);
  image->SetPixel({ { 30, 15, 10 } }, 8);
  this->WriteImage(image, "inside.nrrd");
  EXPECT_EQ(this->Make("inside.nrrd").size, (itk::Size<3>{ { 3, 3, 3 } }));
}

TEST_F(ShearWarpMIPProgramVolumePage, LeavesOutWhatIsBesideMaskAndBox)
{
  this->WriteBox("mask.nrrd", 0, 3);
  this->WriteBox("others.nrrd", 3, 1);
  const auto image = MakeImage<VolumeType>({ { 40, 30, 20 } });
  for (itk::SizeValueType n = 0; n < 24000; ++n)
  {
    image->GetBufferPointer()[n] = static_cast<PixelType>(n % 97 + 11);
  }
  this->WriteImage(image, "values.nrrd");
  // the box of the mask's voxels, with so many voxels at each side that are left out
  const auto expect = [&](const std::string & arguments, std::size_t margin, const std::string & command) {
    SCOPED_TRACE(arguments);
    const PageVolume volume = this->Make("values.nrrd --page-bits 16 " + arguments);
    ASSERT_EQ(volume.size, (itk::Size<3>{ { 10 + 2 * margin, 3 + 2 * margin, 4 + 2 * margin } }));
    for (std::size_t n = 0; n < volume.values.size(); ++n)
    {
      const auto [x, y, z] = volume.GetIndex(n);
      const bool        isInside = x - margin < 10 && y - margin < 3 && z - margin < 4;
      const std::size_t place = ((z - margin + 5) * 30 + y - margin + 20) * 40 + x - margin + 10;
      EXPECT_EQ(volume.values[n], isInside ? static_cast<double>(place % 97 + 11) : 11.0) << x << ' ' << y << ' ' << z;
    }
    EXPECT_NE(volume.series.find("\"command\": [\"shear-warp-mip\", \"INPUT\", " + command + ']'), std::string::npos)
      << volume.series;
  };
  expect("--mask mask.nrrd", 1, R"("--mask", "MASK")");
  expect("--mask mask.nrrd --mask-label 3", 1, R"("--mask", "MASK", "--mask-label", "3")");
  expect("--mask others.nrrd --remove-label 3", 1, R"("--mask", "MASK", "--remove-label", "3")");
  expect("--crop 9.5,19.25,20,22.5,5,8", 0, R"("--crop", "9.5,19.25,20,22.5,5,8")");
  this->ExpectFailure("values.nrrd out.html --page-volume --crop 50,60,0,1,0,1",
                      "--crop: no voxel of INPUT is in the box");
  this->ExpectFailure("values.nrrd out.html --page-volume --mode minimum --mask mask.nrrd",
                      "--mask is not possible with --page-volume unless --mode is maximum");
  EXPECT_EQ(this->Make("values.nrrd --mode minimum --crop 9.5,19.25,20,22.5,5,8").size, (itk::Size<3>{ { 10, 3, 4 } }));
  image->SetDirection(MakeDirection());
  this->WriteImage(image, "oblique.nrrd");
  this->ExpectFailure("oblique.nrrd out.html --page-volume --mode mean --crop -10,10,-10,10,-10,10",
                      "--crop, which cuts oblique voxels off, is not possible with --page-volume");
}

TEST_F(ShearWarpMIPProgramVolumePage, CropsObliqueVolumesInThePatientsSpace)
{
  const auto image = MakeImage<VolumeType>({ { 20, 20, 20 } });
  image->SetDirection(MakeDirection());
  image->FillBuffer(50);
  image->SetPixel({ { 0, 0, 0 } }, 1);
  this->WriteImage(image, "oblique.nrrd");
  const PageVolume volume = this->Make("oblique.nrrd --crop -12,-4,-9,-1,4,12");
  std::size_t      inside = 0;
  for (std::size_t n = 0; n < volume.values.size(); ++n)
  {
    const auto [x, y, z] = volume.GetIndex(n);
    const auto point =
      Place(volume.toPhysical, { { static_cast<double>(x), static_cast<double>(y), static_cast<double>(z) } });
    const bool isInside =
      point[0] >= -12 && point[0] <= -4 && point[1] >= -9 && point[1] <= -1 && point[2] >= 4 && point[2] <= 12;
    EXPECT_EQ(volume.values[n], isInside ? 50 : 1) << n;
    inside += isInside ? 1 : 0;
  }
  EXPECT_GT(inside, 300u);
}

TEST_F(ShearWarpMIPProgramVolumePage, OpensWithTheGivenView)
{
  const std::string how = " --azimuth 20 --elevation 10 --title Vessels --no-labels --threads 1";
  this->ExpectSuccess("in.nrrd frames.html" + how);
  const PageVolume  volume = this->Make("in.nrrd" + how);
  const std::string frames = this->ReadSeries("frames.html");
  EXPECT_EQ(GetNumbers(volume.series, "window"), GetNumbers(frames, "window"));
  for (const std::string common : { "\"title\": \"Vessels\"", "\"inverted\": false", "\"labels\": false" })
  {
    EXPECT_NE(frames.find(common), std::string::npos) << common;
    EXPECT_NE(volume.series.find(common), std::string::npos) << common;
  }
  const auto transform = this->MakeTransform(Direction::Anterior, 20.0, 10.0);
  const auto view = GetNumbers(volume.series, "view");
  ASSERT_EQ(view.size(), 12u);
  for (const std::array<double, 3> & point : { std::array<double, 3>{ { 0.0, 0.0, 0.0 } }, { { 3.0, -7.0, 11.0 } } })
  {
    const auto expected = transform->TransformPoint(itk::Point<double, 3>(point.data()));
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      EXPECT_NEAR(Place(view, point)[axis], expected[axis], 1e-12);
    }
  }
  EXPECT_EQ(GetNumbers(volume.series, "axis"), (std::vector<double>{ 0, 0, 1 }));
  for (const std::string key :
       { "\"slab\": null", "\"exact\": false", "\"hasOrientation\": true", "\"background\": 0" })
  {
    EXPECT_NE(volume.series.find(key), std::string::npos) << key;
  }
}

TEST_F(ShearWarpMIPProgramVolumePage, OpensWithOtherSettings)
{
  const std::string series = this->Make("in.nrrd --window 20 70 --exact --slab -3 inf --output-spacing 0.25").series;
  EXPECT_EQ(GetNumbers(series, "window"), (std::vector<double>{ 20, 70 }));
  EXPECT_NE(series.find("\"exact\": true"), std::string::npos);
  EXPECT_NE(series.find("\"spacing\": 0.25, \"whole\""), std::string::npos);
  const auto slab = GetNumbers(series, "slab");
  ASSERT_EQ(slab.size(), 2u);
  EXPECT_EQ(slab[0], -3);
  EXPECT_GT(slab[1], 20);
  EXPECT_LT(slab[1], 100);
}

TEST_F(ShearWarpMIPProgramVolumePage, HoldsTwiceTheWindowWith8Bits)
{
  const PageVolume volume = this->Make("in.nrrd --window 60 80");
  const auto       voxels = GetPixels(m_Volume);
  for (std::size_t n = 0; n < voxels.size(); ++n)
  {
    EXPECT_EQ(volume.values[n], std::clamp<double>(voxels[n], 50, 90));
  }
}

TEST_F(ShearWarpMIPProgramVolumePage, SaysWhichVoxelsAreAsTheBackground)
{
  const auto image = MakeImage<VolumeType>({ { 3, 2, 2 } });
  const auto expect = [&](short least, const std::string & arguments, double expected) {
    std::iota(image->GetBufferPointer(), image->GetBufferPointer() + 12, least);
    this->WriteImage(image, "ramp.nrrd");
    const PageVolume volume = this->Make("ramp.nrrd --view anterior" + arguments);
    EXPECT_EQ(GetNumber(volume.series, "backgroundVoxel"), expected) << least << arguments;
  };
  expect(0, "", 1);
  expect(-7, "", 1);
  expect(-20, "", 1);
  expect(1, "", 0);
  // the voxels below the stored range are 1
  expect(-7, " --window 1 3", 1);
  expect(0, " --window 8 9", 1);

  const auto logarithms = MakeImage<itk::Image<float, 3>>({ { 3, 2, 2 } });
  std::iota(logarithms->GetBufferPointer(), logarithms->GetBufferPointer() + 12, 2.0f);
  logarithms->GetBufferPointer()[5] = -std::numeric_limits<float>::infinity();
  this->WriteImage(logarithms, "logarithms.nrrd");
  EXPECT_EQ(GetNumber(this->Make("logarithms.nrrd --view anterior").series, "backgroundVoxel"), 1);
}

TEST_F(ShearWarpMIPProgramVolumePage, HoldsFiniteNumbersAlone)
{
  constexpr float infinity = std::numeric_limits<float>::infinity();
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  const auto      image = MakeImage<itk::Image<float, 3>>({ { 6, 5, 4 } });
  const auto      write = [&](const std::vector<float> & pattern) {
    for (itk::SizeValueType n = 0; n < 120; ++n)
    {
      image->GetBufferPointer()[n] = pattern[n % pattern.size()];
    }
    this->WriteImage(image, "hostile.nrrd");
  };
  const auto expect = [&](const std::vector<float> & pattern, const std::vector<double> & values, std::size_t count) {
    write(pattern);
    for (const std::string bits : { "8", "16" })
    {
      SCOPED_TRACE(testing::PrintToString(pattern) + bits);
      const Result result = this->Run("hostile.nrrd page.html --page-volume --window 0 4 --page-bits " + bits);
      EXPECT_EQ(result.status, 0) << result.messages;
      const std::string note = std::to_string(count) + " voxels are no numbers: they have the least value in the page";
      EXPECT_EQ(result.messages.find(note) != std::string::npos, count > 0) << result.messages;
      const PageVolume volume = this->ReadVolume("page.html");
      EXPECT_FALSE(std::regex_search(volume.series, std::regex("[ \\[-](nan|inf)"))) << volume.series;
      ASSERT_EQ(volume.values.size(), 120u);
      for (std::size_t n = 0; n < 120; ++n)
      {
        EXPECT_NEAR(volume.values[n], values[n % values.size()], bits == "8" ? 0.01 : 0.0001) << n;
      }
    }
  };
  expect({ 1, 2, 3, nan, 4 }, { 1, 2, 3, 1, 4 }, 24);
  expect({ 1, 2, infinity, 3, -infinity }, { 1, 2, 3, 3, 1 }, 0);
  expect({ nan }, { 0 }, 120);
  expect({ infinity }, { 0 }, 0);
  expect({ 3 }, { 3 }, 0);
  expect({ nan, 2 }, { 2 }, 60);
}

TEST_F(ShearWarpMIPProgramVolumePage, HoldsOneVoxel)
{
  const auto image = MakeImage<VolumeType>({ { 1, 1, 1 } });
  image->SetPixel({ { 0, 0, 0 } }, -700);
  this->WriteImage(image, "one.nrrd");
  for (const std::string size : { "1", "full" })
  {
    const PageVolume volume = this->Make("one.nrrd --page-volume-size " + size);
    EXPECT_EQ(volume.values, std::vector<double>{ -700 });
  }
}

TEST_F(ShearWarpMIPProgramVolumePage, TellsNoNameOfThePatient)
{
  this->WriteDICOMSeries("1.2.3.4",
                         "a",
                         { 0, 2, 4 },
                         8,
                         false,
                         { { "0010|0010", "Doebler^Janemarie" }, { "0008|103e", "Head of Doebler" } });
  this->WriteDICOMSeries("1.2.3.5", "b", { 0, 2, 4 });
  this->Move("dicom", "Doebler^Janemarie");
  this->Move("in.nrrd", "Janemarie Doebler.nrrd");
  fs::copy_file(this->GetPath("Janemarie Doebler.nrrd"), this->GetPath("Janemarie.nrrd"));
  for (const std::string input :
       { "'Doebler^Janemarie' --series Doebler", "'Janemarie Doebler.nrrd' --mask Janemarie.nrrd" })
  {
    const PageVolume  volume = this->Make(input);
    const std::string page = ReadText(this->GetPath("page.html"));
    EXPECT_NE(page.find("\"title\": \"Maximum intensity projection\""), std::string::npos);
    for (const std::string name : { "Janemarie", "Doebler", ".nrrd" })
    {
      EXPECT_EQ(volume.series.find(name), std::string::npos) << name;
      EXPECT_EQ(page.find(name), std::string::npos) << name;
    }
  }
  EXPECT_NE(this->Make("'Doebler^Janemarie' --series Doebler").series.find(R"("INPUT", "--series", "SERIES"])"),
            std::string::npos);
  EXPECT_NE(this->Make("'Doebler^Janemarie' --series 2").series.find(R"("INPUT", "--series", "2"])"),
            std::string::npos);
}

TEST_F(ShearWarpMIPProgramVolumePage, HasAllValuesForOtherModes)
{
  for (const auto & [mode, bits] : { std::pair("maximum", 8), std::pair("minimum", 16), std::pair("mean", 16) })
  {
    EXPECT_EQ(GetNumber(this->Make("in.nrrd --mode " + std::string(mode)).series, "bits"), bits) << mode;
  }
  EXPECT_EQ(GetNumber(this->Make("in.nrrd --mode mean --page-bits 8").series, "bits"), 8);
}

TEST_F(ShearWarpMIPProgramVolumePage, RefusesWhatItCannotHold)
{
  for (const std::string option : { "--frames 3",
                                    "--sliding-slab 3 2",
                                    "--size 9 9",
                                    "--background 3",
                                    "--oversampling 2",
                                    "--local-maximum 3",
                                    "--attenuation 0.1",
                                    "--depth depth.nrrd",
                                    "--depth-colour depth.png",
                                    "--overlay in.nrrd",
                                    "--segments in.nrrd",
                                    "--dicom-out dicom",
                                    "--in-place" })
  {
    const std::string name = option.substr(0, option.find(' '));
    const Result      result = this->Run("in.nrrd out.html --page-volume " + option);
    EXPECT_EQ(result.status, 1) << option;
    EXPECT_TRUE(std::regex_search(result.messages, std::regex("^shear-warp-mip: \\S+ excludes \\S+\n$")))
      << result.messages;
    EXPECT_NE(result.messages.find(name.substr(0, 10)), std::string::npos) << result.messages;
    EXPECT_NE(result.messages.find("--page-volume"), std::string::npos) << result.messages;
  }
  this->ExpectFailures("in.nrrd out.html --page-volume ",
                       { "--mode absolute-maximum", "--interpolation nearest" },
                       "--page-volume is not possible with --");
  this->ExpectFailure("in.nrrd out.html --page-volume --rate 9", "--rate requires a series");
  this->ExpectFailure("in.nrrd out.html --page-volume --output-spacing 0.5 0.6", "the page's pixels are square");
  this->ExpectFailures(
    "in.nrrd --page-volume ", { "out.png", "out.nrrd", "out/" }, "--page-volume requires a page: .html");
  this->ExpectFailure("in.nrrd out.html --page-volume-size 64", "--page-volume-size requires --page-volume");
  for (const std::string size : { "0", "-3", "1.5", "all", "nan", "70000" })
  {
    this->ExpectFailure("in.nrrd out.html --page-volume --page-volume-size=" + size,
                        '\'' + size + "' is not a whole number from 1 to 65535, nor full");
  }
  this->WriteImage(MakeImage<itk::VectorImage<short, 3>>({ { 5, 4, 3 } }, 3), "colours.nrrd");
  this->ExpectFailure("colours.nrrd out.html --page-volume", "--page-volume is not possible: 'colours.nrrd' has 3");
  this->WriteImage(MakeTimes({ m_Volume, m_Volume }), "times.nrrd");
  this->ExpectFailure("times.nrrd out.html --page-volume", "--page-volume is not possible: 'times.nrrd' has 2 points");
  this->ExpectSuccess("in.nrrd turn.nrrd --frames 3");
  this->ExpectFailure("turn.nrrd out.html --page-volume", "--page-volume is not possible: 'turn.nrrd' has frames");
  const auto transform = this->MakeTransform(Direction::Anterior);
  this->WriteTransforms("two.tfm", { transform, transform });
  this->ExpectFailure("in.nrrd out.html --page-volume --transform two.tfm",
                      "--page-volume is not possible: 'two.tfm' holds 2 transforms");
  this->WriteImage(MakeImage<PictureType>({ { 5, 4 } }), "flat.nrrd");
  this->ExpectFailure("flat.nrrd out.html --page-volume", "has 2 dimensions; 3 are needed");
}

TEST_F(ShearWarpMIPProgramVolumePage, PagesOfFramesHoldNoVolume)
{
  this->ExpectSuccess("in.nrrd frames.html --frames 2");
  EXPECT_EQ(this->ReadScript("frames.html", "engine"), "");
  EXPECT_EQ(this->ReadScript("frames.html", "voxels"), "");
}
