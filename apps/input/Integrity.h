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
#include <ostream>
#include <string>
#include <vector>

/** For the beginning of main(). Damaged files can end the process that parses them, so Check runs the program anew for
 * that: if this is such a run, it parses what the arguments name, and this returns true when all is done. Without a
 * call of this function all is parsed in the process itself. */
bool
ParseIfAsked(int argc, const char * const * argv, std::ostream & output);

enum class FileKind
{
  DicomHeader,
  DicomImage,
  Transform
};

enum class Soundness : char
{
  Sound = '.',
  Damaged = '!',
  WithoutPixels = '0'
};

/** Parses each of the files. */
std::vector<Soundness>
Check(FileKind kind, const std::vector<std::string> & files);

/** Calls \a read, which reads the image file \a path by ITK. Throws if the file is cut short or damaged, as far as its
 * format tells: NRRD, MetaImage, NIfTI and DICOM. Several of ITK's readers take such files for whole. */
void
ReadIntact(const std::filesystem::path & path, const std::function<void()> & read);

/** For each of \a files, whether it has a DICOM header, which can be parsed then. Throws if a file begins as DICOM
 * does, but has no sound header. */
std::vector<bool>
HaveDicomHeaders(const std::vector<std::string> & files);

/** Throws if the file \a path, whose header \a io has read, has fewer voxels than the header says, or values of cells.
 * The readers of VTK, GIPL and MRC do not notice. */
void
RequireAllVoxels(const itk::ImageIOBase & io, const std::filesystem::path & path);

/** Throws the error for a damaged file. */
[[noreturn]] void
Refuse(const std::filesystem::path & path, const std::string & reason);

/** Throws if one of \a files is a DICOM image that is cut short or damaged. Files of other kinds are accepted. */
void
RequireIntactDICOM(const std::vector<std::string> & files);

#endif
