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
#include "ShearWarpMIPProgramTestHelper.h"

#include "itkShearWarpMIPCineImageFilter.h"

#include "itksys/SystemTools.hxx"

namespace
{
using namespace ShearWarpMIPProgramTest;

class ShearWarpMIPProgramSeries : public ShearWarpMIPProgram
{
protected:
  using CineType = itk::ShearWarpMIPCineImageFilter<VolumeType>;

  /** The frames that the program writes are the filter's frames, on the filter's grid. */
  void
  ExpectFrames(const std::string & arguments, const std::function<void(CineType &)> & setUp) const
  {
    SCOPED_TRACE(arguments);
    const auto cine = CineType::New();
    cine->SetInput(m_Volume);
    cine->SetTransform(this->MakeTransform(Direction::Anterior));
    setUp(*cine);
    cine->Update();
    this->ExpectSuccess("in.nrrd out.nrrd " + arguments);
    const auto stack = this->Read<VolumeType>("out.nrrd");
    EXPECT_EQ(stack->GetBufferedRegion(), cine->GetOutput()->GetBufferedRegion());
    EXPECT_LT(stack->GetOrigin().EuclideanDistanceTo(cine->GetOutput()->GetOrigin()), 1e-9);
    EXPECT_EQ(GetPixels(stack), GetPixels(cine->GetOutput()));
  }

  /** Whether there is ffmpeg, which reads animations here too. */
  static bool
  CanAnimate()
  {
    return !itksys::SystemTools::FindProgram("ffmpeg").empty();
  }
};

class ShearWarpMIPProgramSeriesAnimated : public ShearWarpMIPProgramSeries
{
protected:
  void
  SetUp() override
  {
    ShearWarpMIPProgramSeries::SetUp();
    if (!CanAnimate())
    {
      GTEST_SKIP() << "no ffmpeg";
    }
  }

  /** The pixels of an animation, the frames one after the other. */
  std::string
  Decode(const std::string & name, const std::string & format) const
  {
    const std::string command = "ffmpeg -nostdin -v error -i '" + this->GetPath(name) +
                                "' -fps_mode passthrough -f rawvideo -pix_fmt " + format + " '" +
                                this->GetPath("frames.raw") + "'";
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    std::string frames = ReadText(m_Folder / "frames.raw");
    fs::remove(m_Folder / "frames.raw");
    return frames;
  }

  template <typename TPixel>
  std::string
  ReadPictures(unsigned int count) const
  {
    std::string frames;
    for (unsigned int n = 0; n < count; ++n)
    {
      const auto picture = this->Read<itk::Image<TPixel, 2>>("out-00" + std::to_string(n) + ".png");
      frames.append(reinterpret_cast<const char *>(picture->GetBufferPointer()),
                    picture->GetBufferedRegion().GetNumberOfPixels() * sizeof(TPixel));
    }
    return frames;
  }
};

TEST_F(ShearWarpMIPProgramSeries, TurnsAsTheFilter)
{
  const double oblique[] = { -1.0, 0.5, 2.0 };
  const double center[] = { -30.0, 15.0, 7.5 };
  this->ExpectFrames("--frames 7 --rotation-axis -1,0.5,2 --center -30,15,7.5", [&](CineType & cine) {
    cine.SetNumberOfFrames(7);
    cine.SetRotationAxis(oblique);
    cine.SetCenter(center);
  });
  this->ExpectFrames("--frames 4 --angular-range -90", [](CineType & cine) {
    cine.SetNumberOfFrames(4);
    cine.SetAngularRange(-90.0);
  });
  this->ExpectFrames("--frames 6 --rocking --angular-range 50 --elevation 15", [this](CineType & cine) {
    cine.SetNumberOfFrames(6);
    cine.SetTransform(this->MakeTransform(Direction::Anterior, 0.0, 15.0));
    cine.SetAngularRange(50.0);
    cine.RockingOn();
  });
}

TEST_F(ShearWarpMIPProgramSeries, TurnsAboutAxesOfTheImage)
{
  VolumeType::DirectionType direction;
  const double              values[] = { 0.6, 0.0, -0.8, 0.8, 0.0, 0.6, 0.0, -1.0, 0.0 };
  std::copy(std::begin(values), std::end(values), direction.GetVnlMatrix().begin());
  m_Volume->SetDirection(direction);
  this->WriteImage(m_Volume, "in.nrrd");
  for (unsigned int column = 0; column < 3; ++column)
  {
    this->ExpectFrames(std::string("--frames 3 --rotation-axis ") + "ijk"[column], [&](CineType & cine) {
      cine.SetNumberOfFrames(3);
      const double axis[] = { direction(0, column), direction(1, column), direction(2, column) };
      cine.SetRotationAxis(axis);
    });
  }
}

TEST_F(ShearWarpMIPProgramSeries, TakesAListOfTransforms)
{
  const auto first = this->MakeTransform(Direction::Left, 10.0);
  const auto second = this->MakeTransform(Direction::Superior, 0.0, 20.0);
  this->WriteTransforms("views.tfm", { first, second });
  this->ExpectFrames("--transform views.tfm", [&](CineType & cine) {
    cine.AddTransform(first);
    cine.AddTransform(second);
  });
  this->ExpectSuccess("in.nrrd out.png --transform views.tfm",
                      "shear-warp-mip: note: 'out.png' becomes 2 numbered files\n");
  EXPECT_TRUE(fs::exists(m_Folder / "out-001.png"));
  fs::remove(m_Folder / "out.nrrd");
  this->ExpectFailure("in.nrrd out.nrrd --transform views.tfm --frames 3",
                      "--frames is not possible: 'views.tfm' holds 2");
  this->ExpectFailure("in.nrrd out.nrrd --transform views.tfm --sliding-slab 3 1", "--sliding-slab is not possible");
  this->ExpectFailure("in.nrrd out.nrrd --transform views.tfm --in-place", "--in-place is not possible");
}

TEST_F(ShearWarpMIPProgramSeries, TurnsAboutEachAxis)
{
  this->WriteLandmark();
  // after a quarter of a turn from anterior: seen from the left, from below, and with the right side down
  const std::map<std::string, std::string> expected = { { "superior", "top left" },
                                                        { "left", "top right" },
                                                        { "posterior", "top left" } };
  for (const auto & [axis, place] : expected)
  {
    this->ExpectSuccess("landmark.nrrd out.nrrd --frames 4 --rotation-axis " + axis);
    const auto stack = this->Read<VolumeType>("out.nrrd");
    const auto size = stack->GetBufferedRegion().GetSize();
    ASSERT_EQ(size[2], 4u);
    const auto * const frame = stack->GetBufferPointer() + size[0] * size[1];
    EXPECT_EQ(FindLandmark({ frame, frame + size[0] * size[1] }, size[0]), place) << axis;
  }
}

TEST_F(ShearWarpMIPProgramSeries, StacksFramesOnOneGrid)
{
  this->ExpectSuccess("in.nrrd out.nrrd --frames 5 --elevation 10 --background 3");
  const auto stack = this->Read<VolumeType>("out.nrrd");
  const auto size = stack->GetBufferedRegion().GetSize();
  ASSERT_EQ(size[2], 5u);
  EXPECT_EQ(stack->GetSpacing()[2], 1.0);

  itk::SizeValueType widest = 0;
  for (unsigned int k = 0; k < 5; ++k)
  {
    const auto turn = itk::AffineTransform<double, 3>::New();
    turn->SetCenter(itk::ShearWarpMIPView::GetCenter(m_Volume));
    turn->Rotate3D(MakeVector(0.0, 0.0, 1.0), k * itk::Math::twopi / 5);
    const auto transform = this->MakeTransform(Direction::Anterior, 0.0, 10.0);
    transform->Compose(turn);
    widest = std::max(widest, this->Project(transform)->GetBufferedRegion().GetSize(0));

    const auto         expected = this->Project(transform, [&](FilterType & filter) {
      filter.SetSize({ { size[0], size[1] } });
      filter.SetOutputSpacing(itk::Vector<double, 2>(stack->GetSpacing().GetDataPointer()));
      filter.SetOutputOrigin(itk::Point<double, 2>(stack->GetOrigin().GetDataPointer()));
      filter.SetDefaultPixelValue(3);
    });
    const auto         pixels = GetPixels(expected);
    const auto * const frame = stack->GetBufferPointer() + k * pixels.size();
    for (std::size_t i = 0; i < pixels.size(); ++i)
    {
      ASSERT_NEAR(frame[i], pixels[i], 1) << "frame " << k << ", pixel " << i;
    }
  }
  EXPECT_GE(size[0], widest);
  EXPECT_LE(size[0], widest + 1);
}

TEST_F(ShearWarpMIPProgramSeries, NumbersPictures)
{
  this->ExpectSuccess("in.nrrd out.png --frames 3 --window 0 100");
  EXPECT_FALSE(fs::exists(m_Folder / "out.png"));
  EXPECT_FALSE(fs::exists(m_Folder / "out-003.png"));
  const auto size = this->Read("out-000.png")->GetBufferedRegion();
  EXPECT_EQ(this->Read("out-001.png")->GetBufferedRegion(), size);
  EXPECT_EQ(this->Read("out-002.png")->GetBufferedRegion(), size);
  EXPECT_EQ(this->GetContents().size(), 4u);
}

TEST_F(ShearWarpMIPProgramSeriesAnimated, ExactGreys)
{
  const std::string input = "--frames 5 --rocking --angular-range 40 --window 0 100 in.nrrd ";
  this->ExpectSuccess(input + "out.png");
  const std::string expected = this->ReadPictures<unsigned char>(5);
  for (const std::string name : { "turn.gif", "turn.apng" })
  {
    this->ExpectSuccess(input + name + " --rate 12.5");
    EXPECT_TRUE(this->Decode(name, "gray") == expected) << name;
  }
  const std::string gif = ReadText(m_Folder / "turn.gif");
  // for ever, and eight hundredths of a second each
  EXPECT_NE(gif.find(std::string("NETSCAPE2.0\x03\x01\0\0\0", 16)), std::string::npos);
  EXPECT_NE(gif.find(std::string("\x08\0", 2), gif.find("\x21\xf9\x04")), std::string::npos);
}

TEST_F(ShearWarpMIPProgramSeriesAnimated, Video)
{
  // odd sizes get a margin
  const std::string options = " --frames 5 --rocking --angular-range 40 --window 0 100 --size 31 27";
  this->ExpectSuccess("in.nrrd out.png" + options);
  const std::string expected = this->ReadPictures<unsigned char>(5);
  this->ExpectSuccess("in.nrrd turn.mp4" + options);
  const std::string frames = this->Decode("turn.mp4", "gray");
  ASSERT_EQ(frames.size(), std::size_t{ 5 } * 32 * 28);
  constexpr std::size_t columns = 31;
  constexpr std::size_t rows = 27;
  double                sum = 0.0;
  for (std::size_t n = 0; n < expected.size(); ++n)
  {
    const std::size_t frame = n / (columns * rows);
    const std::size_t row = n / columns % rows;
    const auto grey = static_cast<unsigned char>(frames[(frame * (rows + 1) + row) * (columns + 1) + n % columns]);
    sum += std::abs(static_cast<double>(grey) - static_cast<unsigned char>(expected[n]));
  }
  EXPECT_LT(sum / static_cast<double>(expected.size()), 4.0);
}

TEST_F(ShearWarpMIPProgramSeriesAnimated, Colours)
{
  const std::string options = "in.nrrd values.nrrd --frames 3 --window 0 100 --depth-colour ";
  this->ExpectSuccess(options + "out.png");
  this->ExpectSuccess(options + "turn.apng");
  this->ExpectSuccess(options + "turn.gif");
  const std::string expected = this->ReadPictures<itk::RGBPixel<unsigned char>>(3);
  EXPECT_TRUE(this->Decode("turn.apng", "rgb24") == expected);
  EXPECT_EQ(this->Decode("turn.gif", "rgb24").size(), expected.size());
}

TEST_F(ShearWarpMIPProgramSeriesAnimated, Still)
{
  this->ExpectSuccess("in.nrrd 'a strange: name%d.gif' --window 0 100 --frames 1");
  this->ExpectSuccess("in.nrrd still.png --window 0 100");
  const auto pixels = this->ReadPixels<itk::Image<unsigned char, 2>>("still.png");
  EXPECT_TRUE(this->Decode("a strange: name%d.gif", "gray") == std::string(pixels.begin(), pixels.end()));
  EXPECT_EQ(this->GetContents().size(), 3u);
}

TEST_F(ShearWarpMIPProgramSeries, LeavesNothingWhereAnimationsFail)
{
  this->ExpectFailure(
    "in.nrrd out.gif --frames 1", "needs the program ffmpeg, which is not installed", "PATH=/nowhere");
  fs::create_directory(m_Folder / "bin");
  const auto expectFailure = [this](const std::string & script, const std::string & mention) {
    std::ofstream(m_Folder / "bin" / "ffmpeg") << "#!/bin/sh\n" << script << '\n';
    fs::permissions(m_Folder / "bin" / "ffmpeg", fs::perms::owner_all);
    for (const std::string extension : { "gif", "apng", "mp4" })
    {
      this->ExpectFailure("in.nrrd out." + extension + " --frames 3", mention, "PATH=\"$PWD/bin:$PATH\"");
    }
  };
  expectFailure("echo broken >&2; exit 3", "ffmpeg failed: broken");
  expectFailure("kill -KILL $$", "ffmpeg failed");
  // says that all is well but what it wrote cannot be read
  expectFailure("case \"$*\" in *null*) echo no picture; exit 1 ;; esac", "ffmpeg failed: no picture");
  if (CanAnimate())
  {
    this->ExpectFailure("in.nrrd out.gif --frames 1 --output-spacing 0.1", "out.gif", "trap '' XFSZ && ulimit -f 3 &&");
  }
}

TEST_F(ShearWarpMIPProgramSeries, LeavesNoAnimationOnAFullDisk)
{
  fs::create_directory(m_Folder / "disk");
  const std::string disk = this->GetPath("disk");
  if (!CanAnimate() || std::system(("mount -t tmpfs -o size=160k tmpfs '" + disk + "' 2>/dev/null").c_str()) != 0)
  {
    GTEST_SKIP() << "no ffmpeg, or no right to mount a small disk";
  }
  // there is room for the pictures, 150 kB, but not for the animation
  for (const std::string name : { "disk/out.gif", "disk/out.apng", "disk/out.mp4" })
  {
    this->ExpectFailure("in.nrrd " + name + " --frames 60 --size 50 50 --output-spacing 0.3", name);
  }
  EXPECT_EQ(std::system(("umount '" + disk + "'").c_str()), 0);
}

TEST_F(ShearWarpMIPProgramSeries, RefusesWrongOptions)
{
  for (const std::string axis : { "up", "1,2", "1,2,3,4", "1,2,x", "nan,0,1", "left,posterior,superior" })
  {
    this->ExpectFailure("in.nrrd out.png --frames 2 --rotation-axis " + axis, "--rotation-axis: it must be");
  }
  this->ExpectFailures("in.nrrd out.png ",
                       { "--rotation-axis left", "--center 1,2,3", "--angular-range 90", "--rocking" },
                       "requires --frames");
  this->ExpectFailures("in.nrrd out.png --frames 2 --center ", { "1,2", "1,2,inf" }, "--center");
  this->ExpectFailure("in.nrrd out.png --frames 2 --angular-range nan", "--angular-range");
  this->ExpectFailure("in.nrrd out.png --rate 0", "--rate");
  for (const std::string output : { "out.gif", "out.png", "out.html" })
  {
    this->ExpectFailure("in.nrrd --in-place " + output,
                        "--in-place: '" + output + "' must have one of the extensions .mha .nrrd .nii .nii.gz");
  }
}
} // namespace
