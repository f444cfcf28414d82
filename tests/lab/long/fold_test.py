# SPDX-License-Identifier: MIT
"""One filter of a layer norm without the others (stemvo.stems.fold): values, rows, cost."""

import pathlib
import statistics
import sys
import time

import numpy as np
import onnxruntime
from stemvo.stems import fold, onnx_writer
from stemvo.stems import stem as stem_module

sys.path.append(str(pathlib.Path(__file__).parents[3] / "bench"))
import random_stems  # noqa: E402


def session(stem):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(onnx_writer.to_bytes(onnx_writer.build(stem)), options, providers=["CPUExecutionProvider"])


def test_the_filter_has_the_same_values():
    picture = np.random.default_rng(8).uniform(0, 255, (1, 3, 64, 96)).astype(np.float32)
    for filters in (8, 40, 96, 256):
        stem = random_stems.random_stem(filters, seed=filters)
        for index in (0, filters - 1):
            folded = fold.layer_norm_filter(stem, index)
            # 49 numbers per patch; fewer filters say less. Centred filters: one less again.
            assert len(folded.weights) == min(filters - 1, 49)
            wanted = session(stem).run(None, {onnx_writer.INPUT: picture})[0][0, index]
            found = session(folded).run(None, {onnx_writer.INPUT: picture})[0][0, 0]
            assert np.abs(found - wanted).max() < 1e-4 * wanted.std()


def test_a_folded_filter_costs_a_quarter_at_most():
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
    assert statistics.median(ratios) < 0.25


def test_one_filter_in_rows_is_as_among_others():
    """onnx_writer computes many rows of one filter at a time: the same channel, of the same size."""
    rng = np.random.default_rng(4)
    for kernel, stride, padding in (((8, 8), 2, (3, 3, 3, 3)), ((4, 4), 4, (0, 0, 0, 0)), ((7, 5), 2, (3, 2, 2, 1)), ((3, 3), 1, (1, 1, 1, 1))):
        for planes in (1, 3):
            two = stem_module.Stem(rng.normal(size=(2, planes, *kernel)), rng.normal(size=2), stride, mean=np.full(planes, 90.0) if planes == 3 else np.zeros(1),
                                   padding=padding)
            both, one = (session(stem) for stem in (two, fold.one_filter(two, 1)))
            for size in ((8, 9), (31, 40), (33, 33), (64, 50), (131, 20)):
                feed = {onnx_writer.INPUT: rng.uniform(0, 255, (1, planes, *size)).astype(np.float32)}
                expected, found = both.run(None, feed)[0][:, 1:], one.run(None, feed)[0]
                assert found.shape == expected.shape, (kernel, stride, padding, size)
                assert np.abs(found - expected).max() < 0.01
