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
#include "DicomFolder.h"
#include "DicomAttribute.h"
#include "DicomKind.h"
#include "DicomReader.h"
#include "FileStart.h"
#include "InputFiles.h"
#include "Integrity.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>
#include <stdexcept>
#include <tuple>

namespace
{
namespace fs = std::filesystem;
using gdcm::DataSet;

struct Series
{
  std::string              uid;
  std::string              description;
  std::string              modality;
  std::string              date;
  int                      number{ 0 };
  std::size_t              images{ 0 };
  bool                     areProjections{ false };
  std::vector<std::string> files;
  /** DICOM without images. */
  std::vector<std::string> others;
};

bool
IsText(const fs::path & path)
{
  RequireReadable(path);
  const std::string start = ReadStart(path, 512);
  return !start.empty() && std::all_of(start.begin(), start.end(), [](char character) {
    const auto code = static_cast<unsigned char>(character);
    return code >= ' ' || (code >= '\t' && code <= '\r');
  });
}

bool
AreEqual(const fs::path & one, const fs::path & other)
{
  const auto size = fs::file_size(one);
  return size == fs::file_size(other) && ReadStart(one, size) == ReadStart(other, size);
}

/** What is left out of a folder, for one warning of each kind. */
class LeftOut
{
public:
  void
  Add(const fs::path & path, const std::string & kind)
  {
    m_Paths[kind].insert(path);
  }

  void
  Warn(const WarningFunction & warn) const
  {
    for (const auto & [kind, paths] : m_Paths)
    {
      const std::string others = paths.size() > 1 ? " and " + std::to_string(paths.size() - 1) + " more" : "";
      warn("left out: '" + paths.begin()->string() + "'" + others + " (" + kind + ')');
    }
  }

private:
  std::map<std::string, std::set<fs::path>> m_Paths;
};

/** All series of a folder by date, number and UID, as their headers say. What might be an image, but has no sound
 * header, is an error. */
std::vector<Series>
FindAllSeries(const fs::path & folder, const WarningFunction & warn)
{
  LeftOut                  leftOut;
  std::set<fs::path>       texts;
  std::vector<std::string> files;
  for (const fs::path & path : FindFiles(folder))
  {
    const auto type = fs::status(path).type();
    if (type == fs::file_type::not_found)
    {
      throw std::runtime_error("'" + path.string() + "' is a link to a file that is not there; a slice may be missing");
    }
    if (type != fs::file_type::regular)
    {
      leftOut.Add(path, "no regular file");
    }
    else if (IsText(path))
    {
      texts.insert(path);
    }
    else
    {
      files.push_back(path.string());
    }
  }

  std::map<std::string, Series>           found;
  std::map<std::string, fs::path>         instances;
  std::vector<fs::path>                   others;
  std::set<std::pair<fs::path, fs::path>> extensions;
  for (const std::string & file : files)
  {
    const fs::path    path(file);
    const DataSet     header = ReadSoundHeader(file).value_or(DataSet());
    const std::string uid = GetText(header, { 0x0020, 0x000e });
    if (!IsImage(header))
    {
      if (HasPreamble(path))
      {
        found[uid].others.push_back(file);
      }
      else
      {
        others.push_back(path);
      }
      continue;
    }
    extensions.emplace(path.parent_path(), path.extension());
    const auto [first, isNew] = instances.emplace(GetText(header, { 0x0008, 0x0018 }), path);
    if (!isNew && AreEqual(path, first->second))
    {
      leftOut.Add(path, "the same as another file");
      continue;
    }
    Series & series = found[uid];
    if (series.files.empty())
    {
      series.uid = uid;
      series.description = GetLine(header, { 0x0008, 0x103e }, header);
      series.modality = GetLine(header, { 0x0008, 0x0060 }, header);
      series.date = GetLine(header, { 0x0008, 0x0021 }, header);
      series.date = series.date.empty() ? GetLine(header, { 0x0008, 0x0020 }, header) : series.date;
      series.number = std::atoi(GetText(header, { 0x0020, 0x0011 }).c_str());
    }
    series.areProjections = series.areProjections || IsProjection(header);
    series.images += static_cast<std::size_t>(std::max(1, std::atoi(GetText(header, { 0x0028, 0x0008 }).c_str())));
    series.files.push_back(file);
  }

  const auto isLikeSlice = [&extensions](const fs::path & path) {
    return path.extension() == ".dcm" || extensions.count({ path.parent_path(), path.extension() }) > 0;
  };
  for (const auto & other : others)
  {
    if (isLikeSlice(other))
    {
      Refuse(other, "it does not begin as DICOM does");
    }
    leftOut.Add(other, "not DICOM");
  }
  for (const auto & text : texts)
  {
    if (isLikeSlice(text))
    {
      leftOut.Add(text, "text, not DICOM");
    }
  }
  leftOut.Warn(warn);

  std::vector<Series> all;
  all.reserve(found.size());
  for (auto & entry : found)
  {
    if (!entry.second.files.empty())
    {
      all.push_back(std::move(entry.second));
    }
  }
  std::sort(all.begin(), all.end(), [](const Series & a, const Series & b) {
    return std::tie(a.date, a.number, a.uid) < std::tie(b.date, b.number, b.uid);
  });
  return all;
}

/** As "2: Thorax, CT, 2024-01-31, 40 images". */
std::string
Describe(const Series & series, std::size_t number)
{
  std::string date = series.date;
  if (date.size() == 8)
  {
    date.insert(6, "-").insert(4, "-");
  }
  std::string text = std::to_string(number) + ": ";
  for (const std::string & part : { series.description, series.modality, date })
  {
    text += part.empty() ? "" : part + ", ";
  }
  return text + std::to_string(series.images) + (series.areProjections ? " projection" : " image") +
         (series.images == 1 ? "" : "s");
}

/** As FindSeries. */
const Series &
Choose(const std::vector<Series> & all, const fs::path & folder, const std::string & series, const std::string & option)
{
  if (all.empty())
  {
    throw std::runtime_error("no DICOM series in the folder '" + folder.string() + "'");
  }
  const bool isNumber = series.find_first_not_of("0123456789") == std::string::npos;
  const auto fits = [&](std::size_t n) {
    return series.empty() || (isNumber ? series == std::to_string(n + 1)
                                       : ToLower(all[n].description).find(ToLower(series)) != std::string::npos);
  };
  std::size_t chosen = 0;
  std::size_t count = 0;
  std::string present;
  std::string fitting;
  for (std::size_t n = 0; n < all.size(); ++n)
  {
    if (!series.empty() && series == all[n].uid)
    {
      return all[n];
    }
    const std::string line = (present.empty() ? "" : "; ") + Describe(all[n], n + 1);
    present += line;
    if (fits(n))
    {
      chosen = n;
      ++count;
      fitting += fitting.empty() ? Describe(all[n], n + 1) : line;
    }
  }
  const std::string name = "'" + folder.string() + "'";
  if (count == 0)
  {
    throw std::runtime_error(option + " " + series + " is not in " + name + ", which has " + present);
  }
  if (count > 1)
  {
    if (!series.empty())
    {
      throw std::runtime_error(option + " " + series + " fits several, choose one by its number: " + fitting);
    }
    const std::string way =
      option.empty() ? "put the one to use into a folder of its own: " : "choose one by " + option + " NUMBER: ";
    throw std::runtime_error(name + " has several DICOM series, " + way + present);
  }
  return all[chosen];
}
} // namespace

std::vector<std::string>
FindSeries(const fs::path &        folder,
           const std::string &     series,
           const WarningFunction & warn,
           const std::string &     option)
{
  const auto     all = FindAllSeries(folder, warn);
  const Series & chosen = Choose(all, folder, series, option);
  LeftOut        leftOut;
  for (const std::string & other : chosen.others)
  {
    leftOut.Add(other, "no image");
  }
  leftOut.Warn(warn);
  for (const std::string & other : chosen.others)
  {
    DicomReader().ReadWhole(other);
  }
  return chosen.files;
}
