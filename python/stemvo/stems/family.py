# SPDX-License-Identifier: MIT
"""stemvo-lab family: a grid of made filters, for a search by odometry (docs/lab/evidence.md)."""

import pathlib

import click
import numpy as np

from . import metadata, onnx_writer
from .stem import Stem

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
    filters |= {f"S{centre}-{share}x{surround}": gaussian(centre) - share * gaussian(surround)
                for centre, surround in ((0.6, 1.3), (0.6, 2.0), (0.9, 1.8), (0.9, 2.5), (1.2, 2.5)) for share in (0.4, 0.7, 0.9, 1.0)}
    filters |= {f"D{sigma}@{degrees}": derivative(sigma, degrees) for sigma in (1.0, 1.5, 2.0) for degrees in (0, 45, 90, 135)}
    filters |= {f"M{sigma}+{share}D1.2@{degrees}": gaussian(sigma) + share * derivative(1.2, degrees)
                for sigma in (0.7, 1.0) for share, degrees in ((1, 90), (3, 90), (8, 90), (3, 45))}
    filters |= {f"S0.6-1x2.0+{share}D1.2@90": gaussian(0.6) - gaussian(2.0) + share * derivative(1.2, 90) for share in (0.3, 1.0)}
    return {name: values / np.abs(values).sum() for name, values in filters.items()}


@click.command()
@click.option("--out", type=click.Path(file_okay=False, path_type=pathlib.Path), required=True, help="Folder, created where missing")
def command(out):
    """Write OUT/family.onnx, filters of 8x8 at stride 2 made by hand; print number and name of each.

    G1.3: Gaussian of sigma 1.3 px. S0.9-0.7x1.8: Gaussian of 0.9 less 0.7 of one of 1.8. D1.5@90: derivative of a Gaussian of 1.5 along 90
    degrees (down). M0.7+3D1.2@90: Gaussian of 0.7 plus 3 of a derivative."""
    filters = family()
    stem = Stem(np.stack(list(filters.values()))[:, None], np.zeros(len(filters)), STRIDE, np.zeros(1), ((SIDE - STRIDE) // 2,) * 4)
    out.mkdir(parents=True, exist_ok=True)
    metadata.write(out / "family.onnx", onnx_writer.build(stem), stem, network="made filters", layer="stem", licence="MIT",
                   command="stemvo-lab family --out models")
    click.echo("\n".join(f"{index:2d} {name}" for index, name in enumerate(filters)))
