# SPDX-License-Identifier: MIT
"""tools/count_filters.py on Keras' own networks: the paper's Table 1, exactly. As export_frameworks.py, not in `make test`."""

import os
import pathlib
import subprocess
import unittest

TOOL = pathlib.Path(__file__).resolve().parents[2] / "tools/count_filters.py"
# Layers, filters, used: the paper's Table 1.
TABLE_1 = {"ConvNeXtXLarge": (297, 332_806, 36_096), "EfficientNetV2L": (1031, 1_253_254, 261_216), "NASNetLarge": (1041, 502_407, 16_434)}


class Table1(unittest.TestCase):
    def test_numbers(self):
        python = os.environ.get("STEMVO_FRAMEWORKS_PYTHON")
        if not python:
            self.skipTest("STEMVO_FRAMEWORKS_PYTHON is not set: a Python with keras and a backend")
        environment = os.environ if subprocess.run([python, "-c", "import jax, scipy"], check=False, capture_output=True).returncode == 0 \
            else {**os.environ, "KERAS_BACKEND": "tensorflow"}
        done = subprocess.run([python, TOOL], check=False, capture_output=True, text=True, env=environment)
        self.assertEqual(done.returncode, 0, done.stderr[-2000:])
        rows = [line.split() for line in done.stdout.splitlines()]
        self.assertEqual({row[0]: tuple(map(int, row[1:])) for row in rows[1:4]}, TABLE_1)
        self.assertEqual(rows[4], ["in", "all", "2369", "2088467", "313746"])
        used = {network: 0 for network in TABLE_1}
        for network, _stride, filters, _layers in rows[7:]:
            used[network] += int(filters)
        self.assertEqual(used, {network: row[2] for network, row in TABLE_1.items()})


if __name__ == "__main__":
    unittest.main()
