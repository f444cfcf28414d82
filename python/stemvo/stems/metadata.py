# SPDX-License-Identifier: MIT
"""What a model file says of itself, in its metadata (`stemvo.kernel` ..). src/stem/model.cpp reads it."""

import pathlib

import onnx
from google.protobuf.message import DecodeError

from . import onnx_writer

KEYS = ("network", "layer", "filters", "kernel", "stride", "padding", "default_filter", "licence", "command")
OPTIONAL = ("sampling",  # any (where it is missing) or native
            "filter")  # the one filter of `filters` that the file holds


def write(path, model, stem, *, network, layer, licence, command, default_filter=0, sampling="any", only_filter=None, filters=None):
    """Writes the model of a stem (or of another layer with filters, kernel, stride, padding) with its metadata, which is
    returned. only_filter: the model holds this one alone, of `filters`."""
    values = {"network": network, "layer": layer, "filters": filters or stem.filters, "kernel": stem.kernel, "stride": stem.stride,
              "padding": stem.padding, "default_filter": default_filter, "licence": licence, "command": command}
    values |= {} if sampling == "any" else {"sampling": sampling}
    values |= {} if only_filter is None else {"filter": only_filter}
    values = {key: " ".join(str(int(number)) for number in value) if isinstance(value, (tuple, list)) else str(value)
              for key, value in values.items()}
    onnx.helper.set_model_props(model, {f"stemvo.{key}": value for key, value in values.items()})
    pathlib.Path(path).write_bytes(onnx_writer.to_bytes(model))
    return values


def read(path):
    """key -> text. Errors: no model, or one without metadata."""
    try:
        model = onnx.load(path, load_external_data=False)
    except (OSError, DecodeError) as error:
        raise ValueError(f"{path}: expected an .onnx file, found: {' '.join(str(error).split())[:200]}") from error
    values = {prop.key.removeprefix("stemvo."): prop.value for prop in model.metadata_props if prop.key.startswith("stemvo.")}
    missing = [key for key in KEYS if key not in values]
    if missing:
        raise ValueError(f"{path}: expected metadata stemvo.{missing[0]}, found none; `stemvo-lab export` writes files that have it")
    return values
