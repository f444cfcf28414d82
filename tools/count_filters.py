#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The paper's Table 1, and the filters that its search uses by stride: what docs/search.md plans its search of all with.

Counts the layers of keras.applications (with their 1000 classes, without weights); used are the Conv2D layers, as in the
paper (tools/stems/layer_list.py has the rule). Needs Keras and one of its backends in the Python that runs this: pip
install keras scipy jax serves the default, KERAS_BACKEND=numpy. Takes 5 GB and a minute.
"""

import argparse
import collections
import dataclasses
import math
import os
import sys

NETWORKS = ("ConvNeXtXLarge", "EfficientNetV2L", "NASNetLarge")


@dataclasses.dataclass
class Counts:
    """A row of Table 1, and what of it is used: filters and layers by stride; stride 0: a 1x1 output, which is no picture."""

    layers: int = 0
    filters: int = 0
    used: collections.Counter = dataclasses.field(default_factory=collections.Counter)
    used_layers: collections.Counter = dataclasses.field(default_factory=collections.Counter)


def count(keras, network, width, height):
    model = getattr(keras.applications, network)(weights=None, input_shape=(height, width, 3))
    found = Counts(layers=len(model.operations))
    for layer in model.operations:  # the sum at the end of a block of ConvNeXt is no Layer to Keras 3, as it was to Keras 2
        shape = layer.output.shape
        found.filters += 0 if type(layer) is keras.layers.Dense else shape[-1]  # units are no filters
        if type(layer) is keras.layers.Conv2D:
            _, rows, columns, channels = shape
            stride = 0 if rows == columns == 1 else 2 ** round(math.log2(width / columns))
            found.used[stride] += channels
            found.used_layers[stride] += 1
    keras.backend.clear_session()
    return found


def report(counts):
    """counts: network -> Counts."""
    lines = ["network          layers  filters   used"]
    lines += [f"{network:16} {row.layers:6} {row.filters:8} {sum(row.used.values()):6}" for network, row in counts.items()]
    lines += [f"in all           {sum(row.layers for row in counts.values()):6} {sum(row.filters for row in counts.values()):8} "
              f"{sum(sum(row.used.values()) for row in counts.values()):6}", "",
              "network          stride     used  layers"]
    lines += [f"{network:16} {stride or '1x1':>6} {row.used[stride]:8} {row.used_layers[stride]:7}"
              for network, row in counts.items() for stride in sorted(row.used)]
    return "\n".join(lines)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, nargs=2, default=(1241, 376), metavar=("W", "H"), help="of a frame (default: 1241 376)")
    options = parser.parse_args(arguments)
    os.environ.setdefault("KERAS_BACKEND", "numpy")
    try:
        import keras
    except ImportError as error:
        sys.exit(f"error: expected Keras and its backend (pip install keras scipy jax), found: {error}")
    print(report({network: count(keras, network, *options.size) for network in NETWORKS}))


if __name__ == "__main__":
    main()
