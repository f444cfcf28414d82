# SPDX-License-Identifier: MIT
"""stemvo-lab learn on a planted drive: a textured wall that the camera approaches."""

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from exporting import run_onnx
from stemvo.lab.cli import main
from stemvo.stems import drive, learn, metadata

SIZE = (96, 128)
FOCAL_PX = 100.0
WALL_M = 10.0


def wall_gray(x, y):
    """Texture of the wall at metres x, y: waves of many lengths, weaker when shorter."""
    rng = np.random.default_rng(5)
    gray = np.full(x.shape, 120.0)
    for _ in range(60):
        length = 0.3 * 2.0 ** rng.uniform(0, 4)
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        gray += 12 * length**0.5 * np.sin(2 * np.pi * (np.cos(angle) * x + np.sin(angle) * y) / length + phase)
    return np.clip(gray, 0, 255)


def write_drive(folder, frames=4, *, step_m=0.4):
    sequence = folder / "sequences" / "00"
    for name in ("image_2", "depth"):
        (sequence / name).mkdir(parents=True)
    (folder / "poses").mkdir()
    centre = (np.array(SIZE[::-1]) - 1) / 2
    (sequence / "calib.txt").write_text(f"P2: {FOCAL_PX} 0 {centre[0]} 0 0 {FOCAL_PX} {centre[1]} 0 0 0 1 0\n")
    (sequence / "times.txt").write_text("".join(f"{0.1 * i}\n" for i in range(frames)))
    poses = []
    y, x = np.mgrid[:SIZE[0], :SIZE[1]].astype(np.float64)
    for index in range(frames):
        position = np.array([0.11, -0.07, 1.0]) * step_m * index
        depth = WALL_M - position[2]
        gray = wall_gray((x - centre[0]) / FOCAL_PX * depth + position[0], (y - centre[1]) / FOCAL_PX * depth + position[1])
        picture = np.repeat(np.rint(gray).astype(np.uint8)[:, :, None], 3, axis=2)
        cv2.imwrite(str(sequence / "image_2" / f"{index:06d}.png"), picture)
        np.save(sequence / "depth" / f"{index:06d}.npy", np.full(SIZE, depth, np.float32))
        poses.append(np.column_stack([np.eye(3), position]).ravel())
    np.savetxt(folder / "poses" / "00.txt", poses)


@pytest.fixture
def wall(tmp_path):
    write_drive(tmp_path / "drive")
    return tmp_path


def learned(wall, out, *options, code=0):
    done = CliRunner().invoke(main, ["learn", str(wall / "drive"), "--out", str(wall / out), "--pairs", "3000", *options])
    assert done.exit_code == code, done.output
    return done.output if code else wall / out


def channels(folder, gray, file="default.onnx"):
    return run_onnx(folder / file, gray[None])


def test_corners_are_where_the_wall_says(wall):
    frames = drive.Drive(wall / "drive")
    before, after = drive.corresponding_corners(frames, 0, 2, 4, 1, 3000, np.random.default_rng(0))
    assert len(before) > 1000
    centre = (np.array(SIZE[::-1]) - 1) / 2
    wall = (before + 1.5 - centre) / FOCAL_PX * WALL_M
    expected = (wall - 0.8 * np.array([0.11, -0.07])) / (WALL_M - 0.8) * FOCAL_PX + centre - 1.5
    assert np.abs(after - expected).max() <= 0.5 + 1e-9 and np.abs(after - before).max() > 2


def test_hidden_points_are_left_out(wall):
    depth = wall / "drive" / "sequences" / "00" / "depth" / "000001.npy"
    np.save(depth, np.full(SIZE, 3.0, np.float32))
    frames = drive.Drive(wall / "drive")
    before, _ = drive.corresponding_corners(frames, 0, 1, 4, 1, 3000, np.random.default_rng(0))
    assert len(before) == 0


def test_same_drive_same_bytes(wall):
    first, second = (learned(wall, out) / "default.onnx" for out in ("a", "b"))
    assert first.read_bytes() == second.read_bytes()
    said = metadata.read(first)
    assert (said["filters"], said["kernel"], said["stride"]) == ("16", "8 8", "2")
    assert said["command"].startswith("stemvo-lab learn drive --out models --name default --objective matching --kernel 8 ")


NORM = ("--kernel", "4", "--stride", "4", "--floor", "3")


def test_the_layer_norm_is_the_one_of_the_page(wall, monkeypatch):
    """channel k = z_k / sqrt(mean z^2 + floor^2): z_k unspoiled by the mean over channels."""
    made, own = [], learn.learn
    monkeypatch.setattr(learn, "learn", lambda *given: made.append(own(*given)) or made[-1])
    out, gray = learned(wall, "out", *NORM), drive.Drive(wall / "drive").gray(1)
    (stem, ratios), = made
    assert np.all(np.diff(ratios) < 0)
    windows = drive.windows(gray, 4)[::4, ::4]
    z = np.einsum("cyx,hwyx->chw", stem.weights.sum(axis=1), windows) + stem.bias[:, None, None]
    got = channels(out, gray)
    assert np.abs(got - z / np.sqrt((z**2).mean(axis=0) + 9.0)).max() < 1e-3
    assert np.all(got.std(axis=(1, 2)) > 0.01), "a filter is dead on gray"


@pytest.mark.parametrize(("shape", "step"), [((), 1), (NORM, 2)])
def test_the_default_filter_alone_has_the_same_values(wall, shape, step):
    gray, out = drive.Drive(wall / "drive").gray(1), learned(wall, "out", "--default-filter", "5", *shape)
    (alone,), with_others = channels(out, gray, "default_filter_5.onnx"), channels(out, gray)[5]
    assert np.abs(alone[::step, ::step] - with_others).max() <= 1e-6 * np.abs(with_others).max()
    said = metadata.read(out / "default_filter_5.onnx")
    assert (said["filters"], said["filter"], said["default_filter"], said["stride"]) == ("16", "5", "5", "2")


def test_tracking_has_the_steeper_slope_in_its_worse_direction(wall):
    """On the pictures themselves: smaller of the slopes' energies along x and y; the noise is 1 for each filter."""
    gray, ratios = drive.Drive(wall / "drive").gray(1), {}
    for name in ("tracking", "matching"):
        out = learned(wall, name, "--objective", name)
        seen = np.stack([[channels(out, np.roll(gray, (-y, -x), (0, 1))) for x in range(2)] for y in range(2)])[:, :, :, 8:-8, 8:-8]
        slopes = seen[0, 1] - seen[0, 0], seen[1, 0] - seen[0, 0]
        ratios[name] = np.min([(slope**2).mean(axis=(1, 2)) for slope in slopes], axis=0)
    assert ratios["tracking"][0] > 1.1 * ratios["matching"].max(), ratios


@pytest.mark.parametrize(("file", "content", "words"), [
    ("sequences/00/depth/000001.npy", b"broken", "000001.npy"), ("sequences/00/calib.txt", b"P0: 1", "calib.txt"),
    ("poses/00.txt", b"1 2 3", "00.txt"), ("sequences/00/image_2/000002.png", b"broken", "000002.png")])
def test_errors_are_one_line(wall, file, content, words):
    (wall / "drive" / file).write_bytes(content)
    said = learned(wall, "out", code=1)
    assert said.count("\n") == 1 and words in said, said
