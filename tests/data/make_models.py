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
    constants = [numpy_helper.from_array(weights(6, 4)[:, :1], "weights"),
                 numpy_helper.from_array(np.full((1, 1, 1, 1), 9.0, np.float32), "epsilon")]
    nodes = [helper.make_node("Conv", ["image", "weights"], ["z"], kernel_shape=[4, 4], strides=[stride] * 2),
             helper.make_node("ReduceSumSquare", ["z"], ["power"], axes=[1]),
             helper.make_node("Add", ["power", "epsilon"], ["floored"]),
             helper.make_node("Sqrt", ["floored"], ["length"])]
    if pick is not None:
        constants += [numpy_helper.from_array(np.array([number]), key)
                      for key, number in (("from", pick), ("to", pick + 1), ("axis", 1))]
        nodes += [helper.make_node("Slice", ["z", "from", "to", "axis"], ["own"])]
    nodes += [helper.make_node("Div", ["z" if pick is None else "own", "length"], ["channels"])]
    write(name, nodes, [value("image", [1, 1, "H", "W"])],
          [value("channels", [1, 6 if pick is None else 1, "h", "w"])], constants,
          metadata=said("stem", 6, 4, stride, [0] * 4, **({} if pick is None else {"filter": pick})))


def stem(name, filters, kernel, stride, pads, layer_norm=False, size=("H", "W")):
    constants = [numpy_helper.from_array(MEAN.reshape(1, 3, 1, 1), "mean"),
                 numpy_helper.from_array(weights(filters, kernel), "weights")]
    nodes = [helper.make_node("Sub", ["image", "mean"], ["centred"]),
             helper.make_node("Conv", ["centred", "weights"], ["response" if layer_norm else "channels"],
                              kernel_shape=[kernel] * 2, strides=[stride] * 2, pads=pads)]
    if layer_norm:
        constants += [numpy_helper.from_array(np.full((1, 1, 1, 1), 1e-6, np.float32), "epsilon")]
        nodes += [helper.make_node("ReduceMean", ["response"], ["m"], axes=[1]),
                  helper.make_node("Sub", ["response", "m"], ["d"]),
                  helper.make_node("Mul", ["d", "d"], ["d2"]),
                  helper.make_node("ReduceMean", ["d2"], ["v"], axes=[1]),
                  helper.make_node("Add", ["v", "epsilon"], ["ve"]),
                  helper.make_node("Sqrt", ["ve"], ["s"]),
                  helper.make_node("Div", ["d", "s"], ["channels"])]
    write(name, nodes, [value("image", [1, 3, *size])], [value("channels", [1, filters, "h", "w"])], constants,
          metadata=said("stem", filters, kernel, stride, pads))


def deep(name):
    """A padded box of 3x3 over plain_k4s4, less its mean over the frame for the last filter."""
    box = np.zeros((2, 3, 3, 3), np.float32)
    box[0, 0] = box[1, 1] = 1.0 / 9.0
    constants = [numpy_helper.from_array(MEAN.reshape(1, 3, 1, 1), "mean"),
                 numpy_helper.from_array(weights(3, 4), "weights"), numpy_helper.from_array(box, "box"),
                 numpy_helper.from_array(np.array([0.0, 1.0], np.float32).reshape(1, 2, 1, 1), "which")]
    nodes = [helper.make_node("Sub", ["image", "mean"], ["centred"]),
             helper.make_node("Conv", ["centred", "weights"], ["stem"], kernel_shape=[4, 4], strides=[4, 4]),
             helper.make_node("Conv", ["stem", "box"], ["smooth"], kernel_shape=[3, 3], pads=[1, 1, 1, 1]),
             helper.make_node("GlobalAveragePool", ["smooth"], ["average"]),
             helper.make_node("Mul", ["average", "which"], ["level"]),
             helper.make_node("Sub", ["smooth", "level"], ["channels"])]
    write(name, nodes, [value("image", [1, 3, "H", "W"])], [value("channels", [1, 2, "h", "w"])], constants,
          metadata=said("deep", 2, 12, 4, [4] * 4, sampling="native"))


def value(name, shape, kind=TensorProto.FLOAT):
    return helper.make_tensor_value_info(name, kind, shape)


def said(layer, filters, kernel, stride, padding, **more):
    """What the model says of itself."""
    values = {"network": "tiny", "layer": layer, "filters": filters, "kernel": f"{kernel} {kernel}", "stride": stride,
              "padding": " ".join(map(str, padding)), "default_filter": 1, "licence": "MIT", "command": "tests/data/make_models.py", **more}
    return {f"stemvo.{key}": str(value) for key, value in values.items()}


def write(name, nodes, inputs, outputs, constants=(), domains=(), is_checked=True, metadata=None):
    graph = helper.make_graph(nodes, name, inputs, outputs, list(constants))
    domains = [helper.make_opsetid("", 13)] + [helper.make_opsetid(domain, 1) for domain in domains]
    model = helper.make_model(graph, opset_imports=domains, producer_name="stemvo tests")
    model.ir_version = 7
    helper.set_model_props(model, metadata or {})
    if is_checked:
        onnx.checker.check_model(model)
    (OUT / f"{name}.onnx").write_bytes(model.SerializeToString(deterministic=True))


def identity(name, inputs, outputs):
    """A model of the given shapes that copies its input, to be refused at load."""
    write(name, [helper.make_node("Identity", [inputs[0].name], [outputs[0].name])], inputs, outputs)


def external(name):
    """Weights that the file beside it should hold."""
    outside = numpy_helper.from_array(np.zeros((3, 3, 1, 1), np.float32), "weights")
    outside.ClearField("raw_data")
    outside.data_location = TensorProto.EXTERNAL
    outside.external_data.add(key="location", value=f"{name}.bin")
    write(name, [helper.make_node("Conv", ["image", "weights"], ["channels"], kernel_shape=[1, 1])],
          [value("image", [1, 3, "H", "W"])], [value("channels", [1, 3, "h", "w"])], [outside], is_checked=False)


def main():
    OUT.mkdir(exist_ok=True)
    none = [0, 0, 0, 0]
    stem("plain_k4s4", 3, 4, 4, none)
    stem("norm_k4s4", 6, 4, 4, none, layer_norm=True)
    stem("plain_k3s2p1", 3, 3, 2, [1, 1, 1, 1])
    stem("plain_k3s2same", 3, 3, 2, [0, 0, 1, 1])
    stem("plain_k7s2p3", 3, 7, 2, [3, 3, 3, 3])
    stem("fixed_k4s4", 3, 4, 4, none, size=(32, 48))

    gray_stem("gray_k4s4", 4)
    gray_stem("gray_k4s4_filter_1", 2, pick=1)
    deep("deep_k12s4")
    picture, shape = ["H", "W"], [1, 3, "H", "W"]
    identity("wrong_input_name", [value("x", shape)], [value("channels", shape)])
    write("wrong_two_outputs", [helper.make_node("Identity", ["image"], ["a"]), helper.make_node("Identity", ["image"], ["b"])],
          [value("image", shape)], [value("a", shape), value("b", shape)])
    identity("wrong_rank", [value("image", [3, *picture])], [value("channels", [3, *picture])])
    identity("wrong_planes", [value("image", [1, 2, *picture])], [value("channels", [1, 2, *picture])])
    identity("wrong_type", [value("image", shape, TensorProto.UINT8)], [value("channels", shape, TensorProto.UINT8)])
    write("wrong_free_filters", [helper.make_node("ReduceMax", ["image"], ["brightest"]),
                                 helper.make_node("Cast", ["brightest"], ["number"], to=TensorProto.INT64),
                                 helper.make_node("Reshape", ["number", "one"], ["to"]),
                                 helper.make_node("Slice", ["image", "from", "to", "axis"], ["channels"])],
          [value("image", shape)], [value("channels", [1, "C", *picture])],
          [numpy_helper.from_array(np.array([number]), key) for key, number in (("one", 1), ("from", 0), ("axis", 1))])
    write("wrong_two_inputs", [helper.make_node("Add", ["image", "more"], ["channels"])],
          [value("image", shape), value("more", shape)], [value("channels", shape)])
    write("wrong_output_rank", [helper.make_node("ReduceMean", ["image"], ["channels"], axes=[1], keepdims=0)],
          [value("image", shape)], [value("channels", [1, *picture])])
    external("wrong_external")
    identity("wrong_no_metadata", [value("image", shape)], [value("channels", shape)])
    write("wrong_domain", [helper.make_node("Steal", ["image"], ["channels"], domain="com.example")],
          [value("image", shape)], [value("channels", shape)], domains=["com.example"])
    write("wrong_infinite", [helper.make_node("Log", ["image"], ["channels"])], [value("image", shape)], [value("channels", shape)],
          metadata=said("stem", 3, 1, 1, [0] * 4))


if __name__ == "__main__":
    main()
