#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Lines and branches of src/ that the unit tests reach, in all and for each room (`tools/setup.sh coverage`
# installs gcovr). What was counted before is dropped (coverage.sh --keep: a new report of it). build/coverage/report/index.html shows each line.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly BUILD=build/coverage
readonly GCOVR=build/venv-coverage/bin/gcovr
[[ -x $GCOVR ]] || { echo "coverage: $GCOVR is missing: run 'tools/setup.sh coverage' first" >&2; exit 1; }

mkdir -p "$BUILD/report"
cmake --preset coverage --log-level=WARNING >"$BUILD/configure.log" || { cat "$BUILD/configure.log" >&2; exit 1; }
[[ "${1:-}" == --keep ]] || find "$BUILD" -name '*.gcda' -delete # of other sources: counts would not fit
cmake --build --preset coverage --target stemvo_unit_tests >"$BUILD/build.log" 2>&1 || { tail -n 40 "$BUILD/build.log" >&2; exit 1; }
if [[ "${1:-}" != --keep ]]; then
  find "$BUILD" -name '*.gcda' -delete # of the build's list of tests
  ctest --preset coverage --parallel "$(nproc)" >"$BUILD/ctest.log" || { tail -n 40 "$BUILD/ctest.log" >&2; exit 1; }
fi

# Branches that only an exception takes are not counted: bad input throws none.
"$GCOVR" --root . --filter src/ --exclude-throw-branches --merge-mode-functions=separate \
  --gcov-ignore-parse-errors=negative_hits.warn_once_per_file --html-details "$BUILD/report/index.html" \
  --json-summary "$BUILD/report/summary.json" "$BUILD" >"$BUILD/gcovr.log" 2>&1 || { tail -n 20 "$BUILD/gcovr.log" >&2; exit 1; }
build/venv-coverage/bin/python - "$BUILD/report/summary.json" <<'PYTHON'
import collections
import json
import pathlib
import sys

summary = json.loads(pathlib.Path(sys.argv[1]).read_text())
rooms = collections.defaultdict(lambda: [0, 0, 0, 0])
for file in summary["files"]:
    room = "/".join(pathlib.Path(file["filename"]).parts[:2]) if file["filename"].count("/") > 1 else "src"
    for i, key in enumerate(("line_covered", "line_total", "branch_covered", "branch_total")):
        rooms[room][i] += file[key]


def share(covered, total):
    return f"{100 * covered / total:5.1f} %" if total else "    -  "


print(f"{'room':<20}{'lines':>9}{'branches':>11}")
for room, (lines, num_lines, branches, num_branches) in sorted(rooms.items()):
    print(f"{room:<20}{share(lines, num_lines):>9}{share(branches, num_branches):>11}")
total = [sum(column) for column in zip(*rooms.values())]
print(f"{'all of src':<20}{share(*total[:2]):>9}{share(*total[2:]):>11}")
PYTHON
