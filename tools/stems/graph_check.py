# SPDX-License-Identifier: MIT
"""Runs a cut graph and holds the sizes of its outputs against the manifest's kernel, stride and padding."""

import numpy as np
import onnx
import onnxruntime

from stems import onnx_writer
from stems.weights import WeightsError


def _expected(layer, size):
    (top, left, bottom, right), (rows, columns) = layer.padding, layer.kernel
    return ((size[1] + top + bottom - rows) // layer.stride + 1, (size[0] + left + right - columns) // layer.stride + 1)


def session(model):
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    return onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])


def _problem(running, layers, size):
    """What is wrong on a picture of this size; None if nothing."""
    image = np.random.default_rng(1).uniform(0, 255, (1, 3, size[1], size[0])).astype(np.float32)
    try:
        outputs = running.run([layer.name for layer in layers], {onnx_writer.INPUT: image})
    except Exception as error:  # noqa: BLE001  the runtime's own types differ between its versions
        return " ".join(str(error).split())[:200]
    for layer, output in zip(layers, outputs):
        expected = (1, layer.filters, *_expected(layer, size))
        if output.shape != expected:
            return f"{layer.name}: expected {'x'.join(map(str, expected))}, found {'x'.join(map(str, output.shape))}"
        if not np.all(np.isfinite(output)):
            return f"{layer.name}: NaN or infinity on a picture of noise"
    return None


def checked(path, model, layers, size):
    """The model, with its input's size fixed where it takes one size only (then `size`, width and height, is needed).
    Error: its outputs are not what their windows say."""
    stride = max(layer.stride for layer in layers)
    small = max(6 * stride, 96)
    problem = None
    try:
        running = session(model)
    except Exception as error:  # noqa: BLE001
        problem = " ".join(str(error).split())[:200]
    for free in ((small + stride - 1, small + stride // 2), (small + stride, small)):
        problem = problem or _problem(running, layers, free)
    if problem is None:
        return model
    if size is None:
        raise WeightsError(f"{path}: expected a network that takes pictures of any size (one of a single size needs "
                           f"--size WxH), found at {free[0]}x{free[1]}: {problem}")
    del model.graph.input[:]
    model.graph.input.append(onnx.helper.make_tensor_value_info(onnx_writer.INPUT, onnx.TensorProto.FLOAT,
                                                                [1, 3, size[1], size[0]]))
    try:
        problem = _problem(session(model), layers, size)
    except Exception as error:  # noqa: BLE001
        problem = " ".join(str(error).split())[:200]
    if problem is not None:
        raise WeightsError(f"{path}: expected a network that takes pictures of {size[0]}x{size[1]}, found: {problem}")
    return model
