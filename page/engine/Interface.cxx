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

/* The functions that a web page calls, without exceptions and without threads. The page calls _initialize() first.
 * Functions that can fail return 0, or 1 if they did not do anything: GetError() then says why. Without memory they
 * trap, and the page has to load the engine anew. */

#include "Buffer.h"
#include "itkShearWarpEngine.h"

#include <cmath>
#include <cstdlib>
#include <memory>
#include <new>
#include <string>
#include <vector>

#define EXPORT(name) extern "C" __attribute__((export_name(#name)))

namespace
{
using namespace itk;
using namespace itk::ShearWarp;

/** Numbers of bytes have 32 bits. */
constexpr double MostBytes = 0x1p31;

std::string errorText;

bool
HasFailed()
{
  return !errorText.empty();
}

struct Request
{
  AffineMap3D view;
  PictureGrid picture;
  Mode        mode;
  double      slabNear, slabFar;
  bool        isExact, hasDepth;
};

/** A volume and its last picture. */
class Volume
{
public:
  Volume() = default;
  Volume(const Volume &) = delete;
  Volume &
  operator=(const Volume &) = delete;
  virtual ~Volume() = default;
  virtual void
  Project(const Request & request) = 0;
  virtual const void *
  GetPixels() const = 0;
  virtual double
  GetBytes() const = 0;

  const float *
  GetDepths() const
  {
    return m_Depths.data();
  }

protected:
  std::vector<float> m_Depths;
};

std::unique_ptr<Volume> volume;

template <typename TPixel>
class TypedVolume : public Volume
{
public:
  TypedVolume(const VolumeGrid & grid, const void * voxels)
  {
    m_Scene.volume = grid;
    m_Voxels = { static_cast<const TPixel *>(voxels), GetWholeBox(grid), this, 1 };
    m_Threads.run = [](std::size_t count, std::size_t steps, const Task & task) {
      for (std::size_t n = 0; n < count * steps; ++n)
      {
        task(n / steps, n % steps, 0);
      }
    };
  }

  void
  Project(const Request & request) override
  {
    ProjectionRule<TPixel> rule;
    rule.mode = request.mode;
    rule.slabNear = request.slabNear;
    rule.slabFar = request.slabFar;
    rule.isExact = request.isExact;
    rule.hasDepth = request.hasDepth;
    rule.Verify();
    m_Scene.views = { request.view };
    m_Scene.picture = request.picture;
    if (!HasFailed())
    {
      // what Begin() does with maps that are not finite is unknown
      GetOutputToIntermediate(Factorize(request.view, m_Scene.volume), request.picture);
    }
    if (!HasFailed())
    {
      m_Engine.Begin(m_Scene, rule, m_Threads);
    }
    if (HasFailed())
    {
      return;
    }
    const auto count = static_cast<std::size_t>(request.picture.size[0] * request.picture.size[1]);
    m_Pixels.resize(count);
    m_Depths.resize(rule.hasDepth ? count : 0);
    const Picture<TPixel> picture{ m_Pixels.data(), rule.hasDepth ? m_Depths.data() : nullptr };
    for (const SliceRange & slab : m_Engine.BeginPass(0))
    {
      m_Engine.Add(slab, m_Voxels, {});
    }
    rule.isExact ? m_Engine.Refine(0, picture) : m_Engine.Warp(0, picture);
    m_Engine.End();
  }

  const void *
  GetPixels() const override
  {
    return m_Pixels.data();
  }

  double
  GetBytes() const override
  {
    return static_cast<double>(m_Engine.GetSizeInBytes() + CountBytes(m_Pixels) + CountBytes(m_Depths));
  }

private:
  Scene                   m_Scene;
  Voxels<TPixel>          m_Voxels;
  Threads                 m_Threads;
  ShearWarpEngine<TPixel> m_Engine;
  std::vector<TPixel>     m_Pixels;
};

/** Reads three rows of four numbers. */
AffineMap3D
ReadMap(const double * rows)
{
  AffineMap3D map;
  for (int row = 0; row < 3; ++row)
  {
    std::copy_n(rows + 4 * row, 3, map.matrix[row]);
    map.offset[row] = rows[4 * row + 3];
  }
  return map;
}
} // namespace

void
ShearWarp::Fail(const char * message)
{
  errorText = message;
  __builtin_trap();
}

void
ShearWarp::RefuseParameter(const std::string & message)
{
  // what follows the first error may follow from it
  if (!HasFailed())
  {
    errorText = message;
  }
}

// the standard library's own returns null
void *
operator new(std::size_t bytes)
{
  void * memory = std::malloc(bytes);
  if (!memory)
  {
    Fail("There is no memory.");
  }
  return memory;
}

/** Makes a volume the one that is projected. \a bits is 8 or 16. The voxels are unsigned, x contiguous, then y, then z.
 * They stay where they are, as long as the volume is projected. \a toPhysical has three rows of four numbers: indices
 * to physical space, in mm. */
EXPORT(SetVolume)
int
SetVolume(int bits, int columns, int rows, int slices, const double * toPhysical, const void * voxels)
{
  errorText.clear();
  VolumeGrid grid{ { columns, rows, slices }, {}, ReadMap(toPhysical) };
  for (int axis = 0; axis < 3; ++axis)
  {
    const auto & matrix = grid.indexToPhysical.matrix;
    grid.spacing[axis] = std::hypot(matrix[0][axis], matrix[1][axis], matrix[2][axis]);
  }
  VerifyVolumeGrid(grid);
  if (bits != 8 && bits != 16)
  {
    RefuseParameter("Voxels must have 8 or 16 bits, but they have " + std::to_string(bits) + '.');
  }
  if (!(1.0 * columns * rows * slices * bits / 8 <= MostBytes))
  {
    RefuseParameter("A volume must have at most 2^31 bytes.");
  }
  if (!HasFailed())
  {
    volume.reset();
    volume.reset(bits == 8 ? static_cast<Volume *>(new TypedVolume<unsigned char>(grid, voxels))
                           : new TypedVolume<unsigned short>(grid, voxels));
  }
  return HasFailed();
}

/** Projects the volume. \a view has three rows of four numbers: view space (u to the right, v down, w away) to physical
 * space. \a picture has columns, rows, spacing along u and v, u and v of the first pixel. \a mode is 0 for maximum, 1
 * for minimum, 2 for mean. Only samples with w from \a slabNear to \a slabFar count. Pixels without a sample are 0. */
EXPORT(Project)
int
Project(const double * view,
        const double * picture,
        int            mode,
        double         slabNear,
        double         slabFar,
        int            isExact,
        int            hasDepth)
{
  errorText.clear();
  constexpr Mode    modes[] = { Mode::Maximum, Mode::Minimum, Mode::Mean };
  const PictureGrid grid{ { picture[0], picture[1] }, { picture[2], picture[3] }, { picture[4], picture[5] } };
  const AffineMap3D map = ReadMap(view);
  const auto        isWhole = [](double size) { return size >= 1 && size == std::floor(size); };
  if (!volume)
  {
    RefuseParameter("SetVolume() comes before Project().");
  }
  if (mode < 0 || mode > 2)
  {
    RefuseParameter("Mode must be 0, 1 or 2, but it is " + std::to_string(mode) + '.');
  }
  if (!isWhole(grid.size[0]) || !isWhole(grid.size[1]) || !(grid.size[0] * grid.size[1] * sizeof(float) <= MostBytes))
  {
    RefuseParameter("A picture must have a whole number of columns and rows, at least 1 and at most 2^29 pixels.");
  }
  VerifyPictureGrid(grid, false);
  VerifyView(map);
  if (!HasFailed())
  {
    volume->Project({ map, grid, modes[mode], slabNear, slabFar, isExact != 0, hasDepth != 0 });
  }
  return HasFailed();
}

/** Returns the pixels of the last picture, of the voxels' type, row by row. */
EXPORT(GetPixels)
const void *
GetPixels()
{
  return volume ? volume->GetPixels() : nullptr;
}

/** Returns the depths w of the last picture's pixels, if they were wanted. Pixels without a sample have not-a-number.
 */
EXPORT(GetDepths)
const float *
GetDepths()
{
  return volume ? volume->GetDepths() : nullptr;
}

/** Returns the last error as UTF-8 that ends with 0. */
EXPORT(GetError)
const char *
GetError()
{
  return errorText.c_str();
}

/** Returns the bytes that the engine holds beside the voxels. */
EXPORT(GetBytes)
double
GetBytes()
{
  return volume ? volume->GetBytes() : 0.0;
}

// what the standard library would import: there are no files, no environment and no clock
extern "C"
{
  constexpr int BadFile = 8;

  int
  __imported_wasi_snapshot_preview1_environ_get(int, int)
  {
    return 0;
  }

  int
  __imported_wasi_snapshot_preview1_environ_sizes_get(int * count, int * bytes)
  {
    *count = *bytes = 0;
    return 0;
  }

  int
  __imported_wasi_snapshot_preview1_clock_time_get(int, long long, long long * time)
  {
    *time = 0;
    return 0;
  }

  int
  __imported_wasi_snapshot_preview1_fd_close(int)
  {
    return BadFile;
  }

  int
  __imported_wasi_snapshot_preview1_fd_seek(int, long long, int, int)
  {
    return BadFile;
  }

  int
  __imported_wasi_snapshot_preview1_fd_write(int, int, int, int)
  {
    return BadFile;
  }

  void
  __imported_wasi_snapshot_preview1_proc_exit(int)
  {
    __builtin_trap();
  }
}
