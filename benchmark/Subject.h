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

#include "Measurement.h"
#include "PlainShearWarp.h"
#include "Views.h"

#include <optional>
#include <vector>

namespace itk::ShearWarpBenchmark
{
/** Makes or reads the volume. Throws ExceptionObject. */
template <typename TPixel>
typename Image<TPixel, 3>::Pointer
LoadVolume(const DataSet & data);

/** A square of the larger of the volume's first two sizes. */
Size<2>
GetOutputSize(const ImageBase<3> * volume);

/** The smallest spacing of the volume. */
double
GetOutputSpacing(const ImageBase<3> * volume);

/** Gives a filter its input, output grid and threads. */
template <typename TFilter>
void
SetUp(TFilter & filter, const typename TFilter::InputImageType * volume, const Measurement & measurement)
{
  filter.SetInput(volume);
  filter.SetSize(GetOutputSize(volume));
  filter.SetOutputSpacing(itk::Vector<double, 2>(GetOutputSpacing(volume)));
  filter.SetReducedResampling(measurement.reducedResampling);
  // what ITK's thread pool takes by default for so many threads
  filter.SetNumberOfWorkUnits(measurement.threads == 1 ? 1 : 4 * measurement.threads);
}

/** What all measurements of one volume share: the volume, the output grid and, made without the filter, the expected
 * output of every view and the times of the methods that the filter is compared with. */
template <typename TPixel>
class Subject
{
public:
  using VolumeType = Image<TPixel, 3>;
  using OutputType = Image<TPixel, 2>;

  /** Mean seconds for a view, over the views of GetComparedViews(), of methods with one thread. */
  struct Comparison
  {
    double rayCasting;
    double plainShearWarp; // without the warp
  };

  /** Makes or reads the volume, and projects it by the plain shear-warp to get the expected output.
   * Throws ExceptionObject if a voxel is not finite. */
  explicit Subject(const DataSet & data);

  const VolumeType *
  GetVolume() const
  {
    return m_Volume;
  }

  /** The largest voxel. */
  TPixel
  GetMaximum() const
  {
    return m_Maximum;
  }

  bool
  IsExpected(unsigned int view, const OutputType * output) const;

  /** Times the other methods when first called: each view \a repetitions times, or for a second, and the minimum
   * counts. */
  const Comparison &
  Compare(unsigned int repetitions);

  /** For each principal axis the view whose larger shear is nearest to that of 30 degrees off the axis. */
  const std::vector<unsigned int> &
  GetComparedViews() const
  {
    return m_ComparedViews;
  }

private:
  typename OutputType::Pointer
  MakeOutput() const;

  ShearWarpFactorization
  Factorize(unsigned int view) const;

  std::vector<TPixel>
  ProjectPlainly(const ShearWarpFactorization & factorization);

  typename VolumeType::Pointer     m_Volume;
  PlainShearWarp<TPixel>           m_PlainShearWarp;
  TPixel                           m_Maximum{};
  Size<2>                          m_OutputSize;
  double                           m_OutputSpacing{ 1.0 };
  std::vector<std::vector<TPixel>> m_Expected;
  std::vector<unsigned int>        m_ComparedViews;
  std::optional<Comparison>        m_Comparison;
};
} // namespace itk::ShearWarpBenchmark

#endif
