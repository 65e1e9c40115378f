# The tests of the engine, in the folder test. They need no ITK, only GoogleTest, the engine, and the folders test and
# src/engine to include from.
set(
  ShearWarpEngineGTests
  engine/EngineGTest.cxx
  engine/ExactGTest.cxx
  engine/GeometryGTest.cxx
  engine/KernelsGTest.cxx
  engine/PreparedVolumeGTest.cxx
  engine/ProjectorGTest.cxx
)
