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
#include "Views.h"

#include "itkMath.h"
#include "itkShearWarpMIPView.h"

namespace itk::ShearWarpBenchmark
{
const std::vector<Angles> &
GetViews()
{
  static const std::vector<Angles> views = [] {
    std::vector<Angles> result;
    for (int angle = 0; angle <= 180; angle += 10)
    {
      result.push_back({ 0.0, static_cast<double>(angle), 0.0 });
    }
    for (int angle = 0; angle <= 180; angle += 20)
    {
      result.push_back({ static_cast<double>(angle), 0.0, 0.0 });
    }
    result.insert(result.end(),
                  { { 50, 0, 40 }, { 65, 0, 20 }, { 40, 0, 70 }, { 85, 0, 30 }, { 70, 0, 110 }, { 25, 0, 200 } });
    return result;
  }();
  return views;
}

ViewTransformType::Pointer
MakeView(const ImageBase<3> * image, const Angles & angles)
{
  const double degrees[3] = { angles.first, angles.second, angles.third };

  auto transform = ViewTransformType::New();
  for (unsigned int axis = 0; axis < 3; ++axis)
  {
    ViewTransformType::OutputVectorType direction(0.0);
    direction[axis] = 1.0;
    transform->Rotate3D(direction, -degrees[axis] * Math::pi_over_180);
  }
  transform->SetMatrix(image->GetDirection() * transform->GetMatrix());
  transform->SetOffset(ShearWarpMIPView::GetCenter(image).GetVectorFromOrigin());
  return transform;
}
} // namespace itk::ShearWarpBenchmark
