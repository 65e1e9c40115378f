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

#include "ShearWarpMIPExport.h"

#include <cstddef>
#include <vector>

namespace itk
{
namespace ShearWarp
{
template <typename TElement>
std::size_t
CountBytes(const std::vector<TElement> & elements)
{
  const auto * begin = reinterpret_cast<const char *>(elements.data());
  const auto * end = reinterpret_cast<const char *>(elements.data() + elements.capacity());
  return static_cast<std::size_t>(end - begin);
}
} // namespace ShearWarp

/** \class ShearWarpBuffer
 * \brief Uninitialized memory that begins at a cache line, in huge pages where the system offers them.
 * \ingroup ShearWarpMIP
 */
class ShearWarpMIP_EXPORT ShearWarpBuffer
{
public:
  ShearWarpBuffer() = default;
  ShearWarpBuffer(const ShearWarpBuffer &) = delete;
  ShearWarpBuffer &
  operator=(const ShearWarpBuffer &) = delete;
  ShearWarpBuffer(ShearWarpBuffer && other) noexcept;
  ShearWarpBuffer &
  operator=(ShearWarpBuffer && other) noexcept;
  ~ShearWarpBuffer() { this->Release(); }

  /** Makes the buffer hold at least \a bytes bytes. What it held is lost if it has to grow. Throws
   * MemoryAllocationError, which tells the number of bytes and that they were for \a purpose, and the buffer is empty
   * then. */
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
} // namespace itk

#endif
