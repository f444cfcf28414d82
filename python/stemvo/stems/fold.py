# SPDX-License-Identifier: MIT
"""One filter of a stem with a layer norm, without computing all of its filters.

With the mean over the channels taken off the filters (stem.fold_layer_norm_mean), filter k of C is

    y_k = gamma_k z_k / sqrt(sum_c z_c^2 / C + epsilon) + beta_k,     z = W p + b = V q,   q = (p, 1),

p the patch (48 numbers for 4x4x3). The sum is a quadratic form q' G q with G = V' V (49x49), so rows R with
R' R = G say as much as all C filters. G is singular for C - 1 < 49: the rows come from its eigenvectors.

One row can be the filter's own: with a^2 = 1 / (v' G^+ v), the most that G - a^2 v v' stays positive (v = V's
row k), its rank falls by one, and the rows are a v and those of the rest: 49 in all.
"""

import dataclasses

import numpy as np

from . import stem as stem_module

# A smaller share of the largest eigenvalue is rounding.
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


def _rows_of(form):
    """Rows R with R' R = form."""
    values, vectors = np.linalg.eigh((form + form.T) / 2)
    order = np.argsort(values)[::-1]
    kept = order[values[order] > _RANK * values[order[0]]]
    return np.sqrt(values[kept])[:, None] * vectors[:, kept].T


def layer_norm_filter(stem, index):
    """Filter `index` of an unpadded stem with a layer norm."""
    if any(stem.padding):
        raise ValueError("a padded stem's patches hold zeros that are no gray level")
    centred = stem_module.fold_mean(stem_module.fold_layer_norm_mean(stem))
    count = centred.filters
    v = np.column_stack([centred.weights.reshape(count, -1), centred.bias])
    gram = v.T @ v
    own = v[index]
    scale = 1.0 / np.sqrt(own @ np.linalg.pinv(gram, rcond=_RANK, hermitian=True) @ own)
    rows = np.vstack([scale * own, _rows_of(gram - scale**2 * np.outer(own, own))])
    norm = stem.layer_norm
    return FoldedStem(rows[:, :-1].reshape(-1, *centred.weights.shape[1:]), rows[:, -1], stem.stride,
                      gain=float(norm.gamma[index] * np.sqrt(count) / scale), shift=float(norm.beta[index]),
                      floor=float(count * norm.epsilon))
