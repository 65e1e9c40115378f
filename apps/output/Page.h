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
#ifndef Page_h
#define Page_h

#include "Output.h"
#include "Picture.h"
#include "Product.h"

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

/** Stores values in whole numbers from 1 on, of 8 or 16 bits; 0 is none. */
struct StoredScale
{
  WindowType   range;
  double       slope{ 1.0 };
  double       intercept{ 0.0 };
  unsigned int bits{ 8 };
  /** Whether there are values beyond each end of the range. */
  bool isCut[2]{ false, false };

  /** The number of a value within the range, or of the end of the range that is nearest. What is no number is 1. */
  std::uint16_t
  Store(double value) const;
};

/** The scale of all values other than \a background, if there is one. 16 bits hold them all, exactly if they are whole
 * numbers of a range of less than 65535; 8 bits hold a grey level for a 254th of twice \a window, which is what can be
 * set from a page, as far as there are values. */
StoredScale
MakeStoredScale(const AnyImage &      values,
                std::optional<double> background,
                const WindowType &    window,
                unsigned int          bits);

/** \a text in quotes, for JSON in a page. */
std::string
Quote(const std::string & text);

std::string
EncodeBase64(std::string_view bytes);

/** The entries of JSON that frames and volumes have in common. */
std::string
DescribeDisplay(const Product & product, const StoredScale & scale, const WindowType & window);

/** Writes the page with \a texts at its marks, such as @SERIES@; at the others it has none. */
void
WriteFilledPage(OutputFiles &                              files,
                const std::filesystem::path &              path,
                const std::map<std::string, std::string> & texts);

WriteFunction WriteFramesPage;
WriteFunction WriteVolumePage;

#endif
