#!/usr/bin/env bash
# Makes what ITK would take into its source tree, and tests it there.
#
# In build/itk of this checkout: a repository whose branch `ingest` has only the entries of the module that ITK takes,
# in Modules/Filtering/ShearWarpMIP, with their history. Its last commit shortens the module's CMakeLists.txt
# to what ITK needs, and has what is not committed here. If the history is larger than ITK accepts, the branch is
# one commit: see Utilities/Maintenance/RemoteModuleIngest/INGESTION_STRATEGY.md of ITK.
#
# Then builds the branch within ITK's source tree, and runs its tests, with real clinical images from ITK's test data,
# and with Python wrapping configured, but not built. ITK is built once, in the cache. Before, the file
# ShearWarpMIP.remote.cmake fetches the module as from its published repository.
#
#   ITK_SOURCE_DIR=<dir>  ITK's source, for instance of ITK 6     [5.4, as itk-build-tree.sh has it]
#   JOBS=<n>              parallel compile jobs                   [all cores]
#   XDG_CACHE_HOME=<dir>  the cache is itk-shearwarpmip/ inside   [~/.cache]
#
# Usage: itk-ingest.sh [--branch | --briefly]
#   --branch   makes the branch only
#   --briefly  without the tests of the engine alone, and for four pixel types: unsigned char, short, unsigned short, float
# Installs what is missing, as root or with sudo.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

briefly=OFF
case ${1:-} in
  '' | --branch) ;;
  --briefly) briefly=ON ;;
  *) exit_with_usage "$1" ;;
esac

module=Modules/Filtering/ShearWarpMIP
entries=(include src test wrapping CMakeLists.txt itk-module.cmake)
repository=$root/build/itk
KiB=1024

in_repository() {
  git -C "$repository" -c user.name=ingest -c user.email=ingest@localhost "$@"
}

# The entries of all commits, as ITK's own script filters them.
filter_history() {
  local entry paths=()
  for entry in "${entries[@]}"; do
    paths+=(--path "$entry")
  done
  rm -rf "$repository"
  git init --quiet --initial-branch=ingest "$repository"
  in_repository fetch --quiet --update-shallow "file://$root" HEAD:refs/heads/fetched
  in_repository reset --quiet --hard fetched
  in_repository branch --quiet --delete --force fetched
  in_repository filter-repo --force --quiet "${paths[@]}" --to-subdirectory-filter "$module" > /dev/null
}

# audit: prints the way ITK takes such a history: whole, filtered or squashed, and why.
audit() {
  local pack largest large way=whole
  pack=$(in_repository rev-list --objects ingest | cut -d ' ' -f 1 | in_repository pack-objects --quiet --stdout | wc -c)
  read -r largest large < <(in_repository rev-list --objects ingest | cut -d ' ' -f 1 |
    in_repository cat-file --batch-check='%(objecttype) %(objectsize)' |
    awk -v limit=$((341 * KiB)) '$1 == "blob" { if ($2 > max) max = $2; n += $2 > limit } END { print max + 0, n + 0 }')
  if [ "$pack" -gt $((3072 * KiB)) ] || [ "$largest" -gt $((700 * KiB)) ] || [ "$large" -gt 1 ]; then
    way=squashed
  elif [ "$pack" -gt $((700 * KiB)) ] || [ "$largest" -gt $((85 * KiB)) ] || [ "$large" -gt 0 ]; then
    way=filtered
  fi
  say "$(in_repository rev-list --count ingest) commits, $((pack / KiB)) KiB in all; largest file $((largest / KiB)) KiB"
  echo "$way"
}

make_branch() {
  local way files
  need_packages git git-filter-repo rsync
  filter_history
  way=$(audit)
  say "ITK takes this history $way"
  if [ "$way" = squashed ]; then
    in_repository reset --quiet --soft "$(in_repository commit-tree 'ingest^{tree}' -m 'ENH: Ingest ShearWarpMIP')"
  fi
  for entry in "${entries[@]}"; do
    rsync -a --delete --exclude '__pycache__' "$root/$entry" "$repository/$module"
  done
  printf '%s\n' 'project(ShearWarpMIP)' 'set(ShearWarpMIP_LIBRARIES ShearWarpMIP)' 'itk_module_impl()' \
    > "$repository/$module/CMakeLists.txt"
  in_repository add --all
  in_repository commit --quiet --message 'COMP: Drop what builds the module without ITK'"'"'s tree'
  # test data is fetched by its content
  files=$(cd "$repository" && git ls-files "$module/test/Input" | grep -v '[.]cid$') || true
  [ -z "$files" ] || die "ITK takes test data as .cid files only: $files"
}

# As ITK's own test of each module's style, without the rule on namespaces: the rule of ITK 5 does not know the
# namespaces of C++17.
check_style() {
  need_packages kwstyle
  sed '/<Namespace>/d' "$source/Utilities/KWStyle/ITK.kws.xml" > "$root/build/itk-style.xml"
  find "$repository/$module"/{include,src,test} -maxdepth 1 '(' -name '*.h' -o -name '*.*x' ')' > "$root/build/itk-style"
  (cd "$source" && KWStyle -xml "$root/build/itk-style.xml" -v -D "$root/build/itk-style" \
    -o Utilities/KWStyle/ITKOverwrite.txt -gcc)
}

# The remote module's file gets the module from a stand-in for the published repository.
test_fetch() {
  local remote=$root/ShearWarpMIP.remote.cmake dir=$root/build/itk-fetch url tag
  url=$(sed -n 's/^ *GIT_REPOSITORY //p' "$remote")
  tag=$(sed -n 's/^ *GIT_TAG //p' "$remote")
  rm -rf "$dir"
  git clone --quiet "file://$root" "$dir/published"
  git -C "$dir/published" tag --force "$tag" > /dev/null
  {
    echo 'cmake_minimum_required(VERSION 3.16.3)'
    printf 'include(%s)\n' "$source"/CMake/ITK{DownloadSetup,ModuleRemote}.cmake "$remote"
  } > "$dir/fetch.cmake"
  (cd "$dir" && GIT_CONFIG_COUNT=1 GIT_CONFIG_KEY_0=url.$dir/published.insteadOf GIT_CONFIG_VALUE_0=$url \
    cmake -DModule_ShearWarpMIP=ON -DITK_MINIMUM_COMPLIANCE_LEVEL=3 -DITK_SOURCE_DIR="$dir" -P "$dir/fetch.cmake")
  [ -f "$dir/Modules/Remote/ShearWarpMIP/itk-module.cmake" ] || die "$remote did not fetch the module"
  rm -rf "$dir"
}

# ITK's source as links, in it the branch; at fixed places, so that ITK is compiled only once.
test_in_itk() {
  local tree=$root/tools/itk-build-tree.sh source images version dir key entry text options
  source=$("$tree" --source)
  images=$(env -u ITK_SOURCE_DIR "$tree" --source)
  PATH=$("$tree" --tools):$PATH
  test_fetch
  version=$(read_itk_version "$source")
  text=$("$tree" --options)
  mapfile -t options <<< "$text"
  if [[ $version = 6.* ]]; then
    options+=(-DITK_LEGACY_REMOVE=ON -DITK_FUTURE_LEGACY_REMOVE=ON)
  fi
  check_style
  dir=$cache/itk-$version-module
  key=$(printf '%s\n' "$source" "$module" "${options[@]}" "$(c++ --version)")
  if [ "$(cat "$dir/key" 2>/dev/null)" != "$key" ]; then
    rm -rf "$dir"
    mkdir -p "$dir/source/$module"
    for entry in "$source"/* "$source"/Modules/* "$source"/Modules/Filtering/*; do
      [ -e "$dir/source/${entry#"$source/"}" ] || ln -s "$entry" "$dir/source/${entry#"$source/"}"
    done
    echo "$key" > "$dir/key"
  fi
  # files that are the same keep their time
  rsync -rl --checksum --delete "$repository/$module/" "$dir/source/$module"
  share_compilations
  export CCACHE_BASEDIR=$cache CTEST_OUTPUT_ON_FAILURE=1 CTEST_PARALLEL_LEVEL=$jobs
  cmake -S "$dir/source" -B "$dir/build" -G Ninja "${options[@]}" -DBUILD_TESTING=ON -DITK_FORBID_DOWNLOADS=OFF \
    -DModule_ShearWarpMIP=ON -DShearWarpMIP_TEST_BRIEFLY="$briefly" -DCMAKE_PROJECT_INCLUDE="$root/tools/itk-build.cmake" \
    "-DExternalData_OBJECT_STORES=$source/.ExternalData;$images/.ExternalData" > "$dir/configure.log" 2>&1 || {
    tail -n 30 "$dir/configure.log" >&2
    die "ITK $version with the module did not configure"
  }
  relocate_unity_files "$dir/build" "$dir/source"
  ninja -C "$dir/build" -j "$jobs" ShearWarpMIPGTestDriver
  ctest --test-dir "$dir/build/$module" --no-tests=error
  ctest --test-dir "$dir/build/$module/test" --no-tests=error
  say "passed inside ITK $version"
}

make_branch
[ "${1:-}" = --branch ] || test_in_itk
