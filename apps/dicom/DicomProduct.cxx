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
#include "DicomSeries.h"
#include "Product.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace
{
/** Of a frame without a slab the plane through the image's center, or through the origin of view space. */
std::vector<DicomView>
MakeViews(const Stack & stack)
{
  std::vector<DicomView> views;
  for (const Frame & frame : stack.frames)
  {
    DicomView view;
    view.transform = frame.transform;
    view.thickness = frame.slabFar - frame.slabNear;
    view.depth = std::isfinite(view.thickness) ? 0.5 * (frame.slabNear + frame.slabFar)
                 : stack.center                ? ComputeDepth(frame.transform, *stack.center)
                                               : 0.0;
    view.angle = frame.angle;
    views.push_back(view);
  }
  return views;
}
} // namespace

void
WriteDicom(OutputFiles & files, const std::string & path, const Product & product)
{
  const Options &    options = product.options;
  DicomSeriesOptions dicom;
  dicom.mode = product.stack.mode;
  dicom.noReprojection = product.noReprojection;
  dicom.attributes = product.stack.attributes;
  dicom.isInverted = product.stack.projections.isInverted;
  dicom.warn = product.warn;
  dicom.isSuv = product.stack.isSuv;
  dicom.derivation += product.stack.isSuv ? " of SUV by body weight" : "";
  if (options.isMultiFrame)
  {
    dicom.frameTime = 1000.0 / product.rate;
  }
  dicom.derivation += options.overlay.empty() ? "" : ", with the maximum of another volume in color";
  dicom.derivation += product.isOverlaySuv ? ", in SUV by body weight" : "";
  dicom.derivation += options.segments.empty() ? "" : ", with outlines of segments";
  dicom.version = ShearWarpMIP_VERSION;
  if (product.window)
  {
    dicom.window = std::make_pair((*product.window)[0], (*product.window)[1]);
  }
  auto         sources = product.stack.dicomFiles;
  const auto & named = product.stack.sourceFiles;
  std::copy_if(named.begin(), named.end(), std::back_inserter(sources), IsDicomFile);
  WriteDicomSeries(files,
                   product.pictures.image ? product.pictures : product.stack.projections.stack,
                   MakeViews(product.stack),
                   sources,
                   path,
                   dicom);
}
