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

namespace
{
OutputFiles::Layout
GetLayout(const Stack & stack)
{
  return stack.isSeries ? OutputFiles::Layout::Series : OutputFiles::Layout::Still;
}
} // namespace

void
WriteValues(OutputFiles & files, const std::string & path, const Product & product)
{
  const AnyImage & values = product.stack.projections.stack;
  auto             texts = DescribeStack(product.stack);
  if (!product.options.isInPlace)
  {
    files.Write(path, values, GetLayout(product.stack), texts);
    return;
  }
  OutputFiles::Texts ofVolumes;
  for (const std::string key : { "HasOrientation", "IsInverted", "IsSuv" })
  {
    ofVolumes.insert(texts.extract(key));
  }
  files.Write(path, values, OutputFiles::Layout::Volume, ofVolumes);
}

void
WritePictures(OutputFiles & files, const std::string & path, const Product & product)
{
  const Options & options = product.options;
  const Stack &   stack = product.stack;
  const AnyImage pictures = product.pictures.image ? product.pictures : MakePictures(stack.projections, product.window);
  DrawLabels(pictures, stack.frames, { !options.isUnlabelled, options.isAnnotated, stack.hasOrientation });
  if (FindFormat(path) == FileFormat::Animation)
  {
    files.WriteAnimation(path, pictures, product.rate);
  }
  else
  {
    files.Write(path, pictures, GetLayout(stack));
  }
}
