# SPDX-License-Identifier: MIT
"""stemvo-lab scene: a landmark falls on the same pixel through each model as through the result itself."""

import json
import os
import subprocess

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation
from stemvo.lab import scene
from stemvo.lab.cli import main


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder, program = tmp_path_factory.mktemp("scene"), os.environ["STEMVO_PROGRAM"]
    subprocess.run([program, "synth", folder / "drive", "--frames", "20", "--width", "620", "--height", "188"], check=True, capture_output=True)
    subprocess.run([program, "run", folder / "drive/sequences/00", "--frames", "2:20", "--out", folder / "result", "--quiet"], check=True)
    return folder


def pixels(result):
    """Of each landmark in the last image, (0, 0) in the middle of the first pixel; and which are in sight."""
    poses, (points, _), said = scene.read_result(result / "result")
    in_sight = ((points - poses[-1, :3, 3]) @ poses[-1, :3, 2]) > 3.0
    assert np.sum(in_sight) > 50
    return in_sight, project(np.linalg.inv(poses[-1])[:3], points, *(said["camera"][key] for key in ("fx_px", "fy_px", "cx_px", "cy_px")))


def project(camera_from_world, points, fx, fy, cx, cy):
    x, y, z = camera_from_world[:, :3] @ points.T + camera_from_world[:, 3:]
    return np.stack([fx * x / z + cx, fy * y / z + cy], axis=1)


def call(result, kind):
    out = result / kind
    answer = CliRunner().invoke(main, ["scene", str(result / "result"), str(result / "drive/sequences/00"), "--out", str(out), "--to", kind])
    assert answer.exit_code == 0, answer.output
    return out


def test_colmap(result):
    out = call(result, "colmap")
    camera = list(map(float, (out / "sparse/0/cameras.txt").read_text().split()[4:8]))
    assert (out / "sparse/0/cameras.txt").read_text().split() == ["1", "OPENCV", "620", "188", *map(repr, camera), "0.0", "0.0", "0", "0"]
    number, w, x, y, z, *place, _, name = (out / "sparse/0/images.txt").read_text().splitlines()[-2].split()
    assert (number, name) == ("18", "000019.png") and (out / "images" / name).exists() and len(list((out / "images").iterdir())) == 18
    turn = Rotation.from_quat(list(map(float, (x, y, z, w)))).as_matrix()
    points = np.loadtxt(out / "sparse/0/points3D.txt")
    assert np.all(points[:, 4:7] == points[:, 4:7].astype(np.uint8))
    found = project(np.column_stack([turn, np.array(place, float)]), points[:, 1:4], *camera)
    in_sight, expected = pixels(result)
    assert np.abs(found - 0.5 - expected)[in_sight].max() < 0.01


def test_nerfstudio(result):
    out = call(result, "nerfstudio")
    said = json.loads((out / "transforms.json").read_text())
    camera_from_world = np.linalg.inv(said["frames"][-1]["transform_matrix"])
    assert (out / said["frames"][-1]["file_path"]).exists() and (said["w"], said["h"]) == (620, 188)
    points = np.loadtxt((out / "points.ply").read_text().split("end_header\n")[1].splitlines())[:, :3]
    x, y, z = camera_from_world[:3, :3] @ points.T + camera_from_world[:3, 3:]  # it looks along -z, y up
    found = np.stack([said["fl_x"] * x / -z + said["cx"], said["fl_y"] * -y / -z + said["cy"]], axis=1)
    in_sight, expected = pixels(result)
    assert np.abs(found - 0.5 - expected)[in_sight].max() < 0.01


def test_another_file_is_an_error(tmp_path):
    (tmp_path / "map.ply").write_bytes(b"ply\nend_header\n")
    with pytest.raises(Exception, match="expected a map"):
        scene.read_landmarks(tmp_path / "map.ply", 3)
