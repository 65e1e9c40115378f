#!/usr/bin/env bash
# Feeds bytes that libFuzzer finds, under AddressSanitizer and UndefinedBehaviorSanitizer, to
#
#   Projection  the filter, as image, view and output grid of any numbers
#   Program     shear-warp-mip, as arguments and transform file
#
# and fails if one of them crashes, hangs, takes too much memory or gives a wrong result. The input that did it is kept:
# give its path to the fuzzer, in build/fuzz/bin/, to see it again.
#
#   JOBS=<n>              parallel compile jobs                   [all cores]
#   XDG_CACHE_HOME=<dir>  the cache is itk-shearwarpmip/ inside   [~/.cache]
#
# Usage: fuzz.sh [SECONDS [FOLDER]]
#   SECONDS  how long, for each of them                           [600]
#   FOLDER   inputs that reach much of the code, from run to run  [fuzz/ in the cache]
# Installs what is missing, as root or with sudo.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

seconds=${1:-600}
corpus=${2:-$cache/fuzz}
if [ $# -gt 2 ] || ! [[ $seconds =~ ^[1-9][0-9]*$ ]]; then
  exit_with_usage "$seconds"
fi

need_packages build-essential clang cmake libcli11-dev libgtest-dev libinsighttoolkit5-dev llvm ninja-build
# Debian's ITK refuses any other compiler than the one it was built with; its code is good for clang too
build_release fuzz fuzzers -DShearWarpMIP_BUILD_FUZZERS=ON -DShearWarpMIP_BUILD_APPS=ON \
  -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ \
  '-DCMAKE_CXX_FLAGS=-DITK_COMPILER_DETECTION_H -DITK_NOEXCEPT=noexcept' \
  -DCMAKE_RUNTIME_OUTPUT_DIRECTORY="$root/build/fuzz/bin"

# the program's fuzzer changes to a folder of its own
mkdir -p "$corpus"
corpus=$(cd "$corpus" && pwd)
failed=()
for name in Projection Program; do
  log=$corpus/$name.log
  folders=("$corpus/$name")
  [ $name = Projection ] || folders+=("$root/apps/test/fuzz/seeds")
  mkdir -p "${folders[0]}"
  say "== $name: $seconds s; log in $log"
  "$root/build/fuzz/bin/ShearWarpMIP${name}Fuzzer" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 \
    -malloc_limit_mb=256 -max_len=1024 -len_control=0 -print_final_stats=1 -artifact_prefix="$corpus/$name-" \
    "${folders[@]}" > "$log" 2>&1 || {
    tail -n 40 "$log" >&2
    failed+=("$name")
  }
  grep -a -E '^(Done|stat::)' "$log" >&2 || true
done
[ ${#failed[@]} -eq 0 ] || die "failed: ${failed[*]}"
