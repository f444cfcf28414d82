#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Filters of the paper's three networks (Table 1) by stride: what docs/search.md plans its search of all of them with.

Counts the Conv2D layers of keras.applications, as the paper does, without weights. Needs Keras and one of its backends in
the Python that runs this: pip install keras scipy jax serves the default, KERAS_BACKEND=numpy. Takes 3 GB and a minute.
"""

import argparse
import collections
import math
import os
import sys

NETWORKS = ("ConvNeXtXLarge", "EfficientNetV2L", "NASNetLarge")


def count(keras, network, width, height):
    """Filters and layers by stride; stride 0: a 1x1 output, which is no picture."""
    model = getattr(keras.applications, network)(weights=None, include_top=False, input_shape=(height, width, 3))
    filters, layers = collections.Counter(), collections.Counter()
    for layer in model.layers:
        if type(layer) is keras.layers.Conv2D:
            _, rows, columns, channels = layer.output.shape
            stride = 0 if rows == columns == 1 else 2 ** round(math.log2(width / columns))
            filters[stride] += channels
            layers[stride] += 1
    keras.backend.clear_session()
    return filters, layers


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, nargs=2, default=(1241, 376), metavar=("W", "H"), help="of a frame (default: 1241 376)")
    options = parser.parse_args()
    os.environ.setdefault("KERAS_BACKEND", "numpy")
    try:
        import keras
    except ImportError as error:
        sys.exit(f"error: expected Keras and its backend (pip install keras scipy jax), found: {error}")
    print("network          stride  filters  layers")
    total = 0
    for network in NETWORKS:
        filters, layers = count(keras, network, *options.size)
        for stride in sorted(filters):
            print(f"{network:16} {stride or '1x1':>6} {filters[stride]:8} {layers[stride]:7}", flush=True)
        total += sum(filters.values())
    print(f"in all           {total:15}")


if __name__ == "__main__":
    main()
