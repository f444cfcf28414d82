#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Visual odometry as tutorials show it: ORB, brute force, essential matrix, with OpenCV's Python package.

    build/venv-peers/bin/python bench/peers/orb_brute_force.py SEQUENCE --out FILE [--gt POSES] [--frames A:B]

Reads a KITTI sequence (image_2 if there, else image_0), writes poses in KITTI's format. 1000 features, as
such programs commonly ask for. Every step is 1 long; with --gt as long
as the true one (ground truth is used for nothing else). A step that cannot be measured repeats the last one.
`tools/setup.sh peers` makes the environment.
"""

import argparse
import pathlib

import cv2
import numpy as np

FEATURES = 1000
MIN_MATCHES = 8  # findEssentialMat needs 5, recoverPose a few that agree


def read_camera(sequence):
    """Folder of the frames, and K."""
    camera = "image_2" if (sequence / "image_2").is_dir() else "image_0"
    for line in (sequence / "calib.txt").read_text(encoding="utf-8").splitlines():
        name, _, numbers = line.partition(":")
        if name == f"P{camera[-1]}":
            return sequence / camera, np.array(numbers.split(), float).reshape(3, 4)[:, :3]
    raise SystemExit(f"{sequence}/calib.txt: expected a line P{camera[-1]}:, found none")


def step_lengths(poses_file, begin, count):
    """True length of every step between the frames; 1 without a file."""
    if poses_file is None:
        return np.ones(count - 1)
    positions = np.loadtxt(poses_file, ndmin=2)[begin:begin + count, [3, 7, 11]]
    if len(positions) != count:
        raise SystemExit(f"{poses_file}: expected {begin + count} poses, found {begin + len(positions)}")
    return np.linalg.norm(np.diff(positions, axis=0), axis=1)


class Matcher:
    """Points of the last picture and of this one that match."""

    def __init__(self):
        self.orb = cv2.ORB_create(FEATURES)
        self.brute_force = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)
        self.last = ((), None)

    def advance(self, picture):
        keypoints, descriptors = self.orb.detectAndCompute(picture, None)
        (last_keypoints, last_descriptors), self.last = self.last, (keypoints, descriptors)
        if descriptors is None or last_descriptors is None:
            return np.empty((0, 2)), np.empty((0, 2))
        matches = self.brute_force.match(last_descriptors, descriptors)
        return (np.array([last_keypoints[match.queryIdx].pt for match in matches]),
                np.array([keypoints[match.trainIdx].pt for match in matches]))


def motion(last_points, points, camera_matrix):
    """R, t of the last camera's points in this camera, |t| = 1; None where they cannot be measured."""
    if len(points) < MIN_MATCHES:
        return None
    essential, mask = cv2.findEssentialMat(last_points, points, camera_matrix, cv2.RANSAC, 0.999, 1.0)
    if essential is None or essential.shape != (3, 3):
        return None
    _, rotation, translation, _ = cv2.recoverPose(essential, last_points, points, camera_matrix, mask=mask)
    return rotation, translation


def chain(files, camera_matrix, lengths):
    """world_from_camera of every frame."""
    matcher = Matcher()
    pose = np.eye(4)
    step = np.eye(4)
    for index, file in enumerate(files):
        picture = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if picture is None:
            raise SystemExit(f"{file}: expected a picture, found none that can be read")
        measured = motion(*matcher.advance(picture), camera_matrix)
        if index > 0:
            if measured is not None:
                rotation, translation = measured
                step = np.eye(4)
                step[:3, :3] = rotation.T
                step[:3, 3:] = -rotation.T @ translation * lengths[index - 1]
            pose = pose @ step
        yield pose


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="poses are written here")
    parser.add_argument("--gt", type=pathlib.Path, help="true poses, for the lengths of the steps")
    parser.add_argument("--frames", default=":", help="A:B, frames A to B-1")
    options = parser.parse_args()
    folder, camera_matrix = read_camera(options.sequence)
    first, _, last = options.frames.partition(":")
    begin, end = int(first or 0), int(last) if last else None
    files = sorted(folder.glob("*.png"))[begin:end]
    if not files:
        raise SystemExit(f"{folder}: expected frames {options.frames}, found none")
    poses = chain(files, camera_matrix, step_lengths(options.gt, begin, len(files)))
    np.savetxt(options.out, [pose[:3].ravel() for pose in poses], fmt="%.9e")


if __name__ == "__main__":
    main()
