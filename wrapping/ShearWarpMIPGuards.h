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
#ifndef ShearWarpMIPGuards_h
#define ShearWarpMIPGuards_h

#include "itkMultiThreaderBase.h"
#include "itkProcessObject.h"

#include <Python.h>

#include <chrono>

/* What threader.i and update.i put around calls. SWIG includes an interface file only once, also where a base class has
 * it: each submodule includes this header itself. */
namespace
{
class DefaultThreaderGuard
{
public:
  using Threader = itk::MultiThreaderBaseEnums::Threader;

  DefaultThreaderGuard()
    : m_Threader(itk::MultiThreaderBase::GetGlobalDefaultThreader())
  {
    itk::MultiThreaderBase::SetGlobalDefaultThreader(Threader::Pool);
  }
  ~DefaultThreaderGuard() { itk::MultiThreaderBase::SetGlobalDefaultThreader(m_Threader); }

private:
  const Threader m_Threader;
};

class UpdateGuard
{
public:
  /** \a isStreamed: what comes before the filter is updated in its work. \a hasSignals: this is Python's main thread.
   */
  UpdateGuard(itk::ProcessObject * filter, bool isStreamed, bool hasSignals)
    : m_Filter(filter)
    , m_StartTag(filter->AddObserver(itk::StartEvent(),
                                     [this, isStreamed](const itk::EventObject &) {
                                       if (!isStreamed && !m_State)
                                       {
                                         m_State = PyEval_SaveThread();
                                       }
                                     }))
    , m_ProgressTag(filter->AddObserver(itk::ProgressEvent(), [this, hasSignals](const itk::EventObject &) {
      if (hasSignals)
      {
        this->CheckSignals();
      }
    }))
  {}

  UpdateGuard(const UpdateGuard &) = delete;

  // Python's end unwinds daemon threads that ask for the lock
  ~UpdateGuard() noexcept(false)
  {
    if (m_State)
    {
      PyEval_RestoreThread(m_State);
    }
    m_Filter->RemoveObserver(m_StartTag);
    m_Filter->RemoveObserver(m_ProgressTag);
    if (m_ErrorType)
    {
      PyErr_Restore(m_ErrorType, m_Error, m_Traceback);
    }
  }

private:
  using Clock = std::chrono::steady_clock;

  void
  CheckSignals()
  {
    // who takes the lock may wait for it
    const auto now = Clock::now();
    if (m_ErrorType || now - m_LastCheck < std::chrono::milliseconds(50))
    {
      return;
    }
    m_LastCheck = now;
    const PyGILState_STATE lock = PyGILState_Ensure();
    if (PyErr_CheckSignals() != 0)
    {
      PyErr_Fetch(&m_ErrorType, &m_Error, &m_Traceback);
      m_Filter->AbortGenerateDataOn();
    }
    PyGILState_Release(lock);
  }

  itk::ProcessObject * const m_Filter;
  PyThreadState *            m_State{ nullptr };
  Clock::time_point          m_LastCheck{ Clock::now() };
  PyObject *                 m_ErrorType{ nullptr };
  PyObject *                 m_Error{ nullptr };
  PyObject *                 m_Traceback{ nullptr };
  const unsigned long        m_StartTag;
  const unsigned long        m_ProgressTag;
};
} // namespace

#endif
