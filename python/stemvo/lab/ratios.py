# SPDX-License-Identifier: MIT
"""How many times as large the errors of one method are as those of another, on the same segments of drives."""

import statistics
import typing

import numpy as np

SAMPLES = 2000
LEAST_FREEDOM = 4.0  # blocks less roads; below it the interval is everything
NORMAL = statistics.NormalDist()
LEAST_ERROR = 1e-9  # below it a ratio is one of roundings


class Ratio(typing.NamedTuple):
    ratio: float
    low: float  # 95 % interval
    high: float

    @property
    def is_decided(self):
        return self.high < 1.0 or self.low > 1.0

    def is_above(self, count):
        """Above 1 at 95 % for so many ratios together (Bonferroni): the best of many on a short path is luck, too."""
        wider = NORMAL.inv_cdf(1.0 - 0.025 / count) / NORMAL.inv_cdf(0.975)
        return self.low > 0.0 and self.ratio * (self.low / self.ratio) ** wider > 1.0


class Drive(typing.NamedTuple):
    a: np.ndarray  # errors of one method, > 0, in the order of the segments
    b: np.ndarray  # of the other, as many
    block: int  # neighbours that overlap
    road: str = ""  # drives of one road show the same frames, disturbed; empty: a road of its own


def log_ratio(a, b):
    return np.log(np.maximum(a, LEAST_ERROR) / np.maximum(b, LEAST_ERROR))


def paired_ratio(drives, seed=1):
    """Ratio of the mean errors, geometric mean over drives, with the interval of a circular moving-block bootstrap (Kuensch
    1989; Politis and Romano 1992). Drives on one road share their blocks and count as one. Drives of fewer than two blocks
    are left out."""
    roads = {}
    for number, drive in enumerate(drives):
        if len(drive.a) >= 2 * max(drive.block, 1):
            roads.setdefault(drive.road or number, []).append(drive)
    if not roads:
        return Ratio(1.0, 0.0, np.inf)
    count = sum(map(len, roads.values()))
    ratio = np.exp(sum(log_ratio(np.sum(one.a), np.sum(one.b)) for road in roads.values() for one in road) / count)
    blocks = sum(max(len(one.a) / one.block for one in road) for road in roads.values())
    freedom = blocks - len(roads)
    if freedom < LEAST_FREEDOM:
        return Ratio(float(ratio), 0.0, np.inf)
    random, sums = np.random.default_rng(seed), np.zeros(SAMPLES)
    for road in roads.values():
        starts = random.random((SAMPLES, max(-(-len(one.a) // one.block) for one in road)))
        sums += sum(log_ratio(_drawn(one.a, one.block, starts), _drawn(one.b, one.block, starts)) for one in road)
    # Blocks as long as the overlap hold two thirds of the variance of a running mean's sum; a sample of n blocks has (n - 1) / n of
    # it; few of them need Student's quantile, here to 5 % of it.
    widen = np.sqrt(1.5 * blocks / freedom) * (1.0 + 1.5 / freedom)
    low, high = np.quantile(np.exp(sums / count), [0.025, 0.975])
    return Ratio(float(ratio), float(ratio * (low / ratio) ** widen), float(ratio * (high / ratio) ** widen))


def _drawn(errors, block, starts):
    """Sums over blocks that begin at these shares of the drive."""
    block = max(block, 1)
    sums = np.concatenate([[0.0], np.cumsum(np.concatenate([errors, errors]))])
    first = (starts[:, : -(-len(errors) // block)] * len(errors)).astype(int)
    return (sums[first + block] - sums[first]).sum(axis=1)
