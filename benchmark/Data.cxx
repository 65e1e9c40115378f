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

#include "itkMultiThreaderBase.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace itk::ShearWarpBenchmark
{
namespace
{
using VolumeType = Image<std::uint16_t, 3>;

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

std::uint16_t
RoundTo12Bits(float value)
{
  return static_cast<std::uint16_t>(std::min(std::max(value, 0.0F) + 0.5F, 4095.0F));
}

/** Sets each voxel to \a makeValue(what it is, its number, its place), in parallel. */
template <typename TFunction>
void
SetVoxels(VolumeType & volume, const TFunction & makeValue)
{
  const Size<3> size = volume.GetBufferedRegion().GetSize();
  MultiThreaderBase::New()->ParallelizeArray(
    0,
    size[2],
    [&](SizeValueType z) {
      std::uint64_t number = z * size[1] * size[0];
      for (SizeValueType y = 0; y < size[1]; ++y)
      {
        for (SizeValueType x = 0; x < size[0]; ++x, ++number)
        {
          const SizeValueType index[] = { x, y, z };
          Vector<double, 3>   place;
          for (unsigned int axis = 0; axis < 3; ++axis)
          {
            place[axis] = volume.GetOrigin()[axis] + volume.GetSpacing()[axis] * static_cast<double>(index[axis]);
          }
          std::uint16_t & voxel = volume.GetBufferPointer()[number];
          voxel = makeValue(voxel, number, place);
        }
      }
    },
    nullptr);
}

/** A filling function of \a makeValue, called as by SetVoxels() for a head with arteries. */
template <typename TFunction>
std::function<void(VolumeType &)>
Head(const TFunction & makeValue)
{
  return [makeValue](VolumeType & volume) {
    const auto random = Phantom::RandomType::New();
    random->SetSeed(2002);
    Phantom::PaintArteries(volume, *random);
    SetVoxels(volume, makeValue);
  };
}

/** A filling function of \a makeValue(number of the voxel). */
template <typename TFunction>
std::function<void(VolumeType &)>
Voxelwise(const TFunction & makeValue)
{
  return [makeValue](VolumeType & volume) {
    SetVoxels(volume, [&](std::uint16_t, std::uint64_t number, const auto &) { return makeValue(number); });
  };
}

// the program's head has up to 892
constexpr float Contrast = 4.0F;

std::uint16_t
MakeTimeOfFlight(std::uint16_t artery, std::uint64_t number, const Vector<double, 3> & place)
{
  const float signal = std::max(static_cast<float>(artery), static_cast<float>(Phantom::GetTissue(place)));
  return RoundTo12Bits(AddRicianNoise(Contrast * signal, 45.0F, number));
}

std::uint16_t
MakeSuppressedBackground(std::uint16_t artery, std::uint64_t number, const Vector<double, 3> & place)
{
  return Phantom::IsInBrain(place) ? RoundTo12Bits(AddRicianNoise(Contrast * static_cast<float>(artery), 8.0F, number))
                                   : std::uint16_t{ 0 };
}

std::uint16_t
MakeComputedTomogram(std::uint16_t artery, std::uint64_t number, const Vector<double, 3> & place)
{
  const auto  tissue = static_cast<float>(Phantom::GetTissue(place));
  const bool  isBone = tissue == static_cast<float>(Phantom::Bone);
  const float value = tissue == 0.0F ? 24.0F : isBone ? 2000.0F : 1000.0F + 0.4F * tissue;
  const float contrast = 1000.0F + 0.5F * static_cast<float>(artery);
  return RoundTo12Bits((artery > 0 ? std::max(value, contrast) : value) + 15.0F * Normal(number));
}
} // namespace

const std::vector<Kind> &
GetKinds()
{
  static const std::vector<Kind> kinds = {
    { "mra",
      "time-of-flight MR angiogram of a head: arteries to 3568, tissue to 792, Rician noise of 45",
      12,
      Head(MakeTimeOfFlight) },
    { "ct",
      "CT angiogram of a head, HU + 1024: air 24, tissue 1030 to 1080, arteries to 1446, bone 2000, noise of 15",
      12,
      Head(MakeComputedTomogram) },
    { "noise16", "uniform noise of the full 16 bits", 16, Voxelwise([](std::uint64_t voxel) {
        return static_cast<std::uint16_t>(Hash(voxel) >> 48);
      }) },
    { "noise12",
      "normal noise, mean 1000 and deviation 100: flat, so that the least can be skipped",
      12,
      Voxelwise([](std::uint64_t voxel) { return RoundTo12Bits(1000.0F + 100.0F * Normal(voxel)); }) },
    { "sparse",
      "angiogram with suppressed background: the arteries of mra and Rician noise of 8 in the brain, 0 outside",
      12,
      Head(MakeSuppressedBackground) },
    { "const", "1000 everywhere", 12, Voxelwise([](std::uint64_t) { return std::uint16_t{ 1000 }; }) },
  };
  return kinds;
}

template <typename TPixel>
typename Image<TPixel, 3>::Pointer
MakeVolume(const std::string & name, const Size<3> & size)
{
  const auto & kinds = GetKinds();
  const auto kind = std::find_if(kinds.begin(), kinds.end(), [&name](const Kind & each) { return each.name == name; });
  if (kind == kinds.end())
  {
    itkGenericExceptionMacro("There is no kind of volume called '" << name << "'.");
  }

  const auto volume = Phantom::MakeGrid(size);
  kind->fill(*volume);
  volume->SetOrigin(Point<double, 3>());
  volume->SetSpacing(Vector<double, 3>(1.0));
  if constexpr (std::is_same_v<TPixel, std::uint16_t>)
  {
    return volume;
  }
  else
  {
    const unsigned int shift = sizeof(TPixel) == 1 ? kind->bits - 8 : 0;
    const int          offset = std::is_same_v<TPixel, std::int16_t> && kind->bits == 16 ? 32768 : 0;
    const auto         converted = Image<TPixel, 3>::New();
    converted->SetRegions(size);
    converted->Allocate();
    const std::uint16_t * values = volume->GetBufferPointer();
    std::transform(values,
                   values + volume->GetBufferedRegion().GetNumberOfPixels(),
                   converted->GetBufferPointer(),
                   [=](std::uint16_t value) { return static_cast<TPixel>((value >> shift) - offset); });
    return converted;
  }
}

template Image<std::uint8_t, 3>::Pointer
MakeVolume<std::uint8_t>(const std::string &, const Size<3> &);
template Image<std::int16_t, 3>::Pointer
MakeVolume<std::int16_t>(const std::string &, const Size<3> &);
template Image<std::uint16_t, 3>::Pointer
MakeVolume<std::uint16_t>(const std::string &, const Size<3> &);
template Image<float, 3>::Pointer
MakeVolume<float>(const std::string &, const Size<3> &);

} // namespace itk::ShearWarpBenchmark
