#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the program over KITTI clips, one row per configuration, and prints the README's table.

    tools/measure.py KITTI_ROOT [--sequences 00,03,06] [--efficientnet MODEL.onnx:FILTER]

KITTI_ROOT holds sequences/NN and poses/NN.txt. First table: each step is scaled to its true length
(the paper's protocol). Second: metres from the camera's height, no ground truth. No alignment in
either. Every row names the options that made it; standard library only.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
GRAY = ["--set", "stem.model=gray"]
PROTOCOLS = {"ground_truth": "per-step ground-truth scale", "camera_height": "camera height"}


def configurations(efficientnet):
    """(heading, options of `stemvo run`) of every row."""
    paper = ["--config", str(ROOT / "config/paper.yaml")]
    rows = [
        ("learned channel (the defaults)", []),
        ("learned channel, pairs of frames (`odometry.mode=two_frame`)", ["--set", "odometry.mode=two_frame"]),
        ("gray image, same back end", GRAY),
        ("learned channel, SIFT (brute force)", ["--set", "features.method=sift"]),
        ("learned channel, ORB (brute force)", ["--set", "features.method=orb"]),
        ("the paper's recipe, stand-in stem", paper),
        ("the paper's recipe on the gray image", [*paper, *GRAY, "--set", "stem.filter=-1", "--set", "stem.sampling_px=0"]),
    ]
    if efficientnet:
        model, _, channel = efficientnet.rpartition(":")
        options = ["--set", f"stem.model={model}", "--set", f"stem.filter={channel}"]
        rows.insert(3, (f"EfficientNetV2-B0, filter {channel}", options))
    return rows


def run(program, sequence, protocol, options):
    """The metrics of one run; stops with the program's own message where it fails."""
    with tempfile.TemporaryDirectory() as out:
        command = [program, "run", str(sequence), "--out", out, "--quiet", *options, "--set", f"scale.source={protocol}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.exit(done.stderr.strip() or f"{program}: exit code {done.returncode}")
        return json.loads((pathlib.Path(out) / "metrics.json").read_text(encoding="utf-8"))


def cell(metrics):
    def number(key, digits):
        value = metrics[key]
        return "-" if value is None else f"{value:.{digits}f}"

    return f"{number('t_rel_percent', 2)} / {number('r_rel_deg_per_100m', 2)} / {number('average_offset_m', 2)}"


def print_table(arguments, protocol, title):
    sequences = arguments.sequences.split(",")
    print(f"| {title} | " + " | ".join(sequences) + " | frames/s |")
    print("|---|" + "---|" * (len(sequences) + 1))
    null = {}
    for heading, options in configurations(arguments.efficientnet):
        results = []
        for name in sequences:
            folder = arguments.kitti_root / "sequences" / name
            results.append(run(arguments.program, folder, protocol, options))
            null[name] = results[-1]["null_offset_m"]
        speed = sum(m["frames"] for m in results) / sum(m["frames"] / m["fps"] for m in results)
        print(f"| {heading} | " + " | ".join(cell(m) for m in results) + f" | {speed:.0f} |", flush=True)
    print("| zero motion | " + " | ".join(f"- / - / {null[name]:.2f}" for name in sequences) + " | |\n", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kitti_root", type=pathlib.Path)
    parser.add_argument("--sequences", default="03,00,06")
    parser.add_argument("--program", default=str(ROOT / "build/release/stemvo"))
    parser.add_argument("--efficientnet", default="", help="MODEL.onnx:FILTER, made by tools/export_stem.py")
    arguments = parser.parse_args()

    for protocol, heading in PROTOCOLS.items():
        print_table(arguments, protocol, heading)


if __name__ == "__main__":
    main()
