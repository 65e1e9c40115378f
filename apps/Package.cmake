# Debian packages of the program and of the library, made by cpack.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "ShearWarpMIP contributors <contributors@shearwarpmip.invalid>")
set(CPACK_PACKAGE_DIRECTORY packages)
set(CPACK_COMPONENTS_ALL program dev)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME shear-warp-mip)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS ffmpeg)
set(
  CPACK_COMPONENT_PROGRAM_DESCRIPTION
  "maximum intensity projections of 3D images
Projects CT and MR angiograms, PET and microscopy volumes from any direction,
as pictures, turning series, web pages and DICOM series."
)

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libshearwarpmip-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS libinsighttoolkit5-dev)
set(
  CPACK_COMPONENT_DEV_DESCRIPTION
  "maximum intensity projections of 3D images, for C++ with ITK
Library, headers and CMake configuration of ITK's module ShearWarpMIP."
)

set(documents ${CMAKE_CURRENT_BINARY_DIR}/documents)
string(TIMESTAMP year "%Y" UTC)
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
file(
  WRITE ${documents}/copyright
  "Copyright (C) ${year} NumFOCUS

Licensed under the Apache License, Version 2.0: /usr/share/common-licenses/Apache-2.0
"
)
file(
  WRITE ${documents}/changelog
  "shear-warp-mip (${PROJECT_VERSION}) unstable; urgency=medium

  * Version ${PROJECT_VERSION}, whose changes CHANGELOG.md has.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
"
)
execute_process(
  COMMAND gzip --best --no-name --force ${documents}/changelog
)
install(DIRECTORY ${documents}/ DESTINATION share/doc/shear-warp-mip COMPONENT program)
install(DIRECTORY ${documents}/ DESTINATION share/doc/libshearwarpmip-dev COMPONENT dev)

include(CPack)
