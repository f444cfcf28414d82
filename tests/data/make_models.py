#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes tests/data/stems/*.onnx: tiny stems with weights by formula (the tests compute the same
ones, see tests/support/tiny_stem.hpp), and models that must be refused.

    python3 tests/data/make_models.py       # needs numpy and onnx
"""

import pathlib

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

OUT = pathlib.Path(__file__).parent / "stems"
MEAN = np.array([120.0, 115.0, 110.0], np.float32)


def weights(filters, kernel):
    """Filter 0 is a box over all colours; the others are whole numbers with no symmetry."""
    o, c, y, x = np.meshgrid(range(filters), range(3), range(kernel), range(kernel), indexing="ij")
    w = ((7 * o + 5 * c + 3 * y + 11 * x + o * x * y) % 13 - 6) / (20.0 * kernel)
    w[0] = 1.0 / (3 * kernel * kernel)
    return w.astype(np.float32)


def gray_stem(name, stride, pick=None):
    """norm_k4s4's weights of the first colour on one gray plane; pick: that filter alone."""
    constants = {"weights": weights(6, 4)[:, :1], "epsilon": np.full((1, 1, 1, 1), 9.0, np.float32)}
    if pick is not None:
        constants |= {"from": np.array([pick]), "to": np.array([pick + 1]), "axis": np.array([1])}
    write(name, f"""(float[1, 1, H, W] image) => (float[1, {6 if pick is None else 1}, h, w] channels) {{
        z = Conv<kernel_shape = [4, 4], strides = [{stride}, {stride}]>(image, weights)
        power = ReduceSumSquare<axes = [1]>(z)
        floored = Add(power, epsilon)
        length = Sqrt(floored)
        {"" if pick is None else "own = Slice(z, from, to, axis)"}
        channels = Div({"z" if pick is None else "own"}, length) }}""",
          constants, said("stem", 6, 4, stride, [0] * 4, **({} if pick is None else {"filter": pick})))


def stem(name, filters, kernel, stride, pads, layer_norm=False, size="H, W"):
    constants = {"mean": MEAN.reshape(1, 3, 1, 1), "weights": weights(filters, kernel)}
    if layer_norm:
        constants["epsilon"] = np.full((1, 1, 1, 1), 1e-6, np.float32)
    norm = """
        m = ReduceMean<axes = [1]>(response)
        d = Sub(response, m)
        d2 = Mul(d, d)
        v = ReduceMean<axes = [1]>(d2)
        ve = Add(v, epsilon)
        s = Sqrt(ve)
        channels = Div(d, s)"""
    write(name, f"""(float[1, 3, {size}] image) => (float[1, {filters}, h, w] channels) {{
        centred = Sub(image, mean)
        {"response" if layer_norm else "channels"} = Conv<kernel_shape = [{kernel}, {kernel}], pads = {pads}, strides = [{stride}, {stride}]>(centred, weights)
        {norm if layer_norm else ""} }}""", constants, said("stem", filters, kernel, stride, pads))


def deep(name):
    """A padded box of 3x3 over plain_k4s4, less its mean over the frame for the last filter."""
    box = np.zeros((2, 3, 3, 3), np.float32)
    box[0, 0] = box[1, 1] = 1.0 / 9.0
    write(name, """(float[1, 3, H, W] image) => (float[1, 2, h, w] channels) {
        centred = Sub(image, mean)
        stem = Conv<kernel_shape = [4, 4], strides = [4, 4]>(centred, weights)
        smooth = Conv<kernel_shape = [3, 3], pads = [1, 1, 1, 1]>(stem, box)
        average = GlobalAveragePool(smooth)
        level = Mul(average, which)
        channels = Sub(smooth, level) }""",
          {"mean": MEAN.reshape(1, 3, 1, 1), "weights": weights(3, 4), "box": box, "which": np.array([0.0, 1.0], np.float32).reshape(1, 2, 1, 1)},
          said("deep", 2, 12, 4, [4] * 4, sampling="native"))


def said(layer, filters, kernel, stride, padding, **more):
    """What the model says of itself."""
    values = {"network": "tiny", "layer": layer, "filters": filters, "kernel": f"{kernel} {kernel}", "stride": stride,
              "padding": " ".join(map(str, padding)), "default_filter": 1, "licence": "MIT", "command": "tests/data/make_models.py", **more}
    return {f"stemvo.{key}": str(value) for key, value in values.items()}


def write(name, graph, constants=None, metadata=None, domains='"": 13'):
    """graph: in ONNX's textual form."""
    model = onnx.parser.parse_model(f'<ir_version: 7, opset_import: [{domains}], producer_name: "stemvo tests"> {name} {graph}')
    model.graph.initializer.extend(numpy_helper.from_array(values, key) for key, values in (constants or {}).items())
    for node in model.graph.node:
        node.domain or node.ClearField("domain")  # it writes empty ones
    helper.set_model_props(model, metadata or {})
    onnx.checker.check_model(model)
    (OUT / f"{name}.onnx").write_bytes(model.SerializeToString(deterministic=True))
    return model


def external(name):
    """Weights that the file beside it should hold."""
    model = write(name, "(float[1, 3, H, W] image) => (float[1, 3, h, w] channels) { channels = Conv<kernel_shape = [1, 1]>(image, weights) }",
                  {"weights": np.zeros((3, 3, 1, 1), np.float32)})
    outside, = model.graph.initializer
    outside.ClearField("raw_data")
    outside.data_location = TensorProto.EXTERNAL
    outside.external_data.add(key="location", value=f"{name}.bin")
    (OUT / f"{name}.onnx").write_bytes(model.SerializeToString(deterministic=True))


def main():
    OUT.mkdir(exist_ok=True)
    none = [0, 0, 0, 0]
    stem("plain_k4s4", 3, 4, 4, none)
    stem("norm_k4s4", 6, 4, 4, none, layer_norm=True)
    stem("plain_k3s2p1", 3, 3, 2, [1, 1, 1, 1])
    stem("plain_k3s2same", 3, 3, 2, [0, 0, 1, 1])
    stem("plain_k7s2p3", 3, 7, 2, [3, 3, 3, 3])
    stem("fixed_k4s4", 3, 4, 4, none, size="32, 48")

    gray_stem("gray_k4s4", 4)
    gray_stem("gray_k4s4_filter_1", 2, pick=1)
    deep("deep_k12s4")
    given, made = "(float[1, 3, H, W] image)", "(float[1, 3, H, W] channels)"
    copied = "{ channels = Identity(image) }"
    write("wrong_input_name", f"(float[1, 3, H, W] x) => {made} {{ channels = Identity(x) }}")
    write("wrong_two_outputs", f"{given} => (float[1, 3, H, W] a, float[1, 3, H, W] b) {{ a = Identity(image) b = Identity(image) }}")
    write("wrong_rank", f"(float[3, H, W] image) => (float[3, H, W] channels) {copied}")
    write("wrong_planes", f"(float[1, 2, H, W] image) => (float[1, 2, H, W] channels) {copied}")
    write("wrong_type", f"(uint8[1, 3, H, W] image) => (uint8[1, 3, H, W] channels) {copied}")
    write("wrong_free_filters", f"""{given} => (float[1, C, H, W] channels) {{
        brightest = ReduceMax(image)
        number = Cast<to = 7>(brightest)
        to = Reshape(number, one)
        channels = Slice(image, from, to, axis) }}""", {key: np.array([number]) for key, number in (("one", 1), ("from", 0), ("axis", 1))})
    write("wrong_two_inputs", f"(float[1, 3, H, W] image, float[1, 3, H, W] more) => {made} {{ channels = Add(image, more) }}")
    write("wrong_output_rank", f"{given} => (float[1, H, W] channels) {{ channels = ReduceMean<axes = [1], keepdims = 0>(image) }}")
    external("wrong_external")
    write("wrong_no_metadata", f"{given} => {made} {copied}")
    write("wrong_domain", f"{given} => {made} {{ channels = com.example.Steal(image) }}", domains='"": 13, "com.example": 1')
    write("wrong_infinite", f"{given} => {made} {{ channels = Log(image) }}", metadata=said("stem", 3, 1, 1, [0] * 4))


if __name__ == "__main__":
    main()
