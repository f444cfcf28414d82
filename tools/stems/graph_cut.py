# SPDX-License-Identifier: MIT
"""Cuts a whole network (.onnx) at named tensors: image 1x3xHxW, RGB 0..255 -> the layers asked for.

Preprocessing goes in front; "same" paddings, which depend on the size of the picture, and weights that are
computed become numbers; a network whose pictures have their colours last gets a transposition.
"""

import contextlib
import dataclasses
import difflib
import tempfile

import numpy as np
import onnx
import onnxruntime
from google.protobuf.message import DecodeError
from onnx import TensorProto, compose, helper, numpy_helper, shape_inference

from stems import graph_check, onnx_writer, receptive_field
from stems.weights import WeightsError


@contextlib.contextmanager
def refusing_unsound(path):
    """Turns what a damaged graph makes these modules stumble over into an error of one line."""
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, StopIteration, RecursionError, TypeError, ValueError, RuntimeError,
            onnx.checker.ValidationError, shape_inference.InferenceError) as error:
        raise WeightsError(f"{path}: expected a sound graph, found: {' '.join(str(error).split())[:200] or type(error).__name__}") from error


@dataclasses.dataclass(frozen=True)
class CutLayer:
    """One output of the cut graph."""

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
    """The model. Errors: unreadable, not one picture in."""
    if not path.is_file():
        raise WeightsError(f"{path}: expected an .onnx file, found {'a folder' if path.is_dir() else 'nothing'}")
    try:
        model = onnx.load(path)
        onnx.checker.check_model(model)
    except (OSError, DecodeError, ValueError, onnx.checker.ValidationError) as error:
        raise WeightsError(f"{path}: expected an .onnx file, found: {' '.join(str(error).split())[:200]}") from error
    if not model.graph.node:
        raise WeightsError(f"{path}: expected an .onnx file, found an empty graph")
    return model


def _free_our_input(graph):
    """Gives a tensor of the network that has our input's name another one."""
    compose.add_prefix_graph(graph, "", *[False] * 6, inplace=True, name_map={onnx_writer.INPUT: f"network/{onnx_writer.INPUT}"})


def _image_input(path, model):
    constants = {item.name for item in model.graph.initializer}
    inputs = [item for item in model.graph.input if item.name not in constants]
    shapes = [[size.dim_value if size.HasField("dim_value") else None for size in item.type.tensor_type.shape.dim]
              for item in inputs]
    if len(inputs) == 1 and len(shapes[0]) == 4 and 3 in (shapes[0][1], shapes[0][3]):
        _free_our_input(model.graph)
        return inputs[0], shapes[0][1] != 3
    found = ", ".join(f"{item.name} {'x'.join(str(size or '?') for size in shape)}" for item, shape in zip(inputs, shapes))
    raise WeightsError(f"{path}: expected one input 1x3xHxW or 1xHxWx3, found {found or 'none'}")


def _set_input(model, image, colours_last, size):
    """size: width, height, or None for any."""
    sides = ["H", "W"] if size is None else [size[1], size[0]]
    shape = [1, *sides, 3] if colours_last else [1, 3, *sides]
    index = list(model.graph.input).index(image)
    fixed = helper.make_tensor_value_info(image.name, image.type.tensor_type.elem_type, shape)
    model.graph.input[index].CopyFrom(fixed)


def infer(model):
    """Tensor -> its shape (None where unknown), after shape inference."""
    inferred = shape_inference.infer_shapes(model, data_prop=True)
    return {item.name: [size.dim_value if size.HasField("dim_value") else None for size in item.type.tensor_type.shape.dim]
            for item in [*inferred.graph.value_info, *inferred.graph.output, *inferred.graph.input]}


def _with_free_sizes(model, image, colours_last):
    """A copy without the sizes that the exporter wrote down for its own example."""
    copy = onnx.ModelProto()
    copy.CopyFrom(model)
    del copy.graph.value_info[:]
    for output in copy.graph.output:
        output.type.tensor_type.ClearField("shape")
    _set_input(copy, next(item for item in copy.graph.input if item.name == image.name), colours_last, None)
    return copy


def _at_size(model, image, colours_last, size):
    """A copy for pictures of one size (width, height)."""
    copy = _with_free_sizes(model, image, colours_last)
    _set_input(copy, next(item for item in copy.graph.input if item.name == image.name), colours_last, size)
    return copy


def filters_of(shape, field):
    """Of a tensor of four dimensions with its Field: the one that is neither y nor x."""
    if len(shape or []) != 4:
        return None
    return shape[next(axis for axis in (1, 2, 3) if axis not in field.axes)]


def layers_at(path, model, size):
    """Node, filters of its output (None where that is no tensor of pictures or numbers), for pictures of one size."""
    image, colours_last = _image_input(path, model)
    shapes = infer(_at_size(model, image, colours_last, size))
    copy = onnx.ModelProto()
    copy.CopyFrom(model)
    _make_paddings_numbers(copy, shapes)
    walk = receptive_field.Walk(copy.graph, image.name, _start(colours_last))
    found = []
    for node in copy.graph.node:
        shape, field = shapes.get(node.output[0]) or [], walk.fields.get(node.output[0])
        plain = shape[1] if len(shape) == 4 else shape[-1] if len(shape) > 1 else None
        found.append((node, filters_of(shape, field) if isinstance(field, receptive_field.Field) else plain))
    return found


def _start(colours_last):
    return receptive_field.Field(axes=(1, 2) if colours_last else (2, 3))


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


def _find(path, model, names):
    """Tensors by their own name or their node's."""
    outputs = {output: output for node in model.graph.node for output in node.output if output}
    by_node = {node.name: node.output[0] for node in model.graph.node if node.name}
    found = []
    for name in names:
        tensor = outputs.get(name) or by_node.get(name)
        if tensor is None:
            convolutions = [node.output[0] for node in model.graph.node if node.op_type == "Conv"]
            near = difflib.get_close_matches(name, outputs, n=3) or convolutions[:8]
            raise WeightsError(f"{path}: --layers: expected the network's layers (--list shows all {len(outputs)}), such as "
                               f"{', '.join(near)}; found {name!r}")
        found.append(tensor)
    return found


def _reads(node):
    """Names of the tensors it is given, and those of the nodes inside it."""
    inside = (inner for attribute in node.attribute for inner in attribute.g.node)
    return {name for name in node.input if name}.union(*map(_reads, inside))


def _needed(graph, tensors):
    """Nodes that the tensors depend on, in order."""
    wanted, kept = set(tensors), []
    for node in reversed(graph.node):
        if wanted & set(node.output):
            kept.append(node)
            wanted |= _reads(node)
    return kept[::-1], wanted


def _compute_constants(path, model, image, tensors):
    """Weights in place of the nodes that compute them from others (quantised, standardised ones), which stemvo refuses."""
    variable, constant, kept = {image.name}, [], []
    for node in _needed(model.graph, tensors)[0]:
        depends = not variable.isdisjoint(_reads(node))
        (kept if depends else constant).append(node)
        variable |= set(node.output) if depends else set()
    wanted = set(tensors).union(*map(_reads, kept))
    names = [name for node in constant for name in node.output if name in wanted]
    if not names:
        return
    given = set().union(*map(_reads, constant))
    graph = helper.make_graph(constant, "constants", [], [helper.make_empty_tensor_value_info(name) for name in names],
                              [item for item in model.graph.initializer if item.name in given])
    try:
        values = graph_check.session(helper.make_model(graph, opset_imports=model.opset_import, functions=model.functions,
                                                       ir_version=model.ir_version)).run(names, {})
        model.graph.initializer.extend(map(numpy_helper.from_array, values, names))
    except Exception as error:  # noqa: BLE001  the runtime's own types differ between its versions
        raise WeightsError(f"{path}: {names[0]}: expected weights that ONNX Runtime computes, found: "
                           f"{' '.join(str(error).split())[:200]}") from error
    del model.graph.node[:]
    model.graph.node.extend(kept)


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


def _picked(nodes, constants, tensor, filter_index):
    """Nodes that give one channel of a tensor: of a convolution's weights, else a slice behind it."""
    name = f"{tensor}/filter_{filter_index}"
    constants.append(numpy_helper.from_array(np.array([filter_index], np.int64), f"{name}/index"))
    nodes.append(helper.make_node("Gather", [tensor, f"{name}/index"], [name], axis=1))
    return name


def _without_size_arithmetic(path, model, tensors):
    """What a graph computes from the size of its picture (timm's "same" padding) as numbers, for a model of one size."""
    del model.graph.output[:]
    model.graph.output.extend(helper.make_empty_tensor_value_info(name) for name in tensors)
    for output in model.graph.output:
        output.type.tensor_type.elem_type = TensorProto.FLOAT
    with tempfile.TemporaryDirectory() as folder:
        options = onnxruntime.SessionOptions()
        options.log_severity_level = 4
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
        options.optimized_model_filepath = f"{folder}/constant.onnx"
        try:
            onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
            return onnx.load(options.optimized_model_filepath)
        except Exception as error:  # noqa: BLE001  the runtime's own types differ between its versions
            raise WeightsError(f"{path}: expected a graph that ONNX Runtime loads, found: "
                               f"{' '.join(str(error).split())[:200]}") from error


def cut(path, model, names, fed, size=None, filter_index=None):
    """The cut model and its layers. size: width, height: "same" paddings are for pictures of its parity (None:
    even at every level), and where the graph takes one size only, it is this one."""
    image, colours_last = _image_input(path, model)
    tensors = _find(path, model, names)
    if image.type.tensor_type.elem_type != TensorProto.FLOAT:
        raise WeightsError(f"{path}: expected an input of type float, found another")
    if any(node.op_type == "Shape" for node in _needed(model.graph, tensors)[0]):
        model = _without_size_arithmetic(path, _at_size(model, image, colours_last, size or (256, 256)), tensors)
        image = next(item for item in model.graph.input if item.name == image.name)
    _compute_constants(path, model, image, tensors)
    copy = _with_free_sizes(model, image, colours_last)
    shapes = infer(_at_size(model, image, colours_last, size or (256, 256)))
    _make_paddings_numbers(copy, shapes)
    nodes, wanted = _needed(copy.graph, tensors)
    if image.name not in wanted:
        raise WeightsError(f"{path}: {tensors[0]}: expected a layer of the picture, found one that does not depend on it")
    body = helper.make_graph(nodes, "body", [], [], [item for item in copy.graph.initializer if item.name in wanted])
    walk = receptive_field.Walk(body, image.name, _start(colours_last))
    layers, outputs = [], []
    front, constants = _preprocessing_nodes(fed, image.name, colours_last)
    nodes, constants = [*front, *nodes], [*constants, *body.initializer]
    for tensor in tensors:
        field = walk.fields.get(tensor)
        if not isinstance(field, receptive_field.Field):
            why = f"behind {field}" if isinstance(field, str) else "without the picture's height and width"
            raise WeightsError(f"{path}: {tensor}: expected a layer of pictures, found one {why}")
        output, filters = _as_output(nodes, constants, tensor, field, shapes, filter_index, path)
        layers.append(CutLayer(output, filters, field))
        outputs.append(helper.make_tensor_value_info(output, TensorProto.FLOAT, [1, filters, None, None]))
    return _assembled(copy, nodes, constants, outputs), layers


def _as_output(nodes, constants, tensor, field, shapes, filter_index, path):
    """Name and filters of the output for a tensor: its colours second, one channel where one is asked for."""
    filters = filters_of(shapes.get(tensor), field)
    if not filters:
        raise WeightsError(f"{path}: {tensor}: expected a known number of filters, found none (a network of a single size "
                           f"needs its --size WxH)")
    if field.axes != (2, 3):
        nodes.append(helper.make_node("Transpose", [tensor], [f"{tensor}/planes"], perm=[0, ({1, 2, 3} - set(field.axes)).pop(), *field.axes]))
        tensor = f"{tensor}/planes"
    if filter_index is not None:
        if not 0 <= filter_index < filters:
            raise WeightsError(f"{path}: {tensor}: --filter: expected 0 to {filters - 1}, found {filter_index}")
        return _picked(nodes, constants, tensor, filter_index), 1
    return tensor, filters


def _assembled(model, nodes, constants, outputs):
    image = helper.make_tensor_value_info(onnx_writer.INPUT, TensorProto.FLOAT, [1, 3, "H", "W"])
    graph = helper.make_graph(nodes, "layers", [image], outputs, constants)
    cut_model = helper.make_model(graph, opset_imports=model.opset_import, functions=model.functions, producer_name="stemvo")
    cut_model.ir_version = model.ir_version
    onnx.checker.check_model(cut_model)
    return cut_model
