# SPDX-License-Identifier: MIT
"""Results as a table, as a picture, and between processes."""

import copyreg
import types
from collections.abc import Iterable
from typing import Any

from . import _core

COLUMNS = _core.FRAMES_CSV_HEADER.strip().split(",")[:-2]  # without errors
MAPS = (_core.Keyframe, _core.MapChanges, _core.AdjustedKeyframe, _core.AdjustedMap)


class Kept(types.SimpleNamespace):
    """An object that was pickled: the same attributes and repr, without the library."""

    def __repr__(self) -> str:
        return self._repr


def _kept(values: dict[str, Any]) -> Kept:
    return Kept(**values)


def _members(value: Any) -> dict[str, Any]:
    kind = type(value)
    return {name: getattr(value, name) for name in dir(kind) if not name.startswith("_") and not callable(getattr(kind, name))}


def _short(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return " and ".join(map(_short, value)) if value and hasattr(value[0], "shape") and isinstance(value, tuple) else f"{len(value)} of them"
    return "x".join(map(str, value.shape)) if hasattr(value, "shape") else repr(value)


def _repr(value: Any) -> str:
    return f"{type(value).__name__}({', '.join(f'{name}: {_short(member)}' for name, member in _members(value).items())})"


def _keys(options: _core.Options) -> dict[str, str]:
    section, keys = "", {}
    for line in str(options).splitlines():
        if line.endswith(":") and not line.startswith(" "):
            section = line[:-1] + "."
        elif ": " in line and not line.strip().startswith("#"):
            key, _, text = line.partition(": ")
            keys[section + key.strip() if line.startswith(" ") else key] = text
    return keys


def _repr_options(options: _core.Options) -> str:
    """What differs from the default."""
    default = _keys(_core.Options())
    changed = {key: text for key, text in _keys(options).items() if default[key] != text}
    return f"Options({changed})"


def _reduce(value: Any) -> tuple[Any, ...]:
    return _kept, (_members(value) | {"_repr": repr(value)},)


def _reduce_camera(camera: _core.Camera) -> tuple[Any, ...]:
    return _core.Camera, (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height, camera.distortion, camera.coefficients)


for _kind in MAPS:
    setattr(_kind, "__repr__", _repr)
setattr(_core.Options, "__repr__", _repr_options)
for _kind in (_core.Result, _core.CameraSigma, *MAPS):
    copyreg.pickle(_kind, _reduce)
copyreg.pickle(_core.Camera, _reduce_camera)


def to_dataframe(results: Iterable[Any]) -> Any:
    """A pandas.DataFrame with the columns of frames.csv (docs/results.md) but for errors, and is_measured: a row per result, counted from 0."""
    import pandas

    return pandas.DataFrame([[frame, *result.csv_row, result.is_measured] for frame, result in enumerate(results)], columns=[*COLUMNS, "is_measured"])


def plot(results: Iterable[Any], truth: Any = None, ax: Any = None) -> Any:
    """Draws the path from above into matplotlib's axes, which it returns; `truth`: Nx4x4."""
    if ax is None:
        import matplotlib.pyplot

        ax = matplotlib.pyplot.figure().add_subplot()
    if truth is not None:
        ax.plot(truth[:, 0, 3], truth[:, 2, 3], color="0.6", linewidth=4, label="ground truth")
    places = [result.world_from_camera[:3, 3] for result in results]
    ax.plot([place[0] for place in places], [place[2] for place in places], label="estimate")
    ax.set(aspect="equal", adjustable="datalim", xlabel="x (right)", ylabel="z (forward)")
    ax.legend()
    return ax
