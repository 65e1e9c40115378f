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
#include <vector>

/** Of a message. A regular expression takes as much of the stack as there are characters. */
constexpr std::size_t MostCharacters = 4000;

/** Words of \a text with one space between them, without characters of control and ITK's beginnings of errors. */
std::string
MakeOneLine(std::string text);

/** \a text without the spaces, tabs and line ends around it. */
std::string
Trim(const std::string & text);

/** \a text, UTF-8, in small letters; only its ASCII letters are made small if the platform has no locale of UTF-8. */
std::string
ToLower(std::string text);

/** The one of \a names that \a text is, in capitals too, or that alone begins so; empty if there is none. */
std::string
FindName(const std::string & text, const std::vector<std::string> & names);

/** "; did you mean 'x'?" for the word that is nearest to \a text, or nothing if none is near. */
std::string
Suggest(const std::string & text, const std::vector<std::string> & words);

#endif
