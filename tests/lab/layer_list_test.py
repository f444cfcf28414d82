# SPDX-License-Identifier: MIT
"""stemvo-lab export --list: one network as Keras', PyTorch's and ONNX file, and one rule for what the search uses."""

import json

import exporting
import h5py
import numpy as np
import pytest
import safetensors.numpy
from exporting import files  # noqa: F401
from onnx import helper, numpy_helper
from stemvo.stems import keras_files, layer_list

# Name, class in Keras, filters of its output; used are the plain ones, "grouped" too, which Keras knows as Conv2D.
LAYERS = (("first", "Conv2D", 8, True), ("depth", "DepthwiseConv2D", 8, False), ("plain", "Conv2D", 16, True), ("grouped", "Conv2D", 16, True),
          ("apart", "SeparableConv2D", 12, False), ("up", "Conv2DTranspose", 4, False), ("last", "Conv2D", 5, True))
USED = {name: filters for name, _, filters, used in LAYERS if used}


def keras_weights():
    """Height, width, planes, filters; a transposed one's last two change places."""
    shapes = {"first": (3, 3, 3, 8), "depth": (3, 3, 8, 1), "plain": (1, 1, 8, 16), "grouped": (3, 3, 4, 16), "up": (2, 2, 4, 12), "last": (1, 1, 4, 5)}
    found = {name: {"kernel": np.ones(shape, np.float32)} for name, shape in shapes.items()}
    found["apart"] = {"depthwise_kernel": np.ones((3, 3, 16, 1), np.float32), "pointwise_kernel": np.ones((1, 1, 16, 12), np.float32)}
    return {name: found[name] for name, *_ in LAYERS}


def planes_first():
    """The same as PyTorch and ONNX lay them out; there a separable convolution is two."""
    found = {}
    for name, arrays in keras_weights().items():
        for part, values in arrays.items():
            half = {"depthwise_kernel": ".depthwise", "pointwise_kernel": ".pointwise"}.get(part, "")
            depthwise = name == "depth" or half == ".depthwise"
            found[name + half] = values.transpose(2, 3, 0, 1) if depthwise else values.transpose(3, 2, 0, 1)
    return found


def graph(path, with_constants=True):
    nodes, constants, last = [], {}, "x"
    groups = {"depth": 8, "grouped": 4, "apart.depthwise": 16}
    for name, values in planes_first().items():
        constants[f"{name}.weight"] = values
        if name == "up":  # planes, filters
            nodes.append(helper.make_node("ConvTranspose", [last, f"{name}.weight"], [name], kernel_shape=[2, 2], strides=[2, 2]))
        else:
            side = values.shape[2]
            nodes.append(helper.make_node("Conv", [last, f"{name}.weight"], [name], kernel_shape=[side, side], pads=[side // 2] * 4,
                                          group=groups.get(name, 1)))
        last = name
        if name in ("first", "depth", "plain", "grouped"):  # a network has something between them; not inside a separable one
            nodes.append(helper.make_node("Relu", [last], [f"{name}.relu"]))
            last = f"{name}.relu"
    if not with_constants:
        nodes = [helper.make_node("Constant", [], [name], value=numpy_helper.from_array(values, name)) for name, values in constants.items()] + nodes
    exporting.save_network(path, nodes, {"x": [1, 3, "H", "W"]}, {last: [1, 5, None, None]}, constants if with_constants else {})


def used(path):
    rows = layer_list.read(path)
    assert f"used {sum(row.filters for row in rows if row.used)} (in " in layer_list.text(rows)
    return {row.name: row.filters for row in rows if row.used}, {row.name: (row.kind, row.filters) for row in rows}


def write_keras(files):
    named, weights, whole = files.folder / "whole.h5", files.folder / "net.weights.h5", files.folder / "net.keras"
    config = [(kind, name) for name, kind, *_ in LAYERS]
    exporting.keras_named(named, keras_weights(), [name for name, *_ in LAYERS], group="model_weights")
    with h5py.File(named, "a") as file:
        layers = [{"class_name": kind, "config": {"name": name}} for kind, name in config]
        file.attrs["model_config"] = json.dumps({"config": {"layers": layers}})
    names, numbered = {}, {}
    for name, kind, *_ in LAYERS:
        key = keras_files.snake_case(kind)
        names[key] = names.get(key, -1) + 1
        numbered[key + (f"_{names[key]}" if names[key] else "")] = list(keras_weights()[name].values())
    with h5py.File(weights, "w") as file:
        exporting.keras_numbered(file, numbered)
    exporting.keras_zip(whole, numbered, config)
    return named, whole, weights


def test_keras(files):
    *named, numbered = write_keras(files)
    for path in named:
        found, rows = used(path)
        assert found == USED, path
        assert {name: row[0] for name, row in rows.items() if name not in USED} == {"depth": "depthwise", "apart": "separable", "up": "transposed"}
        assert {name: row[1] for name, row in rows.items()} == {name: filters for name, _, filters, _ in LAYERS}
    assert sorted(used(numbered)[0].values()) == sorted(USED.values())


@pytest.mark.parametrize("with_constants", [True, False])
def test_onnx(files, with_constants):
    graph(files.folder / "net.onnx", with_constants)
    found, rows = used(files.folder / "net.onnx")
    assert found == USED
    assert [rows[name][0] for name in ("depth", "apart.depthwise", "apart.pointwise", "up")] == ["depthwise", "depthwise", "separable", "transposed"]


def test_torch(files):
    """Which does not tell what follows what: without the separable and the transposed one."""
    arrays = {f"{name}.weight": np.ascontiguousarray(values) for name, values in planes_first().items() if name not in ("apart.pointwise", "up")}
    safetensors.numpy.save_file(arrays, files.folder / "net.safetensors")
    found, rows = used(files.folder / "net.safetensors")
    assert found == USED and (rows["depth"], rows["apart.depthwise"]) == (("depthwise", 8), ("depthwise", 16))
