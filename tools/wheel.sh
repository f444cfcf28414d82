#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# wheel.sh [FOLDER]: a manylinux wheel of the Python package in FOLDER (build/wheel) that needs neither OpenCV nor ONNX Runtime of the
# system: it holds Debian's libraries (docs/python.md).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly OUT=${1:-build/wheel}
tools/setup.sh wheel
rm -rf build/wheel_as_built "$OUT"/stemvo-*manylinux*_"$(uname -m)".whl
build/venv-wheel/bin/pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir build/wheel_as_built .
PATH=$PWD/build/venv-wheel/bin:$PATH auditwheel repair --wheel-dir "$OUT" build/wheel_as_built/stemvo-*.whl >build/setup/auditwheel.log 2>&1 ||
  { tail -n 20 build/setup/auditwheel.log >&2; exit 1; }
ls "$OUT"/stemvo-*manylinux*.whl
