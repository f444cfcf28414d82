# SPDX-License-Identifier: MIT
"""Small files with the structure of Keras' and PyTorch's, written without either: name -> array."""

import collections
import io
import json
import pickle
import struct
import sys
import types
import zipfile

import h5py
import numpy as np


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


class _Array:
    def __init__(self, key, values):
        self.key, self.values = key, np.ascontiguousarray(values, "<f4")


def _torch_pickle(document, storages, *, extra=()):
    """A state dict as torch pickles it: the constructors are looked up in modules that look like torch's."""
    torch, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")

    class FloatStorage:
        pass

    def _rebuild_tensor_v2():
        pass

    for item, module in ((FloatStorage, torch), (_rebuild_tensor_v2, utils)):
        item.__module__, item.__qualname__ = module.__name__, item.__name__
        setattr(module, item.__name__, item)

    class Pickler(pickle.Pickler):
        def persistent_id(self, item):
            return ("storage", FloatStorage, item.key, "cpu", item.values.size) if isinstance(item, _Array) else None

        def reducer_override(self, item):
            if not isinstance(item, np.ndarray):
                return NotImplemented
            storages.append(_Array(str(len(storages)), item))
            strides = tuple(stride // 4 for stride in storages[-1].values.strides)
            return (_rebuild_tensor_v2, (storages[-1], 0, item.shape, strides, False, collections.OrderedDict()))

    content = io.BytesIO()
    before = {name: sys.modules.get(name) for name in ("torch", "torch._utils")}
    sys.modules.update({"torch": torch, "torch._utils": utils})
    try:
        Pickler(content, protocol=2).dump({**document, **dict(extra)})
    finally:
        for name, module in before.items():
            sys.modules.pop(name) if module is None else sys.modules.update({name: module})
    return content.getvalue()


def torch_zip(path, document, extra=()):
    storages = []
    content = _torch_pickle(document, storages, extra=extra)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("archive/data.pkl", content)
        archive.writestr("archive/byteorder", "little")
        for storage in storages:
            archive.writestr(f"archive/data/{storage.key}", storage.values.tobytes())


def torch_legacy(path, document):
    storages = []
    content = _torch_pickle(document, storages)
    with open(path, "wb") as file:
        for item in (0x1950A86A20F9469CFC6C, 1001, {"little_endian": True}):
            pickle.dump(item, file, protocol=2)
        file.write(content)
        pickle.dump([storage.key for storage in storages], file, protocol=2)
        for storage in storages:
            file.write(struct.pack("<q", storage.values.size) + storage.values.tobytes())
