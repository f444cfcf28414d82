# SPDX-License-Identifier: MIT
"""One run of the program, its memory sampled while it works, its numbers read afterwards."""

import csv
import dataclasses
import json
import pathlib
import subprocess
import time

SAMPLE_S = 0.05
STAGES = ("stem_ms", "features_ms", "pose_ms")


class RunError(Exception):
    """One line: the program's own message."""


@dataclasses.dataclass
class Result:
    metrics: dict  # metrics.json
    memory_mb: tuple  # largest resident set while the first half of the frames ran, and after it
    quarters_ms: list  # mean time per frame of each quarter, without reading the files

    @property
    def memory_ratio(self):
        return self.memory_mb[1] / self.memory_mb[0]


def resident_mb(pid):
    """VmRSS; 0 once the process is gone."""
    try:
        with open(f"/proc/{pid}/status", encoding="ascii") as status:
            for line in status:
                if line.startswith("VmRSS:"):
                    return int(line.split()[1]) / 1024.0
    except OSError:
        pass
    return 0.0


class RowCounter:
    """Rows of a growing frames.csv, whose rows are written as the frames come."""

    def __init__(self, file):
        self.file = file
        self.rows = -1  # the header
        self.stream = None

    def update(self):
        if self.stream is None and self.file.exists():
            self.stream = open(self.file, "rb")
        if self.stream is not None:
            self.rows += self.stream.read().count(b"\n")
        return max(self.rows, 0)

    def close(self):
        if self.stream is not None:
            self.stream.close()


def watch(process, frames_csv, num_frames):
    """Largest resident set before and after the middle frame, MB, until the process ends. What
    writing the results takes counts to the second half."""
    largest = [0.0, 0.0]
    counter = RowCounter(frames_csv)
    while process.poll() is None:
        half = 0 if 2 * counter.update() < num_frames else 1
        largest[half] = max(largest[half], resident_mb(process.pid))
        time.sleep(SAMPLE_S)
    counter.close()
    return largest


def quarters_of(frames_csv):
    with open(frames_csv, encoding="utf-8", newline="") as stream:
        times = [sum(float(row[stage]) for stage in STAGES) for row in csv.DictReader(stream)]
    ends = [len(times) * quarter // 4 for quarter in range(5)]
    return [sum(times[a:b]) / max(b - a, 1) for a, b in zip(ends, ends[1:])]


def run(program, sequence, out, num_frames, options):
    """`options` are those of `stemvo run`. Raises RunError where the program fails."""
    out = pathlib.Path(out)
    out.mkdir(parents=True, exist_ok=True)
    (out / "frames.csv").unlink(missing_ok=True)  # of an earlier run: its rows must not count
    command = [program, "run", str(sequence), "--out", str(out), "--quiet", *options]
    with open(out / "messages.txt", "w+", encoding="utf-8", errors="replace") as messages:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=messages)
        try:
            memory_mb = watch(process, out / "frames.csv", num_frames)
        finally:
            if process.poll() is None:
                process.terminate()
                process.wait()
        messages.seek(0)
        text = " ".join(messages.read().split())
    if process.returncode != 0:
        raise RunError(text or f"{program}: exit code {process.returncode}")
    if not memory_mb[0] or not memory_mb[1]:
        raise RunError(f"{out}: the run was too short to sample its memory")
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    return Result(metrics, tuple(memory_mb), quarters_of(out / "frames.csv"))


def lengths_ratio(estimate, truth):
    """Driven length of the estimate over the true one, per quarter of the frames; None where the
    car stood."""
    def positions(file):
        lines = pathlib.Path(file).read_text(encoding="ascii").split("\n")
        return [tuple(map(float, line.split()[3::4])) for line in lines if line]

    def steps(points):
        return [sum((x - y) ** 2 for x, y in zip(a, b)) ** 0.5 for a, b in zip(points, points[1:])]

    found, true = steps(positions(estimate)), steps(positions(truth))
    ends = [len(found) * quarter // 4 for quarter in range(5)]
    totals = [(sum(found[a:b]), sum(true[a:b])) for a, b in zip(ends, ends[1:])]
    return [f / t if t > 0.0 else None for f, t in totals]
