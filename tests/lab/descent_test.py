# SPDX-License-Identifier: MIT
"""stemvo-lab learn --objective landing: the differentiable aligner against planted motions, learning, the file."""

import jax.numpy as jnp
import numpy as np
import pytest
import stemvo
from click.testing import CliRunner
from small_kitti import write_sequence
from stemvo import _core
from stemvo.lab import pairs
from stemvo.lab.cli import main
from stemvo.stems import aligner, descent, learn, metadata, teaching


def waves(dx=0.0, dy=0.0, side=44):
    y, x = np.indices((side, side)) * 1.0
    return sum(20 * np.sin(((x - dx) * np.cos(2.4 * i) + (y - dy) * np.sin(2.4 * i)) * 2 * np.pi / (6 + 1.5 * i) + i) for i in range(1, 9))


@pytest.mark.parametrize("gain, bias", [(1, 0), (0.6, 50)])
def test_the_aligner_lands_where_a_patch_is(gain, bias):
    moved = jnp.array(gain * waves(1.3, -0.7) + bias)
    landed = aligner.align(jnp.array(waves()), moved, jnp.array([21.5, 21.5]), jnp.array([21.5, 21.5]))
    assert np.abs(np.array(landed) - [22.8, 20.8]).max() < 0.03


def crops():
    rng = np.random.default_rng(1)
    frame = teaching.dead_leaves((240, 320), rng)
    return teaching.crops_of(pairs.plant(frame, "as it is", rng), rng)


def test_crops_show_the_same_corner():
    found = crops()
    assert len(found.before) > 10 and found.before.shape[1:] == found.after.shape[1:] == (teaching.SIDE, teaching.SIDE)
    assert np.abs(found.place).max() <= 0.5
    offs = [np.linalg.norm(2 * np.array(aligner.align(*(descent.filtered(jnp.ones((8, 8)), jnp.array(image, float)) for image in (before, after)),
                                                      jnp.full(2, 20.0), jnp.full(2, 20.0) + place / 2) - 20.0) - place)
            for before, after, place in zip(found.before[:12], found.after[:12], found.place[:12], strict=True)]
    assert np.median(offs) < 0.2


def test_learning_lowers_the_cost(monkeypatch):
    monkeypatch.setattr(descent, "BATCH", 32)
    found = crops()
    steps = list(descent.learn(found, 12, 1))
    weights = steps[-1][0]
    assert np.allclose(weights, weights.T) and np.allclose(weights, weights[::-1]) and weights.sum() == pytest.approx(1)
    assert np.isfinite([value for _, value in steps]).all()
    assert np.mean([value for _, value in steps[-4:]]) < np.mean([value for _, value in steps[:4]]) + 0.1
    assert np.array_equal(weights, list(descent.learn(found, 12, 1))[-1][0])


def test_the_file_is_a_channel(tmp_path, monkeypatch):
    write_sequence(tmp_path / "drive", "00")
    monkeypatch.setattr(learn, "NUM_LEAVES", 1)
    weights = np.outer(np.arange(1, 9), np.arange(2, 10)) / 1584
    monkeypatch.setattr(descent, "learn", lambda *_: [(weights, 0.0)])
    done = CliRunner().invoke(main, ["learn", str(tmp_path / "drive"), "--objective", "landing", "--out", str(tmp_path), "--name", "learned"])
    assert done.exit_code == 0, done.output
    assert metadata.read(tmp_path / "learned.onnx")["kernel"] == "8 8"
    image = np.random.default_rng(1).integers(0, 256, (64, 96)).astype(np.uint8)
    camera = stemvo.Camera(80, 80, 48, 32, 96, 64)
    (channel,) = _core.Stem({"stem.model": str(tmp_path / "learned.onnx"), "stem.tracking_resolution": "half"}).apply(image, camera)
    at = (image[10:18, 20:28] * weights).sum()
    assert channel.values.shape == (29, 45) and channel.values[5, 10] == pytest.approx(at, rel=1e-4)
