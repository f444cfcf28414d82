# SPDX-License-Identifier: MIT
"""tools/count_filters.py on a network that stands in for Keras' (the real ones: tests/frameworks/table_1.py)."""

import pathlib
import sys
import types
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools"))
import _environment  # noqa: E402,F401

import count_filters  # noqa: E402


class Conv2D:
    pass


class DepthwiseConv2D(Conv2D):  # a kind of convolution, but not that class
    pass


class Dense:
    pass


class Add:  # an operation, no layer
    pass


def keras(outputs):
    """Its one network has these operations: (class, shape of the output)."""
    operations = []
    for kind, shape in outputs:
        operations.append(kind())
        operations[-1].output = types.SimpleNamespace(shape=shape)
    applications = types.SimpleNamespace(Net=lambda weights, input_shape: types.SimpleNamespace(
        operations=operations, layers=[item for item in operations if not isinstance(item, Add)]))
    return types.SimpleNamespace(applications=applications, layers=types.SimpleNamespace(Conv2D=Conv2D, Dense=Dense),
                                 backend=types.SimpleNamespace(clear_session=lambda: None))


class CountFilters(unittest.TestCase):
    def setUp(self):
        self.counts = count_filters.count(keras([
            (Conv2D, (None, 187, 620, 32)), (DepthwiseConv2D, (None, 187, 620, 32)), (Add, (None, 187, 620, 32)),
            (Conv2D, (None, 94, 311, 7)), (Conv2D, (None, 94, 310, 9)), (Conv2D, (None, 12, 39, 100)), (Conv2D, (None, 1, 1, 24)),
            (Dense, (None, 1000))]), "Net", 1241, 376)

    def test_used_are_plain_convolutions_by_stride(self):
        self.assertEqual(dict(self.counts.used), {2: 32, 4: 16, 32: 100, 0: 24})
        self.assertEqual(dict(self.counts.used_layers), {2: 1, 4: 2, 32: 1, 0: 1})

    def test_all_layers_and_all_filters_but_dense_units(self):
        self.assertEqual((self.counts.layers, self.counts.filters), (8, 32 * 3 + 7 + 9 + 100 + 24))

    def test_report_is_table_1_then_the_strides(self):
        text = count_filters.report({"Net": self.counts, "Other": self.counts})
        rows = [line.split() for line in text.splitlines()]
        self.assertEqual(rows[:4], [["network", "layers", "filters", "used"], ["Net", "8", "236", "172"], ["Other", "8", "236", "172"],
                                    ["in", "all", "16", "472", "344"]])
        self.assertEqual(rows[6:10], [["Net", "1x1", "24", "1"], ["Net", "2", "32", "1"], ["Net", "4", "16", "2"], ["Net", "32", "100", "1"]])


if __name__ == "__main__":
    unittest.main()
