# SPDX-License-Identifier: MIT
"""models/ holds what the commands of docs/lab/default_model.md make."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import onnxruntime

ROOT = pathlib.Path(__file__).resolve().parents[3]


def channels(file, gray):
    return onnxruntime.InferenceSession(str(file)).run(["channels"], {"image": gray})[0]


class DefaultModel(unittest.TestCase):
    def test_the_commands_of_the_page_make_it(self):
        page = (ROOT / "docs/lab/default_model.md").read_text()
        lines = re.findall(r"^(?:build/release/stemvo synth|tools/learn_stem\.py) .*$", page, re.MULTILINE)
        self.assertEqual(len(lines), 4)
        gray = np.random.default_rng(3).integers(0, 256, (1, 1, 64, 96)).astype(np.float32)
        with tempfile.TemporaryDirectory() as folder:
            for line in lines:
                line = line.replace("build/release/stemvo", os.environ["STEMVO_PROGRAM"])
                line = line.replace("build/teacher", f"{folder}/teacher").replace("--out models", f"--out {folder}/models")
                words = line.split()
                program = [sys.executable, str(ROOT / words[0])] if words[0].startswith("tools/") else words[:1]
                subprocess.run(program + words[1:], check=True, stdout=subprocess.DEVNULL)
            names = sorted(file.name for file in pathlib.Path(folder, "models").glob("*.onnx"))
            self.assertEqual(names, sorted(file.name for file in (ROOT / "models").glob("*.onnx")))
            for name in names:  # weights are whole steps of 2^-14: another processor may round one the other way
                shipped, made = (channels(pathlib.Path(where, "models", name), gray) for where in (ROOT, folder))
                self.assertLess(np.abs(made - shipped).max(), 1e-3 * np.abs(shipped).max(), name)


if __name__ == "__main__":
    unittest.main()
