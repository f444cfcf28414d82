# SPDX-License-Identifier: MIT
"""stemvo-lab show: a stem's filters as a picture, and how far its channels are from plain gray."""

import pathlib

import click
import cv2
import numpy as np
import onnx
import onnxruntime

from ..lab import figures
from . import onnx_writer
from .drive import LUMA

COLUMNS = 8


def read_weights(path):
    """C x planes x kh x kw, the stride and the padding (top, left, bottom, right) of a file that onnx_writer wrote."""
    try:
        graph = onnx.load(path).graph
    except Exception as error:  # protobuf's own types differ between its versions
        raise ValueError(f"{path}: expected an ONNX file, found: {' '.join(str(error).split())}") from error
    weights = [onnx.numpy_helper.to_array(item) for item in graph.initializer if item.name == "weights"]
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    if len(weights) != 1 or len(convolutions) != 1:
        raise ValueError(f"{path}: expected one convolution with `weights`, found {len(convolutions)}")
    attributes = {item.name: list(item.ints) for item in convolutions[0].attribute}
    around = [onnx.numpy_helper.to_array(item) for item in graph.initializer if item.name == "around"]  # onnx_writer's repeated border
    return weights[0], attributes["strides"][0], around[0][[2, 3, 6, 7]].tolist() if around else attributes["pads"]


def draw(weights, title, path):
    """Each filter's response to gray (the sum over R, G, B), on its own symmetric gray scale."""
    filters = weights.sum(axis=1)
    figure, axes = figures.sheet(len(filters), columns=COLUMNS, height_in=0.3 + 1.1 * -(-len(filters) // COLUMNS))
    for index, (axis, values) in enumerate(zip(axes, filters)):
        limit = np.abs(values).max() or 1.0
        axis.imshow(values, cmap="gray", vmin=-limit, vmax=limit, interpolation="nearest")
        axis.set_title(str(index))
        axis.axis("off")
    figure.suptitle(title)
    figure.savefig(path, dpi=150, metadata={"Software": None})


def correlations(session, weights, stride, padding, images):
    """C x frames, and the standard deviation of each channel."""
    top, left, bottom, right = padding
    found, deviations = [], []
    for path in images:
        picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if picture is None:
            raise ValueError(f"{path}: expected a PNG, found another file")
        gray = picture[:, :, ::-1].astype(np.float32) @ LUMA.astype(np.float32)
        channels = session.run([onnx_writer.OUTPUT], {onnx_writer.INPUT: np.tile(gray, (1, weights.shape[1], 1, 1))})[0][0]
        side = weights.shape[2:]
        patches = np.lib.stride_tricks.sliding_window_view(np.pad(gray, ((top, bottom), (left, right))), side)[::stride, ::stride]
        middle = patches[:, :, (side[0] - 1) // 2:side[0] // 2 + 1, (side[1] - 1) // 2:side[1] // 2 + 1].mean(axis=(2, 3))
        deviations.append(channels.std(axis=(1, 2)))
        with np.errstate(invalid="ignore"):
            found.append([np.corrcoef(channel.ravel(), middle.ravel())[0, 1] for channel in channels])
    return np.array(found).T, np.mean(deviations, axis=0)


@click.command()
@click.argument("model", type=click.Path(path_type=pathlib.Path))
@click.option("--picture", type=click.Path(dir_okay=False, path_type=pathlib.Path), help="The filters, as a PNG")
@click.option("--images", type=click.Path(file_okay=False, path_type=pathlib.Path), help="Folder of frames (PNG) to correlate with gray on")
@click.option("--every", type=click.IntRange(1), default=10, show_default=True, help="Of the frames")
@click.option("--weights", "number", type=int, metavar="K", help="Print the weights of filter K, summed over R, G, B")
def command(model, picture, images, every, number):
    """Show a stem's filters, and how far its channels are from gray: the correlation between a channel at its own stride and the gray level in
    the middle of each of its patches, over all pixels of a frame, averaged over the frames."""
    weights, stride, padding = read_weights(model)
    if picture:
        draw(weights, model.name, picture)
    if number is not None:
        if not 0 <= number < len(weights):
            raise ValueError(f"--weights: expected 0 to {len(weights) - 1}, found {number}")
        values = weights[number].sum(axis=0)
        click.echo(np.array2string(values / np.abs(values).sum(), precision=3, suppress_small=True))
    if images:
        chosen = sorted(images.glob("*.png"))[::every]
        if not chosen:
            raise ValueError(f"{images}: expected PNG files, found none")
        session = onnxruntime.InferenceSession(str(model), providers=["CPUExecutionProvider"])
        found, deviations = correlations(session, weights, stride, padding, chosen)
        click.echo(f"{images}: {len(chosen)} frames")
        for index, (row, deviation) in enumerate(zip(found, deviations)):
            click.echo(f"filter {index:2d}: correlation with gray {row.mean():6.3f} (from {row.min():.3f} to {row.max():.3f}), "
                       f"standard deviation {deviation:.3f}")
