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

#include <cmath>

namespace
{
/** Of a frame without a slab the plane through the image's center. */
std::vector<DicomView>
MakeViews(const ProjectionOptions & projection, const itk::ImageBase<3> * grid)
{
  std::vector<DicomView> views;
  for (const Frame & frame : projection.frames)
  {
    DicomView view;
    view.transform = frame.transform;
    view.thickness = frame.slabFar - frame.slabNear;
    view.depth = std::isfinite(view.thickness) ? 0.5 * (frame.slabNear + frame.slabFar)
                                               : ComputeDepthOfCenter(frame.transform, grid);
    view.angle = frame.angle;
    views.push_back(view);
  }
  return views;
}

/** Why pictures of PET are no reprojection by maximum, empty if they may be one. */
std::string
FindNoReprojection(const Options & options)
{
  const bool isSlabOff = !options.slab.empty() && !(options.slab[0] <= 0.0 && options.slab[1] >= 0.0);
  return options.frames == 0         ? "they are no turn, see --frames"
         : options.isRocking         ? "--rocking turns to and fro"
         : options.mode != "maximum" ? "--mode is not maximum"
         : options.localMaximum      ? "--local-maximum shows other values"
         : options.attenuation > 0.0 ? "--attenuation changes values"
         : isSlabOff                 ? "the slab is beside the axis"
                                     : "";
}
} // namespace

void
WriteDicom(OutputFiles & files, const std::string & path, const Product & product)
{
  const Options &    options = product.options;
  DicomSeriesOptions dicom;
  dicom.mode = product.projection.mode;
  dicom.noReprojection = FindNoReprojection(options);
  dicom.warn = product.warn;
  dicom.isSuv = product.isSuv;
  dicom.derivation += product.isSuv ? " of SUV by body weight" : "";
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
  WriteDicomSeries(files,
                   product.pictures.image ? product.pictures : product.projections.stack,
                   MakeViews(product.projection, product.volume.times.front().image),
                   product.volume.dicomFiles,
                   path,
                   dicom);
}
