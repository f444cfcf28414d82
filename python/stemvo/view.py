# SPDX-License-Identifier: MIT
"""A result of `stemvo run`, or a recording while it is tracked, in rerun's viewer (docs/python.md).

    pip install '.[view]'
    python -m stemvo.view RESULT [--recording RECORDING]
    python -m stemvo.view --live RECORDING [--set KEY=VALUE ..]
"""

import argparse
import csv
import json
import os
import pathlib
import sys
import sysconfig

import numpy as np

import stemvo

INLIER, OUTLIER, PATH, TRUTH = (0, 158, 115), (213, 94, 0), (0, 114, 178), (150, 150, 150)
JPEG_QUALITY = 75
MAP_EVERY = 10  # frames: the map is sent whole each time, and moved to where the true path is
PIECE = 100  # frames of path that are sent again with each


def read_poses(file):
    """KITTI's format -> Nx4x4."""
    try:
        rows = np.loadtxt(file, ndmin=2)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
    if rows.ndim != 2 or rows.shape[1] != 12:
        raise ValueError(f"{file}: expected 12 numbers a line, found {rows.shape[-1]}")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows.reshape(-1, 3, 4)
    return poses


class View:
    """Where things stand in rerun: world (truth, estimate/path, estimate/map, estimate/camera/image with points), channel, plots."""

    def __init__(self, rr, recording, scale_source):
        self.rr = rr
        self.path, self.piece = [], []
        self.truth = recording.ground_truth if recording else None
        self.alignment = "sim3" if scale_source == "none" else "none"
        rr.log("world", rr.ViewCoordinates.RIGHT_HAND_Y_DOWN, static=True)
        if self.truth is not None:
            self.true_frames = recording.ground_truth_frames
            rr.log("world/truth", rr.LineStrips3D([self.truth[:, :3, 3]], colors=[TRUTH]), static=True)

    def fit(self, poses):
        """Moves all that is estimated to where report.html draws it."""
        known = self.truth is not None and self.true_frames < len(poses)
        if not np.any(known):
            return
        probes = np.tile(np.eye(4), (2, 1, 1))  # which show how the poses are moved
        probes[1, 0, 3] = 1.0
        origin, unit = stemvo.align(np.concatenate([poses, probes]), self.truth[known], self.true_frames[known], self.alignment)[-2:]
        scale = np.linalg.norm(unit[:3, 3] - origin[:3, 3])
        self.rr.log("world/estimate", self.rr.Transform3D(translation=origin[:3, 3], mat3x3=scale * origin[:3, :3]))

    def at(self, frame, timestamp):
        self.rr.set_time("frame", sequence=frame)
        if timestamp is not None:
            self.rr.set_time("time", duration=timestamp)

    def pose(self, world_from_camera):
        if len(self.path) % PIECE == 0:
            self.piece = self.path[-1:]
        self.path.append(world_from_camera)
        self.piece.append(world_from_camera)
        self.rr.log("world/estimate/camera", self.rr.Transform3D(translation=world_from_camera[:3, 3],
                                                                 mat3x3=world_from_camera[:3, :3]))
        strip = [pose[:3, 3] for pose in self.piece]
        self.rr.log(f"world/estimate/path/{(len(self.path) - 1) // PIECE}", self.rr.LineStrips3D([strip], colors=[PATH]))

    def image(self, image, camera):
        if image is None:  # it could not be read
            return
        self.rr.log("world/estimate/camera/image", self.rr.Pinhole(
            focal_length=(camera.fx, camera.fy), principal_point=(camera.cx, camera.cy),
            width=camera.width, height=camera.height))
        self.rr.log("world/estimate/camera/image", self.rr.Image(image).compress(jpeg_quality=JPEG_QUALITY))

    def points(self, tracks, is_inlier):
        strips = tracks.reshape(-1, 2, 2)
        colors = [INLIER if inlier else OUTLIER for inlier in is_inlier]
        self.rr.log("world/estimate/camera/image/points", self.rr.LineStrips2D(strips, colors=colors))

    def landmarks(self, positions, colors):
        self.rr.log("world/estimate/map", self.rr.Points3D(positions, colors=colors, radii=0.03))

    def channel(self, image):
        self.rr.log("channel", self.rr.Image(image).compress(jpeg_quality=JPEG_QUALITY))

    def number(self, name, value):
        if value is not None:
            self.rr.log(f"plots/{name}", self.rr.Scalars(value))

    def state(self, text, last):
        if text != last:
            self.rr.log("state", self.rr.TextLog(text))


def show_live(rr, recording, options):
    """By process(), not run(): points and channel must be this frame's."""
    odometry = stemvo.Odometry(recording, options)
    view = View(rr, recording, odometry.scale_source)
    state = None
    for frame, (image, timestamp) in enumerate(recording):
        if image is None:  # a gap in time; the path has a pose per frame
            view.path.append(view.path[-1] if view.path else np.eye(4))
            continue
        result = odometry.process(image, timestamp)
        view.at(frame, timestamp)
        view.pose(result.world_from_camera)
        view.image(image, result.camera)
        view.points(*odometry.tracked_points())
        view.channel(odometry.channel_image())
        view.number("matches", result.num_matches)
        view.number("inliers", result.num_inliers)
        view.number("scale_sigma", result.scale_sigma)
        view.state(result.state, state)
        state = result.state
        if frame % MAP_EVERY == MAP_EVERY - 1 or frame == len(recording) - 1:
            view.landmarks(*odometry.landmarks())
            view.fit(view.path)


def show_result(rr, folder, open_recording):
    in_map = folder / "trajectory_map_kitti.txt"  # map.ply is in it
    poses = read_poses(in_map if in_map.exists() else folder / "trajectory_kitti.txt")
    with open(folder / "frames.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if len(rows) != len(poses):
        raise ValueError(f"{folder}: expected a row of frames.csv per pose, found {len(rows)} of {len(poses)}")
    first = int(rows[0]["frame"])
    recording = open_recording(f"{first}:{first + len(rows)}")
    view = View(rr, recording, json.loads((folder / "metrics.json").read_text(encoding="utf-8"))["scale_source"])
    view.fit(poses)
    if (folder / "map.ply").exists():
        rr.log_file_from_path(folder / "map.ply", entity_path_prefix="world/estimate", static=True)
    state = None
    for row, pose in zip(rows, poses):
        frame = int(row["frame"])
        view.at(frame, float(row["timestamp_s"]))
        view.pose(pose)
        if recording:
            view.image(recording[frame - first][0], recording.camera)
        for name in ("matches", "inliers", "r_h", "scale_sigma", "stem_ms", "features_ms", "pose_ms"):
            view.number(name, float(row[name]) if row.get(name) else None)
        view.state(row["state"], state)
        state = row["state"]


def options_of(pairs):
    values = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals:
            raise ValueError(f"--set {pair}: expected KEY=VALUE")
        values[key] = value
    return values


def open_window(rr):
    """The viewer of rerun-sdk stands beside this Python, which need not be on PATH."""
    os.environ["PATH"] = os.pathsep.join([sysconfig.get_path("scripts"), os.environ.get("PATH", "")])
    try:
        rr.spawn()
    except RuntimeError as error:
        raise ValueError(f"rerun: {str(error).splitlines()[0]} Give --save FILE.rrd and open that file elsewhere.") from None


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m stemvo.view", description=__doc__.partition("\n")[0])
    parser.add_argument("result", nargs="?", type=pathlib.Path, metavar="RESULT", help="the --out of `stemvo run`")
    parser.add_argument("--recording", type=pathlib.Path, help="its frames, shown beside")
    parser.add_argument("--live", type=pathlib.Path, metavar="RECORDING", help="track these frames and watch")
    parser.add_argument("--camera", type=pathlib.Path, help="camera file of the recording")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="with --live")
    parser.add_argument("--save", type=pathlib.Path, metavar="FILE.rrd", help="write this in place of a window")
    given = parser.parse_args(arguments)
    if (given.result is None) == (given.live is None):
        parser.error("expected RESULT or --live RECORDING")
    try:
        import rerun as rr
    except ImportError:
        sys.exit("error: expected the package rerun-sdk: pip install '.[view]'")
    try:
        folder = given.live or given.recording
        def open_recording(frames=None):
            return stemvo.read_recording(folder, given.camera, frames=frames) if folder else None

        rr.init("stemvo")
        if given.save:
            rr.save(given.save)
        else:
            open_window(rr)
        if given.live:
            show_live(rr, open_recording(), options_of(given.set))
        else:
            show_result(rr, given.result, open_recording)
    except (OSError, ValueError, KeyError) as error:
        sys.exit("error: " + str(error).replace("camera_file", "--camera FILE"))


if __name__ == "__main__":
    main()
