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
#include "Buffer.h"

#include <new>
#include <string>
#include <utility>

#ifdef __linux__
#  include <sys/mman.h>
#endif

namespace itk::ShearWarp
{
namespace
{
constexpr std::size_t CacheLine = 64;
constexpr std::size_t HugePage = std::size_t{ 1 } << 21;

std::align_val_t
GetAlignment(std::size_t size)
{
  return std::align_val_t{ size < HugePage ? CacheLine : HugePage };
}
} // namespace

Buffer::Buffer(Buffer && other) noexcept
  : m_Memory(std::exchange(other.m_Memory, nullptr))
  , m_Size(std::exchange(other.m_Size, 0))
{}

Buffer &
Buffer::operator=(Buffer && other) noexcept
{
  std::swap(m_Memory, other.m_Memory);
  std::swap(m_Size, other.m_Size);
  return *this;
}

void
Buffer::Reserve(std::size_t bytes, const char * purpose)
{
  if (bytes <= m_Size)
  {
    return;
  }
  this->Release();
  m_Memory = ::operator new(bytes, GetAlignment(bytes), std::nothrow);
  if (!m_Memory)
  {
    Throw(OutOfMemory("Failed to allocate " + std::to_string(bytes) + " bytes for " + purpose + '.'));
  }
  m_Size = bytes;
#ifdef __linux__
  if (bytes >= HugePage)
  {
    // the system may refuse
    madvise(m_Memory, bytes, MADV_HUGEPAGE);
  }
#endif
}

void
Buffer::Release()
{
  if (m_Memory)
  {
    ::operator delete(m_Memory, GetAlignment(m_Size));
    m_Memory = nullptr;
    m_Size = 0;
  }
}
} // namespace itk::ShearWarp
