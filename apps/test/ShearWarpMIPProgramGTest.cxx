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

#include "itkVersion.h"

#include <cctype>
#include <cmath>
#include <complex>
#include <limits>

namespace
{
using namespace ShearWarpMIPProgramTest;

TEST_F(ShearWarpMIPProgram, KeepsValuesInEachFormat)
{
  const auto expected = this->Project(this->MakeTransform(Direction::Anterior));
  for (const std::string name : { "out.mha", "out.nrrd", "out.nii", "out.nii.gz" })
  {
    this->ExpectSuccess("in.nrrd " + name);
    this->ExpectPicture(name, expected);
  }
}

TEST_F(ShearWarpMIPProgram, KeepsPixelTypes)
{
  this->ExpectPixelTypeKept<signed char>();
  this->ExpectPixelTypeKept<unsigned char>();
  this->ExpectPixelTypeKept<unsigned short>();
  this->ExpectPixelTypeKept<int>();
  this->ExpectPixelTypeKept<unsigned long long>();
  this->ExpectPixelTypeKept<float>();
  this->ExpectPixelTypeKept<double>();
}

TEST_F(ShearWarpMIPProgram, TakesViewAndAngles)
{
  this->ExpectSuccess("in.nrrd out.nrrd --view left --azimuth -30.5 --elevation 20");
  this->ExpectPicture("out.nrrd", this->Project(this->MakeTransform(Direction::Left, -30.5, 20.0)));
}

TEST_F(ShearWarpMIPProgram, ShowsPatientFromEachSide)
{
  this->WriteLandmark();
  const std::map<std::string, std::string> expected = { { "anterior", "top right" }, { "posterior", "top left" },
                                                        { "left", "top left" },      { "right", "top right" },
                                                        { "superior", "top left" },  { "inferior", "top right" } };
  for (const auto & [view, place] : expected)
  {
    this->ExpectSuccess("landmark.nrrd out.nrrd --view " + view);
    const auto picture = this->Read("out.nrrd");
    EXPECT_EQ(FindLandmark(GetPixels(picture), picture->GetBufferedRegion().GetSize(0)), place) << view;
  }
}

TEST_F(ShearWarpMIPProgram, WindowsPictures)
{
  this->ExpectSuccess("in.nrrd out.nrrd --azimuth 30");
  const auto values = this->ReadPixels("out.nrrd");
  const auto expectWindowed = [&](const std::string & name, double low, double high) {
    const auto windowed = this->ReadPixels(name);
    ASSERT_EQ(values.size(), windowed.size());
    for (std::size_t i = 0; i < values.size(); ++i)
    {
      EXPECT_EQ(windowed[i], std::lround(255.0 * std::clamp((values[i] - low) / (high - low), 0.0, 1.0)));
    }
  };
  this->ExpectSuccess("in.nrrd out.png --azimuth 30 --window 60 100");
  expectWindowed("out.png", 60.0, 100.0);

  this->ExpectSuccess("in.nrrd robust.png --azimuth 30");
  std::vector<PixelType> shown;
  std::copy_if(values.begin(), values.end(), std::back_inserter(shown), [](PixelType value) { return value != 0; });
  std::sort(shown.begin(), shown.end());
  const auto last = static_cast<double>(shown.size() - 1);
  expectWindowed("robust.png", shown[std::lround(0.01 * last)], shown[std::lround(0.998 * last)]);
}

TEST_F(ShearWarpMIPProgram, TakesGrid)
{
  const auto transform = this->MakeTransform(Direction::Anterior, 30.0);
  this->ExpectSuccess("--azimuth 30 --output-spacing 0.5,0.8 in.nrrd out.nrrd");
  const double spacing[] = { 0.5, 0.8 };
  this->ExpectPicture("out.nrrd", this->Project(transform, [&](FilterType & filter) {
    filter.SetOutputSpacing(itk::Vector<double, 2>(spacing));
  }));
  this->ExpectSuccess("--azimuth 30 --size 40 30 --output-spacing .5 --background -5 in.nrrd out.nrrd");
  this->ExpectPicture("out.nrrd", this->Project(transform, [](FilterType & filter) {
    filter.SetOutputSpacing(itk::Vector<double, 2>(0.5));
    filter.SetSize({ { 40, 30 } });
    filter.SetDefaultPixelValue(-5);
  }));
}

TEST_F(ShearWarpMIPProgram, TakesOversampling)
{
  const auto transform = this->MakeTransform(Direction::Anterior, 30.0, 20.0);
  this->ExpectSuccess("--azimuth 30 --elevation 20 --oversampling 2 in.nrrd out.nrrd");
  const auto finer = this->Project(transform, [](FilterType & filter) { filter.SetOversampling(2); });
  this->ExpectPicture("out.nrrd", finer);
  EXPECT_NE(GetPixels(finer), GetPixels(this->Project(transform)));
}

TEST_F(ShearWarpMIPProgram, BackgroundIsMinimumBelowZero)
{
  this->WriteImage(MakeVolume<PixelType>(-1000), "ct.nrrd");
  this->ExpectSuccess("ct.nrrd out.nrrd --size 100 100");
  EXPECT_EQ(this->ReadPixels("out.nrrd").front(), -1000);
  this->ExpectSuccess("in.nrrd out.nrrd --size 100 100");
  EXPECT_EQ(this->ReadPixels("out.nrrd").front(), 0);
}

TEST_F(ShearWarpMIPProgram, SameBytesWithAnyNumberOfThreads)
{
  this->ExpectSuccess("in.nrrd one.nrrd --frames 6 --threads 1");
  this->ExpectSuccess("in.nrrd two.nrrd --frames 6 --threads 2");
  EXPECT_EQ(ReadText(m_Folder / "one.nrrd"), ReadText(m_Folder / "two.nrrd"));
}

TEST_F(ShearWarpMIPProgram, AcceptsFurtherDimensionsOfOne)
{
  const auto image = MakeImage<itk::Image<PixelType, 4>>({ { 5, 6, 7, 1 } });
  image->FillBuffer(1);
  this->WriteImage(image, "four.nrrd");
  this->ExpectSuccess("four.nrrd out.nrrd");
}

TEST_F(ShearWarpMIPProgram, ReadsDICOMSeries)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4 });
  std::ofstream(m_Folder / "dicom" / "readme.txt") << "no image\n";
  this->ExpectSuccess("dicom out.nrrd --output-spacing 1");
  EXPECT_EQ(this->Read("out.nrrd")->GetBufferedRegion().GetSize(1), 6u);

  this->WriteDICOMSeries("1.2.3.5", "b", { 0, 2, 4, 6, 8, 10 });
  this->ExpectSuccess("dicom out.nrrd --output-spacing 1 --series 1.2.3.5");
  EXPECT_EQ(this->Read("out.nrrd")->GetBufferedRegion().GetSize(1), 12u);
  EXPECT_EQ(this->ReadPixels("out.nrrd").front(), 105);
}

TEST_F(ShearWarpMIPProgram, AsksForTheFolderOfManyFiles)
{
  this->WriteDICOMSeries("1.2.3.4", "a", std::vector<double>(30));
  this->ExpectFailure("dicom/*.dcm out.png",
                      "shear-warp-mip: several files are given, but INPUT is one file or a folder: for a DICOM series "
                      "give its folder, 'dicom'\n");
}

TEST_F(ShearWarpMIPProgram, WarnsOfUnevenSlices)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4, 6.2, 8, 10 });
  this->ExpectWarning("dicom out.nrrd", "the slices are not evenly spaced");
}

TEST_F(ShearWarpMIPProgram, WarnsOfOneSlice)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0 });
  this->ExpectSuccess("dicom out.nrrd", "shear-warp-mip: warning: 'dicom' has only one slice\n");
  this->ExpectSuccess(
    "dicom/a0.dcm out.nrrd",
    "shear-warp-mip: warning: 'dicom/a0.dcm' has only one slice; for a whole series give its folder\n");
}

TEST_F(ShearWarpMIPProgram, RefusesMissingAndRepeatedSlices)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4, 8, 10 });
  this->ExpectFailure("dicom out.png",
                      "a slice is missing between 'dicom/a2.dcm' at 4 mm and 'dicom/a3.dcm' at 8 mm; others are 2 mm");
  this->WriteDICOMSeries("1.2.3.4", "a", { 10, 8, 4, 4, 2 });
  this->ExpectFailure("dicom out.png", "two slices lie at one position: 'dicom/a");
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4, 0, 2 });
  this->ExpectFailure("dicom out.png", "'dicom/a0.dcm' at 0 mm and 'dicom/a3.dcm' at 0 mm");
}

TEST_F(ShearWarpMIPProgram, RefusesSlicesThatDiffer)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4, 6 });
  this->WriteDICOMSeries("1.2.3.4", "b", { 8 }, 9);
  this->ExpectFailure("dicom out.png", "differ in size");
  this->WriteDICOMSeries<unsigned char>("1.2.3.4", "b", { 8 });
  this->ExpectFailure("dicom out.png", "dicom/b0.dcm");
}

TEST_F(ShearWarpMIPProgram, WritesDICOMSeries)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4, 6 });
  this->ExpectSuccess("dicom out.nrrd --frames 3 --dicom-out series");
  const auto getStudy = [](const std::string & name) {
    const auto  io = itk::GDCMImageIO::New();
    std::string study;
    io->SetFileName(name);
    io->ReadImageInformation();
    EXPECT_TRUE(itk::ExposeMetaData(io->GetMetaDataDictionary(), "0020|000d", study));
    return study;
  };
  const auto names = ListFiles(m_Folder / "series");
  ASSERT_EQ(names.size(), 3u);
  const auto values = this->ReadPixels<VolumeType>("out.nrrd");
  auto       value = values.begin();
  for (const auto & name : names)
  {
    EXPECT_EQ(getStudy(name.string()), getStudy(this->GetPath("dicom/a0.dcm")));
    const auto end = value + static_cast<std::ptrdiff_t>(values.size() / 3);
    EXPECT_EQ(this->ReadPixels<VolumeType>(name.string()), std::vector<PixelType>(value, end)) << name;
    value = end;
  }

  this->ExpectFailure("dicom out.png --dicom-out none/series", "its folder does not exist");
}

TEST_F(ShearWarpMIPProgram, RefusesDamagedDICOM)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4 });
  const std::size_t pixels = std::size_t{ 8 } * 8 * sizeof(PixelType);
  for (const std::string name : { "dicom/a1.dcm", "dicom/a2.dcm" })
  {
    const std::size_t size = ReadText(m_Folder / name).size();
    for (const std::string & input : { std::string("dicom"), name })
    {
      const auto expectRefused = [&](const std::function<std::string(const std::string &)> & change) {
        this->WithChangedFile(
          name, change, [&] { this->ExpectFailure(input + " out.png", "'" + name + "' is damaged or incomplete"); });
      };
      // within the pixels, their element and the header, and before the header
      for (const std::size_t cut :
           { std::size_t{ 1 }, pixels, pixels + 12, pixels + 40, size / 2, size - 150, size - 100, size })
      {
        this->ExpectCutFileRefused(input, name, size - cut);
      }
      // half of the pixels, and a length that says so
      expectRefused([&](std::string bytes) {
        bytes[size - pixels - 4] = static_cast<char>(pixels / 2);
        return bytes.substr(0, size - pixels / 2);
      });
      expectRefused([](std::string bytes) { return bytes.replace(128, 4, "????"); });
      expectRefused([](std::string bytes) { return bytes.replace(200, 40, 40, '\xff'); });
    }
  }
}

TEST_F(ShearWarpMIPProgram, TellsWhatItDoes)
{
  const Result usual = this->Run("--help");
  EXPECT_EQ(usual.status, 0);
  EXPECT_EQ(usual.messages, "");
  EXPECT_LT(usual.output.find("Examples"), usual.output.find("Options"));
  EXPECT_NE(usual.output.find("--view"), std::string::npos);
  EXPECT_EQ(usual.output.find("--page-bits"), std::string::npos);

  const Result help = this->Run("--help-all");
  EXPECT_EQ(help.status, 0);
  EXPECT_EQ(help.messages, "");
  for (const std::string & text : { usual.output, help.output })
  {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);)
    {
      EXPECT_LE(line.size(), 100u) << line;
    }
  }
  for (const std::string option :
       { "--view",        "--azimuth",       "--elevation",     "--transform", "--output-spacing", "--size",
         "--background",  "--oversampling",  "--window",        "--frames",    "--rotation-axis",  "--mode",
         "--slab",        "--sliding-slab",  "--local-maximum", "--mask",      "--mask-label",     "--crop",
         "--attenuation", "--depth",         "--depth-color",   "--in-place",  "--series",         "--threads",
         "--verbose",     "--write-phantom", "--version",       "--exact",     "--no-labels",      "--annotate",
         "Examples" })
  {
    EXPECT_NE(help.output.find(option), std::string::npos) << option;
  }

  const Result version = this->Run("--version");
  EXPECT_EQ(version.status, 0);
  EXPECT_EQ(version.output.find("shear-warp-mip "), 0u);
  // a program of another build may have another version of ITK
  const std::string itkVersion = std::getenv("SHEARWARPMIP_PROGRAM")
                                   ? std::to_string(itk::Version::GetITKMajorVersion()) + "."
                                   : itk::Version::GetITKVersion();
  EXPECT_NE(version.output.find(", ITK " + itkVersion), std::string::npos);

  const Result verbose = this->Run("in.nrrd out.png --frames 2 --view left --verbose");
  EXPECT_EQ(verbose.status, 0);
  for (const std::string text :
       { "in.nrrd", "[20, 18, 12]", "0.7", "short", "prepared", "axis 0", "frames 0 to 1", " ms" })
  {
    EXPECT_NE(verbose.messages.find(text), std::string::npos) << text << " in " << verbose.messages;
  }
}

TEST_F(ShearWarpMIPProgram, KnowsTheTerminal)
{
  if (std::system("script -qec true /dev/null >/dev/null 2>&1 </dev/null") != 0)
  {
    GTEST_SKIP() << "no program script, which makes a terminal";
  }
  const auto see = [this](const std::string & arguments) {
    std::ofstream(m_Folder / "call") << "stty cols 70; '" << GetProgram() << "' " << arguments;
    const Result result = this->Run("", "script -qec 'sh call' /dev/null </dev/null >seen; true");
    EXPECT_NE(result.status, -1);
    return ReadText(m_Folder / "seen");
  };
  std::istringstream help(see("--help"));
  std::size_t        widest = 0;
  for (std::string line; std::getline(help, line);)
  {
    widest = std::max(widest, line.substr(0, line.find('\r')).size());
  }
  EXPECT_GT(widest, 60u);
  EXPECT_LE(widest, 70u);

  const std::string clear = "\r\033[K";
  const std::string turn = see("in.nrrd out.nrrd --frames 2");
  for (const std::string step : { "reading in.nrrd", "projecting", "writing out.nrrd" })
  {
    EXPECT_NE(turn.find(clear + step + clear), std::string::npos) << step << " in " << turn;
  }
  EXPECT_EQ(turn.rfind(clear), turn.size() - clear.size());
  const std::string slow = see("in.nrrd out.nrrd --frames 80 --exact --output-spacing 0.05 --threads 1");
  EXPECT_NE(slow.find(" of 80" + clear), std::string::npos);
  EXPECT_NE(see("none.nrrd out.nrrd").find(clear + "shear-warp-mip: 'none.nrrd' does not exist"), std::string::npos);
}

TEST_F(ShearWarpMIPProgram, WritesPhantom)
{
  this->ExpectSuccess("--write-phantom head.mha");
  this->ExpectSuccess("--write-phantom same.mha --phantom-size 256 256,128");
  this->ExpectSuccess("--write-phantom small.mha --phantom-size 128 128 64");
  EXPECT_TRUE(ReadText(m_Folder / "head.mha") == ReadText(m_Folder / "same.mha"));
  EXPECT_EQ(this->Read<VolumeType>("same.mha")->GetBufferedRegion().GetSize(), (itk::Size<3>{ { 256, 256, 128 } }));
  EXPECT_EQ(this->Read<VolumeType>("small.mha")->GetBufferedRegion().GetSize(), (itk::Size<3>{ { 128, 128, 64 } }));
  for (const std::string name : { "head.mha", "small.mha" })
  {
    // the aneurysm, and the same place on the other side
    const auto phantom = this->Read<VolumeType>(name);
    for (const double side : { 1.0, -1.0 })
    {
      const double place[] = { 37.5 * side, -10.5, -9.5 };
      const auto   value = phantom->GetPixel(phantom->TransformPhysicalPointToIndex(itk::Point<double, 3>(place)));
      EXPECT_TRUE(side > 0.0 ? value > 600 : value < 300) << name << ": " << value;
    }
  }
  for (const std::string size : { "0 9 9", "9 9 4097", "9 9 1.5", "9 9" })
  {
    this->ExpectFailure("--write-phantom out.mha --phantom-size " + size, "--phantom-size: ");
  }
  this->ExpectFailure("in.nrrd out.png --phantom-size 9 9 9", "--phantom-size requires --write-phantom");
  this->ExpectFailure("--write-phantom out.png",
                      "--write-phantom: 'out.png' must have one of the extensions .mha .nrrd .nii .nii.gz");
}

TEST_F(ShearWarpMIPProgram, RefusesWrongOptions)
{
  this->ExpectFailure("in.nrrd out.png more", "more");
  this->ExpectFailure("in.nrrd out.png --azimuth inf", "--azimuth");
  this->ExpectFailures("in.nrrd out.png --size ", { "0 5", "-3 5" }, "--size");
  // once they would fit
  const auto side = std::to_string(std::lround(std::sqrt(0.3 * itk::ShearWarp::GetPhysicalMemory())));
  this->ExpectFailure("in.nrrd out.png --size " + side + ' ' + side, "do not fit in memory");
  this->ExpectFailures(
    "in.nrrd out.png --output-spacing ", { "0", "-1", "nan", "inf", "wide", "1,2,3" }, "--output-spacing");
  this->ExpectFailures("in.nrrd out.png --window ", { "7 7", "7 nan" }, "--window");
  this->ExpectFailures("in.nrrd out.png --background ", { "40000", "0.5", "nan" }, "--background");
  this->ExpectFailure("in.nrrd out.png --oversampling 3", "--oversampling");
  this->ExpectFailures("in.nrrd out.png --frames ", { "0", "4000000000", "99999999999" }, "--frames");
  this->ExpectFailure("in.nrrd out.png --threads 0", "--threads");
  this->ExpectFailure("in.nrrd out.png --transform a.tfm --azimuth 3", "--transform");
}

TEST_F(ShearWarpMIPProgram, TakesWhatPeopleWrite)
{
  const std::pair<std::string, std::string> calls[] = {
    { "--view right --mode minimum in.nrrd a.png", "--view Right --mode MINIP in.nrrd b.png" },
    { "--view superior --mode absolute-maximum in.nrrd a.png", "--view s --mode abs in.nrrd b.png" },
    { "--mode maximum in.nrrd a.png", "--mode mip -o b.png in.nrrd" },
    { "in.nrrd a.png", "--output b.png in.nrrd" },
    { "--output-spacing 0.5,0.8 in.nrrd a.nrrd", "--output-spacing 0.5 0.8 in.nrrd b.nrrd" },
    { "--output-spacing 0.5,0.8 in.nrrd a.nrrd", "--output-spacing 0.5, 0.8 in.nrrd b.nrrd" },
    { "--output-spacing 0.5,0.8 in.nrrd a.nrrd", "'--output-spacing=0.5, 0.8' in.nrrd b.nrrd" },
    { "--slab -1,3 in.nrrd a.png", "--slab -1 , 3 in.nrrd b.png" },
    { "--crop -90,90,-90,20,-90,90 in.nrrd a.png", "--crop '-90 90 -90 20 -90 90' in.nrrd b.png" },
    { "--crop -90,90,-90,20,-90,90 in.nrrd a.png", "--crop -90,90 -90,20 -90,90 in.nrrd b.png" },
    { "--crop -90,90,-90,20,-90,90 in.nrrd a.png", "--crop -90 , 90 , -90 , 20 , -90 , 90 in.nrrd b.png" },
    { "--crop -inf,inf,-.5,inf,-inf,inf in.nrrd a.png", "--crop -inf inf -.5, inf, -inf inf in.nrrd b.png" },
    { "--output-spacing .5 in.nrrd a.png", "--output-spacing=.5 in.nrrd b.png" },
    { "--size 40,30 in.nrrd a.png", "in.nrrd b.png --size 40 30" },
    { "--window -20,100 in.nrrd a.png", "--window -20 100 in.nrrd b.png" },
    { "--window -2e1 1e2 in.nrrd a.png", "--wl 40 120 in.nrrd b.png" },
    { "--window -1350 150 in.nrrd a.png", "--window Lung in.nrrd b.png" },
    { "--window -450 1050 in.nrrd a.png", "in.nrrd b.png --window bone" },
    { "--window 0 600 in.nrrd a.png --azimuth 3", "--window=angio --azimuth 3 in.nrrd b.png" },
    { "--window 0 600 --output-spacing 0.5 --slab 0 3 in.nrrd a.png --threads 1",
      "--output-spacing 0.5 in.nrrd b.png --window 0 600 --slab 0 3" },
    { "--window 0 80 in.nrrd a.png", "--window Br in.nrrd b.png" },
    { "--frames 3 --rotation-axis left in.nrrd a.nrrd", "--frames 3 --rotation-axis L in.nrrd b.nrrd" },
    { "--window 0 80 in.nrrd a.png", "--window BRAIN in.nrrd b.png" },
    { "--window 0 10 in.nrrd a.png", "--window pet in.nrrd b.png" },
    { "--slab -inf,-.5 in.nrrd a.png", "--slab -inf -.5 in.nrrd b.png" },
    { "--depth-colour a.png in.nrrd c.png", "--depth-color b.png in.nrrd d.png" },
    { "--frames 3 --centre 1,2,3 --rotation-axis left in.nrrd a.nrrd",
      "--frames 3 --center 1 2 3 --rotation-axis Left in.nrrd b.nrrd" },
    { "--window 0 80 --view left in.nrrd a.png", "-window 0 80 -view=left in.nrrd -output b.png" },
    { "--azimuth -30 in.nrrd a.png", "-azimuth -30 -ob.png -- in.nrrd" },
    { "--frames 3 --rotation-axis 0,-.5,1 in.nrrd a.nrrd", "--frames 3 --rotation-axis 0 -.5 1 in.nrrd b.nrrd" },
  };
  for (const auto & [plain, other] : calls)
  {
    this->ExpectSuccess(plain);
    this->ExpectSuccess(other);
    const std::string suffix = plain.find("a.nrrd") == std::string::npos ? ".png" : ".nrrd";
    EXPECT_TRUE(ReadText(m_Folder / ("a" + suffix)) == ReadText(m_Folder / ("b" + suffix))) << other;
    fs::remove(m_Folder / ("a" + suffix));
    fs::remove(m_Folder / ("b" + suffix));
  }
}

TEST_F(ShearWarpMIPProgram, TakesFilesWhoseNamesBeginWithADash)
{
  this->ExpectSuccess("in.nrrd -o -m.png --depth -dd.nrrd -depth-colour -ox.png");
  this->ExpectSuccess("in.nrrd --output -x5.png");
  for (const std::string name : { "-m.png", "-dd.nrrd", "-ox.png", "-x5.png" })
  {
    EXPECT_TRUE(fs::exists(m_Folder / name)) << name;
  }
}

TEST_F(ShearWarpMIPProgram, SaysWhatHasNoEffect)
{
  const auto expectNote = [this](const std::string & arguments, const std::string & note) {
    this->ExpectSuccess(arguments, "shear-warp-mip: note: " + note + '\n');
  };
  const std::string values = "--window has no effect: 'a.nrrd' keeps the image's values";
  expectNote("in.nrrd a.nrrd --window 3 4", values);
  expectNote("in.nrrd a.nrrd --wl 3 4", "--wl" + values.substr(8));
  this->ExpectSuccess("in.nrrd a.nrrd --window 3 4 --depth-color depth.png");
  this->ExpectSuccess("in.nrrd a.nrrd --window 3 4 --dicom-out out");
  expectNote("in.nrrd a.png --frames 2 --rate 5", "--rate has no effect: 'a.png' does not play");
  this->ExpectSuccess("in.nrrd a.html --frames 2 --rate 5");
  expectNote("in.nrrd dicom/ --rate 5 --frames 2", "--rate has no effect: 'dicom/' does not play");
  expectNote("in.nrrd a.nrrd --no-labels", "--no-labels has no effect: 'a.nrrd' has no letters");
  expectNote("in.nrrd a.nrrd --annotate", "--annotate has no effect: 'a.nrrd' has no annotations");
  expectNote("in.nrrd a.nrrd --depth-color depth.gif --size 48 48", "one view does not move; see --frames");
  expectNote("in.nrrd a.html --annotate", "--annotate has no effect: 'a.html' has scale bar and angles anyway");
  expectNote("in.nrrd a.png --annotate", "--annotate has no effect: 'a.png' has less than 48 columns or rows");
  this->ExpectSuccess("in.nrrd a.png --annotate --size 48 48");
  this->ExpectSuccess("in.nrrd a.html --no-labels");
  this->ExpectSuccess("in.nrrd a.nrrd --no-labels --annotate --depth-color depth.png --size 48 48");
  this->ExpectSuccess("in.nrrd a.html --annotate --depth-color depth.png --size 48 48");
}

TEST_F(ShearWarpMIPProgram, SaysWhatMaySurprise)
{
  const std::string warning = "shear-warp-mip: warning: ";
  const std::string note = "shear-warp-mip: note: ";
  this->ExpectSuccess("in.nrrd a.png --output-spacing 0.5 2",
                      note + "'a.png' looks distorted: its pixels are 0.5 x 2 mm\n");
  for (const std::string arguments : { "in.nrrd a.png --output-spacing 2",
                                       "in.nrrd a.nrrd --output-spacing 0.5 2",
                                       "in.nrrd a.html --output-spacing 0.5 2" })
  {
    this->ExpectSuccess(arguments);
  }

  this->WriteImage(MakeTimes({ m_Volume, m_Volume }), "times.nrrd");
  this->ExpectSuccess("times.nrrd a.png", note + "'a.png' becomes 2 numbered files\n");
  EXPECT_TRUE(fs::exists(m_Folder / "a-000.png") && fs::exists(m_Folder / "a-001.png"));
  this->ExpectSuccess("times.nrrd a.nrrd");
  this->ExpectSuccess("in.nrrd a.png --frames 2");

  const std::string blank = warning + "there is only background in the picture: ";
  const auto        zeros = MakeImageLike<VolumeType>(m_Volume);
  this->WriteImage(zeros, "zeros.nrrd");
  this->ExpectSuccess("zeros.nrrd a.png", blank + "'zeros.nrrd' has only the value 0\n");
  this->ExpectSuccess("zeros.nrrd a.nrrd --slab -1 1", blank + "'zeros.nrrd' has only the value 0\n");
  zeros->FillBuffer(-7);
  this->WriteImage(zeros, "same.nrrd");
  this->ExpectSuccess("same.nrrd a.png", blank + "'same.nrrd' has only the value -7\n");
  this->ExpectSuccess("same.nrrd a.png --background -8");
  const auto floats = MakeImageLike<itk::Image<float, 3>>(m_Volume);
  floats->FillBuffer(std::numeric_limits<float>::quiet_NaN());
  this->WriteImage(floats, "floats.nrrd");
  this->ExpectSuccess("floats.nrrd a.png", blank + "'floats.nrrd' has no numbers\n");
  this->ExpectSuccess("floats.nrrd a.nrrd --background nan", blank + "'floats.nrrd' has no numbers\n");

  const auto slice = MakeImage<VolumeType>({ { 6, 5, 1 } });
  slice->FillBuffer(3);
  for (const std::string name : { "slice.nii", "slice.nrrd", "slice.mha" })
  {
    this->WriteImage(slice, name);
    this->ExpectSuccess(name + " a.nrrd", warning + '\'' + name + "' has only one slice\n");
    this->ExpectSuccess(name + " --write-volume b.nrrd", warning + '\'' + name + "' has only one slice\n");
  }
  this->ExpectSuccess("in.nrrd picture.png");
  this->ExpectFailure("picture.png out.png",
                      "'picture.png' is one picture, not a volume; put all slices into one file");
}

TEST_F(ShearWarpMIPProgram, SaysWhyThereAreNoLetters)
{
  const auto getNote = [this](const std::string & arguments) {
    const Result result = this->Run(arguments);
    EXPECT_EQ(result.status, 0) << arguments;
    return result.messages + result.note;
  };
  const std::string begin = "shear-warp-mip: note: there are no letters: '";
  EXPECT_EQ(getNote("in.nrrd a.png"), begin + "a.png" + smallNote);
  EXPECT_EQ(getNote("in.nrrd a.png --size 47 480"), begin + "a.png" + smallNote);
  EXPECT_EQ(getNote("in.nrrd a.nrrd --depth-color b.png"), begin + "b.png" + smallNote);
  for (const std::string arguments :
       { "a.png --size 48 48", "a.png --no-labels", "a.nrrd", "a.html", "a.nrrd --depth-color b.png --no-labels" })
  {
    EXPECT_EQ(getNote("in.nrrd " + arguments), "");
  }

  // files that do not say where the patient's sides are
  this->WriteImage(m_Volume, "in.nii");
  std::ofstream(m_Folder / "in.vtk") << "# vtk DataFile Version 3.0\nno title\nASCII\nDATASET STRUCTURED_POINTS\n"
                                        "DIMENSIONS 2 2 2\nSPACING 1 1 1\nORIGIN 0 0 0\nPOINT_DATA 8\n"
                                        "SCALARS scalars short 1\nLOOKUP_TABLE default\n1 2 3 4 5 6 7 8\n";
  this->WithChangedFile(
    "in.nii",
    [](std::string bytes) { return bytes.replace(252, 4, 4, '\0'); },
    [&] {
      const std::string why = "in.nii' does not say how it lies in the patient\n";
      EXPECT_EQ(getNote("in.nii a.png --size 64 64"), begin + why);
      EXPECT_EQ(getNote("in.nii a.html"), begin + why);
      EXPECT_EQ(ReadText(m_Folder / "a.html").find("\"letters\""), std::string::npos);
      EXPECT_EQ(getNote("in.nii b.png --size 64 64 --no-labels"), "");
      EXPECT_EQ(GetPixels(this->Read("a.png").GetPointer()), GetPixels(this->Read("b.png").GetPointer()));
    });
  EXPECT_EQ(getNote("in.nii a.png --size 64 64"), "");
  const auto changeSpace = [&](const std::string & space, const std::string & note) {
    const std::string text = "space: left-posterior-superior\n";
    const auto        change = [&](std::string bytes) { return bytes.replace(bytes.find(text), text.size(), space); };
    this->WithChangedFile("in.nrrd", change, [&] { EXPECT_EQ(getNote("in.nrrd a.png --size 64 64"), note) << space; });
  };
  changeSpace("space: RAS\n", "");
  changeSpace("space: scanner-xyz\n", begin + "in.nrrd' does not say how it lies in the patient\n");
  changeSpace("space dimension: 3\n", begin + "in.nrrd' does not say how it lies in the patient\n");
  EXPECT_EQ(getNote("in.vtk a.png --size 64 64"), begin + "in.vtk' does not say how it lies in the patient\n");
}

TEST_F(ShearWarpMIPProgram, TakesExtensionsInCapitals)
{
  for (const std::string name : { "out.NRRD", "out.Nii.GZ", "out.PNG", "out.JPG", "out.TiF", "out.Html" })
  {
    std::string small = "small";
    for (const char letter : name.substr(3))
    {
      small += static_cast<char>(std::tolower(letter));
    }
    this->ExpectSuccess("in.nrrd " + name);
    this->ExpectSuccess("in.nrrd " + small);
    EXPECT_TRUE(ReadText(m_Folder / name) == ReadText(m_Folder / small)) << name;
    // again, over the former
    this->ExpectSuccess("in.nrrd " + name);
  }
}

TEST_F(ShearWarpMIPProgram, WritesBesideInputOfTheSameName)
{
  for (const std::string extension : { "png", "jpg", "jpeg", "tif", "tiff", "mha", "html" })
  {
    this->ExpectSuccess("in.nrrd in." + extension);
    this->ExpectSuccess("in.nrrd in." + extension);
  }
}

TEST_F(ShearWarpMIPProgram, AnswersWrongCalls)
{
  const std::pair<std::string, std::string> calls[] = {
    { "", "INPUT is required; see --help" },
    { "in.nrrd", "OUTPUT is required; see --help" },
    { "help", "OUTPUT is required; see --help" },
    { "in.nrrd out.png -veiw left", "--veiw left is not expected; did you mean '--view'?" },
    { "in.nrrd out.png -gpu", "--gpu is not expected; see --help" },
    { "-- -no.nrrd out.png", "'-no.nrrd' does not exist" },
    { "in.nrrd -m.png", "OUTPUT is required, or ./-m.png if '-m.png' is a file; see --help" },
    { "in.nrrd out.png --mask -no.nrrd", "'-no.nrrd' does not exist" },
    { "out.png in.nrrd -v left", "left is not expected; see --help" },
    { "in.nrrd out.png -o more.png", "OUTPUT: at most 1 can be given, not 2" },
    { "in.nrrd --output", "OUTPUT: a value is needed" },
    { "--depth= in.nrrd out.png", "--depth: a value is needed\n" },
    { "in.nrrd out.png --azimut 30", "--azimut 30 is not expected; did you mean '--azimuth'?" },
    { "in.nrrd out.png --WINDOW 3 4", "--WINDOW 3 4 is not expected; did you mean '--window'?" },
    { "in.nrrd out.png --spacing 2", "--spacing 2 is not expected; did you mean '--output-spacing'?" },
    { "in.nrrd out.png --oversampl=2", "--oversampl=2 is not expected; did you mean '--oversampling'?" },
    { "in.nrrd out.png --gpu", "--gpu is not expected; see --help" },
    { "in.nrrd out.png 1 2 3 4 5 6 7", "1 2 3 4 5 and 2 more is not expected; see --help" },
    { "in.nrrd out.png -30 -.5", "-30 -.5 is not expected; see --help" },
    { "in.nrrd out.png --$(printf %0120000d 30)", "--0000" },
    { "in.nrrd out.png --azimuth", "--azimuth: a value is needed, DEGREES" },
    { "in.nrrd out.png --frames", "--frames: a value is needed, N\n" },
    { "in.nrrd out.png --slab 1, far", "--slab: " },
    { "in.nrrd out.png --azimuth $(printf %0120000d 30)x", "--azimuth: '0000" },
    { "in.nrrd out.png --azimuth 30deg", "--azimuth: '30deg' is not a finite angle" },
    { "in.nrrd out.png --azimuth -inf", "--azimuth: '-inf' is not a finite angle" },
    { "in.nrrd out.png --view front",
      "--view: 'front' is not one of anterior, inferior, left, posterior, right, superior" },
    { "in.nrrd out.png --view anteroir",
      "--view: 'anteroir' is not one of anterior, inferior, left, posterior, right, superior; did you mean "
      "'anterior'?" },
    { "in.nrrd out.png --view ''", "--view: '' is not one of" },
    { "in.nrrd out.png --view", "--view: a value is needed, one of {anterior,inferior," },
    { "in.nrrd out.png --frames 2.5", "--frames: '2.5' is not a whole number from 1 to 65535" },
    { "in.nrrd out.png --multi-frame", "--multi-frame requires --dicom-out, or a folder as OUTPUT" },
    { "in.nrrd out.png --mode m", "--mode: 'm' is not one of absolute-maximum, maximum, mean, minimum" },
    { "in.nrrd out.png --rotation-axis upwards --frames 2", "--rotation-axis: it must be left, posterior" },
    { "in.nrrd out.png --rotation-axis 0 0 0 --frames 2", "The axis must be finite and not zero" },
    { "in.nrrd out.png --window 7", "--window: '7' is not two finite numbers LOW HIGH, nor one of angio, bone" },
    { "in.nrrd out.png --window 7 8 9", "9 is not expected; see --help" },
    { "in.nrrd out.png --window bones",
      "--window: 'bones' is not two finite numbers LOW HIGH, nor one of angio, bone, brain, lung, pet; did you mean "
      "'bone'?" },
    { "in.nrrd out.png --window b", "--window: 'b' is not two finite numbers" },
    { "in.nrrd out.png --window bone,lung", "--window: 'bone lung' is not two finite numbers" },
    { "in.nrrd out.png --window 0 inf", "--window: '0 inf' is not two finite numbers" },
    { "in.nrrd out.png --window bone --wl 40 80", "--w" },
    { "in.nrrd out.png --wl 40", "--wl: 2 values are needed, not 1" },
    { "in.nrrd out.png --wl 40 0", "--wl: WIDTH must be positive" },
    { "in.nrrd out.png --wl 40 -80", "--wl: WIDTH must be positive" },
    { "in.nrrd out.png --view left --view right", "--view: at most 1 can be given, not 2" },
    { "in.nrrd out.png --slab 30", "--slab: 2 values are needed, not 1" },
    { "in.nrrd out.png --crop 0 10 0 10 0", "--crop: 6 values are needed, not 5" },
    { "in.nrrd out.png --oversampling 1e0", "--oversampling: 1e0 not in {1,2}" },
    { "in.nrrd out.png --size 512x512", "--size: '512x512' is not a whole number of at least 1" },
    { "in.nrrd out.png --output-spacing 0,5", "--output-spacing: '0' is not a positive number; decimals have a point" },
    { "in.nrrd out.png --azimuth 22,5", "--azimuth: '22,5' is not a finite angle; decimals have a point" },
    { "in.nrrd out.png --rate -,5", "--rate: '-,5' is not a number from 0.1 to 100; decimals have a point" },
    { "in.nrrd out.png --frames 3,5", "--frames: '3,5' is not a whole number from 1 to 65535\n" },
    { "in.nrrd out.png scan1,2.nrrd", "scan1,2.nrrd is not expected; see --help" },
    { "in.nrrd out.png --wl 40,5 400,5", "400,5 is not expected; decimals have a point" },
    { "in.nrrd out.png --slab -2,5 2,5", "2,5 is not expected; decimals have a point" },
    { "in.nrrd out.png --window 800,100", "--window: LOW must be less than HIGH" },
    { "in.nrrd out.png --background black", "--background: 'black' is not a number" },
    { "in.nrrd out.png --local-maximum high", "--local-maximum: 'high' is not a number" },
    { "in.nrrd out.png --mode mean --exact", "--exact is not possible with --mode mean" },
    { "in.nrrd out.png --mode mean --depth d.nrrd", "--depth is not possible with --mode mean" },
    { "in.nrrd out.png --mode mean --depth-colour d.png", "--depth-colour is not possible with --mode mean" },
    { "in.nrrd out.png --mode mean --local-maximum 6", "--local-maximum is not possible with --mode mean" },
    { "in.nrrd out.png --mode mean --interpolation nearest",
      "--interpolation nearest is not possible with --mode mean" },
    { "in.nrrd out.png --interpolation nearest --oversampling 2",
      "--interpolation nearest is not possible with --oversampling: the picture has only values of voxels" },
    { "in.nrrd out.png --interpolation cubic", "--interpolation: 'cubic' is not one of linear, nearest" },
    { "in.nrrd out.png --local-maximum 6 --mode absolute-maximum",
      "--local-maximum is not possible with --mode absolute-maximum" },
    { "in.nrrd out.png --background 70000", "--background 70000 is not a value of the image's pixel type, short" },
    { "in.nrrd out.png --rocking", "--rocking requires --frames" },
    { "in.nrrd out.png --frames 3 --sliding-slab 10 5", "--frames excludes --sliding-slab" },
    { "in.nrrd out.png --mask-label 2", "--mask-label requires --mask" },
    { "in.nrrd out.png --rate 5", "--rate requires a series; see --frames" },
    { "in.nrrd out.html --rate 5", "--rate requires a series; see --frames" },
    { "in.nrrd out.gif --frames 2 --rate 1e9", "--rate: '1e9' is not a number from 0.1 to 100" },
    { "in.nrrd out.gif --frames 2 --rate nan", "--rate: 'nan' is not a number from 0.1 to 100" },
    { "in.nrrd out.png --page-bits 8 --frames 3", "--page-bits requires a page: .html" },
    { "--write-phantom new.nrrd more.nrrd", "INPUT excludes --write-phantom" },
    { "in.nrrd out.png --write-phantom new.nrrd", "INPUT excludes --write-phantom" },
    { "--write-phantom new.nrrd --azimut=30", "--azimut=30 is not expected; did you mean '--azimuth'?" },
    { "in.nrrd out.png --dicom-out in.nrrd", "'in.nrrd' is there already; a DICOM series needs an empty folder" },
    { "in.nrrd out.png --transform in.nrrd", "'in.nrrd' is not a transform that ITK can read" },
    { "in.nrrd out.png --depth out.jpg", "--depth: 'out.jpg' must have one of the extensions .mha .nrrd .nii .nii.gz" },
    { "in.nrrd out.dcm",
      "OUTPUT: 'out.dcm' must have one of the extensions .mha .nrrd .nii .nii.gz .png .jpg .jpeg "
      ".tif .tiff .gif .apng .mp4 .html; --dicom-out writes DICOM" },
    { "in.nrrd .", "'.' is there already; a DICOM series needs an empty folder" },
    { "in.nrrd -", "OUTPUT: '-' must have one of the extensions" },
    { "- out.png", "'-' does not exist" }
  };
  for (const auto & [arguments, answer] : calls)
  {
    this->ExpectFailure(arguments, "shear-warp-mip: " + answer);
  }

  for (const std::string part : { "--slab 1000,2000", "--crop 900,901,0,1,0,1" })
  {
    const std::string hint = part[2] == 's' ? " A slab must be at least as thick as the voxels." : "";
    this->ExpectSuccess("in.nrrd blank.png " + part,
                        "shear-warp-mip: warning: there is only background in the picture: is the image within " +
                          part.substr(0, 6) + '?' + hint + '\n');
    const auto pixels = this->ReadPixels("blank.png");
    EXPECT_EQ(std::count(pixels.begin(), pixels.end(), 0), static_cast<std::ptrdiff_t>(pixels.size()));
  }
}

TEST_F(ShearWarpMIPProgram, RefusesWrongInput)
{
  for (const std::string name : { "text.nii", "text.mha", "text.nrrd", "text.dcm", "text" })
  {
    std::ofstream(m_Folder / name) << "no image\n";
    this->ExpectFailure(name + " out.png", name);
  }

  this->WriteImage(this->Project(this->MakeTransform(Direction::Left)), "flat.nrrd");
  this->ExpectFailure("flat.nrrd out.png", "flat.nrrd");
  this->WriteImage(MakeImage<itk::Image<std::complex<float>, 3>>({ { 4, 4, 4 } }), "complex.nii");
  this->ExpectFailure("complex.nii out.png", "complex.nii");
  this->WriteImage(MakeImage<itk::Image<PixelType, 5>>({ { 4, 4, 4, 2, 2 } }), "deep.nrrd");
  this->ExpectFailure("deep.nrrd out.png", "'deep.nrrd' has 5 dimensions");
}

TEST_F(ShearWarpMIPProgram, RefusesDamagedFiles)
{
  struct File
  {
    std::string name;
    std::string data;
    bool        isCompressed;
    std::string refusal;
  };
  const std::string damaged = "' is damaged or incomplete";
  const File        files[] = { { "raw.nrrd", "raw.nrrd", false, "raw.nrrd" + damaged },
                                { "gzip.nrrd", "gzip.nrrd", true, "gzip.nrrd" + damaged },
                                { "raw.nhdr", "raw.raw", false, "raw.nhdr" + damaged },
                                { "gzip.nhdr", "gzip.raw.gz", true, "gzip.raw.gz" + damaged },
                                { "raw.mha", "raw.mha", false, "raw.mha" + damaged },
                                { "zlib.mha", "zlib.mha", true, "zlib.mha" + damaged },
                                { "raw.mhd", "raw.raw", false, "raw.mhd" + damaged },
                                { "zlib.mhd", "zlib.zraw", true, "zlib.zraw" + damaged },
                                { "raw.nii", "raw.nii", false, "raw.nii" + damaged },
                                { "gzip.nii.gz", "gzip.nii.gz", true, "gzip.nii.gz" + damaged },
                                { "raw.hdr", "raw.img", false, "raw.img" + damaged },
                                { "gzip.img.gz", "gzip.img.gz", true, "gzip.img.gz" + damaged } };
  for (const File & file : files)
  {
    SCOPED_TRACE(file.name);
    this->WriteImage(m_Volume, file.name, file.isCompressed);
    this->ExpectSuccess(file.name + " whole.mha");

    const auto        expectRefused = [&] { this->ExpectFailure(file.name + " out.png", file.refusal); };
    const std::size_t size = ReadText(m_Folder / file.data).size();
    for (const std::size_t kept : { size - 1, size - 9, size / 2 })
    {
      this->WithCutFile(file.data, kept, expectRefused);
    }
    if (file.isCompressed)
    {
      for (const std::size_t place : { size - 2, size - 6, size / 2 })
      {
        SCOPED_TRACE(place);
        const auto change = [place](std::string bytes) {
          bytes[place] = static_cast<char>(bytes[place] ^ 0x10);
          return bytes;
        };
        this->WithChangedFile(file.data, change, expectRefused);
      }
    }
  }

  this->WithChangedFile(
    "raw.nii",
    [](std::string bytes) { return bytes.replace(40, 2, "\x7f\x7f"); },
    [this] { this->ExpectFailure("raw.nii out.png", "'raw.nii' is damaged or incomplete: its NIfTI header"); });
}

TEST_F(ShearWarpMIPProgram, RefusesSizesThatFilesCannotHave)
{
  const std::string damaged = "' is damaged or incomplete: it has ";
  const std::string ofNrrd = "NRRD0004\ntype: short\ndimension: 3\nendian: little\nsizes: 1000 1000 1000\n";
  const std::string ofMeta = "ObjectType = Image\nNDims = 3\nElementType = MET_SHORT\nDimSize = ";
  const std::string local = "ElementDataFile = LOCAL\n12345";
  std::ofstream(m_Folder / "few.raw") << "12345";
  const std::array<std::string, 3> files[] = {
    { "a.nrrd", ofNrrd + "encoding: raw\n\n12345", "5 of 2000000000 bytes" },
    { "b.nrrd", ofNrrd + "Encoding: GZIP\ndata file: few.raw\n\n", "of 1937984 bytes" },
    { "c.nrrd", ofNrrd + "encoding: ascii\n\n12 45", "5 of 1000000000 bytes" },
    { "d.nrrd", ofNrrd + "encoding: raw\nFrameTransforms:=1 0 0\n\n12345", "5 of 2000000000 bytes" },
    { "a.mha", ofMeta + "1000 1000 1000\n" + local, "5 of 2000000000 bytes" },
    { "b.mha", ofMeta + "18446744073709551615 2 2\n" + local, "5 of 1" },
    { "c.mha", ofMeta + "1000 1000 1000\nFrameTransforms = 1 0 0\n" + local, "5 of 2000000000 bytes" },
    { "d.mhd", ofMeta + "1000 1000 1000\nElementDataFile = few.raw\n", "of 2000000000 bytes" }
  };
  for (const auto & [name, bytes, reason] : files)
  {
    std::ofstream(m_Folder / name) << bytes;
    this->ExpectFailure(name + " out.png", '\'' + name + damaged);
    EXPECT_NE(this->Run(name + " out.png").messages.find(reason), std::string::npos) << name;
  }
}

TEST_F(ShearWarpMIPProgram, RefusesWrongOutput)
{
  this->ExpectFailure("in.nrrd out.bmp", ".mha .nrrd .nii .nii.gz .png .jpg .jpeg .tif .tiff");
  this->ExpectFailure("in.nrrd out", ".png");
  this->ExpectFailure("in.nrrd .png", ".png");
  this->ExpectFailure("in.nrrd nowhere/out.png", "nowhere/out.png");
  fs::create_directory(m_Folder / "folder.png");
  this->ExpectFailure("in.nrrd out.nrrd --depth-colour folder.png", "'folder.png' is a folder");
  this->ExpectFailure("in.nrrd out.png --size 99999999 99999999", "memory");
  this->ExpectFailure("in.nrrd out.png --size 9999 9999 --frames 10000", "memory");
}

TEST_F(ShearWarpMIPProgram, LeavesFilesAsTheyWereIfDiskIsFull)
{
  for (const std::string name : { "out.mha", "out.nrrd", "out.nii", "out.nii.gz", "out.png", "out.jpg", "out.tif" })
  {
    std::ofstream(m_Folder / name) << "kept";
    // the first fails in a write, the second in a close
    const std::string full = "cannot write all of '" + name + "'; is the disk full?\n";
    this->ExpectFailure("in.nrrd " + name + " --output-spacing 0.1", full, "trap '' XFSZ && ulimit -f 3 &&");
    this->ExpectFailure("in.nrrd " + name + " --output-spacing 0.35", full, "trap '' XFSZ && ulimit -f 1 &&");
  }
  this->ExpectFailure(
    "in.nrrd out.png --output-spacing 0.1 --frames 3", "out-000.png", "trap '' XFSZ && ulimit -f 3 &&");
}

TEST_F(ShearWarpMIPProgram, LeavesNothingOnAFullDisk)
{
  fs::create_directory(m_Folder / "disk");
  const std::string disk = this->GetPath("disk");
  if (std::system(("mount -t tmpfs -o size=64k tmpfs '" + disk + "' 2>/dev/null").c_str()) != 0)
  {
    GTEST_SKIP() << "no right to mount a small disk";
  }
  for (const std::string extension : { "mha", "nrrd", "nii", "nii.gz", "png", "jpg", "tif" })
  {
    const std::string name = "disk/out." + extension;
    this->ExpectFailure("in.nrrd " + name + " --output-spacing 0.01", name);
  }
  this->ExpectFailure("in.nrrd disk/out.png --output-spacing 0.1 --frames 40", "disk/out-");
  this->ExpectSuccess("in.nrrd disk/out.png");
  EXPECT_EQ(std::system(("umount '" + disk + "'").c_str()), 0);
}

TEST_F(ShearWarpMIPProgram, RefusesReadOnlyFolder)
{
  const auto start = FindUnprivilegedStart();
  if (!start)
  {
    GTEST_SKIP() << "root writes everywhere";
  }
  fs::create_directory(m_Folder / "locked");
  fs::permissions(m_Folder / "locked", fs::perms::owner_read | fs::perms::owner_exec);
  this->ExpectFailure(
    "in.nrrd locked/out.png", "'locked/out.png': its folder does not exist or is not writable", *start);
}
} // namespace
