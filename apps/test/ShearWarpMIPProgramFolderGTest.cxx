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

#include <gdcmReader.h>
#include <gdcmWriter.h>

using namespace ShearWarpMIPProgramTest;

namespace
{

class ShearWarpMIPProgramFolder : public ShearWarpMIPProgram
{
protected:
  void
  WriteSeries(const std::string & uid, const std::string & prefix, std::size_t slices, const Tags & tags = {}) const
  {
    std::vector<double> positions;
    positions.reserve(slices);
    for (std::size_t slice = 0; slice < slices; ++slice)
    {
      positions.push_back(2.0 * static_cast<double>(slice));
    }
    this->WriteDICOMSeries(uid, prefix, positions, 8, false, tags);
  }

  /** Rewrites a file without \a removed attributes, with explicit VRs. */
  void
  Rewrite(const std::string & name, const std::string & sopClass, const std::vector<gdcm::Tag> & removed) const
  {
    gdcm::Reader reader;
    gdcm::Writer writer;
    reader.SetFileName(this->GetPath(name).c_str());
    ASSERT_TRUE(reader.Read());
    gdcm::DataSet & dataSet = reader.GetFile().GetDataSet();
    for (const gdcm::Tag & tag : removed)
    {
      ASSERT_EQ(dataSet.Remove(tag), 1u);
    }
    gdcm::DataElement element(gdcm::Tag(0x0008, 0x0016), 0, gdcm::VR::UI);
    element.SetByteValue(sopClass.data(), static_cast<std::uint32_t>(sopClass.size()));
    dataSet.Replace(element);
    reader.GetFile().GetHeader().Clear();
    reader.GetFile().GetHeader().SetDataSetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
    writer.SetFile(reader.GetFile());
    writer.SetFileName(this->GetPath(name).c_str());
    ASSERT_TRUE(writer.Write());
  }
};

TEST_F(ShearWarpMIPProgramFolder, IsSearchedWithItsFolders)
{
  this->WriteSeries("1.2.3.4", "a", 6);
  this->ExpectSuccess("dicom plain.nrrd");
  this->Move("dicom/a1.dcm", "dicom/one/a1.dcm");
  this->Move("dicom/a2.dcm", "dicom/one/two/three/a2.dcm");
  this->Move("dicom/a4.dcm", "elsewhere/a4.dcm");
  this->Move("dicom/a5.dcm", "elsewhere/deeper/a5.dcm");
  fs::create_directory_symlink("../elsewhere", m_Folder / "dicom/link");
  fs::create_directory_symlink("../elsewhere", m_Folder / "dicom/second");
  fs::create_directory_symlink("..", m_Folder / "dicom/one/loop");
  fs::create_directory(m_Folder / "dicom/empty");
  fs::create_directory(m_Folder / "dicom/.hidden");
  std::ofstream(m_Folder / "dicom/.hidden/a9.dcm") << '\0';
  // no slices are beside it
  fs::create_directory(m_Folder / "dicom/viewer");
  std::ofstream(m_Folder / "dicom/viewer/readme") << "text";
  std::ofstream(m_Folder / "dicom/DICOMDIR") << "text";
  for (const std::string input : { "dicom", "dicom/", "dicom/DICOMDIR" })
  {
    this->ExpectSuccess(input + " out.nrrd");
    EXPECT_EQ(ReadText(m_Folder / "out.nrrd"), ReadText(m_Folder / "plain.nrrd"));
  }
  fs::rename(m_Folder / "dicom/DICOMDIR", m_Folder / "dicom/dicomdir");
  EXPECT_EQ(this->Run("dicomdir ../out.nrrd", "cd dicom &&").status, 0);
  fs::remove(m_Folder / "dicom/stdout.txt");
  fs::remove(m_Folder / "dicom/stderr.txt");
  this->ExpectSuccess("dicom/dicomdir out.nrrd --series 1");

  std::ofstream(m_Folder / "dicom/viewer/a.exe") << '\0';
  std::ofstream(m_Folder / "dicom/viewer/b") << '\0';
  fs::copy_file(m_Folder / "dicom/a0.dcm", m_Folder / "dicom/one/copy.dcm");
  this->ExpectSuccess("dicom out.nrrd",
                      "shear-warp-mip: warning: left out: 'dicom/viewer/a.exe' and 1 more (not DICOM)\n"
                      "shear-warp-mip: warning: left out: 'dicom/one/copy.dcm' (the same as another file)\n");
  EXPECT_EQ(ReadText(m_Folder / "out.nrrd"), ReadText(m_Folder / "plain.nrrd"));
}

TEST_F(ShearWarpMIPProgramFolder, ListsItsSeries)
{
  this->WriteSeries(
    "1.2.3.7", "a", 3, { { "0008|103e", "Head  MRA" }, { "0020|0011", "10" }, { "0008|0021", "20240131" } });
  this->WriteSeries(
    "1.2.3.6", "b", 2, { { "0008|103e", "Head DWI" }, { "0020|0011", "9" }, { "0008|0021", "20240131" } });
  this->WriteSeries("1.2.3.5", "c", 1, { { "0020|0011", "1" }, { "0008|0021", "20240201" } });
  this->WriteSeries("1.2.3.8",
                    "d",
                    4,
                    { { "0008|0005", "ISO_IR 100" },
                      { "0008|103e",
                        "Sch\xe4"
                        "del\x9b" },
                      { "0008|0021", "20230101" } });
  const std::string head = "2: Head DWI, MR, 2024-01-31, 2 images; 3: Head MRA, MR, 2024-01-31, 3 images";
  const std::string all = "1: Sch\xc3\xa4"
                          "del?, MR, 2023-01-01, 4 images; " +
                          head + "; 4: MR, 2024-02-01, 1 image\n";
  this->ExpectFailure("dicom out.png",
                      "shear-warp-mip: 'dicom' has several DICOM series, choose one by --series NUMBER: " + all);
  for (const std::string option : { "--mask", "--segments" })
  {
    this->ExpectFailure(
      "dicom out.png --series 2 " + option + " dicom",
      "shear-warp-mip: 'dicom' has several DICOM series, put the one to use into a folder of its own: " + all);
  }
  this->ExpectFailures("dicom out.png --series ",
                       { "0", "5", "2.0", "-1", "1.2.3", "spine", "'head  dwi'" },
                       " is not in 'dicom', which has " + all);
  this->ExpectFailure("dicom out.png --series hEAd",
                      "--series hEAd fits several, choose one by its number: " + head + '\n');
  for (const std::string right : { "2", "1.2.3.6", "dwi", "'head dwi'", "DW" })
  {
    this->ExpectSuccess("dicom out.nrrd --output-spacing 1 --series " + right);
    EXPECT_EQ(this->Read("out.nrrd")->GetBufferedRegion().GetSize(1), 4u);
  }
  this->ExpectSuccess("dicom out.nrrd --output-spacing 1 --series Sch\xc3\xa4"
                      "d");
  EXPECT_EQ(this->Read("out.nrrd")->GetBufferedRegion().GetSize(1), 8u);
}

TEST_F(ShearWarpMIPProgramFolder, HasDescriptionsInAnyCharacterSet)
{
  this->WriteSeries("1.2.3.5", "b", 1);
  // most are of PS3.5 H to K; the file's bytes, and in UTF-8
  const std::vector<std::array<std::string, 3>> texts = {
    { "ISO_IR 100",
      "Sch\xe4"
      "del",
      "Sch\u00e4del" },
    { "ISO_IR 101",
      "Wa\xb3\xea"
      "sa",
      "Wa\u0142\u0119sa" },
    { "ISO_IR 109", "\xa6", "\u0124" },
    { "ISO_IR 110", "\xbd", "\u014a" },
    { "ISO_IR 126", "\xc4\xe9\xef", "\u0394\u03b9\u03bf" },
    { "ISO_IR 127", "\xe2\xc8\xc7", "\u0642\u0628\u0627" },
    { "ISO_IR 138", "\xf9\xf8\xe5\xef", "\u05e9\u05e8\u05d5\u05df" },
    { "ISO_IR 144", "\xbb\xee\xda", "\u041b\u044e\u043a" },
    { "ISO_IR 148", "\xdd", "\u0130" },
    { "ISO_IR 166", "\xca\xc1\xcb", "\u0e2a\u0e21\u0e2b" },
    { "ISO_IR 203", "5 \xa4", "5 \u20ac" },
    { "ISO_IR 13", "\xd4\xcf\xc0\xde", "\uff94\uff8f\uff80\uff9e" },
    { "ISO_IR 192", "\u738b", "\u738b" },
    { "GB18030", "\xcd\xf5 \x81\x30\x84\x36", "\u738b \u00a5" },
    { "GBK", "\xcd\xf5", "\u738b" },
    { "\\ISO 2022 IR 87", "Yamada \x1b$B;3ED\x1b(B \x1b$BB@O:\x1b(B.", "Yamada \u5c71\u7530 \u592a\u90ce." },
    { "ISO 2022 IR 13\\ISO 2022 IR 87", "\xd4\xcf\x1b$B;3ED\x1b(J \xd4", "\uff94\uff8f\u5c71\u7530 \uff94" },
    { "\\ISO 2022 IR 87\\ISO 2022 IR 159", "\x1b$(D0!\x1b(B.", "\u4e02." },
    { "\\ISO 2022 IR 149", "Hong \x1b$)C\xfb\xf3 \xd1\xce\xd4\xd7", "Hong \u6d2a \u5409\u6d1e" },
    { "\\ISO 2022 IR 58", "Zhang \x1b$)A\xd5\xc5", "Zhang \u5f20" },
    { "ISO 2022 IR 100\\ISO 2022 IR 144", "\xe4 \x1b-L\xbb \x1b-A\xe4", "\u00e4 \u041b \u00e4" },
    // what is no character
    { "",
      "a\xe4"
      "b",
      "a?b" },
    { "ISO_IR 100",
      "a\x9b"
      "b\x1b"
      "c\x7f",
      "a?b?c?" },
    { "ISO_IR 192",
      "a\xe4"
      "b\xc2\x85",
      "a?b?" },
    { "\\ISO 2022 IR 87", "a\x1b$B;3\xe4\x1b(Bb", "a\u5c71?b" },
    { "ISO_IR 999",
      "a\xe4"
      "b",
      "a?b" },
  };
  for (const auto & [characterSet, text, expected] : texts)
  {
    SCOPED_TRACE(characterSet);
    Tags tags = { { "0008|103e", text }, { "0008|0021", "20230101" } };
    if (!characterSet.empty())
    {
      tags["0008|0005"] = characterSet;
    }
    this->WriteSeries("1.2.3.4", "a", 2, tags);
    this->ExpectFailure("dicom out.png", "NUMBER: 1: " + expected + ", MR, 2023-01-01, 2 images; 2: MR, ");
  }
  this->WriteSeries("1.2.3.4", "a", 2, { { "0008|103e", "\xc4\xe9\xef" }, { "0008|0005", "ISO_IR 126" } });
  this->ExpectSuccess("dicom out.nrrd --series \u03b4\u0399\u039f");
  this->ExpectFailure("dicom out.png --series \u03b4\u0399\u0399", " is not in 'dicom'");
}

TEST_F(ShearWarpMIPProgramFolder, IsRefused)
{
  fs::create_directories(m_Folder / "empty/inner");
  this->ExpectFailure("empty out.png", "no DICOM series in the folder 'empty'");
  std::ofstream(m_Folder / "empty/inner/notes.txt") << "text";
  this->ExpectFailure("empty out.png", "no DICOM series in the folder 'empty'");

  this->WriteSeries("1.2.3.4", "a", 4);
  this->Move("dicom/a2.dcm", "dicom/inner/a2.dcm");
  for (const std::size_t size : { 0, 100, 300, 700 })
  {
    this->ExpectCutFileRefused("dicom", "dicom/inner/a2.dcm", size);
  }
  this->WithChangedFile(
    "dicom/inner/a2.dcm",
    [](std::string bytes) {
      const std::string syntax = "1.2.840.10008.1.";
      return bytes.replace(bytes.find(syntax) + syntax.size(), 1, "9");
    },
    [this] {
      this->ExpectFailure("dicom out.png",
                          "a2.dcm' has a compression that GDCM does not read, transfer syntax 1.2.840.10008.1.9; ");
    });
  fs::create_symlink("none", m_Folder / "dicom/inner/b");
  this->ExpectFailure("dicom out.png", "'dicom/inner/b' is a link to a file that is not there");
  fs::remove(m_Folder / "dicom/inner/b");
  if (const auto start = FindUnprivilegedStart())
  {
    for (const std::string name : { "dicom/inner/a2.dcm", "dicom/inner" })
    {
      fs::permissions(m_Folder / name, fs::perms::none);
      const Result result = this->Run("dicom out.png", *start);
      fs::permissions(m_Folder / name, fs::perms::owner_all);
      EXPECT_EQ(result.status, 1);
      EXPECT_NE(result.messages.find(name), std::string::npos) << result.messages;
    }
    fs::permissions(m_Folder / "in.nrrd", fs::perms::none);
    EXPECT_EQ(this->Run("in.nrrd out.png", *start).messages,
              "shear-warp-mip: cannot read 'in.nrrd': Permission denied\n");
    fs::permissions(m_Folder / "in.nrrd", fs::perms::owner_all);
  }
  std::ofstream(m_Folder / "dicom/inner/DICOMDIR") << "text";
  this->ExpectFailure("in.nrrd out.png --series 1", "--series is for a DICOM folder, but 'in.nrrd' is a file");
  for (const std::string input : { "dicom", "dicom/.", "dicom/../dicom" })
  {
    this->ExpectFailure(input + " dicom/turn/ --frames 2",
                        "'dicom/turn/': it is in '" + input + "', where images are searched");
    this->ExpectFailure(input + " out.png --dicom-out dicom/inner/turn", "'dicom/inner/turn': it is in '" + input);
    this->ExpectFailure(input + " dicom", "'dicom' is there already; a DICOM series needs an empty folder");
    this->ExpectFailure(input + " dicom/", "'dicom/' is there already; a DICOM series needs an empty folder");
  }
  this->ExpectFailure("in.nrrd dicom/turn/ --overlay dicom", "it is in 'dicom', where images are searched");
  this->ExpectFailure("dicom/DICOMDIR turn/", "'dicom/DICOMDIR' does not exist");
  this->ExpectFailure("dicom/inner/DICOMDIR dicom/inner/turn/", "it is in 'dicom/inner', where images are searched");
  fs::create_symlink("dicom/inner/a2.dcm", m_Folder / "slice.nrrd");
  this->ExpectFailure("dicom slice.nrrd", "'slice.nrrd': this call reads it, as 'dicom/inner/a2.dcm'");
}

TEST_F(ShearWarpMIPProgramFolder, IsReadThoughObjectsOfOtherSeriesCannotBe)
{
  const std::string            mrImage = "1.2.840.10008.5.1.4.1.1.4";
  const std::string            registration = "1.2.840.10008.5.1.4.1.1.66.1";
  const gdcm::Tag              pixels(0x7fe0, 0x0010);
  const std::vector<gdcm::Tag> all = { { 0x0028, 0x0100 }, { 0x0028, 0x0010 }, { 0x0028, 0x0011 }, pixels };
  this->WriteSeries("1.2.3.4", "a", 4);
  this->ExpectSuccess("dicom plain.nrrd");
  const auto expectRead = [this](const std::string & options) {
    this->ExpectSuccess("dicom out.nrrd" + options);
    EXPECT_EQ(ReadText(m_Folder / "out.nrrd"), ReadText(m_Folder / "plain.nrrd"));
  };

  this->WriteSeries("1.2.3.8", "b", 1);
  this->Rewrite("dicom/b0.dcm", registration, all);
  expectRead("");

  this->WriteSeries("1.2.3.8", "b", 1);
  this->Rewrite("dicom/b0.dcm", mrImage, { pixels });
  expectRead(" --series 1.2.3.4");
  const std::string withoutPixels = "'dicom/b0.dcm' is damaged or incomplete, or an image of floats: it has no pixels";
  this->ExpectFailure("dicom out.png --series 1.2.3.8", withoutPixels);
  this->ExpectFailure("dicom/b0.dcm out.png", withoutPixels);
  this->ExpectFailure("dicom out.png", " 1 image\n");

  this->WriteSeries("1.2.3.8", "b", 1);
  this->Rewrite("dicom/b0.dcm", mrImage, {});
  const std::string name = "dicom/b0.dcm";
  const std::size_t size = ReadText(m_Folder / name).size();
  this->WithCutFile(name, size - 1, [&] {
    expectRead(" --series 1.2.3.4");
    this->ExpectFailure("dicom out.png --series 1.2.3.8", "'dicom/b0.dcm' is damaged or incomplete");
  });
  // a compression of 2024, and one that does not exist
  for (const std::string syntax : { "1.2.840.10008.1.2.4.201", "1.2.3.4.5.6" })
  {
    this->WithChangedFile(
      name,
      [&syntax](const std::string & bytes) {
        const std::string plain("1.2.840.10008.1.2.1\0", 20);
        const std::string element("\x02\0\x10\0UI", 6);
        const std::size_t begin = bytes.find(element + std::string("\x14\0", 2) + plain);
        EXPECT_NE(begin, std::string::npos);
        std::string uid = syntax;
        uid.resize(uid.size() + uid.size() % 2, '\0');
        std::string changed = bytes;
        changed.replace(begin, 28, element + std::string({ static_cast<char>(uid.size()), '\0' }) + uid);
        // the length of the group, in a value of 4 bytes
        changed[140] = static_cast<char>(changed[140] + static_cast<char>(uid.size()) - 20);
        return changed;
      },
      [&] {
        expectRead(" --series 1.2.3.4");
        this->ExpectFailure("dicom out.png --series 1.2.3.8",
                            "b0.dcm' has a compression that GDCM does not read, transfer syntax " + syntax + ';');
      });
  }
  // what might be a slice of any series
  this->WithCutFile(name, 300, [&] {
    this->ExpectFailure("dicom out.png --series 1.2.3.4",
                        "'dicom/b0.dcm' is damaged or incomplete: its header cannot be parsed, so it may be a slice");
  });

  // sequences in sequences, which take all of the stack: the messages before are said once
  this->WithChangedFile(
    name,
    [](const std::string & bytes) {
      const std::string sequence("\x40\0\0\1SQ\0\0\xff\xff\xff\xff\xfe\xff\0\xe0\xff\xff\xff\xff", 20);
      std::string       changed = bytes.substr(0, 132 + 12 + static_cast<unsigned char>(bytes[140]));
      for (int n = 0; n < 200000; ++n)
      {
        changed += sequence;
      }
      return changed;
    },
    [&] {
      const Result result = this->Run("dicom out.png --frames 3 --series 1.2.3.4");
      EXPECT_NE(result.messages.find("b0.dcm' is damaged or incomplete: its header cannot be parsed"),
                std::string::npos)
        << result.messages;
    });

  // objects of the series itself
  this->WriteSeries("1.2.3.4", "b", 1);
  this->Rewrite("dicom/b0.dcm", registration, all);
  this->ExpectSuccess("dicom out.nrrd", "shear-warp-mip: warning: left out: 'dicom/b0.dcm' (no image)\n");
  EXPECT_EQ(ReadText(m_Folder / "out.nrrd"), ReadText(m_Folder / "plain.nrrd"));
  this->WriteSeries("1.2.3.4", "b", 1);
  this->Rewrite("dicom/b0.dcm", mrImage, all);
  this->ExpectFailure("dicom out.png", withoutPixels);
}

TEST_F(ShearWarpMIPProgramFolder, OfOutputHasDICOMSeries)
{
  this->WriteSeries("1.2.3.4", "a", 4);
  fs::create_directory(m_Folder / "there");
  this->ExpectSuccess("dicom out.nrrd --frames 3 --dicom-out expected");
  for (const std::string folder : { "new/", "there" })
  {
    this->ExpectSuccess("dicom --frames 3 " + folder + " --depth " + folder[0] + ".nrrd");
    for (const std::string frame : { "frame-001.dcm", "frame-002.dcm", "frame-003.dcm" })
    {
      EXPECT_EQ(this->ReadPixels(folder + '/' + frame), this->ReadPixels("expected/" + frame));
    }
    EXPECT_EQ(std::distance(fs::directory_iterator(m_Folder / folder), fs::directory_iterator()), 3);
    EXPECT_TRUE(fs::exists(m_Folder / (folder.substr(0, 1) + ".nrrd")));
    this->ExpectFailure("dicom " + folder, "is there already; a DICOM series needs an empty folder");
  }
  this->ExpectFailure("dicom new", "is there already");
  this->ExpectFailure("dicom more", "or a / at its end for a DICOM series");
  this->ExpectFailure("dicom none/more/", "cannot write 'none/more/': its folder does not exist");
  this->ExpectFailure("dicom in.nrrd/", "in.nrrd/");
  this->ExpectFailure("dicom more/ --dicom-out other", "--dicom-out is not possible: OUTPUT is a folder");
  this->ExpectFailure("dicom more/ --in-place", "--in-place is not possible: OUTPUT is a folder");
  this->ExpectFailure("dicom ''", "OUTPUT is empty");
}

TEST_F(ShearWarpMIPProgramFolder, OfProjectionsIsRefused)
{
  this->WriteSeries("1.2.3.4", "a", 4);
  const std::string mention = " is a projection, not a part of a volume; give the series that it was made from";
  this->ExpectSuccess("dicom turn/ --frames 3");
  this->ExpectSuccess("dicom slabs/ --sliding-slab 2 2");
  this->ExpectSuccess("in.nrrd captures/ --frames 2 --mode minimum");
  for (const std::string folder : { "turn", "slabs", "captures" })
  {
    this->ExpectFailure(folder + " out.png", "'" + folder + "/frame-001.dcm'" + mention);
    this->ExpectFailure(folder + "/frame-001.dcm out.png", "'" + folder + "/frame-001.dcm'" + mention);
  }
  this->WriteSeries("1.2.3.5", "b", 2, { { "0008|0008", "DERIVED\\SECONDARY\\OTHER\\MAX_IP" } });
  this->WriteSeries("1.2.3.6", "c", 1, { { "0054|1000", "WHOLE BODY\\REPROJECTION" } });
  this->WriteSeries("1.2.3.7", "d", 1, { { "0008|0008", "DERIVED\\SECONDARY\\PROJECTION IMAGE" } });
  this->ExpectFailure("dicom out.png", "2 projections; 3: MR, ");
  this->ExpectFailure("dicom out.png --series 1.2.3.7", "'dicom/d0.dcm'" + mention);
  this->ExpectFailure("dicom out.png --series 1.2.3.5", "'dicom/b0.dcm'" + mention);
  this->ExpectFailure("dicom out.png --series 1.2.3.6", "'dicom/c0.dcm'" + mention);
  this->ExpectSuccess("dicom out.png --series 1");
}

TEST_F(ShearWarpMIPProgramFolder, LosesItsLocalizers)
{
  const Tags localizer = { { "0008|0008", "ORIGINAL\\PRIMARY\\LOCALIZER" } };
  this->WriteSeries("1.2.3.4", "a", 4);
  this->ExpectSuccess("dicom plain.nrrd");
  this->WriteDICOMSeries("1.2.3.4", "b", { 8 }, 9, true, localizer);
  this->ExpectWarning("dicom out.nrrd", "left out: 'dicom/b0.dcm' (localizer)");
  this->WriteDICOMSeries("1.2.3.4", "b", { 8, 9 }, 9, true, localizer);
  this->ExpectWarning("dicom out.nrrd", "left out: 'dicom/b0.dcm' and 1 more (localizer)");
  EXPECT_EQ(ReadText(m_Folder / "out.nrrd"), ReadText(m_Folder / "plain.nrrd"));
  // by itself it is what is asked for
  fs::remove_all(m_Folder / "dicom");
  this->WriteDICOMSeries("1.2.3.4", "b", { 8, 10 }, 9, false, localizer);
  this->ExpectSuccess("dicom out.nrrd");
}
} // namespace
