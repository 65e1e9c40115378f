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
#include "Labels.h"
#include "Orientation.h"
#include "ShearWarpMIPProgramTestHelper.h"

#include "itkVectorImage.h"

#include <cmath>
#include <initializer_list>
#include <set>

namespace
{
using namespace ShearWarpMIPProgramTest;
using GreyType = itk::Image<unsigned char, 2>;
using Letters = std::array<std::string, 4>;
using Vector = itk::Vector<double, 3>;

ViewTransformType::Pointer
MakeColumns(const Vector & u, const Vector & v, const Vector & w)
{
  const auto                    transform = ViewTransformType::New();
  ViewTransformType::MatrixType matrix;
  for (unsigned int row = 0; row < 3; ++row)
  {
    matrix(row, 0) = u[row];
    matrix(row, 1) = v[row];
    matrix(row, 2) = w[row];
  }
  transform->SetMatrix(matrix);
  transform->SetOffset(MakeVector(3.0, -200.0, 0.5));
  return transform;
}

Letters
GetLetters(const itk::Transform<double, 3, 3> * transform)
{
  const EdgeLetters letters = ComputeEdgeLetters(transform);
  return { { letters.left, letters.right, letters.top, letters.bottom } };
}

TEST(Orientation, SignedPermutationsHaveOneLetter)
{
  // by index and sign: the sides that an axis of LPS comes from and goes to
  const std::string           from[] = { "R", "A", "F" };
  const std::string           to[] = { "L", "P", "H" };
  unsigned int                count = 0;
  std::array<unsigned int, 3> axes{ { 0, 1, 2 } };
  do
  {
    for (unsigned int signs = 0; signs < 8; ++signs)
    {
      std::array<Vector, 3> columns;
      for (unsigned int n = 0; n < 3; ++n)
      {
        columns[n].Fill(0.0);
        columns[n][axes[n]] = (signs >> n & 1) == 0 ? 2.0 : -0.1;
      }
      const auto letters = GetLetters(MakeColumns(columns[0], columns[1], columns[2]));
      for (std::size_t n = 0; n < 2; ++n)
      {
        const bool isForward = (signs >> n & 1) == 0;
        EXPECT_EQ(letters[2 * n], (isForward ? from : to)[axes[n]]);
        EXPECT_EQ(letters[2 * n + 1], (isForward ? to : from)[axes[n]]);
      }
      ++count;
    }
  } while (std::next_permutation(axes.begin(), axes.end()));
  EXPECT_EQ(count, 48u);
}

TEST(Orientation, ObliqueViewsHaveTwoLetters)
{
  const auto volume = MakeVolume<PixelType>(10);
  struct Case
  {
    Direction direction;
    double    azimuth, elevation;
    Letters   letters;
  };
  for (const Case & view : { Case{ Direction::Anterior, 0.0, 0.0, { { "R", "L", "H", "F" } } },
                             Case{ Direction::Posterior, 0.0, 0.0, { { "L", "R", "H", "F" } } },
                             Case{ Direction::Left, 0.0, 0.0, { { "A", "P", "H", "F" } } },
                             Case{ Direction::Right, 0.0, 0.0, { { "P", "A", "H", "F" } } },
                             Case{ Direction::Superior, 0.0, 0.0, { { "L", "R", "A", "P" } } },
                             Case{ Direction::Inferior, 0.0, 0.0, { { "R", "L", "A", "P" } } },
                             Case{ Direction::Anterior, 22.4, 0.0, { { "R", "L", "H", "F" } } },
                             Case{ Direction::Anterior, 22.6, 0.0, { { "RA", "LP", "H", "F" } } },
                             Case{ Direction::Anterior, -30.0, 0.0, { { "RP", "LA", "H", "F" } } },
                             Case{ Direction::Anterior, 50.0, -60.0, { { "AR", "PL", "LA", "RP" } } },
                             Case{ Direction::Anterior, 0.0, 30.0, { { "R", "L", "HP", "FA" } } },
                             Case{ Direction::Anterior, 67.6, 0.0, { { "A", "P", "H", "F" } } } })
  {
    const auto transform =
      itk::ShearWarpMIPView::MakeTransform(volume.GetPointer(), view.direction, view.azimuth, view.elevation);
    EXPECT_EQ(GetLetters(transform), view.letters) << view.azimuth << ' ' << view.elevation;
  }
  // of equally near sides the first ones of L R, A P, H F
  EXPECT_EQ(GetLetters(MakeColumns(MakeVector(3, 3, 3), MakeVector(0, -2, 2), MakeVector(0, 0, 1))),
            (Letters{ { "RA", "LP", "PF", "AH" } }));
}

TEST(Orientation, AnglesAreLongitudeAndLatitude)
{
  const auto volume = MakeVolume<PixelType>(10);
  const auto expect = [&](Direction direction, double azimuth, double elevation, double primary, double secondary) {
    const auto angles = ComputeViewAngles(
      itk::ShearWarpMIPView::MakeTransform(volume.GetPointer(), direction, azimuth, elevation).GetPointer());
    EXPECT_NEAR(angles.primary, primary, 1e-9) << azimuth << ' ' << elevation;
    EXPECT_NEAR(angles.secondary, secondary, 1e-9) << azimuth << ' ' << elevation;
  };
  for (const double azimuth : { -179.0, -90.0, -7.5, 0.0, 30.0, 90.0, 150.0, 180.0 })
  {
    for (const double elevation : { -89.0, -15.0, 0.0, 60.0 })
    {
      expect(Direction::Anterior, azimuth, elevation, azimuth, elevation);
    }
  }
  expect(Direction::Posterior, 0.0, 10.0, 180.0, 10.0);
  expect(Direction::Left, 0.0, 0.0, 90.0, 0.0);
  expect(Direction::Right, 0.0, 0.0, -90.0, 0.0);
  for (const double azimuth : { -90.0, 0.0, 30.0, 180.0 })
  {
    expect(Direction::Anterior, azimuth, 90.0, azimuth, 90.0);
    expect(Direction::Anterior, azimuth, -90.0, azimuth, -90.0);
  }
  expect(Direction::Superior, 0.0, 0.0, 180.0, 90.0);
  expect(Direction::Inferior, 0.0, 0.0, 0.0, -90.0);
  // however long the ray's direction is
  const auto scaled =
    ComputeViewAngles(MakeColumns(MakeVector(1, 0, 0), MakeVector(0, 0, 1), MakeVector(-1e-3, 1e-3, 0)).GetPointer());
  EXPECT_NEAR(scaled.primary, 45.0, 1e-9);
}

/** Characters as people draw them in cells of 7 rows. */
const std::map<std::string, std::string> shapes = { { "#....|#....|#....|#....|#....|#....|#####", "L" },
                                                    { "####.|#...#|#...#|####.|#..#.|#..#.|#...#", "R" },
                                                    { "..#..|..#..|.#.#.|.#.#.|.###.|#...#|#...#", "A" },
                                                    { "####.|#...#|#...#|####.|#....|#....|#....", "P" },
                                                    { "#...#|#...#|#...#|#####|#...#|#...#|#...#", "H" },
                                                    { "#####|#....|#....|####.|#....|#....|#....", "F" },
                                                    { ".###.|#...#|#...#|#...#|#...#|#...#|.###.", "O" },
                                                    { ".###.|#...#|#....|#....|#....|#...#|.###.", "C" },
                                                    { "#...#|#...#|#...#|#...#|#...#|#...#|.###.", "U" },
                                                    { ".....|.....|##.#.|#.#.#|#.#.#|#.#.#|#.#.#", "m" },
                                                    { ".##.|#..#|#..#|#..#|#..#|#..#|.##.", "0" },
                                                    { ".#|##|.#|.#|.#|.#|.#", "1" },
                                                    { ".##.|#..#|...#|..#.|.##.|.#..|####", "2" },
                                                    { ".##.|#..#|...#|.##.|...#|#..#|.##.", "3" },
                                                    { "#..#|#..#|#..#|####|...#|...#|...#", "4" },
                                                    { "####|#...|###.|...#|...#|#..#|.##.", "5" },
                                                    { ".##.|#..#|#...|###.|#..#|#..#|.##.", "6" },
                                                    { "####|...#|..#.|..#.|..#.|.#..|.#..", "7" },
                                                    { ".##.|#..#|#..#|.##.|#..#|#..#|.##.", "8" },
                                                    { ".##.|#..#|#..#|.###|...#|#..#|.##.", "9" },
                                                    { ".|.|.|.|.|.|#", "." },
                                                    { "...|...|...|###|...|...|...", "-" },
                                                    { ".#.|#.#|.#.|...|...|...|...", "o" },
                                                    { "....|....|###.|#..#|#..#|#..#|#..#", "n" },
                                                    // its descender is below
                                                    { "....|....|#..#|#..#|#..#|#..#|####", "u" } };

/** A part of a picture. */
struct Part
{
  long x, y, width, height;
};

/** What is written in a part of a picture, in letters of 7 pixels on black: nothing if that is all black. */
std::string
ReadLabel(const std::vector<unsigned char> & pixels, long pictureWidth, const Part & part)
{
  std::vector<std::string> lines;
  for (long y = part.y; y < part.y + part.height; ++y)
  {
    lines.emplace_back();
    for (long x = part.x; x < part.x + part.width; ++x)
    {
      lines.back() += pixels[static_cast<std::size_t>(y * pictureWidth + x)] >= 128 ? '#' : '.';
    }
    // so that the last character ends
    lines.back() += '.';
  }
  const auto top = std::find_if(
    lines.begin(), lines.end(), [](const std::string & line) { return line.find('#') != std::string::npos; });
  std::string text;
  std::size_t begin = 0;
  std::size_t end = 0;
  for (std::size_t x = 0; lines.end() - top >= 7 && x < top->size(); ++x)
  {
    if (std::any_of(top, top + 7, [x](const std::string & line) { return line[x] == '#'; }))
    {
      text += x == begin && x > end + 3 && !text.empty() ? " " : "";
      continue;
    }
    if (begin < x)
    {
      std::string shape = top->substr(begin, x - begin);
      std::for_each(top + 1, top + 7, [&](const std::string & line) { shape += '|' + line.substr(begin, x - begin); });
      const auto found = shapes.find(shape);
      text += found != shapes.end() ? found->second : '[' + shape + ']';
      end = x;
    }
    begin = x + 1;
  }
  return text;
}

Letters
ReadLetters(const std::vector<unsigned char> & pixels, long width)
{
  const long height = static_cast<long>(pixels.size()) / width;
  const long x = width / 2 - 8;
  const long y = height / 2 - 6;
  return { { ReadLabel(pixels, width, { 0, y, 16, 12 }),
             ReadLabel(pixels, width, { width - 16, y, 16, 12 }),
             ReadLabel(pixels, width, { x, 0, 16, 12 }),
             ReadLabel(pixels, width, { x, height - 12, 16, 12 }) } };
}

/** Pictures of one grey value. */
AnyImage
MakePictures(itk::SizeValueType width,
             itk::SizeValueType height,
             unsigned char      grey,
             unsigned int       components = 1,
             itk::SizeValueType frames = 1)
{
  const auto grid = itk::Image<char, 3>::New();
  grid->SetRegions(itk::Size<3>{ { width, height, frames } });
  AnyImage pictures = MakeAnyImage<unsigned char>(grid.GetPointer(), components);
  auto &   pixels = *CastImage<unsigned char>(pictures).GetPixelContainer();
  std::fill_n(pixels.GetBufferPointer(), pixels.Size(), grey);
  return pictures;
}

std::vector<unsigned char>
Draw(const AnyImage & pictures, const std::vector<Frame> & frames, const Labels & labels)
{
  DrawLabels(pictures, frames, labels);
  auto &                pixels = *CastImage<unsigned char>(pictures).GetPixelContainer();
  const unsigned char * begin = pixels.GetBufferPointer();
  return { begin, begin + pixels.Size() };
}

Frame
MakeFrame(Direction direction, double azimuth = 0.0, double elevation = 0.0)
{
  Frame frame;
  frame.transform =
    itk::ShearWarpMIPView::MakeTransform(MakeVolume<PixelType>(10).GetPointer(), direction, azimuth, elevation);
  return frame;
}

const Labels sides{ true, false };
const Labels scaleAndAngles{ false, true };

TEST(Labels, LettersAreAtTheMiddleOfEachEdge)
{
  for (const auto & size : { itk::Size<2>{ { 48, 48 } },
                             itk::Size<2>{ { 100, 61 } },
                             itk::Size<2>{ { 4000, 100 } },
                             itk::Size<2>{ { 50, 900 } } })
  {
    for (const Frame & frame : { MakeFrame(Direction::Anterior),
                                 MakeFrame(Direction::Inferior),
                                 MakeFrame(Direction::Right),
                                 MakeFrame(Direction::Superior),
                                 MakeFrame(Direction::Anterior, 40.0, 50.0) })
    {
      const auto pixels = Draw(MakePictures(size[0], size[1], 0), { frame }, sides);
      EXPECT_EQ(ReadLetters(pixels, static_cast<long>(size[0])), GetLetters(frame.transform)) << size;
    }
  }
}

TEST(Labels, FramesHaveTheirOwn)
{
  const auto pixels = Draw(MakePictures(60, 60, 0, 1, 3),
                           { MakeFrame(Direction::Left), MakeFrame(Direction::Right), MakeFrame(Direction::Superior) },
                           sides);
  const auto second = pixels.begin() + 3600;
  EXPECT_EQ(ReadLetters({ pixels.begin(), second }, 60), (Letters{ { "A", "P", "H", "F" } }));
  EXPECT_EQ(ReadLetters({ second, second + 3600 }, 60), (Letters{ { "P", "A", "H", "F" } }));
  EXPECT_EQ(ReadLetters({ second + 3600, pixels.end() }, 60), (Letters{ { "L", "R", "A", "P" } }));
}

TEST(Labels, SmallPicturesHaveNone)
{
  for (const auto & size : { itk::Size<2>{ { 1, 1 } },
                             itk::Size<2>{ { 10, 10 } },
                             itk::Size<2>{ { 47, 47 } },
                             itk::Size<2>{ { 4000, 47 } },
                             itk::Size<2>{ { 47, 4000 } } })
  {
    const auto pixels = Draw(MakePictures(size[0], size[1], 90), { MakeFrame(Direction::Anterior) }, { true, true });
    EXPECT_EQ(pixels, std::vector<unsigned char>(size[0] * size[1], 90)) << size;
  }
}

TEST(Labels, GrowWithThePicture)
{
  for (const long size : { 48L, 100L, 196L, 280L, 561L, 1120L })
  {
    const auto pixels = Draw(MakePictures(static_cast<unsigned long>(size), static_cast<unsigned long>(size + 100), 0),
                             { MakeFrame(Direction::Anterior) },
                             sides);
    std::set<long> columns;
    std::set<long> rows;
    for (long y = size; y < size + 100; ++y)
    {
      for (long x = size / 4; x < 3 * size / 4; ++x)
      {
        if (pixels[static_cast<std::size_t>(y * size + x)] >= 128)
        {
          columns.insert(x);
          rows.insert(y);
        }
      }
    }
    ASSERT_FALSE(columns.empty());
    const long left = *columns.begin();
    const long right = *columns.rbegin();
    // the letter F at the bottom
    const double height = std::max(7.0, static_cast<double>(size) / 28.0);
    EXPECT_NEAR(static_cast<double>(*rows.rbegin() - *rows.begin() + 1), height, 1.0) << size;
    EXPECT_NEAR(static_cast<double>(right - left + 1), height * 5.0 / 7.0, 1.0) << size;
    EXPECT_NEAR(0.5 * static_cast<double>(left + right), 0.5 * static_cast<double>(size - 1), 1.0) << size;
  }
}

TEST(Labels, AreSeenOnEachGrey)
{
  const std::vector<Frame> frames{ MakeFrame(Direction::Anterior, 30.0) };
  const auto               onBlack = Draw(MakePictures(64, 64, 0), frames, sides);
  for (const unsigned char grey : std::initializer_list<unsigned char>{ 0, 1, 127, 128, 200, 255 })
  {
    const auto  pixels = Draw(MakePictures(64, 64, grey), frames, sides);
    std::size_t white = 0;
    for (std::size_t n = 0; n < pixels.size(); ++n)
    {
      if (onBlack[n] == 255)
      {
        ++white;
        EXPECT_EQ(pixels[n], 255);
        const auto pixel = pixels.begin() + static_cast<std::ptrdiff_t>(n);
        EXPECT_EQ(*std::min_element(pixel - 130, pixel + 130), 0);
      }
    }
    EXPECT_GT(white, 40u);
    EXPECT_EQ(pixels[0], grey);
    EXPECT_EQ(pixels[32 * 64 + 32], grey);
  }
}

TEST(Labels, ColoursStayColours)
{
  const std::vector<Frame> frames{ MakeFrame(Direction::Anterior, 30.0) };
  const unsigned char      colour[] = { 255, 30, 0 };
  const AnyImage           pictures = MakePictures(80, 60, 0, 3);
  unsigned char *          begin = CastImage<unsigned char>(pictures).GetBufferPointer();
  for (std::size_t n = 0; n < std::size_t{ 80 } * 60 * 3; ++n)
  {
    begin[n] = colour[n % 3];
  }
  const auto pixels = Draw(pictures, frames, { true, true });
  ASSERT_EQ(pixels.size(), 80u * 60u * 3u);
  for (unsigned int component = 0; component < 3; ++component)
  {
    const auto grey = Draw(MakePictures(80, 60, colour[component]), frames, { true, true });
    for (std::size_t n = 0; n < grey.size(); ++n)
    {
      ASSERT_EQ(pixels[3 * n + component], grey[n]) << n;
    }
  }
}

TEST(Labels, AnglesAreAtTheTopLeft)
{
  const auto read = [](unsigned long size, double azimuth, double elevation) {
    const auto pixels =
      Draw(MakePictures(size, size, 0), { MakeFrame(Direction::Anterior, azimuth, elevation) }, scaleAndAngles);
    const long width = static_cast<long>(size);
    return std::make_pair(ReadLabel(pixels, width, { 0, 0, width, 11 }),
                          ReadLabel(pixels, width, { 0, 11, width, 11 }));
  };
  const auto expect = [&](double azimuth, double elevation, const std::string & text) {
    EXPECT_EQ(read(196, azimuth, elevation), std::make_pair(text, std::string()));
  };
  expect(30.0, 15.0, "LAO 30 CRA 15");
  expect(0.0, 0.0, "LAO 0 CRA 0");
  expect(-1e-9, -1e-9, "LAO 0 CRA 0");
  expect(-82.5, -12.46, "RAO 82.5 CAU 12.5");
  expect(90.0, 67.89, "LAO 90 CRA 67.9");
  expect(135.0, 0.0, "LAO 135 CRA 0");
  expect(-134.0, 0.0, "RAO 134 CRA 0");
  expect(-179.99, 5.0, "LAO 180 CRA 5");
  EXPECT_EQ(read(100, 30.0, 15.0), std::make_pair(std::string("LAO 30"), std::string("CRA 15")));
  EXPECT_EQ(read(64, 30.0, 0.0), std::make_pair(std::string(), std::string()));
}

TEST(Labels, ScaleHasARoundLength)
{
  struct Case
  {
    unsigned long width;
    double        spacing, scale;
    std::string   text;
    double        pixels;
  };
  for (const Case & given : { Case{ 400, 1.0, 1.0, "100 mm", 100.0 },
                              Case{ 400, 0.5, 1.0, "50 mm", 100.0 },
                              Case{ 400, 0.499, 1.0, "20 mm", 20.0 / 0.499 },
                              Case{ 400, 0.1, 1.0, "10 mm", 100.0 },
                              Case{ 400, 0.099, 1.0, "5 mm", 5.0 / 0.099 },
                              Case{ 256, 0.39, 1.0, "20 mm", 20.0 / 0.39 },
                              Case{ 1000, 4.0, 1.0, "1000 mm", 250.0 },
                              Case{ 400, 0.02, 1.0, "2 mm", 100.0 },
                              Case{ 400, 0.01, 1.0, "1 mm", 100.0 },
                              Case{ 100, 0.01, 1.0, "0.2 mm", 20.0 },
                              Case{ 400, 1e-3, 1.0, "0.1 mm", 100.0 },
                              Case{ 400, 9.9e-4, 1.0, "50 um", 0.05 / 9.9e-4 },
                              Case{ 400, 1e-4, 1.0, "10 um", 100.0 },
                              Case{ 400, 1e-6, 1.0, "0.1 um", 100.0 },
                              Case{ 400, 9.9e-7, 1.0, "50 nm", 5e-5 / 9.9e-7 },
                              Case{ 400, 2e-9, 1.0, "0.2 nm", 100.0 },
                              Case{ 400, 0.5, 3.0, "100 mm", 100.0 / 1.5 } })
  {
    SCOPED_TRACE(given.text);
    const AnyImage pictures = MakePictures(given.width, 100, 0);
    const double   spacing[] = { given.spacing, 17.0, 1.0 };
    pictures.image->SetSpacing(spacing);
    Frame frame;
    frame.transform =
      MakeColumns(MakeVector(0, given.scale, 0), MakeVector(0, 0, -9), MakeVector(-7, 0, 0)).GetPointer();
    const auto pixels = Draw(pictures, { frame }, scaleAndAngles);
    const long width = static_cast<long>(given.width);
    EXPECT_EQ(ReadLabel(pixels, width, { 0, 80, width, 14 }), given.text);

    // the bar is the last bright row, its ticks are in the row above
    const auto begin = pixels.begin() + 95 * width;
    double     sum[2] = { 0.0, 0.0 };
    double     moment[2] = { 0.0, 0.0 };
    for (long x = 0; x < width; ++x)
    {
      const int side = static_cast<double>(x) > 3.0 + 0.5 * given.pixels ? 1 : 0;
      sum[side] += begin[x];
      moment[side] += static_cast<double>(x) * begin[x];
    }
    EXPECT_NEAR(moment[1] / sum[1] - moment[0] / sum[0], given.pixels, 0.1);
    EXPECT_NEAR(sum[1], 255.0, 60.0);
  }
}

TEST_F(ShearWarpMIPProgram, LettersAreAtTheLandmarksSides)
{
  this->WriteLandmark();
  for (const std::string view : { "anterior", "posterior", "left", "right", "superior", "inferior" })
  {
    SCOPED_TRACE(view);
    const std::string options = " --size 64 60 --output-spacing 0.25 --view " + view;
    this->ExpectSuccess("landmark.nrrd plain.png --no-labels" + options);
    // without the landmark
    this->ExpectSuccess("landmark.nrrd labelled.png --mode minimum" + options,
                        "shear-warp-mip: warning: there is only background in the picture: it has only the value 0\n");
    const std::string landmark = FindLandmark(this->ReadPixels("plain.png"), 64);
    const auto        letters = ReadLetters(this->ReadPixels<GreyType>("labelled.png"), 64);
    // the landmark is at the left, anterior, superior
    const bool isAtRight = landmark.find("right") != std::string::npos;
    const bool isAtBottom = landmark.find("bottom") != std::string::npos;
    EXPECT_NE(std::string("LAH").find(letters[isAtRight ? 1 : 0]), std::string::npos) << letters[0] << letters[1];
    EXPECT_NE(std::string("RPF").find(letters[isAtRight ? 0 : 1]), std::string::npos) << letters[0] << letters[1];
    EXPECT_NE(std::string("LAH").find(letters[isAtBottom ? 3 : 2]), std::string::npos) << letters[2] << letters[3];
    EXPECT_NE(std::string("RPF").find(letters[isAtBottom ? 2 : 3]), std::string::npos) << letters[2] << letters[3];
  }
}

TEST_F(ShearWarpMIPProgram, OnlyPicturesHaveLabels)
{
  std::vector<std::string>            bytes;
  std::vector<std::vector<PixelType>> dicom;
  for (const std::string labels : { "--annotate", "--no-labels" })
  {
    const Result result = this->Run(
      "in.nrrd values.nrrd --depth depth.nrrd --dicom-out dicom --frames 4 --size 64 60 --output-spacing 0.3 " +
      labels);
    EXPECT_EQ(result.status, 0);
    EXPECT_EQ(result.messages.find("shear-warp-mip: note: " + labels + " has no effect"), 0u) << result.messages;
    bytes.push_back(ReadText(m_Folder / "values.nrrd") + ReadText(m_Folder / "depth.nrrd"));
    dicom.push_back(this->ReadPixels("dicom/frame-002.dcm"));
    fs::remove_all(m_Folder / "dicom");
  }
  EXPECT_TRUE(bytes[0] == bytes[1]);
  EXPECT_EQ(dicom[0], dicom[1]);
}

/** A picture of a file, of 1 or 3 components. */
AnyImage
ReadPicture(const std::string & path, unsigned int components)
{
  const auto picture = itk::ReadImage<itk::VectorImage<unsigned char, 2>>(path);
  const auto size = picture->GetBufferedRegion().GetSize();
  if (picture->GetNumberOfComponentsPerPixel() != components)
  {
    throw std::runtime_error(path + " has not " + std::to_string(components) + " components");
  }
  AnyImage copy = MakePictures(size[0], size[1], 0, components);
  std::copy_n(
    picture->GetBufferPointer(), size[0] * size[1] * components, CastImage<unsigned char>(copy).GetBufferPointer());
  return copy;
}

TEST_F(ShearWarpMIPProgram, LabelsAreDrawnOverThePictures)
{
  const std::string input = "in.nrrd out.png --size 196 100 --output-spacing 0.1 --window 0 100 --frames 4 --mode "
                            "minimum --depth-colour z.png ";
  const auto        readAll = [this](const std::string & options) {
    this->ExpectSuccess(options);
    std::vector<AnyImage> pictures;
    for (std::size_t n = 0; n < 4; ++n)
    {
      const std::string end = "-00" + std::to_string(n) + ".png";
      pictures.push_back(ReadPicture(this->GetPath("out" + end), 1));
      pictures.push_back(ReadPicture(this->GetPath("z" + end), 3));
    }
    return pictures;
  };
  for (const bool isAnnotated : { false, true })
  {
    const auto plain = readAll(input + "--no-labels");
    const auto labelled = readAll(input + (isAnnotated ? "--annotate" : ""));
    for (std::size_t n = 0; n < plain.size(); ++n)
    {
      const double      spacing[] = { 0.1, 0.1, 1.0 };
      const std::size_t view = n / 2;
      plain[n].image->SetSpacing(spacing);
      const auto expected =
        Draw(plain[n], { MakeFrame(Direction::Anterior, 90.0 * static_cast<double>(view)) }, { true, isAnnotated });
      EXPECT_TRUE(Draw(labelled[n], {}, {}) == expected) << n;
    }
  }
}

TEST_F(ShearWarpMIPProgram, WritesOtherPictures)
{
  const std::string options = " --size 196 100 --output-spacing 0.1 --window 0 100 --frames 2 --depth-colour ";
  this->ExpectSuccess("in.nrrd out.png" + options + "z.png");
  for (const std::string extension : { ".jpg", ".jpeg", ".tif", ".tiff" })
  {
    SCOPED_TRACE(extension);
    this->ExpectSuccess("in.nrrd out" + extension + options + "z" + extension);
    for (const auto & [name, components] : { std::pair("out-001", 1u), std::pair("z-001", 3u) })
    {
      const auto one = Draw(ReadPicture(this->GetPath(std::string(name) + ".png"), components), {}, {});
      const auto other = Draw(ReadPicture(this->GetPath(name + extension), components), {}, {});
      double     sum = 0.0;
      ASSERT_EQ(one.size(), other.size());
      for (std::size_t n = 0; n < one.size(); ++n)
      {
        sum += std::abs(one[n] - other[n]);
      }
      EXPECT_LE(sum / static_cast<double>(one.size()), extension[1] == 't' ? 0.0 : 6.0);
    }
  }
}
} // namespace
