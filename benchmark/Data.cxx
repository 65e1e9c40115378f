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

#include "itkMultiThreaderBase.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

namespace itk::ShearWarpBenchmark
{
namespace
{
using VolumeType = Image<std::uint16_t, 3>;
using VectorType = std::array<double, 3>;

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

/** Uniform in [0, 1). */
double
Uniform(std::uint64_t counter)
{
  return static_cast<double>(Hash(counter) >> 11) * 0x1.0p-53;
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

/** A smooth random function of the volume's extent, in [0, 1): linear between the nodes of a lattice. */
class SmoothField
{
public:
  SmoothField(const Size<3> & size, unsigned int cells, std::uint64_t seed)
    : m_Size(size)
    , m_Cells(cells)
    , m_Seed(seed)
  {}

  /** The field's values along the row of voxels at (y, z). */
  void
  GetRow(SizeValueType y, SizeValueType z, std::vector<float> & row) const
  {
    const Position     py = this->Locate(y, 1);
    const Position     pz = this->Locate(z, 2);
    std::vector<float> nodes(m_Cells + 1);
    for (unsigned int x = 0; x <= m_Cells; ++x)
    {
      const float near = Interpolate(this->Node(x, py.cell, pz.cell), this->Node(x, py.cell + 1, pz.cell), py.fraction);
      const float far =
        Interpolate(this->Node(x, py.cell, pz.cell + 1), this->Node(x, py.cell + 1, pz.cell + 1), py.fraction);
      nodes[x] = Interpolate(near, far, pz.fraction);
    }
    row.resize(m_Size[0]);
    for (SizeValueType x = 0; x < m_Size[0]; ++x)
    {
      const Position px = this->Locate(x, 0);
      row[x] = Interpolate(nodes[px.cell], nodes[px.cell + 1], px.fraction);
    }
  }

private:
  struct Position
  {
    unsigned int cell;
    float        fraction;
  };

  Position
  Locate(SizeValueType index, unsigned int axis) const
  {
    const float position = static_cast<float>(index) * static_cast<float>(m_Cells) / static_cast<float>(m_Size[axis]);
    const auto  cell = std::min(static_cast<unsigned int>(position), m_Cells - 1);
    return { cell, position - static_cast<float>(cell) };
  }

  float
  Node(unsigned int x, unsigned int y, unsigned int z) const
  {
    return static_cast<float>(
      Uniform(m_Seed + (static_cast<std::uint64_t>(z) * (m_Cells + 1) + y) * (m_Cells + 1) + x));
  }

  static float
  Interpolate(float a, float b, float fraction)
  {
    return a + fraction * (b - a);
  }

  Size<3>       m_Size;
  unsigned int  m_Cells;
  std::uint64_t m_Seed;
};

struct VesselOptions
{
  unsigned int trees;
  double       smallestRadius; // of a trunk, in voxels
  double       largestRadius;
  double       lowestValue;
  double       highestValue;
};

/** Draws branching vessels that enter the volume at its lowest slice and wander upwards. */
class VesselPainter
{
public:
  VesselPainter(VolumeType & volume, std::uint64_t seed)
    : m_Volume(volume)
    , m_Size(volume.GetLargestPossibleRegion().GetSize())
    , m_Counter(seed)
  {}

  void
  Paint(const VesselOptions & options)
  {
    const double length = 0.9 * static_cast<double>(*std::max_element(m_Size.begin(), m_Size.end()));
    for (unsigned int tree = 0; tree < options.trees; ++tree)
    {
      const VectorType entry = { this->Random(0.3, 0.7) * static_cast<double>(m_Size[0]),
                                 this->Random(0.3, 0.7) * static_cast<double>(m_Size[1]),
                                 2.0 };
      const VectorType direction = { this->Random(-0.5, 0.5), this->Random(-0.5, 0.5), 1.0 };
      const double     radius = this->Random(options.smallestRadius, options.largestRadius);
      const double     value = this->Random(options.lowestValue, options.highestValue);
      this->PaintVessel({ entry, direction, radius, value, length, 0 });
    }
  }

private:
  struct Vessel
  {
    VectorType   position;
    VectorType   direction;
    double       radius;
    double       value;
    double       length;
    unsigned int generation;
  };

  double
  Random(double low, double high)
  {
    return low + (high - low) * Uniform(m_Counter++);
  }

  void
  PaintVessel(Vessel vessel)
  {
    constexpr unsigned int generations = 5;
    constexpr double       step = 0.7;
    constexpr double       branchesPerStep = 0.012;
    for (double walked = 0.0; walked < vessel.length; walked += step)
    {
      Turn(vessel.direction, 0.09);
      for (unsigned int axis = 0; axis < 3; ++axis)
      {
        vessel.position[axis] += step * vessel.direction[axis];
      }
      if (!this->PaintSphere(vessel))
      {
        return;
      }
      const double thinner = 0.7 * vessel.radius;
      if (this->Random(0.0, 1.0) < branchesPerStep && vessel.generation < generations && thinner > 0.35)
      {
        Vessel branch = vessel;
        Turn(branch.direction, 0.6);
        branch.radius = thinner;
        branch.value *= 0.93;
        branch.length *= 0.6;
        ++branch.generation;
        this->PaintVessel(branch);
      }
    }
  }

  /** Changes a direction by up to \a amount in each component. */
  void
  Turn(VectorType & direction, double amount)
  {
    double squaredNorm = 0.0;
    for (double & component : direction)
    {
      component += this->Random(-amount, amount);
      squaredNorm += component * component;
    }
    for (double & component : direction)
    {
      component /= std::sqrt(squaredNorm);
    }
  }

  /** Returns whether any of the sphere is in the volume. Its edge is one voxel wide. */
  bool
  PaintSphere(const Vessel & vessel)
  {
    std::array<IndexValueType, 3> first;
    std::array<IndexValueType, 3> last;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const double reach = vessel.radius + 0.5;
      first[axis] = std::max<IndexValueType>(0, Math::Ceil<IndexValueType>(vessel.position[axis] - reach));
      last[axis] = std::min<IndexValueType>(static_cast<IndexValueType>(m_Size[axis]) - 1,
                                            Math::Floor<IndexValueType>(vessel.position[axis] + reach));
      if (first[axis] > last[axis])
      {
        return false;
      }
    }
    const auto squaredDistance = [&vessel](IndexValueType index, unsigned int axis) {
      const double distance = static_cast<double>(index) - vessel.position[axis];
      return distance * distance;
    };
    for (IndexValueType z = first[2]; z <= last[2]; ++z)
    {
      for (IndexValueType y = first[1]; y <= last[1]; ++y)
      {
        std::uint16_t * row = m_Volume.GetBufferPointer() + m_Volume.ComputeOffset({ { 0, y, z } });
        const double    squaredDistanceOfRow = squaredDistance(z, 2) + squaredDistance(y, 1);
        for (IndexValueType x = first[0]; x <= last[0]; ++x)
        {
          const double depth = vessel.radius + 0.5 - std::sqrt(squaredDistanceOfRow + squaredDistance(x, 0));
          const auto   value = static_cast<std::uint16_t>(vessel.value * std::clamp(depth, 0.0, 1.0));
          row[x] = std::max(row[x], value);
        }
      }
    }
    return true;
  }

  VolumeType &  m_Volume;
  Size<3>       m_Size;
  std::uint64_t m_Counter;
};

/** Calls function(y, z, row of voxels, number of its first voxel) for all rows, in parallel. */
template <typename TFunction>
void
ForEachRow(VolumeType & volume, const TFunction & function)
{
  const Size<3> size = volume.GetLargestPossibleRegion().GetSize();
  MultiThreaderBase::New()->ParallelizeArray(
    0,
    size[2],
    [&](SizeValueType z) {
      for (SizeValueType y = 0; y < size[1]; ++y)
      {
        const std::uint64_t first = (z * size[1] + y) * size[0];
        function(y, z, volume.GetBufferPointer() + first, first);
      }
    },
    nullptr);
}

double
Square(double value)
{
  return value * value;
}

/** Squared distance from the centre of an ellipsoid in units of its half axes. All lengths are fractions of the
 * volume's size; a volume that is much shorter than wide is a slab of a taller body. */
class Ellipsoid
{
public:
  Ellipsoid(const Size<3> & size, const VectorType & centre, const VectorType & halfAxes)
    : m_Size(size)
    , m_Centre(centre)
    , m_HalfAxes(halfAxes)
  {}

  double
  GetSquaredDistanceAlong(unsigned int axis, SizeValueType index) const
  {
    const bool isSlab = axis == 2 && 2 * m_Size[2] < m_Size[0];
    return isSlab ? 0.0
                  : Square((static_cast<double>(index) / static_cast<double>(m_Size[axis]) - m_Centre[axis]) /
                           m_HalfAxes[axis]);
  }

  double
  GetSquaredDistanceOfRow(SizeValueType y, SizeValueType z) const
  {
    return this->GetSquaredDistanceAlong(1, y) + this->GetSquaredDistanceAlong(2, z);
  }

private:
  Size<3>    m_Size;
  VectorType m_Centre;
  VectorType m_HalfAxes;
};

/** The arteries of both angiograms. */
void
PaintArteries(VolumeType & volume)
{
  const Size<3> size = volume.GetLargestPossibleRegion().GetSize();
  const auto    width = static_cast<double>(size[0]);
  VesselPainter(volume, 0xA47E41E5).Paint({ size[2] < size[0] ? 6U : 10U, width / 160, width / 90, 2200, 3800 });
}

void
FillWithTimeOfFlightAngiogram(VolumeType & volume)
{
  PaintArteries(volume);
  const Size<3>     size = volume.GetLargestPossibleRegion().GetSize();
  const Ellipsoid   brain(size, { 0.5, 0.5, 0.5 }, { 0.40, 0.46, 0.47 });
  const SmoothField field(size, 5, 1);
  ForEachRow(volume, [&](SizeValueType y, SizeValueType z, std::uint16_t * row, std::uint64_t first) {
    constexpr double   scalp = 1.12;
    const double       squaredDistanceOfRow = brain.GetSquaredDistanceOfRow(y, z);
    std::vector<float> texture;
    field.GetRow(y, z, texture);
    for (SizeValueType x = 0; x < size[0]; ++x)
    {
      const double squaredDistance = squaredDistanceOfRow + brain.GetSquaredDistanceAlong(0, x);
      const float  tissue = squaredDistance < 1.0     ? 300.0F + 300.0F * texture[x]
                            : squaredDistance < scalp ? 250.0F + 150.0F * texture[x]
                                                      : 0.0F;
      row[x] = RoundTo12Bits(AddRicianNoise(std::max(tissue, static_cast<float>(row[x])), 45.0F, first + x));
    }
  });
}

void
FillWithSuppressedBackgroundAngiogram(VolumeType & volume)
{
  PaintArteries(volume);
  const Size<3>   size = volume.GetLargestPossibleRegion().GetSize();
  const Ellipsoid mask(size, { 0.5, 0.5, 0.5 }, { 0.35, 0.42, 0.45 });
  ForEachRow(volume, [&](SizeValueType y, SizeValueType z, std::uint16_t * row, std::uint64_t first) {
    const double squaredDistanceOfRow = mask.GetSquaredDistanceOfRow(y, z);
    for (SizeValueType x = 0; x < size[0]; ++x)
    {
      const bool inside = squaredDistanceOfRow + mask.GetSquaredDistanceAlong(0, x) < 1.0;
      row[x] = inside ? RoundTo12Bits(AddRicianNoise(static_cast<float>(row[x]), 8.0F, first + x)) : std::uint16_t{ 0 };
    }
  });
}

void
FillWithComputedTomogram(VolumeType & volume)
{
  const Size<3> size = volume.GetLargestPossibleRegion().GetSize();
  const auto    width = static_cast<double>(size[0]);
  VesselPainter(volume, 0xC0417A57).Paint({ 6, width / 120, width / 60, 1300, 1400 });

  const Ellipsoid   body(size, { 0.5, 0.5, 0.5 }, { 0.40, 0.32, 1e6 });
  const Ellipsoid   leftLung(size, { 0.33, 0.45, 0.65 }, { 0.13, 0.20, 0.30 });
  const Ellipsoid   rightLung(size, { 0.67, 0.45, 0.65 }, { 0.13, 0.20, 0.30 });
  const Ellipsoid   spine(size, { 0.5, 0.66, 0.5 }, { 0.045, 0.045, 1e6 });
  const SmoothField field(size, 8, 2);
  ForEachRow(volume, [&](SizeValueType y, SizeValueType z, std::uint16_t * row, std::uint64_t first) {
    const double       height = static_cast<double>(y) / static_cast<double>(size[1]);
    const bool         isTable = height > 0.86 && height < 0.88;
    const double       vertebra = 18.0 * static_cast<double>(z) / static_cast<double>(size[2]);
    const bool         isDisc = vertebra - std::floor(vertebra) < 0.15;
    std::vector<float> texture;
    field.GetRow(y, z, texture);
    for (SizeValueType x = 0; x < size[0]; ++x)
    {
      const auto squaredDistance = [&](const Ellipsoid & ellipsoid) {
        return ellipsoid.GetSquaredDistanceOfRow(y, z) + ellipsoid.GetSquaredDistanceAlong(0, x);
      };
      const double column = static_cast<double>(x) / static_cast<double>(size[0]);
      const double inBody = squaredDistance(body);
      float        value = isTable && std::abs(column - 0.5) < 0.4 ? 800.0F : 24.0F;
      if (inBody < 1.0)
      {
        value = inBody > 0.93 ? 924.0F : 1000.0F + 100.0F * texture[x];
        if (squaredDistance(leftLung) < 1.0 || squaredDistance(rightLung) < 1.0)
        {
          value = 150.0F + 60.0F * texture[x];
        }
        // ribs run obliquely around the chest
        const double rib = vertebra + 4.0 * std::abs(column - 0.5) - 2.0 * height;
        if (inBody > 0.72 && inBody < 0.80 && rib - std::floor(rib) < 0.45)
        {
          value = 1500.0F + 1100.0F * texture[x];
        }
        value = std::max(value, static_cast<float>(row[x]));
        const double inSpine = squaredDistance(spine);
        if (inSpine < 1.0 && !isDisc)
        {
          value = (inSpine > 0.68 ? 1850.0F : 1350.0F) + 150.0F * texture[x];
        }
      }
      const float deviation = inBody < 1.0 ? 15.0F : 10.0F;
      row[x] = RoundTo12Bits(value + deviation * Normal(first + x));
    }
  });
}

/** A filling function that calls valueOf(number of the voxel) for each voxel. */
template <typename TFunction>
std::function<void(VolumeType &)>
Voxelwise(const TFunction & valueOf)
{
  return [valueOf](VolumeType & volume) {
    const SizeValueType columns = volume.GetLargestPossibleRegion().GetSize(0);
    ForEachRow(volume, [&](SizeValueType, SizeValueType, std::uint16_t * row, std::uint64_t first) {
      for (SizeValueType x = 0; x < columns; ++x)
      {
        row[x] = valueOf(first + x);
      }
    });
  };
}
} // namespace

const std::vector<Kind> &
GetKinds()
{
  static const std::vector<Kind> kinds = {
    { "mra",
      "time-of-flight MR angiogram of a head: branching vessels 2200 to 3800 in tissue 300 to 600, Rician noise of 45",
      12,
      FillWithTimeOfFlightAngiogram },
    { "ct",
      "CT angiogram of a chest, HU + 1024: air 24, soft tissue 1000 to 1100, lungs, contrast, bones to 2600, table, "
      "noise of 10 to 15",
      12,
      FillWithComputedTomogram },
    { "noise16", "uniform noise of the full 16 bits", 16, Voxelwise([](std::uint64_t voxel) {
        return static_cast<std::uint16_t>(Hash(voxel) >> 48);
      }) },
    { "noise12",
      "normal noise, mean 1000 and deviation 100: flat, so that the least can be skipped",
      12,
      Voxelwise([](std::uint64_t voxel) { return RoundTo12Bits(1000.0F + 100.0F * Normal(voxel)); }) },
    { "sparse",
      "angiogram with suppressed background: the vessels of mra and Rician noise of 8 in an ellipsoid, 0 outside",
      12,
      FillWithSuppressedBackgroundAngiogram },
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

  const auto volume = VolumeType::New();
  volume->SetRegions(size);
  volume->Allocate(true);
  kind->fill(*volume);
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
