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
#ifndef Cine_h
#define Cine_h

#include "Measurement.h"

namespace itk::ShearWarpBenchmark
{
/** Registers benchmarks, one for each of four axes, of which an iteration is a full turn of 36 frames by
 * ShearWarpMIPCineImageFilter, and is timed. After each the read limit is measured and, with the single filter, all of
 * its frames; frames that differ in a bit are an error of the benchmark. README.md says what the counters are. */
void
RegisterCine(const Measurement & measurement);
} // namespace itk::ShearWarpBenchmark

#endif
