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
#ifndef Measurement_h
#define Measurement_h

#include "Data.h"

#include "itkShearWarpMIPImageFilter.h"

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

/** Registers a benchmark of which an iteration is one view: a new transform, and the filter's whole update, which is
 * what is timed. After each view the read limit is measured with as many threads. Output that differs in a bit from the
 * plain shear-warp is an error of the benchmark. README.md says what the counters are. */
void
Register(const Measurement & measurement);

/** Registers benchmarks, one for each of four axes, of which an iteration is a full turn of 36 frames by
 * ShearWarpMIPCineImageFilter, and is timed. After each the read limit is measured and, with the single filter, all of
 * its frames; frames that differ in a bit are an error of the benchmark. */
void
RegisterCine(const Measurement & measurement);

/** Whether a benchmark that ran ended with an error. */
bool
HasAnyFailed();
} // namespace itk::ShearWarpBenchmark

#endif
