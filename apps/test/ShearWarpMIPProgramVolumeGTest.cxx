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

// A volume that --write-volume writes is the one that was read.

namespace
{
using namespace ShearWarpMIPProgramTest;
using TimesType = itk::Image<PixelType, 4>;

class ShearWarpMIPProgramVolume : public ShearWarpMIPProgram
{
protected:
  void
  SetUp() override
  {
    ShearWarpMIPProgram::SetUp();
    const auto rotation = itk::AffineTransform<double, 3>::New();
    rotation->Rotate3D(MakeVector(1, 2, 3), 0.4);
    m_Volume->SetDirection(rotation->GetMatrix());
    this->WriteImage(m_Volume, "in.nrrd");
  }

  void
  ExpectVolume(const std::string & name, const VolumeType * expected) const
  {
    SCOPED_TRACE(name);
    const auto volume = this->Read<VolumeType>(name);
    EXPECT_EQ(GetPixels(volume), GetPixels(expected));
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      // NIfTI has floats
      EXPECT_NEAR(volume->GetSpacing()[axis], expected->GetSpacing()[axis], 1e-6);
      EXPECT_NEAR(volume->GetOrigin()[axis], expected->GetOrigin()[axis], 1e-5);
      for (unsigned int row = 0; row < 3; ++row)
      {
        EXPECT_NEAR(volume->GetDirection()(row, axis), expected->GetDirection()(row, axis), 1e-6);
      }
    }
  }

  /** That pictures of both volumes have the same bytes and notes. */
  void
  ExpectSamePictures(const std::string & one, const std::string & other, const std::string & options = "") const
  {
    const auto project = [&](const std::string & name) {
      Result     result = this->Run(name + " same.png --size 64 64 " + options);
      const auto at = result.messages.find('\'' + name + '\'');
      return at == std::string::npos ? result.messages : result.messages.replace(at, name.size() + 2, "INPUT");
    };
    const std::string messages = project(one);
    const std::string picture = ReadText(m_Folder / "same.png");
    EXPECT_EQ(project(other), messages);
    EXPECT_TRUE(ReadText(m_Folder / "same.png") == picture);
  }

  /** Whether the header of an NRRD file has this line. */
  bool
  HasLine(const std::string & name, const std::string & line) const
  {
    const std::string text = ReadText(m_Folder / name);
    return text.substr(0, text.find("\n\n") + 1).find('\n' + line + '\n') != std::string::npos;
  }
};
} // namespace

TEST_F(ShearWarpMIPProgramVolume, IsTheSameInEachFormat)
{
  this->WriteImage(m_Volume, "in.mha", true);
  this->WriteImage(m_Volume, "in.nii.gz");
  for (const std::string input : { "in.nrrd", "in.mha", "in.nii.gz" })
  {
    for (const std::string output : { "out.nrrd", "out.mha", "other.nii.gz", "out.nii" })
    {
      this->ExpectSuccess(input + " --write-volume " + output);
      this->ExpectVolume(output, m_Volume);
    }
  }
  this->ExpectSuccess("--write-volume=out.nrrd in.nrrd");
  EXPECT_EQ(ReadText(m_Folder / "out.nrrd"), ReadText(m_Folder / "in.nrrd"));
  this->ExpectSamePictures("in.nrrd", "out.nrrd", "--azimuth 30");
}

TEST_F(ShearWarpMIPProgramVolume, IsStandardOutput)
{
  this->ExpectSuccess("in.nrrd --write-volume out.nrrd");
  EXPECT_TRUE(this->Run("in.nrrd --write-volume=-").output == ReadText(m_Folder / "out.nrrd"));
  const std::string call = "cd '" + m_Folder.string() + "' && '" + GetProgram() + "' in.nrrd --write-volume - ";
  EXPECT_EQ(std::system((call + "| cmp - out.nrrd").c_str()), 0);
  EXPECT_NE(std::system((call + "2>/dev/null 1<>in.nrrd").c_str()), 0);
  this->ExpectSamePictures("in.nrrd", "out.nrrd");
#ifdef __linux__
  EXPECT_NE(std::system((call + "2>/dev/null >/dev/full").c_str()), 0);
  EXPECT_NE(std::system((call + "2>/dev/null >&-").c_str()), 0);
  std::ofstream(m_Folder / "more") << "more";
  EXPECT_NE(std::system((call + "2>/dev/null >>more").c_str()), 0);
  EXPECT_EQ(ReadText(m_Folder / "more"), "more");
  EXPECT_EQ(std::system(("{ " + call + "&& printf end; } >'" + (m_Folder / "more").string() + '\'').c_str()), 0);
  EXPECT_TRUE(ReadText(m_Folder / "more") == ReadText(m_Folder / "out.nrrd") + "end");
#endif
}

TEST_F(ShearWarpMIPProgramVolume, KeepsItsTypeAndComponents)
{
  const auto doubles = MakeVolume<double>(-0.5);
  this->WriteImage(doubles, "in.mha");
  this->ExpectSuccess("in.mha --write-volume out.nrrd");
  EXPECT_EQ((this->ReadPixels<itk::Image<double, 3>>("out.nrrd")), GetPixels(doubles));

  const auto vectors = MakeImageLike<itk::VectorImage<float, 3>>(m_Volume, 2);
  for (std::size_t n = 0; n < vectors->GetPixelContainer()->Size(); ++n)
  {
    vectors->GetBufferPointer()[n] = 0.25F * static_cast<float>(n);
  }
  this->WriteImage(vectors, "in.mha");
  for (const std::string output : { "out.nrrd", "out.mha", "out.nii" })
  {
    this->ExpectSuccess("in.mha --write-volume " + output);
    const auto read = this->Read<itk::VectorImage<float, 3>>(output);
    ASSERT_EQ(read->GetNumberOfComponentsPerPixel(), 2u);
    const float * const begin = vectors->GetBufferPointer();
    EXPECT_TRUE(std::equal(begin, begin + vectors->GetPixelContainer()->Size(), read->GetBufferPointer()));
  }
}

TEST_F(ShearWarpMIPProgramVolume, HasItsPointsInTimeAlongTheFourthAxis)
{
  const auto times = MakeTimes({ m_Volume, MakeVolume<PixelType>(40), MakeVolume<PixelType>(7) });
  this->WriteImage(times, "in.mha");
  for (const std::string output : { "out.nrrd", "out.mha", "out.nii.gz" })
  {
    this->ExpectSuccess("in.mha --write-volume " + output);
    const auto read = this->Read<TimesType>(output);
    EXPECT_EQ(read->GetBufferedRegion(), times->GetBufferedRegion());
    EXPECT_EQ(GetPixels(read), GetPixels(times));
    EXPECT_NEAR(read->GetSpacing()[3], 2.5, 1e-6);
    // NIfTI has no first point in time before ITK 5.4
    if (output != "out.nii.gz")
    {
      EXPECT_EQ(read->GetOrigin()[3], 4.0);
    }
    this->ExpectSuccess("in.mha one.nrrd");
    this->ExpectSuccess(output + " other.nrrd");
    EXPECT_EQ(this->ReadPixels<VolumeType>("one.nrrd"), this->ReadPixels<VolumeType>("other.nrrd"));
    this->ExpectSuccess("in.mha one.png --size 64 64", "shear-warp-mip: note: 'one.png' becomes 3 numbered files\n");
    this->ExpectSuccess(output + " other.png --size 64 64",
                        "shear-warp-mip: note: 'other.png' becomes 3 numbered files\n");
    EXPECT_EQ(ReadText(m_Folder / "one-002.png"), ReadText(m_Folder / "other-002.png"));
  }
}

TEST_F(ShearWarpMIPProgramVolume, SaysThatNobodyKnowsThePatientsSides)
{
  this->WriteImage(m_Volume, "none.nrrd");
  this->WithChangedFile(
    "none.nrrd",
    [](std::string bytes) { return bytes.replace(bytes.find("left-posterior-superior"), 23, "3D-right-handed"); },
    [this] {
      for (const std::string output : { "out.nrrd", "out.mha" })
      {
        this->ExpectSuccess("none.nrrd --write-volume " + output);
        this->ExpectVolume(output, m_Volume);
        this->ExpectSamePictures("none.nrrd", output);
        const auto messages = this->Run(output + " same.png --size 64 64").messages;
        EXPECT_NE(messages.find("does not say how it lies in the patient"), std::string::npos);
      }
      EXPECT_TRUE(this->HasLine("out.nrrd", "HasOrientation:=0"));
      this->ExpectWarning("none.nrrd --write-volume out.nii", "cannot say that nobody knows the patient's sides");
    });
  this->ExpectSuccess("in.nrrd --write-volume out.nrrd");
  EXPECT_FALSE(this->HasLine("out.nrrd", "HasOrientation:=0"));
}

TEST_F(ShearWarpMIPProgramVolume, OfDicomHasItsInversionAndAttributesIfAsked)
{
  this->WriteDICOMSeries("1.2.3.4", "a", { 0.0, 2.0, 4.0 }, 8, false, { { "0010|0010", "Roe^Jane" } });
  for (const fs::path & file : ListFiles(m_Folder / "dicom"))
  {
    std::string bytes = ReadText(file);
    std::ofstream(file, std::ios::binary) << bytes.replace(bytes.find("MONOCHROME2"), 11, "MONOCHROME1");
  }
  for (const std::string output : { "out.nrrd", "out.mha" })
  {
    this->ExpectSuccess("dicom --write-volume " + output);
    EXPECT_EQ(GetPixels(this->Read<VolumeType>(output))[128], 102);
    EXPECT_EQ(ReadText(m_Folder / output).find("Roe"), std::string::npos);
    EXPECT_EQ(ReadText(m_Folder / output).find("SourceFiles"), std::string::npos);
    this->ExpectSamePictures("dicom", output);
  }
  EXPECT_TRUE(this->HasLine("out.nrrd", "IsInverted:=1"));
  this->ExpectWarning("dicom --write-volume out.nii", "cannot say that low values are to be shown white");

  this->ExpectWarning("dicom out.png --window lung", "--window lung is in HU, but INPUT is MR, not CT");

  this->ExpectSuccess("dicom --write-volume out.nrrd --with-attributes");
  EXPECT_TRUE(this->HasLine("out.nrrd", "0010|0010:=Roe^Jane"));
  EXPECT_TRUE(this->HasLine("out.nrrd", "0008|0060:=MR"));
  const std::string folder = fs::canonical(m_Folder).string() + "/dicom/";
  EXPECT_TRUE(this->HasLine("out.nrrd", "SourceFiles:=" + folder + "a0.dcm " + folder + "a1.dcm " + folder + "a2.dcm"));
  this->ExpectSuccess("out.nrrd --write-volume other.nrrd");
  EXPECT_EQ(ReadText(m_Folder / "other.nrrd").find("Roe"), std::string::npos);
  EXPECT_EQ(GetPixels(this->Read<VolumeType>("other.nrrd")), GetPixels(this->Read<VolumeType>("out.nrrd")));

  this->WriteDICOMSeries("1.2.3.5", "b", { 0.0, 3.0 });
  this->ExpectFailure("dicom --write-volume new.nrrd", "has several DICOM series");
  this->ExpectSuccess("dicom --write-volume out.nrrd --series 1.2.3.5");
  EXPECT_EQ(this->Read<VolumeType>("out.nrrd")->GetSpacing()[2], 3.0);
  this->ExpectFailure("dicom --write-volume new.nrrd --series 1.2.3.5 --suv", "--suv is not possible");
}

TEST_F(ShearWarpMIPProgramVolume, IsInTheUnitThatItsEntrySays)
{
  auto & entries = m_Volume->GetMetaDataDictionary();
  itk::EncapsulateMetaData<std::string>(entries, "Unit", "um");
  for (const std::string input : { "um.nrrd", "um.mha" })
  {
    this->WriteImage(m_Volume, input);
    this->ExpectSuccess(input + " --write-volume out.nrrd");
    const auto read = this->Read<VolumeType>("out.nrrd");
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      EXPECT_NEAR(read->GetSpacing()[axis], 0.001 * m_Volume->GetSpacing()[axis], 1e-12);
      EXPECT_NEAR(read->GetOrigin()[axis], 0.001 * m_Volume->GetOrigin()[axis], 1e-12);
    }
    EXPECT_EQ(ReadText(m_Folder / "out.nrrd").find("Unit"), std::string::npos);
  }
  itk::EncapsulateMetaData<std::string>(entries, "Unit", "pixel");
  this->WriteImage(m_Volume, "pixel.nrrd");
  this->ExpectWarning("pixel.nrrd --write-volume out.nrrd", "has lengths in 'pixel', which are taken for mm");
}

TEST_F(ShearWarpMIPProgramVolume, IsRefusedBesideWhatIsOfProjections)
{
  for (const std::string options : { "out.png",
                                     "-o out.png",
                                     "--view anterior",
                                     "--frames 3",
                                     "--mask in.nrrd",
                                     "--dicom-out new",
                                     "--overlay in.nrrd",
                                     "--exact",
                                     "--write-phantom new.nrrd" })
  {
    this->ExpectFailure("in.nrrd --write-volume new.nrrd " + options,
                        options.find("phantom") != std::string::npos ? "--write-phantom" : "with --write-volume");
  }
  this->ExpectFailure("--write-volume new.nrrd", "INPUT is required");
  this->ExpectFailure("in.nrrd out.png --with-attributes", "--with-attributes requires --write-volume");
  this->ExpectFailure("in.nrrd --write-volume new.mha --with-attributes", "'new.mha' is no .nrrd");
  this->ExpectFailure("in.nrrd --write-volume new.png", "must have one of the extensions .mha .nrrd .nii .nii.gz");
  this->ExpectFailure("in.nrrd --write-volume new.nrrd --series 1", "--series is for a DICOM folder");
  this->ExpectFailure("in.nrrd --write-volume new.nrrd --suv", "--suv is not possible");
}

TEST_F(ShearWarpMIPProgramVolume, IsWrittenAsAWholeOrNotAtAll)
{
  this->ExpectFailure("in.nrrd --write-volume in.nrrd", "cannot write 'in.nrrd': this call reads it");
  fs::create_symlink("in.nrrd", m_Folder / "link.nrrd");
  this->ExpectFailure("in.nrrd --write-volume link.nrrd", "cannot write 'link.nrrd': this call reads it");
  this->ExpectFailure("in.nrrd --write-volume none/new.nrrd", "its folder does not exist or is not writable");
  this->ExpectFailure("none.nrrd --write-volume new.nrrd", "'none.nrrd' does not exist");
  this->WithCutFile("in.nrrd", ReadText(m_Folder / "in.nrrd").size() - 1, [this] {
    this->ExpectFailure("in.nrrd --write-volume new.nrrd", "in.nrrd'");
  });
  // as on a full disk
  const std::string full = "trap '' XFSZ; ulimit -f 4;";
  for (const std::string output : { "new.nrrd", "new.mha", "new.nii" })
  {
    this->ExpectFailure("in.nrrd --write-volume " + output, "'" + output + "'", full);
  }
}
