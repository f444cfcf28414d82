# SPDX-License-Identifier: MIT
"""tools/ablation.py: the file it writes, and rows that cannot run."""

import os
import pathlib
import re
import subprocess
import sys

import ablation

PROGRAM, TOOL = os.environ["STEMVO_PROGRAM"], pathlib.Path(__file__).resolve().parents[3] / "tools/ablation.py"


def test_every_row_of_a_rendered_drive(tmp_path):
    subprocess.run([PROGRAM, "synth", tmp_path, "--frames", "20", "--width", "310", "--height", "94"], check=True, capture_output=True)
    out = tmp_path / "table.md"
    subprocess.run([sys.executable, TOOL, tmp_path, "--out", out, "--sequences", "00", "--program", PROGRAM], check=True)
    lines = out.read_text(encoding="utf-8").splitlines()
    for row in ablation.ROWS:
        found = [line for line in lines if line.startswith(f"| {row.heading}")]
        assert len(found) == 1, row.heading
        told = any(problem.startswith(f"Not possible: {row.heading}") for problem in lines)
        assert told or found[0].count(" / ") == 4, found[0]  # two sequences' columns, of three errors
    # Every build can run the defaults.
    assert re.search(r"(\| \d+\.\d\d( / \d+\.\d\d){2} ){2}\|$", next(line for line in lines if line.startswith("| the defaults")))
