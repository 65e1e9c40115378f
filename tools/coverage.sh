#!/usr/bin/env bash
# Measures how many lines of include/ and src/ the C++ tests run, and fails if it is less than 95 %. Kernels that the
# processor cannot run do not count. Writes build/coverage/report/index.html.
#
# Installs what is missing, as root or with sudo. Environment: see itk-build-tree.sh.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
[ $# -eq 0 ] || exit_with_usage "$1"
unset ITK_DIR

build=$root/build/coverage
need_packages build-essential cmake gcovr ninja-build libinsighttoolkit5-dev libgtest-dev
# counts of a previous run would add up
find "$build" -name '*.gcda' -delete 2>/dev/null || true
cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Debug -DBUILD_TESTING=ON -DShearWarpMIP_BUILD_APPS=OFF \
  '-DCMAKE_CXX_FLAGS_DEBUG=-O1 --coverage -DNDEBUG'
ninja -C "$build" -j "$jobs" ShearWarpMIPGTestDriver
timed "tests" "$build/test/ShearWarpMIPGTestDriver" --gtest_brief=1
mkdir -p "$build/report"
exclude=()
grep -q avx512_vnni /proc/cpuinfo || exclude=(--exclude "$root/src/engine/kernels/LanesAVX512.h")
# threads can spoil the counts of branches; atomic ones take more than twice as long
gcovr --root "$root" --filter "$root/(include|src)/" "${exclude[@]}" -j "$jobs" --print-summary --fail-under-line 95 \
  --gcov-ignore-parse-errors \
  --html-details "$build/report/index.html" --txt - "$build"
