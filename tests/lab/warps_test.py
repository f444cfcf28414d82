# SPDX-License-Identifier: MIT
"""Planted warps: where a point lands is known."""

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from stemvo.lab import pairs, warps
from stemvo.lab.cli import main


def leaves(seed=1, size=(240, 320)):
    """Boxes that hide each other, in front of noise."""
    rng = np.random.default_rng(seed)
    image = rng.uniform(60, 200, size).astype(np.float32)
    for _ in range(300):
        x, y = rng.integers(size[1]), rng.integers(size[0])
        image[y:y + rng.integers(4, 40), x:x + rng.integers(4, 40)] = rng.uniform(10, 240)
    return np.round(cv2.GaussianBlur(image, (0, 0), 0.8)).astype(np.uint8)


@pytest.fixture(scope="module")
def measured():
    channels = {"gray": {"stem.model": "gray"}, "default": {}}
    return warps.measure(channels, [leaves(1), leaves(2)], disturbances=["as it is", "noise", "gain"])


def test_points_land_where_they_are_in_another_brightness_too(measured):
    for name in ("gray", "default"):
        row = warps.row(measured[name]["as it is"])
        assert row["median"][0] < 0.15 and row["found"][0] > 0.95 and row["wrong"][0] < 0.01
        assert row["median"][1] <= row["median"][0] <= row["median"][2] < row["percentile_90"][0]
        assert warps.row(measured[name]["gain"])["found"][0] > 0.9


def test_noise_costs_precision(measured):
    for name in ("gray", "default"):
        assert warps.row(measured[name]["noise"])["median"][0] > 1.5 * warps.row(measured[name]["as it is"])["median"][0]
        assert warps.geometric_mean(measured[name])[0] > warps.row(measured[name]["as it is"])["median"][0]


def test_a_wrong_truth_is_seen():
    pair = pairs.plant(leaves(), "as it is", np.random.default_rng(1))
    moved = pair._replace(motion=pair.motion + [[0, 0, 0.5], [0, 0, 0]])
    errors = [np.median(warps.land({"stem.model": "gray"}, one, warps.NEAR, np.random.default_rng(1)).errors) for one in (pair, moved)]
    assert errors[1] - errors[0] > 0.3


@pytest.mark.parametrize("kind", pairs.DISTURBANCES)
def test_pairs_are_images_of_the_frame(kind):
    pair = pairs.plant(leaves(), kind, np.random.default_rng(3))
    again = pairs.plant(leaves(), kind, np.random.default_rng(3))
    assert pair.before.shape == pair.after.shape == (240, 320) and pair.before.dtype == np.uint8
    assert np.array_equal(pair.before, again.before) and np.array_equal(pair.after, again.after)
    assert pair.before.std() > 5 and np.abs(pair.motion[:, :2] - np.eye(2)).max() < 0.09


def test_the_command_prints_a_row_a_disturbance(tmp_path):
    for number in range(2):
        cv2.imwrite(str(tmp_path / f"{number}.png"), leaves(number))
    (tmp_path / "camera.yaml").write_text("image_width: 320\nimage_height: 240\nintrinsics: [300, 300, 160, 120]\ndistortion_model: none\nrate_hz: 10\n")
    answer = CliRunner().invoke(main, ["warps", str(tmp_path), "--frames", "1", "--json", str(tmp_path / "rows.json")])
    assert answer.exit_code == 0, answer.output
    assert answer.output.count("\n| ") == 1 + len(pairs.DISTURBANCES) and "nan" not in answer.output
    answer = CliRunner().invoke(main, ["warps", str(tmp_path), "--channel", "nope"])
    assert answer.exit_code == 1 and "nope" in answer.output
