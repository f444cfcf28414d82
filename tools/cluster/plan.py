# SPDX-License-Identifier: MIT
"""Cuts a search into tasks: a model's filters A to B-1 on one sequence."""

import dataclasses
import hashlib
import json
import pathlib

from stems import metadata


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
        words = ["--model", self.model, "--filters", f"{self.first}:{self.last}", "--exhaustive", "--block", str(self.filters)]  # one pass of the network per frame for the whole task
        if self.sequence is not None:
            words += ["--only-sequence", str(self.sequence)]
        return words if self.baselines else [*words, "--no-baselines"]

    def __str__(self):
        where = "" if self.sequence is None else f" on sequence {self.sequence}"
        return f"{self.layer} {self.first}:{self.last}{where}"


def layer_of(model, models_dir):
    """Layer and number of filters of a model: its name in models_dir, or the path of an .onnx."""
    file = pathlib.Path(model) if model.endswith(".onnx") else models_dir / f"{model}.onnx"
    if not file.is_file():
        known = ", ".join(sorted(path.stem for path in models_dir.glob("*.onnx")))
        raise ClusterError(f"{file}: no such file" if model.endswith(".onnx") else
                           f"--model: expected {known} or the path of an .onnx, found '{model}'")
    try:
        said = metadata.read(file)
        return said["layer"], int(said["filters"])
    except (metadata.MetadataError, ValueError) as error:
        raise ClusterError(f"{error}") from error


def tasks_of(models, models_dir, filters=None, per_task=32, num_sequences=1, baselines=True):
    """All tasks, in order. filters: (A, B) of each model, or None. num_sequences: with the held-out one.
    baselines: once per sequence. Errors: unknown model, filters outside."""
    for model in models:
        if models.count(model) > 1:
            raise ClusterError(f"--model: expected each once, found '{model}' again")
    tasks = []
    for model in models:
        layer, count = layer_of(model, models_dir)
        first, last = filters or (0, count)
        if not 0 <= first < last <= count:
            raise ClusterError(f"--filters: expected filters inside 0:{count} of {model}, found {first}:{last}")
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
