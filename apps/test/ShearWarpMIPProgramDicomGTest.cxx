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
#include "DicomPet.h"
#include "DicomSeries.h"
#include "Output.h"
#include "ShearWarpMIPProgramTestHelper.h"

#include "itkAffineTransform.h"
#include "itkCompositeTransform.h"
#include "itkGDCMSeriesFileNames.h"

#include <gdcmReader.h>

#include <sys/resource.h>

#include <cmath>
#include <csignal>

namespace
{
using namespace ShearWarpMIPProgramTest;
using TransformType = itk::AffineTransform<double, 3>;

const std::string ctImage = "1.2.840.10008.5.1.4.1.1.2";
const std::string mrImage = "1.2.840.10008.5.1.4.1.1.4";
const std::string secondaryCapture = "1.2.840.10008.5.1.4.1.1.7";

constexpr unsigned int columns = 7;
constexpr unsigned int rows = 5;

class ShearWarpMIPProgramDicom : public ShearWarpMIPProgram
{
protected:
  void
  SetUp() override
  {
    ShearWarpMIPProgram::SetUp();
    m_Series = m_Folder / "series";
  }

  /** Frames whose pixels are what \a value makes of their number. */
  template <typename TPixel>
  static AnyImage
  MakeFrames(unsigned int count, const std::function<double(double)> & value = [](double n) { return n; })
  {
    const auto   grid = itk::ImageBase<3>::New();
    const double spacing[] = { 0.75, 1.25, 1.0 };
    const double origin[] = { -20.0, -30.5, 0.0 };
    grid->SetRegions(itk::Size<3>{ { columns, rows, count } });
    grid->SetSpacing(spacing);
    grid->SetOrigin(origin);
    AnyImage     frames = MakeAnyImage<TPixel>(grid, 1);
    auto * const pixels = CastImage<TPixel>(frames).GetBufferPointer();
    for (std::size_t pixel = 0; pixel < std::size_t(columns) * rows * count; ++pixel)
    {
      pixels[pixel] = static_cast<TPixel>(value(static_cast<double>(pixel)));
    }
    return frames;
  }

  /** From anterior and then turning about the patient's axis: rows are the patient's height. */
  static std::vector<DicomView>
  MakeViews(unsigned int count)
  {
    std::vector<DicomView> views;
    views.reserve(count);
    for (unsigned int n = 0; n < count; ++n)
    {
      const auto anterior = TransformType::New();
      const auto turn = TransformType::New();
      anterior->Rotate(1, 2, itk::Math::pi_over_2);
      anterior->SetOffset(MakeVector(10.0, 20.0, 30.0));
      turn->Rotate3D(MakeVector(0.0, 0.0, 1.0), itk::Math::twopi * n / count);
      const auto composite = itk::CompositeTransform<double, 3>::New();
      composite->AddTransform(turn);
      composite->AddTransform(anterior);
      DicomView view;
      view.transform = composite.GetPointer();
      view.depth = 4.0;
      view.angle = 360.0 * n / count;
      views.push_back(view);
    }
    return views;
  }

  /** Writes slices with \a tags, and returns their names. */
  std::vector<fs::path>
  WriteSource(Tags tags, std::size_t count = 2) const
  {
    tags["0020|0052"] = "1.2.3.5";
    this->WriteDICOMSeries("1.2.3.4", "source", std::vector<double>(count), 8, false, tags);
    return ListFiles(m_Folder / "dicom");
  }

  static Tags
  GetCT()
  {
    return { { "0008|0060", "CT" },
             { "0008|0070", "Maker" },
             { "0018|0060", "120" },
             { "0010|0010", "Doe^Jane" },
             { "0010|0020", "ID 7" },
             { "0010|0030", "19700102" },
             { "0010|0040", "F" },
             { "0008|0050", "A1" },
             { "0008|0020", "20240102" },
             { "0008|0030", "101112" },
             { "0020|0010", "S1" },
             { "0008|103e", "Thorax" },
             { "0020|0011", "3" },
             { "0018|5100", "HFS" },
             { "0028|1050", "40" },
             { "0028|1051", "400" },
             { "0008|1030", "CT of a thorax" } };
  }

  static Tags
  GetMR()
  {
    return { { "0008|0060", "MR" }, { "0018|0020", "GR" }, { "0018|0021", "SP" }, { "0018|0081", "4.6" } };
  }

  struct File
  {
    Tags                           tags;
    itk::Image<double, 2>::Pointer image;
    itk::GDCMImageIO::Pointer      io;
  };

  static File
  ReadFile(const fs::path & path)
  {
    File file;
    file.io = itk::GDCMImageIO::New();
    const auto reader = itk::ImageFileReader<itk::Image<double, 2>>::New();
    reader->SetImageIO(file.io);
    reader->SetFileName(path.string());
    reader->Update();
    file.image = reader->GetOutput();
    const auto & dictionary = file.io->GetMetaDataDictionary();
    for (const std::string & key : dictionary.GetKeys())
    {
      std::string value;
      itk::ExposeMetaData(dictionary, key, value);
      const auto end = value.find_last_not_of(std::string(" \0", 2));
      file.tags[key] = end == std::string::npos ? "" : value.substr(0, end + 1);
    }
    return file;
  }

  /** In the order of their names. */
  std::vector<File>
  ReadSeries() const
  {
    const auto        names = ListFiles(m_Series);
    std::vector<File> files(names.size());
    std::transform(names.begin(), names.end(), files.begin(), ReadFile);
    return files;
  }

  /** That pixels read back differ from what was written by at most \a tolerance. */
  template <typename TPixel>
  void
  ExpectPixels(const AnyImage & frames, const std::vector<File> & files, double tolerance) const
  {
    const auto * expected = CastImage<TPixel>(frames).GetBufferPointer();
    ASSERT_EQ(files.size(), frames.image->GetLargestPossibleRegion().GetSize(2));
    for (const File & file : files)
    {
      for (const double pixel : GetPixels(file.image))
      {
        ASSERT_NEAR(pixel, static_cast<double>(*expected++), tolerance);
      }
    }
  }

  template <typename TPixel>
  std::vector<File>
  ExpectExact(const std::function<double(double)> & value, const std::vector<fs::path> & source = {})
  {
    const AnyImage frames = MakeFrames<TPixel>(2, value);
    fs::remove_all(m_Series);
    WriteDicomSeries(frames, MakeViews(2), source, m_Series);
    auto files = this->ReadSeries();
    this->ExpectPixels<TPixel>(frames, files, 0.0);
    return files;
  }

  static void
  ExpectTags(const File & file, const Tags & expected)
  {
    for (const auto & [tag, value] : expected)
    {
      EXPECT_EQ(file.tags.at(tag), value) << tag;
    }
  }

  void
  ExpectError(const AnyImage &               frames,
              const std::vector<DicomView> & views,
              const std::vector<fs::path> &  source,
              const fs::path &               directory,
              const std::string &            mention,
              const DicomSeriesOptions &     options = {}) const
  {
    SCOPED_TRACE(mention);
    const auto before = this->GetContents();
    try
    {
      WriteDicomSeries(frames, views, source, directory, options);
      ADD_FAILURE() << "no error";
    }
    catch (const std::runtime_error & error)
    {
      EXPECT_NE(std::string(error.what()).find(mention), std::string::npos) << error.what();
    }
    EXPECT_TRUE(before == this->GetContents());
  }

  fs::path m_Series;
};

TEST_F(ShearWarpMIPProgramDicom, WritesCTInHounsfieldUnits)
{
  const auto source = this->WriteSource(GetCT());
  const auto files = this->ExpectExact<short>([](double n) { return -1024.0 + 100.0 * n; }, source);
  Tags       expected = { { "0008|0016", ctImage },
                          { "0008|0008", "DERIVED\\SECONDARY\\PROJECTION IMAGE\\MAX_IP" },
                          { "0028|0103", "1" },
                          { "0028|1052", "0" },
                          { "0028|1053", "1" },
                          { "0028|1054", "HU" },
                          { "0028|0301", "NO" },
                          { "0008|103e", "MIP Thorax" },
                          { "0020|0011", "1003" },
                          { "0008|0070", "" },
                          { "0008|1090", "shear-warp-mip" },
                          { "0020|000d", "1.2.3" },
                          { "0020|0052", "1.2.3.5" } };
  // the others are copied
  expected.merge(GetCT());
  for (const File & file : files)
  {
    ExpectTags(file, expected);
    EXPECT_EQ(file.tags.at("0020|000e"), files[0].tags.at("0020|000e"));
    EXPECT_NE(file.tags.at("0020|000e"), "1.2.3.4");
  }
  EXPECT_NE(files[0].tags.at("0008|0018"), files[1].tags.at("0008|0018"));
}

TEST_F(ShearWarpMIPProgramDicom, ReferencesSourcesAndEquipment)
{
  const auto source = this->WriteSource(GetCT(), 3);
  WriteDicomSeries(MakeFrames<short>(1), MakeViews(1), source, m_Series);
  gdcm::Reader reader;
  reader.SetFileName((m_Series / "frame-001.dcm").string().c_str());
  ASSERT_TRUE(reader.Read());
  const gdcm::DataSet & dataSet = reader.GetFile().GetDataSet();
  const auto            getText = [](const gdcm::DataSet & item, const gdcm::Tag & tag) {
    const auto * const value = item.GetDataElement(tag).GetByteValue();
    return std::string(value->GetPointer(), value->GetLength());
  };
  const auto getItem = [](const gdcm::DataSet & from, const gdcm::Tag & tag, std::size_t item) {
    return from.GetDataElement(tag).GetValueAsSQ()->GetItem(item).GetNestedDataSet();
  };
  const gdcm::Tag sources(0x0008, 0x2112);
  ASSERT_EQ(dataSet.GetDataElement(sources).GetValueAsSQ()->GetNumberOfItems(), 3u);
  for (std::size_t item = 1; item <= 3; ++item)
  {
    const auto reference = getItem(dataSet, sources, item);
    EXPECT_EQ(getText(reference, gdcm::Tag(0x0008, 0x1155)).c_str(), "1.2.3.4." + std::to_string(item));
  }
  const auto derivation = getItem(dataSet, gdcm::Tag(0x0008, 0x9215), 1);
  EXPECT_EQ(getText(derivation, gdcm::Tag(0x0008, 0x0100)), "113078");
  const auto equipment = getItem(dataSet, gdcm::Tag(0x0018, 0xa001), 1);
  EXPECT_EQ(getText(equipment, gdcm::Tag(0x0008, 0x0070)), "Maker ");
}

TEST_F(ShearWarpMIPProgramDicom, PlacesEachFrame)
{
  const auto source = this->WriteSource(GetCT());
  auto       views = MakeViews(4);
  views[1].thickness = 2.5;
  WriteDicomSeries(MakeFrames<short>(4), views, source, m_Series);
  const auto files = this->ReadSeries();
  ASSERT_EQ(files.size(), 4u);
  const std::string orientations[] = { "L\\F", "P\\F", "R\\F", "A\\F" };
  for (unsigned int n = 0; n < 4; ++n)
  {
    EXPECT_EQ(files[n].tags.at("0020|0013"), std::to_string(n + 1));
    EXPECT_EQ(files[n].tags.at("0020|0020"), orientations[n]);
    EXPECT_EQ(files[n].tags.at("0018|0050"), n == 1 ? "2.5" : "");
    EXPECT_EQ(files[n].tags.at("0020|4000"), "Turned by " + std::to_string(90 * n) + " degrees");

    const auto & io = *files[n].io;
    const double corner[] = { -20.0, -30.5, 4.0 };
    const double last[] = { -20.0 + (columns - 1) * 0.75, -30.5 + (rows - 1) * 1.25, 4.0 };
    const auto   first = views[n].transform->TransformPoint(itk::Point<double, 3>(corner));
    const auto   end = views[n].transform->TransformPoint(itk::Point<double, 3>(last));
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      EXPECT_NEAR(io.GetOrigin(axis), first[axis], 1e-9);
      EXPECT_NEAR(io.GetOrigin(axis) + io.GetDirection(0)[axis] * io.GetSpacing(0) * (columns - 1) +
                    io.GetDirection(1)[axis] * io.GetSpacing(1) * (rows - 1),
                  end[axis],
                  1e-9);
    }
  }
}

TEST_F(ShearWarpMIPProgramDicom, ScalesSpacing)
{
  auto       views = MakeViews(1);
  const auto scale = TransformType::New();
  scale->Scale(2.0);
  views[0].transform = scale.GetPointer();
  views[0].thickness = 2.5;
  WriteDicomSeries(MakeFrames<short>(1), views, {}, m_Series);
  const auto tags = this->ReadSeries()[0].tags;
  EXPECT_EQ(tags.at("0028|0030"), "2.5\\1.5");
  EXPECT_EQ(tags.at("0018|0050"), "5");
  // what is between the planes of a slab, not how far rays go in it
  scale->Shear(0, 2, 3.0);
  fs::remove_all(m_Series);
  WriteDicomSeries(MakeFrames<short>(1), views, {}, m_Series);
  EXPECT_EQ(this->ReadSeries()[0].tags.at("0018|0050"), "5");
}

TEST_F(ShearWarpMIPProgramDicom, FindsDepthOfAPoint)
{
  const double center[] = { 11.0, 15.0, 31.0 };
  // from anterior, w is posterior, and the views are 20 mm away
  EXPECT_NEAR(ComputeDepth(MakeViews(1)[0].transform, center), 15.0 - 20.0, 1e-12);
  // turned to the half, the other way
  EXPECT_NEAR(ComputeDepth(MakeViews(2)[1].transform, center), -15.0 - 20.0, 1e-12);
}

TEST_F(ShearWarpMIPProgramDicom, WritesMRWithoutRescale)
{
  const auto source = this->WriteSource(GetMR());
  const auto files = this->ExpectExact<float>([](double n) { return 900.0 * n; }, source);
  EXPECT_EQ(files[0].tags.at("0008|0016"), mrImage);
  EXPECT_EQ(files[0].tags.at("0028|0103"), "0");
  EXPECT_EQ(files[0].tags.at("0018|0081"), "4.6");
  EXPECT_EQ(files[0].tags.at("0008|103e"), "MIP");
  EXPECT_EQ(files[0].tags.count("0028|1052"), 0u);
  // all values are in the window
  EXPECT_EQ(files[0].tags.at("0028|1050"), "31050.5");
  EXPECT_EQ(files[0].tags.at("0028|1051"), "62101");
}

TEST_F(ShearWarpMIPProgramDicom, ChoosesSecondaryCaptureForOthers)
{
  const auto ramp = [](double n) { return 1.0 * n; };
  EXPECT_EQ(this->ExpectExact<short>(ramp)[0].tags.at("0008|0016"), secondaryCapture);
  const auto positron = this->ExpectExact<short>(ramp, this->WriteSource({ { "0008|0060", "PT" } }))[0];
  EXPECT_EQ(positron.tags.at("0008|0016"), secondaryCapture);
  EXPECT_EQ(positron.tags.at("0008|0060"), "PT");
  auto incomplete = GetMR();
  incomplete.erase("0018|0020");
  EXPECT_EQ(this->ExpectExact<short>(ramp, this->WriteSource(incomplete))[0].tags.at("0008|0016"), secondaryCapture);
  // MR cannot hold these
  const auto scaled = this->ExpectExact<int>([](double n) { return 100000.0 + n; }, this->WriteSource(GetMR()))[0];
  EXPECT_EQ(scaled.tags.at("0008|0016"), secondaryCapture);
  EXPECT_EQ(scaled.tags.at("0008|0060"), "MR");
}

TEST_F(ShearWarpMIPProgramDicom, MakesStudyWithoutSource)
{
  const auto files = this->ExpectExact<unsigned short>([](double n) { return 65535.0 - n; });
  for (const std::string tag : { "0010|0010", "0010|0020", "0010|0030", "0010|0040", "0008|0020", "0008|0050" })
  {
    EXPECT_EQ(files[0].tags.at(tag), "") << tag;
  }
  EXPECT_EQ(files[0].tags.at("0008|0060"), "OT");
  EXPECT_EQ(files[0].tags.at("0008|0064"), "WSD");
  for (const std::string tag : { "0020|000d", "0020|000e", "0020|0052" })
  {
    EXPECT_FALSE(files[0].tags.at(tag).empty());
    EXPECT_EQ(files[0].tags.at(tag), files[1].tags.at(tag));
  }
}

TEST_F(ShearWarpMIPProgramDicom, KeepsWholeNumbersThatFit)
{
  this->ExpectExact<unsigned char>([](double n) { return 3.0 * n; });
  this->ExpectExact<signed char>([](double n) { return n - 30.0; });
  this->ExpectExact<float>([](double n) { return n == 0 ? -32768.0 : 32767.0; });
  this->ExpectExact<float>([](double n) { return n == 0 ? 0.0 : 65535.0; });
  this->ExpectExact<double>([](double n) { return n == 0 ? -40000.0 : 25535.0; });
  this->ExpectExact<double>([](double) { return -7.0; });
  this->ExpectExact<double>([](double) { return 0.5; });
  this->ExpectExact<unsigned long long>([](double n) { return 1e12 + 900.0 * n; });
}

TEST_F(ShearWarpMIPProgramDicom, RoundsOtherNumbers)
{
  const AnyImage frames = MakeFrames<float>(2, [](double n) { return std::sin(0.1 * n) / 3.0; });
  WriteDicomSeries(frames, MakeViews(2), {}, m_Series);
  const auto files = this->ReadSeries();
  this->ExpectPixels<float>(frames, files, 0.51 * 2.0 / 3.0 / 65535.0);
  EXPECT_EQ(files[0].tags.at("0028|1052"), files[1].tags.at("0028|1052"));
  EXPECT_EQ(files[0].tags.at("0028|1056"), "LINEAR_EXACT");
  EXPECT_NEAR(std::stod(files[0].tags.at("0028|1051")), 2.0 / 3.0, 0.01);
}

TEST_F(ShearWarpMIPProgramDicom, KeepsCharacterSetAndCompression)
{
  auto tags = GetCT();
  tags["0008|0005"] = "ISO_IR 100";
  tags["0010|0010"] = "M\xfcller^Ren\xe9";
  tags["0028|2110"] = "01";
  tags["0028|2112"] = "8.5";
  tags["0028|2114"] = "ISO_10918_1";
  const auto file = this->ExpectExact<short>([](double n) { return n; }, this->WriteSource(tags))[0];
  for (const std::string tag : { "0008|0005", "0010|0010", "0028|2110", "0028|2112", "0028|2114" })
  {
    EXPECT_EQ(file.tags.at(tag), tags.at(tag)) << tag;
  }
}

TEST_F(ShearWarpMIPProgramDicom, SaysThatValuesAreMeans)
{
  DicomSeriesOptions options;
  options.mode = itk::ShearWarpMIPImageFilterEnums::Mode::Mean;
  WriteDicomSeries(MakeFrames<short>(2), MakeViews(2), this->WriteSource(GetCT()), m_Series, options);
  const auto tags = this->ReadSeries()[0].tags;
  EXPECT_EQ(tags.at("0008|0008"), "DERIVED\\SECONDARY\\PROJECTION IMAGE\\MEAN");
  EXPECT_EQ(tags.at("0008|2111"), "Mean intensity projection");
  EXPECT_EQ(tags.at("0008|103e").substr(0, 3), "AIP");
}

TEST_F(ShearWarpMIPProgramDicom, TakesOptions)
{
  DicomSeriesOptions options;
  options.mode = itk::ShearWarpMIPImageFilterEnums::Mode::Minimum;
  options.description = "airways";
  options.derivation = " of slabs";
  options.number = 12;
  options.window = { -1000.0, -500.0 };
  options.version = "1.2";
  WriteDicomSeries(MakeFrames<short>(2), MakeViews(2), this->WriteSource(GetCT()), m_Series, options);
  const auto tags = this->ReadSeries()[0].tags;
  EXPECT_EQ(tags.at("0008|0008"), "DERIVED\\SECONDARY\\PROJECTION IMAGE\\MIN_IP");
  EXPECT_EQ(tags.at("0008|103e"), "airways");
  EXPECT_EQ(tags.at("0008|2111"), "Minimum intensity projection of slabs");
  EXPECT_EQ(tags.at("0020|0011"), "12");
  EXPECT_EQ(tags.at("0028|1050"), "-749.5");
  EXPECT_EQ(tags.at("0028|1051"), "501");
  EXPECT_EQ(tags.at("0018|1020"), "1.2");
}

TEST_F(ShearWarpMIPProgramDicom, SortsManyFrames)
{
  WriteDicomSeries(MakeFrames<short>(1001, [](double n) { return std::floor(n / (1.0 * columns * rows)); }),
                   MakeViews(1001),
                   {},
                   m_Series);
  const auto files = this->ReadSeries();
  ASSERT_EQ(files.size(), 1001u);
  for (unsigned int n = 0; n < 1001; ++n)
  {
    ASSERT_EQ(files[n].tags.at("0020|0013"), std::to_string(n + 1));
    ASSERT_EQ(GetPixels(files[n].image).front(), n);
  }
  const auto names = itk::GDCMSeriesFileNames::New();
  names->SetUseSeriesDetails(false);
  names->SetDirectory(m_Series.string());
  EXPECT_EQ(names->GetSeriesUIDs().size(), 1u);
}

TEST_F(ShearWarpMIPProgramDicom, FillsEmptyFolder)
{
  fs::create_directory(m_Series);
  OutputFiles().ReserveFolder(m_Series);
  const AnyImage frames = MakeFrames<short>(2);
  WriteDicomSeries(frames, MakeViews(2), {}, m_Series / "");
  EXPECT_EQ(ListFiles(m_Series), (std::vector<fs::path>{ m_Series / "frame-001.dcm", m_Series / "frame-002.dcm" }));
  // nothing else but in.nrrd
  EXPECT_EQ(this->GetContents().size(), 4u);
  EXPECT_THROW(OutputFiles().ReserveFolder(m_Series), std::runtime_error);
  this->ExpectError(frames, MakeViews(2), {}, m_Series, "needs an empty folder");
}

TEST_F(ShearWarpMIPProgramDicom, LeavesNothingIfInterrupted)
{
  const AnyImage frames = MakeFrames<float>(2);
  EXPECT_EXIT(
    {
      std::signal(SIGINT, SIG_DFL); // what a shell starts in the background ignores it
      const HeldSignals heldSignals;
      std::raise(SIGINT);
      this->ExpectError(frames, MakeViews(2), {}, m_Series, "interrupted");
      std::_Exit(HasFailure() ? 1 : 7);
    },
    testing::ExitedWithCode(7),
    "");
}

TEST_F(ShearWarpMIPProgramDicom, LeavesNothingIfDiskIsFull)
{
  const AnyImage frames = MakeFrames<float>(2);
  EXPECT_EXIT(
    {
      rlimit limit;
      limit.rlim_cur = limit.rlim_max = 512;
      setrlimit(RLIMIT_FSIZE, &limit);
      std::signal(SIGXFSZ, SIG_IGN);
      this->ExpectError(
        frames, MakeViews(2), {}, m_Series, "cannot write all of '" + (m_Series / "frame-001.dcm").string());
      std::_Exit(HasFailure() ? 1 : 7);
    },
    testing::ExitedWithCode(7),
    "");
}

TEST_F(ShearWarpMIPProgramDicom, RefusesWhatIsNotPossible)
{
  const AnyImage frames = MakeFrames<float>(2);
  const auto     views = MakeViews(2);
  std::ofstream(m_Folder / "file.txt") << "no image\n";
  EXPECT_THROW(OutputFiles().ReserveFolder(m_Folder / "no" / "series"), std::runtime_error);
  this->ExpectError(frames, views, {}, m_Folder / "no" / "series", "does not exist or is not writable");
  this->ExpectError(frames, views, {}, m_Folder / "file.txt", "needs an empty folder");
  this->ExpectError(frames, views, {}, m_Folder / "file.txt" / "series", "does not exist or is not writable");
  this->ExpectError(frames, views, { m_Folder / "file.txt" }, m_Series, "file.txt' is not a DICOM file");
  this->ExpectError(frames, MakeViews(3), {}, m_Series, "2 frames, but 3 views");

  auto sheared = views;
  auto shear = TransformType::New();
  shear->Shear(0, 1, 0.1);
  sheared[1].transform = shear.GetPointer();
  this->ExpectError(frames, sheared, {}, m_Series, "frame 2 is sheared");

  const AnyImage infinite = MakeFrames<float>(2, [](double n) { return std::log(n); });
  this->ExpectError(infinite, views, {}, m_Series, "a pixel is -inf");
  const auto grid = itk::ImageBase<3>::New();
  grid->SetRegions(itk::Size<3>{ { 65536, 1, 1 } });
  this->ExpectError(MakeAnyImage<short>(grid, 1), MakeViews(1), {}, m_Series, "65536 x 1 pixels");
  grid->SetRegions(itk::Size<3>{ { 2, 2, 1 } });
  this->ExpectError(MakeAnyImage<short>(grid, 3), MakeViews(1), {}, m_Series, "one component");

  DicomSeriesOptions options;
  options.window = { 2.0, 2.0 };
  this->ExpectError(frames, views, {}, m_Series, "lower end of a window", options);
  options.window.reset();
  options.description = std::string(65, 'a');
  this->ExpectError(frames, views, {}, m_Series, "at most 64", options);
  options.description = "a\\b";
  this->ExpectError(frames, views, {}, m_Series, "no backslash", options);
}

/** Turned about z by \a angles, seen from above by \a elevation, all in degrees; middles are \a offset away from the
 * axis. */
std::vector<PicturePlane>
MakePlanes(const std::vector<double> & angles, double elevation = 0.0, double offset = 0.0)
{
  std::vector<PicturePlane> planes;
  for (const double angle : angles)
  {
    constexpr double degree = itk::Math::pi / 180.0;
    const double     cosine = std::cos(angle * degree);
    const double     sine = std::sin(angle * degree);
    const double     up = std::sin(elevation * degree);
    PicturePlane     plane;
    plane.right = MakeVector(cosine, sine, 0.0);
    plane.down = MakeVector(-sine * up, cosine * up, -std::cos(elevation * degree));
    plane.center.Fill(40.0);
    plane.center += offset * plane.right + 7.0 * itk::CrossProduct(plane.right, plane.down);
    plane.angle = angle;
    planes.push_back(plane);
  }
  return planes;
}

TEST(ShearWarpMIPProgramPet, FindsWhatIsNoReprojection)
{
  for (const auto & angles : std::vector<std::vector<double>>{
         { 0 }, { 0, 180 }, { 0, 90, 180, 270 }, { 10, -20, -300 }, { 0, 1e-3 }, { 5, 95, 185 } })
  {
    EXPECT_EQ(FindReprojectionObstacle(MakePlanes(angles), 1e-6), "") << angles.size();
  }
  const auto find = [](const std::vector<PicturePlane> & planes) { return FindReprojectionObstacle(planes, 0.1); };
  const std::string twice = "the views do not turn one way, once at most";
  EXPECT_EQ(find(MakePlanes({ 0, 0 })), twice);
  EXPECT_EQ(find(MakePlanes({ 0, 180, 360 })), twice);
  EXPECT_EQ(find(MakePlanes({ 0, 20, 10 })), twice);
  EXPECT_EQ(find(MakePlanes({ 0, std::nan("") })), "the views are no turn");
  EXPECT_EQ(find(MakePlanes({ 0, 120, 240 }, 1.0)), "the views are not at right angles to the axis");
  EXPECT_EQ(find(MakePlanes({ 0, 120, 240 }, 0.0, 0.2)), "the pictures' middles are not on the axis");
  EXPECT_EQ(find(MakePlanes({ 0, 120, 240 }, 0.0, 0.03)), "");
  // two opposite views of one line; a third is beside it
  EXPECT_EQ(find(MakePlanes({ 0, 180 }, 0.0, 0.04)), "");
  auto planes = MakePlanes({ 0, 90, 180 });
  planes[1].center[2] += 1.0;
  EXPECT_EQ(find(planes), "the pictures' middles are not on the axis");
  planes = MakePlanes({ 0, 90, 180 });
  std::swap(planes[1].right, planes[1].down);
  planes[1].right *= -1.0;
  EXPECT_EQ(find(planes), "the views do not turn about one axis");
}
} // namespace
