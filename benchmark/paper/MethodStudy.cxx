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

#include "Studies.h"

#include "Data.h"
#include "RayCasting.h"

#include "itkImageFileReader.h"
#include "itkImageFileWriter.h"
#include "itkResampleImageFilter.h"
#include "itkShearWarpMIPImageFilter.h"
#include "itkSubtractImageFilter.h"

#include <fstream>
#include <functional>
#include <optional>

namespace itk::ShearWarpBenchmark
{
namespace
{
using PixelType = std::uint16_t;
using VolumeType = Image<PixelType, 3>;
using FloatImageType = Image<float, 3>;
using PictureType = Image<PixelType, 2>;
using PixelsType = std::vector<PixelType>;
using FilterType = ShearWarpMIPImageFilter<VolumeType>;

constexpr unsigned int TagBits = 2;
constexpr unsigned int TagMask = (1 << TagBits) - 1;

void
Tag(PermutedVolume<PixelType> & volume)
{
  for (PixelType & voxel : volume.voxels)
  {
    voxel = static_cast<PixelType>(voxel << TagBits);
  }

  // a cell gets its tag before its other voxels get theirs
  const std::ptrdiff_t corners[] = { 0, 1, volume.rowStride, volume.rowStride + 1 };
  for (std::ptrdiff_t k = 0; k < volume.slices; ++k)
  {
    for (std::ptrdiff_t j = 0; j <= volume.rows; ++j)
    {
      PixelType * cell = volume.voxels.data() + (k * (volume.rows + 2) + j) * volume.rowStride;
      for (std::ptrdiff_t i = 0; i <= volume.columns; ++i, ++cell)
      {
        PixelType largest = 0;
        for (PixelType corner = 1; corner < 4; ++corner)
        {
          largest = cell[corners[corner]] > cell[corners[largest]] ? corner : largest;
        }
        *cell |= largest;
      }
    }
  }
}

/** In the order of memory. */
template <typename TImage>
std::vector<typename TImage::PixelType>
GetPixels(const TImage * image)
{
  const auto * const pixels = image->GetBufferPointer();
  return { pixels, pixels + image->GetBufferedRegion().GetNumberOfPixels() };
}

struct View
{
  unsigned int               angle;
  ViewTransformType::Pointer transform;
  PictureType::Pointer       output;
  unsigned int               principalAxis;
};

struct Method
{
  std::string             name;
  std::function<double()> prepare; // returns seconds

  /** Sets what a Timing has of one view; returns the picture of a shear-warp. */
  std::function<PixelsType(const View &, Timing &)> project;
};

Method
MakeRayCasting(const VolumeType * volume)
{
  return { "ray casting",
           [] { return 0.0; },
           [volume](const View & view, Timing & timing) {
             const double step = GetVoxelStep(volume, view.transform);
             timing.clip = Time([&] { CountSamples(volume, view.transform, step, view.output); });
             timing.total = Time([&] { CastRays<PixelType>(volume, view.transform, step, PixelType{}, view.output); });
             timing.interpolation = timing.total - timing.clip;
             return PixelsType();
           } };
}

/** A published shear-warp: factorization, \a project(factorization, skipped fraction), warp. */
template <typename TPrepare, typename TProject>
Method
MakeShearWarp(const std::string & name, const VolumeType * volume, const TPrepare & prepare, const TProject & project)
{
  return { name,
           [prepare] { return Time(prepare); },
           [volume, project](const View & view, Timing & timing) {
             std::optional<ShearWarpFactorization> factorization;
             PixelsType                            intermediate;
             PixelsType                            picture;
             const double factorizing = Time([&] { factorization.emplace(view.transform, volume, view.output); });
             timing.interpolation = Time([&] { intermediate = project(*factorization, timing.skippedFraction); });
             timing.warp =
               Time([&] { picture = Warp(*factorization, intermediate, view.output->GetBufferedRegion().GetSize()); });
             timing.total = factorizing + timing.interpolation + timing.warp;
             return picture;
           } };
}

Method
MakeFilter(const std::string &               name,
           const VolumeType *                volume,
           const std::vector<View> &         views,
           FilterType::ReducedResamplingEnum reducedResampling)
{
  const auto filter = FilterType::New();
  filter->SetInput(volume);
  filter->SetReducedResampling(reducedResampling);
  filter->SetNumberOfWorkUnits(1);
  const auto prepare = [filter, &views] {
    filter->ReleasePreparedVolume();
    double seconds = 0.0;
    for (const View & view : views)
    {
      filter->SetTransform(view.transform);
      filter->Update();
      seconds += filter->GetPreparationSeconds();
    }
    return seconds;
  };
  return { name, prepare, [filter](const View & view, Timing & timing) {
            timing.total = Time([&] {
              filter->SetTransform(view.transform);
              filter->Update();
            });
            timing.interpolation = filter->GetProjectionSeconds();
            timing.warp = filter->GetWarpSeconds();
            timing.skippedFraction = filter->GetSkippedFraction();
            return GetPixels(filter->GetOutput());
          } };
}
} // namespace

VolumeType::Pointer
ReadVolume(const std::string & file, const Size<3> & size)
{
  // throws for other dimensions and components
  ReadInformation(file);
  const auto image = ReadImage<FloatImageType>(file);

  const auto                  region = image->GetLargestPossibleRegion();
  FloatImageType::SpacingType spacing;
  ContinuousIndex<double, 3>  firstVoxel;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const double scale = static_cast<double>(region.GetSize(axis)) / static_cast<double>(size[axis]);
    spacing[axis] = scale * image->GetSpacing()[axis];
    firstVoxel[axis] = static_cast<double>(region.GetIndex(axis)) - 0.5 + 0.5 * scale;
  }
  const auto resample = ResampleImageFilter<FloatImageType, FloatImageType>::New();
  resample->SetInput(image);
  resample->SetSize(size);
  resample->SetOutputSpacing(spacing);
  resample->SetOutputOrigin(image->TransformContinuousIndexToPhysicalPoint<double>(firstVoxel));
  resample->SetOutputDirection(image->GetDirection());
  resample->Update();
  const auto resampled = GetPixels(resample->GetOutput());

  const auto volume = VolumeType::New();
  volume->CopyInformation(resample->GetOutput());
  volume->SetRegions(size);
  volume->Allocate();
  const auto [lowest, highest] = std::minmax_element(resampled.begin(), resampled.end());
  const float scale = *highest > *lowest ? float{ TaggedShearWarp::LargestVoxel } / (*highest - *lowest) : 0.0F;
  std::transform(
    resampled.begin(), resampled.end(), volume->GetBufferPointer(), [offset = *lowest, scale](float voxel) {
      return static_cast<PixelType>(scale * (voxel - offset) + 0.5F);
    });
  return volume;
}

TaggedShearWarp::TaggedShearWarp(const VolumeType * image)
{
  const PixelType * voxels = image->GetBufferPointer();
  const PixelType   largest = *std::max_element(voxels, voxels + image->GetBufferedRegion().GetNumberOfPixels());
  if (largest > LargestVoxel)
  {
    itkGenericExceptionMacro("The image has a voxel of " << largest << "; voxels of up to 14 bits, " << LargestVoxel
                                                         << ", leave room for the corner number.");
  }
  for (unsigned int principalAxis = 0; principalAxis < 3; ++principalAxis)
  {
    m_Volumes.emplace_back(image, principalAxis);
    Tag(m_Volumes.back());
  }
}

TaggedShearWarp::Projection
TaggedShearWarp::Project(const ShearWarpFactorization & factorization) const
{
  const PermutedVolume<PixelType> & volume = m_Volumes[factorization.GetPrincipalAxis()];
  const std::ptrdiff_t              corners[] = { 0, 1, volume.rowStride, volume.rowStride + 1 };
  const auto                        size = factorization.GetIntermediateSize();
  std::vector<PixelType>            intermediate(size[0] * size[1]);
  SizeValueType                     skippedCells = 0;

  ForEachRow(
    volume,
    factorization,
    0,
    static_cast<std::ptrdiff_t>(size[1]),
    [&](
      const ShearWarp::SlicePlacement & placement, const PixelType * cell, std::ptrdiff_t column, std::ptrdiff_t row) {
      const ShearWarp::BilinearWeights weights(placement.column.fraction, placement.row.fraction);
      PixelType * pixel = intermediate.data() + row * static_cast<std::ptrdiff_t>(size[0]) + column;
      for (const PixelType * end = pixel + volume.columns; pixel != end; ++pixel, ++cell)
      {
        if (cell[corners[*cell & TagMask]] >> TagBits <= *pixel)
        {
          ++skippedCells;
          continue;
        }
        const std::int32_t sum = weights.aa * (cell[0] >> TagBits) + weights.ab * (cell[1] >> TagBits) +
                                 weights.ba * (cell[volume.rowStride] >> TagBits) +
                                 weights.bb * (cell[volume.rowStride + 1] >> TagBits);
        *pixel = std::max(*pixel, static_cast<PixelType>((sum + ShearWarp::One / 2) >> ShearWarp::FractionBits));
      }
    });
  return { std::move(intermediate), skippedCells };
}

PictureType::Pointer
MakeFittedOutput(const VolumeType * image, const Transform<double, 3, 3> * viewTransform)
{
  const auto filter = FilterType::New();
  filter->SetInput(image);
  filter->SetTransform(viewTransform);
  filter->UpdateOutputInformation();

  const auto output = PictureType::New();
  output->CopyInformation(filter->GetOutput());
  output->SetRegions(filter->GetOutput()->GetLargestPossibleRegion());
  output->Allocate();
  return output;
}

std::vector<Timing>
TimeMethods(const VolumeType * image, unsigned int repetitions)
{
  std::vector<View> views;
  for (unsigned int angle = 0; angle <= 180; angle += 10)
  {
    const auto transform = MakeView(image, { 0.0, static_cast<double>(angle), 0.0 });
    const auto output = MakeFittedOutput(image, transform);
    const auto axis = ShearWarpFactorization(transform, image, output).GetPrincipalAxis();
    views.push_back({ angle, transform, output, axis });
  }
  std::vector<PermutedVolume<PixelType>> copies;
  std::optional<TaggedShearWarp>         tagged;

  const auto permute = [&] {
    copies.clear();
    for (unsigned int principalAxis = 0; principalAxis < 3; ++principalAxis)
    {
      copies.emplace_back(image, principalAxis);
    }
  };
  const auto projectPlainly = [&](const ShearWarpFactorization & factorization, double &) {
    return Project(copies[factorization.GetPrincipalAxis()], factorization);
  };
  const auto cells = static_cast<double>(image->GetBufferedRegion().GetNumberOfPixels());
  const auto tag = [&] { tagged.emplace(image); };
  const auto projectTagged = [&](const ShearWarpFactorization & factorization, double & skippedFraction) {
    auto projection = tagged->Project(factorization);
    skippedFraction = static_cast<double>(projection.skippedCells) / cells;
    return std::move(projection.intermediate);
  };
  const std::vector<Method> methods{ MakeRayCasting(image),
                                     MakeShearWarp("shear warp", image, permute, projectPlainly),
                                     MakeShearWarp("shear warp, tagged", image, tag, projectTagged),
                                     MakeFilter("filter, off", image, views, FilterType::ReducedResamplingEnum::Off),
                                     MakeFilter(
                                       "filter, auto", image, views, FilterType::ReducedResamplingEnum::Auto) };

  std::vector<Timing>     timings;
  std::vector<PixelsType> expected(views.size());
  for (unsigned int repetition = 0; repetition < repetitions; ++repetition)
  {
    for (const Method & method : methods)
    {
      const double preparation = method.prepare();
      for (std::size_t v = 0; v < views.size(); ++v)
      {
        const View & view = views[v];
        timings.push_back({ method.name, view.angle, view.principalAxis, preparation });
        const PixelsType pixels = method.project(view, timings.back());
        if (expected[v].empty())
        {
          expected[v] = pixels;
        }
        else if (!pixels.empty() && pixels != expected[v])
        {
          itkGenericExceptionMacro("At " << view.angle << " degrees '" << method.name
                                         << "' differs from the first shear-warp.");
        }
      }
    }
  }
  return timings;
}

void
WriteTimings(const std::vector<Timing> & timings, const std::string & csvFile)
{
  std::ofstream csv(csvFile);
  csv << "method,angle,principal_axis,preparation_ms,interpolation_ms,clip_ms,warp_ms,total_ms,skipped_fraction\n";
  for (const Timing & timing : timings)
  {
    csv << '"' << timing.method << "\"," << timing.angle << ',' << timing.principalAxis;
    for (const double seconds : { timing.preparation, timing.interpolation, timing.clip, timing.warp, timing.total })
    {
      csv << ',' << 1000.0 * seconds;
    }
    csv << ',' << timing.skippedFraction << '\n';
  }
  if (!csv.flush())
  {
    itkGenericExceptionMacro("'" << csvFile << "' cannot be written.");
  }
}

void
WriteFigure5(const VolumeType * image, const std::string & name, const std::string & folder)
{
  const auto transform = MakeView(image, { 50.0, 0.0, 40.0 });
  const auto rayCasting = MakeFittedOutput(image, transform);
  CastRays<PixelType>(image, transform, GetVoxelStep(image, transform), 0, rayCasting);

  const ShearWarpFactorization factorization(transform, image, rayCasting);
  const PixelsType             shearWarp = Warp(factorization,
                                    TaggedShearWarp(image).Project(factorization).intermediate,
                                    rayCasting->GetBufferedRegion().GetSize());

  const auto filter = FilterType::New();
  filter->SetInput(image);
  filter->SetTransform(transform);
  filter->Update();
  if (shearWarp != GetPixels(filter->GetOutput()))
  {
    itkGenericExceptionMacro("The filter's picture of " << name << " differs from the published shear-warp's picture.");
  }

  const auto difference = SubtractImageFilter<PictureType, PictureType, Image<float, 2>>::New();
  difference->SetInput1(rayCasting);
  difference->SetInput2(filter->GetOutput());

  const std::string stem = folder + "/figure5-" + name + '-';
  WriteImage(rayCasting.GetPointer(), stem + "raycasting.tif");
  WriteImage(filter->GetOutput(), stem + "shearwarp.tif");
  WriteImage(difference->GetOutput(), stem + "difference.tif");
}
} // namespace itk::ShearWarpBenchmark
