# SPDX-License-Identifier: MIT
"""tools/show_stem.py on filters that are known: what it reads, draws, correlates and refuses."""

import contextlib
import io
import pathlib
import re
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import _environment  # noqa: E402,F401

import matplotlib.image  # noqa: E402
import numpy as np  # noqa: E402

import show_stem  # noqa: E402
from stems import onnx_writer, stem  # noqa: E402


class ShowStem(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        mean = np.full((1, 3, 2, 2), 1 / 12)
        derivative = np.array([[-1.0, 1.0], [-1.0, 1.0]]).reshape(1, 1, 2, 2).repeat(3, axis=1)
        self.weights = np.concatenate([mean, -mean, derivative])
        self.model = self.save("three.onnx")

    def save(self, name, **more):
        path = self.folder / name
        made = stem.Stem(self.weights, np.zeros(3), 2, **{"mean": np.zeros(3), **more})
        path.write_bytes(onnx_writer.to_bytes(onnx_writer.build(made)))
        return path

    def run_tool(self, *options):
        with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()) as complaints:
            code = show_stem.main(list(map(str, options)))
        return code, said.getvalue(), complaints.getvalue()

    def test_reads_what_was_written(self):
        weights, stride, padding = show_stem.read_weights(self.model)
        self.assertEqual((stride, padding), (2, [0, 0, 0, 0]))
        np.testing.assert_allclose(weights, self.weights, atol=1e-7)
        weights, stride, padding = show_stem.read_weights(ROOT / "models/default.onnx")
        self.assertEqual((len(weights), weights.shape[2:], stride, padding), (16, (8, 8), 2, [3, 3, 3, 3]))

    def test_prints_a_filter_by_its_share(self):
        code, said, _ = self.run_tool(self.model, "--weights", 2)
        self.assertEqual((code, re.findall(r"-?\d\.\d+", said)), (0, ["-0.25", "0.25", "-0.25", "0.25"]))

    def test_correlation_with_gray(self):
        """A mean is gray itself, its negative is the opposite, and a derivative of noise has nothing to do with it."""
        rng = np.random.default_rng(5)
        frames = self.folder / "frames"
        frames.mkdir()
        for index in range(3):
            matplotlib.image.imsave(frames / f"{index}.png", rng.uniform(0, 1, (1, 1, 1)).repeat(3, axis=2) * rng.uniform(0.2, 1, (80, 120, 1)))
        code, said, complaints = self.run_tool(self.model, "--images", frames, "--every", 2)
        self.assertEqual((code, complaints), (0, ""))
        self.assertIn(f"{frames}: 2 frames\n", said)
        found = [float(value) for value in re.findall(r"filter +\d: correlation with gray +(\S+) ", said)]
        np.testing.assert_allclose(found[:2], (1, -1), atol=1e-3)
        self.assertLess(abs(found[2]), 0.1)

    def test_picture(self):
        code, _, _ = self.run_tool(self.model, "--picture", self.folder / "filters.png")
        picture = matplotlib.image.imread(self.folder / "filters.png")
        self.assertEqual(code, 0)
        self.assertGreater(min(picture.shape[:2]), 50)
        self.assertGreater(picture[:, :, :3].std(), 0.01)  # not blank

    def test_errors(self):
        (self.folder / "text.onnx").write_text("text")
        (self.folder / "empty").mkdir()
        (self.folder / "damaged").mkdir()
        (self.folder / "damaged/0.png").write_bytes(b"\x89PNG\r\n\x1a\n")
        for options, message in (((self.folder / "text.onnx",), "text.onnx: expected an ONNX file"), ((self.folder / "none.onnx",), "expected an ONNX file"),
                                 ((self.model, "--weights", 3), "--weights: expected 0 to 2, found 3"),
                                 ((self.model, "--images", self.folder / "empty"), "expected PNG files, found none"),
                                 ((self.model, "--images", self.folder / "damaged"), "0.png: expected a PNG, found"),
                                 ((self.model, "--picture", self.folder / "none/a.png"), "none/a.png: expected to write here, found: No such file")):
            code, _, complaints = self.run_tool(*options)
            self.assertEqual((code, complaints.count("\n")), (1, 1), complaints)
            self.assertIn(message, complaints)


if __name__ == "__main__":
    unittest.main()
