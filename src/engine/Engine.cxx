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
#include "itkShearWarpEngine.h"

#include "Exact.h"
#include "kernels/PixelTypes.h"
#include "PreparedVolume.h"
#include "Projector.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <ostream>
#include <stdexcept>
#include <unordered_map>

namespace itk
{
std::ostream &
operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::Mode value)
{
  static constexpr const char * names[] = { "Maximum", "Minimum", "AbsoluteMaximum" };
  const auto                    index = static_cast<unsigned int>(value);
  return out << "itk::ShearWarpMIPImageFilterEnums::Mode::" << (index < 3 ? names[index] : "INVALID VALUE");
}

std::ostream &
operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::ReducedResampling value)
{
  static constexpr const char * names[] = { "Off", "On", "Auto" };
  const auto                    index = static_cast<unsigned int>(value);
  return out << "itk::ShearWarpMIPImageFilterEnums::ReducedResampling::"
             << (index < 3 ? names[index] : "INVALID VALUE");
}

namespace ShearWarp
{
SizeValueType
CountSlabs(SliceRange slices, SizeValueType wanted)
{
  return std::clamp<SizeValueType>(wanted, 1, std::max<std::ptrdiff_t>(CountBlocks(slices.end - slices.begin), 1));
}

SliceRange
GetSlab(SliceRange slices, SizeValueType n, SizeValueType slabs)
{
  const SizeValueType blocks = CountBlocks(slices.end - slices.begin);
  const auto          getEnd = [=](SizeValueType count) {
    return std::min(slices.begin + static_cast<std::ptrdiff_t>(count * blocks / slabs) * BlockLength, slices.end);
  };
  return { getEnd(n), getEnd(n + 1) };
}

template <typename TPixel>
bool
ProjectionRule<TPixel>::IsPlainMaximum() const
{
  return mode == ShearWarpMIPImageFilterEnums::Mode::Maximum && !this->HasRegion() && !localMaximumThreshold &&
         !(depthAttenuation > 0.0) && !hasDepth && !isExact;
}

template <typename TPixel>
bool
ProjectionRule<TPixel>::HasRegion() const
{
  bool hasRegion = slabNear != -Infinity || slabFar != Infinity;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    hasRegion = hasRegion || cropLower[axis] != -Infinity || cropUpper[axis] != Infinity;
  }
  return hasRegion;
}

template <typename TPixel>
void
ProjectionRule<TPixel>::Verify() const
{
  if (!(slabNear <= slabFar && slabNear < Infinity && slabFar > -Infinity))
  {
    itkGenericExceptionMacro("SlabNear must be less than infinity and not greater than SlabFar, but they are "
                             << slabNear << " and " << slabFar << '.');
  }
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    if (!(cropLower[axis] <= cropUpper[axis]))
    {
      itkGenericExceptionMacro("CropLower must not be greater than CropUpper, but they are " << cropLower << " and "
                                                                                             << cropUpper << '.');
    }
  }
  if (!(depthAttenuation >= 0.0 && std::isfinite(depthAttenuation)))
  {
    itkGenericExceptionMacro("DepthAttenuation must be finite and not negative, but it is " << depthAttenuation << '.');
  }
  if (depthAttenuation > 0.0 && !std::isfinite(static_cast<double>(background)))
  {
    itkGenericExceptionMacro("DefaultPixelValue must be finite where samples fade to it, but it is " << background
                                                                                                     << '.');
  }
  if (localMaximumThreshold && *localMaximumThreshold != *localMaximumThreshold)
  {
    itkGenericExceptionMacro("LocalMaximumThreshold must be a number, but it is " << *localMaximumThreshold << '.');
  }
}
} // namespace ShearWarp

namespace
{
using ReducedResamplingEnum = ShearWarpMIPImageFilterEnums::ReducedResampling;
using ModeEnum = ShearWarpMIPImageFilterEnums::Mode;
using Clock = std::chrono::steady_clock;
using ShearWarp::Parallelize;
using ShearWarp::Threads;

constexpr SizeValueType MostViewsTogether = 256;

/** How far beyond the limits of a slab or a box samples count, in extents of a voxel: more than rounding errors. */
constexpr double LimitTolerance = 1e-9;

struct View
{
  ShearWarp::ViewSpace   space;
  ShearWarpFactorization factorization;
  SizeValueType          number;
};

/** The numbers of views with the same intermediate image. */
using Projection = std::vector<SizeValueType>;

/** What is projected together. */
struct Group
{
  unsigned int            axis;
  std::vector<Projection> projections;
};

using FactorizeFunction = std::function<std::shared_ptr<const View>(SizeValueType)>;

double
SecondsSince(Clock::time_point start)
{
  return std::chrono::duration<double>(Clock::now() - start).count();
}

Parallelize
TakeShare(const Threads & threads, float share)
{
  return [&threads, share](SizeValueType count, SizeValueType steps, const ShearWarp::Task & task) {
    threads.run(count, steps, share, task);
  };
}

template <typename TPixel>
std::vector<ShearWarp::Interval>
MakeIntervals(const View & view, const ShearWarp::ProjectionRule<TPixel> & rule)
{
  std::vector<ShearWarp::Interval> intervals;
  const auto &                     shear = view.factorization.GetShear();
  const auto addInterval = [&](const ShearWarp::ShearedFunction & function, double low, double high) {
    if (low != -rule.Infinity || high != rule.Infinity)
    {
      const double alongSlices = (function.perSlice + function.perColumn * shear[0]) + function.perRow * shear[1];
      const double extent = (std::abs(function.perColumn) + std::abs(function.perRow)) + std::abs(alongSlices);
      const double tolerance = LimitTolerance * extent;
      intervals.push_back({ function, low - tolerance, high + tolerance });
    }
  };
  addInterval(view.factorization.GetDepthFunction(), rule.slabNear, rule.slabFar);
  const auto & [axes, offset] = view.space;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const double position[] = { axes(axis, 0), axes(axis, 1), axes(axis, 2), offset[axis] };
    addInterval(
      view.factorization.GetShearedFunction(Vector<double, 4>(position)), rule.cropLower[axis], rule.cropUpper[axis]);
  }
  return intervals;
}

template <typename TPixel>
std::optional<ShearWarp::Fading>
MakeFading(const View & view, const ShearWarp::ProjectionRule<TPixel> & rule, const ImageBase<3> * image)
{
  if (!(rule.depthAttenuation > 0.0))
  {
    return {};
  }
  return ShearWarp::Fading{ rule.depthAttenuation,
                            std::max(ShearWarp::FindSphereDepth(view.space, image), rule.slabNear) };
}

/** For a number that tells most views apart: of the places of the first slice and the last one. */
SizeValueType
HashPlacements(const std::vector<ShearWarp::SlicePlacement> & placements)
{
  SizeValueType hash = 0;
  for (const auto & place : { placements.front(), placements.back() })
  {
    for (const std::int32_t part : { place.column.whole, place.column.fraction, place.row.whole, place.row.fraction })
    {
      hash = hash * 1000003 + static_cast<SizeValueType>(part);
    }
  }
  return hash;
}
} // namespace

template <typename TPixel>
class ShearWarpEngine<TPixel>::Implementation
{
public:
  using Kernels = ShearWarp::Kernels<TPixel>;
  using IntermediateImage = ShearWarp::IntermediateImage<TPixel>;
  using Projector = ShearWarpProjector<TPixel>;

  explicit Implementation(ShearWarp::Measurements & measurementsOfEngine)
    : measurements(measurementsOfEngine)
  {}

  /** Chooses the kernels, and forgets the last update's measurements. */
  void
  Begin(const ShearWarpFactorization & first)
  {
    try
    {
      kernels = &ShearWarp::GetKernels<TPixel>();
      kernelsOfMask = &ShearWarp::GetKernels<unsigned char>();
    }
    catch (const std::invalid_argument & error)
    {
      itkGenericExceptionMacro(<< error.what());
    }
    measurements = {};
    measurements.principalAxis = first.GetPrincipalAxis();
    measurements.instructionSet = kernels->instructionSet;
  }

  /** Whether the order of samples matters: to the first local maximum, and where slices are more than ranks tell. */
  static bool
  IsOrdered(const VolumeType & input, const RuleType & rule)
  {
    const auto size = input.whole.GetSize();
    const auto mostSlices = static_cast<SizeValueType>(Projector::MostRankedSlices);
    return rule.localMaximumThreshold ||
           (NeedsSlices(input, rule) && std::max({ size[0], size[1], size[2] }) > mostSlices);
  }

  /** Whether intermediate images tell the slices of their pixels: of depths, and of masks, where a pixel may have none;
   * and of what fades and of local maxima, as they are projected by the same loops; and where exact maxima begin. */
  static bool
  NeedsSlices(const VolumeType & input, const RuleType & rule)
  {
    return rule.hasDepth || input.mask || rule.depthAttenuation > 0.0 || rule.localMaximumThreshold || rule.isExact;
  }

  static std::vector<Group>
  MakeGroups(const VolumeType &        input,
             SizeValueType             count,
             const FactorizeFunction & factorize,
             const RuleType &          rule,
             SizeValueType             memoryOfThread);

  void
  ProjectGroup(const VolumeType &                                                   input,
               const Group &                                                        group,
               const FactorizeFunction &                                            factorize,
               const RuleType &                                                     rule,
               float                                                                viewShare,
               const std::function<void(const IntermediateImage &, const View &)> & warp,
               const Threads &                                                      threads);

  /** What is prepared of a volume slab by slab. */
  struct Slabs
  {
    ShearWarpPreparedVolume<TPixel>        volume;
    ShearWarpPreparedVolume<unsigned char> mask{ true };
  };

  /** How a volume is projected along an axis. */
  struct Pass
  {
    unsigned int axis;
    bool         isFirstSlabFirst;
    bool         hasBlockExtrema, hasBlocksOfMask;
    bool         isKept; // a transposed copy
    float        share;  // of the progress
  };

  /** Prepares the volume and the mask and has \a project(volume, mask, parallelize) project them, slab by slab; \a mask
   * is null if there is none. */
  template <typename TFunction>
  void
  ProjectSlabs(const VolumeType & input,
               const Pass &       pass,
               Slabs &            slabs,
               const TFunction &  project,
               const Threads &    threads);

  void
  Warp(const IntermediateImage &      intermediate,
       const ShearWarpFactorization & factorization,
       const Size<2> &                size,
       TPixel                         background,
       const PictureType &            picture,
       const Parallelize &            parallelize);

  /** The picture of exact maxima; \a guess is the intermediate image of their view. */
  void
  ProjectExactly(const IntermediateImage & guess,
                 const View &              view,
                 const RuleType &          rule,
                 const Size<2> &           size,
                 const PictureType &       picture,
                 const Threads &           threads,
                 float                     share);

  ShearWarpPreparedVolume<TPixel>           volume;
  ShearWarpPreparedVolume<unsigned char>    mask{ true };
  Slabs                                     slabsOfParts; // a part's next view has their memory
  Projector                                 projector;
  const Kernels *                           kernels{ nullptr };
  const ShearWarp::Kernels<unsigned char> * kernelsOfMask{ nullptr };
  ShearWarp::Measurements &                 measurements;
};

template <typename TPixel>
std::vector<Group>
ShearWarpEngine<TPixel>::Implementation::MakeGroups(const VolumeType &        input,
                                                    SizeValueType             count,
                                                    const FactorizeFunction & factorize,
                                                    const RuleType &          rule,
                                                    SizeValueType             memoryOfThread)
{
  const bool                                          isOneByOne = IsOrdered(input, rule);
  std::vector<Projection>                             projections[3];
  Size<2>                                             largest[3]{};
  unsigned int                                        oversampling = 1;
  std::unordered_multimap<SizeValueType, std::size_t> candidates[3];
  for (SizeValueType number = 0; number < count; ++number)
  {
    const auto         view = factorize(number);
    const unsigned int axis = view->factorization.GetPrincipalAxis();
    const Size<2>      size = view->factorization.GetIntermediateSize();
    largest[axis] = { { std::max(largest[axis][0], size[0]), std::max(largest[axis][1], size[1]) } };
    oversampling = view->factorization.GetOversampling();

    const SizeValueType hash = HashPlacements(view->factorization.GetSlicePlacements());
    const auto [begin, end] = candidates[axis].equal_range(hash);
    const bool isAlone = isOneByOne || rule.HasRegion() || rule.hasDepth || rule.depthAttenuation > 0.0;
    const auto same = isAlone ? end : std::find_if(begin, end, [&](const auto & candidate) {
      const Projection & projection = projections[axis][candidate.second];
      return factorize(projection.front())->factorization.HasSameSlicePlacements(view->factorization);
    });
    if (same != end)
    {
      projections[axis][same->second].push_back(number);
      continue;
    }
    candidates[axis].emplace(hash, projections[axis].size());
    projections[axis].push_back({ number });
  }

  std::vector<Group> groups;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    // as few groups as there is room for, of equal size; more views would save nothing
    const SizeValueType bytes = Projector::GetImageSizeInBytes(
      largest[axis], oversampling, rule.mode, rule.HasRegion(), NeedsSlices(input, rule));
    const SizeValueType room = memoryOfThread / std::max<SizeValueType>(bytes, 1);
    const SizeValueType most = isOneByOne ? 1 : std::clamp<SizeValueType>(room, 1, MostViewsTogether);
    const SizeValueType total = projections[axis].size();
    const SizeValueType groupsOfAxis = (total + most - 1) / most;
    const auto          first = std::make_move_iterator(projections[axis].begin());
    for (SizeValueType n = 0; n < groupsOfAxis; ++n)
    {
      groups.push_back({ axis, { first + n * total / groupsOfAxis, first + (n + 1) * total / groupsOfAxis } });
    }
  }
  return groups;
}

template <typename TPixel>
template <typename TFunction>
void
ShearWarpEngine<TPixel>::Implementation::ProjectSlabs(const VolumeType & input,
                                                      const Pass &       pass,
                                                      Slabs &            slabs,
                                                      const TFunction &  project,
                                                      const Threads &    threads)
{
  using ShearWarp::BlockLength;
  const auto *                image = input.image;
  const bool                  isStreamed = input.streamDivisions > 1;
  const bool                  isWhole = !isStreamed && (pass.isKept || pass.axis != 0);
  const ImageRegion<3> &      present = isStreamed ? input.whole : image->GetBufferedRegion();
  const auto                  first = present.GetIndex(2) - input.whole.GetIndex(2);
  const ShearWarp::SliceRange slices{ first, first + static_cast<std::ptrdiff_t>(present.GetSize(2)) };
  // slabs that are transposed stay in the cache
  constexpr std::ptrdiff_t slabBytes = 1 << 21;
  const auto               sliceBytes =
    static_cast<std::ptrdiff_t>(std::max<SizeValueType>(present.GetSize(0) * present.GetSize(1), 1) * sizeof(TPixel));
  const std::ptrdiff_t slabLength =
    std::max(slabBytes / sliceBytes, 2 * BlockLength) * static_cast<std::ptrdiff_t>(threads.count);
  const SizeValueType count =
    isStreamed ? input.streamDivisions
    : isWhole  ? 1
               : std::max<SizeValueType>(ShearWarp::CountBlocks(slices.end - slices.begin, slabLength), 1);

  const bool  findsMaxima = pass.hasBlockExtrema && !(isWhole && volume.IsPrepared(image, 2));
  const bool  transposes = pass.axis == 0 && !(isWhole && volume.IsPrepared(image, 0, false));
  const bool  transposesMask = input.mask && pass.axis == 0 && !(isWhole && mask.IsPrepared(input.mask, 0, false));
  const bool  findsBlocksOfMask = pass.hasBlocksOfMask && !(isWhole && mask.IsPrepared(input.mask, 2));
  const int   preparations = findsMaxima + transposes + transposesMask + findsBlocksOfMask;
  const float preparationShare = pass.share * (input.mask ? 0.1f : 0.2f) / static_cast<float>(count);
  const float projectionShare =
    pass.share * 0.85f / static_cast<float>(count) - preparationShare * static_cast<float>(preparations);
  const Parallelize prepareInParallel = TakeShare(threads, preparationShare);
  if (isStreamed)
  {
    volume.Release();
    mask.Release();
  }
  else
  {
    volume.SetImage(image, input.whole);
  }
  if (isWhole)
  {
    slabs.volume.Release();
    slabs.mask.Release();
  }
  for (SizeValueType n = 0; n < count; ++n)
  {
    const auto slab = ShearWarp::GetSlab(slices, pass.isFirstSlabFirst ? n : count - 1 - n, count);
    input.load(slab);
    const auto start = Clock::now();
    const auto prepare =
      [&](const auto * of, auto & whole, auto & part, bool hasBlockExtrema, const auto & kernelsOf) -> const auto & {
      if (isWhole)
      {
        whole.Prepare(of, input.whole, pass.axis, hasBlockExtrema, kernelsOf, prepareInParallel);
        return whole;
      }
      part.PreparePart(of, input.whole, slab.begin, slab.end, pass.axis, hasBlockExtrema, kernelsOf, prepareInParallel);
      return part;
    };
    const auto & prepared = prepare(image, volume, slabs.volume, pass.hasBlockExtrema, *kernels);
    const ShearWarpPreparedVolume<unsigned char> * preparedMask = nullptr;
    if (input.mask)
    {
      preparedMask = &prepare(input.mask, mask, slabs.mask, pass.hasBlocksOfMask, *kernelsOfMask);
    }
    measurements.preparationSeconds += preparations > 0 ? SecondsSince(start) : 0.0;

    const auto projectionStart = Clock::now();
    project(prepared, preparedMask, TakeShare(threads, projectionShare));
    measurements.projectionSeconds += SecondsSince(projectionStart);
  }
  if (!isStreamed)
  {
    volume.AddProjectedAxis(pass.axis);
  }
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::ProjectGroup(
  const VolumeType &                                                   input,
  const Group &                                                        group,
  const FactorizeFunction &                                            factorize,
  const RuleType &                                                     rule,
  float                                                                viewShare,
  const std::function<void(const IntermediateImage &, const View &)> & warp,
  const Threads &                                                      threads)
{
  std::vector<std::shared_ptr<const View>> firsts;
  SizeValueType                            count = 0;
  for (const Projection & projection : group.projections)
  {
    count += projection.size();
    firsts.push_back(factorize(projection.front()));
  }
  const float share = viewShare * static_cast<float>(count) * (rule.isExact ? 0.15f : 1.0f);
  const auto  finish = [&](const auto & finishProjection) {
    for (std::size_t n = 0; n < firsts.size(); ++n)
    {
      const Projection & projection = group.projections[n];
      const auto         start = Clock::now();
      const float        mergeShare = 0.05f * viewShare * static_cast<float>(projection.size());
      const auto         intermediate = finishProjection(n, TakeShare(threads, mergeShare));
      measurements.projectionSeconds += SecondsSince(start);
      for (const SizeValueType number : projection)
      {
        warp(intermediate, *factorize(number));
      }
    }
  };

  Slabs slabs;
  // what serves further views is made when they come
  const unsigned int projectedAxes = volume.GetProjectedAxes(input.image);
  const bool         isKept = rule.isExact || (projectedAxes >> group.axis & 1U) != 0;
  const bool         isOrdered = IsOrdered(input, rule);
  const bool         hasBlockExtrema =
    rule.isExact ||
    (rule.IsPlainMaximum() && !input.mask &&
     (rule.reducedResampling == ReducedResamplingEnum::On || group.projections.size() > 1 || projectedAxes != 0));
  if (rule.isExact && rule.mode != ModeEnum::Maximum)
  {
    volume.KeepBlockMinima();
  }
  typename Projector::ViewList views;
  for (const auto & first : firsts)
  {
    views.push_back({ &first->factorization, MakeIntervals(*first, rule), MakeFading(*first, rule, input.image) });
  }
  typename Projector::Parameters parameters;
  parameters.mode = rule.mode;
  parameters.hasSlices = NeedsSlices(input, rule);
  parameters.isOrdered = isOrdered;
  parameters.background = rule.background;
  parameters.maskLabel = rule.maskLabel;
  parameters.reducedResampling = rule.reducedResampling;
  parameters.localThreshold = rule.localMaximumThreshold;
  projector.Start(views, *kernels, parameters, threads.count);
  const auto project = [this](const auto & ofVolume, const auto * ofMask, const Parallelize & parallelize) {
    projector.Project(ofVolume, ofMask, parallelize);
  };
  const bool isFirstSlabFirst = !isOrdered || Projector::IsFirstSlabFront(firsts.front()->factorization);
  const Pass pass{ group.axis, isFirstSlabFirst, hasBlockExtrema, input.mask != nullptr, isKept, share };
  this->ProjectSlabs(input, pass, slabs, project, threads);
  // shares may sum to a little more than 1
  measurements.skippedFraction = std::min(measurements.skippedFraction + projector.GetSkippedFraction() * share, 1.0);
  finish([this](std::size_t n, const Parallelize & parallelize) { return projector.Finish(n, parallelize); });
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::Warp(const IntermediateImage &      intermediate,
                                              const ShearWarpFactorization & factorization,
                                              const Size<2> &                size,
                                              TPixel                         background,
                                              const PictureType &            picture,
                                              const Parallelize &            parallelize)
{
  const auto                   start = Clock::now();
  const auto                   map = factorization.GetOutputToIntermediateMatrix();
  const ShearWarp::AffineMap2D outputToIntermediate{ map(0, 0), map(0, 1), map(0, 2), map(1, 0), map(1, 1), map(1, 2) };
  const auto                   depth = factorization.GetDepthFunction();
  constexpr SizeValueType      band = 16;
  parallelize((size[1] + band - 1) / band, 1, [&](SizeValueType n, SizeValueType, SizeValueType) {
    for (SizeValueType row = n * band; row < std::min((n + 1) * band, size[1]); ++row)
    {
      kernels->warpRow(intermediate, outputToIntermediate, row, 0, size[0], background, picture.pixels + row * size[0]);
      if (picture.depths)
      {
        ShearWarp::FindDepths(intermediate,
                              outputToIntermediate,
                              factorization.GetOversampling(),
                              depth,
                              row,
                              size[0],
                              picture.depths + row * size[0]);
      }
    }
  });
  measurements.warpSeconds += SecondsSince(start);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::ProjectExactly(const IntermediateImage & guess,
                                                        const View &              view,
                                                        const RuleType &          rule,
                                                        const Size<2> &           size,
                                                        const PictureType &       picture,
                                                        const Threads &           threads,
                                                        float                     share)
{
  const auto                   start = Clock::now();
  const auto &                 factorization = view.factorization;
  const unsigned int           axis = factorization.GetPrincipalAxis();
  const auto                   map = factorization.GetOutputToIntermediateMatrix();
  ShearWarp::ExactView<TPixel> exact;
  exact.slices = volume.GetSlices(axis);
  exact.blocks = volume.GetBlockExtrema(axis);
  for (unsigned int n = 0; n < 2; ++n)
  {
    exact.shear[n] = factorization.GetShear()[n];
    exact.translation[n] = factorization.GetTranslation()[n];
  }
  exact.outputToSheared = { map(0, 0), map(0, 1), map(0, 2), map(1, 0), map(1, 1), map(1, 2) };
  exact.intervals = MakeIntervals(view, rule);
  exact.depth = factorization.GetDepthFunction();
  exact.extremum = Projector::FindExtremum(rule.mode);
  exact.background = rule.background;
  ShearWarp::ProjectExactly(exact, *kernels, guess, size[0], size[1], picture, threads, share);
  measurements.warpSeconds += SecondsSince(start);
}

template <typename TPixel>
ShearWarpEngine<TPixel>::ShearWarpEngine()
  : m_Implementation(std::make_unique<Implementation>(m_Measurements))
{}

template <typename TPixel>
ShearWarpEngine<TPixel>::~ShearWarpEngine() = default;

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Project(const VolumeType &                                volume,
                                 const ShearWarp::ViewList &                       views,
                                 const ImageBase<2> *                              grid,
                                 unsigned int                                      oversampling,
                                 const RuleType &                                  rule,
                                 SizeValueType                                     intermediateMemory,
                                 const std::function<PictureType(SizeValueType)> & getPicture,
                                 const ShearWarp::Threads &                        threads)
{
  std::vector<std::shared_ptr<const View>> lastViews(MostViewsTogether);
  const FactorizeFunction                  factorize = [&](SizeValueType number) {
    auto & view = lastViews[number % MostViewsTogether];
    if (!view || view->number != number)
    {
      const auto space = views.get(number);
      view = std::make_shared<const View>(View{ space, { space, volume.image, grid, oversampling }, number });
    }
    return view;
  };
  m_Implementation->Begin(factorize(0)->factorization);
  const float viewShare = 1.0f / static_cast<float>(views.count);
  const auto  warp = [&](const auto & intermediate, const View & view) {
    const Size<2> size = grid->GetLargestPossibleRegion().GetSize();
    if (rule.isExact)
    {
      m_Implementation->ProjectExactly(
        intermediate, view, rule, size, getPicture(view.number), threads, 0.8f * viewShare);
      return;
    }
    m_Implementation->Warp(intermediate,
                           view.factorization,
                           size,
                           rule.background,
                           getPicture(view.number),
                           TakeShare(threads, 0.09f * viewShare));
  };
  const SizeValueType memoryOfThread = intermediateMemory / threads.count;
  for (const Group & group : Implementation::MakeGroups(volume, views.count, factorize, rule, memoryOfThread))
  {
    m_Implementation->ProjectGroup(volume, group, factorize, rule, viewShare, warp, threads);
  }
  if (volume.streamDivisions > 1)
  {
    this->Release();
  }
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::ProjectPart(const VolumeType &                volume,
                                     const ShearWarpFactorization &    factorization,
                                     ReducedResamplingEnum             reducedResampling,
                                     const std::function<TPixel *()> & getPixels,
                                     const ShearWarp::Threads &        threads)
{
  Implementation & engine = *m_Implementation;
  engine.Begin(factorization);
  const unsigned int axis = factorization.GetPrincipalAxis();
  const bool         hasBlockExtrema = reducedResampling != ReducedResamplingEnum::Off;
  const bool         isKept = hasBlockExtrema || engine.volume.IsPrepared(volume.image, axis, false);
  typename Implementation::Projector::Parameters parameters;
  parameters.reducedResampling = reducedResampling;
  engine.projector.Start({ { &factorization, {} } }, *engine.kernels, parameters, threads.count);
  const auto project = [&](const auto & prepared, const auto *, const Parallelize & parallelize) {
    engine.projector.Project(prepared, nullptr, parallelize);
  };
  const typename Implementation::Pass pass{ axis, true, hasBlockExtrema, false, isKept, 1.0f };
  engine.ProjectSlabs(volume, pass, engine.slabsOfParts, project, threads);
  engine.measurements.skippedFraction = engine.projector.GetSkippedFraction();

  const auto start = Clock::now();
  const auto part = engine.projector.Finish(0, TakeShare(threads, 0.05f));
  TPixel *   output = getPixels();
  for (std::ptrdiff_t row = 0; row < part.rows; ++row)
  {
    const TPixel *              pixels = part.pixels + row * part.rowStride;
    const ShearWarp::ColumnSpan reached = part.reached[row];
    std::fill(output, output + part.columns, ShearWarp::NoSample<TPixel>);
    std::copy(pixels + reached.begin, pixels + reached.end, output + reached.begin);
    output += part.columns;
  }
  engine.measurements.projectionSeconds += SecondsSince(start);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::WarpParts(const std::vector<PartType> &     parts,
                                   const ShearWarpFactorization &    factorization,
                                   const ImageBase<2> *              grid,
                                   TPixel                            background,
                                   const std::function<TPixel *()> & getPixels,
                                   const ShearWarp::Threads &        threads)
{
  Implementation & engine = *m_Implementation;
  engine.Begin(factorization);
  const auto      start = Clock::now();
  const auto      columns = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[0]);
  const auto      rows = static_cast<std::ptrdiff_t>(factorization.GetIntermediateSize()[1]);
  ShearWarpBuffer memory;
  memory.Reserve(columns * rows * sizeof(TPixel), "the intermediate image");
  auto * const             pixels = memory.template GetPointer<TPixel>();
  constexpr std::ptrdiff_t band = 16;
  threads.run(ShearWarp::CountBlocks(rows, band), 1, 0.9f, [&](SizeValueType n, SizeValueType, SizeValueType) {
    const auto begin = static_cast<std::ptrdiff_t>(n) * band;
    const auto end = std::min(begin + band, rows);
    std::fill(pixels + begin * columns, pixels + end * columns, ShearWarp::NoSample<TPixel>);
    for (const auto & [partPixels, region] : parts)
    {
      const auto width = static_cast<std::ptrdiff_t>(region.GetSize(0));
      const auto lastRow = region.GetIndex(1) + static_cast<std::ptrdiff_t>(region.GetSize(1));
      for (auto row = std::max(begin, region.GetIndex(1)); row < std::min(end, lastRow); ++row)
      {
        const TPixel * from = partPixels + (row - region.GetIndex(1)) * width;
        TPixel *       to = pixels + row * columns + region.GetIndex(0);
        std::transform(from, from + width, to, to, [](TPixel a, TPixel b) { return a > b ? a : b; });
      }
    }
  });
  engine.measurements.projectionSeconds = SecondsSince(start);
  engine.Warp({ pixels, columns, rows, columns, factorization.GetReachedColumns().data() },
              factorization,
              grid->GetLargestPossibleRegion().GetSize(),
              background,
              { getPixels(), nullptr },
              TakeShare(threads, 0.09f));
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Release()
{
  m_Implementation = std::make_unique<Implementation>(m_Measurements);
}

template <typename TPixel>
SizeValueType
ShearWarpEngine<TPixel>::GetPreparedSizeInBytes() const
{
  return m_Implementation->volume.GetSizeInBytes() + m_Implementation->slabsOfParts.volume.GetSizeInBytes();
}

template <typename TPixel>
SizeValueType
ShearWarpEngine<TPixel>::GetSizeInBytes() const
{
  const Implementation & engine = *m_Implementation;
  return engine.volume.GetSizeInBytes() + engine.slabsOfParts.volume.GetSizeInBytes() + engine.mask.GetSizeInBytes() +
         engine.projector.GetSizeInBytes();
}

#define INSTANTIATE(TPixel)                          \
  template struct ShearWarp::ProjectionRule<TPixel>; \
  template class ShearWarpEngine<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk
