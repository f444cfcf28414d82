# SPDX-License-Identifier: MIT
"""Which pixels of the image an output of an ONNX graph looks at, by walking the graph.

Along an axis, output j of a tensor looks at the pixels from stride * j + first to stride * j + last, and an
image of n pixels has floor((n + rest) / stride) + 1 outputs. Convolutions, pools, pads and slices change
these numbers; where branches meet, the window is the union of theirs. Composition of the floors is exact:
floor((floor(a / s) + b) / t) = floor((a + s b) / (s t)).
"""

import dataclasses

import numpy as np
import onnx
from onnx import numpy_helper

from .stem import same_padding


@dataclasses.dataclass(frozen=True)
class Axis:
    stride: int = 1
    first: int = 0
    last: int = 0
    rest: int = -1

    def convolved(self, kernel, stride, before, after):
        return Axis(self.stride * stride, self.first - self.stride * before,
                    self.last + self.stride * (kernel - 1 - before),
                    self.rest + self.stride * (1 + before + after - kernel))

    def united(self, other):
        return Axis(self.stride, min(self.first, other.first), max(self.last, other.last), self.rest)

    @property
    def kernel(self):
        return self.last - min(self.first, 0) + 1

    @property
    def padding(self):
        """Before, after: of the one convolution with the same window and the same sizes."""
        return -min(self.first, 0), self.rest + self.last + 1


@dataclasses.dataclass(frozen=True)
class Field:
    """The window of a tensor. axes: which of its dimensions are y and x. layers: windowed operations on the way."""

    y: Axis = Axis()
    x: Axis = Axis()
    axes: tuple = (2, 3)
    whole_frame: bool = False  # its values also depend on pixels anywhere (squeeze and excitation)
    layers: int = 0


class _WholeFrame:
    """A tensor without y and x that depends on the image."""


WHOLE_FRAME = _WholeFrame()

_POINTWISE = {"Abs", "Add", "BatchNormalization", "Cast", "Ceil", "Clip", "Div", "Dropout", "Elu", "Erf", "Exp", "Floor", "Gelu",
              "HardSigmoid", "HardSwish", "Identity", "LeakyRelu", "Log", "Max", "Min", "Mish", "Mul", "Neg", "PRelu",
              "Pow", "Reciprocal", "Relu", "Selu", "Sigmoid", "Softplus", "Sqrt", "Sub", "Sum", "Swish", "Tanh", "Where"}
_REDUCTIONS = {"ReduceMean", "ReduceSum", "ReduceMax", "ReduceSumSquare", "ReduceL2"}


def _attributes(node):
    return {item.name: onnx.helper.get_attribute_value(item) for item in node.attribute}


def explicit_pads(node, sizes):
    """Pads y, x before then after of a Conv or pool. sizes: of its input (y, x), needed for "same"."""
    given = _attributes(node)
    mode = given.get("auto_pad", b"NOTSET").decode()
    if mode in ("NOTSET", "VALID"):
        return list(given.get("pads", [0, 0, 0, 0])) if mode == "NOTSET" else [0, 0, 0, 0]
    before, after = [], []
    for axis, size in enumerate(sizes):
        kernel = (given["kernel_shape"][axis] - 1) * given.get("dilations", [1, 1])[axis] + 1
        stride = given.get("strides", [1, 1])[axis]
        small, large = same_padding(kernel, stride, size)
        before.append(small if mode == "SAME_UPPER" else large)
        after.append(large if mode == "SAME_UPPER" else small)
    return before + after


class Walk:
    """Fields of all tensors of a graph whose "same" paddings are numbers already."""

    def __init__(self, graph, image, start=Field()):
        self._constants = {item.name: item for item in graph.initializer}
        self.fields = {image: start}
        for node in graph.node:
            if node.op_type == "Constant":
                self._constants[node.output[0]] = next((a.t for a in node.attribute if a.name == "value"), None)
                continue
            self._visit(node)

    def _value(self, name):
        tensor = self._constants.get(name) if name else None
        return None if tensor is None else numpy_helper.to_array(tensor)

    def _visit(self, node):
        inputs = [self.fields[name] for name in node.input if name in self.fields]
        if not inputs:
            return
        known = [item for item in inputs if isinstance(item, Field)]
        problems = [item for item in inputs if isinstance(item, str)]
        if problems:
            result = problems[0]
        elif not known or node.op_type in ("Shape", "Size"):
            result = WHOLE_FRAME
        else:
            try:
                result = self._through(node, known, WHOLE_FRAME in inputs)
            except (KeyError, IndexError, TypeError, ValueError):
                result = f"{node.op_type} {node.name or node.output[0]} of a kind that is not supported"
        for name in node.output:
            self.fields[name] = result

    def _through(self, node, fields, mixed):
        """The field behind a node, or why there is none."""
        kind, first = node.op_type, fields[0]
        if kind in ("Conv", "MaxPool", "AveragePool", "LpPool"):
            return self._windowed(node, first)
        if kind in _POINTWISE or kind in ("Concat", "Split", "Softmax", "LayerNormalization", "LpNormalization", "LRN"):
            return self._meeting(node, fields, mixed)
        if kind == "Transpose":
            order = list(_attributes(node)["perm"])
            return dataclasses.replace(first, axes=tuple(order.index(axis) for axis in first.axes))
        if kind in _REDUCTIONS:
            return self._reduced(node, first)
        if kind in ("GlobalAveragePool", "GlobalMaxPool"):
            return WHOLE_FRAME
        if kind in ("InstanceNormalization", "GroupNormalization"):
            return dataclasses.replace(first, whole_frame=True)
        if kind == "Pad":
            return self._padded(node, first)
        if kind == "Slice":
            return self._sliced(node, first)
        if kind in ("MatMul", "Gemm") and len(fields) == 1 and max(first.axes) < 3:
            return first
        return f"{kind} {node.name or node.output[0]}, behind which a pixel has no place"

    def _windowed(self, node, field):
        given = _attributes(node)
        if field.axes != (2, 3) or given.get("ceil_mode", 0):
            return f"{node.op_type} {node.name or node.output[0]}, which rounds sizes up"
        kernel = given.get("kernel_shape") or self._value(node.input[1]).shape[2:]
        pads = explicit_pads(node, (0, 0))
        axes = []
        for index, axis in enumerate((field.y, field.x)):
            size = (kernel[index] - 1) * given.get("dilations", [1, 1])[index] + 1
            axes.append(axis.convolved(size, given.get("strides", [1, 1])[index], pads[index], pads[index + 2]))
        counts = max(kernel) > 1 or max(given.get("strides", [1])) > 1
        return dataclasses.replace(field, y=axes[0], x=axes[1], layers=field.layers + counts)

    def _meeting(self, node, fields, mixed):
        if any(item.axes != fields[0].axes or item.y.stride != fields[0].y.stride for item in fields):
            return f"{node.op_type} {node.name or node.output[0]}, where tensors of different places meet"
        given = _attributes(node)
        if node.op_type in ("Concat", "Split", "Softmax", "LayerNormalization") and self._touches(given.get("axis", -1), fields[0]):
            return f"{node.op_type} {node.name or node.output[0]} along a side of the picture"
        united = fields[0]
        for item in fields[1:]:
            united = dataclasses.replace(united, y=united.y.united(item.y), x=united.x.united(item.x),
                                         whole_frame=united.whole_frame or item.whole_frame,
                                         layers=max(united.layers, item.layers))
        return dataclasses.replace(united, whole_frame=united.whole_frame or mixed)

    @staticmethod
    def _touches(axis, field):
        return axis % 4 in field.axes

    def _reduced(self, node, field):
        given = _attributes(node)
        axes = given.get("axes")
        if axes is None:
            axes = self._value(node.input[1]) if len(node.input) > 1 else None
        axes = {int(axis) % 4 for axis in axes} if axes is not None else {0, 1, 2, 3}
        if axes & set(field.axes):
            return WHOLE_FRAME if set(field.axes) <= axes else f"{node.op_type} {node.output[0]} along a side of the picture"
        return field if given.get("keepdims", 1) else f"{node.op_type} {node.output[0]}, which drops a dimension"

    def _padded(self, node, field):
        pads = _attributes(node).get("pads")
        pads = np.asarray(pads if pads is not None else self._value(node.input[1]))
        y, x = field.axes
        return dataclasses.replace(field, y=field.y.convolved(1, 1, int(pads[y]), int(pads[y + 4])),
                                   x=field.x.convolved(1, 1, int(pads[x]), int(pads[x + 4])),
                                   layers=field.layers + bool(pads.any()))

    def _sliced(self, node, field):
        starts, ends = self._value(node.input[1]), self._value(node.input[2])
        axes = self._value(node.input[3]) if len(node.input) > 3 else np.arange(len(starts))
        steps = self._value(node.input[4]) if len(node.input) > 4 else np.ones(len(starts), int)
        sides = {"y": field.y, "x": field.x}
        for start, end, axis, step in zip(starts, ends, axes, steps):
            if int(axis) % 4 not in field.axes:
                continue
            side = "y" if int(axis) % 4 == field.axes[0] else "x"
            if start < 0 or step < 1 or -10**6 < end < 0 or 0 <= end < 2**31 - 1:
                return f"Slice {node.name or node.output[0]}, which cuts to a fixed size"
            sides[side] = sides[side].convolved(1, int(step), -int(start), 0)
        return dataclasses.replace(field, layers=field.layers + 1, **sides)

