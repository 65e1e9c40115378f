// Filters work without Python's lock: its other threads run meanwhile, and Ctrl-C ends an update. What comes before them
// in the pipeline keeps the lock, because it may be Python, or a library for one thread.

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

// A function that works without Python's lock.
%define SHEAR_WARP_MIP_UNLOCK(function)
%exception function {
  PyThreadState * const state = PyEval_SaveThread();
  try {
    $action
    PyEval_RestoreThread(state);
  } catch (const std::exception & e) {
    PyEval_RestoreThread(state);
    SWIG_exception_fail(SWIG_RuntimeError, e.what());
  }
}
%enddef
