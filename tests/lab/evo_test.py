# SPDX-License-Identifier: MIT
"""evo reads every trajectory file of a run and agrees with `stemvo evaluate` on ATE and RPE to 1e-6, for ground truth in each format."""

import json
import os
import subprocess

import numpy as np
import pytest
from compare_test import evo_errors
from evo.core import sync, trajectory
from evo.tools import file_interface
from scipy.spatial.transform import Rotation

FRAMES = 40
WORLD = np.array([[0.0, 0, 1, 5], [0, 1, 0, -2], [-1, 0, 0, 30]])  # of the truth by time: another one than the first camera's


def stemvo(*arguments):
    return subprocess.run([os.environ["STEMVO_PROGRAM"], *map(str, arguments)], check=True, capture_output=True, text=True).stdout


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run, and its truth by time (time, place, quaternion with w last): two frames have none, the others are late."""
    folder = tmp_path_factory.mktemp("evo")
    stemvo("synth", folder / "drive", "--frames", FRAMES, "--width", 620, "--height", 188)
    stemvo("run", folder / "drive/sequences/00", "--out", folder / "result", "--quiet")
    timed = []
    for i, (pose, time) in enumerate(zip(np.loadtxt(folder / "drive/poses/00.txt").reshape(-1, 3, 4), np.loadtxt(folder / "drive/sequences/00/times.txt"))):
        turned, place = WORLD[:, :3] @ pose[:, :3], WORLD[:, :3] @ pose[:, 3] + WORLD[:, 3]
        if i not in (0, 17):
            timed.append([time + 0.003, *place, *Rotation.from_matrix(turned).as_quat()])
    return folder, np.array(timed)


def check(truth_file, file, truth, estimate, *more):
    assert estimate.num_poses == truth.num_poses
    for align in ("none", "se3", "sim3"):
        ours = json.loads(stemvo("evaluate", "--gt", truth_file, file, "--align", align, *more, "--json"))["estimates"][0]
        assert ours["compared_poses"] == truth.num_poses
        found = ours["ate_rmse_m"][align], ours["rpe_translation_m"], ours["rpe_rotation_deg"]
        assert found == pytest.approx(evo_errors(truth, estimate, align), abs=1e-6), (file, align)


@pytest.mark.parametrize("name", ["kitti", "tum"])
def test_every_file(run, name):
    truth_file, file = run[0] / "drive/poses/00.txt", run[0] / f"result/trajectory_{name}.txt"
    read = {"kitti": file_interface.read_kitti_poses_file, "tum": file_interface.read_tum_trajectory_file}[name]
    estimate = trajectory.PosePath3D(poses_se3=read(file).poses_se3)
    check(truth_file, file, file_interface.read_kitti_poses_file(truth_file), estimate)


@pytest.mark.parametrize("kind", ["tum", "euroc"])
def test_truth_by_time(run, kind):
    folder, timed = run
    truth_file, file, more = folder / f"{kind}.csv", folder / "result/trajectory_tum.txt", ()
    if kind == "tum":
        np.savetxt(truth_file, timed, fmt="%.12f")
        truth = file_interface.read_tum_trajectory_file(truth_file)
    else:
        rows = [",".join([str(round(1e9 * row[0])), *(f"{one:.12f}" for one in (*row[1:4], row[7], *row[4:7])), *["0"] * 9]) for row in timed]
        truth_file.write_text("#timestamp\n" + "\n".join(rows) + "\n")
        (folder / "sensor.yaml").write_text("resolution: [620, 188]\nintrinsics: [359, 359, 310, 94]\ndistortion_model: none\n"
                                            "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n")
        truth, more = file_interface.read_euroc_csv_trajectory(truth_file), ("--camera", folder / "sensor.yaml")
    check(truth_file, file, *sync.associate_trajectories(truth, file_interface.read_tum_trajectory_file(file), max_diff=0.01), *more)
