# SPDX-License-Identifier: MIT
"""Filters of a layer on a drive: one pass of the network over an image for all of them, and an odometry for each."""

import collections
import dataclasses
import functools
import hashlib
import pathlib

import numpy as np

import stemvo
from stemvo.lab.runs import image_sizes

MIN_SIDE_PX = 16  # of a channel: room for the windows of a tracker and for motion
MIN_TRACKED = 0.5  # share of the motions that are measured; less: the pose was not detected
MOST_AT_ONCE = 128  # channels: a filter sees some frames before the next one does, so that its tracks stay in the processor's cache
MOST_KEPT = 96  # odometries of a process, some 2 MB each


@dataclasses.dataclass(frozen=True)
class Drive:
    """`name` is its key in tables; a kind of disturbance at its middle strength, or none."""

    path: str
    frames: str | None = None
    kind: str | None = None
    held_out: bool = False
    camera: str = "auto"

    @property
    def road(self):
        return pathlib.Path(self.path).resolve().name

    @property
    def name(self):
        return self.road + (f"_{self.kind}" if self.kind else "")

    def open(self):
        recording = stemvo.read_recording(self.path, frames=self.frames, input_camera=self.camera)
        if recording.ground_truth is None or len(recording.ground_truth) != len(recording):
            raise ValueError(f"{self.path}: expected a true pose for each frame, found {0 if recording.ground_truth is None else len(recording.ground_truth)} of {len(recording)}")
        if len(recording) < 2:
            raise ValueError(f"{self.path}: expected 2 frames or more (--frames), found {len(recording)}")
        if not self.kind:
            return recording
        from stemvo.lab.disturbances import Disturbed, find

        return Disturbed(recording, find(self.kind), 1)

    def hash(self):
        """Of times, truth, camera and images by name and size: what a row depends on."""
        recording = self.open()
        parts = [recording.timestamps.tobytes(), recording.ground_truth.tobytes(), repr(recording.camera).encode(), (self.kind or "").encode(), image_sizes(pathlib.Path(self.path)),
                 *(image.tobytes() for image in (recording[0][0], recording[len(recording) - 1][0]) if image is not None)]
        return hashlib.sha256(b"".join(parts)).hexdigest()[:16]


@dataclasses.dataclass(frozen=True)
class Block:
    """Filters of a model on a drive, and the keys and values of their odometry."""

    model: str
    filters: tuple
    drive: Drive
    options: tuple  # of (key, value)

    def settings(self):
        return stemvo.Options(dict(self.options) | {"stem.model": self.model, "stem.filter": -1})


class _Filter:
    """One filter's odometry, and what is counted after the first frame."""

    def __init__(self, recording, settings):
        self.odometry = stemvo.ChannelOdometry(recording.camera, settings)
        self.frames, self.measured, self.inliers, self.matches = 0, 0, 0, 0

    def process(self, channel, image, time):
        result = self.odometry.process(channel, image, time)
        if self.frames > 0:
            self.measured += result.is_measured
            self.inliers += result.num_inliers
            self.matches += result.num_matches
        self.frames += 1

    def row(self, truth):
        steps = max(self.frames - 1, 1)
        tracked = self.measured / steps
        row = dict.fromkeys(ERRORS) | {"inliers": self.inliers / steps, "tracked": tracked, "detected": tracked >= MIN_TRACKED, "reason": ""}
        if not row["detected"]:
            row["reason"] = f"motion measured in {self.measured} of {steps} frames" if self.matches else "no matches: a channel without contrast"
        if self.measured:  # else the numbers would be those of standing still
            row |= errors_of(self.odometry.trajectory, truth[: self.frames])
        return row


ERRORS = ("t_rel_percent", "r_rel_deg_per_100m", "average_offset_m", "E_t_m", "E_r_deg", "block", "dense_t_percent")


def mean_motion(poses):
    """E_t in m and E_r in degrees: between consecutive poses. They take no ground truth: a camera that stands scores 0."""
    lengths = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    chords = np.linalg.norm(np.diff(poses[:, :3, :3], axis=0), axis=(1, 2)) / np.sqrt(8.0)  # |R - S| = sqrt(8) sin(angle / 2)
    return float(lengths.mean()), float(np.degrees(2.0 * np.arcsin(np.minimum(chords, 1.0))).mean())


def errors_of(trajectory, truth):
    """E_t_m and E_r_deg are the paper's Table 2: the car's motion, not errors."""
    scaled = stemvo.rescale_steps(trajectory, truth)
    metrics, dense = stemvo.evaluate(scaled, truth), stemvo.dense_errors(scaled, truth)
    return {name: metrics[name] for name in ERRORS[:3]} | dict(zip(("E_t_m", "E_r_deg"), mean_motion(scaled))) | {
        "block": dense["block"], "dense_t_percent": " ".join(f"{error:.4f}" for error in dense["t_percent"])}


@functools.lru_cache(2)
def _stem(model, options):
    return stemvo.Stem(stemvo.Options(dict(options) | {"stem.model": model, "stem.filter": -1}))


class _Run:
    def __init__(self, block):
        self.recording, self.stem, self.at = block.drive.open(), _stem(block.model, block.options), 0
        self.truth = self.recording.ground_truth
        self.filters = {k: _Filter(self.recording, block.settings()) for k in block.filters}

    def problem(self):
        """Why the layer's filters cannot be run on these frames; empty: they can."""
        image = next((image for image, _ in self.recording if image is not None), None)
        if image is None:
            return "no image can be read"
        try:
            height, width = self.stem.apply(image, self.recording.camera, 0, 1)[0].values.shape
        except ValueError as error:
            return str(error)
        return f"channel {width}x{height}" if min(height, width) < MIN_SIDE_PX else ""

    def go_on(self, filters, end):
        self.filters = {k: self.filters[k] for k in filters}
        first, at_once = min(filters), min(8, max(1, MOST_AT_ONCE // len(filters)))
        for at in range(self.at, end, at_once):
            frames = [self.recording[i] for i in range(at, min(at + at_once, end))]
            seen = [(image, time, None if image is None else self.stem.apply(image, self.recording.camera, first, max(filters) + 1)) for image, time in frames]
            for k, one in self.filters.items():
                for image, time, channels in seen:
                    one.process(channels[k - first] if channels else None, image, time)
        self.at = max(self.at, end)
        return {k: one.row(self.truth) for k, one in self.filters.items()}


_RUNS = collections.OrderedDict()  # of this process: a block and drive that goes on need not begin again


def score(task):
    """(block, filters of it, end) -> {filter: row} over the drive's frames up to `end`. The same rows whatever ran before."""
    block, filters, end = task
    run = _RUNS.pop(block, None)
    if run is None or run.at > end or not set(filters) <= set(run.filters):
        run = _Run(block)
        if problem := run.problem():
            empty = dict.fromkeys(ERRORS) | {"inliers": None, "tracked": None, "detected": False, "reason": problem}
            return {k: empty for k in filters}
    rows = run.go_on(filters, end)
    if end < len(run.recording):
        _RUNS[block] = run
    while sum(len(one.filters) for one in _RUNS.values()) > MOST_KEPT:
        _RUNS.popitem(last=False)
    return rows
