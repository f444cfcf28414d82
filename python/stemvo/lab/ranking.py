# SPDX-License-Identifier: MIT
"""Filters by their errors: the best, those that cannot be told from it, the others."""

import typing

import numpy as np

from stemvo.lab.bootstrap import Drive, Ratio, paired_ratio

NUMBERS = ("t_rel_percent", "r_rel_deg_per_100m", "average_offset_m", "E_t_m", "E_r_deg", "inliers", "tracked")
LEAST_PERCENT = 1e-6


def number(text):
    return float(text) if text else None


class Score(typing.NamedTuple):
    """One filter on one drive."""

    road: str
    detected: bool
    errors: np.ndarray  # over segments of an eighth of the path
    block: int
    numbers: tuple  # of NUMBERS

    @classmethod
    def of(cls, road, row):
        return cls(road, str(row["detected"]) == "True", np.array(row["dense_t_percent"].split(), float), int(row["block"] or 1), tuple(number(row[name]) for name in NUMBERS))

    @property
    def error(self):
        return self.errors.mean() if len(self.errors) else np.inf if self.numbers[0] is None else self.numbers[0]


class Standing(typing.NamedTuple):
    status: str  # ranked, not detected
    ratio: Ratio | None = None  # of its errors over those of the best

    @property
    def is_equal(self):
        return not self.ratio.low > 1.0


def compare(scores):
    """candidate -> Score per drive; to candidate -> Standing. The best has the lowest geometric mean over drives."""
    ranked = {one: found for one, found in scores.items() if all(score.detected for score in found)}
    best = min(ranked.values(), key=lambda found: sum(np.log(max(score.error, LEAST_PERCENT)) for score in found), default=None)
    told = {one: Standing("not detected") for one in scores}
    for one, found in ranked.items():
        pairs = [Drive(mine.errors, its.errors, mine.block, mine.road) for mine, its in zip(found, best) if len(mine.errors) == len(its.errors)]
        told[one] = Standing("ranked", paired_ratio(pairs))
    return told


def mean(scores):
    columns = list(zip(*(score.numbers for score in scores)))
    return {name: None if None in column else float(np.mean(column)) for name, column in zip(NUMBERS, columns)}


def order(row):
    """Equals by their ratio, the others by t_rel, those that were stopped (late ones first), those not detected."""
    group = {"ranked": 0 if row.get("equal") else 1, "stopped": 2, "not detected": 3}[row["status"]]
    by = row.get("over_best") if group == 0 else row["t_rel_percent"]
    return group, -row["frames"] if group == 2 else 0, np.inf if by is None else by, row["model"], row["filter"]


def draw(stem, table, most=40):
    """Errors over those of the best, with intervals: what leaves out 1 is worse."""
    rows = [row for row in table if row["status"] == "ranked" and np.isfinite(row["over_best_high"])][:most]
    if not rows:
        return
    from stemvo.lab import figures

    figure, (axis,) = figures.sheet(1, height_in=0.8 + 0.2 * len(rows))
    for at, row in enumerate(rows):
        color = "C7" if row["baseline"] else "C0" if row["equal"] else "C1"
        axis.plot([row["over_best_low"], row["over_best_high"]], [at, at], color=color)
        axis.plot(row["over_best"], at, "o", color=color, markersize=4)
    axis.axvline(1.0, color="black", linewidth=0.8)
    if (largest := max(row["over_best_high"] for row in rows)) > 5.0:  # else one bad baseline presses the others together
        axis.set_xscale("log", subs=[])
        axis.set_xticks(*2 * [[tick for tick in (1, 2, 5, 10, 20, 50, 100) if tick < 1.3 * largest]])
    axis.set_yticks(range(len(rows)), [f"{row['model']} {row['layer']} {row['filter']}" for row in rows], fontsize=7)
    axis.invert_yaxis()
    axis.set_xlabel("error over the best filter's, 95 % interval (blue: not told from it; gray: baseline)")
    figures.save(figure, stem)
