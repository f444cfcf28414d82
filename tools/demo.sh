#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Renders a drive (once per build of the program) and reconstructs it. Called by `make demo`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly PROGRAM=build/release/stemvo DATA=build/demo/data OUT=build/demo/out FRAMES=100
rendered_by="$(sha256sum <"$PROGRAM") $FRAMES"
if [[ ! -f $DATA/stamp || "$(<"$DATA/stamp")" != "$rendered_by" ]]; then
  echo "==> Rendering a drive of $FRAMES frames to $DATA"
  rm -rf "$DATA"
  "$PROGRAM" synth "$DATA" --frames "$FRAMES"
  echo "$rendered_by" >"$DATA/stamp"
fi
echo "==> Running stemvo on it (metres from the road and the camera's height; no ground truth, no alignment)"
"$PROGRAM" run "$DATA/sequences/00" --out "$OUT"
echo "==> To look at, in a browser: $PWD/$OUT/report.html (the map: map.ply beside it)"
