#!/usr/bin/env bash
# Builds the documentation: the pages of doc/ by Sphinx, and the pages of the C++ interface by Doxygen. Any warning is
# an error. The pages need no network; MathJax, which draws the formulas, is Debian's. What is missing on a Debian or
# Ubuntu machine is installed, as root or through sudo, and Sphinx from PyPI into the cache.
#
#   JOBS=<n>              parallel compile jobs                   [all cores]
#   XDG_CACHE_HOME=<dir>  the cache is itk-shearwarpmip/ inside   [~/.cache]
#   PYTHON=<program>      for the pictures: Python with the wheel and its extra [test]
#                         [build/python/env/bin/python, of tools/test.sh python]
#
# Usage: docs.sh [FOLDER]     the pages; they begin with index.html           [build/docs]
#        docs.sh --figures    draws the pictures in doc/figures again instead
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

draw_figures() {
  local program=$root/build/demo/apps/shear-warp-mip python=${PYTHON:-$root/build/python/env/bin/python}
  [ -x "$python" ] || die "$python is missing: tools/test.sh python makes it, or give another as PYTHON"
  need_packages build-essential cmake ninja-build libinsighttoolkit5-dev libcli11-dev
  timed "built the program" build_release demo shear-warp-mip -DShearWarpMIP_BUILD_APPS=ON
  "$program" --write-phantom "$work/head.nrrd"
  timed "drew the pictures" "$python" "$root/doc/figures.py" "$work/head.nrrd" "$root/doc/figures"
}

install_sphinx() {
  make_venv "$cache/sphinx"
  "$cache/sphinx/bin/pip" install --quiet --disable-pip-version-check -r "$root/doc/requirements.txt"
}

# copy_mathjax FOLDER: what formulas in TeX, drawn as SVG, need of it.
copy_mathjax() {
  mkdir -p "$1"
  (cd /usr/share/javascript/mathjax &&
    cp -rL --parents MathJax.js extensions jax/element jax/input/TeX jax/output/SVG/*.js jax/output/SVG/autoload \
      jax/output/SVG/fonts/TeX "$1")
}

build_pages() {
  "$cache/sphinx/bin/python" -m sphinx -W --keep-going -n -q -E -d "$work/doctrees" "$root/doc" "$folder"
}

build_cpp_pages() {
  rm -rf "$folder/cpp"
  mkdir "$folder/cpp"
  (cd "$root" && OUTPUT=$folder/cpp doxygen doc/Doxyfile)
}

# the links from Sphinx's pages to Doxygen's, which neither of them knows
check_links() {
  local link
  grep -oh 'href="cpp/[^"#]*' "$folder"/*.html | sed 's/^href="//' | sort -u | while read -r link; do
    [ -f "$folder/$link" ] || die "a page links to $link, which does not exist"
  done
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
case ${1:-} in
  --figures) draw_figures; exit ;;
  -*) exit_with_usage "$1" ;;
esac
timed "installed what building needs" need_packages doxygen libjs-mathjax python3-venv
timed "installed Sphinx" install_sphinx
mkdir -p "${1:-$root/build/docs}"
folder=$(cd "${1:-$root/build/docs}" && pwd)
timed "built the pages" build_pages
timed "built the pages of the C++ interface" build_cpp_pages
copy_mathjax "$folder/_static/mathjax"
check_links
say "The documentation is $folder/index.html."
