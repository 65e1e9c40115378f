#include "itkShearWarpMIPImageFilter.h"
#include "itkShearWarpMIPView.h"
#include <gtest/gtest.h>
#include <iostream>
TEST(A,B){
  using I=itk::Image<unsigned short,3>; auto im=I::New(); im->SetRegions(itk::Size<3>{{256,256,64}}); im->Allocate(); im->FillBuffer(7);
  auto f=itk::ShearWarpMIPImageFilter<I>::New(); f->SetInput(im);
  using D=itk::ShearWarpMIPViewEnums::Direction;
  for(auto d:{D::Anterior,D::Left,D::Superior,D::Left}) { f->SetTransform(itk::ShearWarpMIPView::MakeTransform(im,d,10,10)); f->Update();
  std::cout<<d<<f->GetOutput()->GetLargestPossibleRegion().GetSize()<<f->GetPreparationSeconds()<<" "<<f->GetProjectionSeconds()<<" "<<f->GetWarpSeconds()<<" axis "<<f->GetPrincipalAxis()<<"\n";}
  f->Print(std::cout);
}
