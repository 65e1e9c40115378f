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
#ifndef Text_h
#define Text_h

#include <cstddef>
#include <string>

/** Of a message. A regular expression takes as much of the stack as there are characters. */
constexpr std::size_t MostCharacters = 4000;

/** \a text without the spaces, tabs and line ends around it. */
inline std::string
Trim(const std::string & text)
{
  constexpr auto blank = " \t\r\n";
  const auto     begin = text.find_first_not_of(blank);
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(blank) + 1 - begin);
}

#endif
