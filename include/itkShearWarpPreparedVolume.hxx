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
#ifndef itkShearWarpPreparedVolume_hxx
#define itkShearWarpPreparedVolume_hxx

namespace itk
{
template <typename TPixel>
template <typename TParallelize>
auto
ShearWarpPreparedVolume<TPixel>::GetSlices(const ImageType *    image,
                                           unsigned int         principalAxis,
                                           const TParallelize & parallelize) -> SliceStackType
{
  if (!this->HoldsCopyOf(image))
  {
    this->Release();
  }
  if (!this->IsPrepared(image, principalAxis))
  {
    m_Transposed = Self::Transpose(image, parallelize);
    m_Image = image;
    m_ImageMTime = image->GetMTime();
  }

  const Size<3>        size = image->GetBufferedRegion().GetSize();
  const std::ptrdiff_t x = size[0];
  const std::ptrdiff_t y = size[1];
  const std::ptrdiff_t z = size[2];
  switch (principalAxis)
  {
    case 0:
      return { m_Transposed->GetImportPointer(), y, z, x, x * y, y };
    case 1:
      return { image->GetBufferPointer(), x, z, y, x * y, x };
    default:
      return { image->GetBufferPointer(), x, y, z, x, x * y };
  }
}

template <typename TPixel>
template <typename TParallelize>
auto
ShearWarpPreparedVolume<TPixel>::Transpose(const ImageType * image, const TParallelize & parallelize) ->
  typename ContainerType::Pointer
{
  const Size<3>       size = image->GetBufferedRegion().GetSize();
  const SizeValueType slice = size[0] * size[1];
  auto                transposed = ContainerType::New();
  transposed->Reserve(slice * size[2]);

  const TPixel * const input = image->GetBufferPointer();
  TPixel * const       output = transposed->GetImportPointer();
  parallelize(size[2], [=](SizeValueType begin, SizeValueType end) {
    for (SizeValueType z = begin; z < end; ++z)
    {
      ShearWarp::TransposeSlice(input + z * slice, size[0], size[1], output + z * slice);
    }
  });
  return transposed;
}
} // namespace itk

#endif
