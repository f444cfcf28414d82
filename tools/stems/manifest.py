# SPDX-License-Identifier: MIT
"""models/manifest.yaml: one entry per .onnx file. include/stemvo/stem/manifest.hpp reads it."""

import hashlib
import pathlib

import yaml

# In this order in the file.
KEYS = ("name", "file", "sha256", "network", "layer", "filters", "kernel", "stride", "padding",
        "default_filter", "licence", "command")
OPTIONAL = ("sampling",  # any (where it is missing) or native
            "folded")  # see folded()
_COMMENTS = {"kernel": "y, x", "padding": "top, left, bottom, right, inside the graph"}


class ManifestError(Exception):
    """One line for the user."""


def sha256(path):
    return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()


def entry(name, onnx_file, stem, *, network, layer, licence, command, default_filter=0, sampling="any"):
    """The entry of a stem (or another layer with filters, kernel, stride, padding) that has been written to onnx_file."""
    return {
        "name": name, "file": pathlib.Path(onnx_file).name, "sha256": sha256(onnx_file),
        "network": network, "layer": layer, "filters": int(stem.filters), "kernel": list(stem.kernel),
        "stride": int(stem.stride), "padding": [int(pixels) for pixels in stem.padding],
        "default_filter": int(default_filter), "licence": licence, "command": command,
    } | ({} if sampling == "any" else {"sampling": sampling})


def folded(onnx_file, filter_index, sampling):
    """For the key `folded` of an entry: a file of one filter alone, sampled every `sampling` pixels."""
    return {"filter": int(filter_index), "sampling": int(sampling), "file": pathlib.Path(onnx_file).name,
            "sha256": sha256(onnx_file)}


def load(path):
    """Entries of a manifest; none where there is no file."""
    path = pathlib.Path(path)
    if not path.exists():
        return []
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ManifestError(f"{path}: expected a manifest in YAML, found: {_one_line(error)}") from error
    models = document.get("models") if isinstance(document, dict) else None
    if not isinstance(models, list) or not all(isinstance(model, dict) for model in models):
        raise ManifestError(f"{path}: expected a list `models`, found {type(document).__name__}")
    for model in models:
        odd = sorted(set(model) - set(OPTIONAL) ^ set(KEYS), key=str)
        if odd:
            raise ManifestError(f"{path}: model {model.get('name')}: expected the keys {', '.join(KEYS)}, "
                                f"missing or unknown: {', '.join(map(str, odd))}")
    return models


def add(path, *new_entries):
    """The layers of one model: they replace the entries of its name, or are appended; the others stay as they are."""
    name = new_entries[0]["name"]
    models = load(path)
    places = [index for index, model in enumerate(models) if model["name"] == name]
    kept = [model for model in models if model["name"] != name]
    at = sum(model["name"] != name for model in models[:places[0]]) if places else len(kept)
    pathlib.Path(path).write_text(_text(kept[:at] + list(new_entries) + kept[at:]), encoding="utf-8")


def _one_line(error):
    return " ".join(str(error).split())


def _scalar(value):
    return yaml.safe_dump(value, default_flow_style=True, width=10**6).strip().removesuffix("...").strip()


def _text(models):
    lines = ["models:"]
    for model in models:
        for index, key in enumerate([key for key in (*KEYS, *OPTIONAL) if key in model]):
            comment = f"  # {_COMMENTS[key]}" if key in _COMMENTS else ""
            lines.append(f"{'  - ' if index == 0 else '    '}{key}: {_scalar(model[key])}{comment}")
    return "\n".join(lines) + "\n"
