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

#include "ScalarImage.h"
#include "itkTransform.h"

#include <functional>
#include <optional>
#include <vector>

struct ProjectionOptions
{
  /** View space to physical space, for each frame. */
  std::vector<itk::Transform<double, 3, 3>::Pointer> transforms;
  std::optional<itk::Vector<double, 2>>              spacing;
  std::optional<itk::Size<2>>                        size;
  /** 0 if not given, or the volume's minimum where that is less. */
  std::optional<double> background;
  unsigned int          oversampling{ 1 };
};

struct FrameReport
{
  std::size_t  frame;
  unsigned int principalAxis;
  double       preparationSeconds;
  double       projectionSeconds;
  double       warpSeconds;
};

struct Frames
{
  /** Axes: right in the picture, down in the picture, frame. */
  ScalarImage stack;
  double      background;
};

/** Projects \a volume once for each transform, all on one grid that holds every projection. */
Frames
ProjectFrames(const ScalarImage &                              volume,
              const ProjectionOptions &                        options,
              const std::function<void(const FrameReport &)> & report);

#endif
