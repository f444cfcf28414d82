# SPDX-License-Identifier: MIT
"""stemvo-lab robustness: effects on synthetic frames, states and jumps, verdicts, the command on a rendered drive."""

import json
import os
import subprocess

import numpy as np
import pytest
import stemvo
from click.testing import CliRunner
from stemvo.lab import disturbances, robustness
from stemvo.lab.cli import main

COUNT, WIDTH, HEIGHT = 80, 320, 96


class Frames:
    """Frame i: grains, i levels brighter."""

    grains = np.random.default_rng(7).integers(40, 160, size=(HEIGHT, WIDTH))

    camera = stemvo.Camera(180.0, 180.0, 160.0, 48.0, WIDTH, HEIGHT)
    timestamps = 0.1 * np.arange(COUNT)
    ground_truth = np.tile(np.eye(4), (COUNT, 1, 1))

    def __len__(self):
        return COUNT

    def __getitem__(self, i):
        image = (self.grains + i).astype(np.uint8)
        return np.repeat(image[..., None], 3, axis=2), 0.1 * i


@pytest.mark.parametrize("how", disturbances.ALL, ids=lambda how: how.name)
def test_every_kind_is_repeatable_and_stronger_each_time(how):
    assert len(how.strengths) == 3
    plain, off = Frames(), []
    for index in range(3):
        disturbed, again = (disturbances.Disturbed(plain, how, index, seed=4) for _ in range(2))
        on = [i for i in range(len(disturbed)) if disturbed.is_disturbed(i)]
        for i in on[::9]:
            image, time = disturbed[i]
            assert image.dtype == np.uint8 and image.shape == (disturbed.camera.height, disturbed.camera.width, 3) and time == disturbed.timestamps[i]
            assert np.array_equal(image, again[i][0])
        assert len(disturbed) == len(disturbed.ground_truth) == len(disturbed.timestamps)
        if how.apply:
            assert max(on) < COUNT - 10 and np.array_equal(disturbed[COUNT - 1][0], plain[COUNT - 1][0])  # the calm
            off.append(sum(np.abs(disturbed[i][0].astype(float) - plain[i][0]).mean() for i in on))
    assert not off or off[0] < off[1] < off[2] or how.name in ("moving_third", "blackout") and off[0] > 0.0


def test_other_frames_and_views():
    dropped = disturbances.Disturbed(Frames(), disturbances.find("dropped"), 2)
    assert COUNT * 0.65 < len(dropped) < COUNT * 0.95 and np.all(np.diff(dropped.timestamps) > 0.05)
    nth = disturbances.Disturbed(Frames(), disturbances.find("every_nth"), 1)
    assert nth[2][0][0, 0, 0] == Frames()[6][0][0, 0, 0] and nth[2][1] == pytest.approx(0.6)
    cropped = disturbances.Disturbed(Frames(), disturbances.find("cropped"), 2)
    # The same ray, wherever it falls: the principal point moves with the corner.
    left = (WIDTH - cropped.camera.width) // 2
    assert cropped.camera.cx == Frames.camera.cx - left and np.array_equal(cropped[3][0][:, 0], Frames()[3][0][(HEIGHT - cropped.camera.height) // 2 :][: cropped.camera.height, left])
    scaled = disturbances.Disturbed(Frames(), disturbances.find("scaled"), 1)
    assert (scaled.camera.width, scaled.camera.fx, scaled.camera.cx) == (WIDTH // 2, 90.0, (160.0 + 0.5) * 0.5 - 0.5)


def test_noise_has_the_strength_that_is_named():
    image = np.full((200, 300), 120, np.uint8)
    noisy = disturbances.find("sensor_noise").apply(image, 12.0, disturbances.At(3, 1, Frames.camera)).astype(float)
    assert noisy.mean() == pytest.approx(120.0, abs=0.3) and noisy.std() == pytest.approx(12.0, abs=0.3)
    dark = disturbances.find("dusk").apply(image, 0.01, disturbances.At(60, 1, Frames.camera)).astype(float)
    assert dark.mean() == pytest.approx(12.0, abs=0.5)  # half of the stops: the root of a hundredth


def test_recovery_and_jumps():
    found = [True, False, False, False, True, True]
    assert robustness.recovery(found, [False, True, False, False, False, False]) == {"recovery_frames": 2, "recovered": True}
    assert robustness.recovery(found[:4], [False, True, False, False]) == {"recovery_frames": 2, "recovered": False}
    assert robustness.recovery([True] * 3, [False] * 3) == {"recovery_frames": None, "recovered": True}
    poses = np.tile(np.eye(4), (5, 1, 1))
    angle = np.radians(1.5)
    poses[2:, :2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    truth = np.tile(np.eye(4), (5, 1, 1))
    assert robustness.jumps([True] * 5, poses, truth) == 1 and robustness.jumps([True, False, True, True, True], poses, truth) == 0


def test_contenders_differ_in_the_channel_alone():
    made = robustness.contenders({"seed": 3, "stem.sampling_px": 1}, ["gray", "blue", "orb", "default:4", "paper:1"])
    assert made["gray"] == {"seed": 3, "stem.sampling_px": 0, "stem.model": "gray", "stem.filter": -1}
    assert (made["blue"]["stem.model"], made["blue"]["stem.filter"]) == ("input_layer", 2)
    assert made["orb"]["odometry.mode"] == "two_frame" and (made["default:4"]["stem.sampling_px"], made["paper:1"]["stem.sampling_px"]) == (1, 0)


def test_the_command(tmp_path):
    subprocess.run([os.environ["STEMVO_PROGRAM"], "synth", tmp_path, "--frames", "60", "--width", "310", "--height", "94"], check=True, stdout=subprocess.DEVNULL)
    command = ["robustness", str(tmp_path / "sequences/00"), "--kinds", "none,blackout,cropped", "--controls", "gray,orb", "--no-ray", "--jobs", "2", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output + repr(done.exception)
    found = json.loads((tmp_path / "out/robustness.json").read_text())
    assert [row["disturbance"] for row in found["rows"]] == ["none"] + ["blackout"] * 3 + ["cropped"] * 3
    plain = {one["channel"]: one for one in found["rows"][0]["channels"]}
    assert plain["judged"]["r_rel_deg_per_100m"] < plain["orb"]["r_rel_deg_per_100m"] and plain["judged"]["tracked"] == 1.0
    assert {one["group"] for one in found["groups"]} == {"none", "in the way", "other views", "all"}
    rows = (tmp_path / "out/rows.csv").read_text()
    assert CliRunner().invoke(main, command).output == done.output and (tmp_path / "out/rows.csv").read_text() == rows
    wrong = CliRunner().invoke(main, [*command, "--kinds", "fogg"])
    assert wrong.exit_code == 1 and "found 'fogg'" in wrong.output
