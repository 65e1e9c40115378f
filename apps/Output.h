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

#include "Projection.h"

#include <filesystem>
#include <optional>

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
  enum class Kind
  {
    Still,
    Series,
    Volume
  };

  /** Throws if \a path has an unknown extension or can't be written. A series of PNG is one file for each frame,
   * numbered. */
  OutputFiles(std::filesystem::path path, Kind kind);
  ~OutputFiles();
  OutputFiles(const OutputFiles &) = delete;
  OutputFiles &
  operator=(const OutputFiles &) = delete;

  bool
  IsWindowed() const;

  void
  WriteValues(const ScalarImage & stack);

  /** Writes pixels of 8 bits: \a window, or a robust range of values other than the background, becomes 0 to 255. */
  void
  WriteWindowed(const Frames & frames, const std::optional<itk::Vector<double, 2>> & window);

  /** Throws if a name is taken by a folder; no file is changed then. */
  void
  Commit();

private:
  std::filesystem::path
  GetTemporaryName(const std::filesystem::path & path) const;

  void
  Write(const std::filesystem::path & path,
        const itk::ImageBase<3> *     grid,
        unsigned int                  dimension,
        itk::IOComponentEnum          componentType,
        const void *                  buffer);

  std::filesystem::path              m_Path;
  Kind                               m_Kind;
  std::string                        m_Prefix;
  std::optional<HeldSignals>         m_HeldSignals;
  std::vector<std::filesystem::path> m_Written;
};

#endif
