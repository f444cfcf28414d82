#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# format.sh [--check]: C++ sources in the project's format; with --check only looks, and also wants
# the licence line on top of every source. The pinned clang-format: output differs between versions.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly CLANG_FORMAT=build/venv/bin/clang-format
[[ -x $CLANG_FORMAT ]] || { echo "format: $CLANG_FORMAT is missing: run 'tools/setup.sh tools' first" >&2; exit 1; }
# Tracked and new files, not ignored ones; those deleted but not yet committed are skipped.
sources() { git ls-files --cached --others --exclude-standard -- "$@" | while read -r f; do [[ -f $f ]] && echo "$f"; done; true; }
mapfile -t cpp < <(sources '*.cpp' '*.hpp' '*.h')

if [[ "${1:-}" != --check ]]; then
  "$CLANG_FORMAT" -i "${cpp[@]}"
  exit
fi

failed=0
echo "==> Format of ${#cpp[@]} C++ sources"
"$CLANG_FORMAT" --dry-run --Werror "${cpp[@]}" || failed=1
echo "==> Licence lines"
while read -r file; do
  # Within the first three lines: a script's first is its interpreter.
  head -n 3 "$file" | grep -q 'SPDX-License-Identifier: MIT' ||
    { echo "$file:1: expected 'SPDX-License-Identifier: MIT' on top, found none"; failed=1; }
done < <(sources '*.cpp' '*.hpp' '*.h' '*.py' '*.sh' '.ci/run')
((failed == 0)) || { echo "format: not clean ('make format' rewrites the C++ sources)" >&2; exit 1; }
echo "format: clean"
