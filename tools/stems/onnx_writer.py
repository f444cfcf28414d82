# SPDX-License-Identifier: MIT
"""Writes a Stem as the ONNX graph that stemvo reads:

    image 1x3xHxW float, RGB, 0..255  ->  channels 1xCxhxw float      (H, W, h, w are free)

Preprocessing is inside the graph: folded into the convolution where nothing is padded, otherwise a
subtraction before it. Padding is written as numbers, never as "same": that depends on the parity
of the size, and shifts by a pixel when the picture is cropped.
"""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from stems import stem as stem_module

# Old enough for every ONNX Runtime since 1.7: the graph needs nothing newer.
IR_VERSION = 7
OPSET = 13
INPUT = "image"
OUTPUT = "channels"


class _Graph:
    """Nodes in a chain, and their constants."""

    def __init__(self):
        self.nodes, self.constants = [], []
        self.last = INPUT

    def constant(self, name, values):
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(values, np.float32), name))
        return name

    def add(self, kind, output, *constants, inputs=None, **attributes):
        inputs = inputs or [self.last]
        self.nodes.append(helper.make_node(kind, [*inputs, *constants], [output], name=output,
                                           **attributes))
        self.last = output


def _add_layer_norm(graph, layer_norm):
    """On channels whose mean is already zero at every pixel. Plain operators: ONNX Runtime's fused
    LayerNormalization wants the channels last, and two transposes cost more than it saves."""
    column = (1, -1, 1, 1)
    channels = layer_norm.gamma.size
    centred = graph.last
    graph.add("ReduceSumSquare", "power", axes=[1], keepdims=1)
    graph.add("Mul", "variance", graph.constant("one_over_channels", np.full((1, 1, 1, 1), 1.0 / channels)))
    graph.add("Add", "variance_and_epsilon", graph.constant("epsilon", np.full((1, 1, 1, 1), layer_norm.epsilon)))
    graph.add("Sqrt", "deviation")
    graph.add("Div", "normalised", inputs=[centred, "deviation"])
    if not np.all(layer_norm.gamma == 1.0):
        graph.add("Mul", "scaled", graph.constant("gamma", layer_norm.gamma.reshape(column)))
    if not np.all(layer_norm.beta == 0.0):
        graph.add("Add", "shifted", graph.constant("beta", layer_norm.beta.reshape(column)))


def build(stem):
    """The graph of a stem, checked by ONNX."""
    if stem.layer_norm is not None:
        stem = stem_module.fold_layer_norm_mean(stem)
    if not any(stem.padding):
        stem = stem_module.fold_mean(stem)

    graph = _Graph()
    if np.any(stem.mean != 0.0):
        graph.add("Sub", "centred_image", graph.constant("mean", stem.mean.reshape(1, 3, 1, 1)))
    graph.add("Conv", "convolution", graph.constant("weights", stem.weights), graph.constant("bias", stem.bias),
              kernel_shape=list(stem.kernel), strides=[stem.stride, stem.stride], pads=list(stem.padding))
    if stem.layer_norm is not None:
        _add_layer_norm(graph, stem.layer_norm)
    graph.nodes[-1].output[0] = OUTPUT

    image = helper.make_tensor_value_info(INPUT, TensorProto.FLOAT, [1, 3, "H", "W"])
    channels = helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, [1, stem.filters, "h", "w"])
    model = helper.make_model(helper.make_graph(graph.nodes, "stem", [image], [channels], graph.constants),
                              opset_imports=[helper.make_opsetid("", OPSET)], producer_name="stemvo")
    model.ir_version = IR_VERSION
    onnx.checker.check_model(model)
    return model


def write(stem, path):
    """The same stem gives the same bytes."""
    with open(path, "wb") as file:
        file.write(build(stem).SerializeToString(deterministic=True))
