#!/usr/bin/env bash
# Makes the pictures of modes.md, of the program's synthetic angiogram and of a real image from ITK's test data; ITK's
# source is downloaded for it, once. What is missing on a Debian or Ubuntu machine is installed, as root or through sudo,
# and itk from PyPI into the cache.
#
#   JOBS=<n>              parallel compile jobs                   [all cores]
#   XDG_CACHE_HOME=<dir>  the cache is itk-shearwarpmip/ inside   [~/.cache]
#   ITK_SOURCE_DIR=<dir>  ITK's source with its test data         [downloaded and cached]
#
# Usage: modes.sh [FOLDER]
#   FOLDER  where the pictures go    [doc/modes]
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../tools/common.sh"

[[ ${1:-} != -* ]] || exit_with_usage "$1"
folder=${1:-$root/doc/modes}
program=$root/build/demo/apps/shear-warp-mip
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# make_inputs IMAGE MASK DIFFERENCE COLOURS LABELS: an ellipsoid within the skull; the difference of left and right; the
# image where the ellipsoid is not, where it is, and its differences from slice to slice, as three channels; labels of two
# ellipsoids, in voxels of four times the spacing.
make_inputs() {
  run_itk_python - "$@" << 'PYTHON'
import sys
import itk
import numpy as np

image = itk.imread(sys.argv[1])
z, y, x = np.ogrid[tuple(slice(-1, 1, 1j * n) for n in tuple(itk.size(image))[::-1])]
ellipsoid = (x / 0.62) ** 2 + ((y + 0.22) / 0.5) ** 2 + (z / 0.55) ** 2 < 1
voxels = itk.array_view_from_image(image)
edges = np.abs(np.gradient(voxels, axis=0))
colours = np.clip(np.stack((voxels * ~ellipsoid, voxels * ellipsoid, edges), -1), 0, 32767).astype(np.int16)
inner = (x / 0.3) ** 2 + ((y + 0.3) / 0.25) ** 2 + (z / 0.3) ** 2 < 1
labels = np.where(inner, 3, ellipsoid).astype(np.uint8)[::4, ::4, ::4]
for array, path in zip((ellipsoid.astype(np.uint8), voxels - voxels[::-1], colours, labels), sys.argv[2:]):
    result = itk.image_from_array(array, is_vector=array.ndim == 4)
    # CopyInformation() would copy the number of components too
    step = 4 if array is labels else 1
    result.SetSpacing([step * each for each in image.GetSpacing()])
    result.SetOrigin(image.GetOrigin())
    result.SetDirection(image.GetDirection())
    itk.imwrite(result, path)
PYTHON
}

# project IMAGE NAME OPTION...
project() {
  local image=$work/$1 name=$2
  shift 2
  "$program" "$image" "$folder/$name.png" "$@"
}

make_pictures_of_angiogram() {
  local image=angiogram.nrrd
  local left=(--view left --output-spacing 0.25 --size "340,340" --window "40,800")
  local above=(--azimuth 42 --elevation 35 --output-spacing 0.12 --size "340,340" --window "0,800")
  "$program" --write-phantom "$work/$image"
  project "$image" plain --azimuth 30
  project "$image" fading --azimuth 30 --slab "-80,inf" --attenuation 0.01
  "$program" "$work/$image" "$work/mip.png" --azimuth 30 --window "200,900" --depth-colour "$folder/depth.png"
  project "$image" plain-left "${left[@]}"
  project "$image" local "${left[@]}" --local-maximum 300
  project "$image" plain-detail "${above[@]}"
  project "$image" exact-detail "${above[@]}" --exact
  project "$image" superior --view superior
  "$program" "$work/$image" "$work/slice.nrrd" --azimuth 30 --slab "-10,10" --in-place
  project "$image" in-place --view superior --overlay "$work/slice.nrrd"
}

make_pictures_of_head() {
  local oblique=(--view left --azimuth 20)
  project head.dcm maximum "${oblique[@]}"
  project head.dcm minimum --view left --mode minimum --slab "-5,5"
  project difference.nrrd absolute --view anterior --mode absolute-maximum --slab "-5,5" --window "-400,400"
  project head.dcm mean "${oblique[@]}" --mode mean --slab "-10,10"
  project labels.nrrd labels-linear "${oblique[@]}" --output-spacing 0.75 --window "0,3"
  project labels.nrrd labels "${oblique[@]}" --output-spacing 0.75 --window "0,3" --interpolation nearest
  project head.dcm slab "${oblique[@]}" --slab "-10,10"
  project head.dcm crop "${oblique[@]}" --crop "-40,40,-inf,inf,-inf,inf"
  project head.dcm mask "${oblique[@]}" --mask "$work/mask.nrrd"
  project colours.nrrd channels "${oblique[@]}"
}

timed "installed what building needs" need_packages build-essential cmake ninja-build libinsighttoolkit5-dev \
  libcli11-dev python3-venv
timed "built the program" build_release demo shear-warp-mip -DShearWarpMIP_BUILD_APPS=ON
head=$(find_head)
cp "$head" "$work/head.dcm"
mkdir -p "$folder"
timed "made a mask, a difference, colours and labels" make_inputs "$work/head.dcm" "$work/mask.nrrd" \
  "$work/difference.nrrd" "$work/colours.nrrd" "$work/labels.nrrd"
timed "made the pictures of the angiogram" make_pictures_of_angiogram
timed "made the pictures of the head" make_pictures_of_head
