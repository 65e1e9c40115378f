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

#include "itkRGBPixel.h"
#include "itkShearWarpFactorization.h"
#include "itkVectorImage.h"

#include <cmath>
#include <cstring>
#include <set>

namespace
{
using namespace ShearWarpMIPProgramTest;
using MaskType = itk::Image<unsigned char, 3>;
using DepthType = itk::Image<float, 2>;
using ColourType = itk::Image<itk::RGBPixel<unsigned char>, 2>;
using ModeEnum = FilterType::ModeEnum;

bool
HaveSameDepths(const std::vector<float> & a, const std::vector<float> & b)
{
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](float x, float y) {
    return x == y || (std::isnan(x) && std::isnan(y));
  });
}

class ShearWarpMIPProgramProjection : public ShearWarpMIPProgram
{
protected:
  /** Expects that the options do what \a setUp does to the filter, which must make a difference, with \a messages. */
  void
  ExpectSame(const std::string &                       arguments,
             const std::function<void(FilterType &)> & setUp,
             const std::string &                       messages = "") const
  {
    SCOPED_TRACE(arguments);
    const auto transform = this->MakeTransform(Direction::Anterior, 20.0, 10.0);
    this->ExpectSuccess("in.nrrd out.nrrd --azimuth 20 --elevation 10 " + arguments, messages);
    const auto expected = this->Project(transform, setUp);
    this->ExpectPicture("out.nrrd", expected);
    EXPECT_NE(GetPixels(expected), GetPixels(this->Project(transform)));
  }

  /** A mask on the volume's grid, of values 0, \a scale, 2 \a scale. */
  template <typename TPixel>
  typename itk::Image<TPixel, 3>::Pointer
  MakeMask(TPixel scale = 1) const
  {
    const auto                                               mask = MakeImageLike<itk::Image<TPixel, 3>>(m_Volume);
    itk::ImageRegionIteratorWithIndex<itk::Image<TPixel, 3>> it(mask, mask->GetBufferedRegion());
    for (; !it.IsAtEnd(); ++it)
    {
      it.Set(static_cast<TPixel>(scale * static_cast<TPixel>((it.GetIndex()[0] / 3 + it.GetIndex()[1] / 4) % 3)));
    }
    return mask;
  }

  /** Depths of the image's front and back. */
  std::pair<double, double>
  GetDepthBounds(const itk::Transform<double, 3, 3> * transform) const
  {
    itk::Point<double, 3> lower;
    itk::Point<double, 3> upper;
    itk::ShearWarpFactorization::ComputeViewBounds(transform, m_Volume, lower, upper);
    return { lower[2], upper[2] };
  }

  /** Makes volumes that differ. */
  void
  MakeParts(unsigned int count)
  {
    m_Parts.clear();
    for (unsigned int part = 0; part < count; ++part)
    {
      m_Parts.push_back(MakeImageLike<VolumeType>(m_Volume));
      const auto pixels = GetPixels(m_Volume);
      std::transform(pixels.begin(), pixels.end(), m_Parts.back()->GetBufferPointer(), [part](PixelType value) {
        return static_cast<PixelType>((value * (part + 1)) % 97 + 100 * part);
      });
    }
  }

  template <typename TComponent = PixelType>
  void
  WriteComponents(const std::string & name, unsigned int components)
  {
    this->MakeParts(components);
    const auto image = MakeImageLike<itk::VectorImage<TComponent, 3>>(m_Volume, components);
    for (unsigned int component = 0; component < components; ++component)
    {
      const auto pixels = GetPixels(m_Parts[component]);
      for (std::size_t n = 0; n < pixels.size(); ++n)
      {
        image->GetBufferPointer()[n * components + component] = static_cast<TComponent>(pixels[n]);
      }
    }
    this->WriteImage(image, name);
  }

  void
  WriteTimes(const std::string & name, unsigned int count)
  {
    this->MakeParts(count);
    this->WriteImage(MakeTimes(m_Parts), name);
  }

  /** One component of each pixel of a picture. */
  std::vector<PixelType>
  ReadComponent(const std::string & name, unsigned int component) const
  {
    const auto             picture = this->Read<itk::VectorImage<PixelType, 2>>(name);
    const std::size_t      components = picture->GetNumberOfComponentsPerPixel();
    std::vector<PixelType> values;
    for (std::size_t n = component; n < components * picture->GetBufferedRegion().GetNumberOfPixels(); n += components)
    {
      values.push_back(picture->GetBufferPointer()[n]);
    }
    return values;
  }

  PictureType::Pointer
  ProjectPart(unsigned int part) const
  {
    return this->Project(this->MakeTransform(Direction::Anterior),
                         [&](FilterType & filter) { filter.SetInput(m_Parts[part]); });
  }

  std::vector<VolumeType::Pointer> m_Parts;
};

TEST_F(ShearWarpMIPProgramProjection, TakesMode)
{
  this->ExpectSame("--mode minimum", [](FilterType & filter) { filter.SetMode(ModeEnum::Minimum); });
  this->ExpectSame("--mode mean", [](FilterType & filter) { filter.SetMode(ModeEnum::Mean); });
  this->ExpectSame("--mode average", [](FilterType & filter) { filter.SetMode(ModeEnum::Mean); });
  this->ExpectSuccess("in.nrrd same.nrrd --mode maximum");
  this->ExpectPicture("same.nrrd", this->Project(this->MakeTransform(Direction::Anterior)));

  m_Volume = MakeVolume<PixelType>(-70);
  this->WriteImage(m_Volume, "signed.nrrd");
  this->ExpectSuccess("signed.nrrd out.nrrd --mode absolute-maximum");
  const auto expected = this->Project(this->MakeTransform(Direction::Anterior), [](FilterType & filter) {
    filter.SetMode(ModeEnum::AbsoluteMaximum);
    filter.SetDefaultPixelValue(-70);
  });
  this->ExpectPicture("out.nrrd", expected);
  const auto pixels = GetPixels(expected);
  EXPECT_LT(*std::min_element(pixels.begin(), pixels.end()), 0);

  this->ExpectFailure("in.nrrd out.png --mode median", "--mode");
}

TEST_F(ShearWarpMIPProgramProjection, TakesInterpolation)
{
  using InterpolationEnum = FilterType::InterpolationEnum;
  this->ExpectSame("--interpolation nearest",
                   [](FilterType & filter) { filter.SetInterpolation(InterpolationEnum::Nearest); });
  // labels 1 and 3, and what is beside them
  const auto volume = itk::Image<unsigned char, 3>::New();
  volume->SetRegions(itk::Size<3>{ { 20, 16, 16 } });
  volume->Allocate(true);
  std::fill_n(volume->GetBufferPointer() + 1600, 1000, static_cast<unsigned char>(1));
  std::fill_n(volume->GetBufferPointer() + 3000, 1000, static_cast<unsigned char>(3));
  this->WriteImage(volume, "labels.nrrd");
  const std::string view = "labels.nrrd out.nrrd --azimuth 33 --elevation 21";
  const std::string note = "'labels.nrrd' looks like labels: --interpolation nearest shows only these values";
  const auto        getValues = [this] {
    const auto pixels = this->ReadPixels<itk::Image<unsigned char, 2>>("out.nrrd");
    return std::set<unsigned char>(pixels.begin(), pixels.end());
  };
  EXPECT_NE(this->Run(view).messages.find(note), std::string::npos);
  EXPECT_EQ(getValues(), (std::set<unsigned char>{ 0, 1, 2, 3 }));
  EXPECT_EQ(this->Run(view + " --interpolation nearest").messages.find("labels"), std::string::npos);
  EXPECT_EQ(getValues(), (std::set<unsigned char>{ 0, 1, 3 }));
  // a CT of few values
  const auto negative = MakeImageLike<VolumeType>(m_Volume);
  negative->SetRegions(volume->GetLargestPossibleRegion());
  negative->Allocate(true);
  std::copy_n(volume->GetBufferPointer(), volume->GetPixelContainer()->Size(), negative->GetBufferPointer());
  negative->GetBufferPointer()[7] = -1000;
  this->WriteImage(negative, "negative.nrrd");
  this->ExpectSuccess("negative.nrrd out.nrrd");
  // what fails is not advised
  for (const std::string option : { "--mode mean", "--exact", "--oversampling 2", "--attenuation 0.1" })
  {
    this->ExpectSuccess("labels.nrrd out.nrrd " + option);
  }
  this->ExpectFailure("labels.nrrd out.png --background 1000", "--background 1000 is not a value");
  // one label is a mask
  std::replace(volume->GetBufferPointer(), volume->GetBufferPointer() + volume->GetPixelContainer()->Size(), 3, 0);
  this->WriteImage(volume, "labels.nrrd");
  EXPECT_EQ(this->Run(view).messages.find("labels"), std::string::npos);
}

TEST_F(ShearWarpMIPProgramProjection, TakesSlab)
{
  this->ExpectSame("--slab -3 2.5", [](FilterType & filter) {
    filter.SetSlabNear(-3.0);
    filter.SetSlabFar(2.5);
  });
  this->ExpectSame("--slab 1 inf", [](FilterType & filter) { filter.SetSlabNear(1.0); });
  this->ExpectSame("--slab -inf 1", [](FilterType & filter) { filter.SetSlabFar(1.0); });
  this->ExpectSame("--slab -inf -.5", [](FilterType & filter) { filter.SetSlabFar(-0.5); });
  this->ExpectSame("--slab=-INFINITY -.5", [](FilterType & filter) { filter.SetSlabFar(-0.5); });
  this->ExpectFailure("in.nrrd out.png --slab 3 -inf", "--slab: NEAR must not be greater than FAR");
  this->ExpectFailure("in.nrrd out.png --slab -1 -nan", "--slab: '-nan' is not a number");
  this->ExpectFailure("in.nrrd out.png --slab 3 2", "--slab: NEAR must not be greater than FAR");
  this->ExpectFailures(
    "in.nrrd out.png --slab ", { "inf inf", "-inf -inf" }, "NEAR cannot be inf, and FAR cannot be -inf");
  this->ExpectFailures("in.nrrd out.png --slab ", { "nan 2", "1 thick", "2" }, "--slab");
}

TEST_F(ShearWarpMIPProgramProjection, SlidesSlab)
{
  const auto transform = this->MakeTransform(Direction::Left, 20.0);
  const auto [front, back] = this->GetDepthBounds(transform);
  this->ExpectSuccess("in.nrrd out.nrrd --view left --azimuth 20 --sliding-slab 3 2");
  const auto stack = this->Read<VolumeType>("out.nrrd");
  const auto count = stack->GetBufferedRegion().GetSize(2);
  // the last begins before the back and reaches it
  EXPECT_LT(front + 2.0 * static_cast<double>(count - 1), back);
  EXPECT_LT(front + 2.0 * static_cast<double>(count - 2) + 3.0, back);
  EXPECT_GE(front + 2.0 * static_cast<double>(count - 1) + 3.0, back);
  EXPECT_EQ(stack->GetSpacing()[2], 2.0);
  EXPECT_NEAR(stack->GetOrigin()[2], front + 1.5, 1e-9);
  const auto whole = this->Project(transform);
  EXPECT_NEAR(stack->GetOrigin()[0], whole->GetOrigin()[0], 1e-9);
  for (itk::SizeValueType n = 0; n < count; ++n)
  {
    const double       near = front + 2.0 * static_cast<double>(n);
    const auto         expected = GetPixels(this->Project(transform, [near](FilterType & filter) {
      filter.SetSlabNear(near);
      filter.SetSlabFar(near + 3.0);
    }));
    const auto * const frame = stack->GetBufferPointer() + n * expected.size();
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), frame)) << n;
  }

  this->ExpectSuccess("in.nrrd slabs.png --view left --azimuth 20 --sliding-slab 3 2");
  EXPECT_TRUE(fs::exists(m_Folder / "slabs-000.png"));
  EXPECT_EQ(this->GetContents().size(), count + 2);
  // one that holds all
  this->ExpectSuccess("in.nrrd one.nrrd --sliding-slab 100 1");
  EXPECT_EQ(this->ReadPixels<VolumeType>("one.nrrd"),
            GetPixels(this->Project(this->MakeTransform(Direction::Anterior))));

  // no slab lies behind the image, whether or not there are gaps
  const auto [near, far] = this->GetDepthBounds(this->MakeTransform(Direction::Anterior));
  for (const std::string slabs : { "2 7", "2 8.1", "7 2", "5.4 5.4", "1 17" })
  {
    this->ExpectSuccess("in.nrrd one.nrrd --sliding-slab " + slabs);
    double thickness = 0.0;
    double step = 0.0;
    std::istringstream(slabs) >> thickness >> step;
    const double last =
      near + step * static_cast<double>(this->Read<VolumeType>("one.nrrd")->GetBufferedRegion().GetSize(2) - 1);
    EXPECT_LT(last, far - 1e-6) << slabs;
    EXPECT_GT(last + std::max(thickness, step), far - 1e-6) << slabs;
    EXPECT_LT(last - step + thickness, far - 1e-6) << slabs;
  }

  this->ExpectFailures("in.nrrd out.png --sliding-slab ", { "0 1", "5 -1", "5" }, "--sliding-slab");
  this->ExpectFailure("in.nrrd out.png --sliding-slab 5 1e-9", "at most 65535");
  this->ExpectFailure("in.nrrd out.png --sliding-slab 5 1 --slab 0 1", "--slab");
}

TEST_F(ShearWarpMIPProgramProjection, TakesLocalMaximum)
{
  this->ExpectSame("--local-maximum 60", [](FilterType & filter) {
    filter.LocalMaximumOn();
    filter.SetLocalMaximumThreshold(60);
  });
  this->ExpectFailure("in.nrrd out.png --local-maximum 40000", "--local-maximum 40000 is not a value of the image's");
  this->ExpectFailures("in.nrrd out.png --local-maximum ", { "0.5", "nan", "" }, "--local-maximum");
}

TEST_F(ShearWarpMIPProgramProjection, IsExact)
{
  this->ExpectSame("--exact", [](FilterType & filter) { filter.ExactOn(); });
  this->ExpectSame("--exact --mode minimum --slab -9 4.5", [](FilterType & filter) {
    filter.ExactOn();
    filter.SetMode(FilterType::ModeEnum::Minimum);
    filter.SetSlabNear(-9);
    filter.SetSlabFar(4.5);
  });
  this->ExpectFailures(
    "in.nrrd out.png --exact ",
    { "--oversampling 2", "--local-maximum 60", "--mask in.nrrd", "--attenuation 0.1", "--exact=maybe" },
    "--exact");
}

TEST_F(ShearWarpMIPProgramProjection, TakesMask)
{
  const auto bytes = this->MakeMask<unsigned char>();
  this->WriteImage(bytes, "mask.nrrd");
  this->WriteImage(bytes, "mask.nii.gz");
  const auto masked = [&](FilterType & filter) { filter.SetMaskImage(bytes); };
  const auto labelled = [&](FilterType & filter) {
    filter.SetMaskImage(bytes);
    filter.SetMaskLabel(2);
  };
  this->ExpectSame("--mask mask.nrrd", masked);
  this->ExpectSame("--mask mask.nrrd --mask-label 2", labelled);
  // NIfTI rounds the grid
  this->ExpectSame("--mask mask.nii.gz --mask-label 2", labelled);

  // of values that a byte does not hold: 256 would be 0, and 512 too
  this->WriteImage(this->MakeMask<int>(256), "large.nrrd");
  this->ExpectSame("--mask large.nrrd", masked);
  this->ExpectSame("--mask large.nrrd --mask-label 512", labelled);
  this->WriteImage(this->MakeMask<short>(-1), "negative.nrrd");
  this->ExpectSame("--mask negative.nrrd", masked);

  this->ExpectSuccess("in.nrrd nothing.nrrd --mask large.nrrd --mask-label 1",
                      "shear-warp-mip: warning: no voxel is in the mask 'large.nrrd'\n");
  bytes->FillBuffer(2);
  this->WriteImage(bytes, "all.nrrd");
  for (const std::string arguments : { "", " --mask-label 2" })
  {
    this->ExpectSuccess("in.nrrd out.nrrd --mask all.nrrd" + arguments,
                        "shear-warp-mip: warning: all voxels are in the mask 'all.nrrd'\n");
  }
  const auto pixels = this->ReadPixels("nothing.nrrd");
  EXPECT_EQ(std::count(pixels.begin(), pixels.end(), 0), static_cast<std::ptrdiff_t>(pixels.size()));
}

TEST_F(ShearWarpMIPProgramProjection, RemovesLabels)
{
  // labels 0 to 3; what remains, at 1
  const auto write = [&](auto scale, const std::string & name) {
    using LabelType = decltype(scale);
    const auto labels = this->MakeMask<LabelType>(scale);
    labels->SetPixel({ { 0, 0, 0 } }, static_cast<LabelType>(3 * scale));
    this->WriteImage(labels, name);
  };
  const auto remaining = [&](const std::vector<unsigned char> & values) {
    const auto mask = this->MakeMask<unsigned char>();
    mask->SetPixel({ { 0, 0, 0 } }, 3);
    std::for_each(mask->GetBufferPointer(), mask->GetBufferPointer() + GetPixels(mask).size(), [&](auto & pixel) {
      pixel = std::count(values.begin(), values.end(), pixel) > 0 ? 1 : 0;
    });
    return [mask](FilterType & filter) { filter.SetMaskImage(mask); };
  };
  write(static_cast<unsigned char>(1), "mask.nrrd");
  write(256, "large.nrrd");
  write(static_cast<short>(-1), "negative.nrrd");
  this->ExpectSame("--mask mask.nrrd --remove-label 2", remaining({ 0, 1, 3 }));
  this->ExpectSame("--mask mask.nrrd --remove-label 1 2", remaining({ 0, 3 }));
  this->ExpectSame("--remove-label 1,2 3 --mask mask.nrrd", remaining({ 0 }));
  this->ExpectSame("--mask large.nrrd --remove-label 256 --remove-label 512", remaining({ 0, 3 }));
  // one that is listed before INPUT and OUTPUT, twice
  this->ExpectSuccess("--mask mask.nrrd --remove-label 3 3 in.nrrd out.nrrd");

  this->ExpectSuccess("in.nrrd out.nrrd --mask mask.nrrd --remove-label 7 2 5",
                      "shear-warp-mip: warning: no voxel of the mask 'mask.nrrd' has the label 5\n"
                      "shear-warp-mip: warning: no voxel of the mask 'mask.nrrd' has the label 7\n");
  // negative ones are no labels, nor do they become such
  const Result negative = this->Run("in.nrrd all.nrrd --mask negative.nrrd --remove-label 255 1");
  EXPECT_EQ(std::count(negative.messages.begin(), negative.messages.end(), '\n'), 2) << negative.messages;
  this->ExpectPicture("all.nrrd", this->Project(this->MakeTransform(Direction::Anterior)));

  this->ExpectFailure("in.nrrd out.png --remove-label 3", "--mask");
  this->ExpectFailure("in.nrrd out.png --mask mask.nrrd --mask-label 1 --remove-label 3", "--mask-label");
  this->ExpectFailures("in.nrrd out.png --mask mask.nrrd --remove-label ",
                       { "", "0", "-1", "1.5", "one", "nan", "1 0", "99999999999999999999" },
                       "--remove-label");
}

TEST_F(ShearWarpMIPProgramProjection, RefusesWrongMask)
{
  const auto mask = this->MakeMask<unsigned char>();
  this->WriteImage(mask, "mask.nrrd");
  this->ExpectFailure("in.nrrd out.png --mask missing.nrrd", "'missing.nrrd' does not exist");
  this->ExpectFailures("in.nrrd out.png --mask mask.nrrd --mask-label ",
                       { "0", "-1", "1.5", "one", "nan", "99999999999999999999" },
                       "--mask-label");
  this->WriteImage(this->MakeMask<float>(), "float.nrrd");
  this->ExpectFailure("in.nrrd out.png --mask float.nrrd", "'float.nrrd' must have whole numbers");
  this->WriteTimes("times.nrrd", 2);
  this->ExpectFailure("in.nrrd out.png --mask times.nrrd", "one point in time");
  this->WriteComponents("vector.nrrd", 3);
  this->ExpectFailure("in.nrrd out.png --mask vector.nrrd", "one component");

  mask->SetSpacing(m_Volume->GetSpacing() * 1.01);
  this->WriteImage(mask, "wide.nrrd");
  this->ExpectFailure("in.nrrd out.png --mask wide.nrrd", "'wide.nrrd' is not on INPUT's grid: a corner is");
  this->WriteImage(MakeImage<MaskType>({ { 20, 18, 11 } }), "small.nrrd");
  this->ExpectFailure("in.nrrd out.png --mask small.nrrd", "it has [20, 18, 11] voxels instead of [20, 18, 12]");
  this->WithCutFile("mask.nrrd", fs::file_size(m_Folder / "mask.nrrd") - 1000, [this] {
    this->ExpectFailure("in.nrrd out.png --mask mask.nrrd", "mask.nrrd");
  });
}

TEST_F(ShearWarpMIPProgramProjection, TakesCrop)
{
  const auto cropped = [](FilterType & filter) {
    filter.SetCropLower(itk::Point<double, 3>(std::array<double, 3>{ -36.0, 14.0, 5.0 }.data()));
    filter.SetCropUpper(itk::Point<double, 3>(std::array<double, 3>{ -30.0, 22.0, 12.5 }.data()));
  };
  const auto croppedOnce = [](FilterType & filter) {
    auto upper = filter.GetCropUpper();
    upper[0] = -30.0;
    filter.SetCropUpper(upper);
  };
  this->ExpectSame("--crop -36,-30,14,22,5,12.5", cropped);
  this->ExpectSame("--crop -36 -30 14 22 5 12.5", cropped);
  this->ExpectSame("--crop -inf,-30,-inf,inf,-inf,inf", croppedOnce);
  this->ExpectSame("--crop -inf -30 -inf inf -inf inf", croppedOnce);
  this->ExpectFailures("in.nrrd out.png --crop ", { "1,2,3,4,5", "1,2,3,4,5,6,7", "1,2,3,4,5,nan" }, "--crop");
  this->ExpectFailure("in.nrrd out.png --crop 1,2,4,3,5,6", "--crop: X0, Y0 and Z0 must not be greater");
}

TEST_F(ShearWarpMIPProgramProjection, TakesAttenuation)
{
  this->ExpectSame("--attenuation 0.05", [](FilterType & filter) { filter.SetDepthAttenuation(0.05); });
  this->ExpectSame(
    "--attenuation 1e300",
    [](FilterType & filter) { filter.SetDepthAttenuation(1e300); },
    "shear-warp-mip: warning: there is only background in the picture: it has only the value 0\n");
  this->ExpectFailures("in.nrrd out.png --attenuation ", { "-0.1", "nan", "inf", "fast" }, "ttenuation");
}

TEST_F(ShearWarpMIPProgramProjection, WritesDepth)
{
  // a slab leaves pixels without a depth
  const auto transform = this->MakeTransform(Direction::Anterior, 30.0);
  const auto filter = FilterType::New();
  filter->SetInput(m_Volume);
  filter->SetTransform(transform);
  filter->SetSlabNear(2.0);
  filter->ComputeDepthOn();
  filter->Update();
  const auto expected = GetPixels(filter->GetDepthOutput());
  const auto isNothing = [](float depth) { return std::isnan(depth); };
  EXPECT_GT(std::count_if(expected.begin(), expected.end(), isNothing), 0);
  EXPECT_GT(std::count_if(expected.begin(), expected.end(), std::not_fn(isNothing)), 0);
  for (const std::string name : { "depth.mha", "depth.nrrd", "depth.nii", "depth.nii.gz" })
  {
    SCOPED_TRACE(name);
    this->ExpectSuccess("in.nrrd out.nrrd --azimuth 30 --slab 2 inf --depth " + name);
    this->ExpectPicture("out.nrrd", filter->GetOutput());
    const auto depth = this->Read<DepthType>(name);
    EXPECT_NEAR(depth->GetOrigin()[0], filter->GetOutput()->GetOrigin()[0], 1e-5);
    EXPECT_NEAR(depth->GetSpacing()[1], filter->GetOutput()->GetSpacing()[1], 1e-6);
    EXPECT_EQ(depth->GetBufferedRegion(), filter->GetOutput()->GetBufferedRegion());
    if (name.find(".nii") == std::string::npos)
    {
      EXPECT_TRUE(HaveSameDepths(GetPixels(depth), expected));
    }
  }
  // ITK's reader makes not-a-number of NIfTI 0
  const std::string  bytes = ReadText(m_Folder / "depth.nii");
  std::vector<float> depths(expected.size());
  std::memcpy(depths.data(), bytes.data() + bytes.size() - 4 * depths.size(), 4 * depths.size());
  EXPECT_TRUE(HaveSameDepths(depths, expected));

  this->ExpectSuccess("in.nrrd out.png --frames 3 --depth turn.nrrd");
  EXPECT_EQ((this->Read<itk::Image<float, 3>>("turn.nrrd")->GetBufferedRegion().GetSize(2)), 3u);

  this->ExpectFailure("in.nrrd out.nrrd --depth out.nrrd", "'out.nrrd' would be written twice");
  this->ExpectFailure("in.nrrd out.png --depth nowhere/depth.nrrd", "nowhere/depth.nrrd");
  fs::create_directory(m_Folder / "folder.nrrd");
  this->ExpectFailure("in.nrrd out.png --depth folder.nrrd", "folder.nrrd");
}

TEST_F(ShearWarpMIPProgramProjection, ColoursByDepth)
{
  // equally bright voxels on a line away from the viewer and to the right, the last one dim, and no background
  const auto vessels = MakeImage<VolumeType>({ { 11, 11, 3 } });
  const auto mask = MakeImage<MaskType>({ { 11, 11, 3 } });
  for (itk::IndexValueType n = 0; n <= 10; n += 2)
  {
    vessels->SetPixel({ { n, n, 1 } }, n == 10 ? 40 : 100);
    mask->SetPixel({ { n, n, 1 } }, 1);
  }
  this->WriteImage(vessels, "vessels.nrrd");
  this->WriteImage(mask, "mask.nrrd");
  this->ExpectSuccess("vessels.nrrd out.png --mask mask.nrrd --window 0 100 --depth-colour colour.png");
  EXPECT_TRUE(fs::exists(m_Folder / "out.png"));
  const auto colour = this->Read<ColourType>("colour.png");
  ASSERT_EQ(colour->GetBufferedRegion().GetSize(), (itk::Size<2>{ { 11, 3 } }));
  ColourType::PixelType nothing;
  nothing.Fill(0);
  const auto expectNear = [&](itk::IndexValueType x, const std::array<int, 3> & expected, int tolerance = 4) {
    for (unsigned int component = 0; component < 3; ++component)
    {
      EXPECT_NEAR((colour->GetPixel({ { x, 1 } })[component]), expected[component], tolerance) << x << ' ' << component;
    }
  };
  expectNear(0, { 255, 0, 0 });
  expectNear(2, { 255, 191, 0 });
  expectNear(4, { 127, 255, 127 });
  expectNear(6, { 0, 191, 255 });
  expectNear(8, { 0, 0, 255 });
  expectNear(10, { 0, 0, 102 });
  // between them, and above, nothing
  expectNear(1, { 0, 0, 0 }, 0);
  EXPECT_EQ(colour->GetPixel({ { 0, 0 } }), nothing);

  this->ExpectSuccess("in.nrrd out.nrrd --frames 3 --depth-colour turn.png");
  EXPECT_TRUE(fs::exists(m_Folder / "turn-002.png"));
  // without differences of depth
  EXPECT_EQ(this->Run("in.nrrd out.nrrd --slab 1000 1001 --depth-colour empty.png").status, 0);
  const auto empty = this->ReadPixels<ColourType>("empty.png");
  EXPECT_EQ(std::count(empty.begin(), empty.end(), nothing), static_cast<std::ptrdiff_t>(empty.size()));

  this->ExpectFailure("in.nrrd out.nrrd --depth-colour depth.nrrd",
                      "--depth-colour: 'depth.nrrd' must have one of the extensions .png");
  this->ExpectFailure("in.nrrd out.png --depth-colour out.png", "'out.png' would be written twice");
}

TEST_F(ShearWarpMIPProgramProjection, WritesAllFilesOrNone)
{
  fs::create_directory(m_Folder / "turn-001.png");
  this->ExpectFailure("in.nrrd out.nrrd --frames 2 --depth depth.nrrd --depth-colour turn.png", "turn-001.png");
  // room for OUTPUT only
  std::ofstream(m_Folder / "depth.mha") << "kept";
  this->ExpectSuccess("in.nrrd small.mha --output-spacing 0.35");
  this->ExpectFailure(
    "in.nrrd small.mha --output-spacing 0.35 --depth depth.mha", "'depth.mha'", "trap '' XFSZ && ulimit -f 10 &&");
}

TEST_F(ShearWarpMIPProgramProjection, WritesInPlace)
{
  using InPlaceFilterType = itk::ShearWarpMIPImageFilter<VolumeType, VolumeType>;
  const auto transform = this->MakeTransform(Direction::Left, 20.0, 15.0);
  for (const bool hasSlab : { false, true })
  {
    const auto filter = InPlaceFilterType::New();
    filter->SetInput(m_Volume);
    filter->SetTransform(transform);
    if (hasSlab)
    {
      filter->SetSlabNear(-2.0);
      filter->SetSlabFar(3.0);
    }
    filter->ComputeDepthOn();
    filter->Update();
    const auto * expected = filter->GetOutput();
    for (const std::string name : { "out.mha", "out.nrrd", "out.nii", "out.nii.gz" })
    {
      SCOPED_TRACE(name);
      this->ExpectSuccess("in.nrrd " + name + " --view left --azimuth 20 --elevation 15 --in-place --depth depth.nrrd" +
                          (hasSlab ? " --slab -2 3" : ""));
      const auto slice = this->Read<VolumeType>(name);
      EXPECT_EQ(slice->GetBufferedRegion(), expected->GetBufferedRegion());
      EXPECT_EQ(GetPixels(slice), GetPixels(expected));
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        EXPECT_NEAR(slice->GetSpacing()[axis], expected->GetSpacing()[axis], 1e-5);
        EXPECT_NEAR(slice->GetOrigin()[axis], expected->GetOrigin()[axis], 1e-4);
        for (unsigned int row = 0; row < 3; ++row)
        {
          EXPECT_NEAR(slice->GetDirection()(row, axis), expected->GetDirection()(row, axis), 1e-5);
        }
      }
      const auto depth = this->Read<itk::Image<float, 3>>("depth.nrrd");
      EXPECT_LT((depth->GetOrigin() - expected->GetOrigin()).GetNorm(), 1e-6);
      EXPECT_TRUE(HaveSameDepths(GetPixels(depth), GetPixels(filter->GetDepthOutput())));
    }
  }
  this->ExpectFailure("in.nrrd out.nrrd --in-place --frames 3", "--in-place");
  this->ExpectFailure("in.nrrd out.nrrd --in-place --sliding-slab 3 1", "--in-place");
}

TEST_F(ShearWarpMIPProgramProjection, ProjectsEachComponent)
{
  for (const unsigned int components : { 2u, 3u, 4u, 7u })
  {
    for (const std::string format : { ".nrrd", ".mha", ".nii" })
    {
      SCOPED_TRACE(std::to_string(components) + format);
      this->WriteComponents("vector" + format, components);
      this->ExpectSuccess("vector" + format + " out" + format);
      const auto picture = this->Read<itk::VectorImage<PixelType, 2>>("out" + format);
      ASSERT_EQ(picture->GetNumberOfComponentsPerPixel(), components);
      for (unsigned int component = 0; component < components; ++component)
      {
        EXPECT_EQ(this->ReadComponent("out" + format, component), GetPixels(this->ProjectPart(component)));
      }
    }
  }
  this->ExpectFailure("vector.nrrd out.png", "'vector.nrrd' has 7 components");
  this->ExpectFailure("vector.nrrd out.nrrd --depth depth.nrrd",
                      "--depth is not possible: 'vector.nrrd' has 7 components");
  this->ExpectFailure("vector.nrrd out.nrrd --depth-colour depth.png", "--depth-colour is not possible");
}

TEST_F(ShearWarpMIPProgramProjection, ProjectsColours)
{
  m_Volume = MakeVolume<PixelType>(20);
  this->WriteComponents("short.nrrd", 3);
  this->ExpectSuccess("short.nrrd out.png --window 0 400");
  for (unsigned int component = 0; component < 3; ++component)
  {
    auto expected = GetPixels(this->ProjectPart(component));
    std::transform(expected.begin(), expected.end(), expected.begin(), [](PixelType value) {
      return static_cast<PixelType>(std::lround(255.0 * std::min(value / 400.0, 1.0)));
    });
    EXPECT_EQ(this->ReadComponent("out.png", component), expected);
  }

  // parts below 256 are kept
  using BytesType = itk::Image<itk::RGBPixel<unsigned char>, 3>;
  this->WriteComponents<unsigned char>("bytes.nrrd", 3);
  this->WriteImage(this->Read<BytesType>("bytes.nrrd"), "colour.nii.gz");
  for (const std::string name : { "out.nrrd", "out.mha", "out.nii.gz" })
  {
    SCOPED_TRACE(name);
    this->ExpectSuccess("colour.nii.gz " + name);
    const auto reader = itk::ImageFileReader<ColourType>::New();
    reader->SetFileName(this->GetPath(name));
    reader->Update();
    EXPECT_EQ(reader->GetImageIO()->GetNumberOfComponents(), 3u);
    EXPECT_EQ(reader->GetImageIO()->GetComponentType(), itk::IOComponentEnum::UCHAR);
    EXPECT_EQ(this->ReadComponent(name, 0), GetPixels(this->ProjectPart(0)));
  }

  this->WriteDICOMSeries<ColourType::PixelType>("1.2.3.1", "colour", { 0, 2, 4 });
  this->ExpectSuccess("dicom series.png --view superior --window 0 255");
  const auto          series = this->ReadPixels<ColourType>("series.png");
  const unsigned char last[] = { 102, 102, 102 };
  EXPECT_EQ(series, std::vector<ColourType::PixelType>(64, ColourType::PixelType(last)));

  this->ExpectSuccess("short.nrrd turn.png --frames 3");
  EXPECT_EQ(this->Read<ColourType>("turn-001.png")->GetBufferedRegion(),
            this->Read<ColourType>("turn-002.png")->GetBufferedRegion());
}

TEST_F(ShearWarpMIPProgramProjection, ProjectsEachPointInTime)
{
  for (const std::string name : { "times.nii.gz", "times.nrrd", "times.mha" })
  {
    SCOPED_TRACE(name);
    this->WriteTimes(name, 4);
    this->ExpectSuccess(name + " out.nrrd");
    const auto stack = this->Read<VolumeType>("out.nrrd");
    ASSERT_EQ(stack->GetBufferedRegion().GetSize(2), 4u);
    EXPECT_NEAR(stack->GetSpacing()[2], 2.5, 1e-6);
    const auto times = this->Read<itk::Image<PixelType, 4>>(name);
    EXPECT_EQ(stack->GetOrigin()[2], times->GetOrigin()[3]);
    for (unsigned int time = 0; time < 4; ++time)
    {
      const auto         expected = GetPixels(this->ProjectPart(time));
      const auto * const frame = stack->GetBufferPointer() + time * expected.size();
      EXPECT_TRUE(std::equal(expected.begin(), expected.end(), frame)) << time;
      this->ExpectSuccess(name + " one.nrrd --volume " + std::to_string(time + 1));
      EXPECT_EQ(GetPixels(this->Read<PictureType>("one.nrrd")), expected) << time;
    }
    for (const std::string number : { "0", "5", "-1", "01", "a" })
    {
      this->ExpectFailure(name + " one.nrrd --volume=" + number,
                          "--volume " + number + " is not in '" + name + "', which has points in time 1 to 4\n");
    }
  }
  this->ExpectSuccess("times.nrrd --write-volume one.mha --volume 3");
  EXPECT_EQ(this->Read<VolumeType>("one.mha")->GetLargestPossibleRegion(),
            this->Read<VolumeType>("in.nrrd")->GetLargestPossibleRegion());
  this->ExpectSuccess("times.nrrd turn.nrrd --frames 3 --volume 2");
  this->ExpectSuccess("one.mha out.nrrd --volume 1");
  this->ExpectFailure("in.nrrd out.png --volume 2", "--volume 2 is not in 'in.nrrd', which has one volume\n");
  this->ExpectFailure("in.nrrd out.png --overlay times.nrrd",
                      "4 points in time; --overlay-volume NUMBER chooses one\n");
  this->ExpectFailure("in.nrrd out.png --overlay times.nrrd --overlay-volume 5", "--overlay-volume 5 is not in 'times");
  this->ExpectSuccess("in.nrrd out.png --overlay times.nrrd --overlay-volume 4");
  this->ExpectSuccess("times.nrrd cine.png", "shear-warp-mip: note: 'cine.png' becomes 4 numbered files\n");
  EXPECT_TRUE(fs::exists(m_Folder / "cine-003.png"));
  EXPECT_FALSE(fs::exists(m_Folder / "cine.png"));
  this->ExpectFailure("times.nrrd out.png --frames 3", "has 4 points in time; --volume NUMBER chooses one\n");
  this->ExpectFailure("times.nrrd out.png --sliding-slab 3 1", "--sliding-slab is not possible");
  this->ExpectFailure("times.nrrd out.nrrd --in-place", "--in-place is not possible");
}
} // namespace
