# SPDX-License-Identifier: MIT
"""Reads the variables of Keras files: layer -> its class, and name of the variable -> dataset.

Three layouts (source: keras/src/saving, keras/src/legacy/saving/legacy_h5_format.py):
- .h5 of whole models and of the weights that keras.applications downloads: a group per layer, names as in
  the network; the attribute `layer_names` lists all layers, also those without weights;
- .weights.h5 of Keras 3: groups layers/CLASS, layers/CLASS_1, .. in the network's order, variables 0, 1, ..;
- .keras: a zip of the second, with config.json that has the names.
"""

import dataclasses
import io
import json
import re
import zipfile

import h5py

# Order of the variables in Keras 3.
_VARIABLES = {"conv2d": ("kernel", "bias"), "conv2d_transpose": ("kernel", "bias"), "depthwise_conv2d": ("kernel", "bias"), "dense": ("kernel", "bias"),
              "separable_conv2d": ("depthwise_kernel", "pointwise_kernel", "bias"),
              "layer_normalization": ("gamma", "beta"),
              "batch_normalization": ("gamma", "beta", "moving_mean", "moving_variance")}


@dataclasses.dataclass
class Layer:
    name: str
    kind: str  # class in snake case; "" where the file does not say
    variables: dict = dataclasses.field(default_factory=dict)  # name -> h5py dataset
    filters: int | None = None  # of its output, where the file has the network's configuration
    outer: str = ""  # the nested model it is a layer of


def snake_case(name):
    """As Keras names a class in files: BatchNormalization -> batch_normalization, Conv2D -> conv2d."""
    name = re.sub(r"\W+", "", name)
    name = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", name)
    return re.sub(r"([a-z])([A-Z])", r"\1_\2", name).lower()


def _datasets(group):
    found = []
    group.visititems(lambda name, item: found.append((name, item)) if isinstance(item, h5py.Dataset) else None)
    return found


def _text(value):
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _layer_names(group):
    """The attribute `layer_names`; a long one is cut into layer_names0, layer_names1, .. Empty where there is none."""
    if "layer_names" in group.attrs:
        return list(map(_text, group.attrs["layer_names"]))
    names, index = [], 0
    while f"layer_names{index}" in group.attrs:
        names += map(_text, group.attrs[f"layer_names{index}"])
        index += 1
    return names


def _read_named(group):
    """One group per layer. A nested model's layers are found by the folder that holds their variables."""
    layers = []
    for name in _layer_names(group):
        layer = Layer(name, "")
        nested = {}
        for path, dataset in _datasets(group[name]) if name in group else []:
            *folders, variable = path.split("/")
            owner = folders[-1] if folders else name
            nested.setdefault(owner, Layer(owner, "", outer=name)).variables[variable.split(":")[0]] = dataset
        inner = [item for owner, item in nested.items() if owner != name and len(nested) > 1]
        layer.variables = nested[name].variables if name in nested else {}
        if len(nested) == 1:
            layer.variables = next(iter(nested.values())).variables
        layers += [layer, *inner]
    return layers


def _read_numbered(group, names, prefix=""):
    """names: path in the file -> the network's name, from config.json; empty where there is none."""
    layers = []
    for key in group:
        kind = re.sub(r"_\d+$", "", key)
        path = f"{prefix}{key}"
        outer = prefix.rstrip("/")
        layer = Layer(names.get(path, path), kind, outer=names.get(outer, outer))
        variables = group[key].get("vars", {})
        known = _VARIABLES.get(kind, ())
        for index in sorted(variables, key=lambda text: int(text) if text.isdigit() else 0):
            place = int(index) if index.isdigit() else -1
            layer.variables[known[place] if 0 <= place < len(known) else index] = variables[index]
        layers.append(layer)
        if "layers" in group[key]:
            layers += _read_numbered(group[key]["layers"], names, f"{path}/")
    return layers


def names_in_config(config, prefix=""):
    """Path in the weights file -> the network's name, from the list of layers in the network's order."""
    names, counts = {}, {}
    for item in config.get("layers", []):
        kind = snake_case(item["class_name"])
        number = counts.get(kind, 0)
        counts[kind] = number + 1
        path = f"{prefix}{kind}_{number}" if number else f"{prefix}{kind}"
        names[path] = item["config"].get("name", path)
        names |= names_in_config(item["config"], f"{path}/")
    return names


def _tensors_in(value):
    """The (layer, shape) that a configuration in Keras 3's words says a layer takes."""
    if isinstance(value, list):
        for item in value:
            yield from _tensors_in(item)
    elif isinstance(value, dict):
        if value.get("class_name") == "__keras_tensor__":
            yield value["config"]["keras_history"][0], value["config"]["shape"]
        for item in value.values():
            yield from _tensors_in(item)


def outputs_in_config(config):
    """Layer -> its filters, as the layers behind it say."""
    found = {}
    for item in config.get("layers", []):
        for layer, shape in _tensors_in(item.get("inbound_nodes", [])):
            found[layer] = shape[-1]
        shape = item["config"].get("batch_shape")
        if shape:
            found.setdefault(item["config"]["name"], shape[-1])
        found |= outputs_in_config(item["config"])
    return found


def _with_config(layers, config):
    """All layers of the configuration, in its order, with their filters."""
    names, outputs = names_in_config(config), outputs_in_config(config)
    by_name = {layer.name: layer for layer in layers}
    for path, name in names.items():
        layer = by_name.setdefault(name, Layer(name, ""))
        layer.kind = re.sub(r"_\d+$", "", path.split("/")[-1])
        layer.outer = names.get(path.rpartition("/")[0], "")
        layer.filters = outputs.get(name)
    order = {name: index for index, name in enumerate(names.values())}
    return sorted(by_name.values(), key=lambda layer: order.get(layer.name, len(order)))


def read(path):
    """The layers, in the network's order where the file knows it. Raises what h5py, zipfile and json raise."""
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            config = json.loads(archive.read("config.json"))["config"]
            file = h5py.File(io.BytesIO(archive.read("model.weights.h5")), "r")
        return _with_config(_read_numbered(file["layers"], names_in_config(config)), config)
    file = h5py.File(path, "r")
    group = file.get("model_weights", file)
    if _layer_names(group):
        layers = _read_named(group)
        config = file.attrs.get("model_config")
        return layers if config is None else _with_config(layers, json.loads(_text(config))["config"])
    if "layers" in group:
        return _read_numbered(group["layers"], {})
    raise ValueError(f"groups {', '.join(list(group)[:5]) or 'none'}, not those of a Keras file")
