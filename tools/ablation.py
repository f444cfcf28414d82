#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the defaults, and the defaults with one part replaced: the table says how much each part buys.

    tools/ablation.py KITTI_ROOT --out docs/lab/ablation.md [--sequences 03,00,06] [--seeds 1,2,3]

KITTI_ROOT holds sequences/NN and poses/NN.txt. A cell has t_rel and r_rel with per-step ground-truth scale
(each step takes its true length, so that direction and rotation are judged), and t_rel with metres
from the camera's height (no ground truth). Nothing is aligned. "Together" pools the segments of all
sequences. With more than one seed of the random numbers the means are shown. A row is a heading and the
options that make it (ROWS); standard library only.
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
T_REL, R_REL = "t_rel_percent", "r_rel_deg_per_100m"
COLUMNS = {"ground_truth": (T_REL, R_REL), "camera_height": (T_REL,)}  # scale.source -> errors in a cell


@dataclasses.dataclass(frozen=True)
class Row:
    heading: str
    settings: tuple = ()  # of --set
    config: str = "default"  # of --config
    scales: tuple = tuple(COLUMNS)  # the road plays no part with per-step ground-truth scale


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
    Row("map without refinement", ("ba.every_n_keyframes=0",)),
    Row("the paper's recipe, stand-in stem", config=PAPER),
    Row("the paper's recipe on the gray image", ("stem.model=gray", "stem.filter=-1", "stem.sampling_px=0"), PAPER),
    Row("road: dense alignment only", ("scale.estimators=dense",), scales=ROAD),
    Row("road: tracked points only", ("scale.estimators=points",), scales=ROAD),
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


def averaged(runs):
    """One sequence's numbers, the mean over the seeds."""
    return {key: mean(run[key] for run in runs) for key in (T_REL, R_REL)} | {"segments": runs[0]["segments"]}


def pooled(sequences, key):
    """The mean over the segments of all sequences."""
    with_segments = [s for s in sequences if s["segments"]]
    if not with_segments or any(s[key] is None for s in with_segments):
        return None
    return sum(s[key] * s["segments"] for s in with_segments) / sum(s["segments"] for s in with_segments)


def number(value):
    return "-" if value is None else f"{value:.2f}"


def cells(sequences, scale):
    """The errors of one scale, per sequence and together."""
    keys = COLUMNS[scale]
    return [[number(of[key]) for key in keys] for of in sequences] + [[number(pooled(sequences, key)) for key in keys]]


def line(words):
    return "| " + " | ".join(words) + " |"


def start_row(pool, arguments, row):
    """The runs of a row: by scale, sequence and seed; they wait in the pool."""
    def run(scale, name, seed):
        settings = (*arguments.set, *row.settings, f"scale.source={scale}", f"seed={seed}")
        return pool.submit(metrics_of_run, arguments.program, arguments.kitti_root / "sequences" / name, row.config, settings)

    return {scale: [[run(scale, name, seed) for seed in arguments.seeds] for name in arguments.sequences]
            for scale in row.scales}


def finish_row(row, runs, num_sequences):
    """The cells of a row, and what kept it from being measured."""
    try:
        found = {scale: cells([averaged([run.result() for run in seeds]) for seeds in of_scale], scale)
                 for scale, of_scale in runs.items()}
    except RunError as error:
        return ["-"] * (num_sequences + 1), f"Not possible: {row.heading}: {error}"
    nothing = {scale: ["-"] * len(keys) for scale, keys in COLUMNS.items()}
    return [" / ".join(word for scale in COLUMNS for word in (found[scale][i] if scale in found else nothing[scale]))
            for i in range(num_sequences + 1)], None


def label(row):
    config = () if row.config == "default" else (f"--config {pathlib.Path(row.config).name}",)
    return " ".join([row.heading, *(f"`{setting}`" for setting in (*config, *row.settings))])


def table(arguments):
    names = arguments.sequences
    lines = [line(["", *names, "together"]), "|" + "---|" * (len(names) + 2)]
    problems = []
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for row, runs in [(row, start_row(pool, arguments, row)) for row in ROWS]:
            found, problem = finish_row(row, runs, len(names))
            print(f"{row.heading}: {found[-1]}", file=sys.stderr, flush=True)
            lines.append(line([label(row), *found]))
            problems += [problem] if problem else []
    return lines + ["", *problems] if problems else lines


def report(arguments):
    done = subprocess.run([arguments.program, "--version"], capture_output=True, text=True, check=True)
    seeds = "" if arguments.seeds == ["1"] else f" --seeds {','.join(arguments.seeds)}"
    base = "".join(f" --set {setting}" for setting in arguments.set)
    command = f"tools/ablation.py KITTI --sequences {','.join(arguments.sequences)}{seeds}{base} --out FILE"
    head = ("The defaults, and the defaults with one part replaced: t_rel % / r_rel degrees per 100 m with per-step "
            "ground-truth scale / t_rel % without ground truth, no alignment. What it says: [accuracy](accuracy_notes.md#parts-replaced).")
    return "\n".join(["# Ablation", "", head, "", "```", command, "```", "", f"{done.stdout.strip()}:", "", *table(arguments), ""])


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
    arguments.out.write_text(report(arguments), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
