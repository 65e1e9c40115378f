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
#include "Input.h"
#include "Segments.h"
#include "ShearWarpMIPProgramTestHelper.h"

#include "itkAffineTransform.h"

#include <gdcmAttribute.h>
#include <gdcmDicts.h>
#include <gdcmGlobal.h>
#include <gdcmImageChangeTransferSyntax.h>
#include <gdcmImageReader.h>
#include <gdcmImageWriter.h>
#include <gdcmReader.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmWriter.h>

#include <sys/stat.h>

#include <cmath>
#include <cstring>

using namespace ShearWarpMIPProgramTest;

namespace
{
using gdcm::DataSet;
using gdcm::Tag;

const std::string ctImage = "1.2.840.10008.5.1.4.1.1.2";
const std::string enhancedCTImage = "1.2.840.10008.5.1.4.1.1.2.1";
const std::string petImage = "1.2.840.10008.5.1.4.1.1.128";
const std::string nuclearImage = "1.2.840.10008.5.1.4.1.1.20";
const std::string dose = "1.2.840.10008.5.1.4.1.1.481.2";

constexpr unsigned int columns = 4;
constexpr unsigned int rows = 3;
// GDCM's encoder of JPEG 2000 needs so many
constexpr unsigned int manyColumns = 16;
constexpr unsigned int manyRows = 12;

/** Where a slice lies, as text; an empty one is left out. */
struct Plane
{
  std::string position;
  std::string orientation{ "1\\0\\0\\0\\1\\0" };
  /** Of rows, of columns. */
  std::string spacing{ "1.5\\0.5" };
  std::string slope{};
  std::string intercept{ "0" };
};
using Planes = std::vector<Plane>;

/** Of the bits of a pixel. */
struct Format
{
  unsigned int allocated;
  unsigned int stored;
  bool         isSigned;
};

short
GetStored(std::size_t slice, std::size_t pixel)
{
  return static_cast<short>(100 * slice + pixel);
}

void
SetText(DataSet & dataSet, const Tag & tag, std::string text)
{
  gdcm::DataElement element(tag, 0, gdcm::Global::GetInstance().GetDicts().GetDictEntry(tag).GetVR());
  text += text.size() % 2 == 1 ? " " : "";
  element.SetByteValue(text.data(), static_cast<std::uint32_t>(text.size()));
  dataSet.Replace(element);
}

template <std::uint16_t VGroup, std::uint16_t VElement>
void
SetNumber(DataSet & dataSet, unsigned int number)
{
  gdcm::Attribute<VGroup, VElement> attribute;
  attribute.SetValue(static_cast<std::uint16_t>(number));
  dataSet.Replace(attribute.GetAsDataElement());
}

void
SetFormat(DataSet & dataSet, const Format & format)
{
  SetNumber<0x0028, 0x0100>(dataSet, format.allocated);
  SetNumber<0x0028, 0x0101>(dataSet, format.stored);
  SetNumber<0x0028, 0x0102>(dataSet, format.stored - 1);
  SetNumber<0x0028, 0x0103>(dataSet, format.isSigned ? 1 : 0);
}

void
SetSequence(DataSet & dataSet, const Tag & tag, const std::vector<DataSet> & items)
{
  const gdcm::SmartPointer<gdcm::SequenceOfItems> sequence = new gdcm::SequenceOfItems;
  sequence->SetLengthToUndefined();
  for (const DataSet & nested : items)
  {
    gdcm::Item item;
    item.SetVLToUndefined();
    item.SetNestedDataSet(nested);
    sequence->AddItem(item);
  }
  gdcm::DataElement element(tag, 0, gdcm::VR::SQ);
  element.SetValue(*sequence);
  element.SetVLToUndefined();
  dataSet.Replace(element);
}

/** Sets the attributes that have a value, in a functional group or, if \a group is 0, in \a dataSet itself. */
void
SetAttributes(DataSet &                                        dataSet,
              bool                                             isGrouped,
              const Tag &                                      group,
              const std::vector<std::pair<Tag, std::string>> & attributes)
{
  DataSet   item;
  DataSet & target = isGrouped ? item : dataSet;
  for (const auto & [tag, text] : attributes)
  {
    if (!text.empty())
    {
      SetText(target, tag, text);
    }
  }
  if (isGrouped && !item.IsEmpty())
  {
    SetSequence(dataSet, group, { item });
  }
}

void
SetPixels(DataSet & dataSet, const std::vector<short> & pixels)
{
  gdcm::DataElement element(Tag(0x7fe0, 0x0010), 0, gdcm::VR::OW);
  element.SetByteValue(reinterpret_cast<const char *>(pixels.data()),
                       static_cast<std::uint32_t>(pixels.size() * sizeof(short)));
  dataSet.Replace(element);
}

/** An axial slice whose pixels are rescaled. */
Plane
MakePlane(const std::string & z, const std::string & slope, const std::string & intercept)
{
  return { "0\\0\\" + z, "1\\0\\0\\0\\1\\0", "1\\1", slope, intercept };
}

void
SetPlane(DataSet & dataSet, const Plane & plane, bool isGrouped)
{
  SetAttributes(dataSet, isGrouped, { 0x0020, 0x9113 }, { { { 0x0020, 0x0032 }, plane.position } });
  SetAttributes(dataSet, isGrouped, { 0x0020, 0x9116 }, { { { 0x0020, 0x0037 }, plane.orientation } });
  SetAttributes(dataSet, isGrouped, { 0x0028, 0x9110 }, { { { 0x0028, 0x0030 }, plane.spacing } });
  SetAttributes(
    dataSet,
    isGrouped,
    { 0x0028, 0x9145 },
    { { { 0x0028, 0x1052 }, plane.slope.empty() ? "" : plane.intercept }, { { 0x0028, 0x1053 }, plane.slope } });
}

/** Whether slices are the frames of one file. */
class ShearWarpMIPProgramDicomInput
  : public ShearWarpMIPProgram
  , public testing::WithParamInterface<bool>
{
protected:
  void
  SetUp() override
  {
    ShearWarpMIPProgram::SetUp();
    fs::create_directory(m_Folder / "dicom");
  }

  /** An image of the frames \a begin to \a end, whose pixels are GetStored(). */
  static DataSet
  MakeImage(const std::string & sopClass, std::size_t begin, std::size_t end)
  {
    DataSet dataSet;
    SetText(dataSet, { 0x0008, 0x0016 }, sopClass);
    SetText(dataSet, { 0x0008, 0x0018 }, "1.2.3.4." + std::to_string(begin + 1));
    SetText(dataSet, { 0x0020, 0x000d }, "1.2.3");
    SetText(dataSet, { 0x0020, 0x000e }, "1.2.3.4");
    SetText(dataSet, { 0x0028, 0x0004 }, "MONOCHROME2");
    if (end - begin > 1)
    {
      SetText(dataSet, { 0x0028, 0x0008 }, std::to_string(end - begin));
    }
    SetNumber<0x0028, 0x0002>(dataSet, 1);
    SetNumber<0x0028, 0x0010>(dataSet, rows);
    SetNumber<0x0028, 0x0011>(dataSet, columns);
    SetNumber<0x0028, 0x0100>(dataSet, 16);
    SetNumber<0x0028, 0x0101>(dataSet, 16);
    SetNumber<0x0028, 0x0102>(dataSet, 15);
    SetNumber<0x0028, 0x0103>(dataSet, 1);
    std::vector<short> pixels;
    for (std::size_t slice = begin; slice < end; ++slice)
    {
      for (std::size_t pixel = 0; pixel < std::size_t{ columns } * rows; ++pixel)
      {
        pixels.push_back(GetStored(slice, pixel));
      }
    }
    SetPixels(dataSet, pixels);
    return dataSet;
  }

  void
  WriteFile(const DataSet &              dataSet,
            const fs::path &             name,
            const gdcm::TransferSyntax & syntax = gdcm::TransferSyntax::ExplicitVRLittleEndian) const
  {
    gdcm::Writer writer;
    writer.SetFileName((m_Folder / name).c_str());
    writer.GetFile().SetDataSet(dataSet);
    writer.GetFile().GetHeader().SetDataSetTransferSyntax(syntax);
    ASSERT_TRUE(writer.Write());
  }

  /** Adds attributes to a slice, in a functional group if slices are frames. */
  using AddFunction = std::function<void(DataSet &, std::size_t)>;

  /** Writes the folder dicom. What \a planes have in common is in the group that all frames share. */
  void
  WriteSlices(
    const Planes &      planes,
    const std::string & sopClass = ctImage,
    const AddFunction & add = [](DataSet &, std::size_t) {}) const
  {
    fs::remove_all(m_Folder / "dicom");
    fs::create_directory(m_Folder / "dicom");
    if (!GetParam())
    {
      for (std::size_t slice = 0; slice < planes.size(); ++slice)
      {
        DataSet dataSet = MakeImage(sopClass, slice, slice + 1);
        SetPlane(dataSet, planes[slice], false);
        add(dataSet, slice);
        this->WriteFile(dataSet, "dicom/a" + std::to_string(slice) + ".dcm");
      }
      return;
    }
    const auto isShared = [&planes](std::string Plane::* text) {
      return std::all_of(
        planes.begin(), planes.end(), [&](const Plane & plane) { return plane.*text == planes[0].*text; });
    };
    const bool           isOriented = isShared(&Plane::orientation);
    const bool           isSpaced = isShared(&Plane::spacing);
    DataSet              shared;
    std::vector<DataSet> groups;
    SetPlane(shared, { "", isOriented ? planes[0].orientation : "", isSpaced ? planes[0].spacing : "" }, true);
    for (Plane plane : planes)
    {
      plane.orientation = isOriented ? "" : plane.orientation;
      plane.spacing = isSpaced ? "" : plane.spacing;
      groups.emplace_back();
      SetPlane(groups.back(), plane, true);
      add(groups.back(), groups.size() - 1);
    }
    DataSet dataSet = MakeImage(enhancedCTImage, 0, planes.size());
    SetSequence(dataSet, { 0x5200, 0x9229 }, { shared });
    SetSequence(dataSet, { 0x5200, 0x9230 }, groups);
    this->WriteFile(dataSet, "dicom/frames.dcm");
  }

  /** Rewrites a file. */
  void
  ChangeFile(const fs::path & name, const std::function<void(DataSet &)> & change) const
  {
    gdcm::Reader reader;
    reader.SetFileName((m_Folder / name).c_str());
    ASSERT_TRUE(reader.Read());
    DataSet dataSet = reader.GetFile().GetDataSet();
    change(dataSet);
    this->WriteFile(dataSet, name, reader.GetFile().GetHeader().GetDataSetTransferSyntax());
  }

  /** Three slices of numbers that have so many bits, the next of \a numbers in each pixel. */
  void
  WriteNumbers(const Format & format, const std::vector<int> & numbers) const
  {
    this->WriteSlices({ { "0\\0\\0" }, { "0\\0\\2" }, { "0\\0\\4" } });
    for (const auto & file : ListFiles(m_Folder / "dicom"))
    {
      this->ChangeFile(file, [&](DataSet & dataSet) {
        SetFormat(dataSet, format);
        SetNumber<0x0028, 0x0010>(dataSet, manyRows);
        SetNumber<0x0028, 0x0011>(dataSet, manyColumns);
        const std::size_t count = std::size_t{ GetParam() ? 3u : 1u } * manyColumns * manyRows;
        std::string       pixels(count * format.allocated / 8, '\0');
        for (std::size_t n = 0; n < count; ++n)
        {
          const auto number =
            static_cast<unsigned int>(numbers[n % (std::size_t{ manyColumns } * manyRows) % numbers.size()]);
          for (std::size_t bit = 0; bit < format.allocated; ++bit)
          {
            const std::size_t place = n * format.allocated + bit;
            pixels[place / 8] = static_cast<char>(pixels[place / 8] | (number >> bit & 1) << place % 8);
          }
        }
        gdcm::DataElement element(Tag(0x7fe0, 0x0010), 0, format.allocated <= 8 ? gdcm::VR::OB : gdcm::VR::OW);
        element.SetByteValue(pixels.data(), static_cast<std::uint32_t>(pixels.size()));
        dataSet.Replace(element);
      });
    }
  }

  void
  Compress(const gdcm::TransferSyntax & syntax) const
  {
    for (const auto & file : ListFiles(m_Folder / "dicom"))
    {
      gdcm::ImageReader               reader;
      gdcm::ImageWriter               writer;
      gdcm::ImageChangeTransferSyntax change;
      reader.SetFileName(file.c_str());
      ASSERT_TRUE(reader.Read());
      change.SetInput(reader.GetImage());
      change.SetTransferSyntax(syntax);
      ASSERT_TRUE(change.Change());
      writer.SetFile(reader.GetFile());
      writer.SetImage(change.GetOutput());
      writer.SetFileName(file.c_str());
      ASSERT_TRUE(writer.Write());
    }
  }

  /** That every slice has these values, repeated. */
  void
  ExpectValues(const std::vector<int> & values) const
  {
    const Volume volume = this->ReadFolder();
    DispatchPixelType(volume.times.front().componentType, [&](auto tag) {
      const auto * pixel = CastImage<typename decltype(tag)::Type>(volume.times.front()).GetBufferPointer();
      for (std::size_t n = 0; n < std::size_t{ 3 } * manyColumns * manyRows; ++n, ++pixel)
      {
        ASSERT_EQ(static_cast<double>(*pixel), values[n % (std::size_t{ manyColumns } * manyRows) % values.size()])
          << "pixel " << n;
      }
    });
  }

  /** The folder dicom, which must be read with warnings that have \a mention, or without any. */
  Volume
  ReadFolder(const std::string & mention = "") const
  {
    std::string warnings;
    Volume      volume =
      ReadVolume(m_Folder / "dicom", "", [&warnings](const std::string & text) { warnings += text + '\n'; });
    EXPECT_EQ(warnings.empty(), mention.empty()) << warnings;
    EXPECT_NE(warnings.find(mention), std::string::npos) << warnings;
    return volume;
  }

  /** Writes axial slices at these positions, whose pixels are ten times the position. */
  void
  WritePositions(const std::vector<double> & positions) const
  {
    Planes planes;
    for (const double position : positions)
    {
      std::ostringstream text;
      text << "0\\0\\" << position;
      planes.push_back({ text.str() });
    }
    this->WriteSlices(planes);
    const auto rewrite = [&](const std::string & file, std::size_t begin, std::size_t end) {
      this->ChangeFile("dicom/" + file, [&](DataSet & dataSet) {
        std::vector<short> pixels;
        for (std::size_t slice = begin; slice < end; ++slice)
        {
          pixels.insert(pixels.end(), std::size_t{ columns } * rows, static_cast<short>(10.0 * positions[slice]));
        }
        SetPixels(dataSet, pixels);
      });
    };
    for (std::size_t slice = 0; slice < positions.size() && !GetParam(); ++slice)
    {
      rewrite("a" + std::to_string(slice) + ".dcm", slice, slice + 1);
    }
    if (GetParam())
    {
      rewrite("frames.dcm", 0, positions.size());
    }
  }

  /** That the slices of \a volume are those that were written as \a order, by \a value of the number stored. */
  template <typename TPixel>
  static void
  ExpectSlices(
    const Volume &                                     volume,
    const std::vector<std::size_t> &                   order,
    const std::function<double(std::size_t, double)> & value = [](std::size_t, double stored) { return stored; })
  {
    ASSERT_EQ(volume.times.front().componentType, itk::ImageIOBase::MapPixelType<TPixel>::CType);
    ASSERT_EQ(volume.times.front().image->GetLargestPossibleRegion().GetSize(),
              (itk::Size<3>{ { columns, rows, order.size() } }));
    const TPixel * pixel = CastImage<TPixel>(volume.times.front()).GetBufferPointer();
    for (const std::size_t slice : order)
    {
      for (std::size_t n = 0; n < std::size_t{ columns } * rows; ++n)
      {
        ASSERT_EQ(*pixel++, static_cast<TPixel>(value(slice, GetStored(slice, n)))) << "slice " << slice;
      }
    }
  }

  /** Where the first voxel is, how far one lies from the other, and where the third axis points to. */
  static void
  ExpectGrid(const Volume &                volume,
             const std::array<double, 3> & origin,
             const std::array<double, 3> & spacing,
             const std::array<double, 3> & away)
  {
    const auto & image = *volume.times.front().image;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      EXPECT_NEAR(image.GetOrigin()[axis], origin[axis], 1e-12);
      EXPECT_NEAR(image.GetSpacing()[axis], spacing[axis], 1e-12);
      EXPECT_NEAR(image.GetDirection()(axis, 2), away[axis], 1e-12);
    }
  }
};

INSTANTIATE_TEST_SUITE_P(Files, ShearWarpMIPProgramDicomInput, testing::Bool(), [](const auto & test) {
  return test.param ? "Frames" : "Slices";
});

TEST_P(ShearWarpMIPProgramDicomInput, ReadsTiltedGantry)
{
  // an edge of 5 : 12 : 13
  this->WriteSlices({ { "7\\-2\\3" }, { "7\\0.5\\9" }, { "7\\3\\15" } });
  const Volume volume = this->ReadFolder();
  ExpectSlices<short>(volume, { 0, 1, 2 });
  ExpectGrid(volume, { 7, -2, 3 }, { 0.5, 1.5, 6.5 }, { 0, 5.0 / 13.0, 12.0 / 13.0 });
  EXPECT_NEAR(volume.times.front().image->GetDirection()(0, 0), 1.0, 1e-12);
  EXPECT_NEAR(volume.times.front().image->GetDirection()(1, 1), 1.0, 1e-12);
}

TEST_P(ShearWarpMIPProgramDicomInput, ProjectsTiltedGantry)
{
  // voxels of the same height in every slice, lower by one row from slice to slice
  Planes planes;
  for (unsigned int slice = 0; slice < rows; ++slice)
  {
    planes.push_back({ "0\\" + std::to_string(-1.5 * slice) + '\\' + std::to_string(2 * slice) });
  }
  this->WriteSlices(planes);
  std::size_t number = 0;
  for (const auto & file : ListFiles(m_Folder / "dicom"))
  {
    this->ChangeFile(file, [&](DataSet & dataSet) {
      const std::size_t  slices = GetParam() ? rows : 1;
      std::vector<short> pixels(slices * columns * rows, 0);
      for (std::size_t slice = 0; slice < slices; ++slice)
      {
        pixels[(slice * rows + number + slice) * columns + 1] = 1000;
      }
      SetPixels(dataSet, pixels);
    });
    ++number;
  }
  // from below: u is x, v is y
  this->WriteTransforms("view.tfm", { itk::AffineTransform<double, 3>::New() });
  this->ExpectSuccess("dicom out.nrrd --transform view.tfm --output-spacing 0.25");
  const auto                                     picture = this->Read("out.nrrd");
  double                                         sum = 0.0;
  itk::ImageRegionIteratorWithIndex<PictureType> it(picture, picture->GetBufferedRegion());
  for (; !it.IsAtEnd(); ++it)
  {
    itk::Point<double, 2> point;
    picture->TransformIndexToPhysicalPoint(it.GetIndex(), point);
    // a voxel's own, to the half of its neighbours
    const bool isOutside = std::abs(point[0] - 0.5) > 0.5 || std::abs(point[1]) > 1.5;
    ASSERT_FALSE(isOutside && it.Get() > 0) << point;
    sum += it.Get();
  }
  // a pyramid of linear interpolation, pixels are 0.25 mm
  EXPECT_NEAR(sum * 0.25 * 0.25, 1000 * 0.5 * 1.5, 0.01 * 1000 * 0.5 * 1.5);
}

TEST_P(ShearWarpMIPProgramDicomInput, SortsSlices)
{
  this->WriteSlices({ { "0\\0\\2" }, { "0\\0\\0" }, { "0\\0\\6" }, { "0\\0\\4" } });
  const Volume volume = this->ReadFolder();
  ExpectSlices<short>(volume, { 1, 0, 3, 2 });
  ExpectGrid(volume, { 0, 0, 0 }, { 0.5, 1.5, 2.0 }, { 0, 0, 1 });
}

TEST_P(ShearWarpMIPProgramDicomInput, KeepsOrderOfFrames)
{
  this->WriteSlices({ { "0\\0\\6" }, { "0\\0\\4" }, { "0\\0\\2" } });
  const Volume volume = this->ReadFolder();
  const bool   isKept = GetParam();
  ExpectSlices<short>(volume, isKept ? std::vector<std::size_t>{ 0, 1, 2 } : std::vector<std::size_t>{ 2, 1, 0 });
  ExpectGrid(volume, { 0, 0, isKept ? 6.0 : 2.0 }, { 0.5, 1.5, 2.0 }, { 0, 0, isKept ? -1.0 : 1.0 });
}

TEST_P(ShearWarpMIPProgramDicomInput, RescalesEachSlice)
{
  const double slopes[] = { 2.0, 0.25, 1.0 };
  const double intercepts[] = { -1024.0, 0.0, 0.5 };
  this->WriteSlices({ MakePlane("0", "2", "-1024"), MakePlane("2", "0.25", "0"), MakePlane("4", "1", "0.5") },
                    petImage);
  ExpectSlices<double>(this->ReadFolder(), { 0, 1, 2 }, [&](std::size_t slice, double stored) {
    return slopes[slice] * stored + intercepts[slice];
  });
}

TEST_P(ShearWarpMIPProgramDicomInput, KeepsWholeNumbers)
{
  this->WriteSlices({ MakePlane("0", "1", "10"), MakePlane("2", "1", "10") });
  ExpectSlices<int>(this->ReadFolder(), { 0, 1 }, [&](std::size_t, double stored) { return stored + 10.0; });
}

TEST_P(ShearWarpMIPProgramDicomInput, ReadsCompressedPixels)
{
  for (const auto syntax : { gdcm::TransferSyntax::JPEGLosslessProcess14_1,
                             gdcm::TransferSyntax::JPEGLSLossless,
                             gdcm::TransferSyntax::JPEG2000Lossless,
                             gdcm::TransferSyntax::RLELossless })
  {
    SCOPED_TRACE(syntax);
    if (syntax != gdcm::TransferSyntax::JPEG2000Lossless)
    {
      this->WriteSlices({ { "0\\0\\0" }, { "0\\0\\2" }, { "0\\0\\4" } });
      this->Compress(syntax);
      ExpectSlices<short>(this->ReadFolder(), { 0, 1, 2 });
    }
    for (const Format & format : { Format{ 8, 8, false }, Format{ 16, 12, false }, Format{ 16, 12, true } })
    {
      SCOPED_TRACE(format.stored);
      const int highest = (1 << (format.stored - (format.isSigned ? 1 : 0))) - 1;
      const int lowest = format.isSigned ? -highest - 1 : 0;
      this->WriteNumbers(format, { lowest, highest, 0, 1, lowest + 7 });
      this->Compress(syntax);
      this->ExpectValues({ lowest, highest, 0, 1, lowest + 7 });
    }
  }
}

TEST_P(ShearWarpMIPProgramDicomInput, ReadsBigEndian)
{
  // words of 16 bits have their bytes swapped, others have none
  const auto swapBytes = [this](gdcm::VR::VRType type) {
    for (const auto & file : ListFiles(m_Folder / "dicom"))
    {
      gdcm::Reader reader;
      reader.SetFileName(file.c_str());
      ASSERT_TRUE(reader.Read());
      DataSet           dataSet = reader.GetFile().GetDataSet();
      gdcm::DataElement pixels = dataSet.GetDataElement(Tag(0x7fe0, 0x0010));
      pixels.SetVR(type);
      dataSet.Replace(pixels);
      const std::string little = ReadText(file);
      this->WriteFile(dataSet, file, gdcm::TransferSyntax::ExplicitVRBigEndian);
      std::string big = ReadText(file);
      for (std::size_t n = 1; n <= pixels.GetVL(); ++n)
      {
        big[big.size() - n] = little[little.size() - (type == gdcm::VR::OW ? ((n - 1) ^ 1) + 1 : n)];
      }
      std::ofstream(file, std::ios::binary) << big;
    }
  };
  for (const Format & format : { Format{ 1, 1, false },
                                 Format{ 8, 8, false },
                                 Format{ 8, 8, true },
                                 Format{ 16, 12, false },
                                 Format{ 16, 12, true },
                                 Format{ 16, 16, false },
                                 Format{ 16, 16, true } })
  {
    SCOPED_TRACE(std::to_string(format.stored) + (format.isSigned ? " bits, signed" : " bits"));
    const int              highest = (1 << (format.stored - (format.isSigned ? 1 : 0))) - 1;
    const int              lowest = format.isSigned ? -highest - 1 : 0;
    const std::vector<int> numbers = { lowest, highest, 0, 1, highest / 3 };
    for (const auto type : { gdcm::VR::OB, gdcm::VR::OW })
    {
      if (format.allocated <= 8 || type == gdcm::VR::OW)
      {
        this->WriteNumbers(format, numbers);
        swapBytes(type);
        this->ExpectValues(numbers);
      }
    }
  }
  for (const bool isSigned : { false, true })
  {
    this->WriteNumbers({ 32, 32, isSigned }, { 1254000, 0 });
    this->ExpectValues({ 1254000, 0 });
    swapBytes(gdcm::VR::OW);
    this->ExpectFailure("dicom out.png", "has pixels of 32 bits in big endian, whose byte order differs between ");
  }
}

TEST_P(ShearWarpMIPProgramDicomInput, RefusesWhatIsNotValuesOfSlices)
{
  const Planes planes = { { "0\\0\\0" }, { "0\\0\\2" } };
  const auto   expectRefused = [&](const std::function<void(DataSet &)> & change, const std::string & mention) {
    this->WriteSlices(planes);
    this->ChangeFile(ListFiles(m_Folder / "dicom").back(), change);
    this->ExpectFailure("dicom out.png", mention);
    this->ExpectFailure("in.nrrd out.png --overlay dicom", mention);
  };
  const std::string mosaic = "' is a mosaic: the slices of a volume are tiles of one picture; convert it by dcm2niix";
  const std::string imageType = "ORIGINAL\\PRIMARY\\M\\ND\\MOSAIC";
  expectRefused([&](DataSet & dataSet) { SetText(dataSet, { 0x0008, 0x0008 }, imageType); }, mosaic);
  const auto setTiles = [](DataSet & dataSet, const std::string & count) {
    gdcm::DataElement creator(Tag(0x0019, 0x0010), 0, gdcm::VR::LO);
    creator.SetByteValue("SIEMENS MR HEADER ", 18);
    dataSet.Replace(creator);
    gdcm::DataElement tiles(Tag(0x0019, 0x100a), 0, gdcm::VR::US);
    tiles.SetByteValue(count.data(), 2);
    dataSet.Replace(tiles);
  };
  using namespace std::string_literals;
  expectRefused([&](DataSet & dataSet) { setTiles(dataSet, "\x24\0"s); }, mosaic);
  this->WriteSlices(planes);
  this->ChangeFile(ListFiles(m_Folder / "dicom").back(), [&](DataSet & dataSet) { setTiles(dataSet, "\1\0"s); });
  ExpectSlices<short>(this->ReadFolder(), { 0, 1 });

  expectRefused(
    [](DataSet & dataSet) {
      DataSet table;
      SetText(table, { 0x0028, 0x3003 }, "HU");
      SetSequence(dataSet, { 0x0028, 0x3000 }, { table });
    },
    "has its values in a Modality LUT Sequence (0028,3000), which is not read");
}

TEST_P(ShearWarpMIPProgramDicomInput, ReadsBitsOfStreamsAsAttributesSay)
{
  using Numbers = std::vector<int>;
  for (const auto syntax : { gdcm::TransferSyntax::JPEG2000Lossless,
                             gdcm::TransferSyntax::JPEGLSLossless,
                             gdcm::TransferSyntax::JPEGLosslessProcess14_1 })
  {
    SCOPED_TRACE(syntax);
    const auto write = [&](const Format & from, const Format & to, const Numbers & numbers) {
      this->WriteNumbers(from, numbers);
      this->Compress(syntax);
      for (const auto & file : ListFiles(m_Folder / "dicom"))
      {
        this->ChangeFile(file, [&to](DataSet & dataSet) { SetFormat(dataSet, to); });
      }
    };
    const auto expectValues =
      [&](const Format & from, const Format & to, const Numbers & numbers, const Numbers & values) {
        SCOPED_TRACE(std::to_string(from.stored) + " and " + std::to_string(to.stored) + " bits");
        write(from, to, numbers);
        this->ExpectValues(values);
      };
    const auto expectRefused =
      [&](const Format & from, const Format & to, const Numbers & numbers, const std::string & mention) {
        SCOPED_TRACE(std::to_string(from.stored) + " and " + std::to_string(to.stored) + " bits");
        write(from, to, numbers);
        this->ExpectFailure("dicom out.png", mention);
      };
    // the same bits, with the other sign
    for (const int bits : { 12, 13, 16 })
    {
      const int range = 1 << bits;
      Format    format{ 16, static_cast<unsigned int>(bits), true };
      expectValues({ 16, format.stored, false }, format, { range - 1000, range - 1, 0, 1 }, { -1000, -1, 0, 1 });
    }
    expectValues({ 16, 16, true }, { 16, 16, false }, { -1000, -1, 0, 1 }, { 64536, 65535, 0, 1 });
    // more bits than are stored
    expectValues({ 16, 16, true }, { 16, 12, true }, { -2048, -1, 2047 }, { -2048, -1, 2047 });
    expectValues({ 16, 16, false }, { 16, 12, true }, { 3096, 2047, 0 }, { -1000, 2047, 0 });
    expectValues({ 16, 16, false }, { 16, 12, false }, { 4095, 0 }, { 4095, 0 });
    expectRefused({ 16, 16, false },
                  { 16, 12, false },
                  { 4096, 0 },
                  "has compressed pixels of 16 bits, 1 sample, 16 x 12, but its attributes say 12 bits, 1 sample, " +
                    std::string("16 x 12, and the value of the number 4096 is not clear; export the images without"));
    expectRefused({ 16, 16, true }, { 16, 12, true }, { 2047, -2049 }, "is not clear");
    // fewer bits
    expectValues({ 8, 8, false }, { 16, 16, false }, { 0, 1, 200, 255 }, { 0, 1, 200, 255 });
    expectValues({ 8, 8, false }, { 16, 16, true }, { 0, 1, 127 }, { 0, 1, 127 });
    expectRefused({ 8, 8, false },
                  { 16, 16, true },
                  { 0, 1, 200 },
                  "say 16 signed bits, 1 sample, 16 x 12, and the value of the number 200 is not clear");
    // numbers that do not fit, and other pictures
    expectRefused({ 16, 16, false },
                  { 8, 8, false },
                  { 0, 1, 200 },
                  "pixels of 16 bits, 1 sample, 16 x 12, but its attributes say 8 bits, 1 sample, 16 x 12; export");
    write({ 16, 16, false }, { 16, 16, false }, { 1 });
    this->ChangeFile(ListFiles(m_Folder / "dicom").front(),
                     [](DataSet & dataSet) { SetNumber<0x0028, 0x0011>(dataSet, 15); });
    this->ExpectFailure("dicom out.png", "sample, 16 x 12, but its attributes say 16 bits, 1 sample, 15 x 12; export");
  }
  // RLE has bytes
  this->WriteNumbers({ 8, 8, false }, { 1, 2 });
  this->Compress(gdcm::TransferSyntax::RLELossless);
  this->ChangeFile(ListFiles(m_Folder / "dicom").front(),
                   [](DataSet & dataSet) { SetFormat(dataSet, { 16, 16, false }); });
  this->ExpectFailure("dicom out.png", "pixels of 8 bits, 1 sample, 16 x 12, but its attributes say 16 bits, 1 sample");
  this->WriteNumbers({ 16, 16, false }, { 1, 258 });
  for (const auto & file : ListFiles(m_Folder / "dicom"))
  {
    this->ChangeFile(file, [](DataSet & dataSet) {
      SetNumber<0x0028, 0x0002>(dataSet, 3);
      SetNumber<0x0028, 0x0006>(dataSet, 0);
      SetNumber<0x0028, 0x0010>(dataSet, manyRows / 3);
      SetText(dataSet, { 0x0028, 0x0004 }, "RGB");
    });
  }
  this->ExpectSuccess("dicom out.nrrd");
  this->ChangeFile(ListFiles(m_Folder / "dicom").front(),
                   [](DataSet & dataSet) { SetNumber<0x0028, 0x0010>(dataSet, manyRows / 3 + 1); });
  this->ExpectFailure("dicom out.png", "is damaged or incomplete");
  this->ChangeFile(ListFiles(m_Folder / "dicom").front(),
                   [](DataSet & dataSet) { SetNumber<0x0028, 0x0010>(dataSet, manyRows / 3); });
  this->Compress(gdcm::TransferSyntax::RLELossless);
  this->ExpectFailure("dicom out.png", "has colours of more than 8 bits, compressed by RLE, which GDCM mixes up");
}

TEST_P(ShearWarpMIPProgramDicomInput, RefusesWhatIsNoVolume)
{
  const Planes good = { { "0\\0\\0" }, { "0\\0\\2" }, { "0\\0\\4" }, { "0\\0\\6" } };
  this->WriteSlices(good);
  this->ReadFolder();
  const auto expectRefused = [&](std::string Plane::* text, const std::string & value, const std::string & mention) {
    Planes planes = good;
    planes[2].*text = value;
    this->WriteSlices(planes);
    this->ExpectFailure("dicom out.png", mention);
  };
  const std::string second = GetParam() ? "frame 3 of '" : "a2.dcm' ";
  expectRefused(&Plane::position, "0\\0\\9", "a slice is missing between ");
  expectRefused(&Plane::position, "0\\0\\2", "two slices lie at one position: ");
  expectRefused(&Plane::position, "0\\3\\4", " is 3 mm beside the line from the first to the last, more than a");
  expectRefused(&Plane::position, "", " has no valid position");
  expectRefused(&Plane::position, "0\\0", " has no valid position");
  expectRefused(&Plane::orientation, "0\\1\\0\\1\\0\\0", "differ in orientation");
  expectRefused(&Plane::orientation, "0\\0\\0\\0\\0\\0", second);
  expectRefused(&Plane::orientation, "0\\0\\0\\0\\0\\0", "has no valid orientation");
  expectRefused(&Plane::orientation, "1\\0\\0\\0.01\\1\\0", "has no valid orientation");
  expectRefused(&Plane::orientation, "2\\0\\0\\0\\2\\0", "has no valid orientation");
  expectRefused(&Plane::orientation, "", "has no valid orientation");
  expectRefused(&Plane::spacing, "1.5\\0.6", "differ in pixel spacing");
  expectRefused(&Plane::spacing, "", "has no valid pixel spacing");
  expectRefused(&Plane::spacing, "0\\0.5", "has no valid pixel spacing");
  expectRefused(&Plane::slope, "2", "differ in rescaling");
  expectRefused(&Plane::slope, "0", "has no valid rescale slope");

  Planes all = good;
  for (Plane & plane : all)
  {
    plane.orientation = "0\\0\\0\\0\\0\\0";
  }
  this->WriteSlices(all);
  this->ExpectFailure("dicom out.png", "has no valid orientation");
}

TEST_P(ShearWarpMIPProgramDicomInput, InterpolatesSlicesOfSeveralDistances)
{
  // a transition that is shorter than both, and none
  for (const std::vector<double> & positions :
       { std::vector<double>{ 0, 4, 8, 12, 16, 20, 21, 28, 35, 42, 49 }, { 0, 7, 14, 21, 28, 32, 36, 40, 44 } })
  {
    this->WritePositions(positions);
    const Volume      volume = this->ReadFolder("are interpolated between them");
    const double      extent = positions.back();
    const double      count = std::ceil(extent / 4.0);
    const std::size_t planes = static_cast<std::size_t>(count) + 1;
    ExpectGrid(volume, { 0, 0, 0 }, { 0.5, 1.5, extent / count }, { 0, 0, 1 });
    const auto & image = CastImage<short>(volume.times.front());
    ASSERT_EQ(image.GetLargestPossibleRegion().GetSize(), (itk::Size<3>{ { columns, rows, planes } }));
    const short * pixel = image.GetBufferPointer();
    for (std::size_t plane = 0; plane < planes; ++plane)
    {
      const auto expected = static_cast<short>(std::lround(10.0 * extent * static_cast<double>(plane) / count));
      for (std::size_t n = 0; n < std::size_t{ columns } * rows; ++n)
      {
        ASSERT_EQ(*pixel++, expected) << plane;
      }
    }
    this->ExpectFailure("in.nrrd out.png --mask dicom", " mm): labels cannot be interpolated\n");
  }
}

TEST_P(ShearWarpMIPProgramDicomInput, RefusesDistancesThatMayLackSlices)
{
  const auto expectRefused = [this](const std::vector<double> & positions, const std::string & mention) {
    this->WritePositions(positions);
    this->ExpectFailure("dicom out.png", mention);
  };
  expectRefused({ 0, 2, 4, 6, 8, 190, 192, 194, 196 }, " at 190 mm are 182 mm apart; others are 2 mm apart");
  expectRefused({ 0, 4, 8, 12, 20, 24, 28 }, " at 20 mm; others are 4 mm apart");
  expectRefused({ 0, 4, 8, 12, 20, 28, 36, 40, 44, 48 }, "a slice is missing between ");
  expectRefused({ 0, 4, 8, 12, 16, 24 }, "a slice is missing between ");
  expectRefused({ 0, 4, 8, 12, 16, 23, 30 }, " are 7 mm apart; others are 4 to 7 mm apart");
  expectRefused({ 0, 4, 8, 12, 16, 26, 33, 40, 47 }, " at 26 mm are 10 mm apart; others are 4 to 7 mm apart");
  expectRefused({ 0, 4, 8, 12, 26, 40, 54 }, " are 14 mm apart; others are 4 to 14 mm apart");
}

TEST_P(ShearWarpMIPProgramDicomInput, AllowsAFifthOfTheDistance)
{
  const std::string warning = "the slices are not evenly spaced: one is 0.59 mm away from where it should be";
  for (const std::string position : { "0\\0\\6.59", "0\\0.59\\6", "0.59\\0\\6" })
  {
    this->WriteSlices({ { "0\\0\\0" }, { "0\\0\\3" }, { position }, { "0\\0\\9" }, { "0\\0\\12" } });
    ExpectSlices<short>(this->ReadFolder(warning), { 0, 1, 2, 3, 4 });
  }
  for (const std::string position : { "0\\0\\6.61", "0\\0.61\\6", "0.61\\0\\6" })
  {
    this->WriteSlices({ { "0\\0\\0" }, { "0\\0\\3" }, { position }, { "0\\0\\9" }, { "0\\0\\12" } });
    this->ExpectFailure("dicom out.png",
                        position == "0\\0\\6.61" ? "3.61 mm apart; others are 2.39 to 3 mm" : "beside the line");
  }
}

TEST_P(ShearWarpMIPProgramDicomInput, ReadsTheVolumeThatIsChosen)
{
  Planes planes = { { "0\\0\\0" }, { "0\\0\\2" }, { "0\\0\\4" } };
  planes.insert(planes.end(), { planes[0], planes[1], planes[2] });
  const auto expectChoice = [&](const AddFunction & add, const std::string & message) {
    SCOPED_TRACE(message);
    this->WriteSlices(planes, ctImage, add);
    this->ExpectFailure("dicom out.png", "'dicom' has 2 volumes, which differ in " + message + '\n');
    const auto warn = [](const std::string & text) { FAIL() << text; };
    ExpectSlices<short>(ReadVolume(m_Folder / "dicom", "", warn, "--series", "1"), { 3, 4, 5 });
    ExpectSlices<short>(ReadVolume(m_Folder / "dicom", "1", warn, "--series", "2"), { 0, 1, 2 });
  };
  // the volume that is written first is the second by its value, and each slice has a number of its own
  const auto set = [](DataSet & dataSet, std::size_t slice, const Tag & tag, const std::string & value) {
    SetText(dataSet, { 0x0020, 0x0013 }, std::to_string(slice + 1));
    SetAttributes(dataSet, GetParam(), { 0x0018, 0x9112 }, { { tag, value } });
  };
  struct Difference
  {
    Tag         tag;
    std::string name;
    std::string first;
    std::string second;
  };
  for (const Difference & difference :
       { Difference{ { 0x0018, 0x0060 }, "KVP (0018,0060)", "140", "80" },
         Difference{ { 0x0018, 0x0081 }, "Echo Time (0018,0081)", "10.5", "9.2" },
         Difference{ { 0x0018, 0x0082 }, "Inversion Time (0018,0082)", "1000", "200" },
         Difference{ { 0x0018, 0x1210 }, "Convolution Kernel (0018,1210)", "B70f", "B30f" },
         Difference{ { 0x0018, 0x1314 }, "Flip Angle (0018,1314)", "15", "3" },
         Difference{ { 0x0018, 0x1060 }, "Trigger Time (0018,1060)", "100", "20" },
         Difference{ { 0x0020, 0x0100 }, "Temporal Position Identifier (0020,0100)", "2", "1" },
         Difference{ { 0x0008, 0x0008 }, "Image Type (0008,0008)", "ORIGINAL\\PRIMARY\\P", "ORIGINAL\\PRIMARY\\M" },
         Difference{ { 0x0008, 0x0032 }, "Acquisition Time (0008,0032)", "101010", "101000" } })
  {
    expectChoice(
      [&](DataSet & dataSet, std::size_t slice) {
        set(dataSet, slice, difference.tag, slice < 3 ? difference.first : difference.second);
      },
      difference.name + "; choose one by --volume NUMBER: 1: " + difference.second + "; 2: " + difference.first);
  }
  // a number in binary, in two sequences
  expectChoice(
    [](DataSet & dataSet, std::size_t slice) {
      gdcm::Attribute<0x0018, 0x9087> value;
      value.SetValue(slice < 3 ? 1000.0 : 0.0);
      DataSet item;
      item.Replace(value.GetAsDataElement());
      SetSequence(dataSet, { 0x0018, 0x9117 }, { item });
    },
    "Diffusion b-value (0018,9087); choose one by --volume NUMBER: 1: 0; 2: 1000");
  // each slice at a time of its own
  for (const Tag & tag : { Tag(0x0008, 0x0033), Tag(0x0008, 0x002a) })
  {
    const std::string name =
      tag == Tag(0x0008, 0x0033) ? "Content Time (0008,0033)" : "Acquisition DateTime (0008,002a)";
    expectChoice(
      [&](DataSet & dataSet, std::size_t slice) {
        set(dataSet, slice, tag, "1010" + std::to_string(slice < 3 ? 23 + slice : 7 + slice));
      },
      name + "; choose one by --volume NUMBER: 1: 101010 to 101012; 2: 101023 to 101025");
  }
  for (const std::string number : { "0", "3", "-1", "x", "01" })
  {
    this->ExpectFailure("dicom out.png --volume=" + number, "--volume " + number + " is not in 'dicom', which has 2");
  }
  const std::string overlay = "dicom out.png --volume 1 --overlay dicom";
  this->ExpectFailure(overlay, "differ in Acquisition DateTime (0008,002a); choose one by --overlay-volume NUMBER: ");
  this->ExpectFailure(overlay + " --overlay-volume 3", "--overlay-volume 3 is not in 'dicom', which has 2");
  EXPECT_EQ(this->Run(overlay + " --overlay-volume 2").status, 0);
  this->ExpectFailure("in.nrrd out.png --mask dicom", "; put the images of one into a folder of their own: 1: ");
}

TEST_P(ShearWarpMIPProgramDicomInput, NamesAllAttributesThatTellVolumesApart)
{
  Planes planes;
  for (unsigned int n = 0; n < 12; ++n)
  {
    planes.push_back({ "0\\0\\" + std::to_string(2 * (n % 3)) });
  }
  // echoes in phases
  this->WriteSlices(planes, ctImage, [](DataSet & dataSet, std::size_t slice) {
    SetAttributes(
      dataSet,
      GetParam(),
      { 0x0018, 0x9112 },
      { { { 0x0018, 0x0081 }, slice / 3 % 2 == 0 ? "4" : "8" }, { { 0x0018, 0x1060 }, slice < 6 ? "0" : "50" } });
  });
  this->ExpectFailure("dicom out.png",
                      "4 volumes, which differ in Echo Time (0018,0081), Trigger Time (0018,1060); choose one by "
                      "--volume NUMBER: 1: 4, 0; 2: 4, 50; 3: 8, 0; 4: 8, 50\n");
  const auto warn = [](const std::string & text) { FAIL() << text; };
  ExpectSlices<short>(ReadVolume(m_Folder / "dicom", "", warn, "--series", "3"), { 3, 4, 5 });
  if (GetParam())
  {
    this->ExpectSuccess("dicom/frames.dcm out.nrrd --volume 2");
  }
  this->WriteSlices({ { "0\\0\\0" }, { "0\\0\\2" }, { "0\\0\\4" } });
  this->ExpectSuccess("dicom out.nrrd --volume 1");
  this->ExpectFailure("dicom out.png --volume 2", "--volume 2 is not in 'dicom', which has one volume\n");
}

TEST_P(ShearWarpMIPProgramDicomInput, RefusesImpossiblePixels)
{
  const auto expectRefused = [this](const std::function<void(DataSet &)> & change) {
    this->WriteSlices({ { "0\\0\\0" }, { "0\\0\\2" }, { "0\\0\\4" } });
    this->ChangeFile(GetParam() ? "dicom/frames.dcm" : "dicom/a1.dcm", change);
    this->ExpectFailure("dicom out.png",
                        "has no valid pixels: its Bits Allocated, Bits Stored or Pixel Representation");
  };
  expectRefused([](DataSet & dataSet) { SetNumber<0x0028, 0x0100>(dataSet, 12); });
  expectRefused([](DataSet & dataSet) { SetNumber<0x0028, 0x0101>(dataSet, 17); });
  expectRefused([](DataSet & dataSet) { dataSet.Remove(Tag(0x0028, 0x0103)); });
}

TEST_P(ShearWarpMIPProgramDicomInput, ReadsGridOfDoseAndSlicesOfNuclearMedicine)
{
  DataSet grid = MakeImage(dose, 0, 3);
  SetPlane(grid, { "1\\2\\3" }, false);
  SetText(grid, { 0x3004, 0x000e }, "0.5");
  SetText(grid, { 0x3004, 0x000c }, "0\\2.5\\5");
  this->WriteFile(grid, "dicom/a.dcm");
  Volume volume = this->ReadFolder();
  ExpectSlices<double>(volume, { 0, 1, 2 }, [](std::size_t, double stored) { return 0.5 * stored; });
  ExpectGrid(volume, { 1, 2, 3 }, { 0.5, 1.5, 2.5 }, { 0, 0, 1 });
  SetText(grid, { 0x3004, 0x000c }, "0\\2.5\\7.5");
  this->WriteFile(grid, "dicom/a.dcm");
  this->ExpectFailure("dicom out.png", "a slice is missing between frame 2 of ");

  DataSet emission = MakeImage(nuclearImage, 0, 3);
  DataSet detector;
  SetPlane(detector, { "1\\2\\3", "1\\0\\0\\0\\0\\-1", "" }, false);
  SetSequence(emission, { 0x0054, 0x0022 }, { detector });
  SetText(emission, { 0x0028, 0x0030 }, "1.5\\0.5");
  SetText(emission, { 0x0018, 0x0088 }, "4");
  this->WriteFile(emission, "dicom/a.dcm");
  this->ExpectFailure("dicom out.png", "two slices lie at one position");
  gdcm::DataElement pointer(Tag(0x0028, 0x0009), 0, gdcm::VR::AT);
  pointer.SetByteValue("\x54\x00\x80\x00", 4);
  emission.Insert(pointer);
  this->WriteFile(emission, "dicom/a.dcm");
  volume = this->ReadFolder();
  ExpectSlices<short>(volume, { 0, 1, 2 });
  ExpectGrid(volume, { 1, 2, 3 }, { 0.5, 1.5, 4.0 }, { 0, 1, 0 });
  const auto insertVector = [](DataSet & dataSet, auto vector, const std::vector<unsigned short> & values) {
    vector.SetNumberOfValues(static_cast<unsigned int>(values.size()));
    for (unsigned int n = 0; n < values.size(); ++n)
    {
      vector.SetValue(n, values[n]);
    }
    dataSet.Insert(vector.GetAsDataElement());
  };
  insertVector(emission, gdcm::Attribute<0x0054, 0x0080>(), { 3, 2, 1 });
  this->WriteFile(emission, "dicom/a.dcm");
  this->ExpectFailure("dicom out.png", "is not in the order of the slices");

  // slices in two phases of the heart
  DataSet gated = MakeImage(nuclearImage, 0, 6);
  SetSequence(gated, { 0x0054, 0x0022 }, { detector });
  SetText(gated, { 0x0028, 0x0030 }, "1.5\\0.5");
  SetText(gated, { 0x0018, 0x0088 }, "4");
  pointer.SetByteValue("\x54\x00\x70\x00\x54\x00\x80\x00", 8);
  gated.Insert(pointer);
  insertVector(gated, gdcm::Attribute<0x0054, 0x0070>(), { 1, 1, 1, 2, 2, 2 });
  insertVector(gated, gdcm::Attribute<0x0054, 0x0080>(), { 1, 2, 3, 1, 2, 3 });
  this->WriteFile(gated, "dicom/a.dcm");
  this->ExpectFailure("dicom out.png",
                      "2 volumes, which differ in Time Slot Vector (0054,0070); choose one by --volume NUMBER: 1: 1; "
                      "2: 2\n");
  const auto warn = [](const std::string & text) { FAIL() << text; };
  volume = ReadVolume(m_Folder / "dicom", "", warn, "--series", "2");
  ExpectSlices<short>(volume, { 3, 4, 5 });
  ExpectGrid(volume, { 1, 2, 3 }, { 0.5, 1.5, 4.0 }, { 0, 1, 0 });
}

TEST_P(ShearWarpMIPProgramDicomInput, ReadsLabelMap)
{
  // of 16 bits with padding, or of 8
  const unsigned int               bits = GetParam() ? 16 : 8;
  const unsigned short             padding = GetParam() ? 999 : 0;
  const std::array<std::size_t, 3> order = { 2, 0, 1 };
  const auto                       getNumber = [padding](std::size_t slice, std::size_t pixel) {
    const unsigned short numbers[] = { padding, 3, 0, 200 };
    return numbers[(slice + pixel) % 4];
  };
  DataSet              map = MakeImage("1.2.840.10008.5.1.4.1.1.66.7", 0, 3);
  std::vector<DataSet> groups;
  std::string          pixels;
  for (const std::size_t slice : order)
  {
    groups.emplace_back();
    SetPlane(groups.back(), { "-39\\13\\" + std::to_string(3 + 2 * slice), "", "" }, true);
    for (std::size_t n = 0; n < std::size_t{ columns } * rows; ++n)
    {
      const unsigned short number = getNumber(slice, n);
      pixels += static_cast<char>(number & 0xff);
      pixels += bits == 16 ? std::string(1, static_cast<char>(number >> 8)) : "";
    }
  }
  DataSet shared;
  SetPlane(shared, { "" }, true);
  SetSequence(map, { 0x5200, 0x9229 }, { shared });
  SetSequence(map, { 0x5200, 0x9230 }, groups);
  std::vector<DataSet> segments(2);
  SetNumber<0x0062, 0x0004>(segments[0], 3);
  SetText(segments[0], { 0x0062, 0x0005 }, "liver");
  SetNumber<0x0062, 0x0004>(segments[1], 200);
  SetText(segments[1], { 0x0062, 0x0005 }, "spleen");
  SetSequence(map, { 0x0062, 0x0002 }, segments);
  SetText(map, { 0x0062, 0x0001 }, "LABELMAP");
  SetFormat(map, { bits, bits, false });
  gdcm::DataElement element(Tag(0x7fe0, 0x0010), 0, bits == 8 ? gdcm::VR::OB : gdcm::VR::OW);
  element.SetByteValue(pixels.data(), static_cast<std::uint32_t>(pixels.size()));
  map.Replace(element);
  if (padding != 0)
  {
    gdcm::DataElement value(Tag(0x0028, 0x0120), 0, gdcm::VR::US);
    value.SetByteValue(reinterpret_cast<const char *>(&padding), sizeof(padding));
    map.Replace(value);
  }
  this->WriteFile(map, "dicom/map.dcm");

  const Segments read = ReadSegments(this->GetPath("dicom/map.dcm"), [](const std::string & text) { FAIL() << text; });
  ASSERT_EQ(read.list.size(), 2u);
  EXPECT_EQ(read.list[0].name, "liver");
  EXPECT_EQ(read.list[0].label, 3u);
  EXPECT_EQ(read.list[1].name, "spleen");
  EXPECT_EQ(read.list[1].label, 200u);
  // a slice at each end is empty
  ASSERT_EQ(read.labels.times.front().image->GetLargestPossibleRegion().GetSize(),
            (itk::Size<3>{ { columns, rows, 5 } }));
  ExpectGrid(read.labels, { -39, 13, 1 }, { 0.5, 1.5, 2.0 }, { 0, 0, 1 });
  const unsigned short * label = CastImage<unsigned short>(read.labels.times.front()).GetBufferPointer();
  for (std::size_t slice = 0; slice < 5; ++slice)
  {
    for (std::size_t n = 0; n < std::size_t{ columns } * rows; ++n)
    {
      const unsigned short number = slice == 0 || slice == 4 ? 0 : getNumber(slice - 1, n);
      ASSERT_EQ(*label++, number == padding ? 0 : number);
    }
  }
  this->ExpectSuccess("in.nrrd out.png --segments dicom");
  this->ExpectFailure("dicom/map.dcm out.png", "is a DICOM segmentation: --segments takes one");
  this->ExpectFailure("dicom out.png", "is a DICOM segmentation: --segments takes one");
  this->WithCutFile("dicom/map.dcm", ReadText(m_Folder / "dicom/map.dcm").size() - 1, [&] {
    this->ExpectFailure("in.nrrd out.png --segments dicom/map.dcm", "map.dcm' is damaged or incomplete");
  });
}

TEST_P(ShearWarpMIPProgramDicomInput, CountsWhatIsInTheFolder)
{
  const Planes planes = { { "0\\0\\0" }, { "0\\0\\2" }, { "0\\0\\4" } };
  const auto   folder = m_Folder / "dicom";
  const auto   expectAll = [&](const std::string & mention) {
    ExpectSlices<short>(this->ReadFolder(mention), { 0, 1, 2 });
  };
  this->WriteSlices(planes);
  fs::create_directory(folder / "folder");
  std::ofstream(folder / "readme.txt") << "no image\n";
  std::ofstream(folder / ".hidden") << '\0';
  expectAll("");

  // whatever their place in the listing, many before some slice
  for (unsigned int n = 0; n < 20; ++n)
  {
    const std::string name = (folder / ("pipe" + std::to_string(n))).string();
    ASSERT_EQ(mkfifo(name.c_str(), 0600), 0);
  }
  expectAll("pipe0' and 19 more (no regular file)");
  this->ExpectFailure("dicom/pipe0 out.png", "'dicom/pipe0' is neither a file nor a folder");
  this->ExpectFailure("in.nrrd out.png --transform dicom/pipe0", "'dicom/pipe0' is neither a file nor a folder");

  this->WriteSlices(planes);
  std::ofstream(folder / "notes.dcm") << "Slices 1 to 3 are of Monday\n";
  std::ofstream(folder / "Thumbs.db") << '\0';
  expectAll("notes.dcm' (text, not DICOM)");
  expectAll("Thumbs.db' (not DICOM)");

  // what might be a slice
  std::ofstream(folder / "z.dcm") << '\0';
  this->ExpectFailure("dicom out.png", "z.dcm' is damaged or incomplete");
  this->WriteSlices(planes);
  for (const auto & file : ListFiles(folder))
  {
    fs::rename(file, folder / file.stem());
  }
  expectAll("");
  std::ofstream(folder / "z") << "";
  this->ExpectFailure("dicom out.png", "z' is damaged or incomplete");

  this->WriteSlices(planes);
  fs::create_symlink("a1.dcm", folder / "broken.dcm");
  fs::create_symlink("../none.dcm", folder / "broken2.dcm");
  fs::remove(folder / "broken.dcm");
  this->ExpectFailure("dicom out.png", "broken2.dcm' is a link to a file that is not there");
  fs::remove(folder / "broken2.dcm");
  fs::create_symlink("loop.dcm", folder / "loop.dcm");
  const auto result = this->Run("dicom out.png");
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(result.messages, "shear-warp-mip: 'dicom/loop.dcm': Too many levels of symbolic links\n");
}

TEST_P(ShearWarpMIPProgramDicomInput, ShowsLowValuesWhiteIfTheyAre)
{
  for (const std::string photometric : { "MONOCHROME2", "MONOCHROME1" })
  {
    SCOPED_TRACE(photometric);
    const bool isInverted = photometric == "MONOCHROME1";
    this->WriteSlices({ MakePlane("0", "1", "-1024"), MakePlane("1", "1", "-1024") });
    for (const auto & file : ListFiles(m_Folder / "dicom"))
    {
      this->ChangeFile(file, [&](DataSet & dataSet) { SetText(dataSet, { 0x0028, 0x0004 }, photometric); });
    }
    const std::string view = " --view inferior --window -1024 -769";
    fs::remove_all(m_Folder / "series");
    this->ExpectSuccess("dicom out.nrrd --dicom-out series" + view);
    this->ExpectSuccess("dicom out.png" + view);
    this->ExpectSuccess("dicom out.html --frames 2" + view);
    // the stem of the letter R is white, its rim is black
    this->ExpectSuccess("dicom labelled.png --size 64 64 --output-spacing 0.1" + view);
    const auto labelled = this->ReadPixels("labelled.png");
    EXPECT_EQ(labelled[32 * 64 + 3], 255);
    EXPECT_EQ(labelled[32 * 64 + 2], 0);
    // u is to the patient's left, v to posterior: as in the slices
    const auto   values = this->ReadPixels<itk::Image<int, 2>>("out.nrrd");
    const auto   greys = this->ReadPixels("out.png");
    gdcm::Reader reader;
    reader.SetFileName(this->GetPath("series/frame-001.dcm").c_str());
    ASSERT_TRUE(reader.Read());
    const auto getBytes = [&reader](const Tag & tag) {
      return reader.GetFile().GetDataSet().GetDataElement(tag).GetByteValue()->GetPointer();
    };
    EXPECT_EQ(std::string(getBytes({ 0x0028, 0x0004 }), photometric.size()), photometric);
    ASSERT_EQ(values.size(), std::size_t{ columns } * rows);
    for (std::size_t n = 0; n < values.size(); ++n)
    {
      short archived = 0;
      std::memcpy(&archived, getBytes({ 0x7fe0, 0x0010 }) + n * sizeof(short), sizeof(short));
      EXPECT_EQ(archived, GetStored(1, n) - 1024);
      EXPECT_EQ(values[n], GetStored(1, n) - 1024);
      EXPECT_EQ(greys[n], isInverted ? 255 - GetStored(1, n) : GetStored(1, n));
    }
    EXPECT_NE(ReadText(m_Folder / "out.html").find(isInverted ? "\"inverted\": true" : "\"inverted\": false"),
              std::string::npos);
  }
}
} // namespace
