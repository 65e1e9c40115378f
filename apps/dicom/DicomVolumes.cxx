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
#include "DicomVolumes.h"
#include "DicomAttribute.h"

#include <gdcmSequenceOfItems.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <map>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <tuple>

namespace
{
using gdcm::DataSet;
using gdcm::Tag;
using VectorType = itk::Vector<double, 3>;
using Numbers = std::vector<std::size_t>;

/** An attribute of slices, which may be in sequences. */
struct Attribute
{
  Tag tag;
  /** Of each slice; empty if it has none. */
  std::vector<std::string> values;
  /** The values by number. */
  Numbers numbers{};
};

/** By the place among the attributes. */
using Attributes = std::map<std::string, Attribute>;

template <typename TNumber>
std::string
ListNumbers(const gdcm::ByteValue & bytes)
{
  std::ostringstream text;
  text.precision(10);
  for (std::size_t n = 0; (n + 1) * sizeof(TNumber) <= bytes.GetLength(); ++n)
  {
    TNumber number;
    std::memcpy(&number, bytes.GetPointer() + n * sizeof(TNumber), sizeof(TNumber));
    text << (n > 0 ? "\\" : "") << number;
  }
  return text.str();
}

/** The value in words; empty if it is long or no number or text. */
std::string
GetValue(const DataSet & dataSet, const gdcm::DataElement & element)
{
  constexpr std::size_t         longest = 64;
  const gdcm::ByteValue * const bytes = element.GetByteValue();
  if (!bytes || bytes->GetLength() > longest)
  {
    return "";
  }
  switch (GetVR(element))
  {
    case gdcm::VR::US:
      return ListNumbers<std::uint16_t>(*bytes);
    case gdcm::VR::SS:
      return ListNumbers<std::int16_t>(*bytes);
    case gdcm::VR::UL:
      return ListNumbers<std::uint32_t>(*bytes);
    case gdcm::VR::SL:
      return ListNumbers<std::int32_t>(*bytes);
    case gdcm::VR::FL:
      return ListNumbers<float>(*bytes);
    case gdcm::VR::FD:
      return ListNumbers<double>(*bytes);
    case gdcm::VR::UI:
    case gdcm::VR::AT:
      return "";
    default:
      break;
  }
  const std::string text = GetText(dataSet, element.GetTag());
  const bool        isASCII = std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
  return isASCII ? text : GetLine(dataSet, element.GetTag(), dataSet);
}

/** What the number of the slice, its position and its pixels change. */
bool
IsOfEachSlice(const Tag & tag)
{
  const Tag tags[] = { { 0x0020, 0x0013 }, { 0x0020, 0x9057 }, { 0x0020, 0x0032 },
                       { 0x0020, 0x1041 }, { 0x0028, 0x0106 }, { 0x0028, 0x0107 } };
  return std::find(std::begin(tags), std::end(tags), tag) != std::end(tags);
}

void
Add(const Tag &         tag,
    const std::string & place,
    const std::string & value,
    std::size_t         slice,
    std::size_t         slices,
    Attributes &        all)
{
  Attribute & attribute = all.emplace(place, Attribute{ tag, {} }).first->second;
  attribute.values.resize(slices);
  attribute.values[slice] = value;
}

void
Collect(const DataSet & dataSet, const std::string & place, std::size_t slice, std::size_t slices, Attributes & all)
{
  for (const gdcm::DataElement & element : dataSet.GetDES())
  {
    const Tag & tag = element.GetTag();
    // groups of the frames are collected one by one
    if (tag == Tag(0x5200, 0x9229) || tag == Tag(0x5200, 0x9230) || tag.GetElement() == 0)
    {
      continue;
    }
    std::ostringstream here;
    here << place << tag;
    const auto            sequence = element.GetValueAsSQ();
    constexpr std::size_t deepest = 200;
    for (std::size_t item = 1; sequence && place.size() < deepest && item <= sequence->GetNumberOfItems(); ++item)
    {
      Collect(sequence->GetItem(item).GetNestedDataSet(), here.str() + std::to_string(item), slice, slices, all);
    }
    const std::string value = sequence ? "" : GetValue(dataSet, element);
    if (tag == Tag(0x0020, 0x9157))
    {
      // Dimension Index Values: one of them may be the volume's
      std::istringstream indices(value);
      for (std::string index; std::getline(indices, index, '\\'); here << '#')
      {
        Add(tag, here.str(), index, slice, slices, all);
      }
    }
    else if (!value.empty())
    {
      Add(tag, here.str(), value, slice, slices, all);
    }
  }
}

/** Numbers \a values in the order in which they come first. */
template <typename TValue>
Numbers
NumberValues(const std::vector<TValue> & values)
{
  std::map<TValue, std::size_t> known;
  Numbers                       numbers;
  for (const TValue & value : values)
  {
    numbers.push_back(known.emplace(value, known.size()).first->second);
  }
  return numbers;
}

std::size_t
CountDistinct(const Numbers & numbers)
{
  return numbers.empty() ? 0 : *std::max_element(numbers.begin(), numbers.end()) + 1;
}

/** Numbers the pairs of two numbers. */
Numbers
Combine(const Numbers & one, const Numbers & other)
{
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  pairs.reserve(one.size());
  for (std::size_t n = 0; n < one.size(); ++n)
  {
    pairs.emplace_back(one[n], other[n]);
  }
  return NumberValues(pairs);
}

/** The attributes that differ, those first that say how a slice was acquired, then where and when. */
std::vector<Attribute>
FindDifferent(const std::vector<Slice> & slices)
{
  Attributes all;
  const bool areOfOneFile = std::all_of(
    slices.begin(), slices.end(), [&slices](const Slice & slice) { return slice.source == slices.front().source; });
  for (std::size_t n = 0; n < slices.size(); ++n)
  {
    const DataSet & header = slices[n].source->header;
    const auto      groups = header.GetDataElement(Tag(0x5200, 0x9230)).GetValueAsSQ();
    if (!areOfOneFile)
    {
      Collect(header, "", n, slices.size(), all);
      Collect(GetItem(header, { 0x5200, 0x9229 }), "", n, slices.size(), all);
    }
    for (const Tag & tag : GetFrameVectors(header))
    {
      const gdcm::ByteValue * const bytes = header.GetDataElement(tag).GetByteValue();
      const std::size_t             place = slices[n].frame * sizeof(std::uint16_t);
      const bool                    areNumbers = bytes && GetVR(header.GetDataElement(tag)) == gdcm::VR::US;
      if (areNumbers && place + sizeof(std::uint16_t) <= bytes->GetLength())
      {
        std::uint16_t number = 0;
        std::memcpy(&number, bytes->GetPointer() + place, sizeof(number));
        Add(tag, "frame" + Describe(tag), std::to_string(number), n, slices.size(), all);
      }
    }
    if (groups && slices[n].frame < groups->GetNumberOfItems())
    {
      Collect(groups->GetItem(slices[n].frame + 1).GetNestedDataSet(), "", n, slices.size(), all);
    }
  }
  std::vector<Attribute> different;
  for (auto & [place, attribute] : all)
  {
    attribute.numbers = NumberValues(attribute.values);
    if (CountDistinct(attribute.numbers) > 1)
    {
      different.push_back(attribute);
    }
  }
  const auto rank = [](const Attribute & attribute) {
    const std::uint16_t group = attribute.tag.GetGroup();
    const std::uint16_t order[] = { 0x0018, 0x0020, 0x0054, 0x0008 };
    const auto          place = std::find(std::begin(order), std::end(order), group) - std::begin(order);
    return std::make_tuple(place, group % 2 == 1, group == 0x0028);
  };
  std::stable_sort(different.begin(), different.end(), [&rank](const Attribute & a, const Attribute & b) {
    return rank(a) < rank(b);
  });
  return different;
}

/** Numbers the positions of slices; those closer than a twentieth of a pixel are one. */
Numbers
NumberPlaces(const std::vector<Slice> & slices)
{
  Numbers order(slices.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&slices](std::size_t a, std::size_t b) {
    return slices[a].position < slices[b].position;
  });
  const double closest = 0.05 * std::min(slices.front().spacing[0], slices.front().spacing[1]);
  Numbers      places(slices.size());
  for (std::size_t n = 1; n < order.size(); ++n)
  {
    const bool isNext = slices[order[n]].position - slices[order[n - 1]].position > closest;
    places[order[n]] = places[order[n - 1]] + (isNext ? 1 : 0);
  }
  return places;
}

/** Slices in volumes, each slice with its volume's number, and the attributes that tell these apart. */
struct Volumes
{
  Numbers                numbers;
  std::vector<Attribute> attributes{};
};

/** Splits volumes by the attributes that do so best, as long as slices are at one place. An attribute must have most of
 * its values at most of the places. */
void
SplitByAttributes(Volumes & volumes, const std::vector<Attribute> & different, const Numbers & places)
{
  const std::size_t count = CountDistinct(places);
  std::size_t       told = CountDistinct(Combine(volumes.numbers, places));
  while (told < places.size())
  {
    const Attribute * best = nullptr;
    Numbers           bestNumbers;
    for (const Attribute & attribute : different)
    {
      const auto atPlaces = CountDistinct(Combine(attribute.numbers, places));
      if (IsOfEachSlice(attribute.tag) || 2 * atPlaces <= CountDistinct(attribute.numbers) * count)
      {
        continue;
      }
      const Numbers numbers = Combine(volumes.numbers, attribute.numbers);
      const auto    nowTold = CountDistinct(Combine(numbers, places));
      if (nowTold > told || (best && nowTold == told && CountDistinct(numbers) < CountDistinct(bestNumbers)))
      {
        best = &attribute;
        bestNumbers = numbers;
        told = nowTold;
      }
    }
    if (!best)
    {
      return;
    }
    volumes.numbers = bestNumbers;
    volumes.attributes.push_back(*best);
  }
}

/** Whether each volume has as many slices at all of its places. */
bool
AreFull(const Numbers & numbers, const Numbers & places)
{
  std::map<std::size_t, std::map<std::size_t, std::size_t>> counts;
  for (std::size_t n = 0; n < numbers.size(); ++n)
  {
    ++counts[numbers[n]][places[n]];
  }
  return std::all_of(counts.begin(), counts.end(), [](const auto & volume) {
    const std::size_t first = volume.second.begin()->second;
    return std::all_of(
      volume.second.begin(), volume.second.end(), [first](const auto & place) { return place.second == first; });
  });
}

bool
IsLess(const std::string & one, const std::string & other)
{
  const auto a = ParseNumbers(one);
  const auto b = ParseNumbers(other);
  return a.empty() || b.empty() ? one < other : a < b;
}

/** Splits volumes by the order of the slices at each place in time or, if there is none, in number. */
void
SplitByOrder(Volumes & volumes, const std::vector<Attribute> & different, const Numbers & places)
{
  const Numbers before = Combine(volumes.numbers, places);
  if (CountDistinct(before) == places.size() || !AreFull(volumes.numbers, places))
  {
    return;
  }
  for (const Tag & tag : { Tag(0x0018, 0x1060),
                           Tag(0x0054, 0x1300),
                           Tag(0x0018, 0x9074),
                           Tag(0x0008, 0x002a),
                           Tag(0x0008, 0x0032),
                           Tag(0x0008, 0x0033),
                           Tag(0x0020, 0x0013) })
  {
    for (const Attribute & attribute : different)
    {
      if (attribute.tag == tag && CountDistinct(Combine(before, attribute.numbers)) == places.size())
      {
        Numbers order(places.size());
        std::iota(order.begin(), order.end(), 0);
        std::stable_sort(order.begin(), order.end(), [&attribute](std::size_t a, std::size_t b) {
          return IsLess(attribute.values[a], attribute.values[b]);
        });
        Numbers passed(CountDistinct(before));
        Numbers ranks(places.size());
        for (const std::size_t n : order)
        {
          ranks[n] = passed[before[n]]++;
        }
        volumes.numbers = Combine(volumes.numbers, ranks);
        volumes.attributes.push_back(attribute);
        return;
      }
    }
  }
}

/** The least and the greatest value in a volume. */
std::pair<std::string, std::string>
FindRange(const Attribute & attribute, const Numbers & numbers, std::size_t volume)
{
  std::vector<std::string> values;
  for (std::size_t n = 0; n < numbers.size(); ++n)
  {
    if (numbers[n] == volume)
    {
      values.push_back(attribute.values[n]);
    }
  }
  const auto [least, greatest] = std::minmax_element(values.begin(), values.end(), IsLess);
  return { *least, *greatest };
}

/** The numbers of the volumes by their values. */
Numbers
SortVolumes(const Volumes & volumes)
{
  Numbers order(CountDistinct(volumes.numbers));
  std::iota(order.begin(), order.end(), 0);
  for (auto attribute = volumes.attributes.rbegin(); attribute != volumes.attributes.rend(); ++attribute)
  {
    std::vector<std::string> least;
    least.reserve(order.size());
    for (std::size_t volume = 0; volume < order.size(); ++volume)
    {
      least.push_back(FindRange(*attribute, volumes.numbers, volume).first);
    }
    std::stable_sort(
      order.begin(), order.end(), [&least](std::size_t a, std::size_t b) { return IsLess(least[a], least[b]); });
  }
  return order;
}

/** Adds attributes that hold for each volume too, up to three in all. */
void
AddEquivalents(Volumes & volumes, const std::vector<Attribute> & different)
{
  constexpr std::size_t most = 3;
  const std::size_t     count = CountDistinct(volumes.numbers);
  for (const Attribute & attribute : different)
  {
    const bool isNew = std::none_of(volumes.attributes.begin(),
                                    volumes.attributes.end(),
                                    [&attribute](const Attribute & other) { return other.tag == attribute.tag; });
    if (isNew && volumes.attributes.size() < most &&
        CountDistinct(Combine(volumes.numbers, attribute.numbers)) == count)
    {
      volumes.attributes.push_back(attribute);
    }
  }
}

/** As "2 volumes, which differ in Echo Time (0018,0081)". */
std::string
DescribeVolumes(const Volumes & volumes)
{
  std::string text = std::to_string(CountDistinct(volumes.numbers)) + " volumes, which differ in ";
  for (std::size_t n = 0; n < volumes.attributes.size(); ++n)
  {
    text += (n > 0 ? ", " : "") + Describe(volumes.attributes[n].tag);
  }
  return text;
}

/** As "1: 4.6; 2: 9.2". */
std::string
ListVolumes(const Volumes & volumes, const Numbers & order)
{
  constexpr std::size_t most = 20;
  std::string           text;
  for (std::size_t n = 0; n < order.size(); ++n)
  {
    if (order.size() > most && n == most / 2)
    {
      text += "; ...";
      n = order.size() - most / 2;
    }
    text += (n > 0 ? "; " : "") + std::to_string(n + 1) + ": ";
    for (const Attribute & attribute : volumes.attributes)
    {
      const auto [least, greatest] = FindRange(attribute, volumes.numbers, order[n]);
      text += (&attribute == &volumes.attributes.front() ? "" : ", ") + (least.empty() ? "none" : least) +
              (least == greatest ? "" : " to " + greatest);
    }
  }
  return text;
}

[[noreturn]] void
RefuseTwice(const std::vector<Slice> & slices, const Numbers & numbers, const std::vector<Attribute> & different)
{
  std::size_t other = 1;
  std::size_t one = 0;
  while (one = static_cast<std::size_t>(std::find(numbers.begin(), numbers.end(), numbers[other]) - numbers.begin()),
         one == other)
  {
    ++other;
  }
  std::ostringstream message;
  message << "two slices lie at one position: " << GetName(slices[one]) << " at " << slices[one].position << " mm and "
          << GetName(slices[other]) << " at " << slices[other].position << " mm";
  constexpr int most = 3;
  int           count = 0;
  for (const Attribute & attribute : different)
  {
    if (attribute.values[one] != attribute.values[other] && count < most)
    {
      message << (count++ > 0 ? ", " : ", which differ in ") << Describe(attribute.tag) << ' ' << attribute.values[one]
              << " and " << attribute.values[other];
    }
  }
  const bool areFiles = slices[one].source != slices[other].source;
  throw std::runtime_error(message.str() + (count == 0 ? "; no attribute tells them apart"
                                            : areFiles ? "; put the images of one volume into a folder of their own"
                                                       : ""));
}
} // namespace

void
ChooseVolume(std::vector<Slice> & slices,
             const std::string &  volume,
             const std::string &  option,
             const std::string &  name)
{
  const VectorType normal = slices.front().directions[2];
  for (Slice & slice : slices)
  {
    slice.position = slice.origin * normal;
  }
  if (std::any_of(slices.begin(), slices.end(), [&normal](const Slice & slice) {
        return !((slice.directions[2] - normal).GetNorm() < 1e-3);
      }))
  {
    return;
  }
  Volumes                volumes{ Numbers(slices.size()) };
  std::vector<Attribute> different;
  const Numbers          places = NumberPlaces(slices);
  if (CountDistinct(places) < slices.size())
  {
    different = FindDifferent(slices);
    SplitByAttributes(volumes, different, places);
    SplitByOrder(volumes, different, places);
    const Numbers told = Combine(volumes.numbers, places);
    if (CountDistinct(told) < slices.size())
    {
      RefuseTwice(slices, told, different);
    }
  }
  const Numbers     order = SortVolumes(volumes);
  const std::size_t count = order.size();
  AddEquivalents(volumes, different);
  std::size_t chosen = 0;
  while (chosen < count && volume != std::to_string(chosen + 1))
  {
    ++chosen;
  }
  if (chosen == count && (count > 1 || !volume.empty()))
  {
    const std::string present = count > 1 ? DescribeVolumes(volumes) : "one volume";
    const std::string list = count > 1 ? ": " + ListVolumes(volumes, order) : "";
    if (!volume.empty())
    {
      throw std::runtime_error(option + " " + volume + " is not in " + name + ", which has " + present + list);
    }
    const std::string way =
      option.empty() ? "put the images of one into a folder of their own" : "choose one by " + option + " NUMBER";
    throw std::runtime_error(name + " has " + present + "; " + way + list);
  }
  std::vector<Slice> kept;
  for (std::size_t n = 0; n < slices.size(); ++n)
  {
    if (count == 1 || volumes.numbers[n] == order[chosen])
    {
      kept.push_back(slices[n]);
    }
  }
  slices = std::move(kept);
}
