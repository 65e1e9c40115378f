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
  /** Whether the filter skips parts of the volume that cannot change the picture. */
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
/** Returns the computer's memory in bytes, or the size of the address space if the system does not report it. */
ShearWarpMIP_EXPORT double
GetPhysicalMemory();

/** Step \a step of piece \a n of some work, by thread \a worker. */
using Task = std::function<void(SizeValueType n, SizeValueType step, SizeValueType worker)>;

/** Calls the task for each n of [0, count) and each step of [0, steps). The steps of one n run one after the other.
 * Calls with the same worker do not overlap. */
using Parallelize = std::function<void(SizeValueType count, SizeValueType steps, const Task & task)>;

/** The threads of an update. */
struct Threads
{
  /** The numbers of workers are less than this. */
  SizeValueType count{ 1 };
  /** As Parallelize; the call is \a share of the update's progress. */
  std::function<void(SizeValueType count, SizeValueType steps, float share, const Task & task)> run;
};

/** Slices [begin, end) along z, counted from the first of the whole image. */
struct SliceRange
{
  std::ptrdiff_t begin, end;
};

/** Returns the number of slabs for \a wanted slabs of \a slices slices: slabs consist of blocks of eight slices. */
ShearWarpMIP_EXPORT SizeValueType
CountSlabs(SliceRange slices, SizeValueType wanted);

/** Returns slab \a n of \a slabs slabs of equal thickness. */
ShearWarpMIP_EXPORT SliceRange
GetSlab(SliceRange slices, SizeValueType n, SizeValueType slabs);

/** What the engine projects: the buffered part of an image, or the whole image slab by slab. */
template <typename TPixel>
struct Volume
{
  const Image<TPixel, 3> * image;
  /** The region of the whole, if the image is a part, or else the image's largest possible region. */
  ImageRegion<3> whole;
  /** The mask, with the image's geometry, or null. */
  const Image<unsigned char, 3> * mask{ nullptr };
  /** The number of slabs along z in which the image comes into memory. With more than one, the engine keeps nothing. */
  SizeValueType streamDivisions{ 1 };
  /** Makes image and mask buffer these slices and, if there is one, the slice before them. They stay in memory until
   * the next call. */
  std::function<void(const SliceRange & slices)> load{};
};

/** Which samples count, and how they change: see the parameters of ShearWarpMIPBaseImageFilter. */
template <typename TPixel>
struct ShearWarpMIP_EXPORT ProjectionRule
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

  /** Returns whether a ray's value is the maximum of all its samples, apart from a mask. */
  bool
  IsPlainMaximum() const;

  /** Returns whether only a part of view space or of physical space counts. */
  bool
  HasRegion() const;

  /** Throws ExceptionObject, with the value, if a number is outside of its range or not a number. */
  void
  Verify() const;
};

/** The memory for a view's pixels, row by row. */
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
 * The engine contains all code that touches voxels. This code is compiled only in the library, so its bits do not
 * depend on the program that includes this header.
 *
 * The engine keeps the prepared image until the image changes, and keeps its memory. Only one thread at a time may use
 * it.
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

  /** Projects \a volume to the pictures of \a views on the grid \a grid. Views with the same principal axis are
   * projected together: at most 256, and as many as fit into \a intermediateMemory bytes. \a getPicture(n) returns the
   * memory of view n before the engine writes it. Throws the exceptions of the functions that it gets, and
   * MemoryAllocationError. Like all functions here, it throws ExceptionObject if the environment variable
   * SHEARWARPMIP_INSTRUCTION_SET names an instruction set that this computer does not have. */
  void
  Project(const VolumeType &                                volume,
          const ShearWarp::ViewList &                       views,
          const ImageBase<2> *                              grid,
          unsigned int                                      oversampling,
          const RuleType &                                  rule,
          SizeValueType                                     intermediateMemory,
          const std::function<PictureType(SizeValueType)> & getPicture,
          const ShearWarp::Threads &                        threads);

  /** Projects \a volume, a part of an image, to the intermediate image of \a factorization, which must be for this
   * part. The pixels go to \a getPixels(), row by row. Pixels without a sample have the lowest value, or minus
   * infinity. */
  void
  ProjectPart(const VolumeType &                              volume,
              const ShearWarpFactorization &                  factorization,
              ShearWarpMIPImageFilterEnums::ReducedResampling reducedResampling,
              const std::function<TPixel *()> &               getPixels,
              const ShearWarp::Threads &                      threads);

  /** Makes a picture on \a grid from the maxima of the intermediate images of parts. These lie within the intermediate
   * image of the whole, of \a factorization. */
  void
  WarpParts(const std::vector<PartType> &     parts,
            const ShearWarpFactorization &    factorization,
            const ImageBase<2> *              grid,
            TPixel                            background,
            const std::function<TPixel *()> & getPixels,
            const ShearWarp::Threads &        threads);

  /** Returns the measurements of the last projection or picture. */
  const ShearWarp::Measurements &
  GetMeasurements() const
  {
    return m_Measurements;
  }

  /** Frees all memory. */
  void
  Release();

  /** Returns the bytes that the engine holds. */
  SizeValueType
  GetSizeInBytes() const;

  /** Returns the bytes of the copy and of the block maxima of the volume. */
  SizeValueType
  GetPreparedSizeInBytes() const;

private:
  class Implementation;
  ShearWarp::Measurements         m_Measurements;
  std::unique_ptr<Implementation> m_Implementation;
};
} // namespace itk

#endif
