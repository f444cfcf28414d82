# SPDX-License-Identifier: MIT
"""A stem (the first layer of a network) as plain arrays, and the exact foldings between its forms."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class LayerNorm:
    """Over the channels of each pixel: gamma * (y - mean) / sqrt(variance + epsilon) + beta."""

    gamma: np.ndarray  # C
    beta: np.ndarray  # C
    epsilon: float


@dataclasses.dataclass(frozen=True)
class Stem:
    """y = weights (*) pad(image - mean) + bias, then the layer norm if there is one.

    image: RGB, 0..255, or gray where the weights have one plane. Padding adds zeros to (image - mean), as the networks do after their
    normalisation, or repeats the border's pixels; the division by their standard deviation is already inside the weights.
    """

    weights: np.ndarray  # C x 3 x kh x kw, or C x 1 x kh x kw
    bias: np.ndarray  # C
    stride: int
    mean: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))  # gray levels, RGB
    padding: tuple = (0, 0, 0, 0)  # top, left, bottom, right
    layer_norm: LayerNorm | None = None
    repeats_border: bool = False  # beside the image, instead of zeros

    @property
    def filters(self):
        return self.weights.shape[0]

    @property
    def kernel(self):
        """y, x"""
        return tuple(int(size) for size in self.weights.shape[2:])


def same_padding(kernel, stride, size):
    """Before and after on an axis of `size` pixels (TensorFlow's "same"): the odd pixel after."""
    total = max((-(-size // stride) - 1) * stride + kernel - size, 0)
    return total // 2, total - total // 2


def fold_scale(weights, std):
    """Weights for pixels divided by std (per colour, gray levels) -> weights for the pixels."""
    return weights / np.asarray(std, np.float64).reshape(1, 3, 1, 1)


def fold_batch_norm(weights, bias, gamma, beta, mean, variance, epsilon):
    """Convolution followed by batch norm (at inference) -> one convolution: weights, bias."""
    scale = gamma / np.sqrt(variance + epsilon)
    return weights * scale.reshape(-1, 1, 1, 1), (bias - mean) * scale + beta


def fold_mean(stem):
    """The subtraction of the mean moved into the bias. Exact only where nothing is padded."""
    if any(stem.padding):
        raise ValueError("the mean of a padded stem cannot move into its bias")
    shift = np.einsum("cdyx,d->c", stem.weights, stem.mean)
    return dataclasses.replace(stem, bias=stem.bias - shift, mean=np.zeros(3))


def fold_layer_norm_mean(stem):
    """Filters without their average filter: then the mean over channels that the layer norm
    subtracts is zero at every pixel, and need not be computed. Exact with any padding."""
    return dataclasses.replace(stem, weights=stem.weights - stem.weights.mean(axis=0),
                               bias=stem.bias - stem.bias.mean())
