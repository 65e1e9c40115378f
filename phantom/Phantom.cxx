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
#include "Phantom.h"

#include "itkImageRegionIteratorWithIndex.h"
#include "itkMath.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace Phantom
{
namespace
{
struct Node
{
  VectorType position;
  double     radius;
};
using Path = std::vector<Node>;

VectorType
MakeVector(double x, double y, double z)
{
  const double components[] = { x, y, z };
  return VectorType(components);
}

VectorType
Normalize(VectorType vector)
{
  vector.Normalize();
  return vector;
}

struct Ellipsoid
{
  VectorType center;
  VectorType radii;

  /** 0 at the center, 1 on the surface. */
  double
  GetDepth(const VectorType & point) const
  {
    double sum = 0.0;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const double ratio = (point[axis] - center[axis]) / radii[axis];
      sum += ratio * ratio;
    }
    return std::sqrt(sum);
  }

  VectorType
  GetNormal(const VectorType & point) const
  {
    VectorType normal;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      normal[axis] = (point[axis] - center[axis]) / (radii[axis] * radii[axis]);
    }
    return Normalize(normal);
  }
};

// mm, LPS
const Ellipsoid brain{ MakeVector(0, 2, 4), MakeVector(64, 82, 62) };

/** A smooth curve through \a nodes with a node at least every half mm. */
Path
MakeCurve(const Path & nodes)
{
  Path curve;
  for (std::size_t i = 0; i + 1 < nodes.size(); ++i)
  {
    const VectorType & a = nodes[i == 0 ? 0 : i - 1].position;
    const VectorType & b = nodes[i].position;
    const VectorType & c = nodes[i + 1].position;
    const VectorType & d = nodes[std::min(i + 2, nodes.size() - 1)].position;
    const auto         steps = static_cast<int>(std::ceil((c - b).GetNorm() / 0.4));
    for (int step = 0; step <= steps; ++step)
    {
      const double     t = static_cast<double>(step) / steps;
      const VectorType position =
        b + ((c - a) * t + (a * 2.0 - b * 5.0 + c * 4.0 - d) * t * t + (b * 3.0 - a - c * 3.0 + d) * t * t * t) * 0.5;
      curve.push_back({ position, nodes[i].radius + t * (nodes[i + 1].radius - nodes[i].radius) });
    }
  }
  return curve;
}

/** A painter of bright vessels into an image. */
class VesselPainter
{
public:
  explicit VesselPainter(ImageType & image)
    : m_Image(image)
  {}

  void
  Paint(const Path & curve)
  {
    for (std::size_t i = 0; i + 1 < curve.size(); ++i)
    {
      this->PaintCone(curve[i], curve[i + 1]);
    }
  }

  void
  PaintSphere(const VectorType & center, double radius)
  {
    this->PaintCone({ center, radius }, { center, radius });
  }

private:
  void
  PaintCone(const Node & from, const Node & to)
  {
    constexpr double edge = 0.85;
    const double     reach = std::max(from.radius, to.radius) + edge;
    const auto       region = m_Image.GetBufferedRegion();
    long             first[3];
    long             last[3];
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      const double low = std::min(from.position[axis], to.position[axis]) - reach;
      const double high = std::max(from.position[axis], to.position[axis]) + reach;
      const auto   toIndex = [&](double x) { return (x - m_Image.GetOrigin()[axis]) / m_Image.GetSpacing()[axis]; };
      first[axis] = std::max(0L, std::lround(std::ceil(toIndex(low))));
      last[axis] = std::min(static_cast<long>(region.GetSize(axis)) - 1, std::lround(std::floor(toIndex(high))));
    }
    const VectorType     along = to.position - from.position;
    const double         squaredLength = along.GetSquaredNorm();
    ImageType::IndexType index;
    for (index[2] = first[2]; index[2] <= last[2]; ++index[2])
    {
      for (index[1] = first[1]; index[1] <= last[1]; ++index[1])
      {
        for (index[0] = first[0]; index[0] <= last[0]; ++index[0])
        {
          VectorType offset;
          for (unsigned int axis = 0; axis < 3; ++axis)
          {
            offset[axis] = m_Image.GetOrigin()[axis] + static_cast<double>(index[axis]) * m_Image.GetSpacing()[axis] -
                           from.position[axis];
          }
          const double t = squaredLength > 0.0 ? std::clamp(offset * along / squaredLength, 0.0, 1.0) : 0.0;
          const double radius = from.radius + t * (to.radius - from.radius);
          const double distance = (offset - along * t).GetNorm();
          const double filled = std::clamp((radius - distance) / (2.0 * edge) + 0.5, 0.0, 1.0);
          const double profile = 1.0 - 0.3 * std::min(1.0, distance * distance / (radius * radius));
          const double inflow = 430.0 + 210.0 * std::min(radius, 2.2);
          const auto   value = static_cast<unsigned short>(filled * profile * inflow);
          auto &       pixel = m_Image.GetPixel(index);
          pixel = std::max(pixel, value);
        }
      }
    }
  }

  ImageType & m_Image;
};

/** Grows the small arteries, which run to the surface of the brain and along it, and divide. */
class ArteryTree
{
public:
  ArteryTree(VesselPainter & painter, RandomType & random)
    : m_Painter(painter)
    , m_Random(random)
  {}

  void
  Grow(VectorType position, VectorType direction, double radius, double length, double side)
  {
    constexpr double step = 1.0;
    constexpr double thinnest = 0.36;
    Path             path;
    VectorType       bend(0.0);
    double           untilBranch = this->Uniform(8.0, 18.0);
    const double     taper = (radius - thinnest) / length;
    for (double way = 0.0; way < length && radius > thinnest; way += step)
    {
      path.push_back({ position, radius });
      bend = bend * 0.8 + this->RandomVector() * 0.07;
      const VectorType normal = brain.GetNormal(position);
      const double     depth = brain.GetDepth(position);
      const double     outward = std::max(0.0, direction * normal);
      direction += bend + normal * (depth < 0.9 ? 0.05 : -std::min(1.0, 12.0 * (depth - 0.9)) * (outward + 0.05));
      // neither hemisphere's arteries cross the midline
      direction[0] += 0.4 * side * std::max(0.0, 1.0 - side * position[0] / 2.5);
      direction.Normalize();
      position += direction * step;
      radius -= taper * step;
      untilBranch -= step;
      if (untilBranch < 0.0 && radius > 0.46)
      {
        untilBranch = this->Uniform(9.0, 20.0);
        const VectorType sideways =
          Normalize(itk::CrossProduct(direction, normal) * (this->Uniform(0.0, 1.0) < 0.5 ? -1.0 : 1.0) +
                    normal * this->Uniform(-0.3, 0.3));
        this->Grow(position,
                   Normalize(direction + sideways * this->Uniform(0.6, 1.2)),
                   radius * this->Uniform(0.65, 0.85),
                   (length - way) * this->Uniform(0.6, 0.95),
                   side);
      }
    }
    m_Painter.Paint(MakeCurve(path));
  }

  /** Grows branches all along a trunk, which goes on as one at its end. */
  void
  GrowAlong(const Path & trunk, double distance, double radius, double length, double side)
  {
    double untilBranch = 0.6 * distance;
    for (std::size_t i = 1; i < trunk.size(); ++i)
    {
      const VectorType step = trunk[i].position - trunk[i - 1].position;
      untilBranch -= step.GetNorm();
      if (untilBranch < 0.0)
      {
        untilBranch = distance * this->Uniform(0.7, 1.3);
        const VectorType direction =
          step / step.GetNorm() + brain.GetNormal(trunk[i].position) * 0.5 + this->RandomVector() * 0.8;
        this->Grow(trunk[i].position,
                   Normalize(direction),
                   radius * this->Uniform(0.8, 1.1),
                   length * this->Uniform(0.7, 1.2),
                   side);
      }
    }
    const VectorType last = trunk.back().position - trunk[trunk.size() - 3].position;
    this->Grow(trunk.back().position, Normalize(last), trunk.back().radius, length, side);
  }

private:
  double
  Uniform(double low, double high)
  {
    return m_Random.GetUniformVariate(low, high);
  }

  VectorType
  RandomVector()
  {
    VectorType vector;
    for (double & component : vector)
    {
      component = this->Uniform(-1.0, 1.0);
    }
    return vector;
  }

  VesselPainter & m_Painter;
  RandomType &    m_Random;
};

/** Nodes given for the patient's left, moved to the side asked for (1: left, -1: right). */
Path
MakeTrunk(double side, std::initializer_list<std::array<double, 4>> nodes)
{
  Path path;
  for (const auto & node : nodes)
  {
    path.push_back({ MakeVector(side * node[0], node[1], node[2]), node[3] });
  }
  return MakeCurve(path);
}

/** The right trunk of the middle cerebral artery is narrowed to 40 % of its diameter. */
void
Narrow(Path & trunk, double x)
{
  for (Node & node : trunk)
  {
    const double distance = (node.position[0] - x) / 2.2;
    node.radius *= 1.0 - 0.6 * std::exp(-0.5 * distance * distance);
  }
}

} // namespace

void
PaintArteries(ImageType & image, RandomType & random)
{
  VesselPainter painter(image);
  ArteryTree    tree(painter, random);

  for (const double side : { 1.0, -1.0 })
  {
    const double lift = side > 0.0 ? 1.5 : 0.0;
    painter.Paint(MakeTrunk(side,
                            { { 25, 10, -82, 2.6 },
                              { 27, 7, -68, 2.5 },
                              { 24, 5, -54, 2.5 },
                              { 22, 5, -45, 2.4 },
                              { 15, 1, -40, 2.4 },
                              { 10, -6, -37, 2.3 },
                              { 9, -14, -34, 2.3 },
                              { 11, -20, -28, 2.2 },
                              { 12, -18, -21, 2.1 },
                              { 12, -12, -17, 2.0 },
                              { 13, -10, -12, 1.9 } }));

    Path middle = MakeTrunk(side,
                            { { 13, -10, -12, 1.6 },
                              { 20, -12, -9 + lift, 1.5 },
                              { 28, -10, -10 + lift, 1.45 },
                              { 35, -8, -7 + lift, 1.4 } });
    if (side < 0.0)
    {
      Narrow(middle, -24.0);
    }
    painter.Paint(middle);
    const Path upper = MakeTrunk(side,
                                 { { 35, -8, -7 + lift, 1.2 },
                                   { 41, -10, 0, 1.1 },
                                   { 44, -5, 10, 1.05 },
                                   { 50, 0, 17, 1.0 },
                                   { 53, 8, 27, 0.85 } });
    const Path lower = MakeTrunk(side,
                                 { { 35, -8, -7 + lift, 1.2 },
                                   { 42, -4, -6, 1.15 },
                                   { 46, 6, 0, 1.05 },
                                   { 52, 16, 5, 1.0 },
                                   { 55, 28, 10, 0.85 } });
    const Path frontal = MakeTrunk(
      side, { { 38, -9.3, -3.5 + lift, 0.9 }, { 42, -18, 2, 0.85 }, { 46, -24, 10, 0.8 }, { 48, -26, 18, 0.7 } });
    const Path temporal =
      MakeTrunk(side, { { 27, -10, -10 + lift, 0.75 }, { 34, -14, -18, 0.7 }, { 44, -8, -22, 0.65 } });
    const Path anterior = MakeTrunk(side,
                                    { { 13, -10, -12, 1.25 },
                                      { 8, -15, -10 - lift, 1.2 },
                                      { 2.6, -19, -8, 1.2 },
                                      { 2.2, -27, -2, 1.1 },
                                      { 2.4, -36, 8, 1.1 },
                                      { 2.0, -38, 20, 1.05 },
                                      { 2.2, -30, 31, 1.0 },
                                      { 2.0, -16, 36, 0.95 },
                                      { 2.2, 0, 38, 0.85 },
                                      { 2.4, 18, 37, 0.75 } });
    const Path marginal =
      MakeTrunk(side, { { 2.0, -38, 20, 0.85 }, { 3.0, -36, 36, 0.8 }, { 3.5, -22, 46, 0.75 }, { 3.5, -4, 51, 0.65 } });
    const Path posterior = MakeTrunk(side,
                                     { { 0, 4, -14, 1.3 },
                                       { 7, 3, -12 + lift, 1.25 },
                                       { 14, 8, -13, 1.2 },
                                       { 19, 17, -11, 1.1 },
                                       { 20, 28, -8, 1.05 },
                                       { 16, 42, -5, 1.0 },
                                       { 12, 54, 0, 0.9 } });
    const Path cerebellar = MakeTrunk(
      side,
      { { 0, 5, -18, 0.85 }, { 8, 7, -18, 0.8 }, { 16, 15, -19, 0.75 }, { 20, 28, -20, 0.7 }, { 16, 42, -18, 0.6 } });
    const Path lowerCerebellar = MakeTrunk(side,
                                           { { 0.3, 9, -32, 0.65 },
                                             { 10, 13, -34, 0.6 },
                                             { 20, 18, -33, 0.6 },
                                             { 30, 28, -36, 0.5 },
                                             { 34, 40, -34, 0.4 } });
    for (const Path & trunk :
         { upper, lower, frontal, temporal, anterior, marginal, posterior, cerebellar, lowerCerebellar })
    {
      painter.Paint(trunk);
    }
    tree.GrowAlong(upper, 11.0, 0.78, 85.0, side);
    tree.GrowAlong(lower, 11.0, 0.78, 85.0, side);
    tree.GrowAlong(frontal, 14.0, 0.66, 55.0, side);
    tree.GrowAlong(temporal, 14.0, 0.62, 50.0, side);
    tree.GrowAlong(anterior, 17.0, 0.6, 50.0, side);
    tree.GrowAlong(marginal, 11.0, 0.6, 50.0, side);
    tree.GrowAlong(posterior, 11.0, 0.62, 55.0, side);
    tree.GrowAlong(cerebellar, 14.0, 0.5, 35.0, side);

    // posterior communicating, ophthalmic, vertebral, superficial temporal and meningeal arteries
    painter.Paint(MakeTrunk(
      side,
      { { 14, 8, -13, 0.4 + 0.1 * lift }, { 13.5, 0, -15, 0.4 + 0.1 * lift }, { 12, -12, -17, 0.5 + 0.1 * lift } }));
    painter.Paint(
      MakeTrunk(side, { { 12, -18, -21, 0.7 }, { 14, -28, -22, 0.65 }, { 19, -40, -23, 0.6 }, { 21, -54, -22, 0.5 } }));
    painter.Paint(MakeTrunk(side,
                            { { 18, 32, -82, 1.3 + 0.2 * lift },
                              { 19, 29, -72, 1.3 + 0.2 * lift },
                              { 24, 30, -64, 1.3 + 0.2 * lift },
                              { 18, 36, -57, 1.3 + 0.2 * lift },
                              { 9, 28, -51, 1.3 + 0.2 * lift },
                              { 4, 18, -44, 1.3 + 0.15 * lift },
                              { 0, 11, -37, 1.6 } }));
    painter.Paint(MakeTrunk(side,
                            { { 38, 6, -82, 1.2 },
                              { 48, 6, -66, 1.1 },
                              { 62, 4, -44, 0.9 },
                              { 69, 1, -22, 0.85 },
                              { 71, -6, -4, 0.75 },
                              { 69, -16, 12, 0.65 },
                              { 64, -26, 26, 0.5 } }));
    painter.Paint(
      MakeTrunk(side, { { 71, -6, -4, 0.65 }, { 71, 6, 12, 0.6 }, { 68, 14, 28, 0.55 }, { 58, 22, 44, 0.4 } }));
    painter.Paint(MakeTrunk(
      side,
      { { 42, 4, -75, 0.8 }, { 34, 0, -52, 0.7 }, { 36, -4, -36, 0.6 }, { 50, -8, -26, 0.5 }, { 60, -4, -12, 0.4 } }));
  }

  // basilar and anterior communicating arteries; the aneurysm
  painter.Paint(
    MakeTrunk(1.0, { { 0, 11, -37, 1.8 }, { 1.2, 7, -29, 1.75 }, { 0.6, 5, -21, 1.7 }, { 0, 4, -14, 1.6 } }));
  painter.Paint(MakeTrunk(1.0, { { 2.6, -19, -8, 0.8 }, { 0, -19.5, -8, 0.8 }, { -2.6, -19, -8, 0.8 } }));
  painter.PaintSphere(MakeVector(37.5, -10.5, -9.5), 3.6);
  painter.PaintSphere(MakeVector(39.5, -12.0, -11.5), 2.2);
}

double
GetTissue(const VectorType & point)
{
  static const Ellipsoid head{ MakeVector(0, 2, 4), MakeVector(75, 94, 72) };
  static const Ellipsoid neck{ MakeVector(0, 2, 4), MakeVector(75, 94, 150) };
  static const Ellipsoid leftVentricle{ MakeVector(12, 4, 14), MakeVector(6, 28, 9) };
  static const Ellipsoid rightVentricle{ MakeVector(-12, 4, 14), MakeVector(6, 28, 9) };

  // the neck is wider than an ellipsoid's lower half
  const double headDepth = (point[2] > head.center[2] ? head : neck).GetDepth(point);
  if (headDepth > 1.0)
  {
    return 0.0;
  }
  const double brainDepth = brain.GetDepth(point);
  if (brainDepth > 1.0)
  {
    const bool isBone = brainDepth > 1.02 && brainDepth < 1.10 && point[2] > -45.0;
    return isBone ? Bone : headDepth > 0.95 ? 150.0 : 125.0;
  }
  if (leftVentricle.GetDepth(point) < 1.0 || rightVentricle.GetDepth(point) < 1.0 || brainDepth > 0.965)
  {
    return 75.0;
  }
  const double fissure = std::abs(point[0]) < 0.9 ? 40.0 : 0.0;
  const double folds =
    brainDepth > 0.82 ? 18.0 * std::sin(0.55 * point[0]) * std::sin(0.5 * point[1]) * std::sin(0.6 * point[2]) : 0.0;
  return (brainDepth > 0.88 ? 165.0 : 180.0) + folds - fissure;
}

bool
IsInBrain(const VectorType & point)
{
  return brain.GetDepth(point) < 1.0;
}

ImageType::Pointer
MakeGrid(const itk::Size<3> & size)
{
  constexpr double       extent[] = { 204.8, 204.8, 153.6 };
  const auto             image = ImageType::New();
  ImageType::PointType   origin;
  ImageType::SpacingType spacing;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    spacing[axis] = extent[axis] / static_cast<double>(size[axis]);
    origin[axis] = -0.5 * static_cast<double>(size[axis] - 1) * spacing[axis];
  }
  image->SetRegions(size);
  image->SetSpacing(spacing);
  image->SetOrigin(origin);
  image->Allocate(true);
  return image;
}

ImageType::Pointer
Make(const itk::Size<3> & size)
{
  const auto image = MakeGrid(size);
  const auto random = RandomType::New();
  random->SetSeed(2002);
  PaintArteries(*image, *random);

  constexpr double noise = 9.0;
  for (itk::ImageRegionIteratorWithIndex<ImageType> pixel(image, image->GetBufferedRegion()); !pixel.IsAtEnd(); ++pixel)
  {
    VectorType point;
    for (unsigned int axis = 0; axis < 3; ++axis)
    {
      point[axis] = image->GetOrigin()[axis] + image->GetSpacing()[axis] * static_cast<double>(pixel.GetIndex()[axis]);
    }
    // the magnitude of a complex signal with normal noise, by Box and Muller's method
    const double signal = std::max(static_cast<double>(pixel.Get()), GetTissue(point));
    const double deviate = noise * std::sqrt(-2.0 * std::log(random->GetVariateWithOpenRange()));
    const double phase = itk::Math::twopi * random->GetVariateWithOpenUpperRange();
    pixel.Set(static_cast<unsigned short>(
      std::lround(std::hypot(signal + deviate * std::cos(phase), deviate * std::sin(phase)))));
  }
  return image;
}
} // namespace Phantom
