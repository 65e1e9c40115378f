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
#include "Help.h"
#include "Posix.h"

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#ifdef ShearWarpMIP_HAS_POSIX
#  include <sys/ioctl.h>
#  include <unistd.h>
#endif

namespace
{
constexpr std::size_t column = 28;

std::string
GetTitle(const std::string & group)
{
  return group.substr(0, group.find(','));
}

std::size_t
FindWidth()
{
  std::size_t width = 100;
#ifdef ShearWarpMIP_HAS_POSIX
  winsize terminal{};
  if (isatty(STDOUT_FILENO) == 1 && ioctl(STDOUT_FILENO, TIOCGWINSZ, &terminal) == 0 && terminal.ws_col > 0)
  {
    width = terminal.ws_col;
  }
#endif
  return std::clamp<std::size_t>(width, 60, 120);
}

/** Lines of \a text that begin at a column; the first line is there already. */
std::string
Wrap(const std::string & text, std::size_t begin)
{
  const std::size_t  width = FindWidth();
  std::istringstream words(text);
  std::ostringstream lines;
  std::size_t        position = begin;
  for (std::string word; words >> word; position += word.size() + 1)
  {
    if (position > begin && position + word.size() > width)
    {
      lines << '\n' << std::string(begin, ' ');
      position = begin;
    }
    lines << (position > begin ? " " : "") << word;
  }
  return lines.str();
}

/** What follows the name: the kind of value, or the values. */
std::string
DescribeValue(const CLI::Option & option)
{
  if (option.get_type_size() == 0)
  {
    return "";
  }
  const std::string type = option.get_type_name();
  const auto        end = type.find(':');
  const std::string value = type.find(":{") == std::string::npos ? type.substr(0, end) : type.substr(end + 1);
  std::string       text = ' ' + value;
  // several names in one, or one for all
  for (int n = 1; value.find(' ') == std::string::npos && n < option.get_expected_min(); ++n)
  {
    text += ' ' + value;
  }
  return text;
}

template <typename TOptions>
std::string
List(const TOptions & options)
{
  std::string names;
  for (const CLI::Option * const option : options)
  {
    names += (names.empty() ? "" : ", ") + option->get_name();
  }
  return names;
}
} // namespace

bool
HasTrait(const CLI::Option & option, const std::string & trait)
{
  return (option.get_group() + ',').find(", " + trait + ',') != std::string::npos;
}

std::string
HelpFormatter::make_help(const CLI::App * app, std::string name, CLI::AppFormatMode mode) const
{
  const bool         isAll = mode == CLI::AppFormatMode::All;
  std::ostringstream text;
  std::istringstream paragraphs(app->get_description());
  std::string        paragraph;
  std::getline(paragraphs, paragraph);
  text << Wrap(paragraph, 0) << "\n\n" << make_usage(app, name) << '\n';
  std::istringstream footer(app->get_footer());
  for (std::string line; std::getline(footer, line);)
  {
    const std::size_t indent = std::min(line.find_first_not_of(' '), line.size());
    text << std::string(indent, ' ') << Wrap(line, indent) << '\n';
  }
  text << '\n';
  while (std::getline(paragraphs, paragraph))
  {
    text << Wrap(paragraph, 0) << '\n';
  }
  std::vector<std::string> titles;
  for (const std::string & group : app->get_groups())
  {
    const std::string title = GetTitle(group);
    if (std::find(titles.begin(), titles.end(), title) != titles.end())
    {
      continue;
    }
    titles.push_back(title);
    const auto options = app->get_options([&](const CLI::Option * option) {
      return GetTitle(option->get_group()) == title &&
             (isAll || HasTrait(*option, "usual") || option->get_positional());
    });
    if (!options.empty())
    {
      text << '\n' << title << ":\n";
    }
    for (const CLI::Option * const option : options)
    {
      text << make_option(option, option->get_positional());
    }
  }
  text << (isAll ? "" : "\n--help-all lists all options.\n");
  return text.str();
}

std::string
HelpFormatter::make_option(const CLI::Option * option, bool isPositional) const
{
  std::string names = isPositional ? option->get_name(true, false) : "";
  for (const std::string & name : option->get_snames())
  {
    names += (names.empty() ? "-" : ", -") + name;
  }
  for (const std::string & name : option->get_lnames())
  {
    names += (names.empty() ? "--" : ", --") + name;
  }
  std::string line = "  " + names + (isPositional ? "" : DescribeValue(*option));
  std::string description = option->get_description();
  if (!option->get_default_str().empty())
  {
    description += "; default: " + option->get_default_str();
  }
  if (!option->get_needs().empty())
  {
    description += "; needs " + List(option->get_needs());
  }
  if (!option->get_excludes().empty() && !isPositional)
  {
    description += "; not with " + List(option->get_excludes());
  }
  line += line.size() + 2 > column ? '\n' + std::string(column, ' ') : std::string(column - line.size(), ' ');
  return line + Wrap(description, column) + '\n';
}
