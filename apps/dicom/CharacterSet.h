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
#ifndef CharacterSet_h
#define CharacterSet_h

#include <string>

/** A text of DICOM in UTF-8. \a characterSet is its Specific Character Set, with code extensions (PS3.3 C.12.1.1.2 and
 * PS3.5 6.1). What is no character, or of a set that the platform does not have, is a question mark. */
std::string
ConvertToUTF8(const std::string & text, const std::string & characterSet);

#endif
