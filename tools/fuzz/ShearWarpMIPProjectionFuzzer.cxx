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
#include "itkShearWarpMIPTestOracle.h"
#include "itkShearWarpMIPTestParts.h"
#include "itkShearWarpMIPImageFilter.h"
#include "vnl/vnl_inverse.h"

#include <fuzzer/FuzzedDataProvider.h>

#include <iostream>

// Images, views and output grids of any numbers: ShearWarpMIPImageFilter throws an ExceptionObject or gives the right
// picture, and gives it of the image's parts too.

namespace
{
using namespace itk::ShearWarpMIPTest;

void
Require(bool condition, const char * property)
{
  if (!condition)
  {
    std::cerr << "not so: " << property << std::endl;
    std::abort();
  }
}

/** Numbers of the fuzzer's bytes; those where arithmetic goes wrong are frequent. */
class Numbers : public FuzzedDataProvider
{
public:
  using FuzzedDataProvider::FuzzedDataProvider;

  double
  Next()
  {
    using Limits = std::numeric_limits<double>;
    static constexpr double interesting[] = { 1,
                                              -1,
                                              0,
                                              -0.0,
                                              0.5,
                                              1e-8,
                                              1e-160,
                                              1e-300,
                                              1e8,
                                              1e160,
                                              1e300,
                                              0x1p31,
                                              0x1p63,
                                              -0x1p63,
                                              1 + 0x1p-52,
                                              1 - 0x1p-53,
                                              1e-13,
                                              Limits::min(),
                                              0x1p-16,
                                              0x1p53,
                                              Limits::max(),
                                              Limits::lowest(),
                                              -Limits::infinity(),
                                              Limits::denorm_min(),
                                              Limits::infinity(),
                                              Limits::quiet_NaN() };
    switch (this->ConsumeIntegralInRange(0, 3))
    {
      case 0:
        return this->PickValueInArray(interesting);
      case 1:
        return this->ConsumeIntegralInRange(-64, 64) / 32.0;
      case 2:
        return this->ConsumeFloatingPointInRange(-100.0, 100.0);
      default:
      {
        const auto bits = this->ConsumeIntegral<std::uint64_t>();
        double     number;
        std::memcpy(&number, &bits, sizeof(number));
        return number;
      }
    }
  }

  template <typename TArray>
  TArray
  NextArray()
  {
    TArray array;
    std::generate_n(array.GetDataPointer(), TArray::Dimension, [this] { return this->Next(); });
    return array;
  }

  MatrixType
  NextMatrix()
  {
    switch (this->ConsumeIntegralInRange(0, 3))
    {
      case 0:
        return MakeDiagonal(1, 1, 1);
      case 1:
        return this->NextRotation();
      case 2: // of a plain image, the shear
        return MakeMatrix({ { 1, 0, this->Next() }, { 0, 1, this->Next() }, { 0, 0, this->Next() } });
      default:
        return MakeMatrix({ { this->Next(), this->Next(), this->Next() },
                            { this->Next(), this->Next(), this->Next() },
                            { this->Next(), this->Next(), this->Next() } });
    }
  }

  MatrixType
  NextRotation()
  {
    Random random = this->NextRandom();
    return MakeRandomRotation(random);
  }

  Random
  NextRandom()
  {
    return Random(this->ConsumeIntegral<std::uint16_t>());
  }
};

MatrixType
GetIndexToPhysical(const MatrixType & direction, const itk::Vector<double, 3> & spacing)
{
  MatrixType matrix = direction;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    matrix.GetVnlMatrix().scale_column(axis, spacing[axis]);
  }
  return matrix;
}

template <typename TPixel>
typename itk::Image<TPixel, 3>::Pointer
MakeImage(Numbers & numbers)
{
  const auto          image = itk::Image<TPixel, 3>::New();
  itk::ImageRegion<3> region;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    region.SetSize(axis, numbers.ConsumeIntegralInRange<itk::SizeValueType>(1, 20));
    region.SetIndex(axis, numbers.ConsumeBool() ? 0 : numbers.ConsumeIntegral<std::int32_t>());
  }
  image->SetRegions(region);
  itk::Vector<double, 3> spacing(1.0);
  if (numbers.ConsumeBool())
  {
    spacing = numbers.NextArray<itk::Vector<double, 3>>();
  }
  const MatrixType direction = numbers.NextMatrix();
  for (const MatrixType & axes : { direction, GetIndexToPhysical(direction, spacing) })
  {
    const double * const begin = axes.GetVnlMatrix().data_block();
    const auto isExtreme = [](double x) { return x != 0.0 && !(std::abs(x) > 1e-100 && std::abs(x) < 1e100); };
    if (std::any_of(begin, begin + 9, isExtreme))
    {
      itkGenericExceptionMacro("ITK's inverse of such a matrix aborts or never ends.");
    }
  }
  image->SetDirection(direction);
  image->SetSpacing(spacing);
  if (numbers.ConsumeBool())
  {
    image->SetOrigin(numbers.NextArray<PointType>());
  }
  image->Allocate();

  Random random = numbers.NextRandom();
  FillRandom(random, image.GetPointer());
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    using Limits = std::numeric_limits<TPixel>;
    constexpr TPixel special[] = { Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN(),
                                   Limits::max(),      Limits::lowest(),    Limits::denorm_min() };
    for (int count = numbers.ConsumeIntegralInRange(0, 8); count > 0; --count)
    {
      const auto last = static_cast<std::int64_t>(region.GetNumberOfPixels()) - 1;
      image->GetBufferPointer()[random.Integer(0, last)] = numbers.PickValueInArray(special);
    }
  }
  return image;
}

/** An upper bound, in voxels, of the error of positions that are computed in double precision. */
double
EstimateError(const ViewType * view, const itk::ImageBase<3> * image, const itk::ImageBase<2> * grid)
{
  const auto         norm = [](const MatrixType & matrix) { return matrix.GetVnlMatrix().frobenius_norm(); };
  const MatrixType   indexToPhysical = GetIndexToPhysical(image->GetDirection(), image->GetSpacing());
  const MatrixType   physicalToIndex(vnl_inverse(indexToPhysical.GetVnlMatrix()));
  const MatrixType & matrix = view->GetMatrix();
  const double       condition =
    norm(indexToPhysical) * norm(physicalToIndex) * norm(matrix) * norm(MatrixType(vnl_inverse(matrix.GetVnlMatrix())));

  double reach = 0.0;
  double voxels = 1.0;
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    reach += std::abs(grid->GetOrigin()[axis]) +
             grid->GetSpacing()[axis] * static_cast<double>(grid->GetLargestPossibleRegion().GetSize(axis));
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto & region = image->GetLargestPossibleRegion();
    voxels += std::abs(static_cast<double>(region.GetIndex(axis))) + static_cast<double>(region.GetSize(axis));
  }
  const double offset = view->GetOffset().GetNorm() + image->GetOrigin().GetVectorFromOrigin().GetNorm();
  const double length = norm(matrix) * reach + offset * (1.0 + reach) + norm(indexToPhysical) * voxels;
  return 0x1p-48 * condition * (voxels + norm(physicalToIndex) * length);
}

template <typename TPixel>
void
RequireBounded(const itk::Image<TPixel, 3> * image,
               const itk::Image<TPixel, 2> * picture,
               TPixel                        background,
               bool                          fades)
{
  TPixel             lowest = std::numeric_limits<TPixel>::max();
  TPixel             highest = std::numeric_limits<TPixel>::lowest();
  const auto * const voxels = image->GetBufferPointer();
  std::for_each(voxels, voxels + image->GetBufferedRegion().GetNumberOfPixels(), [&](TPixel voxel) {
    lowest = std::min(lowest, voxel);
    highest = std::max(highest, voxel);
  });
  lowest = fades ? std::min(lowest, background) : lowest;
  highest = fades ? std::max(highest, background) : highest;
  // a difference that overflows has no bounds
  const bool         isBounded = std::isfinite(static_cast<double>(static_cast<TPixel>(highest - lowest)));
  const auto * const pixels = picture->GetBufferPointer();
  std::for_each(pixels, pixels + picture->GetBufferedRegion().GetNumberOfPixels(), [&](TPixel pixel) {
    Require(HaveSameBits(pixel, background) || (isBounded ? pixel >= lowest && pixel <= highest : pixel == pixel),
            "a pixel is the background or bounded by voxels, and by it if they fade");
  });
}

/** Parameters of rays; at most a few of them are such that Update() accepts them. */
template <typename TFilter>
void
SetRays(Numbers & numbers, TFilter * filter)
{
  using ModeEnum = typename TFilter::ModeEnum;
  using InterpolationEnum = typename TFilter::InterpolationEnum;
  filter->SetMode(
    numbers.PickValueInArray({ ModeEnum::Maximum, ModeEnum::Minimum, ModeEnum::AbsoluteMaximum, ModeEnum::Mean }));
  filter->SetInterpolation(numbers.PickValueInArray({ InterpolationEnum::Linear, InterpolationEnum::Nearest }));
  filter->SetExact(numbers.ConsumeBool());
  filter->SetComputeDepth(numbers.ConsumeBool());
  if (numbers.ConsumeBool())
  {
    filter->SetSlabNear(numbers.Next());
    filter->SetSlabFar(numbers.Next());
  }
  if (numbers.ConsumeBool())
  {
    filter->SetCropLower(numbers.NextArray<PointType>());
    filter->SetCropUpper(numbers.NextArray<PointType>());
  }
  if (numbers.ConsumeBool())
  {
    filter->SetDepthAttenuation(numbers.Next());
  }
  if (numbers.ConsumeBool())
  {
    filter->LocalMaximumOn();
    filter->SetLocalMaximumThreshold(
      static_cast<typename TFilter::InputPixelType>(numbers.ConsumeIntegral<std::uint8_t>()));
  }
  if (numbers.ConsumeBool())
  {
    Random     random = numbers.NextRandom();
    const auto mask = MakeRandomMask(random, filter->GetInput());
    filter->SetMaskImage(mask);
  }
}

/** Cuts the image of \a filter in two; the same picture must be made of both. */
template <typename TFilter>
void
RequireTheSameFromParts(Numbers & numbers, const TFilter * filter)
{
  using ImageType = typename TFilter::InputImageType;
  const typename ImageType::ConstPointer image = filter->GetInput();
  const itk::ImageRegion<3> &            whole = image->GetLargestPossibleRegion();
  const auto                             axis = numbers.ConsumeIntegralInRange(0U, 2U);
  // the slice that both have
  const auto common = numbers.ConsumeIntegralInRange<itk::SizeValueType>(0, whole.GetSize(axis) - 1);

  itk::ImageRegion<3> lower = whole;
  lower.SetSize(axis, common + 1);
  itk::ImageRegion<3> upper = whole;
  upper.SetIndex(axis, whole.GetIndex(axis) + static_cast<itk::IndexValueType>(common));
  upper.SetSize(axis, whole.GetSize(axis) - common);

  const auto parts = MakePartsFilter(filter);
  for (const auto & region : { lower, upper })
  {
    parts->AddPart(parts->ProjectPart(MakePart(image.GetPointer(), region)));
  }
  parts->Update();
  Require(HaveSamePixels(filter->GetOutput(), parts->GetOutput()), "parts give the same bits");
  Require(!filter->GetComputeDepth() || HaveSamePixels(filter->GetDepthOutput(), parts->GetDepthOutput()),
          "parts give the same depths");
}

template <typename TPixel>
void
Project(Numbers & numbers)
{
  using ImageType = itk::Image<TPixel, 3>;
  using FilterType = itk::ShearWarpMIPImageFilter<ImageType>;
  const auto image = MakeImage<TPixel>(numbers);
  const auto view = ViewType::New();
  view->SetMatrix(numbers.NextMatrix());
  if (numbers.ConsumeBool())
  {
    view->SetOffset(numbers.NextArray<itk::Vector<double, 3>>());
  }

  const auto filter = FilterType::New();
  filter->SetInput(image);
  filter->SetTransform(view);
  filter->SetNumberOfWorkUnits(numbers.ConsumeIntegralInRange(1, 2));
  filter->SetOversampling(numbers.ConsumeIntegralInRange(1, 2));
  filter->SetReducedResampling(
    numbers.PickValueInArray({ FilterType::ReducedResamplingEnum::Off, FilterType::ReducedResamplingEnum::On }));
  const auto background = static_cast<TPixel>(numbers.ConsumeIntegral<std::uint8_t>());
  filter->SetDefaultPixelValue(background);
  if (numbers.ConsumeBool())
  {
    filter->SetOutputSpacing(numbers.NextArray<itk::Vector<double, 2>>());
  }
  if (numbers.ConsumeBool())
  {
    filter->SetOutputOrigin(numbers.NextArray<itk::Point<double, 2>>());
  }
  itk::Size<2> size{ { 0, 0 } };
  if (numbers.ConsumeBool())
  {
    for (auto & length : size)
    {
      length = numbers.ConsumeBool() ? numbers.ConsumeIntegralInRange(0, 40) : numbers.ConsumeIntegral<std::uint64_t>();
    }
    filter->SetSize(size);
  }

  const bool isPlain = numbers.ConsumeBool();
  if (!isPlain)
  {
    SetRays(numbers, filter.GetPointer());
  }

  filter->UpdateOutputInformation();
  const ImageType * const input = image;
  const auto * const      grid = filter->GetOutput();
  const auto &            region = grid->GetLargestPossibleRegion();
  for (unsigned int axis = 0; axis < 2; ++axis)
  {
    Require(region.GetIndex(axis) == 0 && region.GetSize(axis) > 0, "the output is not empty and begins at zero");
    Require(size[axis] == 0 || size[axis] == region.GetSize(axis), "a given size is kept");
    Require(grid->GetSpacing()[axis] > 0 && std::isfinite(grid->GetSpacing()[axis]), "spacing is positive and finite");
    Require(std::isfinite(grid->GetOrigin()[axis]), "the origin is finite");
  }
  // larger pictures are right too, but slow
  if (region.GetSize(0) > 64 || region.GetSize(1) > 64)
  {
    return;
  }

  typename itk::Image<TPixel, 2>::Pointer first;
  ForEachInstructionSet([&](const std::string &) {
    filter->Modified();
    filter->Update();
    first = first ? first : Copy<TPixel>(filter->GetOutput());
    Require(HaveSamePixels(first, filter->GetOutput()), "every instruction set gives the same bits");
  });
  RequireBounded<TPixel>(input, first, background, filter->GetDepthAttenuation() > 0.0);
  if (!filter->GetMaskImage() && !filter->GetLocalMaximum() && filter->GetDepthAttenuation() == 0.0)
  {
    RequireTheSameFromParts(numbers, static_cast<const FilterType *>(filter));
  }
  if (!isPlain)
  {
    return;
  }

  const double error = EstimateError(view, image, grid);
  if (error < 1e-6)
  {
    BruteForceProjection<TPixel> bruteForce(view, input, static_cast<int>(filter->GetOversampling()));
    const auto                   expected = bruteForce.Evaluate(grid, background);
    const bool                   isRight = HaveSamePixels(first, expected) || bruteForce.GetMargin() < 2.0 * error;
    if (!isRight)
    {
      std::cerr << *input << *view << *grid << "error " << error << ", margin " << bruteForce.GetMargin() << std::endl;
    }
    Require(isRight, "the picture is right");
  }
}
} // namespace

extern "C" int
LLVMFuzzerInitialize(int *, char ***)
{
  itk::Object::SetGlobalWarningDisplay(false);
  return 0;
}

extern "C" int
LLVMFuzzerTestOneInput(const std::uint8_t * data, std::size_t size)
{
  Numbers    numbers(data, size);
  const auto project =
    numbers.PickValueInArray({ Project<unsigned char>, Project<short>, Project<unsigned short>, Project<float> });
  try
  {
    project(numbers);
  }
  catch (const itk::ExceptionObject &)
  {}
  return 0;
}
