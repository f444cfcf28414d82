# SPDX-License-Identifier: MIT
"""Differences of two methods on the same segments, with intervals."""

import numpy as np

SAMPLES = 2000
LEAST_FREEDOM = 4.0  # blocks less drives; below it nothing is told


def difference(drives, seed=1):
    """Mean over drives of mean(a) - mean(b), and its 95 % interval. drives: (a, b, block) each; a, b: errors on the same
    segments, in order; block: how many neighbours overlap. A circular moving-block bootstrap (Kuensch 1989; Politis and Romano
    1992), widened for overlapping segments and few blocks as the library's paired_ratio is. Too few blocks: (.., -inf, inf)."""
    drives = [(np.asarray(a) - np.asarray(b), max(int(block), 1)) for a, b, block in drives]
    drives = [(errors, block) for errors, block in drives if len(errors) >= 2 * block]
    if not drives:
        return np.nan, -np.inf, np.inf
    middle = np.mean([errors.mean() for errors, _ in drives])
    blocks = sum(len(errors) / block for errors, block in drives)
    freedom = blocks - len(drives)
    if freedom < LEAST_FREEDOM:
        return middle, -np.inf, np.inf
    random, means = np.random.default_rng(seed), np.zeros(SAMPLES)
    for errors, block in drives:
        sums = np.concatenate([[0.0], np.cumsum(np.concatenate([errors, errors]))])
        draws = -(-len(errors) // block)
        starts = random.integers(len(errors), size=(SAMPLES, draws))
        means += (sums[starts + block] - sums[starts]).sum(axis=1) / (draws * block) / len(drives)
    widen = np.sqrt(1.5 * blocks / freedom) * (1.0 + 1.5 / freedom)
    low, high = np.quantile(means, [0.025, 0.975])
    return middle, middle + widen * (low - middle), middle + widen * (high - middle)


def is_told(low, high):
    return low > 0.0 or high < 0.0


def best_of(errors):
    """The name whose errors are smaller than each other's, told apart from all; None: of none. errors: name -> drives, each
    (values, block) on the same segments for all names, None where there are none."""
    names = [name for name, drives in errors.items() if any(drive is not None for drive in drives)]
    for name in names:
        others = [other for other in names if other != name]
        if others and all(difference([(*pair, mine[1]) for pair, mine in _paired(errors[name], errors[other])])[2] < 0.0
                          for other in others):
            return name
    return None


def _paired(mine, theirs):
    return [((a[0], b[0]), a) for a, b in zip(mine, theirs) if a is not None and b is not None]
