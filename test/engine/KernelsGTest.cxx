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
#include "kernels/Kernels.h"
#include "kernels/PixelTypes.h"

#include "itkShearWarpMIPTestRule.h"

#include <memory>
#include <optional>

#ifdef __linux__
#  include <sys/mman.h>
#  include <unistd.h>
#endif

namespace
{
namespace Kernels = itk::ShearWarp;
using namespace itk::ShearWarpMIPTest;

constexpr std::ptrdiff_t OddLengths[] = { 1, 2, 3, 17, 31, 33 };
constexpr std::int32_t   Half = Kernels::One / 2;
constexpr std::int32_t   RimFractions[] = { 0, 1, Half - 1, Half, Half + 1, Kernels::One - 1 };
constexpr std::ptrdiff_t Guard = 64;

std::int64_t
ToQuantized(const Kernels::SamplingPosition & position)
{
  return position.whole * WholePixel + position.fraction;
}

/** \class GuardedMemory
 * Memory that ends, and one that begins, at a page that cannot be read: an access outside is a crash. */
class GuardedMemory
{
public:
  explicit GuardedMemory(std::size_t bytes)
    : m_Bytes(bytes)
  {
#ifdef __linux__
    const auto        page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
    const std::size_t pages = (bytes + page - 1) / page;
    m_Mapped = (pages + 2) * page;
    m_Memory = static_cast<char *>(mmap(nullptr, m_Mapped, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    mprotect(m_Memory, page, PROT_NONE);
    mprotect(m_Memory + (pages + 1) * page, page, PROT_NONE);
    m_First = m_Memory + page;
    m_Last = m_Memory + (pages + 1) * page - bytes;
#else
    m_Memory = new char[bytes];
    m_First = m_Last = m_Memory;
#endif
  }
  GuardedMemory(const GuardedMemory &) = delete;
  GuardedMemory &
  operator=(const GuardedMemory &) = delete;
  ~GuardedMemory()
  {
#ifdef __linux__
    munmap(m_Memory, m_Mapped);
#else
    delete[] m_Memory;
#endif
  }

  /** A copy of \a data just behind the first guard, or just before the last one. */
  template <typename TPixel>
  const TPixel *
  Place(const std::vector<TPixel> & data, bool atEnd)
  {
    char * place = atEnd ? m_Last : m_First;
    std::memcpy(place, data.data(), m_Bytes);
    return reinterpret_cast<const TPixel *>(place);
  }

private:
  std::size_t m_Bytes;
  std::size_t m_Mapped{ 0 };
  char *      m_Memory{ nullptr };
  char *      m_First{ nullptr };
  char *      m_Last{ nullptr };
};

/** Nothing has been written before and behind what is in the middle of \a memory. */
template <typename T>
void
ExpectGuards(const std::vector<T> & memory, T untouched)
{
  EXPECT_EQ(std::count(memory.begin(), memory.begin() + Guard, untouched), Guard);
  EXPECT_EQ(std::count(memory.end() - Guard, memory.end(), untouched), Guard);
}

/** The value of a pixel before samples. */
template <typename TPixel>
TPixel
GetStart(Kernels::Extremum extremum)
{
  using Limits = std::numeric_limits<TPixel>;
  const bool   isMinimum = extremum == Kernels::Extremum::Minimum;
  const TPixel finite = isMinimum ? Limits::max() : Limits::lowest();
  const TPixel infinite = isMinimum ? Limits::infinity() : -Limits::infinity();
  return Limits::has_infinity ? infinite : finite;
}

template <typename TPixel>
Kernels::IntermediateImage<TPixel>
MakeImage(TPixel * pixels, std::ptrdiff_t columns, std::ptrdiff_t rows, std::ptrdiff_t rowStride)
{
  Kernels::IntermediateImage<TPixel> image;
  image.pixels = pixels;
  image.columns = columns;
  image.rows = rows;
  image.rowStride = rowStride;
  return image;
}

template <typename TPixel>
std::vector<TPixel>
MakeRandomPixels(Random & random, std::ptrdiff_t count)
{
  std::vector<TPixel> pixels(count);
  std::generate(pixels.begin(), pixels.end(), [&random] { return MakeRandomPixel<TPixel>(random); });
  return pixels;
}

/** The same bits, or both not a number. */
template <typename TPixel>
bool
HaveSameValues(const std::vector<TPixel> & a, const std::vector<TPixel> & b)
{
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](TPixel x, TPixel y) {
    return HaveSameBits(x, y) || (std::isnan(static_cast<double>(x)) && std::isnan(static_cast<double>(y)));
  });
}

/** Warps the whole output, its rows split before column \a split. */
template <typename TPixel>
std::vector<TPixel>
Warp(const std::vector<TPixel> &              pixels,
     const std::vector<Kernels::ColumnSpan> & reached,
     const Kernels::AffineMap2D &             map,
     std::ptrdiff_t                           columns,
     std::ptrdiff_t                           rows,
     TPixel                                   background,
     std::ptrdiff_t                           split)
{
  const auto           intermediateRows = static_cast<std::ptrdiff_t>(reached.size());
  const std::ptrdiff_t intermediateColumns = static_cast<std::ptrdiff_t>(pixels.size()) / intermediateRows;
  GuardedMemory        memory(pixels.size() * sizeof(TPixel));
  const auto *         guarded = memory.Place(pixels, split % 2 == 0);
  auto                 intermediate =
    MakeImage(const_cast<TPixel *>(guarded), intermediateColumns, intermediateRows, intermediateColumns);
  intermediate.reached = reached.data();
  const TPixel        untouched{ 77 };
  std::vector<TPixel> output(Guard + columns * rows + Guard, untouched);
  for (std::ptrdiff_t row = 0; row < rows; ++row)
  {
    TPixel *   pixelsOfRow = output.data() + Guard + row * columns;
    const auto warpRow = Kernels::GetKernels<TPixel>().warpRow;
    warpRow(intermediate, map, row, 0, split, background, pixelsOfRow);
    EXPECT_EQ(std::count(pixelsOfRow + split, pixelsOfRow + columns, untouched), columns - split);
    warpRow(intermediate, map, row, split, columns, background, pixelsOfRow);
  }
  ExpectGuards(output, untouched);
  return { output.begin() + Guard, output.end() - Guard };
}

/** The pixel at (x, y) of 2 x 2 pixels, all of which are reached; the background is 7. */
template <typename TPixel>
TPixel
WarpAt(const std::vector<TPixel> & pixels, double x, double y)
{
  return Warp<TPixel>(pixels, { { 0, 2 }, { 0, 2 } }, { 0, 0, x, 0, 0, y }, 1, 1, 7, 0).front();
}

/** The sum of numbers, in their order. */
template <typename TPixel>
Kernels::SampleSum<TPixel>
SumOf(const std::vector<RaySample<TPixel>> & samples)
{
  Kernels::SampleSum<TPixel> sum{};
  for (const RaySample<TPixel> & sample : samples)
  {
    const TPixel value = sample.value;
    if constexpr (std::is_same_v<TPixel, double>)
    {
      sum.scaled += value / 4294967296.0;
      sum.lowest = std::min(sum.lowest, value);
      sum.highest = std::max(sum.highest, value);
    }
    else if constexpr (std::is_same_v<TPixel, float>)
    {
      sum += static_cast<double>(value);
    }
    else if constexpr (sizeof(TPixel) == 8)
    {
      const auto lower = static_cast<TPixel>(static_cast<std::uint64_t>(value) % 4294967296U);
      sum.lower += static_cast<std::uint64_t>(lower);
      sum.upper += (value - lower) / static_cast<TPixel>(4294967296);
    }
    else
    {
      sum = static_cast<Kernels::SampleSum<TPixel>>(sum + value);
    }
  }
  return sum;
}

/** \class SlicesFixture
 * A stack with padded rows and slices, but for the last, and random placements. The padding would win.
 */
template <typename TPixel>
class SlicesFixture
{
public:
  SlicesFixture(Random & random, std::ptrdiff_t sliceColumns, std::ptrdiff_t sliceRows, std::ptrdiff_t slices)
  {
    m_Stack.columns = sliceColumns;
    m_Stack.rows = sliceRows;
    m_Stack.slices = slices;
    // slices one after the other, or side by side
    m_Stack.rowStride = sliceColumns + 3;
    m_Stack.sliceStride = m_Stack.rowStride * (sliceRows + 2);
    if (random.Integer(0, 1) == 0)
    {
      m_Stack.sliceStride = sliceColumns + 1;
      m_Stack.rowStride = m_Stack.sliceStride * slices;
    }
    m_Voxels.assign((slices - 1) * m_Stack.sliceStride + (sliceRows - 1) * m_Stack.rowStride + sliceColumns,
                    std::numeric_limits<TPixel>::max());
    m_Memory = std::make_unique<GuardedMemory>(m_Voxels.size() * sizeof(TPixel));
    this->Fill([&random](std::ptrdiff_t) { return MakeRandomPixel<TPixel>(random); });
    m_Placements.resize(slices);
  }

  template <typename TFunction>
  void
  Fill(const TFunction & value)
  {
    std::ptrdiff_t n = 0;
    bool           isFirst = true;
    for (std::ptrdiff_t k = 0; k < m_Stack.slices; ++k)
    {
      for (std::ptrdiff_t j = 0; j < m_Stack.rows; ++j)
      {
        for (std::ptrdiff_t i = 0; i < m_Stack.columns; ++i)
        {
          TPixel & voxel = m_Voxels[k * m_Stack.sliceStride + j * m_Stack.rowStride + i];
          voxel = value(n++);
          isFirst = n == 1;
          m_Stack.lowest = isFirst || voxel < m_Stack.lowest ? voxel : m_Stack.lowest;
          m_Stack.highest = isFirst || voxel > m_Stack.highest ? voxel : m_Stack.highest;
        }
      }
    }
  }

  /** Gives what is between rows and slices a value that no sample may have. */
  void
  FillPadding(TPixel value)
  {
    std::vector<TPixel> padded(m_Voxels.size(), value);
    for (std::ptrdiff_t k = 0; k < m_Stack.slices; ++k)
    {
      for (std::ptrdiff_t j = 0; j < m_Stack.rows; ++j)
      {
        const std::ptrdiff_t first = k * m_Stack.sliceStride + j * m_Stack.rowStride;
        std::copy_n(m_Voxels.begin() + first, m_Stack.columns, padded.begin() + first);
      }
    }
    m_Voxels = std::move(padded);
  }

  void
  Place(std::ptrdiff_t slice, std::int64_t column, std::int64_t row)
  {
    const auto position = [](std::int64_t quantized) {
      return Kernels::SamplingPosition{ static_cast<std::int32_t>(quantized >> 15),
                                        static_cast<std::int32_t>(quantized & (Kernels::One - 1)) };
    };
    m_Placements[slice] = { position(column), position(row) };
  }

  /** Each slice at a column and a row that \a draw gives. */
  template <typename TDraw>
  void
  PlaceEach(const TDraw & draw)
  {
    for (std::ptrdiff_t k = 0; k < m_Stack.slices; ++k)
    {
      const std::int64_t column = draw();
      this->Place(k, column, draw());
    }
  }

  /** Projects with the chosen instruction set, in blocks that begin at \a rowSplits and \a sliceSplits, and \a views
   * times in one list; checks that nothing outside the image's columns is written. \a active marks tiles of the whole.
   */
  std::vector<TPixel>
  Project(std::vector<std::ptrdiff_t> rowSplits = {},
          std::vector<std::ptrdiff_t> sliceSplits = {},
          std::size_t                 views = 1,
          bool                        atEnd = true)
  {
    std::int32_t lastColumn = 0;
    std::int32_t lastRow = 0;
    for (const auto & placement : m_Placements)
    {
      lastColumn = std::max(lastColumn, placement.FirstColumn());
      lastRow = std::max(lastRow, placement.FirstRow());
    }
    columns = m_Stack.columns + lastColumn;
    rows = m_Stack.rows + lastRow;
    m_Stack.voxels = m_Memory->Place(m_Voxels, atEnd);

    const auto & kernels = Kernels::GetKernels<TPixel>();

    const TPixel                     untouched{ 77 };
    const std::ptrdiff_t             stride = columns + 5;
    std::vector<std::vector<TPixel>> memories(views, std::vector<TPixel>(Guard + stride * rows + Guard, untouched));
    std::vector<Kernels::ColumnSpan> known(rows * views);
    isCovered.assign(columns * rows * views, 0);
    using Rank = Kernels::SliceRank<TPixel>;
    constexpr Rank                            untouchedRank = 77;
    std::vector<Rank>                         memoryOfRanks(Guard + stride * rows + Guard, untouchedRank);
    Rank * const                              rankMemory = memoryOfRanks.data() + Guard;
    const auto                                lastSlice = static_cast<std::int32_t>(m_Stack.slices - 1);
    std::vector<Kernels::ShearedView<TPixel>> list;
    for (auto & memory : memories)
    {
      for (std::ptrdiff_t row = 0; row < rows; ++row)
      {
        const auto begin = memory.begin() + Guard + row * stride;
        std::fill(begin, begin + columns, GetStart<TPixel>(extremum));
        std::fill_n(rankMemory + row * stride, columns, Kernels::NoRank<TPixel>);
      }
      const auto view = static_cast<std::ptrdiff_t>(list.size());
      auto &     sheared = list.emplace_back();
      sheared.placements = m_Placements.data();
      sheared.intermediate = MakeImage(memory.data() + Guard, columns, rows, stride);
      sheared.extremum = extremum;
      sheared.coverage.region = region.intervals.empty() ? nullptr : &region;
      sheared.coverage.marks = isCovered.data() + view * columns * rows;
      sheared.coverage.rowStride = columns;
      sheared.coverage.known = known.data() + view * rows;
      sheared.ranked.ranks = rankStep != 0 ? rankMemory : nullptr;
      sheared.ranked.first = rankStep < 0 ? lastSlice : 0;
      sheared.ranked.step = rankStep;
      sheared.localThreshold = localThreshold ? &*localThreshold : nullptr;
    }
    rowSplits.push_back(rowsOf == Kernels::BlockRows::OfImage ? rows : m_Stack.rows);
    sliceSplits.push_back(m_Stack.slices);
    Kernels::Block block{};
    block.rows = m_Stack.rows;
    block.rowsOf = rowsOf;
    block.isBackward = isBackward;
    if (isBackward)
    {
      std::reverse(sliceSplits.begin(), sliceSplits.end());
      sliceSplits.push_back(0);
    }
    for (const std::ptrdiff_t rowEnd : rowSplits)
    {
      block.rowEnd = rowEnd;
      for (std::size_t n = 0; n + isBackward < sliceSplits.size(); ++n)
      {
        block.sliceEnd = sliceSplits[n];
        block.sliceBegin = isBackward ? sliceSplits[n + 1] : n == 0 ? 0 : sliceSplits[n - 1];
        kernels.projectBlock(m_Stack, block, list.data(), list.size());
      }
      block.rowBegin = rowEnd;
    }

    const auto takeImage = [&](const auto & memory, auto value) {
      std::decay_t<decltype(memory)> image;
      for (std::ptrdiff_t row = 0; row < rows; ++row)
      {
        const auto begin = memory.begin() + Guard + row * stride;
        image.insert(image.end(), begin, begin + columns);
        EXPECT_EQ(std::count(begin + columns, begin + stride, value), stride - columns);
      }
      ExpectGuards(memory, value);
      return image;
    };
    ranks = takeImage(memoryOfRanks, untouchedRank);
    for (const auto & memory : memories)
    {
      EXPECT_TRUE(HaveSameValues(memory, memories.front()));
    }
    return takeImage(memories.front(), untouched);
  }

  /** Projects, one after the other, parts that end with columns and rows of these numbers, the last ones with the
   * stack; each is in memory of its own, between guards. */
  std::vector<TPixel>
  ProjectParts(const std::vector<std::ptrdiff_t> & columnEnds, const std::vector<std::ptrdiff_t> & rowEnds, bool atEnd)
  {
    std::vector<TPixel> pixels(columns * rows, Kernels::NoSample<TPixel>);
    std::ptrdiff_t      firstRow = 0;
    for (const std::ptrdiff_t rowEnd : rowEnds)
    {
      std::ptrdiff_t firstColumn = 0;
      for (const std::ptrdiff_t columnEnd : columnEnds)
      {
        this->ProjectPart(firstColumn, columnEnd, firstRow, rowEnd, atEnd, pixels);
        firstColumn = columnEnd - 1;
      }
      firstRow = rowEnd - 1;
    }
    return pixels;
  }

  /** The samples of a pixel in the region, by their ranks. */
  std::vector<RaySample<TPixel>>
  FindSamples(std::ptrdiff_t p, std::ptrdiff_t q) const
  {
    std::vector<RaySample<TPixel>> samples;
    for (std::ptrdiff_t n = 0; n < m_Stack.slices; ++n)
    {
      const std::ptrdiff_t k = rankStep < 0 ? m_Stack.slices - 1 - n : n;
      const auto           voxel = [&](std::int64_t i, std::int64_t j) {
        return m_Stack.voxels[k * m_Stack.sliceStride + j * m_Stack.rowStride + i];
      };
      const bool isIn = std::all_of(region.intervals.begin(), region.intervals.end(), [&](const auto & interval) {
        const double value = interval.function(
          static_cast<double>(p), static_cast<double>(q), static_cast<double>(region.first.slice + k));
        return interval.low <= value && value <= interval.high;
      });
      TPixel     sample{};
      if (isIn && SampleSlice(voxel,
                              m_Stack.columns,
                              m_Stack.rows,
                              p * WholePixel - ToQuantized(m_Placements[k].column),
                              q * WholePixel - ToQuantized(m_Placements[k].row),
                              sample))
      {
        samples.push_back({ sample, n });
      }
    }
    return samples;
  }

  /** False where no slice has a sample in the region; \a rank is the rank of the slice whose sample is \a chosen. */
  bool
  Evaluate(std::ptrdiff_t p, std::ptrdiff_t q, TPixel & chosen, std::int64_t * rank = nullptr) const
  {
    const auto samples = this->FindSamples(p, q);
    if (samples.empty())
    {
      return false;
    }
    SampleRule<TPixel> rule;
    rule.mode = extremum == Kernels::Extremum::Minimum ? RayMode::Minimum : RayMode::Maximum;
    rule.isLocal = localThreshold.has_value();
    rule.threshold = localThreshold.value_or(TPixel{});
    const auto sample = ChooseSample(rule, samples);
    chosen = sample.value;
    if (rank)
    {
      *rank = sample.slice;
    }
    return true;
  }

  /** Compares every pixel that some slice reaches, for each rule and instruction set. */
  void
  ExpectProjectionFollowsRule(std::size_t views = 1)
  {
    using Kernels::Extremum;
    const auto rowsWithoutOrder = rowsOf;
    for (int rule = 0; rule < 12; ++rule)
    {
      extremum = rule % 2 == 0 ? Extremum::Maximum : Extremum::Minimum;
      rankStep = rule / 2 % 3 - 1;
      // rays end in the order of their samples, and have ranks
      const bool isLocal = rule / 6 == 1;
      if (isLocal && rankStep == 0)
      {
        continue;
      }
      rowsOf = isLocal ? Kernels::BlockRows::OfImage : rowsWithoutOrder;
      isBackward = isLocal && rankStep < 0;
      localThreshold.reset();
      if (isLocal)
      {
        localThreshold = m_Voxels.front();
      }
      // views share their ranks
      const std::size_t count = isLocal ? 1 : views;
      this->FillPadding(extremum == Extremum::Minimum ? std::numeric_limits<TPixel>::lowest()
                                                      : std::numeric_limits<TPixel>::max());
      this->Project();
      std::vector<TPixel>       expected(columns * rows);
      std::vector<std::uint8_t> isReached(columns * rows);
      std::vector<std::int64_t> expectedRanks(columns * rows, Kernels::NoRank<TPixel>);
      for (std::ptrdiff_t n = 0; n < columns * rows; ++n)
      {
        isReached[n] = this->Evaluate(n % columns, n / columns, expected[n], &expectedRanks[n]);
      }
      bool atEnd = false;
      ForEachInstructionSet([&](const std::string &) {
        atEnd = !atEnd;
        const std::vector<TPixel> pixels = this->Project({}, {}, count, atEnd);
        for (std::ptrdiff_t n = 0; n < columns * rows; ++n)
        {
          if (isReached[n] != 0)
          {
            ASSERT_TRUE(HaveSameBits(WithoutSignOfZero(expected[n]), WithoutSignOfZero(pixels[n])))
              << "at (" << n % columns << ", " << n / columns << ") of " << m_Stack.columns << " x " << m_Stack.rows
              << " x " << m_Stack.slices << ", rule " << rule << ": " << +pixels[n] << " instead of " << +expected[n];
          }
          const bool isEnded = localThreshold && ranks[n] < 0;
          const auto rank = static_cast<std::int64_t>(ranks[n]) - (isEnded ? Kernels::EndedRank<TPixel> : 0);
          ASSERT_TRUE(rankStep == 0 || rank == expectedRanks[n]) << n << ": " << ranks[n];
          for (std::size_t view = 0; view < count; ++view)
          {
            ASSERT_TRUE(region.intervals.empty() || isReached[n] == isCovered[view * pixels.size() + n]) << n;
          }
        }
      });
    }
    for (const bool fromBehind : { false, true })
    {
      isBackward = fromBehind;
      rankStep = fromBehind ? -1 : 1;
      // sums of floats are in the order of the samples
      rowsOf = fromBehind || std::is_floating_point_v<TPixel> ? Kernels::BlockRows::OfImage : rowsWithoutOrder;
      this->ExpectSumsFollowRule();
    }
    rankStep = 0;
    extremum = Extremum::Maximum;
    rowsOf = rowsWithoutOrder;
    isBackward = false;
    localThreshold.reset();
  }

  /** Adds with the chosen instruction set; returns the sums and the counts of the pixels. */
  std::pair<std::vector<Kernels::SampleSum<TPixel>>, std::vector<std::uint32_t>>
  Add(bool atEnd)
  {
    using Sum = Kernels::SampleSum<TPixel>;
    const std::ptrdiff_t       stride = columns + 5;
    std::vector<Sum>           sums(Guard + stride * rows + Guard);
    std::vector<std::uint32_t> steps(Guard + (stride + 1) * rows + Guard);
    std::memset(static_cast<void *>(sums.data()), 0x55, sums.size() * sizeof(Sum));
    const auto untouched = sums;
    for (std::ptrdiff_t row = 0; row < rows; ++row)
    {
      std::fill_n(sums.begin() + Guard + row * stride, columns, Sum{});
    }
    m_Stack.voxels = m_Memory->Place(m_Voxels, atEnd);
    Kernels::ShearedView<TPixel> view;
    view.placements = m_Placements.data();
    view.intermediate = MakeImage<TPixel>(nullptr, columns, rows, stride);
    view.coverage.region = region.intervals.empty() ? nullptr : &region;
    view.summed = { sums.data() + Guard, steps.data() + Guard };
    Kernels::Block block{};
    block.rows = m_Stack.rows;
    block.rowsOf = rowsOf;
    block.isBackward = isBackward;
    block.sliceEnd = m_Stack.slices;
    const std::ptrdiff_t lastRow = rowsOf == Kernels::BlockRows::OfImage ? rows : m_Stack.rows;
    for (; block.rowEnd < lastRow; block.rowBegin = block.rowEnd)
    {
      block.rowEnd = std::min<std::ptrdiff_t>(block.rowBegin + 16, lastRow);
      Kernels::GetKernels<TPixel>().addBlock(m_Stack, block, &view, 1);
    }
    std::vector<Sum>           ofPixels;
    std::vector<std::uint32_t> counts;
    for (std::ptrdiff_t row = 0; row < rows; ++row)
    {
      std::uint32_t count = 0;
      for (std::ptrdiff_t column = 0; column < columns; ++column)
      {
        count += steps[Guard + row * (stride + 1) + column];
        counts.push_back(count);
        Sum & sum = sums[Guard + row * stride + column];
        ofPixels.push_back(sum);
        std::memset(static_cast<void *>(&sum), 0x55, sizeof(Sum));
      }
    }
    EXPECT_EQ(std::memcmp(sums.data(), untouched.data(), sums.size() * sizeof(Sum)), 0);
    ExpectGuards(steps, std::uint32_t{ 0 });
    return { ofPixels, counts };
  }

  /** Compares the sums and counts of all pixels, for each instruction set. */
  void
  ExpectSumsFollowRule()
  {
    bool atEnd = false;
    ForEachInstructionSet([&](const std::string &) {
      atEnd = !atEnd;
      const auto [sums, counts] = this->Add(atEnd);
      for (std::ptrdiff_t n = 0; n < columns * rows; ++n)
      {
        const auto samples = this->FindSamples(n % columns, n / columns);
        ASSERT_EQ(counts[n], samples.size()) << n;
        const auto expected = SumOf(samples);
        ASSERT_EQ(std::memcmp(&sums[n], &expected, sizeof(expected)), 0) << n;
      }
    });
  }

  std::ptrdiff_t        columns{ 0 }, rows{ 0 };
  std::optional<TPixel> localThreshold;
  Kernels::BlockRows    rowsOf{ Kernels::BlockRows::OfSlices };
  Kernels::Extremum     extremum{ Kernels::Extremum::Maximum };
  bool                  isBackward{ false };
  std::int32_t          rankStep{ 0 }; // 0 for no ranks

  std::vector<Kernels::SliceRank<TPixel>> ranks;

  Kernels::Region           region;
  std::vector<std::uint8_t> isCovered; // by samples of the region, for each view

private:
  void
  ProjectPart(std::ptrdiff_t        firstColumn,
              std::ptrdiff_t        columnEnd,
              std::ptrdiff_t        firstRow,
              std::ptrdiff_t        rowEnd,
              bool                  atEnd,
              std::vector<TPixel> & pixels) const
  {
    Kernels::SliceStack<TPixel> part = m_Stack;
    part.columns = columnEnd - firstColumn;
    part.rows = rowEnd - firstRow;
    part.rowStride = part.columns;
    part.sliceStride = part.columns * part.rows;
    part.columnEnds = { firstColumn == 0, columnEnd == m_Stack.columns };
    part.rowEnds = { firstRow == 0, rowEnd == m_Stack.rows };
    std::vector<TPixel> voxels;
    auto                placements = m_Placements;
    for (std::ptrdiff_t k = 0; k < part.slices; ++k)
    {
      placements[k].column.whole += static_cast<std::int32_t>(firstColumn);
      placements[k].row.whole += static_cast<std::int32_t>(firstRow);
      for (std::ptrdiff_t j = firstRow; j < rowEnd; ++j)
      {
        const TPixel * row = m_Voxels.data() + k * m_Stack.sliceStride + j * m_Stack.rowStride;
        voxels.insert(voxels.end(), row + firstColumn, row + columnEnd);
      }
    }
    GuardedMemory memory(voxels.size() * sizeof(TPixel));
    part.voxels = memory.Place(voxels, atEnd);
    Kernels::ShearedView<TPixel> view;
    view.placements = placements.data();
    view.intermediate = MakeImage(pixels.data(), columns, rows, columns);
    Kernels::GetKernels<TPixel>().projectBlock(part, { 0, part.rows, 0, part.slices, part.rows }, &view, 1);
  }

  Kernels::SliceStack<TPixel>          m_Stack;
  std::vector<TPixel>                  m_Voxels;
  std::unique_ptr<GuardedMemory>       m_Memory;
  std::vector<Kernels::SlicePlacement> m_Placements;
};

template <typename TPixel>
class ShearWarpKernelsTyped : public testing::Test
{};
using PixelTypes = testing::Types<SHEARWARP_PIXEL_TYPES>;
TYPED_TEST_SUITE(ShearWarpKernelsTyped, PixelTypes, );

template <typename TPixel>
class ShearWarpKernelsFloating : public testing::Test
{};
using FloatingTypes = testing::Types<float, double>;
TYPED_TEST_SUITE(ShearWarpKernelsFloating, FloatingTypes, );

/** Zeros of both signs, limits, and what is not finite. */
template <typename TPixel>
std::vector<TPixel>
MakeSpecialPixels()
{
  using Limits = std::numeric_limits<TPixel>;
  if constexpr (std::is_floating_point_v<TPixel>)
  {
    return { Limits::quiet_NaN(),  -Limits::infinity(), -Limits::max(), TPixel(-1),    -TPixel(0),        TPixel(0),
             Limits::denorm_min(), TPixel(0.5),         TPixel(1),      Limits::max(), Limits::infinity() };
  }
  else
  {
    return { Limits::lowest(), static_cast<TPixel>(Limits::lowest() + 1), 0, 1, Limits::max() };
  }
}

/** \a samples as they fade to \a background by \a product. */
template <typename TPixel>
std::vector<TPixel>
FadeSamples(const Kernels::Kernels<TPixel> & kernels,
            const std::vector<TPixel> &      samples,
            Kernels::FadeNumber<TPixel>      product,
            TPixel                           background)
{
  // as many columns as fast kernels need
  std::vector<TPixel> voxels;
  while (voxels.size() < 100)
  {
    voxels.insert(voxels.end(), samples.begin(), samples.end());
  }
  const auto                              columns = static_cast<std::ptrdiff_t>(voxels.size());
  Kernels::ViewFading<TPixel>             fading{ { 0.0, 0.0 }, { 0.0, 0.0, 0.0, 0.0 }, background };
  const Kernels::SlicePlacement           placement{};
  std::vector<TPixel>                     pixels(columns, Kernels::NoSample<TPixel>);
  std::vector<Kernels::SliceRank<TPixel>> ranks(columns, Kernels::NoRank<TPixel>);
  fading.factors.assign(columns + 1 + 2 * Kernels::FadePadding, product);
  Kernels::ShearedView<TPixel> view;
  view.placements = &placement;
  view.intermediate = MakeImage(pixels.data(), columns, 1, columns);
  view.ranked.ranks = ranks.data();
  view.fading = &fading;
  kernels.projectBlock({ voxels.data(), columns, 1, 1, columns, columns }, { 0, 1, 0, 1, 1 }, &view, 1);
  for (std::size_t n = 0; n < pixels.size(); ++n)
  {
    EXPECT_TRUE(HaveSameBits(pixels[n], pixels[n % samples.size()])) << n;
  }
  pixels.resize(samples.size());
  return pixels;
}

constexpr std::ptrdiff_t FixedColumns = 61;
constexpr std::ptrdiff_t FixedRows = 45;
constexpr std::ptrdiff_t FixedSlices = 21;

/** Projects with fractions of columns, rows, both and none, and warps. */
template <typename TPixel>
void
AddFixedPictures(const Kernels::SliceStack<TPixel> & stack, std::uint64_t & checksum)
{
  const auto &                                    kernels = Kernels::GetKernels<TPixel>();
  constexpr std::ptrdiff_t                        columns = FixedColumns + 20;
  constexpr std::ptrdiff_t                        rows = FixedRows + 20;
  const std::vector<Kernels::ColumnSpan>          reached(rows, { 0, columns });
  std::vector<Kernels::SliceRank<TPixel>>         ranks(columns * rows);
  constexpr std::pair<std::int32_t, std::int32_t> steps[] = {
    { 32768, 0 }, { 20011, 0 }, { 0, 30011 }, { 9001, 25003 }
  };
  for (const auto & [columnStep, rowStep] : steps)
  {
    std::vector<Kernels::SlicePlacement> placements;
    placements.reserve(FixedSlices);
    for (std::int32_t k = 0; k < FixedSlices; ++k)
    {
      placements.push_back(
        { { k * columnStep >> 15, k * columnStep & 32767 }, { k * rowStep >> 15, k * rowStep & 32767 } });
    }
    for (const auto extremum : { Kernels::Extremum::Maximum, Kernels::Extremum::Minimum })
    {
      for (const bool isRanked : { false, true })
      {
        std::vector<TPixel>          pixels(columns * rows, GetStart<TPixel>(extremum));
        Kernels::ShearedView<TPixel> view;
        view.placements = placements.data();
        view.intermediate = MakeImage(pixels.data(), columns, rows, columns);
        view.intermediate.reached = reached.data();
        view.extremum = extremum;
        Kernels::Block block{ 0, FixedRows, 0, FixedSlices, FixedRows };
        if (isRanked)
        {
          ranks.assign(ranks.size(), Kernels::NoRank<TPixel>);
          view.ranked.ranks = ranks.data();
          block.rowsOf = Kernels::BlockRows::OfImage;
          block.rowEnd = rows;
        }
        kernels.projectBlock(stack, block, &view, 1);
        AddToChecksum(pixels.data(), pixels.size(), checksum);
        AddToChecksum(ranks.data(), ranks.size(), checksum);
        std::vector<TPixel> picture(90);
        for (std::ptrdiff_t row = 0; row < 80; ++row)
        {
          kernels.warpRow(
            view.intermediate, { 0.7, -0.3, 9.2, 0.2, 0.9, -5.1 }, row, 0, 90, TPixel{ 1 }, picture.data());
          AddToChecksum(picture.data(), picture.size(), checksum);
        }
      }
    }
  }
}

/** The extrema of the interpolant along a ray of each cell of a patch. */
template <typename TPixel>
void
AddFixedRays(const Kernels::SliceStack<TPixel> & stack, std::uint64_t & checksum)
{
  using Number = Kernels::ExactNumber<TPixel>;
  constexpr std::ptrdiff_t count = Kernels::CellColumns * Kernels::CellRows;
  const auto &             kernels = Kernels::GetKernels<TPixel>();
  for (const bool isMinimum : { false, true })
  {
    Kernels::ExactView<TPixel> view{};
    view.slices = stack;
    view.shear[0] = 0.3125;
    view.shear[1] = -0.71875;
    view.translation[1] = 15.0;
    view.depth.perSlice = 1.0;
    std::vector<std::int32_t>        cellBegins(count + 1);
    std::vector<std::uint16_t>       cells(count);
    std::vector<double>              p(count), q(count), begins(count), places(count);
    const std::vector<double>        ends(count, static_cast<double>(FixedSlices - 1));
    std::vector<Number>              best(count, -std::numeric_limits<Number>::infinity());
    std::vector<TPixel>              least(count);
    std::vector<std::int16_t>        levels(count);
    std::vector<Kernels::RaySegment> segments;
    for (std::int32_t n = 0; n < count; ++n)
    {
      cellBegins[n + 1] = n + 1;
      cells[n] = static_cast<std::uint16_t>(n);
      const auto row = n / Kernels::CellColumns;
      p[n] = static_cast<double>(10 + n % Kernels::CellColumns) + (n * 37 % 64) / 64.0;
      q[n] = static_cast<double>(20 + row) + (n * 29 % 64) / 64.0;
      places[n] = std::numeric_limits<double>::infinity();
      segments.push_back({ n, n % static_cast<std::int32_t>(FixedSlices - 1) });
    }
    const Kernels::RayPatch<TPixel> patch{
      10,           20,           isMinimum,     true,        cellBegins.data(), cells.data(),
      p.data(),     q.data(),     begins.data(), ends.data(), best.data(),       places.data(),
      least.data(), levels.data()
    };
    kernels.evaluateSegments(view, patch, segments.data(), segments.size());
    kernels.searchLayer(view, patch, 0, FixedSlices - 1);
    AddToChecksum(best.data(), best.size(), checksum);
    AddToChecksum(places.data(), places.size(), checksum);
  }
}

template <typename TPixel>
constexpr std::uint64_t FixedChecksum = 0;
template <>
constexpr std::uint64_t FixedChecksum<std::uint8_t> = 0x37b9f2234cea3296;
template <>
constexpr std::uint64_t FixedChecksum<std::int8_t> = 0xd52f6d2d8d81f668;
template <>
constexpr std::uint64_t FixedChecksum<std::uint16_t> = 0x58fbec20b27a8284;
template <>
constexpr std::uint64_t FixedChecksum<std::int16_t> = 0x2b4fc6d0bf74d747;
template <>
constexpr std::uint64_t FixedChecksum<std::int32_t> = 0xb7c76e30b524c010;
template <>
constexpr std::uint64_t FixedChecksum<std::uint32_t> = 0x62ae25f6e29db6f8;
template <>
constexpr std::uint64_t FixedChecksum<std::int64_t> = 0x4f3e83b79a7ef320;
template <>
constexpr std::uint64_t FixedChecksum<std::uint64_t> = 0x41bd688c80bf91e0;
template <>
constexpr std::uint64_t FixedChecksum<float> = 0xebaf84d1d1c85419;
template <>
constexpr std::uint64_t FixedChecksum<double> = 0xdd5bd692ec434d2d;

template <typename TPixel>
void
ExpectFixedChecksum()
{
  const auto voxels = MakeFixedVoxels<TPixel>(FixedColumns * FixedRows * FixedSlices);
  auto       narrow = voxels;
  std::transform(voxels.begin(), voxels.end(), narrow.begin(), [](TPixel v) { return static_cast<TPixel>(v / 4); });
  ForEachInstructionSet([&](const std::string & name) {
    std::uint64_t checksum = EmptyChecksum;
    for (const auto & all : { voxels, narrow })
    {
      const auto [lowest, highest] = std::minmax_element(all.begin(), all.end());
      constexpr std::ptrdiff_t          sliceStride = FixedColumns * FixedRows;
      const Kernels::SliceStack<TPixel> stack{ all.data(),   FixedColumns, FixedRows, FixedSlices,
                                               FixedColumns, sliceStride,  *lowest,   *highest };
      AddFixedPictures(stack, checksum);
      AddFixedRays(stack, checksum);
    }
    EXPECT_EQ(checksum, FixedChecksum<TPixel>) << name << std::hex << ": 0x" << checksum;
  });
}
} // namespace

TYPED_TEST(ShearWarpKernelsTyped, FixedVolumesHaveTheChecksumsOfEveryMachine)
{
  ExpectFixedChecksum<TypeParam>();
}

TEST(ShearWarpKernels, ClippedColumnsAreThoseWhereTheFunctionIsWithinItsLimits)
{
  // small multiples of a half and zeros of both signs, so that limits are met exactly
  Random     random(41);
  const auto draw = [&random] {
    return (random.Integer(0, 1) == 0 ? 0.5 : -0.5) * static_cast<double>(random.Integer(0, 8));
  };
  for (int repeat = 0; repeat < 20000; ++repeat)
  {
    const itk::ShearWarp::ShearedFunction function{ draw(), draw(), draw(), draw() };
    const double                          row = draw();
    const double                          slice = draw();
    const double                          limits[] = { 3 * draw(), 3 * draw() };
    const double                          low = std::min(limits[0], limits[1]);
    const double                          high = std::max(limits[0], limits[1]);
    const auto                            begin = static_cast<std::int32_t>(random.Integer(-9, 9));
    const itk::ShearWarp::ColumnSpan      span{ begin, begin + static_cast<std::int32_t>(random.Integer(0, 12)) };
    constexpr std::ptrdiff_t              rows = 3;
    itk::ShearWarp::ColumnSpan            clipped[rows] = { span, span, span };
    itk::ShearWarp::ClipColumns({ function, low, high }, row, slice, rows, clipped);
    for (std::ptrdiff_t n = 0; n < rows; ++n)
    {
      const auto [first, last] = clipped[n];
      ASSERT_TRUE(first >= last || (first >= span.begin && last <= span.end));
      for (std::int32_t column = span.begin; column < span.end; ++column)
      {
        const double value = function(column, row + static_cast<double>(n), slice);
        ASSERT_EQ(column >= first && column < last, value >= low && value <= high)
          << "row " << n << ", column " << column << " in repetition " << repeat;
      }
    }
  }
}

TEST(ShearWarpKernels, ReachedColumnsHaveRanks)
{
  const auto expect = [](const std::vector<std::int32_t> & ranks, std::int32_t begin, std::int32_t end, bool hasGaps) {
    const auto reached = Kernels::FindReached(ranks.data(), static_cast<std::ptrdiff_t>(ranks.size()));
    EXPECT_EQ(reached.span.end - reached.span.begin, end - begin);
    EXPECT_TRUE(begin == end || reached.span.begin == begin);
    EXPECT_EQ(reached.hasGaps, hasGaps);
  };
  expect({}, 0, 0, false);
  expect({ 0, -5, 0 }, 0, 0, false);
  expect({ 1, 2, 3 }, 0, 3, false);
  expect({ 0, 1, 7, -1 }, 1, 3, false);
  expect({ -1, 1, 0, 7, 0 }, 1, 4, true);
  expect({ 5 }, 0, 1, false);
}

TYPED_TEST(ShearWarpKernelsTyped, PixelsWithoutARankHaveNoWeightAndNoDepth)
{
  const std::vector<TypeParam>          pixels{ 10, 20, 30, 40 };
  const Kernels::ColumnSpan             reached[] = { { 0, 2 }, { 0, 2 } };
  const Kernels::ShearedFunction        depth{ 0.0, 0.0, 1.0, 0.25 };
  std::vector<std::int32_t>             ranks{ 3, 0, -2, 1 };
  Kernels::IntermediateImage<TypeParam> image = MakeImage(const_cast<TypeParam *>(pixels.data()), 2, 2, 2);
  image.reached = reached;
  image.ranks = ranks.data();
  image.hasGaps = true;
  for (const std::int32_t step : { 1, -1 })
  {
    image.ranking = { 12, step };
    const auto warp = [&](double x, double y) {
      TypeParam output{};
      Kernels::GetKernels<TypeParam>().warpRow(image, { 0, 0, x, 0, 0, y }, 0, 0, 1, TypeParam{ 7 }, &output);
      return output;
    };
    const auto findDepth = [&](double x, double y) {
      float found = 0;
      Kernels::FindDepths(image, { 0, 0, x, 0, 0, y }, 1, depth, 0, 1, &found);
      return found;
    };
    ForEachInstructionSet([&](const std::string &) {
      EXPECT_EQ(warp(0, 0), 10);
      EXPECT_EQ(warp(1, 0), 7);
      EXPECT_EQ(warp(0, 1), 7);
      EXPECT_EQ(warp(0.75, 0), 10);
      EXPECT_EQ(warp(0.5, 0.5), 25);
    });
    EXPECT_EQ(findDepth(0, 0), 12.25f + 2.0f * static_cast<float>(step));
    EXPECT_EQ(findDepth(0.25, 0.25), 12.25f + 2.0f * static_cast<float>(step));
    // the nearest pixel has no rank
    EXPECT_EQ(findDepth(0.25, 0.625), 12.25f + 2.0f * static_cast<float>(step));
    EXPECT_EQ(findDepth(0.375, 0.75), 12.25f);
    EXPECT_EQ(findDepth(1, 1), 12.25f);
    EXPECT_TRUE(std::isnan(findDepth(1, 0)));
    EXPECT_TRUE(std::isnan(findDepth(0, 1)));
    EXPECT_TRUE(std::isnan(findDepth(2, 2)));
  }
}

TEST(ShearWarpKernels, QuantizePositionRoundsToNearestHalfUpward)
{
  const auto expect = [](double position, std::int32_t whole, std::int32_t fraction) {
    const auto quantized = Kernels::QuantizePosition(position);
    EXPECT_EQ(quantized.whole, whole) << position;
    EXPECT_EQ(quantized.fraction, fraction) << position;
  };
  constexpr double unit = 1.0 / Kernels::One;
  expect(0.0, 0, 0);
  expect(-0.0, 0, 0);
  expect(0.5, 0, Half);
  expect(3.25, 3, Kernels::One / 4);
  expect(-0.25, -1, 3 * (Kernels::One / 4));
  expect(-1.0, -1, 0);
  expect(-2.75, -3, Kernels::One / 4);
  expect(0.4999 * unit, 0, 0);
  expect(0.5 * unit, 0, 1);
  expect(-0.5 * unit, 0, 0);
  expect(-0.5001 * unit, -1, Kernels::One - 1);
  expect(1.5 * unit, 0, 2);
  // up to the next whole pixel
  expect(1.0 - 0.25 * unit, 1, 0);
  expect(5.0 - 0.5 * unit, 5, 0);
  expect(5.0 - 0.75 * unit, 4, Kernels::One - 1);
  expect(-3.0 - 0.25 * unit, -3, 0);
  expect(1.0e9, 1000000000, 0);
  expect(-1.0e9 + 0.5, -1000000000, Half);
}

TEST(ShearWarpKernels, QuantizePositionIsWithinHalfAUnit)
{
  Random random(1);
  for (int n = 0; n < 100000; ++n)
  {
    const double position = random.Uniform(-5000, 5000);
    const auto   quantized = Kernels::QuantizePosition(position);
    ASSERT_GE(quantized.fraction, 0);
    ASSERT_LT(quantized.fraction, Kernels::One);
    ASSERT_NEAR(quantized.whole + static_cast<double>(quantized.fraction) / Kernels::One, position, 0.5 / Kernels::One);
  }
}

TEST(ShearWarpKernels, BilinearWeightsAreNotNegativeAndSumToOne)
{
  std::vector<std::int32_t> fractions;
  for (std::int32_t x = 0; x < Kernels::One; ++x)
  {
    const bool isAtRim = x < 40 || x >= Kernels::One - 40 || (x >= Half - 40 && x < Half + 40);
    if (isAtRim || x % 13 == 0)
    {
      fractions.push_back(x);
    }
  }
  for (const std::int32_t x : fractions)
  {
    for (const std::int32_t y : fractions)
    {
      const Kernels::BilinearWeights weights(x, y);
      ASSERT_GE(std::min({ weights.aa, weights.ab, weights.ba, weights.bb }), 0) << x << ' ' << y;
      ASSERT_EQ(weights.aa + weights.ab + weights.ba + weights.bb, Kernels::One) << x << ' ' << y;
      ASSERT_EQ(weights.aa + weights.ab, y);
      ASSERT_EQ(weights.aa + weights.ba, x);
      // half a unit, from above
      const std::int64_t error = std::int64_t{ weights.aa } * Kernels::One - std::int64_t{ x } * y;
      ASSERT_GT(error, -Half) << x << ' ' << y;
      ASSERT_LE(error, Half) << x << ' ' << y;
    }
  }
}

TEST(ShearWarpKernels, SlicePlacementStartsHalfAVoxelBeforeTheFirstCenter)
{
  const auto firstOf = [](std::int32_t fraction) {
    const Kernels::SlicePlacement placement{ { 5, fraction }, { 7, fraction } };
    EXPECT_EQ(placement.FirstColumn() + 2, placement.FirstRow());
    return placement.FirstColumn();
  };
  EXPECT_EQ(firstOf(0), 5);
  EXPECT_EQ(firstOf(Half), 5);
  EXPECT_EQ(firstOf(Half + 1), 6);
  EXPECT_EQ(firstOf(Kernels::One - 1), 6);
}

TYPED_TEST(ShearWarpKernelsTyped, ProjectBlockFollowsTheRuleAtEveryRim)
{
  Random random(2);
  for (const auto columns : OddLengths)
  {
    for (const auto rows : OddLengths)
    {
      for (const auto x : RimFractions)
      {
        for (const auto y : RimFractions)
        {
          SlicesFixture<TypeParam> slices(random, columns, rows, 1);
          slices.Place(0, random.Integer(0, 2) * WholePixel + x, random.Integer(0, 2) * WholePixel + y);
          slices.ExpectProjectionFollowsRule();
        }
      }
    }
  }
}

TYPED_TEST(ShearWarpKernelsTyped, ProjectBlockTakesTheMaximumOfManySlices)
{
  Random random(3);
  for (int repeat = 0; repeat < 40; ++repeat)
  {
    SlicesFixture<TypeParam> slices(
      random, OddLengths[random.Integer(0, 5)], OddLengths[random.Integer(0, 5)], random.Integer(2, 9));
    slices.PlaceEach([&random] { return random.Integer(0, 4 * WholePixel); });
    slices.ExpectProjectionFollowsRule();
  }
}

TYPED_TEST(ShearWarpKernelsTyped, ProjectBlockTakesTheNearestOfEqualSamples)
{
  Random random(11);
  // zeros of both signs, and what pixels begin with
  const TypeParam values[] = { static_cast<TypeParam>(-TypeParam{ 0 }),
                               TypeParam{ 0 },
                               TypeParam{ 1 },
                               std::numeric_limits<TypeParam>::lowest(),
                               std::numeric_limits<TypeParam>::max() };
  for (int repeat = 0; repeat < 40; ++repeat)
  {
    SlicesFixture<TypeParam> slices(random, random.Integer(1, 80), random.Integer(1, 20), random.Integer(2, 12));
    slices.PlaceEach([&] { return random.Integer(0, 2) == 0 ? WholePixel : random.Integer(0, 2 * WholePixel); });
    // differences that do not overflow
    const bool isExtreme = !std::is_floating_point_v<TypeParam> && repeat % 2 == 0;
    slices.Fill([&](std::ptrdiff_t) { return values[random.Integer(0, isExtreme ? 4 : 2)]; });
    slices.ExpectProjectionFollowsRule(1 + repeat % 2);
  }
}

TYPED_TEST(ShearWarpKernelsTyped, PartsHaveTheSamplesOfTheWhole)
{
  Random random(10);
  for (int repeat = 0; repeat < 200; ++repeat)
  {
    const std::ptrdiff_t     columns = random.Integer(1, 150);
    const std::ptrdiff_t     rows = random.Integer(1, 25);
    SlicesFixture<TypeParam> slices(random, columns, rows, random.Integer(1, 3));
    slices.PlaceEach([&random] {
      return random.Integer(0, 3) * WholePixel + RimFractions[random.Integer(0, std::size(RimFractions) - 1)];
    });
    const auto makeEnds = [&random](std::ptrdiff_t length) {
      std::vector<std::ptrdiff_t> ends{ length };
      for (std::ptrdiff_t end = random.Integer(1, length); end < length; end = random.Integer(end + 1, length))
      {
        ends.insert(ends.end() - 1, end);
      }
      return ends;
    };
    const auto columnEnds = makeEnds(columns);
    const auto rowEnds = makeEnds(rows);
    ForEachInstructionSet([&](const std::string &) {
      const auto whole = slices.Project();
      const auto parts = slices.ProjectParts(columnEnds, rowEnds, repeat % 2 == 0);
      ASSERT_EQ(parts.size(), whole.size());
      for (std::size_t n = 0; n < whole.size(); ++n)
      {
        ASSERT_TRUE(HaveSameBits(WithoutSignOfZero(whole[n]), WithoutSignOfZero(parts[n])))
          << "repeat " << repeat << ", pixel " << n << ": " << +parts[n] << " instead of " << +whole[n];
      }
    });
  }
}

TYPED_TEST(ShearWarpKernelsTyped, ProjectBlockTakesNoMoreThanTheRegion)
{
  Random                   random(8);
  const std::ptrdiff_t     lengths[] = { 1, 5, 17, 33, 40, 97, 130 };
  constexpr std::ptrdiff_t slicesBefore = 3;
  for (int repeat = 0; repeat < 120; ++repeat)
  {
    SlicesFixture<TypeParam> slices(random, lengths[repeat % 7], random.Integer(1, 21), random.Integer(1, 12));
    slices.PlaceEach([&] { return random.Integer(0, 3) == 0 ? 0 : random.Integer(0, 4 * WholePixel); });
    slices.region.first.slice = slicesBefore;
    for (int n = 0; n <= repeat % 3; ++n)
    {
      // zeros of both signs, whole numbers and any
      const double slopes[] = { 0.0, -0.0, 1.0, -1.0, 0.5, random.Uniform(-2, 2), random.Uniform(-1e-9, 1e-9) };
      const auto   draw = [&] { return slopes[random.Integer(0, 6)]; };
      const Kernels::ShearedFunction function{ draw(), draw(), draw(), draw() };
      // ends are values at samples, or just beside them
      const auto drawEnd = [&] {
        constexpr double infinity = std::numeric_limits<double>::infinity();
        const auto       drawPlace = [&](double end) { return std::floor(random.Uniform(0, end)); };
        const double     value = function(drawPlace(140), drawPlace(25), drawPlace(16));
        const double     ends[] = { value, std::nextafter(value, infinity), std::nextafter(value, -infinity) };
        return ends[random.Integer(0, 2)];
      };
      const double ends[] = { drawEnd(), drawEnd() };
      const bool   isOpen = random.Integer(0, 3) == 0;
      slices.region.intervals.push_back(
        { function,
          isOpen ? -std::numeric_limits<double>::infinity() : std::min(ends[0], ends[1]),
          std::max(ends[0], ends[1]) });
    }
    slices.rowsOf = repeat % 4 == 0 ? Kernels::BlockRows::OfMiddleSlices : Kernels::BlockRows::OfSlices;
    slices.ExpectProjectionFollowsRule(1 + repeat % 2);
  }
}

TYPED_TEST(ShearWarpKernelsTyped, ProjectBlockIsExactAtTheLimitsOfTheType)
{
  // the difference of two voxels must be finite
  constexpr bool           isFloating = std::is_floating_point_v<TypeParam>;
  constexpr TypeParam      high = std::numeric_limits<TypeParam>::max() / (isFloating ? 2 : 1);
  constexpr TypeParam      low = std::numeric_limits<TypeParam>::lowest() / (isFloating ? 2 : 1);
  const TypeParam          step = isFloating ? std::numeric_limits<TypeParam>::denorm_min() : TypeParam{ 1 };
  Random                   random(4);
  SlicesFixture<TypeParam> slices(random, 17, 3, 1);
  for (int repeat = 0; repeat < 100; ++repeat)
  {
    slices.Place(0, random.Integer(0, WholePixel), random.Integer(0, WholePixel));
    const auto draw = [&](int last) { return step * static_cast<TypeParam>(random.Integer(0, last)); };
    const auto expect = [&slices](const auto & value) {
      slices.Fill(value);
      slices.ExpectProjectionFollowsRule();
    };
    expect([=](std::ptrdiff_t) { return high; });
    expect([=](std::ptrdiff_t) { return low; });
    expect([=](std::ptrdiff_t n) { return n % 2 == 0 ? high : low; });
    expect([&](std::ptrdiff_t) { return static_cast<TypeParam>(high - draw(9)); });
    expect([&](std::ptrdiff_t) { return static_cast<TypeParam>(low + draw(9)); });
    expect([&](std::ptrdiff_t) { return static_cast<TypeParam>(draw(2)); });
  }
}

TYPED_TEST(ShearWarpKernelsTyped, ProjectBlockKeepsConstantsAndTheRangeOfTheVoxels)
{
  Random random(5);
  for (int repeat = 0; repeat < 200; ++repeat)
  {
    SlicesFixture<TypeParam> slices(random, 3, 2, 1);
    slices.Place(0, random.Integer(0, WholePixel), random.Integer(0, WholePixel));
    const auto constant = MakeRandomPixel<TypeParam>(random);
    for (const TypeParam other : { constant, MakeRandomPixel<TypeParam>(random) })
    {
      slices.Fill([=](std::ptrdiff_t n) { return n % 2 == 0 ? constant : other; });
      slices.ExpectProjectionFollowsRule();
      const auto pixels = slices.Project();
      TypeParam  sample{};
      for (std::ptrdiff_t n = 0; n < slices.columns * slices.rows; ++n)
      {
        if (slices.Evaluate(n % slices.columns, n / slices.columns, sample))
        {
          ASSERT_GE(pixels[n], std::min(constant, other));
          ASSERT_LE(pixels[n], std::max(constant, other));
        }
      }
    }
  }
}

TYPED_TEST(ShearWarpKernelsTyped, ProjectBlockGivesTheSameHoweverTheVolumeIsDivided)
{
  Random random(6);
  // the last block has fewer rows than slices of a cube are shifted
  SlicesFixture<TypeParam> slices(random, 67, 41, 21);
  for (const bool columnsMove : { true, false })
  {
    for (const bool rowsMove : { true, false })
    {
      for (int k = 0; k < 21; ++k)
      {
        slices.Place(k, columnsMove * k * 20011, rowsMove * (20 - k) * 30011);
      }
      for (const auto rowsOf :
           { Kernels::BlockRows::OfSlices, Kernels::BlockRows::OfMiddleSlices, Kernels::BlockRows::OfImage })
      {
        slices.rowsOf = rowsOf;
        slices.ExpectProjectionFollowsRule(1);
        slices.ExpectProjectionFollowsRule(3);
        const std::vector<TypeParam> whole = slices.Project();
        ForEachInstructionSet([&](const std::string &) {
          EXPECT_EQ(slices.Project({ 8 }), whole);
          EXPECT_EQ(slices.Project({ 16, 40 }, { 8 }), whole);
          EXPECT_EQ(slices.Project({ 24 }, { 8, 16 }, 2), whole);
          EXPECT_EQ(slices.Project({ 8, 16, 24, 32, 40 }, {}, 2), whole);
        });
      }
    }
  }
}

TYPED_TEST(ShearWarpKernelsTyped, IsAnyBelowFindsEveryPixel)
{
  constexpr std::ptrdiff_t columns = 2 * Kernels::TileColumns;
  constexpr std::ptrdiff_t rows = 2;
  constexpr std::ptrdiff_t stride = columns + 3;
  // what is between rows is below, and does not count
  std::vector<TypeParam> pixels(stride * rows, TypeParam{ 0 });
  for (std::ptrdiff_t n = 0; n < columns * rows; ++n)
  {
    pixels[n / columns * stride + n % columns] = TypeParam{ 100 };
  }
  ForEachInstructionSet([&](const std::string &) {
    const auto isAnyBelow = Kernels::GetKernels<TypeParam>().isAnyBelow;
    EXPECT_FALSE(isAnyBelow(pixels.data(), stride, rows, columns, TypeParam{ 100 }));
    EXPECT_TRUE(isAnyBelow(pixels.data(), stride, rows, columns, TypeParam{ 101 }));
    for (std::ptrdiff_t n = 0; n < columns * rows; ++n)
    {
      TypeParam & pixel = pixels[n / columns * stride + n % columns];
      pixel = TypeParam{ 99 };
      EXPECT_TRUE(isAnyBelow(pixels.data(), stride, rows, columns, TypeParam{ 100 })) << n;
      EXPECT_FALSE(isAnyBelow(pixels.data(), stride, rows, columns, TypeParam{ 99 })) << n;
      pixel = TypeParam{ 100 };
    }
  });
}

TYPED_TEST(ShearWarpKernelsTyped, BlockExtremaAreOfTheVoxels)
{
  Random random(13);
  for (int repeat = 0; repeat < 60; ++repeat)
  {
    const std::ptrdiff_t columns = random.Integer(1, 150);
    const std::ptrdiff_t rows = random.Integer(1, 8);
    const std::ptrdiff_t slices = random.Integer(1, 8);
    const std::ptrdiff_t blocks = (columns + Kernels::BlockLength - 1) / Kernels::BlockLength;
    const auto           voxels = MakeRandomPixels<TypeParam>(random, columns * rows * slices);
    const auto           getExtremum = [&](std::ptrdiff_t begin, std::ptrdiff_t end, auto better) {
      TypeParam extremum = voxels[begin];
      for (std::ptrdiff_t row = 0; row < rows * slices; ++row)
      {
        const auto first = voxels.begin() + row * columns;
        extremum = better(extremum, *std::min_element(first + begin, first + end, [&](TypeParam a, TypeParam b) {
                            return a != b && better(a, b) == a;
                          }));
      }
      return extremum;
    };
    const auto smaller = [](TypeParam a, TypeParam b) { return std::min(a, b); };
    const auto larger = [](TypeParam a, TypeParam b) { return std::max(a, b); };
    ForEachInstructionSet([&](const std::string &) {
      std::vector<TypeParam> maxima(blocks), minima(blocks);
      TypeParam              lowest = voxels.front();
      TypeParam              highest = voxels.front();
      Kernels::GetKernels<TypeParam>().findBlockExtrema(voxels.data(),
                                                        columns,
                                                        rows,
                                                        slices,
                                                        columns,
                                                        columns * rows,
                                                        maxima.data(),
                                                        repeat % 2 == 0 ? minima.data() : nullptr,
                                                        lowest,
                                                        highest);
      EXPECT_EQ(lowest, getExtremum(0, columns, smaller));
      EXPECT_EQ(highest, getExtremum(0, columns, larger));
      for (std::ptrdiff_t n = 0; n < blocks; ++n)
      {
        const std::ptrdiff_t begin = n * Kernels::BlockLength;
        const std::ptrdiff_t end = std::min(begin + Kernels::BlockLength, columns);
        EXPECT_EQ(maxima[n], getExtremum(begin, end, larger)) << n;
        EXPECT_TRUE(repeat % 2 != 0 || minima[n] == getExtremum(begin, end, smaller)) << n;
      }
    });
  }
}

TYPED_TEST(ShearWarpKernelsTyped, WarpRowFollowsTheRule)
{
  Random random(7);
  for (int repeat = 0; repeat < 150; ++repeat)
  {
    const std::ptrdiff_t             columns = OddLengths[random.Integer(0, 5)];
    const std::ptrdiff_t             rows = OddLengths[random.Integer(0, 5)];
    const auto                       pixels = MakeRandomPixels<TypeParam>(random, columns * rows);
    std::vector<Kernels::ColumnSpan> reached(rows);
    for (auto & span : reached)
    {
      const auto a = random.Integer(0, columns);
      const auto b = random.Integer(0, columns);
      const bool isWhole = random.Integer(0, 2) == 0;
      span = { static_cast<std::int32_t>(isWhole ? 0 : a), static_cast<std::int32_t>(isWhole ? columns : b) };
    }
    // multiples of a power of two, so that every order of operations is exact
    const auto fixed = [&random](double limit) {
      const auto steps = static_cast<std::int64_t>(limit * 1024);
      return static_cast<double>(random.Integer(-steps, steps)) / 1024.0;
    };
    Kernels::AffineMap2D map{ fixed(1.5), fixed(1.5), fixed(9), fixed(1.5), fixed(1.5), fixed(9) };
    if (repeat % 10 == 0)
    {
      map = { 0.5, 0, -1.5, 0, 0.5, -1.5 };
    }
    const auto           background = MakeRandomPixel<TypeParam>(random);
    const std::ptrdiff_t width = random.Integer(1, 40);
    const std::ptrdiff_t height = random.Integer(1, 40);
    const auto           split = static_cast<std::ptrdiff_t>(random.Integer(0, width));

    const auto pixel = [&](std::int64_t p, std::int64_t q, TypeParam & value) {
      if (q < 0 || q >= rows || p < reached[q].begin || p >= reached[q].end)
      {
        return false;
      }
      value = pixels[q * columns + p];
      return true;
    };
    ForEachInstructionSet([&](const std::string &) {
      const std::vector<TypeParam> output = Warp(pixels, reached, map, width, height, background, split);
      for (std::ptrdiff_t n = 0; n < width * height; ++n)
      {
        const std::ptrdiff_t row = n / width;
        const auto           x = static_cast<double>(n % width);
        const auto           y = static_cast<double>(row);
        const auto           expected = InterpolateReached(
          pixel, Quantize(map.xx * x + map.xy * y + map.x0), Quantize(map.yx * x + map.yy * y + map.y0), background);
        ASSERT_TRUE(HaveSameBits(expected, output[n]))
          << "at " << n << ": " << +output[n] << " instead of " << +expected;
      }
    });
  }
}

TYPED_TEST(ShearWarpKernelsFloating, WarpRowMakesEveryZeroPositive)
{
  constexpr TypeParam least = std::numeric_limits<TypeParam>::denorm_min();
  constexpr TypeParam values[] = { 0, -TypeParam{ 0 }, least, -least, 3 * least, -3 * least, -TypeParam{ 0.5 } };
  Random              random(12);
  for (int repeat = 0; repeat < 200; ++repeat)
  {
    const std::ptrdiff_t columns = OddLengths[random.Integer(0, 5)];
    constexpr int        rows = 3;
    // nearly all are zeros
    const auto             most = repeat % 2 == 0 ? 3 : std::int64_t{ std::size(values) } - 1;
    std::vector<TypeParam> pixels(columns * rows);
    std::generate(pixels.begin(), pixels.end(), [&] { return values[random.Integer(0, most)]; });
    const Kernels::ColumnSpan  all{ 0, static_cast<std::int32_t>(columns) };
    const double               slope = repeat % 3 == 0 ? 1.0 : 0.25;
    const double               shift = RimFractions[random.Integer(0, 5)] * 0x1p-15;
    const Kernels::AffineMap2D map{ slope, 0, shift, 0, 0.25, RimFractions[random.Integer(0, 5)] * 0x1p-15 };
    const std::ptrdiff_t       width = random.Integer(1, 40);
    const auto                 pixel = [&](std::int64_t p, std::int64_t q, TypeParam & value) {
      const bool isInside = p >= 0 && p < columns && q >= 0 && q < rows;
      value = isInside ? pixels[q * columns + p] : value;
      return isInside;
    };
    ForEachInstructionSet([&](const std::string &) {
      const auto output = Warp<TypeParam>(pixels, { all, all, all }, map, width, 8, 7, random.Integer(0, width));
      for (std::ptrdiff_t n = 0; n < width * 8; ++n)
      {
        const std::ptrdiff_t row = n / width;
        const auto           expected = InterpolateReached<TypeParam>(pixel,
                                                            Quantize(slope * static_cast<double>(n % width) + shift),
                                                            Quantize(0.25 * static_cast<double>(row) + map.y0),
                                                            7);
        ASSERT_TRUE(HaveSameBits(expected, output[n])) << "at " << n << ": " << output[n] << " instead of " << expected;
        ASSERT_FALSE(output[n] == 0 && std::signbit(output[n])) << "at " << n;
      }
    });
  }
}

TYPED_TEST(ShearWarpKernelsTyped, WarpRowGivesBackgroundForPositionsFarOutsideOrNotANumber)
{
  const double infinity = std::numeric_limits<double>::infinity();
  const double notANumber = std::numeric_limits<double>::quiet_NaN();
  for (const double position : { -1.0, 2.0, 1.0e300, -1.0e300, infinity, -infinity, notANumber })
  {
    const std::vector<TypeParam> pixels{ 50, 60, 70, 80 };
    EXPECT_EQ(WarpAt(pixels, position, 0.5), 7) << position;
    EXPECT_EQ(WarpAt(pixels, 0.5, position), 7) << position;
  }
}

TYPED_TEST(ShearWarpKernelsTyped, WarpRowHasNoOtherPositionsWhereTermsCancel)
{
  // 20 x is lost beside what comes from the row and from the offset
  const std::vector<TypeParam> pixels{ 50, 60, 70, 80 };
  const double                 huge = 0x1.7p600;
  ForEachInstructionSet([&](const std::string & name) {
    for (const auto & map :
         { Kernels::AffineMap2D{ 20, huge, -9 * huge, 0, 0, 0.25 }, { 0, 0, 0, 20, huge, -9 * huge } })
    {
      const auto output = Warp<TypeParam>(pixels, { { 0, 2 }, { 0, 2 } }, map, 40, 10, 7, 0);
      const auto last = output.begin() + 9 * 40;
      EXPECT_NE(*last, 7) << name;
      EXPECT_EQ(std::count(last, output.end(), *last), 40) << name;
    }
  });
}

TYPED_TEST(ShearWarpKernelsTyped, WarpRowHasTheBitsOfThePortableKernelsAtSpecialNumbers)
{
  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr double notANumber = std::numeric_limits<double>::quiet_NaN();
  constexpr double numbers[] = { -1.0, -0.5, -0.0, 0.0, 0.5, 1.0, 21.0, infinity, notANumber };
  Random           random(43);
  const auto       draw = [&] { return numbers[random.Integer(0, 5)]; };

  const auto                             pixels = MakeRandomPixels<TypeParam>(random, 21 * 5);
  const std::vector<Kernels::ColumnSpan> reached{ { 0, 21 }, { 0, 21 }, { 3, 18 }, { 0, 21 }, { 0, 21 } };
  for (const double slope : numbers)
  {
    for (const double fromRow : numbers)
    {
      for (const double offset : numbers)
      {
        for (const auto & map : { Kernels::AffineMap2D{ slope, fromRow, offset, draw(), draw(), draw() },
                                  { draw(), draw(), draw(), slope, fromRow, offset } })
        {
          std::vector<TypeParam> portable;
          ForEachInstructionSet([&](const std::string &) {
            const auto output = Warp<TypeParam>(pixels, reached, map, 40, 3, 7, 0);
            portable = portable.empty() ? output : portable;
            ASSERT_TRUE(HaveSameValues(output, portable))
              << map.xx << ' ' << map.xy << ' ' << map.x0 << ' ' << map.yx << ' ' << map.yy << ' ' << map.y0;
          });
        }
      }
    }
  }
}

TYPED_TEST(ShearWarpKernelsTyped, FadingFollowsTheRuleAtSpecialNumbers)
{
  // small, so that every type holds the results
  std::vector<TypeParam> values;
  for (const double value : { -100.0, -3.0, -1.0, -0.0, 0.0, 1.0, 2.0, 5.0, 101.0 })
  {
    values.push_back(static_cast<TypeParam>(std::is_signed_v<TypeParam> ? value : std::abs(value)));
  }
  for (const TypeParam background : values)
  {
    for (const double product : { 0.0, 0.125, 0.25, 0.5, 1.0 })
    {
      using Number = Kernels::FadeNumber<TypeParam>;
      std::vector<TypeParam> expected;
      std::vector<TypeParam> portable;
      for (const TypeParam value : values)
      {
        const auto   to = static_cast<double>(background);
        const double faded = to + (static_cast<double>(value) - to) * product;
        expected.push_back(
          static_cast<TypeParam>(std::is_floating_point_v<TypeParam> ? faded : std::floor(faded + 0.5)));
      }
      ForEachInstructionSet([&](const std::string &) {
        const auto samples =
          FadeSamples(Kernels::GetKernels<TypeParam>(), values, static_cast<Number>(product), background);
        EXPECT_EQ(samples, expected) << "to " << +background << " by " << product;
        portable = portable.empty() ? samples : portable;
        EXPECT_TRUE(HaveSameValues(samples, portable)) << "to " << +background << " by " << product;
      });
    }
  }
}

TEST(ShearWarpKernels, FadedSamplesLieBetweenSampleAndBackground)
{
  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr double most = std::numeric_limits<double>::max();
  constexpr double least = std::numeric_limits<double>::denorm_min();
  const double numbers[] = { -infinity, -most, -1.0, -2e-16, -least, 0.0, least, 1e-17, 2e-16, 1.0, most, infinity };
  const auto & kernels = Kernels::GetPortableKernels<double>();
  for (const double from : numbers)
  {
    for (const double to : { -most, -1.0, 0.0, 1e-17, 1.0, most })
    {
      for (const double factor : { 0.0, least, 1e-300, 0.3, 1.0 - 0x1p-53, 1.0 })
      {
        const double sample = FadeSamples(kernels, { from }, factor, to).front();
        EXPECT_TRUE(sample >= std::min(from, to) && sample <= std::max(from, to)) << from << ' ' << to << ' ' << factor;
        EXPECT_TRUE(factor > 0.0 || sample == (std::isfinite(from - to) ? to : from)) << from << ' ' << to;
      }
    }
  }
}

TYPED_TEST(ShearWarpKernelsTyped, ProjectBlockHasTheBitsOfThePortableKernelsAtSpecialNumbers)
{
  const auto specials = MakeSpecialPixels<TypeParam>();
  Random     random(44);
  const auto draw = [&](std::ptrdiff_t = 0) { return specials[random.Integer(0, specials.size() - 1)]; };
  for (const std::int32_t x : RimFractions)
  {
    for (const std::int32_t y : RimFractions)
    {
      SlicesFixture<TypeParam> slices(random, 40, 9, 7);
      slices.Fill(draw);
      slices.rowsOf = Kernels::BlockRows::OfImage;
      slices.rankStep = 1;
      for (std::ptrdiff_t k = 0; k < 7; ++k)
      {
        slices.Place(k, x, y);
      }
      for (const auto extremum : { Kernels::Extremum::Maximum, Kernels::Extremum::Minimum })
      {
        for (const bool isLocal : { false, true })
        {
          slices.extremum = extremum;
          slices.localThreshold.reset();
          if (isLocal)
          {
            do
            {
              slices.localThreshold = draw();
            } while (*slices.localThreshold != *slices.localThreshold);
          }
          std::vector<TypeParam> portable;
          decltype(slices.ranks) portableRanks;
          ForEachInstructionSet([&](const std::string & name) {
            const auto pixels = slices.Project();
            portableRanks = portable.empty() ? slices.ranks : portableRanks;
            portable = portable.empty() ? pixels : portable;
            EXPECT_TRUE(HaveSameValues(pixels, portable)) << name << ", fractions " << x << ' ' << y;
            EXPECT_EQ(slices.ranks, portableRanks) << name << ", fractions " << x << ' ' << y;
          });
        }
      }
    }
  }
}

TYPED_TEST(ShearWarpKernelsTyped, AddBlockHasTheSumsOfThePortableKernelsAtSpecialNumbers)
{
  const auto specials = MakeSpecialPixels<TypeParam>();
  Random     random(45);
  for (const std::int32_t x : RimFractions)
  {
    for (const std::int32_t y : RimFractions)
    {
      SlicesFixture<TypeParam> slices(random, 40, 9, 7);
      slices.Fill([&](std::ptrdiff_t) { return specials[random.Integer(0, specials.size() - 1)]; });
      slices.rowsOf = Kernels::BlockRows::OfImage;
      for (std::ptrdiff_t k = 0; k < 7; ++k)
      {
        slices.Place(k, x, y);
      }
      slices.Project();
      const auto portable = [&] {
        SetEnvironment("SHEARWARPMIP_INSTRUCTION_SET", "portable");
        return slices.Add(true);
      }();
      ForEachInstructionSet([&](const std::string & name) {
        const auto [sums, counts] = slices.Add(false);
        EXPECT_EQ(counts, portable.second) << name << ", fractions " << x << ' ' << y;
        if constexpr (std::is_same_v<TypeParam, float>)
        {
          EXPECT_TRUE(HaveSameValues(sums, portable.first)) << name << ", fractions " << x << ' ' << y;
          // a sample that is not a number does not count
          EXPECT_TRUE(std::any_of(counts.begin(), counts.end(), [](std::uint32_t count) { return count < 7; }));
        }
        else if constexpr (std::is_integral_v<TypeParam>)
        {
          EXPECT_EQ(std::memcmp(sums.data(), portable.first.data(), sums.size() * sizeof(sums[0])), 0) << name;
        }
      });
    }
  }
}

TYPED_TEST(ShearWarpKernelsTyped, WarpRowStaysWithinTheRangeOfItsPixels)
{
  Random random(8);
  for (int repeat = 0; repeat < 2000; ++repeat)
  {
    auto pixels = MakeRandomPixels<TypeParam>(random, 4);
    if (repeat % 2 == 0)
    {
      std::fill(pixels.begin(), pixels.end(), pixels.front());
    }
    const double column = random.Uniform(-0.9, 1.9);
    const auto   value = WarpAt(pixels, column, random.Uniform(-0.9, 1.9));
    ASSERT_GE(value, *std::min_element(pixels.begin(), pixels.end()));
    ASSERT_LE(value, *std::max_element(pixels.begin(), pixels.end()));
  }
}

TYPED_TEST(ShearWarpKernelsTyped, TransposeSliceSwapsColumnsAndRows)
{
  Random random(9);
  for (const std::ptrdiff_t columns : { 1, 2, 17, 31, 32, 33, 64, 77, 129 })
  {
    for (const std::ptrdiff_t rows : { 1, 2, 17, 31, 32, 33, 64, 77, 129 })
    {
      const auto           input = MakeRandomPixels<TypeParam>(random, columns * rows);
      const TypeParam      untouched{ 77 };
      const std::ptrdiff_t length = Guard + columns * rows + Guard;
      // begins at a line of the cache
      constexpr std::size_t line = 64;
      std::size_t           bytes = length * sizeof(TypeParam) + line;
      std::vector<char>     memory(bytes);
      void *                place = memory.data();
      auto * const          output = static_cast<TypeParam *>(std::align(line, bytes - line, place, bytes));
      ForEachInstructionSet([&](const std::string &) {
        for (const bool isStreamed : { false, true })
        {
          std::fill(output, output + length, untouched);
          Kernels::GetKernels<TypeParam>().transposeSlice(input.data(), columns, rows, output + Guard, isStreamed);
          for (std::ptrdiff_t n = 0; n < columns * rows; ++n)
          {
            ASSERT_EQ(output[Guard + (n % columns) * rows + n / columns], input[n]);
          }
          EXPECT_EQ(std::count(output, output + Guard, untouched), Guard);
          EXPECT_EQ(std::count(output + length - Guard, output + length, untouched), Guard);
        }
      });
    }
  }
}

TYPED_TEST(ShearWarpKernelsFloating, NotANumberNeverWins)
{
  constexpr TypeParam notANumber = std::numeric_limits<TypeParam>::quiet_NaN();
  Random              random(10);
  for (int bad = 0; bad < 2; ++bad)
  {
    SlicesFixture<TypeParam> slices(random, 3, 3, 2);
    slices.Fill([=](std::ptrdiff_t n) { return n / 9 == bad ? notANumber : TypeParam{ -5 }; });
    EXPECT_EQ(slices.Project(), std::vector<TypeParam>(9, -5));
  }

  SlicesFixture<TypeParam> slices(random, 5, 1, 1);
  slices.Fill([=](std::ptrdiff_t n) { return n == 2 ? notANumber : TypeParam{ 1 }; });
  constexpr TypeParam none = -std::numeric_limits<TypeParam>::infinity();
  EXPECT_EQ(slices.Project(), (std::vector<TypeParam>{ 1, 1, none, 1, 1 }));
  slices.Place(0, 1, 0);
  EXPECT_EQ(slices.Project(), (std::vector<TypeParam>{ 1, 1, none, none, 1 }));
}

TYPED_TEST(ShearWarpKernelsFloating, AVoxelOutsideOfTheMaskHasNoWeight)
{
  // its weight, 100 / 2^15 * 100 / 2^15, is rounded to zero
  const TypeParam above[] = { std::numeric_limits<TypeParam>::quiet_NaN(), 1 };
  const TypeParam below[] = { 1, 1 };
  EXPECT_EQ(Kernels::SampleCounted(above + 1, below + 1, 0, -1, 100, 100, 0b0111), 1);
}

TYPED_TEST(ShearWarpKernelsFloating, MinusInfinityCountsAsNoSample)
{
  constexpr TypeParam    infinity = std::numeric_limits<TypeParam>::infinity();
  std::vector<TypeParam> pixels(4, -infinity);
  EXPECT_EQ(WarpAt(pixels, 0.5, 0.5), 7);
  pixels[3] = 20;
  EXPECT_EQ(WarpAt(pixels, 0.5, 0.5), 20);
}

TYPED_TEST(ShearWarpKernelsFloating, InfinityWinsWhereItHasWeight)
{
  constexpr TypeParam      infinity = std::numeric_limits<TypeParam>::infinity();
  Random                   random(11);
  SlicesFixture<TypeParam> slices(random, 5, 1, 1);
  slices.Fill([=](std::ptrdiff_t n) { return n == 2 ? infinity : TypeParam{ 1 }; });
  EXPECT_EQ(slices.Project(), (std::vector<TypeParam>{ 1, 1, infinity, 1, 1 }));
  const std::vector<TypeParam> pixels{ 1, infinity, 1, 1 };
  EXPECT_EQ(WarpAt(pixels, 0.5, 0.5), infinity);
  EXPECT_EQ(WarpAt(pixels, 0.0, 0.5), 1);
}
