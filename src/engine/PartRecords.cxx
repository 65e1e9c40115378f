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
#include "PartRecords.h"

#include "Values.h"
#include "kernels/PixelTypes.h"

#include <cmath>
#include <cstring>

namespace itk::ShearWarp
{
namespace
{
/** Records are not aligned. */
template <typename T>
T
Load(const unsigned char * bytes)
{
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

template <typename T>
void
Store(const T & value, unsigned char * bytes)
{
  std::memcpy(bytes, &value, sizeof(T));
}

/** Merges extrema without ranks. */
template <Mode VMode, typename TPixel>
void
MergeValues(const unsigned char * records, unsigned char * into, std::ptrdiff_t count)
{
  for (std::ptrdiff_t n = 0; n < count; ++n)
  {
    const auto a = Load<TPixel>(records + n * static_cast<std::ptrdiff_t>(sizeof(TPixel)));
    const auto b = Load<TPixel>(into + n * static_cast<std::ptrdiff_t>(sizeof(TPixel)));
    Store(IsBetter<VMode>(a, b) ? a : b, into + n * static_cast<std::ptrdiff_t>(sizeof(TPixel)));
  }
}

/** Takes the better extremum, or the nearer of two equal ones. */
template <Mode VMode, typename TPixel>
void
MergeRanked(const unsigned char * record, unsigned char * into)
{
  const auto value = Load<TPixel>(record);
  const auto rank = Load<std::int32_t>(record + sizeof(TPixel));
  const auto other = Load<TPixel>(into);
  const auto otherRank = Load<std::int32_t>(into + sizeof(TPixel));
  if (rank > 0 && (otherRank == 0 || IsBetter<VMode>(value, other) || (value == other && rank < otherRank)))
  {
    std::memcpy(into, record, sizeof(TPixel) + sizeof(std::int32_t));
  }
}

template <typename TPixel>
void
MergeSums(const unsigned char * record, unsigned char * into)
{
  using Sum = SampleSum<TPixel>;
  auto sum = Load<Sum>(into);
  Merge(sum, Load<Sum>(record));
  Store(sum, into);
  Store(Load<std::uint32_t>(into + sizeof(Sum)) + Load<std::uint32_t>(record + sizeof(Sum)), into + sizeof(Sum));
}

/** Without depth, places are equal. */
template <Mode VMode, typename TNumber>
bool
IsExactBetter(TNumber value, double place, TNumber other, double otherPlace)
{
  return std::isnan(other) || IsBetter<VMode>(value, other) || (value == other && place < otherPlace);
}
} // namespace

template <typename TPixel>
std::size_t
PartRecords<TPixel>::GetSize() const
{
  if (m_Rule.isExact)
  {
    return sizeof(ExactNumber<TPixel>) + (m_Rule.hasDepth ? sizeof(double) : 0);
  }
  if (m_Rule.mode == Mode::Mean)
  {
    return sizeof(SampleSum<TPixel>) + sizeof(std::uint32_t);
  }
  return sizeof(TPixel) + (this->HasRanks() ? sizeof(std::int32_t) : 0);
}

template <typename TPixel>
bool
PartRecords<TPixel>::HasRanks() const
{
  return MayHaveGaps<TPixel>(m_Rule.mode, m_Rule.HasRegion(), m_Rule.NeedsRanks());
}

template <typename TPixel>
TPixel
PartRecords<TPixel>::GetNone() const
{
  switch (m_Rule.mode)
  {
    case Mode::Maximum:
      return NoSample<TPixel>;
    case Mode::Minimum:
      return NoSample<TPixel, Extremum::Minimum>;
    case Mode::AbsoluteMaximum:
    case Mode::Mean:
      break;
  }
  return TPixel{};
}

template <typename TPixel>
template <typename TFunction>
void
PartRecords<TPixel>::CallWithMode(const TFunction & function) const
{
  switch (m_Rule.mode)
  {
    case Mode::Maximum:
      return function(std::integral_constant<Mode, Mode::Maximum>());
    case Mode::Minimum:
      return function(std::integral_constant<Mode, Mode::Minimum>());
    case Mode::AbsoluteMaximum:
      return function(std::integral_constant<Mode, Mode::AbsoluteMaximum>());
    case Mode::Mean:
      break;
  }
}

template <typename TPixel>
void
PartRecords<TPixel>::Clear(unsigned char * records, std::ptrdiff_t count) const
{
  const auto size = static_cast<std::ptrdiff_t>(this->GetSize());
  if (!this->ArePixels())
  {
    std::memset(records, 0, static_cast<std::size_t>(count * size));
  }
  const auto fill = [&](auto none) {
    for (std::ptrdiff_t n = 0; n < count; ++n)
    {
      Store(none, records + n * size);
    }
  };
  if (m_Rule.isExact)
  {
    fill(std::numeric_limits<ExactNumber<TPixel>>::quiet_NaN());
  }
  else if (m_Rule.mode != Mode::Mean)
  {
    fill(this->GetNone());
  }
}

template <typename TPixel>
void
PartRecords<TPixel>::Merge(const unsigned char * records, unsigned char * into, std::ptrdiff_t count) const
{
  const auto size = static_cast<std::ptrdiff_t>(this->GetSize());
  const auto forEach = [&](const auto & merge) {
    for (std::ptrdiff_t n = 0; n < count; ++n)
    {
      merge(records + n * size, into + n * size);
    }
  };
  if (m_Rule.isExact)
  {
    forEach([this](const unsigned char * record, unsigned char * other) {
      auto   value = ExactNumber<TPixel>{};
      double place{};
      if (this->GetExact(record, value, place))
      {
        this->MergeExact(value, place, other);
      }
    });
  }
  else if (m_Rule.mode == Mode::Mean)
  {
    forEach(MergeSums<TPixel>);
  }
  else
  {
    this->CallWithMode([&](auto mode) {
      this->HasRanks() ? forEach(MergeRanked<decltype(mode)::value, TPixel>)
                       : MergeValues<decltype(mode)::value, TPixel>(records, into, count);
    });
  }
}

template <typename TPixel>
void
PartRecords<TPixel>::Pack(const IntermediateImage<TPixel> & image,
                          const SummedImage<TPixel> &       sums,
                          const Ranking &                   whole,
                          std::ptrdiff_t                    row,
                          unsigned char *                   records,
                          std::ptrdiff_t                    distance) const
{
  const auto step = distance * static_cast<std::ptrdiff_t>(this->GetSize());
  if (m_Rule.mode == Mode::Mean)
  {
    const auto *  sum = sums.sums + row * image.rowStride;
    const auto *  countSteps = sums.countSteps + row * (image.rowStride + 1);
    std::uint32_t samples = 0;
    for (std::ptrdiff_t p = 0; p < image.columns; ++p)
    {
      samples += countSteps[p];
      Store(sum[p], records + p * step);
      Store(samples, records + p * step + sizeof(*sum));
    }
    return;
  }
  const bool           hasRanks = this->HasRanks();
  const bool           needsRanks = m_Rule.NeedsRanks();
  const TPixel         none = this->GetNone();
  const ColumnSpan     reached = image.reached[row];
  const TPixel * const pixels = image.pixels + row * image.rowStride;
  const std::int32_t * ranks = image.ranks ? image.ranks + row * image.rowStride : nullptr;
  if (this->ArePixels() && distance == 1 && !ranks)
  {
    // the fastest
    this->Clear(records, image.columns);
    const auto first = static_cast<std::size_t>(reached.begin);
    const auto count = static_cast<std::size_t>(reached.end - reached.begin);
    std::memcpy(records + first * sizeof(TPixel), pixels + first, count * sizeof(TPixel));
    return;
  }
  for (std::ptrdiff_t p = 0; p < image.columns; ++p)
  {
    const bool hasValue = p >= reached.begin && p < reached.end && (!ranks || ranks[p] > 0);
    Store(hasValue ? pixels[p] : none, records + p * step);
    if (hasRanks)
    {
      const std::int32_t rank = needsRanks && hasValue ? whole.GetRank(image.ranking.GetSlice(ranks[p])) : 1;
      Store(hasValue ? rank : std::int32_t{ 0 }, records + p * step + sizeof(TPixel));
    }
  }
}

template <typename TPixel>
void
PartRecords<TPixel>::Unpack(const unsigned char * records,
                            std::ptrdiff_t        count,
                            TPixel *              pixels,
                            std::int32_t *        ranks) const
{
  const auto step = static_cast<std::ptrdiff_t>(this->GetSize());
  for (std::ptrdiff_t p = 0; p < count; ++p, records += step)
  {
    std::int32_t rank = 1;
    if (m_Rule.mode == Mode::Mean)
    {
      const auto samples = Load<std::uint32_t>(records + sizeof(SampleSum<TPixel>));
      pixels[p] = samples > 0 ? GetMean<TPixel>(Load<SampleSum<TPixel>>(records), samples) : TPixel{};
      rank = samples > 0 ? 1 : 0;
    }
    else
    {
      pixels[p] = Load<TPixel>(records);
      rank = ranks ? Load<std::int32_t>(records + sizeof(TPixel)) : 1;
    }
    if (ranks)
    {
      ranks[p] = rank;
    }
  }
}

template <typename TPixel>
void
PartRecords<TPixel>::MergeExact(ExactNumber<TPixel> value, double place, unsigned char * record) const
{
  auto   other = ExactNumber<TPixel>{};
  double otherPlace{};
  this->GetExact(record, other, otherPlace);
  this->CallWithMode([&](auto mode) {
    if (IsExactBetter<decltype(mode)::value>(value, m_Rule.hasDepth ? place : 0.0, other, otherPlace))
    {
      Store(value, record);
      if (m_Rule.hasDepth)
      {
        Store(place, record + sizeof(value));
      }
    }
  });
}

template <typename TPixel>
bool
PartRecords<TPixel>::GetExact(const unsigned char * record, ExactNumber<TPixel> & value, double & place) const
{
  value = Load<ExactNumber<TPixel>>(record);
  place = m_Rule.hasDepth ? Load<double>(record + sizeof(value)) : 0.0;
  return !std::isnan(value);
}

#define INSTANTIATE(TPixel) template class PartRecords<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk::ShearWarp
