# SPDX-License-Identifier: MIT
"""One filter of a layer norm without the others (tools/stems/fold.py): values, rows, cost, trajectory."""

import contextlib
import io
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools"))
import _environment  # noqa: E402,F401

import numpy as np  # noqa: E402

import export_stem  # noqa: E402
import fold_bench  # noqa: E402
from stems import fold, fold_report, frames, onnx_writer  # noqa: E402
from stems import stem as stem_module  # noqa: E402

PROGRAM = os.environ.get("STEMVO_PROGRAM", "")
DATA = os.environ.get("STEMVO_SHARED_DATA")


def streets(count, size=(64, 96)):
    """Pictures with the spectrum of real ones: noise, summed along both axes."""
    rng = np.random.default_rng(8)
    for _ in range(count):
        walk = np.cumsum(np.cumsum(rng.normal(size=(3, *size)), axis=1), axis=2)
        walk = (walk - walk.min()) / np.ptp(walk) * 200 + rng.normal(size=walk.shape) * 4 + 20
        yield np.clip(np.rint(walk), 0, 255).astype(np.float32)


class Fold(unittest.TestCase):
    def difference(self, stem, index, rows=None, moment=None, pictures=None):
        folded = fold.layer_norm_filter(stem, index, rows, moment)
        self.rows = len(folded.weights)
        return fold_report.difference(onnx_writer.build(stem), onnx_writer.build(folded), index, pictures or streets(3))

    def test_exact(self):
        for filters in (8, 40, 96, 256):
            stem = fold_bench.random_stem(filters, seed=filters)
            for index in (0, filters - 1):
                self.assertLess(self.difference(stem, index).largest, 1e-4)
                # 49 numbers per patch; fewer filters say less. Centred filters: one less again.
                self.assertEqual(self.rows, min(filters - 1, 49))

    def test_truncated_rows_are_chosen_by_the_patches(self):
        stem = fold_bench.random_stem(64, seed=1)
        moment = fold.second_moment(stem.kernel, stem.stride, streets(4))
        errors = [self.difference(stem, 3, rows, moment).p99 for rows in (6, 12, 24)]
        self.assertTrue(errors[0] > errors[1] > errors[2], errors)
        self.assertLess(errors[0], 0.6)
        # Rows chosen as if every patch were as likely (white) are worse.
        white = self.difference(stem, 3, 12, np.eye(len(moment)))
        self.assertLess(3 * errors[1], white.p99)

    def test_dropped_rows_leave_their_mean(self):
        stem = fold_bench.random_stem(64, seed=1)
        moment = fold.second_moment(stem.kernel, stem.stride, streets(4))
        full = fold.layer_norm_filter(stem, 3, 64, moment)
        few = fold.layer_norm_filter(stem, 3, 5, moment)
        self.assertLess(full.floor, few.floor)

    def test_a_folded_filter_costs_a_quarter_at_most(self):
        stem = fold_bench.random_stem(256, seed=1)
        sessions = [fold_report.session(onnx_writer.build(item)) for item in (stem, fold.layer_norm_filter(stem, 10))]
        image = np.random.default_rng(2).uniform(0, 255, (1, 3, 376, 1241)).astype(np.float32)
        _, _, ratio = fold_bench.paired_medians(*sessions, image, 9)
        self.assertLess(ratio, 0.25)

    def test_waiting_is_no_time_of_a_stem(self):
        """The machine may do other things: they would lengthen the full stem's run, and so the fold's share would shrink."""
        class Waiting:
            def run(self, _outputs, _inputs):
                time.sleep(0.1)

        self.assertLess(fold_bench.seconds(Waiting(), None), 0.05)


class OneFilterInRows(unittest.TestCase):
    """onnx_writer computes many rows of one filter at a time: the same channel, of the same size."""

    def test_as_among_others(self):
        rng = np.random.default_rng(4)
        for kernel, stride, padding in (((8, 8), 2, (3, 3, 3, 3)), ((4, 4), 4, (0, 0, 0, 0)), ((7, 5), 2, (3, 2, 2, 1)), ((3, 3), 1, (1, 1, 1, 1))):
            for planes in (1, 3):
                two = stem_module.Stem(rng.normal(size=(2, planes, *kernel)), rng.normal(size=2), stride, mean=np.full(planes, 90.0) if planes == 3 else np.zeros(1),
                                       padding=padding)
                both, one = (fold_report.session(onnx_writer.build(stem)) for stem in (two, fold.one_filter(two, 1)))
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
        npz_of(fold_bench.random_stem(24, seed=1), self.folder / "w.npz")
        self.assertIn("expected --frames DIR", self.export("--filter", "3", "--fold", "8", code=1))
        self.assertIn("expected a folder of at least 2 PNG files", self.export("--filter", "3", "--fold", "--frames", str(self.folder / "no"), code=1))
        self.assertIn("expected --padding none", self.export("--filter", "3", "--fold", "--padding", "1,1,1,1", code=1))
        self.assertFalse((self.folder / "out").exists())

    @unittest.skipUnless(DATA, "STEMVO_SHARED_DATA is not set")
    def test_over_real_frames(self):
        npz_of(fold_bench.random_stem(256, seed=1), self.folder / "w.npz")
        for clip, camera in (("00", "image_0"), ("02", "image_2")):
            folder = pathlib.Path(DATA, "kitti/sequences", clip, camera)
            said = self.export("--filter", "10", "--fold", "--frames", str(folder))
            self.assertLess(float(re.search(r"maximum (\S+) of", said)[1]), 1e-4, said)
        said = self.export("--filter", "10", "--fold", "24", "--frames", str(folder))
        self.assertIn("24 rows instead of 256", said)
        self.assertLess(float(re.search(r"p99 (\S+),", said)[1]), 0.15, said)
        self.assertGreater(len(list(frames.find(folder, 40))), 10)

    @unittest.skipUnless(DATA, "STEMVO_SHARED_DATA is not set")
    def test_the_same_trajectory(self):
        npz_of(fold_bench.random_stem(96, seed=3), self.folder / "w.npz")
        self.export("--name", "full")
        self.export("--name", "one", "--filter", "5", "--fold")
        paths = []
        for name, index in (("full", 5), ("one", 0)):
            out = self.folder / name
            subprocess.run([PROGRAM, "run", pathlib.Path(DATA, "kitti/sequences/06"), "--out", out, "--quiet", "--set", f"stem.model={self.folder}/out/{name}.onnx",
                            "--set", f"stem.filter={index}", "--set", "scale.source=ground_truth"], check=True)
            paths.append(np.loadtxt(out / "trajectory_kitti.txt")[:, [3, 7, 11]])
        length = np.linalg.norm(np.diff(paths[0], axis=0), axis=1).sum()
        self.assertGreater(length, 30)
        self.assertLess(np.linalg.norm(paths[0] - paths[1], axis=1).max(), 0.005 * length)


if __name__ == "__main__":
    unittest.main()
