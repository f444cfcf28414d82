# SPDX-License-Identifier: MIT
"""Crops around corners of planted pairs, from which a channel is learned."""

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np

from ..lab import pairs

SIDE = 88  # input px of a crop: what two levels of the aligner read from starts 6 px off
CORNERS = 30  # of a pair
MARGIN = SIDE // 2 + 2


class Crops(NamedTuple):
    before: np.ndarray  # N x SIDE x SIDE uint8, the corner in the middle
    after: np.ndarray  # N x SIDE x SIDE uint8
    place: np.ndarray  # N x 2: of the corner in `after`, input px from the middle of the crop
    turn: np.ndarray  # N x 2: a, b of the motion's linear part [a -b; b a]


def dead_leaves(size: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Discs, boxes and bars that hide each other, their sizes distributed as r^-3: natural images' spectrum and edges. Made at
    twice the size, then averaged over the pixels, as a sensor does."""
    height, width = 2 * size[0], 2 * size[1]
    image = np.full((height, width), 128, np.float32)
    for _ in range(5000):
        radius = 3.0 / np.sqrt(rng.uniform(3.0**2 / 240.0**2, 1.0))
        shade = float(np.clip(rng.normal(115, 55), 2, 250))
        x, y, kind = rng.uniform(0, width), rng.uniform(0, height), rng.integers(3)
        if kind == 0:
            cv2.circle(image, (int(16 * x), int(16 * y)), int(16 * radius), shade, cv2.FILLED, cv2.LINE_AA, 4)
        else:
            length = radius * (1.0 if kind == 1 else rng.uniform(2, 8))
            box = cv2.boxPoints(((x, y), (2 * length, 2 * radius * rng.uniform(0.2, 1)), rng.uniform(0, 180)))
            cv2.fillConvexPoly(image, np.round(16 * box).astype(np.int32), shade, cv2.LINE_AA, 4)
    texture = cv2.GaussianBlur(rng.normal(0, 1, image.shape).astype(np.float32), (0, 0), rng.uniform(0.8, 2.5))
    image += texture / texture.std() * rng.uniform(0, 8)
    image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.6, 1.4))
    return cv2.resize(np.clip(image, 0, 255), size[::-1], interpolation=cv2.INTER_AREA)


def _corners(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """At a quarter of the size, as the odometry looks for them; so that no channel's own are preferred."""
    small = cv2.pyrDown(cv2.pyrDown(image))
    found = cv2.goodFeaturesToTrack(small, 0, 0.005, 2, blockSize=3)
    if found is None:
        return np.zeros((0, 2))
    return 4 * found[rng.permutation(len(found)), 0]


def crops_of(pair: pairs.Pair, rng: np.random.Generator) -> Crops:
    corners = np.round(_corners(pair.before, rng)).astype(int)
    true = (corners + 0.5) @ pair.motion[:, :2].T + pair.motion[:, 2]  # a crop's middle lies between four pixels
    middle = np.floor(true).astype(int)
    size = np.array(pair.before.shape[::-1])
    seen = np.all((corners >= MARGIN) & (middle >= MARGIN) & (corners < size - MARGIN) & (middle < size - MARGIN), axis=1)
    half = SIDE // 2 - 1

    def cut(image, centres):
        return np.array([image[y - half:y - half + SIDE, x - half:x - half + SIDE] for x, y in centres], np.uint8).reshape(-1, SIDE, SIDE)
    corners, true, middle = corners[seen][:CORNERS], true[seen][:CORNERS], middle[seen][:CORNERS]
    turn = np.tile([pair.motion[0, 0], pair.motion[1, 0]], (len(corners), 1))
    return Crops(cut(pair.before, corners), cut(pair.after, middle), true - middle - 0.5, turn)


def collect(frames: Iterable[np.ndarray], seed: int) -> Crops:
    """Every frame under two disturbances, in turn."""
    kinds, found = list(pairs.DISTURBANCES), []
    for number, frame in enumerate(frames):
        for again in range(2):
            rng = np.random.default_rng([seed, number, again])
            found.append(crops_of(pairs.plant(frame, kinds[(2 * number + again) % len(kinds)], rng), rng))
    return Crops(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
