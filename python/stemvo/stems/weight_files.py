# SPDX-License-Identifier: MIT
"""Weights files as layers: .h5 and .keras (Keras), .safetensors (PyTorch)."""

import dataclasses

import numpy as np

from . import keras_files
from .weights import WeightsError

SUFFIXES = (".h5", ".keras", ".safetensors")
# A pickle can run anything, so it is not read here.
_PICKLES = (".pth", ".pt")
_CONVERT = ("expected .safetensors, found a pickle; where PyTorch is: import torch, safetensors.torch; "
            "safetensors.torch.save_file(torch.load({0!r}, weights_only=True), {1!r})")


@dataclasses.dataclass
class Layer:
    """A layer with its arrays. Shapes are known at once, values are read when asked for."""

    name: str
    kind: str  # "convolution", "separable", "depthwise", "transposed", "normalization", "dense", "other", "" where it has no weights
    filters: int | None  # None: no weights, so the file does not say
    shapes: dict  # name of the array -> shape
    read: object  # name of the array -> values
    outer: str = ""  # Keras: the nested model it is a layer of


@dataclasses.dataclass
class WeightsFile:
    path: object
    source: str  # keras, torch
    layers: list

    def find(self, pattern):
        """Layers whose whole name matches."""
        return [layer for layer in self.layers if pattern.fullmatch(layer.name)]


def _is_depthwise(layer, shapes):
    """One filter per input plane. Where the file does not name the class, its kernel's last size says so."""
    kernel = shapes.get("kernel", ())
    return ("depthwise_kernel" in shapes or layer.kind == "depthwise_conv2d" or
            layer.kind == "" and len(kernel) == 4 and kernel[3] == 1 and kernel[2] > 1)


def _keras_kind(layer, shapes):
    kernel = shapes.get("kernel", ())
    if "pointwise_kernel" in shapes:
        return "separable"
    if _is_depthwise(layer, shapes):
        return "depthwise"
    if len(kernel) in (3, 4, 5):
        return "transposed" if layer.kind.endswith("_transpose") else "convolution"
    if "normalization" in layer.kind or "gamma" in shapes and len(shapes) > 1:
        return "normalization"
    return "dense" if kernel else "other" if shapes else ""


def _keras_filters(layer, shapes):
    if "pointwise_kernel" in shapes:
        return shapes["pointwise_kernel"][-1]
    kernel = shapes.get("kernel", shapes.get("depthwise_kernel"))
    if kernel:
        outputs = kernel[-2] if layer.kind.endswith("_transpose") else kernel[-1]
        return kernel[-2] * kernel[-1] if _is_depthwise(layer, shapes) else outputs
    return max((shape[-1] for shape in shapes.values() if shape), default=None)


def _read_keras(path):
    layers = []
    for layer in keras_files.read(path):
        shapes = {name: tuple(item.shape) for name, item in layer.variables.items()}
        layers.append(Layer(layer.name.removeprefix("layers/"), _keras_kind(layer, shapes), layer.filters or _keras_filters(layer, shapes), shapes,
                            lambda name, variables=layer.variables: np.asarray(variables[name]), layer.outer))
    return layers


def _torch_kind(shapes):
    weight = shapes.get("weight", ())
    if len(weight) in (3, 4, 5):
        return "depthwise" if weight[1] == 1 and weight[0] > 1 else "convolution"
    if len(weight) == 2:
        return "dense"
    return "normalization" if len(weight) == 1 else "other"


def _group_torch(tensors):
    """tensors: name -> (shape, reader). Prefixes of wrapped and parallel models are taken off."""
    for prefix in ("model.", "module."):
        if tensors and all(name.startswith(prefix) for name in tensors):
            tensors = {name.removeprefix(prefix): tensor for name, tensor in tensors.items()}
    groups = {}
    for name, tensor in tensors.items():
        owner, _, array = name.rpartition(".")
        groups.setdefault(owner or array, {})[array] = tensor
    layers = []
    for name, arrays in groups.items():
        shapes = {array: shape for array, (shape, _) in arrays.items()}
        filters = next((shape[0] for array in ("weight", *shapes) if (shape := shapes.get(array))), None)
        layers.append(Layer(name, _torch_kind(shapes), filters, shapes, lambda array, arrays=arrays: arrays[array][1]()))
    return layers


def _read_safetensors(path):
    import safetensors

    try:
        file = safetensors.safe_open(path, framework="numpy")
        names = list(file.keys())
        return _group_torch({name: (tuple(file.get_slice(name).get_shape()), lambda name=name: file.get_tensor(name))
                             for name in names})
    except safetensors.SafetensorError as error:
        raise ValueError(str(error)) from error


def load(path):
    """The layers of a file, by its suffix."""
    readers = {".h5": ("keras", _read_keras), ".keras": ("keras", _read_keras), ".safetensors": ("torch", _read_safetensors)}
    if path.suffix in _PICKLES:
        raise WeightsError(f"{path}: " + _CONVERT.format(path.name, f"{path.stem}.safetensors"))
    if path.suffix not in readers:
        raise WeightsError(f"{path}: expected one of .npz, .onnx, {', '.join(SUFFIXES)}, found {path.suffix or 'no suffix'}")
    source, read = readers[path.suffix]
    if not path.is_file():
        raise WeightsError(f"{path}: expected a weights file, found {'a folder' if path.is_dir() else 'nothing'}")
    try:
        layers = read(path)
    except Exception as error:  # noqa: BLE001  the readers raise many kinds on damaged files
        raise WeightsError(f"{path}: expected a {path.suffix} weights file, found: {_one_line(error)}") from error
    if not any(layer.shapes for layer in layers):
        raise WeightsError(f"{path}: expected a {path.suffix} weights file, found no arrays in it")
    return WeightsFile(path, source, layers)


def read_array(file, layer, name):
    """Values as float64. Error: unreadable, or not finite numbers."""
    try:
        with np.errstate(all="ignore"):
            values = np.asarray(layer.read(name)).astype(np.float64)
    except Exception as error:  # noqa: BLE001  the readers raise many kinds on damaged files
        raise WeightsError(f"{file.path}: {layer.name}.{name}: cannot read: {_one_line(error)}") from error
    if not np.all(np.isfinite(values)):
        raise WeightsError(f"{file.path}: {layer.name}.{name}: expected finite numbers, found NaN or infinity")
    return values


def _one_line(error):
    return " ".join(str(error).split()) or type(error).__name__
