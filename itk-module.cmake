set(
  DOCUMENTATION
  "Maximum intensity projection (MIP) of 3D images from any direction, fast and defined bit by bit, by
shear-warp factorization and reduced resampling: Fang et al., Fast Maximum Intensity Projection Algorithm
Using Shear Warp Factorization and Reduced Resampling, Magn Reson Med 47:696-700, 2002."
)

itk_module(
  ShearWarpMIP
  ENABLE_SHARED
  DEPENDS
  ITKCommon
  ITKTransform
  TEST_DEPENDS
  ITKImageFilterBase
  ITKGoogleTest
  ITKImageGrid
  ITKImageStatistics
  ITKIOGDCM
  ITKIOMeta
  ITKIONRRD
  EXCLUDE_FROM_DEFAULT
  DESCRIPTION
  "${DOCUMENTATION}"
)
