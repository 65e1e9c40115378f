// Writes the maximum intensity projection of a 3D image, seen from the patient's front at an azimuth in degrees.

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
