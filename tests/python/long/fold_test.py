# SPDX-License-Identifier: MIT
"""One filter of a layer norm without the others (tools/stems/fold.py): values, rows, cost, file."""

import contextlib
import io
import pathlib
import statistics
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "bench")]
import _environment  # noqa: E402,F401

import numpy as np  # noqa: E402
import onnxruntime  # noqa: E402

import export_stem  # noqa: E402
import random_stems  # noqa: E402
from stems import fold, onnx_writer  # noqa: E402
from stems import stem as stem_module  # noqa: E402


def session(stem):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(onnx_writer.to_bytes(onnx_writer.build(stem)), options, providers=["CPUExecutionProvider"])


class Fold(unittest.TestCase):
    def test_the_filter_has_the_same_values(self):
        picture = np.random.default_rng(8).uniform(0, 255, (1, 3, 64, 96)).astype(np.float32)
        for filters in (8, 40, 96, 256):
            stem = random_stems.random_stem(filters, seed=filters)
            for index in (0, filters - 1):
                folded = fold.layer_norm_filter(stem, index)
                # 49 numbers per patch; fewer filters say less. Centred filters: one less again.
                self.assertEqual(len(folded.weights), min(filters - 1, 49))
                wanted = session(stem).run(None, {onnx_writer.INPUT: picture})[0][0, index]
                found = session(folded).run(None, {onnx_writer.INPUT: picture})[0][0, 0]
                self.assertLess(np.abs(found - wanted).max(), 1e-4 * wanted.std())

    def test_a_folded_filter_costs_a_quarter_at_most(self):
        stem = random_stems.random_stem(256, seed=1)
        image = np.random.default_rng(2).uniform(0, 255, (1, 3, 376, 1241)).astype(np.float32)
        sessions = [session(item) for item in (stem, fold.layer_norm_filter(stem, 10))]
        ratios = []
        for _ in range(9):  # in turn, by the processor's time: other programs slow both alike
            times = [time.thread_time()]
            for one in sessions:
                one.run(None, {onnx_writer.INPUT: image})
                times.append(time.thread_time())
            ratios.append((times[2] - times[1]) / (times[1] - times[0]))
        self.assertLess(statistics.median(ratios), 0.25)


class OneFilterInRows(unittest.TestCase):
    """onnx_writer computes many rows of one filter at a time: the same channel, of the same size."""

    def test_as_among_others(self):
        rng = np.random.default_rng(4)
        for kernel, stride, padding in (((8, 8), 2, (3, 3, 3, 3)), ((4, 4), 4, (0, 0, 0, 0)), ((7, 5), 2, (3, 2, 2, 1)), ((3, 3), 1, (1, 1, 1, 1))):
            for planes in (1, 3):
                two = stem_module.Stem(rng.normal(size=(2, planes, *kernel)), rng.normal(size=2), stride, mean=np.full(planes, 90.0) if planes == 3 else np.zeros(1),
                                       padding=padding)
                both, one = (session(stem) for stem in (two, fold.one_filter(two, 1)))
                for size in ((8, 9), (31, 40), (33, 33), (64, 50), (131, 20)):
                    feed = {onnx_writer.INPUT: rng.uniform(0, 255, (1, planes, *size)).astype(np.float32)}
                    expected, found = both.run(None, feed)[0][:, 1:], one.run(None, feed)[0]
                    self.assertEqual(found.shape, expected.shape, (kernel, stride, padding, size))
                    self.assertLess(np.abs(found - expected).max(), 0.01)


def npz_of(stem, path):
    """Weights for the pixels themselves, as export_stem reads them."""
    np.savez(path, conv_w=stem.weights.astype(np.float32), conv_b=(stem.bias - np.einsum("cdyx,d->c", stem.weights, stem.mean)).astype(np.float32),
             stride=np.int32(stem.stride), input_mean=np.zeros(3, np.float32), input_std=np.full(3, 1 / 255, np.float32),
             ln_gamma=stem.layer_norm.gamma.astype(np.float32), ln_beta=stem.layer_norm.beta.astype(np.float32), ln_eps=np.float32(1e-6))


class Exported(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def export(self, *options, code=0):
        with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()) as complained:
            self.assertEqual(export_stem.main([str(self.folder / "w.npz"), "--out", str(self.folder / "out"), *options]), code)
        return said.getvalue() + complained.getvalue()

    def test_errors(self):
        npz_of(random_stems.random_stem(24, seed=1), self.folder / "w.npz")
        self.assertIn("expected --padding none", self.export("--filter", "3", "--fold", "--padding", "1,1,1,1", code=1))
        self.assertFalse((self.folder / "out").exists())

    def test_the_filter_by_itself_is_that_of_the_layer(self):
        npz_of(random_stems.random_stem(96, seed=3), self.folder / "w.npz")
        self.export("--name", "full")
        self.export("--name", "one", "--filter", "5", "--fold")
        picture = np.random.default_rng(8).uniform(0, 255, (1, 3, 64, 96)).astype(np.float32)
        full, one = (onnxruntime.InferenceSession(self.folder / f"out/{name}.onnx").run(None, {onnx_writer.INPUT: picture})[0][0] for name in ("full", "one"))
        self.assertEqual((len(full), len(one)), (96, 1))
        np.testing.assert_allclose(one[0], full[5], atol=1e-4 * full[5].std())


if __name__ == "__main__":
    unittest.main()
