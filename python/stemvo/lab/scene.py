# SPDX-License-Identifier: MIT
"""stemvo-lab scene: a result for programs that reconstruct scenes: COLMAP's text model, nerfstudio's transforms.json (docs/benchmark.md)."""

import json
import pathlib

import click
import cv2
import numpy as np
from scipy.spatial.transform import Rotation

import stemvo
from stemvo.lab import runs

HALF_PX = 0.5  # the middle of the first pixel is (0.5, 0.5) there, (0, 0) here
_VERTEX = np.dtype([("position", "<f4", 3), ("rgb", "u1", 3)])
_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])  # nerfstudio's camera looks along -z, y up


def read_landmarks(file, num_cameras):
    """Nx3 and their colours of map.ply; the camera's positions stand behind them."""
    head, found, body = file.read_bytes().partition(b"end_header\n")
    counts = [int(line.split()[2]) for line in head.decode("ascii", "replace").splitlines() if line.startswith("element vertex ")]
    if not found or not counts or len(body) < counts[0] * _VERTEX.itemsize or counts[0] < num_cameras:
        raise ValueError(f"{file}: expected a map of `stemvo run`, found another file")
    vertices = np.frombuffer(body, _VERTEX, counts[0] - num_cameras)
    return vertices["position"].astype(float), vertices["rgb"]


def read_result(folder):
    """Nx4x4 world_from_camera as map.ply has them, the landmarks, and what metrics.json says."""
    try:
        said = json.loads((folder / "metrics.json").read_text())
    except ValueError as error:
        raise ValueError(f"{folder / 'metrics.json'}: expected a result of stemvo run, found: {error}") from error
    adjusted = folder / "trajectory_map_kitti.txt"
    poses, _ = stemvo.read_trajectory(adjusted if adjusted.exists() else folder / "trajectory_kitti.txt")
    points = read_landmarks(folder / "map.ply", len(poses)) if (folder / "map.ply").exists() else (np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    return poses, points, said


def write_images(recording, first, folder):
    """As the odometry saw them, without distortion; None for one that cannot be read."""
    folder.mkdir(parents=True, exist_ok=True)
    names = []
    for number, (image, _) in enumerate(recording, first):
        names.append(None if image is None else f"{number:06}.png")
        if image is not None:
            cv2.imwrite(str(folder / names[-1]), image if image.ndim == 2 else image[:, :, ::-1])
    return names


def write_colmap(out, camera, names, poses, points):
    """out/sparse/0: the text model, whose points have no observations (colmap point_triangulator finds them)."""
    folder = out / "sparse/0"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cameras.txt").write_text("1 OPENCV " + " ".join(map(repr, camera.values())) + " 0 0\n")
    lines = []
    for number, (name, pose) in enumerate(zip(names, np.linalg.inv(poses)), 1):
        if name is not None:
            turn = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True, scalar_first=True)
            lines.append(" ".join([str(number), *(f"{value:.12g}" for value in (*turn, *pose[:3, 3])), "1", name]) + "\n\n")
    (folder / "images.txt").write_text("".join(lines))
    (folder / "points3D.txt").write_text("".join(
        " ".join([str(number), *(f"{value:.7g}" for value in position), *map(str, color), "0"]) + "\n"
        for number, (position, color) in enumerate(zip(*points), 1)))


def write_nerfstudio(out, camera, names, poses, points):
    """out/transforms.json and out/points.ply."""
    frames = [{"file_path": f"images/{name}", "transform_matrix": (pose @ _FROM_OPENGL).tolist()} for name, pose in zip(names, poses) if name]
    (out / "transforms.json").write_text(json.dumps(camera | {"camera_model": "OPENCV", "ply_file_path": "points.ply", "frames": frames}, indent=1))
    head = f"ply\nformat ascii 1.0\nelement vertex {len(points[0])}\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    head += "".join(f"property uchar {color}\n" for color in ("red", "green", "blue")) + "end_header\n"
    rows = (" ".join([*(f"{value:.7g}" for value in position), *map(str, color)]) + "\n" for position, color in zip(*points))
    (out / "points.ply").write_text(head + "".join(rows))


@click.command()
@click.argument("result", type=click.Path(exists=True, file_okay=False, path_type=pathlib.Path))
@click.argument("recording", type=click.Path(exists=True, path_type=pathlib.Path))
@click.option("--out", required=True, type=click.Path(path_type=pathlib.Path), help="Folder of the model and images/")
@click.option("--to", "kind", type=click.Choice(["colmap", "nerfstudio"]), default="colmap", show_default=True)
@click.option("--camera", type=click.Path(exists=True, path_type=pathlib.Path), help="Camera file, as `stemvo run` had it")
def command(result, recording, out, kind, camera):
    """RESULT of `stemvo run` on RECORDING: its images without distortion, camera, poses and landmarks for another program."""
    poses, points, said = read_result(result)
    first = said["first_frame"]
    read = stemvo.read_recording(recording, camera, frames=f"{first}:{first + len(poses)}")
    pinhole = said["camera"]
    intrinsics = {"w": read.camera.width, "h": read.camera.height, "fl_x": pinhole["fx_px"], "fl_y": pinhole["fy_px"],
                  "cx": pinhole["cx_px"] + HALF_PX, "cy": pinhole["cy_px"] + HALF_PX, "k1": pinhole["k1"], "k2": pinhole["k2"]}
    runs.open_folder(out, "scene")
    names = write_images(read, first, out / "images")
    {"colmap": write_colmap, "nerfstudio": write_nerfstudio}[kind](out, intrinsics, names, poses, points)
    click.echo(f"{out}: {sum(name is not None for name in names)} images, {len(points[0])} points")
