# SPDX-License-Identifier: MIT
"""A filter learned by gradient through the aligner (docs/lab/default_model.md)."""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np

from . import aligner, teaching

SIDE, STRIDE = 8, 2  # of the filter, input px
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
