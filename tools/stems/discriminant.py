# SPDX-License-Identifier: MIT
"""Linear discriminant embedding of gray patches (the linear case of Hua, Brown, Winder: Discriminant
Learning of Local Image Descriptors, ICCV 2007): filters w that maximise

    w' S w / w' N w

S: covariance of the patches (what tells one place from another);
N: covariance of the differences between two views of the same place (what does not).
"""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class Nuisance:
    """Differences between two views that a rendered drive does not have, as standard deviations."""

    gain: float = 0.03  # of exposure, relative
    offset: float = 2.0  # gray levels, all pixels alike
    noise: float = 6.0  # gray levels, each pixel on its own, in each view

    def covariance(self, second_moment):
        """second_moment: E[p p'] of the patches."""
        return (self.gain**2 * second_moment + self.offset**2 * np.ones_like(second_moment)
                + 2.0 * self.noise**2 * np.eye(len(second_moment)))


class Scatter:
    """Sums over pairs of corresponding patches (N x pixels of square patches, gray levels). A street seen in
    a mirror is as good a street, so every pair counts mirrored too: filters come out even or odd in x."""

    def __init__(self, size):
        self._size = size
        self.count = 0
        self._sum = np.zeros(size * size)
        self._moment = np.zeros((size * size, size * size))
        self._difference = np.zeros((size * size, size * size))

    def add(self, before, after):
        self.count += len(before)
        self._sum += before.sum(axis=0)
        self._moment += before.T @ before
        self._difference += (after - before).T @ (after - before)

    def _mean_with_mirrored(self, sums):
        mirror = np.arange(self._size**2).reshape(self._size, self._size)[:, ::-1].ravel()
        mirrored = sums[mirror] if sums.ndim == 1 else sums[np.ix_(mirror, mirror)]
        return (sums + mirrored) / (2 * self.count)

    def mean(self):
        return self._mean_with_mirrored(self._sum)

    def signal(self):
        """S."""
        return self._mean_with_mirrored(self._moment) - np.outer(self.mean(), self.mean())

    def noise(self, nuisance):
        """N."""
        return self._mean_with_mirrored(self._difference) + nuisance.covariance(self._mean_with_mirrored(self._moment))


def generalised_eigenvectors(signal, noise, count):
    """The count best w (rows) and their ratios w' S w / w' N w, best first; w' N w = 1."""
    factor = np.linalg.cholesky(noise)
    inverse = np.linalg.inv(factor)
    whitened = inverse @ signal @ inverse.T
    values, vectors = np.linalg.eigh((whitened + whitened.T) / 2)
    best = np.argsort(values)[::-1][:count]
    return (inverse.T @ vectors[:, best]).T, values[best]


def with_signs(filters, signal):
    """An eigenvector has no sign: make each rise with the gray level where it is correlated with it,
    and otherwise (the derivatives) to the right and downwards."""
    size = int(round(filters.shape[1] ** 0.5))
    ramp_y, ramp_x = np.mgrid[:size, :size] - (size - 1) / 2
    tie_break = (ramp_x + 0.7 * ramp_y + 0.05 * ramp_x * ramp_y + 0.01 * ramp_x**2).ravel()
    gray = np.ones(filters.shape[1])
    variance = np.einsum("ki,ij,kj->k", filters, signal, filters)
    correlation = filters @ signal @ gray / np.sqrt(variance * (gray @ signal @ gray))
    decides = np.where(np.abs(correlation) > 0.05, correlation, filters @ tie_break)
    return filters * np.where(decides < 0, -1.0, 1.0)[:, None]
