# SPDX-License-Identifier: MIT
"""stemvo-lab show, and family, on filters that are known: what they read, draw, correlate, write and refuse."""

import json
import os
import pathlib
import re
import subprocess

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from stemvo.lab.cli import main
from stemvo.stems import family, onnx_writer, show, stem

MEAN, DERIVATIVE = np.full((1, 3, 2, 2), 1 / 12), np.array([[-1.0, 1.0], [-1.0, 1.0]]).reshape(1, 1, 2, 2).repeat(3, axis=1)
WEIGHTS = np.concatenate([MEAN, -MEAN, DERIVATIVE])


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "three.onnx"
    path.write_bytes(onnx_writer.to_bytes(onnx_writer.build(stem.Stem(WEIGHTS, np.zeros(3), 2))))
    return path


def call(*arguments, code=0):
    done = CliRunner().invoke(main, list(map(str, arguments)))
    assert done.exit_code == code, done.output
    return done.output


def test_reads_what_was_written(model):
    weights, stride, padding = show.read_weights(model)
    assert (stride, padding) == (2, [0, 0, 0, 0])
    np.testing.assert_allclose(weights, WEIGHTS, atol=1e-7)
    weights, stride, padding = show.read_weights(pathlib.Path(__file__).parents[2] / "models/default.onnx")
    assert (len(weights), weights.shape[2:], stride, padding) == (16, (8, 8), 2, [3, 3, 3, 3])


def test_prints_a_filter_by_its_share(model):
    assert re.findall(r"-?\d\.\d+", call("show", model, "--weights", 2)) == ["-0.25", "0.25", "-0.25", "0.25"]


def test_correlation_with_gray(model, tmp_path):
    """A mean is gray itself, its negative is the opposite, and a derivative of noise has nothing to do with it."""
    for index in range(3):
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.random.default_rng(index).uniform(50, 255, (80, 120, 1)).repeat(3, axis=2))
    said = call("show", model, "--images", tmp_path, "--every", 2)
    assert f"{tmp_path}: 2 frames\n" in said
    found = [float(value) for value in re.findall(r"filter +\d: correlation with gray +(\S+) ", said)]
    np.testing.assert_allclose(found[:2], (1, -1), atol=1e-3)
    assert abs(found[2]) < 0.1


def test_picture(model, tmp_path):
    call("show", model, "--picture", tmp_path / "filters.png")
    picture = cv2.imread(str(tmp_path / "filters.png"))
    assert min(picture.shape[:2]) > 50 and picture.std() > 2  # not blank


@pytest.mark.parametrize(("options", "message"), [
    (("text.onnx",), "text.onnx: expected an ONNX file"), (("none.onnx",), "expected an ONNX file"),
    (("three.onnx", "--weights", "3"), "--weights: expected 0 to 2, found 3"), (("three.onnx", "--images", "empty"), "expected PNG files, found none"),
    (("three.onnx", "--images", "damaged"), "0.png: expected a PNG, found"), (("three.onnx", "--picture", "none/a.png"), "none/a.png: expected to be")])
def test_errors(model, tmp_path, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "text.onnx").write_text("text")
    (tmp_path / "empty").mkdir()
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged/0.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    said = call("show", *options, code=1)
    assert said.count("\n") == 1 and message in said, said


def test_stemvo_loads_a_family_whose_names_say_what_it_is(tmp_path):
    names, filters = [line.split()[1] for line in call("family", "--out", tmp_path).splitlines()], family.family()
    assert names == list(filters)
    done = subprocess.run([os.environ["STEMVO_PROGRAM"], "models", tmp_path / "family.onnx", "--json"], capture_output=True, text=True, check=True)
    model, = json.loads(done.stdout)["models"]
    assert (model["sound"], model["filters"], model["kernel_px"], model["stride_px"]) == (True, len(names), [8, 8], 2)
    assert np.unravel_index(filters["D1.5@0"].argmax(), (8, 8))[1] == 2  # a derivative of a Gaussian falls along its angle
    np.testing.assert_allclose(filters["D1.5@90"], filters["D1.5@0"].T)
    assert filters["S0.9-1.0x2.5"].sum() == pytest.approx(0, abs=1e-7) and filters["G1.3"].sum() == pytest.approx(1)
