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
#ifndef Suv_h
#define Suv_h

#include "AnyImage.h"
#include "Warning.h"

/** Converts a DICOM PET series to standardized uptake values by body weight, g/ml, of type float:
 *
 *   SUVbw = c W / D
 *
 * where c is the value in Bq/ml, W the Patient's Weight in g, and D the dose in Bq at the time to which decay is
 * corrected: the Radionuclide Total Dose D0 if Decay Correction is ADMIN, and D0 2^(-t / T) if it is START, T being the
 * Radionuclide Half Life and t the time from the injection to the start of the scan. The injection is at the
 * Radiopharmaceutical Start DateTime or, without one, at the last Start Time before the scan. The scan starts at Series
 * Date and Time unless these are after the first acquisition, as of a series that was processed later; then at GE's
 * private scan time or, without one, where Frame Reference Time places it. Values in g/ml (Units GML) are SUV already.
 *
 * Source: QIBA Profile FDG-PET/CT, appendix G, vendor-neutral pseudo-codes; DICOM PS3.3 C.8.9.
 *
 * Throws std::runtime_error with the name of the attribute that is missing or is of no use. Returns false, and changes
 * nothing, if the volume is no series of PET Image Storage and not in SUV already. Warns of a dose that is unusual for
 * the weight. */
bool
ConvertToSuv(Volume & volume, const WarningFunction & warn);

#endif
