# For CMAKE_PROJECT_INCLUDE of builds of ITK: less to compile. VNL is hundreds of small files, most of ITK's compile time,
# and builds in a fraction of it as a unity build.
if(PROJECT_NAME MATCHES "^vnl(_algo)?$")
  set(CMAKE_UNITY_BUILD ON)
  set(CMAKE_UNITY_BUILD_BATCH_SIZE 12)
  # these overload functions that the others' templates call, or repeat a name
  file(
    GLOB_RECURSE alone
    RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}
    *rational*.cxx
    *bignum*.cxx
    *complex*.cxx
    vnl_bracket_minimum.cxx
    vnl_brent_minimizer.cxx
  )
  set_source_files_properties(${alone} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endif()
# A unity build of ITKCommon takes a third of the time, too. It was tried with ITK 5.4 only.
if(PROJECT_NAME STREQUAL "ITKCommon" AND ITK_VERSION_MAJOR EQUAL 5)
  set(CMAKE_UNITY_BUILD ON)
  set(CMAKE_UNITY_BUILD_BATCH_SIZE 10)
endif()
# These take minutes to compile, and the module and its program spend no time in them.
if(PROJECT_NAME MATCHES "^(netlib|vnl(_algo)?|ITKFFT|ITKTransformFactory)$")
  set(CMAKE_C_FLAGS_RELEASE "-O0 -DNDEBUG")
  set(CMAKE_CXX_FLAGS_RELEASE "-O0 -DNDEBUG")
endif()
