#!/usr/bin/env bash
# Makes the moving picture of cine.md, of a real chest from ITK's test data; ITK's source is downloaded for it, once. What
# is missing on a Debian or Ubuntu machine is installed, as root or through sudo, and itk from PyPI into the cache.
#
#   JOBS=<n>              parallel compile jobs                   [all cores]
#   XDG_CACHE_HOME=<dir>  the cache is itk-shearwarpmip/ inside   [~/.cache]
#   ITK_SOURCE_DIR=<dir>  ITK's source with its test data         [downloaded and cached]
#
# Usage: cine.sh [PICTURE]
#   PICTURE  the animation    [doc/heart.gif]
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../tools/common.sh"

[[ ${1:-} != -* ]] || exit_with_usage "$1"
picture=${1:-$root/doc/heart.gif}
program=$root/build/demo/apps/shear-warp-mip
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Of 25 phases of the heart the first one, with the spacing that the file has where GDCM does not find it.
extract_phase() {
  run_itk_python - "$@" << 'PYTHON'
import sys

import itk
import numpy as np

phases = itk.imread(sys.argv[1], itk.US)
phase = itk.image_from_array(np.ascontiguousarray(itk.array_view_from_image(phases)[::25]))
phase.SetOrigin(phases.GetOrigin())
phase.SetDirection(phases.GetDirection())
phase.SetSpacing([1.8518518, 1.8518518, 1.85])
itk.imwrite(phase, sys.argv[2])
PYTHON
}

timed "installed what building needs" need_packages build-essential cmake ninja-build libinsighttoolkit5-dev \
  libcli11-dev ffmpeg python3-venv
timed "built the program" build_release demo shear-warp-mip -DShearWarpMIP_BUILD_APPS=ON
image=$(find_itk_image "$root/test/Input/Philips_4D_DICOM.dcm.cid")
cp "$image" "$work/phases.dcm"
timed "took one phase" extract_phase "$work/phases.dcm" "$work/phase.nrrd"
timed "turned" "$program" "$work/phase.nrrd" "$picture" --frames 36 --elevation 5 --output-spacing 1.2 --rate 10
