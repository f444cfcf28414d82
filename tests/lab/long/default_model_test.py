# SPDX-License-Identifier: MIT
"""models/ holds what the commands of docs/lab/default_model.md make."""

import os
import pathlib
import re
import subprocess
import sys

import numpy as np
from exporting import run_onnx

ROOT = pathlib.Path(__file__).resolve().parents[3]


def test_the_commands_of_the_page_make_it(tmp_path):
    page = (ROOT / "docs/lab/default_model.md").read_text()
    lines = re.findall(r"^(?:build/release/stemvo synth|stemvo-lab learn) build.*$", page, re.MULTILINE)
    assert len(lines) == 4
    for line in lines:
        line = line.replace("build/release/stemvo", os.environ["STEMVO_PROGRAM"]).replace("stemvo-lab", f"{sys.executable} -m stemvo.lab.cli")
        line = line.replace("learned.onnx", str(ROOT / "models/default_filter_0.onnx"))  # descent_test learns one
        line = line.replace("build/teacher", f"{tmp_path}/teacher").replace("--out models", f"--out {tmp_path}/models")
        subprocess.run(line.split(), check=True, stdout=subprocess.DEVNULL)
    names = sorted(file.name for file in (tmp_path / "models").glob("*.onnx"))
    assert names == sorted(file.name for file in (ROOT / "models").glob("*.onnx"))
    gray = np.random.default_rng(3).integers(0, 256, (1, 64, 96))
    for name in names:  # weights are whole steps of 2^-14: another processor may round one the other way
        shipped, made = (run_onnx(where / "models" / name, gray) for where in (ROOT, tmp_path))
        assert np.abs(made - shipped).max() < 1e-3 * np.abs(shipped).max(), name
