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

#include "itkBSplineTransform.h"
#include "itkCompositeTransform.h"
#include "itkTransformIOFactory.h"
#include "itkTranslationTransform.h"
#include "itkVersorTransform.h"

#include <gdcmReader.h>
#include <gdcmWriter.h>

#include <cstdint>

// A file is read right whatever lies beside it, or refused with the reason.

namespace
{
using namespace ShearWarpMIPProgramTest;

using CompositeType = itk::CompositeTransform<double, 3>;
using AffineType = itk::AffineTransform<double, 3>;

std::string
Replace(std::string text, const std::string & before, const std::string & after)
{
  const auto place = text.find(before);
  EXPECT_NE(place, std::string::npos) << before;
  return place == std::string::npos ? text : text.replace(place, before.size(), after);
}

std::string
MakeBytes(std::vector<std::int32_t> numbers)
{
  return { reinterpret_cast<const char *>(numbers.data()), numbers.size() * sizeof(std::int32_t) };
}

/** Makes a transform without numbers. */
std::string
MakeMATLABTransform(const std::string & type)
{
  return MakeBytes({ 0, 0, 1, 0, static_cast<std::int32_t>(type.size()) }) + type + MakeBytes({ 0, 0, 1, 0, 5 }) +
         "fixed";
}

class ShearWarpMIPProgramTransforms : public ShearWarpMIPProgram
{
protected:
  static bool
  CanWrite(const std::string & name)
  {
    return itk::TransformIOFactoryTemplate<double>::CreateTransformIO(name.c_str(), itk::IOFileModeEnum::WriteMode);
  }

  void
  ExpectRefused(const std::string & name, const std::string & reason) const
  {
    this->ExpectFailure("in.nrrd out.png --transform " + name, "'" + name + "' " + reason);
  }

  void
  ExpectRefusedBytes(const std::string & name, const std::string & bytes, const std::string & reason) const
  {
    std::ofstream(m_Folder / name, std::ios::binary) << bytes;
    this->ExpectRefused(name, reason);
  }

  const std::string m_Unreadable = "is not a transform that ITK can read";
  const std::string m_Empty = "holds an empty composite transform";
};

class ShearWarpMIPProgramTransformFormat
  : public ShearWarpMIPProgramTransforms
  , public testing::WithParamInterface<std::string>
{
protected:
  void
  SetUp() override
  {
    ShearWarpMIPProgramTransforms::SetUp();
    if (!CanWrite(m_Name))
    {
      GTEST_SKIP() << "this ITK has no such files";
    }
  }

  const std::string m_Name = "view" + GetParam();
};

TEST_P(ShearWarpMIPProgramTransformFormat, IsRead)
{
  const auto affine = AffineType::New();
  affine->SetCenter(m_Volume->GetOrigin());
  affine->Rotate(0, 1, 0.3);
  affine->Scale(1.5);
  this->WriteTransforms(m_Name, { affine });
  this->ExpectSuccess("in.nrrd out.nrrd --transform " + m_Name);
  this->ExpectPicture("out.nrrd", this->Project(affine));

  const auto translation = itk::TranslationTransform<double, 3>::New();
  translation->Translate(MakeVector(3.0, 4.0, 5.0));
  const auto composite = CompositeType::New();
  composite->AddTransform(affine);
  composite->AddTransform(translation);
  this->WriteTransforms(m_Name, { composite });
  if (GetParam() == ".mat")
  {
    // ITK does not write the parts
    this->ExpectRefused(m_Name, m_Empty);
    return;
  }
  this->ExpectSuccess("in.nrrd out.nrrd --transform " + m_Name);
  this->ExpectPicture("out.nrrd", this->Project(composite));
}

TEST_P(ShearWarpMIPProgramTransformFormat, IsRefusedIfNotLinear)
{
  this->WriteTransforms(m_Name, { itk::BSplineTransform<double, 3, 3>::New() });
  this->ExpectRefused(m_Name, "holds a BSplineTransform_double_3_3; a linear 3D transform is needed");
  this->WriteTransforms(m_Name, { itk::AffineTransform<double, 2>::New() });
  this->ExpectRefused(m_Name, "holds a AffineTransform_double_2_2; a linear 3D transform is needed");
  const auto flat = AffineType::New();
  flat->Scale(MakeVector(1.0, 1.0, 0.0));
  this->WriteTransforms(m_Name, { flat });
  this->ExpectFailure("in.nrrd out.png --transform " + m_Name, "invertible");
}

TEST_P(ShearWarpMIPProgramTransformFormat, IsRefusedIfNumbersDoNotGoWithTheType)
{
  // names of one length, of 12 and of 3 numbers
  const std::string affine = "AffineTransform_double_3_3";
  const std::string versor = "VersorTransform_double_3_3";
  this->WriteTransforms(m_Name, { AffineType::New() });
  const std::string bytes = ReadText(m_Folder / m_Name);
  this->ExpectRefusedBytes(m_Name, Replace(bytes, affine, versor), m_Unreadable);
  this->ExpectRefusedBytes(m_Name, Replace(bytes, affine, "UnknownTransform_double_3_"), m_Unreadable);
  this->ExpectRefusedBytes(m_Name, Replace(bytes, "_double_", "_______"), m_Unreadable);
  this->WriteTransforms(m_Name, { itk::VersorTransform<double>::New() });
  this->ExpectRefusedBytes(m_Name, Replace(ReadText(m_Folder / m_Name), versor, affine), m_Unreadable);
}

TEST_P(ShearWarpMIPProgramTransformFormat, IsRefusedIfDamaged)
{
  this->WriteTransforms(m_Name, { AffineType::New() });
  const std::string bytes = ReadText(m_Folder / m_Name);
  const std::size_t last = GetParam() == ".tfm" || GetParam() == ".txt" ? bytes.find("Fixed") : bytes.size() - 1;
  for (const std::size_t kept : { last, last - 8, last / 2, last / 4, std::size_t{ 1 }, std::size_t{ 0 } })
  {
    SCOPED_TRACE(kept);
    this->ExpectRefusedBytes(m_Name, bytes.substr(0, kept), m_Unreadable);
  }
  std::mt19937 random;
  for (int n = 0; n < 3; ++n)
  {
    std::string noise(300, '\0');
    std::generate(noise.begin(), noise.end(), [&random] { return static_cast<char>(random()); });
    this->ExpectRefusedBytes(m_Name, noise, m_Unreadable);
    this->ExpectRefusedBytes(m_Name, bytes.substr(0, last / 2) + noise, m_Unreadable);
  }
  this->ExpectRefusedBytes(m_Name, "no transform\n", m_Unreadable);
  if (GetParam() == ".h5")
  {
    // the type's text, length and place in a heap; HDF5 crashes if there is none
    const std::string type = MakeBytes({ 26, static_cast<std::int32_t>(bytes.find("GCOL")), 0 });
    this->ExpectRefusedBytes(m_Name, Replace(bytes, type, std::string(type.size(), '\0')), m_Unreadable);
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, ShearWarpMIPProgramTransformFormat, testing::Values(".tfm", ".txt", ".mat", ".h5"));

TEST_F(ShearWarpMIPProgramTransforms, AreRefusedIfTextIsUnsound)
{
  const std::string euler = "Transform: Euler3DTransform_double_3_3\n";
  const std::string translation = "Transform: TranslationTransform_double_3_3\n";
  const std::string numbers = "Parameters: 1 2 3\nFixedParameters:\n";
  const std::string composite = "Transform: CompositeTransform_double_3_3\n";
  for (const std::string & text : { euler + "Parameters:\nFixedParameters: 0 0 0\n",
                                    euler + "Parameters: 0 0 0 1 2\nFixedParameters: 0 0 0\n",
                                    euler + "Parameters: 0 0 0 1 2 3\nFixedParameters: 0 0\n",
                                    euler + "Parameters: 0 0 nan 1 2 3\nFixedParameters: 0 0 0\n",
                                    euler,
                                    translation + "Parameters: 1 2 3\n" + euler + "FixedParameters: 0 0 0\n",
                                    "Parameters: 1 2 3\n" + euler + "FixedParameters: 0 0 0\n",
                                    std::string("Parameters: 1 2 3\n"),
                                    std::string("ComponentTransformFile: view.tfm\n"),
                                    std::string("Transform: Euler3DTransform\n"),
                                    std::string("Transform: Euler3DTransform_int_3_3\n"),
                                    composite + translation })
  {
    SCOPED_TRACE(text);
    this->ExpectRefusedBytes("view.tfm", "#Insight Transform File V1.0\n" + text, m_Unreadable);
  }
  std::ofstream(m_Folder / "part.tfm") << translation + numbers;
  // ITK looks for parts where the name has a folder
  this->ExpectRefusedBytes("./view.tfm", composite + "ComponentTransformFile: part.tfm\n", m_Unreadable);
  this->ExpectRefusedBytes("view.tfm", composite, m_Empty);
  this->ExpectRefusedBytes("view.tfm", composite + composite + translation + numbers, m_Empty);
  this->ExpectRefusedBytes("view.tfm", translation + numbers + composite, m_Empty);
  this->ExpectRefusedBytes("view", translation + numbers, m_Unreadable);
  this->ExpectRefused("missing.tfm", "does not exist");
}

TEST_F(ShearWarpMIPProgramTransforms, AreRefusedIfMATLABIsUnsound)
{
  if (!CanWrite("view.mat"))
  {
    GTEST_SKIP() << "this ITK has no such files";
  }
  const std::string type = "TranslationTransform_double_3_3";
  this->ExpectRefusedBytes("view.mat", MakeMATLABTransform("CompositeTransform_double_3_3"), m_Empty);
  this->ExpectRefusedBytes("view.mat", MakeMATLABTransform(type), m_Unreadable);
  for (const std::vector<std::int32_t> & header : std::vector<std::vector<std::int32_t>>{
         { 0, 1 << 30, 1, 0, 31 }, { 0, -1, 1, 0, 31 }, { 0, 3, 1, 1, 31 }, { 0, 3, 1, 0, -1 }, { 7, 3, 1, 0, 31 } })
  {
    const std::string numbers(3 * sizeof(double), '\0');
    SCOPED_TRACE(testing::PrintToString(header));
    this->ExpectRefusedBytes(
      "view.mat", MakeBytes(header) + type + numbers + MakeBytes({ 0, 0, 1, 0, 5 }) + "fixed", m_Unreadable);
  }
}

class ShearWarpMIPProgramNIfTI : public ShearWarpMIPProgram
{
protected:
  /** Writes \a name with others that belong to it. */
  void
  WriteFiles(const std::string & name, PixelType lowest) const
  {
    this->WriteImage(MakeVolume<PixelType>(lowest), name);
  }

  void
  ExpectRead(const std::string & name) const
  {
    this->ExpectSuccess(name + " out.nrrd");
    this->ExpectPicture("out.nrrd", this->Project(this->MakeTransform(Direction::Anterior)));
  }

  void
  ExpectRefused(const std::string & name, const std::string & header, const std::string & voxels) const
  {
    const std::string reason = "'" + name +
                               "' cannot be read beside files of like names: ITK would take the header of '" + header +
                               "' and the voxels of '" + voxels + "'";
    this->ExpectFailure(name + " out.png", reason);
    this->ExpectFailure("in.nrrd out.png --mask " + name, reason);
  }
};

TEST_F(ShearWarpMIPProgramNIfTI, IsNotReadFromANeighbour)
{
  this->WriteFiles("x.nii.gz", 10);
  this->ExpectRead("x.nii.gz");
  this->WriteFiles("x.nii", 20);
  this->ExpectRefused("x.nii.gz", "x.nii.gz", "x.nii");
  fs::copy_file(m_Folder / "x.nii.gz", m_Folder / "X.NII.GZ");
  this->ExpectRead("X.NII.GZ");
  this->Move("x.nii", "X.NII");
  this->ExpectRefused("X.NII.GZ", "X.NII.GZ", "X.NII");

  // the file that niftilib prefers
  this->WriteFiles("y.nii", 10);
  this->WriteFiles("y.nii.gz", 20);
  this->WriteFiles("y.img", 20);
  this->ExpectRead("y.nii");
}

TEST_F(ShearWarpMIPProgramNIfTI, IsNotHiddenByAnOutput)
{
  this->WriteFiles("x.nii.gz", 10);
  this->WriteFiles("y.nii", 20);
  this->ExpectFailures("",
                       { "x.nii.gz x.nii", "x.nii.gz ./x.nii", "in.nrrd out.png --mask x.nii.gz --depth x.nii" },
                       "x.nii' beside 'x.nii.gz', which this call reads: ");
  this->ExpectFailure("y.nii y.nii.gz", "cannot write 'y.nii.gz' beside 'y.nii', which this call reads: ");
  this->ExpectSuccess("x.nii.gz y.nii.gz");
}

TEST_F(ShearWarpMIPProgramNIfTI, IsNotReadFromAPairThatIsAnothers)
{
  this->WriteFiles("x.img.gz", 10);
  this->ExpectRead("x.img.gz");
  this->ExpectRead("x.hdr.gz");
  this->WriteFiles("y.img", 20);
  this->Move("y.img", "x.img");
  this->ExpectRefused("x.img.gz", "x.hdr.gz", "x.img");
  this->ExpectRefused("x.hdr.gz", "x.hdr.gz", "x.img");
  fs::remove(m_Folder / "x.img");
  this->Move("y.hdr", "x.hdr");
  this->ExpectRefused("x.img.gz", "x.hdr", "x.img.gz");

  this->WriteFiles("z.img", 10);
  this->WriteFiles("z.nii", 20);
  this->WriteFiles("y.img.gz", 20);
  this->Move("y.img.gz", "z.img.gz");
  this->ExpectRead("z.hdr");
  this->ExpectRead("z.img");
  fs::remove(m_Folder / "z.img.gz");
  this->Move("z.img", "w.img");
  this->ExpectRefused("z.hdr", "z.hdr", "z.nii");
  this->Move("w.img", "z.img");
  fs::remove(m_Folder / "z.hdr");
  this->ExpectRefused("z.img", "z.nii", "z.nii");
  this->Move("z.nii", "w.nii");
  this->WriteFiles("v.img", 10);
  fs::remove(m_Folder / "v.img");
  this->ExpectFailure("v.hdr out.png", "'v.hdr' is damaged or incomplete: there is no 'v.img' for its voxels");
}

class ShearWarpMIPProgramDicomFiles : public ShearWarpMIPProgram
{};

TEST_F(ShearWarpMIPProgramDicomFiles, AreReadWhateverTheirNames)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4, 6, 8 });
  this->ExpectSuccess("dicom plain.mha");
  const std::vector<std::string> names = { "--help", "-\n.dcm", "a'b\"c d.dcm", "\xc3\xa4.dcm", "$(false);\\*.dcm" };
  for (std::size_t slice = 0; slice < names.size(); ++slice)
  {
    this->Move("dicom/a" + std::to_string(slice) + ".dcm", "dicom/" + names[slice]);
  }
  this->ExpectSuccess("dicom out.mha");
  EXPECT_TRUE(ReadText(m_Folder / "out.mha") == ReadText(m_Folder / "plain.mha"));
  this->ExpectCutFileRefused("dicom", "dicom/--help", fs::file_size(m_Folder / "dicom/--help") / 2);
}

TEST_F(ShearWarpMIPProgramDicomFiles, AreParsedWhereSignalsAreIgnored)
{
  this->WriteDICOMSeries("1.2.3.4", "a", std::vector<double>{ 0, 2, 4 });
  const std::string command = "cd '" + m_Folder.string() + "' && trap '' INT TERM && { '" + GetProgram() +
                              "' dicom out.nrrd & program=$!; } && "
                              "{ while kill -INT $program && kill -TERM $program; do :; done 2>/dev/null & } && "
                              "wait $program";
  EXPECT_EQ(std::system(command.c_str()), 0);
  EXPECT_TRUE(fs::exists(m_Folder / "out.nrrd"));
}

TEST_F(ShearWarpMIPProgramDicomFiles, AreParsedWhereStreamsAreClosed)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4 });
  for (const std::string closed : { "<&- >&-", ">&-", "2>&-", "<&- >&- 2>&-" })
  {
    EXPECT_EQ(this->Run("dicom out.nrrd", R"(sh -c '"$0" "$@" )" + closed + "'").status, 0) << closed;
  }
}

TEST_F(ShearWarpMIPProgramDicomFiles, AreParsedHoweverMany)
{
  std::vector<double> positions(300);
  for (std::size_t slice = 0; slice < positions.size(); ++slice)
  {
    positions[slice] = 2.0 * static_cast<double>(slice);
  }
  const std::string prefix(220, 'x');
  this->WriteDICOMSeries("1.2.3.4", prefix, positions, 2);
  this->ExpectSuccess("dicom out.nrrd --output-spacing 1");
  EXPECT_EQ(this->Read("out.nrrd")->GetBufferedRegion().GetSize(1), 600u);
  // wherever that is in the folder's order
  for (const std::string slice : { "0", "99", "128", "299" })
  {
    const std::string name = "dicom/" + prefix + slice + ".dcm";
    this->ExpectCutFileRefused("dicom", name, fs::file_size(m_Folder / name) - 1);
  }
}

TEST_F(ShearWarpMIPProgramDicomFiles, AreReadIfDeflated)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4 }, 40);
  this->ExpectSuccess("dicom plain.mha");
  for (const auto & file : ListFiles(m_Folder / "dicom"))
  {
    gdcm::Reader reader;
    gdcm::Writer writer;
    reader.SetFileName(file.c_str());
    ASSERT_TRUE(reader.Read());
    reader.GetFile().GetHeader().SetDataSetTransferSyntax(gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian);
    writer.SetFile(reader.GetFile());
    writer.SetFileName(file.c_str());
    ASSERT_TRUE(writer.Write());
  }
  this->ExpectSuccess("dicom out.mha");
  EXPECT_TRUE(ReadText(m_Folder / "out.mha") == ReadText(m_Folder / "plain.mha"));
  const std::string name = "dicom/a1.dcm";
  const std::size_t size = ReadText(m_Folder / name).size();
  this->WithChangedFile(
    name,
    [](std::string bytes) {
      constexpr std::size_t footerSize = 8;
      bytes[bytes.size() - footerSize] = '\x1f';
      return bytes;
    },
    [&] { this->ExpectSuccess("dicom out.mha"); });
  for (const std::size_t kept : { size - 20, size - 100, size / 2 })
  {
    this->ExpectCutFileRefused("dicom", name, kept);
    this->ExpectCutFileRefused(name, name, kept);
  }
}
} // namespace
