#!/usr/bin/env bash
# Checks that the completion and the manual page, if there is one, have all options that --help-all has, and no others.
# Usage: check_options.sh PROGRAM COMPLETION [MANUAL_PAGE]
set -euo pipefail
program=$1

fail() { echo "$*" >&2; exit 1; }

complete_words() {
  COMP_WORDS=("$program" "$@")
  COMP_CWORD=$#
  COMPREPLY=()
  _shear_warp_mip "$program"
  printf '%s\n' "${COMPREPLY[@]}"
}

options=$("$program" --help-all | grep -oE '^  (OUTPUT, )?(--?[a-z-]+(, )?)+' | grep -oE -e '--?[a-z][a-z-]*' | sort)
[ "$(wc -l <<< "$options")" -gt 20 ] || fail "--help-all lists too few options: $options"

# shellcheck source=../shear-warp-mip.bash
. "$2"
diff <(echo "$options") <(complete_words - | sort) || fail "the completion's options differ"
[ "$(complete_words --view s)" = superior ] || fail "--view s is not completed"
[ "$(complete_words --view = post)" = posterior ] || fail "--view=post is not completed"
[ -z "$(complete_words --window a)" ] || fail "--window takes no names"

[ $# -lt 3 ] || diff <(echo "$options") \
  <(sed 's/\\-/-/g; s/\\f[BR]//g' "$3" | grep -A 1 '^\.TP' | grep -oE '^(OUTPUT, )?(--?[a-z-]+(, )?)+' |
    grep -oE -e '--?[a-z][a-z-]*' | sort) ||
  fail "the manual page's options differ"
