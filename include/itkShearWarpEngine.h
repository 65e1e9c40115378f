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

#include "itkImage.h"
#include "itkShearWarpFactorization.h"

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
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
  /** Whether parts of the volume that cannot change the picture are skipped. */
  enum class ReducedResampling : uint8_t
  {
    Off,
    On,
    Auto
  };

  /** Which of a ray's samples is its value. */
  enum class Mode : uint8_t
  {
    Maximum,
    Minimum,
    AbsoluteMaximum
  };
};

/** Writes the enumerator's name. */
ShearWarpMIP_EXPORT std::ostream &
                    operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::Mode value);

/** Writes the enumerator's name. */
ShearWarpMIP_EXPORT std::ostream &
                    operator<<(std::ostream & out, ShearWarpMIPImageFilterEnums::ReducedResampling value);

namespace ShearWarp
{
/** The computer's memory in bytes; what can be addressed if the system does not say. */
ShearWarpMIP_EXPORT double
GetPhysicalMemory();

/** Step \a step of piece \a n of some work, by thread \a worker. */
using Task = std::function<void(SizeValueType n, SizeValueType step, SizeValueType worker)>;

/** Calls the task for each n of [0, count) and, one after the other, each step of [0, steps); calls with the same
 * worker do not overlap. */
using Parallelize = std::function<void(SizeValueType count, SizeValueType steps, const Task & task)>;

/** The threads of an update. */
struct Threads
{
  /** Numbers of workers are less. */
  SizeValueType count{ 1 };
  /** Parallelize, with its part of the update's progress. */
  std::function<void(SizeValueType count, SizeValueType steps, float share, const Task & task)> run;
};

/** Slices [begin, end) along z, counted from the first of the whole image. */
struct SliceRange
{
  std::ptrdiff_t begin, end;
};

/** How many slabs there are where \a wanted are, of \a slices slices: slabs are blocks of eight slices. */
ShearWarpMIP_EXPORT SizeValueType
CountSlabs(SliceRange slices, SizeValueType wanted);

/** Slab \a n of \a slabs, which are as thick as each other. */
ShearWarpMIP_EXPORT SliceRange
GetSlab(SliceRange slices, SizeValueType n, SizeValueType slabs);

/** What the engine projects: the buffered part of an image, or all of it slab by slab. */
template <typename TPixel>
struct Volume
{
  const Image<TPixel, 3> * image;
  /** What the image is a part of, or its largest possible region. */
  ImageRegion<3> whole;
  /** Null if there is none; of the image's geometry. */
  const Image<unsigned char, 3> * mask{ nullptr };
  /** In how many slabs along z the image comes into memory. If there are more than one nothing of it is kept. */
  SizeValueType streamDivisions{ 1 };
  /** Makes image and mask buffer these slices and, if there is one, the slice before. They stay in memory until the
   * next call. */
  std::function<void(const SliceRange & slices)> load{};
};

/** Which samples count, and what becomes of them: see the parameters of ShearWarpMIPBaseImageFilter. */
template <typename TPixel>
struct ProjectionRule
{
  static constexpr double Infinity = std::numeric_limits<double>::infinity();

  ShearWarpMIPImageFilterEnums::Mode              mode{ ShearWarpMIPImageFilterEnums::Mode::Maximum };
  ShearWarpMIPImageFilterEnums::ReducedResampling reducedResampling{
    ShearWarpMIPImageFilterEnums::ReducedResampling::Auto
  };
  double                slabNear{ -Infinity };
  double                slabFar{ Infinity };
  Point<double, 3>      cropLower{ -Infinity };
  Point<double, 3>      cropUpper{ Infinity };
  unsigned char         maskLabel{ 0 };
  std::optional<TPixel> localMaximumThreshold{};
  double                depthAttenuation{ 0.0 };
  TPixel                background{};
  bool                  hasDepth{ false };
  bool                  isExact{ false };

  /** Whether a ray's value is the maximum of all its samples, but for a mask. */
  bool
  IsPlainMaximum() const
  {
    return mode == ShearWarpMIPImageFilterEnums::Mode::Maximum && !this->HasRegion() && !localMaximumThreshold &&
           !(depthAttenuation > 0.0) && !hasDepth && !isExact;
  }

  /** Whether only a part of view space or of physical space counts. */
  bool
  HasRegion() const
  {
    return slabNear != -Infinity || slabFar != Infinity || cropLower != Point<double, 3>(-Infinity) ||
           cropUpper != Point<double, 3>(Infinity);
  }
};

/** Where a view's pixels come to, row by row. */
template <typename TPixel>
struct Picture
{
  TPixel * pixels;
  /** Null if depths are not wanted. */
  float * depths;
};

/** A part of an intermediate image, row by row. */
template <typename TPixel>
struct IntermediatePart
{
  const TPixel * pixels;
  ImageRegion<2> region;
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
 * All code that touches voxels is here. It is compiled in the library alone, so that its bits do not depend on who
 * includes this header.
 *
 * The engine keeps what it prepares of an image until that changes, and its memory. It has one user at a time.
 *
 * \tparam TPixel Any arithmetic type but bool and long double.
 *
 * \ingroup ShearWarpMIP
 */
template <typename TPixel>
class ShearWarpMIP_EXPORT ShearWarpEngine
{
public:
  ShearWarpEngine();
  ~ShearWarpEngine();
  ShearWarpEngine(const ShearWarpEngine &) = delete;
  ShearWarpEngine &
  operator=(const ShearWarpEngine &) = delete;

  using VolumeType = ShearWarp::Volume<TPixel>;
  using RuleType = ShearWarp::ProjectionRule<TPixel>;
  using PictureType = ShearWarp::Picture<TPixel>;
  using PartType = ShearWarp::IntermediatePart<TPixel>;

  /** Projects \a volume to the pictures of \a views, of the grid \a grid. Views of one principal axis are projected
   * together: as many as \a intermediateMemory bytes have room for, at most 256. \a getPicture(n) gives the place of
   * view n before it is written.
   * Throws what the functions that it gets throw, MemoryAllocationError, and ExceptionObject if the environment
   * variable SHEARWARPMIP_INSTRUCTION_SET names what this computer does not have; so do all. */
  void
  Project(const VolumeType &                                volume,
          const ShearWarp::ViewList &                       views,
          const ImageBase<2> *                              grid,
          unsigned int                                      oversampling,
          const RuleType &                                  rule,
          SizeValueType                                     intermediateMemory,
          const std::function<PictureType(SizeValueType)> & getPicture,
          const ShearWarp::Threads &                        threads);

  /** Projects \a volume, a part of an image, to the intermediate image of \a factorization, which is that part's: to
   * \a getPixels(), row by row. Pixels without a sample have the lowest value, or minus infinity. */
  void
  ProjectPart(const VolumeType &                              volume,
              const ShearWarpFactorization &                  factorization,
              ShearWarpMIPImageFilterEnums::ReducedResampling reducedResampling,
              const std::function<TPixel *()> &               getPixels,
              const ShearWarp::Threads &                      threads);

  /** Makes a picture of the maxima of intermediate images of parts, which lie within the whole image's, of
   * \a factorization. \a grid is the picture's. */
  void
  WarpParts(const std::vector<PartType> &     parts,
            const ShearWarpFactorization &    factorization,
            const ImageBase<2> *              grid,
            TPixel                            background,
            const std::function<TPixel *()> & getPixels,
            const ShearWarp::Threads &        threads);

  /** Of the last projection or picture. */
  const ShearWarp::Measurements &
  GetMeasurements() const
  {
    return m_Measurements;
  }

  /** Frees all memory. */
  void
  Release();

  /** Bytes that are held. */
  SizeValueType
  GetSizeInBytes() const;

  /** Bytes that the copy and the block maxima of the volume hold. */
  SizeValueType
  GetPreparedSizeInBytes() const;

private:
  class Implementation;
  ShearWarp::Measurements         m_Measurements;
  std::unique_ptr<Implementation> m_Implementation;
};
} // namespace itk

#endif
