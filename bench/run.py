#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the whole program and what it is compared with, in turn (A B C A B C ..), and prints medians and ratios.

    bench/run.py [SEQUENCE] [--frames A:B] [--rounds N] [--json FILE] [--add NAME=PROGRAM] [--only NAME,..] [--without NAME,..]

SEQUENCE is a KITTI folder; without one a drive is rendered. Every row is a whole process, from its start to its end, on the
same cores (--cores, 2). A ratio is taken within a round, where the machine was the same for both. The rows (ROWS):

    defaults      stemvo run
    full stem     the same with all 256 filters of a ConvNeXt-XLarge-shaped stem (random weights) for filter 10
    folded stem   the same filter folded into a network of its own
    gray          gray image instead of a stem
    opencv orb    bench/peers/orb_brute_force.py: ORB, brute force, essential matrix in Python (`tools/setup.sh peers`)

--add runs another build of the program with the defaults, e.g. one from before a change. Standard library only.
"""

import argparse
import dataclasses
import hashlib
import json
import os
import pathlib
import platform
import shlex
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "build/release/stemvo"
PEER = ROOT / "bench/peers/orb_brute_force.py"
PEER_PYTHON = ROOT / "build/venv-peers/bin/python"
WORK = ROOT / "build/bench-run"
RENDERED_FRAMES = 200


class BenchError(Exception):
    """Ends the benchmark with its message."""


@dataclasses.dataclass(frozen=True)
class Row:
    name: str
    settings: tuple = ()  # of --set; {stems} stands for the folder of random stems
    program: pathlib.Path | None = None  # another build
    is_peer: bool = False


ROWS = (
    Row("defaults"),
    Row("full stem", ("stem.model={stems}/full.onnx", "stem.filter=10")),
    Row("folded stem", ("stem.model={stems}/folded.onnx",)),
    Row("gray", ("stem.model=gray",)),
    Row("opencv orb", is_peer=True),
)


@dataclasses.dataclass(frozen=True)
class Sample:
    """One run of one row."""
    wall_s: float
    cpu_s: float
    peak_mib: float


@dataclasses.dataclass(frozen=True)
class Spread:
    median: float
    low: float
    high: float


def spread(values):
    """Median, least and greatest."""
    return Spread(statistics.median(values), min(values), max(values))


def ratios(times, reference):
    """Of a row's times over the reference's of the same round."""
    if len(times) != len(reference):
        raise ValueError(f"expected as many times as references, found {len(times)} and {len(reference)}")
    return [mine / other for mine, other in zip(times, reference)]


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


def output(command):
    """What a command prints; None where it does not run."""
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def rendered_drive(program):
    """A sequence of RENDERED_FRAMES frames, rendered once per build of the program."""
    made_by = f"{hashlib.sha256(program.read_bytes()).hexdigest()} {RENDERED_FRAMES}"
    drive, stamp = WORK / "drive", WORK / "drive.stamp"
    if not stamp.exists() or stamp.read_text(encoding="utf-8") != made_by:
        print(f"rendering a drive of {RENDERED_FRAMES} frames to {drive}", file=sys.stderr)
        subprocess.run(["rm", "-rf", drive], check=True)
        subprocess.run([program, "synth", drive, "--frames", str(RENDERED_FRAMES)], check=True, stderr=subprocess.DEVNULL)
        stamp.write_text(made_by, encoding="utf-8")
    return drive / "sequences/00"


def chosen_rows(options):
    """The rows asked for, the defaults first; a row that cannot run here is an error."""
    rows = [*ROWS[:1], *(Row(name, program=pathlib.Path(path)) for name, path in options.add), *ROWS[1:]]
    known = [row.name for row in rows]
    for name in [*options.only, *options.without]:
        if name not in known:
            raise BenchError(f"expected a row of {', '.join(known)}, found {name!r}")
    rows = [row for row in rows if (row.name in options.only or not options.only) and row.name not in options.without]
    if not rows:
        raise BenchError("no row is left")
    for row in rows:
        needed = row.program or (PEER_PYTHON if row.is_peer else options.program)
        if not os.access(needed, os.X_OK):
            hint = f"run `tools/setup.sh peers`, or give --without {row.name!r}" if row.is_peer else "run `make build`"
            raise BenchError(f"{needed}: expected a program for the row {row.name!r}, found none ({hint})")
    return rows


class Contest:
    """The rows on one sequence."""

    def __init__(self, options, rows, sequence, scratch):
        self.options, self.rows, self.sequence, self.scratch = options, rows, sequence, scratch
        self.truth = sequence.resolve().parents[1] / "poses" / f"{sequence.resolve().name}.txt"
        self.cores = sorted(os.sched_getaffinity(0))[:options.cores]
        self.samples = {row.name: [] for row in rows}
        self.frames = {}

    def command(self, row):
        """What runs, and where its trajectory is."""
        out = self.scratch / row.name.replace(" ", "_")
        frames = ["--frames", self.options.frames] if self.options.frames else []
        if row.is_peer:
            truth = ["--gt", self.truth] if self.truth.exists() else []
            return [PEER_PYTHON, PEER, self.sequence, "--out", f"{out}.txt", *truth, *frames], pathlib.Path(f"{out}.txt")
        settings = [word for setting in row.settings for word in ("--set", setting.format(stems=WORK / "stems"))]
        program = row.program or self.options.program
        return [program, "run", self.sequence, "--out", out, "--quiet", *frames, *settings], out / "trajectory_kitti.txt"

    def run(self):
        for number in range(self.options.rounds):
            for row in self.rows:
                command, trajectory = self.command(row)
                sample = run_measured(command, self.cores, self.scratch / "log.txt")
                self.samples[row.name].append(sample)
                self.frames[row.name] = len(trajectory.read_text(encoding="utf-8").splitlines())
                print(f"round {number + 1}: {row.name}: {sample.wall_s:.2f} s", file=sys.stderr)
        if len(set(self.frames.values())) != 1:
            raise BenchError(f"expected as many poses of every row, found {self.frames}")

    def error_percent(self, row):
        """t_rel by `stemvo evaluate`, nothing aligned; None without ground truth, or where no segment fits."""
        if not self.truth.exists():
            return None
        begin = int((self.options.frames or "").partition(":")[0] or 0)
        lines = self.truth.read_text(encoding="utf-8").splitlines()[begin:begin + self.frames[row.name]]
        truth, numbers = self.scratch / "truth.txt", self.scratch / "numbers.json"
        truth.write_text("\n".join(lines) + "\n", encoding="utf-8")
        subprocess.run([self.options.program, "evaluate", "--gt", truth, self.command(row)[1], "--json", numbers], check=True,
                       stdout=subprocess.DEVNULL)
        return json.loads(numbers.read_text(encoding="utf-8"))["estimates"][0]["t_rel_percent"]

    def results(self):
        reference = [sample.wall_s for sample in self.samples[self.rows[0].name]]
        return [self.result(row, reference) for row in self.rows]

    def result(self, row, reference):
        frames, samples = self.frames[row.name], self.samples[row.name]
        walls = [sample.wall_s for sample in samples]
        return {
            "name": row.name,
            "command": shlex.join(map(str, self.command(row)[0])),
            "fps": dataclasses.asdict(spread([frames / wall for wall in walls])),
            "time_over_first": dataclasses.asdict(spread(ratios(walls, reference))),
            "cpu_ms_per_frame": dataclasses.asdict(spread([1e3 * sample.cpu_s / frames for sample in samples])),
            "peak_mib": max(sample.peak_mib for sample in samples),
            "t_rel_percent": self.error_percent(row),
            "wall_s": walls,
        }


def machine(options, rows, sequence, cores):
    cpu = [line.partition(":")[2].strip() for line in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
           if line.startswith("model name")]
    facts = {
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "machine": f"{cpu[0] if cpu else platform.machine()}, cores {','.join(map(str, cores))} of {os.cpu_count()}, {platform.platform()}",
        "load_before": os.getloadavg()[0],
        "commit": output(["git", "describe", "--always", "--dirty"]),
        "stemvo": output([options.program, "--version"]),
        "sequence": f"{sequence}{' ' + options.frames if options.frames else ''}",
        "rounds": options.rounds,
    }
    if any(row.is_peer for row in rows):
        facts["opencv_python"] = output([PEER_PYTHON, "-c", "import cv2; print(cv2.__version__)"])
    return facts


def table(results):
    first = results[0]["name"]
    lines = [["", "frames/s", "range", f"time, {first} = 1", "range", "CPU ms/frame", "peak MiB", "t_rel %"]]
    for result in results:
        fps, ratio, error = result["fps"], result["time_over_first"], result["t_rel_percent"]
        lines.append([result["name"], f"{fps['median']:.1f}", f"{fps['low']:.1f}-{fps['high']:.1f}", f"{ratio['median']:.2f}",
                      f"{ratio['low']:.2f}-{ratio['high']:.2f}", f"{result['cpu_ms_per_frame']['median']:.1f}", f"{result['peak_mib']:.0f}",
                      "-" if error is None else f"{error:.2f}"])
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    return "\n".join("  ".join([line[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(line[1:], widths[1:]))])
                     for line in lines)


def parse_arguments(arguments):
    def addition(text):
        name, equals, path = text.partition("=")
        if not (name and equals and path):
            raise argparse.ArgumentTypeError(f"expected NAME=PROGRAM, found {text!r}")
        return name, path

    def names(text):
        return [name for name in text.split(",") if name]

    def positive(text):
        if int(text) < 1:
            raise argparse.ArgumentTypeError(f"expected 1 or more, found {text}")
        return int(text)

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", nargs="?", type=pathlib.Path, help="KITTI folder; default: a rendered drive")
    parser.add_argument("--frames", metavar="A:B", help="frames A to B-1 only")
    parser.add_argument("--rounds", type=positive, default=5)
    parser.add_argument("--cores", type=positive, default=2, help="default: 2")
    parser.add_argument("--program", type=pathlib.Path, default=PROGRAM)
    parser.add_argument("--add", metavar="NAME=PROGRAM", type=addition, action="append", default=[])
    parser.add_argument("--only", metavar="NAME,..", type=names, default=[])
    parser.add_argument("--without", metavar="NAME,..", type=names, default=[])
    parser.add_argument("--json", metavar="FILE", type=pathlib.Path)
    return parser.parse_args(arguments)


def bench(options):
    rows = chosen_rows(options)
    WORK.mkdir(parents=True, exist_ok=True)
    if any("{stems}" in setting for row in rows for setting in row.settings):
        subprocess.run([sys.executable, ROOT / "bench/random_stems.py", WORK / "stems"], check=True)
    sequence = options.sequence or rendered_drive(options.program)
    with tempfile.TemporaryDirectory(dir=WORK) as scratch:
        contest = Contest(options, rows, sequence, pathlib.Path(scratch))
        facts = machine(options, rows, sequence, contest.cores)
        contest.run()
        results = contest.results()
    print("\n".join(f"{key}: {value}" for key, value in facts.items()))
    print(f"\n{table(results)}")
    print("\nmedian and range of the rounds; whole processes; t_rel: stemvo with metres from the road, opencv orb with true steps")
    if options.json:
        options.json.write_text(json.dumps(facts | {"rows": results}, indent=2) + "\n", encoding="utf-8")


def main(arguments=None):
    try:
        bench(parse_arguments(arguments))
    except BenchError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except subprocess.CalledProcessError as error:
        print(f"error: {shlex.join(map(str, error.cmd))}: exit code {error.returncode}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
