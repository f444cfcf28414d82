# SPDX-License-Identifier: MIT
"""tools/filter_family.py: stemvo loads what it writes, and the names say what the filters are."""

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

import filter_family  # noqa: E402

PROGRAM = os.environ.get("STEMVO_PROGRAM", ROOT / "build/release/stemvo")


class FilterFamily(unittest.TestCase):
    def test_stemvo_loads_what_is_named(self):
        with tempfile.TemporaryDirectory() as folder:
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                filter_family.main(["--out", folder])
            names = [line.split()[1] for line in printed.getvalue().splitlines()]
            self.assertEqual(names, list(filter_family.family()))
            done = subprocess.run([PROGRAM, "models", f"{folder}/family.onnx", "--json"], capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            model, = json.loads(done.stdout)["models"]
            self.assertEqual((model["sound"], model["filters"], model["kernel_px"], model["stride_px"]), (True, len(names), [8, 8], 2))

    def test_names(self):
        filters = filter_family.family()
        self.assertEqual(np.unravel_index(filters["D1.5@0"].argmax(), (8, 8))[1], 2)  # a derivative of a Gaussian falls along its angle
        np.testing.assert_allclose(filters["D1.5@90"], filters["D1.5@0"].T)
        self.assertAlmostEqual(filters["S0.9-1.0x2.5"].sum(), 0)
        self.assertAlmostEqual(filters["G1.3"].sum(), 1)


if __name__ == "__main__":
    unittest.main()
