#!/usr/bin/env bash
# Builds shear-warp-mip-benchmark and measures the filter's speed: about a quarter of an hour on two cores. Writes
# results.json (of Google Benchmark) and results.md (tables). What is missing on a Debian or Ubuntu machine is
# installed, as root or through sudo.
#
#   JOBS=<n>              parallel compile jobs                   [all cores]
#   XDG_CACHE_HOME=<dir>  the cache is itk-shearwarpmip/ inside   [~/.cache]
#
# Usage: run.sh [--smoke] [--output FOLDER] [--image FILE] [-- OPTION...]
#   --smoke          only try each form of benchmark/README.md on tiny volumes; the times say nothing
#   --output FOLDER  where the results go                         [benchmark-output]
#   --image FILE     measure this 3D image, which ITK reads, and no synthetic ones
#   OPTION           for shear-warp-mip-benchmark, see its --help: --kinds, --benchmark_filter, ...
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../tools/common.sh"

smoke=
output=benchmark-output
options=()
while [ $# -gt 0 ]; do
  case $1 in
    --smoke) smoke=yes ;;
    --output | --image)
      [ $# -ge 2 ] || die "$1 needs a value, see --help"
      if [ "$1" = --output ]; then output=$2; else options+=(--image "$2"); fi
      shift ;;
    --) shift; options+=("$@"); break ;;
    *) exit_with_usage "$1" ;;
  esac
  shift
done

program=$root/build/benchmark-program/benchmark/shear-warp-mip-benchmark

# A small image of a pixel type that becomes int16, anisotropic, its axes exchanged; its voxels are bytes of the program.
write_image() {
  printf '%s\n' 'ObjectType = Image' 'NDims = 3' 'BinaryData = True' 'TransformMatrix = 0 1 0 -1 0 0 0 0 1' \
    'Offset = 5 -3 20' 'ElementSpacing = 0.5 0.7 1.1' 'DimSize = 40 36 20' 'ElementType = MET_CHAR' \
    'ElementDataFile = LOCAL' > "$1"
  head -c $((40 * 36 * 20)) "$program" >> "$1"
}

# A result is written whatever the program says of it.
measure() {
  local status=0
  rm -f "$output/results.json"
  "$program" --benchmark_out="$output/results.json" --benchmark_out_format=json "$@" \
    "${options[@]}" || status=$?
  [ -s "$output/results.json" ] || die "the program measured nothing"
  /usr/bin/python3 "$root/benchmark/table.py" "$output/results.json" > "$output/results.md" || status=1
  return "$status"
}

timed "installed what building needs" need_packages build-essential cmake ninja-build libinsighttoolkit5-dev \
  libbenchmark-dev libcli11-dev python3-pandas python3-tabulate
timed "built the program" build_release benchmark-program shear-warp-mip-benchmark -DShearWarpMIP_BUILD_APPS=OFF \
  -DShearWarpMIP_BUILD_BENCHMARKS=ON
mkdir -p "$output"
if [ -n "$smoke" ]; then
  write_image "$output/smoke.mha"
  options+=(--view-repetitions 1)
  timed "tried everything" measure --sizes 23x29x17,48x40x32 --kinds mra,noise16,const --image "$output/smoke.mha"
  options+=(--sizes 48x40x32)
  timed "tried a filter" measure --benchmark_filter=48x40x32/uint16/portable
  timed "tried variants" measure --variants --kinds mra --threads 2
  timed "tried turns" measure --cine --kinds mra,noise16
else
  timed "measured" measure
fi
say "
The results are in $(cd "$output" && pwd): results.json, results.md.
The program is $program; try it with --help."
