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
#include "Measurement.h"
#include "PlainShearWarp.h"
#include "RayCasting.h"
#include "Views.h"

#include "itkImageFileReader.h"
#include "itkMultiThreaderBase.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>

namespace itk::ShearWarpBenchmark
{
/** Seconds that \a function takes. */
template <typename TFunction>
double
Time(const TFunction & function)
{
  const auto start = std::chrono::steady_clock::now();
  function();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/** What all measurements of one volume share: the volume, the output grid and, made without the filter, the expected
 * output of every view and the times of the methods that the filter is compared with. */
template <typename TPixel>
class Subject
{
public:
  using VolumeType = Image<TPixel, 3>;
  using OutputType = Image<TPixel, 2>;

  /** Mean seconds for a view, over the compared views, of methods with one thread. */
  struct Comparison
  {
    double rayCasting{ 0.0 };
    double plainShearWarp{ 0.0 }; // without the warp
  };

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
    std::map<unsigned int, double>       differences;
    std::map<unsigned int, unsigned int> nearest;
    for (auto view = static_cast<unsigned int>(m_Expected.size()); view < GetNumberOfViews(); ++view)
    {
      const ShearWarpFactorization factorization = this->Factorize(view);
      m_Expected.push_back(this->ProjectPlainly(factorization));

      const unsigned int axis = factorization.GetPrincipalAxis();
      const auto         shear = factorization.GetShear();
      const double       larger = std::max(std::abs(shear[0]), std::abs(shear[1]));
      const double       difference = std::abs(larger - std::tan(30.0 * Math::pi_over_180));
      if (differences.count(axis) == 0 || difference < differences[axis] - 1e-6)
      {
        differences[axis] = difference;
        nearest[axis] = view;
      }
    }
    for (const auto & [axis, view] : nearest)
    {
      comparedViews.push_back(view);
    }
    m_Copy.reset();
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
  const Comparison &
  Compare(unsigned int repetitions)
  {
    if (!m_Comparison)
    {
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
      m_Comparison.emplace();
      for (const unsigned int view : comparedViews)
      {
        const ShearWarpFactorization factorization = this->Factorize(view);
        const auto &                 copy = this->GetCopy(factorization.GetPrincipalAxis());
        const auto                   transform = MakeView(volume, view);
        const auto                   count = static_cast<double>(comparedViews.size());
        m_Comparison->plainShearWarp += getShortestTime([&] { Project(copy, factorization); }) / count;
        m_Comparison->rayCasting +=
          getShortestTime([&] { CastRays<TPixel>(volume, transform, output->GetSpacing()[0], TPixel{}, output); }) /
          count;
      }
      m_Copy.reset();
    }
    return *m_Comparison;
  }

  typename VolumeType::Pointer volume;
  TPixel                       maximum;

  /** A square of the larger of the volume's first two sizes, at its smallest spacing. */
  typename OutputType::Pointer output;

  /** For each principal axis the view whose larger shear is nearest to that of 30 degrees off the axis. */
  std::vector<unsigned int> comparedViews;

private:
  /** Only the last one is kept. */
  const PermutedVolume<TPixel> &
  GetCopy(unsigned int principalAxis)
  {
    if (!m_Copy || m_CopiedAxis != principalAxis)
    {
      m_Copy.reset();
      m_Copy.emplace(volume, principalAxis);
      m_CopiedAxis = principalAxis;
    }
    return *m_Copy;
  }

  ShearWarpFactorization
  Factorize(unsigned int view) const
  {
    return ShearWarpFactorization(MakeView(volume, view), volume, output);
  }

  std::vector<TPixel>
  ProjectPlainly(const ShearWarpFactorization & factorization)
  {
    // bands of rows in parallel
    const auto parallelize = [](SizeValueType count, const auto & function) {
      constexpr SizeValueType band = 32;
      MultiThreaderBase::New()->ParallelizeArray(
        0,
        (count + band - 1) / band,
        [&](SizeValueType n) { function(n * band, std::min((n + 1) * band, count)); },
        nullptr);
    };
    const auto &        copy = this->GetCopy(factorization.GetPrincipalAxis());
    const auto          size = factorization.GetIntermediateSize();
    const auto          length = output->GetBufferedRegion().GetSize(0);
    std::vector<TPixel> intermediate(size[0] * size[1]);
    std::vector<TPixel> picture(length * length);
    parallelize(size[1], [&](SizeValueType begin, SizeValueType end) {
      ProjectRows(copy, factorization, begin, end, intermediate);
    });
    parallelize(length, [&](SizeValueType begin, SizeValueType end) {
      WarpRows(factorization, intermediate, begin, end, length, TPixel{}, picture);
    });
    return picture;
  }

  std::optional<PermutedVolume<TPixel>> m_Copy;
  unsigned int                          m_CopiedAxis{ 0 };
  std::vector<std::vector<TPixel>>      m_Expected;
  std::optional<Comparison>             m_Comparison;
};
} // namespace itk::ShearWarpBenchmark

#endif
