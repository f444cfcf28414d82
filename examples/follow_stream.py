#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Poses of a run while it runs: stemvo run RECORDING --stream | follow_stream.py"""

import json
import sys

for line in sys.stdin:
    frame = json.loads(line)
    x, y, z = frame["position"]  # of the camera: to the right, down, forward of the first
    sigma = sum(frame["step_variances"][:3]) ** 0.5
    print(f"{frame['timestamp_s']:.3f} s, {frame['state']}: {x:.2f} {y:.2f} {z:.2f}, step +- {sigma:.3f}", flush=True)
