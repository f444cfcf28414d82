# SPDX-License-Identifier: MIT
"""What calls take and refuse: cameras, images, masks, hints, options, speeds."""

import os
import pathlib
import pickle
import sys

import numpy as np
import pytest
import stemvo

LENS = [-0.02, 0.004, -0.001, 0.0005]
PINHOLE = stemvo.Camera(200.0, 200.0, 160.0, 120.0, 320, 240)
GRAY = np.random.default_rng(3).integers(0, 256, (30, 40)).repeat(8, axis=0).repeat(8, axis=1).astype(np.uint8)
POSES = np.tile(np.eye(4), (5, 1, 1))


@pytest.mark.parametrize(("distortion", "coefficients"), [
    ("none", []), ("equidistant", LENS), ("equidistant", [0.0] * 4), ("radial-tangential", LENS), ("radial-tangential", [*LENS, 0.1]), ("radial-tangential", [*LENS, *[0.1] * 8])])
def test_a_camera_tells_its_lens(distortion, coefficients):
    camera = stemvo.Camera(200.0, 201.0, 160.0, 120.0, 320, 240, distortion, coefficients)
    for one in (camera, eval(repr(camera), {"Camera": stemvo.Camera}), pickle.loads(pickle.dumps(camera))):
        assert (one.fy, one.distortion, one.coefficients) == (201.0, distortion, coefficients)
    assert ("distortion" in repr(camera)) == (distortion != "none")


@pytest.mark.parametrize(("distortion", "count"), [("none", 1), ("equidistant", 1), ("equidistant", 5), ("radial-tangential", 3), ("fisheye", 4)])
def test_a_lens_has_all_its_coefficients(distortion, count):
    with pytest.raises(ValueError, match=f"^distortion: expected .* equidistant with 4, found '{distortion}' with {count}$"):
        stemvo.Camera(200.0, 200.0, 160.0, 120.0, 320, 240, distortion, [0.01] * count)


IMAGE, MASK = "an array HxW (gray) or HxWx3 (RGB) uint8, found ", "mask: expected an array HxW uint8 or bool, found "


@pytest.mark.parametrize(("call", "text"), [
    (lambda o: o.process(None, 0.0), f"image: expected {IMAGE}NoneType"),
    (lambda o: o.process(GRAY.tolist(), 0.0), f"image: expected {IMAGE}list"),
    (lambda o: o.process(GRAY > 9, 0.0), f"image: expected {IMAGE}240x320 bool"),
    (lambda o: o.process(GRAY / 255, 0.0), f"image: expected {IMAGE}240x320 float64"),
    (lambda o: o.process(GRAY, 0.0, mask=GRAY.astype(np.int16)), f"{MASK}240x320 int16"),
    (lambda o: o.process(GRAY, 0.0, mask="0,0,9,9"), f"{MASK}str"),
    (lambda o: o.process(GRAY, 0.0, rotation_hint=np.zeros(3)), "rotation_hint: expected a rotation, 3x3, found none"),
    (lambda o: list(o.run([("image", 0.0)])), f"image: expected {IMAGE}str"),
    (lambda o: stemvo.Odometry(PINHOLE, mask=np.dstack([GRAY] * 3)), f"{MASK}240x320x3 uint8"),
    (lambda o: stemvo.Odometry(PINHOLE, ["stem.filter=3"]), "options: expected Options or a dict"),
    (lambda o: stemvo.Options("stem.filter=3"), "options: expected Options or a dict"),
    (lambda o: stemvo.Odometry("camera.yaml"), "camera: expected Camera, Recording or FrameView"),
    (lambda o: stemvo.evaluate(list(POSES), POSES), "estimate: expected an array Nx4x4 float64, found list"),
    (lambda o: stemvo.align(POSES, POSES.astype(np.float32)), "truth: expected an array Nx4x4 float64, found 5x4x4 float32"),
])
def test_what_is_wrong_is_one_line_of_a_value_error(call, text):
    with pytest.raises(ValueError) as raised:
        call(stemvo.Odometry(PINHOLE))
    assert str(raised.value) == text


@pytest.mark.parametrize(("call", "text"), [
    (lambda o: o.process(GRAY[:100], 1.0), "expected 320x240 pixels"),
    (lambda o: o.process(np.zeros((240, 320, 4), np.uint8), 1.0), "found 240x320x4"),
    (lambda o: o.process(np.uint8(3), 1.0), "image"),
    (lambda o: o.process(np.zeros((0, 320), np.uint8), 1.0), "expected 320x240"),
    (lambda o: o.process(GRAY[:, ::-1], 1.0), "side by side"),
    (lambda o: o.process(GRAY[::-1], 1.0), "side by side"),
    (lambda o: o.process(np.broadcast_to(np.uint8(1), GRAY.shape), 1.0), "side by side"),
    (lambda o: [o.process(GRAY, 1.0) for _ in range(2)], "after the last frame's, 1 s, found 1 s"),
    (lambda _: stemvo.Odometry(stemvo.Camera(-1, 500, 320, 94, 640, 188)), "camera: expected focal lengths"),
    (lambda _: stemvo.Odometry(PINHOLE, {"stem.filtre": 1}), "did you mean stem.filter?"),
    (lambda _: stemvo.Odometry(PINHOLE, {"features.max_features": "many"}), "features.max_features: expected"),
    (lambda _: stemvo.Odometry(PINHOLE, {"stem.filter": float("nan")}), "stem.filter: expected"),
    (lambda _: stemvo.Odometry(PINHOLE, {"stem.model": "no such"}), "no such"),
    (lambda _: stemvo.Odometry(PINHOLE, {"scale.source": "ground_truth"}), "scale.source: expected"),
    (lambda _: stemvo.Options({"stem.model": pathlib.Path(os.fsdecode(b"\xff"))}), "options: expected text in UTF-8, found"),
    (lambda _: stemvo.Options.load("/nowhere.yaml"), "/nowhere.yaml"),
    (lambda _: stemvo.read_recording("/nowhere"), "/nowhere"),
    (lambda _: stemvo.read_recording("/nowhere", frames="4:2"), "expected A < B"),
    (lambda _: stemvo.read_recording(sys.executable), "stemvo.FrameView"),
    (lambda _: stemvo.read_recording("camera:0"), "stemvo.FrameView"),
    (lambda _: stemvo.read_recording("listed"), "expected camera_file, or camera.yaml in their folder"),
    (lambda _: stemvo.read_recording("listed", "listed.yaml", rate=10, times="times.txt"), "rate 10: expected images without times, found"),
    (lambda _: stemvo.FrameView("listed.yaml", masks=["1,2"]), "masks: expected"),
    (lambda _: stemvo.FrameView("/nowhere.yaml"), "/nowhere.yaml"),
    (lambda _: stemvo.align(POSES, POSES[:3]), "expected a frame of 5 poses for each of 3"),
    (lambda _: stemvo.align(POSES, POSES[:1], [5]), "expected a frame of 5 poses"),
    (lambda _: stemvo.evaluate("/nowhere", POSES), "/nowhere"),
    (lambda _: stemvo.evaluate(POSES, POSES[:4]), "expected 4 poses"),
    (lambda _: stemvo.evaluate(POSES * 2.0, POSES), "estimate[0]: expected a rotation"),
    (lambda _: stemvo.evaluate(POSES, POSES, align="up"), "up"),
    (lambda _: stemvo.evaluate(POSES + np.eye(4)[3][:, None], POSES), "0, 0, 0, 1 below"),
    (lambda _: stemvo.segment_errors(POSES, POSES, [0.0]), "lengths above 0"),
    (lambda _: stemvo.pair_by_time([1.0, 0.0], [0.0, 1.0]), "expected times that rise"),
])
def test_a_value_error_says_in_one_line(call, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "listed").mkdir()
    (tmp_path / "listed/0.png").touch()
    (tmp_path / "listed.yaml").write_text("resolution: [640, 188]\nintrinsics: [500, 500, 320, 94]\ndistortion_model: none\n")
    odometry = stemvo.Odometry(PINHOLE)
    with pytest.raises(ValueError) as raised:
        call(odometry)
    assert text in str(raised.value) and "\n" not in str(raised.value)
    assert odometry.process(GRAY, 2.5).timestamp == 2.5  # it still works


def test_a_mask_of_bool_is_one_of_bytes():
    mask = np.zeros(GRAY.shape, bool)
    mask[:, :160] = True
    tracked = []
    for given in (mask, mask.astype(np.uint8), 255 * mask.astype(np.uint8)):
        for once, each in ((given, None), (None, given)):
            odometry = stemvo.Odometry(PINHOLE, mask=once)
            for k in range(2):
                odometry.process(np.roll(GRAY, -3 * k, axis=1), 0.1 * k, mask=each)
            tracked.append(odometry.tracked_points()[0])
    assert len(tracked[0]) > 20 and tracked[0][:, 2].max() < 160
    for places in tracked:
        np.testing.assert_array_equal(places, tracked[0])
