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
#ifndef Projection_h
#define Projection_h

#include "AnyImage.h"
#include "itkShearWarpMIPCineImageFilter.h"

#include <functional>
#include <limits>
#include <optional>
#include <vector>

/** Most frames of a series. */
constexpr unsigned int MostFrames =
  itk::ShearWarpMIPCineImageFilter<itk::Image<unsigned char, 3>>::MaximumNumberOfFrames;

/** One picture. */
struct Frame
{
  /** View space to physical space. */
  itk::Transform<double, 3, 3>::Pointer transform;
  double                                slabNear{ -std::numeric_limits<double>::infinity() };
  double                                slabFar{ std::numeric_limits<double>::infinity() };
  std::size_t                           time{ 0 };
  /** How far the view has turned, in degrees; not a number unless it does. */
  double angle{ std::numeric_limits<double>::quiet_NaN() };
};

struct ProjectionOptions
{
  using ModeEnum = itk::ShearWarpMIPImageFilterEnums::Mode;
  using InterpolationEnum = itk::ShearWarpMIPImageFilterEnums::Interpolation;
  using PointType = itk::Point<double, 3>;

  std::vector<Frame> frames;
  /** Of the frames in the stack. */
  double frameSpacing{ 1.0 };
  double frameOrigin{ 0.0 };
  /** Whether the stack, of one frame, lies in physical space. */
  bool                                  isInPlace{ false };
  std::optional<itk::Vector<double, 2>> spacing;
  std::optional<itk::Size<2>>           size;
  std::optional<itk::Point<double, 2>>  origin;
  /** 0 if not given, or the volume's minimum where that is less. */
  std::optional<double>                 background;
  unsigned int                          oversampling{ 1 };
  bool                                  isExact{ false };
  ModeEnum                              mode{ ModeEnum::Maximum };
  InterpolationEnum                     interpolation{ InterpolationEnum::Linear };
  std::optional<double>                 localMaximum;
  itk::Image<unsigned char, 3>::Pointer mask;
  PointType                             cropLower{ -std::numeric_limits<double>::infinity() };
  PointType                             cropUpper{ std::numeric_limits<double>::infinity() };
  double                                attenuation{ 0.0 };
  bool                                  computeDepth{ false };
};

/** What was done for frames [begin, end) of all, counted over all components, one after the other. */
struct FrameReport
{
  std::size_t begin, end, all;
  /** Of the first one. */
  unsigned int principalAxis;
  double       preparationSeconds;
  double       projectionSeconds;
  double       warpSeconds;
};

/** Gets told how many frames of how many are done. */
using ProgressFunction = std::function<void(std::size_t done, std::size_t all)>;

struct Projections
{
  /** Axes: right in the picture, down in the picture, frame. */
  AnyImage stack;
  /** Of type float and one component; no image unless it was computed. */
  AnyImage depths;
  double   background;
  /** As of the volume. */
  bool isInverted{ false };
};

/** Whether an image of at least 4096 voxels has from 3 to 32 values, all whole. */
bool
LooksLikeLabels(const AnyImage & image);

/** Whether \a value is one of that pixel type. */
bool
IsPixelValue(itk::IOComponentEnum componentType, double value);

/** The background of images of one pixel type, if none is given: 0, or their least pixel where that is less. */
double
FindBackground(const std::vector<AnyImage> & images);

/** Projects each component of \a volume for each frame, all on one grid that holds every projection: the frames of one
 * point in time and one slab together. */
Projections
ProjectFrames(const Volume &                                   volume,
              const ProjectionOptions &                        options,
              const std::function<void(const FrameReport &)> & report,
              const ProgressFunction &                         progress);

#endif
