# SPDX-License-Identifier: MIT
"""Shared by the tests of `stemvo-lab export`: weights of stems, small files with the structure of Keras' (written without it),
and what the network makes of a picture, in plain numpy."""

import io
import json
import pathlib
import re
import zipfile

import h5py
import numpy as np
import onnx
import onnxruntime
import pytest
from click.testing import CliRunner
from stemvo.lab.cli import main
from stemvo.stems import metadata

IMAGENET = {"input_mean": np.array([0.485, 0.456, 0.406]), "input_std": np.array([0.229, 0.224, 0.225])}


def written(text):
    """What each file that was written says of itself, with numbers as such."""
    entries = []
    for path in re.findall(r"^(.*\.onnx): ", text, re.MULTILINE):
        said = metadata.read(path)
        entries.append(said | {key: list(map(int, said[key].split())) for key in ("kernel", "padding")} |
                       {key: int(said[key]) for key in ("filters", "stride", "default_filter")} | {"file": pathlib.Path(path).name})
    return entries


def save_network(path, nodes, inputs, outputs, constants, opsets=(("", 13),)):
    """inputs, outputs: name -> shape, of floats; constants: name -> array."""
    values = [[onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, shape) for name, shape in given.items()] for given in (inputs, outputs)]
    graph = onnx.helper.make_graph(nodes, "network", *values, [onnx.numpy_helper.from_array(array, name) for name, array in constants.items()])
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid(*one) for one in opsets], ir_version=8)
    onnx.save(model, path)
    return model


def run_onnx(path, image):
    """A picture's channels."""
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(None, {"image": image[None].astype(np.float32)})[0][0]


def plain_stem(arrays, image, padding):
    """The network as its authors wrote it, step by step: normalise, pad, convolve, batch norm, layer norm."""
    if "input_scale" in arrays:
        image = image / 255.0 * arrays["input_scale"] + arrays["input_offset"]
    elif "input_mean" in arrays:
        image = (image / 255.0 - arrays["input_mean"].reshape(3, 1, 1)) / arrays["input_std"].reshape(3, 1, 1)
    top, left, bottom, right = padding
    image = np.pad(image.astype(np.float64), ((0, 0), (top, bottom), (left, right)))
    weights, stride = arrays["conv_w"].astype(np.float64), int(arrays["stride"])
    patches = np.lib.stride_tricks.sliding_window_view(image, weights.shape[2:], (1, 2))[:, ::stride, ::stride]
    out = np.einsum("cdij,dyxij->cyx", weights, patches)
    out += arrays.get("conv_b", np.zeros(weights.shape[0])).reshape(-1, 1, 1)
    if "bn_eps" in arrays:
        gamma, beta, mean, var = (arrays[f"bn_{key}"].reshape(-1, 1, 1) for key in ("gamma", "beta", "mean", "var"))
        out = (out - mean) / np.sqrt(var + arrays["bn_eps"]) * gamma + beta
    if "ln_eps" in arrays:
        out = (out - out.mean(axis=0)) / np.sqrt(out.var(axis=0) + arrays["ln_eps"])
        out = out * arrays["ln_gamma"].reshape(-1, 1, 1) + arrays["ln_beta"].reshape(-1, 1, 1)
    return out


def random_arrays(kernel, stride, *, norm, filters=5, epsilon=None, fed=None):
    """A stem with the keys of an .npz. norm: none, batch or layer."""
    rng = np.random.default_rng(7)
    arrays = {"conv_w": rng.normal(size=(filters, 3, *kernel)), "stride": stride, **(fed or IMAGENET)}
    if norm == "layer":
        arrays["conv_b"] = rng.normal(size=filters)
    for name in {"none": (), "batch": ("gamma", "beta", "mean", "var"), "layer": ("gamma", "beta")}[norm]:
        arrays[f"{norm[0]}n_{name}"] = rng.uniform(0.1, 2, filters)
    arrays |= {} if norm == "none" else {f"{norm[0]}n_eps": epsilon or {"batch": 1e-3, "layer": 1e-6}[norm]}
    return {key: np.asarray(value, np.int32 if key == "stride" else np.float32) for key, value in arrays.items()}


def keras_named(path, layers, order, group=None, cut=None):
    """As keras.applications' downloads: layers is layer -> variable -> array; order lists all layers, in two attributes
    (as Keras does with long lists) with the first `cut` in the first."""
    with h5py.File(path, "w") as file:
        root = file.create_group(group) if group else file
        if cut:
            root.attrs["layer_names0"] = [name.encode() for name in order[:cut]]
            root.attrs["layer_names1"] = [name.encode() for name in order[cut:]]
        else:
            root.attrs["layer_names"] = [name.encode() for name in order]
        for name in order:
            root.create_group(name)
        for name, variables in layers.items():
            outer, inner = name if isinstance(name, tuple) else (name, name)
            for variable, values in variables.items():
                root[f"{outer}/{inner}/{variable}:0"] = values


def keras_numbered(file, layers):
    """As Keras 3: paths below layers/ -> list of arrays."""
    for name, arrays in layers.items():
        place = file.require_group("layers/" + name + "/vars")
        for index, values in enumerate(arrays):
            place[str(index)] = values


def keras_zip(path, layers, config):
    """config: (class, name) of all layers, or (class, name, inner layers)."""
    def described(items):
        return [{"class_name": item[0], "config": {"name": item[1]} | ({"layers": described(item[2])} if len(item) > 2 else {})}
                for item in items]

    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        keras_numbered(file, layers)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("config.json", json.dumps({"config": {"layers": described(config)}}))
        archive.writestr("model.weights.h5", content.getvalue())


class Files:
    def __init__(self, folder):
        self.folder, self.out = folder, folder / "out"

    def save(self, arrays, name="random.npz"):
        np.savez(self.folder / name, **arrays)
        return self.folder / name

    def export(self, path, *options):
        done = CliRunner().invoke(main, ["export", str(path), "--out", str(self.out), *options])
        assert done.exit_code == 0, done.output
        self.said = done.output
        return written(done.output)

    def check(self, path, arrays, *options, network=None, padding=(0, 0, 0, 0), size=(17, 22)):
        """The exported stem gives what the arrays say."""
        entry = self.export(path, *options)[-1]
        assert entry["padding"] == list(padding) and network in (None, entry["network"])
        image = np.random.default_rng(3).uniform(0, 255, (3, *size))
        got, want = run_onnx(self.out / entry["file"], image), plain_stem(arrays, image, padding)
        assert got.shape == want.shape and np.abs(got - want).max() < 2e-5 * want.std()

    def error_of(self, path, *options):
        """The one line; nothing may have been written."""
        done = CliRunner().invoke(main, ["export", str(path), "--out", str(self.folder / "none"), *options])
        assert (done.exit_code, done.output.count("\n")) == (1, 1) and not (self.folder / "none").exists(), done.output
        return done.output


@pytest.fixture
def files(tmp_path):
    return Files(tmp_path)
