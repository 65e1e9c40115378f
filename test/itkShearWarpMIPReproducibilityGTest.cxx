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
#include "itkShearWarpMIPImageFilter.h"

#include "itkShearWarpMIPTestImages.h"

namespace
{
using namespace itk::ShearWarpMIPTest;

template <typename TPixel>
typename itk::Image<TPixel, 3>::Pointer
MakeFixedImage()
{
  const auto image = MakePlainImage<TPixel>({ { 61, 45, 53 } });
  image->SetSpacing(MakeVector3(0.75, 1.25, 1.0));
  image->SetOrigin(MakePoint3(-30.0, 12.5, 4.0));
  const auto voxels = MakeFixedVoxels<TPixel>(static_cast<std::int64_t>(image->GetPixelContainer()->Size()));
  std::copy(voxels.begin(), voxels.end(), image->GetBufferPointer());
  return image;
}

/** Along every axis from both sides, oblique, mirrored, affine; the last two on the tie of two axes. */
const double Views[][3][3] = { { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } },
                               { { 0, 0, -1 }, { 1, 0, 0 }, { 0, 1, 0 } },
                               { { 0.6, 0, 0.8 }, { 0, 1, 0 }, { -0.8, 0, 0.6 } },
                               { { 0.48, 0.8, 0.36 }, { -0.6, 0, 0.8 }, { 0.64, -0.6, 0.48 } },
                               { { -0.36, 0.48, 0.8 }, { 0.8, 0.6, 0 }, { 0.48, -0.64, -0.6 } },
                               { { 0.36, 0.8, -0.48 }, { 0.8, 0, 0.6 }, { 0.48, -0.6, -0.64 } },
                               { { 1.1, 0.2, 0.3 }, { -0.1, 0.9, -0.7 }, { 0.05, 0.4, -1.3 } },
                               { { 1, 0, 0.75 }, { 0, 1, 0 }, { 0, 0, 1 } },
                               { { 0, 1, 0.75 }, { 0, 0, 1.25 }, { 1, 0, 0.5 } } };

template <typename TPixel>
void
ExpectChecksum(unsigned int oversampling, std::uint64_t expected)
{
  const auto image = MakeFixedImage<TPixel>();
  ForEachInstructionSet([&](const std::string &) {
    for (const itk::ThreadIdType threads : { 1, 3 })
    {
      std::uint64_t checksum = EmptyChecksum;
      for (const auto & matrix : Views)
      {
        const auto filter = MakeFilter(image, MakeView(MakeMatrix(matrix), MakePoint3(-7, 40, 31)));
        filter->SetOversampling(oversampling);
        filter->SetDefaultPixelValue(TPixel{ 1 });
        filter->SetSize({ { 90, 80 } });
        filter->SetOutputSpacing(MakeVector2(0.7, 0.9));
        SetThreads(filter, threads);
        filter->Update();
        AddToChecksum<itk::Image<TPixel, 2>>(filter->GetOutput(), checksum);
      }
      EXPECT_EQ(checksum, expected) << std::hex << "0x" << checksum << ", " << threads << " threads";
    }
  });
}
} // namespace

TEST(ShearWarpMIPReproducibility, FixedViewsHaveTheChecksumsOfEveryMachine)
{
  ExpectChecksum<unsigned char>(1, 0x0875ceee5d67491f);
  ExpectChecksum<unsigned char>(2, 0xf24e8bf5387b5a5f);
  ExpectChecksum<signed char>(1, 0x4f71185320f907e6);
  ExpectChecksum<signed char>(2, 0x475c7f8233542590);
  ExpectChecksum<unsigned short>(1, 0x270936e27e857142);
  ExpectChecksum<unsigned short>(2, 0x1dbb7adfc33c9c25);
  ExpectChecksum<short>(1, 0x1a74c4e57fcad1c7);
  ExpectChecksum<short>(2, 0xe94b1ec2b0dc1f3c);
  ExpectChecksum<float>(1, 0x070e51955bb48e76);
  ExpectChecksum<float>(2, 0xdd75f641d7bf59ad);
  ExpectChecksum<double>(1, 0x142e7ff4d398df59);
  ExpectChecksum<double>(2, 0x685d6b6ede50920c);
}
