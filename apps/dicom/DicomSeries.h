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
#ifndef DicomSeries_h
#define DicomSeries_h

#include "Output.h"
#include "itkTransform.h"

#include <filesystem>
#include "itkShearWarpEngine.h"

#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/** Where a frame of a DICOM series lies. */
struct DicomView
{
  /** Linear, from view space (u right in the picture, v down, w away from the viewer) to the patient's (towards left,
   * posterior, head), both in mm. */
  itk::Transform<double, 3, 3>::ConstPointer transform;
  /** The picture's w in view space, in mm. */
  double depth{ 0.0 };
  /** Of the slab that was projected, along w in view space, in mm; infinite if that is the whole volume. */
  double thickness{ std::numeric_limits<double>::infinity() };
  /** How far the view has turned, in degrees; not a number if that does not apply. */
  double angle{ std::numeric_limits<double>::quiet_NaN() };
};

/** What DICOM says of a mode (PS3.3 C.8.16.1, PS3.16 CID 7203). */
struct ModeInDicom
{
  const char * derivation;
  const char * series;    // begins the description of a series
  const char * imageType; // value 4 of Image Type
  const char * code;
  const char * meaning;
  const char * petObstacle; // why pictures of PET are no reprojections, or empty
};

/** The one place of the program that describes modes to DICOM. */
const ModeInDicom &
DescribeMode(itk::ShearWarpMIPImageFilterEnums::Mode mode);

struct DicomSeriesOptions
{
  itk::ShearWarpMIPImageFilterEnums::Mode mode{ itk::ShearWarpMIPImageFilterEnums::Mode::Maximum };
  /** In DerivationDescription, behind the words of the mode: printable ASCII, at most 1024 characters together. */
  std::string derivation;
  /** Why the pictures of a PET series are no reprojection by maximum, if there is a reason beside their geometry. */
  std::string noReprojection;
  /** Whether values are SUV by body weight, from Bq/ml. */
  bool isSuv{ false };
  /** If given, all frames are in one file, to be played at this time from one to the next, in ms. */
  std::optional<double> frameTime;
  /** Is told why the pictures of a PET series are Secondary Capture. */
  std::function<void(const std::string &)> warn;
  /** SeriesDescription, printable ASCII, at most 64 characters. If empty, the mode's and the source's. */
  std::string description;
  /** If not given, the source's and 1000 more. */
  std::optional<int> number;
  /** The lowest and the highest value to tell apart. If not given the source's window, or else all values. */
  std::optional<std::pair<double, double>> window;
  /** Whether low values are to be displayed white, though no source says so. */
  bool isInverted{ false };
  /** Attributes of text as "gggg|eeee" of an image that was projected, if there is no source. */
  std::map<std::string, std::string> attributes;
  /** ManufacturerModelName and SoftwareVersions. */
  std::string program{ "shear-warp-mip" };
  std::string version;
};

/** The w in view space, in mm, of a \a point of the patient's space. \a transform is as in DicomView. */
double
ComputeDepth(const itk::Transform<double, 3, 3> * transform, const itk::Point<double, 3> & point);

/** Writes each frame of \a frames as a DICOM file of one new series into \a directory, which must be empty or not exist
 * (its parent must). Names sort as the frames do. Files appear when all are complete.
 *
 * \a frames has the axes u (columns), v (rows) and frame, with origin and spacing of the first two in view space, in
 * mm, and one component, or three of unsigned char, as RGB; \a views has as many elements as there are frames.
 *
 * \a source are the DICOM files of the series that was projected, all of which are referenced. From the first come
 * patient, study, frame of reference, character set, lossy compression and acquisition; its equipment is the one that
 * contributed. If \a source is empty, the same comes from DicomSeriesOptions::attributes; without these, study and
 * frame of reference are new and the patient is unknown.
 *
 * The SOP class, by DICOM PS3.3 (2024):
 * - CT and MR Image Storage for such sources: in these, values, position and orientation are understood everywhere.
 *   What they want to know of the acquisition (C.8.2.1, C.8.3.1) the source has; an MR source without is none. An MR
 *   image may be a "PROJECTION IMAGE" (C.8.3.1.1.1). The standard's editor advises so: pydicom's issue 1186.
 * - PET Image Storage for a turn of a PET source, as a reprojection (C.8.9.1), of maxima about one axis: see
 *   FindReprojectionObstacle() and FindMissingPetAttribute(). Values keep their unit, so that SUV can be computed from
 *   the attributes, which come from the image that was acquired first. ImageType has PRIMARY (C.8.9.4.1.1).
 * - Secondary Capture Image Storage for all others, enhanced images among them. It is for computed pictures of any
 *   modality (A.8), may have an Image Plane, which ties it to a frame of reference (Table A.8-1 since CP 2330; older
 *   readers, as GDCM 3.0, ignore that), and any pixels.
 * - not Enhanced CT or MR, though they know MAX_IP (C.8.16.2.1.3): not every archive takes them.
 * - Multi-frame Grayscale Byte or Word Secondary Capture (A.8.3, A.8.4) if a frame time is asked for, for archives that
 *   play it: with the Cine module, but without planes, for few viewers look for them in its functional groups
 * (A.8.4.5).
 *
 * ImageType is DERIVED, SECONDARY (C.7.6.1.1.2), PROJECTION IMAGE (of MR; for CT, C.8.2.1.1.1 has terms for
 * cross-sections and localizers alone, but no closed list) and MAX_IP or MIN_IP.
 *
 * Pixels have 16 bits. Whole numbers are exact if the lowest and the highest are at most 65535 apart; all others are
 * rounded to 65536 levels from the lowest to the highest, one RescaleSlope and RescaleIntercept for all frames. As an
 * MR image has none (A.4.3), MR becomes Secondary Capture where one is needed. PET has no intercept (C.8.9.4): its
 * values are rounded to multiples of one slope, signed ones if a value is negative, which holds whole numbers that fit.
 *
 * RGB becomes Secondary Capture of 8 bits, without rescale and window (C.7.6.3.1.2).
 *
 * Low values are displayed white (MONOCHROME1) if the first source's low values are, and values stay as they are. PET
 * is always MONOCHROME2 (C.8.9.4.1.2).
 *
 * Patient Orientation has the letters of ComputeEdgeLetters().
 *
 * Throws std::runtime_error, and leaves nothing, if \a directory is not as above or not writable, if a source is not
 * DICOM, if a picture is too large, if a pixel is not finite, if the plane of a view is sheared, or if a text does not
 * fit. */
void
WriteDicomSeries(const AnyImage &                           frames,
                 const std::vector<DicomView> &             views,
                 const std::vector<std::filesystem::path> & source,
                 const std::filesystem::path &              directory,
                 const DicomSeriesOptions &                 options = {});

/** The same, but files appear with others at the Commit() of \a files. */
void
WriteDicomSeries(OutputFiles &                              files,
                 const AnyImage &                           frames,
                 const std::vector<DicomView> &             views,
                 const std::vector<std::filesystem::path> & source,
                 const std::filesystem::path &              directory,
                 const DicomSeriesOptions &                 options = {});

#endif
