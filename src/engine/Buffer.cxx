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

#include "itkMacro.h"
#include "itkShearWarpEngine.h"

#include "itksys/SystemInformation.hxx"

#include <limits>
#include <new>
#include <utility>

#ifdef __linux__
#  include <sys/mman.h>
#endif

namespace itk
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

ShearWarpBuffer::ShearWarpBuffer(ShearWarpBuffer && other) noexcept
  : m_Memory(std::exchange(other.m_Memory, nullptr))
  , m_Size(std::exchange(other.m_Size, 0))
{}

ShearWarpBuffer &
ShearWarpBuffer::operator=(ShearWarpBuffer && other) noexcept
{
  std::swap(m_Memory, other.m_Memory);
  std::swap(m_Size, other.m_Size);
  return *this;
}

void
ShearWarpBuffer::Reserve(std::size_t bytes, const char * purpose)
{
  if (bytes <= m_Size)
  {
    return;
  }
  this->Release();
  m_Memory = ::operator new(bytes, GetAlignment(bytes), std::nothrow);
  if (!m_Memory)
  {
    throw MemoryAllocationError(
      __FILE__, __LINE__, "Failed to allocate " + std::to_string(bytes) + " bytes for " + purpose + '.', ITK_LOCATION);
  }
  m_Size = bytes;
#ifdef __linux__
  if (bytes >= HugePage)
  {
    // a wish, not a condition
    madvise(m_Memory, bytes, MADV_HUGEPAGE);
  }
#endif
}

void
ShearWarpBuffer::Release()
{
  if (m_Memory)
  {
    ::operator delete(m_Memory, GetAlignment(m_Size));
    m_Memory = nullptr;
    m_Size = 0;
  }
}

double
ShearWarp::GetPhysicalMemory()
{
  static const double memory = [] {
    itksys::SystemInformation system;
    system.RunMemoryCheck();
    const auto megabytes = system.GetTotalPhysicalMemory();
    return megabytes > 0 ? 0x1p20 * static_cast<double>(megabytes)
                         : 0.5 * static_cast<double>(std::numeric_limits<std::ptrdiff_t>::max());
  }();
  return memory;
}
} // namespace itk
