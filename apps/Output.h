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

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

/** Holds back SIGINT and SIGTERM: the process gets them at the end of this object's life. */
class HeldSignals
{
public:
  HeldSignals();
  ~HeldSignals();
  HeldSignals(const HeldSignals &) = delete;
  HeldSignals &
  operator=(const HeldSignals &) = delete;

  /** Throws if a signal came. */
  static void
  RequireNone();
};

/** Files beside their final names until Commit(): nothing is ever seen half written, and nothing remains if the program
 * fails or is interrupted. */
class OutputFiles
{
public:
  enum class Format
  {
    Values,
    /** Still or moving. */
    Picture,
    Any
  };

  enum class Layout
  {
    Still,
    Series,
    Volume
  };

  OutputFiles();
  ~OutputFiles();
  OutputFiles(const OutputFiles &) = delete;
  OutputFiles &
  operator=(const OutputFiles &) = delete;

  static bool
  IsPicture(const std::filesystem::path & path);

  static bool
  IsAnimation(const std::filesystem::path & path);

  /** A web page. */
  static bool
  IsPage(const std::filesystem::path & path);

  /** Throws if \a path has an extension of another format, is reserved already or can't be written. */
  void
  Reserve(const std::filesystem::path & path, Format format);

  /** Writes a still without its third axis, and a series of pictures as one file for each frame, numbered. */
  void
  Write(const std::filesystem::path & path, const AnyImage & image, Layout layout);

  /** Writes pictures of 8 bits as an animation, \a rate of them per second. */
  void
  WriteAnimation(const std::filesystem::path & path, const AnyImage & pictures, double rate);

  void
  WriteText(const std::filesystem::path & path, const std::string & text);

  /** The bytes of a PNG of one frame of \a image, made in a file beside \a path. */
  std::string
  EncodePicture(const std::filesystem::path & path, const AnyImage & image, std::size_t frame);

  /** Throws if a name is taken by a folder; no file is changed then. */
  void
  Commit();

private:
  std::filesystem::path
  GetTemporaryName(const std::filesystem::path & path) const;

  /** The temporary name of a file that is about to be written. */
  std::string
  BeginFile(const std::filesystem::path & path);

  void
  WriteFile(const std::filesystem::path & path, const AnyImage & image, unsigned int dimension, const void * buffer);

  std::string                        m_Prefix;
  std::optional<HeldSignals>         m_HeldSignals;
  std::vector<std::filesystem::path> m_Reserved;
  std::vector<std::filesystem::path> m_Written;
};

#endif
