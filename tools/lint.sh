#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# clang-tidy (.clang-tidy) over the library and the program. Not part of the tests: it is not installed
# by `make build`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

command -v clang-tidy >/dev/null ||
  { echo "lint: clang-tidy is missing: apt-get install clang-tidy" >&2; exit 1; }
cmake --preset dev --log-level=WARNING >/dev/null
cmake --build --preset dev --target stemvo_version >/dev/null # a generated header
echo "==> clang-tidy over src and apps"
git ls-files 'src/*.cpp' 'apps/*.cpp' | xargs --no-run-if-empty --max-args=1 --max-procs="$(nproc)" \
  clang-tidy --quiet -p build/dev
