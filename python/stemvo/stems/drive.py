# SPDX-License-Identifier: MIT
"""A rendered drive (`stemvo synth --depth`): pictures, depth, poses, and patches that show the same point of the world in two frames."""

import dataclasses
import pathlib

import numpy as np

import stemvo

# Depth may differ by this share inside a patch, and between the two frames' views of a point: more is an edge of an object, or a point
# that something else hides.
_DEPTH_TOLERANCE = 0.03
# Where nothing was drawn (the sky) the depth is not finite or not positive: a point this far away.
_SKY_M = 1e6
LUMA = np.array([0.299, 0.587, 0.114])  # share of R, G and B in gray: Rec. 601, as in OpenCV


class Drive:
    """Frames of DIR/sequences/00 with DIR/poses/00.txt; depth beside them."""

    def __init__(self, folder):
        sequence = pathlib.Path(folder) / "sequences/00"
        self._recording, self._depth = stemvo.read_recording(sequence), sequence / "depth"
        self.world_from_camera, camera = self._recording.ground_truth, self._recording.camera
        if self.world_from_camera is None or not len(self) == len(self.world_from_camera) >= 2:
            raise ValueError(f"{sequence}: expected at least 2 pictures and a pose of each, found {len(self)}")
        self.camera = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])

    def __len__(self):
        return len(self._recording)

    def gray(self, index):
        """H x W, gray levels 0..255."""
        picture = self._recording[index][0]
        if picture is None or picture.ndim != 3:
            found = "one that cannot be read" if picture is None else "a gray one"
            raise ValueError(f"{self._depth.parent}/image_2/{index:06}.png: expected a colour picture, found {found}")
        return np.divide(picture, 255, dtype=np.float32).astype(np.float64) @ (255.0 * LUMA)

    def depth(self, index):
        """H x W, metres along z; the sky very far away."""
        file = self._depth / f"{index:06d}.npy"
        try:
            depth = np.load(file, allow_pickle=False).astype(np.float64)
        except (OSError, ValueError, EOFError) as error:
            raise ValueError(f"{file}: expected depth (stemvo synth --depth), found: {error}") from error
        return np.where(np.isfinite(depth) & (depth > 0), depth, _SKY_M)


def windows(values, size):
    """View of all size x size windows: y, x, window y, window x."""
    return np.lib.stride_tricks.sliding_window_view(values, (size, size))


def _project(camera, after_from_before, centre, depth):
    """centre: N x 2 (x, y) with its depth -> where it is in the other frame, and its depth there."""
    rays = np.column_stack([centre, np.ones(len(centre))]) @ np.linalg.inv(camera).T
    points = (rays * depth[:, None]) @ after_from_before[:3, :3].T + after_from_before[:3, 3]
    in_front = np.maximum(points[:, 2], 1e-6)
    return (points @ camera.T)[:, :2] / in_front[:, None], points[:, 2]


def corresponding_corners(drive, before, after, size, sampling_px, count, rng):
    """Top left corners (x, y) of patches that show the same surface in two frames: N x 2, N x 2, N <= count.

    In the frame `after`, the patch is the nearest one whose corner is a multiple of sampling_px:
    a channel sampled every sampling_px pixels has no closer one, so what is left of the motion, up
    to half of that on each axis, belongs to the differences that a filter should not see.
    """
    depth_before, depth_after = drive.depth(before), drive.depth(after)
    height, width = depth_before.shape
    corner = np.column_stack([rng.integers(0, width - size + 1, count), rng.integers(0, height - size + 1, count)])
    patch_depth = windows(depth_before, size)[corner[:, 1], corner[:, 0]].reshape(count, -1)
    flat = patch_depth.max(axis=1) < patch_depth.min(axis=1) * (1 + _DEPTH_TOLERANCE)

    after_from_before = np.linalg.inv(drive.world_from_camera[after]) @ drive.world_from_camera[before]
    half = (size - 1) / 2
    centre, depth = _project(drive.camera, after_from_before, corner + half, patch_depth.mean(axis=1))
    other = sampling_px * np.rint((centre - half) / sampling_px).astype(np.int64)
    inside = np.all((other >= 0) & (other <= np.array([width, height]) - size), axis=1) & (depth > 0)
    other = np.where(inside[:, None], other, 0)
    seen = windows(depth_after, size)[other[:, 1], other[:, 0]].reshape(count, -1)
    visible = np.all(np.abs(seen - depth[:, None]) < 2 * _DEPTH_TOLERANCE * depth[:, None], axis=1)
    keep = flat & inside & visible
    return corner[keep], other[keep]


@dataclasses.dataclass(frozen=True)
class Views:
    """How differently two views show a point beyond what a drive's next frame does: standard deviations."""

    zoom: float = 0.1  # of its logarithm
    rotation_deg: float = 5.0

    def patches(self, image, corners, size, rng):
        """As patches(), each zoomed and rotated about its middle: bilinear, the image's border goes on."""
        if self.zoom == 0 and self.rotation_deg == 0:
            return patches(image, corners, size)
        zoom = np.exp(rng.normal(0, self.zoom, len(corners)))
        angle = np.radians(rng.normal(0, self.rotation_deg, len(corners)))
        along, across = (zoom * np.cos(angle))[:, None], (zoom * np.sin(angle))[:, None]
        half = (size - 1) / 2
        y, x = (axis.ravel() - half for axis in np.mgrid[:size, :size])
        return _bilinear(image, corners[:, :1] + half + along * x - across * y, corners[:, 1:] + half + across * x + along * y)


def _bilinear(image, x, y):
    height, width = image.shape
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    left, top = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    right_share, lower_share = x - left, y - top
    upper, lower = ((1 - right_share) * image[row, left] + right_share * image[row, left + 1] for row in (top, top + 1))
    return (1 - lower_share) * upper + lower_share * lower


def patches(image, corners, size):
    """N x (size * size): y, x."""
    return windows(image, size)[corners[:, 1], corners[:, 0]].reshape(len(corners), -1)
