# SPDX-License-Identifier: MIT
"""What calls take and refuse: cameras, images, masks, hints, options, speeds."""

import pickle

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


def test_metres_by_speeds_name_their_source():
    """Two planes that a camera goes past sideways, with the usual sigma of a wheel."""
    odometry = stemvo.Odometry(PINHOLE)
    wide = np.tile(GRAY, (1, 2))
    assert odometry.scale_source == "none"
    for k in range(30):
        odometry.add_speed(0.1 * k, 2.0)
        shown = np.concatenate([wide[:120, 4 * k:320 + 4 * k], wide[120:, 2 * k:320 + 2 * k]])
        result = odometry.process(shown, 0.1 * k)
    assert (result.scale_state, odometry.scale_source) == ("measured", "speed")
    odometry.reset()
    assert odometry.scale_source == "none"
