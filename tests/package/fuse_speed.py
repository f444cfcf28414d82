# SPDX-License-Identifier: MIT
"""examples/fuse_speed.cpp on a rendered drive: fuse_speed.py PROGRAM DRIVE. A wheel that is right puts the path right, and says how
sure it is."""

import pathlib
import subprocess
import sys

import numpy as np

program, drive = sys.argv[1], pathlib.Path(sys.argv[2])
sequence = drive / "sequences/00"
truth = np.loadtxt(drive / "poses/00.txt").reshape(-1, 3, 4)[:, :, 3]
times = np.loadtxt(sequence / "times.txt")
speeds = np.append(0.0, np.linalg.norm(np.diff(truth, axis=0), axis=1) / np.diff(times))
images = sorted(sequence.glob("image_2/*.png"))
lines = [f"{time} {speed} {image}\n" for time, speed, image in zip(times, speeds, images, strict=True)]
camera = "1241 376 718.86 718.86 607.19 185.22".split()
done = subprocess.run([program, *camera], input="".join(lines), capture_output=True, text=True, check=True)
found = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
positions, sigmas = found[:, 1:4], found[:, 4:]
length = speeds @ np.append(0.0, np.diff(times))
error = np.linalg.norm(positions[-1] - truth[-1])
assert np.allclose(found[:, 0], times), found[:, 0]
assert not sigmas[0].any() and (np.diff(sigmas[:, 2]) > 0).all(), sigmas  # it grows along the road
assert error < 0.02 * length, (error, length)
assert 0.003 * length < sigmas[-1, 2] < 0.02 * length, (sigmas[-1], length)
