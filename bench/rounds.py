# SPDX-License-Identifier: MIT
"""Runs the rows in rounds and measures every process."""

import dataclasses
import os
import pathlib
import shlex
import subprocess
import sys
import time

import places
from places import BenchError
from sequence import frame_files, truth_file


@dataclasses.dataclass(frozen=True)
class Sample:
    """One run of one row."""
    wall_s: float
    cpu_s: float
    peak_mib: float


def run_measured(command, cores, log):
    """A whole process on these cores; its output goes to the file `log`."""
    with open(log, "wb") as output:
        start = time.monotonic()
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                                   preexec_fn=lambda: os.sched_setaffinity(0, cores))
        _, status, usage = os.wait4(process.pid, 0)
        wall_s = time.monotonic() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        said = pathlib.Path(log).read_text(encoding="utf-8", errors="replace").strip()
        raise BenchError(f"{shlex.join(map(str, command))}: exit code {process.returncode}: {said}")
    return Sample(wall_s, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def order(rows, number):
    """The rows of round `number` (from 0): every round begins with the next row, so that no row is always first."""
    begin = number % len(rows)
    return [*rows[begin:], *rows[:begin]]


class Contest:
    """The rows on one sequence."""

    def __init__(self, options, rows, sequence, scratch):
        self.options, self.rows, self.sequence, self.scratch = options, rows, sequence, scratch
        self.truth = truth_file(sequence)
        self.cores = sorted(os.sched_getaffinity(0))[:options.cores]
        self.samples = {row.name: [] for row in rows}
        self.frames = {}

    def out(self, row):
        """The row writes it: a folder of stemvo, a file of the peer."""
        return self.scratch / (row.name.replace(" ", "_") + (".txt" if row.is_peer else ""))

    def trajectory(self, row):
        return self.out(row) if row.is_peer else self.out(row) / "trajectory_kitti.txt"

    def command(self, row):
        frames = ["--frames", self.options.frames] if self.options.frames else []
        if row.is_peer:
            truth = ["--gt", self.truth] if self.truth.exists() else []
            return [places.PEER_PYTHON, places.PEER, self.sequence, "--out", self.out(row), *truth, *frames]
        settings = [word for setting in row.settings for word in ("--set", setting.format(stems=places.WORK / "stems"))]
        program = row.program or self.options.program
        return [program, "run", self.sequence, "--out", self.out(row), "--quiet", *frames, *settings]

    def warm_up(self):
        """Brings frames and programs into memory, so that the first run does not pay for the disk."""
        for file in frame_files(self.sequence, self.options.frames):
            file.read_bytes()
        for row in self.rows:
            command = [places.PEER_PYTHON, places.PEER, "--help"] if row.is_peer else [row.program or self.options.program, "--version"]
            subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)

    def run(self):
        self.warm_up()
        for number in range(self.options.rounds):
            for row in order(self.rows, number):
                sample = run_measured(self.command(row), self.cores, self.scratch / "log.txt")
                self.samples[row.name].append(sample)
                self.frames[row.name] = len(self.trajectory(row).read_text(encoding="utf-8").splitlines())
                print(f"round {number + 1}: {row.name}: {sample.wall_s:.2f} s", file=sys.stderr)
        if len(set(self.frames.values())) != 1:
            raise BenchError(f"expected as many poses of every row, found {self.frames}")
