#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Shows a stem: its filters as a picture, and how far its channels are from plain gray.

The correlation is between a channel at its own stride and the gray level in the middle of each of
its patches, over all pixels of a frame, averaged over the frames.
"""

import _environment  # noqa: F401  starts this tool again in build/venv

import argparse
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.image  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import onnx  # noqa: E402
import onnxruntime  # noqa: E402

from stems import drive, onnx_writer  # noqa: E402

COLUMNS = 8


class ShowError(Exception):
    """One line for the user."""


def read_weights(path):
    """C x 3 x kh x kw, the stride and the padding (top, left, bottom, right) of a file that onnx_writer wrote."""
    try:
        graph = onnx.load(path).graph
    except Exception as error:  # protobuf's own types differ between its versions
        raise ShowError(f"{path}: expected an ONNX file, found: {' '.join(str(error).split())}") from error
    weights = [onnx.numpy_helper.to_array(item) for item in graph.initializer if item.name == "weights"]
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    if len(weights) != 1 or len(convolutions) != 1:
        raise ShowError(f"{path}: expected one convolution with `weights`, found {len(convolutions)}")
    attributes = {item.name: list(item.ints) for item in convolutions[0].attribute}
    return weights[0], attributes["strides"][0], attributes["pads"]


def draw(weights, title, path):
    """Each filter's response to gray (the sum over R, G, B), on its own symmetric gray scale."""
    filters = weights.sum(axis=1)
    rows = -(-len(filters) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(COLUMNS * 1.1, rows * 1.3 + 0.4), squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for index, (axis, values) in enumerate(zip(axes.flat, filters)):
        limit = np.abs(values).max() or 1.0
        axis.imshow(values, cmap="gray", vmin=-limit, vmax=limit, interpolation="nearest")
        axis.set_title(str(index), fontsize=9)
    figure.suptitle(title, fontsize=10)
    figure.tight_layout()
    figure.savefig(path, dpi=100, metadata={"Software": None})
    plt.close(figure)


def read_gray(path):
    try:
        picture = matplotlib.image.imread(path).astype(np.float32)
    except (OSError, SyntaxError, ValueError) as error:
        raise ShowError(f"{path}: expected a PNG, found: {error}") from error
    return 255.0 * (picture if picture.ndim == 2 else picture[:, :, :3] @ drive.LUMA.astype(np.float32))


def correlations(session, weights, stride, padding, images):
    """C x frames, and the standard deviation of each channel."""
    rows, columns = weights.shape[2:]
    top, left, bottom, right = padding
    found, deviations = [], []
    for path in images:
        gray = read_gray(path)
        image = np.tile(gray, (1, weights.shape[1], 1, 1))
        channels = session.run([onnx_writer.OUTPUT], {onnx_writer.INPUT: image})[0][0]
        padded = np.pad(gray, ((top, bottom), (left, right)))
        patches = np.lib.stride_tricks.sliding_window_view(padded, (rows, columns))[::stride, ::stride]
        middle = patches[:, :, (rows - 1) // 2:rows // 2 + 1, (columns - 1) // 2:columns // 2 + 1].mean(axis=(2, 3))
        deviations.append(channels.std(axis=(1, 2)))
        with np.errstate(invalid="ignore"):
            found.append([np.corrcoef(channel.ravel(), middle.ravel())[0, 1] for channel in channels])
    return np.array(found).T, np.mean(deviations, axis=0)


def parse_arguments(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", metavar="MODEL.onnx", type=pathlib.Path)
    parser.add_argument("--picture", metavar="FILE.png", type=pathlib.Path, help="the filters")
    parser.add_argument("--images", metavar="DIR", type=pathlib.Path, help="frames (PNG) to correlate with gray on")
    parser.add_argument("--every", type=int, default=10, help="of the frames (default: %(default)s)")
    parser.add_argument("--weights", metavar="K", type=int, help="print the weights of filter K, summed over R, G, B")
    return parser.parse_args(arguments)


def show(options):
    weights, stride, padding = read_weights(options.model)
    if options.picture:
        draw(weights, options.model.name, options.picture)
    if options.weights is not None:
        if not 0 <= options.weights < len(weights):
            raise ShowError(f"--weights: expected 0 to {len(weights) - 1}, found {options.weights}")
        values = weights[options.weights].sum(axis=0)
        print(np.array2string(values / np.abs(values).sum(), precision=3, suppress_small=True))
    if options.images:
        images = sorted(options.images.glob("*.png"))[::max(options.every, 1)]
        if not images:
            raise ShowError(f"{options.images}: expected PNG files, found none")
        session = onnxruntime.InferenceSession(str(options.model), providers=["CPUExecutionProvider"])
        found, deviations = correlations(session, weights, stride, padding, images)
        print(f"{options.images}: {len(images)} frames")
        for index, (row, deviation) in enumerate(zip(found, deviations)):
            print(f"filter {index:2d}: correlation with gray {row.mean():6.3f} (from {row.min():.3f} to {row.max():.3f}), "
                  f"standard deviation {deviation:.3f}")


def main(arguments=None):
    try:
        show(parse_arguments(arguments))
    except ShowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: {error.filename}: expected to write here, found: {error.strerror}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
