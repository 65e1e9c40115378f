# shear_warp_mip_threads(IS_STREAMED SWIG_NAME...): filters of the current submodule are made with the thread pool, and
# updated without Python's lock, unless the C++ expression IS_STREAMED of `self` is true.
macro(shear_warp_mip_threads is_streamed)
  string(APPEND ITK_WRAP_PYTHON_SWIG_EXT "%{\n#include \"ShearWarpMIPGuards.h\"\n%}\n")
  foreach(file threader update)
    string(APPEND ITK_WRAP_PYTHON_SWIG_EXT "%include \"${ShearWarpMIP_SOURCE_DIR}/wrapping/${file}.i\"\n")
  endforeach()
  foreach(swig_name ${ARGN})
    foreach(function New Clone)
      string(APPEND ITK_WRAP_PYTHON_SWIG_EXT "SHEAR_WARP_MIP_MAKE_WITH_THREAD_POOL(${swig_name}::${function})\n")
    endforeach()
    string(APPEND ITK_WRAP_PYTHON_SWIG_EXT "SHEAR_WARP_MIP_UPDATE(${swig_name}, ${is_streamed})\n")
  endforeach()
endmacro()
