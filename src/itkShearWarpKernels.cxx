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
#include "itkShearWarpPixelTypes.h"
#include "itkShearWarpVectorKernelSets.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <type_traits>

namespace itk::ShearWarp
{

SamplingPosition
QuantizePosition(double position)
{
  const auto quantized = static_cast<std::int64_t>(std::floor(position * One + 0.5));
  return { static_cast<std::int32_t>(quantized >> FractionBits), static_cast<std::int32_t>(quantized & (One - 1)) };
}

RowSpan
FindSamples(const SamplingPosition & position, std::ptrdiff_t voxels, Ends ends)
{
  const bool isLastNearer = position.fraction > One / 2;
  return { ends.first ? isLastNearer : 1, voxels + (ends.last && isLastNearer) };
}

std::ptrdiff_t
FindFirstRow(const Block & block, const SlicePlacement * placements, std::ptrdiff_t slice)
{
  if (block.hasCommonRows)
  {
    slice = std::min(slice / BlockLength * BlockLength + BlockLength / 2, block.sliceEnd - 1);
  }
  return placements[slice].row.whole;
}

RowSpan
FindRows(const Block & block, const SlicePlacement * placements, std::ptrdiff_t slice)
{
  const std::ptrdiff_t difference = FindFirstRow(block, placements, slice) - placements[slice].row.whole;
  const auto           shift = [&](std::ptrdiff_t row) {
    const bool isEnd = row == 0 || row == block.rows;
    return isEnd ? row : std::clamp<std::ptrdiff_t>(row + difference, 0, block.rows);
  };
  return { shift(block.rowBegin), shift(block.rowEnd) };
}

double
ShearedFunction::operator()(double column, double row, double slice) const
{
  return perColumn * column + ((perRow * row + perSlice * slice) + constant);
}

ColumnSpan
ClipColumns(const ShearedFunction & function, double low, double high, double row, double slice, ColumnSpan span)
{
  // monotonic in the column, rounding included
  const double rest = function(0.0, row, slice);
  const auto   getValue = [&](std::int32_t column) { return function.perColumn * column + rest; };
  if (span.begin >= span.end)
  {
    return span;
  }
  const auto [lowest, highest] = std::minmax({ getValue(span.begin), getValue(span.end - 1) });
  if (lowest >= low && highest <= high)
  {
    return span;
  }
  if (!(highest >= low && lowest <= high))
  {
    return { span.begin, span.begin };
  }
  const auto findFirst = [span](const auto & isReached) {
    std::int32_t begin = span.begin;
    std::int32_t end = span.end;
    while (begin < end)
    {
      const std::int32_t middle = begin + (end - begin) / 2;
      (isReached(middle) ? end : begin) = isReached(middle) ? middle : middle + 1;
    }
    return begin;
  };
  if (function.perColumn >= 0)
  {
    return { findFirst([&](std::int32_t column) { return getValue(column) >= low; }),
             findFirst([&](std::int32_t column) { return getValue(column) > high; }) };
  }
  return { findFirst([&](std::int32_t column) { return getValue(column) <= high; }),
           findFirst([&](std::int32_t column) { return getValue(column) < low; }) };
}

std::vector<std::string>
GetInstructionSets()
{
  std::vector<std::string> names{ "portable" };
#ifdef ShearWarpMIP_HAS_X86_KERNELS
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2"))
  {
    names.emplace_back("avx2");
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512vnni"))
    {
      names.emplace_back("avx512");
    }
  }
#endif
  return names;
}

namespace
{
std::string
ChooseInstructionSet()
{
  static const std::vector<std::string> available = GetInstructionSets();
  const char *                          wanted = std::getenv("SHEARWARPMIP_INSTRUCTION_SET");
  if (!wanted || !*wanted)
  {
    return available.back();
  }
  std::string names;
  for (const std::string & name : available)
  {
    if (name == wanted)
    {
      return name;
    }
    names += ' ' + name;
  }
  throw std::invalid_argument("SHEARWARPMIP_INSTRUCTION_SET is \"" + std::string(wanted) +
                              "\"; this computer has:" + names);
}

template <typename TPixel>
constexpr bool HasVectorKernels = false;
#define HAS_VECTOR_KERNELS(TPixel) \
  template <>                      \
  constexpr bool HasVectorKernels<TPixel> = true;
SHEARWARP_FOR_EACH_VECTOR_PIXEL_TYPE(HAS_VECTOR_KERNELS)
#undef HAS_VECTOR_KERNELS
} // namespace

template <typename TPixel>
const Kernels<TPixel> &
GetKernels()
{
  [[maybe_unused]] const std::string name = ChooseInstructionSet();
#ifdef ShearWarpMIP_HAS_X86_KERNELS
  if constexpr (HasVectorKernels<TPixel>)
  {
    if (name == "avx512")
    {
      return GetAVX512Kernels<TPixel>();
    }
    if (name == "avx2")
    {
      return GetAVX2Kernels<TPixel>();
    }
  }
#endif
  return GetPortableKernels<TPixel>();
}

#define INSTANTIATE(TPixel) template const Kernels<TPixel> & GetKernels();
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE

} // namespace itk::ShearWarp
