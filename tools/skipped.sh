#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# skipped.sh: one line on the tests that the last run of ctest left out, and why; nothing where it left out none.
set -euo pipefail
log=${1:-$(dirname "${BASH_SOURCE[0]}")/../build/release/Testing/Temporary/LastTest.log}

# GoogleTest's reason stands below the word; pytest's behind number, file and line.
reasons=$(awk '/: Skipped$/ { getline; print }
  /^SKIPPED \[/ { n = $2; gsub(/[^0-9]/, "", n); sub(/^SKIPPED \[[0-9]+\] [^ ]+ /, ""); while (n-- > 0) print }' "$log" | sort | uniq -c | sort -rn)
if [[ -n "$reasons" ]]; then
  awk '{ n = $1; $1 = ""; total += n; text = text (NR > 1 ? ";" : "") $0 " (" n ")" } END { print "==> Skipped " total " tests:" text }' <<<"$reasons"
fi
