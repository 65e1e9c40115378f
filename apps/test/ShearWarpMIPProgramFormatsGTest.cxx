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

#include <nifti1.h>

#if __has_include("itk_tiff.h")
#  include "itk_tiff.h"
#else
#  include <tiffio.h>
#endif

#include <cstdint>
#include <cstring>
#include <iomanip>

// Geometry and values of files are what the files say, or the files are refused.

namespace
{
using namespace ShearWarpMIPProgramTest;

class ShearWarpMIPProgramFormats : public ShearWarpMIPProgram
{
protected:
  using MatrixType = VolumeType::DirectionType;

  void
  SetUp() override
  {
    ShearWarpMIPProgram::SetUp();
    const auto rotation = itk::AffineTransform<double, 3>::New();
    rotation->Rotate3D(MakeVector(1, 2, 3), 0.4);
    m_Volume->SetDirection(rotation->GetMatrix());
  }

  /** The picture of \a input is the one of m_Volume, and \a messages are said. */
  void
  ExpectRead(const std::string & input, const std::string & messages = "") const
  {
    this->ExpectSuccess(input + " out.nrrd --azimuth 30", messages);
    this->ExpectPicture("out.nrrd", this->Project(this->MakeTransform(Direction::Anterior, 30.0)));
  }

  /** Columns are the axes of m_Volume in mm per voxel. */
  MatrixType
  GetAxes() const
  {
    MatrixType axes = m_Volume->GetDirection();
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      for (unsigned int row = 0; row < 3; ++row)
      {
        axes(row, axis) *= m_Volume->GetSpacing()[axis];
      }
    }
    return axes;
  }

  void
  SetAxes(const MatrixType & axes) const
  {
    MatrixType             direction;
    itk::Vector<double, 3> spacing(0.0);
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const auto column = MakeVector(axes(0, axis), axes(1, axis), axes(2, axis));
      spacing[axis] = column.GetNorm();
      for (unsigned int row = 0; row < 3; ++row)
      {
        direction(row, axis) = column[row] / spacing[axis];
      }
    }
    m_Volume->SetSpacing(spacing);
    m_Volume->SetDirection(direction);
  }

  std::string
  GetBytes() const
  {
    return { reinterpret_cast<const char *>(m_Volume->GetBufferPointer()),
             sizeof(PixelType) * m_Volume->GetBufferedRegion().GetNumberOfPixels() };
  }

  void
  WriteBytes(const std::string & name, const std::string & bytes) const
  {
    std::ofstream(m_Folder / name, std::ios::binary) << bytes;
  }

  /** What is said of letters in a picture that has room for them. */
  void
  ExpectLetters(const std::string & input, bool hasLetters) const
  {
    const std::string note =
      "shear-warp-mip: note: there are no letters: '" + input + "' does not say how it lies in the patient\n";
    this->ExpectSuccess(input + " letters.png --size 64 64", hasLetters ? "" : note);
  }
};

class ShearWarpMIPProgramNRRD : public ShearWarpMIPProgramFormats
{
protected:
  /** Writes m_Volume into a space whose axes have these \a signs in LPS, with lengths of \a millimetres. */
  void
  WriteNRRD(const std::string &           name,
            const std::string &           space,
            const std::array<double, 3> & signs,
            double                        millimetres = 1.0,
            const std::string &           fields = "") const
  {
    const bool         isTime = space.find("ime") != std::string::npos || space.size() == 4;
    const auto         axes = this->GetAxes();
    std::ostringstream header;
    header << std::setprecision(17)
           << "NRRD0004\ntype: short\nendian: little\nencoding: raw\ndimension: " << (isTime ? 4 : 3)
           << "\nsizes: 20 18 12" << (isTime ? " 1" : "") << "\nspace: " << space << "\nspace directions:";
    const auto writeVector = [&](double x, double y, double z) {
      header << " (" << signs[0] * x / millimetres << ',' << signs[1] * y / millimetres << ','
             << signs[2] * z / millimetres << (isTime ? ",0)" : ")");
    };
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      writeVector(axes(0, axis), axes(1, axis), axes(2, axis));
    }
    header << (isTime ? " (0,0,0,2)" : "") << "\nspace origin:";
    writeVector(m_Volume->GetOrigin()[0], m_Volume->GetOrigin()[1], m_Volume->GetOrigin()[2]);
    header << '\n' << fields << '\n';
    this->WriteBytes(name, header.str() + this->GetBytes());
  }
};

TEST_F(ShearWarpMIPProgramNRRD, LiesWhereEachOfItsSpacesSays)
{
  struct Space
  {
    std::vector<std::string> names;
    std::array<double, 3>    signs;
    bool                     isPatients;
  };
  for (const Space & space : { Space{ { "right-anterior-superior", "RAS" }, { { -1, -1, 1 } }, true },
                               Space{ { "left-anterior-superior", "LAS" }, { { 1, -1, 1 } }, true },
                               Space{ { "left-posterior-superior", "LPS" }, { { 1, 1, 1 } }, true },
                               Space{ { "scanner-xyz", "3D-right-handed" }, { { 1, 1, 1 } }, false } })
  {
    for (const std::string & name : space.names)
    {
      for (const std::string & whole : { name, name + (name.size() == 3 ? "T" : "-time") })
      {
        SCOPED_TRACE(whole);
        this->WriteNRRD("x.nrrd", whole, space.signs);
        this->ExpectRead("x.nrrd");
        this->ExpectLetters("x.nrrd", space.isPatients);
      }
    }
  }
  for (const std::string name : { "3D-left-handed", "3D-left-handed-time" })
  {
    this->WriteNRRD("x.nrrd", name, { { 1, 1, 1 } });
    this->ExpectFailure("x.nrrd out.png", "'x.nrrd' is in the space '" + name + "'");
  }
}

TEST_F(ShearWarpMIPProgramNRRD, HasTheUnitThatItStates)
{
  const std::array<double, 3> signs{ { -1, -1, 1 } };
  this->WriteNRRD("um.nrrd", "RAS", signs, 1e-3, "space units: \"um\" \"um\" \"um\"\n");
  this->ExpectRead("um.nrrd");
  this->WriteNRRD("mm.nrrd", "RAS", signs, 1.0, "space units: \"mm\" \"mm\" \"mm\"\n");
  this->ExpectRead("mm.nrrd");
  this->WriteNRRD("foot.nrrd", "RAS", signs, 1.0, "space units: \"foot\" \"foot\" \"foot\"\n");
  this->ExpectRead("foot.nrrd", "shear-warp-mip: warning: 'foot.nrrd' has lengths in 'foot', which are taken for mm\n");
  this->WriteNRRD("odd.nrrd", "RAS", signs, 1.0, "Unit:=a\\nfoot that is longer than that\n");
  this->ExpectRead(
    "odd.nrrd", "shear-warp-mip: warning: 'odd.nrrd' has lengths in 'a foot that is longe', which are taken for mm\n");

  m_Volume->SetDirection(itk::Matrix<double, 3, 3>::GetIdentity());
  m_Volume->SetOrigin(itk::Point<double, 3>(0.0));
  this->WriteBytes("axes.nrrd",
                   "NRRD0004\ntype: short\nendian: little\nencoding: raw\ndimension: 3\nsizes: 20 18 12\n"
                   "spacings: 700 900 1300\nunits: \"um\" \"um\" \"um\"\n\n" +
                     this->GetBytes());
  this->ExpectRead("axes.nrrd");
  this->WriteBytes("axes.nrrd",
                   "NRRD0004\ntype: short\nendian: little\nencoding: raw\ndimension: 3\nsizes: 20 18 12\n"
                   "spacings: 700 900 1.3\nunits: \"um\" \"\" \"mm\"\n\n" +
                     this->GetBytes());
  this->ExpectRead("axes.nrrd");
  this->ExpectLetters("axes.nrrd", false);
}

TEST_F(ShearWarpMIPProgramNRRD, OfAListIsASeries)
{
  const auto volume = MakeVolume<PixelType>(10);
  const auto bytes = GetPixels(volume);
  for (const std::string kinds : { "list domain domain domain", "domain domain domain list" })
  {
    SCOPED_TRACE(kinds);
    const bool             isFirst = kinds.find("list") == 0;
    std::vector<PixelType> values(3 * bytes.size());
    for (std::size_t n = 0; n < values.size(); ++n)
    {
      const std::size_t time = isFirst ? n % 3 : n / bytes.size();
      values[n] = static_cast<PixelType>(bytes[isFirst ? n / 3 : n % bytes.size()] + 100 * time);
    }
    const std::string directions = "(0.7,0,0) (0,0.9,0) (0,0,1.3)";
    this->WriteBytes("list.nrrd",
                     "NRRD0004\ntype: short\nendian: little\nencoding: raw\ndimension: 4\nsizes: " +
                       std::string(isFirst ? "3 20 18 12" : "20 18 12 3") +
                       "\nspace: LPS\nspace directions: " + (isFirst ? "none " + directions : directions + " none") +
                       "\nspace origin: (-40,12.5,3)\nkinds: " + kinds + "\n\n" +
                       std::string(reinterpret_cast<const char *>(values.data()), sizeof(PixelType) * values.size()));
    this->ExpectSuccess("list.nrrd out.nrrd");
    m_Volume = volume;
    const auto stack = this->ReadPixels<VolumeType>("out.nrrd");
    const auto picture = GetPixels(this->Project(this->MakeTransform(Direction::Anterior)));
    ASSERT_EQ(stack.size(), 3 * picture.size());
    for (std::size_t n = 0; n < stack.size(); ++n)
    {
      ASSERT_EQ(stack[n], picture[n % picture.size()] + 100 * static_cast<int>(n / picture.size()));
    }
    // layers of segments are components
    const auto addSegment = [](std::string text) {
      text.insert(text.find("\n\n") + 1, "Segment0_ID:=a\n");
      return text;
    };
    this->WithChangedFile("list.nrrd", addSegment, [&] {
      this->ExpectSuccess("list.nrrd out.nrrd");
      EXPECT_EQ((this->Read<itk::VectorImage<PixelType, 2>>("out.nrrd")->GetNumberOfComponentsPerPixel()), 3u);
    });
  }
}

TEST_F(ShearWarpMIPProgramFormats, MetaImageHasItsUnitAndMayHaveNoSides)
{
  const std::string shape = "ObjectType = Image\nNDims = 3\nDimSize = 20 18 12\nElementType = MET_SHORT\n"
                            "BinaryData = True\nBinaryDataByteOrderMSB = False\n";
  const std::string data = "ElementDataFile = LOCAL\n" + this->GetBytes();
  m_Volume->SetDirection(itk::Matrix<double, 3, 3>::GetIdentity());
  this->WriteBytes("um.mha",
                   shape + "Offset = -40000 12500 3000\nElementSpacing = 700 900 1300\nDistanceUnits = um\n" + data);
  this->ExpectRead("um.mha");
  this->ExpectLetters("um.mha", false);
  // these letters alone give no direction
  this->WriteBytes("letters.mha",
                   shape + "Offset = -40 12.5 3\nElementSpacing = 0.7 0.9 1.3\nAnatomicalOrientation = ASR\n" + data);
  this->ExpectRead("letters.mha");
  this->ExpectLetters("letters.mha", false);
  this->WriteBytes("mm.mha",
                   shape + "Offset = -40 12.5 3\nElementSpacing = 0.7 0.9 1.3\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n" +
                     "AnatomicalOrientation = ???\n" + data);
  this->ExpectRead("mm.mha");
  this->ExpectLetters("mm.mha", true);
}

class ShearWarpMIPProgramForms : public ShearWarpMIPProgramFormats
{
protected:
  /** The matrix of NIfTI (RAS) from voxels to mm that lays m_Volume where it is. */
  std::array<std::array<float, 4>, 3>
  GetForm() const
  {
    const auto                          axes = this->GetAxes();
    std::array<std::array<float, 4>, 3> form{};
    for (unsigned int row = 0; row < 3; ++row)
    {
      const double sign = row < 2 ? -1.0 : 1.0;
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        form[row][axis] = static_cast<float>(sign * axes(row, axis));
      }
      form[row][3] = static_cast<float>(sign * m_Volume->GetOrigin()[row]);
    }
    return form;
  }

  /** Writes m_Volume with its sform and an upright qform, of these codes. */
  void
  WriteNIfTI(
    const std::string &                           name,
    short                                         sform,
    short                                         qform,
    const std::function<void(nifti_1_header &)> & change = [](nifti_1_header &) {}) const
  {
    nifti_1_header header{};
    header.sizeof_hdr = sizeof(header);
    const short dimensions[] = { 3, 20, 18, 12, 1, 1, 1, 1 };
    std::copy(std::begin(dimensions), std::end(dimensions), header.dim);
    header.datatype = DT_INT16;
    header.bitpix = 16;
    header.pixdim[0] = 1.0F;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      header.pixdim[axis + 1] = static_cast<float>(m_Volume->GetSpacing()[axis]);
    }
    header.vox_offset = 352.0F;
    header.xyzt_units = NIFTI_UNITS_MM;
    header.sform_code = sform;
    header.qform_code = qform;
    const auto form = this->GetForm();
    std::copy(form[0].begin(), form[0].end(), header.srow_x);
    std::copy(form[1].begin(), form[1].end(), header.srow_y);
    std::copy(form[2].begin(), form[2].end(), header.srow_z);
    // the same position as by the sform, but no rotation: the axes are right, anterior, superior
    header.qoffset_x = form[0][3];
    header.qoffset_y = form[1][3];
    header.qoffset_z = form[2][3];
    std::memcpy(header.magic, "n+1", 4);
    change(header);
    this->WriteBytes(name,
                     std::string(reinterpret_cast<const char *>(&header), sizeof(header)) + std::string(4, '\0') +
                       this->GetBytes());
  }

  void
  ExpectReadWithWarning(const std::string & input) const
  {
    this->ExpectWarning(input + " out.nrrd --azimuth 30",
                        "'" + input + "' states two positions: the qform puts a corner");
    this->ExpectPicture("out.nrrd", this->Project(this->MakeTransform(Direction::Anterior, 30.0)));
  }

  /** A direction that right, anterior, superior is. */
  static MatrixType
  MakeUpright()
  {
    MatrixType direction;
    direction.Fill(0.0);
    direction(0, 0) = direction(1, 1) = -1.0;
    direction(2, 2) = 1.0;
    return direction;
  }
};

TEST_F(ShearWarpMIPProgramForms, OfNIfTIAreTheSformWhereItHasACode)
{
  for (short code = 1; code <= 4; ++code)
  {
    SCOPED_TRACE(code);
    this->WriteNIfTI("only.nii", code, 0);
    this->ExpectRead("only.nii");
    this->ExpectLetters("only.nii", true);
    for (short other = 1; other <= 4; ++other)
    {
      this->WriteNIfTI("both.nii", code, other);
      this->ExpectReadWithWarning("both.nii");
    }
  }
}

TEST_F(ShearWarpMIPProgramForms, OfNIfTIThatAreFlippedTurnedOrAlike)
{
  const MatrixType upright = MakeUpright();
  m_Volume->SetDirection(upright);
  this->WriteNIfTI("alike.nii", 1, 1);
  this->ExpectRead("alike.nii");

  MatrixType flipped = upright;
  flipped(0, 0) = 1.0;
  m_Volume->SetDirection(flipped);
  this->WriteNIfTI("flipped.nii", 2, 1);
  this->ExpectReadWithWarning("flipped.nii");

  const auto turn = itk::AffineTransform<double, 3>::New();
  turn->Rotate3D(MakeVector(0, 0, 1), 10.0 * itk::Math::pi / 180.0);
  m_Volume->SetDirection(turn->GetMatrix() * upright);
  this->WriteNIfTI("turned.nii", 1, 1);
  this->ExpectReadWithWarning("turned.nii");

  m_Volume->SetDirection(upright);
  this->WriteNIfTI("qform.nii", 0, 1);
  this->ExpectRead("qform.nii");
  this->ExpectLetters("qform.nii", true);

  // the qform of the other handedness
  MatrixType left = upright;
  left(2, 2) = -1.0;
  m_Volume->SetDirection(left);
  this->WriteNIfTI("left.nii", 0, 1, [](nifti_1_header & header) { header.pixdim[0] = -1.0F; });
  this->ExpectRead("left.nii");
}

TEST_F(ShearWarpMIPProgramForms, OfNIfTIKeepAShear)
{
  m_Volume->SetDirection(MakeUpright());
  MatrixType axes = this->GetAxes();
  axes(1, 2) = 0.8;
  this->SetAxes(axes);
  this->WriteNIfTI("alone.nii", 1, 0);
  this->ExpectRead("alone.nii");
  this->WriteNIfTI("both.nii", 1, 1);
  this->ExpectReadWithWarning("both.nii");
}

TEST_F(ShearWarpMIPProgramForms, OfNIfTIAreInMillimetres)
{
  this->WriteNIfTI("mm.nii", 1, 0);
  this->ExpectRead("mm.nii");
  auto spacing = m_Volume->GetSpacing();
  auto origin = m_Volume->GetOrigin();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    spacing[axis] *= 1000.0;
    origin[axis] *= 1000.0;
  }
  m_Volume->SetSpacing(spacing);
  m_Volume->SetOrigin(origin);
  this->WriteNIfTI("um.nii", 1, 0, [](nifti_1_header & header) { header.xyzt_units = NIFTI_UNITS_MICRON; });
  this->WriteNIfTI("q.nii", 0, 1, [](nifti_1_header & header) { header.xyzt_units = NIFTI_UNITS_MICRON; });
  this->ExpectSuccess("um.nii um.nrrd --azimuth 30");
  this->ExpectSuccess("mm.nii mm.nrrd --azimuth 30");
  const auto micrometres = this->Read("um.nrrd");
  const auto millimetres = this->Read("mm.nrrd");
  EXPECT_EQ(micrometres->GetBufferedRegion(), millimetres->GetBufferedRegion());
  EXPECT_NEAR(micrometres->GetSpacing()[0], millimetres->GetSpacing()[0], 1e-6);
  EXPECT_NEAR(micrometres->GetOrigin()[1], millimetres->GetOrigin()[1], 1e-4);
  this->ExpectSuccess("q.nii q.nrrd");
  EXPECT_NEAR(this->Read("q.nrrd")->GetSpacing()[0], 0.7, 1e-6);
}

TEST_F(ShearWarpMIPProgramForms, OfNIfTIThatSpanNoVolumeAreRefused)
{
  const auto flatten = [](nifti_1_header & header) {
    std::copy(std::begin(header.srow_x), std::end(header.srow_x), header.srow_y);
  };
  this->WriteNIfTI("flat.nii", 1, 0, flatten);
  this->ExpectFailure("flat.nii out.png", "'flat.nii' has no valid directions of its axes");
  for (const float number : { std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity() })
  {
    this->WriteNIfTI("x.nii", 1, 1, [number](nifti_1_header & header) { header.srow_x[0] = number; });
    this->ExpectFailure("x.nii out.png", "'x.nii' is damaged or incomplete: its sform or qform is not finite");
  }
  m_Volume->SetDirection(MakeUpright());
  this->WriteNIfTI("other.nii", 1, 1, [](nifti_1_header & header) {
    for (float * row : { header.srow_x, header.srow_y, header.srow_z })
    {
      std::fill_n(row, 4, 0.0F);
    }
  });
  this->ExpectRead("other.nii",
                   "shear-warp-mip: warning: 'other.nii' has an sform that spans no volume; its qform is used\n");
  m_Volume->SetDirection(itk::Matrix<double, 3, 3>::GetIdentity());
  m_Volume->SetOrigin(itk::Point<double, 3>(0.0));
  this->WriteNIfTI("none.nii", 0, 0);
  this->ExpectRead("none.nii");
  this->ExpectLetters("none.nii", false);
}

TEST_F(ShearWarpMIPProgramFormats, MRCIsInAngstromAlongXYZ)
{
  m_Volume->SetDirection(itk::Matrix<double, 3, 3>::GetIdentity());
  this->WriteImage(m_Volume, "x.mrc");
  this->ExpectSuccess("x.mrc out.nrrd");
  const auto picture = this->Read("out.nrrd");
  const auto expected = this->Project(this->MakeTransform(Direction::Anterior));
  EXPECT_EQ(GetPixels(picture), GetPixels(expected));
  EXPECT_NEAR(picture->GetSpacing()[0] / expected->GetSpacing()[0], 1e-7, 1e-12);
  this->ExpectLetters("x.mrc", false);
  this->WithChangedFile(
    "x.mrc",
    [](std::string bytes) {
      // mapc and mapr
      std::swap(bytes[64], bytes[68]);
      return bytes;
    },
    [&] { this->ExpectFailure("x.mrc out.png", "'x.mrc' has its axes in another order than X, Y, Z"); });
}

TEST_F(ShearWarpMIPProgramFormats, VTKHasValuesOfPoints)
{
  const std::string begin = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\n"
                            "ORIGIN 0 0 0\nSPACING 1 1 1\n";
  const std::string scalars = "SCALARS v short 1\nLOOKUP_TABLE default\n";
  this->WriteBytes("points.vtk", begin + "POINT_DATA 8\n" + scalars + "1 2 3 4 5 6 7 8\n");
  this->ExpectSuccess("points.vtk out.nrrd --view superior");
  // the upper slice, its first row at the bottom
  EXPECT_EQ(this->ReadPixels("out.nrrd"), (std::vector<PixelType>{ 6, 5, 8, 7 }));
  this->WriteBytes("cells.vtk", begin + "CELL_DATA 1\n" + scalars + "1 2 3 4 5 6 7 8\n");
  this->ExpectFailure("cells.vtk out.png", "'cells.vtk' cannot be read: its header has 'cell_data'");
  this->WriteBytes("field.vtk",
                   begin + "FIELD FieldData 1\nscalars 1 1 short\n4\nPOINT_DATA 8\n" + scalars + "1 2 3\n");
  this->ExpectFailure("field.vtk out.png", "'field.vtk'");
  this->WriteBytes("few.vtk", begin + "POINT_DATA 8\n" + scalars + "1 2 3 4 5 6 7\n");
  this->ExpectFailure("few.vtk out.png", "'few.vtk' is damaged or incomplete: value 8 of 8 is missing");
  this->WriteBytes("none.vtk", begin + "POINT_DATA 8\n");
  this->ExpectFailure("none.vtk out.png", "none.vtk");
}

TEST_F(ShearWarpMIPProgramFormats, OthersAreRefusedByName)
{
  for (const std::string name : { "x.lsm", "x.png", "x.pic", "x" })
  {
    this->WriteBytes(name, "no image");
    this->ExpectFailure(name + " out.png",
                        "'" + name +
                          "' is no image of DICOM, NIfTI-1, Analyze, NRRD, MetaImage, TIFF, VTK, GIPL or MRC\n");
  }
}

TEST_F(ShearWarpMIPProgramFormats, ContentSaysHowAFileIsToBeCalled)
{
  const std::string gzip = "gzip: decompress it, or if it is NIfTI, let its name end in .nii.gz";
  const std::vector<std::array<std::string, 3>> cases = {
    { { "x.nrrd", "y.nii", "NRRD, whose name ends in .nrrd" } },
    { { "x.mha", "y.nii", "MetaImage, whose name ends in .mha" } },
    { { "x.nii", "y.nrrd", "NIfTI, whose name ends in .nii" } },
    { { "x.nii.gz", "y.nii", gzip } },
    { { "x.nii.gz", "y", gzip } }
  };
  for (const auto & [good, bad, content] : cases)
  {
    SCOPED_TRACE(good + " as " + bad);
    this->WriteImage(m_Volume, good);
    fs::copy_file(m_Folder / good, m_Folder / bad, fs::copy_options::overwrite_existing);
    this->ExpectFailure(bad + " out.png", "GIPL or MRC; its content is " + content + '\n');
  }
  this->WriteBytes("x.nii.gz", "\x1f\x8b no image");
  this->ExpectFailure("x.nii.gz out.png", "x.nii.gz");
  EXPECT_EQ(this->Run("x.nii.gz out.png").messages.find("its content is"), std::string::npos);
}

struct FileType
{
  std::string name;
  bool        isCompressed;
  bool        hasChecksum;
};

std::ostream &
operator<<(std::ostream & stream, const FileType & type)
{
  return stream << type.name << (type.isCompressed ? " compressed" : "");
}

class ShearWarpMIPProgramDamage
  : public ShearWarpMIPProgram
  , public testing::WithParamInterface<FileType>
{};

TEST_P(ShearWarpMIPProgramDamage, OfAFileIsNoticedOrChangesNothing)
{
  const std::string name = GetParam().name;
  const bool        hasChecksum = GetParam().hasChecksum;
  std::mt19937      random;
  std::generate_n(m_Volume->GetBufferPointer(), m_Volume->GetBufferedRegion().GetNumberOfPixels(), [&random] {
    return static_cast<PixelType>(random() % 1000);
  });
  this->WriteImage(m_Volume, name, GetParam().isCompressed);
  const auto getPixels = [&] {
    const Result result = this->Run(name + " out.nrrd");
    return result.status == 0 ? this->ReadPixels("out.nrrd") : std::vector<PixelType>();
  };
  const auto whole = getPixels();
  ASSERT_FALSE(whole.empty());
  const std::size_t size = ReadText(m_Folder / name).size();
  for (const std::size_t kept : { size / 4, size / 2, size - size / 4, size - 1 })
  {
    this->WithCutFile(name, kept, [&] {
      fs::remove(m_Folder / "out.nrrd");
      const auto pixels = getPixels();
      EXPECT_TRUE(pixels.empty() || (kept == size - 1 && pixels == whole));
    });
  }
  for (const std::size_t place : { size / 3, size / 2, size - size / 5 })
  {
    const auto flip = [place](std::string bytes) {
      bytes[place] = static_cast<char>(bytes[place] ^ 0x10);
      return bytes;
    };
    this->WithChangedFile(name, flip, [&] {
      SCOPED_TRACE(place);
      fs::remove(m_Folder / "out.nrrd");
      const auto pixels = getPixels();
      EXPECT_TRUE(!hasChecksum || pixels.empty() || pixels == whole);
    });
  }
}

INSTANTIATE_TEST_SUITE_P(Formats,
                         ShearWarpMIPProgramDamage,
                         testing::Values(FileType{ "x.nrrd", false, false },
                                         FileType{ "x.nrrd", true, true },
                                         FileType{ "x.mha", false, false },
                                         FileType{ "x.mha", true, true },
                                         FileType{ "x.nii", false, false },
                                         FileType{ "x.nii.gz", true, true },
                                         FileType{ "x.vtk", false, false },
                                         FileType{ "x.gipl", false, false },
                                         FileType{ "x.gipl.gz", true, true },
                                         FileType{ "x.mrc", false, false },
                                         FileType{ "x.tif", false, false },
                                         FileType{ "x.tif", true, false }));

class ShearWarpMIPProgramTIFF : public ShearWarpMIPProgramFormats
{
protected:
  struct Storage
  {
    std::string   description{};
    std::uint32_t tile{ 0 };
    std::uint16_t compression{ COMPRESSION_NONE };
    float         resolution{ 0.0F };
    std::uint16_t unit{ RESUNIT_NONE };
    std::uint16_t photometric{ PHOTOMETRIC_MINISBLACK };
    std::uint16_t planar{ PLANARCONFIG_CONTIG };
    std::uint16_t orientation{ ORIENTATION_TOPLEFT };
    std::string   mode{ "w" };
  };

  /** Writes pages of \a width columns; a pixel has the \a samples that follow one another. */
  template <typename T>
  void
  WriteTIFF(const std::string &                 name,
            const std::vector<std::vector<T>> & pages,
            std::uint32_t                       width,
            const Storage &                     storage,
            std::uint16_t                       samples = 1) const
  {
    TIFF * const file = TIFFOpen(this->GetPath(name).c_str(), storage.mode.c_str());
    for (const auto & page : pages)
    {
      const auto height = static_cast<std::uint32_t>(page.size() / samples / width);
      TIFFSetField(file, TIFFTAG_IMAGEWIDTH, width);
      TIFFSetField(file, TIFFTAG_IMAGELENGTH, height);
      TIFFSetField(file, TIFFTAG_BITSPERSAMPLE, 8 * sizeof(T));
      TIFFSetField(file, TIFFTAG_SAMPLESPERPIXEL, samples);
      TIFFSetField(file,
                   TIFFTAG_SAMPLEFORMAT,
                   std::is_floating_point_v<T> ? SAMPLEFORMAT_IEEEFP
                   : std::is_signed_v<T>       ? SAMPLEFORMAT_INT
                                               : SAMPLEFORMAT_UINT);
      TIFFSetField(file, TIFFTAG_PHOTOMETRIC, storage.photometric);
      TIFFSetField(file, TIFFTAG_PLANARCONFIG, storage.planar);
      TIFFSetField(file, TIFFTAG_COMPRESSION, storage.compression);
      TIFFSetField(file, TIFFTAG_ORIENTATION, storage.orientation);
      if (storage.resolution > 0.0F)
      {
        TIFFSetField(file, TIFFTAG_XRESOLUTION, storage.resolution);
        TIFFSetField(file, TIFFTAG_YRESOLUTION, storage.resolution);
      }
      TIFFSetField(file, TIFFTAG_RESOLUTIONUNIT, storage.unit);
      if (&page == &pages.front() && !storage.description.empty())
      {
        TIFFSetField(file, TIFFTAG_IMAGEDESCRIPTION, storage.description.c_str());
      }
      const bool          isPlanar = storage.planar == PLANARCONFIG_SEPARATE;
      const std::uint16_t planes = isPlanar ? samples : std::uint16_t{ 1 };
      const std::uint16_t together = isPlanar ? std::uint16_t{ 1 } : samples;
      const auto          get = [&](std::uint32_t column, std::uint32_t row, std::uint16_t sample) {
        return page[(std::size_t{ row } * width + column) * samples + sample];
      };
      if (storage.tile > 0)
      {
        TIFFSetField(file, TIFFTAG_TILEWIDTH, storage.tile);
        TIFFSetField(file, TIFFTAG_TILELENGTH, storage.tile);
        for (std::uint16_t plane = 0; plane < planes; ++plane)
        {
          for (std::uint32_t top = 0; top < height; top += storage.tile)
          {
            for (std::uint32_t left = 0; left < width; left += storage.tile)
            {
              std::vector<T> tile;
              for (std::uint32_t n = 0; n < storage.tile * storage.tile; ++n)
              {
                for (std::uint16_t sample = 0; sample < together; ++sample)
                {
                  tile.push_back(get(std::min(left + n % storage.tile, width - 1),
                                     std::min(top + n / storage.tile, height - 1),
                                     isPlanar ? plane : sample));
                }
              }
              TIFFWriteTile(file, tile.data(), left, top, 0, plane);
            }
          }
        }
      }
      else
      {
        // several strips
        TIFFSetField(file, TIFFTAG_ROWSPERSTRIP, 5);
        for (std::uint16_t plane = 0; plane < planes; ++plane)
        {
          for (std::uint32_t row = 0; row < height; ++row)
          {
            std::vector<T> line(std::size_t{ width } * together);
            for (std::uint32_t n = 0; n < line.size(); ++n)
            {
              line[n] = isPlanar ? get(n, row, plane) : get(n / samples, row, static_cast<std::uint16_t>(n % samples));
            }
            TIFFWriteScanline(file, line.data(), row, plane);
          }
        }
      }
      TIFFWriteDirectory(file);
    }
    TIFFClose(file);
  }

  /** Pages of 8 columns and 12 rows that are 100 channel + 10 time + slice, and 1000 in the middle of slice 3. */
  static std::vector<std::vector<unsigned short>>
  MakePages(const std::vector<std::array<unsigned int, 3>> & places)
  {
    std::vector<std::vector<unsigned short>> pages;
    for (const auto & [channel, slice, time] : places)
    {
      pages.emplace_back(96, static_cast<unsigned short>(100 * channel + 10 * time + slice));
      pages.back()[50] = static_cast<unsigned short>(slice == 3 ? 1000 + 100 * channel + 10 * time : pages.back()[50]);
    }
    return pages;
  }

  /** The places of pages whose axes vary in the \a order of letters, the first fastest, with these sizes. */
  static std::vector<std::array<unsigned int, 3>>
  MakePlaces(const std::string & order, const std::map<char, unsigned int> & sizes)
  {
    std::vector<std::array<unsigned int, 3>> places;
    const auto                               count = sizes.at('C') * sizes.at('Z') * sizes.at('T');
    for (unsigned int page = 0; page < count; ++page)
    {
      unsigned int                 rest = page;
      std::map<char, unsigned int> place;
      for (const char axis : order)
      {
        place[axis] = rest % sizes.at(axis);
        rest /= sizes.at(axis);
      }
      places.push_back({ { place['C'], place['Z'], place['T'] } });
    }
    return places;
  }

  /** Looks along the slices: each pixel of channel c and time t has its largest value in slice 3 or the last one. */
  void
  ExpectSeries(const std::string & name, unsigned int channels, unsigned int slices, unsigned int times) const
  {
    SCOPED_TRACE(name);
    this->ExpectSuccess(name + " out.nrrd --view superior");
    const auto stack = this->Read<itk::VectorImage<PixelType, 3>>("out.nrrd");
    ASSERT_EQ(stack->GetNumberOfComponentsPerPixel(), channels);
    ASSERT_EQ(stack->GetBufferedRegion().GetSize(), (itk::Size<3>{ { 8, 12, times } }));
    for (unsigned int time = 0; time < times; ++time)
    {
      for (unsigned int channel = 0; channel < channels; ++channel)
      {
        const PixelType * const begin = stack->GetBufferPointer() + std::size_t{ 96 } * channels * time + channel;
        std::multiset<int>      values;
        for (std::size_t n = 0; n < 96; ++n)
        {
          values.insert(begin[n * channels]);
        }
        const int base = static_cast<int>(100 * channel + 10 * time);
        EXPECT_EQ(values.count(1000 + base), 1u);
        EXPECT_EQ(values.count(base + static_cast<int>(slices) - 1), 95u);
      }
    }
  }

  /** The spacing of the volume, from a picture from anterior and one from superior. */
  void
  ExpectSpacing(const std::string & name, const std::array<double, 3> & spacing) const
  {
    SCOPED_TRACE(name);
    const Result result = this->Run(name + " out.nrrd -v");
    EXPECT_EQ(result.status, 0);
    std::ostringstream text;
    text << "spacing [" << spacing[0] << ", " << spacing[1] << ", " << spacing[2] << "] mm";
    EXPECT_NE(result.messages.find(text.str()), std::string::npos) << result.messages;
  }

  static std::string
  MakeOME(const std::string & attributes, const std::string & blocks = "<TiffData/>")
  {
    return "<?xml version=\"1.0\" encoding=\"UTF-8\"?><OME xmlns=\"http://www.openmicroscopy.org/Schemas/OME/2016-06\">"
           "<Image ID=\"Image:0\"><Pixels ID=\"Pixels:0\" Type=\"uint16\" SizeX=\"8\" SizeY=\"12\" " +
           attributes + ">" + blocks + "</Pixels></Image></OME>";
  }
};

TEST_F(ShearWarpMIPProgramTIFF, OfImageJHasChannelsSlicesTimesAndSpacing)
{
  Storage storage;
  storage.description = "ImageJ=1.54f\nimages=30\nchannels=3\nslices=5\nframes=2\nhyperstack=true\nunit=\\u00B5m\n"
                        "spacing=3.0\nloop=false\n";
  storage.resolution = 2.0F;
  const auto pages = MakePages(MakePlaces("CZT", { { 'C', 3 }, { 'Z', 5 }, { 'T', 2 } }));
  this->WriteTIFF("x.tif", pages, 8, storage);
  this->ExpectSeries("x.tif", 3, 5, 2);
  this->ExpectSpacing("x.tif", { { 0.0005, 0.0005, 0.003 } });
  for (const std::string unit : { "um", "micron", "\xc2\xb5m", "\xb5m" })
  {
    storage.description = "ImageJ=1.54f\nimages=5\nslices=5\nunit=" + unit + "\nspacing=3.0\n";
    this->WriteTIFF("z.tif", MakePages(MakePlaces("CZT", { { 'C', 1 }, { 'Z', 5 }, { 'T', 1 } })), 8, storage);
    this->ExpectSeries("z.tif", 1, 5, 1);
    this->ExpectSpacing("z.tif", { { 0.0005, 0.0005, 0.003 } });
  }
  storage.description = "ImageJ=1.54f\nimages=40\nslices=40\n";
  this->WriteTIFF("few.tif", pages, 8, storage);
  this->ExpectFailure("few.tif out.png", "its description states 40 images, but it has 30 pages");
  storage.description = "ImageJ=1.54f\nimages=30\nchannels=3\nslices=5\n";
  this->WriteTIFF("frames.tif", pages, 8, storage);
  this->ExpectFailure("frames.tif out.png", "states 30 images, which are not its channels times slices times frames");
  storage.description = "ImageJ=1.54f\nimages=30\nframes=30\nunit=um\nspacing=3.0\n";
  this->WriteTIFF("frames.tif", pages, 8, storage);
  this->ExpectWarning("frames.tif out.nrrd", "'frames.tif' describes its 30 pages as channels or points in time");
  EXPECT_EQ(this->Read("out.nrrd")->GetBufferedRegion().GetSize()[1], 180u);
}

TEST_F(ShearWarpMIPProgramTIFF, OfImageJMayLeaveOutASpacingOfOneAndHaveSignedValues)
{
  Storage storage;
  storage.description = "ImageJ=1.54f\nimages=5\nslices=5\nunit=micron\n";
  storage.resolution = 2.0F;
  const auto pages = MakePages(MakePlaces("ZCT", { { 'C', 1 }, { 'Z', 5 }, { 'T', 1 } }));
  this->WriteTIFF("x.tif", pages, 8, storage);
  this->ExpectSeries("x.tif", 1, 5, 1);
  this->ExpectSpacing("x.tif", { { 0.0005, 0.0005, 0.001 } });
  storage.description += "spacing=-2.0\ncf=0\nc0=-32768.0\nc1=1.0\n";
  auto shifted = pages;
  for (auto & page : shifted)
  {
    for (unsigned short & value : page)
    {
      value = static_cast<unsigned short>(value + 32768);
    }
  }
  this->WriteTIFF("x.tif", shifted, 8, storage);
  this->ExpectSeries("x.tif", 1, 5, 1);
  this->ExpectSpacing("x.tif", { { 0.0005, 0.0005, 0.002 } });
  storage.description = "ImageJ=1.54f\nimages=5\nslices=5\nunit=micron\ncf=0\nc0=3\nc1=2\n";
  this->WriteTIFF("x.tif", pages, 8, storage);
  this->ExpectWarning("x.tif out.nrrd", "'x.tif' describes a calibration of its values, which is not read");
}

TEST_F(ShearWarpMIPProgramTIFF, HasItsFirstRowAndColumnWhereItSays)
{
  Storage storage;
  storage.description = "ImageJ=1\nimages=2\nslices=2\nspacing=1\nunit=mm\n";
  storage.resolution = 1.0F;
  std::vector<unsigned short> page(24);
  for (std::size_t n = 0; n < page.size(); ++n)
  {
    page[n] = static_cast<unsigned short>(100 + n);
  }
  this->WriteTIFF("upright.tif", std::vector<std::vector<unsigned short>>(2, page), 6, storage);
  this->ExpectSuccess("upright.tif upright.nrrd --view superior");
  for (const int orientation : { ORIENTATION_TOPRIGHT, ORIENTATION_BOTRIGHT, ORIENTATION_BOTLEFT })
  {
    std::vector<unsigned short> stored(24);
    for (std::size_t n = 0; n < page.size(); ++n)
    {
      const std::size_t column = orientation == ORIENTATION_BOTLEFT ? n % 6 : 5 - n % 6;
      const std::size_t row = orientation == ORIENTATION_TOPRIGHT ? n / 6 : 3 - n / 6;
      stored[n] = page[6 * row + column];
    }
    storage.orientation = static_cast<std::uint16_t>(orientation);
    this->WriteTIFF("x.tif", std::vector<std::vector<unsigned short>>(2, stored), 6, storage);
    this->ExpectSuccess("x.tif out.nrrd --view superior");
    EXPECT_EQ(this->ReadPixels("out.nrrd"), this->ReadPixels("upright.nrrd"));
  }
  storage.orientation = ORIENTATION_LEFTTOP;
  this->WriteTIFF("x.tif", std::vector<std::vector<unsigned short>>(2, page), 6, storage);
  this->ExpectFailure("x.tif out.png", "'x.tif' has columns that are stored as rows, which is not read");
}

TEST_F(ShearWarpMIPProgramTIFF, OfOMEHasItsOrderOfAxesAndSpacing)
{
  Storage           storage;
  const std::string sizes = "SizeC=\"3\" SizeZ=\"5\" SizeT=\"2\" ";
  const std::string spacing = "PhysicalSizeX=\"0.5\" PhysicalSizeY=\"0.5\" PhysicalSizeZ=\"2000\" "
                              "PhysicalSizeZUnit=\"nm\" ";
  for (const std::string order : { "CZT", "CTZ", "ZCT", "ZTC", "TCZ", "TZC" })
  {
    SCOPED_TRACE(order);
    storage.description = MakeOME("DimensionOrder=\"XY" + order + "\" " + sizes + spacing);
    const auto pages = MakePages(MakePlaces(order, { { 'C', 3 }, { 'Z', 5 }, { 'T', 2 } }));
    this->WriteTIFF("x.ome.tif", pages, 8, storage);
    this->ExpectSeries("x.ome.tif", 3, 5, 2);
    this->ExpectSpacing("x.ome.tif", { { 0.0005, 0.0005, 0.002 } });
  }
  // each plane says its page, the last page first
  auto        places = MakePlaces("CZT", { { 'C', 3 }, { 'Z', 5 }, { 'T', 2 } });
  std::string blocks;
  for (std::size_t page = 0; page < places.size(); ++page)
  {
    const auto & [c, z, t] = places[places.size() - 1 - page];
    blocks += "<TiffData IFD=\"" + std::to_string(page) + "\" FirstC=\"" + std::to_string(c) + "\" FirstZ=\"" +
              std::to_string(z) + "\" FirstT=\"" + std::to_string(t) + "\" PlaneCount=\"1\"/>";
  }
  std::reverse(places.begin(), places.end());
  storage.description = MakeOME("DimensionOrder=\"XYCZT\" " + sizes + spacing, blocks);
  this->WriteTIFF("x.ome.tif", MakePages(places), 8, storage);
  this->ExpectSeries("x.ome.tif", 3, 5, 2);
}

TEST_F(ShearWarpMIPProgramTIFF, OfOMEWhosePlanesAreElsewhereIsRefused)
{
  Storage    storage;
  const auto pages = MakePages(MakePlaces("ZCT", { { 'C', 1 }, { 'Z', 5 }, { 'T', 1 } }));
  const auto makeBlock = [](int z, const std::string & file) {
    return "<TiffData IFD=\"" + std::to_string(z % 5) + "\" FirstZ=\"" + std::to_string(z) + "\"><UUID FileName=\"" +
           file + "\">urn:uuid:1</UUID></TiffData>";
  };
  std::string blocks;
  for (int z = 0; z < 10; ++z)
  {
    blocks += makeBlock(z, z < 5 ? "x.ome.tif" : "y.ome.tif");
  }
  const std::string axes = "DimensionOrder=\"XYZCT\" SizeC=\"1\" SizeT=\"1\" PhysicalSizeX=\"1\" PhysicalSizeY=\"1\" "
                           "PhysicalSizeZ=\"1\" SizeZ=\"";
  storage.description = MakeOME(axes + "10\"", blocks);
  this->WriteTIFF("x.ome.tif", pages, 8, storage);
  this->ExpectFailure("x.ome.tif out.png", "states 10 planes, of which 5 are not in this file");
  blocks.clear();
  for (int z = 0; z < 5; ++z)
  {
    blocks += makeBlock(z, "its former name.ome.tif");
  }
  storage.description = MakeOME(axes + "5\"", blocks);
  this->WriteTIFF("x.ome.tif", pages, 8, storage);
  this->ExpectSeries("x.ome.tif", 1, 5, 1);
  storage.description = MakeOME(axes + "5\"").substr(0, 300);
  this->WriteTIFF("x.ome.tif", pages, 8, storage);
  this->ExpectFailure("x.ome.tif out.png", "its OME description is damaged");
  for (const std::string size : { "0", "-1", "1e30", "99999999", "x\" y=\"" })
  {
    storage.description = MakeOME(axes + size + "\"");
    this->WriteTIFF("x.ome.tif", pages, 8, storage);
    this->ExpectFailure("x.ome.tif out.png", "cannot read 'x.ome.tif': its ");
  }
}

TEST_F(ShearWarpMIPProgramTIFF, WithoutAKnownDescriptionSaysWhatIsAssumed)
{
  Storage    storage;
  const auto pages = MakePages(MakePlaces("ZCT", { { 'C', 1 }, { 'Z', 5 }, { 'T', 1 } }));
  this->WriteTIFF("x.tif", pages, 8, storage);
  this->ExpectWarning("x.tif out.nrrd", "'x.tif' does not say how large its voxels are along x, y, z; 1 mm is taken");
  storage.resolution = 20.0F;
  storage.unit = RESUNIT_CENTIMETER;
  this->WriteTIFF("x.tif", pages, 8, storage);
  this->ExpectWarning("x.tif out.nrrd", "'x.tif' does not say how large its voxels are along z; 0.5 mm is taken");
  this->ExpectSpacing("x.tif", { { 0.5, 0.5, 0.5 } });
  storage.description = "{\"shape\": [5, 1, 2, 12, 8]}";
  this->WriteTIFF("x.tif", pages, 8, storage);
  const Result result = this->Run("x.tif out.nrrd");
  EXPECT_NE(result.messages.find("'x.tif' describes the shape [5, 1, 2, 12, 8], which is not read"), std::string::npos);
  storage.description.clear();
  this->WriteTIFF("one.tif", std::vector<std::vector<unsigned short>>{ pages[0] }, 8, storage);
  this->ExpectFailure("one.tif out.png", "'one.tif' has one slice; a stack of slices is needed");
  auto others = pages;
  others.back().resize(80);
  storage.description = "ImageJ=1\nimages=5\nslices=5\nspacing=1\nunit=mm\n";
  this->WriteTIFF("sizes.tif", others, 8, storage);
  this->ExpectFailure("sizes.tif out.png", "'sizes.tif' has pages of different sizes or kinds, the first and page 5");
}

template <typename T>
class ShearWarpMIPProgramTIFFType : public ShearWarpMIPProgramTIFF
{};

using SampleTypes = testing::Types<std::uint8_t,
                                   std::int8_t,
                                   std::uint16_t,
                                   std::int16_t,
                                   std::uint32_t,
                                   std::int32_t,
                                   std::int64_t,
                                   float,
                                   double>;
} // namespace

TYPED_TEST_SUITE(ShearWarpMIPProgramTIFFType, SampleTypes);

TYPED_TEST(ShearWarpMIPProgramTIFFType, HasItsValuesHoweverTheyAreStored)
{
  using T = TypeParam;
  const int                   least = std::is_signed_v<T> ? 125 : 0;
  const double                step = std::is_integral_v<T> ? 1.0 : 0.125;
  std::mt19937                random;
  std::vector<std::vector<T>> pages(4, std::vector<T>(37 * 21));
  std::vector<T>              expected(37 * 21, std::numeric_limits<T>::lowest());
  for (auto & page : pages)
  {
    for (std::size_t n = 0; n < page.size(); ++n)
    {
      const auto number = static_cast<int>(random() % 250);
      page[n] = static_cast<T>(step * (number - least));
      expected[n] = std::max(expected[n], page[n]);
    }
  }
  typename ShearWarpMIPProgramTIFF::Storage storage;
  storage.description = "ImageJ=1\nimages=4\nslices=4\nspacing=1\nunit=mm\n";
  storage.resolution = 1.0F;
  for (const std::string mode : { "w", "wb", "w8" })
  {
    for (const std::uint32_t tile : { 0u, 16u, 32u })
    {
      for (const int compression : { COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE })
      {
        storage.mode = mode;
        storage.tile = tile;
        storage.compression = static_cast<std::uint16_t>(compression);
        this->WriteTIFF("x.tif", pages, 37, storage);
        // rows of the picture from superior are the image's
        this->ExpectSuccess("x.tif out.nrrd --view inferior");
        const auto picture = itk::ReadImage<itk::Image<T, 2>>(this->GetPath("out.nrrd"));
        ASSERT_EQ(picture->GetBufferedRegion().GetSize(), (itk::Size<2>{ { 37, 21 } }));
        std::multiset<T> values;
        std::multiset<T> wanted(expected.begin(), expected.end());
        const auto       pixels = GetPixels(picture);
        values.insert(pixels.begin(), pixels.end());
        EXPECT_EQ(values, wanted);
      }
    }
  }
}

TEST_F(ShearWarpMIPProgramTIFF, HasColoursWithoutOpacity)
{
  std::vector<std::vector<unsigned char>> pages(5, std::vector<unsigned char>(384));
  for (std::size_t page = 0; page < pages.size(); ++page)
  {
    for (std::size_t n = 0; n < 96; ++n)
    {
      for (std::size_t sample = 0; sample < 4; ++sample)
      {
        pages[page][4 * n + sample] = static_cast<unsigned char>(10 * page + sample);
      }
    }
  }
  Storage storage;
  storage.photometric = PHOTOMETRIC_RGB;
  storage.description = "ImageJ=1\nimages=5\nslices=5\nspacing=1\nunit=mm\n";
  storage.resolution = 1.0F;
  for (const int planar : { PLANARCONFIG_CONTIG, PLANARCONFIG_SEPARATE })
  {
    storage.planar = static_cast<std::uint16_t>(planar);
    this->WriteTIFF("x.tif", pages, 8, storage, 4);
    this->ExpectSuccess("x.tif out.nrrd");
    const auto picture = this->Read<itk::VectorImage<unsigned char, 2>>("out.nrrd");
    ASSERT_EQ(picture->GetNumberOfComponentsPerPixel(), 3u);
    const auto pixel = picture->GetPixel({ { 4, 2 } });
    EXPECT_EQ(pixel[1] - pixel[0], 1);
    EXPECT_EQ(pixel[2] - pixel[0], 2);
  }
  storage.photometric = PHOTOMETRIC_SEPARATED;
  this->WriteTIFF("cmyk.tif", pages, 8, storage, 4);
  this->ExpectFailure("cmyk.tif out.png", "'cmyk.tif' has colours of a kind that is not read");
}

TEST_F(ShearWarpMIPProgramTIFF, IsRefusedIfAByteOfWhatWasDeflatedIsWrong)
{
  std::mt19937                            random;
  std::vector<std::vector<unsigned char>> pages(5, std::vector<unsigned char>(1024));
  for (auto & page : pages)
  {
    std::generate(page.begin(), page.end(), [&random] { return static_cast<unsigned char>(random() % 40); });
  }
  Storage storage;
  storage.compression = COMPRESSION_ADOBE_DEFLATE;
  storage.description = "ImageJ=1\nimages=5\nslices=5\nspacing=1\nunit=mm\n";
  storage.resolution = 1.0F;
  for (const std::uint32_t tile : { 0u, 16u })
  {
    storage.tile = tile;
    this->WriteTIFF("x.tif", pages, 32, storage);
    this->ExpectSuccess("x.tif out.nrrd");
    // the first blocks are behind the header of 8 bytes
    for (std::size_t place = 10; place < 300; place += 23)
    {
      const auto flip = [place](std::string bytes) {
        bytes[place] = static_cast<char>(bytes[place] ^ 0x10);
        return bytes;
      };
      this->WithChangedFile(
        "x.tif", flip, [&] { this->ExpectFailure("x.tif out.png", "'x.tif' is damaged or incomplete"); });
    }
  }
}
