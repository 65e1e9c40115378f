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
#ifndef Help_h
#define Help_h

#include <CLI/CLI.hpp>

#include <string>

/** Whether an option's group has a \a trait behind its title, as "Picture, usual". */
bool
HasTrait(const CLI::Option & option, const std::string & trait);

/** Examples first, then the options that most people use, or all of them, as wide as the terminal. */
class HelpFormatter : public CLI::Formatter
{
public:
  std::string
  make_help(const CLI::App * app, std::string name, CLI::AppFormatMode mode) const override;

  std::string
  make_option(const CLI::Option * option, bool isPositional) const override;
};

#endif
