# SPDX-License-Identifier: MIT
"""Small files with the structure of Keras', written without it: name -> array."""

import io
import json
import zipfile

import h5py


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
