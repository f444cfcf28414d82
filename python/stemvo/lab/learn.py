# SPDX-License-Identifier: MIT
"""Learns a filter by gradient through the aligner (docs/lab/default_model.md)."""

import pathlib
from collections.abc import Iterator, Sequence

import click
import cv2
import jax
import jax.numpy as jnp
import numpy as np
import onnx
from onnx import numpy_helper

from . import aligner, teaching, warps

SIDE, STRIDE = 8, 2  # of the filter, input px
ROUNDING = 2.0**-14  # of the filter's largest weight: other machines' last bits do not change the file
NUM_LEAVES = 72  # self-made images
BATCH, RATE = 128, 2e-3
FOUND, LOST = 0.02, 0.4  # input px: errors below the one are none, above the other are all alike
STARTS = (2.0, 6.0)  # input px off at most, in turn
EIGHT_BITS = 0.0045  # deviation of the channel's rounding to 8 bits, per deviation of the channel


def symmetric(weights):
    """The same along x, y and the diagonals; sums to one."""
    for turned in (lambda w: w[::-1], lambda w: w[:, ::-1], lambda w: w.T):
        weights = (weights + turned(weights)) / 2
    return weights / weights.sum()


def filtered(weights, image):
    return jax.lax.conv_general_dilated(image[None, None], symmetric(weights)[None, None], (STRIDE, STRIDE), "VALID")[0, 0]


def cost(weights, before, after, place, start, noise):
    """Of a corner that lands off by e: log(e / LOST), bounded on both sides."""
    before, after = filtered(weights, before), filtered(weights, after)
    noise = noise * EIGHT_BITS * jax.lax.stop_gradient(jnp.std(before))
    middle = jnp.full(2, (before.shape[0] - 1) / 2)
    true = middle + place / STRIDE
    landed = aligner.align(before + noise[0], after + noise[1], middle, true + start / STRIDE)
    squared = STRIDE**2 * jnp.sum((landed - true) ** 2)
    return 0.5 * jnp.log((squared + FOUND**2) / (squared + LOST**2))


@jax.jit
def step(weights, moments, number, rate, *batch):
    """One step of Adam."""
    value, gradient = jax.value_and_grad(lambda w: jnp.mean(jax.vmap(cost, (None, 0, 0, 0, 0, 0))(w, *batch)))(weights)
    gradient = jnp.where(jnp.all(jnp.isfinite(gradient)), gradient, 0)
    first, second = 0.9 * moments[0] + 0.1 * gradient, 0.99 * moments[1] + 0.01 * gradient**2
    moved = (first / (1 - 0.9**number)) / (jnp.sqrt(second / (1 - 0.99**number)) + 1e-8)
    return weights - rate * moved, (first, second), value


def learn(crops: teaching.Crops, steps: int, seed: int) -> Iterator[tuple[np.ndarray, float]]:
    """The filter and its cost after each step; it begins as a binomial."""
    rng = np.random.default_rng(seed)
    row = np.array([1, 7, 21, 35, 35, 21, 7, 1]) / 128
    weights = jnp.array(np.outer(row, row), jnp.float32)
    moments = (jnp.zeros_like(weights), jnp.zeros_like(weights))
    pixels = (teaching.SIDE - SIDE) // STRIDE + 1
    for number in range(1, steps + 1):
        chosen = rng.integers(len(crops.before), size=BATCH)
        start = rng.uniform(-1, 1, (BATCH, 2)) * rng.choice(STARTS, (BATCH, 1))
        noise = rng.normal(size=(BATCH, 2, pixels, pixels))
        batch = (crops.before[chosen], crops.after[chosen], crops.place[chosen], start, noise)
        rate = RATE * 0.5 * (1 + np.cos(np.pi * number / steps))
        weights, moments, value = step(weights, moments, float(number), rate, *(jnp.asarray(part, jnp.float32) for part in batch))
        yield np.array(symmetric(weights), float), float(value)


def rounded(weights: np.ndarray) -> np.ndarray:
    unit = ROUNDING * np.abs(weights).max()
    return (np.rint(weights / unit) * unit).astype(np.float32)


def write(weights: np.ndarray, file: pathlib.Path, made_by: str) -> None:
    """A model of one filter, without padding, that says what it is."""
    gray = onnx.helper.make_tensor_value_info("image", onnx.TensorProto.FLOAT, [1, 1, "H", "W"])
    channel = onnx.helper.make_tensor_value_info("channels", onnx.TensorProto.FLOAT, [1, 1, "h", "w"])
    convolution = onnx.helper.make_node("Conv", ["image", "weights"], ["channels"], strides=[STRIDE, STRIDE])
    graph = onnx.helper.make_graph([convolution], "stem", [gray], [channel], [numpy_helper.from_array(weights[None, None], "weights")])
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 13)], producer_name="stemvo")
    model.ir_version = 7  # for every ONNX Runtime since 1.7
    said = {"network": "stemvo, learned through the aligner", "layer": "stem", "filters": 1, "kernel": f"{SIDE} {SIDE}", "stride": STRIDE,
            "padding": "0 0 0 0", "default_filter": 0, "licence": "MIT", "command": made_by}
    onnx.helper.set_model_props(model, {f"stemvo.{key}": str(value) for key, value in said.items()})
    file.write_bytes(model.SerializeToString(deterministic=True))


def frames_of(drives: Sequence[str], seed: int) -> Iterator[np.ndarray]:
    for drive in drives:
        yield from warps.frames_of(drive, 12)
    rng = np.random.default_rng(seed)
    for _ in range(NUM_LEAVES):
        yield teaching.dead_leaves((376, 620), rng)


@click.command()
@click.argument("drives", nargs=-1, required=True)
@click.option("--out", type=click.Path(dir_okay=False, path_type=pathlib.Path), required=True, help="The model, for stem.model.")
@click.option("--steps", default=200, show_default=True)
@click.option("--seed", default=1, show_default=True)
def command(drives, out, steps, seed):
    """Learn a filter by gradient through the odometry's aligner, from DRIVES (rendered) and self-made images.

    Corners of frames that are warped and disturbed (as `stemvo-lab warps`), 8x8 weights, symmetric along x, y and the diagonals: what
    lands them nearest to where they are. The same drives, steps and seed give the same filter."""
    crops = teaching.collect(frames_of(drives, seed), seed)
    click.echo(f"{len(crops.before)} corners")
    costs = []
    for number, (weights, value) in enumerate(learn(crops, steps, seed), 1):
        costs.append(value)
        if number % 50 == 0 or number == steps:
            click.echo(f"step {number}: {np.mean(costs[-50:]):.3f}")
    names = " ".join("/".join(pathlib.Path(drive).parts[-3:]) for drive in drives)
    write(rounded(weights), out, f"stemvo-lab learn {names} --out {out.name} --steps {steps} --seed {seed}")
    click.echo(out)
