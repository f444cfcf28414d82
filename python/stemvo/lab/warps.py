# SPDX-License-Identifier: MIT
"""How far the program's own tracker lands from where a planted warp puts a point, channel by channel."""

import json
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import click
import cv2
import numpy as np

from stemvo import PatchTracker, read_recording
from . import pairs

NEAR, FAR = 2.0, 6.0  # input px that a start is off by at most, along x and y
MIN_CORRELATION = 0.7  # of a patch that the odometry takes for found
WRONG = 2.0  # input px off: found in another place
MARGIN = 24.0  # input px from the border
RESAMPLES = 200


class Landed(NamedTuple):
    """What became of the points of one image pair."""

    errors: np.ndarray  # input px, of the points found
    num_points: int
    num_wrong: int


def _inside(points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    return np.all((points > MARGIN) & (points < np.array(shape[1::-1]) - 1 - MARGIN), axis=1)


def land(options: Mapping[str, Any], pair: pairs.Pair, reach: float, rng: np.random.Generator, corners: int | None = None) -> Landed:
    """Corners (the strongest so many) of the channel of `options` in `before`, each aligned in `after` from up to `reach` px off its true place."""
    tracker = PatchTracker({"stem.tracking_resolution": "half", **options})
    before, after = tracker.see(pair.before), tracker.see(pair.after)
    points = tracker.corners(before)[:corners]
    true = points @ pair.motion[:, :2].T + pair.motion[:, 2]
    seen = _inside(points, pair.before.shape) & _inside(true, pair.before.shape)
    points, true = np.ascontiguousarray(points[seen]), true[seen]
    found = tracker.align(before, after, points, true + rng.uniform(-reach, reach, true.shape))
    errors = np.linalg.norm(found[:, :2] - true, axis=1)[found[:, 2] >= MIN_CORRELATION]
    return Landed(errors[errors < WRONG], len(points), int(np.sum(errors >= WRONG)))


def _values(landed: Sequence[Landed]) -> np.ndarray:
    errors, count = np.concatenate([one.errors for one in landed]), max(1, sum(one.num_points for one in landed))
    middle = np.percentile(errors, [50, 90]) if len(errors) else [np.nan, np.nan]
    return np.array([*middle, len(errors) / count, sum(one.num_wrong for one in landed) / count])


def resampled(landed: Sequence[Landed], seed: int = 0) -> np.ndarray:
    """RESAMPLES x 4 (median, 90 %, found, wrong), each of as many frames drawn from these."""
    rng = np.random.default_rng(seed)
    return np.array([_values([landed[i] for i in rng.integers(len(landed), size=len(landed))]) for _ in range(RESAMPLES)])


def row(landed: Sequence[Landed]) -> dict[str, tuple[float, float, float]]:
    """One channel under one disturbance: median and 90th percentile in input px, shares of the points found and wrong; each with its
    interval (5 to 95 %, bootstrap over the frames)."""
    values = np.array([_values(landed), *np.nanpercentile(resampled(landed), [5, 95], axis=0)])
    return dict(zip(("median", "percentile_90", "found", "wrong"), map(tuple, values.T.tolist()), strict=True))


def geometric_mean(by_disturbance: Mapping[str, Sequence[Landed]]) -> tuple[float, float, float]:
    """Of the medians over the disturbances, with its interval."""
    medians = np.array([_values(landed)[0] for landed in by_disturbance.values()])
    drawn = np.array([resampled(landed)[:, 0] for landed in by_disturbance.values()])
    low, high = np.percentile(np.exp(np.mean(np.log(drawn), axis=0)), [5, 95])
    return float(np.exp(np.mean(np.log(medians)))), float(low), float(high)


def measure(channels: Mapping[str, Mapping[str, Any]], frames: Sequence[np.ndarray], *, reach: float = NEAR,
            disturbances: Sequence[str] = tuple(pairs.DISTURBANCES), seed: int = 1, corners: int | None = None) -> dict[str, dict[str, list[Landed]]]:
    """channel -> disturbance -> one entry a frame. Every channel (options of the odometry) sees the same pairs and starts."""
    result = {name: {kind: [] for kind in disturbances} for name in channels}
    for number, frame in enumerate(frames):
        for kind in disturbances:
            of_pair = [seed, number, list(pairs.DISTURBANCES).index(kind)]
            pair = pairs.plant(frame, kind, np.random.default_rng(of_pair))
            for name, options in channels.items():
                result[name][kind].append(land(options, pair, reach, np.random.default_rng([*of_pair, 1]), corners))
    return result


def frames_of(recording: str, count: int) -> list[np.ndarray]:
    """`count` gray frames, evenly along the recording."""
    source = read_recording(recording)
    images = (source[int(i)][0] for i in np.linspace(0, len(source) - 1, min(count, len(source))))
    return [image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in images if image is not None]


def channel_of(text: str) -> dict[str, Any]:
    """MODEL or MODEL:FILTER."""
    model, _, number = text.partition(":")
    return {"stem.model": model, **({"stem.filter": int(number)} if number else {})}


def table(result: Mapping[str, Mapping[str, Sequence[Landed]]]) -> str:
    """As docs/evidence.md holds it: a line a disturbance, a column a channel."""
    lines = ["| | " + " | ".join(result) + " |", "|---" * (1 + len(result)) + "|"]
    for kind in next(iter(result.values())):
        rows = [row(found[kind]) for found in result.values()]
        lines.append(f"| {kind} | " + " | ".join(
            "{:.3f} ({:.3f}-{:.3f}), {:.2f}; {:.0f} %, {:.1f} %".format(*r["median"], r["percentile_90"][0], 100 * r["found"][0], 100 * r["wrong"][0])
            for r in rows) + " |")
    means = ["{:.3f} ({:.3f}-{:.3f})".format(*geometric_mean(found)) for found in result.values()]
    return "\n".join([*lines, "| geometric mean | " + " | ".join(means) + " |"])


@click.command()
@click.argument("recordings", nargs=-1, required=True)
@click.option("--channel", "channels", multiple=True, default=("default", "gray"), show_default=True, help="MODEL or MODEL:FILTER, as stem.model and stem.filter.")
@click.option("--frames", type=click.IntRange(1), default=12, show_default=True, help="Of each recording, evenly along it.")
@click.option("--corners", type=click.IntRange(1), help="Of each frame, the strongest; default: all that the odometry would take.")
@click.option("--far", is_flag=True, help=f"Starts up to {FAR:g} px off (default: {NEAR:g}).")
@click.option("--seed", default=1, show_default=True)
@click.option("--json", "out", type=click.Path(dir_okay=False), help="The rows, as a file.")
def command(recordings, channels, frames, corners, far, seed, out):
    """How far tracked points land from where they are: frames of RECORDINGS, warped and disturbed, tracked on each channel.

    For each disturbance: median error in input px (5 to 95 %, bootstrap over the frames), 90th percentile; share of the points that
    is found, and found in a wrong place (2 px off and more)."""
    images = [image for recording in recordings for image in frames_of(recording, frames)]
    result = measure({text: channel_of(text) for text in channels}, images, reach=FAR if far else NEAR, seed=seed, corners=corners)
    click.echo(table(result))
    if out:
        rows = {name: {kind: row(landed) for kind, landed in found.items()} for name, found in result.items()}
        pathlib.Path(out).write_text(json.dumps(rows, indent=1))
