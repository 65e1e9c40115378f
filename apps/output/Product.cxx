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
#include "Product.h"
#include "Labels.h"

void
WriteValues(OutputFiles & files, const std::string & path, const Product & product)
{
  files.Write(path,
              product.projections.stack,
              product.options.isInPlace ? OutputFiles::Layout::Volume
              : product.isSeries        ? OutputFiles::Layout::Series
                                        : OutputFiles::Layout::Still);
}

void
WritePictures(OutputFiles & files, const std::string & path, const Product & product)
{
  const Options & options = product.options;
  const AnyImage  pictures =
    product.pictures.image ? product.pictures : MakePictures(product.projections, product.window);
  DrawLabels(
    pictures, product.projection.frames, { !options.isUnlabelled, options.isAnnotated, product.volume.hasOrientation });
  if (FindFormat(path) == FileFormat::Animation)
  {
    files.WriteAnimation(path, pictures, product.rate);
  }
  else
  {
    files.Write(path, pictures, product.isSeries ? OutputFiles::Layout::Series : OutputFiles::Layout::Still);
  }
}
