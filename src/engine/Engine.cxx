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
#include "PartRecords.h"
#include "Projector.h"
#include "Values.h"
#include "kernels/PixelTypes.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <unordered_map>

namespace itk
{
namespace
{
using namespace ShearWarp;
using Clock = std::chrono::steady_clock;

constexpr std::size_t MostViewsTogether = 256;

/** How far beyond the limits of a slab or a box samples count, in extents of a voxel: more than rounding errors. */
constexpr double LimitTolerance = 1e-9;

/** The numbers of views with the same intermediate image, such as views from opposite sides. */
using Projection = std::vector<std::size_t>;

/** What is projected while the volume is read once. */
struct Pass
{
  unsigned int            axis;
  std::vector<Projection> projections;
};

double
SecondsSince(Clock::time_point start)
{
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/** Returns a number that tells most views apart, by the places of the first slice and the last one. */
std::size_t
HashPlacements(const std::vector<SlicePlacement> & placements)
{
  std::size_t hash = 0;
  for (const auto & place : { placements.front(), placements.back() })
  {
    for (const std::int32_t part : { place.column.whole, place.column.fraction, place.row.whole, place.row.fraction })
    {
      hash = hash * 1000003 + static_cast<std::size_t>(part);
    }
  }
  return hash;
}

bool
AreEqual(const std::vector<SlicePlacement> & a, const std::vector<SlicePlacement> & b)
{
  const auto areSame = [](const SamplingPosition & x, const SamplingPosition & y) {
    return x.whole == y.whole && x.fraction == y.fraction;
  };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [&](const SlicePlacement & x, const SlicePlacement & y) {
    return areSame(x.column, y.column) && areSame(x.row, y.row);
  });
}

template <typename TPixel>
Factorization
FactorizeForRule(const Scene & scene, const ProjectionRule<TPixel> & rule, std::size_t view)
{
  Factorization factorization = Factorize(scene.views[view], scene.volume, rule.oversampling);
  factorization.isNearest = rule.interpolation == Interpolation::Nearest;
  return factorization;
}

/** Returns whether the first slab along z is nearer to the viewer than the last one. */
bool
IsFirstSlabFront(const Factorization & factorization)
{
  const bool isFirstSliceNearest = GetDepthFunction(factorization).perSlice > 0;
  // along other axes, rows are along z, and a ray goes through them against the shear
  return factorization.GetPrincipalAxis() == 2 ? isFirstSliceNearest
                                               : isFirstSliceNearest == (factorization.shear[1] < 0);
}

/** Returns the ranks of all slices. */
Ranking
GetRanking(const Factorization & factorization)
{
  const auto last = static_cast<std::int32_t>(factorization.size[2] - 1);
  return GetDepthFunction(factorization).perSlice > 0 ? Ranking{ 0, 1 } : Ranking{ last, -1 };
}

/** Returns whether a part has one voxel along an axis. Its neighbours then have that voxel too, and its samples. */
bool
IsThin(const VoxelBox & box, const VolumeGrid & volume)
{
  bool isThin = false;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    isThin = isThin || (box.size[axis] == 1 && volume.size[axis] > 1);
  }
  return isThin;
}

/** Merges the records of a row of \a region. */
template <typename TPixel>
void
MergeRow(const PartRecords<TPixel> &           records,
         const std::vector<IntermediatePart> & parts,
         const IntermediateRegion &            region,
         std::ptrdiff_t                        row,
         unsigned char *                       merged)
{
  const auto size = static_cast<std::ptrdiff_t>(records.GetSize());
  records.Clear(merged, region.columns);
  for (const auto & [ofPart, part] : parts)
  {
    const std::ptrdiff_t rowOfPart = region.row + row - part.row;
    if (rowOfPart >= 0 && rowOfPart < part.rows)
    {
      const unsigned char * from = ofPart + rowOfPart * part.columns * size;
      records.Merge(from, merged + (part.column - region.column) * size, part.columns);
    }
  }
}

/** Returns the intervals of a view: the slab and the box, as functions of sheared column, row and slice. */
template <typename TPixel>
std::vector<Interval>
MakeIntervals(const AffineMap3D & view, const Factorization & factorization, const ProjectionRule<TPixel> & rule)
{
  std::vector<Interval> intervals;
  const auto            addInterval = [&](const ShearedFunction & function, double low, double high) {
    if (low != -rule.Infinity || high != rule.Infinity)
    {
      const double alongSlices =
        (function.perSlice + function.perColumn * factorization.shear[0]) + function.perRow * factorization.shear[1];
      const double extent = (std::abs(function.perColumn) + std::abs(function.perRow)) + std::abs(alongSlices);
      const double tolerance = LimitTolerance * extent;
      intervals.push_back({ function, low - tolerance, high + tolerance });
    }
  };
  addInterval(GetDepthFunction(factorization), rule.slabNear, rule.slabFar);
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    const auto & row = view.matrix[axis];
    addInterval(GetShearedFunction(factorization, { row[0], row[1], row[2], view.offset[axis] }),
                rule.cropLower[axis],
                rule.cropUpper[axis]);
  }
  return intervals;
}

/** Returns the columns of each row of an oversampled image that its phases reach. */
std::vector<ColumnSpan>
JoinReached(const std::vector<IntermediateGrid> & phases, unsigned int oversampling)
{
  const auto              steps = static_cast<std::int32_t>(oversampling);
  std::vector<ColumnSpan> reached(phases.front().rows * steps);
  for (std::int32_t n = 0; n < steps * steps; ++n)
  {
    const IntermediateGrid & phase = phases[n];
    for (std::ptrdiff_t row = 0; row < phase.rows; ++row)
    {
      const auto [first, end] = phase.reached[row];
      ColumnSpan & span = reached[row * steps + n / steps];
      if (first < end)
      {
        const std::int32_t begin = first * steps + n % steps;
        span.begin = span.begin < span.end ? std::min(span.begin, begin) : begin;
        span.end = std::max(span.end, (end - 1) * steps + n % steps + 1);
      }
    }
  }
  return reached;
}
} // namespace

/** \class ShearWarpEngine::Implementation
 * The memory that is kept between updates, and the plan and state of an update. */
template <typename TPixel>
class ShearWarpEngine<TPixel>::Implementation
{
public:
  using KernelsType = Kernels<TPixel>;
  using ImageType = IntermediateImage<TPixel>;

  explicit Implementation(Measurements & measurements)
    : m_Measurements(measurements)
  {}

  void
  Begin(const Scene & scene, const RuleType & rule, const Threads & threads);

  std::size_t
  GetNumberOfPasses() const
  {
    return m_Passes.size();
  }

  std::vector<SliceRange>
  BeginPass(std::size_t pass);

  void
  Add(const SliceRange & slab, const VoxelsType & voxels, const MaskType & mask);

  std::vector<std::size_t>
  GetViews(std::size_t pass) const;

  void
  Warp(std::size_t view, const PictureType & picture);

  void
  Refine(std::size_t view, const PictureType & picture);

  void
  End();

  double
  GetProgress() const
  {
    const auto planned = static_cast<double>(m_PlannedSteps);
    return planned > 0.0 ? std::min(static_cast<double>(m_DoneSteps) / planned, 1.0) : 0.0;
  }

  void
  ProjectPart(const Scene &      scene,
              const RuleType &   rule,
              const VoxelsType & voxels,
              unsigned char *    records,
              const Threads &    threads);

  void
  WarpParts(const Scene &                 scene,
            const RuleType &              rule,
            const std::vector<PartType> & parts,
            const PictureType &           picture,
            const Threads &               threads);

  std::size_t
  GetSizeInBytes() const;

  std::size_t
  GetPreparedSizeInBytes() const
  {
    return m_Volume.GetSizeInBytes() + m_Piece.GetSizeInBytes();
  }

private:
  void
  SetUp(const Scene & scene, const RuleType & rule, const Threads & threads);

  bool
  IsOrdered() const;

  typename Projector<TPixel>::Parameters
  MakeParameters() const;

  std::vector<Pass>
  PlanPasses() const;

  void
  CutPasses(unsigned int               axis,
            std::vector<Projection> && projections,
            std::size_t                bytesOfView,
            std::vector<Pass> &        passes) const;

  void
  PlanSteps();

  RunTasks
  CountSteps(std::size_t steps);

  Factorization
  FactorizeView(std::size_t view) const
  {
    return FactorizeForRule(m_Scene, m_Rule, view);
  }

  std::vector<ProjectedView>
  MakeProjectedViews(const Pass & pass, const VoxelBox & box);

  void
  DecidePreparation(const VoxelsType & voxels);

  void
  KeepBlockMinima()
  {
    if (m_Rule.isExact && m_Rule.mode != Mode::Maximum)
    {
      m_Volume.KeepBlockMinima();
      m_Piece.KeepBlockMinima();
    }
  }

  std::vector<SliceRange>
  CutSlices(const SliceRange & slices, std::size_t count) const;

  std::vector<SliceRange>
  CutIntoPieces(const SliceRange & slices, const VoxelBox & box) const;

  void
  AddPiece(const SliceRange & slices, const VoxelsType & voxels, const MaskType & mask, bool isWhole);

  void
  AddExactSlab(const SliceRange & slab, const VoxelsType & voxels);

  template <typename T>
  const PreparedVolume<T> &
  Prepare(PreparedVolume<T> & whole,
          PreparedVolume<T> & piece,
          const SliceRange &  slices,
          const Voxels<T> &   voxels,
          const Kernels<T> &  kernels,
          bool                hasBlockExtrema,
          bool                isWhole,
          std::size_t         steps);

  const ImageType &
  FinishProjection(std::size_t projection);

  const ImageType &
  FindImage(std::size_t view);

  void
  Join(const ImageType & phase, std::size_t projection, std::ptrdiff_t n);

  ExactView<TPixel>
  MakeExactView(std::size_t view, const PreparedVolume<TPixel> & volume) const;

  void
  SearchPart(std::size_t                    projection,
             std::size_t                    view,
             const PreparedVolume<TPixel> & volume,
             const IntermediateRegion &     region,
             unsigned char *                records,
             std::size_t                    steps);

  /** Returns whether exact pictures are of voxels that come in slabs. Records then merge the slabs. */
  bool
  HasExactSlabs() const
  {
    return m_Rule.isExact && m_Scene.slabs > 1;
  }

  /** Returns the bytes of the records of a picture. */
  std::size_t
  GetExactBytes() const
  {
    return static_cast<std::size_t>(m_Scene.picture.size[0] * m_Scene.picture.size[1]) *
           PartRecords<TPixel>(m_Rule).GetSize();
  }

  unsigned char *
  GetExactRecords(std::size_t view) const;

  void
  WriteExactRecords(std::size_t view, const unsigned char * records, const PictureType & picture);

  void
  WarpImage(const ImageType & image, const Factorization & factorization, const PictureType & picture);

  // kept between updates
  PreparedVolume<TPixel>        m_Volume;
  PreparedVolume<unsigned char> m_Mask{ true };
  PreparedVolume<TPixel>        m_Piece;
  PreparedVolume<unsigned char> m_PieceOfMask{ true };
  Projector<TPixel>             m_Projector;
  Buffer                        m_JoinedPixels, m_JoinedRanks; // of an oversampled image
  std::vector<ColumnSpan>       m_JoinedReached;
  Buffer                        m_ExactRecords; // of the pictures of a pass, if the volume comes in slabs
  Measurements &                m_Measurements;

  // of an update
  Scene                          m_Scene;
  RuleType                       m_Rule;
  Threads                        m_Threads;
  const KernelsType *            m_Kernels{ nullptr };
  const Kernels<unsigned char> * m_KernelsOfMask{ nullptr };
  std::vector<Pass>              m_Passes;
  std::atomic<std::size_t>       m_PlannedSteps{ 0 };
  std::atomic<std::size_t>       m_DoneSteps{ 0 };

  // of a pass
  static constexpr std::size_t               NoProjection = static_cast<std::size_t>(-1);
  const Pass *                               m_Pass{ nullptr };
  std::vector<std::vector<IntermediateGrid>> m_Phases; // of each projection
  bool                                       m_IsFirstSlabFirst{ true };
  bool                                       m_IsPrepared{ false }; // whether the next two are decided
  bool                                       m_IsCopyKept{ false };
  bool                                       m_HasBlockExtrema{ false };
  double                                     m_SkippedBefore{ 0.0 };
  std::size_t                                m_Finished{ NoProjection };
  ImageType                                  m_Image; // of this projection
};

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::SetUp(const Scene & scene, const RuleType & rule, const Threads & threads)
{
  if (scene.views.empty() || scene.slabs == 0 || threads.count == 0)
  {
    Throw(InvalidParameter("A scene needs views and slabs, and an update needs threads."));
  }
  const auto & size = scene.volume.size;
  const auto   longest = std::max({ size[0], size[1], size[2] });
  if (rule.mode == Mode::Mean && longest > MostSummedSlices<TPixel>)
  {
    RefuseParameter("Mode Mean needs at most " + std::to_string(MostSummedSlices<TPixel>) +
                    " voxels of this type along each axis, but an axis has " + std::to_string(longest) + '.');
  }
  m_Kernels = &GetKernels<TPixel>();
  m_KernelsOfMask = &GetKernels<unsigned char>();
  m_Scene = scene;
  m_Rule = rule;
  m_Threads = threads;
  m_Pass = nullptr;
  m_Finished = NoProjection;
  m_PlannedSteps = 0;
  m_DoneSteps = 0;
  m_Measurements = {};
  m_Measurements.instructionSet = m_Kernels->instructionSet;
  m_Measurements.principalAxis = this->FactorizeView(0).GetPrincipalAxis();
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::Begin(const Scene & scene, const RuleType & rule, const Threads & threads)
{
  this->SetUp(scene, rule, threads);
  m_Passes = this->PlanPasses();
  this->PlanSteps();
}

/** Returns whether the order of samples matters: to the first local maximum, to sums of floats, and where ranks cannot
 * count all slices. */
template <typename TPixel>
bool
ShearWarpEngine<TPixel>::Implementation::IsOrdered() const
{
  const auto & size = m_Scene.volume.size;
  if (m_Rule.mode == Mode::Mean)
  {
    return std::is_floating_point_v<TPixel>;
  }
  return m_Rule.localMaximumThreshold ||
         (m_Rule.NeedsRanks() && std::max({ size[0], size[1], size[2] }) > Projector<TPixel>::MostRankedSlices);
}

template <typename TPixel>
typename Projector<TPixel>::Parameters
ShearWarpEngine<TPixel>::Implementation::MakeParameters() const
{
  typename Projector<TPixel>::Parameters parameters;
  parameters.mode = m_Rule.mode;
  parameters.hasRanks = m_Rule.NeedsRanks();
  parameters.isOrdered = this->IsOrdered();
  parameters.background = m_Rule.background;
  parameters.maskLabel = m_Rule.maskLabel;
  parameters.reducedResampling = m_Rule.reducedResampling;
  parameters.localThreshold = m_Rule.localMaximumThreshold;
  return parameters;
}

template <typename TPixel>
std::vector<Pass>
ShearWarpEngine<TPixel>::Implementation::PlanPasses() const
{
  const bool isAlone = this->IsOrdered() || m_Rule.HasRegion() || m_Rule.hasDepth || m_Rule.depthAttenuation > 0.0;
  const auto place = [](const Factorization & view) { return PlaceSlices(view, 0, view.size[2]); };
  std::vector<Projection>                           projections[3];
  std::size_t                                       mostBytes[3]{};
  std::unordered_multimap<std::size_t, std::size_t> candidates[3];
  for (std::size_t number = 0; number < m_Scene.views.size(); ++number)
  {
    const Factorization factorization = this->FactorizeView(number);
    const unsigned int  axis = factorization.GetPrincipalAxis();
    const auto          phases = MakePhases(factorization, GetWholeBox(m_Scene.volume), m_Rule.oversampling);
    const std::size_t   bytes =
      phases.size() *
        Projector<TPixel>::GetViewSizeInBytes(
          phases.front().columns, phases.front().rows, m_Rule.mode, m_Rule.HasRegion(), m_Rule.NeedsRanks()) +
      (this->HasExactSlabs() ? this->GetExactBytes() / m_Threads.count : 0);
    mostBytes[axis] = std::max(mostBytes[axis], bytes);
    // the last phase is not shifted
    const auto &      placements = phases.back().placements;
    const std::size_t hash = HashPlacements(placements);
    const auto [begin, end] = candidates[axis].equal_range(hash);
    const auto same = isAlone ? end : std::find_if(begin, end, [&, axisOfView = axis](const auto & candidate) {
      return AreEqual(place(this->FactorizeView(projections[axisOfView][candidate.second].front())), placements);
    });
    if (same != end)
    {
      projections[axis][same->second].push_back(number);
      continue;
    }
    candidates[axis].emplace(hash, projections[axis].size());
    projections[axis].push_back({ number });
  }
  std::vector<Pass> passes;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    this->CutPasses(axis, std::move(projections[axis]), mostBytes[axis], passes);
  }
  return passes;
}

/** Adds as few passes of the projections as memory allows, of equal size. */
template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::CutPasses(unsigned int               axis,
                                                   std::vector<Projection> && projections,
                                                   std::size_t                bytesOfView,
                                                   std::vector<Pass> &        passes) const
{
  const std::size_t room = m_Scene.intermediateMemory / m_Threads.count / std::max<std::size_t>(bytesOfView, 1);
  const std::size_t most = this->IsOrdered() ? 1 : std::clamp<std::size_t>(room, 1, MostViewsTogether);
  const std::size_t total = projections.size();
  const std::size_t count = (total + most - 1) / most;
  const auto        first = std::make_move_iterator(projections.begin());
  for (std::size_t n = 0; n < count; ++n)
  {
    passes.push_back({ axis, { first + n * total / count, first + (n + 1) * total / count } });
  }
}

/** Steps are samples. A pass projects the volume once for each projection; what it prepares is planned when it is
 * known. An exact picture takes about as long as eight projections. */
template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::PlanSteps()
{
  const auto & size = m_Scene.volume.size;
  const auto   voxels = static_cast<std::size_t>(size[0]) * size[1] * size[2];
  const auto   pixels = static_cast<std::size_t>(m_Scene.picture.size[0] * m_Scene.picture.size[1]);
  for (const Pass & pass : m_Passes)
  {
    m_PlannedSteps += voxels * pass.projections.size();
  }
  m_PlannedSteps += m_Scene.views.size() * (m_Rule.isExact ? 8 * voxels : pixels);
}

/** Returns the threads, counting steps of work as tasks end. */
template <typename TPixel>
RunTasks
ShearWarpEngine<TPixel>::Implementation::CountSteps(std::size_t stepsOfWork)
{
  return [this, stepsOfWork](std::size_t count, std::size_t steps, const Task & task) {
    const std::size_t stepsOfTask = stepsOfWork / std::max<std::size_t>(count * steps, 1);
    m_Threads.run(count, steps, [this, stepsOfTask, &task](std::size_t n, std::size_t step, std::size_t worker) {
      task(n, step, worker);
      m_DoneSteps += stepsOfTask;
    });
  };
}

/** Makes the views of a pass, and the grids of their phases, for the voxels of a box. */
template <typename TPixel>
std::vector<ProjectedView>
ShearWarpEngine<TPixel>::Implementation::MakeProjectedViews(const Pass & pass, const VoxelBox & box)
{
  std::vector<ProjectedView> views;
  m_Phases.clear();
  for (const Projection & projection : pass.projections)
  {
    const AffineMap3D &   view = m_Scene.views[projection.front()];
    const Factorization   factorization = this->FactorizeView(projection.front());
    const auto            intervals = MakeIntervals(view, factorization, m_Rule);
    std::optional<Fading> fading;
    if (m_Rule.depthAttenuation > 0.0)
    {
      fading = Fading{ m_Rule.depthAttenuation, std::max(FindSphereDepth(view, m_Scene.volume), m_Rule.slabNear) };
    }
    m_Phases.push_back(MakePhases(factorization, box, m_Rule.oversampling));
    for (std::size_t n = 0; n < m_Phases.back().size(); ++n)
    {
      const auto toPhase = [&](const ShearedFunction & function) {
        return GetFunctionOfPhase(function, m_Rule.oversampling, n);
      };
      ProjectedView projected{ &m_Phases.back()[n], toPhase(GetDepthFunction(factorization)), intervals, fading };
      for (Interval & interval : projected.intervals)
      {
        interval.function = toPhase(interval.function);
      }
      views.push_back(std::move(projected));
    }
  }
  return views;
}

template <typename TPixel>
std::vector<SliceRange>
ShearWarpEngine<TPixel>::Implementation::BeginPass(std::size_t pass)
{
  m_Pass = &m_Passes[pass];
  m_Finished = NoProjection;
  m_IsPrepared = false;
  m_SkippedBefore = m_Measurements.skippedFraction;
  m_IsFirstSlabFirst = !this->IsOrdered() || IsFirstSlabFront(this->FactorizeView(m_Pass->projections.front().front()));

  if (this->HasExactSlabs())
  {
    const PartRecords<TPixel> records(m_Rule);
    const std::size_t         bytes = this->GetViews(pass).size() * this->GetExactBytes();
    m_ExactRecords.Reserve(bytes, "the values of exact pictures");
    records.Clear(m_ExactRecords.GetPointer<unsigned char>(), static_cast<std::ptrdiff_t>(bytes / records.GetSize()));
  }
  else
  {
    m_Projector.Begin(this->MakeProjectedViews(*m_Pass, GetWholeBox(m_Scene.volume)),
                      m_Pass->axis,
                      *m_Kernels,
                      this->MakeParameters(),
                      m_Threads.count);
  }
  return this->CutSlices({ 0, m_Scene.volume.size[2] }, m_Scene.slabs);
}

/** Decides what is prepared for a pass: only what serves further views of the volume, too. */
template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::DecidePreparation(const VoxelsType & voxels)
{
  const unsigned int projectedAxes = m_Volume.GetProjectedAxes(voxels);
  const bool         isSecondView = m_Pass->projections.size() > 1 || projectedAxes != 0;
  m_IsCopyKept = m_Rule.isExact || (projectedAxes >> m_Pass->axis & 1U) != 0;
  m_HasBlockExtrema =
    m_Rule.isExact || (m_Rule.IsPlainMaximum() && (m_Rule.reducedResampling == ReducedResampling::On || isSecondView));
  this->KeepBlockMinima();
  m_IsPrepared = true;
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::Add(const SliceRange & slab, const VoxelsType & voxels, const MaskType & mask)
{
  if (!m_Pass)
  {
    Throw(std::logic_error("BeginPass() comes before Add()."));
  }
  if (!m_IsPrepared)
  {
    this->DecidePreparation(voxels);
  }
  if (m_Scene.slabs > 1)
  {
    m_Volume.Release();
    m_Mask.Release();
    m_Rule.isExact ? this->AddExactSlab(slab, voxels) : this->AddPiece(slab, voxels, mask, false);
  }
  else
  {
    if (m_IsCopyKept || m_Pass->axis != 0)
    {
      m_Piece.Release();
      m_PieceOfMask.Release();
      this->AddPiece(slab, voxels, mask, true);
    }
    else
    {
      m_Volume.SetVoxels(voxels, GetWholeBox(m_Scene.volume));
      for (const SliceRange & piece : this->CutIntoPieces(slab, voxels.box))
      {
        this->AddPiece(piece, voxels, mask, false);
      }
    }
    m_Volume.AddProjectedAxis(m_Pass->axis);
  }
  std::size_t views = 0;
  for (const Projection & projection : m_Pass->projections)
  {
    views += projection.size();
  }
  m_Measurements.skippedFraction = m_SkippedBefore + m_Projector.GetSkippedFraction() * static_cast<double>(views) /
                                                       static_cast<double>(m_Scene.views.size());
}

/** Cuts slices into ranges, in the order of projection. */
template <typename TPixel>
std::vector<SliceRange>
ShearWarpEngine<TPixel>::Implementation::CutSlices(const SliceRange & slices, std::size_t count) const
{
  std::vector<SliceRange> ranges(count);
  for (std::size_t n = 0; n < count; ++n)
  {
    ranges[n] = GetSlab(slices, m_IsFirstSlabFirst ? n : count - 1 - n, count);
  }
  return ranges;
}

/** Returns pieces of slices whose transposed copy stays in the cache. */
template <typename TPixel>
std::vector<SliceRange>
ShearWarpEngine<TPixel>::Implementation::CutIntoPieces(const SliceRange & slices, const VoxelBox & box) const
{
  constexpr std::ptrdiff_t pieceBytes = 1 << 21;
  const std::ptrdiff_t     sliceBytes = box.size[0] * box.size[1] * static_cast<std::ptrdiff_t>(sizeof(TPixel));
  const std::ptrdiff_t     length =
    std::max(pieceBytes / sliceBytes, 2 * BlockLength) * static_cast<std::ptrdiff_t>(m_Threads.count);
  const auto count =
    static_cast<std::size_t>(std::max<std::ptrdiff_t>(CountBlocks(slices.end - slices.begin, length), 1));
  return this->CutSlices(slices, count);
}

/** Prepares and projects some slices of the voxels; all of them if \a isWhole. */
template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::AddPiece(const SliceRange & slices,
                                                  const VoxelsType & voxels,
                                                  const MaskType &   mask,
                                                  bool               isWhole)
{
  const auto   size = voxels.box.size;
  const auto   steps = static_cast<std::size_t>(size[0] * size[1] * (slices.end - slices.begin));
  const auto & prepared =
    this->Prepare(m_Volume, m_Piece, slices, voxels, *m_Kernels, m_HasBlockExtrema, isWhole, steps);
  const PreparedVolume<unsigned char> * preparedMask = nullptr;
  if (m_Rule.hasMask)
  {
    preparedMask = &this->Prepare(m_Mask, m_PieceOfMask, slices, mask, *m_KernelsOfMask, true, isWhole, steps);
  }
  const auto start = Clock::now();
  m_Projector.Project(prepared, preparedMask, this->CountSteps(steps * m_Pass->projections.size()));
  m_Measurements.projectionSeconds += SecondsSince(start);
}

template <typename TPixel>
template <typename T>
const PreparedVolume<T> &
ShearWarpEngine<TPixel>::Implementation::Prepare(PreparedVolume<T> & whole,
                                                 PreparedVolume<T> & piece,
                                                 const SliceRange &  slices,
                                                 const Voxels<T> &   voxels,
                                                 const Kernels<T> &  kernels,
                                                 bool                hasBlockExtrema,
                                                 bool                isWhole,
                                                 std::size_t         steps)
{
  const unsigned int axis = m_Pass->axis;
  const bool         findsExtrema = hasBlockExtrema && !(isWhole && whole.IsPrepared(voxels, 2));
  const bool         transposes = axis == 0 && !(isWhole && whole.IsPrepared(voxels, 0, false));
  const auto         start = Clock::now();
  const auto         box = GetWholeBox(m_Scene.volume);
  const RunTasks     run = this->CountSteps(steps);
  m_PlannedSteps += (findsExtrema ? steps : 0) + (transposes ? steps : 0);
  if (isWhole)
  {
    whole.Prepare(voxels, box, axis, hasBlockExtrema, kernels, run);
  }
  else
  {
    piece.PreparePiece(voxels, box, slices, axis, hasBlockExtrema, kernels, run);
  }
  m_Measurements.preparationSeconds += findsExtrema || transposes ? SecondsSince(start) : 0.0;
  return isWhole ? whole : piece;
}

template <typename TPixel>
std::vector<std::size_t>
ShearWarpEngine<TPixel>::Implementation::GetViews(std::size_t pass) const
{
  std::vector<std::size_t> views;
  for (const Projection & projection : m_Passes[pass].projections)
  {
    views.insert(views.end(), projection.begin(), projection.end());
  }
  return views;
}

/** Returns the intermediate image of a view of the pass. */
template <typename TPixel>
auto
ShearWarpEngine<TPixel>::Implementation::FindImage(std::size_t view) -> const ImageType &
{
  for (std::size_t n = 0; m_Pass && n < m_Pass->projections.size(); ++n)
  {
    const Projection & projection = m_Pass->projections[n];
    if (std::find(projection.begin(), projection.end(), view) != projection.end())
    {
      return this->FinishProjection(n);
    }
  }
  Throw(std::logic_error("A view's picture is made in the view's pass."));
}

/** Merges the images of all threads, and joins the phases of an oversampled image. */
template <typename TPixel>
auto
ShearWarpEngine<TPixel>::Implementation::FinishProjection(std::size_t projection) -> const ImageType &
{
  if (projection != m_Finished)
  {
    const auto        start = Clock::now();
    const std::size_t phases = m_Phases[projection].size();
    m_Finished = NoProjection;
    for (std::size_t n = 0; n < phases; ++n)
    {
      m_Image = m_Projector.Finish(projection * phases + n, m_Threads.run);
      if (phases > 1)
      {
        this->Join(m_Image, projection, static_cast<std::ptrdiff_t>(n));
      }
    }
    m_Image.isNearest = m_Rule.interpolation == Interpolation::Nearest;
    m_Finished = projection;
    m_Measurements.projectionSeconds += SecondsSince(start);
  }
  return m_Image;
}

/** Copies phase \a n of a projection into the oversampled image. The last phase completes m_Image. */
template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::Join(const ImageType & phase, std::size_t projection, std::ptrdiff_t n)
{
  const std::ptrdiff_t steps = m_Rule.oversampling;
  ImageType            joined = phase;
  joined.columns = steps * phase.columns;
  joined.rows = steps * phase.rows;
  joined.rowStride = steps * phase.rowStride;
  m_JoinedPixels.Reserve(joined.rows * joined.rowStride * sizeof(TPixel), "the oversampled intermediate image");
  joined.pixels = m_JoinedPixels.GetPointer<TPixel>();
  std::int32_t * ranks = nullptr;
  if (phase.ranks)
  {
    m_JoinedRanks.Reserve(joined.rows * joined.rowStride * sizeof(std::int32_t), "the oversampled intermediate image");
    joined.ranks = ranks = m_JoinedRanks.GetPointer<std::int32_t>();
  }
  m_Threads.run(static_cast<std::size_t>(phase.rows), 1, [&](std::size_t task, std::size_t, std::size_t) {
    const auto           row = static_cast<std::ptrdiff_t>(task);
    const std::ptrdiff_t from = row * phase.rowStride;
    const std::ptrdiff_t to = (row * steps + n / steps) * joined.rowStride + n % steps;
    for (std::ptrdiff_t column = 0; column < phase.columns; ++column)
    {
      joined.pixels[to + column * steps] = phase.pixels[from + column];
      if (ranks)
      {
        ranks[to + column * steps] = phase.ranks[from + column];
      }
    }
  });
  if (n + 1 < steps * steps)
  {
    return;
  }
  m_JoinedReached = JoinReached(m_Phases[projection], m_Rule.oversampling);
  joined.hasGaps = false;
  for (std::ptrdiff_t row = 0; ranks && row < joined.rows; ++row)
  {
    const ReachedRow reached = FindReached(ranks + row * joined.rowStride, joined.columns);
    m_JoinedReached[row] = reached.span;
    joined.hasGaps = joined.hasGaps || reached.hasGaps;
  }
  joined.reached = m_JoinedReached.data();
  m_Image = joined;
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::Warp(std::size_t view, const PictureType & picture)
{
  this->WarpImage(this->FindImage(view), this->FactorizeView(view), picture);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::WarpImage(const ImageType &     image,
                                                   const Factorization & factorization,
                                                   const PictureType &   picture)
{
  const auto               start = Clock::now();
  const unsigned int       oversampling = m_Rule.oversampling;
  const AffineMap2D        map = GetOutputToIntermediate(factorization, m_Scene.picture, oversampling);
  const ShearedFunction    depth = GetDepthFunction(factorization);
  const auto               columns = static_cast<std::ptrdiff_t>(m_Scene.picture.size[0]);
  const auto               rows = static_cast<std::ptrdiff_t>(m_Scene.picture.size[1]);
  constexpr std::ptrdiff_t band = 16;
  const RunTasks           run = this->CountSteps(static_cast<std::size_t>(columns * rows));
  run(static_cast<std::size_t>(CountBlocks(rows, band)), 1, [&](std::size_t n, std::size_t, std::size_t) {
    const std::ptrdiff_t begin = static_cast<std::ptrdiff_t>(n) * band;
    for (std::ptrdiff_t row = begin; row < std::min(begin + band, rows); ++row)
    {
      m_Kernels->warpRow(image, map, row, 0, columns, m_Rule.background, picture.pixels + row * columns);
      if (picture.depths)
      {
        FindDepths(image, map, oversampling, depth, row, columns, picture.depths + row * columns);
      }
    }
  });
  m_Measurements.warpSeconds += SecondsSince(start);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::Refine(std::size_t view, const PictureType & picture)
{
  const auto columns = static_cast<std::ptrdiff_t>(m_Scene.picture.size[0]);
  const auto rows = static_cast<std::ptrdiff_t>(m_Scene.picture.size[1]);
  if (this->HasExactSlabs())
  {
    this->WriteExactRecords(view, this->GetExactRecords(view), picture);
    return;
  }
  const ImageType & guess = this->FindImage(view);
  const auto        start = Clock::now();
  const auto &      size = m_Scene.volume.size;
  const auto        steps = 8 * static_cast<std::size_t>(size[0]) * size[1] * size[2];
  ProjectExactly(this->MakeExactView(view, m_Volume),
                 m_Rule.mode,
                 *m_Kernels,
                 guess,
                 columns,
                 rows,
                 picture,
                 m_Threads.run,
                 this->CountSteps(steps));
  m_Measurements.warpSeconds += SecondsSince(start);
}

template <typename TPixel>
ExactView<TPixel>
ShearWarpEngine<TPixel>::Implementation::MakeExactView(std::size_t view, const PreparedVolume<TPixel> & volume) const
{
  const Factorization factorization = this->FactorizeView(view);
  const unsigned int  axis = factorization.GetPrincipalAxis();
  ExactView<TPixel>   exact;
  exact.slices = volume.GetSlices(axis);
  exact.first = volume.GetCorner(axis);
  exact.blocks = volume.GetBlockExtrema(axis);
  for (unsigned int n = 0; n < 2; ++n)
  {
    exact.shear[n] = factorization.shear[n];
    exact.translation[n] = factorization.translation[n];
  }
  exact.outputToSheared = GetOutputToIntermediate(factorization, m_Scene.picture);
  exact.intervals = MakeIntervals(m_Scene.views[view], factorization, m_Rule);
  exact.depth = GetDepthFunction(factorization);
  exact.background = m_Rule.background;
  return exact;
}

/** Searches the voxels, a part of the volume, for a view of a projection. */
template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::SearchPart(std::size_t                    projection,
                                                    std::size_t                    view,
                                                    const PreparedVolume<TPixel> & volume,
                                                    const IntermediateRegion &     region,
                                                    unsigned char *                records,
                                                    std::size_t                    steps)
{
  const ImageType & guess = this->FinishProjection(projection);
  const auto        start = Clock::now();
  SearchExactly(this->MakeExactView(view, volume),
                this->FactorizeView(view).size,
                m_Rule,
                *m_Kernels,
                guess,
                m_Phases[projection].front().begin,
                region,
                records,
                this->CountSteps(steps));
  m_Measurements.warpSeconds += SecondsSince(start);
}

/** Returns the records of a view of the pass. */
template <typename TPixel>
unsigned char *
ShearWarpEngine<TPixel>::Implementation::GetExactRecords(std::size_t view) const
{
  std::size_t place = 0;
  for (const Projection & projection : m_Pass->projections)
  {
    const auto found = std::find(projection.begin(), projection.end(), view);
    place += static_cast<std::size_t>(found - projection.begin());
    if (found != projection.end())
    {
      break;
    }
  }
  return m_ExactRecords.GetPointer<unsigned char>() + place * this->GetExactBytes();
}

/** Searches a slab as a part of the volume: from the slice before it on, because cells lie between slices. */
template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::AddExactSlab(const SliceRange & slab, const VoxelsType & voxels)
{
  const SliceRange slices{ std::max(slab.begin - 1, voxels.box.begin[2]), slab.end };
  VoxelBox         box = voxels.box;
  box.begin[2] = slices.begin;
  box.size[2] = slices.end - slices.begin;
  m_Finished = NoProjection;
  m_Projector.Begin(
    this->MakeProjectedViews(*m_Pass, box), m_Pass->axis, *m_Kernels, this->MakeParameters(), m_Threads.count);
  VoxelsType slabVoxels = voxels;
  slabVoxels.box = box;
  slabVoxels.data += (slices.begin - voxels.box.begin[2]) * voxels.box.size[0] * voxels.box.size[1];
  this->AddPiece(slices, slabVoxels, {}, false);
  const auto               steps = 8 * static_cast<std::size_t>(box.size[0] * box.size[1] * (slab.end - slab.begin));
  const IntermediateRegion all = FindPart(m_Scene, m_Rule, GetWholeBox(m_Scene.volume));
  for (std::size_t n = 0; n < m_Pass->projections.size(); ++n)
  {
    for (const std::size_t view : m_Pass->projections[n])
    {
      this->SearchPart(n, view, m_Piece, all, this->GetExactRecords(view), steps);
    }
  }
}

/** Makes a picture from the records of all its pixels. */
template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::WriteExactRecords(std::size_t           view,
                                                           const unsigned char * records,
                                                           const PictureType &   picture)
{
  const Factorization   factorization = this->FactorizeView(view);
  const AffineMap2D     map = GetOutputToIntermediate(factorization, m_Scene.picture);
  const ShearedFunction depth = GetDepthFunction(factorization);
  const auto            columns = static_cast<std::ptrdiff_t>(m_Scene.picture.size[0]);
  const auto            bytes = columns * static_cast<std::ptrdiff_t>(PartRecords<TPixel>(m_Rule).GetSize());
  m_Threads.run(static_cast<std::size_t>(m_Scene.picture.size[1]), 1, [&](std::size_t n, std::size_t, std::size_t) {
    const auto row = static_cast<std::ptrdiff_t>(n);
    WriteExactly(m_Rule, map, depth, records + row * bytes, columns, row, picture);
  });
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::End()
{
  m_Piece.Release();
  m_PieceOfMask.Release();
  if (m_Scene.slabs > 1)
  {
    m_Volume.Release();
    m_Mask.Release();
    m_Projector.Release();
    m_JoinedPixels.Release();
    m_JoinedRanks.Release();
    m_JoinedReached = std::vector<ColumnSpan>();
    m_ExactRecords.Release();
  }
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::ProjectPart(const Scene &      scene,
                                                     const RuleType &   rule,
                                                     const VoxelsType & voxels,
                                                     unsigned char *    records,
                                                     const Threads &    threads)
{
  rule.VerifyForParts();
  this->SetUp(scene, rule, threads);
  const Factorization       factorization = this->FactorizeView(0);
  const unsigned int        axis = factorization.GetPrincipalAxis();
  const auto &              box = voxels.box;
  const PartRecords<TPixel> ofRule(m_Rule);
  const auto                steps = static_cast<std::size_t>(box.size[0]) * box.size[1] * box.size[2];
  if (rule.mode == Mode::Mean && IsThin(box, scene.volume))
  {
    const IntermediateRegion region = FindPart(scene, rule, box);
    ofRule.Clear(records, region.columns * region.rows);
    m_PlannedSteps = 1;
    m_DoneSteps = 1;
    return;
  }
  m_Passes = { { axis, { { 0 } } } };
  m_Pass = &m_Passes.front();
  m_PlannedSteps = (rule.isExact ? 9 : 1) * steps;
  m_SkippedBefore = 0.0;
  m_HasBlockExtrema = rule.isExact || (rule.IsPlainMaximum() && rule.reducedResampling != ReducedResampling::Off);
  m_IsCopyKept = m_HasBlockExtrema || m_Volume.IsPrepared(voxels, axis, false);
  this->KeepBlockMinima();
  m_IsPrepared = true;
  auto parameters = this->MakeParameters();
  // ranks tell where an image of the better one of two extrema has no sample
  parameters.hasRanks = parameters.hasRanks || (rule.mode == Mode::AbsoluteMaximum && std::is_signed_v<TPixel>);
  parameters.isOrdered = parameters.hasRanks && box.size[axis] > Projector<TPixel>::MostRankedSlices;
  parameters.isFirstSliceShared = rule.mode == Mode::Mean && box.begin[axis] != 0;
  m_IsFirstSlabFirst = !parameters.isOrdered || IsFirstSlabFront(factorization);
  m_Projector.Begin(this->MakeProjectedViews(*m_Pass, box), axis, *m_Kernels, parameters, m_Threads.count);
  this->Add({ box.begin[2], box.begin[2] + box.size[2] }, voxels, {});
  if (rule.isExact)
  {
    const IntermediateRegion region = FindPart(scene, rule, box);
    ofRule.Clear(records, region.columns * region.rows);
    this->SearchPart(0, 0, m_Volume, region, records, 8 * steps);
    return;
  }
  const auto           start = Clock::now();
  const std::ptrdiff_t oversampling = rule.oversampling;
  const auto           size = static_cast<std::ptrdiff_t>(ofRule.GetSize());
  for (std::ptrdiff_t n = 0; n < oversampling * oversampling; ++n)
  {
    const auto      phase = static_cast<std::size_t>(n);
    const ImageType image = m_Projector.Finish(phase, m_Threads.run);
    for (std::ptrdiff_t row = 0; row < image.rows; ++row)
    {
      const std::ptrdiff_t place =
        (row * oversampling + n / oversampling) * oversampling * image.columns + n % oversampling;
      ofRule.Pack(
        image, m_Projector.GetSums(phase), GetRanking(factorization), row, records + place * size, oversampling);
    }
  }
  m_Measurements.projectionSeconds += SecondsSince(start);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Implementation::WarpParts(const Scene &                 scene,
                                                   const RuleType &              rule,
                                                   const std::vector<PartType> & parts,
                                                   const PictureType &           picture,
                                                   const Threads &               threads)
{
  rule.VerifyForParts();
  this->SetUp(scene, rule, threads);
  const auto                start = Clock::now();
  const Factorization       factorization = this->FactorizeView(0);
  const IntermediateRegion  region = FindPart(scene, rule, GetWholeBox(scene.volume));
  const PartRecords<TPixel> ofRule(m_Rule);
  const std::size_t         recordsOfRow = static_cast<std::size_t>(region.columns) * ofRule.GetSize();
  m_PlannedSteps = static_cast<std::size_t>(scene.picture.size[0] * scene.picture.size[1]);
  const auto mergeRow = [&](std::ptrdiff_t row) {
    std::vector<unsigned char> records(recordsOfRow);
    MergeRow(ofRule, parts, region, row, records.data());
    return records;
  };
  if (rule.isExact)
  {
    const AffineMap2D     map = GetOutputToIntermediate(factorization, scene.picture);
    const ShearedFunction depth = GetDepthFunction(factorization);
    const RunTasks        run = this->CountSteps(m_PlannedSteps);
    run(static_cast<std::size_t>(region.rows), 1, [&](std::size_t n, std::size_t, std::size_t) {
      const auto row = static_cast<std::ptrdiff_t>(n);
      WriteExactly(m_Rule, map, depth, mergeRow(row).data(), region.columns, row, picture);
    });
    return;
  }
  Buffer                  pixels, ranks;
  std::vector<ColumnSpan> reached;
  ImageType               image;
  image.columns = image.rowStride = region.columns;
  image.rows = region.rows;
  pixels.Reserve(image.columns * image.rows * sizeof(TPixel), "the intermediate image");
  image.pixels = pixels.GetPointer<TPixel>();
  if (ofRule.HasRanks())
  {
    ranks.Reserve(image.columns * image.rows * sizeof(std::int32_t), "the ranks of the intermediate image");
    reached.resize(image.rows);
  }
  else
  {
    reached = JoinReached(MakePhases(factorization, GetWholeBox(scene.volume), rule.oversampling), rule.oversampling);
  }
  std::int32_t * const ranksOfImage = ofRule.HasRanks() ? ranks.GetPointer<std::int32_t>() : nullptr;
  std::atomic<bool>    hasGaps{ false };
  m_Threads.run(static_cast<std::size_t>(image.rows), 1, [&](std::size_t n, std::size_t, std::size_t) {
    const auto           row = static_cast<std::ptrdiff_t>(n);
    const std::ptrdiff_t first = row * image.rowStride;
    std::int32_t * const ranksOfRow = ranksOfImage ? ranksOfImage + first : nullptr;
    if (ofRule.ArePixels())
    {
      MergeRow(ofRule, parts, region, row, pixels.GetPointer<unsigned char>() + n * recordsOfRow);
      return;
    }
    ofRule.Unpack(mergeRow(row).data(), image.columns, image.pixels + first, ranksOfRow);
    if (ranksOfRow)
    {
      const ReachedRow found = FindReached(ranksOfRow, image.columns);
      reached[n] = found.span;
      hasGaps = hasGaps || found.hasGaps;
    }
  });
  image.reached = reached.data();
  image.ranks = ranksOfImage;
  image.ranking = GetRanking(factorization);
  image.hasGaps = hasGaps;
  image.isNearest = rule.interpolation == Interpolation::Nearest;
  image.none = ofRule.GetNone();
  m_Measurements.projectionSeconds = SecondsSince(start);
  this->WarpImage(image, factorization, picture);
}

template <typename TPixel>
std::size_t
ShearWarpEngine<TPixel>::Implementation::GetSizeInBytes() const
{
  return this->GetPreparedSizeInBytes() + m_Mask.GetSizeInBytes() + m_PieceOfMask.GetSizeInBytes() +
         m_Projector.GetSizeInBytes() + m_JoinedPixels.GetSizeInBytes() + m_JoinedRanks.GetSizeInBytes() +
         CountBytes(m_JoinedReached) + m_ExactRecords.GetSizeInBytes();
}

template <typename TPixel>
ShearWarpEngine<TPixel>::ShearWarpEngine()
  : m_Implementation(std::make_unique<Implementation>(m_Measurements))
{}

template <typename TPixel>
ShearWarpEngine<TPixel>::~ShearWarpEngine() = default;

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Begin(const Scene & scene, const RuleType & rule, const Threads & threads)
{
  m_Implementation->Begin(scene, rule, threads);
}

template <typename TPixel>
std::size_t
ShearWarpEngine<TPixel>::GetNumberOfPasses() const
{
  return m_Implementation->GetNumberOfPasses();
}

template <typename TPixel>
std::vector<SliceRange>
ShearWarpEngine<TPixel>::BeginPass(std::size_t pass)
{
  return m_Implementation->BeginPass(pass);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Add(const SliceRange & slab, const VoxelsType & voxels, const MaskType & mask)
{
  m_Implementation->Add(slab, voxels, mask);
}

template <typename TPixel>
std::vector<std::size_t>
ShearWarpEngine<TPixel>::GetViews(std::size_t pass) const
{
  return m_Implementation->GetViews(pass);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Warp(std::size_t view, const PictureType & picture)
{
  m_Implementation->Warp(view, picture);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Refine(std::size_t view, const PictureType & picture)
{
  m_Implementation->Refine(view, picture);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::End()
{
  m_Implementation->End();
}

template <typename TPixel>
double
ShearWarpEngine<TPixel>::GetProgress() const
{
  return m_Implementation->GetProgress();
}

template <typename TPixel>
IntermediateRegion
ShearWarpEngine<TPixel>::FindPart(const Scene & scene, const RuleType & rule, const VoxelBox & box)
{
  const auto & whole = scene.volume.size;
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    if (box.begin[axis] < 0 || box.size[axis] < 1 || box.size[axis] > whole[axis] ||
        box.begin[axis] > whole[axis] - box.size[axis])
    {
      std::string text = "A part must not be empty and lie within the volume, but along axis " + std::to_string(axis);
      text += " it begins at " + std::to_string(box.begin[axis]) + " and has " + std::to_string(box.size[axis]);
      Throw(InvalidParameter(text + " voxels of " + std::to_string(whole[axis]) + '.'));
    }
  }
  const Factorization factorization = FactorizeForRule(scene, rule, 0);
  if (rule.isExact)
  {
    return FindExactRegion(factorization, box, scene.picture);
  }
  const auto               phases = MakePhases(factorization, box, rule.oversampling);
  const IntermediateGrid & grid = phases.front();
  const std::ptrdiff_t     steps = rule.oversampling;
  return { steps * grid.begin.column, steps * grid.begin.row, steps * grid.columns, steps * grid.rows };
}

template <typename TPixel>
std::size_t
ShearWarpEngine<TPixel>::GetRecordSize(const RuleType & rule)
{
  return PartRecords<TPixel>(rule).GetSize();
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::ProjectPart(const Scene &      scene,
                                     const RuleType &   rule,
                                     const VoxelsType & voxels,
                                     unsigned char *    records,
                                     const Threads &    threads)
{
  m_Implementation->ProjectPart(scene, rule, voxels, records, threads);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::MergeParts(const RuleType &              rule,
                                    const std::vector<PartType> & parts,
                                    const IntermediateRegion &    region,
                                    unsigned char *               records,
                                    const Threads &               threads)
{
  const PartRecords<TPixel> ofRule(rule);
  const auto                bytesOfRow = region.columns * static_cast<std::ptrdiff_t>(ofRule.GetSize());
  threads.run(static_cast<std::size_t>(region.rows), 1, [&](std::size_t n, std::size_t, std::size_t) {
    const auto row = static_cast<std::ptrdiff_t>(n);
    MergeRow(ofRule, parts, region, row, records + row * bytesOfRow);
  });
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::WarpParts(const Scene &                 scene,
                                   const RuleType &              rule,
                                   const std::vector<PartType> & parts,
                                   const PictureType &           picture,
                                   const Threads &               threads)
{
  m_Implementation->WarpParts(scene, rule, parts, picture, threads);
}

template <typename TPixel>
void
ShearWarpEngine<TPixel>::Release()
{
  m_Implementation = std::make_unique<Implementation>(m_Measurements);
}

template <typename TPixel>
std::size_t
ShearWarpEngine<TPixel>::GetSizeInBytes() const
{
  return m_Implementation->GetSizeInBytes();
}

template <typename TPixel>
std::size_t
ShearWarpEngine<TPixel>::GetPreparedSizeInBytes() const
{
  return m_Implementation->GetPreparedSizeInBytes();
}

#define INSTANTIATE(TPixel) template class ShearWarpEngine<TPixel>;
SHEARWARP_FOR_EACH_PIXEL_TYPE(INSTANTIATE)
#undef INSTANTIATE
} // namespace itk
