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
#include "PreparedVolume.h"
#include "itkShearWarpEngine.h"
#include "kernels/PixelTypes.h"

#include "TestVolume.h"

#include <functional>
#include <stdexcept>
#include <utility>

/** The engine as a filter drives it. */
namespace
{
using namespace itk::ShearWarp;
using namespace itk::ShearWarpMIPTest;

constexpr Mode              AllModes[] = { Mode::Maximum, Mode::Minimum, Mode::AbsoluteMaximum, Mode::Mean };
constexpr ReducedResampling AllReducedResamplings[] = { ReducedResampling::Off,
                                                        ReducedResampling::On,
                                                        ReducedResampling::Auto };

/** The pictures of all views, one after the other. */
template <typename TPixel>
struct Pictures
{
  std::vector<TPixel> pixels;
  std::vector<float>  depths;

  bool
  operator==(const Pictures & other) const
  {
    return pixels.size() == other.pixels.size() && depths.size() == other.depths.size() &&
           std::memcmp(pixels.data(), other.pixels.data(), pixels.size() * sizeof(TPixel)) == 0 &&
           (depths.empty() || std::memcmp(depths.data(), other.depths.data(), depths.size() * sizeof(float)) == 0);
  }
};

/** A grid that holds the volume, with positions between the intermediate image's pixels and beyond it. */
template <typename TPixel>
Scene
MakeScene(const TestVolume<TPixel> & volume, const std::vector<AffineMap3D> & views, double spacing = 0.73)
{
  Scene scene;
  scene.volume = MakeGrid(volume.box);
  scene.views = views;
  scene.picture = FitGrid(views, scene.volume, { {}, { spacing, spacing }, {} }, true, false, true);
  return scene;
}

/** Runs an update. With several slabs, each comes with the slice before it in memory of its own. */
template <typename TPixel>
Pictures<TPixel>
Project(itk::ShearWarpEngine<TPixel> &    engine,
        const Scene &                     scene,
        const ProjectionRule<TPixel> &    rule,
        const Threads &                   threads,
        const TestVolume<TPixel> &        volume,
        const TestVolume<unsigned char> & mask = {})
{
  const auto       count = static_cast<std::size_t>(scene.picture.size[0] * scene.picture.size[1]);
  Pictures<TPixel> pictures;
  pictures.pixels.assign(count * scene.views.size(), TPixel{ 77 });
  pictures.depths.assign(rule.hasDepth ? pictures.pixels.size() : 0, 77.0f);
  double     progress = 0.0;
  const auto expectProgress = [&] {
    EXPECT_GE(engine.GetProgress(), progress);
    progress = engine.GetProgress();
  };
  std::vector<std::size_t> views;
  engine.Begin(scene, rule, threads);
  EXPECT_EQ(engine.GetProgress(), 0.0);
  for (std::size_t pass = 0; pass < engine.GetNumberOfPasses(); ++pass)
  {
    const auto slabs = engine.BeginPass(pass);
    EXPECT_EQ(slabs.size(), scene.slabs);
    for (const SliceRange & slab : slabs)
    {
      if (scene.slabs == 1)
      {
        engine.Add(slab, volume.GetVoxels(), rule.hasMask ? mask.GetVoxels() : Voxels<unsigned char>{});
        expectProgress();
        continue;
      }
      VoxelBox box = volume.box;
      box.begin[2] = std::max<std::ptrdiff_t>(slab.begin - 1, 0);
      box.size[2] = slab.end - box.begin[2];
      const auto part = CopyPart(volume, box);
      const auto partOfMask = rule.hasMask ? CopyPart(mask, box) : TestVolume<unsigned char>{};
      engine.Add(slab, part.GetVoxels(), rule.hasMask ? partOfMask.GetVoxels() : Voxels<unsigned char>{});
      expectProgress();
    }
    for (const std::size_t view : engine.GetViews(pass))
    {
      views.push_back(view);
      const Picture<TPixel> picture{ pictures.pixels.data() + view * count,
                                     rule.hasDepth ? pictures.depths.data() + view * count : nullptr };
      rule.isExact ? engine.Refine(view, picture) : engine.Warp(view, picture);
      expectProgress();
    }
  }
  engine.End();
  std::sort(views.begin(), views.end());
  EXPECT_EQ(views.size(), scene.views.size());
  EXPECT_TRUE(std::adjacent_find(views.begin(), views.end()) == views.end()) << "each view once";
  EXPECT_GT(engine.GetProgress(), 0.97);
  EXPECT_LE(engine.GetProgress(), 1.0);
  return pictures;
}

/** Projects a volume from each view with every instruction set, reduced resampling and number of threads, without and
 * with oversampling. All must give the bits of the portable kernels without reduced resampling. Returns the views'
 * smallest and largest skipped fractions. */
template <typename TPixel>
std::pair<double, double>
ExpectTheSameBits(const TestVolume<TPixel> & volume)
{
  std::vector<double> skipped;
  for (const AffineMap3D & view : MakeTestViews())
  {
    SCOPED_TRACE("view " + std::to_string(skipped.size()));
    skipped.push_back(0.0);
    const Scene scene = MakeScene(volume, { view });
    for (const unsigned int oversampling : { 1, 2 })
    {
      itk::ShearWarpEngine<TPixel> engine;
      ProjectionRule<TPixel>       rule;
      rule.oversampling = oversampling;
      rule.background = TPixel{ 7 };
      rule.reducedResampling = ReducedResampling::Off;
      const auto expected = Project(engine, scene, rule, MakeThreads(1), volume);
      ForEachInstructionSet([&](const std::string & name) {
        for (const ReducedResampling reducedResampling : AllReducedResamplings)
        {
          rule.reducedResampling = reducedResampling;
          for (const std::size_t threads : { 1, 2, 5 })
          {
            EXPECT_TRUE(Project(engine, scene, rule, MakeThreads(threads), volume) == expected)
              << name << ", " << reducedResampling << ", " << threads << " threads, oversampling " << oversampling;
            const Measurements & measurements = engine.GetMeasurements();
            EXPECT_EQ(measurements.instructionSet, name);
            EXPECT_GE(measurements.skippedFraction, 0.0);
            EXPECT_LE(measurements.skippedFraction, reducedResampling == ReducedResampling::Off ? 0.0 : 1.0);
            skipped.back() = std::max(skipped.back(), measurements.skippedFraction);
          }
        }
      });
    }
  }
  return { *std::min_element(skipped.begin(), skipped.end()), *std::max_element(skipped.begin(), skipped.end()) };
}

template <typename TPixel>
using Change = std::function<void(ProjectionRule<TPixel> &)>;

/** Rules of all features. */
template <typename TPixel>
const Change<TPixel> Features[] = { [](ProjectionRule<TPixel> &) {},
                                    [](ProjectionRule<TPixel> & rule) { rule.hasDepth = true; },
                                    [](ProjectionRule<TPixel> & rule) {
                                      rule.slabNear = 5.3;
                                      rule.slabFar = 30.7;
                                      rule.cropUpper[1] = 17.4;
                                    },
                                    [](ProjectionRule<TPixel> & rule) {
                                      rule.hasMask = true;
                                      rule.maskLabel = 2;
                                      rule.hasDepth = true;
                                    },
                                    [](ProjectionRule<TPixel> & rule) {
                                      rule.depthAttenuation = 0.013;
                                      rule.hasMask = true;
                                      rule.cropLower[0] = 3.25;
                                    },
                                    [](ProjectionRule<TPixel> & rule) {
                                      rule.localMaximumThreshold = TPixel{ 40 };
                                      rule.hasDepth = true;
                                    },
                                    [](ProjectionRule<TPixel> & rule) {
                                      rule.isExact = true;
                                      rule.hasDepth = true;
                                      rule.slabFar = 30.7;
                                    },
                                    [](ProjectionRule<TPixel> & rule) {
                                      rule.interpolation = Interpolation::Nearest;
                                      rule.hasDepth = true;
                                    },
                                    [](ProjectionRule<TPixel> & rule) {
                                      rule.interpolation = Interpolation::Nearest;
                                      rule.hasMask = true;
                                      rule.slabNear = 5.3;
                                    } };

/** A view along z of a volume whose grid is view space: a ray goes through voxel (u + slope[0] z, v + slope[1] z, z),
 * forward or backward. All numbers are multiples of 1/64, so there are no rounding errors. */
struct SlopedView
{
  double slope[2];
  bool   isForward;

  AffineMap3D
  GetMap() const
  {
    const double sign = isForward ? 1.0 : -1.0;
    return { { { 1, 0, sign * slope[0] }, { 0, 1, sign * slope[1] }, { 0, 0, sign } }, { 0, 0, 0 } };
  }
};

/** Returns the picture of a view along z, by the rule of sampling alone. */
template <typename TPixel>
std::vector<TPixel>
Evaluate(const TestVolume<TPixel> & volume,
         const SlopedView &         view,
         const PictureGrid &        grid,
         const SampleRule<TPixel> & rule,
         std::int64_t               oversampling,
         TPixel                     background)
{
  const auto & size = volume.box.size;
  double       translation[2];
  for (int n = 0; n < 2; ++n)
  {
    translation[n] = std::max(0.0, view.slope[n] * static_cast<double>(size[2] - 1));
  }
  const auto round = [&rule](std::int64_t position) { return rule.isNearest ? RoundToWhole(position) : position; };
  const auto intermediate = [&](std::int64_t p, std::int64_t q, TPixel & value) {
    std::vector<RaySample<TPixel>> samples;
    for (std::int64_t n = 0; n < size[2]; ++n)
    {
      const std::int64_t k = view.isForward ? n : size[2] - 1 - n;
      const auto         voxel = [&](std::int64_t i, std::int64_t j) { return volume.At(i, j, k); };
      const auto         place = [&](std::int64_t pixel, int axis) {
        const double offset = translation[axis] - view.slope[axis] * static_cast<double>(k);
        return ((pixel + 1) * WholePixel / oversampling - WholePixel) + round(-Quantize(offset));
      };
      TPixel sample{};
      if (SampleSlice(voxel, size[0], size[1], place(p, 0), place(q, 1), sample))
      {
        samples.push_back({ sample, k });
      }
    }
    value = samples.empty() ? TPixel{} : WithoutSignOfZero(ChooseSample(rule, samples).value);
    return !samples.empty();
  };
  std::vector<TPixel> pixels;
  for (double row = 0; row < grid.size[1]; ++row)
  {
    for (double column = 0; column < grid.size[0]; ++column)
    {
      const auto place = [&](double pixel, int axis) {
        const double sheared = grid.origin[axis] + pixel * grid.spacing[axis] + translation[axis];
        return round(Quantize(static_cast<double>(oversampling) * (sheared + 1) - 1));
      };
      pixels.push_back(InterpolateReached(intermediate, place(column, 0), place(row, 1), background));
    }
  }
  return pixels;
}

template <typename TPixel>
bool
IsPossibleInParts(const ProjectionRule<TPixel> & rule)
{
  try
  {
    rule.Verify();
    rule.VerifyForParts();
    return true;
  }
  catch (const InvalidParameter &)
  {
    return false;
  }
}

/** Projections of parts, and some of them merged. */
template <typename TPixel>
class PartsOfVolume
{
public:
  using EngineType = itk::ShearWarpEngine<TPixel>;

  PartsOfVolume(const Scene & scene, const ProjectionRule<TPixel> & rule)
    : m_Scene(scene)
    , m_Rule(rule)
  {}

  void
  Add(EngineType & engine, const TestVolume<TPixel> & part)
  {
    const auto region = EngineType::FindPart(m_Scene, m_Rule, part.box);
    engine.ProjectPart(m_Scene, m_Rule, part.GetVoxels(), this->Reserve(region), MakeThreads(2));
  }

  /** Merges every second part to one. */
  void
  MergeHalf()
  {
    std::vector<IntermediatePart> half, others;
    for (std::size_t n = 0; n < m_Parts.size(); ++n)
    {
      (n % 2 == 0 ? half : others).push_back(m_Parts[n]);
    }
    const auto region = EngineType::FindPart(m_Scene, m_Rule, GetWholeBox(m_Scene.volume));
    m_Parts = std::move(others);
    EngineType::MergeParts(m_Rule, half, region, this->Reserve(region), MakeThreads(2));
  }

  const std::vector<IntermediatePart> &
  Get() const
  {
    return m_Parts;
  }

private:
  unsigned char *
  Reserve(const IntermediateRegion & region)
  {
    m_Memory.emplace_back(region.columns * region.rows * EngineType::GetRecordSize(m_Rule), 77);
    m_Parts.push_back({ m_Memory.back().data(), region });
    return m_Memory.back().data();
  }

  const Scene &                           m_Scene;
  const ProjectionRule<TPixel> &          m_Rule;
  std::vector<std::vector<unsigned char>> m_Memory;
  std::vector<IntermediatePart>           m_Parts;
};

template <typename TPixel>
class ShearWarpEngineTyped : public testing::Test
{};
using PixelTypes = testing::Types<SHEARWARP_PIXEL_TYPES>;
TYPED_TEST_SUITE(ShearWarpEngineTyped, PixelTypes, );
} // namespace

TYPED_TEST(ShearWarpEngineTyped, FollowsTheRuleOfSampling)
{
  Random random(607);
  for (int repeat = 0; repeat < 60; ++repeat)
  {
    SCOPED_TRACE(repeat);
    const auto length = [&random] { return static_cast<std::ptrdiff_t>(random.Integer(1, 12)); };
    const auto volume = MakeRandomVolume<TypeParam>(random, { length(), length(), length() });
    const auto part = [&random](std::int64_t limit) { return static_cast<double>(random.Integer(-limit, limit)) / 64; };
    const SlopedView          view{ { part(64), part(64) }, repeat % 2 == 0 };
    Scene                     scene = MakeScene(volume, { view.GetMap() });
    ProjectionRule<TypeParam> rule;
    SampleRule<TypeParam>     sampleRule;
    scene.picture = { { 20, 18 }, { 1 + part(40), 1 + part(40) }, { part(400), part(400) } };
    rule.mode = AllModes[repeat % std::size(AllModes)];
    rule.oversampling = repeat % 3 == 0 ? 2 : 1;
    rule.background = MakeRandomPixel<TypeParam>(random);
    sampleRule.mode = static_cast<RayMode>(rule.mode);
    if (HasFeature(rule.mode, Feature::LocalMaximum) && repeat % 5 < 2)
    {
      sampleRule.isLocal = true;
      sampleRule.threshold = MakeRandomPixel<TypeParam>(random);
      rule.localMaximumThreshold = sampleRule.threshold;
    }
    if (rule.oversampling == 1 && HasFeature(rule.mode, Feature::Nearest) && repeat % 7 < 3)
    {
      sampleRule.isNearest = true;
      rule.interpolation = Interpolation::Nearest;
    }
    itk::ShearWarpEngine<TypeParam> engine;
    const auto                      pictures = Project(engine, scene, rule, MakeThreads(1 + repeat % 3), volume);
    EXPECT_EQ(engine.GetMeasurements().principalAxis, 2u);
    const auto expected = Evaluate(volume, view, scene.picture, sampleRule, rule.oversampling, rule.background);
    const auto [wanted, pixel] =
      std::mismatch(expected.begin(), expected.end(), pictures.pixels.begin(), HaveSameBits<TypeParam>);
    EXPECT_TRUE(wanted == expected.end())
      << rule.mode << ", oversampling " << rule.oversampling << ": pixel " << wanted - expected.begin() << " is "
      << +*pixel << " instead of " << +*wanted;
  }
}

TYPED_TEST(ShearWarpEngineTyped, NoiseGivesTheSameBitsHoweverItIsProjected)
{
  Random random(601);
  for (const TestSize & size : { TestSize{ 129, 77, 45 }, { 35, 90, 61 }, { 5, 33, 70 } })
  {
    ExpectTheSameBits(MakeRandomVolume<TypeParam>(random, size));
  }
}

TYPED_TEST(ShearWarpEngineTyped, FewBrightVoxelsGiveTheSameBitsHoweverTheyAreProjected)
{
  Random random(602);
  auto   volume = MakeVolume<TypeParam>({ 129, 77, 45 }, 3);
  for (int n = 0; n < 60; ++n)
  {
    volume.pixels[random.Integer(0, 129 * 77 * 45 - 1)] = static_cast<TypeParam>(random.Integer(4, 120));
  }
  EXPECT_GT(ExpectTheSameBits(volume).first, 0.1);
}

TYPED_TEST(ShearWarpEngineTyped, AConstantVolumeIsSkippedButForTheFirstSlices)
{
  EXPECT_GT(ExpectTheSameBits(MakeVolume<TypeParam>({ 96, 80, 128 }, 9)).first, 0.5);
}

TYPED_TEST(ShearWarpEngineTyped, EveryFeatureGivesTheSameBitsHoweverItIsProjected)
{
  Random     random(608);
  const auto volume = MakeRandomVolume<TypeParam>(random, { 30, 22, 33 });
  auto       mask = MakeVolume<unsigned char>({ 30, 22, 33 });
  std::generate(mask.pixels.begin(), mask.pixels.end(), [&random] { return random.Integer(0, 2); });
  const auto views = MakeTestViews();
  // cppcheck does not understand an element of a variable template
  const auto & features = Features<TypeParam>;
  for (std::size_t feature = 0; feature < std::size(features); ++feature)
  {
    for (const Mode mode : AllModes)
    {
      ProjectionRule<TypeParam> rule;
      features[feature](rule);
      rule.mode = mode;
      rule.background = TypeParam{ 7 };
      if (rule.hasDepth && !HasFeature(mode, Feature::Depth))
      {
        EXPECT_THROW(rule.Verify(), InvalidParameter);
        rule.hasDepth = false;
      }
      const bool isNearest = rule.interpolation == Interpolation::Nearest;
      if ((rule.localMaximumThreshold && !HasFeature(mode, Feature::LocalMaximum)) ||
          (rule.isExact && !HasFeature(mode, Feature::Exact)) || (isNearest && !HasFeature(mode, Feature::Nearest)))
      {
        EXPECT_THROW(rule.Verify(), InvalidParameter);
        continue;
      }
      rule.oversampling = rule.isExact || isNearest || feature % 2 == 0 ? 1 : 2;
      EXPECT_NO_THROW(rule.Verify());
      SCOPED_TRACE(testing::Message() << "feature " << feature << ", " << mode);
      // each view alone, by one thread
      Scene               scene = MakeScene(volume, views);
      Pictures<TypeParam> expected;
      for (const AffineMap3D & view : views)
      {
        itk::ShearWarpEngine<TypeParam> engine;
        Scene                           alone = scene;
        alone.views = { view };
        const auto picture = Project(engine, alone, rule, MakeThreads(1), volume, mask);
        expected.pixels.insert(expected.pixels.end(), picture.pixels.begin(), picture.pixels.end());
        expected.depths.insert(expected.depths.end(), picture.depths.begin(), picture.depths.end());
      }
      ForEachInstructionSet([&](const std::string & name) {
        for (const std::size_t slabs : { 1, 3 })
        {
          scene.slabs = slabs;
          scene.intermediateMemory = slabs == 1 ? std::size_t{ 1 } << 30 : 1;
          itk::ShearWarpEngine<TypeParam> engine;
          EXPECT_TRUE(Project(engine, scene, rule, MakeThreads(3), volume, mask) == expected)
            << name << ", " << slabs << " slabs";
          // of a prepared volume
          EXPECT_TRUE(slabs > 1 || Project(engine, scene, rule, MakeThreads(1), volume, mask) == expected) << name;
          EXPECT_EQ(engine.GetSizeInBytes() == 0, slabs > 1);
          engine.Release();
          EXPECT_EQ(engine.GetSizeInBytes(), 0u);
        }
      });
    }
  }
}

/** Every third case has boxes that share a second voxel, which only extrema allow. Half of the parts are merged before.
 * In a lattice, many samples of a ray are equal. */
TYPED_TEST(ShearWarpEngineTyped, PartsGiveTheBitsOfTheWhole)
{
  Random     random(609);
  const auto noise = MakeRandomVolume<TypeParam>(random, { 41, 35, 28 });
  auto       lattice = noise;
  std::generate(lattice.pixels.begin(), lattice.pixels.end(), [&random] { return random.Integer(0, 9) / 8; });
  int repeat = 0;
  for (const AffineMap3D & view : MakeTestViews())
  {
    for (const Change<TypeParam> & change : Features<TypeParam>)
    {
      for (const Mode mode : AllModes)
      {
        ProjectionRule<TypeParam> rule;
        rule.background = TypeParam{ 7 };
        rule.mode = mode;
        change(rule);
        const bool isPlain = rule.interpolation == Interpolation::Linear && !rule.isExact;
        rule.oversampling = isPlain ? static_cast<unsigned int>(random.Integer(1, 2)) : 1;
        if (!IsPossibleInParts(rule))
        {
          continue;
        }
        ++repeat;
        SCOPED_TRACE("case " + std::to_string(repeat));
        const auto &                    volume = repeat % 2 == 0 ? noise : lattice;
        const Scene                     scene = MakeScene(volume, { view });
        itk::ShearWarpEngine<TypeParam> engine;
        const auto                      expected = Project(engine, scene, rule, MakeThreads(1), volume);
        Pictures<TypeParam>             picture{ std::vector<TypeParam>(expected.pixels.size()),
                                     std::vector<float>(expected.depths.size()) };
        PartsOfVolume<TypeParam>        parts(scene, rule);
        const int                       thinnest = random.Integer(0, 3) == 0 ? 1 : 3;
        for (VoxelBox box : DrawParts(random, volume.box, thinnest, 20))
        {
          const auto axis = static_cast<unsigned int>(random.Integer(0, 2));
          if (repeat % 3 == 0 && mode != Mode::Mean && box.begin[axis] > 0)
          {
            --box.begin[axis];
            ++box.size[axis];
          }
          parts.Add(engine, CopyPart(volume, box));
          EXPECT_GT(engine.GetProgress(), 0.9);
        }
        parts.MergeHalf();
        engine.WarpParts(scene,
                         rule,
                         parts.Get(),
                         { picture.pixels.data(), rule.hasDepth ? picture.depths.data() : nullptr },
                         MakeThreads(3));
        EXPECT_TRUE(picture == expected) << "mode " << mode << ", exact " << rule.isExact << ", depth " << rule.hasDepth
                                         << ", region " << rule.HasRegion() << ", oversampling " << rule.oversampling;
      }
    }
  }
}

/** Records of a file can be anything. Sanitizers tell if arithmetic goes wrong. */
TYPED_TEST(ShearWarpEngineTyped, AnyRecordsGiveAPicture)
{
  using EngineType = itk::ShearWarpEngine<TypeParam>;
  Random     random(614);
  const auto volume = MakeRandomVolume<TypeParam>(random, { 9, 8, 7 });
  const auto scene = MakeScene(volume, { MakeTurn(0.3, 0.5, 0.1) });
  for (const Change<TypeParam> & change : Features<TypeParam>)
  {
    for (const Mode mode : AllModes)
    {
      ProjectionRule<TypeParam> rule;
      rule.mode = mode;
      change(rule);
      if (!IsPossibleInParts(rule))
      {
        continue;
      }
      const auto                 region = EngineType::FindPart(scene, rule, volume.box);
      std::vector<unsigned char> bytes(region.columns * region.rows * EngineType::GetRecordSize(rule));
      std::vector<unsigned char> merged(bytes.size());
      std::generate(bytes.begin(), bytes.end(), [&random] {
        const auto bits = random.Bits();
        return static_cast<unsigned char>(bits % 4 == 0 ? 0 : bits % 4 == 1 ? 0xFF : bits >> 8);
      });
      const IntermediatePart part{ bytes.data(), region };
      EngineType::MergeParts(rule, { part, part }, region, merged.data(), MakeThreads(1));
      const auto             count = static_cast<std::size_t>(scene.picture.size[0] * scene.picture.size[1]);
      std::vector<TypeParam> pixels(count);
      std::vector<float>     depths(count);
      EngineType             engine;
      engine.WarpParts(scene,
                       rule,
                       { part, { merged.data(), region } },
                       { pixels.data(), rule.hasDepth ? depths.data() : nullptr },
                       MakeThreads(1));
      EXPECT_EQ(engine.GetProgress(), 1.0);
    }
  }
}

/** No voxel is better than "no value" then. The background differs. */
TEST(ShearWarpEngine, ExactPartsMayHaveTheWorstValueAlone)
{
  Random random(613);
  for (const Mode mode : { Mode::Maximum, Mode::Minimum, Mode::AbsoluteMaximum })
  {
    const auto                  worst = mode == Mode::Minimum ? std::numeric_limits<short>::max() : NoSample<short>;
    const auto                  volume = MakeVolume<short>({ 7, 5, 17 }, worst);
    itk::ShearWarpEngine<short> engine;
    ProjectionRule<short>       rule;
    rule.mode = mode;
    rule.isExact = true;
    rule.background = 7;
    for (const AffineMap3D & view : MakeTestViews())
    {
      const Scene          scene = MakeScene(volume, { view }, 0.31);
      const auto           expected = Project(engine, scene, rule, MakeThreads(1), volume);
      std::vector<short>   pixels(expected.pixels.size());
      PartsOfVolume<short> parts(scene, rule);
      for (const VoxelBox & box : DrawParts(random, volume.box, 1, 3))
      {
        parts.Add(engine, CopyPart(volume, box));
      }
      engine.WarpParts(scene, rule, parts.Get(), { pixels.data(), nullptr }, MakeThreads(1));
      EXPECT_EQ(pixels, expected.pixels) << mode;
      Scene slabs = scene;
      slabs.slabs = 3;
      EXPECT_TRUE(Project(engine, slabs, rule, MakeThreads(1), volume) == expected) << mode;
    }
  }
}

TEST(ShearWarpEngine, DataWithinHalfTheRangeAndBeyondGiveTheSameBits)
{
  Random random(604);
  auto   volume = MakeVolume<unsigned short>({ 70, 40, 30 });
  for (const auto & [lowest, highest] : std::initializer_list<std::pair<int, int>>{
         { 0, 32767 }, { 0, 32768 }, { 30000, 62767 }, { 32768, 65535 }, { 0, 65535 } })
  {
    for (unsigned short & voxel : volume.pixels)
    {
      // extremes side by side
      const auto choice = random.Integer(0, 3);
      voxel = static_cast<unsigned short>(choice == 0   ? lowest
                                          : choice == 1 ? highest
                                                        : random.Integer(lowest, highest));
    }
    ++volume.version;
    ExpectTheSameBits(volume);
  }
}

TEST(ShearWarpEngine, NotANumberInfinityAndZerosOfBothSignsGiveTheSameBits)
{
  Random          random(605);
  auto            volume = MakeVolume<float>({ 70, 40, 45 });
  constexpr float infinity = std::numeric_limits<float>::infinity();
  constexpr float specials[] = { std::numeric_limits<float>::quiet_NaN(), infinity, -infinity, 0.0f, -0.0f, 1e-40f };
  for (const int rarity : { 3, 300 })
  {
    for (float & voxel : volume.pixels)
    {
      voxel = random.Integer(0, rarity) == 0 ? specials[random.Integer(0, 5)] : -0.5f;
    }
    ++volume.version;
    ExpectTheSameBits(volume);
  }
  // the difference of two voxels overflows: interpolation may exceed both
  for (float & voxel : volume.pixels)
  {
    voxel = random.Integer(0, 1) == 0 ? 3e38f : -3e38f;
  }
  ++volume.version;
  EXPECT_EQ(ExpectTheSameBits(volume).second, 0.0);
}

TEST(ShearWarpEngine, ViewsFromOppositeSidesShareAnIntermediateImage)
{
  Random      random(610);
  const auto  volume = MakeRandomVolume<short>(random, { 30, 31, 32 });
  AffineMap3D opposite = MakeTurn(0.3, 0.5, 0.1);
  const auto  view = opposite;
  for (auto & row : opposite.matrix)
  {
    row[0] = -row[0];
    row[2] = -row[2];
  }
  const auto measure = [&](const std::vector<AffineMap3D> & views, bool hasDepth) {
    itk::ShearWarpEngine<short> engine;
    ProjectionRule<short>       rule;
    rule.reducedResampling = ReducedResampling::Off;
    rule.hasDepth = hasDepth;
    Project(engine, MakeScene(volume, views), rule, MakeThreads(1), volume);
    return engine.GetSizeInBytes() - engine.GetPreparedSizeInBytes();
  };
  EXPECT_EQ(measure({ view, opposite }, false), measure({ view }, false));
  EXPECT_GT(measure({ view, opposite }, true), measure({ view }, true));
  EXPECT_GT(measure({ view, MakeTurn(0.3, 0.5, 0.2) }, false), measure({ view }, false));
}

TEST(ShearWarpEngine, AViewCanBeWarpedAgain)
{
  Random      random(612);
  const auto  volume = MakeRandomVolume<short>(random, { 40, 41, 42 });
  const Scene scene = MakeScene(volume, { MakeTurn(0.1, 0.2, 0), MakeTurn(-0.2, 0.1, 0) });
  const auto  count = static_cast<std::size_t>(scene.picture.size[0] * scene.picture.size[1]);
  for (const Mode mode : AllModes)
  {
    itk::ShearWarpEngine<short> engine;
    ProjectionRule<short>       rule;
    rule.mode = mode;
    engine.Begin(scene, rule, MakeThreads(3));
    ASSERT_EQ(engine.GetNumberOfPasses(), 1u);
    engine.Add(engine.BeginPass(0).front(), volume.GetVoxels(), {});
    std::vector<std::vector<short>> pictures;
    for (const std::size_t view : { 0, 1, 0 })
    {
      pictures.emplace_back(count);
      engine.Warp(view, { pictures.back().data(), nullptr });
    }
    EXPECT_EQ(pictures[0], pictures[2]) << mode;
    EXPECT_NE(pictures[0], pictures[1]) << mode;
  }
}

TEST(ShearWarpEngine, SecondViewsPrepareTheVolume)
{
  Random                      random(611);
  auto                        volume = MakeRandomVolume<short>(random, { 40, 41, 42 });
  itk::ShearWarpEngine<short> engine;
  const Scene                 scene = MakeScene(volume, { MakeTurn(0, 1.5, 0) });
  const auto                  project = [&] { return Project(engine, scene, {}, MakeThreads(1), volume); };
  const auto                  expected = project();
  EXPECT_EQ(engine.GetMeasurements().principalAxis, 0u);
  EXPECT_EQ(engine.GetPreparedSizeInBytes(), 0u);
  EXPECT_TRUE(project() == expected);
  EXPECT_EQ(engine.GetPreparedSizeInBytes(), sizeof(short) * (40 * 41 * 42 + 5 * 6 * 6));
  EXPECT_GT(engine.GetMeasurements().preparationSeconds, 0.0);
  EXPECT_TRUE(project() == expected);
  EXPECT_EQ(engine.GetMeasurements().preparationSeconds, 0.0);
  // the same memory, other voxels
  volume.pixels = MakeRandomVolume<short>(random, { 40, 41, 42 }).pixels;
  ++volume.version;
  const auto changed = project();
  EXPECT_FALSE(changed == expected);
  engine.Release();
  EXPECT_EQ(engine.GetSizeInBytes(), 0u);
  EXPECT_TRUE(project() == changed);
}

TEST(ShearWarpEngine, InvalidParametersAreErrorsAtTheDoor)
{
  using Engine = itk::ShearWarpEngine<short>;
  Engine     engine;
  const auto volume = MakeVolume<short>({ 6, 5, 4 }, 3);
  const auto view = MakeTurn(0.1, 0.2, 0.3);
  Scene      scene = MakeScene(volume, { view });
  const auto expected = Project(engine, scene, {}, MakeThreads(1), volume);
  const auto expectInvalid = [](const auto & call, const std::string & text) {
    try
    {
      call();
      ADD_FAILURE() << "no exception";
    }
    catch (const InvalidParameter & error)
    {
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    }
  };
  const auto begin = [&] { engine.Begin(scene, {}, MakeThreads(1)); };
  scene.views = { view, { { { 1, 0, 0 }, { 0, 1, 0 }, { 3.25, 0, 0 } }, { 0, 0, 0 } } };
  expectInvalid(begin, "3.25");
  scene.views = { view };
  SetEnvironment("SHEARWARPMIP_INSTRUCTION_SET", "abacus");
  expectInvalid(begin, "abacus");
  SetEnvironment("SHEARWARPMIP_INSTRUCTION_SET", "");
  const auto findPart = [&](const VoxelBox & box) { return [&scene, box] { Engine::FindPart(scene, {}, box); }; };
  expectInvalid(findPart({ { 0, 0, 0 }, { 6, 5, 5 } }), "axis 2 it begins at 0 and has 5 voxels of 4");
  expectInvalid(findPart({ { 0, -1, 0 }, { 6, 3, 4 } }), "axis 1 it begins at -1 and has 3 voxels of 5");
  expectInvalid(findPart({ { 2, 0, 0 }, { 0, 5, 4 } }), "axis 0 it begins at 2 and has 0 voxels of 6");
  expectInvalid(findPart({ { 0, 0, std::numeric_limits<std::ptrdiff_t>::max() - 1 }, { 6, 5, 4 } }),
                "axis 2 it begins");
  EXPECT_TRUE(Project(engine, scene, {}, MakeThreads(1), volume) == expected);
}

TEST(ShearWarpEngine, ATaskThatThrowsLeavesTheEngineUsable)
{
  Random     random(612);
  const auto volume = MakeRandomVolume<short>(random, { 30, 25, 40 });
  for (const double angle : { 0.1, 1.5 })
  {
    for (const bool isExact : { false, true })
    {
      const Scene           scene = MakeScene(volume, { MakeTurn(0, angle, 0), MakeTurn(0.1, angle, 0) });
      ProjectionRule<short> rule;
      rule.isExact = isExact;
      rule.oversampling = isExact ? 1 : 2;
      itk::ShearWarpEngine<short> fresh;
      const auto                  expected = Project(fresh, scene, rule, MakeThreads(1), volume);
      itk::ShearWarpEngine<short> engine;
      bool                        hasThrown = true;
      int                         calls = 0;
      for (int last = 0; hasThrown; last += 1 + last / 2)
      {
        hasThrown = false;
        calls = 0;
        Threads threads = MakeThreads(1 + last % 2 * 2);
        threads.run = [&, run = threads.run](std::size_t count, std::size_t steps, const Task & task) {
          const bool isLast = calls++ == last;
          run(count, steps, [&](std::size_t n, std::size_t step, std::size_t worker) {
            task(n, step, worker);
            if (isLast && n + 1 >= count / 2)
            {
              throw std::runtime_error("stopped");
            }
          });
        };
        try
        {
          Project(engine, scene, rule, threads, volume);
        }
        catch (const std::runtime_error & error)
        {
          EXPECT_STREQ(error.what(), "stopped");
          hasThrown = true;
        }
        EXPECT_TRUE(Project(engine, scene, rule, MakeThreads(1), volume) == expected) << last;
      }
      EXPECT_GT(calls, 3);
    }
  }
}
