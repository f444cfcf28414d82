#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What each part of the program buys: the defaults, and the defaults with one part replaced.

    tools/ablation.py KITTI_ROOT --out docs/accuracy.md [--sequences 03,00,06] [--seeds 1,2,3]

KITTI_ROOT holds sequences/NN and poses/NN.txt. Two tables: with per-step ground-truth scale (each step takes its true
length, so that direction and rotation are judged) and with metres from the camera's height (no ground
truth). Nothing is aligned. "Together" pools the segments of all sequences. With more than one seed of
the random numbers the means are shown. Where FILE has the lines `<!-- ablation -->` and
`<!-- end of ablation -->`, what is between them is replaced; else FILE is written whole. A row is a
heading and the options that make it (ROWS); standard library only.
"""

import argparse
import concurrent.futures
import dataclasses
import json
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
BEGIN, END = "<!-- ablation -->", "<!-- end of ablation -->"
PROTOCOLS = {
    "ground_truth": "Per-step ground-truth scale (`scale.source=ground_truth`)",
    "camera_height": "Metres from the camera's height (`scale.source=camera_height`), no ground truth",
}


@dataclasses.dataclass(frozen=True)
class Row:
    heading: str
    settings: tuple = ()  # of --set
    config: str = "default"  # of --config
    protocols: tuple = tuple(PROTOCOLS)  # the road plays no part with per-step ground-truth scale


ROAD = ("camera_height",)
PAPER = str(ROOT / "config/paper.yaml")
ROWS = (
    Row("the defaults"),
    Row("gray image instead of the learned channel", ("stem.model=gray",)),
    Row("Laplacian of Gaussian", ("stem.model=log",)),
    Row("local contrast", ("stem.model=census",)),
    Row("Lucas-Kanade instead of patches", ("features.method=klt",)),
    Row("the camera as given", ("camera.refine=off",)),
    Row("SIFT and brute force instead of patches", ("features.method=sift",)),
    Row("ORB and brute force instead of patches", ("features.method=orb",)),
    Row("pairs of frames chained instead of the map", ("odometry.mode=two_frame",)),
    Row("pairs of frames, ORB and brute force", ("odometry.mode=two_frame", "features.method=orb")),
    Row("map without refinement", ("refine.every=0",)),
    Row("the paper's recipe, stand-in stem", config=PAPER),
    Row("the paper's recipe on the gray image", ("stem.model=gray", "stem.filter=-1", "stem.sampling_px=0"), PAPER),
    Row("road: dense alignment only", ("scale.estimators=dense",), protocols=ROAD),
    Row("road: tracked points only", ("scale.estimators=points",), protocols=ROAD),
    Row("road: no temporal filter", ("scale.temporal_filter=false",), protocols=ROAD),
)


class RunError(Exception):
    """The program's own message."""


def metrics_of_run(program, sequence, config, settings):
    with tempfile.TemporaryDirectory() as out:
        command = [program, "run", str(sequence), "--out", out, "--quiet", "--config", config]
        command += [word for setting in settings for word in ("--set", setting)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RunError(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else
                           f"{program}: exit code {done.returncode}")
        return json.loads((pathlib.Path(out) / "metrics.json").read_text(encoding="utf-8"))


def mean(values):
    """None where any of them is missing."""
    values = list(values)
    return None if not values or any(value is None for value in values) else sum(values) / len(values)


KEYS = ("t_rel_percent", "r_rel_deg_per_100m", "average_offset_m")


def averaged(runs):
    """One sequence's numbers, the mean over the seeds."""
    return {key: mean(run[key] for run in runs) for key in KEYS} | {"segments": runs[0]["segments"]}


def pooled(sequences, key):
    """The mean over the segments of all sequences."""
    with_segments = [s for s in sequences if s["segments"]]
    if not with_segments or any(s[key] is None for s in with_segments):
        return None
    return sum(s[key] * s["segments"] for s in with_segments) / sum(s["segments"] for s in with_segments)


def number(value):
    return "-" if value is None else f"{value:.2f}"


def cells(sequences):
    rows = [" / ".join(number(s[key]) for key in KEYS) for s in sequences]
    return rows + [" / ".join(number(pooled(sequences, key)) for key in KEYS[:2])]


def line(words):
    return "| " + " | ".join(words) + " |"


def start_row(pool, arguments, row, protocol):
    """The runs of a row, per sequence and seed; they wait in the pool."""
    def settings(seed):
        return (*arguments.set, *row.settings, f"scale.source={protocol}", f"seed={seed}")

    return [[pool.submit(metrics_of_run, arguments.program, arguments.kitti_root / "sequences" / name, row.config, settings(seed))
             for seed in arguments.seeds] for name in arguments.sequences]


def finish_row(row, runs):
    """The cells of a row, and what kept it from being measured."""
    try:
        return cells([averaged([run.result() for run in seeds]) for seeds in runs]), None
    except RunError as error:
        return ["-"] * (len(runs) + 1), f"{row.heading}: {error}"


def table(arguments, protocol, started):
    """`started`: the rows of this protocol with their runs."""
    lines = [f"{PROTOCOLS[protocol]}:", "", line(["", *arguments.sequences, "together"]),
             "|" + "---|" * (len(arguments.sequences) + 2)]
    problems = []
    for row, runs in started:
        found, problem = finish_row(row, runs)
        print(f"{protocol}, {row.heading}: {found[-1]}", file=sys.stderr, flush=True)
        config = () if row.config == "default" else (f"--config {pathlib.Path(row.config).name}",)
        settings = " ".join(f"`{setting}`" for setting in (*config, *row.settings))
        lines.append(line([f"{row.heading} {settings}".strip(), *found]))
        if problem:
            problems.append(f"Not possible: {problem}")
    return lines + (["", *problems] if problems else []) + [""]


def report(arguments):
    done = subprocess.run([arguments.program, "--version"], capture_output=True, text=True, check=True)
    version = done.stdout.strip()
    seeds = "" if arguments.seeds == ["1"] else f" --seeds {','.join(arguments.seeds)}"
    lines = [f"t_rel % / r_rel degrees per 100 m / average offset m, no alignment; {version}.", ""]
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        started = {protocol: [(row, start_row(pool, arguments, row, protocol)) for row in ROWS
                              if protocol in row.protocols] for protocol in PROTOCOLS}
        for protocol in PROTOCOLS:
            lines += table(arguments, protocol, started[protocol])
    base = "".join(f" --set {setting}" for setting in arguments.set)
    command = f"tools/ablation.py KITTI --sequences {','.join(arguments.sequences)}{seeds}{base} --out FILE"
    return "\n".join(lines + ["```", command, "```"])


def write(file, text):
    """Between the marks of an existing file, or the whole file."""
    old = file.read_text(encoding="utf-8") if file.exists() else ""
    before, begin, rest = old.partition(BEGIN)
    _, end, after = rest.partition(END)
    file.write_text(f"{before}{begin}\n{text}\n{end}{after}" if begin and end else text + "\n", encoding="utf-8")


def parse_arguments(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kitti_root", metavar="KITTI_ROOT", type=pathlib.Path)
    parser.add_argument("--out", metavar="FILE", type=pathlib.Path, required=True)
    parser.add_argument("--sequences", default="03,00,06", type=lambda text: text.split(","))
    parser.add_argument("--seeds", default="1", type=lambda text: text.split(","))
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of every row")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="runs at a time; speed is not measured")
    parser.add_argument("--program", default=str(ROOT / "build/release/stemvo"))
    parsed = parser.parse_args(arguments)
    for name in parsed.sequences:
        if not (parsed.kitti_root / "sequences" / name).is_dir():
            parser.error(f"{parsed.kitti_root / 'sequences' / name}: expected a sequence folder, found none")
    return parsed


def main():
    arguments = parse_arguments(sys.argv[1:])
    write(arguments.out, report(arguments))
    return 0


if __name__ == "__main__":
    sys.exit(main())
