# SPDX-License-Identifier: MIT
"""tools/export_stem.py on files that Keras, timm and torchvision wrote themselves (random weights), value by value
against what these libraries compute. Not in `make test`: the frameworks are 7 GB.

    python3 -m venv V && V/bin/pip install tensorflow-cpu torch torchvision timm safetensors onnx onnxscript
    STEMVO_FRAMEWORKS_PYTHON=V/bin/python make test-frameworks

BatchNorm after an ONNX convolution is folded by its exporter, so whole networks are compared behind a
convolution with its norm where there is one.
"""

import contextlib
import io
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import _environment  # noqa: E402,F401

import numpy as np  # noqa: E402
import onnxruntime  # noqa: E402

import export_stem  # noqa: E402
from stems import metadata  # noqa: E402


def exported(folder, case, *options):
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
        code = export_stem.main([str(folder / case["file"]), "--out", str(folder / "out"), "--name", "model", *options])
    if code != 0:
        raise AssertionError(said.getvalue())
    return onnxruntime.InferenceSession(str(folder / "out/model.onnx"), providers=["CPUExecutionProvider"])


class Frameworks(unittest.TestCase):
    def test_values(self):
        python = os.environ.get("STEMVO_FRAMEWORKS_PYTHON")
        if not python:
            self.skipTest("STEMVO_FRAMEWORKS_PYTHON is not set: a Python with tensorflow-cpu, torch, torchvision, timm")
        for library in ("keras", "torch"):
            with tempfile.TemporaryDirectory() as text:
                self.check_library(python, library, pathlib.Path(text))

    def check_library(self, python, library, folder):
        write = [python, pathlib.Path(__file__).with_name("write_files.py"), folder, library]
        done = subprocess.run(write, check=False, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr[-2000:])
        with np.load(folder / "pictures.npz") as stored:
            pictures = list(stored.values())
        for case in json.loads((folder / f"{library}.json").read_text(encoding="utf-8")):
            with self.subTest(case["file"]):
                self.check(folder, case, pictures)

    def check(self, folder, case, pictures):
        with np.load(folder / case["output"]) as stored:
            wanted = list(stored.values())
        errors = []
        for picture, want in zip(pictures, wanted):
            size = ("--size", f"{picture.shape[2]}x{picture.shape[1]}")
            options = (("--layers", case["layer"], "--preprocessing", case["fed"]) if "fed" in case else ("--padding", "same"))
            got = exported(folder, case, *size, *options).run(None, {"image": picture[None]})[0][0]
            self.assertEqual(got.shape, want.shape)
            self.assertTrue(np.all(np.isfinite(want)))
            errors.append(np.abs(got - want).max() / want.std(dtype=np.float64))
        if "fed" not in case:
            errors.append(self.interior(folder, case, pictures[0], wanted[0]))
        print(f"{case['file']:40} {max(errors):.1e} {case.get('version', '')}")
        self.assertTrue(max(errors) < 1e-4, f"{errors} standard deviations")

    def interior(self, folder, case, picture, want):
        """Without padding (the default), on even sizes: the same values away from the borders. Where the trained
        padding is no whole stride, the trained grid starts so many pixels later."""
        exported(folder, case, "--padding", "same")
        said = metadata.read(folder / "out/model.onnx")
        (top, left, _, _), stride = map(int, said["padding"].split()), int(said["stride"])
        self.assertEqual(top, left)
        cropped = np.ascontiguousarray(picture[:, -top % stride:, -left % stride:])
        got = exported(folder, case).run(None, {"image": cropped[None]})[0][0]
        shift = -(-top // stride)
        inner = want[:, shift:shift + got.shape[1], shift:shift + got.shape[2]]
        return np.abs(got - inner).max() / want.std()


if __name__ == "__main__":
    unittest.main()
