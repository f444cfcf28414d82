# SPDX-License-Identifier: MIT
"""tools/ablation.py: the means, the file it writes, and rows that cannot run."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import ablation

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAM = os.environ["STEMVO_PROGRAM"]


def numbers(t_rel, segments):
    return {"t_rel_percent": t_rel, "r_rel_deg_per_100m": 1.0, "segments": segments}


class Command(unittest.TestCase):
    def test_every_row_of_a_rendered_drive(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            subprocess.run([PROGRAM, "synth", str(folder), "--frames", "20", "--width", "310", "--height", "94"],
                           check=True, capture_output=True)
            out = folder / "table.md"
            command = [sys.executable, str(ROOT / "tools/ablation.py"), str(folder), "--out", str(out), "--sequences",
                       "00", "--program", PROGRAM]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            lines = out.read_text(encoding="utf-8").splitlines()
        for row in ablation.ROWS:
            found = [line for line in lines if line.startswith(f"| {row.heading}")]
            self.assertEqual(len(found), 1, row.heading)
            told = any(problem.startswith(f"Not possible: {row.heading}") for problem in lines)
            self.assertTrue(told or found[0].count(" / ") == 4, found[0])  # two sequences' columns, of three errors
        # Every build can run the defaults.
        self.assertRegex(next(line for line in lines if line.startswith("| the defaults")), r"(\| \d+\.\d\d( / \d+\.\d\d){2} ){2}\|$")

    def test_a_sequence_that_is_not_there_is_wrong_usage(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([sys.executable, str(ROOT / "tools/ablation.py"), folder, "--out", f"{folder}/x"],
                                  capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 2)
        self.assertIn("expected a sequence folder", done.stderr)


if __name__ == "__main__":
    unittest.main()
