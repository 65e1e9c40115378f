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
#include "Projector.h"
#include "kernels/PixelTypes.h"

#include "TestVolume.h"

namespace
{
using namespace itk::ShearWarp;
using namespace itk::ShearWarpMIPTest;

template <typename TPixel>
class ShearWarpProjectorTyped : public testing::Test
{
public:
  /** Returns the intermediate images of all phases, where slices reach them, from \a parts of a volume. */
  static std::vector<TPixel>
  ProjectInParts(const TestVolume<TPixel> &    volume,
                 const AffineMap3D &           view,
                 unsigned int                  oversampling,
                 const std::vector<VoxelBox> & parts)
  {
    const auto &               kernels = GetKernels<TPixel>();
    const Factorization        factorization = Factorize(view, MakeGrid(volume.box), oversampling);
    const auto                 phases = MakePhases(factorization, volume.box, oversampling);
    const unsigned int         axis = factorization.GetPrincipalAxis();
    std::vector<ProjectedView> views(phases.size());
    for (std::size_t n = 0; n < phases.size(); ++n)
    {
      views[n].grid = &phases[n];
    }
    // two threads take turns
    const auto run = [](std::size_t count, std::size_t steps, const Task & task) {
      for (std::size_t n = 0; n < count * steps; ++n)
      {
        task(n / steps, n % steps, n / steps % 2);
      }
    };
    typename Projector<TPixel>::Parameters parameters;
    parameters.reducedResampling = ReducedResampling::On;
    PreparedVolume<TPixel> prepared;
    Projector<TPixel>      projector;
    projector.Begin(views, axis, kernels, parameters, 2);
    for (const VoxelBox & box : parts)
    {
      const TestVolume<TPixel> part = CopyPart(volume, box);
      const SliceRange         slices{ box.begin[2], box.begin[2] + box.size[2] };
      prepared.PreparePiece(part.GetVoxels(), volume.box, slices, axis, true, kernels, run);
      projector.Project(prepared, nullptr, run);
    }
    std::vector<TPixel> pixels;
    for (std::size_t phase = 0; phase < phases.size(); ++phase)
    {
      const auto image = projector.Finish(phase, run);
      for (std::ptrdiff_t row = 0; row < image.rows; ++row)
      {
        const TPixel * begin = image.pixels + row * image.rowStride;
        pixels.insert(pixels.end(), begin + image.reached[row].begin, begin + image.reached[row].end);
      }
    }
    EXPECT_GT(projector.GetSizeInBytes(), 0u);
    projector.Release();
    EXPECT_EQ(projector.GetSizeInBytes(), 0u);
    return pixels;
  }
};

using PixelTypes = testing::Types<SHEARWARP_PIXEL_TYPES>;
TYPED_TEST_SUITE(ShearWarpProjectorTyped, PixelTypes, );
} // namespace

TYPED_TEST(ShearWarpProjectorTyped, PartsOfAVolumeGiveTheBitsOfTheWhole)
{
  Random     random(606);
  const auto volume = MakeRandomVolume<TypeParam>(random, { 61, 45, 38 });
  for (const auto & view : MakeTestViews())
  {
    for (const unsigned int oversampling : { 1, 2 })
    {
      const auto whole = TestFixture::ProjectInParts(volume, view, oversampling, { volume.box });
      const auto parts = DrawParts(random, volume.box, 1, 30);
      ForEachInstructionSet([&](const std::string &) {
        EXPECT_TRUE(TestFixture::ProjectInParts(volume, view, oversampling, parts) == whole);
      });
    }
  }
}
