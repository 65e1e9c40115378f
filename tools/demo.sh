#!/usr/bin/env bash
# Builds the program shear-warp-mip and shows what it does: six anatomical views, a turning series of 36 pictures
# as an animation, as a page to turn and as a stack with the image's values, and a page that holds the volume. What
# is missing on a Debian or Ubuntu machine is installed, as root or through sudo.
#
#   JOBS=<n>              parallel compile jobs                   [all cores]
#   XDG_CACHE_HOME=<dir>  the cache is itk-shearwarpmip/ inside   [~/.cache]
#
# Usage: demo.sh [IMAGE [FOLDER [OPTION]...]]
#   IMAGE   a 3D image, or a folder with a DICOM series           [a synthetic MR angiogram of a head]
#   FOLDER  where the pictures go                                 [demo-output]
#   OPTION  --series, --volume or --suv, as the program takes them
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

[[ ${1:-} != -* ]] || exit_with_usage "$1"
[[ ${2:-} != -* ]] || die "the folder of the pictures comes before options, see --help"
for ((n = 3; n <= $#; ++n)); do
  case ${!n} in
    --series=* | --volume=* | --suv) ;;
    --series | --volume) [ $((++n)) -le $# ] || die "${!#} needs a value" ;;
    *) die "'${!n}' does not choose the volume; the program takes all options, as build/demo/apps/shear-warp-mip" ;;
  esac
done
image=${1:-}
folder=${2:-demo-output}
options=("${@:3}")
[ -z "$image" ] || [ -e "$image" ] || die "'$image' does not exist"
[ -z "$image" ] || [ ! "$image" -ef "$folder" ] || die "choose another folder for the pictures than the image's"
[ ! "$image" -ef "$folder/volume.nrrd" ] || die "choose another folder: this one keeps its volume in '$image'"
[ ! -e "$folder" ] || [ -d "$folder" ] || die "'$folder' is a file, not a folder for the pictures"

program=$root/build/demo/apps/shear-warp-mip

render_views() {
  local view
  for view in anterior posterior left right superior inferior; do
    "$program" "$image" "$folder/$view.png" --view "$view"
  done
}

render_cine() {
  local extension
  for extension in gif html; do
    "$program" "$image" "$folder/cine.$extension" --frames 36 --rate 12.5
  done
  "$program" "$image" "$folder/cine.nrrd" --frames 36
}

timed "installed what building needs" need_packages build-essential cmake ninja-build libinsighttoolkit5-dev \
  libcli11-dev ffmpeg "${page_packages[@]}"
say "building the program, some minutes at the first time"
timed "built the program" build_release demo all -DShearWarpMIP_BUILD_APPS=ON
say "the program is $program"
mkdir -p "$folder"
if [ -z "$image" ]; then
  timed "made a synthetic angiogram" "$program" --write-phantom "$folder/volume.nrrd"
else
  timed "read the image" "$program" "$image" --write-volume "$folder/volume.nrrd" "${options[@]}"
fi
image=$folder/volume.nrrd
timed "rendered six views" render_views
timed "rendered 36 frames, three times" render_cine
timed "wrote a page that holds the volume" "$program" "$image" "$folder/volume.html" --page-volume

say "
The pictures are in $(cd "$folder" && pwd):
  anterior.png posterior.png left.png right.png superior.png inferior.png
  cine.gif (animated), cine.html (to turn, in a browser), cine.nrrd (with the image's values)
  volume.html (the volume itself, to turn freely, cut and click, in a browser)
Try the program with --help: $program"
