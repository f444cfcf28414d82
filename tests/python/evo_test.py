# SPDX-License-Identifier: MIT
"""evo reads every trajectory file of a run and agrees with `stemvo evaluate` on ATE and RPE to 1e-6."""

import json
import os
import pathlib
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("STEMVO_PROGRAM", str(ROOT / "build/release/stemvo"))
EVO = ROOT / "build/venv-evo/bin/python"


def output_of(*command):
    return subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True).stdout


@unittest.skipUnless(EVO.exists(), "tools/setup.sh evo has not run")
class Evo(unittest.TestCase):
    def test_agrees_on_every_file(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        drive, out = pathlib.Path(folder.name) / "drive", pathlib.Path(folder.name) / "result"
        output_of(PROGRAM, "synth", drive, "--frames", 40, "--width", 620, "--height", 188)
        output_of(PROGRAM, "run", drive / "sequences/00", "--out", out, "--quiet")
        truth = drive / "poses/00.txt"
        for name in ("trajectory_kitti.txt", "trajectory_refined_kitti.txt", "trajectory_tum.txt"):
            ours = json.loads(output_of(PROGRAM, "evaluate", "--gt", truth, out / name, "--json", "-"))["estimates"][0]
            kind = "tum" if "tum" in name else "kitti"
            theirs = json.loads(output_of(EVO, ROOT / "tests/evo/judge.py", kind, truth, out / name))
            self.assertEqual(theirs["poses"], 40)
            for alignment, error in theirs["ate_rmse_m"].items():
                self.assertGreater(error, 0.0)
                self.assertAlmostEqual(error, ours["ate_rmse_m"][alignment], delta=1e-6, msg=f"{name}, {alignment}")
            self.assertAlmostEqual(theirs["rpe_rotation_deg"], ours["rpe_rotation_deg"], delta=1e-6, msg=name)


if __name__ == "__main__":
    unittest.main()
