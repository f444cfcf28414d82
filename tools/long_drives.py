#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Renders drives along whole KITTI paths, runs the program on them, prints what must stay flat.

    tools/long_drives.py CACHE --poses POSES_DIR [--sequences 00,05] [--set KEY=VALUE ...]

POSES_DIR holds NN.txt, KITTI's official poses (without the option: $STEMVO_SHARED_DATA/full_poses).
CACHE keeps the rendered frames (some 0.2 MB each at 620x188), so that the next run starts at once.
The defaults of the program are run, with what --set changes. Errors are those of `stemvo run`, no
alignment. Memory is the largest resident set in the first half of the frames / in the second / after
the last (writing the results); the ratio is that of the halves. Time is per frame in each quarter of
the drive, by the clock; processor time is that of all threads, which other programs on
the machine do not stretch; length is the estimated length of each quarter over the true one.
docs/accuracy.md shows a table.
"""

import argparse
import os
import pathlib
import sys
import tempfile

from drives import rendered, watched_run

ROOT = pathlib.Path(__file__).resolve().parent.parent
HEADINGS = ("drive", "frames", "t_rel %", "r_rel deg/100 m", "offset m", "measured %", "memory MB", "ratio",
            "ms per frame by quarter", "processor ms by quarter", "length by quarter", "frames/s")


def number(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def numbers(values, digits):
    return " ".join(number(value, digits) for value in values)


def row_of(name, result, ratios):
    m = result.metrics
    memory = " / ".join(number(value, 0) for value in result.memory_mb)
    return (name, str(m["frames"]), number(m["t_rel_percent"], 2), number(m["r_rel_deg_per_100m"], 3),
            number(m["average_offset_m"], 2), number(100.0 * m["tracked_fraction"], 1), memory,
            f"{result.memory_ratio:.2f}", numbers(result.quarters_ms, 1), numbers(result.quarters_cpu_ms, 1),
            numbers(ratios, 3), f"{m['fps']:.1f}")


def row(cells):
    return "| " + " | ".join(cells) + " |"


def measure(arguments, drive, out):
    """The row of one drive."""
    folder = rendered.render(arguments.program, arguments.cache, drive, arguments.render_threads)
    options = [word for assignment in arguments.set for word in ("--set", assignment)]
    result = watched_run.run(arguments.program, folder / "sequences/00", out, drive.num_frames(), options)
    ratios = watched_run.lengths_ratio(out / "trajectory_kitti.txt", folder / "poses/00.txt")
    return row_of(drive.name, result, ratios)


def parse_size(text):
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT, found {text!r}")
    return int(width), int(height)


def parser_of_drives(description, sequences, size):
    """With the options that say which drives are rendered."""
    shared = os.environ.get("STEMVO_SHARED_DATA")
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cache", metavar="CACHE", type=pathlib.Path, help="created where missing")
    parser.add_argument("--poses", metavar="DIR", type=pathlib.Path, required=shared is None,
                        default=pathlib.Path(shared or "") / "full_poses")
    parser.add_argument("--sequences", default=sequences)
    parser.add_argument("--size", type=parse_size, default=parse_size(size), metavar="WxH", help=f"default: {size}")
    parser.add_argument("--frames", type=int, default=0, metavar="N", help="of each drive; default: all")
    parser.add_argument("--render-threads", type=int, default=1, metavar="N", help="0: all cores; default: 1")
    parser.add_argument("--program", default=str(ROOT / "build/release/stemvo"))
    return parser


def parse_arguments(arguments):
    parser = parser_of_drives(__doc__, "00,05", "620x188")
    parser.add_argument("--seed", type=int, default=1, help="of the street")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as in `stemvo run`")
    parser.add_argument("--out", type=pathlib.Path, help="keeps the results of the runs, a folder per drive")
    parser.add_argument("--render-only", action="store_true")
    return parser.parse_args(arguments)


def main():
    arguments = parse_arguments(sys.argv[1:])
    failed = False
    if not arguments.render_only:
        print(row(HEADINGS) + "\n" + row(["---"] * len(HEADINGS)), flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        for name in arguments.sequences.split(","):
            drive = rendered.Drive(arguments.poses / f"{name}.txt", *arguments.size, arguments.frames, arguments.seed)
            try:
                if arguments.render_only:
                    print(rendered.render(arguments.program, arguments.cache, drive, arguments.render_threads))
                else:
                    print(row(measure(arguments, drive, (arguments.out or pathlib.Path(scratch)) / name)), flush=True)
            except (rendered.DriveError, watched_run.RunError) as error:
                failed = True
                print(f"{name}: {error}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
