# What the module's folders call of ITK's build system, for a build against an installed ITK: the module's library with
# its CMake package, and its tests.

include(CMakePackageConfigHelpers)
include(CheckCXXCompilerFlag)
include(CTest)
include(GenerateExportHeader)
include(GNUInstallDirs)
include(GoogleTest)

function(itk_module_add_library module)
  set(install_include_dir ${CMAKE_INSTALL_INCLUDEDIR}/${module})
  set(install_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/${module})

  add_library(${module} ${ARGN})
  generate_export_header(
    ${module}
    EXPORT_MACRO_NAME ${module}_EXPORT
    NO_EXPORT_MACRO_NAME ${module}_HIDDEN
    EXPORT_FILE_NAME include/${module}Export.h
  )
  target_compile_features(${module} PUBLIC cxx_std_17)
  target_include_directories(
    ${module}
    PUBLIC
      $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
      $<BUILD_INTERFACE:${CMAKE_CURRENT_BINARY_DIR}/include>
      $<INSTALL_INTERFACE:${install_include_dir}>
  )
  target_link_libraries(${module} PUBLIC ${ITK_LIBRARIES})
  set_target_properties(
    ${module}
    PROPERTIES POSITION_INDEPENDENT_CODE ON VERSION ${PROJECT_VERSION} SOVERSION 0
  )

  set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME dev)
  install(TARGETS ${module} EXPORT ${module}Targets)
  install(
    DIRECTORY ${PROJECT_SOURCE_DIR}/include/ ${CMAKE_CURRENT_BINARY_DIR}/include/
    DESTINATION ${install_include_dir}
  )
  install(EXPORT ${module}Targets DESTINATION ${install_package_dir})
  set(config ${CMAKE_CURRENT_BINARY_DIR}/${module}Config)
  file(
    WRITE ${config}.cmake
    "include(CMakeFindDependencyMacro)
find_dependency(ITK ${ITK_VERSION_MAJOR}.${ITK_VERSION_MINOR} COMPONENTS ITKCommon ITKTransform)
include(\${CMAKE_CURRENT_LIST_DIR}/${module}Targets.cmake)
"
  )
  write_basic_package_version_file(${config}Version.cmake COMPATIBILITY SameMajorVersion)
  install(FILES ${config}.cmake ${config}Version.cmake DESTINATION ${install_package_dir})
endfunction()

macro(itk_module_test)
  set(
    ShearWarpMIP_TEST_IMAGES
    ""
    CACHE PATH
    "Folder with the images named in test/Input; the tests on real images are skipped without it."
  )
  shearwarpmip_find_gtest()
  find_package(
    ITK
    REQUIRED
    COMPONENTS ITKCommon ITKTransform ITKImageFilterBase ITKImageGrid ITKImageStatistics ITKIOGDCM ITKIOMeta ITKIONRRD
  )
  shearwarpmip_use_itk()
endmacro()

# Gives the path of an image; ITK would fetch it.
function(ExternalData_Expand_Arguments target images)
  string(APPEND ShearWarpMIP_TEST_IMAGES "/")
  string(REGEX REPLACE "^/$" "" folder "${ShearWarpMIP_TEST_IMAGES}")
  set(${images} "${folder}image" PARENT_SCOPE)
endfunction()

function(ExternalData_Add_Target target)
  add_custom_target(${target})
endfunction()

macro(creategoogletestdriver module libraries sources)
  add_executable(${module}GTestDriver ${sources})
  target_link_libraries(${module}GTestDriver ${module} ${ITK_LIBRARIES} GTest::gtest GTest::gtest_main)
  gtest_discover_tests(${module}GTestDriver DISCOVERY_TIMEOUT 120)
  # whoever includes the headers may compile them for a processor that fuses multiplications and additions, and without
  # numbers that are not finite
  check_cxx_compiler_flag("-march=native -ffast-math" ${module}_CAN_FUSE)
  if(${module}_CAN_FUSE AND NOT CMAKE_CROSSCOMPILING)
    add_executable(${module}FusedGTestDriver itkShearWarpMIPArithmeticGTest.cxx)
    target_include_directories(${module}FusedGTestDriver PRIVATE ${PROJECT_SOURCE_DIR}/src/engine)
    target_compile_options(${module}FusedGTestDriver PRIVATE -O2 -march=native -ffast-math -Wno-nan-infinity-disabled)
    target_link_libraries(${module}FusedGTestDriver ${module} ${ITK_LIBRARIES} GTest::gtest GTest::gtest_main)
    gtest_discover_tests(${module}FusedGTestDriver TEST_SUFFIX .Fused)
  endif()
endmacro()
