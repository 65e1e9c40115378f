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
#ifndef TransformRecords_h
#define TransformRecords_h

#include "itkTransformBase.h"

#include <filesystem>
#include <list>
#include <string>

/** What a file says of its transforms: types and numbers, which need not go together. */
using TransformRecords = std::list<itk::TransformBaseTemplate<double>::Pointer>;

/** None if ITK does not read the file. With a damaged one, it can end the process. */
TransformRecords
ReadTransformRecords(const std::filesystem::path & path);

/** Whether ITK can read the file. With a damaged one, it can end the process. */
bool
IsReadableTransform(const std::string & path);

#endif
