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
#include "Subject.h"

#include "Data.h"
#include "RayCasting.h"

#include "itkImageFileReader.h"
#include "itkMultiThreaderBase.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

namespace itk::ShearWarpBenchmark
{
namespace
{
/** Calls function(begin, end) in parallel for bands that make up [0, count). */
template <typename TFunction>
void
Parallelize(SizeValueType count, const TFunction & function)
{
  constexpr SizeValueType band = 32;
  MultiThreaderBase::New()->ParallelizeArray(
    0,
    (count + band - 1) / band,
    [&](SizeValueType index) { function(index * band, std::min((index + 1) * band, count)); },
    nullptr);
}

/** The shortest of several calls of \a function, in seconds; after a second no further call begins. */
template <typename TFunction>
double
GetShortestTime(unsigned int repetitions, const TFunction & function)
{
  double shortest = std::numeric_limits<double>::max();
  double total = 0.0;
  for (unsigned int repetition = 0; repetition < repetitions && total < 1.0; ++repetition)
  {
    const auto start = std::chrono::steady_clock::now();
    function();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    shortest = std::min(shortest, seconds);
    total += seconds;
  }
  return shortest;
}
} // namespace

template <typename TPixel>
typename Image<TPixel, 3>::Pointer
LoadVolume(const DataSet & data)
{
  if (data.file.empty())
  {
    return MakeVolume<TPixel>(data.kind, data.size);
  }
  return ReadImage<Image<TPixel, 3>>(data.file);
}

Size<2>
GetOutputSize(const ImageBase<3> * volume)
{
  const Size<3> size = volume->GetLargestPossibleRegion().GetSize();
  return Size<2>::Filled(std::max(size[0], size[1]));
}

double
GetOutputSpacing(const ImageBase<3> * volume)
{
  return *std::min_element(volume->GetSpacing().Begin(), volume->GetSpacing().End());
}

template <typename TPixel>
Subject<TPixel>::Subject(const DataSet & data)
  : m_Volume(LoadVolume<TPixel>(data))
  , m_PlainShearWarp(m_Volume)
{
  const TPixel * voxels = m_Volume->GetBufferPointer();
  const TPixel * voxelsEnd = voxels + m_Volume->GetLargestPossibleRegion().GetNumberOfPixels();
  if (!std::all_of(voxels, voxelsEnd, [](TPixel voxel) { return std::isfinite(static_cast<float>(voxel)); }))
  {
    itkGenericExceptionMacro("The volume has infinite voxels or such that are not a number; they are not measured.");
  }
  m_Maximum = *std::max_element(voxels, voxelsEnd);
  m_OutputSize = GetOutputSize(m_Volume);
  m_OutputSpacing = GetOutputSpacing(m_Volume);

  struct Candidate
  {
    unsigned int view;
    double       difference;
  };
  std::map<unsigned int, Candidate> nearest;
  for (unsigned int view = 0; view < GetNumberOfViews(); ++view)
  {
    const ShearWarpFactorization factorization = this->Factorize(view);
    m_Expected.push_back(this->ProjectPlainly(factorization));

    const auto      shear = factorization.GetShear();
    const double    larger = std::max(std::abs(shear[0]), std::abs(shear[1]));
    const Candidate candidate{ view, std::abs(larger - std::tan(30.0 * Math::pi_over_180)) };
    const auto [entry, isNew] = nearest.emplace(factorization.GetPrincipalAxis(), candidate);
    if (!isNew && candidate.difference < entry->second.difference - 1e-6)
    {
      entry->second = candidate;
    }
  }
  for (const auto & [axis, candidate] : nearest)
  {
    m_ComparedViews.push_back(candidate.view);
  }
  m_PlainShearWarp.Release();
}

template <typename TPixel>
typename Subject<TPixel>::OutputType::Pointer
Subject<TPixel>::MakeOutput() const
{
  const auto   output = OutputType::New();
  const double first = -0.5 * m_OutputSpacing * (static_cast<double>(m_OutputSize[0]) - 1.0);
  const double spacing[] = { m_OutputSpacing, m_OutputSpacing };
  const double origin[] = { first, first };
  output->SetRegions(m_OutputSize);
  output->SetSpacing(spacing);
  output->SetOrigin(origin);
  output->Allocate();
  return output;
}

template <typename TPixel>
ShearWarpFactorization
Subject<TPixel>::Factorize(unsigned int view) const
{
  return ShearWarpFactorization(MakeView(m_Volume, view), m_Volume, this->MakeOutput());
}

template <typename TPixel>
std::vector<TPixel>
Subject<TPixel>::ProjectPlainly(const ShearWarpFactorization & factorization)
{
  m_PlainShearWarp.Prepare(factorization.GetPrincipalAxis());
  const auto          size = factorization.GetIntermediateSize();
  std::vector<TPixel> intermediate(size[0] * size[1]);
  std::vector<TPixel> output(m_OutputSize[0] * m_OutputSize[1]);
  Parallelize(size[1], [&](SizeValueType begin, SizeValueType end) {
    m_PlainShearWarp.ProjectRows(factorization, begin, end, intermediate);
  });
  Parallelize(m_OutputSize[1], [&](SizeValueType begin, SizeValueType end) {
    m_PlainShearWarp.WarpRows(factorization, intermediate, begin, end, m_OutputSize[0], TPixel{}, output);
  });
  return output;
}

template <typename TPixel>
bool
Subject<TPixel>::IsExpected(unsigned int view, const OutputType * output) const
{
  // bits, so that a not-a-number equals itself
  const std::vector<TPixel> & expected = m_Expected.at(view);
  return output->GetBufferedRegion().GetSize() == m_OutputSize &&
         std::memcmp(expected.data(), output->GetBufferPointer(), expected.size() * sizeof(TPixel)) == 0;
}

template <typename TPixel>
const typename Subject<TPixel>::Comparison &
Subject<TPixel>::Compare(unsigned int repetitions)
{
  if (!m_Comparison)
  {
    Comparison comparison{ 0.0, 0.0 };
    const auto output = this->MakeOutput();
    for (const unsigned int view : m_ComparedViews)
    {
      const ShearWarpFactorization factorization = this->Factorize(view);
      m_PlainShearWarp.Prepare(factorization.GetPrincipalAxis());
      comparison.plainShearWarp += GetShortestTime(repetitions, [&] { m_PlainShearWarp.Project(factorization); });
      const auto transform = MakeView(m_Volume, view);
      comparison.rayCasting +=
        GetShortestTime(repetitions, [&] { CastRays<TPixel>(m_Volume, transform, m_OutputSpacing, TPixel{}, output); });
    }
    comparison.plainShearWarp /= static_cast<double>(m_ComparedViews.size());
    comparison.rayCasting /= static_cast<double>(m_ComparedViews.size());
    m_PlainShearWarp.Release();
    m_Comparison = comparison;
  }
  return *m_Comparison;
}

template class Subject<std::uint8_t>;
template Image<std::uint8_t, 3>::Pointer
LoadVolume<std::uint8_t>(const DataSet &);
template class Subject<std::int16_t>;
template Image<std::int16_t, 3>::Pointer
LoadVolume<std::int16_t>(const DataSet &);
template class Subject<std::uint16_t>;
template Image<std::uint16_t, 3>::Pointer
LoadVolume<std::uint16_t>(const DataSet &);
template class Subject<float>;
template Image<float, 3>::Pointer
LoadVolume<float>(const DataSet &);

} // namespace itk::ShearWarpBenchmark
