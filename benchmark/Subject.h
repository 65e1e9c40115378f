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
#ifndef Subject_h
#define Subject_h

#include "Data.h"
#include "PlainShearWarp.h"
#include "RayCasting.h"

#include "itkImageFileReader.h"
#include "itkShearWarpMIPImageFilter.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>

namespace itk::ShearWarpBenchmark
{
/** How the filter projects a volume. */
struct Measurement
{
  using ReducedResampling = ShearWarpMIPImageFilter<Image<float, 3>>::ReducedResamplingEnum;

  DataSet           data;
  std::string       instructionSet;
  unsigned int      threads;
  ReducedResampling reducedResampling;
  unsigned int      repetitions; // of each view
  bool              hasVariants; // the filter's other parameters too
};

/** What all measurements of one volume share: the volume, the output grid and, made without the filter, the expected
 * output of every view and the times of the methods that the filter is compared with. */
template <typename TPixel>
class Subject
{
public:
  using VolumeType = Image<TPixel, 3>;
  using OutputType = Image<TPixel, 2>;

  /** Makes or reads the volume. Throws ExceptionObject if a voxel is not finite. */
  explicit Subject(const DataSet & data)
    : volume(data.file.empty() ? MakeVolume<TPixel>(data.kind, data.size) : ReadImage<VolumeType>(data.file))
    , output(OutputType::New())
  {
    const TPixel * voxels = volume->GetBufferPointer();
    const TPixel * voxelsEnd = voxels + volume->GetLargestPossibleRegion().GetNumberOfPixels();
    if (!std::all_of(voxels, voxelsEnd, [](TPixel voxel) { return std::isfinite(static_cast<float>(voxel)); }))
    {
      itkGenericExceptionMacro("The volume has infinite voxels or such that are not a number; they are not measured.");
    }
    maximum = *std::max_element(voxels, voxelsEnd);
    const auto * bytes = reinterpret_cast<const char *>(voxels);
    const auto * bytesEnd = reinterpret_cast<const char *>(voxelsEnd);
    for (std::uint64_t word = 0; bytes < bytesEnd; word = 0)
    {
      const std::ptrdiff_t length = std::min<std::ptrdiff_t>(sizeof(word), bytesEnd - bytes);
      std::memcpy(&word, bytes, static_cast<std::size_t>(length));
      sum += word;
      bytes += length;
    }

    const Size<3>       size = volume->GetLargestPossibleRegion().GetSize();
    const SizeValueType length = std::max(size[0], size[1]);
    const double        spacing = *std::min_element(volume->GetSpacing().Begin(), volume->GetSpacing().End());
    output->SetRegions(Size<2>::Filled(length));
    output->SetSpacing(Vector<double, 2>(spacing));
    output->SetOrigin(Point<double, 2>(-0.5 * spacing * (static_cast<double>(length) - 1.0)));
    output->Allocate();
  }

  /** Gives a filter its input, output grid and threads. */
  template <typename TFilter>
  void
  SetUp(TFilter & filter, const Measurement & measurement) const
  {
    filter.SetInput(volume);
    filter.SetSize(output->GetBufferedRegion().GetSize());
    filter.SetOutputSpacing(output->GetSpacing());
    filter.SetReducedResampling(measurement.reducedResampling);
    // what ITK's thread pool takes by default for so many threads
    filter.SetNumberOfWorkUnits(measurement.threads == 1 ? 1 : 4 * measurement.threads);
  }

  /** Projects all views by the plain shear-warp, once, and chooses those that are compared. */
  void
  Expect()
  {
    std::map<unsigned int, double> differences;
    for (auto view = static_cast<unsigned int>(m_Expected.size()); view < GetViews().size(); ++view)
    {
      const ShearWarpFactorization factorization = this->Factorize(view);
      const unsigned int           axis = factorization.GetPrincipalAxis();
      const auto                   intermediate = Project(this->GetCopy(axis), factorization, true);
      m_Expected.push_back(Warp(factorization, intermediate, output->GetBufferedRegion().GetSize(), TPixel{}, true));

      const auto   shear = factorization.GetShear();
      const double larger = std::max(std::abs(shear[0]), std::abs(shear[1]));
      const double difference = std::abs(larger - std::tan(30.0 * Math::pi_over_180));
      if (differences.count(axis) == 0 || difference < differences[axis] - 1e-6)
      {
        differences[axis] = difference;
        comparedViews[axis] = view;
      }
    }
    m_Copy.clear();
  }

  /** Whether the plain shear-warp gave the same bits. */
  bool
  IsExpected(unsigned int view, const OutputType * picture) const
  {
    const std::vector<TPixel> & expected = m_Expected.at(view);
    return picture->GetBufferedRegion().GetSize() == output->GetBufferedRegion().GetSize() &&
           std::memcmp(expected.data(), picture->GetBufferPointer(), expected.size() * sizeof(TPixel)) == 0;
  }

  /** Times the other methods when first called: each view \a repetitions times, or for a second, and the minimum
   * counts. */
  void
  Compare(unsigned int repetitions)
  {
    if (rayCastingSeconds > 0.0)
    {
      return;
    }
    const auto getShortestTime = [repetitions](const auto & function) {
      double shortest = std::numeric_limits<double>::max();
      double total = 0.0;
      for (unsigned int repetition = 0; repetition < repetitions && total < 1.0; ++repetition)
      {
        const double seconds = Time(function);
        shortest = std::min(shortest, seconds);
        total += seconds;
      }
      return shortest;
    };
    const auto count = static_cast<double>(comparedViews.size());
    for (const auto & [axis, view] : comparedViews)
    {
      const ShearWarpFactorization factorization = this->Factorize(view);
      const auto &                 copy = this->GetCopy(axis);
      const auto                   transform = MakeView(volume, GetViews()[view]);
      const double                 step = output->GetSpacing()[0];
      plainSeconds += getShortestTime([&] { Project(copy, factorization); }) / count;
      rayCastingSeconds +=
        getShortestTime([&] { CastRays<TPixel>(volume, transform, step, TPixel{}, output); }) / count;
    }
    m_Copy.clear();
  }

  typename VolumeType::Pointer volume;
  TPixel                       maximum;
  std::uint64_t                sum{ 0 }; // of its words of 64 bits

  /** A square of the larger of the volume's first two sizes, at its smallest spacing. */
  typename OutputType::Pointer output;

  /** For each principal axis the view whose larger shear is nearest to the shear at 30 degrees off the axis. */
  std::map<unsigned int, unsigned int> comparedViews;

  /** Of Compare(), with one thread: mean over the compared views; for the plain shear-warp, without the warp. */
  double rayCastingSeconds{ 0.0 };
  double plainSeconds{ 0.0 };

private:
  /** Only the last one is kept. */
  const PermutedVolume<TPixel> &
  GetCopy(unsigned int principalAxis)
  {
    if (m_Copy.count(principalAxis) == 0)
    {
      m_Copy.clear();
      m_Copy.try_emplace(principalAxis, volume, principalAxis);
    }
    return m_Copy.at(principalAxis);
  }

  ShearWarpFactorization
  Factorize(unsigned int view) const
  {
    return ShearWarpFactorization(MakeView(volume, GetViews()[view]), volume, output);
  }

  std::map<unsigned int, PermutedVolume<TPixel>> m_Copy;
  std::vector<std::vector<TPixel>>               m_Expected;
};
} // namespace itk::ShearWarpBenchmark

#endif
