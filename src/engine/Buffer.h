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
#ifndef itkShearWarpBuffer_h
#define itkShearWarpBuffer_h

#include "itkShearWarpGeometry.h"

#include <cstddef>
#include <vector>

namespace itk::ShearWarp
{
template <typename TElement>
std::size_t
CountBytes(const std::vector<TElement> & elements)
{
  return elements.capacity() * sizeof(TElement);
}

/** \class Buffer
 * \brief Uninitialized memory that begins at a cache line, in huge pages where the system offers them.
 * \ingroup ShearWarpMIP
 */
class ShearWarpMIP_EXPORT Buffer
{
public:
  Buffer() = default;
  Buffer(const Buffer &) = delete;
  Buffer &
  operator=(const Buffer &) = delete;
  Buffer(Buffer && other) noexcept;
  Buffer &
  operator=(Buffer && other) noexcept;
  ~Buffer() { this->Release(); }

  /** Makes the buffer hold at least \a bytes bytes. A buffer that has to grow loses its contents. Throws OutOfMemory,
   * which tells the number of bytes and \a purpose; the buffer is then empty. */
  void
  Reserve(std::size_t bytes, const char * purpose);

  void
  Release();

  std::size_t
  GetSizeInBytes() const
  {
    return m_Size;
  }

  template <typename TElement>
  TElement *
  GetPointer() const
  {
    return static_cast<TElement *>(m_Memory);
  }

private:
  void *      m_Memory{ nullptr };
  std::size_t m_Size{ 0 };
};
} // namespace itk::ShearWarp

#endif
