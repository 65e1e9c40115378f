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

#include "Help.h"
#include "Options.h"
#include "Picture.h"

#include <regex>
#include <set>

namespace
{
using namespace ShearWarpMIPProgramTest;

/** Files of frames, and what the program makes of them without the volume. */
class ShearWarpMIPProgramStack : public ShearWarpMIPProgram
{
protected:
  void
  SetUp() override
  {
    ShearWarpMIPProgram::SetUp();
    const auto volume = MakeImage<VolumeType>({ { 60, 56, 52 } }, { 0.7, 0.9, 1.3 }, { -40.0, 12.5, 3.0 });
    itk::ImageRegionIteratorWithIndex<VolumeType> it(volume, volume->GetBufferedRegion());
    for (; !it.IsAtEnd(); ++it)
    {
      const auto & index = it.GetIndex();
      it.Set(static_cast<PixelType>((7 * index[0] + 5 * index[1] + 11 * index[2]) % 701 - 100));
    }
    auto turned = volume->GetDirection();
    turned[0][0] = turned[1][1] = 0.8;
    turned[0][1] = -0.6;
    turned[1][0] = 0.6;
    volume->SetDirection(turned);
    this->WriteImage(volume, "large.nrrd");
  }

  /** That each of \a outputs, a name with options, is the same of frames in files as it is of the volume. */
  void
  ExpectSame(const std::string & volume, const std::string & projection, const std::vector<std::string> & outputs) const
  {
    SCOPED_TRACE(projection);
    std::vector<std::map<std::string, std::string>> made;
    for (const std::string & input : { volume + ' ' + projection, std::string("turn.nrrd"), std::string("turn.mha") })
    {
      if (input.find("turn") == 0)
      {
        this->ExpectSuccess(volume + ' ' + input + ' ' + projection);
      }
      const std::string rest = input.substr(input.find(' ') == std::string::npos ? input.size() : input.find(' '));
      const std::string name = input.substr(0, input.find(' '));
      made.emplace_back();
      for (const std::string & output : outputs)
      {
        fs::create_directory(m_Folder / "made");
        EXPECT_EQ(this->Run(name + " made/" + output + rest).status, 0) << output;
        for (const fs::path & file : ListFiles(m_Folder / "made"))
        {
          made.back()[output + ": " + file.filename().string()] = ReadText(file);
        }
        fs::remove_all(m_Folder / "made");
      }
    }
    EXPECT_GE(made[0].size(), outputs.size());
    EXPECT_TRUE(made[0] == made[1]);
    EXPECT_TRUE(made[0] == made[2]);
  }

  /** The texts of a DICOM file, but what each writing makes anew. */
  Tags
  ReadTags(const fs::path & path) const
  {
    const auto io = itk::GDCMImageIO::New();
    io->SetFileName(path.string());
    io->LoadPrivateTagsOn();
    io->ReadImageInformation();
    Tags tags;
    for (const std::string & key : io->GetMetaDataDictionary().GetKeys())
    {
      itk::ExposeMetaData<std::string>(io->GetMetaDataDictionary(), key, tags[key]);
    }
    for (const std::string key : { "0008|0012",
                                   "0008|0013",
                                   "0008|0018",
                                   "0008|0021",
                                   "0008|0023",
                                   "0008|0031",
                                   "0008|0033",
                                   "0020|000d",
                                   "0020|000e",
                                   "0020|0052",
                                   "0002|0003" })
    {
      tags.erase(key);
    }
    return tags;
  }

  void
  ExpectSameDicom(const std::string & one, const std::string & other) const
  {
    const auto files = ListFiles(m_Folder / one);
    const auto others = ListFiles(m_Folder / other);
    ASSERT_EQ(files.size(), others.size());
    for (std::size_t n = 0; n < files.size(); ++n)
    {
      EXPECT_EQ(this->ReadTags(files[n]), this->ReadTags(others[n]));
      EXPECT_EQ(GetPixels(itk::ReadImage<itk::Image<int, 3>>(files[n].string())),
                GetPixels(itk::ReadImage<itk::Image<int, 3>>(others[n].string())));
    }
  }

  /** Writes the file of frames \a name, with \a key as \a text; without it if that is empty. */
  void
  WriteChanged(const std::string & name, const std::string & key, const std::string & text) const
  {
    std::istringstream lines(ReadText(m_Folder / "turn.nrrd"));
    std::ofstream      file(m_Folder / name, std::ios::binary);
    bool               isHeader = true;
    for (std::string line; isHeader && std::getline(lines, line); isHeader = !line.empty())
    {
      if (line.empty() && !text.empty())
      {
        file << key << ":=" << text << '\n';
      }
      if (line.find(key + ":=") != 0)
      {
        file << line << '\n';
      }
    }
    file << lines.rdbuf();
  }

  const std::vector<std::string> m_Outputs = { "a.png",
                                               "a.png --window 0 400 --no-labels",
                                               "a.tif --wl 200 300 --annotate",
                                               "a.html",
                                               "a.html --page-bits 16 --no-labels",
                                               "a.nrrd",
                                               "a.mha",
                                               "a.nii" };
};

TEST_F(ShearWarpMIPProgramStack, IsWrittenAsTheVolumeIs)
{
  this->ExpectSame("large.nrrd", "--frames 12", m_Outputs);
  this->ExpectSame("large.nrrd", "--frames 2 --rocking --angular-range 40 --elevation 20", m_Outputs);
  this->ExpectSame("large.nrrd", "--frames 4 --elevations=-30,0,30 --mode minimum", m_Outputs);
  this->ExpectSame("large.nrrd", "--frames 5 --angular-range 200 --background=-200", m_Outputs);
  this->ExpectSame("large.nrrd", "--sliding-slab 10 5 --view superior", m_Outputs);
  this->ExpectSame("large.nrrd", "--azimuth 33 --elevation 21 --slab -10 inf", m_Outputs);
  this->ExpectSame("large.nrrd", "--frames 3 --rocking --angular-range 30", { "a.html --rate 3", "a.png --annotate" });
}

TEST_F(ShearWarpMIPProgramStack, IsAnimatedAsTheVolumeIs)
{
  if (std::system("ffmpeg -version >/dev/null 2>&1") != 0)
  {
    GTEST_SKIP() << "ffmpeg is not installed";
  }
  this->ExpectSame("large.nrrd", "--frames 6", { "a.gif", "a.apng --annotate --rate 20", "a.mp4" });
}

TEST_F(ShearWarpMIPProgramStack, KeepsColours)
{
  using ColourType = itk::VectorImage<unsigned char, 3>;
  const auto colours = MakeImage<ColourType>({ { 50, 50, 50 } }, 3);
  for (itk::SizeValueType n = 0; n < 375000; ++n)
  {
    colours->GetBufferPointer()[n] = static_cast<unsigned char>(n % 253);
  }
  this->WriteImage(colours, "colours.nrrd");
  this->ExpectSame("colours.nrrd", "--frames 3", { "a.png", "a.html", "a.nrrd" });
  this->ExpectFailure("turn.nrrd dicom/", "A DICOM series is not possible: 'turn.nrrd' has 3 components");
  this->ExpectFailure("turn.nrrd a.html --page-bits 16",
                      "--page-bits 16 is not possible: 'turn.nrrd' has 3 components");
}

TEST_F(ShearWarpMIPProgramStack, HasMoreTextThanALineOfMetaImage)
{
  this->ExpectSame("in.nrrd", "--frames 700 --size 8 8", { "a.html" });
  const auto keys = itk::ReadImage<VolumeType>(this->GetPath("turn.mha"))->GetMetaDataDictionary();
  EXPECT_TRUE(keys.HasKey("FrameTransforms.2"));
}

TEST_F(ShearWarpMIPProgramStack, BecomesTheSameDicom)
{
  for (const std::string projection : { "--frames 5", "--frames 5 --mode minimum --slab -3 9", "--sliding-slab 9 8" })
  {
    SCOPED_TRACE(projection);
    for (const std::string output : { "", "--window 0 300", "--multi-frame" })
    {
      this->ExpectSuccess("large.nrrd turn.nrrd " + projection);
      this->ExpectSuccess("large.nrrd one/ " + projection + ' ' + output);
      this->ExpectSuccess("turn.nrrd other/ " + output);
      this->ExpectSameDicom("one", "other");
      fs::remove_all(m_Folder / "one");
      fs::remove_all(m_Folder / "other");
    }
  }
}

TEST_F(ShearWarpMIPProgramStack, HasNothingOfThePatient)
{
  const Tags tags{ { "0010|0010", "Doe^Jane" }, { "0008|0016", "1.2.840.10008.5.1.4.1.1.4" } };
  this->WriteDICOMSeries("1.2.3.4", "", { 0.0, 2.0, 4.0 }, 8, false, tags);
  this->ExpectSuccess("dicom turn.nrrd --frames 3");
  const std::string text = ReadText(m_Folder / "turn.nrrd");
  EXPECT_EQ(text.find("Doe"), std::string::npos);
  EXPECT_EQ(text.find('|'), std::string::npos);
  EXPECT_EQ(text.find("dicom"), std::string::npos);
  this->ExpectSuccess("turn.nrrd a.html");
  EXPECT_NE(ReadText(m_Folder / "a.html").find("\"Maximum intensity projection\""), std::string::npos);
}

TEST_F(ShearWarpMIPProgramStack, TakesWhatItsSourcesSayOnlyIfTrusted)
{
  const Tags tags{ { "0010|0010", "Doe^Jane" }, { "0008|0016", "1.2.840.10008.5.1.4.1.1.4" } };
  this->WriteDICOMSeries("1.2.3.4", "", { 0.0, 2.0, 4.0 }, 8, false, tags);
  this->ExpectSuccess("dicom turn.nrrd --frames 3");
  this->ExpectSuccess("dicom one/ --frames 3");
  // a name with a newline, a percent sign and a byte that is no UTF-8
  fs::rename(m_Folder / "dicom/1.dcm", m_Folder / "dicom/1\n%41\xff.dcm");
  const std::string folder = this->GetPath("dicom/");
  this->WriteChanged(
    "from.nrrd", "SourceFiles", folder + "0.dcm " + folder + "1%0A%2541%FF.dcm " + folder + "2.dcm gone");
  this->ExpectSuccess("from.nrrd other/ --trust dicom/../from.nrrd");
  this->ExpectSameDicom("one", "other");
  this->WriteChanged("turn.nrrd", "0010|0010", "Doe^Jane");
  this->ExpectSuccess("turn.nrrd third/ --trust=turn.nrrd");
  EXPECT_EQ(this->ReadTags(m_Folder / "third/frame-001.dcm").at("0010|0010").substr(0, 8), "Doe^Jane");

  for (const std::string input : { "from.nrrd", "turn.nrrd" })
  {
    this->ExpectSuccess(input + " of-nobody/");
    EXPECT_EQ(ReadText(m_Folder / "of-nobody/frame-001.dcm").find("Doe"), std::string::npos) << input;
    fs::remove_all(m_Folder / "of-nobody");
  }
}

TEST_F(ShearWarpMIPProgramStack, IsTrustedOnlyIfRead)
{
  const std::string refusal = "' is not read: it must be INPUT, or the file of --mask, --overlay or --segments";
  this->ExpectSuccess("large.nrrd turn.nrrd --frames 3");
  this->ExpectFailure("turn.nrrd out.png --trust turn.nrrd --trust large.nrrd", "--trust: 'large.nrrd" + refusal);
  this->ExpectFailure("large.nrrd out.png --trust none.nrrd", "--trust: 'none.nrrd" + refusal);
  this->ExpectFailure("none.nrrd out.png --trust none.nrrd", "'none.nrrd' does not exist");
}

TEST_F(ShearWarpMIPProgramStack, IsInvertedAndHasUnitsAsItsKeysSay)
{
  this->ExpectSuccess("large.nrrd turn.nrrd --frames 3 --rocking --angular-range 20");
  this->WriteChanged("inverted.nrrd", "IsInverted", "1");
  this->WriteChanged("nowhere.nrrd", "HasOrientation", "0");
  this->WriteChanged("small.nrrd", "Unit", "um");
  this->ExpectSuccess("turn.nrrd a.png --no-labels");
  this->ExpectSuccess("inverted.nrrd b.png --no-labels");
  auto expected = this->ReadPixels<itk::Image<unsigned char, 2>>("a-001.png");
  for (unsigned char & pixel : expected)
  {
    pixel = static_cast<unsigned char>(255 - pixel);
  }
  EXPECT_TRUE((this->ReadPixels<itk::Image<unsigned char, 2>>("b-001.png") == expected));
  this->ExpectSuccess("inverted.nrrd one/");
  EXPECT_EQ(this->ReadTags(m_Folder / "one/frame-001.dcm").at("0028|0004").substr(0, 11), "MONOCHROME1");
  this->ExpectFailure("inverted.nrrd two/ --multi-frame", "MONOCHROME1");
  EXPECT_EQ(this->Run("nowhere.nrrd a.html").status, 0);
  EXPECT_EQ(ReadText(m_Folder / "a.html").find("\"letters\": ["), std::string::npos);
  this->ExpectSuccess("small.nrrd b.html");
  EXPECT_NE(ReadText(m_Folder / "b.html").find("\"spacing\": [0.00069999"), std::string::npos);
  this->WriteChanged("odd.nrrd", "Unit", "furlong");
  this->ExpectWarning("odd.nrrd c.html", "lengths in 'furlong', which are taken for mm");
}

TEST_F(ShearWarpMIPProgramStack, LeavesOutWhatIsNotKnown)
{
  this->ExpectSuccess("large.nrrd turn.nrrd --frames 4");
  const auto keep = [this](const std::vector<std::string> & keys) {
    for (const std::string & key : keys)
    {
      this->WriteChanged("less.nrrd", key, "");
      fs::rename(m_Folder / "less.nrrd", m_Folder / "turn.nrrd");
    }
  };
  keep({ "Background", "Mode", "Center", "Loop" });
  this->ExpectSuccess("turn.nrrd a.html");
  const std::string page = ReadText(m_Folder / "a.html");
  EXPECT_NE(page.find("\"Maximum intensity projection\""), std::string::npos);
  EXPECT_NE(page.find("\"loop\": \"turn\""), std::string::npos);
  keep({ "FrameAngles" });
  this->ExpectSuccess("turn.nrrd b.html");
  EXPECT_NE(ReadText(m_Folder / "b.html").find("\"loop\": \"none\""), std::string::npos);
  this->WriteChanged("swing.nrrd", "FrameAngles", "0 10 0 -10");
  this->ExpectSuccess("swing.nrrd c.html");
  EXPECT_NE(ReadText(m_Folder / "c.html").find("\"loop\": \"swing\""), std::string::npos);
}

/** Each option of the help but INPUT and OUTPUT, with a value that it takes. */
TEST_F(ShearWarpMIPProgramStack, TakesOptionsOfOutputsOnly)
{
  this->ExpectSuccess("large.nrrd turn.nrrd --frames 3");
  const std::map<std::string, std::string> values = { { "--series", "1" },           { "--volume", "1" },
                                                      { "--view", "left" },          { "--rotation-axis", "i" },
                                                      { "--center", "1 2 3" },       { "--page-bits", "16" },
                                                      { "--page-volume", "" },       { "--output-spacing", "2" },
                                                      { "--size", "9 9" },           { "--oversampling", "2" },
                                                      { "--window", "1 2" },         { "--wl", "1 2" },
                                                      { "--slab", "1 2" },           { "--sliding-slab", "1 2" },
                                                      { "--mode", "minimum" },       { "--interpolation", "nearest" },
                                                      { "--mask-label", "1" },       { "--remove-label", "1" },
                                                      { "--crop", "1 2 1 2 1 2" },   { "--overlay-color", "hot" },
                                                      { "--overlay-window", "1 2" }, { "--opacity", "0.5" },
                                                      { "--threads", "1" },          { "--trust", "turn.nrrd" },
                                                      { "--depth", "depth.nrrd" },   { "--depth-color", "depth.png" },
                                                      { "--dicom-out", "series" } };
  const std::map<std::string, std::string> needed = { { "--rotation-axis", "--frames" },
                                                      { "--center", "--frames" },
                                                      { "--angular-range", "--frames" },
                                                      { "--rocking", "--frames" },
                                                      { "--elevations", "--frames" },
                                                      { "--mask-label", "--mask" },
                                                      { "--remove-label", "--mask" },
                                                      { "--overlay-series", "--overlay" },
                                                      { "--overlay-volume", "--overlay" },
                                                      { "--overlay-transform", "--overlay" },
                                                      { "--overlay-color", "--overlay" },
                                                      { "--overlay-window", "--overlay" },
                                                      { "--opacity", "--overlay" },
                                                      { "--multi-frame", "--dicom-out" },
                                                      { "--page-volume-size", "--page-volume" } };
  const std::set<std::string> program{ "--help",         "--help-all",     "--version",        "--write-phantom",
                                       "--phantom-size", "--write-volume", "--with-attributes" };
  const std::string           help = this->Run("--help-all").output;
  const std::regex            pattern("\n  (?:-\\w, ?)?(--[a-z-]+)(?:, --[a-z-]+)*( [A-Z{])?");
  std::size_t                 ofOutputs = 0;
  Options                     options;
  CLI::App                    app;
  DefineOptions(app, options);
  for (std::sregex_iterator it(help.begin(), help.end(), pattern), end; it != end; ++it)
  {
    const std::string name = (*it)[1];
    SCOPED_TRACE(name);
    const auto write = [&](const std::string & option, bool hasValue) {
      const auto value = values.find(option);
      return ' ' + option + (!hasValue ? "" : ' ' + (value == values.end() ? "1" : value->second));
    };
    if (program.count(name) > 0)
    {
      continue;
    }
    std::string arguments = write(name, (*it)[2].matched);
    if (const auto other = needed.find(name); other != needed.end())
    {
      arguments += write(other->second, true);
    }
    if (HasTrait(*app.get_option(name), "outputs"))
    {
      ++ofOutputs;
      EXPECT_EQ(this->Run("turn.nrrd a.html" + arguments).status, 0);
      fs::remove_all(m_Folder / "series");
      continue;
    }
    const Result result = this->Run("turn.nrrd b." + std::string(name == "--in-place" ? "nrrd" : "html") + arguments);
    EXPECT_EQ(result.status, 1);
    EXPECT_NE(result.messages.find(" is not possible: 'turn.nrrd' has frames, which are not projected again\n"),
              std::string::npos)
      << result.messages;
  }
  EXPECT_EQ(ofOutputs, 12u);
}

TEST_F(ShearWarpMIPProgramStack, IsRefusedWithWrongKeys)
{
  this->ExpectSuccess("large.nrrd turn.nrrd --frames 3");
  const std::string                             matrix = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 ";
  const std::string                             megabytes(5000000, '1');
  const std::vector<std::array<std::string, 3>> wrong = {
    { "FrameTransforms", matrix, "FrameTransforms has 16 numbers; 48 are needed" },
    { "FrameTransforms", matrix + matrix + matrix + '1', "FrameTransforms has more than 48 numbers" },
    { "FrameTransforms", matrix + matrix + "0 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "matrix of frame 3 that is singular" },
    { "FrameTransforms", matrix + matrix + "1 0 0 0 0 1 0 0 0 0 1 0 1 0 0 1", "does not end with 0 0 0 1" },
    { "FrameTransforms", matrix + matrix + "nan 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "not finite" },
    { "FrameTransforms", "1 0 0 0 0 1 0 0 0 0 1 0 " + matrix + "1 0 0 0 0 1 0 0", "has 36 numbers; 48 are needed" },
    { "FrameTransforms", "one", "holds something that is no number" },
    { "FrameTransforms", megabytes, "FrameTransforms" },
    { "FrameAngles", "1 2", "FrameAngles has 2 numbers; 3 are needed" },
    { "FrameAngles", "1 2 inf", "not finite" },
    { "Elevations", "1 2", "Elevations has 2 turns, which 3 frames do not make" },
    { "Elevations", " ", "Elevations has 0 turns" },
    { "Loop", "back", "Loop must be one of none, turn, swing" },
    { "Mode", megabytes, "Mode must be one of maximum" },
    { "Slab", "1 2 3", "Slab has 3 numbers; 2 are needed, or 2 for each frame" },
    { "Slab", "2 1", "NEAR that is greater than FAR" },
    { "Slab", "nan 1", "not finite" },
    { "Center", "1 2", "Center has 2 numbers; 3 are needed" },
    { "Background", "1e9", "Background is no value of its pixel type" },
    { "Background", "black", "Background is no number" },
    { "IsInverted", "yes", "IsInverted must be one of 0, 1" },
    { "IsSuv", "yes", "IsSuv must be one of 0, 1" },
    { "HasOrientation", "2", "HasOrientation must be one of 1, 0" },
  };
  for (const auto & [key, text, mention] : wrong)
  {
    SCOPED_TRACE(key);
    this->WriteChanged("wrong.nrrd", key, text);
    this->ExpectFailure("wrong.nrrd out.png", mention);
    EXPECT_LT(this->Run("wrong.nrrd out.png").messages.size(), 500u);
  }
  this->WithChangedFile(
    "turn.nrrd",
    [](std::string text) { return text.replace(text.find("FrameTransforms"), 0, " "); },
    [this] { this->ExpectFailure("turn.nrrd out.png", "FrameTransforms has blanks beside its name"); });
  this->WriteChanged("wrong.nrrd", "FrameAngles", "");
  fs::rename(m_Folder / "wrong.nrrd", m_Folder / "turn.nrrd");
  this->ExpectFailure("turn.nrrd out.png", "Loop is turn without FrameAngles");

  // a line of MetaImage is no longer than MetaIO's buffer
  this->ExpectSuccess("large.nrrd turn.mha --frames 3");
  this->WithChangedFile(
    "turn.mha",
    [&megabytes](const std::string & text) {
      const auto loop = text.find("Loop");
      return text.substr(0, loop) + "Odd = " + megabytes + '\n' + text.substr(loop);
    },
    [this] { this->ExpectFailure("turn.mha out.png", "'turn.mha' is damaged or incomplete"); });
  this->ExpectCutFileRefused("turn.mha", "turn.mha", 3000);
}

TEST_F(ShearWarpMIPProgramStack, HasDepths)
{
  this->ExpectSuccess("large.nrrd turn.nrrd --frames 3 --depth depth.nrrd");
  this->ExpectSuccess("depth.nrrd a.png --no-labels");
  const auto pixels = this->ReadPixels<itk::Image<unsigned char, 2>>("a-002.png");
  EXPECT_EQ(*std::min_element(pixels.begin(), pixels.end()), 0);
  EXPECT_EQ(*std::max_element(pixels.begin(), pixels.end()), 255);
}

TEST_F(ShearWarpMIPProgramStack, IsNoVolumeInPlace)
{
  this->ExpectSuccess("large.nrrd slice.nrrd --in-place --slab -5 5 --view left");
  EXPECT_EQ(ReadText(m_Folder / "slice.nrrd").find("FrameTransforms"), std::string::npos);
  this->ExpectSuccess("slice.nrrd a.png --view left", "shear-warp-mip: warning: 'slice.nrrd' has only one slice\n");
}

TEST_F(ShearWarpMIPProgramStack, IsNotOverwritten)
{
  this->ExpectSuccess("large.nrrd turn.nrrd --frames 3");
  this->ExpectFailure("turn.nrrd turn.nrrd", "this call reads it");
  for (const std::string key : { "SourceFiles", "MaskFiles" })
  {
    this->WriteChanged("from.nrrd", key, this->GetPath("large.nrrd"));
    this->ExpectFailure("from.nrrd large.nrrd --trust from.nrrd", "cannot write 'large.nrrd': this call reads it");
  }
}

/** The letters of the page and of Patient Orientation come from one function, also at 22.5 and 45 degrees. */
TEST_F(ShearWarpMIPProgramStack, HasTheSameLettersInPagesAndDicom)
{
  for (const std::string projection : { "--frames 360",
                                        "--frames 72 --elevation 45",
                                        "--frames 16",
                                        "--frames 16 --rotation-axis left --elevation 22.5" })
  {
    SCOPED_TRACE(projection);
    this->ExpectSuccess("in.nrrd a.html --size 4 4 --dicom-out series " + projection);
    const std::string    page = ReadText(m_Folder / "a.html");
    const std::string    letters = page.substr(page.find("\"letters\": ["));
    const std::regex     pattern("\"([A-Z]+) ([A-Z]+) ([A-Z]+) ([A-Z]+)\"");
    std::sregex_iterator edges(letters.begin(), letters.end(), pattern);
    for (const fs::path & file : ListFiles(m_Folder / "series"))
    {
      ASSERT_NE(edges, std::sregex_iterator());
      const std::string expected = (*edges)[2].str() + '\\' + (*edges)[4].str();
      const std::string found = this->ReadTags(file).at("0020|0020");
      EXPECT_EQ(found.substr(0, expected.size()), expected) << file;
      EXPECT_LE(found.size(), expected.size() + 1) << file;
      ++edges;
    }
    EXPECT_EQ(edges, std::sregex_iterator());
    fs::remove_all(m_Folder / "series");
  }
}

TEST_F(ShearWarpMIPProgramStack, HasAWindowBeyondWholeNumbersOfDoubles)
{
  const auto volume = MakeImage<itk::Image<double, 3>>({ { 9, 9, 9 } });
  volume->FillBuffer(0x1p60);
  this->WriteImage(volume, "huge.nrrd");
  this->ExpectSuccess("huge.nrrd a.png --view left");
  const auto pixels = this->ReadPixels<itk::Image<unsigned char, 2>>("a.png");
  EXPECT_EQ(*std::max_element(pixels.begin(), pixels.end()), 255);
}
} // namespace
