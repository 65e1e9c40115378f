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
#ifndef Output_h
#define Output_h

#include "AnyImage.h"
#include "FileFormat.h"
#include "HeldSignals.h"

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

/** Files beside their final names until Commit(): nothing is ever seen half written, and nothing remains if the program
 * fails or is interrupted. A symbolic link stays one, a file keeps its mode. */
class OutputFiles
{
public:
  enum class Layout
  {
    Still,
    Series,
    Volume
  };

  /** Texts by key. */
  using Texts = std::map<std::string, std::string>;

  OutputFiles();
  ~OutputFiles();
  OutputFiles(const OutputFiles &) = delete;
  OutputFiles &
  operator=(const OutputFiles &) = delete;

  /** Has \a inputs, by whatever name, never written. */
  void
  Protect(const std::vector<std::filesystem::path> & inputs);

  /** Throws if \a path, of \a option, has the extension of no such format, is an input, is reserved already or can't be
   * written. */
  void
  Reserve(const std::filesystem::path & path, const std::set<FileFormat> & formats, const std::string & option);

  /** Throws if the folder \a path is neither new nor empty, or as above. */
  void
  ReserveFolder(const std::filesystem::path & path);

  /** Writes a still without its third axis, and a series of pictures as one file for each frame, numbered. NRRD and
   * MetaImage also hold \a texts, by key; what is too long for MetaImage goes on in KEY.2, KEY.3 and so on. */
  void
  Write(const std::filesystem::path & path, const AnyImage & image, Layout layout, const Texts & texts = {});

  /** Writes all points in time, with the entries that the dictionary of the first one has, if the format has any. */
  void
  WriteVolume(const std::filesystem::path & path, const Volume & volume);

  /** Writes pictures of 8 bits as an animation, \a rate of them per second. */
  void
  WriteAnimation(const std::filesystem::path & path, const AnyImage & pictures, double rate);

  /** Writes \a parts one after the other. */
  void
  WriteText(const std::filesystem::path & path, const std::vector<std::string_view> & parts);

  /** The bytes of a PNG of one frame of \a image, made in a file beside \a path. */
  std::string
  EncodePicture(const std::filesystem::path & path, const AnyImage & image, std::size_t frame);

  /** Makes a folder to write the files of the folder \a path into. */
  std::filesystem::path
  BeginFolder(const std::filesystem::path & path);

  /** Gives all files their names. Throws if that is not possible; no file is changed then. */
  void
  Commit();

private:
  using Path = std::filesystem::path;
  using Names = std::map<std::string, Path>;

  struct File
  {
    Path temporary;
    Path target;
    /** What was there before, to go back. */
    Path former;
    /** A folder that was there when this was begun. */
    bool isFilled{ false };
  };

  /** Holds signals from now on. Throws if one came. */
  void
  HoldSignals();

  Path
  MakeTemporaryName(const Path & folder, const std::string & extension);

  void
  RequireNoInput(const Path & path) const;

  /** Adds \a path to the names that are \a taken. What it leads to; throws if that can't be written. */
  Path
  Claim(const Path & path, bool isFolder, Names & taken) const;

  /** But for temporary files. */
  bool
  IsEmptyFolder(const Path & path) const;

  /** Throws if nothing can be written into \a folder, for \a path. */
  void
  RequireWritable(const Path & folder, const Path & path);

  /** The temporary name of a file that is about to be written. */
  std::string
  BeginFile(const Path & path);

  /** The temporary name of a file that RemoveScratch() removes again, at the place of \a path and as secret. */
  std::string
  BeginScratch(const Path & path, const std::string & extension);

  std::string
  AddFile(const Path & target, const std::string & extension);

  void
  RemoveScratch();

  void
  KeepFormer(File & file);

  /** The fourth axis of a file. */
  struct Times
  {
    std::size_t count{ 1 };
    double      spacing{ 1.0 };
    double      origin{ 0.0 };
  };

  void
  WriteFile(const Path &        path,
            const std::string & temporaryName,
            const AnyImage &    image,
            unsigned int        dimension,
            const void *        buffer,
            const Times &       times,
            const Texts &       texts = {});

  std::string                m_Prefix;
  unsigned int               m_Count{ 0 };
  std::optional<HeldSignals> m_HeldSignals;
  Names                      m_Inputs;
  Names                      m_Reserved;
  Names                      m_Begun;
  std::vector<File>          m_Files;
};

#endif
