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
#include "Text.h"

#include <algorithm>
#include <cwchar>
#include <locale>
#include <numeric>
#include <optional>
#include <regex>
#include <sstream>
#include <stdexcept>

namespace
{
/** Letters that are changed, left out or added between two words (Levenshtein 1966). */
std::size_t
CountEdits(const std::string & a, const std::string & b)
{
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j)
    {
      const std::size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({ changed, row[j] + 1, diagonal + 1 });
    }
  }
  return row.back();
}

/** A locale that knows the letters of UTF-8, if the platform has one. */
std::optional<std::locale>
FindLocale()
{
  for (const char * const name : { "C.UTF-8", "en_US.UTF-8" })
  {
    try
    {
      return std::locale(name);
    }
    catch (const std::runtime_error &)
    {
      continue;
    }
  }
  return {};
}
} // namespace

std::string
MakeOneLine(std::string text)
{
  text.resize(std::min(text.size(), MostCharacters));
  const auto isControl = [](char letter) { return ('\0' <= letter && letter < ' ') || letter == '\x7f'; };
  std::replace_if(text.begin(), text.end(), isControl, ' ');
  // "ITK ERROR: Class(0x123): " and "itk::ERROR: Class(0x123): "
  std::istringstream words(std::regex_replace(text, std::regex("(ITK |itk::)ERROR: |\\w+\\(0x[0-9a-f]+\\): "), ""));
  std::string        line;
  for (std::string word; words >> word;)
  {
    line += (line.empty() ? "" : " ") + word;
  }
  return line;
}

std::string
Trim(const std::string & text)
{
  constexpr auto blank = " \t\r\n";
  const auto     begin = text.find_first_not_of(blank);
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(blank) + 1 - begin);
}

std::string
ToLower(std::string text)
{
  std::transform(text.begin(), text.end(), text.begin(), [](char letter) {
    return 'A' <= letter && letter <= 'Z' ? static_cast<char>(letter - 'A' + 'a') : letter;
  });
  static const std::optional<std::locale> locale = FindLocale();
  if (!locale)
  {
    return text;
  }
  using CodecType = std::codecvt<wchar_t, char, std::mbstate_t>;
  const auto &   codec = std::use_facet<CodecType>(*locale);
  std::mbstate_t state{};
  std::wstring   letters(text.size(), L'\0');
  wchar_t *      lettersEnd = letters.data();
  const char *   read = text.data();
  const auto     result =
    codec.in(state, read, read + text.size(), read, letters.data(), letters.data() + letters.size(), lettersEnd);
  if (result != CodecType::ok)
  {
    return text;
  }
  std::use_facet<std::ctype<wchar_t>>(*locale).tolower(letters.data(), lettersEnd);
  std::string     lower(4 * letters.size(), '\0');
  char *          lowerEnd = lower.data();
  const wchar_t * written = letters.data();
  state = {};
  codec.out(state, written, lettersEnd, written, lower.data(), lower.data() + lower.size(), lowerEnd);
  lower.resize(static_cast<std::size_t>(lowerEnd - lower.data()));
  return lower;
}

std::string
FindName(const std::string & text, const std::vector<std::string> & names)
{
  const std::string word = ToLower(text);
  std::string       found;
  std::size_t       count = 0;
  for (const std::string & name : names)
  {
    if (!word.empty() && name.compare(0, word.size(), word) == 0)
    {
      found = name;
      count += 1;
    }
  }
  return count == 1 ? found : "";
}

std::string
Suggest(const std::string & text, const std::vector<std::string> & words)
{
  const std::string word = ToLower(text.substr(0, 100));
  // a beginning, or the end of an option: --spacing for --output-spacing
  const auto count = [&word](const std::string & other) {
    const bool isPart =
      other.size() > word.size() && word.size() > 3 &&
      (other.compare(0, word.size(), word) == 0 ||
       (word[0] == '-' && other.compare(other.size() - word.size() + 1, std::string::npos, word, 1) == 0));
    return isPart ? std::size_t{ 1 } : CountEdits(word, ToLower(other));
  };
  const auto nearest = std::min_element(
    words.begin(), words.end(), [&](const std::string & a, const std::string & b) { return count(a) < count(b); });
  const bool isNear = nearest != words.end() && 3 * count(*nearest) <= std::max(word.size(), std::size_t{ 3 });
  return isNear ? "; did you mean '" + *nearest + "'?" : "";
}
