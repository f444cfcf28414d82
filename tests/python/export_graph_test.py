# SPDX-License-Identifier: MIT
"""tools/export_stem.py on whole networks (.onnx): cut at layers, values against the uncut network, windows."""

import unittest

from exporting import Files

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

import export_stem
from stems import receptive_field


def network(path, *, colours_last=False, free=True, same=b"SAME_UPPER", image="x"):
    """Convolution 5x5/2 "same", squeeze and excitation, depthwise 3x3, padded pool, a dense layer."""
    rng = np.random.default_rng(11)
    constants = [numpy_helper.from_array(rng.normal(size=shape).astype(np.float32), name) for name, shape in
                 (("w1", (6, 3, 5, 5)), ("w2", (6, 1, 3, 3)), ("squeeze", (6, 6, 1, 1)), ("dense", (6, 4)))]
    nodes = [helper.make_node("Transpose", [image], ["planes"], perm=[0, 3, 1, 2])] if colours_last else []
    nodes += [helper.make_node("Conv", ["planes" if colours_last else image, "w1"], ["front"], name="conv_1", kernel_shape=[5, 5],
                               strides=[2, 2], auto_pad=same),
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
    sides = ["H", "W"] if free else [32, 48]
    shape = [1, *sides, 3] if colours_last else [1, 3, *sides]
    graph = helper.make_graph(nodes, "network", [helper.make_tensor_value_info(image, TensorProto.FLOAT, shape)],
                              [helper.make_tensor_value_info("y", TensorProto.FLOAT, [1, 4])], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 8
    onnx.checker.check_model(model)
    onnx.save(model, path)
    return model


def with_computed_weights(path, kind, operators):
    """Convolution 5x5/2 whose weights the nodes (operator, inputs, output, attributes) compute from `w`, up to `computed`."""
    rng = np.random.default_rng(5)
    weights = rng.integers(-99, 99, (6, 3, 5, 5)).astype(kind)
    constants = [numpy_helper.from_array(values, name) for name, values in
                 (("w", weights), ("scale", rng.uniform(0.01, 0.1, 6).astype(np.float32)), ("three", np.full(3, 2, np.float32)),
                  ("axes", np.array([1, 2, 3]))) if any(name in inputs for _, inputs, _, _ in operators)]
    nodes = [helper.make_node(operator, inputs, [output], **more) for operator, inputs, output, more in operators]
    nodes.append(helper.make_node("Conv", ["x", "computed"], ["front"], kernel_shape=[5, 5], strides=[2, 2], pads=[1, 1, 2, 2]))
    value = lambda name, shape: helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)  # noqa: E731
    graph = helper.make_graph(nodes, "computed", [value("x", [1, 3, "H", "W"])], [value("front", [1, 6, None, None])], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18), helper.make_opsetid("theirs", 1)], ir_version=8)
    onnx.save(model, path)
    return model


def uncut(model, tensor, image, colours_last):
    """The tensor of the network itself for a preprocessed picture (3 x H x W)."""
    copy = onnx.ModelProto()
    copy.CopyFrom(model)
    copy.graph.output.append(helper.make_empty_tensor_value_info(tensor))
    copy.graph.output[-1].type.tensor_type.elem_type = TensorProto.FLOAT
    feed = image.transpose(1, 2, 0) if colours_last else image
    session = onnxruntime.InferenceSession(copy.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run([tensor], {model.graph.input[0].name: np.ascontiguousarray(feed[None], np.float32)})[0]


def cut(file, image):
    session = onnxruntime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    return session.run(None, {"image": image[None].astype(np.float32)})


class Cut(Files):
    def setUp(self):
        super().setUp()
        self.path = self.folder / "whole.onnx"
        self.image = np.random.default_rng(2).uniform(0, 255, (3, 64, 96))

    def test_values_of_several_layers(self):
        for colours_last in (False, True):
            model = network(self.path, colours_last=colours_last)
            entries = self.export(self.path, "--layers", "front,second,last", "--preprocessing", "caffe")
            found = [cut(self.folder / "out" / entry["file"], self.image)[0] for entry in entries]
            fed = self.image[::-1] - np.array([103.939, 116.779, 123.68]).reshape(3, 1, 1)
            for tensor, values, entry in zip(("front", "second", "last"), found, entries):
                want = uncut(model, tensor, fed, colours_last)
                want = want.transpose(0, 3, 1, 2) if tensor == "last" else want
                self.assertEqual(entry["filters"], want.shape[1])
                self.assertLess(np.abs(values - want).max(), 1e-4 * want.std())
            self.assertEqual([entry["layer"] for entry in entries], ["front", "second", "last/planes"])

    def test_windows_and_what_may_be_sampled(self):
        network(self.path)
        entries = self.export(self.path, "--layers", "conv_1,pooled,second", "--preprocessing", "unit")
        facts = [(entry["kernel"], entry["stride"], entry["padding"], entry.get("sampling")) for entry in entries]
        # "Same", 5x5/2 on even sizes: 1 before, 2 after. Pool: 5 + 2 * 2 wide, 1 + 2 before; then 4 * 2 wider.
        self.assertEqual(facts, [([5, 5], 2, [1, 1, 2, 2], None), ([9, 9], 4, [3, 3, 4, 4], "native"),
                                 ([17, 17], 4, [3, 3, 4, 4], "native")])
        self.assertIn("second: sees the whole frame: sampled at its stride 4 only", self.said)

    def test_size_class(self):
        model = network(self.path)
        entry = self.export(self.path, "--layers", "front", "--preprocessing", "none", "--size", "97x65")[-1]
        self.assertEqual(entry["padding"], [2, 2, 2, 2])
        image = np.random.default_rng(2).uniform(0, 255, (3, 65, 97))
        want = uncut(model, "front", image, False)
        self.assertLess(np.abs(cut(self.folder / "out" / "whole.onnx", image)[0] - want).max(), 1e-4 * want.std())

    def test_one_filter_of_a_layer(self):
        model = network(self.path)
        entry = self.export(self.path, "--layers", "second", "--filter", "4", "--preprocessing", "none")[-1]
        self.assertEqual((entry["filters"], entry["layer"]), (1, "second/filter_4"))
        want = uncut(model, "second", self.image, False)[:, 4:5]
        self.assertLess(np.abs(cut(self.folder / "out" / "whole_filter4.onnx", self.image)[0] - want).max(), 1e-4 * want.std())

    def test_a_network_of_one_size_is_refused(self):
        model = network(self.path)
        model.graph.initializer.append(numpy_helper.from_array(np.ones((1, 6, 8, 12), np.float32), "place"))
        model.graph.node.insert(4, helper.make_node("Add", ["pooled", "place"], ["placed"]))
        onnx.save(model, self.path)
        for size in ((), ("--size", "48x32")):
            self.assertIn("expected", self.error_of(self.path, "--layers", "placed", "--preprocessing", "none", *size))

    def test_paddings_that_nodes_compute_from_the_size(self):
        """As timm writes TensorFlow's: Shape, arithmetic, Pad."""
        rng = np.random.default_rng(11)
        constants = [numpy_helper.from_array(values, name) for name, values in
                     (("w", rng.normal(size=(6, 3, 3, 3)).astype(np.float32)), ("sides", np.array([2, 3])), ("two", np.array([2, 2])),
                      ("planes", np.zeros(2, np.int64)), ("one", np.array([1, 1])))]
        nodes = [helper.make_node("Shape", ["x"], ["shape"]), helper.make_node("Gather", ["shape", "sides"], ["size"]),
                 helper.make_node("Mod", ["size", "two"], ["odd"]),  # "same", 3x3/2
                 helper.make_node("Concat", ["planes", "odd", "planes", "one"], ["pads"], axis=0), helper.make_node("Pad", ["x", "pads"], ["padded"]),
                 helper.make_node("Conv", ["padded", "w"], ["front"], kernel_shape=[3, 3], strides=[2, 2])]
        value = lambda name, shape: helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)  # noqa: E731
        graph = helper.make_graph(nodes, "timm", [value("x", [1, 3, "H", "W"])], [value("front", [1, 6, None, None])], constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
        onnx.save(model, self.path)
        entry = self.export(self.path, "--layers", "front", "--preprocessing", "none")[-1]
        self.assertEqual(entry["padding"], [0, 0, 1, 1])
        want = uncut(model, "front", self.image, False)
        self.assertLess(np.abs(cut(self.folder / "out" / "whole.onnx", self.image)[0] - want).max(), 1e-4 * want.std())

    def test_weights_that_nodes_compute_are_weights(self):
        for kind, *operators in (
                (np.int8, ("DequantizeLinear", ["w", "scale"], "computed", {"axis": 0})),
                (np.float32, ("ReduceMean", ["w", "axes"], "mean", {}), ("Sub", ["w", "mean"], "centred", {}),
                 ("Mul", ["centred"] * 2, "square", {}), ("ReduceMean", ["square", "axes"], "variance", {}),
                 ("Sqrt", ["variance"], "sigma", {}), ("Div", ["centred", "sigma"], "computed", {})),
                (np.float32, ("ReduceL2", ["w", "axes"], "norm", {}), ("Div", ["w", "norm"], "computed", {})),
                (np.float32, ("BatchNormalization", ["w", *["three"] * 4], "computed", {}))):
            with self.subTest(operator=operators[0][0]):
                model = with_computed_weights(self.path, kind, operators)
                self.export(self.path, "--layers", "front", "--preprocessing", "none")
                file = self.folder / "out" / "whole.onnx"
                want = uncut(model, "front", self.image, False)
                self.assertLess(np.abs(cut(file, self.image)[0] - want).max(), 1e-4 * want.std())

    def test_a_network_whose_input_has_the_name_of_ours(self):
        for colours_last in (False, True):
            model = network(self.path, colours_last=colours_last, image="image")
            self.export(self.path, "--layers", "front", "--preprocessing", "none")
            want = uncut(model, "front", self.image, colours_last)
            self.assertLess(np.abs(cut(self.folder / "out" / "whole.onnx", self.image)[0] - want).max(), 1e-4 * want.std())

    def test_errors(self):
        network(self.path)
        options = ("--preprocessing", "none")
        self.assertIn("such as front, excite, second; found 'secnd'", self.error_of(self.path, "--layers", "secnd", *options))
        self.assertIn("expected a layer of pictures, found one", self.error_of(self.path, "--layers", "y", *options))
        self.assertIn("expected a layer of pictures, found one", self.error_of(self.path, "--layers", "gate", *options))
        self.assertIn("expected --layers (--list shows them)", self.error_of(self.path, *options))
        self.assertIn("expected --preprocessing", self.error_of(self.path, "--layers", "front"))
        self.assertIn("--filter: expected 0 to 5, found 6", self.error_of(self.path, "--layers", "front", "--filter", "6", *options))


class Window(unittest.TestCase):
    def test_equals_where_a_gradient_is_not_zero(self):
        """A chain of random windows with all-positive weights: the pixels that change an output are its window."""
        rng = np.random.default_rng(4)
        for _ in range(20):
            nodes, constants, last = [], [], "image"
            for step in range(3):
                size, stride = int(rng.integers(1, 5)), int(rng.integers(1, 3))
                pads = [int(value) for value in rng.integers(0, size, 4)]
                constants.append(numpy_helper.from_array(np.ones((1, 1, size, size), np.float32), f"w{step}"))
                nodes.append(helper.make_node("Conv", [last, f"w{step}"], [f"t{step}"], kernel_shape=[size, size],
                                              strides=[stride, stride], pads=pads))
                last = f"t{step}"
            value = lambda name: helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, 1, None, None])  # noqa: E731
            graph = helper.make_graph(nodes, "chain", [value("image")], [value(last)], constants)
            model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
            model.ir_version = 8
            field = receptive_field.Walk(graph, "image").fields[last]
            session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
            height, width = 61, 70
            zero = session.run(None, {"image": np.zeros((1, 1, height, width), np.float32)})[0]
            self.assertEqual(zero.shape[2:], ((height + field.y.rest) // field.y.stride + 1, (width + field.x.rest) // field.x.stride + 1))
            row = zero.shape[2] // 2
            rows = []
            for y in range(height):
                image = np.zeros((1, 1, height, width), np.float32)
                image[0, 0, y] = 1
                if session.run(None, {"image": image})[0][0, 0, row].any():
                    rows.append(y)
            # With strides wider than windows some pixels in between are not looked at; the ends are exact.
            self.assertEqual((rows[0], rows[-1]), (field.y.stride * row + field.y.first, field.y.stride * row + field.y.last))


if __name__ == "__main__":
    unittest.main()
