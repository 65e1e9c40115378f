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
#ifndef Segments_h
#define Segments_h

#include "DicomSegments.h"
#include "Picture.h"

#include "itkRGBPixel.h"

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/** A label, or one of one component where an image has layers. */
struct Segment
{
  std::string                  name;
  itk::RGBPixel<unsigned char> colour;
  unsigned int                 component;
  std::uint64_t                label;
  /** Its voxels and those beside them. */
  itk::ImageRegion<3> box;
};

struct Segments
{
  Volume               labels;
  std::vector<Segment> list;
};

/** Most segments of an image. */
constexpr std::size_t MostSegments = 1000;

/** Reads a DICOM segmentation, or an image of labels, whole numbers; 0 and less are none. Names and colors are as in 3D
 * Slicer's segmentation files (.seg.nrrd), in the file's meta data: SegmentN_LabelValue, SegmentN_Layer, SegmentN_Name,
 * SegmentN_Color; see https://slicer.readthedocs.io/en/latest/developer_guide/modules/segmentations.html. Others are
 * "label N" and have the colors of Okabe and Ito, Color Universal Design, 2008. Throws if pixels are no whole numbers,
 * if the image is 4D, or if it has too many labels. */
Segments
ReadSegments(const std::string & path, const WarningFunction & warn);

/** How many there are, and their names. */
std::string
Describe(const Segments & segments);

/** RGB pictures of \a pictures, of 8 bits and one or three components, with the outlines of segments: in the segment's
 * color the pixels of its projection that have one of their four neighbors outside of it. Its projection is where the
 * maximum along the ray of its interpolated indicator is at least a half. \a project projects a volume on the pictures'
 * grid. */
AnyImage
DrawSegments(const AnyImage &                                   pictures,
             const Segments &                                   segments,
             const std::function<Projections(const Volume &)> & project);

#endif
