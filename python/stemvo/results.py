# SPDX-License-Identifier: MIT
"""Results as a table, as a picture, and between processes."""

import copyreg
import types
from collections.abc import Iterable
from typing import Any

from . import _core

NUMBERS = ("timestamp", "state", "is_measured", "num_matches", "num_inliers", "scale_state", "scale_sigma", "map_id", "is_scale_new", "recognized_frame")


class Kept(types.SimpleNamespace):
    """An object that was pickled: the same attributes and repr, without the library."""

    def __repr__(self) -> str:
        return self._repr


def _kept(values: dict[str, Any]) -> Kept:
    return Kept(**values)


def _reduce(value: Any) -> tuple[Any, ...]:
    kind = type(value)
    names = [name for name in dir(kind) if not name.startswith("_") and not callable(getattr(kind, name))]
    return _kept, ({name: getattr(value, name) for name in names} | {"_repr": repr(value)},)


def _reduce_camera(camera: _core.Camera) -> tuple[Any, ...]:
    return _core.Camera, (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height, camera.distortion, camera.coefficients)


for _kind in (_core.Result, _core.CameraSigma, _core.Keyframe, _core.MapChanges, _core.AdjustedKeyframe, _core.AdjustedMap):
    copyreg.pickle(_kind, _reduce)
copyreg.pickle(_core.Camera, _reduce_camera)


def to_dataframe(results: Iterable[Any]) -> Any:
    """A pandas.DataFrame with a row per result: its numbers, and x, y, z of the camera in the world."""
    import pandas

    rows = []
    for result in results:
        x, y, z = (float(value) for value in result.world_from_camera[:3, 3])
        rows.append({name: getattr(result, name) for name in NUMBERS} | {"x": x, "y": y, "z": z})
    return pandas.DataFrame(rows, columns=[*NUMBERS, "x", "y", "z"])


def plot(results: Iterable[Any], truth: Any = None, ax: Any = None) -> Any:
    """Draws the path from above into matplotlib's axes, which it returns; `truth`: Nx4x4."""
    if ax is None:
        import matplotlib.pyplot

        ax = matplotlib.pyplot.figure().add_subplot()
    if truth is not None:
        ax.plot(truth[:, 0, 3], truth[:, 2, 3], color="0.6", linewidth=4, label="ground truth")
    places = [result.world_from_camera[:3, 3] for result in results]
    ax.plot([place[0] for place in places], [place[2] for place in places], label="estimate")
    ax.set(aspect="equal", xlabel="x (right)", ylabel="z (forward)")
    ax.legend()
    return ax
