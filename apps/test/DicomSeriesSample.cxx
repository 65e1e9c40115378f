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

#include "itkAffineTransform.h"

#include <cmath>
#include <iostream>

/** Writes a series of a turning ball for check_dicom_series.py: KIND DIRECTORY [SOURCE...]. KIND is signed, unsigned or
 * float. */
int
main(int argc, char * argv[])
{
  if (argc < 3)
  {
    std::cerr << "KIND DIRECTORY [SOURCE...] are needed\n";
    return 1;
  }
  constexpr unsigned int      size = 48;
  constexpr unsigned int      count = 6;
  const std::string           kind = argv[1];
  const double                lowest = kind == "signed" ? -1024.0 : 0.0;
  const double                scale = kind == "float" ? 0.001 : 1.0;
  const auto                  grid = itk::ImageBase<3>::New();
  const itk::Point<double, 3> origin(-0.5 * (size - 1));
  std::vector<DicomView>      views;
  grid->SetRegions(itk::Size<3>{ { size, size + 1, count } });
  grid->SetOrigin(origin);
  const AnyImage frames = kind == "unsigned" ? MakeAnyImage<unsigned short>(grid, 1) : MakeAnyImage<float>(grid, 1);
  for (unsigned int frame = 0; frame < count; ++frame)
  {
    const double           angle = itk::Math::twopi * frame / count;
    const auto             transform = itk::AffineTransform<double, 3>::New();
    itk::Vector<double, 3> axis(0.0);
    axis[2] = 1.0;
    transform->Rotate(1, 2, itk::Math::pi_over_2);
    transform->Rotate3D(axis, angle);
    DicomView view;
    view.transform = transform.GetPointer();
    view.angle = 360.0 * frame / count;
    views.push_back(view);
    for (unsigned int v = 0; v <= size; ++v)
    {
      for (unsigned int u = 0; u < size; ++u)
      {
        const double      distance = std::hypot(u + origin[0] - 12.0 * std::cos(angle), v + origin[1] - 5.0);
        const double      value = lowest + scale * std::floor(std::max(0.0, 100.0 * (12.0 - distance)));
        const std::size_t pixel = (std::size_t(frame) * (size + 1) + v) * size + u;
        if (kind == "unsigned")
        {
          CastImage<unsigned short>(frames).GetBufferPointer()[pixel] = static_cast<unsigned short>(value);
        }
        else
        {
          CastImage<float>(frames).GetBufferPointer()[pixel] = static_cast<float>(value);
        }
      }
    }
  }
  try
  {
    DicomSeriesOptions options;
    options.version = "0.1.0";
    WriteDicomSeries(frames, views, { argv + 3, argv + argc }, argv[2], options);
  }
  catch (const std::exception & error)
  {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
