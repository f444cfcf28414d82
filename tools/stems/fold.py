# SPDX-License-Identifier: MIT
"""One filter of a stem with a layer norm, without computing all of its filters.

With the mean over the channels taken off the filters (stem.fold_layer_norm_mean), filter k of C is

    y_k = gamma_k z_k / sqrt(sum_c z_c^2 / C + epsilon) + beta_k,     z = W p + b = V q,   q = (p, 1),

p the patch (48 numbers for 4x4x3). The sum is a quadratic form q' G q with G = V' V (49x49), so rows R with
R' R = G say as much as all C filters. G is singular for C - 1 < 49: the rows come from its eigenvectors.

One row can be the filter's own: with a^2 = 1 / (v' G^+ v), the most that G - a^2 v v' stays positive (v = V's
row k), its rank falls by one, and the rows are a v and those of the rest: 49 in all.

Truncated: fewer rows of the rest. Which ones, the patches must say: with S = E[q q'] = L L' over real frames, the
rest's part is u' M u with white u = L^-1 q and M = L' (G - a^2 v v') L; the largest eigenvalues of M are kept, and
what the others give on average goes to epsilon.
"""

import dataclasses

import numpy as np

from stems import stem as stem_module

# Of the largest eigenvalue: below it, rounding.
_RANK = 1e-13


@dataclasses.dataclass(frozen=True)
class FoldedStem:
    """y = gain * z_0 / sqrt(sum_r z_r^2 + floor) + shift, z = weights (*) image + bias."""

    weights: np.ndarray  # R x 3 x kh x kw; row 0 is the filter's own
    bias: np.ndarray  # R
    stride: int
    gain: float
    shift: float
    floor: float
    filters: int = 1
    padding: tuple = (0, 0, 0, 0)

    @property
    def kernel(self):
        return tuple(int(size) for size in self.weights.shape[2:])


def one_filter(stem, index):
    """Filter `index` of a stem without a layer norm."""
    return dataclasses.replace(stem, weights=stem.weights[index:index + 1], bias=stem.bias[index:index + 1])


def second_moment(kernel, stride, pictures):
    """E[q q'] over the patches that a stem sees: pictures are 3 x H x W."""
    size = 3 * kernel[0] * kernel[1] + 1
    moment, count = np.zeros((size, size)), 0
    for picture in pictures:
        views = np.lib.stride_tricks.sliding_window_view(picture, kernel, axis=(1, 2))[:, ::stride, ::stride]
        patches = views.transpose(1, 2, 0, 3, 4).reshape(-1, size - 1).astype(np.float64)
        q = np.column_stack([patches, np.ones(len(patches))])
        moment += q.T @ q
        count += len(q)
    return moment / count


def _eigen_rows(form, metric_factor=None, rows=None):
    """Rows R with R' R = form. With a metric's factor L and a number of rows, the best so many in the metric; and
    the mean of what is left out."""
    whitened = form if metric_factor is None else metric_factor.T @ form @ metric_factor
    values, vectors = np.linalg.eigh((whitened + whitened.T) / 2)
    order = np.argsort(values)[::-1]
    values, vectors = np.maximum(values[order], 0.0), vectors[:, order]
    kept = int(np.sum(values > _RANK * values[0])) if rows is None else min(rows, len(values))
    found = np.sqrt(values[:kept])[:, None] * vectors[:, :kept].T
    if metric_factor is not None:
        found = np.linalg.solve(metric_factor.T, found.T).T  # u = L^-1 q
    return found, float(values[kept:].sum())


def layer_norm_filter(stem, index, rows=None, moment=None):
    """Filter `index` of an unpadded stem with a layer norm. rows None: exact; else so many rows in all, chosen by
    `moment` (second_moment)."""
    if any(stem.padding):
        raise ValueError("a padded stem's patches hold zeros that are no gray level")
    centred = stem_module.fold_mean(stem_module.fold_layer_norm_mean(stem))
    count = centred.filters
    v = np.column_stack([centred.weights.reshape(count, -1), centred.bias])
    gram = v.T @ v
    own = v[index]
    scale = 1.0 / np.sqrt(own @ np.linalg.pinv(gram, rcond=_RANK, hermitian=True) @ own)
    rest = gram - scale**2 * np.outer(own, own)
    if rows is None:
        others, dropped = _eigen_rows(rest)
    else:
        factor = np.linalg.cholesky(moment + 1e-9 * np.trace(moment) / len(moment) * np.eye(len(moment)))
        others, dropped = _eigen_rows(rest, factor, max(rows - 1, 0))
    all_rows = np.vstack([scale * own, others])
    norm = stem.layer_norm
    return FoldedStem(all_rows[:, :-1].reshape(-1, *centred.weights.shape[1:]), all_rows[:, -1], stem.stride,
                      gain=float(norm.gamma[index] * np.sqrt(count) / scale), shift=float(norm.beta[index]),
                      floor=float(count * norm.epsilon + dropped))
