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
#ifndef itkShearWarpPartRecords_h
#define itkShearWarpPartRecords_h

#include "itkShearWarpEngine.h"
#include "kernels/Kernels.h"

#include <cstddef>

namespace itk::ShearWarp
{
/** \class PartRecords
 * \brief Packs, merges and unpacks records: the bytes that a part keeps of each pixel.
 *
 * Merged records of parts give the bits of the whole. The record of an extremum is its value and, where a pixel may
 * have none, its rank in the whole volume: 0 for no value, and 1 if the rule needs no ranks. The record of a mean is
 * the sum and the count of its samples. The record of an exact extremum is its value before rounding, not-a-number for
 * no value, and, with depth, the place on the ray; the lower place is nearer.
 *
 * \ingroup ShearWarpMIP
 */
template <typename TPixel>
class PartRecords
{
public:
  /** \a rule must live as long as this object. */
  explicit PartRecords(const ProjectionRule<TPixel> & rule)
    : m_Rule(rule)
  {}

  /** Returns the bytes of a record. */
  std::size_t
  GetSize() const;

  /** Returns whether extrema have ranks. */
  bool
  HasRanks() const;

  /** Returns whether records are pixels. */
  bool
  ArePixels() const
  {
    return !m_Rule.isExact && m_Rule.mode != Mode::Mean && !this->HasRanks();
  }

  /** Returns the value of an extremum without a sample, which is never better than a sample. */
  TPixel
  GetNone() const;

  /** Makes \a count records that have no value. */
  void
  Clear(unsigned char * records, std::ptrdiff_t count) const;

  /** Merges \a count records with those in \a into. */
  void
  Merge(const unsigned char * records, unsigned char * into, std::ptrdiff_t count) const;

  /** Writes the records of a row of an intermediate image, \a distance records from one to the next. Ranks become the
   * ranks of \a whole. \a sums are used for means. */
  void
  Pack(const IntermediateImage<TPixel> & image,
       const SummedImage<TPixel> &       sums,
       const Ranking &                   whole,
       std::ptrdiff_t                    row,
       unsigned char *                   records,
       std::ptrdiff_t                    distance) const;

  /** Writes the pixels of \a count records and, if not null, their ranks. */
  void
  Unpack(const unsigned char * records, std::ptrdiff_t count, TPixel * pixels, std::int32_t * ranks) const;

  /** Merges an exact extremum with a record. */
  void
  MergeExact(ExactNumber<TPixel> value, double place, unsigned char * record) const;

  /** Reads an exact extremum. Returns whether there is a value. */
  bool
  GetExact(const unsigned char * record, ExactNumber<TPixel> & value, double & place) const;

private:
  /** Calls \a function with the mode of an extremum as a constant. */
  template <typename TFunction>
  void
  CallWithMode(const TFunction & function) const;

  const ProjectionRule<TPixel> & m_Rule;
};
} // namespace itk::ShearWarp

#endif
