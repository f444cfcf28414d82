# SPDX-License-Identifier: MIT
"""stemvo-lab export on whole networks (.onnx): cut at layers, values against the uncut network, windows."""

import numpy as np
import onnx
import onnxruntime
import pytest
from exporting import files, run_onnx, save_network  # noqa: F401
from onnx import TensorProto, helper, numpy_helper
from stemvo.stems import receptive_field

IMAGE, NONE = np.random.default_rng(2).uniform(0, 255, (3, 64, 96)), ("--preprocessing", "none")


def network(path, *, colours_last=False, image="x"):
    """Convolution 5x5/2 "same", squeeze and excitation, depthwise 3x3, padded pool, a dense layer."""
    rng = np.random.default_rng(11)
    shapes = {"w1": (6, 3, 5, 5), "w2": (6, 1, 3, 3), "squeeze": (6, 6, 1, 1), "dense": (6, 4)}
    constants = {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}
    nodes = [helper.make_node("Transpose", [image], ["planes"], perm=[0, 3, 1, 2])] if colours_last else []
    nodes += [helper.make_node("Conv", ["planes" if colours_last else image, "w1"], ["front"], name="conv_1", kernel_shape=[5, 5],
                               strides=[2, 2], auto_pad="SAME_UPPER"),
              helper.make_node("Relu", ["front"], ["front/relu"]),
              helper.make_node("MaxPool", ["front/relu"], ["pooled"], kernel_shape=[3, 3], strides=[2, 2], pads=[1, 1, 1, 1]),
              helper.make_node("GlobalAveragePool", ["pooled"], ["average"]),
              helper.make_node("Conv", ["average", "squeeze"], ["excite"]),
              helper.make_node("Sigmoid", ["excite"], ["gate"]),
              helper.make_node("Mul", ["pooled", "gate"], ["gated"]),
              helper.make_node("Conv", ["gated", "w2"], ["second"], group=6, kernel_shape=[3, 3], pads=[0, 0, 0, 0]),
              helper.make_node("Transpose", ["second"], ["last"], perm=[0, 2, 3, 1]),
              helper.make_node("ReduceMean", ["last"], ["mean"], axes=[1, 2], keepdims=0),
              helper.make_node("MatMul", ["mean", "dense"], ["y"])]
    return save_network(path, nodes, {image: [1, "H", "W", 3] if colours_last else [1, 3, "H", "W"]}, {"y": [1, 4]}, constants)


def with_computed_weights(path, kind, operators):
    """Convolution 5x5/2 whose weights the nodes (operator, inputs, output, attributes) compute from `w`, up to `computed`."""
    rng = np.random.default_rng(5)
    weights = rng.integers(-99, 99, (6, 3, 5, 5)).astype(kind)
    constants = {"w": weights, "scale": rng.uniform(0.01, 0.1, 6).astype(np.float32), "three": np.full(3, 2, np.float32), "axes": np.array([1, 2, 3])}
    constants = {name: values for name, values in constants.items() if any(name in inputs for _, inputs, _, _ in operators)}
    nodes = [helper.make_node(operator, inputs, [output], **more) for operator, inputs, output, more in operators]
    nodes.append(helper.make_node("Conv", ["x", "computed"], ["front"], kernel_shape=[5, 5], strides=[2, 2], pads=[1, 1, 2, 2]))
    return save_network(path, nodes, {"x": [1, 3, "H", "W"]}, {"front": [1, 6, None, None]}, constants, (("", 18), ("theirs", 1)))


def uncut(model, tensor, image, colours_last):
    """The tensor of the network itself for a preprocessed picture (3 x H x W)."""
    copy = onnx.ModelProto()
    copy.CopyFrom(model)
    copy.graph.output.append(helper.make_empty_tensor_value_info(tensor))
    copy.graph.output[-1].type.tensor_type.elem_type = TensorProto.FLOAT
    feed = image.transpose(1, 2, 0) if colours_last else image
    session = onnxruntime.InferenceSession(copy.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run([tensor], {model.graph.input[0].name: np.ascontiguousarray(feed[None], np.float32)})[0]


def compare(files, model, tensor, *options, file="whole.onnx", image=IMAGE, colours_last=False, own=slice(None)):
    """The cut layer's values are those of the network. Returns its entry."""
    entry = files.export(files.folder / "whole.onnx", "--preprocessing", "none", *options)[-1]
    want = uncut(model, tensor, image, colours_last)[0, own]
    assert np.abs(run_onnx(files.out / file, image) - want).max() < 1e-4 * want.std()
    return entry


@pytest.fixture
def path(files):
    return files.folder / "whole.onnx"


@pytest.mark.parametrize("colours_last", [False, True])
def test_values_of_several_layers(files, path, colours_last):
    model = network(path, colours_last=colours_last)
    entries = files.export(path, "--layers", "front,second,last", "--preprocessing", "caffe")
    assert [entry["layer"] for entry in entries] == ["front", "second", "last/planes"]
    fed = IMAGE[::-1] - np.array([103.939, 116.779, 123.68]).reshape(3, 1, 1)
    for tensor, entry in zip(("front", "second", "last"), entries):
        want = uncut(model, tensor, fed, colours_last)[0]
        want = want.transpose(2, 0, 1) if tensor == "last" else want
        assert entry["filters"] == len(want) and np.abs(run_onnx(files.out / entry["file"], IMAGE) - want).max() < 1e-4 * want.std()


def test_windows_and_what_may_be_sampled(files, path):
    network(path)
    entries = files.export(path, "--layers", "conv_1,pooled,second", "--preprocessing", "unit")
    facts = [(entry["kernel"], entry["stride"], entry["padding"], entry.get("sampling")) for entry in entries]
    # "Same", 5x5/2 on even sizes: 1 before, 2 after. Pool: 5 + 2 * 2 wide, 1 + 2 before; then 4 * 2 wider.
    assert facts == [([5, 5], 2, [1, 1, 2, 2], None), ([9, 9], 4, [3, 3, 4, 4], "native"), ([17, 17], 4, [3, 3, 4, 4], "native")]
    assert "second: sees the whole frame: sampled at its stride 4 only" in files.said


def test_size_class(files, path):
    image = np.random.default_rng(2).uniform(0, 255, (3, 65, 97))
    assert compare(files, network(path), "front", "--layers", "front", "--size", "97x65", image=image)["padding"] == [2, 2, 2, 2]


def test_one_filter_of_a_layer(files, path):
    entry = compare(files, network(path), "second", "--layers", "second", "--filter", "4", file="whole_filter4.onnx", own=slice(4, 5))
    assert (entry["filters"], entry["layer"]) == (1, "second/filter_4")


def test_a_network_of_one_size_is_refused(files, path):
    model = network(path)
    model.graph.initializer.append(numpy_helper.from_array(np.ones((1, 6, 8, 12), np.float32), "place"))
    model.graph.node.insert(4, helper.make_node("Add", ["pooled", "place"], ["placed"]))
    onnx.save(model, path)
    for size in ((), ("--size", "48x32")):
        assert "expected" in files.error_of(path, "--layers", "placed", "--preprocessing", "none", *size)


def test_paddings_that_nodes_compute_from_the_size(files, path):
    """As timm writes TensorFlow's: Shape, arithmetic, Pad."""
    rng = np.random.default_rng(11)
    constants = {"w": rng.normal(size=(6, 3, 3, 3)).astype(np.float32), "sides": np.array([2, 3]), "two": np.array([2, 2]), "planes": np.zeros(2, np.int64),
                 "one": np.array([1, 1])}
    nodes = [helper.make_node("Shape", ["x"], ["shape"]), helper.make_node("Gather", ["shape", "sides"], ["size"]),
             helper.make_node("Mod", ["size", "two"], ["odd"]),  # "same", 3x3/2
             helper.make_node("Concat", ["planes", "odd", "planes", "one"], ["pads"], axis=0), helper.make_node("Pad", ["x", "pads"], ["padded"]),
             helper.make_node("Conv", ["padded", "w"], ["front"], kernel_shape=[3, 3], strides=[2, 2])]
    model = save_network(path, nodes, {"x": [1, 3, "H", "W"]}, {"front": [1, 6, None, None]}, constants)
    assert compare(files, model, "front", "--layers", "front")["padding"] == [0, 0, 1, 1]


def test_weights_that_nodes_compute_are_weights(files, path):
    for kind, *operators in (
            (np.int8, ("DequantizeLinear", ["w", "scale"], "computed", {"axis": 0})),
            (np.float32, ("ReduceMean", ["w", "axes"], "mean", {}), ("Sub", ["w", "mean"], "centred", {}),
             ("Mul", ["centred"] * 2, "square", {}), ("ReduceMean", ["square", "axes"], "variance", {}),
             ("Sqrt", ["variance"], "sigma", {}), ("Div", ["centred", "sigma"], "computed", {})),
            (np.float32, ("ReduceL2", ["w", "axes"], "norm", {}), ("Div", ["w", "norm"], "computed", {})),
            (np.float32, ("BatchNormalization", ["w", *["three"] * 4], "computed", {}))):
        compare(files, with_computed_weights(path, kind, operators), "front", "--layers", "front")


@pytest.mark.parametrize("colours_last", [False, True])
def test_a_network_whose_input_has_the_name_of_ours(files, path, colours_last):
    compare(files, network(path, colours_last=colours_last, image="image"), "front", "--layers", "front", colours_last=colours_last)


@pytest.mark.parametrize(("options", "words"), [
    (("--layers", "secnd", *NONE), "such as front, excite, second; found 'secnd'"), (("--layers", "y", *NONE), "expected a layer of pictures, found one"),
    (("--layers", "gate", *NONE), "expected a layer of pictures, found one"), (NONE, "expected --layers (--list shows them)"),
    (("--layers", "front"), "expected --preprocessing"), (("--layers", "front", "--filter", "6", *NONE), "--filter: expected 0 to 5, found 6")])
def test_errors(files, path, options, words):
    network(path)
    assert words in files.error_of(path, *options)


def test_equals_where_a_gradient_is_not_zero(tmp_path):
    """A chain of random windows with all-positive weights: the pixels that change an output are its window."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        nodes, constants, last = [], {}, "image"
        for step in range(3):
            size, stride = int(rng.integers(1, 5)), int(rng.integers(1, 3))
            pads = [int(value) for value in rng.integers(0, size, 4)]
            constants[f"w{step}"] = np.ones((1, 1, size, size), np.float32)
            nodes.append(helper.make_node("Conv", [last, f"w{step}"], [f"t{step}"], kernel_shape=[size, size],
                                          strides=[stride, stride], pads=pads))
            last = f"t{step}"
        model = save_network(tmp_path / "chain.onnx", nodes, {"image": [1, 1, None, None]}, {last: [1, 1, None, None]}, constants)
        field = receptive_field.Walk(model.graph, "image").fields[last]
        session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
        height, width = 61, 70
        zero = session.run(None, {"image": np.zeros((1, 1, height, width), np.float32)})[0]
        assert zero.shape[2:] == ((height + field.y.rest) // field.y.stride + 1, (width + field.x.rest) // field.x.stride + 1)
        row = zero.shape[2] // 2
        rows = []
        for y in range(height):
            image = np.zeros((1, 1, height, width), np.float32)
            image[0, 0, y] = 1
            if session.run(None, {"image": image})[0][0, 0, row].any():
                rows.append(y)
        # With strides wider than windows some pixels in between are not looked at; the ends are exact.
        assert (rows[0], rows[-1]) == (field.y.stride * row + field.y.first, field.y.stride * row + field.y.last)
