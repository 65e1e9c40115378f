#!/usr/bin/env bash
# Prints the path of an ITK build tree that this module, its tests and its Python wrapping build
# against. The first call makes it (ITK's source from Debian's source package, a trimmed build);
# later calls find it in the cache. What happens is told on standard error.
#
#   ITK_DIR=<dir>         an ITK build tree that you have already: printed, nothing is built; the tests of test.sh need
#                         the modules that are in this script's list
#   ITK_SOURCE_DIR=<dir>  ITK source that you have already: built, nothing is downloaded
#   PYTHON=<program>      the Python to wrap for (3.11 or later)      [/usr/bin/python3]
#   JOBS=<n>              parallel compile jobs                       [all cores]
#   XDG_CACHE_HOME=<dir>  the cache is itk-shearwarpmip/ inside       [~/.cache]
#
# Usage: itk-build-tree.sh [--tools | --source | --options]
#   --tools    prints the folder of cmake, ninja, swig and castxml instead
#   --source   prints ITK's source folder instead; its .ExternalData holds ITK's test images
#   --options  prints CMake's options instead, one a line. A build with them shares the tree's compilations if
#              CCACHE_BASEDIR is the cache, and its folder is in the cache, beside one called source.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

what=${1:-}
case $what in
  '' | --tools | --source | --options) ;;
  *) exit_with_usage "$what" ;;
esac

python=${PYTHON:-/usr/bin/python3}
tool_versions=('cmake==3.31.10' 'ninja==1.13.0' 'swig==4.3.1' 'castxml==0.4.5')

# The trimmed tree: what the module, its program, its tests and its wrapping use.
mapfile -t options < "$root/tools/itk-options.txt"
options+=(
  # C++ compiles faster at -O1; so the module is tested at -O1 inside ITK, and at -O3 elsewhere
  '-DCMAKE_C_FLAGS_RELEASE=-O2 -DNDEBUG' '-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG'
  -DITK_FORBID_DOWNLOADS=ON
  # exceptions name source files: relative to ITK, not to this machine; ccache makes paths relative to the build
  -DCMAKE_CXX_FLAGS=-fmacro-prefix-map=../source/=
)
# TIFF is ITK's own: Debian's needs libjbig, whose licence is the GPL
for library in SWIG CASTXML GDCM PNG JPEG ZLIB EXPAT EIGEN; do
  options+=("-DITK_USE_SYSTEM_$library=ON")
done

# complete DIR KEY: whether DIR was finished with that key.
complete() { [ "$(cat "$1/.complete" 2>/dev/null)" = "$2" ]; }

# make_once DIR KEY COMMAND: runs COMMAND to fill DIR, unless that was done with this key before.
make_once() {
  complete "$1" "$2" && return
  rm -rf "$1"
  mkdir -p "$1"
  "$3" "$1"
  printf '%s\n' "$2" > "$1/.complete"
}

make_tools() {
  "$python" -m venv "$1"
  "$1/bin/pip" install --quiet --disable-pip-version-check "${tool_versions[@]}" >&2
  # PyPI's swig is a Python script that isolated builds cannot run; the program itself needs its library's path
  local swig
  swig=$("$1/bin/python" -c 'import os, swig; print(os.path.join(os.path.dirname(swig.__file__), "data"))')
  rm "$1"/bin/swig*
  printf '#!/bin/sh\nSWIG_LIB=%q exec %q "$@"\n' "$swig"/share/swig/* "$swig/bin/swig" > "$1/bin/swig"
  chmod +x "$1/bin/swig"
  ln -s swig "$1/bin/swig4.0"
  "$1/bin/swig" -version >/dev/null
}

# ITK's source from the archive that this machine already uses, without touching its package sources.
find_archive() {
  apt-get indextargets --format '$(REPO_URI) $(RELEASE)' 'Created-By: Packages' |
    awk -v release="$(. /etc/os-release && echo "${VERSION_CODENAME:-}")" '$2 == release && !found { print $1; found = 1 }'
}

make_source() {
  local parts=$1/apt archive apt
  archive=$(find_archive)
  if [ -z "$archive" ]; then
    as_root apt-get update -qq >&2
    archive=$(find_archive)
  fi
  [ -n "$archive" ] || die "no Debian archive is configured here: set ITK_SOURCE_DIR or ITK_DIR"
  mkdir -p "$parts/lists/partial" "$parts/cache/archives/partial"
  echo "deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $archive sid main" > "$parts/sources.list"
  apt=(apt-get -qq -o "Dir::Etc::sourcelist=$parts/sources.list" -o Dir::Etc::sourceparts=-
    -o "Dir::State::lists=$parts/lists" -o "Dir::Cache=$parts/cache" -o "APT::Sandbox::User=$(id -un)")
  (cd "$parts" && "${apt[@]}" update && "${apt[@]}" source --download-only insighttoolkit5) >&2
  dpkg-source --skip-patches -x "$parts"/insighttoolkit5_*.dsc "$1/source" >&2
  rm -rf "$parts"
}

make_tree() {
  local log=$1.log
  share_compilations
  unset CCACHE_DISABLE
  export PATH=$tools/bin:$PATH CCACHE_BASEDIR=$cache
  say "building ITK in $1 (log: $log)"
  configure_tree "$1" > "$log" 2>&1 && build_tree "$1" >> "$log" 2>&1 || {
    tail -n 30 "$log" >&2
    die "ITK did not build, see $log"
  }
  list_files "$1" > "$1/.files"
}

# Sizes and names of what is built against. Modules built against the tree add files of their own to it.
list_files() {
  local folders=(lib Wrapping/Typedefs ../source/Wrapping "$source/Modules")
  [ ! -d "$source/.ExternalData" ] || folders+=("$source/.ExternalData")
  (cd "$1/build" && find "${folders[@]}" -type f ! -name '*ShearWarp*' -printf '%s %p\n' | sort)
}

# intact DIR: whether the finished tree still has all its files, as long as they were.
intact() { [ -z "$(comm -23 "$1/.files" <(list_files "$1") 2>&1)" ]; }

# ITK 5.4 wraps only the classes of itk-wrapped.txt, a fifth of all: the module's interface imports no others.
configure_tree() {
  local list=THIS_MODULE_SUBMODULE_ORDER wrapped
  wrapped=$(paste -sd '|' "$root/tools/itk-wrapped.txt") &&
    mkdir "$1/source" &&
    ln -s "$source"/* "$1/source" &&
    rm "$1/source/Wrapping" &&
    cp -r --no-preserve=mode "$source/Wrapping" "$1/source" || return
  if [[ $version = 5.4.* ]]; then
    sed -i "s/list(REMOVE_DUPLICATES $list)/&\n  list(FILTER $list INCLUDE REGEX \"^($wrapped)\$|ShearWarp\")/" \
      "$1/source/Wrapping/macro_files/itk_auto_load_submodules.cmake" || return
  fi
  cp "$root/tools/itk-build.cmake" "$1/" &&
    cmake -S "$1/source" -B "$1/build" -G Ninja "${options[@]}" -DCMAKE_PROJECT_INCLUDE="$1/itk-build.cmake" &&
    relocate_unity_files "$1/build" "$1/source"
}

# All static libraries, and the wrapping's interface files; no Python module is compiled.
build_tree() {
  local libraries
  mapfile -t libraries < <(ninja -C "$1/build" -t targets all | sed -n 's|^\(lib/.*\.a\): .*|\1|p' | grep -v itktestlib)
  ninja -C "$1/build" -j "$jobs" "${libraries[@]}" ITKCommonSwig ITKTransformSwig
}

if [ "$what" = '' ] && [ -n "${ITK_DIR:-}" ]; then
  [ -f "$ITK_DIR/ITKConfig.cmake" ] || die "ITK_DIR=$ITK_DIR holds no ITKConfig.cmake"
  echo "$ITK_DIR"
  exit
fi

need_packages build-essential dpkg-dev python3-dev python3-venv \
  libgdcm-dev libpng-dev libjpeg-dev zlib1g-dev libexpat1-dev libeigen3-dev
mkdir -p "$cache"
exec 9> "$cache/lock"
flock 9

tools=$cache/tools
make_once "$tools" "$("$python" --version) ${tool_versions[*]} $(declare -f make_tools | sha256sum)" make_tools
if [ "$what" = --tools ]; then
  echo "$tools/bin"
  exit
fi

options+=(-DPython3_EXECUTABLE="$tools/bin/python")
find_source() {
  if [ -n "${ITK_SOURCE_DIR:-}" ]; then
    source=$(cd "$ITK_SOURCE_DIR" && pwd)
  else
    make_once "$cache/itk-source" 5.4 make_source
    source=$cache/itk-source/source
    [[ $(read_itk_version "$source") = 5.4.* ]] || die "Debian has another ITK now than 5.4: set ITK_SOURCE_DIR or ITK_DIR"
  fi
  [ -f "$source/CMake/itkVersion.cmake" ] || die "no ITK source in $source"
}

find_source
if [ "$what" = --source ]; then
  echo "$source"
  exit
fi

version=$(read_itk_version "$source")
# ITK 6 does not compile with the Eigen of Debian 12, and wraps only beside NumPy
if [[ $version = 6.* ]]; then
  options+=(-DITK_USE_SYSTEM_EIGEN=OFF)
  "$tools/bin/pip" install --quiet --disable-pip-version-check numpy >&2
fi
if [ "$what" = --options ]; then
  printf '%s\n' "${options[@]}"
  exit
fi
key=$(printf '%s\n' "$source" "$version" "$(c++ --version)" "$("$python" --version)" "${tool_versions[@]}" "${options[@]}" \
  "$(declare -f configure_tree build_tree; cat "$root/tools"/itk-{build.cmake,wrapped.txt})" | sha256sum | cut -c1-12)
tree=$cache/itk-$version-$key

if complete "$tree" "$key" && ! intact "$tree"; then
  say "the cached ITK is broken; making it anew"
  rm -rf "$tree" "$cache/itk-source"
  find_source
fi
make_once "$tree" "$key" make_tree
echo "$tree/build"
