# SPDX-License-Identifier: MIT
"""Planted warps: two images of one frame that differ by a known similarity and a disturbance."""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from stemvo.lab.disturbances import levels

Disturbance = Callable[[np.ndarray, np.ndarray, np.random.Generator], tuple[np.ndarray, np.ndarray]]
SENSOR_NOISE = 1.5  # gray levels, of every image but those that are made of noise or compressed


class Pair(NamedTuple):
    before: np.ndarray  # HxW uint8
    after: np.ndarray  # HxW uint8
    motion: np.ndarray  # 2x3: pixels of `after` from pixels of `before`


def noise(before, after, rng):
    level = rng.uniform(6, 20)
    return tuple(image + rng.normal(0, level, image.shape) for image in (before, after))


def dusk(before, after, rng):
    """2 electrons a gray level, 2 to 15 % of the light, electrons counted, the contrast half restored."""
    light = np.exp(rng.uniform(np.log(0.02), np.log(0.15)))
    return tuple((rng.poisson(np.clip(2 * light * image, 0, None)) / 2 + rng.normal(0, 1, image.shape)) / np.sqrt(light)
                 for image in (before, after))


def low_contrast(before, after, rng):
    share = rng.uniform(0.1, 0.5)
    return tuple(127 + share * (image - 127) for image in (before, after))


def fog(before, after, rng):
    """Denser towards the upper border, of another density in each image."""
    height = np.linspace(0, 1, len(before))[:, None]
    seen = [np.exp(-rng.uniform(1, 4) * (1 - height)) for _ in range(2)]
    return tuple(image * share + 200 * (1 - share) for image, share in zip((before, after), seen, strict=True))


def shadow(before, after, rng):
    """Stripes of shadow, elsewhere in each image."""
    rows, columns = np.indices(before.shape)
    period, angle, depth = rng.uniform(60, 160), rng.uniform(0, np.pi), rng.uniform(0.3, 0.7)
    along = columns * np.cos(angle) + rows * np.sin(angle)

    def shaded(image):
        stripes = ((along + rng.uniform(0, period)) % period < period / 2).astype(np.float32)
        return image * (1 - depth * cv2.GaussianBlur(stripes, (0, 0), 1.0))
    return shaded(before), shaded(after)


def rain(before, after, rng):
    def wet(image):
        height, width = image.shape
        streaks = np.zeros(image.shape, np.float32)
        for _ in range(int(rng.integers(50, 400) * image.size / 116000)):
            x, y, length = int(rng.integers(width)), int(rng.integers(height)), int(rng.integers(6, 20))
            cv2.line(streaks, (x, y), (x + length // 5, y + length), float(rng.uniform(30, 90)))
        return image + cv2.GaussianBlur(streaks, (0, 0), 0.6)
    return wet(before), wet(after)


def jpeg(before, after, rng):
    quality = int(rng.integers(7, 40))
    return tuple(cv2.imdecode(cv2.imencode(".jpg", levels(image), [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_GRAYSCALE)
                 for image in (before, after))


DISTURBANCES: dict[str, Disturbance] = {
    "as it is": lambda before, after, rng: (before, after),
    "gain": lambda before, after, rng: (before, after * np.exp(rng.uniform(-0.6, 0.6)) + rng.uniform(-15, 15)),
    "gamma": lambda before, after, rng: (before, 255 * (np.clip(after, 0, 255) / 255) ** np.exp(rng.uniform(-0.7, 0.7))),
    "noise": noise, "dusk": dusk,
    "blur": lambda before, after, rng: (before, cv2.GaussianBlur(after, (0, 0), rng.uniform(0.5, 1.8))),
    "low contrast": low_contrast, "fog": fog, "shadow": shadow, "rain": rain, "jpeg": jpeg}


def _half_motion(size: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """3x3, about the middle: half of up to 6 % of scale, 3 degrees and 4 px."""
    scale, angle = np.exp(rng.uniform(-0.06, 0.06) / 2), np.radians(rng.uniform(-3, 3)) / 2
    turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = (np.array(size[::-1]) - 1) / 2
    motion = np.eye(3)
    motion[:2, :2], motion[:2, 2] = turn, middle + rng.uniform(-2, 2, 2) - turn @ middle
    return motion


def plant(frame: np.ndarray, disturbance: str, rng: np.random.Generator) -> Pair:
    """Both images are `frame` (HxW, gray) moved by half of the motion, so that neither is smoother."""
    half = _half_motion(frame.shape, rng)
    before, after = (cv2.warpAffine(frame.astype(np.float32), motion[:2], frame.shape[::-1], flags=cv2.INTER_LANCZOS4,
                                    borderMode=cv2.BORDER_REFLECT) for motion in (np.linalg.inv(half), half))
    before, after = DISTURBANCES[disturbance](before, after, rng)
    if disturbance != "jpeg":
        before, after = (image + rng.normal(0, SENSOR_NOISE, image.shape) for image in (before, after))
    return Pair(levels(before), levels(after), (half @ half)[:2])
