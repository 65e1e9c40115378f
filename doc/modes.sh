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

# The Python of the page makes inputs.
make_inputs() {
  "$program" "$work/head.dcm" --write-volume "$work/head.nrrd"
  (cd "$work" && print_blocks python doc/modes.md | run_itk_python -)
}

# The commands of the page are its indented lines, except the last ones, which measure.
make_pictures() {
  local commands
  commands=$(sed -n '/^```/,/^```$/d; /^    benchmark/q; s/^    //p' "$root/doc/modes.md")
  (cd "$work" && PATH=$(dirname "$program"):$PATH bash -e -c "$commands" && cp ./*.png "$folder")
}

timed "installed what building needs" need_packages build-essential cmake ninja-build libinsighttoolkit5-dev \
  libcli11-dev python3-venv
timed "built the program" build_release demo shear-warp-mip -DShearWarpMIP_BUILD_APPS=ON
head=$(find_head)
cp "$head" "$work/head.dcm"
mkdir -p "$folder"
timed "made a mask, a difference, colours and labels" make_inputs
timed "made the pictures" make_pictures
