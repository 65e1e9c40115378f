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
#include "PreparedVolume.h"
#include "itkShearWarpEngine.h"
#include "kernels/PixelTypes.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace itk
{
namespace
{
/** Returns null if a cast integer is no enumerator. */
const char *
GetName(ShearWarp::Mode value)
{
  using ShearWarp::Mode;
  switch (value)
  {
    case Mode::Maximum:
      return "Maximum";
    case Mode::Minimum:
      return "Minimum";
    case Mode::AbsoluteMaximum:
      return "AbsoluteMaximum";
    case Mode::Mean:
      return "Mean";
  }
  return nullptr;
}

const char *
GetName(ShearWarp::ReducedResampling value)
{
  using ShearWarp::ReducedResampling;
  switch (value)
  {
    case ReducedResampling::Off:
      return "Off";
    case ReducedResampling::On:
      return "On";
    case ReducedResampling::Auto:
      return "Auto";
  }
  return nullptr;
}

const char *
GetName(ShearWarp::Interpolation value)
{
  using ShearWarp::Interpolation;
  switch (value)
  {
    case Interpolation::Linear:
      return "Linear";
    case Interpolation::Nearest:
      return "Nearest";
  }
  return nullptr;
}

template <typename TEnum>
std::ostream &
WriteName(std::ostream & out, const char * type, TEnum value)
{
  const char * name = GetName(value);
  return out << "itk::ShearWarpMIPImageFilterEnums::" << type << "::" << (name ? name : "INVALID VALUE");
}

template <typename... TParts>
void
Refuse(const TParts &... parts)
{
  std::ostringstream text;
  (text << ... << parts);
  ShearWarp::RefuseParameter(text.str());
}

std::string
WritePoint(const double (&point)[3])
{
  std::ostringstream text;
  text << '[' << point[0] << ", " << point[1] << ", " << point[2] << ']';
  return text.str();
}
} // namespace

std::ostream &
operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::Mode value)
{
  return WriteName(out, "Mode", value);
}

std::ostream &
operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::ReducedResampling value)
{
  return WriteName(out, "ReducedResampling", value);
}

std::ostream &
operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::Interpolation value)
{
  return WriteName(out, "Interpolation", value);
}

namespace ShearWarp
{
bool
HasFeature(Mode mode, Feature feature)
{
  switch (mode)
  {
    case Mode::Maximum:
    case Mode::Minimum:
      return true;
    case Mode::AbsoluteMaximum:
      return feature != Feature::LocalMaximum;
    case Mode::Mean:
      return false;
  }
  return false;
}

std::size_t
CountSlabs(SliceRange slices, std::size_t wanted)
{
  const auto blocks = static_cast<std::size_t>(std::max<std::ptrdiff_t>(CountBlocks(slices.end - slices.begin), 1));
  return std::clamp<std::size_t>(wanted, 1, blocks);
}

SliceRange
GetSlab(SliceRange slices, std::size_t n, std::size_t slabs)
{
  const auto blocks = static_cast<std::size_t>(CountBlocks(slices.end - slices.begin));
  const auto getEnd = [=](std::size_t count) {
    return std::min(slices.begin + static_cast<std::ptrdiff_t>(count * blocks / slabs) * BlockLength, slices.end);
  };
  return { getEnd(n), getEnd(n + 1) };
}

template <typename TPixel>
bool
ProjectionRule<TPixel>::IsPlainMaximum() const
{
  return mode == Mode::Maximum && !this->HasRegion() && !this->NeedsRanks();
}

template <typename TPixel>
bool
ProjectionRule<TPixel>::HasRegion() const
{
  bool hasRegion = slabNear != -Infinity || slabFar != Infinity;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    hasRegion = hasRegion || cropLower[axis] != -Infinity || cropUpper[axis] != Infinity;
  }
  return hasRegion;
}

template <typename TPixel>
bool
ProjectionRule<TPixel>::NeedsRanks() const
{
  return hasDepth || hasMask || depthAttenuation > 0.0 || localMaximumThreshold || isExact;
}

template <typename TPixel>
void
ProjectionRule<TPixel>::Verify() const
{
  if (!GetName(mode))
  {
    Refuse("Mode must be one of its enumerators, but it is ", static_cast<unsigned int>(mode), '.');
  }
  if (!GetName(reducedResampling))
  {
    const auto value = static_cast<unsigned int>(reducedResampling);
    Refuse("ReducedResampling must be one of its enumerators, but it is ", value, '.');
  }
  if (!GetName(interpolation))
  {
    const auto value = static_cast<unsigned int>(interpolation);
    Refuse("Interpolation must be one of its enumerators, but it is ", value, '.');
  }
  if (oversampling != 1 && oversampling != 2)
  {
    Refuse("Oversampling must be 1 or 2, but it is ", oversampling, '.');
  }
  if (!(slabNear <= slabFar && slabNear < Infinity && slabFar > -Infinity))
  {
    const char * text = "SlabNear must be less than infinity and not greater than SlabFar, but they are ";
    Refuse(text, slabNear, " and ", slabFar, '.');
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    if (!(cropLower[axis] <= cropUpper[axis]))
    {
      const char * text = "CropLower must not be greater than CropUpper, but they are ";
      Refuse(text, WritePoint(cropLower), " and ", WritePoint(cropUpper), '.');
    }
  }
  if (!(depthAttenuation >= 0.0 && std::isfinite(depthAttenuation)))
  {
    Refuse("DepthAttenuation must be finite and not negative, but it is ", depthAttenuation, '.');
  }
  if (depthAttenuation > 0.0 && !std::isfinite(static_cast<double>(background)))
  {
    Refuse("DefaultPixelValue must be finite where samples fade to it, but it is ", background, '.');
  }
  if (localMaximumThreshold && *localMaximumThreshold != *localMaximumThreshold)
  {
    Refuse("LocalMaximumThreshold must be a number, but it is ", *localMaximumThreshold, '.');
  }
  if (localMaximumThreshold && !HasFeature(mode, Feature::LocalMaximum))
  {
    Refuse("LocalMaximum needs Mode Maximum or Minimum, but Mode is ", GetName(mode), '.');
  }
  if (hasDepth && !HasFeature(mode, Feature::Depth))
  {
    Refuse("ComputeDepth needs another Mode: Mode is ", GetName(mode), '.');
  }
  if (isExact && !HasFeature(mode, Feature::Exact))
  {
    Refuse("Exact needs another Mode: Mode is ", GetName(mode), '.');
  }
  if (interpolation == Interpolation::Nearest && !HasFeature(mode, Feature::Nearest))
  {
    Refuse("Interpolation Nearest needs another Mode: Mode is ", GetName(mode), '.');
  }
  if (interpolation == Interpolation::Nearest && (isExact || depthAttenuation > 0.0 || oversampling != 1))
  {
    Refuse("Interpolation Nearest keeps the values of voxels: Exact, DepthAttenuation and Oversampling must be as by "
           "default.");
  }
  if (isExact && (hasMask || localMaximumThreshold || depthAttenuation > 0.0 || oversampling != 1))
  {
    Refuse("Exact pictures have no MaskImage, LocalMaximum, DepthAttenuation or Oversampling: these must be as by "
           "default.");
  }
}

template <typename TPixel>
void
ProjectionRule<TPixel>::VerifyForParts() const
{
  if (hasMask || localMaximumThreshold || depthAttenuation > 0.0)
  {
    Refuse("Parts have no MaskImage, LocalMaximum or DepthAttenuation: these must be as by default.");
  }
  if (mode == Mode::Mean && std::is_floating_point_v<TPixel>)
  {
    Refuse("Parts have no Mode Mean of floating-point pixels, because its bits depend on the order of samples.");
  }
}

#define INSTANTIATE(TPixel) template struct ProjectionRule<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace ShearWarp
} // namespace itk
