#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# clang-tidy (.clang-tidy) over the library and the program, with the pinned version (`tools/setup.sh lint`).
# lint.sh FILE..: over these sources only.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly BUILD=build/tidy
readonly CLANG_TIDY=build/venv-lint/bin/clang-tidy
[[ -x $CLANG_TIDY ]] || { echo "lint: $CLANG_TIDY is missing: run 'tools/setup.sh lint' first" >&2; exit 1; }
# All sources: a room's together, as they are compiled; most of the time goes into libraries' headers.
unity=OFF
(($# > 0)) || unity=ON
# Precompiled headers are another compiler's; with all they hold each source takes several times as long.
mkdir -p "$BUILD"
cmake --preset dev -B "$BUILD" -D CMAKE_DISABLE_PRECOMPILE_HEADERS=ON -D STEMVO_UNITY_BUILD=$unity --log-level=WARNING >"$BUILD/configure.log" ||
  { cat "$BUILD/configure.log" >&2; exit 1; }
cmake --build "$BUILD" --target stemvo_version >"$BUILD/build.log" || { cat "$BUILD/build.log" >&2; exit 1; } # a generated header
sources=("$@")
(($# > 0)) || mapfile -t sources < <(grep -oP "\"file\": \"\K$PWD/($BUILD/)?(src|apps)/[^\"]*" "$BUILD/compile_commands.json")
echo "==> clang-tidy over ${#sources[@]} sources of src and apps"
failed=0
# Deprecated functions that libstdc++ itself uses are no finding; nor are counts of warnings in system headers.
printf '%s\0' "${sources[@]}" | xargs -0 --max-args=1 --max-procs="$(nproc)" "$CLANG_TIDY" --quiet -p "$BUILD" \
  --checks=-bugprone-suspicious-include --extra-arg=-Wno-deprecated-declarations 2>"$BUILD/stderr.log" || failed=1
((failed == 0)) || { grep -v ' warnings\? generated' "$BUILD/stderr.log" >&2 || true; echo "lint: not clean" >&2; exit 1; }
echo "lint: clean"
