# SPDX-License-Identifier: MIT
"""What the program is linked with."""

import os
import pathlib
import re
import subprocess

PROGRAM = pathlib.Path(os.environ["STEMVO_PROGRAM"])
MODULE = PROGRAM.parent / "libstemvo_video.so"
MARKERS = PROGRAM.parent / "libstemvo_markers.so"


def needed_by(binary):
    return subprocess.run(["readelf", "--dynamic", "--wide", binary], check=True, capture_output=True, text=True).stdout


def test_what_only_videos_and_markers_need_is_no_dependency():
    assert "videoio" not in needed_by(PROGRAM) and "videoio" in needed_by(MODULE)
    assert not any(re.search("aruco|objdetect", needed_by(binary)) for binary in (PROGRAM, MARKERS))
