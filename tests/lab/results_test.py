# SPDX-License-Identifier: MIT
"""Results as a table, as a picture, and between processes."""

import os
import pickle
import subprocess

import matplotlib.pyplot
import numpy as np
import pandas
import pytest
import stemvo


@pytest.fixture(scope="module")
def seen():
    """Sixteen frames of a camera that goes sideways before two planes: the odometry and its results."""
    noise = np.random.default_rng(3).integers(0, 256, (30, 60)).repeat(8, axis=0).repeat(8, axis=1).astype(np.uint8)
    odometry = stemvo.Odometry(stemvo.Camera(200.0, 200.0, 160.0, 120.0, 320, 240))
    images = [np.concatenate([noise[:120, 4 * k:320 + 4 * k], noise[120:, 2 * k:320 + 2 * k]]) for k in range(16)]
    return odometry, [odometry.process(image, 0.1 * k) for k, image in enumerate(images)]


def test_results_are_pickled_whole(seen):
    _, results = seen
    for result, again in zip(results, pickle.loads(pickle.dumps(results)), strict=True):
        assert repr(again) == repr(result)
        assert again.state == result.state and again.timestamp == result.timestamp
        np.testing.assert_array_equal(again.world_from_camera, result.world_from_camera)
        assert (again.camera.fx, again.camera.distortion, again.camera.coefficients) == (
            result.camera.fx, result.camera.distortion, result.camera.coefficients)
        names = {name for name in dir(result) if not name.startswith("_")}
        assert names == {name for name in vars(again) if name != "_repr"}
    assert pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(results[-1])))).state == results[-1].state


def test_maps_are_pickled_too(seen):
    odometry, _ = seen
    assert [one.frame for one in pickle.loads(pickle.dumps(odometry.keyframes()))] == [one.frame for one in odometry.keyframes()]
    changes = odometry.landmarks_since(0)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(changes)).positions, changes.positions)


def test_a_table_has_a_row_per_result(seen):
    _, results = seen
    table = stemvo.to_dataframe(results)
    assert list(table.timestamp_s) == pytest.approx([0.1 * k for k in range(16)])
    assert list(table.state) == [result.state for result in results]
    np.testing.assert_array_equal(table[["x", "y", "z"]], [result.world_from_camera[:3, 3] for result in results])
    assert list(stemvo.to_dataframe([]).columns) == list(table.columns)


def test_a_table_has_the_columns_of_frames_csv(tmp_path):
    program = os.environ["STEMVO_PROGRAM"]
    for words in (["synth", tmp_path, "--frames", "12", "--width", "310", "--height", "94"], ["run", tmp_path / "sequences/00", "--out", tmp_path / "result"]):
        subprocess.run([program, *words], check=True, capture_output=True)
    recording = stemvo.read_recording(tmp_path / "sequences/00")
    table, written = stemvo.to_dataframe(pickle.loads(pickle.dumps(list(stemvo.Odometry(recording).run(recording))))), pandas.read_csv(tmp_path / "result/frames.csv", keep_default_na=False, na_values="")
    assert list(table.columns) == [*written.columns[:-2], "is_measured"]
    for name in written.columns[:-2]:
        if not name.endswith("_ms"):
            pandas.testing.assert_series_equal(table[name], written[name], check_dtype=False, rtol=1e-5, atol=0.005 if name.endswith("_px") else 6e-4 if name[0] in "sr" else 1e-9)


def test_a_picture_has_the_path_and_the_truth(seen):
    _, results = seen
    truth = np.stack([result.world_from_camera for result in results]) + 1.0
    axes = stemvo.plot(results, truth, matplotlib.pyplot.figure().add_subplot())
    assert axes.get_aspect() == 1.0 and axes.get_adjustable() == "datalim"  # a straight drive is no line of six pixels
    lines = {line.get_label(): line.get_xydata() for line in axes.get_lines()}
    np.testing.assert_array_equal(lines["estimate"], [result.world_from_camera[[0, 2], 3] for result in results])
    np.testing.assert_array_equal(lines["ground truth"], lines["estimate"] + 1.0)
