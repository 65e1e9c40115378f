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
#include "Labels.h"

#include "Orientation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <map>
#include <sstream>

namespace
{
using PointType = itk::Vector<double, 2>;
using SegmentType = std::array<PointType, 2>;

/** Lines through points, a digit for x (to the right) and one for y (down), of letters that are 6 units high. A small o
 * is the sign of degrees, and u the Greek letter. */
const std::map<char, std::string> glyphs = { { ' ', "" },
                                             { '-', "0323" },
                                             { '.', "0606" },
                                             { '0', "102031352616050110" },
                                             { '1', "011016" },
                                             { '2', "01102031320636" },
                                             { '3', "01102031322313 233435261605" },
                                             { '4', "000333 3036" },
                                             { '5', "300002223335261605" },
                                             { '6', "312010010516263534231304" },
                                             { '7', "003016" },
                                             { '8', "102031322313020110 1304051626353423" },
                                             { '9', "051626353120100102132332" },
                                             { 'A', "062046 1434" },
                                             { 'C', "4130100105163645" },
                                             { 'F', "400006 0333" },
                                             { 'H', "0006 4046 0343" },
                                             { 'L', "000646" },
                                             { 'O', "103041453616050110" },
                                             { 'P', "06003041423303" },
                                             { 'R', "06003041423303 2346" },
                                             { 'U', "000516364540" },
                                             { 'm', "0602 03122326 23324346" },
                                             { 'n', "0602 0312223336" },
                                             { 'o', "1021120110" },
                                             { 'u', "0207 0516263532 3536" } };

constexpr double glyphHeight = 6.0;
constexpr double margin = 3.0;

struct Text
{
  std::vector<SegmentType> lines;
  double                   width;
};

/** The lines of \a text from (0, 0) on; its letters are one unit apart. */
Text
MakeText(const std::string & text)
{
  std::vector<SegmentType> lines;
  double                   begin = 0.0;
  double                   end = 0.0;
  for (const char letter : text)
  {
    std::istringstream polylines(glyphs.at(letter));
    for (std::string digits; polylines >> digits;)
    {
      std::vector<PointType> points(digits.size() / 2);
      for (std::size_t n = 0; n < points.size(); ++n)
      {
        points[n][0] = begin + digits[2 * n] - '0';
        points[n][1] = digits[2 * n + 1] - '0';
        end = std::max(end, points[n][0]);
        if (n > 0)
        {
          lines.push_back({ { points[n - 1], points[n] } });
        }
      }
    }
    begin = (letter == ' ' ? begin + 1.0 : end) + 2.0;
  }
  return { lines, end };
}

double
ComputeDistance(const PointType & point, const SegmentType & line)
{
  const PointType along = line[1] - line[0];
  const double    squaredLength = along.GetSquaredNorm();
  const double fraction = squaredLength > 0.0 ? std::clamp((point - line[0]) * along / squaredLength, 0.0, 1.0) : 0.0;
  return (point - line[0] - along * fraction).GetNorm();
}

/** A picture of 8 bits to draw into. */
class Canvas
{
public:
  Canvas(unsigned char * pixels, const itk::Size<3> & size, unsigned int components)
    : m_Pixels(pixels)
    , m_Width(static_cast<long>(size[0]))
    , m_Height(static_cast<long>(size[1]))
    , m_Components(components)
    , m_Unit(std::max(1.0, static_cast<double>(std::min(m_Width, m_Height)) / (28.0 * (glyphHeight + 1.0))))
  {}

  /** Pixels per unit of the letters. */
  double
  GetUnit() const
  {
    return m_Unit;
  }

  /** In units, between the centers of the outer pixels. */
  double
  GetWidth() const
  {
    return static_cast<double>(m_Width - 1) / m_Unit;
  }

  double
  GetHeight() const
  {
    return static_cast<double>(m_Height - 1) / m_Unit;
  }

  /** Draws \a lines, in units, from (\a x, \a y) on. */
  void
  Draw(std::vector<SegmentType> lines, double x, double y)
  {
    // a pixel's center makes the smallest letters crisp
    PointType origin;
    origin[0] = std::round(x * m_Unit);
    origin[1] = std::round(y * m_Unit);
    PointType lower(std::numeric_limits<double>::max());
    PointType upper(std::numeric_limits<double>::lowest());
    for (SegmentType & line : lines)
    {
      for (PointType & point : line)
      {
        point = origin + point * m_Unit;
        for (unsigned int axis = 0; axis < 2; ++axis)
        {
          lower[axis] = std::min(lower[axis], point[axis]);
          upper[axis] = std::max(upper[axis], point[axis]);
        }
      }
    }
    const double half = 0.5 * m_Unit;
    const double rim = 1.5 * m_Unit;
    const double reach = rim + 0.5;
    const auto   clampIndex = [](double value, long size) { return std::clamp(static_cast<long>(value), 0L, size); };
    const long   endX = clampIndex(upper[0] + reach + 1.0, m_Width);
    const long   endY = clampIndex(upper[1] + reach + 1.0, m_Height);
    for (long row = clampIndex(lower[1] - reach, m_Height); row < endY; ++row)
    {
      for (long column = clampIndex(lower[0] - reach, m_Width); column < endX; ++column)
      {
        PointType point;
        point[0] = static_cast<double>(column);
        point[1] = static_cast<double>(row);
        double distance = reach;
        for (const SegmentType & line : lines)
        {
          distance = std::min(distance, ComputeDistance(point, line));
        }
        const double black = std::clamp(reach - distance, 0.0, 1.0);
        const double white = std::clamp(half + 0.5 - distance, 0.0, 1.0);
        for (unsigned int component = 0; component < m_Components; ++component)
        {
          unsigned char & pixel = m_Pixels[(row * m_Width + column) * m_Components + component];
          pixel = static_cast<unsigned char>(std::lround(pixel * (1.0 - black) * (1.0 - white) + 255.0 * white));
        }
      }
    }
  }

private:
  unsigned char * m_Pixels;
  long            m_Width;
  long            m_Height;
  unsigned int    m_Components;
  double          m_Unit;
};

void
DrawSides(Canvas & canvas, const EdgeLetters & letters)
{
  const auto draw = [&](const std::string & text, double x, double y) {
    const Text   made = MakeText(text);
    const double right = canvas.GetWidth() - made.width - margin;
    const double bottom = canvas.GetHeight() - glyphHeight - margin;
    canvas.Draw(made.lines, margin + x * (right - margin), margin + y * (bottom - margin));
  };
  draw(letters.left, 0.0, 0.5);
  draw(letters.right, 1.0, 0.5);
  draw(letters.top, 0.5, 0.0);
  draw(letters.bottom, 0.5, 1.0);
}

/** Whether what is \a width wide has room to the left of the letters at the top or bottom. */
bool
HasRoom(const Canvas & canvas, double width)
{
  constexpr double halfOfTwoLetters = 5.0;
  return margin + width + margin <= 0.5 * canvas.GetWidth() - halfOfTwoLetters;
}

void
DrawAngles(Canvas & canvas, const ViewAngles & angles)
{
  const auto write = [](double angle, const std::string & positive, const std::string & negative) {
    const long         tenths = std::lround(10.0 * angle);
    const bool         isNegative = tenths < 0 && tenths > -1800;
    std::ostringstream text;
    text << (isNegative ? negative : positive) << ' ' << static_cast<double>(std::abs(tenths)) / 10.0;
    return text.str();
  };
  const std::string         primary = write(angles.primary, "LAO", "RAO");
  const std::string         secondary = write(angles.secondary, "CRA", "CAU");
  const Text                one = MakeText(primary + ' ' + secondary);
  const std::array<Text, 2> two{ { MakeText(primary), MakeText(secondary) } };
  if (HasRoom(canvas, one.width))
  {
    canvas.Draw(one.lines, margin, margin);
  }
  else if (HasRoom(canvas, std::max(two[0].width, two[1].width)))
  {
    canvas.Draw(two[0].lines, margin, margin);
    canvas.Draw(two[1].lines, margin, margin + glyphHeight + 3.0);
  }
}

/** \a spacing is the pixels' spacing, in mm. */
void
DrawScale(Canvas & canvas, double spacing, double width)
{
  // not 4.999... for 5
  const double most = 0.25 * width * spacing * (1.0 + 1e-9);
  const int    exponent = static_cast<int>(std::floor(std::log10(most)));
  const double power = std::pow(10.0, exponent);
  const double length = power * (5.0 * power <= most ? 5.0 : 2.0 * power <= most ? 2.0 : 1.0);

  // tenths of the larger unit come before thousands of the smaller one
  const int          thousands = exponent < -4 ? 2 : exponent < -1 ? 1 : 0;
  std::ostringstream text;
  text << std::fixed << std::setprecision(std::max(0, -exponent - 3 * thousands))
       << length * std::pow(1000.0, thousands)
       << std::array<const char *, 3>{ { " mm", " um", " nm" } }[static_cast<std::size_t>(thousands)];
  const Text   made = MakeText(text.str());
  const double bar = length / spacing / canvas.GetUnit();
  if (HasRoom(canvas, std::max(bar, made.width)))
  {
    const auto makeLine = [](double x0, double y0, double x1, double y1) {
      SegmentType line;
      line[0][0] = x0;
      line[0][1] = y0;
      line[1][0] = x1;
      line[1][1] = y1;
      return line;
    };
    const double bottom = canvas.GetHeight() - margin;
    canvas.Draw(made.lines, margin, bottom - glyphHeight - 5.0);
    canvas.Draw(
      { makeLine(0.0, 0.0, bar, 0.0), makeLine(0.0, -2.0, 0.0, 0.0), makeLine(bar, -2.0, bar, 0.0) }, margin, bottom);
  }
}
} // namespace

void
DrawLabels(const AnyImage & pictures, const std::vector<Frame> & frames, const Labels & labels)
{
  auto &             image = CastImage<unsigned char>(pictures);
  const auto         size = image.GetLargestPossibleRegion().GetSize();
  const unsigned int components = image.GetNumberOfComponentsPerPixel();
  unsigned char *    pixels = image.GetBufferPointer();
  for (std::size_t n = 0; n < frames.size() && std::min(size[0], size[1]) >= SmallestLabelled; ++n)
  {
    const itk::Transform<double, 3, 3> * const transform = frames[n].transform;
    Canvas                                     canvas(pixels + n * size[0] * size[1] * components, size, components);
    if (labels.hasSides && labels.hasOrientation)
    {
      DrawSides(canvas, ComputeEdgeLetters(transform));
    }
    if (labels.hasScaleAndAngles && labels.hasOrientation)
    {
      DrawAngles(canvas, ComputeViewAngles(transform));
    }
    if (labels.hasScaleAndAngles)
    {
      DrawScale(canvas, image.GetSpacing()[0] * ComputeAxis(transform, 0).GetNorm(), static_cast<double>(size[0]));
    }
  }
}
