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
#include "Data.h"

#include "Phantom.h"

#include "itkImageIOFactory.h"
#include "itkMath.h"
#include "itkMultiThreaderBase.h"
#include "itkShearWarpMIPView.h"
#include "itkShiftScaleImageFilter.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <type_traits>

namespace itk::ShearWarpBenchmark
{
namespace
{
/** Random numbers of a counter: the finalizer of SplitMix64 (Steele et al. 2014), so that voxels can be made in any
 * order. */
std::uint64_t
Hash(std::uint64_t counter)
{
  counter = (counter + 1) * 0x9E3779B97F4A7C15;
  counter = (counter ^ (counter >> 30)) * 0xBF58476D1CE4E5B9;
  counter = (counter ^ (counter >> 27)) * 0x94D049BB133111EB;
  return counter ^ (counter >> 31);
}

/** Close to normal, mean 0 and standard deviation 1: the sum of eight uniform numbers, at most 4.9 in magnitude. */
float
Normal(std::uint64_t counter)
{
  constexpr std::uint64_t lower = 0x0000FFFF0000FFFF;
  const std::uint64_t     a = Hash(2 * counter);
  const std::uint64_t     b = Hash(2 * counter + 1);
  const std::uint64_t     pairs = (a & lower) + ((a >> 16) & lower) + (b & lower) + ((b >> 16) & lower);
  const auto              sum = static_cast<std::int32_t>((pairs >> 32) + (pairs & 0xFFFFFFFF));
  constexpr float         deviation = 53509.6F; // 65536 sqrt(8 / 12)
  return static_cast<float>(sum - 4 * 65535) / deviation;
}

/** Magnitude of a complex signal with normal noise in both parts, as MR shows it (Rice's distribution). */
float
AddRicianNoise(float signal, float deviation, std::uint64_t voxel)
{
  const float real = signal + deviation * Normal(2 * voxel);
  const float imaginary = deviation * Normal(2 * voxel + 1);
  return std::sqrt(real * real + imaginary * imaginary);
}

/** A voxel that a kind of volume is made of. */
struct Voxel
{
  float             artery; // its brightness, 0 for a kind without a head
  std::uint64_t     number; // in the volume
  Vector<double, 3> place;
};

struct Kind
{
  const char * name;
  bool         hasHead;
  float (*makeValue)(const Voxel &);
};

// the program's head has up to 892
constexpr float Contrast = 4.0F;

constexpr Kind Kinds[] = {
  { "mra",
    true,
    [](const Voxel & voxel) {
      const float signal = std::max(voxel.artery, static_cast<float>(Phantom::GetTissue(voxel.place)));
      return AddRicianNoise(Contrast * signal, 45.0F, voxel.number);
    } },
  { "ct",
    true,
    [](const Voxel & voxel) {
      const auto  tissue = static_cast<float>(Phantom::GetTissue(voxel.place));
      const bool  isBone = tissue == static_cast<float>(Phantom::Bone);
      const float value = tissue == 0.0F ? 24.0F : isBone ? 2000.0F : 1000.0F + 0.4F * tissue;
      const float contrast = 1000.0F + 0.5F * voxel.artery;
      return (voxel.artery > 0.0F ? std::max(value, contrast) : value) + 15.0F * Normal(voxel.number);
    } },
  { "noise16", false, [](const Voxel & voxel) { return static_cast<float>(Hash(voxel.number) >> 48); } },
  { "noise12", false, [](const Voxel & voxel) { return 1000.0F + 100.0F * Normal(voxel.number); } },
  { "sparse",
    true,
    [](const Voxel & voxel) {
      return Phantom::IsInBrain(voxel.place) ? AddRicianNoise(Contrast * voxel.artery, 8.0F, voxel.number) : 0.0F;
    } },
  { "const", false, [](const Voxel &) { return 1000.0F; } },
};
} // namespace

std::vector<std::string>
GetKinds()
{
  std::vector<std::string> names;
  for (const Kind & kind : Kinds)
  {
    names.emplace_back(kind.name);
  }
  return names;
}

template <typename TPixel>
typename Image<TPixel, 3>::Pointer
MakeVolume(const std::string & name, const Size<3> & size)
{
  const auto kind =
    std::find_if(std::begin(Kinds), std::end(Kinds), [&name](const Kind & each) { return each.name == name; });
  if (kind == std::end(Kinds))
  {
    itkGenericExceptionMacro("There is no kind of volume called '" << name << "'.");
  }
  const int  bits = name == "noise16" ? 16 : 12;
  const auto volume = Phantom::MakeGrid(size);
  if (kind->hasHead)
  {
    const auto random = Phantom::RandomType::New();
    random->SetSeed(2002);
    Phantom::PaintArteries(*volume, *random);
  }
  const float largest = static_cast<float>((1 << bits) - 1);
  MultiThreaderBase::New()->ParallelizeArray(
    0,
    size[2],
    [&](SizeValueType slice) {
      const SizeValueType pixels = size[0] * size[1];
      for (SizeValueType number = slice * pixels; number < (slice + 1) * pixels; ++number)
      {
        auto &      voxel = volume->GetBufferPointer()[number];
        const auto  index = volume->ComputeIndex(static_cast<OffsetValueType>(number));
        const auto  place = volume->TransformIndexToPhysicalPoint<double>(index).GetVectorFromOrigin();
        const float value = kind->makeValue({ static_cast<float>(voxel), number, place });
        voxel = static_cast<std::uint16_t>(std::min(std::max(value, 0.0F) + 0.5F, largest));
      }
    },
    nullptr);
  volume->SetOrigin(Point<double, 3>());
  volume->SetSpacing(Vector<double, 3>(1.0));
  if constexpr (std::is_same_v<TPixel, std::uint16_t>)
  {
    return volume;
  }
  else
  {
    const auto convert = ShiftScaleImageFilter<Image<std::uint16_t, 3>, Image<TPixel, 3>>::New();
    convert->SetInput(volume);
    convert->SetShift(std::is_same_v<TPixel, std::int16_t> && bits == 16 ? -32768.0 : 0.0);
    convert->SetScale(sizeof(TPixel) == 1 ? 1.0 / (1 << (bits - 8)) : 1.0);
    convert->Update();
    return convert->GetOutput();
  }
}

#define INSTANTIATE(TPixel) template Image<TPixel, 3>::Pointer MakeVolume<TPixel>(const std::string &, const Size<3> &);
FOR_EACH_BENCHMARK_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE

DataSet
ReadInformation(const std::string & file)
{
  const ImageIOBase::Pointer io = ImageIOFactory::CreateImageIO(file.c_str(), IOFileModeEnum::ReadMode);
  if (!io)
  {
    itkGenericExceptionMacro("'" << file << "' is not an image that ITK can read.");
  }
  io->SetFileName(file);
  io->ReadImageInformation();
  if (io->GetNumberOfDimensions() != 3 || io->GetNumberOfComponents() != 1)
  {
    itkGenericExceptionMacro("'" << file << "' has " << io->GetNumberOfDimensions() << " dimensions and "
                                 << io->GetNumberOfComponents() << " components; 3 and 1 are needed.");
  }
  const auto component = io->GetComponentType();
  return { std::filesystem::path(file).stem().string(),
           file,
           { { io->GetDimensions(0), io->GetDimensions(1), io->GetDimensions(2) } },
           component == IOComponentEnum::UCHAR    ? "uint8"
           : component == IOComponentEnum::USHORT ? "uint16"
           : component == IOComponentEnum::INT    ? "int32"
           : component == IOComponentEnum::FLOAT  ? "float"
           : component == IOComponentEnum::DOUBLE ? "double"
                                                  : "int16" };
}

std::string
Describe(const std::exception & error)
{
  const auto * const exception = dynamic_cast<const ExceptionObject *>(&error);
  return exception ? exception->GetDescription() : error.what();
}

const std::vector<Angles> &
GetViews()
{
  static const std::vector<Angles> views = [] {
    std::vector<Angles> result;
    for (double angle = 0; angle <= 180; angle += 10)
    {
      result.push_back({ 0, angle, 0 });
    }
    for (double angle = 0; angle <= 180; angle += 20)
    {
      result.push_back({ angle, 0, 0 });
    }
    result.insert(result.end(),
                  { { 50, 0, 40 }, { 65, 0, 20 }, { 40, 0, 70 }, { 85, 0, 30 }, { 70, 0, 110 }, { 25, 0, 200 } });
    return result;
  }();
  return views;
}

ViewTransformType::Pointer
MakeView(const ImageBase<3> * image, const Angles & angles)
{
  auto transform = ViewTransformType::New();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    ViewTransformType::OutputVectorType direction(0.0);
    direction[axis] = 1.0;
    transform->Rotate3D(direction, -angles[axis] * Math::pi_over_180);
  }
  transform->SetMatrix(image->GetDirection() * transform->GetMatrix());
  transform->SetOffset(ShearWarpMIPView::GetCenter(image).GetVectorFromOrigin());
  return transform;
}
} // namespace itk::ShearWarpBenchmark
