#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Whole rendered drives with the principal point of the calibration planted off: what it costs, and whether it is found.

    tools/planted_camera.py CACHE --poses POSES_DIR [--sequences 05] [--plant DX,DY] [--from-frame N]

Renders as tools/long_drives.py does (CACHE and POSES_DIR are the same), runs the program with the true calibration and
with one whose principal point is DX, DY pixels off, with either scale, and prints a table: t_rel in percent and r_rel
in degrees per 100 m of the whole drive and from frame N on, no alignment; and how far the camera of frames.csv is from
the true one in the runs with the camera's height, at the end and at most (x and y; from frame N on). docs/lab/accuracy_notes.md shows the table.
"""

import csv
import json
import pathlib
import subprocess
import sys
import tempfile

from drives import rendered
from long_drives import parser_of_drives, row

HEADINGS = ("drive", "calibration", "camera height", "the same, from N on", "true steps", "the same, from N on",
            "px off at the end", "at most, from N on")


def planted(calibration, off_px):
    """The text of a calibration with all principal points moved."""
    lines = []
    for line in calibration.splitlines():
        name, *numbers = line.split()
        for at, off in ((2, off_px[0]), (6, off_px[1])):
            numbers[at] = repr(float(numbers[at]) + off)
        lines.append(" ".join([name, *numbers]))
    return "\n".join(lines) + "\n"


def principal_point(calibration):
    """The program reads that of P2."""
    numbers = next(line for line in calibration.splitlines() if line.startswith("P2:")).split()
    return float(numbers[3]), float(numbers[7])


def called(command):
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode != 0:
        raise rendered.DriveError(done.stderr.strip())
    return done.stdout


def errors(program, truth, estimate, first):
    """t_rel / r_rel of the frames from `first` on."""
    tails = []
    for file in (truth, estimate):
        tails.append(estimate.with_name(f"{file.stem}_from_{first}.txt"))
        tails[-1].write_text("".join(file.read_text(encoding="ascii").splitlines(keepends=True)[first:]), encoding="ascii")
    found = json.loads(called([program, "evaluate", "--gt", str(tails[0]), str(tails[1]), "--json"]))["estimates"][0]
    return f"{found['t_rel_percent']:.3f} / {found['r_rel_deg_per_100m']:.3f}"


def pixels_off(frames_csv, true, first):
    """At the end; at most from `first` on."""
    with open(frames_csv, encoding="ascii", newline="") as file:
        off = [tuple(abs(float(frame[key]) - value) for key, value in zip(("cx_px", "cy_px"), true))
               for frame in csv.DictReader(file)]
    return off[-1], tuple(map(max, zip(*off[first:])))


def measure(arguments, drive, off_px, scratch):
    """The row of one drive with one calibration."""
    folder = rendered.render(arguments.program, arguments.cache, drive, arguments.render_threads)
    calibration = (folder / "sequences/00/calib.txt").read_text(encoding="ascii")
    file = scratch / "calib.txt"
    file.write_text(planted(calibration, off_px), encoding="ascii")
    cells = []
    for source in ("camera_height", "ground_truth"):
        out = scratch / source
        called([arguments.program, "run", str(folder / "sequences/00"), "--calib", str(file), "--out", str(out),
                "--set", f"scale.source={source}"])
        cells += [errors(arguments.program, folder / "poses/00.txt", out / "trajectory_kitti.txt", first)
                  for first in (0, arguments.from_frame)]
    end, most = pixels_off(scratch / "camera_height/frames.csv", principal_point(calibration), arguments.from_frame)
    name = "{:g}, {:g} px off".format(*off_px) if any(off_px) else "true"
    return (drive.name, name, *cells, *("{:.2f}, {:.2f}".format(*off) for off in (end, most)))


def parse_pixels(text):
    x, _, y = text.partition(",")
    return float(x), float(y)


def parse_arguments():
    parser = parser_of_drives(__doc__, "05", "1241x376")
    parser.add_argument("--plant", type=parse_pixels, default=(3.0, 2.0), metavar="DX,DY", help="default: 3,2")
    parser.add_argument("--from-frame", type=int, default=500, metavar="N", help="default: 500")
    return parser.parse_args()


def main():
    arguments = parse_arguments()
    print(row(HEADINGS) + "\n" + row(["---"] * len(HEADINGS)), flush=True)
    try:
        for name in arguments.sequences.split(","):
            drive = rendered.Drive(arguments.poses / f"{name}.txt", *arguments.size, arguments.frames)
            for off_px in ((0.0, 0.0), arguments.plant):
                with tempfile.TemporaryDirectory() as scratch:
                    print(row(measure(arguments, drive, off_px, pathlib.Path(scratch))), flush=True)
    except rendered.DriveError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
