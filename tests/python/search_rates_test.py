# SPDX-License-Identifier: MIT
"""tools/search_rates.py on a small rendered drive: its models are what their manifest says, its table is filled."""

import contextlib
import io
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
import yaml  # noqa: E402

import search_rates  # noqa: E402
from stems import manifest  # noqa: E402

PROGRAM = os.environ.get("STEMVO_PROGRAM", str(ROOT / "build/release/stemvo"))


class SearchRates(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_tool(self, *options):
        with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()) as complaints:
            code = search_rates.main(list(map(str, options)))
        return code, said.getvalue(), complaints.getvalue()

    def test_the_models_are_what_the_manifest_says(self):
        for stride in (2, 4):
            search_rates.write_model(self.folder, stride, 6)
        entries = yaml.safe_load((self.folder / "manifest.yaml").read_text(encoding="utf-8"))["models"]
        self.assertEqual([(entry["file"], entry["filters"], entry["stride"], entry["kernel"]) for entry in entries],
                         [("stride2.onnx", 6, 2, [3, 3]), ("stride4.onnx", 6, 4, [4, 4])])
        self.assertEqual([entry.get("sampling") for entry in entries], [None, "native"])  # as exported layers behind a stem are
        image = np.random.default_rng(1).uniform(0, 255, (1, 3, 40, 60)).astype(np.float32)
        for entry, shape in zip(entries, ((6, 19, 29), (6, 10, 15))):
            self.assertEqual(entry["sha256"], manifest.sha256(self.folder / entry["file"]))
            session = onnxruntime.InferenceSession(str(self.folder / entry["file"]), providers=["CPUExecutionProvider"])
            (channels,) = session.run(None, {"image": image})
            self.assertEqual(channels.shape[1:], shape)
            self.assertTrue(np.all(channels.std(axis=(2, 3)) > 0))

    def test_table(self):
        subprocess.run([PROGRAM, "synth", self.folder / "drive", "--frames", "14", "--width", "620", "--height", "188"], check=True, capture_output=True)
        code, said, complaints = self.run_tool(self.folder / "drive/sequences/00", "--filters", 3, "--frames", 14, "--strides", 2, 4, "--program", PROGRAM)
        self.assertEqual((code, complaints), (0, ""))
        heading, *rows, last = said.splitlines()
        self.assertTrue(heading.startswith("stride  filter-frames per core-second"))
        self.assertEqual([row.split()[0] for row in rows], ["2", "4"])
        for row in rows:
            _, rate, tracked, _, memory = row.split()
            self.assertTrue(0 < int(rate) < 1e6 and 0 < int(memory) < 4096, row)
            self.assertTrue(50 < int(tracked) <= 100, row)  # a street that filters of a picture's structure see
        self.assertRegex(last, r"^convolution: [1-9]\d* billion multiplications per core-second$")

    def test_errors(self):
        code, _, complaints = self.run_tool(self.folder, "--program", self.folder / "none")
        self.assertEqual((code, complaints.count("\n")), (1, 1))
        self.assertIn(str(self.folder / "none"), complaints)
        for option in ("--filters", "--frames", "--block", "--strides"):
            with contextlib.redirect_stderr(io.StringIO()) as said, self.assertRaises(SystemExit):
                search_rates.main([str(self.folder), option, "0"])
            self.assertIn(f"{option}: expected a whole number >= 1, found '0'", said.getvalue())


if __name__ == "__main__":
    unittest.main()
