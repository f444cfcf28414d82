# SPDX-License-Identifier: MIT
"""Writes a Stem as the ONNX graph that stemvo reads:

    image 1x3xHxW float, RGB, 0..255  ->  channels 1xCxhxw float      (H, W, h, w are free)

A stem whose weights have one plane takes gray instead, 1x1xHxW.

Preprocessing is inside the graph: folded into the convolution where nothing is padded, otherwise a
subtraction before it. Padding is written as numbers, never as "same": that depends on the parity
of the size, and shifts by a pixel when the picture is cropped.
"""

import dataclasses

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from . import fold
from . import stem as stem_module

# Old enough for every ONNX Runtime since 1.7: the graph needs nothing newer.
IR_VERSION = 7
OPSET = 13
INPUT = "image"
OUTPUT = "channels"

# Rows of one filter that are computed as that many filters: a block of ONNX Runtime's convolutions with AVX-512, two with AVX2.
ROWS = 16


class _Graph:
    """Nodes in a chain, and their constants."""

    def __init__(self):
        self.nodes, self.constants = [], []
        self.last = INPUT

    def constant(self, name, values, kind=np.float32):
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(values, kind), name))
        return name

    def integers(self, name, values):
        return self.constant(name, values, np.int64)

    def add(self, kind, output, *constants, inputs=None, **attributes):
        """inputs: names of earlier outputs (default: of the last one)."""
        names = [*(inputs or []), *constants]
        self.nodes.append(helper.make_node(kind, names if inputs else [self.last, *names], [output], name=output,
                                           **attributes))
        self.last = output


def _add_layer_norm(graph, layer_norm, pick):
    """On channels whose mean is already zero at every pixel. Plain operators: ONNX Runtime's fused
    LayerNormalization wants the channels last, and two transposes cost more than it saves.
    pick: this filter only, if not None; the others are needed for the division alone."""
    column = (1, -1, 1, 1)
    channels = layer_norm.gamma.size
    own = slice(None)
    if pick is None:
        graph.add("ReduceSumSquare", "power", axes=[1], keepdims=1)
        graph.add("Mul", "variance", graph.constant("one_over_channels", np.full((1, 1, 1, 1), 1.0 / channels)))
        graph.add("Add", "variance_and_epsilon", graph.constant("epsilon", np.full((1, 1, 1, 1), layer_norm.epsilon)))
        graph.add("Sqrt", "deviation")
    else:
        own = slice(pick, pick + 1)
        _add_length(graph, "convolution", channels, 1.0 / channels, layer_norm.epsilon, "deviation")
        _add_slice(graph, "own", pick, inputs=["convolution"])
    graph.add("Div", "normalised", inputs=["convolution" if pick is None else "own", "deviation"])
    if not np.all(layer_norm.gamma == 1.0):
        graph.add("Mul", "scaled", graph.constant("gamma", layer_norm.gamma[own].reshape(column)))
    if not np.all(layer_norm.beta == 0.0):
        graph.add("Add", "shifted", graph.constant("beta", layer_norm.beta[own].reshape(column)))


def _add_length(graph, planes, count, weight, floor, output):
    """sqrt(weight * sum over the planes of their squares + floor). The sum is a convolution 1x1: a run over a few rows of
    the picture then takes two thirds of the time with ReduceSumSquare, which goes over the planes pixel by pixel."""
    graph.add("Mul", "squares", inputs=[planes, planes])
    graph.add("Conv", "power", graph.constant("sum", np.full((1, count, 1, 1), weight)), graph.constant("floor", np.full(1, floor)),
              kernel_shape=[1, 1])
    graph.add("Sqrt", output)


def _add_slice(graph, output, channel, inputs=None):
    """One channel."""
    graph.add("Slice", output, *(graph.integers(name, [value]) for name, value in
                                 (("from", channel), ("to", channel + 1), ("axis", 1))), inputs=inputs)


def _add_folded(graph, stem):
    """See fold.py: one channel, divided by the length of all rows."""
    graph.add("Conv", "rows", graph.constant("weights", stem.weights), graph.constant("bias", stem.bias),
              kernel_shape=list(stem.kernel), strides=[stem.stride, stem.stride], pads=list(stem.padding))
    _add_length(graph, "rows", len(stem.weights), 1.0, stem.floor, "length")
    _add_slice(graph, "own", 0, inputs=["rows"])
    graph.add("Div", "normalised", inputs=["own", "length"])
    graph.add("Mul", "scaled", graph.constant("gain", np.full((1, 1, 1, 1), stem.gain)))
    graph.add("Add", "shifted", graph.constant("shift", np.full((1, 1, 1, 1), stem.shift)))


def _add_rows(graph, stem):
    """One filter, ROWS rows of its channel at a time. ONNX Runtime copies each pixel's patch to multiply one filter with it,
    which takes longer than the product. Filters that see the rows of all ROWS, each its own shifted down, need no copy, and
    make the same numbers: for 8x8 at stride 2, 38 rows instead of 8, in a third of the time."""
    _, planes, height, width = stem.weights.shape
    top, left, bottom, right = stem.padding
    below = stem.stride * (ROWS - 1)
    weights = np.zeros((ROWS, planes, height + below, width))
    for row in range(ROWS):
        weights[row, :, stem.stride * row:stem.stride * row + height] = stem.weights[0]
    image = graph.last
    graph.add("Conv", "blocks", graph.constant("weights", weights), graph.constant("bias", np.repeat(stem.bias, ROWS)),
              kernel_shape=[height + below, width], strides=[stem.stride * ROWS, stem.stride], pads=[top, left, bottom + below, right])
    graph.add("Transpose", "rows", perm=[0, 2, 1, 3])  # 1 x blocks x ROWS x w
    graph.add("Reshape", "all_rows", graph.integers("one_plane", [1, 1, -1, 0]))
    graph.last = image
    graph.add("Shape", "size")
    graph.add("Gather", "height", graph.integers("of_rows", [2]))
    graph.add("Add", "room", graph.integers("beside_the_kernel", [top + bottom - height + stem.stride]))
    graph.add("Div", "count", graph.integers("stride", [stem.stride]))
    graph.add("Slice", "filtered", graph.integers("axis", [2]), inputs=["all_rows", graph.integers("first", [0]), "count"])


def _add_stem(graph, stem, pick):
    if stem.layer_norm is not None:
        stem = stem_module.fold_layer_norm_mean(stem)
    if not any(stem.padding):
        stem = stem_module.fold_mean(stem)
    if np.any(stem.mean != 0.0):
        graph.add("Sub", "centred_image", graph.constant("mean", stem.mean.reshape(1, 3, 1, 1)))
    if stem.repeats_border and any(stem.padding):
        top, left, bottom, right = stem.padding
        graph.add("Pad", "padded", graph.integers("around", [0, 0, top, left, 0, 0, bottom, right]), mode="edge")
        stem = dataclasses.replace(stem, padding=(0, 0, 0, 0))
    if stem.filters == 1 and stem.layer_norm is None:
        _add_rows(graph, stem)
        return
    graph.add("Conv", "convolution", graph.constant("weights", stem.weights), graph.constant("bias", stem.bias),
              kernel_shape=list(stem.kernel), strides=[stem.stride, stem.stride], pads=list(stem.padding))
    if stem.layer_norm is not None:
        _add_layer_norm(graph, stem.layer_norm, pick)
    elif pick is not None:
        _add_slice(graph, "picked", pick)


def build(stem, pick=None):
    """The graph of a stem or a FoldedStem, checked by ONNX. pick: this filter only, of all that are computed."""
    graph = _Graph()
    if isinstance(stem, fold.FoldedStem):
        _add_folded(graph, stem)
    else:
        _add_stem(graph, stem, pick)
    graph.nodes[-1].output[0] = OUTPUT
    channels = helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, [1, stem.filters if pick is None else 1, "h", "w"])
    image = helper.make_tensor_value_info(INPUT, TensorProto.FLOAT, [1, stem.weights.shape[1], "H", "W"])
    model = helper.make_model(helper.make_graph(graph.nodes, "stem", [image], [channels], graph.constants),
                              opset_imports=[helper.make_opsetid("", OPSET)], producer_name="stemvo")
    model.ir_version = IR_VERSION
    onnx.checker.check_model(model)
    return model


def to_bytes(model):
    """The same model gives the same bytes."""
    return model.SerializeToString(deterministic=True)
