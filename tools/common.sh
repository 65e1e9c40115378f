# Shared by the scripts in this folder; sourced, not run.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cache=${SHEARWARPMIP_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/itk-shearwarpmip}
jobs=${JOBS:-$(nproc)}
# what clang needs for WebAssembly: the engine of pages that hold a volume
# shellcheck disable=SC2034
page_packages=(clang lld libc++-dev-wasm32 libclang-rt-dev-wasm32 wasi-libc)

# Of builds against Debian's ITK, which so share their compilations; check.sh takes them for errors. With optimization,
# g++ 12 warns of empty vectors that are copied.
# shellcheck disable=SC2034
warnings='-Wall -Wextra -Wconversion -Wshadow -Wno-nonnull'

say() { printf '%s\n' "$*" >&2; }
die() { say "$(basename "$0"): $*"; exit 1; }

# exit_with_usage [ARGUMENT]: prints the comment at the beginning of the script that calls it; an error unless the
# argument asks for it.
exit_with_usage() {
  sed -n '2,/^set/{/^set/d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[1]}" >&2
  case ${1:-} in -h | --help) exit 0 ;; *) die "'${1:-}' is not expected, see above" ;; esac
}

# as_root COMMAND...: runs it as root, through sudo where that is needed.
as_root() {
  if [ "$(id -u)" -eq 0 ]; then "$@"
  elif command -v sudo >/dev/null; then sudo "$@"
  else die "needs root or sudo to run: $*"
  fi
}

# need_packages NAME...: installs those Debian packages that are missing.
need_packages() {
  local missing=() name
  for name in "$@"; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$name" 2>/dev/null)" = installed ] || missing+=("$name")
  done
  [ ${#missing[@]} -gt 0 ] || return 0
  command -v apt-get >/dev/null || die "please install: ${missing[*]}"
  say "installing Debian packages: ${missing[*]}"
  as_root apt-get update -qq >&2 || say "apt-get update failed; trying with the lists that are here"
  as_root env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 -o APT::Keep-Downloaded-Packages=false \
    install -y -qq --no-install-recommends "${missing[@]}" >&2
}

# share_compilations: what is compiled from now on is kept in the cache, for other folders and runs too.
share_compilations() {
  need_packages ccache
  # CCACHE_DEPEND: what is not in the cache is preprocessed only once; CCACHE_SLOPPINESS: precompiled headers
  export CCACHE_DIR=$cache/ccache CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1 CCACHE_MAXSIZE=3G CCACHE_DEPEND=1
  export CCACHE_SLOPPINESS=pch_defines,time_macros
  export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
}

# relocate_unity_files BUILD SOURCE: CMake writes absolute paths of sources into them; with relative ones, builds in
# other folders share their compilations.
relocate_unity_files() {
  local file
  find "$1" -path '*/Unity/unity_*' -type f | while IFS= read -r file; do
    sed -i "s|\"$2/|\"$(realpath --relative-to="${file%/*}" "$2")/|" "$file"
  done
}

# read_itk_version SOURCE: prints the version of ITK's source.
read_itk_version() {
  awk -F'"' '/set\(ITK_VERSION_(MAJOR|MINOR|PATCH)/ { v = v s $2; s = "." } END { print v }' "$1/CMake/itkVersion.cmake"
}

# print_blocks LANGUAGE FILE: prints the blocks of a page in this language.
print_blocks() {
  sed -n "/^\`\`\`$1\$/,/^\`\`\`\$/{/^\`\`\`/d;p}" "$root/$2"
}

# find_itk_image CID_FILE: the path of an image of ITK's test data, whose files are named by their content.
find_itk_image() {
  local source file
  source=$("$root/tools/itk-build-tree.sh" --source)
  file=$source/.ExternalData/CID/$(cat "$1")
  [ -f "$file" ] || die "ITK's source in $source is without its test data"
  echo "$file"
}

# find_head: the path of a real image, an MR of a head.
find_head() {
  find_itk_image "$root/benchmark/paper/MultiFrameDicomTest.dcm.cid"
}

# check_packages FOLDER: Debian's lintian finds nothing in the packages there.
check_packages() {
  need_packages lintian
  lintian --allow-root --fail-on error,warning "$1"/*.deb
}

# make_venv FOLDER: a virtual environment with pip, made anew if a run was cut short or its Python has gone.
make_venv() {
  "$1/bin/python" -m pip --version > /dev/null 2>&1 || /usr/bin/python3 -m venv --clear "$1"
}

# run_itk_python ARGUMENT...: Python with PyPI's itk-io, in the cache; needs python3-venv.
run_itk_python() {
  make_venv "$cache/itk-python"
  "$cache/itk-python/bin/pip" install --quiet --disable-pip-version-check itk-io
  "$cache/itk-python/bin/python" "$@"
}

# build_release NAME TARGET OPTION...: builds the target against Debian's ITK, not one that happens to be in the
# environment, with the flags that its users have by default, in build/NAME. A broken or moved folder is made anew. Needs
# build-essential cmake ninja-build libinsighttoolkit5-dev.
build_release() {
  local build=$root/build/$1 target=$2
  shift 2
  mkdir -p "$root/build"
  share_compilations
  configure_and_build() {
    env -u ITK_DIR cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=OFF \
      "-DCMAKE_CXX_FLAGS=$warnings" "$@" && ninja -C "$build" -j "$jobs" "$target"
  }
  configure_and_build "$@" > "$build.log" 2>&1 && return
  rm -rf "$build"
  configure_and_build "$@" > "$build.log" 2>&1 || {
    tail -n 30 "$build.log" >&2
    die "$target did not build, see $build.log"
  }
}

# timed WHAT COMMAND...: runs the command and says on standard error how long it took.
timed() {
  local what=$1 start=$SECONDS
  shift
  "$@"
  say "$what: $((SECONDS - start)) s"
}
