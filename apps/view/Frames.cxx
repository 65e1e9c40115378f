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
#include "Frames.h"

#include "RotationAxis.h"

#include "itkShearWarpFactorization.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace
{
using TransformPointer = itk::Transform<double, 3, 3>::Pointer;
// only for its geometry
using TurnType = itk::ShearWarpMIPCineImageFilter<itk::Image<unsigned char, 3>>;

std::vector<Frame>
MakeTurn(const Options & options, const Frame & still, const itk::ImageBase<3> * grid)
{
  const auto image = TurnType::InputImageType::New();
  image->CopyInformation(grid);
  const auto turn = TurnType::New();
  turn->SetInput(image);
  turn->SetTransform(still.transform);
  turn->SetNumberOfFrames(options.frames);
  turn->SetRotationAxis(MakeAxis(options.rotationAxis, grid));
  if (!options.center.empty())
  {
    turn->SetCenter(itk::Point<double, 3>(options.center.data()));
  }
  turn->SetRocking(options.isRocking);
  turn->SetAngularRange(options.angularRange);

  const auto         angles = turn->GetFrameAngles();
  std::vector<Frame> frames(options.frames, still);
  for (unsigned int n = 0; n < options.frames; ++n)
  {
    frames[n].transform = turn->GetFrameTransform(n);
    frames[n].angle = angles[n];
  }
  return frames;
}

/** One for each elevation, one after the other. */
std::vector<Frame>
MakeTurns(const Options & options, Frame still, const itk::ImageBase<3> * grid)
{
  if (options.elevations.size() > MostFrames / options.frames)
  {
    throw std::runtime_error("--elevations: " + std::to_string(options.elevations.size()) + " turns of " +
                             std::to_string(options.frames) + " frames are too many; at most " +
                             std::to_string(MostFrames) + " frames are possible");
  }
  std::vector<Frame> frames;
  for (const double elevation : options.elevations)
  {
    still.transform =
      itk::ShearWarpMIPView::MakeTransform(grid, directions.at(options.view), options.azimuth, elevation);
    const auto turn = MakeTurn(options, still, grid);
    frames.insert(frames.end(), turn.begin(), turn.end());
  }
  return frames;
}

void
SetSlidingSlabs(ProjectionOptions & projection, const Options & options, Frame frame, const itk::ImageBase<3> * grid)
{
  const double          thickness = options.slidingSlab[0];
  const double          step = options.slidingSlab[1];
  itk::Point<double, 3> lower;
  itk::Point<double, 3> upper;
  itk::ShearWarpFactorization::VerifyViewTransform(frame.transform);
  itk::ShearWarpFactorization::ComputeViewBounds(frame.transform, grid, lower, upper);
  // up to the one that reaches the back, or begins before it
  const double more = std::max(0.0, std::ceil((upper[2] - lower[2] - std::max(thickness, step)) / step - 1e-6));
  if (!(more < MostFrames))
  {
    std::ostringstream message;
    message << "--sliding-slab: " << more + 1.0 << " slabs are too many; at most " << MostFrames << " are possible";
    throw std::runtime_error(message.str());
  }
  for (unsigned int n = 0; n <= static_cast<unsigned int>(more); ++n)
  {
    frame.slabNear = lower[2] + n * step;
    frame.slabFar = frame.slabNear + thickness;
    projection.frames.push_back(frame);
  }
  projection.frameSpacing = step;
  projection.frameOrigin = lower[2] + 0.5 * thickness;
}
} // namespace

void
SetFrames(ProjectionOptions &                   projection,
          const Options &                       options,
          const std::vector<TransformPointer> & given,
          const Volume &                        volume)
{
  const itk::ImageBase<3> * grid = volume.times.front().image;
  Frame                     still;
  if (given.empty())
  {
    still.transform =
      itk::ShearWarpMIPView::MakeTransform(grid, directions.at(options.view), options.azimuth, options.elevation);
  }
  else
  {
    still.transform = given.front();
  }
  if (!options.slab.empty())
  {
    still.slabNear = options.slab[0];
    still.slabFar = options.slab[1];
  }

  if (options.frames > 0)
  {
    projection.frames = options.elevations.empty() ? MakeTurn(options, still, grid) : MakeTurns(options, still, grid);
  }
  else if (!options.slidingSlab.empty())
  {
    SetSlidingSlabs(projection, options, still, grid);
  }
  else if (given.size() > 1)
  {
    projection.frames.resize(given.size(), still);
    for (std::size_t n = 0; n < given.size(); ++n)
    {
      projection.frames[n].transform = given[n];
    }
  }
  else
  {
    projection.frames.resize(volume.times.size(), still);
    for (std::size_t time = 0; time < volume.times.size(); ++time)
    {
      projection.frames[time].time = time;
    }
    projection.frameSpacing = volume.timeSpacing;
    projection.frameOrigin = volume.timeOrigin;
  }
}
