# SPDX-License-Identifier: MIT
"""Linear discriminant embedding of gray patches (the linear case of Hua, Brown, Winder: Discriminant
Learning of Local Image Descriptors, ICCV 2007): filters w that maximise

    w' S w / w' N w

S: covariance of the patches (what tells one place from another);
N: covariance of the differences between two views of the same place (what does not).

Or filters for the smallest covariance of a tracked translation: tracking_filters().
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
        self._slope_moments = np.zeros((2, size * size, size * size))

    def add(self, before, after, slopes=()):
        """slopes: of the patches before, along x and y."""
        self.count += len(before)
        self._sum += before.sum(axis=0)
        self._moment += before.T @ before
        self._difference += (after - before).T @ (after - before)
        for sums, slope in zip(self._slope_moments, slopes):
            sums += slope.T @ slope

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

    def slopes(self):
        """S_x, S_y: w' S_x w is the energy of the slope along x of what w gives."""
        return [self._mean_with_mirrored(sums) for sums in self._slope_moments]


def generalised_eigenvectors(signal, noise, count):
    """The count best w (rows) and their ratios w' S w / w' N w, best first; w' N w = 1."""
    factor = np.linalg.cholesky(noise)
    inverse = np.linalg.inv(factor)
    whitened = inverse @ signal @ inverse.T
    values, vectors = np.linalg.eigh((whitened + whitened.T) / 2)
    best = np.argsort(values)[::-1][:count]
    return (inverse.T @ vectors[:, best]).T, values[best]


def tracking_filters(slopes, noise, count):
    """count filters (rows) whose place is measured best, and their ratios, best first; w' N w = 1 of each.

    A translation tracked on w has the covariance w' N w / (w' S_x w) along x, w' N w / (w' S_y w) along y, and nothing between
    them where w is even or odd in x (the scatter has its mirror image in it). The worse of the two counts, so the ratio is
    min(w' S_x w, w' S_y w) / w' N w. It is largest for the first eigenvector of a S_x + (1 - a) S_y against N with the a that
    makes this eigenvector's energies equal: there the first eigenvalue, convex in a with the slope w' (S_x - S_y) w, is least.
    """
    pairs = [_best_in(basis, slopes, noise, count) for basis in _even_and_odd(len(noise))]
    filters, ratios = (np.concatenate(parts) for parts in zip(*pairs))
    order = np.argsort(ratios)[::-1][:count]
    return filters[order], ratios[order]


def _even_and_odd(pixels):
    """Bases (rows) of the filters that are even in x, and of those that are odd."""
    index = np.arange(pixels).reshape(int(round(pixels**0.5)), -1)
    mirror = index[:, ::-1].ravel()
    left = np.eye(pixels)[index.ravel() <= mirror]
    bases = left + left[:, mirror], left - left[:, mirror]
    return [basis[basis.any(axis=1)] for basis in bases]


def _best_in(basis, slopes, noise, count):
    slope_x, slope_y, noise = (basis @ scatter @ basis.T for scatter in (*slopes, noise))
    low, high = 0.0, 1.0
    for _ in range(50):
        share = (low + high) / 2
        filters, _ = generalised_eigenvectors(share * slope_x + (1 - share) * slope_y, noise, count)
        low, high = (low, share) if filters[0] @ (slope_x - slope_y) @ filters[0] > 0 else (share, high)
    ratios = np.min([np.einsum("ki,ij,kj->k", filters, slope, filters) for slope in (slope_x, slope_y)], axis=0)
    return filters @ basis, ratios


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
