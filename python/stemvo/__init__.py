# SPDX-License-Identifier: MIT
"""Monocular visual odometry: images in, poses out (docs/python.md)."""

from ._core import Camera, CameraSigma, FrameView, Odometry, Options, Recording, Result, __version__, align, evaluate, read_recording

__all__ = ["Camera", "CameraSigma", "FrameView", "Odometry", "Options", "Recording", "Result", "__version__", "align", "evaluate", "read_recording"]
