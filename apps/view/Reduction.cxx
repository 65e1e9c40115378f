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
#include "Reduction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace
{
using ModeEnum = ProjectionOptions::ModeEnum;

/** The voxels from \a begin to before \a end. */
struct Box
{
  std::array<std::size_t, 3> begin;
  std::array<std::size_t, 3> end;

  bool
  IsEmpty() const
  {
    return end[0] <= begin[0];
  }

  void
  Add(std::size_t x, std::size_t y, std::size_t z)
  {
    const std::array<std::size_t, 3> place{ { x, y, z } };
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      begin[axis] = std::min(begin[axis], place[axis]);
      end[axis] = std::max(end[axis], place[axis] + 1);
    }
  }
};

constexpr std::size_t nowhere = std::numeric_limits<std::size_t>::max();
constexpr Box         emptyBox{ { { nowhere, nowhere, nowhere } }, { { 0, 0, 0 } } };

Box
GetWhole(const itk::ImageBase<3> & grid)
{
  const auto size = grid.GetLargestPossibleRegion().GetSize();
  return { { { 0, 0, 0 } }, { { size[0], size[1], size[2] } } };
}

/** Calls function(x, y, z, voxel) for each voxel of a box. */
template <typename TPixel, typename TFunction>
void
ForEach(itk::VectorImage<TPixel, 3> & image, const Box & box, const TFunction & function)
{
  const auto size = image.GetLargestPossibleRegion().GetSize();
  for (std::size_t z = box.begin[2]; z < box.end[2]; ++z)
  {
    for (std::size_t y = box.begin[1]; y < box.end[1]; ++y)
    {
      TPixel * const row = image.GetBufferPointer() + (z * size[1] + y) * size[0];
      for (std::size_t x = box.begin[0]; x < box.end[0]; ++x)
      {
        function(x, y, z, row[x]);
      }
    }
  }
}

/** The least voxel that is a number, or the greatest value if there is none. */
template <typename TPixel>
TPixel
FindLeast(itk::VectorImage<TPixel, 3> & image, const Box & box)
{
  TPixel least = std::numeric_limits<TPixel>::max();
  ForEach(image, box, [&least](std::size_t, std::size_t, std::size_t, TPixel voxel) {
    least = voxel < least ? voxel : least;
  });
  return least;
}

/** Gives voxels outside of mask and crop the least value, and returns the box of the voxels whose centers are in the
 * crop. */
template <typename TPixel>
Box
Clear(itk::VectorImage<TPixel, 3> & image, const ProjectionOptions & options)
{
  const Box  whole = GetWhole(image);
  const auto isFinite = [](double bound) { return std::isfinite(bound); };
  const bool isCropped = std::any_of(options.cropLower.Begin(), options.cropLower.End(), isFinite) ||
                         std::any_of(options.cropUpper.Begin(), options.cropUpper.End(), isFinite);
  if (!isCropped && !options.mask)
  {
    return whole;
  }
  const auto isInCrop = [&](std::size_t x, std::size_t y, std::size_t z) {
    const itk::Index<3> index{
      { static_cast<itk::IndexValueType>(x), static_cast<itk::IndexValueType>(y), static_cast<itk::IndexValueType>(z) }
    };
    const auto point = image.template TransformIndexToPhysicalPoint<double>(index);
    bool       isInside = true;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      isInside = isInside && point[axis] >= options.cropLower[axis] && point[axis] <= options.cropUpper[axis];
    }
    return isInside;
  };
  Box box = isCropped ? emptyBox : whole;
  if (isCropped)
  {
    ForEach(image, whole, [&](std::size_t x, std::size_t y, std::size_t z, TPixel) {
      if (isInCrop(x, y, z))
      {
        box.Add(x, y, z);
      }
    });
    if (box.IsEmpty())
    {
      throw std::runtime_error("--crop: no voxel of INPUT is in the box");
    }
  }

  const TPixel                least = FindLeast(image, whole);
  const unsigned char * const mask = options.mask ? options.mask->GetBufferPointer() : nullptr;
  const TPixel * const        first = image.GetBufferPointer();
  bool                        hasCleared = false;
  ForEach(image, box, [&](std::size_t x, std::size_t y, std::size_t z, TPixel & voxel) {
    if ((mask && mask[&voxel - first] == 0) || (isCropped && !isInCrop(x, y, z)))
    {
      voxel = least;
      hasCleared = true;
    }
  });
  if (hasCleared && options.mode != ModeEnum::Maximum)
  {
    throw std::runtime_error(std::string(mask ? "--mask" : "--crop, which cuts oblique voxels off,") +
                             " is not possible with --page-volume unless --mode is maximum: voxels that are left out "
                             "get the least value");
  }
  return box;
}

/** The voxels above the background, and one more at each side. */
template <typename TPixel>
Box
FindContent(itk::VectorImage<TPixel, 3> & image, const Box & box)
{
  TPixel background = std::numeric_limits<TPixel>::max();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    Box first = box;
    Box last = box;
    first.end[axis] = first.begin[axis] + 1;
    last.begin[axis] = last.end[axis] - 1;
    background = std::min({ background, FindLeast(image, first), FindLeast(image, last) });
  }
  Box content = emptyBox;
  ForEach(image, box, [&](std::size_t x, std::size_t y, std::size_t z, TPixel voxel) {
    if (voxel > background)
    {
      content.Add(x, y, z);
    }
  });
  if (content.IsEmpty())
  {
    return box;
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    content.begin[axis] = std::max(content.begin[axis], box.begin[axis] + 1) - 1;
    content.end[axis] = std::min(content.end[axis] + 1, box.end[axis]);
  }
  return content;
}

/** How many voxels make a block along each axis. */
std::array<std::size_t, 3>
ChooseFactors(const Box & box, const itk::ImageBase<3> & grid, std::size_t most)
{
  std::array<std::size_t, 3> factors{};
  double                     edge = 0.0;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    factors[axis] = (box.end[axis] - box.begin[axis] - 1) / most + 1;
    if (factors[axis] > 1)
    {
      edge = std::max(edge, static_cast<double>(factors[axis]) * grid.GetSpacing()[axis]);
    }
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto length = static_cast<double>(box.end[axis] - box.begin[axis]);
    const auto factor = static_cast<std::size_t>(std::min(length, std::round(edge / grid.GetSpacing()[axis])));
    factors[axis] = std::max(factors[axis], factor);
  }
  return factors;
}

/** Makes one value of several: their maximum, minimum or mean. */
template <typename TPixel>
class Block
{
public:
  explicit Block(ModeEnum mode)
    : m_Mode(mode)
  {}

  void
  Add(TPixel voxel)
  {
    if (voxel != voxel)
    {
      return;
    }
    ++m_Count;
    m_Sum += m_Mode == ModeEnum::Mean ? static_cast<double>(voxel) : 0.0;
    if (m_Count == 1 || (m_Mode == ModeEnum::Minimum ? voxel < m_Extremum : voxel > m_Extremum))
    {
      m_Extremum = voxel;
    }
  }

  TPixel
  Get() const
  {
    if (m_Count == 0)
    {
      return std::numeric_limits<TPixel>::quiet_NaN();
    }
    if (m_Mode != ModeEnum::Mean)
    {
      return m_Extremum;
    }
    const double mean = m_Sum / static_cast<double>(m_Count);
    return static_cast<TPixel>(std::is_integral_v<TPixel> ? std::round(mean) : mean);
  }

private:
  ModeEnum    m_Mode;
  std::size_t m_Count{ 0 };
  double      m_Sum{ 0.0 };
  TPixel      m_Extremum{};
};

itk::ImageBase<3>::Pointer
MakeGrid(const itk::ImageBase<3> & whole, const Box & box, const std::array<std::size_t, 3> & factors)
{
  const auto                      grid = itk::ImageBase<3>::New();
  itk::Size<3>                    size{};
  itk::Vector<double, 3>          spacing;
  itk::ContinuousIndex<double, 3> first;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto factor = static_cast<double>(factors[axis]);
    size[axis] = (box.end[axis] - box.begin[axis] - 1) / factors[axis] + 1;
    spacing[axis] = factor * whole.GetSpacing()[axis];
    first[axis] = static_cast<double>(box.begin[axis]) + 0.5 * (factor - 1.0);
  }
  grid->SetRegions(size);
  grid->SetSpacing(spacing);
  grid->SetDirection(whole.GetDirection());
  grid->SetOrigin(whole.TransformContinuousIndexToPhysicalPoint<double>(first));
  return grid;
}

template <typename TPixel>
AnyImage
MakeBlocks(itk::VectorImage<TPixel, 3> & image, const Box & box, std::size_t most, ModeEnum mode)
{
  const auto factors = ChooseFactors(box, image, most);
  const Box  whole = GetWhole(image);
  if (box.begin == whole.begin && box.end == whole.end && *std::max_element(factors.begin(), factors.end()) == 1)
  {
    return { &image, itk::ImageIOBase::MapPixelType<TPixel>::CType };
  }
  AnyImage reduced = MakeAnyImage<TPixel>(MakeGrid(image, box, factors), 1);
  auto &   blocks = CastImage<TPixel>(reduced);
  ForEach(blocks, GetWhole(blocks), [&](std::size_t x, std::size_t y, std::size_t z, TPixel & voxel) {
    const std::array<std::size_t, 3> place{ { x, y, z } };
    Box                              ofBlock{};
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      ofBlock.begin[axis] = box.begin[axis] + place[axis] * factors[axis];
      ofBlock.end[axis] = std::min(ofBlock.begin[axis] + factors[axis], box.end[axis]);
    }
    Block<TPixel> block(mode);
    ForEach(image, ofBlock, [&block](std::size_t, std::size_t, std::size_t, TPixel of) { block.Add(of); });
    voxel = block.Get();
  });
  return reduced;
}
} // namespace

Reduction
Reduce(const Volume & volume, const ProjectionOptions & options, std::size_t most)
{
  const AnyImage & whole = volume.times.front();
  Reduction        reduction;
  reduction.whole = itk::ImageBase<3>::New();
  reduction.whole->CopyInformation(whole.image);
  DispatchPixelType(whole.componentType, [&](auto tag) {
    using PixelType = typename decltype(tag)::Type;
    auto &    image = CastImage<PixelType>(whole);
    const Box rest = Clear(image, options);
    const Box box = options.mode == ModeEnum::Maximum ? FindContent(image, rest) : rest;
    reduction.image = MakeBlocks(image, box, most, options.mode);
    ForEach(image, box, [&](std::size_t, std::size_t, std::size_t, PixelType voxel) {
      reduction.notNumbers += voxel != voxel ? 1 : 0;
    });
  });
  reduction.pixels = reduction.image.image == whole.image ? volume.pixels : nullptr;
  return reduction;
}
