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

#include "itkImageFileReader.h"
#include "itkImageFileWriter.h"
#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPView.h"

#include <cstdlib>
#include <iostream>

int
main(int argc, char * argv[])
{
  if (argc != 4)
  {
    std::cerr << "Usage: " << argv[0] << " INPUT OUTPUT AZIMUTH" << std::endl;
    return EXIT_FAILURE;
  }
  using ImageType = itk::Image<short, 3>;
  try
  {
    const auto image = itk::ReadImage<ImageType>(argv[1]);

    auto mip = itk::ShearWarpMIPImageFilter<ImageType>::New();
    mip->SetInput(image);
    mip->SetTransform(
      itk::ShearWarpMIPView::MakeTransform(image, itk::ShearWarpMIPViewEnums::Direction::Anterior, std::atof(argv[3])));
    itk::WriteImage(mip->GetOutput(), argv[2]);
  }
  catch (const itk::ExceptionObject & error)
  {
    std::cerr << error.GetDescription() << std::endl;
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
