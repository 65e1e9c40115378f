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
#include "Exact.h"
#include "PreparedVolume.h"
#include "kernels/PixelTypes.h"

#include "TestVolume.h"

namespace
{
using namespace itk::ShearWarpMIPTest;
namespace Kernels = itk::ShearWarp;

template <typename TPixel>
class ShearWarpExactKernels : public testing::Test
{};
using PixelTypes = testing::Types<SHEARWARP_PIXEL_TYPES>;
TYPED_TEST_SUITE(ShearWarpExactKernels, PixelTypes, );

/** Rays of a tile, some in each cell, or in the corners of cells. */
template <typename TPixel>
struct RandomTile
{
  RandomTile(Random & random, const Kernels::ExactView<TPixel> & view, bool isInCorners)
    : column(random.Integer(-40, view.slices.columns + 40))
    , row(random.Integer(-20, view.slices.rows + 20))
  {
    constexpr double fractions[] = { 0.0, 0.5, 0.25, 1.0 - 0x1p-40 };
    const auto       place = [&](double low) {
      const auto choice = isInCorners ? 3 * random.Integer(0, 1) : random.Integer(0, 7);
      return low + (choice < 4 ? fractions[choice] : random.Uniform(0, 1));
    };
    for (std::ptrdiff_t cell = 0; cell < Kernels::CellRows * Kernels::CellColumns; ++cell)
    {
      cellBegins.push_back(static_cast<std::int32_t>(p.size()));
      for (auto count = random.Integer(0, 4) / 2; count > 0; --count)
      {
        cells.push_back(static_cast<std::uint16_t>(cell));
        p.push_back(place(static_cast<double>(column + cell % Kernels::CellColumns)));
        const std::ptrdiff_t cellRow = cell / Kernels::CellColumns;
        q.push_back(place(static_cast<double>(row + cellRow)));
        const double last = static_cast<double>(view.slices.slices) - 0.5;
        const double ends[] = { random.Uniform(-0.5, last), random.Uniform(-0.5, last) };
        const bool   isWhole = random.Integer(0, 2) > 0;
        begin.push_back(isWhole ? -0.5 : std::min(ends[0], ends[1]));
        end.push_back(isWhole ? last : std::max(ends[0], ends[1]));
      }
    }
    cellBegins.push_back(static_cast<std::int32_t>(p.size()));
    least.resize(Kernels::CellRows * Kernels::CellColumns);
    leastLevels.resize(least.size());
  }

  /** Without any value yet. */
  Kernels::RayPatch<TPixel>
  Get(bool isMinimum, bool hasDepth, bool isBackward)
  {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    best.assign(p.size(), static_cast<Kernels::ExactNumber<TPixel>>(-infinity));
    places.assign(p.size(), isBackward ? -infinity : infinity);
    return { column,   row,          isMinimum,  hasDepth,    cellBegins.data(), cells.data(), p.data(),
             q.data(), begin.data(), end.data(), best.data(), places.data(),     least.data(), leastLevels.data() };
  }

  std::ptrdiff_t                            column, row;
  std::vector<std::int32_t>                 cellBegins;
  std::vector<std::uint16_t>                cells;
  std::vector<double>                       p, q, begin, end, places;
  std::vector<Kernels::ExactNumber<TPixel>> best;
  std::vector<TPixel>                       least;
  std::vector<std::int16_t>                 leastLevels;
};

constexpr std::int64_t AnyVoxels = 0;
constexpr std::int64_t FewLargeVoxels = 2;

template <typename TPixel>
std::vector<TPixel>
MakeVoxelsForBounds(Random & random, std::size_t count, std::int64_t kind)
{
  using Limits = std::numeric_limits<TPixel>;
  std::vector<TPixel> voxels(count);
  const auto          rare = random.Integer(2, 60);
  const auto          limit = std::min(1e18, static_cast<double>(Limits::max()));
  const auto          large = static_cast<TPixel>(random.Integer(0, 1) == 0 ? 100.0 : limit);
  for (TPixel & voxel : voxels)
  {
    const bool isRare = random.Integer(0, rare) == 0;
    const auto few = static_cast<TPixel>(random.Integer(0, 3));
    voxel = kind == AnyVoxels        ? MakeRandomPixel<TPixel>(random)
            : kind == 1              ? few
            : kind == FewLargeVoxels ? static_cast<TPixel>(isRare ? large : 0)
            : kind == 3              ? (isRare ? Limits::max() : static_cast<TPixel>(Limits::max() - few))
            : kind == 4              ? (isRare ? static_cast<TPixel>(Limits::lowest() + few) : Limits::lowest())
                                     : static_cast<TPixel>(random.Integer(0, 127));
    if (std::is_floating_point_v<TPixel> && (std::abs(static_cast<double>(voxel)) > 1e30 || (isRare && kind == 5)))
    {
      voxel = kind == 5 ? Limits::quiet_NaN() : static_cast<TPixel>(few);
    }
  }
  return voxels;
}

/** Slices that differ by at most 3, so that bounds must not be too low by one; with \a isNarrow they have two thirds of
 * the type's range. */
template <typename TPixel>
std::vector<TPixel>
MakeAlikeSlices(Random & random, std::size_t pixels, std::size_t slices, bool isNarrow)
{
  auto voxels = MakeVoxelsForBounds<TPixel>(random, pixels, AnyVoxels);
  for (std::size_t n = 0; isNarrow && n < pixels; ++n)
  {
    voxels[n] = static_cast<TPixel>(voxels[n] - voxels[n] / 3);
  }
  while (voxels.size() < pixels * slices)
  {
    const TPixel first = voxels[voxels.size() % pixels];
    voxels.push_back(static_cast<TPixel>(first > 3 ? first - static_cast<TPixel>(random.Integer(0, 3)) : first));
  }
  return voxels;
}
} // namespace

/** All parts of all rays have the maxima, bit by bit, that are found where bounds leave parts out. */
TYPED_TEST(ShearWarpExactKernels, BoundsExcludeNothingBetter)
{
  using Number = Kernels::ExactNumber<TypeParam>;
  Random random(2408);
  for (int repeat = 0; repeat < 60; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto columns = random.Integer(1, repeat % 2 == 0 ? 90 : 9);
    const auto rows = random.Integer(1, repeat % 2 == 0 ? 40 : 9);
    const auto slices = random.Integer(1, 20);
    // large voxels that rays touch by 1e-7 of a voxel
    const bool touches = repeat % 4 == 2;
    const bool isAlike = repeat % 4 == 0;
    const auto voxels = isAlike ? MakeAlikeSlices<TypeParam>(random, columns * rows, slices, repeat % 8 == 4)
                                : MakeVoxelsForBounds<TypeParam>(
                                    random, columns * rows * slices, touches ? FewLargeVoxels : random.Integer(0, 5));
    Kernels::ExactView<TypeParam> view{};
    constexpr double              shears[] = { 0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1.0 - 0x1p-30, 1e-9 };
    view.slices = { voxels.data(), columns, rows, slices, columns, columns * rows };
    if (random.Integer(0, 1) == 0)
    {
      const auto [low, high] = std::minmax_element(voxels.begin(), voxels.end());
      view.slices.lowest = *low;
      view.slices.highest = *high;
    }
    for (int axis = 0; axis < 2; ++axis)
    {
      const auto choice = random.Integer(0, 15);
      view.shear[axis] = isAlike      ? 0.0
                         : touches    ? (choice < 8 ? 1e-7 : -1e-7)
                         : choice < 8 ? shears[choice]
                                      : random.Uniform(-1, 1);
      const bool isHalf = touches || random.Integer(0, 1) == 0;
      view.translation[axis] = isHalf ? 0.5 * static_cast<double>(random.Integer(0, 40)) : random.Uniform(0, 20);
    }
    view.depth = { 0.0, 0.0, repeat % 3 == 0 ? -1.0 : 1.0, 0.0 };
    RandomTile<TypeParam>            rays(random, view, isAlike);
    std::vector<Kernels::RaySegment> all, some;
    for (std::size_t ray = 0; ray < rays.p.size(); ++ray)
    {
      for (std::int64_t slice = -1; slice < slices; ++slice)
      {
        all.push_back({ static_cast<std::int32_t>(ray), static_cast<std::int32_t>(slice) });
      }
      const double begin = std::floor(random.Uniform(rays.begin[ray], rays.end[ray]));
      some.push_back({ static_cast<std::int32_t>(ray), static_cast<std::int32_t>(begin) });
    }
    const bool isMinimum = random.Integer(0, 1) == 0;
    const bool hasDepth = random.Integer(0, 1) == 0;
    ForEachInstructionSet([&](const std::string &) {
      const auto & kernels = Kernels::GetKernels<TypeParam>();
      const auto   tile = rays.Get(isMinimum, hasDepth, view.depth.perSlice < 0);
      kernels.evaluateSegments(view, tile, all.data(), all.size());
      const std::vector<Number> best = rays.best;
      const std::vector<double> places = rays.places;

      const auto again = rays.Get(isMinimum, hasDepth, view.depth.perSlice < 0);
      kernels.evaluateSegments(view, again, some.data(), some.size());
      for (const std::int64_t begin : { std::int64_t{ 8 }, std::int64_t{ -1 }, std::int64_t{ 16 } })
      {
        kernels.searchLayer(view, again, begin, std::min<std::int64_t>(begin < 0 ? 8 : begin + 8, slices));
      }
      for (std::size_t ray = 0; ray < best.size(); ++ray)
      {
        // but for the sign of zero
        ASSERT_TRUE(rays.best[ray] == best[ray] &&
                    (!hasDepth || std::isinf(best[ray]) || rays.places[ray] == places[ray]))
          << rays.best[ray] << " in " << rays.places[ray] << " instead of " << best[ray] << " in " << places[ray]
          << " at " << rays.p[ray] << ' ' << rays.q[ray] << ", slices " << rays.begin[ray] << " to " << rays.end[ray]
          << ", shear " << view.shear[0] << ' ' << view.shear[1] << " from " << view.translation[0] << ' '
          << view.translation[1] << ", " << columns << " x " << rows << " x " << slices << (isMinimum ? " minimum" : "")
          << (hasDepth ? " depth" : "");
      }
    });
  }
}

/** The picture is the same without ranks and with wrong ones, whether the first or the last slice has rank 1. */
TEST(ShearWarpExactGuess, ChangesNoBit)
{
  Random                         random(2405);
  constexpr std::ptrdiff_t       columns = 37, rows = 29, slices = 23;
  std::vector<short>             voxels(columns * rows * slices);
  const Kernels::VoxelBox        box{ { 0, 0, 0 }, { columns, rows, slices } };
  Kernels::PreparedVolume<short> volume(true);
  const auto &                   kernels = Kernels::GetKernels<short>();
  for (int repeat = 0; repeat < 40; ++repeat)
  {
    std::generate(voxels.begin(), voxels.end(), [&] {
      return static_cast<short>(repeat % 2 == 0 ? random.Integer(0, 3) : random.Integer(-32768, 32767));
    });
    const auto version = static_cast<std::uint64_t>(repeat);
    volume.Prepare({ voxels.data(), box, &voxels, version }, box, 2, true, kernels, RunSerially);
    Kernels::ExactView<short> view;
    view.slices = volume.GetSlices(2);
    view.blocks = volume.GetBlockExtrema(2);
    for (int axis = 0; axis < 2; ++axis)
    {
      view.shear[axis] = random.Uniform(-1, 1);
      view.translation[axis] = std::max(0.0, -view.shear[axis] * (slices - 1));
    }
    view.outputToSheared = { 0.9, 0.1, 0.0, -0.2, 0.8, 5.0 };
    view.depth = { 0.0, 0.0, repeat % 3 == 0 ? -1.0 : 1.0, 0.0 };
    view.background = 7;
    const auto mode = static_cast<Kernels::Mode>(repeat % 3);

    constexpr std::ptrdiff_t          width = 60, height = 50;
    const std::ptrdiff_t              guessColumns = columns + slices, guessRows = rows + slices;
    std::vector<Kernels::ColumnSpan>  reached(guessRows, { 0, static_cast<std::int32_t>(guessColumns) });
    std::vector<std::int32_t>         ranks(guessColumns * guessRows, 0);
    Kernels::IntermediateImage<short> guess{ nullptr, guessColumns, guessRows, guessColumns, reached.data() };
    guess.ranks = ranks.data();
    guess.ranking = repeat % 4 < 2 ? Kernels::Ranking{ 0, 1 } : Kernels::Ranking{ slices - 1, -1 };

    std::vector<short> pixels, expected;
    std::vector<float> depths, expectedDepths;
    for (int n = 0; n < 4; ++n)
    {
      pixels.assign(width * height, 0);
      depths.assign(width * height, 0.0f);
      Kernels::ProjectExactly<short>(
        view, mode, kernels, guess, width, height, { pixels.data(), depths.data() }, RunSerially, RunSerially);
      expected = n == 0 ? pixels : expected;
      expectedDepths = n == 0 ? depths : expectedDepths;
      EXPECT_EQ(pixels, expected);
      EXPECT_EQ(std::memcmp(depths.data(), expectedDepths.data(), depths.size() * sizeof(float)), 0);
      std::generate(
        ranks.begin(), ranks.end(), [&random] { return static_cast<std::int32_t>(random.Integer(-1, slices)); });
    }
    EXPECT_GT(std::count(pixels.begin(), pixels.end(), 7), 0);
  }
}

namespace
{
std::vector<std::int32_t> firstSlices;

/** Evaluates nothing, but keeps the slices where the search begins. */
short
KeepFirstSlices(const Kernels::ExactView<short> &,
                const Kernels::RayPatch<short> &,
                const Kernels::RaySegment * parts,
                std::size_t                 count)
{
  std::for_each(parts, parts + count, [](const auto & part) { firstSlices.push_back(part.slice); });
  return 0;
}
} // namespace

/** The search begins in the slice of the guess, or where the ray begins: without a rank, and without a pixel. */
TEST(ShearWarpExactGuess, TellsWhereTheSearchBegins)
{
  constexpr std::ptrdiff_t  size = 6;
  std::vector<short>        voxels(size * size * size), cubes(1);
  Kernels::Kernels<short>   kernels = Kernels::GetPortableKernels<short>();
  Kernels::ExactView<short> view{};
  view.slices = { voxels.data(), size, size, size, size, size * size };
  view.blocks = { cubes.data(), nullptr, 1, 1, 1, 1, 1, 1 };
  view.outputToSheared = { 1.0, 0.0, 0.0, 0.0, 1.0, 0.0 };
  kernels.evaluateSegments = KeepFirstSlices;
  kernels.searchLayer = [](const auto &, const auto &, std::ptrdiff_t, std::ptrdiff_t) { return short{ 0 }; };

  const std::vector<Kernels::ColumnSpan> reached(size, { 0, 5 });
  const std::vector<std::int32_t>        ranks{ 0, 1, 2, 6, -3, 4 };
  Kernels::IntermediateImage<short>      guess{ nullptr, size, 1, size, reached.data(), ranks.data() };
  std::vector<short>                     pixels(size);
  const auto                             findFirstSlices = [&](const Kernels::Ranking & ranking) {
    firstSlices.clear();
    guess.ranking = ranking;
    Kernels::ProjectExactly<short>(
      view, Kernels::Mode::Maximum, kernels, guess, size, 1, { pixels.data(), nullptr }, RunSerially, RunSerially);
    return firstSlices;
  };
  EXPECT_EQ(findFirstSlices({ 0, 1 }), (std::vector<std::int32_t>{ -1, 0, 1, 5, -1, -1 }));
  EXPECT_EQ(findFirstSlices({ size - 1, -1 }), (std::vector<std::int32_t>{ -1, 5, 4, 0, -1, -1 }));
  EXPECT_EQ(findFirstSlices({ 2, 1 }), (std::vector<std::int32_t>{ -1, 2, 3, -1, -1, -1 }));
}
