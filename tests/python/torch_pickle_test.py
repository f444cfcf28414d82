# SPDX-License-Identifier: MIT
"""tools/stems/torch_pickle.py on files made to exhaust the machine: refused, in little time and memory."""

import pathlib
import re
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools"))
import _environment  # noqa: E402,F401

import numpy as np  # noqa: E402

import weight_file_writers as writers  # noqa: E402
from stems import torch_pickle, weight_files  # noqa: E402
from stems.weights import WeightsError  # noqa: E402


class HostileFiles(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name) / "weights.pth"
        self.start = time.monotonic()
        self.weight = np.arange(6, dtype=np.float32).reshape(2, 3)

    def tearDown(self):
        self.assertLess(time.monotonic() - self.start, 20)

    def test_a_dictionary_inside_itself_is_left_out(self):
        inner = {"weight": self.weight}
        inner |= {f"name{i}": inner for i in range(60)}
        outer = {"inner": inner}
        inner["outer"] = outer
        writers.torch_zip(self.path, outer)
        found = torch_pickle.read(self.path)
        self.assertLessEqual(len(found), 2)  # the outermost dictionary is the writer's own copy of `outer`
        np.testing.assert_array_equal(found["inner.weight"].array(), self.weight)

    def test_a_dictionary_under_two_names_has_both(self):
        layer = {"weight": self.weight}
        writers.torch_zip(self.path, {"model": layer, "model_ema": layer})
        self.assertEqual(set(torch_pickle.read(self.path)), {"model.weight", "model_ema.weight"})

    def test_dictionaries_that_hold_each_other_many_times_are_refused(self):
        level = {"weight": self.weight}
        for _ in range(7):
            level = {f"name{i}": level for i in range(60)}
        writers.torch_zip(self.path, level)
        with self.assertRaisesRegex(ValueError, "too many names"):
            torch_pickle.read(self.path)

    def test_many_numbers_out_of_one_are_refused(self):
        for shape in ((1 << 40,), (1 << 20, 1 << 20), (7, 1)):
            writers.torch_zip(self.path, {"conv.weight": np.broadcast_to(np.float32(1), (1,))})
            tensor = torch_pickle.read(self.path)["conv.weight"]
            stretched = torch_pickle.Tensor(tensor._storage, 0, shape, [0] * len(shape))
            with self.assertRaisesRegex(ValueError, r"a tensor of \d+ numbers in a storage of 1$"):
                stretched.array()

    def test_the_user_sees_one_line(self):
        before = writers._torch_pickle
        one, stretched = rb"K\x01\x85(q.)K\x01\x85", b"J\x00\x00\x00\x40\x85\\1K\x00\x85"  # shape (1,) strides (1,) -> (2^30,), (0,)
        writers._torch_pickle = lambda *what, **more: re.sub(one, stretched, before(*what, **more), flags=re.DOTALL)
        self.addCleanup(setattr, writers, "_torch_pickle", before)
        writers.torch_zip(self.path, {"conv.weight": np.ones(1, np.float32)})
        file = weight_files.load(self.path)
        self.assertEqual(file.layers[0].shapes["weight"], (1 << 30,))
        with self.assertRaises(WeightsError) as raised:
            weight_files.read_array(file, file.layers[0], "weight")
        self.assertEqual(str(raised.exception), f"{self.path}: conv.weight: cannot read: a tensor of 1073741824 numbers in a storage of 1")


if __name__ == "__main__":
    unittest.main()
