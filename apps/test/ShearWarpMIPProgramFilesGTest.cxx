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
#include "Guard.h"
#include "Output.h"
#include "ShearWarpMIPProgramTestHelper.h"

#include <pthread.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace
{
using namespace ShearWarpMIPProgramTest;

class ShearWarpMIPProgramFiles : public ShearWarpMIPProgram
{
protected:
  void
  WriteText(const std::string & name, const std::string & text) const
  {
    std::ofstream(m_Folder / name, std::ios::binary) << text;
  }

  void
  Link(const std::string & target, const std::string & name) const
  {
    fs::create_symlink(target, m_Folder / name);
  }

  fs::perms
  GetMode(const std::string & name) const
  {
    return fs::status(m_Folder / name).permissions();
  }

  /** Writes a program ffmpeg and returns what has it found. */
  std::string
  WriteEncoder(const std::string & script) const
  {
    fs::create_directories(m_Folder / "bin");
    this->WriteText("bin/ffmpeg", "#!/bin/sh\n" + script + '\n');
    fs::permissions(m_Folder / "bin" / "ffmpeg", fs::perms::owner_all);
    return "PATH=\"$PWD/bin:$PATH\"";
  }
};

TEST_F(ShearWarpMIPProgramFiles, NeverWritesWhatItReads)
{
  fs::create_directory(m_Folder / "d");
  this->WriteDICOMSeries("1.2.3.4", "a", { 0, 2, 4 });
  for (const std::string name : { "mask.nrrd", "raw.nhdr", "meta.mhd", "pair.hdr" })
  {
    this->WriteImage(m_Volume, name);
  }
  this->WriteTransforms("view.tfm", { this->MakeTransform(Direction::Left) });
  // headers that name several files of data
  const std::string bytes(24, 'v');
  const std::string nrrd = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 3 2\nencoding: raw\n";
  for (const std::string name : { "s1.dat", "s2.dat", "t1.dat", "t2.dat" })
  {
    this->WriteText(name, bytes.substr(0, 12));
  }
  this->WriteText("list.nhdr", nrrd + "data file: LIST\ns1.dat\n./s2.dat\n");
  this->WriteText("series.nhdr", nrrd + "data file: t%d.dat 1 2 1\n");
  // a header alone: what a call writes is refused before any voxel is read
  this->WriteText("cut.nrrd", nrrd + '\n');
  this->Link("in.nrrd", "link.nrrd");
  fs::create_hard_link(m_Folder / "in.nrrd", m_Folder / "hard.nrrd");
  fs::create_hard_link(m_Folder / "in.nrrd", m_Folder / "many-001.png");
  this->Link("in.nrrd", "turn.gif");
  this->Link("in.nrrd", "page.html");
  this->Link("view.tfm", "view.nrrd");
  this->Link("dicom/a1.dcm", "slice.nrrd");
  this->Link("raw.raw", "raw.mha");
  this->Link("meta.raw", "meta.mha");
  this->Link("pair.img", "pair.mha");
  this->Link("s2.dat", "list.mha");
  this->Link("t2.dat", "series.mha");
  this->ExpectFailures("",
                       { "in.nrrd in.nrrd",
                         "in.nrrd ./d/../in.nrrd",
                         "in.nrrd $PWD/in.nrrd",
                         "in.nrrd link.nrrd",
                         "link.nrrd in.nrrd",
                         "in.nrrd hard.nrrd",
                         "in.nrrd page.html",
                         "in.nrrd turn.gif",
                         "in.nrrd many.png --frames 2",
                         "in.nrrd new.nrrd --depth in.nrrd",
                         "in.nrrd new.nrrd --depth-colour many.png --frames 2",
                         "in.nrrd new.nrrd --mask mask.nrrd --depth d/../mask.nrrd",
                         "in.nrrd view.nrrd --transform view.tfm",
                         "dicom slice.nrrd",
                         "cut.nrrd cut.nrrd",
                         "raw.nhdr raw.mha",
                         "meta.mhd meta.mha",
                         "pair.hdr pair.mha",
                         "list.nhdr list.mha",
                         "series.nhdr series.mha" },
                       "': this call reads it, as '");
  for (const std::string input : { "raw.nhdr", "meta.mhd", "pair.hdr", "list.nhdr", "series.nhdr" })
  {
    this->ExpectSuccess(input + " new.nrrd");
  }
  // a voxel is no name
  this->WriteText("7", "");
  fs::create_hard_link(m_Folder / "7", m_Folder / "seven.nrrd");
  this->WriteText("numbers.nrrd", "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 2 2\nencoding: ascii\n\n5\n6\n7\n8\n");
  this->ExpectSuccess("numbers.nrrd seven.nrrd", "shear-warp-mip: warning: 'numbers.nrrd' has only one slice\n");
  this->ExpectFailure("dicom out.png --dicom-out dicom", "needs an empty folder");
  // a picture in the folder of slices is none
  this->ExpectSuccess("dicom dicom/new.png");
  this->ExpectSuccess("dicom dicom/new.png", "shear-warp-mip: warning: left out: 'dicom/new.png' (not DICOM)\n");
}

TEST_F(ShearWarpMIPProgramFiles, WritesNoFileTwice)
{
  this->Link("y.nrrd", "dangling.nrrd");
  this->WriteText("one.png", "");
  fs::create_hard_link(m_Folder / "one.png", m_Folder / "two.png");
  this->ExpectFailures("in.nrrd ",
                       { "y.nrrd --depth y.nrrd",
                         "y.nrrd --depth ./y.nrrd",
                         "y.nrrd --depth dangling.nrrd",
                         "dangling.nrrd --depth $PWD/y.nrrd",
                         "one.png --depth-colour two.png",
                         "y.nrrd --dicom-out y.nrrd/" },
                       "would be written twice");
  this->ExpectSuccess("in.nrrd y.png --depth y.nrrd --depth-colour z.png --dicom-out y");
}

TEST_F(ShearWarpMIPProgramFiles, WritesThroughLinks)
{
  fs::create_directory(m_Folder / "d");
  this->WriteText("d/there.nrrd", "");
  this->Link("d/there.nrrd", "first.nrrd");
  this->Link("first.nrrd", "second.nrrd");
  this->Link("d/new", "new.nrrd");
  this->Link("d", "series");
  this->Link("d/new-series", "new-series");
  this->ExpectSuccess("in.nrrd expected.nrrd");
  for (const auto & [name, target] : { std::pair("second.nrrd", "d/there.nrrd"), std::pair("new.nrrd", "d/new") })
  {
    this->ExpectSuccess(std::string("in.nrrd ") + name);
    EXPECT_TRUE(fs::is_symlink(m_Folder / name));
    EXPECT_EQ(ReadText(m_Folder / target), ReadText(m_Folder / "expected.nrrd"));
  }
  EXPECT_TRUE(fs::is_symlink(m_Folder / "first.nrrd"));
  this->ExpectFailure("in.nrrd out.png --dicom-out series", "needs an empty folder");
  this->ExpectSuccess("in.nrrd expected.nrrd --dicom-out new-series");
  EXPECT_TRUE(fs::is_symlink(m_Folder / "new-series"));
  EXPECT_TRUE(fs::exists(m_Folder / "d" / "new-series" / "frame-001.dcm"));

  this->Link("round.nrrd", "round.nrrd");
  EXPECT_NE(this->Run("in.nrrd round.nrrd").messages.find("'round.nrrd': Too many levels of symbolic links"),
            std::string::npos);
}

TEST_F(ShearWarpMIPProgramFiles, KeepsModes)
{
  for (const auto mode : { S_IRUSR | S_IWUSR, S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP | S_IROTH })
  {
    for (const std::string name : { "out.nrrd", "depth.mha", "out-001.png" })
    {
      this->WriteText(name, "");
      ASSERT_EQ(chmod(this->GetPath(name).c_str(), mode), 0);
    }
    this->ExpectSuccess("in.nrrd out.nrrd --depth depth.mha --depth-colour out.png --frames 2");
    for (const std::string name : { "out.nrrd", "depth.mha", "out-001.png" })
    {
      EXPECT_EQ(this->GetMode(name), fs::perms(mode)) << name;
      EXPECT_GT(fs::file_size(m_Folder / name), 0u);
    }
  }
  for (const std::string name : { "new.nrrd", "new.nii.gz", "new.png", "new.html" })
  {
    EXPECT_EQ(this->Run("in.nrrd " + name, "umask 027 &&").status, 0);
    EXPECT_EQ(this->GetMode(name), fs::perms(S_IRUSR | S_IWUSR | S_IRGRP)) << name;
  }
}

TEST_F(ShearWarpMIPProgramFiles, IsAsSecretAsTheFileWhileItWrites)
{
  this->WriteText("out.gif", "");
  fs::permissions(m_Folder / "out.gif", fs::perms::owner_read | fs::perms::owner_write);
  const std::string encoder = this->WriteEncoder("stat -c %a .shear-warp-mip-* >> modes.txt");
  EXPECT_EQ(this->Run("in.nrrd out.gif", encoder).status, 0);
  // the pictures and the animation, when it is made and when it is checked
  EXPECT_EQ(ReadText(m_Folder / "modes.txt"), "600\n600\n600\n600\n");
}

TEST_F(ShearWarpMIPProgramFiles, RefusesWhatIsNoFileToWrite)
{
  ASSERT_EQ(mkfifo(this->GetPath("pipe.png").c_str(), S_IRUSR | S_IWUSR), 0);
  this->Link("/dev/null", "null.nrrd");
  this->ExpectFailure("in.nrrd pipe.png", "'pipe.png' is a device or a pipe");
  this->ExpectFailure("in.nrrd null.nrrd", "'null.nrrd' is a device or a pipe");
  this->ExpectFailure("in.nrrd /dev/full", "'/dev/full' is a device or a pipe");
  EXPECT_EQ(this->Run("in.nrrd /dev/stdout 2>&1 | grep -q 'is a device or a pipe'; :").status, 0);

  const auto start = FindUnprivilegedStart();
  if (!start)
  {
    GTEST_SKIP() << "root writes everywhere";
  }
  for (const std::string name : { "kept.nrrd", "kept-001.png" })
  {
    this->WriteText(name, "kept");
    fs::permissions(m_Folder / name, fs::perms::owner_read);
  }
  this->ExpectFailure("in.nrrd kept.nrrd", "'kept.nrrd': it is write-protected", *start);
  this->ExpectFailure("in.nrrd kept.png --frames 2", "'kept-001.png': it is write-protected", *start);
}

TEST_F(ShearWarpMIPProgramFiles, TakesLongNames)
{
  for (const std::string extension : { ".nrrd", ".nii.gz", ".png", ".html" })
  {
    const std::string name = std::string(255 - extension.size(), 'n') + extension;
    this->ExpectSuccess("in.nrrd " + name);
    EXPECT_TRUE(fs::exists(m_Folder / name));
    this->ExpectFailure("in.nrrd n" + name, "File name too long");
  }
}

TEST_F(ShearWarpMIPProgramFiles, NumbersSortAsFrames)
{
  this->ExpectSuccess("in.nrrd cine.png --frames 1001 --size 2 2 --output-spacing 9");
  EXPECT_TRUE(fs::exists(m_Folder / "cine-0000.png"));
  EXPECT_TRUE(fs::exists(m_Folder / "cine-1000.png"));
  EXPECT_EQ(this->GetContents().size(), 1002u);
}

TEST_F(ShearWarpMIPProgramFiles, CommitsAllOrNone)
{
  this->WriteText("former.html", "kept");
  const auto before = this->GetContents();
  {
    OutputFiles files;
    std::ofstream(files.BeginFolder(m_Folder / "series") / "frame") << "new";
    for (const std::string name : { "former.html", "new.html", "blocked.html" })
    {
      files.WriteText(m_Folder / name, { "new" });
    }
    fs::create_directory(m_Folder / "blocked.html");
    EXPECT_THROW(files.Commit(), std::runtime_error);
  }
  fs::remove(m_Folder / "blocked.html");
  EXPECT_TRUE(this->GetContents() == before);

  for (const bool isThere : { false, true })
  {
    const fs::path series = m_Folder / "another";
    if (isThere)
    {
      fs::create_directory(series);
    }
    {
      OutputFiles files;
      std::ofstream(files.BeginFolder(series) / "frame") << "new";
      fs::create_directory(series);
      this->WriteText("another/frame", "another's");
      EXPECT_THROW(files.Commit(), std::runtime_error);
    }
    EXPECT_EQ(ReadText(m_Folder / "another/frame"), "another's");
    fs::remove_all(series);
  }

  fs::create_directory(m_Folder / "out-002.png");
  this->ExpectFailure("in.nrrd out.png --frames 3 --dicom-out series", "out-002.png' is a folder");
}

TEST_F(ShearWarpMIPProgramFiles, LeavesNothingWhenInterrupted)
{
  const std::string encoder = this->WriteEncoder("touch \"${0%/*}/runs\"; exec sleep 20");
  const auto        before = this->GetContents();
  // when the signal comes, for each call
  const std::map<std::string, std::string> begins = {
    { "out.png --frames 400 --size 200 200", "[ -e .shear-warp-mip-*-9.png ]" },
    { "out.gif --frames 3", "[ -e bin/runs ]" },
  };
  for (const auto & [arguments, begun] : begins)
  {
    for (const auto & [name, signal] : { std::pair("TERM", SIGTERM),
                                         std::pair("HUP", SIGHUP),
                                         std::pair("PIPE", SIGPIPE),
                                         std::pair("INT", SIGINT),
                                         std::pair("QUIT", SIGQUIT) })
    {
      // the shell has programs in the background ignore SIGINT and SIGQUIT
      const std::string command = "cd '" + m_Folder.string() + "' || exit\n" + encoder +
                                  " env --default-signal=INT,QUIT '" + GetProgram() + "' in.nrrd " + arguments +
                                  " 2>/dev/null &\nuntil " + begun +
                                  " || ! kill -0 $!; do sleep 0.001; done\n"
                                  "kill -" +
                                  name + " $!; wait $!";
      const int status = std::system(command.c_str());
      EXPECT_EQ(WEXITSTATUS(status), 128 + signal) << arguments;
      fs::remove(m_Folder / "bin" / "runs");
      EXPECT_TRUE(this->GetContents() == before) << arguments << ' ' << name;
    }
  }
}

TEST_F(ShearWarpMIPProgramFiles, SaysThatAFileWouldBeLargerThanIsAllowed)
{
  this->ExpectFailure("in.nrrd x.nrrd --size 200 200", "cannot write all of 'x.nrrd'", "ulimit -f 10;");
}

TEST_F(ShearWarpMIPProgramFiles, EndsAtASignalThatComesWhenItsProcessBegins)
{
  const pid_t process = fork();
  if (process == 0)
  {
    pthread_atfork(nullptr, nullptr, [] { std::raise(SIGTERM); });
    std::_Exit(RunGuarded([] { return EXIT_SUCCESS; }, [](const std::string &) {}));
  }
  int status = 0;
  ASSERT_EQ(waitpid(process, &status, 0), process);
  EXPECT_TRUE(WIFSIGNALED(status)) << status;
  EXPECT_EQ(WTERMSIG(status), SIGTERM);
}

TEST_F(ShearWarpMIPProgramFiles, LeavesNothingWhenKilled)
{
#ifdef __linux__
  const auto before = this->GetContents();
  // the process that is started, and the one that it started
  for (const auto & [killed, said] :
       { std::pair("$!", ""),
         std::pair("$(cat /proc/$!/task/$!/children)",
                   "shear-warp-mip: the program was killed; is there too little memory?\n") })
  {
    const std::string command = "cd '" + m_Folder.string() + "' || exit\n'" + GetProgram() +
                                "' in.nrrd out.png --frames 400 --size 200 200 --no-labels 2>said.txt &\n"
                                "until [ -e .shear-warp-mip-*-9.png ] || ! kill -0 $!; do sleep 0.001; done\n"
                                "kill -KILL " +
                                killed +
                                "; wait $!; for n in $(seq 200); do\n"
                                "ls -A | grep -q shear-warp-mip- || exit 0; sleep 0.05; done; exit 1";
    EXPECT_EQ(std::system(command.c_str()), 0);
    EXPECT_EQ(ReadText(m_Folder / "said.txt"), said);
    fs::remove(m_Folder / "said.txt");
    EXPECT_TRUE(this->GetContents() == before) << killed;
  }
#endif
}

TEST_F(ShearWarpMIPProgramFiles, RemovesOnlyItsOwnWhenKilled)
{
#ifdef __linux__
  fs::create_directory(m_Folder / "one\nfolder");
  this->WriteText("one", "another's");
  this->WriteText("one-more", "another's");
  const auto before = this->GetContents();
  // a name may be the end of another one
  const std::string command = "cd '" + m_Folder.string() + "' || exit\n'" + GetProgram() +
                              "' in.nrrd 'one\nfolder/out.nrrd' --depth depth.nrrd --frames 400 --size 200 200 &\n"
                              "until [ -e .shear-warp-mip-*.nrrd ] || ! kill -0 $!; do sleep 0.001; done\n"
                              "kill -KILL $(cat /proc/$!/task/$!/children); ! wait $!";
  EXPECT_EQ(std::system(command.c_str()), 0);
  EXPECT_TRUE(this->GetContents() == before);
#endif
}
} // namespace
