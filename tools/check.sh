#!/usr/bin/env bash
# Static analysis of the C++ code; any finding is a failure.
#
#   compile   g++ with -Wall -Wextra -Wconversion -Wshadow
#   tidy      clang-tidy, with the checks of .clang-tidy and clang's warnings; of the module and its program
#   cppcheck
#
# Usage: check.sh [compile | tidy | cppcheck]...    [all three]
# Installs what is missing, as root or with sudo. Environment: see itk-build-tree.sh.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root"
unset ITK_DIR

build=$root/build/check

stages=("$@")
[ ${#stages[@]} -gt 0 ] || stages=(compile tidy cppcheck)
for stage in "${stages[@]}"; do
  case $stage in
    compile | tidy | cppcheck) ;;
    *) exit_with_usage ;;
  esac
done

configure() {
  need_packages build-essential cmake ninja-build libinsighttoolkit5-dev libbenchmark-dev libcli11-dev libgtest-dev
  cmake -S "$root" -B "$build" -G Ninja -DBUILD_TESTING=ON -DCMAKE_EXPORT_COMPILE_COMMANDS=ON \
    -DShearWarpMIP_BUILD_APPS=ON -DShearWarpMIP_BUILD_BENCHMARKS=ON -DCMAKE_BUILD_TYPE=Check \
    '-DCMAKE_CXX_FLAGS_CHECK=-fsyntax-only -Wall -Wextra -Wconversion -Wshadow -Werror' > /dev/null
}

check_compile() {
  configure
  sed -n 's/^ *"command": "\(.*\)",$/\1/p' "$build/compile_commands.json" | sed 's/\\\(.\)/\1/g' |
    xargs -d '\n' -P "$jobs" -n 1 sh -c
}

# Debian's ITK refuses any other compiler than the one it was built with; its code is good for clang too.
check_tidy() {
  need_packages clang-tidy
  configure
  sed -n 's/^ *"file": "\(.*\)".*/\1/p' "$build/compile_commands.json" | grep -v "^$root/benchmark/" |
    xargs -P "$jobs" -n 1 clang-tidy --quiet -p "$build" --extra-arg=-Wno-sign-conversion \
      --extra-arg=-Wno-unknown-warning-option --extra-arg=-DITK_COMPILER_DETECTION_H --extra-arg=-DITK_NOEXCEPT=noexcept
}

check_cppcheck() {
  need_packages cppcheck
  mkdir -p "$build"
  git ls-files --cached --others --exclude-standard -- '*.cxx' > "$build/files"
  cppcheck --quiet -j "$jobs" --std=c++17 --enable=warning,performance,portability --inline-suppr --error-exitcode=1 \
    --library=googletest --library=gnu '-DTYPED_TEST_SUITE(...)=' -D__linux__ -DShearWarpMIP_HAS_X86_KERNELS \
    -I include -I src -I apps -I benchmark --file-list="$build/files"
}

for stage in "${stages[@]}"; do
  say "== $stage"
  timed "$stage" "check_$stage"
done
say "all checked: ${stages[*]}"
