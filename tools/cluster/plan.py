# SPDX-License-Identifier: MIT
"""Cuts a search into tasks: a layer's filters A to B-1 on one sequence."""

import dataclasses
import hashlib
import json
import pathlib

from stems import manifest


class ClusterError(Exception):
    """One line for the user."""


@dataclasses.dataclass(frozen=True)
class Task:
    name: str  # also of its folder
    model: str
    layer: str
    first: int
    last: int  # behind the last one
    baselines: bool  # the rows of ORB on gray and of R, G, B come with this task
    sequence: int | None = None  # index, the held-out one last; None: there is one only

    @property
    def filters(self):
        return self.last - self.first

    def arguments(self):
        """For `stemvo search`."""
        words = ["--model", self.model, "--layers", self.layer, "--filters", f"{self.first}:{self.last}", "--exhaustive",
                 "--block", str(self.filters)]  # one pass of the network per frame for the whole task
        if self.sequence is not None:
            words += ["--only-sequence", str(self.sequence)]
        return words if self.baselines else [*words, "--no-baselines"]

    def __str__(self):
        where = "" if self.sequence is None else f" on sequence {self.sequence}"
        return f"{self.layer} {self.first}:{self.last}{where}"


def _entries(path):
    if not path.is_file():
        raise ClusterError(f"{path}: expected a manifest of models, found no file")
    try:
        return [(entry["name"], entry["file"], entry["layer"], int(entry["filters"])) for entry in manifest.load(path)]
    except manifest.ManifestError as error:
        raise ClusterError(str(error)) from error
    except (TypeError, ValueError) as error:
        raise ClusterError(f"{path}: expected numbers of filters, found: {' '.join(str(error).split())}") from error


def layers_of(model, models_dir):
    """(layer, filters) of a model: its name in models_dir, or the path of an .onnx."""
    if model.endswith(".onnx"):
        file = pathlib.Path(model)
        if not file.is_file():
            raise ClusterError(f"{file}: no such file")
        found = [(layer, filters) for _, name, layer, filters in _entries(file.parent / "manifest.yaml") if name == file.name]
        known = f"an entry with 'file: {file.name}'"
    else:
        entries = _entries(models_dir / "manifest.yaml")
        found = [(layer, filters) for name, _, layer, filters in entries if name == model]
        known = f"{', '.join(sorted({entry[0] for entry in entries}))} or the path of an .onnx"
    if not found:
        raise ClusterError(f"--model: expected {known}, found '{model}'")
    return found


def _once(option, values):
    for value in values:
        if values.count(value) > 1:
            raise ClusterError(f"{option}: expected each once, found '{value}' again")


def _chosen(known, wanted):
    """Model -> its layers among those wanted, of known: model -> its layers (name, filters). Error: a layer that no model has."""
    _once("--layers", wanted or [])
    for layer in wanted or []:
        if not any(layer == name for layers in known.values() for name, _ in layers):
            raise ClusterError("--layers: expected " + "; ".join(f"{', '.join(name for name, _ in layers)} of {model}" for model, layers in known.items()) +
                               f"; found '{layer}'")
    return {model: [(name, filters) for name, filters in layers if not wanted or name in wanted] for model, layers in known.items()}


def lacking(models, models_dir, layers):
    """A line for each model that has not all of the layers."""
    lines = []
    for model in models:
        known = [layer for layer, _ in layers_of(model, models_dir)]
        missing = [layer for layer in layers or [] if layer not in known]
        if missing:
            rest = "" if len(missing) < len(layers) else "; nothing of it is searched"
            lines.append(f"--layers: {model} has {', '.join(known)}, not {', '.join(missing)}{rest}")
    return lines


def tasks_of(models, models_dir, layers=None, filters=None, per_task=32, num_sequences=1, baselines=True):
    """All tasks, in order. layers: of the models, each of those that it has. filters: (A, B) of each layer, or None.
    num_sequences: with the held-out one. baselines: once per sequence. Errors: unknown model, a layer of none, filters outside."""
    tasks = []
    _once("--model", models)
    for model, chosen in _chosen({model: layers_of(model, models_dir) for model in models}, layers).items():
        for layer, count in chosen:
            first, last = filters or (0, count)
            if not 0 <= first < last <= count:
                raise ClusterError(f"--filters: expected filters inside 0:{count} of {model} layer {layer}, found {first}:{last}")
            for start in range(first, last, per_task):
                for sequence in range(num_sequences):
                    tasks.append(Task(f"part{len(tasks):05}", model, layer, start, min(start + per_task, last),
                                      baselines and len(tasks) < num_sequences, sequence if num_sequences > 1 else None))
    return tasks


def _hash_of(path):
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None


def sequence_contents(sequence):
    """What tells whether a sequence has changed, by hash: frames, calib.txt, times.txt and the pose file."""
    folder = sequence.resolve()
    frames = [[file.parent.name, file.name, _hash_of(file)] for file in sorted(folder.glob("image_*/*")) if file.is_file()]
    texts = [folder / "calib.txt", folder / "times.txt"]
    poses = [base.parent.parent / "poses" / f"{base.name}.txt" for base in (sequence.absolute(), folder)]
    return [[_hash_of(path) for path in texts + poses], frames]


def fingerprint(tasks, arguments):
    """Of everything that says what the tasks do, so that another search is not taken for this one."""
    text = json.dumps([[dataclasses.astuple(task) for task in tasks], arguments])
    return hashlib.sha256(text.encode()).hexdigest()
