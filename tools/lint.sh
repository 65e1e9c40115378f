#!/usr/bin/env bash
# Checks the form of every file that git knows, with the hooks of .pre-commit-config.yaml. What a tool can put right is
# put right; any finding is a failure.
#
# Usage: lint.sh [HOOK]    [all]
# Installs what is missing, as root or with sudo; the tools from PyPI, in the cache.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

if [ $# -gt 1 ] || [[ ${1:-} == -* ]]; then
  exit_with_usage "$1"
fi

need_packages git python3-venv
make_venv "$cache/pre-commit"
"$cache/pre-commit/bin/pip" install --quiet --disable-pip-version-check pre-commit==4.7.0
cd "$root"
PRE_COMMIT_HOME=$cache/pre-commit/hooks "$cache/pre-commit/bin/pre-commit" run --all-files --show-diff-on-failure "$@"
