# SPDX-License-Identifier: MIT
"""The odometry's patch aligner (src/features/patch_alignment.cpp) for JAX: differentiable, a batch at a time, two levels.

Patches of 8x8: a translation on the coarser level, a similarity on the finer; inverse composition, samples of a cubic spline (in C++
bilinear ones on the coarser), gain and bias projected out."""

import jax
import jax.numpy as jnp

_OFFSETS = jnp.arange(8.0) - 3.5
_DX, _DY = (grid.ravel() for grid in jnp.meshgrid(_OFFSETS, _OFFSETS))
_COARSE_STEPS, _FINE_STEPS = 5, 5
_POWERS = (3**0.5 - 2) ** abs(jnp.arange(-3.0, 4.0))


def _filtered(image, kernel, stride):
    """By the kernel along x and along y."""
    padded = jnp.pad(image, len(kernel) // 2, mode="reflect")[None, None]
    return jax.lax.conv_general_dilated(padded, jnp.outer(kernel, kernel)[None, None], (stride, stride), "VALID")[0, 0]


def _coefficients(image):
    """Of the cubic spline through the pixels (src/features/patch_pyramid.cpp)."""
    return _filtered(image, _POWERS / _POWERS.sum(), 1)


def _half(image):
    """cv::pyrDown."""
    return _filtered(image, jnp.array([1.0, 4, 6, 4, 1]) / 16, 2)


def _weights(t):
    return jnp.stack([(1 - t) ** 3, (3 * t - 6) * t * t + 4, ((3 - 3 * t) * t + 3) * t + 1, t**3], -1) / 6


def _sample(coefficients, x, y):
    """x, y: 64 places each, inside."""
    column, row = jnp.clip(jnp.floor(x), 1, coefficients.shape[1] - 3), jnp.clip(jnp.floor(y), 1, coefficients.shape[0] - 3)
    columns = column.astype(int)[:, None] + jnp.arange(-1, 3)
    rows = row.astype(int)[:, None] + jnp.arange(-1, 3)
    pixels = coefficients[rows[:, :, None], columns[:, None, :]]
    return jnp.einsum("nij,ni,nj->n", pixels, _weights(y - row), _weights(x - column))


def _slopes(image, x, y):
    across = _sample(image, x + 1, y) - _sample(image, x - 1, y)
    return across / 2, (_sample(image, x, y + 1) - _sample(image, x, y - 1)) / 2


def _without_gain(value, columns):
    """The value's mean 0, the columns orthogonal to it and to 1; and its power."""
    value = value - value.mean()
    power = value @ value + 1e-9
    columns = columns - columns.mean(0)
    return value, columns - value[:, None] * (value @ columns) / power, power


def _translation(before, after, at, start):
    value = _sample(before, at[0] + _DX, at[1] + _DY)
    jacobian = jnp.stack(_slopes(before, at[0] + _DX, at[1] + _DY), 1)
    value, jacobian, power = _without_gain(value, jacobian)
    hessian = jacobian.T @ jacobian
    hessian += 1e-4 * jnp.trace(hessian) * jnp.eye(2) + 1e-9 * jnp.eye(2)
    place = start
    for _ in range(_COARSE_STEPS):
        seen = _sample(after, place[0] + _DX, place[1] + _DY)
        gain = jnp.maximum(seen @ value / power, 1)
        place = place - jnp.clip(jnp.linalg.solve(hessian, jacobian.T @ seen) / gain, -3, 3)
    return place


def _similarity(before, after, at, start):
    value = _sample(before, at[0] + _DX, at[1] + _DY)
    gx, gy = _slopes(before, at[0] + _DX, at[1] + _DY)
    columns = jnp.stack([gx, gy, gx * _DX + gy * _DY, gy * _DX - gx * _DY], 1)
    value, columns, power = _without_gain(value, columns)
    hessian = columns.T @ columns
    hessian += 1e-5 * jnp.diag(jnp.diag(hessian)) + 1e-9 * jnp.eye(4)
    inverse = jnp.linalg.inv(hessian)
    step_of = jnp.linalg.inv(hessian[:2, :2]) @ columns[:, :2].T
    x, y, a, b = start[0], start[1], 1.0, 0.0
    for i in range(_FINE_STEPS):
        seen = _sample(after, x + a * _DX - b * _DY, y + b * _DX + a * _DY)
        gain = jnp.maximum((seen - seen.mean()) @ value / power, 0.1)
        error = seen / gain - value
        if i < 2:
            step = jnp.concatenate([step_of @ error, jnp.zeros(2)])
        else:
            step = inverse @ (columns.T @ error)
        step = jnp.clip(step, -2, 2)
        c, s = 1 + jnp.clip(step[2], -0.3, 0.3), jnp.clip(step[3], -0.3, 0.3)
        scale = 1 / (c * c + s * s)
        a, b = (a * c + b * s) * scale, (b * c - a * s) * scale
        x, y = x - (a * step[0] - b * step[1]), y - (b * step[0] + a * step[1])
    return jnp.stack([x, y])


def align(before, after, at, start):
    """Where the patch at `at` (x, y) of `before` lands in `after` from `start`; pixels of the channel."""
    coarse = _translation(*(_coefficients(_half(image)) for image in (before, after)), at / 2, start / 2)
    return _similarity(_coefficients(before), _coefficients(after), at, 2 * coarse)
