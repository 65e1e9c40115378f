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
#include "CharacterSet.h"

#ifdef ShearWarpMIP_HAS_ICONV
#  include <iconv.h>
#endif

#include <algorithm>
#include <array>
#include <cstddef>

namespace
{
struct CharacterSet
{
  /** The end of the defined term: of "ISO_IR 100" and of "ISO 2022 IR 100". */
  std::string term;
  /** What selects it within a text. */
  std::string escape;
  /** Of iconv. */
  std::string name;
  /** Whether it takes the place of ASCII. */
  bool isInsteadOfASCII{ false };
};

const CharacterSet ascii{ " 6", "\x1b(B", "ASCII", true };

const std::array<CharacterSet, 21> characterSets{ { ascii,
                                                    { " 13", "\x1b)I", "SHIFT_JIS" },
                                                    { "", "\x1b(J", "ASCII", true },
                                                    { " 58", "\x1b$)A", "GB2312" },
                                                    { " 87", "\x1b$B", "ISO-2022-JP-2", true },
                                                    { " 100", "\x1b-A", "ISO-8859-1" },
                                                    { " 101", "\x1b-B", "ISO-8859-2" },
                                                    { " 109", "\x1b-C", "ISO-8859-3" },
                                                    { " 110", "\x1b-D", "ISO-8859-4" },
                                                    { " 126", "\x1b-F", "ISO-8859-7" },
                                                    { " 127", "\x1b-G", "ISO-8859-6" },
                                                    { " 138", "\x1b-H", "ISO-8859-8" },
                                                    { " 144", "\x1b-L", "ISO-8859-5" },
                                                    { " 148", "\x1b-M", "ISO-8859-9" },
                                                    { " 149", "\x1b$)C", "EUC-KR" },
                                                    { " 159", "\x1b$(D", "ISO-2022-JP-2", true },
                                                    { " 166", "\x1b-T", "TIS-620" },
                                                    { " 203", "\x1b-b", "ISO-8859-15" },
                                                    { " 192", "", "UTF-8" },
                                                    { "GB18030", "", "GB18030" },
                                                    { "GBK", "", "GBK" } } };

std::string
ConvertToUTF8(std::string text, const CharacterSet & set)
{
  std::string converted;
#ifdef ShearWarpMIP_HAS_ICONV
  iconv_t converter = iconv_open("UTF-8", set.name.c_str());
  if (converter != iconv_t(-1)) // NOLINT(performance-no-int-to-ptr)
  {
    char *      from = text.data();
    std::size_t left = text.size();
    while (left > 0)
    {
      std::array<char, 256> buffer{};
      char *                to = buffer.data();
      std::size_t           room = buffer.size();
      const bool            isDone = iconv(converter, &from, &left, &to, &room) != static_cast<std::size_t>(-1);
      converted.append(buffer.data(), to);
      // or the buffer was too small
      if (!isDone && to == buffer.data())
      {
        converted += '?';
        ++from;
        --left;
      }
    }
    iconv_close(converter);
    return converted;
  }
#endif
  for (const char character : text)
  {
    const auto code = static_cast<unsigned char>(character);
    if (code >= 0x80 && set.name == "ISO-8859-1")
    {
      converted += { static_cast<char>(0xc0 | code >> 6), static_cast<char>(0x80 | (code & 0x3f)) };
    }
    else
    {
      converted += code < 0x80 || set.name == "UTF-8" ? character : '?';
    }
  }
  return converted;
}
} // namespace

std::string
ConvertToUTF8(const std::string & text, const std::string & characterSet)
{
  const std::string first = characterSet.substr(0, characterSet.find('\\'));
  CharacterSet      lower = ascii;
  CharacterSet      upper = ascii;
  for (const CharacterSet & set : characterSets)
  {
    const bool isFirst = !set.term.empty() && first.size() >= set.term.size() &&
                         first.compare(first.size() - set.term.size(), set.term.size(), set.term) == 0;
    upper = isFirst && !set.isInsteadOfASCII ? set : upper;
  }

  std::string converted;
  for (std::size_t begin = 0; begin < text.size();)
  {
    const auto set = std::find_if(characterSets.begin(), characterSets.end(), [&](const CharacterSet & each) {
      return !each.escape.empty() && text.compare(begin, each.escape.size(), each.escape) == 0;
    });
    if (set != characterSets.end())
    {
      (set->isInsteadOfASCII ? lower : upper) = *set;
      begin += set->escape.size();
    }
    const auto        end = std::min(text.find('\x1b', set != characterSets.end() ? begin : begin + 1), text.size());
    const std::string part = text.substr(begin, end - begin);
    const bool        isAscii = lower.name == ascii.name;
    converted += isAscii ? ConvertToUTF8(part, upper) : ConvertToUTF8(lower.escape + part, lower);
    begin = end;
  }
  return converted;
}
