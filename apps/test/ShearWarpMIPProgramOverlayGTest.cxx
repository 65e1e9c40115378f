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

#include "itkAffineTransform.h"
#include "itkEuler3DTransform.h"
#include "itkRGBPixel.h"
#include "itkVectorImage.h"

#include <gdcmReader.h>
#include <gdcmWriter.h>

#include <cmath>
#include <numeric>
#include <set>

namespace
{
using namespace ShearWarpMIPProgramTest;
using OverlayType = itk::Image<float, 3>;
using OverlayFilterType = itk::ShearWarpMIPImageFilter<OverlayType>;
using ColourType = itk::RGBPixel<unsigned char>;
using ColourPictureType = itk::Image<ColourType, 2>;
using GreyPictureType = itk::Image<unsigned char, 2>;
using LabelType = itk::Image<unsigned char, 3>;
using TransformType = itk::Transform<double, 3, 3>;

/** The map "hot" as ITK has it: each component is cut off at 0 and 1, and rounded down. */
std::array<double, 3>
Hot(double fraction)
{
  const double t = std::clamp(fraction, 0.0, 1.0);
  const auto   ramp = [](double value) { return std::floor(255.0 * std::clamp(value, 0.0, 1.0)); };
  return { { ramp(63.0 / 26.0 * t - 1.0 / 13.0), ramp(63.0 / 26.0 * t - 11.0 / 13.0), ramp(4.5 * t - 3.5) } };
}

class ShearWarpMIPProgramOverlay : public ShearWarpMIPProgram
{
protected:
  void
  SetUp() override
  {
    ShearWarpMIPProgram::SetUp();
    m_Overlay = MakeOverlay();
    this->WriteImage(m_Overlay, "pet.nrrd");
  }

  /** Of another grid than INPUT, turned and smaller. */
  static OverlayType::Pointer
  MakeOverlay()
  {
    const auto overlay = MakeImage<OverlayType>({ { 5, 9, 4 } }, { 1.7, 1.1, 2.3 }, { -36.0, 14.0, 5.0 });
    const auto turn = itk::Euler3DTransform<double>::New();
    turn->SetRotation(0.0, 0.0, 0.3);
    overlay->SetDirection(turn->GetMatrix());
    itk::ImageRegionIteratorWithIndex<OverlayType> it(overlay, overlay->GetBufferedRegion());
    for (; !it.IsAtEnd(); ++it)
    {
      const auto & index = it.GetIndex();
      it.Set(0.25F * static_cast<float>((3 * index[0] + 7 * index[1] + 5 * index[2]) % 23));
    }
    return overlay;
  }

  /** The overlay's projection on the pixels of \a picture. */
  itk::Image<float, 2>::Pointer
  ProjectOverlay(
    const TransformType *                            transform,
    const PictureType *                              picture,
    const std::function<void(OverlayFilterType &)> & setUp = [](OverlayFilterType &) {}) const
  {
    const auto filter = OverlayFilterType::New();
    filter->SetInput(m_Overlay);
    filter->SetTransform(transform);
    filter->SetSize(picture->GetLargestPossibleRegion().GetSize());
    filter->SetOutputSpacing(picture->GetSpacing());
    filter->SetOutputOrigin(picture->GetOrigin());
    setUp(*filter);
    filter->Update();
    return filter->GetOutput();
  }

  /** Expects out.png to be blended from base.png and \a overlay. */
  void
  ExpectBlended(const itk::Image<float, 2> * overlay, double low, double high, double opacity) const
  {
    const auto base = this->ReadPixels<ColourPictureType>("base.png");
    const auto blended = this->ReadPixels<ColourPictureType>("out.png");
    const auto values = GetPixels(overlay);
    ASSERT_EQ(blended.size(), values.size());
    ASSERT_EQ(base.size(), values.size());
    std::size_t coloured = 0;
    for (std::size_t n = 0; n < values.size(); ++n)
    {
      const double value = values[n];
      const auto   colour = Hot((value - low) / (high - low));
      coloured += value > low ? 1 : 0;
      for (unsigned int component = 0; component < 3; ++component)
      {
        const double expected = value > low ? (1.0 - opacity) * base[n][component] + opacity * colour[component]
                                            : static_cast<double>(base[n][component]);
        ASSERT_NEAR(blended[n][component], expected, 0.5001) << "pixel " << n << ", value " << value;
      }
    }
    EXPECT_GT(coloured, values.size() / 10);
    EXPECT_LT(coloured, values.size());
  }

  /** Of a DICOM file. */
  void
  SetAttribute(const fs::path & file, const gdcm::Tag & tag, gdcm::VR::VRType type, std::string text) const
  {
    gdcm::Reader reader;
    reader.SetFileName(file.c_str());
    ASSERT_TRUE(reader.Read());
    text.resize(text.size() + text.size() % 2);
    gdcm::DataElement element(tag, 0, type);
    element.SetByteValue(text.data(), static_cast<std::uint32_t>(text.size()));
    reader.GetFile().GetDataSet().Replace(element);
    reader.GetFile().GetHeader().Clear();
    reader.GetFile().GetHeader().SetDataSetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
    gdcm::Writer writer;
    writer.SetFile(reader.GetFile());
    writer.SetFileName(file.c_str());
    ASSERT_TRUE(writer.Write());
  }

  OverlayType::Pointer m_Overlay;
};

TEST_F(ShearWarpMIPProgramOverlay, BlendsOnThePicturesGrid)
{
  const auto transform = this->MakeTransform(Direction::Anterior, 20.0, 10.0);
  const auto expectBlended = [&](const std::string &                              where,
                                 const std::string &                              how,
                                 double                                           opacity,
                                 const std::function<void(OverlayFilterType &)> & setUp) {
    SCOPED_TRACE(where + how);
    const std::string view = " --azimuth 20 --elevation 10 ";
    const auto        getNote = [&where](const std::string & name) {
      const bool isDistorted = where.find("0.4,0.3") != std::string::npos;
      return isDistorted ? "shear-warp-mip: note: '" + name + "' looks distorted: its pixels are 0.4 x 0.3 mm\n" : "";
    };
    this->ExpectSuccess("in.nrrd base.png --no-labels --window 10 110" + view + where, getNote("base.png"));
    this->ExpectSuccess("in.nrrd grid.nrrd" + view + where);
    this->ExpectSuccess("in.nrrd out.png --no-labels --window 10 110 --overlay pet.nrrd --overlay-window 1 4.5" + view +
                          where + how,
                        getNote("out.png"));
    this->ExpectBlended(this->ProjectOverlay(transform, this->Read("grid.nrrd"), setUp), 1.0, 4.5, opacity);
  };
  const auto asIs = [](OverlayFilterType &) {};
  expectBlended("", "", 0.6, asIs);
  expectBlended("--output-spacing 0.4,0.3 --size 50 70", " --opacity 0.35", 0.35, asIs);
  expectBlended("", " --opacity 1 --overlay-colour hot", 1.0, asIs);
  expectBlended("--exact", "", 0.6, [](OverlayFilterType & filter) { filter.ExactOn(); });
  expectBlended("--oversampling 2", "", 0.6, [](OverlayFilterType & filter) { filter.SetOversampling(2); });
  expectBlended("--slab -3 2", "", 0.6, [](OverlayFilterType & filter) {
    filter.SetSlabNear(-3.0);
    filter.SetSlabFar(2.0);
  });
  expectBlended("--crop -34 inf 16 22 -inf inf", "", 0.6, [](OverlayFilterType & filter) {
    OverlayFilterType::PhysicalPointType lower(-std::numeric_limits<double>::infinity());
    OverlayFilterType::PhysicalPointType upper(std::numeric_limits<double>::infinity());
    lower[0] = -34.0;
    lower[1] = 16.0;
    upper[1] = 22.0;
    filter.SetCropLower(lower);
    filter.SetCropUpper(upper);
  });
  // the overlay's maximum, whatever INPUT shows
  expectBlended("--mode minimum --attenuation 0.05", "", 0.6, asIs);
  expectBlended("--local-maximum 60", "", 0.6, asIs);
}

TEST_F(ShearWarpMIPProgramOverlay, IsTransparentUpToLow)
{
  this->ExpectSuccess("in.nrrd base.png");
  const auto base = this->ReadPixels<GreyPictureType>("base.png");
  for (const std::string transparent : { "--opacity 0", "--overlay-window 5.5 6" })
  {
    this->ExpectSuccess("in.nrrd out.png --overlay pet.nrrd " + transparent,
                        transparent == "--opacity 0"
                          ? ""
                          : "shear-warp-mip: warning: nothing of 'pet.nrrd' is in the picture: no "
                            "value is above 5.5\n");
    const auto pixels = this->ReadPixels<ColourPictureType>("out.png");
    for (std::size_t n = 0; n < base.size(); ++n)
    {
      ASSERT_EQ(pixels[n], ColourType(base[n])) << n;
    }
  }
  // beside the overlay too, where LOW is less than the background
  this->ExpectSuccess("in.nrrd out.png --overlay pet.nrrd --overlay-window -5 5 --opacity 1");
  const auto pixels = this->ReadPixels<ColourPictureType>("out.png");
  EXPECT_EQ(pixels.front(), ColourType(base.front()));
  EXPECT_FALSE(std::equal(base.begin(), base.end(), pixels.begin(), [](unsigned char grey, const ColourType & colour) {
    return ColourType(grey) == colour;
  }));
}

// a bright point at one place of two volumes, whose grids differ
TEST_F(ShearWarpMIPProgramOverlay, LiesWhereInputDoes)
{
  const auto          input = MakeImage<VolumeType>({ { 31, 27, 25 } }, { 0.9, 1.1, 1.3 }, { -50.0, 20.0, 7.0 });
  const itk::Index<3> index{ { 22, 9, 17 } };
  input->SetPixel(index, 1000);
  this->WriteImage(input, "point.nrrd");

  const auto point = MakeImage<LabelType>({ { 9, 12, 7 } }, { 1.5, 1.2, 1.9 }, { 0.0, 0.0, 0.0 });
  const auto turn = itk::Euler3DTransform<double>::New();
  turn->SetRotation(0.3, -0.5, 0.8);
  point->SetDirection(turn->GetMatrix());
  const itk::Index<3>   other{ { 3, 8, 2 } };
  itk::Point<double, 3> place;
  itk::Point<double, 3> there;
  input->TransformIndexToPhysicalPoint(index, place);
  point->TransformIndexToPhysicalPoint(other, there);
  point->SetOrigin(point->GetOrigin() + (place - there));
  point->SetPixel(other, 200);
  this->WriteImage(point, "other.nrrd");

  const std::string options =
    " --no-labels --frames 10 --rotation-axis 1,2,-1 --elevation 13 --output-spacing 0.4 --window 0 1000 ";
  const std::string overlay = "--overlay other.nrrd --overlay-window 0 200 --opacity 1 --overlay-colour ";
  this->ExpectSuccess("point.nrrd base.png" + options);
  this->ExpectSuccess("point.nrrd out.png" + options + overlay + "green");
  this->ExpectSuccess("point.nrrd gone.png" + options + overlay + "blue");
  const auto findCentroid = [](const std::vector<double> & values, std::size_t width) {
    double sum = 0.0;
    double column = 0.0;
    double row = 0.0;
    for (std::size_t n = 0; n < values.size(); ++n)
    {
      const std::size_t line = n / width;
      sum += values[n];
      column += values[n] * static_cast<double>(n % width);
      row += values[n] * static_cast<double>(line);
    }
    EXPECT_GT(sum, 100.0);
    return std::make_pair(column / sum, row / sum);
  };
  for (unsigned int frame = 0; frame < 10; ++frame)
  {
    SCOPED_TRACE(frame);
    const std::string   number = "-00" + std::to_string(frame) + ".png";
    const auto          base = this->Read<GreyPictureType>("base" + number);
    const auto          blended = this->ReadPixels<ColourPictureType>("out" + number);
    const auto          alone = this->ReadPixels<ColourPictureType>("gone" + number);
    const auto          grey = GetPixels(base);
    std::vector<double> greens(blended.size());
    for (std::size_t n = 0; n < blended.size(); ++n)
    {
      // where the other map has no green, there is nothing but the overlay's
      greens[n] = blended[n] != alone[n] ? blended[n][1] : 0.0;
    }
    const std::size_t width = base->GetLargestPossibleRegion().GetSize(0);
    const auto [x, y] = findCentroid({ grey.begin(), grey.end() }, width);
    const auto [u, v] = findCentroid(greens, width);
    EXPECT_NEAR(u, x, 0.2);
    EXPECT_NEAR(v, y, 0.2);
  }
}

// T is from INPUT's space to the overlay's: one that lies at T of its place comes back
TEST_F(ShearWarpMIPProgramOverlay, TakesTransform)
{
  const auto transform = itk::AffineTransform<double, 3>::New();
  transform->Rotate3D(MakeVector(1.0, 1.0, 1.0), 0.7);
  transform->Scale(1.25);
  transform->Shear(0, 2, 0.2);
  transform->Translate(MakeVector(30.0, -70.0, 12.5));
  this->WriteTransforms("t.tfm", { transform });

  const auto moved = MakeOverlay();
  auto       spacing = moved->GetSpacing();
  auto       direction = moved->GetDirection();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    auto column = MakeVector(direction(0, axis), direction(1, axis), direction(2, axis)) * spacing[axis];
    column = transform->GetMatrix() * column;
    spacing[axis] = column.Normalize();
    for (unsigned int row = 0; row < 3; ++row)
    {
      direction(row, axis) = column[row];
    }
  }
  moved->SetOrigin(transform->TransformPoint(moved->GetOrigin()));
  moved->SetSpacing(spacing);
  moved->SetDirection(direction);
  this->WriteImage(moved, "moved.nrrd");

  for (const std::string options : { "", " --azimuth 25 --crop -34 -28 15 40 -inf 14", " --view left --slab -2 3" })
  {
    this->ExpectSuccess("in.nrrd there.png --overlay-window 1 4.5 --overlay pet.nrrd" + options);
    this->ExpectSuccess("in.nrrd back.png --overlay-window 1 4.5 --overlay moved.nrrd --overlay-transform t.tfm" +
                        options);
    const auto expected = this->ReadPixels<ColourPictureType>("there.png");
    const auto pixels = this->ReadPixels<ColourPictureType>("back.png");
    ASSERT_EQ(pixels.size(), expected.size());
    std::size_t differing = 0;
    for (std::size_t n = 0; n < pixels.size(); ++n)
    {
      for (unsigned int component = 0; component < 3; ++component)
      {
        differing += std::abs(pixels[n][component] - expected[n][component]) > 2 ? 1 : 0;
      }
    }
    EXPECT_LE(differing, 2u) << options;
  }
  this->ExpectWarning("in.nrrd out.png --overlay moved.nrrd", "'moved.nrrd' and INPUT have no place in common");
}

TEST_F(ShearWarpMIPProgramOverlay, IsInEachFrame)
{
  const std::string overlay = " --overlay pet.nrrd --overlay-window 1 4 --window 0 110";
  this->ExpectSuccess("in.nrrd out.png --frames 3 --dicom-out series" + overlay);
  const auto   names = ListFiles(m_Folder / "series");
  unsigned int frame = 0;
  ASSERT_EQ(names.size(), 3u);
  for (const auto & name : names)
  {
    const auto io = itk::GDCMImageIO::New();
    const auto reader = itk::ImageFileReader<itk::Image<ColourType, 3>>::New();
    reader->SetImageIO(io);
    reader->SetFileName(name.string());
    reader->Update();
    const auto & dictionary = io->GetMetaDataDictionary();
    const auto   get = [&dictionary](const std::string & tag) {
      std::string text;
      itk::ExposeMetaData(dictionary, tag, text);
      return text.substr(0, text.find_last_not_of(' ') + 1);
    };
    const Tags expected = { { "0028|0004", "RGB" }, { "0028|0002", "3" }, { "0028|0006", "0" },
                            { "0028|0100", "8" },   { "0028|0101", "8" }, { "0028|0102", "7" },
                            { "0028|0103", "0" },   { "0028|1053", "" },  { "0028|1050", "" } };
    for (const auto & [tag, value] : expected)
    {
      EXPECT_EQ(get(tag), value) << tag;
    }
    EXPECT_NE(get("0008|2111").find("another volume"), std::string::npos);
    const std::string picture = "out-00" + std::to_string(frame++) + ".png";
    EXPECT_EQ(GetPixels(reader->GetOutput()), this->ReadPixels<ColourPictureType>(picture));
  }
  // an odd number of bytes
  this->ExpectSuccess("in.nrrd odd.png --size 5 7 --dicom-out odd" + overlay);
  EXPECT_EQ((this->ReadPixels<itk::Image<ColourType, 3>>("odd/frame-001.dcm")),
            this->ReadPixels<ColourPictureType>("odd.png"));
  if (std::system("command -v ffmpeg >/dev/null") == 0)
  {
    this->ExpectSuccess("in.nrrd turn.apng --frames 3" + overlay);
    this->ExpectSuccess("in.nrrd slabs.png --sliding-slab 6 6" + overlay);
  }
}

TEST_F(ShearWarpMIPProgramOverlay, IsOverColourAndDicom)
{
  using VectorType = itk::VectorImage<PixelType, 3>;
  const auto colours = MakeImageLike<VectorType>(m_Volume, 3);
  const auto values = GetPixels(m_Volume);
  for (std::size_t n = 0; n < 3 * values.size(); ++n)
  {
    colours->GetBufferPointer()[n] = static_cast<PixelType>(values[n / 3] * static_cast<PixelType>(1 + n % 3) % 120);
  }
  this->WriteImage(colours, "rgb.nrrd");
  this->ExpectSuccess("rgb.nrrd base.png --window 0 120");
  this->ExpectSuccess("rgb.nrrd out.png --window 0 120 --overlay pet.nrrd --overlay-window 1 4.5 --opacity 0.25");
  const auto transform = this->MakeTransform(Direction::Anterior);
  this->ExpectBlended(this->ProjectOverlay(transform, this->Project(transform)), 1.0, 4.5, 0.25);

  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4, 6 });
  this->WriteDICOMSeries("1.2.3.5", "b", { 1, 3, 5 });
  const auto describe = [&](const std::string & patient, const std::string & frameOfReference) {
    for (const auto & file : ListFiles(m_Folder / "dicom"))
    {
      const bool isOverlay = file.filename().string()[0] == 'b';
      this->SetAttribute(file, { 0x0010, 0x0020 }, gdcm::VR::LO, isOverlay ? patient : "x");
      this->SetAttribute(file, { 0x0020, 0x0052 }, gdcm::VR::UI, isOverlay ? frameOfReference : "1.2.9");
    }
  };
  const std::string fused =
    "dicom out.png --series 1.2.3.4 --overlay dicom --overlay-series 1.2.3.5 --overlay-window 0 100";
  this->WriteTransforms("t.tfm", { itk::AffineTransform<double, 3>::New() });
  describe("x", "1.2.9");
  this->ExpectSuccess(fused);
  describe("", "1.2.8");
  this->ExpectWarning(fused, "'dicom' and INPUT are of different frames of reference");
  this->ExpectSuccess(fused + " --overlay-transform t.tfm");
  describe("y", "1.2.9");
  this->ExpectWarning(fused, "'dicom' and INPUT are of different patients");
  this->ExpectFailure("dicom out.png --series 1.2.3.4 --overlay dicom --overlay-series 1.2.3.6",
                      "--overlay-series 1.2.3.6 is not in 'dicom'");
  this->ExpectFailure("dicom out.png --series 1.2.3.4 --overlay dicom", "choose one by --overlay-series NUMBER");
}

// one volume over each point in time
TEST_F(ShearWarpMIPProgramOverlay, IsOverEachPointInTime)
{
  const auto reversed = MakeImageLike<VolumeType>(m_Volume);
  const auto values = GetPixels(m_Volume);
  std::copy(values.rbegin(), values.rend(), reversed->GetBufferPointer());
  this->WriteImage(MakeTimes({ m_Volume, reversed }), "times.nrrd");
  const std::string options = " --window 10 110 --overlay pet.nrrd --overlay-window 1 4.5";
  this->ExpectSuccess("times.nrrd out.png" + options, "shear-warp-mip: note: 'out.png' becomes 2 numbered files\n");
  this->ExpectSuccess("in.nrrd still.png" + options);
  const auto still = this->ReadPixels<ColourPictureType>("still.png");
  EXPECT_EQ(this->ReadPixels<ColourPictureType>("out-000.png"), still);
  EXPECT_NE(this->ReadPixels<ColourPictureType>("out-001.png"), still);
}

TEST_F(ShearWarpMIPProgramOverlay, RefusesWhatIsNotPossible)
{
  this->WriteImage(MakeImage<itk::VectorImage<float, 3>>({ { 3, 3, 3 } }, 3), "rgb.nrrd");
  this->WriteImage(MakeImage<itk::Image<float, 4>>({ { 3, 3, 3, 2 } }), "times.nrrd");
  this->ExpectFailure("in.nrrd out.png --overlay rgb.nrrd", "--overlay: 'rgb.nrrd' has 3 components; 1 is needed");
  this->ExpectFailure("in.nrrd out.png --overlay times.nrrd", "--overlay: 'times.nrrd' has 2 points in time");
  this->ExpectFailure("in.nrrd out.png --overlay none.nrrd", "'none.nrrd' does not exist");
  this->ExpectFailures("in.nrrd out.png --overlay pet.nrrd --opacity ",
                       { "-0.1", "1.01", "nan", "half", "inf" },
                       "is not a number from 0 to 1");
  this->ExpectFailure("in.nrrd out.png --overlay pet.nrrd --overlay-colour rainbow",
                      "--overlay-color: 'rainbow' is not one of autumn, blue");
  this->ExpectFailure("in.nrrd out.png --overlay pet.nrrd --overlay-window 4 4", "--overlay-window: LOW must be less");
  this->ExpectFailures("in.nrrd out.png --overlay pet.nrrd --overlay-window ", { "4", "0 inf" }, "--overlay-window");
  this->ExpectFailures(
    "in.nrrd out.png --",
    { "opacity 0.5", "overlay-colour jet", "overlay-window 0 1", "overlay-transform t.tfm", "overlay-series 1.2" },
    "--overlay");
  this->ExpectFailures("in.nrrd --overlay pet.nrrd ",
                       { "out.nrrd", "out.nii.gz", "out.nrrd --in-place" },
                       "--overlay is for what is looked at");
  fs::copy(m_Folder / "pet.nrrd", m_Folder / "picture.png");
  fs::create_hard_link(m_Folder / "pet.nrrd", m_Folder / "same.png");
  this->ExpectFailure("in.nrrd picture.png --overlay picture.png", "this call reads it");
  this->ExpectFailure("in.nrrd same.png --overlay pet.nrrd", "this call reads it, as 'pet.nrrd'");

  const auto flat = itk::AffineTransform<double, 3>::New();
  flat->Scale(MakeVector(1.0, 1.0, 0.0));
  this->WriteTransforms("flat.tfm", { flat });
  this->ExpectFailure("in.nrrd out.png --overlay pet.nrrd --overlay-transform flat.tfm", "'flat.tfm' has no inverse");
  this->WriteTransforms("two.tfm", { this->MakeTransform(Direction::Left), this->MakeTransform(Direction::Left) });
  this->ExpectFailure("in.nrrd out.png --overlay pet.nrrd --overlay-transform two.tfm", "'two.tfm' holds 2 transforms");
  this->ExpectFailure("in.nrrd out.png --overlay pet.nrrd --overlay-transform no.tfm", "'no.tfm' does not exist");
}

class ShearWarpMIPProgramSegments : public ShearWarpMIPProgramOverlay
{
protected:
  /** Writes labels with the meta data of each segment. */
  template <typename TImage>
  void
  WriteSegments(const itk::SmartPointer<TImage> & image,
                const std::string &               name,
                const std::vector<Tags> &         segments) const
  {
    for (std::size_t n = 0; n < segments.size(); ++n)
    {
      for (const auto & [key, value] : segments[n])
      {
        const std::string entry = "Segment" + std::to_string(n) + '_' + key;
        itk::EncapsulateMetaData<std::string>(image->GetMetaDataDictionary(), entry, value);
      }
    }
    this->WriteImage(image, name);
  }

  /** Labels of balls: of each voxel, the last whose ball holds its center. */
  static LabelType::Pointer
  MakeBalls(const std::vector<itk::Point<double, 3>> & centers, double radius)
  {
    const auto labels = MakeImage<LabelType>({ { 60, 50, 70 } }, { 0.4, 0.5, 0.3 }, { -45.0, 10.0, 0.0 });
    itk::ImageRegionIteratorWithIndex<LabelType> it(labels, labels->GetBufferedRegion());
    for (; !it.IsAtEnd(); ++it)
    {
      itk::Point<double, 3> point;
      labels->TransformIndexToPhysicalPoint(it.GetIndex(), point);
      for (std::size_t n = 0; n < centers.size(); ++n)
      {
        if (point.EuclideanDistanceTo(centers[n]) <= radius)
        {
          it.Set(static_cast<unsigned char>(n + 1));
        }
      }
    }
    return labels;
  }

  /** The pixels of a color, in mm of the view plane. */
  std::vector<itk::Point<double, 2>>
  FindOutline(const std::string & name, const ColourType & colour, const PictureType * grid) const
  {
    const auto                         pixels = this->ReadPixels<ColourPictureType>(name);
    std::vector<itk::Point<double, 2>> outline;
    for (std::size_t n = 0; n < pixels.size(); ++n)
    {
      if (pixels[n] == colour)
      {
        itk::Point<double, 2> point;
        grid->TransformIndexToPhysicalPoint(grid->ComputeIndex(static_cast<itk::OffsetValueType>(n)), point);
        outline.push_back(point);
      }
    }
    return outline;
  }
};

// a ball's projection is a disk of its radius
TEST_F(ShearWarpMIPProgramSegments, OutlinesBalls)
{
  const double                             centers[][3] = { { -35.5, 17.5, 8.5 }, { -30.5, 23.5, 13.0 } };
  const std::vector<itk::Point<double, 3>> balls{ itk::Point<double, 3>(centers[0]),
                                                  itk::Point<double, 3>(centers[1]) };
  constexpr double                         radius = 4.0;
  constexpr double                         pixel = 0.25;
  this->WriteSegments(MakeBalls(balls, radius),
                      "balls.seg.nrrd",
                      { { { "LabelValue", "2" }, { "Layer", "0" }, { "Name", "cyst" }, { "Color", "0 1 0.5" } },
                        { { "LabelValue", "1" }, { "Layer", "0" }, { "Name", "left kidney" }, { "Color", "1 0 0" } } });
  const unsigned char colours[][3] = { { 255, 0, 0 }, { 0, 255, 128 } };
  for (const double azimuth : { 0.0, 35.0, 90.0, 200.0 })
  {
    SCOPED_TRACE(azimuth);
    std::ostringstream view;
    view << " --output-spacing 0.25 --elevation 20 --azimuth " << azimuth;
    this->ExpectSuccess("in.nrrd grid.nrrd" + view.str());
    this->ExpectSuccess("in.nrrd out.png --no-labels --segments balls.seg.nrrd" + view.str());
    const auto grid = this->Read("grid.nrrd");
    const auto toView = this->MakeTransform(Direction::Anterior, azimuth, 20.0)->GetInverseTransform();
    for (std::size_t ball = 0; ball < 2; ++ball)
    {
      const auto            place = toView->TransformPoint(balls[ball]);
      const auto            outline = this->FindOutline("out.png", ColourType(colours[ball]), grid);
      std::set<int>         sectors;
      itk::Point<double, 2> center;
      center[0] = place[0];
      center[1] = place[1];
      for (const auto & point : outline)
      {
        const double distance = point.EuclideanDistanceTo(center);
        EXPECT_GT(distance, radius - 0.5 - 1.5 * pixel);
        EXPECT_LT(distance, radius + 0.5);
        sectors.insert(
          static_cast<int>(std::floor(std::atan2(point[1] - center[1], point[0] - center[0]) * 12.0 / itk::Math::pi)));
      }
      // closed, but for where the second lies over the first; and thin
      EXPECT_GE(sectors.size(), ball == 1 ? 24u : 16u);
      EXPECT_LT(static_cast<double>(outline.size()), 1.2 * itk::Math::twopi * radius / pixel);
    }
  }

  const Result told = this->Run("in.nrrd out.png --verbose --segments balls.seg.nrrd");
  EXPECT_NE(told.messages.find("2 segments: left kidney, cyst:"), std::string::npos) << told.messages;
  this->ExpectSuccess("in.nrrd turn.png --frames 2 --dicom-out series --segments balls.seg.nrrd --overlay pet.nrrd");
  this->ExpectSuccess("in.nrrd turn.html --segments balls.seg.nrrd");
  EXPECT_NE(ReadText(m_Folder / "turn.html").find(R"("segments": [["left kidney", "#ff0000"], ["cyst", "#00ff80"]])"),
            std::string::npos);
  // what a slab does not hold has no outline
  this->ExpectSuccess("in.nrrd grid.nrrd");
  this->ExpectSuccess("in.nrrd out.png --slab 7.6 20 --segments balls.seg.nrrd");
  EXPECT_EQ(this->FindOutline("out.png", ColourType(colours[0]), this->Read("grid.nrrd")).size(), 0u);
}

// along an axis of the grid, by brute force: the projection is what any slice has
TEST_F(ShearWarpMIPProgramSegments, OutlinesWhatAnySliceHas)
{
  const auto input = MakeImage<VolumeType>({ { 24, 7, 20 } });
  this->WriteImage(input, "flat.nrrd");
  using LayersType = itk::VectorImage<short, 3>;
  const auto   layers = MakeImage<LayersType>({ { 24, 7, 20 } }, 2);
  std::mt19937 random(7);
  // boxes, in each layer, of labels -1, 0, 1 and 300
  const short labels[] = { -1, 0, 1, 300 };
  for (int box = 0; box < 40; ++box)
  {
    const long  begin[] = { static_cast<long>(random() % 24),
                            static_cast<long>(random() % 7),
                            static_cast<long>(random() % 20) };
    const auto  component = static_cast<std::size_t>(random() % 2);
    const short label = labels[random() % 4];
    for (long z = begin[2]; z < std::min(20L, begin[2] + 4); ++z)
    {
      for (long x = begin[0]; x < std::min(24L, begin[0] + 5); ++x)
      {
        layers->GetBufferPointer()[2 * ((z * 7 + begin[1]) * 24 + x) + static_cast<long>(component)] = label;
      }
    }
  }
  this->WriteSegments(layers,
                      "layers.seg.nrrd",
                      { { { "LabelValue", "300" }, { "Layer", "1" }, { "Name", "a" }, { "Color", "0.2 0.4 1" } },
                        { { "LabelValue", "1" }, { "Layer", "1" }, { "Name", "b" }, { "Color", "1" } } });
  this->ExpectSuccess(
    "flat.nrrd out.png --segments layers.seg.nrrd",
    "shear-warp-mip: warning: there is only background in the picture: 'flat.nrrd' has only the value "
    "0\n");
  // drawn in this order; without a color, Okabe's and Ito's by number
  const struct
  {
    long          component;
    short         label;
    unsigned char colour[3];
  } segments[] = {
    { 0, 1, { 230, 159, 0 } }, { 0, 300, { 86, 180, 233 } }, { 1, 1, { 0, 158, 115 } }, { 1, 300, { 51, 102, 255 } }
  };
  std::vector<ColourType> expected(480, ColourType(static_cast<unsigned char>(0)));
  for (const auto & segment : segments)
  {
    // rows go down, from the head
    const auto isIn = [&](long column, long row) {
      bool any = false;
      for (long y = 0; y < 7; ++y)
      {
        const auto value = layers->GetBufferPointer()[2 * (((19 - row) * 7 + y) * 24 + column) + segment.component];
        any = any || value == segment.label;
      }
      return any;
    };
    for (long n = 0; n < 480; ++n)
    {
      const long column = n % 24;
      const long row = n / 24;
      bool       isEdge = false;
      for (int side = 0; side < 4; ++side)
      {
        const long x = column + (side == 0 ? 1 : side == 1 ? -1 : 0);
        const long y = row + (side == 2 ? 1 : side == 3 ? -1 : 0);
        isEdge = isEdge || (x >= 0 && x < 24 && y >= 0 && y < 20 && !isIn(x, y));
      }
      if (isEdge && isIn(column, row))
      {
        expected[static_cast<std::size_t>(n)] = ColourType(segment.colour);
      }
    }
  }
  EXPECT_EQ(this->ReadPixels<ColourPictureType>("out.png"), expected);
}

TEST_F(ShearWarpMIPProgramSegments, TakesFilesOfOldSlicersAndOthers)
{
  using LayersType = itk::VectorImage<unsigned char, 3>;
  const auto layers = MakeImageLike<LayersType>(m_Volume, 2);
  layers->GetBufferPointer()[2 * 900 + 1] = 1;
  this->WriteSegments(
    layers, "old.seg.nrrd", { { { "Name", "absent" } }, { { "ID", "Segment_1" }, { "Color", "1 0 0" } } });
  const Result old = this->Run("in.nrrd out.png --verbose --segments old.seg.nrrd");
  EXPECT_NE(old.messages.find("1 segment: Segment_1:"), std::string::npos) << old.messages;

  const auto plain = MakeBalls({ itk::Point<double, 3>(m_Volume->GetOrigin()) }, 3.0);
  this->WriteImage(plain, "plain.nii.gz");
  const Result told = this->Run("in.nrrd out.png --verbose --segments plain.nii.gz");
  EXPECT_NE(told.messages.find("1 segment: label 1:"), std::string::npos) << told.messages;
}

TEST_F(ShearWarpMIPProgramSegments, RefusesWhatIsNotPossible)
{
  this->ExpectFailure("in.nrrd out.png --segments pet.nrrd", "--segments: 'pet.nrrd' must have whole numbers");
  this->ExpectFailure("in.nrrd out.png --segments none.nrrd", "'none.nrrd' does not exist");
  const auto many = MakeImage<VolumeType>({ { 11, 10, 10 } });
  std::iota(many->GetBufferPointer(), many->GetBufferPointer() + 1100, static_cast<PixelType>(-98));
  this->WriteImage(many, "many.nrrd");
  this->ExpectFailure("in.nrrd out.png --segments many.nrrd", "'many.nrrd' has more than 1000 labels");
  this->WriteImage(MakeImage<itk::Image<unsigned char, 4>>({ { 3, 3, 3, 2 } }), "times.nrrd");
  this->ExpectFailure("in.nrrd out.png --segments times.nrrd", "'times.nrrd' has 2 points in time; 1 is needed");
  this->ExpectFailure("in.nrrd out.nrrd --segments many.nrrd", "--segments is for what is looked at");
  fs::copy(m_Folder / "many.nrrd", m_Folder / "same.png");
  this->ExpectFailure("in.nrrd same.png --segments same.png", "this call reads it");

  const auto far = MakeBalls({ itk::Point<double, 3>(m_Volume->GetOrigin()) }, 3.0);
  far->SetOrigin(itk::Point<double, 3>(500.0));
  this->WriteImage(far, "far.nrrd");
  this->ExpectWarning("in.nrrd out.png --segments far.nrrd", "'far.nrrd' and INPUT have no place in common");
  far->FillBuffer(0);
  far->SetOrigin(m_Volume->GetOrigin());
  this->WriteImage(far, "empty.nrrd");
  this->ExpectWarning("in.nrrd out.png --segments empty.nrrd", "no voxel of 'empty.nrrd' has a label");
}

TEST_F(ShearWarpMIPProgramSegments, AreNoInput)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2 });
  for (const auto & file : ListFiles(m_Folder / "dicom"))
  {
    this->SetAttribute(file, { 0x0008, 0x0016 }, gdcm::VR::UI, "1.2.840.10008.5.1.4.1.1.66.4");
  }
  for (const std::string path : { "dicom/a0.dcm", "dicom" })
  {
    this->ExpectFailure(path + " out.png", "is a DICOM segmentation: --segments takes one");
  }
}
} // namespace
