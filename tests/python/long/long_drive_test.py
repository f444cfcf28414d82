# SPDX-License-Identifier: MIT
"""A rendered drive of some hundred frames, metres from the camera's height, nothing aligned: what must hold on 4541 frames
(tools/long_drives.py) in a size that fits every change. Memory and time: many_frames_test.py."""

import json
import os
import subprocess

import pytest
from drives import watched_run

PROGRAM = os.environ["STEMVO_PROGRAM"]
FRAMES = 300
MAX_T_REL_PERCENT = 1.5  # 1.33: the default stem finds this road 1 % too far away; gray 0.5
MAX_R_REL_DEG_PER_100M = 0.5
MAX_LENGTH_ERROR = 0.03


def test_errors_are_small_and_the_scale_does_not_drift(tmp_path):
    for command in (["synth", "drive", "--frames", str(FRAMES), "--width", "620", "--height", "188"],
                    # Said, so that other defaults change nothing.
                    ["run", "drive/sequences/00", "--out", "out", "--set", "odometry.mode=map", "--set", "scale.source=camera_height"]):
        subprocess.run([PROGRAM, *command], cwd=tmp_path, check=True, capture_output=True)
    metrics = json.loads((tmp_path / "out/metrics.json").read_text())
    lengths = watched_run.lengths_ratio(tmp_path / "out/trajectory_kitti.txt", tmp_path / "drive/poses/00.txt")
    assert (metrics["frames"], metrics["alignment"]) == (FRAMES, "none") and metrics["t_rel_percent"] <= MAX_T_REL_PERCENT
    assert metrics["r_rel_deg_per_100m"] <= MAX_R_REL_DEG_PER_100M and metrics["tracked_fraction"] >= 0.99
    assert lengths == pytest.approx([1.0] * 4, abs=MAX_LENGTH_ERROR, rel=0)
