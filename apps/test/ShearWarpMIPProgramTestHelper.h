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
#ifndef ShearWarpMIPProgramTestHelper_h
#define ShearWarpMIPProgramTestHelper_h

#include "itkGDCMImageIO.h"
#include "itkImageFileReader.h"
#include "itkImageFileWriter.h"
#include "itkImageRegionIteratorWithIndex.h"
#include "itkMetaDataObject.h"
#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPView.h"
#include "itkTransformFileWriter.h"

#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <sstream>

/* What most tests use, compiled once in ShearWarpMIPProgramTestTemplates.cxx: half of the time to compile them. */
#define SHEARWARPMIP_TEST_TEMPLATES(declare)                                                  \
  declare class itk::Image<short, 2>;                                                         \
  declare class itk::Image<short, 3>;                                                         \
  declare class itk::ImageFileReader<itk::Image<unsigned char, 2>>;                           \
  declare class itk::ImageFileReader<itk::Image<unsigned short, 2>>;                          \
  declare class itk::ImageFileReader<itk::Image<short, 2>>;                                   \
  declare class itk::ImageFileReader<itk::Image<short, 3>>;                                   \
  declare class itk::ImageFileReader<itk::Image<int, 2>>;                                     \
  declare class itk::ImageFileReader<itk::Image<float, 2>>;                                   \
  declare class itk::ImageFileReader<itk::Image<double, 2>>;                                  \
  declare class itk::ImageFileReader<itk::Image<double, 3>>;                                  \
  declare class itk::ImageFileWriter<itk::Image<unsigned char, 3>>;                           \
  declare class itk::ImageFileWriter<itk::Image<short, 2>>;                                   \
  declare class itk::ImageFileWriter<itk::Image<short, 3>>;                                   \
  declare class itk::ImageFileWriter<itk::Image<short, 4>>;                                   \
  declare class itk::ImageFileWriter<itk::Image<float, 3>>;                                   \
  declare class itk::ImageFileWriter<itk::Image<double, 3>>;                                  \
  declare class itk::ImageToImageFilter<itk::Image<short, 3>, itk::Image<short, 2>>;          \
  declare class itk::ImageToImageFilter<itk::Image<float, 3>, itk::Image<float, 2>>;          \
  declare class itk::ShearWarpMIPBaseImageFilter<itk::Image<short, 3>, itk::Image<short, 2>>; \
  declare class itk::ShearWarpMIPBaseImageFilter<itk::Image<float, 3>, itk::Image<float, 2>>; \
  declare class itk::ShearWarpMIPImageFilter<itk::Image<short, 3>>;                           \
  declare class itk::ShearWarpMIPImageFilter<itk::Image<float, 3>>

SHEARWARPMIP_TEST_TEMPLATES(extern template);

namespace ShearWarpMIPProgramTest
{
namespace fs = std::filesystem;
using Direction = itk::ShearWarpMIPViewEnums::Direction;
using PixelType = short;
using VolumeType = itk::Image<PixelType, 3>;
using PictureType = itk::Image<PixelType, 2>;
using FilterType = itk::ShearWarpMIPImageFilter<VolumeType>;
using ViewTransformType = itk::ShearWarpMIPView::TransformType;
/** Attributes of DICOM as "group|element", and their values. */
using Tags = std::map<std::string, std::string>;

const std::string smallNote = "' has less than 48 columns or rows";

/** The program of the build, or the one that the environment variable SHEARWARPMIP_PROGRAM names. */
std::string
GetProgram();

inline std::string
ReadText(const fs::path & path)
{
  std::ifstream      file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

inline itk::Vector<double, 3>
MakeVector(double x, double y, double z)
{
  const double values[] = { x, y, z };
  return itk::Vector<double, 3>(values);
}

/** The files of a folder, in the order of their names. */
inline std::vector<fs::path>
ListFiles(const fs::path & folder)
{
  const fs::directory_iterator begin(folder);
  std::vector<fs::path>        files(begin, fs::directory_iterator{});
  std::sort(files.begin(), files.end());
  return files;
}

/** What starts a program without root's right to all files; nothing if that is not possible. */
inline std::optional<std::string>
FindUnprivilegedStart()
{
  const std::string rights = "-dac_override,-dac_read_search";
  const std::string start = geteuid() == 0 ? "setpriv --bounding-set=" + rights + " --inh-caps=" + rights : "";
  return std::system((start + " true").c_str()) == 0 ? std::optional(start) : std::nullopt;
}

/** An image of 0, of so many components if they are not one. */
template <typename TImage>
typename TImage::Pointer
MakeImage(const typename TImage::SizeType & size, unsigned int components = 1)
{
  const auto image = TImage::New();
  image->SetRegions(size);
  image->SetNumberOfComponentsPerPixel(components);
  image->Allocate(true);
  return image;
}

template <typename TImage>
typename TImage::Pointer
MakeImage(const itk::Size<3> & size, const std::array<double, 3> & spacing, const std::array<double, 3> & origin)
{
  const auto image = MakeImage<TImage>(size);
  image->SetSpacing(spacing.data());
  image->SetOrigin(origin.data());
  return image;
}

/** An image of 0 on the grid of another one. */
template <typename TImage>
typename TImage::Pointer
MakeImageLike(const VolumeType * other, unsigned int components = 1)
{
  const auto image = MakeImage<TImage>(other->GetLargestPossibleRegion().GetSize(), components);
  image->SetSpacing(other->GetSpacing());
  image->SetOrigin(other->GetOrigin());
  image->SetDirection(other->GetDirection());
  return image;
}

template <typename TPixel>
typename itk::Image<TPixel, 3>::Pointer
MakeVolume(TPixel lowest)
{
  using ImageType = itk::Image<TPixel, 3>;
  const auto volume = MakeImage<ImageType>({ { 20, 18, 12 } }, { 0.7, 0.9, 1.3 }, { -40.0, 12.5, 3.0 });
  itk::ImageRegionIteratorWithIndex<ImageType> it(volume, volume->GetBufferedRegion());
  for (; !it.IsAtEnd(); ++it)
  {
    const auto & index = it.GetIndex();
    it.Set(static_cast<TPixel>(lowest + static_cast<TPixel>((7 * index[0] + 5 * index[1] + 11 * index[2]) % 101)));
  }
  return volume;
}

template <typename TPicture>
std::vector<typename TPicture::PixelType>
GetPixels(const TPicture * picture)
{
  const auto * const begin = picture->GetBufferPointer();
  return { begin, begin + picture->GetBufferedRegion().GetNumberOfPixels() };
}

template <typename TPicture>
auto
GetPixels(const itk::SmartPointer<TPicture> & picture)
{
  return GetPixels(picture.GetPointer());
}

/** An image of these volumes at 4 and at each 2.5 later. */
inline itk::Image<PixelType, 4>::Pointer
MakeTimes(const std::vector<VolumeType::Pointer> & volumes)
{
  using ImageType = itk::Image<PixelType, 4>;
  const auto             size = volumes[0]->GetLargestPossibleRegion().GetSize();
  const auto             times = MakeImage<ImageType>({ { size[0], size[1], size[2], volumes.size() } });
  ImageType::SpacingType spacing(2.5);
  ImageType::PointType   origin(4.0);
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    spacing[axis] = volumes[0]->GetSpacing()[axis];
    origin[axis] = volumes[0]->GetOrigin()[axis];
  }
  times->SetSpacing(spacing);
  times->SetOrigin(origin);
  PixelType * begin = times->GetBufferPointer();
  for (const auto & volume : volumes)
  {
    const auto pixels = GetPixels(volume);
    begin = std::copy(pixels.begin(), pixels.end(), begin);
  }
  return times;
}

class ShearWarpMIPProgram : public testing::Test
{
protected:
  struct Result
  {
    int         status;
    std::string output;
    std::string messages;
    /** What is said of a picture that is too small for letters, as most here are; the messages are without it. */
    std::string note{};
  };

  void
  SetUp() override
  {
    m_Folder = fs::temp_directory_path() / ("shear-warp-mip-test-" + std::to_string(std::random_device()()));
    fs::create_directory(m_Folder);
    m_Volume = MakeVolume<PixelType>(10);
    this->WriteImage(m_Volume, "in.nrrd");
  }

  void
  TearDown() override
  {
    fs::remove_all(m_Folder);
  }

  /** \a before is what the shell does first, or a program that starts ours. */
  Result
  Run(const std::string & arguments, const std::string & before = "") const
  {
    const std::string command = "cd '" + m_Folder.string() + "' && " + before + " '" + GetProgram() + "' " + arguments +
                                " >stdout.txt 2>stderr.txt";
    const int status = std::system(command.c_str());
    Result    result{ WIFEXITED(status) ? WEXITSTATUS(status) : -1,
                   ReadText(m_Folder / "stdout.txt"),
                   ReadText(m_Folder / "stderr.txt") };
    const auto note = result.messages.find("shear-warp-mip: note: there are no letters: '");
    const auto end = result.messages.find('\n', note);
    if (note != std::string::npos && result.messages.compare(end - smallNote.size(), smallNote.size(), smallNote) == 0)
    {
      result.note = result.messages.substr(note, end - note);
      result.messages.erase(note, end + 1 - note);
    }
    fs::remove(m_Folder / "stdout.txt");
    fs::remove(m_Folder / "stderr.txt");
    return result;
  }

  /** Success, and \a messages to the letter. */
  void
  ExpectSuccess(const std::string & arguments, const std::string & messages = "") const
  {
    SCOPED_TRACE(arguments);
    const Result result = this->Run(arguments);
    EXPECT_EQ(result.status, 0);
    EXPECT_EQ(result.output, "");
    EXPECT_EQ(result.messages, messages);
  }

  /** Success, and a warning that has \a mention. */
  void
  ExpectWarning(const std::string & arguments, const std::string & mention) const
  {
    SCOPED_TRACE(arguments);
    const Result result = this->Run(arguments);
    EXPECT_EQ(result.status, 0);
    EXPECT_EQ(result.messages.find("shear-warp-mip: warning: "), 0u) << result.messages;
    EXPECT_NE(result.messages.find(mention), std::string::npos) << result.messages;
  }

  /** One line that has \a mention, and no file changed. */
  void
  ExpectFailure(const std::string & arguments, const std::string & mention, const std::string & before = "") const
  {
    SCOPED_TRACE(arguments);
    std::ofstream(m_Folder / "out.png") << "kept";
    const auto   contents = this->GetContents();
    const Result result = this->Run(arguments, before);
    EXPECT_EQ(result.status, 1);
    EXPECT_EQ(result.output, "");
    EXPECT_EQ(result.messages.find("shear-warp-mip: "), 0u) << result.messages;
    EXPECT_EQ(result.messages.find('\n'), result.messages.size() - 1) << result.messages;
    EXPECT_NE(result.messages.find(mention), std::string::npos) << result.messages;
    EXPECT_TRUE(contents == this->GetContents());
  }

  /** ExpectFailure() of \a begin with each of \a ends. */
  void
  ExpectFailures(const std::string & begin, const std::vector<std::string> & ends, const std::string & mention) const
  {
    for (const std::string & end : ends)
    {
      this->ExpectFailure(begin + end, mention);
    }
  }

  std::map<fs::path, std::string>
  GetContents() const
  {
    std::map<fs::path, std::string> contents;
    for (const auto & entry : fs::recursive_directory_iterator(m_Folder))
    {
      contents[entry.path()] = entry.is_regular_file() ? ReadText(entry.path()) : "";
    }
    return contents;
  }

  void
  Move(const std::string & from, const std::string & to) const
  {
    fs::create_directories((m_Folder / to).parent_path());
    fs::rename(m_Folder / from, m_Folder / to);
  }

  template <typename TImagePointer>
  void
  WriteImage(const TImagePointer & image, const std::string & name, bool isCompressed = false) const
  {
    itk::WriteImage(&*image, this->GetPath(name), isCompressed);
  }

  void
  WriteTransforms(const std::string & name, const std::vector<const itk::Object *> & transforms) const
  {
    const auto writer = itk::TransformFileWriterTemplate<double>::New();
    for (const itk::Object * transform : transforms)
    {
      writer->AddTransform(transform);
    }
    writer->SetFileName(this->GetPath(name));
    writer->Update();
  }

  template <typename TImage = PictureType>
  typename TImage::Pointer
  Read(const std::string & name) const
  {
    return itk::ReadImage<TImage>(this->GetPath(name));
  }

  template <typename TImage = PictureType>
  std::vector<typename TImage::PixelType>
  ReadPixels(const std::string & name) const
  {
    return GetPixels(this->Read<TImage>(name));
  }

  std::string
  GetPath(const std::string & name) const
  {
    return (m_Folder / name).string();
  }

  ViewTransformType::Pointer
  MakeTransform(Direction direction, double azimuth = 0.0, double elevation = 0.0) const
  {
    return itk::ShearWarpMIPView::MakeTransform(m_Volume, direction, azimuth, elevation);
  }

  PictureType::Pointer
  Project(
    const itk::Transform<double, 3, 3> *      transform,
    const std::function<void(FilterType &)> & setUp = [](FilterType &) {}) const
  {
    const auto filter = FilterType::New();
    filter->SetInput(m_Volume);
    filter->SetTransform(transform);
    setUp(*filter);
    filter->Update();
    return filter->GetOutput();
  }

  void
  ExpectPicture(const std::string & name, const PictureType * expected) const
  {
    SCOPED_TRACE(name);
    const auto picture = this->Read(name);
    EXPECT_EQ(picture->GetBufferedRegion(), expected->GetBufferedRegion());
    for (unsigned int axis = 0; axis < 2; ++axis)
    {
      // NIfTI has floats
      EXPECT_NEAR(picture->GetSpacing()[axis], expected->GetSpacing()[axis], 1e-6);
      EXPECT_NEAR(picture->GetOrigin()[axis], expected->GetOrigin()[axis], 1e-5);
    }
    EXPECT_EQ(GetPixels(picture.GetPointer()), GetPixels(expected));
  }

  template <typename TPixel>
  void
  ExpectPixelTypeKept()
  {
    using ImageType = itk::Image<TPixel, 3>;
    const auto volume = MakeVolume<TPixel>(20);
    this->WriteImage(volume, "typed.nrrd");
    this->ExpectSuccess("typed.nrrd out.mha");
    const auto filter = itk::ShearWarpMIPImageFilter<ImageType>::New();
    filter->SetInput(volume);
    filter->SetTransform(this->MakeTransform(Direction::Anterior));
    filter->Update();

    const auto reader = itk::ImageFileReader<itk::Image<TPixel, 2>>::New();
    reader->SetFileName(this->GetPath("out.mha"));
    reader->Update();
    const std::size_t bytes = reader->GetImageIO()->GetComponentSize();
    EXPECT_EQ(bytes, sizeof(TPixel));
    EXPECT_EQ(GetPixels(reader->GetOutput()), GetPixels(filter->GetOutput()));
  }

  /** Writes an image that is 0 but for a voxel at the left, anterior, superior. */
  void
  WriteLandmark() const
  {
    const auto landmark = MakeImage<VolumeType>({ { 15, 15, 15 } });
    landmark->SetPixel({ { 12, 3, 11 } }, 1000);
    this->WriteImage(landmark, "landmark.nrrd");
  }

  static std::string
  FindLandmark(const std::vector<PixelType> & pixels, std::size_t width)
  {
    const auto        brightest = std::max_element(pixels.begin(), pixels.end()) - pixels.begin();
    const std::size_t height = pixels.size() / width;
    const std::string row = 2 * (brightest / width) < height ? "top " : "bottom ";
    return row + (2 * (brightest % width) < width ? "left" : "right");
  }

  /** Rewrites a file by what \a change makes of its bytes, and takes that back after \a check. */
  void
  WithChangedFile(const std::string &                                     name,
                  const std::function<std::string(const std::string &)> & change,
                  const std::function<void()> &                           check) const
  {
    const std::string bytes = ReadText(m_Folder / name);
    std::ofstream(m_Folder / name, std::ios::binary) << change(bytes);
    check();
    std::ofstream(m_Folder / name, std::ios::binary) << bytes;
  }

  /** Keeps only so many bytes of a file until after \a check. */
  void
  WithCutFile(const std::string & name, std::size_t kept, const std::function<void()> & check) const
  {
    SCOPED_TRACE(kept);
    this->WithChangedFile(name, [kept](const std::string & bytes) { return bytes.substr(0, kept); }, check);
  }

  /** That \a input is refused without the end of the file \a name. */
  void
  ExpectCutFileRefused(const std::string & input, const std::string & name, std::size_t kept) const
  {
    this->WithCutFile(
      name, kept, [&] { this->ExpectFailure(input + " out.png", '\'' + name + "' is damaged or incomplete"); });
  }

  /** Writes dicom/PREFIX0.dcm and so on, slices at the \a positions in mm. */
  template <typename TPixel = PixelType>
  void
  WriteDICOMSeries(const std::string &         uid,
                   const std::string &         prefix,
                   const std::vector<double> & positions,
                   itk::SizeValueType          width = 8,
                   bool                        isCoronal = false,
                   const Tags &                tags = {}) const
  {
    using SliceType = itk::Image<TPixel, 3>;
    fs::create_directories(m_Folder / "dicom");
    for (std::size_t slice = 0; slice < positions.size(); ++slice)
    {
      const auto image = MakeImage<SliceType>({ { width, 8, 1 } }, { 1.0, 1.0, 2.0 }, { 0.0, 0.0, positions[slice] });
      if (isCoronal)
      {
        typename SliceType::DirectionType direction;
        direction.Fill(0.0);
        direction[0][0] = direction[1][2] = 1.0;
        direction[2][1] = -1.0;
        image->SetDirection(direction);
      }
      image->FillBuffer(TPixel(static_cast<typename itk::NumericTraits<TPixel>::ValueType>(100 + slice)));

      Tags all = tags;
      all.insert({ { "0008|0060", "MR" },
                   { "0008|0018", uid + "." + std::to_string(slice + 1) },
                   { "0020|000d", "1.2.3" },
                   { "0020|000e", uid },
                   { "0020|0013", std::to_string(slice + 1) } });
      for (const auto & [tag, value] : all)
      {
        itk::EncapsulateMetaData<std::string>(image->GetMetaDataDictionary(), tag, value);
      }
      const auto io = itk::GDCMImageIO::New();
      io->KeepOriginalUIDOn();
      const auto writer = itk::ImageFileWriter<SliceType>::New();
      writer->SetImageIO(io);
      writer->SetInput(image);
      writer->SetFileName(this->GetPath("dicom/" + prefix + std::to_string(slice) + ".dcm"));
      writer->Update();
    }
  }

  fs::path            m_Folder;
  VolumeType::Pointer m_Volume;
};
} // namespace ShearWarpMIPProgramTest

#endif
