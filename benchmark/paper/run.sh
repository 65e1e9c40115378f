#!/usr/bin/env bash
# Repeats the experiments of Fang et al. (Magn Reson Med 47:696-700, 2002), with their methods and with the filter: in
# less than ten minutes on two cores. Writes REPORT.md, its pictures (figures/), and the numbers (CSV files). What is missing
# on a Debian or Ubuntu machine is installed, as root or through sudo. The real image is from ITK's test data; ITK's
# source is downloaded for it, once.
#
#   JOBS=<n>              parallel compile jobs                   [all cores]
#   XDG_CACHE_HOME=<dir>  the cache is itk-shearwarpmip/ inside   [~/.cache]
#   ITK_SOURCE_DIR=<dir>  ITK's source with its test data         [downloaded and cached]
#
# Usage: run.sh [--smoke] [--output FOLDER] [--image FILE]
#   --smoke          only try everything, in a fraction of the time; the numbers say little
#   --output FOLDER  where the results go                         [paper-output]
#   --image FILE     this 3D image, which ITK reads, instead of the one from ITK's test data
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../../tools/common.sh"

repetitions=9
output=paper-output
image=
description=('MR image of a head' 'MultiFrameDicomTest.dcm of the test data of ITK')
while [ $# -gt 0 ]; do
  case $1 in
    --smoke) repetitions=1 ;;
    --output | --image)
      [ $# -ge 2 ] || die "$1 needs a value, see --help"
      if [ "$1" = --output ]; then output=$2; else image=$2 description=(image "$(basename "$2")"); fi
      shift ;;
    *) exit_with_usage "$1" ;;
  esac
  shift
done

program=$root/build/benchmark-program/benchmark/paper/shear-warp-mip-paper

find_image() { image=$(find_head); }

timed "installed what building needs" need_packages build-essential cmake ninja-build libinsighttoolkit5-dev \
  libbenchmark-dev libcli11-dev python3-matplotlib python3-pandas python3-pil python3-tabulate
timed "built the program" build_release benchmark-program shear-warp-mip-paper -DShearWarpMIP_BUILD_APPS=OFF \
  -DShearWarpMIP_BUILD_BENCHMARKS=ON
[ -n "$image" ] || timed "found the image" find_image
mkdir -p "$output"
timed "measured" "$program" --output "$output" --image "$image" --repetitions "$repetitions"
timed "wrote the report" /usr/bin/python3 "$root/benchmark/paper/report.py" "$output" "${description[@]}"
say "
The report is $(cd "$output" && pwd)/REPORT.md. The program is $program; try it with --help."
