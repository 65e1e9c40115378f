# Python docstrings from the headers' Doxygen comments: Doxygen's XML through ITK's converter to SWIG.
# ITK's own switch for this (ITK_WRAP_DOC) does not work for modules outside of its source tree.

find_package(Doxygen QUIET)
if(NOT DOXYGEN_FOUND)
  message(WARNING "Doxygen was not found: the Python classes get no docstrings.")
endif()

set(ShearWarpMIP_DOXYGEN_DIR ${CMAKE_CURRENT_BINARY_DIR}/doxygen)
if(DOXYGEN_FOUND)
  file(GLOB headers ${ShearWarpMIP_SOURCE_DIR}/include/*.h)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${headers})
  string(REPLACE ";" " " headers "${headers}")
  file(MAKE_DIRECTORY ${ShearWarpMIP_DOXYGEN_DIR})
  file(
    WRITE ${ShearWarpMIP_DOXYGEN_DIR}/Doxyfile
    "@INCLUDE = ${CMAKE_CURRENT_SOURCE_DIR}/Doxyfile
INPUT = ${headers}
INPUT_FILTER = \"${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/repeat_comments.py\"
OUTPUT_DIRECTORY = ${ShearWarpMIP_DOXYGEN_DIR}
GENERATE_HTML = NO
GENERATE_XML = YES
WARNINGS = NO
"
  )
  execute_process(COMMAND ${DOXYGEN_EXECUTABLE} ${ShearWarpMIP_DOXYGEN_DIR}/Doxyfile COMMAND_ERROR_IS_FATAL ANY)
endif()

# shear_warp_mip_docstrings(CLASS SWIG_NAME...): docstrings of itk::CLASS for its wrapped names, in the current submodule.
macro(shear_warp_mip_docstrings class)
  if(DOXYGEN_FOUND)
    set(xml_file ${ShearWarpMIP_DOXYGEN_DIR}/xml/classitk_1_1${class}.xml)
    # the converter leaves out static functions
    file(READ ${xml_file} xml)
    string(REPLACE "public-static-func" "public-func" xml "${xml}")
    file(WRITE ${xml_file} "${xml}")
    string(REPLACE ";" "\t" tabbed_names "${ARGN}")
    file(WRITE ${ShearWarpMIP_DOXYGEN_DIR}/${class}.conf "${xml_file}\titk::${class}\t${tabbed_names}\n")
    execute_process(
      COMMAND
        ${Python3_EXECUTABLE} ${WRAP_ITK_CMAKE_DIR}/Generators/Doc/itk_doxy2swig.py
        ${ShearWarpMIP_DOXYGEN_DIR}/${class}.conf ${ShearWarpMIP_DOXYGEN_DIR}/${class}_doc.i
      COMMAND_ERROR_IS_FATAL ANY
    )
    string(APPEND ITK_WRAP_PYTHON_SWIG_EXT "%include \"${ShearWarpMIP_DOXYGEN_DIR}/${class}_doc.i\"\n")
  endif()
endmacro()
