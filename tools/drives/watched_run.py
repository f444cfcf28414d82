# SPDX-License-Identifier: MIT
"""One run of the program, its memory sampled while it works, its numbers read afterwards."""

import contextlib
import dataclasses
import json
import os
import pathlib
import pty
import re
import statistics
import subprocess
import time

SAMPLE_S = 0.02
PROGRESS = re.compile(r"(\d+)/\d+ frames,")


class RunError(Exception):
    """One line: the program's own message."""


@dataclasses.dataclass
class Result:
    metrics: dict  # metrics.json
    memory_mb: tuple  # largest resident set in the first half of the frames, in the second, and after the last
    memory_ratio: float  # median of the resident set in the second half over that in the second quarter: peaks come and go
    quarters_ms: list  # mean time per frame of each quarter, by the clock
    quarters_cpu_ms: list  # mean processor time per frame of each quarter, of all threads
    median_mb: tuple  # of the resident set in the second quarter, in the second half
    handles: tuple  # most open files in the first half of the frames, in the second


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


def processor_s(pid):
    """User and system time of all threads so far; 0 once the process is gone."""
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii", errors="replace") as stat:
            fields = stat.read().rpartition(")")[2].split()  # the name before it may hold blanks
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except OSError:
        return 0.0


def open_files(pid):
    """0 once the process is gone."""
    try:
        return len(os.listdir(f"/proc/{pid}/fd"))
    except OSError:
        return 0


class Messages:
    """Reads standard error of a program, which believes to be at a terminal and tells its
    progress ten times a second."""

    def __init__(self):
        self.master, self.slave = pty.openpty()
        os.set_blocking(self.master, False)
        self.text = ""

    def frames_done(self):
        """The number in the last line of progress; 0 before."""
        try:
            while said := os.read(self.master, 1 << 16):
                self.text += said.decode("utf-8", errors="replace")
        except OSError:  # nothing more for now
            pass
        done = PROGRESS.findall(self.text)
        return int(done[-1]) if done else 0

    def words(self):
        """All but the progress, in one line."""
        self.frames_done()
        return " ".join(" ".join(line for line in self.text.splitlines() if not PROGRESS.search(line)).split())

    def close(self):
        os.close(self.master)
        os.close(self.slave)


@dataclasses.dataclass
class Watched:
    """Samples of a running process."""

    memory_samples_mb: tuple = dataclasses.field(default_factory=lambda: ([], [], []))
    second_quarter_mb: list = dataclasses.field(default_factory=list)  # the program has started, the queues are full
    handles: list = dataclasses.field(default_factory=lambda: [0, 0])
    marks: list = dataclasses.field(default_factory=list)  # (frames, seconds, processor seconds) at the quarters

    def add(self, pid, done, num_frames):
        part = 2 if done >= num_frames else 1 if 2 * done >= num_frames else 0
        memory_mb = resident_mb(pid)
        self.memory_samples_mb[part].append(memory_mb)
        if part < 2:
            self.handles[part] = max(self.handles[part], open_files(pid))
        if part == 0 and 4 * done >= num_frames:
            self.second_quarter_mb.append(memory_mb)
        if len(self.marks) < 5 and (done > 0 or self.marks) and 4 * done >= len(self.marks) * num_frames:
            self.marks.append((done, time.monotonic(), processor_s(pid)))

    @property
    def memory_mb(self):
        return tuple(max(samples, default=0.0) for samples in self.memory_samples_mb)

    @property
    def median_mb(self):
        return statistics.median(self.second_quarter_mb), statistics.median(self.memory_samples_mb[1])

    @property
    def memory_ratio(self):
        return self.median_mb[1] / self.median_mb[0]

    def quarters_ms(self, clock):
        """Per frame; `clock` 1: of the wall, 2: of the processor. None where the run was too short to tell."""
        spans = [(b[0] - a[0], b[clock] - a[clock]) for a, b in zip(self.marks, self.marks[1:])]
        return [1000.0 * seconds / frames if frames > 0 and seconds > 0.0 else None for frames, seconds in spans]


def watch(process, frames_done, num_frames):
    """Memory up to the middle frame, up to the last one, and from then until the process ends
    (evaluating, drawing the map); processor time at the quarters."""
    watched = Watched()
    while process.poll() is None:
        watched.add(process.pid, frames_done(), num_frames)
        time.sleep(SAMPLE_S)
    return watched


def run(program, sequence, out, num_frames, options):
    """`options` are those of `stemvo run`. Raises RunError where the program fails."""
    out = pathlib.Path(out)
    command = [program, "run", str(sequence), "--out", str(out), *options]
    with contextlib.closing(Messages()) as messages:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=messages.slave)
        try:
            watched = watch(process, messages.frames_done, num_frames)
        finally:
            if process.poll() is None:
                process.terminate()
                process.wait()
        text = messages.words()
    if process.returncode != 0:
        raise RunError(text or f"{program}: exit code {process.returncode}")
    if not watched.second_quarter_mb or not watched.memory_mb[1]:
        raise RunError(f"{out}: the run was too short to sample its memory")
    metrics = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    return Result(metrics, watched.memory_mb, watched.memory_ratio, watched.quarters_ms(1), watched.quarters_ms(2),
                  watched.median_mb, tuple(watched.handles))


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
