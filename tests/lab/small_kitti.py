# SPDX-License-Identifier: MIT
"""A KITTI folder of a wall of noise that comes nearer."""

import cv2
import numpy as np

STEP_M, DISTANCE_M, WIDTH, HEIGHT = 0.5, 12.0, 160, 80


def write_sequence(root, name, frames=8, camera="image_0"):
    folder = root / "sequences" / name
    (folder / camera).mkdir(parents=True)
    (root / "poses").mkdir(exist_ok=True)
    (folder / "calib.txt").write_text("".join(f"P{i}: 100 0 79.5 0 0 100 39.5 0 0 0 1 0\n" for i in (0, 2)))
    (folder / "times.txt").write_text("".join(f"{0.1 * i}\n" for i in range(frames)))
    (root / "poses" / f"{name}.txt").write_text("".join(f"1 0 0 0 0 1 0 0 0 0 1 {STEP_M * i}\n" for i in range(frames)))
    shape = (HEIGHT, WIDTH) if camera == "image_0" else (HEIGHT, WIDTH, 3)
    wall = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 256, shape, np.uint8), (0, 0), 1.5)
    for i in range(frames):
        scale = DISTANCE_M / (DISTANCE_M - STEP_M * i)
        view = np.array([[scale, 0, 79.5 * (1 - scale)], [0, scale, 39.5 * (1 - scale)]])
        cv2.imwrite(str(folder / camera / f"{i:06}.png"), cv2.warpAffine(wall, view, (WIDTH, HEIGHT)))
    return folder
