#!/usr/bin/env bash
# Static analysis of the C++ code; any finding is a failure. Files that passed before are not analysed again.
#
#   compile   g++ with the warnings of common.sh, by a build of all objects that test.sh and others find in the cache;
#             what asks for Linux or POSIX without these too
#   tidy      clang-tidy, with the checks of .clang-tidy and clang's warnings, of the module and its program without
#             their tests, with the headers of libc++
#   cppcheck
#
# Usage: check.sh [compile | tidy | cppcheck]...    [all three]
# Installs what is missing, as root or with sudo. Environment: see itk-build-tree.sh.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root"
unset ITK_DIR
[[ $root != *[[:space:]]* ]] || die "names of files are read as words here: clone the project to a path without spaces"

build=$root/build/check
# Debian's ITK refuses any other compiler than the one it was built with; its code is good for clang too
clang_flags=(-Wno-sign-conversion -Wno-unknown-warning-option -Wno-deprecated-declarations -DITK_COMPILER_DETECTION_H -DITK_NOEXCEPT=noexcept)

stages=("$@")
[ ${#stages[@]} -gt 0 ] || stages=(compile tidy cppcheck)
for stage in "${stages[@]}"; do
  case $stage in
    compile | tidy | cppcheck) ;;
    *) exit_with_usage "$stage" ;;
  esac
done

configure() {
  need_packages build-essential cmake ninja-build libinsighttoolkit5-dev libbenchmark-dev libcli11-dev libgtest-dev
  cmake -S "$root" -B "$build" -G Ninja -DBUILD_TESTING=ON -DCMAKE_EXPORT_COMPILE_COMMANDS=ON \
    -DShearWarpMIP_BUILD_APPS=ON -DShearWarpMIP_BUILD_BENCHMARKS=ON -DShearWarpMIP_BUILD_PAGE_ENGINE=OFF \
    -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON -DCMAKE_BUILD_TYPE=Check "-DCMAKE_CXX_FLAGS=$warnings" > /dev/null
}

list_commands() {
  sed -n 's/^ *"command": "\(.*\)",$/\1/p' "$build/compile_commands.json" | sed 's/\\\(.\)/\1/g'
}

# check COMPILATION [COMMAND]: runs the command, or the compilation itself, unless it passed before with the same files of
# the project, options and versions.
check() {
  local compilation=$1 command=${2:-$1} files key
  files=$(eval "$(sed 's/ -o [^ ]*//; s/ -fsyntax-only//' <<< "$compilation") -MM -MT ''") || { eval "$command"; return; }
  # shellcheck disable=SC2086
  key=$({ printf '%s\n' "$versions" "$compilation" "$command"; cat .clang-tidy ${files//[:\\]/ }; } |
    sed "s|$root|.|g" | sha256sum | cut -d ' ' -f 1)
  [ -e "$passed/$key" ] || { eval "$command" && touch "$passed/$key"; }
}

# Reads lines of arguments of check, with tabs between them.
check_all() {
  export root passed=$cache/passed versions
  versions=$(c++ --version; "$cache/clang-tidy/bin/pip" freeze 2>&1
    dpkg-query --show libinsighttoolkit5-dev libgtest-dev libcli11-dev libbenchmark-dev clang libc++-dev 2>&1) || true
  mkdir -p "$passed"
  find "$passed" -type f -mtime +30 -delete
  export -f check
  xargs -d '\n' -P "$jobs" -n 1 bash -c 'IFS=$'"'\t'"' read -r -a arguments <<< "$1" && check "${arguments[@]}"' -
}

check_compile() {
  configure
  build_objects "$root/build/compile"
  list_commands | grep -F "$(git grep -l '^#ifdef \(__linux__\|ShearWarpMIP_HAS_POSIX\)' -- apps src | grep cxx$)" |
    sed 's/$/ -fsyntax-only -Werror -U__linux__ -DShearWarpMIP_WITHOUT_POSIX/' | check_all
}

# build_objects FOLDER: made anew, because a compilation from the cache repeats its warnings
build_objects() {
  local objects
  need_packages "${page_packages[@]}"
  share_compilations
  rm -rf "$1"
  cmake -S "$root" -B "$1" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=ON -DShearWarpMIP_BUILD_APPS=ON \
    -DShearWarpMIP_BUILD_BENCHMARKS=ON "-DCMAKE_CXX_FLAGS=$warnings" > /dev/null
  mapfile -t objects < <(ninja -C "$1" -t targets all | sed -n 's|^\([^:]*[.]o\): .*|\1|p')
  ninja -C "$1" -j "$jobs" "${objects[@]}" > "$1.log" 2>&1 || { tail -n 50 "$1.log" >&2; return 1; }
  if grep -B 20 -A 5 'warning:' "$1.log" >&2; then
    return 1
  fi
  rm -rf "$1"
}

check_tidy() {
  need_packages python3-venv libc++-dev
  # from 22 on it leaves system headers alone, in a third of the time
  make_venv "$cache/clang-tidy"
  "$cache/clang-tidy/bin/pip" install --quiet --disable-pip-version-check clang-tidy==23.1.4
  configure
  local tidy="$cache/clang-tidy/bin/clang-tidy --quiet -p $build ${clang_flags[*]/#/--extra-arg=}"
  tidy+=" --extra-arg=-stdlib=libc++"
  # it looks at a file with all its commands; one test is read too, because only tests have the filter of parts
  list_commands | awk -v left_out="^$root/(.*/)?(benchmark|test)/" \
    '($NF !~ left_out || $NF ~ /PartsImageFilterGTest/) && !seen[$NF]++' |
    sed "s|.* \([^ ]*\)$|&\t$tidy \1|" | check_all
}

check_cppcheck() {
  need_packages cppcheck
  mkdir -p "$build"
  git ls-files --cached --others --exclude-standard -- '*.cxx' > "$build/files"
  cppcheck --quiet -j "$jobs" --std=c++17 --enable=warning,performance,portability --inline-suppr --error-exitcode=1 \
    --library=googletest --library=gnu '-DTYPED_TEST_SUITE(...)=' '-DitkOverrideGetNameOfClassMacro(x)=' -D__linux__ \
    -DShearWarpMIP_HAS_X86_KERNELS -I include -I src -I apps -I apps/dicom -I apps/input -I apps/output -I apps/view -I phantom -I benchmark \
    --file-list="$build/files"
}

for stage in "${stages[@]}"; do
  say "== $stage"
  timed "$stage" "check_$stage"
done
say "all checked: ${stages[*]}"
