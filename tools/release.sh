#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# release.sh [FOLDER]: what a release offers, in FOLDER (build/dist): wheels and Debian packages for x86_64 and 64-bit ARM, and their SHA-256.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly OUT=${1:-build/dist}
mkdir -p "$OUT"
rm -f -- "$OUT"/stemvo*.whl "$OUT"/stemvo*.deb "$OUT/SHA256SUMS"  # of an earlier one; the folder may hold more
tools/wheel.sh "$OUT"
tools/arm64.sh wheel "$OUT"
(cd build/release && rm -f stemvo_*.deb && cpack -G DEB >cpack.log) || { cat build/release/cpack.log && exit 1; }
cp build/release/stemvo_*.deb build/arm64/stemvo_*.deb "$OUT/"
cd "$OUT" && sha256sum -- stemvo*.whl stemvo*.deb | tee SHA256SUMS
