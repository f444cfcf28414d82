#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# skipped.sh: one line on the tests that the last run of ctest left out, and why; nothing where it left out none.
set -euo pipefail
log=${1:-$(dirname "${BASH_SOURCE[0]}")/../build/release/Testing/Temporary/LastTest.log}

# GoogleTest's reason stands below the word, unittest's behind it; pytest tells a number.
reasons=$(awk '/: Skipped$/ { getline; print } match($0, /\.\.\. skipped .*/) { print substr($0, RSTART + 13, RLENGTH - 14) }
  match($0, /[0-9]+ skipped/) { n = $0; sub(/ skipped.*/, "", n); sub(/.*[^0-9]/, "", n); while (n-- > 0) print "of stemvo-lab" }' "$log" | sort | uniq -c | sort -rn)
if [[ -n "$reasons" ]]; then
  awk '{ n = $1; $1 = ""; total += n; text = text (NR > 1 ? ";" : "") $0 " (" n ")" } END { print "==> Skipped " total " tests:" text }' <<<"$reasons"
fi
