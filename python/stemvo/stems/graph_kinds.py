# SPDX-License-Identifier: MIT
"""Tells the convolutions of a whole network (.onnx) apart."""


def _shapes_of_constants(model):
    shapes = {item.name: list(item.dims) for item in model.graph.initializer}
    return shapes | {node.output[0]: list(item.t.dims) for node in model.graph.node if node.op_type == "Constant"
                     for item in node.attribute if item.name == "value"}


def kinds_of(model):
    """Output of each convolution -> its kind, in the words of weight_files.Layer: depthwise is one filter per input plane,
    separable the 1x1 convolution of a depthwise one's output (its second half), transposed ConvTranspose."""
    shapes, kinds = _shapes_of_constants(model), {}
    for node in model.graph.node:
        given = {item.name: item for item in node.attribute}
        if node.op_type == "Identity" and node.input[0] in kinds:
            kinds[node.output[0]] = kinds[node.input[0]]
        elif node.op_type == "ConvTranspose":
            kinds[node.output[0]] = "transposed"
        elif node.op_type == "Conv":
            planes, *kernel = shapes.get(node.input[1], (0, 0, 0, 0))[1:]
            groups = given["group"].i if "group" in given else 1
            depthwise = groups > 1 and planes in (0, 1)  # 0: the weights are computed, as of quantised ones
            pointwise = groups == 1 and set(given["kernel_shape"].ints if "kernel_shape" in given else kernel) == {1}
            separable = pointwise and kinds.get(node.input[0]) == "depthwise"
            kinds[node.output[0]] = "depthwise" if depthwise else "separable" if separable else "convolution"
    return kinds


def first_convolution(model):
    """Filters, (height, width) of the kernel and stride of the first convolution of the picture; None where its weights are not in
    the file."""
    shapes = _shapes_of_constants(model)
    for node in model.graph.node:
        if node.op_type == "Conv" and len(shapes.get(node.input[1], ())) == 4 and shapes[node.input[1]][1] == 3:
            filters, _, *kernel = shapes[node.input[1]]
            strides = next((list(item.ints) for item in node.attribute if item.name == "strides"), [1])
            return filters, kernel, strides[0]
    return None
