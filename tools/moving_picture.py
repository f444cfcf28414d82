#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Makes the README's moving picture of a run: frame with tracks, its channel, the path growing.

    stemvo synth drive --frames 150 --width 930 --height 282
    stemvo run drive/sequences/00 --out result --pictures 8
    tools/moving_picture.py result drive/poses/00.txt docs/images/demo.gif
"""

import _environment  # noqa: F401  starts this tool again in build/venv

import argparse
import pathlib

import matplotlib
import numpy as np
import PIL.Image

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

WIDTH, PATH_WIDTH, COLOURS, MS_PER_IMAGE = 380, 180, 64, 250


def positions(file):
    return np.loadtxt(file).reshape(-1, 3, 4)[:, :, 3]


def draw_path(estimate, truth, frame, size):
    """From above, up to the frame."""
    figure, axes = plt.subplots(figsize=(size[0] / 100, size[1] / 100), dpi=100, layout="constrained")
    axes.plot(truth[:, 0], truth[:, 2], color="#bbbbbb", linewidth=4)
    axes.plot(estimate[:frame + 1, 0], estimate[:frame + 1, 2], color="#0072b2", linewidth=2)
    axes.plot(estimate[frame, 0], estimate[frame, 2], "o", color="#d55e00")
    axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(labelsize=7)
    axes.set_title(f"path, m ({frame + 1} frames)", fontsize=8)
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[:, :, :3].copy()
    plt.close(figure)
    return PIL.Image.fromarray(pixels)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("result", type=pathlib.Path, help="of `stemvo run --pictures N`")
    parser.add_argument("truth", type=pathlib.Path, help="poses in KITTI's format")
    parser.add_argument("gif", type=pathlib.Path)
    options = parser.parse_args()
    estimate, truth = positions(options.result / "trajectory_kitti.txt"), positions(options.truth)
    images = []
    for file in sorted((options.result / "pictures").glob("*.png")):
        left = PIL.Image.open(file).convert("RGB")
        left = left.resize((WIDTH, round(left.height * WIDTH / left.width)), PIL.Image.Resampling.LANCZOS)
        both = PIL.Image.new("RGB", (WIDTH + PATH_WIDTH, left.height), "white")
        both.paste(left, (0, 0))
        both.paste(draw_path(estimate, truth, int(file.stem), (PATH_WIDTH, left.height)), (WIDTH, 0))
        images.append(both.quantize(COLOURS, PIL.Image.Quantize.MAXCOVERAGE, kmeans=1, dither=PIL.Image.Dither.NONE))
    images[0].save(options.gif, save_all=True, append_images=images[1:], duration=MS_PER_IMAGE, loop=0, optimize=True)
    print(f"{options.gif}: {len(images)} images, {options.gif.stat().st_size} bytes")


if __name__ == "__main__":
    main()
