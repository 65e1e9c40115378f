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

#include "itkRGBPixel.h"
#include "itkVectorImage.h"

namespace
{
using namespace ShearWarpMIPProgramTest;

class ShearWarpMIPProgramPage : public ShearWarpMIPProgramPageTest
{
protected:
  template <typename TStored>
  std::vector<std::vector<TStored>>
  ReadFrames(const std::string & series) const
  {
    std::vector<std::vector<TStored>> frames;
    const std::regex                  quoted("\"(iVBOR[A-Za-z0-9+/=]+)\"");
    for (std::sregex_iterator it(series.begin(), series.end(), quoted), end; it != end; ++it)
    {
      std::ofstream(this->GetPath("frame.png"), std::ios::binary) << DecodeBase64((*it)[1]);
      frames.push_back(this->ReadPixels<itk::Image<TStored, 2>>("frame.png"));
    }
    fs::remove(this->GetPath("frame.png"));
    return frames;
  }

  /** Writes frames as values and as a page, whose pixels must be what \a shown makes of the values, but for so many
   * slopes and \a epsilon. Returns the page's JSON. */
  template <typename TStored>
  std::string
  ExpectValues(const std::string &                   arguments,
               const std::string &                   pageOptions,
               double                                background,
               const std::function<double(double)> & shown,
               double                                slopes,
               double                                epsilon) const
  {
    this->ExpectSuccess(arguments + " --output values.nrrd");
    this->ExpectSuccess(arguments + pageOptions + " --output page.html");
    const std::string series = this->ReadSeries("page.html");
    const auto        values = this->Read<itk::Image<double, 3>>("values.nrrd");
    const auto        size = values->GetLargestPossibleRegion().GetSize();
    const double      intercept = GetNumber(series, "intercept");
    const double      slope = GetNumber(series, "slope");
    const double *    value = values->GetBufferPointer();
    const auto        frames = this->ReadFrames<TStored>(series);
    EXPECT_EQ(GetNumber(series, "width"), size[0]);
    EXPECT_EQ(GetNumber(series, "height"), size[1]);
    EXPECT_EQ(GetNumber(series, "bits"), 8 * sizeof(TStored));
    EXPECT_EQ(frames.size(), size[2]);
    const std::size_t pixels = size[0] * size[1];
    for (std::size_t n = 0; n < std::min<std::size_t>(frames.size(), size[2]); ++n)
    {
      EXPECT_EQ(frames[n].size(), pixels);
      for (std::size_t pixel = 0; pixel < std::min(frames[n].size(), pixels); ++pixel)
      {
        const TStored stored = frames[n][pixel];
        const double  found = stored == 0 ? background : intercept + slope * stored;
        EXPECT_NEAR(found, shown(value[n * pixels + pixel]), slopes * slope + epsilon)
          << "frame " << n << ", pixel " << pixel;
      }
    }
    return series;
  }
};
} // namespace

TEST_F(ShearWarpMIPProgramPage, TellsNoNameOfThePatient)
{
  this->WriteDICOMSeries(
    "1.2.3.4", "a", { 0, 2, 4 }, 8, false, { { "0010|0010", "Doebler^Janemarie" }, { "0010|0020", "Patient7" } });
  this->Move("dicom", "Doebler^Janemarie");
  this->Move("in.nrrd", "Janemarie Doebler.nrrd");
  for (const std::string input : { "'Doebler^Janemarie'", "'Janemarie Doebler.nrrd'" })
  {
    this->ExpectSuccess(input + " out.html --frames 3");
    const std::string page = ReadText(m_Folder / "out.html");
    EXPECT_NE(page.find("\"title\": \"Maximum intensity projection\""), std::string::npos);
    for (const std::string name : { "Janemarie", "Doebler", "Patient7", ".nrrd" })
    {
      EXPECT_EQ(page.find(name), std::string::npos) << name;
    }
  }
}

TEST_F(ShearWarpMIPProgramPage, FilesOfPicturesTellNoNameOfInput)
{
  this->Move("in.nrrd", "Janemarie Doebler.nrrd");
  const std::vector<std::string> stills{ "png", "jpg", "tif", "nrrd", "mha", "nii" };
  const std::vector<std::string> series{ "gif", "apng", "mp4" };
  const auto                     expect = [this](const std::string & extension, const std::string & frames) {
    const std::string name = "out." + extension;
    this->ExpectSuccess("'Janemarie Doebler.nrrd' " + name + frames);
    EXPECT_EQ(ReadText(m_Folder / name).find("Janemarie"), std::string::npos) << name;
  };
  for (const std::string & extension : stills)
  {
    expect(extension, "");
  }
  for (const std::string & extension : series)
  {
    expect(extension, " --frames 2");
  }
}

TEST_F(ShearWarpMIPProgramPage, HasTheTitleThatIsGiven)
{
  this->ExpectSuccess("in.nrrd page.html --title 'Case \"3\" </script> é'");
  EXPECT_EQ(this->ReadSeries("page.html").find("{\"title\": \"Case \\u00223\\u0022 \\u003c/script> é\""), 0u);
  this->ExpectSuccess("in.nrrd turn.nrrd --frames 3");
  this->ExpectSuccess("turn.nrrd page.html --title 'Case 4'");
  EXPECT_EQ(this->ReadSeries("page.html").find("{\"title\": \"Case 4\""), 0u);
  this->ExpectSuccess("in.nrrd out.nrrd --title 'Case 5'",
                      "shear-warp-mip: note: --title has no effect: 'out.nrrd' has no title\n");
}

TEST_F(ShearWarpMIPProgramPage, HasTheTitleOfTheMode)
{
  const std::map<std::string, std::string> titles = { { "minimum", "Minimum" }, { "mean", "Mean" } };
  for (const auto & [mode, title] : titles)
  {
    this->ExpectSuccess("in.nrrd page.html --mode " + mode);
    EXPECT_EQ(this->ReadSeries("page.html").find("{\"title\": \"" + title + " intensity projection\""), 0u);
  }
}

TEST_F(ShearWarpMIPProgramPage, TellsWhichValuesAreCut)
{
  using Numbers = std::vector<double>;
  const std::vector<std::pair<std::string, Numbers>> cases = { { "--window 100 104", { 1, 9 } },
                                                               { "--window 0 70", { -1, 11 } },
                                                               { "--window 0 100000", { -1, -1 } },
                                                               { "--window 100 104 --page-bits 16", { -1, -1 } } };
  for (const auto & [options, cut] : cases)
  {
    this->ExpectSuccess("in.nrrd page.html " + options);
    EXPECT_EQ(GetNumbers(this->ReadSeries("page.html"), "cut"), cut) << options;
  }
}

TEST_F(ShearWarpMIPProgramPage, HoldsAllValuesWith16Bits)
{
  const auto        same = [](double value) { return value; };
  const std::string series = this->ExpectValues<unsigned short>(
    "in.nrrd --frames 5 --background -7", " --page-bits 16 --window 20 100", -7.0, same, 0.0, 0.0);
  EXPECT_EQ(GetNumber(series, "slope"), 1);
  EXPECT_NE(series.find("\"window\": [20, 100]"), std::string::npos);
  EXPECT_NE(series.find("\"loop\": \"turn\", \"angles\": [0, 72, 144, 216, 288]"), std::string::npos);
  EXPECT_EQ(this->ReadFrames<unsigned short>(series).size(), 5u);
}

TEST_F(ShearWarpMIPProgramPage, HoldsTwiceTheWindowWith8Bits)
{
  const auto clamp = [](double value) { return value == -7.0 ? -7.0 : std::clamp(value, 50.0, 90.0); };
  const auto series =
    this->ExpectValues<unsigned char>("in.nrrd --frames 3 --background -7", " --window 60 80", -7.0, clamp, 0.5, 1e-9);
  EXPECT_EQ(this->ReadFrames<unsigned char>(series).size(), 3u);
}

TEST_F(ShearWarpMIPProgramPage, HoldsFractionsAndSeriesThatDoNotTurn)
{
  const auto image = MakeImage<itk::Image<float, 3>>({ { 9, 8, 7 } });
  for (itk::SizeValueType n = 0; n < image->GetLargestPossibleRegion().GetNumberOfPixels(); ++n)
  {
    image->GetBufferPointer()[n] = static_cast<float>(n % 37) / 7.0f - 2.0f;
  }
  this->WriteImage(image, "float.nrrd");
  const auto        same = [](double value) { return value; };
  const std::string series =
    this->ExpectValues<unsigned short>("float.nrrd --sliding-slab 3 2", " --page-bits 16", 0.0, same, 0.5, 1e-6);
  EXPECT_NE(series.find("\"loop\": \"none\""), std::string::npos);
  EXPECT_EQ(series.find("\"angles\""), std::string::npos);
  const auto frames = this->ReadFrames<unsigned short>(series);
  EXPECT_GT(*std::max_element(frames.at(0).begin(), frames.at(0).end()), 0);
}

TEST_F(ShearWarpMIPProgramPage, HoldsColours)
{
  using ColourType = itk::RGBPixel<unsigned char>;
  const auto colours = MakeImage<itk::VectorImage<short, 3>>({ { 9, 8, 7 } }, 3);
  for (unsigned int n = 0; n < 9 * 8 * 7 * 3; ++n)
  {
    colours->GetBufferPointer()[n] = static_cast<short>(n % 41);
  }
  this->WriteImage(colours, "colours.nrrd");
  for (const std::string call : { "in.nrrd --overlay in.nrrd --overlay-window 60 100 --window 10 90",
                                  "in.nrrd --segments in.nrrd",
                                  "colours.nrrd --window 3 40" })
  {
    SCOPED_TRACE(call);
    this->ExpectSuccess(call + " -o page.html --frames 2 --azimuth 20");
    this->ExpectSuccess(call + " -o still.png --frames 2 --azimuth 20 --no-labels");
    const std::string series = this->ReadSeries("page.html");
    EXPECT_EQ(GetNumber(series, "bits"), 24);
    EXPECT_NE(series.find("\"inverted\": false, \"window\": [0, 255]"), std::string::npos);
    const auto frames = this->ReadFrames<ColourType>(series);
    ASSERT_EQ(frames.size(), 2u);
    for (const std::string n : { "0", "1" })
    {
      const auto still = this->Read<itk::Image<ColourType, 2>>("still-00" + n + ".png");
      EXPECT_EQ(frames[std::stoul(n)], GetPixels(still));
    }
  }
}

TEST_F(ShearWarpMIPProgramPage, TellsHowTheSeriesGoesOn)
{
  this->ExpectSuccess("in.nrrd turn.html --frames 2 --angular-range -360 --rate 7.5");
  const std::string turn = this->ReadSeries("turn.html");
  EXPECT_NE(turn.find("\"loop\": \"turn\", \"angles\": [0, -180]"), std::string::npos);
  EXPECT_EQ(GetNumber(turn, "rate"), 7.5);
  this->ExpectSuccess("in.nrrd part.html --frames 3 --angular-range 90");
  EXPECT_NE(this->ReadSeries("part.html").find("\"loop\": \"none\", \"angles\": [0, 30, 60]"), std::string::npos);
  this->ExpectSuccess("in.nrrd rocking.html --frames 4 --rocking --angular-range 60");
  EXPECT_NE(this->ReadSeries("rocking.html").find("\"loop\": \"swing\", \"angles\": [0, 30, "), std::string::npos);
}

TEST_F(ShearWarpMIPProgramPage, NamesTheSidesOfThePatient)
{
  const std::map<std::string, std::string> letters = { { "anterior", "R L H F" }, { "posterior", "L R H F" },
                                                       { "left", "A P H F" },     { "right", "P A H F" },
                                                       { "superior", "L R A P" }, { "inferior", "R L A P" } };
  for (const auto & [view, sides] : letters)
  {
    this->ExpectSuccess("in.nrrd view.html --view " + view);
    EXPECT_NE(this->ReadSeries("view.html").find("\"letters\": [\"" + sides + "\"]"), std::string::npos) << view;
  }
  this->ExpectSuccess("in.nrrd turn.html --frames 6");
  const std::string turn = this->ReadSeries("turn.html");
  EXPECT_NE(turn.find(R"("letters": ["R L H F", "AR PL H F", "AL PR H F", "L R H F", "PL AR H F", )"),
            std::string::npos)
    << turn.substr(0, 500);
  EXPECT_NE(turn.find("\"labels\": true"), std::string::npos);
  this->ExpectSuccess("in.nrrd turn.html --frames 6 --no-labels");
  EXPECT_NE(this->ReadSeries("turn.html").find("\"labels\": false"), std::string::npos);
}

TEST_F(ShearWarpMIPProgramPage, HasARowOfFramesForEachElevation)
{
  this->ExpectSuccess("in.nrrd rows.html --frames 4 --elevations -30,60");
  const std::string rows = this->ReadSeries("rows.html");
  EXPECT_NE(rows.find("\"angles\": [0, 90, 180, 270], \"elevations\": [-30, 60], \"letters\": ["), std::string::npos);
  EXPECT_NE(rows.find(R"("R L HA FP", "A P HL FR", )"), std::string::npos) << rows.substr(0, 700);
  EXPECT_EQ(this->ReadFrames<unsigned char>(rows).size(), 8u);
  this->ExpectSuccess("in.nrrd rows.html --frames 24 --elevations 0 10");
  EXPECT_EQ(GetNumber(this->ReadSeries("rows.html"), "rate"), 6);
  this->ExpectSuccess("in.nrrd turn.html --frames 4 --elevation 60");
  EXPECT_EQ(this->ReadSeries("turn.html").find("\"elevations\""), std::string::npos);
}

TEST_F(ShearWarpMIPProgramPage, TurnsOfSeveralElevationsFollowOneAnother)
{
  const std::string grid = " --frames 3 --angular-range 90 --view left --azimuth 10 --output-spacing 0.8 --size 50 40";
  this->ExpectSuccess("in.nrrd rows.nrrd --elevations 40,-25.5" + grid);
  std::vector<short> expected;
  for (const std::string elevation : { "40", "-25.5" })
  {
    this->ExpectSuccess("in.nrrd turn.nrrd --elevation " + elevation + grid);
    const auto turn = this->ReadPixels<VolumeType>("turn.nrrd");
    expected.insert(expected.end(), turn.begin(), turn.end());
  }
  EXPECT_EQ(this->ReadPixels<VolumeType>("rows.nrrd"), expected);

  this->ExpectSuccess("in.nrrd rows.png --frames 2 --elevations -30,0,30 --dicom-out dicom");
  EXPECT_TRUE(fs::exists(this->GetPath("rows-005.png")));
  EXPECT_FALSE(fs::exists(this->GetPath("rows-006.png")));
  EXPECT_EQ(std::distance(fs::directory_iterator(this->GetPath("dicom")), fs::directory_iterator()), 6);
}

TEST_F(ShearWarpMIPProgramPage, RefusesElevationsThatAreNone)
{
  this->ExpectFailure("in.nrrd out.html --elevations 0,30", "--elevations requires --frames");
  this->ExpectFailure("in.nrrd out.html --frames 2 --elevations 0,30 --elevation 10", "excludes");
  this->ExpectFailure("in.nrrd out.html --frames 2 --elevations 0,high", "'high' is not a finite angle");
  this->ExpectFailure("in.nrrd out.html --frames 2 --elevations 0,inf", "'inf' is not a finite angle");
  this->ExpectFailure("in.nrrd out.html --frames 40000 --elevations 0,30", "at most 65535 frames are possible");
}

TEST_F(ShearWarpMIPProgramPage, HoldsFiniteNumbersAlone)
{
  this->WriteImage(MakeVolume<float>(1.0f), "float.nrrd");
  for (const std::string background : { "nan", "inf", "-inf" })
  {
    for (const std::string region : { "", " --crop 900 901 0 1 0 1", " --page-bits 16 --crop 900 901 0 1 0 1" })
    {
      EXPECT_EQ(this->Run("float.nrrd out.html --background " + background + region).status, 0);
      const std::string series = this->ReadSeries("out.html");
      const std::string numbers = series.substr(0, series.find("\"frames\""));
      EXPECT_FALSE(std::regex_search(numbers, std::regex("[ \\[-](nan|inf)"))) << numbers;
      const bool isEmpty = !region.empty();
      for (const auto & frame : this->ReadFrames<unsigned short>(series))
      {
        EXPECT_EQ(*std::max_element(frame.begin(), frame.end()) == 0, isEmpty);
      }
    }
  }
}

TEST_F(ShearWarpMIPProgramPage, RefusesWhatAPageCannotShow)
{
  this->WriteImage(MakeImage<itk::VectorImage<short, 3>>({ { 5, 4, 3 } }, 2), "vectors.nrrd");
  this->ExpectFailure("vectors.nrrd out.html --frames 2", "A picture of other than 1 or 3 components is not possible");
  this->ExpectFailure("vectors.nrrd out.html --page-bits 16", "--page-bits 16 is not possible: 'vectors.nrrd' has 2");
  this->ExpectFailure("in.nrrd out.html --page-bits 16 --overlay in.nrrd",
                      "--page-bits 16 is not possible with --overlay: the page holds colours, not values");
  this->ExpectFailure("in.nrrd none/out.html --frames 2", "its folder does not exist");
  this->ExpectFailure("in.nrrd out.nrrd --depth depth.html", "must have one of the extensions");
  EXPECT_NE(this->Run("in.nrrd out.html --frames 2 --page-bits 12").status, 0);
}
