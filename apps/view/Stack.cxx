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
#include "Stack.h"

#include "FileGeometry.h"
#include "FileStart.h"
#include "InputFiles.h"
#include "Integrity.h"
#include "Options.h"
#include "FileFormat.h"

#include "itkImageFileReader.h" // registers ITK's readers and writers
#include "itkImageIOFactory.h"
#include "itkMetaDataObject.h"
#include "itkShearWarpFactorization.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>

namespace
{
namespace fs = std::filesystem;
using TransformType = itk::ShearWarpMIPView::TransformType;

constexpr std::size_t numbersOfTransform = 16;

/** The shortest text that is read as the same number. */
std::string
Print(double number)
{
  std::string text;
  for (int digits = 15; digits <= 17; ++digits)
  {
    std::ostringstream stream;
    stream.precision(digits);
    stream << number;
    text = stream.str();
    if (std::strtod(text.c_str(), nullptr) == number)
    {
      break;
    }
  }
  return text;
}

std::string
Print(const std::vector<double> & numbers)
{
  std::string text;
  for (const double number : numbers)
  {
    text += (text.empty() ? "" : " ") + Print(number);
  }
  return text;
}

/** 4 x 4, row by row. */
std::vector<double>
GetNumbers(const itk::Transform<double, 3, 3> * transform)
{
  const auto          linear = itk::ShearWarpFactorization::GetLinearPart(transform);
  const auto          origin = transform->TransformPoint(itk::Point<double, 3>(0.0));
  std::vector<double> numbers;
  for (unsigned int row = 0; row < 3; ++row)
  {
    for (unsigned int column = 0; column < 3; ++column)
    {
      numbers.push_back(linear(row, column));
    }
    numbers.push_back(origin[row]);
  }
  numbers.insert(numbers.end(), { 0.0, 0.0, 0.0, 1.0 });
  return numbers;
}

/** The entries of a file, and its name for errors. */
class Keys
{
public:
  Keys(const fs::path & path, const itk::MetaDataDictionary & dictionary)
    : m_Path(path)
  {
    for (const std::string & key : dictionary.GetKeys())
    {
      itk::ExposeMetaData<std::string>(dictionary, key, m_Texts[key]);
    }
  }

  [[noreturn]] void
  Refuse(const std::string & key, const std::string & reason) const
  {
    throw std::runtime_error("'" + m_Path.string() + "' has frames, but its " + key + ' ' + reason);
  }

  bool
  Has(const std::string & key) const
  {
    return m_Texts.count(key) > 0;
  }

  std::string
  GetText(const std::string & key) const
  {
    const auto found = m_Texts.find(key);
    return found == m_Texts.end() ? "" : Trim(found->second);
  }

  /** The one of \a names that a key has, the first without the key. */
  std::string
  GetName(const std::string & key, const std::vector<std::string> & names) const
  {
    std::string text = this->Has(key) ? this->GetText(key) : names.front();
    std::replace(text.begin(), text.end(), '_', '-');
    if (std::find(names.begin(), names.end(), text) == names.end())
    {
      std::string all;
      for (const std::string & name : names)
      {
        all += (all.empty() ? "" : ", ") + name;
      }
      this->Refuse(key, "must be one of " + all);
    }
    return text;
  }

  /** As many numbers as \a most, or fewer; a text of more is refused. */
  std::vector<double>
  GetNumbers(const std::string & key, std::size_t most, bool areFinite = true) const
  {
    std::vector<double> numbers;
    // what is too long for MetaImage is in several
    for (std::string name = key; this->Has(name); name = key + '.' + std::to_string(std::stoi(GetEnding(name)) + 1))
    {
      const std::string & text = m_Texts.at(name);
      for (const char * at = text.c_str(); *at != '\0';)
      {
        char *       end = nullptr;
        const double number = std::strtod(at, &end);
        if (end == at)
        {
          if (std::string(" ,\t").find(*at) == std::string::npos)
          {
            this->Refuse(key, "holds something that is no number");
          }
          ++at;
          continue;
        }
        if (numbers.size() == most)
        {
          this->Refuse(key, "has more than " + std::to_string(most) + " numbers");
        }
        if (areFinite ? !std::isfinite(number) : std::isnan(number))
        {
          this->Refuse(key, "holds a number that is not finite");
        }
        numbers.push_back(number);
        at = end;
      }
    }
    return numbers;
  }

  /** So many numbers; none without the key. */
  std::vector<double>
  GetAll(const std::string & key, std::size_t count, bool areFinite = true) const
  {
    std::vector<double> numbers = this->GetNumbers(key, count, areFinite);
    if (this->Has(key) && numbers.size() != count)
    {
      this->Refuse(key, "has " + std::to_string(numbers.size()) + " numbers; " + std::to_string(count) + " are needed");
    }
    return numbers;
  }

  const std::map<std::string, std::string> &
  GetTexts() const
  {
    return m_Texts;
  }

private:
  /** The number behind the last point, 1 without one. */
  static std::string
  GetEnding(const std::string & name)
  {
    const auto point = name.rfind('.');
    return point == std::string::npos ? "1" : name.substr(point + 1);
  }

  fs::path                           m_Path;
  std::map<std::string, std::string> m_Texts{};
};

/** The names of all modes; the first one is the default. */
std::vector<std::string>
GetModeNames()
{
  std::vector<std::string> names{ "maximum" };
  for (const auto & [name, mode] : modes)
  {
    if (name != names.front())
    {
      names.push_back(name);
    }
  }
  return names;
}

/** The transforms, whose lengths are \a millimetres. */
std::vector<Frame>
MakeFrames(const Keys & keys, std::size_t count, double millimetres)
{
  const std::string key = "FrameTransforms";
  const auto        numbers = keys.GetAll(key, numbersOfTransform * count);
  if (!keys.Has(key))
  {
    keys.Refuse(key, "has blanks beside its name");
  }
  std::vector<Frame>        frames(count);
  const std::vector<double> lastRow{ 0.0, 0.0, 0.0, 1.0 };
  for (std::size_t n = 0; n < count; ++n)
  {
    const auto                      matrix = numbers.begin() + static_cast<std::ptrdiff_t>(numbersOfTransform * n);
    TransformType::MatrixType       linear;
    TransformType::OutputVectorType offset;
    for (unsigned int row = 0; row < 3; ++row)
    {
      for (unsigned int column = 0; column < 3; ++column)
      {
        linear(row, column) = matrix[4 * row + column];
      }
      offset[row] = millimetres * matrix[4 * row + 3];
    }
    const auto        transform = TransformType::New();
    const std::string name = "has a matrix of frame " + std::to_string(n + 1) + " that ";
    if (!std::equal(lastRow.begin(), lastRow.end(), matrix + 12))
    {
      keys.Refuse(key, name + "does not end with 0 0 0 1");
    }
    try
    {
      transform->SetMatrix(linear);
      transform->SetOffset(offset);
      itk::ShearWarpFactorization::VerifyViewTransform(transform);
    }
    catch (const itk::ExceptionObject &)
    {
      keys.Refuse(key, name + "is singular");
    }
    frames[n].transform = transform;
  }
  return frames;
}

/** How a turn of such angles goes on, if nothing else is known: back where they do so. */
std::string
FindLoop(const std::vector<double> & angles)
{
  if (angles.empty())
  {
    return "none";
  }
  const double step = angles.size() > 1 ? angles[1] - angles[0] : 360.0;
  for (std::size_t n = 1; n < angles.size(); ++n)
  {
    if ((angles[n] - angles[n - 1]) * step < 0.0)
    {
      return "swing";
    }
  }
  return std::abs(std::abs(step) * static_cast<double>(angles.size()) - 360.0) < 1e-6 ? "turn" : "none";
}

void
SetTurn(Stack & stack, const Keys & keys)
{
  const std::size_t count = stack.frames.size();
  const auto        angles = keys.GetAll("FrameAngles", count);
  for (std::size_t n = 0; n < angles.size(); ++n)
  {
    stack.frames[n].angle = angles[n];
  }
  stack.elevations = keys.GetNumbers("Elevations", count);
  if (keys.Has("Elevations") && (stack.elevations.empty() || angles.empty() || count % stack.elevations.size() != 0))
  {
    keys.Refuse("Elevations",
                "has " + std::to_string(stack.elevations.size()) + " turns, which " + std::to_string(count) +
                  " frames" + (angles.empty() ? " without FrameAngles" : "") + " do not make");
  }
  stack.loop = keys.Has("Loop") ? keys.GetName("Loop", { "none", "turn", "swing" }) : FindLoop(GetAngles(stack));
  if (stack.loop != "none" && angles.empty())
  {
    keys.Refuse("Loop", "is " + stack.loop + " without FrameAngles");
  }
}

void
SetSlabs(Stack & stack, const Keys & keys, double millimetres)
{
  const std::size_t count = stack.frames.size();
  const auto        slabs = keys.GetNumbers("Slab", 2 * count, false);
  if (slabs.empty() && !keys.Has("Slab"))
  {
    return;
  }
  if (slabs.size() != 2 && slabs.size() != 2 * count)
  {
    keys.Refuse("Slab", "has " + std::to_string(slabs.size()) + " numbers; 2 are needed, or 2 for each frame");
  }
  for (std::size_t n = 0; n < count; ++n)
  {
    const std::size_t at = slabs.size() == 2 ? 0 : 2 * n;
    Frame &           frame = stack.frames[n];
    frame.slabNear = millimetres * slabs[at];
    frame.slabFar = millimetres * slabs[at + 1];
    if (frame.slabNear > frame.slabFar)
    {
      keys.Refuse("Slab", "has a NEAR that is greater than FAR");
    }
  }
}

void
SetBackground(Projections & projections, const Keys & keys)
{
  const std::string key = "Background";
  projections.background = FindBackground({ projections.stack });
  if (keys.Has(key))
  {
    const std::string text = keys.GetText(key);
    char *            end = nullptr;
    projections.background = std::strtod(text.c_str(), &end);
    if (text.empty() || *end != '\0')
    {
      keys.Refuse(key, "is no number");
    }
    if (!IsPixelValue(projections.stack.componentType, projections.background))
    {
      keys.Refuse(key, "is no value of its pixel type");
    }
  }
}

/** The pixels, and their grid in mm. */
AnyImage
ReadFrames(itk::ImageIOBase & io, const fs::path & path, double millimetres)
{
  const unsigned int dimension = io.GetNumberOfDimensions();
  if (dimension != 2 && dimension != 3)
  {
    throw std::runtime_error("'" + path.string() + "' has " + std::to_string(dimension) +
                             " dimensions; frames have 2 or 3");
  }
  if (io.GetPixelType() == itk::IOPixelEnum::COMPLEX)
  {
    throw std::runtime_error("'" + path.string() + "' has complex pixels; real ones are needed");
  }
  const auto         grid = itk::ImageBase<3>::New();
  itk::Size<3>       size{ { 1, 1, 1 } };
  auto               spacing = grid->GetSpacing();
  auto               origin = grid->GetOrigin();
  itk::ImageIORegion region(dimension);
  for (unsigned int axis = 0; axis < dimension; ++axis)
  {
    const double factor = axis < 2 ? millimetres : 1.0;
    size[axis] = io.GetDimensions(axis);
    spacing[axis] = factor * io.GetSpacing(axis);
    origin[axis] = factor * io.GetOrigin(axis);
    region.SetSize(axis, size[axis]);
    const auto direction = io.GetDirection(axis);
    if (!(std::abs(direction[axis] - 1.0) < 1e-6) || !(spacing[axis] > 0.0) || !std::isfinite(origin[axis]))
    {
      throw std::runtime_error("'" + path.string() +
                               "' has frames, but its axes are not the axes of view space: right, down and frame");
    }
  }
  if (size[2] > 65535)
  {
    throw std::runtime_error("'" + path.string() + "' has more than 65535 frames");
  }
  RequireAllVoxels(io, path);
  grid->SetRegions(size);
  grid->SetSpacing(spacing);
  grid->SetOrigin(origin);
  io.SetIORegion(region);
  return DispatchPixelType(io.GetComponentType(), [&](auto tag) {
    const auto frames = MakeAnyImage<typename decltype(tag)::Type>(grid, io.GetNumberOfComponents());
    io.Read(CastImage<typename decltype(tag)::Type>(frames).GetBufferPointer());
    return frames;
  });
}

void
SetSources(Stack & stack, const Keys & keys)
{
  stack.sourceFiles = SplitPaths(keys.GetText("SourceFiles"));
  stack.maskFiles = SplitPaths(keys.GetText("MaskFiles"));
  for (const auto & [key, text] : keys.GetTexts())
  {
    if (std::regex_match(key.substr(0, 10), std::regex("[0-9a-f]{4}\\|[0-9a-f]{4}")))
    {
      stack.attributes[key] = text;
    }
  }
}
} // namespace

std::vector<double>
GetAngles(const Stack & stack)
{
  std::vector<double> angles;
  for (std::size_t n = 0; n < CountFramesOfTurn(stack) && !std::isnan(stack.frames[n].angle); ++n)
  {
    angles.push_back(stack.frames[n].angle);
  }
  return angles;
}

std::size_t
CountFramesOfTurn(const Stack & stack)
{
  return stack.frames.size() / std::max<std::size_t>(1, stack.elevations.size());
}

std::map<std::string, std::string>
DescribeStack(const Stack & stack)
{
  std::vector<double> transforms;
  std::vector<double> angles;
  std::vector<double> slabs;
  for (const Frame & frame : stack.frames)
  {
    const auto numbers = GetNumbers(frame.transform);
    transforms.insert(transforms.end(), numbers.begin(), numbers.end());
    angles.push_back(frame.angle);
    slabs.insert(slabs.end(), { frame.slabNear, frame.slabFar });
  }
  std::map<std::string, std::string> texts{ { "FrameTransforms", Print(transforms) },
                                            { "Background", Print(stack.projections.background) },
                                            { "Loop", stack.loop } };
  const auto                         add = [&texts](bool isKnown, const std::string & key, const std::string & text) {
    if (isKnown)
    {
      texts[key] = text;
    }
  };
  const auto mode =
    std::find_if(modes.begin(), modes.end(), [&](const auto & entry) { return entry.second == stack.mode; });
  add(mode != modes.end(), "Mode", mode->first);
  add(!GetAngles(stack).empty(), "FrameAngles", Print(angles));
  add(!stack.elevations.empty(), "Elevations", Print(stack.elevations));
  const bool isOneSlab = std::all_of(stack.frames.begin(), stack.frames.end(), [&](const Frame & frame) {
    return frame.slabNear == slabs[0] && frame.slabFar == slabs[1];
  });
  slabs.resize(isOneSlab ? 2 : slabs.size());
  add(!isOneSlab || std::isfinite(slabs[0]) || std::isfinite(slabs[1]), "Slab", Print(slabs));
  if (stack.center)
  {
    texts["Center"] = Print(std::vector<double>(stack.center->Begin(), stack.center->End()));
  }
  add(!stack.hasOrientation, "HasOrientation", "0");
  add(stack.projections.isInverted, "IsInverted", "1");
  add(stack.isSuv, "IsSuv", "1");
  return texts;
}

std::optional<Stack>
ReadStack(const fs::path & path, bool isTrusted, const WarningFunction & warn)
{
  const std::string extension = GetExtension(path);
  std::error_code   ignored;
  if (!fs::is_regular_file(path, ignored) ||
      (ReadStart(path, 4) != "NRRD" && extension != ".mha" && extension != ".mhd") ||
      ReadFields(path).count("FrameTransforms") == 0)
  {
    return std::nullopt;
  }
  RequireReadable(path);
  std::optional<Stack> made;
  ReadIntact(path, [&] {
    const auto io = itk::ImageIOFactory::CreateImageIO(path.c_str(), itk::IOFileModeEnum::ReadMode);
    if (!io)
    {
      throw std::runtime_error("'" + path.string() + "' is no NRRD or MetaImage");
    }
    io->SetFileName(path.string());
    io->ReadImageInformation();
    const Keys        keys(path, io->GetMetaDataDictionary());
    const std::string unit = keys.GetText("Unit");
    const auto        known = FindMillimetres(unit);
    if (!known && !unit.empty())
    {
      warn("'" + path.string() + "' has lengths in '" + unit.substr(0, 20) + "', which are taken for mm");
    }
    const double millimetres = known.value_or(1.0);

    Stack stack{ { ReadFrames(*io, path, millimetres), {}, 0.0 } };
    stack.isSeries = io->GetNumberOfDimensions() == 3;
    stack.frames =
      MakeFrames(keys, stack.projections.stack.image->GetLargestPossibleRegion().GetSize()[2], millimetres);
    SetTurn(stack, keys);
    SetSlabs(stack, keys, millimetres);
    SetBackground(stack.projections, keys);
    stack.mode = modes.at(keys.GetName("Mode", GetModeNames()));
    const auto center = keys.GetAll("Center", 3);
    if (!center.empty())
    {
      const double point[] = { millimetres * center[0], millimetres * center[1], millimetres * center[2] };
      stack.center = ProjectionOptions::PointType(point);
    }
    stack.hasOrientation = keys.GetName("HasOrientation", { "1", "0" }) == "1";
    stack.projections.isInverted = keys.GetName("IsInverted", { "0", "1" }) == "1";
    stack.isSuv = keys.GetName("IsSuv", { "0", "1" }) == "1";
    if (isTrusted)
    {
      SetSources(stack, keys);
    }
    made = std::move(stack);
  });
  return made;
}
