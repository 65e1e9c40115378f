#-- # Grading Level Criteria Report
#-- EVALUATION DATE: 2026-11-22
#-- EVALUATORS: [The ShearWarpMIP contributors]
#--
#-- ## Compliance level 5 star
#--   - [ ] Much used in the community
#--   - [X] Tests run more than 90 % of the code (tools/coverage.sh fails below 95 %)
#--   - [ ] Dashboards that somebody watches
#--   - [X] What matters in the API is wrapped for Python
#--   - [ ] All of levels 4 to 1
#--
#-- ## Compliance level 4 star
#--   - [X] ITK's code style
#--   - [X] The module needs nothing but ITK (its program needs CLI11)
#--   - [ ] Built and tested on all platforms within a month of each release of ITK
#--            - [ ] Windows, shared libraries, Visual Studio
#--            - [ ] macOS, clang
#--            - [X] Linux, gcc
#--   - [ ] A community of developers
#--   - [X] Tests run more than 75 % of the code
#--   - [ ] Continuous integration: the workflows are in .github/workflows, and have not run yet
#--   - [X] All of levels 3 to 1
#--
#-- ## Compliance level 3 star
#--   - [X] The interfaces are complete and mostly stable
#--   - [X] Tests run more than 10 % of the code
#--   - [X] Tests pass on at least one platform
#--   - [X] All of levels 2 and 1
#--
#-- ## Compliance level 2 star
#--   - [X] Can be built in at least one environment
#--
#-- ## Compliance level 1 star
#--   - [X] Compiles on at least one platform
#--
#-- ### Justification
#       Built and tested on Debian 12 only: gcc against ITK 5.2 and 5.4, clang for the fuzzers and clang-tidy.

# the repository is the proposed one, the tag is set when it is published; ITK itself then takes the tag's commit
itk_fetch_module(
  ShearWarpMIP
  "Maximum intensity projection (MIP) of 3D images from any direction, exact and fast, by shear-warp factorization
(Fang et al., Magn Reson Med 47:696-700, 2002)."
  MODULE_COMPLIANCE_LEVEL 3
  GIT_REPOSITORY https://github.com/InsightSoftwareConsortium/ITKShearWarpMIP.git
  GIT_TAG v0.1.0
)
