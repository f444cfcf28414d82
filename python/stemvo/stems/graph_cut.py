# SPDX-License-Identifier: MIT
"""Cuts a whole network (.onnx) at a named tensor: image 1x3xHxW, RGB 0..255 -> the layer asked for.

onnx.utils.Extractor takes the nodes that the layer needs. Preprocessing goes in front of them; "same" paddings, which depend on the
size of the picture, become numbers; a network whose pictures have their colours last gets a transposition.
"""

import contextlib
import dataclasses
import tempfile

import numpy as np
import onnx
import onnx.utils
import onnxruntime
from onnx import TensorProto, compose, helper, numpy_helper, shape_inference

from . import onnx_writer, receptive_field
from .weights import WeightsError

_ANY_SIZE = (256, 256)  # width, height: even at every level


@contextlib.contextmanager
def refusing_unsound(path, expected="a sound graph"):
    """Turns what a damaged or strange graph makes these modules stumble over into an error of one line."""
    try:
        yield
    except WeightsError:
        raise
    except Exception as error:  # noqa: BLE001  protobuf's and the runtime's own types differ between their versions
        raise WeightsError(f"{path}: expected {expected}, found: {' '.join(str(error).split())[:200] or type(error).__name__}") from error


@dataclasses.dataclass(frozen=True)
class CutLayer:
    """The output of the cut graph."""

    name: str
    filters: int
    field: receptive_field.Field

    @property
    def kernel(self):
        return (self.field.y.kernel, self.field.x.kernel)

    @property
    def stride(self):
        return self.field.y.stride

    @property
    def padding(self):
        (top, bottom), (left, right) = self.field.y.padding, self.field.x.padding
        return (top, left, bottom, right)

    @property
    def sampling(self):
        """Only of a single convolution is it certain that passes over a shifted frame fit together."""
        return "any" if self.field.layers <= 1 and not self.field.whole_frame else "native"


def read(path):
    """The model."""
    if not path.is_file():
        raise WeightsError(f"{path}: expected an .onnx file, found {'a folder' if path.is_dir() else 'nothing'}")
    with refusing_unsound(path, "an .onnx file"):
        model = onnx.load(path)
        onnx.checker.check_model(model)
    if not model.graph.node:
        raise WeightsError(f"{path}: expected an .onnx file, found an empty graph")
    return model


def _image_input(path, model):
    """Name of the network's input, and whether its colours are the last dimension."""
    constants = {item.name for item in model.graph.initializer}
    inputs = [item for item in model.graph.input if item.name not in constants]
    shapes = [[size.dim_value if size.HasField("dim_value") else None for size in item.type.tensor_type.shape.dim]
              for item in inputs]
    if len(inputs) != 1 or len(shapes[0]) != 4 or 3 not in (shapes[0][1], shapes[0][3]):
        found = ", ".join(f"{item.name} {'x'.join(str(size or '?') for size in shape)}" for item, shape in zip(inputs, shapes))
        raise WeightsError(f"{path}: expected one input 1x3xHxW or 1xHxWx3, found {found or 'none'}")
    if inputs[0].type.tensor_type.elem_type != TensorProto.FLOAT:
        raise WeightsError(f"{path}: expected an input of type float, found another")
    # A tensor of the network that has our input's name gets another one.
    compose.add_prefix_graph(model.graph, "", *[False] * 6, inplace=True, name_map={onnx_writer.INPUT: f"network/{onnx_writer.INPUT}"})
    return inputs[0].name, shapes[0][1] != 3


def _extracted(model, image, colours_last, tensors, size=None):
    """The part of a network that the tensors need, for pictures of one size (width, height) or any."""
    sides = ["H", "W"] if size is None else [size[1], size[0]]
    whole = onnx.ModelProto()
    whole.CopyFrom(model)
    for values in (whole.graph.value_info, whole.graph.input, whole.graph.output):
        del values[:]  # sizes that the exporter wrote down for its own example, too
    whole.graph.input.append(helper.make_tensor_value_info(image, TensorProto.FLOAT, [1, *sides, 3] if colours_last else [1, 3, *sides]))
    whole.graph.output.extend(helper.make_tensor_value_info(tensor, TensorProto.FLOAT, None) for tensor in tensors)
    return onnx.utils.Extractor(whole).extract_model([image], list(tensors))


def _shapes(model):
    """Tensor -> its shape (None where unknown)."""
    inferred = shape_inference.infer_shapes(model, data_prop=True)
    return {item.name: [size.dim_value if size.HasField("dim_value") else None for size in item.type.tensor_type.shape.dim]
            for item in [*inferred.graph.value_info, *inferred.graph.output, *inferred.graph.input]}


def _start(colours_last):
    return receptive_field.Field(axes=(1, 2) if colours_last else (2, 3))


def filters_of(shape, field):
    """The dimension of a tensor of four that is neither y nor x, by its Field."""
    return shape[next(axis for axis in (1, 2, 3) if axis not in field.axes)] if len(shape or []) == 4 else None


def layers_at(path, model, size):
    """Node, filters of its output (None where that is no tensor of pictures or numbers), for pictures of one size."""
    image, colours_last = _image_input(path, model)
    outputs = [node.output[0] for node in model.graph.node]
    shapes = _shapes(_extracted(model, image, colours_last, outputs, size or _ANY_SIZE))
    fields = receptive_field.Walk(model.graph, image, _start(colours_last)).fields
    found = []
    for node, output in zip(model.graph.node, outputs):
        shape, field = shapes.get(output) or [], fields.get(output)
        plain = shape[1] if len(shape) == 4 else shape[-1] if len(shape) > 1 else None
        found.append((node, filters_of(shape, field) if isinstance(field, receptive_field.Field) else plain))
    return found


def _make_paddings_numbers(model, shapes):
    """shapes: of all tensors for one size of picture."""
    for node in model.graph.node:
        mode = next((item for item in node.attribute if item.name == "auto_pad"), None)
        if mode is None or mode.s in (b"NOTSET", b""):
            continue
        if not any(item.name == "kernel_shape" for item in node.attribute):
            weights = next(item for item in model.graph.initializer if item.name == node.input[1])
            node.attribute.append(helper.make_attribute("kernel_shape", list(weights.dims[2:])))
        pads = receptive_field.explicit_pads(node, [size or 0 for size in shapes[node.input[0]][2:]])
        kept = [item for item in node.attribute if item.name not in ("auto_pad", "pads")]
        del node.attribute[:]
        node.attribute.extend([*kept, helper.make_attribute("pads", pads)])


def _without_size_arithmetic(model):
    """A model of one size, with numbers where the graph computes them from the size of its picture (timm's "same" padding)."""
    with tempfile.TemporaryDirectory() as folder:
        options = _silent()
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
        options.optimized_model_filepath = f"{folder}/constant.onnx"
        onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
        return onnx.load(options.optimized_model_filepath)


def _find(path, model, name):
    """A tensor by its own name or its node's."""
    outputs = {output: output for node in model.graph.node for output in node.output if output}
    by_node = {node.name: node.output[0] for node in model.graph.node if node.name}
    if name in outputs or name in by_node:
        return outputs.get(name) or by_node[name]
    convolutions = [node.output[0] for node in model.graph.node if node.op_type == "Conv"]
    raise WeightsError(f"{path}: --layers: expected the network's layers (--list shows all {len(outputs)}), such as "
                       f"{', '.join(convolutions[:8])}; found {name!r}")


def _preprocessing_nodes(fed, target, colours_last):
    """image -> target: (image - mean) / std, planes reversed for BGR."""
    nodes, constants, last = [], [], onnx_writer.INPUT

    def add(kind, *more, **attributes):
        nonlocal last
        output = f"stemvo_{kind.lower()}"
        nodes.append(helper.make_node(kind, [last, *more], [output], **attributes))
        last = output

    for kind, values, neutral in (("Sub", fed.mean, 0.0), ("Div", fed.std, 1.0)):
        if any(value != neutral for value in values):
            name = f"stemvo_{kind.lower()}_by"
            constants.append(numpy_helper.from_array(np.array(values, np.float32).reshape(1, 3, 1, 1), name))
            add(kind, name)
    if fed.takes_bgr:
        constants.append(numpy_helper.from_array(np.array([2, 1, 0], np.int64), "stemvo_bgr"))
        add("Gather", "stemvo_bgr", axis=1)
    if colours_last:
        add("Transpose", perm=[0, 2, 3, 1])
    nodes.append(helper.make_node("Identity", [last], [target]))
    return nodes, constants


def _output_nodes(path, tensor, field, shape, filter_index):
    """Nodes and constants behind a tensor, name and filters of what they give: its colours second, one channel where one is asked for."""
    if not isinstance(field, receptive_field.Field):
        why = f"behind {field}" if isinstance(field, str) else "without the picture's height and width"
        raise WeightsError(f"{path}: {tensor}: expected a layer of pictures, found one {why}")
    filters = filters_of(shape, field)
    if not filters:
        raise WeightsError(f"{path}: {tensor}: expected a known number of filters, found none")
    if filter_index is not None and not 0 <= filter_index < filters:
        raise WeightsError(f"{path}: {tensor}: --filter: expected 0 to {filters - 1}, found {filter_index}")
    nodes, constants = [], []
    if field.axes != (2, 3):
        nodes.append(helper.make_node("Transpose", [tensor], [f"{tensor}/planes"], perm=[0, ({1, 2, 3} - set(field.axes)).pop(), *field.axes]))
        tensor = f"{tensor}/planes"
    if filter_index is not None:
        name = f"{tensor}/filter_{filter_index}"
        constants.append(numpy_helper.from_array(np.array([filter_index], np.int64), f"{name}/index"))
        nodes.append(helper.make_node("Gather", [tensor, f"{name}/index"], [name], axis=1))
        tensor, filters = name, 1
    return nodes, constants, tensor, filters


def cut(path, name, fed, size=None, filter_index=None):
    """The cut model and its layer. size: width, height: "same" paddings are for pictures of its parity (None: even at every level)."""
    model = read(path)
    image, colours_last = _image_input(path, model)
    tensor = _find(path, model, name)
    body = _extracted(model, image, colours_last, [tensor])
    if any(node.op_type == "Shape" for node in body.graph.node):
        body = _without_size_arithmetic(_extracted(body, image, colours_last, [tensor], size or _ANY_SIZE))
    shapes = _shapes(_extracted(body, image, colours_last, [tensor], size or _ANY_SIZE))
    _make_paddings_numbers(body, shapes)
    field = receptive_field.Walk(body.graph, image, _start(colours_last)).fields.get(tensor)
    front, constants = _preprocessing_nodes(fed, image, colours_last)
    behind, more, output, filters = _output_nodes(path, tensor, field, shapes.get(tensor), filter_index)
    layer = CutLayer(output, filters, field)
    graph = helper.make_graph([*front, *body.graph.node, *behind], "layer",
                              [helper.make_tensor_value_info(onnx_writer.INPUT, TensorProto.FLOAT, [1, 3, "H", "W"])],
                              [helper.make_tensor_value_info(output, TensorProto.FLOAT, [1, filters, None, None])],
                              [*constants, *body.graph.initializer, *more])
    cut_model = helper.make_model(graph, opset_imports=model.opset_import, functions=body.functions, producer_name="stemvo",
                                  ir_version=model.ir_version)
    onnx.checker.check_model(cut_model)
    _check_sizes(path, cut_model, layer)
    return cut_model, layer


def _check_sizes(path, model, layer):
    """Runs the graph on noise of two sizes. Error: its output is not what its window says."""
    (top, left, bottom, right), (rows, columns), stride = layer.padding, layer.kernel, layer.stride
    small = max(6 * stride, 96)
    for width, height in ((small + stride - 1, small + stride // 2), (small + stride, small)):
        image = np.random.default_rng(1).uniform(0, 255, (1, 3, height, width)).astype(np.float32)
        with refusing_unsound(path, f"a network that takes pictures of any size, {width}x{height} too"):
            session = onnxruntime.InferenceSession(model.SerializeToString(), _silent(), providers=["CPUExecutionProvider"])
            (output,) = session.run(None, {onnx_writer.INPUT: image})
        expected = (1, layer.filters, (height + top + bottom - rows) // stride + 1, (width + left + right - columns) // stride + 1)
        if output.shape != expected or not np.all(np.isfinite(output)):
            raise WeightsError(f"{path}: {layer.name}: expected {'x'.join(map(str, expected))} finite numbers of a picture of {width}x{height}, "
                               f"found {'x'.join(map(str, output.shape))}" + ("" if output.shape != expected else " with NaN or infinity"))


def _silent():
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    return options
