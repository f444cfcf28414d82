# SPDX-License-Identifier: MIT
"""evo reads every trajectory file of a run and agrees with `stemvo evaluate` on ATE and RPE to 1e-6, for ground truth in each format."""

import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAM = os.environ.get("STEMVO_PROGRAM", str(ROOT / "build/release/stemvo"))
EVO = ROOT / "build/venv-evo/bin/python"
FRAMES = 40
WORLD = np.array([[0.0, 0, 1, 5], [0, 1, 0, -2], [-1, 0, 0, 30]])  # of the truth by time: another one than the first camera's


def output_of(*command):
    return subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True).stdout


def with_times(poses, times):
    """Time, place and quaternion (x, y, z, w) of poses that are turned by less than half a turn; two frames have none, the others are late."""
    for i, (pose, time) in enumerate(zip(poses, times)):
        turned, place = WORLD[:, :3] @ pose[:, :3], WORLD[:, :3] @ pose[:, 3] + WORLD[:, 3]
        w = np.sqrt(1.0 + np.trace(turned)) / 2.0
        vector = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) / (4.0 * w)
        if i not in (0, 17):
            yield time + 0.003, place, [*vector, w]


@unittest.skipUnless(EVO.exists(), "tools/setup.sh evo has not run")
class Evo(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        output_of(PROGRAM, "synth", cls.folder / "drive", "--frames", FRAMES, "--width", 620, "--height", 188)
        output_of(PROGRAM, "run", cls.folder / "drive/sequences/00", "--out", cls.folder / "result", "--quiet")
        cls.truth = cls.folder / "drive/poses/00.txt"
        cls.timed = list(with_times(np.loadtxt(cls.truth).reshape(-1, 3, 4), np.loadtxt(cls.folder / "drive/sequences/00/times.txt")))

    def check(self, name, kind, truth, poses, *more, result="result"):
        file = self.folder / result / name
        ours = {align: json.loads(output_of(PROGRAM, "evaluate", "--gt", truth, file, "--align", align, *more, "--json"))["estimates"][0]
                for align in ("none", "se3", "sim3")}
        theirs = json.loads(output_of(EVO, ROOT / "tests/evo/judge.py", kind, truth, "tum" if "tum" in name else "kitti", file))
        self.assertEqual((theirs["poses"], ours["none"]["compared_poses"]), (poses, poses))
        for align, numbers in ours.items():
            self.assertGreater(theirs["ate_rmse_m"][align], 0.0)
            self.assertAlmostEqual(theirs["ate_rmse_m"][align], numbers["ate_rmse_m"][align], delta=1e-6, msg=f"{name}, {kind}, {align}")
            self.assertAlmostEqual(theirs["rpe_translation_m"][align], numbers["rpe_translation_m"], delta=1e-6, msg=f"{name}, {kind}, {align}")
            self.assertAlmostEqual(theirs["rpe_rotation_deg"], numbers["rpe_rotation_deg"], delta=1e-6, msg=f"{name}, {kind}, {align}")

    def test_every_file(self):
        for name in ("kitti", "tum"):
            self.check(f"trajectory_{name}.txt", "kitti", self.truth, FRAMES)

    @unittest.skipUnless("STEMVO_SHARED_DATA" in os.environ, "STEMVO_SHARED_DATA is not set")
    def test_a_real_clip(self):
        kitti, frames = pathlib.Path(os.environ["STEMVO_SHARED_DATA"]) / "kitti", 100
        output_of(PROGRAM, "run", kitti / "sequences/03", "--frames", f"0:{frames}", "--out", self.folder / "real", "--quiet")
        truth = self.folder / "03.txt"
        truth.write_text("".join((kitti / "poses/03.txt").read_text().splitlines(True)[:frames]))
        for name in ("kitti", "tum"):
            self.check(f"trajectory_{name}.txt", "kitti", truth, frames, result="real")

    def test_truth_of_tum(self):
        truth = self.folder / "groundtruth.txt"
        truth.write_text("".join(" ".join(f"{number:.12f}" for number in (time, *place, *turn)) + "\n" for time, place, turn in self.timed))
        self.check("trajectory_tum.txt", "tum", truth, FRAMES - 2)

    def test_truth_of_euroc(self):
        truth, camera = self.folder / "data.csv", self.folder / "sensor.yaml"
        truth.write_text("#timestamp\n" + "".join(
            ",".join([str(round(1e9 * time)), *(f"{number:.12f}" for number in (*place, turn[3], *turn[:3])), *["0"] * 9]) + "\n"
            for time, place, turn in self.timed))
        camera.write_text("resolution: [620, 188]\nintrinsics: [359, 359, 310, 94]\ndistortion_model: none\n"
                          "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n")
        self.check("trajectory_tum.txt", "euroc", truth, FRAMES - 2, "--camera", camera)


if __name__ == "__main__":
    unittest.main()
