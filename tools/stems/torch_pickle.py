# SPDX-License-Identifier: MIT
"""Reads the tensors of a .pth file (torch.save), without torch and without running what is in it.

A .pth is a pickle, and a pickle can call anything. This reader resolves no name of the file: the few
constructors of tensors are its own functions, and everything else becomes an empty object. So a
hostile file can at worst be refused. Both layouts are read: the zip of torch 1.6 and later, and the
older one (pickles and raw storages one after the other, as of many torchvision files).
Source of the layouts: torch/serialization.py (_load, _legacy_load).
"""

import collections
import math
import pickle
import struct
import zipfile

import numpy as np

_DTYPES = {"FloatStorage": "<f4", "DoubleStorage": "<f8", "HalfStorage": "<f2", "LongStorage": "<i8",
           "IntStorage": "<i4", "ShortStorage": "<i2", "CharStorage": "<i1", "ByteStorage": "<u1", "BoolStorage": "?"}
_LEGACY_MAGIC = 0x1950A86A20F9469CFC6C
_LARGEST_FILE = 8 << 30
_LONGEST_NAMES = 1 << 26  # characters of all names together, each at least _SHORTEST_NAME
_SHORTEST_NAME = 64


class _Other:
    """Stands for whatever is no tensor: takes any arguments, does nothing."""

    def __new__(cls, *_args, **_kwargs):
        return object.__new__(cls)

    def __init__(self, *_args, **_kwargs):
        pass

    def __setstate__(self, _state):
        pass

    def __call__(self, *_args, **_kwargs):
        return _Other()

    def append(self, _item):
        pass

    def extend(self, _items):
        pass

    def __setitem__(self, _key, _value):
        pass


class _Storage:
    """Numbers of one storage; `read` gives its bytes when they are wanted."""

    def __init__(self, kind, read):
        self.kind, self.read = kind, read

    def array(self):
        if self.kind == "BFloat16Storage":  # the upper half of a float32
            return (np.frombuffer(self.read(), "<u2").astype("<u4") << 16).view("<f4")
        return np.frombuffer(self.read(), _DTYPES[self.kind])


class Tensor:
    """A view into a storage, in numbers of its type."""

    def __init__(self, storage, offset, shape, strides):
        self._storage, self._offset, self._strides = storage, int(offset), tuple(map(int, strides))
        self.shape = tuple(map(int, shape))

    def array(self):
        values = self._storage.array()
        if any(size < 0 for size in self.shape + self._strides) or self._offset < 0:
            raise ValueError("a tensor with negative sizes")
        last = self._offset + sum((size - 1) * stride for size, stride in zip(self.shape, self._strides))
        if 0 not in self.shape and last >= values.size:
            raise ValueError("a tensor outside its storage")
        count = math.prod(self.shape)
        if count > values.size:  # strides of 0 make any size out of one number
            raise ValueError(f"a tensor of {count} numbers in a storage of {values.size}")
        bytes_per = values.itemsize
        return np.lib.stride_tricks.as_strided(values[self._offset:], self.shape,
                                               [stride * bytes_per for stride in self._strides]).copy()


def _rebuild_tensor(storage, offset, shape, strides, *_rest):
    return Tensor(storage, offset, shape, strides) if isinstance(storage, _Storage) else _Other()


def _rebuild_parameter(tensor, *_rest):
    return tensor


class _Kind:
    """torch.FloatStorage and the like: only a name."""

    def __init__(self, name):
        self.name = name


_KNOWN = {("collections", "OrderedDict"): collections.OrderedDict,
          ("torch._utils", "_rebuild_tensor"): _rebuild_tensor,
          ("torch._utils", "_rebuild_tensor_v2"): _rebuild_tensor,
          ("torch._utils", "_rebuild_parameter"): _rebuild_parameter}


class _Unpickler(pickle.Unpickler):
    def __init__(self, file, storage_of):
        super().__init__(file, encoding="latin-1")
        self._storage_of = storage_of

    def find_class(self, module, name):
        if module == "torch" and name.endswith("Storage"):
            return _Kind(name)
        return _KNOWN.get((module, name), _Other)

    def persistent_load(self, key):
        kind = getattr(key[1], "name", None) if isinstance(key, tuple) and len(key) > 3 and key[0] == "storage" else None
        if kind not in _DTYPES and kind != "BFloat16Storage":
            return _Other()
        return self._storage_of(kind, str(key[2]))


def _read_zip(path):
    archive = zipfile.ZipFile(path)
    names = [name for name in archive.namelist() if name == "data.pkl" or name.endswith("/data.pkl")]
    if len(names) != 1:
        raise ValueError(f"a zip with {len(names)} data.pkl")
    folder = names[0][:-len("data.pkl")]
    if folder + "byteorder" in archive.namelist() and archive.read(folder + "byteorder") != b"little":
        raise ValueError("big-endian numbers")
    with archive.open(names[0]) as file:
        return _Unpickler(file, lambda kind, key: _Storage(kind, lambda: archive.read(f"{folder}data/{key}"))).load()


def _read_legacy(path):
    with open(path, "rb") as file:
        plain = lambda: _Unpickler(file, lambda kind, key: _Other()).load()  # noqa: E731
        if plain() != _LEGACY_MAGIC:
            raise ValueError("no file of torch.save")
        plain(), plain()  # protocol, sizes of types
        storages = {}
        document = _Unpickler(file, lambda kind, key: storages.setdefault(key, _Storage(kind, None))).load()
        for key in plain():
            storage = storages.get(str(key))
            (count,) = struct.unpack("<q", file.read(8))
            size = count * (2 if storage and storage.kind == "BFloat16Storage"
                            else np.dtype(_DTYPES[storage.kind]).itemsize if storage else 0)
            if storage is None or not 0 <= size <= _LARGEST_FILE:
                raise ValueError("storages that do not fit the tensors")
            content = file.read(size)
            if len(content) != size:
                raise EOFError("the file ends inside a storage")
            storage.read = lambda content=content: content
        return document


class _Names:
    """All tensors of nested dictionaries by their dotted names. A dictionary inside itself is left out; dictionaries
    that hold each other by many names, which would give more names than there is memory, are an error."""

    def __init__(self):
        self.found = {}
        self._inside = set()  # ids of the dictionaries on the way down
        self._length = 0

    def add(self, document, prefix=""):
        self._length += max(len(prefix), _SHORTEST_NAME)
        if self._length > _LONGEST_NAMES:
            raise ValueError("dictionaries that give too many names")
        if isinstance(document, Tensor):
            self.found[prefix] = document
        elif isinstance(document, dict) and len(self._inside) < 8 and id(document) not in self._inside:
            self._inside.add(id(document))
            for key, value in document.items():
                if isinstance(key, str):
                    self.add(value, f"{prefix}.{key}" if prefix else key)
            self._inside.remove(id(document))


def read(path):
    """Name -> Tensor, of all nested dictionaries ("model.conv1.weight"). Raises what pickle, zipfile and
    numpy raise on a broken file."""
    document = _read_zip(path) if zipfile.is_zipfile(path) else _read_legacy(path)
    names = _Names()
    names.add(document)
    return names.found
