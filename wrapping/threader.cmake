# shear_warp_mip_threader(SWIG_NAME...): filters of the current submodule are made with the thread pool.
macro(shear_warp_mip_threader)
  string(APPEND ITK_WRAP_PYTHON_SWIG_EXT "%include \"${ShearWarpMIP_SOURCE_DIR}/wrapping/threader.i\"\n")
  foreach(swig_name ${ARGN})
    foreach(function New Clone)
      string(APPEND ITK_WRAP_PYTHON_SWIG_EXT "SHEAR_WARP_MIP_MAKE_WITH_THREAD_POOL(${swig_name}::${function})\n")
    endforeach()
  endforeach()
endmacro()
