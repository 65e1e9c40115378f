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
#ifndef Integrity_h
#define Integrity_h

#include "itkImageIOBase.h"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <ios>
#include <string>

enum class DeflateFormat
{
  GzipOrZlib,
  Raw
};

/** The bytes that the stream from \a offset on inflates to. Throws if the stream is cut short or damaged. */
std::uintmax_t
GetInflatedSize(const std::filesystem::path & path,
                std::streamoff                offset = 0,
                DeflateFormat                 format = DeflateFormat::GzipOrZlib);

/** Calls \a read, which reads the image file \a path by ITK. Throws if ITK cannot, or if the file is cut short or
 * damaged, as far as its format tells: NRRD, MetaImage and NIfTI. Several of ITK's readers take such files for whole.
 */
void
ReadIntact(const std::filesystem::path & path, const std::function<void()> & read);

/** Throws if the file \a path, whose header \a io has read, has fewer voxels than the header says, or values of cells.
 * The readers of VTK, GIPL and MRC do not notice. The readers of NRRD and MetaImage notice, but need memory for all
 * voxels first. */
void
RequireAllVoxels(const itk::ImageIOBase & io, const std::filesystem::path & path);

/** What is said of a damaged file. */
std::string
DescribeDamage(const std::filesystem::path & path, const std::string & reason);

/** Throws the error for a damaged file. */
[[noreturn]] void
Refuse(const std::filesystem::path & path, const std::string & reason);

#endif
