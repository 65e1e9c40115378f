// ITK's default threader is a global of the process. PyPI's ITK chooses TBB, which the ITK linked into this module does
// not have: a filter of ours is made with the thread pool, and the global stays as it was.

%pythoncode %{
# the first to ask chooses the default: PyPI's ITK shall
import itk.ITKCommonBasePython
itk.ITKCommonBasePython.itkMultiThreaderBase.GetGlobalDefaultThreader()
%}

%define SHEAR_WARP_MIP_MAKE_WITH_THREAD_POOL(function)
%exception function {
  try {
    const DefaultThreaderGuard guard;
    $action
  } catch (const std::exception & e) {
    SWIG_exception_fail(SWIG_RuntimeError, e.what());
  }
}
%enddef
