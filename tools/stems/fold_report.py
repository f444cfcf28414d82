# SPDX-License-Identifier: MIT
"""How far a folded filter is from the same filter of the full stem, over frames, both through ONNX Runtime."""

import dataclasses

import numpy as np
import onnxruntime

from stems import onnx_writer


@dataclasses.dataclass(frozen=True)
class Difference:
    """In standard deviations of the channel over all frames."""

    frames: int
    largest: float
    p99: float

    def __str__(self):
        return f"over {self.frames} frames: p99 {self.p99:.3g}, maximum {self.largest:.3g} of the channel's standard deviation"


def session(model, threads=1):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = threads
    return onnxruntime.InferenceSession(onnx_writer.to_bytes(model), options, providers=["CPUExecutionProvider"])


def difference(full, folded, index, pictures):
    """full: model of all filters, folded: of filter `index` alone."""
    full, folded = session(full), session(folded)
    errors, values = [], []
    for picture in pictures:
        feed = {onnx_writer.INPUT: picture[None]}
        expected = full.run(None, feed)[0][0, index].astype(np.float64)
        errors.append(np.abs(folded.run(None, feed)[0][0, 0] - expected).ravel())
        values.append(expected.ravel())
    errors, deviation = np.concatenate(errors), np.std(np.concatenate(values))
    return Difference(len(values), float(errors.max() / deviation), float(np.percentile(errors, 99) / deviation))
