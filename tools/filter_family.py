#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A grid of made filters of 8x8 at stride 2, for a search by odometry: OUT/family.onnx; prints number and name of each
filter. docs/lab/evidence.md has what came of it.

G1.3: Gaussian of sigma 1.3 px. S0.9-0.7x1.8: Gaussian of 0.9 less 0.7 of one of 1.8. D1.5@90: derivative of a Gaussian of 1.5
along 90 degrees (down). M0.7+3D1.2@90: Gaussian of 0.7 plus 3 of a derivative.
"""

import _environment  # noqa: F401  starts this tool again in build/venv

import argparse
import pathlib
import sys

import numpy as np

from stems import metadata, onnx_writer
from stems import stem as stem_module

SIDE, STRIDE = 8, 2
Y, X = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2


def gaussian(sigma):
    values = np.exp(-(X**2 + Y**2) / (2 * sigma**2))
    return values / values.sum()


def derivative(sigma, degrees):
    angle = np.radians(degrees)
    values = -(np.cos(angle) * X + np.sin(angle) * Y) * gaussian(sigma)
    return values / np.abs(values).sum()


def family():
    """name -> filter; the sizes of a filter's weights sum to 1."""
    filters = {f"G{sigma}": gaussian(sigma) for sigma in (0.6, 0.9, 1.3, 1.8)}
    for centre, surround in ((0.6, 1.3), (0.6, 2.0), (0.9, 1.8), (0.9, 2.5), (1.2, 2.5)):
        for share in (0.4, 0.7, 0.9, 1.0):
            filters[f"S{centre}-{share}x{surround}"] = gaussian(centre) - share * gaussian(surround)
    for sigma in (1.0, 1.5, 2.0):
        for degrees in (0, 45, 90, 135):
            filters[f"D{sigma}@{degrees}"] = derivative(sigma, degrees)
    for sigma in (0.7, 1.0):
        for share, degrees in ((1, 90), (3, 90), (8, 90), (3, 45)):
            filters[f"M{sigma}+{share}D1.2@{degrees}"] = gaussian(sigma) + share * derivative(1.2, degrees)
    for share in (0.3, 1.0):
        filters[f"S0.6-1x2.0+{share}D1.2@90"] = gaussian(0.6) - gaussian(2.0) + share * derivative(1.2, 90)
    return {name: values / np.abs(values).sum() for name, values in filters.items()}


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=pathlib.Path, required=True, help="created where missing")
    out = parser.parse_args(arguments).out
    filters = family()
    stem = stem_module.Stem(np.stack(list(filters.values()))[:, None], np.zeros(len(filters)), stride=STRIDE, mean=np.zeros(1),
                            padding=((SIDE - STRIDE) // 2,) * 4)
    file = out / "family.onnx"
    try:
        out.mkdir(parents=True, exist_ok=True)
        metadata.write(file, onnx_writer.build(stem), stem, network="made filters", layer="stem", licence="MIT",
                       command="tools/filter_family.py --out models")
    except OSError as error:
        sys.exit(f"error: {error.filename}: expected to write here, found: {error.strerror}")
    print("\n".join(f"{index:2d} {name}" for index, name in enumerate(filters)))


if __name__ == "__main__":
    main()
