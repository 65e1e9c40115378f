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

#include <gtest/gtest.h>

#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <sstream>

namespace ShearWarpMIPProgramTest
{
namespace fs = std::filesystem;
using Direction = itk::ShearWarpMIPViewEnums::Direction;
using PixelType = short;
using VolumeType = itk::Image<PixelType, 3>;
using PictureType = itk::Image<PixelType, 2>;
using FilterType = itk::ShearWarpMIPImageFilter<VolumeType>;
using ViewTransformType = itk::ShearWarpMIPView::TransformType;

const std::string smallNote = "' has less than 48 pixels along one side";

inline std::string
ReadText(const fs::path & path)
{
  std::ifstream      file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

template <typename TPixel>
typename itk::Image<TPixel, 3>::Pointer
MakeVolume(TPixel lowest)
{
  const auto   volume = itk::Image<TPixel, 3>::New();
  const double spacing[] = { 0.7, 0.9, 1.3 };
  const double origin[] = { -40.0, 12.5, 3.0 };
  volume->SetRegions(itk::Size<3>{ { 20, 18, 12 } });
  volume->SetSpacing(spacing);
  volume->SetOrigin(origin);
  volume->Allocate();
  itk::ImageRegionIteratorWithIndex<itk::Image<TPixel, 3>> it(volume, volume->GetBufferedRegion());
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
    this->WriteImage<VolumeType>(m_Volume, "in.nrrd");
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
    const std::string command = "cd '" + m_Folder.string() + "' && " + before + " '" SHEAR_WARP_MIP_PROGRAM "' " +
                                arguments + " >stdout.txt 2>stderr.txt";
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

  void
  ExpectSuccess(const std::string & arguments) const
  {
    SCOPED_TRACE(arguments);
    const Result result = this->Run(arguments);
    EXPECT_EQ(result.status, 0);
    EXPECT_EQ(result.output, "");
    EXPECT_EQ(result.messages, "");
  }

  /** Success, and \a messages to the letter. */
  void
  ExpectMessages(const std::string & arguments, const std::string & messages) const
  {
    SCOPED_TRACE(arguments);
    const Result result = this->Run(arguments);
    EXPECT_EQ(result.status, 0);
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

  template <typename TImage>
  void
  WriteImage(const TImage * image, const std::string & name) const
  {
    itk::WriteImage(image, this->GetPath(name));
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
    this->WriteImage<ImageType>(volume, "typed.nrrd");
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
    this->WriteImage<VolumeType>(landmark, "landmark.nrrd");
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

  /** Writes dicom/PREFIX0.dcm and so on, slices at the \a positions in mm. */
  template <typename TPixel = PixelType>
  void
  WriteDICOMSeries(const std::string &                        uid,
                   const std::string &                        prefix,
                   const std::vector<double> &                positions,
                   itk::SizeValueType                         width = 8,
                   bool                                       isCoronal = false,
                   const std::map<std::string, std::string> & tags = {}) const
  {
    using SliceType = itk::Image<TPixel, 3>;
    fs::create_directories(m_Folder / "dicom");
    for (std::size_t slice = 0; slice < positions.size(); ++slice)
    {
      const auto image = SliceType::New();
      image->SetRegions(itk::Size<3>{ { width, 8, 1 } });
      const double spacing[] = { 1.0, 1.0, 2.0 };
      const double origin[] = { 0.0, 0.0, positions[slice] };
      image->SetSpacing(spacing);
      image->SetOrigin(origin);
      if (isCoronal)
      {
        typename SliceType::DirectionType direction;
        direction.Fill(0.0);
        direction[0][0] = direction[1][2] = 1.0;
        direction[2][1] = -1.0;
        image->SetDirection(direction);
      }
      image->Allocate();
      image->FillBuffer(TPixel(static_cast<typename itk::NumericTraits<TPixel>::ValueType>(100 + slice)));

      auto &     dictionary = image->GetMetaDataDictionary();
      const auto io = itk::GDCMImageIO::New();
      io->KeepOriginalUIDOn();
      itk::EncapsulateMetaData<std::string>(dictionary, "0008|0060", "MR");
      itk::EncapsulateMetaData<std::string>(dictionary, "0008|0018", uid + "." + std::to_string(slice + 1));
      itk::EncapsulateMetaData<std::string>(dictionary, "0020|000d", "1.2.3");
      itk::EncapsulateMetaData<std::string>(dictionary, "0020|000e", uid);
      itk::EncapsulateMetaData<std::string>(dictionary, "0020|0013", std::to_string(slice + 1));
      for (const auto & [tag, value] : tags)
      {
        itk::EncapsulateMetaData<std::string>(dictionary, tag, value);
      }
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
