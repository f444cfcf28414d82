# SPDX-License-Identifier: MIT
"""Monocular visual odometry: images in, poses out (docs/python.md)."""

from ._core import Camera, Odometry, Options, Recording, Result, __version__, evaluate, read_recording

__all__ = ["Camera", "Odometry", "Options", "Recording", "Result", "__version__", "evaluate", "read_recording"]
