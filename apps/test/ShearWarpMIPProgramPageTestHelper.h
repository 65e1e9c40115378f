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
#ifndef ShearWarpMIPProgramPageTestHelper_h
#define ShearWarpMIPProgramPageTestHelper_h

#include "ShearWarpMIPProgramTestHelper.h"

#include "itksys/Base64.h"

#include <regex>

namespace ShearWarpMIPProgramTest
{
inline std::string
DecodeBase64(const std::string & text)
{
  std::string bytes(text.size(), '\0');
  bytes.resize(itksysBase64_Decode(reinterpret_cast<const unsigned char *>(text.data()),
                                   0,
                                   reinterpret_cast<unsigned char *>(bytes.data()),
                                   text.size()));
  return bytes;
}

/** A number of JSON. */
inline double
GetNumber(const std::string & json, const std::string & key)
{
  std::smatch match;
  EXPECT_TRUE(std::regex_search(json, match, std::regex('"' + key + "\": (-?[0-9.e+-]+)"))) << key;
  return match.empty() ? 0.0 : std::stod(match[1]);
}

/** All numbers of a list of JSON, or of a list of lists. */
inline std::vector<double>
GetNumbers(const std::string & json, const std::string & key)
{
  std::smatch match;
  EXPECT_TRUE(std::regex_search(json, match, std::regex('"' + key + "\": (\\[[^\"a-z]*\\])"))) << key;
  const std::string   list = match.empty() ? "" : match[1].str();
  std::vector<double> numbers;
  const std::regex    number("-?[0-9.][0-9.e+-]*");
  for (std::sregex_iterator it(list.begin(), list.end(), number), end; it != end; ++it)
  {
    numbers.push_back(std::stod((*it)[0]));
  }
  return numbers;
}

class ShearWarpMIPProgramPageTest : public ShearWarpMIPProgram
{
protected:
  /** The JSON in the page. */
  std::string
  ReadSeries(const std::string & name) const
  {
    const std::string page = ReadText(this->GetPath(name));
    EXPECT_EQ(page.find("<!DOCTYPE html>"), 0u);
    EXPECT_EQ(page.find("http:"), std::string::npos);
    EXPECT_EQ(page.find("https:"), std::string::npos);
    for (const std::string mark : { "SERIES", "ENGINE", "VOXELS" })
    {
      EXPECT_EQ(page.find('@' + mark + '@'), std::string::npos);
    }
    return this->ReadScript(name, "series");
  }

  /** What is between the tags of a script. */
  std::string
  ReadScript(const std::string & name, const std::string & id) const
  {
    const std::string page = ReadText(this->GetPath(name));
    const std::string tag = " id=\"" + id + "\">";
    const std::size_t begin = page.find(tag);
    EXPECT_NE(begin, std::string::npos) << id;
    return page.substr(begin + tag.size(), page.find("</script>", begin) - begin - tag.size());
  }
};
} // namespace ShearWarpMIPProgramTest

#endif
