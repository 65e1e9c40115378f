// Filters work without Python's lock: its other threads run meanwhile, and Ctrl-C ends an update. What comes before them
// in the pipeline keeps the lock, because it may be Python, or a library for one thread.

%{
#include "itkProcessObject.h"

#include <chrono>

namespace
{
class UpdateGuard
{
public:
  /** \a isStreamed: what comes before the filter is updated in its work. \a hasSignals: this is Python's main thread. */
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

  void CheckSignals()
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
}
%}

%define SHEAR_WARP_MIP_UPDATE(class, isStreamed)
%exception class::_UpdateUnlocked {
  try {
    $action
  } catch (const std::exception & e) {
    if (!PyErr_Occurred()) {
      SWIG_Error(SWIG_RuntimeError, e.what());
    }
  }
  if (PyErr_Occurred()) {
    SWIG_fail;
  }
}
%extend class {
void _UpdateUnlocked(bool largest, bool hasSignals)
{
  const UpdateGuard guard(self, isStreamed, hasSignals);
  largest ? self->UpdateLargestPossibleRegion() : self->Update();
}
%pythoncode %{
    def _update(self, largest):
        import threading

        self._UpdateUnlocked(largest, threading.current_thread() is threading.main_thread())

    def Update(self):
        """Brings the output up to date. Other threads of Python run meanwhile, and Ctrl-C ends it."""
        self._update(False)

    def UpdateLargestPossibleRegion(self):
        """Brings the whole output up to date. Other threads of Python run meanwhile, and Ctrl-C ends it."""
        self._update(True)
%}
}
%enddef
