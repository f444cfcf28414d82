# SPDX-License-Identifier: MIT
"""Errors of two methods on the same segments of drives: difference and ratio of their means, with 95 % intervals."""

import statistics
import typing

import numpy as np

SAMPLES = 2000
LEAST_FREEDOM = 4.0  # blocks less roads; below it the interval is everything
LEAST_ERROR = 1e-9  # below it a ratio is one of roundings
NORMAL = statistics.NormalDist()


class Drive(typing.NamedTuple):
    a: np.ndarray  # errors of one method, in the order of the segments
    b: np.ndarray  # of the other, as many
    block: int  # neighbours that overlap
    road: str = ""  # drives of one road show the same frames, disturbed; empty: a road of its own


class Difference(typing.NamedTuple):
    middle: float
    low: float  # 95 % interval
    high: float

    @property
    def is_told(self):
        return self.low > 0.0 or self.high < 0.0


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


def difference(drives, seed=1):
    """Difference of the mean errors a and b, in the mean over drives."""
    return Difference(*_interval(drives, lambda a, b, count: (a - b) / count, seed) or (np.nan, -np.inf, np.inf))


def paired_ratio(drives, seed=1):
    """Ratio of the mean errors a and b, which are above 0; geometric mean over drives."""
    found = _interval(drives, lambda a, b, _: np.log(np.maximum(a, LEAST_ERROR) / np.maximum(b, LEAST_ERROR)), seed) or (0.0, -np.inf, np.inf)
    return Ratio(*(float(np.exp(value)) for value in found))


def _interval(drives, measure, seed):
    """Mean over drives of measure(sum of a, sum of b, their number) with the interval of a circular moving-block bootstrap (Kuensch
    1989; Politis and Romano 1992). Drives on one road share their blocks and count as one. Drives of fewer than two blocks are left
    out; None: all are."""
    roads = {}
    for number, drive in enumerate(drives):
        if len(drive.a) >= 2 * max(drive.block, 1):
            roads.setdefault(drive.road or number, []).append(drive)
    if not roads:
        return None
    count = sum(map(len, roads.values()))
    middle = sum(measure(np.sum(one.a), np.sum(one.b), len(one.a)) for road in roads.values() for one in road) / count
    blocks = sum(max(len(one.a) / max(one.block, 1) for one in road) for road in roads.values())
    freedom = blocks - len(roads)
    if freedom < LEAST_FREEDOM:
        return middle, -np.inf, np.inf
    random, means = np.random.default_rng(seed), np.zeros(SAMPLES)
    for road in roads.values():
        starts = random.random((SAMPLES, max(-(-len(one.a) // max(one.block, 1)) for one in road)))
        means += sum(measure(*_drawn(one, starts)) for one in road) / count
    # Blocks as long as the overlap hold two thirds of the variance of a running mean's sum; a sample of n blocks has (n - 1) / n of
    # it; few of them need Student's quantile, here to 5 % of it.
    widen = np.sqrt(1.5 * blocks / freedom) * (1.0 + 1.5 / freedom)
    low, high = np.quantile(means, [0.025, 0.975])
    return middle, middle + widen * (low - middle), middle + widen * (high - middle)


def _drawn(drive, starts):
    """Sums of a and b over blocks that begin at these shares of the drive, and how many errors they are."""
    count, block = len(drive.a), max(drive.block, 1)
    first = (starts[:, : -(-count // block)] * count).astype(int)
    sums = [np.concatenate([[0.0], np.cumsum(np.concatenate([errors, errors]))]) for errors in (drive.a, drive.b)]
    return *((one[first + block] - one[first]).sum(axis=1) for one in sums), first.shape[1] * block


def best_of(errors):
    """The name whose errors are smaller than each other's, told apart from all; None: of none. errors: name -> drives, each
    (values, block) on the same segments for all names, None where there are none."""
    names = [name for name, drives in errors.items() if any(drive is not None for drive in drives)]
    for name in names:
        pairs = [[Drive(mine[0], its[0], mine[1]) for mine, its in zip(errors[name], errors[other]) if mine is not None and its is not None]
                 for other in names if other != name]
        if pairs and all(difference(pair).high < 0.0 for pair in pairs):
            return name
    return None
