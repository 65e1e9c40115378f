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
#ifndef itkShearWarpEngine_h
#define itkShearWarpEngine_h

#include "itkShearWarpGeometry.h"

#include <functional>
#include <iosfwd>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

namespace itk
{
/** \class ShearWarpMIPImageFilterEnums
 * \brief Enumerations of ShearWarpMIPImageFilter.
 * \ingroup ShearWarpMIP
 */
class ShearWarpMIPImageFilterEnums
{
public:
  /// Whether the filter skips parts of the volume that cannot change the picture.
  enum class ReducedResampling : std::uint8_t
  {
    Off,
    On,
    Auto
  };

  /// What the value of a ray is: one of its samples, or their mean.
  enum class Mode : std::uint8_t
  {
    Maximum,
    Minimum,
    AbsoluteMaximum,
    Mean
  };

  /// Whether samples and pixels are interpolated, or have the value of the nearest voxel.
  enum class Interpolation : std::uint8_t
  {
    Linear,
    Nearest
  };
};

/** Writes the enumerator's name. */
ShearWarpMIP_EXPORT std::ostream &
                    operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::Mode value);

/** Writes the enumerator's name. */
ShearWarpMIP_EXPORT std::ostream &
                    operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::ReducedResampling value);

/** Writes the enumerator's name. */
ShearWarpMIP_EXPORT std::ostream &
                    operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::Interpolation value);

namespace ShearWarp
{
/** Whether the values of \a TPixel have the bits of \a TEnginePixel. */
template <typename TPixel, typename TEnginePixel>
struct IsAlike
  : std::bool_constant<sizeof(TPixel) == sizeof(TEnginePixel) &&
                       std::is_signed_v<TPixel> == std::is_signed_v<TEnginePixel> &&
                       std::is_integral_v<TPixel> == std::is_integral_v<TEnginePixel>>
{
  using Type = TEnginePixel;
};

/** The engine's type with the bits of an arithmetic type: integers of the same size and sign are one type to it. */
template <typename TPixel>
using EnginePixel = typename std::disjunction<IsAlike<TPixel, std::uint8_t>,
                                              IsAlike<TPixel, std::int8_t>,
                                              IsAlike<TPixel, std::uint16_t>,
                                              IsAlike<TPixel, std::int16_t>,
                                              IsAlike<TPixel, float>,
                                              IsAlike<TPixel, std::int32_t>,
                                              IsAlike<TPixel, std::uint32_t>,
                                              IsAlike<TPixel, std::int64_t>,
                                              IsAlike<TPixel, std::uint64_t>,
                                              IsAlike<TPixel, double>>::Type;

using Interpolation = ShearWarpMIPImageFilterEnums::Interpolation;
using Mode = ShearWarpMIPImageFilterEnums::Mode;
using ReducedResampling = ShearWarpMIPImageFilterEnums::ReducedResampling;

/** \class Feature
 * What not every mode has.
 * \ingroup ShearWarpMIP */
enum class Feature : std::uint8_t
{
  Depth,
  Exact,
  LocalMaximum,
  Nearest
};

/** Returns whether pictures of a mode can have a feature. */
ShearWarpMIP_EXPORT bool
HasFeature(Mode mode, Feature feature);

/** Step \a step of piece \a n of some work, by thread \a worker. */
using Task = std::function<void(std::size_t n, std::size_t step, std::size_t worker)>;

/** Calls the task for each n of [0, count) and each step of [0, steps). The steps of one n run one after the other.
 * Calls with the same worker do not overlap. */
using RunTasks = std::function<void(std::size_t count, std::size_t steps, const Task & task)>;

/** The threads of an update. The numbers of workers are less than `count`. */
struct Threads
{
  std::size_t count{ 1 };
  RunTasks    run;
};

/** Slices [begin, end) along z, counted from the first of the whole volume. */
struct SliceRange
{
  std::ptrdiff_t begin, end;
};

/** Returns the number of slabs for \a wanted slabs of \a slices slices: slabs consist of blocks of eight slices. */
ShearWarpMIP_EXPORT std::size_t
                    CountSlabs(SliceRange slices, std::size_t wanted);

/** Returns slab \a n of \a slabs slabs of equal thickness. */
ShearWarpMIP_EXPORT SliceRange
GetSlab(SliceRange slices, std::size_t n, std::size_t slabs);

/** The voxels of a box of a volume, x contiguous, then y, then z. Voxels with the same `owner` and `version` are
 * unchanged, so the engine prepares them only once. */
template <typename TPixel>
struct Voxels
{
  const TPixel * data{ nullptr };
  VoxelBox       box{};
  const void *   owner{ nullptr };
  std::uint64_t  version{ 0 };
};

/** Which samples count, and how: see the parameters of ShearWarpMIPBaseImageFilter. */
template <typename TPixel>
struct ShearWarpMIP_EXPORT ProjectionRule
{
  static constexpr double Infinity = std::numeric_limits<double>::infinity();

  Mode                  mode{ Mode::Maximum };
  Interpolation         interpolation{ Interpolation::Linear };
  ReducedResampling     reducedResampling{ ReducedResampling::Auto };
  unsigned int          oversampling{ 1 };
  double                slabNear{ -Infinity };
  double                slabFar{ Infinity };
  double                cropLower[3]{ -Infinity, -Infinity, -Infinity };
  double                cropUpper[3]{ Infinity, Infinity, Infinity };
  bool                  hasMask{ false };
  unsigned char         maskLabel{ 0 };
  std::optional<TPixel> localMaximumThreshold{};
  double                depthAttenuation{ 0.0 };
  TPixel                background{};
  bool                  hasDepth{ false };
  bool                  isExact{ false };

  /** Returns whether a ray's value is the maximum of all its samples. */
  bool
  IsPlainMaximum() const;

  /** Returns whether only a part of view space or of physical space counts. */
  bool
  HasRegion() const;

  /** Returns whether intermediate images have ranks: which slice gave a pixel its value. Depth, masks, fading, local
   * maxima and exact pictures need them. */
  bool
  NeedsRanks() const;

  /** Throws InvalidParameter, with the value, if a parameter is outside of its range, or if two of them exclude each
   * other. */
  void
  Verify() const;

  /** Throws InvalidParameter if parts of a volume do not merge by this rule: masks, local maxima, fading, and means of
   * floating-point pixels, whose bits depend on the order of samples. */
  void
  VerifyForParts() const;
};

/** What is projected: views of a volume, each onto the same grid of pixels. */
struct Scene
{
  VolumeGrid               volume{};
  std::vector<AffineMap3D> views{};
  PictureGrid              picture{};
  /** The number of slabs along z in which the volume comes into memory. With more than one, the engine keeps nothing.
   */
  std::size_t slabs{ 1 };
  /** The most bytes of intermediate images of views that are projected together. */
  std::size_t intermediateMemory{ std::size_t{ 1 } << 30 };
};

/** The memory for a view's pixels, row by row. */
template <typename TPixel>
struct Picture
{
  TPixel * pixels;
  /** Null if depths are not wanted. */
  float * depths;
};

/** A rectangle of an intermediate image, or of an exact picture. */
struct IntermediateRegion
{
  std::ptrdiff_t column, row;
  std::ptrdiff_t columns, rows;
};

/** The projection of a part of a volume: a record of some bytes for each pixel of a rectangle, row by row. Only the
 * engine reads records. They have the byte order of the computer. */
struct IntermediatePart
{
  const unsigned char * records;
  IntermediateRegion    region;
};

/** What an update did and how long it took. */
struct Measurements
{
  std::string  instructionSet{ "portable" };
  unsigned int principalAxis{ 2 }; // of the first view
  double       preparationSeconds{ 0.0 };
  double       projectionSeconds{ 0.0 };
  double       warpSeconds{ 0.0 };
  double       skippedFraction{ 0.0 };
};
} // namespace ShearWarp

/** \class ShearWarpEngine
 * \brief Projects volumes of one pixel type.
 *
 * The engine contains all code that touches voxels. This code is compiled only in the library, so its bits do not
 * depend on the program that includes this header. No header of ITK is needed. A filter drives the engine:
 *
 *     engine.Begin(scene, rule, threads);
 *     for each pass:
 *       for each slab of engine.BeginPass(pass): bring the slab into memory; engine.Add(slab, voxels, mask);
 *       for each view of engine.GetViews(pass): engine.Warp(view, picture), or Refine() if the rule is exact
 *     engine.End();
 *
 * A pass reads the volume once, for views along the same axis. Each function throws ShearWarp::OutOfMemory if there is
 * no memory, and what a task throws. After an exception, Begin() can be called again.
 *
 * The engine keeps the prepared volume until the volume changes, and keeps its memory. Only one thread at a time may
 * use it.
 *
 * \tparam TPixel ShearWarp::EnginePixel of any arithmetic type but bool and long double.
 *
 * \ingroup ShearWarpMIP
 */
template <typename TPixel>
class ShearWarpMIP_EXPORT ShearWarpEngine
{
  static_assert(std::is_same_v<TPixel, ShearWarp::EnginePixel<TPixel>>, "see ShearWarp::EnginePixel");

public:
  ShearWarpEngine();
  ~ShearWarpEngine();
  ShearWarpEngine(const ShearWarpEngine &) = delete;
  ShearWarpEngine &
  operator=(const ShearWarpEngine &) = delete;

  using RuleType = ShearWarp::ProjectionRule<TPixel>;
  using VoxelsType = ShearWarp::Voxels<TPixel>;
  using MaskType = ShearWarp::Voxels<unsigned char>;
  using PictureType = ShearWarp::Picture<TPixel>;
  using PartType = ShearWarp::IntermediatePart;

  /** Plans the passes: views with the same principal axis are projected together, at most 256, and as many as fit into
   * the scene's memory. The engine keeps copies of all arguments. Throws InvalidParameter as Factorize(), if the
   * environment variable SHEARWARPMIP_INSTRUCTION_SET names an instruction set that this computer does not have, and
   * for the mean of pixels of 8 or 16 bits if an axis has more than 65536 voxels. */
  void
  Begin(const ShearWarp::Scene & scene, const RuleType & rule, const ShearWarp::Threads & threads);

  std::size_t
  GetNumberOfPasses() const;

  /** Returns the slabs that Add() expects, in order. */
  std::vector<ShearWarp::SliceRange>
  BeginPass(std::size_t pass);

  /** Projects a slab. The voxels' box must contain the slab and, if there is one, the slice before the slab. The voxels
   * must stay in memory until the next call of Add() or, for an exact rule, until End(). \a mask has the voxels of the
   * mask if the rule has a mask, and else no data. */
  void
  Add(const ShearWarp::SliceRange & slab, const VoxelsType & voxels, const MaskType & mask);

  /** Returns the views of the pass, in the order in which Warp() or Refine() expects them. */
  std::vector<std::size_t>
  GetViews(std::size_t pass) const;

  /** Makes the picture of a view from the view's intermediate image. */
  void
  Warp(std::size_t view, const PictureType & picture);

  /** Makes the exact picture of a view: the intermediate image is only a guess where the extremum of each ray is. */
  void
  Refine(std::size_t view, const PictureType & picture);

  /** Ends an update: frees what only this update needs. */
  void
  End();

  /** Returns the part of the planned work that is done, 0 to 1. Any thread may call it. */
  double
  GetProgress() const;

  /** Returns where the intermediate image of a part lies in the intermediate image of the whole or, for an exact rule,
   * which pixels of the picture the part may reach. Throws InvalidParameter as Factorize(), and if the box is empty or
   * not within the volume. */
  static ShearWarp::IntermediateRegion
  FindPart(const ShearWarp::Scene & scene, const RuleType & rule, const ShearWarp::VoxelBox & box);

  /** Returns the bytes of a pixel's record. */
  static std::size_t
  GetRecordSize(const RuleType & rule);

  /** Projects the voxels, a part of the volume, to the records of FindPart(). The scene has one view. Parts that share
   * one voxel along each axis together have all samples. A mean counts samples in a part's first slice, row and column
   * only where that is the volume's, and none of a part that is one voxel thick, so parts of means must share exactly
   * one voxel. Throws InvalidParameter as ProjectionRule::VerifyForParts(). */
  void
  ProjectPart(const ShearWarp::Scene &   scene,
              const RuleType &           rule,
              const VoxelsType &         voxels,
              unsigned char *            records,
              const ShearWarp::Threads & threads);

  /** Writes the records of \a region, which contains all parts: of one part with the samples of all parts. */
  static void
  MergeParts(const RuleType &                      rule,
             const std::vector<PartType> &         parts,
             const ShearWarp::IntermediateRegion & region,
             unsigned char *                       records,
             const ShearWarp::Threads &            threads);

  /** Makes a picture from parts. The scene has one view. Throws InvalidParameter as ProjectPart(). */
  void
  WarpParts(const ShearWarp::Scene &      scene,
            const RuleType &              rule,
            const std::vector<PartType> & parts,
            const PictureType &           picture,
            const ShearWarp::Threads &    threads);

  /** Returns the measurements of the last update. */
  const ShearWarp::Measurements &
  GetMeasurements() const
  {
    return m_Measurements;
  }

  /** Frees all memory. */
  void
  Release();

  /** Returns the bytes that the engine holds. */
  std::size_t
  GetSizeInBytes() const;

  /** Returns the bytes of the copy and of the block maxima of the volume. */
  std::size_t
  GetPreparedSizeInBytes() const;

private:
  class Implementation;
  ShearWarp::Measurements         m_Measurements;
  std::unique_ptr<Implementation> m_Implementation;
};
} // namespace itk

#endif
