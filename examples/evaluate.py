#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Evaluation alone, of any program's trajectory: evaluate.py TRUTH ESTIMATE.. (KITTI's, TUM's or EuRoC's poses)

Prints a line per estimate. Needs nothing but Python and `stemvo` on the PATH."""

import json
import subprocess
import sys

done = subprocess.run(["stemvo", "evaluate", "--gt", *sys.argv[1:], "--align", "sim3", "--json"], stdout=subprocess.PIPE, check=False)
if done.returncode != 0:
    sys.exit(done.returncode)  # stemvo has said why
for estimate in json.loads(done.stdout)["estimates"]:
    print(f"{estimate['file']}: ATE {estimate['ate_rmse_m']['sim3']:.4f} m, RPE {estimate['rpe_translation_m']:.4f} m and {estimate['rpe_rotation_deg']:.4f} deg a frame")
