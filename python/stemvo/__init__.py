# SPDX-License-Identifier: MIT
"""Monocular visual odometry: images in, poses out (docs/python.md)."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from . import _core
from ._core import (AdjustedKeyframe, AdjustedMap, Camera, CameraSigma, Channel, ChannelOdometry, FrameView, Keyframe, MapChanges, Options,
                    PatchTracker, Recording, Result, SeenImage, Stem, __version__, align, dense_errors, evaluate, pair_by_time, read_recording, read_trajectory, rescale_steps, segment_errors)
from .results import Kept, plot, to_dataframe

__all__ = [
    "AdjustedKeyframe", "AdjustedMap", "Camera", "CameraSigma", "Channel", "ChannelOdometry", "FrameView", "Kept", "Keyframe", "MapChanges", "Odometry", "Options",
    "PatchTracker", "Recording", "Result", "SeenImage", "Stem", "__version__", "align", "dense_errors", "evaluate",
    "pair_by_time", "plot", "read_recording", "read_trajectory", "rescale_steps", "segment_errors", "to_dataframe",
]


class Odometry(_core.Odometry):
    """Images in, poses out."""

    FRAMES_AHEAD = 6  # at work at a time

    def run(self, frames: Iterable[Sequence[Any]]) -> Iterator[Result]:
        """Yields what process() would return for each frame, while the next six are read and worked on. A frame is
        (image, timestamp), or more of process()'s arguments; without an image (None) it is left out. What `frames`
        raises, or a frame that is refused, comes after the results before it. Until this ends (a loop that is left ends
        it) process() is refused; then frames already read count as processed."""
        if number := self._num_at_work:
            raise ValueError(f"run: expected a run that is over, found one with {number} frames at work")
        source, ended = iter(frames), None
        try:
            while ended is None or self._num_at_work:
                try:
                    while ended is None and self._num_at_work < self.FRAMES_AHEAD:
                        frame = next(source)
                        if frame[0] is not None:
                            self._push(*frame)
                except Exception as error:
                    ended = error
                if self._num_at_work:
                    yield self._take()
            if not isinstance(ended, StopIteration):
                raise ended
        finally:
            ended = None  # whose traceback holds this frame
            while self._num_at_work:
                self._take()
